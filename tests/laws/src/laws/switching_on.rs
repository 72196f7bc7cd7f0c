//! The bridge switches on only after an edge of bits 15 and 14 seen in this CP4, with C1D = 0.

use ring::Nanoseconds;
use ring::ident::{Element, Idn};
use ring::service_client::status;

use crate::dialogue::Heard;
use crate::law::{Event, Law, Verdict};
use crate::scene::Scene;

/// From the MDT that has the edge to the bridge: t3 of this cycle or the next, and what the amplifier takes to be reset.
const PROMPT_MICROSECONDS: u64 = 2_000;

/// What the search for the zero of the current sensors takes.
const ZERO_MICROSECONDS: u64 = 200_000;

/// S-0-0099 may come with the edge: the ATs that show the error are older, up to so many after the one that acknowledges it.
const STALE_ANSWERS: u64 = 3;

/// Watches the bridge come on.
#[derive(Default)]
pub(crate) struct SwitchingOn {
    /// The last edge of a CP4, also when the next MST has ended it: what it has begun comes on.
    edge: Option<Nanoseconds>,
    /// How many ATs had been sent in this CP4 when S-0-0099 was last acknowledged.
    cleared: Option<u64>,
    /// A sensor lied at the last look.
    lied: bool,
}

impl Law for SwitchingOn {
    fn sentence(&self) -> &'static str {
        "the bridge switches on only after an edge of bits 15 and 14 seen in this CP4, with C1D = 0"
    }

    fn judge(&mut self, event: &Event<'_>, scene: &Scene) -> Verdict {
        let wire = &scene.wire;
        if matches!(event, Event::Record) && wire.edge.is_some() {
            self.edge = wire.edge;
        }
        if let Event::Service(Heard::Written(Idn(99), Element::Data, words)) = event {
            self.cleared = (words[..] == [3]).then_some(wire.answers);
        }
        if !matches!(event, Event::Look) {
            return Verdict::Silent;
        }
        let lied = std::mem::replace(&mut self.lied, scene.deceived);
        if scene.before.bridge || !scene.sight.bridge {
            return Verdict::Silent;
        }
        let stale = self.cleared.is_some_and(|then| wire.answers <= then + STALE_ANSWERS);
        let clearing = scene.starting == Some(Idn(99)) || stale;
        // The AT before the last one may be older than S-0-0099.
        let error = wire.status & wire.status_before & status::SHUT_DOWN != 0 && !clearing;
        // A brake that was just closing is closed and tested first, and then opened again.
        let brake = scene.machine.brake.map_or(0, |_| {
            let milliseconds = [206, 207, 0x8000 | 123].map(|idn| scene.settings.unsigned(Idn(idn)).unwrap_or(0));
            1_000 * milliseconds.iter().sum::<i64>().unsigned_abs()
        });
        // Current sensors that have lied find their zero anew first.
        let zero = if lied { ZERO_MICROSECONDS } else { 0 };
        let fresh = scene.within(self.edge, scene.cycles(2, PROMPT_MICROSECONDS + brake + zero));
        Verdict::of(fresh && !error, || {
            let (phase, control, status) = (wire.phase, wire.control, wire.status);
            match scene.since(wire.edge) {
                Some(since) => format!("the bridge is on {since} after the edge, status word {status:04X}H"),
                None => format!("the bridge is on in CP{phase} without an edge, control word {control:04X}H"),
            }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::laws::fake::Fake;

    #[test]
    fn an_edge_in_cp4_may_switch_the_bridge_on() {
        let mut fake = Fake::in_cp4(SwitchingOn::default());
        fake.cycle(0, 0x8000);
        fake.cycle(0xE000, 0x8000);
        fake.sight.bridge = true;
        fake.cycle(0xE000, 0x8000);
        assert_eq!((fake.broken(), fake.armed()), (None, 1));
    }

    #[test]
    fn switches_left_on_from_before_may_not() {
        let mut fake = Fake::in_cp4(SwitchingOn::default());
        fake.cycle(0xE000, 0x8000);
        fake.sight.bridge = true;
        fake.cycle(0xE000, 0x8000);
        assert!(fake.broken().is_some_and(|words| words.contains("without an edge")));
    }

    #[test]
    fn an_error_that_is_still_shown_forbids_it() {
        let mut fake = Fake::in_cp4(SwitchingOn::default());
        fake.cycle(0, 0xA000);
        fake.cycle(0xE000, 0xA000);
        fake.sight.bridge = true;
        fake.cycle(0xE000, 0xA000);
        assert!(fake.broken().is_some());
    }
}
