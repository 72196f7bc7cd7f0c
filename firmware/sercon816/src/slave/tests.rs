//! What a slave writes, against the published words, and in which order.

use std::vec::Vec;

use super::*;
use crate::test_bus::{TestBus, Write};
use crate::timer::Timer;
use crate::uncertain::UNTOUCHED;

const CONFIGURATION: Configuration = Configuration {
    address: 2,
    bit_rate: BitRate::Mbit2,
    clock: MasterClock::Mhz32,
    transceiver: Transceiver::STANDARD,
};

/// The second drive of the recording of sercon816.md 11.
const RECORDED: CyclicConfiguration = CyclicConfiguration {
    cycle_us: 2000,
    t1_us: 336,
    t2_us: 1782,
    t3_us: 1965,
    t4_us: 1698,
    at_words: 4,
    mdt_words: 2,
    mdt_length_words: 16,
    record_position_words: 4,
};

const TIMERS: TimerMap = TimerMap {
    command_valid: Timer { register: Register::TIMER_0, bit: 9 },
    capture_feedback: Timer { register: Register::TIMER_2, bit: 14 },
    cycle_bits: 0,
};

fn initialised() -> (TestBus, Slave<TestBus>) {
    let bus = TestBus::new();
    let mut slave = Slave::new(bus.clone());
    slave.initialise(&CONFIGURATION).unwrap();
    (bus, slave)
}

fn words(bus: &TestBus, from: u16, count: u16) -> Vec<u16> {
    (from..from + count).map(|word| bus.ram(word)).collect()
}

fn timers(bus: &TestBus) -> [u16; 4] {
    [0x1A, 0x1B, 0x1C, 0x1D].map(|word| bus.register(word))
}

#[test]
fn initialisation_leaves_the_published_words() {
    let (bus, _) = initialised();
    let expected = [
        (0x01, 0x0669), // RSTFL as it was read after the reset
        (0x02, 0x0383),
        (0x03, 0x0100),
        (0x04, 0),
        (0x05, 0),
        (0x06, 0),
        (0x07, 0),
        (0x08, 0),
        (0x09, 0),
        (0x0A, 0),
        (0x0D, 0xFF0A),
        (0x0E, 0x051F),
        (0x0F, 65_000),
        (0x10, 65_000),
        (0x13, 3),
        (0x14, 0),
        (0x15, 0xFFFC),
        (0x16, 10),
        (0x18, 0),
        (0x19, 220),
    ];
    for (word, value) in expected {
        assert_eq!(bus.register(word), value, "{word:02X}H");
    }
    assert_eq!(timers(&bus), [0xFFFF; 4]);
    assert_eq!(words(&bus, 0, 11), [0x10, 0x10, 0x70, 0x70, 0x70, 0x70, 0x70, 0x70, 0x70, 0x70, 0]);
    assert_eq!(words(&bus, 0x010, 7), [0x4002, 150, 2, 0x018, 0x8402, 0, 0]);
    assert_eq!(words(&bus, 0x018, 9), [0x1802, 500, 2, 0x022, 0, 0x8402, 0, 0, 0]);
    assert_eq!(words(&bus, 0x022, 2), [0xC000, 950]);
}

#[test]
fn initialisation_resets_first_and_starts_telegrams_last() {
    let bus = TestBus::new();
    Slave::new(bus.clone()).initialise(&CONFIGURATION).unwrap();
    let writes = bus.take_writes();
    assert_eq!(
        writes[..3],
        [Write::Register(0x01, 0x0002), Write::Register(0x01, 0x0669), Write::Register(0x03, 0x0000),]
    );
    assert_eq!(writes.last(), Some(&Write::Register(0x03, 0x0100)));
    assert!(!writes[3..writes.len() - 1].iter().any(|write| matches!(write, Write::Register(0x03, _))));
}

#[test]
fn no_unexplained_register_is_ever_touched() {
    let (bus, mut slave) = initialised();
    slave.configure_cyclic(&RECORDED).unwrap();
    for phase in [0, 1, 2, 3, 4, 0] {
        if phase == 3 {
            slave.configure_cyclic(&RECORDED).unwrap();
        }
        slave.enter(phase, Some(&TIMERS)).unwrap();
    }
    for register in UNTOUCHED.into_iter().chain([Register::PHASE_DEPENDENT, Register::RING_DELAY]) {
        assert_eq!(bus.register(usize::from(register.word())), 0xBEEF, "{register:?}");
    }
}

#[test]
fn initialisation_refuses_what_is_not_there() {
    let bus = TestBus::new();
    bus.set_register(0, 0xFFFF);
    let mut slave = Slave::new(bus.clone());
    let error = slave.initialise(&CONFIGURATION).unwrap_err();
    assert_eq!(error, InitialiseError::Version { expected: 0x0010, actual: 0xFFFF });
    bus.set_register(0, 0x0010);
    bus.0.borrow_mut().broken_word = Some(0x50);
    let error = slave.initialise(&CONFIGURATION).unwrap_err();
    assert_eq!(error, InitialiseError::Ram { address: 0x50, expected: 0xA5C3 ^ 0x50, actual: 0xDEAD });
    for address in [0, 255] {
        let configuration = Configuration { address, ..CONFIGURATION };
        assert_eq!(slave.initialise(&configuration), Err(InitialiseError::Address { actual: address }));
    }
}

#[test]
fn the_cyclic_block_is_prepared_beside_the_block_in_force() {
    let (bus, mut slave) = initialised();
    bus.take_writes();
    slave.configure_cyclic(&RECORDED).unwrap();
    for write in bus.take_writes() {
        assert!(matches!(write, Write::Ram(0x030..=0x063, _)), "{write:?}");
    }
    assert_eq!(words(&bus, 0x030, 5), [0x4002, 336, 6, 0x048, 0x8406]);
    assert_eq!(words(&bus, 0x048, 7), [0x18FF, 1782, 16, 0x062, 0, 0x8404, 4]);
    // MDT of 16 words: 176 us at 2 Mbit/s.
    assert_eq!(words(&bus, 0x062, 2), [0xC000, 1782 + 176 + 10]);
}

#[test]
fn entering_cp3_is_a_handful_of_writes_that_switch_everything() {
    let (bus, mut slave) = initialised();
    slave.enter(2, Some(&TIMERS)).unwrap();
    slave.configure_cyclic(&RECORDED).unwrap();
    bus.set_ram(0x010, 0x4802);
    bus.take_accesses();
    slave.enter(3, Some(&TIMERS)).unwrap();
    assert!(bus.take_accesses() <= 20);
    assert_eq!(words(&bus, 0, 2), [0x030, 0x030]);
    assert_eq!(bus.ram(0x030), 0x5002);
    assert_eq!(bus.ram(0x010), 0x4002);
    assert_eq!([0x0F, 0x10].map(|word| bus.register(word)), [2000, 2000]);
    assert_eq!([0x15, 0x16, 0x18, 0x19].map(|word| bus.register(word)), [0xFFFC, 10, 6, 23]);
    assert_eq!((bus.register(0x03), bus.register(0x0A)), (0x0104, 3));
    assert_eq!(timers(&bus), [1965, 0xFFFF, 1698, 0xFFFF]);
    bus.take_writes();
    slave.enter(4, Some(&TIMERS)).unwrap();
    assert_eq!(bus.take_writes(), [Write::Register(0x0A, 4)]);
}

#[test]
fn falling_back_to_cp0_silences_the_drive_first() {
    let (bus, mut slave) = initialised();
    slave.configure_cyclic(&RECORDED).unwrap();
    slave.enter(3, Some(&TIMERS)).unwrap();
    bus.take_writes();
    slave.enter(0, Some(&TIMERS)).unwrap();
    assert_eq!(bus.take_writes()[..2], [Write::Ram(0x030, 0x4002), Write::Ram(0x010, 0x4002)]);
    assert_eq!(words(&bus, 0, 2), [0x010, 0x010]);
    assert_eq!((bus.register(0x03), bus.register(0x0A)), (0x0100, 0));
    assert_eq!(timers(&bus), [800, 0xFFFF, 0xFFFF, 0xFFFF]);
    assert_eq!(slave.enter(3, None), Err(EnterError::NotConfigured));
}

#[test]
fn timers_are_left_alone_while_they_are_being_discovered() {
    let (bus, mut slave) = initialised();
    slave.configure_cyclic(&RECORDED).unwrap();
    bus.take_writes();
    for phase in [0, 1, 2] {
        slave.enter(phase, None).unwrap();
    }
    assert!(!bus.take_writes().iter().any(|write| matches!(write, Write::Register(0x1A..=0x1D, _))));
}

#[test]
fn phases_above_4_change_nothing() {
    let (bus, mut slave) = initialised();
    bus.take_writes();
    assert_eq!(slave.enter(5, None), Err(EnterError::UnknownPhase { actual: 5 }));
    assert_eq!(bus.take_writes(), []);
}

#[test]
fn the_received_phase_is_masked() {
    let (bus, mut slave) = initialised();
    bus.set_register(0x0B, 0xA504);
    assert_eq!(slave.phase_received(), 4);
}

#[test]
fn a_negative_window_edge_is_clamped() {
    let bus = TestBus::new();
    let mut slave = Slave::new(bus.clone());
    slave.initialise(&Configuration { bit_rate: BitRate::Mbit16, ..CONFIGURATION }).unwrap();
    slave.configure_cyclic(&RECORDED).unwrap();
    slave.enter(3, None).unwrap();
    assert_eq!([0x18, 0x19].map(|word| bus.register(word)), [0, 8]);
}

#[test]
fn an_mdt_before_the_at_is_chained_first() {
    let (bus, mut slave) = initialised();
    slave.configure_cyclic(&CyclicConfiguration { t1_us: 1500, t2_us: 300, ..RECORDED }).unwrap();
    slave.enter(3, None).unwrap();
    assert_eq!((bus.ram(0), bus.ram(0x04B), bus.ram(0x033)), (0x048, 0x030, 0x062));
}

#[test]
fn the_end_marker_stays_before_the_next_mst_window() {
    let (bus, mut slave) = initialised();
    slave.configure_cyclic(&CyclicConfiguration { t2_us: 1815, ..RECORDED }).unwrap();
    assert_eq!(bus.ram(0x063), 2000 - 4 - 1);
}

#[test]
fn cyclic_configurations_that_do_not_fit_are_refused() {
    let (_, mut slave) = initialised();
    let cases = [
        (CyclicConfiguration { at_words: 17, ..RECORDED }, CyclicError::TooManyWords { limit: 16, actual: 17 }),
        (
            CyclicConfiguration { record_position_words: 13, ..RECORDED },
            CyclicError::RecordOutsideTelegram { length: 16, actual: 17 },
        ),
        (
            CyclicConfiguration { t3_us: 2000, ..RECORDED },
            CyclicError::TimeOutsideCycle { cycle_us: 2000, actual_us: 2000 },
        ),
    ];
    for (cyclic, error) in cases {
        assert_eq!(slave.configure_cyclic(&cyclic), Err(error));
        assert_eq!(slave.enter(3, None), Err(EnterError::NotConfigured));
    }
    slave.configure_cyclic(&CyclicConfiguration { record_position_words: 12, ..RECORDED }).unwrap();
}
