//! The drive's states, from [`StateMachine`] with every input that can come.

use super::cover::{Cube, cover};
use super::is_on_the_page;
use drive::{Conditions, DriveState, StateMachine, Switches};
use std::collections::BTreeMap;
use std::fmt::Write as _;

/// What each bit of an input means, and what it means that it is 0. The first is made of bits 1, 2 and 4 and of what was before.
const INPUTS: [(&str, &str); 12] = [
    ("edge of bits 15 and 14", "no edge"),
    ("bit 15", "no bit 15"),
    ("bit 14", "no bit 14"),
    ("bit 13", "no bit 13"),
    ("CP4", "not CP4"),
    ("main power", "no main power"),
    ("DC link", "no DC link"),
    ("error", "no error"),
    ("fatal", "not fatal"),
    ("standstill", "turning"),
    ("released", "not released"),
    ("torque off", "torque on"),
];

/// The bits in the order in which a condition does without them.
const DISPENSABLE: [u32; 12] = [8, 6, 11, 10, 9, 3, 5, 2, 1, 4, 7, 0];

const STATES: [DriveState; 8] = [
    DriveState::Off,
    DriveState::SwitchingOn,
    DriveState::Following,
    DriveState::Halted,
    DriveState::SwitchingOff,
    DriveState::FaultReaction,
    DriveState::Engaging,
    DriveState::Fault,
];

const fn bit(input: u32, number: u32) -> bool {
    input >> number & 1 != 0
}

/// Switches and conditions without the edge; `None` for what cannot come: a fatal error that is no error, main power on an empty link.
fn looked_at(input: u32) -> Option<(Switches, Conditions)> {
    let on = |number| bit(input, number);
    let conditions = Conditions {
        operating_phase: on(4),
        power: on(5),
        sustained: on(6),
        fault: on(7),
        fatal: on(8),
        standstill: on(9),
        released: on(10),
        torque_off: on(11),
    };
    let possible = (conditions.fault || !conditions.fatal) && (conditions.sustained || !conditions.power);
    possible.then_some((Switches { on: on(1), enable: on(2), run: on(3) }, conditions))
}

/// From each state to each other: the inputs that lead there, and those that do not.
fn transitions() -> BTreeMap<(usize, usize), (Vec<u32>, Vec<u32>)> {
    let number = |state| STATES.iter().position(|known| *known == state).expect("a state that the list lacks");
    let mut met: Vec<StateMachine> = vec![StateMachine::default()];
    let mut seen: BTreeMap<usize, BTreeMap<u32, usize>> = BTreeMap::new();
    let mut next = 0;
    while let Some(machine) = met.get(next).copied() {
        next += 1;
        for input in (0..1 << INPUTS.len()).step_by(2) {
            let Some((switches, conditions)) = looked_at(input) else { continue };
            let mut after = machine;
            let state = after.update(switches, conditions);
            let request = switches.on && switches.enable && conditions.operating_phase;
            // What the machine remembers is whether its last look was at no request in CP4: with a request now, that is the edge.
            let edge = request && format!("{machine:?}").contains("armed: true");
            let before = seen.entry(number(machine.state())).or_default();
            let known = before.insert(input | u32::from(edge), number(state));
            assert!(known.is_none_or(|known| known == number(state)), "the machine remembers more than the edge");
            if !met.contains(&after) {
                met.push(after);
            }
        }
    }
    let mut transitions = BTreeMap::new();
    for (from, inputs) in &seen {
        for to in inputs.values().filter(|to| *to != from) {
            transitions.entry((*from, *to)).or_insert_with(|| {
                let (inside, outside): (Vec<_>, Vec<_>) = inputs.iter().partition(|(_, led)| *led == to);
                let inputs = |of: Vec<(&u32, &usize)>| of.into_iter().map(|(input, _)| *input).collect();
                (inputs(inside), inputs(outside))
            });
        }
    }
    transitions
}

fn words(cube: Cube) -> String {
    let words = INPUTS.iter().enumerate().filter(|(number, _)| bit(cube.care, *number as u32));
    let words: Vec<_> =
        words.map(|(number, (set, not))| if bit(cube.value, number as u32) { *set } else { *not }).collect();
    words.join(", ")
}

fn generated() -> String {
    let mut text = String::from("```mermaid\nstateDiagram-v2\n    [*] --> Off\n");
    let mut table = String::from("```\n\n| | from | to | when |\n|---:|---|---|---|\n");
    for (index, ((from, to), (inside, outside))) in transitions().into_iter().enumerate() {
        let (from, to, number) = (STATES[from], STATES[to], index + 1);
        writeln!(text, "    {from:?} --> {to:?} : {number}").unwrap();
        let when: Vec<_> = cover(&inside, &outside, &DISPENSABLE).into_iter().map(words).collect();
        writeln!(table, "| {number} | {from:?} | {to:?} | {} |", when.join("<br>or ")).unwrap();
    }
    text + &table
}

#[test]
fn the_states_of_the_drive_are_drawn_as_the_machine_goes() {
    is_on_the_page("states of the drive", &generated());
}

#[test]
fn every_state_is_reached_and_left() {
    let transitions = transitions();
    for (number, state) in STATES.iter().enumerate() {
        assert!(transitions.keys().any(|(from, _)| *from == number), "{state:?} is not left");
        assert!(transitions.keys().any(|(_, to)| *to == number), "{state:?} is not reached");
    }
}
