//! The hand-overs of the flashed ELF between its tasks, and between the chip and its handlers, with the interrupt at every instruction.
//!
//! A handler is stopped before its first instruction, then before its second one in the next cycle, and so on until it is at its end. Each time it
//! stands there until what is to come in between has come.

use crate::elf::Turning;
use crate::running::ADDRESS;
use bench::DriveSetup;
use emulator::{EmulatorError, Guest, Hold, StopAt, Stopped};
use ring::Nanoseconds;
use std::cell::RefCell;
use std::collections::BTreeSet;
use std::rc::Rc;

/// Number of the exception of the first interrupt.
const FIRST: u16 = 16;
/// End of conversion: the current loop.
const ADC: u8 = 18;
/// The control loop, on a vector of CAN2.
const CONTROL_LOOP: u8 = 63;
/// INT1 and INT0 of the chip.
const INT1: u8 = 8;
const INT0: u8 = 9;

/// What happens at an instruction of a handler.
type Act = Box<dyn FnMut(&mut Guest, &Place) -> Result<(), EmulatorError>>;

/// Where a handler was stopped.
#[derive(Clone, Copy, Debug)]
struct Place {
    now: Nanoseconds,
    pc: u32,
    /// Instructions executed since the handler began.
    step: u32,
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
    at_entry: Act,
    at_step: Act,
    swept: Rc<RefCell<Swept>>,
}

impl Sweep {
    /// So many stops in a row beyond its end, and a handler has been swept: it is not always equally long.
    const BEYOND: u32 = 24;

    fn stopped(&mut self, guest: &mut Guest, stopped: Stopped, entry: bool) -> Result<bool, EmulatorError> {
        let Stopped { now, pc, exception } = stopped;
        if entry {
            (self.at_entry)(guest, &Place { now, pc, step: 0 })?;
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
            (self.at_step)(guest, &Place { now, pc, step: self.step })?;
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
    at_entry: Act,
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

/// Nothing is done.
fn nothing() -> Act {
    Box::new(|_, _| Ok(()))
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
    let before: Rc<RefCell<Vec<u32>>> = Rc::default();
    let pending: Rc<RefCell<Option<Vec<u32>>>> = Rc::default();
    let halves = Rc::new(RefCell::new(0));
    let at_entry: Act = {
        let (before, pending, written, wrong) =
            (Rc::clone(&before), Rc::clone(&pending), Rc::clone(&written), Rc::clone(&wrong));
        Box::new(move |guest, place| {
            let now = link(guest)?;
            // A message that had been sent when the handler was stopped has not changed since.
            if let Some(then) = pending.borrow_mut().take() {
                let message = &written.borrow()[(then[sent] & 1) as usize];
                let changed: Vec<usize> = message.iter().copied().filter(|word| then[*word] != now[*word]).collect();
                if then[sent] == now[sent] && !changed.is_empty() {
                    wrong.borrow_mut().push(format!("behind its sending, before {}: {changed:?}", place.now));
                }
            }
            *before.borrow_mut() = now;
            Ok(())
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
    assert_eq!(turning.bench.number(0x8000 | 153), late, "a cycle came late");
    assert_eq!(turning.bench.number(11), 0);
    assert!(greatest < 1.5 * quiet + 0.01, "{quiet} before, {greatest}");
}
