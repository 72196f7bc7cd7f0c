//! All cells, on all cores.

use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc;
use std::thread;

use bench::Executor;

use crate::{Cell, MatrixError, Outcome, run};

/// Runs cells, each in a simulation of its own, in as many threads as the computer has cores. The outcomes have the order of the cells.
///
/// # Errors
/// The first cell, in their order, that could not be run.
pub fn run_all(cells: &[Cell], executor: &Executor) -> Result<Vec<Outcome>, MatrixError> {
    let threads = thread::available_parallelism().map_or(1, usize::from);
    let next = AtomicUsize::new(0);
    let (sender, receiver) = mpsc::channel();
    thread::scope(|scope| {
        for _ in 0..threads {
            let (sender, next) = (sender.clone(), &next);
            scope.spawn(move || {
                loop {
                    let index = next.fetch_add(1, Ordering::Relaxed);
                    let Some(&cell) = cells.get(index) else { break };
                    // Nobody listens any more only when the receiver has been dropped, and it is not before the scope ends.
                    let _ = sender.send((index, run(cell, executor)));
                }
            });
        }
        drop(sender);
    });
    let mut outcomes: Vec<_> = receiver.into_iter().collect();
    outcomes.sort_by_key(|(index, _)| *index);
    outcomes.into_iter().map(|(_, outcome)| outcome).collect()
}
