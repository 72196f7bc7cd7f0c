//! The motor side below the velocity loop: what comes up from the current loop, what goes down to it, and everything that stands guard
//! over bridge, motor, encoder and brake.
//!
//! A loop tick calls [`Motor::measure`] and [`Motor::watch_motion`], then the loops with [`Motor::torque_limits`], and [`Motor::command`]
//! last; the supervision calls [`Motor::supervise`] and [`Motor::sequence`].

pub(crate) mod current_task;
pub(crate) mod cycle_values;
#[cfg(test)]
mod example;
pub(crate) mod facts;
pub(crate) mod fault;
pub(crate) mod link;
pub(crate) mod monitoring;
pub(crate) mod phase_test;
pub(crate) mod sequence;
pub(crate) mod settings;
pub(crate) mod stage;
pub(crate) mod watched;

pub use current_task::CurrentControl;
pub use cycle_values::CurrentLoopValues;
pub use facts::{BoardKind, Facts};
pub use fault::{FaultReaction, MotorFault, MotorFaults};
pub use link::CurrentLink;
pub use monitoring::Surroundings;
pub use sequence::{CALIBRATION_TICKS, Sequence, SequenceInputs, SequenceOutput};
pub use settings::{CurrentSettings, MotorSettings};
pub use stage::{Cycle, PowerStage, Samples};
pub use watched::Watched;

use core::marker::PhantomData;

use link::{CycleReport, get};
use phase_test::PhaseTest;

use crate::arithmetic::trigonometry::Rotation;
use crate::axis::limits::{CommandedTorqueLimits, Limiting, TorqueLimitSettings, TorqueLimits};
use crate::brake::{BrakeInputs, BrakeOutput, BrakeRequest, BrakeSequencer};
use crate::commutation::CommutationAngle;
use crate::commutation::alignment::{Alignment, AlignmentError};
use crate::commutation::index::IndexCorrection;
use crate::current::command::{BusScale, CurrentCommand};
use crate::current::protection::Trip;
use crate::current::readings::CurrentReadings;
use crate::current::weakening::FieldWeakening;
use crate::encoder::jump::EncoderMotion;
use crate::encoder::monitor::EncoderMonitor;
use crate::identification::CurrentRequest;
use crate::monitor::bus_voltage::{BusVoltage, VoltageOutput};
use crate::monitor::chopper::Chopper;
use crate::monitor::current_balance::CurrentBalance;
use crate::monitor::load::LoadModel;
use crate::monitor::open_phase::{OpenPhase, Phases};
use crate::monitor::temperature::Temperature;
use crate::units::{CurrentFraction, Position, Velocity};

/// What the current loop reported at the beginning of a tick.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Measured {
    /// Torque-producing current.
    pub torque_current: CurrentFraction,
    /// Flux-producing current.
    pub field_current: CurrentFraction,
    /// Currents and voltages of the d and q axis, of the cycle that began the tick.
    pub readings: CurrentReadings,
    /// Bus voltage in counts.
    pub bus: u16,
    /// The zero of the current sensors is known.
    pub calibrated: bool,
    /// Why the current loop has switched the bridge off.
    pub trip: Option<Trip>,
    /// Cycles of the current loop that came too late, since the start.
    pub late: u32,
}

/// State of the motor side.
///
/// Laid out as declared: what every loop tick touches comes first, where an instruction reaches it without an address of its own.
#[repr(C)]
#[derive(Debug)]
pub struct Motor<B: BoardKind> {
    link: &'static CurrentLink,
    /// The current loop is ordered to regulate, and the bridge follows a step later.
    bridge_on: bool,
    /// The bridge was told to be closed at the last step of the sequence.
    told: bool,
    /// And was, or was told so for the first time.
    closed: bool,
    /// Of positive current in counts, 1 or -1.
    direction: u32,
    /// Currents and angle that the alignment asks for.
    aligning: Option<(u32, CurrentFraction, CurrentFraction)>,
    /// The angle that an identification holds, and what it asks for there.
    held: Option<(u32, CurrentRequest)>,
    /// Ticks of the supervision until the voltages of an order that was held have died away.
    disturbed: u8,
    commutation: Option<CommutationAngle>,
    brake_output: BrakeOutput,
    /// Flux-producing current that weakens the field.
    weakened: CurrentFraction,
    bus_scale: BusScale,
    limits: TorqueLimits,
    /// Flux-producing current of the order in force.
    direct_command: CurrentFraction,
    /// Torque-producing current of the last order, and the voltage that the rotation induces, volt 2^-14.
    commanded: CurrentFraction,
    induced: i32,
    /// Sample of the bus voltage above which the current that feeds the link is limited.
    generating_from: u16,
    /// Sample of the bus voltage in the tick before.
    bus_before: u16,
    /// What of a current may feed the DC link in this tick, where that is limited.
    may_feed: Option<CurrentFraction>,
    /// Electrical angle of one increment as the encoder counts it, 2^-32 revolution.
    angle_per_increment: u32,
    /// Encoder count of the tick.
    count: u32,
    encoder_motion: EncoderMotion,
    alignment: Option<Alignment>,
    /// `Report::changes` as last seen.
    changes_seen: u32,
    voltage: BusVoltage,
    bus: VoltageOutput,
    chopper: Chopper,
    chopper_works: bool,
    /// Ticks of the supervision for which [`Watched::link_full`] goes on.
    link_full: u16,
    heat_sink: Temperature,
    winding: Temperature,
    motor_load: LoadModel,
    amplifier_load: LoadModel,
    encoder: EncoderMonitor,
    /// Why the search for the commutation angle has failed, until the sequence has taken it.
    alignment_error: Option<AlignmentError>,
    index: IndexCorrection,
    index_armed: bool,
    brake: BrakeSequencer,
    /// Ticks of the supervision for which the current has not followed.
    blind: u16,
    /// What was asked of the phases meanwhile, and what flowed.
    seen_blind: [Phases; 2],
    balance: CurrentBalance,
    open_phase: OpenPhase,
    phase_test: PhaseTest,
    /// Time constant of the current loop, in us, where the motor is known.
    loop_time: Option<u32>,
    /// Its current was asked for in the last step.
    tested: bool,
    /// Ticks of the supervision for which switching on has waited for the zero of the current sensors.
    uncalibrated: u16,
    weakening: FieldWeakening,
    /// Limits of the torque before the thermal models and the field weakening: those of the settings, or of the MDT.
    torque_limits: TorqueLimitSettings,
    /// What the field weakening leaves for the torque.
    weakening_limit: Option<CurrentFraction>,
    /// The voltage was at its limit at the last look.
    saturated: bool,
    /// What the voltage leaves for the torque, on the side of its sign.
    within_reach: Option<CurrentFraction>,
    limiting: Limiting,
    watched: Watched,
    measured: Measured,
    settings: MotorSettings,
    board: PhantomData<fn() -> B>,
}

/// The bus voltage a millisecond ahead, if it goes on rising as in the last tick: a current at the limit of the voltage takes longer than that to
/// fall, and a small link is full by then.
#[inline]
fn foreseen(before: u16, now: u16) -> u16 {
    now.saturating_add(now.saturating_sub(before) << 3)
}

/// Whatever the voltage of the link, nothing may feed it.
const HANDS_OVER: u16 = 0;

/// A link that was full is told of for so long, 100 ms: a control that asks once in a while shall see it.
const LINK_FULL_TICKS: u16 = 200;

/// From the sample of the currents to the reading of the encoder, in 2^-16 of a tick: 1.9 us of conversion and 0.3 us to the handler.
const SAMPLE_AGE: i64 = (22 << 16) / 1_250;

impl<B: BoardKind> Motor<B> {
    const CYCLES_IN_A_TICK: i32 = B::FACTS.frequency.cycles_per_tick() as i32;

    /// A motor side at rest.
    pub fn new(link: &'static CurrentLink, settings: MotorSettings) -> Self {
        let mut voltage = BusVoltage::new(&settings.voltage, 0);
        let bus = voltage.tick(&settings.voltage, 0);
        let count = get(&link.report.cycle(true).count);
        let mut brake = BrakeSequencer::new();
        let brake_output = at_rest(&mut brake, &settings);
        link.settings.send(|shared| shared.set(&settings.current));
        let angle_per_increment = settings.angle_per_increment;
        Self {
            link,
            settings,
            count,
            measured: Measured::default(),
            changes_seen: 0,
            voltage,
            bus,
            heat_sink: Temperature::new(),
            winding: Temperature::new(),
            motor_load: LoadModel::new(),
            amplifier_load: LoadModel::new(),
            encoder: EncoderMonitor::new(count),
            encoder_motion: EncoderMotion::new(count),
            commutation: None,
            alignment: None,
            alignment_error: None,
            index: IndexCorrection::start(settings.index_angle),
            index_armed: false,
            brake,
            brake_output,
            held: None,
            disturbed: 0,
            direct_command: CurrentFraction::ZERO,
            aligning: None,
            commanded: CurrentFraction::ZERO,
            induced: 0,
            generating_from: settings.generating.begin(false),
            bus_before: 0,
            may_feed: None,
            chopper: Chopper::new(),
            chopper_works: false,
            link_full: 0,
            blind: 0,
            seen_blind: [Phases::default(); 2],
            balance: CurrentBalance::default(),
            open_phase: OpenPhase::default(),
            phase_test: PhaseTest::default(),
            loop_time: settings.model.loop_time(&settings.current.current_loop),
            tested: false,
            uncalibrated: 0,
            weakening: FieldWeakening::new(),
            weakened: CurrentFraction::ZERO,
            bus_scale: BusScale::default(),
            limits: TorqueLimits::symmetrical(CurrentFraction::ZERO, Limiting::AMPLIFIER_PEAK),
            torque_limits: settings.torque_limits,
            weakening_limit: None,
            saturated: false,
            within_reach: None,
            limiting: Limiting::empty(),
            watched: Watched::default(),
            bridge_on: false,
            told: false,
            closed: false,
            direction: 1,
            angle_per_increment,
            board: PhantomData,
        }
    }

    /// Takes new settings over. Another number of pole pairs or increments, or another direction of the encoder, makes the commutation angle
    /// unknown again, and another sensor begins a measurement of its own.
    pub fn apply_settings(&mut self, settings: &MotorSettings, encoder_reversed: bool) {
        let direction = if encoder_reversed { u32::MAX } else { 1 };
        if settings.commutation != self.settings.commutation || direction != self.direction {
            self.commutation = None;
            self.encoder = EncoderMonitor::new(self.count);
            self.encoder_motion = EncoderMotion::new(self.count);
        }
        if settings.index_angle != self.settings.index_angle {
            self.index = IndexCorrection::start(settings.index_angle);
            self.index_armed = false;
        }
        if settings.current != self.settings.current {
            self.link.settings.send(|shared| shared.set(&settings.current));
        }
        if !settings.winding.has_sensor_of(&self.settings.winding) {
            self.winding = Temperature::new();
        }
        self.direction = direction;
        self.angle_per_increment = settings.angle_per_increment.wrapping_mul(direction);
        self.loop_time = settings.model.loop_time(&settings.current.current_loop);
        self.settings = *settings;
        self.limit_torque(None);
    }

    /// Settings in force.
    pub const fn settings(&self) -> &MotorSettings {
        &self.settings
    }

    /// Limits of the control in place of S-0-0082, S-0-0083 and S-0-0092, or these again. They act from the next tick on.
    pub fn limit_torque(&mut self, commanded: Option<&CommandedTorqueLimits>) {
        let stored = self.settings.torque_limits;
        self.torque_limits = commanded.map_or(stored, |commanded| stored.with_commanded(commanded));
        self.combine_limits();
    }

    fn combine_limits(&mut self) {
        let [motor, amplifier] = self.watched.allowed;
        self.limits = self.torque_limits.combine(motor, amplifier);
        if let Some(limit) = self.weakening_limit {
            self.limits = self.limits.narrowed(limit, Limiting::FIELD_WEAKENING);
        }
        if let Some(reach) = self.within_reach {
            self.limits = self.limits.narrowed_on_one_side(reach, Limiting::VOLTAGE);
        }
        if let Some(allowed) = self.may_feed {
            self.limits = self.limits.narrowed_against(self.induced > 0, allowed, Limiting::VOLTAGE);
        }
    }

    /// The encoder counts half a tick before this tick, and with which it began. At 8 kHz there is only the second. Once a tick, before the loops:
    /// what the DC link leaves of their torque is looked at as well.
    #[inline]
    pub fn take_counts(&mut self) -> [u32; 2] {
        let first = self.link.report.cycle(true);
        let bus = (get(&first.bus) & 0xFFFF) as u16;
        let foreseen = foreseen(core::mem::replace(&mut self.bus_before, bus), bus);
        self.may_feed = None;
        if foreseen > self.generating_from {
            self.limit_generating(if self.chopper_works { bus } else { foreseen });
        }
        self.count = get(&first.count);
        [if B::FACTS.reads_the_encoder_twice() { get(&first.count_before) } else { self.count }, self.count]
    }

    /// The encoder counts with which the tick began, and half a tick later.
    #[inline]
    pub fn half_counts(&self) -> [u32; 2] {
        let second = self.link.report.cycle(false);
        [get(&second.count_before), get(&second.count)]
    }

    /// What a count is multiplied with to count in the direction of positive current.
    #[inline]
    pub const fn direction(&self) -> u32 {
        self.direction
    }

    /// The encoder count with which the last tick began.
    pub const fn count(&self) -> u32 {
        self.count
    }

    /// What the current loop has to tell of the cycle that began this tick.
    pub fn measure(&mut self) {
        let report = &self.link.report;
        let first = report.cycle(true);
        let measured = &mut self.measured;
        let readings = first.readings.readings();
        measured.readings = readings;
        measured.torque_current = CurrentReadings::fraction(readings.quadrature);
        measured.field_current = CurrentReadings::fraction(readings.direct);
        measured.bus = (get(&first.bus) & 0xFFFF) as u16;
        let changes = report.changes();
        if changes != self.changes_seen {
            self.changes_seen = changes;
            measured.calibrated = get(&report.calibrated) != 0;
            measured.trip = Trip::from_code(get(&report.trip));
            measured.late = get(&report.late);
        }
    }

    /// The DC link is nearly full: less may flow into it, and what the torque needs for the other direction is left alone.
    #[cold]
    #[inline(never)]
    fn limit_generating(&mut self, bus: u16) {
        let bus = if self.generating_from == HANDS_OVER { u16::MAX } else { bus };
        self.may_feed = self.settings.generating.allowed(bus, self.induced, self.chopper_works);
        self.combine_limits();
        if self.may_feed.is_some()
            && self.limits.met_by(self.commanded) == Limiting::VOLTAGE
            && (self.commanded.to_bits() > 0) != (self.induced > 0)
        {
            self.link_full = LINK_FULL_TICKS;
        }
    }

    /// What was last measured.
    #[inline]
    pub const fn measured(&self) -> &Measured {
        &self.measured
    }

    /// Limits of the torque.
    #[inline]
    pub const fn torque_limits(&self) -> &TorqueLimits {
        &self.limits
    }

    /// The current that carries the load of an axis whose brake is open, smoothed over 8 ms.
    pub fn carried_load(&self) -> CurrentFraction {
        self.brake.load()
    }

    /// What limits the motor side, apart from the loops.
    pub const fn limiting(&self) -> Limiting {
        self.limiting
    }

    /// Temperatures, loads and voltage as last looked at.
    pub const fn watched(&self) -> &Watched {
        &self.watched
    }

    /// The commutation angle is known and the loops may use torque.
    #[inline]
    pub const fn commutates(&self) -> bool {
        self.commutation.is_some() && self.aligning.is_none()
    }

    /// The electrical angle of a position, in 2^-32 revolution, if it is known.
    pub fn commutation_angle(&self, position: Position) -> Option<u32> {
        self.commutation.as_ref().map(|commutation| commutation.at(position))
    }

    /// Gives the electrical angle of a position (P-0-0118), or takes it away.
    pub fn set_commutation_angle(&mut self, position: Position, angle: Option<u32>) {
        self.commutation = angle.map(|angle| CommutationAngle::new(self.settings.commutation, position, angle));
        self.index_armed = angle.is_some();
    }

    /// Moves the zero of the position without a movement.
    pub fn shift(&mut self, difference: Position) {
        if let Some(commutation) = &mut self.commutation {
            commutation.shift(difference);
        }
        if let Some(alignment) = &mut self.alignment {
            alignment.shift(difference);
        }
        self.brake.shift(difference);
    }

    /// Sends the current loop its order for this tick: the current that the loops want, at the velocity that they measured.
    ///
    /// The compiler knows where the drive lies, and reaches what is far from its beginning in two instructions; of a pointer that it knows
    /// nothing about it makes one. [`Motor::measure`] does the same.
    #[inline]
    pub fn command(&mut self, position: Position, current: CurrentFraction, velocity: Velocity, trim: i16) {
        // 2^-32 of an electrical revolution a tick, 64 of them at most too low. Beyond half a revolution nothing commutates any more, and the
        // overspeed has long been found.
        let speed = (velocity.to_bits() >> 4).wrapping_mul(self.settings.pole_pairs);
        let (None, None, Some(commutation)) = (&self.aligning, &self.held, &self.commutation) else {
            return self.command_without_the_loops(speed, trim);
        };
        let quadrature = self.granted(current);
        let direct = self.brake_output.test_current.saturating_add(self.weakened);
        let voltages = self.settings.model.induced(speed, direct, quadrature);
        // The position belongs to the middle between the two counts of the tick, the order to the second.
        let turned = if B::FACTS.reads_the_encoder_twice() { speed >> 2 } else { 0 };
        let angle = commutation.at(position).wrapping_add(turned.cast_unsigned());
        self.send(&Wanted { angle, turning: self.angle_per_increment, speed, direct, quadrature, voltages }, trim);
    }

    /// Half a tick later: the current of the order in force is another one. It is one word, and the current loop finds the one or the other.
    #[inline]
    pub fn correct(&mut self, current: CurrentFraction) {
        if let (None, None, Some(_)) = (&self.aligning, &self.held, &self.commutation) {
            let quadrature = self.granted(current);
            self.commanded = quadrature;
            self.link.order.last().command.set_quadrature(CurrentCommand::reference(quadrature));
        }
    }

    /// What of a current the holding brake's sequence lets pass.
    #[inline]
    fn granted(&self, current: CurrentFraction) -> CurrentFraction {
        // A scale of at most 1, 2^15.
        let scale = i32::from(self.brake_output.torque_scale.to_bits());
        CurrentFraction::from_bits((i32::from(current.to_bits()).wrapping_mul(scale) >> 15) as i16)
    }

    /// The order while the angle is looked for, or held for an identification, or not known.
    #[cold]
    fn command_without_the_loops(&mut self, speed: i32, trim: i16) {
        let (angle, direct, quadrature) = match (self.aligning, self.held) {
            (Some((angle, direct, quadrature)), _) => (angle, direct, quadrature),
            (None, Some((angle, request))) => (angle, request.direct, request.quadrature),
            (None, None) => (0, CurrentFraction::ZERO, CurrentFraction::ZERO),
        };
        // An angle that is held does not turn with the rotor.
        let (speed, turning) = if self.held.is_some() { (0, 0) } else { (speed, self.angle_per_increment) };
        let voltages = match self.held {
            Some((_, request)) => (request.direct_voltage, request.quadrature_voltage),
            None => self.settings.model.induced(speed, direct, quadrature),
        };
        self.send(&Wanted { angle, turning, speed, direct, quadrature, voltages }, trim);
    }

    #[inline]
    fn send(&mut self, wanted: &Wanted, trim: i16) {
        let (direct_voltage, quadrature_voltage) = wanted.voltages;
        self.direct_command = wanted.direct;
        self.commanded = wanted.quadrature;
        self.induced = quadrature_voltage;
        let aged = (i64::from(wanted.speed).wrapping_mul(SAMPLE_AGE << 16) >> 32) as i32;
        let angle = wanted.angle.wrapping_sub(aged.cast_unsigned());
        self.link.order.send(|order| {
            let command = &order.command;
            // First, as long as the compiler has a register for where the drive lies.
            command.set_bus(&self.bus_scale);
            order.set(self.bridge_on, trim);
            command
                .set_currents(CurrentCommand::reference(wanted.direct), CurrentCommand::reference(wanted.quadrature));
            command.set_voltages(direct_voltage, quadrature_voltage);
            command.set_angle(angle, self.count, wanted.turning);
            command.set_ahead(Self::ahead(wanted.speed));
        });
    }

    /// Holds the angle for an identification, or gives it back to the rotor.
    #[inline]
    pub const fn hold(&mut self, held: Option<(u32, CurrentRequest)>) {
        self.held = held;
    }

    /// Longest voltage vector of this tick, volt 2^-14.
    #[inline]
    pub const fn longest_voltage(&self) -> i32 {
        self.bus_scale.longest()
    }

    /// What the oscilloscope shows of the current loop: the second cycle of the tick before, then the first one of this tick. At 8 kHz a
    /// tick has only the first.
    #[inline]
    pub fn last_cycles(&self) -> impl Iterator<Item = CurrentLoopValues> {
        let skipped = usize::from(Self::CYCLES_IN_A_TICK < 2);
        [false, true].into_iter().skip(skipped).map(|first| self.values_of(self.link.report.cycle(first)))
    }

    /// What the oscilloscope shows of the cycle that began this tick.
    #[inline]
    pub fn cycle_values(&self) -> CurrentLoopValues {
        self.values_of(self.link.report.cycle(true))
    }

    #[inline]
    fn values_of(&self, cycle: &CycleReport) -> CurrentLoopValues {
        let readings = cycle.readings.readings();
        let phase = |counts: i32| {
            let fraction = self.settings.phase_current.apply(counts.into());
            CurrentFraction::from_bits(fraction.clamp(i16::MIN.into(), i16::MAX.into()) as i16)
        };
        CurrentLoopValues {
            quadrature: CurrentReadings::fraction(readings.quadrature),
            direct_command: self.direct_command,
            direct: CurrentReadings::fraction(readings.direct),
            phases: cycle.readings.phases().map(phase),
            // A bridge that is off keeps its last voltages in the readings.
            quadrature_voltage: if self.bridge_on { readings.quadrature_voltage } else { 0 },
            direct_voltage: if self.bridge_on { readings.direct_voltage } else { 0 },
            angle: (cycle.readings.angle() >> 16) as u16,
            // At most 4 000 V.
            bus_voltage: self.settings.bus_millivolts.apply(get(&cycle.bus).into()) as i32,
        }
    }

    /// From a sample to the middle of the period in which its voltage acts: one cycle, at a speed in 2^-32 revolution a tick.
    #[inline]
    fn ahead(speed: i32) -> Rotation {
        match Self::CYCLES_IN_A_TICK {
            // Half a revolution a tick, the end of the range, is a quarter of one a cycle.
            2 => Rotation::within_a_quarter(speed),
            _ => Rotation::by(speed.cast_unsigned()),
        }
    }

    /// The torque-producing current that flows, for S-0-0084.
    pub fn torque_current(&self) -> CurrentFraction {
        if !self.bridge_on {
            return CurrentFraction::ZERO;
        }
        let first = self.link.report.cycle(true);
        CurrentReadings::fraction(first.readings.readings().quadrature)
    }
}

/// What the motor is to be given.
struct Wanted {
    /// Electrical angle at the count of the tick, 2^-32 revolution.
    angle: u32,
    /// By which it turns with an increment.
    turning: u32,
    /// And in a tick.
    speed: i32,
    direct: CurrentFraction,
    quadrature: CurrentFraction,
    /// Feed-forward of the d and q axis, volt 2^-14.
    voltages: (i32, i32),
}

/// The output of a sequence that has never run.
fn at_rest(brake: &mut BrakeSequencer, settings: &MotorSettings) -> BrakeOutput {
    brake.tick(
        &settings.brake,
        &BrakeInputs {
            request: BrakeRequest::Immediate,
            bridge_on: false,
            standstill: true,
            position: Position::ZERO,
            torque_command: CurrentFraction::ZERO,
            torque_current: CurrentFraction::ZERO,
            field_current: CurrentFraction::ZERO,
            contact_open: false,
            blocked: false,
        },
    )
}

#[cfg(test)]
mod tests {
    extern crate std;

    use std::boxed::Box;

    use super::example::{self, Example};
    use super::link::set;
    use super::*;
    use crate::encoder::double_sampled::{DoubleSampledEncoder, DoubleSampledSettings};

    #[test]
    fn the_angle_of_an_order_is_that_of_the_rotor_at_the_sample_at_any_speed_in_both_directions() {
        let settings = example::settings();
        let pole_pairs = f64::from(settings.pole_pairs);
        let increments = f64::from(settings.angle_per_increment).recip() * pole_pairs * 2_f64.powi(32);
        for reversed in [false, true] {
            for moved in [-60_i32, -1, 0, 7, 60] {
                let link = Box::leak(Box::new(CurrentLink::new()));
                let mut motor = Motor::<Example>::new(link, settings);
                motor.apply_settings(&settings, reversed);
                let mut encoder =
                    DoubleSampledEncoder::new(DoubleSampledSettings::new(example::INCREMENTS).unwrap(), 0);
                motor.set_commutation_angle(encoder.position(), Some(0));
                let sign = if reversed { -1.0 } else { 1.0 };
                // Two cycles a tick, `moved` increments of the counter in each.
                let per_tick = 2.0 * f64::from(moved) * sign;
                let velocity = Velocity::from_bits((per_tick / increments * 2_f64.powi(36)).round() as i32);
                for tick in 1..50_i32 {
                    let count = |half_ticks: i32| moved.wrapping_mul(half_ticks).cast_unsigned();
                    set(&link.report.cycle(true).count_before, count(2 * tick - 1));
                    set(&link.report.cycle(true).count, count(2 * tick));
                    // The tick may be so late that its second cycle has been.
                    set(&link.report.cycle(false).count_before, count(2 * tick));
                    set(&link.report.cycle(false).count, count(2 * tick + 1));
                    let [before, now] = motor.take_counts();
                    let direction = motor.direction();
                    let position = encoder.update(before.wrapping_mul(direction), now.wrapping_mul(direction));
                    motor.command(position, CurrentFraction::ZERO, velocity, 0);
                    for later in [0, 1, 2] {
                        let angle = link.order.last().command.angle_at(count(2 * tick + later));
                        let at_sample =
                            (f64::from(tick) + f64::from(later) / 2.0 - SAMPLE_AGE as f64 / 65_536.0) * per_tick;
                        let exact = (at_sample * pole_pairs / increments).rem_euclid(1.0);
                        let error = (f64::from(angle) / 2_f64.powi(32) - exact + 0.5).rem_euclid(1.0) - 0.5;
                        assert!(
                            error.abs() < 1e-6,
                            "{error} of a revolution at {moved}, {reversed}, tick {tick} + {later}"
                        );
                    }
                }
            }
        }
    }
}
