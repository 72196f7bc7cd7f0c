//! The communication phases, from [`PhaseMachine`] with every MST, both transition checks and every loss.

use super::is_on_the_page;
use sercos::duration::BitRate;
use sercos::parameters::Parameters;
use sercos::phase::PhaseError;
use sercos::transition::{Capabilities, check_cp3, check_cp4};
use sercos::{Idn, PhaseMachine};
use std::collections::BTreeMap;
use std::fmt::Write as _;

/// What can happen to the machine.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Input {
    /// An MST with this phase.
    Mst(u8),
    /// S-0-0127 is passed.
    Cp3Check,
    /// S-0-0128 is passed.
    Cp4Check,
    /// A parameter that a check looked at is written, or a check fails.
    Withdraw,
    /// Two telegrams of a kind in a row are missing.
    Lost(PhaseError),
}

const INPUTS: [Input; 14] = [
    Input::Mst(0),
    Input::Mst(1),
    Input::Mst(2),
    Input::Mst(3),
    Input::Mst(4),
    Input::Mst(5),
    Input::Mst(6),
    Input::Mst(7),
    Input::Cp3Check,
    Input::Cp4Check,
    Input::Withdraw,
    Input::Lost(PhaseError::MstFailure),
    Input::Lost(PhaseError::MdtFailure),
    Input::Lost(PhaseError::LightLoss),
];

/// What can be seen of the machine from outside.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Seen {
    phase: u8,
    follows_master: bool,
    permitted: bool,
}

impl Seen {
    fn name(self) -> String {
        match (self.follows_master, self.permitted) {
            (false, _) => "Waiting".to_owned(),
            (true, false) => format!("CP{}", self.phase),
            (true, true) => format!("CP{}_checked", self.phase),
        }
    }
}

/// The values with which the recorded master ran its first drive up: they pass both checks.
fn passing() -> (Parameters, Capabilities) {
    let mut parameters = Parameters::new(&drive::DICTIONARY);
    let capabilities = Capabilities { bit_rate: BitRate::Mbit2, operation_modes: &[2], feedback_2: false };
    for (number, value) in [(1, 2000), (2, 2000), (6, 92), (89, 1782), (8, 1965), (7, 1698), (9, 1), (10, 32), (15, 7)]
    {
        parameters.set(Idn::standard(number), value).unwrap();
        parameters.mark_written(Idn::standard(number));
    }
    parameters.set_list(Idn::AT_LIST, &[Idn::standard(51)]).unwrap();
    parameters.set_list(Idn::MDT_LIST, &[Idn::standard(36)]).unwrap();
    (parameters, capabilities)
}

/// The machine after these inputs, and the bits that the last of them set in S-0-0014.
fn after(inputs: &[Input]) -> (PhaseMachine, u16) {
    let (parameters, capabilities) = passing();
    let mut machine = PhaseMachine::new();
    let mut bits = 0;
    for input in inputs {
        machine.clear_error();
        match *input {
            Input::Mst(phase) => drop(machine.received(phase)),
            Input::Cp3Check => machine.permit_cp3(check_cp3(&parameters, &capabilities).unwrap().1),
            Input::Cp4Check => {
                let (configuration, _) = check_cp3(&parameters, &capabilities).unwrap();
                machine.permit_cp4(check_cp4(&parameters, &capabilities, &configuration, true).unwrap());
            }
            Input::Withdraw => machine.withdraw(),
            Input::Lost(error) => drop(machine.fail(error)),
        }
        bits = machine.interface_status().raw_value() & !7;
    }
    (machine, bits)
}

fn seen(inputs: &[Input]) -> Seen {
    let (mut machine, _) = after(inputs);
    let (phase, permitted) = (machine.current().number(), machine.is_permitted());
    // A machine that waits for the master's CP0 makes nothing of an MST that would be an error to one that follows.
    Seen { phase, permitted, follows_master: machine.received(7).is_err() }
}

/// Each state with the inputs that lead to it first.
fn states() -> BTreeMap<Seen, Vec<Input>> {
    let mut ways = vec![Vec::new()];
    let mut states = BTreeMap::new();
    while let Some(way) = (!ways.is_empty()).then(|| ways.remove(0)) {
        let state = seen(&way);
        if states.contains_key(&state) {
            continue;
        }
        ways.extend(INPUTS.map(|input| way.iter().copied().chain([input]).collect()));
        states.insert(state, way);
    }
    states
}

fn generated() -> String {
    let mut picture = String::from(
        "```mermaid\nstateDiagram-v2\n    [*] --> Waiting\n    Waiting : CP0, waiting for an MST of CP0\n",
    );
    let mut edges = String::new();
    let mut table = String::from(
        "```\n\n| | MST 0 | 1 | 2 | 3 | 4 | 5 to 7 | S-0-0127 passed | S-0-0128 passed | written, or failed | MST lost twice | MDT | both |\n",
    );
    table += "|---|---|---|---|---|---|---|---|---|---|---|---|---|\n";
    for (state, way) in states() {
        let name = state.name();
        if state.permitted {
            writeln!(picture, "    {name} : CP{}, transition check passed", state.phase).unwrap();
        }
        let mut leads: Vec<(String, Vec<&str>)> = Vec::new();
        write!(table, "| {} |", name.replace('_', " ")).unwrap();
        let mut cells = Vec::new();
        for input in INPUTS {
            let way: Vec<_> = way.iter().copied().chain([input]).collect();
            let (to, (_, bits)) = (seen(&way), after(&way));
            let bits: Vec<_> = (3..16).filter(|bit| bits >> bit & 1 != 0).map(|bit| bit.to_string()).collect();
            let cause = match input {
                _ if !bits.is_empty() => "error",
                Input::Mst(phase) => {
                    ["MST 0", "MST 1", "MST 2", "MST 3", "MST 4", "MST 5", "MST 6", "MST 7"][usize::from(phase)]
                }
                Input::Cp3Check => "S-0-0127",
                Input::Cp4Check => "S-0-0128",
                Input::Withdraw => "written, or failed",
                Input::Lost(_) => "lost",
            };
            if to != state {
                match leads.iter_mut().find(|(name, _)| *name == to.name()) {
                    Some((_, causes)) if causes.contains(&cause) => {}
                    Some((_, causes)) => causes.push(cause),
                    None => leads.push((to.name(), vec![cause])),
                }
            }
            cells.push(match (to == state, bits.is_empty()) {
                (_, false) => format!("bit {}", bits.join(", ")),
                (true, true) => "-".to_owned(),
                (false, true) => to.name().replace('_', " "),
            });
        }
        // The three phases that there are not are one column.
        assert!(cells[5] == cells[6] && cells[6] == cells[7]);
        cells.drain(6..8);
        writeln!(table, " {} |", cells.join(" | ")).unwrap();
        for (to, causes) in leads {
            writeln!(edges, "    {name} --> {to} : {}", causes.join(", ")).unwrap();
        }
    }
    picture + &edges + &table
}

#[test]
fn the_communication_phases_are_drawn_as_the_machine_goes() {
    is_on_the_page("communication phases", &generated());
}

#[test]
fn five_phases_two_passed_checks_and_the_wait_for_cp0_are_all_there_is() {
    let names: Vec<_> = states().into_keys().map(Seen::name).collect();
    assert_eq!(names, ["Waiting", "CP0", "CP1", "CP2", "CP2_checked", "CP3", "CP3_checked", "CP4"]);
}
