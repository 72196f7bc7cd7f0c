//! The drive's own words of diagnosis, and all that a diagnosis is made of.

use bitflags::bitflags;
use sercos::Phase;
use sercos::diagnostic::{Class1, Class2};
use sercos::phase::InterfaceStatus;

use crate::state::DriveState;

bitflags! {
    /// S-0-0129: the errors behind C1D bit 15.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
    pub struct Manufacturer1: u16 {
        /// The amplifier reported a fault while torque was on.
        const AMPLIFIER_FAULT = 1 << 0;
        /// The phase currents do not add up to nothing.
        const CURRENT_SENSOR = 1 << 1;
        /// The current loop came too late twice in a row.
        const DEADLINE = 1 << 2;
        /// The holding brake does not do what it is told.
        const BRAKE = 1 << 3;
        /// Safe torque off took the torque away.
        const SAFE_TORQUE_OFF = 1 << 4;
        /// The two channels of safe torque off contradict each other.
        const SAFE_TORQUE_CHANNELS = 1 << 5;
        /// The motor turned faster than its highest speed.
        const OVERSPEED = 1 << 6;
        /// The loops lost the rhythm of the ring while torque was on.
        const SYNCHRONISATION = 1 << 7;
        /// A wire of a temperature sensor is broken.
        const THERMOMETER_BROKEN = 1 << 8;
        /// The search for the commutation angle: the motor does not move.
        const ALIGNMENT_NO_MOVEMENT = 1 << 9;
        /// The search for the commutation angle: encoder and motor phases turn against each other.
        const ALIGNMENT_DIRECTION = 1 << 10;
        /// The search for the commutation angle failed otherwise.
        const ALIGNMENT = 1 << 11;
        /// The position command stepped further than S-0-0091 allows.
        const COMMAND_JUMP = 1 << 12;
        /// A phase of the motor carries no current.
        const OPEN_PHASE = 1 << 13;
        /// Nothing is remembered of the parameters.
        const MEMORY = 1 << 14;
        /// A temperature sensor is short-circuited.
        const THERMOMETER_SHORT = 1 << 15;
        /// All errors of the search for the commutation angle.
        const ALIGNMENTS = 7 << 9;
    }
}

bitflags! {
    /// S-0-0181: the warnings behind C2D bit 15.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
    pub struct Manufacturer2: u16 {
        /// In CP4 the loops do not run in a fixed phase to the ring.
        const NOT_LOCKED = 1 << 0;
        /// An MST or an MDT was lost within the last second.
        const TELEGRAM_LOST = 1 << 1;
        /// The amplifier reports a fault; torque is off.
        const AMPLIFIER_NOT_READY = 1 << 2;
        /// The zero of the current sensors is not known yet, or not believable.
        const NOT_CALIBRATED = 1 << 3;
        /// The MDT carries a limit that is not within the range of its data block, or that the loops cannot work with.
        const LIMIT_OUT_OF_RANGE = 1 << 4;
        /// The DC link takes less than the braking motor would give back.
        const LINK_FULL = 1 << 5;
        /// The resistor of the brake chopper is at 90 % of its load.
        const CHOPPER_HOT = 1 << 6;
        /// The resistor of the brake chopper was too hot and is off until it has cooled down.
        const CHOPPER_OFF = 1 << 7;
        /// Nobody knows the amplifier: its record cannot be read or be true, or what was saved is of another one.
        const AMPLIFIER_UNKNOWN = 1 << 8;
    }
}

bitflags! {
    /// S-0-0182: the states behind C3D bit 15.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
    pub struct Manufacturer3: u16 {
        /// The loops run in a fixed phase to the ring.
        const LOCKED = 1 << 0;
        /// The axis is parked (S-0-0139).
        const PARKED = 1 << 1;
        /// The password S-0-0267 locks the stored parameters.
        const PASSWORD = 1 << 2;
        /// Parameters were written that are to be kept (S-0-0269 = 0), or the lock S-0-0267 has changed, and it is not kept yet.
        const UNSAVED = 1 << 3;
    }
}

/// What a diagnosis is made of, and all that it is made of.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Circumstances {
    /// Of the slave.
    pub phase: Phase,
    /// S-0-0014.
    pub interface: InterfaceStatus,
    /// State of the drive.
    pub state: DriveState,
    /// Main power is applied, and nothing stands in the way of torque.
    pub power: bool,
    /// S-0-0148 holds the position.
    pub homing: bool,
    /// S-0-0011.
    pub class_1: Class1,
    /// S-0-0012.
    pub class_2: Class2,
    /// S-0-0129.
    pub manufacturer_1: Manufacturer1,
    /// S-0-0181.
    pub manufacturer_2: Manufacturer2,
    /// S-0-0182.
    pub manufacturer_3: Manufacturer3,
}
