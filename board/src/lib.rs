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
//! | [`encoder`] | TIM2 | position, latched in hardware by INT0 and INT1 |
//! | [`current_command`] | DAC | torque-producing current as an analogue voltage |
//! | [`amplifier`] | GPIO | enable output, main power and ready inputs |
//! | [`loop_timer`] | TIM6 | 125 us tick of the control loops, trimmed to the ring |
//! | [`timestamp`] | TIM5 | microseconds for logs |
//! | [`switches`] | GPIO | drive address and baud rate |
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

pub mod amplifier;
pub mod chip_control;
pub mod clocks;
pub mod current_command;
pub mod encoder;
pub mod fsmc;
pub mod interrupt_pins;
pub mod loop_timer;
mod motor_side;
pub mod pins;
pub mod switches;
pub mod timestamp;
pub mod watchdog;

pub use motor_side::MotorSide;
/// Registers and interrupt vectors of the part, for `rtic::app(device = ...)`.
pub use stm32f4xx_hal::pac;

use stm32f4xx_hal::rcc::{Enable, Rcc};

/// Everything the application works with, set up and ready.
#[derive(Debug)]
pub struct Board {
    /// The SERCON816; clone it for every task that talks to the chip.
    pub bus: fsmc::SercosBus,
    /// Encoder, current command, amplifier and loop timer.
    pub motor_side: MotorSide,
    /// Acknowledges interrupts of pin INT0 (EXTI3).
    pub int0: interrupt_pins::InterruptPin,
    /// Acknowledges interrupts of pin INT1 (EXTI2).
    pub int1: interrupt_pins::InterruptPin,
    /// Acknowledges interrupts of the loop timer (TIM6).
    pub loop_tick: loop_timer::LoopTick,
    /// Microseconds since start.
    pub timestamp: timestamp::Timestamp,
    /// Not yet running: [`watchdog::Watchdog::start`] it when the tasks run.
    pub watchdog: watchdog::Watchdog,
    /// What the operator set on the address and baud rate switches.
    pub settings: switches::Settings,
}

impl Board {
    /// Sets the whole board up. Call it once, with interrupts disabled, as RTIC's `init` does.
    ///
    /// The amplifier is off before its output pin is driven and stays off; the current command is zero. The SERCON816 leaves its
    /// reset with the straps of the selected baud rate. Waits for the crystal for as long as it takes: without a clock the drive must
    /// stay dead, and the amplifier input is held off by its own pull-down.
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
        let (loop_timer, loop_tick) = loop_timer::LoopTimer::new(peripherals.TIM6, &mut rcc);
        let watchdog = watchdog::Watchdog::new(peripherals.IWDG, &mut rcc);
        let motor_side = MotorSide::new(
            encoder::Encoder::new(peripherals.TIM2, &mut rcc),
            current_command::CurrentCommand::new(peripherals.DAC, &mut rcc),
            amplifier::AmplifierPort::new(peripherals.GPIOC),
            loop_timer,
            watchdog.reset_cause(),
        );
        Self { bus, motor_side, int0, int1, loop_tick, timestamp, watchdog, settings }
    }
}

fn enable_ports(rcc: &mut Rcc) {
    pac::GPIOA::enable(rcc);
    pac::GPIOC::enable(rcc);
    pac::GPIOD::enable(rcc);
    pac::GPIOE::enable(rcc);
    pac::GPIOF::enable(rcc);
    pac::GPIOG::enable(rcc);
}
