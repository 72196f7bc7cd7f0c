//! Who calls whom.

use super::checks::is_end;
use super::code::{self, Flow, Instruction};
use super::program::Program;
use anyhow::{Context, Result};
use std::collections::{BTreeMap, VecDeque};

/// The instructions of every function, and its calls.
#[derive(Debug)]
pub(crate) struct Graph {
    pub(crate) program: Program,
    /// One for each function of the program.
    nodes: Vec<Node>,
}

#[derive(Debug)]
struct Node {
    instructions: Vec<Instruction>,
    /// Functions that it calls or jumps to, by index.
    calls: Vec<usize>,
}

/// Bytes of stack, counted along the calls.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Depth {
    /// At most so many.
    Bytes(u32),
    /// A function calls itself, or what a register points to.
    Unbounded,
}

impl Graph {
    /// Disassembles everything.
    pub(crate) fn new(program: Program) -> Result<Self> {
        let disassembler = code::disassembler()?;
        let mut nodes = Vec::new();
        for function in program.functions() {
            let mut instructions = Vec::new();
            for (address, bytes) in program.code_of(function) {
                let more = code::instructions(&disassembler, address, bytes);
                instructions.extend(more.with_context(|| format!("in {}", function.name))?);
            }
            nodes.push(Node { instructions, calls: Vec::new() });
        }
        for (index, node) in nodes.iter_mut().enumerate() {
            let targets = node.instructions.iter().filter_map(|instruction| match instruction.flow {
                Flow::Call(target) => program.function_at(target),
                // A jump out of the function is its last call.
                Flow::Jump(target) => program.function_at(target).filter(|callee| *callee != index),
                _ => None,
            });
            node.calls = targets.collect();
            node.calls.sort_unstable();
            node.calls.dedup();
        }
        Ok(Self { program, nodes })
    }

    /// The instructions of a function.
    pub(crate) fn instructions(&self, function: usize) -> &[Instruction] {
        self.nodes.get(function).map_or(&[], |node| &node.instructions)
    }

    /// All instructions.
    pub(crate) fn all(&self) -> impl Iterator<Item = &Instruction> {
        self.nodes.iter().flat_map(|node| &node.instructions)
    }

    /// Every function that can be reached, with the one that it was reached from first.
    pub(crate) fn reachable(&self, root: usize) -> BTreeMap<usize, usize> {
        let mut from = BTreeMap::from([(root, root)]);
        let mut open = VecDeque::from([root]);
        while let Some(function) = open.pop_front() {
            for callee in &self.nodes[function].calls {
                from.entry(*callee).or_insert_with(|| {
                    open.push_back(*callee);
                    function
                });
            }
        }
        from
    }

    /// Functions that one calls or jumps to.
    pub(crate) fn calls(&self, function: usize) -> &[usize] {
        self.nodes.get(function).map_or(&[], |node| &node.calls)
    }

    /// Does a function call or jump to what a register points to?
    pub(crate) fn calls_indirectly(&self, function: usize) -> bool {
        let indirect = |flow| matches!(flow, Flow::CallIndirect | Flow::JumpIndirect);
        self.instructions(function).iter().any(|instruction| indirect(instruction.flow))
    }

    /// Bytes by which a function itself moves the stack pointer down, on all ways together.
    pub(crate) fn frame(&self, function: usize) -> u32 {
        self.instructions(function).iter().map(Instruction::pushes).sum()
    }

    /// The most that one instruction of a function takes of the stack at once.
    pub(crate) fn largest_push(&self, function: usize) -> u32 {
        self.instructions(function).iter().map(Instruction::pushes).max().unwrap_or(0)
    }

    /// Names on the way from the root to a function.
    pub(crate) fn path(&self, from: &BTreeMap<usize, usize>, mut function: usize) -> Vec<&str> {
        let mut names = vec![self.name(function)];
        while let Some(caller) = from.get(&function).filter(|caller| **caller != function) {
            function = *caller;
            names.push(self.name(function));
        }
        names.reverse();
        names
    }

    /// Address of the first instruction of `caller` that leads to `callee`.
    pub(crate) fn call_site(&self, caller: usize, callee: usize) -> Option<u32> {
        let leads = |instruction: &&Instruction| match instruction.flow {
            Flow::Call(target) | Flow::Jump(target) => self.program.function_at(target) == Some(callee),
            _ => false,
        };
        self.instructions(caller).iter().find(leads).map(|instruction| instruction.address)
    }

    /// The name of a function.
    pub(crate) fn name(&self, function: usize) -> &str {
        self.program.functions().get(function).map_or("?", |function| &function.name)
    }

    /// Stack of a function with all that it calls. Everything that is ever pushed in a function counts, also on ways that exclude each other;
    /// what a panic needs does not, because nothing comes after it.
    pub(crate) fn depth(&self, root: usize) -> Depth {
        self.deepest(root, &mut BTreeMap::new())
    }

    /// `known` holds `None` for a function that is being looked at: met again, it calls itself.
    fn deepest(&self, function: usize, known: &mut BTreeMap<usize, Option<Depth>>) -> Depth {
        match known.get(&function) {
            Some(Some(depth)) => return *depth,
            Some(None) => return Depth::Unbounded,
            None => known.insert(function, None),
        };
        let node = &self.nodes[function];
        let mut depth = if self.calls_indirectly(function) { Depth::Unbounded } else { Depth::Bytes(0) };
        for callee in node.calls.iter().filter(|callee| !is_end(self.name(**callee))) {
            depth = match (depth, self.deepest(*callee, known)) {
                (Depth::Bytes(first), Depth::Bytes(second)) => Depth::Bytes(first.max(second)),
                _ => Depth::Unbounded,
            };
        }
        let own = self.frame(function);
        if let Depth::Bytes(bytes) = &mut depth {
            *bytes += own;
        }
        known.insert(function, Some(depth));
        depth
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// a: push {r7, lr}; bl c; b.w b. b: sub sp, #16; bx lr. c: push {r4-r7, lr}; pop {r4-r7, pc}.
    fn graph() -> Graph {
        let program = Program::of_code(
            0x0800_0100,
            &[
                ("a", &[0x80, 0xb5, 0x00, 0xf0, 0x04, 0xf8, 0x00, 0xf0, 0x00, 0xb8]),
                ("b", &[0x84, 0xb0, 0x70, 0x47]),
                ("c", &[0xf0, 0xb5, 0xf0, 0xbd]),
            ],
        );
        Graph::new(program).unwrap()
    }

    #[test]
    fn calls_and_last_jumps_lead_to_other_functions() {
        let graph = graph();
        let from = graph.reachable(0);
        assert_eq!(from, BTreeMap::from([(0, 0), (1, 0), (2, 0)]));
        assert_eq!(graph.path(&from, 2), ["a", "c"]);
        assert_eq!(graph.reachable(1).len(), 1);
    }

    #[test]
    fn the_deeper_of_two_calls_counts_for_the_stack() {
        assert_eq!(graph().depth(0), Depth::Bytes(8 + 20));
        assert_eq!(graph().depth(1), Depth::Bytes(16));
    }

    #[test]
    fn a_function_that_calls_itself_has_no_depth() {
        // bl itself; bx lr
        let program = Program::of_code(0x0800_0100, &[("again", &[0xff, 0xf7, 0xfe, 0xff, 0x70, 0x47])]);
        assert_eq!(Graph::new(program).unwrap().depth(0), Depth::Unbounded);
    }

    #[test]
    fn a_jump_table_is_no_code_and_its_function_is_read_to_the_end() {
        // tbb [pc, r0]; two bytes of table; bx lr; bl behind
        let program = Program::of_code(
            0x0800_0100,
            &[
                ("chooses", &[0xdf, 0xe8, 0x00, 0xf0, 0xff, 0xff, 0x70, 0x47, 0x00, 0xf0, 0x00, 0xf8]),
                ("behind", &[0x70, 0x47]),
            ],
        )
        .with_data(0x0800_0104..0x0800_0106);
        let graph = Graph::new(program).unwrap();
        assert_eq!(graph.instructions(0).len(), 3);
        assert_eq!(graph.reachable(0).len(), 2);
    }
}
