//! The models together, seen through their addresses, with the pins of the board.

use super::*;
use crate::{DigitalInputs, IndexEdge};

/// 16 kHz, from the start of the modulator.
const HALF: u64 = 31_250;
const TIMER: u32 = 0x4001_0000;
const STATUS: u32 = 0x10;
const COUNT: u32 = 0x24;
const CAPTURE_1: u32 = 0x34;

/// Everything is written down as it is told.
#[derive(Debug, Default)]
pub(crate) struct World {
    pins: (bool, bool),
    encoder: u32,
    steady_until: Nanoseconds,
    inputs: DigitalInputs,
    index: IndexEdge,
    fault: bool,
    samples: Vec<(u64, usize, u8)>,
    bridge: Vec<(u64, bool, u32)>,
    duties: Vec<(u64, [f64; 3])>,
    brake: Vec<(u64, bool)>,
    chopper: Vec<(u64, bool)>,
}

impl Environment for World {
    fn external_read(&mut self, _: Nanoseconds, _: u32) -> u16 {
        0
    }

    fn external_write(&mut self, _: Nanoseconds, _: u32, _: u16) {}

    fn interrupt_pins(&self) -> (bool, bool) {
        self.pins
    }

    fn encoder_count(&mut self, _: Nanoseconds) -> u32 {
        self.encoder
    }

    fn address_switches(&self) -> u8 {
        0
    }

    fn analog_sample(&mut self, at: Nanoseconds, adc: usize, channel: u8) -> u16 {
        self.samples.push((at.0, adc, channel));
        1_000 * adc as u16 + u16::from(channel)
    }

    fn set_bridge(&mut self, at: Nanoseconds, on: bool, dead_time_ns: u32) {
        self.bridge.push((at.0, on, dead_time_ns));
    }

    fn set_duties(&mut self, at: Nanoseconds, duties: [f64; 3]) {
        self.duties.push((at.0, duties));
    }

    fn set_brake(&mut self, at: Nanoseconds, energised: bool) {
        self.brake.push((at.0, energised));
    }

    fn set_chopper(&mut self, at: Nanoseconds, on: bool) {
        self.chopper.push((at.0, on));
    }

    fn break_input(&self) -> bool {
        !self.fault
    }

    fn digital_inputs(&self) -> DigitalInputs {
        self.inputs
    }

    fn index_count(&mut self, _: Nanoseconds) -> IndexEdge {
        self.index
    }

    fn encoder_steady_until(&self, _: Nanoseconds) -> Nanoseconds {
        self.steady_until
    }
}

/// The peripherals without a processor.
#[derive(Debug)]
pub(crate) struct Board {
    pub(crate) peripherals: Peripherals,
    world: World,
    now: Nanoseconds,
}

impl Board {
    /// The clocks are up: 168 MHz, everything that the power stage needs enabled.
    pub(crate) fn new() -> Self {
        let mut board = Self {
            peripherals: Peripherals::new(),
            world: World { pins: (true, true), ..World::default() },
            now: Nanoseconds::ZERO,
        };
        for (address, value) in [(0x4002_3C00, 0x705), (0x4002_3804, 0x0740_2A04), (0x4002_3800, 0x0101_0081)] {
            board.write(address, value);
        }
        board.run_until(Nanoseconds::from_millis(10));
        for (address, value) in
            [(0x4002_3808, 0x9402), (0x4002_3830, 0x1FF), (0x4002_3840, 0x7), (0x4002_3844, 0x1_4703)]
        {
            board.write(address, value);
        }
        board
    }

    /// Set up and running, as the audit wants it; returns the instant of the start.
    fn with_power_stage() -> (Self, u64) {
        let mut board = Self::new();
        board.set_up(&set_up_power_stage());
        let start = board.now.0;
        (board, start)
    }

    /// Writes one after the other, a microsecond between them.
    pub(crate) fn set_up(&mut self, writes: &[(u32, u32)]) {
        for (address, value) in writes {
            self.run_until(self.now + Nanoseconds::from_microseconds(1));
            self.write(*address, *value);
        }
    }

    fn try_write(&mut self, address: u32, value: u32) -> Result<(), EmulatorError> {
        let access = Access { now: self.now, address, width: 4, pc: 0 };
        self.peripherals.write(&mut self.world, access, value)?;
        self.peripherals.sample(&mut self.world, self.now).map(|_| ())
    }

    pub(crate) fn write(&mut self, address: u32, value: u32) {
        self.try_write(address, value).unwrap();
    }

    fn read(&mut self, address: u32) -> u32 {
        let access = Access { now: self.now, address, width: 4, pc: 0 };
        self.peripherals.read(&mut self.world, access).unwrap()
    }

    /// From event to event, as the guest does it.
    fn try_run_until(&mut self, until: Nanoseconds) -> Result<(), EmulatorError> {
        while self.now < until {
            let next = self.peripherals.next_event().map_or(until, |event| event.min(until));
            assert!(next > self.now, "an event at {next} is still due");
            self.now = next;
            self.peripherals.advance(&mut self.world, next)?;
            self.peripherals.sample(&mut self.world, next)?;
        }
        Ok(())
    }

    fn run_until(&mut self, until: Nanoseconds) {
        self.try_run_until(until).unwrap();
    }

    /// The world has changed its pins at this instant.
    fn edge(&mut self) {
        self.peripherals.sample(&mut self.world, self.now).unwrap();
    }
}

/// Mode, pull and alternate functions of a port: (pin, function or `None` for other modes, mode, pull).
fn port(number: u32, pins: &[(u32, u32, u32, u32)]) -> [(u32, u32); 4] {
    let base = 0x4002_0000 + 0x400 * number;
    let (mut mode, mut pull, mut functions) = (0, 0, 0_u64);
    for (pin, pin_mode, pin_pull, function) in pins {
        mode |= pin_mode << (2 * pin);
        pull |= pin_pull << (2 * pin);
        functions |= u64::from(*function) << (4 * pin);
    }
    [(base + 0x20, functions as u32), (base + 0x24, (functions >> 32) as u32), (base + 0x0C, pull), (base, mode)]
}

/// A set-up of pins, modulator and converters without deviation, one write a register.
pub(crate) fn set_up_power_stage() -> Vec<(u32, u32)> {
    const OUTPUT: u32 = 1;
    const ALTERNATE: u32 = 2;
    const ANALOGUE: u32 = 3;
    let alternate = |function: u32| move |pin: u32| (pin, ALTERNATE, 0, function);
    let analogue = |pin: u32| (pin, ANALOGUE, 0, 0);
    let input = |pin: u32| (pin, 0, 2, 0);
    let driver = |pin: u32| (pin, ALTERNATE, 2, 1);
    let mut of_a: Vec<_> = (0..=3).map(alternate(1)).collect();
    of_a.extend((8..=10).map(driver));
    let mut of_b: Vec<_> = [12, 13, 14, 15].into_iter().map(driver).collect();
    of_b.extend([0, 4, 5, 6, 7, 8].into_iter().map(alternate(2)));
    let mut of_c: Vec<_> = (0..=4).map(analogue).collect();
    of_c.extend((6..=8).map(alternate(3)));
    of_c.extend((9..=13).map(input));
    of_c.push((5, OUTPUT, 0, 0));
    let of_e: Vec<_> = [5, 6].into_iter().map(alternate(3)).collect();
    let ports = [(0, of_a), (1, of_b), (2, of_c), (4, of_e), (5, vec![analogue(6), (11, OUTPUT, 0, 0)])];
    let mut writes: Vec<_> = ports.iter().flat_map(|(number, pins)| port(*number, pins)).collect();
    let sequence = |first: u32, second: u32| 1 << 20 | second << 15 | first << 10;
    writes.extend([
        (0x4001_2304, 0x0001_0015),
        (0x4001_2004, 0x180),
        (0x4001_2104, 0x100),
        (0x4001_2204, 0x100),
        (0x4001_200C, 2 << 9),
        (0x4001_210C, 2 << 12),
        (0x4001_2210, 2 << 12),
        (0x4001_2038, sequence(10, 13)),
        (0x4001_2138, sequence(11, 14)),
        (0x4001_2238, sequence(12, 4)),
        (0x4001_2108, 1),
        (0x4001_2208, 1),
        (0x4001_2008, 0x0011_0001),
        (0x4001_0028, 0),
        (0x4001_002C, 5_250),
        (0x4001_0030, 0),
        (0x4001_0018, 0x6868),
        (0x4001_001C, 0x7868),
        (0x4001_0034, 2_625),
        (0x4001_0038, 2_625),
        (0x4001_003C, 2_625),
        (0x4001_0040, 5_226),
        (0x4001_0020, 0x555),
        (0x4001_0044, 0x1C94),
        (0x4001_0014, 1),
        (0x4001_0010, 0),
        // Reference 4 is low only since CCR4 has been loaded: as TRGO before, it would have started a sequence.
        (0x4001_0004, 0x70),
        (0x4001_0000, 0xA1),
    ]);
    writes
}

#[test]
fn currents_are_held_at_the_peak_of_every_period() {
    let (mut board, start) = Board::with_power_stage();
    board.run_until(Nanoseconds(start + 4 * HALF));
    let holds: Vec<u64> = board
        .world
        .samples
        .iter()
        .filter(|(_, adc, channel)| (*adc, *channel) == (2, 11))
        .map(|(at, ..)| *at)
        .collect();
    assert_eq!(holds.len(), 2);
    for (period, at) in (0..).zip(&holds) {
        let peak = start + (2 * period + 1) * HALF;
        assert!(at.abs_diff(peak) <= 2, "held {at}, peak {peak}");
    }
    assert_eq!(board.world.samples.len(), 12, "two ranks on three converters in two periods");
}

#[test]
fn a_period_has_four_events_two_holds_the_end_and_the_underflow() {
    let (mut board, start) = Board::with_power_stage();
    let mut events = Vec::new();
    while events.len() < 8 {
        let next = board.peripherals.next_event().unwrap();
        events.push(next.0 - start);
        board.run_until(next);
    }
    let first = [31_251, 33_156, 33_728, 62_500];
    let expected = first.into_iter().chain(first.map(|at| at + 2 * HALF));
    assert_eq!(events, expected.collect::<Vec<_>>());
}

#[test]
fn the_end_of_the_sequence_interrupts_and_foretells_what_the_handler_reads() {
    let (mut board, start) = Board::with_power_stage();
    board.peripherals.take_interrupts();
    // Trigger at 31 107.1 ns, 55 cycles of 21 MHz.
    board.run_until(Nanoseconds(start + 33_726));
    assert_eq!(board.peripherals.take_interrupts().0, 0);
    board.run_until(Nanoseconds(start + 33_728));
    assert_eq!(board.peripherals.take_interrupts().0, 1 << 18);
    let wake = board.peripherals.next_event().unwrap();
    assert_eq!(wake, Nanoseconds(start + 2 * HALF), "nothing until the underflow");
    board.world.steady_until = wake;
    let mut peek = |address| board.peripherals.peek(&mut board.world, address, board.now, wake);
    for (address, expected) in [
        (0x4001_2000, 0xC),
        (0x4001_203C, 1_010),
        (0x4001_2040, 1_013),
        (0x4001_213C, 2_011),
        (0x4001_2140, 2_014),
        (0x4001_223C, 3_012),
        (0x4001_2240, 3_004),
        (0x4001_0000, 0xB1),
    ] {
        assert_eq!(peek(address), Some(expected), "{address:#x}");
    }
    assert_eq!(peek(0x4001_0024), None, "the count of the modulator runs");
}

#[test]
fn a_processor_that_waits_is_asked_at_the_end_of_a_sequence_and_at_nothing_before() {
    let (mut board, start) = Board::with_power_stage();
    board.run_until(Nanoseconds(start + 1_000));
    let end = board.peripherals.next_interrupt().unwrap();
    assert_eq!(end, Nanoseconds(start + 33_728));
    board.peripherals.take_interrupts();
    board.run_until(Nanoseconds(end.0 - 2));
    assert_eq!(board.peripherals.take_interrupts().0, 0);
    assert_eq!(board.peripherals.next_interrupt(), Some(end), "of the sequence that runs");
    board.run_until(end);
    assert_eq!(board.peripherals.take_interrupts().0, 1 << 18);
    let next = board.peripherals.next_interrupt().unwrap();
    assert!(next.0.abs_diff(end.0 + 2 * HALF) <= 1, "{next}");
    board.write(0x4001_2004, 0x100);
    assert_eq!(board.peripherals.next_interrupt(), None, "no interrupt is enabled");
}

#[test]
fn the_counts_of_running_timers_are_foretold_for_an_instant() {
    let (mut board, start) = Board::with_power_stage();
    let tim9 = 0x4001_4000;
    for (offset, value) in [(0x2C, 0xFFFF), (0x00, 1)] {
        board.write(tim9 + offset, value);
    }
    board.run_until(Nanoseconds(start + 34_000));
    let then = Nanoseconds(start + 34_500);
    let foretold = [TIMER + COUNT, tim9 + COUNT]
        .map(|address| board.peripherals.foretell(&mut board.world, address, then).unwrap());
    let turn = Nanoseconds(start + 2 * HALF);
    assert_eq!(board.peripherals.foretell(&mut board.world, TIMER + COUNT, turn), None, "the direction turns");
    assert_eq!(board.peripherals.foretell(&mut board.world, TIMER + STATUS, then), None, "no count");
    board.run_until(then);
    assert_eq!([board.read(TIMER + COUNT), board.read(tim9 + COUNT)], foretold);
    assert_eq!(foretold[0], 5_250 - 546);
}

#[test]
fn nothing_is_foretold_beyond_its_next_change() {
    let (mut board, start) = Board::with_power_stage();
    let now = Nanoseconds(start + 40_000);
    board.run_until(now);
    let underflow = Nanoseconds(start + 2 * HALF);
    let mut peek = |address, until| board.peripherals.peek(&mut board.world, address, now, until);
    assert!(peek(0x4001_0000, underflow).is_some());
    assert_eq!(peek(0x4001_0000, underflow + Nanoseconds(1)), None, "the direction turns");
    assert!(peek(0x4001_203C, Nanoseconds(start + 93_600)).is_some());
    assert_eq!(peek(0x4001_203C, Nanoseconds(start + 93_700)), None, "the next sequence starts");
}

#[test]
fn the_position_is_foretold_while_the_encoder_is_steady() {
    let (mut board, _) = Board::with_power_stage();
    for (offset, value) in [(0x08, 3), (0x2C, u32::MAX), (0x24, 0), (0x00, 1)] {
        board.write(0x4000_0000 + offset, value);
    }
    board.world.encoder = 77;
    board.world.steady_until = board.now + Nanoseconds(1_000);
    let (now, soon) = (board.now, board.now + Nanoseconds(1_000));
    let mut peek = |until| board.peripherals.peek(&mut board.world, 0x4000_0024, now, until);
    assert_eq!(peek(soon), Some(77));
    assert_eq!(peek(soon + Nanoseconds(1)), None);
}

#[test]
fn duties_reach_the_world_at_the_next_half() {
    let (mut board, start) = Board::with_power_stage();
    board.write(TIMER + 0x44, 0x9C94);
    assert_eq!(board.world.bridge.last(), Some(&(start, true, 1_000)));
    board.world.duties.clear();
    board.run_until(Nanoseconds(start + HALF + 2_500));
    board.write(TIMER + 0x34, 1_050);
    board.run_until(Nanoseconds(start + 4 * HALF));
    assert_eq!(board.world.duties, [(start + 2 * HALF, [0.2, 0.5, 0.5])]);
}

#[test]
fn a_fault_opens_the_bridge_while_the_processor_stands_still() {
    let (mut board, start) = Board::with_power_stage();
    board.write(TIMER + 0x44, 0x9C94);
    board.run_until(Nanoseconds(start + 12_345));
    board.world.fault = true;
    board.edge();
    assert_eq!(board.world.bridge.last(), Some(&(start + 12_345, false, 1_000)));
    board.world.fault = false;
    board.run_until(Nanoseconds(start + 10 * HALF));
    assert_eq!(board.world.bridge.last(), Some(&(start + 12_345, false, 1_000)), "AOE is off");
    assert_eq!(board.read(TIMER + STATUS) & 0x80, 0x80);
}

#[test]
fn a_break_interrupts_when_asked_to() {
    let (mut board, _) = Board::with_power_stage();
    board.write(TIMER + 0x0C, 0x80);
    board.peripherals.take_interrupts();
    board.world.fault = true;
    board.edge();
    assert_eq!(board.peripherals.take_interrupts().0, 1 << 24);
}

#[test]
fn without_its_pin_the_break_input_is_low() {
    let (mut board, start) = Board::with_power_stage();
    board.write(0x4002_0400, 0xA800_0000);
    board.write(TIMER + 0x44, 0x9C94);
    assert!(!board.world.bridge.iter().any(|(_, on, _)| *on), "{:?}", board.world.bridge);
    assert_eq!(board.now.0, start);
}

#[test]
fn a_gate_pin_that_is_not_switched_to_the_timer_keeps_the_bridge_off() {
    let (mut board, _) = Board::with_power_stage();
    board.write(TIMER + 0x44, 0x9C94);
    let mode = board.read(0x4002_0000);
    board.write(0x4002_0000, mode & !(3 << 18));
    assert_eq!(board.world.bridge.last().map(|(_, on, _)| *on), Some(false));
    board.write(0x4002_0000, mode);
    assert_eq!(board.world.bridge.last().map(|(_, on, _)| *on), Some(true));
}

#[test]
fn converting_a_pin_that_is_not_analogue_is_refused() {
    let (mut board, start) = Board::with_power_stage();
    let mode = board.read(0x4002_0800);
    board.write(0x4002_0800, mode & !3);
    let error = board.try_run_until(Nanoseconds(start + HALF + 10)).unwrap_err().to_string();
    assert!(error.contains("ADC1 converts PC0, which is not analogue"), "{error}");
}

#[test]
fn a_peripheral_without_its_clock_is_refused() {
    for (address, bit) in [(0x4001_0000, 0), (0x4001_0400, 1), (0x4001_2000, 8), (0x4001_2304, 8), (0x4001_2104, 9)] {
        let mut board = Board::new();
        board.write(0x4002_3844, 0x1_4703 & !(1 << bit));
        let error = board.try_write(address, 0).unwrap_err().to_string();
        assert!(error.contains(&format!("bit {bit} of its clock enable")), "{error}");
    }
}

#[test]
fn the_brake_coil_is_told() {
    let (mut board, start) = Board::with_power_stage();
    board.write(0x4002_0818, 1 << 5);
    board.write(0x4002_0818, 1 << 21);
    assert_eq!(board.world.brake, [(start, true), (start, false)]);
}

#[test]
fn the_switch_of_the_chopper_is_told() {
    let (mut board, start) = Board::with_power_stage();
    board.write(0x4002_1418, 1 << 11);
    board.write(0x4002_1418, 1 << 27);
    assert_eq!(board.world.chopper, [(start, true), (start, false)]);
}

#[test]
fn digital_inputs_are_levels_of_port_c() {
    let (mut board, _) = Board::with_power_stage();
    board.world.inputs =
        DigitalInputs { main_power: true, sto_2: true, brake_feedback: true, ..DigitalInputs::default() };
    board.edge();
    assert_eq!(board.read(0x4002_0810) & 0x3E00, 1 << 9 | 1 << 11 | 1 << 13);
    board.world.inputs = DigitalInputs { sto_1: true, home_switch: true, ..DigitalInputs::default() };
    board.edge();
    assert_eq!(board.read(0x4002_0810) & 0x3E00, 1 << 10 | 1 << 12);
}

#[test]
fn index_and_probes_latch_the_position() {
    let (mut board, _) = Board::with_power_stage();
    board.world.encoder = 70_000;
    let (tim3, tim4, tim8) = (0x4000_0400, 0x4000_0800, 0x4001_0400);
    for timer in [tim3, tim4, tim8] {
        // IC3 on TI3 rising, IC4 on TI3 falling.
        for (offset, value) in [(0x1C, 0x0201), (0x20, 0x3100), (0x08, 3), (0x2C, 0xFFFF), (COUNT, 0), (0x00, 1)] {
            board.write(timer + offset, value);
        }
    }
    board.world.encoder = 70_100;
    board.world.inputs.probe_1 = true;
    board.edge();
    board.world.encoder = 70_300;
    board.world.inputs.probe_1 = false;
    board.world.inputs.probe_2 = true;
    board.world.index = IndexEdge { number: 1, count: 70_250 };
    board.edge();
    board.world.encoder = 71_000;
    assert_eq!(board.read(tim3 + STATUS), 1 << 3);
    assert_eq!(board.read(tim3 + 0x3C), 250, "the index, not the position at which it is noticed");
    assert_eq!(board.read(tim4 + STATUS), 1 << 3 | 1 << 4);
    assert_eq!([board.read(tim4 + 0x3C), board.read(tim4 + 0x40)], [100, 300]);
    assert_eq!(board.read(tim8 + STATUS), 1 << 3);
    assert_eq!(board.read(tim8 + 0x3C), 300);
    assert_eq!(board.read(tim8 + COUNT), 1_000);
    board.world.index = IndexEdge { number: 3, count: 70_900 };
    board.edge();
    board.write(tim3 + STATUS, !(1 << 3));
    assert_eq!(board.read(tim3 + STATUS), 1 << 11, "an index was lost");
}

#[test]
fn tim9_stamps_the_time_of_both_chip_interrupts() {
    let (mut board, _) = Board::with_power_stage();
    let tim9 = 0x4001_4000;
    for (offset, value) in [(0x18, 0x0101), (0x20, 0xBB), (0x2C, 0xFFFF), (0x00, 1)] {
        board.write(tim9 + offset, value);
    }
    let start = board.now;
    board.run_until(start + Nanoseconds(100_000));
    board.world.pins.0 = false;
    board.edge();
    board.run_until(start + Nanoseconds(150_000));
    board.world.pins.1 = false;
    board.edge();
    let stamps = [board.read(tim9 + CAPTURE_1), board.read(tim9 + CAPTURE_1 + 4)];
    assert!(stamps[0].abs_diff(16_800) <= 1 && stamps[1].abs_diff(25_200) <= 1, "{stamps:?}");
    board.run_until(start + Nanoseconds(200_000));
    board.world.pins.0 = true;
    board.edge();
    assert!(board.read(tim9 + CAPTURE_1).abs_diff(33_600) <= 1, "both edges");
}

#[test]
fn captures_need_their_pins() {
    let (mut board, _) = Board::with_power_stage();
    let tim9 = 0x4001_4000;
    for (offset, value) in [(0x18, 0x0101), (0x20, 0xBB), (0x00, 1)] {
        board.write(tim9 + offset, value);
    }
    board.write(0x4002_1000, 0);
    board.world.pins = (false, false);
    board.edge();
    assert_eq!(board.read(tim9 + STATUS), 0);
}
