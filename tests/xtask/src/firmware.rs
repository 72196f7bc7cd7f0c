//! The release ELFs: the product as it is flashed, and the shim that runs beside it in QEMU.

use crate::report::data::Platform;
use crate::setup::{self, Installing, TARGET, TargetCompiler};
use crate::{Verdict, process, workspace};
use anyhow::{Context, Result, bail};
use bench::{Elves, Executor};
use object::{Object, ObjectSection, SectionFlags, SectionKind, elf};
use std::path::{Path, PathBuf};

/// Builds both and prints what they occupy.
pub(crate) fn build_and_print(installing: Installing) -> Result<Verdict> {
    let firmware = build(installing)?;
    for (name, path) in [("drive", &firmware.product), ("shim", &firmware.shim)] {
        let file = std::fs::read(path).with_context(|| format!("cannot read {}", path.display()))?;
        println!("{name}: {}", path.display());
        print!("{}", Sections::of(&file)?);
    }
    Ok(Verdict::Passed)
}

/// Builds both; what is up to date is not built again.
///
/// The two are built one after the other, so that neither can switch a feature on in the other's dependencies.
pub(crate) fn build(installing: Installing) -> Result<Elves> {
    let compiler = setup::target_compiler(installing)?;
    let folder = build_folder()?;
    eprintln!("building the release ELF of the drive and the shim ({TARGET}: {compiler})");
    Ok(Elves { product: build_one(&compiler, &folder, "app")?, shim: build_one(&compiler, &folder, "shim")? })
}

/// What is needed to run the drive under test there: nothing, or QEMU and the ELFs.
pub(crate) fn executor(on: Platform, installing: Installing) -> Result<Executor> {
    match on {
        Platform::Host => Ok(Executor::Host),
        Platform::Qemu => {
            // Asked for before the build: a missing QEMU is known at once.
            let version = setup::qemu(installing)?;
            let firmware = build(installing)?;
            eprintln!("running the ELF in QEMU {version}");
            Ok(Executor::Qemu(firmware))
        }
    }
}

/// A folder of its own: the target's compiler may be another one than the host's.
fn build_folder() -> Result<PathBuf> {
    Ok(workspace::target_folder()?.join("firmware"))
}

fn build_one(compiler: &TargetCompiler, folder: &Path, package: &str) -> Result<PathBuf> {
    let mut cargo = compiler.cargo("build");
    cargo.args(["--release", "--package", package, "--target-dir"]).arg(folder).stdout(std::io::stderr());
    if process::watch(&mut cargo)? == Verdict::Failed {
        bail!("the package `{package}` does not build for {TARGET}; the compiler's messages above say why");
    }
    let program = folder.join(TARGET).join("release").join(package);
    if !program.is_file() {
        bail!(
            "the build of `{package}` left no program at {}; give the package a binary of its name",
            program.display()
        );
    }
    Ok(program)
}

/// Sizes of the sections that take room in the part.
#[derive(Debug, PartialEq, Eq)]
struct Sections {
    /// Name, bytes in flash, bytes in RAM.
    rows: Vec<(String, u64, u64)>,
}

impl Sections {
    fn of(file: &[u8]) -> Result<Self> {
        let program = object::File::parse(file).context("the program is not an ELF file")?;
        let rows = program
            .sections()
            .filter(|section| matches!(section.flags(), SectionFlags::Elf { sh_flags } if sh_flags & u64::from(elf::SHF_ALLOC) != 0))
            .filter(|section| section.size() > 0)
            .map(|section| {
                let stored = section.kind() != SectionKind::UninitializedData && section.file_range().is_some();
                let in_ram = section.address() >= 0x2000_0000;
                let name = section.name().unwrap_or("?").to_owned();
                (name, if stored { section.size() } else { 0 }, if in_ram { section.size() } else { 0 })
            })
            .collect();
        Ok(Self { rows })
    }
}

impl std::fmt::Display for Sections {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        writeln!(formatter, "  {:<16} {:>9} {:>9}", "section", "flash", "RAM")?;
        for (name, flash, ram) in &self.rows {
            writeln!(formatter, "  {name:<16} {flash:>9} {ram:>9}")?;
        }
        let flash: u64 = self.rows.iter().map(|row| row.1).sum();
        let ram: u64 = self.rows.iter().map(|row| row.2).sum();
        writeln!(formatter, "  {:<16} {flash:>9} {ram:>9}", "in all")
    }
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
}
