//! The limits as the control gives them.

use sercos::parameters::Parameters;

use crate::signal::limit::{LIMITS, Limit};

/// All limits, each in the increments of its scaling.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct LimitValues([i32; LIMITS.len()]);

impl LimitValues {
    /// As the parameters say; what needs 32 bits without sign saturates.
    pub(crate) fn new(parameters: &Parameters) -> Self {
        let mut values = Self::default();
        for (block, limit) in LIMITS {
            values.set(*limit, i32::try_from(parameters.get_signed(block.idn)).unwrap_or(i32::MAX));
        }
        values
    }

    /// One of them.
    pub(crate) fn get(&self, limit: Limit) -> i32 {
        self.0.get(limit as usize).copied().unwrap_or(0)
    }

    pub(crate) fn set(&mut self, limit: Limit, value: i32) {
        if let Some(place) = self.0.get_mut(limit as usize) {
            *place = value;
        }
    }
}
