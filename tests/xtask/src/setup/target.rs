//! A compiler for the drive's processor.
//!
//! Two ways lead there. The toolchain that runs this program may have the target's core library, or rustup may be able
//! to fetch it. Where neither is so, a distribution's own rustc builds the core library from the sources that the
//! distribution ships with it (Cargo's `build-std`, which such a compiler accepts with `RUSTC_BOOTSTRAP=1`).
//! That trick stays in this file: sources and Cargo configuration know nothing of it.

use super::Installing;
use super::system::PackageManager;
use crate::{Verdict, process, workspace};
use anyhow::{Result, bail};
use std::fmt;
use std::path::{Path, PathBuf};
use std::process::Command;

/// The drive's processor: Cortex-M4 with a single-precision floating-point unit.
pub(crate) const TARGET: &str = "thumbv7em-none-eabihf";

/// Set to `distribution`, the distribution's compiler is used even where the target is installed.
const CHOICE: &str = "XTASK_COMPILER";

/// Oldest rustc that the workspace builds with.
const OLDEST: &str = env!("CARGO_PKG_RUST_VERSION");

/// A compiler that can build for [`TARGET`].
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum TargetCompiler {
    /// The toolchain that runs this program has the target's core library.
    Toolchain,
    /// A distribution's rustc, which builds the core library itself.
    Distribution(Distribution),
}

/// The parts of a distribution's Rust.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Distribution {
    cargo: PathBuf,
    rustc: PathBuf,
    release: String,
}

impl fmt::Display for TargetCompiler {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Toolchain => formatter.write_str("installed"),
            Self::Distribution(distribution) => {
                write!(formatter, "built from source by the distribution's rustc {}", distribution.release)
            }
        }
    }
}

impl TargetCompiler {
    /// Cargo with `subcommand`, set up to build for the target; add packages and profile.
    pub(crate) fn cargo(&self, subcommand: &str) -> Command {
        let mut command = match self {
            Self::Toolchain => process::cargo(),
            Self::Distribution(distribution) => Command::new(&distribution.cargo),
        };
        command.current_dir(workspace::root()).args([subcommand, "--target", TARGET]);
        if let Self::Distribution(distribution) = self {
            command
                .arg("-Zbuild-std=core,compiler_builtins")
                .env("RUSTC", &distribution.rustc)
                .env("RUSTC_BOOTSTRAP", "1")
                .env("CARGO_TARGET_THUMBV7EM_NONE_EABIHF_LINKER", "ld.lld")
                .env_remove("CARGO")
                .env_remove("RUSTUP_TOOLCHAIN")
                .env_remove("RUSTC_WRAPPER")
                // It calls clippy, which a distribution's compiler comes without.
                .env_remove("RUSTC_WORKSPACE_WRAPPER");
        }
        command
    }

    /// Can `cargo clippy` check the target's crates? A distribution's clippy is a package of its own, which is not asked for.
    pub(crate) fn has_clippy(&self) -> bool {
        *self == Self::Toolchain
    }
}

/// Finds a compiler for the target; installs one where there is none.
///
/// What is there already comes before what would have to be fetched.
pub(super) fn ensure(installing: Installing) -> Result<TargetCompiler> {
    let distribution_wanted = std::env::var(CHOICE).is_ok_and(|choice| choice == "distribution");
    if !distribution_wanted && toolchain_has_target() {
        return Ok(TargetCompiler::Toolchain);
    }
    if let Some(distribution) = PACKAGES.iter().find_map(DistributionPackages::find) {
        return Ok(TargetCompiler::Distribution(distribution));
    }
    if !distribution_wanted && installing == Installing::Allowed && add_with_rustup() {
        return Ok(TargetCompiler::Toolchain);
    }
    install_distribution(installing)
}

/// Is the core library of the target in the sysroot of the toolchain in use?
fn toolchain_has_target() -> bool {
    let mut rustc = Command::new("rustc");
    rustc.args(["--print", "target-libdir", "--target", TARGET]).current_dir(workspace::root());
    let Some(folder) = process::ask(&mut rustc) else { return false };
    std::fs::read_dir(folder).is_ok_and(|mut files| {
        files.any(|file| file.is_ok_and(|file| file.file_name().to_string_lossy().starts_with("libcore-")))
    })
}

fn add_with_rustup() -> bool {
    if process::find("rustup").is_none() {
        return false;
    }
    eprintln!("the target {TARGET} is not installed; installing it with `rustup target add {TARGET}`");
    let mut rustup = Command::new("rustup");
    rustup
        .args(["target", "add", TARGET])
        .current_dir(workspace::root())
        .env("RUSTUP_MAX_RETRIES", "1")
        .stdout(std::io::stderr());
    process::watch(&mut rustup).is_ok_and(|verdict| verdict == Verdict::Passed) && toolchain_has_target()
}

fn install_distribution(installing: Installing) -> Result<TargetCompiler> {
    let missing = format!("the target {TARGET} is not installed (`rustup target add {TARGET}` installs it)");
    let manager = PackageManager::of_this_machine();
    let offered = match manager {
        PackageManager::Apt => PACKAGES.iter().find(|packages| packages.are_offered()),
        PackageManager::Brew | PackageManager::Unknown => None,
    };
    let Some(packages) = offered else {
        bail!("{missing}");
    };
    let missing = format!("{missing}, nor is a distribution's rustc with its sources");
    manager.install(&packages.all(), &missing, installing)?;
    match packages.find() {
        Some(distribution) => Ok(TargetCompiler::Distribution(distribution)),
        None => bail!("{missing}, though {} were just installed", packages.all().join(", ")),
    }
}

/// Names of the packages that make a distribution's Rust.
struct DistributionPackages {
    rustc: &'static str,
    cargo: &'static str,
    sources: &'static str,
}

/// The linker: rustc asks for `rust-lld`, which only rustup's toolchains carry.
const LINKER_PACKAGE: &str = "lld";

/// Debian's newer Rust for its web browsers first, then the distribution's ordinary one.
const PACKAGES: [DistributionPackages; 2] = [
    DistributionPackages { rustc: "rustc-web", cargo: "cargo-web", sources: "rust-web-src" },
    DistributionPackages { rustc: "rustc", cargo: "cargo", sources: "rust-src" },
];

impl DistributionPackages {
    fn all(&self) -> [&'static str; 4] {
        [self.rustc, self.cargo, self.sources, LINKER_PACKAGE]
    }

    /// The compiler, if all packages are installed, new enough, and of one version.
    fn find(&self) -> Option<Distribution> {
        let rustc = program_of_package(self.rustc, "rustc")?;
        let cargo = program_of_package(self.cargo, "cargo")?;
        if installed_version(self.rustc)? != installed_version(self.sources)? || process::find("ld.lld").is_none() {
            return None;
        }
        let verbose = process::ask(without_rustup(Command::new(&rustc).arg("-vV")))?;
        let release = verbose.lines().find_map(|line| line.strip_prefix("release: "))?.to_owned();
        let sysroot = process::ask(without_rustup(Command::new(&rustc).args(["--print", "sysroot"])))?;
        let library = Path::new(&sysroot).join("lib/rustlib/src/rust/library");
        (new_enough(&release) && library.join("core").is_dir()).then_some(Distribution { cargo, rustc, release })
    }

    /// Does the package manager offer them, new enough?
    fn are_offered(&self) -> bool {
        let mut show = Command::new("apt-cache");
        show.args(["show", "--no-all-versions", self.rustc]);
        process::ask(&mut show)
            .and_then(|text| text.lines().find_map(|line| line.strip_prefix("Version: ").map(new_enough)))
            .unwrap_or(false)
    }
}

/// rustup sets variables that would turn another toolchain's programs around.
fn without_rustup(command: &mut Command) -> &mut Command {
    command.env_remove("RUSTUP_TOOLCHAIN").env_remove("RUSTC")
}

/// The program's path out of the package's list of files: the shortest one, wrappers stand deeper.
fn program_of_package(package: &str, program: &str) -> Option<PathBuf> {
    let files = process::ask(Command::new("dpkg-query").args(["-L", package]))?;
    shortest_program(&files, program).map(PathBuf::from).filter(|path| path.is_file())
}

fn shortest_program<'files>(files: &'files str, program: &str) -> Option<&'files str> {
    let ending = format!("/bin/{program}");
    files.lines().filter(|path| path.ends_with(&ending)).min_by_key(|path| path.len())
}

fn installed_version(package: &str) -> Option<String> {
    let mut query = Command::new("dpkg-query");
    query.args(["-W", "-f", "${db:Status-Status} ${Version}", package]);
    process::ask(&mut query)?.strip_prefix("installed ").map(str::to_owned)
}

/// Is a version such as `1.96.0` or `1.96.0+dfsg1-1~deb12u2` new enough?
fn new_enough(version: &str) -> bool {
    release_number(version).is_some_and(|number| Some(number) >= release_number(OLDEST))
}

/// Major and minor number, after the epoch that some packages' versions begin with.
fn release_number(version: &str) -> Option<(u32, u32)> {
    let version = version.rsplit(':').next()?;
    let mut numbers = version.split(|character: char| !character.is_ascii_digit());
    Some((numbers.next()?.parse().ok()?, numbers.next()?.parse().ok()?))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn versions_are_judged_as_releases_and_as_packages_write_them() {
        assert!(new_enough(OLDEST));
        assert!(new_enough("1.96.0+dfsg1-1~deb12u2"));
        assert!(new_enough("2.0.0"));
        assert!(new_enough("1:1.100.0-1"));
        assert!(!new_enough("1.63.0+dfsg1-2"));
        assert!(!new_enough("1:1.9.0-1"));
        assert!(!new_enough("none"));
    }

    #[test]
    fn the_program_of_a_package_is_not_its_wrapper() {
        let files = "/usr\n/usr/share/cargo/bin/cargo\n/usr/bin/cargo\n/usr/share/doc/cargo\n";
        assert_eq!(shortest_program(files, "cargo"), Some("/usr/bin/cargo"));
        assert_eq!(shortest_program(files, "rustc"), None);
    }

    #[test]
    fn a_distribution_compiler_is_told_to_build_the_core_library_with_its_own_rustc() {
        let compiler = TargetCompiler::Distribution(Distribution {
            cargo: "/some/bin/cargo".into(),
            rustc: "/some/bin/rustc".into(),
            release: "1.96.0".into(),
        });
        let command = compiler.cargo("build");
        assert_eq!(
            process::words(&command),
            format!("cargo build --target {TARGET} -Zbuild-std=core,compiler_builtins")
        );
        let variables: Vec<_> = command.get_envs().collect();
        assert!(variables.contains(&("RUSTC".as_ref(), Some("/some/bin/rustc".as_ref()))));
        assert!(variables.contains(&("RUSTUP_TOOLCHAIN".as_ref(), None)));
        assert!(!compiler.has_clippy());
    }
}
