//! The simulation of a life: machine, drive, ring and master, and the service channel asked and waited for.

use std::collections::BTreeSet;

use bench::motor_side::SharedMotorSide;
use bench::{DriveHandle, DriveSetup, ProcessorError, World, ring_of_drives};
use fault_matrix::{MatrixError, Mode, Target};
use plant::ReferenceAxis;
use ring::fibre::Fault as RingFault;
use ring::ident::Element;
use ring::service_client::{Request, Step, StepRecord, status};
use ring::slots::{DriveData, DriveTimes, MdtPlace, Slots};
use ring::wire::BitRate;
use ring::{Nanoseconds, RingConfiguration};

use crate::life::Axis;
use crate::master::{Layout, Stubborn, bytes_of};
use crate::services::{KEY, PASSWORD, words_of_text};
use crate::steps::{read_value, reading, refusals, writing};
use crate::units::{Units, words_of, writes};

pub(crate) const ADDRESS: u8 = 5;
/// Polls of a procedure command before it counts as one without an end.
const POLLS: u32 = 400;
/// Procedure command: set and enabled, and its end.
const START: u16 = 3;
const DONE: u16 = 3;
const EXECUTING: u16 = 7;
const LOAD_DEFAULTS: u16 = 262;

/// Why a life ends before its time.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Stop {
    /// A law is broken.
    Broken {
        /// Its sentence.
        law: String,
        /// What was seen.
        detail: String,
    },
    /// The drive refuses this axis, with its reason.
    Refused(String),
}

impl From<ProcessorError> for Stop {
    fn from(error: ProcessorError) -> Self {
        match error {
            ProcessorError::Unlawful(broken) => {
                let time = broken.time.as_microseconds();
                Self::Broken { law: broken.law.to_owned(), detail: format!("at {time} us: {}", broken.detail) }
            }
            ProcessorError::Stuck { cause, .. } => {
                Self::Broken { law: "the drive can always go on".to_owned(), detail: cause }
            }
        }
    }
}

impl From<MatrixError> for Stop {
    fn from(error: MatrixError) -> Self {
        match error {
            MatrixError::Processor(error) => error.into(),
            other => Self::Broken { law: "the drive can always go on".to_owned(), detail: other.to_string() },
        }
    }
}

pub(crate) struct Rig {
    pub(crate) world: World<Stubborn>,
    pub(crate) drive: DriveHandle,
    pub(crate) axis: Axis,
    /// The axis with what the life has changed of it in CP2.
    pub(crate) now: Axis,
    /// Other data than the axis' own may stand in the drive.
    pub(crate) is_another: bool,
    /// S-0-0001 does not follow S-0-0002 in this run-up: something has been written there.
    pub(crate) writes_control_cycle: bool,
    pub(crate) machine: ReferenceAxis,
    /// What the run-ups have written.
    pub(crate) set: BTreeSet<u16>,
    times: Option<DriveTimes>,
    /// The fibre is sound again from this cycle on.
    pub(crate) sound_from: u64,
    /// What the mode bits have chosen last.
    pub(crate) chosen: u8,
}

impl Rig {
    pub(crate) fn new(axis: &Axis) -> Result<Self, Stop> {
        let mut machine = axis.plant.axis();
        if let Some(increments) = axis.increments {
            machine.machine.encoder.increments_per_revolution = increments;
        }
        if let Some(fault) = axis.built_for {
            fault.prepare(&mut machine);
        }
        let rate = BitRate::from_megabits(axis.megabits.into()).unwrap_or(BitRate::M2);
        let setup = DriveSetup { axis: machine, ..DriveSetup::new(ADDRESS) };
        let master = Stubborn::new(rate, ADDRESS);
        let (world, mut handles) = ring_of_drives(RingConfiguration::new(1, rate), master, &[setup])
            .map_err(|error| Stop::Refused(error.to_string()))?;
        let rig = Self {
            world,
            drive: handles.remove(0),
            axis: axis.clone(),
            now: axis.clone(),
            is_another: false,
            writes_control_cycle: false,
            machine,
            set: BTreeSet::new(),
            times: None,
            sound_from: 0,
            chosen: 0,
        };
        if let Some(fault) = axis.built_for {
            fault.begin(&rig);
        }
        Ok(rig)
    }

    pub(crate) fn master(&mut self) -> &mut Stubborn {
        self.world.ring_mut().master_mut()
    }

    pub(crate) fn run_until(&mut self, until: Nanoseconds) -> Result<(), Stop> {
        self.world.run_until(until.max(self.world.now())).map_err(Stop::from)
    }

    pub(crate) fn run(&mut self, span: Nanoseconds) -> Result<(), Stop> {
        self.run_until(self.world.now() + span)
    }

    /// So many cycles, from MST to MST.
    pub(crate) fn cycles(&mut self, number: u64) -> Result<(), Stop> {
        let until = self.master().cycles() + number;
        while self.master().cycles() < until {
            let next = ring::Master::next_transmission(self.world.ring().master());
            self.run_until(next.unwrap_or(self.world.now() + Nanoseconds(1)))?;
        }
        Ok(())
    }

    /// Revolutions of the motor since the beginning.
    pub(crate) fn angle(&mut self) -> f64 {
        let now = self.world.now().0;
        self.drive.motor_side.borrow_mut().machine().angle(now)
    }

    pub(crate) fn rpm(&mut self) -> f64 {
        let now = self.world.now().0;
        self.drive.motor_side.borrow_mut().machine().velocity(now) * 60.0 / core::f64::consts::TAU
    }

    pub(crate) fn bridge_is_on(&self) -> bool {
        self.drive.motor_side.borrow().bridge_is_on()
    }

    /// Steps of the service channel, all of them; `None` if the channel does not answer.
    pub(crate) fn ask(&mut self, steps: Vec<Step>) -> Result<Option<Vec<StepRecord>>, Stop> {
        self.master().ask(Request::Steps(steps));
        loop {
            self.cycles(1)?;
            if self.master().is_idle() {
                break;
            }
            if self.master().silent() > 100 {
                return Ok(None);
            }
        }
        let mut last = None;
        while let Some(finished) = self.master().answer() {
            last = Some(finished);
        }
        Ok(last.and_then(|finished| finished.result.is_ok().then_some(finished.steps)))
    }

    /// Reads operation data of fixed length.
    pub(crate) fn read(&mut self, idn: u16) -> Result<Option<i64>, Stop> {
        let records = self.ask(reading(idn, true))?;
        Ok(records.and_then(|records| read_value(idn, &records)))
    }

    /// Reads a text or a list as bytes.
    fn bytes(&mut self, idn: u16) -> Result<Option<Vec<u8>>, Stop> {
        self.master().ask(Request::Read(ring::ident::Idn(idn)));
        while !self.master().is_idle() && self.master().silent() < 100 {
            self.cycles(1)?;
        }
        let mut last = None;
        while let Some(finished) = self.master().answer() {
            last = Some(finished);
        }
        Ok(last.and_then(|finished| match finished.result {
            Ok(reply) => match reply.value() {
                Some(ring::ident::Value::Bytes(bytes)) => Some(bytes.clone()),
                _ => None,
            },
            Err(_) => None,
        }))
    }

    /// Writes operation data; the error word, if it is refused, or 0 if there is no answer.
    pub(crate) fn write(&mut self, idn: u16, value: i64) -> Result<Result<(), u16>, Stop> {
        self.write_words(idn, &words_of(idn, value))
    }

    /// The same with the words as they are.
    pub(crate) fn write_words(&mut self, idn: u16, words: &[u16]) -> Result<Result<(), u16>, Stop> {
        let Some(records) = self.ask(writing(idn, words))? else { return Ok(Err(0)) };
        Ok(records.iter().find(|record| record.error).map_or(Ok(()), |record| Err(record.reply)))
    }

    /// Starts a procedure command and waits for its end; its data status, or the error word as `Err`. It is cancelled afterwards.
    pub(crate) fn command(&mut self, idn: u16) -> Result<Result<u16, u16>, Stop> {
        if let Err(code) = self.write(idn, START.into())? {
            return Ok(Err(code));
        }
        let mut result = EXECUTING;
        for _ in 0..POLLS {
            let Some(records) = self.ask(vec![Step::open(ring::ident::Idn(idn))])? else { return Ok(Err(0)) };
            result = records.first().map_or(0, |record| record.reply);
            if result & 0xF != EXECUTING {
                break;
            }
        }
        Ok(self.write(idn, 0)?.map(|()| result & 0xF))
    }

    /// Writes in CP2 what a run-up needs; `settings`: and everything else that the axis has.
    pub(crate) fn set_up(&mut self, settings: bool) -> Result<(), Stop> {
        if settings && self.is_another {
            // Data that nobody writes again may be those of another machine, or lost on their way through another scaling.
            if let Err(code) = self.command(LOAD_DEFAULTS)? {
                return Err(Stop::Refused(format!("S-0-0262 is refused in CP2 with {code:04X}H")));
            }
            self.now = self.axis.clone();
            self.is_another = false;
        }
        let times = self.needs()?;
        let slots = self.layout(times)?;
        self.configure(&slots, settings)
    }

    /// From CP0 to CP2.
    pub(crate) fn open_cp2(&mut self) -> Result<(), Stop> {
        self.fall_to_cp0()?;
        self.master().open_channel();
        self.master().phase = 1;
        self.cycles(4)?;
        if self.master().at().is_none_or(|at| at.status & status::HANDSHAKE == 0) {
            return Err(Stop::Broken {
                law: "ten clean cycles of CP0 and a run-up always bring the drive back".to_owned(),
                detail: format!("no answer with AHS = 1 in CP1: {:04X?}", self.master().at()),
            });
        }
        self.master().phase = 2;
        self.cycles(2)
    }

    /// From CP0 to CP4 with everything that the axis has.
    pub(crate) fn run_up(&mut self) -> Result<(), Stop> {
        self.open_cp2()?;
        self.set_up(true)?;
        self.go_on_to_cp4()
    }

    /// From CP2 to CP4.
    pub(crate) fn go_on_to_cp4(&mut self) -> Result<(), Stop> {
        self.check(127)?;
        self.master().phase = 3;
        self.cycles(3)?;
        self.check(128)?;
        self.master().phase = 4;
        self.cycles(3)
    }

    /// From CP0 to the phase before this one, 3 or 4, and to this one without its transition check.
    pub(crate) fn skip_check(&mut self, phase: u8) -> Result<(), Stop> {
        self.open_cp2()?;
        self.set_up(false)?;
        if phase == 4 {
            self.check(127)?;
            self.master().phase = 3;
            self.cycles(3)?;
        }
        self.master().phase = phase;
        self.cycles(3)
    }

    /// Until the service channel has nothing to do any more.
    pub(crate) fn wait_for_answers(&mut self) -> Result<(), Stop> {
        while !self.master().is_idle() && self.master().silent() < 100 {
            self.cycles(1)?;
        }
        Ok(())
    }

    /// Takes the password back, if one is set.
    pub(crate) fn unlock(&mut self) -> Result<(), Stop> {
        if self.bytes(PASSWORD)?.is_some_and(|shown| !shown.is_empty()) {
            self.ask(writing(PASSWORD, &words_of_text(KEY)))?;
        }
        Ok(())
    }

    /// The drive has taken another setting than the axis began with.
    pub(crate) fn learn(&mut self, idn: u16, value: i64) {
        self.now.settings.push((idn, value));
        self.is_another = true;
        self.wrap();
    }

    fn wrap(&mut self) {
        let modulo = Units::of(&self.now).modulo.map(|modulo| modulo as i64);
        let wraps = self.now.wraps;
        self.master().wrap_at(modulo, wraps);
    }

    /// The operation mode that the mode bits ask for.
    pub(crate) fn chosen_mode(&self) -> i64 {
        let idn = crate::generate::MODES.get(usize::from(self.chosen)).copied().unwrap_or(32);
        crate::units::setting(&self.now, idn).unwrap_or_else(|| crate::units::default_of(idn))
    }

    /// Ten clean cycles of CP0, once the fibre is sound.
    pub(crate) fn fall_to_cp0(&mut self) -> Result<(), Stop> {
        self.master().phase = 0;
        while self.world.ring().cycle().is_some_and(|cycle| cycle < self.sound_from) {
            self.cycles(1)?;
        }
        self.cycles(12)
    }

    fn needs(&mut self) -> Result<DriveTimes, Stop> {
        if let Some(times) = self.times {
            return Ok(times);
        }
        let mut time = |idn| {
            let value = self.read(idn)?;
            value.and_then(|value| u16::try_from(value).ok()).ok_or_else(|| Stop::Broken {
                law: "what the drive needs can be read in CP2".to_owned(),
                detail: format!("S-0-{idn:04}: {value:?}"),
            })
        };
        let times = DriveTimes {
            t1_min: time(3)?,
            t_at_mdt: time(4)?,
            t5: time(5)?,
            t_mdt_mst: time(88)?,
            t_mdt_command: time(90)?,
            ..DriveTimes::default()
        };
        self.times = Some(times);
        Ok(times)
    }

    fn layout(&mut self, times: DriveTimes) -> Result<Slots, Stop> {
        let axis = &self.axis;
        let bytes = |idns: &[u16]| idns.iter().map(|&idn| bytes_of(idn)).sum();
        let data = DriveData { at_bytes: bytes(&axis.at), mdt_bytes: bytes(&axis.mdt) };
        let rate = BitRate::from_megabits(axis.megabits.into()).unwrap_or(BitRate::M2);
        let place = if axis.early_mdt { MdtPlace::Early } else { MdtPlace::Late };
        let slots = Slots::compute(&[times], &[data], axis.cycle, rate, place)
            .map_err(|error| Stop::Refused(error.to_string()))?;
        let layout = Layout {
            cycle: axis.cycle,
            control_cycles: axis.control_cycles,
            t2: slots.t2,
            at: axis.at.clone(),
            mdt: axis.mdt.clone(),
        };
        self.master().set_layout(layout);
        self.wrap();
        Ok(slots)
    }

    fn configure(&mut self, slots: &Slots, settings: bool) -> Result<(), Stop> {
        let axis = &self.axis;
        let bytes: usize = axis.mdt.iter().map(|&idn| bytes_of(idn)).sum();
        let mut values = vec![
            (2, i64::from(axis.cycle)),
            (6, slots.t1.first().copied().unwrap_or(0).into()),
            (89, slots.t2.into()),
            (8, slots.t3.into()),
            (7, slots.t4.into()),
            (9, 1),
            (10, 4 + bytes as i64),
            (15, axis.telegram.into()),
        ];
        // S-0-0001 follows S-0-0002, if nobody writes it.
        if axis.control_cycles > 1 || self.writes_control_cycle {
            values.push((1, i64::from(axis.cycle) * i64::from(axis.control_cycles.max(1))));
        }
        if settings {
            values.extend(writes(axis, &self.machine));
        }
        let mut steps: Vec<Step> =
            values.iter().flat_map(|&(idn, value)| writing(idn, &words_of(idn, value))).collect();
        if axis.telegram & 7 == 7 {
            for (idn, list) in [(16, &axis.at), (24, &axis.mdt)] {
                let length = 2 * list.len() as u16;
                let words: Vec<u16> = [length, length].into_iter().chain(list.iter().copied()).collect();
                steps.extend(writing(idn, &words));
            }
        }
        // A vertical load whose brake does not hold keeps its torque over a lost ring, and a drive under torque takes no angle.
        if settings && self.axis.aligned && !self.bridge_is_on() {
            steps.extend(writing(0x8000 | 118, &words_of(0x8000 | 118, self.commutation_angle())));
        }
        let opened = steps.iter().filter(|step| step.element == Element::Idn).map(|step| step.info);
        self.set.extend(opened);
        let Some(records) = self.ask(steps)? else {
            return Err(Stop::Broken {
                law: "the service channel answers in CP2".to_owned(),
                detail: "no answer".to_owned(),
            });
        };
        match refusals(&records).first() {
            Some((idn, code)) => {
                Err(Stop::Refused(format!("{} is refused in CP2 with {code:04X}H", ring::ident::Idn(*idn))))
            }
            None => Ok(()),
        }
    }

    /// Electrical angle at this moment, in 0.01 degrees.
    pub(crate) fn commutation_angle(&mut self) -> i64 {
        let turns = self.angle() + self.machine.machine.encoder.electrical_zero;
        let electrical = turns * f64::from(self.machine.machine.windings.pole_pairs);
        ((electrical - electrical.floor()) * 36_000.0) as i64
    }

    fn check(&mut self, command: u16) -> Result<(), Stop> {
        match self.command(command)? {
            Ok(DONE) => Ok(()),
            other => {
                let reason = self.bytes(0x8003)?.map(|bytes| String::from_utf8_lossy(&bytes).into_owned());
                Err(Stop::Refused(format!("S-0-{command:04} ends with {other:?}: {}", reason.unwrap_or_default())))
            }
        }
    }
}

impl Target for Rig {
    fn now(&self) -> Nanoseconds {
        self.world.now()
    }

    fn motor_side(&self) -> &SharedMotorSide {
        &self.drive.motor_side
    }

    fn mode(&self) -> Mode {
        match self.chosen_mode() {
            1 => Mode::Torque,
            3 | 0x13 | 0x213 => Mode::Position,
            11 | 0x1B | 0x21B => Mode::PositionWithoutLag,
            _ => Mode::Velocity,
        }
    }

    fn hold_switches(&mut self, on: bool) {
        self.master().switch(if on { 7 } else { 0 });
    }

    fn take_bit_15_away(&mut self) {
        self.world.ring_mut().master_mut().take_bit_15_back();
    }

    fn next_cycles(&self) -> u64 {
        self.world.ring().cycle().map_or(2, |cycle| cycle + 2)
    }

    fn add_ring_fault(&mut self, fault: RingFault) {
        self.sound_from = self.sound_from.max(fault.cycles.end);
        self.world.ring_mut().add_fault(fault);
    }

    fn run_to_cycle(&mut self, cycle: u64) -> Result<(), MatrixError> {
        while self.world.ring().cycle().is_none_or(|now| now < cycle) {
            let next = ring::Master::next_transmission(self.world.ring().master());
            self.world.run_until(next.unwrap_or(self.world.now() + Nanoseconds(1)))?;
        }
        Ok(())
    }
}
