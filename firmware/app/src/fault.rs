//! Where the program ends when it cannot go on: torque off, brake closed, then wait for the watchdog.
//!
//! A panic ends here too: `panic-probe` logs its message and raises a hard fault. Without this the last voltage would stay on
//! the motor for the watchdog's whole period, and TIM1 makes it without the processor.

use cortex_m_rt::{ExceptionFrame, exception};

#[exception]
unsafe fn HardFault(_frame: &ExceptionFrame) -> ! {
    stop()
}

/// An interrupt that nobody is bound to, or one of the configurable faults.
#[exception]
unsafe fn DefaultHandler(_interrupt: i16) {
    stop()
}

fn stop() -> ! {
    board::bridge::off();
    board::brake_coil::apply();
    loop {
        // With a debugger attached the watchdog is off, and the frame can be looked at in peace.
        cortex_m::asm::nop();
    }
}
