//! What one increment of position, velocity and acceleration data is at the motor (S-0-0044, 76, 160, sercos2.md 6.5).
//!
//! Data count degrees or metres, at the motor or at the load. The way from one to the other is made of whole numbers:
//! the load turns S-0-0122 revolutions while the motor turns S-0-0121, and moves S-0-0123 a revolution. No public paper
//! says what a linear scaling at a rotary motor's shaft is; here it leaves the gear out and keeps the feed constant.

use sercos::Idn;
use sercos::parameters::Parameters;
use sercos::unit::Dimension;
use sercos::weighting::{Increment, Kind, Weighting};
use servo::SettingsError;
use servo::units::{Acceleration, Jerk, Modulo, PositionScale, VelocityScale};

use crate::coordinates::Coordinates;

use super::invalid::{InvalidSetting, invalid, signed, unsupported};

pub(super) fn position_scale(parameters: &Parameters) -> Result<PositionScale, InvalidSetting> {
    let (increments, culprit) = increments_of_a_revolution(parameters)?;
    PositionScale::new(increments.numerator, increments.denominator).map_err(invalid(culprit))
}

/// Positions of the master. Both of bits 0 and 2 of S-0-0055 turn them round; S-0-0128 refuses one without the other.
pub(super) fn coordinates(parameters: &Parameters) -> Result<Coordinates, InvalidSetting> {
    const COMMAND_AND_FEEDBACK: u16 = 1 << 0 | 1 << 2;
    let reversed = match parameters.get_word(Idn::standard(55)) & COMMAND_AND_FEEDBACK {
        0 => false,
        COMMAND_AND_FEEDBACK => true,
        _ => return Err(unsupported(55)),
    };
    let scale = position_scale(parameters)?;
    let (range, modulo) = match modulo(parameters)? {
        Some(range) => (range, Some(signed(parameters, 103))),
        None => {
            let (increments, culprit) = increments_of_a_revolution(parameters)?;
            (Modulo::of_all_data(increments.numerator, increments.denominator).map_err(invalid(culprit))?, None)
        }
    };
    Ok(Coordinates { scale, range, modulo, reversed })
}

fn modulo(parameters: &Parameters) -> Result<Option<Modulo>, InvalidSetting> {
    if !weighting(Dimension::Position, parameters)?.modulo {
        return Ok(None);
    }
    let (increments, _) = increments_of_a_revolution(parameters)?;
    let revolutions = Ratio::new(parameters.get(Idn::standard(103)).into(), 1)
        .over(increments.numerator)
        .and_then(|ratio| ratio.times(increments.denominator))
        .ok_or(invalid(103)(SettingsError::ModuloOutOfRange))?;
    Modulo::from_ratio(revolutions.numerator, revolutions.denominator).map(Some).map_err(invalid(103))
}

pub(super) fn velocity_scale(parameters: &Parameters) -> Result<VelocityScale, InvalidSetting> {
    let rpm = rpm_of_an_increment(parameters)?;
    VelocityScale::new(rpm.numerator, rpm.denominator).map_err(invalid(45))
}

pub(super) fn rpm_of_an_increment(parameters: &Parameters) -> Result<Ratio, InvalidSetting> {
    let weighting = weighting(Dimension::Velocity, parameters)?;
    let (factor, exponent) = decimal(&weighting, 44)?;
    let velocity = Ratio::new(factor, 1).times(if weighting.per_second { 60 } else { 1 });
    let velocity = if weighting.kind == Kind::Linear {
        velocity
            .and_then(|ratio| ratio.times_ten_to(exponent.saturating_sub(FEED_EXPONENT)))
            .and_then(|ratio| ratio.over(feed(parameters)))
    } else {
        velocity.and_then(|ratio| ratio.times_ten_to(exponent))
    };
    velocity.and_then(|ratio| ratio.over_gear(&weighting, parameters)).ok_or(unsupported(46))
}

/// The scaling of a dimension, or its type as the one to blame.
pub(super) fn weighting(dimension: Dimension, parameters: &Parameters) -> Result<Weighting, InvalidSetting> {
    Weighting::of(dimension, parameters).map_err(|idn| InvalidSetting { idn, reason: None })
}

/// Factor and exponent of an increment that is none of a revolution.
pub(super) fn decimal(weighting: &Weighting, scaling_type: u16) -> Result<(u64, i32), InvalidSetting> {
    match weighting.increment {
        Increment::Decimal { factor, exponent } => Ok((factor.into(), exponent)),
        Increment::OfRevolution(_) => Err(unsupported(scaling_type)),
    }
}

/// Scaling of accelerations (S-0-0160) and of jerks, which have the same increments a second.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub(super) struct DerivativeScale {
    /// Of 10^-3 rad/s² of the motor in an increment.
    pub(super) milliradians: Ratio,
}

impl DerivativeScale {
    pub(super) fn new(parameters: &Parameters) -> Result<Self, InvalidSetting> {
        let weighting = weighting(Dimension::Acceleration, parameters)?;
        let (factor, exponent) = decimal(&weighting, 160)?;
        let of_unit = Ratio::new(factor, 1).times_ten_to(exponent.saturating_add(3));
        let milliradians = if weighting.kind == Kind::Linear {
            of_unit
                .and_then(|ratio| ratio.times_ten_to(FEED_EXPONENT.saturating_neg()))
                .and_then(|ratio| ratio.over(feed(parameters)))
                .and_then(|ratio| ratio.times(TWO_PI.numerator))
                .and_then(|ratio| ratio.over(TWO_PI.denominator))
        } else {
            of_unit
        };
        let at_motor = milliradians.and_then(|ratio| ratio.over_gear(&weighting, parameters));
        at_motor.map(|milliradians| Self { milliradians }).ok_or(unsupported(162))
    }

    /// An acceleration of so many increments.
    pub(super) fn acceleration(self, increments: u32) -> Acceleration {
        Acceleration::from_milliradians_per_second_squared(self.milliradians(increments))
    }

    /// A jerk limit of so many increments; `None` for 0, but not for one that is less than a step: that is too small, and no limit at all
    /// would be the opposite.
    pub(super) fn jerk(self, increments: u32) -> Option<Jerk> {
        let jerk = Jerk::from_milliradians_per_second_cubed(self.milliradians(increments));
        (increments != 0).then(|| Jerk::from_bits(jerk.to_bits().max(1)))
    }

    /// Saturates, and never makes 0 of a value: 0 means "no limit" with some parameters.
    fn milliradians(self, increments: u32) -> u32 {
        let value = u128::from(increments);
        let scaled = value.saturating_mul(self.milliradians.numerator.into());
        let scaled = scaled.checked_div(self.milliradians.denominator.into()).unwrap_or(u128::MAX);
        u32::try_from(scaled.max(value.min(1))).unwrap_or(u32::MAX)
    }
}

/// Position increments of one revolution of the motor, and the parameter to blame if they are too many or too few.
pub(super) fn increments_of_a_revolution(parameters: &Parameters) -> Result<(Ratio, u16), InvalidSetting> {
    let weighting = weighting(Dimension::Position, parameters)?;
    let (increments, culprit) = match weighting.increment {
        Increment::OfRevolution(increments) => (Some(Ratio::new(increments.into(), 1)), 79),
        Increment::Decimal { factor, exponent } => {
            let ratio = Ratio::new(feed(parameters), 1).over(factor.into());
            let ratio = ratio.and_then(|ratio| ratio.times_ten_to(FEED_EXPONENT.saturating_sub(exponent)));
            (ratio, if weighting.by_parameter { 78 } else { 123 })
        }
    };
    let at_motor = |ratio: Ratio| match weighting.at_load {
        true => ratio.times(gear(parameters, 122))?.over(gear(parameters, 121)),
        false => Some(ratio),
    };
    let out_of_range = invalid(culprit)(SettingsError::PositionScaleOutOfRange);
    increments.and_then(at_motor).map(|increments| (increments, culprit)).ok_or(out_of_range)
}

/// Revolutions of the load gear: S-0-0121 at its input, the motor, S-0-0122 at its output, the load.
pub(super) fn gear(parameters: &Parameters, number: u16) -> u64 {
    parameters.get(Idn::standard(number)).into()
}

/// S-0-0123 in its own increments of 10^-7 m a revolution.
pub(super) fn feed(parameters: &Parameters) -> u64 {
    parameters.get(Idn::standard(123)).into()
}

/// A ratio in its lowest terms; `None` from an operation that leaves 64 bits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub(crate) struct Ratio {
    pub(super) numerator: u64,
    pub(super) denominator: u64,
}

impl Ratio {
    pub(super) const fn new(numerator: u64, denominator: u64) -> Self {
        Self { numerator, denominator }
    }

    pub(super) fn times(self, factor: u64) -> Option<Self> {
        let common = greatest_common_divisor(factor, self.denominator);
        Some(Self {
            numerator: self.numerator.checked_mul(factor.checked_div(common)?)?,
            denominator: self.denominator.checked_div(common)?,
        })
    }

    pub(super) fn over(self, divisor: u64) -> Option<Self> {
        let Self { numerator, denominator } = Self::new(self.denominator, self.numerator).times(divisor)?;
        Some(Self::new(denominator, numerator))
    }

    pub(super) const fn inverse(self) -> Self {
        Self::new(self.denominator, self.numerator)
    }

    pub(crate) fn over_ratio(self, divisor: Self) -> Option<Self> {
        self.over(divisor.numerator)?.times(divisor.denominator)
    }

    /// The product with a number, to the nearest. Saturates.
    pub(crate) fn of(self, number: u64) -> u128 {
        let product = u128::from(number).saturating_mul(self.numerator.into());
        let half = u128::from(self.denominator / 2);
        product.saturating_add(half).checked_div(self.denominator.into()).unwrap_or(u128::MAX)
    }

    /// The motor's share of a rate of the load, if bit 6 of the scaling type says that it is the load's.
    fn over_gear(self, weighting: &Weighting, parameters: &Parameters) -> Option<Self> {
        match weighting.at_load {
            true => self.times(gear(parameters, 121))?.over(gear(parameters, 122)),
            false => Some(self),
        }
    }

    pub(super) fn times_ten_to(self, exponent: i32) -> Option<Self> {
        let power = 10_u64.checked_pow(exponent.unsigned_abs())?;
        if exponent < 0 { self.over(power) } else { self.times(power) }
    }
}

/// Zero only for two zeros.
fn greatest_common_divisor(mut larger: u64, mut smaller: u64) -> u64 {
    while let Some(rest) = larger.checked_rem(smaller) {
        larger = smaller;
        smaller = rest;
    }
    larger
}

/// One increment of S-0-0123 is 10^-7 m, and so is the preferred linear position increment.
pub(super) const FEED_EXPONENT: i32 = -7;

/// Radians of a revolution, 8 * 10^-8 of itself too large.
pub(super) const TWO_PI: Ratio = Ratio::new(710, 113);

#[cfg(test)]
mod tests {
    use super::*;
    use servo::units::{Position, Velocity};

    fn with(changes: &[(u16, i32)]) -> Parameters {
        let mut parameters = crate::service::rig::parameters();
        for &(number, value) in changes {
            parameters.set(Idn::standard(number), (value as u32).into()).unwrap();
        }
        parameters
    }

    /// Revolutions of the motor for a million increments, and rpm of the motor for as many.
    fn position(changes: &[(u16, i32)]) -> f64 {
        position_scale(&with(changes)).unwrap().to_position(1_000_000).to_bits() as f64 / 2_f64.powi(32)
    }

    fn velocity(changes: &[(u16, i32)]) -> f64 {
        let one_rpm = f64::from(Velocity::from_ten_thousandths_rpm(10_000_000).to_bits()) / 1_000.0;
        f64::from(velocity_scale(&with(changes)).unwrap().to_velocity(1_000_000).to_bits()) / one_rpm
    }

    /// Accelerations are counted in whole 10^-3 rad/s², which is 4 * 10^-6 of the smallest here.
    fn near(value: f64, expected: f64) {
        assert!((value / expected - 1.0).abs() < 5e-6, "{value} is not {expected}");
    }

    #[test]
    fn a_million_increments_are_what_the_type_says() {
        // The default feed constant is 10 mm a revolution; 1 000 000 preferred increments are 100 mm.
        near(position(&[(76, 1)]), 10.0);
        near(position(&[(76, 1), (123, 250_000)]), 4.0);
        near(position(&[(76, 9), (77, 1), (78, -6)]), 100.0);
        near(position(&[(76, 9), (77, 25), (78, -8)]), 25.0);
        near(position(&[(76, 2)]), 1_000_000.0 / 3_600_000.0);
        near(position(&[(76, 0x0A), (79, 1 << 20)]), 1_000_000.0 / 1_048_576.0);
    }

    #[test]
    fn at_the_load_the_gear_counts_and_at_the_motor_it_does_not() {
        // The motor turns seven times for three turns of the load.
        let gear = [(121, 7), (122, 3)];
        near(position(&[(76, 0x42), gear[0], gear[1]]), 1_000_000.0 / 3_600_000.0 * 7.0 / 3.0);
        near(position(&[(76, 0x02), gear[0], gear[1]]), 1_000_000.0 / 3_600_000.0);
        near(position(&[(76, 0x41), gear[0], gear[1]]), 10.0 * 7.0 / 3.0);
        near(position(&[(76, 0x01), gear[0], gear[1]]), 10.0);
        near(velocity(&[(44, 0x42), gear[0], gear[1]]), 100.0 * 7.0 / 3.0);
        near(velocity(&[(44, 0x02), gear[0], gear[1]]), 100.0);
        near(velocity(&[(44, 0x41), gear[0], gear[1]]), 100.0 * 7.0 / 3.0);
        near(velocity(&[(44, 0x01), gear[0], gear[1]]), 100.0);
    }

    #[test]
    fn a_million_velocity_increments_are_what_the_type_says() {
        // 1 m/min at 10 mm and at 25 mm a revolution.
        near(velocity(&[(44, 1)]), 100.0);
        near(velocity(&[(44, 1), (123, 250_000)]), 40.0);
        // 0.5 um/s and 5 um/min.
        near(velocity(&[(44, 0x29), (45, 5), (46, -7)]), 3_000.0);
        near(velocity(&[(44, 0x09), (45, 5), (46, -6)]), 500.0);
        near(velocity(&[(44, 0x0A), (45, 2), (46, -5)]), 20.0);
        near(velocity(&[(44, 0x22)]), 60.0);
    }

    /// rad/s² of the motor for a million increments of S-0-0138.
    fn acceleration(changes: &[(u16, i32)]) -> f64 {
        f64::from(DerivativeScale::new(&with(changes)).unwrap().milliradians(1_000_000)) / 1_000.0
    }

    #[test]
    fn a_million_acceleration_increments_are_what_the_type_says() {
        let radians_per_metre = std::f64::consts::TAU / 0.01;
        near(acceleration(&[]), 1_000.0);
        near(acceleration(&[(160, 0x0A), (161, 25), (162, -4)]), 2_500.0);
        near(acceleration(&[(160, 1)]), radians_per_metre);
        near(acceleration(&[(160, 1), (123, 250_000)]), radians_per_metre / 2.5);
        near(acceleration(&[(160, 9), (161, 3), (162, -5)]), radians_per_metre * 30.0);
        let gear = [(121, 7), (122, 3)];
        near(acceleration(&[(160, 0x42), gear[0], gear[1]]), 7_000.0 / 3.0);
        near(acceleration(&[(160, 0x41), gear[0], gear[1]]), radians_per_metre * 7.0 / 3.0);
        near(acceleration(&[(160, 0x01), gear[0], gear[1]]), radians_per_metre);
    }

    #[test]
    fn an_acceleration_too_small_to_count_is_not_taken_for_no_limit() {
        let scale = DerivativeScale::new(&with(&[(160, 0x0A), (162, -10)])).unwrap();
        assert_eq!((scale.milliradians(1), scale.milliradians(0)), (1, 0));
        let scale = DerivativeScale::new(&with(&[(160, 0x0A), (162, 9)])).unwrap();
        assert_eq!(scale.milliradians(5), u32::MAX, "as much as there is");
    }

    #[test]
    fn position_and_velocity_of_one_linear_axis_agree() {
        // 0.1 um and 1 um/min: 600 000 000 velocity increments are 100 000 000 position increments a second.
        let gear = [(121, 19), (122, 6), (123, 333_333)];
        let with_type = |number, kind| [(number, kind), gear[0], gear[1], gear[2]];
        near(velocity(&with_type(44, 0x41)), position(&with_type(76, 0x41)) * 10.0);
    }

    #[test]
    fn a_modulo_of_the_load_is_one_of_its_revolutions() {
        let parameters = with(&[(76, 0xC2), (121, 7), (122, 3)]);
        let modulo = modulo(&parameters).unwrap().unwrap();
        assert_eq!(modulo, Modulo::from_ratio(7, 3).unwrap());
        let linear = with(&[(76, 0xC1), (103, 300_000), (121, 7), (122, 3)]);
        assert_eq!(super::modulo(&linear).unwrap().unwrap(), Modulo::from_ratio(7, 1).unwrap());
        let scale = position_scale(&parameters).unwrap();
        assert_eq!(scale.from_position(Position::from_bits(modulo.value().to_bits() / 2)), 1_800_000);
    }

    #[test]
    fn what_no_increment_can_be_names_its_parameter() {
        let position = |changes: &[(u16, i32)]| position_scale(&with(changes)).err().map(|error| error.idn.0);
        let velocity = |changes: &[(u16, i32)]| velocity_scale(&with(changes)).err().map(|error| error.idn.0);
        for inches_reserved_or_none in [0x12, 0x22, 0x11, 0, 3, 8, 0x102] {
            assert_eq!(position(&[(76, inches_reserved_or_none)]), Some(76), "{inches_reserved_or_none:X}");
        }
        for inches_modulo_or_none in [0x12, 0x82, 0x11, 0, 3, 8, 0x21] {
            assert_eq!(velocity(&[(44, inches_modulo_or_none)]), Some(44), "{inches_modulo_or_none:X}");
        }
        let acceleration = |changes: &[(u16, i32)]| DerivativeScale::new(&with(changes)).err().map(|error| error.idn.0);
        for inches_cubes_or_none in [0x12, 0x22, 0x82, 0, 3, 8] {
            assert_eq!(acceleration(&[(160, inches_cubes_or_none)]), Some(160), "{inches_cubes_or_none:X}");
        }
        for exponent in [-32, 32] {
            assert_eq!(acceleration(&[(160, 0x0A), (162, exponent)]), Some(162));
            assert_eq!(position(&[(76, 9), (78, exponent)]), Some(78));
            assert_eq!(velocity(&[(44, 9), (46, exponent)]), Some(46));
        }
        assert_eq!(position(&[(76, 1), (123, 1)]), Some(123), "one increment a revolution");
        assert_eq!(position(&[(76, 0x0A), (79, 1)]), Some(79));
        assert_eq!(position(&[(76, 0x42), (122, -1)]), Some(79), "2^32 - 1 turns of the load for one of the motor");
    }
}
