//! A fault of the product: which instruction, and with which registers.

use emulator_link::protocol::fault;

use crate::machine::{Machine, machine};

/// Registers as the processor has them in the first instruction of the fault's handler.
struct Registers {
    numbered: [u32; 16],
}

impl Registers {
    /// From what QEMU prints for people: `R00=00000000 R01=...`.
    fn parse(text: &str) -> Option<Self> {
        let mut numbered = [0; 16];
        for (number, register) in numbered.iter_mut().enumerate() {
            let (_, value) = text.split_once(&format!("R{number:02}="))?;
            *register = u32::from_str_radix(value.get(..8)?, 16).ok()?;
        }
        Some(Self { numbered })
    }
}

const STACK: usize = 13;
const LINK: usize = 14;
const PROGRAM: usize = 15;

/// The record of the fault whose handler begins, or what stands in its way.
pub(crate) fn record() -> Result<[u32; fault::WORDS], String> {
    let text = machine().registers_as_text();
    let handler = Registers::parse(&text).ok_or_else(|| {
        format!("the product faulted, and QEMU prints no registers that can be read: {}", text.trim())
    })?;
    Ok(unstack(&handler, machine()))
}

/// The registers before the exception: eight words of them lie on the stack (ARM DDI 0403E B1.5.6).
fn unstack(handler: &Registers, machine: &Machine) -> [u32; fault::WORDS] {
    const WITHOUT_FLOATING_POINT: u32 = 1 << 4;
    const PADDED: u32 = 1 << 9;
    const STATUS: [u32; 4] = [0xE000_ED28, 0xE000_ED2C, 0xE000_ED34, 0xE000_ED38];
    let frame = handler.numbered[STACK];
    let stacked = |word: u32| machine.word(frame.wrapping_add(4 * word));
    let program_status = stacked(7);
    let mut record = [0; fault::WORDS];
    record[..16].copy_from_slice(&handler.numbered);
    for word in 0..4 {
        record[word as usize] = stacked(word);
    }
    record[12] = stacked(4);
    let frame_words = if handler.numbered[LINK] & WITHOUT_FLOATING_POINT != 0 { 8 } else { 26 };
    record[STACK] = frame.wrapping_add(4 * frame_words).wrapping_add(if program_status & PADDED != 0 { 4 } else { 0 });
    record[LINK] = stacked(5);
    record[PROGRAM] = stacked(6);
    record[16] = program_status;
    for (slot, address) in record[17..21].iter_mut().zip(STATUS) {
        *slot = machine.word(address);
    }
    record[21] = machine.word(record[PROGRAM]);
    record
}
