//! What the drive knows to be wrong, or worth telling: C1D, C2D, C3D with their manufacturer's words and change bits, and what the background
//! has been told of them.

use sercos::diagnostic::{Class1, Class2, Class3};
use servo::axis::{AxisOutput, Limiting};
use servo::units::{CurrentFraction, Velocity};

use super::positioning::REACHED;
use crate::diagnosis::faults::Findings;
use crate::diagnosis::words::{Manufacturer1, Manufacturer2, Manufacturer3};
use crate::settings::MotionSettings;
use crate::state::DriveState;
use servo::motor::Watched;

/// Change bits of the status word (sercos2.md 1.7).
const CLASS_2_CHANGE: u16 = 1 << 12;
const CLASS_3_CHANGE: u16 = 1 << 11;

/// The limits that C3D bit 4 stands for.
pub(super) const TORQUE_LIMITS: Limiting = Limiting::TORQUE_POSITIVE
    .union(Limiting::TORQUE_NEGATIVE)
    .union(Limiting::TORQUE_BIPOLAR)
    .union(Limiting::MOTOR_PEAK)
    .union(Limiting::AMPLIFIER_PEAK)
    .union(Limiting::MOTOR_LOAD)
    .union(Limiting::AMPLIFIER_LOAD);

/// The limits that C3D bit 5 stands for.
const VELOCITY_LIMITS: Limiting =
    Limiting::VELOCITY_POSITIVE.union(Limiting::VELOCITY_NEGATIVE).union(Limiting::VELOCITY_BIPOLAR);

/// The diagnostic words of the motion side.
///
/// Laid out as declared: what every loop tick touches comes first.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Status {
    class_1: Class1,
    class_2: Class2,
    class_3: Class3,
    manufacturer_1: Manufacturer1,
    manufacturer_2: Manufacturer2,
    manufacturer_3: Manufacturer3,
    amplifier_unknown: bool,
    class_2_change: bool,
    class_3_change: bool,
    /// An error forbids a controlled stop.
    fatal: bool,
    /// State and diagnostic words that the background has been told of.
    told: (DriveState, Class1, Class2),
    /// What limits the drive right now (P-0-0160).
    limiting: Limiting,
    /// S-0-0014, as the background has made it.
    interface_status: u16,
    /// S-0-0390, as the background has made it.
    diagnostic_number: u16,
}

/// What warnings and conditions are made of. Plain values, put together by the supervision for one look.
pub(super) struct Look<'a> {
    pub(super) settings: &'a MotionSettings,
    pub(super) output: &'a AxisOutput,
    pub(super) watched: &'a Watched,
    pub(super) torque_current: CurrentFraction,
    /// What limits the motor side, apart from the loops.
    pub(super) motor_limiting: Limiting,
    /// Torque is on.
    pub(super) torque: bool,
    /// The control asks for torque, and there is no main power for it.
    pub(super) without_power: bool,
    /// CP4.
    pub(super) operating_phase: bool,
    /// The loops run in a fixed phase to the ring.
    pub(super) locked: bool,
    /// A telegram was lost a short time ago.
    pub(super) telegram_lost: bool,
    pub(super) bridge_ready: bool,
    /// A limit of the MDT is out of its range.
    pub(super) limit_out_of_range: bool,
    /// The current sensors have not found their zero, and should have.
    pub(super) not_calibrated: bool,
    /// The bits of C3D that tell of having reached something.
    pub(super) reached: Class3,
}

impl Status {
    /// Errors have been found: the only way into C1D.
    #[inline]
    pub(super) fn raise(&mut self, findings: Findings) {
        self.class_1 |= findings.class_1;
        self.manufacturer_1 |= findings.manufacturer_1;
        self.fatal |= findings.fatal;
    }

    /// S-0-0099: no error is left.
    pub(super) fn clear_errors(&mut self) {
        self.class_1 = Class1::empty();
        self.manufacturer_1 = Manufacturer1::empty();
        self.fatal = false;
    }

    /// S-0-0012, S-0-0013 and their manufacturer's words, and P-0-0160.
    #[inline]
    pub(super) fn look(&mut self, look: &Look<'_>) {
        self.limiting = look.output.limiting | look.motor_limiting;
        let class_2 = self.warnings(look);
        self.class_2_change |= (class_2 ^ self.class_2).bits() & look.settings.class_2_mask != 0;
        self.class_2 = class_2;
        let class_3 = self.conditions(look);
        self.show_class_3(class_3, look.settings.class_3_mask);
    }

    /// A new target is not reached by having reached the old one, not even until the supervision looks. `mask`: S-0-0098.
    pub(super) fn show_reached(&mut self, reached: Class3, mask: u16) {
        self.show_class_3(self.class_3.difference(REACHED) | reached, mask);
    }

    /// S-0-0013, and whether its change bit tells of it.
    fn show_class_3(&mut self, class_3: Class3, mask: u16) {
        self.class_3_change |= (class_3 ^ self.class_3).bits() & mask != 0;
        self.class_3 = class_3;
    }

    fn warnings(&mut self, look: &Look<'_>) -> Class2 {
        let mut own = Manufacturer2::empty();
        own.set(Manufacturer2::NOT_LOCKED, look.operating_phase && !look.locked);
        own.set(Manufacturer2::TELEGRAM_LOST, look.telegram_lost);
        let known = self.class_1.contains(Class1::MANUFACTURER);
        own.set(Manufacturer2::AMPLIFIER_NOT_READY, !look.bridge_ready && !look.torque && !known);
        own.set(Manufacturer2::LIMIT_OUT_OF_RANGE, look.limit_out_of_range);
        own.set(Manufacturer2::NOT_CALIBRATED, look.not_calibrated);
        own.set(Manufacturer2::LINK_FULL, look.torque && look.watched.link_full);
        own.set(Manufacturer2::CHOPPER_HOT, look.watched.chopper_warning);
        own.set(Manufacturer2::CHOPPER_OFF, look.watched.chopper_off);
        own.set(Manufacturer2::AMPLIFIER_UNKNOWN, self.amplifier_unknown);
        self.manufacturer_2 = own;

        let mut class_2 = Class2::empty();
        class_2.set(Class2::UNDERVOLTAGE, look.without_power);
        let watched = look.watched;
        class_2.set(Class2::OVERLOAD, watched.overload);
        class_2.set(Class2::AMPLIFIER_TEMPERATURE, watched.heat_sink_warning);
        class_2.set(Class2::MOTOR_TEMPERATURE, watched.winding_warning);
        let window = look.settings.velocity_monitoring_window;
        let deviation = (look.output.velocity_command - look.output.velocity).abs();
        class_2.set(Class2::VELOCITY_DEVIATION, look.torque && window != Velocity::ZERO && deviation > window);
        class_2.set(Class2::MANUFACTURER, !own.is_empty());
        class_2
    }

    fn conditions(&mut self, look: &Look<'_>) -> Class3 {
        self.manufacturer_3.set(Manufacturer3::LOCKED, look.locked);
        let settings = look.settings;
        let output = look.output;
        let mut class_3 = Class3::empty();
        let velocity = output.velocity.abs();
        let velocity_error = output.velocity_command - output.velocity;
        class_3.set(Class3::VELOCITY_REACHED, velocity_error.abs() <= settings.velocity_window);
        class_3.set(Class3::STANDSTILL, output.standstill);
        class_3.set(Class3::BELOW_THRESHOLD, velocity < settings.velocity_threshold);
        let torque = i32::from(look.torque_current.to_bits()).unsigned_abs();
        class_3.set(Class3::TORQUE_THRESHOLD, torque >= settings.torque_threshold);
        class_3.set(Class3::TORQUE_LIMIT, output.limiting.intersects(TORQUE_LIMITS));
        class_3.set(Class3::VELOCITY_LIMIT, output.limiting.intersects(VELOCITY_LIMITS));
        class_3.set(Class3::MANUFACTURER, !self.manufacturer_3.is_empty());
        class_3 | look.reached
    }

    /// Whether state, errors or warnings are others than at the last call.
    #[inline]
    pub(super) fn is_news(&mut self, state: DriveState) -> bool {
        let now = (state, self.class_1, self.class_2);
        let news = now != self.told;
        self.told = now;
        news
    }

    /// S-0-0014 and S-0-0390, for the AT.
    pub(super) const fn set_diagnostics(&mut self, interface_status: u16, diagnostic_number: u16) {
        self.interface_status = interface_status;
        self.diagnostic_number = diagnostic_number;
    }

    /// The master has read S-0-0012.
    pub(super) const fn clear_class_2_change(&mut self) {
        self.class_2_change = false;
    }

    /// The master has read S-0-0013.
    pub(super) const fn clear_class_3_change(&mut self) {
        self.class_3_change = false;
    }

    /// S-0-0139 and its cancellation.
    pub(super) fn park(&mut self, parked: bool) {
        self.manufacturer_3.set(Manufacturer3::PARKED, parked);
    }

    /// The password locks the parameters.
    pub(super) fn show_lock(&mut self, locked: bool) {
        self.manufacturer_3.set(Manufacturer3::PASSWORD, locked);
    }

    /// Nobody knows the amplifier.
    pub(super) fn show_amplifier_unknown(&mut self, unknown: bool) {
        self.amplifier_unknown = unknown;
    }

    /// Parameters are not kept yet.
    pub(super) fn show_unsaved(&mut self, unsaved: bool) {
        self.manufacturer_3.set(Manufacturer3::UNSAVED, unsaved);
    }

    /// The axis is parked.
    #[inline]
    pub(super) const fn is_parked(&self) -> bool {
        self.manufacturer_3.contains(Manufacturer3::PARKED)
    }

    /// There is an error in C1D.
    #[inline]
    pub(super) const fn has_error(&self) -> bool {
        !self.class_1.is_empty()
    }

    /// An error forbids a controlled stop.
    #[inline]
    pub(super) const fn is_fatal(&self) -> bool {
        self.fatal
    }

    /// Bits 12 and 11 of the status word.
    #[inline]
    pub(super) const fn change_bits(&self) -> u16 {
        let class_2 = if self.class_2_change { CLASS_2_CHANGE } else { 0 };
        let class_3 = if self.class_3_change { CLASS_3_CHANGE } else { 0 };
        class_2 | class_3
    }

    /// S-0-0011.
    #[inline]
    pub(super) const fn class_1(&self) -> Class1 {
        self.class_1
    }

    /// S-0-0012.
    #[inline]
    pub(super) const fn class_2(&self) -> Class2 {
        self.class_2
    }

    /// S-0-0013.
    #[inline]
    pub(super) const fn class_3(&self) -> Class3 {
        self.class_3
    }

    /// S-0-0129.
    #[inline]
    pub(super) const fn manufacturer_1(&self) -> Manufacturer1 {
        self.manufacturer_1
    }

    /// S-0-0181.
    #[inline]
    pub(super) const fn manufacturer_2(&self) -> Manufacturer2 {
        self.manufacturer_2
    }

    /// S-0-0182.
    #[inline]
    pub(super) const fn manufacturer_3(&self) -> Manufacturer3 {
        self.manufacturer_3
    }

    /// S-0-0014.
    #[inline]
    pub(super) const fn interface_status(&self) -> u16 {
        self.interface_status
    }

    /// S-0-0390.
    #[inline]
    pub(super) const fn diagnostic_number(&self) -> u16 {
        self.diagnostic_number
    }

    /// P-0-0160.
    #[inline]
    pub(super) const fn limiting(&self) -> Limiting {
        self.limiting
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_add_up_until_they_are_cleared_and_are_news_once() {
        let mut status = Status::default();
        assert!(!status.is_news(DriveState::Off), "nothing has come since the start");
        status.raise(Findings { class_1: Class1::OVERLOAD, ..Findings::default() });
        let mut own = Findings::default();
        own.add_own(Manufacturer1::DEADLINE, true);
        status.raise(own);
        status.raise(Findings::default());
        assert_eq!(status.class_1(), Class1::OVERLOAD | Class1::MANUFACTURER);
        assert_eq!((status.manufacturer_1(), status.is_fatal()), (Manufacturer1::DEADLINE, true));
        assert_eq!([0, 1].map(|_| status.is_news(DriveState::Off)), [true, false]);
        status.clear_errors();
        assert_eq!((status.has_error(), status.is_fatal(), status.is_news(DriveState::Off)), (false, false, true));
    }

    #[test]
    fn a_target_that_is_reached_sets_its_change_bit_only_under_the_mask_and_leaves_the_rest_of_c3d() {
        let mut status = Status { class_3: Class3::STANDSTILL | Class3::AT_ACTIVE_TARGET, ..Status::default() };
        status.show_reached(Class3::AT_ACTIVE_TARGET, u16::MAX);
        assert_eq!(status.change_bits(), 0, "nothing has changed");
        status.show_reached(Class3::empty(), !Class3::AT_ACTIVE_TARGET.bits());
        assert_eq!((status.class_3(), status.change_bits()), (Class3::STANDSTILL, 0));
        status.show_reached(Class3::AT_ACTIVE_TARGET, Class3::AT_ACTIVE_TARGET.bits());
        assert_eq!(status.change_bits(), 1 << 11);
        status.clear_class_3_change();
        assert_eq!(status.change_bits(), 0);
    }
}
