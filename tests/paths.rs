//! Between two position commands: when the shaft is where S-0-0047 said, and what a ramp makes of the torque.
//!
//! `UPDATE_GOLDEN=1` writes the table of `docs/paths.md`.

use std::f64::consts::TAU;
use std::fmt::Write as _;

use crate::commissioning::Halted;
use crate::running::{ADDRESS, Bench, script};
use bench::{DriveSetup, Executor, demo_with, product};
use ring::Nanoseconds;
use ring::ident::{Idn, Value};
use ring::master::{CommandValues, DriveScript, MasterScript, Motion, Telegram};

/// Position increments of a revolution, S-0-0079.
const INCREMENTS: f64 = 3_600_000.0;
/// The shaft gets to its speed in this time, in seconds, without a jump of the acceleration.
const STARTING: f64 = 0.5;

/// A press drive that follows a shaft with this speed in rpm, and the mean and the deviation, in us, of when it is where the commands said:
/// from one cycle after the t3 at which each became valid, over half a second.
fn lateness(cycle: u16, rpm: f64, parameters: Vec<(Idn, Value)>) -> f64 {
    let velocity = rpm / 60.0;
    let drive = script().drives.remove(0).with(Idn::OPERATION_MODE, Value::Word(11)).with_all(parameters);
    let drive = DriveScript { telegram: Telegram::standard(4).unwrap(), ..drive };
    let motion = Motion::new(1_000_000, move |point| {
        let seconds = point.time.as_seconds();
        let turned = if seconds < STARTING {
            velocity * (seconds / 2.0 - STARTING / TAU / 2.0 * (TAU / 2.0 * seconds / STARTING).sin())
        } else {
            velocity * (seconds - STARTING / 2.0)
        };
        CommandValues::at_position(point.start.wrapping_add((turned * INCREMENTS).round() as i32))
    });
    let mut bench = Bench::new(
        DriveSetup::new(ADDRESS),
        MasterScript { cycle, motion: Some(motion), ..MasterScript::new(vec![drive]) },
    );
    for _ in 0..2_000 {
        if bench.rpm().abs() > rpm.abs() * 0.99 {
            break;
        }
        bench.run(Nanoseconds::from_millis(10));
    }
    bench.run(Nanoseconds::from_millis(500));
    let t3 = u64::from(bench.world.ring().master().report().slots.as_ref().unwrap().t3);
    let ahead = Nanoseconds::from_microseconds(t3 + u64::from(cycle));
    let cycles = 500_000 / u32::from(cycle);
    let late = (0..cycles).map(|_| {
        bench.run(Nanoseconds::from_microseconds(u64::from(cycle)));
        let now = bench.world.now();
        let samples = &bench.world.ring().master().report().samples;
        let sample = samples.iter().rev().find(|sample| sample.time + ahead >= now).unwrap();
        let (at, command) = (sample.time + ahead, f64::from(sample.position_command) / INCREMENTS);
        bench.world.run_until(at).unwrap();
        let shaft = bench.drive.motor_side.borrow_mut().machine().angle(at.0);
        (command - shaft) / velocity * 1e6
    });
    let mean = late.sum::<f64>() / f64::from(cycles);
    println!("{cycle} us, {rpm} rpm: {mean:.2} us late");
    mean
}

fn shifted(microseconds: i16) -> Vec<(Idn, Value)> {
    vec![(product(230), Value::Word(microseconds.cast_unsigned()))]
}

#[test]
fn the_shaft_is_where_s_0_0047_said_one_cycle_after_t3_at_either_speed_and_direction() {
    for (cycle, rpm, tolerance) in [(10_000, 600.0, 0.5), (1_000, 600.0, 0.5), (10_000, 60.0, 5.0)] {
        for rpm in [rpm, -rpm] {
            let late = lateness(cycle, rpm, vec![]);
            assert!(late.abs() < tolerance, "{cycle} us, {rpm} rpm: {late} us");
        }
    }
}

#[test]
fn p_0_0230_shifts_the_shaft_in_time_either_way() {
    for (cycle, shift) in [(10_000, 300), (10_000, -300), (10_000, 800), (10_000, -800), (1_000, 94), (1_000, -94)] {
        for rpm in [600.0, -600.0] {
            let late = lateness(cycle, rpm, shifted(shift)) - f64::from(shift);
            assert!(late.abs() < 0.5, "{shift} us, {rpm} rpm: {late} us beside it");
        }
    }
}

/// What the demonstration measures (`cargo xtask demo`): a press drive at 10 ms, to 600 rpm in 1.5 s, 3 s there, and back.
#[derive(Clone, Copy, Debug)]
struct Figures {
    /// Torque ripple on the ramp in % of peak: rms, peak to peak.
    ramp: [f64; 2],
    /// At constant speed, rms.
    constant: f64,
    /// Largest error of the whole motion, and of constant speed, in degrees.
    error: [f64; 2],
}

impl Figures {
    fn of(parameters: &[(Idn, Value)]) -> Self {
        let report = demo_with(&Executor::Host, parameters, &mut |_| {}).unwrap();
        let (ripple, following) = (report.torque_ripple, report.following);
        Self {
            ramp: [ripple.accelerating_rms_percent, ripple.accelerating_peak_to_peak_percent],
            constant: ripple.constant_speed_rms_percent,
            error: [following.overall_max_degrees, following.constant_speed_max_degrees],
        }
    }

    fn row(&self, name: &str) -> String {
        let Self { ramp: [rms, peak_to_peak], constant, error: [all, steady] } = self;
        format!("| {name} | {rms:.2} % | {peak_to_peak:.1} % | {constant:.2} % | {all:.4} | {steady:.4} |\n")
    }
}

/// What the user of a press drive does: the bandwidths, P-0-0226, P-0-0220; and what stands in the drive then.
fn tuned() -> Vec<(Idn, Value)> {
    const COMPUTE_GAINS: u16 = 0x8000 | 220;
    const IDENTIFY_INERTIA: u16 = 0x8000 | 226;
    const EXECUTED: u64 = 3;
    let mut halted = Halted::with_cycle(10_000);
    for (idn, value) in [(product(222), Value::Word(1_100)), (product(223), Value::Word(40))] {
        halted.bench.write(idn.0, value).unwrap();
    }
    halted.bench.write(IDENTIFY_INERTIA, Value::Word(3)).unwrap();
    assert_eq!(halted.end_of(IDENTIFY_INERTIA), EXECUTED);
    halted.bench.write(COMPUTE_GAINS, Value::Word(3)).unwrap();
    assert_eq!(halted.numbers([COMPUTE_GAINS]), [EXECUTED]);
    let found = [Idn(100), Idn(101), Idn(104), Idn(106), Idn(107), Idn(155), Idn(348), product(142), product(231)];
    let words = found.map(|idn| (idn, Value::Word(u16::try_from(halted.bench.number(idn.0)).unwrap())));
    println!("{words:?}");
    words.to_vec()
}

#[track_caller]
fn within(what: &str, value: f64, range: std::ops::Range<f64>) {
    assert!(range.contains(&value), "{what}: {value}, expected {range:?}");
}

/// Puts the table into `docs/paths.md`, or compares.
#[track_caller]
fn is_on_the_page(table: &str) {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../docs/paths.md");
    let page = std::fs::read_to_string(path).unwrap();
    let (begin, end) = ("<!-- generated: figures -->\n", "<!-- end: figures -->");
    let (head, rest) = page.split_once(begin).expect("the page has a place for the figures");
    let (written, tail) = rest.split_once(end).expect("the figures on the page have an end");
    if std::env::var_os("UPDATE_GOLDEN").is_some() {
        std::fs::write(path, format!("{head}{begin}{table}{end}{tail}")).unwrap();
        return;
    }
    assert_eq!(written, table, "docs/paths.md: set UPDATE_GOLDEN=1 to accept what is measured now");
}

#[test]
fn cubics_and_feed_forwards_make_the_press_smooth_and_its_error_small() {
    let tuned = tuned();
    let lines = (product(141), Value::Word(0));
    let on_lines: Vec<_> = tuned.iter().cloned().chain([lines.clone()]).collect();
    let [before, tuned_on_lines, by_default, tuned] =
        [vec![lines], on_lines, vec![], tuned].map(|parameters| Figures::of(&parameters));
    let mut table = String::from(
        "| settings | torque on the ramp, rms | peak to peak | at constant speed, rms | largest error, degrees | at constant speed |\n\
         |---|---|---|---|---|---|\n",
    );
    for (name, figures) in [
        ("as it was: lines, nothing fed forward but the velocity", &before),
        ("lines, tuned", &tuned_on_lines),
        ("default: cubic", &by_default),
        ("tuned by P-0-0226 and P-0-0220: cubic, acceleration and friction", &tuned),
    ] {
        write!(table, "{}", figures.row(name)).unwrap();
    }
    println!("{table}");
    within("ripple on the ramp as it was", before.ramp[0], 3.7..4.5);
    within("peak to peak as it was", before.ramp[1], 14.0..19.0);
    within("largest error as it was", before.error[0], 0.09..0.13);
    within("ripple on the ramp by default", by_default.ramp[0], 0.5..0.9);
    within("ripple on the ramp, tuned", tuned.ramp[0], 0.3..1.0);
    within("ripple at constant speed, tuned", tuned.constant, 0.7..1.4);
    within("largest error, tuned", tuned.error[0], 0.01..0.02);
    within("largest error at constant speed, tuned", tuned.error[1], 0.001..0.004);
    within("ripple on lines, tuned", tuned_on_lines.ramp[0], 3.7..4.5);
    within("largest error on lines, tuned", tuned_on_lines.error[0], 0.02..0.06);
    is_on_the_page(&table);
}
