//! What tests of the memory do again and again: run up, save, and look at what was kept.

use bench::{DriveSetup, Executor, parameters_of};
use flash::FlashModel;
use plant::ReferenceAxis;
use ring::Nanoseconds;
use ring::ident::{Idn, Value};
use ring::master::{CommandValues, DriveScript, MasterScript, Motion, Telegram};
use ring::service_client::{Reply, Request, ServiceError};

use crate::running::{ADDRESS, Bench, VELOCITY};

/// An axis that is none of the defaults: the motor would not turn with those.
pub(crate) fn axis() -> ReferenceAxis {
    ReferenceAxis::small_cnc()
}

/// What the recorded master writes: times and telegram, nothing of the axis; the mode is remembered.
pub(crate) fn only_communication(turns: bool) -> MasterScript {
    let drive = DriveScript::new(ADDRESS, Telegram::standard(2).unwrap());
    let motion = turns.then(|| Motion::new(1_000_000, |_| CommandValues::at_velocity(VELOCITY)));
    MasterScript { motion, stops_at_refusals: false, reset_diagnostics: false, ..MasterScript::new(vec![drive]) }
}

/// A drive that remembers this, with nobody who tells it more.
pub(crate) fn started(executor: Executor, flash: FlashModel, turns: bool) -> Bench {
    let setup = DriveSetup { axis: axis(), flash, ..DriveSetup::new(ADDRESS) };
    Bench::on(executor, setup, only_communication(turns))
}

/// In CP4, without torque.
pub(crate) fn in_cp4(executor: Executor, flash: FlashModel) -> Bench {
    run_up(started(executor, flash, false))
}

/// A drive whose master has run it up.
pub(crate) fn run_up(mut bench: Bench) -> Bench {
    for _ in 0..1_000 {
        bench.run(Nanoseconds::from_millis(10));
        if bench.world.ring().master().is_done() {
            return bench;
        }
    }
    panic!("{}", bench.world.ring().master().state());
}

/// A drive whose user has told it its motor and has saved nothing yet; in CP4, without torque.
pub(crate) fn told(executor: Executor) -> Bench {
    told_over(executor, FlashModel::new())
}

/// The same over this flash.
pub(crate) fn told_over(executor: Executor, flash: FlashModel) -> Bench {
    let drive = DriveScript::new(ADDRESS, Telegram::standard(2).unwrap())
        .with(Idn::OPERATION_MODE, Value::Word(2))
        .with_all(parameters_of(&axis()));
    let script = MasterScript { stops_at_refusals: false, reset_diagnostics: false, ..MasterScript::new(vec![drive]) };
    let setup = DriveSetup { axis: axis(), flash, ..DriveSetup::new(ADDRESS) };
    run_up(Bench::on(executor, setup, script))
}

/// Data status of a command that was started and has ended, 3 or FH; the error where it was refused.
pub(crate) fn command(bench: &mut Bench, idn: u16) -> Result<u16, u16> {
    match bench.ask(Request::Command { idn: Idn(idn), polls: 20_000 }) {
        Ok(Reply::Command(outcome)) => Ok(outcome.status),
        Err(ServiceError::Refused { code, .. }) => Err(code),
        Err(ServiceError::CommandFailed { status, .. }) => Ok(status),
        other => panic!("{other:?}"),
    }
}

/// What the drive of a bench would remember if its supply went now.
pub(crate) fn flash_of(bench: &Bench) -> FlashModel {
    match &bench.drive.elf {
        Some(elf) => elf.guest.borrow().flash().clone(),
        None => bench.drive.flash.borrow().clone(),
    }
}

/// Runs until the control has written a data block, as its script says.
pub(crate) fn run_until_written(bench: &mut Bench, idn: Idn) {
    let is_written = |bench: &Bench| {
        let services = &bench.world.ring().master().report().drives[0].services;
        services.iter().any(|service| service.request.idn() == idn)
    };
    while !is_written(bench) {
        bench.run(Nanoseconds::from_millis(1));
    }
}

/// Where the record of a data block begins in a set: four bytes, the first two of them the IDN, then its operation data.
pub(crate) fn place_of(set: &[u8], idn: Idn) -> usize {
    let mut at = 4;
    while set[at..at + 2] != idn.0.to_le_bytes() {
        at += 4 + usize::from(set[at + 3]);
    }
    at
}

/// The records of a set: IDN and operation data of each, as `drive::remembering` lays them down.
pub(crate) fn records(set: &[u8]) -> Vec<(Idn, Vec<u8>)> {
    let mut records = Vec::new();
    let mut rest = &set[4..];
    while let [low, high, length, room, behind @ ..] = rest {
        let (data, behind) = behind.split_at(usize::from(*room));
        records.push((Idn(u16::from_le_bytes([*low, *high])), data[..usize::from(*length)].to_vec()));
        rest = behind;
    }
    assert_eq!(records.len(), usize::from(u16::from_le_bytes([set[2], set[3]])), "the records that the head says");
    records
}
