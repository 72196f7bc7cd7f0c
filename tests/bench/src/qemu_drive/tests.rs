//! What must not change what the ELF does on a ring.

use emulator::Trace;
use plant::ReferenceAxis;
use ring::master::{CommandValues, DriveScript, MasterScript, Motion, ScriptedMaster, Telegram};
use ring::{Ring, RingConfiguration};

use super::*;
use crate::axis::parameters_of;
use crate::ring_of_drives::{DriveSetup, observer, station};
use crate::world::{Inhabited, World};

const ADDRESS: u8 = 5;

/// A drive run up at 2 ms and switched on; what it did in the first 1.5 s.
fn run_up(step: Nanoseconds, whole_blocks: bool) -> Trace {
    let path =
        |name: &str| std::env::var_os(name).unwrap_or_else(|| panic!("{name} is not set: run `cargo xtask test`"));
    let product = path("PRODUCT_ELF");
    let bus = Rig::Bus(path("BUS_PLUGIN").into());
    let guest = Guest::start(&GuestConfiguration { whole_blocks, ..GuestConfiguration::new(product, bus) }).unwrap();
    let configuration = RingConfiguration::new(1, BitRate::M2);
    let setup = DriveSetup::new(ADDRESS);
    let (chip, motor_side) = station(&setup, BitRate::M2, &configuration.clock);
    let measurements = SharedMeasurements::default();
    let drive = QemuDrive::around(guest, &chip, &motor_side, ADDRESS, BitRate::M2, measurements.clone());
    let inhabited = Inhabited { processor: Box::new(drive), motor_side, laws: observer(&setup) };
    let script =
        DriveScript::new(ADDRESS, Telegram::standard(2).unwrap()).with_all(parameters_of(&ReferenceAxis::press()));
    let motion = Motion::new(1_000_000, |_| CommandValues::at_velocity(1_000_000));
    let script = MasterScript { motion: Some(motion), ..MasterScript::new(vec![script]) };
    let mut world = World::new(Ring::new(configuration, ScriptedMaster::new(script), vec![chip]), vec![inhabited]);
    let end = Nanoseconds::from_millis(1_500);
    while world.now() < end {
        let until = (world.now() + step).min(end);
        world.run_until(until).unwrap();
    }
    let (state, trace) = (world.ring().master().state().to_string(), measurements.borrow().trace.unwrap());
    println!("{state}: {trace}");
    trace
}

#[test]
#[ignore = "needs QEMU and the ELF: cargo xtask test"]
fn neither_whole_blocks_nor_how_often_the_world_looks_changes_what_the_elf_does_on_a_ring() {
    let one = run_up(Nanoseconds::from_millis(10), true);
    assert!(one.accesses > 200_000, "{one}");
    assert_eq!(run_up(Nanoseconds::from_microseconds(250), true), one, "looked at every 250 us");
    assert_eq!(run_up(Nanoseconds(17_011), true), one, "looked at every 17 us");
    assert_eq!(run_up(Nanoseconds::from_millis(10), false), one, "instruction by instruction");
}
