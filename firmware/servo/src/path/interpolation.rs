//! From one command value per control unit cycle to one per loop tick.
//!
//! A command that becomes valid at t3 is reached exactly one control unit cycle later, on a straight line or, with the same latency,
//! on a cubic without a jump of the velocity. The path is worked out once per command, with the reciprocal of the number of ticks,
//! so that a tick is a few additions.
//!
//! The loop timer is trimmed to the ring's clock, so a cycle has its number of ticks once locked, and may have one more or
//! less before. Each line starts where the last tick left off: a tick too few or too many bends the slope, the position never jumps.

use crate::arithmetic::wide::times_fraction;
use crate::path::command_step::CommandJump;
use crate::path::cubic::Cubic;
use crate::path::setpoint::{CommandSource, Setpoint};
use crate::path::settings::{Interpolation, InterpolatorSettings};
use crate::units::derivatives::SignedAcceleration;
use crate::units::modulo::ModuloCounter;
use crate::units::{Position, Velocity};

/// 2^32 / 3.
const A_THIRD: i32 = 1_431_655_765;
/// Bits of a slope below a position step: the line runs in 2^-48 revolution.
const FINE_BITS: u32 = 16;
/// Longest line in whole revolutions, four times the way at [`Velocity::MAX`] in the longest cycle.
const LONGEST: i32 = 64;

/// Where the line ends, in 2^-48 revolution: half a position step, so that cutting to steps is rounding to the nearest, and a slope that
/// was rounded down ends at the command.
const END: i64 = 1 << (FINE_BITS - 1);

/// Interpolates position commands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Interpolator {
    /// Place on the straight line, in 2^-48 revolution: before [`END`] until the command is reached, beyond it while extrapolating.
    place: i64,
    /// In 2^-48 revolution per tick.
    slope: i64,
    /// End of the path.
    target: Position,
    /// Of the slope.
    speed: Velocity,
    /// Ticks to the end of the path: on a line, on a cubic, and how many since then without a command.
    line: u16,
    curve: u16,
    overdue: u16,
    /// The path is the cubic, also at its end: neither place nor slope are those of a line.
    bent: bool,
    cubic: Cubic,
    /// What the line has gained over the one before it, spread over the cycle.
    acceleration: SignedAcceleration,
    /// Way from the last command to this one, in position steps per cycle.
    way: i64,
    /// Velocity at the end of the path, in position steps per cycle.
    exit: i64,
    ranges: ModuloCounter,
    /// Started, and no command has come yet: the loops begin to follow with the next.
    starting: bool,
    /// The command that was in force then.
    standing: Option<Position>,
}

impl Interpolator {
    /// Stands at `position`.
    #[must_use]
    pub const fn new(position: Position, ranges: ModuloCounter) -> Self {
        Self {
            place: END,
            slope: 0,
            target: position,
            speed: Velocity::ZERO,
            line: 0,
            curve: 0,
            overdue: 0,
            bent: false,
            cubic: Cubic::AT_REST,
            acceleration: SignedAcceleration::ZERO,
            way: 0,
            exit: 0,
            ranges,
            starting: false,
            standing: None,
        }
    }

    /// Starts anew at `position`, moving with `velocity` until the first command comes (for two cycles at most).
    ///
    /// `ranges` is the modulo range near `position` (from the feedback's counter).
    pub fn start(
        &mut self,
        settings: &InterpolatorSettings,
        position: Position,
        velocity: Velocity,
        ranges: ModuloCounter,
    ) {
        let slope = i64::from(velocity.to_bits()) << 12;
        let way = slope.wrapping_mul(i64::from(settings.ticks_per_cycle())) >> FINE_BITS;
        *self = Self { slope, speed: velocity, way, exit: way, starting: true, ..Self::new(position, ranges) };
    }

    /// The command that was in force when the interpolator was started between two commands: no step from it may pass for a first command.
    pub fn note_standing(&mut self, settings: &InterpolatorSettings, command: Position) {
        if self.starting && self.standing.is_none() {
            let mut ranges = self.ranges;
            self.standing = Some(match settings.modulo() {
                Some(modulo) => ranges.unwrap_nearest(modulo, command, self.target),
                None => command,
            });
        }
    }

    /// Takes the command that became valid at t3: reached after one cycle of ticks.
    ///
    /// # Errors
    /// [`CommandJump`] when it is further away than the limits of the settings allow. It is not taken then: the path goes on as it was.
    #[inline]
    pub fn command(&mut self, settings: &InterpolatorSettings, command: Position) -> Result<(), CommandJump> {
        let here = self.position();
        let target = match settings.modulo() {
            Some(modulo) => self.ranges.unwrap_nearest(modulo, command, self.target),
            None => command,
        };
        if self.starting || settings.limits().is_passed_by((target - self.target).to_bits()) {
            self.look_at(settings, target)?;
        }
        let distance = limited((target - here).to_bits());
        // From command to command, not from here: what an extrapolation was off by must not come back as a velocity, and grow.
        let commanded = limited((target - self.target).to_bits());
        let way = self.per_cycle(settings, commanded);
        self.target = target;
        self.overdue = 0;
        self.bent = settings.interpolation() == Interpolation::Cubic;
        match settings.interpolation() {
            Interpolation::Linear => {
                [self.line, self.curve] = [settings.ticks_per_cycle(), 0];
                self.place = END.wrapping_sub(distance << FINE_BITS);
                self.follow(settings.per_tick(distance << FINE_BITS));
                // From command to command: the line itself has it all in its first tick.
                let gained = settings.per_square_of_ticks(way.wrapping_sub(self.way) << FINE_BITS);
                self.acceleration = SignedAcceleration::from_bits(gained);
            }
            Interpolation::Cubic => {
                [self.line, self.curve] = [0, settings.ticks_per_cycle()];
                let entry = self.exit;
                self.exit = way.wrapping_add(way.wrapping_sub(self.way) >> 1);
                self.cubic = Cubic::over(settings, distance, entry, self.exit);
                // What follows if the next command does not come: a line with the last velocity.
                self.place = END;
                self.follow(settings.per_tick(self.exit << FINE_BITS));
            }
        }
        self.way = way;
        Ok(())
    }

    /// A command that needs a closer look: the first one, and one that is far from the one before.
    #[cold]
    #[inline(never)]
    fn look_at(&mut self, settings: &InterpolatorSettings, target: Position) -> Result<(), CommandJump> {
        if self.starting {
            // An axis that turns is not where it starts when the command is reached, but a cycle further.
            let ahead = (target - self.position()).to_bits().wrapping_sub(self.way);
            settings.limits().look_at_first(ahead)?;
            if let Some(standing) = self.standing {
                let cycles = if self.overdue > settings.ticks_per_cycle() { 2 } else { 1 };
                settings.limits().look_at_step((target - standing).to_bits(), cycles)?;
            }
            self.starting = false;
            return Ok(());
        }
        settings.limits().look_at_step((target - self.target).to_bits(), self.cycles_since_command(settings))
    }

    /// Cycles since the last command: one, or as many as commands were missing more, up to three.
    #[inline]
    fn cycles_since_command(&self, settings: &InterpolatorSettings) -> u64 {
        // At the end of the path, or before it.
        if self.overdue == 0 { 1 } else { self.cycles_without_command(settings) }
    }

    #[cold]
    fn cycles_without_command(&self, settings: &InterpolatorSettings) -> u64 {
        let cycle = u32::from(settings.ticks_per_cycle());
        let ticks = cycle.saturating_sub(self.line.max(self.curve).into()).saturating_add(self.overdue.into());
        let half_cycles = ticks.saturating_mul(2);
        if half_cycles <= cycle.saturating_mul(3) {
            1
        } else if half_cycles <= cycle.saturating_mul(5) {
            2
        } else {
            3
        }
    }

    /// The way since the last command, spread over the cycles that it has taken.
    #[inline]
    fn per_cycle(&self, settings: &InterpolatorSettings, commanded: i64) -> i64 {
        match self.cycles_since_command(settings) {
            1 => commanded,
            2 => commanded >> 1,
            _ => times_fraction(commanded, A_THIRD),
        }
    }

    #[inline]
    fn follow(&mut self, slope: i64) {
        self.slope = slope;
        self.speed = Velocity::saturating_from_bits(slope >> 12);
    }

    /// One tick further: the setpoint of this tick.
    #[inline]
    pub fn tick(&mut self, settings: &InterpolatorSettings) -> (Setpoint, CommandSource) {
        if self.line != 0 {
            self.line = self.line.saturating_sub(1);
            self.place = self.place.wrapping_add(self.slope);
            return (self.on_the_line(), CommandSource::Interpolated);
        }
        if self.curve != 0 {
            return (self.tick_on_the_curve(), CommandSource::Interpolated);
        }
        self.tick_without_command(settings)
    }

    #[inline]
    fn tick_on_the_curve(&mut self) -> Setpoint {
        self.curve = self.curve.saturating_sub(1);
        let (velocity, acceleration) = self.cubic.tick();
        Setpoint { position: self.target + self.cubic.place(), velocity, acceleration }
    }

    /// A tick behind the end of the path: its line goes on. Not inline: what it takes of the registers costs every other tick 20 instructions.
    #[cold]
    #[inline(never)]
    fn tick_without_command(&mut self, settings: &InterpolatorSettings) -> (Setpoint, CommandSource) {
        self.bent = false;
        self.acceleration = SignedAcceleration::ZERO;
        if self.overdue < settings.ticks_per_cycle() << 1 {
            self.overdue = self.overdue.wrapping_add(1);
            self.place = self.place.wrapping_add(self.slope);
            return (self.on_the_line(), CommandSource::Extrapolated);
        }
        self.hold()
    }

    fn hold(&mut self) -> (Setpoint, CommandSource) {
        self.follow(0);
        self.way = 0;
        self.exit = 0;
        (self.on_the_line(), CommandSource::Held)
    }

    /// The setpoint of the last tick.
    #[inline]
    #[must_use]
    pub fn setpoint(&self) -> Setpoint {
        if self.bent {
            let (velocity, acceleration) = self.cubic.last();
            Setpoint { position: self.position(), velocity, acceleration }
        } else {
            self.on_the_line()
        }
    }

    /// The accelerations with which the path to the last command begins and ends.
    #[inline]
    #[must_use]
    pub fn accelerations(&self) -> [SignedAcceleration; 2] {
        if self.bent { self.cubic.accelerations(self.curve) } else { [self.acceleration; 2] }
    }

    /// The setpoint position of the last tick.
    #[inline]
    #[must_use]
    pub fn position(&self) -> Position {
        if self.bent { self.target + self.cubic.place() } else { self.on_the_line().position }
    }

    /// The setpoint of a path that is no cubic.
    #[inline]
    fn on_the_line(&self) -> Setpoint {
        let position = self.target + Position::from_bits(self.place >> FINE_BITS);
        Setpoint { position, velocity: self.speed, acceleration: self.acceleration }
    }

    /// The setpoint velocity: what the last tick moved, or with a new line what the next one will.
    #[inline]
    #[must_use]
    pub fn velocity(&self) -> Velocity {
        self.setpoint().velocity
    }

    /// The last commanded position, unbounded.
    #[must_use]
    pub const fn target(&self) -> Position {
        self.target
    }

    /// The same, once there has been a command since the start.
    #[must_use]
    pub fn aim(&self) -> Option<Position> {
        (!self.starting).then_some(self.target)
    }

    /// Shifts the line by `difference` without a movement (homing).
    pub fn shift(&mut self, difference: Position) {
        self.target = self.target + difference;
    }

    /// Takes over the modulo range near the axis, after a change of the modulo value or of the zero.
    pub fn set_ranges(&mut self, ranges: ModuloCounter) {
        self.ranges = ranges;
    }
}

/// A way in position steps, at most as long as the longest line. Of most the whole revolutions say that they are shorter.
#[inline]
const fn limited(way: i64) -> i64 {
    const LIMIT: i64 = (LONGEST as i64) << 32;
    let revolutions = (way >> 32) as i32;
    if revolutions >= LONGEST {
        LIMIT
    } else if revolutions < -LONGEST {
        -LIMIT
    } else {
        way
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::SettingsError;
    use crate::path::command_step::CommandLimits;
    use crate::units::modulo::Modulo;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_way_is_limited_to_64_revolutions(way in any::<i64>(), near in -3_i64..=3, bits in 0_u32..64) {
            for way in [way >> bits, (64 << 32) + near, near - (64 << 32)] {
                prop_assert_eq!(limited(way), way.clamp(-64 << 32, 64 << 32));
            }
        }
    }

    #[test]
    fn a_first_command_is_no_further_from_the_one_in_force_than_a_step_and_from_the_axis_than_the_window() {
        let limits = CommandLimits::new(Position::from_bits(100), Position::from_bits(1_000));
        let settings = settings(16).with_limits(limits);
        // The command in force, the next one, and ticks until it comes: a cycle, or with a lost MDT two.
        for (standing, command, ticks, taken) in [
            (None, 900, 4, true),
            (Some(0), 100, 4, true),
            (Some(0), 101, 4, false),
            (Some(0), 200, 17, true),
            (Some(0), 201, 17, false),
            (Some(880), 900, 4, true),
            (Some(1_050), 1_001, 4, false),
        ] {
            let mut interpolator = Interpolator::new(Position::ZERO, ModuloCounter::default());
            interpolator.start(&settings, Position::ZERO, Velocity::ZERO, ModuloCounter::default());
            if let Some(standing) = standing {
                interpolator.note_standing(&settings, Position::from_bits(standing));
                interpolator.note_standing(&settings, Position::from_bits(command));
            }
            for _ in 0..ticks {
                interpolator.tick(&settings);
            }
            let result = interpolator.command(&settings, Position::from_bits(command));
            assert_eq!(result.is_ok(), taken, "{standing:?} {command} {ticks}: {result:?}");
            // What follows is a step from the command before, whatever stood.
            assert!(!taken || interpolator.command(&settings, Position::from_bits(command + 100)).is_ok());
        }
    }

    fn settings(ticks: u16) -> InterpolatorSettings {
        InterpolatorSettings::new(ticks, None).unwrap()
    }

    fn standing() -> Interpolator {
        Interpolator::new(Position::ZERO, ModuloCounter::default())
    }

    #[test]
    fn cycles_out_of_range_are_refused() {
        for ticks in [0, 3, 521] {
            assert_eq!(InterpolatorSettings::new(ticks, None), Err(SettingsError::TicksPerCycle { actual: ticks }));
        }
        assert_eq!(settings(520).ticks_per_cycle(), 520);
    }

    #[test]
    fn a_command_is_reached_on_a_straight_line() {
        let settings = settings(4);
        let mut interpolator = standing();
        interpolator.command(&settings, Position::from_bits(1_000)).unwrap();
        let positions: [i64; 4] = core::array::from_fn(|_| interpolator.tick(&settings).0.position.to_bits());
        assert_eq!(positions, [250, 500, 750, 1_000]);
        assert_eq!(interpolator.velocity(), Velocity::from_bits(250 << 4));
        let (setpoint, source) = interpolator.tick(&settings);
        assert_eq!((setpoint.position.to_bits(), source), (1_250, CommandSource::Extrapolated));
    }

    #[test]
    fn a_late_command_bends_the_line_and_the_position_does_not_jump() {
        let settings = settings(10);
        let mut interpolator = standing();
        for (cycle, ticks) in [(1, 10), (2, 11), (3, 9), (4, 10), (5, 9), (6, 11)] {
            interpolator.command(&settings, Position::from_bits(cycle * 10_000)).unwrap();
            for _ in 0..ticks {
                let before = interpolator.position();
                let step = (interpolator.tick(&settings).0.position - before).to_bits();
                assert!((890..=1_210).contains(&step), "step of {step}");
            }
        }
    }

    #[test]
    fn after_two_missing_cycles_it_stands() {
        let settings = settings(4);
        let mut interpolator = standing();
        interpolator.command(&settings, Position::from_bits(400)).unwrap();
        let run: [(i64, CommandSource); 14] = core::array::from_fn(|_| {
            let (setpoint, source) = interpolator.tick(&settings);
            (setpoint.position.to_bits(), source)
        });
        assert_eq!(run[11], (1_200, CommandSource::Extrapolated));
        assert_eq!(run[13], (1_200, CommandSource::Held));
        assert_eq!(interpolator.velocity(), Velocity::ZERO);
    }

    #[test]
    fn a_start_in_full_run_goes_on_with_its_velocity_until_the_first_command() {
        let settings = settings(8);
        let mut interpolator = standing();
        let start = Position::from_bits(5_000);
        interpolator.start(&settings, start, Velocity::from_bits(-160), ModuloCounter::default());
        assert_eq!(interpolator.position(), start);
        assert_eq!(interpolator.tick(&settings).0.position.to_bits(), 4_990);
        interpolator.command(&settings, Position::from_bits(4_910)).unwrap();
        for _ in 0..8 {
            interpolator.tick(&settings);
        }
        assert_eq!(interpolator.position().to_bits(), 4_910);
    }

    #[test]
    fn the_slowest_movement_loses_nothing() {
        // One position step in 100 cycles of 520 ticks.
        let settings = settings(520);
        let mut interpolator = standing();
        for cycle in 1..=1_000_i64 {
            interpolator.command(&settings, Position::from_bits(cycle / 100)).unwrap();
            for _ in 0..520 {
                interpolator.tick(&settings);
            }
            assert_eq!(interpolator.position().to_bits(), cycle / 100);
        }
    }

    proptest! {
        #[test]
        fn every_command_is_reached_exactly_at_the_end_of_its_cycle_without_passing_it(
            ticks in 4_u16..=520, steps in proptest::collection::vec(-(1_i64 << 36)..1 << 36, 1..40),
        ) {
            let settings = settings(ticks);
            let mut interpolator = standing();
            let mut target = 0;
            for step in steps {
                target += step;
                interpolator.command(&settings, Position::from_bits(target)).unwrap();
                let mut last = interpolator.position().to_bits();
                for tick in 1..=ticks {
                    let (setpoint, source) = interpolator.tick(&settings);
                    prop_assert_eq!(source, CommandSource::Interpolated);
                    let position = setpoint.position.to_bits();
                    // Within one position step of the line.
                    let line = i128::from(target - step) + (i128::from(step) * i128::from(tick)).div_euclid(i128::from(ticks));
                    prop_assert!((i128::from(position) - line).abs() <= 1, "{} beside the line", i128::from(position) - line);
                    prop_assert!((position - last).abs() <= (step.abs() / i64::from(ticks)) + 2);
                    last = position;
                }
                prop_assert_eq!(last, target);
            }
        }

        #[test]
        fn modulo_commands_go_the_shortest_way(
            ticks in 4_u16..=100, numerator in 1_u64..50, denominator in 1_u64..50,
            shares in proptest::collection::vec(-0.49_f64..0.49, 1..60),
        ) {
            let Ok(modulo) = Modulo::from_ratio(numerator, denominator) else { return Ok(()) };
            let settings = InterpolatorSettings::new(ticks, Some(modulo)).unwrap();
            let mut interpolator = standing();
            let whole = modulo.value().to_bits();
            let mut unbounded = 0_i64;
            for share in shares {
                unbounded += (share * whole as f64) as i64;
                let command = ModuloCounter::containing(&modulo, Position::from_bits(unbounded)).wrap(&modulo, Position::from_bits(unbounded));
                interpolator.command(&settings, command).unwrap();
                for _ in 0..ticks {
                    interpolator.tick(&settings);
                }
                prop_assert_eq!(interpolator.position().to_bits(), unbounded);
            }
        }
    }
}
