//! What the product occupies of the part: measured on the release ELF, and held against what was accepted.

use crate::workspace;
use anyhow::{Context, Result, anyhow, bail};
use object::{Object, ObjectSection, ObjectSymbol, SectionFlags, SectionKind, elf};
use std::fmt;

/// Where the accepted sizes are kept, from the repository's root.
const ACCEPTED: &str = "firmware/app/size.txt";
/// RAM of the part begins here; everything below is flash.
const RAM: u64 = 0x2000_0000;
/// Difference that needs no acceptance, in per cent.
const TOLERANCE: u64 = 2;
/// Names of the constant tables in the ELF: the rows of the dictionary, the IDN lists, and the accessors of the rows. The diagnoses have
/// none, because the firmware only takes single ones out of their table.
const TABLES: [&str; 3] = ["DATA_BLOCKS", "IDNS", "ACCESSORS"];

/// Sizes of the sections that take room in the part.
#[derive(Debug, PartialEq, Eq)]
pub(crate) struct Sections {
    /// Name, bytes in flash, bytes in RAM.
    rows: Vec<(String, u64, u64)>,
}

impl Sections {
    pub(crate) fn of(file: &[u8]) -> Result<Self> {
        let program = object::File::parse(file).context("the program is not an ELF file")?;
        let rows = program
            .sections()
            .filter(|section| matches!(section.flags(), SectionFlags::Elf { sh_flags } if sh_flags & u64::from(elf::SHF_ALLOC) != 0))
            .filter(|section| section.size() > 0)
            .map(|section| {
                let stored = section.kind() != SectionKind::UninitializedData && section.file_range().is_some();
                let in_ram = section.address() >= RAM;
                let name = section.name().unwrap_or("?").to_owned();
                (name, if stored { section.size() } else { 0 }, if in_ram { section.size() } else { 0 })
            })
            .collect();
        Ok(Self { rows })
    }

    fn size(&self) -> Size {
        Size { flash: self.rows.iter().map(|row| row.1).sum(), ram: self.rows.iter().map(|row| row.2).sum() }
    }
}

impl fmt::Display for Sections {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(formatter, "  {:<16} {:>9} {:>9}", "section", "flash", "RAM")?;
        for (name, flash, ram) in &self.rows {
            writeln!(formatter, "  {name:<16} {flash:>9} {ram:>9}")?;
        }
        let Size { flash, ram } = self.size();
        writeln!(formatter, "  {:<16} {flash:>9} {ram:>9}", "in all")
    }
}

/// Bytes in flash and in RAM (without stack).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Size {
    flash: u64,
    ram: u64,
}

impl Size {
    /// From lines `flash 141240` and `ram 4832`; what begins with # is for people.
    fn parse(text: &str) -> Result<Self> {
        let find = |name: &str| {
            let line = text.lines().find_map(|line| line.strip_prefix(name)?.strip_prefix(' '));
            let number = line.ok_or_else(|| anyhow!("{ACCEPTED} has no line `{name} <bytes>`"))?;
            number.trim().parse::<u64>().with_context(|| format!("{ACCEPTED}: `{number}` after `{name}` is no number"))
        };
        Ok(Self { flash: find("flash")?, ram: find("ram")? })
    }

    fn file(self) -> String {
        format!(
            "# Bytes of the release ELF in flash and RAM (RAM without the stack), as accepted by `cargo xtask build --accept-size`.\n\
             # More than {TOLERANCE} % of difference fails the build of `cargo xtask`, in either direction.\n\
             flash {}\nram {}\n",
            self.flash, self.ram
        )
    }
}

/// Prints what the product occupies beside what was accepted, and where its tables lie.
///
/// # Errors
/// It differs too much, or a table lies in RAM.
pub(crate) fn gate(product: &[u8]) -> Result<()> {
    let size = Sections::of(product)?.size();
    let path = workspace::root().join(ACCEPTED);
    let text = std::fs::read_to_string(&path)
        .with_context(|| format!("cannot read {ACCEPTED}; `cargo xtask build --accept-size` makes it"))?;
    let accepted = Size::parse(&text)?;
    let tables = tables_in_flash(product)?;
    eprintln!(
        "flash {} of {} bytes accepted, RAM {} of {}; tables {tables} bytes, all in flash",
        size.flash, accepted.flash, size.ram, accepted.ram
    );
    compare("flash", size.flash, accepted.flash)?;
    compare("RAM", size.ram, accepted.ram)
}

/// Makes the product's sizes the accepted ones.
pub(crate) fn accept(product: &[u8]) -> Result<()> {
    let size = Sections::of(product)?.size();
    tables_in_flash(product)?;
    workspace::write_whole(&workspace::root().join(ACCEPTED), &size.file())
}

fn compare(what: &str, bytes: u64, accepted: u64) -> Result<()> {
    if bytes.abs_diff(accepted) * 100 > accepted * TOLERANCE {
        let direction = if bytes > accepted { "more" } else { "less" };
        bail!(
            "the drive takes {bytes} bytes of {what}, {} {direction} than the {accepted} accepted; find out why, then run \
             `cargo xtask build --accept-size` and commit {ACCEPTED}",
            bytes.abs_diff(accepted)
        );
    }
    Ok(())
}

/// Bytes of the tables, all of which lie in flash.
fn tables_in_flash(product: &[u8]) -> Result<u64> {
    let program = object::File::parse(product).context("the program is not an ELF file")?;
    let symbols: Vec<(&str, u64, u64)> = program
        .symbols()
        .filter(|symbol| symbol.size() > 0)
        .filter_map(|symbol| Some((symbol.name().ok()?, symbol.address(), symbol.size())))
        .collect();
    judge_tables(&symbols)?;
    let of_tables = symbols.iter().filter(|symbol| TABLES.iter().any(|table| symbol.0.contains(table)));
    let bytes = of_tables.map(|symbol| symbol.2).sum();
    // A copy would have another name: no variable that is filled at start may be as large as the dictionary. Memory that starts as zeros,
    // such as that of the oscilloscope, is none.
    let is_filled = |address: u64| {
        program.sections().any(|section| {
            section.kind() == object::SectionKind::Data
                && (section.address()..section.address() + section.size()).contains(&address)
        })
    };
    let filled = symbols.iter().filter(|symbol| symbol.1 >= RAM && is_filled(symbol.1));
    if let Some((name, _, size)) = filled.max_by_key(|symbol| symbol.2).filter(|symbol| symbol.2 * 2 > bytes) {
        bail!("{name} takes {size} bytes of RAM, as much as a table: constants belong into flash");
    }
    Ok(bytes)
}

fn judge_tables(symbols: &[(&str, u64, u64)]) -> Result<()> {
    for table in TABLES {
        let of_table: Vec<_> = symbols.iter().filter(|symbol| symbol.0.contains(table)).collect();
        if of_table.is_empty() {
            bail!("the ELF has no symbol with {table} in its name: the check of the tables has nothing to look at");
        }
        if let Some((name, address, size)) = of_table.into_iter().find(|symbol| symbol.1 >= RAM) {
            bail!("{name}, {size} bytes, lies in RAM at {address:#010x}; a constant table belongs into flash");
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_not_an_elf_file_is_refused() {
        assert!(Sections::of(b"no program").unwrap_err().to_string().contains("not an ELF file"));
    }

    #[test]
    fn the_table_adds_flash_and_ram_separately() {
        let rows = vec![(".text".into(), 1000, 0), (".data".into(), 16, 16), (".bss".into(), 0, 200)];
        let text = Sections { rows }.to_string();
        let last = text.lines().last().unwrap();
        assert_eq!(last.split_whitespace().collect::<Vec<_>>(), ["in", "all", "1016", "216"]);
    }

    #[test]
    fn what_is_written_down_is_what_is_read() {
        let size = Size { flash: 141_240, ram: 4_832 };
        assert_eq!(Size::parse(&size.file()).unwrap(), size);
        assert!(Size::parse("flash 1\n").unwrap_err().to_string().contains("no line `ram"));
        assert!(Size::parse("flash x\nram 1\n").is_err());
    }

    #[test]
    fn two_per_cent_pass_and_more_does_not_in_either_direction() {
        for (bytes, passes) in [(100_000, true), (102_000, true), (98_000, true), (102_001, false), (97_999, false)] {
            assert_eq!(compare("flash", bytes, 100_000).is_ok(), passes, "{bytes}");
        }
        let line = compare("RAM", 5_000, 4_000).unwrap_err().to_string();
        assert!(line.contains("1000 more than the 4000 accepted") && line.contains("--accept-size"), "{line}");
    }

    #[test]
    fn a_table_in_ram_or_without_a_symbol_is_found() {
        let good = [("drive::DATA_BLOCKS", 0x0801_0000, 8), ("IDNS", 0x0801_0100, 8), ("ACCESSORS", 0x0801_0200, 8)];
        assert!(judge_tables(&good).is_ok());
        let mut moved = good;
        moved[1].1 = 0x2000_0100;
        assert!(judge_tables(&moved).unwrap_err().to_string().contains("IDNS"));
        assert!(judge_tables(&good[..2]).unwrap_err().to_string().contains("ACCESSORS"));
    }
}
