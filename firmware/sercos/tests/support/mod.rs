//! A slave at step level: server, parameters and phase machine, with a ring controller's hardware handshake around them.

#![allow(dead_code, missing_docs, reason = "`tests/garbage` takes a part of it")]

use super::DICTIONARY;
use heapless::{String, Vec};
use sercos::capacity::{LIVE_LIST_ENTRIES, LIVE_LONG_ENTRIES, LIVE_TEXT_BYTES};
use sercos::command::{CommandAction, CommandState};
use sercos::data_block::{DataBlock, NeededFor};
use sercos::duration::BitRate;
use sercos::error::ServiceError;
use sercos::parameters::Parameters;
use sercos::service::{Live, ReadPosition, Reply, Server, Step};
use sercos::transition::{self, Capabilities, CyclicConfiguration};
use sercos::{Idn, Phase, PhaseMachine};
use std::collections::{BTreeMap, VecDeque};

pub(crate) const CAPABILITIES: Capabilities =
    Capabilities { bit_rate: BitRate::Mbit2, operation_modes: &[1, 2, 3, 11], feedback_2: false };

/// The drive behind the service channel.
pub(crate) struct Drive {
    pub(crate) machine: PhaseMachine,
    pub(crate) configuration: Option<CyclicConfiguration>,
    pub(crate) values: BTreeMap<Idn, u64>,
    pub(crate) invalid_cp3: std::vec::Vec<u16>,
    pub(crate) invalid_cp4: std::vec::Vec<u16>,
    pub(crate) refusal: Option<ServiceError>,
    /// What the drive says of parameters that have been written.
    pub(crate) after: Option<ServiceError>,
    /// Whose values the server has not taken.
    pub(crate) not_taken: std::vec::Vec<Idn>,
    pub(crate) locked: bool,
    pub(crate) written_text: std::vec::Vec<u8>,
    pub(crate) synchronised: bool,
    /// Commands stay at 7 until told otherwise.
    pub(crate) slow: bool,
}

impl Live for Drive {
    fn read(&mut self, block: &DataBlock, _parameters: &Parameters) -> u64 {
        self.values.get(&block.idn).copied().unwrap_or(0)
    }

    fn cyclic(&mut self, block: &DataBlock) -> Option<u64> {
        self.values.get(&block.idn).copied()
    }

    fn read_text(
        &mut self,
        block: &DataBlock,
        _parameters: &Parameters,
        text: &mut String<LIVE_TEXT_BYTES>,
    ) -> Option<&'static str> {
        use std::fmt::Write;
        write!(text, "text of {}!", block.idn).unwrap();
        (block.idn == Idn::standard(95))
            .then_some("a text that never changes, and longer than any other text of this drive could ever be")
    }

    fn read_list(&mut self, block: &DataBlock, list: &mut Vec<u16, LIVE_LIST_ENTRIES>) {
        match block.idn.0 {
            21 => list.extend(self.invalid_cp3.iter().copied()),
            22 => list.extend(self.invalid_cp4.iter().copied()),
            _ => list.extend(0..LIVE_LIST_ENTRIES as u16),
        }
    }

    fn read_longs(&mut self, _block: &DataBlock, list: &mut Vec<u32, LIVE_LONG_ENTRIES>) {
        list.extend((0..LIVE_LONG_ENTRIES as u32).map(|number| (number << 16) | (number + 1)));
    }

    fn write(&mut self, block: &DataBlock, value: u64) {
        self.values.insert(block.idn, value);
    }

    fn write_text(&mut self, _block: &DataBlock, text: &[u8]) -> Result<(), ServiceError> {
        self.written_text = text.to_vec();
        Ok(())
    }

    fn written(&mut self, block: &DataBlock, _parameters: &mut Parameters) -> Result<(), ServiceError> {
        if block.needed_for != NeededFor::Neither {
            self.machine.withdraw();
        }
        self.after.map_or(Ok(()), Err)
    }

    fn not_taken(&mut self, block: &DataBlock) {
        self.not_taken.push(block.idn);
    }

    fn command(
        &mut self,
        block: &DataBlock,
        action: CommandAction,
        parameters: &mut Parameters,
    ) -> Result<CommandState, ServiceError> {
        if self.slow || action != CommandAction::Start {
            return Ok(match action {
                CommandAction::Start => CommandState::Executing,
                CommandAction::Interrupt | CommandAction::Cancel => CommandState::Interrupted,
            });
        }
        match block.idn.0 {
            99 => self.machine.clear_error(),
            127 => match transition::check_cp3(parameters, &CAPABILITIES) {
                Ok((configuration, ready)) => {
                    self.configuration = Some(configuration);
                    self.invalid_cp3.clear();
                    self.machine.permit_cp3(ready);
                }
                Err(invalid) => {
                    self.machine.withdraw();
                    self.invalid_cp3 = invalid.idns().map(|idn| idn.0).collect();
                    return Ok(CommandState::Failed);
                }
            },
            128 => {
                let configuration = self.configuration.as_ref().unwrap();
                match transition::check_cp4(parameters, &CAPABILITIES, configuration, self.synchronised) {
                    Ok(ready) => {
                        self.invalid_cp4.clear();
                        self.machine.permit_cp4(ready);
                    }
                    Err(invalid) => {
                        self.machine.withdraw();
                        self.invalid_cp4 = invalid.idns().map(|idn| idn.0).collect();
                        return Ok(CommandState::Failed);
                    }
                }
            }
            _ => assert!(block.attribute.command(), "{} is no command", block.idn),
        }
        Ok(CommandState::Executed)
    }

    fn phase(&self) -> Phase {
        self.machine.current()
    }

    fn refuses(&mut self, _block: &DataBlock, _value: u64, _parameters: &Parameters) -> Option<ServiceError> {
        self.refusal
    }

    fn is_locked(&self) -> bool {
        self.locked
    }
}

/// When the controller stops at the end of its sender buffer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Boundary {
    /// With the step that takes the last word.
    WithLast,
    /// With the step after it.
    AfterLast,
}

pub(crate) struct Slave {
    pub(crate) server: Server,
    pub(crate) parameters: Parameters,
    pub(crate) drive: Drive,
    boundary: Boundary,
    sender: VecDeque<u16>,
    /// Element and direction of the transfer that goes on.
    running: Option<(u8, bool)>,
    /// Steps that needed the processor.
    pub(crate) processor_steps: usize,
}

impl Slave {
    pub(crate) fn new(boundary: Boundary, segment_words: usize) -> Self {
        Self {
            server: Server::with_segment_words(&DICTIONARY, segment_words),
            parameters: Parameters::new(&DICTIONARY),
            drive: Drive {
                machine: PhaseMachine::new(),
                configuration: None,
                values: BTreeMap::from([(Idn::standard(96), 0x0101)]),
                invalid_cp3: std::vec::Vec::new(),
                invalid_cp4: std::vec::Vec::new(),
                refusal: None,
                after: None,
                not_taken: std::vec::Vec::new(),
                locked: false,
                written_text: std::vec::Vec::new(),
                synchronised: true,
                slow: false,
            },
            boundary,
            sender: VecDeque::new(),
            running: None,
            processor_steps: 0,
        }
    }

    /// A slave in CP2.
    pub(crate) fn in_cp2() -> Self {
        let mut slave = Self::new(Boundary::WithLast, 16);
        for phase in 0..=2 {
            slave.mst(phase).unwrap();
        }
        slave
    }

    pub(crate) fn mst(&mut self, data: u8) -> Result<(), sercos::phase::PhaseError> {
        let before = self.drive.machine.current();
        let result = self.drive.machine.received(data);
        let phase = self.drive.machine.current();
        if phase != before {
            self.server.phase_changed(phase);
            if phase == Phase::Cp2 {
                self.parameters.forget_written();
            }
        }
        result.map(|_| ())
    }

    /// One step of the master as the AT answers it: INFO, or the error.
    pub(crate) fn step(&mut self, element: u8, write: bool, end: bool, info: u16) -> Result<u16, ServiceError> {
        let new_transfer = self.running != Some((element, write));
        self.running = (!end && element != 0).then_some((element, write));
        let mut step = Step { element, write, end, info, new_transfer, position: ReadPosition::Within };
        if element == 0 || write || new_transfer {
            if new_transfer {
                self.sender.clear();
            }
            return self.ask(step);
        }
        match self.sender.pop_front() {
            None => {
                step.position = ReadPosition::Exhausted;
                self.ask(step)
            }
            Some(word) => {
                // The handshake bit gives the parity of the word; only a controller that stops with the last one knows more.
                let may_be_last = self.sender.len().is_multiple_of(2);
                step.position = match (end, self.boundary) {
                    (false, Boundary::WithLast) if self.sender.is_empty() => ReadPosition::TookLast,
                    (true, _) if may_be_last => ReadPosition::TookLast,
                    (true, _) => ReadPosition::NotLast,
                    _ => ReadPosition::Within,
                };
                if end || step.position == ReadPosition::TookLast {
                    self.processor_steps += 1;
                    match self.server.step(step, &mut self.parameters, &mut self.drive) {
                        Reply::Send(words) => self.sender.extend(words),
                        Reply::Continue => {}
                        Reply::Accept { .. } => panic!("a read was answered like a write"),
                        Reply::Error(error) => return Err(error),
                    }
                }
                Ok(word)
            }
        }
    }

    /// A step as no controller would hand it on, straight to the server. Whatever was running is over for the controller.
    pub(crate) fn stray_step(&mut self, step: Step) -> Reply {
        self.running = None;
        self.sender.clear();
        self.server.step(step, &mut self.parameters, &mut self.drive)
    }

    fn ask(&mut self, step: Step) -> Result<u16, ServiceError> {
        self.processor_steps += 1;
        match self.server.step(step, &mut self.parameters, &mut self.drive) {
            Reply::Send(words) => {
                self.sender.extend(words);
                Ok(self.sender.pop_front().expect("Send holds at least one word"))
            }
            Reply::Continue => panic!("the step needs a word: {step:?}"),
            Reply::Accept { info } => Ok(info),
            Reply::Error(error) => Err(error),
        }
    }

    pub(crate) fn open(&mut self, idn: Idn) -> Result<u16, ServiceError> {
        self.step(1, true, true, idn.0)
    }

    pub(crate) fn close(&mut self) -> Result<u16, ServiceError> {
        self.step(0, true, true, 0)
    }

    /// Reads so many words, END with the last.
    pub(crate) fn read(&mut self, element: u8, words: usize) -> Result<std::vec::Vec<u16>, ServiceError> {
        (1..=words).map(|number| self.step(element, false, number == words, 0)).collect()
    }

    /// Reads length words first, then as many words as they say.
    pub(crate) fn read_list(&mut self, element: u8) -> Result<std::vec::Vec<u16>, ServiceError> {
        let length = self.step(element, false, false, 0)?;
        let words = 1 + usize::from(length).div_ceil(2);
        let mut all = std::vec![length];
        for number in 1..=words {
            all.push(self.step(element, false, number == words, 0)?);
        }
        Ok(all)
    }

    /// Writes operation data, END with the last word.
    pub(crate) fn write(&mut self, words: &[u16]) -> Result<u16, ServiceError> {
        let mut info = Ok(0);
        for (number, &word) in (1..).zip(words) {
            info = self.step(7, true, number == words.len(), word);
            info?;
        }
        info
    }

    /// Opens, writes, closes.
    pub(crate) fn set(&mut self, idn: Idn, words: &[u16]) -> Result<u16, ServiceError> {
        self.open(idn)?;
        let result = self.write(words);
        self.close()?;
        result
    }

    /// Everything that S-0-0127 needs, as the recorded master writes it for drive 1.
    pub(crate) fn configure(&mut self) {
        let idn = Idn::standard;
        for (number, value) in
            [(1, 2000), (2, 2000), (6, 92), (89, 1782), (8, 1965), (7, 1698), (9, 1), (10, 32), (15, 7)]
        {
            self.set(idn(number), &[value]).unwrap();
        }
        self.set(Idn::AT_LIST, &[6, 6, 11, 51, 0x8013]).unwrap();
        self.set(Idn::MDT_LIST, &[2, 2, 36]).unwrap();
    }

    /// Configured and in CP4.
    pub(crate) fn in_cp4() -> Self {
        let mut slave = Self::in_cp2();
        slave.configure();
        slave.set(Idn::CP3_TRANSITION_CHECK, &[3]).unwrap();
        slave.mst(3).unwrap();
        slave.set(Idn::CP4_TRANSITION_CHECK, &[3]).unwrap();
        slave.mst(4).unwrap();
        slave
    }
}
