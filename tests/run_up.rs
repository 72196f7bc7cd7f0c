//! The run-up of a ring of our drives by the scripted master.

use bench::{DriveSetup, ring_of_drives};
use ring::master::{DriveScript, MasterScript, ScriptedMaster, Telegram};
use ring::wire::BitRate;
use ring::{Nanoseconds, RingConfiguration};

fn run(script: MasterScript, setups: &[DriveSetup]) -> ring::master::MasterReport {
    let master = ScriptedMaster::new(script);
    let (mut world, _) = ring_of_drives(RingConfiguration::new(setups.len(), BitRate::M2), master, setups).unwrap();
    while !world.ring().master().is_done() {
        let now = world.now();
        assert!(now < Nanoseconds::from_millis(60_000), "{}", world.ring().master().state());
        world.run_until(now + Nanoseconds::from_millis(10)).unwrap();
    }
    world.ring().master().report().clone()
}

#[test]
fn three_drives_reach_cp4() {
    let drives = [1, 2, 3].map(|address| DriveScript::new(address, Telegram::standard(2).unwrap()));
    let report = run(MasterScript::new(drives.to_vec()), &[1, 2, 3].map(DriveSetup::new));
    assert_eq!(report.error, None);
    assert_eq!(report.phases.last().map(|phase| phase.phase), Some(4));
    for drive in &report.drives {
        println!(
            "{} steps {} slowest {} missed {}",
            drive.address,
            drive.steps(),
            drive.slowest_step(),
            drive.missed_ats
        );
    }
}

#[test]
fn whichever_way_the_silicon_turns_out_the_ring_runs_up() {
    let mut failures = Vec::new();
    let variants: Vec<_> =
        ring::chip::Alternatives::singles().into_iter().chain(ring::chip::Alternatives::pairs()).collect();
    println!("{} variants", variants.len());
    for (name, alternatives) in variants {
        let drives = [1, 2].map(|address| DriveScript::new(address, Telegram::standard(2).unwrap()));
        let setups = [1, 2].map(|address| DriveSetup { alternatives, ..DriveSetup::new(address) });
        let report = run(MasterScript::new(drives.to_vec()), &setups);
        if let Some(error) = report.error {
            failures.push(format!("{name}: {error}"));
        }
    }
    assert!(failures.is_empty(), "{} failures:\n{}", failures.len(), failures.join("\n"));
}
