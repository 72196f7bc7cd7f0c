//! Modulo positions (S-0-0103) over an unbounded position.

use crate::error::SettingsError;
use crate::units::Position;

/// A modulo value, in 2^-64 revolution of the motor.
///
/// The modulo of a load behind a gear is rarely a whole number of position steps; the finer unit keeps the error below
/// one position step for 2^32 passages of the modulo point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Modulo {
    /// In 2^-32 revolution.
    whole: i64,
    /// In 2^-64 revolution.
    fraction: u32,
}

impl Modulo {
    /// A modulo of `numerator / denominator` revolutions of the motor, 1/16 to 2^30.
    ///
    /// # Errors
    /// [`SettingsError::Zero`] for a denominator of 0, [`SettingsError::ModuloOutOfRange`] beyond the range.
    pub fn from_ratio(numerator: u64, denominator: u64) -> Result<Self, SettingsError> {
        let steps = (u128::from(numerator) << 64)
            .checked_div(u128::from(denominator))
            .ok_or(SettingsError::Zero { parameter: "modulo denominator" })?;
        if !(1_u128 << 60..=1_u128 << 94).contains(&steps) {
            return Err(SettingsError::ModuloOutOfRange);
        }
        // Range checked; the fraction is cut on purpose.
        Ok(Self { whole: (steps >> 32) as i64, fraction: steps as u32 })
    }

    /// The range of absolute position data of 32 bits, with `numerator / denominator` increments per revolution of the motor: behind the
    /// highest of their 2^32 values comes the lowest. The same ratios as for [`crate::units::PositionScale`].
    ///
    /// # Errors
    /// [`SettingsError::Zero`], or [`SettingsError::PositionScaleOutOfRange`] beyond the range.
    pub fn of_all_data(numerator: u64, denominator: u64) -> Result<Self, SettingsError> {
        // Position steps of 2^32 increments, and what is left in 2^-32 of a step.
        let (steps, numerator) = (u128::from(denominator) << 64, u128::from(numerator));
        let zero = SettingsError::Zero { parameter: "position scale" };
        let whole = steps.checked_div(numerator).filter(|whole| *whole != 0).ok_or(zero)?;
        let rest = steps.checked_rem(numerator).ok_or(zero)? << 32;
        if !(1_u128 << 33..=1_u128 << 62).contains(&whole) {
            return Err(SettingsError::PositionScaleOutOfRange);
        }
        // Range checked; the remainder is below the divisor.
        Ok(Self { whole: whole as i64, fraction: rest.checked_div(numerator).unwrap_or(0) as u32 })
    }

    /// Any position brought into `0 ..` modulo value, for values that come from outside. At most 63 shifts and subtractions, no division;
    /// two compares for a position that is within one range of it.
    #[must_use]
    pub const fn reduce(self, position: Position) -> Position {
        let modulo = self.whole;
        let mut rest = position.to_bits();
        let negative = rest < 0;
        if negative {
            rest = rest.saturating_neg();
        }
        if rest >= modulo {
            let mut shift = modulo.leading_zeros().saturating_sub(1);
            loop {
                let part = modulo.wrapping_shl(shift);
                if rest >= part {
                    rest = rest.wrapping_sub(part);
                }
                if shift == 0 {
                    break;
                }
                shift = shift.wrapping_sub(1);
            }
        }
        Position::from_bits(if negative && rest != 0 { modulo.wrapping_sub(rest) } else { rest })
    }

    /// A position of the range `0 ..` modulo value as one of the range around zero: the upper half becomes negative.
    #[inline]
    #[must_use]
    pub const fn around_zero(self, within: Position) -> Position {
        let bits = within.to_bits();
        Position::from_bits(if bits > self.whole >> 1 { bits.wrapping_sub(self.whole) } else { bits })
    }

    /// The modulo value, cut to whole position steps.
    #[must_use]
    pub const fn value(self) -> Position {
        Position::from_bits(self.whole)
    }
}

/// Most ranges that a counter follows in a call. In a tick of the supervision an axis turns through two of the shortest ranges, 1/16 revolution
/// each, at [`crate::units::Velocity::MAX`]; what is asked for beside the axis, its set-point or the latch of t4, may be ahead of it by as much again.
const FARTHEST: usize = 4;

/// Where the current modulo range begins in the unbounded position.
///
/// Follows the position by a few ranges a call, see `FARTHEST`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct ModuloCounter {
    begin: i64,
    begin_fraction: u32,
}

impl ModuloCounter {
    /// The range that contains `position`. Divides: for changes of settings.
    #[must_use]
    pub fn containing(modulo: &Modulo, position: Position) -> Self {
        let steps = i128::from(modulo.whole).saturating_mul(1 << 32).saturating_add(i128::from(modulo.fraction));
        let fine = i128::from(position.to_bits()).saturating_mul(1 << 32);
        let ranges = fine.checked_div_euclid(steps).unwrap_or(0);
        let begin = ranges.saturating_mul(steps);
        // Whole part and fraction of a number below the position.
        Self { begin: (begin >> 32) as i64, begin_fraction: begin as u32 }
    }

    /// Follows `position` and gives it within the range: `0 ..` modulo value.
    #[inline]
    pub fn wrap(&mut self, modulo: &Modulo, position: Position) -> Position {
        let within = position.to_bits().wrapping_sub(self.begin);
        // A negative one is a large one.
        if within.cast_unsigned() >= modulo.whole.cast_unsigned() {
            return self.step_to(modulo, position);
        }
        Position::from_bits(within)
    }

    /// The position is in another range.
    #[cold]
    #[inline(never)]
    fn step_to(&mut self, modulo: &Modulo, position: Position) -> Position {
        let within = |counter: &Self| position.to_bits().wrapping_sub(counter.begin);
        for _ in 0..FARTHEST {
            if within(self) < 0 {
                self.step_down(modulo);
            } else if within(self) >= modulo.whole {
                let mut next = *self;
                next.step_up(modulo);
                if within(&next) < 0 {
                    break;
                }
                *self = next;
            } else {
                break;
            }
        }
        Position::from_bits(within(self))
    }

    /// The unbounded position nearest to `reference` that `command` names, following the ranges.
    #[inline]
    pub(crate) fn unwrap_nearest(&mut self, modulo: &Modulo, command: Position, reference: Position) -> Position {
        let distance = command.to_bits().wrapping_add(self.begin).wrapping_sub(reference.to_bits());
        if distance.unsigned_abs() > modulo.whole.cast_unsigned() >> 1 {
            self.step_towards(modulo, distance);
        }
        Position::from_bits(command.to_bits().wrapping_add(self.begin))
    }

    /// The command is in the next range, or in the one before.
    #[cold]
    #[inline(never)]
    fn step_towards(&mut self, modulo: &Modulo, distance: i64) {
        if distance > 0 {
            self.step_down(modulo);
        } else {
            self.step_up(modulo);
        }
    }

    #[inline]
    fn step_up(&mut self, modulo: &Modulo) {
        let (fraction, carry) = self.begin_fraction.overflowing_add(modulo.fraction);
        self.begin_fraction = fraction;
        self.begin = self.begin.wrapping_add(modulo.whole).wrapping_add(i64::from(carry));
    }

    #[inline]
    fn step_down(&mut self, modulo: &Modulo) {
        let (fraction, borrow) = self.begin_fraction.overflowing_sub(modulo.fraction);
        self.begin_fraction = fraction;
        self.begin = self.begin.wrapping_sub(modulo.whole).wrapping_sub(i64::from(borrow));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn every_position_is_reduced_to_its_place_in_the_range(
            position in any::<i64>(),
            numerator in 1_u64..1 << 20,
            denominator in 1_u64..1 << 10,
        ) {
            let Ok(modulo) = Modulo::from_ratio(numerator, denominator) else { return Ok(()) };
            let reduced = modulo.reduce(Position::from_bits(position)).to_bits();
            // The most negative position has no counterpart and is one step off.
            let expected = position.max(-i64::MAX).rem_euclid(modulo.value().to_bits());
            prop_assert_eq!(reduced, expected);
        }
    }

    #[test]
    fn absolute_data_have_the_range_of_their_32_bits_in_every_scaling() {
        assert_eq!(Modulo::of_all_data(1 << 20, 1).unwrap(), Modulo::from_ratio(1 << 12, 1).unwrap());
        assert_eq!(Modulo::of_all_data(3_600_000, 1).unwrap(), Modulo::from_ratio(1 << 32, 3_600_000).unwrap());
        assert_eq!(Modulo::of_all_data(360, 7).unwrap(), Modulo::from_ratio(7 << 32, 360).unwrap());
        assert_eq!(Modulo::of_all_data(4, 1).unwrap().value().to_bits(), 1 << 62);
        for (numerator, denominator) in [(3, 1), (1 << 32, 1)] {
            let out_of_range = Err(SettingsError::PositionScaleOutOfRange);
            assert_eq!(Modulo::of_all_data(numerator, denominator), out_of_range, "{numerator} / {denominator}");
        }
        for (numerator, denominator) in [(0, 1), (1, 0)] {
            assert!(matches!(Modulo::of_all_data(numerator, denominator), Err(SettingsError::Zero { .. })));
        }
    }

    #[test]
    fn the_upper_half_of_a_range_is_below_zero() {
        let modulo = Modulo::from_ratio(1, 1).unwrap();
        let around_zero = |bits| modulo.around_zero(Position::from_bits(bits)).to_bits();
        assert_eq!([around_zero(0), around_zero(1 << 31), around_zero((1 << 31) + 1)], [0, 1 << 31, 1 - (1 << 31)]);
        assert_eq!(around_zero((1 << 32) - 1), -1);
    }

    #[test]
    fn impossible_values_are_refused() {
        assert_eq!(Modulo::from_ratio(1, 0), Err(SettingsError::Zero { parameter: "modulo denominator" }));
        assert_eq!(Modulo::from_ratio(1, 17), Err(SettingsError::ModuloOutOfRange));
        assert_eq!(Modulo::from_ratio((1 << 30) + 1, 1), Err(SettingsError::ModuloOutOfRange));
        assert_eq!(Modulo::from_ratio(1, 16).unwrap().value(), Position::from_bits(1 << 28));
    }

    #[test]
    fn a_third_of_a_revolution_does_not_drift_in_three_million_ranges() {
        for direction in [1, -1] {
            let modulo = Modulo::from_ratio(1, 3).unwrap();
            let mut counter = ModuloCounter::default();
            for revolution in 1..=1_000_000_i64 {
                for third in 1..=6 {
                    let position = (revolution - 1) * direction * (1 << 32) + direction * third * ((1 << 32) / 6);
                    counter.wrap(&modulo, Position::from_bits(position));
                }
            }
            let wrapped = counter.wrap(&modulo, Position::from_bits(1_000_000 * direction * (1 << 32) + 10));
            assert!((9..=11).contains(&wrapped.to_bits()), "{wrapped:?}");
        }
    }

    #[test]
    fn the_shortest_ranges_at_the_highest_velocity_are_followed_by_a_look_in_a_tick_of_the_supervision() {
        let modulo = Modulo::from_ratio(1, 16).unwrap();
        // In 2^-36 revolution a loop tick.
        let way = (i64::from(crate::units::Velocity::MAX.to_bits()) >> 4)
            * i64::from(crate::units::LOOP_TICKS_PER_SUPERVISION);
        assert!((1 << 28..=2 << 28).contains(&way), "{way}: between one range and two");
        for direction in [1, -1] {
            let mut counter = ModuloCounter::default();
            for look in 1..1_000 {
                let position = direction * look * way;
                counter.wrap(&modulo, Position::from_bits(position));
                // The latch of t4 may be ahead by nearly as much again.
                for ahead in [-way, 0, way] {
                    let position = position + ahead;
                    let within = { counter }.wrap(&modulo, Position::from_bits(position));
                    assert_eq!(within.to_bits(), position.rem_euclid(1 << 28), "look {look}, {ahead} ahead");
                }
            }
        }
    }

    proptest! {
        #[test]
        fn following_in_steps_agrees_with_dividing(
            numerator in 1_u64..1_000, denominator in 1_u64..1_000, start in -(1_i64 << 40)..1 << 40,
            steps in proptest::collection::vec(-0.99_f64..0.99, 1..200),
        ) {
            let Ok(modulo) = Modulo::from_ratio(numerator, denominator) else { return Ok(()) };
            let mut position = start;
            let mut counter = ModuloCounter::containing(&modulo, Position::from_bits(position));
            for step in steps {
                position += (step * modulo.value().to_bits() as f64) as i64;
                let wrapped = counter.wrap(&modulo, Position::from_bits(position));
                prop_assert!(wrapped >= Position::ZERO && wrapped <= modulo.value());
                let direct = ModuloCounter::containing(&modulo, Position::from_bits(position));
                // At the very border, the cut to whole steps may see either range.
                let at_border = wrapped.to_bits() <= 1 || (modulo.value() - wrapped).to_bits() <= 1;
                prop_assert!(counter == direct || at_border);
            }
        }
    }
}
