//! The parts of [`Motion`](super::Motion) keep their fields to themselves, and the manual of them names each.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::string::String;
use std::vec::Vec;
use std::{format, fs};

/// Structs that only carry values from one part to another, or out of the drive: nothing is kept in them, so that nothing can be changed
/// behind a part's back.
const VALUES: [&str; 5] = [
    // Put together by the supervision for one look of `Status`.
    "Look",
    // Results of one tick or step, acted on at once.
    "HomingStep",
    "PositioningStep",
    "Step",
    // All values of one instant, for the oscilloscope.
    "Values",
];

/// A struct of the source: its file, and which of its fields others can reach.
#[derive(Debug, PartialEq, Eq)]
struct Found {
    file: String,
    open: Vec<String>,
}

/// The structs of a source that `cargo fmt` has been over.
fn structs(file: &str, source: &str) -> Vec<(String, Found)> {
    let mut found = Vec::new();
    let mut lines = source.lines();
    while let Some(line) = lines.next() {
        let item = line.trim_start();
        let item = if item.starts_with("pub") { item.split_once(' ').map_or("", |(_, rest)| rest) } else { item };
        let Some(rest) = item.strip_prefix("struct ") else { continue };
        let name: String = rest.chars().take_while(|letter| letter.is_alphanumeric() || *letter == '_').collect();
        let mut open = Vec::new();
        if line.ends_with('{') {
            let end = format!("{}}}", line.split_at(line.len() - line.trim_start().len()).0);
            let fields = lines.by_ref().take_while(|field| *field != end).map(str::trim_start);
            open.extend(fields.filter(|field| field.starts_with("pub")).map(String::from));
        } else if line.contains("(pub") {
            open.push(String::from(line.trim()));
        }
        found.push((name, Found { file: file.into(), open }));
    }
    found
}

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("src")
}

/// All structs of `motion.rs` and of the files below it.
fn parts() -> BTreeMap<String, Found> {
    let below = fs::read_dir(folder().join("motion")).unwrap().map(|entry| entry.unwrap().path());
    let mut parts = BTreeMap::new();
    for path in below.chain([folder().join("motion.rs")]).filter(|path| !path.ends_with("tests.rs")) {
        let file = path.strip_prefix(folder()).unwrap().to_str().unwrap();
        for (name, found) in structs(file, &fs::read_to_string(&path).unwrap()) {
            let before = parts.insert(name.clone(), found);
            assert_eq!(before, None, "{name} stands twice");
        }
    }
    parts
}

#[test]
fn no_field_of_a_part_of_motion_can_be_reached_from_another_file() {
    let parts = parts();
    for (name, Found { file, open }) in &parts {
        let is_value = VALUES.contains(&name.as_str());
        assert!(is_value || open.is_empty(), "{file}: {name} gives away {open:?}; a method of its own file changes it");
    }
    for value in VALUES {
        assert!(parts.contains_key(value), "{value} is gone: strike it off");
    }
}

#[test]
fn the_table_of_the_parts_has_each_with_its_file() {
    let page = fs::read_to_string(folder().join("../../../docs/design.md")).unwrap();
    let (_, table) = page.split_once("## The parts of the motion side").unwrap();
    let told: BTreeMap<&str, &str> = table
        .lines()
        .take_while(|line| !line.starts_with("## "))
        .filter_map(|line| {
            let mut cells = line.split('|').map(|cell| cell.trim().trim_matches('`')).skip(1);
            Some((cells.next()?, cells.next()?))
        })
        .filter(|(_, file)| file.ends_with(".rs"))
        .collect();
    let fields = fs::read_to_string(folder().join("motion.rs")).unwrap();
    let parts = parts();
    let kept = parts.iter().filter(|(name, found)| {
        // What `Motion` has a field of.
        found.file != "motion.rs" && [",\n", "<B>,\n"].iter().any(|end| fields.contains(&format!(": {name}{end}")))
    });
    let kept: BTreeMap<&str, &str> = kept.map(|(name, found)| (name.as_str(), found.file.as_str())).collect();
    assert_eq!(told, kept, "docs/design.md");
    assert!(kept.len() > 5, "{kept:?}");
}

#[test]
fn a_field_that_is_open_is_found_wherever_it_stands() {
    let source = "\
pub(super) struct Open {\n    closed: u8,\n    /// Why.\n    pub(super) open: u8,\n}\n\n\
struct Tuple(pub(crate) u8);\nstruct Closed(u8);\nmod inner {\n    struct Deep<B> {\n        pub deep: B,\n    }\n}\n\
impl Closed {\n    pub(super) const fn new() {}\n}\n";
    let found = structs("x.rs", source);
    let open: Vec<(&str, usize)> = found.iter().map(|(name, found)| (name.as_str(), found.open.len())).collect();
    assert_eq!(open, [("Open", 1), ("Tuple", 1), ("Closed", 0), ("Deep", 1)]);
}
