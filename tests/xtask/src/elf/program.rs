//! What the ELF says about itself: functions by name, where code is and where data lies in between, the vector table.

use anyhow::{Context, Result, bail};
use object::{Object, ObjectSection, ObjectSymbol, SymbolKind};

/// A function.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Function {
    /// As the source has it, without the hash.
    pub(crate) name: String,
    /// Of its first instruction.
    pub(crate) address: u32,
    /// Behind its last byte.
    pub(crate) end: u32,
}

/// The parts of an ELF that matter here.
#[derive(Clone, Debug, Default)]
pub(crate) struct Program {
    /// By address, without overlap.
    functions: Vec<Function>,
    /// All names of functions, also of those that share their code; mangled.
    names: Vec<(String, u32)>,
    /// Where code begins (`true`) or data (`false`), by address: constants and jump tables lie between the instructions.
    marks: Vec<(u32, bool)>,
    /// Address and bytes of the sections with code.
    sections: Vec<(u32, Vec<u8>)>,
    /// Words of the vector table.
    vectors: Vec<u32>,
    /// Words of the constants that are the address of a function: tables of functions, virtual and others.
    taken: Vec<u32>,
    /// Bytes of the statics whose name contains this, by their mangled names.
    statics: Vec<(String, u32)>,
}

impl Program {
    pub(crate) fn parse(elf: &[u8]) -> Result<Self> {
        let file = object::File::parse(elf).context("the program is not an ELF file")?;
        let mut program = Self::default();
        for section in file.sections().filter(|section| section.kind() == object::SectionKind::Text) {
            let bytes = section.data().context("a section of the program cannot be read")?;
            program.sections.push((section.address() as u32, bytes.to_vec()));
        }
        let table = file.section_by_name(".vector_table").context("the program has no section .vector_table")?;
        let words = table.data().context("the vector table cannot be read")?.chunks_exact(4);
        program.vectors = words.map(|word| u32::from_le_bytes([word[0], word[1], word[2], word[3]])).collect();
        for section in file.sections() {
            let name = section.name().unwrap_or_default();
            if ![".rodata", ".data"].contains(&name) {
                continue;
            }
            let words = section.data().context("the constants of the program cannot be read")?.chunks_exact(4);
            program.taken.extend(words.map(|word| u32::from_le_bytes([word[0], word[1], word[2], word[3]])));
        }
        program.taken.retain(|word| word & 1 == 1);
        program.taken.sort_unstable();
        program.taken.dedup();
        let mut functions = Vec::new();
        for symbol in file.symbols() {
            if symbol.kind() == SymbolKind::Data {
                program.statics.extend(symbol.name().map(|name| (name.to_owned(), symbol.size() as u32)));
            }
            let (Ok(name), address) = (symbol.name(), symbol.address() as u32 & !1) else { continue };
            match name.get(..2) {
                Some("$t") => program.marks.push((address, true)),
                Some("$d") => program.marks.push((address, false)),
                _ if symbol.kind() == SymbolKind::Text => {
                    program.names.push((name.to_owned(), address));
                    functions.push((address, symbol.size() as u32, name.to_owned()));
                }
                _ => {}
            }
        }
        program.marks.sort_unstable();
        program.place(functions);
        if program.functions.is_empty() || program.marks.is_empty() {
            bail!("the program has no symbols: build it without `strip`");
        }
        Ok(program)
    }

    /// One function for each address; one without a size (assembly) ends where the next begins.
    fn place(&mut self, mut functions: Vec<(u32, u32, String)>) {
        functions.sort_unstable();
        functions.dedup_by_key(|function| function.0);
        let next: Vec<Option<u32>> =
            (1..=functions.len()).map(|index| functions.get(index).map(|next| next.0)).collect();
        for ((address, size, name), next) in functions.into_iter().zip(next) {
            let Some((start, bytes)) = self.section_of(address) else { continue };
            let limit = next.unwrap_or(u32::MAX).min(start + bytes.len() as u32);
            let end = if size == 0 { limit } else { limit.min(address + size) };
            self.functions.push(Function { name: demangled(&name), address, end });
        }
    }

    fn section_of(&self, address: u32) -> Option<&(u32, Vec<u8>)> {
        self.sections.iter().find(|(start, bytes)| (*start..start + bytes.len() as u32).contains(&address))
    }

    /// All functions, by address.
    pub(crate) fn functions(&self) -> &[Function] {
        &self.functions
    }

    /// Functions whose address lies among the constants: what a call through a register can reach. Those whose address is only ever put together by
    /// instructions are not found.
    pub(crate) fn taken(&self) -> Vec<usize> {
        let begins = |word: &u32| self.functions.binary_search_by_key(&(word & !1), |function| function.address).ok();
        self.taken.iter().filter_map(begins).collect()
    }

    /// Bytes of the static with this in its name.
    pub(crate) fn bytes_of_static(&self, part: &str) -> Option<u32> {
        self.statics.iter().find(|(name, _)| name.contains(part)).map(|(_, bytes)| *bytes)
    }

    /// Index of the function in whose code an address lies.
    pub(crate) fn function_at(&self, address: u32) -> Option<usize> {
        let index = self.functions.partition_point(|function| function.address <= address).checked_sub(1)?;
        (address < self.functions[index].end).then_some(index)
    }

    /// Address of the handler with the name of a vector, and the number of its exception (16 + number of the interrupt).
    ///
    /// `None` if there is no such symbol, or nothing but the default handler behind it.
    pub(crate) fn vector(&self, name: &str) -> Option<(u32, u16)> {
        let address_of = |wanted: &str| self.names.iter().find(|(name, _)| name == wanted).map(|(_, address)| *address);
        let address = address_of(name)?;
        if address_of("DefaultHandler") == Some(address) && name != "DefaultHandler" {
            return None;
        }
        let number = self.vectors.iter().skip(1).position(|vector| vector & !1 == address)? + 1;
        Some((address, u16::try_from(number).ok()?))
    }

    /// The pieces of a function that are code, with their addresses.
    pub(crate) fn code_of(&self, function: &Function) -> Vec<(u32, &[u8])> {
        let Some((start, bytes)) = self.section_of(function.address) else { return Vec::new() };
        let first = self.marks.partition_point(|mark| mark.0 <= function.address);
        let inside = self.marks[first..].iter().take_while(|mark| mark.0 < function.end);
        let mut is_code = first.checked_sub(1).is_none_or(|before| self.marks[before].1);
        let mut from = function.address;
        let mut pieces = Vec::new();
        for (to, code_follows) in inside.copied().chain([(function.end, false)]) {
            if is_code && to > from {
                pieces.extend(bytes.get((from - start) as usize..(to - start) as usize).map(|bytes| (from, bytes)));
            }
            (from, is_code) = (to, code_follows);
        }
        pieces
    }

    /// A program of given code, for tests: functions one behind the other from `address`.
    #[cfg(test)]
    pub(crate) fn of_code(address: u32, functions: &[(&str, &[u8])]) -> Self {
        let mut program = Self { marks: vec![(address, true)], ..Self::default() };
        let mut bytes = Vec::new();
        for (name, code) in functions {
            let start = address + bytes.len() as u32;
            bytes.extend_from_slice(code);
            let function = Function { name: (*name).to_owned(), address: start, end: address + bytes.len() as u32 };
            program.names.push((function.name.clone(), start));
            program.functions.push(function);
        }
        program.sections.push((address, bytes));
        program
    }

    /// The same with data from here to there.
    #[cfg(test)]
    pub(crate) fn with_data(mut self, data: std::ops::Range<u32>) -> Self {
        self.marks.extend([(data.start, false), (data.end, true)]);
        self.marks.sort_unstable();
        self
    }
}

/// Without hash and crate disambiguators.
fn demangled(name: &str) -> String {
    format!("{:#}", rustc_demangle::demangle(name))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_not_an_elf_file_is_refused() {
        assert!(Program::parse(b"no program").unwrap_err().to_string().contains("not an ELF file"));
    }

    #[test]
    fn an_address_belongs_to_the_function_around_it() {
        let program = Program::of_code(0x100, &[("first", &[0; 4]), ("second", &[0; 6])]);
        assert_eq!(program.function_at(0xfe), None);
        assert_eq!(program.function_at(0x100), Some(0));
        assert_eq!(program.function_at(0x103), Some(0));
        assert_eq!(program.function_at(0x104), Some(1));
        assert_eq!(program.function_at(0x10a), None);
    }

    #[test]
    fn data_between_the_instructions_is_no_code() {
        let program = Program::of_code(0x100, &[("table", &[1, 2, 3, 4, 5, 6, 7, 8])]).with_data(0x102..0x106);
        let pieces = program.code_of(&program.functions()[0]);
        assert_eq!(pieces, [(0x100, &[1, 2][..]), (0x106, &[7, 8][..])]);
    }

    #[test]
    fn names_are_shown_as_in_the_source() {
        assert_eq!(demangled("_RNvNtCs7ldSeZOOJos_4core9panicking9panic_fmt"), "core::panicking::panic_fmt");
        assert_eq!(demangled("TIM6_DAC"), "TIM6_DAC");
    }
}
