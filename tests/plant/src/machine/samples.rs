//! What the board sees of a machine.

use super::outside::Outside;
use super::{Machine, State};
use crate::Effects;
use crate::cable::EarthFault;
use crate::frame::Dq;
use crate::noise::Noise;
use crate::sensors::bus_sample;
use crate::turn::Turn;

/// The largest sample of the converters.
const LARGEST_SAMPLE: u16 = 4_095;

/// What sensors show at the instant `at`.
impl Machine {
    /// Samples of the three phase currents, positive into the motor; 2048 is 0 A.
    #[must_use]
    pub fn current_samples(&mut self, at: u64) -> [u16; 3] {
        // An input may have broken the cable by then.
        self.advance(at);
        let currents = if self.effects || !self.cable.is_sound() {
            let state = *self.state_at(at);
            self.sensed(&state)
        } else {
            self.phase_currents(at)
        };
        let noise = Noise { seed: self.settings.seed };
        let samples = self.settings.current_sensors.samples(currents, noise, at);
        let (broken, shifted) = (self.outside.broken_sensors, self.outside.shifted_sensors);
        let moved = |k: usize| (i32::from(samples[k]) + shifted[k]).clamp(0, i32::from(LARGEST_SAMPLE)) as u16;
        core::array::from_fn(|k| broken[k].unwrap_or_else(|| moved(k)))
    }

    /// Currents in A of which the converter is shown the samples.
    #[cold]
    fn sensed(&self, state: &State) -> [f64; 3] {
        let Effects { sensor_bandwidth, shunts, .. } = &self.settings.effects;
        let State { current, shafts, bus, shown, .. } = *state;
        let currents = match sensor_bandwidth {
            Some(_) => shown,
            None => self.leg_currents(current, shafts.turn, bus.voltage),
        };
        let Some(shunts) = shunts else { return currents };
        let Outside { bridge, duties, .. } = self.outside;
        core::array::from_fn(|k| shunts.shown(&self.settings.inverter, bridge, duties[k], currents[k]))
    }

    /// Currents in A out of the legs of the bridge, as they are in the middle of the low-side pulses: those of the windings that they feed, and
    /// what goes to earth.
    pub(super) fn leg_currents(&self, current: Dq, turn: Turn, bus: f64) -> [f64; 3] {
        let mut currents = self.frame(turn.part).phases(current);
        if let Some(wiring) = self.settings.effects.wiring {
            currents = wiring.to_legs(currents);
        }
        if let Some((leg, fault)) = self.cable.earth_fault() {
            currents[leg] += self.earth_current(leg, fault, currents[leg], bus);
        }
        currents
    }

    #[cold]
    fn earth_current(&self, leg: usize, fault: EarthFault, current: f64, bus: f64) -> f64 {
        let inverter = &self.settings.inverter;
        let Outside { bridge, duties, .. } = self.outside;
        if bridge {
            return fault.in_the_middle_of_low(bus, duties[leg], inverter.period);
        }
        let legs = self.legs(inverter.terminals(bridge, &duties), bus);
        legs[leg].voltage(current, bus) / fault.resistance
    }

    /// Sample of the bus voltage; 4096 would be `bus_range`.
    #[must_use]
    pub fn bus_sample(&mut self, at: u64) -> u16 {
        bus_sample(self.state_at(at).bus.voltage, self.settings.bus_range)
    }

    /// Samples of the temperatures of heat sink and motor, see [`Thermometer`](crate::Thermometer).
    #[must_use]
    pub fn temperature_samples(&mut self, at: u64) -> [u16; 2] {
        let temperatures = self.state_at(at).temperatures;
        let temperatures = [temperatures.heat_sink, temperatures.winding];
        let (thermometers, broken) = (&self.settings.thermometers, self.outside.broken_thermometers);
        core::array::from_fn(|k| thermometers[k].sample(temperatures[k], broken[k]))
    }

    /// The encoder counter: quantised, wrapping at 2^32.
    #[must_use]
    pub fn encoder_count(&mut self, at: u64) -> u32 {
        let State { counter, shafts, .. } = *self.state_at(at);
        self.settings.encoder.count(counter, self.tracks(shafts.turn))
    }

    /// What [`Machine::encoder_count`] will answer at an instant ahead if no input comes until then: a look that passes no time.
    #[must_use]
    pub fn encoder_ahead(&mut self, at: u64) -> u32 {
        let kept = (self.state, self.outside, self.cable, self.interventions, self.slipped, self.still);
        let mut place = self.timeline.place();
        while let Some(stretch) = self.timeline.look(&mut place, at) {
            self.pass(stretch);
        }
        let state = if self.still { self.state } else { self.step(at.saturating_sub(place.time)) };
        (self.state, self.outside, self.cable, self.interventions, self.slipped, self.still) = kept;
        self.settings.encoder.count(state.counter, self.tracks(state.shafts.turn))
    }

    /// The count at the last rising edge of the index, exactly where it lies; `None` before the first.
    #[must_use]
    pub fn index_count(&mut self, at: u64) -> Option<u32> {
        self.state_at(at).counter.latch()
    }

    /// Number of rising edges of the index; wraps.
    #[must_use]
    pub fn index_pulses(&mut self, at: u64) -> u32 {
        self.state_at(at).counter.pulses()
    }
}
