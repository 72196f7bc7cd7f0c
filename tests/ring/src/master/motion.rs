//! CP4: the drives are switched on, follow a profile, and are switched off.

use super::{FeedbackSample, MasterError, ProfilePoint, ScriptedMaster, Work};
use crate::ident::Idn;
use crate::service_client::{control, status};
use crate::time::Nanoseconds;

/// Status bits 15..14: power applied, without torque.
const POWER: u16 = 2;
/// Status bits 15..14: torque.
const TORQUE: u16 = 3;
/// What makes a drive follow its commands (sercos2.md 1.6).
const FOLLOW: u16 = control::ON | control::ENABLE | control::NO_HALT;

/// So many MDTs of CP4 carry a control word of 0 before a drive is switched on: an edge needs both of its sides in CP4, and one of them
/// may be lost.
const OFF_CYCLES: u64 = 2;

/// How far the motion has come; all drives are always in the same stage.
#[derive(Copy, Clone, Debug, PartialEq, Eq)]
pub(super) enum Stage {
    /// Control word 0, until all report power.
    Power { waited: u64 },
    /// Switched on with the feedback as command, until all follow.
    Follow { waited: u64 },
    /// The profile.
    Run { cycle: u64 },
    /// Bit 15 taken back with the last command held, until all are without torque.
    Stop { waited: u64 },
}

impl ScriptedMaster {
    /// Control word bits of this cycle's MDT; commands and samples are brought up to date.
    pub(super) fn motion_control(&mut self, _now: Nanoseconds) -> u16 {
        let Work::Move(stage) = self.work else { return 0 };
        if self.phase != 4 {
            return 0;
        }
        let stage = match self.next_stage(stage) {
            Ok(Some(stage)) => stage,
            Ok(None) => {
                self.work = Work::Finished;
                self.sample(None);
                return 0;
            }
            Err(error) => {
                self.fail(error);
                return 0;
            }
        };
        let (bits, profile_cycle) = match stage {
            Stage::Power { .. } => {
                self.command_feedback();
                (0, None)
            }
            Stage::Follow { .. } => {
                self.command_feedback();
                (FOLLOW, None)
            }
            Stage::Run { cycle } => {
                self.command_profile(cycle);
                let halt = self.drives.iter().any(|drive| drive.commands.halt);
                (if halt { FOLLOW & !control::NO_HALT } else { FOLLOW }, Some(cycle))
            }
            Stage::Stop { .. } => (control::ENABLE | control::NO_HALT, None),
        };
        self.sample(profile_cycle);
        self.work = Work::Move(match stage {
            Stage::Power { waited } => Stage::Power { waited: waited + 1 },
            Stage::Follow { waited } => Stage::Follow { waited: waited + 1 },
            Stage::Run { cycle } => Stage::Run { cycle: cycle + 1 },
            Stage::Stop { waited } => Stage::Stop { waited: waited + 1 },
        });
        self.switches.unwrap_or(bits)
    }

    fn next_stage(&self, stage: Stage) -> Result<Option<Stage>, MasterError> {
        let (cycles, patience) = self.script.motion.as_ref().map_or((0, 0), |motion| (motion.cycles, motion.patience));
        let wait = |expected: &'static str, waited: u64, there: fn(u16) -> bool| {
            let missing = self.statuses().into_iter().find(|(_, status)| !status.is_some_and(there));
            match missing {
                Some((address, status)) if waited >= patience => {
                    Err(MasterError::NotInTime { address, expected, cycles: waited, status: status.unwrap_or(0) })
                }
                missing => Ok(missing.is_none()),
            }
        };
        Ok(Some(match stage {
            Stage::Power { waited } => {
                let power = wait("power (status bits 15..14 = 2)", waited, |word| status::readiness(word) >= POWER)?;
                if power && waited >= OFF_CYCLES { Stage::Follow { waited: 0 } } else { stage }
            }
            Stage::Follow { waited } => {
                let follows = |word| status::readiness(word) == TORQUE && word & status::FOLLOWS != 0;
                if wait("following (status bits 15..14 = 3 and bit 3)", waited, follows)? {
                    Stage::Run { cycle: 0 }
                } else {
                    stage
                }
            }
            Stage::Run { cycle } => {
                let down = |word: u16| word & status::SHUT_DOWN != 0 || status::readiness(word) != TORQUE;
                let lost = self
                    .statuses()
                    .into_iter()
                    .find_map(|(address, status)| Some((address, status.filter(|word| down(*word))?)));
                if let (Some((address, status)), None) = (lost, self.switches) {
                    return Err(MasterError::ShutDown { address, cycle: self.cycle - 1, status });
                }
                if cycle < cycles { stage } else { Stage::Stop { waited: 0 } }
            }
            Stage::Stop { waited } => {
                // The order has to reach the drive before its status can mean anything.
                if waited > 1
                    && wait("torque off (status bits 15..14 < 3)", waited, |word| status::readiness(word) != TORQUE)?
                {
                    return Ok(None);
                }
                stage
            }
        }))
    }

    fn statuses(&self) -> Vec<(u8, Option<u16>)> {
        self.drives.iter().map(|drive| (drive.address, drive.at.as_ref().map(|at| at.words.status))).collect()
    }

    /// Before a drive follows, its command is where it stands, so that nothing jumps when it does.
    fn command_feedback(&mut self) {
        for drive in &mut self.drives {
            let Some(at) = &drive.at else { continue };
            if at.words.status & status::FOLLOWS != 0 {
                continue;
            }
            let feedback = [Idn::POSITION_FEEDBACK, Idn::POSITION_FEEDBACK_2]
                .iter()
                .find_map(|idn| drive.layout.feedback(*idn, &at.data));
            drive.start = feedback.unwrap_or(0);
            drive.commands.position = drive.start;
        }
    }

    fn command_profile(&mut self, cycle: u64) {
        let Some(motion) = &mut self.script.motion else { return };
        let time = Nanoseconds::from_microseconds(u64::from(self.script.cycle) * cycle);
        for (index, drive) in self.drives.iter_mut().enumerate() {
            drive.commands = (motion.profile)(ProfilePoint { cycle, time, drive: index, start: drive.start });
        }
    }

    fn sample(&mut self, profile_cycle: Option<u64>) {
        let (cycle, time) = (self.cycle - 1, self.beat.mark());
        for (index, drive) in self.drives.iter().enumerate() {
            let feedback = |idn: Idn| drive.layout.feedback(idn, &drive.at.as_ref()?.data);
            self.report.samples.push(FeedbackSample {
                cycle,
                time,
                drive: index,
                profile_cycle,
                position_command: drive.commands.position,
                velocity_command: drive.commands.velocity,
                status: drive.at.as_ref().map(|at| at.words.status),
                position: feedback(Idn::POSITION_FEEDBACK),
                velocity: feedback(Idn::VELOCITY_FEEDBACK),
                following_distance: feedback(Idn::FOLLOWING_DISTANCE),
            });
        }
    }
}
