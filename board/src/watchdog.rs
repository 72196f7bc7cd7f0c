//! Independent watchdog: resets the drive when the control loop or a bus task stops making progress.
//!
//! The bridge is off and the brake holds through a reset and after it (see [`crate::pins`]), and the SERCON816 is reset with us, so a hung drive
//! leaves the ring and lets the motor coast within the period of the watchdog.
//!
//! What it is fed on ([`CheckIn`]): `idle` runs, so no task hangs or storms; the control loop has ticked, which every second current loop starts; the
//! supervision has run, and the velocity loop between two ticks; and no task that was started is still waiting to begin, which would mean that its interrupt was lost. Which of them kept it from
//! being fed is left for the record of the reset ([`crate::crash`]).

use core::sync::atomic::{AtomicBool, AtomicU8, AtomicU32, Ordering};

use drive::{ResetCause, Tasks};
use stm32f4xx_hal::{pac, rcc::Rcc};

use crate::{crash, loop_watchdog};

/// Ticks of the LSI oscillator (32 kHz, 17 to 47 kHz over all parts) divided by four: 100 ms, at least 68 and at most 188 ms.
const RELOAD: u16 = 800 - 1;

/// Ticks of the control loop (125 us) between two feedings: 8 ms, an eighth of the shortest period.
const TICKS_PER_FEEDING: u32 = 64;

/// What the tasks report and `idle` judges; one static of the application.
#[derive(Debug)]
pub struct CheckIn {
    ticks: AtomicU32,
    started: AtomicU8,
    supervised: AtomicBool,
    regulated: AtomicBool,
}

impl CheckIn {
    /// Nothing done, nothing asked for.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            ticks: AtomicU32::new(0),
            started: AtomicU8::new(0),
            supervised: AtomicBool::new(false),
            regulated: AtomicBool::new(false),
        }
    }

    /// The control loop ran.
    #[inline(always)]
    pub fn tick(&self) {
        // One writer, so no read-modify-write instruction is needed.
        let ticks = self.ticks.load(Ordering::Relaxed);
        self.ticks.store(ticks.wrapping_add(1), Ordering::Relaxed);
    }

    /// Bus tasks were pended, one bit for each.
    #[inline(always)]
    pub fn started(&self, tasks: u8) {
        self.started.fetch_or(tasks, Ordering::Relaxed);
    }

    /// A bus task begins; called by it before anything else, so that being started again meanwhile counts anew.
    #[inline(always)]
    pub fn begun(&self, tasks: u8) {
        self.started.fetch_and(!tasks, Ordering::Relaxed);
    }

    /// The supervision ran.
    #[inline(always)]
    pub fn supervised(&self) {
        self.supervised.store(true, Ordering::Relaxed);
    }

    /// The velocity loop ran between two ticks.
    #[inline(always)]
    pub fn regulated(&self) {
        self.regulated.store(true, Ordering::Relaxed);
    }

    /// Tasks that have not begun, or that should have run and did not.
    fn silent(&self) -> u8 {
        let has_run = [(&self.supervised, Tasks::SUPERVISION), (&self.regulated, Tasks::VELOCITY_LOOP)];
        has_run.iter().fold(self.started.load(Ordering::Relaxed), |silent, (has_run, task)| {
            if has_run.load(Ordering::Relaxed) { silent } else { silent | task.bits() }
        })
    }

    /// A new period of the watchdog.
    fn begin_again(&self) {
        self.supervised.store(false, Ordering::Relaxed);
        self.regulated.store(false, Ordering::Relaxed);
    }
}

impl Default for CheckIn {
    fn default() -> Self {
        Self::new()
    }
}

/// The watchdog; cannot be stopped once started.
#[derive(Debug)]
pub struct Watchdog {
    watchdog: pac::IWDG,
    of_loops: pac::WWDG,
    reset_cause: ResetCause,
    running: bool,
    fed_at: u32,
}

impl Watchdog {
    /// Takes the watchdog over, and the record of the last reset with it.
    pub(crate) fn new(watchdog: pac::IWDG, of_loops: pac::WWDG, rcc: &mut Rcc) -> Self {
        let reset_cause = cause_in(&rcc.csr().read());
        rcc.csr().modify(|_, w| w.rmvf().clear());
        loop_watchdog::enable(rcc);
        Self { watchdog, of_loops, reset_cause, running: false, fed_at: 0 }
    }

    /// What the last reset was for; the watchdog, if something in the drive had hung.
    #[must_use]
    pub const fn reset_cause(&self) -> ResetCause {
        self.reset_cause
    }

    /// Starts this watchdog and that of the loops and returns `true`; with a debugger attached leaves it off, as a halted core would be reset.
    pub fn start(&mut self) -> bool {
        if !self.running && !cortex_m::peripheral::DCB::is_debugger_attached() {
            // Starting first switches the oscillator on, without which the registers would not take a value.
            self.watchdog.kr().write(|w| w.key().start());
            self.watchdog.kr().write(|w| w.key().unlock());
            self.watchdog.pr().write(|w| w.pr().divide_by4());
            self.watchdog.rlr().write(|w| w.rl().set(RELOAD));
            loop_watchdog::start(&self.of_loops);
            self.running = true;
        }
        self.running
    }

    /// Feeds the watchdog when it is time and the tasks made progress. For `idle`, at every wake-up.
    ///
    /// Returns whether it was: about every 8 ms in a drive that is well, with or without a watchdog running.
    pub fn feed(&mut self, progress: &CheckIn) -> bool {
        let ticks = progress.ticks.load(Ordering::Relaxed);
        let due = ticks.wrapping_sub(self.fed_at) >= TICKS_PER_FEEDING;
        let silent = progress.silent();
        if !due || silent != 0 {
            if due {
                crash::suspect(silent.into());
            }
            return false;
        }
        crash::suspect(0);
        progress.begin_again();
        self.fed_at = ticks;
        if self.running {
            self.watchdog.kr().write(|w| w.key().feed());
        }
        true
    }
}

/// The cause in RCC_CSR. Every reset pulls the reset pin as well, and a coming supply sets several flags: the most telling one counts
/// (RM0090, 7.3.21).
fn cause_in(flags: &pac::rcc::csr::R) -> ResetCause {
    if flags.wdgrstf().is_reset() || flags.wwdgrstf().is_reset() {
        ResetCause::Watchdog
    } else if flags.sftrstf().is_reset() {
        ResetCause::Software
    } else if flags.lpwrrstf().is_reset() {
        ResetCause::LowPower
    } else if flags.porrstf().is_reset() || flags.borrstf().is_reset() {
        ResetCause::PowerOn
    } else if flags.padrstf().is_reset() {
        ResetCause::ResetPin
    } else {
        ResetCause::Unknown
    }
}
