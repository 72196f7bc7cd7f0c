//! An axis that meets a mechanical stop, a shaft that is blocked, and an encoder that is dead: over the ring.

use crate::running::{ADDRESS, Bench};
use bench::{DriveSetup, Works, parameters_of};
use plant::ReferenceAxis;
use ring::Nanoseconds;
use ring::ident::{Idn, Value};
use ring::master::{CommandValues, DriveScript, MasterScript, Motion, Telegram};
use ring::service_client::control;
use std::sync::Arc;
use std::sync::atomic::{AtomicI32, Ordering};

const CLASS_1: u16 = 11;
const CLASS_3: u16 = 13;
const DIAGNOSTIC_NUMBER: u16 = 390;
const TORQUE_LIMIT: u64 = 1 << 4;
const FEEDBACK: u64 = 1 << 5;
const FOLLOW: u16 = control::ON | control::ENABLE | control::NO_HALT;

/// A drive on its ring, and the command that it is given from now on in the unit of its mode: 0.1 %, 0.0001 rpm or 0.0001 degree from where
/// it was switched on.
struct Commanded {
    bench: Bench,
    command: Arc<AtomicI32>,
}

/// A stop of steel: 200 000 Nm/rad, damped, one-sided.
const STIFFNESS: f64 = 200_000.0;
const DAMPING: f64 = 60.0;

impl Commanded {
    /// In operation with a command of zero, with these data blocks written before.
    fn new(axis: ReferenceAxis, mode: u16, parameters: Vec<(Idn, Value)>) -> Self {
        Self::on(Works::OfItsAxis, axis, mode, parameters)
    }

    /// The same on an amplifier whose dead time is compensated from this current on; 0: it is not.
    fn with_dead_time_band(axis: ReferenceAxis, mode: u16, band: u16) -> Self {
        let works = Works::but_for(&axis, |amplifier| amplifier.dead_time_band = band);
        Self::on(works, axis, mode, vec![])
    }

    fn on(works: Works, axis: ReferenceAxis, mode: u16, parameters: Vec<(Idn, Value)>) -> Self {
        let command = Arc::new(AtomicI32::new(0));
        let given = Arc::clone(&command);
        let motion = Motion::new(1_000_000, move |point| {
            let value = given.load(Ordering::Relaxed);
            match mode {
                1 => CommandValues { torque: value as i16, ..CommandValues::default() },
                2 => CommandValues::at_velocity(value),
                _ => CommandValues::at_position(point.start + value),
            }
        });
        let idn = [Idn::TORQUE_COMMAND, Idn::VELOCITY_COMMAND, Idn::POSITION_COMMAND][usize::from(mode - 1).min(2)];
        let telegram = Telegram::application(&[Idn::VELOCITY_FEEDBACK, Idn::POSITION_FEEDBACK], &[idn]);
        let drive = DriveScript::new(ADDRESS, telegram)
            .with_all(parameters_of(&axis))
            .with(Idn::OPERATION_MODE, Value::Word(mode))
            .with_all(parameters);
        let script = MasterScript { motion: Some(motion), stops_at_refusals: false, ..MasterScript::new(vec![drive]) };
        let mut bench = Bench::new(DriveSetup { axis, works, ..DriveSetup::new(ADDRESS) }, script);
        for _ in 0..2_000 {
            bench.run(Nanoseconds::from_millis(10));
            if bench.is_in_operation() {
                bench.world.ring_mut().master_mut().hold_switches(Some(FOLLOW));
                bench.run(Nanoseconds::from_millis(100));
                return Self { bench, command };
            }
        }
        panic!("{}", bench.world.ring().master().state());
    }

    fn command(&self, value: i32) {
        self.command.store(value, Ordering::Relaxed);
    }

    /// In degrees.
    fn angle(&mut self) -> f64 {
        let now = self.bench.world.now().0;
        self.bench.drive.motor_side.borrow_mut().machine().angle(now) * 360.0
    }

    fn torque(&mut self) -> f64 {
        let now = self.bench.world.now().0;
        self.bench.drive.motor_side.borrow_mut().machine().torque(now)
    }

    fn machine(&mut self, change: impl FnOnce(&mut plant::Machine, u64)) {
        let now = self.bench.world.now().0;
        change(self.bench.drive.motor_side.borrow_mut().machine(), now);
    }

    fn run(&mut self, milliseconds: u64) {
        self.bench.run(Nanoseconds::from_millis(milliseconds));
    }

    /// The stop stands at these degrees.
    fn run_with_stop(&mut self, milliseconds: u32, stop: f64) {
        for _ in 0..milliseconds * 16 {
            let beyond = (self.angle() - stop).to_radians();
            self.machine(|machine, now| {
                let velocity = machine.velocity(now);
                let torque = if beyond > 0.0 { (-STIFFNESS * beyond - DAMPING * velocity).min(0.0) } else { 0.0 };
                machine.set_load_torque(torque, now);
            });
            self.bench.run(Nanoseconds(62_500));
        }
    }

    /// Makes the place where the motor stands the reference: no way to go.
    fn reference(&mut self) {
        self.bench.write(147, Value::Word(0b110_0000)).unwrap();
        self.bench.write(148, Value::Word(3)).unwrap();
        self.run(50);
        self.bench.write(148, Value::Word(0)).unwrap();
        assert_eq!(self.bench.number(403), 1);
    }

    fn errors(&mut self) -> (u64, u64) {
        let number = self.bench.number(DIAGNOSTIC_NUMBER);
        (self.bench.number(CLASS_1), if number < 0xE000 { 0 } else { number })
    }
}

#[test]
fn an_axis_that_is_pressed_against_a_stop_holds_its_torque_and_its_reference() {
    // 100 % of S-0-0111: 25 A at 2 Nm/A.
    for (mode, command) in [(2, 600_000), (1, 1_500)] {
        let limits = vec![(Idn(92), Value::Word(1_000)), (Idn(91), Value::Long(1_000_000))];
        let mut axis = Commanded::new(ReferenceAxis::press(), mode, limits);
        axis.reference();
        let stop = axis.angle() + 30.0;
        axis.command(command);
        axis.run_with_stop(1_000, stop);
        for _ in 0..5 {
            axis.run_with_stop(400, stop);
            let torque = axis.torque();
            assert!((48.5..50.5).contains(&torque), "mode {mode}: {torque} Nm");
        }
        // The load stays as it is while the service channel is asked: at rest.
        assert_eq!(axis.errors(), (0, 0), "mode {mode}");
        assert_eq!(axis.bench.number(CLASS_3) & TORQUE_LIMIT, TORQUE_LIMIT, "mode {mode}");
        assert_eq!(axis.bench.number(403), 1, "mode {mode}: the reference is kept");
        assert!(axis.bench.has_torque());
        let shown = f64::from(axis.bench.number(51) as u32 as i32) / 10_000.0;
        let true_angle = axis.angle() - (stop - 30.0);
        assert!((shown - true_angle).abs() < 0.05, "mode {mode}: {shown}, not {true_angle} degrees");
        // And away from it.
        axis.command(-command);
        axis.run_with_stop(1_000, stop);
        assert!(axis.angle() < stop - 90.0, "mode {mode}: {}", axis.angle() - stop);
        axis.machine(|machine, now| machine.set_load_torque(0.0, now));
        assert_eq!((axis.errors(), axis.bench.number(403)), ((0, 0), 1), "mode {mode}");
    }
}

#[test]
fn a_position_command_behind_the_stop_is_a_following_distance_and_no_fault_of_the_encoder() {
    for mode in [3, 11] {
        let mut axis = Commanded::new(ReferenceAxis::press(), mode, vec![(Idn(92), Value::Word(1_000))]);
        axis.reference();
        let stop = axis.angle() + 10.0;
        // 30 degrees of S-0-0159 behind the stop are reached at 60 rpm after 0.11 s.
        for step in 1..=400 {
            axis.command((step * 2_000).min(600_000));
            axis.run_with_stop(1, stop);
        }
        axis.run_with_stop(500, stop);
        axis.machine(|machine, now| machine.set_load_torque(0.0, now));
        assert_eq!(axis.errors(), (1 << 11, 0xF10B), "mode {mode}");
        assert_eq!(axis.bench.number(403), 1, "mode {mode}: the reference is kept");
    }
}

/// Every 15 electrical degrees of 120, which what dead time leaves repeats twice in, the whole torque in both directions on each kind of
/// machine: nothing induces a voltage.
#[test]
fn a_blocked_shaft_is_no_dead_encoder_at_any_angle() {
    for (axis, dead_time) in [
        (ReferenceAxis::press(), 200),
        (ReferenceAxis::small_cnc(), 200),
        (ReferenceAxis::catalogue(), 200),
        // Nothing makes up for the dead time.
        (ReferenceAxis::press(), 0),
        (ReferenceAxis::small_cnc(), 0),
    ] {
        for step in 0..8 {
            let mut axis = axis;
            let pole_pairs = f64::from(axis.machine.windings.pole_pairs);
            axis.machine.encoder.electrical_zero = f64::from(step) / 24.0 / pole_pairs;
            let name = format!("{} at {} degrees, P-0-0103 {dead_time}", axis.name, step * 15);
            let mut commanded = Commanded::with_dead_time_band(axis, 2, dead_time);
            commanded.machine(|machine, now| machine.block(true, now));
            for command in [600_000, -600_000, 3_000_000] {
                commanded.command(command);
                commanded.run(150);
                assert!(commanded.bench.has_torque(), "{name} at {command}: {:?}", commanded.errors());
            }
        }
    }
}

/// The tracks die while the axis stands or creeps, and a command makes it move.
#[test]
fn an_encoder_that_dies_at_standstill_is_found_when_the_rotor_turns() {
    for (axis, mode, before, command, dead_time) in [
        (ReferenceAxis::press(), 2, 0, 3_000_000, 0),
        (ReferenceAxis::small_cnc(), 2, 0, 3_000_000, 0),
        (ReferenceAxis::press(), 2, 0, 3_000_000, 200),
        (ReferenceAxis::press(), 2, 0, -600_000, 200),
        (ReferenceAxis::press(), 2, 1_000_000, 1_000_000, 200),
        (ReferenceAxis::press(), 1, 0, 500, 200),
        (ReferenceAxis::press(), 1, 0, -1_000, 200),
        (ReferenceAxis::press(), 11, 0, 200_000, 200),
        (ReferenceAxis::small_cnc(), 2, 0, 3_000_000, 200),
        (ReferenceAxis::small_cnc(), 2, 0, -600_000, 200),
        (ReferenceAxis::small_cnc(), 2, 1_000_000, 1_000_000, 200),
        (ReferenceAxis::small_cnc(), 1, 0, 500, 200),
        (ReferenceAxis::catalogue(), 2, 0, 600_000, 200),
        (ReferenceAxis::catalogue(), 2, 500_000, 500_000, 200),
        (ReferenceAxis::catalogue(), 1, 0, 200, 200),
    ] {
        let name = format!("{} in mode {mode}, {before} then {command}, P-0-0103 {dead_time}", axis.name);
        let pole_pairs = f64::from(axis.machine.windings.pole_pairs);
        let mut commanded = Commanded::with_dead_time_band(axis, mode, dead_time);
        commanded.reference();
        commanded.command(before);
        commanded.run(400);
        commanded.machine(|machine, now| machine.freeze_encoder(true, now));
        let from = commanded.angle();
        commanded.command(command);
        let mut milliseconds = 0.0;
        let mut most = 0.0_f64;
        while commanded.bench.has_torque() && milliseconds < 500.0 {
            commanded.bench.run(Nanoseconds::from_microseconds(250));
            milliseconds += 0.25;
            most = most.max((commanded.angle() - from).abs() * pole_pairs);
        }
        assert!(!commanded.bench.has_torque(), "{name}: not found, {most} electrical degrees");
        // The rotor is drawn to the current a quarter of an electrical revolution away, and swings beyond it.
        assert!(milliseconds < 130.0 && most < 170.0, "{name}: {milliseconds} ms, {most} electrical degrees");
        assert_eq!(commanded.errors(), (FEEDBACK, 0xF105), "{name}");
        assert_eq!(commanded.bench.number(403), 0, "{name}: nobody knows where the axis is");
    }
}

/// S-0-0149, the "positive stop".
const POSITIVE_STOP: u16 = 149;

#[test]
fn s_0_0149_goes_to_a_stop_without_a_following_distance_and_holds_until_it_is_cancelled() {
    for mode in [3, 11, 2, 1] {
        let limits = vec![(Idn(92), Value::Word(1_000)), (Idn(91), Value::Long(1_000_000))];
        let mut axis = Commanded::new(ReferenceAxis::press(), mode, limits);
        axis.reference();
        axis.bench.write(POSITIVE_STOP, Value::Word(3)).unwrap();
        assert_eq!(axis.bench.number(POSITIVE_STOP), 7, "mode {mode}: under way, for the axis is free");
        let stop = axis.angle() + 10.0;
        let target = match mode {
            1 => 1_500,
            2 => 600_000,
            // 90 degrees, three times S-0-0159.
            _ => 900_000,
        };
        for step in 1..=500 {
            axis.command(if mode > 2 { (step * 2_000).min(target) } else { target });
            axis.run_with_stop(1, stop);
        }
        // As the stop pushes while the service channel is read: what holds the axis stays.
        assert_eq!((axis.bench.number(POSITIVE_STOP), axis.errors()), (3, (0, 0)), "mode {mode}");
        assert_eq!(axis.bench.number(CLASS_3) & TORQUE_LIMIT, TORQUE_LIMIT, "mode {mode}");
        axis.run_with_stop(1_000, stop);
        let torque = axis.torque();
        assert!((48.5..50.5).contains(&torque), "mode {mode}: {torque} Nm");
        assert_eq!((axis.errors(), axis.bench.number(403)), ((0, 0), 1), "mode {mode}");
        // Cancelled, the monitoring is there again: a command that is still behind the stop is a following distance.
        axis.bench.write(POSITIVE_STOP, Value::Word(0)).unwrap();
        axis.run_with_stop(200, stop);
        axis.machine(|machine, now| machine.set_load_torque(0.0, now));
        assert_eq!(axis.bench.number(POSITIVE_STOP), 0);
        let expected = if mode > 2 { (1 << 11, 0xF10B) } else { (0, 0) };
        assert_eq!(axis.errors(), expected, "mode {mode}");
        assert_eq!(axis.bench.number(403), 1, "mode {mode}: the reference is kept");
    }
}

#[test]
fn s_0_0149_is_executed_by_a_stop_alone_and_fails_without_torque() {
    // The whole torque on a free axis, from rest: it is at its limit for 40 ms, and no stop.
    let mut axis = Commanded::new(ReferenceAxis::press(), 2, vec![(Idn(92), Value::Word(1_000))]);
    axis.bench.write(POSITIVE_STOP, Value::Word(3)).unwrap();
    axis.command(6_000_000);
    axis.run(20);
    axis.command(-6_000_000);
    axis.run(600);
    assert_eq!(axis.bench.number(POSITIVE_STOP), 7);
    // The control takes ENABLE away.
    axis.bench.world.ring_mut().master_mut().hold_switches(Some(0));
    axis.run(50);
    assert_eq!(axis.bench.number(POSITIVE_STOP) & 0xF, 0xF);
    assert_eq!(axis.bench.text(0x8003), "the torque went before the stop was reached");
    axis.bench.write(POSITIVE_STOP, Value::Word(0)).unwrap();
    assert_eq!(
        axis.bench.write(POSITIVE_STOP, Value::Word(3)),
        Err(0x7012),
        "without torque there is nothing to press with"
    );
}
