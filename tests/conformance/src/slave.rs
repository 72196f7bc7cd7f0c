//! The slave under test and the master's end of the fibre: everything a case can do to a drive.
//!
//! A cycle begins here just before its MDT, when its AT has come: so a step of the service channel that is sent with the MDT is answered by
//! the AT that the next [`Slave::cycle`] returns.

use bench::{DriveHandle, DriveSetup, World, ring_of_drives};
use drive::DICTIONARY;
use ring::fibre::{Effect, Fault, TelegramKind};
use ring::ident::{Element, Idn};
use ring::service_client::{HANDSHAKE_TIMEOUT_CYCLES, Step, control, status};
use ring::tester::{Plan, ReceivedAt};
use ring::wire::{BROADCAST, BitRate};
use ring::{Nanoseconds, RingConfiguration, Tester};

use crate::configuration::Configuration;

/// What a case says when it fails: what was expected and what was seen.
pub type Outcome<T = ()> = Result<T, String>;

/// Cycle of CP0 to CP2, the shortest that a master may have (sercos2.md 2.1).
pub const START_UP_CYCLE: Nanoseconds = Nanoseconds::from_millis(1);

/// When the MDT starts in CP1 and CP2: in the middle of its window of 500 to 700 us (sercos2.md 2.1).
pub const START_UP_MDT: Nanoseconds = Nanoseconds::from_microseconds(600);

/// MSTs in CP0 before a run-up (sercos2.md 2.1).
pub const GOOD_MSTS: u32 = 10;

/// Cycles that a drive may take from the switch to following: it may have to look for its commutation angle first.
const SWITCHING_ON: u32 = 2_000;

/// How often a data status is asked for before a command counts as one without an end.
const POLLS: u32 = 400;

/// An AT of the slave under test.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct At {
    /// First word.
    pub status: u16,
    /// Second word.
    pub info: u16,
    /// Configurable data.
    pub data: Vec<u8>,
    /// From the end of the MST to its start.
    pub after_mst: Nanoseconds,
}

impl At {
    /// The word of configurable data at this byte; 0 behind the end.
    #[must_use]
    pub fn word(&self, byte: usize) -> u16 {
        let at = |index| self.data.get(index).copied().unwrap_or(0);
        u16::from_le_bytes([at(byte), at(byte + 1)])
    }

    /// The four-byte value of configurable data at this byte.
    #[must_use]
    pub fn long(&self, byte: usize) -> i32 {
        (u32::from(self.word(byte)) | u32::from(self.word(byte + 2)) << 16) as i32
    }
}

/// The answer to a step of the service channel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Answer {
    /// INFO.
    pub info: u16,
    /// The error bit.
    pub error: bool,
    /// MDTs sent with the step until the AT that answered it; 1 is the fastest.
    pub cycles: u32,
}

impl Answer {
    /// INFO, or the error code.
    ///
    /// # Errors
    /// The error code.
    pub const fn result(self) -> Result<u16, u16> {
        if self.error { Err(self.info) } else { Ok(self.info) }
    }
}

/// How long a drive in QEMU took over a step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Release {
    /// The data block that was open.
    pub idn: Idn,
    /// The step.
    pub step: Step,
    /// From the end of the step's MDT at the master to the release.
    pub after_mdt: Nanoseconds,
}

/// The drive, its ring, and the state of its master.
pub struct Slave {
    /// Ring and processors.
    pub world: World<Tester>,
    /// The drive from outside.
    pub drive: DriveHandle,
    /// Data byte of the next MST; `None`: no MST.
    pub mst: Option<u8>,
    /// Control word bits 15 to 6.
    pub control: u16,
    /// Command data of the record in CP3 and CP4.
    pub commands: Vec<u8>,
    /// What the cyclic telegrams look like.
    pub configuration: Configuration,
    /// Whether there is an MDT at all.
    pub mdt: bool,
    /// The last AT.
    pub last: Option<At>,
    /// Most cycles that a step has taken so far, and which.
    pub slowest: (u32, Option<Step>),
    /// From the end of the MDT to the release of the container, for every step that the processor released; of a drive in QEMU only.
    pub releases: Vec<Release>,
    opened: u16,
    address: u8,
    addressed: u8,
    handshake: bool,
    step: Step,
}

impl Slave {
    /// A drive with this address on a ring of its own, switched on, in the first cycle of CP0.
    #[must_use]
    pub fn new(setup: DriveSetup) -> Self {
        Self::on(BitRate::M2, vec![setup])
    }

    /// The first of several drives on a ring with this bit rate.
    ///
    /// # Panics
    /// A drive that does not start: the set-up is wrong then, not the drive.
    #[must_use]
    pub fn on(rate: BitRate, setups: Vec<DriveSetup>) -> Self {
        Self::in_ring(rate, setups, 0)
    }

    /// The first of several drives that are switched on while the master is in some phase already.
    ///
    /// # Panics
    /// As [`Slave::on`].
    #[must_use]
    #[allow(clippy::expect_used, reason = "a wrong set-up is a mistake of the test")]
    pub fn in_ring(rate: BitRate, setups: Vec<DriveSetup>, phase: u8) -> Self {
        let tester = Tester::new(rate, Plan::mst_only(phase, START_UP_CYCLE));
        let (world, mut handles) =
            ring_of_drives(RingConfiguration::new(setups.len(), rate), tester, &setups).expect("the drives start");
        Self { mst: Some(phase), ..Self::around(world, handles.remove(0)) }
    }

    /// A drive that runs somewhere: on this computer or in QEMU.
    #[must_use]
    pub fn around(world: World<Tester>, drive: DriveHandle) -> Self {
        let mut slave = Self {
            world,
            mst: Some(0),
            control: 0,
            commands: Vec::new(),
            configuration: Configuration::default(),
            mdt: true,
            last: None,
            slowest: (0, None),
            releases: Vec::new(),
            opened: 0,
            address: drive.address,
            addressed: drive.address,
            handshake: true,
            step: Step { element: Element::Close, write: false, end: false, info: 0 },
            drive,
        };
        slave.run_to_mdt();
        slave
    }

    /// Its address.
    #[must_use]
    pub const fn address(&self) -> u8 {
        self.address
    }

    /// Whom the MDT of CP1 and CP2 is for.
    pub fn address_to(&mut self, address: u8) {
        self.addressed = address;
    }

    /// Handshake bit MHS as it is sent.
    #[must_use]
    pub const fn handshake(&self) -> bool {
        self.handshake
    }

    /// Sets the handshake bit and the step, as a master that has lost its place would.
    pub fn force(&mut self, handshake: bool, step: Step) {
        self.handshake = handshake;
        self.step = step;
    }

    /// The rest of this cycle with its MDT, and the next up to the end of its ATs. Returns the AT of the slave.
    pub fn cycle(&mut self) -> Option<At> {
        self.finish_cycle();
        self.begin_cycle();
        self.run_to_mdt();
        self.last = self.ats().into_iter().find_map(|(address, at)| (address == self.address).then_some(at));
        self.last.clone()
    }

    /// Sends the MDT of this cycle and runs to so many us after the end of its MST; to be followed by [`Slave::finish_cycle`] or
    /// [`Slave::cycle`].
    pub fn finish_cycle_to(&mut self, microseconds: u16) {
        let bytes = self.mdt_bytes();
        self.world.ring_mut().master_mut().set_mdt(bytes);
        self.run_to(microseconds);
    }

    /// The first half of [`Slave::cycle`]: the MDT goes out, and everything happens up to the next MST.
    pub fn finish_cycle(&mut self) {
        let bytes = self.mdt_bytes();
        self.world.ring_mut().master_mut().set_mdt(bytes);
        let end = self.world.ring().master().end_of_cycle();
        self.run_until(end);
    }

    /// After [`Slave::finish_cycle`]: the next MST is decided on. The caller runs on to what it wants to see, and then to the MDT.
    pub fn begin_cycle(&mut self) {
        let plan = self.plan();
        self.world.ring_mut().master_mut().set_plan(plan);
        let decided = self.world.now() + Nanoseconds(2);
        self.run_until(decided);
    }

    /// Runs to so many us after the end of this cycle's MST; nothing, if that is over.
    pub fn run_to(&mut self, microseconds: u16) {
        let until = self.world.ring().master().mark() + Nanoseconds::from_microseconds(microseconds.into());
        let until = until.max(self.world.now());
        self.run_until(until);
    }

    /// Switches on (control word bits 15 to 13) and waits until the drive follows.
    ///
    /// # Errors
    /// It does not within 200 cycles.
    pub fn switch_on(&mut self) -> Outcome {
        self.control = (self.control & 0x1FFF) | control::ON | control::ENABLE | control::NO_HALT;
        for _ in 0..SWITCHING_ON {
            let at = self.cycle();
            if at.is_some_and(|at| status::readiness(at.status) == 3 && at.status & status::FOLLOWS != 0) {
                return Ok(());
            }
        }
        let diagnosis = self.number(390)?;
        Err(format!(
            "not in operation {SWITCHING_ON} cycles after it was switched on: S-0-0390 = {diagnosis:04X}H, {:04X?}",
            self.last
        ))
    }

    /// So many cycles.
    pub fn cycles(&mut self, number: u32) {
        for _ in 0..number {
            self.cycle();
        }
    }

    /// ATs of every drive in this cycle so far, with their addresses.
    #[must_use]
    pub fn ats(&self) -> Vec<(u8, At)> {
        self.world.ring().master().received().iter().filter_map(parse).collect()
    }

    /// Whether the slave has sent no AT in this cycle.
    #[must_use]
    pub const fn is_silent(&self) -> bool {
        self.last.is_none()
    }

    /// Something happens to this telegram on its way to the slave, so many cycles from the next on.
    pub fn disturb(&mut self, kind: TelegramKind, effect: Effect, cycles: u64) {
        let from = self.world.ring().cycle().unwrap_or(0) + 1;
        for cycle in from..from + cycles {
            self.world.ring_mut().add_fault(Fault::once(cycle, 0, kind, effect));
        }
    }

    /// Sends a step until it is acknowledged.
    ///
    /// # Errors
    /// The handshake takes more than 10 cycles (IGS 4.2.2), or BUSY does not end.
    pub fn step(&mut self, step: Step) -> Outcome<Answer> {
        self.handshake = !self.handshake;
        self.step = step;
        if step.element == Element::Idn {
            self.opened = step.info;
        }
        self.drive.measurements.borrow_mut().released = None;
        let answer = self.await_answer()?;
        if let Some(released) = self.drive.measurements.borrow_mut().released.take() {
            // The MDT that brought the step: the later ones only repeat it.
            let repeated = self.cycle_time().0 * u64::from(answer.cycles - 1);
            let brought = self.world.ring().master().mdt_end().saturating_sub(Nanoseconds(repeated));
            let after_mdt = released.saturating_sub(brought);
            self.releases.push(Release { idn: Idn(self.opened), step, after_mdt });
        }
        Ok(answer)
    }

    fn cycle_time(&self) -> Nanoseconds {
        self.plan().cycle
    }

    /// Waits for the answer to the step that is being sent.
    ///
    /// # Errors
    /// As [`Slave::step`].
    pub fn await_answer(&mut self) -> Outcome<Answer> {
        for cycles in 1..=HANDSHAKE_TIMEOUT_CYCLES {
            let Some(at) = self.cycle() else { continue };
            let acknowledged = (at.status & status::HANDSHAKE != 0) == self.handshake;
            if acknowledged && at.status & status::BUSY == 0 {
                if cycles > self.slowest.0 {
                    self.slowest = (cycles, Some(self.step));
                }
                return Ok(Answer { info: at.info, error: at.status & status::ERROR != 0, cycles });
            }
        }
        Err(format!("\"{}\" is not acknowledged within {HANDSHAKE_TIMEOUT_CYCLES} cycles", self.step))
    }

    /// One step by its parts.
    ///
    /// # Errors
    /// As [`Slave::step`].
    pub fn send(&mut self, element: u8, write: bool, end: bool, info: u16) -> Outcome<Answer> {
        let element = Element::of_control(u16::from(element) << 3);
        self.step(Step { element, write, end, info })
    }

    /// Opens a data block; the data status.
    ///
    /// # Errors
    /// The handshake fails, or the drive refuses.
    pub fn open(&mut self, idn: u16) -> Outcome<u16> {
        let answer = self.step(Step::open(Idn(idn)))?;
        answer.result().map_err(|code| format!("{} does not open: {code:04X}H", Idn(idn)))
    }

    /// Closes the channel.
    ///
    /// # Errors
    /// As [`Slave::step`]; or the drive answers with an error, which it never may.
    pub fn close(&mut self) -> Outcome {
        let answer = self.step(Step::close(self.step.info))?;
        if answer.error { Err(format!("closing is refused with {:04X}H", answer.info)) } else { Ok(()) }
    }

    /// Reads so many words of an element, END with the last: the words, or the error code of the first step that is refused.
    ///
    /// # Errors
    /// The handshake fails.
    pub fn words(&mut self, element: u8, number: usize) -> Outcome<Result<Vec<u16>, u16>> {
        let mut words = Vec::new();
        for index in 1..=number {
            match self.send(element, false, index == number, 0)?.result() {
                Ok(word) => words.push(word),
                Err(code) => return Ok(Err(code)),
            }
        }
        Ok(Ok(words))
    }

    /// Reads an element of variable length, both length words first.
    ///
    /// # Errors
    /// The handshake fails.
    pub fn list(&mut self, element: u8) -> Outcome<Result<Vec<u16>, u16>> {
        let length = match self.send(element, false, false, 0)?.result() {
            Ok(length) => length,
            Err(code) => return Ok(Err(code)),
        };
        let rest = usize::from(length).div_ceil(2) + 1;
        let words = self.words(element, rest)?;
        Ok(words.map(|words| [vec![length], words].concat()))
    }

    /// Writes words of operation data, END with the last: the data status, or the error code.
    ///
    /// # Errors
    /// The handshake fails.
    pub fn write(&mut self, words: &[u16]) -> Outcome<Result<u16, u16>> {
        let mut result = Ok(0);
        for (index, word) in (1..).zip(words) {
            result = self.send(7, true, index == words.len(), *word)?.result();
            if result.is_err() {
                break;
            }
        }
        Ok(result)
    }

    /// Opens, writes operation data, closes.
    ///
    /// # Errors
    /// The handshake fails.
    pub fn set(&mut self, idn: u16, words: &[u16]) -> Outcome<Result<(), u16>> {
        self.open(idn)?;
        let result = self.write(words)?;
        self.close()?;
        Ok(result.map(|_| ()))
    }

    /// Like [`Slave::set`] where the drive must accept.
    ///
    /// # Errors
    /// It does not.
    pub fn must_set(&mut self, idn: u16, words: &[u16]) -> Outcome {
        self.set(idn, words)?.map_err(|code| format!("{} = {words:04X?} is refused with {code:04X}H", Idn(idn)))
    }

    /// Opens, reads operation data of any length, closes.
    ///
    /// # Errors
    /// The handshake fails, the drive refuses, or it has another length than the table says.
    pub fn get(&mut self, idn: u16) -> Outcome<Vec<u16>> {
        self.open(idn)?;
        let fixed = DICTIONARY.find(sercos::Idn(idn)).and_then(|block| block.fixed_bytes());
        let words = match fixed {
            Some(bytes) => self.words(7, usize::from(bytes / 2))?,
            None => self.list(7)?,
        };
        self.close()?;
        words.map_err(|code| format!("{} cannot be read: {code:04X}H", Idn(idn)))
    }

    /// Operation data as a number, low word first.
    ///
    /// # Errors
    /// As [`Slave::get`].
    pub fn number(&mut self, idn: u16) -> Outcome<u64> {
        Ok(self.get(idn)?.iter().rev().fold(0, |number, &word| number << 16 | u64::from(word)))
    }

    /// The entries of a list of two-byte items.
    ///
    /// # Errors
    /// As [`Slave::get`].
    pub fn entries(&mut self, idn: u16) -> Outcome<Vec<u16>> {
        Ok(self.get(idn)?.split_off(2))
    }

    /// A text.
    ///
    /// # Errors
    /// As [`Slave::get`].
    pub fn text(&mut self, idn: u16) -> Outcome<String> {
        let words = self.get(idn)?;
        let length = usize::from(words.first().copied().unwrap_or(0));
        let bytes: Vec<u8> = words.iter().skip(2).flat_map(|word| word.to_le_bytes()).take(length).collect();
        String::from_utf8(bytes).map_err(|error| error.to_string())
    }

    /// Starts a command and waits for its end; its data status then. The command stays set.
    ///
    /// # Errors
    /// The handshake fails, or the command is refused or does not end.
    pub fn start_command(&mut self, idn: u16) -> Outcome<u16> {
        self.must_set(idn, &[3])?;
        for _ in 0..POLLS {
            let status = self.open(idn)?;
            self.close()?;
            if status != 7 {
                return Ok(status);
            }
        }
        Err(format!("{} is still executing after {POLLS} polls", Idn(idn)))
    }

    /// Starts a command, waits for its end and cancels it; its data status at the end.
    ///
    /// # Errors
    /// As [`Slave::start_command`]; or the data status is not 0 afterwards.
    pub fn command(&mut self, idn: u16) -> Outcome<u16> {
        let status = self.start_command(idn)?;
        self.must_set(idn, &[0])?;
        let left = self.open(idn)?;
        self.close()?;
        if left == 0 {
            Ok(status)
        } else {
            Err(format!("{} has data status {left:X}H after its cancellation", Idn(idn)))
        }
    }

    /// Lets everything happen up to `until`.
    ///
    /// # Panics
    /// A drive in QEMU cannot go on; the text says why. A drive on this computer always can.
    pub fn run_until(&mut self, until: Nanoseconds) {
        if let Err(error) = self.world.run_until(until) {
            panic!("the drive cannot go on: {error}");
        }
    }

    /// Runs to just before this cycle's MDT.
    pub fn run_to_mdt(&mut self) {
        let after = match self.mst {
            Some(3..) if self.has_cyclic_cycle() => Nanoseconds::from_microseconds(self.configuration.t2.into()),
            _ => START_UP_MDT,
        };
        let until = self.world.ring().master().mark() + after - Nanoseconds::from_microseconds(1);
        let until = until.max(self.world.now());
        self.run_until(until);
    }

    fn has_cyclic_cycle(&self) -> bool {
        matches!(self.mst, Some(3 | 4))
    }

    fn plan(&self) -> Plan {
        let (after, cycle) = if self.has_cyclic_cycle() {
            let microseconds = |time: u16| Nanoseconds::from_microseconds(time.into());
            (microseconds(self.configuration.t2), microseconds(self.configuration.cycle))
        } else {
            (START_UP_MDT, START_UP_CYCLE)
        };
        let has_mdt = self.mdt && !matches!(self.mst, Some(0));
        Plan { mst: self.mst, mdt: has_mdt.then(|| (after, Vec::new())), cycle }
    }

    /// The MDT of this cycle, by the phase of its MST.
    fn mdt_bytes(&self) -> Vec<u8> {
        let service = self.step.control() | u16::from(self.handshake);
        if !self.has_cyclic_cycle() {
            let [low, high] = service.to_le_bytes();
            let [first, second] = self.step.info.to_le_bytes();
            return vec![self.addressed, low, high, first, second];
        }
        let mut record = Vec::new();
        record.extend((self.control & !control::SERVICE | service).to_le_bytes());
        record.extend(self.step.info.to_le_bytes());
        record.extend(&self.commands);
        self.configuration.mdt(&record)
    }
}

fn parse(received: &ReceivedAt) -> Option<(u8, At)> {
    let [address, low, high, first, second, data @ ..] = received.bytes.as_slice() else { return None };
    if *address == BROADCAST {
        return None;
    }
    let at = At {
        status: u16::from_le_bytes([*low, *high]),
        info: u16::from_le_bytes([*first, *second]),
        data: data.to_vec(),
        after_mst: received.after_mst?,
    };
    Some((*address, at))
}
