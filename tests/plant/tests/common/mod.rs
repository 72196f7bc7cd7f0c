//! A machine without any imperfection, of which each test adds its own.

use plant::{
    CurrentSensors, Effects, Encoder, HeatedBody, Inverter, Machine, MachineSettings, Mechanics, Supply, Thermal,
    Windings,
};

pub(crate) const MICROSECOND: u64 = 1_000;
pub(crate) const MILLISECOND: u64 = 1_000_000;
pub(crate) const SECOND: u64 = 1_000_000_000;
/// Bus voltage of the ideal machine.
pub(crate) const BUS: f64 = 300.0;

/// A machine that obeys the textbook: nothing gives way, nothing rubs, nothing gets warm. At time zero its d axis is that of the first phase.
pub(crate) fn ideal() -> MachineSettings {
    let increments = 4_096;
    MachineSettings {
        windings: Windings {
            pole_pairs: 4,
            resistance: 1.0,
            inductance_d: 1e-3,
            inductance_q: 1e-3,
            flux: 0.1,
            saturation: None,
        },
        inverter: Inverter { dead_time: 0.0, period: 62.5e-6, voltage_drop: 0.0 },
        supply: Supply { voltage: BUS, resistance: 1e-3, capacitance: 1e6, chopper: None },
        current_sensors: CurrentSensors { range: 20.48, offset: [0.0; 3], gain_error: [0.0; 3], noise: 0.0 },
        bus_range: 512.0,
        encoder: Encoder {
            increments_per_revolution: increments,
            initial_count: 0,
            index_at: 0.25,
            electrical_zero: -0.5 / f64::from(increments),
        },
        mechanics: Mechanics {
            rotor_inertia: 0.01,
            coulomb_friction: 0.0,
            viscous_friction: 0.0,
            load: None,
            gravity_torque: 0.0,
        },
        brake: None,
        thermal: Thermal {
            winding: HeatedBody { capacity: 1e12, resistance: 1.0 },
            heat_sink: HeatedBody { capacity: 1e12, resistance: 1.0 },
            ambient: 20.0,
        },
        effects: Effects::NONE,
        seed: 1,
    }
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
