//! A motor for the tests of this folder: that of the drive's default parameters.

use super::facts::{BoardKind, Facts};
use super::settings::{CurrentSettings, MotorSettings};
use crate::arithmetic::gain::Gain;
use crate::axis::limits::{CommandedTorqueLimits, TorqueLimitParameters, TorqueLimitSettings};
use crate::brake::settings::{BrakeParameters, BrakeSettings};
use crate::commutation::CommutationSettings;
use crate::commutation::alignment::AlignmentSettings;
use crate::current::command::MotorModel;
use crate::current::protection::Protection;
use crate::current::sensing::CurrentSensing;
use crate::current::settings::{CurrentLoopParameters, CurrentLoopSettings, PwmFrequency};
use crate::current::weakening::{FieldWeakeningParameters, FieldWeakeningSettings};
use crate::encoder::monitor::{EncoderMonitorParameters, EncoderMonitorSettings};
use crate::monitor::bus_voltage::{VoltageParameters, VoltageSettings};
use crate::monitor::chopper::{ChopperParameters, ChopperSettings};
use crate::monitor::generating::{GeneratingParameters, GeneratingSettings};
use crate::monitor::load::{LoadParameters, LoadSettings};
use crate::monitor::temperature::{TemperatureParameters, TemperatureSettings};
use crate::monitor::thermometer::{Divider, TemperatureSensor, Thermometers};
use crate::units::{CurrentFraction, Position, Velocity};

/// A board of 16 kHz.
#[derive(Debug)]
pub(crate) struct Example;

impl BoardKind for Example {
    const FACTS: Facts = Facts {
        frequency: PwmFrequency::Khz16,
        dead_time: 1_000,
        current_sensing: CurrentSensing::InLine,
        loop_timer_counts: 10_500,
        sample_to_count: 2_200,
        encoder_rate: 18_600_000,
        thermometers: &Thermometers::new(TemperatureSensor::Ntc5k, &DIVIDER, &DIVIDER),
    };
}

/// Of both temperature inputs.
const DIVIDER: Divider = Divider { pull_up: 2_200, supply: 3_300, reference: 3_300 };

/// Of the encoder in a revolution.
pub(crate) const INCREMENTS: u32 = 10_000;

/// 20 A peak, 4 pole pairs, no brake.
pub(crate) fn settings() -> MotorSettings {
    let Facts { frequency, dead_time, thermometers, .. } = Example::FACTS;
    let fastest = Velocity::from_ten_thousandths_rpm(60_000_000);
    let commutation = CommutationSettings::new(4, INCREMENTS).unwrap();
    let temperature = TemperatureSettings::new(&TemperatureParameters {
        sensor: thermometers.heat_sink(),
        warning: 800,
        shutdown: 900,
        filter: 2_000,
        debounce: 200,
    })
    .unwrap();
    let load = LoadSettings::new(&LoadParameters {
        continuous_current: 10_000,
        peak_current: 20_000,
        amplifier_peak_current: 20_000,
        time_constant: 10_000,
        warning_level: 900,
        shutdown_level: 1_100,
    })
    .unwrap();
    let current_loop = CurrentLoopSettings::new(&CurrentLoopParameters {
        peak_current: 20_000,
        measuring_range: 25_000,
        proportional_gain: 40_000,
        integral_time: 500,
        frequency,
        dead_time,
        dead_time_band: 200,
    });
    MotorSettings {
        current: CurrentSettings {
            current_loop: current_loop.unwrap(),
            protection: Protection::new(25_000, 25_000, 3_600, 100).unwrap(),
        },
        model: MotorModel::new(6_000, 6_000, 133_333, 20_000).unwrap(),
        commutation,
        angle_per_increment: ((4_u64 << 32) as f64 / f64::from(INCREMENTS)).round() as u32,
        pole_pairs: 4,
        alignment: AlignmentSettings::new(commutation, CurrentFraction::from_num(0.5)).unwrap(),
        index_angle: None,
        voltage: VoltageSettings::new(&VoltageParameters {
            full_scale: 1_000,
            filter: 500,
            undervoltage: 300,
            overvoltage: 800,
            power_on: 340,
            power_off: 320,
            undervoltage_time: 2,
            overvoltage_ticks: 1,
        })
        .unwrap(),
        chopper: ChopperSettings::new(&ChopperParameters {
            full_scale: 1_000,
            overvoltage: 800,
            resistance: 22_000,
            continuous_power: 1_000,
            time_constant: 10_000,
            frequency,
        })
        .unwrap(),
        generating: GeneratingSettings::new(&GeneratingParameters {
            full_scale: 1_000,
            overvoltage: 800,
            resistance: 1_200,
            continuous_current: 5_000,
            peak_current: 20_000,
            holds_a_load: false,
        })
        .unwrap(),
        heat_sink: temperature,
        winding: temperature,
        motor_load: load,
        amplifier_load: load,
        encoder: EncoderMonitorSettings::new(&EncoderMonitorParameters {
            increments_per_revolution: INCREMENTS,
            maximum_velocity: fastest,
            pole_pairs: 4,
            flux: 133_333,
            dead_time_compensated: true,
            index_width: None,
        })
        .unwrap(),
        brake: BrakeSettings::new(&BrakeParameters {
            fitted: false,
            contact_fitted: false,
            drive_on_delay: 50,
            drive_off_delay: 50,
            maximum_drive_off_delay: 1_000,
            proof_current: CurrentFraction::from_num(0.1),
            proof_tolerance: CurrentFraction::from_num(0.05),
            proof_time: 2,
            proof_limit: 100,
            hold_test_time: 100,
            hold_window: Position::from_bits(1 << 24),
            stuck_time: 500,
        })
        .unwrap(),
        has_brake: false,
        aligns_with_open_brake: false,
        torque_limits: TorqueLimitSettings::new(&TorqueLimitParameters {
            commanded: CommandedTorqueLimits {
                positive: CurrentFraction::MAX,
                negative: CurrentFraction::MAX,
                bipolar: CurrentFraction::MAX,
                reversed: false,
            },
            motor_peak: 20_000,
            amplifier_peak: 20_000,
        })
        .unwrap(),
        weakening: FieldWeakeningSettings::new(&FieldWeakeningParameters {
            limit: 0,
            voltage: 9_300,
            integral_time: 100,
        })
        .unwrap(),
        phase_current: Gain::from_ratio(50_000, 20_000).unwrap(),
        bus_millivolts: Gain::from_ratio(1_000_000, 4_096).unwrap(),
    }
}
