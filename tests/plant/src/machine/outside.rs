//! What acts on a machine from outside.

use crate::MachineSettings;
use crate::brake::BrakeFailure;
use crate::cable::Cable;
use crate::thermometer::ThermometerFailure;

/// What acts on the machine from outside, until it is changed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Outside {
    pub(super) duties: [f64; 3],
    pub(super) bridge: bool,
    pub(super) mains: f64,
    pub(super) chopper: bool,
    pub(super) load_torque: f64,
    pub(super) seized: bool,
    pub(super) brake_energised: bool,
    pub(super) brake_failure: Option<BrakeFailure>,
    pub(super) ambient: f64,
    /// What broken current sensors show.
    pub(super) broken_sensors: [Option<u16>; 3],
    /// What is added to the samples of the current sensors.
    pub(super) shifted_sensors: [i32; 3],
    /// Temperature sensors of heat sink and windings.
    pub(super) broken_thermometers: [Option<ThermometerFailure>; 2],
    pub(super) encoder_frozen: bool,
    pub(super) index_muted: bool,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Input {
    Outside(Outside),
    Cable(Cable),
    Velocity(f64),
    Slip(i32),
    Temperatures([f64; 2]),
    Bus(f64),
}

impl Outside {
    /// The mains on, the bridge off, nothing broken.
    pub(super) fn at_start(settings: &MachineSettings) -> Self {
        Self {
            duties: [0.5; 3],
            bridge: false,
            mains: settings.supply.voltage,
            chopper: false,
            load_torque: 0.0,
            seized: false,
            brake_energised: false,
            brake_failure: None,
            ambient: settings.thermal.ambient,
            broken_sensors: [None; 3],
            shifted_sensors: [0; 3],
            broken_thermometers: [None; 2],
            encoder_frozen: false,
            index_muted: false,
        }
    }
}
