//! Time: what the state depends on, and what it does not.

use crate::common::{BUS, MICROSECOND, MILLISECOND, SECOND, assert_near, duties, ideal};
use plant::{
    Cogging, EarthFault, Eccentricity, Effects, EmfHarmonics, LegCapacitance, Load, LowSideShunts, Machine,
    MachineSettings, QuadratureError, ReferenceAxis, SensorBandwidth, Stiction, Windings, Wiring,
};

/// A machine with every imperfection at once.
fn imperfect() -> MachineSettings {
    let load = Load { inertia: 0.000_5, stiffness: 8_000.0, damping: 0.2, backlash: 0.001 };
    let mut settings = ReferenceAxis::vertical().machine;
    settings.mechanics.load = Some(load);
    settings
}

/// The same with every effect, and what inputs can break.
fn with_all_effects() -> MachineSettings {
    let mut settings = imperfect();
    settings.mechanics.coulomb_friction = 0.2;
    settings.effects = Effects {
        shunts: Some(LowSideShunts { settling_time: 3e-6, sampling_time: 0.7e-6 }),
        sensor_bandwidth: Some(SensorBandwidth { hertz: 50_000.0 }),
        leg_capacitance: Some(LegCapacitance { farads: 2e-9 }),
        wiring: Some(Wiring::turned_on()),
        cogging: Some(Cogging::of(12, 10, 0.1)),
        emf_harmonics: Some(EmfHarmonics { fifth: 0.02, seventh: 0.01 }),
        stiction: Some(Stiction { static_torque: 0.3, stribeck_velocity: 0.5 }),
        eccentricity: Some(Eccentricity { radians: 0.001, phase: 0.1 }),
        quadrature: Some(QuadratureError {
            periods_per_revolution: 512,
            amplitude: 0.02,
            phase: 0.01,
            offset: [0.01; 2],
        }),
    };
    settings
}

/// Every number that a machine shows.
fn bits(machine: &mut Machine, at: u64) -> Vec<u64> {
    let [d, q] = machine.dq_currents(at);
    let [a, b, c] = machine.current_samples(at).map(u64::from);
    let numbers = [
        machine.angle(at),
        machine.load_angle(at),
        machine.velocity(at),
        machine.torque(at),
        d,
        q,
        machine.bus_voltage(at),
        machine.winding_temperature(at),
        machine.heat_sink_temperature(at),
        machine.brake_torque(at),
    ];
    let mut bits: Vec<u64> = numbers.iter().map(|number| number.to_bits()).collect();
    bits.extend([a, b, c, u64::from(machine.encoder_count(at)), u64::from(machine.index_pulses(at))]);
    bits
}

#[test]
fn the_result_does_not_depend_on_how_often_it_is_asked() {
    let run = |step: u64, broken: bool| {
        let mut machine = Machine::new(if broken { with_all_effects() } else { imperfect() });
        machine.set_bridge(true, 0);
        machine.set_brake(true, 0);
        for n in 0..1_600_u64 {
            let at = n * 62_500 + 3_333;
            let duties = duties(30.0, n as f64 * 0.013);
            machine.set_duties(duties, at);
            match n {
                320 if broken => machine.set_contact_resistances([0.3, 0.0, 0.1], at + 77),
                640 if broken => {
                    machine.fail_to_earth(Some((1, EarthFault { resistance: 100.0, inductance: 1e-3 })), at + 77);
                }
                960 if broken => machine.open_phase(2, true, at + 77),
                1_120 => machine.set_velocity(50.0, at),
                1_440 => machine.set_bridge(false, at + 17),
                _ => {}
            }
            let mut asked = at;
            while asked < at + 62_500 {
                let _ = bits(&mut machine, asked);
                machine.set_duties(duties, asked);
                machine.set_brake(true, asked);
                asked += step;
            }
        }
        bits(&mut machine, 101 * MILLISECOND)
    };
    for broken in [false, true] {
        let reference = run(62_500, broken);
        for step in [2_777, 4_999, 5_000, 31_250] {
            assert_eq!(run(step, broken), reference, "asked every {step} ns");
        }
    }
}

#[test]
fn an_input_ahead_of_time_waits_for_it() {
    let at = 123 * MICROSECOND + 456;
    let mut machine = Machine::new(ideal());
    machine.set_bridge(true, at);
    machine.set_duties(duties(100.0, 0.0), at);
    machine.set_supply(200.0, at + SECOND);
    assert_eq!(machine.dq_currents(at), [0.0, 0.0]);
    // 100 A/ms
    assert_near(machine.dq_currents(at + 1_000)[0], 0.1, 1e-4);
    // The same with the inputs entered in time.
    let mut late = Machine::new(ideal());
    late.advance(at);
    late.set_bridge(true, at);
    late.set_duties(duties(100.0, 0.0), at);
    assert_eq!(bits(&mut late, 10 * MILLISECOND), bits(&mut machine, 10 * MILLISECOND));
}

#[test]
fn an_input_that_comes_late_holds_from_the_last_one_on() {
    let mut machine = Machine::new(ideal());
    machine.set_load_torque(1.0, 2 * MILLISECOND);
    machine.set_load_torque(0.0, MILLISECOND);
    assert_eq!(machine.velocity(10 * MILLISECOND), 0.0);
}

#[test]
fn queries_leave_no_trace_in_a_copy() {
    for settings in [imperfect(), with_all_effects()] {
        let mut asked = Machine::new(settings);
        asked.set_bridge(true, 0);
        asked.set_duties(duties(20.0, 0.1), 0);
        let mut silent = asked.clone();
        for at in (0..MILLISECOND).step_by(1_111) {
            let _ = bits(&mut asked, at);
        }
        asked.advance(MILLISECOND);
        silent.advance(MILLISECOND);
        assert_eq!(asked, silent);
    }
}

#[test]
#[should_panic(expected = "inertia must be positive")]
fn a_machine_without_inertia_makes_no_sense() {
    let mut settings = ideal();
    settings.mechanics.rotor_inertia = 0.0;
    let _ = Machine::new(settings);
}

#[test]
fn a_look_ahead_is_what_will_be_and_changes_nothing() {
    look_ahead(Machine::new(imperfect()));
    let mut broken = Machine::new(with_all_effects());
    // At instants that the looks pass.
    broken.set_contact_resistances([0.3, 0.0, 0.1], 20_000);
    look_ahead(broken);
}

fn look_ahead(mut machine: Machine) {
    machine.set_bridge(true, 0);
    machine.set_brake(true, 0);
    let mut moved = 0;
    for n in 0..800_u64 {
        let at = n * 62_500 + 3_333;
        // From here on an input lies ahead, which a look must pass, too.
        machine.set_duties(duties(30.0, n as f64 * 0.013), at + 31_250);
        if n % 100 == 50 {
            machine.set_velocity(50.0, at + 33_333);
        }
        machine.advance(at);
        let before = machine.clone();
        for ahead in [at, at + 1, at + 1_667, at + 29_000, at + 40_001] {
            let seen = machine.encoder_ahead(ahead);
            assert_eq!(seen, before.clone().encoder_count(ahead), "{ahead}");
            moved += u32::from(seen != machine.encoder_ahead(at));
        }
        assert!(machine == before, "the look at {at} left a trace");
    }
    assert!(moved > 400, "the shaft hardly moves: {moved}");
}

#[test]
fn the_textbook_s_machine_shows_what_flows_and_nothing_gives_way() {
    let windings = Windings {
        pole_pairs: 3,
        resistance: 2.0,
        inductance_d: 1e-3,
        inductance_q: 1e-3,
        flux: 0.1,
        saturation: None,
    };
    let settings = MachineSettings::textbook(windings, BUS, 20.0);
    let mut machine = Machine::new(settings);
    machine.block(true, 0);
    machine.set_bridge(true, 0);
    machine.set_duties(duties(20.0, 0.0), 0);
    let at = 50 * MILLISECOND;
    let [d, q] = machine.dq_currents(at);
    assert_near(d, 10.0, 1e-7);
    // The d axis is that of the first phase to the last bit.
    assert_near(q, 0.0, 1e-9);
    assert_eq!(machine.current_samples(at), [3_072, 1_536, 1_536]);
    assert_eq!(machine.bus_sample(at), 2_048);
    assert_near(machine.bus_voltage(at), BUS, 1e-6);
    assert_eq!(machine.encoder_count(at), 0);
    machine.block(false, at);
    machine.set_velocity(1.0, at);
    machine.set_bridge(false, at);
    assert_near(machine.velocity(at + SECOND), 1.0, 1e-3);
}
