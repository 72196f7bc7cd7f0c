//! The record of a crash: what it says, that it is kept, and where it is shown.

use emulator::{Mistake, Reset, What};

use super::rig::{Axis, Event, Rig, STARTED_MS, State};

/// The guard below the stack, as the protection unit has it: all of it, and as near to the statics as it gets.
fn guard(rig: &Rig) -> std::ops::Range<u32> {
    const BYTES: u32 = 8 * 1024;
    const GRAIN: u32 = 2 * 1024;
    let guard = rig.qemu.borrow_mut().guest_mut().guard().unwrap().unwrap();
    let start = rig.functions.data("__sheap").unwrap().next_multiple_of(GRAIN);
    assert_eq!(guard, start..start + BYTES);
    guard
}

/// The line in which the start after the crash tells of it.
#[track_caller]
fn told(rig: &Rig, words: &str) -> String {
    let lines = rig.log();
    let line = lines.iter().find(|line| line.contains("error") && line.contains(words));
    line.unwrap_or_else(|| panic!("{words} expected: {lines:#?}")).clone()
}

#[test]
#[ignore = "needs QEMU and the ELF: cargo xtask test"]
fn a_stack_that_overflows_ends_at_its_guard_with_a_record_that_says_so() {
    const PAINT: u32 = 0xA5A5_5A5A;
    for task in ["CAN2_TX", "CAN1_SCE", "ADC"] {
        let mut rig = Rig::in_state(Axis::Vertical, State::Standstill);
        let guard = guard(&rig);
        let words = (guard.end - guard.start) as usize / 4;
        rig.qemu.borrow_mut().guest_mut().write_memory(guard.start, &vec![PAINT; words]).unwrap();
        if task == "CAN1_SCE" {
            rig.request(12);
        }
        let seen = rig.happen(Event::Mistake(Mistake::Recursion, task), None);
        assert!(matches!(seen.incidents[0].what, What::Handler(3)), "{seen:?}");
        assert!(seen.bridge_off.unwrap().0 < 100 && seen.brake_off.unwrap().0 < 100, "{task}: {seen:?}");
        let memory = rig.qemu.borrow_mut().guest_mut().read_memory(guard.start, words).unwrap();
        assert!(memory.iter().all(|word| *word == PAINT), "{task}: the guard was written to");
        rig.run_ms(STARTED_MS);
        let line = told(&rig, "stack overflow");
        println!("{line}");
        let name = match task {
            "CAN2_TX" => "control_loop",
            "CAN1_SCE" => "service_channel",
            _ => "current_loop",
        };
        // Where a current loop comes on top of the last word that there is, it is the one.
        assert!(line.contains(name) || line.contains("current_loop"), "{line}");
    }
}

#[test]
#[ignore = "needs QEMU and the ELF: cargo xtask test"]
fn a_panic_names_its_task_its_file_and_its_line() {
    let mut rig = Rig::in_state(Axis::Horizontal, State::Standstill);
    rig.happen(Event::Mistake(Mistake::Panic, "CAN1_RX0"), None);
    rig.run_ms(STARTED_MS);
    let line = told(&rig, "panic in capture_feedback at ");
    let (_, place) = line.split_once(" at ").unwrap();
    let (file, rest) = place.split_once(".rs:").unwrap();
    let number: u32 = rest.split(',').next().unwrap().parse().unwrap();
    assert!(file.len() > 3 && number > 0, "{line}");
}

#[test]
#[ignore = "needs QEMU and the ELF: cargo xtask test"]
fn an_exception_that_nobody_is_bound_to_and_a_dead_crystal_are_told_apart_from_a_fault() {
    let mut rig = Rig::in_state(Axis::Horizontal, State::Standstill);
    let seen = rig.happen(Event::Mistake(Mistake::Call, "CAN2_RX0"), None);
    // SVCall, whose vector nobody has.
    assert!(matches!(seen.incidents[0].what, What::Handler(11)), "{seen:?}");
    assert!(seen.bridge_off.unwrap().0 < 100, "{seen:?}");
    rig.run_ms(STARTED_MS);
    told(&rig, "interrupt without a task in supervision");
    let mut rig = Rig::in_state(Axis::Horizontal, State::Standstill);
    rig.happen(Event::CrystalFails, None);
    // Nothing goes on without a crystal, and nothing is on.
    rig.run_ms(STARTED_MS);
    assert!(!rig.log().iter().any(|line| line.contains("crystal failed")));
    let now = rig.world.now();
    rig.qemu.borrow_mut().guest_mut().mend_crystal(now);
    rig.run_ms(STARTED_MS);
    told(&rig, "crystal failed in ");
}

#[test]
#[ignore = "needs QEMU and the ELF: cargo xtask test"]
fn the_record_is_shown_over_the_ring_and_in_the_error_memory_and_is_news_only_once() {
    let mut rig = Rig::in_state(Axis::Horizontal, State::AtSpeed);
    rig.happen(Event::Mistake(Mistake::Undefined, "CAN2_TX"), None);
    rig.run_ms(STARTED_MS);
    rig.run_up_again();
    let text = rig.text(0x8000 | 12);
    assert!(text.starts_with("fault in control_loop, pc 080"), "{text}");
    let address = rig.functions.address("CAN2_TX").unwrap();
    let words = rig.longs(0x8000 | 13);
    // Cause 1, exception 79 (CAN2_TX), and where the instruction was planted.
    assert_eq!((words[0] & 0x7F, words[0] >> 16, words[1], words[2]), (1, 79, 1, address), "{words:08x?}");
    assert_eq!(rig.list(375), [0xF120]);
    // A reset by the pin: what was told is no news, and still there.
    let now = rig.world.now();
    rig.qemu.borrow_mut().reset(now, Reset::Pin).unwrap();
    rig.run_ms(STARTED_MS);
    for words in ["before: fault in control_loop", "started by ResetPin"] {
        assert!(rig.log().iter().any(|line| line.contains(words)), "{words}: {:#?}", rig.log());
    }
    rig.run_up_again();
    assert_eq!((rig.text(0x8000 | 12), rig.list(375)), (text.clone(), vec![0xF120]));
    // The supply goes: what lies in the RAM is no record, what lies in the flash is.
    let now = rig.world.now();
    rig.qemu.borrow_mut().reset(now, Reset::PowerOn(11)).unwrap();
    rig.run_ms(STARTED_MS);
    rig.run_up_again();
    assert_eq!((rig.text(0x8000 | 12), rig.list(375)), (text, vec![0xF120]));
    assert_eq!(rig.longs(0x8000 | 13)[2], address);
}

/// One drive, whose supply goes after each of its crashes: what lies in the RAM is no record then, what lies in the flash is.
#[test]
#[ignore = "needs QEMU and the ELF: cargo xtask test"]
fn a_crash_in_each_task_is_in_the_error_memory_with_its_place_after_the_supply_was_cut() {
    const FAULT: u16 = 0xF120;
    const TASKS: [(&str, Option<&str>); 11] = [
        ("current_loop", Some("ADC")),
        ("chip_interrupt_0", Some("EXTI3")),
        ("chip_interrupt_1", Some("EXTI2")),
        ("command_valid", Some("CAN1_TX")),
        ("capture_feedback", Some("CAN1_RX0")),
        ("control_loop", Some("CAN2_TX")),
        ("supervision", Some("CAN2_RX0")),
        ("velocity_loop", Some("CAN2_RX1")),
        ("phase_change", Some("CAN1_RX1")),
        ("service_channel", Some("CAN1_SCE")),
        ("idle or init", None),
    ];
    let mut rig = Rig::new(Axis::Horizontal);
    rig.run_ms(STARTED_MS);
    rig.run_up_again();
    for (crash, (task, vector)) in TASKS.into_iter().enumerate() {
        match task {
            "phase_change" => rig.begin_again(),
            "service_channel" => rig.request(12),
            _ => {}
        }
        let undefined = Mistake::Undefined;
        let (event, places) = match vector {
            Some(vector) => (Event::Mistake(undefined, vector), vec![rig.functions.address(vector).unwrap()]),
            None => (Event::InIdle(undefined), rig.functions.waits_in_idle()),
        };
        let seen = rig.happen(event, None);
        assert!(seen.reset.is_some(), "{task}: {seen:?}");
        // It is told at the start, and kept as soon as idle comes to it.
        rig.run_ms(STARTED_MS);
        told(&rig, &format!("fault in {task}"));
        let now = rig.world.now();
        rig.qemu.borrow_mut().reset(now, Reset::PowerOn(crash as u64)).unwrap();
        rig.run_ms(STARTED_MS);
        rig.run_up_again();
        let (text, words, errors) = (rig.text(0x8000 | 12), rig.longs(0x8000 | 13), rig.list(375));
        println!("{text}");
        assert!(text.starts_with(&format!("fault in {task}, pc 080")), "{task}: {text}");
        assert!(places.contains(&words[2]), "{task}: {words:08x?} is none of {places:08x?}");
        let faults = errors.iter().filter(|number| **number == FAULT).count();
        assert_eq!((faults, errors[0]), (crash + 1, FAULT), "{task}: {errors:04X?}");
    }
}

#[test]
#[ignore = "needs QEMU and the ELF: cargo xtask test"]
fn after_three_crashes_in_a_row_the_drive_stays_out_of_the_ring_until_the_next_reset() {
    let mut rig = Rig::new(Axis::Horizontal);
    let resets = |rig: &Rig| {
        let qemu = &mut *rig.qemu.borrow_mut();
        qemu.guest_mut().incidents().iter().filter(|incident| matches!(incident.what, What::Reset(_))).count()
    };
    for crash in 1..=3 {
        rig.run_ms(15);
        Mistake::Undefined.plant(&mut rig.qemu.borrow_mut().guest_mut(), &rig.functions, "CAN2_TX").unwrap();
        rig.run_ms(1);
        assert_eq!(resets(&rig), crash);
    }
    rig.run_ms(30);
    assert_eq!(resets(&rig), 3, "it neither runs on nor bites");
    told(&rig, "3 crashes in a row: out of the ring");
    assert!(rig.log().last().is_some_and(|line| line.contains("out of the ring")), "it went on: {:#?}", rig.log());
    let now = rig.world.now();
    rig.qemu.borrow_mut().reset(now, Reset::Pin).unwrap();
    rig.run_ms(STARTED_MS);
    assert!(rig.log().last().is_some_and(|line| line.contains("class 1 diagnostic")), "{:#?}", rig.log());
    assert_eq!(resets(&rig), 4);
}
