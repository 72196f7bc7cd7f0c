//! Holds what was measured and found against the gates.

use super::gates::{CEILING, CYCLE_BEGINS, Chain, Gates, Rate, Task};
use super::response::{self, Load};
use crate::elf::{self, Check, Depth, Finding, Flow, Graph, Instruction};
use anyhow::{Result, bail};
use bench::traced::CYCLE;
use bench::{StackUse, Traced};
use emulator::{Demand, Listing, Price, Spread, Step, TaskCount};
use std::collections::HashMap;

/// The core clock, and an access to the ring controller with its slowest timing.
pub(crate) const PRICE: Price = Price { core_megahertz: 168, bus_access: 550 };

/// Addresses of the external bus.
const SLOW_BUS: std::ops::Range<u32> = 0x6000_0000..0x7000_0000;

/// A task with all that is known of it.
#[derive(Clone, Debug)]
pub(crate) struct TaskReport {
    pub(crate) task: Task,
    /// What was counted; `None` if it did not run while traced.
    pub(crate) count: Option<TaskCount>,
    /// `None` if the vector has no handler.
    pub(crate) found: Option<StaticReport>,
    /// Blocking and response time in ns, where the task takes part.
    pub(crate) timing: Option<Timing>,
}

/// What the ELF shows of a task.
#[derive(Clone, Debug)]
pub(crate) struct StaticReport {
    /// Functions that can be reached, itself included.
    pub(crate) functions: usize,
    /// Stack of all of them, without the frame of the exception.
    pub(crate) stack: Depth,
    /// What was found, for each check.
    pub(crate) findings: Vec<(Check, Vec<Finding>)>,
}

/// Times of a task in ns.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Timing {
    pub(crate) load: Load,
    /// Share of the processor, in tenths of a per cent.
    pub(crate) share: u64,
    pub(crate) blocking: u64,
    pub(crate) response: Option<u64>,
}

/// A function with its count.
#[derive(Clone, Debug)]
pub(crate) struct FunctionReport {
    pub(crate) symbol: &'static str,
    pub(crate) budget: u64,
    /// Is there a function with that name?
    pub(crate) present: bool,
    pub(crate) count: Option<Spread>,
}

/// Tasks that make one thing together, with the sum of their counts.
#[derive(Clone, Debug)]
pub(crate) struct ChainReport {
    pub(crate) chain: Chain,
    /// `None` if one of them did not run while traced.
    pub(crate) count: Option<Spread>,
}

/// The stack: what the worst nesting of priorities needs, what a run has used, and what there is.
#[derive(Clone, Debug)]
pub(crate) struct StackReport {
    /// The start, before an interrupt can come.
    pub(crate) start: u32,
    /// The deepest of each priority, 0 is the end of the start, or idle; without the frames of the exceptions that interrupt it.
    pub(crate) levels: Vec<(u8, &'static str, u32)>,
    pub(crate) measured: StackUse,
    /// The largest frame of a function that runs with the guard, and its name.
    pub(crate) largest_frame: (String, u32),
    /// What the fault handler needs, and bytes of its own stack.
    pub(crate) fault_handler: (u32, u32),
}

impl StackReport {
    /// Bytes of the worst nesting, or of the start.
    pub(crate) fn bound(&self) -> u32 {
        let nested = self.levels.iter().map(|(.., bytes)| bytes + EXCEPTION_FRAME).sum();
        self.start.max(nested)
    }
}

/// An exception stacks so much of the one that it interrupts, with floating point and its alignment (ARM DDI 0403E B1.5.7).
const EXCEPTION_FRAME: u32 = 108;

/// What a parameter that is written costs the tasks of the cycle, in ns. It is seldom, so that it is no part of their response times.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct HandOver {
    /// The longest time for which they are held up at once.
    pub(crate) longest: u64,
    /// The longest response of one of them then; `None`: longer than its period.
    pub(crate) response: Option<u64>,
}

/// All of it.
#[derive(Clone, Debug)]
pub(crate) struct Report {
    pub(crate) tasks: Vec<TaskReport>,
    pub(crate) chains: Vec<ChainReport>,
    pub(crate) functions: Vec<FunctionReport>,
    pub(crate) stack: Option<StackReport>,
    pub(crate) hand_over: Option<HandOver>,
    /// One line for each gate that does not hold.
    pub(crate) failures: Vec<String>,
}

pub(crate) const CHECKS: [Check; 6] =
    [Check::Panic, Check::IndirectCall, Check::FloatingPoint, Check::Division, Check::MemoryRoutine, Check::Lock];

/// BASEPRI of a lock up to this priority, as RTIC sets it with the part's four bits (ARM DDI 0403E B1.4.3).
const fn masked_up_to(priority: u8) -> u32 {
    (16 - priority as u32) << 4
}

/// The constants in registers, as far as straight code tells: for the ceiling of a lock, which is loaded just before it.
#[derive(Debug, Default)]
struct Constants(HashMap<String, u32>);

impl Constants {
    fn of_source(&self, instruction: &Instruction) -> Option<u32> {
        let source = instruction.operands.strip_prefix("basepri_max, ").filter(|_| instruction.mnemonic == "msr")?;
        self.0.get(source).copied()
    }

    fn follow(&mut self, instruction: &Instruction) {
        if instruction.flow != Flow::Next {
            self.0.clear();
            return;
        }
        let Some((first, rest)) = instruction.operands.split_once(", ") else { return };
        let number = rest.strip_prefix('#').and_then(|number| match number.strip_prefix("0x") {
            Some(digits) => u32::from_str_radix(digits, 16).ok(),
            None => number.parse().ok(),
        });
        let is_move = matches!(instruction.mnemonic.as_str(), "mov" | "movs" | "movw");
        match number.filter(|_| is_move) {
            Some(number) => drop(self.0.insert(first.to_owned(), number)),
            // Stores and comparisons change no register; to forget one too many makes a lock the longer.
            None => drop(self.0.remove(first)),
        }
    }
}

/// What the count must know of the program.
pub(crate) fn listing(graph: &Graph, gates: Gates) -> Result<Listing> {
    let mut steps = HashMap::new();
    let mut constants = Constants::default();
    for instruction in graph.all() {
        let below = constants.of_source(instruction).is_some_and(|masked| masked > masked_up_to(CEILING));
        constants.follow(instruction);
        let step = match instruction.flow {
            Flow::Call(_) | Flow::CallIndirect => Step::Call(instruction.address + instruction.length),
            // Holds up nobody of the cycle. What ends it finds no lock to end.
            _ if below => continue,
            _ if instruction.mnemonic == "msr" && instruction.operands.starts_with("basepri_max") => Step::Lock,
            _ if instruction.mnemonic == "msr" && instruction.operands.starts_with("basepri") => Step::Unlock,
            _ => continue,
        };
        steps.insert(instruction.address, step);
    }
    if steps.is_empty() {
        bail!("the program has no calls: the ELF is not the drive's");
    }
    let wanted = |name: &str| gates.functions.iter().any(|function| name.contains(function.symbol));
    let functions = graph.program.functions().iter().filter(|function| wanted(&function.name));
    let functions = functions.map(|function| (function.address, function.name.clone())).collect();
    let cycle = graph.program.vector(CYCLE_BEGINS).map(|(_, exception)| exception);
    Ok(Listing { steps, functions, slow_bus: SLOW_BUS, price: PRICE, cycle, profiled: None })
}

/// Judges.
pub(crate) fn judge(graph: &Graph, traced: &Traced, gates: Gates) -> Report {
    let mut report = Report {
        tasks: Vec::new(),
        chains: Vec::new(),
        functions: Vec::new(),
        stack: None,
        hand_over: None,
        failures: Vec::new(),
    };
    for task in gates.tasks {
        let vector = graph.program.vector(task.vector);
        let count = vector.and_then(|(_, exception)| traced.activations.tasks().get(&exception).copied());
        let found = vector.and_then(|(address, _)| static_report(graph, address));
        report.tasks.push(TaskReport { task: *task, count, found, timing: None });
    }
    add_timing(&mut report.tasks, locked_by(traced.activations.thread()));
    report.hand_over = hand_over(graph, traced, gates, &report.tasks);
    for function in gates.functions {
        let of_name = |name: &str| name.contains(function.symbol);
        let present = graph.program.functions().iter().any(|function| of_name(&function.name));
        let counts = traced.activations.functions().iter().filter(|(name, _)| of_name(name));
        let count = counts.map(|(_, count)| *count).reduce(merged);
        report.functions.push(FunctionReport { symbol: function.symbol, budget: function.budget, present, count });
    }
    let exceptions = |name: &str| {
        let task = gates.tasks.iter().find(|task| task.name == name)?;
        graph.program.vector(task.vector).map(|(_, exception)| exception)
    };
    report.chains = gates
        .chains
        .iter()
        .map(|&chain| {
            let activations = if chain.low_pass { &traced.activations } else { &traced.without_low_pass };
            let count = |name: &str| activations.tasks().get(&exceptions(name)?).map(|count| count.own);
            ChainReport { chain, count: chained(chain, count) }
        })
        .collect();
    report.failures = report.tasks.iter().flat_map(failures_of_task).collect();
    report.failures.extend(report.chains.iter().filter_map(failure_of_chain));
    report.failures.extend(failure_of_load(load(&report.tasks), gates.load));
    report.failures.extend(report.functions.iter().filter_map(failure_of_function));
    report.failures.extend(failure_of_hand_over(report.hand_over, gates.hand_over));
    report.stack = stack_report(graph, gates, traced.stack);
    match &report.stack {
        Some(stack) => report.failures.extend(failures_of_stack(stack, gates.stack_left)),
        None => report.failures.push("the stack: the ELF has no `main`, `HardFault` or FAULT_STACK".into()),
    }
    report
}

/// Where everything begins.
const START: &str = "main";

fn stack_report(graph: &Graph, gates: Gates, measured: StackUse) -> Option<StackReport> {
    let named = |name: &str| graph.program.functions().iter().position(|function| function.name == name);
    let main = named(START)?;
    let start = elf::of_start(graph, main);
    let mut roots = Vec::new();
    let mut levels = vec![(0, "end of the start, idle", start.interrupted)];
    for task in gates.tasks {
        let root = graph.program.vector(task.vector).and_then(|(address, _)| graph.program.function_at(address))?;
        roots.push(root);
        let needed = elf::bound(graph, root);
        match levels.iter_mut().find(|(priority, ..)| *priority == task.priority) {
            Some(level) if level.2 >= needed => {}
            Some(level) => *level = (task.priority, task.name, needed),
            None => levels.push((task.priority, task.name, needed)),
        }
    }
    levels.sort_unstable();
    let functions = graph.program.functions().iter().enumerate();
    let only_at_start = elf::only_at_start(graph, main, &roots);
    let guarded = functions.filter(|(index, _)| !only_at_start.contains(index));
    let frames = guarded.map(|(index, function)| (function.name.clone(), graph.largest_push(index)));
    let largest_frame = frames.max_by_key(|(_, bytes)| *bytes)?;
    let fault_handler = (elf::bound(graph, named("HardFault")?), graph.program.bytes_of_static("FAULT_STACK")?);
    Some(StackReport { start: start.alone, levels, measured, largest_frame, fault_handler })
}

fn failures_of_stack(stack: &StackReport, to_be_left: u32) -> Vec<String> {
    let StackUse { used, room, guard } = stack.measured;
    let bound = stack.bound();
    let (name, frame) = &stack.largest_frame;
    let (needed, there) = stack.fault_handler;
    let checks = [
        (
            bound + to_be_left <= room,
            format!("the stack needs {bound} bytes at most, {room} are there: {to_be_left} of them have to be left"),
        ),
        (used <= bound, format!("the stack was {used} bytes deep, and {bound} is the bound: the bound is wrong")),
        (used >= bound / 8, format!("the stack was {used} bytes deep of a bound of {bound}: nothing was measured")),
        (
            frame + EXCEPTION_FRAME <= guard,
            format!("{name} takes {frame} bytes at once, the guard has {guard}: it could step over the guard"),
        ),
        (needed <= there, format!("the fault handler needs {needed} bytes of stack and has {there}")),
    ];
    checks.into_iter().filter(|(fine, _)| !fine).map(|(_, failure)| failure).collect()
}

/// One activation of each task, at least, at most and on average: as if they all had their longest one at once.
fn chained(chain: Chain, of_task: impl Fn(&str) -> Option<Spread>) -> Option<Spread> {
    let counts: Vec<Spread> = chain.tasks.iter().map(|name| of_task(name)).collect::<Option<_>>()?;
    let count = counts.iter().map(|count| count.count).min()?;
    Some(Spread {
        count,
        least: counts.iter().map(|count| count.least).sum(),
        most: counts.iter().map(|count| count.most).sum(),
        sum: counts.iter().map(Spread::mean).sum::<u64>() * count,
    })
}

/// Of all tasks, in tenths of a per cent.
pub(crate) fn load(tasks: &[TaskReport]) -> u64 {
    tasks.iter().filter_map(|report| report.timing).map(|timing| timing.share).sum()
}

fn static_report(graph: &Graph, address: u32) -> Option<StaticReport> {
    let root = graph.program.function_at(address)?;
    Some(StaticReport {
        functions: graph.reachable(root).len(),
        stack: graph.depth(root),
        findings: CHECKS.map(|check| (check, elf::findings(graph, root, check))).to_vec(),
    })
}

fn merged(first: Spread, second: Spread) -> Spread {
    Spread {
        count: first.count + second.count,
        least: first.least.min(second.least),
        most: first.most.max(second.most),
        sum: first.sum + second.sum,
    }
}

/// Longest critical section, in ns.
fn locked_by(count: &TaskCount) -> u64 {
    PRICE.nanoseconds(count.worst.lock)
}

fn hand_over(graph: &Graph, traced: &Traced, gates: Gates, tasks: &[TaskReport]) -> Option<HandOver> {
    let background = gates.tasks.iter().filter(|task| task.priority < CEILING);
    let locks = background.filter_map(|task| {
        let (_, exception) = graph.program.vector(task.vector)?;
        traced.written.tasks().get(&exception).map(locked_by)
    });
    let longest = locks.max()?;
    let mut tasks = tasks.to_vec();
    add_timing(&mut tasks, longest);
    let of_the_cycle = tasks.iter().filter(|report| report.task.priority == CEILING);
    let responses: Option<Vec<u64>> =
        of_the_cycle.filter_map(|report| report.timing).map(|timing| timing.response).collect();
    Some(HandOver { longest, response: responses.and_then(|responses| responses.into_iter().max()) })
}

fn failure_of_hand_over(hand_over: Option<HandOver>, limit: u64) -> Option<String> {
    let us = |ns: u64| ns as f64 / 1e3;
    match hand_over {
        None => Some("the hand-over of settings did not run while it was traced: nothing is known of it".into()),
        Some(HandOver { longest, .. }) if longest > limit => Some(format!(
            "the hand-over of settings holds the cycle up for {:.1} us at once, {:.1} us are allowed",
            us(longest),
            us(limit)
        )),
        Some(HandOver { response: None, .. }) => {
            Some("a task of the cycle is not done within its period while settings are handed over".into())
        }
        Some(_) => None,
    }
}

/// What a task asks for between two of its causes, or groups of causes: how long they are apart, and what it asks for.
fn demand(report: &TaskReport) -> Option<(u64, Demand)> {
    let worst = report.count?.worst;
    match report.task.rate {
        Rate::Every(period) => Some((period, worst.activation)),
        Rate::EachCycle => Some((CYCLE.0, worst.cycle)),
        Rate::OutsideTheCycle => None,
    }
}

/// `thread`: the longest critical section of the thread, in ns.
fn add_timing(tasks: &mut [TaskReport], thread: u64) {
    let load = |report: &TaskReport| {
        let (period, demand) = demand(report)?;
        Some(Load {
            priority: report.task.priority,
            period,
            demand: PRICE.nanoseconds(demand),
            locked: locked_by(&report.count?),
            ceiling: CEILING,
            in_turn_with: None,
        })
    };
    let (places, set): (Vec<usize>, Vec<Load>) =
        tasks.iter().enumerate().filter_map(|(place, report)| Some((place, load(report)?))).unzip();
    let mut set = set;
    for (load, &place) in set.iter_mut().zip(&places) {
        let partner = tasks[place].task.in_turn_with;
        load.in_turn_with = places.iter().position(|&other| Some(tasks[other].task.name) == partner);
    }
    // The thread is below all of them; it takes nothing away but while it locks.
    let thread =
        Load { priority: 0, period: u64::MAX, demand: 0, locked: thread, ceiling: CEILING, in_turn_with: None };
    set.push(thread);
    for (index, place) in places.into_iter().enumerate() {
        let (blocking, response) = (response::blocking(&set, index), response::response(&set, index));
        let cycle = tasks[place].count.map_or(0, |count| PRICE.nanoseconds(count.worst.cycle));
        let share = response::share(cycle, CYCLE.0);
        tasks[place].timing = Some(Timing { load: set[index], share, blocking, response });
    }
}

fn failures_of_task(report: &TaskReport) -> Vec<String> {
    let Task { name, vector, budget, forbidden, rate, deadline, .. } = report.task;
    let Some(found) = &report.found else {
        return vec![format!(
            "{name}: the vector {vector} has no handler in the ELF; bind the task or take its gate out"
        )];
    };
    let mut failures = Vec::new();
    match (budget, report.count) {
        (Some(budget), Some(count)) if count.own.most > budget => {
            failures.push(format!("{name} ({vector}) takes {} instructions, {budget} are its budget", count.own.most));
        }
        (Some(_), None) => {
            failures.push(format!("{name} ({vector}) did not run while it was traced: nothing is known of it"))
        }
        _ => {}
    }
    let period = match rate {
        Rate::Every(period) => period,
        _ => CYCLE.0,
    };
    match (report.timing.map(|timing| timing.response), deadline) {
        (Some(None), _) => {
            failures.push(format!("{name} ({vector}) is not always done within its period of {} us", period / 1_000));
        }
        (Some(Some(response)), Some(deadline)) if response > deadline => failures.push(format!(
            "{name} ({vector}) takes {:.1} us from its cause to its end, {:.1} us are there",
            response as f64 / 1e3,
            deadline as f64 / 1e3
        )),
        _ => {}
    }
    for (check, findings) in found.findings.iter().filter(|(check, _)| forbidden.contains(check)) {
        if let Some(first) = findings.first() {
            failures.push(format!(
                "{name} ({vector}) reaches {} {}: the first is `{}` at {:#010x}, by {}",
                findings.len(),
                check.name(),
                first.what.trim(),
                first.address,
                first.path.join(" > ")
            ));
        }
    }
    failures
}

fn failure_of_chain(report: &ChainReport) -> Option<String> {
    let Chain { name, budget, .. } = report.chain;
    match report.count {
        None => Some(format!("{name}: one of the tasks did not run while it was traced: nothing is known of it")),
        Some(count) if count.most > budget => {
            Some(format!("{name}: {} instructions together, {budget} are their budget", count.most))
        }
        Some(_) => None,
    }
}

fn failure_of_load(load: u64, limit: u64) -> Option<String> {
    let percent = |tenths: u64| format!("{}.{} %", tenths / 10, tenths % 10);
    (load > limit).then(|| format!("the load is {}, {} is the limit", percent(load), percent(limit)))
}

fn failure_of_function(report: &FunctionReport) -> Option<String> {
    let FunctionReport { symbol, budget, present, count } = report;
    match count {
        _ if !present => {
            Some(format!("no function has {symbol} in its name: mark it #[inline(never)], or take its gate out"))
        }
        None => Some(format!("{symbol} was not called while traced: nothing is known of it")),
        Some(count) if count.most > *budget => {
            Some(format!("{symbol} takes {} instructions, {budget} are its budget", count.most))
        }
        Some(_) => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_ceiling_of_a_lock_is_the_constant_that_was_loaded_last_into_its_register() {
        let instruction = |mnemonic: &str, operands: &str, flow| Instruction {
            address: 0,
            length: 2,
            mnemonic: mnemonic.into(),
            operands: operands.into(),
            flow,
        };
        let next = |mnemonic: &str, operands: &str| instruction(mnemonic, operands, Flow::Next);
        let lock = next("msr", "basepri_max, r1");
        let after = |before: &[Instruction]| {
            let mut constants = Constants::default();
            before.iter().for_each(|one| constants.follow(one));
            constants.of_source(&lock)
        };
        assert_eq!(after(&[next("movs", "r1, #0xe0"), next("mrs", "r0, basepri")]), Some(0xE0));
        assert_eq!(after(&[next("movs", "r1, #192")]), Some(0xC0));
        assert_eq!(after(&[next("movs", "r1, #0xe0"), next("adds", "r1, #1")]), None);
        assert_eq!(after(&[next("movs", "r1, #0xe0"), instruction("bl", "#0x100", Flow::Call(0x100))]), None);
        assert_eq!(after(&[next("movs", "r0, #0xe0")]), None);
        assert_eq!((masked_up_to(2), masked_up_to(4)), (0xE0, 0xC0));
    }

    fn once(value: u64) -> Spread {
        Spread { count: 1, least: value, most: value, sum: value }
    }

    fn counted(instructions: u64) -> TaskCount {
        let demand = Demand { activations: 1, instructions, bus: 0 };
        let mut count = TaskCount { own: once(instructions), bus: once(0), ..TaskCount::default() };
        (count.worst.activation, count.worst.cycle) = (demand, demand);
        count
    }

    fn stack() -> StackReport {
        StackReport {
            start: 1_100,
            levels: vec![(0, "end of the start, idle", 1_000), (5, "tick", 500)],
            measured: StackUse { used: 1_200, room: 1_816, guard: 1_024 },
            largest_frame: ("step".into(), 900),
            fault_handler: (400, 512),
        }
    }

    #[test]
    fn the_frames_of_exceptions_are_part_of_the_bound() {
        assert_eq!(stack().bound(), 1_500 + 2 * 108);
        assert_eq!(StackReport { start: 1_800, ..stack() }.bound(), 1_800);
        assert_eq!(failures_of_stack(&stack(), 100), [""; 0]);
    }

    #[test]
    fn a_stack_that_is_too_small_a_bound_that_is_wrong_and_a_step_over_the_guard_fail() {
        let failing = |change: fn(&mut StackReport)| {
            let mut stack = stack();
            change(&mut stack);
            let failures = failures_of_stack(&stack, 100);
            assert_eq!(failures.len(), 1, "{failures:?}");
            failures[0].clone()
        };
        assert!(failing(|stack| stack.measured.room = 1_815).contains("1716 bytes at most, 1815 are there: 100 of"));
        assert!(failing(|stack| stack.measured.used = 1_717).contains("the bound is wrong"));
        assert!(failing(|stack| stack.measured.used = 8).contains("nothing was measured"));
        assert!(failing(|stack| stack.largest_frame.1 = 917).contains("step takes 917 bytes at once"));
        assert!(failing(|stack| stack.fault_handler.0 = 513).contains("needs 513 bytes of stack and has 512"));
    }

    fn report(instructions: Option<u64>, findings: Vec<(Check, Vec<Finding>)>) -> TaskReport {
        let rate = Rate::Every(125_000);
        let forbidden = &[Check::Panic];
        let task = Task {
            name: "tick",
            vector: "TIM6_DAC",
            priority: 4,
            rate,
            budget: Some(100),
            deadline: None,
            in_turn_with: None,
            forbidden,
        };
        let found = Some(StaticReport { functions: 1, stack: Depth::Bytes(0), findings });
        TaskReport { task, count: instructions.map(counted), found, timing: None }
    }

    fn finding() -> Finding {
        Finding { address: 0x0800_0100, what: "trap ".into(), path: vec!["TIM6_DAC".into(), "step".into()] }
    }

    #[test]
    fn a_budget_holds_up_to_itself() {
        assert_eq!(failures_of_task(&report(Some(100), Vec::new())), [""; 0]);
        let failures = failures_of_task(&report(Some(101), Vec::new()));
        assert_eq!(failures, ["tick (TIM6_DAC) takes 101 instructions, 100 are its budget"]);
    }

    #[test]
    fn a_task_that_did_not_run_or_has_no_handler_fails() {
        assert!(failures_of_task(&report(None, Vec::new()))[0].contains("did not run"));
        let without = TaskReport { found: None, ..report(None, Vec::new()) };
        assert!(failures_of_task(&without)[0].contains("the vector TIM6_DAC has no handler"));
    }

    #[test]
    fn only_what_is_forbidden_fails_and_the_way_to_it_is_named() {
        assert_eq!(failures_of_task(&report(Some(1), vec![(Check::Lock, vec![finding()])])), [""; 0]);
        let failures = failures_of_task(&report(Some(1), vec![(Check::Panic, vec![finding(), finding()])]));
        let expected = "tick (TIM6_DAC) reaches 2 panic: the first is `trap` at 0x08000100, by TIM6_DAC > step";
        assert_eq!(failures, [expected]);
    }

    #[test]
    fn a_function_that_is_missing_not_called_or_too_long_fails() {
        let function = |present, count| FunctionReport { symbol: "core", budget: 160, present, count };
        assert!(failure_of_function(&function(false, None)).unwrap().contains("no function has core in its name"));
        assert!(failure_of_function(&function(true, None)).unwrap().contains("not called"));
        assert!(failure_of_function(&function(true, Some(once(161)))).unwrap().contains("161 instructions, 160"));
        assert_eq!(failure_of_function(&function(true, Some(once(160)))), None);
    }

    #[test]
    fn a_chain_is_the_sum_of_its_tasks_and_fails_above_its_budget_or_without_one_of_them() {
        let chain = |budget| Chain { name: "both", tasks: &["tick", "tock"], low_pass: false, budget };
        let count = chained(chain(130), |name| Some(once(if name == "tick" { 100 } else { 30 })));
        assert_eq!(count, Some(once(130)));
        assert_eq!(failure_of_chain(&ChainReport { chain: chain(130), count }), None);
        let failure = failure_of_chain(&ChainReport { chain: chain(129), count });
        assert_eq!(failure.unwrap(), "both: 130 instructions together, 129 are their budget");
        let count = chained(chain(130), |name| (name == "tick").then_some(once(100)));
        assert!(failure_of_chain(&ChainReport { chain: chain(130), count }).unwrap().contains("did not run"));
    }

    #[test]
    fn a_hand_over_that_is_too_long_or_was_not_seen_fails() {
        let of = |longest, response| Some(HandOver { longest, response });
        assert_eq!(failure_of_hand_over(of(10_000, Some(60_000)), 10_000), None);
        assert!(failure_of_hand_over(of(10_001, Some(60_000)), 10_000).unwrap().contains("10.0 us are allowed"));
        assert!(failure_of_hand_over(of(1_000, None), 10_000).unwrap().contains("not done within its period"));
        assert!(failure_of_hand_over(None, 10_000).unwrap().contains("did not run"));
    }

    #[test]
    fn the_load_is_that_of_all_tasks_and_fails_above_its_limit() {
        let mut tasks = [report(Some(5_600), Vec::new()), report(Some(5_600), Vec::new())];
        add_timing(&mut tasks, 0);
        // 50 us of 500 each.
        assert_eq!(load(&tasks), 200);
        assert_eq!(failure_of_load(200, 200), None);
        assert_eq!(failure_of_load(201, 200).unwrap(), "the load is 20.1 %, 20.0 % is the limit");
    }

    #[test]
    fn a_task_of_the_cycle_takes_part_with_its_worst_cycle_and_a_task_of_a_timer_with_its_worst_activation() {
        let demand = |activations, instructions| Demand { activations, instructions, bus: 0 };
        let mut tasks = [report(Some(100), Vec::new()), report(Some(100), Vec::new())];
        tasks[0].task.rate = Rate::EachCycle;
        for task in &mut tasks {
            let worst = &mut task.count.as_mut().unwrap().worst;
            (worst.activation, worst.cycle) = (demand(1, 1_680), demand(4, 2_800));
        }
        add_timing(&mut tasks, 0);
        let timings = tasks.map(|task| task.timing.unwrap());
        assert_eq!(
            timings.map(|timing| (timing.load.period, timing.load.demand)),
            [(500_000, 25_000), (125_000, 15_000)]
        );
        // Its share is that of the worst cycle in both cases: 25 us of 500.
        assert_eq!(timings.map(|timing| timing.share), [50, 50]);
    }

    #[test]
    fn a_task_that_overruns_its_period_fails() {
        let mut tasks = [report(Some(20_000), Vec::new())];
        tasks[0].task.budget = None;
        add_timing(&mut tasks, 0);
        assert!(failures_of_task(&tasks[0])[0].contains("not always done within its period of 125 us"));
        tasks[0].count = Some(counted(100));
        add_timing(&mut tasks, 0);
        assert_eq!(failures_of_task(&tasks[0]), [""; 0]);
        let response = tasks[0].timing.unwrap().response.unwrap();
        tasks[0].task.deadline = Some(response);
        assert_eq!(failures_of_task(&tasks[0]), [""; 0]);
        tasks[0].task.deadline = Some(response - 1);
        assert!(failures_of_task(&tasks[0])[0].contains("from its cause to its end"));
    }

    #[test]
    fn a_task_waits_for_a_critical_section_of_the_thread() {
        let mut tasks = [report(Some(100), Vec::new())];
        add_timing(&mut tasks, 2_000);
        let timing = tasks[0].timing.unwrap();
        assert_eq!((timing.blocking, timing.response), (2_000, Some(2_000 + timing.load.demand)));
    }
}
