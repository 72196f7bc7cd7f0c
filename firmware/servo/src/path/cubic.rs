//! What a smooth path between two commands adds to the straight line between them.

use crate::path::settings::InterpolatorSettings;

/// Bits below a position step: the deviation runs in 2^-56 revolution.
const BITS: u32 = 24;
/// Largest difference of an end's velocity from that of the line, in position steps per cycle: 32 revolutions, twice what
/// [`crate::units::Velocity::MAX`] makes in the longest cycle. Three of them still fit into 64 bits.
const DIFFERENCE_LIMIT: i64 = 1 << 37;

/// A cubic that is zero at both ends of a cycle and has given slopes there, as forward differences: a tick is three additions.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub(crate) struct Deviation {
    value: i64,
    first: i64,
    second: i64,
    third: i64,
}

impl Deviation {
    /// No deviation: the straight line.
    pub(crate) const NONE: Self = Self { value: 0, first: 0, second: 0, third: 0 };

    /// Leaves the line with the velocity `start` relative to it and comes back with `end`, in position steps per cycle.
    #[inline]
    pub(crate) fn between(settings: &InterpolatorSettings, start: i64, end: i64) -> Self {
        let start = start.clamp(-DIFFERENCE_LIMIT, DIFFERENCE_LIMIT) << BITS;
        let end = end.clamp(-DIFFERENCE_LIMIT, DIFFERENCE_LIMIT) << BITS;
        // With u from 0 to 1 over n ticks: start u (1 - u)² - end u² (1 - u) = start u - (2 start + end) u² + (start + end) u³.
        let per_tick = |value| settings.per_tick(value);
        let square = per_tick(per_tick(start.wrapping_mul(2).wrapping_add(end)));
        let cube = per_tick(per_tick(per_tick(start.wrapping_add(end))));
        // The linear part is what closes the curve exactly with these two, whatever they were rounded by.
        let ticks = i64::from(settings.ticks_per_cycle());
        let linear = square.wrapping_sub(cube.wrapping_mul(ticks)).wrapping_mul(ticks);
        Self {
            value: 0,
            first: linear.wrapping_sub(square).wrapping_add(cube),
            second: cube.wrapping_mul(6).wrapping_sub(square.wrapping_mul(2)),
            third: cube.wrapping_mul(6),
        }
    }

    /// One tick further: what this tick moves, in 2^-48 revolution.
    #[inline]
    pub(crate) fn tick(&mut self) -> i64 {
        let step = self.first;
        self.value = self.value.wrapping_add(step);
        self.first = self.first.wrapping_add(self.second);
        self.second = self.second.wrapping_add(self.third);
        step >> (BITS - 16)
    }

    /// Distance from the line in 2^-48 revolution.
    #[inline]
    pub(crate) const fn value(&self) -> i64 {
        self.value >> (BITS - 16)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn it_follows_its_polynomial_and_closes(
            ticks in 4_u16..=520, start in -(1_i64 << 37)..1 << 37, end in -(1_i64 << 37)..1 << 37,
        ) {
            let settings = InterpolatorSettings::new(ticks, None).unwrap();
            let mut deviation = Deviation::between(&settings, start, end);
            for tick in 1..=ticks {
                deviation.tick();
                let u = f64::from(tick) / f64::from(ticks);
                let exact = start as f64 * u * (1.0 - u) * (1.0 - u) - end as f64 * u * u * (1.0 - u);
                let off = deviation.value() as f64 / 65_536.0 - exact;
                // A rounded cube is off by 2^-56 revolution times the ticks cubed.
                prop_assert!(off.abs() < 4.0, "{off} position steps beside it");
            }
            prop_assert_eq!(deviation.value, 0, "ends on the line");
        }
    }

    #[test]
    fn slopes_that_mirror_each_other_make_a_parabola() {
        let settings = InterpolatorSettings::new(4, None).unwrap();
        // Slopes of +16 and -16 against the line leave it by 16 u (1 - u).
        let mut deviation = Deviation::between(&settings, 16, -16);
        let values: [i64; 4] = core::array::from_fn(|_| {
            deviation.tick();
            deviation.value() >> 16
        });
        assert_eq!(values, [3, 4, 3, 0]);
    }
}
