//! Randomness that repeats itself: everything about a life comes from its seed.

/// A generator with a state of 64 bits (splitmix64, Steele and others 2014).
#[derive(Clone, Debug)]
pub struct Dice {
    state: u64,
}

impl Dice {
    /// Different seeds give unrelated numbers, neighbouring ones too.
    #[must_use]
    pub const fn new(seed: u64) -> Self {
        Self { state: seed }
    }

    /// 64 random bits.
    pub fn bits(&mut self) -> u64 {
        self.state = self.state.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.state;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    /// 0 to `below` - 1; 0 for 0.
    pub fn below(&mut self, below: u64) -> u64 {
        if below == 0 { 0 } else { self.bits() % below }
    }

    /// One of `from` to `to`, both included.
    pub fn between(&mut self, from: i64, to: i64) -> i64 {
        let span = to.wrapping_sub(from) as u64;
        from.wrapping_add(if span == u64::MAX { self.bits() } else { self.below(span + 1) } as i64)
    }

    /// True so many times in a hundred.
    pub fn chance(&mut self, percent: u64) -> bool {
        self.below(100) < percent
    }

    /// One of these, all alike.
    pub fn pick<T: Copy>(&mut self, choices: &[T]) -> Option<T> {
        choices.get(self.below(choices.len() as u64) as usize).copied()
    }

    /// One of these, each as often as its weight says.
    pub fn weighted<T: Copy>(&mut self, choices: &[(u64, T)]) -> Option<T> {
        let mut left = self.below(choices.iter().map(|(weight, _)| weight).sum());
        choices.iter().find_map(|&(weight, choice)| {
            if left < weight {
                return Some(choice);
            }
            left -= weight;
            None
        })
    }

    /// 0 to 1.
    pub fn share(&mut self) -> f64 {
        (self.bits() >> 11) as f64 / (1u64 << 53) as f64
    }

    /// A magnitude with all decades alike, with a random sign.
    pub fn spread(&mut self, least: f64, most: f64) -> f64 {
        let size = least * (most / least).powf(self.share());
        if self.chance(50) { size } else { -size }
    }
}

/// The seed of a life: so many-th of a run with this seed.
#[must_use]
pub fn seed_of_life(run: u64, index: u64) -> u64 {
    Dice::new(Dice::new(run).bits() ^ index.wrapping_mul(0xD134_2543_DE82_EF95)).bits()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_seed_repeats_itself_and_its_neighbour_does_not() {
        let numbers = |seed| {
            let mut dice = Dice::new(seed);
            (0..100).map(|_| dice.bits()).collect::<Vec<_>>()
        };
        assert_eq!(numbers(1), numbers(1));
        assert_ne!(numbers(1), numbers(2));
        assert_ne!(seed_of_life(1, 0), seed_of_life(1, 1));
        assert_ne!(seed_of_life(1, 1), seed_of_life(2, 1));
    }

    #[test]
    fn weights_and_borders_are_kept() {
        let mut dice = Dice::new(7);
        let chosen = (0..10_000).filter(|_| dice.weighted(&[(1, false), (3, true)]) == Some(true)).count();
        assert!((7_300..7_700).contains(&chosen), "{chosen}");
        assert!((0..1_000).all(|_| (-3..=3).contains(&dice.between(-3, 3))));
        assert!((0..100).any(|_| dice.between(-3, 3) == 3) && (0..100).any(|_| dice.between(-3, 3) == -3));
        let _ = dice.between(i64::MIN, i64::MAX);
        assert_eq!((dice.below(0), dice.pick::<u8>(&[])), (0, None));
    }
}
