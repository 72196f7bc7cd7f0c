//! Status bits 15 and 14 tell the truth about the bridge and its supply.

use ring::Nanoseconds;
use ring::ident::Idn;
use ring::service_client::status;

use crate::law::{Event, Law, Verdict};
use crate::scene::Scene;

/// Beside two cycles: the supervision looks at the pins every 500 us, and twice before it believes them.
const LATENCY_MICROSECONDS: u64 = 2_000;
/// The DC link charges, a contactor's contact is debounced.
const POWER_UP: Nanoseconds = Nanoseconds::from_millis(500);
/// The search for the commutation angle takes so long at most, and so does anything else that needs torque out of operation.
const LONGEST_SWITCHING: Nanoseconds = Nanoseconds::from_millis(5_000);

/// Compares the AT with the bridge.
#[derive(Default)]
pub(crate) struct Truth {
    /// When the DC link was last not charged.
    empty: Option<Nanoseconds>,
}

impl Law for Truth {
    fn sentence(&self) -> &'static str {
        "status bits 15 and 14 tell the truth about the bridge"
    }

    fn judge(&mut self, event: &Event<'_>, scene: &Scene) -> Verdict {
        // The drive takes the mains for gone a sixteenth above P-0-0104.
        let threshold = scene.settings.unsigned(Idn(0x8000 | 104)).unwrap_or(4_000) as f64 * 1.1;
        let charged = scene.sight.machine.bus_voltage > threshold.max(0.9 * scene.machine.supply.voltage);
        if !charged {
            self.empty = Some(scene.now);
        }
        if !matches!(event, Event::Answer) || scene.wire.phase != 4 || scene.wire.answers < 4 {
            return Verdict::Silent;
        }
        let (sight, word) = (&scene.sight, scene.wire.status);
        let settled = |then, span| scene.since(then).is_none_or(|since| since > span);
        let late = scene.cycles(2, LATENCY_MICROSECONDS);
        let words = |what: &str| format!("status word {word:04X}H, but {what}");
        match status::readiness(word) {
            3 => Verdict::of(sight.bridge || !settled(scene.bridge_changed, late), || words("the bridge is off")),
            _ if sight.bridge && settled(scene.bridge_changed, LONGEST_SWITCHING) => {
                // It came on long ago; what switches off is not in operation for as long as brake and proof take.
                Verdict::Silent
            }
            2 => {
                // The DC link holds the torque until the brake has closed.
                let off = !sight.main_power && !sight.bridge && settled(scene.bridge_changed, late);
                Verdict::of(!off || !settled(scene.pins_changed, late), || words("main power is off"))
            }
            1 => {
                let sound = sight.main_power && sight.bridge_ready && sight.safe_torque;
                let charged = settled(self.empty, POWER_UP);
                Verdict::of(!(sound && charged && settled(scene.pins_changed, POWER_UP)), || {
                    words("main power is on, the DC link charged and the amplifier ready")
                })
            }
            _ => Verdict::Broken(words("the drive answers in CP4")),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::laws::fake::Fake;

    #[test]
    fn in_operation_is_a_bridge_that_is_on() {
        let mut fake = Fake::in_cp4(Truth::default());
        fake.sight.bridge = true;
        fake.run(10, 0xE000, 0xC008);
        assert_eq!(fake.broken(), None);
        fake.sight.bridge = false;
        fake.run(2, 0xE000, 0xC008);
        assert_eq!(fake.broken(), None, "an AT may be older than the bridge");
        fake.run(3, 0xE000, 0xC008);
        assert!(fake.broken().is_some_and(|words| words.contains("the bridge is off")));
    }

    #[test]
    fn power_that_is_not_there_is_not_shown() {
        let mut fake = Fake::in_cp4(Truth::default());
        fake.run(10, 0, 0x8000);
        fake.sight.main_power = false;
        fake.run(10, 0, 0x4000);
        assert_eq!(fake.broken(), None);
        fake.run(10, 0, 0x8000);
        assert!(fake.broken().is_some());
    }
}
