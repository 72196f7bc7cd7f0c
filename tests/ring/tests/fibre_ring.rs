//! The ring itself: delays, repeaters, collisions, faults.

use std::cell::RefCell;
use std::rc::Rc;

use ring::fibre::{Effect, Fault, Hop, TelegramKind};
use ring::ring::{Collision, Sender};
use ring::wire::{BitRate, LineError, LineSignal, Transmission};
use ring::{Master, Nanoseconds, Ring, RingConfiguration, Station};

/// What reached somebody: start, end, bytes.
type Received = Vec<(u64, u64, Result<Vec<u8>, LineError>)>;

/// Sends what it is told when it is told, and keeps what it hears.
#[derive(Default)]
struct Talker {
    sends: Vec<(Nanoseconds, Vec<u8>)>,
    received: Received,
    flags: Vec<u64>,
    signal: Vec<(u64, bool)>,
    deaf_repeater: bool,
}

impl Talker {
    fn sending(sends: &[(u64, &[u8])]) -> Self {
        let sends = sends.iter().map(|(time, bytes)| (Nanoseconds(*time), bytes.to_vec())).collect();
        Self { sends, ..Self::default() }
    }

    fn due(&mut self, now: Nanoseconds) -> Option<Transmission> {
        let due = self.sends.first().is_some_and(|(time, _)| *time <= now);
        due.then(|| Transmission { bytes: self.sends.remove(0).1 })
    }
}

impl Master for Talker {
    fn next_transmission(&self) -> Option<Nanoseconds> {
        self.sends.first().map(|(time, _)| *time)
    }
    fn transmit(&mut self, now: Nanoseconds) -> Option<Transmission> {
        self.due(now)
    }
    fn receive(&mut self, start: Nanoseconds, end: Nanoseconds, frame: Result<&[u8], LineError>) {
        self.received.push((start.0, end.0, frame.map(<[u8]>::to_vec)));
    }
    fn on_signal(&mut self, now: Nanoseconds, present: bool) {
        self.signal.push((now.0, present));
    }
}

impl Station for Talker {
    fn next_event(&self) -> Option<Nanoseconds> {
        self.sends.first().map(|(time, _)| *time)
    }
    fn on_time(&mut self, now: Nanoseconds) -> Option<Transmission> {
        self.due(now)
    }
    fn on_telegram_start(&mut self, now: Nanoseconds) {
        self.flags.push(now.0);
    }
    fn on_telegram(&mut self, start: Nanoseconds, end: Nanoseconds, frame: Result<&[u8], LineError>) {
        self.received.push((start.0, end.0, frame.map(<[u8]>::to_vec)));
    }
    fn on_signal(&mut self, now: Nanoseconds, present: bool) {
        self.signal.push((now.0, present));
    }
    fn repeats(&self) -> bool {
        !self.deaf_repeater
    }
}

const MST: &[u8] = &[255, 0];
const AT: &[u8] = &[1, 0, 0, 0, 0];
const MDT: &[u8] = &[255, 1, 0, 2, 0, 3, 0, 4, 0];

/// Hops of 100, 200, 300 ns of fibre, repeaters of 500 ns.
fn three_hops(faults: Vec<Fault>) -> RingConfiguration {
    let hop = |fibre, repeater| Hop { fibre: Nanoseconds(fibre), repeater: Nanoseconds(repeater) };
    let hops = vec![hop(100, 0), hop(200, 500), hop(300, 500)];
    RingConfiguration { hops, faults, trace: true, ..RingConfiguration::new(2, BitRate::M2) }
}

fn run(configuration: RingConfiguration, master: Talker, stations: Vec<Talker>) -> Ring<Talker, Talker> {
    let mut ring = Ring::new(configuration, master, stations);
    ring.advance(Nanoseconds::from_millis(10));
    ring
}

fn bits(bytes: &[u8]) -> u64 {
    LineSignal::of_telegram(bytes).len() as u64 * 500
}

#[test]
fn every_hop_delays_and_every_repeater_too() {
    let ring = run(three_hops(vec![]), Talker::sending(&[(1_000, MST)]), vec![Talker::default(), Talker::default()]);
    let length = bits(MST);
    let at = |time: u64| vec![(time, time + length, Ok(MST.to_vec()))];
    assert_eq!(ring.stations()[0].received, at(1_100));
    assert_eq!(ring.stations()[1].received, at(1_800));
    assert_eq!(ring.master().received, at(2_600));
    assert_eq!(ring.stations()[1].flags, [1_800 + 8 * 500]);
    assert_eq!(ring.trace()[0].sender, Sender::Master);
    assert_eq!(ring.now(), Nanoseconds::from_millis(10));
}

#[test]
fn an_at_is_heard_only_behind_its_sender_and_passes_no_repeater_of_its_own() {
    let stations = vec![Talker::sending(&[(50_000, AT)]), Talker::default()];
    let ring = run(three_hops(vec![]), Talker::default(), stations);
    assert!(ring.stations()[0].received.is_empty());
    assert_eq!(ring.stations()[1].received[0].0, 50_200);
    assert_eq!(ring.master().received[0].0, 50_200 + 500 + 300);
}

#[test]
fn a_drive_that_sends_cuts_what_passes_and_the_ring_says_so() {
    // The first drive begins 20 us into the MDT: 40 bits get through to those behind it.
    let stations = vec![Talker::sending(&[(21_100, AT)]), Talker::default()];
    let ring = run(three_hops(vec![]), Talker::sending(&[(1_000, MDT)]), stations);
    assert_eq!(ring.stations()[0].received[0].2, Ok(MDT.to_vec()), "its own receiver is not disturbed");
    let heard: Vec<_> = ring.stations()[1].received.iter().map(|(_, _, frame)| frame.clone()).collect();
    assert_eq!(heard, [Err(LineError::Collision { bits: 40 }), Ok(AT.to_vec())]);
    assert_eq!(ring.master().received.len(), 2);
    let expected = Collision { time: Nanoseconds(21_100), cycle: 0, station: 0, cut: TelegramKind::Mdt };
    assert_eq!(ring.statistics().collisions, [expected]);
    assert_eq!(ring.statistics().line_errors, [0, 1, 1]);
}

#[test]
fn what_arrives_while_a_drive_sends_is_lost_behind_it() {
    let inside = run(
        three_hops(vec![]),
        Talker::sending(&[(5_000, MST)]),
        vec![Talker::sending(&[(1_000, MDT)]), Talker::default()],
    );
    assert_eq!(inside.stations()[1].received.len(), 1, "the MST lies wholly inside the drive's telegram");
    assert_eq!(inside.statistics().collisions.len(), 1);
    let overlapping = run(
        three_hops(vec![]),
        Talker::sending(&[(30_000, MDT)]),
        vec![Talker::sending(&[(1_000, AT)]), Talker::default()],
    );
    let heard: Vec<_> = overlapping.stations()[1].received.iter().map(|(_, _, frame)| frame.is_ok()).collect();
    assert_eq!(heard, [true, false], "the end of the MDT gets through and is no telegram");
    assert_eq!(overlapping.stations()[1].flags.len(), 1);
}

#[test]
fn a_station_whose_repeater_is_off_ends_the_ring() {
    let stations = vec![Talker { deaf_repeater: true, ..Talker::default() }, Talker::default()];
    let ring = run(three_hops(vec![]), Talker::sending(&[(1_000, MST)]), stations);
    assert_eq!(ring.stations()[0].received.len(), 1);
    assert!(ring.stations()[1].received.is_empty() && ring.master().received.is_empty());
}

#[test]
fn faults_hit_their_telegram_in_their_cycle_on_their_hop() {
    let cycle = |n: u64| (1_000 + n * 1_000_000, MST);
    let sends: Vec<_> = (0..6).map(cycle).collect();
    let fault = |cycle, effect| Fault::once(cycle, 1, TelegramKind::Mst, effect);
    let faults = vec![
        fault(0, Effect::Drop),
        fault(1, Effect::FlipBit(20)),
        fault(2, Effect::Delay(Nanoseconds(7_000))),
        fault(3, Effect::Duplicate(Nanoseconds(1_000))),
        fault(4, Effect::Phase(6)),
        Fault::once(5, 1, TelegramKind::Mdt, Effect::Drop),
    ];
    let ring = run(three_hops(faults), Talker::sending(&sends), vec![Talker::default(), Talker::default()]);
    assert_eq!(ring.stations()[0].received.len(), 6, "nothing happens before hop 1");
    let heard = &ring.stations()[1].received;
    let cycle_of = |start: u64| start / 1_000_000;
    assert_eq!(heard.iter().map(|(start, ..)| cycle_of(*start)).collect::<Vec<_>>(), [1, 2, 3, 3, 4, 5]);
    assert!(matches!(heard[0].2, Err(LineError::CheckSequence { .. })));
    assert_eq!(heard[1].0, 2_000_000 + 1_800 + 7_000);
    assert_eq!(heard[3].0, heard[2].1 + 1_000);
    assert_eq!(heard[4].2, Ok(vec![255, 6]));
    assert_eq!(heard[5].2, Ok(MST.to_vec()));
    assert_eq!(ring.statistics().faults, 5);
    assert_eq!(ring.master().received.len(), 6, "faults are passed on");
}

#[test]
fn a_broken_fibre_is_dark_behind_the_break_until_it_is_mended() {
    let sends: Vec<_> = (0..5).map(|n| (1_000 + n * 1_000_000, MST)).collect();
    let ring = run(
        three_hops(vec![Fault::ring_break(1..3, 1)]),
        Talker::sending(&sends),
        vec![Talker::default(), Talker::default()],
    );
    assert_eq!(ring.stations()[0].received.len(), 5);
    assert_eq!(ring.stations()[1].received.len(), 3);
    assert_eq!(ring.stations()[0].signal, [(0, true)]);
    let light = [(0, true), (1_001_000, false), (3_001_000, true)];
    assert_eq!(ring.stations()[1].signal, light);
    assert_eq!(ring.master().signal, light);
}

#[test]
fn nothing_reaches_a_station_before_the_look_ahead_says_so() {
    let log = Rc::new(RefCell::new(Vec::new()));
    let sends: Vec<_> = (0..20).map(|n| (1_000 + n * 333_333, if n % 2 == 0 { MST } else { MDT })).collect();
    let first = Talker::sending(&[(10_000, AT), (1_100_500, AT), (2_000_100, AT)]);
    let mut ring = Ring::new(three_hops(vec![]), Talker::sending(&sends), vec![first, Talker::default()]);
    ring.advance(Nanoseconds::ZERO);
    while let Some(next) = ring.next_event() {
        for station in 0..2 {
            let heard = |ring: &Ring<Talker, Talker>| {
                ring.stations()[station].received.len() + ring.stations()[station].flags.len()
            };
            let before = heard(&ring);
            let ahead = ring.next_event_at(station);
            assert!(ahead.is_none_or(|ahead| ahead >= next));
            log.borrow_mut().push((station, before, ahead));
        }
        ring.advance(next);
        for (station, before, ahead) in log.borrow_mut().drain(..) {
            let heard = ring.stations()[station].received.len() + ring.stations()[station].flags.len();
            assert!(
                heard == before || ahead == Some(next),
                "station {station} was reached at {next}, announced for {ahead:?}"
            );
        }
    }
}

#[test]
#[should_panic(expected = "without end")]
fn a_station_that_never_does_what_it_asked_for_is_found_out() {
    struct Stuck;
    impl Station for Stuck {
        fn next_event(&self) -> Option<Nanoseconds> {
            Some(Nanoseconds(5))
        }
        fn on_time(&mut self, _: Nanoseconds) -> Option<Transmission> {
            None
        }
        fn on_telegram_start(&mut self, _: Nanoseconds) {}
        fn on_telegram(&mut self, _: Nanoseconds, _: Nanoseconds, _: Result<&[u8], LineError>) {}
        fn on_signal(&mut self, _: Nanoseconds, _: bool) {}
    }
    let mut ring = Ring::new(RingConfiguration::new(1, BitRate::M2), Talker::default(), vec![Stuck]);
    ring.advance(Nanoseconds(10));
}
