//! The bridge of six switches between the bus and the windings.

/// Below this phase current in A the error of the dead time shrinks with the current: its ripple changes sign within every period.
const SMALL_CURRENT: f64 = 0.05;
/// Below this phase current in A a diode is taken for a resistor: what leaks through an open bridge stays below it.
const LEAKAGE: f64 = 1e-6;

/// A two-level inverter with diodes, as the average over a period of its pulse width modulation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Inverter {
    /// Time in seconds between one switch of a phase and the other, in which the current's direction decides on the voltage.
    pub dead_time: f64,
    /// Period of the pulse width modulation in seconds.
    pub period: f64,
    /// Voltage in V that a conducting switch or diode takes, whatever the current.
    pub voltage_drop: f64,
}

/// A phase's terminal as the windings see it. Its voltage depends on the current's direction: between 1 for a current into the motor
/// and -1 for one out of it, `level` says how far. It is `(share - deviation * level) * bus - drop * level`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Terminal {
    /// Share of the bus voltage without current.
    pub(crate) share: f64,
    /// How much less of the bus a current into the motor finds.
    pub(crate) deviation: f64,
    /// Voltage lost in the semiconductors.
    pub(crate) drop: f64,
    /// Current in A at which the level reaches 1.
    pub(crate) knee: f64,
}

impl Inverter {
    pub(crate) fn check(&self) {
        assert!(self.period > 0.0, "the period of the pulse width modulation must be positive");
        assert!((0.0..=0.5 * self.period).contains(&self.dead_time), "the dead time must fit into half a period");
        assert!(self.voltage_drop >= 0.0, "the voltage drop must not be negative");
    }

    /// The terminals with the high-side switches closed for these shares of the period, or with all switches open.
    pub(crate) fn terminals(&self, bridge: bool, duties: &[f64; 3]) -> [Terminal; 3] {
        let drop = self.voltage_drop;
        if !bridge {
            // A current into the motor comes through the lower diode, one out of it goes through the upper.
            return [Terminal { share: 0.5, deviation: 0.5, drop, knee: LEAKAGE }; 3];
        }
        let lost = self.dead_time / self.period;
        duties.map(|share| {
            // A pulse or a gap that is shorter than the dead time cannot lose more than itself.
            let deviation = lost.min(share).min(1.0 - share);
            Terminal { share, deviation, drop, knee: SMALL_CURRENT }
        })
    }
}
