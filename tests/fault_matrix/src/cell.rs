//! One cell of the matrix: bring the drive into its state, break something, look.

use bench::Executor;
use ring::Nanoseconds;
use ring::ident::Idn;
use ring::service_client::status;
use std::fmt;

use crate::rig::{Rig, SPEED, STEP};
use crate::{Afterwards, Fault, MatrixError, Mode, Outcome, Reaction, State, Target};

/// Fault, state and mode.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Cell {
    /// What breaks.
    pub fault: Fault,
    /// When it does.
    pub state: State,
    /// What the drive follows then.
    pub mode: Mode,
}

impl fmt::Display for Cell {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "{} / {} / {}", self.fault, self.state, self.mode)
    }
}

/// What is seen of bridge and shaft after the fault.
struct Seen {
    torque_off: Option<Nanoseconds>,
    /// Magnitude of the velocity when the torque went, in rpm.
    rpm_then: f64,
    turned: f64,
    status: Option<u16>,
}

/// Runs a cell with the portable tasks on this computer, or with the flashed ELF in QEMU.
///
/// # Errors
/// The drive does not come into the state, does not answer afterwards, or breaks a law of the axis.
pub fn run(cell: Cell, executor: &Executor) -> Result<Outcome, MatrixError> {
    outcome(cell, executor).map_err(|error| MatrixError::In { cell: cell.to_string(), error: Box::new(error) })
}

fn outcome(cell: Cell, executor: &Executor) -> Result<Outcome, MatrixError> {
    let Cell { fault, state, mode } = cell;
    let mut rig = Rig::new(cell.to_string(), (fault, state, mode), executor)?;
    let had_torque = rig.bridge_is_on();
    fault.inject(&mut rig)?;
    let seen = watch(&mut rig, fault, had_torque)?;
    let torque = rig.bridge_is_on();

    rig.open_service()?;
    let class_1 = rig.number(Idn::CLASS_1_DIAGNOSTIC)?;
    let number = rig.number(Idn(390))?;
    let brake_closed = rig.brake_is_closed();
    let reaction = match (class_1, had_torque, torque) {
        (0, ..) if number & 0xF000 == 0xE000 => Reaction::Warning,
        (0, ..) => Reaction::None,
        (_, false, false) => Reaction::Error,
        (_, _, true) => Reaction::Holds,
        (_, true, false) => how_it_ended(&seen, state),
    };
    let afterwards = if class_1 == 0 { Afterwards::NoError } else { recover(&mut rig, fault)? };
    Ok(Outcome {
        reaction,
        torque_off: seen.torque_off,
        turned: seen.torque_off.map(|_| seen.turned),
        number,
        class_1,
        brake_closed,
        afterwards,
    })
}

fn watch(rig: &mut Rig, fault: Fault, had_torque: bool) -> Result<Seen, MatrixError> {
    let from = rig.now();
    let angle = rig.angle();
    // A break input does not wait for the first look.
    let torque_off = (had_torque && !rig.bridge_is_on()).then_some(Nanoseconds::ZERO);
    let mut seen = Seen { torque_off, rpm_then: rig.rpm().abs(), turned: 0.0, status: None };
    let mut step = 0;
    while rig.now() < from + fault.span() {
        fault.go_on(rig, step);
        rig.run(STEP)?;
        step += 1;
        if had_torque && seen.torque_off.is_none() && !rig.bridge_is_on() {
            seen.torque_off = Some(rig.now().saturating_sub(from));
            seen.rpm_then = rig.rpm().abs();
        }
        if rig.rpm().abs() < 1.0 && seen.torque_off.is_some() && rig.now() > from + Nanoseconds::from_millis(150) {
            break;
        }
    }
    seen.turned = rig.angle() - angle;
    seen.status = rig.error_status(from);
    Ok(seen)
}

/// The status word tells of a stop under torque where the ring was there to carry it, and the speed at which the torque went of its end.
fn how_it_ended(seen: &Seen, state: State) -> Reaction {
    let turning = matches!(state, State::AtSpeed | State::Stopping);
    let under_torque = seen.status.is_none_or(|word| status::readiness(word) == 3);
    let stopped = seen.rpm_then < 0.1 * f64::from(SPEED);
    if turning && under_torque && stopped { Reaction::Ramp } else { Reaction::TorqueOff }
}

fn recover(rig: &mut Rig, fault: Fault) -> Result<Afterwards, MatrixError> {
    fault.repair(rig);
    rig.run(fault.aftermath())?;
    rig.wait_for_standstill()?;
    let mut cleared = Afterwards::RunsAgain;
    if !is_cleared(rig)? {
        rig.release()?;
        cleared = Afterwards::RunsAgainReleased;
        if !is_cleared(rig)? {
            return Ok(Afterwards::NotCleared);
        }
    }
    Ok(if rig.switch_on_again()? { cleared } else { Afterwards::StaysOff })
}

fn is_cleared(rig: &mut Rig) -> Result<bool, MatrixError> {
    Ok(rig.reset_errors()? && rig.number(Idn::CLASS_1_DIAGNOSTIC)? == 0)
}
