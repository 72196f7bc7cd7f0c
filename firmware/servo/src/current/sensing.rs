//! Where the current sensors of a board are, and in which periods their samples are true.

use super::modulator::{Counts, FRACTION};
use super::settings::PwmFrequency;

/// How a board measures the phase currents.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CurrentSensing {
    /// Sensors in the lines to the motor: they show the current at every instant.
    InLine,
    /// Shunts in the emitters of the low-side transistors: they show it while these conduct, and are sampled in the middle of that.
    LowSideShunts {
        /// From a step to within 1 % of it, in ns (data sheet of the amplifier, settling time).
        settling: u32,
        /// For which the converter needs the level to stand still, in ns (its sampling time).
        sampling: u32,
    },
}

impl CurrentSensing {
    /// The periods in which shunts can be read: a low side that is on for so short a time that dead time, settling and sampling do not fit between
    /// its turning on and its middle shows nothing. `None`: every sample is true.
    ///
    /// * `dead_time` of the bridge, in ns.
    ///
    /// # Panics
    /// When the shunts are so slow that two phases can be without a true sample at once, at the longest voltage that [`BusScale`] allows. Called for
    /// a constant, as a board does, this is an error of the compiler.
    ///
    /// [`BusScale`]: super::BusScale
    #[must_use]
    #[allow(clippy::arithmetic_side_effects, reason = "small numbers, worked out by the compiler")]
    pub const fn window(self, frequency: PwmFrequency, dead_time: u32) -> Option<ShuntWindow> {
        let Self::LowSideShunts { settling, sampling } = self else { return None };
        let reload = frequency.reload() as u32;
        let needed = counts(dead_time + settling + sampling);
        let compensation = counts(dead_time.div_ceil(2));
        // Between the lowest and the middle phase are at most 3/2 of the longest vector, 0.849 of the bus. With the lowest at zero the middle one is
        // as high as that.
        let middle_phase = reload * 849 / 1_000;
        assert!(
            needed + compensation + middle_phase < reload,
            "the shunts are too slow for this modulation: take a faster amplifier, a lower frequency or sensors in the lines"
        );
        let largest = reload - needed;
        Some(ShuntWindow {
            largest: largest as u16,
            longest: ((largest - compensation) << FRACTION) as i32,
            shortest: (compensation << FRACTION) as i32,
        })
    }
}

/// Timer counts of 168 MHz in so many ns, rounded up.
#[allow(clippy::arithmetic_side_effects, reason = "small numbers, worked out by the compiler")]
const fn counts(nanoseconds: u32) -> u32 {
    (nanoseconds * 168).div_ceil(1_000)
}

/// Which compare values leave a shunt its time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ShuntWindow {
    largest: u16,
    /// What may become as large as that when the dead time is compensated, counts 2^-3.
    longest: i32,
    /// What may be nothing when it is.
    shortest: i32,
}

impl ShuntWindow {
    /// The largest compare value with which a shunt can be read.
    #[must_use]
    pub const fn largest_compare(self) -> u16 {
        self.largest
    }

    /// The same voltage with the three phases lower, by as much as makes all of them readable or the lowest zero. Then at most one is hidden. To be
    /// done before the dead time is compensated: a phase that stays low has none, and one that is nearly low would be given the wrong one.
    #[inline]
    pub(super) fn fit(self, counts: Counts) -> (Counts, Hidden) {
        let [a, b, c] = counts;
        let higher = a.max(b);
        let beyond = higher.max(c).wrapping_sub(self.longest);
        if beyond <= 0 {
            return (counts, Hidden::No);
        }
        let room = a.min(b).min(c);
        let down = if room.wrapping_sub(beyond) < self.shortest { room } else { beyond };
        let hidden = if beyond <= room {
            Hidden::No
        } else if c > higher {
            Hidden::C
        } else if b > a {
            Hidden::B
        } else {
            Hidden::A
        };
        (counts.map(|counts| counts.wrapping_sub(down)), hidden)
    }
}

/// The phase whose shunt shows nothing in a period.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Hidden {
    /// None: all three samples are true.
    #[default]
    No,
    /// The first.
    A,
    /// The second.
    B,
    /// The third.
    C,
}

impl Hidden {
    /// The three currents, the hidden one from the other two. Then they add up to nothing, and say nothing about the sensors.
    #[inline]
    #[must_use]
    pub const fn restore(self, [a, b, c]: [i32; 3]) -> [i32; 3] {
        match self {
            Self::No => [a, b, c],
            Self::A => [b.wrapping_add(c).wrapping_neg(), b, c],
            Self::B => [a, a.wrapping_add(c).wrapping_neg(), c],
            Self::C => [a, b, a.wrapping_add(b).wrapping_neg()],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::modulator::{space_vector, to_compare_value};
    use super::*;

    /// 1.2 us of settling and 15 cycles of 21 MHz.
    const SHUNTS: CurrentSensing = CurrentSensing::LowSideShunts { settling: 1_200, sampling: 714 };
    const RELOAD: i32 = PwmFrequency::Khz16.reload() as i32;

    fn window() -> ShuntWindow {
        SHUNTS.window(PwmFrequency::Khz16, 1_000).unwrap()
    }

    #[test]
    fn the_window_ends_where_dead_time_settling_and_sampling_fit_between_turning_on_and_the_middle_of_the_low_side() {
        // 2.914 us of 31.25 us, 490 counts of 5 250.
        assert_eq!(window().largest_compare(), 5_250 - 490);
        assert_eq!(SHUNTS.window(PwmFrequency::Khz8, 1_000).unwrap().largest_compare(), 10_500 - 490);
        assert_eq!(CurrentSensing::InLine.window(PwmFrequency::Khz16, 1_000), None);
    }

    #[test]
    #[should_panic(expected = "the shunts are too slow for this modulation")]
    fn shunts_that_could_hide_two_phases_at_once_are_refused() {
        let slow = CurrentSensing::LowSideShunts { settling: 2_600, sampling: 714 };
        let _ = slow.window(PwmFrequency::Khz16, 1_000);
    }

    /// Compare values, 2^-3, of vectors all around: a share of the longest in the linear range; and the compensation of a current that lags.
    fn around(share: f64, lag: f64) -> impl Iterator<Item = (Counts, Counts)> {
        let length = share * f64::from(RELOAD << FRACTION) / 3_f64.sqrt();
        (0..3_600).map(move |step| {
            let angle = f64::from(step) * core::f64::consts::TAU / 3_600.0;
            let side = length * angle.sin() * 0.75_f64.sqrt();
            let counts = space_vector((length * angle.cos()) as i32, side as i32, RELOAD << (FRACTION - 1));
            let compensation = core::array::from_fn(|phase| {
                let current = (angle - lag - phase as f64 * core::f64::consts::TAU / 3.0).cos();
                // Half a dead time of 1 us.
                ((current * 20.0).clamp(-1.0, 1.0) * 84.0 * 8.0) as i32
            });
            (counts, compensation)
        })
    }

    #[test]
    fn up_to_the_longest_vector_two_phases_can_be_read_at_every_angle_and_the_voltage_is_the_same() {
        for (share, readable) in [(0.5, 1.0..1.01), (0.87, 1.0..1.01), (0.93 * 0.98, 0.58..0.60), (0.98, 0.17..0.19)] {
            let mut all = 0;
            for lag in [-1.5, -0.5, 0.0, 0.5, 1.5, 3.0] {
                all = 0;
                for (before, compensation) in around(share, lag) {
                    let (after, hidden) = window().fit(before);
                    let down = [0, 1, 2].map(|phase| before[phase] - after[phase]);
                    assert!(down[0] == down[1] && down[1] == down[2] && down[0] >= 0);
                    let lowest = after.iter().copied().min().unwrap();
                    assert!(lowest == 0 || lowest >= 84 << FRACTION || down[0] == 0, "{lowest}");
                    let seen = [0, 1, 2].map(|phase| {
                        to_compare_value(after[phase] + compensation[phase]) <= window().largest_compare()
                    });
                    let [a, b, c] = seen;
                    let shown = match hidden {
                        Hidden::No => a && b && c,
                        Hidden::A => b && c,
                        Hidden::B => a && c,
                        Hidden::C => a && b,
                    };
                    assert!(shown, "{share}, {lag}: {before:?} {after:?} {hidden:?}");
                    all += u32::from(hidden == Hidden::No);
                }
            }
            let part = f64::from(all) / 3_600.0;
            assert!(readable.contains(&part), "{share}: all are seen in {part} of the revolution");
        }
    }

    #[test]
    fn a_voltage_that_needs_no_shift_is_not_shifted() {
        for (before, _) in around(0.75, 0.0) {
            assert_eq!(window().fit(before), (before, Hidden::No));
        }
    }

    #[test]
    fn what_is_hidden_follows_from_the_other_two() {
        let currents = [700, -300, 123];
        assert_eq!(Hidden::No.restore(currents), currents);
        assert_eq!(Hidden::A.restore(currents), [177, -300, 123]);
        assert_eq!(Hidden::B.restore(currents), [700, -823, 123]);
        assert_eq!(Hidden::C.restore(currents), [700, -300, -400]);
    }
}
