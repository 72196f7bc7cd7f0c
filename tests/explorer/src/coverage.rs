//! What lives have seen, added up: so that what was never reached can be told.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

/// What the master saw in the status words of one life.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Wire {
    last: Option<State>,
    /// From one state to the next, and how often.
    pub(crate) transitions: BTreeMap<(State, State), u64>,
}

/// What a status word tells of the drive's state: phase, bits 15 and 14, bit 13, bit 3.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(crate) struct State {
    phase: u8,
    ready: u8,
    error: bool,
    follows: bool,
}

impl Wire {
    pub(crate) fn see(&mut self, phase: u8, status: u16) {
        let state = State {
            phase,
            ready: (status >> 14) as u8,
            error: status & 1 << 13 != 0,
            follows: status & 1 << 3 != 0,
        };
        if let Some(last) = self.last.replace(state)
            && last != state
        {
            *self.transitions.entry((last, state)).or_default() += 1;
        }
    }

    /// The ring went away under it.
    pub(crate) const fn begin_again(&mut self) {
        self.last = None;
    }
}

impl std::fmt::Display for State {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let ready = ["not ready", "logic ready", "power ready", "torque"][usize::from(self.ready & 3)];
        write!(formatter, "CP{} {ready}", self.phase)?;
        if self.follows {
            write!(formatter, " following")?;
        }
        if self.error {
            write!(formatter, " error")?;
        }
        Ok(())
    }
}

/// What many lives have covered; each with how often.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Coverage {
    /// Lives lived to their end.
    pub lives: u64,
    /// Milliseconds simulated.
    pub milliseconds: u64,
    /// Counts by heading and name.
    pub seen: BTreeMap<String, BTreeMap<String, u64>>,
}

impl Coverage {
    /// One more of a heading.
    pub fn count(&mut self, heading: &str, name: impl Into<String>) {
        self.add(heading, name, 1);
    }

    /// More of a heading.
    pub fn add(&mut self, heading: &str, name: impl Into<String>, number: u64) {
        if !self.seen.contains_key(heading) {
            self.seen.insert(heading.to_owned(), BTreeMap::new());
        }
        if let Some(names) = self.seen.get_mut(heading) {
            *names.entry(name.into()).or_default() += number;
        }
    }

    /// What two have seen.
    pub fn merge(&mut self, other: &Self) {
        self.lives += other.lives;
        self.milliseconds += other.milliseconds;
        for (heading, names) in &other.seen {
            for (name, number) in names {
                self.add(heading, name.clone(), *number);
            }
        }
    }

    pub(crate) fn add_wire(&mut self, wire: &Wire) {
        for ((from, to), number) in &wire.transitions {
            self.add("transition", format!("{from} -> {to}"), *number);
        }
    }
}
