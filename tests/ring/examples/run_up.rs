//! A ring of two drives, from the first MST to CP4: what the master finds, decides and sends.
//!
//! `cargo run -p ring --example run_up`

use ring::ident::Idn;
use ring::master::{DriveScript, MasterScript, ScriptedMaster, Telegram};
use ring::wire::BitRate;
use ring::{Nanoseconds, Ring, RingConfiguration, SoftwareSlave};

pub(crate) fn main() {
    let addresses = [3, 8];
    let telegram = Telegram::application(&[Idn(51)], &[Idn::VELOCITY_COMMAND]);
    let drives = addresses.map(|address| DriveScript::new(address, telegram.clone()));
    let script = MasterScript { cycle: 1_000, bit_rate: BitRate::M4, ..MasterScript::new(drives.to_vec()) };
    let slaves = addresses.map(SoftwareSlave::new);
    let configuration = RingConfiguration { trace: true, ..RingConfiguration::new(slaves.len(), BitRate::M4) };
    let mut ring = Ring::new(configuration, ScriptedMaster::new(script), slaves.to_vec());

    let mut phase = None;
    while !ring.master().is_done() {
        let now = ring.now() + Nanoseconds::from_millis(1);
        ring.advance(now);
        if phase.replace(ring.master().phase()) != Some(ring.master().phase()) {
            println!("{:>9} CP{}", now.to_string(), ring.master().phase());
        }
        assert!(now < Nanoseconds::from_millis(20_000), "not done: {}", ring.master().state());
    }
    let report = ring.master().report();
    assert_eq!(report.error, None);
    assert_eq!(ring.master().phase(), 4);
    for drive in &report.drives {
        println!("drive {}: {} steps of its service channel", drive.address, drive.steps());
    }
    println!("the last telegrams on the fibre:");
    let trace = ring.trace();
    for entry in &trace[trace.len() - 4..] {
        println!("{:>14} {:?} {:02X?}", entry.time.to_string(), entry.sender, entry.bytes);
    }
}
