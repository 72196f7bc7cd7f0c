//! An axis that does what a test says, for the tests of one law.

use plant::{MachineSettings, ReferenceAxis};
use ring::ident::{Element, Idn};
use ring::service_client::{Step, control};
use ring::{Nanoseconds, Tap};

use crate::law::Law;
use crate::observer::Observer;
use crate::sight::Sight;

const ADDRESS: u8 = 1;
const CYCLE: Nanoseconds = Nanoseconds::from_millis(2);
const LOOK: Nanoseconds = Nanoseconds(62_500);

/// A ring of one drive in CP4, telegram type as it is set, 2 ms.
pub(crate) struct Fake {
    observer: Observer,
    time: Nanoseconds,
    /// What is seen, until it is changed.
    pub(crate) sight: Sight,
    /// Configured data of the MDT and the AT.
    pub(crate) data: [Vec<u8>; 2],
    handshake: u16,
}

impl Fake {
    /// The press axis.
    pub(crate) fn in_cp4(law: impl Law + 'static) -> Self {
        Self::of(law, ReferenceAxis::press().machine)
    }

    pub(crate) fn of(law: impl Law + 'static, machine: MachineSettings) -> Self {
        let mut sight = Sight { main_power: true, bridge_ready: true, safe_torque: true, ..Sight::default() };
        sight.machine.bus_voltage = machine.supply.voltage;
        let observer = Observer::with(ADDRESS, machine, vec![Box::new(law)]);
        let mut fake = Self { observer, time: CYCLE, sight, data: [vec![0; 4], vec![0; 4]], handshake: 0 };
        for phase in 0..=4 {
            fake.enter(phase);
        }
        fake
    }

    /// The first MST of a phase, and in CP1 the record with which CP2 begins.
    pub(crate) fn enter(&mut self, phase: u8) {
        self.phase(phase);
        if phase == 1 {
            self.handshake = 0;
            self.observer.arrived(self.time, self.time, Ok(&[ADDRESS, 0, 0, 0, 0]));
        }
    }

    /// An MST.
    pub(crate) fn phase(&mut self, phase: u8) {
        self.time += CYCLE;
        self.observer.arrived(self.time, self.time, Ok(&[255, phase]));
    }

    /// A cycle of CP4: MST, AT, MDT, and a look every 62.5 us.
    pub(crate) fn cycle(&mut self, control: u16, status: u16) {
        self.turning(control, status, 0.0, |_| {});
    }

    /// So many of them.
    pub(crate) fn run(&mut self, cycles: usize, control: u16, status: u16) {
        for _ in 0..cycles {
            self.cycle(control, status);
        }
    }

    /// A cycle in which the shaft turns with so many rad/s², and `change` is called before each look.
    pub(crate) fn turning(&mut self, control: u16, status: u16, acceleration: f64, change: impl FnMut(&mut Sight)) {
        self.phase(4);
        self.answer(status | self.handshake, 0);
        self.record(control | self.handshake, 0);
        self.look(acceleration, change);
    }

    /// So many cycles without a telegram.
    pub(crate) fn silence(&mut self, cycles: usize, acceleration: f64, mut change: impl FnMut(&mut Sight)) {
        for _ in 0..cycles {
            self.time += CYCLE;
            self.look(acceleration, &mut change);
        }
    }

    fn look(&mut self, acceleration: f64, mut change: impl FnMut(&mut Sight)) {
        let dt = LOOK.as_seconds();
        for look in 0..CYCLE.0 / LOOK.0 {
            change(&mut self.sight);
            self.sight.time = self.time + Nanoseconds(look * LOOK.0);
            self.sight.machine.time = self.sight.time.0;
            self.observer.look(self.sight);
            let machine = &mut self.sight.machine;
            machine.angle += machine.velocity * dt / core::f64::consts::TAU;
            machine.velocity += acceleration * dt;
        }
    }

    fn answer(&mut self, status: u16, info: u16) {
        let words = [status, info].map(u16::to_le_bytes).concat();
        self.observer.sent(self.time, &[&[ADDRESS][..], &words, &self.data[1]].concat());
    }

    fn record(&mut self, control: u16, info: u16) {
        let words = [control, info].map(u16::to_le_bytes).concat();
        let address = if self.observer.scene().wire.phase < 3 { ADDRESS } else { 255 };
        self.observer.arrived(self.time, self.time, Ok(&[&[address][..], &words, &self.data[0]].concat()));
    }

    fn step(&mut self, step: Step, reply: u16, control: u16, status: u16) {
        self.handshake ^= control::HANDSHAKE;
        self.record(control | step.control() | self.handshake, step.info);
        self.answer(status | self.handshake, reply);
    }

    /// The master writes these words and the drive takes them, within no time.
    pub(crate) fn write(&mut self, number: u16, words: &[u16]) {
        self.talk(number, words, true);
    }

    /// The master opens a data block, and this data status comes back.
    pub(crate) fn open(&mut self, number: u16, data_status: u16) {
        let wire = &self.observer.scene().wire;
        let (control, status) = (wire.control & !0x3F, wire.status & !0x37);
        self.step(Step::open(Idn(number)), data_status, control, status);
    }

    /// A homed axis with S-0-0049 at `high` and S-0-0050 at its opposite, and 100 A to brake with.
    pub(crate) fn settle_limits(&mut self, high: i32) {
        self.write(92, &[40_000]);
        for idn in [109, 110] {
            self.write(idn, &[0x86A0, 1]);
        }
        self.write(55, &[0x10]);
        for (idn, limit) in [(49, high), (50, -high)] {
            self.write(idn, &[limit as u16, (limit >> 16) as u16]);
        }
        self.read(403, &[1]);
    }

    /// Where the shaft was at the beginning of the cycle that ends now, in revolutions.
    pub(crate) fn angle_before(&self) -> f64 {
        self.observer.scene().angle_at(self.time).unwrap_or(0.0)
    }

    /// The master reads, and these words come back.
    pub(crate) fn read(&mut self, number: u16, words: &[u16]) {
        self.talk(number, words, false);
    }

    fn talk(&mut self, number: u16, words: &[u16], write: bool) {
        let wire = &self.observer.scene().wire;
        let (control, status) = (wire.control & !0x3F, wire.status & !0x3F | wire.status & 8);
        self.step(Step::open(Idn(number)), 0, control, status);
        for (index, word) in words.iter().enumerate() {
            let end = index + 1 == words.len();
            let step = Step { element: Element::Data, write, end, info: if write { *word } else { 0 } };
            self.step(step, if write { 0 } else { *word }, control, status);
        }
    }

    /// The master writes this word, and the drive does not say whether it has taken it.
    pub(crate) fn write_unanswered(&mut self, number: u16, word: u16) {
        let wire = &self.observer.scene().wire;
        let (control, status) = (wire.control & !0x3F, wire.status & !0x3F | wire.status & 8);
        self.step(Step::open(Idn(number)), 0, control, status);
        self.handshake ^= control::HANDSHAKE;
        let step = Step { element: Element::Data, write: true, end: true, info: word };
        self.record(control | step.control() | self.handshake, word);
    }

    /// What was broken, if anything.
    pub(crate) fn broken(&self) -> Option<String> {
        self.observer.broken().map(ToString::to_string)
    }

    /// How often the law has looked.
    pub(crate) fn armed(&self) -> u64 {
        self.observer.coverage().map(|coverage| coverage.armed).sum()
    }
}
