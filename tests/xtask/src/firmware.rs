//! What runs in QEMU: the product as it is flashed, and the bus inside QEMU that answers its accesses.

use crate::report::data::Platform;
use crate::setup::{self, Installing, TARGET, TargetCompiler};
use crate::size::{self, Sections};
use crate::{Verdict, process, workspace};
use anyhow::{Context, Result, bail};
use bench::{Elves, Executor};
use std::path::{Path, PathBuf};

/// Builds all of it and prints what the ELF occupies; the product's size is held against the accepted one, or becomes it.
pub(crate) fn build_and_print(accept_size: bool, installing: Installing) -> Result<Verdict> {
    let firmware = build_ungated(installing)?;
    println!("drive: {}", firmware.product.display());
    print!("{}", Sections::of(&read(&firmware.product)?)?);
    println!("bus inside QEMU: {}", firmware.bus.display());
    let product = read(&firmware.product)?;
    if accept_size {
        size::accept(&product)?;
    }
    size::gate(&product)?;
    Ok(Verdict::Passed)
}

/// Builds all of it; what is up to date is not built again.
pub(crate) fn build(installing: Installing) -> Result<Elves> {
    let firmware = build_ungated(installing)?;
    size::gate(&read(&firmware.product)?)?;
    Ok(firmware)
}

fn read(path: &Path) -> Result<Vec<u8>> {
    std::fs::read(path).with_context(|| format!("cannot read {}", path.display()))
}

/// The same, whatever the size.
pub(crate) fn build_ungated(installing: Installing) -> Result<Elves> {
    let compiler = setup::target_compiler(installing)?;
    let folder = build_folder()?;
    eprintln!("building the release ELF of the drive ({TARGET}: {compiler})");
    let product = build_one(&compiler, &folder, &["--package", "app"], "app")?;
    Ok(Elves::new(product, build_bus()?))
}

/// The program that tries the flash of the parameters, see `board/examples/parameter_flash.rs`.
pub(crate) fn build_flash_trial(installing: Installing) -> Result<PathBuf> {
    const NAME: &str = "parameter_flash";
    let compiler = setup::target_compiler(installing)?;
    build_one(&compiler, &build_folder()?, &["--package", "board", "--example", NAME], &format!("examples/{NAME}"))
}

/// The library that QEMU loads, built by this computer's compiler.
pub(crate) fn build_bus() -> Result<PathBuf> {
    const PACKAGE: &str = "emulator_bus";
    let name = format!("{}{PACKAGE}{}", std::env::consts::DLL_PREFIX, std::env::consts::DLL_SUFFIX);
    workspace::build_like_tests(PACKAGE, &["--lib"], &name)
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
pub(crate) fn build_folder() -> Result<PathBuf> {
    Ok(workspace::target_folder()?.join("firmware"))
}

fn build_one(compiler: &TargetCompiler, folder: &Path, selection: &[&str], name: &str) -> Result<PathBuf> {
    let mut cargo = compiler.cargo("build");
    cargo.arg("--release").args(selection).arg("--target-dir").arg(folder).stdout(std::io::stderr());
    if process::watch(&mut cargo)? == Verdict::Failed {
        bail!("`{name}` does not build for {TARGET}; the compiler's messages above say why");
    }
    let program = folder.join(TARGET).join("release").join(name);
    if !program.is_file() {
        bail!("the build left no program at {}; give the package a binary of its name", program.display());
    }
    Ok(program)
}
