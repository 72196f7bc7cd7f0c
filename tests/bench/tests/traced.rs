//! The ELF, counted instruction by instruction on a fast ring.

use super::elves;
use bench::traced;
use emulator::Listing;

/// CAN2_TX.
const CONTROL_LOOP: u16 = 16 + 63;

#[test]
#[ignore = "needs QEMU and the ELF: cargo xtask test"]
fn two_traced_runs_count_the_same() {
    let elves = elves();
    let count =
        || traced(&elves, Listing { slow_bus: 0x6000_0000..0x7000_0000, ..Listing::default() }, &mut |_| {}).unwrap();
    let first = count();
    for (exception, task) in first.activations.tasks() {
        println!("{exception}: {task:?}");
    }
    let control_loop = first.activations.tasks()[&CONTROL_LOOP];
    // Every 125 us; one may lie across a mark.
    let ticks = first.window.as_microseconds() / 125;
    assert!((ticks - 1..=ticks).contains(&control_loop.own.count), "{control_loop:?}");
    assert!((200..5_000).contains(&control_loop.own.least), "{control_loop:?}");
    assert!(control_loop.own.sum < first.activations.executed());
    let second = count();
    assert_eq!(first.activations.tasks(), second.activations.tasks());
    assert_eq!(first.activations.executed(), second.activations.executed());
}
