//! Position data of the master and places of the axis: scaling S-0-0076, modulo S-0-0103 and polarity S-0-0055.
//!
//! Inside, a place is an angle of the motor in the direction of positive current. Signs are turned round here, on the way in and out, and the
//! loops know nothing of them. `docs/polarity.md` says which data blocks go this way.

use servo::units::{Modulo, Position, PositionScale};

/// The coordinates in which the master reads S-0-0051.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Coordinates {
    /// Increments.
    pub scale: PositionScale,
    /// The range that the data go round in: S-0-0103, or all values of 32 bits.
    pub range: Modulo,
    /// S-0-0103 in increments, if bit 7 of S-0-0076 says that data are modulo.
    pub modulo: Option<i32>,
    /// S-0-0055 bits 0 and 2: the data count against the motor.
    pub reversed: bool,
}

impl Coordinates {
    /// The place that a data value names. Places that are a range apart have the same.
    #[inline]
    pub fn place(&self, data: i32) -> Position {
        let place = self.scale.to_position(data);
        if self.reversed { -place } else { place }
    }

    /// The data value of a place within `0 ..` range: `0 ..` S-0-0103 of a modulo axis, else all of the 32 bits.
    #[inline]
    pub fn data(&self, within: Position) -> i32 {
        let data = self.scale.from_position(within);
        let Some(modulo) = self.modulo else {
            return if self.reversed { data.wrapping_neg() } else { data };
        };
        // The last half increment is rounded up to the first of the next range.
        let data = if data >= modulo { data.wrapping_sub(modulo) } else { data };
        if self.reversed && data != 0 { modulo.wrapping_sub(data) } else { data }
    }

    /// The data value of a difference of two places; a longer one than data can say is the longest, or it would look small.
    #[inline]
    pub fn difference(&self, difference: Position) -> i32 {
        let difference = if self.reversed { -difference } else { difference };
        let all = self.scale.to_position(i32::MAX);
        if difference >= all {
            i32::MAX
        } else if difference <= -all {
            -i32::MAX
        } else {
            self.scale.from_position(difference)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn absolute(reversed: bool) -> Coordinates {
        Coordinates {
            scale: PositionScale::new(3_600_000, 1).unwrap(),
            range: Modulo::of_all_data(3_600_000, 1).unwrap(),
            modulo: None,
            reversed,
        }
    }

    fn modulo(numerator: u64, denominator: u64, modulo: i32, reversed: bool) -> Option<Coordinates> {
        Some(Coordinates {
            scale: PositionScale::new(numerator, denominator).ok()?,
            range: Modulo::from_ratio(u64::from(modulo.unsigned_abs()) * denominator, numerator).ok()?,
            modulo: Some(modulo),
            reversed,
        })
    }

    proptest! {
        #[test]
        fn absolute_data_read_back_whichever_way_they_count(data in any::<i32>(), reversed in any::<bool>()) {
            let coordinates = absolute(reversed);
            let within = coordinates.range.reduce(coordinates.place(data));
            prop_assert_eq!(coordinates.data(within), data);
        }

        #[test]
        fn modulo_data_read_back_and_are_never_the_modulo_value(
            numerator in 1_u64..1 << 31, denominator in 1_u64..1 << 10, value in 1_i32.., share in 0.0..1.0_f64,
            reversed in any::<bool>(), fine in any::<u64>(),
        ) {
            let Some(coordinates) = modulo(numerator, denominator, value, reversed) else { return Ok(()) };
            let data = ((f64::from(value) * share) as i32).min(value - 1);
            prop_assert_eq!(coordinates.data(coordinates.range.reduce(coordinates.place(data))), data);
            let range = coordinates.range.value().to_bits();
            for within in [0, 1, range / 2, range - 1, (fine % range.unsigned_abs()) as i64] {
                let shown = coordinates.data(Position::from_bits(within));
                prop_assert!((0..value).contains(&shown), "{} of {}", shown, value);
            }
        }

        #[test]
        fn a_difference_reads_as_the_difference_of_the_data(a in any::<i32>(), b in any::<i32>(), reversed in any::<bool>()) {
            let coordinates = absolute(reversed);
            let difference = coordinates.difference(coordinates.place(a) - coordinates.place(b));
            let exact = (i64::from(a) - i64::from(b)).clamp(-i64::from(i32::MAX), i32::MAX.into());
            prop_assert!((i64::from(difference) - exact).abs() <= 1, "{} {}", difference, exact);
        }
    }
}
