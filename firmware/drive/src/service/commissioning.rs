//! Commissioning over the service channel: gains from the data of the motor (P-0-0220), and the data of the motor from measurements
//! (P-0-0224 to P-0-0226).
//!
//! Everything that divides is here, in the background, and after the release of the step that asked for it. A command changes all of its
//! parameters or none, and P-0-0228 says why.

use core::fmt;

use sercos::Idn;
use sercos::parameters::Parameters;
use servo::SettingsError;
use servo::axis::{
    NOISE_DAMPING, NOISE_TIME, VelocityRate, acceleration_feed_forward, acceleration_smoothing, current_gains, is_felt,
    noise_filter, position_gain, velocity_gains,
};
use servo::current::PwmFrequency;
use servo::identification::{
    FluxSettings, IdentificationError, IdentificationParameters, InductanceSettings, Inertia, InertiaSettings,
    ResistanceSettings,
};
use servo::units::{Acceleration, Position, Velocity};

use crate::dictionary::procedures::Procedure;
use crate::motion::identification::{Failure, Measurement, Outcome, Plan};
use crate::settings::current::{amplitude, rms, torque_constant};
use crate::settings::invalid::InvalidSetting;
use crate::settings::torque::TorqueScale;

const S: fn(u16) -> Idn = Idn::standard;
const P: fn(u16) -> Idn = Idn::product;

/// Which identification runs, and what the last command has found.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Commissioning {
    /// P-0-0224, P-0-0225 or P-0-0226.
    pub(crate) identifying: Option<Procedure>,
    /// P-0-0228.
    pub(crate) finding: Option<Finding>,
}

/// Why a command has failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Finding {
    /// The motor's data or what was asked for cannot be worked with.
    Settings(SettingsError),
    /// The result does not fit into its parameter.
    Limits { idn: Idn, actual: u32 },
    /// The loops cannot work with the result.
    Refused(Idn),
    /// The measurement.
    Identification(IdentificationError),
    /// HALT has ended before the measurement, or torque or operation have.
    Interrupted,
    /// P-0-0224 would have let a load go.
    Loaded,
}

impl From<SettingsError> for Finding {
    fn from(error: SettingsError) -> Self {
        Self::Settings(error)
    }
}

impl From<Failure> for Finding {
    fn from(failure: Failure) -> Self {
        match failure {
            Failure::Sequence(error) => Self::Identification(error),
            Failure::Interrupted => Self::Interrupted,
            Failure::Loaded => Self::Loaded,
        }
    }
}

impl From<IdentificationError> for Finding {
    fn from(error: IdentificationError) -> Self {
        Self::Identification(error)
    }
}

impl fmt::Display for Finding {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Settings(error) => error.fmt(formatter),
            Self::Limits { idn, actual } => write!(formatter, "{idn} would be {actual}, which is beyond its limits"),
            Self::Refused(idn) => write!(formatter, "the loops cannot work with the result, see {idn}"),
            Self::Identification(IdentificationError::TooMuchMovement { .. }) => {
                formatter.write_str("the motor has turned further than P-0-0229, or than the current allows")
            }
            Self::Identification(IdentificationError::CurrentNotReached { .. }) => {
                formatter.write_str("the current does not come although voltage is left")
            }
            Self::Identification(error) => error.fmt(formatter),
            Self::Interrupted => formatter.write_str("interrupted: HALT, torque or operation have ended"),
            Self::Loaded => formatter.write_str("the axis holds a load that P-0-0224 would let go: take the load off"),
        }
    }
}

/// P-0-0220. `check` says whether the loops can work with the parameters as they are.
///
/// # Errors
/// [`Finding`]; nothing is changed then.
#[cold]
#[inline(never)]
pub(crate) fn compute_gains(
    parameters: &mut Parameters,
    frequency: PwmFrequency,
    check: impl Fn(&Parameters) -> Result<(), InvalidSetting>,
) -> Result<(), Finding> {
    let data = &*parameters;
    // With the gain for the larger inductance the loop of the other axis would be faster than asked for.
    let inductance = data.get(P(112)).min(data.get(P(113)));
    let current = current_gains(data.get(P(111)), inductance, data.get(P(222)), frequency)?;
    let current_loop = u64::from(inductance).saturating_mul(1_000).checked_div(current.proportional.into());
    let bandwidth = data.get(P(223));
    let rate = VelocityRate::of(frequency);
    let velocity_with = |time: u16, filters: u64| {
        let small_times = u64::from(time)
            .saturating_add(rate.delay(time > 0).into())
            .saturating_add(filters)
            .saturating_add(current_loop.unwrap_or(0));
        let small_times = u32::try_from(small_times).unwrap_or(u32::MAX);
        // Per ampere RMS, as S-0-0100 counts them.
        velocity_gains(data.get(P(221)), data.get(P(114)), bandwidth, small_times)
    };
    let [first, second] = [170, 174].map(|first| current_filter(data, first));
    let others = filter_delay(&first);
    // A notch is somebody's answer to a resonance, and one low-pass is enough.
    let keeps = second[0] == NOTCH || first[0] == LOW_PASS;
    let alone = if keeps { second } else { [0, second[1], second[2], 0] };
    let fastest = velocity_with(0, others.saturating_add(filter_delay(&alone)))?;
    let increments = data.get(S(116)).saturating_mul(4);
    let peak = data.get(S(109)).min(data.get(S(110)));
    let quiet = if keeps { second } else { [LOW_PASS, noise_filter(bandwidth).into(), NOISE_DAMPING.into(), 0] };
    // Against steps that are felt as much as leaves the bandwidth that was asked for; the low-pass does more than the velocity filter.
    let against_steps = || {
        let delays = others.saturating_add(filter_delay(&quiet));
        [NOISE_TIME, 0].into_iter().find_map(|time| Some((time, quiet, velocity_with(time, delays).ok()?)))
    };
    let chosen = if is_felt(fastest.proportional, increments, peak, rate.hertz()) { against_steps() } else { None };
    let (filter_time, filter, velocity) = chosen.unwrap_or((0, alone, fastest));
    let [kind, frequency, width, _] = filter;
    let position = position_gain(bandwidth)?;
    let feed_forward = acceleration_feed_forward(data.get(P(221)), data.get(P(114)))?;
    let smoothing = acceleration_smoothing(data.get_word(S(1)));
    // Less than half a step would switch the integral part off.
    let current_time = (current.integral_time.saturating_add(50) / 100).max(1);
    put(
        parameters,
        [
            (S(100), velocity.proportional),
            (S(101), velocity.integral_time.into()),
            (S(104), position.into()),
            (S(106), current.proportional),
            (S(107), current_time),
            (S(348), feed_forward.into()),
            (S(392), filter_time.into()),
            (P(231), smoothing.into()),
            (P(174), kind),
            (P(175), frequency),
            (P(176), width),
        ],
        check,
    )
}

/// What P-0-0224, P-0-0225 or P-0-0226 is to do.
///
/// # Errors
/// [`Finding::Settings`].
pub(crate) fn plan(procedure: Procedure, parameters: &Parameters, frequency: PwmFrequency) -> Result<Plan, Finding> {
    let peak_current = amplitude(parameters.get(S(110)));
    let torque = TorqueScale::new(parameters).map_err(|invalid| Finding::Refused(invalid.idn))?;
    // An angle that is held makes torque as soon as the rotor is not where it is asked to be.
    let [bipolar, positive, negative] = [92, 82, 83].map(|number| parameters.get_signed(S(number)).unsigned_abs());
    let allowed = torque.milliamperes(u16::try_from(bipolar.min(positive).min(negative)).unwrap_or(u16::MAX));
    let current = amplitude(parameters.get(S(111)).min(parameters.get(S(109))).min(allowed)).min(peak_current);
    const COMMAND_REVERSED: u32 = 1 << 0;
    let velocity = Velocity::from_ten_thousandths_rpm(parameters.get(P(218)).cast_signed());
    let identification = IdentificationParameters {
        peak_current,
        current,
        ripple: (current / 8).max(peak_current / 256).min(current / 2),
        pole_pairs: u8::try_from(parameters.get(P(110))).unwrap_or(0),
        // Its sign is that of velocity commands.
        velocity: if parameters.get(S(43)) & COMMAND_REVERSED != 0 { -velocity } else { velocity },
        acceleration: Acceleration::from_milliradians_per_second_squared(parameters.get(P(219))),
        movement: Position::from_bits((i64::from(parameters.get(P(229))) << 32) / 100),
        frequency,
    };
    Ok(match procedure {
        Procedure::IdentifyFlux => {
            Plan::Flux(FluxSettings::new(&identification, parameters.get(P(111)), parameters.get(P(112)))?)
        }
        Procedure::IdentifyInertia => {
            Plan::Inertia(InertiaSettings::new(&identification, torque_constant(parameters))?)
        }
        _ => Plan::Winding(ResistanceSettings::new(&identification)?, InductanceSettings::new(&identification)?),
    })
}

/// Takes over what was measured.
///
/// # Errors
/// [`Finding`]; nothing is changed then.
#[cold]
#[inline(never)]
pub(crate) fn take_over(
    outcome: Outcome,
    parameters: &mut Parameters,
    check: impl Fn(&Parameters) -> Result<(), InvalidSetting>,
) -> Result<(), Finding> {
    match outcome? {
        Measurement::Winding(resistance, inductance) => {
            let inductances = inductance.inductances()?;
            let values =
                [(P(111), resistance.resistance()?), (P(112), inductances.direct), (P(113), inductances.quadrature)];
            put(parameters, values, check)
        }
        Measurement::Flux(flux) => put(parameters, [(P(114), amplitude(flux.flux()?.torque_constant))], check),
        Measurement::Inertia(inertia) => {
            let Inertia { inertia, coulomb_friction, viscous_friction } = inertia.inertia()?;
            // Friction never drives: below zero it is noise.
            let resisting = |amplitude: i32| rms(amplitude.max(0).unsigned_abs());
            let scale = TorqueScale::new(parameters).map_err(|invalid| Finding::Refused(invalid.idn))?;
            let coulomb = scale.increments(resisting(coulomb_friction));
            // Of 1000 rpm in uA to uA/rpm.
            let viscous = resisting(viscous_friction).saturating_add(500) / 1_000;
            put(parameters, [(P(221), inertia), (S(155), coulomb), (P(142), viscous)], check)
        }
    }
}

/// Sets all of these or, when one of them is refused, none.
fn put<const N: usize>(
    parameters: &mut Parameters,
    values: [(Idn, u32); N],
    check: impl Fn(&Parameters) -> Result<(), InvalidSetting>,
) -> Result<(), Finding> {
    let before = values.map(|(idn, _)| (idn, parameters.get(idn)));
    let result = values
        .into_iter()
        .try_for_each(|(idn, actual)| {
            let is_set = parameters.set(idn, actual.into()).is_ok();
            // A parameter of two bytes takes the low half of a number that does not fit.
            if is_set && parameters.get(idn) == actual { Ok(()) } else { Err(Finding::Limits { idn, actual }) }
        })
        .and_then(|()| check(parameters).map_err(|invalid| Finding::Refused(invalid.idn)));
    if result.is_err() {
        for (idn, value) in before {
            // It was there before.
            let _ = parameters.set(idn, value.into());
        }
    }
    result
}

/// Kinds of filter, P-0-0170 and P-0-0174.
const LOW_PASS: u32 = 1;
const NOTCH: u32 = 2;

/// The four parameters of a filter of the current command, from its first one on: kind, frequency, width and depth.
fn current_filter(parameters: &Parameters, first: u16) -> [u32; 4] {
    [0, 1, 2, 3].map(|offset| parameters.get(P(first.saturating_add(offset))))
}

/// By how many microseconds a filter of the current command delays what is slow against it.
fn filter_delay(filter: &[u32; 4]) -> u64 {
    // 2 pi in 10^-4.
    const TWO_PI: u64 = 62_832;
    let [_, frequency, width, depth] = filter.map(u64::from);
    match filter[0] {
        // 2 damping / (2 pi f), of 10^-3 and 0.1 Hz.
        LOW_PASS => width.saturating_mul(2 * 10_000 * 10_000).checked_div(frequency.saturating_mul(TWO_PI)),
        // (1 - depth) width / (2 pi f^2), of 10^-4 and 0.1 Hz.
        NOTCH => {
            let taken = 10_000_u64.saturating_sub(depth);
            let square = frequency.saturating_mul(frequency).saturating_mul(TWO_PI);
            taken.saturating_mul(width).saturating_mul(1_000 * 10_000).checked_div(square)
        }
        _ => Some(0),
    }
    .unwrap_or(u64::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn valid(_: &Parameters) -> Result<(), InvalidSetting> {
        Ok(())
    }

    fn gains(parameters: &Parameters) -> [u32; 7] {
        [S(100), S(101), S(104), S(106), S(107), S(348), P(231)].map(|idn| parameters.get(idn))
    }

    #[test]
    fn gains_that_the_loops_cannot_work_with_are_taken_back() {
        let mut parameters = crate::service::rig::parameters();
        parameters.set(P(111), 600).unwrap();
        let before = gains(&parameters);
        let refused = |_: &Parameters| Err(InvalidSetting { idn: S(100), reason: None });
        assert_eq!(compute_gains(&mut parameters, PwmFrequency::Khz16, refused), Err(Finding::Refused(S(100))));
        assert_eq!(gains(&parameters), before);
        compute_gains(&mut parameters, PwmFrequency::Khz16, valid).unwrap();
        assert!(gains(&parameters).iter().zip(before).all(|(&after, before)| after != before), "{before:?}");
    }

    #[test]
    fn an_identification_stays_within_the_torque_limits_or_is_refused() {
        let planned = |changes: &[(u16, u32)]| {
            let mut parameters = crate::service::rig::parameters();
            for &(number, value) in changes {
                parameters.set(S(number), value.into()).unwrap();
            }
            plan(Procedure::IdentifyWinding, &parameters, PwmFrequency::Khz16)
        };
        let whole = planned(&[]).unwrap();
        // A half of S-0-0111, whoever says it.
        let half = planned(&[(111, 1_768), (92, 65_535)]).unwrap();
        for limit in [(92, 500), (82, 500), (83, 65_036)] {
            assert_eq!(planned(&[limit]).unwrap(), half, "{limit:?}");
        }
        assert_ne!(whole, half);
        for limit in [(92, 0), (82, 0), (83, 0)] {
            assert!(matches!(planned(&[limit]), Err(Finding::Settings(_))), "{limit:?}");
        }
    }

    #[test]
    fn a_gain_beyond_its_limits_is_named_and_none_is_changed() {
        let mut parameters = crate::service::rig::parameters();
        // 1 kg m^2 at 1.131 Nm/A and 40 Hz: 222 A s/rad.
        parameters.set(P(221), 10_000_000).unwrap();
        let before = gains(&parameters);
        let finding = compute_gains(&mut parameters, PwmFrequency::Khz16, valid).unwrap_err();
        assert!(matches!(finding, Finding::Limits { idn, actual: 222_000..222_300 } if idn == S(100)), "{finding}");
        assert_eq!(gains(&parameters), before);
    }

    #[test]
    fn an_identification_turns_as_velocity_commands_of_its_sign_would() {
        let of = |polarity: u64, velocity: i32| {
            let mut parameters = crate::service::rig::parameters();
            parameters.set(S(43), polarity).unwrap();
            parameters.set(P(218), velocity.cast_unsigned().into()).unwrap();
            plan(Procedure::IdentifyFlux, &parameters, PwmFrequency::Khz16).unwrap()
        };
        let forwards = std::format!("{:?}", of(0, 3_000_000));
        assert_eq!(std::format!("{:?}", of(7, -3_000_000)), forwards);
        assert_ne!(std::format!("{:?}", of(7, 3_000_000)), forwards);
    }

    #[test]
    fn every_finding_fits_into_the_text_of_the_service_channel() {
        let out_of_range = |parameter, actual, minimum, maximum| {
            Finding::Settings(SettingsError::OutOfRange { parameter, actual, minimum, maximum })
        };
        let findings = [
            // The longest of those that the two rules and the sequences have.
            out_of_range("current loop proportional gain S-0-0106", u32::MAX, 1, 500_000),
            out_of_range("current loop integral action time S-0-0107", u32::MAX, 63, 6_553_500),
            out_of_range("velocity loop proportional gain S-0-0100", u32::MAX, 1, 6_553_500),
            out_of_range("ramp of the identification in loop ticks", u32::MAX, 0, 240_000),
            out_of_range("movement of the identification in revolutions", 1 << 20, 0, 1 << 20),
            Finding::Settings(SettingsError::Zero { parameter: "resistance of the winding" }),
            Finding::Limits { idn: P(4_095), actual: u32::MAX },
            Finding::Refused(P(4_095)),
            Finding::Interrupted,
            IdentificationError::OutOfRange { actual: i64::MIN, minimum: 10, maximum: 1_000_000_000 }.into(),
            IdentificationError::CurrentNotReached { actual: i32::MIN, expected: i32::MIN }.into(),
            IdentificationError::NoMovement.into(),
            IdentificationError::VoltageLimit.into(),
            IdentificationError::Unstable.into(),
            IdentificationError::TooMuchMovement { actual: i64::MIN, maximum: i64::MAX }.into(),
        ];
        for finding in findings {
            let text = std::string::ToString::to_string(&finding);
            assert!((10..=sercos::capacity::LIVE_TEXT_BYTES).contains(&text.len()), "{text}: {}", text.len());
        }
    }

    /// The data of a precise axis: 1 Ohm, 5 mH, 1.2 Nm per ampere of amplitude, 0.0024 kg m², 20 A of amplitude.
    fn precise(increments: u32, bandwidth: u32) -> Parameters {
        let mut parameters = crate::service::rig::parameters();
        for (number, value) in
            [(111, 1_000), (112, 5_000), (113, 5_000), (114, 1_697_056), (221, 24_000), (223, bandwidth)]
        {
            parameters.set(P(number), value.into()).unwrap();
        }
        for (number, value) in [(116, increments / 4), (109, 14_142)] {
            parameters.set(S(number), value.into()).unwrap();
        }
        parameters
    }

    #[test]
    fn an_axis_with_a_fine_encoder_gets_300_hertz_and_no_filter() {
        let mut parameters = precise(1 << 20, 300);
        compute_gains(&mut parameters, PwmFrequency::Khz16, valid).unwrap();
        // 2 pi 300 Hz * 0.0024 kg m² / 1.697 Nm/A.
        assert_eq!(parameters.get(S(100)), 2_666);
        assert_eq!([S(392), P(174)].map(|idn| parameters.get(idn)), [0, 0]);
        // 146 us of the current loop and 125 of its own: 1 / (12 * 271 us) is 307 Hz.
        compute_gains(&mut precise(1 << 20, 307), PwmFrequency::Khz16, valid).unwrap();
        let refused = compute_gains(&mut precise(1 << 20, 308), PwmFrequency::Khz16, valid).unwrap_err();
        assert!(matches!(refused, Finding::Settings(SettingsError::OutOfRange { maximum: 307, .. })), "{refused}");
        // With a velocity loop every 125 us it was less.
        let refused = compute_gains(&mut precise(1 << 20, 300), PwmFrequency::Khz8, valid).unwrap_err();
        assert!(matches!(refused, Finding::Settings(SettingsError::OutOfRange { .. })), "{refused}");
    }

    #[test]
    fn against_a_coarse_encoder_there_is_as_much_filter_as_the_bandwidth_leaves() {
        // Small times: 146 us of the current loop; velocity filter 500 us and 157, or none and 125; low-pass 45 / bandwidth.
        for (bandwidth, filter, low_pass) in [(40, 500, 1), (60, 0, 1), (140, 0, 1), (142, 0, 0), (300, 0, 0)] {
            let mut parameters = precise(65_536, bandwidth);
            compute_gains(&mut parameters, PwmFrequency::Khz16, valid).unwrap();
            assert_eq!([S(392), P(174)].map(|idn| parameters.get(idn)), [filter, low_pass], "{bandwidth} Hz");
        }
        // A notch stays, and counts.
        let mut parameters = precise(65_536, 40);
        parameters.set(P(174), 2).unwrap();
        compute_gains(&mut parameters, PwmFrequency::Khz16, valid).unwrap();
        assert_eq!([S(392), P(174)].map(|idn| parameters.get(idn)), [500, 2]);
    }

    #[test]
    fn a_filter_of_the_current_command_makes_the_velocity_loop_slower() {
        let mut parameters = crate::service::rig::parameters();
        assert_eq!(filter_delay(&current_filter(&parameters, 170)), 0);
        parameters.set(P(170), 1).unwrap();
        // 2 * 0.707 / (2 pi 800 Hz).
        assert_eq!(filter_delay(&current_filter(&parameters, 170)), 281);
        parameters.set(P(170), 2).unwrap();
        parameters.set(P(172), 2_000).unwrap();
        parameters.set(P(173), 5_000).unwrap();
        // Half of 200 Hz / (2 pi 800^2).
        assert_eq!(filter_delay(&current_filter(&parameters, 170)), 24);
    }
}
