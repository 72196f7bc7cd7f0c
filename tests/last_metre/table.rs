//! How long bridge and brake take to go off, in every state of the drive, whatever happens.

use std::fmt::Write;

use emulator::{Mistake, Reset, What};
use ring::Nanoseconds;

use super::rig::{Axis, Event, Rig, STARTED_MS, Seen, State};

const DOCUMENT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../docs/last-metre.md");
const STATES: [State; 5] = [State::Off, State::SwitchingOn, State::Standstill, State::AtSpeed, State::Stopping];
/// The task that makes the mistake, the control loop: it runs in every state.
const TASK: &str = "CAN2_TX";
/// Latest interrupt of the watchdog of the loops.
const LOOP_WATCHDOG: Nanoseconds = Nanoseconds(1_200_000);
const CURRENT_LOOP: &str = "ADC";
/// On both axes, in every state.
const EVENTS: [(&str, Event); 4] = [
    ("fault in a task", Event::Mistake(Mistake::Undefined, TASK)),
    ("crystal stops", Event::CrystalFails),
    ("reset: pin, brown-out, supply", Event::Reset(Reset::Pin)),
    ("control loop hangs", Event::Mistake(Mistake::Hang, TASK)),
];
/// On the axis that has bridge and brake, in every state: they take the same ways.
const MORE_EVENTS: [(&str, Event); 4] = [
    ("panic in a task", Event::Mistake(Mistake::Panic, TASK)),
    ("stack overflow, from the guard on", Event::Mistake(Mistake::Recursion, TASK)),
    ("current loop hangs", Event::Mistake(Mistake::Hang, CURRENT_LOOP)),
    ("idle task hangs", Event::InIdle(Mistake::Hang)),
];

/// Instructions in a time, at a clock of so many MHz.
fn instructions(time: Nanoseconds, megahertz: u64) -> u64 {
    (time.0 * megahertz * 10 + 7_500) / 15_000
}

fn cell(time: Option<Nanoseconds>, megahertz: u64) -> String {
    match time {
        None => "-".into(),
        Some(Nanoseconds(0)) => "0".into(),
        // How long after its last feeding a watchdog finds the mistake is chance; `judge` has the exact bounds.
        Some(time) if time > LOOP_WATCHDOG => "<= 100 ms".into(),
        Some(time) if time > Nanoseconds(100_000) => "<= 1.2 ms".into(),
        Some(time) => {
            let hundredths = (time.0 + 5) / 10;
            format!("{} i, {}.{:02} us", instructions(time, megahertz), hundredths / 100, hundredths % 100)
        }
    }
}

/// Everything that is the same for whatever happens, and the limits of each.
#[track_caller]
fn judge(axis: Axis, state: State, event: Event, seen: &Seen) {
    let told = || format!("{axis:?} {state:?} {event:?}: {seen:?}");
    assert_eq!(seen.bridge_off.is_some(), state != State::Off, "{}", told());
    assert_eq!(seen.brake_off.is_some(), axis == Axis::Vertical && state != State::Off, "{}", told());
    let (bridge, brake) = (seen.bridge_off.unwrap_or_default(), seen.brake_off.unwrap_or_default());
    let reset = seen.reset.unwrap_or_else(|| panic!("no reset: {}", told()));
    let handlers = seen.incidents.iter().filter(|incident| matches!(incident.what, What::Handler(_))).count();
    match event {
        // Off with the first instructions of the handler, and reset soon after.
        Event::Mistake(Mistake::Undefined | Mistake::Recursion, _) => {
            assert!(instructions(bridge, 168) <= 5 && instructions(brake, 168) <= 9, "{}", told());
            assert!(reset < Nanoseconds::from_microseconds(40) && handlers == 1, "{}", told());
        }
        Event::Mistake(Mistake::Panic, _) => {
            assert!(instructions(brake.max(bridge), 168) <= 40, "{}", told());
            assert!(reset < Nanoseconds::from_microseconds(500) && handlers == 1, "{}", told());
        }
        Event::CrystalFails => {
            assert_eq!(bridge, Nanoseconds::ZERO, "{}", told());
            // The handler runs at 16 MHz, behind the instruction that runs.
            assert!(instructions(brake, 16) <= 12 && handlers == 1, "{}", told());
        }
        Event::Reset(_) => {
            assert_eq!((bridge, brake, handlers), (Nanoseconds::ZERO, Nanoseconds::ZERO, 0), "{}", told())
        }
        // The watchdog of the loops: its interrupt, 1.07 to 1.17 ms after it was fed last, which is up to two ticks ago.
        Event::Mistake(Mistake::Hang, _) => {
            let expected = Nanoseconds(820_000)..=LOOP_WATCHDOG;
            assert!(state == State::Off || expected.contains(&bridge), "{}", told());
            assert!(expected.contains(&reset) && handlers == 1, "{}", told());
        }
        // The watchdog: 100 ms since it was fed last, which is 8 ms ago at most.
        Event::InIdle(Mistake::Hang) => {
            let expected = Nanoseconds(91_000_000)..=Nanoseconds(100_000_000);
            assert!(expected.contains(&reset) && handlers == 0, "{}", told());
            // The loops go on meanwhile: a stop that runs is finished.
            let at_reset = matches!(state, State::SwitchingOn | State::Standstill | State::AtSpeed);
            assert!(bridge <= reset && (bridge == reset || !at_reset), "{}", told());
        }
        other => panic!("{other:?}"),
    }
}

/// All cells of an axis, as rows of the table.
fn rows(axis: Axis) -> String {
    let more = if axis == Axis::Vertical { &MORE_EVENTS[..] } else { &[] };
    let events = [&EVENTS, more].concat();
    let mut cells = vec![Vec::new(); events.len()];
    for state in STATES {
        // The simulation repeats itself to the bit: what is planted is reached at the same instant, whatever it is.
        let mut reached = Nanoseconds::ZERO;
        for ((_, event), cells) in events.iter().zip(&mut cells) {
            let mut rig = Rig::in_state(axis, state);
            let begun = match event {
                Event::Mistake(Mistake::Panic, _) | Event::Mistake(Mistake::Hang, TASK) => Some(reached),
                // The current loop, within 62.5 us; a handler that is entered later is that of the watchdog.
                Event::Mistake(Mistake::Hang, _) => Some(rig.world.now()),
                _ => None,
            };
            let seen = rig.happen(*event, begun);
            if matches!(event, Event::Mistake(Mistake::Undefined, _)) {
                reached = seen.event;
            }
            judge(axis, state, *event, &seen);
            // It comes back, and nothing goes on by itself.
            rig.run_ms(STARTED_MS);
            rig.assert_started_again_without_torque();
            let megahertz = if *event == Event::CrystalFails { 16 } else { 168 };
            cells.push(match axis {
                Axis::Horizontal => cell(seen.bridge_off, megahertz),
                Axis::Vertical => {
                    format!("{} / {}", cell(seen.bridge_off, megahertz), cell(seen.brake_off, megahertz))
                }
            });
        }
    }
    let mut rows = String::from(
        "| what happens | off | switching on | standstill | at speed | stopping |\n|---|---|---|---|---|---|\n",
    );
    for ((name, _), cells) in events.iter().zip(cells) {
        writeln!(rows, "| {name} | {} |", cells.join(" | ")).unwrap();
    }
    rows
}

/// The table in the document is what was measured; `UPDATE_GOLDEN=1` writes it.
fn compare(axis: Axis) {
    let measured = rows(axis);
    let document = std::fs::read_to_string(DOCUMENT).unwrap();
    let marks = [format!("<!-- {axis:?} begins -->\n"), format!("<!-- {axis:?} ends -->")];
    let (before, rest) = document.split_once(&marks[0]).expect("the mark where the table begins");
    let (table, after) = rest.split_once(&marks[1]).expect("the mark where the table ends");
    if std::env::var_os("UPDATE_GOLDEN").is_some() {
        std::fs::write(DOCUMENT, format!("{before}{}{measured}{}{after}", marks[0], marks[1])).unwrap();
        return;
    }
    assert_eq!(table, measured, "measured is on the right; UPDATE_GOLDEN=1 writes it into docs/last-metre.md");
}

#[test]
#[ignore = "needs QEMU and the ELF: cargo xtask test"]
fn whatever_ends_the_program_of_a_horizontal_axis_its_bridge_is_off_as_fast_as_the_table_says() {
    compare(Axis::Horizontal);
}

#[test]
#[ignore = "needs QEMU and the ELF: cargo xtask test"]
fn whatever_ends_the_program_of_a_vertical_axis_bridge_and_brake_are_off_as_fast_as_the_table_says() {
    compare(Axis::Vertical);
}
