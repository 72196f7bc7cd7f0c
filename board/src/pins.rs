//! The pin table: what every used lead of the LQFP144 does, and the code that sets it up, from the same constants.
//!
//! | signal | pin | lead | function | wired to |
//! |---|---|---|---|---|
//! | D0 D1 D2 D3 | PD14 PD15 PD0 PD1 | 85 86 114 115 | AF12 | SERCON816 D0 to D3, through a 5 V translator |
//! | D4 to D12 | PE7 to PE15 | 58 59 60 63 to 68 | AF12 | SERCON816 D4 to D12 |
//! | D13 D14 D15 | PD8 PD9 PD10 | 77 78 79 | AF12 | SERCON816 D13 to D15 |
//! | A0 to A5 | PF0 to PF5 | 10 to 15 | AF12 | SERCON816 A1 to A6 |
//! | A6 to A9 | PF12 to PF15 | 50 53 54 55 | AF12 | SERCON816 A7 to A10 |
//! | A10 | PG0 | 56 | AF12 | SERCON816 A11 |
//! | A11 | PG1 | 57 | AF12 | SERCON816 A12, MCSN1, PCS1: RAM (0) or registers (1) |
//! | NOE, NWE | PD4, PD5 | 118, 119 | AF12 | SERCON816 RDN, WRN |
//! | NWAIT | PD6 | 122 | AF12, pull-up | SERCON816 BUSYN; open reads "ready" |
//! | NE1 | PD7 | 123 | AF12 | SERCON816 MCSN0, PCSN0 |
//! | INT1 | PA2 | 36 | AF1 TIM2_CH3, EXTI2, pull-up | SERCON816 INT1 |
//! | INT0 | PA3 | 37 | AF1 TIM2_CH4, EXTI3, pull-up | SERCON816 INT0 |
//! | encoder A, B | PA0, PA1 | 34, 35 | AF1 TIM2_CH1, CH2, pull-up | line receivers of the encoder |
//! | the same | PB4, PB5 | 134, 135 | AF2 TIM3_CH1, CH2, pull-up | the same receivers |
//! | the same | PB6, PB7 | 136, 137 | AF2 TIM4_CH1, CH2, pull-up | the same receivers |
//! | the same | PC6, PC7 | 96, 97 | AF3 TIM8_CH1, CH2, pull-up | the same receivers |
//! | index | PB0 | 46 | AF2 TIM3_CH3, pull-down | line receiver of the encoder |
//! | probe 1 | PB8 | 139 | AF2 TIM4_CH3, pull-down | touch probe, 1 = touched |
//! | probe 2 | PC8 | 98 | AF3 TIM8_CH3, pull-down | touch probe, 1 = touched |
//! | time of INT0, INT1 | PE5, PE6 | 4, 5 | AF3 TIM9_CH1, CH2, pull-up | SERCON816 INT0 and INT1, as PA3 and PA2 |
//! | high sides A, B, C | PA8, PA9, PA10 | 100 to 102 | AF1 TIM1_CH1 to CH3, pull-down | gate drivers, 1 = on, pull-down there |
//! | low sides A, B, C | PB13, PB14, PB15 | 74 to 76 | AF1 TIM1_CH1N to CH3N, pull-down | gate drivers, 1 = on, pull-down there |
//! | break | PB12 | 73 | AF1 TIM1_BKIN, pull-down | gate drivers and overcurrent comparator, 1 = no fault |
//! | currents A, B, C | PC0, PC1, PC2 | 26 to 28 | analogue, IN10 to IN12 | current amplifiers, half of the supply = 0 A |
//! | DC link voltage | PC3 | 29 | analogue, IN13 | divider |
//! | temperature, heat sink | PC4 | 44 | analogue, IN14 | sensor of the power module (5 kOhm, negative coefficient) to ground, 2.2 kOhm to VREF+ |
//! | temperature, motor | PF6 | 18 | analogue, ADC3_IN4 | sensor in the winding (P-0-0134) to ground, 2.2 kOhm to VREF+ |
//! | brake coil | PC5 | 45 | output, low at start | coil driver, 1 = released, pull-down there |
//! | brake chopper | PF11 | 49 | output, low at start | driver of the chopper's switch, 1 = resistor on, pull-down there |
//! | main power | PC9 | 99 | input, pull-down | charging circuit, 1 = DC link charged |
//! | safe torque off 1, 2 | PC10, PC11 | 111, 112 | input, pull-down | safety circuit, 1 = torque permitted |
//! | home switch | PC12 | 113 | input, pull-down | switch to the supply, 1 = actuated |
//! | brake feedback | PC13 | 7 | input, pull-down | brake, 1 = released |
//! | chip reset | PG2 | 87 | output, low at start | SERCON816 RSTN, pull-down |
//! | SBAUD, SBAUD16 | PG3, PG4 | 88, 89 | output, high at start | SERCON816 SBAUD, SBAUD16 |
//! | address, low digit | PG5 to PG8 | 90 to 93 | input, pull-up | hexadecimal rotary switch to ground |
//! | address, high digit | PG10 to PG13 | 125 to 128 | input, pull-up | hexadecimal rotary switch to ground |
//! | baud rate | PG14, PG15 | 129, 132 | input, pull-up | switches to ground |
//! | SWDIO, SWCLK | PA13, PA14 | 105, 109 | as after reset | debug connector |
//! | OSC_IN, OSC_OUT | PH0, PH1 | 23, 24 | as after reset | crystal, 8 MHz |
//!
//! SERCON816 pins that no pin here drives (sercon816.md 3.1): SCLK from an own 64 MHz oscillator, MCLK = 32 MHz from the chip's SCLKO2
//! (OUTZ = 0); ADMUX = 0, BUSMODE0 = 0 (Intel strobes), BUSWIDTH = 1, BYTEDIR = 0, BHEN = A0 = 0, ALEL = ALEH = 1,
//! TM0 = TM1 = 1, DMA acknowledges inactive.
//!
//! Leads and signals agree with the pin data that ST publishes for the STM32F407Z(E-G)T in LQFP144.
//!
//! Kept free for what comes: ADC and DAC (PA4 to PA7, PB1), a 32 kHz crystal (PC14, PC15), NE2 (PG9) for a W5100 on the same bus, USART3 (PB10, PB11), trace output (PB3).

use stm32f4xx_hal::pac;

/// GPIO port.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Port {
    /// PA0 to PA15.
    A = 0,
    /// PB0 to PB15.
    B = 1,
    /// PC0 to PC15.
    C = 2,
    /// PD0 to PD15.
    D = 3,
    /// PE0 to PE15.
    E = 4,
    /// PF0 to PF15.
    F = 5,
    /// PG0 to PG15.
    G = 6,
}

/// Resistor inside the part, about 40 kilohm.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pull {
    /// None: the other side always drives.
    None = 0b00,
    /// To the supply.
    Up = 0b01,
    /// To ground.
    Down = 0b10,
}

/// What a pin does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Function {
    /// Digital input.
    Input(Pull),
    /// Push-pull output with the level it starts with.
    Output(Level),
    /// Belongs to a peripheral, by alternate function number.
    Alternate(u8, Pull),
    /// Digital part disconnected.
    Analogue,
}

/// Level of an output.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Level {
    /// Ground.
    Low,
    /// Supply.
    High,
}

/// One used pin.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Pin {
    /// Its port.
    pub port: Port,
    /// Its number in the port, 0 to 15.
    pub number: u8,
    /// What it is set up for.
    pub function: Function,
}

impl Pin {
    const fn new(port: Port, number: u8, function: Function) -> Self {
        assert!(number < 16);
        Self { port, number, function }
    }

    /// The pin's bit in IDR, ODR and the lower half of BSRR.
    #[must_use]
    pub const fn mask(self) -> u32 {
        1 << self.number
    }
}

/// Alternate function of TIM1 and TIM2.
const TIMER: u8 = 1;
/// Alternate function of TIM3 and TIM4.
const TIMER_3_4: u8 = 2;
/// Alternate function of TIM8 and TIM9.
const TIMER_8_9: u8 = 3;
/// Alternate function of the FSMC.
const FSMC: u8 = 12;

const fn bus(port: Port, number: u8) -> Pin {
    Pin::new(port, number, Function::Alternate(FSMC, Pull::None))
}

const fn timer(number: u8) -> Pin {
    Pin::new(Port::A, number, Function::Alternate(TIMER, Pull::Up))
}

/// Input of a gate driver: held low until TIM1 drives it.
const fn gate(port: Port, number: u8) -> Pin {
    Pin::new(port, number, Function::Alternate(TIMER, Pull::Down))
}

/// Digital input that reads 0 when its wire is broken.
const fn active_high(number: u8) -> Pin {
    Pin::new(Port::C, number, Function::Input(Pull::Down))
}

const fn analogue(port: Port, number: u8) -> Pin {
    Pin::new(port, number, Function::Analogue)
}

const fn switch(number: u8) -> Pin {
    Pin::new(Port::G, number, Function::Input(Pull::Up))
}

/// FSMC_D0 to FSMC_D15.
pub const BUS_DATA: [Pin; 16] = [
    bus(Port::D, 14),
    bus(Port::D, 15),
    bus(Port::D, 0),
    bus(Port::D, 1),
    bus(Port::E, 7),
    bus(Port::E, 8),
    bus(Port::E, 9),
    bus(Port::E, 10),
    bus(Port::E, 11),
    bus(Port::E, 12),
    bus(Port::E, 13),
    bus(Port::E, 14),
    bus(Port::E, 15),
    bus(Port::D, 8),
    bus(Port::D, 9),
    bus(Port::D, 10),
];
/// FSMC_A0 to FSMC_A11: A1 to A12 of the chip.
pub const BUS_ADDRESS: [Pin; 12] = [
    bus(Port::F, 0),
    bus(Port::F, 1),
    bus(Port::F, 2),
    bus(Port::F, 3),
    bus(Port::F, 4),
    bus(Port::F, 5),
    bus(Port::F, 12),
    bus(Port::F, 13),
    bus(Port::F, 14),
    bus(Port::F, 15),
    bus(Port::G, 0),
    bus(Port::G, 1),
];
/// FSMC_NOE, FSMC_NWE, FSMC_NE1.
pub const BUS_STROBES: [Pin; 3] = [bus(Port::D, 4), bus(Port::D, 5), bus(Port::D, 7)];
/// FSMC_NWAIT, from BUSYN of the chip.
pub const BUS_WAIT: Pin = Pin::new(Port::D, 6, Function::Alternate(FSMC, Pull::Up));
/// Encoder tracks A and B.
pub const ENCODER: [Pin; 2] = [timer(0), timer(1)];
/// INT1 of the chip: TIM2_CH3 and EXTI2.
pub const CHIP_INT1: Pin = timer(2);
/// INT0 of the chip: TIM2_CH4 and EXTI3.
pub const CHIP_INT0: Pin = timer(3);
/// INT0 and INT1 of the chip once more: TIM9_CH1 and CH2.
pub const CHIP_EDGES: [Pin; 2] = [
    Pin::new(Port::E, 5, Function::Alternate(TIMER_8_9, Pull::Up)),
    Pin::new(Port::E, 6, Function::Alternate(TIMER_8_9, Pull::Up)),
];
/// Encoder tracks A and B once more: of TIM3, TIM4 and TIM8.
pub const ENCODER_COPIES: [Pin; 6] = [
    Pin::new(Port::B, 4, Function::Alternate(TIMER_3_4, Pull::Up)),
    Pin::new(Port::B, 5, Function::Alternate(TIMER_3_4, Pull::Up)),
    Pin::new(Port::B, 6, Function::Alternate(TIMER_3_4, Pull::Up)),
    Pin::new(Port::B, 7, Function::Alternate(TIMER_3_4, Pull::Up)),
    Pin::new(Port::C, 6, Function::Alternate(TIMER_8_9, Pull::Up)),
    Pin::new(Port::C, 7, Function::Alternate(TIMER_8_9, Pull::Up)),
];
/// Index of the encoder: TIM3_CH3.
pub const INDEX: Pin = Pin::new(Port::B, 0, Function::Alternate(TIMER_3_4, Pull::Down));
/// Probe 1: TIM4_CH3.
pub const PROBE_1: Pin = Pin::new(Port::B, 8, Function::Alternate(TIMER_3_4, Pull::Down));
/// Probe 2: TIM8_CH3.
pub const PROBE_2: Pin = Pin::new(Port::C, 8, Function::Alternate(TIMER_8_9, Pull::Down));
/// TIM1_CH1 to CH3.
pub const HIGH_SIDES: [Pin; 3] = [gate(Port::A, 8), gate(Port::A, 9), gate(Port::A, 10)];
/// TIM1_CH1N to CH3N.
pub const LOW_SIDES: [Pin; 3] = [gate(Port::B, 13), gate(Port::B, 14), gate(Port::B, 15)];
/// TIM1_BKIN, 1 = no fault.
pub const BREAK_INPUT: Pin = gate(Port::B, 12);
/// Currents of phases A, B, C: IN10 to IN12.
pub const CURRENTS: [Pin; 3] = [analogue(Port::C, 0), analogue(Port::C, 1), analogue(Port::C, 2)];
/// DC link voltage (IN13), temperatures of heat sink (IN14) and motor (IN4 of ADC3).
pub const BUS_AND_TEMPERATURES: [Pin; 3] = [analogue(Port::C, 3), analogue(Port::C, 4), analogue(Port::F, 6)];
/// Coil of the holding brake, 1 = energised.
pub const BRAKE_COIL: Pin = Pin::new(Port::C, 5, Function::Output(Level::Low));
/// Switch of the brake chopper, 1 = resistor across the DC link.
pub const CHOPPER: Pin = Pin::new(Port::F, 11, Function::Output(Level::Low));
/// 1 = DC link charged.
pub const MAIN_POWER: Pin = active_high(9);
/// Safe torque off, channels 1 and 2, 1 = torque permitted.
pub const SAFE_TORQUE_OFF: [Pin; 2] = [active_high(10), active_high(11)];
/// Home switch, 1 = actuated.
pub const HOME_SWITCH: Pin = active_high(12);
/// 1 = the brake reports that it is released.
pub const BRAKE_FEEDBACK: Pin = active_high(13);
/// RSTN of the chip.
pub const CHIP_RESET: Pin = Pin::new(Port::G, 2, Function::Output(Level::Low));
/// SBAUD of the chip.
pub const STRAP_SBAUD: Pin = Pin::new(Port::G, 3, Function::Output(Level::High));
/// SBAUD16 of the chip.
pub const STRAP_SBAUD16: Pin = Pin::new(Port::G, 4, Function::Output(Level::High));
/// Low digit of the drive address, least significant bit first.
pub const ADDRESS_LOW_DIGIT: [Pin; 4] = [switch(5), switch(6), switch(7), switch(8)];
/// High digit of the drive address, least significant bit first.
pub const ADDRESS_HIGH_DIGIT: [Pin; 4] = [switch(10), switch(11), switch(12), switch(13)];
/// Baud rate switch, least significant bit first.
pub const BAUD_SWITCH: [Pin; 2] = [switch(14), switch(15)];

/// Every pin that is set up.
const ALL: [&[Pin]; 26] = [
    &BUS_DATA,
    &BUS_ADDRESS,
    &BUS_STROBES,
    &[BUS_WAIT],
    &ENCODER,
    &[CHIP_INT1, CHIP_INT0],
    &CHIP_EDGES,
    &ENCODER_COPIES,
    &[INDEX],
    &[PROBE_1, PROBE_2],
    &HIGH_SIDES,
    &LOW_SIDES,
    &[BREAK_INPUT],
    &CURRENTS,
    &BUS_AND_TEMPERATURES,
    &[BRAKE_COIL],
    &[CHOPPER],
    &[MAIN_POWER],
    &SAFE_TORQUE_OFF,
    &[HOME_SWITCH],
    &[BRAKE_FEEDBACK],
    &[CHIP_RESET],
    &[STRAP_SBAUD, STRAP_SBAUD16],
    &ADDRESS_LOW_DIGIT,
    &ADDRESS_HIGH_DIGIT,
    &BAUD_SWITCH,
];

/// Pins that must stay as they are after reset, or nobody can attach a debugger again: SWDIO, SWCLK.
const DEBUG_PORT: [(Port, u8); 2] = [(Port::A, 13), (Port::A, 14)];

// Refuses to compile when two signals share a pin, when one takes the debug port, or when a switch is not read as one group of bits.
#[allow(clippy::indexing_slicing, clippy::arithmetic_side_effects, reason = "evaluated by the compiler only")]
const _: () = {
    let mut used = [0u16; 7];
    let mut debug = 0;
    while debug < DEBUG_PORT.len() {
        used[DEBUG_PORT[debug].0 as usize] |= 1 << DEBUG_PORT[debug].1;
        debug += 1;
    }
    let mut group = 0;
    while group < ALL.len() {
        let mut index = 0;
        while index < ALL[group].len() {
            let pin = ALL[group][index];
            let bit = 1 << pin.number;
            assert!(used[pin.port as usize] & bit == 0, "a pin is used twice");
            used[pin.port as usize] |= bit;
            index += 1;
        }
        group += 1;
    }
    let groups: [&[Pin]; 3] = [&ADDRESS_LOW_DIGIT, &ADDRESS_HIGH_DIGIT, &BAUD_SWITCH];
    let mut group = 0;
    while group < groups.len() {
        let mut index = 1;
        while index < groups[group].len() {
            assert!(
                groups[group][index].number == groups[group][0].number + index as u8,
                "the bits of a switch are neighbours, `switches` shifts them out together"
            );
            index += 1;
        }
        group += 1;
    }
};

/// Sets every pin of the table up. The clocks of the ports must be on.
pub(crate) fn set_up() {
    for pin in ALL.iter().copied().flatten() {
        set_up_pin(*pin);
    }
}

/// The mode is written last: until then the pin is the floating input that it is after reset, so no level glitches. (PB4 is
/// a debug input with pull-up then, which is no output either.)
fn set_up_pin(pin: Pin) {
    let (mode, pull) = match pin.function {
        Function::Input(pull) => (0b00, pull),
        Function::Output(_) => (0b01, Pull::None),
        Function::Alternate(_, pull) => (0b10, pull),
        Function::Analogue => (0b11, Pull::None),
    };
    let port = registers(pin.port);
    let number = pin.number;
    // SAFETY: every value of BSRR, PUPDR, OSPEEDR, AFRL, AFRH and MODER is defined for every pin, except alternate functions
    // that the pin does not have; those in the table are from the data sheet's alternate function table.
    unsafe {
        match pin.function {
            Function::Output(Level::Low) => {
                port.bsrr().write(|w| w.bits(pin.mask() << 16));
            }
            Function::Output(Level::High) => {
                port.bsrr().write(|w| w.bits(pin.mask()));
            }
            Function::Alternate(function, _) => {
                // 50 MHz edges: fast enough for the bus timing by far, and kinder to the translator than 100 MHz.
                port.ospeedr().modify(|r, w| w.bits(field(r.bits(), number, 2, 0b10)));
                if number < 8 {
                    port.afrl().modify(|r, w| w.bits(field(r.bits(), number, 4, u32::from(function))));
                } else {
                    port.afrh().modify(|r, w| w.bits(field(r.bits(), number & 7, 4, u32::from(function))));
                };
            }
            Function::Input(_) | Function::Analogue => {}
        }
        port.pupdr().modify(|r, w| w.bits(field(r.bits(), number, 2, pull as u32)));
        port.moder().modify(|r, w| w.bits(field(r.bits(), number, 2, mode)));
    }
}

/// `old` with field `index` of fields `width` bits wide replaced.
const fn field(old: u32, index: u8, width: u8, value: u32) -> u32 {
    let shift = index.wrapping_mul(width) as u32;
    let mask = (1u32 << width).wrapping_sub(1) << shift;
    old & !mask | value << shift
}

fn registers(port: Port) -> &'static pac::gpioa::RegisterBlock {
    const SPACING: usize = 0x400;
    let offset = SPACING.wrapping_mul(port as usize);
    // SAFETY: ports A to G are 400H apart and have the same registers (RM0090 8.4); the reset values, in which the description
    // of port A differs, are not used because every register is modified or written as a whole.
    unsafe { &*pac::GPIOA::PTR.byte_add(offset) }
}
