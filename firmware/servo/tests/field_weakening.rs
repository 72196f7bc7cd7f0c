//! Field weakening with the real current loop and a permanent magnet motor in f64 whose speed is ramped over its base speed and back.

use crate::current_bench::{Drive, MotorData};
use servo::axis::current_gains;
use servo::current::{
    CurrentReadings, FieldWeakening, FieldWeakeningParameters, FieldWeakeningSettings, PwmFrequency, WeakeningOutput,
};
use servo::units::{CurrentFraction, LOOP_TICKS_PER_SUPERVISION};

/// 0.2 Vs on 320 V: the longest vector is 181 V, 905 rad/s without load. 4 mH at 20 A are 0.08 Vs: at 0.9 of peak 36 % of the flux.
const MOTOR: MotorData =
    MotorData { resistance: 0.5, inductance: 0.004, flux: 0.2, bus: 320, peak: 20.0, frequency: PwmFrequency::Khz16 };

/// What a tick of the run saw.
#[derive(Clone, Copy, Debug)]
struct Seen {
    /// Share of the longest vector.
    voltage: f64,
    /// Shares of peak: commanded d, and both as they flow.
    command: f64,
    direct: f64,
    quadrature: f64,
    active: bool,
}

struct Run {
    drive: Drive,
    weakening: FieldWeakening,
    settings: FieldWeakeningSettings,
    output: WeakeningOutput,
    ticks: u32,
}

impl Run {
    fn new(limit: u16) -> Self {
        let gains = current_gains(500, 4_000, 1_000, MOTOR.frequency).unwrap();
        let parameters = FieldWeakeningParameters { limit, voltage: 9_300, integral_time: 50 };
        Self {
            drive: Drive::new(MOTOR, gains.proportional, gains.integral_time),
            weakening: FieldWeakening::new(),
            settings: FieldWeakeningSettings::new(&parameters).unwrap(),
            output: WeakeningOutput {
                direct: CurrentFraction::ZERO,
                quadrature_limit: CurrentFraction::MAX,
                active: false,
            },
            ticks: 0,
        }
    }

    /// A tick of two cycles.
    fn tick(&mut self, quadrature: f64, speed: f64) -> Seen {
        let bus = self.drive.bus();
        let readings: CurrentReadings = self.drive.readings().readings();
        if self.ticks.is_multiple_of(LOOP_TICKS_PER_SUPERVISION) {
            self.output = self.weakening.tick(&self.settings, &readings, &bus);
        }
        self.ticks += 1;
        let output = self.output;
        let limit = output.quadrature_limit.to_num::<f64>();
        for _ in 0..2 {
            self.drive.cycle(output.direct.to_num(), quadrature.clamp(-limit, limit), speed);
        }
        let length = f64::from(readings.direct_voltage).hypot(f64::from(readings.quadrature_voltage));
        let (direct, quadrature) = self.drive.current();
        Seen {
            voltage: length / f64::from(bus.longest()),
            command: output.direct.to_num(),
            direct,
            quadrature,
            active: output.active,
        }
    }

    /// Ticks at a speed that goes from one value to another.
    fn ramp(&mut self, quadrature: f64, from: f64, to: f64, ticks: u32) -> Vec<Seen> {
        (0..ticks).map(|tick| self.tick(quadrature, from + (to - from) * f64::from(tick) / f64::from(ticks))).collect()
    }
}

fn spread(seen: &[Seen], value: impl Fn(&Seen) -> f64) -> f64 {
    let highest = seen.iter().map(&value).fold(f64::MIN, f64::max);
    highest - seen.iter().map(&value).fold(f64::MAX, f64::min)
}

fn mean(seen: &[Seen], value: impl Fn(&Seen) -> f64) -> f64 {
    seen.iter().map(value).sum::<f64>() / seen.len() as f64
}

/// d current as a share of peak at which the voltage has a length in V.
fn direct_for(voltage: f64, quadrature: f64, speed: f64) -> f64 {
    let MotorData { resistance, inductance, flux, peak, .. } = MOTOR;
    let length = |direct: f64| {
        let (d, q) = (direct * peak, quadrature * peak);
        (resistance * d - speed * inductance * q).hypot(resistance * q + speed * (inductance * d + flux))
    };
    let (mut low, mut high) = (-0.9, 0.0);
    for _ in 0..50 {
        let middle = (low + high) / 2.0;
        if length(middle) > voltage { high = middle } else { low = middle }
    }
    low
}

#[test]
fn over_base_speed_the_voltage_is_held_and_below_it_the_full_field_returns() {
    for quadrature in [0.3, -0.3] {
        let mut run = Run::new(9_000);
        let below = run.ramp(quadrature, 0.0, 700.0, 1_600);
        assert!(below.iter().all(|seen| !seen.active && seen.command == 0.0), "nothing is done below base speed");

        // 1.25 times base speed within 100 ms
        let rising = run.ramp(quadrature, 700.0, 1_100.0, 800);
        let highest = rising.iter().map(|seen| seen.voltage).fold(0.0, f64::max);
        assert!((0.93..0.975).contains(&highest), "on the ramp {highest}");

        let steady = run.ramp(quadrature, 1_100.0, 1_100.0, 1_600).split_off(800);
        let voltage = mean(&steady, |seen| seen.voltage);
        assert!((0.929..0.931).contains(&voltage), "{voltage}");
        let longest = f64::from(run.drive.bus().longest()) / 16_384.0;
        let expected = direct_for(0.93 * longest, quadrature, 1_100.0);
        let direct = mean(&steady, |seen| seen.direct);
        println!("q {quadrature}: highest {highest:.4}, steady {voltage:.4}, d {direct:.4} of {expected:.4}");
        assert!((direct - expected).abs() < 0.02, "d current {direct}, by the equations of the motor {expected}");
        assert!(steady.iter().all(|seen| seen.active));
        assert!((mean(&steady, |seen| seen.quadrature) - quadrature).abs() < 0.005, "the torque is untouched");
        assert!(spread(&steady, |seen| seen.command) < 0.01, "{}", spread(&steady, |seen| seen.command));

        let back = run.ramp(quadrature, 1_100.0, 700.0, 800);
        let end = back.last().unwrap();
        assert!(!end.active && end.command == 0.0 && end.direct.abs() < 0.01, "{end:?}");
    }
}

#[test]
fn without_field_weakening_the_torque_is_lost_where_it_is_kept_with_it() {
    let quadrature = |limit| {
        let mut run = Run::new(limit);
        run.ramp(0.3, 0.0, 950.0, 2_400);
        mean(&run.ramp(0.3, 950.0, 950.0, 800), |seen| seen.quadrature)
    };
    let (without, with) = (quadrature(0), quadrature(9_000));
    println!("q current without {without:.3}, with {with:.3}");
    assert!(without < 0.1, "{without}");
    assert!((0.295..0.305).contains(&with), "{with}");
}

#[test]
fn the_limit_of_the_current_holds_and_both_currents_stay_within_the_peak() {
    let mut run = Run::new(5_000);
    run.ramp(1.0, 0.0, 1_000.0, 2_400);
    let seen = run.ramp(1.0, 1_000.0, 1_000.0, 800);
    for seen in &seen {
        assert!((-0.5..-0.499).contains(&seen.command), "{seen:?}");
        assert!(seen.direct.hypot(seen.quadrature) < 1.01, "{seen:?}");
        assert!((0.95..1.000_1).contains(&seen.voltage), "{seen:?}");
    }
    println!("d {:.4}, q {:.4}", mean(&seen, |seen| seen.direct), mean(&seen, |seen| seen.quadrature));
    assert!((mean(&seen, |seen| seen.direct) + 0.5).abs() < 0.01, "the d axis is served first");
    assert!(spread(&seen, |seen| seen.direct) < 0.05, "{}", spread(&seen, |seen| seen.direct));
}

#[test]
fn a_step_of_the_torque_over_base_speed_settles() {
    let mut run = Run::new(9_000);
    run.ramp(0.0, 0.0, 1_000.0, 2_400);
    run.ramp(0.0, 1_000.0, 1_000.0, 400);
    for quadrature in [0.3, -0.3, 0.0] {
        let step = run.ramp(quadrature, 1_000.0, 1_000.0, 1_200);
        let settled = step.get(600..).unwrap();
        assert!((mean(settled, |seen| seen.quadrature) - quadrature).abs() < 0.005);
        assert!((0.925..0.935).contains(&mean(settled, |seen| seen.voltage)), "{}", mean(settled, |seen| seen.voltage));
        assert!(spread(settled, |seen| seen.command) < 0.01, "{}", spread(settled, |seen| seen.command));
    }
}
