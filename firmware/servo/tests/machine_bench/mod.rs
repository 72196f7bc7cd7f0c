//! The whole servo on the machine: samples and counts in, compare values out, as the tasks of the drive join them, without a ring.
//!
//! ```text
//! peak of the period      currents, bus sampled; 2.2 us later the encoder count; a cycle of the current loop
//! bottom, 31.25 us later  its compare values act
//! every second cycle      position and velocity loop; their order is taken by the next cycle of the current loop
//! every eighth            bus voltage and field weakening, behind the loops
//! ```

pub(crate) mod master;
pub(crate) mod measure;
pub(crate) mod setup;

use plant::Machine;
use servo::arithmetic::Rotation;
use servo::axis::{Axis, AxisOutput, AxisSettings, Limiting, Mode, TorqueLimits};
use servo::commutation::CommutationAngle;
use servo::current::{
    BusScale, CurrentCommand, CurrentLoop, CurrentLoopSettings, FieldWeakening, FieldWeakeningSettings, MotorModel,
    Offsets, Protection, PwmFrequency, SharedCommand, SharedReadings, Trip, WeakeningOutput,
};
use servo::encoder::{TwiceReadEncoder, TwiceReadSettings};
use servo::monitor::{BusVoltage, VoltageSettings};
use servo::units::{CurrentFraction, LOOP_TICKS_PER_SUPERVISION, Position, Velocity};

use setup::Setup;

/// Nanoseconds of a cycle of the current loop.
pub(crate) const CYCLE: u64 = 62_500;
/// Cycles of the current loop in a second, and ticks of the outer loops.
pub(crate) const CYCLES_PER_SECOND: f64 = 16_000.0;
pub(crate) const TICKS_PER_SECOND: f64 = 8_000.0;
/// From the sample of the currents to the count of the encoder, in nanoseconds.
const CONVERSION: u64 = 2_200;
/// The same in 2^-16 of a tick, as the drive knows it.
const SAMPLE_AGE: i64 = (22 << 16) / 1_250;
const RELOAD: u16 = PwmFrequency::Khz16.reload();
/// Cycles with the bridge off in which the current sensors find their zero.
const CALIBRATION: u32 = 1_100;

/// A servo drive on its machine, with the commutation angle known.
pub(crate) struct Bench {
    pub(crate) machine: Machine,
    pub(crate) axis: Axis,
    pub(crate) encoder: TwiceReadEncoder,
    /// Limits of the torque, before field weakening takes its part.
    pub(crate) limits: TorqueLimits,
    /// Instant of the last sample of the currents.
    pub(crate) time: u64,
    /// Why the current loop has switched the bridge off.
    pub(crate) trip: Option<Trip>,
    /// What the motor side stands at: field weakening, voltage.
    pub(crate) limiting: Limiting,
    pub(crate) current_loop: CurrentLoop,
    readings: SharedReadings,
    /// Peak current in A.
    pub(crate) peak: f64,
    current_settings: CurrentLoopSettings,
    protection: Protection,
    offsets: Offsets,
    command: CurrentCommand,
    shared_command: SharedCommand,
    /// Encoder counts of the last two cycles.
    count_before: u32,
    count: u32,
    commutation: CommutationAngle,
    model: Option<MotorModel>,
    pole_pairs: i64,
    angle_per_increment: u32,
    voltage: VoltageSettings,
    bus: BusVoltage,
    bus_scale: BusScale,
    weakening: FieldWeakening,
    weakening_settings: FieldWeakeningSettings,
    weakened: WeakeningOutput,
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
}

impl Bench {
    /// A drive with the bridge on and no current, its axis in [`Mode::Off`]; a holding brake, if there is one, is engaged.
    pub(crate) fn new(setup: &Setup) -> Self {
        let mut machine = setup.reference.machine();
        let settings = *machine.settings();
        let encoder = TwiceReadSettings::new(settings.encoder.increments_per_revolution).unwrap();
        let mut encoder = TwiceReadEncoder::new(encoder, machine.encoder_count(0));
        encoder.set_position(setup.start);
        let bus = BusVoltage::new(&setup.voltage(), machine.bus_sample(0));
        let mut bench = Self {
            axis: Axis::new(AxisSettings::new(&setup.axis).unwrap().measured_a_quarter_tick_ago(), encoder.position()),
            limits: TorqueLimits::symmetrical(CurrentFraction::MAX, Limiting::AMPLIFIER_PEAK),
            time: 0,
            trip: None,
            limiting: Limiting::empty(),
            current_loop: CurrentLoop::new(CurrentLoopSettings::new(&setup.current).unwrap()),
            readings: SharedReadings::new(),
            peak: f64::from(setup.reference.peak_current) / 1_000.0,
            current_settings: CurrentLoopSettings::new(&setup.current).unwrap(),
            protection: setup.protection(),
            offsets: Offsets::default(),
            command: CurrentCommand {
                direct: 0,
                quadrature: 0,
                angle: 0,
                count: 0,
                angle_per_increment: 0,
                ahead: Rotation::NONE,
                direct_voltage: 0,
                quadrature_voltage: 0,
                bus: BusScale::default(),
            },
            shared_command: SharedCommand::new(),
            count: machine.encoder_count(0),
            count_before: machine.encoder_count(0),
            commutation: setup.commutation(encoder.position()),
            model: setup.decoupled.then(|| setup.model()),
            pole_pairs: settings.windings.pole_pairs.into(),
            angle_per_increment: setup.angle_per_increment(),
            voltage: setup.voltage(),
            bus,
            bus_scale: BusScale::default(),
            weakening: FieldWeakening::new(),
            weakening_settings: setup.weakening(),
            weakened: WeakeningOutput {
                direct: CurrentFraction::ZERO,
                quadrature_limit: CurrentFraction::MAX,
                active: false,
            },
            ticks: 0,
            first: true,
            encoder,
            machine,
        };
        bench.calibrate();
        bench
    }

    fn calibrate(&mut self) {
        for _ in 0..CALIBRATION {
            self.time += CYCLE;
            self.offsets.calibrate(self.machine.current_samples(self.time).map(u32::from));
            if self.first {
                self.count = self.machine.encoder_count(self.time + CONVERSION);
                self.count_before = self.count;
                let (output, _) = self.outer_tick();
                self.order(CurrentFraction::ZERO, CurrentFraction::ZERO, output.loop_velocity);
            }
            self.first = !self.first;
        }
        assert!(self.offsets.is_calibrated() && self.first);
        self.machine.set_bridge(true, self.time + CYCLE / 2);
    }

    /// A tick of the outer loops: two cycles of the current loop, and the orders of the axis.
    pub(crate) fn tick(&mut self) -> Seen {
        self.cycle();
        let (output, direct) = self.outer_tick();
        let seen = self.seen(output);
        self.order(direct, output.current, output.loop_velocity);
        self.cycle();
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
    pub(crate) fn current_cycle(&mut self, [direct, quadrature]: [f64; 2]) -> [f64; 2] {
        let share = |value: f64| (value * f64::from(1 << 26)).round() as i32;
        self.command.direct = share(direct);
        self.command.quadrature = share(quadrature);
        self.cycle();
        let flowing = self.currents();
        if !self.first {
            let (output, _) = self.outer_tick();
            let fraction = |value: f64| CurrentFraction::saturating_from_num(value);
            self.order(fraction(direct), fraction(quadrature), output.loop_velocity);
        }
        flowing
    }

    /// Cycles of the current loop with one reference; gives the currents at their samples.
    pub(crate) fn current_cycles(&mut self, reference: [f64; 2], number: usize) -> Vec<[f64; 2]> {
        (0..number).map(|_| self.current_cycle(reference)).collect()
    }

    /// Opens the bridge for so many cycles and closes it again, with a current loop that knows nothing of before.
    pub(crate) fn coast(&mut self, cycles: usize) {
        self.machine.set_bridge(false, self.time + CYCLE / 2);
        self.current_cycles([0.0; 2], cycles);
        self.current_loop = CurrentLoop::new(self.current_settings);
        self.machine.set_bridge(true, self.time + CYCLE / 2);
    }

    /// Believes the sensors to be without offset, whatever they are.
    pub(crate) fn forget_offsets(&mut self) {
        self.offsets = Offsets::default();
    }

    /// Lets the axis follow a mode after it has seen where it is.
    pub(crate) fn start(&mut self, mode: Mode) {
        self.ticks(8);
        self.axis.set_mode(mode);
    }

    /// d and q current at the last sample as shares of the peak current.
    pub(crate) fn currents(&mut self) -> [f64; 2] {
        let peak = self.peak;
        self.machine.dq_currents(self.time).map(|current| current / peak)
    }

    /// One cycle of the current loop, from peak to peak.
    fn cycle(&mut self) {
        self.time += CYCLE;
        let samples = self.machine.current_samples(self.time).map(u32::from);
        let bus = self.machine.bus_sample(self.time);
        let count = self.machine.encoder_count(self.time + CONVERSION);
        let moved = count.wrapping_sub(self.count).cast_signed();
        self.count_before = std::mem::replace(&mut self.count, count);
        self.first = !self.first;
        let currents = self.offsets.remove(samples);
        self.shared_command.set(&self.command);
        self.readings.set_phases(currents);
        self.readings.set_angle(self.shared_command.angle_at(count));
        self.trip = self.trip.or_else(|| self.protection.check(currents, bus.into(), moved));
        if self.trip.is_some() {
            self.machine.set_bridge(false, self.time + CONVERSION);
            return;
        }
        let counts = self.current_loop.cycle(&self.shared_command, &self.readings);
        let duties = counts.map(|count| f64::from(count) / f64::from(RELOAD));
        self.machine.set_duties(duties, self.time + CYCLE / 2);
    }

    /// Bus and field weakening.
    fn supervise(&mut self) {
        self.axis.follow_ranges();
        let sample = self.machine.bus_sample(self.time);
        let bus = self.bus.tick(&self.voltage, sample);
        self.bus_scale = BusScale::new(bus.voltage.to_bits() >> 2, bus.reciprocal.of_fine_volts(), RELOAD);
        self.weakened = self.weakening.tick(&self.weakening_settings, &self.readings.readings(), &self.bus_scale);
        self.limiting.set(Limiting::FIELD_WEAKENING, self.weakened.active);
    }

    /// The loops, and behind them the supervision, when it is its turn; gives what the axis wants and the flux-producing current that
    /// weakens the field.
    fn outer_tick(&mut self) -> (AxisOutput, CurrentFraction) {
        let weakened = self.weakened;
        let limits = if weakened.active {
            self.limits.narrowed(weakened.quadrature_limit, Limiting::FIELD_WEAKENING)
        } else {
            self.limits
        };
        let measured = self.encoder.update(self.count_before, self.count);
        let output = self.axis.tick(measured, &limits);
        self.ticks += 1;
        if self.ticks.is_multiple_of(LOOP_TICKS_PER_SUPERVISION) {
            self.supervise();
        }
        (output, weakened.direct)
    }

    /// The order to the current loop, as the motor side of the drive makes it.
    fn order(&mut self, direct: CurrentFraction, quadrature: CurrentFraction, velocity: Velocity) {
        let speed = ((i64::from(velocity.to_bits()) * self.pole_pairs) >> 4) as i32;
        let aged = ((i64::from(speed) * SAMPLE_AGE) >> 16) as i32;
        let (direct_voltage, quadrature_voltage) =
            self.model.map_or((0, 0), |model| model.induced(speed, direct, quadrature));
        self.command = CurrentCommand {
            direct: CurrentCommand::reference(direct),
            quadrature: CurrentCommand::reference(quadrature),
            // From the middle between the two counts to the second, and back to the sample.
            angle: self.commutation.at(self.encoder.position()).wrapping_add(((speed >> 2) - aged).cast_unsigned()),
            count: self.count,
            angle_per_increment: self.angle_per_increment,
            ahead: Rotation::by((speed / i32::from(PwmFrequency::Khz16.cycles_per_tick())).cast_unsigned()),
            direct_voltage,
            quadrature_voltage,
            bus: self.bus_scale,
        };
    }

    fn seen(&mut self, output: AxisOutput) -> Seen {
        let at = self.time;
        let readings = &self.readings.readings();
        let length = f64::from(readings.direct_voltage).hypot(f64::from(readings.quadrature_voltage));
        Seen {
            output,
            voltage: length / f64::from(self.bus_scale.longest()),
            velocity: self.machine.velocity(at),
            angle: self.machine.angle(at),
            current: self.currents(),
            torque: self.machine.torque(at),
            bus: self.machine.bus_voltage(at),
            limiting: output.limiting | self.limiting,
        }
    }
}
