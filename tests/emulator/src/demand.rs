//! What a task asks of the processor: of one activation, of one critical section, and of a whole communication cycle.
//!
//! Instructions and bus accesses of the same activation belong together: the one with the most instructions need not be the one with the most
//! accesses, and a time made of both would be one that never was. So the worst is found by time.

use std::ops::AddAssign;

use crate::CYCLES_PER_INSTRUCTION_TENTHS;

/// Instructions, and accesses to the slow bus beside them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Demand {
    /// Activations that it is the sum of.
    pub activations: u64,
    /// Instructions of these.
    pub instructions: u64,
    /// Accesses to the slow bus of these.
    pub bus: u64,
}

impl AddAssign for Demand {
    fn add_assign(&mut self, other: Self) {
        self.activations += other.activations;
        self.instructions += other.instructions;
        self.bus += other.bus;
    }
}

/// What instructions and accesses cost.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Price {
    /// The core's clock.
    pub core_megahertz: u64,
    /// An access to the slow bus beside its instruction, in ns.
    pub bus_access: u64,
}

impl Default for Price {
    /// An instruction takes a microsecond and an access nothing: for who only counts.
    fn default() -> Self {
        Self { core_megahertz: 1, bus_access: 0 }
    }
}

impl Price {
    /// Time in ns, rounded up.
    #[must_use]
    pub fn nanoseconds(self, demand: Demand) -> u64 {
        (demand.instructions * CYCLES_PER_INSTRUCTION_TENTHS * 100).div_ceil(self.core_megahertz)
            + demand.bus * self.bus_access
    }

    fn dearer(self, one: Demand, other: Demand) -> Demand {
        if self.nanoseconds(other) > self.nanoseconds(one) { other } else { one }
    }
}

/// The worst that was seen of a task.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Worst {
    /// The activation that took longest.
    pub activation: Demand,
    /// The cycle whose activations took longest together.
    pub cycle: Demand,
    /// The most activations of a cycle.
    pub activations: u64,
    /// The outermost critical section that took longest.
    pub lock: Demand,
    /// The cycle that is being added up: its number, and what it has come to.
    running: (u64, Demand),
}

impl Worst {
    /// One more activation; it belongs to the cycle in which it began.
    pub(crate) fn add(&mut self, activation: Demand, cycle: u64, price: Price) {
        self.activation = price.dearer(self.activation, activation);
        if self.running.0 != cycle {
            self.running = (cycle, Demand::default());
        }
        self.running.1 += activation;
        self.cycle = price.dearer(self.cycle, self.running.1);
        self.activations = self.activations.max(self.running.1.activations);
    }

    /// One more critical section.
    pub(crate) fn add_lock(&mut self, lock: Demand, price: Price) {
        self.lock = price.dearer(self.lock, lock);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PRICE: Price = Price { core_megahertz: 168, bus_access: 550 };

    fn of(instructions: u64, bus: u64) -> Demand {
        Demand { activations: 1, instructions, bus }
    }

    #[test]
    fn a_thousand_instructions_and_two_accesses_take_ten_microseconds() {
        assert_eq!(PRICE.nanoseconds(of(1_000, 2)), 8_929 + 1_100);
    }

    #[test]
    fn the_worst_activation_is_the_longest_and_not_made_of_two() {
        let mut worst = Worst::default();
        // 8.9 us, 5.7 us with the most accesses, 7.7 us.
        for activation in [of(1_000, 0), of(20, 10), of(800, 1)] {
            worst.add(activation, 0, PRICE);
        }
        assert_eq!(worst.activation, of(1_000, 0));
        // Ten accesses are longer than 600 instructions.
        let mut worst = Worst::default();
        for activation in [of(600, 0), of(20, 10)] {
            worst.add(activation, 0, PRICE);
        }
        assert_eq!(worst.activation, of(20, 10));
    }

    #[test]
    fn the_worst_cycle_is_the_sum_of_what_began_in_it() {
        let mut worst = Worst::default();
        for (cycle, activation) in [(0, of(500, 0)), (1, of(400, 0)), (1, of(300, 1)), (3, of(600, 0))] {
            worst.add(activation, cycle, PRICE);
        }
        assert_eq!(worst.cycle, Demand { activations: 2, instructions: 700, bus: 1 });
        assert_eq!((worst.activation, worst.activations), (of(600, 0), 2));
    }

    #[test]
    fn the_cycle_with_the_most_activations_need_not_be_the_longest() {
        let mut worst = Worst::default();
        for (cycle, activation) in [(0, of(10, 0)), (0, of(10, 0)), (0, of(10, 0)), (1, of(500, 0))] {
            worst.add(activation, cycle, PRICE);
        }
        assert_eq!((worst.cycle, worst.activations), (of(500, 0), 3));
    }

    #[test]
    fn the_worst_critical_section_is_the_longest() {
        let mut worst = Worst::default();
        for lock in [of(50, 0), of(10, 2), of(60, 0)] {
            worst.add_lock(lock, PRICE);
        }
        assert_eq!(worst.lock, of(10, 2));
    }
}
