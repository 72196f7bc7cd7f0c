//! What an encoder's disk and its signals are wrong by.

use core::f64::consts::TAU;

use crate::frame::sine_and_cosine;
use crate::turn::Turn;

/// A disk beside the middle of the shaft: once a revolution the encoder shows `radians * sin(2 pi (angle + phase))` too much, with the angle
/// in revolutions. An offset `e` of a track of radius `r` gives `e / r` rad (10 um on 20 mm: 103 seconds of arc).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Eccentricity {
    /// Amplitude of the error in rad.
    pub radians: f64,
    /// In revolutions.
    pub phase: f64,
}

/// Sine and cosine of the tracks that are no pure ones. With the angle `p` within a signal period they are `cos p + offset[0]` and
/// `(1 + amplitude) sin(p + phase) + offset[1]`; the angle read from them is too much by
/// `offset[1] cos p - offset[0] sin p + amplitude sin 2p / 2 + phase (1 + cos 2p) / 2` (first order of Heydemann, Applied Optics 20, 1981, 3382).
///
/// Edges of a square-wave encoder move by the same within their pitch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct QuadratureError {
    /// Signal periods, or lines, per revolution.
    pub periods_per_revolution: u32,
    /// By how much the sine is larger than the cosine, as a share of it.
    pub amplitude: f64,
    /// By how much the sine leads its place, in rad of the signal.
    pub phase: f64,
    /// Offsets of cosine and sine as shares of their amplitude.
    pub offset: [f64; 2],
}

impl Eccentricity {
    pub(crate) fn check(&self) {
        assert!(self.radians.abs() < 0.5, "the encoder would count backwards within a revolution");
    }

    /// Too much, in revolutions.
    pub(crate) fn error(&self, turn: Turn) -> f64 {
        let (sine, _) = sine_and_cosine(turn.part + self.phase);
        self.radians * sine / TAU
    }
}

impl QuadratureError {
    pub(crate) fn check(&self) {
        assert!(self.periods_per_revolution > 0, "the tracks have signal periods");
        let [cosine, sine] = self.offset;
        let steepest = self.amplitude.abs() + self.phase.abs() + cosine.abs() + sine.abs();
        assert!(steepest < 0.9, "the encoder would count backwards within a signal period");
    }

    /// Too much, in revolutions.
    pub(crate) fn error(&self, turn: Turn) -> f64 {
        let periods = f64::from(self.periods_per_revolution);
        let (sine, cosine) = sine_and_cosine(periods * turn.part);
        let [of_cosine, of_sine] = self.offset;
        // sin 2p / 2 and (1 + cos 2p) / 2.
        let twice = self.amplitude * sine * cosine + self.phase * cosine * cosine;
        (of_sine * cosine - of_cosine * sine + twice) / (TAU * periods)
    }
}
