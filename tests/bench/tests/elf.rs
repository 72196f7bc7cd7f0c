//! What must not change what the ELF does on a ring.

use super::elves;
use bench::{DriveSetup, Elves, Executor, parameters_of, ring_of_drives_on};
use emulator::Trace;
use plant::ReferenceAxis;
use ring::master::{CommandValues, DriveScript, MasterScript, Motion, ScriptedMaster, Telegram};
use ring::wire::BitRate;
use ring::{Nanoseconds, RingConfiguration};

const ADDRESS: u8 = 5;

/// A drive run up at 2 ms and switched on, in a world that looks at it in steps; what it did in the first 1.5 s.
fn run_up(step: Nanoseconds, change: impl FnOnce(&mut Elves)) -> Trace {
    let mut elves = elves();
    change(&mut elves);
    let script =
        DriveScript::new(ADDRESS, Telegram::standard(2).unwrap()).with_all(parameters_of(&ReferenceAxis::press()));
    let motion = Motion::new(1_000_000, |_| CommandValues::at_velocity(1_000_000));
    let script = MasterScript { motion: Some(motion), ..MasterScript::new(vec![script]) };
    let (configuration, master) = (RingConfiguration::new(1, BitRate::M2), ScriptedMaster::new(script));
    let on_elf = |_| Executor::Qemu(elves.clone());
    let (mut world, drives) = ring_of_drives_on(configuration, master, &[DriveSetup::new(ADDRESS)], on_elf).unwrap();
    let end = Nanoseconds::from_millis(1_500);
    while world.now() < end {
        let until = (world.now() + step).min(end);
        world.run_until(until).unwrap();
    }
    let (state, trace) = (world.ring().master().state().to_string(), drives[0].measurements.borrow().trace.unwrap());
    println!("{state}: {trace}");
    trace
}

#[test]
#[ignore = "needs QEMU and the ELF: cargo xtask test"]
fn what_the_elf_does_on_a_ring_depends_neither_on_looks_nor_blocks_nor_guesses() {
    let rarely = Nanoseconds::from_millis(10);
    let one = run_up(rarely, |_| {});
    assert!(one.accesses > 200_000, "{one}");
    assert_eq!(run_up(Nanoseconds::from_microseconds(250), |_| {}), one, "looked at every 250 us");
    assert_eq!(run_up(Nanoseconds(17_011), |_| {}), one, "looked at every 17 us");
    assert_eq!(run_up(rarely, |how| how.whole_blocks = false), one, "instruction by instruction");
    assert_eq!(run_up(rarely, |how| how.foretells = false), one, "every read asked for");
}
