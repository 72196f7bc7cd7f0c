//! The table against the cogging: learnt over the service channel, and seen at the true shaft.
//!
//! `UPDATE_GOLDEN=1` writes the table of `docs/motor-side.md`.

use std::cell::{Cell, RefCell};
use std::fmt::Write as _;
use std::rc::Rc;

use crate::kept::{command, flash_of};
use crate::running::{ADDRESS, Bench};
use bench::{DriveSetup, Works, parameters_of};
use flash::FlashModel;
use plant::{Cogging, EmfHarmonics, ReferenceAxis, Stiction, TorqueHarmonic};
use ring::Nanoseconds;
use ring::ident::{Idn, Value};
use ring::master::{CommandValues, DriveScript, MasterScript, Motion, Telegram};

const P: u16 = 0x8000;
const LEARN: u16 = P | 250;
const SWITCH: u16 = P | 251;
const TABLE: u16 = P | 252;
const STATE: u16 = P | 253;
const DROP: u16 = P | 254;
const PROGRESS: u16 = P | 227;
const FINDING: u16 = P | 228;

const EXECUTED: u64 = 3;
const EXECUTING: u64 = 7;
const FAILED: u64 = 0xF;

const NO_TABLE: u64 = 0;
const OFF: u64 = 1;
const WAITS: u64 = 2;
const IN_EFFECT: u64 = 3;

/// Position increments of a revolution, S-0-0079.
const INCREMENTS: f64 = 3_600_000.0;
/// Of the position commands, in us.
const CYCLE: u16 = 1_000;
/// Increments of 2^20, in which the place is measured.
const COUNTS: f64 = 1_048_576.0;

/// The precise axis, whose motor of 12 slots and 10 poles has 2 % of its peak torque between the crests of the common multiple, and half of
/// that of an eccentric rotor.
fn axis() -> ReferenceAxis {
    let mut axis = ReferenceAxis::precise();
    let peak = f64::from(axis.peak_current) / 1_000.0 * axis.machine.torque_constant();
    axis.machine.effects.cogging = Some(Cogging {
        harmonics: [
            TorqueHarmonic { per_revolution: 60, amplitude: 0.01 * peak, phase: 0.3 },
            TorqueHarmonic { per_revolution: 12, amplitude: 0.005 * peak, phase: 0.77 },
        ],
    });
    axis
}

/// The same machine, started with its rotor so many revolutions further.
fn turned(mut axis: ReferenceAxis, by: f64) -> ReferenceAxis {
    let machine = &mut axis.machine;
    machine.encoder.index_at = (machine.encoder.index_at - by).rem_euclid(1.0);
    machine.encoder.electrical_zero += by;
    for harmonic in &mut machine.effects.cogging.as_mut().unwrap().harmonics {
        harmonic.phase += by * f64::from(harmonic.per_revolution);
    }
    axis
}

/// What the master wants of the axis.
#[derive(Default)]
struct Wanted {
    halt: Cell<bool>,
    /// In revolutions per second, and the one that it has come to.
    speed: Cell<f64>,
    now: Cell<f64>,
    /// In increments.
    place: Cell<f64>,
    /// Positions that were asked for are to begin at this one.
    begin: RefCell<Option<f64>>,
}

impl Wanted {
    /// The next command.
    fn next(&self) -> CommandValues {
        let seconds = f64::from(CYCLE) * 1e-6;
        if let Some(begin) = self.begin.borrow_mut().take() {
            self.place.set(begin);
        }
        if !self.halt.get() {
            // 5 revolutions per second and half a second of it.
            let step = 10.0 * seconds;
            let now = self.now.get();
            self.now.set(now + (self.speed.get() - now).clamp(-step, step));
            self.place.set(self.place.get() + self.now.get() * seconds * INCREMENTS);
        }
        let place = self.place.get().rem_euclid(4_294_967_296.0) as u32;
        CommandValues { halt: self.halt.get(), ..CommandValues::at_position(place.cast_signed()) }
    }
}

struct Axis {
    bench: Bench,
    wanted: Rc<Wanted>,
}

impl Axis {
    /// In operation, held by HALT; `told` is what the control writes of it.
    fn new(axis: ReferenceAxis, flash: Option<FlashModel>, told: Vec<(Idn, Value)>) -> Self {
        let drive = DriveScript::new(ADDRESS, Telegram::standard(4).unwrap())
            .with(Idn::OPERATION_MODE, Value::Word(11))
            .with_all(told);
        let wanted = Rc::new(Wanted::default());
        wanted.halt.set(true);
        let asked = wanted.clone();
        let has_begun = Cell::new(false);
        let motion = Motion::new(u64::from(u32::MAX), move |point| {
            if !has_begun.replace(true) {
                *asked.begin.borrow_mut() = Some(f64::from(point.start));
            }
            asked.next()
        });
        // The plant's amplifier is one whose dead time is right from 50 mA on: its works have measured that.
        let works = Works::but_for(&axis, |amplifier| amplifier.dead_time_band = 50);
        let setup = DriveSetup { axis, works, ..DriveSetup::new(ADDRESS) };
        let setup = match flash {
            Some(flash) => DriveSetup { flash, ..setup },
            None => setup,
        };
        let script = MasterScript {
            cycle: CYCLE,
            motion: Some(motion),
            stops_at_refusals: false,
            ..MasterScript::new(vec![drive])
        };
        let mut bench = Bench::new(setup, script);
        bench.run_to_operation();
        bench.run(Nanoseconds::from_millis(500));
        Self { bench, wanted }
    }

    /// Follows a line shaft that begins where the motor stands, and has come to its speed.
    fn turn(&mut self, rpm: f64) {
        let begin = self.bench.number(51) as u32;
        if self.wanted.halt.get() {
            *self.wanted.begin.borrow_mut() = Some(begin.cast_signed().into());
            self.wanted.now.set(0.0);
        }
        self.wanted.speed.set(rpm / 60.0);
        self.wanted.halt.set(false);
        self.bench.run(Nanoseconds::from_millis(1_200));
        let now = self.bench.rpm();
        assert!((now - rpm).abs() < 0.02 * rpm.abs() + 1.0, "{now} rpm, asked for {rpm}");
    }

    /// Stands, held by HALT.
    fn halt(&mut self) {
        self.wanted.speed.set(0.0);
        self.bench.run(Nanoseconds::from_millis(800));
        self.wanted.halt.set(true);
        self.bench.run(Nanoseconds::from_millis(300));
    }

    fn angle(&mut self) -> f64 {
        let now = self.bench.world.now().0;
        self.bench.drive.motor_side.borrow_mut().machine().angle(now)
    }

    /// Peak to peak, in counts of 2^20, of what the true shaft leaves a line by, over a revolution or 2 s.
    fn ripple(&mut self, rpm: f64) -> f64 {
        self.turn(rpm);
        let step = 250_u32;
        let seconds = (60.0 / rpm.abs()).min(2.0);
        let number = (seconds * 1e6 / f64::from(step)) as usize;
        let places: Vec<f64> = (0..number)
            .map(|_| {
                self.bench.run(Nanoseconds::from_microseconds(step.into()));
                self.angle()
            })
            .collect();
        // The line is that of the commands: its slope is known.
        let slope = rpm / 60.0 * f64::from(step) * 1e-6;
        let beside = places.iter().enumerate().map(|(n, place)| (place - slope * n as f64) * COUNTS);
        let (lowest, highest) = beside.fold((f64::MAX, f64::MIN), |(low, high), at| (low.min(at), high.max(at)));
        println!("{rpm} rpm: {:.2} counts", highest - lowest);
        highest - lowest
    }

    fn ripples<const N: usize>(&mut self, speeds: [f64; N]) -> [f64; N] {
        let ripples = speeds.map(|rpm| self.ripple(rpm));
        self.halt();
        ripples
    }

    fn state(&mut self) -> u64 {
        self.bench.number(STATE)
    }

    /// Waits for the end of P-0-0250.
    fn learn(&mut self) -> u64 {
        self.bench.write(LEARN, Value::Word(3)).unwrap();
        let mut last = 0;
        for _ in 0..250 {
            self.bench.run(Nanoseconds::from_millis(1_000));
            let status = self.bench.number(LEARN);
            if status != EXECUTING {
                self.bench.write(LEARN, Value::Word(0)).unwrap();
                return status;
            }
            let percent = self.bench.number(PROGRESS);
            assert!((last..100).contains(&percent), "{percent} % after {last} %");
            last = percent;
        }
        panic!("P-0-0250 does not end");
    }
}

#[track_caller]
fn within(what: &str, value: f64, range: std::ops::Range<f64>) {
    assert!(range.contains(&value), "{what}: {value}, expected {range:?}");
}

/// What the control writes of an axis; the transistors of its amplifier take 1.5 V of 320 V (data sheet), 293 ns of 62.5 us.
fn told(axis: &ReferenceAxis) -> Vec<(Idn, Value)> {
    let mut told = parameters_of(axis);
    told.push((Idn(DROP), Value::Word(293)));
    told
}

/// In operation, with a table that it has learnt.
fn taught(axis: ReferenceAxis) -> Axis {
    let mut drive = Axis::new(axis, None, told(&axis));
    // The index has been seen by then, or is looked for.
    assert_eq!(drive.learn(), EXECUTED, "{}", drive.bench.text(FINDING));
    assert_eq!((drive.bench.number(PROGRESS), drive.state()), (100, IN_EFFECT));
    drive
}

/// 2^20 increments at 10, 60 and 300 rpm.
const SPEEDS: [f64; 3] = [10.0, 60.0, 300.0];

#[test]
fn what_is_learnt_at_1_rpm_takes_the_cogging_away_at_any_speed_in_both_directions_and_behind_the_supply() {
    let mut drive = Axis::new(axis(), None, told(&axis()));
    assert_eq!(drive.state(), NO_TABLE);
    let before = drive.ripples(SPEEDS);
    drop(drive);
    let mut drive = taught(axis());
    let after = drive.ripples(SPEEDS);
    let backwards = drive.ripples([-10.0, -60.0, -300.0]);
    for (ripple, without) in after.into_iter().chain(backwards).zip(before.into_iter().cycle()) {
        within("counts with the table", ripple, 0.3..5.0);
        within("of what it was", ripple / without, 0.02..0.13);
    }
    drive.bench.write(SWITCH, Value::Word(0)).unwrap();
    assert_eq!(drive.state(), OFF);
    within("switched off, at 60 rpm", drive.ripples([60.0])[0] / before[1], 0.9..1.1);
    drive.bench.write(SWITCH, Value::Word(1)).unwrap();
    // Half the current loop's error is what the transistors take.
    drive.bench.write(DROP, Value::Word(0)).unwrap();
    let without_drop = drive.ripples(SPEEDS);
    drive.bench.write(DROP, Value::Word(293)).unwrap();
    let table = drive.bench.entries(TABLE);
    drive.bench.run_up_and_read(&[]);
    assert_eq!(command(&mut drive.bench, 264), Ok(3), "saved");
    let flash = flash_of(&drive.bench);
    drop(drive);

    // The rotor has been turned meanwhile, and the control tells nothing of the motor.
    let mut again = Axis::new(turned(axis(), 0.317), Some(flash), vec![]);
    assert_eq!((again.state(), again.bench.entries(TABLE)), (WAITS, table));
    again.turn(60.0);
    assert_eq!(again.state(), IN_EFFECT, "the index has come by");
    let restarted = again.ripples(SPEEDS);
    for ripple in restarted {
        within("counts behind the supply", ripple, 0.3..5.0);
    }
    let mut page = String::from("| axis | 10 rpm | 60 rpm | 300 rpm |\n|---|---|---|---|\n");
    for (what, [slow, middle, fast]) in [
        ("without table", before),
        ("with the table, learnt once", after),
        ("the same, backwards", backwards),
        ("after a start with the rotor elsewhere", restarted),
        ("with the table, P-0-0254 = 0", without_drop),
    ] {
        writeln!(page, "| {what} | {slow:.1} | {middle:.1} | {fast:.1} |").unwrap();
    }
    is_on_the_page(&page);
}

/// The table that the plant's formula asks for, in mA RMS, from the index on.
fn ideal(axis: &ReferenceAxis) -> Value {
    let machine = &axis.machine;
    let current = |at: f64| {
        let harmonics = machine.effects.cogging.iter().flat_map(|cogging| &cogging.harmonics);
        let torque: f64 = harmonics
            .map(|harmonic| {
                let periods = f64::from(harmonic.per_revolution) * (machine.encoder.index_at + at) + harmonic.phase;
                harmonic.amplitude * (std::f64::consts::TAU * periods).sin()
            })
            .sum();
        -torque / machine.torque_constant() * std::f64::consts::FRAC_1_SQRT_2 * 1_000.0
    };
    let points = (0..1_024).map(|point| current(f64::from(point) / 1_024.0).round() as i16);
    Value::Bytes(points.flat_map(i16::to_le_bytes).collect())
}

#[test]
fn a_zero_that_moves_and_another_weight_of_the_data_leave_the_table_at_its_rotor() {
    // S-0-0147 without switch and marker: S-0-0148 makes the place where the motor stands S-0-0052.
    let homing = [(147, Value::Word(0x60)), (52, Value::Long(1_234_567))];
    // Positions in other increments and the other way round.
    let data = [(79, Value::Long(3_000_000)), (76, Value::Word(0x0A)), (55, Value::Word(5))];
    for (changes, homes) in [(&homing[..], true), (&data[..], false)] {
        let changes = changes.iter().map(|(idn, value)| (Idn(*idn), value.clone()));
        let mut drive = Axis::new(axis(), None, told(&axis()).into_iter().chain(changes).collect());
        drive.bench.write(TABLE, ideal(&axis())).unwrap();
        assert_eq!(drive.state(), WAITS);
        if homes {
            let rpm = drive.ripples([60.0])[0];
            within("counts before", rpm, 0.3..5.0);
            assert_eq!(command(&mut drive.bench, 148), Ok(3));
            assert_eq!(drive.bench.number(51) as u32 / 1_000, 1_234, "a new zero");
            within("counts with another zero", drive.ripples([60.0])[0], 0.3..5.0);
        } else {
            // The shaft turns against the commands, and by more than its increments.
            drive.wanted.speed.set(1.0);
            let begin = drive.bench.number(51) as u32;
            *drive.wanted.begin.borrow_mut() = Some(begin.cast_signed().into());
            drive.wanted.halt.set(false);
            drive.bench.run(Nanoseconds::from_millis(2_000));
            let rpm = drive.bench.rpm();
            within("rpm the other way", rpm, -73.0..-71.0);
            let at: Vec<f64> = (0..2_000)
                .map(|_| {
                    drive.bench.run(Nanoseconds::from_microseconds(500));
                    drive.angle()
                })
                .collect();
            let beside = at.iter().enumerate().map(|(n, place)| (place + 1.2 * 500e-6 * n as f64) * COUNTS);
            let (low, high) = beside.fold((f64::MAX, f64::MIN), |(low, high), at| (low.min(at), high.max(at)));
            within("counts the other way round", high - low, 0.3..6.0);
        }
        assert_eq!(drive.state(), IN_EFFECT);
    }
}

#[test]
fn the_low_pass_of_the_current_command_does_not_make_the_table_late_and_its_limits_hold() {
    let ripple = |low_pass: u16| {
        let filter = [(P | 174, Value::Word(low_pass)), (P | 175, Value::Word(10_000))];
        let filter = filter.map(|(idn, value)| (Idn(idn), value));
        let mut drive = Axis::new(axis(), None, told(&axis()).into_iter().chain(filter).collect());
        drive.bench.write(TABLE, ideal(&axis())).unwrap();
        // The index comes by.
        drive.ripples([60.0]);
        let ripple = drive.ripples([300.0])[0];
        // 2 % of 5 A, and what is left of it is told: the law watches the current.
        drive.bench.write(92, Value::Word(20)).unwrap();
        drive.bench.run(Nanoseconds::from_millis(500));
        ripple
    };
    let (without, with) = (ripple(0), ripple(1));
    within("counts without", without, 0.3..5.0);
    // 225 us at 300 Hz would be 8 counts more.
    within("counts with the low-pass", with, 0.3..6.0);
}

/// Puts the table into `docs/motor-side.md`, or compares.
#[track_caller]
fn is_on_the_page(table: &str) {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../docs/motor-side.md");
    let page = std::fs::read_to_string(path).unwrap();
    let (begin, end) = ("<!-- generated: cogging -->\n", "<!-- end: cogging -->");
    let (head, rest) = page.split_once(begin).expect("the page has a place for the figures");
    let (written, tail) = rest.split_once(end).expect("the figures on the page have an end");
    if std::env::var_os("UPDATE_GOLDEN").is_some() {
        std::fs::write(path, format!("{head}{begin}{table}{end}{tail}")).unwrap();
        return;
    }
    assert_eq!(written, table, "docs/motor-side.md: set UPDATE_GOLDEN=1 to accept what is measured now");
}

#[test]
fn a_load_that_pulls_one_way_while_it_is_learnt_and_a_shaft_that_sticks_are_no_cogging() {
    let mut sticking = axis();
    sticking.machine.effects.stiction = Some(Stiction { static_torque: 0.12, stribeck_velocity: 0.02 });
    let mut drive = Axis::new(sticking, None, told(&sticking));
    let pull = |drive: &mut Axis, torque: f64| {
        let now = drive.bench.world.now().0;
        drive.bench.drive.motor_side.borrow_mut().machine().set_load_torque(torque, now);
        drive.bench.run(Nanoseconds::from_millis(300));
    };
    // Half of what the motor has for ever.
    pull(&mut drive, -3.0);
    assert_eq!(drive.learn(), EXECUTED, "{}", drive.bench.text(FINDING));
    for (torque, speed) in [(-3.0, 60.0), (0.0, 60.0), (0.0, -10.0), (0.0, 300.0)] {
        pull(&mut drive, torque);
        let [ripple] = drive.ripples([speed]);
        within(&format!("counts with {torque} Nm at {speed} rpm"), ripple, 0.3..5.0);
    }
}

#[test]
fn harmonics_of_the_emf_are_beside_what_is_learnt() {
    let mut other = axis();
    other.machine.effects.emf_harmonics = Some(EmfHarmonics { fifth: 0.02, seventh: -0.01 });
    let without = {
        let mut smooth = other;
        smooth.machine.effects.cogging = None;
        Axis::new(smooth, None, told(&smooth)).ripples(SPEEDS)
    };
    // They are there without cogging, and the table takes none of them away and adds nothing to them.
    let with = taught(other).ripples(SPEEDS);
    for (with, without) in with.into_iter().zip(without) {
        within("counts with the table", with, 0.3..7.0);
        within("beside those without cogging", with - without, 0.0..3.5);
    }
}

#[test]
fn an_axis_without_index_little_way_or_a_limit_of_the_torque_learns_nothing_and_says_why() {
    let with = |changes: &[(u16, Value)]| {
        let changes = changes.iter().map(|(idn, value)| (Idn(*idn), value.clone()));
        Axis::new(axis(), None, told(&axis()).into_iter().chain(changes).collect())
    };
    for (changes, wait, reason) in [
        (&[(P | 117, Value::Word(0))][..], 100, "a table begins at the index of the encoder, and P-0-0117 is 0"),
        (&[(P | 229, Value::Long(129))], 100, "movement of the identification in 0.01 revolutions"),
        // 2 % of 5 A are less than the cogging takes.
        (&[(92, Value::Word(20))], 8_000, "the current has met a limit of the torque"),
    ] {
        let mut drive = with(changes);
        drive.bench.write(LEARN, Value::Word(3)).unwrap();
        drive.bench.run(Nanoseconds::from_millis(wait));
        assert_eq!(drive.bench.number(LEARN), FAILED, "{reason}");
        let finding = drive.bench.text(FINDING);
        assert!(finding.starts_with(reason), "{finding}, expected {reason}");
        assert_eq!((drive.state(), drive.bench.entries(TABLE).len()), (NO_TABLE, 0));
    }
}

#[test]
fn a_command_that_is_cancelled_or_whose_halt_ends_leaves_the_table_and_the_axis_as_they_were() {
    let mut drive = Axis::new(axis(), None, told(&axis()));
    let table = |of: fn(i16) -> i16| Value::Bytes((0..1_024).flat_map(|point| of(point).to_le_bytes()).collect());
    // What a user writes is taken, all of it or none, up to a quarter of the 14.142 A of the peak.
    drive.bench.write(TABLE, table(|point| point - 512)).unwrap();
    for (wrong, code) in [
        (table(|point| if point == 700 { 3_536 } else { 0 }), 0x7008),
        (Value::Bytes(vec![0; 2_046]), 0x7008),
        (Value::Bytes(vec![0; 2_050]), 0x7003),
    ] {
        assert_eq!(drive.bench.write(TABLE, wrong), Err(code));
    }
    let written = drive.bench.entries(TABLE);
    assert_eq!((written.len(), written[0].cast_signed(), written[1_023].cast_signed()), (1_024, -512, 511));
    drive.bench.write(LEARN, Value::Word(3)).unwrap();
    assert_eq!(drive.bench.write(P | 226, Value::Word(3)), Err(0x7012), "another one is under way");
    drive.bench.run(Nanoseconds::from_millis(5_000));
    assert!((0.5..1.5).contains(&drive.bench.rpm().abs()), "{} rpm", drive.bench.rpm());
    drive.bench.write(LEARN, Value::Word(0)).unwrap();
    drive.bench.run(Nanoseconds::from_millis(300));
    let place = drive.angle();
    drive.bench.run(Nanoseconds::from_millis(300));
    assert!((drive.angle() - place).abs() < 1e-5 && drive.bench.has_torque(), "held where it was");
    assert_eq!(drive.bench.entries(TABLE), written);
    drive.bench.write(LEARN, Value::Word(3)).unwrap();
    drive.bench.run(Nanoseconds::from_millis(2_000));
    drive.turn(10.0);
    assert_eq!(drive.bench.number(LEARN), FAILED);
    assert_eq!(drive.bench.text(FINDING), "interrupted: HALT, torque or operation have ended");
    assert_eq!(drive.bench.entries(TABLE), written);
    drive.bench.write(TABLE, Value::Bytes(vec![])).unwrap();
    assert_eq!(drive.state(), NO_TABLE);
}
