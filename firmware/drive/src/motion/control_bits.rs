//! Single bits that the control unit or the service channel sets: the application word P-0-0019, and the enables above it.

use crate::signal::bits::BitSettings;
use crate::signal::control_bits::Enable;

/// The bits as they are: P-0-0019 in the low half, the enables above.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct ControlBits(u32);

impl ControlBits {
    /// The real-time bits of a control word.
    #[inline]
    pub(super) const fn take_control_word(&mut self, settings: &BitSettings, control_word: u16) {
        self.0 = settings.apply_control_word(self.0, control_word);
    }

    /// S-0-0145.
    #[inline]
    pub(super) fn take_signal_control(&mut self, settings: &BitSettings, signal_control: u16) {
        self.0 = settings.apply_signal_control(self.0, signal_control);
    }

    /// One of the enables, over the service channel.
    pub(super) const fn set_enable(&mut self, enable: Enable, set: bool) {
        let bit = enable.mask();
        self.0 = if set { self.0 | bit } else { self.0 & !bit };
    }

    /// P-0-0019, over the service channel.
    pub(super) fn set_application_word(&mut self, word: u16) {
        self.0 = self.0 & !0xFFFF | u32::from(word);
    }

    /// One of the enables is set.
    #[inline]
    pub(super) const fn has(&self, enable: Enable) -> bool {
        self.0 & enable.mask() != 0
    }

    /// All of them.
    #[inline]
    pub(super) const fn all(&self) -> u32 {
        self.0
    }

    /// S-0-0405 to S-0-0407, from bit 0.
    #[inline]
    pub(super) fn enables(&self) -> u16 {
        let enables = [Enable::Probe1, Enable::Probe2, Enable::Homing].into_iter().rev();
        enables.fold(0, |word, enable| word << 1 | u16::from(self.has(enable)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_enable_and_the_application_word_leave_each_other_alone() {
        let mut bits = ControlBits::default();
        bits.set_enable(Enable::Probe2, true);
        bits.set_application_word(0xA5A5);
        assert_eq!((bits.all() & 0xFFFF, bits.enables()), (0xA5A5, 0b010));
        bits.set_enable(Enable::Homing, true);
        bits.set_enable(Enable::Probe2, false);
        bits.set_application_word(0);
        assert_eq!((bits.all(), bits.enables()), (Enable::Homing.mask(), 0b100));
    }
}
