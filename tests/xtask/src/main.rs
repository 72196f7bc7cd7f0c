//! `cargo xtask`: everything that is done with this repository, from a bare machine to a drive on the bench.
//!
//! Exit codes: 0 the command did what it says; 1 it ran and the result is negative (a test failed, a drive did not
//! reach CP4); 2 it could not run (bad arguments, malformed recording, missing tool), with one line on stderr that
//! names the cause and the remedy.
#![forbid(unsafe_code)]

mod budget;
#[cfg(test)]
mod citations;
mod cli;
mod clippy;
mod demo;
#[cfg(test)]
mod design;
mod doc;
mod elf;
#[cfg(test)]
mod examples;
mod explore;
mod faults;
mod firmware;
mod flash;
mod fuzz;
mod identity;
mod manual;
mod mutants;
mod parameters;
mod process;
mod progress;
#[cfg(test)]
mod readmes;
mod replay;
mod report;
mod ring_server;
mod scope;
mod setup;
mod size;
mod slave_report;
mod suite;
mod workspace;

use cli::{Command, CommandLine};
use std::process::ExitCode;

/// What came of a command that could run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Verdict {
    /// Exit code 0.
    Passed,
    /// Exit code 1.
    Failed,
}

fn main() -> ExitCode {
    let command_line = match cli::parse() {
        Ok(command_line) => command_line,
        Err(refused) => return refused.report(),
    };
    match run(command_line) {
        Ok(Verdict::Passed) => ExitCode::SUCCESS,
        Ok(Verdict::Failed) => ExitCode::from(1),
        Err(error) => {
            eprintln!("error: {}", cli::one_line(&format!("{error:#}")));
            ExitCode::from(2)
        }
    }
}

fn run(command_line: CommandLine) -> anyhow::Result<Verdict> {
    let installing = command_line.installing();
    match command_line.command {
        Command::Setup => setup::everything(installing),
        Command::Build { accept_size } => firmware::build_and_print(accept_size, installing),
        Command::Budget { markdown, profile } => {
            let style = if markdown { budget::Style::Markdown } else { budget::Style::Text };
            budget::run(style, profile.as_deref(), installing)
        }
        Command::Clippy => clippy::run(installing),
        Command::Doc => doc::run(installing),
        Command::Test { host, qemu } => suite::run(suite::Selection::from_flags(host, qemu), installing),
        Command::Fuzz { target, runs } => fuzz::run(target, runs, installing),
        Command::Demo { on, output } => demo::run(on.into(), output, installing),
        Command::Replay { file, on, json } => replay::run(&file, on.into(), json, installing),
        Command::SlaveReport { sections, json } => slave_report::run(&sections, json),
        Command::Manual { check } => manual::run(check),
        Command::Faults { on: cli::On::Qemu, .. } => faults::compare(installing),
        Command::Faults { check, on: cli::On::Host } => faults::run(check),
        Command::Explore(arguments) => arguments.run(),
        Command::Mutants(arguments) => mutants::run(&arguments.into(), installing),
        Command::Scope(arguments) => scope::run(&arguments.into()),
        Command::Parameters { command } => {
            let (action, which) = command.into();
            parameters::run(&action, &which, installing)
        }
        Command::Ring { drives, on, chip_socket } => ring_server::run(&drives, on.into(), &chip_socket, installing),
        Command::Identity(arguments) => arguments.run(),
        Command::Flash { probe } => flash::run(probe.as_deref(), installing),
    }
}
