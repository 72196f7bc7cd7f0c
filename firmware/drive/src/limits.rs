//! Limits that the MDT can carry: a tension axis gets its torque limit in every cycle.
//!
//! While the MDT carries a limit, its value there takes the place of the parameter, from CP4 on: at once for torque and velocity, within a
//! millisecond for accelerations and jerks, which are prepared by division. The parameter keeps what was written last, and is in force again
//! when CP4 is left. So it is while the drive stops by itself (bit 15 off, an error, a lost ring): no value of a telegram makes a stop
//! impossible.

use bitflags::bitflags;
use sercos::attribute::Attribute;
use servo::SettingsError;
use servo::axis::{AxisMovements, VelocityLimits};
use servo::path::MotionLimits;

use crate::settings::limit_values::LimitValues;
use crate::settings::limits::LimitScale;
use crate::signal::limit::{LIMITS, Limit};

/// How many limits there are.
const COUNT: usize = LIMITS.len();

impl Limit {
    /// What has to be worked out anew when it changes.
    const fn effects(self) -> Effects {
        match self {
            Self::PositiveVelocity | Self::NegativeVelocity => Effects::VELOCITY,
            // Positioning does not plan to be faster.
            Self::BipolarVelocity => Effects::VELOCITY.union(Effects::POSITIONING),
            Self::PositiveTorque | Self::NegativeTorque | Self::BipolarTorque => Effects::TORQUE,
            Self::PositiveAcceleration | Self::NegativeAcceleration | Self::BipolarAcceleration | Self::BipolarJerk => {
                Effects::AXIS
            }
            Self::PositioningJerk | Self::PositioningVelocity | Self::PositioningAcceleration => Effects::POSITIONING,
        }
    }

    const fn bit(self) -> u16 {
        1 << self as u16
    }
}

bitflags! {
    /// What follows from the limits.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
    pub(crate) struct Effects: u8 {
        /// Limits of the velocity command.
        const VELOCITY = 1 << 0;
        /// Limits of the torque.
        const TORQUE = 1 << 1;
        /// Ramps of halt, stop and velocity commands.
        const AXIS = 1 << 2;
        /// Movements to S-0-0258.
        const POSITIONING = 1 << 3;
    }
}

/// What has to be prepared outside the hot tasks, because it takes divisions.
const PREPARED: Effects = Effects::AXIS.union(Effects::POSITIONING);

/// Format and range of a limit, from its data block.
#[derive(Clone, Copy, Debug)]
struct Range {
    attribute: Attribute,
    minimum: i64,
    maximum: i64,
}

impl Range {
    /// `None` for a limit that no data block stands for; a test looks.
    fn of(limit: Limit) -> Option<Self> {
        let (block, _) = LIMITS.get(limit as usize)?;
        let maximum = block.maximum?.min(i32::MAX.into());
        Some(Self { attribute: block.attribute, minimum: block.minimum?, maximum })
    }
}

/// The limits of the MDT.
#[derive(Debug, Default)]
pub(crate) struct CyclicLimits {
    /// Which of them the MDT carries, a bit each.
    carried: u16,
    /// What follows from those.
    effects: Effects,
    /// They are in force: in CP4, while the drive does not stop by itself.
    obeyed: bool,
    values: LimitValues,
    /// Which of those carried are not within the range of their data block, a bit each.
    out_of_range: u16,
    /// What the loops cannot work with: the values before stay in force.
    refused: Effects,
    changed: Effects,
    unprepared: Effects,
    ranges: [Option<Range>; COUNT],
    /// What the values mean.
    velocity: Option<VelocityLimits>,
    movements: Movements,
}

/// Prepared movements, where the MDT carries a limit of them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Movements {
    /// For the axis.
    pub(crate) axis: Option<AxisMovements>,
    /// To S-0-0258.
    pub(crate) positioning: Option<MotionLimits>,
}

/// What the background is to prepare.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Preparation {
    scale: LimitScale,
    values: LimitValues,
    effects: Effects,
}

/// What it has prepared; `None`: was not to be.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Prepared {
    axis: Option<Result<AxisMovements, SettingsError>>,
    positioning: Option<Result<MotionLimits, SettingsError>>,
}

impl Preparation {
    /// Divides.
    pub(crate) fn carry_out(&self) -> Prepared {
        let wanted = |effect| self.effects.contains(effect);
        Prepared {
            axis: wanted(Effects::AXIS).then(|| self.scale.movements(&self.values)),
            positioning: wanted(Effects::POSITIONING).then(|| self.scale.positioning(&self.values)),
        }
    }
}

impl CyclicLimits {
    /// Which limits the MDT will carry; before CP3.
    pub(crate) fn configure(&mut self, carried: impl Iterator<Item = Limit>) {
        *self = Self { values: self.values, ..Self::default() };
        for limit in carried {
            self.carried |= limit.bit();
            self.effects |= limit.effects();
            if let Some(range) = self.ranges.get_mut(limit as usize) {
                *range = Range::of(limit);
            }
        }
    }

    /// CP4 begins, or is over: the stored values are in force until the MDT has brought others.
    pub(crate) fn restart(&mut self, stored: &LimitValues) {
        self.values = *stored;
        self.out_of_range = 0;
        self.refused = Effects::empty();
        self.changed = Effects::all();
    }

    /// Other settings: what the MDT does not carry follows them, and everything is worked out anew.
    pub(crate) fn rescale(&mut self, stored: &LimitValues) {
        for limit in Limit::all().filter(|limit| self.carried & limit.bit() == 0) {
            self.values.set(limit, stored.get(limit));
        }
        self.work_out_anew();
    }

    /// Settings of the parameters are in force in the place of what the MDT carries.
    pub(crate) fn work_out_anew(&mut self) {
        self.changed = Effects::all();
    }

    /// The MDT carries a limit.
    #[inline]
    pub(crate) const fn is_carried(&self) -> bool {
        self.carried != 0
    }

    /// Puts them into force, or takes them out; returns whether that is a change.
    pub(crate) fn obey(&mut self, obeyed: bool) -> bool {
        let changes = obeyed != self.obeyed;
        if changes {
            self.obeyed = obeyed;
            self.changed = Effects::all();
            self.unprepared = Effects::empty();
            self.movements = Movements::default();
        }
        changes
    }

    /// They are in force.
    pub(crate) const fn is_obeyed(&self) -> bool {
        self.obeyed
    }

    /// A value of the MDT: beyond the range of its data block it is the end of the range.
    pub(crate) fn take(&mut self, limit: Limit, raw: u32) {
        let Some(&Some(range)) = self.ranges.get(limit as usize) else { return };
        let wanted = range.attribute.value_of(raw.into());
        let value = wanted.max(range.minimum).min(range.maximum);
        let bit = limit.bit();
        self.out_of_range = if value == wanted { self.out_of_range & !bit } else { self.out_of_range | bit };
        // Within 32 bits, as the range is.
        let value = value as i32;
        if value != self.values.get(limit) {
            self.values.set(limit, value);
            self.changed |= limit.effects();
        }
    }

    /// The last value, as the service channel shows it while the MDT carries the limit.
    pub(crate) fn shown(&self, limit: Limit) -> Option<u32> {
        (self.carried & limit.bit() != 0).then(|| self.values.get(limit).cast_unsigned())
    }

    /// S-0-0181 bit 4: a value is out of its range, or the loops cannot work with it.
    pub(crate) const fn complains(&self) -> bool {
        self.out_of_range != 0 || !self.refused.is_empty()
    }

    /// All values.
    pub(crate) const fn values(&self) -> &LimitValues {
        &self.values
    }

    /// What follows from values that have changed since the last time; what has to be prepared is kept for the background.
    #[inline]
    pub(crate) fn take_changed(&mut self) -> Effects {
        let changed = core::mem::take(&mut self.changed);
        self.unprepared |= changed & PREPARED & self.effects;
        changed
    }

    /// Limits of the velocity that the values mean, worked out when they change.
    #[inline]
    pub(crate) fn velocity(&mut self, scale: &LimitScale, changed: Effects) -> VelocityLimits {
        match self.velocity {
            Some(limits) if !changed.contains(Effects::VELOCITY) => limits,
            _ => *self.velocity.insert(scale.velocity_limits(&self.values)),
        }
    }

    /// The background has something to prepare.
    pub(crate) const fn needs_preparation(&self) -> bool {
        !self.unprepared.is_empty()
    }

    /// What the background is to prepare, once.
    pub(crate) fn take_preparation(&mut self, scale: &LimitScale) -> Option<Preparation> {
        let effects = core::mem::take(&mut self.unprepared);
        (!effects.is_empty()).then_some(Preparation { scale: *scale, values: self.values, effects })
    }

    /// What the background has prepared; what the loops cannot work with changes nothing and is told.
    pub(crate) fn take_prepared(&mut self, prepared: &Prepared) {
        if !self.obeyed {
            return;
        }
        if let Some(axis) = prepared.axis {
            self.refused.set(Effects::AXIS, axis.is_err());
            self.movements.axis = axis.ok().or(self.movements.axis);
        }
        if let Some(positioning) = prepared.positioning {
            self.refused.set(Effects::POSITIONING, positioning.is_err());
            self.movements.positioning = positioning.ok().or(self.movements.positioning);
        }
    }

    /// The prepared movements in force.
    pub(crate) const fn movements(&self) -> &Movements {
        &self.movements
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dictionary::{DICTIONARY, source};

    fn carried(limits: &[Limit]) -> CyclicLimits {
        let mut cyclic = CyclicLimits::default();
        cyclic.configure(limits.iter().copied());
        cyclic.restart(&LimitValues::new(&crate::service::rig::parameters()));
        cyclic.obey(true);
        cyclic.take_changed();
        cyclic
    }

    #[test]
    fn every_limit_has_a_data_block_with_a_range_that_the_mdt_can_carry() {
        for limit in Limit::all() {
            assert!(Range::of(limit).is_some(), "{limit:?}");
            let block = DICTIONARY.find(limit.idn()).unwrap();
            assert!(block.is_in(sercos::data_block::Selection::ConfigurableInMdt), "{limit:?}");
        }
    }

    #[test]
    fn a_value_beyond_its_range_is_the_end_of_it_and_is_told_until_a_good_one_comes() {
        for (limit, raw, taken) in [
            (Limit::PositiveTorque, 0xFFFF, 0),
            (Limit::NegativeTorque, 1, 0),
            (Limit::BipolarVelocity, 0, 1),
            (Limit::BipolarVelocity, 0x8000_0000, i32::MAX),
            (Limit::BipolarAcceleration, 0, 1),
            (Limit::PositioningAcceleration, 0, 1_000),
            (Limit::BipolarJerk, u32::MAX, 0),
        ] {
            let mut cyclic = carried(&[limit]);
            for _ in 0..2 {
                cyclic.take(limit, raw);
                assert_eq!((cyclic.values.get(limit), cyclic.complains()), (taken, true), "{limit:?} {raw:X}");
            }
            let good = if limit == Limit::NegativeTorque { 0xFFF0 } else { 2_000 };
            cyclic.take(limit, good);
            assert!(!cyclic.complains(), "{limit:?}");
        }
        // The whole of two bytes is a bipolar torque limit, and none of it is an error.
        let mut cyclic = carried(&[Limit::BipolarTorque]);
        for raw in [0, 1, 0x7FFF, 0x8000, 0xFFFF] {
            cyclic.take(Limit::BipolarTorque, raw);
            assert_eq!((cyclic.values.get(Limit::BipolarTorque), cyclic.complains()), (raw as i32, false));
        }
    }

    #[test]
    fn only_what_follows_from_a_changed_value_is_worked_out_again() {
        let mut cyclic = carried(&[Limit::BipolarTorque, Limit::PositioningJerk]);
        assert!(cyclic.take_preparation(&scale()).is_some(), "everything at first");
        cyclic.take(Limit::BipolarTorque, 2_000);
        assert_eq!(cyclic.take_changed(), Effects::empty(), "that is the stored value");
        cyclic.take(Limit::BipolarTorque, 300);
        assert_eq!(cyclic.take_changed(), Effects::TORQUE);
        assert!(!cyclic.needs_preparation());
        cyclic.take(Limit::PositioningJerk, 300);
        assert_eq!(cyclic.take_changed(), Effects::POSITIONING);
        assert!(cyclic.needs_preparation());
    }

    #[test]
    fn a_value_that_is_good_forgives_only_its_own_limit() {
        let mut cyclic = carried(&[Limit::BipolarVelocity, Limit::BipolarAcceleration]);
        cyclic.take(Limit::BipolarVelocity, 0);
        cyclic.take(Limit::BipolarAcceleration, 2_000);
        assert!(cyclic.complains(), "the velocity is bad still");
        cyclic.take(Limit::BipolarVelocity, 2_000);
        assert!(!cyclic.complains());
    }

    #[test]
    fn a_limit_of_the_mdt_is_shown_and_stays_when_the_settings_change_and_all_others_follow_them() {
        assert!(!carried(&[]).is_carried());
        let mut cyclic = carried(&[Limit::BipolarTorque]);
        assert!(cyclic.is_carried());
        cyclic.take(Limit::BipolarTorque, 300);
        cyclic.take_changed();
        assert_eq!((cyclic.shown(Limit::BipolarTorque), cyclic.shown(Limit::PositioningJerk)), (Some(300), None));
        let mut settings = LimitValues::default();
        settings.set(Limit::BipolarTorque, 700);
        settings.set(Limit::PositioningJerk, 77);
        cyclic.rescale(&settings);
        assert_eq!((cyclic.values.get(Limit::BipolarTorque), cyclic.values.get(Limit::PositioningJerk)), (300, 77));
        assert_eq!(cyclic.take_changed(), Effects::all());
        // What the next CP4 carries is settled before it; until then nothing has another value.
        cyclic.configure([Limit::PositiveVelocity].into_iter());
        assert_eq!((cyclic.values.get(Limit::BipolarTorque), cyclic.shown(Limit::BipolarTorque)), (300, None));
    }

    #[test]
    fn limits_that_come_into_force_or_leave_it_are_worked_out_anew_and_only_then() {
        let mut cyclic = carried(&[Limit::BipolarTorque]);
        assert!(cyclic.is_obeyed() && !cyclic.obey(true));
        assert_eq!(cyclic.take_changed(), Effects::empty());
        assert!(cyclic.obey(false) && !cyclic.is_obeyed());
        assert_eq!(cyclic.take_changed(), Effects::all());
    }

    #[test]
    fn limits_of_the_velocity_are_worked_out_when_they_are_told_to_have_changed_and_stand_still_otherwise() {
        let mut cyclic = carried(&[Limit::PositiveVelocity]);
        let scale = scale();
        let before = cyclic.velocity(&scale, Effects::empty());
        cyclic.take(Limit::PositiveVelocity, 1_000_000);
        assert_eq!(cyclic.velocity(&scale, Effects::TORQUE), before);
        let changed = cyclic.take_changed();
        let after = cyclic.velocity(&scale, changed);
        assert_ne!(after, before);
        assert_eq!(cyclic.velocity(&scale, Effects::empty()), after);
    }

    fn scale() -> LimitScale {
        crate::settings::DriveSettings::new(&crate::service::rig::parameters(), &crate::service::rig::FACTS, source)
            .unwrap()
            .motion
            .limit_scale
    }

    #[test]
    fn what_the_loops_cannot_work_with_leaves_the_movements_as_they_were_and_is_told() {
        let mut cyclic = carried(&[Limit::BipolarJerk, Limit::BipolarAcceleration]);
        let prepare = |cyclic: &mut CyclicLimits| {
            cyclic.take_changed();
            let prepared = cyclic.take_preparation(&scale()).unwrap().carry_out();
            cyclic.take_prepared(&prepared);
        };
        prepare(&mut cyclic);
        let before = cyclic.movements;
        assert!(before.axis.is_some() && !cyclic.complains());
        // 0.001 rad/s³: too smooth.
        cyclic.take(Limit::BipolarJerk, 1);
        prepare(&mut cyclic);
        assert!(cyclic.complains());
        assert_eq!(cyclic.movements, before);
        cyclic.take(Limit::BipolarJerk, 10_000_000);
        prepare(&mut cyclic);
        assert!(!cyclic.complains());
        assert_ne!(cyclic.movements.axis, before.axis);
    }
}
