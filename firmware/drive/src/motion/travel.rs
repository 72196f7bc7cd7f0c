//! Homing S-0-0148, a movement that the drive makes by itself, and the probes that look on.

use sercon816::Bus;
use sercos::command::CommandState;
use servo::axis::Travel;
use servo::homing::{Homing, HomingError, HomingInputs, HomingMotion, HomingSettings, HomingState};
use servo::path::MotionLimits;
use servo::probe::{ProbeInput as ProbeSide, ProbeInputs, ProbeSettings, ProbingCycle};
use servo::units::Position;

use super::Motion;
use crate::hardware::{Hardware, ProbeInput};
use crate::signal::control_bits::Enable;
use crate::state::DriveState;

/// Homing, as the service channel sees it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct HomingRun {
    /// Under way, with what it works with.
    running: Option<(Homing, HomingSettings, MotionLimits)>,
    /// Armed, and the first index position since.
    index: Option<Option<Position>>,
    /// S-0-0408.
    pub(super) marker_registered: bool,
    /// How it ended, until the service channel has taken it.
    result: Option<CommandState>,
    /// Why it failed.
    pub(super) error: Option<HomingFailure>,
}

/// Why homing failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum HomingFailure {
    /// The way was not as it should be.
    Way(HomingError),
    /// The torque went.
    Torque,
}

/// Probes, as the service channel and the AT see them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct ProbeRun {
    pub(super) cycle: ProbingCycle,
    settings: Option<ProbeSettings>,
}

impl<B: Bus + Clone, H: Hardware> Motion<B, H> {
    /// Starts S-0-0148 with a movement. The old reference is gone from now on. `false`: the drive is not in operation.
    pub(crate) fn start_homing(&mut self, settings: HomingSettings, limits: MotionLimits) -> bool {
        if !matches!(self.machine.state(), DriveState::Following | DriveState::Halted) {
            return false;
        }
        self.referenced = false;
        self.homing = true;
        self.homing_run = HomingRun {
            running: Some((Homing::start(self.encoder.position()), settings, limits)),
            ..HomingRun::default()
        };
        self.update_state();
        true
    }

    /// How a homing has ended, once.
    pub(crate) fn take_homing_result(&mut self) -> Option<CommandState> {
        self.homing_run.result.take()
    }

    /// A homing has ended, see [`Motion::take_homing_result`].
    pub(super) const fn has_homing_result(&self) -> bool {
        self.homing_run.result.is_some()
    }

    /// Why the last homing failed.
    pub(crate) const fn homing_error(&self) -> Option<HomingFailure> {
        self.homing_run.error
    }

    /// A homing is under way.
    pub(super) const fn is_travelling_home(&self) -> bool {
        self.homing_run.running.is_some()
    }

    /// One loop tick of homing, before the loops: the edge of a switch is found at their rate. Returns whether the service channel has
    /// something to take.
    pub(super) fn home(&mut self) -> bool {
        let Some((mut homing, settings, limits)) = self.homing_run.running else { return false };
        if !self.machine.state().is_in_operation() {
            self.end_homing(CommandState::Failed, Some(HomingFailure::Torque));
            return true;
        }
        // The others are the supervision's, which says why the torque goes when it acts on them.
        self.inputs.home_switch = self.hardware.inputs().home_switch;
        let output = homing.tick(
            &settings,
            HomingInputs {
                position: self.encoder.position(),
                home_switch: self.home_switch(settings.is_switch_at_drive()),
                homing_enable: self.controlled & Enable::Homing.mask() != 0,
                index: self.homing_run.index.flatten(),
                standstill: self.output.standstill,
                moving_finished: self.output.travelled,
                run: self.switches.is_some_and(|switches| switches.run),
            },
        );
        if output.arm_index && self.homing_run.index.is_none() {
            self.hardware.arm_index();
            self.homing_run.index = Some(None);
        }
        self.homing_run.running = Some((homing, settings, limits));
        self.homing_run.marker_registered = output.marker_registered;
        let travel = match output.motion {
            HomingMotion::Hold => Travel::Hold,
            HomingMotion::Velocity(velocity) => Travel::AtVelocity(velocity),
            HomingMotion::MoveTo(position) => Travel::To(position),
        };
        self.axis.travel(limits, travel);
        match (output.state, output.reference) {
            (HomingState::Running, _) => return false,
            (HomingState::Done, Some(reference)) => {
                self.shift_zero(reference.shift);
                self.referenced = true;
                self.end_homing(CommandState::Executed, None);
            }
            (HomingState::Failed(error), _) => {
                self.end_homing(CommandState::Failed, Some(HomingFailure::Way(error)));
            }
            (HomingState::Done, None) => self.end_homing(CommandState::Failed, None),
        }
        true
    }

    /// The position of an index pulse, if the supervision has seen one: the first since the homing armed it counts.
    pub(super) fn note_marker(&mut self, index: Option<Position>) {
        if let Some(first) = &mut self.homing_run.index {
            *first = first.or(index);
        }
    }

    fn end_homing(&mut self, result: CommandState, error: Option<HomingFailure>) {
        let marker_registered = self.homing_run.marker_registered;
        self.homing_run = HomingRun { result: Some(result), error, marker_registered, ..HomingRun::default() };
    }

    /// Forgets a homing that has not ended (cancelled, phase left).
    pub(super) fn abandon_homing(&mut self) {
        self.homing_run.running = None;
        self.homing_run.result = None;
    }

    /// The home switch of its owner.
    fn home_switch(&self, at_drive: bool) -> bool {
        if at_drive { self.inputs.home_switch } else { self.controlled & Enable::HomeSwitch.mask() != 0 }
    }

    /// Moves the zero of all positions by `difference` without a movement. Divides.
    pub(super) fn shift_zero(&mut self, difference: Position) {
        self.encoder.set_position(self.encoder.position() + difference);
        self.axis.shift(difference);
        self.motor.shift(difference);
        // What the last tick and the last t4 have left is read before the next.
        self.output.position_command = self.output.position_command + difference;
        self.shown.position = self.shown.position + difference;
        // Where the axis stands now is nothing that a command has led to.
        self.range_monitor = None;
        self.positioning.forget();
    }

    /// One look at the probes, whose edges the hardware has latched.
    pub(super) fn probe(&mut self) {
        let Some(settings) = self.probe_run.settings else { return };
        let direction = self.motor.direction();
        let mut side = |probe: ProbeInput, level: bool, enable: bool| {
            let mut latched = |rising| {
                let latch = self.hardware.probe_latch(probe, rising)?;
                // In the turn of the data in which the edge came.
                Some(self.axis.cyclic_position(self.encoder.position_of(latch.wrapping_mul(direction))))
            };
            ProbeSide { level, enable, positive: latched(true), negative: latched(false) }
        };
        let one = side(ProbeInput::One, self.inputs.probe_1, self.controlled & Enable::Probe1.mask() != 0);
        let two = side(ProbeInput::Two, self.inputs.probe_2, self.controlled & Enable::Probe2.mask() != 0);
        self.probe_run.cycle.tick(&settings, &ProbeInputs { active: true, one, two });
    }

    /// S-0-0170 with S-0-0169, or its end.
    pub(crate) fn set_probing(&mut self, settings: Option<ProbeSettings>) {
        if settings.is_some() {
            self.hardware.arm_probe(ProbeInput::One);
            self.hardware.arm_probe(ProbeInput::Two);
        } else if let Some(last) = self.probe_run.settings {
            self.probe_run.cycle.tick(&last, &ProbeInputs::default());
        }
        self.probe_run.settings = settings;
    }

    /// S-0-0179.
    pub(super) fn probe_status(&self) -> u16 {
        self.probe_run.cycle.measurement_value_status()
    }

    /// Single bits of inputs and sequences: 0 home switch, 1 and 2 probes, 3 marker registered, 4 to 7 the bits of S-0-0179, 8 to 10
    /// S-0-0405 to S-0-0407.
    pub(super) fn signals(&self) -> u16 {
        let enables = [Enable::Probe1, Enable::Probe2, Enable::Homing].into_iter().rev();
        let enables = enables.fold(0, |word, enable| word << 1 | u16::from(self.controlled & enable.mask() != 0));
        u16::from(self.home_switch(self.settings.home_switch_at_drive))
            | u16::from(self.inputs.probe_1) << 1
            | u16::from(self.inputs.probe_2) << 2
            | u16::from(self.homing_run.marker_registered) << 3
            | self.probe_status() << 4
            | enables << 8
    }
}
