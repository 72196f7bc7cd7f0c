//! The whole servo on the machine: the axis, the motor side and the task of the current loop, as they are flashed, joined as the tasks of the
//! drive join them, without a ring.
//!
//! ```text
//! peak of the period      currents, bus sampled; 2.2 us later the encoder count; a cycle of the current loop
//! bottom, 31.25 us later  its compare values act
//! every second cycle      position and velocity loop; their order is taken by the next cycle of the current loop
//! half a tick later       the velocity loop once more
//! every eighth            the supervision of the motor side, behind the loops
//! ```

pub(crate) mod master;
pub(crate) mod measure;
pub(crate) mod setup;
mod stage;

use std::cell::RefMut;

use plant::Machine;
use servo::axis::{Axis, AxisOutput, AxisSettings, CommandedTorqueLimits, Limiting, Mode};
use servo::current::Trip;
use servo::encoder::{DoubleSampledEncoder, DoubleSampledSettings};
use servo::identification::CurrentRequest;
use servo::motor::{
    BoardKind, CurrentControl, CurrentLink, Motor, MotorFaults, Sequence, SequenceInputs, SequenceOutput, Surroundings,
    Watched,
};
use servo::units::{CurrentFraction, LOOP_TICKS_PER_SUPERVISION, Position, Velocity};

use setup::Setup;
use stage::Stage;
pub(crate) use stage::{Kind, OnShunts};

/// Nanoseconds of a cycle of the current loop.
pub(crate) const CYCLE: u64 = 62_500;
/// Cycles of the current loop in a second, and ticks of the outer loops.
pub(crate) const CYCLES_PER_SECOND: f64 = 16_000.0;
pub(crate) const TICKS_PER_SECOND: f64 = 8_000.0;
/// Ticks with the bridge off in which the current sensors find their zero, and those until the drive has switched on.
const CALIBRATION: usize = 664;
const SWITCHING_ON: usize = 50;
/// Further ticks that a slow current loop may take for the test of the phases.
const LONGEST_TEST: usize = 3_000;

/// A servo drive on its machine, with the commutation angle known.
pub(crate) struct Bench<B: BoardKind = Kind> {
    pub(crate) axis: Axis,
    pub(crate) encoder: DoubleSampledEncoder,
    /// Instant of the last sample of the currents.
    pub(crate) time: u64,
    /// Why the current loop has switched the bridge off.
    pub(crate) trip: Option<Trip>,
    /// What the motor side has found since the start.
    pub(crate) faults: MotorFaults,
    /// Peak current in A.
    pub(crate) peak: f64,
    stage: Stage<B>,
    link: &'static CurrentLink,
    task: CurrentControl<Stage<B>>,
    motor: Motor<B>,
    setup: Setup,
    /// What is wanted of the sequence, and how far it is.
    wanted: Sequence,
    progress: SequenceOutput,
    /// Of the last tick.
    output: AxisOutput,
    /// At the last look of the supervision.
    deviates: bool,
    /// Loop ticks since the start.
    ticks: u32,
    /// The next cycle is the first of a tick.
    first: bool,
}

/// What a tick gave, and what was true at its sample.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Seen {
    pub(crate) output: AxisOutput,
    /// Of the motor, in rad/s.
    pub(crate) velocity: f64,
    /// Of the motor since the start, in revolutions.
    pub(crate) angle: f64,
    /// d and q current as shares of the peak current.
    pub(crate) current: [f64; 2],
    /// Of the motor in Nm.
    pub(crate) torque: f64,
    /// In V.
    pub(crate) bus: f64,
    /// Length of the voltage vector as a share of the longest one.
    pub(crate) voltage: f64,
    pub(crate) limiting: Limiting,
    /// The following error was outside of its window at the last look.
    pub(crate) deviates: bool,
}

impl Bench {
    /// As [`Bench::on_board`], with current sensors in the lines.
    pub(crate) fn new(setup: &Setup) -> Self {
        Self::on_board(setup)
    }
}

impl<B: BoardKind> Bench<B> {
    /// A drive with the bridge on and no current, its axis in [`Mode::Off`]; a holding brake, if there is one, is engaged.
    pub(crate) fn on_board(setup: &Setup) -> Self {
        let stage = Stage::new(setup.reference.machine());
        let settings = *stage.machine().settings();
        let encoder = DoubleSampledSettings::new(settings.encoder.increments_per_revolution).unwrap();
        let mut encoder = DoubleSampledEncoder::new(encoder, stage.machine().encoder_count(0));
        encoder.set_position(setup.start);
        let position = encoder.position();
        // As in the firmware it lives as long as the drive.
        let link: &'static CurrentLink = Box::leak(Box::new(CurrentLink::new()));
        let motor_settings = setup.motor();
        let task = CurrentControl::new(stage.clone(), link, motor_settings.current);
        let mut bench = Self {
            axis: Axis::new(AxisSettings::new(&setup.axis).unwrap().with_setpoint_ahead(31_250), position),
            encoder,
            time: 0,
            trip: None,
            faults: MotorFaults::NONE,
            peak: f64::from(setup.reference.peak_current) / 1_000.0,
            stage,
            link,
            task,
            motor: Motor::new(link, motor_settings),
            setup: *setup,
            wanted: Sequence::Off,
            progress: SequenceOutput::default(),
            deviates: false,
            output: AxisOutput::at_rest(position),
            ticks: 0,
            first: true,
        };
        bench.motor.apply_settings(&motor_settings, false);
        bench.motor.set_commutation_angle(position, Some(setup.electrical_angle()));
        bench.ticks(CALIBRATION);
        assert!(bench.motor.measured().calibrated && bench.first);
        bench.wanted = Sequence::Start;
        bench.ticks(SWITCHING_ON);
        // A slow current loop takes its time.
        for _ in 0..LONGEST_TEST {
            if bench.progress.released || !bench.faults.is_empty() {
                break;
            }
            bench.tick();
        }
        assert!(bench.progress.released, "the drive does not switch on: {:?}", bench.faults);
        bench
    }

    /// The machine, as it stands at [`Bench::time`].
    pub(crate) fn machine(&self) -> RefMut<'_, Machine> {
        self.stage.machine()
    }

    /// Limits of the control in place of the amplifier's own, in shares of peak; the negative one below zero.
    pub(crate) fn limit_torque(&mut self, positive: f64, negative: f64, bipolar: f64) {
        let fraction = |value: f64| CurrentFraction::saturating_from_num(value);
        self.motor.limit_torque(Some(&CommandedTorqueLimits {
            positive: fraction(positive),
            negative: fraction(negative),
            bipolar: fraction(bipolar),
            reversed: false,
        }));
    }

    /// Loads, voltage and warnings as the supervision last saw them.
    pub(crate) fn watched(&self) -> &Watched {
        self.motor.watched()
    }

    /// A tick of the outer loops: two cycles of the current loop, and the orders of the axis.
    pub(crate) fn tick(&mut self) -> Seen {
        assert!(self.first);
        self.cycle();
        self.loops();
        self.command(self.output.current);
        self.supervision();
        let seen = self.seen();
        self.cycle();
        self.half_loops();
        seen
    }

    pub(crate) fn ticks(&mut self, number: usize) -> Vec<Seen> {
        (0..number).map(|_| self.tick()).collect()
    }

    /// Ticks of a time in seconds.
    pub(crate) fn run(&mut self, seconds: f64) -> Vec<Seen> {
        self.ticks((seconds * TICKS_PER_SECOND).round() as usize)
    }

    /// A control unit cycle without command.
    pub(crate) fn cycle_of_ticks(&mut self) -> Vec<Seen> {
        self.ticks(usize::from(self.axis.settings().interpolator().ticks_per_cycle()))
    }

    /// A control unit cycle that begins with a position command.
    pub(crate) fn position_cycle(&mut self, command: Position) -> Vec<Seen> {
        self.axis.command_position(command).unwrap();
        self.cycle_of_ticks()
    }

    /// A control unit cycle that begins with a velocity command.
    pub(crate) fn velocity_cycle(&mut self, command: Velocity) -> Vec<Seen> {
        self.axis.command_velocity(command);
        self.cycle_of_ticks()
    }

    /// A cycle of the current loop alone that takes these currents as its reference, in shares of peak; gives what flowed at its sample.
    ///
    /// A current along the magnet is given at the angle of this moment: to a shaft that is held fast.
    pub(crate) fn current_cycle(&mut self, [direct, quadrature]: [f64; 2]) -> [f64; 2] {
        let fraction = |value: f64| CurrentFraction::saturating_from_num(value);
        let angle = self.motor.commutation_angle(self.encoder.position());
        self.motor.hold(angle.filter(|_| direct != 0.0).map(|angle| {
            (
                angle,
                CurrentRequest {
                    direct: fraction(direct),
                    quadrature: fraction(quadrature),
                    direct_voltage: 0,
                    quadrature_voltage: 0,
                },
            )
        }));
        self.command(fraction(quadrature));
        let begins = self.first;
        self.cycle();
        let flowing = self.currents();
        if begins {
            self.loops();
            self.command(fraction(quadrature));
            self.supervision();
        }
        flowing
    }

    /// Cycles of the current loop with one reference; gives the currents at their samples.
    pub(crate) fn current_cycles(&mut self, reference: [f64; 2], number: usize) -> Vec<[f64; 2]> {
        (0..number).map(|_| self.current_cycle(reference)).collect()
    }

    /// Opens the bridge for so many ticks and closes it again, with a current loop that knows nothing of before.
    pub(crate) fn coast(&mut self, ticks: usize) {
        self.open(ticks);
        self.close();
    }

    /// Opens the bridge for so many ticks.
    pub(crate) fn open(&mut self, ticks: usize) {
        self.wanted = Sequence::Off;
        self.ticks(ticks);
    }

    /// Closes it again.
    pub(crate) fn close(&mut self) {
        self.wanted = Sequence::Start;
        while !self.stage.bridge_is_on() {
            self.tick();
        }
    }

    /// Opens the bridge, forgets the commutation angle if it is told to, and switches on again. Seconds until the axis is released, or a fault.
    pub(crate) fn switch_on_again(&mut self, forget: bool) -> Result<f64, (f64, MotorFaults)> {
        self.open(16);
        if forget {
            self.motor.set_commutation_angle(self.encoder.position(), None);
        }
        self.wanted = Sequence::Start;
        for tick in 1..=16_000 {
            self.tick();
            let seconds = f64::from(tick) / TICKS_PER_SECOND;
            if !self.faults.is_empty() {
                return Err((seconds, self.faults));
            }
            if self.progress.released {
                return Ok(seconds);
            }
        }
        panic!("the drive neither switches on nor says why");
    }

    /// Believes the sensors to be without offset, whatever they are.
    pub(crate) fn forget_offsets(&mut self) {
        self.task = CurrentControl::new(self.stage.clone(), self.link, self.setup.motor().current);
        self.stage.reset();
    }

    /// Lets the axis follow a mode after it has seen where it is.
    pub(crate) fn start(&mut self, mode: Mode) {
        self.ticks(8);
        self.axis.set_mode(mode);
    }

    /// Of the motor since the start, in revolutions.
    pub(crate) fn seen_angle(&self) -> f64 {
        let at = self.time;
        self.machine().angle(at)
    }

    /// d and q current at the last sample as shares of the peak current.
    pub(crate) fn currents(&self) -> [f64; 2] {
        let (peak, at) = (self.peak, self.time);
        self.machine().dq_currents(at).map(|current| current / peak)
    }

    /// One cycle of the current loop, from peak to peak.
    fn cycle(&mut self) {
        self.time += CYCLE;
        self.stage.sample_at(self.time);
        assert_eq!(self.task.current_loop(), self.first);
        self.first = !self.first;
        self.motor.measure();
        self.trip = self.trip.or(self.motor.measured().trip);
    }

    /// What a loop tick does before its order: encoder, position and velocity loop.
    fn loops(&mut self) {
        let [before, now] = self.motor.take_counts();
        let position = self.encoder.update(before, now);
        if let Some(faults) = self.motor.watch_motion(now, self.progress.bridge) {
            self.faults.add_all(faults);
        }
        if self.motor.is_searching() && self.stage.bridge_is_on() {
            self.motor.search(position);
        }
        let latest = self.encoder.velocity(before, now);
        self.output = self.axis.tick(position, latest, self.motor.torque_limits());
        self.ticks += 1;
    }

    /// Half a tick later: the velocity loop once more, and its correction of the order.
    fn half_loops(&mut self) {
        let [before, now] = self.motor.half_counts();
        let latest = self.encoder.velocity(before, now);
        if let Some(current) = self.axis.half_tick(latest, self.motor.torque_limits()) {
            self.motor.correct(current);
        }
    }

    /// The order to the current loop.
    fn command(&mut self, current: CurrentFraction) {
        self.motor.command(self.encoder.position(), current, self.output.loop_velocity, 0);
    }

    /// Every fourth tick: the motor side, and the sequence of switching on and off.
    fn supervision(&mut self) {
        if !self.ticks.is_multiple_of(LOOP_TICKS_PER_SUPERVISION) {
            return;
        }
        self.deviates = self.axis.supervise();
        let count = self.motor.count();
        let torque = self.progress.bridge;
        let mut faults = self.motor.supervise(&Surroundings { torque, count, index: None });
        faults.add_all(self.motor.supervise_heat());
        let bridge_on = self.stage.bridge_is_on();
        self.progress = self.motor.sequence(
            &SequenceInputs {
                wanted: self.wanted,
                bridge_on,
                standstill: self.output.standstill,
                position: self.encoder.position(),
                torque_command: self.output.current,
                brake_contact: false,
                blocked: false,
                index: None,
            },
            &mut faults,
        );
        self.faults.add_all(faults);
        self.stage.set_bridge(self.progress.bridge);
    }

    fn seen(&self) -> Seen {
        let (at, output) = (self.time, self.output);
        let readings = self.motor.measured().readings;
        let length = f64::from(readings.direct_voltage).hypot(f64::from(readings.quadrature_voltage));
        let current = self.currents();
        let longest = f64::from(self.motor.longest_voltage());
        let limiting = output.limiting | self.motor.limiting();
        let mut machine = self.machine();
        Seen {
            output,
            voltage: length / longest,
            velocity: machine.velocity(at),
            angle: machine.angle(at),
            current,
            torque: machine.torque(at),
            bus: machine.bus_voltage(at),
            limiting,
            deviates: self.deviates,
        }
    }
}
