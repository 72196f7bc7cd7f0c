//! What an increment of torque data is at the motor (S-0-0086, sercos2.md 6.5): a current.

use sercos::Idn;
use sercos::parameters::Parameters;
use sercos::unit::Dimension;
use sercos::weighting::Kind;
use servo::SettingsError;
use servo::arithmetic::Gain;
use servo::units::CurrentFraction;

use super::invalid::InvalidSetting;
use super::scaling::{FEED_EXPONENT, Ratio, TWO_PI, decimal, feed, gear, weighting};

/// Torque data as currents, and back.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct TorqueScale {
    /// From an increment to a fraction of the peak current (2^-15).
    to_fraction: Gain,
    /// From a fraction of the peak current (2^-15) to increments.
    from_fraction: Gain,
    /// mA RMS in an increment.
    milliamperes: Ratio,
}

impl TorqueScale {
    /// Divides.
    ///
    /// # Errors
    /// S-0-0086 where it names a scaling that the drive does not have; P-0-0114 of 0, of which nothing makes newton metres;
    /// S-0-0094 (S-0-0111 with per cent) for an increment that the current cannot represent.
    pub(crate) fn new(parameters: &Parameters) -> Result<Self, InvalidSetting> {
        let (milliamperes, culprit) = milliamperes(parameters)?;
        let reason = Some(SettingsError::TorqueScaleOutOfRange);
        let out_of_range = InvalidSetting { idn: Idn::standard(culprit), reason };
        let milliamperes = milliamperes.ok_or(out_of_range)?;
        let peak: u128 = parameters.get(Idn::standard(110)).into();
        let increment = u128::from(milliamperes.numerator) << 15;
        let peak = u128::from(milliamperes.denominator).saturating_mul(peak);
        // The whole peak in one increment, or nothing in all that two bytes hold.
        if increment > peak << 15 || increment.saturating_mul(i16::MAX as u128) < peak {
            return Err(out_of_range);
        }
        Ok(Self {
            to_fraction: Gain::from_ratio(increment, peak).ok_or(out_of_range)?,
            from_fraction: Gain::from_ratio(peak, increment).ok_or(out_of_range)?,
            milliamperes,
        })
    }

    /// The current that makes the torque of so many increments, limited to the peak current.
    #[inline]
    #[must_use]
    pub fn current_of(&self, increments: i64) -> CurrentFraction {
        let fraction = self.to_fraction.apply(increments);
        CurrentFraction::from_bits(fraction.clamp(-MOST_CURRENT, MOST_CURRENT) as i16)
    }

    /// Increments of the torque that a current makes.
    #[inline]
    #[must_use]
    pub fn increments_of(&self, current: CurrentFraction) -> i64 {
        self.from_fraction.apply(i64::from(current.to_bits()))
    }

    /// The magnitude of so many increments as a fraction of the peak current (2^-15), also beyond it.
    pub(super) fn threshold(&self, increments: u16) -> u32 {
        u32::try_from(self.to_fraction.apply(increments.into())).unwrap_or(u32::MAX)
    }

    /// Increments that are nearest to so many mA RMS. Divides.
    pub(crate) fn increments(&self, milliamperes: u32) -> u32 {
        let Ratio { numerator, denominator } = self.milliamperes;
        let scaled =
            u128::from(milliamperes).saturating_mul(denominator.into()).saturating_add(u128::from(numerator) / 2);
        let increments = scaled.checked_div(numerator.into()).unwrap_or(u128::MAX);
        u32::try_from(increments).unwrap_or(u32::MAX)
    }

    /// mA RMS of so many increments. Divides.
    pub(crate) fn milliamperes(&self, increments: u16) -> u32 {
        let scaled = u128::from(increments).saturating_mul(self.milliamperes.numerator.into());
        let scaled = scaled.checked_div(self.milliamperes.denominator.into()).unwrap_or(u128::MAX);
        u32::try_from(scaled).unwrap_or(u32::MAX)
    }
}

/// Largest current fraction, in 2^-15.
const MOST_CURRENT: i64 = i16::MAX as i64;

/// mA RMS in an increment, and the parameter to blame if they are too many or too few.
pub(super) fn milliamperes(parameters: &Parameters) -> Result<(Option<Ratio>, u16), InvalidSetting> {
    let weighting = weighting(Dimension::Torque, parameters)?;
    let (factor, exponent) = decimal(&weighting, 86)?;
    let increment = Ratio::new(factor, 1).times_ten_to(exponent);
    if weighting.kind == Kind::Percent {
        const PERCENT: u64 = 100;
        let stall: u64 = parameters.get(Idn::standard(111)).into();
        return Ok((increment.and_then(|ratio| ratio.times(stall)?.over(PERCENT)), 111));
    }
    let newton_metres = match weighting.kind {
        Kind::Linear => increment
            .and_then(|ratio| ratio.times(feed(parameters)))
            .and_then(|ratio| ratio.times_ten_to(FEED_EXPONENT))
            .and_then(|ratio| ratio.over(TWO_PI.numerator)?.times(TWO_PI.denominator)),
        _ => increment,
    };
    let at_motor = newton_metres.and_then(|ratio| match weighting.at_load {
        // The torque of the load is that of the motor by S-0-0121 to S-0-0122.
        true => ratio.times(gear(parameters, 122))?.over(gear(parameters, 121)),
        false => Some(ratio),
    });
    // In 10^-6 Nm/A, and the current in 10^-3 A; both RMS, as S-0-0110 and S-0-0111 are.
    let torque_constant: u64 = parameters.get(Idn::product(114)).into();
    if torque_constant == 0 {
        let reason = Some(SettingsError::Zero { parameter: "torque constant P-0-0114" });
        return Err(InvalidSetting { idn: Idn::product(114), reason });
    }
    let current = at_motor.and_then(|ratio| ratio.times_ten_to(9)?.over(torque_constant));
    Ok((current, 94))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn with(changes: &[(Idn, i32)]) -> Parameters {
        let mut parameters = crate::service::rig::parameters();
        for &(idn, value) in changes {
            parameters.set(idn, (value as u32).into()).unwrap();
        }
        parameters
    }

    const S: fn(u16) -> Idn = Idn::standard;
    const P: fn(u16) -> Idn = Idn::product;

    /// mA for a thousand increments, of the default motor: 1.131371 Nm/A.
    fn current(changes: &[(Idn, i32)]) -> f64 {
        f64::from(TorqueScale::new(&with(changes)).unwrap().milliamperes(1_000))
    }

    /// Whole mA, cut.
    fn near(value: f64, expected: f64) {
        assert!((-1.0..=0.0).contains(&(value - expected)), "{value} is not {expected}");
    }

    #[test]
    fn a_thousand_increments_are_the_current_that_makes_their_torque() {
        let constant = 1.131_371;
        // 100 % of 3.536 A.
        near(current(&[]), 3_536.0);
        near(current(&[(S(111), 7_321)]), 7_321.0);
        // 10 Nm, 1 Nm, and 0.5 Nm of a weaker motor.
        near(current(&[(S(86), 2)]), 10.0 / constant * 1_000.0);
        near(current(&[(S(86), 0x0A), (S(93), 1), (S(94), -3)]), 1.0 / constant * 1_000.0);
        let weak = 0.09;
        near(current(&[(S(86), 0x0A), (S(93), 5), (S(94), -4), (P(114), 90_000)]), 0.5 / weak * 1_000.0);
        // 1 kN with 10 mm a revolution is 1.59 Nm.
        let newton_metres = 1_000.0 * 0.01 / core::f64::consts::TAU;
        near(current(&[(S(86), 1)]), newton_metres / constant * 1_000.0);
        // The motor turns seven times for three turns of the load.
        let gear = [(S(121), 7), (S(122), 3)];
        near(current(&[(S(86), 0x42), gear[0], gear[1]]), 10.0 * 3.0 / 7.0 / constant * 1_000.0);
        near(current(&[(S(86), 0x02), gear[0], gear[1]]), 10.0 / constant * 1_000.0);
        near(current(&[(S(86), 0x41), gear[0], gear[1]]), newton_metres * 3.0 / 7.0 / constant * 1_000.0);
    }

    #[test]
    fn torques_read_back_under_every_scaling() {
        for changes in [&[][..], &[(S(86), 2)], &[(S(86), 1)], &[(S(86), 0x0A), (S(94), -3)]] {
            let scale = TorqueScale::new(&with(changes)).unwrap();
            // A fraction is 2^-15 of 20 A, which is up to 0.6 increments of 0.001 Nm.
            for increments in [-1_000, -1, 0, 1, 37, 1_000] {
                let back = scale.increments_of(scale.current_of(increments));
                assert!((back - increments).abs() <= 1, "{increments} reads {back} under {changes:?}");
            }
        }
    }

    #[test]
    fn torques_beyond_the_peak_current_are_the_peak_current() {
        let scale = TorqueScale::new(&with(&[(S(86), 0x0A), (S(94), -1)])).unwrap();
        assert_eq!([65_535, -65_535].map(|limit| scale.current_of(limit).to_bits()), [i16::MAX, -i16::MAX]);
        // 4 Nm are 3.536 A, a quarter of 14.142 A.
        let negative = scale.current_of(-40).to_num::<f64>();
        assert!((negative + 0.25).abs() < 5e-5, "{negative}");
    }

    #[test]
    fn what_no_increment_can_be_names_its_parameter_and_the_reason() {
        let refused = |changes: &[(Idn, i32)]| {
            let error = TorqueScale::new(&with(changes)).unwrap_err();
            (error.idn, error.reason)
        };
        for pounds_or_reserved in [0x12, 0x22, 0x82, 3, 8, 0x40, 0x0102] {
            assert_eq!(refused(&[(S(86), pounds_or_reserved)]), (S(86), None), "{pounds_or_reserved:X}");
        }
        let flux = SettingsError::Zero { parameter: "torque constant P-0-0114" };
        assert_eq!(refused(&[(S(86), 2), (P(114), 0)]), (P(114), Some(flux)));
        // 32 767 increments of 10^-12 Nm are nothing; one of 100 Nm is beyond the peak current; the rest is beyond all numbers.
        for exponent in [-32, -12, 2, 32] {
            let out_of_range = SettingsError::TorqueScaleOutOfRange;
            assert_eq!(refused(&[(S(86), 0x0A), (S(94), exponent)]), (S(94), Some(out_of_range)), "{exponent}");
        }
    }
}
