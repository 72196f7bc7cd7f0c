//! From a path in the code to the file that defines what it names, through whatever passes the name on.

use std::collections::{BTreeMap, BTreeSet};

use super::source::{Binding, Crate, File, Mention, Module, Path};

/// What a path leads to.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Found {
    /// Defined in this file.
    file: File,
    /// Modules on the way in which the name is not defined but imported itself; without the one that names it.
    passed_on_by: Vec<Path>,
}

/// The files that each file of a crate needs: for each of them the name by which it first does.
pub(crate) type Needs = BTreeMap<File, BTreeMap<File, String>>;

impl Crate {
    /// Which file names something of which other one. Tests may name what they like, and who passes a name on does not need it.
    pub(crate) fn needs(&self) -> Needs {
        let mut needs = Needs::new();
        for (path, module) in self.modules.iter().filter(|(_, module)| !module.test) {
            let from = needs.entry(module.file.clone()).or_default();
            for mention in module.mentions.iter().filter(|mention| !mention.passes_on) {
                if let Some(found) = self.follow(path, &mention.path).filter(|found| found.file != module.file) {
                    from.entry(found.file).or_insert_with(|| mention.path.join("::"));
                }
            }
        }
        needs
    }

    /// What is named through a module that has it from another one: `file: path`. Of all modules, or only through the root of the crate.
    pub(crate) fn detours(&self, only_through_the_root: bool) -> BTreeSet<String> {
        let mut detours = BTreeSet::new();
        for (path, module) in &self.modules {
            for mention in &module.mentions {
                let by_an_import = mention.path.first().and_then(|first| module.names.get(first));
                if !mention.import && matches!(by_an_import, Some(Binding::Import(_))) {
                    continue;
                }
                let Some(found) = self.follow(path, &mention.path) else { continue };
                // Who imports what its parent has imported for itself may do so in tests: that is what they are below it for.
                let allowed = |by: &Path| (module.test && !by.is_empty() && path.starts_with(by)) || by == path;
                if found.passed_on_by.iter().any(|by| !allowed(by) && (by.is_empty() || !only_through_the_root)) {
                    detours.insert(format!("{}: {}", module.file, mention.path.join("::")));
                }
            }
        }
        detours
    }

    /// Other crates of these that this one names.
    pub(crate) fn names_of<'c>(&self, crates: &[&'c str]) -> BTreeSet<&'c str> {
        let mut named = BTreeSet::new();
        for module in self.modules.values() {
            for Mention { path, .. } in &module.mentions {
                let first = path.first().map_or("", String::as_str);
                if path.len() > 1 && !module.names.contains_key(first) {
                    named.extend(crates.iter().filter(|name| **name == first));
                }
            }
            for glob in &module.globs {
                named.extend(crates.iter().filter(|name| glob.first().is_some_and(|first| first == *name)));
            }
        }
        named
    }

    /// Where a path leads that the module at `from` names; `None`: out of the crate, or to something local.
    fn follow(&self, from: &Path, path: &[String]) -> Option<Found> {
        self.follow_names(from, path, 0)
    }

    fn follow_names(&self, from: &Path, path: &[String], depth: u32) -> Option<Found> {
        // Modules that import each other's names.
        if depth > 32 {
            return None;
        }
        let mut at = from.clone();
        let mut rest = path;
        while let [first, others @ ..] = rest {
            match first.as_str() {
                "crate" => at.clear(),
                "self" => {}
                "super" => drop(at.pop()?),
                _ => break,
            }
            rest = others;
        }
        let started = rest.len() < path.len();
        let [name, below @ ..] = rest else { return None };
        let module = self.modules.get(&at)?;
        match self.binding(&at, module, name, depth) {
            Some((_, Binding::Module)) if below.is_empty() => None,
            Some((at, Binding::Module)) => {
                let inner: Path = at.into_iter().chain([name.clone()]).collect();
                self.follow_names(&inner, &[&["self".into()], below].concat(), depth + 1)
            }
            Some((at, Binding::Item)) => {
                Some(Found { file: self.modules.get(&at)?.file.clone(), passed_on_by: vec![] })
            }
            Some((at, Binding::Import(import))) => {
                let whole = [&import[..], below].concat();
                // A `use` of its own name is that of another crate.
                if whole == path && at == *from {
                    return None;
                }
                let mut found = self.follow_names(&at, &whole, depth + 1)?;
                if !self.is_module(&at, &import) && (started || at != *from) {
                    found.passed_on_by.push(at);
                }
                Some(found)
            }
            // In a module of this crate it must be: a macro has made it.
            None if started => Some(Found { file: module.file.clone(), passed_on_by: vec![] }),
            None => None,
        }
    }

    /// An import of a module only shortens a path.
    fn is_module(&self, from: &Path, path: &[String]) -> bool {
        let mut at = from.clone();
        for name in path {
            match name.as_str() {
                "crate" => at.clear(),
                "self" => {}
                "super" => drop(at.pop()),
                _ => at.push(name.clone()),
            }
        }
        self.modules.contains_key(&at)
    }

    /// What a name stands for in a module, by its own names or by those that it imports with a star; and the module that says so.
    fn binding(&self, at: &Path, module: &Module, name: &str, depth: u32) -> Option<(Path, Binding)> {
        if let Some(binding) = module.names.get(name) {
            return Some((at.clone(), binding.clone()));
        }
        if depth > 32 {
            return None;
        }
        module.globs.iter().find_map(|glob| {
            let whole = self.place(at, glob)?;
            let other = self.modules.get(&whole)?;
            if whole == *at { None } else { self.binding(&whole, other, name, depth + 1) }
        })
    }

    /// The module at the end of a path of modules.
    fn place(&self, from: &Path, path: &[String]) -> Option<Path> {
        let mut at = from.clone();
        for name in path {
            match name.as_str() {
                "crate" => at.clear(),
                "self" => {}
                "super" => drop(at.pop()?),
                _ => at.push(name.clone()),
            }
        }
        self.modules.contains_key(&at).then_some(at)
    }
}

/// The files that need each other, directly or around; each circle in the order of the names.
pub(crate) fn circles(needs: &Needs) -> BTreeSet<Vec<File>> {
    let reached: BTreeMap<&File, BTreeSet<&File>> =
        needs.keys().map(|file| (file, reached_from(needs, file))).collect();
    let reaches = |from: &File, to: &File| reached.get(from).is_some_and(|files| files.contains(to));
    needs
        .keys()
        .filter(|file| reaches(file, file))
        .map(|file| needs.keys().filter(|other| reaches(file, other) && reaches(other, file)).cloned().collect())
        .collect()
}

fn reached_from<'n>(needs: &'n Needs, start: &'n File) -> BTreeSet<&'n File> {
    let mut reached = BTreeSet::new();
    let mut next = vec![start];
    while let Some(file) = next.pop() {
        for other in needs.get(file).into_iter().flat_map(BTreeMap::keys) {
            if reached.insert(other) {
                next.push(other);
            }
        }
    }
    reached
}

/// The names that tie a circle: `from needs to for name`.
pub(crate) fn ties(needs: &Needs, circle: &[File]) -> Vec<String> {
    let mut ties = Vec::new();
    for from in circle {
        for (to, name) in needs.get(from).into_iter().flatten() {
            if circle.contains(to) {
                ties.push(format!("{from} needs {to} for {name}"));
            }
        }
    }
    ties
}
