//! What the drive does by itself goes the way that it was told.

use ring::Nanoseconds;
use ring::ident::{Element, Idn};

use crate::dialogue::Heard;
use crate::law::{Event, Law, Verdict};
use crate::scene::Scene;

const HOMING: Idn = Idn(148);
/// P-0-0225 and P-0-0226 turn as P-0-0218 says.
const IDENTIFICATIONS: [Idn; 2] = [Idn(0x8000 | 225), Idn(0x8000 | 226)];
const VELOCITY: Idn = Idn(0x8000 | 218);
/// Its default: 300 rpm.
const FORWARDS: i64 = 3_000_000;
/// S-0-0147: negative direction, falling edge of the switch, the switch is at the drive, no switch, no marker.
const NEGATIVE: u16 = 1;
const FALLING: u16 = 2;
const AT_THE_DRIVE: u16 = 4;
const NO_SWITCH: u16 = 0x20;
const NO_MARKER: u16 = 0x40;
/// In rad/s; a shaft that is slower stands.
const STANDSTILL: f64 = 0.05;
/// In revolutions: a shaft that trembles, or takes over a load, goes no further the wrong way; and one that goes so far has begun to go.
const WRONG: f64 = 0.02;
const BEGUN: f64 = 0.05;
/// A load that has just changed moves the shaft itself.
const GRACE: Nanoseconds = Nanoseconds::from_millis(500);

/// Watches the first part of a movement.
#[derive(Default)]
pub(crate) struct Directions {
    watched: Option<Movement>,
}

struct Movement {
    command: Idn,
    /// Where the shaft stood, in revolutions.
    from: f64,
    /// The sign of its way.
    sign: f64,
}

impl Directions {
    /// The sign of the shaft's way, if that is known.
    fn sign(command: Idn, scene: &Scene) -> Option<f64> {
        let settings = &scene.settings;
        if command == HOMING {
            let way = settings.word(Idn(147))?;
            // On the switch it goes back first; a switch that the control writes is not seen.
            let by_switch = way & NO_SWITCH == 0;
            let free = !scene.sight.home_switch && way & (AT_THE_DRIVE | FALLING) == AT_THE_DRIVE;
            let moves = way & (NO_SWITCH | NO_MARKER) != NO_SWITCH | NO_MARKER;
            let sense = scene.sense()?;
            return (moves && (!by_switch || free)).then_some(if way & NEGATIVE == 0 { sense } else { -sense });
        }
        let velocity = settings.signed(VELOCITY).unwrap_or(FORWARDS) as f64;
        Some(if scene.is_positive(velocity, Idn(43))? { 1.0 } else { -1.0 })
    }

    fn begin(&mut self, command: Idn, scene: &Scene) {
        let machine = &scene.sight.machine;
        // A command of just now may already lead the axis away, although its lag has not let it go yet.
        let stands = machine.velocity.abs() < STANDSTILL && scene.sight.bridge && !scene.within(scene.commanded, GRACE);
        let sign = Self::sign(command, scene).filter(|_| stands && scene.is_left_alone(GRACE) && scene.wire.phase == 4);
        self.watched = sign.map(|sign| Movement { command, from: machine.angle, sign });
    }
}

impl Law for Directions {
    fn sentence(&self) -> &'static str {
        "what the drive does by itself goes the way that it was told"
    }

    fn judge(&mut self, event: &Event<'_>, scene: &Scene) -> Verdict {
        match event {
            Event::Service(Heard::Written(command, Element::Data, words))
                if words[..] == [3] && (*command == HOMING || IDENTIFICATIONS.contains(command)) =>
            {
                self.begin(*command, scene);
                Verdict::Silent
            }
            Event::Look => {
                let Some(movement) = &self.watched else { return Verdict::Silent };
                let way = (scene.sight.machine.angle - movement.from) * movement.sign;
                let runs = scene.command == Some(movement.command) && scene.is_operating() && !scene.wire.has_error();
                if !runs || way > BEGUN || !scene.sight.bridge || !scene.is_left_alone(GRACE) {
                    let kept = way > BEGUN;
                    self.watched = None;
                    return if kept { Verdict::Kept } else { Verdict::Silent };
                }
                if way > -WRONG {
                    return Verdict::Silent;
                }
                Verdict::Broken(format!("{} began with {way:.3} revolutions the wrong way", movement.command))
            }
            _ => Verdict::Silent,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::laws::fake::Fake;

    fn moved(command: u16, settings: &[(u16, u16)], velocity: f64) -> Fake {
        let mut fake = Fake::in_cp4(Directions::default());
        fake.sight.bridge = true;
        for (idn, word) in settings {
            fake.write(*idn, &[*word]);
        }
        fake.run(300, 0xC000, 0xC000);
        fake.write(command, &[3]);
        fake.sight.machine.velocity = velocity;
        fake.run(20, 0xC000, 0xC000);
        fake
    }

    #[test]
    fn homing_begins_in_the_direction_of_its_parameter_and_of_s_0_0051() {
        for (way, polarity, positive) in [(0x20, 0, true), (0x21, 0, false), (0x20, 5, false), (0x21, 5, true)] {
            for velocity in [10.0, -10.0] {
                let fake = moved(148, &[(147, way), (55, polarity)], velocity);
                let lawful = (velocity > 0.0) == positive;
                assert_eq!(fake.broken().is_none(), lawful, "{way:X}H {polarity} {velocity}: {:?}", fake.broken());
                assert_eq!(fake.armed(), u64::from(lawful));
            }
        }
    }

    #[test]
    fn an_axis_that_a_command_has_just_sent_away_may_still_go_there() {
        for (cycles, lawful) in [(200, true), (300, false)] {
            let mut fake = Fake::in_cp4(Directions::default());
            fake.sight.bridge = true;
            fake.write(147, &[0x20]);
            fake.run(300, 0xE000, 0xC008);
            fake.data[0] = (-1_000_i32).to_le_bytes().to_vec();
            fake.run(cycles, 0xE000, 0xC008);
            fake.write(148, &[3]);
            fake.sight.machine.velocity = -10.0;
            fake.run(20, 0xE000, 0xC000);
            assert_eq!(fake.broken().is_none(), lawful, "{cycles}");
        }
    }

    #[test]
    fn an_identification_turns_as_its_velocity_says() {
        for (polarity, positive) in [(0, true), (1, false)] {
            for velocity in [10.0, -10.0] {
                let fake = moved(0x8000 | 226, &[(43, polarity)], velocity);
                assert_eq!(fake.broken().is_none(), (velocity > 0.0) == positive, "{polarity} {velocity}");
            }
        }
    }
}
