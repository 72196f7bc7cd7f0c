//! Every telegram of the recordings of masters, against four slaves at step level.

use crate::recordings::{Known, recordings};
use crate::support::{Boundary, Slave};
use sercos::telegram::{Mst, RecordPacket, record_of};
use sercos::{Idn, Phase};

fn bytes(hex: &str) -> Vec<u8> {
    hex.split_ascii_whitespace().map(|byte| u8::from_str_radix(byte, 16).unwrap()).collect()
}

struct Station {
    slave: Slave,
    /// AHS.
    handshake: bool,
    steps: usize,
}

impl Station {
    fn record(&mut self, cycle: &str, record: &RecordPacket<&[u8]>) {
        let control = record.control();
        let is_step = control.handshake() != self.handshake;
        self.handshake = control.handshake();
        if is_step && self.slave.drive.machine.current() >= Phase::Cp2 {
            self.steps += 1;
            let element = control.element().value();
            if let Err(error) = self.slave.step(element, control.write(), control.end(), record.info()) {
                panic!("cycle {cycle}, element {element}, INFO {:04X}: {error}", record.info());
            }
        }
    }
}

#[test]
fn four_slaves_follow_the_recorded_masters_into_cp4_without_an_error() {
    for known in recordings() {
        four_slaves_follow(&known, &std::fs::read_to_string(&known.path).unwrap());
    }
}

fn four_slaves_follow(known: &Known, recording: &str) {
    for boundary in [Boundary::WithLast, Boundary::AfterLast] {
        let mut stations: Vec<Station> =
            (0..4).map(|_| Station { slave: Slave::new(boundary, 16), handshake: false, steps: 0 }).collect();
        for line in recording.lines().filter(|line| !line.starts_with('#')) {
            let columns: Vec<&str> = line.split('\t').collect();
            let [cycle, kind, telegram, ..] = columns[..] else { panic!("{line}") };
            let telegram = bytes(telegram);
            if kind == "MST" {
                for station in &mut stations {
                    station.slave.mst(Mst::parse(&telegram).unwrap().data).unwrap();
                }
            } else if telegram[0] == 255 {
                for station in &mut stations {
                    let position = station.slave.parameters.get_word(Idn::standard(9));
                    station.record(cycle, &record_of(&telegram[1..], position, 8).unwrap());
                }
            } else {
                let station = &mut stations[usize::from(telegram[0]) - 1];
                station.record(cycle, &RecordPacket::new_checked(&telegram[1..]).unwrap());
            }
        }
        for (number, station) in stations.iter().enumerate() {
            let parameters = &station.slave.parameters;
            assert_eq!(station.slave.drive.machine.current(), Phase::Cp4);
            assert!(station.steps > 100, "drive {} saw {} steps", number + 1, station.steps);
            assert_eq!(parameters.get(Idn::standard(6)), u32::from(known.t1[number]));
            assert_eq!(parameters.get(Idn::standard(9)), [1, 9, 17, 25][number]);
            assert_eq!(parameters.list(Idn::AT_LIST), [Idn::standard(11), Idn::standard(51), Idn::product(19)]);
            assert_eq!(parameters.list(Idn::MDT_LIST), [Idn::standard(36)]);
            assert!(!station.slave.server.command_change());
        }
    }
}
