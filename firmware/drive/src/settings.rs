//! From the parameters of the master to the settings of the hot tasks: every division is made here.

use sercos::Idn;
use sercos::parameters::Parameters;
use sercos::transition::OPERATION_MODES;
use servo::SettingsError;
use servo::axis::{
    AxisParameters, AxisSettings, CurrentFilterSettings, FilterSection, FrictionParameters, FrictionSettings,
    VelocityRate,
};
use servo::clock::LoopClockSettings;
use servo::encoder::DoubleSampledSettings;
use servo::homing::{HomingParameters, HomingSettings};
use servo::monitor::TravelRange;
use servo::motor::{Facts, MotorSettings};
use servo::path::{Interpolation, MotionLimits};
use servo::units::{Position, PositionScale, SUPERVISION_PERIOD_MICROSECONDS, Velocity, VelocityScale};

pub(crate) mod current;
pub(crate) mod increments;
pub(crate) mod invalid;
pub(crate) mod limit_values;
pub(crate) mod limits;
pub(crate) mod motor;
pub(crate) mod scaling;
pub(crate) mod torque;

use invalid::{InvalidSetting, blamed, invalid, signed, unsupported};
use limit_values::LimitValues;
use limits::LimitScale;
use scaling::DerivativeScale;
use torque::TorqueScale;

use crate::coordinates::Coordinates;
use crate::hardware::LOOP_PERIOD_MICROSECONDS;
use crate::operation_mode::{Direction, OperationMode, Polarity, Reaction};
use crate::signal::bits::BitSettings;
use crate::signal::word::Source;

/// What movements to a target need (S-0-0259, S-0-0260, S-0-0359, S-0-0193, S-0-0108, S-0-0393, S-0-0418).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct PositioningSettings {
    /// Velocity, acceleration, deceleration and jerk.
    pub limits: MotionLimits,
    /// Bits 1 and 0 of S-0-0393.
    pub direction: Direction,
    /// Bit 2 of S-0-0393: a target is dropped with its mode.
    pub drops_target: bool,
    /// S-0-0418.
    pub window_behind: Position,
}

/// What the cycle of the ring is to the loops: what S-0-0127 has accepted of S-0-0001 and S-0-0002 counts from CP3 on, whatever else is
/// still missing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct CycleSettings {
    /// The loop timer's clock on the ring's clock.
    pub clock: LoopClockSettings,
    /// Loop ticks in a communication cycle (S-0-0002).
    pub ticks_per_cycle: u16,
    /// Loop ticks from one t3 event to the time at which the next is overdue: a cycle and a quarter, at least two ticks.
    pub ticks_to_overdue: u16,
    /// us from t3 to t4, in the same cycle or across the MST.
    pub from_t3_to_t4: u16,
    /// Communication cycles in a control unit cycle (S-0-0001): the command value changes once in so many.
    pub cycles_per_command: u16,
}

impl CycleSettings {
    /// From S-0-0001 and S-0-0002. Divides.
    ///
    /// # Errors
    /// The first of the two that the loops cannot run with.
    pub fn new(parameters: &Parameters, loop_timer_counts: u16) -> Result<Self, InvalidSetting> {
        let ticks_per_cycle = ticks(parameters, 2);
        let cycles_per_command =
            ticks(parameters, 1).checked_div(ticks_per_cycle).filter(|&cycles| cycles > 0).ok_or(unsupported(1))?;
        // The ring gives one t3 event a communication cycle, whatever the control unit's own cycle is.
        let clock = LoopClockSettings::new(loop_timer_counts, ticks_per_cycle, three_quarters(loop_timer_counts))
            .map_err(invalid(2))?;
        let ticks_to_overdue = ticks_per_cycle.saturating_add((ticks_per_cycle >> 2).max(2));
        let [cycle, t3, t4] = [2, 8, 7].map(|number| parameters.get_word(Idn::standard(number)));
        let from_t3_to_t4 = t4.checked_sub(t3).unwrap_or_else(|| t4.wrapping_add(cycle).wrapping_sub(t3));
        Ok(Self { clock, ticks_per_cycle, ticks_to_overdue, from_t3_to_t4, cycles_per_command })
    }
}

/// Everything the hot tasks need of the parameters, scaled: in parts, each of which is handed to them in a few microseconds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct DriveSettings {
    /// Loops without feed-forward: velocity mode and position mode with lag.
    pub with_lag: AxisSettings,
    /// Loops with feed-forward S-0-0296.
    pub without_lag: AxisSettings,
    /// Bridge, motor, brake.
    pub motor: MotorSettings,
    /// The rest.
    pub motion: MotionSettings,
}

/// What stands around the loops: data, modes, limits and windows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct MotionSettings {
    /// Modes of control word bits 11, 9, 8 = 000 to 111 (S-0-0032 to S-0-0035, S-0-0284 to S-0-0287).
    pub modes: [Option<OperationMode>; 8],
    /// Weight of position data without sign: windows and ways.
    pub position: PositionScale,
    /// Positions of the master.
    pub coordinates: Coordinates,
    /// Velocity data.
    pub velocity: VelocityScale,
    /// Torque data.
    pub torque: TorqueScale,
    /// S-0-0126 as a fraction of the peak current (2^-15).
    pub torque_threshold: u32,
    /// S-0-0055.
    pub position_polarity: Polarity,
    /// S-0-0043.
    pub velocity_polarity: Polarity,
    /// S-0-0085.
    pub torque_polarity: Polarity,
    /// The encoder.
    pub encoder: DoubleSampledSettings,
    /// S-0-0277 bit 3: the encoder counts against the direction of positive current.
    pub encoder_reversed: bool,
    /// P-0-2705: S-0-0053 shows the motor encoder.
    pub has_feedback_2: bool,
    /// The cycle of the ring.
    pub cycle: CycleSettings,
    /// S-0-0057.
    pub position_window: Position,
    /// S-0-0157.
    pub velocity_window: Velocity,
    /// Measured velocity that is an error: 1.25 times S-0-0113.
    pub overspeed: Velocity,
    /// S-0-0124.
    pub standstill_window: Velocity,
    /// S-0-0049 and S-0-0050, while S-0-0055 bit 4 switches them on.
    pub position_limits: Option<TravelRange>,
    /// The limits that the MDT can carry, as the parameters say.
    pub limits: LimitValues,
    /// What these are for the loops.
    pub limit_scale: LimitScale,
    /// S-0-0261.
    pub coarse_window: Position,
    /// Movements to S-0-0258 and S-0-0282.
    pub positioning: PositioningSettings,
    /// P-0-0140: what an error does to a motor that runs.
    pub reaction: Reaction,
    /// S-0-0159; zero: not monitored.
    pub monitoring_window: Position,
    /// S-0-0125.
    pub velocity_threshold: Velocity,
    /// S-0-0377; zero: not monitored.
    pub velocity_monitoring_window: Velocity,
    /// S-0-0097: which bits of C2D set their change bit.
    pub class_2_mask: u16,
    /// S-0-0098: which bits of C3D set their change bit.
    pub class_3_mask: u16,
    /// Real-time bits and signal words.
    pub bits: BitSettings,
    /// S-0-0147 bit 2: the home switch is an input of the drive, not S-0-0400.
    pub home_switch_at_drive: bool,
}

/// P-0-2705: where position feedback 2 comes from; 0: there is none. The number is far from those that controls write to every drive of
/// another maker (P-0-0005 is the language there).
pub(crate) const POSITION_FEEDBACK_2_SOURCE: Idn = Idn::product(2705);

/// There is a position feedback 2.
pub(crate) fn has_feedback_2(parameters: &Parameters) -> bool {
    parameters.get_word(POSITION_FEEDBACK_2_SOURCE) != 0
}

impl DriveSettings {
    /// Scales the parameters. Divides: for the service channel, never for a loop.
    ///
    /// # Errors
    /// The first parameter that the drive cannot work with.
    pub fn new(
        parameters: &Parameters,
        facts: &Facts,
        sources: impl Fn(Idn) -> Option<Source>,
    ) -> Result<Self, InvalidSetting> {
        let position = scaling::position_scale(parameters)?;
        let velocity = scaling::velocity_scale(parameters)?;
        let derivatives = DerivativeScale::new(parameters)?;
        let coordinates = scaling::coordinates(parameters)?;
        let velocity_polarity = Polarity::from_parameter(parameters.get_word(Idn::standard(43)));
        let torque = TorqueScale::new(parameters)?;
        let cycle = CycleSettings::new(parameters, facts.loop_timer_counts)?;
        let monitoring_window = position.to_position(signed(parameters, 159));
        let limits = LimitValues::new(parameters);
        let limit_scale = LimitScale::new(parameters, velocity, torque, derivatives, cycle.ticks_per_cycle)?;
        let fastest = limit_scale.fastest();
        let peak_current = parameters.get(Idn::standard(110));
        let axis = AxisParameters {
            ticks_per_cycle: ticks(parameters, 1),
            modulo: Some(coordinates.range),
            position_gain: parameters.get_word(Idn::standard(104)),
            feed_forward: 0,
            velocity_gain: parameters.get(Idn::standard(100)),
            integral_time: parameters.get_word(Idn::standard(101)),
            velocity_rate: VelocityRate::of(facts.frequency),
            velocity_filter: parameters.get_word(Idn::standard(392)),
            acceleration_gain: 0,
            acceleration_smoothing: parameters.get_word(Idn::product(231)),
            friction: friction(parameters, &torque, peak_current)?,
            filter: filter(parameters, VelocityRate::of(facts.frequency))?,
            peak_current,
            velocity_limits: limit_scale.velocity_limits(&limits),
            deceleration: limit_scale.deceleration(&limits),
            halt_deceleration: limit_scale.halt_deceleration(),
            jerk: limit_scale.jerk(&limits),
            velocity_ramp: limit_scale.velocity_ramp(&limits),
            interpolation: interpolation(parameters),
            standstill_window: velocity.to_velocity(signed(parameters, 124)),
            monitoring_window,
            largest_step: largest_step(
                limit_scale.fastest_command(parameters, &limits),
                ticks(parameters, 1),
                &position,
            ),
        };
        let feed_forward = parameters.get_word(Idn::standard(296)).saturating_mul(10);
        let ahead = setpoint_ahead(parameters, facts);
        let increments = parameters.get(Idn::standard(116)).saturating_mul(parameters.get(Idn::standard(256)));
        let feedback_type = parameters.get_word(Idn::standard(277));
        if feedback_type & !REVERSED != 0 {
            return Err(unsupported(277));
        }
        Ok(Self {
            with_lag: AxisSettings::new(&axis).map_err(blamed)?.with_setpoint_ahead(ahead),
            without_lag: AxisSettings::new(&AxisParameters {
                feed_forward,
                // One increment is 0.1 mA s²/rad.
                acceleration_gain: u32::from(parameters.get_word(Idn::standard(348))).saturating_mul(100),
                ..axis
            })
            .map_err(blamed)?
            .with_setpoint_ahead(ahead),
            motor: motor::settings(parameters, facts, &limit_scale.torque_limits(&limits), increments, fastest)?,
            motion: MotionSettings {
                modes: modes(parameters)?,
                position,
                coordinates,
                velocity,
                torque,
                torque_threshold: torque.threshold(parameters.get_word(Idn::standard(126))),
                position_polarity: Polarity::from_parameter(parameters.get_word(Idn::standard(55))),
                velocity_polarity,
                torque_polarity: Polarity::from_parameter(parameters.get_word(Idn::standard(85))),
                encoder: DoubleSampledSettings::new(increments).map_err(invalid(116))?,
                encoder_reversed: feedback_type & REVERSED != 0,
                has_feedback_2: has_feedback_2(parameters),
                cycle,
                position_window: position.to_position(signed(parameters, 57)),
                velocity_window: velocity.to_velocity(signed(parameters, 157)),
                overspeed: Velocity::saturating_from_bits(i64::from(fastest.to_bits()).saturating_mul(5) / 4),
                standstill_window: velocity.to_velocity(signed(parameters, 124)),
                position_limits: position_limits(parameters, &coordinates, increments)?,
                limits,
                limit_scale,
                coarse_window: position.to_position(signed(parameters, 261)),
                positioning: PositioningSettings {
                    limits: limit_scale.positioning(&limits).map_err(|reason| match reason {
                        SettingsError::TooSmooth { .. } | SettingsError::BrakingTime { .. } => invalid(193)(reason),
                        _ => invalid(259)(reason),
                    })?,
                    direction: Direction::from_parameter(parameters.get_word(COMMAND_VALUE_MODE))
                        .ok_or(unsupported(393))?,
                    drops_target: parameters.get_word(COMMAND_VALUE_MODE) & DROPS_TARGET != 0,
                    window_behind: position.to_position(signed(parameters, 418)),
                },
                reaction: Reaction::from_parameter(parameters.get_word(Idn::product(140))),
                monitoring_window,
                velocity_threshold: velocity.to_velocity(signed(parameters, 125)),
                velocity_monitoring_window: velocity.to_velocity(signed(parameters, 377)),
                class_2_mask: parameters.get_word(Idn::standard(97)),
                class_3_mask: parameters.get_word(Idn::standard(98)),
                bits: BitSettings::new(parameters, sources),
                home_switch_at_drive: parameters.get_word(Idn::standard(147)) & SWITCH_AT_DRIVE != 0,
            },
        })
    }
}

/// P-0-0141; it leaves the choice to the length of the cycle by default.
fn interpolation(parameters: &Parameters) -> Interpolation {
    /// S-0-0001 from which on lines are seen in the torque, in us.
    const LONG: u16 = 4_000;
    match parameters.get_word(Idn::product(141)) {
        0 => Interpolation::Linear,
        1 => Interpolation::Cubic,
        _ if parameters.get_word(Idn::standard(1)) < LONG => Interpolation::Linear,
        _ => Interpolation::Cubic,
    }
}

/// Velocity commands within which the friction compensation grows in proportion: 1 rpm.
const FRICTION_BAND: u32 = 10_000;

/// Bit 2 of S-0-0147.
const SWITCH_AT_DRIVE: u16 = 1 << 2;

const COMMAND_VALUE_MODE: Idn = Idn::standard(393);

/// Bit 2 of S-0-0393.
const DROPS_TARGET: u16 = 1 << 2;

/// Bit 3 of S-0-0277.
const REVERSED: u16 = 1 << 3;

fn ticks(parameters: &Parameters, number: u16) -> u16 {
    parameters.get_word(Idn::standard(number)) / LOOP_PERIOD_MICROSECONDS
}

/// Where t3 falls between two ticks: the first tick with a new command comes a quarter of a period after it.
const fn three_quarters(counts: u16) -> u16 {
    counts.saturating_sub(counts / 4)
}

/// What a position command may be away from the one before it: the way at S-0-0091 in a control unit cycle S-0-0001, a quarter more for a
/// control whose path is not quite its own limit, and two increments, because S-0-0047 and S-0-0048 are rounded to them.
fn largest_step(fastest: Velocity, ticks_per_command: u16, scale: &PositionScale) -> Position {
    let way = i64::from(fastest.to_bits()).saturating_mul(ticks_per_command.into()) >> 4;
    Position::from_bits(way.saturating_add(way >> 2)) + scale.to_position(2)
}

/// What homing S-0-0148 works with: its way and the limits of its movements.
///
/// # Errors
/// The first parameter that homing cannot work with.
pub(crate) fn homing(
    parameters: &Parameters,
    settings: &MotionSettings,
) -> Result<(HomingSettings, MotionLimits), InvalidSetting> {
    const NEGATIVE: u16 = 1 << 0;
    let place = |number| settings.coordinates.place(signed(parameters, number));
    let way = |number| settings.position.to_position(signed(parameters, number));
    let velocity = settings.velocity.to_velocity(signed(parameters, 41));
    // The positive direction is that of S-0-0051.
    let direction = if settings.coordinates.reversed { NEGATIVE } else { 0 };
    let homing = HomingSettings::new(&HomingParameters {
        homing_parameter: parameters.get_word(Idn::standard(147)) ^ direction,
        velocity,
        reference_distance: place(52),
        reference_offset: place(150),
        switch_offset: way(299),
        travel_limit: Some(way(278)).filter(|limit| *limit > Position::ZERO),
        marker_limit: None,
    })
    .map_err(|_| unsupported(147))?;
    let derivatives = DerivativeScale::new(parameters)?;
    let acceleration = derivatives.acceleration(parameters.get(Idn::standard(42)));
    let jerk = derivatives.jerk(parameters.get(Idn::standard(349)));
    let limits = MotionLimits::new(velocity, acceleration, acceleration, jerk).map_err(invalid(41))?;
    Ok((homing, limits))
}

/// S-0-0155 and P-0-0142.
fn friction(
    parameters: &Parameters,
    torque: &TorqueScale,
    peak_current: u32,
) -> Result<FrictionSettings, InvalidSetting> {
    FrictionSettings::new(&FrictionParameters {
        coulomb: torque.milliamperes(parameters.get_word(Idn::standard(155))),
        viscous: parameters.get_word(Idn::product(142)).into(),
        band: FRICTION_BAND,
        peak_current,
    })
    .map_err(invalid(155))
}

/// P-0-0170 to P-0-0177: kind, frequency, damping or width, and depth of each section.
fn filter(parameters: &Parameters, rate: VelocityRate) -> Result<CurrentFilterSettings, InvalidSetting> {
    let section = |first: u16| {
        let word = |offset: u16| parameters.get_word(Idn::product(first.saturating_add(offset)));
        match word(0) {
            1 => FilterSection::LowPass { frequency: word(1), damping: word(2) },
            2 => FilterSection::Notch { frequency: word(1), width: word(2), depth: word(3) },
            _ => FilterSection::Off,
        }
    };
    let settings = CurrentFilterSettings::new([section(170), section(174)], rate);
    settings.map_err(|reason| InvalidSetting { idn: Idn::product(170), reason: Some(reason) })
}

/// S-0-0049 and S-0-0050, if bit 4 of S-0-0055 switches them on. An endless axis has none.
fn position_limits(
    parameters: &Parameters,
    coordinates: &Coordinates,
    encoder_increments: u32,
) -> Result<Option<TravelRange>, InvalidSetting> {
    const LIMITS_ON: u16 = 1 << 4;
    if parameters.get_word(Idn::standard(55)) & LIMITS_ON == 0 {
        return Ok(None);
    }
    if coordinates.modulo.is_some() {
        return Err(unsupported(55));
    }
    let (positive, negative) = (signed(parameters, 49), signed(parameters, 50));
    if positive < negative {
        return Err(unsupported(49));
    }
    let (one, other) = (coordinates.place(positive), coordinates.place(negative));
    let increment = coordinates.scale.to_position(1);
    let of_encoder = (1_i64 << 32).checked_div(encoder_increments.into()).unwrap_or(0);
    Ok(Some(TravelRange {
        lowest: one.min(other),
        highest: one.max(other),
        rounding: Position::from_bits(increment.to_bits() / 2),
        // What is read of a standing encoder swings by one of its increments to either side, and by the rounding to data.
        swing: increment + Position::from_bits(of_encoder.saturating_mul(2)),
        // S-0-0047 was S-0-0051 of an AT two cycles before; and as long as an old command stands, it is followed.
        looks_back: looks_in(parameters.get_word(Idn::standard(1)).saturating_mul(3)),
    }))
}

/// How often the supervision looks in so many microseconds, and once more.
fn looks_in(microseconds: u16) -> u16 {
    let looks = u32::from(microseconds).checked_div(SUPERVISION_PERIOD_MICROSECONDS).unwrap_or(0);
    u16::try_from(looks).unwrap_or(u16::MAX).saturating_add(1)
}

fn modes(parameters: &Parameters) -> Result<[Option<OperationMode>; 8], InvalidSetting> {
    let mut modes = [None; 8];
    for (slot, (number, idn)) in modes.iter_mut().zip(OPERATION_MODES.into_iter().enumerate()) {
        let value = parameters.get_word(idn);
        *slot = OperationMode::from_parameter(value);
        if slot.is_none() && (value != 0 || number == 0) {
            return Err(InvalidSetting { idn, reason: None });
        }
    }
    Ok(modes)
}

/// By how many ns the set-point of a tick is ahead of the position that is measured in it, so that the shaft reaches a command one cycle
/// S-0-0001 after the t3 at which it became valid, and P-0-0230 later.
///
/// The first tick behind t3 is a whole tick of the way to the new command already; see [`three_quarters`] for when it is.
fn setpoint_ahead(parameters: &Parameters, facts: &Facts) -> i32 {
    const TICK: i32 = LOOP_PERIOD_MICROSECONDS as i32 * 1_000;
    let counted = (TICK / 4).saturating_add(facts.sample_to_count.into());
    let measured = if facts.reads_the_encoder_twice() { counted.saturating_sub(TICK / 4) } else { counted };
    let shift = i32::from(parameters.get_word(Idn::product(230)).cast_signed());
    shift.saturating_mul(1_000).saturating_add(TICK).saturating_sub(measured)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dictionary::source;
    use crate::service::rig::FACTS;
    use servo::units::CurrentFraction;

    fn with(changes: &[(u16, u32)]) -> Parameters {
        let mut parameters = crate::service::rig::parameters();
        for &(number, value) in changes {
            parameters.set(Idn::standard(number), value.into()).unwrap();
        }
        parameters
    }

    #[test]
    fn the_defaults_of_the_table_make_a_drive() {
        let settings = DriveSettings::new(&crate::service::rig::parameters(), &FACTS, source).unwrap();
        assert_eq!(settings.motion.cycle.ticks_per_cycle, 16);
        assert_eq!(settings.motion.modes[0], Some(OperationMode::Velocity));
        assert_eq!(settings.motion.modes[1..], [None; 7]);
        // Preferred scaling: 3 600 000 increments and 10 000 increments per rpm.
        assert_eq!(settings.motion.position.to_position(3_600_000), Position::REVOLUTION);
        assert_eq!(settings.motion.velocity.to_velocity(10_000), Velocity::from_ten_thousandths_rpm(10_000));
    }

    #[test]
    fn what_the_drive_does_not_have_is_named() {
        for (changes, culprit) in [
            (&[(76, 0x12)][..], 76),
            (&[(76, 3)], 76),
            (&[(44, 0x21)], 44),
            (&[(32, 0)], 32),
            (&[(33, 7)], 33),
            (&[(287, 4)], 287),
            (&[(277, 1)], 277),
            (&[(76, 0x82), (103, 0)], 103),
            (&[(44, 0x0A), (46, 32)], 46),
            (&[(76, 0x0A), (79, 1)], 79),
        ] {
            let result = DriveSettings::new(&with(changes), &FACTS, source);
            assert_eq!(result.map_err(|error| error.idn).err(), Some(Idn::standard(culprit)), "{changes:?}");
        }
    }

    #[test]
    fn a_motor_faster_than_its_encoder_can_be_counted_is_refused_with_both_rates() {
        let with_encoder =
            |lines, rpm: u32| DriveSettings::new(&with(&[(116, lines), (113, rpm * 10_000)]), &FACTS, source);
        // 2^20 increments at a quarter more than 851 rpm are 18.6 million a second.
        assert!(with_encoder(1 << 18, 851).is_ok());
        let error = with_encoder(1 << 18, 852).unwrap_err();
        let expected = SettingsError::EncoderRate { actual: 18_612_224, maximum: 18_600_000 };
        assert_eq!((error.idn, error.reason), (Idn::standard(113), Some(expected)));
        // Faster, its magnets would be too strong for the link.
        assert!(with_encoder(1 << 15, 4_500).is_ok());
    }

    #[test]
    fn a_shut_down_temperature_that_the_sensor_cannot_show_is_refused() {
        let with_sensor = |number: u16, shutdown: u16| {
            let mut parameters = with(&[(204, shutdown.into())]);
            parameters.set(Idn::product(134), number.into()).unwrap();
            DriveSettings::new(&parameters, &FACTS, source).map_err(|error| error.idn)
        };
        // A resistor with negative coefficient shows up to 200 degrees C.
        assert!(with_sensor(3, 2_000).is_ok());
        assert_eq!(with_sensor(3, 2_001).err(), Some(Idn::standard(204)));
        for number in [0, 1, 2, 4, 5] {
            assert!(with_sensor(number, 2_500).is_ok(), "{number}");
        }
    }

    #[test]
    fn the_trip_level_of_a_small_motor_on_a_large_amplifier_is_the_motors() {
        let counts = |motor: u32, level: u32| {
            let mut parameters = with(&[(109, motor), (110, 14_000)]);
            parameters.set(Idn::product(106), level.into()).unwrap();
            let [current, ..] =
                DriveSettings::new(&parameters, &FACTS, source).unwrap().motor.current.protection.to_words();
            f64::from(current)
        };
        // Counts 2^-3 of an amplitude, the range of 25 A being 2 048 counts.
        let of = |amplitude: f64| amplitude / 25.0 * 2_048.0 * 8.0;
        let rms = core::f64::consts::SQRT_2;
        // 5 A of the motor and 4.5 A across are 6.73 A; and what is given is the crest of a sine.
        for (motor, level, amplitude) in [
            (5_000, 17_500, 1.25 * 5.0 * 1.81_f64.sqrt() * rms),
            (100, 17_500, 0.1 * 1.81_f64.sqrt() * rms + 0.5),
            (5_000, 7_000, 7.0 * rms),
            (9_000, 17_500, 1.25 * 9.0 * 1.81_f64.sqrt() * rms),
        ] {
            let actual = counts(motor, level);
            assert!((actual - of(amplitude)).abs() < 8.0, "{motor} {level}: {actual}, expected {}", of(amplitude));
        }
        assert_eq!(counts(14_000, 15_000), counts(20_000, 15_000), "the amplifier's");
    }

    #[test]
    fn shares_of_the_largest_current_are_those_of_the_smaller_of_motor_and_amplifier() {
        let motor_side = |motor: u32, [weakening, alignment, proof]: [u16; 3]| {
            let mut parameters = with(&[(109, motor), (110, 14_000)]);
            for (number, value) in [(107, weakening), (116, alignment), (121, proof), (120, 1)] {
                parameters.set(Idn::product(number), value.into()).unwrap();
            }
            let MotorSettings { weakening, alignment, brake, .. } =
                DriveSettings::new(&parameters, &FACTS, source).unwrap().motor;
            (weakening, alignment, brake)
        };
        assert_eq!(motor_side(7_000, [800, 500, 200]), motor_side(14_000, [400, 250, 100]));
        assert_eq!(motor_side(20_000, [800, 500, 200]), motor_side(14_000, [800, 500, 200]));
        assert_ne!(motor_side(7_000, [800, 500, 200]), motor_side(14_000, [800, 500, 200]));
    }

    #[test]
    fn a_proof_of_the_torque_that_sinks_into_the_noise_of_the_sensors_is_refused() {
        let with_proof = |per_mille: u16, brake: u16| {
            let mut parameters = with(&[(109, 1_000), (110, 14_000)]);
            parameters.set(Idn::product(121), per_mille.into()).unwrap();
            parameters.set(Idn::product(120), brake.into()).unwrap();
            DriveSettings::new(&parameters, &FACTS, source).map_err(|error| error.idn)
        };
        // 16 counts of 2 048 are 0.1953 A of 25 A, 138 mA RMS.
        assert_eq!(with_proof(137, 1).err(), Some(Idn::product(121)));
        assert!(with_proof(140, 1).is_ok() && with_proof(10, 0).is_ok());
    }

    #[test]
    fn a_feedrate_override_beyond_100_per_cent_is_more_velocity_within_s_0_0091() {
        let positioning =
            |changes: &[(u16, u32)]| DriveSettings::new(&with(changes), &FACTS, source).unwrap().motion.positioning;
        let doubled = positioning(&[(259, 1_000_000), (108, 20_000)]);
        assert_eq!(doubled, positioning(&[(259, 2_000_000)]));
        assert_ne!(doubled, positioning(&[(259, 1_000_000)]));
        let most = positioning(&[(259, 30_000_000)]);
        assert_eq!(positioning(&[(259, 29_000_000), (108, 32_767)]), most, "S-0-0091 is 3000 rpm");
        assert_ne!(positioning(&[(259, 30_000_000), (108, 9_999)]), most);
    }

    #[test]
    fn position_commands_are_joined_by_cubics_from_4_ms_on_unless_p_0_0141_says_otherwise() {
        let of = |cycle: u64, choice: Option<u64>| {
            let mut parameters = crate::service::rig::parameters();
            parameters.set(Idn::standard(1), cycle).unwrap();
            if let Some(choice) = choice {
                parameters.set(Idn::product(141), choice).unwrap();
            }
            interpolation(&parameters)
        };
        for cycle in [500, 3_500, 4_000, 65_000] {
            let automatic = if cycle < 4_000 { Interpolation::Linear } else { Interpolation::Cubic };
            assert_eq!((of(cycle, None), of(cycle, Some(2))), (automatic, automatic), "{cycle} us");
            assert_eq!(of(cycle, Some(0)), Interpolation::Linear, "{cycle} us");
            assert_eq!(of(cycle, Some(1)), Interpolation::Cubic, "{cycle} us");
        }
    }

    #[test]
    fn a_shift_of_the_set_point_is_seen_in_both_kinds_of_position_control() {
        let shifted = |microseconds: i16| {
            let mut parameters = crate::service::rig::parameters();
            parameters.set(Idn::product(230), microseconds.cast_unsigned().into()).unwrap();
            assert_eq!(setpoint_ahead(&parameters, &FACTS), 122_800 + i32::from(microseconds) * 1_000);
            let settings = DriveSettings::new(&parameters, &FACTS, source).unwrap();
            (settings.with_lag, settings.without_lag)
        };
        let [early, none, late] = [-800, 0, 800].map(shifted);
        assert!(early.0 != none.0 && none.0 != late.0 && early.1 != none.1 && none.1 != late.1);
    }

    #[test]
    fn a_feed_forward_of_120_per_cent_is_more_than_one_of_100() {
        let [whole, more] =
            [1_000, 1_200].map(|gain| DriveSettings::new(&with(&[(296, gain)]), &FACTS, source).unwrap());
        assert_ne!(whole.without_lag, more.without_lag);
        assert_eq!(whole.with_lag, more.with_lag);
    }

    #[test]
    fn parameter_scaling_per_second_is_sixty_times_that_per_minute() {
        // 1 * 10^-6 revolutions per second.
        let settings = DriveSettings::new(&with(&[(44, 0x2A), (45, 1), (46, -6_i32 as u32)]), &FACTS, source).unwrap();
        let preferred = DriveSettings::new(&with(&[(44, 0x22)]), &FACTS, source).unwrap();
        assert_eq!(settings.motion.velocity, preferred.motion.velocity);
        let difference = settings.motion.velocity.to_velocity(1_000_000) - Velocity::from_ten_thousandths_rpm(600_000);
        assert!(difference.abs().to_bits() <= 1, "one revolution per second is 60 rpm: {difference:?}");
    }

    #[test]
    fn a_torque_command_is_the_inverse_of_the_torque_feedback() {
        let settings = DriveSettings::new(&with(&[(110, 14_000), (111, 3_500)]), &FACTS, source).unwrap();
        for command in [-4_000_i64, -1, 0, 1, 1_000, 4_000] {
            let current = settings.motion.torque.current_of(command);
            assert!((settings.motion.torque.increments_of(current) - command).abs() <= 1, "{command}");
        }
        assert_eq!(settings.motion.torque.current_of(1_000).to_bits(), 1 << 13, "100 % of 3.5 A is a quarter of 14 A");
    }

    #[test]
    fn torque_feedback_is_in_tenths_of_a_per_cent_of_the_stall_current() {
        // Full peak current 14 A is 400.0 % of 3.5 A.
        let settings = DriveSettings::new(&with(&[(110, 14_000), (111, 3_500)]), &FACTS, source).unwrap();
        assert_eq!(settings.motion.torque.increments_of(CurrentFraction::MAX), 4_000);
        assert_eq!(settings.motion.torque.increments_of(CurrentFraction::from_bits(-(1 << 14))), -2_000);
    }
}
