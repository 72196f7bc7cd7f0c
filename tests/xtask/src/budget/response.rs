//! Response times: how long a task takes from its cause to its end, at worst, with everything else that may run.
//!
//! A task that comes several times in a communication cycle takes part with the demand of a whole cycle at once, the worst that was counted.
//! That is a bound for every stretch of a cycle's length, wherever it begins, and so for what such a task takes away from another one
//! in that time: the chip raises its events at fixed times of the cycle, and each of them starts an activation or two, so that the stretch has each of
//! these places once. All but one of them are taken in every cycle. The one that is not, the service container, is taken in the
//! cycle in which the stretch ends or in the one in which it begins, and either cycle was counted with it.

/// A task, as far as time is concerned. All times in ns.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Load {
    /// Higher ones interrupt lower ones.
    pub(crate) priority: u8,
    /// Between its causes, or groups of causes.
    pub(crate) period: u64,
    /// Of all activations in a period together, at worst all at once.
    pub(crate) demand: u64,
    /// Its longest critical section.
    pub(crate) locked: u64,
    /// Its critical sections hold up the tasks above it, up to this priority.
    pub(crate) ceiling: u8,
    /// The place in the set of the task that comes half a period before and after it. Each of them is done before the other comes: their deadline.
    pub(crate) in_turn_with: Option<usize>,
}

/// Longest that a task waits for a critical section of a task below it.
pub(crate) fn blocking(set: &[Load], task: usize) -> u64 {
    let priority = set[task].priority;
    let holds_up = |load: &&Load| load.priority < priority && priority <= load.ceiling;
    set.iter().filter(holds_up).map(|load| load.locked).max().unwrap_or(0)
}

/// From the cause to the end of the last activation of a period; `None` if that is not before the next cause.
///
/// The standard iteration of fixed-priority scheduling. Tasks of the same priority wait for each other, so each counts with all of its activations.
pub(crate) fn response(set: &[Load], task: usize) -> Option<u64> {
    let own = &set[task];
    let begin = blocking(set, task) + own.demand;
    let mut response = begin;
    while response <= own.period {
        let others = set
            .iter()
            .enumerate()
            .filter(|(index, load)| *index != task && load.priority >= own.priority && load.in_turn_with != Some(task));
        let interference: u64 = others.map(|(index, load)| demand(set, index, load, response)).sum();
        if begin + interference == response {
            return Some(response);
        }
        response = begin + interference;
    }
    None
}

/// What a task asks for within a stretch of time; of two that come in turn the first asks for both, beginning with the longer one.
fn demand(set: &[Load], index: usize, load: &Load, time: u64) -> u64 {
    match load.in_turn_with {
        None => time.div_ceil(load.period) * load.demand,
        Some(other) if other < index => 0,
        Some(other) => {
            let activations = time.div_ceil(load.period / 2);
            let [short, long] = [load.demand.min(set[other].demand), load.demand.max(set[other].demand)];
            activations.div_ceil(2) * long + activations / 2 * short
        }
    }
}

/// Share of the processor in tenths of a per cent, rounded up.
pub(crate) const fn share(demand: u64, period: u64) -> u64 {
    (demand * 1_000).div_ceil(period)
}

#[cfg(test)]
mod tests {
    use super::*;

    const fn of(priority: u8, period: u64, demand: u64) -> Load {
        Load { priority, period, demand, locked: 0, ceiling: 3, in_turn_with: None }
    }

    #[test]
    fn the_textbook_set_has_the_textbook_response_times() {
        // Periods 7, 12, 20; times 3, 3, 5: response times 3, 6, 20 (Joseph and Pandya).
        let set = [of(3, 7, 3), of(2, 12, 3), of(1, 20, 5)];
        assert_eq!([0, 1, 2].map(|task| response(&set, task)), [Some(3), Some(6), Some(20)]);
        assert_eq!([0, 1, 2].map(|task| share(set[task].demand, set[task].period)), [429, 250, 250]);
    }

    #[test]
    fn tasks_in_turn_do_not_wait_for_each_other_and_others_wait_for_both_of_them() {
        // Long, short, and one that takes a quarter of their period and more.
        let mut set = [of(4, 100, 20), of(4, 100, 8), of(4, 200, 25)];
        assert_eq!([0, 1, 2].map(|task| response(&set, task)), [Some(53), Some(53), Some(53)]);
        (set[0].in_turn_with, set[1].in_turn_with) = (Some(1), Some(0));
        assert_eq!([0, 1, 2].map(|task| response(&set, task)), [Some(45), Some(33), Some(45)]);
        // From half a period on the other one comes too.
        set[2].demand = 35;
        assert_eq!(response(&set, 2), Some(63));
    }

    #[test]
    fn a_set_that_asks_for_more_than_there_is_has_no_response_time() {
        let set = [of(2, 7, 3), of(1, 12, 7)];
        assert_eq!(response(&set, 1), None);
    }

    #[test]
    fn a_task_waits_for_the_longest_lock_below_it_and_for_no_lock_above() {
        let mut set = [of(3, 100, 10), of(2, 100, 20), of(1, 100, 30)];
        (set[0].locked, set[1].locked, set[2].locked) = (9, 4, 7);
        assert_eq!([0, 1, 2].map(|task| blocking(&set, task)), [7, 7, 0]);
        assert_eq!([0, 1, 2].map(|task| response(&set, task)), [Some(17), Some(37), Some(60)]);
        // A task above the ceiling waits for nobody.
        set[2].ceiling = 2;
        assert_eq!([0, 1, 2].map(|task| blocking(&set, task)), [4, 7, 0]);
    }

    #[test]
    fn tasks_of_one_priority_wait_for_all_activations_of_each_other() {
        // The first one three times.
        let set = [of(4, 500, 3 * 10), of(4, 500, 20)];
        assert_eq!([0, 1].map(|task| response(&set, task)), [Some(50), Some(50)]);
    }
}
