//! A probe value is where the axis was at the edge.

use ring::Nanoseconds;
use ring::ident::{Element, Idn};

use crate::dialogue::Heard;
use crate::law::{Event, Law, Verdict};
use crate::scene::Scene;

/// S-0-0169 bit 0: the positive edge of probe 1 is taken.
const POSITIVE: u16 = 1;
const PROBING: Idn = Idn(170);
/// Where bits of the control get what they set: S-0-0027, 0301, 0303.
const OWNERS: [u16; 3] = [27, 301, 303];
/// Cycles from the acknowledgement of S-0-0405 until the edge is taken for sure, and from the capture of S-0-0051 to its AT.
const ARMING: u64 = 3;
/// In rad/s; a shaft that is slower is where the last AT has shown it.
const STANDSTILL: f64 = 0.01;

/// Waits for the edge of probe 1 while the shaft stands, and for the value.
pub(crate) struct Probes {
    edges: u32,
    /// S-0-0405 as last written; `None`: a bit of the control may have set it.
    level: Option<bool>,
    /// S-0-0405 has gone from 0 to 1 while S-0-0170 was set, and no edge has come since.
    enabled: Option<Nanoseconds>,
    /// S-0-0051 at the edge, in increments.
    taken: Option<f64>,
}

impl Default for Probes {
    fn default() -> Self {
        Self { edges: 0, level: Some(false), enabled: None, taken: None }
    }
}

impl Probes {
    fn edge(&mut self, scene: &Scene) {
        let enabled = self.enabled.take();
        let positive = scene.settings.word(Idn(169)).is_some_and(|word| word & POSITIVE != 0);
        let ready = scene.command == Some(PROBING) && positive && !scene.deceived && scene.wire.answers > ARMING;
        let stands = scene.sight.machine.velocity.abs() < STANDSTILL && scene.is_left_alone(scene.cycles(ARMING, 0));
        let known = !scene.within(scene.rezeroed, scene.cycles(ARMING, 0));
        let armed = enabled.is_some_and(|since| scene.now.saturating_sub(since) > scene.cycles(ARMING, 0));
        self.taken = scene.position_feedback().filter(|_| ready && stands && known && armed);
    }

    fn compare(&self, read: i64, scene: &Scene) -> Verdict {
        let Some((taken, units)) = self.taken.zip(scene.units) else { return Verdict::Silent };
        let tolerance =
            2.0 * scene.quantum(&units) + 2.0 + units.increments * STANDSTILL * scene.cycles(ARMING, 0).as_seconds();
        Verdict::of((taken - read as f64).abs() <= tolerance, || {
            format!("S-0-0051 was {taken} at the edge of probe 1, and S-0-0130 is {read}")
        })
    }
}

impl Law for Probes {
    fn sentence(&self) -> &'static str {
        "a probe value is where the axis was at the edge"
    }

    fn judge(&mut self, event: &Event<'_>, scene: &Scene) -> Verdict {
        match event {
            Event::Look if scene.sight.probe_1_edges != self.edges => {
                self.edges = scene.sight.probe_1_edges;
                self.edge(scene);
            }
            // A second 1 arms nothing: the first edge stays the one that counts.
            Event::Service(Heard::Written(Idn(405), Element::Data, words)) => {
                let before = self.level.replace(words[..] == [1]);
                let rises = before == Some(false) && self.level == Some(true) && scene.command == Some(PROBING);
                self.enabled = rises.then_some(scene.now);
                self.taken = None;
            }
            Event::Service(Heard::Written(idn, Element::Data, _)) if OWNERS.contains(&idn.0) => self.level = None,
            // What is evaluated changes, or begins anew.
            Event::Service(Heard::Written(Idn(169 | 170), Element::Data, _)) => {
                (self.enabled, self.taken) = (None, None)
            }
            Event::Service(Heard::Read(Idn(130), Element::Data, words)) => {
                if let &[low, high] = &words[..] {
                    return self.compare(i64::from((u32::from(high) << 16 | u32::from(low)).cast_signed()), scene);
                }
            }
            Event::Mst if scene.wire.phase < 4 => (self.enabled, self.taken) = (None, None),
            _ => {}
        }
        Verdict::Silent
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::laws::fake::Fake;

    #[test]
    fn the_value_of_an_edge_at_standstill_is_s_0_0051() {
        for (read, lawful) in [(7_000_i32, true), (-7_000, false), (7_000 + 3_600_000, false)] {
            let mut fake = Fake::in_cp4(Probes::default());
            fake.data[1] = 7_000_i32.to_le_bytes().to_vec();
            fake.write(169, &[1]);
            fake.write(170, &[3]);
            fake.write(405, &[1]);
            fake.run(10, 0, 0x8000);
            fake.sight.probe_1_edges = 1;
            fake.run(10, 0, 0x8000);
            fake.read(130, &[read as u16, (read >> 16) as u16]);
            assert_eq!(fake.broken().is_none(), lawful, "{read}: {:?}", fake.broken());
            assert_eq!(fake.armed(), u64::from(lawful));
        }
    }

    #[test]
    fn an_edge_that_nobody_waits_for_has_no_value() {
        let mut fake = Fake::in_cp4(Probes::default());
        fake.run(10, 0, 0x8000);
        fake.sight.probe_1_edges = 1;
        fake.run(10, 0, 0x8000);
        fake.read(130, &[1, 1]);
        assert_eq!((fake.broken(), fake.armed()), (None, 0));
    }

    #[test]
    fn a_second_one_in_s_0_0405_arms_nothing_and_an_edge_between_two_looks_is_the_first_all_the_same() {
        for (again, edges, armed) in [(&[0, 1][..], 1, 1), (&[1], 1, 0), (&[0, 1], 2, 0)] {
            let mut fake = Fake::in_cp4(Probes::default());
            fake.write(169, &[1]);
            fake.write(170, &[3]);
            fake.write(405, &[1]);
            fake.run(10, 0, 0x8000);
            fake.sight.probe_1_edges = 1;
            fake.run(1, 0, 0x8000);
            for value in again {
                fake.write(405, &[*value]);
            }
            fake.run(10, 0, 0x8000);
            for _ in 0..edges {
                fake.data[1] = (i32::from(fake.sight.probe_1_edges == 1) * 500).to_le_bytes().to_vec();
                fake.run(1, 0, 0x8000);
                fake.sight.probe_1_edges += 1;
                fake.run(1, 0, 0x8000);
            }
            fake.read(130, &[500, 0]);
            assert_eq!((fake.broken(), fake.armed()), (None, armed), "{again:?}, {edges}");
        }
    }
}
