//! The dialogue with the drive's oscilloscope: settings, arming, motion, and window after window of its points.

use super::channel::{ChannelError, ServiceChannel};
use super::signal::Signal;
use clap::ValueEnum;
use drive::oscilloscope::{
    CONTROL, INTERVAL, LEVEL, POINTS, PRE_TRIGGER, SAMPLING, SIGNALS, STATE, TRIGGER, WINDOW, WINDOW_POINTS,
};

/// Points that a drive records in each channel.
pub(crate) const ALL_POINTS: u16 = 2_048;

// States of P-0-0200.
const ARMED: u64 = 1;
const TRIGGERED: u64 = 3;
const DONE: u64 = 4;

/// How often the state is asked for before it counts as stuck, once the time that it needs is over.
const POLLS: u32 = 20;

/// What the recording waits for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Edge {
    /// Nothing: record at once
    Immediate,
    /// The signal reaches the level from below
    Rising,
    /// The signal reaches the level from above
    Falling,
}

/// What is to be recorded.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Settings {
    /// One to four.
    pub(crate) signals: Vec<Signal>,
    /// Counted from 1.
    pub(crate) trigger_channel: usize,
    pub(crate) edge: Edge,
    /// In the unit of the trigger channel's signal.
    pub(crate) level: f64,
    /// Points.
    pub(crate) pre_trigger: u16,
    /// P-0-0208.
    pub(crate) sampling: u16,
    /// Points of each channel that are read.
    pub(crate) points: u16,
}

impl Settings {
    /// P-0-0205.
    fn trigger(&self) -> u16 {
        let edge = match self.edge {
            Edge::Immediate => 0,
            Edge::Rising => 1,
            Edge::Falling => 2,
        };
        // Checked to be 1 to 4.
        edge << 8 | (self.trigger_channel - 1) as u16
    }

    /// P-0-0206, where there is an edge to look for.
    fn level(&self) -> i32 {
        match (self.edge, self.signals.get(self.trigger_channel - 1)) {
            (Edge::Rising | Edge::Falling, Some(signal)) => signal.raw(self.level),
            _ => 0,
        }
    }
}

/// One channel that was read.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Channel {
    pub(crate) signal: Signal,
    pub(crate) points: Vec<i32>,
}

/// A recording that was read.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Recording {
    /// In 0.1 us.
    pub(crate) interval: u32,
    /// Index of the trigger.
    pub(crate) pre_trigger: u16,
    /// Index of the trigger channel and level in its increments, if an edge was waited for.
    pub(crate) trigger: Option<(usize, i32)>,
    /// All equally long.
    pub(crate) channels: Vec<Channel>,
}

impl Recording {
    /// Time of a point in 0.1 us, zero at the trigger.
    pub(crate) fn time(&self, index: usize) -> i64 {
        (index as i64 - i64::from(self.pre_trigger)) * i64::from(self.interval)
    }

    /// Points of each channel.
    pub(crate) fn len(&self) -> usize {
        self.channels.first().map_or(0, |channel| channel.points.len())
    }
}

/// Why there is no recording.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum RecordError {
    /// The service channel.
    Channel(ChannelError),
    /// P-0-0200 stayed what it was.
    Stuck { state: u64 },
    /// A list had another number of points than it should.
    Points { channel: usize, start: u16, expected: usize, actual: usize },
}

impl From<ChannelError> for RecordError {
    fn from(error: ChannelError) -> Self {
        Self::Channel(error)
    }
}

impl std::error::Error for RecordError {}

impl std::fmt::Display for RecordError {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Channel(error) => error.fmt(formatter),
            Self::Stuck { state: 2 } => formatter.write_str(
                "the trigger has not come; choose another --level, --edge or --trigger-channel, or --edge immediate",
            ),
            Self::Stuck { state } => write!(formatter, "the oscilloscope stays in state {state} of P-0-0200"),
            Self::Points { channel, start, expected, actual } => {
                write!(formatter, "channel {channel} gave {actual} points from {start} on, expected {expected}")
            }
        }
    }
}

/// Records: arms, waits for the pre-trigger, lets `motion` begin, waits for the end, and reads. `progress` is told what is done, how
/// far it is, and of how much (0: nobody knows).
pub(crate) fn record<C: ServiceChannel>(
    channel: &mut C,
    settings: &Settings,
    motion: impl FnOnce(&mut C) -> Result<(), ChannelError>,
    progress: &mut dyn FnMut(&str, u64, u64),
) -> Result<Recording, RecordError> {
    progress("set and arm the oscilloscope", 0, 0);
    arm(channel, settings)?;
    let interval = channel.read(INTERVAL.0)?;
    // At most 2 048 times 8.2 s in 0.1 us.
    let microseconds = |points: u16| u64::from(points) * interval / 10;
    progress("wait for the points before the trigger", 0, 0);
    channel.wait(microseconds(settings.pre_trigger))?;
    wait_for(channel, microseconds(ALL_POINTS), |state| state > ARMED)?;
    progress("move, and wait for the trigger", 0, 0);
    motion(channel)?;
    channel.wait(microseconds(ALL_POINTS - settings.pre_trigger))?;
    wait_for(channel, microseconds(ALL_POINTS), |state| state >= TRIGGERED)?;
    wait_for(channel, microseconds(ALL_POINTS), |state| state == DONE)?;
    let channels = read_points(channel, settings, progress)?;
    Ok(Recording {
        interval: u32::try_from(interval)
            .map_err(|_| ChannelError::Format { idn: INTERVAL.0, expected: "a number of four bytes" })?,
        pre_trigger: settings.pre_trigger,
        trigger: (settings.edge != Edge::Immediate).then(|| (settings.trigger_channel - 1, settings.level())),
        channels,
    })
}

fn arm(channel: &mut impl ServiceChannel, settings: &Settings) -> Result<(), ChannelError> {
    channel.write(CONTROL.0, 0)?;
    let numbers = settings.signals.iter().map(|signal| signal.number).chain(std::iter::repeat(0));
    for (idn, number) in SIGNALS.into_iter().zip(numbers) {
        channel.write(idn.0, number.into())?;
    }
    channel.write(TRIGGER.0, settings.trigger().into())?;
    channel.write(LEVEL.0, settings.level().cast_unsigned().into())?;
    channel.write(PRE_TRIGGER.0, settings.pre_trigger.into())?;
    channel.write(SAMPLING.0, settings.sampling.into())?;
    channel.write(CONTROL.0, 1)
}

fn wait_for(channel: &mut impl ServiceChannel, recording_us: u64, there: fn(u64) -> bool) -> Result<(), RecordError> {
    let mut state = channel.read(STATE.0)?;
    for _ in 0..POLLS {
        if there(state) {
            return Ok(());
        }
        channel.wait(recording_us / 10)?;
        state = channel.read(STATE.0)?;
    }
    if there(state) { Ok(()) } else { Err(RecordError::Stuck { state }) }
}

fn read_points(
    channel: &mut impl ServiceChannel,
    settings: &Settings,
    progress: &mut dyn FnMut(&str, u64, u64),
) -> Result<Vec<Channel>, RecordError> {
    let points = usize::from(settings.points);
    let mut channels: Vec<Channel> =
        settings.signals.iter().map(|signal| Channel { signal: signal.clone(), points: Vec::new() }).collect();
    for start in (0..settings.points).step_by(WINDOW_POINTS) {
        progress("read the points", start.into(), settings.points.into());
        channel.write(WINDOW.0, start.into())?;
        let expected = WINDOW_POINTS.min(usize::from(ALL_POINTS - start));
        for (number, (read, idn)) in channels.iter_mut().zip(POINTS).enumerate() {
            let list = channel.read_list(idn.0)?;
            if list.len() != expected {
                return Err(RecordError::Points { channel: number + 1, start, expected, actual: list.len() });
            }
            read.points.extend(list);
        }
    }
    channels.iter_mut().for_each(|channel| channel.points.truncate(points));
    progress("read the points", settings.points.into(), settings.points.into());
    Ok(channels)
}
