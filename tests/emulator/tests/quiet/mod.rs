//! A world in which the release ELF boots and waits for a master.

use emulator::Environment;
use ring::Nanoseconds;

/// A world without a ring: a chip that answers with its version and otherwise with memory, a motor that stands still.
pub(crate) struct Quiet {
    pub(crate) words: Vec<u16>,
    pub(crate) pins: (bool, bool),
    /// The bridge was on at least once.
    pub(crate) bridge: bool,
    pub(crate) brake: bool,
    /// Instants of the samples of phase current A.
    pub(crate) samples: Vec<Nanoseconds>,
    /// Position of the address switches.
    pub(crate) address: u8,
    /// Position of the bit-rate switches.
    pub(crate) bit_rate: u8,
    /// What the chip saw of the processor's start.
    pub(crate) chip: Vec<(Nanoseconds, Chip)>,
}

/// Pins of the chip.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Chip {
    /// RSTN is 0, or not.
    Reset(bool),
    /// SBAUD and SBAUD16.
    Straps(bool, bool),
    /// The first access.
    Accessed,
}

const VERSION_REGISTER: usize = 0x1000 / 2;

impl Quiet {
    pub(crate) fn new() -> Self {
        let mut words = vec![0; 0x1000];
        words[VERSION_REGISTER] = 0x0010;
        Self {
            words,
            pins: (true, true),
            bridge: false,
            brake: false,
            samples: Vec::new(),
            address: 2,
            bit_rate: 0,
            chip: Vec::new(),
        }
    }

    fn note_access(&mut self, now: Nanoseconds) {
        if self.chip.iter().all(|(_, seen)| *seen != Chip::Accessed) {
            self.chip.push((now, Chip::Accessed));
        }
    }
}

impl Environment for Quiet {
    fn external_read(&mut self, now: Nanoseconds, byte_offset: u32) -> u16 {
        self.note_access(now);
        self.words[byte_offset as usize / 2]
    }

    fn external_write(&mut self, now: Nanoseconds, byte_offset: u32, value: u16) {
        self.note_access(now);
        // Interrupt flags (04H, 05H) are cleared by writing ones and never set here; the version is read-only.
        let word = byte_offset as usize / 2;
        if ![VERSION_REGISTER, VERSION_REGISTER + 4, VERSION_REGISTER + 5].contains(&word) {
            self.words[word] = value;
        }
    }

    fn external_peek(&self, byte_offset: u32) -> Option<u16> {
        Some(self.words[byte_offset as usize / 2])
    }

    fn interrupt_pins(&self) -> (bool, bool) {
        self.pins
    }

    fn encoder_count(&mut self, _: Nanoseconds) -> u32 {
        1234
    }

    fn encoder_steady_until(&self, _: Nanoseconds) -> Nanoseconds {
        Nanoseconds(u64::MAX)
    }

    fn analog_sample(&mut self, at: Nanoseconds, adc: usize, channel: u8) -> u16 {
        if (adc, channel) == (1, 10) {
            self.samples.push(at);
        }
        2048
    }

    fn set_bridge(&mut self, _: Nanoseconds, on: bool, _: u32) {
        self.bridge |= on;
    }

    fn set_brake(&mut self, _: Nanoseconds, energised: bool) {
        self.brake |= energised;
    }

    fn set_chip_reset(&mut self, now: Nanoseconds, held: bool) {
        self.chip.push((now, Chip::Reset(held)));
    }

    fn set_bit_rate_straps(&mut self, now: Nanoseconds, sbaud: bool, sbaud16: bool) {
        self.chip.push((now, Chip::Straps(sbaud, sbaud16)));
    }

    fn bit_rate_switches(&self) -> u8 {
        self.bit_rate
    }

    fn address_switches(&self) -> u8 {
        self.address
    }
}
