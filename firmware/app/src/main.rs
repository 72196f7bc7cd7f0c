//! The RTIC application: board start-up and time stamps, until the drive's tasks are bound.
#![no_std]
#![no_main]

mod fault;

use defmt_rtt as _;
use panic_probe as _;

defmt::timestamp!("{=u32:us}", board::timestamp::microseconds());

/// What the tasks report to the watchdog.
static PROGRESS: board::watchdog::Progress = board::watchdog::Progress::new();

#[rtic::app(device = board::pac, peripherals = true)]
mod app {
    use board::{Board, interrupt_pins::InterruptPin, loop_timer::LoopTick, watchdog::Watchdog};
    use sercon816::{Bus, Register};

    use crate::PROGRESS;

    #[shared]
    struct Shared {}

    #[local]
    struct Local {
        int0: InterruptPin,
        int1: InterruptPin,
        loop_tick: LoopTick,
        watchdog: Watchdog,
    }

    #[init]
    fn init(context: init::Context) -> (Shared, Local) {
        let Board { mut bus, int0, int1, loop_tick, mut watchdog, settings, .. } = Board::new(context.device);
        defmt::info!(
            "drive {=u8}, {}, chip version {=?}",
            settings.address,
            settings.bit_rate,
            Register::new(0).map(|version| bus.read_register(version))
        );
        if !watchdog.start() {
            defmt::warn!("debugger attached, watchdog off");
        }
        (Shared {}, Local { int0, int1, loop_tick, watchdog })
    }

    #[idle(local = [watchdog])]
    fn idle(context: idle::Context) -> ! {
        loop {
            context.local.watchdog.feed(&PROGRESS);
            cortex_m::asm::wfi();
        }
    }

    #[task(binds = TIM6_DAC, priority = 4, local = [loop_tick])]
    fn control_loop(context: control_loop::Context) {
        context.local.loop_tick.acknowledge();
        PROGRESS.tick();
    }

    #[task(binds = EXTI3, priority = 4, local = [int0])]
    fn chip_interrupt_0(context: chip_interrupt_0::Context) {
        context.local.int0.acknowledge();
    }

    #[task(binds = EXTI2, priority = 4, local = [int1])]
    fn chip_interrupt_1(context: chip_interrupt_1::Context) {
        context.local.int1.acknowledge();
    }
}
