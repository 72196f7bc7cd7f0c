//! How many instructions a task takes each time it runs: counted from the stream of what the processor did.
//!
//! Every exception has a context of its own, so that what interrupts a task is not counted as the task's. Functions are followed inside a
//! context by the returns of the calls that lead to them; what they call counts as theirs.

use std::collections::{BTreeMap, HashMap};
use std::ops::Range;

use crate::trace::{TraceEvent, TraceSink};

/// What an instruction means to the count.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Step {
    /// A call; the function returns to this address.
    Call(u32),
    /// Raises the priority ceiling: a critical section begins.
    Lock,
    /// Restores the ceiling.
    Unlock,
}

/// What is known of the program.
#[derive(Clone, Debug, Default)]
pub struct Listing {
    /// Instructions by their address; those without a meaning of their own are left out.
    pub steps: HashMap<u32, Step>,
    /// First instruction of the functions to be counted, and their names.
    pub functions: HashMap<u32, String>,
    /// Addresses whose accesses cost wait states.
    pub slow_bus: Range<u32>,
    /// The exception whose instructions are wanted one by one, see [`Activations::profile`].
    pub profiled: Option<u16>,
}

/// How often instructions were executed: by the return addresses of the calls that were open, the outermost first, then by address.
pub type Profile = HashMap<Vec<u32>, HashMap<u32, u64>>;

/// Figures of something that happens many times.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Spread {
    /// How often.
    pub count: u64,
    /// Least.
    pub least: u64,
    /// Most.
    pub most: u64,
    /// All together.
    pub sum: u64,
}

impl Default for Spread {
    fn default() -> Self {
        Self { count: 0, least: u64::MAX, most: 0, sum: 0 }
    }
}

impl Spread {
    fn add(&mut self, value: u64) {
        self.count += 1;
        self.least = self.least.min(value);
        self.most = self.most.max(value);
        self.sum += value;
    }

    /// The mean, rounded to the nearest; zero without any.
    #[must_use]
    pub fn mean(&self) -> u64 {
        (self.sum + self.count / 2).checked_div(self.count).unwrap_or(0)
    }
}

/// What the activations of a task took.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct TaskCount {
    /// Instructions of the task itself.
    pub own: Spread,
    /// The same, with the tasks that interrupted it.
    pub with_preemption: Spread,
    /// Accesses to the slow bus.
    pub bus: Spread,
    /// Instructions of each outermost critical section.
    pub locked: Spread,
    /// Accesses to the slow bus in each outermost critical section.
    pub bus_locked: Spread,
}

/// A function that is being executed.
#[derive(Clone, Copy, Debug)]
struct Running {
    entry: u32,
    /// Calls that were open when it began: it has ended when there are fewer.
    depth: usize,
    from: u64,
}

/// An exception that is being served, or the thread.
#[derive(Clone, Debug, Default)]
struct Context {
    exception: u16,
    own: u64,
    preempted_by: u64,
    bus: u64,
    /// Return addresses of the open calls.
    returns: Vec<u32>,
    running: Vec<Running>,
    locks: u32,
    locked_from: (u64, u64),
    task: TaskCount,
    functions: Vec<(u32, u64)>,
    profile: Profile,
}

impl Context {
    fn instruction(&mut self, address: u32, listing: &Listing) {
        if self.returns.last() == Some(&address) {
            self.returns.pop();
            self.end_functions();
        }
        if listing.functions.contains_key(&address) {
            let depth = self.returns.len();
            // A loop may lead back to the first instruction.
            let again = self.running.iter().any(|running| (running.entry, running.depth) == (address, depth));
            if !again {
                self.running.push(Running { entry: address, depth, from: self.own });
            }
        }
        self.own += 1;
        if listing.profiled == Some(self.exception) {
            match self.profile.get_mut(self.returns.as_slice()) {
                Some(place) => *place.entry(address).or_default() += 1,
                None => _ = self.profile.insert(self.returns.clone(), HashMap::from([(address, 1)])),
            }
        }
        match listing.steps.get(&address) {
            Some(Step::Call(returns_to)) => self.returns.push(*returns_to),
            Some(Step::Lock) => self.lock(),
            Some(Step::Unlock) => self.unlock(),
            None => {}
        }
    }

    fn end_functions(&mut self) {
        while let Some(running) = self.running.pop_if(|running| running.depth > self.returns.len()) {
            self.functions.push((running.entry, self.own - running.from));
        }
    }

    fn lock(&mut self) {
        if self.locks == 0 {
            self.locked_from = (self.own, self.bus);
        }
        self.locks += 1;
    }

    /// A task restores the ceiling once more at its end, where nothing is locked.
    fn unlock(&mut self) {
        if self.locks == 1 {
            self.task.locked.add(self.own - self.locked_from.0);
            self.task.bus_locked.add(self.bus - self.locked_from.1);
        }
        self.locks = self.locks.saturating_sub(1);
    }
}

/// The count.
#[derive(Clone, Debug)]
pub struct Activations {
    listing: Listing,
    /// The innermost last; below the first there is what ran when the count began.
    contexts: Vec<Context>,
    base: Context,
    recording: bool,
    executed: u64,
    thread: TaskCount,
    tasks: BTreeMap<u16, TaskCount>,
    functions: BTreeMap<String, Spread>,
    profile: Profile,
}

impl Activations {
    /// Counts what begins after the first mark and ends before the second.
    #[must_use]
    pub fn new(listing: Listing) -> Self {
        Self {
            listing,
            contexts: Vec::new(),
            base: Context::default(),
            recording: false,
            executed: 0,
            thread: TaskCount::default(),
            tasks: BTreeMap::new(),
            functions: BTreeMap::new(),
            profile: Profile::new(),
        }
    }

    /// By the number of the exception (16 + number of the interrupt).
    #[must_use]
    pub fn tasks(&self) -> &BTreeMap<u16, TaskCount> {
        &self.tasks
    }

    /// By the names of the listing: instructions of each call, with all that it calls, without interrupts.
    #[must_use]
    pub fn functions(&self) -> &BTreeMap<String, Spread> {
        &self.functions
    }

    /// Every instruction of the activations of [`Listing::profiled`], without what interrupted them.
    #[must_use]
    pub const fn profile(&self) -> &Profile {
        &self.profile
    }

    /// Critical sections of the thread, which has no activations.
    #[must_use]
    pub fn thread(&self) -> &TaskCount {
        &self.thread
    }

    /// All instructions between the marks, the thread's included.
    #[must_use]
    pub fn executed(&self) -> u64 {
        self.executed
    }

    fn mark(&mut self) {
        self.recording = !self.recording;
        // What runs right now has been seen in part only.
        self.contexts.clear();
        self.thread = std::mem::take(&mut self.base).task;
    }

    fn leave(&mut self, exception: u16) {
        // Without it, the exception began before the mark.
        let Some(place) = self.contexts.iter().rposition(|context| context.exception == exception) else {
            self.contexts.clear();
            return;
        };
        self.contexts.truncate(place + 1);
        let Some(mut ended) = self.contexts.pop() else { return };
        ended.returns.clear();
        for running in std::mem::take(&mut ended.running) {
            ended.functions.push((running.entry, ended.own - running.from));
        }
        let whole = ended.own + ended.preempted_by;
        self.contexts.last_mut().unwrap_or(&mut self.base).preempted_by += whole;
        if ended.own == 0 {
            // The shim's: none of its instructions is logged.
            return;
        }
        let task = self.tasks.entry(exception).or_default();
        task.own.add(ended.own);
        task.with_preemption.add(whole);
        task.bus.add(ended.bus);
        merge(&mut task.locked, ended.task.locked);
        merge(&mut task.bus_locked, ended.task.bus_locked);
        for (path, places) in ended.profile {
            let known = self.profile.entry(path).or_default();
            for (address, times) in places {
                *known.entry(address).or_default() += times;
            }
        }
        for (entry, instructions) in ended.functions {
            if let Some(name) = self.listing.functions.get(&entry) {
                self.functions.entry(name.clone()).or_default().add(instructions);
            }
        }
    }
}

fn merge(into: &mut Spread, other: Spread) {
    into.count += other.count;
    into.least = into.least.min(other.least);
    into.most = into.most.max(other.most);
    into.sum += other.sum;
}

impl TraceSink for Activations {
    fn take(&mut self, event: TraceEvent) {
        match event {
            TraceEvent::Mark => self.mark(),
            _ if !self.recording => {}
            TraceEvent::Instruction(address) => {
                self.executed += 1;
                self.contexts.last_mut().unwrap_or(&mut self.base).instruction(address, &self.listing);
            }
            TraceEvent::Access(address) => {
                if self.listing.slow_bus.contains(&address) {
                    self.contexts.last_mut().unwrap_or(&mut self.base).bus += 1;
                }
            }
            TraceEvent::Entered(exception) => self.contexts.push(Context { exception, ..Context::default() }),
            TraceEvent::Left(exception) => self.leave(exception),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use TraceEvent::{Access, Entered, Instruction, Left, Mark};

    const CORE: u32 = 0x200;

    fn listing() -> Listing {
        Listing {
            steps: HashMap::from([
                (0x104, Step::Call(0x108)),
                (0x10a, Step::Lock),
                (0x110, Step::Unlock),
                (0x204, Step::Call(0x208)),
            ]),
            functions: HashMap::from([(CORE, "core".to_owned())]),
            slow_bus: 0x6000_0000..0x7000_0000,
            profiled: Some(70),
        }
    }

    fn counted(events: impl IntoIterator<Item = TraceEvent>) -> Activations {
        let mut activations = Activations::new(listing());
        activations.take(Mark);
        events.into_iter().for_each(|event| activations.take(event));
        activations
    }

    fn run(addresses: impl IntoIterator<Item = u32>) -> Vec<TraceEvent> {
        addresses.into_iter().map(Instruction).collect()
    }

    fn once(value: u64) -> Spread {
        Spread { count: 1, least: value, most: value, sum: value }
    }

    #[test]
    fn what_interrupts_a_task_is_not_its_own() {
        let count = counted(
            [
                vec![Entered(70)],
                run([0x100, 0x102]),
                vec![Entered(34)],
                run([0x300, 0x302]),
                vec![Entered(35), Instruction(0x600), Left(35)],
                run([0x304]),
                vec![Left(34)],
                run([0x106]),
                vec![Left(70)],
            ]
            .concat(),
        );
        assert_eq!((count.tasks()[&70].own, count.tasks()[&70].with_preemption), (once(3), once(7)));
        assert_eq!((count.tasks()[&34].own, count.tasks()[&34].with_preemption), (once(3), once(4)));
        assert_eq!(count.executed(), 7);
    }

    #[test]
    fn two_activations_one_behind_the_other_are_two() {
        let count = counted(
            [vec![Entered(70)], run([0x100]), vec![Left(70), Entered(70)], run([0x100, 0x102]), vec![Left(70)]]
                .concat(),
        );
        assert_eq!(count.tasks()[&70].own, Spread { count: 2, least: 1, most: 2, sum: 3 });
        assert_eq!(count.tasks()[&70].own.mean(), 2);
    }

    #[test]
    fn a_function_counts_with_what_it_calls_and_without_what_interrupts_it() {
        let count = counted(
            [
                vec![Entered(70)],
                run([0x100, 0x104, CORE, 0x204, 0x400, 0x402]),
                vec![Entered(34)],
                run([0x300]),
                vec![Left(34)],
                run([0x208, 0x20a, 0x108, 0x106]),
                vec![Left(70)],
            ]
            .concat(),
        );
        // 200, 204, the callee's 400 and 402, 208, 20a.
        assert_eq!(count.functions()["core"], once(6));
    }

    #[test]
    fn the_profile_has_every_instruction_of_its_task_below_the_calls_that_led_there() {
        let count = counted(
            [
                vec![Entered(70)],
                run([0x100, 0x104, CORE, 0x202]),
                vec![Entered(34), Instruction(0x202), Left(34)],
                run([0x202, 0x108]),
                vec![Left(70), Entered(70)],
                run([0x100]),
                vec![Left(70)],
            ]
            .concat(),
        );
        let expected = Profile::from([
            (vec![], HashMap::from([(0x100, 2), (0x104, 1), (0x108, 1)])),
            (vec![0x108], HashMap::from([(CORE, 1), (0x202, 2)])),
        ]);
        assert_eq!(count.profile(), &expected);
    }

    #[test]
    fn a_function_that_ends_with_a_jump_returns_where_its_caller_was_called() {
        // 104 calls 500, which jumps to CORE, which returns to 108.
        let count = counted([vec![Entered(70)], run([0x104, 0x500, CORE, 0x202, 0x108]), vec![Left(70)]].concat());
        assert_eq!(count.functions()["core"], once(2));
    }

    #[test]
    fn a_function_that_a_handler_jumps_to_ends_with_the_handler_and_a_loop_does_not_begin_it_anew() {
        let count = counted([vec![Entered(70)], run([0x100, CORE, 0x202, CORE, 0x202]), vec![Left(70)]].concat());
        assert_eq!(count.functions()["core"], once(4));
    }

    #[test]
    fn nested_critical_sections_are_one_and_the_last_restore_of_a_task_is_none() {
        let count = counted(
            [vec![Entered(70)], run([0x100, 0x10a, 0x10a, 0x10c, 0x110, 0x110, 0x110]), vec![Left(70)]].concat(),
        );
        // From behind the first lock: lock, 10c, unlock, unlock.
        assert_eq!(count.tasks()[&70].locked, once(4));
    }

    #[test]
    fn what_ran_at_one_mark_is_forgotten_at_the_next() {
        let count =
            counted([vec![Entered(70)], run([0x100]), vec![Mark, Mark], run([0x102]), vec![Left(70), Mark]].concat());
        assert!(count.tasks().is_empty(), "{:?}", count.tasks());
    }

    #[test]
    fn a_critical_section_of_the_thread_is_known_after_the_second_mark() {
        let count = counted([run([0x10a, 0x10c, 0x110]), vec![Mark]].concat());
        assert_eq!(count.thread().locked, once(2));
    }

    #[test]
    fn only_accesses_to_the_slow_bus_are_counted() {
        let shim = [Entered(3), Left(3)];
        let count = counted(
            [
                vec![Entered(70), Instruction(0x100), Access(0x6000_0012)],
                shim.to_vec(),
                vec![Instruction(0x102), Access(0x4000_1010)],
                shim.to_vec(),
                vec![Left(70)],
            ]
            .concat(),
        );
        assert_eq!((count.tasks()[&70].bus, count.tasks()[&70].own), (once(1), once(2)));
        assert!(!count.tasks().contains_key(&3));
    }

    #[test]
    fn only_activations_that_lie_wholly_between_the_marks_count() {
        let count = counted(
            [
                // Began before the mark.
                run([0x100]),
                vec![Entered(34)],
                run([0x300]),
                vec![Left(34)],
                run([0x102]),
                vec![Left(70), Entered(70)],
                run([0x100]),
                vec![Left(70), Entered(70)],
                run([0x100]),
                vec![Mark],
                run([0x102]),
                vec![Left(70)],
            ]
            .concat(),
        );
        assert_eq!((count.tasks()[&70].own, count.tasks()[&34].own), (once(1), once(1)));
        assert_eq!(count.executed(), 5);
    }
}
