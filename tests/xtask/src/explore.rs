//! Random lives of random axes: workers on all cores, what they found, and what they never reached.

mod duration;
mod worker;

use crate::report::numbers::thousands;
use crate::{Verdict, process, workspace};
use anyhow::{Context, Result, bail};
use explorer::Coverage;
use explorer::work::Found;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::collections::BTreeMap;
use std::io::IsTerminal;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};
use std::thread;
use std::time::{Duration, Instant};

pub(crate) use duration::duration;

/// Lives of one worker process: every life keeps 40 kB for ever.
const LIVES_OF_A_WORKER: u64 = 250;

/// What is to be explored.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Order {
    pub(crate) seed: u64,
    pub(crate) until: Until,
    pub(crate) jobs: Option<u16>,
}

/// When it is enough.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Until {
    /// After so long.
    Time(Duration),
    /// After so many lives.
    Lives(u64),
}

/// One life, told.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum One {
    /// Of this seed.
    Seed(u64),
    /// Of this seed, shrunk first.
    Shrunk(u64),
    /// Out of a file.
    File(PathBuf),
}

/// What workers have brought so far.
#[derive(Debug, Default)]
pub(super) struct Harvest {
    done: u64,
    /// The first life of each law, shrunk if there was time, and how often the law broke.
    broken: BTreeMap<String, (Found, u64)>,
    coverage: Coverage,
}

/// Explores, and prints what was found.
pub(crate) fn run(order: &Order) -> Result<Verdict> {
    let worker = build()?;
    let jobs = order.jobs.map_or_else(|| thread::available_parallelism().map_or(1, usize::from), usize::from);
    let begin = Instant::now();
    let bar = bar(order.until);
    let next = AtomicU64::new(0);
    let harvest = Mutex::new(Harvest::default());
    let failures: Vec<anyhow::Error> = thread::scope(|scope| {
        let workers: Vec<_> =
            (0..jobs).map(|_| scope.spawn(|| keep_working(&worker, order, begin, &next, &harvest, &bar))).collect();
        let joined = workers.into_iter().map(|worker| worker.join());
        joined.filter_map(|result| result.unwrap_or_else(|_| Err(anyhow::anyhow!("a thread panicked"))).err()).collect()
    });
    bar.finish_and_clear();
    if let Some(failure) = failures.into_iter().next() {
        return Err(failure);
    }
    let harvest = harvest.into_inner().map_err(|_| anyhow::anyhow!("a thread panicked"))?;
    tell(order, &harvest, begin.elapsed())
}

/// Lives one life again and prints it.
pub(crate) fn replay(one: &One) -> Result<Verdict> {
    let mut command = std::process::Command::new(build()?);
    match one {
        One::Seed(seed) => command.args(["life", &seed.to_string()]),
        One::Shrunk(seed) => command.args(["shrink", &seed.to_string()]),
        One::File(path) => {
            std::fs::metadata(path).with_context(|| format!("cannot read {}", path.display()))?;
            command.arg("replay").arg(path)
        }
    };
    let status = command.status().with_context(|| format!("cannot start {}", process::words(&command)))?;
    match status.code() {
        Some(0) => Ok(Verdict::Passed),
        Some(1) => Ok(Verdict::Failed),
        _ => bail!("the life could not be lived; the line above says why"),
    }
}

/// The worker, compiled as the tests are: optimised, and with every check of overflow. Nothing is compiled for it alone.
fn build() -> Result<PathBuf> {
    workspace::build_like_tests("explorer", &["--bin", "explorer"], "explorer")
}

fn keep_working(
    program: &Path,
    order: &Order,
    begin: Instant,
    next: &AtomicU64,
    harvest: &Mutex<Harvest>,
    bar: &ProgressBar,
) -> Result<()> {
    loop {
        let from = next.fetch_add(LIVES_OF_A_WORKER, Ordering::Relaxed);
        let count = match order.until {
            Until::Lives(lives) => lives.saturating_sub(from).min(LIVES_OF_A_WORKER),
            Until::Time(span) if begin.elapsed() < span => LIVES_OF_A_WORKER,
            Until::Time(_) => 0,
        };
        if count == 0 {
            return Ok(());
        }
        worker::lives(program, order.seed, from, count, harvest, |done| match order.until {
            Until::Lives(lives) => bar.set_position(done.min(lives)),
            Until::Time(_) => {
                bar.set_position(begin.elapsed().as_secs());
                bar.set_message(format!("{} lives", thousands(done)));
            }
        })?;
    }
}

fn bar(until: Until) -> ProgressBar {
    let terminal = std::io::stderr().is_terminal();
    let target = if terminal { ProgressDrawTarget::stderr() } else { ProgressDrawTarget::hidden() };
    let length = match until {
        Until::Time(span) => span.as_secs(),
        Until::Lives(lives) => lives,
    };
    let bar = ProgressBar::with_draw_target(Some(length), target);
    if let Ok(style) = ProgressStyle::with_template("  explore {bar:32.cyan/blue} {percent:>3} %  {eta} to go  {msg}") {
        bar.set_style(style.progress_chars("━╸─"));
    }
    bar
}

fn tell(order: &Order, harvest: &Harvest, span: Duration) -> Result<Verdict> {
    println!("{}", harvest.coverage.report());
    let seconds = span.as_secs_f64().max(0.001);
    let speed = harvest.coverage.lives as f64 / seconds;
    let lives = thousands(harvest.coverage.lives);
    println!("{lives} lives of seed {} in {seconds:.0} s, {speed:.1} a second", order.seed);
    if harvest.broken.is_empty() {
        println!("no law is broken");
        return Ok(Verdict::Passed);
    }
    for (law, (found, number)) in &harvest.broken {
        let file = format!("explorer/{:016x}.json", found.life.seed);
        let path = workspace::target_folder()?.join(&file);
        workspace::write_whole(&path, &serde_json::to_string_pretty(&found.life)?)?;
        println!("\nBROKEN by {} of them: {law}\n  {}\n  {}", thousands(*number), found.life, found.detail);
        println!("  cargo xtask explore --life {:#018x}", found.life.seed);
        println!("  cargo xtask explore --replay {}", path.display());
    }
    Ok(Verdict::Failed)
}
