//! The watchdog: started, with its period, and fed only while every task makes progress.

use emulator::{Mistake, Reset, What};
use ring::Nanoseconds;

use super::rig::{Axis, Event, Rig, State};

/// Longest time between two feedings.
const FEEDING: Nanoseconds = Nanoseconds(8_125_000);
/// At the nominal 32 kHz of its oscillator; 68 to 188 ms over all parts.
const PERIOD: Nanoseconds = Nanoseconds::from_millis(100);

/// The tasks that hold the control loop up when they hang, by the symbols of their handlers.
const OF_THE_CYCLE: [(&str, &str); 8] = [
    ("ADC", "current_loop"),
    ("CAN2_TX", "control_loop"),
    ("CAN2_RX0", "supervision"),
    ("CAN2_RX1", "velocity_loop"),
    ("EXTI3", "chip_interrupt_0"),
    ("EXTI2", "chip_interrupt_1"),
    ("CAN1_TX", "command_valid"),
    ("CAN1_RX0", "capture_feedback"),
];
/// Those that another task starts, and the velocity loop, with their bits in `drive::Tasks`.
const STARTED: [(&str, u8); 6] =
    [("CAN1_TX", 1), ("CAN1_RX0", 2), ("CAN1_RX1", 4), ("CAN1_SCE", 8), ("CAN2_RX0", 32), ("CAN2_RX1", 64)];

/// Runs until the reset: what was entered and which reset, and the line in which the start tells of it.
#[track_caller]
fn bitten(rig: &mut Rig, what: &str) -> (Vec<What>, String) {
    let incidents = |rig: &Rig| -> Vec<What> {
        rig.qemu.borrow_mut().guest_mut().incidents().iter().map(|incident| incident.what).collect()
    };
    for _ in 0..600 {
        rig.run_ms(1);
        let until_reset = incidents(rig);
        if until_reset.iter().any(|what| matches!(what, What::Reset(_))) {
            rig.run_ms(15);
            let lines = rig.log();
            let line = lines.iter().find(|line| line.contains(" error "));
            return (until_reset, line.unwrap_or_else(|| panic!("{what}: {lines:#?}")).clone());
        }
    }
    panic!("{what}: no reset within 600 ms");
}

const BITTEN: [What; 1] = [What::Reset(Reset::Watchdog)];
/// The early interrupt of the window watchdog, and the reset of the fault handler.
const STOPPED: [What; 2] = [What::Handler(16), What::Reset(Reset::Software)];

/// In CP0, 12 ms after the reset: everything runs, the master is about to begin.
fn started() -> Rig {
    let mut rig = Rig::new(Axis::Horizontal);
    rig.run_ms(16);
    rig
}

#[test]
#[ignore = "needs QEMU and the ELF: cargo xtask test"]
fn a_task_of_the_cycle_that_hangs_ends_the_program_within_a_millisecond_and_is_named() {
    // The current loop runs on top of whoever hangs, for a hundredth of the time or more. Where the watchdog comes just then, the record is that of the current loop:
    // it is the innermost, and its link says that it has interrupted a handler. The next attempt is at another moment.
    const ON_TOP: &str = "control stopped in current_loop, pc ";
    const OF_A_HANDLER: &str = " lr fffffff1";
    for (handler, task) in OF_THE_CYCLE {
        let named = (0..2).any(|attempt| {
            let mut rig = started();
            rig.run_ms(attempt);
            Mistake::Hang.plant(&mut rig.qemu.borrow_mut().guest_mut(), &rig.functions, handler).unwrap();
            let (whats, line) = bitten(&mut rig, task);
            assert_eq!(whats, STOPPED, "{task}");
            let named = line.contains(&format!("control stopped in {task}, pc 080"));
            assert!(named || line.contains(ON_TOP) && line.contains(OF_A_HANDLER), "{task}: {line}");
            named
        });
        assert!(named, "{task}: twice the current loop was on top");
    }
}

#[test]
#[ignore = "needs QEMU and the ELF: cargo xtask test"]
fn another_task_that_hangs_is_bitten_by_the_watchdog() {
    for handler in ["CAN1_RX1", "CAN1_SCE"] {
        let mut rig = started();
        Mistake::Hang.plant(&mut rig.qemu.borrow_mut().guest_mut(), &rig.functions, handler).unwrap();
        let (whats, line) = bitten(&mut rig, handler);
        assert_eq!(whats, BITTEN, "{handler}");
        assert!(line.contains("watchdog: a task did not end"), "{handler}: {line}");
        assert!(rig.log().iter().any(|line| line.contains("started by Watchdog")), "{handler}");
    }
    let mut rig = started();
    Mistake::Hang.plant_in_idle(&mut rig.qemu.borrow_mut().guest_mut(), &rig.functions).unwrap();
    let (whats, line) = bitten(&mut rig, "idle");
    assert_eq!(whats, BITTEN);
    assert!(line.contains("watchdog: a task did not end"), "{line}");
}

#[test]
#[ignore = "needs QEMU and the ELF: cargo xtask test"]
fn a_task_that_is_started_and_does_nothing_is_bitten_by_the_watchdog_and_named() {
    for (handler, bit) in STARTED {
        let mut rig = started();
        Mistake::Silence.plant(&mut rig.qemu.borrow_mut().guest_mut(), &rig.functions, handler).unwrap();
        let (whats, line) = bitten(&mut rig, handler);
        assert_eq!(whats, BITTEN, "{handler}");
        assert!(line.contains(&format!("watchdog: tasks {bit:02x}H")), "{handler}: {line}");
    }
}

#[test]
#[ignore = "needs QEMU and the ELF: cargo xtask test"]
fn loops_that_fall_silent_end_the_program_within_a_millisecond() {
    for handler in ["ADC", "CAN2_TX"] {
        let mut rig = started();
        Mistake::Silence.plant(&mut rig.qemu.borrow_mut().guest_mut(), &rig.functions, handler).unwrap();
        let (whats, line) = bitten(&mut rig, handler);
        assert_eq!(whats, STOPPED, "{handler}");
        assert!(line.contains("control stopped in "), "{handler}: {line}");
    }
}

#[test]
#[ignore = "needs QEMU and the ELF: cargo xtask test"]
fn where_not_even_the_fault_handler_runs_the_watchdog_of_the_loops_resets_and_bridge_and_brake_are_off() {
    let mut rig = Rig::in_state(Axis::Vertical, State::Standstill);
    let begun = rig.world.now();
    for handler in ["HardFault", "ADC"] {
        Mistake::Hang.plant(&mut rig.qemu.borrow_mut().guest_mut(), &rig.functions, handler).unwrap();
    }
    rig.run_ms(3);
    let incidents = rig.qemu.borrow_mut().guest_mut().incidents().to_vec();
    let whats: Vec<What> = incidents.iter().map(|incident| incident.what).collect();
    assert_eq!(whats, [What::Handler(16), What::Reset(Reset::WindowWatchdog)]);
    let after = Nanoseconds(incidents[1].time.0 - begun.0);
    assert!((920_000..=1_300_000).contains(&after.0), "{after}");
    let motor_side = rig.drive.motor_side.borrow();
    assert_eq!(
        (motor_side.bridge_off_at(), motor_side.brake_off_at()),
        (Some(incidents[1].time), Some(incidents[1].time))
    );
}

#[test]
#[ignore = "needs QEMU and the ELF: cargo xtask test"]
fn the_watchdog_is_fed_every_8_ms_and_bites_100_ms_after_that() {
    let mut rig = started();
    // Of all instants between two feedings.
    for step in 0..4_u64 {
        let before = rig.qemu.borrow_mut().guest_mut().incidents().len();
        rig.run(Nanoseconds(step * 2_100_000 + 30_000_000));
        let hangs = rig.world.now();
        Mistake::Hang.plant_in_idle(&mut rig.qemu.borrow_mut().guest_mut(), &rig.functions).unwrap();
        rig.run_ms(130);
        let incidents = rig.qemu.borrow_mut().guest_mut().incidents().to_vec();
        let [reset] = incidents[before..] else { panic!("one reset expected: {incidents:?}") };
        assert_eq!(reset.what, What::Reset(Reset::Watchdog));
        let after = Nanoseconds(reset.time.0 - hangs.0);
        println!("{after} after idle hung");
        assert!((PERIOD.0 - FEEDING.0..=PERIOD.0).contains(&after.0), "{after}");
        // The drive must not stay out of the ring: that is another test.
        rig.qemu.borrow_mut().reset(rig.world.now(), Reset::PowerOn(step + 3)).unwrap();
    }
}

#[test]
#[ignore = "needs QEMU and the ELF: cargo xtask test"]
fn with_a_debugger_attached_nothing_is_reset_but_bridge_and_brake_go_off_all_the_same() {
    let mut rig = Rig::new(Axis::Vertical);
    rig.qemu.borrow_mut().guest_mut().attach_debugger(true).unwrap();
    rig.run_to(State::Standstill);
    assert!(rig.log().iter().any(|line| line.contains("debugger attached, watchdog off")));
    let seen = rig.happen(Event::Mistake(Mistake::Undefined, "CAN2_TX"), None);
    assert_eq!(seen.reset, None, "{seen:?}");
    assert!(seen.bridge_off.unwrap().0 < 100 && seen.brake_off.unwrap().0 < 100, "{seen:?}");
}

#[test]
#[ignore = "needs QEMU and the ELF: cargo xtask test"]
fn without_a_debugger_nothing_is_reset_that_is_well() {
    let mut rig = Rig::in_state(Axis::Horizontal, State::Standstill);
    rig.run_ms(300);
    assert_eq!(rig.qemu.borrow_mut().guest_mut().incidents(), []);
}
