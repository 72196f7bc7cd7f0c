//! Every citation in code, tests and documents leads to a file and a section that are there.
//!
//! A citation is a name of the list [`WORKS`] with its places behind it (`sercos2.md 1.6, 2.4`), a G-number, a Markdown link, the name of a
//! document, or a path in backquotes. The test reads them as a reader does: across the ends of comment lines.

mod library;
mod place;
mod text;

use library::Library;
use place::{Place, g_numbers, places_after};
use std::path::Path;
use text::Text;

/// What is cited with places behind it.
const WORKS: [&str; 5] = ["sercos2.md", "sercon816.md", "IGS", "Gao", "RM0090"];

/// What is wrong with the citations of a file, each as one line with path and line number.
fn wrong(text: &Text, library: &Library) -> Vec<String> {
    let mut wrong = Vec::new();
    let mut tell = |offset: usize, what: String| wrong.push(format!("{}:{}: {what}", text.path, text.line(offset)));
    for work in WORKS {
        for (offset, places) in places_after(&text.content, work) {
            for place in places.iter().filter(|place| !library.has(work, place)) {
                tell(offset, format!("`{work} {place}` leads nowhere"));
            }
        }
    }
    for (offset, number) in g_numbers(&text.content) {
        if !library.has("sercon816.md", &Place::Open(number)) {
            tell(offset, format!("G{number} is no row of sercon816.md 14"));
        }
    }
    for (offset, name) in text.documents() {
        if !library.has_document(name) {
            tell(offset, format!("there is no document {name}"));
        }
    }
    for (offset, target) in text.links() {
        if let Err(cause) = library.follow(&text.path, target) {
            tell(offset, cause);
        }
    }
    for (offset, path) in text.quoted_paths() {
        if !library.has_path(path) {
            tell(offset, format!("`{path}` is not in the repository"));
        }
    }
    for (offset, own) in text.own_sections() {
        if !library.has(text.name(), &own) {
            tell(offset, format!("section {own} is not in this document"));
        }
    }
    wrong
}

/// Everything that is read, by path from the root of the repository.
fn texts(root: &Path) -> Vec<Text> {
    let mut texts = Vec::new();
    for entry in ["firmware", "board", "tests", "fuzz", "docs"] {
        collect(root, &root.join(entry), &mut texts);
    }
    for entry in std::fs::read_dir(root).unwrap() {
        let path = entry.unwrap().path();
        if path.is_file() {
            texts.extend(Text::read(root, &path));
        }
    }
    texts
}

fn collect(root: &Path, folder: &Path, texts: &mut Vec<Text>) {
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            if path.file_name().is_some_and(|name| name != "target" && name != "corpus") {
                collect(root, &path, texts);
            }
        } else {
            texts.extend(Text::read(root, &path));
        }
    }
}

#[test]
fn every_citation_leads_to_a_file_and_a_section_that_are_there() {
    let root = crate::workspace::root();
    let texts = texts(root);
    let library = Library::open(root, &texts);
    let cited: usize = texts
        .iter()
        .flat_map(|text| WORKS.map(|work| places_after(&text.content, work)))
        .flatten()
        .map(|(_, places)| places.len())
        .sum();
    let wrong: Vec<String> = texts.iter().flat_map(|text| wrong(text, &library)).collect();
    println!("{cited} places cited in {} files", texts.len());
    assert!(wrong.is_empty(), "{} citations lead nowhere:\n{}", wrong.len(), wrong.join("\n"));
    // A reader that finds nothing would be content with everything.
    assert!(cited > 350, "only {cited} places were found");
}

#[test]
fn a_citation_that_leads_nowhere_is_told_with_its_file_and_line() {
    let root = crate::workspace::root();
    let library = Library::open(root, &texts(root));
    let told = |name: &str, content: &str| wrong(&Text::new(name, content), &library);
    assert_eq!(
        told("a.rs", "/// Bits (sercos2.md 1.6, 2.4 and 3.1; sercon816.md 6.4, G20; IGS 4.2.2.1 a, f).\n"),
        [""; 0]
    );
    assert_eq!(told("a.rs", "\n/// As in sercos2.md\n/// 1.19).\n"), ["a.rs:2: `sercos2.md 1.19` leads nowhere"]);
    assert_eq!(told("a.rs", "// sercos2.md 1.6, 12\n"), ["a.rs:1: `sercos2.md 12` leads nowhere"]);
    assert_eq!(told("a.rs", "// sercon816.md 2EH\n"), ["a.rs:1: `sercon816.md 2EH` leads nowhere"]);
    assert_eq!(told("a.rs", "// IGS 4.2.2.2 d\n"), ["a.rs:1: `IGS 4.2.2.2 d` leads nowhere"]);
    assert_eq!(told("a.rs", "// Gao table 3, IGS table 1\n"), ["a.rs:1: `Gao table 3` leads nowhere"]);
    assert_eq!(told("a.rs", "// RM0090, 17.4.99\n"), ["a.rs:1: `RM0090 17.4.99` leads nowhere"]);
    assert_eq!(told("a.rs", "// open: G99\n"), ["a.rs:1: G99 is no row of sercon816.md 14"]);
    assert_eq!(told("a.md", "See DESIGN.md."), ["a.md:1: there is no document DESIGN.md"]);
    assert_eq!(told("a.md", "[x](NOTES.md#nowhere)"), ["a.md:1: NOTES.md has no heading #nowhere"]);
    assert_eq!(told("a.md", "[x](docs/none.svg)"), ["a.md:1: docs/none.svg is not in the repository"]);
    assert_eq!(told("a.md", "in `firmware/none.rs`"), ["a.md:1: `firmware/none.rs` is not in the repository"]);
    assert_eq!(
        told("docs/reference/sercos2.md", "see §1.77 and section 2.1"),
        ["docs/reference/sercos2.md:1: section 1.77 is not in this document"]
    );
}
