//! FSMC bank 1 and the independent watchdog (RM0090 chapters 36 and 21).

use ring::Nanoseconds;

/// Static memory controller, bank 1.
#[derive(Clone, Debug)]
pub(crate) struct Fsmc {
    /// BCR1, BTR1, BCR2, ... BTR4.
    control: [u32; 8],
    /// BWTR1 to BWTR4.
    write_timing: [u32; 4],
}

impl Fsmc {
    pub(crate) fn new() -> Self {
        let mut control = [0x0FFF_FFFF; 8];
        for bank in 0..4 {
            control[2 * bank] = if bank == 0 { 0x30DB } else { 0x30D2 };
        }
        Self { control, write_timing: [0x0FFF_FFFF; 4] }
    }

    pub(crate) fn read(&self, offset: u32) -> Option<u32> {
        match offset {
            0x000..=0x01C => Some(self.control[offset as usize / 4]),
            0x104..=0x11C if offset % 8 == 4 => Some(self.write_timing[(offset as usize - 0x104) / 8]),
            _ => None,
        }
    }

    pub(crate) fn write(&mut self, offset: u32, value: u32) -> Option<()> {
        match offset {
            0x000..=0x01C => self.control[offset as usize / 4] = value,
            0x104..=0x11C if offset % 8 == 4 => {
                self.write_timing[(offset as usize - 0x104) / 8] = value;
            }
            _ => return None,
        }
        Some(())
    }

    /// What keeps an asynchronous 16-bit access with chip select NE1 from working.
    pub(crate) fn obstacle(&self) -> Option<String> {
        let control = self.control[0];
        let checks = [
            (control & 1 == 1, "the bank is disabled (MBKEN)"),
            (control & 2 == 0, "address and data are multiplexed (MUXEN)"),
            (control >> 2 & 3 == 0, "the memory type is not SRAM (MTYP)"),
            (control >> 4 & 3 == 1, "the width is not 16 bits (MWID)"),
            (control & 1 << 8 == 0, "synchronous bursts are on (BURSTEN)"),
        ];
        checks.iter().find(|(fine, _)| !fine).map(|(_, what)| format!("FSMC_BCR1 = {control:#010x}: {what}"))
    }

    pub(crate) fn is_writable(&self) -> bool {
        self.control[0] & 1 << 12 != 0
    }

    /// Cycles of HCLK that a read and a write keep the processor waiting: address set-up, data phase, turnaround and two to start and end.
    pub(crate) fn cycles(&self) -> (u32, u32) {
        let cycles = |timing: u32| (timing & 0xF) + (timing >> 8 & 0xFF) + (timing >> 16 & 0xF) + 2;
        let read = cycles(self.control[1]);
        let extended = self.control[0] & 1 << 14 != 0;
        let write = if extended { cycles(self.write_timing[0]) } else { read };
        (read, write)
    }
}

/// Independent watchdog at the nominal 32 kHz.
#[derive(Clone, Debug)]
pub(crate) struct Watchdog {
    unlocked: bool,
    prescaler: u32,
    reload: u32,
    busy_until: Nanoseconds,
    expires: Option<Nanoseconds>,
}

const LOW_SPEED_HZ: u64 = 32_000;

impl Watchdog {
    pub(crate) fn new() -> Self {
        Self { unlocked: false, prescaler: 0, reload: 0xFFF, busy_until: Nanoseconds::ZERO, expires: None }
    }

    /// When it resets the processor.
    pub(crate) fn expires(&self) -> Option<Nanoseconds> {
        self.expires
    }

    /// Time from feeding to reset.
    pub(crate) fn timeout(&self) -> Nanoseconds {
        let divider = 4_u64 << self.prescaler.min(6);
        Nanoseconds((u64::from(self.reload) + 1) * divider * 1_000_000_000 / LOW_SPEED_HZ)
    }

    pub(crate) fn read(&self, offset: u32, now: Nanoseconds) -> Option<u32> {
        Some(match offset {
            0x00 => 0,
            0x04 => self.prescaler,
            0x08 => self.reload,
            0x0C => {
                if now < self.busy_until {
                    3
                } else {
                    0
                }
            }
            _ => return None,
        })
    }

    pub(crate) fn write(&mut self, offset: u32, value: u32, now: Nanoseconds) -> Option<()> {
        /// Five periods of the low speed clock.
        const UPDATE_TIME: Nanoseconds = Nanoseconds(156_250);
        match (offset, value & 0xFFFF) {
            (0x00, 0xCCCC) => {
                self.expires = Some(now + self.timeout());
                self.unlocked = false;
            }
            (0x00, 0xAAAA) => {
                if self.expires.is_some() {
                    self.expires = Some(now + self.timeout());
                }
                self.unlocked = false;
            }
            (0x00, key) => self.unlocked = key == 0x5555,
            (0x04, value) if self.unlocked => {
                self.prescaler = value & 7;
                self.busy_until = now + UPDATE_TIME;
            }
            (0x08, value) if self.unlocked => {
                self.reload = value & 0xFFF;
                self.busy_until = now + UPDATE_TIME;
            }
            (0x04 | 0x08 | 0x0C, _) => {}
            _ => return None,
        }
        Some(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn waits_follow_the_timing_registers() {
        let mut fsmc = Fsmc::new();
        assert!(fsmc.obstacle().unwrap().contains("MUXEN"));
        fsmc.write(0x000, 0xF091);
        fsmc.write(0x004, 0x000F_3C1F);
        fsmc.write(0x104, 0x0FF0_0402);
        assert_eq!(fsmc.obstacle(), None);
        assert_eq!(fsmc.cycles(), (15 + 60 + 15 + 2, 2 + 4 + 2));
        assert_eq!(fsmc.read(0x104), Some(0x0FF0_0402));
        assert_eq!(fsmc.read(0x108), None);
    }

    #[test]
    fn the_watchdog_runs_from_its_registers() {
        let mut watchdog = Watchdog::new();
        let now = Nanoseconds::from_millis(1);
        watchdog.write(0, 0xCCCC, now);
        watchdog.write(8, 799, now);
        assert_eq!(watchdog.read(8, now), Some(0xFFF), "locked");
        watchdog.write(0, 0x5555, now);
        watchdog.write(8, 799, now);
        watchdog.write(0, 0xAAAA, now);
        assert_eq!(watchdog.expires(), Some(Nanoseconds::from_millis(101)));
    }
}
