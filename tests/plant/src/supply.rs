//! Rectifier, bus capacitor and brake chopper.

/// What feeds the bus: a voltage behind a resistance and diodes, which take nothing back.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Supply {
    /// Rectified voltage of the mains in V at time zero; the bus begins charged to it.
    pub voltage: f64,
    /// Resistance of mains and rectifier in ohm.
    pub resistance: f64,
    /// Capacitance of the bus in F.
    pub capacitance: f64,
    /// A resistor that burns what the motor feeds back, with a control of its own.
    pub chopper: Option<Chopper>,
    /// Ohms of a resistor that the drive's own output switches ([`Machine::set_chopper`](crate::Machine::set_chopper)).
    pub resistor: Option<f64>,
}

/// A brake chopper, switched with hysteresis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Chopper {
    /// Bus voltage in V above which it switches on.
    pub on_above: f64,
    /// Bus voltage in V below which it switches off.
    pub off_below: f64,
    /// Resistance in ohm.
    pub resistance: f64,
}

/// State of the bus.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Bus {
    /// In V.
    pub(crate) voltage: f64,
    pub(crate) chopping: bool,
}

impl Supply {
    pub(crate) fn check(&self) {
        assert!(self.voltage >= 0.0, "a rectifier gives no negative voltage");
        assert!(self.resistance > 0.0, "the resistance of the supply must be positive");
        assert!(self.capacitance > 0.0, "the capacitance of the bus must be positive");
        assert!(self.chopper.is_none_or(|c| c.resistance > 0.0), "the resistance of the chopper must be positive");
        assert!(self.resistor.is_none_or(|ohms| ohms > 0.0), "the resistance of the drive's resistor must be positive");
        assert!(
            self.chopper.is_none_or(|c| c.off_below <= c.on_above),
            "the chopper must go off below where it goes on"
        );
    }

    /// The bus at time zero.
    pub(crate) fn charged(&self) -> Bus {
        Bus { voltage: self.voltage, chopping: false }
    }

    /// The bus after `dt` at a mains voltage, while the bridge draws a current and the drive switches its resistor; trapezoidal.
    pub(crate) fn step(&self, bus: Bus, (mains, switched): (f64, bool), drawn: f64, dt: f64) -> Bus {
        let (mut conductance, mut current) = (0.0, -drawn);
        if mains > bus.voltage {
            conductance += 1.0 / self.resistance;
            current += mains / self.resistance;
        }
        if let (Some(chopper), true) = (self.chopper, bus.chopping) {
            conductance += 1.0 / chopper.resistance;
        }
        if let (Some(resistor), true) = (self.resistor, switched) {
            conductance += 1.0 / resistor;
        }
        let change = self.capacitance / dt;
        let voltage = ((change - 0.5 * conductance) * bus.voltage + current) / (change + 0.5 * conductance);
        // Below zero the diodes of the bridge would short the bus.
        let voltage = voltage.max(0.0);
        let chopping = self.chopper.is_some_and(|chopper| {
            let threshold = if bus.chopping { chopper.off_below } else { chopper.on_above };
            voltage > threshold
        });
        Bus { voltage, chopping }
    }
}
