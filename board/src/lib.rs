//! Placeholder.
#![no_std]
pub use stm32f4xx_hal::pac;
