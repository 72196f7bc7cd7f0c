//! RCC, PWR and the flash interface: the clock tree, worked out from the registers (RM0090 chapters 3, 5 and 7).

use ring::Nanoseconds;

/// Frequency of the crystal on the board, in hertz.
pub const CRYSTAL_HZ: u64 = 8_000_000;
const INTERNAL_OSCILLATOR_HZ: u64 = 16_000_000;
/// Start-up time of the crystal oscillator.
const CRYSTAL_START: Nanoseconds = Nanoseconds::from_microseconds(500);
/// Lock time of the PLL (data sheet: 75 to 200 us).
const PLL_LOCK: Nanoseconds = Nanoseconds::from_microseconds(100);

const CR: u32 = 0x00;
const PLLCFGR: u32 = 0x04;
const CFGR: u32 = 0x08;
const HSION: u32 = 1;
const HSIRDY: u32 = 1 << 1;
const HSEON: u32 = 1 << 16;
const HSERDY: u32 = 1 << 17;
const PLLON: u32 = 1 << 24;
const PLLRDY: u32 = 1 << 25;

/// Frequencies in force, in hertz.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ClockTree {
    /// SYSCLK.
    pub system: u64,
    /// HCLK: core, FSMC.
    pub core: u64,
    /// PCLK1.
    pub apb1: u64,
    /// PCLK2.
    pub apb2: u64,
    /// Timers on APB1.
    pub apb1_timers: u64,
    /// Timers on APB2.
    pub apb2_timers: u64,
    /// All of it comes from the crystal: the oscillator inside is off by a per cent.
    pub from_crystal: bool,
}

/// Reset and clock control.
#[derive(Clone, Debug)]
pub(crate) struct Rcc {
    control: u32,
    pll: u32,
    configuration: u32,
    /// The other registers, plain memory, word offset / 4.
    rest: [u32; 36],
    crystal_since: Option<Nanoseconds>,
    pll_since: Option<Nanoseconds>,
    /// The crystal has stopped.
    failed: bool,
}

/// RCC_CIR and RCC_CSR.
const CIR: usize = 0x0C;
const CSR: usize = 0x74;
/// The clock security system is on.
const SECURITY: u32 = 1 << 19;
const SECURITY_FLAG: u32 = 1 << 7;
const SECURITY_CLEARED: u32 = 1 << 23;
const RESET_FLAGS: u32 = 0xFE00_0000;
const REMOVE_RESET_FLAGS: u32 = 1 << 24;

/// Resets, and a crystal that fails (RM0090 7.1.1, 7.2.7).
impl Rcc {
    /// The flags of CSR that say why the part was reset.
    pub(crate) fn reset_flags(&self) -> u32 {
        self.rest[CSR / 4] & RESET_FLAGS
    }

    /// Right behind a reset.
    pub(crate) fn set_reset(&mut self, flags: u32, has_crystal: bool) {
        self.rest[CSR / 4] = flags;
        self.failed = !has_crystal;
    }

    pub(crate) fn has_crystal(&self) -> bool {
        !self.failed
    }

    pub(crate) fn mend_crystal(&mut self, now: Nanoseconds) {
        self.failed = false;
        self.crystal_since = self.crystal_since.map(|_| now);
    }

    /// The crystal stops. The clock security system, if it is on, puts the internal oscillator into its place.
    pub(crate) fn fail_crystal(&mut self) -> bool {
        self.failed = true;
        let noticed = self.control & SECURITY != 0 && self.control & HSEON != 0;
        if noticed {
            self.control &= !(HSEON | PLLON);
            (self.crystal_since, self.pll_since) = (None, None);
            self.configuration &= !3;
            self.rest[CIR / 4] |= SECURITY_FLAG;
        }
        noticed
    }

    /// The core runs from a crystal that has stopped.
    pub(crate) fn is_without_clock(&self) -> bool {
        self.failed && self.configuration & 3 != 0
    }
}

impl Rcc {
    pub(crate) fn new() -> Self {
        let mut rest = [0; 36];
        for (offset, value) in [
            (0x30, 0x0010_0000),
            (0x50, 0x7E67_91FF),
            (0x54, 0x0000_00F1),
            (0x58, 0x0000_0001),
            (0x60, 0x36FE_C9FF),
            (0x64, 0x0007_5F33),
            (0x74, 0x0E00_0000),
            (0x84, 0x2000_3000),
        ] {
            rest[offset / 4] = value;
        }
        Self {
            control: 0x0000_0081,
            pll: 0x2400_3010,
            configuration: 0,
            rest,
            crystal_since: None,
            pll_since: None,
            failed: false,
        }
    }

    pub(crate) fn read(&self, offset: u32, now: Nanoseconds) -> Option<u32> {
        match offset {
            CR => Some(self.control | self.ready(now)),
            PLLCFGR => Some(self.pll),
            CFGR => Some(self.configuration & !0xC | (self.configuration & 3) << 2),
            0x0C..=0x88 => Some(self.rest[offset as usize / 4]),
            _ => None,
        }
    }

    /// `Err` tells what would fail on the part.
    pub(crate) fn write(
        &mut self,
        offset: u32,
        value: u32,
        now: Nanoseconds,
        latency: u32,
    ) -> Option<Result<(), String>> {
        match offset {
            CR => {
                if value & HSEON == 0 {
                    self.crystal_since = None;
                } else if self.crystal_since.is_none() {
                    self.crystal_since = Some(now);
                }
                if value & PLLON == 0 {
                    self.pll_since = None;
                } else if self.pll_since.is_none() {
                    self.pll_since = Some(now);
                }
                self.control = value & !(HSIRDY | HSERDY | PLLRDY) | HSION;
            }
            PLLCFGR => {
                if self.control & PLLON != 0 && (value ^ self.pll) & 0x0F43_7FFF != 0 {
                    return Some(Err("RCC_PLLCFGR changed while the PLL runs".into()));
                }
                self.pll = value;
            }
            CFGR => {
                self.configuration = value;
                return Some(self.check(now, latency));
            }
            // Flags are not written.
            0x0C => {
                let cleared = if value & SECURITY_CLEARED != 0 { SECURITY_FLAG } else { 0 };
                self.rest[CIR / 4] = value & !0x00FF_00FF | self.rest[CIR / 4] & SECURITY_FLAG & !cleared;
            }
            0x74 => {
                let flags = if value & REMOVE_RESET_FLAGS != 0 { 0 } else { self.reset_flags() };
                self.rest[CSR / 4] = value & 1 | (value & 1) << 1 | flags;
            }
            0x10..=0x88 => self.rest[offset as usize / 4] = value,
            _ => return None,
        }
        Some(Ok(()))
    }

    /// Whether a peripheral's clock enable bit is set.
    pub(crate) fn is_enabled(&self, offset: u32, bit: u32) -> bool {
        self.rest[offset as usize / 4] & 1 << bit != 0
    }

    pub(crate) fn tree(&self) -> ClockTree {
        let system = match self.configuration & 3 {
            0 => INTERNAL_OSCILLATOR_HZ,
            1 => CRYSTAL_HZ,
            _ => self.pll_output(),
        };
        let core = system / ahb_divider(self.configuration >> 4 & 0xF);
        let bus = |code: u32| {
            let divider = if code & 4 == 0 { 1 } else { 2 << (code & 3) };
            let timers = if divider == 1 { 1 } else { 2 };
            (core / divider, core / divider * timers)
        };
        let (apb1, apb1_timers) = bus(self.configuration >> 10 & 7);
        let (apb2, apb2_timers) = bus(self.configuration >> 13 & 7);
        let from_crystal = match self.configuration & 3 {
            0 => false,
            1 => true,
            _ => self.pll & 1 << 22 != 0,
        };
        ClockTree { system, core, apb1, apb2, apb1_timers, apb2_timers, from_crystal }
    }

    fn ready(&self, now: Nanoseconds) -> u32 {
        let after = |since: Option<Nanoseconds>, delay, flag| match since {
            Some(since) if now >= since + delay => flag,
            _ => 0,
        };
        let crystal_since = self.crystal_since.filter(|_| !self.failed);
        HSIRDY | after(crystal_since, CRYSTAL_START, HSERDY) | after(self.pll_since, PLL_LOCK, PLLRDY)
    }

    fn pll_input(&self) -> u64 {
        let source = if self.pll & 1 << 22 != 0 { CRYSTAL_HZ } else { INTERNAL_OSCILLATOR_HZ };
        source / u64::from((self.pll & 0x3F).max(1))
    }

    fn pll_vco(&self) -> u64 {
        self.pll_input() * u64::from(self.pll >> 6 & 0x1FF)
    }

    fn pll_output(&self) -> u64 {
        self.pll_vco() / u64::from(2 * ((self.pll >> 16 & 3) + 1))
    }

    /// Limits of the data sheet at 3.3 V, scale 1.
    fn check(&self, now: Nanoseconds, latency: u32) -> Result<(), String> {
        let ready = self.ready(now);
        match self.configuration & 3 {
            0 => {}
            1 if ready & HSERDY == 0 => return Err("switched to a crystal that is not ready".into()),
            1 => {}
            2 => {
                if ready & PLLRDY == 0 {
                    return Err("switched to a PLL that is not locked".into());
                }
                let (input, vco) = (self.pll_input(), self.pll_vco());
                if !(1_000_000..=2_000_000).contains(&input) {
                    return Err(format!("PLL input {input} Hz, allowed 1 to 2 MHz"));
                }
                if !(100_000_000..=432_000_000).contains(&vco) {
                    return Err(format!("PLL VCO {vco} Hz, allowed 100 to 432 MHz"));
                }
            }
            _ => return Err("RCC_CFGR.SW = 3 is not allowed".into()),
        }
        let tree = self.tree();
        for (name, frequency, limit) in
            [("HCLK", tree.core, 168_000_000), ("PCLK1", tree.apb1, 42_000_000), ("PCLK2", tree.apb2, 84_000_000)]
        {
            if frequency > limit {
                return Err(format!("{name} {frequency} Hz, allowed {limit} Hz"));
            }
        }
        let needed = (tree.core.div_ceil(30_000_000) - 1) as u32;
        if latency < needed {
            return Err(format!("{latency} flash wait states at HCLK {} Hz, needed {needed}", tree.core));
        }
        Ok(())
    }
}

fn ahb_divider(code: u32) -> u64 {
    match code {
        0..=7 => 1,
        8..=11 => 2 << (code - 8),
        _ => 64 << (code - 12),
    }
}

/// Power control: voltage scale.
#[derive(Clone, Debug)]
pub(crate) struct Power {
    control: u32,
}

impl Power {
    pub(crate) fn new() -> Self {
        Self { control: 0x4000 }
    }

    pub(crate) fn read(&self, offset: u32) -> Option<u32> {
        const VOLTAGE_READY: u32 = 1 << 14;
        match offset {
            0 => Some(self.control),
            4 => Some(VOLTAGE_READY),
            _ => None,
        }
    }

    pub(crate) fn write(&mut self, offset: u32, value: u32) -> Option<()> {
        match offset {
            0 => self.control = value,
            4 => {}
            _ => return None,
        }
        Some(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LATER: Nanoseconds = Nanoseconds::from_millis(10);

    fn started() -> Rcc {
        let mut rcc = Rcc::new();
        rcc.write(PLLCFGR, 0x0740_2A04, Nanoseconds::ZERO, 5);
        rcc.write(CR, 0x81 | HSEON | PLLON, Nanoseconds::ZERO, 5);
        rcc
    }

    #[test]
    fn tree_is_worked_out_from_the_registers() {
        let mut rcc = started();
        assert_eq!(rcc.tree().core, 16_000_000);
        assert_eq!(rcc.read(CR, Nanoseconds::ZERO).unwrap() & HSERDY, 0);
        assert_eq!(rcc.write(CFGR, 0x9402, LATER, 5), Some(Ok(())));
        assert_eq!(
            rcc.tree(),
            ClockTree {
                system: 168_000_000,
                core: 168_000_000,
                apb1: 42_000_000,
                apb2: 84_000_000,
                apb1_timers: 84_000_000,
                apb2_timers: 168_000_000,
                from_crystal: true,
            }
        );
        assert_eq!(rcc.read(CFGR, LATER), Some(0x940A));
    }

    #[test]
    fn what_fails_on_the_part_is_refused() {
        let refused = |mut rcc: Rcc, value, now, latency| rcc.write(CFGR, value, now, latency).unwrap().unwrap_err();
        assert!(refused(started(), 0x9402, LATER, 4).contains("needed 5"));
        assert!(refused(started(), 0x9402, Nanoseconds::ZERO, 5).contains("not locked"));
        assert!(refused(started(), 0x8002, LATER, 5).contains("PCLK1 168000000"));
        let mut rcc = started();
        assert!(matches!(rcc.write(PLLCFGR, 0x0740_2A08, LATER, 5), Some(Err(_))));
    }

    /// Running from the PLL, with or without the clock security system.
    fn running(security: u32) -> Rcc {
        let mut rcc = started();
        rcc.write(CFGR, 0x9402, LATER, 5);
        rcc.write(CR, 0x81 | HSEON | PLLON | security, LATER, 5);
        rcc
    }

    #[test]
    fn a_crystal_that_fails_is_replaced_by_the_internal_oscillator_if_somebody_watches() {
        let mut rcc = running(SECURITY);
        assert!(rcc.fail_crystal() && !rcc.is_without_clock());
        assert_eq!(rcc.tree().core, 16_000_000);
        assert_eq!(rcc.read(CIR as u32, LATER).unwrap() & SECURITY_FLAG, SECURITY_FLAG);
        rcc.write(CIR as u32, SECURITY_CLEARED, LATER, 5);
        assert_eq!(rcc.read(CIR as u32, LATER).unwrap() & SECURITY_FLAG, 0);
        // It does not come again while the crystal is dead.
        rcc.write(CR, 0x81 | HSEON, LATER, 5);
        assert_eq!(rcc.read(CR, LATER + LATER).unwrap() & HSERDY, 0);
        rcc.mend_crystal(LATER);
        assert_eq!(rcc.read(CR, LATER + LATER).unwrap() & HSERDY, HSERDY);
    }

    #[test]
    fn a_crystal_that_fails_unwatched_leaves_the_core_without_a_clock() {
        let mut rcc = running(0);
        assert!(!rcc.fail_crystal() && rcc.is_without_clock());
    }

    #[test]
    fn the_flags_of_a_reset_stay_until_they_are_removed() {
        let mut rcc = Rcc::new();
        rcc.set_reset(0x2400_0000, true);
        rcc.write(CSR as u32, 1, LATER, 5);
        assert_eq!(rcc.read(CSR as u32, LATER), Some(0x2400_0003));
        rcc.write(CSR as u32, REMOVE_RESET_FLAGS, LATER, 5);
        assert_eq!(rcc.read(CSR as u32, LATER), Some(0));
    }
}
