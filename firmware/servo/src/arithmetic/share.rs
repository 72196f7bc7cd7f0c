//! A factor from 0 to 1, or up to one and a half.

/// A factor in 2^-32, of which 0 and 1 are exact.
///
/// The low word is taken with a sign, as the processor multiplies; what is then missing of it is the whole value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub(crate) struct Share {
    low_word: i32,
    /// All bits where the value itself is to be added, else none.
    whole: i32,
}

impl Share {
    /// `part / whole`, to the nearest; 1 when the part is the larger one, and without a whole. Divides.
    pub(crate) const fn new(part: u32, whole: u32) -> Self {
        if part >= whole {
            return Self { low_word: 0, whole: -1 };
        }
        let half = whole as u64 >> 1;
        // At most 2^32, when it is rounded up.
        let share = match ((part as u64) << 32).saturating_add(half).checked_div(whole as u64) {
            Some(share) => share.cast_signed(),
            None => 0,
        };
        let low_word = share as i32;
        Self { low_word, whole: if low_word as i64 == share { 0 } else { -1 } }
    }

    /// The same up to below one and a half: what is more than the whole is a share of its own. Divides.
    pub(crate) const fn beyond_whole(part: u32, whole: u32) -> Self {
        if part <= whole {
            return Self::new(part, whole);
        }
        let beyond = Self::new(part.saturating_sub(whole), whole);
        let low_word = if beyond.whole == 0 && beyond.low_word >= 0 { beyond.low_word } else { i32::MAX };
        Self { low_word, whole: -1 }
    }

    /// This share of `value`, to the nearest; of more than the whole it ends at the range.
    #[inline]
    pub(crate) fn of(self, value: i32) -> i32 {
        let product = i64::from(value).wrapping_mul(i64::from(self.low_word)).wrapping_add(1 << 31);
        ((product >> 32) as i32).saturating_add(value & self.whole)
    }

    /// `sum`, in 2^-32, and this share of `value`, exactly; it wraps.
    #[inline]
    pub(crate) fn added_to(self, sum: i64, value: i32) -> i64 {
        let product = i64::from(value).wrapping_mul(i64::from(self.low_word));
        sum.wrapping_add(product).wrapping_add(i64::from(value & self.whole) << 32)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_share_beyond_the_whole_is_exact_to_a_step_and_never_turns_its_sign() {
        for (part, of_a_million) in [(10_000, 1_000_000), (10_001, 1_000_100), (12_000, 1_200_000), (14_999, 1_499_900)]
        {
            let share = Share::beyond_whole(part, 10_000);
            assert!((share.of(1_000_000) - of_a_million).abs() <= 1, "{part}: {}", share.of(1_000_000));
            assert!((share.of(-1_000_000) + of_a_million).abs() <= 1, "{part}");
            assert_eq!((share.of(i32::MAX), share.of(i32::MIN)), (i32::MAX, i32::MIN), "{part}");
        }
        assert_eq!(Share::beyond_whole(7_000, 10_000), Share::new(7_000, 10_000));
    }

    #[test]
    fn nothing_half_and_all_are_exact() {
        for value in [i32::MIN, -5, 0, 1, 5, i32::MAX] {
            assert_eq!(Share::new(0, 7).of(value), 0);
            assert_eq!(i64::from(Share::new(7, 7).of(value)), i64::from(value));
            assert_eq!(i64::from(Share::new(3, 6).of(value)), (i64::from(value) + 1) >> 1);
            assert_eq!(Share::new(7, 7).added_to(9, value), (i64::from(value) << 32) + 9);
        }
        assert_eq!(Share::new(8, 7), Share::new(7, 7));
        assert_eq!(Share::new(0, 0), Share::new(7, 7));
    }

    proptest! {
        #[test]
        fn it_is_the_nearest_to_the_ratio(part in any::<u32>(), more in 0..=u32::MAX, value in any::<i32>()) {
            let whole = part.saturating_add(more).max(1);
            let share = Share::new(part, whole);
            let exact = i128::from(value) * i128::from(part);
            let off = (i128::from(share.of(value)) * i128::from(whole) - exact).abs();
            // Half a step for the product, and half of 2^-32 of at most 2^31 for the factor.
            prop_assert!(off * 4 <= i128::from(whole) * 3, "{} beside {}/{}", off, exact, whole);
            let fine = i128::from(share.added_to(0, value));
            prop_assert!((fine * i128::from(whole) - (exact << 32)).abs() * 2 <= i128::from(whole) * i128::from(value).abs());
        }
    }
}
