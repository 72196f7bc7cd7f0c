//! TIM1_BDTR: main output enable, break input, dead time and the lock of the set-up (RM0090 17.4.18).

pub(crate) const AUTOMATIC_OUTPUT: u32 = 1 << 14;
pub(crate) const BREAK_ACTIVE_HIGH: u32 = 1 << 13;
pub(crate) const BREAK_ENABLE: u32 = 1 << 12;
pub(crate) const IDLE_STATE_DRIVEN: u32 = 1 << 10;
pub(crate) const RUN_STATE_DRIVEN: u32 = 1 << 11;
const MAIN_OUTPUT: u32 = 1 << 15;
const LOCK: u32 = 3 << 8;
const DEAD_TIME: u32 = 0xFF;

/// The register, and what freezes it.
#[derive(Clone, Debug)]
pub(crate) struct BreakAndDeadTime {
    value: u32,
    written: bool,
    /// Level of the break pin.
    level: bool,
    clock_failed: bool,
}

impl BreakAndDeadTime {
    /// After reset; the break pin is low, as an unconnected one.
    pub(crate) fn new() -> Self {
        Self { value: 0, written: false, level: false, clock_failed: false }
    }

    pub(crate) fn value(&self) -> u32 {
        self.value
    }

    /// LOCK: 0 to 3.
    pub(crate) fn lock(&self) -> u32 {
        (self.value & LOCK) >> 8
    }

    pub(crate) fn main_output(&self) -> bool {
        self.value & MAIN_OUTPUT != 0
    }

    /// Is the break input enabled and at its active level?
    pub(crate) fn is_broken(&self) -> bool {
        let pin = self.level == (self.value & BREAK_ACTIVE_HIGH != 0);
        self.value & BREAK_ENABLE != 0 && (pin || self.clock_failed)
    }

    /// The clock security system has found the crystal dead.
    pub(crate) fn fail_clock(&mut self) {
        self.clock_failed = true;
    }

    pub(crate) fn set_level(&mut self, level: bool) {
        self.level = level;
    }

    /// Switches the outputs off.
    pub(crate) fn trip(&mut self) {
        self.value &= !MAIN_OUTPUT;
    }

    /// An update event brings the outputs back when AOE is set and the break is over.
    pub(crate) fn rearm(&mut self) {
        if self.rearms() {
            self.value |= MAIN_OUTPUT;
        }
    }

    /// Would the next update event switch the outputs on?
    pub(crate) fn rearms(&self) -> bool {
        self.value & (AUTOMATIC_OUTPUT | MAIN_OUTPUT) == AUTOMATIC_OUTPUT && !self.is_broken()
    }

    /// `Err` tells what is locked; the bits that are not locked are written nevertheless, as in the part.
    pub(crate) fn write(&mut self, value: u32) -> Result<(), String> {
        let locked = match self.lock() {
            0 => 0,
            1 => DEAD_TIME | BREAK_ENABLE | BREAK_ACTIVE_HIGH | AUTOMATIC_OUTPUT,
            _ => DEAD_TIME | BREAK_ENABLE | BREAK_ACTIVE_HIGH | AUTOMATIC_OUTPUT | IDLE_STATE_DRIVEN | RUN_STATE_DRIVEN,
        };
        let locked = if self.written { locked | LOCK } else { locked };
        let refused = (value ^ self.value) & locked;
        self.written = true;
        self.value = self.value & locked | value & !locked & 0xFFFF;
        if self.is_broken() {
            self.trip();
        }
        refuse_locked("BDTR", refused, self.lock())
    }

    /// Dead time in periods of the dead-time clock (CK_INT divided by CKD).
    pub(crate) fn dead_time(&self) -> u32 {
        let code = self.value & DEAD_TIME;
        match code >> 5 {
            0..=3 => code,
            4 | 5 => (64 + (code & 0x3F)) * 2,
            6 => (32 + (code & 0x1F)) * 8,
            _ => (32 + (code & 0x1F)) * 16,
        }
    }
}

/// The part ignores a write to locked bits; no product means that.
pub(crate) fn refuse_locked(register: &str, refused: u32, lock: u32) -> Result<(), String> {
    if refused == 0 {
        Ok(())
    } else {
        Err(format!("bits {refused:#06x} of TIM1_{register} are locked (LOCK = {lock}) and keep their value"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn with(value: u32) -> BreakAndDeadTime {
        let mut register = BreakAndDeadTime::new();
        register.set_level(true);
        register.write(value).unwrap();
        register
    }

    #[test]
    fn dead_time_has_four_ranges() {
        let dead_time = |code| with(code).dead_time();
        assert_eq!([0, 0x7F, 0x80, 0x94, 0xBF].map(dead_time), [0, 127, 128, 168, 254]);
        assert_eq!([0xC0, 0xDF, 0xE0, 0xFF].map(dead_time), [256, 504, 512, 1_008]);
    }

    #[test]
    fn level_1_locks_dead_time_and_break() {
        for changed in [0x01, BREAK_ENABLE, BREAK_ACTIVE_HIGH, AUTOMATIC_OUTPUT] {
            let start = 0x94 | 1 << 8 | BREAK_ENABLE;
            let mut register = with(start);
            let refused = register.write(start ^ changed).unwrap_err();
            assert!(refused.contains("locked (LOCK = 1)"), "{refused}");
            assert_eq!(register.value(), start);
        }
        let mut register = with(1 << 8);
        register.write(1 << 8 | IDLE_STATE_DRIVEN | MAIN_OUTPUT).unwrap();
        assert!(register.main_output(), "MOE and OSSI are free at level 1");
    }

    #[test]
    fn level_2_locks_the_off_states_too() {
        for changed in [IDLE_STATE_DRIVEN, RUN_STATE_DRIVEN] {
            let mut register = with(2 << 8);
            register.write(2 << 8 | changed).unwrap_err();
            assert_eq!(register.value(), 2 << 8);
        }
    }

    #[test]
    fn the_lock_is_written_once() {
        let mut register = with(0x94);
        register.write(0x94 | 1 << 8).unwrap_err();
        assert_eq!(register.lock(), 0, "frozen by the first write");
        register.write(0x55).unwrap();
        assert_eq!(register.value(), 0x55);
    }

    #[test]
    fn main_output_cannot_be_set_during_a_break() {
        let mut register = with(BREAK_ENABLE);
        register.set_level(false);
        register.write(BREAK_ENABLE | MAIN_OUTPUT).unwrap();
        assert!(!register.main_output());
        register.set_level(true);
        register.write(BREAK_ENABLE | MAIN_OUTPUT).unwrap();
        assert!(register.main_output());
    }

    #[test]
    fn polarity_chooses_the_active_level() {
        let mut register = with(BREAK_ENABLE | BREAK_ACTIVE_HIGH);
        assert!(register.is_broken());
        register.set_level(false);
        assert!(!register.is_broken());
    }
}
