//! What a commissioning engineer writes into a drive for an axis: motor and loops.

use plant::ReferenceAxis;
use ring::ident::{Idn, Value};

/// Crossing of the current loop in rad/s: 1 100 Hz, which leaves 65 degrees of phase at 16 kHz.
const CURRENT_CROSSING: f64 = 6_912.0;

/// The parameters of an axis, each with its IDN, to be written in CP2.
#[must_use]
pub fn parameters_of(axis: &ReferenceAxis) -> Vec<(Idn, Value)> {
    let gains = &axis.gains;
    let windings = &axis.machine.windings;
    let mechanics = &axis.machine.mechanics;
    let inertia = mechanics.rotor_inertia + mechanics.load.map_or(0.0, |load| load.inertia);
    let word = |value: f64| Value::Word(value.round() as u16);
    let long = |value: f64| Value::Long(value.round() as u32);
    // Currents of the data blocks are RMS values.
    let rms = |amplitude: f64| amplitude * core::f64::consts::FRAC_1_SQRT_2;
    let current = |milliamperes: u32| long(rms(milliamperes.into()));
    vec![
        (Idn(100), word(rms(f64::from(gains.velocity_gain) * 100.0))),
        (Idn(101), Value::Word(gains.integral_time)),
        (Idn(104), Value::Word(gains.position_gain)),
        (Idn(106), word(CURRENT_CROSSING * windings.inductance_q * 1_000.0)),
        (Idn(107), word(windings.inductance_q / windings.resistance * 10_000.0)),
        (Idn(109), current(axis.peak_current)),
        (Idn(111), current(axis.standstill_current)),
        (Idn(113), Value::Long((axis.maximum_speed * 10_000).min(countable(&axis.machine.encoder)))),
        (Idn(116), Value::Long(axis.machine.encoder.increments_per_revolution / 4)),
        (Idn(138), Value::Long(gains.acceleration_limit)),
        (Idn(392), Value::Word(gains.velocity_filter)),
        (product(110), Value::Word(windings.pole_pairs as u16)),
        (product(111), long(windings.resistance * 1_000.0)),
        (product(112), long(windings.inductance_d * 1e6)),
        (product(113), long(windings.inductance_q * 1e6)),
        (product(114), long(axis.machine.torque_constant() * core::f64::consts::SQRT_2 * 1e6)),
        (product(120), Value::Word(u16::from(axis.machine.brake.is_some()))),
        // kg m2 in 0.001 kg cm2.
        (product(221), long(inertia * 1e7)),
    ]
}

/// What is written besides once the axis has been commissioned: the friction that P-0-0226 has found, and P-0-0220.
#[must_use]
pub fn commissioned(axis: &ReferenceAxis) -> Vec<(Idn, Value)> {
    let mechanics = &axis.machine.mechanics;
    let per_ampere = axis.machine.torque_constant() * core::f64::consts::SQRT_2;
    let rated = axis.machine.torque_constant() * f64::from(axis.standstill_current) / 1_000.0;
    // 250 rad/s, as the gains of the press.
    let bandwidth = 40;
    vec![
        (product(223), Value::Word(bandwidth)),
        // 0.1 % of the torque at S-0-0111.
        (Idn(155), Value::Word((mechanics.coulomb_friction / rated * 1_000.0).round() as u16)),
        // uA/rpm.
        (
            product(142),
            Value::Word((mechanics.viscous_friction / per_ampere * core::f64::consts::TAU / 60.0 * 1e6).round() as u16),
        ),
        (product(220), Value::Word(3)),
        (product(220), Value::Word(0)),
    ]
}

/// The speed in 10^-4 rpm that the board's inputs count: a little less than each track keeping its level, two increments, for nine samples of 84 MHz.
fn countable(encoder: &plant::Encoder) -> u32 {
    let rate = 18.6e6;
    // Overspeed is a quarter above S-0-0113.
    (rate / 1.25 / f64::from(encoder.increments_per_revolution) * 60.0 * 1e4) as u32 - 20_000
}

/// P-0-nnnn.
#[must_use]
pub const fn product(number: u16) -> Idn {
    Idn(0x8000 | number)
}
