//! Limits of the MDT in force, see [`crate::limits`].

use sercon816::Bus;
use sercos::Phase;
use servo::axis::VelocityLimits;

use super::Motion;
use crate::hardware::Hardware;
use crate::limits::{Effects, Preparation, Prepared};
use crate::signal::limit::Limit;
use crate::state::DriveState;
use crate::work::Work;

impl<B: Bus + Clone, H: Hardware> Motion<B, H> {
    /// Whether the limits of the MDT are in force now: not in a stop of the drive's own.
    #[cold]
    pub(super) fn choose_limits(&mut self, state: DriveState) {
        let stopping = matches!(state, DriveState::SwitchingOff | DriveState::FaultReaction);
        let obeyed = self.phase == Phase::Cp4 && !stopping;
        if self.cyclic_limits.obey(obeyed) && !obeyed {
            self.motor.limit_torque(None);
            self.apply_axis_settings();
        }
    }

    /// The limits of this cycle: those of torque and velocity act from the next loop tick on.
    #[inline(never)]
    pub(super) fn obey_limits(&mut self) {
        if !self.cyclic_limits.is_obeyed() {
            return;
        }
        let scale = &self.settings.limit_scale;
        let changed = self.cyclic_limits.take_changed();
        if changed.contains(Effects::TORQUE) {
            self.motor.limit_torque(Some(&scale.torque_limits(self.cyclic_limits.values())));
        }
        let wanted = self.cyclic_limits.velocity(scale, changed);
        let before = self.axis.settings().velocity_limits();
        if wanted != before {
            self.axis.set_velocity_limits(wanted.approached(&before, self.output.loop_velocity, scale.step));
        }
    }

    /// After new settings of the axis: what the MDT limits stays limited.
    pub(super) fn keep_limits(&mut self, before: VelocityLimits) {
        if self.cyclic_limits.is_obeyed() {
            self.axis.set_velocity_limits(before);
            self.limit_movements();
        }
    }

    fn limit_movements(&mut self) {
        if let Some(movements) = self.cyclic_limits.movements().axis {
            self.axis.set_movements(&movements);
        }
    }

    /// Accelerations and jerks of the MDT that wait for the background.
    pub(super) const fn tell_limits(&self) -> Work {
        if self.cyclic_limits.needs_preparation() { Work::SERVICE_CHANNEL } else { Work::empty() }
    }

    /// What the background is to prepare, once.
    pub(crate) fn take_preparation(&mut self) -> Option<Preparation> {
        self.cyclic_limits.take_preparation(&self.settings.limit_scale)
    }

    /// What the background has prepared.
    pub(crate) fn take_prepared(&mut self, prepared: &Prepared) {
        self.cyclic_limits.take_prepared(prepared);
        self.limit_movements();
    }

    /// The last value of a limit that the MDT carries, in CP4.
    pub(crate) fn cyclic_limit(&self, limit: Limit) -> Option<u32> {
        self.cyclic_limits.shown(limit).filter(|_| self.phase == Phase::Cp4)
    }
}
