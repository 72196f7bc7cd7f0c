//! The physical part of a servo drive on the host.
//!
//! [`Machine`] is the whole of it: bridge, bus, windings, brake, load and the sensors of all that, fed through duties and seen through
//! samples. What a real one has beside the textbook's is switched on one by one: [`Effects`] of its settings, and inputs that break it.
//! [`Motor`] leaves the electrical part out: torque follows a current command.
//!
//! The models are driven by absolute simulated time in nanoseconds and are deterministic: the state is computed on a fixed grid and at
//! the instants when inputs change, and nothing else. How often it is queried does not matter, and only additions, multiplications,
//! divisions and square roots of IEEE 754 are used, so that every machine gives the same bits.
#![forbid(unsafe_code)]

mod bandwidth;
mod brake;
mod cable;
mod cogging;
mod effects;
mod encoder;
mod encoder_errors;
mod exponential;
mod frame;
mod friction;
mod glance;
mod inverter;
mod legs;
mod machine;
mod machine_settings;
mod mechanics;
mod motor;
mod noise;
mod reference_axis;
mod sensors;
mod shunts;
mod stiction;
mod supply;
mod thermal;
mod thermometer;
mod timeline;
mod turn;
mod windings;

pub use bandwidth::SensorBandwidth;
pub use brake::{BrakeFailure, HoldingBrake};
pub use cable::{EarthFault, Wiring};
pub use cogging::{Cogging, EmfHarmonics, TorqueHarmonic};
pub use effects::Effects;
pub use encoder::Encoder;
pub use encoder_errors::{Eccentricity, QuadratureError};
pub use glance::Glance;
pub use inverter::Inverter;
pub use legs::LegCapacitance;
pub use machine::Machine;
pub use machine_settings::MachineSettings;
pub use mechanics::{Load, Mechanics};
pub use motor::{Coupling, Motor, MotorSettings};
pub use reference_axis::{ReferenceAxis, SuggestedGains};
pub use sensors::CurrentSensors;
pub use shunts::LowSideShunts;
pub use stiction::Stiction;
pub use supply::{Chopper, Supply};
pub use thermal::{HeatedBody, Thermal};
pub use thermometer::{Ntc, ThermalResistor, Thermometer, ThermometerFailure};
pub use windings::{Saturation, Windings};
