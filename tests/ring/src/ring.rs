//! The ring: a master, drives with repeaters, and the telegrams that travel between them.
//!
//! Events, not bits, are simulated: a telegram is one burst of real line levels that reaches every station after the
//! delays of the hops before it. A drive that sends takes its repeater out of the ring; a telegram that passes at that
//! moment is cut behind it, and the ring reports the collision. Within one instant the fibre goes first, then the
//! stations in their order, then the master, so that a run always gives the same result.

use std::cmp::Reverse;
use std::collections::{BTreeMap, BinaryHeap};
use std::rc::Rc;

use crate::fibre::{Cause, Effect, Fault, RingConfiguration, TelegramKind, crossing};
use crate::station::{Master, SharedTap, Station};
use crate::time::{Nanoseconds, SharedClock};
use crate::wire::{FLAG, LineError, LineSignal, Transmission};

/// More calls than this within one instant mean that a station does not do what it asked to be called for.
const MOST_ROUNDS_IN_AN_INSTANT: u32 = 10_000;

/// A running ring. `M` is the master, `S` the drives' side of every station, usually a shared chip.
pub struct Ring<M, S> {
    configuration: RingConfiguration,
    master: M,
    stations: Vec<S>,
    /// Until when each station sends, and its repeater is out of the ring.
    sending_until: Vec<Nanoseconds>,
    passages: BTreeMap<u64, Passage>,
    events: BinaryHeap<Reverse<(Nanoseconds, u64, Event)>>,
    /// Numbers events and passages, so that events of one instant keep their order.
    numbers: u64,
    broken: Vec<bool>,
    /// Which stations see light; the last is the master.
    lit: Vec<bool>,
    cycle: Option<u64>,
    statistics: Statistics,
    trace: Vec<TraceEntry>,
    taps: Vec<(usize, SharedTap)>,
}

/// Who sent a telegram.
#[derive(Copy, Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Sender {
    /// The master.
    Master,
    /// The drive behind hop `n`, counted from 0.
    Station(usize),
}

/// One telegram as it was sent.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TraceEntry {
    /// Start of the opening flag at the sender.
    pub time: Nanoseconds,
    /// Number of MSTs sent before this telegram, itself not counted.
    pub cycle: u64,
    /// Who sent it.
    pub sender: Sender,
    /// Address and data.
    pub bytes: Vec<u8>,
}

/// One telegram cut by a drive that began to send while it passed.
#[derive(Copy, Clone, Debug, PartialEq, Eq)]
pub struct Collision {
    /// When.
    pub time: Nanoseconds,
    /// In which cycle.
    pub cycle: u64,
    /// The drive that sent.
    pub station: usize,
    /// The telegram that was cut.
    pub cut: TelegramKind,
}

/// What the ring has counted since its start.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Statistics {
    /// Telegrams sent, by kind.
    pub sent: BTreeMap<TelegramKind, u64>,
    /// Bursts that reached a station and were no valid telegram, by station; the last entry is the master.
    pub line_errors: Vec<u64>,
    /// How often a fault of the configuration took effect.
    pub faults: u64,
    /// All collisions.
    pub collisions: Vec<Collision>,
}

/// A telegram on its way into one station. Its `end` moves when it is cut.
struct Passage {
    signal: Rc<LineSignal>,
    kind: TelegramKind,
    node: usize,
    start: Nanoseconds,
    end: Nanoseconds,
    damage: Damage,
    forwarded: Vec<u64>,
}

/// What another sender's transmission has left of a telegram.
#[derive(Copy, Clone, Debug, PartialEq, Eq)]
enum Damage {
    None,
    /// So many bits from the beginning.
    Head(usize),
    /// So many bits before the end.
    Tail(usize),
}

impl Damage {
    fn bits(self, whole: usize) -> usize {
        match self {
            Self::None => whole,
            Self::Head(bits) | Self::Tail(bits) => bits,
        }
    }

    fn cut(self, after: usize) -> Self {
        match self {
            Self::None => Self::Head(after),
            Self::Head(bits) => Self::Head(bits.min(after)),
            Self::Tail(bits) => Self::Tail(bits.min(after)),
        }
    }

    fn shows_flag(self) -> bool {
        match self {
            Self::None => true,
            Self::Head(bits) => bits >= FLAG.len(),
            Self::Tail(_) => false,
        }
    }
}

#[derive(Copy, Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Event {
    Begin(u64),
    FlagSeen(u64),
    End(u64),
    Signal { node: usize, present: bool },
}

impl<M: Master, S: Station> Ring<M, S> {
    /// A ring at time zero, light everywhere, nothing sent yet.
    ///
    /// # Panics
    ///
    /// When there are not as many hops as drives plus one.
    pub fn new(configuration: RingConfiguration, master: M, stations: Vec<S>) -> Self {
        let nodes = stations.len() + 1;
        assert_eq!(configuration.hops.len(), nodes, "a ring of {} drives has {nodes} hops", stations.len());
        configuration.clock.set(Nanoseconds::ZERO);
        let mut ring = Self {
            master,
            sending_until: vec![Nanoseconds::ZERO; stations.len()],
            stations,
            passages: BTreeMap::new(),
            events: BinaryHeap::new(),
            numbers: 0,
            broken: vec![false; nodes],
            lit: vec![true; nodes],
            cycle: None,
            statistics: Statistics { line_errors: vec![0; nodes], ..Statistics::default() },
            trace: Vec::new(),
            taps: Vec::new(),
            configuration,
        };
        for node in 0..nodes {
            ring.schedule(Nanoseconds::ZERO, Event::Signal { node, present: true });
        }
        ring
    }

    /// Simulated time.
    pub fn now(&self) -> Nanoseconds {
        self.configuration.clock.get()
    }

    /// The clock that the ring sets; chips and processors read it.
    pub fn clock(&self) -> SharedClock {
        self.configuration.clock.clone()
    }

    /// The master.
    pub fn master(&self) -> &M {
        &self.master
    }

    /// The master, to be given new work.
    pub fn master_mut(&mut self) -> &mut M {
        &mut self.master
    }

    /// The drives, in the order of the ring.
    pub fn stations(&self) -> &[S] {
        &self.stations
    }

    /// The drives, in the order of the ring.
    pub fn stations_mut(&mut self) -> &mut [S] {
        &mut self.stations
    }

    /// What has been counted so far.
    pub fn statistics(&self) -> &Statistics {
        &self.statistics
    }

    /// Every telegram sent so far, if the configuration asks for a trace.
    pub fn trace(&self) -> &[TraceEntry] {
        &self.trace
    }

    /// The cycle that the last MST began, counted from 0; `None` before the first MST.
    pub fn cycle(&self) -> Option<u64> {
        self.cycle
    }

    /// Lets `tap` hear everything that the fibre brings to this station, and what the station sends.
    pub fn tap(&mut self, station: usize, tap: SharedTap) {
        self.taps.push((station, tap));
    }

    /// One more thing that will go wrong. A fault of a cycle that has begun may come too late.
    pub fn add_fault(&mut self, fault: Fault) {
        self.configuration.faults.push(fault);
    }

    /// The next instant at which anything happens, never before [`Ring::now`].
    pub fn next_event(&self) -> Option<Nanoseconds> {
        let on_fibre = self.events.peek().map(|Reverse((time, ..))| *time);
        let stations = self.stations.iter().filter_map(Station::next_event).min();
        let master = self.master.next_transmission();
        on_fibre.into_iter().chain(stations).chain(master).min().map(|time| time.max(self.now()))
    }

    /// The earliest instant at which something can reach the chip of this station: its own timers, a telegram on
    /// the way to it, or one that is yet to be sent before it in the ring. A processor that is simulated beside
    /// the ring can run up to it without missing anything. What the processor itself writes may bring it nearer.
    pub fn next_event_at(&self, station: usize) -> Option<Nanoseconds> {
        let in_flight = self.events.iter().filter_map(|Reverse((time, _, event))| {
            let (node, begins) = match event {
                Event::Begin(passage) => (self.passages.get(passage)?.node, true),
                Event::FlagSeen(passage) | Event::End(passage) => (self.passages.get(passage)?.node, false),
                Event::Signal { node, .. } => (*node, false),
            };
            match node.cmp(&station) {
                std::cmp::Ordering::Equal => Some(*time),
                std::cmp::Ordering::Less if begins => Some(*time + self.delay_between(node, station)),
                _ => None,
            }
        });
        let before = (0..station).filter_map(|node| {
            Some(self.stations[node].next_event()?.max(self.now()) + self.delay_between(node, station))
        });
        let own = self.stations[station].next_event();
        let master = self
            .master
            .next_transmission()
            .map(|time| time.max(self.now()) + self.delay_of_hop(0) + self.delay_between(0, station));
        in_flight.chain(before).chain(own).chain(master).min().map(|time| time.max(self.now()))
    }

    /// Lets everything happen up to and including `until`, which is then the time.
    ///
    /// # Panics
    ///
    /// When a station or the master asks for the same instant without end.
    pub fn advance(&mut self, until: Nanoseconds) {
        let mut instant = self.now();
        let mut rounds = 0;
        while let Some(time) = self.next_event().filter(|time| *time <= until) {
            rounds = if time == instant { rounds + 1 } else { 0 };
            assert!(rounds < MOST_ROUNDS_IN_AN_INSTANT, "a station or the master asks for {time} without end");
            instant = time;
            self.configuration.clock.set(time);
            self.step(time);
        }
        self.configuration.clock.set(until.max(self.now()));
    }

    fn step(&mut self, now: Nanoseconds) {
        while let Some(Reverse((time, _, event))) = self.events.peek().copied() {
            if time > now {
                break;
            }
            self.events.pop();
            self.happen(now, event);
        }
        for station in 0..self.stations.len() {
            if self.stations[station].next_event().is_some_and(|time| time <= now)
                && let Some(transmission) = self.stations[station].on_time(now)
            {
                self.send_from_station(now, station, transmission);
            }
        }
        if self.master.next_transmission().is_some_and(|time| time <= now)
            && let Some(transmission) = self.master.transmit(now)
        {
            self.send_from_master(now, transmission);
        }
    }

    fn happen(&mut self, now: Nanoseconds, event: Event) {
        match event {
            Event::Begin(number) => self.repeat(number),
            Event::FlagSeen(number) => {
                let Some(passage) = self.passages.get(&number) else {
                    return;
                };
                if passage.damage.shows_flag()
                    && let Some(station) = self.stations.get_mut(passage.node)
                {
                    station.on_telegram_start(now);
                }
            }
            Event::End(number) => {
                if self.passages.get(&number).is_some_and(|passage| passage.end == now)
                    && let Some(passage) = self.passages.remove(&number)
                {
                    self.deliver(&passage);
                }
            }
            Event::Signal { node, present } => match self.stations.get_mut(node) {
                Some(station) => station.on_signal(now, present),
                None => self.master.on_signal(now, present),
            },
        }
    }

    fn deliver(&mut self, passage: &Passage) {
        let frame = match passage.damage {
            Damage::None => passage.signal.telegram(),
            Damage::Head(bits) | Damage::Tail(bits) => Err(LineError::Collision { bits }),
        };
        if frame.is_err() {
            self.statistics.line_errors[passage.node] += 1;
        }
        for (_, tap) in self.taps.iter().filter(|(station, _)| *station == passage.node) {
            tap.borrow_mut().arrived(passage.start, passage.end, frame);
        }
        match self.stations.get_mut(passage.node) {
            Some(station) => station.on_telegram(passage.start, passage.end, frame),
            None => self.master.receive(passage.start, passage.end, frame),
        }
    }

    /// A telegram begins to enter a station: its repeater passes it on, unless the station sends.
    fn repeat(&mut self, number: u64) {
        let Some(passage) = self.passages.get(&number) else {
            return;
        };
        let node = passage.node;
        if node == self.stations.len() || !self.stations[node].repeats() {
            return;
        }
        let (signal, kind, end) = (Rc::clone(&passage.signal), passage.kind, passage.end);
        let (mut start, mut damage) = (passage.start, passage.damage);
        let free = self.sending_until[node];
        if free > start {
            self.report_collision(start, node, kind);
            if free >= end {
                return;
            }
            // Only the end of it gets through, which is no telegram.
            damage = Damage::Tail(self.configuration.bit_rate.bits_in(end - free));
            start = free;
        }
        let delay = self.configuration.hops[node + 1].repeater;
        let forwarded = self.cross(node + 1, &signal, kind, start + delay, damage);
        if let Some(passage) = self.passages.get_mut(&number) {
            passage.forwarded = forwarded;
        }
    }

    fn send_from_master(&mut self, now: Nanoseconds, transmission: Transmission) {
        let kind = TelegramKind::of_master(&transmission.bytes);
        if kind == TelegramKind::Mst {
            let cycle = self.cycle.map_or(0, |cycle| cycle + 1);
            self.cycle = Some(cycle);
            self.break_and_mend(now, cycle);
        }
        self.send(now, Sender::Master, kind, transmission);
    }

    fn send_from_station(&mut self, now: Nanoseconds, station: usize, transmission: Transmission) {
        let kind = TelegramKind::At(transmission.bytes.first().copied().unwrap_or(0));
        for (_, tap) in self.taps.iter().filter(|(tapped, _)| *tapped == station) {
            tap.borrow_mut().sent(now, &transmission.bytes);
        }
        let passing: Vec<(u64, TelegramKind, usize)> = self
            .passages
            .iter()
            .filter(|(_, passage)| passage.node == station && passage.start <= now && now < passage.end)
            .map(|(number, passage)| (*number, passage.kind, self.configuration.bit_rate.bits_in(now - passage.start)))
            .collect();
        for (number, cut, bits) in passing {
            let forwarded = self
                .passages
                .get_mut(&number)
                .map(|passage| std::mem::take(&mut passage.forwarded))
                .unwrap_or_default();
            if !forwarded.is_empty() {
                self.report_collision(now, station, cut);
                forwarded.into_iter().for_each(|number| self.cut(number, bits));
            }
        }
        self.sending_until[station] = self.send(now, Sender::Station(station), kind, transmission);
    }

    /// Sends over the hop behind the sender; returns when the telegram ends.
    fn send(
        &mut self,
        now: Nanoseconds,
        sender: Sender,
        kind: TelegramKind,
        transmission: Transmission,
    ) -> Nanoseconds {
        *self.statistics.sent.entry(kind).or_default() += 1;
        let hop = match sender {
            Sender::Master => 0,
            Sender::Station(station) => station + 1,
        };
        let signal = Rc::new(LineSignal::of_telegram(&transmission.bytes));
        let end = now + self.configuration.bit_rate.span(signal.len());
        self.cross(hop, &signal, kind, now, Damage::None);
        if self.configuration.trace {
            let cycle = self.cycle.unwrap_or(0);
            self.trace.push(TraceEntry { time: now, cycle, sender, bytes: transmission.bytes });
        }
        end
    }

    /// The telegram on its way over one hop, with whatever befalls it there; `start` is at the hop's beginning.
    fn cross(
        &mut self,
        hop: usize,
        signal: &Rc<LineSignal>,
        kind: TelegramKind,
        start: Nanoseconds,
        damage: Damage,
    ) -> Vec<u64> {
        if self.broken[hop] {
            return Vec::new();
        }
        let effects = self.effects_on(hop, kind);
        self.statistics.faults += effects.len() as u64;
        let rate = self.configuration.bit_rate;
        let start = start + self.configuration.hops[hop].fibre;
        let arriving = crossing(signal, rate.span(signal.len()), &effects);
        arriving
            .into_iter()
            .map(|(changed, late)| {
                let signal = changed.map_or_else(|| Rc::clone(signal), Rc::new);
                let start = start + late;
                let end = start + rate.span(damage.bits(signal.len()));
                let number = self.schedule(start, Event::Begin(self.numbers));
                self.schedule(start + rate.span(FLAG.len()), Event::FlagSeen(number));
                self.schedule(end, Event::End(number));
                self.passages
                    .insert(number, Passage { signal, kind, node: hop, start, end, damage, forwarded: Vec::new() });
                number
            })
            .collect()
    }

    /// Cuts a telegram behind a station, and so behind all that it has been passed on to.
    fn cut(&mut self, number: u64, bits: usize) {
        let Some(passage) = self.passages.get_mut(&number) else {
            return;
        };
        let now = self.configuration.clock.get();
        passage.damage = passage.damage.cut(bits);
        let left = passage.damage.bits(passage.signal.len());
        passage.end = (passage.start + self.configuration.bit_rate.span(left)).max(now);
        let (end, forwarded) = (passage.end, passage.forwarded.clone());
        self.schedule(end, Event::End(number));
        forwarded.into_iter().for_each(|number| self.cut(number, bits));
    }

    fn effects_on(&self, hop: usize, telegram: TelegramKind) -> Vec<Effect> {
        let cycle = self.cycle.unwrap_or(0);
        self.configuration
            .faults
            .iter()
            .filter(|fault| fault.hop == hop && fault.cycles.contains(&cycle))
            .filter_map(|fault| match fault.cause {
                Cause::Telegram(kind, effect) if kind == telegram => Some(effect),
                _ => None,
            })
            .collect()
    }

    /// A new cycle begins: fibres break and are mended between two cycles.
    fn break_and_mend(&mut self, now: Nanoseconds, cycle: u64) {
        let mut light = true;
        for hop in 0..self.broken.len() {
            let faults = self.configuration.faults.iter();
            let broken = faults
                .filter(|fault| fault.cause == Cause::Break)
                .any(|fault| fault.hop == hop && fault.cycles.contains(&cycle));
            self.statistics.faults += u64::from(broken && !self.broken[hop]);
            self.broken[hop] = broken;
            light &= !broken;
            if self.lit[hop] != light {
                self.lit[hop] = light;
                self.schedule(now, Event::Signal { node: hop, present: light });
            }
        }
    }

    fn report_collision(&mut self, time: Nanoseconds, station: usize, cut: TelegramKind) {
        let cycle = self.cycle.unwrap_or(0);
        self.statistics.collisions.push(Collision { time, cycle, station, cut });
    }

    fn delay_of_hop(&self, hop: usize) -> Nanoseconds {
        self.configuration.hops[hop].fibre
    }

    /// From the input of one station to that of a later one.
    fn delay_between(&self, node: usize, later: usize) -> Nanoseconds {
        self.configuration.hops[node + 1..=later].iter().fold(Nanoseconds::ZERO, |sum, hop| sum + hop.fibre)
    }

    fn schedule(&mut self, time: Nanoseconds, event: Event) -> u64 {
        let number = self.numbers;
        self.numbers += 1;
        self.events.push(Reverse((time, number, event)));
        number
    }
}
