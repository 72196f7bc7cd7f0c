//! The sequences that measure the motor, joined to what the commands P-0-0224 to P-0-0226 stand for.
//!
//! What a sequence measures is summed up here; its result takes divisions and is therefore asked for in the background
//! (`commissioning`).

use servo::identification::{
    CurrentRequest, FluxIdentification, FluxMeasurement, FluxSettings, IdentificationError, IdentificationInputs,
    IdentificationOutput, IdentificationState, InductanceIdentification, InductanceMeasurement, InductanceSettings,
    InertiaIdentification, InertiaMeasurement, InertiaSettings, ResistanceIdentification, ResistanceMeasurement,
    ResistanceSettings,
};
use servo::units::{CurrentFraction, Position, Velocity};

/// What is to be measured, and how.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Plan {
    /// P-0-0224.
    Winding(ResistanceSettings, InductanceSettings),
    /// P-0-0225.
    Flux(FluxSettings),
    /// P-0-0226.
    Inertia(InertiaSettings),
}

impl Plan {
    /// What may be needed to hold the axis at its start; `None`: the loops hold it all the while.
    fn largest_load(&self) -> Option<CurrentFraction> {
        match self {
            Self::Winding(resistance, _) => Some(resistance.largest_load()),
            Self::Flux(_) | Self::Inertia(_) => None,
        }
    }

    /// Whether an axis that is held with `current` may be let go for it.
    ///
    /// # Errors
    /// [`Failure::Loaded`].
    pub(super) fn look_at_load(&self, current: CurrentFraction) -> Result<(), Failure> {
        let fits = self.largest_load().is_none_or(|largest| current.abs() <= largest);
        if fits { Ok(()) } else { Err(Failure::Loaded) }
    }
}

/// What was measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Measurement {
    /// P-0-0224.
    Winding(ResistanceMeasurement, InductanceMeasurement),
    /// P-0-0225.
    Flux(FluxMeasurement),
    /// P-0-0226.
    Inertia(InertiaMeasurement),
}

/// Why nothing was measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Failure {
    /// The sequence has given up.
    Sequence(IdentificationError),
    /// HALT has ended, or torque or operation have: by the control unit or by an error.
    Interrupted,
    /// It would have let a load go that the axis holds.
    Loaded,
}

/// How an identification has ended.
pub(crate) type Outcome = Result<Measurement, Failure>;

/// What is asked for until the next tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Request {
    /// Currents and voltages at this angle, in 2^-32 electrical revolution, wherever the rotor is.
    Current { angle: u32, current: CurrentRequest },
    /// A velocity.
    Velocity(Velocity),
}

/// Result of a tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Step {
    pub(crate) request: Request,
    /// 0 to 100.
    pub(crate) percent: u8,
    /// In the last tick.
    pub(crate) result: Option<Result<Measurement, IdentificationError>>,
}

/// An identification under way.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Identification {
    stage: Stage,
    angle: u32,
    percent: u8,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Stage {
    Resistance(ResistanceIdentification, InductanceSettings),
    Inductance(ResistanceMeasurement, InductanceIdentification),
    Flux(FluxIdentification),
    Inertia(InertiaIdentification),
}

impl Identification {
    /// Begins where the motor stands; `angle` is its electrical angle there, in 2^-32 revolution.
    ///
    /// The currents are held at the nearest multiple of 60 degrees: there no phase current is near zero, where the dead time of the bridge
    /// would disturb most. The rotor turns by 30 electrical degrees at most.
    pub(crate) fn start(plan: &Plan, position: Position, angle: u32) -> Self {
        let stage = match *plan {
            Plan::Winding(resistance, inductance) => {
                Stage::Resistance(ResistanceIdentification::start(resistance, position), inductance)
            }
            Plan::Flux(settings) => Stage::Flux(FluxIdentification::start(settings, position)),
            Plan::Inertia(settings) => Stage::Inertia(InertiaIdentification::start(settings, position)),
        };
        Self { stage, angle: nearest_sixth(angle), percent: 0 }
    }

    /// It needs a velocity loop; otherwise a current at an angle.
    pub(crate) const fn turns(&self) -> bool {
        matches!(self.stage, Stage::Flux(_) | Stage::Inertia(_))
    }

    /// One tick.
    #[inline]
    pub(crate) fn tick(&mut self, inputs: &IdentificationInputs) -> Step {
        let angle = self.angle;
        match &mut self.stage {
            Stage::Resistance(sequence, inductance) => {
                let (inductance, output) = (*inductance, sequence.tick(inputs));
                let request = Request::Current { angle, current: output.request };
                // The first half of the way.
                self.percent = percent_of(&output) / 2;
                let result = match output.state {
                    IdentificationState::Running { .. } => None,
                    IdentificationState::Done(measurement) => {
                        let next = InductanceIdentification::start(inductance, inputs.position);
                        self.stage = Stage::Inductance(measurement, next);
                        None
                    }
                    IdentificationState::Failed(error) => Some(Err(error)),
                };
                Step { request, percent: self.percent, result }
            }
            Stage::Inductance(resistance, sequence) => {
                let (resistance, output) = (*resistance, sequence.tick(inputs));
                let request = Request::Current { angle, current: output.request };
                self.percent = 50_u8.saturating_add(percent_of(&output) / 2);
                self.ended(request, output.state, |inductance| Measurement::Winding(resistance, inductance))
            }
            Stage::Flux(sequence) => {
                let output = sequence.tick(inputs);
                self.percent = percent_of(&output);
                self.ended(Request::Velocity(output.request), output.state, Measurement::Flux)
            }
            Stage::Inertia(sequence) => {
                let output = sequence.tick(inputs);
                self.percent = percent_of(&output);
                self.ended(Request::Velocity(output.request), output.state, Measurement::Inertia)
            }
        }
    }

    #[inline]
    fn ended<M>(
        &self,
        request: Request,
        state: IdentificationState<M>,
        measured: impl FnOnce(M) -> Measurement,
    ) -> Step {
        let (percent, result) = match state {
            IdentificationState::Running { .. } => (self.percent, None),
            IdentificationState::Done(measurement) => (100, Some(Ok(measured(measurement)))),
            IdentificationState::Failed(error) => (self.percent, Some(Err(error))),
        };
        Step { request, percent, result }
    }
}

#[inline]
fn percent_of<R, M>(output: &IdentificationOutput<R, M>) -> u8 {
    match output.state {
        IdentificationState::Running { percent } => percent,
        IdentificationState::Done(_) | IdentificationState::Failed(_) => 100,
    }
}

/// The nearest multiple of a sixth of a revolution, in 2^-32.
fn nearest_sixth(angle: u32) -> u32 {
    let sixths = u64::from(angle).wrapping_mul(6).wrapping_add(1 << 31) >> 32;
    // Six of them are none.
    ((sixths << 32) / 6) as u32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_held_angle_is_a_multiple_of_sixty_degrees_at_most_thirty_away() {
        let degrees = |degrees: f64| (degrees / 360.0 * 4_294_967_296.0) as u32;
        for (angle, expected) in [
            (0.0, 0.0),
            (29.9, 0.0),
            (30.1, 60.0),
            (89.9, 60.0),
            (90.1, 120.0),
            (269.0, 240.0),
            (329.9, 300.0),
            (330.1, 0.0),
        ] {
            let difference = nearest_sixth(degrees(angle)).wrapping_sub(degrees(expected)).cast_signed();
            assert!(difference.abs() <= 1, "{angle}: {difference}");
        }
    }
}
