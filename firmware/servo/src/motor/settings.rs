//! Settings of the motor side: current loop, commutation, brake, monitors.

use crate::arithmetic::gain::Gain;
use crate::axis::limits::TorqueLimitSettings;
use crate::brake::settings::BrakeSettings;
use crate::commutation::CommutationSettings;
use crate::commutation::alignment::AlignmentSettings;
use crate::current::command::MotorModel;
use crate::current::protection::Protection;
use crate::current::settings::CurrentLoopSettings;
use crate::current::weakening::FieldWeakeningSettings;
use crate::encoder::monitor::EncoderMonitorSettings;
use crate::monitor::bus_voltage::VoltageSettings;
use crate::monitor::chopper::ChopperSettings;
use crate::monitor::generating::GeneratingSettings;
use crate::monitor::load::LoadSettings;
use crate::monitor::temperature::TemperatureSettings;

/// Everything the motor side needs of the parameters, scaled.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct MotorSettings {
    /// For the current loop's task.
    pub current: CurrentSettings,
    /// Feed-forward of the induced voltages.
    pub model: MotorModel,
    /// Pole pairs and encoder.
    pub commutation: CommutationSettings,
    /// Electrical angle of one increment, 2^-32 revolution.
    pub angle_per_increment: u32,
    /// Pole pairs.
    pub pole_pairs: i32,
    /// Search for the commutation angle.
    pub alignment: AlignmentSettings,
    /// P-0-0115: electrical angle at the index, 2^-32 revolution; `None`: not known.
    pub index_angle: Option<u32>,
    /// Bus voltage.
    pub voltage: VoltageSettings,
    /// Chopper of the DC link and its resistor.
    pub chopper: ChopperSettings,
    /// What the DC link leaves of the current that feeds it.
    pub generating: GeneratingSettings,
    /// Heat sink.
    pub heat_sink: TemperatureSettings,
    /// Motor.
    pub winding: TemperatureSettings,
    /// Thermal model of the motor.
    pub motor_load: LoadSettings,
    /// Thermal model of the amplifier.
    pub amplifier_load: LoadSettings,
    /// Encoder.
    pub encoder: EncoderMonitorSettings,
    /// Holding brake.
    pub brake: BrakeSettings,
    /// P-0-0120 bit 0: there is a brake.
    pub has_brake: bool,
    /// P-0-0120 bit 2: the axis stays where it is with its brake open and without torque.
    pub aligns_with_open_brake: bool,
    /// S-0-0082, S-0-0083, S-0-0092, S-0-0109, S-0-0110.
    pub torque_limits: TorqueLimitSettings,
    /// Field weakening.
    pub weakening: FieldWeakeningSettings,
    /// From a phase current in counts 2^-3 to a fraction of the peak current (2^-15).
    pub phase_current: Gain,
    /// From a sample of the bus voltage to mV.
    pub bus_millivolts: Gain,
}

/// Everything the current loop needs of the parameters.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct CurrentSettings {
    /// Gains.
    pub current_loop: CurrentLoopSettings,
    /// Trip levels.
    pub protection: Protection,
}
