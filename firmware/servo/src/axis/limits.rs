//! What limits the drive at the moment, and the limits of the torque.
//!
//! A drive that does not do what it is told is most often at one of its limits. [`Limiting`] names them, one bit each, so that the
//! question "why does it not turn faster" has an answer that can be read.

use bitflags::bitflags;

use crate::error::{SettingsError, in_range};
use crate::units::{CurrentFraction, Velocity};

bitflags! {
    /// The limits at which the drive stands in this tick.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
    pub struct Limiting: u16 {
        /// Positive torque limit S-0-0082.
        const TORQUE_POSITIVE = 1 << 0;
        /// Negative torque limit S-0-0083.
        const TORQUE_NEGATIVE = 1 << 1;
        /// Bipolar torque limit S-0-0092.
        const TORQUE_BIPOLAR = 1 << 2;
        /// Motor peak current S-0-0109.
        const MOTOR_PEAK = 1 << 3;
        /// Amplifier peak current S-0-0110.
        const AMPLIFIER_PEAK = 1 << 4;
        /// Foldback of the motor's thermal model (S-0-0111, S-0-0114).
        const MOTOR_LOAD = 1 << 5;
        /// Foldback of the amplifier's thermal model (S-0-0112).
        const AMPLIFIER_LOAD = 1 << 6;
        /// Bus voltage: the modulator is saturated.
        const VOLTAGE = 1 << 7;
        /// Field weakening takes current from the torque.
        const FIELD_WEAKENING = 1 << 8;
        /// Positive velocity limit S-0-0038.
        const VELOCITY_POSITIVE = 1 << 9;
        /// Negative velocity limit S-0-0039.
        const VELOCITY_NEGATIVE = 1 << 10;
        /// Bipolar velocity limit S-0-0091.
        const VELOCITY_BIPOLAR = 1 << 11;
        /// Acceleration limit S-0-0138.
        const ACCELERATION = 1 << 12;
        /// Jerk limit S-0-0349.
        const JERK = 1 << 13;
        /// Positive position limit S-0-0049.
        const POSITION_POSITIVE = 1 << 14;
        /// Negative position limit S-0-0050.
        const POSITION_NEGATIVE = 1 << 15;
    }
}

#[cfg(feature = "defmt")]
impl defmt::Format for Limiting {
    fn format(&self, formatter: defmt::Formatter<'_>) {
        defmt::write!(formatter, "Limiting({=u16:#018b})", self.bits());
    }
}

/// The torque limits that a control sets, as the currents that make them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CommandedTorqueLimits {
    /// Positive torque limit S-0-0082; negative counts as zero.
    pub positive: CurrentFraction,
    /// Negative torque limit S-0-0083; positive counts as zero.
    pub negative: CurrentFraction,
    /// Bipolar torque limit S-0-0092; negative counts as zero.
    pub bipolar: CurrentFraction,
    /// S-0-0085 bit 0: torque data count against the motor. Each end limits the other direction, and keeps its name.
    pub reversed: bool,
}

/// Limits of the torque, as the IDNs carry them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TorqueLimitParameters {
    /// S-0-0082, S-0-0083, S-0-0092.
    pub commanded: CommandedTorqueLimits,
    /// Motor peak current S-0-0109 in mA.
    pub motor_peak: u32,
    /// Amplifier peak current S-0-0110 in mA: the unit of [`CurrentFraction`].
    pub amplifier_peak: u32,
}

/// The limits that only change with parameters, combined: the smallest for each sign, and which one it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct TorqueLimitSettings {
    peak: Bound,
    positive: Bound,
    negative: Bound,
}

/// A magnitude of the current in 2^-15 of the peak, and what sets it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
struct Bound {
    magnitude: i16,
    cause: Limiting,
}

impl Bound {
    /// The smaller of the two; of equal ones the first.
    #[inline]
    fn or_smaller(self, magnitude: i16, cause: Limiting) -> Self {
        if magnitude < self.magnitude { Self { magnitude: magnitude.max(0), cause } } else { self }
    }
}

impl TorqueLimitSettings {
    /// Combines the parameters. Divides.
    ///
    /// Of equal limits the amplifier's is named, then the motor's, then the bipolar one: the one that is hardest to change.
    ///
    /// # Errors
    /// [`SettingsError::OutOfRange`] without an amplifier peak current.
    pub fn new(parameters: &TorqueLimitParameters) -> Result<Self, SettingsError> {
        let amplifier_peak = in_range("amplifier peak current S-0-0110", parameters.amplifier_peak, 1, u32::MAX)?;
        let motor_peak = (u64::from(parameters.motor_peak) << 15).checked_div(amplifier_peak.into()).unwrap_or(0);
        let peak = Bound { magnitude: i16::MAX, cause: Limiting::AMPLIFIER_PEAK }
            .or_smaller(i16::try_from(motor_peak).unwrap_or(i16::MAX), Limiting::MOTOR_PEAK);
        Ok(Self { peak, positive: peak, negative: peak }.with_commanded(&parameters.commanded))
    }

    /// The same peak currents with other limits of the control. Does not divide: for every cycle.
    #[inline]
    #[must_use]
    pub fn with_commanded(self, commanded: &CommandedTorqueLimits) -> Self {
        let common = self.peak.or_smaller(commanded.bipolar.to_bits(), Limiting::TORQUE_BIPOLAR);
        let positive = common.or_smaller(commanded.positive.to_bits(), Limiting::TORQUE_POSITIVE);
        let negative = common.or_smaller(commanded.negative.saturating_neg().to_bits(), Limiting::TORQUE_NEGATIVE);
        let (positive, negative) = if commanded.reversed { (negative, positive) } else { (positive, negative) };
        Self { peak: self.peak, positive, negative }
    }

    /// The limits of this tick: those of the settings and what the thermal models allow ([`crate::monitor::LoadOutput::allowed`]).
    #[inline]
    #[must_use]
    pub fn combine(&self, motor_allowed: CurrentFraction, amplifier_allowed: CurrentFraction) -> TorqueLimits {
        let (motor, amplifier) = (motor_allowed.to_bits(), amplifier_allowed.to_bits());
        let combined = |bound: Bound| {
            bound.or_smaller(motor, Limiting::MOTOR_LOAD).or_smaller(amplifier, Limiting::AMPLIFIER_LOAD)
        };
        let (positive, negative) = (combined(self.positive), combined(self.negative));
        TorqueLimits {
            positive: CurrentFraction::from_bits(positive.magnitude),
            // A magnitude is at most 2^15 - 1.
            negative: CurrentFraction::from_bits(negative.magnitude.wrapping_neg()),
            positive_cause: positive.cause,
            negative_cause: negative.cause,
        }
    }
}

/// Limits of the torque-producing current in a tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TorqueLimits {
    /// Highest current, 0 or more.
    pub positive: CurrentFraction,
    /// Lowest current, 0 or less.
    pub negative: CurrentFraction,
    /// What sets the highest current.
    pub positive_cause: Limiting,
    /// What sets the lowest current.
    pub negative_cause: Limiting,
}

impl TorqueLimits {
    /// The limits `-magnitude ..= magnitude`, all because of `cause`.
    #[must_use]
    pub fn symmetrical(magnitude: CurrentFraction, cause: Limiting) -> Self {
        let positive = magnitude.saturating_abs();
        let negative = CurrentFraction::from_bits(positive.to_bits().wrapping_neg());
        Self { positive, negative, positive_cause: cause, negative_cause: cause }
    }

    /// These limits, where `magnitude` is not narrower for `cause`.
    #[inline]
    #[must_use]
    pub fn narrowed(mut self, magnitude: CurrentFraction, cause: Limiting) -> Self {
        if magnitude < self.positive {
            self.positive = magnitude;
            self.positive_cause = cause;
        }
        let lowest = CurrentFraction::from_bits(magnitude.to_bits().wrapping_neg());
        if lowest > self.negative {
            self.negative = lowest;
            self.negative_cause = cause;
        }
        self
    }

    /// These limits, on the side of `current`, which is not zero, where that is not wider.
    #[inline]
    #[must_use]
    pub fn narrowed_on_one_side(mut self, current: CurrentFraction, cause: Limiting) -> Self {
        if current > CurrentFraction::ZERO {
            if current < self.positive {
                self.positive = current;
                self.positive_cause = cause;
            }
        } else if current > self.negative {
            self.negative = current;
            self.negative_cause = cause;
        }
        self
    }

    /// These limits for currents whose torque acts against a rotation, where `magnitude` is not wider.
    #[must_use]
    pub fn narrowed_against(mut self, rotates_forwards: bool, magnitude: CurrentFraction, cause: Limiting) -> Self {
        let magnitude = magnitude.max(CurrentFraction::ZERO);
        if rotates_forwards {
            let lowest = CurrentFraction::from_bits(magnitude.to_bits().wrapping_neg());
            if lowest > self.negative {
                self.negative = lowest;
                self.negative_cause = cause;
            }
        } else if magnitude < self.positive {
            self.positive = magnitude;
            self.positive_cause = cause;
        }
        self
    }

    /// Which limit this current meets; none when it is within.
    #[inline]
    #[must_use]
    pub fn met_by(&self, current: CurrentFraction) -> Limiting {
        if current >= self.positive {
            self.positive_cause
        } else if current <= self.negative {
            self.negative_cause
        } else {
            Limiting::empty()
        }
    }

    /// `current` within the limits, and which of them it met; none when it was within.
    #[inline]
    #[must_use]
    pub fn apply(&self, current: CurrentFraction) -> (CurrentFraction, Limiting) {
        if current > self.positive {
            (self.positive, self.positive_cause)
        } else if current < self.negative {
            (self.negative, self.negative_cause)
        } else {
            (current, Limiting::empty())
        }
    }
}

/// Limits of the velocity command: S-0-0038, S-0-0039 and S-0-0091 together.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct VelocityLimits {
    /// Highest velocity, 0 or more.
    pub positive: Velocity,
    /// Lowest velocity, 0 or less.
    pub negative: Velocity,
    /// What sets the highest velocity.
    pub positive_cause: Limiting,
    /// What sets the lowest velocity.
    pub negative_cause: Limiting,
}

impl VelocityLimits {
    /// The narrower of the limits for each sign. `bipolar` is S-0-0091 with S-0-0113; `positive` S-0-0038, of which a negative value counts as
    /// zero; `negative` S-0-0039, of which a positive value counts as zero. `None`: not set.
    #[must_use]
    pub fn new(bipolar: Velocity, positive: Option<Velocity>, negative: Option<Velocity>) -> Self {
        let bipolar = bipolar.abs();
        let positive = positive.map(|limit| limit.max(Velocity::ZERO)).filter(|limit| *limit < bipolar);
        let negative = negative.map(|limit| limit.min(Velocity::ZERO)).filter(|limit| *limit > -bipolar);
        Self {
            positive: positive.unwrap_or(bipolar),
            negative: negative.unwrap_or(-bipolar),
            positive_cause: positive.map_or(Limiting::VELOCITY_BIPOLAR, |_| Limiting::VELOCITY_POSITIVE),
            negative_cause: negative.map_or(Limiting::VELOCITY_BIPOLAR, |_| Limiting::VELOCITY_NEGATIVE),
        }
    }

    /// What is in force instead of `before` on the way to these limits: wider at once, narrower at once for an axis that is slower, and by
    /// `step` at a time below the measured velocity of one that is faster. To be asked once in the time of a step.
    #[must_use]
    pub fn approached(self, before: &Self, measured: Velocity, step: Velocity) -> Self {
        let mut limits = self;
        if self.positive < before.positive {
            limits.positive = self.positive.max(before.positive.min(measured) - step);
        }
        if self.negative > before.negative {
            limits.negative = self.negative.min(before.negative.max(measured) + step);
        }
        limits
    }

    /// The same limits for velocity data that count against the motor: each end limits the other direction, and keeps its name.
    #[must_use]
    pub fn reversed(self) -> Self {
        Self {
            positive: -self.negative,
            negative: -self.positive,
            positive_cause: self.negative_cause,
            negative_cause: self.positive_cause,
        }
    }

    /// `velocity` within the limits.
    #[inline]
    #[must_use]
    pub fn limit(&self, velocity: Velocity) -> Velocity {
        velocity.min(self.positive).max(self.negative)
    }

    /// `velocity` within the limits, and which of them it meets; none when it is within.
    #[inline]
    #[must_use]
    pub fn apply(&self, velocity: Velocity) -> (Velocity, Limiting) {
        if self.negative < velocity && velocity < self.positive {
            return (velocity, Limiting::empty());
        }
        self.nearest(velocity)
    }

    /// The limit that a velocity meets or passes.
    #[cold]
    #[inline(never)]
    fn nearest(&self, velocity: Velocity) -> (Velocity, Limiting) {
        if velocity >= self.positive {
            (self.positive, self.positive_cause)
        } else {
            (self.negative, self.negative_cause)
        }
    }

    /// Which limit this velocity meets; none when it is within.
    #[inline]
    #[must_use]
    pub fn met_by(&self, velocity: Velocity) -> Limiting {
        if velocity >= self.positive {
            self.positive_cause
        } else if velocity <= self.negative {
            self.negative_cause
        } else {
            Limiting::empty()
        }
    }

    /// The larger of the two magnitudes.
    #[must_use]
    pub fn largest(&self) -> Velocity {
        self.positive.max(self.negative.abs())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Amplifier and motor of 20 A.
    const PARAMETERS: TorqueLimitParameters = TorqueLimitParameters {
        commanded: CommandedTorqueLimits {
            positive: CurrentFraction::MAX,
            negative: CurrentFraction::MIN,
            bipolar: CurrentFraction::MAX,
            reversed: false,
        },
        motor_peak: 20_000,
        amplifier_peak: 20_000,
    };

    fn with(positive: f64, negative: f64, bipolar: f64) -> TorqueLimitParameters {
        let [positive, negative, bipolar] = [positive, negative, bipolar].map(CurrentFraction::saturating_from_num);
        TorqueLimitParameters {
            commanded: CommandedTorqueLimits { positive, negative, bipolar, reversed: false },
            ..PARAMETERS
        }
    }

    fn limits(parameters: TorqueLimitParameters) -> TorqueLimits {
        TorqueLimitSettings::new(&parameters).unwrap().combine(CurrentFraction::MAX, CurrentFraction::MAX)
    }

    fn near(current: CurrentFraction, expected: f64) -> bool {
        (current.to_num::<f64>() - expected).abs() <= 0.000_04
    }

    #[test]
    fn a_limit_that_is_as_wide_as_the_one_in_force_changes_nothing_and_not_its_name() {
        let [wide, equal, narrow] = [150, 100, 50].map(CurrentFraction::from_bits);
        let limits = TorqueLimits::symmetrical(equal, Limiting::MOTOR_PEAK);
        for magnitude in [wide, equal] {
            assert_eq!(limits.narrowed(magnitude, Limiting::MOTOR_LOAD), limits);
            for current in [magnitude, -magnitude] {
                assert_eq!(limits.narrowed_on_one_side(current, Limiting::MOTOR_LOAD), limits);
            }
        }
        assert_eq!(
            limits.narrowed(narrow, Limiting::MOTOR_LOAD),
            TorqueLimits::symmetrical(narrow, Limiting::MOTOR_LOAD)
        );
        let positive = limits.narrowed_on_one_side(narrow, Limiting::MOTOR_LOAD);
        assert_eq!((positive.positive, positive.negative), (narrow, -equal));
        assert_eq!((positive.positive_cause, positive.negative_cause), (Limiting::MOTOR_LOAD, Limiting::MOTOR_PEAK));
        let negative = limits.narrowed_on_one_side(-narrow, Limiting::MOTOR_LOAD);
        assert_eq!((negative.positive, negative.negative), (equal, -narrow));
    }

    #[test]
    fn a_value_at_its_limit_meets_it_and_is_within_it() {
        let limit = CurrentFraction::from_bits(100);
        let torque = TorqueLimits {
            positive: limit,
            negative: -limit,
            positive_cause: Limiting::TORQUE_POSITIVE,
            negative_cause: Limiting::TORQUE_NEGATIVE,
        };
        for (bits, met, applied) in [
            (99, Limiting::empty(), Limiting::empty()),
            (100, Limiting::TORQUE_POSITIVE, Limiting::empty()),
            (101, Limiting::TORQUE_POSITIVE, Limiting::TORQUE_POSITIVE),
            (-99, Limiting::empty(), Limiting::empty()),
            (-100, Limiting::TORQUE_NEGATIVE, Limiting::empty()),
            (-101, Limiting::TORQUE_NEGATIVE, Limiting::TORQUE_NEGATIVE),
        ] {
            let current = CurrentFraction::from_bits(bits);
            assert_eq!(torque.met_by(current), met, "{bits}");
            assert_eq!(torque.apply(current), (current.min(limit).max(-limit), applied), "{bits}");
        }
        let limit = Velocity::from_bits(100);
        let velocity = VelocityLimits::new(Velocity::from_bits(500), Some(limit), Some(-limit));
        assert_eq!(velocity.apply(limit), (limit, Limiting::VELOCITY_POSITIVE));
        assert_eq!(velocity.apply(-limit), (-limit, Limiting::VELOCITY_NEGATIVE));
    }

    #[test]
    fn each_limit_can_be_the_smallest_and_is_named() {
        for (parameters, positive, positive_cause, negative, negative_cause) in [
            (PARAMETERS, 1.0, Limiting::AMPLIFIER_PEAK, -1.0, Limiting::AMPLIFIER_PEAK),
            (
                TorqueLimitParameters { motor_peak: 15_000, ..PARAMETERS },
                0.75,
                Limiting::MOTOR_PEAK,
                -0.75,
                Limiting::MOTOR_PEAK,
            ),
            (with(1.0, -1.0, 0.5), 0.5, Limiting::TORQUE_BIPOLAR, -0.5, Limiting::TORQUE_BIPOLAR),
            (with(0.25, -1.0, 1.0), 0.25, Limiting::TORQUE_POSITIVE, -1.0, Limiting::AMPLIFIER_PEAK),
            (
                TorqueLimitParameters { motor_peak: 15_000, ..with(1.0, -0.15, 1.0) },
                0.75,
                Limiting::MOTOR_PEAK,
                -0.15,
                Limiting::TORQUE_NEGATIVE,
            ),
            (with(-0.1, 0.1, 1.0), 0.0, Limiting::TORQUE_POSITIVE, 0.0, Limiting::TORQUE_NEGATIVE),
            (with(1.0, -1.0, -0.1), 0.0, Limiting::TORQUE_BIPOLAR, 0.0, Limiting::TORQUE_BIPOLAR),
        ] {
            let limits = limits(parameters);
            assert!(near(limits.positive, positive) && near(limits.negative, negative), "{limits:?}");
            assert_eq!((limits.positive_cause, limits.negative_cause), (positive_cause, negative_cause));
        }
    }

    #[test]
    fn other_limits_of_the_control_replace_those_before_them_and_leave_the_peak_currents() {
        let narrow = TorqueLimitSettings::new(&TorqueLimitParameters { motor_peak: 15_000, ..with(0.1, -0.1, 0.1) });
        let wide = TorqueLimitSettings::new(&TorqueLimitParameters { motor_peak: 15_000, ..PARAMETERS }).unwrap();
        assert_eq!(narrow.unwrap().with_commanded(&PARAMETERS.commanded), wide);
    }

    #[test]
    fn what_one_sign_leaves_narrows_that_sign_only_and_widens_nothing() {
        let wide = limits(with(0.5, -0.5, 1.0));
        let narrow = wide.narrowed_on_one_side(CurrentFraction::from_num(0.2), Limiting::VOLTAGE);
        assert_eq!((narrow.positive, narrow.positive_cause), (CurrentFraction::from_num(0.2), Limiting::VOLTAGE));
        assert_eq!((narrow.negative, narrow.negative_cause), (wide.negative, Limiting::TORQUE_NEGATIVE));
        let narrow = wide.narrowed_on_one_side(CurrentFraction::from_num(-0.2), Limiting::VOLTAGE);
        assert_eq!((narrow.negative, narrow.negative_cause), (CurrentFraction::from_num(-0.2), Limiting::VOLTAGE));
        assert_eq!((narrow.positive, narrow.positive_cause), (wide.positive, Limiting::TORQUE_POSITIVE));
        for beyond in [0.6, -0.6] {
            assert_eq!(wide.narrowed_on_one_side(CurrentFraction::from_num(beyond), Limiting::VOLTAGE), wide);
        }
    }

    #[test]
    fn the_foldback_of_motor_and_amplifier_limits_both_signs_and_is_named() {
        let settings = TorqueLimitSettings::new(&with(0.25, -1.0, 1.0)).unwrap();
        let (half, fifth) = (CurrentFraction::from_num(0.5), CurrentFraction::from_num(0.2));
        let motor = settings.combine(half, CurrentFraction::MAX);
        assert_eq!((motor.negative, motor.negative_cause), (-half, Limiting::MOTOR_LOAD));
        assert_eq!(motor.positive_cause, Limiting::TORQUE_POSITIVE, "which is smaller");
        let amplifier = settings.combine(half, fifth);
        assert_eq!((amplifier.negative, amplifier.negative_cause), (-fifth, Limiting::AMPLIFIER_LOAD));
        assert_eq!((amplifier.positive, amplifier.positive_cause), (fifth, Limiting::AMPLIFIER_LOAD));
    }

    #[test]
    fn a_current_within_the_limits_passes_and_names_none() {
        let limits = limits(with(1.0, -0.15, 0.5));
        let apply = |current: f64| limits.apply(CurrentFraction::from_num(current));
        assert_eq!(apply(0.49), (CurrentFraction::from_num(0.49), Limiting::empty()));
        assert_eq!(apply(-0.14), (CurrentFraction::from_num(-0.14), Limiting::empty()));
        assert_eq!(apply(0.6), (limits.positive, Limiting::TORQUE_BIPOLAR));
        assert_eq!(apply(-0.6), (limits.negative, Limiting::TORQUE_NEGATIVE));
    }

    #[test]
    fn impossible_settings_are_refused() {
        assert!(TorqueLimitSettings::new(&TorqueLimitParameters { amplifier_peak: 0, ..PARAMETERS }).is_err());
        assert!(TorqueLimitSettings::new(&TorqueLimitParameters { motor_peak: 0, ..PARAMETERS }).is_ok(), "no torque");
    }

    #[test]
    fn the_flags_have_a_bit_each() {
        assert_eq!(Limiting::all().bits(), u16::MAX);
        assert_eq!(Limiting::all().iter().count(), 16);
    }

    proptest! {
        #[test]
        fn the_limits_are_the_smallest_of_all(
            positive in any::<i16>(), negative in any::<i16>(), bipolar in any::<i16>(), motor_peak in 0_u32..500_000,
            amplifier_peak in 1_u32..500_000, motor in 0_i16.., amplifier in 0_i16.., command in any::<i16>(),
        ) {
            let [commanded_positive, commanded_negative, commanded_bipolar] =
                [positive, negative, bipolar].map(CurrentFraction::from_bits);
            let commanded = CommandedTorqueLimits {
                positive: commanded_positive, negative: commanded_negative, bipolar: commanded_bipolar,
                reversed: false,
            };
            let settings =
                TorqueLimitSettings::new(&TorqueLimitParameters { commanded, motor_peak, amplifier_peak }).unwrap();
            let limits = settings.combine(CurrentFraction::from_bits(motor), CurrentFraction::from_bits(amplifier));
            let of_peak = |bits: i16| f64::from(bits.max(0)) / 32_768.0;
            let common = [
                f64::from(motor_peak) / f64::from(amplifier_peak), of_peak(bipolar), of_peak(motor), of_peak(amplifier),
            ].into_iter().fold(1.0, f64::min);
            let expected = common.min(of_peak(positive));
            prop_assert!(near(limits.positive, expected), "{:?} {}", limits, expected);
            let expected = common.min(of_peak(negative.saturating_neg()));
            prop_assert!(near(limits.negative, -expected), "{:?} {}", limits, expected);

            let (current, limiting) = limits.apply(CurrentFraction::from_bits(command));
            prop_assert!(limits.negative <= current && current <= limits.positive);
            prop_assert_eq!(limiting.is_empty(), current.to_bits() == command);
        }
    }

    #[test]
    fn a_narrower_velocity_limit_takes_an_axis_that_is_faster_along_step_by_step() {
        let rpm = |value: i32| Velocity::from_ten_thousandths_rpm(value * 10_000);
        let [wide, narrow] = [3_000, 100].map(|limit| VelocityLimits::new(rpm(limit), None, None));
        let near = |velocity: Velocity, expected: i32| (velocity - rpm(expected)).abs() < Velocity::from_bits(100);
        // 130 rpm forwards: the other direction is narrow at once.
        let first = narrow.approached(&wide, rpm(130), rpm(10));
        assert!(near(first.positive, 120) && near(first.negative, -100), "{first:?}");
        // The axis lags behind, which holds nothing up.
        let second = narrow.approached(&first, rpm(128), rpm(10));
        assert!(near(second.positive, 110), "{second:?}");
        let third = narrow.approached(&second, rpm(121), rpm(10));
        assert_eq!(narrow.approached(&third, rpm(115), rpm(10)), narrow);
        assert_eq!(narrow.approached(&wide, rpm(99), rpm(10)), narrow, "nothing is faster");
        assert_eq!(wide.approached(&narrow, rpm(100), rpm(10)), wide, "wider at once");
        let backwards = narrow.approached(&wide, rpm(-500), rpm(10));
        assert!(near(backwards.positive, 100) && near(backwards.negative, -490), "{backwards:?}");
    }

    #[test]
    fn a_reversed_limit_keeps_its_name_and_changes_its_direction() {
        let rpm = |value: i32| Velocity::from_ten_thousandths_rpm(value * 10_000);
        let limits = VelocityLimits::new(rpm(3_000), Some(rpm(1_000)), None).reversed();
        assert_eq!(limits.apply(rpm(-2_000)), (rpm(-1_000), Limiting::VELOCITY_POSITIVE));
        assert_eq!(limits.apply(rpm(4_000)), (rpm(3_000), Limiting::VELOCITY_BIPOLAR));
        assert_eq!(limits.reversed(), VelocityLimits::new(rpm(3_000), Some(rpm(1_000)), None));

        let most = CurrentFraction::MAX;
        let mut parameters = with(0.125, -1.0, 1.0);
        let plain = TorqueLimitSettings::new(&parameters).unwrap().combine(most, most);
        parameters.commanded.reversed = true;
        let reversed = TorqueLimitSettings::new(&parameters).unwrap().combine(most, most);
        assert_eq!((reversed.negative, reversed.negative_cause), (-plain.positive, Limiting::TORQUE_POSITIVE));
        assert_eq!((reversed.positive, reversed.positive_cause), (-plain.negative, plain.negative_cause));
    }

    #[test]
    fn the_narrower_velocity_limit_of_each_sign_counts_and_is_named() {
        let rpm = |value: i32| Velocity::from_ten_thousandths_rpm(value * 10_000);
        let limits = VelocityLimits::new(rpm(3_000), Some(rpm(1_000)), Some(rpm(-5_000)));
        assert_eq!((limits.positive, limits.negative), (rpm(1_000), rpm(-3_000)));
        assert_eq!(limits.limit(rpm(2_000)), rpm(1_000));
        assert_eq!(limits.apply(rpm(2_000)), (rpm(1_000), Limiting::VELOCITY_POSITIVE));
        assert_eq!(limits.apply(rpm(-4_000)), (rpm(-3_000), Limiting::VELOCITY_BIPOLAR));
        assert_eq!(limits.apply(rpm(-2_999)), (rpm(-2_999), Limiting::empty()));
        assert_eq!(limits.met_by(rpm(1_000)), Limiting::VELOCITY_POSITIVE);
        assert_eq!(limits.met_by(rpm(-3_000)), Limiting::VELOCITY_BIPOLAR);
        assert_eq!(limits.met_by(rpm(-2_999)), Limiting::empty());
        assert_eq!(limits.largest(), rpm(3_000));
        let shut = VelocityLimits::new(rpm(3_000), Some(rpm(-1)), Some(rpm(1)));
        assert_eq!((shut.positive, shut.negative), (Velocity::ZERO, Velocity::ZERO), "a limit of the wrong sign shuts");
    }
}
