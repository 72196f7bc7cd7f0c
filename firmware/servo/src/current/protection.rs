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

/// Zero of the current sensors, in ADC counts 2^-6: rounded to the 2^-3 of the currents it would stand in the torque once in an electrical
/// revolution.
///
/// It is the mean of four blocks of samples that agree. Where one does not, a sensor was disturbed in between: all of them are thrown away,
/// and the zero that is in force stays. A block is a period of mains of 50 Hz long, so that hum disturbs nothing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Offsets {
    phases: [i32; 3],
    /// Sums of the samples without current: of this block, of the first one, and of all before this one.
    block: [u32; 3],
    first: [u32; 3],
    sums: [u32; 3],
    /// Samples in the sums and in the block.
    samples: u32,
    /// First samples of the block.
    begin: [u32; 3],
    calibrated: bool,
}

/// The middle of the converter, in counts.
const MIDDLE: i32 = 2_048;
/// Samples without current that make an offset: 80 ms at 16 kHz.
const CALIBRATION: u32 = 4 * BLOCK;
/// Samples of a block: 20 ms at 16 kHz. Of hum of 60 Hz its mean keeps a sixth.
const BLOCK: u32 = 320;
/// Blocks agree when their means are within this, in counts: 0.4 % of the range. What is disturbed by less makes the zero wrong by less.
const AGREEMENT: u32 = 8;
/// So much more than noise in a sample is a current, in counts: 1.2 % of the range. The mean of smaller pulses is within [`AGREEMENT`].
const PULSE: u32 = 24;
/// A sensor whose zero is further than this from the middle is broken, in counts: 5 % of the range.
const LARGEST_OFFSET: i32 = 102;

impl Default for Offsets {
    fn default() -> Self {
        Self {
            phases: [MIDDLE << 6; 3],
            block: [0; 3],
            first: [0; 3],
            sums: [0; 3],
            samples: 0,
            begin: [0; 3],
            calibrated: false,
        }
    }
}

impl Offsets {
    /// Currents in counts 2^-3.
    #[inline]
    #[must_use]
    pub fn remove(&self, [a, b, c]: [u32; 3]) -> [i32; 3] {
        let [zero_a, zero_b, zero_c] = self.phases;
        let without = |sample: u32, zero: i32| sample.wrapping_shl(6).cast_signed().wrapping_sub(zero) >> 3;
        [without(a, zero_a), without(b, zero_b), without(c, zero_c)]
    }

    /// Takes samples while no current flows: each 1 280 of them make a new zero, if it is believable.
    pub fn calibrate(&mut self, samples: [u32; 3]) {
        for (sum, sample) in self.block.iter_mut().zip(samples) {
            *sum = sum.wrapping_add(sample);
        }
        self.samples = self.samples.wrapping_add(1);
        if self.samples.is_multiple_of(BLOCK) {
            self.end_block();
        }
    }

    /// The same for shunts of the low side. Of a motor that charges the DC link through the diodes of an open bridge they show the currents
    /// that come through the lower ones, all of one sign: pulses whose mean is no zero.
    pub fn calibrate_on_shunts(&mut self, samples: [u32; 3]) {
        if self.samples.is_multiple_of(BLOCK) {
            self.begin = samples;
        }
        if samples.iter().zip(&self.begin).any(|(one, other)| one.abs_diff(*other) > PULSE) {
            return self.interrupt();
        }
        self.calibrate(samples);
    }

    #[cold]
    fn end_block(&mut self) {
        let block = core::mem::take(&mut self.block);
        if self.samples == BLOCK {
            self.first = block;
        }
        if block.iter().zip(&self.first).any(|(one, other)| one.abs_diff(*other) > AGREEMENT * BLOCK) {
            return self.interrupt();
        }
        for (sum, block) in self.sums.iter_mut().zip(block) {
            *sum = sum.wrapping_add(block);
        }
        if self.samples == CALIBRATION {
            let phases = self.sums.map(|sum| (sum.wrapping_add(CALIBRATION / 128) / (CALIBRATION / 64)).cast_signed());
            self.calibrated =
                phases.iter().all(|zero| zero.wrapping_sub(MIDDLE << 6).wrapping_abs() <= LARGEST_OFFSET << 6);
            if self.calibrated {
                self.phases = phases;
            }
            self.interrupt();
        }
    }

    /// Begins anew: current flows, so what was summed is worth nothing. The zero in force stays.
    pub fn interrupt(&mut self) {
        (self.block, self.sums, self.samples) = ([0; 3], [0; 3], 0);
    }

    /// The last zero that was measured is believable.
    #[inline]
    #[must_use]
    pub const fn is_calibrated(&self) -> bool {
        self.calibrated
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
        for n in 0..CALIBRATION {
            assert!(!offsets.is_calibrated());
            offsets.calibrate([2_050 + n % 2, 2_040, 2_048]);
        }
        assert!(offsets.is_calibrated());
        assert_eq!(offsets.remove([2_050, 2_041, 2_148]), [-4, 8, 800]);
    }

    #[test]
    fn the_zero_is_rounded_to_the_nearest_64th_of_a_count() {
        for (more, expected) in [(9, 0), (10, 1), (29, 1), (30, 2)] {
            let mut offsets = Offsets::default();
            for n in 0..CALIBRATION {
                // Spread over the blocks, so that they agree.
                offsets.calibrate([
                    2_048 + u32::from(n % (CALIBRATION / 32) == 0 && n / (CALIBRATION / 32) < more),
                    2_048,
                    2_048,
                ]);
            }
            assert_eq!(offsets.phases, [(2_048 << 6) + expected, 2_048 << 6, 2_048 << 6], "{more} counts more in all");
        }
    }

    #[test]
    fn blocks_that_differ_by_just_the_agreement_agree() {
        for (more, agree) in [(0, true), (1, false)] {
            let mut offsets = Offsets::default();
            for n in 0..CALIBRATION {
                let second = u32::from(n / BLOCK == 1);
                offsets.calibrate([2_048 + AGREEMENT * second + more * u32::from(n == BLOCK), 2_048, 2_048]);
            }
            assert_eq!(offsets.is_calibrated(), agree, "{more} more");
        }
    }

    #[test]
    fn a_sensor_that_was_disturbed_for_a_while_moves_no_zero() {
        // A fifth of the range for 2 ms, wherever in the 80 ms, and 50 counts for half of them.
        for (begin, span, moved) in [(0, 32, 410), (500, 32, 410), (1_200, 24, 410), (640, 640, 50), (0, 640, -50)] {
            let mut offsets = Offsets::default();
            let run = |offsets: &mut Offsets, moved: i32, samples| {
                for _ in 0..samples {
                    offsets.calibrate([2_048, (2_040 + moved).cast_unsigned(), 2_050]);
                }
            };
            run(&mut offsets, 0, CALIBRATION + begin);
            run(&mut offsets, moved, span);
            run(&mut offsets, 0, 3 * CALIBRATION);
            assert_eq!(offsets.remove([2_048, 2_040, 2_050]), [0; 3], "{begin} {span} {moved}");
            assert!(offsets.is_calibrated());
            // Within the 80 ms that it was in, too.
            let mut offsets = Offsets::default();
            run(&mut offsets, 0, CALIBRATION + begin);
            run(&mut offsets, moved, span);
            run(&mut offsets, 0, CALIBRATION - begin - span);
            assert_eq!(offsets.remove([2_048, 2_040, 2_050]), [0; 3], "{begin} {span} {moved}");
        }
    }

    #[test]
    fn hum_of_the_mains_disturbs_nothing() {
        // In counts: all there may be before it is no zero any more.
        for (hertz, amplitude) in [(50.0, 80.0), (60.0, 20.0), (100.0, 80.0), (120.0, 20.0)] {
            let mut offsets = Offsets::default();
            for n in 0..CALIBRATION {
                let angle = core::f64::consts::TAU * hertz * f64::from(n) / 16_000.0;
                let hum = [0.0, 2.0, 4.0].map(|phase| (2_048.5 + amplitude * (angle + phase).sin()) as u32);
                offsets.calibrate(hum);
            }
            assert!(offsets.is_calibrated(), "{hertz} Hz");
            let rest = offsets.remove([2_048; 3]);
            assert!(rest.iter().all(|rest| rest.abs() <= 12), "{hertz} Hz: {rest:?} of 2^-3 counts");
        }
    }

    #[test]
    fn a_sensor_whose_zero_stays_elsewhere_is_followed_within_two_measurements() {
        let mut offsets = Offsets::default();
        for n in 0..CALIBRATION + 500 + 2 * CALIBRATION {
            offsets.calibrate([2_048, if n < CALIBRATION + 500 { 2_048 } else { 2_078 }, 2_048]);
        }
        assert_eq!(offsets.remove([2_048, 2_078, 2_048]), [0; 3]);
    }

    #[test]
    fn pulses_through_the_lower_diodes_move_no_zero_of_shunts() {
        let pulses = |amplitude: f64| {
            move |n: u32| {
                let angle = core::f64::consts::TAU * f64::from(n) / 80.0;
                [0.0, 2.0, 4.0].map(|phase| (2_048.5 + amplitude * (angle + phase).sin().max(0.0)) as u32)
            }
        };
        let zero = |calibrate: fn(&mut Offsets, [u32; 3]), amplitude: f64| {
            let mut offsets = Offsets::default();
            (0..CALIBRATION).for_each(|_| calibrate(&mut offsets, [2_040, 2_048, 2_055]));
            (0..3 * CALIBRATION).map(pulses(amplitude)).for_each(|samples| calibrate(&mut offsets, samples));
            assert!(offsets.is_calibrated());
            offsets.remove([2_040, 2_048, 2_055])
        };
        assert_eq!(zero(Offsets::calibrate_on_shunts, 150.0), [0; 3]);
        assert!(
            zero(Offsets::calibrate, 150.0).iter().all(|rest| *rest < -300),
            "in the lines they would have no mean"
        );
        // What is less than a pulse moves it by less than blocks may differ.
        assert!(zero(Offsets::calibrate_on_shunts, 24.0)[1] > -8 * 8);
    }

    #[test]
    fn noise_is_no_disturbance() {
        let mut offsets = Offsets::default();
        let mut noise = 1_u32;
        for _ in 0..CALIBRATION {
            noise = noise.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            // Even over 33 counts: a deviation of 9.5.
            offsets.calibrate([2_032 + (noise >> 16) % 33; 3]);
        }
        assert!(offsets.is_calibrated());
        assert!(offsets.remove([2_048; 3]).iter().all(|rest| rest.abs() <= 10), "{:?}", offsets.remove([2_048; 3]));
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
        for _ in 0..CALIBRATION {
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
