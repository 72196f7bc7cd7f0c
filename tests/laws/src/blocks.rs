//! Operation data by their numbers.

use std::collections::BTreeMap;

/// Numbers S-0-0000 to S-0-0511, then P-0-0000 to P-0-0511.
const NEAR: usize = 512;

/// Words by numbers of data blocks. The laws ask for dozens of them at every look: the ordinary numbers are places in a row, found without a search.
#[derive(Clone, Debug)]
pub(crate) struct Blocks {
    near: Vec<Option<Vec<u16>>>,
    far: BTreeMap<u16, Vec<u16>>,
}

impl Blocks {
    pub(crate) fn new() -> Self {
        Self { near: vec![None; 2 * NEAR], far: BTreeMap::new() }
    }

    fn place(number: u16) -> Option<usize> {
        let (manufacturer, rest) = (usize::from(number >> 15), usize::from(number & 0x7FFF));
        (rest < NEAR).then_some(manufacturer * NEAR + rest)
    }

    fn number(place: usize) -> u16 {
        (((place / NEAR) << 15) | (place % NEAR)) as u16
    }

    pub(crate) fn get(&self, number: u16) -> Option<&[u16]> {
        match Self::place(number) {
            Some(place) => self.near[place].as_deref(),
            None => self.far.get(&number).map(Vec::as_slice),
        }
    }

    pub(crate) fn insert(&mut self, number: u16, words: Vec<u16>) {
        match Self::place(number) {
            Some(place) => self.near[place] = Some(words),
            None => drop(self.far.insert(number, words)),
        }
    }

    /// The words of a number, to be changed; empty, if there were none.
    pub(crate) fn entry(&mut self, number: u16) -> &mut Vec<u16> {
        match Self::place(number) {
            Some(place) => self.near[place].get_or_insert_default(),
            None => self.far.entry(number).or_default(),
        }
    }

    pub(crate) fn remove(&mut self, number: u16) {
        match Self::place(number) {
            Some(place) => self.near[place] = None,
            None => drop(self.far.remove(&number)),
        }
    }

    /// Forgets all but some.
    pub(crate) fn retain(&mut self, stays: impl Fn(u16) -> bool) {
        for (place, words) in self.near.iter_mut().enumerate() {
            if !stays(Self::number(place)) {
                *words = None;
            }
        }
        self.far.retain(|number, _| stays(*number));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_number_has_a_place_of_its_own() {
        let mut blocks = Blocks::new();
        for number in 0..=u16::MAX {
            assert_eq!(blocks.get(number), None);
            blocks.insert(number, vec![number]);
        }
        blocks.entry(3).push(7);
        blocks.entry(0x9003).push(8);
        blocks.retain(|number| number.is_multiple_of(3));
        for number in 0..=u16::MAX {
            let expected = match number {
                3 => Some(&[3, 7][..]),
                0x9003 => Some(&[0x9003, 8][..]),
                _ if number.is_multiple_of(3) => Some(&[number][..]),
                _ => None,
            };
            assert_eq!(blocks.get(number), expected, "{number:04X}H");
        }
        for number in [3, 0x9003] {
            blocks.remove(number);
            assert_eq!(blocks.get(number), None);
            assert!(blocks.entry(number).is_empty());
        }
    }
}
