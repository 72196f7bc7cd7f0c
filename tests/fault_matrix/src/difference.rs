//! What the flashed ELF does otherwise than the portable drive.

use ring::Nanoseconds;

use crate::{Fault, Outcome, State};

/// The ELF's tasks take their time where those of the portable drive take none, and its clock begins elsewhere: a tick of the supervision and one of
/// the communication cycle.
const NOTICED_LATER: Nanoseconds = Nanoseconds::from_microseconds(2_500);
/// Speeds and temperatures are not quite those of the other run.
const PER_CENT: u64 = 3;

/// What is not the same, in one line: reaction, diagnosis, brake and what comes afterwards are; times within 2.5 ms and 3 %, but for faults that are
/// found [by chance](Fault::is_found_by_chance).
#[must_use]
pub fn difference(fault: Fault, state: State, host: &Outcome, elf: &Outcome) -> Option<String> {
    let essence = |outcome: &Outcome| {
        let Outcome { reaction, number, class_1, brake_closed, afterwards, .. } = *outcome;
        (reaction, number, class_1, brake_closed, afterwards)
    };
    let in_time = match (host.torque_off, elf.torque_off) {
        (None, None) => true,
        (Some(_), Some(_)) if fault.is_found_by_chance(state) => true,
        (Some(host), Some(elf)) => host.0.abs_diff(elf.0) <= NOTICED_LATER.0 + host.0 * PER_CENT / 100,
        _ => false,
    };
    if essence(host) == essence(elf) && in_time {
        return None;
    }
    Some(format!("portable {}, ELF {}", words(host), words(elf)))
}

fn words(outcome: &Outcome) -> String {
    let time = outcome.torque_off.map_or_else(|| "never".to_owned(), |time| time.to_string());
    let brake = match outcome.brake_closed {
        None => "",
        Some(true) => ", brake closed",
        Some(false) => ", brake open",
    };
    format!(
        "{}, torque off {time}, {:04X}H, class 1 {:04X}H{brake}, cleared: {}",
        outcome.reaction, outcome.number, outcome.class_1, outcome.afterwards
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Afterwards, Reaction};

    #[test]
    fn whatever_differs_is_told_and_times_may_by_a_little() {
        let host = Outcome {
            reaction: Reaction::Ramp,
            torque_off: Some(Nanoseconds::from_millis(60)),
            turned: Some(377.0),
            number: 0xF109,
            class_1: 1 << 9,
            brake_closed: Some(true),
            afterwards: Afterwards::RunsAgain,
        };
        let after = |microseconds| Some(Nanoseconds::from_microseconds(microseconds));
        let fault = Fault::MainPowerLost;
        assert_eq!(
            difference(fault, State::AtSpeed, &host, &Outcome { torque_off: after(64_300), turned: Some(0.0), ..host }),
            None
        );
        assert_eq!(
            difference(Fault::EncoderSlip, State::AtSpeed, &host, &Outcome { torque_off: after(90_000), ..host }),
            None
        );
        assert!(difference(Fault::EncoderSlip, State::AtSpeed, &host, &Outcome { torque_off: None, ..host }).is_some());
        // A shaft that stands shows a dead encoder by what the noise asks for.
        let late = Outcome { torque_off: after(90_000), ..host };
        assert_eq!(difference(Fault::EncoderFrozen, State::Halted, &host, &late), None);
        assert!(difference(Fault::EncoderFrozen, State::AtSpeed, &host, &late).is_some());
        for wrong in [
            Outcome { reaction: Reaction::TorqueOff, ..host },
            Outcome { torque_off: after(64_400), ..host },
            Outcome { torque_off: after(55_600), ..host },
            Outcome { torque_off: None, ..host },
            Outcome { number: 0xF10F, ..host },
            Outcome { class_1: 0, ..host },
            Outcome { brake_closed: Some(false), ..host },
            Outcome { afterwards: Afterwards::StaysOff, ..host },
        ] {
            assert!(difference(fault, State::AtSpeed, &host, &wrong).is_some(), "{wrong:?}");
        }
    }
}
