//! The command line: words, help texts, and how a refusal is said.

use crate::explore::{self, One, Until};
use crate::fuzz::Target;
use crate::identity;
use crate::mutants::{self, Sorts};
use crate::parameters::ParametersCommand;
use crate::report::data::Platform;
use crate::scope::{Edge, Order, Settings, Signal};
use crate::setup::Installing;
use clap::builder::{PossibleValuesParser, TypedValueParser};
use clap::{Args, Parser, Subcommand, ValueEnum, error::ErrorKind};
use conformance::Section;
use std::path::PathBuf;
use std::process::ExitCode;

/// Everything that is done with this repository.
///
/// Each command first sees to what it needs itself (QEMU, the compiler for the drive's processor), and says so before
/// it installs anything.
#[derive(Debug, Parser)]
#[command(
    name = "cargo xtask",
    bin_name = "cargo xtask",
    after_help = "Exit codes: 0 done, 1 ran and failed, 2 could not run (one line says why and what to do).",
    disable_help_subcommand = true,
    max_term_width = 100
)]
pub(crate) struct CommandLine {
    /// Install nothing: where something is missing, say which command would install it and stop
    #[arg(long, global = true)]
    no_install: bool,
    #[command(subcommand)]
    pub(crate) command: Command,
}

#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Check what is needed for the other commands, and install what is missing
    Setup,
    /// Build the release ELF of the drive and the bus inside QEMU, and print the section sizes
    ///
    /// Fails if the drive takes another amount of flash or RAM than accepted, or keeps a constant table in RAM; so do all
    /// commands that build it.
    Build {
        /// Make the present sizes the accepted ones, in firmware/app/size.txt
        #[arg(long)]
        accept_size: bool,
    },
    /// Count the instructions of every task of the release ELF, and look for what must not be in it
    ///
    /// The ELF runs in QEMU and follows a ring of 500 us; each instruction of 100 ms is logged and counted. Fails, with one line for each
    /// gate, if a task takes more than its budget or longer than its period, or if a panic, a division or whatever else is forbidden can be
    /// reached from it. The gates are in tests/xtask/src/budget/gates.rs.
    Budget {
        /// Print the tables as Markdown
        #[arg(long)]
        markdown: bool,
        /// Instead of the tables: where the instructions of this task go, function by function, inlined ones too
        #[arg(long, value_name = "TASK", conflicts_with = "markdown")]
        profile: Option<String>,
    },
    /// Run clippy over the host crates and, where the compiler can, the target crates; warnings are errors
    Clippy,
    /// Make the documentation of the host crates and of the target crates; warnings are errors
    Doc,
    /// Run the tests: on this computer and, with the release ELF, in QEMU
    Test {
        /// Only the tests that run on this computer
        #[arg(long, conflicts_with = "qemu")]
        host: bool,
        /// Only the tests that run the release ELF in QEMU
        #[arg(long)]
        qemu: bool,
    },
    /// Run the fuzz targets: random bytes, led by coverage, as service steps, parameters, telegrams and files
    Fuzz {
        /// Only this target
        #[arg(long, value_enum, value_name = "NAME")]
        target: Option<Target>,
        /// Executions of each target
        #[arg(long, value_name = "N", default_value_t = 10_000_000, value_parser = clap::value_parser!(u64).range(1..))]
        runs: u64,
    },
    /// Boot the release ELF in QEMU as drive 2 of a simulated press ring, run it up and let it follow a line shaft
    Demo {
        /// Where drive 2 runs; the other drives always run on this computer
        #[arg(long, value_enum, default_value_t = On::Qemu)]
        on: On,
        /// Folder for the report [default: demo in Cargo's target folder]
        #[arg(long, value_name = "FOLDER")]
        output: Option<PathBuf>,
    },
    /// Play a recording of a real master against one drive per address found in it
    Replay {
        /// The recording: cycle, kind, bytes, fcs and line levels, tab-separated, one telegram a line
        file: PathBuf,
        /// Where drive 1 runs; the other drives always run on this computer
        #[arg(long, value_enum, default_value_t = On::Host)]
        on: On,
        /// Print the result as JSON
        #[arg(long)]
        json: bool,
    },
    /// Test the slave against the rules of SERCOS II, case by case under nine headings, on a simulated ring
    ///
    /// Every case starts with a drive that has just been switched on, and goes through its chip. Run it after a change of the
    /// protocol, or with `--json` to compare two versions.
    SlaveReport {
        /// Only the cases under this heading; may be given several times
        #[arg(long = "section", value_name = "HEADING", value_parser = section_parser())]
        sections: Vec<Section>,
        /// Print the result as JSON
        #[arg(long)]
        json: bool,
    },
    /// Write the manual page of all data blocks and diagnoses, docs/idn.md, from the tables of the firmware
    Manual {
        /// Write nothing: fail if the page is not what the tables say
        #[arg(long)]
        check: bool,
    },
    /// Write the fault matrix, docs/fault-matrix.md: what the drive does about every fault, by state and operation mode
    ///
    /// Every cell is a simulated run of the whole firmware on a ring, about half a minute for all of them. Fails, with one line for each cell,
    /// where the drive does not do what tests/fault_matrix/src/expected.rs asks of it, and writes nothing then.
    Faults {
        /// Write nothing: fail if the page is not what the drive does
        #[arg(long)]
        check: bool,
        /// Where every cell is run: `qemu` writes nothing, and fails where the release ELF does otherwise than the portable crates
        #[arg(long, value_enum, default_value_t = On::Host, conflicts_with = "check")]
        on: On,
    },
    /// Let random axes live random lives, and hold them to the laws of the axis
    ///
    /// Everything of a life comes from its seed: machine, ring, scaling, polarity, limits, modes, and then control bits, commands, services,
    /// lost telegrams, faults, loads and supply. At its end everything is repaired, and the axis must come back. Fails if a law is broken,
    /// and prints the life shrunk to a few words, with the command that replays it; then what was covered, and what was never reached.
    Explore(ExploreArguments),
    /// Break the drive on purpose, one defect at a time, and say which of them no test sees
    ///
    /// First the patches of tests/defects, made by hand for what only the hardware shows: each is built and run with the tests that must turn red,
    /// or must not compile. Then what cargo-mutants makes of the safety files of the portable crates, with their own tests and, for what those do
    /// not see, the laws of the axis. Fails if a defect stays unseen that is not listed with its reason in docs/mutants.md, and if a patch does
    /// not apply. Works on a copy of the sources in Cargo's target folder.
    Mutants(MutantsArguments),
    /// Record a velocity step with the drive's own oscilloscope, read it over the service channel, and draw it
    ///
    /// One drive on a simulated ring, on this computer. A signal is a data block (`S-0-0040`) or a signal inside the loops, by its
    /// number: `F000` and `F001` position feedback and setpoint, `F002` following error, `F003` and `F004` velocity feedback and
    /// setpoint, `F005` velocity error, `F006` current setpoint, `F010` to `F019` the current loop.
    Scope(ScopeArguments),
    /// Save, load, compare and print the parameters of a drive: a text file for people and version control
    ///
    /// The drive is a simulated one, on a ring of its own and in CP2. Without `--flash` it has the defaults and forgets everything behind the
    /// command. The file is TOML: IDN, name, value in its unit.
    #[command(disable_help_subcommand = true)]
    Parameters {
        #[command(subcommand)]
        command: ParametersCommand,
    },
    /// Serve the registers and the RAM of a master's SERCON816 on a simulated ring, for a foreign master driver
    ///
    /// One command a line, one answer a line, all numbers hexadecimal but the count of cycles:
    /// `r 0b` and `w 0a 0001` read and write registers, `R 012` and `W 012 5001` RAM words,
    /// `cycles 5` lets the ring run so many cycles, `time` tells the simulated time.
    Ring {
        /// Addresses of the drives, in ring order
        #[arg(long, value_delimiter = ',', required = true, value_name = "ADDRESSES",
              value_parser = clap::value_parser!(u8).range(1..=254))]
        drives: Vec<u8>,
        /// Where the drives run, all of them
        #[arg(long, value_enum, default_value_t = On::Host)]
        on: On,
        /// Unix socket to serve; it must not exist yet
        #[arg(long, value_name = "PATH")]
        chip_socket: PathBuf,
    },
    /// Write the production record into a real board with probe-rs: what amplifier it is, its serial number
    ///
    /// Once, where the drive is built. The data sheet is TOML, as docs/amplifier.toml; what does not go together is refused. A new program leaves the
    /// record as it is, and no control can change it.
    Identity(IdentityArguments),
    /// Write the release ELF into a real board with probe-rs and show its log
    Flash {
        /// Debug probe to use, as `probe-rs list` names it
        #[arg(long, value_name = "VID:PID[:SERIAL]")]
        probe: Option<String>,
    },
}

/// What `cargo xtask identity` writes, and where.
#[derive(Debug, Args)]
pub(crate) struct IdentityArguments {
    /// Data sheet of the amplifier, TOML
    file: PathBuf,
    /// Instead of a board: write the record into this file, as the flash holds it at 080A0000H
    #[arg(long, value_name = "FILE", conflicts_with_all = ["probe", "replace"])]
    output: Option<PathBuf>,
    /// Debug probe to use, as `probe-rs list` names it
    #[arg(long, value_name = "VID:PID[:SERIAL]")]
    probe: Option<String>,
    /// Also over another record
    #[arg(long)]
    replace: bool,
}

impl IdentityArguments {
    /// Does what the arguments ask for.
    pub(crate) fn run(self) -> anyhow::Result<crate::Verdict> {
        let Self { file, output, probe, replace } = self;
        let action = output.map_or(identity::Action::Board { probe, replace }, identity::Action::File);
        identity::run(&file, &action)
    }
}

/// What `cargo xtask explore` explores.
#[derive(Debug, Args)]
pub(crate) struct ExploreArguments {
    /// How long: a number and s, m or h
    #[arg(long = "for", value_name = "DURATION", value_parser = explore::duration, conflicts_with = "lives")]
    duration: Option<std::time::Duration>,
    /// How many lives [default: 2000, if no duration is given]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    lives: Option<u64>,
    /// Seed of the run: the same seed, the same lives
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Worker processes at a time [default: as many as there are cores]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    jobs: Option<u16>,
    /// Instead: live the life of this seed again, as a run has printed it
    #[arg(long, value_name = "SEED", value_parser = life_seed, conflicts_with_all = ["duration", "lives", "jobs", "replay"])]
    life: Option<u64>,
    /// With --life: shrink it first
    #[arg(long, requires = "life")]
    shrink: bool,
    /// Instead: live the life in this file
    #[arg(long, value_name = "FILE", conflicts_with_all = ["duration", "lives", "jobs"])]
    replay: Option<PathBuf>,
}

impl ExploreArguments {
    /// Does what the arguments ask for.
    pub(crate) fn run(self) -> anyhow::Result<crate::Verdict> {
        match (self.life, self.replay) {
            (Some(seed), _) if self.shrink => explore::replay(&One::Shrunk(seed)),
            (Some(seed), _) => explore::replay(&One::Seed(seed)),
            (None, Some(file)) => explore::replay(&One::File(file)),
            (None, None) => {
                let until = self.duration.map_or(Until::Lives(self.lives.unwrap_or(2_000)), Until::Time);
                explore::run(&explore::Order { seed: self.seed, until, jobs: self.jobs })
            }
        }
    }
}

/// A seed, decimal or hexadecimal with 0x.
fn life_seed(text: &str) -> Result<u64, String> {
    let number = match text.strip_prefix("0x") {
        Some(digits) => u64::from_str_radix(digits, 16),
        None => text.parse(),
    };
    number.map_err(|_| format!("'{text}' is no seed; give a number of 64 bits, decimal or with 0x"))
}

/// What `cargo xtask mutants` breaks.
#[derive(Debug, Args)]
pub(crate) struct MutantsArguments {
    /// Break nothing: list the patches
    #[arg(long, conflicts_with = "portable")]
    list: bool,
    /// Only these patches, by name; with --portable only these files
    #[arg(long, num_args = 1.., value_name = "NAME")]
    only: Vec<String>,
    /// Only so many patches, spread over all of them
    #[arg(long, value_name = "N", conflicts_with_all = ["only", "portable"], value_parser = clap::value_parser!(u16).range(1..))]
    sample: Option<u16>,
    /// Only the patches
    #[arg(long, conflicts_with = "portable")]
    defects: bool,
    /// Only the safety files of the portable crates
    #[arg(long)]
    portable: bool,
}

impl From<MutantsArguments> for mutants::Order {
    fn from(arguments: MutantsArguments) -> Self {
        let patches_only = arguments.defects || arguments.sample.is_some() || !arguments.only.is_empty();
        let sorts = match (arguments.portable, patches_only) {
            (true, _) => Sorts::Portable,
            (false, true) => Sorts::Patches,
            (false, false) => Sorts::Both,
        };
        Self { list: arguments.list, only: arguments.only, sample: arguments.sample.map(usize::from), sorts }
    }
}

/// What `cargo xtask scope` records, and where it goes.
#[derive(Debug, Args)]
pub(crate) struct ScopeArguments {
    /// What a channel records; may be given up to four times
    #[arg(long = "signal", value_name = "SIGNAL", default_values = ["F004", "F003", "F006", "S-0-0040"])]
    signals: Vec<Signal>,
    /// Which of the signals is compared with the level, counted from 1
    #[arg(long, value_name = "CHANNEL", default_value_t = 1, value_parser = channel_parser())]
    trigger_channel: usize,
    /// What the recording waits for
    #[arg(long, value_enum, default_value_t = Edge::Rising)]
    edge: Edge,
    /// Level of the trigger, in the unit of its signal
    #[arg(long, value_name = "VALUE", default_value_t = 1.0, allow_negative_numbers = true)]
    level: f64,
    /// Points kept from before the trigger
    #[arg(long, value_name = "POINTS", default_value_t = 128, value_parser = clap::value_parser!(u16).range(0..=2_047))]
    pre_trigger: u16,
    /// 0: a point every 62.5 us; N: a point every N times 125 us
    #[arg(long, value_name = "N", default_value_t = 1)]
    sampling: u16,
    /// Points of each channel to read; a recording has 2048
    #[arg(long, value_name = "POINTS", default_value_t = 2_048, value_parser = clap::value_parser!(u16).range(1..=2_048))]
    points: u16,
    /// Step of the velocity command, made as soon as the oscilloscope waits for its trigger
    #[arg(long, value_name = "RPM", default_value_t = 300.0, allow_negative_numbers = true)]
    rpm: f64,
    /// Folder for the plot [default: scope in Cargo's target folder]
    #[arg(long, value_name = "FOLDER")]
    output: Option<PathBuf>,
    /// Write the points as a table, too: time in microseconds from the trigger, then a column a signal
    #[arg(long, value_name = "FILE")]
    csv: Option<PathBuf>,
}

impl From<ScopeArguments> for Order {
    fn from(arguments: ScopeArguments) -> Self {
        let settings = Settings {
            signals: arguments.signals,
            trigger_channel: arguments.trigger_channel,
            edge: arguments.edge,
            level: arguments.level,
            pre_trigger: arguments.pre_trigger,
            sampling: arguments.sampling,
            points: arguments.points,
        };
        Self { settings, rpm: arguments.rpm, output: arguments.output, csv: arguments.csv }
    }
}

/// Channels 1 to 4.
fn channel_parser() -> impl TypedValueParser<Value = usize> {
    clap::value_parser!(u8).range(1..=4).map(usize::from)
}

/// Headings by their names.
fn section_parser() -> impl TypedValueParser<Value = Section> {
    PossibleValuesParser::new(Section::ALL.map(Section::slug)).map(|name| {
        let found = Section::ALL.into_iter().find(|section| section.slug() == name);
        found.unwrap_or(Section::Identification)
    })
}

/// Where the drive under test runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum On {
    /// The portable crates, compiled for this computer
    Host,
    /// The release ELF in QEMU
    Qemu,
}

impl From<On> for Platform {
    fn from(on: On) -> Self {
        match on {
            On::Host => Self::Host,
            On::Qemu => Self::Qemu,
        }
    }
}

impl CommandLine {
    /// May this run install something?
    pub(crate) fn installing(&self) -> Installing {
        if self.no_install { Installing::Never } else { Installing::Allowed }
    }
}

/// The command line was not understood, or asked for help.
pub(crate) struct Refused(clap::Error);

impl Refused {
    /// Prints help to stdout, or what is wrong as one line to stderr; gives the exit code.
    pub(crate) fn report(&self) -> ExitCode {
        match self.0.kind() {
            ErrorKind::DisplayHelp | ErrorKind::DisplayVersion => {
                // A closed pipe behind `--help | head` is not worth a word.
                let _ = self.0.print();
                ExitCode::SUCCESS
            }
            _ => {
                eprintln!("error: {}", refusal(&self.0.to_string()));
                ExitCode::from(2)
            }
        }
    }
}

/// Reads the arguments of this process.
pub(crate) fn parse() -> Result<CommandLine, Refused> {
    CommandLine::try_parse().map_err(Refused)
}

/// The cause out of clap's several lines, and where to read on.
fn refusal(clap_text: &str) -> String {
    let usage = "see `cargo xtask --help`";
    let cause: Vec<&str> = clap_text
        .lines()
        .map(str::trim)
        .take_while(|line| !line.starts_with("Usage:") && !line.starts_with("For more information"))
        .filter(|line| !line.is_empty())
        .collect();
    let cause = cause.join(" ");
    let cause = cause.strip_prefix("error: ").unwrap_or(&cause);
    if cause.is_empty() { format!("a command is missing; {usage}") } else { format!("{cause}; {usage}") }
}

/// Folds a message of several lines into one.
pub(crate) fn one_line(message: &str) -> String {
    message.lines().map(str::trim).filter(|line| !line.is_empty()).collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    #[test]
    fn the_definition_of_the_command_line_is_consistent() {
        CommandLine::command().debug_assert();
    }

    #[test]
    fn clap_refusals_become_one_line_with_the_cause() {
        let error = CommandLine::try_parse_from(["xtask", "replay", "file", "--on", "moon"]).unwrap_err();
        let line = refusal(&error.to_string());
        assert!(!line.contains('\n'), "{line}");
        assert!(line.starts_with("invalid value 'moon'"), "{line}");
        assert!(line.contains("host, qemu"), "{line}");
        assert!(line.ends_with("see `cargo xtask --help`"), "{line}");
    }

    #[test]
    fn a_message_of_several_lines_is_folded() {
        assert_eq!(one_line("first\n   second\n\nthird"), "first second third");
    }
}
