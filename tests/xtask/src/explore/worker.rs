//! One worker process, and its lines.

use super::Harvest;
use anyhow::{Context, Result, bail};
use explorer::work::Line;
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Command, Stdio};
use std::sync::Mutex;

/// Lets a worker live so many lives; `progress` is told of all that are done.
pub(super) fn lives(
    program: &Path,
    run: u64,
    from: u64,
    count: u64,
    harvest: &Mutex<Harvest>,
    progress: impl Fn(u64),
) -> Result<()> {
    let mut command = Command::new(program);
    command.args(["lives", &run.to_string(), &from.to_string(), &count.to_string()]);
    command.args(locked(harvest)?.broken.keys());
    let mut child = command
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .spawn()
        .with_context(|| format!("cannot start {}", program.display()))?;
    let stdout = child.stdout.take().context("a worker's output cannot be read")?;
    let mut covered = false;
    for line in BufReader::new(stdout).lines() {
        let line = line.context("a worker's output cannot be read")?;
        let line: Line = serde_json::from_str(&line).context("a worker says what nobody understands")?;
        let mut harvest = locked(harvest)?;
        covered |= harvest.take(line);
        progress(harvest.done);
    }
    let status = child.wait().context("a worker does not end")?;
    if !status.success() || !covered {
        bail!("a worker with the lives from {from} on ended with {status} before its time");
    }
    Ok(())
}

fn locked(harvest: &Mutex<Harvest>) -> Result<std::sync::MutexGuard<'_, Harvest>> {
    harvest.lock().map_err(|_| anyhow::anyhow!("a thread panicked"))
}

impl Harvest {
    /// Takes a line; true for the last.
    fn take(&mut self, line: Line) -> bool {
        match line {
            Line::Done(lives) => self.done += lives,
            Line::Broken(found) => {
                let kept = self.broken.entry(found.law.clone()).or_insert_with(|| ((*found).clone(), 0));
                kept.1 += 1;
                let shorter = found.life.events.len() < kept.0.life.events.len();
                if found.shrunk && (!kept.0.shrunk || shorter) {
                    kept.0 = *found;
                }
            }
            Line::Covered(coverage) => {
                self.coverage.merge(&coverage);
                return true;
            }
        }
        false
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use explorer::work::Found;
    use explorer::{Coverage, life_of};

    fn found(events: usize, shrunk: bool) -> Line {
        let mut life = life_of(1);
        life.events.truncate(events);
        Line::Broken(Box::new(Found { law: "a law".to_owned(), detail: String::new(), life, shrunk }))
    }

    #[test]
    fn of_each_law_the_shortest_shrunk_life_is_kept_and_all_are_counted() {
        let mut harvest = Harvest::default();
        for line in [found(5, false), found(4, true), found(2, true), found(1, false)] {
            assert!(!harvest.take(line));
        }
        let (kept, number) = &harvest.broken["a law"];
        assert_eq!((kept.life.events.len(), kept.shrunk, *number), (2, true, 4));
        assert!(harvest.take(Line::Covered(Coverage { lives: 7, ..Coverage::default() })));
        assert_eq!(harvest.coverage.lives, 7);
    }
}
