//! One defect after the other: broken, built, tested, mended.

use super::defect::{Defect, Expected};
use super::programs::{self, Ended, Program};
use super::scratch::Scratch;
use crate::setup::{self, Installing, TARGET, TargetCompiler};
use crate::{firmware, process, workspace};
use anyhow::{Context, Result, bail};
use bench::Elves;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::Command;

/// What is compiled to run once is not optimised.
pub(super) const UNOPTIMISED: [(&str, &str); 2] =
    [("CARGO_PROFILE_DEV_OPT_LEVEL", "0"), ("CARGO_PROFILE_DEV_DEBUG", "none")];

/// Packages of this computer's tests that run the ELF.
const TESTS_OF_THE_ELF: [&str; 6] = ["--package", "integration", "--package", "emulator", "--package", "xtask"];
/// Packages of the product that have tests of their own.
const PORTABLE: [&str; 8] =
    ["--package", "sercos", "--package", "sercon816", "--package", "servo-axis", "--package", "drive"];

/// What came of a defect.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Outcome {
    /// What must see it sees it.
    Caught,
    /// A test hangs with it, which is as good as red.
    Hangs,
    /// This test stays green.
    Survived(String),
    /// The sources have changed: the patch has to follow them.
    DoesNotApply(String),
    /// It does not compile, and should, or for another reason than it should.
    DoesNotBuild(String),
}

impl Outcome {
    pub(super) const fn is_as_it_should_be(&self) -> bool {
        matches!(self, Self::Caught | Self::Hangs)
    }
}

impl std::fmt::Display for Outcome {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Caught => formatter.write_str("caught"),
            Self::Hangs => formatter.write_str("caught, the test hangs"),
            Self::Survived(what) => write!(formatter, "SURVIVED: {what}"),
            Self::DoesNotApply(reason) => write!(formatter, "DOES NOT APPLY: {reason}"),
            Self::DoesNotBuild(reason) => write!(formatter, "DOES NOT BUILD: {reason}"),
        }
    }
}

/// Where a named test is.
#[derive(Clone, Debug, PartialEq, Eq)]
enum Place {
    /// In a program that was built without a defect and runs the ELF, which has one.
    OnElf(Program, String),
    /// In a program that has to be built with the defect.
    OnHost(Program, String),
}

/// All that is needed to try defects.
pub(super) struct Bench {
    scratch: Scratch,
    compiler: TargetCompiler,
    /// Without a defect, from the user's own sources.
    whole: Elves,
    programs: Vec<Program>,
    portable: Option<Vec<Program>>,
}

impl Bench {
    /// Builds the tests and the ELF without a defect.
    pub(super) fn new(installing: Installing) -> Result<Self> {
        setup::qemu(installing)?;
        let compiler = setup::target_compiler(installing)?;
        let scratch = Scratch::new()?;
        eprintln!("building the tests and the ELF without a defect");
        let whole = firmware::build_ungated(installing)?;
        scratch.begin_with("firmware", &firmware::build_folder()?)?;
        let programs = programs::build(workspace::root(), &TESTS_OF_THE_ELF, &[])?;
        Ok(Self { scratch, compiler, whole, programs, portable: None })
    }

    /// Every test that must turn red is there and green without a defect.
    pub(super) fn check(&mut self, defects: &[Defect]) -> Result<()> {
        let mut names = BTreeSet::new();
        for defect in defects {
            if let Expected::Tests(tests) = &defect.expected {
                names.extend(tests.iter().cloned());
            }
        }
        for name in names {
            let ended = match self.find(&name)? {
                Place::OnElf(program, test) => self.run_on_elf(&program, &test, &self.whole.product)?,
                Place::OnHost(program, test) => match self.run_on_host(&program, &test)? {
                    Ok(ended) => ended,
                    Err(reason) => bail!("{name} does not build without a defect: {reason}"),
                },
            };
            if ended != Ended::Green {
                bail!("{name} is red without a defect; mend that first (its words: {})", self.words().display());
            }
        }
        Ok(())
    }

    /// Breaks, builds, tests and mends.
    pub(super) fn try_out(&mut self, defect: &Defect) -> Result<Outcome> {
        if let Err(reason) = self.scratch.apply(&defect.patch)? {
            return Ok(Outcome::DoesNotApply(reason));
        }
        let outcome = self.try_broken(&defect.expected);
        self.scratch.undo(&defect.patch)?;
        outcome
    }

    fn try_broken(&mut self, expected: &Expected) -> Result<Outcome> {
        let tests = match expected {
            Expected::Compiler(text) => {
                return Ok(match self.build_elf()? {
                    Ok(()) => Outcome::Survived("it compiles".into()),
                    Err(_) if self.said(text)? => Outcome::Caught,
                    Err(reason) => Outcome::DoesNotBuild(reason),
                });
            }
            Expected::Tests(tests) => tests,
        };
        let mut outcome = Outcome::Caught;
        let mut elf_is_built = false;
        for name in tests {
            let ended = match self.find(name)? {
                Place::OnElf(program, test) => {
                    if !elf_is_built {
                        if let Err(reason) = self.build_elf()? {
                            return Ok(Outcome::DoesNotBuild(reason));
                        }
                        elf_is_built = true;
                    }
                    self.run_on_elf(&program, &test, &self.broken_elf())?
                }
                Place::OnHost(program, test) => match self.run_on_host(&program, &test)? {
                    Ok(ended) => ended,
                    Err(reason) => return Ok(Outcome::DoesNotBuild(reason)),
                },
            };
            match ended {
                Ended::Red => {}
                Ended::Hanging => outcome = Outcome::Hangs,
                Ended::Green => return Ok(Outcome::Survived(format!("{name} stays green"))),
            }
        }
        Ok(outcome)
    }

    /// The program with a test of this name: those of the ELF first, then those of the portable crates.
    fn find(&mut self, name: &str) -> Result<Place> {
        if let Some((program, test, on_elf)) = find_in(&self.programs, name)? {
            return Ok(if on_elf { Place::OnElf(program, test) } else { Place::OnHost(program, test) });
        }
        let portable = match self.portable.take() {
            Some(portable) => portable,
            None => {
                let folder = self.scratch.build_folder("host");
                let folder = folder.to_str().context("the target folder's path is no text")?;
                let arguments = [&PORTABLE[..], &["--target-dir", folder]].concat();
                programs::build(&self.scratch.root(), &arguments, &UNOPTIMISED)?
            }
        };
        let found = find_in(&portable, name);
        self.portable = Some(portable);
        match found? {
            Some((program, test, _)) => Ok(Place::OnHost(program, test)),
            None => bail!("no test is named {name}; give its name as the tests print it"),
        }
    }

    /// Builds the ELF from the copy; the first line of the compiler's complaint, if it does not build.
    fn build_elf(&self) -> Result<Result<(), String>> {
        let mut cargo = self.compiler.cargo("build");
        cargo.current_dir(self.scratch.root()).args(["--quiet", "--release", "--package", "app", "--target-dir"]);
        cargo.arg(self.scratch.build_folder("firmware"));
        self.build(&mut cargo)
    }

    fn build(&self, cargo: &mut Command) -> Result<Result<(), String>> {
        Ok(match programs::watch(cargo, &self.words())? {
            Ended::Green => Ok(()),
            Ended::Red => Err(self.complaint()),
            Ended::Hanging => Err("the compiler hangs".into()),
        })
    }

    fn broken_elf(&self) -> PathBuf {
        self.scratch.build_folder("firmware").join(TARGET).join("release/app")
    }

    fn run_on_elf(&self, program: &Program, test: &str, product: &Path) -> Result<Ended> {
        program.run(test, &[("PRODUCT_ELF", product), ("BUS_PLUGIN", &self.whole.bus)], &self.words())
    }

    fn run_on_host(&self, program: &Program, test: &str) -> Result<Result<Ended, String>> {
        let cargo = |arguments: &[&str]| {
            let mut cargo = process::cargo();
            cargo.current_dir(self.scratch.root()).args(["test", "--quiet", "--manifest-path"]).arg(&program.manifest);
            cargo.args(&program.selection).arg("--target-dir").arg(self.scratch.build_folder("host"));
            cargo.args(arguments).envs(UNOPTIMISED);
            cargo
        };
        if let Err(reason) = self.build(&mut cargo(&["--no-run"]))? {
            return Ok(Err(reason));
        }
        programs::watch(&mut cargo(&["--", "--exact", test]), &self.words()).map(Ok)
    }

    /// What the last build or test has said.
    fn words(&self) -> PathBuf {
        self.scratch.build_folder("words.txt")
    }

    fn said(&self, text: &str) -> Result<bool> {
        Ok(read(&self.words())?.contains(text))
    }

    fn complaint(&self) -> String {
        let words = read(&self.words()).unwrap_or_default();
        let mut errors = words.lines().filter(|line| line.starts_with("error"));
        errors.next().unwrap_or("the compiler does not say why").to_owned()
    }
}

fn read(path: &Path) -> Result<String> {
    let bytes = std::fs::read(path).with_context(|| format!("cannot read {}", path.display()))?;
    Ok(String::from_utf8_lossy(&bytes).into_owned())
}

fn find_in(programs: &[Program], name: &str) -> Result<Option<(Program, String, bool)>> {
    let mut found = programs.iter().filter_map(|program| program.find(name).map(|test| (program, test)));
    let Some((program, (test, on_elf))) = found.next() else { return Ok(None) };
    if let Some((_, (another, _))) = found.next() {
        bail!("{name} may be {test} or {another}; give more of its name");
    }
    Ok(Some((program.clone(), test.to_owned(), on_elf)))
}
