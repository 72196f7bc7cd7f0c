//! Random bytes, and the seeds of the fuzz targets.

use std::path::Path;

use proptest::prelude::*;

/// As long as cargo-fuzz makes an input.
const LONGEST_INPUT: usize = 256;

fn any_bytes() -> impl Strategy<Value = Vec<u8>> {
    prop::collection::vec(any::<u8>(), 0..LONGEST_INPUT)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(4_096))]

    #[test]
    fn after_any_stream_of_steps_and_phases_a_proper_run_up_ends_in_cp4(bytes in any_bytes()) {
        garbage::service_channel(&bytes);
    }

    #[test]
    fn whatever_values_pass_the_checks_make_a_drive_and_a_proper_run_up_ends_in_cp4(bytes in any_bytes()) {
        garbage::configuration(&bytes);
    }

    #[test]
    fn whatever_the_works_have_written_is_taken_or_refused(bytes in any_bytes()) {
        garbage::production_record(&bytes);
    }

    #[test]
    fn no_recording_and_no_telegram_panics_or_hangs(bytes in any_bytes()) {
        garbage::capture(&bytes);
    }
}

#[test]
fn the_seeds_hold() {
    let seeds = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fuzz/seeds");
    for (target, holds) in [
        ("service_channel", garbage::service_channel as fn(&[u8])),
        ("configuration", garbage::configuration),
        ("production_record", garbage::production_record),
        ("capture", garbage::capture),
    ] {
        let mut files = 0;
        for entry in std::fs::read_dir(seeds.join(target)).unwrap() {
            let path = entry.unwrap().path();
            println!("{}", path.display());
            holds(&std::fs::read(path).unwrap());
            files += 1;
        }
        assert!(files > 0, "{target} has no seed");
    }
}
