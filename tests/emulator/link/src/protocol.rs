//! The words that travel between the bus inside QEMU and the emulator.
//!
//! Every message is a sequence of 32-bit words. The bus speaks first; after each of its messages it waits for commands, of which only
//! [`command::RESUME`] lets the product run on. A *tick* is one instruction of the product.

/// Version of this protocol; both sides name it.
pub const VERSION: u32 = 6;

/// First word of a message from the bus.
pub mod message {
    /// The product asks for the value at an address and waits.
    pub const READ: u32 = 1;
    /// The tick budget is used up, the product was interrupted.
    pub const TIMER: u32 = 2;
    /// The buffer of posted entries is full.
    pub const FULL: u32 = 3;
    /// Something the bus cannot serve; the payload is a [`super::fault`] record.
    pub const FAULT: u32 = 4;
    /// The bus is up; address = protocol version, payload empty.
    pub const HELLO: u32 = 5;
    /// The payload answers [`super::command::READ_MEMORY`]; empty after [`super::command::WRITE_MEMORY`].
    pub const MEMORY: u32 = 6;
    /// The product resets itself; nothing but memory commands is answered from here on.
    pub const RESET: u32 = 8;
    /// There is no going on; the payload says why, as text of four bytes a word, zeros behind it.
    pub const FAILED: u32 = 7;
    /// The last posted write is one of those that [`super::acts_at_once`], and the product waits for its end.
    pub const ACTS: u32 = 9;
    /// The instruction of [`super::command::STOP_AT`] is about to be executed.
    pub const STOPPED: u32 = 16;
}

/// Word positions in the header of a message from the bus.
pub mod header {
    /// One of [`super::message`].
    pub const KIND: usize = 0;
    /// Ticks since the last resume.
    pub const TICKS: usize = 1;
    /// Address that is read.
    pub const ADDRESS: usize = 2;
    /// Width in bytes: 1, 2 or 4.
    pub const WIDTH: usize = 3;
    /// Program counter of the access; for a timer message of the interrupted instruction.
    pub const PC: usize = 4;
    /// The word at the watched address, see [`super::resume::WATCH`].
    pub const WATCHED: usize = 5;
    /// Bit 0: the interrupted instruction was a WFI.
    pub const FLAGS: usize = 6;
    /// Number of payload words that follow.
    pub const PAYLOAD: usize = 7;
    /// Words in a header.
    pub const WORDS: usize = 8;
}

/// A posted entry: what the product did since the last message without waiting for the host.
pub mod post {
    /// Ticks since the last resume.
    pub const TICKS: usize = 0;
    /// Address.
    pub const ADDRESS: usize = 1;
    /// Value written, or value that the bus served from the prefetched ones.
    pub const VALUE: usize = 2;
    /// Width in bytes, plus [`SERVED`] for a read served by the bus.
    pub const KIND: usize = 3;
    /// Program counter.
    pub const PC: usize = 4;
    /// Words in an entry.
    pub const WORDS: usize = 5;
    /// Flag in the kind word: a read that the bus answered from prefetched values.
    pub const SERVED: u32 = 0x100;
    /// Flag in the kind word: the handler of a fault begins. The value is the exception's number.
    pub const ENTERED: u32 = 0x200;
    /// Entries that the bus gathers at most.
    pub const CAPACITY: usize = 40;
}

/// Payload of a fault message: r0..r12, sp, lr, pc, xpsr, CFSR, HFSR, MMFAR, BFAR, the two half-words at pc.
pub mod fault {
    /// Words in the record.
    pub const WORDS: usize = 22;
}

/// First word of a command from the host.
pub mod command {
    /// Let the product run; a [`super::resume`] record follows.
    pub const RESUME: u32 = 1;
    /// Read memory: address, number of words. Answered with a memory message.
    pub const READ_MEMORY: u32 = 2;
    /// Write words: address, number of words, the words. Reaches the flash as well. Answered with an empty memory message.
    pub const WRITE_MEMORY: u32 = 3;
    /// Begin (1) or end (0) a trace, see [`super::trace`]. Answered with an empty memory message. Only the bus inside QEMU knows it.
    pub const TRACE: u32 = 4;
    /// Stop once before an instruction: that at this address (0: the current one), or so many executed ones behind it (second word). Answered with
    /// an empty memory message.
    pub const STOP_AT: u32 = 16;
    /// The handlers of the faults, of NMI and of unbound interrupts are entered (1), or each of them ends the run with a fault message (0, as at the start).
    /// Answered with an empty memory message.
    pub const FAULTS_RUN_ON: u32 = 5;
    /// DHCSR says that a debugger is attached (1) or not (0). Answered with an empty memory message.
    pub const DEBUGGER: u32 = 6;
}

/// What the processor did, little-endian words in a file beside the page: the address of an instruction, which is even, or one of these.
pub mod trace {
    /// Name of the file.
    pub const FILE: &str = "trace";
    /// The last instruction accesses the address in the next word.
    pub const ACCESS: u32 = 1;
    /// The handler of an exception begins; its number is above [`NUMBER`].
    pub const ENTERED: u32 = 3;
    /// The handler of an exception has returned; its number is above [`NUMBER`].
    pub const LEFT: u32 = 5;
    /// First bit of an exception's number.
    pub const NUMBER: u32 = 8;
}

/// Word positions in a resume command.
pub mod resume {
    /// [`super::command::RESUME`].
    pub const KIND: usize = 0;
    /// The value read, already aligned to bit 0.
    pub const VALUE: usize = 1;
    /// Ticks until the product must be interrupted, 1 to 2^31 - 1.
    pub const BUDGET: usize = 2;
    /// Three words of interrupts to pend whether their handler is active or not: an edge.
    pub const PEND: usize = 3;
    /// Three words of interrupt lines that are high: pended unless the handler is active now.
    pub const LEVEL: usize = 6;
    /// Address of a word that every message carries (the RTT write index), 0 = none.
    pub const WATCH: usize = 9;
    /// Ticks that a read in the external bus window costs beside its instruction.
    pub const READ_WAIT: usize = 10;
    /// Ticks that a write in the external bus window costs beside its instruction.
    pub const WRITE_WAIT: usize = 11;
    /// The product is interrupted so many ticks after the first posted write at the latest.
    pub const POST_BOUND: usize = 12;
    /// Number of prefetched values that follow, see [`super::prefetched`].
    pub const PREFETCHED: usize = 13;
    /// NMI is pended (1).
    pub const NON_MASKABLE: usize = 14;
    /// Words before the prefetched values.
    pub const WORDS: usize = 15;
    /// Most prefetched values in a resume.
    pub const PREFETCH_CAPACITY: usize = 24;
}

/// A prefetched value.
pub mod prefetched {
    /// Address.
    pub const ADDRESS: usize = 0;
    /// Value.
    pub const VALUE: usize = 1;
    /// Ticks since the resume at which the value is right, for what changes all the time; [`ANY`]: until the budget is used up.
    pub const AT: usize = 2;
    /// Words of a value.
    pub const WORDS: usize = 3;
    /// At any tick: no access comes before the first one.
    pub const ANY: u32 = 0;
}

/// Most words in a message either way; both buffers lie in one page of memory.
pub const MESSAGE_WORDS: usize = 256;
/// Most words that a memory message or command carries.
pub const MEMORY_WORDS: usize = MESSAGE_WORDS - header::WORDS;

/// First byte of the window of the external bus (FSMC bank 1, NE1).
pub const EXTERNAL_BUS: u32 = 0x6000_0000;
/// First address behind the window of the external bus.
pub const EXTERNAL_BUS_END: u32 = 0x7000_0000;

/// First byte of the flash that holds the parameters: sectors 10 and 11. The product's reads are answered from what
/// [`command::WRITE_MEMORY`] has put there, all ones at the start; its writes go to the emulator.
pub const PARAMETER_FLASH: u32 = 0x080C_0000;
/// First address behind the flash that holds the parameters.
pub const PARAMETER_FLASH_END: u32 = 0x0810_0000;
/// First byte of the production record: sector 9.
pub const PRODUCTION_RECORD: u32 = 0x080A_0000;
/// FLASH_CR.
const FLASH_CONTROL: u32 = 0x4002_3C10;

/// A write there may stop the processor for as long as it takes.
#[must_use]
pub fn acts_at_once(address: u32) -> bool {
    address == FLASH_CONTROL || (PARAMETER_FLASH..PARAMETER_FLASH_END).contains(&address)
}
