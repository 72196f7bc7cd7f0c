//! After the cause is gone, S-0-0099 and a fresh edge always bring the axis back.

use ring::Nanoseconds;
use ring::ident::{Element, Idn};
use ring::service_client::status;

use crate::dialogue::Heard;
use crate::law::{Event, Law, Verdict};
use crate::scene::Scene;

/// The search for the commutation angle, beside the delays of the brake.
const PATIENCE: Nanoseconds = Nanoseconds::from_millis(5_000);
/// Nothing outside has changed for so long: supply, load, pins.
const QUIET: Nanoseconds = Nanoseconds::from_millis(500);
/// Telegrams have been in time for so many cycles.
const REGULAR: u64 = 8;
/// In operation so long without an error, it is back.
const BACK: Nanoseconds = Nanoseconds::from_millis(250);
/// A command may be this share of S-0-0159 away.
const NEAR: f64 = 0.5;
/// rad/s: 3 rpm.
const STANDSTILL: f64 = 0.3;
/// S-0-0277 bit 3.
const COUNTS_AGAINST: u16 = 8;

/// Follows an axis from the edge until it is in operation.
#[derive(Default)]
pub(crate) struct Back {
    begun: Option<Begun>,
    /// S-0-0099 has been executed; the error must be gone soon.
    cleared: Option<Nanoseconds>,
    edge: Option<Nanoseconds>,
}

struct Begun {
    edge: Nanoseconds,
    control: u16,
    command: Option<f64>,
    operates: Option<Nanoseconds>,
}

impl Back {
    /// The command is near the shaft, and near enough at every cycle.
    fn asks_for_rest(scene: &Scene) -> bool {
        let settings = &scene.settings;
        match scene.asked_mode() {
            Some(3 | 11) => {
                let window = settings.unsigned(Idn(159)).unwrap_or(0) as f64;
                let known = scene.units.zip(scene.position_feedback()).zip(scene.position_command());
                known.is_some_and(|((units, feedback), command)| {
                    let way = units.way(feedback, command);
                    way.abs() <= NEAR * window && !Self::is_beyond_a_limit(feedback + way, scene)
                })
            }
            Some(2) => [36, 37].iter().all(|idn| scene.wire.command(Idn(*idn)).unwrap_or(0) == 0),
            _ => false,
        }
    }

    /// Whether a place is beyond S-0-0049 or S-0-0050 where bit 4 of S-0-0055 switches them on. What goes over the border of the data is, as the
    /// limits lie within it.
    fn is_beyond_a_limit(place: f64, scene: &Scene) -> bool {
        let settings = &scene.settings;
        let acts = settings.word(Idn(55)).is_some_and(|word| word & 0x10 != 0)
            && scene.units.is_some_and(|units| !units.is_modulo);
        let limits = settings.signed(Idn(50)).zip(settings.signed(Idn(49)));
        acts && limits.is_none_or(|(low, high)| place < low as f64 || place > high as f64)
    }

    /// The command has not gone anywhere since the drive follows it. Before that it goes with the shaft, which searches its angle.
    fn is_still(begun: &Begun, scene: &Scene) -> bool {
        let way = scene.units.zip(begun.command).zip(scene.position_command());
        way.is_none_or(|((units, from), to)| units.way(from, to).abs() <= 2.0 * scene.quantum(&units))
    }

    /// Nothing stands in the way of an axis that is to be switched on.
    fn may_come(scene: &Scene) -> bool {
        let (machine, settings) = (&scene.sight.machine, &scene.settings);
        let sound = scene.is_left_alone(QUIET)
            && !scene.within(scene.troubled, QUIET)
            && !scene.within(scene.irregular, scene.cycles(REGULAR, 0))
            && machine.velocity.abs() < STANDSTILL;
        let motor = settings.unsigned(Idn(116)).map(|lines| 4 * lines)
            == Some(i64::from(scene.machine.encoder.increments_per_revolution))
            && settings.word(Idn(0x8000 | 110)) == Some(scene.machine.windings.pole_pairs as u16)
            // The machine's encoder counts with its motor.
            && settings.word(Idn(277)).is_some_and(|kind| kind & COUNTS_AGAINST == 0);
        let free = scene.command.is_none()
            && scene.wire.phase == 4
            && !scene.wire.has_error()
            && scene.machine.brake.is_none();
        sound && motor && free && Self::asks_for_rest(scene) && !scene.is_beyond_thresholds()
    }
}

impl Law for Back {
    fn sentence(&self) -> &'static str {
        "after the cause is gone, S-0-0099 and a fresh edge always bring the axis back"
    }

    fn judge(&mut self, event: &Event<'_>, scene: &Scene) -> Verdict {
        let wire = &scene.wire;
        match event {
            Event::Service(Heard::Opened(Idn(99), 3)) => self.cleared = Some(scene.now),
            Event::Service(Heard::Written(Idn(99), Element::Data, _)) => self.cleared = None,
            Event::Record if wire.edge != self.edge => {
                self.edge = wire.edge;
                let fits = wire.edge.is_some() && Self::may_come(scene);
                self.begun = wire.edge.filter(|_| fits).map(|edge| Begun {
                    edge,
                    control: wire.control & 0xEB00,
                    command: None,
                    operates: None,
                });
            }
            Event::Record => {
                let same = |begun: &Begun| {
                    wire.control & 0xEB00 == begun.control && Self::asks_for_rest(scene) && Self::is_still(begun, scene)
                };
                if !self.begun.as_ref().is_some_and(same) {
                    self.begun = None;
                }
            }
            Event::Answer => {
                if let Some(cleared) =
                    self.cleared.filter(|cleared| scene.now.saturating_sub(*cleared) > scene.cycles(2, 1_000))
                {
                    self.cleared = None;
                    if wire.phase == 4
                        && wire.has_error()
                        && wire.status_before & status::SHUT_DOWN != 0
                        && scene.is_left_alone(QUIET)
                        && !scene.within(scene.pins_changed, QUIET)
                        && !scene.is_beyond_thresholds()
                    {
                        return Verdict::Broken(format!(
                            "S-0-0099 was executed at {cleared}, and the AT shows an error"
                        ));
                    }
                }
                return self.answer(scene);
            }
            _ => {}
        }
        Verdict::Silent
    }
}

impl Back {
    fn answer(&mut self, scene: &Scene) -> Verdict {
        let wire = &scene.wire;
        let undisturbed = scene.is_operating()
            && scene.is_left_alone(QUIET)
            && !scene.within(scene.troubled, QUIET)
            && scene.command.is_none()
            && scene.irregular.zip(self.begun.as_ref()).is_none_or(|(then, begun)| then < begun.edge);
        let Some(begun) = self.begun.as_mut().filter(|_| undisturbed) else {
            self.begun = None;
            return Verdict::Silent;
        };
        if begun.command.is_none() && wire.follows() {
            // Not that of the next MDT: the control has seen this AT by then, and goes where it likes.
            begun.command = scene.position_command();
        }
        let edge = begun.edge;
        if wire.has_error() && scene.is_beyond_thresholds() {
            // They have been written since.
            self.begun = None;
            return Verdict::Silent;
        }
        if wire.has_error() {
            let words = scene.words();
            return Verdict::Broken(format!(
                "a fresh edge at {edge} with nothing in its way ended in an error: {words}"
            ));
        }
        let operates = status::readiness(wire.status) == 3;
        if !operates {
            let delays = scene.settings.unsigned(Idn(206)).unwrap_or(10_000).unsigned_abs();
            let late = scene.now.saturating_sub(edge) > PATIENCE + Nanoseconds::from_millis(delays);
            return if late {
                Verdict::Broken(format!("the axis is not in operation after the edge at {edge}"))
            } else {
                Verdict::Silent
            };
        }
        let since = *begun.operates.get_or_insert(scene.now);
        if scene.now.saturating_sub(since) > BACK {
            self.begun = None;
            return Verdict::Kept;
        }
        Verdict::Silent
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::laws::fake::Fake;

    fn fake() -> Fake {
        let mut fake = Fake::in_cp4(Back::default());
        fake.write(32, &[11]);
        fake.write(116, &[16_384, 0]);
        fake.write(0x8000 | 110, &[4]);
        fake.write(0x8000 | 105, &[700]);
        fake.run(12, 0, 0x8000);
        fake
    }

    #[test]
    fn an_edge_with_nothing_in_its_way_brings_the_axis_into_operation() {
        let mut kept = fake();
        kept.run(500, 0xE000, 0x8000);
        kept.run(140, 0xE000, 0xC008);
        assert_eq!((kept.broken(), kept.armed()), (None, 1));
        let mut never = fake();
        never.run(3_000, 0xE000, 0x8000);
        assert!(never.broken().is_some_and(|words| words.contains("not in operation")));
        let mut error = fake();
        error.run(3, 0xE000, 0x8000);
        error.run(3, 0xE000, 0xA000);
        assert!(error.broken().is_some_and(|words| words.contains("ended in an error")));
    }

    #[test]
    fn an_encoder_that_slips_while_the_bridge_comes_on_is_in_the_way() {
        for (slips, lawful) in [(0, false), (1, true)] {
            let mut fake = fake();
            fake.run(1, 0xE000, 0x8000);
            fake.sight.bridge = true;
            fake.sight.machine.slips += slips;
            fake.cycle(0xE000, 0x8000);
            fake.run(3, 0xE000, 0xA000);
            assert_eq!(fake.broken().is_none(), lawful, "{slips}: {:?}", fake.broken());
        }
    }

    #[test]
    fn a_command_over_the_border_of_the_data_is_beyond_a_limit_and_in_the_way() {
        for (bits, lawful) in [(0x10, true), (0, false)] {
            let mut fake = fake();
            fake.write(55, &[bits]);
            fake.data = [(i32::MIN + 999).to_le_bytes().to_vec(), i32::MAX.to_le_bytes().to_vec()];
            fake.run(12, 0, 0x8000);
            fake.run(3, 0xE000, 0x8000);
            fake.run(3, 0xE000, 0xA000);
            assert_eq!(fake.broken().is_none(), lawful, "{bits:X}: {:?}", fake.broken());
        }
    }

    #[test]
    fn an_encoder_that_is_said_to_count_against_its_motor_is_in_the_way() {
        let mut fake = fake();
        fake.write(277, &[8]);
        fake.run(3, 0xE000, 0x8000);
        fake.run(3, 0xE000, 0xA000);
        assert_eq!(fake.broken(), None);
    }

    #[test]
    fn what_a_threshold_makes_an_error_is_not_gone() {
        for (idn, words) in [(204, 300), (203, 100), (0x8000 | 104, 3_000), (0x8000 | 105, 10)] {
            let mut fake = fake();
            fake.sight.machine.temperatures = [40.0, 60.0];
            fake.run(3, 0xE000, 0x8000);
            fake.write(idn, &[words]);
            fake.run(3, 0xE000, 0xA000);
            assert_eq!(fake.broken(), None, "{idn}");
            fake.write(99, &[3]);
            fake.open(99, 3);
            fake.run(10, 0, 0xA000);
            assert_eq!(fake.broken(), None, "{idn}");
        }
    }

    #[test]
    fn a_command_that_goes_on_as_soon_as_it_is_followed_may_be_refused() {
        let mut fake = fake();
        fake.run(3, 0xE000, 0x8000);
        fake.data[0] = 100_000_i32.to_le_bytes().to_vec();
        fake.run(1, 0xE000, 0xC008);
        fake.run(3, 0xE000, 0xE000);
        assert_eq!(fake.broken(), None);
    }

    #[test]
    fn a_command_that_is_far_away_may_be_refused() {
        let mut fake = fake();
        fake.data[0] = 3_600_000_i32.to_le_bytes().to_vec();
        fake.run(3, 0xE000, 0x8000);
        fake.run(3, 0xE000, 0xA000);
        assert_eq!(fake.broken(), None);
    }

    #[test]
    fn what_s_0_0099_has_cleared_is_gone() {
        let mut fake = fake();
        fake.run(5, 0, 0xA000);
        fake.write(99, &[3]);
        fake.open(99, 3);
        fake.run(10, 0, 0xA000);
        assert!(fake.broken().is_some_and(|words| words.contains("S-0-0099")));
    }
}
