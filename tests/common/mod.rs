//! Recordings for the replays: the real one, and others made with the scripted master and software slaves.

use crate::recordings::Known;
use ring::capture::Recording;
use ring::ident::Idn;
use ring::master::{DriveScript, MasterScript, ScriptedMaster, SlotChoice, Telegram};
use ring::service_client::Pace;
use ring::slots::Slots;
use ring::software_slave::SoftwareSlave;
use ring::wire::BitRate;
use ring::{Nanoseconds, Ring, RingConfiguration};

/// The recordings that are here: our own master's, and that of a real one where it is found.
pub(crate) fn recordings() -> Vec<(Known, Recording)> {
    let known = crate::recordings::recordings().into_iter();
    known.map(|known| (known.clone(), Recording::open(&known.path).unwrap())).collect()
}

/// A ring in which 59 us lie between the MDT (it ends at 1 958 us of 2 000) and the first AT (17 us).
pub(crate) fn tight_ring() -> Recording {
    // MDT of 3 + 3 * 8 bytes, AT of 7 + 8 bytes at 2 Mbit/s. The MDT has almost no stuffing bits, because the command values are
    // zero: (16 + 8 n) bit times. The ATs are given their longest duration, (16 + 9.6 n) (sercos2.md 5.2).
    let (mdt, at) = (117, 80);
    let slots = Slots { t1: vec![17, 17 + at + 2, 17 + 2 * (at + 2)], t2: 1_958 - mdt, t3: 1_985, t4: 1_698 };
    recorded(&[1, 2, 3], 2_000, SlotChoice::Fixed(slots), Pace::FASTEST, BitRate::M2)
}

/// A recording of a run-up of software slaves by the scripted master.
pub(crate) fn recorded(addresses: &[u8], cycle: u16, slots: SlotChoice, pace: Pace, bit_rate: BitRate) -> Recording {
    let telegram = Telegram::application(&[Idn(11), Idn(51), Idn(0x8013)], &[Idn::VELOCITY_COMMAND]);
    let drives = addresses.iter().map(|&address| DriveScript::new(address, telegram.clone())).collect();
    let script = MasterScript { bit_rate, cycle, slots, pace, ..MasterScript::new(drives) };
    let slaves = addresses.iter().map(|&address| SoftwareSlave::new(address)).collect();
    let configuration = RingConfiguration { trace: true, ..RingConfiguration::new(addresses.len(), bit_rate) };
    let mut ring = Ring::new(configuration, ScriptedMaster::new(script), slaves);
    while !ring.master().is_done() {
        let until = ring.now() + Nanoseconds::from_millis(10);
        ring.advance(until);
    }
    assert_eq!(ring.master().report().error, None);
    let until = ring.now() + Nanoseconds::from_millis(20);
    ring.advance(until);
    Recording::of_trace(ring.trace()).unwrap()
}
