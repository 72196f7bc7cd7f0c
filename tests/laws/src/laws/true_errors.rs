//! An error that says why says what is so.

use ring::Nanoseconds;
use ring::ident::{Element, Idn};
use ring::service_client::status;

use crate::dialogue::Heard;
use crate::law::{Event, Law, Verdict};
use crate::scene::Scene;

/// What has been so within this before an error may be its cause.
const MEMORY: Nanoseconds = Nanoseconds::from_millis(1_500);
/// What was not so within this is no cause of an error: loops and filters have settled.
const QUIET: Nanoseconds = Nanoseconds::from_millis(200);
/// Positions have another zero, and limits with them another place.
const REZEROED: Nanoseconds = Nanoseconds::from_millis(100);
/// rad/s: 3 rpm.
const STANDSTILL: f64 = 0.3;
/// A share of S-0-0159 at which a following distance may be said to have been too large: between the looks it may have been more.
const NEARLY: f64 = 0.5;

/// Cycles from the capture of S-0-0051 until the command that is sent after it is compared with the shaft, at most.
const AGE: u64 = 2;

/// C1D bits (sercos2.md 4.3).
const FEEDBACK: u16 = 1 << 5;
const OVERVOLTAGE: u16 = 1 << 8;
const UNDERVOLTAGE: u16 = 1 << 9;
const DEVIATION: u16 = 1 << 11;
const POSITION_LIMIT: u16 = 1 << 13;

/// Remembers what could be the cause of an error.
#[derive(Default)]
pub(crate) struct TrueErrors {
    encoder_lied: Option<Nanoseconds>,
    link_was_low: Option<Nanoseconds>,
    link_was_high: Option<Nanoseconds>,
    was_far: Option<Nanoseconds>,
    was_beyond: Option<Nanoseconds>,
    /// When a command stepped by more than half of what S-0-0091 allows, or the motor was at its limit.
    was_hard: Option<Nanoseconds>,
    command: Option<f64>,
    /// When the error came that is shown; only its own past counts.
    error: Option<Nanoseconds>,
}

impl TrueErrors {
    fn remember(&mut self, scene: &Scene) {
        let (sight, now) = (&scene.sight, Some(scene.now));
        let volts = |number: u16| scene.settings.unsigned(Idn(0x8000 | number)).map(|volts| volts as f64);
        let bus = sight.machine.bus_voltage;
        // A counter that is faster than the motor may be, S-0-0113 and a quarter, is taken for one that jumps (known, see docs/laws.md).
        // So is a shaft that something stronger than the motor stops: a brake, or what a fault has put in its place.
        let stopped = sight.machine.brake_torque > 0.0 && sight.machine.velocity.abs() > STANDSTILL;
        if scene.deceived || sight.machine.seized || stopped || sight.machine.index_muted || scene.outruns_its_motor() {
            self.encoder_lied = now;
        }
        if !sight.main_power || volts(104).is_none_or(|least| bus < 1.15 * least) {
            self.link_was_low = now;
        }
        if volts(105).is_none_or(|most| bus > 0.95 * most) {
            self.link_was_high = now;
        }
        if scene.is_at_its_limit() || scene.command.is_some() {
            self.was_hard = now;
        }
    }

    fn compare(&mut self, scene: &Scene) {
        let known = scene.units.zip(scene.position_feedback()).zip(scene.position_command());
        let Some(((units, feedback), command)) = known else {
            // Commands that are not seen may be anything.
            (self.was_far, self.was_beyond) = (Some(scene.now), Some(scene.now));
            return;
        };
        let number = |idn| scene.settings.signed(Idn(idn)).map(|value| value as f64);
        let window = number(159).unwrap_or(0.0);
        // S-0-0051 is of the cycle before, and the command waits for t3: a shaft that turns is somewhere else by then.
        let turned = scene.sense().unwrap_or(0.0) * scene.sight.machine.velocity / core::f64::consts::TAU
            * units.increments
            * scene.cycles(AGE, 0).as_seconds();
        let is_far = |shaft: f64| units.way(shaft, command).abs() > NEARLY * window;
        if is_far(feedback) || is_far(feedback + turned) {
            self.was_far = Some(scene.now);
        }
        let before = self.command.replace(command).unwrap_or(command);
        let step = units.way(before, command);
        // Without the wrap at the border of the numbers, which may lie behind a limit.
        let asked = before + step;
        let seconds = scene.cycle.as_seconds();
        let allowed = number(91).unwrap_or(0.0) * units.velocity / core::f64::consts::TAU * units.increments * seconds;
        if step.abs() > 0.5 * allowed || !scene.asks_for_position() {
            self.was_hard = Some(scene.now);
        }
        // What comes next is as far away as a cycle of this speed.
        let next = scene.sight.machine.velocity.abs() / core::f64::consts::TAU
            * units.increments
            * 4.0
            * scene.cycle.as_seconds();
        let margin = next + 2.0 * scene.quantum(&units) + 2.0;
        // Beyond a limit the axis may stand, and it may go back: which way the command or the shaft goes makes the error.
        let turns = scene.sense().unwrap_or(0.0) * scene.sight.machine.velocity;
        let (up, down) = (step > 0.0 || turns > STANDSTILL, step < 0.0 || turns < -STANDSTILL);
        let beyond = |position: f64, up: bool, down: bool| {
            number(49).is_none_or(|high| up && position > high - margin)
                || number(50).is_none_or(|low| down && position < low + margin)
        };
        if beyond(feedback, up, down)
            || beyond(asked, up, down)
            || scene.command.is_some()
            || scene.within(scene.rezeroed, REZEROED)
            || scene.units.is_none_or(|units| units.is_modulo)
        {
            self.was_beyond = Some(scene.now);
        }
    }

    /// Nothing was asked that is not allowed, nothing outside was wrong, and the axis followed: there is no cause for an error.
    fn is_without_cause(&self, scene: &Scene) -> bool {
        let wire = &scene.wire;
        let memories = [self.was_far, self.was_beyond, self.was_hard, scene.irregular, scene.written, scene.troubled];
        let recent = memories.into_iter().any(|then| scene.within(then, QUIET));
        let followed = wire.status_before & status::FOLLOWS != 0 && wire.asks_to_follow() && scene.sight.bridge;
        let monitored = scene.settings.unsigned(Idn(159)).is_some_and(|window| window > 0);
        followed && monitored && !recent && scene.is_operating() && scene.is_left_alone(MEMORY)
    }

    fn judge_bits(&self, bits: u16, scene: &Scene) -> Verdict {
        let Some(error) = self.error else { return Verdict::Silent };
        let recent = |then: Option<Nanoseconds>| then.is_some_and(|then| then + MEMORY + scene.cycles(4, 0) >= error);
        let just = |then: Option<Nanoseconds>| then.is_some_and(|then| then + QUIET + scene.cycles(4, 0) >= error);
        // An encoder with other lines than S-0-0116 says is an encoder that lies.
        let lines = scene.settings.unsigned(Idn(116)).map(|lines| 4 * lines);
        let right = lines == Some(i64::from(scene.machine.encoder.increments_per_revolution));
        let position = scene.asks_for_position() && scene.command.is_none();
        let claims = [
            (FEEDBACK, right && !recent(self.encoder_lied), "a feedback error, and the encoder tells the truth"),
            (OVERVOLTAGE, !recent(self.link_was_high), "an overvoltage, and the DC link has had none"),
            (UNDERVOLTAGE, !recent(self.link_was_low), "an undervoltage, and the DC link has had none"),
            (DEVIATION, position && !recent(self.was_far), "a following distance, and it has not been large"),
            (
                POSITION_LIMIT,
                position && !just(self.was_beyond),
                "a position limit, and neither position nor command went out beyond it",
            ),
        ];
        let looked = claims.iter().any(|(bit, ..)| bits & bit != 0);
        match claims.iter().find(|(bit, false_claim, _)| bits & bit != 0 && *false_claim) {
            Some((_, _, words)) => Verdict::Broken(format!("S-0-0011 is {bits:04X}H: {words}")),
            None if looked => Verdict::Kept,
            None => Verdict::Silent,
        }
    }

    fn judge_number(&self, number: u16, scene: &Scene) -> Verdict {
        match number {
            0xF105 => self.judge_bits(FEEDBACK, scene),
            0xF108 => self.judge_bits(OVERVOLTAGE, scene),
            0xF109 => self.judge_bits(UNDERVOLTAGE, scene),
            0xF10B => self.judge_bits(DEVIATION, scene),
            0xF10D => self.judge_bits(POSITION_LIMIT, scene),
            0xF112 => {
                Verdict::of(scene.machine.brake.is_some() || scene.settings.word(Idn(0x8000 | 120)) != Some(0), || {
                    "S-0-0390 blames a holding brake, and there is none".to_owned()
                })
            }
            _ => Verdict::Silent,
        }
    }
}

impl Law for TrueErrors {
    fn sentence(&self) -> &'static str {
        "an error that says why says what is so"
    }

    fn judge(&mut self, event: &Event<'_>, scene: &Scene) -> Verdict {
        match event {
            Event::Look => {
                self.remember(scene);
                Verdict::Silent
            }
            Event::Record => {
                self.compare(scene);
                Verdict::Silent
            }
            Event::Answer if scene.wire.phase == 4 => {
                if !scene.wire.has_error() {
                    self.error = None;
                    return Verdict::Silent;
                }
                if self.error.is_some() {
                    return Verdict::Silent;
                }
                self.error = Some(scene.now);
                if self.is_without_cause(scene) {
                    let words = "the axis followed, nothing was asked that is not allowed, nothing is wrong, and an error is shown";
                    return Verdict::Broken(words.to_owned());
                }
                match scene.wire.feedback(Idn(390)) {
                    Some(number) => self.judge_number(number as u16, scene),
                    None => match scene.wire.feedback(Idn::CLASS_1_DIAGNOSTIC) {
                        Some(bits) => self.judge_bits(bits as u16, scene),
                        None => Verdict::Silent,
                    },
                }
            }
            Event::Service(Heard::Read(idn, Element::Data, words)) => match (idn.0, &words[..]) {
                (390, [number]) => self.judge_number(*number, scene),
                (11, [bits]) => self.judge_bits(*bits, scene),
                _ => Verdict::Silent,
            },
            _ => Verdict::Silent,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::laws::fake::Fake;

    fn error(number: u16, prepare: impl FnOnce(&mut Fake)) -> Fake {
        let mut fake = Fake::in_cp4(TrueErrors::default());
        fake.write(116, &[16_384, 0]);
        fake.write(32, &[11]);
        fake.settle_limits(1_000_000);
        fake.run(1_000, 0xE000, 0xC008);
        prepare(&mut fake);
        fake.cycle(0xE000, 0xC008);
        fake.run(3, 0xE000, 0xE000);
        fake.read(390, &[number]);
        fake
    }

    #[test]
    fn what_is_not_so_must_not_be_said() {
        for number in [0xF105, 0xF109, 0xF10B, 0xF10D, 0xF112] {
            assert!(error(number, |_| {}).broken().is_some(), "{number:X}");
        }
    }

    #[test]
    fn an_axis_that_follows_what_is_allowed_does_not_fail() {
        let life = |cycles: usize, step: i32| {
            let mut fake = Fake::in_cp4(TrueErrors::default());
            fake.write(32, &[11]);
            fake.cycle(0, 0x8000);
            fake.sight.bridge = true;
            fake.run(cycles, 0xE000, 0xC008);
            fake.data = [step.to_le_bytes().to_vec(), step.to_le_bytes().to_vec()];
            fake.cycle(0xE000, 0xC008);
            fake.run(3, 0xE000, 0xE000);
            fake
        };
        assert!(life(1_000, 1_000).broken().is_some());
        assert_eq!(life(50, 1_000).broken(), None, "too soon after the writing");
        assert_eq!(life(1_000, 1_000_000).broken(), None, "a jump");
    }

    #[test]
    fn a_command_at_s_0_0051_is_behind_a_shaft_that_turns_fast() {
        // 3 600 000 increments a revolution, a cycle of 2 ms and S-0-0159 = 300 000: half of it is two cycles at 625 rpm.
        for (rpm, lawful) in [(700.0, true), (-700.0, true), (500.0, false), (0.0, false)] {
            let fake = error(0xF10B, |fake| fake.sight.machine.velocity = rpm * core::f64::consts::TAU / 60.0);
            assert_eq!(fake.broken().is_none(), lawful, "{rpm} rpm: {:?}", fake.broken());
        }
    }

    #[test]
    fn what_is_so_may_be_said() {
        let kept = [
            error(0xF105, |fake| fake.sight.machine.encoder_frozen = true),
            error(0xF109, |fake| fake.sight.main_power = false),
            error(0xF10B, |fake| fake.data[0] = 300_000_i32.to_le_bytes().to_vec()),
            error(0xF10D, |fake| {
                fake.data[0] = 1_000_001_i32.to_le_bytes().to_vec();
                fake.cycle(0xE000, 0xC008);
            }),
        ];
        assert!(
            kept.iter().all(|fake| fake.broken().is_none() && fake.armed() > 0),
            "{:?}",
            kept.map(|fake| fake.broken())
        );
    }
}
