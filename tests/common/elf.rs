//! The flashed ELF on a ring, turning as a test commands it, and seen from outside to the count.

use std::cell::Cell;
use std::rc::Rc;

use bench::{DriveSetup, Elf, Elves, Executor, LineEdge, parameters_of};
use ring::Nanoseconds;
use ring::chip::{InterruptPin, RoutingSense};
use ring::ident::{Idn, Value};
use ring::master::{CommandValues, DriveScript, MasterScript, Motion, Telegram};
use ring::service_client::control;

use crate::running::{ADDRESS, Bench};

const REASON: &str = "is not set: run `cargo xtask test`, which builds the ELF and runs the tests in QEMU";

/// The law that takes t4 from the parameters, for tests that tell the chip otherwise behind the drive's back.
pub(crate) const FOLLOWS_THE_SHAFT: &str =
    "S-0-0051 follows the shaft and does not jump but by homing, S-0-0447 or rescaling";

/// Switched on and following.
pub(crate) const FOLLOW: u16 = control::ON | control::ENABLE | control::NO_HALT;

/// First of the chip's timer registers.
const TIMERS: u16 = 0x1A;

/// S-0-0051 counts so many in a revolution: 0.0001 degree.
pub(crate) const REVOLUTION: f64 = 3_600_000.0;

/// The programs that `cargo xtask test` has built.
pub(crate) fn on_qemu() -> Executor {
    Executor::Qemu(elves())
}

/// The same, on whatever CPU is free.
pub(crate) fn on_qemu_on_any_cpu() -> Executor {
    Executor::Qemu(Elves { one_cpu: false, ..elves() })
}

fn elves() -> Elves {
    let path = |name: &str| std::env::var_os(name).unwrap_or_else(|| panic!("{name} {REASON}"));
    Elves::new(path("PRODUCT_ELF"), path("BUS_PLUGIN"))
}

/// A press drive whose encoder counts 8.7 increments in a microsecond at 1 000 rpm, as fast as the board's filters let pass: what is
/// latched a microsecond late is seen.
pub(crate) fn fine_press() -> DriveSetup {
    let mut setup = DriveSetup::new(ADDRESS);
    setup.axis.machine.encoder.increments_per_revolution = 1 << 19;
    setup
}

/// A drive in velocity mode that turns as a test says.
pub(crate) struct Turning {
    pub(crate) bench: Bench,
    pub(crate) elf: Elf,
    velocity: Rc<Cell<i32>>,
    increments: f64,
    /// Register of the chip that says when t3 is, in microseconds behind the MST, and its bit of 05H.
    pub(crate) t3: (u16, u16),
    /// The same of t4.
    pub(crate) t4: (u16, u16),
    /// Where the encoder counted when S-0-0051 was zero.
    pub(crate) zero: u32,
}

impl Turning {
    /// In operation at standstill. With its first instruction the shaft turns at this speed, for 20 ms.
    pub(crate) fn new(setup: DriveSetup, turned_at_start: f64, parameters: Vec<(Idn, Value)>) -> Self {
        let axis = setup.axis;
        let telegram = Telegram::application(&[Idn(51), Idn(40)], &[Idn::VELOCITY_COMMAND]);
        let drive = DriveScript::new(setup.address, telegram)
            .with(Idn::OPERATION_MODE, Value::Word(2))
            .with_all(parameters_of(&axis))
            .with_all(parameters);
        let velocity = Rc::new(Cell::new(0));
        let commanded = Rc::clone(&velocity);
        let motion = Motion::new(1_000_000, move |_| CommandValues::at_velocity(commanded.get()));
        let script = MasterScript { motion: Some(motion), stops_at_refusals: false, ..MasterScript::new(vec![drive]) };
        let mut bench = Bench::on(on_qemu(), setup, script);
        let turn = |velocity, at| bench.drive.motor_side.borrow_mut().machine().set_velocity(velocity, at);
        if turned_at_start != 0.0 {
            turn(turned_at_start, 0);
            turn(0.0, 20_000_000);
        }
        for _ in 0..2_000 {
            bench.run(Nanoseconds::from_millis(5));
            if bench.is_in_operation() {
                break;
            }
        }
        assert!(bench.is_in_operation(), "{}", bench.world.ring().master().state());
        bench.world.ring_mut().master_mut().hold_switches(Some(FOLLOW));
        bench.run(Nanoseconds::from_millis(20));
        let elf = bench.drive.elf.clone().expect("it runs in QEMU");
        let increments = f64::from(axis.machine.encoder.increments_per_revolution);
        let mut turning = Self { bench, elf, velocity, increments, t3: (0, 0), t4: (0, 0), zero: 0 };
        [turning.t3, turning.t4] = [8, 7].map(|idn| {
            let time = turning.bench.number(idn) as u16;
            let chip = &mut *turning.bench.drive.chip.borrow_mut();
            // A t3 at the very end of the cycle is set a microsecond earlier.
            let mut is_it = |timer: &u16| {
                let set = chip.read_register(Nanoseconds::ZERO, TIMERS + timer);
                time.checked_sub(set).is_some_and(|earlier| earlier <= 1)
            };
            let timer = (0..4).find(&mut is_it).expect("one timer of the chip is its");
            (TIMERS + timer, chip.alternatives().event_map.timer_bit(usize::from(timer)))
        });
        let from = turning.watch_lines();
        turning.bench.run(Nanoseconds::from_millis(20));
        let (position, count) = *turning.positions_since(from).last().unwrap();
        let moved = (f64::from(position) / REVOLUTION * increments).round() as i64;
        turning.zero = count.wrapping_sub(moved as u32);
        turning
    }

    /// Position of the shaft, as the encoder counts.
    pub(crate) fn count(&mut self) -> u32 {
        let now = self.bench.world.now().0;
        self.bench.drive.motor_side.borrow_mut().machine().encoder_count(now)
    }

    /// Turns at a speed in rpm, and has reached it.
    pub(crate) fn turn(&mut self, rpm: i32) {
        self.velocity.set(rpm * 10_000);
        for _ in 0..600 {
            self.bench.run(Nanoseconds::from_millis(2));
            if (self.bench.rpm() - f64::from(rpm)).abs() < 1.0 {
                return;
            }
        }
        panic!("{rpm} rpm are not reached: {}", self.bench.rpm());
    }

    /// By how many counts a position in the weight of S-0-0051 differs from that of the shaft at a count, within a revolution.
    pub(crate) fn deviation(&self, position: i32, count: u32) -> f64 {
        let counted = f64::from(count.wrapping_sub(self.zero).cast_signed());
        let difference = f64::from(position) / REVOLUTION * self.increments - counted;
        let half = self.increments / 2.0;
        (difference + half).rem_euclid(self.increments) - half
    }

    /// Keeps the edges of the chip's lines from now on.
    pub(crate) fn watch_lines(&self) -> Nanoseconds {
        self.elf.tape.borrow_mut().edges = Some(Vec::new());
        self.bench.world.now()
    }

    /// The line on which the chip tells of t4.
    pub(crate) fn line_of_t4(&self) -> InterruptPin {
        const ROUTING: u16 = 0x09;
        let chip = &mut *self.bench.drive.chip.borrow_mut();
        let routed = chip.read_register(Nanoseconds::ZERO, ROUTING) & self.t4.1 != 0;
        let one = chip.alternatives().routing_sense == RoutingSense::ZeroIsInt0;
        if routed == one { InterruptPin::Int1 } else { InterruptPin::Int0 }
    }

    /// The edges at which t4 was told so far.
    pub(crate) fn edges_of_t4(&self) -> Vec<LineEdge> {
        let (tape, line) = (self.elf.tape.borrow(), self.line_of_t4());
        tape.edges.iter().flatten().filter(|edge| edge.line == line && edge.status & self.t4.1 != 0).copied().collect()
    }

    /// S-0-0051 of every AT since then, and where the shaft was at the t4 before it.
    pub(crate) fn positions_since(&self, from: Nanoseconds) -> Vec<(i32, u32)> {
        let edges = self.edges_of_t4();
        let samples = self.bench.world.ring().master().report().samples.iter();
        samples
            .filter_map(|sample| {
                let edge = edges.iter().rev().find(|edge| edge.time < sample.time)?;
                Some((sample.position?, edge.count)).filter(|_| edge.time > from)
            })
            .collect()
    }

    /// The greatest deviation of a position from the shaft, in counts, and how many were looked at.
    pub(crate) fn worst_since(&self, from: Nanoseconds) -> (f64, usize) {
        let positions = self.positions_since(from);
        let deviations = positions.iter().map(|(position, count)| self.deviation(*position, *count));
        (deviations.fold(0.0, worse), positions.len())
    }
}

/// The one that is farther from zero.
pub(crate) fn worse(one: f64, other: f64) -> f64 {
    if other.abs() > one.abs() { other } else { one }
}
