//! The frequency response of the real axis: the drive tunes it (P-0-0240), and what it has measured is read over the service channel.

use super::channel::{ChannelError, ServiceChannel};
use serde::Serialize;

const TUNE: u16 = 0x8000 | 240;
const PROGRESS: u16 = 0x8000 | 227;
const RESULT: u16 = 0x8000 | 243;
const PHASE_MARGIN: u16 = 0x8000 | 244;
const GAIN_MARGIN: u16 = 0x8000 | 245;
const CROSSING: u16 = 0x8000 | 246;
const RESONANCE: u16 = 0x8000 | 247;
const POINTS: u16 = 0x8000 | 248;
const WINDOW: u16 = 0x8000 | 249;
/// Points of a window, and numbers of a point.
const WINDOW_POINTS: usize = 6;
const NUMBERS: usize = 5;
/// Windows that there can be.
const WINDOWS: u64 = 11;

const EXECUTED: u64 = 3;
const EXECUTING: u64 = 7;
/// Of P-0-0245: nowhere.
const NO_TURNING: u64 = 0xFFFF;
/// Looks at the command, every half second: three minutes.
const LOOKS: u32 = 360;
const LOOK: u64 = 500_000;

/// One frequency.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub(crate) struct BodePoint {
    pub(crate) hertz: f64,
    /// Of the axis, in dB of 1 rad/s per A, and degrees.
    pub(crate) axis_decibels: f64,
    pub(crate) axis_degrees: f64,
    /// Of the open velocity loop.
    pub(crate) open_decibels: f64,
    pub(crate) open_degrees: f64,
}

/// What was read.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(crate) struct Bode {
    /// Degrees.
    pub(crate) phase_margin: f64,
    /// dB; none where the phase does not pass -180 degrees.
    pub(crate) gain_margin: Option<f64>,
    pub(crate) crossing_hertz: f64,
    pub(crate) resonance_hertz: Option<f64>,
    /// A notch was put on the resonance.
    pub(crate) notch: bool,
    pub(crate) points: Vec<BodePoint>,
}

/// Why there is nothing to draw.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum BodeError {
    Channel(ChannelError),
    /// The command has ended with an error, and P-0-0228 says why.
    Failed {
        state: u64,
    },
    /// It does not end.
    Endless {
        percent: u64,
    },
    /// The list has another length than whole points.
    Points {
        actual: usize,
    },
}

impl From<ChannelError> for BodeError {
    fn from(error: ChannelError) -> Self {
        Self::Channel(error)
    }
}

impl std::error::Error for BodeError {}

impl std::fmt::Display for BodeError {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Channel(error) => error.fmt(formatter),
            Self::Failed { state } => {
                write!(formatter, "P-0-0240 has ended with state {state:X}H; P-0-0228 says why")
            }
            Self::Endless { percent } => write!(formatter, "P-0-0240 does not end; it has come to {percent} %"),
            Self::Points { actual } => write!(formatter, "P-0-0248 has {actual} numbers, which are no whole points"),
        }
    }
}

/// Tunes the axis and reads what was measured. `progress` as for the oscilloscope.
pub(crate) fn measure<C: ServiceChannel>(
    channel: &mut C,
    progress: &mut dyn FnMut(&str, u64, u64),
) -> Result<Bode, BodeError> {
    progress("tune the axis", 0, 100);
    channel.write(TUNE, 3)?;
    let mut state = channel.read(TUNE)?;
    for _ in 0..LOOKS {
        if state != EXECUTING {
            break;
        }
        channel.wait(LOOK)?;
        progress("tune the axis", channel.read(PROGRESS)?, 100);
        state = channel.read(TUNE)?;
    }
    match state {
        EXECUTED => {}
        EXECUTING => return Err(BodeError::Endless { percent: channel.read(PROGRESS)? }),
        state => return Err(BodeError::Failed { state }),
    }
    let points = read_points(channel, progress)?;
    channel.write(TUNE, 0)?;
    let gain_margin = channel.read(GAIN_MARGIN)?;
    let resonance = channel.read(RESONANCE)?;
    Ok(Bode {
        phase_margin: channel.read(PHASE_MARGIN)? as f64 / 10.0,
        gain_margin: (gain_margin != NO_TURNING).then_some(gain_margin as f64 / 10.0),
        crossing_hertz: channel.read(CROSSING)? as f64 / 100.0,
        resonance_hertz: (resonance != 0).then_some(resonance as f64 / 100.0),
        notch: channel.read(RESULT)? & 2 != 0,
        points,
    })
}

fn read_points(
    channel: &mut impl ServiceChannel,
    progress: &mut dyn FnMut(&str, u64, u64),
) -> Result<Vec<BodePoint>, BodeError> {
    let mut points = Vec::new();
    for window in 0..WINDOWS {
        progress("read the points", window, WINDOWS);
        channel.write(WINDOW, window * WINDOW_POINTS as u64)?;
        let list = channel.read_list(POINTS)?;
        if !list.len().is_multiple_of(NUMBERS) {
            return Err(BodeError::Points { actual: list.len() });
        }
        let hundredths = |value: i32| f64::from(value) / 100.0;
        points.extend(list.chunks_exact(NUMBERS).map(|point| BodePoint {
            hertz: hundredths(point[0]),
            axis_decibels: hundredths(point[1]),
            axis_degrees: hundredths(point[2]),
            open_decibels: hundredths(point[3]),
            open_degrees: hundredths(point[4]),
        }));
        if list.len() < WINDOW_POINTS * NUMBERS {
            break;
        }
    }
    progress("read the points", WINDOWS, WINDOWS);
    Ok(points)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeMap;

    /// A drive that is done after a few looks, or never.
    struct Tuned {
        values: BTreeMap<u16, u64>,
        looks: u32,
        ends: u64,
        points: Vec<i32>,
    }

    impl ServiceChannel for Tuned {
        fn read(&mut self, idn: u16) -> Result<u64, ChannelError> {
            if idn == TUNE {
                self.looks += 1;
                return Ok(if self.looks < 5 { EXECUTING } else { self.ends });
            }
            Ok(self.values.get(&idn).copied().unwrap_or(0))
        }

        fn read_list(&mut self, _: u16) -> Result<Vec<i32>, ChannelError> {
            let start = (self.values.get(&WINDOW).copied().unwrap_or(0) as usize * NUMBERS).min(self.points.len());
            let end = (start + WINDOW_POINTS * NUMBERS).min(self.points.len());
            Ok(self.points[start..end].to_vec())
        }

        fn write(&mut self, idn: u16, value: u64) -> Result<(), ChannelError> {
            self.values.insert(idn, value);
            Ok(())
        }

        fn wait(&mut self, _: u64) -> Result<(), ChannelError> {
            Ok(())
        }
    }

    fn tuned(ends: u64, numbers: i32) -> Tuned {
        let values = [(PHASE_MARGIN, 456), (GAIN_MARGIN, 83), (CROSSING, 18_750), (RESULT, 3), (RESONANCE, 64_000)];
        Tuned { values: values.into(), looks: 0, ends, points: (0..numbers).map(|n| n * 100).collect() }
    }

    #[test]
    fn all_windows_are_read_and_numbers_have_their_units() {
        let bode = measure(&mut tuned(EXECUTED, 70), &mut |_, _, _| {}).unwrap();
        assert_eq!(bode.points.len(), 14);
        let last = bode.points[13];
        assert_eq!((last.hertz, last.axis_decibels, last.open_degrees), (65.0, 66.0, 69.0));
        assert_eq!((bode.phase_margin, bode.gain_margin, bode.crossing_hertz), (45.6, Some(8.3), 187.5));
        assert_eq!((bode.resonance_hertz, bode.notch), (Some(640.0), true));
    }

    #[test]
    fn a_command_that_fails_or_does_not_end_and_half_a_point_are_told_of() {
        assert_eq!(measure(&mut tuned(0xF, 70), &mut |_, _, _| {}), Err(BodeError::Failed { state: 0xF }));
        assert_eq!(measure(&mut tuned(EXECUTING, 70), &mut |_, _, _| {}), Err(BodeError::Endless { percent: 0 }));
        assert_eq!(measure(&mut tuned(EXECUTED, 7), &mut |_, _, _| {}), Err(BodeError::Points { actual: 7 }));
        let mut nowhere = tuned(EXECUTED, 5);
        nowhere.values.insert(GAIN_MARGIN, NO_TURNING);
        assert_eq!(measure(&mut nowhere, &mut |_, _, _| {}).unwrap().gain_margin, None);
    }
}
