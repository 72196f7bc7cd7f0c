//! An angle that never loses resolution.

/// The largest whole number up to a value of less than 2^53: what [`f64::floor`] gives, which is a call of the C library wherever the processor is
/// not known to have an instruction for it, and there are half a dozen in every step.
pub(crate) fn floor(value: f64) -> i64 {
    let towards_zero = value as i64;
    towards_zero.saturating_sub(i64::from(towards_zero as f64 > value))
}

/// Whole revolutions and the rest, 0 ..= 1 revolution: as fine after a year of turning as at the start.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Turn {
    pub(crate) whole: i64,
    pub(crate) part: f64,
}

impl Turn {
    /// The middle of an encoder's first increment: where a machine stands at time zero.
    pub(crate) fn start(resolution: u32) -> Self {
        Self { whole: 0, part: 0.5 / f64::from(resolution) }
    }

    /// This angle and `travel` revolutions.
    #[must_use]
    pub(crate) fn after(self, travel: f64) -> Self {
        let part = self.part + travel;
        let whole = floor(part);
        Self { whole: self.whole + whole, part: part - whole as f64 }
    }

    /// Revolutions since the start.
    pub(crate) fn since_start(self, resolution: u32) -> f64 {
        self.whole as f64 + (self.part - 0.5 / f64::from(resolution))
    }

    /// What a counter of `resolution` increments per revolution counts from angle zero to here: quantised down, wrapping at 2^32.
    pub(crate) fn count(self, resolution: u32) -> u32 {
        let increments = floor(self.part * f64::from(resolution));
        self.whole.wrapping_mul(i64::from(resolution)).wrapping_add(increments) as u32
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_largest_whole_number_is_that_of_the_library() {
        let mut value = -1_000.0_f64;
        while value < 1_000.0 {
            for value in [value, value.round(), value.round().next_up(), value.round().next_down(), value * 1e12] {
                assert_eq!(floor(value), value.floor() as i64, "{value}");
            }
            value += 0.37;
        }
        assert_eq!((floor(-0.0), floor(f64::MIN_POSITIVE), floor(-f64::MIN_POSITIVE)), (0, 0, -1));
    }
}
