//! One CPU for a test and its QEMUs.
//!
//! They never run at the same time: each waits for the other. Waking a thread on another CPU takes 32 us here, on the same one 6 us, so they
//! share one. Each test takes a CPU that no other has taken, as far as there are any.

use std::cell::RefCell;
use std::fs::File;
use std::rc::{Rc, Weak};

use rustix::thread::{CpuSet, sched_getaffinity, sched_getcpu, sched_setaffinity};

/// While this lives, the thread that took it and what it starts run on one CPU.
///
/// Where the system does not allow it, everything runs as before, only slower.
#[derive(Debug)]
pub(crate) struct OneCpu {
    before: Option<CpuSet>,
    /// Locked: the mark by which other processes know that the CPU is taken.
    _taken: Option<File>,
}

thread_local! {
    static OF_THIS_THREAD: RefCell<Weak<OneCpu>> = const { RefCell::new(Weak::new()) };
}

impl OneCpu {
    /// One for this thread: the guests of a ring share it.
    pub(crate) fn of_this_thread() -> Rc<Self> {
        OF_THIS_THREAD.with_borrow_mut(|shared| {
            shared.upgrade().unwrap_or_else(|| {
                let taken = Rc::new(Self::take());
                *shared = Rc::downgrade(&taken);
                taken
            })
        })
    }

    fn take() -> Self {
        let Some(allowed) = sched_getaffinity(None).ok().filter(|allowed| allowed.count() > 1) else {
            return Self { before: None, _taken: None };
        };
        let cpus = (0..CpuSet::MAX_CPU).filter(|cpu| allowed.is_set(*cpu));
        let (cpu, taken) = cpus
            .filter_map(|cpu| Some((cpu, Some(mark(cpu)?))))
            .next()
            // More tests than CPUs: where this one runs now.
            .unwrap_or((sched_getcpu(), None));
        let mut one = CpuSet::new();
        one.set(cpu);
        let before = sched_setaffinity(None, &one).is_ok().then_some(allowed);
        Self { before, _taken: taken }
    }
}

impl Drop for OneCpu {
    fn drop(&mut self) {
        if let Some(before) = &self.before {
            // A thread that cannot be let go again only stays where it is.
            let _ = sched_setaffinity(None, before);
        }
    }
}

/// The locked mark of a CPU, if nobody else has it. The lock goes with the process, however that ends.
fn mark(cpu: usize) -> Option<File> {
    let path = std::env::temp_dir().join(format!("emulator-cpu-{cpu}"));
    let file = File::options().create(true).truncate(false).write(true).open(path).ok()?;
    file.try_lock().ok()?;
    Some(file)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn allowed() -> u32 {
        sched_getaffinity(None).unwrap().count()
    }

    #[test]
    fn while_one_is_held_the_thread_runs_on_a_single_cpu_and_afterwards_where_it_may() {
        let before = allowed();
        let first = OneCpu::of_this_thread();
        let second = OneCpu::of_this_thread();
        assert!(Rc::ptr_eq(&first, &second));
        assert_eq!(allowed(), 1);
        drop(first);
        assert_eq!(allowed(), 1);
        drop(second);
        assert_eq!(allowed(), before);
    }

    #[test]
    fn two_threads_take_different_cpus_as_far_as_there_are_any() {
        let cpu = |held: &OneCpu| (held._taken.is_some(), sched_getcpu());
        let first = OneCpu::of_this_thread();
        let second = std::thread::spawn(move || cpu(&OneCpu::of_this_thread())).join().unwrap();
        assert!(!second.0 || second.1 != cpu(&first).1);
    }
}
