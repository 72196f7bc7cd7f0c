//! The flashed ELF, unchanged, in QEMU: trap link and STM32F407 peripheral models.
#![forbid(unsafe_code)]

pub mod protocol;
pub mod thumb;
