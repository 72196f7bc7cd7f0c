//! The READMEs of the crates that stand alone are their crate documentation, as a page of its own.
//!
//! `UPDATE_GOLDEN=1` writes them.

use crate::workspace;
use std::path::PathBuf;

const CRATES: [&str; 3] = ["sercos", "sercon816", "servo"];

fn folder(name: &str) -> PathBuf {
    workspace::root().join("firmware").join(name)
}

/// The page that a crate's documentation makes, whose first heading is the package's name.
fn page(package: &str, source: &str) -> String {
    let mut page = format!("# {package}\n\n");
    let mut in_code = false;
    for line in source.lines().map_while(|line| line.strip_prefix("//!")) {
        let line = line.strip_prefix(' ').unwrap_or(line);
        if line.starts_with("```") {
            in_code = !in_code;
            page += if line == "```" && in_code { "```rust" } else { line };
        } else if in_code {
            // What the documentation hides, a page hides too.
            if line == "#" || line.starts_with("# ") {
                continue;
            }
            page += line;
        } else {
            if line.starts_with('#') {
                page.push('#');
            }
            page += &without_links(line);
        }
        page.push('\n');
    }
    page
}

/// Links to items lead nowhere outside the documentation: their text is left. Others stay.
fn without_links(line: &str) -> String {
    let mut text = String::new();
    let mut rest = line;
    while let Some((before, link)) = rest.split_once('[') {
        let Some((name, behind)) = link.split_once(']') else { break };
        text += before;
        let target = behind.strip_prefix('(').and_then(|target| target.split_once(')'));
        let (left, behind) = match target {
            Some((path, behind)) if !path.contains(['/', '.', '#']) => (name.to_owned(), behind),
            Some((path, behind)) => (format!("[{name}]({path})"), behind),
            None if name.starts_with('`') => (name.to_owned(), behind),
            None => (format!("[{name}]"), behind),
        };
        text += &left;
        rest = behind;
    }
    text + rest
}

#[test]
fn the_readme_of_a_crate_says_what_its_documentation_says() {
    for name in CRATES {
        let manifest = std::fs::read_to_string(folder(name).join("Cargo.toml")).unwrap();
        let package = manifest.lines().find_map(|line| line.strip_prefix("name = \"")?.strip_suffix('"')).unwrap();
        let source = std::fs::read_to_string(folder(name).join("src/lib.rs")).unwrap();
        let page = page(package, &source);
        assert!(page.lines().count() > 20 && page.contains("```rust"), "{name}: {page}");
        let path = folder(name).join("README.md");
        if std::env::var_os("UPDATE_GOLDEN").is_some() {
            workspace::write_whole(&path, &page).unwrap();
        }
        let readme = std::fs::read_to_string(&path).unwrap();
        assert_eq!(readme, page, "{}: set UPDATE_GOLDEN=1 to write it anew", path.display());
    }
}

#[test]
fn links_headings_and_hidden_lines_become_those_of_a_page() {
    let source = "//! Has [`A`], [the b](c::b), [0] and [x](y.html).\n//!\n//! # Example\n//!\n//! ```\n//! # use hidden;\n//! shown();\n//! ```\n#![no_std]\n//! no more\n";
    let expected = "# name\n\nHas `A`, the b, [0] and [x](y.html).\n\n## Example\n\n```rust\nshown();\n```\n";
    assert_eq!(page("name", source), expected);
}
