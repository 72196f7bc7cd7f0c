//! S-0-0047 - S-0-0051 = S-0-0189 in every coordinate, and homing makes S-0-0051 = S-0-0052.

use ring::ident::{Element, Idn};

use crate::dialogue::Heard;
use crate::law::{Event, Law, Verdict};
use crate::scene::Scene;

/// A path between commands is done after so many cycles of the control unit, and so many of the ring for the way there and back.
const SETTLED_CYCLES: i64 = 7;
/// So many cycles after a slip of the encoder the AT shows both values from behind it.
const SLIPS: u64 = 2;
/// In revolutions: a held shaft trembles less.
const STOOD: f64 = 1e-4;
/// The shaft stands when it is slower than this in rad/s.
const STANDSTILL: f64 = 0.05;

/// Waits until a command has stood for a while.
#[derive(Default)]
pub(crate) struct Distance {
    command: Option<u32>,
    unchanged: i64,
    /// From where to where the shaft was since a homing was started, in revolutions.
    started: Option<[f64; 2]>,
    /// Where the shaft was at the record before: a drive works with a position that it has read.
    before: f64,
    /// S-0-0189 of the last AT while commands were followed.
    shown: Option<i64>,
    /// S-0-0052 at that time.
    reference: Option<i64>,
    /// Where the shaft stood when S-0-0447, or S-0-0148 where it stands, gave it S-0-0052.
    zeroed: Option<Zeroed>,
}

struct Zeroed {
    angle: f64,
    /// How far from there the shaft may have been at that moment, in revolutions.
    blur: f64,
    distance: f64,
    answers: u32,
}

impl Distance {
    fn compare(&self, distance: u32, scene: &Scene) -> Verdict {
        let settings = &scene.settings;
        let unit_cycles =
            settings.unsigned(Idn::CONTROL_UNIT_CYCLE).unwrap_or(65_000) / settings.unsigned(Idn::CYCLE).unwrap_or(500);
        // S-0-0001 may still have its default beside a slow ring.
        let unit_cycles = unit_cycles.max(1);
        let following =
            scene.is_operating() && scene.wire.asks_to_follow() && scene.wire.follows() && scene.asks_for_position();
        // For the drive a count that slips is a shaft that turns: S-0-0051 is of t4, S-0-0189 of the loops' last tick before it.
        let slips = scene.within(scene.slipped, scene.cycles(SLIPS, 0));
        let still =
            scene.sight.machine.velocity.abs() < STANDSTILL && !slips && scene.asked_mode() == scene.actual_mode();
        if !following || !still || self.unchanged < SETTLED_CYCLES * unit_cycles {
            return Verdict::Silent;
        }
        let known = scene.position_command().zip(scene.position_feedback()).zip(scene.units);
        let Some(((command, feedback), units)) = known else { return Verdict::Silent };
        let expected = units.way(feedback, command);
        let shown = f64::from(distance.cast_signed());
        let tolerance = 2.0 * scene.quantum(&units) + 3.0;
        Verdict::of(units.way(expected, shown).abs() <= tolerance, || {
            format!("S-0-0047 is {command}, S-0-0051 {feedback}, and S-0-0189 {shown}")
        })
    }

    /// What follows a command comes nearer or falls behind, and never changes sides by half of all numbers: a distance that has no number
    /// stays at the last one.
    fn goes_on(&mut self, distance: u32, scene: &Scene) -> Verdict {
        let following = scene.is_operating() && scene.wire.asks_to_follow() && scene.wire.follows();
        let same =
            scene.asked_mode() == scene.actual_mode() && scene.asks_for_position() && !scene.drive_moves_the_axis();
        let now = i64::from(distance.cast_signed());
        if !following || !same {
            self.shown = None;
            return Verdict::Silent;
        }
        let Some(before) = self.shown.replace(now) else { return Verdict::Silent };
        Verdict::of((now - before).abs() < 1 << 31, || format!("S-0-0189 was {before} and is {now} a cycle later"))
    }

    /// S-0-0447, or S-0-0148 that takes the place where the motor stands, has been executed.
    fn homed(&mut self, idn: Idn, scene: &Scene) {
        let here = idn == Idn(447) || scene.settings.word(Idn(147)).is_some_and(|word| word & 0xE0 == 0x60);
        if here
            && matches!(idn.0, 447 | 148)
            && scene.sight.machine.velocity.abs() < STANDSTILL
            && !scene.deceived
            // It is executed at once, and the master asks later: only for a shaft that has stood since then is it known where.
            && let Some([least, most]) = self.started.filter(|[least, most]| most - least < STOOD)
            && let Some(distance) = self.reference
        {
            let (angle, blur) = (scene.sight.machine.angle, most - least);
            self.zeroed = Some(Zeroed { angle, blur, distance: distance as f64, answers: 0 });
        }
    }

    fn arrived(&mut self, scene: &Scene) -> Verdict {
        if scene.sight.machine.velocity.abs() >= STANDSTILL || scene.deceived {
            // A shaft that moves has left the place by the time that an AT shows it.
            self.zeroed = None;
        }
        let Some(zeroed) = &mut self.zeroed else { return Verdict::Silent };
        zeroed.answers += 1;
        if zeroed.answers < 4 {
            return Verdict::Silent;
        }
        let Some(zeroed) = self.zeroed.take() else { return Verdict::Silent };
        let known = scene.position_feedback().zip(scene.sense()).zip(scene.units);
        let Some(((feedback, sense), units)) = known.filter(|_| scene.wire.phase == 4) else { return Verdict::Silent };
        let moved = sense * (scene.sight.machine.angle - zeroed.angle) * units.increments;
        let off = units.way(zeroed.distance + moved, feedback);
        let tolerance = 2.0 * scene.quantum(&units) + 2.0 + moved.abs() + zeroed.blur * units.increments;
        Verdict::of(off.abs() <= tolerance, || {
            format!("S-0-0052 is {}, and S-0-0051 {feedback} after homing", zeroed.distance)
        })
    }
}

impl Law for Distance {
    fn sentence(&self) -> &'static str {
        "S-0-0047 - S-0-0051 = S-0-0189 in every coordinate, and homing makes S-0-0051 = S-0-0052"
    }

    fn judge(&mut self, event: &Event<'_>, scene: &Scene) -> Verdict {
        if let Some([least, most]) = &mut self.started {
            *least = least.min(scene.sight.machine.angle);
            *most = most.max(scene.sight.machine.angle);
        }
        match event {
            Event::Record => {
                if scene.starting.is_some_and(|idn| matches!(idn.0, 148 | 447)) && self.started.is_none() {
                    let now = scene.sight.machine.angle;
                    self.started = Some([now.min(self.before), now.max(self.before)]);
                }
                self.before = scene.sight.machine.angle;
                let command = scene.wire.command(Idn::POSITION_COMMAND);
                self.unchanged = if command == self.command { self.unchanged + 1 } else { 0 };
                self.command = command;
                let other_mode = scene.asked_mode() != scene.actual_mode();
                if !scene.wire.asks_to_follow() || !scene.wire.follows() || other_mode {
                    self.unchanged = 0;
                }
                Verdict::Silent
            }
            Event::Answer => match self.arrived(scene) {
                Verdict::Silent => {
                    let Some(distance) = scene.wire.feedback(Idn::FOLLOWING_DISTANCE) else { return Verdict::Silent };
                    match self.compare(distance, scene) {
                        Verdict::Broken(words) => Verdict::Broken(words),
                        _ => self.goes_on(distance, scene),
                    }
                }
                verdict => verdict,
            },
            Event::Service(Heard::Read(Idn::FOLLOWING_DISTANCE, Element::Data, words)) => match words[..] {
                [low, high] => self.compare(u32::from(high) << 16 | u32::from(low), scene),
                _ => Verdict::Silent,
            },
            Event::Service(Heard::Written(Idn(148 | 447), Element::Data, words)) => {
                let from = self.started.unwrap_or([scene.sight.machine.angle; 2]);
                self.started = (words[..] == [3]).then_some(from);
                self.reference = scene.settings.signed(Idn(52));
                Verdict::Silent
            }
            Event::Service(Heard::Opened(idn, 3)) if scene.command == Some(*idn) => {
                self.homed(*idn, scene);
                Verdict::Silent
            }
            _ => Verdict::Silent,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::laws::fake::Fake;

    fn fake(command: i32, feedback: i32, distance: i32) -> Fake {
        let mut fake = Fake::in_cp4(Distance::default());
        fake.write(15, &[7]);
        fake.write(24, &[2, 2, 47]);
        fake.write(16, &[4, 4, 51, 189]);
        fake.write(32, &[11]);
        fake.data = [command.to_le_bytes().to_vec(), [feedback, distance].map(i32::to_le_bytes).concat()];
        fake.cycle(0, 0x8000);
        fake.run(20, 0xE000, 0xC008);
        fake
    }

    #[test]
    fn the_distance_is_the_difference_and_wraps_with_it() {
        let kept = fake(1_000, 900, 100);
        assert_eq!(kept.broken(), None);
        assert!(kept.armed() > 5);
        assert_eq!(fake(-2_147_483_600, 2_147_483_600, 96).broken(), None);
        assert!(fake(1_000, 900, -100).broken().is_some());
        assert!(fake(1_000, -900, 100).broken().is_some());
    }

    #[test]
    fn a_count_that_slips_is_a_shaft_that_turns() {
        for (cycles, lawful) in [(1, true), (4, false)] {
            let mut fake = fake(1_000, 900, 100);
            fake.sight.machine.slips += 1;
            fake.cycle(0xE000, 0xC008);
            fake.data[1] = [5_900_i32, 100].map(i32::to_le_bytes).concat();
            fake.run(cycles, 0xE000, 0xC008);
            assert_eq!(fake.broken().is_none(), lawful, "{cycles}: {:?}", fake.broken());
        }
    }

    #[test]
    fn a_distance_that_has_no_number_does_not_come_back_with_the_other_sign() {
        let after = |distance: i32| {
            // The command turns: nothing is settled, only the distance grows.
            let feedback = 5 - i32::MAX;
            let mut fake = fake(0, feedback, -feedback);
            for command in 1..20 {
                let command = command * 1_000_000_i32;
                fake.data = [command.to_le_bytes().to_vec(), [feedback, distance].map(i32::to_le_bytes).concat()];
                fake.run(1, 0xE000, 0xC008);
            }
            fake.broken()
        };
        assert_eq!(after(i32::MAX), None);
        assert!(after(i32::MIN + 5).is_some_and(|words| words.contains("a cycle later")));
    }

    fn homed(distance: i32, feedback: i32) -> Fake {
        let mut fake = fake(0, 0, 0);
        fake.run(2, 0, 0x8000);
        fake.write(52, &[distance as u16, (distance >> 16) as u16]);
        fake.write(447, &[3]);
        fake.open(447, 3);
        fake.data[1] = [feedback, 0].map(i32::to_le_bytes).concat();
        fake.run(10, 0, 0x8000);
        fake
    }

    #[test]
    fn the_reference_distance_is_that_of_the_beginning() {
        let mut fake = fake(0, 0, 0);
        fake.run(2, 0, 0x8000);
        fake.write(447, &[3]);
        fake.write(52, &[7, 7]);
        fake.open(447, 3);
        fake.run(10, 0, 0x8000);
        assert_eq!(fake.broken(), None);
    }

    #[test]
    fn homing_gives_the_reference_distance() {
        assert_eq!(homed(100_000, 100_000).broken(), None);
        assert!(homed(100_000, -100_000).broken().is_some());
    }
}
