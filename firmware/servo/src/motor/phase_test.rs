//! Before the torque: a small current through all three phases of a motor that stands.
//!
//! Its direction is half way between two of the twelve in which a phase has nothing or two have the same: there the three phases are to carry 0.97, 0.71
//! and 0.26 of it, and whichever is open, the other two still carry a current that is seen. Of these directions it takes the one nearest to the
//! magnets, 15 degrees at most, so that a quarter of a small current makes torque. It flows to and fro, and leaves the rotor where it was.
//!
//! What has little or nothing there is asked again, turned by 60 degrees, and the sum of both counts: where the phase with the most is open little flows
//! in the other two, and the few volts of a slow current loop do not always get past the dead time of the bridge in the phase that has the least.
//!
//! The current is waited for as long as the current loop takes, and longer while it is on its way. One that falls short in all phases alike is
//! that of a slow loop, and no finding.

use crate::current::command::CurrentCommand;
use crate::current::readings::CurrentReadings;
use crate::monitor::open_phase::{Phases, phases};
use crate::units::CurrentFraction;

/// State of the test.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub(crate) struct PhaseTest {
    stage: Stage,
    /// Of the current, 2^-32 revolution.
    direction: u32,
    wait: Wait,
}

/// How long a current loop is waited for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
struct Wait {
    /// At least so many steps in each direction.
    steps: u8,
    /// It has set the current by then, for certain: where there is none, something is wrong.
    certain: bool,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
enum Stage {
    /// To be made when torque is wanted the next time.
    #[default]
    Due,
    /// The bridge is to close; so many steps have been waited for it.
    Closing(u8),
    /// Under way for so many steps, turned or not, with what was seen.
    Flowing { turned: bool, steps: u8, seen: Seen },
    /// Passed, or not to be made, until the bridge has been open.
    Over,
    /// Told of, until the torque is not wanted any more.
    Failed,
}

/// What was asked, and what flowed, at the end of each of the two directions; the steps of the first one, 0 while that goes on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
struct Seen {
    asked: Phases,
    flowed: Phases,
    forth: u8,
}

/// What a step of the test needs to know.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Look {
    /// Torque, and nothing is in its way.
    pub(crate) wanted: bool,
    pub(crate) standstill: bool,
    /// The bridge switches.
    pub(crate) bridge_on: bool,
    /// Electrical angle of the magnets, 0 where it is not known.
    pub(crate) magnets: u32,
    /// Time constant of the current loop in us, inductance / S-0-0106; `None` where it is not known.
    pub(crate) loop_time: Option<u32>,
    /// The d current that was asked for, and what flowed, at this angle.
    pub(crate) asked: CurrentFraction,
    pub(crate) readings: CurrentReadings,
    pub(crate) angle: u32,
}

/// What a step of the test asks for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Step {
    /// Nothing: there is no test, or no more.
    Over,
    /// The bridge closed, and a current along an angle.
    Flow(u32, CurrentFraction),
    /// The bridge open; what was found, once.
    Failed(Option<Finding>),
}

/// What is wrong with the phases.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Finding {
    /// One of them is open.
    Open,
    /// No current anywhere: converters that have stopped, or no motor at all.
    Nothing,
}

/// Steps of the supervision for which the bridge is waited for, 10 ms. The sequence tells of one that does not come.
const PATIENCE: u8 = 20;
/// Steps of the current in one direction, 1.5 to 40 ms.
const SHORTEST: u8 = 3;
const LONGEST: u8 = 80;
/// A loop that takes longer is too slow to tell nothing from something: below 32 Hz.
const CERTAIN: u8 = 20;
const STEP_MICROSECONDS: u32 = 500;
/// 5 % of peak.
const CURRENT: CurrentFraction = CurrentFraction::from_bits(1_638);
/// Twelve directions in a revolution.
const TWELFTH: u32 = u32::MAX / 12 + 1;

impl PhaseTest {
    /// There is none until the torque is off and not wanted.
    #[inline]
    pub(crate) fn is_over(&self) -> bool {
        self.stage == Stage::Over
    }

    /// One step of the supervision without torque: where there is some, a load may hang on it.
    pub(crate) fn tick(&mut self, look: &Look) -> Step {
        if !look.wanted {
            // A bridge that is still closed is the one that was tested.
            let tested = self.is_over() && look.bridge_on;
            return self.end(if tested { Stage::Over } else { Stage::Due });
        }
        match self.stage {
            Stage::Over => Step::Over,
            Stage::Failed => Step::Failed(None),
            // What turns is watched as soon as a current flows, and the test would be felt.
            Stage::Due if !look.standstill => self.end(Stage::Over),
            Stage::Due => {
                self.direction = nearest(look.magnets);
                self.wait = Wait::of(look.loop_time);
                self.go_on(Stage::Closing(0), CurrentFraction::ZERO)
            }
            Stage::Closing(PATIENCE) => self.end(Stage::Over),
            Stage::Closing(waited) if !look.bridge_on => {
                self.go_on(Stage::Closing(waited.wrapping_add(1)), CurrentFraction::ZERO)
            }
            Stage::Closing(_) => self.begin(false, Seen::default()),
            Stage::Flowing { .. } if !look.bridge_on => self.end(Stage::Over),
            Stage::Flowing { turned, steps, seen } => self.flow(look, turned, steps.wrapping_add(1), seen),
        }
    }

    fn begin(&mut self, turned: bool, before: Seen) -> Step {
        self.go_on(Stage::Flowing { turned, steps: 0, seen: Seen { forth: 0, ..before } }, CURRENT)
    }

    fn flow(&mut self, look: &Look, turned: bool, steps: u8, mut seen: Seen) -> Step {
        let readings = &look.readings;
        let asked = phases([CurrentCommand::reference(look.asked), 0], look.angle);
        let flowing = phases([readings.direct, readings.quadrature], look.angle);
        let ends = if seen.forth == 0 { self.wait.ends(steps, &flowing, &asked) } else { steps == seen.forth };
        if !ends {
            let current = if seen.forth == 0 { CURRENT } else { CURRENT.saturating_neg() };
            return self.go_on(Stage::Flowing { turned, steps, seen }, current);
        }
        seen.asked.add(&asked);
        seen.flowed.add(&flowing);
        if seen.forth == 0 {
            seen.forth = steps;
            return self.go_on(Stage::Flowing { turned, steps: 0, seen }, CURRENT.saturating_neg());
        }
        let nothing = seen.flowed.are_nothing_beside(&seen.asked);
        let open = !nothing && seen.flowed.lack_a_share_of(&seen.asked);
        if !turned && (nothing || open) {
            self.direction = self.direction.wrapping_add(2 * TWELFTH);
            return self.begin(true, seen);
        }
        let finding = if open {
            Finding::Open
        } else if nothing && self.wait.certain {
            Finding::Nothing
        } else {
            return self.end(Stage::Over);
        };
        self.stage = Stage::Failed;
        Step::Failed(Some(finding))
    }

    fn go_on(&mut self, stage: Stage, current: CurrentFraction) -> Step {
        self.stage = stage;
        Step::Flow(self.direction, current)
    }

    fn end(&mut self, stage: Stage) -> Step {
        self.stage = stage;
        Step::Over
    }
}

impl Wait {
    /// Twice the time constant: 86 % of the current.
    fn of(loop_time: Option<u32>) -> Self {
        let Some(time) = loop_time else { return Self { steps: CERTAIN, certain: false } };
        let steps = time.saturating_mul(2).div_ceil(STEP_MICROSECONDS);
        // Within a byte.
        Self { steps: steps.clamp(SHORTEST.into(), LONGEST.into()) as u8, certain: steps <= u32::from(CERTAIN) }
    }

    /// After so many steps there is enough to tell: all of it, one phase that has nothing, or nothing at all that would be on its way.
    fn ends(self, steps: u8, flowing: &Phases, asked: &Phases) -> bool {
        let told =
            || flowing.are_a_quarter_of(asked) || flowing.are_nothing_beside(asked) || flowing.lack_a_share_of(asked);
        steps >= LONGEST || steps >= self.steps && told()
    }
}

/// The direction of the test that is nearest to an angle.
const fn nearest(angle: u32) -> u32 {
    let twelfth = ((angle as u64).wrapping_mul(12) >> 32) as u32;
    twelfth.wrapping_mul(TWELFTH).wrapping_add(TWELFTH / 2)
}

#[cfg(test)]
mod tests {
    use super::*;

    const STANDING: Look = Look {
        wanted: true,
        standstill: true,
        bridge_on: true,
        magnets: 0,
        loop_time: Some(100),
        asked: CurrentFraction::ZERO,
        readings: CurrentReadings { direct: 0, quadrature: 0, direct_voltage: 0, quadrature_voltage: 0 },
        angle: 0,
    };

    /// The steps of a test until it ends, with what flows of what is asked for.
    fn run(test: &mut PhaseTest, share: i32) -> (u32, Step) {
        run_with(test, share, STANDING.loop_time)
    }

    fn run_with(test: &mut PhaseTest, share: i32, loop_time: Option<u32>) -> (u32, Step) {
        let mut look = Look { loop_time, ..STANDING };
        for step in 1..400 {
            match test.tick(&look) {
                Step::Flow(angle, current) => {
                    let direct = CurrentCommand::reference(current) / 100 * share;
                    look =
                        Look { asked: current, angle, readings: CurrentReadings { direct, ..look.readings }, ..look };
                }
                end => return (step, end),
            }
        }
        panic!("the test does not end");
    }

    #[test]
    fn a_sound_motor_passes_in_eight_steps_and_is_tested_anew_when_torque_is_wanted_again() {
        let mut test = PhaseTest::default();
        assert_eq!(run(&mut test, 100), (8, Step::Over));
        assert_eq!(test.tick(&STANDING), Step::Over);
        for bridge_on in [true, false] {
            assert_eq!(test.tick(&Look { wanted: false, bridge_on, ..STANDING }), Step::Over);
            assert_eq!(test.is_over(), bridge_on, "until the bridge has been open");
        }
        assert_eq!(run(&mut test, 30), (8, Step::Over));
    }

    #[test]
    fn no_current_in_two_directions_is_told_once() {
        let mut test = PhaseTest::default();
        assert_eq!(run(&mut test, 2), (14, Step::Failed(Some(Finding::Nothing))));
        assert_eq!(test.tick(&STANDING), Step::Failed(None));
        assert_eq!(test.tick(&Look { wanted: false, ..STANDING }), Step::Over);
    }

    #[test]
    fn a_current_is_waited_for_as_long_as_its_loop_takes_and_falls_short_in_all_phases_alike_without_a_finding() {
        let run = |share, time| run_with(&mut PhaseTest::default(), share, time);
        for (time, steps) in
            [(None, 20), (Some(0), 3), (Some(750), 3), (Some(751), 4), (Some(5_000), 20), (Some(u32::MAX), 80)]
        {
            assert_eq!(run(100, time), (2 + 2 * steps, Step::Over), "{time:?}");
        }
        // On its way: 40 ms in each direction, and no finding.
        assert_eq!(run(20, Some(100)), (2 + 160, Step::Over));
        // Nothing at all is a finding where the loop is known to be fast enough to tell.
        assert_eq!(run(2, Some(5_000)), (2 + 80, Step::Failed(Some(Finding::Nothing))));
        assert_eq!(run(2, Some(5_001)), (2 + 84, Step::Over));
        assert_eq!(run(2, None), (2 + 80, Step::Over));
    }

    #[test]
    fn a_bridge_that_does_not_come_and_an_axis_that_turns_are_left_to_others() {
        let mut test = PhaseTest::default();
        let open = Look { bridge_on: false, ..STANDING };
        let steps = (1..).find(|_| test.tick(&open) == Step::Over);
        assert_eq!(steps, Some(22));
        assert_eq!(PhaseTest::default().tick(&Look { standstill: false, ..STANDING }), Step::Over);
    }

    #[test]
    fn the_direction_is_within_fifteen_degrees_of_the_magnets_and_leaves_no_phase_without_a_quarter() {
        for step in 0..7_200_u32 {
            let magnets = step.wrapping_mul(596_523);
            let direction = nearest(magnets);
            let beside = f64::from(direction.wrapping_sub(magnets).cast_signed()) / 4_294_967_296.0 * 360.0;
            assert!(beside.abs() < 15.001, "{step}: {beside}");
            for phase in 0..3 {
                let turns = f64::from(direction) / 4_294_967_296.0 - f64::from(phase) / 3.0;
                assert!((turns * core::f64::consts::TAU).cos().abs() > 0.258, "{step}, {phase}");
            }
        }
    }
}
