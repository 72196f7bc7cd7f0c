//! Lives from seeds.

mod axis;
mod events;
mod ordeals;
mod services;

pub(crate) use axis::MODES;
pub(crate) use events::{BRAKE_FAULTS, FAULTS};

use crate::dice::Dice;
use crate::life::Life;

/// The life of a seed.
#[must_use]
pub fn life_of(seed: u64) -> Life {
    let mut dice = Dice::new(seed);
    let axis = axis::any(&mut dice);
    let (events, rest) = events::any(&mut dice, &axis);
    Life { seed, axis, events, rest }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_seed_gives_the_same_life_again_and_another_seed_another() {
        assert_eq!(life_of(3), life_of(3));
        assert_ne!(life_of(3), life_of(4));
    }

    #[test]
    fn events_are_in_the_order_of_time_and_as_many_as_promised() {
        for seed in 0..500 {
            let life = life_of(seed);
            assert!(life.events.is_sorted_by_key(|event| event.at), "{seed}");
            assert!((4..=60).contains(&life.events.len()), "{seed}: {}", life.events.len());
        }
    }
}
