//! Decoder of the Thumb loads and stores that compilers use for peripheral registers.
//!
//! Pure and without allocation: the host tests it, the shim runs it inside the HardFault entry
//! (ARMv7-M Architecture Reference Manual, A5.2.4, A5.3.5 to A5.3.10 and A7.7).
//! What a compiler never aims at a peripheral (exclusives, unprivileged, literal, floating-point and
//! program-counter loads) is not decoded: the shim reports it as a fault.

/// Direction of an access.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Direction {
    /// Memory to register.
    Load,
    /// Register to memory.
    Store,
}

/// Width of a single access on the bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Width {
    /// 8 bits.
    Byte,
    /// 16 bits.
    Half,
    /// 32 bits.
    Word,
}

impl Width {
    /// Number of bytes: 1, 2 or 4.
    #[must_use]
    pub const fn bytes(self) -> u32 {
        match self {
            Self::Byte => 1,
            Self::Half => 2,
            Self::Word => 4,
        }
    }
}

/// The registers that take part, lowest address first.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Transfer {
    /// LDR, STR and their narrow forms.
    Single(u8),
    /// LDRD, STRD.
    Pair(u8, u8),
    /// LDM, STM: bit n stands for register n, ascending registers at ascending addresses.
    Multiple(u16),
}

/// One decoded load or store with its addresses worked out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Access {
    /// Load or store.
    pub direction: Direction,
    /// Width of each transfer.
    pub width: Width,
    /// LDRSB and LDRSH extend the sign.
    pub signed: bool,
    /// Registers that are loaded or stored.
    pub transfer: Transfer,
    /// Address of the first transfer; further ones follow at +4.
    pub address: u32,
    /// Base register and its new value, for pre-indexed, post-indexed and multiple forms.
    pub write_back: Option<(u8, u32)>,
    /// Length of the instruction in bytes: 2 or 4.
    pub length: u32,
}

impl Access {
    /// A loaded value as it stands in the register: narrow loads are extended.
    #[must_use]
    pub const fn extend(&self, value: u32) -> u32 {
        match (self.width, self.signed) {
            (Width::Byte, false) => value & 0xFF,
            (Width::Byte, true) => value as u8 as i8 as i32 as u32,
            (Width::Half, false) => value & 0xFFFF,
            (Width::Half, true) => value as u16 as i16 as i32 as u32,
            (Width::Word, _) => value,
        }
    }

    /// A stored value as it goes over the bus: narrow stores are cut.
    #[must_use]
    pub const fn cut(&self, value: u32) -> u32 {
        match self.width {
            Width::Byte => value & 0xFF,
            Width::Half => value & 0xFFFF,
            Width::Word => value,
        }
    }
}

/// Decodes the instruction made of one or two half-words; `registers` are r0 to r15 at that instruction.
///
/// `second` is ignored for 16-bit instructions. `None`: not a load or store of the supported kinds.
#[must_use]
pub fn decode(first: u16, second: u16, registers: &[u32; 16]) -> Option<Access> {
    if first >> 11 >= 0b11101 {
        decode_wide(u32::from(first), u32::from(second), registers)
    } else {
        decode_narrow(u32::from(first), registers)
    }
}

/// Steps ITSTATE in a stacked xPSR over one instruction (B1.4.2: bits 26..25 and 15..10).
#[must_use]
pub const fn advance_it(xpsr: u32) -> u32 {
    let state = ((xpsr >> 25) & 0x03) | ((xpsr >> 8) & 0xFC);
    let next = if state & 0x07 == 0 { 0 } else { (state & 0xE0) | ((state << 1) & 0x1F) };
    (xpsr & !0x0600_FC00) | ((next & 0x03) << 25) | ((next & 0xFC) << 8)
}

const STACK_POINTER: u8 = 13;
const PROGRAM_COUNTER: u8 = 15;

/// r13 and r15 are never transferred: a peripheral register is no stack pointer and no code address.
const fn is_general(register: u8) -> bool {
    register != STACK_POINTER && register != PROGRAM_COUNTER
}

const fn field(value: u32, low: u32, bits: u32) -> u32 {
    (value >> low) & ((1 << bits) - 1)
}

fn register(registers: &[u32; 16], number: u32) -> u32 {
    registers[(number & 15) as usize]
}

fn decode_narrow(code: u32, registers: &[u32; 16]) -> Option<Access> {
    use Direction::{Load, Store};
    use Width::{Byte, Half, Word};
    let target = field(code, 0, 3) as u8;
    let base = register(registers, field(code, 3, 3));
    let immediate = field(code, 6, 5);
    let single = |direction, width, signed, address| {
        Some(Access {
            direction,
            width,
            signed,
            transfer: Transfer::Single(target),
            address,
            write_back: None,
            length: 2,
        })
    };
    match code >> 11 {
        0b01010 | 0b01011 => {
            let address = base.wrapping_add(register(registers, field(code, 6, 3)));
            let (direction, width, signed) = match field(code, 9, 3) {
                0 => (Store, Word, false),
                1 => (Store, Half, false),
                2 => (Store, Byte, false),
                3 => (Load, Byte, true),
                4 => (Load, Word, false),
                5 => (Load, Half, false),
                6 => (Load, Byte, false),
                _ => (Load, Half, true),
            };
            single(direction, width, signed, address)
        }
        0b01100 => single(Store, Word, false, base.wrapping_add(immediate << 2)),
        0b01101 => single(Load, Word, false, base.wrapping_add(immediate << 2)),
        0b01110 => single(Store, Byte, false, base.wrapping_add(immediate)),
        0b01111 => single(Load, Byte, false, base.wrapping_add(immediate)),
        0b10000 => single(Store, Half, false, base.wrapping_add(immediate << 1)),
        0b10001 => single(Load, Half, false, base.wrapping_add(immediate << 1)),
        0b11000 => {
            let base = field(code, 8, 3);
            multiple(Store, base, code & 0xFF, true, false, 2, registers)
        }
        0b11001 => {
            let base = field(code, 8, 3);
            // The base is written back unless it is in the list (A7.7.41).
            let write_back = code & (1 << base) == 0;
            multiple(Load, base, code & 0xFF, write_back, false, 2, registers)
        }
        _ => None,
    }
}

fn decode_wide(first: u32, second: u32, registers: &[u32; 16]) -> Option<Access> {
    let base = field(first, 0, 4);
    if base == u32::from(PROGRAM_COUNTER) {
        return None;
    }
    match first >> 8 {
        0b1111_1000 | 0b1111_1001 => decode_single(first, second, registers),
        0b1110_1000 | 0b1110_1001 if first & 0x40 != 0 => decode_pair(first, second, registers),
        0b1110_1000 | 0b1110_1001 => {
            let direction = direction_of(first);
            let (before, after) = (first & 0x0100 != 0, first & 0x0080 != 0);
            if before == after || second & 0xA000 != 0 {
                return None;
            }
            let write_back = first & 0x20 != 0;
            multiple(direction, base, second, write_back, before, 4, registers)
        }
        _ => None,
    }
}

fn direction_of(first: u32) -> Direction {
    if first & 0x10 != 0 { Direction::Load } else { Direction::Store }
}

fn decode_single(first: u32, second: u32, registers: &[u32; 16]) -> Option<Access> {
    let signed = first & 0x0100 != 0;
    let width = match (field(first, 5, 2), signed) {
        (0, _) => Width::Byte,
        (1, _) => Width::Half,
        (2, false) => Width::Word,
        _ => return None,
    };
    let direction = direction_of(first);
    let target = field(second, 12, 4) as u8;
    if !is_general(target) || (signed && direction == Direction::Store) {
        return None;
    }
    let base_number = field(first, 0, 4);
    let base = register(registers, base_number);
    let (address, write_back) = if first & 0x80 != 0 {
        (base.wrapping_add(field(second, 0, 12)), None)
    } else if second & 0x0800 != 0 {
        let (pre_indexed, add, writes_back) = (second & 0x0400 != 0, second & 0x0200 != 0, second & 0x0100 != 0);
        // 110x without write-back is the negative offset, 1110 the unprivileged form, 0x0 undefined.
        if !writes_back && (add || !pre_indexed) {
            return None;
        }
        let moved = offset(base, field(second, 0, 8), add);
        (if pre_indexed { moved } else { base }, writes_back.then_some((base_number as u8, moved)))
    } else if second & 0x0FC0 == 0 {
        let index = register(registers, field(second, 0, 4));
        (base.wrapping_add(index << field(second, 4, 2)), None)
    } else {
        return None;
    };
    Some(Access { direction, width, signed, transfer: Transfer::Single(target), address, write_back, length: 4 })
}

fn decode_pair(first: u32, second: u32, registers: &[u32; 16]) -> Option<Access> {
    let (pre_indexed, add, writes_back) = (first & 0x0100 != 0, first & 0x80 != 0, first & 0x20 != 0);
    if !pre_indexed && !writes_back {
        return None;
    }
    let (low, high) = (field(second, 12, 4) as u8, field(second, 8, 4) as u8);
    if !is_general(low) || !is_general(high) {
        return None;
    }
    let base_number = field(first, 0, 4);
    let base = register(registers, base_number);
    let moved = offset(base, field(second, 0, 8) << 2, add);
    Some(Access {
        direction: direction_of(first),
        width: Width::Word,
        signed: false,
        transfer: Transfer::Pair(low, high),
        address: if pre_indexed { moved } else { base },
        write_back: writes_back.then_some((base_number as u8, moved)),
        length: 4,
    })
}

fn offset(base: u32, offset: u32, add: bool) -> u32 {
    if add { base.wrapping_add(offset) } else { base.wrapping_sub(offset) }
}

fn multiple(
    direction: Direction,
    base_number: u32,
    list: u32,
    write_back: bool,
    decrement_before: bool,
    length: u32,
    registers: &[u32; 16],
) -> Option<Access> {
    let list = list as u16;
    if list == 0 {
        return None;
    }
    let base = register(registers, base_number);
    let span = list.count_ones() << 2;
    let moved = offset(base, span, !decrement_before);
    Some(Access {
        direction,
        width: Width::Word,
        signed: false,
        transfer: Transfer::Multiple(list),
        address: if decrement_before { moved } else { base },
        write_back: write_back.then_some((base_number as u8, moved)),
        length,
    })
}
