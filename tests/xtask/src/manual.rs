//! `docs/idn.md`: the manual page of all data blocks, made from the tables of the firmware.

mod page;

use crate::{Verdict, workspace};
use anyhow::{Context, Result, bail};

/// Where the page lives, from the repository's root.
const PAGE: &str = "docs/idn.md";

/// Writes the page, or only compares it.
pub(crate) fn run(check: bool) -> Result<Verdict> {
    let path = workspace::root().join(PAGE);
    let page = page::markdown();
    if check {
        let present = std::fs::read_to_string(&path).with_context(|| format!("cannot read {PAGE}"))?;
        if present != page {
            bail!("{PAGE} is not what the tables of the firmware say; run `cargo xtask manual` and commit it");
        }
        println!("{PAGE} is up to date");
        return Ok(Verdict::Passed);
    }
    workspace::write_whole(&path, &page)?;
    println!("{PAGE}: {} data blocks, {} diagnoses", drive::DICTIONARY.blocks().len(), drive::DIAGNOSES.len());
    Ok(Verdict::Passed)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_page_in_the_repository_is_what_the_tables_say() {
        assert_eq!(run(true).unwrap(), Verdict::Passed);
    }
}
