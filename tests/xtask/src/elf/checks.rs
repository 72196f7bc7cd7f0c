//! What must not be reached from an interrupt.

use super::code::{self, Flow, Instruction};
use super::graph::Graph;

/// One thing that is looked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Check {
    /// A panic, or an instruction that traps.
    Panic,
    /// A call through a register: what it reaches is not known.
    IndirectCall,
    /// An instruction of the floating-point unit, or a routine that stands in for one.
    FloatingPoint,
    /// A division: instruction or routine. Both take a time that depends on the numbers.
    Division,
    /// A routine that copies, fills or compares memory: a loop over bytes.
    MemoryRoutine,
    /// A raised ceiling, masked interrupts, or an exclusive access.
    Lock,
}

impl Check {
    /// What the table and the messages call it.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Panic => "panic",
            Self::IndirectCall => "indirect call",
            Self::FloatingPoint => "floating point",
            Self::Division => "division",
            Self::MemoryRoutine => "memory routine",
            Self::Lock => "lock",
        }
    }

    /// By its name a whole function is what is looked for.
    fn is_function(self, name: &str) -> bool {
        match self {
            Self::Panic => {
                ["core::panicking::", "core::option::", "core::result::"].iter().any(|path| name.starts_with(path))
                    || ["rust_begin_unwind", "__rust_start_panic", "defmt_default_panic", "_defmt_panic"]
                        .contains(&name)
                    || name.contains("panic_impl")
                    || name.contains("slice_index_fail")
            }
            Self::Division => is_routine(name) && name.contains("div") && !is_float_routine(name),
            Self::MemoryRoutine => {
                name.starts_with("__aeabi_mem")
                    || name.starts_with("compiler_builtins::mem::")
                    || ["memcpy", "memmove", "memset", "memcmp", "bcmp", "strlen"].contains(&name)
            }
            Self::FloatingPoint => is_routine(name) && is_float_routine(name),
            Self::IndirectCall | Self::Lock => false,
        }
    }

    fn is_instruction(self, instruction: &Instruction) -> bool {
        let mnemonic = instruction.mnemonic.as_str();
        match self {
            // Capstone's `trap` is `udf #254`, which the compiler puts behind a `match` whose value can be no other (an enum with gaps). A panic
            // of Rust ends in a function, which is found by its name.
            Self::Panic => instruction.flow == Flow::Trap && mnemonic != "trap",
            Self::IndirectCall => matches!(instruction.flow, Flow::CallIndirect | Flow::JumpIndirect),
            // All of them, and nothing else, begin with a v.
            Self::FloatingPoint => mnemonic.starts_with('v'),
            Self::Division => code::is(mnemonic, "sdiv") || code::is(mnemonic, "udiv"),
            Self::MemoryRoutine => false,
            Self::Lock => is_lock(instruction) || ["ldrex", "strex"].iter().any(|base| mnemonic.starts_with(base)),
        }
    }
}

/// Names of the compiler's helpers.
fn is_routine(name: &str) -> bool {
    name.starts_with("__") || name.starts_with("compiler_builtins::")
}

fn is_float_routine(name: &str) -> bool {
    let aeabi = [
        "__aeabi_f",
        "__aeabi_d",
        "__aeabi_cf",
        "__aeabi_cd",
        "__aeabi_i2",
        "__aeabi_ui2",
        "__aeabi_l2",
        "__aeabi_ul2",
    ];
    aeabi.iter().any(|prefix| name.starts_with(prefix))
        || ["df3", "sf3", "compiler_builtins::float"].iter().any(|part| name.contains(part))
}

/// Raises the ceiling or masks all interrupts. A ceiling is raised by BASEPRI_MAX, which can do nothing else; every task puts BASEPRI back at its
/// end, where it holds up nobody.
fn is_lock(instruction: &Instruction) -> bool {
    let operands = instruction.operands.as_str();
    let raises = ["basepri_max", "primask", "faultmask"].iter().any(|register| operands.starts_with(register));
    instruction.mnemonic == "msr" && raises || instruction.mnemonic.starts_with("cpsid")
}

/// Something that was looked for and found.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Finding {
    /// Of the instruction, or of the call that leads to the function.
    pub(crate) address: u32,
    /// The instruction, or the function by its name.
    pub(crate) what: String,
    /// Functions on the way from the root.
    pub(crate) path: Vec<String>,
}

/// Does the program end in a function of this name?
pub(super) fn is_end(name: &str) -> bool {
    Check::Panic.is_function(name)
}

/// Everything of this kind that can be reached; nothing is looked for inside a function that is itself found, nor behind a panic, which is a
/// finding of its own.
pub(crate) fn findings(graph: &Graph, root: usize, check: Check) -> Vec<Finding> {
    let from = graph.reachable(root);
    let mut findings = Vec::new();
    for function in from.keys().copied() {
        let path = graph.path(&from, function);
        let is_found = |name: &&str| check.is_function(name);
        let (callers, last) = path.split_at(path.len() - 1);
        if callers.iter().any(is_found) || check != Check::Panic && path.iter().any(|name| is_end(name)) {
            continue;
        }
        let path_of_names: Vec<String> = path.iter().map(|name| (*name).to_owned()).collect();
        if last.iter().any(is_found) {
            let address = from.get(&function).and_then(|caller| graph.call_site(*caller, function)).unwrap_or_default();
            findings.push(Finding { address, what: graph.name(function).to_owned(), path: path_of_names });
            continue;
        }
        let path = path_of_names;
        for instruction in graph.instructions(function).iter().filter(|found| check.is_instruction(found)) {
            let what = format!("{} {}", instruction.mnemonic, instruction.operands);
            findings.push(Finding { address: instruction.address, what, path: path.clone() });
        }
    }
    findings
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::elf::Program;

    fn found(code: &[u8], check: Check) -> Vec<String> {
        let graph = Graph::new(Program::of_code(0x0800_0100, &[("TIM6_DAC", code)])).unwrap();
        findings(&graph, 0, check).into_iter().map(|finding| finding.what).collect()
    }

    #[test]
    fn each_forbidden_instruction_is_found_by_its_check_and_by_no_other() {
        const ALL: [Check; 6] = [
            Check::Panic,
            Check::IndirectCall,
            Check::FloatingPoint,
            Check::Division,
            Check::MemoryRoutine,
            Check::Lock,
        ];
        for (code, text, check) in [
            (&[0x09, 0xde][..], "udf #9", Check::Panic),
            (&[0x98, 0x47], "blx r3", Check::IndirectCall),
            (&[0x30, 0xee, 0x20, 0x0a], "vadd.f32 s0, s0, s1", Check::FloatingPoint),
            (&[0xf1, 0xee, 0x10, 0xfa], "vmrs apsr_nzcv, fpscr", Check::FloatingPoint),
            (&[0x90, 0xfb, 0xf1, 0xf0], "sdiv r0, r0, r1", Check::Division),
            (&[0xb0, 0xfb, 0xf1, 0xf0], "udiv r0, r0, r1", Check::Division),
            (&[0x80, 0xf3, 0x12, 0x88], "msr basepri_max, r0", Check::Lock),
            (&[0x80, 0xf3, 0x10, 0x88], "msr primask, r0", Check::Lock),
            (&[0x72, 0xb6], "cpsid i", Check::Lock),
            (&[0x50, 0xe8, 0x00, 0x1f], "ldrex r1, [r0]", Check::Lock),
            (&[0x40, 0xe8, 0x00, 0x21], "strex r1, r2, [r0]", Check::Lock),
        ] {
            for other in ALL {
                let expected: &[&str] = if other == check { &[text] } else { &[] };
                assert_eq!(found(code, other), expected, "{}", other.name());
            }
        }
    }

    #[test]
    fn reading_and_restoring_the_ceiling_and_plain_arithmetic_are_found_by_no_check() {
        // mrs r0, basepri; msr basepri, r0; smull r0, r1, r2, r3; bx lr; the mark of a place that cannot be reached
        let code = [0xef, 0xf3, 0x11, 0x80, 0x80, 0xf3, 0x11, 0x88, 0x82, 0xfb, 0x03, 0x01, 0x70, 0x47, 0xfe, 0xde];
        for check in [Check::Panic, Check::IndirectCall, Check::FloatingPoint, Check::Division, Check::Lock] {
            assert_eq!(found(&code, check), [""; 0], "{}", check.name());
        }
    }

    #[test]
    fn a_routine_is_found_once_by_its_name_with_the_way_to_it() {
        for (name, check) in [
            ("core::panicking::panic_fmt", Check::Panic),
            ("core::option::unwrap_failed", Check::Panic),
            ("__aeabi_uldivmod", Check::Division),
            ("__udivmoddi4", Check::Division),
            ("compiler_builtins::int::specialized_div_rem::u64_div_rem", Check::Division),
            ("__aeabi_memcpy4", Check::MemoryRoutine),
            ("compiler_builtins::mem::memmove", Check::MemoryRoutine),
            ("__aeabi_dmul", Check::FloatingPoint),
            ("__aeabi_ddiv", Check::FloatingPoint),
        ] {
            // TIM6_DAC: bl step; bx lr. step: b.w routine. routine: udiv; udf.
            let program = Program::of_code(
                0x0800_0100,
                &[
                    ("TIM6_DAC", &[0x00, 0xf0, 0x01, 0xf8, 0x70, 0x47]),
                    ("step", &[0x00, 0xf0, 0x00, 0xb8]),
                    (name, &[0x70, 0x47]),
                ],
            );
            let found = findings(&Graph::new(program).unwrap(), 0, check);
            assert_eq!(found.len(), 1, "{name}: {found:?}");
            assert_eq!((found[0].what.as_str(), found[0].address), (name, 0x0800_0106), "the jump to it");
            assert_eq!(found[0].path, ["TIM6_DAC", "step", name]);
        }
    }

    #[test]
    fn what_lies_behind_a_panic_is_not_found_beside_it() {
        // bl panic; bx lr. Panic: udiv r0, r0, r1.
        let program = Program::of_code(
            0x0800_0100,
            &[
                ("TIM6_DAC", &[0x00, 0xf0, 0x01, 0xf8, 0x70, 0x47]),
                ("core::panicking::panic_fmt", &[0xb0, 0xfb, 0xf1, 0xf0]),
            ],
        );
        let graph = Graph::new(program).unwrap();
        assert_eq!(findings(&graph, 0, Check::Division), []);
        assert_eq!(findings(&graph, 0, Check::Panic).len(), 1);
    }

    #[test]
    fn a_floating_point_division_is_no_integer_division_and_a_divider_of_our_own_is_none() {
        assert!(!Check::Division.is_function("__aeabi_ddiv"));
        assert!(!Check::Division.is_function("servo::divider::Divider::tick"));
        assert!(!Check::MemoryRoutine.is_function("drive::error_memory::ErrorMemory::push"));
    }
}
