//! Supervision of MST and MDT in CP3 and CP4: error counters and the double-failure rule (sercos2.md 2.4).

use crate::phase::PhaseError;

/// How a telegram fared in one communication cycle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Reception {
    /// Received in its window, right length and FCS.
    Valid,
    /// Missing, or outside its window, or damaged.
    Failed,
    /// No judgement is possible; failures in a row are neither ended nor prolonged. So for the MDT of a cycle in which
    /// a ring controller, having seen no MST, did not listen.
    Unknown,
}

/// Counts failures of MST and MDT, one call a cycle.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct LossCounter {
    mst: Failures,
    mdt: Failures,
}

impl LossCounter {
    /// No failures yet.
    pub const fn new() -> Self {
        Self { mst: Failures::NONE, mdt: Failures::NONE }
    }

    /// Takes the verdict on one cycle of CP3 or CP4.
    ///
    /// # Errors
    /// Two MSTs, or two MDTs, or both, have now failed in a row; told once a burst, in the cycle in which it happens.
    /// If both end in the same cycle, it is taken for a loss of light, and the counters forget the burst.
    pub fn cycle(&mut self, mst: Reception, mdt: Reception) -> Result<(), PhaseError> {
        let mst_fault = self.mst.take(mst);
        let mdt_fault = self.mdt.take(mdt);
        match (mst_fault, mdt_fault) {
            (false, false) => Ok(()),
            (true, false) => Err(PhaseError::MstFailure),
            (false, true) => Err(PhaseError::MdtFailure),
            (true, true) => {
                self.mst.forget_burst();
                self.mdt.forget_burst();
                Err(PhaseError::LightLoss)
            }
        }
    }

    /// S-0-0028: invalid MSTs, 0..=65535, saturating; only the first two of a burst count.
    pub const fn mst_errors(&self) -> u16 {
        self.mst.count
    }

    /// S-0-0029: invalid MDTs, like [`LossCounter::mst_errors`].
    pub const fn mdt_errors(&self) -> u16 {
        self.mdt.count
    }

    /// Clears counters and bursts: on the way from CP2 to CP3.
    pub fn clear(&mut self) {
        *self = Self::new();
    }

    /// Ends the bursts and keeps the counters: for a fall back to CP0.
    pub fn end_bursts(&mut self) {
        self.mst.in_a_row = 0;
        self.mdt.in_a_row = 0;
    }
}

/// Failures in a row that mean a fault.
const FAULT: u8 = 2;

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
struct Failures {
    count: u16,
    /// The count when the burst began.
    before_burst: u16,
    /// Saturates above [`FAULT`], so that the fault is told once.
    in_a_row: u8,
}

impl Failures {
    const NONE: Self = Self { count: 0, before_burst: 0, in_a_row: 0 };

    /// True if this failure completes a fault.
    fn take(&mut self, reception: Reception) -> bool {
        match reception {
            Reception::Valid => self.in_a_row = 0,
            Reception::Unknown => {}
            Reception::Failed => {
                if self.in_a_row == 0 {
                    self.before_burst = self.count;
                }
                if self.in_a_row < FAULT {
                    self.count = self.count.saturating_add(1);
                }
                self.in_a_row = self.in_a_row.saturating_add(1).min(FAULT.saturating_add(1));
                return self.in_a_row == FAULT;
            }
        }
        false
    }

    fn forget_burst(&mut self) {
        self.count = self.before_burst;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use Reception::{Failed, Unknown, Valid};

    #[test]
    fn a_single_loss_rides_through_and_is_counted() {
        let mut losses = LossCounter::new();
        for _ in 0..3 {
            assert_eq!(losses.cycle(Failed, Valid), Ok(()));
            assert_eq!(losses.cycle(Valid, Failed), Ok(()));
        }
        assert_eq!((losses.mst_errors(), losses.mdt_errors()), (3, 3));
    }

    #[test]
    fn the_second_loss_in_a_row_is_a_fault_told_once_and_only_two_of_the_burst_count() {
        let mut losses = LossCounter::new();
        assert_eq!(losses.cycle(Failed, Unknown), Ok(()));
        assert_eq!(losses.cycle(Failed, Unknown), Err(PhaseError::MstFailure));
        for _ in 0..10 {
            assert_eq!(losses.cycle(Failed, Unknown), Ok(()));
        }
        assert_eq!((losses.mst_errors(), losses.mdt_errors()), (2, 0));
    }

    #[test]
    fn two_mdts_in_a_row_are_a_fault() {
        let mut losses = LossCounter::new();
        assert_eq!(losses.cycle(Valid, Failed), Ok(()));
        assert_eq!(losses.cycle(Valid, Failed), Err(PhaseError::MdtFailure));
        assert_eq!(losses.mdt_errors(), 2);
    }

    #[test]
    fn loss_of_light_is_not_counted() {
        let mut losses = LossCounter::new();
        assert_eq!(losses.cycle(Failed, Failed), Ok(()));
        assert_eq!(losses.cycle(Failed, Failed), Err(PhaseError::LightLoss));
        assert_eq!((losses.mst_errors(), losses.mdt_errors()), (0, 0));
    }

    #[test]
    fn an_unknown_cycle_neither_ends_nor_prolongs_a_burst() {
        let mut losses = LossCounter::new();
        assert_eq!(losses.cycle(Valid, Failed), Ok(()));
        assert_eq!(losses.cycle(Failed, Unknown), Ok(()));
        assert_eq!(losses.cycle(Valid, Failed), Err(PhaseError::MdtFailure));
    }

    #[test]
    fn a_fall_back_ends_bursts_and_keeps_counters_and_a_new_cp3_clears_both() {
        let mut losses = LossCounter::new();
        assert_eq!(losses.cycle(Failed, Valid), Ok(()));
        losses.end_bursts();
        assert_eq!(losses.cycle(Failed, Valid), Ok(()), "the first of a new burst");
        assert_eq!(losses.mst_errors(), 2);
        losses.clear();
        assert_eq!(losses, LossCounter::new());
        assert_eq!(losses.cycle(Failed, Failed), Ok(()));
        losses.end_bursts();
        assert_eq!(losses.cycle(Valid, Failed), Ok(()));
        assert_eq!((losses.mst_errors(), losses.mdt_errors()), (1, 2));
    }

    #[test]
    fn the_counters_saturate() {
        let mut losses = LossCounter::new();
        for _ in 0..70_000 {
            let _ = losses.cycle(Failed, Valid);
            let _ = losses.cycle(Valid, Valid);
        }
        assert_eq!(losses.mst_errors(), u16::MAX);
    }
}
