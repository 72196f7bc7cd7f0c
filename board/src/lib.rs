//! STM32F407ZG board of the servo drive: one file per peripheral, set up once by [`Board::new`].
//!
//! Nothing here decides anything: set-up values are constants with their derivation beside them, run-time calls are one or two
//! register accesses. What the drive does with them is in `drive`; who calls when is in `app`. NVIC priorities belong to RTIC.
//!
//! | file | peripheral | what for |
//! |---|---|---|
//! | [`clocks`] | RCC, flash wait states | 168 MHz from an 8 MHz crystal |
//! | [`pins`] | GPIO | the pin table: documentation and set-up in one |
//! | [`fsmc`] | FSMC bank 1, NE1 | the SERCON816 as memory, [`fsmc::SercosBus`] |
//! | [`chip_control`] | GPIO | reset, straps and wiring of the SERCON816 |
//! | [`interrupt_pins`] | EXTI | INT0 and INT1 of the SERCON816 |
//! | [`edge_time`] | TIM9 | when INT0 and INT1 had their edges |
//! | [`encoder`] | TIM2 | position, latched in hardware by INT0 and INT1 |
//! | [`edge_latches`] | TIM3, TIM4, TIM8 | position, latched in hardware by the index and two probes |
//! | [`bridge`], [`dead_time`] | TIM1 | PWM of the three half-bridges, trimmed to the ring; break; trigger of the converters |
//! | [`current_sense`] | ADC1, ADC2, ADC3 | phase currents, DC link voltage, temperatures; the interrupt of the current loop |
//! | [`loop_phase`] | TIM9 against TIM1 | where in the tick of the control loops an edge of INT0 or INT1 came |
//! | [`inputs`] | GPIO | main power, power stage, safe torque off, home switch, brake, probes |
//! | [`brake_coil`] | GPIO | output to the holding brake |
//! | [`chopper`] | GPIO | output to the switch of the brake chopper |
//! | [`MotorSide`], [`Inverter`] | - | the above, as `drive` sees them |
//! | [`timestamp`] | TIM5 | microseconds for logs |
//! | [`switches`] | GPIO | drive address and baud rate |
//! | [`parameter_flash`] | flash controller | the two sectors of the parameters |
//! | [`production_record`] | flash | what the works have written of this unit |
//! | [`crash`] | RAM | the record of a crash, kept over the reset |
//! | [`stack_guard`] | MPU | stops a stack before it reaches the statics |
//! | `loop_watchdog` | WWDG | ends a program whose loops do not run |
//! | [`watchdog`] | IWDG | resets the drive when a task stops making progress |
#![no_std]
#![deny(unsafe_op_in_unsafe_fn)]
#![cfg_attr(
    not(test),
    deny(
        clippy::unwrap_used,
        clippy::expect_used,
        clippy::indexing_slicing,
        clippy::arithmetic_side_effects,
        clippy::panic
    )
)]

pub mod brake_coil;
pub mod bridge;
pub mod chip_control;
pub mod chopper;
pub mod clocks;
pub mod crash;
pub mod current_sense;
pub mod dead_time;
pub mod edge_latches;
pub mod edge_time;
pub mod encoder;
mod facts;
pub mod fsmc;
pub mod inputs;
pub mod interrupt_pins;
mod inverter;
pub mod loop_phase;
mod loop_watchdog;
mod motor_side;
pub mod parameter_flash;
mod permit;
pub mod pins;
pub mod production_record;
pub mod stack_guard;
pub mod switches;
pub mod timestamp;
pub mod watchdog;

pub use facts::Kind;
pub use inverter::Inverter;
pub use motor_side::MotorSide;
/// Registers and interrupt vectors of the part, for `rtic::app(device = ...)`.
pub use stm32f4xx_hal::pac;

use stm32f4xx_hal::rcc::{Enable, Rcc};

/// Everything the application works with, set up and ready.
#[derive(Debug)]
pub struct Board {
    /// The SERCON816; clone it for every task that talks to the chip.
    pub bus: fsmc::SercosBus,
    /// For the tasks of the loop tick.
    pub motor_side: MotorSide,
    /// For the current loop, which the end of conversion (ADC) starts.
    pub inverter: Inverter,
    /// Acknowledges interrupts of pin INT0 (EXTI3).
    pub int0: interrupt_pins::InterruptPin,
    /// Acknowledges interrupts of pin INT1 (EXTI2).
    pub int1: interrupt_pins::InterruptPin,
    /// Microseconds since start.
    pub timestamp: timestamp::Timestamp,
    /// Both watchdogs, not yet running: [`watchdog::Watchdog::start`] them when the tasks run.
    pub watchdog: watchdog::Watchdog,
    /// Where the parameters are kept.
    pub parameter_flash: parameter_flash::ParameterFlash,
    /// What the operator set on the address and baud rate switches.
    pub settings: switches::Settings,
}

impl Board {
    /// Sets the whole board up. Call it once, with interrupts disabled, as RTIC's `init` does.
    ///
    /// The bridge is off before its pins are driven and stays off, and the brake holds. The bridge's timer and the converters run from here
    /// on. The SERCON816 leaves its reset with the straps of the selected baud rate. Waits for the crystal for as long as it takes: without
    /// a clock the drive must stay dead, and the pull-downs at gate drivers and brake hold them off.
    #[must_use]
    pub fn new(peripherals: pac::Peripherals) -> Self {
        let mut rcc = clocks::start(peripherals.RCC);
        enable_ports(&mut rcc);
        pins::set_up();
        let settings = switches::read(&peripherals.GPIOG);
        let bus = fsmc::SercosBus::new(peripherals.FSMC, &mut rcc);
        chip_control::start(&peripherals.GPIOG, settings.bit_rate);
        let (int0, int1) = interrupt_pins::set_up(&peripherals.EXTI, &peripherals.SYSCFG, &mut rcc);
        let timestamp = timestamp::Timestamp::new(&peripherals.TIM5, &mut rcc);
        let encoder = encoder::Encoder::new(peripherals.TIM2, &mut rcc);
        let marks = edge_latches::EdgeLatches::new((peripherals.TIM3, peripherals.TIM4, peripherals.TIM8), &mut rcc);
        let edge_time = edge_time::EdgeTime::new(peripherals.TIM9, &mut rcc);
        let current_sense = current_sense::CurrentSense::new(
            (peripherals.ADC1, peripherals.ADC2, peripherals.ADC3),
            &peripherals.ADC_COMMON,
            &mut rcc,
        );
        // Behind the converters and TIM9: its first trigger finds them waiting.
        let (bridge, modulator) = bridge::start(peripherals.TIM1, &mut rcc);
        let watchdog = watchdog::Watchdog::new(peripherals.IWDG, peripherals.WWDG, &mut rcc);
        let motor_side = MotorSide {
            encoder,
            marks,
            loop_phase: loop_phase::LoopPhase::new(edge_time),
            bridge,
            brake_coil: brake_coil::BrakeCoil::new(),
            reset_cause: watchdog.reset_cause(),
        };
        let inverter = Inverter { modulator, current_sense, chopper: chopper::Chopper::new() };
        let parameter_flash = parameter_flash::ParameterFlash::new(peripherals.FLASH);
        Self { bus, motor_side, inverter, int0, int1, timestamp, watchdog, parameter_flash, settings }
    }
}

fn enable_ports(rcc: &mut Rcc) {
    pac::GPIOA::enable(rcc);
    pac::GPIOB::enable(rcc);
    pac::GPIOC::enable(rcc);
    pac::GPIOD::enable(rcc);
    pac::GPIOE::enable(rcc);
    pac::GPIOF::enable(rcc);
    pac::GPIOG::enable(rcc);
}
