//! The run-up of a ring of our drives by the scripted master.

use bench::{DriveSetup, ring_of_drives};
use ring::ident::{Idn, Value};
use ring::master::{DriveScript, MasterError, MasterScript, ScriptedMaster, Telegram};
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
    let report = run(MasterScript::new(drives.to_vec()), &[1, 2, 3].map(DriveSetup::catalogue));
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
    // Lists take words over the service channel that the chip accepts by itself.
    let lists = Telegram::application(&[Idn(11), Idn(51), Idn(0x8013)], &[Idn::VELOCITY_COMMAND]);
    let mut failures = Vec::new();
    let variants: Vec<_> =
        ring::chip::Alternatives::singles().into_iter().chain(ring::chip::Alternatives::pairs()).collect();
    println!("{} variants", variants.len());
    for (name, alternatives) in variants {
        let drives = [1, 2].map(|address| DriveScript::new(address, lists.clone()));
        let setups = [1, 2].map(|address| DriveSetup { alternatives, ..DriveSetup::catalogue(address) });
        let report = run(MasterScript::new(drives.to_vec()), &setups);
        if let Some(error) = report.error {
            failures.push(format!("{name}: {error}"));
        }
    }
    assert!(failures.is_empty(), "{} failures:\n{}", failures.len(), failures.join("\n"));
}

#[test]
fn a_parameter_that_does_not_fit_keeps_the_ring_out_of_cp3_and_is_named_in_s_0_0021() {
    // S-0-0001 of 3 ms is no multiple of S-0-0002, 2 ms.
    let drive = DriveScript::new(1, Telegram::standard(2).unwrap()).with(Idn(1), Value::Word(3_000));
    let report = run(MasterScript::new(vec![drive]), &[DriveSetup::catalogue(1)]);
    match &report.error {
        Some(MasterError::CheckRefused { address: 1, invalid, .. }) => assert_eq!(invalid, &[Idn(1)]),
        other => panic!("{other:?}"),
    }
    assert!(report.phases.iter().all(|phase| phase.phase < 3));
}
