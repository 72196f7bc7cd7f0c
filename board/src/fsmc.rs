//! The SERCON816 on the external bus: FSMC bank 1, chip select NE1, 16 bit, asynchronous, mode A.
//!
//! Select wiring without glue logic (sercon816.md 3.2): MCSN0 = PCSN0 = NE1, MCSN1 = PCS1 = A12. On a 16-bit bank the FSMC puts byte
//! address bit n + 1 on its line number n, so the chip's A1..A11 are FSMC_A0..FSMC_A10 and its A12 is FSMC_A11.
//!
//! | what | byte address |
//! |---|---|
//! | dual-port RAM, word n of 2048 | 0x6000_0000 + 2 n |
//! | register n, 00H to 2AH | 0x6000_1000 + 2 n |
//!
//! The memory map of the core calls this window normal memory. That is harmless on a Cortex-M4: it has no data cache, does not
//! reorder or speculate data accesses, and never restarts a single half-word access.

use sercon816::{Bus, RamAddress, Register};
use stm32f4xx_hal::{
    pac,
    rcc::{Enable, Rcc},
};

/// Bus timing in HCLK cycles of 1/168 MHz = 5.95 ns.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Timing {
    /// Address and chip select before the strobe: 0 to 15 cycles.
    pub address_setup: u8,
    /// Strobe low: 1 to 255 cycles; a read samples at its end. The FSMC looks at NWAIT only up to four cycles before the end of
    /// this phase, so it must be at least 4 cycles + the delay from strobe to BUSYN (RM0090, asynchronous wait).
    pub data: u8,
    /// Idle between two accesses, 0 to 15 cycles: the chip's outputs must be off the bus.
    pub turnaround: u8,
}

impl Timing {
    /// Values for bring-up: the chip's access times are not public (sercon816.md G1), so this is as slow as the address phase
    /// can be made, and a strobe of 357 ns, several times that of any memory of the chip's age. One access takes about 0.55 us.
    /// Once RDN to BUSYN and RDN to data have been measured, G1 proposes 4, 24, 4 (0.2 us).
    pub const BRING_UP: Self = Self { address_setup: 15, data: 60, turnaround: 15 };

    /// Fields of BTR and BWTR, access mode A.
    const fn bits(self) -> u32 {
        // ADDHLD is not used in mode A, but 0 is a reserved value.
        const ADDRESS_HOLD: u32 = 1 << 4;
        assert!(self.address_setup <= 15 && self.data >= 1 && self.turnaround <= 15);
        self.address_setup as u32 | ADDRESS_HOLD | (self.data as u32) << 8 | (self.turnaround as u32) << 16
    }
}

const _: () = assert!(Timing::BRING_UP.bits() == 0x000F_3C1F);

/// Start of the dual-port RAM, chip address line A12 low.
const RAM: *mut u16 = 0x6000_0000 as *mut u16;
/// Start of the registers, chip address line A12 high.
const REGISTERS: *mut u16 = 0x6000_1000 as *mut u16;

/// Access path to the SERCON816. Exists only once the FSMC is set up; clones reach the same chip.
///
/// Every call is one half-word access of about 0.55 us, more while the chip holds BUSYN.
#[derive(Clone, Debug)]
pub struct SercosBus(());

impl SercosBus {
    /// Sets the bank up with [`Timing::BRING_UP`]. The pins must have been set up before.
    pub(crate) fn new(fsmc: pac::FSMC, rcc: &mut Rcc) -> Self {
        pac::FSMC::enable(rcc);
        set_timing(&fsmc, Timing::BRING_UP);
        // Written last and as a whole: the reset value has the bank enabled with multiplexed address and data.
        fsmc.bcr1().write(|w| {
            w.mtyp().sram().mwid().bits16().wren().enabled();
            w.muxen().disabled().faccen().disabled().bursten().disabled();
            // Mode A: read and write timing apart (EXTMOD), and NOE falls only after the address set-up time. In mode 1 it
            // would fall together with the chip select, and the chip would see a read strobe on an unsettled address.
            w.extmod().enabled();
            // BUSYN is active low. WAITEN is for synchronous memories; set as well so that both switches say "wait".
            w.waitpol().active_low().waiten().enabled().asyncwait().enabled();
            w.mbken().enabled()
        });
        Self(())
    }
}

/// Same timing for reading and writing.
fn set_timing(fsmc: &pac::FSMC, timing: Timing) {
    // SAFETY: `bits` is built of in-range fields only; CLKDIV and DATLAT, 0 here, are not used by asynchronous accesses.
    fsmc.btr1().write(|w| unsafe { w.bits(timing.bits()) });
    // SAFETY: as above; the reserved bits 27 to 20 of this register reset to 1 and are kept, as the manual asks.
    fsmc.bwtr1().write(|w| unsafe { w.bits(timing.bits() | 0x0FF0_0000) });
}

impl Bus for SercosBus {
    #[inline(always)]
    fn read_register(&mut self, register: Register) -> u16 {
        // SAFETY: `Register` is at most 2AH, inside the chip's register window; the address is aligned and no Rust object lives there.
        unsafe { REGISTERS.add(usize::from(register.word())).read_volatile() }
    }

    #[inline(always)]
    fn write_register(&mut self, register: Register, value: u16) {
        // SAFETY: as in `read_register`; what a write does, it does to the chip only, which has no access to our memory.
        unsafe { REGISTERS.add(usize::from(register.word())).write_volatile(value) }
    }

    #[inline(always)]
    fn read_ram(&mut self, address: RamAddress) -> u16 {
        // SAFETY: `RamAddress` is below 2048, inside the chip's RAM window; the address is aligned and no Rust object lives there.
        unsafe { RAM.add(usize::from(address.word())).read_volatile() }
    }

    #[inline(always)]
    fn write_ram(&mut self, address: RamAddress, value: u16) {
        // SAFETY: as in `read_ram`; all 2048 words may be written at any time, meaning is the driver's concern.
        unsafe { RAM.add(usize::from(address.word())).write_volatile(value) }
    }
}
