//! A bus for tests: plain registers and RAM, with a record of every write, and no behaviour but write-1-to-clear
//! and the software reset of 01H.

use std::cell::RefCell;
use std::rc::Rc;
use std::vec::Vec;

use crate::bus::{Bus, RamAddress, Register};

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Write {
    Register(u16, u16),
    Ram(u16, u16),
}

pub(crate) struct Memory {
    pub(crate) registers: [u16; 0x2B],
    pub(crate) ram: Vec<u16>,
    pub(crate) writes: Vec<Write>,
    pub(crate) accesses: usize,
    /// Flags that are set again whenever they are cleared: register word, bits.
    pub(crate) persistent: (usize, u16),
    /// Flags that come while the others are being acknowledged, once: register word, bits.
    pub(crate) late: Option<(usize, u16)>,
    /// A RAM word that does not hold what is written.
    pub(crate) broken_word: Option<u16>,
}

#[derive(Clone)]
pub(crate) struct TestBus(pub(crate) Rc<RefCell<Memory>>);

impl TestBus {
    /// Garbage everywhere but in the version register.
    pub(crate) fn new() -> Self {
        let mut registers = [0xBEEF; 0x2B];
        registers[0] = 0x0010;
        registers[4] = 0;
        registers[5] = 0;
        Self(Rc::new(RefCell::new(Memory {
            registers,
            ram: std::vec![0xDEAD; 2048],
            writes: Vec::new(),
            accesses: 0,
            persistent: (0, 0),
            late: None,
            broken_word: None,
        })))
    }

    pub(crate) fn ram(&self, word: u16) -> u16 {
        self.0.borrow().ram[usize::from(word)]
    }

    pub(crate) fn set_ram(&self, word: u16, value: u16) {
        self.0.borrow_mut().ram[usize::from(word)] = value;
    }

    pub(crate) fn register(&self, word: usize) -> u16 {
        self.0.borrow().registers[word]
    }

    pub(crate) fn set_register(&self, word: usize, value: u16) {
        self.0.borrow_mut().registers[word] = value;
    }

    pub(crate) fn take_writes(&self) -> Vec<Write> {
        core::mem::take(&mut self.0.borrow_mut().writes)
    }

    pub(crate) fn take_accesses(&self) -> usize {
        core::mem::take(&mut self.0.borrow_mut().accesses)
    }
}

impl Bus for TestBus {
    fn read_register(&mut self, register: Register) -> u16 {
        let mut memory = self.0.borrow_mut();
        memory.accesses += 1;
        memory.registers[usize::from(register.word())]
    }

    fn write_register(&mut self, register: Register, value: u16) {
        let mut memory = self.0.borrow_mut();
        memory.accesses += 1;
        memory.writes.push(Write::Register(register.word(), value));
        let word = usize::from(register.word());
        match word {
            0x00 | 0x0B => {}
            0x01 if value & 2 != 0 => memory.registers[word] = 0x0009,
            0x04 | 0x05 => {
                memory.registers[word] &= !value;
                if let Some((late, bits)) = memory.late.take() {
                    memory.registers[late] |= bits;
                }
                let (persistent, bits) = memory.persistent;
                if persistent == word {
                    memory.registers[word] |= bits;
                }
            }
            _ => memory.registers[word] = value,
        }
    }

    fn read_ram(&mut self, address: RamAddress) -> u16 {
        let mut memory = self.0.borrow_mut();
        memory.accesses += 1;
        memory.ram[usize::from(address.word())]
    }

    fn write_ram(&mut self, address: RamAddress, value: u16) {
        let mut memory = self.0.borrow_mut();
        memory.accesses += 1;
        memory.writes.push(Write::Ram(address.word(), value));
        if memory.broken_word != Some(address.word()) {
            memory.ram[usize::from(address.word())] = value;
        }
    }
}
