//! The dual-port RAM and where things stand in it. sercon816.md 6.1.

use super::noise::Noise;

/// Number of words.
pub(super) const WORDS: u16 = 2048;

/// Error counter of the MST.
pub(super) const NMSTERR: u16 = 10;

/// The words of the RAM; addresses wrap as the address lines do.
pub(super) struct Ram {
    words: Vec<u16>,
}

impl Ram {
    /// Undefined contents, as after power-up.
    pub(super) fn garbage(noise: &mut Noise) -> Self {
        Self { words: (0..WORDS).map(|_| noise.word()).collect() }
    }

    pub(super) fn get(&self, address: u16) -> u16 {
        self.words[usize::from(address % WORDS)]
    }

    pub(super) fn set(&mut self, address: u16, value: u16) {
        self.words[usize::from(address % WORDS)] = value;
    }

    /// Sets and clears bits of one word.
    pub(super) fn change(&mut self, address: u16, clear: u16, set: u16) {
        self.set(address, self.get(address) & !clear | set);
    }

    /// COMPT0 or COMPT1: the first telegram header of a transmission block.
    pub(super) fn first_header(&self, block: u16) -> u16 {
        self.get(block)
    }

    /// SCPTn: control word 0 of service container 0 to 7.
    pub(super) fn service_container(&self, number: usize) -> u16 {
        self.get(2 + number as u16)
    }
}
