//! The inputs of a machine.

use super::Machine;
use super::outside::{Input, Outside};
use crate::brake::BrakeFailure;
use crate::cable::{Cable, EarthFault};
use crate::thermometer::ThermometerFailure;

/// Inputs, each from the instant `at` on.
impl Machine {
    /// Sets for which share of a period each phase's high-side switch is closed; limited to 0 ..= 1.
    pub fn set_duties(&mut self, duties: [f64; 3], at: u64) {
        self.change(at, |outside| outside.duties = duties.map(|duty| duty.clamp(0.0, 1.0)));
    }

    /// Lets the bridge switch, or opens all its switches: the current then flows on through the diodes against the bus until it is zero.
    pub fn set_bridge(&mut self, on: bool, at: u64) {
        self.change(at, |outside| outside.bridge = on);
    }

    /// Sets the rectified mains voltage in V; 0 is mains off.
    pub fn set_supply(&mut self, voltage: f64, at: u64) {
        self.change(at, |outside| outside.mains = voltage);
    }

    /// Switches the resistor of the drive's own chopper ([`Supply::resistor`](crate::Supply)) across the DC link.
    pub fn set_chopper(&mut self, on: bool, at: u64) {
        self.change(at, |outside| outside.chopper = on);
    }

    /// Brings the DC link to a voltage in V, as its discharge resistor does within minutes.
    pub fn set_bus_voltage(&mut self, voltage: f64, at: u64) {
        self.timeline.enter(Input::Bus(voltage), at);
    }

    /// Sets the torque with which the load is driven (negative brakes positive movement), in Nm; gravity comes on top.
    pub fn set_load_torque(&mut self, torque: f64, at: u64) {
        self.change(at, |outside| outside.load_torque = torque);
    }

    /// Gives motor and load a velocity in rad/s at the instant `at`: a start in full run.
    pub fn set_velocity(&mut self, velocity: f64, at: u64) {
        self.timeline.enter(Input::Velocity(velocity), at);
    }

    /// Seizes the motor shaft, which stops at once, or lets it go.
    pub fn block(&mut self, seized: bool, at: u64) {
        self.change(at, |outside| outside.seized = seized);
    }

    /// Energises the brake's coil, which releases the brake, or cuts it off.
    pub fn set_brake(&mut self, energised: bool, at: u64) {
        self.change(at, |outside| outside.brake_energised = energised);
    }

    /// Breaks or repairs the brake.
    pub fn fail_brake(&mut self, failure: Option<BrakeFailure>, at: u64) {
        self.change(at, |outside| outside.brake_failure = failure);
    }

    /// Sets the ambient temperature in degrees Celsius.
    pub fn set_ambient(&mut self, temperature: f64, at: u64) {
        self.change(at, |outside| outside.ambient = temperature);
    }

    /// Gives heat sink and windings these temperatures in degrees Celsius at the instant `at`: a load that has gone on for long.
    pub fn set_temperatures(&mut self, temperatures: [f64; 2], at: u64) {
        self.timeline.enter(Input::Temperatures(temperatures), at);
    }

    /// Breaks the wires of the temperature sensor of the heat sink (0) or of the windings (1), or repairs them.
    pub fn fail_temperature_sensor(&mut self, sensor: usize, failure: Option<ThermometerFailure>, at: u64) {
        self.change(at, |outside| {
            if let Some(thermometer) = outside.broken_thermometers.get_mut(sensor) {
                *thermometer = failure;
            }
        });
    }

    /// Moves the zero of the current sensor of a phase (0, 1, 2) by so many counts.
    pub fn shift_current_sensor(&mut self, phase: usize, counts: i32, at: u64) {
        self.change(at, |outside| {
            if let Some(sensor) = outside.shifted_sensors.get_mut(phase) {
                *sensor = counts;
            }
        });
    }

    /// Lets the current sensor of a phase (0, 1, 2) show a fixed sample, or repairs it.
    pub fn fail_current_sensor(&mut self, phase: usize, sample: Option<u16>, at: u64) {
        self.change(at, |outside| {
            if let Some(sensor) = outside.broken_sensors.get_mut(phase) {
                *sensor = sample;
            }
        });
    }

    /// Adds resistances in ohm to the three legs' cores of the motor cable: bad contacts. Their heat stays outside.
    ///
    /// # Panics
    /// When one is negative.
    pub fn set_contact_resistances(&mut self, resistances: [f64; 3], at: u64) {
        self.change_cable(at, |cable| cable.set_resistances(resistances));
    }

    /// Breaks the core of a leg (0, 1, 2) in the motor cable, or joins it: without it no current flows, the arc takes less than a step.
    ///
    /// # Panics
    /// When there is no such leg.
    pub fn open_phase(&mut self, leg: usize, open: bool, at: u64) {
        self.change_cable(at, |cable| cable.set_open(leg, open));
    }

    /// Connects the output of a leg (0, 1, 2), behind its current sensor, with the bus's minus, or takes the connection away.
    ///
    /// # Panics
    /// When there is no such leg, or when the resistance is not positive.
    pub fn fail_to_earth(&mut self, fault: Option<(usize, EarthFault)>, at: u64) {
        self.change_cable(at, |cable| cable.set_earth_fault(fault));
    }

    /// Freezes the encoder's counting tracks or brings them back; the counts missed meanwhile stay lost. The index goes on.
    pub fn freeze_encoder(&mut self, frozen: bool, at: u64) {
        self.change(at, |outside| outside.encoder_frozen = frozen);
    }

    /// Adds counts at the instant `at` that no movement has caused.
    pub fn slip_encoder(&mut self, counts: i32, at: u64) {
        self.timeline.enter(Input::Slip(counts), at);
    }

    /// Takes the index pulse away or brings it back.
    pub fn mute_index(&mut self, muted: bool, at: u64) {
        self.change(at, |outside| outside.index_muted = muted);
    }

    /// A repeated input is no event: the result must not depend on how often it is repeated.
    fn change(&mut self, at: u64, change: impl FnOnce(&mut Outside)) {
        let before = self.last_outside;
        change(&mut self.last_outside);
        if self.last_outside != before {
            self.timeline.enter(Input::Outside(self.last_outside), at);
        }
    }

    fn change_cable(&mut self, at: u64, change: impl FnOnce(&mut Cable)) {
        let before = self.last_cable;
        change(&mut self.last_cable);
        if self.last_cable != before {
            self.timeline.enter(Input::Cable(self.last_cable), at);
        }
    }
}
