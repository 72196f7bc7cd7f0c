//! Real-time bits (S-0-0300 to S-0-0307) and signal words (S-0-0144, S-0-0145): which bit shows or sets what.
//!
//! Source: sercos2.md 6.1. The allocations are worked out when a parameter changes; a cycle only follows them.

use sercos::Idn;
use sercos::parameters::Parameters;

use crate::motion::{HOME_SWITCH, HOMING_ENABLE, PROBE_1_ENABLE, PROBE_2_ENABLE};

/// A word of the motion side that has bits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Word {
    /// S-0-0011.
    Class1,
    /// S-0-0012.
    Class2,
    /// S-0-0013.
    Class3,
    /// S-0-0014.
    InterfaceStatus,
    /// S-0-0129.
    Manufacturer1,
    /// S-0-0181.
    Manufacturer2,
    /// S-0-0182.
    Manufacturer3,
    /// S-0-0134.
    Control,
    /// S-0-0135, real-time bits and service bits 0.
    Status,
    /// S-0-0403.
    PositionStatus,
    /// P-0-0019.
    Application,
    /// Home switch S-0-0400, probes S-0-0401 and S-0-0402, S-0-0408, S-0-0409 to S-0-0412.
    Signals,
    /// S-0-0179.
    ProbeStatus,
    /// S-0-0437, with S-0-0419 in bit 0.
    Positioning,
}

/// What an IDN of S-0-0398 shows: a word, or one bit of it in bit 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Source {
    word: Word,
    single: Option<u8>,
}

impl Source {
    /// The source of an IDN; `None` if it has no bits.
    #[must_use]
    pub fn from_idn(idn: Idn) -> Option<Self> {
        let whole = |word| Some(Self { word, single: None });
        let single = |word, bit: u16| Some(Self { word, single: u8::try_from(bit).ok() });
        if idn == APPLICATION_WORD {
            return whole(Word::Application);
        }
        if idn != Idn::standard(idn.number()) {
            return None;
        }
        match idn.number() {
            11 => whole(Word::Class1),
            12 => whole(Word::Class2),
            13 => whole(Word::Class3),
            14 => whole(Word::InterfaceStatus),
            129 => whole(Word::Manufacturer1),
            134 => whole(Word::Control),
            135 => whole(Word::Status),
            181 => whole(Word::Manufacturer2),
            182 => whole(Word::Manufacturer3),
            300 => single(Word::Control, 6),
            302 => single(Word::Control, 7),
            number @ 310..=323 => single(Word::Class2, number.saturating_sub(310)),
            number @ 330..=343 => single(Word::Class3, number.saturating_sub(330)),
            179 => whole(Word::ProbeStatus),
            number @ 400..=402 => single(Word::Signals, number.saturating_sub(400)),
            403 => whole(Word::PositionStatus),
            number @ 405..=407 => single(Word::Signals, number.saturating_sub(397)),
            number @ 408..=412 => single(Word::Signals, number.saturating_sub(405)),
            419 => single(Word::Positioning, 0),
            437 => whole(Word::Positioning),
            _ => None,
        }
    }

    /// Where bit `number` of the data block comes from; `None` for a bit that is always 0.
    #[must_use]
    pub const fn bit(self, number: u16) -> Option<SourceBit> {
        let bit = match (self.single, number) {
            (Some(bit), 0) => bit,
            (None, 0..=15) => (number & 15) as u8,
            _ => return None,
        };
        Some(SourceBit { word: self.word, mask: 1_u16.wrapping_shl(bit as u32) })
    }

    /// The operation data, from the word's value.
    #[must_use]
    pub fn value(self, word: u16) -> u16 {
        self.single.map_or(word, |bit| word.wrapping_shr(bit.into()) & 1)
    }

    /// The word to ask for.
    #[must_use]
    pub const fn word(self) -> Word {
        self.word
    }
}

/// One bit of a word.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct SourceBit {
    /// The word.
    pub word: Word,
    /// The bit in it.
    pub mask: u16,
}

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
    /// From the allocations in the parameters.
    #[must_use]
    pub fn new(parameters: &Parameters) -> Self {
        let word = |idn: Idn| parameters.get_word(idn);
        let source = |idn, bit| Source::from_idn(idn).and_then(|source| source.bit(bit));
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

const APPLICATION_WORD: Idn = Idn::product(19);

/// The mask of a bit that a control bit may set: any of P-0-0019, or bit 0 of an enable; 0 for everything else.
fn target(idn: Idn, bit: u16) -> u32 {
    if idn == APPLICATION_WORD {
        return if bit < 16 { 1_u32.wrapping_shl(bit.into()) } else { 0 };
    }
    enable_bit(idn).filter(|_| bit == 0).unwrap_or(0)
}

/// Where a single bit that the control sets lies.
pub(crate) const fn enable_bit(idn: Idn) -> Option<u32> {
    const S_400: Idn = Idn::standard(400);
    const S_405: Idn = Idn::standard(405);
    const S_406: Idn = Idn::standard(406);
    const S_407: Idn = Idn::standard(407);
    match idn {
        S_400 => Some(HOME_SWITCH),
        S_405 => Some(PROBE_1_ENABLE),
        S_406 => Some(PROBE_2_ENABLE),
        S_407 => Some(HOMING_ENABLE),
        _ => None,
    }
}

const fn with(word: u32, mask: u32, set: bool) -> u32 {
    if set { word | mask } else { word & !mask }
}

#[cfg(test)]
mod tests {
    use super::*;
    use sercos::data_block::Selection;
    use sercos::diagnostic::Class2;
    use sercos::dictionary;

    #[test]
    fn every_data_block_that_the_table_lets_a_bit_show_has_a_source() {
        for block in dictionary::select(Selection::BitSources) {
            assert!(Source::from_idn(block.idn).is_some(), "{}", block.idn);
        }
        assert_eq!(Source::from_idn(Idn::standard(2)), None);
        assert_eq!(Source::from_idn(Idn::product(11)), None);
        let targets: std::vec::Vec<Idn> = dictionary::select(Selection::BitTargets).map(|block| block.idn).collect();
        assert_eq!(
            targets,
            [400, 405, 406, 407].map(Idn::standard).into_iter().chain([APPLICATION_WORD]).collect::<std::vec::Vec<_>>()
        );
        for idn in targets {
            assert_ne!(target(idn, 0), 0, "{idn}");
        }
    }

    #[test]
    fn every_warning_has_a_data_block_of_its_own_and_stands_in_the_manual() {
        let manual = dictionary::find(Idn::standard(12)).unwrap().documentation;
        // A drive without a fan of its own has no cooling warning; bit 15 stands for S-0-0181.
        for warning in Class2::all().difference(Class2::COOLING | Class2::MANUFACTURER).iter() {
            let bit = warning.bits().trailing_zeros() as u16;
            let idn = Idn::standard(310 + bit);
            assert!(dictionary::find(idn).is_some_and(|block| block.is_in(Selection::BitSources)), "{idn}");
            assert_eq!(
                Source::from_idn(idn).unwrap().bit(0),
                Some(SourceBit { word: Word::Class2, mask: warning.bits() })
            );
            let mut words = manual.split([' ', ':', ',']);
            assert!(words.any(|word| word == std::format!("{bit}")), "bit {bit} is not in \"{manual}\"");
        }
    }

    #[test]
    fn a_single_bit_data_block_has_its_bit_in_bit_0_and_no_other() {
        let standstill = Source::from_idn(Idn::standard(331)).unwrap();
        assert_eq!(standstill.bit(0), Some(SourceBit { word: Word::Class3, mask: 2 }));
        assert_eq!(standstill.bit(1), None);
        assert_eq!((standstill.value(2), standstill.value(0xFFFD)), (1, 0));
        let class_3 = Source::from_idn(Idn::standard(13)).unwrap();
        assert_eq!(class_3.bit(15), Some(SourceBit { word: Word::Class3, mask: 0x8000 }));
        assert_eq!(class_3.bit(16), None);
    }

    #[test]
    fn control_bits_set_and_clear_their_target_only() {
        let mut parameters = Parameters::new();
        parameters.set(Idn::REAL_TIME_CONTROL_BIT_1, 0x8013).unwrap();
        parameters.set(Idn::standard(413), 3).unwrap();
        let bits = BitSettings::new(&parameters);
        assert_eq!(bits.apply_control_word(0x8001, 1 << 6), 0x8009);
        assert_eq!(bits.apply_control_word(0x8009, 0), 0x8001);
        assert_eq!(bits.apply_control_word(0x8001, 1 << 7), 0x8001, "bit 7 is not allocated");
    }

    #[test]
    fn signal_words_follow_their_two_lists_and_a_short_second_list_means_bit_0() {
        let mut parameters = Parameters::new();
        parameters.set_list(Idn::SIGNAL_STATUS_LIST, &[Idn::standard(13), Idn::standard(331)]).unwrap();
        parameters.set_words(Idn::standard(328), &[4]).unwrap();
        parameters.set_list(Idn::SIGNAL_CONTROL_LIST, &[APPLICATION_WORD, APPLICATION_WORD]).unwrap();
        parameters.set_words(Idn::standard(329), &[15]).unwrap();
        let bits = BitSettings::new(&parameters);
        assert_eq!(bits.signal_status[0], Some(SourceBit { word: Word::Class3, mask: 1 << 4 }));
        assert_eq!(bits.signal_status[1], Some(SourceBit { word: Word::Class3, mask: 1 << 1 }));
        assert_eq!(bits.signal_status[2], None);
        assert_eq!(bits.apply_signal_control(0x0100, 0b01), 0x8100);
        assert_eq!(bits.apply_signal_control(0x8100, 0b10), 0x0101);
    }
}
