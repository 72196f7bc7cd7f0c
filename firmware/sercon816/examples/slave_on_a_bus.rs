//! A slave is set up on a bus that remembers: what the driver writes into the chip, and when it refuses to go on.
//!
//! `cargo run -p sercon816 --example slave_on_a_bus`

use sercon816::{
    BitRate, Block, Bus, CommandPort, Configuration, CyclicConfiguration, FeedbackPort, InitialiseError, MasterClock,
    RamAddress, Register, Slave, Transceiver,
};
use std::cell::RefCell;
use std::rc::Rc;

/// Registers and RAM of a chip that does nothing by itself.
struct Memory {
    registers: [u16; 43],
    ram: [u16; RamAddress::WORDS as usize],
    accesses: u32,
}

/// A handle of it; every task of a driver has one.
#[derive(Clone)]
struct Remembering(Rc<RefCell<Memory>>);

impl Remembering {
    /// `version` is what register 00H reads.
    fn new(version: u16) -> Self {
        let mut memory = Memory { registers: [0; 43], ram: [0xDEAD; RamAddress::WORDS as usize], accesses: 0 };
        memory.registers[0] = version;
        Self(Rc::new(RefCell::new(memory)))
    }

    fn accesses(&self) -> u32 {
        std::mem::take(&mut self.0.borrow_mut().accesses)
    }
}

impl Bus for Remembering {
    fn read_register(&mut self, register: Register) -> u16 {
        let memory = &mut *self.0.borrow_mut();
        memory.accesses += 1;
        memory.registers[usize::from(register.word())]
    }
    fn write_register(&mut self, register: Register, value: u16) {
        let memory = &mut *self.0.borrow_mut();
        memory.accesses += 1;
        // The version register is read-only, and the software reset of 01H ends by itself.
        match register.word() {
            0 => {}
            1 => memory.registers[1] = value & !1,
            word => memory.registers[usize::from(word)] = value,
        }
    }
    fn read_ram(&mut self, address: RamAddress) -> u16 {
        let memory = &mut *self.0.borrow_mut();
        memory.accesses += 1;
        memory.ram[usize::from(address.word())]
    }
    fn write_ram(&mut self, address: RamAddress, value: u16) {
        let memory = &mut *self.0.borrow_mut();
        memory.accesses += 1;
        memory.ram[usize::from(address.word())] = value;
    }
}

pub(crate) fn main() {
    let configuration = Configuration {
        address: 5,
        bit_rate: BitRate::Mbit4,
        clock: MasterClock::Mhz32,
        transceiver: Transceiver::STANDARD,
    };

    // Nothing on the bus: the driver says so and touches nothing.
    let refused = Slave::new(Remembering::new(0xFFFF)).initialise(&configuration).expect_err("there is no chip");
    println!("without a chip: {refused}");
    assert_eq!(refused, InitialiseError::Version { expected: 0x0010, actual: 0xFFFF });

    let mut bus = Remembering::new(0x0010);
    let mut slave = Slave::new(bus.clone());
    slave.initialise(&configuration).expect("a SERCON816");
    println!("set up for CP0 with {} accesses", bus.accesses());

    // What the master has written in CP2, here of a ring of 2 ms.
    let cyclic = CyclicConfiguration {
        cycle_us: 2_000,
        t1_us: 92,
        t2_us: 1_782,
        t3_us: 1_965,
        t4_us: 1_698,
        at_words: 4,
        mdt_words: 2,
        mdt_length_words: 16,
        record_position_words: 0,
    };
    slave.configure_cyclic(&cyclic).expect("it fits the chip");
    for phase in 1..=3 {
        slave.enter(phase, None).expect("configured");
        println!("CP{phase} after {} accesses", bus.accesses());
    }
    for (name, word) in [("AT header", Block::CYCLIC.at_header), ("MDT header", Block::CYCLIC.mdt_header)] {
        let words: Vec<_> = (0..5).map(|offset| format!("{:04X}", bus.read_ram(word.offset(offset)))).collect();
        println!("{name} at word {:03X}H: {}", word.word(), words.join(" "));
    }

    // The chip would put an MDT here, and send what stands there at t1.
    bus.write_ram(Block::CYCLIC.mdt_data, 0xE000);
    bus.write_ram(Block::CYCLIC.mdt_data.offset(2), 0x2710);
    bus.write_ram(Block::CYCLIC.mdt_data.offset(3), 0);
    let (mut command, mut feedback) = (CommandPort::new(bus.clone(), 5), FeedbackPort::new(bus.clone()));
    let (control, velocity) = (command.control_word(), command.double_word(0));
    println!("t3: control word {control:04X}H, command {velocity}");
    assert_eq!((control, velocity), (0xE000, 10_000));
    feedback.set_double_word(1, 9_998);
    assert_eq!(bus.read_ram(Block::CYCLIC.at_data.offset(3)), 9_998);
    println!("t4: feedback {} stands in the AT", bus.read_ram(Block::CYCLIC.at_data.offset(3)));
}
