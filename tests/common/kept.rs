//! What tests of the memory do again and again: run up, save, and look at what was kept.

use flash::FlashModel;
use ring::Nanoseconds;
use ring::ident::Idn;
use ring::service_client::{Reply, Request, ServiceError};

use crate::running::Bench;

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
