//! Where things are in the product, and instructions that a test plants there to make it fail.

use std::path::Path;

use object::{Object, ObjectSection, ObjectSymbol, SymbolKind};

use crate::{EmulatorError, Guest};

/// `udf #0`
const UNDEFINED: u16 = 0xDE00;
/// `b .`
const FOR_EVER: u16 = 0xE7FE;
/// `bx lr`
const RETURN: u16 = 0x4770;
/// `svc #0`
const CALL: u16 = 0xDF00;
/// `wfi`
const WAIT: u16 = 0xBF30;

/// The functions of an ELF.
#[derive(Clone, Debug)]
pub struct Functions {
    /// Name as in the ELF, address without its lowest bit, bytes.
    symbols: Vec<(String, u32, u32)>,
    /// What is no function: name, address.
    data: Vec<(String, u32)>,
    /// Address of the first byte, and the code.
    code: (u32, Vec<u8>),
}

impl Functions {
    /// Reads them.
    ///
    /// # Errors
    /// The file cannot be read, or is no ELF with symbols and code.
    pub fn read(path: &Path) -> Result<Self, EmulatorError> {
        let broken = |what: String| EmulatorError::Elf { path: path.to_owned(), what };
        let elf = std::fs::read(path).map_err(|error| broken(error.to_string()))?;
        let file = object::File::parse(&*elf).map_err(|error| broken(error.to_string()))?;
        let text = file.section_by_name(".text").ok_or_else(|| broken("no section .text".into()))?;
        let code = text.data().map_err(|error| broken(error.to_string()))?.to_vec();
        let data = file.symbols().filter(|symbol| symbol.kind() != SymbolKind::Text);
        let data = data.filter_map(|symbol| Some((symbol.name().ok()?.to_owned(), symbol.address() as u32))).collect();
        let symbols = file.symbols().filter(|symbol| symbol.kind() == SymbolKind::Text);
        let symbols = symbols.filter_map(|symbol| {
            Some((symbol.name().ok()?.to_owned(), symbol.address() as u32 & !1, symbol.size() as u32))
        });
        Ok(Self { symbols: symbols.collect(), data, code: (text.address() as u32, code) })
    }

    /// The address of a function by its whole name.
    #[must_use]
    pub fn address(&self, name: &str) -> Option<u32> {
        self.symbols.iter().find(|(symbol, ..)| symbol == name).map(|(_, address, _)| *address)
    }

    /// The address of a static or of a symbol of the linker.
    #[must_use]
    pub fn data(&self, name: &str) -> Option<u32> {
        self.data.iter().find(|(symbol, _)| symbol == name).map(|(_, address)| *address)
    }

    /// The half-word at an address of the code.
    fn half(&self, address: u32) -> Option<u16> {
        let at = address.checked_sub(self.code.0)? as usize;
        let bytes = self.code.1.get(at..at + 2)?;
        Some(u16::from_le_bytes([bytes[0], bytes[1]]))
    }

    /// Every `wfi` in the function that has this in its name.
    #[must_use]
    pub fn waits_in(&self, name: &str) -> Vec<u32> {
        let Some((_, address, size)) = self.symbols.iter().find(|(symbol, ..)| symbol.contains(name)) else {
            return Vec::new();
        };
        (*address..address + size).step_by(2).filter(|at| self.half(*at) == Some(WAIT)).collect()
    }

    /// Every `wfi` of the idle task.
    #[must_use]
    pub fn waits_in_idle(&self) -> Vec<u32> {
        self.waits_in("3app4idle")
    }

    /// Instructions that put the arguments of a panic together and call it: two calls of `core::panicking::panic` shortly one after the other, of
    /// which the first returns never, so that what lies between them belongs to the second.
    #[must_use]
    pub fn panic_site(&self) -> Option<u32> {
        let panics = |name: &str| name.contains("9panicking5panic") && !name.contains("panic_");
        let target = self.symbols.iter().find(|(name, ..)| panics(name)).map(|(_, address, _)| *address)?;
        let code = self.code.0..self.code.0 + self.code.1.len() as u32 - 3;
        let calls: Vec<u32> = code.step_by(2).filter(|at| self.called_at(*at) == Some(target)).collect();
        calls.windows(2).find(|pair| (12..=32).contains(&(pair[1] - pair[0]))).map(|pair| pair[0] + 4)
    }

    /// Target of a `bl`.
    fn called_at(&self, at: u32) -> Option<u32> {
        let (first, second) = (u32::from(self.half(at)?), u32::from(self.half(at + 2)?));
        if first & 0xF800 != 0xF000 || second & 0xD000 != 0xD000 {
            return None;
        }
        let sign = first >> 10 & 1;
        let same = |bit: u32| !(second >> bit ^ sign) & 1;
        let offset = (first & 0x3FF) << 12 | (second & 0x7FF) << 1 | same(11) << 22 | same(13) << 23 | sign << 24;
        let offset = (offset << 7).cast_signed() >> 7;
        Some((at + 4).wrapping_add_signed(offset))
    }
}

/// A mistake in the program.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mistake {
    /// An instruction that is none.
    Undefined,
    /// It panics.
    Panic,
    /// It calls itself until the stack ends.
    Recursion,
    /// It calls the supervisor, which there is none.
    Call,
    /// It goes round for ever.
    Hang,
    /// It returns at once, and has done nothing.
    Silence,
}

impl Mistake {
    /// Plants it at the beginning of a function.
    ///
    /// # Errors
    /// There is no such function, or QEMU ends.
    pub fn plant(self, guest: &mut Guest, functions: &Functions, name: &str) -> Result<(), EmulatorError> {
        let missing = |what: &str| EmulatorError::Guest(format!("the ELF has no {what}"));
        let at = functions.address(name).ok_or_else(|| missing(name))?;
        let code = match self {
            Self::Undefined => vec![UNDEFINED],
            Self::Panic => jump(at, functions.panic_site().ok_or_else(|| missing("two panics in a row"))?).to_vec(),
            // push {r0-r7, lr}, and once more.
            Self::Recursion => vec![0xB5FF, 0xE7FD],
            Self::Call => vec![CALL],
            Self::Hang => vec![FOR_EVER],
            Self::Silence => vec![RETURN],
        };
        for (index, half) in code.into_iter().enumerate() {
            guest.write_instruction(at + 2 * index as u32, half)?;
        }
        Ok(())
    }

    /// Plants a mistake of one instruction in the idle task, wherever it waits for an interrupt.
    ///
    /// # Errors
    /// The mistake takes more than one instruction, the idle task does not wait, or QEMU ends.
    pub fn plant_in_idle(self, guest: &mut Guest, functions: &Functions) -> Result<(), EmulatorError> {
        let code = match self {
            Self::Undefined => UNDEFINED,
            Self::Call => CALL,
            Self::Hang => FOR_EVER,
            Self::Panic | Self::Recursion | Self::Silence => {
                return Err(EmulatorError::Guest(format!("the idle task takes no {self:?} where it waits")));
            }
        };
        let waits = functions.waits_in_idle();
        if waits.is_empty() {
            return Err(EmulatorError::Guest("the ELF's idle task does not wait for interrupts".into()));
        }
        waits.into_iter().try_for_each(|at| guest.write_instruction(at, code))
    }
}

/// `b.w` from one address to another (ARM DDI 0403E A7.7.12, T4).
fn jump(from: u32, to: u32) -> [u16; 2] {
    let offset = to.wrapping_sub(from + 4);
    let sign = offset >> 24 & 1;
    let bit = |number: u32| !(offset >> number & 1 ^ sign) & 1;
    let first = 0xF000 | sign << 10 | offset >> 12 & 0x3FF;
    let second = 0x9000 | bit(23) << 13 | bit(22) << 11 | offset >> 1 & 0x7FF;
    [first as u16, second as u16]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(code: &[u16]) -> Functions {
        let bytes = code.iter().flat_map(|half| half.to_le_bytes()).collect();
        Functions { symbols: Vec::new(), data: Vec::new(), code: (0x0800_0000, bytes) }
    }

    #[test]
    fn a_jump_goes_where_it_should() {
        // As an assembler makes them: b.w to itself, 16 MiB less two forwards and backwards.
        assert_eq!(jump(0x0800_0000, 0x0800_0000), [0xF7FF, 0xBFFE]);
        assert_eq!(jump(0x0800_0000, 0x0800_0104), [0xF000, 0xB880]);
        // A call is a jump with one more bit: both ways through.
        for to in [0x0800_0000_u32, 0x0800_0104, 0x0880_0000, 0x0780_0000, 0x0845_6788] {
            let [first, second] = jump(0x0800_0000, to);
            assert_eq!(of(&[first, second | 0x4000]).called_at(0x0800_0000), Some(to));
        }
    }

    #[test]
    fn the_second_of_two_neighbouring_panics_is_found_with_its_arguments() {
        // bl +0x100 at 0; arguments; bl to the same.
        let call = |from: u32, to: u32| jump(from, to).map(|half| half | 0x4000);
        let mut code = vec![0xBF00; 0x100];
        let second = |half: u16| if half & 0x8000 != 0 { half } else { 0 };
        assert_eq!(second(0xD000), 0xD000);
        for at in [0x20_u32, 0x38] {
            let halves = call(0x0800_0000 + at, 0x0800_0100);
            code[at as usize / 2] = halves[0];
            code[at as usize / 2 + 1] = halves[1];
        }
        let mut functions = of(&code);
        functions.symbols = vec![("_RNvNtCs_4core9panicking5panic".into(), 0x0800_0100, 4)];
        assert_eq!(functions.panic_site(), Some(0x0800_0024));
        functions.symbols[0].0 = "_RNvNtCs_4core9panicking9panic_fmt".into();
        assert_eq!(functions.panic_site(), None);
    }
}
