//! The positive stop S-0-0149: the control takes the axis to a mechanical stop, and the drive does not take that for an error.

use sercos::command::CommandState;

/// So long the axis has to stand at its torque limit, in ticks of the supervision: 50 ms. A free axis has left S-0-0124 before.
const PRESSED_TICKS: u8 = 100;

/// S-0-0149.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct PositiveStop {
    stage: Stage,
    /// How it has ended, until the service channel has taken it.
    result: Option<CommandState>,
}

/// How far it has come.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Stage {
    /// Not set, or its torque has gone: everything is monitored.
    #[default]
    Inactive,
    /// On the way; so many ticks of the supervision at the stop.
    Approaching(u8),
    /// At the stop, until it is cancelled.
    Holding,
}

impl PositiveStop {
    /// Begins to wait for the stop. A result of the last one that nobody has taken stays.
    pub(super) const fn start(&mut self) {
        self.stage = Stage::Approaching(0);
    }

    /// It is cancelled, or its phase left.
    pub(super) const fn cancel(&mut self) {
        self.stage = Stage::Inactive;
        self.result = None;
    }

    /// A stop is expected: standing under torque away from the command is no error.
    #[inline]
    pub(super) fn is_expected(&self) -> bool {
        self.stage != Stage::Inactive
    }

    /// It has ended, see [`PositiveStop::take_result`].
    #[inline]
    pub(super) const fn has_result(&self) -> bool {
        self.result.is_some()
    }

    /// How it has ended, once.
    pub(super) const fn take_result(&mut self) -> Option<CommandState> {
        self.result.take()
    }

    /// One tick of the supervision; `pressed`: the axis stands at its torque limit. Returns whether the stop is reached, or out of reach
    /// because the torque has gone.
    #[inline]
    pub(super) fn look(&mut self, torque: bool, pressed: impl FnOnce() -> bool) -> bool {
        let (next, result) = match self.stage {
            Stage::Inactive => return false,
            Stage::Approaching(_) if !torque => (Stage::Inactive, Some(CommandState::Failed)),
            // Executed it has been; who switches on again has his monitoring.
            Stage::Holding if !torque => (Stage::Inactive, None),
            Stage::Holding => return false,
            Stage::Approaching(ticks) => match (pressed(), ticks.saturating_add(1)) {
                (true, PRESSED_TICKS..) => (Stage::Holding, Some(CommandState::Executed)),
                (true, ticks) => (Stage::Approaching(ticks), None),
                (false, _) => (Stage::Approaching(0), None),
            },
        };
        self.stage = next;
        if result.is_none() {
            return false;
        }
        self.result = result;
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_stop_is_reached_after_50_ms_at_it_without_a_break_and_told_once() {
        let mut stop = PositiveStop::default();
        assert!(!stop.is_expected() && !stop.look(true, || true));
        stop.start();
        assert!((1..100).all(|_| !stop.look(true, || true)));
        assert!(!stop.look(true, || false), "it has left the stop again");
        assert_eq!((1..=200).find(|_| stop.look(true, || true)), Some(100));
        assert_eq!((stop.take_result(), stop.take_result()), (Some(CommandState::Executed), None));
        assert!(stop.is_expected() && !stop.look(false, || false), "the torque goes after it was reached");
        assert!(!stop.is_expected() && !stop.has_result());
    }

    #[test]
    fn without_torque_there_is_no_stop_to_be_reached() {
        let mut stop = PositiveStop::default();
        stop.start();
        assert!(stop.look(false, || true));
        assert_eq!((stop.is_expected(), stop.take_result()), (false, Some(CommandState::Failed)));
    }
}
