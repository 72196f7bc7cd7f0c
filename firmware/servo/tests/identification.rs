//! Identification of simulated motors through the real current loop.

mod pmsm;

use pmsm::{Bench, Fault, Machine};
use servo::current::PwmFrequency;
use servo::identification::{
    FluxIdentification, FluxMeasurement, FluxSettings, IdentificationError, IdentificationInputs, IdentificationOutput,
    IdentificationParameters, IdentificationState, InductanceIdentification, InductanceMeasurement, InductanceSettings,
    InertiaIdentification, InertiaMeasurement, InertiaSettings, ResistanceIdentification, ResistanceMeasurement,
    ResistanceSettings,
};
use servo::{Acceleration, Position, Velocity};

/// Low voltage, high current, hardly any resistance.
const WHEEL: Machine = Machine {
    name: "wheel",
    resistance: 0.2,
    direct_inductance: 0.5e-3,
    quadrature_inductance: 0.7e-3,
    flux: 0.02,
    pole_pairs: 4,
    inertia: 3e-4,
    coulomb_friction: 0.03,
    viscous_friction: 1e-4,
    increments: 10_000,
    bus: 48.0,
    peak_current: 25.0,
    measuring_range: 31.25,
    current: 10.0,
    ripple: 1.2,
    speed: 1_500.0,
    acceleration: 800.0,
    bandwidth: 900.0,
    frequency: PwmFrequency::Khz16,
};

/// Light and fast; the rotor shivers most.
const SPINDLE: Machine = Machine {
    name: "spindle",
    resistance: 0.8,
    direct_inductance: 1.5e-3,
    quadrature_inductance: 1.5e-3,
    flux: 0.012,
    pole_pairs: 5,
    inertia: 3e-6,
    coulomb_friction: 0.002,
    viscous_friction: 1e-6,
    increments: 65_536,
    bus: 60.0,
    peak_current: 8.0,
    measuring_range: 10.0,
    current: 3.0,
    ripple: 0.4,
    speed: 3_000.0,
    acceleration: 3_000.0,
    bandwidth: 500.0,
    frequency: PwmFrequency::Khz16,
};

/// A servo motor of middle size with buried magnets.
const AXIS: Machine = Machine {
    name: "axis",
    resistance: 2.5,
    direct_inductance: 8e-3,
    quadrature_inductance: 14e-3,
    flux: 0.15,
    pole_pairs: 3,
    inertia: 1e-3,
    coulomb_friction: 0.1,
    viscous_friction: 5e-4,
    increments: 1 << 20,
    bus: 560.0,
    peak_current: 15.0,
    measuring_range: 20.0,
    current: 5.0,
    ripple: 0.6,
    speed: 1_200.0,
    acceleration: 600.0,
    bandwidth: 700.0,
    frequency: PwmFrequency::Khz16,
};

/// Many turns of thin wire.
const TABLE: Machine = Machine {
    name: "table",
    resistance: 12.0,
    direct_inductance: 40e-3,
    quadrature_inductance: 46e-3,
    flux: 0.4,
    pole_pairs: 4,
    inertia: 4e-3,
    coulomb_friction: 0.25,
    viscous_friction: 2e-3,
    increments: 40_000,
    bus: 560.0,
    peak_current: 6.0,
    measuring_range: 8.0,
    current: 3.0,
    ripple: 0.3,
    speed: 600.0,
    acceleration: 300.0,
    bandwidth: 400.0,
    frequency: PwmFrequency::Khz8,
};

const MACHINES: [Machine; 4] = [WHEEL, SPINDLE, AXIS, TABLE];

fn parameters(machine: &Machine) -> IdentificationParameters {
    let milli = |value: f64| (value * 1_000.0).round() as u32;
    IdentificationParameters {
        peak_current: milli(machine.peak_current),
        current: milli(machine.current),
        ripple: milli(machine.ripple),
        pole_pairs: machine.pole_pairs,
        velocity: Velocity::from_ten_thousandths_rpm((machine.speed * 1e4) as i32),
        acceleration: Acceleration::from_milliradians_per_second_squared(milli(machine.acceleration)),
        movement: Position::from_bits(200 << 32),
        frequency: machine.frequency,
    }
}

/// Ticks until the sequence ends; also its longest way in revolutions and its ticks.
struct End<M> {
    result: Result<M, IdentificationError>,
    moved: f64,
    ticks: u32,
}

fn run<R: Default + PartialEq + core::fmt::Debug, M: Copy>(
    bench: &mut Bench,
    mut tick: impl FnMut(&IdentificationInputs) -> IdentificationOutput<R, M>,
    mut apply: impl FnMut(&mut Bench, R),
) -> End<M> {
    let start = bench.angle;
    let (mut moved, mut last) = (0.0_f64, 0);
    for ticks in 1..400_000 {
        let inputs = bench.begin_tick();
        let output = tick(&inputs);
        let result = match output.state {
            IdentificationState::Running { percent } => {
                assert!((last..100).contains(&percent), "{percent} after {last}");
                last = percent;
                apply(bench, output.request);
                moved = moved.max((bench.angle - start).abs() / std::f64::consts::TAU);
                continue;
            }
            IdentificationState::Done(measurement) => {
                assert!((97..100).contains(&last), "{last} percent at the end");
                Ok(measurement)
            }
            IdentificationState::Failed(error) => Err(error),
        };
        assert_eq!(output.request, R::default(), "nothing is asked for at the end");
        apply(bench, output.request);
        assert_eq!(tick(&bench.begin_tick()).request, R::default(), "nor later");
        return End { result, moved, ticks };
    }
    panic!("the sequence does not end");
}

fn resistance(bench: &mut Bench) -> End<ResistanceMeasurement> {
    let settings = ResistanceSettings::new(&parameters(&bench.machine)).unwrap();
    let mut sequence = ResistanceIdentification::start(settings, bench.position());
    run(bench, |inputs| sequence.tick(inputs), |bench, request| bench.end_tick(&request))
}

fn inductance(bench: &mut Bench) -> End<InductanceMeasurement> {
    let settings = InductanceSettings::new(&parameters(&bench.machine)).unwrap();
    let mut sequence = InductanceIdentification::start(settings, bench.position());
    run(bench, |inputs| sequence.tick(inputs), |bench, request| bench.end_tick(&request))
}

fn flux(bench: &mut Bench, parameters: &IdentificationParameters) -> End<FluxMeasurement> {
    let (milliohm, microhenry) = (bench.machine.resistance * 1e3, bench.machine.direct_inductance * 1e6);
    let settings = FluxSettings::new(parameters, milliohm.round() as u32, microhenry.round() as u32).unwrap();
    let mut sequence = FluxIdentification::start(settings, bench.position());
    run(bench, |inputs| sequence.tick(inputs), Bench::end_tick_with_velocity)
}

fn inertia(bench: &mut Bench, parameters: &IdentificationParameters) -> End<InertiaMeasurement> {
    let machine = &bench.machine;
    let torque_constant = 1.5e6 * f64::from(machine.pole_pairs) * machine.flux;
    let settings = InertiaSettings::new(parameters, torque_constant.round() as u32).unwrap();
    let mut sequence = InertiaIdentification::start(settings, bench.position());
    run(bench, |inputs| sequence.tick(inputs), Bench::end_tick_with_velocity)
}

fn close(what: &str, machine: &Machine, actual: f64, expected: f64, tolerance: f64) {
    let error = actual / expected - 1.0;
    println!("{}: {what} {actual}, {:+.2} %", machine.name, error * 100.0);
    assert!(error.abs() < tolerance, "{}: {what} {actual}, expected {expected}", machine.name);
}

/// Current at an angle that stands still; the rotor stands so many electrical degrees beside it.
fn held(machine: Machine, beside: f64) -> Bench {
    let mut bench = Bench::new(machine, beside.to_radians() / f64::from(machine.pole_pairs));
    bench.held_angle = Some(0);
    bench
}

#[test]
fn the_resistance_is_found_while_the_rotor_aligns_or_is_held() {
    for machine in MACHINES {
        for (fault, beside) in [(Fault::None, 140.0), (Fault::None, -30.0), (Fault::Blocked, 50.0)] {
            let mut bench = held(machine, beside);
            bench.fault = fault;
            let end = resistance(&mut bench);
            let milliohm = end.result.unwrap().resistance().unwrap();
            close("resistance", &machine, f64::from(milliohm) / 1e3, machine.resistance, 0.05);
            assert_eq!(end.ticks, 22_532);
            let electrical = end.moved * f64::from(machine.pole_pairs);
            if fault == Fault::None {
                let way: f64 = beside / 360.0;
                assert!((0.6 * way.abs()..1.0).contains(&electrical), "{electrical}");
            }
        }
    }
}

#[test]
fn the_inductances_of_both_axes_are_found_while_the_rotor_shivers() {
    for machine in MACHINES {
        let mut bench = held(machine, 3.0);
        let end = inductance(&mut bench);
        let inductances = end.result.unwrap().inductances().unwrap();
        close("Ld", &machine, f64::from(inductances.direct) / 1e6, machine.direct_inductance, 0.05);
        close("Lq", &machine, f64::from(inductances.quadrature) / 1e6, machine.quadrature_inductance, 0.05);
        assert!(end.moved * f64::from(machine.pole_pairs) < 0.02, "{}", end.moved);
        assert!((16_000..22_000).contains(&end.ticks), "{}", end.ticks);
    }
}

#[test]
fn the_flux_is_found_in_both_directions() {
    for machine in MACHINES {
        for sign in [1, -1] {
            let parameters = parameters(&machine);
            let velocity = Velocity::from_bits(sign * parameters.velocity.to_bits());
            let mut bench = Bench::new(machine, 1.0);
            let end = flux(&mut bench, &IdentificationParameters { velocity, ..parameters });
            let flux = end.result.unwrap().flux().unwrap();
            close("flux", &machine, f64::from(flux.linkage) / 1e6, machine.flux, 0.02);
            let torque_constant = 1.5 * f64::from(machine.pole_pairs) * machine.flux;
            close("torque constant", &machine, f64::from(flux.torque_constant) / 1e6, torque_constant, 0.02);
            let (speed, acceleration) = (machine.speed / 60.0, machine.acceleration / std::f64::consts::TAU);
            let way = speed * speed / acceleration + 0.77 * speed;
            assert!((0.95 * way..1.01 * way).contains(&end.moved), "{} revolutions, {way}", end.moved);
        }
    }
}

#[test]
fn inertia_and_friction_are_found_in_both_directions() {
    for machine in MACHINES {
        for sign in [1, -1] {
            let parameters = parameters(&machine);
            let velocity = Velocity::from_bits(sign * parameters.velocity.to_bits());
            let mut bench = Bench::new(machine, 1.0);
            let end = inertia(&mut bench, &IdentificationParameters { velocity, ..parameters });
            let result = end.result.unwrap().inertia().unwrap();
            close("inertia", &machine, f64::from(result.inertia) / 1e7, machine.inertia, 0.05);
            let torque_constant = 1.5e-3 * f64::from(machine.pole_pairs) * machine.flux;
            let coulomb = machine.coulomb_friction / torque_constant;
            close("Coulomb friction", &machine, f64::from(result.coulomb_friction), coulomb, 0.05);
            let viscous = machine.viscous_friction * std::f64::consts::TAU * 1_000.0 / 60.0 / torque_constant;
            close("viscous friction", &machine, f64::from(result.viscous_friction), viscous, 0.1);
            let (speed, acceleration) = (machine.speed / 60.0, machine.acceleration / std::f64::consts::TAU);
            let way = 1.25 * speed * speed / acceleration + 1.3 * speed;
            assert!((0.9 * way..1.02 * way).contains(&end.moved), "{} revolutions, {way}", end.moved);
        }
    }
}
