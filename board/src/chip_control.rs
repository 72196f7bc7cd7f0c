//! Reset and straps of the SERCON816, and how the board is wired to it.
//!
//! RSTN has a pull-down on the board, so that the chip is held in reset until the straps are right; a chip in reset repeats
//! nothing and the ring stays open rather than disturbed.

use sercon816::{BitRate, MasterClock, Transceiver};
use stm32f4xx_hal::pac;

use crate::{clocks::HCLK_HZ, pins};

/// Clock at the chip's MCLK pin: SCLKO2, half of the 64 MHz oscillator at SCLK.
pub const MASTER_CLOCK: MasterClock = MasterClock::Mhz32;

/// Optical transceivers of the board: the wiring that is published.
pub const TRANSCEIVER: Transceiver = Transceiver::STANDARD;

/// RSTN low: at least 50 ns are asked for (sercon816.md 3.1); 10 us cost nothing and let slow edges settle.
const RESET_CYCLES: u32 = HCLK_HZ / 1_000_000 * 10;
/// Before the first access after reset. No figure is public; 1 ms is thousands of chip clocks.
const START_CYCLES: u32 = HCLK_HZ / 1_000;

/// Sets the straps and takes the chip through its reset. Takes 1.01 ms.
pub(crate) fn start(port: &pac::GPIOG, bit_rate: BitRate) {
    // SAFETY: every value is valid for BSRR; these two only touch the straps and the reset pin.
    port.bsrr().write(|w| unsafe { w.bits(straps(bit_rate) | pins::CHIP_RESET.mask() << 16) });
    cortex_m::asm::delay(RESET_CYCLES);
    // SAFETY: as above.
    port.bsrr().write(|w| unsafe { w.bits(pins::CHIP_RESET.mask()) });
    cortex_m::asm::delay(START_CYCLES);
}

/// BSRR value for (SBAUD, SBAUD16) of sercon816.md G15: (1,1) 2 Mbit/s, (0,1) 4, (1,0) 8, (0,0) 16.
const fn straps(bit_rate: BitRate) -> u32 {
    let (sbaud, sbaud16) = match bit_rate {
        BitRate::Mbit2 => (true, true),
        BitRate::Mbit4 => (false, true),
        BitRate::Mbit8 => (true, false),
        BitRate::Mbit16 => (false, false),
    };
    level(pins::STRAP_SBAUD, sbaud) | level(pins::STRAP_SBAUD16, sbaud16)
}

const fn level(pin: pins::Pin, high: bool) -> u32 {
    if high { pin.mask() } else { pin.mask() << 16 }
}
