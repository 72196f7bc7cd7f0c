//! From the very first instruction: whenever a reset comes, bridge and brake stay off, and the drive starts.

use emulator::{Mistake, Reset, What};
use ring::Nanoseconds;

use super::rig::{Axis, Rig, STARTED_MS};

#[test]
#[ignore = "needs QEMU and the ELF: cargo xtask test"]
fn whenever_a_reset_comes_during_the_start_nothing_is_switched_on_and_the_drive_starts() {
    let mut rig = Rig::new(Axis::Vertical);
    let kinds = [Reset::Pin, Reset::BrownOut, Reset::PowerOn(17), Reset::Software];
    // 10 ms of start in steps that fall on other instructions each time: crystal, PLL, pins, chip, first ticks.
    for (step, kind) in (0..24_u64).zip(kinds.iter().cycle()) {
        rig.run(Nanoseconds(step * 431_317 + 13));
        rig.assert_nothing_was_ever_on();
        let now = rig.world.now();
        rig.qemu.borrow_mut().reset(now, *kind).unwrap();
        rig.assert_nothing_was_ever_on();
    }
    rig.run_ms(STARTED_MS);
    rig.assert_nothing_was_ever_on();
    assert!(rig.log().last().is_some_and(|line| line.contains("class 1 diagnostic")), "{:#?}", rig.log());
    assert!(!rig.log().iter().any(|line| line.contains(" error ")), "a crash that was none: {:#?}", rig.log());
}

#[test]
#[ignore = "needs QEMU and the ELF: cargo xtask test"]
fn a_fault_before_the_clocks_run_is_recorded_too() {
    let mut rig = Rig::new(Axis::Horizontal);
    Mistake::Undefined.plant(&mut rig.qemu.borrow_mut().guest_mut(), &rig.functions, "main").unwrap();
    // The statics are set up at 16 MHz before.
    rig.run_ms(9);
    let incidents = rig.qemu.borrow_mut().guest_mut().incidents().to_vec();
    let whats: Vec<What> = incidents.iter().map(|incident| incident.what).collect();
    assert_eq!(whats, [What::Handler(3), What::Reset(Reset::Software)]);
    rig.run_ms(STARTED_MS);
    assert!(rig.log().iter().any(|line| line.contains("fault in idle or init, pc 080")), "{:#?}", rig.log());
    rig.assert_nothing_was_ever_on();
}
