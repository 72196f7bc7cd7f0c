//! What the AT shows, the service channel shows; what was acknowledged is in effect; what a phase protects does not change in it.

use std::collections::{BTreeMap, VecDeque};

use ring::ident::{Element, Idn};

use crate::dialogue::Heard;
use crate::law::{Event, Law, Verdict};
use crate::scene::Scene;
use crate::settings::is_protected_in_cp4;

/// A read takes some cycles; what it shows was in one of so many ATs before it, or will be in the next ones.
const ANSWERS: usize = 12;
const ANSWERS_AFTER: u32 = 3;
/// Data blocks that the drive itself changes, or that read otherwise than they are written: command values, bits that a control bit or an
/// input owns, the password, the commutation angle, what follows another, and the recorder's.
const ALIVE: [u16; 27] = [
    1,
    36,
    37,
    47,
    48,
    80,
    81,
    145,
    258,
    267,
    282,
    301,
    346,
    400,
    405,
    406,
    407,
    0x8013,
    0x8000 | 106,
    0x8000 | 115,
    0x8000 | 118,
    0x8000 | 209,
    0x8000 | 214,
    0x8000 | 221,
    52,
    261,
    99,
];
/// Data that what is written in them changes the weight or the unit of others.
const WEIGHTS: [u16; 16] = [44, 45, 46, 76, 77, 78, 79, 86, 93, 94, 121, 122, 123, 160, 161, 162];

/// Compares what is read with what the ATs show.
#[derive(Default)]
pub(crate) struct AtAndService {
    seen: VecDeque<Vec<(Idn, u32)>>,
    pending: Vec<(Idn, u32, u32)>,
}

impl AtAndService {
    fn compare(&self, idn: Idn, read: u32) -> Verdict {
        let mut values = self.seen.iter().flatten().filter(|(shown, _)| *shown == idn).map(|(_, value)| *value);
        let Some(first) = values.next() else { return Verdict::Silent };
        // A value that moves is read somewhere between.
        if !values.all(|value| value == first) {
            return Verdict::Silent;
        }
        Verdict::of(read == first, || format!("{idn} is {first:X}H in the ATs, and {read:X}H over the service channel"))
    }
}

impl Law for AtAndService {
    fn sentence(&self) -> &'static str {
        "what the AT shows, the service channel shows"
    }

    fn judge(&mut self, event: &Event<'_>, scene: &Scene) -> Verdict {
        match event {
            Event::Answer if scene.wire.phase == 4 => {
                self.seen.push_back(scene.wire.feedbacks().to_vec());
                if self.seen.len() > ANSWERS {
                    self.seen.pop_front();
                }
                for (_, _, left) in &mut self.pending {
                    *left -= 1;
                }
                let done = self.pending.iter().position(|(_, _, left)| *left == 0);
                done.map_or(Verdict::Silent, |done| {
                    let (idn, read, _) = self.pending.swap_remove(done);
                    if self.seen.len() < ANSWERS { Verdict::Silent } else { self.compare(idn, read) }
                })
            }
            Event::Service(Heard::Read(idn, Element::Data, words)) if scene.wire.feedback(*idn).is_some() => {
                let read = words.iter().rev().fold(0, |value, word| value << 16 | u32::from(*word));
                self.pending.push((*idn, read, ANSWERS_AFTER));
                Verdict::Silent
            }
            Event::Mst if scene.wire.phase < 4 => {
                self.seen.clear();
                self.pending.clear();
                Verdict::Silent
            }
            _ => Verdict::Silent,
        }
    }
}

/// Remembers what was acknowledged.
#[derive(Default)]
pub(crate) struct Acknowledged {
    written: BTreeMap<u16, Vec<u16>>,
    /// S-0-0001, if the master has written it since CP2 began; else it is S-0-0002.
    unit_cycle: Option<Vec<u16>>,
}

/// A list or a text has its maximum length as second word: the drive has its own.
fn is_same(written: &[u16], read: &[u16]) -> bool {
    written == read
        || written.len() > 2 && written.len() == read.len() && written[0] == read[0] && written[2..] == read[2..]
        || written.len() == 2 && written[0] == 0 && read.first() == Some(&0) && read.len() == 2
}

impl Law for Acknowledged {
    fn sentence(&self) -> &'static str {
        "what was acknowledged is in effect: it reads as it was written"
    }

    fn judge(&mut self, event: &Event<'_>, scene: &Scene) -> Verdict {
        match event {
            // A command changes what it is for.
            Event::Service(Heard::Written(idn, Element::Data, words)) if is_command(*idn) => {
                if words[..] == [3] && !matches!(idn.0, 99 | 127 | 128 | 139) {
                    self.written.clear();
                }
                Verdict::Silent
            }
            Event::Service(Heard::Written(idn, Element::Data, words)) => {
                if WEIGHTS.contains(&idn.0) {
                    self.written.retain(|number, _| WEIGHTS.contains(number));
                }
                if *idn == Idn::CONTROL_UNIT_CYCLE {
                    self.unit_cycle = Some(words.clone());
                }
                if !ALIVE.contains(&idn.0) && scene.wire.command(*idn).is_none() {
                    self.written.insert(idn.0, words.clone());
                }
                Verdict::Silent
            }
            // The next run-up begins without it, and without what a write may have changed that CP0 left unanswered.
            Event::Mst if scene.wire.phase < 2 => {
                self.unit_cycle = None;
                self.written.retain(|number, _| scene.settings.words(Idn(*number)).is_some());
                Verdict::Silent
            }
            Event::Service(Heard::Read(Idn::CONTROL_UNIT_CYCLE, Element::Data, words)) => {
                let expected = self.unit_cycle.as_deref().or_else(|| scene.settings.words(Idn::CYCLE));
                Verdict::of(expected.is_none_or(|expected| expected == words), || {
                    format!("S-0-0001 is {expected:04X?} by what was written, and reads {words:04X?}")
                })
            }
            Event::Service(Heard::Read(idn, Element::Data, words)) => {
                let written = self.written.get(&idn.0).filter(|_| scene.wire.command(*idn).is_none());
                written.map_or(Verdict::Silent, |written| {
                    Verdict::of(is_same(written, words), || {
                        format!("{idn} was written as {written:04X?} and reads {words:04X?}")
                    })
                })
            }
            _ => Verdict::Silent,
        }
    }
}

/// S-0-0025 and its like.
pub(crate) fn is_command(idn: Idn) -> bool {
    matches!(idn.0, 99 | 127 | 128 | 139 | 146 | 148 | 149 | 152 | 170 | 191 | 262 | 263 | 264 | 293 | 447)
        || matches!(idn.0 ^ 0x8000, 220 | 224..=226)
}

/// Remembers what was known of protected data when CP4 began.
#[derive(Default)]
pub(crate) struct Protected {
    session: Option<ring::Nanoseconds>,
    known: BTreeMap<u16, Vec<u16>>,
}

impl Law for Protected {
    fn sentence(&self) -> &'static str {
        "what a phase protects does not change in it"
    }

    fn judge(&mut self, event: &Event<'_>, scene: &Scene) -> Verdict {
        let Event::Service(heard) = event else { return Verdict::Silent };
        if scene.wire.phase != 4 {
            self.known.clear();
            return Verdict::Silent;
        }
        if self.session != Some(scene.wire.phase_since) {
            self.known.clear();
            self.session = Some(scene.wire.phase_since);
        }
        match heard {
            Heard::Written(idn, Element::Data, words) if is_protected_in_cp4(idn.0) => {
                Verdict::Broken(format!("{idn} was written in CP4 as {words:04X?}, and acknowledged"))
            }
            Heard::Read(idn, Element::Data, words) if is_protected_in_cp4(idn.0) && !is_status(*idn) => {
                let known = self.known.entry(idn.0).or_insert_with(|| {
                    // What was written or read before CP4 is what it must be.
                    scene.settings.words(*idn).unwrap_or(words).to_vec()
                });
                Verdict::of(is_same(known, words), || format!("{idn} was {known:04X?} and is {words:04X?} in CP4"))
            }
            _ => Verdict::Silent,
        }
    }
}

/// Data blocks of the range that are no settings.
fn is_status(idn: Idn) -> bool {
    matches!(idn.0, 1 | 3..=5 | 11..=14 | 17..=23 | 87 | 88 | 90)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::laws::fake::Fake;

    #[test]
    fn a_position_that_stands_reads_as_the_at_shows_it() {
        for (read, lawful) in [(&[7, 0], true), (&[8, 0], false)] {
            let mut fake = Fake::in_cp4(AtAndService::default());
            fake.data[1] = 7_i32.to_le_bytes().to_vec();
            fake.run(20, 0, 0x8000);
            fake.read(51, read);
            fake.run(10, 0, 0x8000);
            assert_eq!(fake.broken().is_none(), lawful, "{:?}", fake.broken());
            assert_eq!(fake.armed(), u64::from(lawful));
        }
    }

    #[test]
    fn what_was_written_and_then_left_unanswered_by_cp0_may_read_either_way() {
        for (unanswered, lawful) in [(Some(92), true), (Some(91), false), (None, false)] {
            let mut fake = Fake::in_cp4(Acknowledged::default());
            fake.write(92, &[7]);
            if let Some(number) = unanswered {
                fake.write_unanswered(number, 8);
            }
            for phase in 0..=4 {
                fake.enter(phase);
            }
            fake.read(92, &[8]);
            assert_eq!(fake.broken().is_none(), lawful, "{unanswered:?}: {:?}", fake.broken());
        }
    }

    #[test]
    fn what_was_written_reads_back() {
        for (read, lawful) in [(7, true), (8, false)] {
            let mut fake = Fake::in_cp4(Acknowledged::default());
            fake.write(92, &[7]);
            fake.read(92, &[read]);
            assert_eq!(fake.broken().is_none(), lawful);
        }
        for (read, lawful) in [(4_000, true), (2_000, false)] {
            let mut fake = Fake::in_cp4(Acknowledged::default());
            fake.write(2, &[4_000]);
            fake.read(1, &[read]);
            assert_eq!(fake.broken().is_none(), lawful);
        }
        let mut fake = Fake::in_cp4(Acknowledged::default());
        fake.write(26, &[4, 4, 11, 12]);
        fake.read(26, &[4, 32, 11, 12]);
        assert_eq!((fake.broken(), fake.armed()), (None, 1));
        fake.read(26, &[2, 32, 11]);
        assert!(fake.broken().is_some());
    }

    #[test]
    fn what_is_protected_stays() {
        let mut fake = Fake::in_cp4(Protected::default());
        fake.read(79, &[0xEE80, 54]);
        assert_eq!((fake.broken(), fake.armed()), (None, 1));
        fake.read(79, &[0xEE81, 54]);
        assert!(fake.broken().is_some());
        let mut fake = Fake::in_cp4(Protected::default());
        fake.write(79, &[1, 0]);
        assert!(fake.broken().is_some_and(|words| words.contains("acknowledged")));
    }
}
