//! The pictures of docs/design.md that are made by running what they show, and those that name what is in the code.
//!
//! `UPDATE_GOLDEN=1` writes what is generated into the page.

mod cover;
mod cycle;
mod names;
mod phases;
mod states;

use crate::workspace;

const PAGE: &str = "docs/design.md";

fn page() -> String {
    std::fs::read_to_string(workspace::root().join(PAGE)).unwrap()
}

/// Compares a part of the page with what it should be, or writes it.
#[track_caller]
fn is_on_the_page(name: &str, generated: &str) {
    let update = std::env::var_os("UPDATE_GOLDEN").is_some();
    // Tests side by side write parts of one page.
    let lock = std::fs::File::open(workspace::root().join("Cargo.toml")).unwrap();
    if update {
        lock.lock().unwrap();
    }
    let page = page();
    let begin = format!("<!-- generated: {name} -->\n");
    let end = format!("<!-- end: {name} -->");
    let (head, rest) = page.split_once(&begin).unwrap_or_else(|| panic!("{PAGE} has no line {begin}"));
    let (written, tail) = rest.split_once(&end).unwrap_or_else(|| panic!("{PAGE} has no {end}"));
    if update {
        let page = format!("{head}{begin}{generated}{end}{tail}");
        workspace::write_whole(&workspace::root().join(PAGE), &page).unwrap();
        return;
    }
    assert_eq!(written, generated, "{PAGE}, {name}: set UPDATE_GOLDEN=1 to accept what the code does now");
}
