//! A machine without any imperfection, of which each test adds its own.

use plant::{Machine, MachineSettings, Windings};

pub(crate) const MICROSECOND: u64 = 1_000;
pub(crate) const MILLISECOND: u64 = 1_000_000;
pub(crate) const SECOND: u64 = 1_000_000_000;
/// Bus voltage of the ideal machine.
pub(crate) const BUS: f64 = 300.0;

/// A machine that obeys the textbook: nothing gives way, nothing rubs, nothing gets warm. At time zero its d axis is that of the first phase.
pub(crate) fn ideal() -> MachineSettings {
    let windings = Windings {
        pole_pairs: 4,
        resistance: 1.0,
        inductance_d: 1e-3,
        inductance_q: 1e-3,
        flux: 0.1,
        saturation: None,
    };
    let increments = 4_096;
    let mut settings = MachineSettings::textbook(windings, BUS, 20.48);
    settings.bus_range = 512.0;
    settings.encoder.increments_per_revolution = increments;
    settings.encoder.electrical_zero = -0.5 / f64::from(increments);
    settings
}

/// Duties that give a voltage of this amplitude and angle (in turns, from the first phase's axis) at the ideal bus.
pub(crate) fn duties(amplitude: f64, turns: f64) -> [f64; 3] {
    [0.0, 1.0, 2.0].map(|phase| 0.5 + amplitude / BUS * ((turns - phase / 3.0) * core::f64::consts::TAU).cos())
}

/// A machine with its bridge on and its shaft seized, with a constant voltage along and across the magnet.
pub(crate) fn seized(settings: MachineSettings, voltage_d: f64, voltage_q: f64) -> Machine {
    let mut machine = Machine::new(settings);
    machine.block(true, 0);
    machine.set_bridge(true, 0);
    machine.set_duties(duties(voltage_d.hypot(voltage_q), voltage_q.atan2(voltage_d) / core::f64::consts::TAU), 0);
    machine
}

/// Both sides of an expectation.
#[track_caller]
pub(crate) fn assert_near(value: f64, expected: f64, tolerance: f64) {
    assert!((value - expected).abs() <= tolerance, "{value} instead of {expected} +- {tolerance}");
}
