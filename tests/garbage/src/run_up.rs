//! What a proper master does after anything: ten cycles of CP0, then every phase in its order (sercos2.md 2.1 to 2.3).

use std::sync::LazyLock;

use drive::DICTIONARY;
use sercos::command::CommandStatus;
use sercos::data_block::{DataBlock, Location, NeededFor};
use sercos::{Idn, Phase};

use crate::support::Slave;

/// MSTs of CP0 that a master sends at least.
const CLOSING_MSTS: usize = 10;

/// The ring closes again and runs up; everything that the transition checks look at is written anew.
///
/// # Panics
/// When the slave does not end in CP4 without an error in S-0-0014.
pub(crate) fn run_up(slave: &mut Slave) {
    slave.drive.slow = false;
    slave.drive.refusal = None;
    slave.drive.synchronised = true;
    for _ in 0..CLOSING_MSTS {
        assert_eq!(slave.mst(0), Ok(()), "an MST of CP0");
    }
    for phase in [Phase::Cp1, Phase::Cp2] {
        enter(slave, phase);
    }
    for (idn, words) in CHECKED.iter() {
        assert_eq!(slave.set(*idn, words), Ok(0), "{idn} = {words:?}");
    }
    slave.configure();
    assert_eq!(command(slave, Idn::RESET_CLASS_1_DIAGNOSTIC), CommandStatus::Executed, "S-0-0099");
    assert_eq!(command(slave, Idn::CP3_TRANSITION_CHECK), CommandStatus::Executed, "{:?}", slave.drive.invalid_cp3);
    enter(slave, Phase::Cp3);
    assert_eq!(command(slave, Idn::CP4_TRANSITION_CHECK), CommandStatus::Executed, "{:?}", slave.drive.invalid_cp4);
    enter(slave, Phase::Cp4);
    assert!(!slave.drive.machine.interface_status().has_error());
    assert!(!slave.server.command_change());
}

/// What the transition checks look at, and the words of its defaults.
static CHECKED: LazyLock<Vec<(Idn, Vec<u16>)>> = LazyLock::new(|| {
    let checked = DICTIONARY.blocks().iter().filter(|block| is_checked(block));
    checked.map(|block| (block.idn, words_of(block, block.default))).collect()
});

/// The data block is of fixed length, needed for a transition, and can be written in CP2.
fn is_checked(block: &DataBlock) -> bool {
    block.needed_for != NeededFor::Neither
        && block.location == Location::Parameter
        && block.fixed_bytes().is_some()
        && !block.attribute.is_protected_in(Phase::Cp2)
}

/// The words of a value of fixed length, low word first.
pub(crate) fn words_of(block: &DataBlock, value: i64) -> Vec<u16> {
    let words = block.fixed_bytes().unwrap_or(2) / 2;
    (0..words).map(|word| (value >> (16 * word)) as u16).collect()
}

/// The whole procedure of a command: start, look, cancel; the status in between.
pub(crate) fn command(slave: &mut Slave, idn: Idn) -> CommandStatus {
    for value in [0, 3] {
        slave.set(idn, &[value]).unwrap_or_else(|error| panic!("{idn} = {value}: {error:?}"));
    }
    let status = slave.server.command_status(idn);
    assert_eq!(slave.open(idn), Ok(status as u16), "the data status");
    assert_eq!(slave.close(), Ok(0));
    assert_eq!(slave.set(idn, &[0]), Ok(0), "{idn} = 0");
    assert_eq!(slave.server.command_status(idn), CommandStatus::NotSet);
    status
}

fn enter(slave: &mut Slave, phase: Phase) {
    assert_eq!(slave.mst(phase.number()), Ok(()), "the MST of {phase}");
    assert_eq!(slave.drive.machine.current(), phase);
}
