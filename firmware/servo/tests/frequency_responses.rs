//! The open loops of current, velocity and position on the machine of every reference axis, against the formulas that their gains come from.
//!
//! The design is worked out here, of the data of the axis and the times of the tasks; of the firmware's own numbers there is none in it.
//! `UPDATE_GOLDEN=1` writes the table of `docs/frequency-responses.md`.

use std::f64::consts::TAU;
use std::fmt::Write as _;

use crate::machine_bench::master::{of_radians, revolutions, rpm, to_rpm, turns};
use crate::machine_bench::measure::{Phasor, whole_periods};
use crate::machine_bench::setup::{CURRENT_BANDWIDTH, Setup};
use crate::machine_bench::{Bench, CYCLES_PER_SECOND, TICKS_PER_SECOND};
use plant::ReferenceAxis;
use servo::axis::Mode;

/// Seconds of small times in the velocity loop beside its filter and the current loop: half a tick for the difference of two positions, half
/// a tick until the current loop takes the command, a quarter for holding it.
const SMALL_TIMES: f64 = 1.25 * TICK;
/// Of the outer loops.
const TICK: f64 = 125e-6;

/// A frequency at which a loop has a figure, in Hz, and its phase margin in degrees.
#[derive(Clone, Copy, Debug)]
struct Figures {
    /// Where the open loop crosses 1; of the current loop where the closed one has -3 dB.
    hertz: f64,
    /// Against -180 degrees where the open loop crosses 1.
    margin: f64,
}

/// A complex gain.
type Complex = (f64, f64);

fn product(a: Complex, b: Complex) -> Complex {
    (a.0 * b.0 - a.1 * b.1, a.0 * b.1 + a.1 * b.0)
}

fn quotient(a: Complex, b: Complex) -> Complex {
    let square = b.0 * b.0 + b.1 * b.1;
    ((a.0 * b.0 + a.1 * b.1) / square, (a.1 * b.0 - a.0 * b.1) / square)
}

fn size(a: Complex) -> f64 {
    a.0.hypot(a.1)
}

/// Of an open loop, from the closed one or from the error.
fn closed(open: Complex) -> Complex {
    quotient(open, (1.0 + open.0, open.1))
}

/// A delay or lead in seconds at so many rad/s, as its gain.
fn turned(angle: f64) -> Complex {
    (angle.cos(), angle.sin())
}

/// Where `gain` falls below `level`, and the phase in degrees of `phase` there, of points that lie in order of their frequency: both are lines
/// over the logarithm of the frequency between two of them.
fn crossing(points: &[(f64, Complex)], level: f64, gain: impl Fn(Complex) -> f64) -> Figures {
    let after = points.iter().position(|&(_, open)| gain(open) < level).expect("the gain falls below the level");
    assert!(after > 0, "the gain is below {level} from {} Hz on", points[0].0);
    let [(low, before), (high, behind)] = [points[after - 1], points[after]];
    let share = (gain(before) / level).ln() / (gain(before) / gain(behind)).ln();
    // From one to the other a phase turns by less than a half.
    let phase = before.1.atan2(before.0);
    let turn = quotient(behind, before);
    let phase = (phase + share * turn.1.atan2(turn.0)).to_degrees();
    Figures { hertz: low * (high / low).powf(share), margin: (phase + 180.0).rem_euclid(360.0) }
}

/// So many frequencies between two multiples of one, a fixed ratio apart.
fn around(hertz: f64, points: usize, from: f64, to: f64) -> Vec<f64> {
    (0..points).map(|n| hertz * from * (to / from).powf(n as f64 / (points - 1) as f64)).collect()
}

/// What the formulas promise of an axis.
struct Design {
    setup: Setup,
    torque_constant: f64,
    inertia: f64,
}

impl Design {
    fn of(axis: ReferenceAxis) -> Self {
        let setup = Setup::of(axis).with_cycle(4);
        Self { setup, torque_constant: axis.machine.torque_constant(), inertia: setup.inertia() }
    }

    /// The sampled open loop `k (z^-1 + z^-2) / 2 / (1 - z^-1)` whose k gives the bandwidth on the smaller inductance, on that of the q axis.
    fn current(&self) -> Figures {
        let windings = &self.setup.reference.machine.windings;
        let p = TAU * f64::from(CURRENT_BANDWIDTH) / CYCLES_PER_SECOND;
        let smaller = windings.inductance_d.min(windings.inductance_q);
        let k = 2.0 * (p / 2.0).tan() * ((1.0 + p.sin().powi(2)).sqrt() - p.sin()) * smaller / windings.inductance_q;
        let open = |hertz: f64| {
            let p = TAU * hertz / CYCLES_PER_SECOND;
            let (z1, z2) = (turned(-p), turned(-2.0 * p));
            quotient((k * (z1.0 + z2.0) / 2.0, k * (z1.1 + z2.1) / 2.0), (1.0 - z1.0, -z1.1))
        };
        let points: Vec<_> = around(1_000.0, 800, 0.1, 4.0).into_iter().map(|hertz| (hertz, open(hertz))).collect();
        let corner = crossing(&points, 0.5_f64.sqrt(), |open| size(closed(open))).hertz;
        Figures { hertz: corner, margin: crossing(&points, 1.0, size).margin }
    }

    /// `gain (1 + 1 / (s Tn)) torque constant / (s inertia)`, late by the small times, behind its filter and the current loop.
    fn velocity_loop(&self, hertz: f64) -> Complex {
        let axis = &self.setup.axis;
        let speed = TAU * hertz;
        let gain = f64::from(axis.velocity_gain) / 1e3 * self.torque_constant / self.inertia / speed;
        let integral = 1.0 / (speed * f64::from(axis.integral_time) * 1e-4);
        let current_loop =
            self.setup.reference.machine.windings.inductance_q / f64::from(self.setup.current.proportional_gain) * 1e3;
        let filter = f64::from(axis.velocity_filter) * 1e-6;
        let lags = product((1.0, speed * filter), (1.0, speed * current_loop));
        // 1 / j is a quarter back.
        quotient(product((-gain * integral, -gain), turned(-speed * SMALL_TIMES)), lags)
    }

    fn velocity(&self) -> Figures {
        let hertz = around(100.0, 2_000, 0.05, 10.0);
        let points: Vec<_> = hertz.into_iter().map(|hertz| (hertz, self.velocity_loop(hertz))).collect();
        crossing(&points, 1.0, size)
    }

    /// `Kv / s` of a shaft whose velocity is the closed velocity loop, without its filter and its half tick.
    fn position(&self) -> Figures {
        let axis = &self.setup.axis;
        let open = |hertz: f64| {
            let speed = TAU * hertz;
            let ahead = product(turned(speed * 0.5 * TICK), (1.0, speed * f64::from(axis.velocity_filter) * 1e-6));
            let followed = product(closed(self.velocity_loop(hertz)), ahead);
            let gain = f64::from(axis.position_gain) / 6.0 / speed;
            product((0.0, -gain), followed)
        };
        let points: Vec<_> = around(30.0, 2_000, 0.05, 10.0).into_iter().map(|hertz| (hertz, open(hertz))).collect();
        crossing(&points, 1.0, size)
    }
}

/// An axis whose brake, if it has one, is open.
fn bench(setup: &Setup, mode: Mode) -> Bench {
    let mut bench = Bench::new(setup);
    bench.start(mode);
    bench.machine().set_brake(true, bench.time);
    bench
}

/// Samples of whole periods of `hertz`: at least eight of them, and half a second.
fn length_of(hertz: f64, rate: f64) -> usize {
    (8.0 / hertz * rate).max(0.5 * rate).round() as usize
}

fn over(output: &[f64], error: &[f64], hertz: f64, rate: f64) -> Complex {
    let open = Phasor::of(output, hertz, rate).over(Phasor::of(error, hertz, rate));
    (open.real, open.imaginary)
}

/// Around the design's figures, the current of a shaft that is held fast, at a third of the peak current.
fn measured_current(design: &Design) -> Figures {
    let mut bench = Bench::new(&design.setup);
    bench.machine().block(true, bench.time);
    let points: Vec<_> = around(design.current().hertz, 9, 0.3, 1.3)
        .into_iter()
        .map(|hertz| {
            let length = 4_000;
            let hertz = whole_periods(hertz, length, CYCLES_PER_SECOND);
            let (mut errors, mut currents) = (Vec::new(), Vec::new());
            for n in 0..400 + length {
                let command = 0.3 + 0.05 * (TAU * hertz * n as f64 / CYCLES_PER_SECOND).sin();
                let [_, current] = bench.current_cycle([0.0, command]);
                if n >= 400 {
                    errors.push(command - current);
                    currents.push(current);
                }
            }
            (hertz, over(&currents, &errors, hertz, CYCLES_PER_SECOND))
        })
        .collect();
    assert_eq!(bench.trip, None);
    let corner = crossing(&points, 0.5_f64.sqrt(), |open| size(closed(open))).hertz;
    Figures { hertz: corner, margin: crossing(&points, 1.0, size).margin }
}

/// Around 300 rpm, so that the friction is a constant; with a third of the peak current, and 120 rpm at most.
fn measured_velocity(design: &Design) -> Figures {
    let Setup { axis, reference, .. } = &design.setup;
    let third = f64::from(reference.peak_current) * 0.3 / f64::from(axis.velocity_gain);
    let swing = of_radians(third).min(120.0);
    let mut bench = bench(&design.setup, Mode::Velocity);
    bench.axis.command_velocity(rpm(300.0));
    bench.run(0.5);
    let points: Vec<_> = around(design.velocity().hertz, 6, 0.6, 1.6)
        .into_iter()
        .map(|hertz| {
            let length = length_of(hertz, TICKS_PER_SECOND) / 4 * 4;
            let hertz = whole_periods(hertz, length, TICKS_PER_SECOND);
            let (mut commands, mut velocities) = (Vec::new(), Vec::new());
            for cycle in 0..(2_000 + length) / 4 {
                let command = 300.0 + swing * (TAU * hertz * cycle as f64 * 4.0 / TICKS_PER_SECOND).sin();
                for seen in bench.velocity_cycle(rpm(command)) {
                    assert!(seen.limiting.is_empty(), "the test is of small signals");
                    commands.push(to_rpm(seen.output.velocity_command));
                    velocities.push(to_rpm(seen.output.loop_velocity));
                }
            }
            // The command of a tick holds from its middle on, half a tick later.
            let turned = product(
                over(&velocities[2_000..], &commands[2_000..], hertz, TICKS_PER_SECOND),
                turned(TAU * hertz * TICK / 2.0),
            );
            (hertz, quotient(turned, (1.0 - turned.0, -turned.1)))
        })
        .collect();
    crossing(&points, 1.0, size)
}

/// With lag, around 60 rpm; what swings of the velocity is a third of that.
fn measured_position(design: &Design) -> Figures {
    let mut setup = design.setup;
    setup.axis.feed_forward = 0;
    let mut bench = bench(&setup, Mode::Position);
    let start = turns(bench.encoder.position());
    let speed = 1.0;
    let mut ticks = 0_u32;
    let mut command = |swing: f64, hertz: f64| {
        let seconds = f64::from(ticks) * TICK;
        ticks += 4;
        let ramped = if seconds < 0.5 { seconds * seconds } else { seconds - 0.25 };
        revolutions(start + speed * ramped + swing * (TAU * hertz * seconds).sin())
    };
    for _ in 0..3_000 {
        bench.position_cycle(command(0.0, 0.0));
    }
    let points: Vec<_> = around(design.position().hertz, 6, 0.6, 1.6)
        .into_iter()
        .map(|hertz| {
            let length = length_of(hertz, TICKS_PER_SECOND) / 4 * 4;
            let hertz = whole_periods(hertz, length, TICKS_PER_SECOND);
            // From one frequency to the next the command may step by the swing.
            let swing = speed / 3.0 / (TAU * hertz);
            let (mut errors, mut places) = (Vec::new(), Vec::new());
            for _ in 0..(3_000 + length) / 4 {
                for seen in bench.position_cycle(command(swing, hertz)) {
                    assert!(errors.len() < 3_000 || seen.limiting.is_empty(), "the test is of small signals");
                    errors.push(turns(seen.output.following_error));
                    places.push(seen.angle);
                }
            }
            let drift = |values: &[f64]| without_drift(&values[3_000..]);
            (hertz, over(&drift(&places), &drift(&errors), hertz, TICKS_PER_SECOND))
        })
        .collect();
    crossing(&points, 1.0, size)
}

/// Without the line from the first to one behind the last value: a shaft that turns is no swing.
fn without_drift(values: &[f64]) -> Vec<f64> {
    let slope = (values[values.len() - 1] - values[0]) / (values.len() - 1) as f64;
    // The line through the ends has what the swing is there: over whole periods that is the same at both.
    values.iter().enumerate().map(|(n, value)| value - slope * n as f64).collect()
}

/// How far a measured figure may be beside that of the design: a share of the frequency, and degrees. That the current loop is a lag of first order
/// to the velocity loop costs the precise axis, which crosses at a tenth of its bandwidth, 2.7 degrees to the safe side.
const TOLERANCES: [(&str, f64, f64); 3] = [("current", 0.055, 2.0), ("velocity", 0.045, 3.0), ("position", 0.025, 2.0)];

/// Puts the table into `docs/frequency-responses.md`, or compares.
#[track_caller]
fn is_on_the_page(table: &str) {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/frequency-responses.md");
    let page = std::fs::read_to_string(path).unwrap();
    let (begin, end) = ("<!-- generated: loops -->\n", "<!-- end: loops -->");
    let (head, rest) = page.split_once(begin).expect("the page has a place for the loops");
    let (written, tail) = rest.split_once(end).expect("the table on the page has an end");
    if std::env::var_os("UPDATE_GOLDEN").is_some() {
        std::fs::write(path, format!("{head}{begin}{table}{end}{tail}")).unwrap();
        return;
    }
    assert_eq!(written, table, "docs/frequency-responses.md: set UPDATE_GOLDEN=1 to accept what is measured now");
}

#[test]
fn the_three_loops_of_every_axis_cross_where_their_formulas_say_with_the_margin_that_they_promise() {
    let mut table = String::from(
        "| axis | loop | design, Hz | measured, Hz | margin by design, degrees | measured |\n|---|---|---:|---:|---:|---:|\n",
    );
    let mut beside = Vec::new();
    for axis in ReferenceAxis::ALL {
        let design = Design::of(axis());
        let promised = [design.current(), design.velocity(), design.position()];
        let measured = [measured_current(&design), measured_velocity(&design), measured_position(&design)];
        for ((name, share, degrees), (promised, measured)) in
            TOLERANCES.into_iter().zip(promised.into_iter().zip(measured))
        {
            let axis = design.setup.reference.name;
            let (hertz, degree) = (measured.hertz / promised.hertz - 1.0, measured.margin - promised.margin);
            writeln!(
                table,
                "| {axis} | {name} | {:.1} | {:.1} | {:.1} | {:.1} |",
                promised.hertz, measured.hertz, promised.margin, measured.margin
            )
            .unwrap();
            if hertz.abs() > share || degree.abs() > degrees {
                beside.push(format!("{axis}, {name}: {:+.1} %, {degree:+.1} degrees", hertz * 100.0));
            }
        }
    }
    println!("{table}");
    assert!(beside.is_empty(), "beside their design: {beside:#?}");
    is_on_the_page(&table);
}
