//! The probes of S-0-0170, which look on while the axis moves.

use servo::probe::{Edge, Probe, ProbeInputs, ProbeSettings, ProbingCycle};
use servo::units::Position;

use crate::hardware::{Hardware, ProbeInput};

/// Probes, as the service channel and the AT see them.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Probing {
    cycle: ProbingCycle,
    /// `None`: S-0-0170 is not active.
    settings: Option<ProbeSettings>,
}

impl Probing {
    /// S-0-0170 with S-0-0169, or its end.
    pub(super) fn set(&mut self, settings: Option<ProbeSettings>, hardware: &mut impl Hardware) {
        if settings.is_some() {
            hardware.arm_probe(ProbeInput::One);
            hardware.arm_probe(ProbeInput::Two);
        } else if let Some(last) = self.settings {
            self.cycle.tick(&last, &ProbeInputs::default());
        }
        self.settings = settings;
    }

    /// Another S-0-0169: its edges count from now on if S-0-0170 is active, else it is for the next start.
    pub(super) const fn select(&mut self, settings: ProbeSettings) {
        if self.settings.is_some() {
            self.settings = Some(settings);
        }
    }

    /// One look at the probes, whose edges the hardware has latched; what they are is asked for only while S-0-0170 is active.
    #[inline]
    pub(super) fn look(&mut self, inputs: impl FnOnce() -> ProbeInputs) {
        if let Some(settings) = self.settings {
            self.cycle.tick(&settings, &inputs());
        }
    }

    /// S-0-0179.
    #[inline]
    pub(super) fn status(&self) -> u16 {
        self.cycle.measurement_value_status()
    }

    /// S-0-0130 to S-0-0133, in the turn of the data in which the edge came.
    #[inline]
    pub(super) const fn value(&self, probe: Probe, edge: Edge) -> Position {
        self.cycle.value(probe, edge)
    }
}
