//! The page docs/mutants.md: what survives and why, and the table of the defects.

use crate::workspace;
use anyhow::{Context, Result};

/// The page.
const PAGE: &str = "docs/mutants.md";
/// Under it are the mutants that nobody can see.
const SURVIVORS: &str = "## What nobody can see";

/// A mutant that no test sees, without its place in the file, which moves.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Survivor {
    path: String,
    what: String,
}

impl Survivor {
    /// From its name as cargo-mutants has it: path, line, column and what was done.
    pub(super) fn named(name: &str) -> Option<Self> {
        let (place, what) = name.split_once(": ")?;
        let (path, _) = place.split_once(':')?;
        Some(Self { path: path.to_owned(), what: what.to_owned() })
    }
}

impl std::fmt::Display for Survivor {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(formatter, "{}: {}", self.path, self.what)
    }
}

/// Those of the page.
pub(super) fn listed() -> Result<Vec<Survivor>> {
    let page = workspace::root().join(PAGE);
    let text = std::fs::read_to_string(page).with_context(|| format!("cannot read {PAGE}"))?;
    Ok(rows(&text))
}

/// The rows of the table: file, mutant, how many of the kind, reason.
fn rows(page: &str) -> Vec<Survivor> {
    let Some((_, section)) = page.split_once(SURVIVORS) else { return Vec::new() };
    let section = section.split("\n## ").next().unwrap_or_default();
    let mut survivors = Vec::new();
    for row in section.lines().filter_map(|line| line.strip_prefix("| `")) {
        let cells: Vec<&str> = row.split(" | ").collect();
        if let [path, what, number, _] = cells[..] {
            let (path, what) = (path.trim_end_matches('`'), what.trim_matches('`').replace("\\|", "|"));
            let survivor = Survivor { path: path.to_owned(), what };
            survivors.extend(std::iter::repeat_n(survivor, number.trim().parse().unwrap_or(1)));
        }
    }
    survivors
}

/// What has survived and is not on the list, and what is on the list and has not survived, of one file.
pub(super) fn compare(listed: &[Survivor], survived: &[Survivor], path: &str) -> (Vec<Survivor>, Vec<Survivor>) {
    let mut gone: Vec<Survivor> = listed.iter().filter(|survivor| survivor.path == path).cloned().collect();
    let mut new = Vec::new();
    for survivor in survived {
        match gone.iter().position(|listed| listed == survivor) {
            Some(place) => drop(gone.swap_remove(place)),
            None => new.push(survivor.clone()),
        }
    }
    (new, gone)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mutants::defect::{self, Defect};

    /// Under it is the table of the defects, to the end of the page.
    const DEFECTS: &str = "## Defects made by hand\n";

    fn table(defects: &[Defect]) -> String {
        let mut table = String::from("\n| Defect | What it would do to a machine | Seen by |\n|---|---|---|\n");
        for Defect { name, why, expected, .. } in defects {
            table += &format!("| {name} | {why} | {} |\n", expected.to_string().replace('|', "\\|"));
        }
        table
    }

    #[test]
    fn the_table_of_the_page_is_that_of_the_patches() {
        let path = workspace::root().join(PAGE);
        let page = std::fs::read_to_string(&path).unwrap();
        let (head, present) = page.split_once(DEFECTS).unwrap();
        let table = table(&defect::all().unwrap());
        if std::env::var_os("UPDATE_GOLDEN").is_some() {
            std::fs::write(&path, format!("{head}{DEFECTS}{table}")).unwrap();
        } else {
            assert_eq!(present, table, "set UPDATE_GOLDEN=1 to write the table anew");
        }
    }

    #[test]
    fn every_row_of_the_list_names_a_safety_file_and_gives_a_reason() {
        for survivor in listed().unwrap() {
            assert!(workspace::root().join(&survivor.path).is_file(), "{survivor}");
        }
    }

    #[test]
    fn survivors_are_counted_by_kind_and_file() {
        let page = "## What nobody can see\n\n| File | Mutant | Number | Reason |\n|---|---|---|---|\n\
                    | `a.rs` | `replace \\| with ^ in f` | 2 | no bit is in both |\n| `b.rs` | `replace < with <=` | 1 | equal |\n\n\
                    ## Other\n\n| `c.rs` | `x` | 1 | y |\n";
        let listed = rows(page);
        let one = Survivor::named("a.rs:12:3: replace | with ^ in f").unwrap();
        let other = Survivor::named("b.rs:1:1: replace < with <=").unwrap();
        assert_eq!(listed, [one.clone(), one.clone(), other.clone()]);
        let third = Survivor::named("a.rs:7:7: replace f with ()").unwrap();
        let (new, gone) = compare(&listed, &[third.clone(), one.clone()], "a.rs");
        assert_eq!((new, gone), (vec![third], vec![one]));
    }
}
