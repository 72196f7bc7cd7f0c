//! The sequence on an axis in f64: what the sums say is what the axis is.

extern crate std;

use super::*;
use crate::current::readings::CurrentReadings;
use crate::current::settings::PwmFrequency;
use crate::units::Acceleration;
use core::f64::consts::{PI, TAU};

const TICK: f64 = 125e-6;

fn parameters() -> IdentificationParameters {
    IdentificationParameters {
        peak_current: 10_000,
        current: 3_000,
        ripple: 500,
        pole_pairs: 4,
        velocity: Velocity::from_ten_thousandths_rpm(750_000),
        acceleration: Acceleration::from_milliradians_per_second_squared(100_000),
        movement: Position::from_bits(3 << 32),
        frequency: PwmFrequency::Khz16,
    }
}

/// `acceleration` in revolutions/s^2 at peak, that begins half a tick after the order; a proportional velocity loop; steps of an encoder.
struct Axis {
    sequence: ExcitationIdentification,
    acceleration: f64,
    gain: f64,
    friction: f64,
    increments: f64,
    velocity: f64,
    angle: f64,
    last: f64,
    commanded: Commanded,
    current: f64,
}

impl Axis {
    fn new(settings: ExcitationSettings) -> Self {
        Self {
            sequence: ExcitationIdentification::start(settings, Position::ZERO),
            acceleration: 200.0,
            gain: 0.3,
            friction: 0.0,
            increments: 4_294_967_296.0,
            velocity: 0.0,
            angle: 0.0,
            last: 0.0,
            commanded: Commanded::NONE,
            current: 0.0,
        }
    }

    fn half(&mut self) {
        let step = 0.5 * TICK;
        let accelerated = self.acceleration * (self.current - self.friction * self.velocity.signum());
        self.angle += step * (self.velocity + 0.5 * step * accelerated);
        self.velocity += step * accelerated;
    }

    fn tick(&mut self) -> IdentificationState<ExcitationMeasurement> {
        let seen = (self.angle * self.increments).floor() / self.increments;
        let inputs = IdentificationInputs {
            readings: CurrentReadings::default(),
            longest_voltage: 1 << 20,
            position: Position::from_bits((seen * 4_294_967_296.0) as i64),
        };
        let output = self.sequence.tick(&inputs, &self.commanded);
        let command = f64::from(output.request.velocity.to_bits()) / 68_719_476_736.0 / TICK;
        let own = self.gain * (command - (seen - self.last) / TICK);
        self.last = seen;
        let own = CurrentFraction::from_num(own.clamp(-0.9, 0.9));
        self.commanded = Commanded { own, total: own + output.request.current, is_limited: false };
        self.half();
        self.current = self.commanded.total.to_num();
        self.half();
        output.state
    }

    fn result(&mut self) -> Result<ExcitationMeasurement, IdentificationError> {
        for _ in 0..40_000 {
            match self.tick() {
                IdentificationState::Running { .. } => {}
                IdentificationState::Done(measurement) => return Ok(measurement),
                IdentificationState::Failed(error) => return Err(error),
            }
        }
        panic!("the sequence does not end");
    }
}

fn settings(hertz: f64, amplitude: f64) -> ExcitationSettings {
    let frequency = ExcitationFrequency::near((hertz * 100.0) as u32, 8);
    ExcitationSettings::new(&parameters(), frequency, CurrentFraction::from_num(amplitude), None).unwrap()
}

/// Of the axis above in f64: the order acts half a tick after the tick, for a tick, on a double integrator of which the difference of two
/// samples is taken: in z it is `a T^2 / 8 (1 + 6 z^-1 + z^-2) / (1 - z^-1)`, late by nothing else.
fn ideal(hertz: f64, acceleration: f64) -> (f64, f64) {
    let p = TAU * hertz * TICK;
    let (x, y) = (1.0 + 6.0 * p.cos() + (2.0 * p).cos(), -6.0 * p.sin() - (2.0 * p).sin());
    let (c, d) = (1.0 - p.cos(), p.sin());
    let gain = acceleration * TICK * TICK / 8.0;
    // In 2^-10 revolution a tick, and one tick later: what was ordered in a tick moves the next one.
    let square = c * c + d * d;
    let (real, imaginary) = ((x * c + y * d) / square, (y * c - x * d) / square);
    let phase = imaginary.atan2(real) - p;
    (gain * real.hypot(imaginary) * 1_024.0, phase.to_degrees())
}

#[track_caller]
fn assert_near(response: Response, (gain, phase): (f64, f64), decibels: f64, degrees: f64) {
    let measured = f64::from(response.hundredths_of_decibel()) / 100.0;
    assert!((measured - 20.0 * gain.log10()).abs() < decibels, "{measured} dB, not {}", 20.0 * gain.log10());
    let measured = f64::from(response.hundredths_of_degree()) / 100.0;
    let off = (measured - phase + 180.0).rem_euclid(360.0) - 180.0;
    assert!(off.abs() < degrees, "{measured} degrees, not {phase}");
}

#[test]
fn the_axis_is_measured_right_however_much_the_loop_takes_back() {
    for hertz in [12.0, 60.0, 300.0, 1_500.0] {
        for gain in [0.1, 0.3, 1.0] {
            let settings = settings(hertz, 0.05);
            let mut axis = Axis { gain, ..Axis::new(settings) };
            let measured = axis.result().unwrap();
            let hertz = f64::from(measured.frequency().hundredths()) / 100.0;
            assert_near(measured.axis().unwrap(), ideal(hertz, 200.0), 0.2, 1.5);
            // The open loop is the axis behind the gain of the loop, in revolutions per second.
            let (axis, phase) = ideal(hertz, 200.0);
            assert_near(measured.open_loop().unwrap(), (axis * gain / TICK / 1_024.0, phase), 0.3, 2.0);
        }
    }
}

#[test]
fn friction_and_the_steps_of_an_encoder_hardly_bend_the_answer() {
    for hertz in [12.0, 60.0, 300.0] {
        let mut axis = Axis { friction: 0.05, increments: 10_000.0, ..Axis::new(settings(hertz, 0.15)) };
        let measured = axis.result().unwrap();
        let hertz = f64::from(measured.frequency().hundredths()) / 100.0;
        assert_near(measured.axis().unwrap(), ideal(hertz, 200.0), 1.0, 6.0);
    }
}

#[test]
fn the_sums_are_those_of_the_same_sums_in_f64() {
    let settings = settings(60.0, 0.05);
    let mut axis = Axis::new(settings);
    let (mut movements, mut totals) = (std::vec::Vec::new(), std::vec::Vec::new());
    let measured = loop {
        let before = axis.last;
        let state = axis.tick();
        movements.push((axis.last - before) * 1_024.0);
        totals.push(axis.commanded.total.to_num::<f64>());
        if let IdentificationState::Done(measurement) = state {
            break measurement;
        }
    };
    let (ramp, ticks) = (settings.ramp() as usize, settings.frequency.ticks() as usize);
    let begin = ramp + SETTLING as usize;
    let sum = |values: &[f64]| {
        let turn = TAU * f64::from(settings.frequency.periods) / ticks as f64;
        let part = |n: usize, value: f64, quarter: f64| value * (turn * n as f64 + quarter).cos();
        let values = values[begin..begin + ticks].iter().enumerate();
        let sums = values.map(|(n, &value)| (part(n, value, 0.0), part(n, value, PI / 2.0)));
        sums.fold((0.0, 0.0), |(x, y), (a, b)| (x + a, y + b))
    };
    let ((a, b), (c, d)) = (sum(&movements), sum(&totals));
    let phase = (b.atan2(a) - d.atan2(c)).to_degrees();
    assert_near(measured.axis().unwrap(), (a.hypot(b) / c.hypot(d), phase), 0.02, 0.1);
}

#[test]
fn an_axis_that_stands_or_runs_ahead_and_a_current_at_its_limit_are_no_measurement() {
    let mut stuck = Axis { acceleration: 0.0, ..Axis::new(settings(60.0, 0.05)) };
    assert_eq!(stuck.result(), Err(IdentificationError::NoMovement));
    let mut limited = Axis::new(settings(60.0, 0.05));
    let result = loop {
        let state = limited.tick();
        limited.commanded.is_limited = true;
        match state {
            IdentificationState::Running { .. } => {}
            IdentificationState::Done(_) => panic!("bent"),
            IdentificationState::Failed(error) => break error,
        }
    };
    assert_eq!(result, IdentificationError::CurrentLimit);
    let mut lazy = Axis { friction: 0.08, gain: 0.15, ..Axis::new(settings(60.0, 0.02)) };
    assert_eq!(lazy.result(), Err(IdentificationError::Unstable));
}

#[test]
fn whole_periods_fill_the_window_and_a_way_that_does_not_fit_is_refused() {
    for (hertz, periods) in [(10.0, 8), (20.0, 8), (100.0, 32), (1_900.0, 8), (9_999.0, 8), (0.0, 8)] {
        let frequency = ExcitationFrequency::near((hertz * 100.0) as u32, periods);
        let actual = f64::from(frequency.hundredths()) / 100.0;
        let step = 8_000.0 / f64::from(frequency.ticks());
        let wanted = f64::clamp(hertz, step, 2_400.0);
        assert!((actual - wanted).abs() <= 0.51 * step, "{hertz}: {frequency:?}");
        assert!((actual / step - (actual / step).round()).abs() < 0.01);
    }
    let frequency = ExcitationFrequency::near(1_000, 8);
    let narrow = IdentificationParameters { movement: Position::from_bits(1 << 31), ..parameters() };
    let amplitude = CurrentFraction::from_num(0.1);
    let refused = ExcitationSettings::new(&narrow, frequency, amplitude, None);
    assert!(matches!(refused, Err(SettingsError::OutOfRange { actual: 140..180, maximum: 50, .. })), "{refused:?}");
    let none = ExcitationSettings::new(&parameters(), frequency, CurrentFraction::ZERO, None);
    assert!(none.is_err());
}

#[test]
fn a_sweep_goes_from_10_hz_to_2_khz_and_each_of_its_frequencies_is_found_again() {
    for index in 0..SWEEP {
        let frequency = ExcitationFrequency::of_sweep(index);
        assert_eq!(ExcitationFrequency::near(frequency.hundredths(), 32).hundredths(), frequency.hundredths());
    }
    assert_eq!(ExcitationFrequency::of_sweep(0).hundredths(), 977);
    let last = ExcitationFrequency::of_sweep(SWEEP - 1).hundredths();
    assert!((199_000..201_000).contains(&last), "{last}");
}

#[test]
fn the_movement_counts_from_the_first_of_several_sequences() {
    let frequency = ExcitationFrequency::near(6_000, 8);
    let amplitude = CurrentFraction::from_num(0.05);
    let origin = Some(Position::from_bits(-(5 << 31)));
    let settings = ExcitationSettings::new(&parameters(), frequency, amplitude, origin).unwrap();
    let result = Axis::new(settings).result();
    assert!(matches!(result, Err(IdentificationError::TooMuchMovement { .. })), "{result:?}");
}
