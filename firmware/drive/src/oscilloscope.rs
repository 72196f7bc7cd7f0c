//! The oscilloscope over the service channel (P-0-0200 to P-0-0215): what the data blocks mean, and which signals there are.
//!
//! The settings are ordinary parameters. Arming (P-0-0209 = 1) makes a [`Configuration`] of them: every look-up is done there, and a
//! tick only follows four [`Signal`]s. Settings that change later count from the next arming on.
//!
//! The points stay where they were recorded. A list (P-0-0210 to P-0-0213) shows the [`WINDOW_POINTS`] of its channel that begin at
//! P-0-0214, because no list that the drive supplies is longer; a control moves the window and reads on.
//!
//! ```text
//! write P-0-0201 ... P-0-0208          signals, trigger, sampling
//! write P-0-0209 = 1                   arm
//! read  P-0-0200 until it is 4         done
//! for start in 0, 32, 64 ... 2 016:
//!     write P-0-0214 = start
//!     read  P-0-0210 ... P-0-0213      up to 32 points of each channel
//! ```

use core::fmt;

use sercos::Idn;
use sercos::attribute::{Attribute, Format, Length};
use sercos::capacity::LIVE_LONG_ENTRIES;
use sercos::error::ServiceError;
use servo::motor::CurrentLoopValues;
use servo::scope::{SCOPE_CHANNELS, Scope, ScopeEdge, ScopeSettings, ScopeSettingsError, ScopeTrigger};

use crate::signal::command::Command;
use crate::signal::feedback::Feedback;
use crate::signal::word::Source;

mod internal;

pub use internal::{INTERNAL_SIGNALS, Internal, InternalSignal, LoopValues};

/// P-0-0200: a [`servo::scope::ScopeState`] as a number.
pub const STATE: Idn = Idn::product(200);
/// P-0-0201 to P-0-0204: what each channel records, an IDN or the number of an [`Internal`] signal; 0: nothing.
pub const SIGNALS: [Idn; SCOPE_CHANNELS] = [Idn::product(201), Idn::product(202), Idn::product(203), Idn::product(204)];
/// P-0-0205: bits 1 and 0 the channel, 0 to 3; bits 9 and 8 the edge, 0 immediate, 1 rising, 2 falling.
pub const TRIGGER: Idn = Idn::product(205);
/// P-0-0206: in the weight of the trigger channel's signal.
pub const LEVEL: Idn = Idn::product(206);
/// P-0-0207: points before the trigger.
pub const PRE_TRIGGER: Idn = Idn::product(207);
/// P-0-0208: see [`Sampling`].
pub const SAMPLING: Idn = Idn::product(208);
/// P-0-0209: writing 1 arms, 0 stops; reads what was written last.
pub const CONTROL: Idn = Idn::product(209);
/// P-0-0210 to P-0-0213: the points of each channel from P-0-0214 on.
pub const POINTS: [Idn; SCOPE_CHANNELS] = [Idn::product(210), Idn::product(211), Idn::product(212), Idn::product(213)];
/// P-0-0214: the first point that the lists show.
pub const WINDOW: Idn = Idn::product(214);
/// P-0-0215: time between two points in 0.1 us.
pub const INTERVAL: Idn = Idn::product(215);

/// Points that a list shows at once.
pub const WINDOW_POINTS: usize = LIVE_LONG_ENTRIES;

/// A loop tick in 0.1 us, the unit of P-0-0215.
const LOOP_TICK: u32 = 1_250;

/// Which task samples, and how often (P-0-0208).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Sampling {
    /// 0: every current loop, 62.5 us.
    CurrentLoop,
    /// n = 1 ..= 65 535: every n-th tick of the position and velocity loops, n times 125 us.
    Loops {
        /// n.
        ticks: u16,
    },
}

impl Sampling {
    /// Of the value of P-0-0208.
    #[must_use]
    pub const fn from_parameter(value: u16) -> Self {
        match value {
            0 => Self::CurrentLoop,
            ticks => Self::Loops { ticks },
        }
    }

    const fn divider(self) -> u16 {
        match self {
            Self::CurrentLoop => 1,
            Self::Loops { ticks } => ticks,
        }
    }

    /// Time between two points in 0.1 us; `current_loop` is the period of the current loop in that unit (625 at 16 kHz).
    #[must_use]
    pub const fn interval(self, current_loop: u16) -> u32 {
        match self {
            Self::CurrentLoop => current_loop as u32,
            Self::Loops { ticks } => LOOP_TICK.wrapping_mul(ticks as u32),
        }
    }
}

/// Where a channel's value comes from, worked out when the recording is armed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Signal {
    /// Nowhere: it is 0.
    #[default]
    Off,
    /// A command value as it came last.
    Command(Command, Width),
    /// A feedback value of the last t4.
    Feedback(Feedback, Width),
    /// A word of bits, or one of them in bit 0.
    Bits(Source),
    /// A parameter, as it was when the recording was armed.
    Constant(i32),
    /// A signal that has no IDN.
    Internal(Internal),
}

/// Length and sign of a value as its data block is transmitted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Width {
    /// Two bytes that are extended by zeros.
    Word,
    /// Two bytes that are extended by their sign.
    SignedWord,
    /// Four bytes, which keep their bits: numbers without sign from 2^31 up turn negative.
    Long,
}

impl Width {
    /// That of a data block of two or four bytes.
    #[must_use]
    pub const fn of(attribute: Attribute) -> Self {
        match (attribute.length(), attribute.format()) {
            (Length::Two, Format::Signed) => Self::SignedWord,
            (Length::Two, _) => Self::Word,
            _ => Self::Long,
        }
    }

    pub(crate) const fn extend(self, raw: u32) -> i32 {
        match self {
            Self::Word => (raw & 0xFFFF) as i32,
            Self::SignedWord => (raw as u16).cast_signed() as i32,
            Self::Long => raw.cast_signed(),
        }
    }
}

/// What the motion side knows in a tick.
pub trait SignalValues {
    /// A command value as it is transmitted.
    fn command(&self, command: Command) -> u32;

    /// A value of the AT as it is transmitted.
    fn feedback(&self, feedback: Feedback) -> u32;

    /// A word of bits.
    fn bits(&self, source: Source) -> u16;

    /// The position and velocity loops in their last tick.
    fn loops(&self) -> &LoopValues;

    /// The current loop in its last tick.
    fn current_loop(&self) -> &CurrentLoopValues;
}

/// The value of a signal in this tick.
#[inline]
pub fn sample_source(signal: Signal, values: &impl SignalValues) -> i32 {
    match signal {
        Signal::Off => 0,
        Signal::Constant(value) => value,
        Signal::Command(command, width) => width.extend(values.command(command)),
        Signal::Feedback(feedback, width) => width.extend(values.feedback(feedback)),
        Signal::Bits(source) => i32::from(values.bits(source)),
        Signal::Internal(internal) => internal.value(values.loops(), values.current_loop()),
    }
}

/// Settings that no recording can be made with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum InvalidConfiguration {
    /// P-0-0201 to P-0-0204.
    Signal {
        /// Channel, 0 to 3.
        channel: u8,
        /// Number given.
        actual: u16,
        /// What the master is told.
        error: ServiceError,
    },
    /// P-0-0205 has bits set that mean nothing, or edge 3.
    Trigger {
        /// Value given.
        actual: u16,
    },
    /// The settings do not go together.
    Scope(ScopeSettingsError),
}

impl InvalidConfiguration {
    /// What a master is told that writes the setting, or arms.
    #[must_use]
    pub const fn service_error(self) -> ServiceError {
        match self {
            Self::Signal { error, .. } => error,
            Self::Trigger { .. } | Self::Scope(_) => ServiceError::InvalidData,
        }
    }
}

impl fmt::Display for InvalidConfiguration {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Signal { channel, actual, error } => {
                write!(formatter, "channel {channel} cannot record {actual:#06x}: {error:?}")
            }
            Self::Trigger { actual } => write!(formatter, "{actual:#06x} is no trigger channel and edge"),
            Self::Scope(error) => error.fmt(formatter),
        }
    }
}

impl core::error::Error for InvalidConfiguration {}

/// Everything that a recording needs, checked and looked up.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Configuration {
    settings: ScopeSettings,
    signals: [Signal; SCOPE_CHANNELS],
    sampling: Sampling,
}

impl Configuration {
    /// From P-0-0201 to P-0-0208, which `setting` gives as they are transmitted; `signal` is what the number in one of the first four means.
    ///
    /// # Errors
    /// The first setting that no recording can be made with.
    pub fn new(
        setting: impl Fn(Idn) -> u32,
        signal: impl Fn(u16) -> Result<Signal, ServiceError>,
    ) -> Result<Self, InvalidConfiguration> {
        let word = |idn| (setting(idn) & 0xFFFF) as u16;
        let mut signals = [Signal::Off; SCOPE_CHANNELS];
        for ((slot, idn), channel) in signals.iter_mut().zip(SIGNALS).zip(0_u8..) {
            let actual = word(idn);
            *slot = signal(actual).map_err(|error| InvalidConfiguration::Signal { channel, actual, error })?;
        }
        let (channel, edge) = trigger(word(TRIGGER))?;
        let trigger = ScopeTrigger { channel, edge, level: setting(LEVEL).cast_signed() };
        let sampling = Sampling::from_parameter(word(SAMPLING));
        let settings =
            ScopeSettings::new(trigger, word(PRE_TRIGGER), sampling.divider()).map_err(InvalidConfiguration::Scope)?;
        Ok(Self { settings, signals, sampling })
    }
}

/// Channel and edge of P-0-0205.
pub(crate) fn trigger(value: u16) -> Result<(u8, ScopeEdge), InvalidConfiguration> {
    let edge = match value >> 8 {
        0 => ScopeEdge::Immediate,
        1 => ScopeEdge::Rising,
        2 => ScopeEdge::Falling,
        _ => return Err(InvalidConfiguration::Trigger { actual: value }),
    };
    match value & 0xFF {
        channel @ 0..=3 => Ok((channel as u8, edge)),
        _ => Err(InvalidConfiguration::Trigger { actual: value }),
    }
}

/// The task that calls.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Task {
    /// Every 62.5 us.
    CurrentLoop,
    /// Every 125 us.
    ControlLoop,
}

/// The drive's side of the oscilloscope. It borrows its 32 KiB, which nobody wants to move.
#[derive(Debug)]
pub struct Oscilloscope<'memory> {
    scope: &'memory mut Scope,
    signals: [Signal; SCOPE_CHANNELS],
    sampling: Sampling,
    window: u16,
}

impl<'memory> Oscilloscope<'memory> {
    /// Idle, with the window at the first point.
    #[must_use]
    pub const fn new(scope: &'memory mut Scope) -> Self {
        let signals = [Signal::Off; SCOPE_CHANNELS];
        Self { scope, signals, sampling: Sampling::Loops { ticks: 1 }, window: 0 }
    }

    /// P-0-0209 = 1. What was recorded before is lost; the window goes back to the first point.
    pub const fn arm(&mut self, configuration: Configuration) {
        self.signals = configuration.signals;
        self.sampling = configuration.sampling;
        self.window = 0;
        self.scope.arm(configuration.settings);
    }

    /// P-0-0209 = 0.
    pub const fn stop(&mut self) {
        self.scope.stop();
    }

    /// P-0-0200.
    #[must_use]
    pub const fn state(&self) -> u16 {
        self.scope.state() as u16
    }

    /// Points are being taken, by whichever task.
    #[inline]
    #[must_use]
    pub const fn is_recording(&self) -> bool {
        self.scope.is_recording()
    }

    /// P-0-0215; `current_loop` as for [`Sampling::interval`].
    #[must_use]
    pub const fn interval(&self, current_loop: u16) -> u32 {
        self.sampling.interval(current_loop)
    }

    /// The signals whose values this task has to give to [`Oscilloscope::record`] in this tick, each by [`sample_source`]; `None` while
    /// nothing is recorded, or the other task records.
    #[inline]
    #[must_use]
    pub const fn wanted(&self, task: Task) -> Option<[Signal; SCOPE_CHANNELS]> {
        let called = match self.sampling {
            Sampling::CurrentLoop => matches!(task, Task::CurrentLoop),
            Sampling::Loops { .. } => matches!(task, Task::ControlLoop),
        };
        if called && self.scope.is_recording() { Some(self.signals) } else { None }
    }

    /// Takes the values of this tick.
    #[inline]
    pub fn record(&mut self, values: &[i32; SCOPE_CHANNELS]) {
        self.scope.sample(values);
    }

    /// P-0-0214.
    #[must_use]
    pub const fn window(&self) -> u16 {
        self.window
    }

    /// Sets P-0-0214, 0 ..= 2 047; from elsewhere nothing can be read.
    pub const fn set_window(&mut self, start: u16) {
        self.window = start;
    }

    /// P-0-0210 to P-0-0213 for channel 0 to 3: the points of the window as they are transmitted. Fewer than [`WINDOW_POINTS`] at the end
    /// of the recording, none before it is complete.
    pub fn points(&self, channel: usize) -> impl Iterator<Item = u32> + '_ {
        let start = usize::from(self.window);
        let window = start..start.saturating_add(WINDOW_POINTS);
        window.map_while(move |index| self.scope.point(channel, index)).map(i32::cast_unsigned)
    }
}

#[cfg(test)]
mod tests;
