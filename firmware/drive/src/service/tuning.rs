//! P-0-0240: the axis is measured, its velocity loop made of the measurement, and what came of it measured again.
//!
//! ```text
//! Inertia -> Sweep -> Close (around a resonance) -> Shaping -> Verification -> done
//!                                                      ^            |
//!                                                      +-- slower --+
//! ```
//!
//! Each measurement is an identification of its own, under the same conditions as P-0-0226, and HALT holds the axis between two of them. They are planned
//! here, in the background, and their results taken; the search for gains tries a candidate in each call. Until the end the parameters are what
//! they were: the loops alone get the gains that are verified, and lose them again when the command fails or is cancelled.

use servo::arithmetic::Response;
use servo::axis::{
    FilterSection, LoopPoint, LoopResponse, Margins, Shaped, Shaping, ShapingRequest, VelocityRate,
    acceleration_feed_forward, acceleration_smoothing, position_gain,
};
use servo::current::PwmFrequency;
use servo::identification::{
    CLOSE_LOOK, ExcitationFrequency, ExcitationMeasurement, ExcitationSettings, IdentificationError, Inertia,
    InertiaSettings, SWEEP,
};
use servo::units::{CurrentFraction, Position, Velocity};

use sercos::Idn;
use sercos::parameters::Parameters;

mod values;

#[cfg(test)]
pub(crate) use values::shaping_request;

use super::commissioning::{Finding, identification, inertia_values, put};
use crate::motion::identification::{Failure, Measurement, Outcome, Plan};
use crate::settings::current::torque_constant;
use crate::settings::invalid::InvalidSetting;

const S: fn(u16) -> Idn = Idn::standard;
const P: fn(u16) -> Idn = Idn::product;

/// What P-0-0243 tells.
pub(crate) mod result {
    /// P-0-0247 is the frequency of a resonance.
    pub(crate) const RESONANCE: u16 = 1 << 0;
    /// A notch was put on it.
    pub(crate) const NOTCH: u16 = 1 << 1;
    /// There was no room for one: both filters of the current command are somebody's own.
    pub(crate) const NO_ROOM: u16 = 1 << 2;
    /// The low-pass of P-0-0220 was set.
    pub(crate) const LOW_PASS: u16 = 1 << 3;
    /// The loop is slower than was worked out, because the verification asked for it.
    pub(crate) const SLOWER: u16 = 1 << 4;
}

/// What was found last: P-0-0243 to P-0-0247.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Found {
    /// See [`result`].
    pub(crate) bits: u16,
    /// As they were measured.
    pub(crate) margins: Margins,
    /// In 0.01 Hz; 0: none.
    pub(crate) resonance: u32,
}

impl Found {
    /// P-0-0244 in 0.1 degrees.
    pub(crate) fn phase_margin(&self) -> u16 {
        tenths(Response::new(0, self.margins.phase).hundredths_of_degree())
    }

    /// P-0-0245 in 0.1 dB.
    pub(crate) fn gain_margin(&self) -> u16 {
        tenths(Response::new(self.margins.gain, 0).hundredths_of_decibel())
    }
}

/// From hundredths, to the nearest, not below zero.
fn tenths(hundredths: i32) -> u16 {
    u16::try_from(hundredths.max(0).saturating_add(5) / 10).unwrap_or(u16::MAX)
}

/// How far P-0-0240 has come, and what it has found.
#[derive(Clone, Debug, Default)]
pub(crate) struct Tuning {
    stage: Stage,
    /// The next measurement waits for an axis that stands.
    waits: bool,
    /// Calls for which it has waited.
    waited: u16,
    /// The excitation is halved so often.
    attenuation: u32,
    /// Verifications that have failed.
    failures: u16,
    origin: Position,
    /// What P-0-0226 would write: P-0-0221, S-0-0155, P-0-0142.
    inertia: [u32; 3],
    response: LoopResponse,
    request: Option<ShapingRequest>,
    shaping: Option<Shaping>,
    shaped: Option<Shaped>,
    /// P-0-0241 and P-0-0242.
    asked: Margins,
    found: Found,
    /// P-0-0249.
    window: u16,
    /// Somebody has handed other settings to the loops.
    is_disturbed: bool,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Stage {
    #[default]
    Idle,
    Inertia,
    /// Index of the frequency.
    Sweep(u8),
    /// The same around this frequency, in 0.01 Hz.
    Close(u32, u8),
    Shaping,
    /// Of the frequency in 0.01 Hz, up to the last one.
    Verification(u32, u32),
}

/// What is to be done next.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Next {
    /// There is nothing to be done until something happens, or until the next call.
    Wait,
    /// The measurement of the stage.
    Measure,
    /// These parameters are to be in force in the loops.
    Try,
    /// Everything is measured: [`Tuning::values`] are to be written.
    Done,
}

/// Points of a window of P-0-0248, and numbers of a point.
const WINDOW: usize = 6;
/// Calls of the background, every 500 us, until an axis that ought to stand is given up: 2 s.
const PATIENCE: u16 = 4_000;
/// A verification may fall short by so much, in 2^-32 revolution (3 degrees) and 2^-16 of a factor 2 (1 dB).
const PHASE_TOLERANCE: i32 = 35_791_394;
const GAIN_TOLERANCE: i32 = 10_885;
/// Then a slower loop is tried, twice at most.
const ATTEMPTS: u16 = 2;

impl Tuning {
    /// A measurement is under way, or was: this is no time for the search.
    pub(crate) const fn measured(&self) -> bool {
        !matches!(self.stage, Stage::Idle | Stage::Shaping)
    }

    /// Nobody has handed other settings to the loops.
    ///
    /// # Errors
    /// [`Finding::Disturbed`].
    pub(crate) const fn look(&self) -> Result<(), Finding> {
        if self.is_disturbed { Err(Finding::Disturbed) } else { Ok(()) }
    }

    /// Writes everything that was found, or nothing.
    ///
    /// # Errors
    /// [`Finding`]; nothing is changed then.
    pub(crate) fn write(
        &self,
        parameters: &mut Parameters,
        check: impl Fn(&Parameters) -> Result<(), InvalidSetting>,
    ) -> Result<(), Finding> {
        self.look()?;
        let [a, b, c, d, e, f, g, h, i, j, k] = self.loop_values(parameters)?;
        let [l, m, n, o, p] = self.axis_values(parameters)?;
        put(parameters, [a, b, c, d, e, f, g, h, i, j, k, l, m, n, o, p], check)
    }

    /// Begins, with the axis at `position`. The next to do is [`Next::Measure`].
    #[cold]
    #[inline(never)]
    pub(crate) fn begin(&mut self, position: Position) {
        *self = Self { stage: Stage::Inertia, origin: position, window: self.window, ..Self::default() };
    }

    /// Is over; what was found stays.
    pub(crate) const fn end(&mut self) {
        self.stage = Stage::Idle;
    }

    /// Other settings were handed to the loops.
    pub(crate) const fn disturb(&mut self) {
        self.is_disturbed = true;
    }

    /// P-0-0243 to P-0-0247.
    pub(crate) const fn found(&self) -> &Found {
        &self.found
    }

    /// P-0-0249.
    pub(crate) const fn window(&self) -> u16 {
        self.window
    }

    /// Sets P-0-0249.
    pub(crate) const fn set_window(&mut self, window: u16) {
        self.window = window;
    }

    /// P-0-0248: of each point frequency, axis and open loop.
    pub(crate) fn points(&self) -> impl Iterator<Item = u32> + '_ {
        let points = self.response.points().iter().skip(self.window.into()).take(WINDOW);
        points.flat_map(|point| {
            let of = |response: Response| [response.hundredths_of_decibel(), response.hundredths_of_degree()];
            let ([gain, phase], [open_gain, open_phase]) = (of(point.axis), of(point.open));
            [
                point.frequency,
                gain.cast_unsigned(),
                phase.cast_unsigned(),
                open_gain.cast_unsigned(),
                open_phase.cast_unsigned(),
            ]
        })
    }

    /// P-0-0227.
    pub(crate) fn percent(&self) -> u8 {
        let share = |of: u8, done: u32, all: u32| {
            u32::from(of).saturating_mul(done).checked_div(all).unwrap_or(0).min(of.into()) as u8
        };
        match self.stage {
            Stage::Idle => 100,
            Stage::Inertia => 0,
            Stage::Sweep(index) => 5_u8.saturating_add(share(55, index.into(), SWEEP.into())),
            Stage::Close(_, index) => 60_u8.saturating_add(share(10, index.into(), CLOSE_LOOK.into())),
            Stage::Shaping => 70,
            Stage::Verification(frequency, last) => 75_u8.saturating_add(share(24, frequency, last)),
        }
    }

    /// The measurement of this stage, of an axis that stands at `position`, has so much voltage (2^-14 V), and needs `halt` of a velocity to stop. Divides.
    ///
    /// # Errors
    /// The way does not fit into P-0-0229, or a parameter cannot be worked with.
    pub(crate) fn plan(
        &self,
        parameters: &Parameters,
        frequency: PwmFrequency,
        position: Position,
        longest_voltage: i32,
        mut halt: impl FnMut(Velocity) -> Position,
    ) -> Result<Plan, Finding> {
        let mut identification = identification(parameters, frequency)?;
        let fastest = identification.velocity;
        let window = identification.movement;
        // What the loops need to notice, and an eighth that they swing by.
        let mut room = |velocity: Velocity| {
            let stop = halt(velocity).to_bits();
            let noticed = i64::from(velocity.abs().to_bits()).saturating_mul(240) >> 4;
            let reserve = stop.saturating_add(stop / 8).saturating_add(noticed);
            Position::from_bits(window.to_bits().saturating_sub(reserve).max(0))
        };
        let wanted = match self.stage {
            Stage::Inertia => {
                identification.movement = room(fastest);
                values::fits(values::way_of_inertia(parameters), identification.movement)?;
                return Ok(Plan::Inertia(InertiaSettings::new(&identification, torque_constant(parameters))?));
            }
            Stage::Sweep(index) => ExcitationFrequency::of_sweep(index),
            Stage::Close(centre, index) => ExcitationFrequency::around(centre, index),
            Stage::Verification(at, _) => ExcitationFrequency::near(at, 32),
            Stage::Idle | Stage::Shaping => return Err(Finding::Interrupted),
        };
        let slow = Velocity::from_bits(fastest.abs().to_bits() / 4);
        // Back to where it began.
        identification.velocity = if position > self.origin { -slow } else { slow };
        identification.movement = room(Velocity::from_bits(slow.to_bits().saturating_mul(2)));
        let gain = self.shaped.map_or(parameters.get(S(100)), |shaped| shaped.gain);
        let amplitude =
            values::amplitude(parameters, self.inertia[0], gain, wanted.hundredths(), slow, longest_voltage);
        let amplitude = CurrentFraction::from_bits((amplitude.to_bits() >> self.attenuation).max(1));
        let settings = ExcitationSettings::new(&identification, wanted, amplitude, Some(self.origin))?;
        Ok(Plan::Excitation(settings))
    }

    /// Takes what came of the measurement of this stage, and says what is next.
    ///
    /// # Errors
    /// Why the tuning has failed.
    pub(crate) fn take(
        &mut self,
        outcome: Outcome,
        parameters: &Parameters,
        frequency: PwmFrequency,
    ) -> Result<Next, Finding> {
        let measurement = match outcome {
            Err(Failure::Sequence(IdentificationError::CurrentLimit)) if self.attenuation < 4 => {
                self.attenuation = self.attenuation.saturating_add(1);
                return Ok(Next::Measure);
            }
            other => other?,
        };
        self.attenuation = self.attenuation.saturating_sub(1);
        match (self.stage, measurement) {
            (Stage::Inertia, Measurement::Inertia(measured)) => {
                let measured: Inertia = measured.inertia()?;
                self.inertia = inertia_values(&measured, parameters)?.map(|(_, value)| value);
                self.stage = Stage::Sweep(0);
                Ok(Next::Measure)
            }
            (_, Measurement::Excitation(measured)) => {
                let noted = self.note(&measured, parameters)?;
                self.after(noted, parameters, VelocityRate::of(frequency))
            }
            _ => Err(Finding::Interrupted),
        }
    }

    /// A point in the units of P-0-0248.
    fn note(&mut self, measured: &ExcitationMeasurement, parameters: &Parameters) -> Result<u32, Finding> {
        let frequency = measured.frequency().hundredths();
        // 2^-10 revolution a tick in rad/s, and the peak current in A: 2 pi 8 000 000 / 1 024, per mA.
        let scale = |value: u32| Response::of_vector(value.into(), 0).unwrap_or(Response::ONE);
        let axis = measured.axis()?.then(scale(49_087)).over(scale(parameters.get(S(110))));
        // A sweep has as many points as there is room for.
        let _ = self.response.insert(LoopPoint { frequency, axis, open: measured.open_loop()? });
        Ok(frequency)
    }

    fn after(&mut self, frequency: u32, parameters: &Parameters, rate: VelocityRate) -> Result<Next, Finding> {
        let next = match self.stage {
            Stage::Sweep(index) if index.saturating_add(1) < SWEEP => Some(Stage::Sweep(index.saturating_add(1))),
            Stage::Sweep(_) => self.response.resonance().map(|resonance| Stage::Close(resonance.frequency, 0)),
            Stage::Close(centre, index) if index.saturating_add(1) < CLOSE_LOOK => {
                Some(Stage::Close(centre, index.saturating_add(1)))
            }
            Stage::Verification(_, last) => match self.next_point(frequency, last) {
                Some(at) => Some(Stage::Verification(at, last)),
                None => return self.judge(),
            },
            _ => None,
        };
        self.stage = next.unwrap_or(Stage::Shaping);
        if self.stage != Stage::Shaping {
            return Ok(Next::Measure);
        }
        let request = values::shaping_request(parameters, rate);
        self.asked = request.margins();
        self.found.resonance = self.response.resonance().map_or(0, |resonance| resonance.frequency);
        self.shaping = Some(Shaping::new(request, &self.response));
        self.request = Some(request);
        Ok(Next::Wait)
    }

    /// The next frequency that was measured behind this one.
    fn next_point(&self, frequency: u32, last: u32) -> Option<u32> {
        let frequencies = self.response.points().iter().map(|point| point.frequency);
        frequencies.filter(|&other| other > frequency && other <= last).min()
    }

    /// A candidate more; what has come before its time.
    ///
    /// # Errors
    /// [`Finding::NoMargin`].
    pub(crate) fn go_on(&mut self) -> Result<Next, Finding> {
        self.look()?;
        let (Stage::Shaping, Some(shaping), Some(request)) = (self.stage, &mut self.shaping, self.request) else {
            return Ok(Next::Wait);
        };
        let Some(ended) = shaping.step(&self.response) else { return Ok(Next::Wait) };
        let shaped = ended.ok_or(Finding::NoMargin)?;
        shaped.put_into(&request, &mut self.response);
        // A notch of the attempt before stays, and is in the response.
        let notch = match (self.shaped, shaped.notch) {
            (Some(before), FilterSection::Off) => before.notch,
            (_, notch) => notch,
        };
        self.shaped = Some(Shaped { notch, ..shaped });
        Ok(Next::Try)
    }

    /// The loops work with what was found: it is measured from well below the crossing to well above -180 degrees.
    ///
    /// # Errors
    /// [`Finding::NoMargin`].
    pub(crate) fn verify(&mut self) -> Result<Next, Finding> {
        let margins = self.shaped.map(|shaped| shaped.margins).unwrap_or_default();
        let first = margins.crossing.saturating_mul(5) / 8;
        let turning = if margins.turning == 0 { margins.crossing.saturating_mul(4) } else { margins.turning };
        let last = turning.saturating_mul(4) / 3;
        match self.next_point(first, last) {
            Some(at) => {
                self.stage = Stage::Verification(at, last);
                self.is_disturbed = false;
                Ok(Next::Measure)
            }
            None => self.judge(),
        }
    }

    /// Whether the loop that was measured has the margins that it shall have.
    fn judge(&mut self) -> Result<Next, Finding> {
        let (Some(request), Some(shaped)) = (self.request, self.shaped) else { return Ok(Next::Wait) };
        let measured = self.response.margins(|point| point.open).unwrap_or_default();
        let phase = self.asked.phase.saturating_sub(measured.phase);
        let gain = self.asked.gain.saturating_sub(measured.gain);
        self.found.margins = measured;
        if phase <= PHASE_TOLERANCE && gain <= GAIN_TOLERANCE {
            self.tell(&shaped);
            return Ok(Next::Done);
        }
        self.failures = self.failures.saturating_add(1);
        if self.failures > ATTEMPTS {
            return Err(Finding::NoMargin);
        }
        let slower = request.with_more(&shaped, phase, gain);
        self.shaping = Some(Shaping::new(slower, &self.response));
        self.request = Some(slower);
        self.stage = Stage::Shaping;
        Ok(Next::Wait)
    }

    fn tell(&mut self, shaped: &Shaped) {
        let has_resonance = self.found.resonance != 0;
        let has_room = self.request.is_some_and(|request| request.has_room);
        let has_notch = shaped.notch != FilterSection::Off;
        let bit = |is_set: bool, bit: u16| if is_set { bit } else { 0 };
        self.found.bits = bit(has_resonance, result::RESONANCE)
            | bit(has_notch, result::NOTCH)
            | bit(has_resonance && !has_room && !has_notch, result::NO_ROOM)
            | bit(shaped.low_pass != FilterSection::Off, result::LOW_PASS)
            | bit(self.failures > 0, result::SLOWER);
    }

    /// The axis does not stand yet: `false` once it has had its time.
    pub(crate) fn may_wait(&mut self) -> bool {
        self.waits = true;
        self.waited = self.waited.saturating_add(1);
        self.waited < PATIENCE
    }

    /// A measurement waits for the axis.
    pub(crate) const fn waits(&self) -> bool {
        self.waits
    }

    /// It has begun.
    pub(crate) const fn measures(&mut self) {
        (self.waits, self.waited) = (false, 0);
    }

    /// What the loops have to work with: gains and filters.
    ///
    /// # Errors
    /// [`Finding::NoMargin`] before anything was found; [`Finding::Settings`] for a crossing beyond the range of S-0-0104.
    pub(crate) fn loop_values(&self, parameters: &Parameters) -> Result<[(Idn, u32); 11], Finding> {
        let shaped = self.shaped.ok_or(Finding::NoMargin)?;
        let crossing = shaped.margins.crossing.saturating_add(50) / 100;
        let [[a, b, c, d], [e, f, g, h]] = values::filters(parameters, shaped.low_pass, shaped.notch);
        Ok([
            (S(100), shaped.gain),
            (S(101), shaped.integral_time.into()),
            (S(104), position_gain(crossing.max(1))?.into()),
            a,
            b,
            c,
            d,
            e,
            f,
            g,
            h,
        ])
    }

    /// What is written besides at the end: inertia, friction and feed-forward.
    ///
    /// # Errors
    /// [`Finding::Settings`] where it is beyond its limits.
    pub(crate) fn axis_values(&self, parameters: &Parameters) -> Result<[(Idn, u32); 5], Finding> {
        let [inertia, coulomb, viscous] = self.inertia;
        let feed_forward = acceleration_feed_forward(inertia, parameters.get(P(114)))?;
        let smoothing = acceleration_smoothing(parameters.get_word(S(1)));
        Ok([
            (P(221), inertia),
            (S(155), coulomb),
            (P(142), viscous),
            (S(348), feed_forward.into()),
            (P(231), smoothing.into()),
        ])
    }
}
