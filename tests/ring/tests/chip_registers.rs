//! Registers of the chip model: what reads, what writes, what a reset leaves. sercon816.md 4, 5, 14.

use crate::chip_rig::{FIRST_MST, Rig, with};
use ring::chip::{Alternatives, Chip, PhaseReadBack, ResetValues, UnknownStatusBits, UpperByte};
use ring::{Nanoseconds, chip};

const ZERO: Nanoseconds = Nanoseconds::ZERO;

#[test]
fn a_reset_chip_shows_its_version_and_has_its_repeater_on() {
    let mut rig = Rig::new(Alternatives::default());
    assert_eq!(rig.register(0x00), 0x0010);
    assert_eq!(rig.register(0x01) & 0x0009, 0x0009);
    assert!((0x02..=0x2A).all(|register| rig.register(register) == 0));
    assert!(rig.chip.repeater_on());
    rig.set_register(0x01, 0x0620);
    assert!(!rig.chip.repeater_on());
}

#[test]
fn read_only_registers_and_addresses_beyond_2ah_ignore_writes() {
    let mut rig = Rig::new(Alternatives::default());
    for register in [0x00, 0x0B, 0x11, 0x2B, 0x40, 0xFFFF] {
        let before = rig.register(register);
        rig.set_register(register, 0x5A5A);
        assert_eq!(rig.register(register), before, "{register:x}");
    }
    for register in [0x0C, 0x12, 0x17, 0x1E, 0x25, 0x2A] {
        rig.set_register(register, 0x5A5A);
        assert_eq!(rig.register(register), 0x5A5A, "G10: {register:x} is plain storage");
    }
}

#[test]
fn status_flags_are_cleared_by_writing_ones_and_come_back_while_the_fibre_is_dark() {
    let mut rig = Rig::new(Alternatives::default());
    rig.chip.on_signal(rig.now, false);
    assert_eq!(rig.register(0x04), 0x0003);
    rig.set_register(0x04, 0x0001);
    assert_eq!(rig.register(0x04), 0x0002);
    rig.set_register(0x04, 0xFFFF);
    assert_eq!(rig.register(0x04), 0x0002, "a bit still set means that the condition is present");
    rig.chip.on_signal(rig.now, true);
    rig.set_register(0x04, 0xFFFF);
    assert_eq!(rig.register(0x04), 0);
}

#[test]
fn a_software_reset_stops_the_timers_and_keeps_the_ram() {
    let mut rig = Rig::slave(Alternatives::default());
    rig.set_register(0x1A, 500);
    rig.mst(FIRST_MST, 0);
    assert!(rig.chip.next_event().is_some());
    rig.set_register(0x01, 0x0002);
    assert_eq!(rig.chip.next_event(), None);
    assert_eq!(rig.register(0x1A), 0);
    assert_eq!(rig.register(0x01) & 0x000B, 0x0009);
    assert_eq!(rig.ram(0), crate::chip_rig::AT_HEADER);
}

#[test]
fn ram_starts_as_garbage_that_depends_on_the_seed_alone() {
    let words = |seed| {
        let mut chip = Chip::new(Alternatives::default(), seed);
        (0..2048).map(|word| chip.read_ram(ZERO, word)).collect::<Vec<_>>()
    };
    assert_eq!(words(1), words(1));
    assert_ne!(words(1), words(2));
    let zeros = words(1).iter().filter(|&&word| word == 0).count();
    assert!(zeros < 5, "{zeros} zeros in 2048 words");
}

#[test]
fn g3_noise_appears_only_in_bits_without_a_meaning() {
    let mut seen = 0;
    let mut rig = Rig::slave(with(|chip| chip.unknown_status_bits = UnknownStatusBits::Noisy));
    for cycle in 0..30 {
        rig.mst(FIRST_MST + cycle * 2_000_000, 0);
        seen |= rig.take_status(0x04);
    }
    assert_eq!(seen, 0xFC7C);
    let mut rig = Rig::slave(Alternatives::default());
    rig.cycles(30, 0);
    assert_eq!(rig.register(0x04), 0);
}

#[test]
fn g8_the_phase_register_reads_what_was_written_or_what_was_received() {
    for (read_back, expected) in [(PhaseReadBack::Stored, 1), (PhaseReadBack::Received, 2)] {
        let mut rig = Rig::slave(with(|chip| chip.phase_read_back = read_back));
        rig.set_register(0x0A, 1);
        rig.mst(FIRST_MST, 2);
        assert_eq!(rig.register(0x0A), expected);
        assert_eq!(rig.register(0x0B), 2);
    }
}

#[test]
fn g9_garbage_above_the_received_phase_leaves_the_phase() {
    let mut rig = Rig::slave(with(|chip| chip.received_phase_upper_byte = UpperByte::Garbage));
    rig.mst(FIRST_MST, 3);
    let words: Vec<u16> = (0..8).map(|_| rig.register(0x0B)).collect();
    assert!(words.iter().all(|word| word & 0xFF == 3));
    assert!(words.iter().any(|word| word & 0xFF00 != 0));
}

#[test]
fn g30_garbage_registers_keep_version_configuration_and_status() {
    let mut rig = Rig::new(with(|chip| chip.reset_values = ResetValues::Garbage));
    assert_eq!(rig.register(0x00), 0x0010);
    assert_eq!(rig.register(0x01) & 0x000B, 0x0009);
    assert_eq!((rig.register(0x04), rig.register(0x05)), (0, 0));
    assert!((0x0C..=0x2A).filter(|&register| rig.register(register) != 0).count() > 20);
}

#[test]
fn the_rate_strap_reads_back_in_01h_and_cannot_be_written() {
    use ring::wire::BitRate;
    for (bit_rate, strap) in [(BitRate::M2, 0x0800), (BitRate::M4, 0), (BitRate::M8, 0x0800), (BitRate::M16, 0)] {
        let straps = chip::Straps { bit_rate, mclk_megahertz: 32 };
        let mut chip = Chip::with_straps(straps, Alternatives::default(), 1);
        chip.write_register(ZERO, 0x01, 0x0628 | (0x0800 & !strap));
        assert_eq!(chip.read_register(ZERO, 0x01), 0x0628 | strap);
    }
}
