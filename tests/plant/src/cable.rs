//! The cable between the bridge and the motor, and what can be wrong with it.

use crate::exponential::decay;

/// A path from a leg's output to the bus's minus, as an earthed cable screen or a burnt winding gives where the mains have earthed the bus.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EarthFault {
    /// In ohm.
    pub resistance: f64,
    /// Of the loop, in H: some 10 uH of cable and earth. It holds up the current while the leg is low, which is when the board samples; the
    /// power is that of the resistance alone.
    pub inductance: f64,
}

/// Which winding each leg of the bridge feeds; sensors and cable faults are counted as the legs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Wiring {
    winding_of: [usize; 3],
}

/// The cable.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Cable {
    /// In series with each leg, in ohm.
    resistances: [f64; 3],
    open: [bool; 3],
    earth: Option<(usize, EarthFault)>,
    /// Nothing of all that.
    sound: bool,
}

impl EarthFault {
    fn check(&self) {
        assert!(self.resistance > 0.0, "the resistance of an earth fault must be positive");
        assert!(self.inductance >= 0.0, "the inductance of an earth fault must not be negative");
    }

    /// The current in A in the middle of the time in which the leg is low, with the leg high for a share of the period in seconds: a coil that
    /// is switched to and fro between the bus voltage and nothing, as it is after many periods.
    pub(crate) fn in_the_middle_of_low(&self, bus: f64, share: f64, period: f64) -> f64 {
        let end = bus / self.resistance;
        if share >= 1.0 {
            return end;
        }
        if self.inductance == 0.0 {
            return 0.0;
        }
        let time_constant = self.inductance / self.resistance;
        let left = |time: f64| decay(time / time_constant);
        let at_turning_off = end * (1.0 - left(share * period)) / (1.0 - left(period));
        at_turning_off * left(0.5 * (1.0 - share) * period)
    }
}

impl Wiring {
    /// Two cores have changed places.
    ///
    /// # Panics
    /// When there is no such leg (0, 1, 2).
    #[must_use]
    pub fn swapped(one: usize, other: usize) -> Self {
        let mut winding_of = [0, 1, 2];
        winding_of.swap(one, other);
        Self { winding_of }
    }

    /// Each leg feeds the winding behind its own, in turn: the directions are right, the angle is wrong by a third of an electrical turn.
    #[must_use]
    pub fn turned_on() -> Self {
        Self { winding_of: [1, 2, 0] }
    }

    /// What the legs have, by their windings.
    pub(crate) fn to_windings<T: Copy>(self, legs: [T; 3]) -> [T; 3] {
        let mut windings = legs;
        for (leg, winding) in self.winding_of.into_iter().enumerate() {
            windings[winding] = legs[leg];
        }
        windings
    }

    /// What the windings have, by their legs.
    pub(crate) fn to_legs<T: Copy>(self, windings: [T; 3]) -> [T; 3] {
        self.winding_of.map(|winding| windings[winding])
    }
}

impl Cable {
    pub(crate) fn sound() -> Self {
        Self { resistances: [0.0; 3], open: [false; 3], earth: None, sound: true }
    }

    pub(crate) fn is_sound(&self) -> bool {
        self.sound
    }

    pub(crate) fn set_resistances(&mut self, resistances: [f64; 3]) {
        assert!(resistances.iter().all(|ohm| *ohm >= 0.0), "a contact's resistance must not be negative");
        self.resistances = resistances;
        self.judge();
    }

    pub(crate) fn set_open(&mut self, leg: usize, open: bool) {
        self.open[leg] = open;
        self.judge();
    }

    pub(crate) fn set_earth_fault(&mut self, fault: Option<(usize, EarthFault)>) {
        if let Some((leg, fault)) = &fault {
            assert!(*leg < 3, "the bridge has three legs");
            fault.check();
        }
        self.earth = fault;
        self.judge();
    }

    fn judge(&mut self) {
        self.sound = self.resistances == [0.0; 3] && self.open == [false; 3] && self.earth.is_none();
    }

    pub(crate) fn resistance(&self, leg: usize) -> f64 {
        self.resistances[leg]
    }

    pub(crate) fn is_open(&self, leg: usize) -> bool {
        self.open[leg]
    }

    pub(crate) fn earth_fault(&self) -> Option<(usize, EarthFault)> {
        self.earth
    }

    /// The earth fault of a leg.
    pub(crate) fn earth_fault_of(&self, leg: usize) -> Option<EarthFault> {
        self.earth.filter(|(faulty, _)| *faulty == leg).map(|(_, fault)| fault)
    }
}
