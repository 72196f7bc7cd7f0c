//! What is true of a machine, whatever its sensors show.

use super::{Machine, State};
use crate::Effects;
use crate::frame::Dq;
use crate::glance::Glance;

/// What is true at the instant `at`.
impl Machine {
    /// Angle of the motor shaft since time zero in revolutions.
    #[must_use]
    pub fn angle(&mut self, at: u64) -> f64 {
        let resolution = self.settings.encoder.increments_per_revolution;
        self.state_at(at).shafts.turn.since_start(resolution)
    }

    /// Angle of the load in revolutions, on the motor's scale.
    #[must_use]
    pub fn load_angle(&mut self, at: u64) -> f64 {
        self.angle(at) + self.state_at(at).shafts.lead_of_load()
    }

    /// Velocity of the motor shaft in rad/s.
    #[must_use]
    pub fn velocity(&mut self, at: u64) -> f64 {
        self.state_at(at).shafts.velocity
    }

    /// Torque of the motor's currents in Nm, without cogging, friction and brake.
    #[must_use]
    pub fn torque(&mut self, at: u64) -> f64 {
        let State { current, shafts, .. } = *self.state_at(at);
        self.torque_of(current, shafts.turn.part)
    }

    fn torque_of(&self, current: Dq, angle: f64) -> f64 {
        let torque = self.settings.windings.torque(current);
        match self.effects() {
            Some(Effects { emf_harmonics: Some(harmonics), .. }) => {
                torque + self.torque_of_harmonics(harmonics, current, angle)
            }
            _ => torque,
        }
    }

    /// Cogging torque in Nm, in counting direction.
    #[must_use]
    pub fn cogging_torque(&mut self, at: u64) -> f64 {
        let angle = self.state_at(at).shafts.turn.part;
        self.settings.effects.cogging.map_or(0.0, |cogging| cogging.torque(angle))
    }

    /// Phase currents in A, positive into the motor.
    #[must_use]
    pub fn phase_currents(&mut self, at: u64) -> [f64; 3] {
        let State { current, shafts, .. } = *self.state_at(at);
        self.frame(shafts.turn.part).phases(current)
    }

    /// Currents along and across the magnet in A, amplitudes of the phase current.
    #[must_use]
    pub fn dq_currents(&mut self, at: u64) -> [f64; 2] {
        let Dq { d, q } = self.state_at(at).current;
        [d, q]
    }

    /// Bus voltage in V.
    #[must_use]
    pub fn bus_voltage(&mut self, at: u64) -> f64 {
        self.state_at(at).bus.voltage
    }

    /// Temperature of the windings in degrees Celsius.
    #[must_use]
    pub fn winding_temperature(&mut self, at: u64) -> f64 {
        self.state_at(at).temperatures.winding
    }

    /// Temperature of the heat sink in degrees Celsius.
    #[must_use]
    pub fn heat_sink_temperature(&mut self, at: u64) -> f64 {
        self.state_at(at).temperatures.heat_sink
    }

    /// Whether there is a brake and its torque has built up.
    #[must_use]
    pub fn brake_holds(&mut self, at: u64) -> bool {
        self.settings.brake.is_some() && self.state_at(at).grip.holds()
    }

    /// Torque in Nm that the brake can hold.
    #[must_use]
    pub fn brake_torque(&mut self, at: u64) -> f64 {
        let grip = self.state_at(at).grip;
        self.settings.brake.map_or(0.0, |brake| brake.torque(grip, self.outside.brake_failure))
    }

    /// Everything at once, at the last instant of the grid up to `at`: nothing is computed for it that was not computed anyway.
    pub fn glance(&mut self, at: u64) -> Glance {
        self.advance(at);
        let (state, outside, settings) = (&self.state, &self.outside, &self.settings);
        Glance {
            time: self.timeline.time(),
            angle: state.shafts.turn.since_start(settings.encoder.increments_per_revolution),
            velocity: state.shafts.velocity,
            torque: self.torque_of(state.current, state.shafts.turn.part),
            current: [state.current.d, state.current.q],
            bus_voltage: state.bus.voltage,
            temperatures: [state.temperatures.heat_sink, state.temperatures.winding],
            brake_torque: settings.brake.map_or(0.0, |brake| brake.torque(state.grip, outside.brake_failure)),
            load_torque: outside.load_torque + settings.mechanics.gravity_torque,
            seized: outside.seized,
            brake_broken: outside.brake_failure.is_some(),
            blind: outside.broken_sensors.iter().any(Option::is_some) || outside.shifted_sensors != [0; 3],
            feverish: outside.broken_thermometers.iter().any(Option::is_some),
            encoder_frozen: outside.encoder_frozen,
            index_muted: outside.index_muted,
            cable_broken: !self.cable.is_sound(),
            kicks: self.interventions[0],
            slips: self.interventions[1],
            slipped: self.slipped,
        }
    }
}
