//! The matrix as a page of the documentation.

use std::fmt::Write as _;

use crate::expected::note;
use crate::{Cell, Expected, Outcome, Reaction};

const HEAD: &str = "\
# Fault matrix

What the drive does about a fault, by state and operation mode. Written by `cargo xtask faults` from simulated runs of the whole
firmware; do not edit. Each row is measured: a drive on a ring (2 Mbit/s, 2 ms) is brought into the state, the fault is put in from outside,
and bridge, shaft and service channel are watched. Axis: the one that the defaults of the parameters describe, all parameters at their
defaults; for the brake a vertical axis of 750 W. Speed: 600 rpm, in torque mode held by S-0-0091. The control unit keeps its switches and
commands as they are. Reaction to errors P-0-0140: ramp, S-0-0138 at 1000 rad/s^2: 63 ms from 600 rpm.

* **Reaction**: *goes on*: torque as before; *ramp, torque off*: the axis is stopped by its own torque and then left without it; *torque off*:
  the bridge is off at once when the fault is found (at standstill a ramp has nothing to do and looks the same).
* **Torque off**: from the fault to the bridge's switching off, two digits. A lost telegram counts from where it should have begun.
* **Turned**: from the fault to standstill, two digits.
* **S-0-0390**, **S-0-0011**: as the service channel shows them afterwards.
* **S-0-0099**: whether it clears the error once the cause is gone, and whether the axis can be switched on then.
";

/// The page.
#[must_use]
pub fn markdown(cells: &[(&Expected, Outcome)]) -> String {
    let mut page = HEAD.to_owned();
    let mut last = None;
    for (expected, outcome) in cells {
        let Cell { fault, .. } = expected.cell;
        if last != Some(fault) {
            last = Some(fault);
            let _ = write!(page, "\n## {}\n\n", capitalised(&fault.to_string()));
            if let Some(note) = note(fault) {
                let _ = write!(page, "{note}\n\n");
            }
            page += "| State | Mode | Reaction | Torque off | Turned | S-0-0390 | S-0-0011 | Brake | S-0-0099 |\n";
            page += "|---|---|---|---|---|---|---|---|---|\n";
        }
        page += &row(&expected.cell, outcome);
    }
    page
}

fn row(cell: &Cell, outcome: &Outcome) -> String {
    let torque_off = outcome.torque_off.map_or_else(|| "-".to_owned(), |time| milliseconds(time.0));
    let turned = outcome.turned.map_or_else(|| "-".to_owned(), degrees);
    let class_1 = if outcome.class_1 == 0 { "-".to_owned() } else { bits(outcome.class_1) };
    let brake = match outcome.brake_closed {
        None => "-",
        Some(true) => "closed",
        Some(false) => "open",
    };
    let reaction = match outcome.reaction {
        Reaction::None if outcome.torque_off.is_some() => "none; stops as told".to_owned(),
        Reaction::Warning if outcome.torque_off.is_some() => "warns; stops as told".to_owned(),
        reaction => reaction.to_string(),
    };
    format!(
        "| {} | {} | {reaction} | {torque_off} | {turned} | {} | {class_1} | {brake} | {} |\n",
        cell.state,
        cell.mode,
        diagnosis(outcome.number),
        outcome.afterwards,
    )
}

/// Number and text of an error or a warning; of a state neither.
fn diagnosis(number: u16) -> String {
    let known = drive::DIAGNOSES.iter().find(|diagnosis| diagnosis.number == number && number >= 0xE000);
    known.map_or_else(|| "-".to_owned(), |diagnosis| format!("{number:04X}H {}", diagnosis.text))
}

/// The bits of a word: `bits 5, 11`.
fn bits(word: u16) -> String {
    let set: Vec<String> = (0..16).filter(|bit| word >> bit & 1 == 1).map(|bit| bit.to_string()).collect();
    format!("{} {}", if set.len() == 1 { "bit" } else { "bits" }, set.join(", "))
}

fn milliseconds(nanoseconds: u64) -> String {
    if nanoseconds < 62_500 {
        return "at once".to_owned();
    }
    format!("{} ms", two_digits(nanoseconds as f64 * 1e-6))
}

fn degrees(angle: f64) -> String {
    // What a standing axis swings is nothing to tell.
    if angle.abs() < 2.0 { "0".to_owned() } else { format!("{} deg", two_digits(angle)) }
}

/// Rounded to two digits, so that the page does not change with every last bit.
fn two_digits(value: f64) -> String {
    let scale = 10_f64.powf(value.abs().log10().floor() - 1.0);
    let rounded = (value / scale).round() * scale;
    let places = usize::from(scale < 0.99) + usize::from(scale < 0.099) + usize::from(scale < 0.0099);
    format!("{rounded:.places$}")
}

fn capitalised(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or_else(String::new, |first| first.to_uppercase().chain(letters).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn figures_have_two_digits() {
        for (value, text) in
            [(0.0625, "0.063"), (0.125, "0.13"), (5.54, "5.5"), (63.9, "64"), (4_342.0, "4300"), (-271.0, "-270")]
        {
            assert_eq!(two_digits(value), text);
        }
    }

    #[test]
    fn words_are_told_by_their_bits() {
        assert_eq!(bits(0x0820), "bits 5, 11");
        assert_eq!(bits(0x8000), "bit 15");
    }

    #[test]
    fn a_state_is_no_diagnosis_of_a_fault() {
        assert_eq!(diagnosis(0xA012), "-");
        assert_eq!(diagnosis(0xF107), "F107H Overcurrent");
    }
}
