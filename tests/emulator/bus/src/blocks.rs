//! Exactly which instruction: time in instructions, and how a block of them is left in the middle.
//!
//! QEMU takes interrupts between blocks only. So that every interrupt comes at its very instruction, a block is left
//! * at its start, when the deadline may come within it: it goes on one instruction a block until the deadline has come;
//! * behind an access that raised an interrupt or let the deadline come nearer than the block's end;
//! * before a write to the interrupt controller, and before an instruction of several accesses touches the bus.
//!
//! The instruction that was left begins again alone in its block. An access that it has already made is not made a second time.

use crate::machine::{Raised, machine};

/// An instruction of a block, as it was translated: a number, which QEMU hands to the callback in the place of a pointer. So there is nothing
/// to fetch from memory before each of 10^8 instructions.
///
/// Bits 31..0 address, 41..32 place in the block, 51..42 instructions of the block, 52 and 53 as below.
#[derive(Clone, Copy, Debug)]
#[repr(transparent)]
pub(crate) struct Instruction(u64);

const SEVERAL: u64 = 1 << 52;
const FALLS_THROUGH: u64 = 1 << 53;
/// TCG_MAX_INSNS is 512.
const MOST_IN_A_BLOCK: u64 = 0x3FF;

impl Instruction {
    /// The instruction at `pc` with this first half-word, and its place in a block of `count`.
    pub(crate) fn new(pc: u32, code: u16, index: usize, count: usize) -> Self {
        let place = |place: usize| (place as u64).min(MOST_IN_A_BLOCK);
        let flag = |flag: u64, set: bool| if set { flag } else { 0 };
        Self(
            u64::from(pc)
                | place(index) << 32
                | place(count) << 42
                | flag(SEVERAL, accesses_several(code))
                | flag(FALLS_THROUGH, falls_through(code)),
        )
    }

    pub(crate) const fn from_number(number: u64) -> Self {
        Self(number)
    }

    pub(crate) const fn number(self) -> u64 {
        self.0
    }

    pub(crate) const fn pc(self) -> u32 {
        self.0 as u32
    }

    pub(crate) const fn index(self) -> u64 {
        self.0 >> 32 & MOST_IN_A_BLOCK
    }

    const fn count(self) -> u64 {
        self.0 >> 42 & MOST_IN_A_BLOCK
    }

    /// Is it the only one of its block?
    pub(crate) const fn is_alone(self) -> bool {
        self.count() == 1
    }

    /// The instructions behind it in its block.
    const fn rest(self) -> u64 {
        self.count() - 1 - self.index()
    }

    pub(crate) const fn accesses_several(self) -> bool {
        self.0 & SEVERAL != 0
    }

    const fn falls_through(self) -> bool {
        self.0 & FALLS_THROUGH != 0
    }
}

/// May it access memory more than once (LDM, STM, LDRD, STRD, exclusive, coprocessor; ARM DDI 0403E A5.2, A5.3)?
const fn accesses_several(code: u16) -> bool {
    code & 0xF000 == 0xC000 || code & 0xFE00 == 0xE800 || code & 0xFE00 == 0xEC00
}

/// Is the next instruction surely the one behind it? Said of plain 16-bit instructions only.
const fn falls_through(code: u16) -> bool {
    // Arithmetic on low registers, literal loads, loads and stores, addresses.
    matches!(code >> 12, 0x0..=0x3 | 0x5..=0xA) || code & 0xFC00 == 0x4000 || code & 0xF800 == 0x4800
}

/// An access that was made before its instruction was left.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Made {
    pub(crate) address: u32,
    pub(crate) value: u32,
    /// Interrupts that it raised, for [`crate::machine::Machine::pend`].
    pub(crate) raised: Option<Raised>,
}

/// An instruction that begins again.
#[derive(Clone, Copy, Debug)]
struct Again {
    pc: u32,
    made: Option<Made>,
}

/// Where the processor is.
pub(crate) struct Blocks {
    whole: bool,
    pub(crate) current: Instruction,
    /// Where in QEMU's translated code the current instruction is.
    at_host: usize,
    /// Instructions and waits since the host last answered; within an instruction, including it.
    pub(crate) ticks: u64,
    /// Before which tick the host must be asked.
    pub(crate) deadline: u64,
    /// Blocks are whole again once the deadline is farther than so many ticks.
    near: u64,
    again: Option<Again>,
    /// What the current instruction made before it was left.
    pub(crate) made: Option<Made>,
    /// How many instructions [`Blocks::prove`] has watched, and the last of them.
    proven: (u32, Instruction),
    stop: Stop,
}

/// Where the product is to stop once.
#[derive(Clone, Copy, Debug)]
struct Stop {
    /// The address, or [`NOWHERE`].
    at: u32,
    /// Instructions behind it.
    behind: u32,
    /// It has come past the address: every instruction is alone until the stop.
    near: bool,
}

impl Stop {
    /// May it be in a block of so many instructions?
    #[inline]
    const fn lies_in(&self, pc: u32, count: u64) -> bool {
        const LONGEST: u64 = 4;
        self.near || (self.at.wrapping_sub(pc) as u64) < LONGEST * count
    }
}

/// No instruction is at an odd address.
const NOWHERE: u32 = 1;

/// What stands before an instruction.
pub(crate) enum Begin {
    /// Nothing.
    Go,
    /// Nothing, and it has taken its tick before.
    Again,
    /// The deadline has come.
    Due,
    /// It is not the instruction that must come here.
    Wrong,
}

/// Instructions that are watched at the start.
const TO_PROVE: u32 = 3;

/// Alone in its block.
const NOTHING_YET: Instruction = Instruction(1 << 42);

impl Blocks {
    /// Without `whole` blocks every instruction is one of its own: slow, and the same to the bit.
    pub(crate) const fn new(whole: bool) -> Self {
        Self {
            whole,
            current: NOTHING_YET,
            at_host: 0,
            ticks: 0,
            deadline: 0,
            near: 0,
            again: None,
            made: None,
            proven: (0, NOTHING_YET),
            stop: Stop { at: NOWHERE, behind: 0, near: false },
        }
    }

    /// From now on [`Blocks::stops`] looks for this instruction; at 0 it is the current one, behind which to count.
    pub(crate) const fn stop_at(&mut self, at: u32, behind: u32) {
        self.stop = if at == 0 {
            Stop { at: NOWHERE, behind: behind.saturating_sub(1), near: behind > 0 }
        } else {
            Stop { at: at & !1, behind, near: false }
        };
    }

    /// Is the current instruction the one to stop before? Once.
    #[inline]
    pub(crate) fn stops(&mut self) -> bool {
        let comes = self.stop.near || self.stop.at == self.current.pc();
        comes && self.current.is_alone() && self.count_down()
    }

    #[cold]
    fn count_down(&mut self) -> bool {
        let Stop { behind, .. } = self.stop;
        self.stop = Stop { at: NOWHERE, behind: behind.saturating_sub(1), near: behind > 0 };
        behind == 0
    }

    /// An instruction is about to be executed; after [`Begin::Due`], [`Blocks::go_on`] follows.
    #[inline]
    pub(crate) fn begin(&mut self, this: Instruction, at_host: usize) -> Begin {
        self.current = this;
        self.at_host = at_host;
        if let Some(again) = self.again.take() {
            self.made = again.made;
            return if again.pc == this.pc() && this.is_alone() { Begin::Again } else { Begin::Wrong };
        }
        self.made = None;
        let count = this.count();
        // QEMU 7.2 has the registers in memory at the beginning of a block only: it is left there, and not at the instruction to stop before.
        if this.index() == 0 && count > 1 && self.stop.lies_in(this.pc(), count) {
            machine().leave_block(at_host);
        }
        if this.index() == 0 && count > 1 && self.ticks + count > self.deadline {
            self.near = count;
            machine().leave_block(at_host);
        }
        if self.proven.0 < TO_PROVE && !self.prove() {
            return Begin::Wrong;
        }
        if self.ticks >= self.deadline {
            return Begin::Due;
        }
        self.go_on();
        Begin::Go
    }

    /// The instruction is executed and takes a tick.
    #[inline]
    pub(crate) fn go_on(&mut self) {
        let far = self.ticks + self.near < self.deadline && !self.stop.near;
        if self.current.is_alone() && far && self.proven.0 == TO_PROVE && self.whole {
            machine().set_one_instruction(false);
        }
        self.ticks += 1;
    }

    /// The first instructions are watched, alone in their blocks: the first is that of the reset vector, and each comes once and in its order.
    fn prove(&mut self) -> bool {
        const RESET: u32 = 1;
        let this = self.current;
        if !this.is_alone() {
            machine().leave_block(self.at_host);
        }
        let (number, before) = self.proven;
        self.proven = (number + 1, this);
        match number {
            0 => this.pc() == machine().vector(RESET),
            _ if before.falls_through() => this.pc() == before.pc() + 2,
            _ => this.pc() != before.pc(),
        }
    }

    /// Leaves the block; the current instruction begins again. What it has made must not be made again.
    pub(crate) fn leave(&mut self, near: u64, made: Option<Made>) -> ! {
        self.again = Some(Again { pc: self.current.pc(), made });
        self.near = near;
        machine().leave_block(self.at_host)
    }

    /// Behind an access: may the block go on? It must not when an interrupt was raised or the deadline comes before its end.
    #[inline]
    pub(crate) fn end_access(&mut self, made: Made) {
        let rest = self.current.rest();
        if !self.current.is_alone() && (made.raised.is_some() || self.ticks + rest > self.deadline) {
            self.leave(rest, Some(made));
        }
    }
}
