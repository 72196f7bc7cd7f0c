//! Current sensors that are not there all the time, and that are not as fast as the current.

use core::f64::consts::TAU;

use crate::common::{BUS, MICROSECOND, MILLISECOND, assert_near, ideal, seized};
use plant::{Inverter, LowSideShunts, Machine, MachineSettings, SensorBandwidth};

const INVERTER: Inverter = Inverter { dead_time: 1e-6, period: 62.5e-6, voltage_drop: 0.0 };
const SHUNTS: LowSideShunts = LowSideShunts { settling_time: 1.2e-6, sampling_time: 0.7e-6 };

fn with_shunts() -> MachineSettings {
    let mut settings = MachineSettings { inverter: INVERTER, ..ideal() };
    settings.effects.shunts = Some(SHUNTS);
    settings
}

/// Counts beside the middle, 100 per A, of the first leg with its high side closed for a share of the period, and its current.
fn sample(share: f64) -> (f64, f64) {
    let mut machine = seized(with_shunts(), 0.0, 0.0);
    let other = share - 15.0 / BUS;
    machine.set_duties([share, other, other], 0);
    let at = 20 * MILLISECOND;
    (f64::from(machine.current_samples(at)[0]) - 2_048.0, machine.phase_currents(at)[0])
}

#[test]
fn in_a_window_that_is_long_enough_the_current_is_seen_and_in_a_short_one_a_settling_amplifier() {
    let mut least: f64 = 1.0;
    for n in 0..=60 {
        let share = 0.7 + 0.005 * f64::from(n);
        let (counts, current) = sample(share.min(1.0));
        // From the low side's turning on to the begin of sampling, 1 % being left after each settling time.
        let time = 0.5 * (1.0 - share).max(0.0) * 62.5e-6 - 1e-6 - 0.7e-6;
        let settled = 1.0 - 0.01_f64.powf(time.max(0.0) / 1.2e-6);
        assert!(current > 1.0, "{current}");
        assert_near(counts, 100.0 * current * settled, 0.51);
        least = least.min(settled);
    }
    assert_eq!(least, 0.0);
}

#[test]
fn the_window_ends_where_one_percent_is_missing() {
    // 2 * (1 + 0.7 + 1.2) us of 62.5 us.
    let share = 1.0 - 5.8 / 62.5;
    assert_near(SHUNTS.window(&INVERTER, share), 0.0, 1e-12);
    assert_near(SHUNTS.window(&INVERTER, 0.5), 15.625e-6 - 2.9e-6, 1e-12);
    let (counts, current) = sample(share);
    assert_near(counts, 99.0 * current, 0.51);
}

#[test]
fn of_an_open_bridge_shunts_show_what_comes_through_the_lower_diodes() {
    let run = |settings| {
        let mut machine = seized(settings, 8.0, 3.0);
        machine.set_bridge(false, 20 * MILLISECOND);
        let at = 20 * MILLISECOND + 5 * MICROSECOND;
        (machine.current_samples(at), machine.phase_currents(at))
    };
    let (seen, currents) = run(with_shunts());
    let mut without = with_shunts();
    without.effects.shunts = None;
    let (all, _) = run(without);
    assert!(currents[0] > 1.0 && currents[2] < -1.0, "{currents:?}");
    for phase in 0..3 {
        let expected = if currents[phase] > 0.0 { all[phase] } else { 2_048 };
        assert_eq!(seen[phase], expected, "phase {phase} of {currents:?}");
    }
}

#[test]
fn a_sensor_lags_behind_a_current_that_rises_evenly_by_its_time_constant() {
    let mut settings = ideal();
    settings.windings.resistance = 0.0;
    settings.effects.sensor_bandwidth = Some(SensorBandwidth { hertz: 5_000.0 });
    let mut machine = seized(settings, 10.0, 0.0);
    let time_constant = 1.0 / (TAU * 5_000.0);
    for at in [3, 12, 50, 333, 1_500].map(|at| at * MICROSECOND) {
        // 10 A/ms, 100 counts per A.
        let time = at as f64 * 1e-9;
        let shown = 1e6 * (time - time_constant * (1.0 - (-time / time_constant).exp()));
        assert_near(f64::from(machine.current_samples(at)[0]), 2_048.0 + shown, 0.51);
    }
}

#[test]
fn at_its_bandwidth_a_sensor_shows_71_percent_an_eighth_of_a_period_late() {
    // A short circuit at 1 000 Hz carries flux / L = 10 A.
    let mut settings = ideal();
    settings.windings.flux = 0.01;
    settings.windings.resistance = 0.05;
    settings.mechanics.rotor_inertia = 1e6;
    settings.current_sensors.range = 20.48;
    settings.effects.sensor_bandwidth = Some(SensorBandwidth { hertz: 1_000.0 });
    let mut machine = Machine::new(settings);
    machine.set_bridge(true, 0);
    machine.set_velocity(TAU * 1_000.0 / 4.0, 0);
    let eighth = MILLISECOND / 8;
    for n in 0..40 {
        let at = 300 * MILLISECOND + n * 27_000;
        let before = machine.phase_currents(at);
        let samples = machine.clone().current_samples(at + eighth);
        for phase in 0..3 {
            let counts = f64::from(samples[phase]) - 2_048.0;
            assert_near(counts, 100.0 * before[phase] * 0.5_f64.sqrt(), 1.0);
        }
    }
    assert!(machine.dq_currents(300 * MILLISECOND)[0] < -9.5);
}
