//! Every supported encoding, and those that must be refused, as an assembler (llvm-mc) writes them.

use crate::thumb::{Access, Direction, Transfer, Width, advance_it, decode};
use Direction::{Load, Store};
use Transfer::{Multiple, Pair, Single};
use Width::{Byte, Half, Word};

/// Register n holds 0x4000_0000 + 0x1000 n, the index registers r2 and r11 hold 8.
fn registers() -> [u32; 16] {
    let mut registers = [0; 16];
    for (number, register) in registers.iter_mut().enumerate() {
        *register = base(number as u32);
    }
    registers[2] = 8;
    registers[11] = 8;
    registers
}

const fn base(number: u32) -> u32 {
    0x4000_0000 + 0x1000 * number
}

/// The bytes of an instruction, in memory order.
fn decode_bytes(bytes: &[u8]) -> Option<Access> {
    let half = |at: usize| bytes.get(at..at + 2).map_or(0, |pair| u16::from_le_bytes([pair[0], pair[1]]));
    decode(half(0), half(2), &registers())
}

type Case = (&'static str, &'static [u8], (Direction, Width, bool, Transfer, u32, Option<(u8, u32)>));

#[rustfmt::skip]
const CASES: &[Case] = &[
    ("ldr r2, [r1, #12]", &[0xca, 0x68], (Load, Word, false, Single(2), base(1) + 12, None)),
    ("str r2, [r1, #124]", &[0xca, 0x67], (Store, Word, false, Single(2), base(1) + 124, None)),
    ("ldrb r3, [r4, #31]", &[0xe3, 0x7f], (Load, Byte, false, Single(3), base(4) + 31, None)),
    ("strb r3, [r4, #5]", &[0x63, 0x71], (Store, Byte, false, Single(3), base(4) + 5, None)),
    ("ldrh r5, [r6, #62]", &[0xf5, 0x8f], (Load, Half, false, Single(5), base(6) + 62, None)),
    ("strh r5, [r6, #2]", &[0x75, 0x80], (Store, Half, false, Single(5), base(6) + 2, None)),
    ("ldr r0, [r1, r2]", &[0x88, 0x58], (Load, Word, false, Single(0), base(1) + 8, None)),
    ("str r0, [r1, r2]", &[0x88, 0x50], (Store, Word, false, Single(0), base(1) + 8, None)),
    ("ldrb r0, [r1, r2]", &[0x88, 0x5c], (Load, Byte, false, Single(0), base(1) + 8, None)),
    ("strb r0, [r1, r2]", &[0x88, 0x54], (Store, Byte, false, Single(0), base(1) + 8, None)),
    ("ldrh r0, [r1, r2]", &[0x88, 0x5a], (Load, Half, false, Single(0), base(1) + 8, None)),
    ("strh r0, [r1, r2]", &[0x88, 0x52], (Store, Half, false, Single(0), base(1) + 8, None)),
    ("ldrsb r0, [r1, r2]", &[0x88, 0x56], (Load, Byte, true, Single(0), base(1) + 8, None)),
    ("ldrsh r0, [r1, r2]", &[0x88, 0x5e], (Load, Half, true, Single(0), base(1) + 8, None)),
    ("ldm r3!, {r0, r2}", &[0x05, 0xcb], (Load, Word, false, Multiple(0b101), base(3), Some((3, base(3) + 8)))),
    ("ldm r3, {r1, r3}", &[0x0a, 0xcb], (Load, Word, false, Multiple(0b1010), base(3), None)),
    ("stm r3!, {r0, r2}", &[0x05, 0xc3], (Store, Word, false, Multiple(0b101), base(3), Some((3, base(3) + 8)))),
    ("ldr.w r9, [r10, #4095]", &[0xda, 0xf8, 0xff, 0x9f], (Load, Word, false, Single(9), base(10) + 4095, None)),
    ("str.w r9, [r10, #4]", &[0xca, 0xf8, 0x04, 0x90], (Store, Word, false, Single(9), base(10) + 4, None)),
    ("ldrb.w r9, [r10, #1]", &[0x9a, 0xf8, 0x01, 0x90], (Load, Byte, false, Single(9), base(10) + 1, None)),
    ("strb.w r9, [r10, #1]", &[0x8a, 0xf8, 0x01, 0x90], (Store, Byte, false, Single(9), base(10) + 1, None)),
    ("ldrh.w r9, [r10, #2]", &[0xba, 0xf8, 0x02, 0x90], (Load, Half, false, Single(9), base(10) + 2, None)),
    ("strh.w r9, [r10, #2]", &[0xaa, 0xf8, 0x02, 0x90], (Store, Half, false, Single(9), base(10) + 2, None)),
    ("ldrsb.w r9, [r10, #1]", &[0x9a, 0xf9, 0x01, 0x90], (Load, Byte, true, Single(9), base(10) + 1, None)),
    ("ldrsh.w r9, [r10, #2]", &[0xba, 0xf9, 0x02, 0x90], (Load, Half, true, Single(9), base(10) + 2, None)),
    ("ldr r9, [r10, #-4]", &[0x5a, 0xf8, 0x04, 0x9c], (Load, Word, false, Single(9), base(10) - 4, None)),
    ("str r9, [r10, #-255]", &[0x4a, 0xf8, 0xff, 0x9c], (Store, Word, false, Single(9), base(10) - 255, None)),
    ("ldr r9, [r10], #8", &[0x5a, 0xf8, 0x08, 0x9b], (Load, Word, false, Single(9), base(10), Some((10, base(10) + 8)))),
    ("str r9, [r10], #-8", &[0x4a, 0xf8, 0x08, 0x99], (Store, Word, false, Single(9), base(10), Some((10, base(10) - 8)))),
    ("ldr r9, [r10, #8]!", &[0x5a, 0xf8, 0x08, 0x9f], (Load, Word, false, Single(9), base(10) + 8, Some((10, base(10) + 8)))),
    ("strh r9, [r10, #-8]!", &[0x2a, 0xf8, 0x08, 0x9d], (Store, Half, false, Single(9), base(10) - 8, Some((10, base(10) - 8)))),
    ("ldrb r9, [r10], #1", &[0x1a, 0xf8, 0x01, 0x9b], (Load, Byte, false, Single(9), base(10), Some((10, base(10) + 1)))),
    ("ldrsh r9, [r10, #-2]", &[0x3a, 0xf9, 0x02, 0x9c], (Load, Half, true, Single(9), base(10) - 2, None)),
    ("ldr.w r9, [r10, r11, lsl #2]", &[0x5a, 0xf8, 0x2b, 0x90], (Load, Word, false, Single(9), base(10) + 32, None)),
    ("str.w r9, [r10, r11]", &[0x4a, 0xf8, 0x0b, 0x90], (Store, Word, false, Single(9), base(10) + 8, None)),
    ("ldrh.w r9, [r10, r11, lsl #1]", &[0x3a, 0xf8, 0x1b, 0x90], (Load, Half, false, Single(9), base(10) + 16, None)),
    ("strb.w r9, [r10, r11, lsl #3]", &[0x0a, 0xf8, 0x3b, 0x90], (Store, Byte, false, Single(9), base(10) + 64, None)),
    ("ldrsb.w r9, [r10, r11]", &[0x1a, 0xf9, 0x0b, 0x90], (Load, Byte, true, Single(9), base(10) + 8, None)),
    ("ldrd r8, r9, [r10, #16]", &[0xda, 0xe9, 0x04, 0x89], (Load, Word, false, Pair(8, 9), base(10) + 16, None)),
    ("strd r8, r9, [r10, #-16]", &[0x4a, 0xe9, 0x04, 0x89], (Store, Word, false, Pair(8, 9), base(10) - 16, None)),
    ("ldrd r8, r9, [r10], #8", &[0xfa, 0xe8, 0x02, 0x89], (Load, Word, false, Pair(8, 9), base(10), Some((10, base(10) + 8)))),
    ("strd r8, r9, [r10, #8]!", &[0xea, 0xe9, 0x02, 0x89], (Store, Word, false, Pair(8, 9), base(10) + 8, Some((10, base(10) + 8)))),
    ("ldm.w r10, {r8, r9, lr}", &[0x9a, 0xe8, 0x00, 0x43], (Load, Word, false, Multiple(0x4300), base(10), None)),
    ("stmdb r10!, {r8, r9}", &[0x2a, 0xe9, 0x00, 0x03], (Store, Word, false, Multiple(0x0300), base(10) - 8, Some((10, base(10) - 8)))),
    ("stm.w r10!, {r8, r9}", &[0xaa, 0xe8, 0x00, 0x03], (Store, Word, false, Multiple(0x0300), base(10), Some((10, base(10) + 8)))),
    ("ldmdb r10, {r0, r8}", &[0x1a, 0xe9, 0x01, 0x01], (Load, Word, false, Multiple(0x0101), base(10) - 8, None)),
];

#[rustfmt::skip]
const REFUSED: &[(&str, &[u8])] = &[
    ("ldr pc, [r1]", &[0xd1, 0xf8, 0x00, 0xf0]),
    ("ldr r0, [pc, #8]", &[0x02, 0x48]),
    ("ldrt r0, [r1, #4]", &[0x51, 0xf8, 0x04, 0x0e]),
    ("ldrex r0, [r1]", &[0x51, 0xe8, 0x00, 0x0f]),
    ("strex r0, r2, [r1]", &[0x41, 0xe8, 0x00, 0x20]),
    ("tbb [pc, r1]", &[0xdf, 0xe8, 0x01, 0xf0]),
    ("vldr s0, [r1]", &[0x91, 0xed, 0x00, 0x0a]),
    ("pld [r1, #4]", &[0x91, 0xf8, 0x04, 0xf0]),
    ("ldr r0, [sp, #4]", &[0x01, 0x98]),
    ("ldr sp, [r1]", &[0xd1, 0xf8, 0x00, 0xd0]),
    ("ldm.w r10, {r8, pc}", &[0x9a, 0xe8, 0x00, 0x81]),
    ("ldrd r8, r9, [pc, #16]", &[0xdf, 0xe9, 0x04, 0x89]),
    ("adds r0, r1, r2", &[0x88, 0x18]),
    ("add.w r0, r1, r2", &[0x01, 0xeb, 0x02, 0x00]),
    ("bkpt #0xab", &[0xab, 0xbe]),
    ("udf #0", &[0x00, 0xde]),
];

#[test]
fn loads_and_stores_of_an_assembler_are_decoded() {
    for (text, bytes, (direction, width, signed, transfer, address, write_back)) in CASES {
        let expected = Access {
            direction: *direction,
            width: *width,
            signed: *signed,
            transfer: *transfer,
            address: *address,
            write_back: *write_back,
            length: bytes.len() as u32,
        };
        assert_eq!(decode_bytes(bytes), Some(expected), "{text}");
    }
}

#[test]
fn what_is_not_a_plain_load_or_store_is_refused() {
    for (text, bytes) in REFUSED {
        assert_eq!(decode_bytes(bytes), None, "{text}");
    }
}

#[test]
fn narrow_values_are_extended_and_cut() {
    let access = |width, signed| Access {
        direction: Load,
        width,
        signed,
        transfer: Single(0),
        address: 0,
        write_back: None,
        length: 2,
    };
    assert_eq!(access(Byte, false).extend(0xFFF0), 0xF0);
    assert_eq!(access(Byte, true).extend(0x80), 0xFFFF_FF80);
    assert_eq!(access(Half, false).extend(0xF_8000), 0x8000);
    assert_eq!(access(Half, true).extend(0x8000), 0xFFFF_8000);
    assert_eq!(access(Word, false).extend(0xDEAD_BEEF), 0xDEAD_BEEF);
    assert_eq!(access(Byte, false).cut(0x1234), 0x34);
    assert_eq!(access(Half, false).cut(0x1_2345), 0x2345);
}

/// xPSR with this ITSTATE, the Thumb bit and flags that must survive.
const fn xpsr(state: u32) -> u32 {
    0xA100_0036 | (state & 3) << 25 | (state & 0xFC) << 8
}

#[test]
fn the_it_block_steps_to_its_next_instruction() {
    // ITTTE EQ: condition 0000, then one bit for each further instruction (0, 0, 1) and the end mark.
    let steps = [0b0000_0011, 0b0000_0110, 0b0000_1100, 0b0001_1000, 0];
    for pair in steps.windows(2) {
        assert_eq!(advance_it(xpsr(pair[0])), xpsr(pair[1]), "{:#010b}", pair[0]);
    }
    // IT NE, one instruction: ends at once and leaves no trace of its condition.
    assert_eq!(advance_it(xpsr(0b0001_1000)), xpsr(0));
    // ITE GE: the base condition (top three bits) stays, the else flips the lowest condition bit.
    assert_eq!(advance_it(xpsr(0b1010_1100)), xpsr(0b1011_1000));
    assert_eq!(advance_it(xpsr(0)), xpsr(0), "outside a block");
}
