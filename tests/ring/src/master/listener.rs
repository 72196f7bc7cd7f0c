//! What comes back to a master: its own telegrams, which it only takes note of, and the ATs.

use super::SHORTEST_AT;
use crate::service_client::AtWords;
use crate::time::Nanoseconds;
use crate::wire::BROADCAST;

/// The receiving end of a master, over one cycle.
#[derive(Clone, Debug, Default)]
pub(crate) struct Listener {
    /// End of this cycle's MST as it came back.
    mst_returned: Option<Nanoseconds>,
    last_mdt: Vec<u8>,
}

impl Listener {
    /// Forgets the cycle that is over.
    pub(crate) fn begin_cycle(&mut self) {
        self.mst_returned = None;
        self.last_mdt.clear();
    }

    /// To be told of every MDT, which is no AT when it comes back.
    pub(crate) fn mdt_sent(&mut self, bytes: &[u8]) {
        self.last_mdt.clear();
        self.last_mdt.extend(bytes);
    }

    /// Takes note of a telegram that ended at `end` and whose check sequence is good; true if it is an AT.
    pub(crate) fn is_at(&mut self, phase: u8, end: Nanoseconds, bytes: &[u8]) -> bool {
        match bytes {
            [BROADCAST, returned] if *returned == phase => {
                self.mst_returned.get_or_insert(end);
                false
            }
            [BROADCAST, ..] => false,
            _ => bytes.len() >= SHORTEST_AT && bytes != self.last_mdt,
        }
    }

    /// Has this cycle's MST come back?
    pub(crate) fn mst_has_returned(&self) -> bool {
        self.mst_returned.is_some()
    }

    /// The time from the end of the MST as it came back; `None` without one.
    pub(crate) fn since_mst(&self, time: Nanoseconds) -> Option<Nanoseconds> {
        self.mst_returned.map(|mst| time.saturating_sub(mst))
    }
}

/// Status and info word of an AT, which has at least [`SHORTEST_AT`] bytes.
pub(crate) fn at_words(at: &[u8]) -> AtWords {
    let word = |at_byte: usize| u16::from_le_bytes([at[at_byte], at[at_byte + 1]]);
    AtWords { status: word(1), info: word(3) }
}

#[cfg(test)]
mod tests {
    use super::*;

    const AT: [u8; 5] = [7, 0x34, 0x12, 0x78, 0x56];

    #[test]
    fn only_telegrams_that_the_master_did_not_send_are_ats() {
        let mut listener = Listener::default();
        let end = Nanoseconds(10);
        listener.mdt_sent(&[7, 1, 2, 3, 4]);
        assert!(!listener.is_at(2, end, &[7, 1, 2, 3, 4]), "the MDT of CP1 and CP2 as it comes back");
        assert!(!listener.is_at(2, end, &[BROADCAST, 1, 2, 3, 4]), "that of CP3 and CP4");
        assert!(!listener.is_at(2, end, &AT[..4]), "too short");
        assert!(listener.is_at(2, end, &AT));
        listener.begin_cycle();
        assert!(listener.is_at(2, end, &[7, 1, 2, 3, 4]), "the MDT of a cycle that is over");
        assert_eq!(at_words(&AT), AtWords { status: 0x1234, info: 0x5678 });
    }

    #[test]
    fn time_counts_from_the_first_mst_of_the_phase_that_comes_back() {
        let mut listener = Listener::default();
        assert!(!listener.is_at(2, Nanoseconds(5), &[BROADCAST, 3]));
        assert_eq!(listener.since_mst(Nanoseconds(100)), None);
        assert!(!listener.mst_has_returned());
        for end in [20, 30] {
            assert!(!listener.is_at(2, Nanoseconds(end), &[BROADCAST, 2]));
        }
        assert!(listener.mst_has_returned());
        assert_eq!(listener.since_mst(Nanoseconds(100)), Some(Nanoseconds(80)));
        listener.begin_cycle();
        assert_eq!(listener.since_mst(Nanoseconds(100)), None);
    }
}
