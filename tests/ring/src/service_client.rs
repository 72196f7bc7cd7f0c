//! The master's side of one drive's service channel.
//!
//! A [`ServiceClient`] is asked once for every record that the master sends to its drive. It holds one step until the
//! drive has acknowledged it (AHS = MHS, BUSY = 0) and then takes the next one of the request in hand; what a request
//! consists of is sercos2.md 3.4 and 3.6.

mod request;

use std::collections::VecDeque;
use std::fmt;

use serde::Serialize;
use thiserror::Error;

use crate::ident::{Attribute, Element, Idn, Value};

pub use request::{CommandOutcome, Reply, Request};
use request::{Progress, Script};

/// Bits of the AT's status word (sercos2.md 1.7).
pub mod status {
    /// Drive handshake AHS.
    pub const HANDSHAKE: u16 = 1;
    /// A step is being processed.
    pub const BUSY: u16 = 1 << 1;
    /// The info word holds an error code.
    pub const ERROR: u16 = 1 << 2;
    /// Command values are followed.
    pub const FOLLOWS: u16 = 1 << 3;
    /// A procedure command has ended.
    pub const COMMAND_CHANGE: u16 = 1 << 5;
    /// Class 1 diagnostic: the drive has shut down.
    pub const SHUT_DOWN: u16 = 1 << 13;

    /// Bits 15..14, ready to operate: 0 not, 1 logic, 2 power, 3 torque.
    pub const fn readiness(status: u16) -> u16 {
        status >> 14
    }
}

/// Bits of the MDT's control word (sercos2.md 1.6).
pub mod control {
    /// Master handshake MHS.
    pub const HANDSHAKE: u16 = 1;
    /// Write; read when clear.
    pub const WRITE: u16 = 1 << 1;
    /// Last step of this element.
    pub const END: u16 = 1 << 2;
    /// All bits of the service channel.
    pub const SERVICE: u16 = 0x3F;
    /// Control-unit synchronisation IPOSYNC.
    pub const IPOSYNC: u16 = 1 << 10;
    /// Follow the command values; a halt when clear.
    pub const NO_HALT: u16 = 1 << 13;
    /// Drive enable.
    pub const ENABLE: u16 = 1 << 14;
    /// Drive on.
    pub const ON: u16 = 1 << 15;
}

/// Communication cycles within which a drive must set AHS = MHS (sercos2.md 3.3).
pub const HANDSHAKE_TIMEOUT_CYCLES: u32 = 10;
/// Cycles of BUSY after which this master gives up; no value for SERCOS II is known (sercos2.md 3.3).
pub const BUSY_TIMEOUT_CYCLES: u32 = 2_000;

/// Status and info word of an AT.
#[derive(Copy, Clone, Debug, PartialEq, Eq)]
pub struct AtWords {
    /// First word of the data field.
    pub status: u16,
    /// Second word.
    pub info: u16,
}

/// Service channel bits and info word for an MDT record.
#[derive(Copy, Clone, Debug, PartialEq, Eq)]
pub struct MdtWords {
    /// Bits 5..0 of the control word.
    pub control: u16,
    /// Second word of the record.
    pub info: u16,
}

/// One step: what the master asks for with one change of its handshake bit.
#[derive(Copy, Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Step {
    /// Element.
    pub element: Element,
    /// L/S: the master writes.
    pub write: bool,
    /// END: the last step of the element.
    pub end: bool,
    /// Info word.
    pub info: u16,
}

impl Step {
    /// Open a data block.
    pub const fn open(idn: Idn) -> Self {
        Self { element: Element::Idn, write: true, end: true, info: idn.0 }
    }

    /// Close the channel; the info word is whatever was there before.
    pub const fn close(info: u16) -> Self {
        Self { element: Element::Close, write: true, end: true, info }
    }

    /// Bits 5..1 of the control word.
    pub const fn control(self) -> u16 {
        let write = if self.write { control::WRITE } else { 0 };
        let end = if self.end { control::END } else { 0 };
        (self.element as u16) << 3 | end | write
    }

    /// From a record on the wire.
    pub const fn of_words(words: MdtWords) -> Self {
        Self {
            element: Element::of_control(words.control),
            write: words.control & control::WRITE != 0,
            end: words.control & control::END != 0,
            info: words.info,
        }
    }
}

impl fmt::Display for Step {
    /// `open S-0-0003`, `read Attribute`, `write Data 07d0 END`.
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let end = if self.end { " END" } else { "" };
        match (self.element, self.write) {
            (Element::Close, _) => write!(formatter, "close"),
            (Element::Idn, true) => write!(formatter, "open {}", Idn(self.info)),
            (element, true) => write!(formatter, "write {element:?} {:04x}{end}", self.info),
            (element, false) => write!(formatter, "read {element:?}{end}"),
        }
    }
}

/// A step that the drive has acknowledged, and how long it took.
#[derive(Copy, Clone, Debug, PartialEq, Eq, Serialize)]
pub struct StepRecord {
    /// The step.
    pub step: Step,
    /// Records sent with it until the AT that acknowledged it: 1 is the fastest.
    pub cycles: u32,
    /// The info word of the acknowledging AT.
    pub reply: u16,
    /// Whether that AT carried the error bit; `reply` is the error code then.
    pub error: bool,
}

/// A request that has ended.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Finished {
    /// What was asked for.
    pub request: Request,
    /// What came of it.
    pub result: Result<Reply, ServiceError>,
    /// Its steps.
    pub steps: Vec<StepRecord>,
}

impl Finished {
    /// Cycles of all steps together.
    pub fn cycles(&self) -> u32 {
        self.steps.iter().map(|step| step.cycles).sum()
    }
}

/// Why a request failed.
#[derive(Copy, Clone, Debug, PartialEq, Eq, Error, Serialize)]
pub enum ServiceError {
    /// The drive answered with an error code (sercos2.md 3.5).
    #[error("{idn}: {step} refused with {code:#06x} ({})", meaning(*code))]
    Refused {
        /// The data block.
        idn: Idn,
        /// The step that was refused.
        step: Step,
        /// The info word.
        code: u16,
    },
    /// AHS did not follow MHS in time.
    #[error("{idn}: handshake timeout, {step} not acknowledged in {cycles} cycles")]
    HandshakeTimeout {
        /// The data block.
        idn: Idn,
        /// The step that was not acknowledged.
        step: Step,
        /// Cycles waited.
        cycles: u32,
    },
    /// BUSY did not end.
    #[error("{idn}: busy timeout, {step} not finished in {cycles} cycles")]
    BusyTimeout {
        /// The data block.
        idn: Idn,
        /// The step that was not finished.
        step: Step,
        /// Cycles waited.
        cycles: u32,
    },
    /// A procedure command ended with another data status than "executed correctly" (3).
    #[error("{idn}: command ended with data status {status:#x} after {polls} polls, expected 3")]
    CommandFailed {
        /// The command.
        idn: Idn,
        /// Its data status.
        status: u16,
        /// How often it was asked for.
        polls: u32,
    },
    /// After being cancelled a procedure command still shows a data status.
    #[error("{idn}: data status {status:#x} after the command was cancelled, expected 0")]
    NotCancelled {
        /// The command.
        idn: Idn,
        /// Its data status.
        status: u16,
    },
    /// An attribute whose length bits mean nothing.
    #[error("{idn}: attribute {attribute:#010x} has a reserved data length")]
    ReservedLength {
        /// The data block.
        idn: Idn,
        /// Its attribute.
        attribute: u32,
    },
}

/// The plain words of an error code (sercos2.md 3.5).
pub fn meaning(code: u16) -> &'static str {
    match (code >> 12, code & 0x0FFF) {
        (0, 1) => "service channel not open",
        (0, 9) => "invalid access to closing the channel",
        (1, 1) => "IDN not available",
        (1, 9) => "invalid access to the IDN",
        (2..=6, 1) => "element not available",
        (2..=7, 2) => "too short",
        (2..=7, 3) => "too long",
        (2..=7, 4) => "read-only",
        (2..=7, 5) => "write-protected in this phase",
        (7, 6) => "below minimum",
        (7, 7) => "above maximum",
        (7, 8) => "invalid data",
        (7, 9) => "protected by password",
        (7, 0xA) => "protected: configured cyclically",
        (7, 0xB) => "invalid indirect addressing",
        (7, 0xC) => "protected by other settings",
        (7, 0x10) => "command already active",
        (7, 0x11) => "command cannot be interrupted",
        (7, 0x12) => "command not executable now",
        (7, 0x13) => "command not executable",
        _ => "unknown code",
    }
}

/// How many records at least a step is repeated in; a drive that is faster waits.
#[derive(Copy, Clone, Debug, PartialEq, Eq)]
pub struct Pace {
    /// A step without END.
    pub plain: u32,
    /// A step with END.
    pub end: u32,
    /// Closing the channel.
    pub close: u32,
}

impl Pace {
    /// As fast as the drive.
    pub const FASTEST: Self = Self { plain: 1, end: 1, close: 1 };
    /// What the recorded master did (sercon816.md 8.2).
    pub const RECORDED: Self = Self { plain: 1, end: 2, close: 3 };
}

/// The master's side of one drive's service channel.
#[derive(Clone, Debug)]
pub struct ServiceClient {
    handshake: u16,
    step: Step,
    pace: Pace,
    sent: u32,
    without_handshake: u32,
    acknowledged: bool,
    idn: Idn,
    active: Option<Active>,
    waiting: VecDeque<Request>,
    finished: VecDeque<Finished>,
}

#[derive(Clone, Debug)]
struct Active {
    request: Request,
    script: Script,
    steps: Vec<StepRecord>,
    /// Set once the request has failed and only the channel is left to be closed.
    failed: Option<ServiceError>,
}

impl ServiceClient {
    /// A channel that has sent a closing step with this handshake bit and waits for its acknowledgement.
    ///
    /// In CP1 the master sends MHS = 1 with element 0, so that is where CP2 begins (sercos2.md 2.1).
    pub fn new(handshake: bool, pace: Pace) -> Self {
        Self {
            handshake: u16::from(handshake),
            step: Step { element: Element::Close, write: false, end: false, info: 0 },
            pace,
            sent: 0,
            without_handshake: 0,
            acknowledged: false,
            idn: Idn(0),
            active: None,
            waiting: VecDeque::new(),
            finished: VecDeque::new(),
        }
    }

    /// A channel in the middle of its life: the last record that was sent.
    pub fn taken_over(last: MdtWords, pace: Pace) -> Self {
        Self { step: Step::of_words(last), ..Self::new(last.control & control::HANDSHAKE != 0, pace) }
    }

    /// Puts a request behind those that are waiting.
    pub fn request(&mut self, request: Request) {
        self.waiting.push_back(request);
    }

    /// Takes back the requests that nothing has been done for yet; how many.
    pub fn take_back(&mut self) -> usize {
        std::mem::take(&mut self.waiting).len()
    }

    /// The next request that has ended, in the order of asking.
    pub fn take_finished(&mut self) -> Option<Finished> {
        self.finished.pop_front()
    }

    /// Whether nothing is being done or waiting; results may still be there to be taken.
    pub fn is_idle(&self) -> bool {
        self.active.is_none() && self.waiting.is_empty()
    }

    /// The step that is being sent.
    pub fn step(&self) -> Step {
        self.step
    }

    /// The data block of the request in hand.
    pub fn idn(&self) -> Idn {
        self.idn
    }

    /// What the drive answered since the last call (`None`: its AT was missed), and what to send it now.
    pub fn poll(&mut self, at: Option<AtWords>) -> MdtWords {
        if !self.acknowledged && self.sent > 0 {
            self.evaluate(at);
        }
        if self.acknowledged && self.sent >= self.least_repetitions() {
            self.proceed();
        }
        self.sent += 1;
        self.current()
    }

    /// What is being sent, without going on.
    pub fn current(&self) -> MdtWords {
        MdtWords { control: self.step.control() | self.handshake, info: self.step.info }
    }

    fn least_repetitions(&self) -> u32 {
        match (self.step.element, self.step.end) {
            (Element::Close, _) => self.pace.close,
            (_, true) => self.pace.end,
            (_, false) => self.pace.plain,
        }
    }

    fn evaluate(&mut self, at: Option<AtWords>) {
        match at {
            Some(at) if at.status & status::HANDSHAKE == self.handshake => {
                if at.status & status::BUSY == 0 {
                    self.acknowledge(at);
                } else if self.sent >= BUSY_TIMEOUT_CYCLES {
                    self.give_up(ServiceError::BusyTimeout { idn: self.idn, step: self.step, cycles: self.sent });
                }
            }
            _ => {
                self.without_handshake += 1;
                if self.without_handshake >= HANDSHAKE_TIMEOUT_CYCLES {
                    self.give_up(ServiceError::HandshakeTimeout { idn: self.idn, step: self.step, cycles: self.sent });
                }
            }
        }
    }

    fn acknowledge(&mut self, at: AtWords) {
        self.acknowledged = true;
        let error = at.status & status::ERROR != 0;
        let record = StepRecord { step: self.step, cycles: self.sent, reply: at.info, error };
        let Some(active) = &mut self.active else { return };
        active.steps.push(record);
        if active.failed.is_some() {
            return;
        }
        if error && !matches!(active.request, Request::Steps(_)) {
            active.failed = Some(ServiceError::Refused { idn: self.idn, step: self.step, code: at.info });
        } else {
            active.script.reply(at.info);
        }
    }

    /// The handshake itself is broken: there is no channel left to be closed.
    fn give_up(&mut self, error: ServiceError) {
        self.without_handshake = 0;
        // A master with nothing to say waits on; only a request can fail, be it one that has not begun.
        let failed = match self.active.take() {
            Some(active) => Some((active.request, active.steps)),
            None => self.waiting.pop_front().map(|request| (request, Vec::new())),
        };
        if let Some((request, steps)) = failed {
            self.finished.push_back(Finished { request, result: Err(error), steps });
            self.acknowledged = true;
        }
    }

    fn proceed(&mut self) {
        if self.active.is_none() {
            self.active = self.waiting.pop_front().map(|request| {
                self.idn = request.idn();
                Active { script: Script::new(&request), request, steps: Vec::new(), failed: None }
            });
        }
        let Some(active) = &mut self.active else { return };
        let info = self.step.info;
        let closed = self.step.element == Element::Close && !active.steps.is_empty();
        let next = match (&active.failed, active.script.next(info)) {
            (Some(_), _) if closed => None,
            (Some(_), _) => Some(Step::close(info)),
            (None, Progress::Step(step)) => Some(step),
            (None, Progress::Failed) if !closed => Some(Step::close(info)),
            (None, _) => None,
        };
        match next {
            Some(step) => self.begin(step),
            None => self.finish(),
        }
    }

    fn begin(&mut self, step: Step) {
        self.step = step;
        self.handshake ^= control::HANDSHAKE;
        self.sent = 0;
        self.without_handshake = 0;
        self.acknowledged = false;
    }

    fn finish(&mut self) {
        let Some(mut active) = self.active.take() else { return };
        let result = match active.failed.take() {
            Some(error) => Err(error),
            None => active.script.result(),
        };
        self.finished.push_back(Finished { request: active.request, result, steps: active.steps });
        self.proceed();
    }
}

/// The attribute in two info words, low word first.
fn attribute_of(low: u16, high: u16) -> Attribute {
    Attribute(u32::from(high) << 16 | u32::from(low))
}

/// Kept here so that a request can be shown in one line.
impl fmt::Display for Value {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Word(word) => write!(formatter, "{word}"),
            Self::Long(long) => write!(formatter, "{}", *long as i32),
            Self::Quad(quad) => write!(formatter, "{quad}"),
            Self::Bytes(bytes) => {
                let words: Vec<String> = bytes
                    .chunks(2)
                    .map(|pair| format!("{:02x}{:02x}", pair.get(1).copied().unwrap_or(0), pair[0]))
                    .collect();
                write!(formatter, "[{}]", words.join(" "))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What was sent, control and info word of each step, and how the requests ended.
    type Conversation = (Vec<(u16, u16)>, Vec<Result<Reply, ServiceError>>);

    /// Answers every step in the next AT with the words of `replies`, one a step; an `Err` is an error code.
    fn converse(client: &mut ServiceClient, replies: &[Result<u16, u16>]) -> Conversation {
        let mut replies = replies.iter();
        let (mut at, mut last) = (None, None);
        let (mut words, mut results) = (Vec::new(), Vec::new());
        for _ in 0..200 {
            let sent = client.poll(at);
            if last != Some(sent.control & control::HANDSHAKE) {
                last = Some(sent.control & control::HANDSHAKE);
                words.push((sent.control, sent.info));
                let (info, error) = match replies.next() {
                    None => (0, 0),
                    Some(Ok(info)) => (*info, 0),
                    Some(Err(code)) => (*code, status::ERROR),
                };
                at = Some(AtWords { status: 0x4000 | error | sent.control & control::HANDSHAKE, info });
            }
            results.extend(std::iter::from_fn(|| client.take_finished()).map(|finished| finished.result));
            if client.is_idle() {
                break;
            }
        }
        (words, results)
    }

    fn client() -> ServiceClient {
        let mut client = ServiceClient::new(false, Pace::FASTEST);
        client.poll(None);
        client.poll(Some(AtWords { status: 0, info: 0 }));
        client
    }

    #[test]
    fn the_recorded_masters_words_for_reading_and_writing() {
        // sercon816.md 8.2: IDN 3 read, 1 written, list 16 written; the handshake bit alternates through all of it.
        let mut client = client();
        client.request(Request::Read(Idn(3)));
        client.request(Request::Write(Idn(1), Value::Word(2000)));
        let list = Value::words(&[11, 51, 0x8013]);
        client.request(Request::WriteList(Idn(16), list));
        let replies = [0, 1, 0x7011, 20, 0, 0, 0, 0, 0, 1, 0x6055].map(Ok);
        let (words, results) = converse(&mut client, &replies);
        let expected = [
            (0x0F, 3),
            (0x18, 3),
            (0x1D, 3),
            (0x3C, 3),
            (0x07, 3),
            (0x0E, 1),
            (0x3F, 2000),
            (0x06, 2000),
            (0x0F, 16),
            (0x18, 16),
            (0x1D, 16),
            (0x3A, 6),
            (0x3B, 6),
            (0x3A, 11),
            (0x3B, 51),
            (0x3E, 0x8013),
            (0x07, 0x8013),
        ];
        assert_eq!(words, expected);
        assert_eq!(results.len(), 3);
        assert!(results.iter().all(Result::is_ok));
    }

    #[test]
    fn steps_as_they_are_go_on_through_every_refusal() {
        let mut client = client();
        let step = |element, write, end, info| Step { element, write, end, info };
        let steps = vec![
            step(Element::Data, false, false, 9),
            step(Element::Idn, true, false, 0xFFFF),
            step(Element::Close, false, false, 1),
            step(Element::Data, true, true, 7),
        ];
        client.request(Request::Steps(steps));
        client.request(Request::DataStatus(Idn(127)));
        let (words, results) = converse(&mut client, &[Err(0x0001), Err(0x1009), Ok(0), Err(0x0001), Ok(3), Ok(0)]);
        let sent: Vec<_> = words.iter().map(|(control, info)| (control & !control::HANDSHAKE, *info)).collect();
        assert_eq!(sent, [(0x38, 9), (0x0A, 0xFFFF), (0x00, 1), (0x3E, 7), (0x0E, 127), (0x06, 127)]);
        assert_eq!(results, [Ok(Reply::Done), Ok(Reply::DataStatus(3))]);
    }

    #[test]
    fn a_list_is_read_as_long_as_its_first_word_says() {
        let mut client = client();
        client.request(Request::Read(Idn(17)));
        client.request(Request::Read(Idn(21)));
        let full = [0, 1, 0x7055, 6, 40, 11, 51, 0x8013, 0];
        let empty = [0, 1, 0x7055, 0, 40, 0];
        let replies: Vec<_> = full.into_iter().chain(empty).map(Ok).collect();
        let (words, results) = converse(&mut client, &replies);
        let controls: Vec<u16> = words.iter().map(|(control, _)| control & !control::HANDSHAKE).collect();
        let expected = [0x0E, 0x18, 0x1C, 0x38, 0x38, 0x38, 0x38, 0x3C, 0x06, 0x0E, 0x18, 0x1C, 0x38, 0x3C, 0x06];
        assert_eq!(controls, expected);
        let value = |index: usize| results[index].as_ref().ok().and_then(Reply::value).and_then(Value::as_idns);
        assert_eq!(value(0), Some(vec![Idn(11), Idn(51), Idn(0x8013)]));
        assert_eq!(value(1), Some(vec![]));
    }

    #[test]
    fn an_error_closes_the_channel_and_the_next_request_goes_on() {
        let mut client = client();
        client.request(Request::Write(Idn(6), Value::Word(1)));
        client.request(Request::DataStatus(Idn(127)));
        let (words, results) = converse(&mut client, &[Ok(0), Err(0x7006), Ok(0), Ok(3)]);
        let controls: Vec<u16> = words.iter().map(|(control, _)| control & !control::HANDSHAKE).collect();
        assert_eq!(controls, [0x0E, 0x3E, 0x06, 0x0E, 0x06]);
        let step = Step { element: Element::Data, write: true, end: true, info: 1 };
        assert_eq!(results[0], Err(ServiceError::Refused { idn: Idn(6), step, code: 0x7006 }));
        assert_eq!(results[1], Ok(Reply::DataStatus(3)));
    }

    #[test]
    fn a_command_is_started_polled_cancelled_and_checked() {
        let mut client = client();
        client.request(Request::Command { idn: Idn(127), polls: 5 });
        let replies = [0, 1, 0x6009, 0, 0, 7, 0, 3, 0, 0, 0, 0, 0, 0].map(Ok);
        let (words, results) = converse(&mut client, &replies);
        let controls: Vec<u16> = words.iter().map(|(control, _)| control & !control::HANDSHAKE).collect();
        // sercos2.md 3.6: open, attribute, write 3, close, open (7), close, open (3), close, open, write 0, close, open, close.
        let expected = [0x0E, 0x18, 0x1C, 0x3E, 0x06, 0x0E, 0x06, 0x0E, 0x06, 0x0E, 0x3E, 0x06, 0x0E, 0x06];
        assert_eq!(controls, expected);
        assert_eq!((words[3].1, words[10].1), (3, 0));
        assert_eq!(results, [Ok(Reply::Command(CommandOutcome { status: 3, polls: 2 }))]);
    }

    #[test]
    fn a_command_that_stays_set_after_cancelling_is_an_error() {
        let mut client = client();
        client.request(Request::Command { idn: Idn(99), polls: 5 });
        let replies = [0, 1, 9, 0, 0, 3, 0, 0, 0, 0, 3, 0].map(Ok);
        let (_, results) = converse(&mut client, &replies);
        assert_eq!(results, [Err(ServiceError::NotCancelled { idn: Idn(99), status: 3 })]);
    }

    #[test]
    fn ten_cycles_without_the_handshake_are_too_many_and_missed_ats_count() {
        let mut client = client();
        client.request(Request::DataStatus(Idn(1)));
        let mut polls = 0;
        let finished = loop {
            client.poll((polls % 2 == 0).then_some(AtWords { status: 0, info: 0 }));
            polls += 1;
            if let Some(finished) = client.take_finished() {
                break finished;
            }
        };
        assert_eq!(polls, 11, "one poll to send the step, ten ATs or gaps without its handshake");
        assert!(matches!(finished.result, Err(ServiceError::HandshakeTimeout { cycles: 10, .. })));
    }

    #[test]
    fn the_pace_holds_a_fast_drive_back() {
        let mut client = ServiceClient::new(false, Pace::RECORDED);
        client.request(Request::Write(Idn(1), Value::Word(7)));
        let mut at = None;
        let mut controls = Vec::new();
        for _ in 0..12 {
            let sent = client.poll(at);
            at = Some(AtWords { status: sent.control & control::HANDSHAKE, info: 0 });
            controls.push(sent.control);
        }
        assert_eq!(controls, [0, 0, 0, 0x0F, 0x0F, 0x3E, 0x3E, 0x07, 0x07, 0x07, 0x07, 0x07]);
        let steps = client.take_finished().expect("the write is done").steps;
        assert!(steps.iter().all(|step| step.cycles == 1), "the drive's own time is told, not the pace");
    }
}
