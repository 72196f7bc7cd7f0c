//! Minimal RTIC application.
#![no_std]
#![no_main]

use defmt_rtt as _;
use panic_probe as _;

#[rtic::app(device = board::pac, peripherals = false, dispatchers = [])]
mod app {
    #[shared]
    struct Shared {}
    #[local]
    struct Local {}

    #[init]
    fn init(_: init::Context) -> (Shared, Local) {
        defmt::info!("up");
        (Shared {}, Local {})
    }

    #[idle]
    fn idle(_: idle::Context) -> ! {
        loop {
            cortex_m::asm::wfi();
        }
    }

    #[task(binds = TIM6_DAC, priority = 4)]
    fn control_loop(_: control_loop::Context) {}
}
