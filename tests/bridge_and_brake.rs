//! Bridge and brake of the flashed ELF: in which order they switch, what a trip of the current loop does, and cycles of the current loop that
//! come too late.

use crate::elf::{FOLLOW, Turning, on_qemu};
use crate::running::{ADDRESS, Bench};
use bench::{DriveSetup, Elf, Works};
use ring::Nanoseconds;
use ring::service_client::control;
use std::cell::Cell;
use std::rc::Rc;

const HALT: u16 = control::ON | control::ENABLE;
const OFF: u16 = control::ENABLE | control::NO_HALT;
/// S-0-0206 and S-0-0207 of the vertical axis.
const BRAKE_DELAY: Nanoseconds = Nanoseconds::from_millis(60);
/// A period of the current loop.
const PERIOD: Nanoseconds = Nanoseconds(62_500);
/// Two ticks of the supervision.
const SUPERVISION: Nanoseconds = Nanoseconds::from_millis(1);
/// TIM1_SR and TIM1_BDTR.
const STATUS: u32 = 0x4001_0010;
const OUTPUTS: u32 = 0x4001_0044;
const BREAK_FLAG: u32 = 1 << 7;
const OUTPUTS_ENABLED: u32 = 1 << 15;

struct Axis {
    bench: Bench,
    elf: Elf,
}

impl Axis {
    /// The vertical axis, which nobody has switched on yet.
    fn new() -> Self {
        let mut bench = Bench::vertical_on(on_qemu(), Works::OfItsAxis);
        while bench.world.ring().master().phase() < 4 {
            assert!(bench.world.now() < Nanoseconds::from_millis(20_000), "{}", bench.world.ring().master().state());
            bench.run(Nanoseconds::from_millis(2));
        }
        let elf = bench.drive.elf.clone().expect("it runs in QEMU");
        elf.guest.borrow_mut().watch_accesses(&[STATUS, OUTPUTS]);
        Self { bench, elf }
    }

    fn switches(&mut self, bits: u16) -> Nanoseconds {
        self.bench.world.ring_mut().master_mut().hold_switches(Some(bits));
        self.bench.world.now()
    }

    fn run(&mut self, milliseconds: u64) {
        self.bench.run(Nanoseconds::from_millis(milliseconds));
    }

    /// Switches on with an edge of bit 15, and gives when bridge and coil came on and when the axis followed; `None`: it did not.
    fn switch_on(&mut self) -> [Option<Nanoseconds>; 3] {
        self.switches(0);
        self.run(20);
        let from = self.switches(FOLLOW);
        self.run(400);
        let samples = self.bench.world.ring().master().report().samples.iter();
        let follows = samples
            .filter(|sample| sample.time > from && sample.status.is_some_and(|status| status & 1 << 3 != 0))
            .map(|sample| sample.time)
            .next();
        let [bridge, coil] = self.since(from, true);
        [bridge, coil, follows]
    }

    /// When bridge and coil first came on or went off since then.
    fn since(&self, from: Nanoseconds, on: bool) -> [Option<Nanoseconds>; 2] {
        let tape = self.elf.tape.borrow();
        [&tape.bridge, &tape.coil]
            .map(|events| events.iter().find(|(time, to)| *time > from && *to == on).map(|(time, _)| *time))
    }

    /// The latch of a trip.
    fn tripped(&self) -> bool {
        let guest = &mut *self.elf.guest.borrow_mut();
        let (address, _) = guest.symbol("board::bridge::TRIPPED").expect("the latch of a trip has a name");
        guest.read_memory(address & !3, 1).unwrap()[0] >> (8 * (address & 3)) & 0xFF != 0
    }

    fn is_on(&self) -> bool {
        self.bench.has_torque()
    }
}

#[track_caller]
fn within(what: &str, span: Nanoseconds, shortest: Nanoseconds, longest: Nanoseconds) {
    println!("{what}: {span}");
    assert!((shortest..=longest).contains(&span), "{what}: {span}, expected {shortest} to {longest}");
}

#[test]
#[ignore = "needs QEMU and the ELF: cargo xtask test"]
fn bridge_and_brake_switch_in_their_order_and_times_and_a_trip_takes_the_bridge_off_until_it_is_cleared() {
    let mut axis = Axis::new();
    let milliseconds = Nanoseconds::from_millis;

    let [bridge, coil, follows] = axis.switch_on().map(|event| event.expect("it is switched on"));
    within("bridge on to brake energised", coil - bridge, milliseconds(1), milliseconds(100));
    within("brake energised to following", follows - coil, BRAKE_DELAY, BRAKE_DELAY + milliseconds(6));

    let halted = axis.switches(HALT);
    axis.run(200);
    assert_eq!(axis.since(halted, false), [None, None], "HALT holds with torque");

    let off = axis.switches(OFF);
    axis.run(400);
    let [bridge, coil] = axis.since(off, false).map(|event| event.expect("it is switched off"));
    within("bit 15 off to brake without current", coil - off, Nanoseconds(1), milliseconds(6));
    within("brake without current to bridge off", bridge - coil, BRAKE_DELAY, BRAKE_DELAY + milliseconds(150));

    axis.switch_on()[2].expect("it is switched on again");
    let opened = axis.bench.world.now();
    axis.bench.drive.motor_side.borrow_mut().change_inputs(|inputs| {
        inputs.safe_torque_1 = false;
        inputs.safe_torque_2 = false;
    });
    axis.run(20);
    let [bridge, coil] = axis.since(opened, false).map(|event| event.expect("safe torque off"));
    within("safe torque off to bridge off", bridge - opened, Nanoseconds(1), SUPERVISION);
    within("bridge off to brake without current", coil - bridge, Nanoseconds::ZERO, Nanoseconds::from_microseconds(20));
    axis.bench.drive.motor_side.borrow_mut().change_inputs(|inputs| {
        inputs.safe_torque_1 = true;
        inputs.safe_torque_2 = true;
    });
    axis.run(50);
    axis.bench.clear_errors();

    axis.switch_on()[2].expect("it is switched on once more");
    assert!(!axis.tripped());
    let now = axis.bench.world.now();
    axis.bench.drive.motor_side.borrow_mut().machine().fail_current_sensor(0, Some(4_095), now.0);
    axis.run(20);
    let [bridge, coil] = axis.since(now, false).map(|event| event.expect("a trip"));
    // The converters hold the currents at every peak, and the current loop is done 10 us later.
    within("trip to bridge off", bridge - now, Nanoseconds(1), PERIOD + Nanoseconds::from_microseconds(10));
    within("bridge off to brake without current", coil - bridge, Nanoseconds(1), SUPERVISION);
    assert!(axis.tripped(), "a trip is latched");
    axis.bench.drive.motor_side.borrow_mut().machine().fail_current_sensor(0, None, now.0);
    assert_eq!(axis.bench.number(390), 0xF107);

    assert_eq!(axis.switch_on(), [None; 3], "switched on with an error");
    assert!(axis.tripped() && !axis.is_on());
    axis.bench.clear_errors();
    assert!(axis.tripped() && !axis.is_on(), "S-0-0099 alone switches nothing on");
    let acknowledged = axis.elf.guest.borrow().measurements().watched.len();
    axis.switch_on()[2].expect("it is switched on after S-0-0099");
    assert!(!axis.tripped() && axis.is_on());
    // It is acknowledged with the bridge held off: the outputs are switched off just before the flags are cleared.
    let guest = axis.elf.guest.borrow();
    let watched = &guest.measurements().watched[acknowledged..];
    let written: Vec<_> = watched.iter().filter(|access| access.writes).copied().collect();
    let on = written.iter().position(|write| write.address == OUTPUTS && write.value & OUTPUTS_ENABLED != 0);
    let before = &written[..on.expect("the bridge is switched on")];
    let clearings =
        before.iter().enumerate().filter(|(_, write)| write.address == STATUS && write.value & BREAK_FLAG == 0);
    let mut seen = 0;
    for (place, clearing) in clearings {
        let held = place.checked_sub(1).map(|before| written[before]);
        let holds = held.is_some_and(|held| held.address == OUTPUTS && held.value & OUTPUTS_ENABLED == 0);
        assert!(holds && clearing.time - held.unwrap().time < Nanoseconds(200), "{held:?}, {clearing:?}");
        seen += 1;
    }
    assert!(seen > 0, "{written:?}");
}

/// Holds cycles of the current loop for these spans, in us, one after the other.
fn hold_cycles(turning: &mut Turning, spans: &[u64]) {
    let spans: Vec<Nanoseconds> = spans.iter().map(|span| Nanoseconds::from_microseconds(*span)).collect();
    let done = Rc::new(Cell::new(false));
    let told = Rc::clone(&done);
    turning.elf.hold_cycles(&spans, move || told.set(true)).unwrap();
    turning.bench.run(Nanoseconds::from_millis(2));
    assert!(done.get());
}

#[test]
#[ignore = "needs QEMU and the ELF: cargo xtask test"]
fn a_late_or_missing_cycle_of_the_current_loop_is_counted_and_two_in_a_row_take_the_bridge_off() {
    let mut turning = Turning::new(DriveSetup::new(ADDRESS), 0.0, vec![]);
    turning.turn(300);
    let mut late = turning.bench.number(0x8000 | 153);
    // The handler begins 2 us behind the peak of the counter. The compare values are due 31 us behind it, the next cycle 64 us behind it.
    for (spans, counted) in [
        (&[27][..], 0),
        (&[32], 1),
        (&[27], 0),
        // The next cycle begins late as well, and has not been held.
        (&[70], 1),
        (&[32, 0, 32], 2),
        (&[70, 0, 0, 32], 2),
    ] {
        // Both periods of a tick.
        for later in [0, 62_500] {
            turning.bench.run(Nanoseconds::from_millis(3) + Nanoseconds(later));
            hold_cycles(&mut turning, spans);
            turning.bench.run(Nanoseconds::from_millis(50));
            let now = turning.bench.number(0x8000 | 153);
            println!("{spans:?} us: {} cycles late", now - late);
            assert_eq!(now - late, counted, "{spans:?}");
            late = now;
            assert!(turning.bench.has_torque() && turning.bench.is_in_operation(), "{spans:?}");
        }
    }
    let from = turning.bench.world.now();
    hold_cycles(&mut turning, &[32, 32]);
    turning.bench.run(Nanoseconds::from_millis(10));
    let off = turning.elf.tape.borrow().bridge.iter().find(|(time, on)| *time > from && !on).map(|(time, _)| *time);
    // The second of them comes 62.5 us behind the first at the latest.
    within(
        "two late cycles to bridge off",
        off.expect("the bridge is off") - from,
        Nanoseconds(1),
        PERIOD + PERIOD + PERIOD,
    );
    assert_eq!(turning.bench.number(390), 0xF111);
    assert_eq!(turning.bench.number(0x8000 | 153) - late, 2);
}
