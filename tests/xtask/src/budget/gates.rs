//! What is allowed: the one place for budgets and for what must not be reached from an interrupt.

use crate::elf::Check;

/// How often a task runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Rate {
    /// Every so many ns, by a timer.
    Every(u64),
    /// With the communication cycle, as often in each as the traced run shows.
    EachCycle,
    /// Not in a cycle that runs undisturbed: it has no part in the response times, and is not counted.
    OutsideTheCycle,
}

/// A task of the application.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Task {
    /// Its function in the application.
    pub(crate) name: &'static str,
    /// Symbol of its handler.
    pub(crate) vector: &'static str,
    /// Higher ones interrupt lower ones.
    pub(crate) priority: u8,
    /// How often it runs.
    pub(crate) rate: Rate,
    /// Most instructions of one activation, interrupting tasks not counted; `None`: reported only.
    pub(crate) budget: Option<u64>,
    /// Longest time from its cause to its end in ns, where its period is too long.
    pub(crate) deadline: Option<u64>,
    /// The task that it takes turns with: each comes half a period after the other.
    pub(crate) in_turn_with: Option<&'static str>,
    /// What must not be reached from it.
    pub(crate) forbidden: &'static [Check],
}

/// A function that is not inlined.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Function {
    /// A part of its name.
    pub(crate) symbol: &'static str,
    /// Most instructions of one call, with all that it calls.
    pub(crate) budget: u64,
}

/// Tasks that make one thing together.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Chain {
    /// What they make.
    pub(crate) name: &'static str,
    /// By name, one activation of each.
    pub(crate) tasks: &'static [&'static str],
    /// With the low-pass of the current command.
    pub(crate) low_pass: bool,
    /// Most instructions of all of them.
    pub(crate) budget: u64,
}

/// Highest priority of a task that shares a resource with others: nobody above waits for a critical section.
pub(crate) const CEILING: u8 = 4;

/// Handler of the task with which a communication cycle begins for the load table: t4, the quietest instant of the ring. What the telegrams of a
/// cycle have started is done by then, so that no task slips from one cycle into the other.
pub(crate) const CYCLE_BEGINS: &str = "CAN1_RX0";

/// All gates.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Gates {
    /// The tasks, in the order of the table.
    pub(crate) tasks: &'static [Task],
    /// What several tasks make together.
    pub(crate) chains: &'static [Chain],
    /// The functions.
    pub(crate) functions: &'static [Function],
    /// Largest load in tenths of a per cent.
    pub(crate) load: u64,
    /// Longest time in ns for which settings that are handed over hold the cycle up at once: with it, the AT is written within S-0-0005.
    pub(crate) hand_over: u64,
    /// Bytes that stay free between the worst of the stack and its guard, at least.
    pub(crate) stack_left: u32,
}

/// No task of the cycle may end the program, or go where nobody can follow it.
const OF_THE_CYCLE: &[Check] = &[Check::Panic, Check::IndirectCall, Check::FloatingPoint, Check::Division];
/// The current loop waits for nobody and copies nothing: all that there is.
const OF_THE_CURRENT_LOOP: &[Check] =
    &[Check::Panic, Check::IndirectCall, Check::FloatingPoint, Check::Division, Check::MemoryRoutine, Check::Lock];

/// The tasks of the application's table, and what each may take. The position cycle, the core of the current loop and the load have their limits
/// from the design; the other budgets leave about a tenth above what was measured: a binary that needs more has changed, and somebody should know
/// why.
pub(crate) const GATES: Gates = Gates {
    tasks: &[
        task("chip_interrupt_0", "EXTI3", 4, Rate::EachCycle, Some(220), OF_THE_CYCLE),
        task("chip_interrupt_1", "EXTI2", 4, Rate::EachCycle, Some(220), OF_THE_CYCLE),
        task("command_valid", "CAN1_TX", 4, Rate::EachCycle, Some(1_010), OF_THE_CYCLE),
        task("capture_feedback", "CAN1_RX0", 4, Rate::EachCycle, Some(450), OF_THE_CYCLE),
        task("current_loop", "ADC", 5, Rate::Every(62_500), Some(400), OF_THE_CURRENT_LOOP),
        // Its order is there before the second current cycle of the tick.
        Task {
            deadline: Some(62_500),
            in_turn_with: Some("velocity_loop"),
            ..task("control_loop", "CAN2_TX", 4, Rate::Every(125_000), Some(670), OF_THE_CYCLE)
        },
        Task {
            deadline: Some(62_500),
            in_turn_with: Some("control_loop"),
            ..task("velocity_loop", "CAN2_RX1", 4, Rate::Every(125_000), Some(300), OF_THE_CYCLE)
        },
        task("supervision", "CAN2_RX0", 4, Rate::Every(250_000), Some(1_560), OF_THE_CYCLE),
        task("phase_change", "CAN1_RX1", 2, Rate::OutsideTheCycle, None, &[]),
        task("service_channel", "CAN1_SCE", 2, Rate::EachCycle, None, &[]),
    ],
    chains: &[
        Chain {
            name: "position cycle with cubic, feed-forwards and friction: control_loop, current_loop",
            tasks: &["control_loop", "current_loop"],
            low_pass: false,
            // The design's figure.
            budget: 900,
        },
        Chain {
            name: "the same with a low-pass of the current command",
            tasks: &["control_loop", "current_loop"],
            low_pass: true,
            // A filter of second order takes a hundred.
            budget: 1_030,
        },
    ],
    functions: &[
        Function { symbol: "current_loop_core", budget: 160 },
        Function { symbol: "Motion<B,H>::update_state", budget: 160 },
    ],
    load: 300,
    hand_over: 10_000,
    // Another motion side on the stack of the start, 6.5 KiB, does not fit in besides: somebody should know why.
    stack_left: 20 * 1024,
};

const fn task(
    name: &'static str,
    vector: &'static str,
    priority: u8,
    rate: Rate,
    budget: Option<u64>,
    forbidden: &'static [Check],
) -> Task {
    Task { name, vector, priority, rate, budget, deadline: None, in_turn_with: None, forbidden }
}
