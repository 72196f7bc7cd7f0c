//! The memory map of the part, as far as there are models: where a peripheral is and which bit clocks it (RM0090 2.3 and 7.3).

pub(super) const TIM2: u32 = 0x4000_0000;
pub(super) const TIM3: u32 = 0x4000_0400;
pub(super) const TIM4: u32 = 0x4000_0800;
pub(super) const TIM5: u32 = 0x4000_0C00;
pub(super) const WWDG: u32 = 0x4000_2C00;
pub(super) const IWDG: u32 = 0x4000_3000;
pub(super) const PWR: u32 = 0x4000_7000;
pub(super) const TIM1: u32 = 0x4001_0000;
pub(super) const TIM8: u32 = 0x4001_0400;
pub(super) const ADC: u32 = 0x4001_2000;
pub(super) const TIM9: u32 = 0x4001_4000;
pub(super) const SYSCFG: u32 = 0x4001_3800;
pub(super) const EXTI: u32 = 0x4001_3C00;
pub(super) const GPIO: u32 = 0x4002_0000;
pub(super) const GPIO_END: u32 = 0x4002_2400;
pub(super) const RCC: u32 = 0x4002_3800;
pub(super) const FLASH: u32 = 0x4002_3C00;
pub(super) const FSMC: u32 = 0xA000_0000;
pub(super) const BIT_BAND: u32 = 0x4200_0000;
pub(super) const BIT_BAND_END: u32 = 0x4400_0000;
pub(super) const PERIPHERALS: u32 = 0x4000_0000;

/// Address lines A0 to A11 of a 16-bit bank: 8 KiB.
pub(super) const EXTERNAL_BYTES: u32 = 0x2000;

/// Timers in the order of `EncoderCounters`.
pub(super) const ENCODER_COUNTERS: [u32; 5] = [TIM2, TIM3, TIM4, TIM8, TIM9];

/// Clock enable of the peripheral at an address: offset of the register in RCC, bit. `None` where there is none to enable.
pub(super) fn clock_enable(address: u32) -> Option<(u32, u32)> {
    const AHB1: u32 = 0x30;
    const AHB3: u32 = 0x38;
    const APB1: u32 = 0x40;
    const APB2: u32 = 0x44;
    Some(match address & !0x3FF {
        TIM1 => (APB2, 0),
        TIM8 => (APB2, 1),
        ADC => match address & 0x300 {
            0x100 => (APB2, 9),
            0x200 => (APB2, 10),
            // The common registers are clocked with ADC1.
            _ => (APB2, 8),
        },
        TIM9 => (APB2, 16),
        TIM2 => (APB1, 0),
        TIM3 => (APB1, 1),
        TIM4 => (APB1, 2),
        TIM5 => (APB1, 3),
        WWDG => (APB1, 11),
        PWR => (APB1, 28),
        SYSCFG => (APB2, 14),
        FSMC => (AHB3, 0),
        page @ GPIO..GPIO_END => (AHB1, port_of(page) as u32),
        _ => return None,
    })
}

pub(super) fn is_timer(page: u32) -> bool {
    ENCODER_COUNTERS.contains(&page) || [TIM1, TIM5].contains(&page)
}

pub(super) fn counter_of(page: u32) -> usize {
    ENCODER_COUNTERS.iter().position(|base| *base == page).unwrap_or_default()
}

pub(super) fn port_of(page: u32) -> usize {
    ((page - GPIO) / 0x400) as usize
}

/// The word behind a bit-band address, and the bit in it.
pub(super) fn bit_band(address: u32) -> (u32, u32) {
    let offset = address - BIT_BAND;
    let byte = PERIPHERALS + offset / 32;
    (byte & !3, (byte & 3) * 8 + offset / 4 % 8)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bit_band_addresses_name_one_bit() {
        // RCC_AHB1ENR bit 6, as the hardware abstraction layer computes it.
        let address = 0x4200_0000 + (0x2_3800 + 0x30) * 32 + 6 * 4;
        assert_eq!(bit_band(address), (0x4002_3830, 6));
        let address = 0x4200_0000 + (0x2_3800 + 0x40) * 32 + 29 * 4;
        assert_eq!(bit_band(address), (0x4002_3840, 29));
    }
}
