//! What a cycle of the current loop measured and gave.

use super::settings::CURRENT_BITS;
use crate::units::CurrentFraction;

/// What the current loop measured and gave in its last cycle.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct CurrentReadings {
    /// Flux-producing current, 2^-26 of peak.
    pub direct: i32,
    /// Torque-producing current, 2^-26 of peak.
    pub quadrature: i32,
    /// Voltage of the d axis, volt 2^-14.
    pub direct_voltage: i32,
    /// Voltage of the q axis, volt 2^-14.
    pub quadrature_voltage: i32,
}

impl CurrentReadings {
    /// A current of the loop as a fraction of the peak current, limited to its range.
    #[inline]
    #[must_use]
    pub fn fraction(current: i32) -> CurrentFraction {
        let bits = current.wrapping_add(1 << (CURRENT_BITS - 16)) >> (CURRENT_BITS - 15);
        let bits = bits.clamp(i16::MIN.into(), i16::MAX.into()) as i16;
        // Negated twice, -1 becomes the value beside it: every current has its negative. Cheaper than a limit of its own.
        CurrentFraction::from_bits(bits.saturating_neg().saturating_neg())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_current_is_rounded_to_its_fraction_and_limited_to_the_same_at_both_ends() {
        let bits = |current: i32| CurrentReadings::fraction(current).to_bits();
        assert_eq!([0, 1_023, 1_024, -1_024, -1_025].map(bits), [0, 0, 1, 0, -1]);
        assert_eq!([1 << 26, i32::MAX - 1_024].map(bits), [32_767; 2]);
        assert_eq!([-(32_767 << 11), -(32_768 << 11), -(32_769 << 11), i32::MIN].map(bits), [-32_767; 4]);
    }
}
