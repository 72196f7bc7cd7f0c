//! What sensors and encoder show.

use core::f64::consts::TAU;

use crate::common::{MICROSECOND, MILLISECOND, SECOND, assert_near, ideal, seized};
use plant::{CurrentSensors, Encoder, Machine, MachineSettings, ThermalResistor, Thermometer, ThermometerFailure};

fn with_encoder(change: impl FnOnce(&mut Encoder)) -> MachineSettings {
    let mut settings = ideal();
    change(&mut settings.encoder);
    settings
}

#[test]
fn the_encoder_counts_quantised_down_and_wraps() {
    let mut machine = Machine::new(with_encoder(|e| e.initial_count = 5));
    assert_eq!(machine.encoder_count(0), 5);
    machine.set_velocity(-TAU, 0);
    assert_eq!(machine.encoder_count(SECOND), 5_u32.wrapping_sub(4_096));
    assert_eq!(machine.encoder_count(SECOND + SECOND / 4_096 / 4), 5_u32.wrapping_sub(4_096));
    assert_eq!(machine.encoder_count(SECOND + SECOND / 4_096), 5_u32.wrapping_sub(4_097));
}

/// Of the machine that turns.
const REVOLUTION: u64 = 50 * MILLISECOND;

const SPEED: f64 = 20.0 * TAU;

/// A machine that turns.
fn turning(settings: MachineSettings, direction: f64) -> Machine {
    let mut machine = Machine::new(settings);
    machine.set_velocity(direction * SPEED, 0);
    machine
}

#[test]
fn the_index_latches_the_count_at_the_edge_that_comes_first_in_the_direction() {
    // On an edge of the tracks, between two edges, and in the last increment of a revolution.
    for (index_at, forward, backward) in
        [(0.25, 1_024, 1_024), (0.250_1, 1_024, 1_025), (4_095.4 / 4_096.0, 4_095, 4_096)]
    {
        let settings = with_encoder(|e| (e.index_at, e.initial_count) = (index_at, 100));
        let mut machine = turning(settings, 1.0);
        assert_eq!(machine.index_count(MILLISECOND / 20), None);
        for revolution in 0..3_u32 {
            let at = REVOLUTION * u64::from(revolution + 1);
            assert_eq!(machine.index_count(at), Some(100 + forward + 4_096 * revolution), "{index_at}");
            assert_eq!(machine.index_pulses(at), revolution + 1);
        }
        let mut machine = turning(settings, -1.0);
        assert_eq!(machine.index_count(REVOLUTION / 100_000), None);
        for revolution in 1..4_u32 {
            let at = REVOLUTION * u64::from(revolution);
            let count = 100_u32.wrapping_add(backward).wrapping_sub(4_096 * revolution);
            assert_eq!(machine.index_count(at), Some(count), "{index_at}");
            assert_eq!(machine.index_pulses(at), revolution);
        }
    }
}

#[test]
fn the_latch_appears_when_the_counter_passes_its_count() {
    for (direction, index_at) in [(1.0, 0.25), (-1.0, 0.25), (1.0, 0.3001), (-1.0, 0.3001)] {
        let mut machine = turning(with_encoder(|e| e.index_at = index_at), direction);
        let at = (0..1_000_000).map(|n| n * MICROSECOND).find(|at| machine.index_pulses(*at) > 0).unwrap();
        let (latched, count) = (machine.index_count(at).unwrap(), machine.encoder_count(at));
        assert_eq!(count, latched, "direction {direction}, index at {index_at}");
    }
}

#[test]
fn a_turn_back_within_the_pulse_raises_it_again_only_from_outside() {
    let mut machine = turning(ideal(), 1.0);
    let inside = REVOLUTION / 4 + REVOLUTION / 4_096 / 4;
    machine.set_velocity(-SPEED, inside);
    assert_eq!(machine.index_pulses(inside), 1);
    // Out of it at its begin, and in again there.
    machine.set_velocity(SPEED, inside + REVOLUTION / 4_096);
    assert_eq!(machine.index_pulses(inside + REVOLUTION / 4_096), 1);
    assert_eq!(machine.index_pulses(inside + REVOLUTION / 1_024), 2);
    // From above it rises at its end.
    machine.set_velocity(-SPEED, inside + REVOLUTION / 1_024);
    assert_eq!(machine.index_pulses(inside + REVOLUTION / 256), 3);
    assert_eq!(machine.index_count(inside + REVOLUTION / 256), Some(1_024));
}

#[test]
fn a_muted_index_latches_nothing() {
    let mut machine = turning(ideal(), 1.0);
    machine.mute_index(true, REVOLUTION);
    assert_eq!(machine.index_pulses(3 * REVOLUTION), 1);
    assert_eq!(machine.index_count(3 * REVOLUTION), Some(1_024));
    machine.mute_index(false, 3 * REVOLUTION);
    assert_eq!(machine.index_pulses(4 * REVOLUTION), 2);
    assert_eq!(machine.index_count(4 * REVOLUTION), Some(1_024 + 3 * 4_096));
}

#[test]
fn a_frozen_encoder_loses_the_counts_of_the_movement() {
    let mut machine = turning(ideal(), 1.0);
    machine.freeze_encoder(true, REVOLUTION);
    machine.freeze_encoder(false, 3 * REVOLUTION);
    assert_eq!(machine.encoder_count(2 * REVOLUTION), 4_096);
    assert_eq!(machine.index_count(2 * REVOLUTION), Some(4_096), "the index goes on, the count does not");
    assert_eq!(machine.encoder_count(4 * REVOLUTION), 2 * 4_096);
    assert_eq!(machine.index_count(4 * REVOLUTION), Some(4_096 + 1_024));
    assert_near(machine.angle(4 * REVOLUTION), 4.0, 1e-5);
}

#[test]
fn counts_that_slip_stay_in_the_counter_and_in_the_latch() {
    let mut machine = turning(ideal(), 1.0);
    machine.slip_encoder(-7, REVOLUTION);
    assert_eq!(machine.encoder_count(REVOLUTION), 4_096 - 7);
    assert_eq!(machine.index_count(2 * REVOLUTION), Some(4_096 + 1_024 - 7));
    machine.slip_encoder(10, 2 * REVOLUTION);
    machine.slip_encoder(10, 2 * REVOLUTION);
    machine.freeze_encoder(true, 2 * REVOLUTION);
    machine.slip_encoder(1, 2 * REVOLUTION);
    assert_eq!(machine.encoder_count(3 * REVOLUTION), 2 * 4_096 + 14);
    machine.freeze_encoder(false, 3 * REVOLUTION);
    assert_eq!(machine.encoder_count(3 * REVOLUTION), 2 * 4_096 + 14);
}

/// Phase currents of 8, -4 and -4 A at 100 counts per A.
fn with_current(sensors: CurrentSensors) -> Machine {
    seized(MachineSettings { current_sensors: sensors, ..ideal() }, 8.0, 0.0)
}

#[test]
fn current_samples_have_offset_gain_error_and_steps() {
    let at = 100 * MILLISECOND;
    let sensors = ideal().current_sensors;
    assert_eq!(with_current(sensors).current_samples(at), [2_848, 1_648, 1_648]);
    let sensors = CurrentSensors { offset: [3.4, -4.6, 0.5], gain_error: [0.01, -0.01, 0.0], ..sensors };
    assert_eq!(with_current(sensors).current_samples(0), [2_051, 2_043, 2_049]);
    // 2851.4 + 8, 1643.4 + 4, 1648.5
    assert_eq!(with_current(sensors).current_samples(at)[..2], [2_859, 1_647]);
}

#[test]
fn samples_beyond_the_range_are_clipped() {
    let sensors = CurrentSensors { range: 3.9, ..ideal().current_sensors };
    assert_eq!(with_current(sensors).current_samples(100 * MILLISECOND), [4_095, 0, 0]);
    let mut settings = ideal();
    settings.bus_range = 299.0;
    settings.thermometers = [Thermometer { supply: 5.0, ..Thermometer::with(ThermalResistor::Absent) }; 2];
    let mut machine = Machine::new(settings);
    assert_eq!(machine.bus_sample(0), 4_095);
    assert_eq!(machine.temperature_samples(0), [4_095, 4_095]);
}

#[test]
fn bus_samples_are_linear() {
    let mut machine = Machine::new(ideal());
    assert_eq!(machine.bus_sample(0), 2_400);
}

#[test]
fn a_broken_current_sensor_shows_its_own_value_until_it_is_repaired() {
    let mut machine = with_current(ideal().current_sensors);
    machine.fail_current_sensor(1, Some(4_000), 100 * MILLISECOND);
    machine.fail_current_sensor(1, None, 200 * MILLISECOND);
    assert_eq!(machine.current_samples(100 * MILLISECOND - 1), [2_848, 1_648, 1_648]);
    assert_eq!(machine.current_samples(100 * MILLISECOND), [2_848, 4_000, 1_648]);
    assert_near(machine.phase_currents(100 * MILLISECOND)[1], -4.0, 1e-6);
    assert_eq!(machine.current_samples(200 * MILLISECOND), [2_848, 1_648, 1_648]);
}

#[test]
fn a_current_sensor_with_a_moved_zero_shows_so_much_more() {
    let mut machine = with_current(ideal().current_sensors);
    machine.shift_current_sensor(2, -50, 100 * MILLISECOND);
    machine.shift_current_sensor(0, 4_000, 100 * MILLISECOND);
    assert_eq!(machine.current_samples(100 * MILLISECOND - 1), [2_848, 1_648, 1_648]);
    assert_eq!(machine.current_samples(100 * MILLISECOND), [4_095, 1_648, 1_598]);
}

#[test]
fn heat_sink_and_windings_take_the_temperatures_that_they_are_given_and_a_broken_sensor_does_not_see_them() {
    let mut machine = Machine::new(ideal());
    machine.set_temperatures([60.0, 100.0], MILLISECOND);
    machine.fail_temperature_sensor(1, Some(ThermometerFailure::BrokenWire), 2 * MILLISECOND);
    // 1 515.3 and 1 000 Ohm beside 2 200.
    assert_eq!(machine.temperature_samples(MILLISECOND), [1_671, 1_280]);
    assert_eq!(machine.temperature_samples(2 * MILLISECOND), [1_671, 4_095]);
}

#[test]
fn the_noise_has_its_strength_and_repeats_with_its_seed() {
    let sensors = CurrentSensors { noise: 3.0, ..ideal().current_sensors };
    let run = |seed: u64| {
        let mut machine = Machine::new(MachineSettings { current_sensors: sensors, seed, ..ideal() });
        (0..20_000).map(|n| machine.current_samples(n * 5_000).map(f64::from)).collect::<Vec<_>>()
    };
    let samples = run(7);
    for phase in 0..3 {
        let mean = samples.iter().map(|sample| sample[phase]).sum::<f64>() / 20_000.0;
        let square = samples.iter().map(|sample| (sample[phase] - 2_048.0).powi(2)).sum::<f64>() / 20_000.0;
        assert_near(mean, 2_048.0, 0.1);
        // Rounding adds 1/12.
        assert_near(square.sqrt(), (9.0_f64 + 1.0 / 12.0).sqrt(), 0.08);
    }
    assert_eq!(run(7), samples);
    assert_ne!(run(8), samples);
    let mut machine = Machine::new(MachineSettings { current_sensors: sensors, ..ideal() });
    let sample = machine.current_samples(3 * MICROSECOND);
    let _ = machine.current_samples(4 * MICROSECOND);
    assert_eq!(machine.current_samples(3 * MICROSECOND), sample, "the noise belongs to the instant");
}
