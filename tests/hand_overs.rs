//! The hand-overs of the flashed ELF between its tasks, and between the chip and its handlers, with the interrupt at every instruction.
//!
//! A handler is stopped before its first instruction, then before its second one in the next cycle, and so on until it is at its end. Each time it
//! stands there until what is to come in between has come.

use crate::elf::{FOLLOW, Turning, fine_press};
use crate::running::ADDRESS;
use bench::DriveSetup;
use emulator::{EmulatorError, Guest, Hold, StopAt, Stopped, Watched};
use ring::Nanoseconds;
use ring::chip::{Alternatives, InterruptOutput};
use ring::ident::{Idn, Value};
use ring::service_client::Request;
use std::cell::{Cell, RefCell};
use std::collections::BTreeSet;
use std::ops::Range;
use std::rc::Rc;

/// Number of the exception of the first interrupt.
const FIRST: u16 = 16;
/// End of conversion: the current loop.
const ADC: u8 = 18;
/// The control loop, on a vector of CAN2.
const CONTROL_LOOP: u8 = 63;
/// CAN2_RX1.
const VELOCITY_LOOP: u8 = 65;
/// INT1 and INT0 of the chip.
const INT1: u8 = 8;
const INT0: u8 = 9;

/// Whether a handler that begins is one of those that are swept.
type Choose = Box<dyn FnMut(&mut Guest, &Place) -> Result<bool, EmulatorError>>;
/// What happens at an instruction of a handler.
type Act = Box<dyn FnMut(&mut Guest, &Place) -> Result<(), EmulatorError>>;

/// Where a handler was stopped.
#[derive(Clone, Copy, Debug)]
struct Place {
    now: Nanoseconds,
    pc: u32,
}

/// What a sweep has seen.
#[derive(Debug, Default)]
struct Swept {
    /// Stops within the handler.
    stops: u32,
    /// Instructions before which it was stopped.
    instructions: BTreeSet<u32>,
    done: bool,
}

struct Sweep {
    exception: u16,
    handler: u32,
    step: u32,
    /// Stops in a row beyond the end of the handler.
    beyond: u32,
    at_entry: Choose,
    at_step: Act,
    swept: Rc<RefCell<Swept>>,
}

impl Sweep {
    /// So many stops in a row beyond its end, and a handler has been swept: it is not always equally long.
    const BEYOND: u32 = 24;

    fn stopped(&mut self, guest: &mut Guest, stopped: Stopped, entry: bool) -> Result<bool, EmulatorError> {
        let Stopped { now, pc, exception } = stopped;
        if entry {
            if !(self.at_entry)(guest, &Place { now, pc })? {
                guest.stop_at(StopAt { address: self.handler, behind: 0 })?;
                return Ok(true);
            }
            if self.step > 0 {
                guest.stop_at(StopAt { address: StopAt::HERE, behind: self.step })?;
                return Ok(false);
            }
        }
        let swept = &mut *self.swept.borrow_mut();
        let inside = exception == self.exception;
        self.beyond = if inside { 0 } else { self.beyond + 1 };
        if inside {
            swept.stops += 1;
            swept.instructions.insert(pc);
            (self.at_step)(guest, &Place { now, pc })?;
        }
        self.step += 1;
        swept.done = self.beyond >= Self::BEYOND;
        if !swept.done {
            guest.stop_at(StopAt { address: self.handler, behind: 0 })?;
        }
        Ok(true)
    }
}

/// Sweeps the handler of an interrupt; the world looks every `look`.
fn sweep(
    turning: &mut Turning,
    interrupt: u8,
    at_entry: Choose,
    at_step: Act,
    mut look: impl FnMut(&mut Turning),
) -> Swept {
    let swept = Rc::new(RefCell::new(Swept::default()));
    let handler = turning.elf.guest.borrow_mut().handler_of(interrupt).unwrap();
    let mut sweep = Sweep {
        exception: FIRST + u16::from(interrupt),
        handler,
        step: 0,
        beyond: 0,
        at_entry,
        at_step,
        swept: Rc::clone(&swept),
    };
    let mut entry = true;
    *turning.elf.on_stop.borrow_mut() = Some(Box::new(move |guest, stopped| {
        entry = sweep.stopped(guest, stopped, entry)?;
        Ok(())
    }));
    turning.elf.guest.borrow_mut().stop_at(StopAt { address: handler, behind: 0 }).unwrap();
    while !swept.borrow().done {
        look(turning);
        assert!(turning.bench.has_torque(), "the drive has switched off: {:?}", swept.borrow().stops);
    }
    *turning.elf.on_stop.borrow_mut() = None;
    Rc::try_unwrap(swept).map_or_else(|shared| shared.take(), RefCell::into_inner)
}

/// The words of the static through which the current loop and the control loop speak with each other.
fn link(guest: &mut Guest) -> Result<Vec<u32>, EmulatorError> {
    let (address, bytes) = guest.symbol("app::app::LINK").expect("the link has a name");
    guest.read_memory(address, bytes as usize / 4)
}

/// Those that the chip has an event of these bits of 05H for.
fn of_event(turning: &Turning, bits: u16) -> Choose {
    let chip = Rc::clone(&turning.bench.drive.chip);
    Box::new(move |_, place| Ok(chip.borrow_mut().read_register(place.now, 0x05) & bits != 0))
}

/// Greatest torque-producing current while the drive turns on, as a fraction of the peak current, looked at in each period of the current loop.
fn greatest_current(turning: &mut Turning, periods: u32) -> f64 {
    let mut greatest = 0.0_f64;
    for _ in 0..periods {
        turning.bench.run(Nanoseconds(62_500));
        greatest = greatest.max(turning.bench.drive.motor_side.borrow_mut().current().abs());
    }
    greatest
}

#[test]
#[ignore = "needs QEMU and the ELF: cargo xtask test"]
fn the_current_loop_at_every_instruction_of_the_control_loop_reads_no_half_of_a_message_and_disturbs_no_torque() {
    let mut turning = Turning::new(DriveSetup::new(ADDRESS), 0.0, vec![]);
    turning.turn(1_000);
    turning.bench.run(Nanoseconds::from_millis(300));
    let quiet = greatest_current(&mut turning, 2_000);

    // How many messages were sent: the word that grows by one from one control loop to the next.
    let entries: Rc<RefCell<Vec<Vec<u32>>>> = Rc::default();
    let seen = Rc::clone(&entries);
    let handler = turning.elf.guest.borrow_mut().handler_of(CONTROL_LOOP).unwrap();
    *turning.elf.on_stop.borrow_mut() = Some(Box::new(move |guest, _| {
        seen.borrow_mut().push(link(guest)?);
        guest.stop_at(StopAt { address: handler, behind: 0 })
    }));
    turning.elf.guest.borrow_mut().stop_at(StopAt { address: handler, behind: 0 }).unwrap();
    turning.bench.run(Nanoseconds::from_millis(3));
    *turning.elf.on_stop.borrow_mut() = None;
    let entries = entries.take();
    let counts = |word: usize| entries.windows(2).all(|pair| pair[1][word] == pair[0][word].wrapping_add(1));
    let counters: Vec<usize> = (0..entries[0].len()).filter(|word| counts(*word)).collect();
    let [sent] = counters[..] else { panic!("one word counts the messages: {counters:?}") };

    // Words that a message has changed before it was sent, of the even and the odd ones.
    let written: Rc<RefCell<[BTreeSet<usize>; 2]>> = Rc::default();
    let wrong: Rc<RefCell<Vec<String>>> = Rc::default();
    // Those that change behind it: the velocity loop's correction.
    let corrected: Rc<RefCell<[BTreeSet<usize>; 2]>> = Rc::default();
    let before: Rc<RefCell<Vec<u32>>> = Rc::default();
    let pending: Rc<RefCell<Option<Vec<u32>>>> = Rc::default();
    let halves = Rc::new(RefCell::new(0));
    let at_entry: Choose = {
        let (before, pending, written, wrong) =
            (Rc::clone(&before), Rc::clone(&pending), Rc::clone(&written), Rc::clone(&wrong));
        let corrected = Rc::clone(&corrected);
        Box::new(move |guest, place| {
            let now = link(guest)?;
            // Of a message that had been sent when the handler was stopped no more than a single word has changed since.
            if let Some(then) = pending.borrow_mut().take() {
                let side = (then[sent] & 1) as usize;
                let message = &written.borrow()[side];
                let changed: Vec<usize> = message.iter().copied().filter(|word| then[*word] != now[*word]).collect();
                if then[sent] == now[sent] && changed.len() > 1 {
                    wrong.borrow_mut().push(format!("behind its sending, before {}: {changed:?}", place.now));
                }
                if then[sent] == now[sent] {
                    corrected.borrow_mut()[side].extend(changed);
                }
            }
            *before.borrow_mut() = now;
            Ok(true)
        })
    };
    let at_step: Act = {
        let (before, pending, written, halves) =
            (Rc::clone(&before), Rc::clone(&pending), Rc::clone(&written), Rc::clone(&halves));
        Box::new(move |guest, _| {
            let (now, before) = (link(guest)?, before.borrow());
            if now[sent] == before[sent] {
                let next = (before[sent].wrapping_add(1) & 1) as usize;
                let changed: Vec<usize> = (0..now.len()).filter(|word| now[*word] != before[*word]).collect();
                *halves.borrow_mut() += u32::from(!changed.is_empty());
                written.borrow_mut()[next].extend(changed);
            } else {
                *pending.borrow_mut() = Some(now);
            }
            guest.hold(Hold::Interrupt(ADC));
            Ok(())
        })
    };
    let late = turning.bench.number(0x8000 | 153);
    let mut greatest = 0.0_f64;
    let swept = sweep(&mut turning, CONTROL_LOOP, at_entry, at_step, |turning| {
        greatest = greatest.max(greatest_current(turning, 16));
    });
    let [even, odd] = &*written.borrow();
    println!(
        "{} instructions of the control loop swept in {} ticks, {} of them within a message of {} words; current {quiet:.4} before, {greatest:.4} \
         at most",
        swept.instructions.len(),
        swept.stops,
        halves.borrow(),
        even.len()
    );
    assert!(swept.instructions.len() > 300 && *halves.borrow() > 5, "{swept:?}");
    assert!(even.len() >= 6 && even.is_disjoint(odd), "one message is written while it is read: {even:?}, {odd:?}");
    assert!(wrong.borrow().is_empty(), "{:?}", wrong.borrow());
    let corrected = &*corrected.borrow();
    assert!(corrected.iter().all(|words| words.len() == 1), "always the same word of each message: {corrected:?}");
    assert_eq!(turning.bench.number(0x8000 | 153), late, "a cycle came late");
    assert_eq!(turning.bench.number(11), 0);
    assert!(greatest < 1.5 * quiet + 0.01, "{quiet} before, {greatest}");
}

#[test]
#[ignore = "needs QEMU and the ELF: cargo xtask test"]
fn the_current_loop_at_every_instruction_of_the_velocity_loop_disturbs_no_torque() {
    let mut turning = Turning::new(DriveSetup::new(ADDRESS), 0.0, vec![]);
    turning.turn(1_000);
    turning.bench.run(Nanoseconds::from_millis(300));
    let quiet = greatest_current(&mut turning, 2_000);
    let late = turning.bench.number(0x8000 | 153);
    // Held for a whole cycle of the current loop, the task of t4 would be too late for its AT.
    let (begins, cycle, t4) = {
        let report = turning.bench.world.ring().master().report();
        let [.., before, last] = &report.samples[..] else { panic!("the ring has run for long") };
        (last.time.0, last.time.0 - before.time.0, u64::from(report.slots.as_ref().unwrap().t4) * 1_000)
    };
    let is_quiet = move |now: u64| (200_000..cycle - 300_000).contains(&((now - begins + cycle - t4) % cycle));
    let (at_entry, at_step): (Choose, Act) = (
        Box::new(move |_, place| Ok(is_quiet(place.now.0))),
        Box::new(|guest, _| {
            guest.hold(Hold::Interrupt(ADC));
            Ok(())
        }),
    );
    let mut greatest = 0.0_f64;
    let swept = sweep(&mut turning, VELOCITY_LOOP, at_entry, at_step, |turning| {
        greatest = greatest.max(greatest_current(turning, 16));
    });
    println!(
        "{} instructions of the velocity loop swept in {} ticks; current {quiet:.4} before, {greatest:.4} at most",
        swept.instructions.len(),
        swept.stops
    );
    assert!(swept.instructions.len() > 100, "{swept:?}");
    assert_eq!(turning.bench.number(0x8000 | 153), late, "a cycle came late");
    assert_eq!(turning.bench.number(11), 0);
    assert!(greatest < 1.5 * quiet + 0.01, "{quiet} before, {greatest}");
}

/// Word 0 of service container 0 on the external bus.
const SERVICE_CONTAINER: u32 = 0x6000_0000 + 2 * 0x70;
/// Bit of 05H of service container 0.
const SERVICE_EVENT: u16 = 1;
/// TIM1_ARR: the trim of the tick to the ring.
const RELOAD: u32 = 0x4001_002C;
/// Half a period without trim.
const HALF_PERIOD: u32 = 5_250;

/// Greatest trim of the current loop's period since then, in counts of 168 MHz.
fn greatest_trim(turning: &Turning, since: Nanoseconds) -> u32 {
    let guest = turning.elf.guest.borrow();
    let reloads = guest.measurements().watched.iter().filter(|access| access.address == RELOAD && access.time > since);
    reloads.map(|access| access.value.abs_diff(HALF_PERIOD)).max().unwrap_or(0)
}

/// A new event of the chip at every instruction of the handler of its common line: while the status is read and cleared, while the line is
/// acknowledged, behind all of it.
fn new_events_while_the_last_is_served(output: InterruptOutput) {
    let alternatives = Alternatives { interrupt_output: output, ..Alternatives::default() };
    let mut turning = Turning::new(DriveSetup { alternatives, ..DriveSetup::new(ADDRESS) }, 0.0, vec![]);
    turning.turn(1_000);
    turning.elf.guest.borrow_mut().watch_accesses(&[SERVICE_CONTAINER]);
    let from = turning.watch_lines();
    let raised: Rc<RefCell<Vec<(Nanoseconds, u32)>>> = Rc::default();
    let mut instructions = BTreeSet::new();
    // While there is something to serve, and at the other edge, that of the acknowledgement, which finds nothing.
    for something in [true, false] {
        let act: Act = {
            let (chip, raised) = (Rc::clone(&turning.bench.drive.chip), Rc::clone(&raised));
            Box::new(move |_, place| {
                chip.borrow_mut().raise(place.now, SERVICE_EVENT);
                raised.borrow_mut().push((place.now, place.pc));
                Ok(())
            })
        };
        let choose: Choose = {
            let (raised, mut is_t3) = (Rc::clone(&raised), of_event(&turning, turning.t3.1));
            Box::new(move |guest, place| {
                // What is raised makes edges, too.
                let last = raised.borrow().last().map_or(Nanoseconds::ZERO, |(time, _)| *time);
                Ok(is_t3(guest, place)? == something && place.now > last + Nanoseconds::from_millis(1))
            })
        };
        let swept = sweep(&mut turning, INT0, choose, act, |turning| turning.bench.run(Nanoseconds::from_millis(2)));
        instructions.extend(swept.instructions);
    }
    turning.bench.run(Nanoseconds::from_millis(20));
    let raised = raised.borrow();
    let guest = turning.elf.guest.borrow();
    let looks: Vec<Nanoseconds> =
        guest.measurements().watched.iter().filter(|access| !access.writes).map(|access| access.time).collect();
    let lost: Vec<String> = raised
        .iter()
        .filter(|(time, _)| {
            let next = looks.partition_point(|look| look <= time);
            looks.get(next).is_none_or(|look| *look - *time > Nanoseconds::from_microseconds(300))
        })
        .map(|(time, pc)| format!("{time} at {pc:08x}"))
        .collect();
    drop(guest);
    let (worst, positions) = turning.worst_since(from);
    println!(
        "{output:?}: {} instructions of the handler swept with {} events, {} lost; {positions} positions off by {worst:.2} counts at most",
        instructions.len(),
        raised.len(),
        lost.len()
    );
    assert!(lost.is_empty(), "{output:?}: {lost:?}");
    assert!(instructions.len() > 100 && positions > 50, "{instructions:x?}");
    assert!(worst.abs() < 0.5, "{worst}");
    let status = turning.bench.drive.chip.borrow_mut().read_register(Nanoseconds::ZERO, 0x05);
    assert_eq!(status & SERVICE_EVENT, 0);
    assert_eq!(turning.bench.number(11), 0);
}

#[test]
#[ignore = "needs QEMU and the ELF: cargo xtask test"]
fn an_event_of_the_chip_at_every_instruction_of_its_handler_is_served_and_no_edge_is_lost() {
    for output in [InterruptOutput::ActiveLowLevel, InterruptOutput::ActiveHighPulse] {
        new_events_while_the_last_is_served(output);
    }
}

/// Moves t4 to so many microseconds behind the edge of t3, and gives where t3 is.
fn t4_behind_t3(turning: &mut Turning, microseconds: i32) {
    let t3 = turning.bench.number(8) as i32;
    let now = turning.bench.world.now();
    turning.bench.drive.laws.borrow_mut().dismiss(crate::elf::FOLLOWS_THE_SHAFT);
    turning.bench.drive.chip.borrow_mut().write_register(now, turning.t4.0, (t3 + microseconds) as u16);
    turning.bench.run(Nanoseconds::from_millis(20));
}

#[test]
#[ignore = "needs QEMU and the ELF: cargo xtask test"]
fn t4_at_every_instruction_of_the_handler_of_t3_and_t3_at_every_instruction_of_that_of_t4_latch_both() {
    for (behind, held, other) in [(9, INT0, INT1), (-9, INT1, INT0)] {
        let mut turning = Turning::new(fine_press(), 0.0, vec![]);
        t4_behind_t3(&mut turning, behind);
        turning.turn(1_000);
        turning.elf.guest.borrow_mut().watch_accesses(&[RELOAD]);
        let quiet_since = turning.bench.world.now();
        turning.bench.run(Nanoseconds::from_millis(100));
        let quiet = greatest_trim(&turning, quiet_since);
        let from = turning.watch_lines();
        let event = if held == INT0 { turning.t3.1 } else { turning.t4.1 };
        // The other event comes 9 us behind this one: a handler that has gone on for longer has it behind it, and is swept.
        let begun: Rc<Cell<Nanoseconds>> = Rc::default();
        let (begins, mut choose) = (Rc::clone(&begun), of_event(&turning, event));
        let choose: Choose = Box::new(move |guest, place| {
            begins.set(place.now);
            choose(guest, place)
        });
        let act: Act = Box::new(move |guest, place| {
            if place.now - begun.get() < Nanoseconds::from_microseconds(8) {
                guest.hold(Hold::Interrupt(other));
            }
            Ok(())
        });
        let swept = sweep(&mut turning, held, choose, act, |turning| turning.bench.run(Nanoseconds::from_millis(2)));
        turning.bench.run(Nanoseconds::from_millis(20));
        let (worst, positions) = turning.worst_since(from);
        let trim = greatest_trim(&turning, from);
        println!(
            "vector {held} held until {other}: {} instructions swept in {} cycles; {positions} positions off by {worst:.2} counts at most; trim {quiet} \
             before, {trim} at most",
            swept.instructions.len(),
            swept.stops
        );
        assert!(swept.instructions.len() > 40 && positions > 50, "{swept:?}");
        assert!(worst.abs() < 0.5, "{worst}");
        assert!(trim <= quiet + 3, "{quiet} before, {trim}");
        assert_eq!(turning.bench.number(11), 0);
    }
}

#[test]
#[ignore = "needs QEMU and the ELF: cargo xtask test"]
fn the_phase_of_t3_is_measured_alike_with_the_current_loop_at_every_instruction_of_its_handler() {
    let mut turning = Turning::new(DriveSetup::new(ADDRESS), 0.0, vec![]);
    turning.elf.guest.borrow_mut().watch_accesses(&[RELOAD]);
    let quiet_since = turning.bench.world.now();
    turning.bench.run(Nanoseconds::from_millis(300));
    let quiet = greatest_trim(&turning, quiet_since);
    // Where in the tick t3 comes: in its second half, so that the next current loop begins another one.
    let ticks: Rc<RefCell<Vec<Nanoseconds>>> = Rc::default();
    let seen = Rc::clone(&ticks);
    let handler = turning.elf.guest.borrow_mut().handler_of(CONTROL_LOOP).unwrap();
    *turning.elf.on_stop.borrow_mut() = Some(Box::new(move |guest, stopped| {
        seen.borrow_mut().push(stopped.now);
        guest.stop_at(StopAt { address: handler, behind: 0 })
    }));
    turning.elf.guest.borrow_mut().stop_at(StopAt { address: handler, behind: 0 }).unwrap();
    turning.watch_lines();
    turning.bench.run(Nanoseconds::from_millis(10));
    *turning.elf.on_stop.borrow_mut() = None;
    let edge = {
        let tape = turning.elf.tape.borrow();
        tape.edges.iter().flatten().find(|edge| edge.status & turning.t3.1 != 0).unwrap().time
    };
    let ticks = ticks.take();
    let since = edge - *ticks.iter().rev().find(|tick| **tick < edge).unwrap();
    println!("t3 comes {since} behind the beginning of a control loop");
    assert!((Nanoseconds(70_000)..Nanoseconds(115_000)).contains(&since), "{since}");

    let from = turning.bench.world.now();
    let act: Act = Box::new(move |guest, _| {
        guest.hold(Hold::Interrupt(ADC));
        Ok(())
    });
    let choose = of_event(&turning, turning.t3.1);
    let swept = sweep(&mut turning, INT0, choose, act, |turning| turning.bench.run(Nanoseconds::from_millis(2)));
    turning.bench.run(Nanoseconds::from_millis(50));
    let trim = greatest_trim(&turning, from);
    println!(
        "{} instructions of the handler of t3 swept in {} cycles, trim {quiet} before, {trim} at most",
        swept.instructions.len(),
        swept.stops
    );
    assert!(swept.instructions.len() > 40, "{swept:?}");
    assert!(trim <= quiet + 3, "{quiet} before, {trim}");
    assert_eq!(turning.bench.number(11), 0);
}

/// TIM1_SR and TIM1_BDTR.
const STATUS: u32 = 0x4001_0010;
const OUTPUTS: u32 = 0x4001_0044;
const BREAK_FLAG: u32 = 1 << 7;
const OUTPUTS_ENABLED: u32 = 1 << 15;

/// Switches the axis off and on again, and gives the writes to TIM1 of the latter.
fn off_and_on(turning: &mut Turning) -> Vec<Watched> {
    turning.bench.world.ring_mut().master_mut().hold_switches(Some(0));
    turning.bench.run(Nanoseconds::from_millis(12));
    let before = turning.elf.guest.borrow().measurements().watched.len();
    turning.bench.world.ring_mut().master_mut().hold_switches(Some(FOLLOW));
    turning.bench.run(Nanoseconds::from_millis(8));
    let guest = turning.elf.guest.borrow();
    guest.measurements().watched[before..].iter().filter(|access| access.writes).copied().collect()
}

/// The last acknowledgement of a trip among these.
fn last_acknowledgement(writes: &[Watched]) -> Option<&Watched> {
    writes.iter().rfind(|write| write.address == STATUS && write.value & BREAK_FLAG == 0)
}

/// What is done at an instruction while the bridge is switched on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Trip {
    /// The break input is low for one instruction.
    Break,
    /// The current loop finds an overcurrent.
    CurrentLoop,
}

/// A trip at every instruction from the acknowledgement of the last one to the second look behind the store that switches on.
fn trips_while_switching_on(turning: &mut Turning, trip: Trip) {
    let link_at = turning.elf.guest.borrow().symbol("app::app::LINK").unwrap().0;
    // The words that are 1 with torque and 0 without, in both messages: the order to regulate.
    let words = |turning: &Turning| link(&mut turning.elf.guest.borrow_mut()).unwrap();
    let with_torque = words(turning);
    turning.bench.world.ring_mut().master_mut().hold_switches(Some(0));
    turning.bench.run(Nanoseconds::from_millis(12));
    let without = words(turning);
    let orders: Vec<u32> = (0..without.len())
        .filter(|word| with_torque[*word] == 1 && without[*word] == 0)
        .map(|word| link_at + 4 * word as u32)
        .collect();
    assert_eq!(orders.len(), 2, "{orders:x?}");
    let writes = off_and_on(turning);
    assert!(turning.bench.has_torque(), "{writes:x?}");
    let first = writes.iter().find(|write| write.address == OUTPUTS).unwrap().pc;
    let on = writes.iter().position(|write| write.address == OUTPUTS && write.value & OUTPUTS_ENABLED != 0).unwrap();
    assert!(last_acknowledgement(&writes[..on]).is_some());

    let mut places = BTreeSet::new();
    let (mut must_stay_off, mut may_be_on) = (0, 0);
    for step in 0..80 {
        let struck: Rc<Cell<Option<(Nanoseconds, u32)>>> = Rc::default();
        let (seen, motor_side) = (Rc::clone(&struck), Rc::clone(&turning.bench.drive.motor_side));
        let orders = orders.clone();
        *turning.elf.on_stop.borrow_mut() = Some(Box::new(move |guest, stopped| {
            let again = seen.get().is_some();
            match trip {
                Trip::Break => {
                    motor_side.borrow_mut().change_inputs(|inputs| inputs.bridge_ready = again);
                    if !again {
                        guest.stop_at(StopAt { address: StopAt::HERE, behind: 1 })?;
                    }
                }
                Trip::CurrentLoop => {
                    motor_side.borrow_mut().machine().fail_current_sensor(0, Some(4_095), stopped.now.0);
                    for order in &orders {
                        guest.write_memory(*order, &[1])?;
                    }
                    guest.hold(Hold::Interrupt(ADC));
                }
            }
            seen.set(seen.get().or(Some((stopped.now, stopped.pc))));
            Ok(())
        }));
        turning.bench.world.ring_mut().master_mut().hold_switches(Some(0));
        turning.bench.run(Nanoseconds::from_millis(6));
        let before = turning.elf.guest.borrow().measurements().watched.len();
        turning.elf.guest.borrow_mut().stop_at(StopAt { address: first, behind: step }).unwrap();
        turning.bench.world.ring_mut().master_mut().hold_switches(Some(FOLLOW));
        while struck.get().is_none() {
            turning.bench.run(Nanoseconds(125_000));
        }
        // Before the supervision looks at it and takes the bridge off by itself.
        turning.bench.run(Nanoseconds::from_microseconds(70));
        let (time, pc) = struck.get().unwrap();
        let (stays_on, watched) = {
            let guest = turning.elf.guest.borrow();
            (turning.bench.has_torque(), guest.measurements().watched[before..].to_vec())
        };
        let writes: Vec<Watched> = watched.into_iter().filter(|access| access.writes).collect();
        let acknowledged = last_acknowledgement(&writes).map_or(Nanoseconds::ZERO, |write| write.time);
        let on = writes.iter().find(|write| write.address == OUTPUTS && write.value & OUTPUTS_ENABLED != 0);
        // Beyond the store that switches on and the look behind it, a trip finds the bridge on and takes it off as any other does.
        let beyond = on.is_some_and(|on| time > on.time + Nanoseconds(400));
        if !beyond {
            places.insert(pc);
        }
        if time > acknowledged {
            must_stay_off += 1;
            assert!(!stays_on, "{trip:?} at {pc:08x}, step {step}: the bridge is on");
        } else {
            may_be_on += 1;
        }
        motor_side_restored(turning);
        *turning.elf.on_stop.borrow_mut() = None;
        turning.bench.world.ring_mut().master_mut().hold_switches(Some(0));
        turning.bench.run(Nanoseconds::from_millis(6));
        if turning.bench.status() & 0x2000 != 0 {
            turning.bench.ask(Request::Command { idn: Idn(99), polls: 10 }).unwrap();
        }
        if beyond {
            break;
        }
    }
    println!(
        "{trip:?}: {} instructions swept; {may_be_on} before the acknowledgement, {must_stay_off} behind it",
        places.len()
    );
    assert!(places.len() > 15 && must_stay_off > 8 && may_be_on > 3, "{places:x?}");
}

fn motor_side_restored(turning: &mut Turning) {
    let now = turning.bench.world.now().0;
    let motor_side = &mut *turning.bench.drive.motor_side.borrow_mut();
    motor_side.machine().fail_current_sensor(0, None, now);
    motor_side.change_inputs(|inputs| inputs.bridge_ready = true);
}

#[test]
#[ignore = "needs QEMU and the ELF: cargo xtask test"]
fn a_trip_at_every_instruction_of_switching_on_wins_once_the_last_one_has_been_acknowledged() {
    let mut turning = Turning::new(DriveSetup::new(ADDRESS), 0.0, vec![]);
    turning.elf.guest.borrow_mut().watch_accesses(&[STATUS, OUTPUTS]);
    // An instruction's worth of a break is nothing that it sees.
    turning
        .bench
        .drive
        .laws
        .borrow_mut()
        .dismiss("after the cause is gone, S-0-0099 and a fresh edge always bring the axis back");
    for trip in [Trip::Break, Trip::CurrentLoop] {
        trips_while_switching_on(&mut turning, trip);
        turning.bench.world.ring_mut().master_mut().hold_switches(Some(FOLLOW));
        turning.bench.run(Nanoseconds::from_millis(20));
        assert!(turning.bench.has_torque());
    }
}

/// The service channel, on a vector of CAN1: it hands settings over.
const SERVICE_CHANNEL: u8 = 22;

/// What the task of the service channel has written into the link, instruction by instruction, while it handed settings over.
#[derive(Debug, Default)]
struct Handed {
    /// Words, in their order.
    writes: Vec<usize>,
    /// The current loop came in between so often.
    interrupted: u32,
    /// Words of the message in use that have changed.
    torn: Vec<usize>,
}

/// Writes S-0-0106, and gives the link before and behind it.
fn write_gain(turning: &mut Turning, gain: u16) -> [Vec<u32>; 2] {
    let words = |turning: &Turning| link(&mut turning.elf.guest.borrow_mut()).unwrap();
    let before = words(turning);
    turning.bench.write(106, Value::Word(gain)).unwrap();
    turning.bench.run(Nanoseconds::from_millis(5));
    [before, words(turning)]
}

/// An instruction of the task of the service channel, up to 100 before it sends settings; `sent` is the word that counts them.
fn shortly_before_sending(turning: &mut Turning, gain: u16, sent: usize) -> u32 {
    const STRIDE: u32 = 50;
    let handler = turning.elf.guest.borrow_mut().handler_of(SERVICE_CHANNEL).unwrap();
    let entry = StopAt { address: handler, behind: 0 };
    let found: Rc<Cell<Option<u32>>> = Rc::default();
    let tell = Rc::clone(&found);
    let mut last: Vec<u32> = Vec::new();
    let mut count = None;
    *turning.elf.on_stop.borrow_mut() = Some(Box::new(move |guest, stopped| {
        let now = link(guest)?[sent];
        if *count.get_or_insert(now) != now {
            tell.set(last.iter().nth_back(1).or(last.first()).copied());
            return Ok(());
        }
        match stopped.exception.checked_sub(FIRST) {
            Some(interrupt) if interrupt == u16::from(SERVICE_CHANNEL) => last.push(stopped.pc),
            Some(_) => {}
            None => {
                last.clear();
                return guest.stop_at(entry);
            }
        }
        guest.stop_at(StopAt { address: StopAt::HERE, behind: STRIDE })
    }));
    turning.elf.guest.borrow_mut().stop_at(entry).unwrap();
    write_gain(turning, gain);
    *turning.elf.on_stop.borrow_mut() = None;
    found.get().expect("settings are handed over by the service channel")
}

/// Writes S-0-0106, and stops the task of the service channel at each instruction from `from` to that which sends. From the first word of `message` on,
/// the current loop comes at each of them; `in_use` are the words of the message in use.
fn hand_settings_over(
    turning: &mut Turning,
    gain: u16,
    (from, sent): (u32, usize),
    [in_use, message]: [&[usize]; 2],
    part: Range<u32>,
) -> Handed {
    let handed: Rc<RefCell<Handed>> = Rc::default();
    let seen = Rc::clone(&handed);
    let begin = StopAt { address: from, behind: 0 };
    let (in_use, message) = (in_use.to_vec(), message.to_vec());
    // The link one instruction before, if that was one of the task's.
    let mut before: Option<Vec<u32>> = None;
    let mut first: Option<Vec<u32>> = None;
    *turning.elf.on_stop.borrow_mut() = Some(Box::new(move |guest, stopped| {
        let handed = &mut *seen.borrow_mut();
        if stopped.exception != FIRST + u16::from(SERVICE_CHANNEL) {
            before = None;
            // The same instruction may have been executed for something else.
            let over = stopped.exception == 0;
            return guest.stop_at(if over { begin } else { StopAt { address: StopAt::HERE, behind: 1 } });
        }
        let now = link(guest)?;
        if let Some(before) = &before {
            handed.writes.extend((0..now.len()).filter(|word| now[*word] != before[*word]));
        }
        let first = first.get_or_insert_with(|| now.clone());
        let changed =
            |words: &[usize]| words.iter().copied().filter(|word| now[*word] != first[*word]).collect::<Vec<_>>();
        handed.torn.extend(changed(&in_use));
        if changed(&message).is_empty() {
            before = Some(now.clone());
        } else {
            // The control loop waits meanwhile: a millisecond of it ends the product, and rightly.
            if part.contains(&handed.interrupted) {
                guest.hold(Hold::Interrupt(ADC));
            }
            handed.interrupted += 1;
            before = None;
        }
        if now[sent] != first[sent] { Ok(()) } else { guest.stop_at(StopAt { address: StopAt::HERE, behind: 1 }) }
    }));
    turning.elf.guest.borrow_mut().stop_at(begin).unwrap();
    write_gain(turning, gain);
    *turning.elf.on_stop.borrow_mut() = None;
    handed.take()
}

#[test]
#[ignore = "needs QEMU and the ELF: cargo xtask test"]
fn settings_are_handed_over_whole_whatever_instruction_the_current_loop_comes_at() {
    let mut turning = Turning::new(DriveSetup::new(ADDRESS), 0.0, vec![]);
    let gain = turning.bench.number(106) as u16;
    // Steps that change what the current loop reckons with.
    let links = [64, 128].map(|more| write_gain(&mut turning, gain + more));
    let [[first, second], [third, fourth]] = &links;
    let counts = |word: &usize| {
        let values = [first, second, third, fourth].map(|words| words[*word]);
        [0, 1, 1, 2].map(|more| values[0].wrapping_add(more)) == values
    };
    let counters: Vec<usize> = (0..first.len()).filter(counts).collect();
    let [sent] = counters[..] else { panic!("one word counts the messages: {counters:?}") };
    let place = (shortly_before_sending(&mut turning, gain + 192, sent), sent);

    let messages = [256, 320].map(|more| hand_settings_over(&mut turning, gain + more, place, [&[], &[]], 0..0).writes);
    // A word that keeps its value is not seen to be written.
    println!("words of two messages, word {sent} counts them, from {:08x} on: {messages:?}", place.0);
    let [even, odd] = messages.each_ref().map(|words| {
        let (last, message) = words.split_last().expect("words are handed over");
        assert_eq!(*last, sent, "the message is filled before it is sent");
        assert!(!message.is_empty() && !message.contains(last));
        message
    });
    assert!(even.iter().all(|word| !odd.contains(word)), "the message in use is filled: {even:?}, {odd:?}");
    let mut more = 320;
    for first in [0, 6, 12, 18] {
        for (in_use, message) in [(odd, even), (even, odd)] {
            more += 64;
            let handed = hand_settings_over(&mut turning, gain + more, place, [in_use, message], first..first + 6);
            println!("the current loop came at instructions {first} to {} of {}", first + 5, handed.interrupted);
            assert!(handed.torn.is_empty(), "{:?}", handed.torn);
            assert!((5..24).contains(&handed.interrupted), "{}", handed.interrupted);
        }
    }
    assert_eq!(turning.bench.number(106) as u16, gain + more);
    assert_eq!(turning.bench.number(11), 0);
}
