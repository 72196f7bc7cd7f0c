//! The recording of a real master, and recordings made here, played against our drives.

use bench::{DriveSetup, ReplayOptions, replay};
use ring::capture::Recording;
use ring::chip::Alternatives;

fn recording() -> Option<Recording> {
    let folder = std::env::var_os("SERCOS_CAPTURES").map_or_else(
        || std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/captures"),
        std::path::PathBuf::from,
    );
    let path = folder.join("fc7502-four-drives.tsv");
    if !path.exists() {
        eprintln!("SKIPPED: no recording at {}; set SERCOS_CAPTURES to the folder of recordings", path.display());
        return None;
    }
    Some(Recording::open(&path).unwrap())
}

#[test]
fn four_drives_do_all_that_the_recorded_ones_did() {
    let Some(recording) = recording() else { return };
    let report = replay(recording, &ReplayOptions::on_host(), &mut |_| {}).unwrap();
    for drive in &report.drives {
        println!("{drive:?}");
    }
    assert!(report.passed);
    assert_eq!(report.drives.len(), 4);
}

#[test]
fn the_recording_passes_whichever_way_the_silicon_turns_out() {
    let Some(recording) = recording() else { return };
    let variants: Vec<_> = Alternatives::singles().into_iter().chain(Alternatives::pairs()).collect();
    let workers = std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
    let failures: Vec<String> = std::thread::scope(|scope| {
        let share = variants.len().div_ceil(workers);
        let threads: Vec<_> = variants
            .chunks(share)
            .map(|variants| {
                let recording = &recording;
                scope.spawn(move || variants.iter().flat_map(|variant| failures_with(recording, variant)).collect())
            })
            .collect();
        threads.into_iter().flat_map(|thread: std::thread::ScopedJoinHandle<'_, Vec<String>>| thread.join().unwrap()).collect()
    });
    assert!(failures.is_empty(), "{} failures:\n{}", failures.len(), failures.join("\n"));
}

fn failures_with(recording: &Recording, (name, alternatives): &(String, Alternatives)) -> Vec<String> {
    let drive = DriveSetup { alternatives: alternatives.clone(), ..DriveSetup::new(1) };
    let options = ReplayOptions { drive, ..ReplayOptions::on_host() };
    let report = replay(recording.clone(), &options, &mut |_| {}).unwrap();
    let failed = report.drives.iter().filter_map(|drive| Some((drive.address, drive.failure.as_ref()?)));
    failed.map(|(address, failure)| format!("{name}: drive {address}: {failure}")).collect()
}
