//! Learns which value the product reads next, so that an answer can carry it along.
//!
//! The product's handlers read the same addresses in the same order at every interrupt. After each read, the one that followed it last time is
//! remembered; an answer then carries the whole chain, as far as its values cannot change before the next event.
//! A wrong guess costs nothing but its two words.

use std::collections::HashMap;

/// Where a chain goes on from: a read at an address by an instruction, or the interrupt that was raised.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum Place {
    Read { pc: u32, address: u32 },
    Interrupt(u8),
}

/// The memory.
#[derive(Clone, Debug, Default)]
pub(crate) struct Prefetch {
    followers: HashMap<Place, Place>,
    last: Option<Place>,
}

impl Prefetch {
    /// The product passes a place.
    pub(crate) fn pass(&mut self, place: Place) {
        if let Some(last) = self.last.replace(place)
            && last != place
        {
            self.followers.insert(last, place);
        }
    }

    /// Addresses expected after the last place, at most `limit`, as long as `value` knows them.
    pub(crate) fn chain(&self, limit: usize, mut value: impl FnMut(u32) -> Option<u32>) -> Vec<(u32, u32)> {
        let mut chain: Vec<(u32, u32)> = Vec::new();
        let mut place = self.last;
        // Every step but the repeated addresses adds an entry; the bound keeps a loop of known addresses from going round for ever.
        for _ in 0..2 * limit {
            let Some(Place::Read { pc, address }) = place.and_then(|place| self.followers.get(&place).copied()) else {
                break;
            };
            if chain.len() == limit {
                break;
            }
            if !chain.iter().any(|(known, _)| *known == address) {
                let Some(value) = value(address) else { break };
                chain.push((address, value));
            }
            place = Some(Place::Read { pc, address });
        }
        chain
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_second_time_the_chain_is_known() {
        let read = |address| Place::Read { pc: 2, address };
        let mut prefetch = Prefetch::default();
        for _ in 0..2 {
            prefetch.pass(Place::Interrupt(9));
            for address in [10, 20, 30] {
                prefetch.pass(read(address));
            }
        }
        prefetch.pass(Place::Interrupt(9));
        let values = |address: u32| (address != 30).then_some(address + 1);
        assert_eq!(prefetch.chain(8, values), [(10, 11), (20, 21)]);
        assert_eq!(prefetch.chain(1, values), [(10, 11)]);
    }
}
