//! What a real machine has beside the textbook's.

use crate::turn::Turn;
use crate::{
    Cogging, Eccentricity, EmfHarmonics, LegCapacitance, LowSideShunts, QuadratureError, SensorBandwidth, Stiction,
    Wiring,
};

/// Effects that a machine has when it is told to; [`Effects::NONE`] is the default and that of every reference axis.
///
/// Each is switched on by one line, as `settings.effects.leg_capacitance = Some(LegCapacitance { farads: 2e-9 })`, of a
/// [`MachineSettings`](crate::MachineSettings) or of a reference axis' `machine`. What breaks while the machine runs is an input of
/// [`Machine`](crate::Machine): contact resistances, an open phase, an earth fault.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Effects {
    /// The current sensors are shunts of the low side, with a window in which they can be read.
    pub shunts: Option<LowSideShunts>,
    /// The current sensors follow with a delay.
    pub sensor_bandwidth: Option<SensorBandwidth>,
    /// The voltage of a leg slews in the dead time.
    pub leg_capacitance: Option<LegCapacitance>,
    /// Cores of the motor cable have changed places.
    pub wiring: Option<Wiring>,
    /// The magnets hold on to the teeth.
    pub cogging: Option<Cogging>,
    /// The EMF is no sine.
    pub emf_harmonics: Option<EmfHarmonics>,
    /// The shaft sticks more than it rubs.
    pub stiction: Option<Stiction>,
    /// The encoder's disk lies beside the middle.
    pub eccentricity: Option<Eccentricity>,
    /// The encoder's signals are no pure sine and cosine.
    pub quadrature: Option<QuadratureError>,
}

impl Effects {
    /// None.
    pub const NONE: Self = Self {
        shunts: None,
        sensor_bandwidth: None,
        leg_capacitance: None,
        wiring: None,
        cogging: None,
        emf_harmonics: None,
        stiction: None,
        eccentricity: None,
        quadrature: None,
    };

    /// No leg is more than a switch, each on its own winding.
    pub(crate) fn legs_are_plain(&self) -> bool {
        self.leg_capacitance.is_none() && self.wiring.is_none()
    }

    /// The angle that the encoder's tracks show.
    pub(crate) fn shown_by_tracks(&self, turn: Turn) -> Turn {
        if self.eccentricity.is_none() && self.quadrature.is_none() {
            return turn;
        }
        let once = self.eccentricity.map_or(0.0, |eccentricity| eccentricity.error(turn));
        let often = self.quadrature.map_or(0.0, |quadrature| quadrature.error(turn));
        turn.after(once + often)
    }

    pub(crate) fn check(&self) {
        self.shunts.iter().for_each(LowSideShunts::check);
        self.sensor_bandwidth.iter().for_each(SensorBandwidth::check);
        self.leg_capacitance.iter().for_each(LegCapacitance::check);
        self.stiction.iter().for_each(Stiction::check);
        self.eccentricity.iter().for_each(Eccentricity::check);
        self.quadrature.iter().for_each(QuadratureError::check);
    }
}
