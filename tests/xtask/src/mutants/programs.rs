//! Test programs: which there are, what is in them, and how one test is run.

use crate::process;
use anyhow::{Context, Result, bail};
use std::collections::BTreeSet;
use std::fs::File;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

/// A test that takes longer hangs: the longest takes half a minute on a machine that has other work too.
const PATIENCE: Duration = Duration::from_secs(300);

/// A test program.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Program {
    /// Its package's manifest, from the root of the sources.
    pub(super) manifest: PathBuf,
    /// What makes Cargo build this program and no other of the package.
    pub(super) selection: Vec<String>,
    executable: PathBuf,
    folder: PathBuf,
    tests: BTreeSet<String>,
    /// Those that need the ELF.
    on_elf: BTreeSet<String>,
}

/// How a test ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Ended {
    Green,
    Red,
    /// It was stopped after [`PATIENCE`].
    Hanging,
}

impl Program {
    /// The full name of a test in it, from its last parts; and whether it needs the ELF.
    pub(super) fn find(&self, name: &str) -> Option<(&str, bool)> {
        let mut found = self
            .tests
            .iter()
            .filter(|test| test.strip_suffix(name).is_some_and(|before| before.is_empty() || before.ends_with("::")));
        let test = found.next()?;
        Some((test, self.on_elf.contains(test)))
    }

    /// Runs one test of this program, with these variables.
    pub(super) fn run(&self, test: &str, variables: &[(&str, &Path)], output: &Path) -> Result<Ended> {
        let mut command = Command::new(&self.executable);
        command.current_dir(&self.folder).args(["--exact", "--include-ignored", "--test-threads", "1", test]);
        command.envs(variables.iter().copied());
        let ended = watch(&mut command, output)?;
        let text = std::fs::read_to_string(output).unwrap_or_default();
        if ended != Ended::Hanging && !text.contains("running 1 test") {
            bail!("{test} did not run: `{}` says {text:?}", process::words(&command));
        }
        Ok(ended)
    }
}

/// Builds the test programs of packages (none named: of the workspace's default members) and lists their tests.
///
/// # Errors
/// They do not build.
pub(super) fn build(root: &Path, arguments: &[&str], variables: &[(&str, &str)]) -> Result<Vec<Program>> {
    let mut cargo = process::cargo();
    cargo.current_dir(root).args(["test", "--quiet", "--no-run", "--lib", "--bins", "--tests"]);
    cargo.args(["--message-format", "json-render-diagnostics"]).args(arguments).envs(variables.iter().copied());
    let output =
        cargo.stderr(Stdio::inherit()).output().with_context(|| format!("cannot start {}", process::words(&cargo)))?;
    if !output.status.success() {
        bail!("the tests do not build without a defect; the compiler's messages above say why");
    }
    let mut programs = Vec::new();
    for line in String::from_utf8_lossy(&output.stdout).lines() {
        let message: serde_json::Value = serde_json::from_str(line).context("Cargo says what nobody understands")?;
        if let Some(program) = program(root, &message)? {
            programs.push(program);
        }
    }
    Ok(programs)
}

/// The test program that a message of Cargo's tells of.
fn program(root: &Path, message: &serde_json::Value) -> Result<Option<Program>> {
    let (Some(executable), Some(true)) = (message["executable"].as_str(), message["profile"]["test"].as_bool()) else {
        return Ok(None);
    };
    let manifest = Path::new(message["manifest_path"].as_str().context("a program without a package")?);
    let folder = manifest.parent().context("a package without a folder")?.to_owned();
    let (kind, name) = (&message["target"]["kind"][0], &message["target"]["name"]);
    let selection = match (kind.as_str().unwrap_or_default(), name.as_str().unwrap_or_default()) {
        (kind @ ("test" | "bin"), name) => vec![format!("--{kind}"), name.to_owned()],
        _ => vec!["--lib".to_owned()],
    };
    let executable = PathBuf::from(executable);
    let [tests, on_elf] = [&["--list"][..], &["--list", "--ignored"]].map(|arguments| {
        let mut list = Command::new(&executable);
        list.args(arguments).args(["--format", "terse"]).current_dir(&folder);
        let list = process::ask(&mut list).with_context(|| format!("{} does not list its tests", executable.display()));
        list.map(|list| list.lines().filter_map(|line| line.strip_suffix(": test")).map(str::to_owned).collect())
    });
    let manifest = manifest.strip_prefix(root).unwrap_or(manifest).to_owned();
    Ok(Some(Program { manifest, selection, executable, folder, tests: tests?, on_elf: on_elf? }))
}

/// Runs a command to its end, or until it hangs; what it says goes into a file.
pub(super) fn watch(command: &mut Command, output: &Path) -> Result<Ended> {
    let file = File::create(output).with_context(|| format!("cannot write {}", output.display()))?;
    let errors = file.try_clone().context("cannot write twice into one file")?;
    command.stdin(Stdio::null()).stdout(file).stderr(errors);
    let mut child = command.spawn().with_context(|| format!("cannot start {}", process::words(command)))?;
    let begin = Instant::now();
    loop {
        if let Some(status) = child.try_wait().context("a process cannot be waited for")? {
            return Ok(if status.success() { Ended::Green } else { Ended::Red });
        }
        if begin.elapsed() > PATIENCE {
            // Its QEMU ends with it, see the bus.
            child.kill().and_then(|()| child.wait()).context("a process that hangs cannot be stopped")?;
            return Ok(Ended::Hanging);
        }
        std::thread::sleep(Duration::from_millis(20));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn with(tests: &[&str], on_elf: &[&str]) -> Program {
        let set = |names: &[&str]| names.iter().map(|&name| name.to_owned()).collect();
        Program {
            manifest: PathBuf::new(),
            selection: Vec::new(),
            executable: std::env::current_exe().unwrap(),
            folder: PathBuf::from("."),
            tests: set(tests),
            on_elf: set(on_elf),
        }
    }

    #[test]
    fn a_test_is_found_by_the_last_parts_of_its_name() {
        let program = with(&["link::tests::a_reader", "qemu::keeps_pace"], &["qemu::keeps_pace"]);
        assert_eq!(program.find("a_reader"), Some(("link::tests::a_reader", false)));
        assert_eq!(program.find("qemu::keeps_pace"), Some(("qemu::keeps_pace", true)));
        assert_eq!(program.find("reader"), None);
        assert_eq!(program.find("pace"), None);
    }

    #[test]
    #[ignore = "a part of the next test"]
    fn red_when_told_to_be() {
        assert_eq!(std::env::var_os("TEST_IS_RED"), None);
    }

    #[test]
    fn red_green_and_not_there_are_told_apart() {
        let folder = tempfile::tempdir().unwrap();
        let output = folder.path().join("output");
        let name = "mutants::programs::tests::red_when_told_to_be";
        let program = with(&[], &[]);
        assert_eq!(program.run(name, &[], &output).unwrap(), Ended::Green);
        assert_eq!(program.run(name, &[("TEST_IS_RED", Path::new("1"))], &output).unwrap(), Ended::Red);
        let error = program.run("no_such_test", &[], &output).unwrap_err().to_string();
        assert!(error.contains("no_such_test did not run"), "{error}");
    }
}
