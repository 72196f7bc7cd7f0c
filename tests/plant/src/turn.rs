//! An angle that never loses resolution.

/// Whole revolutions and the rest, 0 ..= 1 revolution: as fine after a year of turning as at the start.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Turn {
    pub(crate) whole: i64,
    pub(crate) part: f64,
}

impl Turn {
    /// The middle of an encoder's first increment: where a machine stands at time zero.
    pub(crate) fn start(resolution: u32) -> Self {
        Self { whole: 0, part: 0.5 / f64::from(resolution) }
    }

    /// This angle and `travel` revolutions.
    #[must_use]
    pub(crate) fn after(self, travel: f64) -> Self {
        let part = self.part + travel;
        let whole = part.floor();
        Self { whole: self.whole + whole as i64, part: part - whole }
    }

    /// Revolutions since the start.
    pub(crate) fn since_start(self, resolution: u32) -> f64 {
        self.whole as f64 + (self.part - 0.5 / f64::from(resolution))
    }

    /// What a counter of `resolution` increments per revolution counts from angle zero to here: quantised down, wrapping at 2^32.
    pub(crate) fn count(self, resolution: u32) -> u32 {
        let increments = (self.part * f64::from(resolution)).floor() as i64;
        self.whole.wrapping_mul(i64::from(resolution)).wrapping_add(increments) as u32
    }
}
