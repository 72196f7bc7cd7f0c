//! Clock tree: 168 MHz from an 8 MHz crystal.
//!
//! | clock | frequency | why |
//! |---|---|---|
//! | HSE | 8 MHz | crystal at PH0/PH1: +-30 ppm parts are common, and the ring tolerates +-100 ppm |
//! | SYSCLK, HCLK | 168 MHz | the part's maximum; core and FSMC |
//! | APB1, its timers | 42, 84 MHz | APB1 maximum; TIM2 to TIM6 count at twice the bus clock |
//! | APB2, its timers | 84, 168 MHz | APB2 maximum; EXTI, SYSCFG; TIM1, TIM8, TIM9 count at twice the bus clock |
//! | converters | 21 MHz | a quarter of APB2, see [`crate::current_sense`] |
//!
//! A crystal that fails would leave the timers of the bridge without a clock, with whatever voltage is on at that instant. The clock security
//! system breaks TIM1 without the processor (RM0090 7.2.7, 17.3.12), puts the 16 MHz oscillator into the crystal's place and raises NMI.
//!
//! The PLL comes out as M = 4, N = 168, P = 2 (VCO 336 MHz). Voltage scale 1, which 168 MHz needs, is the reset value of PWR_CR.
//! The clock of the SERCON816 (SCLK 64 MHz, MCLK 32 MHz) does not come from here, see the pin table.

use stm32f4xx_hal::{
    pac,
    prelude::_fugit_RateExtU32,
    rcc::{Config, Rcc, RccExt},
};

/// Crystal frequency, in hertz.
pub const HSE_HZ: u32 = 8_000_000;
/// Core and AHB clock (FSMC), in hertz.
pub const HCLK_HZ: u32 = 168_000_000;
/// Clock of the APB1 timers (TIM2 to TIM6), in hertz.
pub const APB1_TIMER_HZ: u32 = 84_000_000;
/// Clock of the APB2 timers (TIM1, TIM8, TIM9), in hertz.
pub const APB2_TIMER_HZ: u32 = 168_000_000;

/// Switches to the PLL and sets the flash wait states (5), prefetch and caches. From here on the clock security system watches the crystal.
pub(crate) fn start(rcc: pac::RCC) -> Rcc {
    let rcc = rcc.freeze(
        Config::hse(HSE_HZ.Hz())
            .sysclk(HCLK_HZ.Hz())
            .hclk(HCLK_HZ.Hz())
            .pclk1((APB1_TIMER_HZ / 2).Hz())
            .pclk2((APB2_TIMER_HZ / 2).Hz()),
    );
    rcc.cr().modify(|_, w| w.csson().on());
    rcc
}
