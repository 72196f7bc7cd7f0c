//! One chip on a bench: telegrams come by hand, time runs by hand, what the chip sends is collected.

use ring::Nanoseconds;
use ring::chip::{Alternatives, Chip};
use ring::wire::{BitRate, LineError, encode};

/// End of the first MST of every test.
pub(crate) const FIRST_MST: u64 = 1_000_000;
/// TSCYC0 and TSCYC1 of every test, in microseconds.
pub(crate) const CYCLE: u64 = 2_000;

/// Where the layout of sercon816.md 6.5 puts things.
pub(crate) const AT_HEADER: u16 = 0x10;
pub(crate) const AT_STATUS: u16 = 0x15;
pub(crate) const MDT_HEADER: u16 = 0x18;
pub(crate) const MDT_CONTROL: u16 = 0x1F;
pub(crate) const SERVICE: u16 = 0x60;
pub(crate) const BUFFERS: u16 = SERVICE + 5;
pub(crate) const NMSTERR: u16 = 0x0A;

pub(crate) struct Rig {
    pub(crate) chip: Chip,
    pub(crate) now: Nanoseconds,
    pub(crate) sent: Vec<(u64, Vec<u8>)>,
}

impl Rig {
    /// A chip after power-up.
    pub(crate) fn new(alternatives: Alternatives) -> Self {
        Self { chip: Chip::new(alternatives, 816), now: Nanoseconds::ZERO, sent: Vec::new() }
    }

    /// A slave of address 1 with the CP1/CP2 block of sercon816.md 6.5, AT at 150 us, MDT from 500 to 720 us.
    pub(crate) fn slave(alternatives: Alternatives) -> Self {
        let mut rig = Self::new(alternatives);
        for (register, value) in [
            (0x01, 0x0628),
            (0x02, 0x0383),
            (0x06, 0),
            (0x07, 0),
            (0x08, 0),
            (0x09, 0),
            (0x0A, 0),
            (0x0D, 0xFF0A),
            (0x0E, 0x051F),
            (0x0F, CYCLE as u16),
            (0x10, CYCLE as u16),
            (0x13, 3),
            (0x15, 0xFFFC),
            (0x16, 10),
            (0x18, 0),
            (0x19, 220),
            (0x1A, 0xFFFF),
            (0x1B, 0xFFFF),
            (0x1C, 0xFFFF),
            (0x1D, 0xFFFF),
            (0x03, 0x0100),
        ] {
            rig.set_register(register, value);
        }
        rig.set_ram(0, &[AT_HEADER, AT_HEADER, SERVICE, SERVICE, SERVICE, SERVICE, SERVICE, SERVICE, SERVICE, SERVICE]);
        rig.set_ram(NMSTERR, &[0]);
        rig.set_ram(AT_HEADER, &[0x4001, 150, 2, MDT_HEADER, 0x8402, 0xA5A0, 0x1234]);
        rig.set_ram(MDT_HEADER, &[0x1801, 500, 2, 0x22, 0, 0x8402, 0, 0, 0]);
        rig.set_ram(0x22, &[0xC000, 1_900]);
        rig.set_ram(SERVICE, &[0, 0, 0, 0, 0]);
        rig
    }

    pub(crate) fn register(&mut self, word: u16) -> u16 {
        self.chip.read_register(self.now, word)
    }

    pub(crate) fn set_register(&mut self, word: u16, value: u16) {
        self.chip.write_register(self.now, word, value);
    }

    pub(crate) fn ram(&mut self, word: u16) -> u16 {
        self.chip.read_ram(self.now, word)
    }

    pub(crate) fn set_ram(&mut self, first: u16, values: &[u16]) {
        for (word, &value) in (first..).zip(values) {
            self.chip.write_ram(self.now, word, value);
        }
    }

    /// Reads a status register and clears what was set.
    pub(crate) fn take_status(&mut self, register: u16) -> u16 {
        let flags = self.register(register);
        self.set_register(register, flags);
        flags
    }

    /// Lets time run up to `until` nanoseconds.
    pub(crate) fn run_to(&mut self, until: u64) {
        let until = Nanoseconds(until);
        assert!(until >= self.now, "{until} is before {}", self.now);
        while let Some(time) = self.chip.next_event().filter(|&time| time <= until) {
            assert!(time >= self.now, "an event at {time}, it is {}", self.now);
            self.now = time;
            if let Some(transmission) = self.chip.on_time(time) {
                self.sent.push((time.0, transmission.bytes));
            }
        }
        self.now = until;
    }

    /// A telegram whose opening flag begins at `start` nanoseconds; returns its end.
    pub(crate) fn telegram(&mut self, start: u64, bytes: &[u8]) -> u64 {
        self.frame(start, bytes, Ok(()))
    }

    /// The same, damaged.
    pub(crate) fn damaged_telegram(&mut self, start: u64, bytes: &[u8]) -> u64 {
        self.frame(start, bytes, Err(LineError::CheckSequence { expected: 1, actual: 2 }))
    }

    fn frame(&mut self, start: u64, bytes: &[u8], result: Result<(), LineError>) -> u64 {
        let length = BitRate::M2.span(encode(bytes).len()).0;
        self.run_to(start + BitRate::M2.span(8).0);
        self.chip.on_telegram_start(self.now);
        let end = start + length;
        self.run_to(end);
        self.chip.on_telegram(Nanoseconds(start), self.now, result.map(|()| bytes));
        end
    }

    /// An MST with its end at `end` nanoseconds.
    pub(crate) fn mst(&mut self, end: u64, phase: u8) {
        let bytes = [0xFF, phase];
        self.telegram(end - BitRate::M2.span(encode(&bytes).len()).0, &bytes);
    }

    /// The MSTs of `count` cycles, the first with its end at `FIRST_MST`; returns the end of the last.
    pub(crate) fn cycles(&mut self, count: u64, phase: u8) -> u64 {
        let mut end = FIRST_MST;
        for cycle in 0..count {
            end = FIRST_MST + cycle * CYCLE * 1_000;
            self.mst(end, phase);
        }
        end
    }

    /// An MDT to address 1 in CP1 or CP2, 600 us after the MST that ended at `mst`; returns its end.
    pub(crate) fn mdt(&mut self, mst: u64, control: u16, info: u16) -> u64 {
        let [c, i] = [control.to_le_bytes(), info.to_le_bytes()];
        self.telegram(mst + 600_000, &[1, c[0], c[1], i[0], i[1]])
    }
}

/// The defaults with some changes.
pub(crate) fn with(change: impl FnOnce(&mut Alternatives)) -> Alternatives {
    let mut alternatives = Alternatives::default();
    change(&mut alternatives);
    alternatives
}
