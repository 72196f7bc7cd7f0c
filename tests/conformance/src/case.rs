//! Cases, how they are run, and what comes of them.

use std::panic::{AssertUnwindSafe, catch_unwind};

use serde::Serialize;

use crate::slave::{Outcome, Slave};
use bench::DriveSetup;

/// The nine headings of the slave conformance test (sercos2.md 9, last line).
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Section {
    /// CP1, and who answers whom.
    Identification,
    /// Elements, lengths, limits.
    ServiceChannel,
    /// Set, start, interrupt, cancel.
    ProcedureCommands,
    /// S-0-0015, S-0-0016, S-0-0024.
    TelegramTypes,
    /// Lost telegrams, illegal phases, diagnosis.
    ErrorHandling,
    /// t1, t2, cycle times, bit rates.
    TimeSlots,
    /// CP0 to CP4.
    PhaseSwitch,
    /// Command valid, feedback captured.
    CommandAndFeedback,
    /// The data blocks that every master asks for.
    ComplianceClasses,
}

impl Section {
    /// All of them, in the order of the report.
    pub const ALL: [Self; 9] = [
        Self::Identification,
        Self::ServiceChannel,
        Self::ProcedureCommands,
        Self::TelegramTypes,
        Self::ErrorHandling,
        Self::TimeSlots,
        Self::PhaseSwitch,
        Self::CommandAndFeedback,
        Self::ComplianceClasses,
    ];

    /// The heading.
    #[must_use]
    pub const fn title(self) -> &'static str {
        match self {
            Self::Identification => "Identification",
            Self::ServiceChannel => "Service channel",
            Self::ProcedureCommands => "Procedure commands",
            Self::TelegramTypes => "Telegram types",
            Self::ErrorHandling => "Error handling",
            Self::TimeSlots => "Time slots",
            Self::PhaseSwitch => "Phase switch",
            Self::CommandAndFeedback => "t3 and t4 capture",
            Self::ComplianceClasses => "Compliance classes",
        }
    }
}

impl Section {
    /// Its name on a command line and in JSON.
    #[must_use]
    pub const fn slug(self) -> &'static str {
        match self {
            Self::Identification => "identification",
            Self::ServiceChannel => "service-channel",
            Self::ProcedureCommands => "procedure-commands",
            Self::TelegramTypes => "telegram-types",
            Self::ErrorHandling => "error-handling",
            Self::TimeSlots => "time-slots",
            Self::PhaseSwitch => "phase-switch",
            Self::CommandAndFeedback => "command-and-feedback",
            Self::ComplianceClasses => "compliance-classes",
        }
    }
}

/// What a case does with a fresh slave.
pub type Check = Box<dyn Fn(&mut Slave) -> Outcome + Send + Sync>;

/// One case.
pub struct Case {
    /// Its heading.
    pub section: Section,
    /// The rule in one line.
    pub rule: String,
    /// Where the rule stands.
    pub source: &'static str,
    /// Address of the slave.
    pub address: u8,
    setup: fn(u8) -> DriveSetup,
    check: Check,
}

impl Case {
    /// A case with a slave at address 5.
    pub fn new(
        section: Section,
        rule: impl Into<String>,
        source: &'static str,
        check: impl Fn(&mut Slave) -> Outcome + Send + Sync + 'static,
    ) -> Self {
        Self { section, rule: rule.into(), source, address: 5, setup: DriveSetup::catalogue, check: Box::new(check) }
    }

    /// The same with the slave at another address.
    #[must_use]
    pub fn at(mut self, address: u8) -> Self {
        self.address = address;
        self
    }

    /// The same with the motor, load and amplifier of a press.
    #[must_use]
    pub fn on_a_press(mut self) -> Self {
        self.setup = DriveSetup::new;
        self
    }

    /// Runs the case with a slave that has just been switched on.
    #[must_use]
    pub fn run(&self) -> CaseReport {
        let checked = catch_unwind(AssertUnwindSafe(|| {
            let mut slave = Slave::new((self.setup)(self.address));
            (self.check)(&mut slave)
        }));
        // A drive that panics must not take the other cases with it; what it said stands on stderr.
        let failure = checked.unwrap_or_else(|_| Err("panicked".to_owned())).err();
        CaseReport {
            section: self.section,
            rule: self.rule.clone(),
            source: self.source,
            passed: failure.is_none(),
            failure,
        }
    }
}

/// What came of a case.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct CaseReport {
    /// Its heading.
    pub section: Section,
    /// The rule in one line.
    pub rule: String,
    /// Where the rule stands.
    pub source: &'static str,
    /// Whether the slave keeps the rule.
    pub passed: bool,
    /// What was expected and what was seen, if not.
    pub failure: Option<String>,
}

/// What came of all cases.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct SlaveReport {
    /// In the order of the headings.
    pub cases: Vec<CaseReport>,
}

impl SlaveReport {
    /// Passed and all cases of a heading.
    #[must_use]
    pub fn count(&self, section: Section) -> (usize, usize) {
        let of = |case: &&CaseReport| case.section == section;
        let all = self.cases.iter().filter(of).count();
        (self.cases.iter().filter(of).filter(|case| case.passed).count(), all)
    }

    /// Whether every case has passed, and there is one.
    #[must_use]
    pub fn passed(&self) -> bool {
        !self.cases.is_empty() && self.cases.iter().all(|case| case.passed)
    }
}

/// Compares, and says both sides if they differ.
///
/// # Errors
/// They differ.
pub fn expect<T: PartialEq + std::fmt::Debug>(what: &str, seen: T, expected: T) -> Outcome {
    if seen == expected { Ok(()) } else { Err(format!("{what}: expected {expected:X?}, seen {seen:X?}")) }
}

/// Fails with this text unless the condition holds.
///
/// # Errors
/// It does not hold.
pub fn ensure(holds: bool, otherwise: impl FnOnce() -> String) -> Outcome {
    if holds { Ok(()) } else { Err(otherwise()) }
}
