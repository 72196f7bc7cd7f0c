//! What nobody has written keeps its size, under another scaling too.

use ring::ident::Element;

use crate::dialogue::Heard;
use crate::law::{Event, Law, Verdict};
use crate::scene::Scene;
use crate::settings::is_sized;

/// Compares what is read in CP4 with what the scaling has made of the number that was known.
pub(crate) struct Sizes;

impl Law for Sizes {
    fn sentence(&self) -> &'static str {
        "what nobody has written keeps its size, under another scaling too"
    }

    fn judge(&mut self, event: &Event<'_>, scene: &Scene) -> Verdict {
        let Event::Service(Heard::Read(idn, Element::Data, words)) = event else { return Verdict::Silent };
        let &[low, high] = &words[..] else { return Verdict::Silent };
        if scene.wire.phase != 4 || !is_sized(*idn) || scene.wire.command(*idn).is_some() {
            return Verdict::Silent;
        }
        let read = i64::from((u32::from(high) << 16 | u32::from(low)).cast_signed());
        let Some(known) = scene.settings.signed(*idn) else { return Verdict::Silent };
        // Rounded to the nearest, with ratios of a drive that has no floating point.
        let tolerance = 1 + (known.unsigned_abs() >> 20);
        Verdict::of(known.abs_diff(read) <= tolerance, || {
            format!("{idn} is worth {known} increments, and reads {read}")
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::laws::fake::Fake;

    /// A run-up in which S-0-0044 becomes linear: 10 mm a revolution, 1 um/min.
    fn rescaled() -> Fake {
        let mut fake = Fake::in_cp4(Sizes);
        for phase in 0..=2 {
            fake.enter(phase);
        }
        fake.write(44, &[1]);
        fake
    }

    #[test]
    fn a_default_keeps_its_size_and_what_was_written_its_number() {
        // 10 rpm are 100 mm/min.
        for (read, lawful) in [([0x86A0, 1], true), ([0x86A1, 1], true), ([0, 1], false)] {
            let mut fake = rescaled();
            fake.enter(3);
            fake.enter(4);
            fake.read(124, &read);
            assert_eq!(fake.broken().is_none(), lawful, "{read:?}: {:?}", fake.broken());
        }
        let mut fake = rescaled();
        fake.write(157, &[77, 0]);
        fake.enter(3);
        fake.enter(4);
        fake.read(157, &[77, 0]);
        assert_eq!((fake.broken(), fake.armed()), (None, 1));
        // 100 rpm are 1 m/min: 1 000 000.
        fake.read(41, &[0x4240, 15]);
        assert_eq!((fake.broken(), fake.armed()), (None, 2));
    }
}
