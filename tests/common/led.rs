//! An axis whose master does as a test says, and keeps its switches whatever the drive answers.

use std::cell::Cell;
use std::rc::Rc;

use bench::DriveSetup;
use ring::Nanoseconds;
use ring::ident::{Idn, Value};
use ring::master::{CommandValues, MasterScript, Motion, Telegram};
use ring::service_client::control;

use crate::running::{ADDRESS, Bench, script};

/// Switched on and following.
pub(crate) const FOLLOW: u16 = control::ON | control::ENABLE | control::NO_HALT;
/// Held by HALT.
pub(crate) const HALT: u16 = control::ON | control::ENABLE;
/// Bit 15 taken back.
pub(crate) const OFF: u16 = control::ENABLE | control::NO_HALT;

/// A drive in operation whose master does as the test says, and keeps its switches whatever the drive answers.
pub(crate) struct Axis {
    pub(crate) bench: Bench,
    commands: Rc<Cell<CommandValues>>,
    start: i32,
    /// Fastest since the last look, in rpm.
    pub(crate) fastest: f64,
    /// The bridge was on since the last look.
    pub(crate) had_torque: bool,
}

impl Axis {
    pub(crate) fn in_mode(mode: u16) -> Self {
        Self::with(mode, vec![])
    }

    pub(crate) fn with(mode: u16, parameters: Vec<(Idn, Value)>) -> Self {
        Self::of(mode, parameters, |script| script)
    }

    pub(crate) fn of(
        mode: u16,
        parameters: Vec<(Idn, Value)>,
        change: impl FnOnce(MasterScript) -> MasterScript,
    ) -> Self {
        let mut drive = script().drives.remove(0);
        drive = drive.with(Idn::OPERATION_MODE, Value::Word(mode)).with_all(parameters);
        drive.telegram = Telegram::application(
            &[Idn(51), Idn(40)],
            &[Idn::POSITION_COMMAND, Idn::VELOCITY_COMMAND, Idn::TORQUE_COMMAND],
        );
        let commands = Rc::new(Cell::new(CommandValues::default()));
        let start = Rc::new(Cell::new(None));
        let (given, seen) = (Rc::clone(&commands), Rc::clone(&start));
        let motion = Motion::new(1_000_000, move |point| {
            if seen.get().is_none() {
                seen.set(Some(point.start));
                given.set(CommandValues { position: point.start, ..given.get() });
            }
            given.get()
        });
        let script = MasterScript { motion: Some(motion), stops_at_refusals: false, ..MasterScript::new(vec![drive]) };
        let mut bench = Bench::new(DriveSetup::new(ADDRESS), change(script));
        for _ in 0..1_000 {
            bench.run(Nanoseconds::from_millis(10));
            if bench.is_in_operation() && start.get().is_some() {
                bench.world.ring_mut().master_mut().hold_switches(Some(FOLLOW));
                bench.run(Nanoseconds::from_millis(100));
                return Self { bench, commands, start: start.get().unwrap(), fastest: 0.0, had_torque: false };
            }
        }
        panic!("{}", bench.world.ring().master().state());
    }

    pub(crate) fn command(&mut self, change: impl FnOnce(&mut CommandValues)) {
        let mut commands = self.commands.get();
        change(&mut commands);
        self.commands.set(commands);
    }

    /// S-0-0047, in degrees from where the axis began to follow.
    pub(crate) fn position(&mut self, degrees: f64) {
        let start = self.start;
        self.command(|commands| commands.position = start + (degrees * 10_000.0).round() as i32);
    }

    pub(crate) fn velocity(&mut self, rpm: i32) {
        self.command(|commands| commands.velocity = rpm * 10_000);
    }

    pub(crate) fn torque(&mut self, tenths: i16) {
        self.command(|commands| commands.torque = tenths);
    }

    pub(crate) fn switches(&mut self, bits: u16) {
        self.bench.world.ring_mut().master_mut().hold_switches(Some(bits));
    }

    /// Runs on and keeps the fastest speed.
    pub(crate) fn run(&mut self, milliseconds: u64) {
        for _ in 0..milliseconds * 4 {
            self.bench.run(Nanoseconds::from_microseconds(250));
            let rpm = self.bench.rpm().abs();
            self.fastest = self.fastest.max(rpm);
            self.had_torque |= self.bench.has_torque();
        }
    }

    /// Runs until the shaft stands and gives how long that took, in milliseconds.
    pub(crate) fn run_to_standstill(&mut self) -> f64 {
        let from = self.bench.world.now();
        for _ in 0..4_000 {
            self.run(1);
            if self.bench.rpm().abs() < 1.0 {
                break;
            }
        }
        (self.bench.world.now() - from).0 as f64 / 1e6
    }

    pub(crate) fn degrees(&mut self) -> f64 {
        let now = self.bench.world.now().0;
        self.bench.drive.motor_side.borrow_mut().machine().angle(now) * 360.0
    }

    /// S-0-0011 and S-0-0390, in the CP4 that the drive is in.
    pub(crate) fn diagnosis(&mut self) -> (u16, u16) {
        (self.bench.number(11) as u16, self.bench.number(390) as u16)
    }
}
