//! The drive's oscilloscope: a velocity step on the simulated ring, recorded in the drive and read over the service channel.

mod channel;
mod recorder;
mod ring_channel;
mod signal;

#[cfg(test)]
pub(crate) use recorder::Channel;
pub(crate) use recorder::{Edge, Recording, Settings};
pub(crate) use signal::Signal;

use crate::progress::PhaseBars;
use crate::report::scope as report;
use crate::{Verdict, workspace};
use anyhow::{Result, bail, ensure};
use channel::{ChannelError, ServiceChannel};
use recorder::RecordError;
use ring_channel::RingChannel;
use std::path::{Path, PathBuf};

/// Increments of S-0-0036 and S-0-0037 in 1 rpm.
const PER_RPM: f64 = 10_000.0;

/// Additive velocity command value: the step is made with it, because the telegram does not carry it.
const ADDITIVE_VELOCITY_COMMAND: u16 = 37;

/// What the command line asks for.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Order {
    pub(crate) settings: Settings,
    /// The step of the velocity command.
    pub(crate) rpm: f64,
    /// Folder of the page; `None`: `scope` in Cargo's target folder.
    pub(crate) output: Option<PathBuf>,
    pub(crate) csv: Option<PathBuf>,
}

/// Runs a drive up, records, prints what was recorded, and writes page and table.
pub(crate) fn run(order: &Order) -> Result<Verdict> {
    check(order)?;
    let folder = order.output.clone().map_or_else(|| workspace::target_folder().map(|it| it.join("scope")), Ok)?;
    let mut bars = PhaseBars::new();
    let recorded =
        RingChannel::run_up(&mut |progress| bars.show(progress)).map_err(RecordError::from).and_then(|mut channel| {
            let step = |channel: &mut RingChannel| step(channel, order.rpm);
            let clock = channel.clock();
            recorder::record(&mut channel, &order.settings, step, &mut |what, done, of| {
                bars.show(&ring_channel::progress(clock.get(), what, done, of));
            })
        });
    bars.finish();
    match recorded {
        Ok(recording) => conclude(&recording, order.csv.as_deref(), &folder),
        // The run was possible and came to nothing: that is a result.
        Err(failure) => {
            eprintln!("failed: {failure}");
            Ok(Verdict::Failed)
        }
    }
}

/// What the drive would refuse anyway, in the words of the command line and before anything runs.
fn check(order: &Order) -> Result<()> {
    let settings = &order.settings;
    let channels = settings.signals.len();
    ensure!((1..=4).contains(&channels), "{channels} signals, expected 1 to 4; give --signal up to four times");
    let trigger = settings.trigger_channel;
    if !(1..=channels).contains(&trigger) {
        bail!("--trigger-channel {trigger}, but there are {channels} signals; channels are counted from 1");
    }
    ensure!(settings.level.is_finite(), "--level {} is no number", settings.level);
    ensure!(order.rpm.abs() <= 10_000.0, "--rpm {}, expected -10000 to 10000", order.rpm);
    Ok(())
}

/// A step of the velocity command.
fn step(channel: &mut impl ServiceChannel, rpm: f64) -> Result<(), ChannelError> {
    // Checked to be within 10 000 rpm.
    let command = (rpm * PER_RPM).round() as i32;
    channel.write(ADDITIVE_VELOCITY_COMMAND, command.cast_unsigned().into())
}

/// Prints, and writes the files.
fn conclude(recording: &Recording, csv: Option<&Path>, folder: &Path) -> Result<Verdict> {
    print!("{}", report::text(recording));
    let page = folder.join("index.html");
    workspace::write_whole(&page, &report::html(recording))?;
    println!("plot: {}", page.display());
    if let Some(csv) = csv {
        workspace::write_beside(csv, &report::csv(recording))?;
        println!("table: {}", csv.display());
    }
    Ok(Verdict::Passed)
}

#[cfg(test)]
mod fake_drive;
#[cfg(test)]
mod tests;
