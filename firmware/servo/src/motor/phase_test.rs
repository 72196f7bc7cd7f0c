//! Before the torque: a small current through all three phases of a motor that stands.
//!
//! Its direction is half way between two of the twelve in which a phase has nothing or two have the same: there the three phases are to carry 0.97, 0.71
//! and 0.26 of it, and whichever is open, the other two still carry a current that is seen. Of these directions it takes the one nearest to the
//! magnets, 15 degrees at most, so that a quarter of a small current makes torque. It flows to and fro, and leaves the rotor where it was.
//!
//! Where the phase with the most is open, little flows in the other two. Nothing at all is therefore asked again, turned by 60 degrees, where these
//! two have the most.

use super::Motor;
use super::facts::BoardKind;
use super::fault::{MotorFault, MotorFaults};
use super::sequence::{Sequence, SequenceInputs};
use crate::current::command::CurrentCommand;
use crate::monitor::open_phase::{Phases, phases};
use crate::units::CurrentFraction;

/// How far the test has come.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub(crate) enum PhaseTest {
    /// To be made when torque is wanted the next time.
    #[default]
    Due,
    /// The bridge is to close; so many steps have been waited for it.
    Closing(u8),
    /// Under way for so many steps, with what was seen.
    Flowing { turned: bool, steps: u8, asked: Phases, flowed: Phases },
    /// Passed, or not to be made.
    Over,
    /// Told of, until the torque is not wanted any more.
    Failed,
}

/// Steps of the supervision for which the bridge is waited for, 10 ms. The sequence tells of one that does not come.
const PATIENCE: u8 = 20;
/// Steps of the current in one direction, 1.5 ms: long for a current loop.
const DIRECTION: u8 = 3;
/// 5 % of peak.
const CURRENT: CurrentFraction = CurrentFraction::from_bits(1_638);
/// Twelve directions in a revolution.
const STEP: u32 = u32::MAX / 12 + 1;

impl<B: BoardKind> Motor<B> {
    /// One step of the test. `None`: the sequence may go on; otherwise it may not, and the bridge is to be closed or not.
    pub(super) fn test_phases(&mut self, inputs: &SequenceInputs, faults: &mut MotorFaults) -> Option<bool> {
        if inputs.wanted != Sequence::Start || !self.measured.calibrated || self.refuses_to_align() {
            if matches!(self.phase_test, PhaseTest::Closing(_) | PhaseTest::Flowing { .. }) {
                self.aligning = None;
            }
            self.phase_test = PhaseTest::Due;
            return None;
        }
        match self.phase_test {
            PhaseTest::Over => None,
            PhaseTest::Failed => Some(false),
            // What turns is watched as soon as a current flows, and the test would be felt.
            PhaseTest::Due if !inputs.standstill => self.end_test(PhaseTest::Over),
            PhaseTest::Due => {
                // Of one place, or the direction could change in between.
                self.at_test = inputs.position;
                self.go_on(PhaseTest::Closing(0), CurrentFraction::ZERO)
            }
            PhaseTest::Closing(PATIENCE) => self.end_test(PhaseTest::Over),
            PhaseTest::Closing(waited) if !inputs.bridge_on => {
                self.go_on(PhaseTest::Closing(waited.wrapping_add(1)), CurrentFraction::ZERO)
            }
            PhaseTest::Closing(_) => self.begin(false),
            PhaseTest::Flowing { turned, steps, asked, flowed } => {
                self.flow(inputs, faults, (turned, steps.wrapping_add(1)), (asked, flowed))
            }
        }
    }

    fn begin(&mut self, turned: bool) -> Option<bool> {
        let (asked, flowed) = (Phases::default(), Phases::default());
        self.go_on(PhaseTest::Flowing { turned, steps: 0, asked, flowed }, CURRENT)
    }

    fn flow(
        &mut self,
        inputs: &SequenceInputs,
        faults: &mut MotorFaults,
        (turned, steps): (bool, u8),
        (mut asked, mut flowed): (Phases, Phases),
    ) -> Option<bool> {
        if !inputs.bridge_on {
            return self.end_test(PhaseTest::Over);
        }
        if steps == DIRECTION || steps == 2 * DIRECTION {
            let readings = &self.measured.readings;
            let angle = self.link.report.cycle(true).readings.angle();
            let command = [self.direct_command, CurrentFraction::ZERO].map(CurrentCommand::reference);
            asked.add(&phases(command, angle));
            flowed.add(&phases([readings.direct, readings.quadrature], angle));
        }
        if steps < 2 * DIRECTION {
            let current = if steps < DIRECTION { CURRENT } else { CURRENT.saturating_neg() };
            return self.go_on(PhaseTest::Flowing { turned, steps, asked, flowed }, current);
        }
        if flowed.follow(&asked) {
            return self.end_test(PhaseTest::Over);
        }
        if flowed.are_nothing_beside(&asked) {
            if !turned {
                return self.begin(true);
            }
            // Converters that have stopped, or no motor at all.
            faults.add(MotorFault::CurrentSensor);
        } else {
            faults.add(MotorFault::OpenPhase);
        }
        self.end_test(PhaseTest::Failed)
    }

    /// The bridge is closed, with this current along the direction of the test.
    fn go_on(&mut self, test: PhaseTest, current: CurrentFraction) -> Option<bool> {
        let magnets = self.commutation.as_ref().map_or(0, |commutation| commutation.at(self.at_test));
        let turn = if matches!(test, PhaseTest::Flowing { turned: true, .. }) { 2 * STEP } else { 0 };
        self.phase_test = test;
        self.aligning = Some((nearest(magnets).wrapping_add(turn), current, CurrentFraction::ZERO));
        Some(true)
    }

    fn end_test(&mut self, test: PhaseTest) -> Option<bool> {
        self.phase_test = test;
        self.aligning = None;
        (test == PhaseTest::Failed).then_some(false)
    }
}

/// The direction of the test that is nearest to an angle.
const fn nearest(angle: u32) -> u32 {
    let twelfth = ((angle as u64 * 12) >> 32) as u32;
    twelfth.wrapping_mul(STEP).wrapping_add(STEP / 2)
}
