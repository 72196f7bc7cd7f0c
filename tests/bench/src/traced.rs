//! A drive on a fast ring, traced instruction by instruction while it follows the master and its service channel is in use.

use std::cell::RefCell;
use std::rc::Rc;

use emulator::{Activations, EmulatorError, Functions, Guest, Listing};
use plant::ReferenceAxis;
use ring::ident::{Idn, Value};
use ring::master::{Activity, CommandValues, DriveScript, MasterError, MasterScript, Motion, ScriptedMaster, Telegram};
use ring::service_client::{Request, ServiceError};
use ring::wire::BitRate;
use ring::{Nanoseconds, RingConfiguration};

use crate::axis::{parameters_of, product};
use crate::crashing::watched;
use crate::executor::Elves;
use crate::processor::ProcessorError;
use crate::qemu_drive::QemuDrive;
use crate::report::Progress;
use crate::ring_of_drives::DriveSetup;
use crate::world::World;

/// What came of it.
#[derive(Clone, Debug)]
pub struct Traced {
    /// The counts with all that a position cycle can have.
    pub activations: Activations,
    /// Those while parameters are written, each of which changes another part of the settings.
    pub written: Activations,
    /// Those without the low-pass of the current command, in a quarter of the time.
    pub without_low_pass: Activations,
    /// How long was traced.
    pub window: Nanoseconds,
    /// Communication cycles in that time.
    pub cycles: u64,
    /// From the start to the end of that time.
    pub stack: StackUse,
}

/// The stack as a run has found it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StackUse {
    /// Bytes that were written to at least once.
    pub used: u32,
    /// Bytes from the stack's first down to the guard.
    pub room: u32,
    /// Bytes of the guard below it, as the memory protection unit has it.
    pub guard: u32,
}

/// Words that no stack holds in a row.
const PAINT: u32 = 0xA5C3_1E87;
const END_OF_RAM: u32 = 0x2002_0000;

/// Why there are no counts.
#[derive(Debug, thiserror::Error)]
pub enum TraceError {
    /// The master gave up.
    #[error("the master stopped: {0}")]
    Master(#[from] MasterError),
    /// The drive could not go on.
    #[error(transparent)]
    Processor(#[from] ProcessorError),
    /// The trace could not be had.
    #[error(transparent)]
    Emulator(#[from] EmulatorError),
    /// A parameter was refused.
    #[error("{idn} was refused: {error}")]
    Written {
        /// Which one.
        idn: Idn,
        /// Why.
        error: ServiceError,
    },
    /// The drive is not where it should be.
    #[error("the drive does not {what} within {seconds} s of simulated time; the master is {state}")]
    TooLate {
        /// What was waited for.
        what: &'static str,
        /// How long.
        seconds: u64,
        /// What the master was doing.
        state: String,
    },
}

const ADDRESS: u8 = 5;
/// P-0-0174, the kind of the second filter of the current command.
const LOW_PASS: Idn = product(174);
/// The shortest cycle that the drive is made for.
pub const CYCLE: Nanoseconds = Nanoseconds::from_microseconds(500);
/// The drive has settled on the master's motion this long after its beginning.
const SETTLING: Nanoseconds = Nanoseconds::from_millis(200);
/// The marks lie on a multiple of this, so that it does not matter when exactly QEMU began to log.
const GRID: Nanoseconds = Nanoseconds::from_millis(20);
const WINDOW: Nanoseconds = Nanoseconds::from_millis(100);
const STEP: Nanoseconds = Nanoseconds::from_millis(1);
const PATIENCE_SECONDS: u64 = 30;
/// The drive searches its commutation angle when it is first switched on: 2 s are enough.
const SWITCHING_ON_CYCLES: u64 = 4_000;
/// 300 rpm of 3 600 000 increments a revolution, in increments a cycle.
const INCREMENTS_PER_CYCLE: i32 = 9_000;
/// By how much the shaft swings about that, in increments, and in how many cycles: 62 rad/s², so that every tick has an acceleration.
const SWING: f64 = 36_000.0;
const CYCLES_PER_SWING: f64 = 400.0;
/// Read while traced: a word, a long word, a text, a list, and the checksum over all parameters, the longest step of all.
const READ: [u16; 5] = [104, 47, 30, 17, 326];

/// Written while traced: for the motor (S-0-0092), around the loops (S-0-0057), and for the axis, the last of which takes the low-pass away.
const WRITTEN: [(Idn, Value); 4] = [
    (Idn(92), Value::Word(2_000)),
    (Idn(57), Value::Long(1_000)),
    (product(175), Value::Word(2_001)),
    (LOW_PASS, Value::Word(0)),
];

/// Runs the drive up at 500 us with everything on that a position cycle can have, lets it follow a shaft that swings, and counts for 100 ms.
///
/// # Errors
/// The ring did not come up, or QEMU did not trace.
pub fn traced(elves: &Elves, listing: Listing, progress: &mut dyn FnMut(&Progress)) -> Result<Traced, TraceError> {
    let (mut world, drive) = world(elves)?;
    let statics = Functions::read(&elves.product)?.data("__sheap").ok_or_else(|| EmulatorError::Elf {
        path: elves.product.clone(),
        what: "no symbol __sheap: where do its statics end?".into(),
    })?;
    // The product has not executed an instruction yet.
    let paint = vec![PAINT; ((END_OF_RAM - statics) / 4) as usize];
    drive.borrow_mut().guest_mut().write_memory(statics, &paint)?;
    let following = run_until(&mut world, progress, "follow", |world| {
        matches!(world.ring().master().state().activity, Activity::Moving { .. })
    })?;
    let begin = Nanoseconds(((following + SETTLING).0 / GRID.0 + 1) * GRID.0);
    world.run_until(begin)?;
    for idn in READ {
        world.ring_mut().master_mut().service(0).request(Request::Read(Idn(idn)));
    }
    let activations = count(&mut world, &drive, listing.clone(), WINDOW, progress)?;
    let mut written = Activations::new(listing.clone());
    until_idle(&mut world)?;
    for (idn, value) in WRITTEN {
        world.ring_mut().master_mut().service(0).request(Request::Write(idn, value));
        drive.borrow_mut().guest_mut().begin_trace()?;
        until_idle(&mut world)?;
        drive.borrow_mut().guest_mut().end_trace(&mut written)?;
        while let Some(finished) = world.ring_mut().master_mut().service(0).take_finished() {
            finished.result.map_err(|error| TraceError::Written { idn, error })?;
        }
    }
    world.run_until(Nanoseconds((world.now().0 / GRID.0 + 1) * GRID.0))?;
    let without_low_pass = count(&mut world, &drive, listing, Nanoseconds(WINDOW.0 / 4), progress)?;
    let stack = stack_use(&mut drive.borrow_mut().guest_mut(), statics)?;
    Ok(Traced { activations, written, without_low_pass, window: WINDOW, cycles: WINDOW.0 / CYCLE.0, stack })
}

/// Until everything that was asked for over the service channel is there.
fn until_idle(world: &mut World<ScriptedMaster>) -> Result<(), TraceError> {
    let limit = world.now() + Nanoseconds::from_millis(1_000);
    while !world.ring_mut().master_mut().service(0).is_idle() {
        if world.now() >= limit {
            let state = world.ring().master().state().to_string();
            return Err(TraceError::TooLate { what: "answer over the service channel", seconds: 1, state });
        }
        world.run_until(world.now() + STEP)?;
    }
    Ok(())
}

fn count(
    world: &mut World<ScriptedMaster>,
    drive: &Rc<RefCell<QemuDrive>>,
    listing: Listing,
    window: Nanoseconds,
    progress: &mut dyn FnMut(&Progress),
) -> Result<Activations, TraceError> {
    drive.borrow_mut().guest_mut().begin_trace()?;
    let begin = world.now();
    let mut now = begin;
    while now < begin + window {
        now += STEP;
        world.run_until(now)?;
        let done = (now.0 - begin.0) / STEP.0;
        progress(&Progress {
            phase: 4,
            what: "counting instructions".into(),
            done,
            of: window.0 / STEP.0,
            time_us: now.as_microseconds(),
        });
    }
    let mut activations = Activations::new(listing);
    drive.borrow_mut().guest_mut().end_trace(&mut activations)?;
    match world.ring().master().report().error.clone() {
        Some(error) => Err(error.into()),
        None => Ok(activations),
    }
}

fn stack_use(guest: &mut Guest, statics: u32) -> Result<StackUse, EmulatorError> {
    let guard = guest.guard()?.unwrap_or(statics..statics);
    let memory = guest.read_memory(statics, ((END_OF_RAM - statics) / 4) as usize)?;
    let untouched = memory.iter().take_while(|word| **word == PAINT).count() as u32;
    Ok(StackUse {
        used: END_OF_RAM - statics - 4 * untouched,
        room: END_OF_RAM - guard.end,
        guard: guard.end - guard.start,
    })
}

fn run_until(
    world: &mut World<ScriptedMaster>,
    progress: &mut dyn FnMut(&Progress),
    what: &'static str,
    done: impl Fn(&World<ScriptedMaster>) -> bool,
) -> Result<Nanoseconds, TraceError> {
    let limit = world.now() + Nanoseconds::from_millis(PATIENCE_SECONDS * 1_000);
    while !done(world) {
        let now = world.now();
        if now >= limit {
            let state = world.ring().master().state().to_string();
            return Err(TraceError::TooLate { what, seconds: PATIENCE_SECONDS, state });
        }
        world.run_until(now + STEP)?;
        let master = world.ring().master();
        if let Some(error) = master.report().error.clone() {
            return Err(error.into());
        }
        let state = master.state();
        let what = state.activity.to_string();
        progress(&Progress { phase: state.phase, what, done: state.cycle, of: 0, time_us: now.as_microseconds() });
    }
    Ok(world.now())
}

fn world(elves: &Elves) -> Result<(World<ScriptedMaster>, Rc<RefCell<QemuDrive>>), TraceError> {
    let bit_rate = BitRate::M4;
    let configuration = RingConfiguration::new(1, bit_rate);
    let setup = DriveSetup::new(ADDRESS);
    let (world, _, drive) = watched(configuration, ScriptedMaster::new(script(bit_rate)), &setup, elves)?;
    Ok((world, drive))
}

/// Cubic, acceleration feed-forward with its smoothing, low-pass of the current, friction of 2.1 A and 1.85 mA/rpm; S-0-0296 is on by default.
fn everything_fed_forward() -> Vec<(Idn, Value)> {
    vec![
        (product(141), Value::Word(1)),
        (Idn(348), Value::Word(530)),
        (LOW_PASS, Value::Word(1)),
        (product(175), Value::Word(2_000)),
        (product(176), Value::Word(707)),
        (product(231), Value::Word(500)),
        (Idn(155), Value::Word(120)),
        (product(142), Value::Word(1_851)),
    ]
}

fn script(bit_rate: BitRate) -> MasterScript {
    let axis = ReferenceAxis::press();
    let telegram = Telegram::application(&[Idn(51), Idn(40), Idn::FOLLOWING_DISTANCE], &[Idn::POSITION_COMMAND]);
    let drive = DriveScript::new(ADDRESS, telegram)
        .with(Idn::OPERATION_MODE, Value::Word(11))
        .with_all(parameters_of(&axis))
        .with_all(everything_fed_forward());
    let mut motion = Motion::new(u64::from(u32::MAX), |point| {
        // The shaft starts gently, over the first 200 cycles.
        let cycles = i32::try_from(point.cycle).unwrap_or(i32::MAX);
        let ramp = cycles.min(200);
        let turned = INCREMENTS_PER_CYCLE.wrapping_mul(ramp) / 200 * ramp / 2;
        let steady = cycles.wrapping_sub(ramp).wrapping_mul(INCREMENTS_PER_CYCLE);
        let swung = SWING * (1.0 - (core::f64::consts::TAU * f64::from(cycles) / CYCLES_PER_SWING).cos());
        CommandValues::at_position(point.start.wrapping_add(turned).wrapping_add(steady).wrapping_add(swung as i32))
    });
    motion.patience = SWITCHING_ON_CYCLES;
    MasterScript {
        bit_rate,
        cycle: u16::try_from(CYCLE.as_microseconds()).unwrap_or(u16::MAX),
        motion: Some(motion),
        stops_at_refusals: false,
        ..MasterScript::new(vec![drive])
    }
}
