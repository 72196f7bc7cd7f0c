//! Position data of 32 bits on an axis that turns for ever: command and feedback are compared modulo 2^32.

use proptest::prelude::*;
use servo::path::{Interpolator, InterpolatorSettings};
use servo::units::{Modulo, ModuloCounter, Position, PositionScale};

/// An axis whose place is counted in increments, exactly, as far as 128 bits go.
struct Axis {
    scale: PositionScale,
    range: Modulo,
    numerator: i128,
    denominator: i128,
    feedback: ModuloCounter,
}

impl Axis {
    fn new(numerator: u64, denominator: u64) -> Option<Self> {
        Some(Self {
            scale: PositionScale::new(numerator, denominator).ok()?,
            range: Modulo::of_all_data(numerator, denominator).ok()?,
            numerator: numerator.into(),
            denominator: denominator.into(),
            feedback: ModuloCounter::default(),
        })
    }

    /// The place of so many increments in 2^-32 revolution, as the encoder's wrapping position has it.
    fn place(&self, increments: i128) -> Position {
        Position::from_bits(((increments * self.denominator) << 32).div_euclid(self.numerator) as i64)
    }

    /// What S-0-0051 shows there.
    fn shown(&mut self, increments: i128) -> i32 {
        let place = self.place(increments);
        let within = self.feedback.wrap(&self.range, place);
        self.scale.from_position(within)
    }

    /// S-0-0047 as the axis takes it.
    fn commanded(&self, data: i32) -> Position {
        self.range.reduce(self.scale.to_position(data))
    }

    /// The feedback stands in this turn of the data, as after so many turns one by one.
    fn turn_to(&mut self, increments: i128) {
        let turns = (increments + (1 << 31)).div_euclid(1 << 32);
        // One turn of the data a call is what a moving axis needs; here the turns are gone through a run of them at a time.
        let place = self.place(turns << 32);
        self.feedback = ModuloCounter::containing(&self.range, place);
    }
}

proptest! {
    /// The following error after every command is the way of the command, however often the data have gone round.
    #[test]
    fn a_small_step_of_the_data_is_a_small_step_of_the_axis_in_every_scaling(
        numerator in 4_u64..1 << 31, denominator in 1_u64..1 << 12,
        start in -(1_i64 << 33)..1 << 33, backwards in any::<bool>(), stride in 1_i64..1 << 30,
    ) {
        let Some(mut axis) = Axis::new(numerator, denominator) else { return Ok(()) };
        let settings = InterpolatorSettings::new(4, Some(axis.range)).unwrap();
        let start = i128::from(start) % (axis.numerator << 30) / axis.denominator.max(1);
        axis.turn_to(start);
        axis.shown(start);
        let ranges = axis.feedback;
        let mut interpolator = Interpolator::new(axis.place(start), ranges);
        let stride = i128::from(if backwards { -stride } else { stride });
        let mut place = start;
        // Several turns of the data at the longest stride.
        for _ in 0..40 {
            place += stride;
            let data = place as i32;
            interpolator.command(&settings, axis.commanded(data)).unwrap();
            for _ in 0..4 {
                interpolator.tick(&settings);
            }
            let off = (interpolator.position() - axis.place(place)).to_bits();
            // Half a step of the data's scale in 2^31 increments, one for the cut of the place, one for each turn's fraction.
            prop_assert!(off.abs() <= 4, "{} steps off at {}", off, place);
            let shown = axis.shown(place);
            prop_assert!(shown.wrapping_sub(data).abs() <= 1, "{} shown, {} commanded", shown, data);
        }
    }
}

#[test]
fn data_are_right_where_the_64_bits_of_the_position_go_round() {
    // Seven turns of the motor for three of the load: 2^32 turns of the motor are no whole number of increments.
    let mut axis = Axis::new(3_600_000 * 3, 7).unwrap();
    let settings = InterpolatorSettings::new(4, Some(axis.range)).unwrap();
    let revolution = axis.numerator / axis.denominator;
    let border = revolution << 31;
    for direction in [1, -1] {
        // The turn of the data just before the border, found by dividing while the position is still in 64 bits.
        let mut place = direction * (border - 4_000 * revolution);
        axis.feedback = ModuloCounter::containing(&axis.range, axis.place(place));
        let mut interpolator = Interpolator::new(axis.place(place), axis.feedback);
        let before = axis.place(place).to_bits().signum();
        for _ in 0..80 {
            place += direction * 100 * revolution;
            let data = axis.shown(place);
            assert!(
                (i128::from(data) - place).rem_euclid(1 << 32).min((place - i128::from(data)).rem_euclid(1 << 32)) <= 1
            );
            interpolator.command(&settings, axis.commanded(place as i32)).unwrap();
            for _ in 0..4 {
                interpolator.tick(&settings);
            }
            let off = (interpolator.position() - axis.place(place)).to_bits();
            assert!(off.abs() <= 4, "{off} steps off");
        }
        assert_ne!(axis.place(place).to_bits().signum(), before, "the position has gone round");
    }
}
