//! Identification of simulated motors through the real current loop.

use crate::identification_bench::{Bench, Fault, Machine};
use servo::current::PwmFrequency;
use servo::identification::{
    FluxIdentification, FluxMeasurement, FluxSettings, IdentificationError, IdentificationInputs, IdentificationOutput,
    IdentificationParameters, IdentificationState, InductanceIdentification, InductanceMeasurement, InductanceSettings,
    InertiaIdentification, InertiaMeasurement, InertiaSettings, ResistanceIdentification, ResistanceMeasurement,
    ResistanceSettings,
};
use servo::units::{Acceleration, Position, Velocity};

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
    let start = bench.turns();
    let (mut moved, mut last) = (0.0_f64, 0);
    for ticks in 1..400_000 {
        let inputs = bench.begin_tick();
        let output = tick(&inputs);
        let result = match output.state {
            IdentificationState::Running { percent } => {
                assert!((last..100).contains(&percent), "{percent} after {last}");
                last = percent;
                apply(bench, output.request);
                moved = moved.max((bench.turns() - start).abs());
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
    let milliohm = (bench.machine.resistance * 1e3).round() as u32;
    flux_with(bench, parameters, milliohm)
}

fn flux_with(bench: &mut Bench, parameters: &IdentificationParameters, milliohm: u32) -> End<FluxMeasurement> {
    let microhenry = bench.machine.direct_inductance * 1e6;
    let settings = FluxSettings::new(parameters, milliohm, microhenry.round() as u32).unwrap();
    let mut sequence = FluxIdentification::start(settings, bench.position());
    run(bench, |inputs| sequence.tick(inputs), Bench::end_tick_with_velocity)
}

fn inertia(bench: &mut Bench, parameters: &IdentificationParameters) -> End<InertiaMeasurement> {
    let torque_constant = 1.5e6 * f64::from(bench.machine.pole_pairs) * bench.machine.flux;
    inertia_with(bench, parameters, torque_constant.round() as u32)
}

fn inertia_with(
    bench: &mut Bench,
    parameters: &IdentificationParameters,
    torque_constant: u32,
) -> End<InertiaMeasurement> {
    let settings = InertiaSettings::new(parameters, torque_constant).unwrap();
    let mut sequence = InertiaIdentification::start(settings, bench.position());
    run(bench, |inputs| sequence.tick(inputs), Bench::end_tick_with_velocity)
}

fn close(what: &str, machine: &Machine, actual: f64, expected: f64, tolerance: f64) {
    let error = actual / expected - 1.0;
    println!("{}: {what} {actual}, {:+.2} %", machine.name, error * 100.0);
    assert!(error.abs() < tolerance, "{}: {what} {actual}, expected {expected}", machine.name);
}

/// Current at an electrical angle that stands still, in degrees; the rotor stands so many degrees beside it.
fn held(machine: Machine, angle: f64, beside: f64) -> Bench {
    let mut bench = Bench::new(machine, (angle + beside).to_radians() / f64::from(machine.pole_pairs));
    bench.held_angle = Some((angle / 360.0 * 2_f64.powi(32)) as u32);
    bench
}

#[test]
fn the_resistance_is_found_while_the_rotor_aligns() {
    for machine in MACHINES {
        // At 30 degrees a phase is without current.
        for (angle, beside) in [(0.0, 140.0), (30.0, -30.0), (200.0, 90.0)] {
            let mut bench = held(machine, angle, beside);
            let end = resistance(&mut bench);
            let milliohm = end.result.unwrap().resistance().unwrap();
            close("resistance", &machine, f64::from(milliohm) / 1e3, machine.resistance, 0.05);
            assert_eq!(end.ticks, 22_531);
            let electrical = end.moved * f64::from(machine.pole_pairs) * 360.0;
            assert!((0.7 * beside.abs()..2.0 * beside.abs()).contains(&electrical), "{electrical}");
        }
    }
}

#[test]
fn the_resistance_is_found_with_the_rotor_held_at_any_angle() {
    for machine in MACHINES {
        for (angle, beside) in [(15.0, 50.0), (100.0, -120.0), (230.0, 180.0)] {
            let mut bench = held(machine, angle, beside);
            bench.fault = Fault::Blocked;
            let end = resistance(&mut bench);
            let milliohm = end.result.unwrap().resistance().unwrap();
            close("resistance", &machine, f64::from(milliohm) / 1e3, machine.resistance, 0.05);
            assert_eq!(end.moved, 0.0);
        }
    }
}

#[test]
fn the_inductances_of_both_axes_are_found_while_the_rotor_shivers_or_is_held() {
    for machine in MACHINES {
        for (angle, fault) in [(0.0, Fault::None), (240.0, Fault::None), (70.0, Fault::Blocked)] {
            let beside = if fault == Fault::None { 3.0 } else { 0.0 };
            let mut bench = held(machine, angle, beside);
            bench.fault = fault;
            let end = inductance(&mut bench);
            let inductances = end.result.unwrap().inductances().unwrap();
            close("Ld", &machine, f64::from(inductances.direct) / 1e6, machine.direct_inductance, 0.05);
            close("Lq", &machine, f64::from(inductances.quadrature) / 1e6, machine.quadrature_inductance, 0.05);
            let electrical = end.moved * f64::from(machine.pole_pairs) * 360.0;
            assert!(electrical < 2.0 * beside + 0.01, "{electrical} degrees");
            assert!((16_000..22_000).contains(&end.ticks), "{}", end.ticks);
        }
    }
}

#[test]
fn the_late_compensation_of_a_phase_that_crosses_zero_makes_the_quadrature_inductance_an_eighth_too_high() {
    let end = inductance(&mut held(SPINDLE, 37.0, 0.0));
    let inductances = end.result.unwrap().inductances().unwrap();
    close("Ld", &SPINDLE, f64::from(inductances.direct) / 1e6, SPINDLE.direct_inductance, 0.05);
    let error = f64::from(inductances.quadrature) / 1e6 / SPINDLE.quadrature_inductance - 1.0;
    // The inverter turns within 0.05 A, the compensation within 0.08 A.
    assert!((0.11..0.15).contains(&error), "{error}");
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
            let viscous = machine.viscous_friction * std::f64::consts::TAU * 1e6 / 60.0 / torque_constant;
            close("viscous friction", &machine, f64::from(result.viscous_friction), viscous, 0.15);
            let (speed, acceleration) = (machine.speed / 60.0, machine.acceleration / std::f64::consts::TAU);
            let way = speed * speed / acceleration + 1.02 * speed;
            assert!((0.95 * way..1.01 * way).contains(&end.moved), "{} revolutions, {way}", end.moved);
        }
    }
}

fn is_out_of_range<R>(result: Result<R, IdentificationError>) -> bool {
    matches!(result, Err(IdentificationError::OutOfRange { actual, minimum, maximum })
        if !(minimum..=maximum).contains(&actual))
}

/// The error of a sequence.
fn error<M>(end: &End<M>) -> IdentificationError {
    end.result.as_ref().err().copied().expect("the sequence fails")
}

fn with_fault(mut bench: Bench, fault: Fault) -> Bench {
    bench.fault = fault;
    bench
}

#[test]
fn a_resistance_that_cannot_be_measured_is_refused_with_its_cause() {
    let open = held(Machine { resistance: 200.0, ..TABLE }, 0.0, 0.0);
    let mut bench = with_fault(open, Fault::Blocked);
    assert_eq!(error(&resistance(&mut bench)), IdentificationError::VoltageLimit);

    let mut bench = with_fault(held(AXIS, 0.0, 0.0), Fault::BridgeOff(0.0));
    // 2.5 of 15 A
    let expected = 11_184_810;
    assert_eq!(error(&resistance(&mut bench)), IdentificationError::CurrentNotReached { actual: 0, expected });

    // Two thirds of it along the axis: 2.5 and 3 V at 5 A.
    for ohm in [0.75, 0.9] {
        let mut bench = with_fault(held(AXIS, 0.0, 0.0), Fault::LooseContact(ohm));
        assert_eq!(error(&resistance(&mut bench)), IdentificationError::Unstable);
    }

    // Two phases come out of the band of the dead-time compensation on the way.
    let low = Machine { current: 0.47, ripple: 0.1, resistance: 1.0, ..AXIS };
    let mut bench = with_fault(held(low, 0.0, 0.0), Fault::Blocked);
    assert_eq!(error(&resistance(&mut bench)), IdentificationError::Unstable);

    let mut bench = with_fault(held(AXIS, 0.0, 0.0), Fault::Load(8.0, 0.6));
    let IdentificationError::TooMuchMovement { actual, maximum } = error(&resistance(&mut bench)) else {
        panic!("the load turns the motor");
    };
    assert_eq!(maximum, (1 << 32) / 3);
    assert!((-maximum * 11 / 10..-maximum).contains(&actual), "{actual}");

    let mut bench = with_fault(held(Machine { resistance: 0.003, ..WHEEL }, 0.0, 0.0), Fault::Blocked);
    assert!(is_out_of_range(resistance(&mut bench).result.unwrap().resistance()));
}

#[test]
fn inductances_that_cannot_be_measured_are_refused_with_their_cause() {
    let mut bench = with_fault(held(AXIS, 0.0, 0.0), Fault::BridgeOff(0.0));
    // 3.75 of 15 A
    let expected = 16_777_216;
    let not_reached = error(&inductance(&mut bench));
    assert!(
        matches!(not_reached, IdentificationError::CurrentNotReached { actual: 0, expected: e } if (e - expected).abs() < 4),
        "{not_reached:?}"
    );

    let mut bench = with_fault(held(Machine { quadrature_inductance: 0.5, ..SPINDLE }, 0.0, 0.0), Fault::Blocked);
    assert_eq!(error(&inductance(&mut bench)), IdentificationError::VoltageLimit);

    let mut bench = with_fault(held(AXIS, 0.0, 0.0), Fault::BridgeOff(1.3));
    let end = inductance(&mut bench);
    assert_eq!(error(&end), IdentificationError::CurrentNotReached { actual: 0, expected: 2_684_355 });
    // 1.28 s until the current stands, and 32 trials of 12 ms.
    assert!((13_200..13_400).contains(&end.ticks), "{}", end.ticks);

    // An axis with hardly any inductance: the current loop swings, or the first trial makes more current than was asked for.
    for bandwidth in [700.0, 1.0] {
        let shorted = Machine { quadrature_inductance: 30e-6, resistance: 0.05, bandwidth, ..AXIS };
        let mut bench = with_fault(held(shorted, 0.0, 0.0), Fault::Blocked);
        assert_eq!(error(&inductance(&mut bench)), IdentificationError::Unstable);
    }

    let mut bench = with_fault(held(AXIS, 0.0, 0.0), Fault::Load(8.0, 0.6));
    assert!(matches!(error(&inductance(&mut bench)), IdentificationError::TooMuchMovement { .. }));
}

#[test]
fn a_flux_that_cannot_be_measured_is_refused_with_its_cause() {
    let all = parameters(&AXIS);
    let mut bench = with_fault(Bench::new(AXIS, 0.0), Fault::Blocked);
    assert_eq!(error(&flux(&mut bench, &all)), IdentificationError::NoMovement);

    let mut bench = Bench::new(Machine { bus: 90.0, ..AXIS }, 0.0);
    assert_eq!(error(&flux(&mut bench, &all)), IdentificationError::VoltageLimit);

    // In the window of each plateau.
    for from in [0.45, 1.1] {
        let mut bench = with_fault(Bench::new(AXIS, 0.0), Fault::Load(3.0, from));
        assert_eq!(error(&flux(&mut bench, &all)), IdentificationError::Unstable, "{from} s");
    }

    let movement = Position::from_bits(5 << 32);
    let end = flux(&mut Bench::new(AXIS, 0.0), &IdentificationParameters { movement, ..all });
    assert!(matches!(error(&end), IdentificationError::TooMuchMovement { .. }));
    assert!((5.0..5.1).contains(&end.moved), "{}", end.moved);

    let mut bench = Bench::new(AXIS, 0.0);
    assert!(is_out_of_range(flux_with(&mut bench, &all, 1_000_000).result.unwrap().flux()));
}

#[test]
fn an_inertia_that_cannot_be_measured_is_refused_with_its_cause() {
    let all = parameters(&AXIS);
    let mut bench = with_fault(Bench::new(AXIS, 0.0), Fault::Blocked);
    assert_eq!(error(&inertia(&mut bench, &all)), IdentificationError::NoMovement);

    let mut bench = Bench::new(Machine { bus: 90.0, ..AXIS }, 0.0);
    assert_eq!(error(&inertia(&mut bench, &all)), IdentificationError::VoltageLimit);
    // Enough for the velocity, too little for a steeper ramp.
    let mut bench = Bench::new(Machine { bus: 127.0, ..AXIS }, 0.0);
    assert!(inertia(&mut bench, &all).result.is_ok());
    let steep = parameters(&Machine { acceleration: 3_000.0, ..AXIS });
    let mut bench = Bench::new(Machine { bus: 127.0, ..AXIS }, 0.0);
    assert_eq!(error(&inertia(&mut bench, &steep)), IdentificationError::VoltageLimit);

    // In the window of each plateau.
    for from in [0.45, 1.1, 1.7] {
        let mut bench = with_fault(Bench::new(AXIS, 0.0), Fault::Load(3.0, from));
        assert_eq!(error(&inertia(&mut bench, &all)), IdentificationError::Unstable, "{from} s");
    }

    let movement = Position::from_bits(5 << 32);
    let end = inertia(&mut Bench::new(AXIS, 0.0), &IdentificationParameters { movement, ..all });
    assert!(matches!(error(&end), IdentificationError::TooMuchMovement { .. }));

    let mut bench = Bench::new(AXIS, 0.0);
    assert!(is_out_of_range(inertia_with(&mut bench, &all, 1).result.unwrap().inertia()));
}

#[test]
fn parameters_out_of_range_are_refused() {
    let all = parameters(&AXIS);
    for refused in [
        IdentificationParameters { peak_current: 255, ..all },
        IdentificationParameters { current: all.peak_current / 32 - 1, ..all },
        IdentificationParameters { current: all.peak_current + 1, ..all },
        IdentificationParameters { ripple: all.peak_current / 256 - 1, ..all },
        IdentificationParameters { ripple: all.current / 2 + 1, ..all },
        IdentificationParameters { pole_pairs: 0, ..all },
        IdentificationParameters { pole_pairs: 65, ..all },
    ] {
        assert!(ResistanceSettings::new(&refused).is_err(), "{refused:?}");
        assert!(InductanceSettings::new(&refused).is_err(), "{refused:?}");
    }
    assert!(FluxSettings::new(&IdentificationParameters { pole_pairs: 0, ..all }, 1, 1).is_err());
    assert!(InertiaSettings::new(&all, 0).is_err());
    assert!(InertiaSettings::new(&IdentificationParameters { velocity: Velocity::ZERO, ..all }, 1).is_err());
}
