//! What a real machine has beside the textbook's.

use crate::{LegCapacitance, Wiring};

/// Effects that a machine has when it is told to; [`Effects::NONE`] is the default and that of every reference axis.
///
/// Each is switched on by one line, as `settings.effects.leg_capacitance = Some(LegCapacitance { farads: 2e-9 })`, of a
/// [`MachineSettings`](crate::MachineSettings) or of a reference axis' `machine`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Effects {
    /// The voltage of a leg slews in the dead time.
    pub leg_capacitance: Option<LegCapacitance>,
    /// Cores of the motor cable have changed places.
    pub wiring: Option<Wiring>,
}

impl Effects {
    /// None.
    pub const NONE: Self = Self { leg_capacitance: None, wiring: None };

    /// No leg is more than a switch, each on its own winding.
    pub(crate) fn legs_are_plain(&self) -> bool {
        self.leg_capacitance.is_none() && self.wiring.is_none()
    }

    pub(crate) fn check(&self) {
        if let Some(capacitance) = &self.leg_capacitance {
            capacitance.check();
        }
    }
}
