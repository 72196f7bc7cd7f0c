//! Which pin carries which signal, as the board's pin table says; the audit checks that the binary agrees.

use crate::peripherals::gpio::PinMode;

/// A pin: port 0 = A, number.
pub type Pin = (usize, u8);

/// INT0 of the SERCON816: EXTI3, TIM2 channel 4.
pub const INT0: Pin = (0, 3);
/// INT1 of the SERCON816: EXTI2, TIM2 channel 3.
pub const INT1: Pin = (0, 2);
/// Encoder track A, TIM2 channel 1.
pub const ENCODER_A: Pin = (0, 0);
/// Encoder track B, TIM2 channel 2.
pub const ENCODER_B: Pin = (0, 1);
/// Analogue current command.
pub const CURRENT: Pin = (0, 4);
/// Amplifier enable, 1 = on.
pub const AMPLIFIER_ENABLE: Pin = (2, 6);
/// Main power present, 1 = present.
pub const MAIN_POWER: Pin = (2, 7);
/// Amplifier ready, 0 = fault.
pub const AMPLIFIER_READY: Pin = (2, 8);
/// Reset of the SERCON816, 0 = held in reset.
pub const CHIP_RESET: Pin = (6, 2);
/// Strap SBAUD.
pub const SBAUD: Pin = (6, 3);
/// Strap SBAUD16.
pub const SBAUD16: Pin = (6, 4);
/// Address switch contacts, bit 0 first; a closed contact pulls low and stands for 1.
pub const ADDRESS_SWITCHES: [Pin; 8] = [(6, 5), (6, 6), (6, 7), (6, 8), (6, 10), (6, 11), (6, 12), (6, 13)];
/// Bit-rate switch contacts, bit 0 first; a closed contact pulls low and stands for 1.
pub const BIT_RATE_SWITCHES: [Pin; 2] = [(6, 14), (6, 15)];

/// What the set-up must have made of a pin.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ExpectedPin {
    /// Signal name.
    pub signal: &'static str,
    /// The pin.
    pub pin: Pin,
    /// Its mode.
    pub mode: PinMode,
    /// 0 none, 1 up, 2 down.
    pub pull: u32,
    /// Smallest OSPEEDR code, 0 low to 3 very high.
    pub speed: u32,
}

/// The pin table.
#[must_use]
pub fn expected_pins() -> Vec<ExpectedPin> {
    const BUS: PinMode = PinMode::Alternate(12);
    const TIMER: PinMode = PinMode::Alternate(1);
    let mut pins = Vec::new();
    let mut add = |signal, pin, mode, pull, speed| {
        pins.push(ExpectedPin { signal, pin, mode, pull, speed });
    };
    // D0 to D15 and A0 to A11 of the FSMC on the LQFP144 package (data sheet, table of alternate functions).
    for number in [14, 15, 0, 1, 8, 9, 10] {
        add("FSMC data", (3, number), BUS, 0, 2);
    }
    for number in 7..=15 {
        add("FSMC data", (4, number), BUS, 0, 2);
    }
    for number in (0..=5).chain(12..=15) {
        add("FSMC address", (5, number), BUS, 0, 2);
    }
    for number in [0, 1] {
        add("FSMC address", (6, number), BUS, 0, 2);
    }
    add("FSMC NOE", (3, 4), BUS, 0, 2);
    add("FSMC NWE", (3, 5), BUS, 0, 2);
    add("FSMC NE1", (3, 7), BUS, 0, 2);
    add("FSMC NWAIT", (3, 6), BUS, 1, 0);
    add("INT1", INT1, TIMER, 1, 0);
    add("INT0", INT0, TIMER, 1, 0);
    add("encoder A", ENCODER_A, TIMER, 1, 0);
    add("encoder B", ENCODER_B, TIMER, 1, 0);
    add("current command", CURRENT, PinMode::Analogue, 0, 0);
    add("amplifier enable", AMPLIFIER_ENABLE, PinMode::Output, 0, 0);
    add("main power", MAIN_POWER, PinMode::Input, 2, 0);
    add("amplifier ready", AMPLIFIER_READY, PinMode::Input, 2, 0);
    add("chip reset", CHIP_RESET, PinMode::Output, 0, 0);
    add("SBAUD", SBAUD, PinMode::Output, 0, 0);
    add("SBAUD16", SBAUD16, PinMode::Output, 0, 0);
    for pin in ADDRESS_SWITCHES {
        add("address switch", pin, PinMode::Input, 1, 0);
    }
    for pin in BIT_RATE_SWITCHES {
        add("bit-rate switch", pin, PinMode::Input, 1, 0);
    }
    pins
}

/// `PA3` for (0, 3).
#[must_use]
pub fn pin_name((port, number): Pin) -> String {
    format!("P{}{number}", char::from(b'A' + port as u8))
}
