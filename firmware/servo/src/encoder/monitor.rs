//! Supervision of the motor encoder: a lost signal (with [`HiddenMotion`]), an implausible jump or stop, an index pulse in the wrong place.
//!
//! What is found here is an error of the encoder and is reported as such, never as one of the motor: who reads "encoder" looks at
//! the cable. The errors carry what was expected and what was seen.

use core::fmt;

use crate::encoder::hidden_motion::{HiddenMotion, HiddenMotionSettings};
use crate::error::{SettingsError, in_range};
use crate::units::Velocity;

/// Parameters of the supervision.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct EncoderMonitorParameters {
    /// Increments (edges, four per line) per revolution, 16 ..= 2^28.
    pub increments_per_revolution: u32,
    /// Highest velocity of the motor (S-0-0113).
    pub maximum_velocity: Velocity,
    /// Pole pairs of the motor, from 1.
    pub pole_pairs: u32,
    /// Flux linkage of the magnets in uVs (from the torque constant P-0-0114); 0: not known, a lost signal is not found at standstill.
    pub flux: u32,
    /// The current loop makes up for the dead time of the bridge.
    pub dead_time_compensated: bool,
    /// Width of the index pulse in increments, by which its latched flank differs between the directions: 1 for an index gated with
    /// both tracks. `None` for an encoder without index.
    pub index_width: Option<u8>,
}

/// The supervision, scaled.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct EncoderMonitorSettings {
    increments: i32,
    /// Largest plausible change of the counter in a loop tick.
    pub(crate) largest_jump: u32,
    /// Change of the counter in a loop tick from which no axis stops at once.
    pub(crate) fast: u32,
    /// `None` where an increment is so much of an electrical revolution that a counter that stands says nothing.
    hidden: Option<HiddenMotionSettings>,
    index_width: Option<u8>,
}

/// Increments of an electrical revolution from which on a counter that stands says that the rotor does: three are 11 degrees.
const FINE: u32 = 96;
/// A track that has failed leaves a counter that goes to and fro by one increment; a line has four.
const STILL: u32 = 3;
/// Share of a revolution in a loop tick from which no axis stops at once: 240 rpm, gone within two ticks, would be 100 000 rad/s^2.
const FAST_DIVISOR: u32 = 2_000;
/// Below so many increments in a loop tick a stop is no proof.
const FAST_INCREMENTS: u32 = 8;
/// Revolutions of the motor without an index pulse after which it is missing.
const REVOLUTIONS_WITHOUT_INDEX: i32 = 2;
/// Same direction: the flank may be seen an increment early or late.
const SAME_FLANK: u32 = 1;

impl EncoderMonitorSettings {
    /// Scales the parameters. Divides.
    ///
    /// # Errors
    /// [`SettingsError::OutOfRange`] for a parameter beyond its range, [`SettingsError::Zero`] without a maximum velocity.
    pub fn new(parameters: &EncoderMonitorParameters) -> Result<Self, SettingsError> {
        let increments = in_range("increments per revolution", parameters.increments_per_revolution, 16, 1 << 28)?;
        let velocity = parameters.maximum_velocity.abs().to_bits().unsigned_abs();
        if velocity == 0 {
            return Err(SettingsError::Zero { parameter: "maximum motor speed S-0-0113" });
        }
        let pole_pairs = in_range("pole pairs P-0-0110", parameters.pole_pairs, 1, u32::MAX)?;
        let hidden = HiddenMotionSettings::new(parameters.flux, parameters.dead_time_compensated)?;
        if let Some(width) = parameters.index_width {
            in_range("width of the index pulse", width.into(), 1, increments / 4)?;
        }
        // One and a half times the maximum, rounded up; below 2^36 revolutions * 2^28 increments.
        let jump = u128::from(velocity).saturating_mul(3).saturating_mul(u128::from(increments)).div_ceil(1 << 37);
        Ok(Self {
            // Range checked.
            increments: increments as i32,
            largest_jump: u32::try_from(jump).unwrap_or(u32::MAX),
            fast: (increments / FAST_DIVISOR).max(FAST_INCREMENTS),
            hidden: (increments >= FINE.saturating_mul(pole_pairs)).then_some(hidden),
            index_width: parameters.index_width,
        })
    }
}

/// An error of the encoder, its cable or its counter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum EncoderError {
    /// The counter stands still or goes to and fro between two lines, but the rotor has turned: its flux has induced a voltage. A motor that
    /// is blocked induces none.
    SignalLost {
        /// Change of the flux that may be, in 0.1 % of the magnets'.
        expected: u32,
        /// Change of the flux.
        actual: u32,
    },
    /// The counter changed by more in a loop tick than one and a half times the maximum velocity.
    Jump {
        /// Largest plausible change in increments.
        expected: u32,
        /// Change in increments.
        actual: i32,
    },
    /// The counter stood still from one loop tick to the next, faster than any axis stops: cable or supply of the encoder are gone.
    SuddenStop {
        /// Increments in a loop tick before.
        expected: u32,
        /// Increments in the last loop tick.
        actual: i32,
    },
    /// The distance between two index pulses is no whole number of revolutions: increments were lost or added, or the index is disturbed.
    Index {
        /// Increments of the nearest whole number of revolutions; 0 when the motor turned round.
        expected: i32,
        /// Increments counted.
        actual: i32,
    },
    /// The motor has turned two revolutions without an index pulse.
    IndexMissing {
        /// Increments within which there should have been one.
        expected: u32,
        /// Increments counted since the last one.
        actual: i32,
    },
}

impl fmt::Display for EncoderError {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::SignalLost { expected, actual } => {
                write!(formatter, "encoder stands, but the flux has turned by {actual} in 0.1 %, expected {expected}")
            }
            Self::Jump { expected, actual } => {
                write!(formatter, "encoder jumped by {actual} increments in a tick, expected at most {expected}")
            }
            Self::SuddenStop { expected, actual } => {
                write!(formatter, "encoder stopped at once: {actual} increments in a tick after {expected}")
            }
            Self::Index { expected, actual } => {
                write!(formatter, "encoder index after {actual} increments, expected {expected}")
            }
            Self::IndexMissing { expected, actual } => {
                write!(formatter, "no encoder index in {actual} increments, expected one in {expected}")
            }
        }
    }
}

impl core::error::Error for EncoderError {}

/// What the supervision looks at in one of its ticks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct EncoderMonitorInputs {
    /// Counter at this tick.
    pub count: u32,
    /// Counter latched at an index pulse since the last tick.
    pub index: Option<u32>,
    /// Voltage of the d axis and longest voltage vector, volt 2^-14, while the current is commutated by this encoder. `None`: no current, or
    /// at an angle of its own.
    pub voltage: Option<(i32, i32)>,
}

/// State of the supervision.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct EncoderMonitor {
    count: u32,
    /// Latched at the last index pulse.
    index: Option<u32>,
    /// Since the last index pulse, or since the start.
    since_index: i32,
    /// Where the counter stood when it was last seen to move.
    still_at: u32,
    hidden: HiddenMotion,
}

impl EncoderMonitor {
    /// Starts with the counter at `count`.
    #[must_use]
    pub const fn new(count: u32) -> Self {
        Self { count, index: None, since_index: 0, still_at: count, hidden: HiddenMotion::new() }
    }

    /// One tick of the supervision. An error is told once, in the tick in which it is found; of an index pulse in the wrong place or
    /// missing and a lost signal, the first.
    #[inline]
    pub fn tick(&mut self, settings: &EncoderMonitorSettings, inputs: &EncoderMonitorInputs) -> Option<EncoderError> {
        let moved = inputs.count.wrapping_sub(self.count) as i32;
        self.count = inputs.count;
        let index = self.index(settings, inputs, moved);
        let lost = self.lost(settings, inputs);
        index.or(lost)
    }

    #[inline]
    fn index(
        &mut self,
        settings: &EncoderMonitorSettings,
        inputs: &EncoderMonitorInputs,
        moved: i32,
    ) -> Option<EncoderError> {
        let width = u32::from(settings.index_width?);
        self.since_index = self.since_index.saturating_add(moved);
        let Some(latched) = inputs.index else {
            let expected = settings.increments.saturating_mul(REVOLUTIONS_WITHOUT_INDEX);
            let actual = self.since_index;
            if actual.unsigned_abs() <= expected.unsigned_abs() {
                return None;
            }
            self.since_index = 0;
            self.index = None;
            return Some(EncoderError::IndexMissing { expected: expected.unsigned_abs(), actual });
        };
        self.since_index = inputs.count.wrapping_sub(latched) as i32;
        let last = self.index.replace(latched)?;
        let actual = latched.wrapping_sub(last) as i32;
        let expected = nearest_revolutions(actual, settings.increments);
        let tolerance = if expected == 0 { width } else { SAME_FLANK };
        (actual.abs_diff(expected) > tolerance).then_some(EncoderError::Index { expected, actual })
    }

    #[inline]
    fn lost(&mut self, settings: &EncoderMonitorSettings, inputs: &EncoderMonitorInputs) -> Option<EncoderError> {
        let distance = (inputs.count.wrapping_sub(self.still_at) as i32).unsigned_abs();
        let (true, Some(hidden), Some((voltage, longest))) = (distance <= STILL, &settings.hidden, inputs.voltage)
        else {
            self.still_at = inputs.count;
            self.hidden = HiddenMotion::new();
            return None;
        };
        let actual = self.hidden.tick(hidden, voltage, longest)?;
        Some(EncoderError::SignalLost { expected: HiddenMotionSettings::ALLOWED, actual })
    }
}

/// The multiple of `increments` that is nearest, from -2 to 2 revolutions: an index pulse that is missing for longer is told before.
#[inline]
fn nearest_revolutions(distance: i32, increments: i32) -> i32 {
    let magnitude = distance.unsigned_abs().wrapping_mul(2);
    let increments_u = increments.unsigned_abs();
    // Halves of a revolution up to the middle between one and two, and beyond.
    let nearest = if magnitude < increments_u {
        0
    } else if magnitude < increments_u.wrapping_mul(3) {
        increments
    } else {
        increments.wrapping_mul(2)
    };
    if distance < 0 { nearest.wrapping_neg() } else { nearest }
}

#[cfg(test)]
mod tests {
    extern crate std;

    use std::string::ToString;

    use super::*;
    use proptest::prelude::*;

    const INCREMENTS: u32 = 10_000;

    /// 10 000 increments, 6000 rpm (500 increments a tick), 4 pole pairs, 0.133 Vs.
    fn settings() -> EncoderMonitorSettings {
        EncoderMonitorSettings::new(&PARAMETERS).unwrap()
    }

    const PARAMETERS: EncoderMonitorParameters = EncoderMonitorParameters {
        increments_per_revolution: INCREMENTS,
        maximum_velocity: Velocity::from_bits((1_u64 << 36).div_ceil(80) as i32),
        pole_pairs: 4,
        flux: 133_333,
        dead_time_compensated: true,
        index_width: Some(1),
    };

    fn inputs(count: u32) -> EncoderMonitorInputs {
        EncoderMonitorInputs { count, index: None, voltage: Some((0, LONGEST)) }
    }

    /// Of a bus of 320 V.
    const LONGEST: i32 = 181 << 14;

    /// 20 V across the current: a third of 0.133 Vs in 2.6 ms, 3 V of it for the dead time and a part forgotten.
    fn induced(count: u32) -> EncoderMonitorInputs {
        EncoderMonitorInputs { voltage: Some((-(20 << 14), LONGEST)), ..inputs(count) }
    }

    #[test]
    fn the_nearest_revolution_changes_in_the_middle_between_two() {
        for (distance, nearest) in
            [(0, 0), (499, 0), (500, 1_000), (1_000, 1_000), (1_499, 1_000), (1_500, 2_000), (2_700, 2_000)]
        {
            assert_eq!(nearest_revolutions(distance, 1_000), nearest, "{distance}");
            assert_eq!(nearest_revolutions(-distance, 1_000), -nearest, "-{distance}");
        }
    }

    #[test]
    fn a_signal_is_lost_when_the_flux_turns_and_the_counter_does_not() {
        for jitter in [0, 1, 3] {
            let mut monitor = EncoderMonitor::new(5);
            for tick in 1..=6 {
                assert_eq!(monitor.tick(&settings(), &induced(5 + jitter * (tick % 2))), None, "tick {tick}");
            }
            let error = monitor.tick(&settings(), &inputs(5));
            let Some(EncoderError::SignalLost { expected: 333, actual }) = error else { panic!("{error:?}") };
            assert!((334..460).contains(&actual), "{actual}");
            assert_eq!(monitor.tick(&settings(), &inputs(5)), None, "told once");
        }
    }

    #[test]
    fn an_axis_that_turns_stands_or_has_no_current_of_its_angle_has_its_signal() {
        let mut turning = EncoderMonitor::new(0);
        let mut standing = EncoderMonitor::new(0);
        let mut without = EncoderMonitor::new(0);
        for tick in 0..2_000_u32 {
            let pulse = |count| if tick % 40 < 20 { induced(count) } else { inputs(count) };
            assert_eq!(turning.tick(&settings(), &pulse(tick * 2)), None, "4 increments a millisecond");
            assert_eq!(standing.tick(&settings(), &inputs(0)), None, "blocked: whatever the current is");
            assert_eq!(without.tick(&settings(), &EncoderMonitorInputs { voltage: None, ..inputs(0) }), None);
        }
        // 64 increments of a motor with four pole pairs: one is 22 electrical degrees.
        let coarse = EncoderMonitorParameters { increments_per_revolution: 64, ..PARAMETERS };
        let coarse = EncoderMonitorSettings::new(&coarse).unwrap();
        let pulse = |tick: u32| if tick % 40 < 20 { induced(0) } else { inputs(0) };
        assert!((0..100).all(|tick| without.tick(&coarse, &pulse(tick)).is_none()));
        assert!((0..100).any(|tick| without.tick(&settings(), &pulse(tick)).is_some()));
    }

    /// Feeds index pulses at these counts, in steps that do not jump.
    fn pass(monitor: &mut EncoderMonitor, from: u32, index: u32) -> Option<EncoderError> {
        let mut count = from;
        let mut found = None;
        loop {
            let left = index.wrapping_sub(count) as i32;
            let step = left.clamp(-150, 150);
            count = count.wrapping_add(step as u32);
            let arrived = count == index;
            let latched = arrived.then_some(index);
            let error = monitor.tick(&settings(), &EncoderMonitorInputs { index: latched, ..inputs(count) });
            found = found.or(error);
            if arrived {
                return found;
            }
        }
    }

    #[test]
    fn index_pulses_a_revolution_apart_are_right_within_one_increment() {
        for (sign, deviation, right) in
            [(1, 0, true), (1, 1, true), (1, -1, true), (1, 2, false), (1, -2, false), (-1, 1, true), (-1, -2, false)]
        {
            let mut monitor = EncoderMonitor::new(0);
            assert_eq!(pass(&mut monitor, 0, 700), None, "the first one has no predecessor");
            let actual = sign * INCREMENTS as i32 + deviation;
            let error = pass(&mut monitor, 700, 700_u32.wrapping_add(actual as u32));
            let expected = EncoderError::Index { expected: sign * INCREMENTS as i32, actual };
            assert_eq!(error, (!right).then_some(expected));
        }
    }

    #[test]
    fn an_index_passed_again_after_turning_round_is_right_within_its_width() {
        for (width, deviation, right) in [(1, 0, true), (1, 1, true), (1, -2, false), (4, -4, true), (4, 5, false)] {
            let settings =
                EncoderMonitorSettings::new(&EncoderMonitorParameters { index_width: Some(width), ..PARAMETERS })
                    .unwrap();
            let mut monitor = EncoderMonitor::new(0);
            let at = |index: u32| EncoderMonitorInputs { index: Some(index), ..inputs(50) };
            assert_eq!(monitor.tick(&settings, &at(40)), None);
            let error = monitor.tick(&settings, &at(40_u32.wrapping_add(deviation as u32)));
            assert_eq!(error, (!right).then_some(EncoderError::Index { expected: 0, actual: deviation }));
        }
    }

    #[test]
    fn one_pulse_may_be_missed_but_not_two() {
        let mut monitor = EncoderMonitor::new(0);
        pass(&mut monitor, 0, 700);
        assert_eq!(pass(&mut monitor, 700, 700 + 2 * INCREMENTS), None);
        let error = pass(&mut monitor, 700 + 2 * INCREMENTS, 700 + 5 * INCREMENTS);
        let Some(EncoderError::IndexMissing { expected, actual }) = error else { panic!("{error:?}") };
        assert_eq!(expected, 2 * INCREMENTS);
        assert!((20_001..=20_150).contains(&actual), "{actual}");
    }

    #[test]
    fn a_wrong_place_is_measured_from_the_nearest_whole_number_of_revolutions() {
        for (actual, expected) in [(4_999, 0), (5_001, 10_000), (14_999, 10_000), (15_001, 20_000)] {
            for sign in [1, -1] {
                let mut monitor = EncoderMonitor::new(0);
                pass(&mut monitor, 0, 700);
                let error = pass(&mut monitor, 700, 700_u32.wrapping_add((sign * actual) as u32));
                assert_eq!(error, Some(EncoderError::Index { expected: sign * expected, actual: sign * actual }));
            }
        }
    }

    #[test]
    fn an_encoder_without_index_misses_none() {
        let settings =
            EncoderMonitorSettings::new(&EncoderMonitorParameters { index_width: None, ..PARAMETERS }).unwrap();
        let mut monitor = EncoderMonitor::new(0);
        assert!((0..1_000).all(|tick| monitor.tick(&settings, &inputs(tick * 100)).is_none()));
    }

    #[test]
    fn impossible_settings_are_refused() {
        let new = EncoderMonitorSettings::new;
        let increments = EncoderMonitorParameters { increments_per_revolution: 15, ..PARAMETERS };
        assert!(matches!(new(&increments), Err(SettingsError::OutOfRange { actual: 15, minimum: 16, .. })));
        let velocity = EncoderMonitorParameters { maximum_velocity: Velocity::ZERO, ..PARAMETERS };
        assert_eq!(new(&velocity), Err(SettingsError::Zero { parameter: "maximum motor speed S-0-0113" }));
        assert!(new(&EncoderMonitorParameters { pole_pairs: 0, ..PARAMETERS }).is_err());
        assert!(new(&EncoderMonitorParameters { flux: 3_000_000, ..PARAMETERS }).is_err());
        assert!(new(&EncoderMonitorParameters { index_width: Some(0), ..PARAMETERS }).is_err());
    }

    #[test]
    fn no_message_speaks_of_the_motor() {
        for error in [
            EncoderError::SignalLost { expected: 1, actual: 2 },
            EncoderError::Jump { expected: 1, actual: 2 },
            EncoderError::Index { expected: 1, actual: 2 },
            EncoderError::IndexMissing { expected: 1, actual: 2 },
        ] {
            let text = error.to_string();
            assert!(text.contains("encoder") && !text.contains("motor"), "{text}");
            assert!(text.contains('1') && text.contains('2'), "{text}");
        }
    }

    proptest! {
        /// A shaft that turns to and fro: the index passes at every multiple of the revolution, seen from the tick after.
        #[test]
        fn a_sound_encoder_is_never_blamed(start in any::<u32>(), steps in proptest::collection::vec(-188_i32..=188, 1..3_000)) {
            let mut monitor = EncoderMonitor::new(start);
            let mut place = 0_i64;
            for step in steps {
                // Long ways, so that pulses are passed.
                let next = place + i64::from(step) + 60;
                let next = if next - place > 188 { place + 188 } else { next };
                let resolution = i64::from(INCREMENTS);
                let (low, high) = (place.min(next), place.max(next));
                let at = (high.div_euclid(resolution)) * resolution;
                let index = (at > low).then(|| start.wrapping_add(at as u32));
                place = next;
                let inputs = EncoderMonitorInputs { index, ..inputs(start.wrapping_add(place as u32)) };
                prop_assert_eq!(monitor.tick(&settings(), &inputs), None);
            }
        }

        #[test]
        fn lost_increments_are_found_at_the_next_index(lost in 2_i32..4_000, negative in any::<bool>(), start in any::<u32>()) {
            let mut monitor = EncoderMonitor::new(start);
            pass(&mut monitor, start, start.wrapping_add(100));
            let lost = if negative { -lost } else { lost };
            let actual = INCREMENTS as i32 - lost;
            let error = pass(&mut monitor, start.wrapping_add(100), start.wrapping_add(100).wrapping_add(actual as u32));
            prop_assert_eq!(error, Some(EncoderError::Index { expected: INCREMENTS as i32, actual }));
        }
    }
}
