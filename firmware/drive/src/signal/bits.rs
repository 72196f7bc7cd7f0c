//! Real-time bits (S-0-0300 to S-0-0307) and signal words (S-0-0144, S-0-0145): which bit shows or sets what.
//!
//! Source: sercos2.md 6.1. The allocations are worked out when a parameter changes; a cycle only follows them.

use sercos::Idn;
use sercos::parameters::Parameters;

use super::word::{Source, SourceBit};

/// Bits that a signal word has.
pub const SIGNAL_BITS: usize = 16;

/// All allocations. The only data block that bits can set is P-0-0019; its masks are 0 where nothing is allocated.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct BitSettings {
    /// What control word bits 6 and 7 set (S-0-0301, S-0-0303).
    pub control: [u32; 2],
    /// What status word bits 6 and 7 show (S-0-0305, S-0-0307).
    pub status: [Option<SourceBit>; 2],
    /// What the bits of S-0-0144 show, from bit 0.
    pub signal_status: [Option<SourceBit>; SIGNAL_BITS],
    /// What the bits of S-0-0145 set, from bit 0.
    pub signal_control: [u32; SIGNAL_BITS],
}

impl BitSettings {
    /// From the allocations in the parameters; `sources` says what bits can do with a data block.
    #[must_use]
    pub fn new(parameters: &Parameters, sources: impl Fn(Idn) -> Option<Source>) -> Self {
        let word = |idn: Idn| parameters.get_word(idn);
        let source = |idn, bit| sources(idn).and_then(|source| source.bit(bit));
        let target = |idn, bit| sources(idn).map_or(0, |source| source.target(bit));
        let mut settings = Self {
            control: [
                target(Idn(word(Idn::REAL_TIME_CONTROL_BIT_1)), word(Idn::standard(413))),
                target(Idn(word(Idn::REAL_TIME_CONTROL_BIT_2)), word(Idn::standard(414))),
            ],
            status: [
                source(Idn(word(Idn::REAL_TIME_STATUS_BIT_1)), word(Idn::standard(415))),
                source(Idn(word(Idn::REAL_TIME_STATUS_BIT_2)), word(Idn::standard(416))),
            ],
            ..Self::default()
        };
        let numbers = |idn| parameters.words(idn).iter().copied().chain(core::iter::repeat(0));
        let shown = parameters.list(Idn::SIGNAL_STATUS_LIST).iter().zip(numbers(Idn::standard(328)));
        for (slot, (&idn, bit)) in settings.signal_status.iter_mut().zip(shown) {
            *slot = source(idn, bit);
        }
        let set = parameters.list(Idn::SIGNAL_CONTROL_LIST).iter().zip(numbers(Idn::standard(329)));
        for (slot, (&idn, bit)) in settings.signal_control.iter_mut().zip(set) {
            *slot = target(idn, bit);
        }
        settings
    }

    /// P-0-0019 and the bits above it after the real-time bits of a control word.
    #[inline]
    #[must_use]
    pub const fn apply_control_word(&self, application_word: u32, control_word: u16) -> u32 {
        let [first, second] = self.control;
        let word = with(application_word, first, control_word & 1 << 6 != 0);
        with(word, second, control_word & 1 << 7 != 0)
    }

    /// P-0-0019 and the bits above it after a signal control word S-0-0145.
    #[inline]
    #[must_use]
    pub fn apply_signal_control(&self, application_word: u32, signal_control: u16) -> u32 {
        let mut rest = signal_control;
        let mut word = application_word;
        for &mask in &self.signal_control {
            word = with(word, mask, rest & 1 != 0);
            rest >>= 1;
        }
        word
    }
}

const fn with(word: u32, mask: u32, set: bool) -> u32 {
    if set { word | mask } else { word & !mask }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dictionary::{DICTIONARY, source};
    use crate::signal::word::Word;

    #[test]
    fn a_single_bit_data_block_has_its_bit_in_bit_0_and_no_other() {
        let standstill = source(Idn::standard(331)).unwrap();
        assert_eq!(standstill.bit(0), Some(SourceBit { word: Word::Class3, mask: 2 }));
        assert_eq!(standstill.bit(1), None);
        assert_eq!((standstill.value(2), standstill.value(0xFFFD)), (1, 0));
        let class_3 = source(Idn::standard(13)).unwrap();
        assert_eq!(class_3.bit(15), Some(SourceBit { word: Word::Class3, mask: 0x8000 }));
        assert_eq!(class_3.bit(16), None);
    }

    #[test]
    fn control_bits_set_and_clear_their_target_only() {
        let mut parameters = Parameters::new(&DICTIONARY);
        parameters.set(Idn::REAL_TIME_CONTROL_BIT_1, 0x8013).unwrap();
        parameters.set(Idn::standard(413), 3).unwrap();
        let bits = BitSettings::new(&parameters, source);
        assert_eq!(bits.apply_control_word(0x8001, 1 << 6), 0x8009);
        assert_eq!(bits.apply_control_word(0x8009, 0), 0x8001);
        assert_eq!(bits.apply_control_word(0x8001, 1 << 7), 0x8001, "bit 7 is not allocated");
    }

    #[test]
    fn signal_words_follow_their_two_lists_and_a_short_second_list_means_bit_0() {
        let mut parameters = Parameters::new(&DICTIONARY);
        parameters.set_list(Idn::SIGNAL_STATUS_LIST, &[Idn::standard(13), Idn::standard(331)]).unwrap();
        parameters.set_words(Idn::standard(328), &[4]).unwrap();
        parameters.set_list(Idn::SIGNAL_CONTROL_LIST, &[Idn::product(19), Idn::product(19)]).unwrap();
        parameters.set_words(Idn::standard(329), &[15]).unwrap();
        let bits = BitSettings::new(&parameters, source);
        assert_eq!(bits.signal_status[0], Some(SourceBit { word: Word::Class3, mask: 1 << 4 }));
        assert_eq!(bits.signal_status[1], Some(SourceBit { word: Word::Class3, mask: 1 << 1 }));
        assert_eq!(bits.signal_status[2], None);
        assert_eq!(bits.apply_signal_control(0x0100, 0b01), 0x8100);
        assert_eq!(bits.apply_signal_control(0x8100, 0b10), 0x0101);
    }
}
