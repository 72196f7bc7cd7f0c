//! A master's service container against a scripted slave. sercon816.md 6.4, 8.5, 0DH.

use std::collections::VecDeque;

use crate::chip_rig::{BUFFERS, Rig, SERVICE};
use ring::chip::Alternatives;

const CYCLE: u64 = 2_000_000;

const M_BUSY: u16 = 1 << 7;
const SETEND: u16 = 1 << 6;
const INT_ERR: u16 = 1 << 12;
const INT_END_WRBUF: u16 = 1 << 13;
const INT_END_RDBUF: u16 = 1 << 14;
const INT_HS_TIMEOUT: u16 = 1 << 10;
const INT_BUSY_TIMEOUT: u16 = 1 << 11;
const INT_CMD: u16 = 1 << 12;

/// The AT's command change bit as it is on the wire (sercos2.md 1.7).
const COMMAND_CHANGE: u16 = 1 << 5;

/// A master chip with one AT (of any address, at 150 us) and one MDT (to address 1, at 600 us) a cycle.
struct Station {
    rig: Rig,
    /// The AT of the next cycle, `None` for a drive that is silent.
    at: Option<(u16, u16)>,
    mst: u64,
}

impl Station {
    fn new() -> Self {
        let mut rig = Rig::new(Alternatives::default());
        for (register, value) in [
            (0x01, 0x0002),
            (0x01, 0x0661),
            (0x02, 0x0383),
            (0x0D, 0xFF0A),
            (0x0E, 0x051F),
            (0x0F, 2_000),
            (0x13, 3),
            (0x15, 0xFFFC),
            (0x16, 10),
            (0x18, 0),
            (0x19, 400),
        ] {
            rig.set_register(register, value);
        }
        rig.set_ram(0, &[0x10, 0x10, SERVICE, SERVICE, SERVICE, SERVICE, SERVICE, SERVICE, SERVICE, SERVICE, 0]);
        rig.set_ram(0x10, &[0x1000, 100, 2, 0x20, 0, 0xC402, 0, 0, 0]);
        rig.set_ram(0x20, &[0x5001, 600, 2, 0x30, 0xC402, 0xE000, 0]);
        rig.set_ram(0x30, &[0xC000, 950]);
        rig.set_ram(SERVICE, &[0x0086, 0, 0, 0x1414, 0]);
        rig.set_register(0x0A, 2);
        rig.set_register(0x03, 0x0100);
        Self { rig, at: Some((0, 0)), mst: 0 }
    }

    /// One cycle: MST, AT, MDT; returns control and info of the MDT.
    fn cycle(&mut self) -> (u16, u16) {
        self.rig.sent.clear();
        let end = self.mst + 24_500;
        if let Some((status, info)) = self.at {
            let [s, i] = [status.to_le_bytes(), info.to_le_bytes()];
            self.rig.telegram(end + 150_000, &[1, s[0], s[1], i[0], i[1]]);
        }
        self.rig.run_to(self.mst + CYCLE - 1_000);
        assert_eq!(self.rig.sent[0], (self.mst, vec![0xFF, 2]));
        let (time, mdt) = &self.rig.sent[1];
        assert_eq!(*time, end + 600_000);
        assert_eq!(mdt[0], 1);
        self.mst += CYCLE;
        (u16::from_le_bytes([mdt[1], mdt[2]]), u16::from_le_bytes([mdt[3], mdt[4]]))
    }

    /// Answers every step at once, taking info words from `words`; returns what the slave has seen until M_BUSY.
    fn run_with_slave(&mut self, words: &[u16]) -> Vec<(u16, u16)> {
        let mut words: VecDeque<u16> = words.iter().copied().collect();
        let mut seen = Vec::new();
        for _ in 0..40 {
            if self.word(0) & M_BUSY != 0 {
                return seen;
            }
            let (control, info) = self.cycle();
            let (status, last) = self.at.unwrap_or_default();
            if (control ^ status) & 1 != 0 {
                seen.push((control & 0x3F, info));
                self.at = Some((control & 1, words.pop_front().unwrap_or(last)));
            }
        }
        panic!("the container does not come to an end");
    }

    fn word(&mut self, offset: u16) -> u16 {
        self.rig.ram(SERVICE + offset)
    }

    /// Starts a transfer as sercon816.md 8.5 does.
    fn write(&mut self, element: u16, words: &[u16]) {
        self.rig.set_ram(BUFFERS, words);
        self.start(element, 1 << 1, words.len() as u16);
    }

    fn read(&mut self, element: u16, words: u16) {
        self.start(element, 0, words);
    }

    fn start(&mut self, element: u16, direction: u16, words: u16) {
        let handshake = !self.word(1) & 1;
        let end = if words == 1 { 1 << 2 } else { SETEND };
        self.rig.set_ram(SERVICE + 2, &[(words - 1) << 8, 0x1414 + ((words - 1) << 8), 0]);
        self.rig.set_ram(SERVICE, &[handshake | direction | end | element << 3]);
    }
}

#[test]
fn an_idle_container_repeats_its_word_and_never_interrupts() {
    let mut station = Station::new();
    for _ in 0..20 {
        assert_eq!(station.cycle(), (0xE006, 0));
    }
    assert_eq!(station.word(0), 0x0086);
    assert_eq!(station.rig.register(0x05) & 1, 0);
}

#[test]
fn a_single_word_goes_out_with_end_and_stops_at_its_acknowledgement() {
    let mut station = Station::new();
    station.write(1, &[3]);
    assert_eq!(station.run_with_slave(&[0x0008]), [(0x0F, 3)]);
    assert_eq!(station.word(0), 0x008F | INT_END_WRBUF);
    assert_eq!(station.rig.take_status(0x05) & 1, 1);
    assert_eq!(station.rig.ram(0x18), 0x0008, "the AT's info word stands in the data container");
    assert_eq!(station.cycle(), (0xE00F, 3), "the word is repeated until software gives the next");
}

#[test]
fn a_list_toggles_the_handshake_every_word_and_sets_end_on_the_last() {
    let mut station = Station::new();
    station.write(7, &[6, 6, 11, 51, 32_787]);
    let seen = station.run_with_slave(&[]);
    assert_eq!(seen, [(0x3B, 6), (0x3A, 6), (0x3B, 11), (0x3A, 51), (0x3F, 32_787)]);
    assert_eq!(station.word(0) & INT_END_WRBUF, INT_END_WRBUF);
}

#[test]
fn a_segment_without_setend_stops_without_end() {
    let mut station = Station::new();
    station.write(7, &[1, 2]);
    let word = station.word(0);
    station.rig.set_ram(SERVICE, &[word & !SETEND]);
    assert_eq!(station.run_with_slave(&[]), [(0x3B, 1), (0x3A, 2)]);
}

#[test]
fn a_read_collects_the_words_in_the_read_buffer() {
    let mut station = Station::new();
    station.read(3, 2);
    assert_eq!(station.run_with_slave(&[0x1234, 0x5678]).len(), 2);
    assert_eq!(station.word(0) & (M_BUSY | INT_END_RDBUF), M_BUSY | INT_END_RDBUF);
    assert_eq!((station.rig.ram(BUFFERS + 20), station.rig.ram(BUFFERS + 21)), (0x1234, 0x5678));
}

#[test]
fn an_error_of_the_slave_ends_the_transfer_with_int_err() {
    let mut station = Station::new();
    station.write(7, &[1, 2, 3]);
    station.cycle();
    station.at = Some((0b0101, 0x7005));
    station.cycle();
    assert_eq!(station.word(0) & (M_BUSY | INT_ERR), M_BUSY | INT_ERR);
    assert_eq!(station.rig.register(0x05) & 1, 1);
    assert_eq!(station.rig.ram(0x18), 0x7005);
    assert_eq!(station.word(2) & 0xFF, 0, "the pointer stays at the refused word");
}

#[test]
fn a_slave_that_never_acknowledges_runs_into_the_handshake_timeout() {
    for answers in [true, false] {
        let mut station = Station::new();
        station.at = answers.then_some((0, 0));
        station.write(1, &[3]);
        station.cycle();
        for counted in 1..10 {
            station.cycle();
            assert_eq!(station.word(4), counted, "answers: {answers}");
        }
        assert_eq!(station.word(0) & M_BUSY, 0);
        station.cycle();
        assert_eq!(station.word(4) & INT_HS_TIMEOUT, INT_HS_TIMEOUT);
        assert_eq!(station.word(0) & M_BUSY, M_BUSY);
        assert_eq!(station.word(1) & 0x80 != 0, !answers, "RECERR");
        assert_eq!(station.rig.register(0x05) & 1, 1);
    }
}

#[test]
fn a_busy_slave_has_the_busy_timeout() {
    let mut station = Station::new();
    station.rig.set_register(0x0D, 0x280A);
    station.write(1, &[3]);
    station.cycle();
    station.at = Some((0b0010, 0));
    for counted in 1..40 {
        station.cycle();
        assert_eq!(station.word(4), 0x0100 | counted);
    }
    station.cycle();
    assert_eq!(station.word(4) & (INT_BUSY_TIMEOUT | INT_HS_TIMEOUT), INT_BUSY_TIMEOUT);
    assert_eq!(station.word(0) & M_BUSY, M_BUSY);

    let mut station = Station::new();
    station.write(1, &[3]);
    station.cycle();
    station.at = Some((0b0010, 0));
    for _ in 0..30 {
        station.cycle();
    }
    station.at = Some((0b0001, 0));
    station.cycle();
    assert_eq!(station.word(0) & INT_END_WRBUF, INT_END_WRBUF, "busy for 30 cycles is no handshake timeout");
    assert_eq!(station.word(4), 0);
}

#[test]
fn a_command_change_bit_sets_int_cmd_once() {
    let mut station = Station::new();
    station.at = Some((COMMAND_CHANGE, 0));
    station.cycle();
    assert_eq!(station.word(4), INT_CMD);
    assert_eq!(station.rig.take_status(0x05) & 1, 1);
    station.cycle();
    assert_eq!(station.rig.take_status(0x05) & 1, 0);
}

#[test]
fn the_msts_come_every_tscyc_with_the_phase_of_0ah_until_the_cycle_is_stopped() {
    let mut station = Station::new();
    station.cycle();
    station.rig.set_register(0x0A, 3);
    station.rig.set_register(0x0F, 4_000);
    station.rig.sent.clear();
    station.rig.run_to(station.rig.now.0 + 12_000_000);
    let msts: Vec<_> = station.rig.sent.iter().filter(|(_, bytes)| bytes[0] == 0xFF).cloned().collect();
    assert_eq!(msts, [2, 6, 10].map(|millis: u64| (millis * 1_000_000, vec![0xFF, 3])));
    station.rig.set_register(0x03, 0);
    station.rig.sent.clear();
    station.rig.run_to(station.rig.now.0 + 12_000_000);
    assert!(station.rig.sent.iter().all(|(_, bytes)| bytes[0] != 0xFF));
}

#[test]
fn before_the_start_command_each_edge_of_cyc_clk_makes_one_mst() {
    let mut station = Station::new();
    station.rig.set_register(0x03, 0);
    station.rig.set_register(0x14, 5);
    for edge in [10_000_000, 13_000_000] {
        station.rig.sent.clear();
        station.rig.run_to(edge);
        station.rig.chip.on_cycle_clock(station.rig.now);
        station.rig.run_to(edge + 2_900_000);
        assert_eq!(station.rig.sent, [(edge + 5_000, vec![0xFF, 2])], "and no header is processed");
    }
    station.rig.set_register(0x14, 0);
    station.rig.set_register(0x03, 0x0100);
    // What the host writes for its cycles does not stop a chip that runs by itself.
    station.rig.set_register(0x03, 0x0423);
    station.rig.sent.clear();
    let start = station.rig.now.0;
    station.rig.chip.on_cycle_clock(station.rig.now);
    station.rig.run_to(start + 5_000_000);
    let starts: Vec<u64> = station.rig.sent.iter().map(|(time, _)| time - start).collect();
    assert_eq!(starts, [0, 624_500, 2_000_000, 2_624_500, 4_000_000, 4_624_500]);
}

#[test]
fn a_chip_with_its_repeater_on_sends_no_mst() {
    let mut rig = Rig::slave(Alternatives::default());
    rig.run_to(10_000_000);
    assert!(rig.sent.is_empty());
}

#[test]
fn a_drive_that_becomes_busy_restarts_the_count() {
    let mut station = Station::new();
    station.write(1, &[3]);
    for _ in 0..6 {
        station.cycle();
    }
    assert_eq!(station.word(4), 5);
    station.at = Some((0b0010, 0));
    station.cycle();
    assert_eq!(station.word(4), 0x0101);
}
