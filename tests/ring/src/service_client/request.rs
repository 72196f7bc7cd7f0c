//! What a master asks for, and the steps it takes (sercos2.md 3.4, 3.6).

use std::collections::VecDeque;
use std::fmt;

use serde::Serialize;

use super::{ServiceError, Step, attribute_of};
use crate::ident::{Attribute, Element, Idn, Value};

/// Starts a procedure command: set and execution enabled.
const COMMAND_START: u16 = 3;
/// Cancels a procedure command.
const COMMAND_CANCEL: u16 = 0;
/// Data status of a command that was executed correctly.
const COMMAND_DONE: u16 = 3;
/// Bit of the data status: error.
const COMMAND_ERROR: u16 = 8;

/// One thing that a master wants from a drive.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub enum Request {
    /// One closing step, to see the handshake work.
    Handshake,
    /// Open, both words of the attribute, close.
    ReadAttribute(Idn),
    /// Open, attribute, operation data as long as the attribute says, close.
    Read(Idn),
    /// Open, attribute, then name, unit, minimum or maximum, close.
    ReadElement(Idn, Element),
    /// Open, operation data, close.
    Write(Idn, Value),
    /// The same with the attribute read first, as the recorded master does with lists.
    WriteList(Idn, Value),
    /// Open and close: the data status.
    DataStatus(Idn),
    /// The whole procedure: attribute, start, poll until it has ended, cancel, check that it is cancelled.
    Command {
        /// The procedure command.
        idn: Idn,
        /// How often the data status is asked for before the master gives up.
        polls: u32,
    },
    /// These steps as they are, whatever the drive answers to each: what no sound master would send.
    Steps(Vec<Step>),
}

impl Request {
    /// The data block; 0 for [`Request::Handshake`] and [`Request::Steps`].
    pub fn idn(&self) -> Idn {
        match self {
            Self::Handshake | Self::Steps(_) => Idn(0),
            Self::ReadAttribute(idn) | Self::Read(idn) | Self::ReadElement(idn, _) | Self::DataStatus(idn) => *idn,
            Self::Write(idn, _) | Self::WriteList(idn, _) | Self::Command { idn, .. } => *idn,
        }
    }
}

impl fmt::Display for Request {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Handshake => write!(formatter, "handshake"),
            Self::ReadAttribute(idn) => write!(formatter, "attribute of {idn}"),
            Self::Read(idn) => write!(formatter, "read {idn}"),
            Self::ReadElement(idn, element) => write!(formatter, "read {element:?} of {idn}"),
            Self::Write(idn, value) | Self::WriteList(idn, value) => write!(formatter, "write {idn} = {value}"),
            Self::DataStatus(idn) => write!(formatter, "data status of {idn}"),
            Self::Command { idn, .. } => write!(formatter, "command {idn}"),
            Self::Steps(steps) => write!(formatter, "{} steps", steps.len()),
        }
    }
}

/// What a request brought.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub enum Reply {
    /// It is done; there is nothing to tell.
    Done,
    /// The attribute.
    Attribute(Attribute),
    /// A value and the attribute that told its length.
    Data {
        /// The attribute.
        attribute: Attribute,
        /// The value.
        value: Value,
    },
    /// The data status.
    DataStatus(u16),
    /// A procedure command was executed correctly and cancelled.
    Command(CommandOutcome),
}

impl Reply {
    /// The value, if this is one.
    pub fn value(&self) -> Option<&Value> {
        match self {
            Self::Data { value, .. } => Some(value),
            _ => None,
        }
    }
}

/// How a procedure command went.
#[derive(Copy, Clone, Debug, PartialEq, Eq, Serialize)]
pub struct CommandOutcome {
    /// Data status when it had ended.
    pub status: u16,
    /// How often the data status was asked for.
    pub polls: u32,
}

/// What comes next in a request.
pub(super) enum Progress {
    Step(Step),
    Done,
    /// The channel is to be closed; [`Script::result`] says why.
    Failed,
}

#[derive(Clone, Debug)]
enum Task {
    Open,
    OpenToPoll,
    OpenToCheckCancelled,
    Attribute,
    Read(Element),
    Write(Vec<u16>),
    AsIs(Step),
    Close,
}

/// What the answer to the current step is good for.
#[derive(Copy, Clone, Debug, PartialEq, Eq)]
enum Expecting {
    Nothing,
    Status,
    CommandStatus,
    CancelledStatus,
    AttributeLow,
    AttributeHigh,
    DataWord,
}

/// The steps of one request, planned as far as they are known.
#[derive(Clone, Debug)]
pub(super) struct Script {
    request: Request,
    tasks: VecDeque<Task>,
    expecting: Expecting,
    attribute_low: u16,
    attribute: Option<Attribute>,
    written: usize,
    words: Vec<u16>,
    status: u16,
    polls: u32,
    failure: Option<ServiceError>,
    /// A command that failed is still cancelled before the request ends.
    command_failure: Option<ServiceError>,
}

impl Script {
    pub(super) fn new(request: &Request) -> Self {
        let tasks: Vec<Task> = match request {
            Request::Handshake => vec![Task::Close],
            Request::ReadAttribute(_) => vec![Task::Open, Task::Attribute, Task::Close],
            Request::Read(_) => vec![Task::Open, Task::Attribute, Task::Read(Element::Data), Task::Close],
            Request::ReadElement(_, element) => vec![Task::Open, Task::Attribute, Task::Read(*element), Task::Close],
            Request::Write(_, value) => vec![Task::Open, Task::Write(value.to_words()), Task::Close],
            Request::WriteList(_, value) => {
                vec![Task::Open, Task::Attribute, Task::Write(value.to_words()), Task::Close]
            }
            Request::DataStatus(_) => vec![Task::Open, Task::Close],
            Request::Steps(steps) => steps.iter().copied().map(Task::AsIs).collect(),
            Request::Command { .. } => {
                vec![Task::Open, Task::Attribute, Task::Write(vec![COMMAND_START]), Task::Close, Task::OpenToPoll]
            }
        };
        Self {
            request: request.clone(),
            tasks: tasks.into(),
            expecting: Expecting::Nothing,
            attribute_low: 0,
            attribute: None,
            written: 0,
            words: Vec::new(),
            status: 0,
            polls: 0,
            failure: None,
            command_failure: None,
        }
    }

    /// The info word of the AT that acknowledged the last step.
    pub(super) fn reply(&mut self, info: u16) {
        match std::mem::replace(&mut self.expecting, Expecting::Nothing) {
            Expecting::Nothing => {}
            Expecting::Status if self.polls == 0 => self.status = info,
            Expecting::Status => {}
            Expecting::CommandStatus => self.command_polled(info),
            Expecting::CancelledStatus if info != 0 => {
                self.failure = Some(ServiceError::NotCancelled { idn: self.request.idn(), status: info });
            }
            Expecting::CancelledStatus => {}
            Expecting::AttributeLow => self.attribute_low = info,
            Expecting::AttributeHigh => self.attribute = Some(attribute_of(self.attribute_low, info)),
            Expecting::DataWord => self.words.push(info),
        }
    }

    /// The next step; `info` is the info word that a closing step leaves standing.
    pub(super) fn next(&mut self, info: u16) -> Progress {
        loop {
            if self.failure.is_some() {
                return Progress::Failed;
            }
            let Some(task) = self.tasks.front().cloned() else { return Progress::Done };
            let step = match task {
                Task::Open => self.last(Step::open(self.request.idn()), Expecting::Status),
                Task::OpenToPoll => self.last(Step::open(self.request.idn()), Expecting::CommandStatus),
                Task::OpenToCheckCancelled => self.last(Step::open(self.request.idn()), Expecting::CancelledStatus),
                Task::AsIs(step) => self.last(step, Expecting::Nothing),
                Task::Close => self.last(Step::close(info), Expecting::Nothing),
                Task::Attribute => self.attribute_step(info),
                Task::Read(element) => match self.read_step(element, info) {
                    Some(step) => step,
                    None => continue,
                },
                Task::Write(words) => {
                    let step = Step {
                        element: Element::Data,
                        write: true,
                        end: self.written + 1 >= words.len(),
                        info: words[self.written],
                    };
                    self.written += 1;
                    if step.end {
                        self.written = 0;
                        self.tasks.pop_front();
                    }
                    step
                }
            };
            return Progress::Step(step);
        }
    }

    pub(super) fn result(self) -> Result<Reply, ServiceError> {
        if let Some(error) = self.failure.or(self.command_failure) {
            return Err(error);
        }
        Ok(match (&self.request, self.attribute) {
            (Request::ReadAttribute(_), Some(attribute)) => Reply::Attribute(attribute),
            (Request::Read(_), Some(attribute)) => {
                Reply::Data { attribute, value: Value::of_words(&self.words, attribute.is_variable()) }
            }
            (Request::ReadElement(_, element), Some(attribute)) => {
                Reply::Data { attribute, value: Value::of_words(&self.words, is_variable(*element, attribute)) }
            }
            (Request::DataStatus(_), _) => Reply::DataStatus(self.status),
            (Request::Command { .. }, _) => Reply::Command(CommandOutcome { status: self.status, polls: self.polls }),
            _ => Reply::Done,
        })
    }

    fn last(&mut self, step: Step, expecting: Expecting) -> Step {
        self.tasks.pop_front();
        self.expecting = expecting;
        step
    }

    /// The recorded master leaves the IDN standing as info word while it reads.
    fn attribute_step(&mut self, info: u16) -> Step {
        let step = Step { element: Element::Attribute, write: false, end: self.written == 1, info };
        if step.end {
            self.written = 0;
            return self.last(step, Expecting::AttributeHigh);
        }
        self.written = 1;
        self.expecting = Expecting::AttributeLow;
        step
    }

    /// `None` when the element has been read completely, or cannot be.
    fn read_step(&mut self, element: Element, info: u16) -> Option<Step> {
        let attribute = self.attribute.unwrap_or(Attribute(0));
        let total = if is_variable(element, attribute) {
            self.words.first().map(|bytes| 2 + usize::from(*bytes).div_ceil(2))
        } else if let Some(bytes) = attribute.fixed_bytes() {
            Some(bytes / 2)
        } else {
            self.failure = Some(ServiceError::ReservedLength { idn: self.request.idn(), attribute: attribute.0 });
            return None;
        };
        if total == Some(self.words.len()) {
            self.tasks.pop_front();
            return None;
        }
        self.expecting = Expecting::DataWord;
        Some(Step { element, write: false, end: total == Some(self.words.len() + 1), info })
    }

    fn command_polled(&mut self, status: u16) {
        self.status = status;
        self.polls += 1;
        let allowed = match self.request {
            Request::Command { polls, .. } => polls,
            _ => 0,
        };
        let failed = ServiceError::CommandFailed { idn: self.request.idn(), status, polls: self.polls };
        let cancel = [Task::Close, Task::Open, Task::Write(vec![COMMAND_CANCEL]), Task::Close];
        if status == COMMAND_DONE {
            self.tasks.extend(cancel);
            self.tasks.extend([Task::OpenToCheckCancelled, Task::Close]);
        } else if status & COMMAND_ERROR != 0 {
            self.command_failure = Some(failed);
            self.tasks.extend(cancel);
        } else if self.polls < allowed {
            self.tasks.extend([Task::Close, Task::OpenToPoll]);
        } else {
            self.failure = Some(failed);
        }
    }
}

/// Names and units are texts whatever the operation data is; limits are as long as the data.
fn is_variable(element: Element, attribute: Attribute) -> bool {
    matches!(element, Element::Name | Element::Unit) || attribute.is_variable()
}
