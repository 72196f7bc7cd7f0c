//! Everything that the laws look at, at one instant.

use ring::Nanoseconds;
use ring::ident::Idn;

use plant::MachineSettings;

use crate::settings::Settings;
use crate::sight::Sight;
use crate::units::Units;
use crate::wire::Wire;

/// What is seen and heard of one axis.
#[derive(Clone, Debug)]
pub struct Scene {
    /// Now.
    pub now: Nanoseconds,
    /// The last look.
    pub sight: Sight,
    /// The look before it.
    pub before: Sight,
    /// The fibre.
    pub wire: Wire,
    /// What the drive is set to.
    pub settings: Settings,
    /// What its increments are.
    pub units: Option<Units>,
    /// What the machine is made of.
    pub machine: MachineSettings,
    /// S-0-0002, or 2 ms.
    pub cycle: Nanoseconds,
    /// When the load, or another torque from outside, last changed; a seized shaft and a shaft that is let go count too.
    pub disturbed: Option<Nanoseconds>,
    /// A sensor of current or position shows, or has shown since the bridge came on, what is not so.
    pub deceived: bool,
    /// When a pin of the power stage last changed.
    pub pins_changed: Option<Nanoseconds>,
    /// When the bridge was last switched.
    pub bridge_changed: Option<Nanoseconds>,
    /// The last procedure command that was started and not yet cancelled.
    pub command: Option<Idn>,
}

impl Scene {
    /// In CP4, with the ring intact.
    #[must_use]
    pub fn is_operating(&self) -> bool {
        self.wire.is_operating(self.now, self.cycle)
    }

    /// So long ago, or `None` if never.
    #[must_use]
    pub fn since(&self, then: Option<Nanoseconds>) -> Option<Nanoseconds> {
        then.map(|then| self.now.saturating_sub(then))
    }

    /// It happened within `span`.
    #[must_use]
    pub fn within(&self, then: Option<Nanoseconds>, span: Nanoseconds) -> bool {
        self.since(then).is_some_and(|since| since <= span)
    }

    /// Torque in Nm for 1 A across the magnet.
    #[must_use]
    pub fn torque_constant(&self) -> f64 {
        1.5 * f64::from(self.machine.windings.pole_pairs) * self.machine.windings.flux
    }

    /// Inertia of rotor and load in kg m².
    #[must_use]
    pub fn inertia(&self) -> f64 {
        self.machine.mechanics.rotor_inertia + self.machine.mechanics.load.map_or(0.0, |load| load.inertia)
    }

    /// The current in A that S-0-0082, 83, 92, 109 and 110 leave to a torque of this sign; `None` while one is not known.
    #[must_use]
    pub fn current_limit(&self, positive: bool) -> Option<f64> {
        let number = |idn: u16| self.settings.unsigned(Idn(idn)).map(|value| value as f64);
        let side = if positive { self.settings.signed(Idn(82))? } else { -self.settings.signed(Idn(83))? } as f64;
        let torque = side.min(number(92)?) * self.units?.torque;
        Some(torque.min(number(109)? * 1e-3).min(number(110)? * 1e-3))
    }

    /// The motor gives what its limits or its supply leave it, or nearly so.
    #[must_use]
    pub fn is_at_its_limit(&self) -> bool {
        let [d, q] = self.sight.machine.current;
        let starved = self.sight.machine.bus_voltage < 0.9 * self.machine.supply.voltage;
        starved || self.current_limit(q > 0.0).is_none_or(|limit| d.hypot(q) > 0.9 * limit)
    }

    /// So many cycles, and so many microseconds beyond them.
    #[must_use]
    pub const fn cycles(&self, cycles: u64, microseconds: u64) -> Nanoseconds {
        Nanoseconds(self.cycle.0 * cycles + microseconds * 1_000)
    }
}
