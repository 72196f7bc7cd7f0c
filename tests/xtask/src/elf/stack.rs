//! A bound for the stack of a function with all that it calls, also through registers.
//!
//! What a call through a register reaches is not known, so it may be any function whose address lies among the constants. That closes circles, of formatting
//! above all; of the functions of a circle each counts once. The bound holds as long as no function is on the stack twice; the measured stack is held
//! against it.

use super::checks::is_end;
use super::code::{Flow, Instruction};
use super::graph::Graph;
use std::collections::{BTreeMap, BTreeSet};

/// Frames of functions, and who calls whom.
struct Frames<'a> {
    graph: &'a Graph,
    taken: Vec<usize>,
}

impl Frames<'_> {
    fn calls(&self, function: usize) -> Vec<usize> {
        let mut calls: Vec<usize> = self.graph.calls(function).to_vec();
        if self.graph.calls_indirectly(function) {
            calls.extend(&self.taken);
        }
        // Nothing comes after a panic, which ends on this stack; what it needs is counted where it is asked for.
        calls.retain(|callee| !is_end(self.graph.name(*callee)));
        calls
    }
}

/// Bytes that a function and all that it reaches need at most.
pub(crate) fn bound(graph: &Graph, root: usize) -> u32 {
    let frames = Frames { graph, taken: graph.program.taken() };
    let circles = circles(root, |function| frames.calls(function));
    // The circles come callees first.
    let of: BTreeMap<usize, usize> =
        circles.iter().enumerate().flat_map(|(number, circle)| circle.iter().map(move |one| (*one, number))).collect();
    let mut deepest: Vec<u32> = Vec::with_capacity(circles.len());
    for (number, circle) in circles.iter().enumerate() {
        let own: u32 = circle.iter().map(|function| graph.frame(*function)).sum();
        let callees = circle.iter().flat_map(|function| frames.calls(*function));
        let below = callees.map(|callee| of[&callee]).filter(|callee| *callee != number);
        deepest.push(own + below.map(|callee| deepest[callee]).max().unwrap_or(0));
    }
    deepest.last().copied().unwrap_or(0)
}

/// Stack of a program's start.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Start {
    /// Bytes that it needs at most, with interrupts off.
    pub(crate) alone: u32,
    /// Bytes that it, or what comes behind it for ever, has at most when an interrupt comes.
    pub(crate) interrupted: u32,
}

/// Interrupts come on in one place, behind the last call of a function that `main` reaches: under them lie the frames of those on the way to it and
/// nothing else, and then what `main` calls besides, which never ends. A program that is made otherwise can be interrupted wherever it is deepest.
pub(crate) fn of_start(graph: &Graph, main: usize) -> Start {
    let alone = bound(graph, main);
    let Some(enabling) = enabling(graph) else { return Start { alone, interrupted: alone } };
    let way: Vec<usize> =
        graph.reachable(main).into_keys().filter(|one| graph.reachable(*one).contains_key(&enabling)).collect();
    let starting = way.iter().map(|function| graph.frame(*function)).sum();
    let others = graph.calls(main).iter().filter(|callee| !way.contains(callee) && !is_end(graph.name(**callee)));
    let behind = others.map(|callee| bound(graph, *callee)).max().unwrap_or(0);
    Start { alone, interrupted: (graph.frame(main) + behind).max(starting) }
}

/// Functions that nobody but the start reaches, whose frames lie far above the guard: those on the way to where interrupts come on, and what they call.
pub(crate) fn only_at_start(graph: &Graph, main: usize, tasks: &[usize]) -> BTreeSet<usize> {
    let Some(enabling) = enabling(graph) else { return BTreeSet::new() };
    let leads = |one: &usize| graph.reachable(*one).contains_key(&enabling);
    let (starting, behind): (Vec<usize>, Vec<usize>) = graph.calls(main).iter().partition(|callee| leads(callee));
    let reached = |roots: &[usize]| roots.iter().flat_map(|root| graph.reachable(*root).into_keys()).collect();
    let later: BTreeSet<usize> = reached(&[behind, tasks.to_vec()].concat());
    let started: BTreeSet<usize> = reached(&starting);
    started.difference(&later).copied().collect()
}

/// The function in which interrupts come on, if they do in one place only and it calls nothing behind that.
fn enabling(graph: &Graph) -> Option<usize> {
    let functions = 0..graph.program.functions().len();
    let places = |function| graph.instructions(function).iter().filter(|one| is_enabling(one)).map(move |_| function);
    let mut enabling = functions.flat_map(places);
    let (first, second) = (enabling.next()?, enabling.next());
    (second.is_none() && ends_with_interrupts_on(graph.instructions(first))).then_some(first)
}

/// Interrupts come on, and up to the return nothing is called.
fn ends_with_interrupts_on(instructions: &[Instruction]) -> bool {
    let mut behind = instructions.iter().skip_while(|one| !is_enabling(one));
    behind.next().is_some() && behind.find(|one| one.flow != Flow::Next).is_some_and(|one| one.flow == Flow::Return)
}

/// What writes PRIMASK puts back what it was before.
fn is_enabling(instruction: &Instruction) -> bool {
    instruction.mnemonic.starts_with("cpsie")
}

/// The strongly connected parts of what a root reaches, callees before callers (Tarjan, with a stack of its own).
fn circles(root: usize, calls: impl Fn(usize) -> Vec<usize>) -> Vec<Vec<usize>> {
    let mut circles = Vec::new();
    let mut number: BTreeMap<usize, usize> = BTreeMap::new();
    let mut lowest: BTreeMap<usize, usize> = BTreeMap::new();
    let mut open: Vec<usize> = Vec::new();
    let mut work = vec![(root, calls(root), 0)];
    number.insert(root, 0);
    lowest.insert(root, 0);
    open.push(root);
    while let Some((function, callees, next)) = work.last_mut() {
        let function = *function;
        if let Some(callee) = callees.get(*next).copied() {
            *next += 1;
            if let Some(seen) = number.get(&callee) {
                if open.contains(&callee) {
                    let low = lowest[&function].min(*seen);
                    lowest.insert(function, low);
                }
            } else {
                let fresh = number.len();
                number.insert(callee, fresh);
                lowest.insert(callee, fresh);
                open.push(callee);
                work.push((callee, calls(callee), 0));
            }
            continue;
        }
        work.pop();
        if let Some((caller, ..)) = work.last() {
            let low = lowest[caller].min(lowest[&function]);
            lowest.insert(*caller, low);
        }
        if lowest[&function] == number[&function]
            && let Some(at) = open.iter().position(|one| *one == function)
        {
            circles.push(open.split_off(at));
        }
    }
    circles
}

#[cfg(test)]
mod tests {
    use super::super::Program;
    use super::*;

    #[test]
    fn circles_come_callees_first_and_whole() {
        // 0 -> 1 -> 2 -> 1, 2 -> 3, 0 -> 3.
        let calls = |function: usize| [vec![1, 3], vec![2], vec![1, 3], vec![]][function].clone();
        assert_eq!(circles(0, calls), [vec![3], vec![1, 2], vec![0]]);
    }

    #[test]
    fn of_a_circle_every_frame_counts_once_and_behind_it_the_deepest() {
        // again: push {r7, lr}; bl again; bl leaf. leaf: sub sp, #16; bx lr.
        let program = Program::of_code(
            0x0800_0100,
            &[
                ("again", &[0x80, 0xb5, 0xff, 0xf7, 0xfd, 0xff, 0x00, 0xf0, 0x00, 0xf8]),
                ("leaf", &[0x84, 0xb0, 0x70, 0x47]),
            ],
        );
        assert_eq!(bound(&Graph::new(program).unwrap(), 0), 8 + 16);
    }

    /// main: push {r7, lr}; bl start; bl leaf. start: push {r4, r5, r6, lr}; bl leaf; cpsie i; what comes behind; pop {r4, r5, r6, pc}.
    /// leaf: sub sp, #64; bx lr.
    fn started(behind: &[u8]) -> Start {
        let mut start = vec![0x70, 0xb5, 0x00, 0xf0, 0x06, 0xf8, 0x62, 0xb6];
        start.extend(behind);
        start.extend([0x70, 0xbd]);
        start.resize(16, 0x00);
        let main = [0x80, 0xb5, 0x00, 0xf0, 0x03, 0xf8, 0x00, 0xf0, 0x09, 0xf8, 0x00, 0xbf];
        let leaf = [0x90, 0xb0, 0x70, 0x47];
        let program = Program::of_code(0x0800_0100, &[("main", &main), ("start", &start), ("leaf", &leaf)]);
        of_start(&Graph::new(program).unwrap(), 0)
    }

    #[test]
    fn what_idle_or_a_task_calls_too_is_not_the_starts_alone() {
        // main: bl start; bl idle. start: cpsie i; b leaf is a call, so: push, bl leaf, cpsie, pop.
        let main = [0x80, 0xb5, 0x00, 0xf0, 0x03, 0xf8, 0x00, 0xf0, 0x09, 0xf8, 0x00, 0xbf];
        let mut start = vec![0x70, 0xb5, 0x00, 0xf0, 0x06, 0xf8, 0x62, 0xb6, 0x70, 0xbd];
        start.resize(16, 0x00);
        let leaf = [0x90, 0xb0, 0x70, 0x47];
        let program = Program::of_code(0x0800_0100, &[("main", &main), ("start", &start), ("leaf", &leaf)]);
        let graph = Graph::new(program).unwrap();
        assert_eq!(only_at_start(&graph, 0, &[]), BTreeSet::from([1]), "main calls the leaf, too");
    }

    #[test]
    fn interrupts_that_come_on_behind_the_last_call_find_the_frame_of_the_start_alone() {
        assert_eq!(started(&[]), Start { alone: 8 + 16 + 64, interrupted: 8 + 64 });
        // bl leaf
        assert_eq!(started(&[0x00, 0xf0, 0x02, 0xf8]).interrupted, 8 + 16 + 64);
        // cpsie i
        assert_eq!(started(&[0x62, 0xb6]).interrupted, 8 + 16 + 64);
    }
}
