//! P-0-0240 on every reference axis: what it finds, what an observer outside of the drive finds, and what it leaves alone.
//!
//! The observer sees torque and velocity of the machine's shaft, while a load swings it, and knows masses and shaft from the data sheet. Of the drive
//! it asks nothing.

use std::cell::Cell;
use std::f64::consts::TAU;
use std::rc::Rc;

use bench::{DriveSetup, parameters_of, product};
use plant::{Load, ReferenceAxis, Stiction};
use ring::Nanoseconds;
use ring::ident::{Idn, Value};
use ring::master::{CommandValues, DriveScript, MasterScript, Motion, Telegram};

use crate::running::{ADDRESS, Bench};

const P: u16 = 0x8000;
const TUNE: u16 = P | 240;
const PROGRESS: u16 = P | 227;
const FINDING: u16 = P | 228;
const EXECUTED: u64 = 3;
const EXECUTING: u64 = 7;
const FAILED: u64 = 0xF;

/// Everything that the tuning may write.
const WRITTEN: [u16; 16] = [
    100,
    101,
    104,
    155,
    348,
    P | 142,
    P | 170,
    P | 171,
    P | 172,
    P | 173,
    P | 174,
    P | 175,
    P | 176,
    P | 177,
    P | 221,
    P | 231,
];

/// An axis in velocity mode, held by HALT as long as the master says so.
struct Axis {
    bench: Bench,
    reference: ReferenceAxis,
    /// HALT, and the velocity in 0.0001 rpm.
    command: Rc<Cell<(bool, i32)>>,
}

type Complex = (f64, f64);

fn quotient(a: Complex, b: Complex) -> Complex {
    let square = b.0 * b.0 + b.1 * b.1;
    ((a.0 * b.0 + a.1 * b.1) / square, (a.1 * b.0 - a.0 * b.1) / square)
}

fn product_of(a: Complex, b: Complex) -> Complex {
    (a.0 * b.0 - a.1 * b.1, a.0 * b.1 + a.1 * b.0)
}

impl Axis {
    fn halted(reference: ReferenceAxis) -> Self {
        let mut drive = DriveScript::new(ADDRESS, Telegram::standard(2).unwrap())
            .with(Idn::OPERATION_MODE, Value::Word(2))
            .with_all(parameters_of(&reference));
        if reference.machine.brake.is_some() {
            let encoder = reference.machine.encoder;
            let pole_pairs = f64::from(reference.machine.windings.pole_pairs);
            let angle = (encoder.electrical_zero * pole_pairs).fract() * 36_000.0;
            drive = drive
                .with(product(120), Value::Word(3))
                .with(product(118), Value::Long(angle as u32))
                .with(Idn(206), Value::Word(60))
                .with(Idn(207), Value::Word(60));
        }
        let command = Rc::new(Cell::new((true, 0)));
        let asked = command.clone();
        let motion = Motion::new(1_000_000, move |_| {
            let (halt, velocity) = asked.get();
            CommandValues { halt, ..CommandValues::at_velocity(velocity) }
        });
        let script = MasterScript { motion: Some(motion), stops_at_refusals: false, ..MasterScript::new(vec![drive]) };
        let setup = DriveSetup { axis: reference, ..DriveSetup::new(ADDRESS) };
        let mut bench = Bench::new(setup, script);
        bench.run_to_operation();
        bench.run(Nanoseconds::from_millis(500));
        Self { bench, reference, command }
    }

    fn revolutions(&mut self) -> f64 {
        let now = self.bench.world.now().0;
        self.bench.drive.motor_side.borrow_mut().machine().angle(now)
    }

    fn numbers<const N: usize>(&mut self, idns: [u16; N]) -> [u64; N] {
        idns.map(|idn| self.bench.number(idn))
    }

    fn start(&mut self) {
        self.bench.write(TUNE, Value::Word(3)).unwrap();
    }

    /// Waits until the command has come to so many per cent, or to its end.
    fn wait(&mut self, percent: u64) -> u64 {
        for _ in 0..1_000 {
            self.bench.run(Nanoseconds::from_millis(200));
            let [status, progress] = self.numbers([TUNE, PROGRESS]);
            if status != EXECUTING || progress >= percent {
                return status;
            }
        }
        panic!("the tuning does not end: {} %", self.bench.number(PROGRESS));
    }

    /// Tunes to the end, successfully.
    fn tune(&mut self) {
        self.start();
        assert_eq!(self.wait(101), EXECUTED, "{}", self.bench.text(FINDING));
        assert_eq!(self.numbers([PROGRESS]), [100]);
    }

    /// From the motor's torque to the velocity of its shaft, by the data sheet.
    fn shaft(&self, hertz: f64) -> Complex {
        let mechanics = &self.reference.machine.mechanics;
        let s = TAU * hertz;
        let motor = mechanics.rotor_inertia;
        match mechanics.load {
            None => quotient((1.0, 0.0), (mechanics.viscous_friction, s * motor)),
            Some(Load { inertia, stiffness, damping, .. }) => {
                let free = (stiffness - inertia * s * s, damping * s);
                let both = motor + inertia;
                let swing = (both * stiffness - motor * inertia * s * s, both * damping * s);
                quotient(free, product_of((0.0, s), swing))
            }
        }
    }

    /// The open velocity loop at about this frequency: what a load that swings makes the motor do against the shaft's velocity.
    fn open_loop(&mut self, hertz: f64) -> (f64, Complex) {
        const RATE: f64 = 16_000.0;
        let periods = (hertz * 0.4).ceil().max(8.0);
        let samples = (periods * RATE / hertz).round();
        let hertz = periods * RATE / samples;
        let amplitude = 0.15 * self.reference.motor.peak_torque;
        let (mut torque, mut velocity) = ((0.0, 0.0), (0.0, 0.0));
        let settling = 3_200.0;
        for n in 0..(settling + samples) as u32 {
            let angle = TAU * hertz * (f64::from(n) - settling) / RATE;
            let now = self.bench.world.now().0;
            self.bench.drive.motor_side.borrow_mut().machine().set_load_torque(amplitude * angle.sin(), now);
            self.bench.run(Nanoseconds(62_500));
            if f64::from(n) >= settling {
                let now = self.bench.world.now().0;
                let mut motor_side = self.bench.drive.motor_side.borrow_mut();
                let machine = motor_side.machine();
                let add = |sum: &mut Complex, value: f64| {
                    sum.0 += value * angle.cos();
                    sum.1 -= value * angle.sin();
                };
                add(&mut torque, machine.torque(now));
                add(&mut velocity, machine.velocity(now));
            }
        }
        let now = self.bench.world.now().0;
        self.bench.drive.motor_side.borrow_mut().machine().set_load_torque(0.0, now);
        let (real, imaginary) = product_of(quotient(torque, velocity), self.shaft(hertz));
        (hertz, (-real, -imaginary))
    }

    /// Crossing in Hz, phase margin in degrees and gain margin in dB that the observer finds around this crossing.
    fn observed(&mut self, about: f64) -> (f64, f64, f64) {
        self.command.set((false, 1_000_000));
        self.bench.run(Nanoseconds::from_millis(500));
        let ratios = [0.8, 0.95, 1.1, 1.3, 1.8, 2.4, 3.0, 3.7, 4.5, 5.5];
        let points = ratios.map(|ratio| self.open_loop(about * ratio));
        let decibels = |open: Complex| 20.0 * open.0.hypot(open.1).log10();
        // Above -180 degrees.
        let above = |open: Complex| (-open.1).atan2(-open.0).to_degrees();
        let between = |pair: &[(f64, Complex)], share: f64| {
            let (before, behind) = (pair[0].1, pair[1].1);
            let turn = (above(behind) - above(before) + 180.0).rem_euclid(360.0) - 180.0;
            let hertz = pair[0].0 * (pair[1].0 / pair[0].0).powf(share);
            (hertz, decibels(before) + share * (decibels(behind) - decibels(before)), above(before) + share * turn)
        };
        let crossing = points.windows(2).find(|pair| decibels(pair[0].1) >= 0.0 && decibels(pair[1].1) < 0.0);
        let crossing = crossing.unwrap_or_else(|| panic!("no crossing in {points:?}"));
        let share = decibels(crossing[0].1) / (decibels(crossing[0].1) - decibels(crossing[1].1));
        let (hertz, _, phase) = between(crossing, share);
        let turning = points.windows(2).find(|pair| above(pair[0].1) >= 0.0 && above(pair[1].1) < 0.0);
        let turning = turning.unwrap_or_else(|| panic!("the phase does not turn in {points:?}"));
        let share = above(turning[0].1) / (above(turning[0].1) - above(turning[1].1));
        let (_, gain, _) = between(turning, share);
        (hertz, phase, -gain)
    }

    /// A velocity command that swings by 60 rpm around 150 rpm with 10 Hz: how far the shaft swings, as a share of that.
    fn follows_a_sine(&mut self) -> f64 {
        let mut sum = (0.0, 0.0);
        for cycle in 0..500 {
            let angle = TAU * 10.0 * f64::from(cycle) * 0.002;
            self.command.set((false, 1_500_000 + (600_000.0 * angle.sin()) as i32));
            self.bench.run(Nanoseconds::from_millis(2));
            if cycle >= 200 {
                let rpm = self.bench.rpm();
                sum = (sum.0 + rpm * angle.cos(), sum.1 + rpm * angle.sin());
            }
        }
        f64::hypot(sum.0, sum.1) / 150.0 / 60.0
    }
}

/// A precise axis that is tuned for some seconds, for the laws.
pub(crate) fn tuned_for_a_while() -> Bench {
    let mut axis = Axis::halted(ReferenceAxis::precise());
    axis.start();
    axis.bench.run(Nanoseconds::from_millis(4_000));
    axis.bench
}

#[track_caller]
fn within(what: &str, value: f64, range: std::ops::Range<f64>) {
    println!("{what}: {value:.3}");
    assert!(range.contains(&value), "{what}: {value}, expected {range:?}");
}

/// Tunes an axis; an observer then finds the margins that the drive reports, which are those that were asked for.
fn is_tuned(reference: ReferenceAxis) -> Axis {
    let mut axis = Axis::halted(reference);
    axis.tune();
    let [phase, gain, crossing] = axis.numbers([P | 244, P | 245, P | 246]);
    let (phase, gain, crossing) = (phase as f64 / 10.0, gain as f64 / 10.0, crossing as f64 / 100.0);
    // 45 degrees and 8 dB, less what a verification may fall short by.
    within("phase margin of the drive in degrees", phase, 42.0..60.0);
    within("gain margin of the drive in dB", gain, 7.0..25.0);
    let (hertz, observed_phase, observed_gain) = axis.observed(crossing);
    within("crossing observed, to that of the drive", hertz / crossing, 0.9..1.13);
    within("phase margin observed, in degrees", observed_phase, 40.0..62.0);
    within("beside that of the drive", observed_phase - phase, -5.0..5.0);
    within("gain margin observed, in dB", observed_gain, 6.0..26.0);
    within("beside that of the drive", observed_gain - gain, -2.0..2.0);
    within("share of a sine that the shaft follows", axis.follows_a_sine(), 0.85..1.35);
    axis
}

/// The moment of inertia that was found, to that of the machine.
fn inertia_found(axis: &mut Axis) -> f64 {
    let mechanics = axis.reference.machine.mechanics;
    let inertia = mechanics.rotor_inertia + mechanics.load.map_or(0.0, |load| load.inertia);
    axis.numbers([P | 221])[0] as f64 * 1e-7 / inertia
}

#[test]
fn the_press_is_tuned_with_its_friction_and_a_low_pass_for_its_encoder() {
    let mut axis = is_tuned(ReferenceAxis::press());
    within("inertia found", inertia_found(&mut axis), 0.97..1.03);
    let [bits, crossing, resonance, coulomb] = axis.numbers([P | 243, P | 246, P | 247, 155]);
    // A count a tick is a quarter of the peak current at 40 Hz; 6 Nm at 2 Nm/A are 12 % of 25 A.
    within("crossing in Hz", crossing as f64 / 100.0, 38.0..43.0);
    assert_eq!((bits & 0b1011, resonance), (0b1000, 0), "a low-pass, no resonance, no notch");
    within("friction in 0.1 %", coulomb as f64, 115.0..125.0);
}

#[test]
fn the_small_machine_tool_is_tuned() {
    let mut axis = is_tuned(ReferenceAxis::small_cnc());
    within("inertia found", inertia_found(&mut axis), 0.97..1.03);
}

#[test]
fn the_precise_axis_is_tuned_as_fast_as_its_reference_gains() {
    let mut axis = is_tuned(ReferenceAxis::precise());
    within("inertia found", inertia_found(&mut axis), 0.97..1.03);
    let [crossing, gain] = axis.numbers([P | 246, 100]);
    // Worked out by hand for 1 200 rad/s, at 2.4 A s/rad of amplitude.
    within("crossing in Hz", crossing as f64 / 100.0, 175.0..215.0);
    within("S-0-0100 in A s/rad", gain as f64 / 1_000.0 * core::f64::consts::SQRT_2, 2.2..2.8);
}

#[test]
fn the_vertical_axis_is_tuned_with_its_load_and_its_resonance_is_found() {
    let mut axis = is_tuned(ReferenceAxis::vertical());
    within("inertia found", inertia_found(&mut axis), 0.97..1.03);
    // sqrt(8 000 * 2 / 0.0005) rad/s.
    within("resonance in Hz", axis.numbers([P | 247])[0] as f64 / 100.0, 882.0..919.0);
}

#[test]
fn the_catalogue_motor_is_tuned() {
    let mut axis = is_tuned(ReferenceAxis::catalogue());
    within("inertia found", inertia_found(&mut axis), 0.97..1.03);
}

/// A motor of 0.0008 kg m² with a load so many times that, which swing against each other at so many Hz with this damping ratio; slow gains.
fn elastic(ratio: f64, hertz: f64, damping: f64) -> ReferenceAxis {
    let mut axis = ReferenceAxis::precise();
    let inertia = 0.000_8 * ratio;
    let both = 1.0 / 0.000_8 + 1.0 / inertia;
    let s = TAU * hertz;
    axis.machine.mechanics.load =
        Some(Load { inertia, stiffness: s * s / both, damping: 2.0 * damping * s / both, backlash: 0.0 });
    axis.gains.velocity_gain = 2;
    axis.gains.integral_time = 400;
    axis
}

#[test]
fn a_resonance_is_found_within_two_per_cent_and_gets_a_notch_where_that_makes_the_axis_faster() {
    let mut notches = 0;
    for (ratio, hertz) in [(0.5, 420.0), (2.0, 550.0), (4.0, 700.0)] {
        let mut axis = Axis::halted(elastic(ratio, hertz, 0.03));
        axis.tune();
        let [bits, phase, gain, resonance, kind, notch] =
            axis.numbers([P | 243, P | 244, P | 245, P | 247, P | 170, P | 171]);
        println!("{ratio}, {hertz} Hz: {bits:b}, {phase}, {gain}, {resonance}");
        within("resonance found", resonance as f64 / 100.0 / hertz, 0.98..1.02);
        assert_eq!(bits & 1, 1, "{ratio}, {hertz} Hz: a resonance");
        assert_eq!(bits & 0b10 != 0, kind == 2, "{ratio}, {hertz} Hz: P-0-0243 and P-0-0170");
        if kind == 2 {
            within("the notch", notch as f64 / 10.0 / hertz, 0.98..1.02);
            notches += 1;
        }
        // With the gain margin ending the search there is more of it.
        within("phase margin in degrees", phase as f64 / 10.0, 42.0..90.0);
    }
    assert!(notches > 0, "none of them is faster with a notch");
}

#[test]
fn stiction_backlash_and_noise_do_not_mislead_it() {
    let mut reference = elastic(2.0, 550.0, 0.03);
    let mechanics = &mut reference.machine.mechanics;
    mechanics.coulomb_friction = 0.3;
    mechanics.load = mechanics.load.map(|load| Load { backlash: 1e-4, ..load });
    reference.machine.current_sensors.noise = 3.0;
    reference.machine.effects.stiction = Some(Stiction { static_torque: 0.5, stribeck_velocity: 0.5 });
    let mut axis = Axis::halted(reference);
    axis.tune();
    let [phase, gain, resonance] = axis.numbers([P | 244, P | 245, P | 247]);
    within("resonance found", resonance as f64 / 100.0 / 550.0, 0.95..1.02);
    within("phase margin in degrees", phase as f64 / 10.0, 42.0..65.0);
    within("gain margin in dB", gain as f64 / 10.0, 7.0..30.0);
}

#[test]
fn a_notch_of_the_user_is_kept() {
    let mut axis = Axis::halted(elastic(2.0, 550.0, 0.03));
    let own = [(170, 2), (171, 8_000), (172, 1_000), (173, 500)];
    for (number, value) in own {
        axis.bench.write(P | number, Value::Word(value)).unwrap();
    }
    axis.tune();
    for (number, value) in own {
        assert_eq!(axis.numbers([P | number]), [u64::from(value)], "P-0-{number:04}");
    }
    assert_eq!(axis.numbers([P | 243])[0] & 0b111, 0b101, "a resonance, and no room for a notch");
}

#[test]
fn what_is_cancelled_interrupted_or_disturbed_leaves_everything_as_it_was() {
    // In the sweep, and while the new gains are in the loops.
    for percent in [20, 80] {
        for end in ["cancelled", "interrupted", "disturbed"] {
            let mut axis = Axis::halted(ReferenceAxis::precise());
            let before = axis.numbers(WRITTEN);
            axis.start();
            assert_eq!(axis.wait(percent), EXECUTING);
            match end {
                "cancelled" => {
                    axis.bench.write(TUNE, Value::Word(0)).unwrap();
                    assert_eq!(axis.numbers([TUNE]), [0]);
                }
                "interrupted" => {
                    axis.command.set((false, 0));
                    axis.bench.run(Nanoseconds::from_millis(500));
                    assert_eq!(axis.numbers([TUNE]), [FAILED], "{percent}");
                    assert!(axis.bench.text(FINDING).starts_with("interrupted"), "{}", axis.bench.text(FINDING));
                }
                _ => {
                    axis.bench.write(138, Value::Long(4_000_000)).unwrap();
                    assert_eq!(axis.wait(101), FAILED);
                    assert!(axis.bench.text(FINDING).contains("other parameters"), "{}", axis.bench.text(FINDING));
                }
            }
            assert_eq!(axis.numbers(WRITTEN), before, "{end} at {percent} %");
            axis.bench.run(Nanoseconds::from_millis(500));
            let place = axis.revolutions();
            axis.bench.run(Nanoseconds::from_millis(200));
            let moved = (axis.revolutions() - place) * 360.0;
            assert!(moved.abs() < 0.02 && axis.bench.has_torque(), "{end} at {percent} %: {moved} degrees");
        }
    }
}

#[test]
fn a_way_that_does_not_fit_is_refused_before_anything_moves() {
    let mut axis = Axis::halted(ReferenceAxis::precise());
    axis.bench.write(P | 229, Value::Long(600)).unwrap();
    let start = axis.revolutions();
    axis.start();
    assert_eq!(axis.wait(101), FAILED);
    assert!(axis.bench.text(FINDING).starts_with("way of P-0-0240"), "{}", axis.bench.text(FINDING));
    let moved = axis.revolutions() - start;
    assert!(moved.abs() < 1e-3, "{moved} revolutions");
    // At a third of the velocity it fits, and the law says that it stays within.
    axis.bench.write(TUNE, Value::Word(0)).unwrap();
    axis.bench.write(P | 218, Value::Long(1_000_000)).unwrap();
    axis.tune();
}

#[test]
fn it_needs_halt_and_no_other_identification_and_no_password() {
    let mut axis = Axis::halted(ReferenceAxis::precise());
    axis.start();
    assert_eq!(axis.bench.write(P | 226, Value::Word(3)), Err(0x7012));
    axis.bench.write(TUNE, Value::Word(0)).unwrap();
    axis.bench.run(Nanoseconds::from_millis(500));
    axis.command.set((false, 0));
    axis.bench.run(Nanoseconds::from_millis(100));
    assert_eq!(axis.bench.write(TUNE, Value::Word(3)), Err(0x7012));
    axis.command.set((true, 0));
    axis.bench.run(Nanoseconds::from_millis(100));
    axis.bench.write(267, Value::Bytes(b"press".to_vec())).unwrap();
    assert_eq!(axis.bench.write(TUNE, Value::Word(3)), Err(0x7009));
}
