//! The current that the cogging needs, over one revolution of the motor in both directions.
//!
//! ```text
//!        | run-up |            a revolution            | an eighth | run-out |
//! index? ------->|==================================================|-------> there at 1 rpm
//!                 |==================================================|<------- and back
//! ```
//!
//! The axis is led at 1 rpm and the velocity loop holds it against the cogging: what it gives is summed up in a bin for each point of the
//! table and each direction. Friction changes its sign with the direction and cogging does not; half the sum of both directions, less
//! its mean (a load that pulls one way), is the cogging, see [`CoggingTable`](super::CoggingTable).
//!
//! At 1 rpm a harmonic of `h` periods is one of `h / 60` Hz. A velocity loop that crosses at `w` with an integral action time of `4 / w` leaves
//! `4 (2 pi h / 60 / w)^2` of it to the inertia: at 40 Hz 0.4 % of 72 periods and 1.4 % of 144. A table that is in effect already is part of
//! the current that is summed up, so that a second time leaves the square of it.
//!
//! The eighth is turned twice, a revolution apart: cogging is the same there, and a load that is not tells itself.
//!
//! Movement: from where the index is known 1.25 revolutions in the direction of the velocity, and back; before that at most 1.25 in search of
//! the index. Takes 150 s, and up to 75 s for the search.

use super::{IdentificationError, IdentificationState, Range};
use crate::axis::cogging::COGGING_POINTS;
use crate::error::{SettingsError, in_range};
use crate::path::limits::MotionLimits;
use crate::units::derivatives::Jerk;
use crate::units::{Acceleration, CurrentFraction, Position, Velocity};

/// Parts of the way, in 2^-32 revolution.
const REVOLUTION: i64 = 1 << 32;
const EIGHTH: i64 = REVOLUTION / 8;
const RUN_UP: i64 = REVOLUTION / 16;
/// Where the revolution ends, the eighth behind it, and the run-out.
const ONCE: i64 = RUN_UP + REVOLUTION;
const TWICE: i64 = ONCE + EIGHTH;
const TURN: i64 = TWICE + RUN_UP;
/// The place where the axis is to turn round or to end is reached within so much.
const ARRIVED: i64 = REVOLUTION / 256;
/// Way without an index after which there is none.
const SEARCH: i64 = REVOLUTION + EIGHTH;

/// 1 rpm.
const SPEED: Velocity = Velocity::from_bits(((1_i64 << 36) + 240_000).div_euclid(480_000) as i32);

/// Ticks for a quarter more than the longest part of the way, 1.25 revolutions at 1 rpm, and 2 s.
const LONGEST: u32 = 766_000;

/// What is summed up of a point in both directions.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Bin {
    /// Currents in 2^-15 of peak, forwards and backwards.
    sums: [i32; 2],
    /// How many of them.
    visits: [u16; 2],
}

impl Bin {
    /// Of currents in 2^-15 of peak, forwards and backwards, and how many of them: for tests of what is made of them.
    #[must_use]
    pub const fn new(sums: [i32; 2], visits: [u16; 2]) -> Self {
        Self { sums, visits }
    }

    /// Mean current of a direction in 2^-`bits` of peak, for up to 31; `None` where the axis has not been. Divides.
    #[must_use]
    pub fn mean(&self, backwards: bool, bits: u32) -> Option<i32> {
        let [sums, visits] = [self.sums.map(i64::from), self.visits.map(i64::from)];
        let side = usize::from(backwards);
        let sum = sums.get(side)?.checked_shl(bits.saturating_sub(15))?;
        // Not more than its largest summand.
        sum.checked_div(*visits.get(side)?).map(|mean| mean as i32)
    }
}

/// A bin in memory that is lent for it: both sums, then how many currents there are in each.
pub type CoggingRow = [i32; 4];

/// The bins of a revolution, in memory that is somebody else's between two learnings: a row a bin, [`COGGING_POINTS`] of them.
#[derive(Debug)]
pub struct CoggingRecord<'a> {
    rows: &'a mut [CoggingRow],
}

impl<'a> CoggingRecord<'a> {
    /// As the rows were left.
    #[must_use]
    pub const fn new(rows: &'a mut [CoggingRow]) -> Self {
        Self { rows }
    }

    /// Empties so many bins from one on; before a sequence begins.
    pub fn clear(&mut self, from: usize, bins: usize) {
        self.rows.iter_mut().skip(from).take(bins).for_each(|row| *row = [0; 4]);
    }

    /// A bin as it is; an empty one beyond the end.
    #[must_use]
    pub fn bin(&self, index: usize) -> Bin {
        let [there, back, visits_there, visits_back] = self.rows.get(index).copied().unwrap_or_default();
        Bin::new([there, back], [visits_there as u16, visits_back as u16])
    }

    /// Adds a current at an angle from the index, in 2^-32 revolution. The bin of a point reaches half way to its neighbours.
    #[inline]
    fn add(&mut self, angle: u32, backwards: bool, current: CurrentFraction) {
        const BIN: u32 = (REVOLUTION as u64 / COGGING_POINTS as u64) as u32;
        let index = (angle.wrapping_add(BIN / 2) / BIN) as usize % COGGING_POINTS;
        if let Some([there, back, visits_there, visits_back]) = self.rows.get_mut(index)
            && let (sum, visits) = if backwards { (back, visits_back) } else { (there, visits_there) }
            && *visits < i32::from(u16::MAX)
        {
            // At most 2^16 of at most 2^15.
            *sum = sum.wrapping_add(i32::from(current.to_bits()));
            *visits = visits.wrapping_add(1);
        }
    }
}

/// Settings of the sequence.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct CoggingIdentificationSettings {
    limits: MotionLimits,
    movement: Position,
    is_reversed: bool,
}

impl CoggingIdentificationSettings {
    /// * `is_reversed`: the axis turns backwards first.
    /// * `acceleration`: of the ramps; with `jerk`, if there is one.
    /// * `movement`: how far the motor may turn from where it stands; up to 2^20 revolutions.
    ///
    /// Divides.
    ///
    /// # Errors
    /// [`SettingsError::OutOfRange`] for a movement below 1.30 revolutions, and those of [`MotionLimits::new`].
    pub fn new(
        is_reversed: bool,
        acceleration: Acceleration,
        jerk: Option<Jerk>,
        movement: Position,
    ) -> Result<Self, SettingsError> {
        let hundredths = movement.to_bits().saturating_mul(100).saturating_add(1 << 31) >> 32;
        let hundredths = u32::try_from(hundredths).unwrap_or(if hundredths < 0 { 0 } else { u32::MAX });
        in_range("movement of the identification in 0.01 revolutions", hundredths, 130, 100 << 20)?;
        let limits = MotionLimits::new(SPEED, acceleration, acceleration, jerk)?;
        Ok(Self { limits, movement, is_reversed })
    }

    /// Limits of the movements that the sequence asks for.
    #[must_use]
    pub const fn limits(&self) -> MotionLimits {
        self.limits
    }

    /// In the first direction of the sequence.
    const fn along(&self, way: i64) -> i64 {
        if self.is_reversed { way.wrapping_neg() } else { way }
    }
}

/// What the sequence looks at in a tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CoggingInputs {
    /// Measured position.
    pub position: Position,
    /// Angle of the position at the index, see [`Cogging::origin`](crate::axis::Cogging::origin).
    pub origin: Option<u32>,
    /// Current command of the last tick, with all that is fed forward.
    pub current: CurrentFraction,
    /// It was at a limit of the torque.
    pub is_limited: bool,
}

/// Sum of currents.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
struct Sum {
    current: i64,
    ticks: u32,
}

impl Sum {
    #[inline]
    fn add(&mut self, current: CurrentFraction) {
        self.current = self.current.wrapping_add(current.to_bits().into());
        self.ticks = self.ticks.wrapping_add(1);
    }

    /// In 2^-17 of peak. Divides.
    fn mean(self) -> i64 {
        (self.current << 2).checked_div(self.ticks.into()).unwrap_or(0)
    }
}

/// What was summed up beside the bins.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct CoggingMeasurement {
    /// Of the eighth, the first and the second time, there and back.
    there: [Sum; 2],
    back: [Sum; 2],
}

impl CoggingMeasurement {
    /// How much more the same places needed a revolution further, in 2^-17 of peak; the larger one of both directions. Divides.
    pub(super) fn unevenness(&self) -> i64 {
        let of = |[near, far]: [Sum; 2]| far.mean().saturating_sub(near.mean()).saturating_abs();
        of(self.there).max(of(self.back))
    }
}

/// State of the sequence.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct CoggingIdentification {
    settings: CoggingIdentificationSettings,
    range: Range,
    state: IdentificationState<CoggingMeasurement>,
    stage: Stage,
    /// Where the way there begins.
    start: Position,
    /// Ticks of the stage.
    elapsed: u32,
    measured: CoggingMeasurement,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
enum Stage {
    /// For the index.
    Search,
    There,
    Back,
}

impl CoggingIdentification {
    /// Begins at this position; the motor stands, the position loop is closed, and the record has been emptied.
    #[must_use]
    pub fn start(settings: CoggingIdentificationSettings, position: Position) -> Self {
        Self {
            settings,
            range: Range { origin: position, maximum: settings.movement },
            state: IdentificationState::Running { percent: 0 },
            stage: Stage::Search,
            start: position,
            elapsed: 0,
            measured: CoggingMeasurement::default(),
        }
    }

    /// One tick: where the axis is to go, at 1 rpm, and how far the sequence has come.
    #[inline]
    pub fn tick(
        &mut self,
        inputs: &CoggingInputs,
        record: &mut CoggingRecord<'_>,
    ) -> (Position, IdentificationState<CoggingMeasurement>) {
        if let IdentificationState::Running { percent } = self.state {
            self.elapsed = self.elapsed.wrapping_add(1);
            self.state = match self.run(inputs, record) {
                Ok(None) => IdentificationState::Running { percent: percent.max(self.percent(inputs.position)) },
                Ok(Some(measurement)) => IdentificationState::Done(measurement),
                Err(error) => IdentificationState::Failed(error),
            };
        }
        let way = match self.stage {
            Stage::Search => SEARCH + RUN_UP,
            Stage::There => TURN,
            Stage::Back => 0,
        };
        (self.start + Position::from_bits(self.settings.along(way)), self.state)
    }

    /// In the first direction, from where the way there begins.
    #[inline]
    fn way(&self, position: Position) -> i64 {
        self.settings.along((position - self.start).to_bits())
    }

    #[inline]
    fn percent(&self, position: Position) -> u8 {
        let way = self.way(position);
        let turned = match self.stage {
            Stage::Search => 0,
            Stage::There => way,
            Stage::Back => (2 * TURN).wrapping_sub(way),
        };
        // 2.5 revolutions.
        (turned.wrapping_mul(40) >> 32).clamp(0, 99) as u8
    }

    #[inline]
    fn run(
        &mut self,
        inputs: &CoggingInputs,
        record: &mut CoggingRecord<'_>,
    ) -> Result<Option<CoggingMeasurement>, IdentificationError> {
        self.range.check(inputs.position)?;
        if inputs.is_limited {
            return Err(IdentificationError::TorqueLimit);
        }
        if self.elapsed > LONGEST {
            return Err(IdentificationError::NoMovement);
        }
        let way = self.way(inputs.position);
        let Some(origin) = inputs.origin else {
            // It was known once: increments have been lost.
            let lost = self.stage != Stage::Search;
            return if lost || way > SEARCH { Err(IdentificationError::NoIndex) } else { Ok(None) };
        };
        match self.stage {
            Stage::Search => {
                self.start = inputs.position;
                self.begin(Stage::There);
            }
            Stage::There => {
                self.sum_up(inputs, way, origin, record);
                if way >= TURN - ARRIVED {
                    self.begin(Stage::Back);
                }
            }
            Stage::Back => {
                self.sum_up(inputs, way, origin, record);
                if way <= ARRIVED {
                    return Ok(Some(self.measured));
                }
            }
        }
        Ok(None)
    }

    fn begin(&mut self, stage: Stage) {
        self.stage = stage;
        self.elapsed = 0;
    }

    #[inline]
    fn sum_up(&mut self, inputs: &CoggingInputs, way: i64, origin: u32, record: &mut CoggingRecord<'_>) {
        let backwards = self.stage == Stage::Back;
        let [near, far] = if backwards { &mut self.measured.back } else { &mut self.measured.there };
        if (RUN_UP..RUN_UP + EIGHTH).contains(&way) {
            near.add(inputs.current);
        } else if (ONCE..TWICE).contains(&way) {
            far.add(inputs.current);
        }
        if (RUN_UP..ONCE).contains(&way) {
            record.add((inputs.position.to_bits() as u32).wrapping_sub(origin), backwards, inputs.current);
        }
    }
}

#[cfg(test)]
mod tests {
    extern crate std;

    use super::*;
    use crate::axis::cogging::CoggingScale;
    use crate::identification::CoggingTable;
    use crate::units::Velocity;
    use std::f64::consts::TAU;
    use std::vec;
    use std::vec::Vec;

    /// Of 100 A.
    const PEAK: u32 = 100_000;
    const TURN_BITS: f64 = 4_294_967_296.0;

    fn settings(is_reversed: bool, hundredths: i64) -> Result<CoggingIdentificationSettings, SettingsError> {
        let acceleration = Acceleration::from_milliradians_per_second_squared(100_000);
        CoggingIdentificationSettings::new(
            is_reversed,
            acceleration,
            None,
            Position::from_bits((hundredths << 32) / 100),
        )
    }

    /// An axis that is exactly where it is led to at 1 rpm, and the current in shares of peak that it needs at a place, in a direction, and
    /// at a time in s.
    struct Ideal<F> {
        current: F,
        /// Where the index is; `None`: it has none.
        index: Option<i64>,
        is_known: bool,
        position: i64,
        limit: f64,
    }

    type End = (Result<CoggingMeasurement, IdentificationError>, Vec<CoggingRow>, [i64; 2]);

    impl<F: Fn(f64, f64, f64) -> f64> Ideal<F> {
        fn new(current: F) -> Self {
            Self { current, index: Some(1 << 30), is_known: true, position: 77 << 20, limit: 1.0 }
        }

        /// How it ends, and how far it went.
        fn run(mut self, settings: CoggingIdentificationSettings) -> End {
            let mut rows = vec![[0; 4]; COGGING_POINTS];
            let mut record = CoggingRecord::new(&mut rows);
            let start = self.position;
            let mut sequence = CoggingIdentification::start(settings, Position::from_bits(start));
            let step = i64::from(SPEED.to_bits()) >> 4;
            let (mut reached, mut last, mut direction) = ([0, 0], 0, 1.0);
            for tick in 0..3_000_000_u32 {
                let current = (self.current)(self.position as f64 / TURN_BITS, direction, f64::from(tick) / 8_000.0);
                let inputs = CoggingInputs {
                    position: Position::from_bits(self.position),
                    origin: self.index.filter(|_| self.is_known).map(|index| index as u32),
                    current: CurrentFraction::saturating_from_num(current.clamp(-self.limit, self.limit)),
                    is_limited: current.abs() > self.limit,
                };
                let (target, state) = sequence.tick(&inputs, &mut record);
                match state {
                    IdentificationState::Running { percent } => assert!(percent >= last && percent < 100),
                    IdentificationState::Done(measurement) => return (Ok(measurement), rows, reached),
                    IdentificationState::Failed(error) => return (Err(error), rows, reached),
                }
                if let IdentificationState::Running { percent } = state {
                    last = percent;
                }
                let before = self.position;
                self.position += (target.to_bits() - before).clamp(-step, step);
                direction = if self.position < before { -1.0 } else { 1.0 };
                let passes = |index: i64| (before - index) >> 32 != (self.position - index) >> 32;
                self.is_known |= self.index.is_some_and(passes);
                let way = self.position - start;
                reached = [reached[0].min(way), reached[1].max(way)];
            }
            panic!("it does not end");
        }
    }

    fn table(end: &End) -> Result<[i16; COGGING_POINTS], IdentificationError> {
        let (mut table, mut rows) = (CoggingTable::new(), end.1.clone());
        let record = CoggingRecord::new(&mut rows);
        (0..COGGING_POINTS).for_each(|bin| table.take(record.bin(bin)));
        table.finish(&end.0.unwrap(), &CoggingScale::new(PEAK).unwrap()).copied()
    }

    #[test]
    fn the_table_begins_at_the_index_whichever_way_the_axis_turns_first() {
        for is_reversed in [false, true] {
            for is_known in [false, true] {
                let mut axis = Ideal::new(|place, direction, _| {
                    0.03 * direction + 0.1 + 0.02 * (TAU * 11.0 * (place - 0.25)).sin()
                });
                axis.is_known = is_known;
                let end = axis.run(settings(is_reversed, 300).unwrap());
                let points = table(&end).unwrap();
                for (at, point) in points.iter().enumerate() {
                    let exact = 2_000.0 * (TAU * 11.0 * at as f64 / COGGING_POINTS as f64).sin();
                    assert!((f64::from(*point) - exact).abs() < 12.0, "{is_reversed}, {is_known}, {at}: {point}");
                }
                // 1.25 revolutions, and what the search takes: to the index at a quarter.
                let [back, there] = end.2.map(|way| way as f64 / TURN_BITS);
                let way = if is_reversed { -back } else { there };
                let searched = if is_known {
                    0.0
                } else if is_reversed {
                    0.768
                } else {
                    0.232
                };
                assert!((way - 1.25 - searched).abs() < 0.01, "{is_reversed}, {is_known}: {way}");
                assert!(if is_reversed { there } else { -back } < 0.001);
            }
        }
    }

    #[test]
    fn without_an_index_the_axis_turns_little_more_than_a_revolution_and_nothing_is_learnt() {
        let mut axis = Ideal::new(|_, _, _| 0.0);
        (axis.index, axis.is_known) = (None, false);
        let (end, _, [_, there]) = axis.run(settings(false, 300).unwrap());
        assert_eq!(end, Err(IdentificationError::NoIndex));
        assert!((there as f64 / TURN_BITS - 1.125).abs() < 0.001);
    }

    #[test]
    fn a_limit_of_the_torque_or_of_the_movement_ends_it() {
        let mut axis = Ideal::new(|place, _, _| 0.05 * (TAU * place).sin());
        axis.limit = 0.04;
        assert_eq!(axis.run(settings(false, 300).unwrap()).0, Err(IdentificationError::TorqueLimit));
        let mut axis = Ideal::new(|_, _, _| 0.0);
        axis.is_known = false;
        // The search takes 0.23 revolutions of it.
        let end = axis.run(settings(false, 140).unwrap()).0;
        assert!(matches!(end, Err(IdentificationError::TooMuchMovement { .. })), "{end:?}");
        assert!(settings(false, 130).is_ok());
        assert!(matches!(settings(false, 129), Err(SettingsError::OutOfRange { actual: 129, minimum: 130, .. })));
    }

    #[test]
    fn a_load_that_grows_with_the_way_or_comes_and_goes_is_no_cogging() {
        // A spring; a load of a minute and a half.
        let spring =
            |stiffness: f64| Ideal::new(move |place, _, _| stiffness * place).run(settings(false, 300).unwrap());
        assert_eq!(table(&spring(0.01)), Err(IdentificationError::UnevenLoad));
        assert!(table(&spring(0.000_5)).is_ok(), "in the noise");
        let swing = Ideal::new(|_, _, time| 0.05 * (TAU * time / 90.0).sin()).run(settings(false, 300).unwrap());
        assert_eq!(table(&swing), Err(IdentificationError::UnevenLoad));
    }

    #[test]
    fn an_axis_that_does_not_move_is_given_up() {
        let mut rows = vec![[0; 4]; COGGING_POINTS];
        let mut record = CoggingRecord::new(&mut rows);
        let mut sequence = CoggingIdentification::start(settings(false, 300).unwrap(), Position::ZERO);
        let inputs = CoggingInputs {
            position: Position::ZERO,
            origin: Some(0),
            current: CurrentFraction::ZERO,
            is_limited: false,
        };
        let end = (0..800_000).find_map(|tick| match sequence.tick(&inputs, &mut record).1 {
            IdentificationState::Running { .. } => None,
            state => Some((tick, state)),
        });
        let (ticks, state) = end.unwrap();
        assert_eq!(state, IdentificationState::Failed(IdentificationError::NoMovement));
        // A quarter more than 75 s, and two.
        assert!((760_000..770_000).contains(&ticks), "{ticks}");
        assert_eq!(Velocity::from_ten_thousandths_rpm(10_000).to_bits().abs_diff(SPEED.to_bits()), 0);
    }
}
