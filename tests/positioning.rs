//! Movements to a target by the drive itself, over the ring, and what it tells of having reached it: S-0-0258 in the modes 0013H and 001BH,
//! S-0-0282 with S-0-0346 in 0213H and 021BH.

use std::cell::Cell;
use std::rc::Rc;

use crate::running::{ADDRESS, Bench, script};
use bench::{Amplifier, DriveSetup};
use ring::Nanoseconds;
use ring::ident::{Idn, Value};
use ring::master::{CommandValues, MasterScript, Motion, Telegram};

const TO_TARGET: u16 = 0x1B;
const BY_CONTROL: u16 = 0x21B;

const OFF: u16 = 0;
const HALT: u16 = 0xC000;
const FOLLOW: u16 = 0xE000;

// S-0-0346.
const TOGGLE: u16 = 1;
const JOG_POSITIVE: u16 = 1 << 1;
const JOG_NEGATIVE: u16 = 2 << 1;
const STOP: u16 = 3 << 1;
const DISTANCE: u16 = 1 << 3;
const FROM_ACTUAL: u16 = 1 << 4;
const AT_ONCE: u16 = 1 << 5;

// S-0-0437.
const ACKNOWLEDGED: u64 = 1;
const ATTAINED: u64 = 1 << 1;
const HALTED: u64 = 1 << 2;
const AT_TARGET: u64 = 1 << 3;
const COARSE: u64 = 1 << 4;
const IN_POSITION: u64 = 1 << 5;
const JOGS: u64 = 1 << 6;
const WAITS: u64 = 1 << 7;
const ACTIVE: u64 = 1 << 8;
const THERE: u64 = ATTAINED | HALTED | AT_TARGET | COARSE | IN_POSITION | ACTIVE;

/// 0.0001 degrees of a degree.
const DEGREE: i32 = 10_000;
/// An increment of the encoder is 0.0055 degrees, and the drive holds its place within some of them.
const NEAR: f64 = 0.03;

/// An axis that turns at 120 rpm between ramps of 200 rad/s2, switched on at standstill.
fn axis(mode: u16, parameters: &[(u16, i32)]) -> Bench {
    cyclic_axis(mode, parameters, &[Idn::VELOCITY_COMMAND], |_| CommandValues::default())
}

fn cyclic_axis(
    mode: u16,
    parameters: &[(u16, i32)],
    mdt: &[Idn],
    mut commands: impl FnMut(CommandValues) -> CommandValues + 'static,
) -> Bench {
    let four_bytes = |idn: u16| matches!(idn, 49 | 50 | 57 | 103 | 159 | 193 | 259..=261 | 359 | 418);
    let parameters = parameters.iter().map(|&(idn, value)| {
        let value = value as u32;
        (Idn(idn), if four_bytes(idn) { Value::Long(value) } else { Value::Word(value as u16) })
    });
    let mut drive = script()
        .drives
        .remove(0)
        .with(Idn::OPERATION_MODE, Value::Word(mode))
        .with(Idn(259), Value::Long(1_200_000))
        .with(Idn(260), Value::Long(200_000))
        .with_all(parameters);
    drive.telegram = Telegram::application(&[Idn(51), Idn(40), Idn(430), Idn(437)], mdt);
    let motion = Motion {
        patience: 100_000,
        ..Motion::new(1_000_000, move |point| commands(CommandValues::at_position(point.start)))
    };
    let script = MasterScript { motion: Some(motion), stops_at_refusals: false, ..MasterScript::new(vec![drive]) };
    let mut bench = Bench::new(DriveSetup::new(ADDRESS), script);
    for _ in 0..1_000 {
        run(&mut bench, 10);
        if bench.is_in_operation() {
            // Whatever the drive answers: this master goes on.
            switch(&mut bench, FOLLOW);
            run(&mut bench, 100);
            return bench;
        }
    }
    panic!("{}", bench.world.ring().master().state());
}

fn run(bench: &mut Bench, milliseconds: u64) {
    bench.run(Nanoseconds::from_millis(milliseconds));
}

fn switch(bench: &mut Bench, word: u16) {
    bench.world.ring_mut().master_mut().hold_switches(Some(word));
}

/// The angle of the shaft, which no polarity turns round.
fn shaft(bench: &mut Bench) -> f64 {
    let now = bench.world.now().0;
    bench.drive.motor_side.borrow_mut().machine().angle(now) * 360.0
}

/// The angle of the shaft at the position 0: the search for the commutation angle has moved it.
fn zero(bench: &mut Bench) -> f64 {
    shaft(bench) - f64::from(signed(bench, 51)) / f64::from(DEGREE)
}

fn signed(bench: &mut Bench, idn: u16) -> i32 {
    bench.number(idn) as u32 as i32
}

fn write_long(bench: &mut Bench, idn: u16, value: i32) {
    bench.write(idn, Value::Long(value as u32)).unwrap();
}

/// S-0-0282 with a change of bit 0 of S-0-0346; gives that.
fn take_over(bench: &mut Bench, value: i32, how: u16) -> u16 {
    write_long(bench, 282, value);
    let control = (bench.number(346) as u16 ^ TOGGLE) & TOGGLE | how;
    bench.write(346, Value::Word(control)).unwrap();
    control
}

/// C3D bits 6, 8, 11, 12, 13 as their own data blocks, which are what S-0-0013 shows.
fn bits(bench: &mut Bench) -> [u64; 5] {
    let bits = [336, 338, 341, 342, 343].map(|idn| bench.number(idn));
    let word = bench.number(13);
    assert_eq!(bits, [6, 8, 11, 12, 13].map(|bit| word >> bit & 1), "S-0-0013 is {word:04x}");
    bits
}

fn assert_turned(bench: &mut Bench, from: f64, expected: f64) {
    let turned = shaft(bench) - from;
    assert!((turned - expected).abs() < NEAR, "turned {turned} degrees, not {expected}");
}

/// Nothing has moved and nothing does.
fn assert_stays(bench: &mut Bench) {
    let before = shaft(bench);
    run(bench, 500);
    assert_turned(bench, before, 0.0);
}

/// An error in full run, its end, and the edge that brings the torque back.
fn fail_and_recover(bench: &mut Bench) {
    let amplifier = |bench: &mut Bench, fault| {
        bench.drive.motor_side.borrow_mut().set_amplifier_inputs(Amplifier { main_power: true, fault });
    };
    amplifier(bench, true);
    run(bench, 20);
    assert!(!bench.has_torque());
    amplifier(bench, false);
    // Coasts to a stop.
    for _ in 0..100 {
        run(bench, 100);
        if bench.rpm().abs() < 0.1 {
            break;
        }
    }
    bench.clear_errors();
    switch(bench, OFF);
    run(bench, 50);
    switch(bench, FOLLOW);
    run(bench, 300);
    assert!(bench.has_torque() && bench.is_in_operation());
}

#[test]
fn a_drive_that_moves_by_itself_is_in_position_when_it_has_arrived_and_not_before() {
    for mode in [0x13, TO_TARGET] {
        let mut bench = axis(mode, &[(57, 2 * DEGREE)]);
        bench.write(305, Value::Word(336)).unwrap();
        bench.write(307, Value::Word(342)).unwrap();
        run(&mut bench, 100);
        let from = bench.world.ring().master().report().samples.len();
        write_long(&mut bench, 258, 720 * DEGREE);
        run(&mut bench, 2_500);
        let samples = &bench.world.ring().master().report().samples[from..];
        let shown = |sample: &ring::master::FeedbackSample, bit: u16| sample.status.unwrap() >> bit & 1 == 1;
        for bit in [6, 7] {
            let edges = samples.windows(2).filter(|pair| shown(&pair[0], bit) != shown(&pair[1], bit)).count();
            assert_eq!(edges, 2, "mode {mode:x}, bit {bit}: off when it starts and on when it arrives");
        }
        let arrived = samples.iter().rposition(|sample| !shown(sample, 6)).unwrap() + 1;
        let way = f64::from(samples[arrived].position.unwrap() - 720 * DEGREE) / f64::from(DEGREE);
        assert!(way.abs() <= 2.0, "mode {mode:x}: {way} degrees from the target");
        // At 120 rpm, and 1.6 s for two revolutions with their ramps.
        let moving = samples.iter().filter(|sample| !shown(sample, 6)).count() * 2;
        assert!((1_000..1_300).contains(&moving), "mode {mode:x}: {moving} ms");
    }
}

#[test]
fn each_window_is_told_when_it_is_entered_and_the_set_point_on_its_own() {
    let mut bench = axis(TO_TARGET, &[(57, DEGREE), (261, 30 * DEGREE), (259, 100_000)]);
    assert_eq!(bits(&mut bench), [1, 1, 1, 1, 1], "it is to stay where it stands");
    assert_eq!(bench.number(437), THERE);
    // 10 rpm are 60 degrees a second.
    let from = zero(&mut bench);
    write_long(&mut bench, 258, 180 * DEGREE);
    run(&mut bench, 500);
    assert_eq!(bits(&mut bench), [0, 0, 0, 0, 0]);
    assert_eq!(signed(&mut bench, 430), 180 * DEGREE);
    while shaft(&mut bench) - from < 155.0 {
        run(&mut bench, 5);
    }
    assert_eq!(bench.number(437), COARSE | ACTIVE, "{}", shaft(&mut bench) - from);
    run(&mut bench, 1_000);
    assert_eq!(bits(&mut bench), [1, 1, 1, 1, 1]);
    assert_turned(&mut bench, from, 180.0);
    // The override stops the set-point on its way.
    write_long(&mut bench, 258, 0);
    run(&mut bench, 500);
    bench.write(108, Value::Word(0)).unwrap();
    run(&mut bench, 300);
    assert!(bench.rpm().abs() < 0.5);
    assert_eq!(bits(&mut bench), [0, 0, 0, 0, 1]);
}

#[test]
fn a_target_is_attained_by_the_set_point_while_a_shaft_that_lags_behind_it_is_not_in_position() {
    // Kv = 0.5/min * 1000: at 720 degrees a second the shaft is 86 degrees behind.
    let mut bench = axis(0x13, &[(57, DEGREE), (104, 50), (159, 0)]);
    bench.write(305, Value::Word(342)).unwrap();
    bench.write(307, Value::Word(336)).unwrap();
    run(&mut bench, 50);
    write_long(&mut bench, 258, 720 * DEGREE);
    let first = bench.world.ring().master().report().samples.len();
    run(&mut bench, 2_500);
    let samples = &bench.world.ring().master().report().samples[first..];
    let told = |bit: u16| samples.iter().position(|sample| sample.status.unwrap() >> bit & 1 == 1).unwrap();
    let [attained, in_position] = [told(6), told(7)];
    let behind = |sample: usize| 720.0 - f64::from(samples[sample].position.unwrap()) / f64::from(DEGREE);
    assert!((20.0..86.0).contains(&behind(attained)), "{} degrees behind", behind(attained));
    // A position loop alone: the rest falls by e every 120 ms.
    let expected = (behind(attained) / 1.0).ln() * 60.0;
    assert!(((in_position - attained) as f64 - expected).abs() < 15.0, "{attained} {in_position} {expected}");
    assert!((0.8..1.05).contains(&behind(in_position)), "{} degrees behind", behind(in_position));
}

#[test]
fn in_modes_that_follow_the_master_in_position_is_the_following_distance_and_the_rest_is_silent() {
    let mut bench = cyclic_axis(11, &[], &[Idn::POSITION_COMMAND], |values| values);
    assert_eq!(bits(&mut bench), [1, 0, 0, 0, 0]);
    switch(&mut bench, HALT);
    run(&mut bench, 100);
    assert_eq!(bits(&mut bench), [1, 0, 0, 0, 0], "it holds the place where it has stopped");
    switch(&mut bench, OFF);
    run(&mut bench, 500);
    assert_eq!(bits(&mut bench), [0; 5]);
    let mut bench = cyclic_axis(2, &[], &[Idn::VELOCITY_COMMAND], |_| CommandValues::at_velocity(3_000_000));
    run(&mut bench, 300);
    assert_eq!(bits(&mut bench), [0; 5]);
}

#[test]
fn an_axis_that_halt_or_homing_moves_is_not_in_position_before_it_stands() {
    // Up to 300 rpm within 200 ms, and on; without lag the following distance stays small all the time.
    let moved = Cell::new((0, 0));
    let mut bench = cyclic_axis(11, &[(57, 5 * DEGREE)], &[Idn::POSITION_COMMAND], move |values| {
        let (way, velocity) = moved.get();
        let velocity = (velocity + 360).min(36_000);
        moved.set((way + velocity, velocity));
        CommandValues::at_position(values.position + way)
    });
    bench.write(305, Value::Word(336)).unwrap();
    run(&mut bench, 400);
    assert!((299.0..301.0).contains(&bench.rpm()));
    let first = bench.world.ring().master().report().samples.len();
    switch(&mut bench, HALT);
    run(&mut bench, 300);
    let samples = &bench.world.ring().master().report().samples[first..];
    let told: Vec<bool> = samples.iter().map(|sample| sample.status.unwrap() & 1 << 6 != 0).collect();
    let edges: Vec<usize> = (1..told.len()).filter(|&at| told[at] != told[at - 1]).collect();
    assert_eq!((edges.len(), told[0]), (2, true), "{edges:?}");
    // 31.4 rad/s at 400 rad/s2 are 79 ms.
    let braking = (edges[1] - edges[0]) * 2;
    assert!((77..90).contains(&braking), "{braking} ms");
    // Homing to the marker.
    bench.write(147, Value::Word(0b10_0000)).unwrap();
    bench.write(148, Value::Word(3)).unwrap();
    // The homing holds the axis until it is cancelled, whatever this master commands meanwhile.
    switch(&mut bench, FOLLOW);
    let mut seen = 0;
    for _ in 0..50 {
        if bench.rpm().abs() > 50.0 {
            assert_eq!(bench.number(336), 0);
            seen += 1;
        }
        run(&mut bench, 10);
    }
    assert!(seen > 0);
    assert_eq!((bench.number(148), bench.number(336)), (3, 1));
}

#[test]
fn positioning_brakes_with_its_own_deceleration_or_as_it_accelerates() {
    for (deceleration, expected) in [(0, 200.0), (50_000, 50.0), (400_000, 400.0)] {
        let mut bench = axis(TO_TARGET, &[(359, deceleration), (259, 3_000_000)]);
        let from = zero(&mut bench);
        write_long(&mut bench, 258, 1_440 * DEGREE);
        run(&mut bench, 300);
        assert!((299.0..301.0).contains(&bench.rpm()));
        while bench.rpm() > 250.0 {
            run(&mut bench, 1);
        }
        let (begin, fast) = (bench.world.now().0, bench.rpm());
        while bench.rpm() > 80.0 {
            bench.run(Nanoseconds::from_microseconds(250));
        }
        let time = (bench.world.now().0 - begin) as f64 * 1e-9;
        let measured = (fast - bench.rpm()) * core::f64::consts::TAU / 60.0 / time;
        assert!((measured / expected - 1.0).abs() < 0.1, "{measured} rad/s2, not {expected}");
        run(&mut bench, 2_000);
        assert_turned(&mut bench, from, 1_440.0);
    }
}

#[test]
fn distances_add_up_exactly_whether_the_last_one_was_done_or_not() {
    for modulo in [false, true] {
        let parameters: &[(u16, i32)] = if modulo { &[(76, 0x82), (103, 1_000_007)] } else { &[] };
        let mut bench = axis(BY_CONTROL, parameters);
        let from = shaft(&mut bench);
        let start = signed(&mut bench, 430);
        let mut sum = 0;
        for distance in [333_333, 1, 2_222_222, -1_111_111, 3, 4_999_999] {
            let control = take_over(&mut bench, distance, DISTANCE | AT_ONCE);
            sum += distance;
            assert_eq!(bench.number(419), u64::from(control & TOGGLE), "acknowledged");
            let expected = if modulo { (start + sum).rem_euclid(1_000_007) } else { start + sum };
            assert_eq!(signed(&mut bench, 430), expected);
        }
        run(&mut bench, 3_000);
        assert_turned(&mut bench, from, f64::from(sum) / f64::from(DEGREE));
        assert_eq!(bench.number(437) & THERE, THERE);
    }
}

#[test]
fn a_distance_counts_from_the_last_target_or_from_where_the_axis_is() {
    let mut bench = axis(BY_CONTROL, &[]);
    let from = shaft(&mut bench);
    take_over(&mut bench, 720 * DEGREE, DISTANCE | AT_ONCE);
    run(&mut bench, 200);
    let before = shaft(&mut bench) - from;
    take_over(&mut bench, 90 * DEGREE, DISTANCE | AT_ONCE | FROM_ACTUAL);
    let after = shaft(&mut bench) - from;
    run(&mut bench, 2_000);
    let target = shaft(&mut bench) - from - 90.0;
    assert!((before..=after).contains(&target), "{before} {target} {after}");
    // A position is one, wherever the axis stands.
    take_over(&mut bench, 45 * DEGREE, AT_ONCE);
    run(&mut bench, 2_000);
    let zero = zero(&mut bench);
    assert_turned(&mut bench, zero, 45.0);
}

#[test]
fn the_next_command_waits_for_the_last_one_unless_it_is_to_be_taken_at_once() {
    let mut bench = axis(BY_CONTROL, &[]);
    let from = zero(&mut bench);
    let first = take_over(&mut bench, 180 * DEGREE, 0);
    run(&mut bench, 100);
    assert_eq!(bench.number(437) & (WAITS | ACKNOWLEDGED), u64::from(first & TOGGLE));
    take_over(&mut bench, 0, 0);
    assert_eq!(bench.number(437) & (WAITS | ACKNOWLEDGED), WAITS | u64::from(first & TOGGLE));
    assert_eq!(signed(&mut bench, 430), 180 * DEGREE);
    let mut highest = 0.0_f64;
    for _ in 0..200 {
        run(&mut bench, 10);
        highest = highest.max(shaft(&mut bench) - from);
    }
    assert!((highest - 180.0).abs() < 0.2, "the first target was reached before: {highest}");
    assert_turned(&mut bench, from, 0.0);
    assert_eq!(bench.number(437), THERE | u64::from(first & TOGGLE ^ TOGGLE));
}

#[test]
fn halt_interrupts_a_movement_and_its_end_finishes_it() {
    for (mode, distance) in [(TO_TARGET, 0), (BY_CONTROL, DISTANCE)] {
        let mut bench = axis(mode, &[]);
        let from = if mode == TO_TARGET { zero(&mut bench) } else { shaft(&mut bench) };
        if mode == TO_TARGET {
            write_long(&mut bench, 258, 720 * DEGREE);
        } else {
            take_over(&mut bench, 720 * DEGREE, distance);
        }
        run(&mut bench, 200);
        switch(&mut bench, HALT);
        run(&mut bench, 300);
        assert!(bench.rpm().abs() < 0.5 && bench.has_torque());
        let word = bench.number(437);
        assert_eq!(word & !ACKNOWLEDGED, HALTED | ACTIVE, "{mode:x}: stands, and not at its target: {word:b}");
        let ahead = f64::from(signed(&mut bench, 430)) / f64::from(DEGREE) + zero(&mut bench) - from;
        assert!((ahead - 720.0).abs() < NEAR, "{ahead}");
        assert_stays(&mut bench);
        switch(&mut bench, FOLLOW);
        run(&mut bench, 2_000);
        assert_turned(&mut bench, from, 720.0);
        // What is commanded in HALT is gone to afterwards, and told not to be attained meanwhile.
        switch(&mut bench, HALT);
        run(&mut bench, 50);
        let end = if mode == TO_TARGET {
            write_long(&mut bench, 258, 360 * DEGREE);
            360.0
        } else {
            take_over(&mut bench, 45 * DEGREE, DISTANCE);
            765.0
        };
        assert_eq!(bits(&mut bench), [0, 0, 0, 0, 1]);
        let before = shaft(&mut bench);
        run(&mut bench, 300);
        assert_turned(&mut bench, before, 0.0);
        switch(&mut bench, FOLLOW);
        run(&mut bench, 2_000);
        assert_turned(&mut bench, from, end);
    }
}

#[test]
fn after_an_error_nothing_moves_by_itself_unless_the_target_is_to_be_kept() {
    for (mode, keeps) in [(TO_TARGET, false), (BY_CONTROL, false), (TO_TARGET, true), (BY_CONTROL, true)] {
        let mut bench = axis(mode, if keeps { &[(393, 0)] } else { &[] });
        let from = if mode == TO_TARGET { zero(&mut bench) } else { shaft(&mut bench) };
        if mode == TO_TARGET {
            write_long(&mut bench, 258, 3_600 * DEGREE);
        } else {
            take_over(&mut bench, 3_600 * DEGREE, DISTANCE);
        }
        run(&mut bench, 300);
        fail_and_recover(&mut bench);
        if keeps {
            run(&mut bench, 6_000);
            assert_turned(&mut bench, from, 3_600.0);
            continue;
        }
        let here = shaft(&mut bench) - from;
        assert!((50.0..3_000.0).contains(&here), "{here}");
        assert_stays(&mut bench);
        assert_eq!(bench.number(437) & THERE, THERE);
        // The data say where it stands.
        for idn in if mode == TO_TARGET { &[258, 430][..] } else { &[430] } {
            let shown = f64::from(signed(&mut bench, *idn)) / f64::from(DEGREE) + zero(&mut bench);
            let stands = shaft(&mut bench);
            assert!((shown - stands).abs() < NEAR, "S-0-{idn:04}: {shown}, not {stands}");
        }
        // And a new command is followed from there.
        let stands = shaft(&mut bench);
        if mode == TO_TARGET {
            let target = signed(&mut bench, 258) + 90 * DEGREE;
            write_long(&mut bench, 258, target);
        } else {
            take_over(&mut bench, 90 * DEGREE, DISTANCE);
        }
        run(&mut bench, 1_500);
        let turned = shaft(&mut bench) - stands;
        assert!((turned - 90.0).abs() < 0.1, "{turned}");
    }
}

#[test]
fn a_target_that_is_written_without_torque_is_gone_to_and_a_toggle_without_torque_is_not() {
    let mut bench = axis(TO_TARGET, &[]);
    let from = zero(&mut bench);
    switch(&mut bench, OFF);
    run(&mut bench, 300);
    assert!(!bench.has_torque());
    write_long(&mut bench, 258, 90 * DEGREE);
    assert_stays(&mut bench);
    switch(&mut bench, FOLLOW);
    run(&mut bench, 1_500);
    assert_turned(&mut bench, from, 90.0);

    let mut bench = axis(BY_CONTROL, &[]);
    switch(&mut bench, OFF);
    run(&mut bench, 300);
    take_over(&mut bench, 90 * DEGREE, DISTANCE | AT_ONCE);
    assert_eq!((bench.number(346) & 1, bench.number(419)), (1, 0), "not taken over");
    let from = shaft(&mut bench);
    switch(&mut bench, FOLLOW);
    run(&mut bench, 500);
    assert_turned(&mut bench, from, 0.0);
    assert_eq!((bench.number(419), bench.number(437) & WAITS), (0, 0), "nor later");
    take_over(&mut bench, 90 * DEGREE, DISTANCE | AT_ONCE);
    run(&mut bench, 1_500);
    assert_turned(&mut bench, from, 90.0);
}

#[test]
fn another_mode_in_the_middle_ends_the_movement_and_the_way_back_does_not_begin_it_again() {
    const VELOCITY_MODE: u16 = FOLLOW | 0x100;
    for mode in [TO_TARGET, BY_CONTROL] {
        let mut bench = axis(mode, &[(33, 2)]);
        if mode == TO_TARGET {
            write_long(&mut bench, 258, 1_440 * DEGREE);
        } else {
            take_over(&mut bench, 1_440 * DEGREE, DISTANCE);
        }
        run(&mut bench, 400);
        switch(&mut bench, VELOCITY_MODE);
        run(&mut bench, 300);
        assert!(bench.rpm().abs() < 0.5, "S-0-0036 is 0: {}", bench.rpm());
        assert_eq!(bits(&mut bench), [0, 0, 0, 0, 0]);
        assert_eq!(bench.number(437) & ACTIVE, 0);
        switch(&mut bench, FOLLOW);
        run(&mut bench, 50);
        assert_stays(&mut bench);
        assert_eq!(bench.number(437) & THERE, THERE);
    }
}

#[test]
fn a_mode_that_begins_in_full_run_stops_the_axis_first() {
    let mut bench = cyclic_axis(2, &[(33, 0x1B)], &[Idn::VELOCITY_COMMAND], |_| CommandValues::at_velocity(3_000_000));
    run(&mut bench, 300);
    assert!((299.0..301.0).contains(&bench.rpm()));
    switch(&mut bench, FOLLOW | 0x100);
    run(&mut bench, 30);
    // 31.4 rad/s at 200 rad/s2 are 157 ms.
    assert!((150.0..290.0).contains(&bench.rpm()), "{}", bench.rpm());
    assert_eq!(bits(&mut bench)[..1], [0]);
    run(&mut bench, 300);
    assert_stays(&mut bench);
    assert_eq!(bits(&mut bench), [1; 5]);
}

#[test]
fn a_jogging_axis_turns_until_its_bits_end_and_a_stopped_one_goes_on() {
    for polarity in [0, 7] {
        let mut bench = axis(BY_CONTROL, &[(55, polarity)]);
        let sign = if polarity == 0 { 1.0 } else { -1.0 };
        for (bits, direction) in [(JOG_POSITIVE, 1.0), (JOG_NEGATIVE, -1.0)] {
            bench.write(346, Value::Word(bits)).unwrap();
            run(&mut bench, 300);
            let rpm = bench.rpm() * sign * direction;
            assert!((118.0..122.0).contains(&rpm), "{rpm} rpm with bits {bits:b}");
            assert_eq!(bench.number(437), JOGS | ACTIVE);
            bench.write(346, Value::Word(0)).unwrap();
            run(&mut bench, 300);
            assert_stays(&mut bench);
            assert_eq!(bench.number(437), THERE, "its target is where it has stopped");
        }
        let from = shaft(&mut bench);
        let control = take_over(&mut bench, 720 * DEGREE, DISTANCE);
        run(&mut bench, 200);
        bench.write(346, Value::Word(control | STOP)).unwrap();
        run(&mut bench, 300);
        assert_stays(&mut bench);
        assert_eq!(bench.number(437) & !ACKNOWLEDGED, HALTED | ACTIVE);
        bench.write(346, Value::Word(control)).unwrap();
        run(&mut bench, 2_000);
        assert_turned(&mut bench, from, 720.0 * sign);
    }
}

/// A way of an axis with a modulo of 360 degrees to a position, in degrees of the coordinates of S-0-0051.
fn modulo_way(bench: &mut Bench, mode: u16, polarity: i32, to: i32) -> f64 {
    let before = shaft(bench);
    if mode == TO_TARGET {
        write_long(bench, 258, to * DEGREE);
    } else {
        take_over(bench, to * DEGREE, 0);
    }
    run(bench, 500);
    assert_eq!(bench.number(437) & THERE, THERE);
    let shown = f64::from(signed(bench, 51)) / f64::from(DEGREE);
    let off = (shown - f64::from(to) + 540.0).rem_euclid(360.0) - 180.0;
    assert!(off.abs() < NEAR, "{shown}, not {to}");
    let turned = shaft(bench) - before;
    if polarity == 0 { turned } else { -turned }
}

#[test]
fn a_modulo_axis_goes_the_way_that_its_command_value_mode_asks_for() {
    for (way, stages) in [
        (4, [(350, 0.0), (10, 20.0), (350, -20.0), (520, 170.0), (160, 0.0)]),
        (5, [(350, 0.0), (10, 20.0), (350, 340.0), (349, 359.0), (349, 0.0)]),
        (2, [(350, 0.0), (10, -340.0), (350, -20.0), (351, -359.0), (-9, 0.0)]),
    ] {
        for (mode, polarity) in [(TO_TARGET, 0), (TO_TARGET, 7), (BY_CONTROL, 0), (BY_CONTROL, 7)] {
            let parameters = [(76, 0x82), (103, 360 * DEGREE), (393, way), (55, polarity), (259, 3_000_000)];
            let mut bench = axis(mode, &parameters);
            for (number, (to, expected)) in stages.into_iter().enumerate() {
                let turned = modulo_way(&mut bench, mode, polarity, to);
                assert!(
                    number == 0 || (turned - expected).abs() < NEAR,
                    "mode {mode:x}, S-0-0393 = {way}, S-0-0055 = {polarity}: to {to} it turned {turned}, not {expected}"
                );
            }
        }
    }
}

#[test]
fn an_axis_with_one_direction_takes_another_turn_when_it_is_too_near_or_halted_beyond() {
    // 300 rpm down to 0 at 200 rad/s2 take 141 degrees.
    let mut bench = axis(TO_TARGET, &[(76, 0x82), (103, 360 * DEGREE), (393, 5), (259, 3_000_000)]);
    let from = shaft(&mut bench);
    let start = signed(&mut bench, 51);
    write_long(&mut bench, 258, (start - DEGREE).rem_euclid(360 * DEGREE));
    run(&mut bench, 140);
    let (lowest, here) = (shaft(&mut bench), f64::from(signed(&mut bench, 51)) / f64::from(DEGREE));
    let near = (here + 90.0).rem_euclid(360.0);
    write_long(&mut bench, 258, (near * f64::from(DEGREE)) as i32);
    let mut before = lowest;
    for _ in 0..400 {
        run(&mut bench, 5);
        let now = shaft(&mut bench);
        // The shaft itself overshoots by some increments; coming back to the target would be 50 degrees.
        assert!(now > before - 0.3, "turned back from {before} to {now}");
        before = now;
    }
    assert_eq!(bench.number(437) & THERE, THERE);
    let turned = shaft(&mut bench) - from;
    assert!((300.0..720.0).contains(&turned), "{turned}");

    // A HALT whose ramp leads beyond the target.
    let mut bench = axis(TO_TARGET, &[(76, 0x82), (103, 360 * DEGREE), (393, 5)]);
    bench.write(372, Value::Long(20_000)).unwrap();
    let from = shaft(&mut bench);
    let start = signed(&mut bench, 51);
    write_long(&mut bench, 258, (start + 120 * DEGREE).rem_euclid(360 * DEGREE));
    while shaft(&mut bench) - from < 80.0 {
        run(&mut bench, 2);
    }
    switch(&mut bench, HALT);
    run(&mut bench, 1_500);
    let beyond = shaft(&mut bench) - from;
    assert!((130.0..350.0).contains(&beyond), "{beyond}");
    switch(&mut bench, FOLLOW);
    run(&mut bench, 2_500);
    assert_turned(&mut bench, from, 480.0);
}

#[test]
fn a_position_just_behind_a_standing_axis_with_one_direction_is_gone_back_to() {
    for (window, expected) in [(1_000, 359.0), (20_000, -1.0)] {
        let mut bench = axis(TO_TARGET, &[(76, 0x82), (103, 360 * DEGREE), (393, 5), (418, window)]);
        write_long(&mut bench, 258, 90 * DEGREE);
        run(&mut bench, 1_500);
        let from = shaft(&mut bench);
        write_long(&mut bench, 258, 89 * DEGREE);
        run(&mut bench, 1_500);
        assert_turned(&mut bench, from, expected);
    }
}

#[test]
fn a_cyclic_target_is_followed_whatever_happens_in_between() {
    let target = Rc::new(Cell::new(0));
    let commanded = Rc::clone(&target);
    let mut bench = cyclic_axis(TO_TARGET, &[], &[Idn(258)], move |_| CommandValues::at_position(commanded.get()));
    let from = zero(&mut bench);
    target.set(720 * DEGREE);
    run(&mut bench, 300);
    assert_eq!(bits(&mut bench), [0; 5]);
    target.set(360 * DEGREE);
    run(&mut bench, 1_500);
    assert_turned(&mut bench, from, 360.0);
    // The target that is left is told to be left in the cycle that it comes with.
    bench.write(305, Value::Word(342)).unwrap();
    run(&mut bench, 20);
    let first = bench.world.ring().master().report().samples.len();
    target.set(720 * DEGREE);
    run(&mut bench, 20);
    let samples = &bench.world.ring().master().report().samples[first..];
    let sent = samples.iter().position(|sample| sample.position_command == 720 * DEGREE).unwrap();
    let told = samples.iter().position(|sample| sample.status.unwrap() & 1 << 6 == 0).unwrap();
    assert!(told - sent <= 3, "sent in {sent}, told in {told}");
    run(&mut bench, 300);
    // The master goes on to command it: after an error too.
    fail_and_recover(&mut bench);
    run(&mut bench, 2_000);
    assert_turned(&mut bench, from, 720.0);
}

#[test]
fn a_cyclic_control_word_takes_over_the_value_of_its_own_telegram() {
    let step = Rc::new(Cell::new((0, 0)));
    let commanded = Rc::clone(&step);
    // The value behind the word that takes it over.
    let mut bench = cyclic_axis(BY_CONTROL, &[], &[Idn(346), Idn(282)], move |_| {
        let (position, positioning) = commanded.get();
        CommandValues { position, positioning, ..CommandValues::default() }
    });
    let from = shaft(&mut bench);
    for (turn, toggle) in [(90, 1), (45, 0), (-30, 1)] {
        step.set((turn * DEGREE, toggle | DISTANCE | AT_ONCE));
        run(&mut bench, 10);
    }
    // An error does not bring the last one back, though its word goes on.
    run(&mut bench, 1_000);
    assert_turned(&mut bench, from, 105.0);
    fail_and_recover(&mut bench);
    assert_stays(&mut bench);
    assert_eq!(bench.number(419), 1);
}

#[test]
fn a_distance_beyond_a_limit_ends_there_and_the_axis_comes_back_by_the_next() {
    let limits = [(49, 100 * DEGREE), (50, -100 * DEGREE), (55, 1 << 4), (259, 300_000)];
    let mut bench = axis(BY_CONTROL, &limits);
    bench.write(52, Value::Long(0)).unwrap();
    bench.write(148, Value::Word(3)).unwrap();
    bench.write(148, Value::Word(0)).unwrap();
    run(&mut bench, 50);
    let from = shaft(&mut bench);
    take_over(&mut bench, 200 * DEGREE, DISTANCE);
    run(&mut bench, 1_500);
    assert!(!bench.has_torque());
    let beyond = shaft(&mut bench) - from;
    assert!((100.0..108.0).contains(&beyond), "{beyond}");
    bench.clear_errors();
    switch(&mut bench, OFF);
    run(&mut bench, 50);
    switch(&mut bench, FOLLOW);
    run(&mut bench, 300);
    assert_stays(&mut bench);
    assert!(bench.has_torque());
    take_over(&mut bench, -90 * DEGREE, DISTANCE);
    run(&mut bench, 3_000);
    assert_turned(&mut bench, from, beyond - 90.0);
}

#[test]
fn a_homed_axis_stays_where_it_is_in_its_new_coordinates() {
    for mode in [TO_TARGET, BY_CONTROL] {
        let mut bench = axis(mode, &[(393, 0)]);
        if mode == TO_TARGET {
            write_long(&mut bench, 258, 90 * DEGREE);
        } else {
            take_over(&mut bench, 90 * DEGREE, DISTANCE);
        }
        run(&mut bench, 1_500);
        bench.write(52, Value::Long(10_000_000)).unwrap();
        bench.write(148, Value::Word(3)).unwrap();
        bench.write(148, Value::Word(0)).unwrap();
        run(&mut bench, 50);
        assert_stays(&mut bench);
        let target = signed(&mut bench, 430);
        assert!((target - 10_000_000).abs() < 300, "{target}");
    }
}

#[test]
fn a_direction_that_is_none_is_refused() {
    let mut bench = axis(TO_TARGET, &[]);
    assert_eq!(bench.write(393, Value::Word(3)), Err(0x7008));
    assert_eq!(bench.write(393, Value::Word(7)), Err(0x7007));
    assert_eq!(bench.number(393), 4);
    for way in [0, 1, 2, 4, 5, 6] {
        bench.write(393, Value::Word(way)).unwrap();
    }
}
