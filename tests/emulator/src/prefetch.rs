//! Learns which value the product reads next, so that an answer can carry it along.
//!
//! The product's handlers read the same addresses in the same order at every interrupt, and mostly after the same number of instructions. After
//! each read, the two that followed it last are remembered, and how many ticks later. The product's loops take two paths in turn, one for each half
//! of a tick, so the follower *before last* is the one that is expected. An answer then carries the whole chain, as far as its values are
//! known: until the next event, or at the very tick for a counter that runs. A wrong guess costs nothing but its words.

use std::collections::HashMap;

/// Where a chain goes on from: a read at an address by an instruction, or the interrupt that was raised.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum Place {
    Read { pc: u32, address: u32 },
    Interrupt(u8),
}

/// A value that an answer carries.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Foretold {
    pub(crate) address: u32,
    pub(crate) value: u32,
    /// [`emulator_link::protocol::prefetched::AT`].
    pub(crate) at: u32,
}

/// The place that came next, and the ticks to it.
type Follower = (Place, u32);

/// The memory.
#[derive(Clone, Debug, Default)]
pub(crate) struct Prefetch {
    /// The last follower and the one before, each with the ticks to it.
    followers: HashMap<Place, [Follower; 2]>,
    last: Option<Place>,
    /// Tick of the last place since the product was resumed; 0 when it was before.
    tick: u32,
}

impl Prefetch {
    /// The product passes a place, so many ticks after it was resumed.
    pub(crate) fn pass(&mut self, place: Place, tick: u32) {
        let after = tick.saturating_sub(self.tick);
        self.tick = tick;
        if let Some(last) = self.last.replace(place)
            && last != place
        {
            let newest = (place, after);
            self.followers.entry(last).and_modify(|known| *known = [newest, known[0]]).or_insert([newest; 2]);
        }
    }

    /// The product is resumed: its ticks count from 0.
    pub(crate) fn resume(&mut self) {
        self.tick = 0;
    }

    /// What is expected after the last place, at most `limit`, as long as `value` knows it; `value` gets an address, and the tick of the read.
    pub(crate) fn chain(&self, limit: usize, mut value: impl FnMut(u32, u32) -> Option<Foretold>) -> Vec<Foretold> {
        let mut chain: Vec<Foretold> = Vec::new();
        let mut place = self.last;
        let mut tick = self.tick;
        // Every step but the repeated addresses adds an entry; the bound keeps a loop of known addresses from going round for ever.
        for _ in 0..2 * limit {
            let expected = place.and_then(|place| self.followers.get(&place)).map(|[_, before_last]| *before_last);
            let Some((Place::Read { pc, address }, after)) = expected else { break };
            if chain.len() == limit {
                break;
            }
            tick += after;
            let known = |foretold: &Foretold| foretold.address == address && foretold.at == 0;
            if !chain.iter().any(known) {
                let Some(foretold) = value(address, tick) else { break };
                chain.push(foretold);
            }
            place = Some(Place::Read { pc, address });
        }
        chain
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(address: u32) -> Place {
        Place::Read { pc: 2, address }
    }

    /// As the product reads at every interrupt, a few ticks between.
    fn learned() -> Prefetch {
        let mut prefetch = Prefetch::default();
        for _ in 0..2 {
            prefetch.resume();
            prefetch.pass(Place::Interrupt(9), 0);
            for (address, tick) in [(10, 7), (20, 12), (30, 20)] {
                prefetch.pass(read(address), tick);
            }
        }
        prefetch.resume();
        prefetch.pass(Place::Interrupt(9), 0);
        prefetch
    }

    #[test]
    fn the_second_time_the_chain_is_known() {
        let prefetch = learned();
        let foretold = |address| Foretold { address, value: address + 1, at: 0 };
        let values = |address: u32, _| (address != 30).then_some(foretold(address));
        assert_eq!(prefetch.chain(8, values), [foretold(10), foretold(20)]);
        assert_eq!(prefetch.chain(1, values), [foretold(10)]);
    }

    #[test]
    fn of_two_paths_that_take_turns_the_one_whose_turn_it_is_is_expected() {
        let mut prefetch = Prefetch::default();
        let ticks = |address: u32, at: u32| Some(Foretold { address, value: 0, at });
        for turn in 0..8_u32 {
            let (address, tick) = if turn % 2 == 0 { (10, 40) } else { (20, 62) };
            prefetch.resume();
            prefetch.pass(Place::Interrupt(18), 0);
            if turn >= 4 {
                let expected = Foretold { address, value: 0, at: tick };
                assert_eq!(prefetch.chain(1, ticks), [expected], "turn {turn}");
            }
            prefetch.pass(read(address), tick);
        }
    }

    #[test]
    fn the_ticks_of_a_chain_count_from_the_resume_whatever_was_answered_in_between() {
        let mut prefetch = learned();
        let ticks = |address: u32, at: u32| Some(Foretold { address, value: 0, at });
        let at = |chain: Vec<Foretold>| chain.iter().map(|foretold| foretold.at).collect::<Vec<_>>();
        assert_eq!(at(prefetch.chain(8, ticks)), [7, 12, 20]);
        // The first read is a question: its answer resumes the product.
        prefetch.pass(read(10), 7);
        prefetch.resume();
        assert_eq!(at(prefetch.chain(8, ticks)), [5, 13]);
    }
}
