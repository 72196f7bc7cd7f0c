//! What the current loop watches in every cycle, and the zero of its sensors.

use crate::arithmetic::division::divide_rounding;
use crate::error::SettingsError;

/// What made the current loop switch the bridge off.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Trip {
    /// The current of a phase passed the trip level.
    Overcurrent,
    /// The three currents do not add up to nothing: a sensor, or a phase to earth.
    CurrentSum,
    /// The bus voltage passed its highest value.
    Overvoltage,
    /// The encoder made more increments in a cycle than the motor can.
    EncoderJump,
    /// The cycle came too late for its compare values.
    Late,
}

impl Trip {
    /// As a word for the outer loops; never 0.
    #[must_use]
    pub const fn code(self) -> u32 {
        match self {
            Self::Overcurrent => 1,
            Self::CurrentSum => 2,
            Self::Overvoltage => 3,
            Self::EncoderJump => 4,
            Self::Late => 5,
        }
    }

    /// The trip of a word.
    #[must_use]
    pub const fn from_code(code: u32) -> Option<Self> {
        match code {
            1 => Some(Self::Overcurrent),
            2 => Some(Self::CurrentSum),
            3 => Some(Self::Overvoltage),
            4 => Some(Self::EncoderJump),
            5 => Some(Self::Late),
            _ => None,
        }
    }
}

/// Zero of the current sensors, in ADC counts 2^-3.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Offsets {
    phases: [i32; 3],
    /// Sums of the samples without current, and how many they are.
    sums: [u32; 3],
    samples: u32,
}

/// The middle of the converter, in counts.
const MIDDLE: i32 = 2_048;
/// Samples without current that make an offset: 64 ms at 16 kHz.
const CALIBRATION: u32 = 1_024;
/// A sensor whose zero is further than this from the middle is broken, in counts: 5 % of the range.
const LARGEST_OFFSET: i32 = 102;

impl Default for Offsets {
    fn default() -> Self {
        Self { phases: [MIDDLE << 3; 3], sums: [0; 3], samples: 0 }
    }
}

impl Offsets {
    /// Currents in counts 2^-3.
    #[inline]
    #[must_use]
    pub fn remove(&self, [a, b, c]: [u32; 3]) -> [i32; 3] {
        let [zero_a, zero_b, zero_c] = self.phases;
        let without = |sample: u32, zero: i32| sample.wrapping_shl(3).cast_signed().wrapping_sub(zero);
        [without(a, zero_a), without(b, zero_b), without(c, zero_c)]
    }

    /// Takes samples while no current flows: each 1 024 of them make a new zero, if it is believable.
    pub fn calibrate(&mut self, samples: [u32; 3]) {
        for (sum, sample) in self.sums.iter_mut().zip(samples) {
            *sum = sum.wrapping_add(sample);
        }
        self.samples = self.samples.wrapping_add(1);
        if self.samples & (CALIBRATION - 1) == 0 {
            // 1 024 samples of 12 bits: the mean in 2^-3 counts is the sum over 128.
            let phases = self.sums.map(|sum| (sum >> 7).cast_signed());
            self.sums = [0; 3];
            if phases.iter().all(|zero| zero.wrapping_sub(MIDDLE << 3).wrapping_abs() <= LARGEST_OFFSET << 3) {
                self.phases = phases;
            } else {
                self.samples = 0;
            }
        }
    }

    /// Begins anew: current flows, so what was summed is worth nothing. The zero in force stays.
    pub fn interrupt(&mut self) {
        self.sums = [0; 3];
        self.samples &= !(CALIBRATION - 1);
    }

    /// A believable zero has been measured since the start.
    #[inline]
    #[must_use]
    pub const fn is_calibrated(&self) -> bool {
        self.samples >= CALIBRATION
    }
}

/// Levels at which the current loop switches the bridge off by itself.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Protection {
    /// ADC counts 2^-3.
    pub(crate) current: i32,
    /// ADC counts 2^-3 of the sum.
    pub(crate) sum: i32,
    /// ADC counts.
    pub(crate) bus: u32,
    /// Increments in a cycle.
    pub(crate) increments: i32,
}

impl Protection {
    /// * `trip_current` and `measuring_range` in mA; a level at or beyond the end of the range trips just before it.
    /// * `highest_bus` in counts of the converter.
    /// * `increments_per_cycle`: what the motor makes at its highest speed, with some reserve.
    ///
    /// # Errors
    /// [`SettingsError::Zero`] for a range of zero.
    pub fn new(
        trip_current: u32,
        measuring_range: u32,
        highest_bus: u16,
        increments_per_cycle: u32,
    ) -> Result<Self, SettingsError> {
        if measuring_range == 0 {
            return Err(SettingsError::Zero { parameter: "measuring range of the phase currents" });
        }
        let counts = divide_rounding(i128::from(trip_current) << 14, measuring_range.into());
        let current = counts.clamp(1, i64::from(LAST_COUNTS)) as i32;
        Ok(Self {
            current,
            // A tenth of the range: three gain errors of 2 % at full current, and noise, make less.
            sum: (MIDDLE << 3) / 10,
            bus: highest_bus.into(),
            increments: i32::try_from(increments_per_cycle).unwrap_or(i32::MAX),
        })
    }

    /// As words, for a mailbox; see [`Protection::from_words`].
    #[must_use]
    pub const fn to_words(&self) -> [u32; 4] {
        [self.current.cast_unsigned(), self.sum.cast_unsigned(), self.bus, self.increments.cast_unsigned()]
    }

    /// From [`Protection::to_words`].
    #[must_use]
    pub const fn from_words([current, sum, bus, increments]: [u32; 4]) -> Self {
        Self { current: current.cast_signed(), sum: sum.cast_signed(), bus, increments: increments.cast_signed() }
    }

    /// Looks at one cycle. `moved`: increments since the last one.
    #[inline]
    #[must_use]
    pub fn check(&self, [a, b, c]: [i32; 3], bus: u32, moved: i32) -> Option<Trip> {
        // What lies within +-limit is, moved up by it, an unsigned number of at most twice the limit: one comparison for both ends.
        let beyond =
            |value: i32, limit: i32| value.wrapping_add(limit).cast_unsigned() > limit.cast_unsigned().wrapping_shl(1);
        let limit = self.current;
        if beyond(a, limit) || beyond(b, limit) || beyond(c, limit) {
            return Some(Trip::Overcurrent);
        }
        if beyond(a.wrapping_add(b).wrapping_add(c), self.sum) {
            return Some(Trip::CurrentSum);
        }
        if bus > self.bus {
            return Some(Trip::Overvoltage);
        }
        if beyond(moved, self.increments) {
            return Some(Trip::EncoderJump);
        }
        None
    }
}

/// The last place before the converter's end, less the largest offset, in counts 2^-3.
const LAST_COUNTS: i32 = (MIDDLE - LARGEST_OFFSET - 4) << 3;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_zero_is_the_mean_of_a_thousand_samples() {
        let mut offsets = Offsets::default();
        for n in 0..1_024_u32 {
            assert!(!offsets.is_calibrated());
            offsets.calibrate([2_050 + n % 2, 2_040, 2_048]);
        }
        assert!(offsets.is_calibrated());
        assert_eq!(offsets.remove([2_050, 2_041, 2_148]), [-4, 8, 800]);
    }

    #[test]
    fn a_sensor_far_from_its_zero_is_not_believed() {
        let mut offsets = Offsets::default();
        for _ in 0..4_096 {
            offsets.calibrate([2_048, 2_151, 2_048]);
        }
        assert!(!offsets.is_calibrated());
        assert_eq!(offsets.remove([2_048; 3]), [0; 3]);
    }

    #[test]
    fn a_calibration_that_is_interrupted_counts_for_nothing() {
        let mut offsets = Offsets::default();
        for _ in 0..1_500 {
            offsets.calibrate([2_060, 2_048, 2_048]);
        }
        offsets.interrupt();
        assert!(offsets.is_calibrated(), "the zero that was found stays");
        for _ in 0..1_024 {
            offsets.calibrate([2_040, 2_048, 2_048]);
        }
        assert_eq!(offsets.remove([2_040, 2_048, 2_048]), [0; 3]);
    }

    #[test]
    fn every_level_trips_just_above_it() {
        // 20 A of 25 A: 13 107 counts 2^-3
        let protection = Protection::new(20_000, 25_000, 3_600, 50).unwrap();
        let quiet = [13_107, -6_000, -7_107];
        assert_eq!(protection.check(quiet, 3_600, -50), None);
        for phases in [[13_108, -6_000, -7_108], [-13_108, 6_000, 7_108], [0, 13_200, -13_200], [6_000, 7_200, -13_200]]
        {
            assert_eq!(protection.check(phases, 0, 0), Some(Trip::Overcurrent), "{phases:?}");
        }
        assert_eq!(protection.check([1_638, 0, 0], 0, 0), None);
        assert_eq!(protection.check([1_639, 0, 0], 0, 0), Some(Trip::CurrentSum));
        assert_eq!(protection.check([-1_000, -1_000, 0], 0, 0), Some(Trip::CurrentSum));
        assert_eq!(protection.check(quiet, 3_601, 0), Some(Trip::Overvoltage));
        assert_eq!(protection.check(quiet, 0, -51), Some(Trip::EncoderJump));
        let beyond = Protection::new(100_000, 25_000, 0, 0).unwrap();
        assert_eq!(beyond.check([15_600, -7_800, -7_800], 0, 0), Some(Trip::Overcurrent), "before the converter ends");
    }

    #[test]
    fn levels_read_back_from_their_words_each_in_its_place() {
        let protection = Protection { current: 1, sum: 2, bus: 3, increments: 4 };
        assert_eq!(protection.to_words(), [1, 2, 3, 4]);
        assert_eq!(Protection::from_words([1, 2, 3, 4]), protection);
    }

    #[test]
    fn codes_read_back() {
        for trip in [Trip::Overcurrent, Trip::CurrentSum, Trip::Overvoltage, Trip::EncoderJump, Trip::Late] {
            assert_eq!(Trip::from_code(trip.code()), Some(trip));
        }
        assert_eq!(Trip::from_code(0), None);
    }
}
