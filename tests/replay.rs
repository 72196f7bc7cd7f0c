//! Recordings of masters, a real one and ours, played against our drives.

use crate::common::{recorded, recordings, tight_ring};
use crate::recordings::ours;
use bench::{DriveSetup, ReplayOptions, replay};
use ring::Nanoseconds;
use ring::capture::Recording;
use ring::chip::Alternatives;
use ring::master::SlotChoice;
use ring::service_client::Pace;
use ring::slots::MdtPlace;
use ring::wire::BitRate;

#[test]
fn four_drives_do_all_that_the_recorded_ones_did() {
    for (known, recording) in recordings() {
        let report = replay(recording, &ReplayOptions::on_host(), &mut |_| {}).unwrap();
        assert!(report.passed, "{report:#?}");
        assert_eq!(report.drives.len(), 4);
        for drive in &report.drives {
            assert_eq!(drive.written, known.written, "{known:?}");
            assert!(drive.service_steps >= 127, "{known:?}: {} steps", drive.service_steps);
        }
    }
}

/// `UPDATE_GOLDEN=1` makes it anew.
#[test]
fn the_recording_in_the_tree_is_what_our_master_sends() {
    let made = recorded(&[1, 2, 3, 4], 2_000, SlotChoice::Computed(MdtPlace::Late), Pace::RECORDED, BitRate::M2);
    let path = ours().path;
    if std::env::var_os("UPDATE_GOLDEN").is_some() {
        std::fs::write(&path, made.to_text()).unwrap();
    }
    assert!(Recording::open(&path).unwrap() == made, "set UPDATE_GOLDEN=1 to record the master as it is now");
}

#[test]
fn a_ring_with_59_us_from_mdt_to_at_is_served_in_time() {
    let report = replay(tight_ring(), &ReplayOptions::on_host(), &mut |_| {}).unwrap();
    assert!(report.passed, "{report:#?}");
}

#[test]
fn a_processor_too_slow_for_a_tight_ring_is_found_out() {
    let mut drive = DriveSetup::catalogue(1);
    drive.latency.background = Nanoseconds::from_microseconds(62);
    let options = ReplayOptions { drive, ..ReplayOptions::on_host() };
    let report = replay(tight_ring(), &options, &mut |_| {}).unwrap();
    let first = report.drives[0].failure.as_deref().unwrap();
    assert!(first.contains("not acknowledged"), "{first}");
}

#[test]
fn recordings_with_other_times_and_addresses_pass() {
    for (cycle, bit_rate) in [(2_000, BitRate::M2), (10_000, BitRate::M2), (1_000, BitRate::M4), (500, BitRate::M16)] {
        let options = ReplayOptions { bit_rate, ..ReplayOptions::on_host() };
        let report = replay(other_ring(cycle, bit_rate), &options, &mut |_| {}).unwrap();
        assert!(report.passed, "{cycle} us, {bit_rate:?}: {report:#?}");
        assert_eq!(report.drives.iter().map(|drive| drive.address).collect::<Vec<_>>(), [3, 7, 12, 31, 200]);
    }
}

#[test]
fn the_recording_passes_whichever_way_the_silicon_turns_out() {
    let recordings = recordings();
    let (_, recording) = recordings.last().unwrap();
    let variants: Vec<_> = Alternatives::singles().into_iter().chain(Alternatives::pairs()).collect();
    let workers = std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
    let failures: Vec<String> = std::thread::scope(|scope| {
        let share = variants.len().div_ceil(workers);
        let threads: Vec<_> = variants
            .chunks(share)
            .map(|variants| {
                scope.spawn(move || -> Vec<String> {
                    variants.iter().flat_map(|variant| failures_with(recording, variant)).collect()
                })
            })
            .collect();
        threads.into_iter().flat_map(|thread| thread.join().unwrap()).collect()
    });
    assert!(failures.is_empty(), "{} failures:\n{}", failures.len(), failures.join("\n"));
}

/// A ring with other addresses, times and cycle, as the slot rules give them.
fn other_ring(cycle: u16, bit_rate: BitRate) -> Recording {
    let slots = SlotChoice::Computed(MdtPlace::Late);
    recorded(&[7, 3, 200, 12, 31], cycle, slots, Pace::RECORDED, bit_rate)
}

fn failures_with(recording: &Recording, (name, alternatives): &(String, Alternatives)) -> Vec<String> {
    let drive = DriveSetup { alternatives: *alternatives, ..DriveSetup::catalogue(1) };
    let options = ReplayOptions { drive, ..ReplayOptions::on_host() };
    let report = replay(recording.clone(), &options, &mut |_| {}).unwrap();
    let failed = report.drives.iter().filter_map(|drive| Some((drive.address, drive.failure.as_ref()?)));
    failed.map(|(address, failure)| format!("{name}: drive {address}: {failure}")).collect()
}
