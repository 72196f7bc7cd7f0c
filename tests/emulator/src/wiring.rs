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

/// Gate signals of the high sides, phases U, V, W: TIM1 channels 1 to 3.
pub const HIGH_SIDES: [Pin; 3] = [(0, 8), (0, 9), (0, 10)];
/// Gate signals of the low sides: TIM1 channels 1N to 3N.
pub const LOW_SIDES: [Pin; 3] = [(1, 13), (1, 14), (1, 15)];
/// Fault of the gate drivers, TIM1 break input, 0 = tripped.
pub const BREAK: Pin = (1, 12);
/// Phase currents U, V, W: first rank of ADC1, ADC2, ADC3.
pub const PHASE_CURRENTS: [Pin; 3] = [(2, 0), (2, 1), (2, 2)];
/// Bus voltage, second rank of ADC1.
pub const BUS_VOLTAGE: Pin = (2, 3);
/// Temperature of the heat sink, second rank of ADC2.
pub const HEAT_SINK_TEMPERATURE: Pin = (2, 4);
/// Temperature of the motor, second rank of ADC3.
pub const MOTOR_TEMPERATURE: Pin = (5, 6);
/// Channels of the injected sequences of ADC1, ADC2 and ADC3: phase current, then a slow quantity.
pub const ADC_SEQUENCES: [[u8; 2]; 3] = [[10, 13], [11, 14], [12, 4]];
/// Tracks A and B at TIM3.
pub const ENCODER_TIM3: [Pin; 2] = [(1, 4), (1, 5)];
/// Encoder index, TIM3 channel 3.
pub const INDEX: Pin = (1, 0);
/// Tracks A and B at TIM4.
pub const ENCODER_TIM4: [Pin; 2] = [(1, 6), (1, 7)];
/// Probe 1, TIM4 channel 3 (and 4, crossed).
pub const PROBE_1: Pin = (1, 8);
/// Tracks A and B at TIM8.
pub const ENCODER_TIM8: [Pin; 2] = [(2, 6), (2, 7)];
/// Probe 2, TIM8 channel 3 (and 4, crossed).
pub const PROBE_2: Pin = (2, 8);
/// INT0 once more, TIM9 channel 1.
pub const INT0_TIME: Pin = (4, 5);
/// INT1 once more, TIM9 channel 2.
pub const INT1_TIME: Pin = (4, 6);
/// Main power, 1 = DC link charged.
pub const MAIN_POWER: Pin = (2, 9);
/// Safe torque off, channel 1, 1 = torque allowed.
pub const STO_1: Pin = (2, 10);
/// Safe torque off, channel 2, 1 = torque allowed.
pub const STO_2: Pin = (2, 11);
/// Home switch.
pub const HOME_SWITCH: Pin = (2, 12);
/// Contact of the holding brake.
pub const BRAKE_FEEDBACK: Pin = (2, 13);
/// Coil of the holding brake, 1 = energised.
pub const BRAKE_COIL: Pin = (2, 5);

/// Switch of the brake chopper, 1 = resistor on.
pub const CHOPPER: Pin = (5, 11);

/// The pin that an ADC (1 to 3) converts on a channel; `None` for the sources inside the part (data sheet, pin definitions).
#[must_use]
pub fn analogue_pin(adc: usize, channel: u8) -> Option<Pin> {
    const OF_ADC_3: [u8; 5] = [6, 7, 8, 9, 10];
    match (adc, channel) {
        (3, 4..=8) => Some((5, OF_ADC_3[usize::from(channel - 4)])),
        (3, 9) => Some((5, 3)),
        (3, 14 | 15) => Some((5, channel - 10)),
        (_, 0..=7) => Some((0, channel)),
        (_, 8 | 9) => Some((1, channel - 8)),
        (_, 10..=15) => Some((2, channel - 10)),
        _ => None,
    }
}

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
    for (pins, function) in [(ENCODER_TIM3, 2), (ENCODER_TIM4, 2), (ENCODER_TIM8, 3), ([INT0_TIME, INT1_TIME], 3)] {
        for pin in pins {
            add("encoder or interrupt line once more", pin, PinMode::Alternate(function), 1, 0);
        }
    }
    for (signal, pin, function) in [("index", INDEX, 2), ("probe 1", PROBE_1, 2), ("probe 2", PROBE_2, 3)] {
        add(signal, pin, PinMode::Alternate(function), 2, 0);
    }
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

/// The pin table of the power stage on the board, beside [`expected_pins`].
#[must_use]
pub fn power_stage_pins() -> Vec<ExpectedPin> {
    let mut pins = Vec::new();
    let mut add = |signal, pins_of_signal: &[Pin], mode, pull| {
        pins.extend(pins_of_signal.iter().map(|pin| ExpectedPin { signal, pin: *pin, mode, pull, speed: 0 }));
    };
    add("high side", &HIGH_SIDES, PinMode::Alternate(1), 2);
    add("low side", &LOW_SIDES, PinMode::Alternate(1), 2);
    add("break input", &[BREAK], PinMode::Alternate(1), 2);
    add("phase current", &PHASE_CURRENTS, PinMode::Analogue, 0);
    add("bus voltage", &[BUS_VOLTAGE], PinMode::Analogue, 0);
    add("heat sink temperature", &[HEAT_SINK_TEMPERATURE], PinMode::Analogue, 0);
    add("motor temperature", &[MOTOR_TEMPERATURE], PinMode::Analogue, 0);
    for (signal, pin) in [
        ("main power", MAIN_POWER),
        ("STO 1", STO_1),
        ("STO 2", STO_2),
        ("home switch", HOME_SWITCH),
        ("brake feedback", BRAKE_FEEDBACK),
    ] {
        add(signal, &[pin], PinMode::Input, 2);
    }
    add("brake coil", &[BRAKE_COIL], PinMode::Output, 0);
    add("brake chopper", &[CHOPPER], PinMode::Output, 0);
    pins
}

/// `PA3` for (0, 3).
#[must_use]
pub fn pin_name((port, number): Pin) -> String {
    format!("P{}{number}", char::from(b'A' + port as u8))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_sequences_convert_the_pins_of_their_signals() {
        let pins = |adc: usize| ADC_SEQUENCES[adc - 1].map(|channel| analogue_pin(adc, channel));
        assert_eq!(pins(1), [Some(PHASE_CURRENTS[0]), Some(BUS_VOLTAGE)]);
        assert_eq!(pins(2), [Some(PHASE_CURRENTS[1]), Some(HEAT_SINK_TEMPERATURE)]);
        assert_eq!(pins(3), [Some(PHASE_CURRENTS[2]), Some(MOTOR_TEMPERATURE)]);
        assert_eq!(analogue_pin(1, 16), None);
    }
}
