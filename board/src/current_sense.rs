//! Phase currents, DC link voltage and temperatures: the three converters together, started by TIM1 once in every PWM period.
//!
//! | converter | first | then |
//! |---|---|---|
//! | ADC1 | PC0, IN10: current of phase A | PC3, IN13: DC link voltage |
//! | ADC2 | PC1, IN11: current of phase B | PC4, IN14: temperature of the heat sink |
//! | ADC3 | PC2, IN12: current of phase C | PF6, IN4: temperature of the motor |
//!
//! The three currents are sampled at the same instant, the middle of the low-side pulses: there the ripple passes through its mean, and
//! shunts in the low-side emitters carry the phase currents. The trigger comes earlier by [`TRIGGER_TO_HOLD`]; with the
//! conversions it makes this time line, in cycles of the converters' 21 MHz:
//!
//! ```text
//! trigger      sampling ends, peak of TIM1     second sampling ends       both converted, interrupt
//!    0    3 + 15 = 18  (0.86 us)                 3 + 27 + 15 = 45           3 + 2 x 27 = 57
//!                    0                                                        39 = 1.86 us
//! ```
//!
//! [`SENSING`] says where the currents are measured, and `servo` works with either:
//!
//! * Sensors in the lines to the motor (magnetic ones, or shunts with isolated amplifiers) show the current at every instant.
//! * Shunts in the low-side emitters are cheaper and show it only while the low side conducts. Their amplifier settles after each turning on, and
//!   [`SAMPLING_NANOSECONDS`] of the converter must lie behind that: with a dead time of 1 us and an amplifier that settles to 1 % in 1.2 us a phase
//!   can be read up to a compare value of 4 760 of 5 250. Amplifiers slower than 1.9 us do not compile.
//!
//! The sources need an impedance of at most 11 kilohm at a sampling time of 15 cycles (data sheet, RAIN), which the current amplifiers are
//! far below; dividers of voltage and temperatures have a capacitor of 100 nF at the pin, which holds the level for the converter.

use drive::{CurrentSensing, Samples};
use stm32f4xx_hal::{
    pac,
    rcc::{Enable, Rcc},
};

use crate::clocks::{APB2_TIMER_HZ, HCLK_HZ};

/// Clock of the converters: APB2's 84 MHz divided by 4. 36 MHz are allowed; the next faster one, 42 MHz, is not.
const CONVERTER_HZ: u32 = APB2_TIMER_HZ / 2 / 4;
/// From trigger to sampling: at most 3 cycles (data sheet, trigger conversion latency of the injected group).
const LATENCY: u32 = 3;
/// Sampling time, the same for all: channels that convert at the same time must have it (RM0090 13.9).
const SAMPLING: u32 = 15;
/// Successive approximation of 12 bits.
const APPROXIMATION: u32 = 12;
/// Conversions of a sequence.
const CONVERSIONS: u32 = 2;

/// From the trigger to the end of the first sampling, when the currents are held, in counts of TIM1.
pub const TRIGGER_TO_HOLD: u16 = timer_counts(LATENCY + SAMPLING);
/// From there to the interrupt, in counts of TIM1: 1.86 us.
pub const HOLD_TO_INTERRUPT: u16 = timer_counts(LATENCY + CONVERSIONS * (SAMPLING + APPROXIMATION)) - TRIGGER_TO_HOLD;

/// From the hold to the reading of the encoder, with some 50 cycles of the processor until the handler has got there: 2.15 us.
pub const HOLD_TO_COUNT_NANOSECONDS: u16 = ((HOLD_TO_INTERRUPT as u32 + 50) * 1_000 / (HCLK_HZ / 1_000_000)) as u16;

/// For which the converter needs a level to stand still, in ns: 714.
pub const SAMPLING_NANOSECONDS: u32 = (SAMPLING * 1_000).div_ceil(CONVERTER_HZ / 1_000_000);

/// Where this board measures its phase currents. On shunts it would be
/// `CurrentSensing::LowSideShunts { settling: 1_200, sampling: SAMPLING_NANOSECONDS }`, with the settling time of their amplifier.
pub const SENSING: CurrentSensing = CurrentSensing::InLine;

const fn timer_counts(converter_cycles: u32) -> u16 {
    converter_cycles.wrapping_mul(APB2_TIMER_HZ / CONVERTER_HZ) as u16
}

/// Converters are stable 3 us after they were switched on (data sheet, tSTAB); 10 us cost nothing.
const STABILISATION_CYCLES: u32 = HCLK_HZ / 1_000_000 * 10;

/// Channels of ADC1 to ADC3, in the order in which they are converted.
const CHANNELS: [[u8; CONVERSIONS as usize]; 3] = [[10, 13], [11, 14], [12, 4]];

/// The three converters; owned by the current loop.
#[derive(Debug)]
pub struct CurrentSense {
    converters: (pac::ADC1, pac::ADC2, pac::ADC3),
}

impl CurrentSense {
    /// Switches the converters on and lets them wait for TIM1, which must not run yet. Takes 10 us.
    pub(crate) fn new(converters: (pac::ADC1, pac::ADC2, pac::ADC3), common: &pac::ADC_COMMON, rcc: &mut Rcc) -> Self {
        pac::ADC1::enable(rcc);
        pac::ADC2::enable(rcc);
        pac::ADC3::enable(rcc);
        // Clock and mode while all three are off: a converter that was on already could start on its own.
        common.ccr().write(|w| w.adcpre().div4().multi().triple_j());
        let (adc1, adc2, adc3) = &converters;
        for (adc, channels) in [&**adc1, &**adc2, &**adc3].into_iter().zip(CHANNELS) {
            set_up(adc, channels);
        }
        cortex_m::asm::delay(STABILISATION_CYCLES);
        // The trigger goes to the master alone: one that reached a slave as well could start it twice (RM0090 13.9).
        adc1.cr2().write(|w| w.adon().enabled().jextsel().tim1trgo().jexten().rising_edge());
        adc1.cr1().write(|w| w.scan().enabled().jeocie().enabled());
        Self { converters }
    }

    /// Currents and voltage of this period.
    ///
    /// The registers as they are: what is above the 12 bits is reserved and read as 0.
    #[inline(always)]
    pub fn read(&self) -> Samples {
        let (adc1, adc2, adc3) = &self.converters;
        Samples {
            currents: [adc1.jdr1().read().bits(), adc2.jdr1().read().bits(), adc3.jdr1().read().bits()],
            bus: adc1.jdr2().read().bits(),
        }
    }

    /// Temperatures of heat sink and motor.
    #[inline(always)]
    pub fn temperatures(&self) -> [u32; 2] {
        let (_, adc2, adc3) = &self.converters;
        [adc2.jdr2().read().bits(), adc3.jdr2().read().bits()]
    }

    /// Clears the interrupt; to be called first in the handler.
    ///
    /// The samples stay until the next period has been converted, 62.5 us later at 16 kHz.
    #[inline(always)]
    pub fn acknowledge(&mut self) {
        // SAFETY: every value is valid for SR, whose bits are cleared by 0 and untouched by 1.
        self.converters.0.sr().write(|w| unsafe { w.bits(!(JEOC | JSTRT)) });
    }
}

/// End and start of the injected group, bits of ADC_SR.
const JEOC: u32 = 1 << 2;
const JSTRT: u32 = 1 << 3;

/// Sequence and sampling times, then power on; starts nothing.
fn set_up(adc: &pac::adc1::RegisterBlock, channels: [u8; CONVERSIONS as usize]) {
    // SAFETY: `sequence` and `sampling` fill their fields with defined values only, and leave the reserved bits 0.
    unsafe {
        adc.jsqr().write(|w| w.bits(sequence(channels)));
        let [low, high] = sampling(channels);
        adc.smpr2().write(|w| w.bits(low));
        adc.smpr1().write(|w| w.bits(high));
    }
    adc.cr1().write(|w| w.scan().enabled());
    adc.cr2().write(|w| w.adon().enabled());
}

/// JSQR. A sequence of two is converted from JSQ3 to JSQ4, its results are in JDR1 and JDR2 (RM0090 13.13.12).
const fn sequence([first, second]: [u8; CONVERSIONS as usize]) -> u32 {
    assert!(first <= 18 && second <= 18);
    (CONVERSIONS - 1) << 20 | (second as u32) << 15 | (first as u32) << 10
}

/// SMPR2 (channels 0 to 9) and SMPR1 (10 to 18): three bits a channel, 001 is 15 cycles.
const fn sampling([first, second]: [u8; CONVERSIONS as usize]) -> [u32; 2] {
    const CYCLES_15: u64 = 0b001;
    // SMPR1 follows SMPR2 as if it were its upper half, but for the two unused bits above channel 9.
    let both = CYCLES_15 << (first as u32).wrapping_mul(3) | CYCLES_15 << (second as u32).wrapping_mul(3);
    [(both & 0x3FFF_FFFF) as u32, (both >> 30) as u32]
}

const _: () = {
    assert!(CONVERTER_HZ == 21_000_000);
    assert!(CONVERTER_HZ * 8 == APB2_TIMER_HZ, "converters and TIM1 keep step");
    assert!(TRIGGER_TO_HOLD == 144 && HOLD_TO_INTERRUPT == 312);
    assert!(CHANNELS[0][0] != CHANNELS[1][0] && CHANNELS[1][0] != CHANNELS[2][0] && CHANNELS[0][0] != CHANNELS[2][0]);

    assert!(sequence([10, 13]) == 0x0016_A800);
    assert!(sequence([11, 14]) == 0x0017_2C00);
    assert!(sequence([12, 4]) == 0x0012_3000);

    let [low, high] = sampling([10, 13]);
    assert!(low == 0 && high == 1 | 1 << 9);
    let [low, high] = sampling([12, 4]);
    assert!(low == 1 << 12 && high == 1 << 6);
    let [low, high] = sampling([9, 18]);
    assert!(low == 1 << 27 && high == 1 << 24);

    assert!(!(JEOC | JSTRT) & 0x3F == 0x33);
};
