//! The watchdog: started, with its period, and fed only while every task makes progress.

use emulator::{Mistake, Reset, What};
use ring::Nanoseconds;

use super::rig::{Axis, Event, Rig, State};

/// Longest time between two feedings.
const FEEDING: Nanoseconds = Nanoseconds(8_125_000);
/// At the nominal 32 kHz of its oscillator; 68 to 188 ms over all parts.
const PERIOD: Nanoseconds = Nanoseconds::from_millis(100);

/// The tasks that run from the start on, by the symbols of their handlers, and those that the ring starts, with their bits in `drive::Work`.
const TASKS: [(&str, &str); 5] = [
    ("ADC", "current_loop"),
    ("CAN2_TX", "control_loop"),
    ("CAN2_RX0", "supervision"),
    ("EXTI3", "chip_interrupt_0"),
    ("EXTI2", "chip_interrupt_1"),
];
const STARTED: [(&str, u8); 5] = [("CAN1_TX", 1), ("CAN1_RX0", 2), ("CAN1_RX1", 4), ("CAN1_SCE", 8), ("CAN2_RX0", 32)];

/// Runs until the reset, and tells how long before it the watchdog was fed last.
#[track_caller]
fn bitten(rig: &mut Rig, what: &str) -> String {
    let incidents = |rig: &Rig| rig.qemu.borrow_mut().guest_mut().incidents().to_vec();
    for _ in 0..600 {
        rig.run_ms(1);
        if let Some(reset) = incidents(rig).iter().find(|incident| matches!(incident.what, What::Reset(_))) {
            assert_eq!(reset.what, What::Reset(Reset::Watchdog), "{what}");
            assert_eq!(incidents(rig).len(), 1, "{what}: {:?}", incidents(rig));
            rig.run_ms(15);
            let lines = rig.log();
            let line =
                lines.iter().find(|line| line.contains("watchdog")).unwrap_or_else(|| panic!("{what}: {lines:#?}"));
            assert!(lines.iter().any(|line| line.contains("started by Watchdog")), "{what}");
            return line.clone();
        }
    }
    panic!("{what}: no reset within 600 ms");
}

/// In CP0, 12 ms after the reset: everything runs, the master is about to begin.
fn started() -> Rig {
    let mut rig = Rig::new(Axis::Horizontal);
    rig.run_ms(12);
    rig
}

#[test]
#[ignore = "needs QEMU and the ELF: cargo xtask test"]
fn a_task_that_hangs_or_an_idle_task_that_does_is_bitten_by_the_watchdog() {
    let tasks = TASKS.into_iter().chain([("CAN1_RX1", "phase_change"), ("CAN1_SCE", "service_channel")]);
    let tasks = tasks.chain([("CAN1_TX", "command_valid"), ("CAN1_RX0", "capture_feedback")]);
    for (handler, task) in tasks {
        let mut rig = started();
        let guest = Mistake::Hang;
        guest.plant(rig.qemu.borrow_mut().guest_mut(), &rig.functions, handler).unwrap();
        let line = bitten(&mut rig, task);
        assert!(line.contains("a task did not end"), "{task}: {line}");
    }
    let mut rig = started();
    Mistake::hang_idle(rig.qemu.borrow_mut().guest_mut(), &rig.functions).unwrap();
    let line = bitten(&mut rig, "idle");
    assert!(line.contains("a task did not end"), "{line}");
}

#[test]
#[ignore = "needs QEMU and the ELF: cargo xtask test"]
fn a_task_that_is_started_and_does_nothing_is_bitten_by_the_watchdog_and_named() {
    for (handler, bit) in STARTED {
        let mut rig = started();
        Mistake::Silence.plant(rig.qemu.borrow_mut().guest_mut(), &rig.functions, handler).unwrap();
        let line = bitten(&mut rig, handler);
        assert!(line.contains(&format!("tasks {bit:02x}H")), "{handler}: {line}");
    }
    // Nothing ticks any more.
    for handler in ["ADC", "CAN2_TX"] {
        let mut rig = started();
        Mistake::Silence.plant(rig.qemu.borrow_mut().guest_mut(), &rig.functions, handler).unwrap();
        bitten(&mut rig, handler);
    }
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
        Mistake::hang_idle(rig.qemu.borrow_mut().guest_mut(), &rig.functions).unwrap();
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
