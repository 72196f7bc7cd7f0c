//! A smooth path from one command to the next.

use crate::path::settings::InterpolatorSettings;
use crate::units::derivatives::SignedAcceleration;
use crate::units::{Position, Velocity};

/// Bits below a position step: the path runs in 2^-56 revolution.
const BITS: u32 = 24;
/// From there to the bits of a [`Velocity`].
const VELOCITY_BITS: u32 = 20;
/// Cutting to position steps is rounding to the nearest.
const HALF_A_STEP: i64 = 1 << (BITS - 1);
/// Largest difference of an end's velocity from that of the straight line, in position steps per cycle: 32 revolutions, twice what
/// [`crate::units::Velocity::MAX`] makes in the longest cycle. Three of them still fit into 64 bits.
const DIFFERENCE_LIMIT: i64 = 1 << 37;

/// A cubic that ends at the command and has given velocities at both ends of a cycle, as forward differences: a tick is three additions, and
/// velocity and acceleration are what it adds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub(crate) struct Cubic {
    /// From the command, negative before it on the way forwards.
    place: i64,
    first: i64,
    second: i64,
    third: i64,
}

impl Cubic {
    /// At the command, at rest.
    pub(crate) const AT_REST: Self = Self { place: HALF_A_STEP, first: 0, second: 0, third: 0 };

    /// Leads over `distance` (at most 64 revolutions) and is entered and left with these velocities: position steps and position steps per
    /// cycle.
    #[inline]
    pub(crate) fn over(settings: &InterpolatorSettings, distance: i64, entry: i64, exit: i64) -> Self {
        let relative =
            |velocity: i64| velocity.wrapping_sub(distance).clamp(-DIFFERENCE_LIMIT, DIFFERENCE_LIMIT) << BITS;
        let (start, end) = (relative(entry), relative(exit));
        // With u from 0 to 1 over n ticks the path leaves the straight line by
        // start u (1 - u)² - end u² (1 - u) = start u - (2 start + end) u² + (start + end) u³.
        let per_tick = |value| settings.per_tick(value);
        let square = per_tick(per_tick(start.wrapping_mul(2).wrapping_add(end)));
        let cube = per_tick(per_tick(per_tick(start.wrapping_add(end))));
        // The linear part is what leads back to the line exactly with these two, whatever they were rounded by.
        let ticks = i64::from(settings.ticks_per_cycle());
        let linear = square.wrapping_sub(cube.wrapping_mul(ticks)).wrapping_mul(ticks);
        let line = per_tick(distance << BITS);
        Self {
            place: HALF_A_STEP.wrapping_sub(distance << BITS),
            first: line.wrapping_add(linear).wrapping_sub(square).wrapping_add(cube),
            second: cube.wrapping_mul(6).wrapping_sub(square.wrapping_mul(2)),
            third: cube.wrapping_mul(6),
        }
    }

    /// One tick further: the velocity of this tick, and the acceleration at its end.
    #[inline]
    pub(crate) fn tick(&mut self) -> (Velocity, SignedAcceleration) {
        let (moved, gained) = (self.first, self.second);
        self.place = self.place.wrapping_add(moved);
        self.first = moved.wrapping_add(gained);
        self.second = gained.wrapping_add(self.third);
        (velocity(moved), acceleration(gained))
    }

    /// Distance from the command, to the nearest step.
    #[inline]
    pub(crate) const fn place(&self) -> Position {
        Position::from_bits(self.place >> BITS)
    }

    /// The accelerations now and so many ticks further.
    #[inline]
    pub(crate) fn accelerations(&self, ticks: u16) -> [SignedAcceleration; 2] {
        [acceleration(self.second), acceleration(self.second.wrapping_add(self.third.wrapping_mul(ticks.into())))]
    }

    /// Of the last tick, as it was given with it.
    pub(crate) fn last(&self) -> (Velocity, SignedAcceleration) {
        let gained = self.second.wrapping_sub(self.third);
        (velocity(self.first.wrapping_sub(gained)), acceleration(gained))
    }
}

#[inline]
fn velocity(moved: i64) -> Velocity {
    Velocity::saturating_from_bits(moved >> VELOCITY_BITS)
}

#[inline]
fn acceleration(gained: i64) -> SignedAcceleration {
    SignedAcceleration::from_bits(gained >> (BITS - 16))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn it_follows_its_polynomial_and_ends_at_the_command(
            ticks in 4_u16..=520, distance in -(1_i64 << 37)..1 << 37,
            start in -(1_i64 << 37)..1 << 37, end in -(1_i64 << 37)..1 << 37,
        ) {
            let settings = InterpolatorSettings::new(ticks, None).unwrap();
            let mut cubic = Cubic::over(&settings, distance, distance + start, distance + end);
            for tick in 1..=ticks {
                cubic.tick();
                let u = f64::from(tick) / f64::from(ticks);
                let bent = start as f64 * u * (1.0 - u) * (1.0 - u) - end as f64 * u * u * (1.0 - u);
                let exact = distance as f64 * (u - 1.0) + bent;
                let off = (cubic.place - HALF_A_STEP) as f64 / f64::from(1 << BITS) - exact;
                // A rounded cube is off by 2^-56 revolution times the ticks cubed.
                prop_assert!(off.abs() < 4.0, "{off} position steps beside it");
            }
            prop_assert_eq!(cubic.place(), Position::ZERO, "ends at the command");
            // Of half a step less than a hundredth is lost.
            prop_assert!((cubic.place - HALF_A_STEP).abs() < 1 << 16);
        }
    }

    #[test]
    fn slopes_that_mirror_each_other_make_a_parabola() {
        let settings = InterpolatorSettings::new(4, None).unwrap();
        // Slopes of +16 and -16 against the line leave it by 16 u (1 - u).
        let mut cubic = Cubic::over(&settings, 400, 416, 384);
        let values: [i64; 4] = core::array::from_fn(|_| {
            cubic.tick();
            cubic.place().to_bits()
        });
        assert_eq!(values, [-297, -196, -97, 0]);
        // From a tick to the next 2 less, of velocities in 2^-4 and accelerations in 2^-16 steps.
        assert_eq!(cubic.last(), (Velocity::from_bits(97 << 4), SignedAcceleration::from_bits(-2 << 16)));
    }
}
