//! Something that counts only if it lasts.

use ring::Nanoseconds;

/// Since when something is so.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Lasting(Option<Nanoseconds>);

impl Lasting {
    /// Whether it is so, and has been for longer than `span`.
    pub(crate) fn lasts(&mut self, is_so: bool, now: Nanoseconds, span: Nanoseconds) -> bool {
        if !is_so {
            self.0 = None;
            return false;
        }
        now.saturating_sub(*self.0.get_or_insert(now)) > span
    }

    /// It is not so, or can not be seen.
    pub(crate) fn end(&mut self) {
        self.0 = None;
    }
}
