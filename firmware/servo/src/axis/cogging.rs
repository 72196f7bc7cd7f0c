//! Cogging compensation: the current against a torque that comes again at the same places of every revolution, fed forward from a table.
//!
//! The magnets hold on to the teeth. Of `s` slots and `p` poles the torque has the least common multiple of both as its harmonic of the
//! revolution; a stator that is not round adds multiples of `p`, an eccentric rotor those of `s` (Hanselman, Brushless Permanent Magnet Motor
//! Design, cogging torque). Servo motors have 6 to 36 slots and 4 to 40 poles, which makes 12 to 270 periods; of the direct drives with 64
//! pole pairs and some 144 slots the common multiple, 1 152, has next to no torque, and what is left of them are the 128 of the poles and
//! the 144 of the slots.
//!
//! The table has [`COGGING_POINTS`] points, joined by lines, and [`compensation`](crate::identification::CoggingTable) sharpens them against
//! what bins and lines take: of a harmonic of 72 periods a revolution less than 0.1 % are left, of 144 1 %, of 256 10 %.
//!
//! A place in the table is an angle from the index pulse of the encoder, in the direction of positive current: it belongs to rotor and
//! stator, whatever the zero of the axis is. Until the index has been seen nothing is compensated.
//!
//! ```text
//!  measured position ----+  + velocity * lead     where the rotor will be when the current acts
//!  - place of the index  |
//!                        +--> table --> * share --> beside the velocity loop
//! ```

use crate::arithmetic::gain::Gain;
use crate::arithmetic::trigonometry::high_product;
use crate::axis::velocity_loop::CURRENT_BITS;
use crate::error::SettingsError;
use crate::units::{LOOP_PERIOD_MICROSECONDS, Position, Velocity};

/// Points of the table, evenly over a revolution of the motor; the first one at the index.
pub const COGGING_POINTS: usize = 1 << POINT_BITS;

const POINT_BITS: u32 = 10;

/// Points of the table are in 2^-17 of the peak current: a quarter of it at most, in steps of 8 millionths.
pub(crate) const TABLE_BITS: u32 = 17;

/// Of the line between two points.
const FRACTION_BITS: u32 = 14;

/// The whole of the table; the share grows and falls by one in a look of the supervision, 64 ms from nothing to everything.
const WHOLE: i32 = 1 << SHARE_BITS;
const SHARE_BITS: u32 = 7;

/// How the table is used.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct CoggingSettings {
    is_on: bool,
    has_index: bool,
    /// From the instant of the measured position to that at which the current acts, in 2^-28 tick.
    lead: i32,
}

impl CoggingSettings {
    /// Without index, or not wanted.
    pub const OFF: Self = Self { is_on: false, has_index: false, lead: 0 };

    /// * `is_on`: the compensation is wanted.
    /// * `has_index`: the index of the encoder is connected; without it the table has no place.
    /// * `lead`: ns from the instant to which a measured position belongs to that at which the torque of the order is there; at most 999 000,
    ///   what is more counts as that.
    ///
    /// Divides.
    #[must_use]
    pub fn new(is_on: bool, has_index: bool, lead: u32) -> Self {
        const PERIOD: i64 = LOOP_PERIOD_MICROSECONDS as i64 * 1_000;
        // Below 8 ticks.
        Self { is_on, has_index, lead: ((i64::from(lead.min(999_000)) << 28) / PERIOD) as i32 }
    }
}

/// What has become of the compensation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum CoggingState {
    /// There is no table.
    NoTable = 0,
    /// It is switched off.
    Off = 1,
    /// The index has not been seen since the start, or since increments were lost.
    WaitsForIndex = 2,
    /// The table acts.
    InEffect = 3,
}

/// From the mA RMS of a data block to the points of a table.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct CoggingScale {
    peak: u32,
    to_points: Gain,
}

impl CoggingScale {
    /// For an amplifier with this peak current S-0-0110 in mA RMS. Divides.
    ///
    /// # Errors
    /// [`SettingsError::Zero`] without peak current.
    pub fn new(peak: u32) -> Result<Self, SettingsError> {
        let to_points = Gain::from_ratio(1 << TABLE_BITS, peak.into())
            .ok_or(SettingsError::Zero { parameter: "amplifier peak current S-0-0110" })?;
        Ok(Self { peak, to_points })
    }

    /// Largest current of a point either way in mA RMS: a quarter of the peak current.
    #[must_use]
    pub const fn largest(&self) -> u16 {
        let quarter = self.peak / 4;
        if quarter < i16::MAX as u32 { quarter as u16 } else { i16::MAX as u16 }
    }

    /// A point from mA RMS, within [`CoggingScale::largest`].
    #[must_use]
    pub fn point(&self, milliamperes: i16) -> i16 {
        self.to_points.apply(milliamperes.into()).clamp(i16::MIN.into(), i16::MAX.into()) as i16
    }

    /// mA RMS of a point. Divides.
    #[must_use]
    pub fn milliamperes(&self, point: i32) -> i32 {
        let product = i64::from(point).wrapping_mul(i64::from(self.peak));
        // Within the peak current.
        (product.wrapping_add(1 << (TABLE_BITS - 1)) >> TABLE_BITS) as i32
    }
}

/// A table, and the first point once more behind the last.
type Points = [i16; COGGING_POINTS + 1];

/// The compensation of an axis: two tables, of which one acts and the other may be filled.
///
/// Keep one in a static and lend it.
#[derive(Debug)]
pub struct CoggingTables {
    tables: [Points; 2],
}

impl CoggingTables {
    /// Of nothing.
    #[must_use]
    pub const fn new() -> Self {
        Self { tables: [[0; COGGING_POINTS + 1]; 2] }
    }
}

impl Default for CoggingTables {
    fn default() -> Self {
        Self::new()
    }
}

/// State of the compensation.
#[derive(Debug)]
pub struct Cogging {
    /// 0: nothing is compensated.
    share: i32,
    /// See [`CoggingSettings`].
    lead: i32,
    /// Angle of the position at the index, 2^-32 revolution; what it is before the index has been seen does not count.
    origin: u32,
    tables: &'static mut CoggingTables,
    /// The second one acts.
    second: bool,
    has_table: bool,
    is_anchored: bool,
    settings: CoggingSettings,
}

impl Cogging {
    /// Without table.
    pub const fn new(tables: &'static mut CoggingTables, settings: CoggingSettings) -> Self {
        Self {
            share: 0,
            lead: settings.lead,
            origin: 0,
            tables,
            second: false,
            has_table: false,
            is_anchored: false,
            settings,
        }
    }

    /// Takes new settings over. A table that has begun to act goes on, or fades within 64 ms.
    pub fn apply_settings(&mut self, settings: CoggingSettings) {
        self.lead = settings.lead;
        self.settings = settings;
        if !settings.has_index {
            self.forget_index();
        }
    }

    /// The current against the cogging in 2^-25 of the peak current, within a quarter of it, at a measured position and velocity.
    #[inline]
    #[must_use]
    pub fn current(&self, position: Position, velocity: Velocity) -> i32 {
        if self.share == 0 {
            return 0;
        }
        let moved = high_product(velocity.to_bits(), self.lead);
        let angle = (position.to_bits() as u32).wrapping_sub(self.origin).wrapping_add_signed(moved);
        let [first, second] = &self.tables.tables;
        let points = if self.second { second } else { first };
        let index = (angle >> (32 - POINT_BITS)) as usize;
        let fraction = (angle >> (32 - POINT_BITS - FRACTION_BITS) & ((1 << FRACTION_BITS) - 1)).cast_signed();
        // The index has ten bits, and the table a point more than that.
        let point = |index: usize| points.get(index).copied().map_or(0, i32::from);
        let from = point(index);
        let rise = point(index.wrapping_add(1)).wrapping_sub(from);
        let value = (from << (CURRENT_BITS - TABLE_BITS))
            .wrapping_add(rise.wrapping_mul(fraction) >> (FRACTION_BITS + TABLE_BITS - CURRENT_BITS));
        value.wrapping_mul(self.share) >> SHARE_BITS
    }

    /// Looks after the compensation: `index` is the position of an index pulse since the last time. To be called once in
    /// [`crate::units::LOOP_TICKS_PER_SUPERVISION`] ticks.
    #[inline]
    pub fn supervise(&mut self, index: Option<Position>) {
        if let Some(index) = index
            && !self.is_anchored
            && self.settings.has_index
        {
            self.origin = index.to_bits() as u32;
            self.is_anchored = true;
        }
        let wanted = if self.state() == CoggingState::InEffect { WHOLE } else { 0 };
        self.share = self.share.wrapping_add(wanted.wrapping_sub(self.share).signum());
    }

    /// Whether the table acts, and why not.
    #[must_use]
    pub const fn state(&self) -> CoggingState {
        if !self.has_table {
            CoggingState::NoTable
        } else if !self.settings.is_on {
            CoggingState::Off
        } else if !self.is_anchored {
            CoggingState::WaitsForIndex
        } else {
            CoggingState::InEffect
        }
    }

    /// The index of the encoder is connected.
    #[must_use]
    pub const fn has_index(&self) -> bool {
        self.settings.has_index
    }

    /// Angle of the position at the index, 2^-32 revolution; `None` until it has been seen.
    #[inline]
    #[must_use]
    pub const fn origin(&self) -> Option<u32> {
        if self.is_anchored { Some(self.origin) } else { None }
    }

    /// Positions count from elsewhere, or increments were lost: nobody knows any more where the index is.
    pub const fn forget_index(&mut self) {
        self.is_anchored = false;
        self.share = 0;
    }

    /// Moves the zero of the position without a movement.
    pub const fn shift(&mut self, difference: Position) {
        self.origin = self.origin.wrapping_add(difference.to_bits() as u32);
    }

    /// Fills the table that does not act from a point on; what lies beyond its end is left out. Nothing acts otherwise before
    /// [`Cogging::exchange`].
    pub fn fill(&mut self, from: usize, points: &[i16]) {
        let [first, second] = &mut self.tables.tables;
        let table = if self.second { first } else { second };
        for (place, point) in table.iter_mut().take(COGGING_POINTS).skip(from).zip(points) {
            *place = *point;
        }
        let [begin, .., end] = table;
        *end = *begin;
    }

    /// The table that was filled acts from now on; `is_one`: it is a table at all.
    pub const fn exchange(&mut self, is_one: bool) {
        self.second = !self.second;
        self.has_table = is_one;
        if !is_one {
            self.share = 0;
        }
    }
}

#[cfg(test)]
mod tests {
    extern crate std;

    use super::*;
    use proptest::prelude::*;
    use std::boxed::Box;
    use std::f64::consts::TAU;

    const UNIT: f64 = (1 << CURRENT_BITS) as f64;

    fn cogging(lead: u32, points: impl Fn(usize) -> i16) -> Cogging {
        let settings = CoggingSettings::new(true, true, lead);
        let mut cogging = Cogging::new(Box::leak(Box::new(CoggingTables::new())), settings);
        fill(&mut cogging, points);
        cogging
    }

    /// In parts, as the background hands them over.
    fn fill(cogging: &mut Cogging, points: impl Fn(usize) -> i16) {
        let points: std::vec::Vec<i16> = (0..COGGING_POINTS).map(points).collect();
        for (part, points) in points.chunks(64).enumerate() {
            cogging.fill(part * 64, points);
        }
        cogging.exchange(true);
    }

    /// With the whole table in effect, the index at this place.
    fn anchored(mut cogging: Cogging, index: i64) -> Cogging {
        cogging.supervise(Some(Position::from_bits(index)));
        (0..WHOLE).for_each(|_| cogging.supervise(None));
        cogging
    }

    fn sine(periods: f64) -> impl Fn(usize) -> i16 {
        move |point| ((TAU * periods * point as f64 / COGGING_POINTS as f64).sin() * 20_000.0).round() as i16
    }

    #[test]
    fn nothing_is_compensated_before_the_index_has_been_seen_and_then_it_grows_within_64_ms() {
        let mut cogging = cogging(0, |_| 16_384);
        assert_eq!(cogging.state(), CoggingState::WaitsForIndex);
        (0..1_000).for_each(|_| cogging.supervise(None));
        assert_eq!((cogging.current(Position::ZERO, Velocity::MAX), cogging.origin()), (0, None));
        cogging.supervise(Some(Position::from_bits(77)));
        assert_eq!((cogging.state(), cogging.origin()), (CoggingState::InEffect, Some(77)));
        let mut before = 0;
        for look in 1..=WHOLE {
            let now = cogging.current(Position::ZERO, Velocity::ZERO);
            assert_eq!(now, look << (CURRENT_BITS - 3 - SHARE_BITS), "{look}");
            assert!(now > before);
            before = now;
            cogging.supervise(None);
        }
        // An eighth of the peak current; a second pulse changes nothing.
        cogging.supervise(Some(Position::from_bits(1_000_000)));
        assert_eq!(
            (cogging.current(Position::ZERO, Velocity::ZERO), cogging.origin()),
            (1 << (CURRENT_BITS - 3), Some(77))
        );
    }

    #[test]
    fn what_is_switched_off_fades_and_without_index_there_is_no_place() {
        let mut axis = anchored(cogging(0, |_| 16_384), 0);
        axis.apply_settings(CoggingSettings::new(false, true, 0));
        assert_eq!(axis.state(), CoggingState::Off);
        assert_ne!(axis.current(Position::ZERO, Velocity::ZERO), 0, "no jump");
        (0..WHOLE).for_each(|_| axis.supervise(None));
        assert_eq!(axis.current(Position::ZERO, Velocity::ZERO), 0);
        axis.apply_settings(CoggingSettings::new(true, true, 0));
        assert_eq!(axis.state(), CoggingState::InEffect, "the place is still known");
        axis.apply_settings(CoggingSettings::new(true, false, 0));
        axis.supervise(Some(Position::ZERO));
        assert_eq!((axis.state(), axis.origin()), (CoggingState::WaitsForIndex, None), "a pulse of nothing");
        assert_eq!(axis.current(Position::ZERO, Velocity::ZERO), 0);
    }

    #[test]
    fn a_table_that_is_taken_away_acts_no_more_and_half_a_table_never_acts() {
        let mut axis = anchored(cogging(0, |_| 16_384), 0);
        let whole = axis.current(Position::ZERO, Velocity::ZERO);
        axis.fill(0, &[-16_384; 512]);
        assert_eq!(axis.current(Position::ZERO, Velocity::ZERO), whole);
        axis.fill(512, &[-16_384; 2_000]);
        axis.exchange(true);
        assert_eq!(axis.current(Position::ZERO, Velocity::ZERO), -whole);
        assert_eq!(axis.current(Position::from_bits(-1), Velocity::ZERO), -whole, "the line to the first point");
        axis.exchange(false);
        assert_eq!((axis.state(), axis.current(Position::ZERO, Velocity::ZERO)), (CoggingState::NoTable, 0));
    }

    #[test]
    fn lost_increments_and_a_zero_that_moves_are_no_movement_of_the_table() {
        let table = sine(3.0);
        let mut axis = anchored(cogging(0, table), 1 << 30);
        let place = Position::from_bits(0x1234_5678_9ABC);
        let before = axis.current(place, Velocity::ZERO);
        let difference = Position::from_bits(-98_765_432_109);
        axis.shift(difference);
        assert_eq!(axis.current(place + difference, Velocity::ZERO), before);
        assert_ne!(before, 0);
        axis.forget_index();
        assert_eq!((axis.current(place, Velocity::ZERO), axis.state()), (0, CoggingState::WaitsForIndex));
    }

    #[test]
    fn the_place_is_that_of_the_rotor_when_the_current_acts_in_both_directions() {
        let axis = anchored(cogging(250_000, sine(60.0)), 0);
        let still = anchored(cogging(0, sine(60.0)), 0);
        for rpm in [300.0, -300.0, 3_000.0, -3_000.0] {
            // In two ticks.
            let moved = (rpm / 60.0 * 250e-6 * 4_294_967_296.0_f64).round() as i64;
            let velocity = Velocity::from_ten_thousandths_rpm((rpm * 1e4) as i32);
            for place in (0..1 << 32).step_by(98_765_431) {
                let (led, there) = (
                    axis.current(Position::from_bits(place), velocity),
                    still.current(Position::from_bits(place + moved), Velocity::ZERO),
                );
                assert!(led.abs_diff(there) < 40, "{rpm} rpm at {place}: {led}, {there}");
            }
        }
        assert!((axis.current(Position::ZERO, Velocity::ZERO)).abs() < 10);
    }

    #[test]
    fn milliamperes_are_points_and_points_milliamperes() {
        let scale = CoggingScale::new(14_142).unwrap();
        assert_eq!(scale.largest(), 3_535);
        for milliamperes in [-3_535, -1, 0, 1, 283, 3_535_i16] {
            let point = scale.point(milliamperes);
            let exact = f64::from(milliamperes) / 14_142.0 * 131_072.0;
            assert!((f64::from(point) - exact).abs() <= 0.5, "{milliamperes}: {point}");
            assert_eq!(scale.milliamperes(point.into()), i32::from(milliamperes));
        }
        // A quarter of what a large amplifier has does not fit into two bytes.
        assert_eq!(CoggingScale::new(500_000).unwrap().largest(), 32_767);
        assert_eq!(CoggingScale::new(0), Err(SettingsError::Zero { parameter: "amplifier peak current S-0-0110" }));
    }

    proptest! {
        #[test]
        fn between_its_points_the_table_is_a_line_without_a_jump_at_the_wrap(
            seed: u64, position: i64, index: i64,
        ) {
            let points = move |point: usize| (seed.wrapping_mul(2 * point as u64 + 1) >> 24) as i16;
            let axis = anchored(cogging(0, points), index);
            let turns = f64::from((position as u32).wrapping_sub(index as u32)) / 4_294_967_296.0;
            let place = turns * COGGING_POINTS as f64;
            let (from, to) = (place.floor() as usize, (place.floor() as usize + 1) % COGGING_POINTS);
            let exact = f64::from(points(from)) + (f64::from(points(to)) - f64::from(points(from))) * place.fract();
            let actual = f64::from(axis.current(Position::from_bits(position), Velocity::ZERO)) / UNIT * 131_072.0;
            // A step of the line is 2^-14 of it.
            prop_assert!((actual - exact).abs() < 4.1, "{actual}, {exact}");
            let beside = f64::from(axis.current(Position::from_bits(position.wrapping_sub(1)), Velocity::ZERO));
            prop_assert!((beside / UNIT * 131_072.0 - actual).abs() < 4.1);
        }
    }
}
