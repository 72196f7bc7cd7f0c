//! NRZI: line bits to light and dark, and back.

use std::cell::OnceCell;

use super::{LineError, decode, encode};

/// The levels of one burst on the fibre, one a bit time.
///
/// sercon816.md 10.3: a zero changes the level, a one keeps it. The level *before* the burst belongs to it, because
/// the first bit is nothing but a comparison with it.
#[derive(Clone, Debug)]
pub struct LineSignal {
    before: bool,
    levels: Vec<bool>,
    /// Every station of the ring asks for the same answer; nobody changes the levels behind it.
    decoded: OnceCell<Result<Vec<u8>, LineError>>,
}

impl LineSignal {
    /// The burst of a telegram, flag to flag; `bytes` are address and data.
    pub fn of_telegram(bytes: &[u8]) -> Self {
        Self::of_bits(false, &encode(bytes))
    }

    /// The burst of any line bits; `before` is the level of the bit time before it.
    pub fn of_bits(before: bool, bits: &[bool]) -> Self {
        let mut level = before;
        let levels = bits
            .iter()
            .map(|&bit| {
                level ^= !bit;
                level
            })
            .collect();
        Self::new(before, levels)
    }

    /// The levels as a recording packs them: eight a byte, most significant bit first in time
    /// (README of the captures). The level before the first one is taken as its opposite, so that a recording which
    /// starts exactly at a flag still shows the flag's first zero.
    pub fn from_packed(packed: &[u8]) -> Self {
        let levels: Vec<bool> =
            packed.iter().flat_map(|byte| (0..8).rev().map(move |position| byte >> position & 1 == 1)).collect();
        Self::new(levels.first().is_none_or(|first| !first), levels)
    }

    /// The levels as a recording packs them, `lead` bit times of the level before first, the last level as padding.
    pub fn to_packed(&self, lead: usize) -> Vec<u8> {
        let mut levels = vec![self.before; lead];
        levels.extend(&self.levels);
        let padding = levels.last().copied().unwrap_or(self.before);
        levels.resize(levels.len().next_multiple_of(8), padding);
        levels.chunks_exact(8).map(|chunk| chunk.iter().fold(0, |byte, &level| byte << 1 | u8::from(level))).collect()
    }

    /// Address and data of the telegram in this burst.
    ///
    /// # Errors
    ///
    /// Why it is no valid telegram.
    pub fn telegram(&self) -> Result<&[u8], LineError> {
        match self.decoded.get_or_init(|| decode(&self.bits())) {
            Ok(bytes) => Ok(bytes),
            Err(error) => Err(*error),
        }
    }

    /// Length in bit times.
    pub fn len(&self) -> usize {
        self.levels.len()
    }

    /// Whether nothing is sent at all.
    pub fn is_empty(&self) -> bool {
        self.levels.is_empty()
    }

    /// The line bits, inserted zeros and flags included.
    pub fn bits(&self) -> Vec<bool> {
        let before = std::iter::once(self.before).chain(self.levels.iter().copied());
        before.zip(&self.levels).map(|(before, &level)| before == level).collect()
    }

    /// The same burst with line bit `position` inverted on the way: every level from there on is inverted.
    /// `None` beyond its end.
    pub fn with_flipped_bit(&self, position: usize) -> Option<Self> {
        let mut bits = self.bits();
        *bits.get_mut(position)? ^= true;
        Some(Self::of_bits(self.before, &bits))
    }

    /// The same burst with one level inverted for a single bit time, which spoils the bits on both sides of it.
    /// `None` beyond its end.
    pub fn with_flipped_level(&self, position: usize) -> Option<Self> {
        let mut levels = self.levels.clone();
        *levels.get_mut(position)? ^= true;
        Some(Self::new(self.before, levels))
    }

    fn new(before: bool, levels: Vec<bool>) -> Self {
        Self { before, levels, decoded: OnceCell::new() }
    }
}

impl PartialEq for LineSignal {
    fn eq(&self, other: &Self) -> bool {
        self.before == other.before && self.levels == other.levels
    }
}

impl Eq for LineSignal {}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const MST_CP0: [u8; 2] = [0xFF, 0x00];

    #[test]
    fn the_first_recorded_telegram() {
        // First line of the recording: two bit times of lead, five of padding.
        let packed = [0x3F, 0x81, 0xEA, 0xBD, 0x6B, 0xE0, 0x3F];
        assert_eq!(LineSignal::from_packed(&packed).telegram(), Ok(&MST_CP0[..]));
        let signal = LineSignal::of_telegram(&MST_CP0);
        assert_eq!(signal.len(), 49);
        assert_eq!(signal.to_packed(2)[..6], packed[..6]);
    }

    #[test]
    fn a_wrong_level_is_never_a_telegram() {
        let signal = LineSignal::of_telegram(&[1, 0x0F, 0, 3, 0]);
        for position in 0..signal.len() {
            let level = signal.with_flipped_level(position).expect("inside the burst");
            // The last level's only neighbour is idle line: there the flag's final zero alone is lost.
            assert!(level.telegram().is_err(), "level {position}");
            let bit = signal.with_flipped_bit(position).expect("inside the burst");
            assert!(bit.telegram().is_err(), "bit {position}");
        }
        assert_eq!(signal.with_flipped_bit(signal.len()), None);
    }

    proptest! {
        #[test]
        fn light_and_dark_are_alike(bytes in prop::collection::vec(any::<u8>(), 2..40), lead in 0usize..9) {
            let signal = LineSignal::of_telegram(&bytes);
            let mut packed = signal.to_packed(lead);
            let recorded = LineSignal::from_packed(&packed);
            prop_assert_eq!(recorded.telegram(), Ok(&bytes[..]));
            packed.iter_mut().for_each(|byte| *byte = !*byte);
            let inverted = LineSignal::from_packed(&packed);
            prop_assert_eq!(inverted.telegram(), Ok(&bytes[..]));
        }
    }
}
