//! The run-up of a real master (sercos2.md 10.2), step by step, as drive 1 sees it.

use crate::support::{Boundary, Slave};
use sercos::{Idn, Phase};
use std::fmt::Write;

/// Writes down every step and its answer.
struct Dialogue {
    slave: Slave,
    log: String,
}

impl Dialogue {
    fn mst(&mut self, phase: u8) {
        self.slave.mst(phase).unwrap();
        writeln!(
            self.log,
            "-- MST {phase}: {}, command change {}",
            self.slave.drive.machine.current(),
            self.slave.server.command_change()
        )
        .unwrap();
    }

    fn step(&mut self, element: u8, write: bool, end: bool, info: u16) -> u16 {
        let answer = self.slave.step(element, write, end, info);
        let direction = if write { 'W' } else { 'R' };
        let end = if end { "END" } else { "   " };
        write!(self.log, "{element} {direction} {end} {info:04X} ").unwrap();
        match answer {
            Ok(answer) => writeln!(self.log, "-> {answer:04X}").unwrap(),
            Err(error) => writeln!(self.log, "-> error {:04X}", error.code()).unwrap(),
        }
        answer.unwrap_or_else(|error| panic!("{error}\n{}", self.log))
    }

    fn open(&mut self, idn: u16) -> u16 {
        self.step(1, true, true, idn)
    }

    fn close(&mut self, leftover: u16) {
        self.step(0, true, true, leftover);
    }

    fn read_attribute(&mut self, leftover: u16) -> u32 {
        let low = self.step(3, false, false, leftover);
        let high = self.step(3, false, true, leftover);
        u32::from(low) | (u32::from(high) << 16)
    }

    fn command(&mut self, idn: u16) {
        assert_eq!(self.open(idn), 0);
        self.read_attribute(idn);
        self.step(7, true, true, 3);
        self.close(3);
        assert_eq!(self.open(idn), 3);
        self.close(idn);
        assert_eq!(self.open(idn), 3);
        self.step(7, true, true, 0);
        self.close(0);
        assert_eq!(self.open(idn), 0);
        self.close(idn);
    }
}

fn run_up(slave: Slave) -> Dialogue {
    let mut dialogue = Dialogue { slave, log: String::new() };
    for phase in [0, 1, 2] {
        dialogue.mst(phase);
    }
    // Handshake test: element 0, read, no END.
    dialogue.step(0, false, false, 0x0080);
    for idn in [3, 4, 88, 96, 5, 90] {
        dialogue.open(idn);
        let attribute = dialogue.read_attribute(idn);
        assert_eq!(attribute, if idn == 96 { 0x7031_0001 } else { 0x7011_0001 });
        dialogue.step(7, false, true, idn);
        dialogue.close(idn);
    }
    for (idn, value) in [(1, 2000), (2, 2000), (6, 92), (89, 1782), (8, 1965), (7, 1698), (9, 1), (10, 32), (15, 7)] {
        dialogue.open(idn);
        dialogue.step(7, true, true, value);
        dialogue.close(value);
    }
    for (idn, words) in [(16, [6, 6, 11, 51, 0x8013].as_slice()), (24, [2, 2, 36].as_slice())] {
        dialogue.open(idn);
        dialogue.read_attribute(idn);
        let (last, first) = words.split_last().unwrap();
        for &word in first {
            dialogue.step(7, true, false, word);
        }
        dialogue.step(7, true, true, *last);
        dialogue.close(*last);
    }
    for (idn, bytes) in [(11, 2), (51, 4), (0x8013, 2), (36, 4)] {
        dialogue.open(idn);
        assert_eq!(dialogue.read_attribute(idn) >> 16 & 7, bytes / 2);
        dialogue.close(idn);
    }
    dialogue.command(99);
    dialogue.command(127);
    // The master serves the other drives before it switches.
    for _ in 0..100 {
        dialogue.slave.mst(2).unwrap();
    }
    dialogue.mst(3);
    dialogue.command(128);
    for _ in 0..420 {
        dialogue.slave.mst(3).unwrap();
    }
    dialogue.mst(4);
    dialogue
}

#[test]
fn the_recorded_run_up_reaches_cp4_without_an_error_step_for_step() {
    let dialogue = run_up(Slave::new(Boundary::WithLast, 16));
    assert_eq!(dialogue.slave.drive.machine.current(), Phase::Cp4);
    insta::assert_snapshot!(dialogue.log);
}

#[test]
fn the_answers_do_not_depend_on_how_the_controller_buffers() {
    let expected = run_up(Slave::new(Boundary::WithLast, 16)).log;
    for boundary in [Boundary::WithLast, Boundary::AfterLast] {
        for words in 1..=16 {
            assert_eq!(run_up(Slave::new(boundary, words)).log, expected, "{boundary:?}, {words} words");
        }
    }
}

#[test]
fn every_value_that_the_recorded_master_wrote_reads_back() {
    let mut slave = run_up(Slave::new(Boundary::WithLast, 16)).slave;
    for (idn, value) in [(1, 2000), (2, 2000), (6, 92), (89, 1782), (8, 1965), (7, 1698), (9, 1), (10, 32), (15, 7)] {
        slave.open(Idn(idn)).unwrap();
        assert_eq!(slave.read(7, 1), Ok(vec![value]));
    }
    slave.open(Idn::AT_LIST).unwrap();
    assert_eq!(slave.read_list(7), Ok(vec![6, 32, 11, 51, 0x8013]));
    slave.open(Idn::MDT_LIST).unwrap();
    assert_eq!(slave.read_list(7), Ok(vec![2, 32, 36]));
}
