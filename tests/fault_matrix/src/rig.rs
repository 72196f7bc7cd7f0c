//! One drive on a ring, brought into a state.

use bench::motor_side::SharedMotorSide;
use bench::{
    DriveHandle, DriveSetup, Executor, ProcessorError, Works, World, parameters_of, product, ring_of_drives_on,
};
use plant::ReferenceAxis;
use ring::fibre::Fault as RingFault;
use ring::ident::{Idn, Value};
use ring::master::{CommandValues, DriveScript, MasterScript, Motion, ProfilePoint, ScriptedMaster, Telegram};
use ring::service_client::{Reply, Request, ServiceError, control, status};
use ring::wire::BitRate;
use ring::{Nanoseconds, RingConfiguration};
use std::fmt;
use thiserror::Error;

use crate::{Fault, Target};

const ADDRESS: u8 = 5;
/// Speed of all states in which the axis turns, in rpm.
pub(crate) const SPEED: i32 = 600;
/// One look at the drive: a cycle of the current loop.
pub(crate) const STEP: Nanoseconds = Nanoseconds(62_500);
/// Switched on and following.
const FOLLOW: u16 = control::ON | control::ENABLE | control::NO_HALT;

/// Operation mode of a cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Mode {
    /// S-0-0080 is followed.
    Torque,
    /// S-0-0036 is followed.
    Velocity,
    /// S-0-0047 is followed with a lag.
    Position,
    /// S-0-0047 is followed without a lag.
    PositionWithoutLag,
}

impl Mode {
    /// S-0-0032.
    const fn parameter(self) -> u16 {
        match self {
            Self::Torque => 1,
            Self::Velocity => 2,
            Self::Position => 3,
            Self::PositionWithoutLag => 11,
        }
    }

    const fn command(self) -> Idn {
        match self {
            Self::Torque => Idn::TORQUE_COMMAND,
            Self::Velocity => Idn::VELOCITY_COMMAND,
            Self::Position | Self::PositionWithoutLag => Idn::POSITION_COMMAND,
        }
    }

    fn values(self, rpm: i32, driving: i16, point: ProfilePoint) -> CommandValues {
        match self {
            Self::Torque => CommandValues { torque: if rpm == 0 { 0 } else { driving }, ..CommandValues::default() },
            Self::Velocity => CommandValues::at_velocity(rpm * 10_000),
            Self::Position | Self::PositionWithoutLag => {
                // 0.2 s of ramp; 0.0001 degree.
                let speed = f64::from(rpm) * 60_000.0;
                let time = point.time.0 as f64 * 1e-9;
                let way = if time < 0.2 { 2.5 * time * time } else { time - 0.1 };
                CommandValues::at_position(point.start + (speed * way) as i32)
            }
        }
    }
}

impl fmt::Display for Mode {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.pad(match self {
            Self::Torque => "torque",
            Self::Velocity => "velocity",
            Self::Position => "position",
            Self::PositionWithoutLag => "position without lag",
        })
    }
}

/// State of the drive when the fault comes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum State {
    /// Power applied, torque off.
    Off,
    /// The search for the commutation angle, or the opening of the brake, is under way.
    SwitchingOn,
    /// In operation, following a command of zero.
    Standstill,
    /// In operation, turning with 600 rpm.
    AtSpeed,
    /// Stopped from 600 rpm by HALT, held with torque.
    Halted,
    /// 5 ms after Drive OFF at 600 rpm.
    Stopping,
}

impl fmt::Display for State {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.pad(match self {
            Self::Off => "off",
            Self::SwitchingOn => "switching on",
            Self::Standstill => "standstill",
            Self::AtSpeed => "at speed",
            Self::Halted => "halted",
            Self::Stopping => "stopping",
        })
    }
}

/// The simulation did not come as far as the fault, or could not be asked afterwards.
#[derive(Debug, Error)]
pub enum MatrixError {
    /// The drive could not be started, or has broken a law of the axis.
    #[error(transparent)]
    Processor(#[from] ProcessorError),
    /// In this cell.
    #[error("{cell}: {error}")]
    In {
        /// Which cell.
        cell: String,
        /// What happened.
        error: Box<MatrixError>,
    },
    /// The drive did not come into the state.
    #[error("{cell}: {expected} expected, but the master is {master}")]
    NotReached {
        /// Which cell.
        cell: String,
        /// What was waited for.
        expected: &'static str,
        /// What the master was doing.
        master: String,
    },
    /// A request over the service channel was not answered as a sound drive would.
    #[error("{request}: {cause}")]
    Service {
        /// What was asked.
        request: String,
        /// What came back.
        cause: String,
    },
}

pub(crate) struct Rig {
    world: World<ScriptedMaster>,
    drive: DriveHandle,
    mode: Mode,
    vertical: bool,
    name: String,
}

impl Rig {
    /// A drive in CP4, in the state.
    pub(crate) fn new(
        name: String,
        (fault, state, mode): (Fault, State, Mode),
        executor: &Executor,
    ) -> Result<Self, MatrixError> {
        let mut axis = if fault.needs_brake() { ReferenceAxis::vertical() } else { ReferenceAxis::catalogue() };
        fault.prepare(&mut axis);
        let vertical = fault.needs_brake();
        let telegram = Telegram::application(&[Idn::VELOCITY_FEEDBACK, Idn::POSITION_FEEDBACK], &[mode.command()]);
        let mut script = DriveScript::new(ADDRESS, telegram).with(Idn::OPERATION_MODE, Value::Word(mode.parameter()));
        if vertical {
            let encoder = axis.machine.encoder;
            let angle = (encoder.electrical_zero * f64::from(axis.machine.windings.pole_pairs)).fract() * 36_000.0;
            script = script
                .with_all(parameters_of(&axis))
                .with(product(120), Value::Word(3))
                .with(product(118), Value::Long(angle as u32))
                .with(Idn(206), Value::Word(60))
                .with(Idn(207), Value::Word(60));
        }
        if mode == Mode::Torque {
            script = script.with(Idn(91), Value::Long(SPEED.unsigned_abs() * 10_000));
        }
        script = script.with_all(fault.parameters());
        let works = if vertical { Works::OfItsAxis } else { Works::Blank };
        let setup = DriveSetup { axis, works, ..DriveSetup::new(ADDRESS) };
        let motion = (state != State::Off).then(|| motion(mode, state, fault.driving()));
        let script = MasterScript { motion, stops_at_refusals: false, ..MasterScript::new(vec![script]) };
        let configuration = RingConfiguration::new(1, BitRate::M2);
        let (world, mut handles) =
            ring_of_drives_on(configuration, ScriptedMaster::new(script), &[setup], |_| executor.clone())?;
        let mut rig = Self { world, drive: handles.remove(0), mode, vertical, name };
        fault.begin(&rig);
        rig.reach(state)?;
        Ok(rig)
    }

    fn reach(&mut self, state: State) -> Result<(), MatrixError> {
        if state == State::Off {
            self.wait("CP4", |rig| rig.master().is_done() && rig.master().phase() == 4)?;
            return self.run(Nanoseconds::from_millis(100));
        }
        if state == State::SwitchingOn {
            self.wait("the bridge on", |rig| rig.bridge_is_on())?;
            // Far from the end of the search, and before the brake opens.
            self.master_mut().hold_switches(Some(FOLLOW));
            return self.run(Nanoseconds::from_millis(10));
        }
        self.wait("operation", |rig| rig.last_status().is_some_and(|word| word & status::FOLLOWS != 0))?;
        if state != State::Standstill {
            self.wait("600 rpm", |rig| rig.rpm() > 0.99 * f64::from(SPEED))?;
        }
        self.run(Nanoseconds::from_millis(250))?;
        // From now on the drive alone decides: a master that answers an error with a control word of zero takes ENABLE away.
        self.master_mut().hold_switches(Some(FOLLOW));
        match state {
            State::Halted => {
                self.master_mut().hold_switches(Some(control::ON | control::ENABLE));
                self.run(Nanoseconds::from_millis(400))
            }
            State::Stopping => {
                let before = self.rpm();
                self.master_mut().hold_switches(Some(control::ENABLE | control::NO_HALT));
                self.wait("a stop", |rig| rig.rpm() < before - 20.0)?;
                self.run(Nanoseconds::from_millis(3))
            }
            _ => Ok(()),
        }
    }

    fn wait(&mut self, expected: &'static str, mut there: impl FnMut(&mut Self) -> bool) -> Result<(), MatrixError> {
        for _ in 0..20_000 {
            self.run(Nanoseconds::from_millis(1))?;
            if there(self) {
                return Ok(());
            }
        }
        let master = self.master().state().activity.to_string();
        Err(MatrixError::NotReached { cell: self.name.clone(), expected, master })
    }

    pub(crate) fn run(&mut self, span: Nanoseconds) -> Result<(), MatrixError> {
        let until = self.world.now() + span;
        Ok(self.world.run_until(until)?)
    }

    fn master(&self) -> &ScriptedMaster {
        self.world.ring().master()
    }

    fn master_mut(&mut self) -> &mut ScriptedMaster {
        self.world.ring_mut().master_mut()
    }

    pub(crate) fn rpm(&mut self) -> f64 {
        let now = self.world.now().0;
        self.drive.motor_side.borrow_mut().machine().velocity(now) * 60.0 / core::f64::consts::TAU
    }

    /// In degrees.
    pub(crate) fn angle(&mut self) -> f64 {
        let now = self.world.now().0;
        self.drive.motor_side.borrow_mut().machine().angle(now) * 360.0
    }

    pub(crate) fn bridge_is_on(&self) -> bool {
        self.drive.motor_side.borrow().bridge_is_on()
    }

    /// Whether the coil of the brake has no current; `None` without a brake.
    pub(crate) fn brake_is_closed(&self) -> Option<bool> {
        self.vertical.then(|| !self.drive.motor_side.borrow().brake_is_open())
    }

    fn last_status(&self) -> Option<u16> {
        self.master().report().samples.last().and_then(|sample| sample.status)
    }

    /// The first status word since then that tells of an error.
    pub(crate) fn error_status(&self, since: Nanoseconds) -> Option<u16> {
        let samples = self.master().report().samples.iter().filter(|sample| sample.time > since);
        samples.filter_map(|sample| sample.status).find(|word| word & status::SHUT_DOWN != 0)
    }

    /// The ring as it is, if it runs, else run up again without motion: the service channel is open.
    pub(crate) fn open_service(&mut self) -> Result<(), MatrixError> {
        let running = self.master().phase() == 4 && self.master().report().error.is_none();
        if running {
            return Ok(());
        }
        let telegram = Telegram::application(&[Idn::VELOCITY_FEEDBACK, Idn::POSITION_FEEDBACK], &[self.mode.command()]);
        let script = DriveScript::new(ADDRESS, telegram);
        self.master_mut().restart(MasterScript {
            reset_diagnostics: false,
            stops_at_refusals: false,
            ..MasterScript::new(vec![script])
        });
        self.wait("CP4 again", |rig| rig.master().is_done())?;
        if self.master().phase() == 4 {
            return Ok(());
        }
        let master = self.master().state().activity.to_string();
        Err(MatrixError::NotReached { cell: self.name.clone(), expected: "CP4 again", master })
    }

    /// One request over the service channel.
    pub(crate) fn ask(&mut self, request: Request) -> Result<Result<Reply, ServiceError>, MatrixError> {
        let done = self.master().report().drives[0].services.len();
        let words = request.to_string();
        self.master_mut().service(0).request(request);
        for _ in 0..400 {
            self.run(Nanoseconds::from_millis(2))?;
            if let Some(finished) = self.master().report().drives[0].services.get(done) {
                return Ok(finished.result.clone());
            }
        }
        Err(MatrixError::Service { request: words, cause: "no answer".to_owned() })
    }

    pub(crate) fn number(&mut self, idn: Idn) -> Result<u16, MatrixError> {
        let answer = self.ask(Request::Read(idn))?;
        match &answer {
            Ok(Reply::Data { value, .. }) => value.as_number().and_then(|number| u16::try_from(number).ok()),
            _ => None,
        }
        .ok_or_else(|| MatrixError::Service { request: format!("read {idn}"), cause: format!("{answer:?}") })
    }

    /// The control unit takes ON and ENABLE back.
    pub(crate) fn release(&mut self) -> Result<(), MatrixError> {
        self.master_mut().hold_switches(Some(0));
        self.run(Nanoseconds::from_millis(100))
    }

    /// S-0-0099; whether it was executed.
    pub(crate) fn reset_errors(&mut self) -> Result<bool, MatrixError> {
        Ok(self.ask(Request::Command { idn: Idn::RESET_CLASS_1, polls: 20 })?.is_ok())
    }

    /// Until the axis stands, or for 5 s.
    pub(crate) fn wait_for_standstill(&mut self) -> Result<(), MatrixError> {
        for _ in 0..500 {
            if self.rpm().abs() < 1.0 {
                break;
            }
            self.run(Nanoseconds::from_millis(10))?;
        }
        Ok(())
    }

    /// Switches the axis on once more; whether it follows.
    pub(crate) fn switch_on_again(&mut self) -> Result<bool, MatrixError> {
        let mode = self.mode;
        self.master_mut().move_again(motion(mode, State::Standstill, 0));
        // Without an edge nothing is switched on.
        self.master_mut().hold_switches(Some(0));
        self.run(Nanoseconds::from_millis(20))?;
        self.master_mut().move_again(motion(mode, State::Standstill, 0));
        self.master_mut().hold_switches(None);
        let before = self.now();
        for _ in 0..1_500 {
            self.run(Nanoseconds::from_millis(2))?;
            let samples = self.master().report().samples.last();
            let follows = |word: u16| word & status::FOLLOWS != 0;
            if samples.is_some_and(|sample| sample.time > before && sample.status.is_some_and(follows)) {
                self.run(Nanoseconds::from_millis(20))?;
                return Ok(self.bridge_is_on());
            }
        }
        Ok(false)
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
        self.mode
    }

    fn hold_switches(&mut self, on: bool) {
        self.master_mut().hold_switches(Some(if on { FOLLOW } else { 0 }));
    }

    fn take_bit_15_away(&mut self) {
        self.master_mut().hold_switches(Some(control::ENABLE | control::NO_HALT));
    }

    /// In QEMU the handler is held at its first instruction: past the valley behind the middle of the samples.
    fn delay_cycles(&self, cycles: u32) -> Result<(), MatrixError> {
        const LATE: Nanoseconds = Nanoseconds::from_microseconds(32);
        let motor_side = self.drive.motor_side.clone();
        motor_side.borrow_mut().delay_cycles(cycles);
        let Some(elf) = &self.drive.elf else { return Ok(()) };
        let spans = vec![LATE; cycles as usize];
        let held = elf.hold_cycles(&spans, move || motor_side.borrow_mut().delay_cycles(0));
        Ok(held.map_err(|error| ProcessorError::Stuck { address: ADDRESS, cause: error.to_string() })?)
    }

    fn next_cycles(&self) -> u64 {
        self.world.ring().cycle().map_or(2, |cycle| cycle + 2)
    }

    fn add_ring_fault(&mut self, fault: RingFault) {
        self.world.ring_mut().add_fault(fault);
    }

    fn run_to_cycle(&mut self, cycle: u64) -> Result<(), MatrixError> {
        while self.world.ring().cycle().is_none_or(|now| now < cycle) {
            self.run(STEP)?;
        }
        Ok(())
    }
}

fn motion(mode: Mode, state: State, driving: i16) -> Motion {
    let rpm = match state {
        State::AtSpeed | State::Halted | State::Stopping => SPEED,
        State::Off | State::SwitchingOn | State::Standstill => 0,
    };
    Motion::new(1_000_000, move |point| mode.values(rpm, driving, point))
}
