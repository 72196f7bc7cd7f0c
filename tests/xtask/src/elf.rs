//! The release ELF, read as the processor will: functions, instructions, who calls whom, and what must not be in it.

mod checks;
mod code;
mod graph;
mod program;
mod stack;

pub(crate) use checks::{Check, Finding, findings};
pub(crate) use code::{Flow, Instruction};
pub(crate) use graph::{Depth, Graph};
pub(crate) use program::Program;
pub(crate) use stack::{bound, of_start, only_at_start};
