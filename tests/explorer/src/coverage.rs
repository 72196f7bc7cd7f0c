//! What lives have seen, added up: so that what was never reached can be told.

use std::collections::BTreeMap;

use drive::DICTIONARY;
use sercos::Phase;
use sercos::data_block::Location;
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
        let state =
            State { phase, ready: (status >> 14) as u8, error: status & 1 << 13 != 0, follows: status & 1 << 3 != 0 };
        if let Some(last) = self.last.replace(state)
            && last != state
        {
            *self.transitions.entry((last, state)).or_default() += 1;
        }
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

    /// There is something of this name under a heading.
    #[must_use]
    pub fn has(&self, heading: &str, name: &str) -> bool {
        self.seen.get(heading).is_some_and(|names| names.contains_key(name))
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

/// Headings whose names are few enough to be printed one by one.
const PRINTED: [&str; 12] = [
    "ending",
    "broken law",
    "law looked",
    "peace",
    "action",
    "mode followed",
    "command started",
    "fault",
    "error met",
    "refused axis",
    "run-up refused in a life",
    "transition",
];

impl Coverage {
    /// Everything in words, with what was never reached at the end.
    #[must_use]
    pub fn report(&self) -> String {
        let mut text = String::new();
        for heading in PRINTED {
            let Some(names) = self.seen.get(heading) else { continue };
            text += &format!("{heading}:\n");
            for (name, number) in names {
                text += &format!("  {number:>9}  {name}\n");
            }
        }
        for heading in ["write accepted", "write refused", "command refused"] {
            let names = self.seen.get(heading);
            let number: u64 = names.iter().flat_map(|names| names.values()).sum();
            let blocks: std::collections::BTreeSet<&str> =
                names.iter().flat_map(|names| names.keys()).filter_map(|name| name.split(' ').next()).collect();
            text += &format!("{heading}: {number}, of {} data blocks\n", blocks.len());
        }
        text += "never reached:\n";
        for missing in self.never() {
            text += &format!("  {missing}\n");
        }
        text += &format!("{} s of simulated time", self.milliseconds / 1_000);
        text
    }

    /// What no life has reached.
    fn never(&self) -> Vec<String> {
        let names = |heading: &str| self.seen.get(heading).map(|names| names.keys().cloned().collect::<Vec<_>>());
        let has = |heading: &str, begin: &str| {
            names(heading).unwrap_or_default().iter().any(|name| name.split(' ').next() == Some(begin))
        };
        let mut never = Vec::new();
        for block in DICTIONARY.blocks() {
            let name = ring::ident::Idn(block.idn.0).to_string();
            let is_command = matches!(block.location, Location::Command);
            if block.attribute.is_read_only() {
                continue;
            }
            if is_command {
                if !has("command started", &name) {
                    never.push(format!("{name} started"));
                }
            } else if !has("write accepted", &name) && !has("set up", &name) && !has("write refused", &name) {
                never.push(format!("{name} written"));
            } else if !block.attribute.is_protected_in(Phase::Cp4)
                && block.fixed_bytes().is_some()
                && !has("write accepted", &name)
            {
                never.push(format!("{name} written in CP4 and accepted"));
            }
        }
        for (law, looked) in self.seen.get("law looked").into_iter().flatten() {
            if *looked == 0 {
                never.push(format!("law with something to look at: {law}"));
            }
        }
        for mode in ["1", "2", "3", "11", "19", "27", "531", "539"] {
            if !has("mode followed", mode) {
                never.push(format!("operation mode {mode} followed"));
            }
        }
        for fault in crate::generate::FAULTS.iter().chain(&crate::generate::BRAKE_FAULTS) {
            for torque in ["with torque", "without torque"] {
                let wanted = format!("{fault:?} {torque}");
                if !names("fault").unwrap_or_default().contains(&wanted) {
                    never.push(format!("{fault} {torque}"));
                }
            }
        }
        for diagnosis in drive::DIAGNOSES.iter().filter(|diagnosis| diagnosis.number & 0xF000 == 0xF000) {
            if !has("error met", &format!("{:04X}H", diagnosis.number)) {
                never.push(format!("error {:04X}H, {}", diagnosis.number, diagnosis.text));
            }
        }
        never
    }
}
