//! What a law is.

use crate::dialogue::Heard;
use crate::scene::Scene;

/// What has just happened.
#[derive(Clone, Debug)]
pub(crate) enum Event<'a> {
    /// Time has passed: there is something new to see.
    Look,
    /// An MST has reached the drive.
    Mst,
    /// The drive's record of an MDT has reached it.
    Record,
    /// The drive begins to send its AT.
    Answer,
    /// The service channel has brought something to its end.
    Service(&'a Heard),
}

/// What a law says to it.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Verdict {
    /// It had nothing to look at, or does not know enough.
    Silent,
    /// It has looked, and it is kept.
    Kept,
    /// It is broken: what was expected and what was seen.
    Broken(String),
}

/// One law. It is asked at every event, in the order of time.
pub(crate) trait Law {
    /// The law, as a sentence that goes on after "the law that".
    fn sentence(&self) -> &'static str;

    /// Looks at what has happened.
    fn judge(&mut self, event: &Event<'_>, scene: &Scene) -> Verdict;
}

/// How often a law has looked at something that could have broken it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Coverage {
    /// The law.
    pub law: &'static str,
    /// How often it was asked and had something to look at.
    pub armed: u64,
}

impl Verdict {
    /// Kept when it is, and otherwise broken with these words.
    pub(crate) fn of(kept: bool, words: impl FnOnce() -> String) -> Self {
        if kept { Self::Kept } else { Self::Broken(words()) }
    }
}
