//! How many instructions a task takes each time it runs: counted from the stream of what the processor did.
//!
//! Every exception has a context of its own, so that what interrupts a task is not counted as the task's. Functions are followed inside a
//! context by the returns of the calls that lead to them; what they call counts as theirs.

use std::collections::{BTreeMap, HashMap};
use std::ops::Range;

use crate::demand::{Demand, Price, Worst};
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
    /// What both cost.
    pub price: Price,
    /// The exception with which a communication cycle begins: one that comes once in each.
    pub cycle: Option<u16>,
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
    /// The longest activation, critical section and cycle.
    pub worst: Worst,
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
    /// The communication cycle in which it began.
    cycle: u64,
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
            Some(Step::Unlock) => self.unlock(listing.price),
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
    fn unlock(&mut self, price: Price) {
        if self.locks == 1 {
            let (instructions, bus) = (self.own - self.locked_from.0, self.bus - self.locked_from.1);
            self.task.locked.add(instructions);
            self.task.bus_locked.add(bus);
            self.task.worst.add_lock(Demand { activations: 0, instructions, bus }, price);
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
    /// Communication cycles that have begun since the mark.
    cycles: u64,
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
            cycles: 0,
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
        let task = self.tasks.entry(exception).or_default();
        task.own.add(ended.own);
        task.with_preemption.add(whole);
        task.bus.add(ended.bus);
        let activation = Demand { activations: 1, instructions: ended.own, bus: ended.bus };
        task.worst.add(activation, ended.cycle, self.listing.price);
        task.worst.add_lock(ended.task.worst.lock, self.listing.price);
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
            TraceEvent::Entered(exception) => {
                self.cycles += u64::from(self.listing.cycle == Some(exception));
                self.contexts.push(Context { exception, cycle: self.cycles, ..Context::default() });
            }
            TraceEvent::Left(exception) => self.leave(exception),
        }
    }
}

#[cfg(test)]
mod tests;
