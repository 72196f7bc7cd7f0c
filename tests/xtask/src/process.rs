//! Starting other programs.

use crate::Verdict;
use anyhow::{Context, Result};
use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// The Cargo that runs this program, or the one in PATH.
pub(crate) fn cargo() -> Command {
    Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()))
}

/// Where a program is, as the shell would find it.
pub(crate) fn find(program: &str) -> Option<PathBuf> {
    std::env::split_paths(&std::env::var_os("PATH")?)
        .map(|folder| folder.join(program))
        .find(|candidate| is_executable(candidate))
}

fn is_executable(path: &Path) -> bool {
    path.is_file() && rustix::fs::access(path, rustix::fs::Access::EXEC_OK).is_ok()
}

/// Runs a command whose output the user sees; a bad exit is a negative result, not a refusal.
pub(crate) fn watch(command: &mut Command) -> Result<Verdict> {
    let status = command.status().with_context(|| format!("cannot start {}", words(command)))?;
    Ok(if status.success() { Verdict::Passed } else { Verdict::Failed })
}

/// Runs a command and gives what it prints, or `None` if it cannot be started or fails.
pub(crate) fn ask(command: &mut Command) -> Option<String> {
    let output = command.stdin(Stdio::null()).stderr(Stdio::null()).output().ok()?;
    output.status.success().then(|| String::from_utf8_lossy(&output.stdout).trim().to_owned())
}

/// The command as one would type it.
pub(crate) fn words(command: &Command) -> String {
    let program = Path::new(command.get_program()).file_name().unwrap_or(command.get_program());
    std::iter::once(program).chain(command.get_args()).map(OsStr::to_string_lossy).collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_exit_of_a_watched_command_is_its_verdict() {
        assert_eq!(watch(&mut Command::new("true")).unwrap(), Verdict::Passed);
        assert_eq!(watch(&mut Command::new("false")).unwrap(), Verdict::Failed);
        let refused = watch(&mut Command::new("no-such-program-anywhere")).unwrap_err();
        assert!(refused.to_string().contains("no-such-program-anywhere"));
    }

    #[test]
    fn an_answer_is_given_only_by_a_command_that_succeeds() {
        assert_eq!(ask(Command::new("echo").arg("yes")).as_deref(), Some("yes"));
        assert_eq!(ask(&mut Command::new("false")), None);
        assert_eq!(ask(&mut Command::new("no-such-program-anywhere")), None);
    }
}
