//! The positive stop S-0-0149: the control takes the axis to a mechanical stop, and the drive does not take that for an error.

use sercon816::Bus;
use sercos::command::CommandState;

use super::Motion;
use super::words::TORQUE_LIMITS;
use crate::hardware::Hardware;
use crate::state::DriveState;
use crate::work::Work;

/// So long the axis has to stand at its torque limit, in ticks of the supervision: 50 ms. A free axis has left S-0-0124 before.
const PRESSED_TICKS: u8 = 100;

/// How far S-0-0149 has come.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum PositiveStop {
    /// Not set, or its torque has gone: everything is monitored.
    #[default]
    Inactive,
    /// On the way; so many ticks of the supervision at the stop.
    Approaching(u8),
    /// At the stop, until it is cancelled.
    Holding,
}

impl<B: Bus + Clone, H: Hardware> Motion<B, H> {
    /// S-0-0149. `false`: the drive does not follow and is not halted.
    pub(crate) fn start_positive_stop(&mut self) -> bool {
        let may = matches!(self.machine.state(), DriveState::Following | DriveState::Halted) && self.class_1.is_empty();
        if may {
            self.positive_stop = PositiveStop::Approaching(0);
        }
        may
    }

    /// S-0-0149 is cancelled, or its phase left.
    pub(crate) fn cancel_positive_stop(&mut self) {
        self.positive_stop = PositiveStop::Inactive;
        self.positive_stop_result = None;
    }

    /// A stop is expected: standing under torque away from the command is no error.
    pub(super) fn expects_a_stop(&self) -> bool {
        self.positive_stop != PositiveStop::Inactive
    }

    /// How S-0-0149 has ended, once.
    pub(crate) fn take_positive_stop_result(&mut self) -> Option<CommandState> {
        self.positive_stop_result.take()
    }

    /// One tick of the supervision. Tells the service channel when the stop is reached or out of reach.
    pub(super) fn watch_positive_stop(&mut self) -> Work {
        let (next, result) = match self.positive_stop {
            PositiveStop::Inactive => return Work::empty(),
            PositiveStop::Approaching(_) if !self.has_torque() => (PositiveStop::Inactive, Some(CommandState::Failed)),
            // Executed it has been; who switches on again has his monitoring.
            PositiveStop::Holding if !self.has_torque() => (PositiveStop::Inactive, None),
            PositiveStop::Holding => return Work::empty(),
            PositiveStop::Approaching(ticks) => {
                let pressed = self.output.limiting.intersects(TORQUE_LIMITS) && self.stands();
                match (pressed, ticks.saturating_add(1)) {
                    (true, PRESSED_TICKS..) => (PositiveStop::Holding, Some(CommandState::Executed)),
                    (true, ticks) => (PositiveStop::Approaching(ticks), None),
                    (false, _) => (PositiveStop::Approaching(0), None),
                }
            }
        };
        self.positive_stop = next;
        if result.is_none() {
            return Work::empty();
        }
        self.positive_stop_result = result;
        Work::SERVICE_CHANNEL
    }

    /// The shaft stands, whatever is commanded.
    fn stands(&self) -> bool {
        self.output.velocity.abs() <= self.settings.standstill_window
    }
}
