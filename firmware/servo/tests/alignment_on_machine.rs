//! Alignment of a motor on its bridge, with what a real one can be wired and built wrong.

use plant::{Cogging, Machine, ReferenceAxis, Stiction, Wiring};
use servo::arithmetic::Rotation;
use servo::axis::current_gains;
use servo::commutation::{Alignment, AlignmentError, AlignmentSettings, AlignmentState, CommutationSettings};
use servo::current::{CurrentCommand, CurrentLoopParameters, PwmFrequency};
use servo::encoder::{Encoder, EncoderSettings};
use servo::units::CurrentFraction;

use crate::current_bench::{Bench, angle_of};

/// Of peak: 5 A, 4 Nm.
const CURRENT: f64 = 0.25;
const ANGLES: u32 = 16;

/// The end of an alignment, with electrical degrees.
#[derive(Debug)]
struct Run {
    state: AlignmentState,
    moved: f64,
    error: f64,
}

/// The catalogue motor with its d axis at so many sixteenths of an electrical turn and a little.
fn axis(sixteenths: u32) -> ReferenceAxis {
    let mut axis = ReferenceAxis::catalogue();
    let turns = f64::from(sixteenths) / f64::from(ANGLES) + 0.002;
    axis.machine.encoder.electrical_zero = turns / f64::from(axis.machine.windings.pole_pairs);
    axis
}

fn run(axis: ReferenceAxis, break_it: impl FnOnce(&mut Machine)) -> Run {
    let settings = axis.machine;
    let windings = settings.windings;
    let (pole_pairs, increments) = (windings.pole_pairs as u8, settings.encoder.increments_per_revolution);
    let gains = current_gains(
        (windings.resistance * 1e3) as u32,
        (windings.inductance_d * 1e6) as u32,
        1_000,
        PwmFrequency::Khz16,
    )
    .unwrap();
    let parameters = CurrentLoopParameters {
        peak_current: axis.peak_current,
        measuring_range: (settings.current_sensors.range * 1e3).round() as u32,
        proportional_gain: gains.proportional,
        integral_time: gains.integral_time,
        frequency: PwmFrequency::Khz16,
        dead_time: 1_000,
        dead_time_band: axis.peak_current / 100,
    };
    let mut bench = Bench::new(settings, &parameters);
    break_it(&mut bench.machine);
    let mut encoder = Encoder::new(EncoderSettings::new(increments).unwrap(), 0);
    let commutation = CommutationSettings::new(pole_pairs, increments).unwrap();
    let alignment = AlignmentSettings::new(commutation, CurrentFraction::from_num(CURRENT)).unwrap();
    let mut alignment = Alignment::start(alignment, encoder.position());
    let electrical = |machine: &mut Machine, at| {
        f64::from(pole_pairs) * (machine.angle(at) + settings.encoder.electrical_zero + 0.5 / f64::from(increments))
    };
    let start = electrical(&mut bench.machine, 0);
    let mut moved = 0.0_f64;
    for _ in 0..40_000 {
        let output = alignment.tick(encoder.update(bench.machine.encoder_count(bench.time)));
        let now = electrical(&mut bench.machine, bench.time);
        if output.state != AlignmentState::Running {
            let error = f64::from(output.angle.wrapping_sub(angle_of(now)) as i32) / 4_294_967_296.0 * 360.0;
            return Run { state: output.state, moved, error };
        }
        moved = moved.max((now - start).abs() * 360.0);
        let command = CurrentCommand {
            direct: CurrentCommand::reference(output.id),
            quadrature: CurrentCommand::reference(output.iq),
            angle: output.angle,
            count: 0,
            angle_per_increment: 0,
            ahead: Rotation::NONE,
            direct_voltage: 0,
            quadrature_voltage: 0,
            bus: bench.bus(),
        };
        for _ in 0..2 {
            bench.cycle(&command, |_, command, _| command.angle_at(0));
        }
    }
    panic!("the alignment does not end");
}

fn axes() -> impl Iterator<Item = ReferenceAxis> {
    (0..ANGLES).map(axis)
}

/// Every one is aligned after little movement; gives the largest error.
#[track_caller]
fn largest_error(axes: impl Iterator<Item = ReferenceAxis>) -> f64 {
    axes.map(|axis| {
        let run = run(axis, |_| {});
        assert_eq!(run.state, AlignmentState::Done, "{run:?}");
        assert!((3.5..6.0).contains(&run.moved), "{run:?}");
        run.error.abs()
    })
    .fold(0.0, f64::max)
}

#[test]
fn a_motor_is_found_from_every_angle_with_the_accuracy_that_its_friction_leaves() {
    // 0.1 of 4 Nm hold the rotor up to asin 0.025 = 1.43 degrees beside the field, of which the swaying leaves a part.
    let error = largest_error(axes());
    assert!((0.3..1.2).contains(&error), "{error}");
}

#[test]
fn teeth_and_a_shaft_that_sticks_cost_accuracy_and_not_more() {
    let error = largest_error(axes().map(|mut axis| {
        axis.machine.effects.cogging = Some(Cogging::of(12, 8, 0.03 * 4.0));
        axis
    }));
    assert!((0.3..1.7).contains(&error), "{error}");
    let error = largest_error(axes().map(|mut axis| {
        axis.machine.effects.stiction = Some(Stiction { static_torque: 0.15, stribeck_velocity: 1.0 });
        axis
    }));
    assert!((0.3..1.3).contains(&error), "{error}");
}

#[test]
fn two_swapped_phases_are_a_wrong_direction_from_every_angle() {
    for (one, other) in [(0, 1), (0, 2), (1, 2)] {
        for mut axis in axes() {
            axis.machine.effects.wiring = Some(Wiring::swapped(one, other));
            let run = run(axis, |_| {});
            assert_eq!(run.state, AlignmentState::Failed(AlignmentError::WrongDirection), "{run:?}");
            assert!((5.0..9.0).contains(&run.moved), "{run:?}");
        }
    }
}

#[test]
fn phases_that_are_turned_on_by_one_are_part_of_the_angle_that_is_found() {
    for mut axis in axes() {
        axis.machine.effects.wiring = Some(Wiring::turned_on());
        let run = run(axis, |_| {});
        assert_eq!(run.state, AlignmentState::Done, "{run:?}");
        // The field of the first leg is that of the second winding: by a third of a turn less is asked for.
        assert!((run.error + 120.0).abs() < 1.2, "{run:?}");
    }
}

#[test]
fn an_open_phase_is_not_always_found_by_the_alignment_alone() {
    // The current loop makes no current along the axis of the open phase whatever is asked for; what remains swings the rotor about a wrong
    // place in a third of the cases. Hence the test of the phases before it (`open_phase.rs`): 48 of 48.
    let (mut done, mut named, mut other) = (0, 0, 0);
    let mut worst = 0.0_f64;
    for leg in 0..3 {
        for axis in axes() {
            let run = run(axis, |machine| machine.open_phase(leg, true, 0));
            assert!(run.moved < 18.0, "{run:?}");
            match run.state {
                AlignmentState::Done => {
                    done += 1;
                    worst = worst.max(run.error.abs());
                }
                AlignmentState::Failed(AlignmentError::PhaseMissing) => named += 1,
                _ => other += 1,
            }
        }
    }
    println!("taken for aligned {done}, at worst {worst:.0} degrees beside; named {named}, otherwise refused {other}");
    assert!((10..22).contains(&done) && (60.0..90.0).contains(&worst), "{done} {worst}");
    assert!(named > 12 && other > 8, "{named} {other}");
}
