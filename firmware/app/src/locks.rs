//! Other ways to lock a shared resource.

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

/// Locks what a shared reference refers to.
pub(crate) struct Referred<M>(pub(crate) M);

impl<T: 'static, M: Mutex<T = &'static mut T>> Mutex for Referred<M> {
    type T = T;

    fn lock<R>(&mut self, act: impl FnOnce(&mut T) -> R) -> R {
        self.0.lock(|referred| act(referred))
    }
}
