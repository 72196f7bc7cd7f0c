//! The main job with the portable drive: the flashed ELF makes the same run in QEMU (`cargo xtask demo`).

use bench::{Executor, demo};

#[test]
fn a_press_drive_follows_the_line_shaft_within_a_twentieth_of_a_degree_twice_with_the_same_numbers_bit_for_bit() {
    let report = demo(&Executor::Host, &mut |_| {}).unwrap();
    println!("{:?} {:?} {:?} {:?}", report.following, report.missed, report.phases, report.service_release);
    let error = report.following.constant_speed_max_degrees;
    assert!((0.000_1..0.05).contains(&error), "{error} degree");
    assert!(report.service_errors.is_empty());
    assert_eq!((report.missed.mst, report.missed.mdt), (0, 0));
    assert_eq!(report.missed.at, 0);
    let second = demo(&Executor::Host, &mut |_| {}).unwrap();
    assert_eq!(second, report);
}
