//! Limits in the MDT, as a tension axis has them, and torque data in newton metres.

use std::cell::RefCell;
use std::rc::Rc;

use crate::running::{ADDRESS, Bench, script};
use bench::DriveSetup;
use ring::Nanoseconds;
use ring::ident::{Idn, Value};
use ring::master::{CommandValues, MasterScript, Motion, ProfilePoint, Telegram};

const BIPOLAR_VELOCITY: Idn = Idn(91);
const BIPOLAR_TORQUE: Idn = Idn(92);

/// What the press motor's standstill current of 25 A makes with its 2 Nm/A.
const STALL_TORQUE: f64 = 50.0;

/// A drive in operation in this mode, whose MDT carries these data and whose master gives these values.
fn in_operation(
    mode: u16,
    mdt: &[Idn],
    parameters: Vec<(Idn, Value)>,
    profile: impl FnMut(ProfilePoint) -> CommandValues + 'static,
) -> Bench {
    let mut drive = script().drives.remove(0).with(Idn::OPERATION_MODE, Value::Word(mode)).with_all(parameters);
    drive.telegram = Telegram::application(&[Idn(51), Idn(40)], mdt);
    let motion = Motion { patience: 100_000, ..Motion::new(1_000_000, profile) };
    let script = MasterScript { motion: Some(motion), stops_at_refusals: false, ..MasterScript::new(vec![drive]) };
    let mut bench = Bench::new(DriveSetup::new(ADDRESS), script);
    bench.run_to_operation();
    bench
}

fn torque(bench: &mut Bench) -> f64 {
    let now = bench.world.now().0;
    bench.drive.motor_side.borrow_mut().machine().torque(now)
}

fn limited(commands: CommandValues, limits: &[(Idn, u32)]) -> CommandValues {
    let mut commands = commands;
    for (place, limit) in commands.limits.iter_mut().zip(limits) {
        *place = *limit;
    }
    commands
}

/// A value that a test changes while the master sends it.
type Shared = Rc<RefCell<u32>>;

fn shared(value: u32) -> Shared {
    Rc::new(RefCell::new(value))
}

/// Velocity command and a limit that the test may change.
fn velocity_with(velocity: i32, idn: Idn, value: &Shared) -> impl FnMut(ProfilePoint) -> CommandValues + 'static {
    let value = Rc::clone(value);
    move |_| limited(CommandValues::at_velocity(velocity), &[(idn, *value.borrow())])
}

/// In 0.1 % of the stall torque, another one in each cycle.
const PATTERN: [u32; 7] = [400, 200, 350, 250, 450, 180, 300];

/// Changes S-0-0092 in every cycle, and gives the largest deviation of the plant's torque from it at the best constant delay, and that delay.
fn follow_the_limit(mode: u16, command: CommandValues, mdt: &[Idn]) -> (f64, Nanoseconds) {
    let log: Rc<RefCell<Vec<u32>>> = Rc::default();
    let sent = Rc::clone(&log);
    let profile = move |point: ProfilePoint| {
        let limit = PATTERN[(point.cycle % PATTERN.len() as u64) as usize];
        sent.borrow_mut().push(limit);
        limited(command, &[(BIPOLAR_TORQUE, limit)])
    };
    let mut bench = in_operation(mode, mdt, Vec::new(), profile);
    bench.run(Nanoseconds::from_millis(20));
    let step = Nanoseconds::from_microseconds(125);
    let (mut changes, mut torques) = (Vec::new(), Vec::new());
    for _ in 0..16 * 60 {
        let seen = log.borrow().len();
        bench.run(step);
        torques.push(torque(&mut bench));
        if log.borrow().len() > seen {
            let limit = f64::from(*log.borrow().last().unwrap());
            changes.push((torques.len(), limit * STALL_TORQUE / 1_000.0));
        }
    }
    assert!(changes.len() > 50);
    let worst = |delay: usize| {
        let deviations =
            changes.iter().filter_map(|&(at, limit)| torques.get(at + delay).map(|torque| (torque - limit).abs()));
        deviations.fold(0.0, f64::max)
    };
    // One and a half cycles: an MDT is prepared at the beginning of its cycle, and a current has risen half a millisecond after t3.
    let best = (0..28).min_by(|&one, &other| worst(one).total_cmp(&worst(other))).unwrap();
    (worst(best), Nanoseconds(step.0 * best as u64))
}

#[test]
fn the_torque_follows_a_torque_limit_that_changes_in_every_mdt_within_a_cycle() {
    let torque = CommandValues { torque: 900, ..CommandValues::default() };
    for (mode, command, carried) in
        [(2, CommandValues::at_velocity(25_000_000), Idn::VELOCITY_COMMAND), (1, torque, Idn::TORQUE_COMMAND)]
    {
        // The limit before or behind the command.
        for mdt in [[carried, BIPOLAR_TORQUE], [BIPOLAR_TORQUE, carried]] {
            let (deviation, delay) = follow_the_limit(mode, command, &mdt);
            assert!(deviation < 0.7, "mode {mode}: {deviation} Nm off at {delay:?}");
            assert!(delay <= Nanoseconds::from_microseconds(2_750), "{delay:?}");
        }
    }
}

#[test]
fn each_sign_of_the_torque_has_its_own_limit_in_the_mdt() {
    let positive = Idn(82);
    let value = shared(200);
    let mut bench = in_operation(2, &[Idn::VELOCITY_COMMAND, positive, Idn(83)], Vec::new(), {
        let value = Rc::clone(&value);
        move |_| {
            let limit = *value.borrow();
            let limits = [(positive, limit), (Idn(83), 0_u32.wrapping_sub(limit / 2))];
            limited(CommandValues::at_velocity(if limit == 200 { 25_000_000 } else { -25_000_000 }), &limits)
        }
    });
    bench.run(Nanoseconds::from_millis(50));
    let driving = torque(&mut bench);
    assert!((driving - 10.0).abs() < 0.5, "{driving}");
    *value.borrow_mut() = 600;
    bench.run(Nanoseconds::from_millis(20));
    let braking = torque(&mut bench);
    assert!((braking + 15.0).abs() < 0.5, "{braking}");
}

#[test]
fn a_limit_in_the_mdt_stays_in_force_while_parameters_are_written() {
    let command = |_: ProfilePoint| {
        limited(CommandValues { torque: 1_000, ..CommandValues::default() }, &[(BIPOLAR_TORQUE, 200)])
    };
    let mut bench = in_operation(1, &[Idn::TORQUE_COMMAND, BIPOLAR_TORQUE], vec![], command);
    bench.run(Nanoseconds::from_millis(100));
    // Of the motor, around the loops, of the axis.
    for (idn, value) in [(Idn(82), Value::Word(3_000)), (Idn(57), Value::Long(1_234)), (Idn(100), Value::Word(12_000))]
    {
        bench.write(idn.0, value).unwrap();
        for _ in 0..200 {
            bench.run(Nanoseconds::from_microseconds(100));
            let torque = torque(&mut bench);
            assert!((0.19..0.21).contains(&(torque / STALL_TORQUE)), "{idn}: {torque} Nm");
        }
    }
}

#[test]
fn a_torque_limit_of_zero_lets_the_axis_coast_and_never_keeps_the_drive_from_stopping_it() {
    for lost in [false, true] {
        let limit = shared(2_000);
        let profile = velocity_with(3_000_000, BIPOLAR_TORQUE, &limit);
        let mut bench = in_operation(2, &[Idn::VELOCITY_COMMAND, BIPOLAR_TORQUE], Vec::new(), profile);
        bench.run(Nanoseconds::from_millis(500));
        assert!((bench.rpm() - 300.0).abs() < 3.0, "{}", bench.rpm());
        *limit.borrow_mut() = 0;
        bench.run(Nanoseconds::from_millis(10));
        let (free, from) = (torque(&mut bench), bench.rpm());
        assert!(free.abs() < 0.4, "{free} Nm");
        bench.run(Nanoseconds::from_millis(100));
        // 6 Nm of friction on 0.15 kgm² are 382 rpm a second.
        let coasted = from - bench.rpm();
        assert!((35.0..50.0).contains(&coasted), "{coasted} rpm");
        assert!(bench.has_torque());
        if lost {
            bench.lose(ring::fibre::TelegramKind::Mst, 3);
        } else {
            // Bit 15 off, the limit still 0 in every MDT.
            bench.world.ring_mut().master_mut().hold_switches(Some(0x6000));
        }
        let before = bench.rpm();
        // 400 rad/s² are 3 820 rpm a second: 68 ms.
        bench.run(Nanoseconds::from_millis(45));
        let after = bench.rpm();
        // A lost ring is found out after some cycles. Coasting, the axis would lose 17 rpm.
        let least = if lost { 70.0 } else { 100.0 };
        assert!((least..180.0).contains(&(before - after)), "{before} {after}");
        bench.run(Nanoseconds::from_millis(150));
        assert!(bench.rpm().abs() < 1.0 && !bench.has_torque(), "{}", bench.rpm());
    }
}

#[test]
fn a_lowered_velocity_limit_takes_a_faster_axis_along_at_the_acceleration_limit() {
    let limit = shared(30_000_000);
    let profile = velocity_with(3_000_000, BIPOLAR_VELOCITY, &limit);
    let mut bench = in_operation(2, &[Idn::VELOCITY_COMMAND, BIPOLAR_VELOCITY], Vec::new(), profile);
    bench.run(Nanoseconds::from_millis(500));
    assert!((bench.rpm() - 300.0).abs() < 3.0, "{}", bench.rpm());
    *limit.borrow_mut() = 1_000_000;
    // 200 rpm at 400 rad/s² are 52 ms, and 60 Nm less the friction.
    let mut hardest = 0.0_f64;
    let mut fastest = 0.0_f64;
    for tick in 0..8 * 40 {
        bench.run(Nanoseconds::from_microseconds(125));
        hardest = hardest.min(torque(&mut bench));
        fastest = fastest.max(bench.rpm());
        if tick == 8 * 26 {
            assert!((170.0..260.0).contains(&bench.rpm()), "{} rpm half way", bench.rpm());
        }
    }
    assert!((-75.0..-40.0).contains(&hardest), "{hardest} Nm");
    assert!(fastest < 303.0, "{fastest}");
    bench.run(Nanoseconds::from_millis(100));
    assert!((bench.rpm() - 100.0).abs() < 2.0, "{}", bench.rpm());
    assert_eq!(bench.number(335), 1, "n_command > n_limit");
    *limit.borrow_mut() = 30_000_000;
    bench.run(Nanoseconds::from_millis(300));
    assert!((bench.rpm() - 300.0).abs() < 3.0, "{}", bench.rpm());
}

#[test]
fn accelerations_in_the_mdt_are_the_ramps_of_velocity_commands() {
    let [up, down] = [Idn(136), Idn(137)];
    let (acceleration, velocity) = (shared(50_000), shared(0));
    let profile = {
        let (acceleration, velocity) = (Rc::clone(&acceleration), Rc::clone(&velocity));
        move |_| {
            let value = *acceleration.borrow();
            limited(CommandValues::at_velocity(*velocity.borrow() as i32), &[(up, value), (down, value)])
        }
    };
    let mut bench = in_operation(2, &[Idn::VELOCITY_COMMAND, up, down], Vec::new(), profile);
    for (value, per_millisecond) in [(50_000, 0.477), (100_000, 0.955)] {
        *acceleration.borrow_mut() = value;
        bench.run(Nanoseconds::from_millis(10));
        *velocity.borrow_mut() = 6_000_000;
        bench.run(Nanoseconds::from_millis(50));
        let before = bench.rpm();
        bench.run(Nanoseconds::from_millis(100));
        let slope = (bench.rpm() - before) / 100.0;
        assert!((slope / per_millisecond - 1.0).abs() < 0.05, "{value}: {slope} rpm/ms");
        *velocity.borrow_mut() = 0;
        bench.run(Nanoseconds::from_millis(1_500));
    }
}

#[test]
fn a_limit_in_the_mdt_reads_as_it_came_last_cannot_be_written_and_ends_with_cp4() {
    let limit = shared(350);
    let stored = vec![(BIPOLAR_TORQUE, Value::Word(1_200))];
    let profile = velocity_with(1_000_000, BIPOLAR_TORQUE, &limit);
    let mut bench = in_operation(2, &[Idn::VELOCITY_COMMAND, BIPOLAR_TORQUE], stored, profile);
    bench.run(Nanoseconds::from_millis(50));
    assert_eq!(bench.number(92), 350);
    *limit.borrow_mut() = 360;
    bench.run(Nanoseconds::from_millis(10));
    assert_eq!(bench.number(92), 360);
    assert_eq!(bench.write(92, Value::Word(100)), Err(0x700A));
    // Another parameter of the loops leaves the limit in force.
    bench.write(100, Value::Word(2_121)).unwrap();
    bench.run(Nanoseconds::from_millis(10));
    assert_eq!(bench.number(92), 360);
    assert_eq!(bench.run_up_and_read(&[92]), [1_200], "the stored one, when CP4 is left");
    let list = bench.entries(188);
    for number in [38, 39, 82, 83, 91, 92, 136, 137, 138, 193, 259, 260, 349] {
        assert!(list.contains(&number), "S-0-0188 names {number}");
    }
}

#[test]
fn a_limit_out_of_its_range_is_the_end_of_the_range_and_a_warning_with_its_reason() {
    let limit = shared(30_000_000);
    let profile = velocity_with(1_000_000, BIPOLAR_VELOCITY, &limit);
    let mut bench = in_operation(2, &[Idn::VELOCITY_COMMAND, BIPOLAR_VELOCITY], Vec::new(), profile);
    bench.run(Nanoseconds::from_millis(1_500));
    assert_eq!(bench.number(181) & 1 << 4, 0);
    *limit.borrow_mut() = 0;
    bench.run(Nanoseconds::from_millis(300));
    assert_eq!((bench.number(181) & 1 << 4, bench.number(12) >> 15), (1 << 4, 1));
    assert_eq!((bench.number(390), bench.number(91)), (0xE005, 1));
    assert!(bench.rpm().abs() < 1.0 && bench.has_torque(), "{}", bench.rpm());
    *limit.borrow_mut() = 30_000_000;
    bench.run(Nanoseconds::from_millis(300));
    assert_eq!((bench.number(181) & 1 << 4, bench.number(390)), (0, 0xA012));
    assert!((bench.rpm() - 100.0).abs() < 2.0, "{}", bench.rpm());
}

#[test]
fn torque_data_in_newton_metres_are_newton_metres_at_the_shaft() {
    for (kind, command, limit, expected) in [
        // 0.01 Nm an increment.
        (vec![(Idn(86), Value::Word(2))], 1_200, 3_000, 12.0),
        (vec![(Idn(86), Value::Word(2))], 3_000, 900, 9.0),
        // 0.005 Nm.
        (
            vec![(Idn(86), Value::Word(0x0A)), (Idn(93), Value::Word(5)), (Idn(94), Value::Word(-3_i16 as u16))],
            2_000,
            9_000,
            10.0,
        ),
        // Of a load behind a gear of 7 to 2: 42 Nm.
        (
            vec![(Idn(86), Value::Word(0x42)), (Idn(121), Value::Long(7)), (Idn(122), Value::Long(2))],
            4_200,
            30_000,
            12.0,
        ),
        // 10 kN on 10 mm a revolution.
        (vec![(Idn(86), Value::Word(1)), (Idn(123), Value::Long(100_000))], 10_000, 30_000, 15.9),
    ] {
        let mut parameters = kind.clone();
        parameters.push((BIPOLAR_TORQUE, Value::Word(limit)));
        let commands = CommandValues { torque: command, ..CommandValues::default() };
        let mut bench = in_operation(1, &[Idn::TORQUE_COMMAND], parameters, move |_| commands);
        bench.run(Nanoseconds::from_millis(50));
        let torque = torque(&mut bench);
        assert!((torque / expected - 1.0).abs() < 0.03, "{kind:?}: {torque} instead of {expected} Nm");
        // The same in its own increments.
        let wanted = f64::from(command.unsigned_abs().min(limit));
        let shown = f64::from(bench.number(84) as u16 as i16);
        assert!((shown / wanted - 1.0).abs() < 0.05, "{kind:?}: S-0-0084 = {shown}");
    }
}
