//! What stands guard over motor, amplifier and travel, each part with warnings and errors of its own.

pub(crate) mod bus_voltage;
pub(crate) mod chopper;
pub(crate) mod current_balance;
pub(crate) mod debounce;
pub(crate) mod generating;
pub(crate) mod load;
pub(crate) mod open_phase;
pub(crate) mod temperature;
pub(crate) mod thermometer;
pub(crate) mod travel_range;

pub use bus_voltage::{
    BusVoltage, Duty, Reciprocal, VoltageError, VoltageOutput, VoltageParameters, VoltageSettings, Volts,
};
pub use chopper::{Chopper, ChopperLevels, ChopperOutput, ChopperParameters, ChopperSettings};
pub use current_balance::CurrentBalance;
pub use generating::{GeneratingParameters, GeneratingSettings};
pub use load::{LoadModel, LoadOutput, LoadParameters, LoadSettings};
pub use open_phase::OpenPhase;
pub use temperature::{
    NO_TEMPERATURE, Temperature, TemperatureError, TemperatureOutput, TemperatureParameters, TemperatureSettings,
};
pub use thermometer::{Characteristic, Contact, Curve, Divider, TemperatureSensor, Thermometers};
pub use travel_range::{Commanded, RangeEnd, RangeMonitor, TravelRange};
