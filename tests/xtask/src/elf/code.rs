//! Instructions, and where each leads.

use anyhow::{Context, Result, anyhow, bail};
use capstone::Capstone;
use capstone::arch::{self, BuildsCapstone, BuildsCapstoneExtraMode};

/// Where an instruction leads beside the next one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Flow {
    /// Nowhere else.
    Next,
    /// Calls the function at this address.
    Call(u32),
    /// Calls what a register points to.
    CallIndirect,
    /// Jumps there, perhaps on a condition.
    Jump(u32),
    /// Jumps to where a register or a loaded word points.
    JumpIndirect,
    /// Jumps within the function, by a table behind the instruction.
    Table,
    /// Back to the caller.
    Return,
    /// Ends the program.
    Trap,
}

/// An instruction.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Instruction {
    /// Its address.
    pub(crate) address: u32,
    /// Bytes: 2 or 4.
    pub(crate) length: u32,
    /// Without `.w`; with a condition inside an IT block.
    pub(crate) mnemonic: String,
    /// As the assembler writes them.
    pub(crate) operands: String,
    /// Where it leads.
    pub(crate) flow: Flow,
}

impl Instruction {
    /// Bytes by which it moves the stack pointer down.
    pub(crate) fn pushes(&self) -> u32 {
        let operands = self.operands.as_str();
        let registers = || registers_in(operands);
        match self.mnemonic.as_str() {
            "push" => 4 * registers(),
            "stmdb" if operands.starts_with("sp!") => 4 * registers(),
            "vpush" => registers() * if operands.contains('d') { 8 } else { 4 },
            "sub" | "subw" if operands.starts_with("sp, ") => {
                operands.rsplit('#').next().and_then(number).unwrap_or_default()
            }
            "str" | "strd" => match operands.split_once("[sp, #-") {
                Some((_, offset)) => offset.strip_suffix("]!").and_then(number).unwrap_or_default(),
                None => 0,
            },
            _ => 0,
        }
    }
}

/// Registers named in braces; the disassembler writes every one of them.
fn registers_in(operands: &str) -> u32 {
    let list = operands.split_once('{').map_or("", |(_, list)| list);
    list.split(',').count() as u32
}

/// Disassembles one piece of code completely.
pub(crate) fn instructions(disassembler: &Capstone, address: u32, bytes: &[u8]) -> Result<Vec<Instruction>> {
    let found = disassembler
        .disasm_all(bytes, u64::from(address))
        .map_err(|error| anyhow!("the code at {address:#010x} cannot be disassembled: {error}"))?;
    let mut instructions = Vec::with_capacity(found.len());
    for instruction in found.iter() {
        let mnemonic = instruction.mnemonic().context("an instruction without a name")?;
        let mnemonic = mnemonic.trim_end_matches(".w").to_owned();
        let operands = instruction.op_str().unwrap_or_default().to_owned();
        let flow = flow(&mnemonic, &operands)?;
        let address = instruction.address() as u32;
        instructions.push(Instruction { address, length: instruction.len() as u32, mnemonic, operands, flow });
    }
    let end = instructions.last().map_or(address, |last| last.address + last.length);
    if end != address + bytes.len() as u32 {
        bail!("the code at {end:#010x} is no known instruction: what it does cannot be judged");
    }
    Ok(instructions)
}

/// A disassembler for the drive's processor.
pub(crate) fn disassembler() -> Result<Capstone> {
    Capstone::new()
        .arm()
        .mode(arch::arm::ArchMode::Thumb)
        .extra_mode([arch::arm::ArchExtraMode::MClass].into_iter())
        .build()
        .map_err(|error| anyhow!("the disassembler does not start: {error}"))
}

const CONDITIONS: [&str; 16] =
    ["eq", "ne", "hs", "lo", "mi", "pl", "vs", "vc", "hi", "ls", "ge", "lt", "gt", "le", "al", ""];

/// Is this the mnemonic, with or without a condition?
pub(crate) fn is(mnemonic: &str, base: &str) -> bool {
    mnemonic.strip_prefix(base).is_some_and(|condition| CONDITIONS.contains(&condition))
}

fn flow(mnemonic: &str, operands: &str) -> Result<Flow> {
    let target = || {
        let number = operands.rsplit('#').next().and_then(number);
        number.with_context(|| format!("`{mnemonic} {operands}` has no target"))
    };
    // In this order: `ble` is a jump, `blx` no `bl`.
    Ok(if is(mnemonic, "b") || mnemonic == "cbz" || mnemonic == "cbnz" {
        Flow::Jump(target()?)
    } else if is(mnemonic, "bl") {
        Flow::Call(target()?)
    } else if is(mnemonic, "blx") {
        Flow::CallIndirect
    } else if is(mnemonic, "bx") {
        if operands == "lr" { Flow::Return } else { Flow::JumpIndirect }
    } else if mnemonic == "tbb" || mnemonic == "tbh" {
        Flow::Table
    } else if mnemonic == "udf" || mnemonic == "trap" {
        Flow::Trap
    } else if is(mnemonic, "pop") || mnemonic.starts_with("ldm") {
        if operands.contains("pc") { Flow::Return } else { Flow::Next }
    } else if operands.starts_with("pc,") {
        let returns = operands == "pc, lr" || operands.starts_with("pc, [sp]");
        if returns { Flow::Return } else { Flow::JumpIndirect }
    } else {
        Flow::Next
    })
}

fn number(text: &str) -> Option<u32> {
    match text.strip_prefix("0x") {
        Some(digits) => u32::from_str_radix(digits, 16).ok(),
        None => text.parse().ok(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn one(bytes: &[u8]) -> Instruction {
        let found = instructions(&disassembler().unwrap(), 0x0800_0100, bytes).unwrap();
        assert_eq!(found.len(), 1, "{found:?}");
        found[0].clone()
    }

    #[test]
    fn calls_jumps_and_returns_are_told_apart() {
        for (bytes, flow) in [
            (&[0x00, 0xf0, 0x02, 0xf8][..], Flow::Call(0x0800_0108)), // bl
            (&[0x00, 0xf0, 0x02, 0xb8], Flow::Jump(0x0800_0108)),     // b.w
            (&[0x02, 0xe0], Flow::Jump(0x0800_0108)),                 // b
            (&[0x02, 0xdd], Flow::Jump(0x0800_0108)),                 // ble
            (&[0x02, 0xdb], Flow::Jump(0x0800_0108)),                 // blt
            (&[0x02, 0xd9], Flow::Jump(0x0800_0108)),                 // bls
            (&[0x10, 0xb1], Flow::Jump(0x0800_0108)),                 // cbz r0
            (&[0x98, 0x47], Flow::CallIndirect),                      // blx r3
            (&[0x18, 0x47], Flow::JumpIndirect),                      // bx r3
            (&[0x70, 0x47], Flow::Return),                            // bx lr
            (&[0xf0, 0xbd], Flow::Return),                            // pop {r4-r7, pc}
            (&[0xbd, 0xe8, 0xf0, 0x87], Flow::Return),                // pop.w {r4-r10, pc}
            (&[0x5d, 0xf8, 0x04, 0xfb], Flow::Return),                // ldr pc, [sp], #4
            (&[0x97, 0x46], Flow::JumpIndirect),                      // mov pc, r2
            (&[0xdf, 0xe8, 0x00, 0xf0], Flow::Table),                 // tbb [pc, r0]
            (&[0xdf, 0xe8, 0x11, 0xf0], Flow::Table),                 // tbh [pc, r1, lsl #1]
            (&[0xfe, 0xde], Flow::Trap),                              // udf #254, which the compiler traps with
            (&[0x09, 0xde], Flow::Trap),                              // udf #9
            (&[0xf0, 0xbc], Flow::Next),                              // pop {r4-r7}
            (&[0x20, 0xf0, 0x01, 0x00], Flow::Next),                  // bic
        ] {
            assert_eq!(one(bytes).flow, flow, "{:?}", one(bytes));
        }
    }

    #[test]
    fn what_moves_the_stack_pointer_is_measured() {
        for (bytes, pushed) in [
            (&[0xf0, 0xb5][..], 20),          // push {r4-r7, lr}
            (&[0x2d, 0xe9, 0x00, 0x0f], 16),  // stmdb sp!, {r8-r11}
            (&[0x9d, 0xb0], 116),             // sub sp, #116
            (&[0xad, 0xf5, 0x80, 0x7d], 256), // sub.w sp, sp, #256
            (&[0x4d, 0xf8, 0x04, 0xbd], 4),   // str r11, [sp, #-4]!
            (&[0x2d, 0xed, 0x04, 0x8b], 16),  // vpush {d8, d9}
            (&[0x1d, 0xb0], 0),               // add sp, #116
            (&[0x0d, 0x93], 0),               // str r3, [sp, #52]
        ] {
            assert_eq!(one(bytes).pushes(), pushed, "{:?}", one(bytes));
        }
    }

    #[test]
    fn an_unknown_instruction_is_an_error_and_not_skipped() {
        // nop, then a half of a 32-bit instruction.
        let error = instructions(&disassembler().unwrap(), 0x0800_0100, &[0x00, 0xbf, 0xff, 0xff]).unwrap_err();
        assert!(error.to_string().contains("0x08000102"), "{error}");
    }
}
