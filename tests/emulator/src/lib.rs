//! The flashed ELF, unchanged, in QEMU: link to QEMU and STM32F407 peripheral models.
//!
//! * [`Guest`]: the running product, advanced from event to event like every other participant of a simulation.
//! * [`Environment`]: the world at its pins and on its external bus, which the caller implements.
//! * [`audit()`]: does the binary set its clocks, pins, bus and interrupts up as the board needs? [`audit_power_stage`]: and modulator and
//!   converters?
//! * [`Measurements`]: instructions, exchanges and latencies, seen from outside.
//! * [`Guest::begin_trace`], [`Activations`]: every instruction, counted by task and by function.
//!
//! How it works: QEMU's machine `netduinoplus2` has the core, the NVIC and the memories of the part but hardly a peripheral. A plugin in QEMU's
//! process (`tests/emulator/bus`) answers each access from the models here, over a shared page ([`emulator_link`]). The guest is deterministic: an
//! instruction is a tick, simulated time is ticks times [`CYCLES_PER_INSTRUCTION_TENTHS`] / 10 core cycles, plus the wait states of the external
//! bus. The core clock itself is worked out from the RCC registers that the product wrote. How often the world looks at the guest changes nothing
//! that it does.
//!
//! What it is not: cycle accurate. Interrupt entry and exit, flash wait states and bus contention are in the average only.
//! The private peripheral bus is QEMU's own; the bus refuses SysTick, which does not follow simulated time (QEMU 7.2 has no DWT cycle counter).
#![forbid(unsafe_code)]

mod activations;
mod audit;
mod clock;
mod cpu;
mod demand;
mod environment;
mod error;
mod guest;
mod link;
mod log;
mod measure;
mod peripherals;
mod plant;
mod prefetch;
mod qemu;
mod trace;
pub mod wiring;

pub use activations::{Activations, Listing, Profile, Spread, Step, TaskCount};
pub use audit::{Finding, audit, audit_power_stage};
pub use clock::CYCLES_PER_INSTRUCTION_TENTHS;
pub use demand::{Demand, Price, Worst};
pub use environment::{DigitalInputs, Environment, Hold, IndexEdge, StopAt, Stopped};
pub use error::EmulatorError;
pub use guest::{Guest, GuestConfiguration, Incident, QEMU, QEMU_VARIABLE, Reset, What};
pub use log::LogLine;
pub use measure::{Latency, Measurements, Probe, Trace, Trigger, Watched};
pub use peripherals::clocks::{CRYSTAL_HZ, ClockTree};
pub use peripherals::gpio::PinMode;
pub use plant::{Functions, Mistake};
pub use trace::{TraceEvent, TraceSink};
