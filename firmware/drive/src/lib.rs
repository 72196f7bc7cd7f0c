//! The drive: what each task of the application does, as plain functions over two traits.
//!
//! | struct | priority | tasks |
//! |---|---|---|
//! | [`CurrentControl`] | highest | `current_loop` (62.5 us) |
//! | [`RingInterrupts`] | high | both interrupt lines of the ring controller |
//! | [`Motion`] | high | `command_valid` (t3), `capture_feedback` (t4), `control_loop` (125 us), `supervise` (500 us) |
//! | [`Communication`] | low | `phase_change`, `service_channel` |
//!
//! What outlives the supply is kept by [`remembering::keep`], whenever there is nothing else to do.
//!
//! The application binds the tasks to interrupts and does nothing else; a test binds them to a simulated ring. The chip is
//! reached through [`sercon816::Bus`], the motor through [`Hardware`].
#![no_std]
#![forbid(unsafe_code)]
#![cfg_attr(
    not(test),
    deny(
        clippy::unwrap_used,
        clippy::expect_used,
        clippy::indexing_slicing,
        clippy::arithmetic_side_effects,
        clippy::panic
    )
)]

#[cfg(test)]
extern crate std;

mod amplifier;
mod communication;
mod coordinates;
pub mod crash;
mod diagnosis;
pub mod dictionary;
mod feedback;
mod hardware;
mod identity;
mod interrupts;
mod limits;
mod motion;
mod operation_mode;
pub mod oscilloscope;
pub mod production;
pub mod remembering;
pub mod service;
mod settings;
mod signal;
mod snapshot;
mod state;
mod tasks;

pub use amplifier::Amplifier;
pub use communication::{Communication, PhaseReport, StartError};
pub use diagnosis::error_memory::{ERRORS, ErrorMemory, ErrorRecord};
pub use diagnosis::table::{DIAGNOSES, Diagnosis, NO_SAVED_PARAMETERS, Severity, diagnose, of_phase_error};
pub use diagnosis::words::{Circumstances, Manufacturer1, Manufacturer2, Manufacturer3};
pub use dictionary::DICTIONARY;
pub use hardware::{Hardware, Inputs, InterruptLine, LOOP_PERIOD_MICROSECONDS, ProbeInput, ResetCause};
pub use identity::{DriveAddress, Identity};
pub use interrupts::RingInterrupts;
pub use motion::Motion;
pub use operation_mode::{OperationMode, Polarity, Reaction};
pub use service::access::{Access, LONGEST_PASSWORD, SHORTEST_PASSWORD};
pub use service::loops::without_motor;
pub use settings::invalid::InvalidSetting;
pub use settings::{CycleSettings, DriveSettings, MotionSettings};
pub use signal::bits::{BitSettings, SIGNAL_BITS};
pub use signal::command::{Command, CommandValue, CommandValues};
pub use signal::control_bits::Enable;
pub use signal::feedback::{Feedback, FeedbackValue};
pub use signal::limit::Limit;
pub use signal::record::{Datum, MOST_SIGNALS, Records};
pub use signal::word::{Source, SourceBit, Word};
pub use snapshot::Snapshot;
pub use state::{Conditions, DriveState, StateMachine, Switches, status_bits};
pub use tasks::Tasks;

pub use servo::current::{CurrentSensing, PwmFrequency};
pub use servo::monitor::{Divider, TemperatureSensor, Thermometers};
pub use servo::motor::{BoardKind, CurrentControl, CurrentLink, CurrentLoopValues, Cycle, Facts, PowerStage, Samples};
pub use servo::scope::Scope;

use sercon816::Bus;

/// The parts of a drive besides its [`Communication`]; each belongs to the tasks of one priority.
#[derive(Debug)]
pub struct Drive<B, H: Hardware, P: 'static> {
    /// The current loop.
    pub current: CurrentControl<P>,
    /// The interrupt lines.
    pub interrupts: RingInterrupts<B>,
    /// Motor side and cyclic data.
    pub motion: Motion<B, H>,
}

/// A drive with the parameters that its communication has recalled, torque-free; the chip is not touched before [`Communication::start`]. `link` is its own,
/// for the current loop, and so is `scope`, the memory of its oscilloscope.
///
/// It has a frame of its own, so that the start, which holds what it returns on its stack, does not hold what it works with besides.
///
/// # Errors
/// The defaults do not make a drive with this board's loop timer (a mistake in the table or the board, found by tests).
#[inline(never)]
pub fn new<B: Bus + Clone, H: Hardware, P: PowerStage<Board = H::Board>>(
    bus: B,
    hardware: H,
    stage: P,
    link: &'static CurrentLink,
    scope: &'static mut Scope,
    communication: &Communication<B>,
) -> Result<Drive<B, H, P>, InvalidSetting> {
    let settings = settings_at_start::<H>(communication);
    let settings = settings.as_ref().map_err(|error| *error)?;
    let current = CurrentControl::new(stage, link, settings.motor.current);
    let motion = Motion::new(bus.clone(), communication.address(), hardware, link, scope, settings);
    Ok(Drive { current, interrupts: RingInterrupts::new(bus), motion })
}

/// A set that another program has saved may not go together here: then the loops begin without a motor, and S-0-0128 finds it. So they do, and without a brake
/// resistor, where nobody knows the amplifier: on the scale of another one it would be switched at any voltage.
#[inline(never)]
fn settings_at_start<H: Hardware>(
    communication: &Communication<impl Bus + Clone>,
) -> Result<DriveSettings, InvalidSetting> {
    let settings = service::loops::settings::<H>;
    let without_motor = |amplifier, others| settings(&without_motor(amplifier, &<H::Board>::FACTS, others));
    let of_board = || without_motor(&H::AMPLIFIER, None);
    let Some(amplifier) = communication.amplifier(&H::AMPLIFIER) else { return of_board() };
    let parameters = communication.parameters();
    settings(parameters).or_else(|_| without_motor(amplifier, Some(parameters))).or_else(|_| of_board())
}
