//! Chips on a fibre: one in master use, others as slaves.

use std::cell::RefCell;
use std::io::Cursor;
use std::rc::Rc;

use ring::chip::socket::{ServedChip, serve};
use ring::chip::{Alternatives, Chip, ChipBus, ChipMaster, SharedChip};
use ring::fibre::{Cause, Fault};
use ring::wire::BitRate;
use ring::{Nanoseconds, Ring, RingConfiguration};
use sercon816::{Bus, RamAddress, Register};

const DRIVES: usize = 3;

struct World {
    ring: Ring<ChipMaster, SharedChip>,
    master: ChipBus,
    slaves: Vec<ChipBus>,
}

fn write_registers(bus: &mut ChipBus, registers: &[(u16, u16)]) {
    for &(register, value) in registers {
        bus.write_register(Register::new(register).unwrap(), value);
    }
}

fn register(bus: &mut ChipBus, register: u16) -> u16 {
    bus.read_register(Register::new(register).unwrap())
}

fn write_ram(bus: &mut ChipBus, first: u16, values: &[u16]) {
    for (word, &value) in (first..).zip(values) {
        bus.write_ram(RamAddress::new(word), value);
    }
}

fn ram(bus: &mut ChipBus, word: u16) -> u16 {
    bus.read_ram(RamAddress::new(word))
}

const TIMING: [(u16, u16); 9] = [
    (0x0D, 0xFF0A),
    (0x0E, 0x051F),
    (0x0F, 2_000),
    (0x10, 2_000),
    (0x13, 3),
    (0x14, 0),
    (0x15, 0xFFFC),
    (0x16, 10),
    (0x18, 6),
];

/// The same, running.
fn running_world(faults: Vec<Fault>) -> World {
    let mut world = world(faults);
    write_registers(&mut world.master, &[(0x04, 0xFFFF), (0x05, 0xFFFF), (0x0A, 0), (0x03, 0x0100)]);
    world
}

/// Three slaves with t1 = 100, 250 and 400 us, a master that reads their ATs and sends one MDT to all at 1000 us.
fn world(faults: Vec<Fault>) -> World {
    let mut configuration = RingConfiguration::new(DRIVES, BitRate::M2);
    configuration.faults = faults;
    configuration.trace = true;
    let clock = configuration.clock.clone();
    let chip = |seed| Rc::new(RefCell::new(Chip::new(Alternatives::default(), seed)));
    let chips: Vec<SharedChip> = (1..=DRIVES as u64).map(chip).collect();
    let master_chip = chip(99);
    let mut master = ChipBus::new(master_chip.clone(), clock.clone());
    let mut slaves: Vec<ChipBus> = chips.iter().map(|chip| ChipBus::new(chip.clone(), clock.clone())).collect();

    for (index, slave) in (0..).zip(&mut slaves) {
        write_registers(slave, &[(0x01, 0x0628), (0x0A, 0), (0x19, 23), (0x03, 0x0100)]);
        write_registers(slave, &TIMING);
        write_ram(slave, 0, &[0x10, 0x10, 0x60, 0x60, 0x60, 0x60, 0x60, 0x60, 0x60, 0x60, 0]);
        write_ram(slave, 0x10, &[0x5001 + index, 100 + 150 * index, 3, 0x18, 0x8003, 0xC000, 0, 0x1000 + index]);
        write_ram(slave, 0x18, &[0x18FF, 1_000, 6, 0x22, 0, 0x8002, 2 * index, 0, 0, 0]);
        write_ram(slave, 0x22, &[0xC000, 1_900]);
    }
    write_registers(&mut master, &[(0x01, 0x0002), (0x01, 0x0661), (0x02, 0x0383), (0x19, 30)]);
    write_registers(&mut master, &TIMING);
    write_ram(&mut master, 0, &[0x10, 0x10, 0x60, 0x60, 0x60, 0x60, 0x60, 0x60, 0x60, 0x60, 0]);
    for index in 0..3 {
        let header = 0x10 + 0x10 * index;
        write_ram(&mut master, header, &[0x1801 + index, 100 + 150 * index, 3, header + 0x10, 0, 0x8003, 0, 0, 0, 0]);
    }
    write_ram(&mut master, 0x40, &[0x50FF, 1_000, 6, 0x50, 0x8006, 10, 11, 20, 21, 30, 31]);
    write_ram(&mut master, 0x50, &[0xC000, 1_900]);
    World { ring: Ring::new(configuration, ChipMaster::new(master_chip), chips), master, slaves }
}

#[test]
fn a_master_chip_runs_a_ring_of_slave_chips() {
    let mut world = running_world(Vec::new());
    world.ring.advance(Nanoseconds::from_millis(39));
    assert_eq!(world.ring.cycle(), Some(19));
    assert!(world.ring.statistics().collisions.is_empty());
    for (index, slave) in (0..).zip(&mut world.slaves) {
        assert_eq!(register(slave, 0x04), 0, "drive {index}");
        assert_eq!([ram(slave, 0x1F), ram(slave, 0x20)], [10 * (index + 1), 10 * (index + 1) + 1]);
        assert_eq!(ram(slave, 0x18), 0x18FF | 1 << 10);
        assert_eq!((ram(slave, 0x1C), ram(slave, 0x0A)), (0, 0), "no error was counted");
    }
    for index in 0..3 {
        let header = 0x10 + 0x10 * index;
        assert_eq!(ram(&mut world.master, header) & (1 << 10), 1 << 10, "AT {index}");
        assert_eq!(ram(&mut world.master, header + 9), 0x1000 + index);
        assert_eq!(ram(&mut world.master, header + 4), 0);
    }
    assert_eq!(register(&mut world.master, 0x04) & 0x0382, 0, "the ring is closed");
}

#[test]
fn the_ring_delay_is_tcycdel_less_tcntst() {
    let mut world = running_world(Vec::new());
    world.ring.advance(Nanoseconds::from_millis(9));
    // Three repeaters of one bit (500 ns) and four fibres of 5 m (25 ns): 1.6 us.
    assert_eq!(register(&mut world.master, 0x11), 3 + 1);
}

#[test]
fn the_phase_of_0ah_reaches_every_drive() {
    let mut world = running_world(Vec::new());
    for phase in [0, 1, 2] {
        write_registers(&mut world.master, &[(0x0A, phase)]);
        world.ring.advance(world.ring.now() + Nanoseconds::from_millis(4));
        assert!(world.slaves.iter_mut().all(|slave| register(slave, 0x0B) == phase), "phase {phase}");
    }
}

#[test]
fn a_broken_fibre_shows_as_fibre_break_and_missing_msts_and_heals() {
    let fault = Fault { hop: DRIVES, cycles: 5..8, cause: Cause::Break };
    let mut world = running_world(vec![fault]);
    world.ring.advance(Nanoseconds::from_millis(9));
    assert_eq!(register(&mut world.master, 0x04) & 0x0382, 0);
    world.ring.advance(Nanoseconds::from_millis(15));
    assert_eq!(register(&mut world.master, 0x04) & 0x0382, 0x0202);
    world.ring.advance(Nanoseconds::from_millis(25));
    write_registers(&mut world.master, &[(0x04, 0xFFFF)]);
    world.ring.advance(Nanoseconds::from_millis(65));
    assert_eq!(register(&mut world.master, 0x04) & 0x0382, 0);
    assert_eq!(ram(&mut world.master, 0x0A), 3);
}

#[test]
fn a_broken_fibre_before_the_drives_stops_their_telegrams() {
    let fault = Fault { hop: 0, cycles: 5..8, cause: Cause::Break };
    let mut world = running_world(vec![fault]);
    world.ring.advance(Nanoseconds::from_millis(17));
    for slave in &mut world.slaves {
        assert_eq!(register(slave, 0x04) & 0x0202, 0x0202);
        assert_eq!(ram(slave, 0x0A), 3);
    }
    let ats = world.ring.trace().iter().filter(|entry| entry.bytes[0] == 1).count();
    assert_eq!(ats, 6, "five cycles, the sixth after the break");
}

#[test]
fn a_driver_at_the_socket_finds_the_ring_closed_before_it_starts_and_then_runs_it() {
    let World { ring, mut slaves, .. } = world(Vec::new());
    let ring = RefCell::new(ring);
    let chip = ring.borrow().master().chip().clone();
    let clock = ring.borrow().clock();
    let mut server = ServedChip::new(chip, clock, |until| ring.borrow_mut().advance(until));
    let mut converse = |commands: &str| -> Vec<String> {
        let mut output = Vec::new();
        serve(&mut Cursor::new(commands.replace("; ", "\n")), &mut output, &mut server).unwrap();
        String::from_utf8(output).unwrap().lines().filter(|line| *line != "ok").map(str::to_owned).collect()
    };
    // The order of sercon816.md 9: clear all, 20 cycles, ring closed? then phase 1 and start.
    assert_eq!(converse("w 0a 0; w 04 ffff; cycles 20; r 04; time; r 0b"), ["0000", "40000000", "0000"]);
    assert_eq!(ring.borrow().cycle(), Some(19));
    assert!(slaves.iter_mut().all(|slave| ram(slave, 0x1F) != 20), "no MDT yet");
    assert_eq!(converse("w 0a 1; w 03 0100; cycles 10; r 04; r 0b; R 010; R 019"), ["0000", "0001", "1c01", "1000"]);
    assert_eq!(ring.borrow().cycle(), Some(30), "the MST at the end of the tenth cycle is that of the next");
    assert!(slaves.iter_mut().all(|slave| register(slave, 0x0B) == 1));
    assert_eq!(ram(&mut slaves[1], 0x1F), 20);
}
