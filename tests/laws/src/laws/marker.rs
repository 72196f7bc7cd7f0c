//! After homing with a marker, the reference point lies S-0-0150 from it.

use ring::ident::{Element, Idn};

use crate::dialogue::Heard;
use crate::law::{Event, Law, Verdict};
use crate::scene::Scene;

const HOMING: Idn = Idn(148);
/// What the place of the marker follows from.
const PARAMETERS: [u16; 3] = [52, 147, 150];
/// S-0-0147: another encoder than the motor's, no marker.
const SECOND_ENCODER: u16 = 8;
const NO_MARKER: u16 = 0x40;
/// The shaft stands when it is slower than this in rad/s.
const STANDSTILL: f64 = 0.05;
/// ATs until what stands is shown.
const SHOWN: u32 = 4;
/// Values of 32 bits.
const DATA: f64 = 4_294_967_296.0;
/// Beside the encoder's steps: its pulse is one of them wide, and has two edges.
const TOLERANCE: (f64, f64) = (3.0, 3.0);

/// Waits for the end of a homing and for the shaft to stand.
#[derive(Default)]
pub(crate) struct Marker {
    /// S-0-0052 less S-0-0150 when the homing began.
    begun: Option<i64>,
    homed: Option<i64>,
    answers: u32,
}

impl Marker {
    fn begin(&mut self, scene: &Scene) {
        *self = Self::default();
        let settings = &scene.settings;
        let by_marker = settings.word(Idn(147)).is_some_and(|way| way & (SECOND_ENCODER | NO_MARKER) == 0);
        let place = settings.signed(Idn(52)).zip(settings.signed(Idn(150)));
        self.begun = place.filter(|_| by_marker).map(|(distance, offset)| distance - offset);
    }

    fn arrived(&mut self, scene: &Scene) -> Verdict {
        let Some(at_marker) = self.homed else { return Verdict::Silent };
        let machine = &scene.sight.machine;
        if machine.velocity.abs() >= STANDSTILL {
            self.answers = 0;
            return Verdict::Silent;
        }
        self.answers += 1;
        if self.answers < SHOWN {
            return Verdict::Silent;
        }
        self.homed = None;
        let known = scene.position_feedback().zip(scene.sense()).zip(scene.units);
        let Some(((feedback, sense), units)) = known else { return Verdict::Silent };
        if units.is_modulo || scene.deceived {
            return Verdict::Silent;
        }
        // Every revolution has the marker: how many of them lie between is not told.
        let turned = sense * (machine.angle - scene.machine.encoder.index_at) * units.increments;
        // Data of 32 bits go round, and not after whole revolutions.
        let way = feedback - at_marker as f64 - turned;
        let off = (way - DATA * (way / DATA).round()).rem_euclid(units.increments);
        let off = off.min(units.increments - off);
        Verdict::of(off <= TOLERANCE.0 * scene.quantum(&units) + TOLERANCE.1, || {
            format!("S-0-0051 would be {off:.0} increments beside {at_marker}, S-0-0052 less S-0-0150, at the marker")
        })
    }
}

impl Law for Marker {
    fn sentence(&self) -> &'static str {
        "after homing with a marker, the reference point lies S-0-0150 from it"
    }

    fn judge(&mut self, event: &Event<'_>, scene: &Scene) -> Verdict {
        match event {
            Event::Mst if scene.wire.phase < 4 => *self = Self::default(),
            Event::Service(Heard::Written(HOMING, Element::Data, words)) if words[..] == [3] => self.begin(scene),
            Event::Service(Heard::Written(idn, Element::Data, _)) if PARAMETERS.contains(&idn.0) => {
                self.begun = None;
            }
            Event::Service(Heard::Written(Idn(262 | 263 | 447), ..)) => *self = Self::default(),
            Event::Service(Heard::Opened(HOMING, 3)) if scene.command == Some(HOMING) => {
                (self.homed, self.answers) = (self.begun.take(), 0);
            }
            Event::Answer => return self.arrived(scene),
            _ => {}
        }
        Verdict::Silent
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::laws::fake::Fake;
    use plant::ReferenceAxis;

    /// S-0-0052 is 5 000, S-0-0150 1 000, S-0-0147 as given; the shaft stands a tenth of a revolution behind the marker.
    fn homed(way: u16, feedback: i32) -> Fake {
        homed_to(5_000, way, feedback)
    }

    /// The same with another S-0-0052.
    fn homed_to(place: i32, way: u16, feedback: i32) -> Fake {
        let mut machine = ReferenceAxis::press().machine;
        machine.encoder.index_at = 0.3;
        let mut fake = Fake::of(Marker::default(), machine);
        fake.write(52, &[place as u16, (place >> 16) as u16]);
        fake.write(150, &[1_000, 0]);
        fake.write(147, &[way]);
        fake.sight.machine.angle = 7.4;
        fake.data[1] = feedback.to_le_bytes().to_vec();
        fake.write(148, &[3]);
        fake.open(148, 3);
        fake.run(10, 0, 0x8000);
        fake
    }

    #[test]
    fn the_marker_has_s_0_0052_less_s_0_0150_in_whatever_turn() {
        for turn in [-2, 0, 3] {
            let fake = homed(0x20, 4_000 + 360_000 + turn * 3_600_000);
            assert_eq!((fake.broken(), fake.armed()), (None, 1), "{turn}");
        }
        for off in [2_000, -2_000] {
            assert!(homed(0x20, 364_000 + off).broken().is_some_and(|words| words.contains("2000 increments beside")));
        }
    }

    #[test]
    fn a_reference_point_at_the_end_of_the_data_is_one_beyond_it() {
        // The marker has -2^31 - 1 000 + 500, which is beyond the data, and the shaft stands 0.1 revolutions behind it.
        let place = i32::MIN + 500;
        for (off, lawful) in [(0, true), (2_000, false)] {
            let fake = homed_to(place, 0x20, place.wrapping_sub(1_000).wrapping_add(360_000 + off));
            assert_eq!(fake.broken().is_none(), lawful, "{off}: {:?}", fake.broken());
        }
    }

    #[test]
    fn a_homing_without_a_marker_says_nothing_of_it() {
        assert_eq!(homed(0x60, 7).armed(), 0);
        assert_eq!(homed(0x28, 7).armed(), 0);
    }
}
