//! Limits of the MDT in force, see [`crate::limits`].

use sercon816::Bus;
use sercos::Phase;
use servo::axis::VelocityLimits;

use super::Motion;
use crate::hardware::Hardware;
use crate::limits::{Effects, Preparation, Prepared};
use crate::signal::limit::Limit;
use crate::state::DriveState;

impl<B: Bus + Clone, H: Hardware> Motion<B, H> {
    /// Whether the limits of the MDT are in force now: not in a stop of the drive's own.
    #[cold]
    pub(super) fn choose_limits(&mut self, state: DriveState) {
        let stopping = matches!(state, DriveState::SwitchingOff | DriveState::FaultReaction);
        let obeyed = self.ring.phase() == Phase::Cp4 && !stopping;
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
        self.cyclic_limits.shown(limit).filter(|_| self.ring.phase() == Phase::Cp4)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::service::rig::Rig;
    use servo::units::Velocity;

    /// Between any two parts a task of the cycle may come.
    #[test]
    fn after_each_part_of_new_settings_the_limits_of_the_mdt_are_in_force() {
        let mut rig = Rig::in_cp4(&[]);
        let motion = &mut rig.motion;
        for _ in 0..4 {
            // The loads that limit it are known.
            _ = motion.supervise();
        }
        let stored = (*motion.motor.torque_limits(), motion.axis.settings().velocity_limits());
        motion.cyclic_limits.configure([Limit::BipolarTorque, Limit::BipolarVelocity].into_iter());
        motion.cyclic_limits.take(Limit::BipolarTorque, 100);
        motion.cyclic_limits.take(Limit::BipolarVelocity, 1_000_000);
        motion.cyclic_limits.obey(true);
        motion.obey_limits();
        let settings = motion.settings();
        let in_force =
            |motion: &Motion<_, _>| (*motion.motor.torque_limits(), motion.axis.settings().velocity_limits());
        let limited = in_force(motion);
        assert!(
            limited.0 != stored.0 && limited.1.positive == Velocity::from_ten_thousandths_rpm(1_000_000),
            "{limited:?}"
        );
        motion.apply_motor_settings(&settings);
        assert_eq!(in_force(motion), limited, "the motor's");
        for without_lag in [false, true] {
            motion.take_axis_settings(&settings, without_lag);
            assert_eq!(in_force(motion), limited, "the axis'");
        }
        motion.put_axis_settings_in_force();
        assert_eq!(in_force(motion), limited, "the axis' in force");
        motion.apply_motion_settings(&settings.motion);
        assert_eq!(in_force(motion), limited, "those around");
    }
}
