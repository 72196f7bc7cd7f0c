//! Streams of service-channel steps, MSTs, commands and lost telegrams.

use std::sync::LazyLock;

use sercos::command::CommandState;
use sercos::data_block::{DataBlock, Selection};
use sercos::dictionary::{self, DICTIONARY};
use sercos::parameters::Parameters;
use sercos::phase::PhaseError;
use sercos::service::{Reply, ServiceError, Step};
use sercos::supervision::{Reception, Supervision};
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
        supervision: Supervision::new(),
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
    /// Everything that a proper master does to get one phase further; it may fail after what was written before.
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
                let (write, end, new_transfer, at_boundary) = (flag(3), flag(4), flag(5), flag(6));
                let info = info(flag(7), bytes.word()?);
                Self::Stray(Step { element, write, end, info, new_transfer, at_boundary })
            }
            4..=8 => {
                let bits = bytes.byte()?;
                let flag = |bit: u8| bits >> bit & 1 == 1;
                let info = info(flag(7), bytes.word()?);
                Self::Regular { element: bits & 7, write: flag(3), end: flag(4), info }
            }
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
    &DICTIONARY[number % DICTIONARY.len()]
}

/// All procedure commands.
static COMMANDS: LazyLock<Vec<Idn>> =
    LazyLock::new(|| dictionary::select(Selection::Commands).map(|block| block.idn).collect());

struct Stream {
    slave: Slave,
    supervision: Supervision,
    /// Statuses of all commands before a step, kept to spare the allocation.
    before: Vec<u16>,
}

impl Stream {
    fn happen(&mut self, event: Event) {
        match event {
            Event::Stray(step) => self.stray(step),
            Event::Regular { element, write, end, info } => {
                self.unchanged_unless(|slave| {
                    slave.step(element, write, end, info).is_ok() && element == 7 && write && end
                });
            }
            Event::Write { block, value } => {
                let words = words_of(block, value);
                self.unchanged_unless(|slave| slave.set(block.idn, &words).is_ok());
            }
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
        self.unchanged_unless(|slave| {
            let reply = slave.stray_step(step);
            match &reply {
                Reply::Send(words) => assert!(!words.is_empty() && !step.write, "{step:?}: {reply:?}"),
                Reply::Continue => assert!(!step.write, "{step:?}: {reply:?}"),
                Reply::Accept { .. } => assert!(step.write || !(1..=7).contains(&step.element), "{step:?}: {reply:?}"),
                Reply::Error(error) => assert_ne!(error.code(), 0, "{step:?}: {reply:?}"),
            }
            step.element == 7 && step.write && step.end && matches!(reply, Reply::Accept { .. })
        });
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
        }
    }

    fn advance(&mut self) {
        let slave = &mut self.slave;
        let ready = !slave.drive.slow && slave.drive.refusal.is_none();
        match slave.drive.machine.current() {
            // A slave that waits for CP0 takes the first one for it.
            Phase::Cp0 => self.mst(0),
            Phase::Cp2 if ready => {
                slave.configure();
                command(slave, Idn::CP3_TRANSITION_CHECK);
            }
            Phase::Cp3 if ready => {
                command(slave, Idn::CP4_TRANSITION_CHECK);
            }
            _ => {}
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
