//! P-0-0240 stays within P-0-0229.

use ring::Nanoseconds;
use ring::ident::{Element, Idn};

use crate::dialogue::Heard;
use crate::law::{Event, Law, Verdict};
use crate::scene::Scene;

const TUNE: Idn = Idn(0x8000 | 240);
/// In 0.01 revolutions, and its default.
const WINDOW: Idn = Idn(0x8000 | 229);
const DEFAULT: i64 = 1_500;
/// A shaft that somebody else turns goes where that leads it.
const GRACE: Nanoseconds = Nanoseconds::from_millis(500);

/// Watches an axis from the start of the command to its end.
#[derive(Default)]
pub(crate) struct Window {
    /// Where the shaft stood, and how far it may go, in revolutions.
    watched: Option<(f64, f64)>,
}

impl Law for Window {
    fn sentence(&self) -> &'static str {
        "an axis that is tuned stays within the way that it was given"
    }

    fn judge(&mut self, event: &Event<'_>, scene: &Scene) -> Verdict {
        match event {
            Event::Service(Heard::Written(TUNE, Element::Data, words)) if words[..] == [3] => {
                let window = scene.settings.unsigned(WINDOW).unwrap_or(DEFAULT) as f64 / 100.0;
                let alone = scene.is_left_alone(GRACE) && scene.wire.phase == 4 && scene.sight.bridge;
                self.watched = alone.then_some((scene.sight.machine.angle, window));
                Verdict::Silent
            }
            Event::Look => {
                let Some((from, window)) = self.watched else { return Verdict::Silent };
                let runs = scene.command == Some(TUNE) && scene.is_operating() && !scene.wire.has_error();
                if !runs || !scene.sight.bridge || !scene.is_left_alone(GRACE) {
                    self.watched = None;
                    return Verdict::Silent;
                }
                let way = scene.sight.machine.angle - from;
                Verdict::of(way.abs() <= window, || format!("{way:.3} revolutions from its start, of {window:.2}"))
            }
            _ => Verdict::Silent,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::laws::fake::Fake;

    /// Five seconds at 10 rad/s are 8 revolutions.
    fn turned(settings: &[u16], velocity: f64) -> Fake {
        let mut fake = Fake::in_cp4(Window::default());
        fake.sight.bridge = true;
        if !settings.is_empty() {
            fake.write(WINDOW.0, settings);
        }
        fake.run(300, 0xC000, 0xC000);
        fake.write(TUNE.0, &[3]);
        fake.sight.machine.velocity = velocity;
        fake.run(2_500, 0xC000, 0xC000);
        fake
    }

    #[test]
    fn it_may_go_as_far_as_it_was_told_either_way_and_no_further() {
        for velocity in [10.0, -10.0] {
            for (settings, lawful) in [(&[][..], true), (&[900, 0], true), (&[700, 0], false)] {
                let fake = turned(settings, velocity);
                assert_eq!(fake.broken().is_none(), lawful, "{settings:?} {velocity}: {:?}", fake.broken());
                assert!(fake.armed() > 100);
            }
        }
        assert!(turned(&[], 25.0).broken().is_some(), "15 revolutions are the default");
    }
}
