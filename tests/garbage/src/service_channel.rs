//! Streams of service-channel steps, MSTs, commands and lost telegrams.

use std::sync::LazyLock;

use drive::DICTIONARY;
use sercos::capacity::LIVE_LIST_ENTRIES;
use sercos::command::{CommandState, CommandStatus};
use sercos::data_block::{DataBlock, Selection};
use sercos::error::ServiceError;
use sercos::loss_counter::{LossCounter, Reception};
use sercos::parameters::Parameters;
use sercos::phase::PhaseError;
use sercos::service::{ReadPosition, Reply, Step};
use sercos::{Idn, Phase, transition};

use crate::bytes::{Bytes, chosen};
use crate::run_up::{command, run_up, words_of};
use crate::support::{Boundary, CAPABILITIES, Slave};

/// Whatever a master sends, and however the ring loses it:
///
/// * nothing panics, and every answer has the shape that its step needs;
/// * nothing changes but by an accepted END of element 7, a phase, or news of a command;
/// * a phase above CP2 is entered only with values that pass its transition check in that moment;
/// * a permission exists only in the phase in which it was given;
/// * ten MSTs of CP0 and a proper run-up end in CP4.
///
/// # Panics
/// When one of these does not hold.
pub fn service_channel(bytes: &[u8]) {
    let mut bytes = Bytes::new(bytes);
    let Some(silicon) = bytes.byte() else { return };
    let boundary = if silicon & 1 == 0 { Boundary::WithLast } else { Boundary::AfterLast };
    let mut stream = Stream {
        slave: Slave::new(boundary, usize::from(silicon >> 1) % 17),
        supervision: LossCounter::new(),
        words_written: None,
        before: Vec::new(),
    };
    while let Some(event) = Event::take(&mut bytes) {
        stream.happen(event);
        stream.assert_permission_belongs_to_phase();
    }
    run_up(&mut stream.slave);
}

/// One thing that happens.
#[derive(Clone, Debug)]
enum Event {
    /// A step that need not fit what the controller did before.
    Stray(Step),
    /// A step with the controller's handshake around it.
    Regular { element: u8, write: bool, end: bool, info: u16 },
    /// A whole write of as many words as the data block has.
    Write { block: &'static DataBlock, value: i64 },
    /// The proper configuration in CP2, and the transition check of the phase; it may fail after what was written before.
    Check,
    /// The MST of the next phase, after the same.
    Advance,
    /// An MST with this byte.
    Mst(u8),
    /// The verdict on a cycle of CP3 or CP4.
    Cycle(Reception, Reception),
    /// News of a command.
    Progress(Idn, CommandState),
    /// What the drive itself makes of writes and commands from now on.
    Conditions { slow: bool, synchronised: bool, refusal: Option<ServiceError> },
}

impl Event {
    /// Up to four bytes; `None` when there are not enough.
    fn take(bytes: &mut Bytes<'_>) -> Option<Self> {
        let kind = bytes.byte()?;
        Some(match kind % 16 {
            0..=3 => {
                let bits = bytes.byte()?;
                let element = if bits == 0xFF { kind } else { bits & 7 };
                let flag = |bit: u8| bits >> bit & 1 == 1;
                let (write, end, new_transfer) = (flag(3), flag(4), flag(5));
                let position = match (flag(6), kind & 1) {
                    (false, 0) => ReadPosition::Within,
                    (false, _) => ReadPosition::NotLast,
                    (true, 0) => ReadPosition::TookLast,
                    (true, _) => ReadPosition::Exhausted,
                };
                let info = info(flag(7), bytes.word()?);
                Self::Stray(Step { element, write, end, info, new_transfer, position })
            }
            4..=7 => {
                let bits = bytes.byte()?;
                let flag = |bit: u8| bits >> bit & 1 == 1;
                let info = info(flag(7), bytes.word()?);
                Self::Regular { element: bits & 7, write: flag(3), end: flag(4), info }
            }
            8 => Self::Check,
            9 | 10 => {
                let block = block(usize::from(bytes.byte()?));
                Self::Write { block, value: i64::from(bytes.word()?.cast_signed()) }
            }
            11 => Self::Advance,
            12 => {
                let data = bytes.byte()?;
                Self::Mst(if data & 0x80 == 0 { data % 6 } else { data })
            }
            13 => {
                let verdicts = bytes.byte()?;
                let reception =
                    |bits: u8| chosen(&[Reception::Failed, Reception::Valid, Reception::Unknown], usize::from(bits));
                Self::Cycle(reception(verdicts & 3), reception(verdicts >> 2 & 3))
            }
            14 => {
                use CommandState::{Executed, Executing, Failed, Interrupted};
                let which = usize::from(bytes.byte()?);
                let state = chosen(&[Executed, Failed, Executing, Interrupted], which);
                Self::Progress(chosen(&COMMANDS, which / 4), state)
            }
            _ => {
                let bits = bytes.byte()?;
                let refusal = (bits & 0b1100 == 0).then_some(ServiceError::ProtectedBySettings);
                Self::Conditions { slow: bits & 1 != 0, synchronised: bits & 2 == 0, refusal }
            }
        })
    }
}

/// An IDN of the table, or the word itself.
fn info(of_table: bool, word: u16) -> u16 {
    if of_table { block(usize::from(word)).idn.0 } else { word }
}

fn block(number: usize) -> &'static DataBlock {
    &DICTIONARY.blocks()[number % DICTIONARY.blocks().len()]
}

/// All procedure commands.
static COMMANDS: LazyLock<Vec<Idn>> =
    LazyLock::new(|| DICTIONARY.select(Selection::Commands).map(|block| block.idn).collect());

/// The longest list or text that the service channel takes: all that its staging buffer holds.
const MOST_LIST_WORDS: usize = LIVE_LIST_ENTRIES + 2;

/// Words of operation data that were accepted since the transfer began.
#[derive(Clone, Copy)]
struct Written {
    words: usize,
    /// The last was no regular step, so the controller takes the next one for a new transfer.
    stray: bool,
}

struct Stream {
    slave: Slave,
    supervision: LossCounter,
    words_written: Option<Written>,
    /// Statuses of all commands before a step, kept to spare the allocation.
    before: Vec<u16>,
}

impl Stream {
    fn happen(&mut self, event: Event) {
        match event {
            Event::Stray(step) => self.stray(step),
            Event::Regular { element, write, end, info } => {
                let is_new = self.words_written.is_none_or(|written| written.stray);
                let mut accepted = false;
                self.unchanged_unless(|slave| {
                    accepted = slave.step(element, write, end, info).is_ok();
                    accepted && element == 7 && write && end
                });
                let step = Step { element, write, end, info, new_transfer: is_new, position: ReadPosition::Within };
                self.count_written(step, accepted, false);
            }
            Event::Write { block, value } => {
                let words = words_of(block, value);
                self.unchanged_unless(|slave| slave.set(block.idn, &words).is_ok());
                self.words_written = None;
            }
            Event::Check => self.check(),
            Event::Advance => self.advance(),
            Event::Mst(data) => self.mst(data),
            Event::Cycle(mst, mdt) => self.cycle(mst, mdt),
            Event::Progress(idn, state) => self.slave.server.command_progress(idn, state),
            Event::Conditions { slow, synchronised, refusal } => {
                let drive = &mut self.slave.drive;
                (drive.slow, drive.synchronised, drive.refusal) = (slow, synchronised, refusal);
            }
        }
    }

    fn stray(&mut self, step: Step) {
        let mut accepted = false;
        self.unchanged_unless(|slave| {
            let reply = slave.stray_step(step);
            accepted = matches!(reply, Reply::Accept { .. });
            match &reply {
                Reply::Send(words) => assert!(!words.is_empty() && !step.write, "{step:?}: {reply:?}"),
                Reply::Continue => assert!(!step.write, "{step:?}: {reply:?}"),
                Reply::Accept { .. } => assert!(step.write || !(1..=7).contains(&step.element), "{step:?}: {reply:?}"),
                Reply::Error(error) => assert_ne!(error.code(), 0, "{step:?}: {reply:?}"),
            }
            accepted && step.element == 7 && step.write && step.end
        });
        self.count_written(step, accepted, true);
    }

    /// No more words are accepted than the open data block has, and the last one only in a phase in which it may be written.
    fn count_written(&mut self, step: Step, accepted: bool, stray: bool) {
        if step.element != 7 || !step.write {
            self.words_written = None;
            return;
        }
        let before = self.words_written.filter(|_| !step.new_transfer).map_or(0, |written| written.words);
        let words = before + usize::from(accepted);
        self.words_written = (!step.end).then_some(Written { words, stray });
        if accepted {
            let block =
                self.slave.server.open_idn().and_then(|idn| DICTIONARY.find(idn)).expect("a data block is open");
            let most = block.fixed_bytes().map_or(MOST_LIST_WORDS, |bytes| usize::from(bytes / 2));
            assert!(words <= most, "{} has taken {words} words of {most}", block.idn);
            let phase = self.slave.drive.machine.current();
            assert!(!step.end || !block.attribute.is_protected_in(phase), "{} was written in {phase}", block.idn);
        }
    }

    /// Nothing may have changed after `act` unless it says so.
    fn unchanged_unless(&mut self, act: impl FnOnce(&mut Slave) -> bool) {
        let slave = &mut self.slave;
        let parameters: Parameters = slave.parameters.clone();
        let values = slave.drive.values.clone();
        let phase = slave.drive.machine.current();
        let status = (slave.drive.machine.interface_status(), slave.drive.machine.is_permitted());
        self.before.clear();
        self.before.extend(statuses(slave));
        if !act(slave) {
            assert!(slave.parameters == parameters, "a parameter has changed");
            assert_eq!(slave.drive.values, values);
            assert_eq!((slave.drive.machine.interface_status(), slave.drive.machine.is_permitted()), status);
            assert!(statuses(slave).eq(self.before.iter().copied()), "a command has changed");
        }
        assert_eq!(slave.drive.machine.current(), phase, "only an MST changes the phase");
    }

    fn mst(&mut self, data: u8) {
        let before = self.slave.drive.machine.current();
        let result = self.slave.mst(data);
        let machine = &self.slave.drive.machine;
        let now = machine.current();
        if let Err(error) = result {
            assert_eq!(now, Phase::Cp0, "{error}");
            assert!(machine.interface_status().has_error(), "{error}");
        }
        if now != before {
            assert!(!machine.is_permitted(), "a permission is used up");
            self.assert_commands_can_be_cancelled();
            match now {
                Phase::Cp3 => {
                    self.supervision.clear();
                    self.assert_checked_for_cp3();
                }
                Phase::Cp4 => self.assert_checked_for_cp4(),
                _ => {}
            }
        }
    }

    /// No command stays set in a phase in which the master could not write to it.
    fn assert_commands_can_be_cancelled(&self) {
        let phase = self.slave.drive.machine.current();
        for &idn in COMMANDS.iter() {
            let protected = DICTIONARY.find(idn).is_some_and(|block| block.attribute.is_protected_in(phase));
            let status = self.slave.server.command_status(idn);
            let is_free = status == CommandStatus::NotSet;
            assert!(is_free || !(protected || phase < Phase::Cp2), "{idn} is {status:?} in {phase}");
        }
    }

    fn assert_checked_for_cp3(&self) {
        match transition::check_cp3(&self.slave.parameters, &CAPABILITIES) {
            Ok((configuration, _)) => assert_eq!(Some(&configuration), self.slave.drive.configuration.as_ref()),
            Err(invalid) => panic!("CP3 with {:?}", invalid.findings()),
        }
    }

    fn assert_checked_for_cp4(&self) {
        let configuration = self.slave.drive.configuration.as_ref().expect("CP3 comes before CP4");
        if let Err(invalid) = transition::check_cp4(&self.slave.parameters, &CAPABILITIES, configuration, true) {
            panic!("CP4 with {:?}", invalid.findings());
        }
    }

    fn cycle(&mut self, mst: Reception, mdt: Reception) {
        if self.slave.drive.machine.current() < Phase::Cp3 {
            return;
        }
        if let Err(error) = self.supervision.cycle(mst, mdt) {
            assert!(matches!(error, PhaseError::MstFailure | PhaseError::MdtFailure | PhaseError::LightLoss));
            self.slave.drive.machine.fail(error);
            self.slave.server.phase_changed(Phase::Cp0);
            self.supervision.end_bursts();
            self.assert_commands_can_be_cancelled();
        }
    }

    fn check(&mut self) {
        self.words_written = None;
        let slave = &mut self.slave;
        if slave.drive.slow || slave.drive.refusal.is_some() {
            return;
        }
        let check = match slave.drive.machine.current() {
            Phase::Cp2 => {
                slave.configure();
                Idn::CP3_TRANSITION_CHECK
            }
            Phase::Cp3 => Idn::CP4_TRANSITION_CHECK,
            _ => return,
        };
        command(slave, check);
    }

    fn advance(&mut self) {
        self.check();
        if self.slave.drive.machine.current() == Phase::Cp0 {
            // A slave that waits for CP0 does not follow before it.
            self.mst(0);
        }
        let next = self.slave.drive.machine.current().number() + 1;
        self.mst(next.min(4));
    }

    fn assert_permission_belongs_to_phase(&self) {
        let machine = &self.slave.drive.machine;
        assert!(
            !machine.is_permitted() || matches!(machine.current(), Phase::Cp2 | Phase::Cp3),
            "permitted in {}",
            machine.current()
        );
    }
}

fn statuses(slave: &Slave) -> impl Iterator<Item = u16> + use<'_> {
    COMMANDS.iter().map(|&idn| slave.server.command_status(idn) as u16)
}
