//! Programs of a few instructions that the rig takes for a product, and a world in which nothing is connected.

use std::path::{Path, PathBuf};

use emulator::Environment;
use ring::Nanoseconds;

/// Nothing is connected.
pub(crate) struct Nothing;

impl Environment for Nothing {
    fn external_read(&mut self, _: Nanoseconds, _: u32) -> u16 {
        0
    }
    fn external_write(&mut self, _: Nanoseconds, _: u32, _: u16) {}
    fn interrupt_pins(&self) -> (bool, bool) {
        (true, true)
    }
    fn encoder_count(&mut self, _: Nanoseconds) -> u32 {
        0
    }
    fn address_switches(&self) -> u8 {
        2
    }
}

const FLASH: u32 = 0x0800_0000;
const STACK: u32 = 0x2000_8000;

/// Flash from its first address on.
pub(crate) struct Program {
    image: Vec<u8>,
    start: u32,
}

impl Program {
    /// Starts at an address, with its stack in RAM.
    pub(crate) fn new(start: u32) -> Self {
        Self { image: vec![0; 0x280], start }.word(FLASH, STACK).vector(1, start)
    }

    /// The handler of an exception.
    pub(crate) fn vector(self, exception: u32, handler: u32) -> Self {
        self.word(FLASH + 4 * exception, handler | 1)
    }

    /// A word at an address.
    pub(crate) fn word(mut self, address: u32, word: u32) -> Self {
        let at = (address - FLASH) as usize;
        self.image[at..at + 4].copy_from_slice(&word.to_le_bytes());
        self
    }

    /// Words from an address on, behind everything else.
    pub(crate) fn words(mut self, address: u32, words: &[u32]) -> Self {
        self.image.resize((address - FLASH) as usize, 0);
        self.image.extend(words.iter().flat_map(|word| word.to_le_bytes()));
        self
    }

    /// Instructions from an address on.
    pub(crate) fn code(mut self, address: u32, code: &[u16]) -> Self {
        for (slot, half) in self.image[(address - FLASH) as usize..].chunks_exact_mut(2).zip(code) {
            slot.copy_from_slice(&half.to_le_bytes());
        }
        self
    }

    /// Writes it into a folder as the smallest ELF that the rig accepts: one segment, which is the section `.vector_table`.
    pub(crate) fn write(&self, folder: &Path) -> PathBuf {
        let path = folder.join("product");
        std::fs::write(&path, self.elf()).unwrap();
        path
    }

    fn elf(&self) -> Vec<u8> {
        let names = b"\0.vector_table\0.names\0";
        let image_at = 52 + 32;
        let names_at = image_at + self.image.len() as u32;
        let sections_at = (names_at + names.len() as u32).next_multiple_of(4);
        let mut elf = b"\x7fELF\x01\x01\x01\0\0\0\0\0\0\0\0\0".to_vec();
        let mut words = |half: &[u16], words: &[u32], more: &[u16]| {
            elf.extend(half.iter().flat_map(|half| half.to_le_bytes()));
            elf.extend(words.iter().flat_map(|word| word.to_le_bytes()));
            elf.extend(more.iter().flat_map(|half| half.to_le_bytes()));
        };
        // Executable for ARM, EABI 5; one program header, three section headers, names in the last.
        words(&[2, 40], &[1, self.start | 1, 52, sections_at, 0x0500_0000], &[52, 32, 1, 40, 3, 2]);
        let size = self.image.len() as u32;
        words(&[], &[1, image_at, FLASH, FLASH, size, size, 5, 4], &[]);
        elf.extend(&self.image);
        elf.extend(names);
        elf.resize(sections_at as usize, 0);
        for section in [
            [0; 10],
            [1, 1, 6, FLASH, image_at, size, 0, 0, 4, 0],
            [15, 3, 0, 0, names_at, names.len() as u32, 0, 0, 1, 0],
        ] {
            elf.extend(section.iter().flat_map(|word| word.to_le_bytes()));
        }
        elf
    }
}
