//! Heat of windings and heat sink.

/// Two bodies that losses heat and the ambient air cools. Temperatures are in degrees Celsius.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Thermal {
    /// The windings, heated by the current.
    pub winding: HeatedBody,
    /// The inverter's heat sink, heated by the voltage drop of its semiconductors.
    pub heat_sink: HeatedBody,
    /// Ambient temperature at time zero; both bodies begin with it.
    pub ambient: f64,
}

/// A body of one temperature.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HeatedBody {
    /// Heat capacity in J/K.
    pub capacity: f64,
    /// Thermal resistance to the ambient air in K/W.
    pub resistance: f64,
}

/// State of the bodies.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Temperatures {
    pub(crate) winding: f64,
    pub(crate) heat_sink: f64,
}

impl HeatedBody {
    fn check(&self) {
        assert!(self.capacity > 0.0 && self.resistance > 0.0, "heat capacity and thermal resistance must be positive");
    }

    /// The temperature after `dt` of a loss in W. The step is far below the time constant: Euler will do.
    fn step(&self, temperature: f64, loss: f64, ambient: f64, dt: f64) -> f64 {
        temperature + (loss - (temperature - ambient) / self.resistance) / self.capacity * dt
    }
}

impl Thermal {
    pub(crate) fn check(&self) {
        self.winding.check();
        self.heat_sink.check();
    }

    pub(crate) fn cold(&self) -> Temperatures {
        Temperatures { winding: self.ambient, heat_sink: self.ambient }
    }

    /// The temperatures after `dt` of losses in W.
    pub(crate) fn step(&self, old: Temperatures, losses: (f64, f64), ambient: f64, dt: f64) -> Temperatures {
        Temperatures {
            winding: self.winding.step(old.winding, losses.0, ambient, dt),
            heat_sink: self.heat_sink.step(old.heat_sink, losses.1, ambient, dt),
        }
    }
}
