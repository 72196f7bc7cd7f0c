//! A drive in a few pages: what a telegram needs to be answered, without a chip and without the product's code.
//!
//! It is the counterpart for tests of masters and players, and stands in for drives when a recording is generated. It
//! follows its commands exactly and at once; the service channel answers every step in the next AT unless told otherwise.

use std::collections::BTreeMap;

use crate::ident::{Attribute, Element, Idn, Value};
use crate::master::Telegram;
use crate::service_client::{MdtWords, Step, control, status};
use crate::station::Station;
use crate::time::Nanoseconds;
use crate::wire::{BROADCAST, LineError, Transmission};

/// AT start in CP1 and CP2, in the window of 100 to 300 us.
const START_UP_AT: Nanoseconds = Nanoseconds::from_microseconds(150);
const READ_ONLY_WORD: u32 = 0x7011_0001;
const WORD: u32 = 0x0011_0001;
const LONG: u32 = 0x0022_0001;
const COMMAND: u32 = 0x0009_0001;
const IDN_LIST: u32 = 0x0055_0001;
const TEXT: u32 = 0x0044_0001;

/// How a drive behaves that does not behave well.
#[derive(Clone, Debug, PartialEq, Eq, Default)]
pub struct Manners {
    /// Cycles by which every acknowledgement comes late.
    pub late: u32,
    /// Cycles of BUSY before a step is done.
    pub busy: u32,
    /// Cycles that a procedure command takes.
    pub command: u32,
    /// What S-0-0127 finds wrong.
    pub invalid_for_cp3: Vec<Idn>,
    /// Writes that are accepted and forgotten.
    pub forgets: Vec<Idn>,
    /// It does not send anything.
    pub mute: bool,
    /// Status bits 15..14 never exceed this.
    pub readiness: Option<u16>,
}

/// The drive.
#[derive(Clone, Debug)]
pub struct SoftwareSlave {
    address: u8,
    manners: Manners,
    blocks: BTreeMap<Idn, Block>,
    phase: u8,
    mst_end: Nanoseconds,
    at_due: Option<Nanoseconds>,
    addressed: bool,
    handshake: u16,
    pending: Option<Pending>,
    info: u16,
    error: bool,
    opened: Option<Idn>,
    element: Option<(Element, bool)>,
    transferred: Vec<u16>,
    control: u16,
    status: u16,
}

#[derive(Clone, Debug)]
struct Block {
    attribute: Attribute,
    value: Value,
    data_status: u16,
    running: u32,
}

#[derive(Clone, Debug)]
struct Pending {
    words: MdtWords,
    late: u32,
    busy: u32,
}

impl SoftwareSlave {
    /// A drive with the data blocks of a run-up; it declares t1min 20, tATMT 10, tMTSY 10, tMTSG 20, t5 80 us.
    pub fn new(address: u8) -> Self {
        let mut blocks = BTreeMap::new();
        let mut add = |number: u16, attribute: u32, value: Value| {
            let block = Block { attribute: Attribute(attribute), value, data_status: 0, running: 0 };
            blocks.insert(Idn(number), block);
        };
        let arrangement = u16::from(address) << 8 | u16::from(address);
        for (number, value) in [(3, 20), (4, 10), (5, 80), (88, 10), (90, 20), (96, arrangement), (87, 0)] {
            add(number, READ_ONLY_WORD, Value::Word(value));
        }
        for number in [1, 2, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 89, 32, 44, 45, 46, 76, 77, 78, 0x8013] {
            add(number, WORD, Value::Word(0));
        }
        for number in [36, 40, 47, 51, 53, 79, 103, 189] {
            add(number, LONG, Value::Long(0));
        }
        for number in [99, 127, 128] {
            add(number, COMMAND, Value::Word(0));
        }
        for number in [16, 21, 22, 24] {
            add(number, IDN_LIST, Value::Bytes(Vec::new()));
        }
        add(30, TEXT, Value::Bytes(b"software slave".to_vec()));
        add(80, WORD, Value::Word(0));
        Self {
            address,
            manners: Manners::default(),
            blocks,
            phase: 0,
            mst_end: Nanoseconds::ZERO,
            at_due: None,
            addressed: false,
            handshake: 0,
            pending: None,
            info: 0,
            error: false,
            opened: None,
            element: None,
            transferred: Vec::new(),
            control: 0,
            status: 2 << 14,
        }
    }

    /// The same with other manners.
    #[must_use]
    pub fn with_manners(mut self, manners: Manners) -> Self {
        self.status = manners.readiness.unwrap_or(2).min(2) << 14;
        self.manners = manners;
        self
    }

    /// The operation data of a block.
    pub fn value(&self, idn: Idn) -> Option<&Value> {
        self.blocks.get(&idn).map(|block| &block.value)
    }

    /// Phase of the last MST.
    pub fn phase(&self) -> u8 {
        self.phase
    }

    fn word(&self, idn: Idn) -> u16 {
        self.value(idn).and_then(Value::as_number).unwrap_or(0) as u16
    }

    fn telegram(&self) -> Telegram {
        let list = |idn: Idn| self.value(idn).and_then(Value::as_idns).unwrap_or_default();
        Telegram::standard(self.word(Idn::TELEGRAM_TYPE))
            .unwrap_or_else(|| Telegram::application(&list(Idn::AT_LIST), &list(Idn::MDT_LIST)))
    }

    fn length(&self, idn: Idn) -> usize {
        self.blocks.get(&idn).and_then(|block| block.attribute.fixed_bytes()).unwrap_or(0)
    }

    fn on_mst(&mut self, end: Nanoseconds, phase: u8) {
        if phase != self.phase && phase == 2 {
            self.handshake = 0;
            self.pending = None;
        }
        self.phase = phase;
        self.mst_end = end;
        let answers = match phase {
            1 | 2 => std::mem::take(&mut self.addressed),
            3 | 4 => true,
            _ => false,
        };
        let start = if phase < 3 { START_UP_AT } else { Nanoseconds::from_microseconds(u64::from(self.word(Idn::T1))) };
        self.at_due = answers.then_some(end + start);
        if let Some(pending) = &mut self.pending {
            if pending.late > 0 {
                pending.late -= 1;
            } else if pending.busy > 0 {
                pending.busy -= 1;
            } else {
                let words = pending.words;
                self.pending = None;
                self.execute(Step::of_words(words));
            }
        }
        for block in self.blocks.values_mut().filter(|block| block.data_status == 7) {
            block.running = block.running.saturating_sub(1);
            if block.running == 0 {
                block.data_status = 3;
            }
        }
    }

    fn on_mdt(&mut self, data: &[u8]) {
        let (record, commands) = match self.phase {
            1 | 2 => (data.get(..4), &[][..]),
            _ => {
                let from = usize::from(self.word(Idn::MDT_POSITION)).saturating_sub(1);
                (data.get(from..from + 4), data.get(from + 4..).unwrap_or(&[]))
            }
        };
        let Some(&[control_low, control_high, info_low, info_high]) = record else { return };
        let words = MdtWords {
            control: u16::from_le_bytes([control_low, control_high]),
            info: u16::from_le_bytes([info_low, info_high]),
        };
        self.addressed = true;
        self.control = words.control;
        if self.phase == 1 {
            self.handshake = words.control & control::HANDSHAKE;
        } else if words.control & control::HANDSHAKE != self.handshake && self.pending.is_none() {
            self.pending = Some(Pending { words, late: self.manners.late, busy: self.manners.busy });
        }
        if self.phase == 4 {
            self.follow(commands);
        }
    }

    /// The drive stands where its command says, at once.
    fn follow(&mut self, commands: &[u8]) {
        let on = self.control & (control::ON | control::ENABLE) == control::ON | control::ENABLE;
        let readiness = if on { 3 } else { 2 }.min(self.manners.readiness.unwrap_or(3));
        let follows = readiness == 3 && self.control & control::NO_HALT != 0;
        self.status = readiness << 14 | if follows { status::FOLLOWS } else { 0 };
        let mut offset = 0;
        for idn in self.telegram().mdt {
            let length = self.length(idn);
            if let (true, Some(&[a, b, c, d])) = (follows, commands.get(offset..offset + length)) {
                let value = Value::Long(u32::from_le_bytes([a, b, c, d]));
                let feedback = match idn {
                    Idn::POSITION_COMMAND => Idn::POSITION_FEEDBACK,
                    Idn::VELOCITY_COMMAND => Idn::VELOCITY_FEEDBACK,
                    other => other,
                };
                if let Some(block) = self.blocks.get_mut(&feedback) {
                    block.value = value;
                }
            }
            offset += length;
        }
    }

    /// One step of the service channel (sercos2.md 3.3).
    fn execute(&mut self, step: Step) {
        self.handshake ^= 1;
        let answer = self.answer(step);
        self.error = answer.is_err();
        self.info = match answer {
            Ok(info) | Err(info) => info,
        };
    }

    fn answer(&mut self, step: Step) -> Result<u16, u16> {
        if self.element != Some((step.element, step.write)) {
            self.element = Some((step.element, step.write));
            self.transferred.clear();
        }
        if step.end {
            self.element = None;
        }
        let opened = self.opened;
        match step.element {
            Element::Close => {
                self.opened = None;
                Ok(0)
            }
            Element::Idn if step.write => {
                self.opened = Some(Idn(step.info)).filter(|idn| self.blocks.contains_key(idn));
                self.opened.and_then(|idn| self.blocks.get(&idn)).map(|block| block.data_status).ok_or(0x1001)
            }
            element if !step.write => {
                let block = opened.and_then(|idn| self.blocks.get(&idn)).ok_or(0x0001u16)?;
                let words = match element {
                    Element::Attribute => Value::Long(block.attribute.0).to_words(),
                    Element::Data => block.value.to_words(),
                    _ => return Err((element as u16) << 12 | 1),
                };
                let index = self.transferred.len();
                let word = *words.get(index).ok_or((element as u16) << 12 | 3)?;
                if step.end && index + 1 < words.len() {
                    return Err((element as u16) << 12 | 2);
                }
                self.transferred.push(word);
                Ok(word)
            }
            Element::Data => {
                let idn = opened.ok_or(0x0001u16)?;
                self.transferred.push(step.info);
                if step.end { self.write(idn) } else { Ok(0) }
            }
            element => Err((element as u16) << 12 | 4),
        }
    }

    fn write(&mut self, idn: Idn) -> Result<u16, u16> {
        let words = std::mem::take(&mut self.transferred);
        let manners = self.manners.clone();
        let block = self.blocks.get_mut(&idn).ok_or(0x1001u16)?;
        if block.attribute.0 == READ_ONLY_WORD {
            return Err(0x7004);
        }
        let value = Value::of_words(&words, block.attribute.is_variable());
        match (block.attribute.fixed_bytes(), words.len()) {
            (Some(bytes), sent) if sent * 2 < bytes => return Err(0x7002),
            (Some(bytes), sent) if sent * 2 > bytes => return Err(0x7003),
            _ => {}
        }
        if block.attribute.is_command() {
            block.running = manners.command;
            block.data_status = match words[0] {
                3 if idn == Idn::CHECK_FOR_CP3 && !manners.invalid_for_cp3.is_empty() => 0xF,
                3 if manners.command > 0 => 7,
                3 => 3,
                _ => 0,
            };
            if block.data_status == 0xF
                && let Some(list) = self.blocks.get_mut(&Idn::INVALID_FOR_CP3)
            {
                list.value = Value::idns(&manners.invalid_for_cp3);
            }
        } else if !manners.forgets.contains(&idn) {
            block.value = value;
        }
        Ok(0)
    }

    fn at(&self) -> Transmission {
        let busy = self.pending.as_ref().filter(|pending| pending.late == 0 && self.manners.busy > 0);
        let (handshake, busy) = match busy {
            Some(_) => (self.handshake ^ 1, status::BUSY),
            None => (self.handshake, 0),
        };
        let error = if self.error && busy == 0 { status::ERROR } else { 0 };
        let word = self.status | error | busy | handshake;
        let mut bytes = vec![self.address];
        bytes.extend(word.to_le_bytes());
        bytes.extend(self.info.to_le_bytes());
        if self.phase >= 3 {
            for idn in self.telegram().at {
                let value = self.value(idn).map(Value::to_words).unwrap_or_default();
                bytes.extend(value.into_iter().flat_map(u16::to_le_bytes));
            }
        }
        Transmission { bytes }
    }
}

impl Station for SoftwareSlave {
    fn next_event(&self) -> Option<Nanoseconds> {
        self.at_due
    }

    fn on_time(&mut self, now: Nanoseconds) -> Option<Transmission> {
        self.at_due.take_if(|due| *due <= now)?;
        (!self.manners.mute).then(|| self.at())
    }

    fn on_telegram_start(&mut self, _now: Nanoseconds) {}

    fn on_telegram(&mut self, _start: Nanoseconds, end: Nanoseconds, frame: Result<&[u8], LineError>) {
        match frame {
            Ok([BROADCAST, phase]) => self.on_mst(end, *phase),
            Ok([BROADCAST, data @ ..]) if self.phase >= 3 => self.on_mdt(data),
            Ok([address, data @ ..]) if *address == self.address && self.phase < 3 && self.phase > 0 => {
                self.on_mdt(data)
            }
            _ => {}
        }
    }

    fn on_signal(&mut self, _now: Nanoseconds, _present: bool) {}
}
