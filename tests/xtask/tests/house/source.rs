//! The source of a crate as a tree of modules: what each defines, what it imports, what it names.

use std::collections::BTreeMap;

use proc_macro2::{TokenStream, TokenTree};
use syn::visit::{self, Visit};
use syn::{Item, UseTree, Visibility};

/// The names on the way to a module or to something in it.
pub(crate) type Path = Vec<String>;

/// One file of a crate, by its place below `src`.
pub(crate) type File = String;

/// What a name stands for in a module.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Binding {
    /// Defined here.
    Item,
    /// A module below this one.
    Module,
    /// Imported, by the path that its `use` has.
    Import(Path),
}

/// A path that the code names.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Mention {
    pub(crate) path: Path,
    /// It is that of a `use`.
    pub(crate) import: bool,
    /// It passes a name on to others: `pub use`.
    pub(crate) passes_on: bool,
}

/// A module, inline or a file of its own.
#[derive(Clone, Debug, Default)]
pub(crate) struct Module {
    pub(crate) file: File,
    /// Compiled for tests only.
    pub(crate) test: bool,
    pub(crate) names: BTreeMap<String, Binding>,
    /// Modules whose names are all imported.
    pub(crate) globs: Vec<Path>,
    pub(crate) mentions: Vec<Mention>,
}

/// A crate.
#[derive(Clone, Debug)]
pub(crate) struct Crate {
    /// By their path in the crate; the root is the empty one.
    pub(crate) modules: BTreeMap<Path, Module>,
}

impl Crate {
    /// Reads a crate from its root on. `read` gives the text of a file, `None` if there is none.
    pub(crate) fn read(root: &str, read: &dyn Fn(&str) -> Option<String>) -> Self {
        let mut this = Self { modules: BTreeMap::new() };
        this.read_file(root, "", &Path::new(), false, read);
        this
    }

    /// `folder`: where the files of its modules are, with a slash at its end.
    fn read_file(&mut self, file: &str, folder: &str, path: &Path, test: bool, read: &dyn Fn(&str) -> Option<String>) {
        let text = read(file).unwrap_or_else(|| panic!("{file} is missing"));
        let parsed = syn::parse_file(&text).unwrap_or_else(|error| panic!("{file} cannot be read: {error}"));
        self.read_module(&parsed.items, file, folder, path, test, read);
    }

    fn read_module(
        &mut self,
        items: &[Item],
        file: &str,
        folder: &str,
        path: &Path,
        test: bool,
        read: &dyn Fn(&str) -> Option<String>,
    ) {
        let mut module = Module { file: file.into(), test, ..Module::default() };
        for item in items {
            let only_for_tests = test || is_for_tests(attributes(item));
            if let Item::Mod(below) = item {
                let name = below.ident.to_string();
                let below_path: Path = path.iter().cloned().chain([name.clone()]).collect();
                let inner = format!("{folder}{name}/");
                if below.attrs.iter().any(|attribute| attribute.path().is_ident("path")) {
                    assert!(only_for_tests, "#[path] in {file}");
                    continue;
                }
                match &below.content {
                    Some((_, items)) => self.read_module(items, file, &inner, &below_path, only_for_tests, read),
                    None => {
                        let beside = format!("{folder}{name}.rs");
                        let chosen = if read(&beside).is_some() { beside } else { format!("{inner}mod.rs") };
                        self.read_file(&chosen, &inner, &below_path, only_for_tests, read);
                    }
                }
                module.names.insert(name, Binding::Module);
                continue;
            }
            if only_for_tests && !test {
                continue;
            }
            module.define(item);
            if let Item::Use(item) = item {
                let passes_on = !matches!(item.vis, Visibility::Inherited);
                module.import(&item.tree, &Path::new(), passes_on);
            } else {
                Mentions(&mut module.mentions).visit_item(item);
            }
        }
        self.modules.insert(path.clone(), module);
    }
}

impl Module {
    fn define(&mut self, item: &Item) {
        let name = match item {
            Item::Const(item) => &item.ident,
            Item::Enum(item) => &item.ident,
            Item::Fn(item) => &item.sig.ident,
            Item::Static(item) => &item.ident,
            Item::Struct(item) => &item.ident,
            Item::Trait(item) => &item.ident,
            Item::Type(item) => &item.ident,
            Item::Union(item) => &item.ident,
            Item::Macro(item) => {
                if let Some(name) = &item.ident {
                    self.names.insert(name.to_string(), Binding::Item);
                } else {
                    self.define_in_macro(&item.mac.tokens);
                }
                return;
            }
            _ => return,
        };
        self.names.insert(name.to_string(), Binding::Item);
    }

    /// What a macro makes of its words is not known; what looks like a definition is taken for one.
    fn define_in_macro(&mut self, tokens: &TokenStream) {
        let mut defines = false;
        for token in tokens.clone() {
            match token {
                TokenTree::Ident(word) if defines => {
                    self.names.insert(word.to_string(), Binding::Item);
                    defines = false;
                }
                TokenTree::Ident(word) => {
                    let word = word.to_string();
                    defines =
                        ["struct", "enum", "fn", "const", "static", "type", "trait", "union"].contains(&word.as_str());
                }
                _ => defines = false,
            }
        }
    }

    fn import(&mut self, tree: &UseTree, before: &Path, passes_on: bool) {
        let with = |name: &syn::Ident| before.iter().cloned().chain([name.to_string()]).collect::<Path>();
        match tree {
            UseTree::Path(part) => self.import(&part.tree, &with(&part.ident), passes_on),
            UseTree::Group(group) => group.items.iter().for_each(|tree| self.import(tree, before, passes_on)),
            UseTree::Glob(_) => self.globs.push(before.clone()),
            UseTree::Name(name) if name.ident == "self" => {
                let last = before.last().cloned().unwrap_or_default();
                self.bind(last, before.clone(), passes_on);
            }
            UseTree::Name(name) => self.bind(name.ident.to_string(), with(&name.ident), passes_on),
            UseTree::Rename(name) => self.bind(name.rename.to_string(), with(&name.ident), passes_on),
        }
    }

    fn bind(&mut self, name: String, path: Path, passes_on: bool) {
        self.mentions.push(Mention { path: path.clone(), import: true, passes_on });
        self.names.insert(name, Binding::Import(path));
    }
}

/// Collects the paths of an item.
struct Mentions<'m>(&'m mut Vec<Mention>);

impl Mentions<'_> {
    fn add(&mut self, path: Path) {
        self.0.push(Mention { path, import: false, passes_on: false });
    }

    /// Words with colons between them.
    fn words(&mut self, tokens: TokenStream) {
        let mut path = Path::new();
        let mut colons = 0;
        for token in tokens {
            match token {
                TokenTree::Punct(mark) if mark.as_char() == ':' && !path.is_empty() => {
                    colons += 1;
                    continue;
                }
                TokenTree::Ident(word) if colons == 2 || path.is_empty() => path.push(word.to_string()),
                TokenTree::Ident(word) => {
                    self.add(std::mem::take(&mut path));
                    path.push(word.to_string());
                }
                TokenTree::Group(group) => {
                    if !path.is_empty() {
                        self.add(std::mem::take(&mut path));
                    }
                    self.words(group.stream());
                }
                _ if !path.is_empty() => self.add(std::mem::take(&mut path)),
                _ => {}
            }
            colons = 0;
        }
        if !path.is_empty() {
            self.add(path);
        }
    }
}

impl<'ast> Visit<'ast> for Mentions<'_> {
    fn visit_path(&mut self, path: &'ast syn::Path) {
        self.add(path.segments.iter().map(|segment| segment.ident.to_string()).collect());
        visit::visit_path(self, path);
    }

    fn visit_macro(&mut self, macro_call: &'ast syn::Macro) {
        self.visit_path(&macro_call.path);
        self.words(macro_call.tokens.clone());
    }

    fn visit_attribute(&mut self, _: &'ast syn::Attribute) {}

    fn visit_visibility(&mut self, _: &'ast Visibility) {}

    /// In a function; those of a module are taken by [`Module::import`].
    fn visit_item_use(&mut self, item: &'ast syn::ItemUse) {
        let mut local = Module::default();
        local.import(&item.tree, &Path::new(), false);
        self.0.append(&mut local.mentions);
    }

    fn visit_impl_item(&mut self, item: &'ast syn::ImplItem) {
        let attributes = match item {
            syn::ImplItem::Const(item) => &item.attrs,
            syn::ImplItem::Fn(item) => &item.attrs,
            _ => return visit::visit_impl_item(self, item),
        };
        if !is_for_tests(attributes) {
            visit::visit_impl_item(self, item);
        }
    }
}

fn is_for_tests(attributes: &[syn::Attribute]) -> bool {
    attributes.iter().any(|attribute| {
        attribute.path().is_ident("cfg")
            && attribute.parse_args::<syn::Path>().is_ok_and(|condition| condition.is_ident("test"))
    })
}

fn attributes(item: &Item) -> &[syn::Attribute] {
    match item {
        Item::Const(item) => &item.attrs,
        Item::Enum(item) => &item.attrs,
        Item::Fn(item) => &item.attrs,
        Item::Impl(item) => &item.attrs,
        Item::Macro(item) => &item.attrs,
        Item::Mod(item) => &item.attrs,
        Item::Static(item) => &item.attrs,
        Item::Struct(item) => &item.attrs,
        Item::Trait(item) => &item.attrs,
        Item::Type(item) => &item.attrs,
        Item::Use(item) => &item.attrs,
        _ => &[],
    }
}
