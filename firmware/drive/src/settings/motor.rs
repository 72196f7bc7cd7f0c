//! Settings of the motor side: current loop, commutation, brake, supervision.

use sercos::Idn;
use sercos::parameters::Parameters;
use servo::SettingsError;
use servo::arithmetic::Gain;
use servo::axis::{CommandedTorqueLimits, TorqueLimitParameters, TorqueLimitSettings};
use servo::brake::{BrakeParameters, BrakeSettings};
use servo::commutation::{AlignmentSettings, CommutationSettings};
use servo::current::{
    CurrentLoopParameters, CurrentLoopSettings, FieldWeakeningParameters, FieldWeakeningSettings, MotorModel,
    Protection,
};
use servo::encoder::{EncoderMonitorParameters, EncoderMonitorSettings};
use servo::monitor::{
    ChopperParameters, ChopperSettings, GeneratingParameters, GeneratingSettings, LoadParameters, LoadSettings,
    TemperatureParameters, TemperatureSettings, VoltageParameters, VoltageSettings,
};
use servo::motor::{CurrentSettings, Facts, MotorSettings};
use servo::units::{CurrentFraction, Position, Velocity};

use super::current::{amplitude, flux_linkage};
use super::invalid::InvalidSetting;

const S: fn(u16) -> Idn = Idn::standard;
const P: fn(u16) -> Idn = Idn::product;

/// Scales the parameters. Divides.
///
/// # Errors
/// The first parameter that the motor side cannot work with.
pub(super) fn settings(
    parameters: &Parameters,
    facts: &Facts,
    limits: &CommandedTorqueLimits,
    increments: u32,
    maximum_velocity: Velocity,
) -> Result<MotorSettings, InvalidSetting> {
    let long = |idn: Idn| parameters.get(idn);
    let word = |idn: Idn| parameters.get_word(idn);
    // In amplitudes, as the measuring range.
    let peak = amplitude(long(S(110)));
    let flux = flux_linkage(parameters);
    let range = long(P(100));
    let full_scale = word(P(101));
    let of = |idn: Idn| move |reason: SettingsError| InvalidSetting { idn, reason: Some(reason) };
    let commutation = |idn: Idn| move |_| InvalidSetting { idn, reason: None };

    let current_loop = CurrentLoopSettings::new(&CurrentLoopParameters {
        peak_current: peak,
        measuring_range: range,
        proportional_gain: word(S(106)).into(),
        integral_time: u32::from(word(S(107))).saturating_mul(100),
        frequency: facts.frequency,
        dead_time: if word(P(103)) == 0 { 0 } else { facts.dead_time },
        dead_time_band: u32::from(word(P(103))).max(1),
    })
    .map_err(|reason| InvalidSetting { idn: blamed(&reason), reason: Some(reason) })?;
    // What the motor and the amplifier bear both.
    let most = long(S(109)).min(long(S(110)));
    let weakening_current = most.saturating_mul(word(P(107)).into()) / 1_000;
    let trip = trip_of(most, range).min(amplitude(long(P(106))));
    let of_most = |per_mille: u16| share(most.saturating_mul(per_mille.into()) / 1_000, long(S(110)));
    let highest_bus = u32::from(word(P(105))).saturating_mul(4_096).checked_div(full_scale.into()).unwrap_or(0);
    // One and a half times the highest speed, in a cycle, and two increments that a standing encoder may swing.
    let turned = u64::from(maximum_velocity.abs().to_bits().unsigned_abs()).saturating_mul(increments.into());
    let per_cycle = (turned >> 36).saturating_mul(3) / 4;
    let increments_per_cycle = u32::try_from(per_cycle).unwrap_or(u32::MAX).saturating_add(3);
    let highest_bus = u16::try_from(highest_bus.min(4_095)).unwrap_or(4_095);
    let protection = Protection::new(trip, range, highest_bus, increments_per_cycle).map_err(of(P(100)))?;

    // Overspeed is found a quarter above it.
    check_encoder_rate(long(S(113)).saturating_add(long(S(113)) / 4), increments, facts.encoder_rate)
        .map_err(of(S(113)))?;
    check_chopper(word(P(235)), word(P(234))).map_err(of(P(235)))?;
    if word(P(107)) != 0 {
        check_induced_voltage(parameters, flux).map_err(of(S(113)))?;
    }

    let pole_pairs = word(P(110));
    let commutation_settings =
        CommutationSettings::new(u8::try_from(pole_pairs).unwrap_or(0), increments).map_err(commutation(P(110)))?;
    let angle = (u64::from(pole_pairs) << 32).saturating_add(u64::from(increments) / 2);
    let motor_sensor = facts.thermometers.motor(word(P(134))).ok_or(InvalidSetting { idn: P(134), reason: None })?;
    let temperature = |sensor, warning: u16, shutdown: u16| {
        TemperatureSettings::new(&TemperatureParameters {
            sensor,
            warning: word(S(warning)),
            shutdown: word(S(shutdown)),
            filter: 2_000,
            debounce: 200,
        })
        .map_err(|reason| {
            let idn = S(if matches!(reason, SettingsError::BeyondSensor { .. }) { shutdown } else { warning });
            InvalidSetting { idn, reason: Some(reason) }
        })
    };
    let load = |continuous: u16, peak_current: u16, time: u16, limit: u16| {
        LoadSettings::new(&LoadParameters {
            continuous_current: long(S(continuous)),
            peak_current: long(S(peak_current)),
            amplifier_peak_current: long(S(110)),
            time_constant: long(P(time)),
            warning_level: WARNING_LEVEL,
            shutdown_level: limit.max(WARNING_LEVEL.saturating_add(1)),
        })
        .map_err(of(P(time)))
    };
    let brake_bits = word(P(120));
    if brake_bits & BRAKE_FITTED != 0 {
        check_proof(most.saturating_mul(word(P(121)).into()) / 1_000, range).map_err(of(P(121)))?;
    }
    let millidegrees = |idn: Idn| Position::from_bits((i64::from(word(idn)) << 32) / 36_000);
    Ok(MotorSettings {
        current: CurrentSettings { current_loop, protection },
        model: MotorModel::new(long(P(112)), long(P(113)), flux, peak).map_err(of(P(114)))?,
        commutation: commutation_settings,
        // Whole electrical revolutions are cut on purpose.
        angle_per_increment: angle.checked_div(u64::from(increments)).unwrap_or(0) as u32,
        pole_pairs: pole_pairs.into(),
        alignment: AlignmentSettings::new(commutation_settings, of_most(word(P(116)))).map_err(commutation(P(116)))?,
        index_angle: index_angle(parameters),
        voltage: VoltageSettings::new(&VoltageParameters {
            full_scale,
            filter: 500,
            undervoltage: word(P(104)),
            overvoltage: word(P(105)),
            power_on: word(P(104)).saturating_add(word(P(104)) / 8).max(1),
            // A sixteenth above: with the mains gone and the contactor closed, a stop needs what lies between.
            power_off: word(P(104)).saturating_add(word(P(104)) / 16),
            undervoltage_time: 2,
            overvoltage_ticks: 1,
        })
        .map_err(of(P(105)))?,
        chopper: ChopperSettings::new(&ChopperParameters {
            full_scale,
            overvoltage: word(P(105)),
            resistance: u32::from(word(P(235))).saturating_mul(100),
            continuous_power: long(P(236)),
            time_constant: long(P(237)),
            frequency: facts.frequency,
        })
        .map_err(of(P(235)))?,
        generating: GeneratingSettings::new(&GeneratingParameters {
            full_scale,
            overvoltage: word(P(105)),
            resistance: long(P(111)),
            continuous_current: amplitude(long(S(111))),
            peak_current: peak,
            holds_a_load: brake_bits & BRAKE_FITTED != 0,
        })
        .map_err(of(P(105)))?,
        heat_sink: temperature(facts.thermometers.heat_sink(), 200, 203)?,
        winding: temperature(motor_sensor, 201, 204)?,
        motor_load: load(111, 109, 130, word(S(114)))?,
        amplifier_load: load(112, 110, 131, AMPLIFIER_LIMIT)?,
        encoder: EncoderMonitorSettings::new(&EncoderMonitorParameters {
            increments_per_revolution: increments,
            maximum_velocity,
            pole_pairs: pole_pairs.into(),
            flux,
            dead_time_compensated: word(P(103)) != 0,
            index_width: (word(P(117)) != 0).then_some(1),
        })
        .map_err(of(S(116)))?,
        brake: BrakeSettings::new(&BrakeParameters {
            fitted: brake_bits & BRAKE_FITTED != 0,
            contact_fitted: brake_bits & BRAKE_CONTACT != 0,
            drive_on_delay: word(S(206)),
            drive_off_delay: word(S(207)),
            maximum_drive_off_delay: word(S(273)),
            proof_current: of_most(word(P(121))),
            proof_tolerance: of_most(word(P(121)) / 2),
            proof_time: 2,
            proof_limit: 100,
            hold_test_time: word(P(123)),
            hold_window: millidegrees(P(122)),
            stuck_time: 500,
        })
        .map_err(of(P(121)))?,
        has_brake: brake_bits & BRAKE_FITTED != 0,
        aligns_with_open_brake: brake_bits & BRAKE_MAY_OPEN != 0,
        torque_limits: TorqueLimitSettings::new(&TorqueLimitParameters {
            commanded: *limits,
            motor_peak: long(S(109)),
            amplifier_peak: long(S(110)),
        })
        .map_err(of(S(110)))?,
        weakening: FieldWeakeningSettings::new(&FieldWeakeningParameters {
            limit: u64::from(weakening_current)
                .saturating_mul(10_000)
                .checked_div(long(S(110)).into())
                .and_then(|limit| u16::try_from(limit).ok())
                .unwrap_or(u16::MAX),
            voltage: 9_300,
            integral_time: 100,
        })
        .map_err(of(P(107)))?,
        // 2 048 counts are the range, 2^15 is the peak.
        phase_current: Gain::from_ratio(u128::from(range).saturating_mul(2), peak.into())
            .ok_or(InvalidSetting { idn: P(100), reason: None })?,
        bus_millivolts: Gain::from_ratio(u128::from(full_scale).saturating_mul(1_000), 4_096)
            .ok_or(InvalidSetting { idn: P(101), reason: None })?,
    })
}

/// Whether the board counts so many increments of a revolution at `speed`, in 10^-4 rpm.
fn check_encoder_rate(speed: u32, increments: u32, maximum: u32) -> Result<(), SettingsError> {
    const MINUTE: u64 = 60 * 10_000;
    let rate = u64::from(speed).saturating_mul(increments.into()).div_ceil(MINUTE);
    let actual = u32::try_from(rate).unwrap_or(u32::MAX);
    if actual <= maximum { Ok(()) } else { Err(SettingsError::EncoderRate { actual, maximum }) }
}

/// Whether the switch of the chopper bears this resistor, both in 0.1 Ohm; 0: there is no resistor, or no switch.
fn check_chopper(resistance: u16, least: u16) -> Result<(), SettingsError> {
    if resistance == 0 || least != 0 && resistance >= least {
        return Ok(());
    }
    let (parameter, minimum, maximum) = match least {
        0 => ("brake resistor of a drive without a chopper", 0, 0),
        _ => ("brake resistor in 0.1 Ohm", least.into(), u16::MAX.into()),
    };
    Err(SettingsError::OutOfRange { parameter, actual: resistance.into(), minimum, maximum })
}

/// Whether the DC link bears what the magnets induce at S-0-0113: `flux` in uVs a phase, peak value.
fn check_induced_voltage(parameters: &Parameters, flux: u32) -> Result<(), SettingsError> {
    /// sqrt(3) * 2 pi / 60, in 10^-9: from flux times pole pairs times rpm to the peak voltage between two phases.
    const LINE_VOLTAGE: u128 = 181_379_936;
    // uVs * 10^-4 rpm * 10^-9.
    const ONE: u128 = 1_000_000 * 10_000 * 1_000_000_000;
    let speed = u128::from(parameters.get(S(113)));
    let turning = u128::from(flux).saturating_mul(parameters.get_word(P(110)).into()).saturating_mul(speed);
    let actual = u32::try_from(turning.saturating_mul(LINE_VOLTAGE).div_ceil(ONE)).unwrap_or(u32::MAX);
    let maximum = parameters.get_word(P(239)).into();
    if actual <= maximum { Ok(()) } else { Err(SettingsError::InducedVoltage { actual, maximum }) }
}

const BRAKE_FITTED: u16 = 1 << 0;
const BRAKE_CONTACT: u16 = 1 << 1;
const BRAKE_MAY_OPEN: u16 = 1 << 2;

/// Load from which the thermal models warn and limit, in 0.1 %.
const WARNING_LEVEL: u16 = 900;

/// Load at which that of the amplifier shuts down, in 0.1 %: S-0-0114 is the motor's.
const AMPLIFIER_LIMIT: u16 = 1_100;

/// A current as a share of the peak current, both RMS.
fn share(current: u32, peak: u32) -> CurrentFraction {
    let bits = (u64::from(current) << 15).checked_div(peak.into()).unwrap_or(0);
    CurrentFraction::from_bits(i16::try_from(bits).unwrap_or(i16::MAX))
}

/// Amplitude at which the bridge is switched off, unless the amplifier's own trip P-0-0106 is lower: 125 % of the longest vector, and a fiftieth of the
/// measuring range above it at least, that noise and ripple of the sensors trip nothing. The vector has S-0-0109 for the torque and 90 % of it, the
/// most of P-0-0107, across.
fn trip_of(most: u32, range: u32) -> u32 {
    // sqrt(1 + 0.9^2).
    const PER_MILLE: u64 = 1_346;
    let vector = u64::from(most).saturating_mul(PER_MILLE) / 1_000;
    let longest = amplitude(u32::try_from(vector).unwrap_or(u32::MAX));
    longest.saturating_add((longest / 4).max(range / 50))
}

/// Smallest test current of the torque proof in counts of the converter: half of it is the tolerance, and a zero may be wrong by four.
const LEAST_PROOF_COUNTS: u32 = 16;

/// Whether a current that does not flow can be told from one that does.
fn check_proof(current: u32, range: u32) -> Result<(), SettingsError> {
    let counts = u64::from(amplitude(current)).saturating_mul(2_048).checked_div(range.into()).unwrap_or(0);
    let actual = u32::try_from(counts).unwrap_or(u32::MAX);
    if actual >= LEAST_PROOF_COUNTS {
        return Ok(());
    }
    let parameter = "test current P-0-0121 in counts of the converter";
    Err(SettingsError::OutOfRange { parameter, actual, minimum: LEAST_PROOF_COUNTS, maximum: 2_047 })
}

/// P-0-0115 in 0.01 degree; -1: not known.
fn index_angle(parameters: &Parameters) -> Option<u32> {
    let hundredths = u64::try_from(parameters.get_signed(P(115))).ok()?;
    // Up to 36 000: a revolution.
    Some(((hundredths << 32) / 36_000) as u32)
}

/// The data block that a complaint of the current loop is about.
const fn blamed(reason: &SettingsError) -> Idn {
    match reason {
        SettingsError::CurrentGain { .. } => Idn::standard(106),
        SettingsError::MeasuringRange { .. } => Idn::product(100),
        SettingsError::DeadTime { .. } => Idn::product(103),
        _ => Idn::standard(110),
    }
}
