//! Supervision of the motor encoder: a lost signal, an implausible jump or stop, an index pulse in the wrong place.
//!
//! What is found here is an error of the encoder and is reported as such, never as one of the motor: who reads "encoder" looks at
//! the cable. The errors carry what was expected and what was seen.

use core::fmt;

use crate::debounce::{Debounce, ticks_of};
use crate::settings::in_range;
use crate::{CurrentFraction, Gain, LOOP_TICKS_PER_SUPERVISION, SettingsError, Velocity};

/// Parameters of the supervision.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct EncoderMonitorParameters {
    /// Increments (edges, four per line) per revolution, 16 ..= 2^28.
    pub increments_per_revolution: u32,
    /// Highest velocity of the motor (S-0-0113).
    pub maximum_velocity: Velocity,
    /// Time in ms without movement under current and demand after which the signal counts as lost, from 1.
    pub loss_time: u16,
    /// Current above which an axis under demand must move, in magnitude.
    pub loss_current: CurrentFraction,
    /// Velocity command above which motion is demanded, in magnitude.
    pub loss_velocity: Velocity,
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
    loss_ticks: u32,
    loss_current: i32,
    loss_velocity: Velocity,
    /// From the sum of the velocity commands to increments.
    commanded: Gain,
    index_width: Option<u8>,
}

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
        let loss_time = in_range("time to a lost encoder signal", parameters.loss_time.into(), 1, u16::MAX.into())?;
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
            loss_ticks: ticks_of(loss_time),
            loss_current: i32::from(parameters.loss_current.to_bits()).saturating_abs(),
            loss_velocity: parameters.loss_velocity.abs(),
            // A velocity command stands for the loop ticks of one tick here.
            commanded: Gain::from_ratio(u128::from(increments.saturating_mul(LOOP_TICKS_PER_SUPERVISION)), 1 << 36)
                .unwrap_or(Gain::ZERO),
            index_width: parameters.index_width,
        })
    }
}

/// An error of the encoder, its cable or its counter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum EncoderError {
    /// Current flows and motion is demanded, but the counter stands still or goes to and fro between two lines. A motor that is blocked
    /// gives the same picture; a brake that stays closed is found by the brake sequencer first.
    SignalLost {
        /// Increments that the command has covered meanwhile, at most four revolutions.
        expected: u32,
        /// Largest distance of the counter from where it began.
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
                write!(formatter, "encoder signal lost: {actual} increments counted, {expected} commanded")
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
    /// Command of the velocity loop; zero when no motion is demanded, as in torque control.
    pub velocity_command: Velocity,
    /// Measured torque-producing current.
    pub current: CurrentFraction,
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
    furthest: u32,
    still: Debounce,
    /// Sum of the velocity commands meanwhile, one a tick.
    commanded: i64,
}

impl EncoderMonitor {
    /// Starts with the counter at `count`.
    #[must_use]
    pub const fn new(count: u32) -> Self {
        Self { count, index: None, since_index: 0, still_at: count, furthest: 0, still: Debounce::new(), commanded: 0 }
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
        let demanded =
            inputs.velocity_command.abs() >= settings.loss_velocity && inputs.velocity_command != Velocity::ZERO;
        let flows = i32::from(inputs.current.to_bits()).saturating_abs() >= settings.loss_current;
        let distance = (inputs.count.wrapping_sub(self.still_at) as i32).unsigned_abs();
        let still = distance <= STILL;
        let lost = self.still.holds(demanded && flows && still, settings.loss_ticks);
        if self.still.ticks() == 0 {
            self.begin(inputs.count);
            return None;
        }
        self.furthest = self.furthest.max(distance);
        self.commanded = self.commanded.saturating_add(i64::from(inputs.velocity_command.to_bits()));
        if !lost {
            return None;
        }
        let expected = settings.commanded.apply(self.commanded).unsigned_abs();
        let error =
            EncoderError::SignalLost { expected: u32::try_from(expected).unwrap_or(u32::MAX), actual: self.furthest };
        self.begin(inputs.count);
        Some(error)
    }

    #[inline]
    fn begin(&mut self, count: u32) {
        self.still = Debounce::new();
        self.still_at = count;
        self.furthest = 0;
        self.commanded = 0;
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

    /// 10 000 increments, 6000 rpm (500 increments a tick), 50 ms at 10 % current and 10 rpm.
    fn settings() -> EncoderMonitorSettings {
        EncoderMonitorSettings::new(&PARAMETERS).unwrap()
    }

    const PARAMETERS: EncoderMonitorParameters = EncoderMonitorParameters {
        increments_per_revolution: INCREMENTS,
        maximum_velocity: Velocity::from_bits((1_u64 << 36).div_ceil(80) as i32),
        loss_time: 50,
        loss_current: CurrentFraction::lit("0.1"),
        loss_velocity: Velocity::from_bits(1_431_655),
        index_width: Some(1),
    };

    fn inputs(count: u32) -> EncoderMonitorInputs {
        EncoderMonitorInputs { count, index: None, velocity_command: Velocity::ZERO, current: CurrentFraction::ZERO }
    }

    /// 60 rpm: 5 increments a tick.
    fn demanding(count: u32) -> EncoderMonitorInputs {
        EncoderMonitorInputs {
            velocity_command: Velocity::from_ten_thousandths_rpm(-600_000),
            current: CurrentFraction::from_num(-0.2),
            ..inputs(count)
        }
    }

    #[test]
    fn a_signal_is_lost_when_current_and_demand_do_not_move_the_counter() {
        let mut monitor = EncoderMonitor::new(5);
        for tick in 1..100 {
            assert_eq!(monitor.tick(&settings(), &demanding(5)), None, "tick {tick}");
        }
        let error = monitor.tick(&settings(), &demanding(5));
        assert_eq!(error, Some(EncoderError::SignalLost { expected: 500, actual: 0 }));
    }

    #[test]
    fn a_counter_that_goes_to_and_fro_on_one_track_is_a_lost_signal() {
        let mut monitor = EncoderMonitor::new(5);
        let error = (0..100).find_map(|tick| monitor.tick(&settings(), &demanding(5 + tick % 2)));
        assert_eq!(error, Some(EncoderError::SignalLost { expected: 500, actual: 1 }));
    }

    #[test]
    fn an_axis_that_moves_slowly_or_is_not_asked_to_has_its_signal() {
        let mut moving = EncoderMonitor::new(0);
        let mut idle = EncoderMonitor::new(0);
        let mut without_current = EncoderMonitor::new(0);
        for tick in 0..2_000_u32 {
            assert_eq!(moving.tick(&settings(), &demanding(tick / 22)), None, "4 increments in 44 ms");
            let still = EncoderMonitorInputs { velocity_command: Velocity::ZERO, ..demanding(0) };
            assert_eq!(idle.tick(&settings(), &still), None);
            let weak = EncoderMonitorInputs { current: CurrentFraction::from_num(0.09), ..demanding(0) };
            assert_eq!(without_current.tick(&settings(), &weak), None);
        }
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
        assert!(new(&EncoderMonitorParameters { loss_time: 0, ..PARAMETERS }).is_err());
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
                let inputs = EncoderMonitorInputs { index, ..demanding(start.wrapping_add(place as u32)) };
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
