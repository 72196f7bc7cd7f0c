//! The flashed ELF, unchanged, in QEMU: the real recording, a tight ring, and the main job.
//!
//! `cargo xtask test` builds the ELF and runs these.

mod common;

use bench::report::Platform;
use bench::{Elves, Executor, ReplayOptions, demo, replay};
use common::{real_recording, tight_ring};

const REASON: &str = "is not set: run `cargo xtask test`, which builds the ELF and runs the tests in QEMU";

fn on_qemu() -> Executor {
    let path = |name: &str| std::env::var_os(name).unwrap_or_else(|| panic!("{name} {REASON}")).into();
    Executor::Qemu(Elves { product: path("PRODUCT_ELF"), shim: path("SHIM_ELF") })
}

#[test]
#[ignore = "needs QEMU and the ELF: cargo xtask test"]
fn the_flashed_elf_does_all_that_the_recorded_drive_did() {
    let Some(recording) = real_recording() else { return };
    let options = ReplayOptions { executor: on_qemu(), ..ReplayOptions::on_host() };
    let report = replay(recording, &options, &mut |_| {}).unwrap();
    assert!(report.passed, "{report:#?}");
    let elf = &report.drives[0];
    assert_eq!((elf.address, elf.platform), (1, Platform::Qemu));
    assert_released_in_time(elf.service_release.as_ref().unwrap());
}

#[test]
#[ignore = "needs QEMU and the ELF: cargo xtask test"]
fn the_flashed_elf_keeps_pace_with_59_us_from_mdt_to_at() {
    let options = ReplayOptions { executor: on_qemu(), ..ReplayOptions::on_host() };
    let report = replay(tight_ring(), &options, &mut |_| {}).unwrap();
    assert!(report.passed, "{report:#?}");
    assert_released_in_time(report.drives[0].service_release.as_ref().unwrap());
}

/// Well within the 59 us of the tight ring, and not so fast that the measurement must be wrong.
fn assert_released_in_time(release: &bench::report::Durations) {
    println!("INT_SC to release: {release:?}");
    assert!(release.count > 50, "{release:?}");
    assert!((5_000..50_000).contains(&release.longest_ns), "{release:?}");
}

#[test]
#[ignore = "needs QEMU and the ELF: cargo xtask test"]
fn the_flashed_elf_follows_the_line_shaft_twice_in_exactly_the_same_way() {
    let executor = on_qemu();
    let first = demo(&executor, &mut |_| {}).unwrap();
    println!("{:?} {:?}", first.following, first.missed);
    let error = first.following.constant_speed_max_degrees;
    assert!((0.000_1..0.05).contains(&error), "{error} degree");
    assert!(first.service_errors.is_empty());
    assert_eq!((first.missed.mst, first.missed.mdt, first.missed.at), (0, 0, 0));
    assert!((5_000..30_000).contains(&first.interrupt_to_at.longest_ns), "{:?}", first.interrupt_to_at);
    let second = demo(&executor, &mut |_| {}).unwrap();
    assert_eq!(first, second);
}
