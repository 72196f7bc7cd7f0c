//! One shared resource for two who never work at the same time.

use core::cell::RefCell;

use rtic::Mutex;

/// Locks a resource that somebody else of the same task locks, too: none of them holds it while the other runs.
pub(crate) struct ByTurns<'a, M>(pub(crate) &'a RefCell<M>);

impl<M: Mutex> Mutex for ByTurns<'_, M> {
    type T = M::T;

    fn lock<R>(&mut self, act: impl FnOnce(&mut Self::T) -> R) -> R {
        self.0.borrow_mut().lock(act)
    }
}
