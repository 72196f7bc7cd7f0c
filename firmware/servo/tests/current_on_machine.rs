//! The current loop on the machine: inverter with dead time, saturating windings, noisy sensors with offsets and gain errors.

use std::f64::consts::TAU;

use crate::machine_bench::measure::{
    Phasor, Step, decibels, deviation, highest, largest, lowest, mean, whole_periods, within,
};
use crate::machine_bench::setup::Setup;
use crate::machine_bench::{Bench, CYCLES_PER_SECOND};
use plant::ReferenceAxis;
use servo::current::Trip;

/// With the shaft held fast.
fn seized(setup: &Setup) -> Bench {
    let bench = Bench::new(setup);
    bench.machine().block(true, bench.time);
    bench
}

/// At a speed in rpm that nothing changes.
fn turning(setup: Setup, rpm: f64) -> Bench {
    let mut bench = Bench::new(&setup.with_flywheel());
    bench.machine().set_velocity(rpm * TAU / 60.0, bench.time);
    bench.current_cycles([0.0; 2], 800);
    bench
}

fn quadrature(currents: &[[f64; 2]]) -> Vec<f64> {
    currents.iter().map(|current| current[1]).collect()
}

fn direct(currents: &[[f64; 2]]) -> Vec<f64> {
    currents.iter().map(|current| current[0]).collect()
}

/// Response of the q current around `offset` to a sine of its reference.
fn response(bench: &mut Bench, offset: f64, hertz: f64) -> Phasor {
    let length = 1_600;
    let hertz = whole_periods(hertz, length, CYCLES_PER_SECOND);
    let (mut commanded, mut measured) = (Vec::new(), Vec::new());
    for n in 0..400 + length {
        let command = offset + 0.1 * (TAU * hertz * n as f64 / CYCLES_PER_SECOND).sin();
        let current = bench.current_cycle([0.0, command]);
        if n >= 400 {
            commanded.push(command);
            measured.push(current[1]);
        }
    }
    assert_eq!(bench.trip, None);
    Phasor::of(&measured, hertz, CYCLES_PER_SECOND).over(Phasor::of(&commanded, hertz, CYCLES_PER_SECOND))
}

/// Gains in dB over 50 Hz to 3 kHz, and the frequency of -3 dB between them.
fn bode(bench: &mut Bench, offset: f64) -> (Vec<f64>, f64) {
    let frequencies = [50.0, 100.0, 200.0, 400.0, 700.0, 1_000.0, 1_300.0, 1_500.0, 1_700.0, 2_000.0, 2_500.0, 3_000.0];
    let gains: Vec<f64> =
        frequencies.iter().map(|&hertz| decibels(response(bench, offset, hertz).amplitude())).collect();
    let after = gains.iter().position(|&gain| gain < -3.0).expect("the gain falls");
    let share = (gains[after - 1] + 3.0) / (gains[after - 1] - gains[after]);
    let corner = frequencies[after - 1] + share * (frequencies[after] - frequencies[after - 1]);
    println!("{gains:.2?} dB, -3 dB at {corner:.0} Hz");
    (gains, corner)
}

fn has_its_bandwidth(axis: fn() -> ReferenceAxis, corner_at_load: std::ops::Range<f64>, at_zero: std::ops::Range<f64>) {
    let mut bench = seized(&Setup::of(axis()));
    for (offset, corners) in [(0.3, corner_at_load), (0.0, at_zero)] {
        let (gains, corner) = bode(&mut bench, offset);
        within("-3 dB at Hz", corner, corners);
        within("highest gain in dB", highest(gains.iter().copied()), -0.5..0.1);
    }
}

#[test]
fn the_current_loop_of_the_press_reaches_1500_hertz_without_a_peak() {
    has_its_bandwidth(ReferenceAxis::press, 1_950.0..2_150.0, 1_900.0..2_100.0);
}

#[test]
fn the_current_loop_of_the_small_machine_tool_reaches_1500_hertz_without_a_peak() {
    has_its_bandwidth(ReferenceAxis::small_cnc, 2_200.0..2_400.0, 2_150.0..2_300.0);
}

#[test]
fn the_current_loop_of_the_precise_axis_reaches_1500_hertz_without_a_peak() {
    has_its_bandwidth(ReferenceAxis::precise, 2_200.0..2_400.0, 2_150.0..2_300.0);
}

#[test]
fn the_current_loop_of_the_vertical_axis_reaches_1500_hertz_without_a_peak() {
    has_its_bandwidth(ReferenceAxis::vertical, 2_200.0..2_400.0, 2_150.0..2_300.0);
}

#[test]
fn the_current_loop_of_the_catalogue_motor_reaches_1500_hertz_without_a_peak() {
    has_its_bandwidth(ReferenceAxis::catalogue, 2_200.0..2_400.0, 2_150.0..2_300.0);
}

#[test]
fn the_bandwidth_is_the_same_at_speed() {
    let mut bench = turning(Setup::of(ReferenceAxis::precise()), 1_000.0);
    let (gains, corner) = bode(&mut bench, 0.3);
    within("-3 dB at Hz", corner, 2_100.0..2_300.0);
    within("highest gain in dB", highest(gains), -0.1..0.1);
}

#[test]
fn a_step_rises_in_three_to_four_cycles_and_hardly_overshoots() {
    for axis in ReferenceAxis::ALL {
        let mut bench = seized(&Setup::of(axis()));
        for (from, to) in [(0.2, 0.3), (0.3, 0.2), (-0.5, -0.6)] {
            bench.current_cycles([0.0, from], 400);
            let step = Step::of(&quadrature(&bench.current_cycles([0.0, to], 160)), from, to);
            within("rise in us", step.rise * 62.5, 140.0..210.0);
            within("overshoot", step.overshoot, -0.01..0.08);
            within("settling in us", step.settling * 62.5, 150.0..400.0);
        }
    }
}

#[test]
fn a_long_step_rises_as_fast_as_the_bus_lets_it() {
    let setup = Setup::of(ReferenceAxis::press());
    let mut bench = seized(&setup);
    bench.current_cycles([0.0, 0.3], 400);
    let step = Step::of(&quadrature(&bench.current_cycles([0.0, -0.3], 160)), 0.3, -0.3);
    // 80 % of 36 A in 3.8 mH with 0.98 * 560 V / sqrt(3) less or more 0.35 ohm and 9 V of dead time: 345 us.
    within("rise in us", step.rise * 62.5, 320.0..390.0);
    within("overshoot", step.overshoot, -0.01..0.02);
}

#[test]
fn a_step_along_the_magnet_is_the_same_step() {
    let mut bench = seized(&Setup::of(ReferenceAxis::precise()));
    bench.current_cycles([0.05, 0.2], 400);
    let step = Step::of(&direct(&bench.current_cycles([0.25, 0.2], 160)), 0.05, 0.25);
    within("rise in us", step.rise * 62.5, 140.0..210.0);
    within("overshoot", step.overshoot, -0.01..0.08);
}

#[test]
fn a_ramp_is_followed_with_a_lag_of_the_loops_time_constant() {
    let mut bench = seized(&Setup::of(ReferenceAxis::precise()));
    bench.current_cycles([0.0, 0.1], 400);
    // A share of 0.4 in 10 ms.
    let lags: Vec<f64> = (0..160)
        .map(|n| {
            let command = 0.1 + 0.4 * f64::from(n) / 160.0;
            (command - bench.current_cycle([0.0, command])[1]) / (0.4 / 0.01) * 1e6
        })
        .collect();
    within("lag in us", mean(&lags[80..]), 130.0..175.0);
    within("noise of the lag in us", deviation(&lags[80..]), 2.0..15.0);
}

#[test]
fn a_sine_of_100_hertz_is_followed_with_its_amplitude() {
    let mut bench = seized(&Setup::of(ReferenceAxis::press()));
    let response = response(&mut bench, 0.3, 100.0);
    within("gain", response.amplitude(), 0.99..1.01);
    within("phase in degrees", response.phase(), -6.0..-4.0);
}

#[test]
fn the_current_that_flows_is_the_one_commanded_within_the_errors_of_the_sensors() {
    let mut bench = seized(&Setup::of(ReferenceAxis::precise()));
    for command in [-0.9, -0.5, -0.1, 0.1, 0.5, 0.9] {
        bench.current_cycles([0.0, command], 400);
        let flowing = mean(&quadrature(&bench.current_cycles([0.0, command], 800)));
        // Gains of the phases are 0.5 % off.
        within("error in % of peak", (flowing - command).abs() * 100.0, 0.0..0.005 * 100.0 * command.abs() + 0.02);
    }
}

/// d current in % of peak that a step of the q current makes at speed: mean magnitude of the first 10 ms, and at the end.
fn crosstalk(decoupled: bool) -> (f64, f64) {
    let setup = Setup { decoupled, ..Setup::of(ReferenceAxis::press()) };
    let mut bench = turning(setup, 1_200.0);
    bench.current_cycles([0.0, 0.0], 800);
    let currents: Vec<f64> = direct(&bench.current_cycles([0.0, 0.15], 1_600)).iter().map(|d| d * 100.0).collect();
    let magnitudes: Vec<f64> = currents[..160].iter().map(|current| current.abs()).collect();
    (mean(&magnitudes), mean(&currents[1_200..]).abs())
}

#[test]
fn a_step_of_the_torque_current_hardly_moves_the_other_axis_at_speed() {
    let (with, with_at_end) = crosstalk(true);
    let (without, _) = crosstalk(false);
    within("mean d current in % of peak, decoupled", with, 0.02..0.15);
    within("mean d current in % of peak, not decoupled", without, 0.5..1.0);
    within("ratio", without / with, 6.0..20.0);
    within("d current at the end in % of peak", with_at_end, 0.0..0.02);
}

#[test]
fn at_full_speed_the_induced_voltage_is_met_without_a_current() {
    let mut bench = turning(Setup::of(ReferenceAxis::press()), 2_000.0);
    let currents = bench.current_cycles([0.0, 0.0], 1_600);
    within("d current in % of peak", mean(&direct(&currents)) * 100.0, -0.05..0.05);
    within("q current in % of peak", mean(&quadrature(&currents)) * 100.0, -0.05..0.05);
    within("ripple in % of peak", deviation(&quadrature(&currents)) * 100.0, 0.005..0.03);
}

#[test]
fn a_bridge_that_closes_at_full_speed_meets_the_rotor_where_it_will_be() {
    let mut bench = turning(Setup::of(ReferenceAxis::precise()), 2_000.0);
    bench.coast(200);
    // From its first period on: were it closed before the current is regulated, its phases at half would short-circuit the rotor, 19 %.
    let currents = bench.current_cycles([0.0, 0.0], 32);
    assert_eq!(bench.trip, None);
    within("largest d current in % of peak", largest(direct(&currents)) * 100.0, 0.01..0.15);
    within("largest q current in % of peak", largest(quadrature(&currents)) * 100.0, 0.005..0.035);
}

/// Part of the q current that swings `harmonic` times in an electrical revolution, in shares of peak, at 300 rpm and a current.
fn harmonic(mut bench: Bench, current: f64, harmonic: f64) -> f64 {
    // 300 rpm of 5 pole pairs are 25 Hz: 640 cycles.
    bench.current_cycles([0.0, current], 640);
    let currents = quadrature(&bench.current_cycles([0.0, current], 6_400));
    Phasor::of(&currents, 25.0 * harmonic, CYCLES_PER_SECOND).amplitude()
}

#[test]
fn offsets_of_the_sensors_are_measured_and_taken_out() {
    let mut setup = Setup::of(ReferenceAxis::precise());
    setup.reference.machine.current_sensors.offset = [40.2, -30.7, 10.4];
    let with = harmonic(turning(setup, 300.0), 0.3, 1.0);
    let mut bench = turning(setup, 300.0);
    bench.forget_offsets();
    let without = harmonic(bench, 0.3, 1.0);
    within("ripple once per electrical revolution in % of peak", with * 100.0, 0.0..0.005);
    // Offsets make a vector of 41 counts of 2 048 in 25 A.
    within("the same with the offsets", without * 100.0, 2.4..2.6);
}

#[test]
fn rounding_leaves_no_voltage_that_stands_in_the_stator() {
    // A compare value that is half a count off stands for 30 mV, which make 0.8 mA through the loop at 25 Hz.
    let ripple = harmonic(turning(Setup::of(ReferenceAxis::precise()).with_exact_sensors(), 300.0), 0.3, 1.0);
    within("ripple once per electrical revolution in mA", ripple * 20.0 * 1e3, 0.0..0.3);
}

#[test]
fn gain_errors_of_the_sensors_make_their_ripple_twice_per_electrical_revolution_and_no_more() {
    let mut setup = Setup::of(ReferenceAxis::precise());
    let errors = [0.02, -0.01, -0.01];
    setup.reference.machine.current_sensors.gain_error = errors;
    // The Clarke transformation sees half the difference of alpha's 1.3 % and beta's -1 %.
    let ripple = harmonic(turning(setup, 300.0), 0.5, 2.0);
    let exact = harmonic(turning(Setup::of(ReferenceAxis::precise()).with_exact_sensors(), 300.0), 0.5, 2.0);
    within("ripple in % of the current", ripple / 0.5 * 100.0, 0.9..1.1);
    within("without errors", exact / 0.5 * 100.0, 0.0..0.02);
}

#[test]
fn noise_of_the_converter_passes_by_a_part_of_itself_only() {
    let ripple = |noise: f64| {
        let mut setup = Setup::of(ReferenceAxis::precise());
        setup.reference.machine.current_sensors.noise = noise;
        let mut bench = seized(&setup);
        bench.current_cycles([0.0, 0.3], 400);
        deviation(&quadrature(&bench.current_cycles([0.0, 0.3], 8_000))) * bench.peak
    };
    // A count of 25 A / 2048 makes sqrt(2/3) of it in each axis: 10 mA.
    within("mA with 3 counts of noise", ripple(3.0) * 1e3, 14.0..20.0);
    within("mA with 1 count", ripple(1.0) * 1e3, 4.8..6.8);
    within("mA without", ripple(0.0) * 1e3, 0.1..2.0);
}

/// Ripple of the q current six times per electrical revolution, in shares of a small current.
fn dead_time_ripple(dead_time: u32) -> f64 {
    let mut setup = Setup::of(ReferenceAxis::precise()).with_exact_sensors();
    setup.current.dead_time = dead_time;
    harmonic(turning(setup, 300.0), 0.05, 6.0) / 0.05
}

#[test]
fn the_compensation_takes_most_of_the_dead_times_ripple_away() {
    let with = dead_time_ripple(1_000);
    let without = dead_time_ripple(0);
    within("sixth harmonic in %, compensated", with * 100.0, 0.1..0.4);
    within("sixth harmonic in %, not compensated", without * 100.0, 1.2..1.8);
    within("ratio", without / with, 4.0..10.0);
}

#[test]
fn a_dead_time_that_counts_the_drop_of_the_semiconductors_leaves_even_less() {
    // 1.5 V of 320 V are 0.29 us of 62.5 us.
    let with = dead_time_ripple(1_290);
    within("sixth harmonic in %", with * 100.0, 0.02..0.2);
    within("share of what the dead time alone leaves", with / dead_time_ripple(1_000), 0.1..0.8);
}

#[test]
fn a_small_current_follows_a_small_command_through_the_dead_time() {
    let gain = |dead_time: u32| {
        let mut setup = Setup::of(ReferenceAxis::precise());
        setup.current.dead_time = dead_time;
        setup.current.dead_time_band = 50;
        // The step is 3 counts, and the noise of a sample one: eight steps, each in noise of its own.
        let steps: Vec<f64> = (0..8)
            .map(|step| {
                let mut bench = seized(&setup);
                bench.current_cycles([0.0, 0.002], 100 + 38 * step);
                let flowing = quadrature(&bench.current_cycles([0.0, 0.004], 12));
                (mean(&flowing[6..]) - 0.002) / 0.002
            })
            .collect();
        mean(&steps)
    };
    // Within a millisecond. What is missing are the 1.5 V of the semiconductors beside the 5.1 V of the dead time.
    within("share of a step of 40 mA", gain(1_000), 0.55..0.95);
    within("the same without compensation", gain(0), -0.4..0.4);
}

#[test]
fn a_sag_of_the_bus_is_hardly_felt_by_the_current() {
    let mut bench = turning(Setup::of(ReferenceAxis::precise()), 500.0);
    bench.current_cycles([0.0, 0.5], 800);
    bench.machine().set_supply(220.0, bench.time);
    let currents = quadrature(&bench.current_cycles([0.0, 0.5], 3_200));
    let bus = bench.machine().bus_voltage(bench.time);
    within("bus in V", bus, 210.0..221.0);
    within("lowest current", lowest(currents.iter().copied()), 0.496..0.499);
    within("highest current", highest(currents.iter().copied()), 0.501..0.505);
    within("mean of the last 50 ms", mean(&currents[2_400..]), 0.498..0.502);
}

#[test]
fn out_of_the_voltage_limit_the_current_comes_back_without_a_swing() {
    // 2 000 rpm induce 168 V of the 181 V that there are: 0.9 of peak cannot flow.
    let mut bench = turning(Setup::of(ReferenceAxis::precise()), 2_000.0);
    let stuck = quadrature(&bench.current_cycles([0.0, 0.9], 1_600));
    within("current at the limit", mean(&stuck[1_200..]), 0.3..0.45);
    let back = quadrature(&bench.current_cycles([0.0, 0.0], 320));
    within("lowest current after the command fell to zero", lowest(back.iter().copied()), -0.05..-0.01);
    let settled = back.iter().rposition(|current| current.abs() > 0.02).map_or(0.0, |last| (last + 1) as f64);
    within("cycles until it is back", settled, 4.0..10.0);
}

#[test]
fn a_step_from_peak_to_peak_does_not_trip_and_stays_within_the_peak() {
    let mut bench = seized(&Setup::of(ReferenceAxis::catalogue()));
    bench.current_cycles([0.0, -1.0], 800);
    let currents = quadrature(&bench.current_cycles([0.0, 1.0], 320));
    assert_eq!(bench.trip, None);
    within("highest current", highest(currents), 0.995..1.01);
}

#[test]
fn a_current_above_the_trip_level_opens_the_bridge_and_dies() {
    let mut bench = seized(&Setup { trip: 0.8, ..Setup::of(ReferenceAxis::catalogue()) });
    bench.current_cycles([0.0, 0.7], 400);
    assert_eq!(bench.trip, None);
    let currents = quadrature(&bench.current_cycles([0.0, 1.0], 320));
    assert_eq!(bench.trip, Some(Trip::Overcurrent));
    within("highest current", highest(currents.iter().copied()), 0.8..0.96);
    within("current after 20 ms", currents[319].abs(), 0.0..0.001);
}

#[test]
fn a_sensor_that_stands_still_opens_the_bridge() {
    let mut bench = seized(&Setup::of(ReferenceAxis::precise()));
    bench.current_cycles([0.0, 0.5], 400);
    bench.machine().fail_current_sensor(1, Some(2_048), bench.time);
    let currents = bench.current_cycles([0.0, 0.5], 160);
    assert_eq!(bench.trip, Some(Trip::CurrentSum));
    within("largest current", largest(quadrature(&currents)), 0.49..1.1);
}

#[test]
fn counts_that_no_motor_makes_open_the_bridge() {
    let mut bench = Bench::new(&Setup::of(ReferenceAxis::precise()));
    bench.current_cycles([0.0, 0.0], 16);
    bench.machine().slip_encoder(2_000, bench.time);
    bench.current_cycles([0.0, 0.0], 16);
    assert_eq!(bench.trip, None, "2 000 rpm are 2 185 counts in a cycle");
    bench.machine().slip_encoder(10_000, bench.time);
    bench.current_cycles([0.0, 0.0], 16);
    assert_eq!(bench.trip, Some(Trip::EncoderJump));
}
