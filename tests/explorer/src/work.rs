//! What a worker process does for the explorer, and what it says: a line of JSON for each life that broke a law, and one at the end.
//!
//! Lives run in processes of their own, because every simulated drive keeps its memory for ever, as on the target.

use std::collections::BTreeMap;
use std::io::Write;

use serde::{Deserialize, Serialize};

use crate::coverage::Coverage;
use crate::dice::seed_of_life;
use crate::generate::life_of;
use crate::life::Life;
use crate::run::{Ending, Outcome, live};
use crate::shrink::shrink;

/// Trials that shrinking may take.
pub const TRIALS: u32 = 400;

/// A line of a worker.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Line {
    /// So many lives more are done.
    Done(u64),
    /// A life has broken a law.
    Broken(Box<Found>),
    /// The worker has ended; what its lives have covered.
    Covered(Coverage),
}

/// A life that has broken a law.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Found {
    /// The law's sentence.
    pub law: String,
    /// What was seen.
    pub detail: String,
    /// The life, shrunk if this was the worker's first of that law.
    pub life: Life,
    /// Whether it is shrunk.
    pub shrunk: bool,
}

/// Lives so many lives of a run, from the `from`-th on. Of each law that breaks the first life is shrunk, unless it is among `known`.
///
/// # Errors
/// Nobody reads the lines any more.
pub fn lives(run: u64, from: u64, count: u64, known: &[String], out: &mut dyn Write) -> std::io::Result<()> {
    let mut coverage = Coverage::default();
    let mut shrunk: BTreeMap<String, ()> = known.iter().map(|law| (law.clone(), ())).collect();
    for index in from..from + count {
        let life = life_of(seed_of_life(run, index));
        let outcome = live(&life);
        coverage.merge(&outcome.coverage);
        if let Ending::Broken { law, detail } = outcome.ending {
            let first = shrunk.insert(law.clone(), ()).is_none();
            let life = if first { shrink(&life, TRIALS) } else { life };
            let detail = match (first, live_again(first, &life)) {
                (true, Some(shorter)) => shorter,
                _ => detail,
            };
            say(out, &Line::Broken(Box::new(Found { law, detail, life, shrunk: first })))?;
        }
        if (index + 1 - from).is_multiple_of(10) || index + 1 == from + count {
            let done = if (index + 1 - from).is_multiple_of(10) { 10 } else { count % 10 };
            say(out, &Line::Done(done))?;
        }
    }
    say(out, &Line::Covered(coverage))
}

fn live_again(first: bool, life: &Life) -> Option<String> {
    match first.then(|| live(life).ending)? {
        Ending::Broken { detail, .. } => Some(detail),
        Ending::Lived | Ending::Refused(_) => None,
    }
}

/// The outcome of a life in words.
#[must_use]
pub fn told(life: &Life, outcome: &Outcome) -> String {
    let end = match &outcome.ending {
        Ending::Lived => "no law is broken".to_owned(),
        Ending::Refused(reason) => format!("the axis is refused: {reason}"),
        Ending::Broken { law, detail } => format!("BROKEN: {law}\n  {detail}"),
    };
    let errors =
        outcome.coverage.seen.get("error met").into_iter().flat_map(|errors| errors.keys().map(String::as_str));
    let errors = errors.collect::<Vec<_>>().join(" ");
    let errors = if errors.is_empty() { String::new() } else { format!("errors met: {errors}\n") };
    format!("{life}\n{errors}{end}\n(trace {:016x})", outcome.hash)
}

fn say(out: &mut dyn Write, line: &Line) -> std::io::Result<()> {
    let text = serde_json::to_string(line)?;
    writeln!(out, "{text}")?;
    out.flush()
}
