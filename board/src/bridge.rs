//! The three half-bridges: TIM1, centre-aligned PWM with dead time, break input and the trigger of the converters.
//!
//! | channel | pins | what |
//! |---|---|---|
//! | CH1, CH1N | PA8, PB13 | phase A, high and low side |
//! | CH2, CH2N | PA9, PB14 | phase B |
//! | CH3, CH3N | PA10, PB15 | phase C |
//! | CH4 | - | inside only: OC4REF is TRGO and starts the converters, see [`crate::current_sense`] |
//! | BKIN | PB12 | power stage without fault = 1; 0 or a broken wire switches all six off without software or clock |
//!
//! The counter runs up to ARR and down to 0. A high side is on below its compare value, so the low sides are on around the peak, and
//! that is where the currents are sampled:
//!
//! ```text
//! ARR         /\            /\
//!          * /  \        * /  \        *  trigger, 144 counts before the peak
//!           /    \        /    \       o  current loop: begins 2 us behind the peak
//!          /      o      /      o
//!         /        \    /        \    compare values and reload written here come into force in the next valley
//!   0 \  /          \  /          \   (RCR = 0: at the peak too, where nothing is waiting unless the loop is late)
//!      \/            \/
//! ```
//!
//! Three hands: [`Modulator`] for the current loop, [`Bridge`] for who switches torque on, and [`off`] for fault and panic handlers. Each may
//! switch off at any time; only [`Bridge`] can switch on, and nothing that another one of them does in between gets lost.
//!
//! The break has no interrupt: it needs nobody to switch off, its flag stays until it is acknowledged, and the control loop looks at the
//! outputs in every tick. A power stage that is not ready yet when the drive starts is a break like any other.
//!
//! A failed crystal breaks it as well, see [`crate::clocks`].
//!
//! Debugger: TIM1 runs on while the core is halted. Do not halt with torque on; the break input stays in force.

use core::sync::atomic::{AtomicBool, Ordering};

use drive::{Cycle, PwmFrequency};
use stm32f4xx_hal::{
    pac,
    rcc::{Enable, Rcc},
};

use crate::{clocks::APB2_TIMER_HZ, current_sense::TRIGGER_TO_HOLD, dead_time, edge_time, loop_phase};

/// The board's PWM frequency, a constant, so that the current loop decides nothing about it.
pub const PWM_FREQUENCY: PwmFrequency = PwmFrequency::Khz16;

/// Dead time between high and low side, in nanoseconds: IGBT modules of this size switch within some 0.5 us.
pub const DEAD_TIME_NANOSECONDS: u32 = 1_000;

/// Largest trim that lengthens a tick, in counts of 84 MHz; one more that shortens it. 2.4 %: pulls half a period of phase error in within 50
/// ticks (6 ms) and changes neither modulation depth nor ripple by more than that. A power of two, less one: one instruction limits to it.
pub const LARGEST_TRIM: i32 = 255;

/// BDTR with the outputs off.
///
/// Lock level 2 (RM0090 17.4.18): after the first write nothing that could turn a safe state into a short circuit can be changed before the
/// next reset: dead time, break, polarities, idle levels, OSSI, OSSR. Level 3 would only add the modes of the compare channels.
/// BKP = 0: active low. AOE = 0: nothing but software switches on again. OSSI, OSSR: off is driven low, not left floating.
pub const OFF: u32 = {
    const LOCK_LEVEL_2: u32 = 0b10 << 8;
    const OSSI: u32 = 1 << 10;
    const OSSR: u32 = 1 << 11;
    const BKE: u32 = 1 << 12;
    dead_time::code(DEAD_TIME_NANOSECONDS) as u32 | LOCK_LEVEL_2 | OSSI | OSSR | BKE
};
/// BDTR with the outputs on.
const ON: u32 = OFF | MOE;
/// Main output enable.
const MOE: u32 = 1 << 15;

/// TIM1_SR, break flag: cleared by 0, untouched by 1.
const BIF: u32 = 1 << 7;

/// Switched off for a reason that someone has to acknowledge. Outlives a [`Bridge::set_on`] that was on its way.
///
/// Sequentially consistent, because the order towards the stores to BDTR matters.
static TRIPPED: AtomicBool = AtomicBool::new(false);

/// Address of BDTR, for handlers that have no stack.
pub const BDTR: u32 = 0x4001_0044;

/// Switches all six outputs off from wherever the program has come to a standstill: for fault and panic handlers, which own nothing.
pub fn off() {
    // SAFETY: a single store that can only switch off; right at any time, whoever owns the timer.
    unsafe { (*pac::TIM1::ptr()).bdtr().write(|w| w.bits(OFF)) };
}

/// Sets everything up with the outputs off and the counter running; the first trigger comes within half a period.
///
/// The converters must wait for it already, and TIM9 must run.
pub(crate) fn start(timer: pac::TIM1, rcc: &mut Rcc) -> (Bridge, Modulator) {
    pac::TIM1::enable(rcc);
    // First of all what makes "off" drive the outputs low; idle levels and polarities have their reset value 0: low, active high.
    // SAFETY: `OFF` is built of defined fields only.
    timer.bdtr().write(|w| unsafe { w.bits(OFF) });
    timer.ccmr1_output().write(|w| {
        w.oc1m().pwm_mode1().oc1pe().enabled();
        w.oc2m().pwm_mode1().oc2pe().enabled()
    });
    // Before the preload is switched on, so that it is in force: at 0 OC4REF would be high at once, and start the converters.
    let reload = PWM_FREQUENCY.reload();
    timer.ccr4().write(|w| w.ccr().set(trigger(reload.into()) as u16));
    // Mode 2: OC4REF rises while counting up, before the peak. Mode 1 would rise behind it.
    timer.ccmr2_output().write(|w| {
        w.oc3m().pwm_mode1().oc3pe().enabled();
        w.oc4m().pwm_mode2().oc4pe().enabled()
    });
    timer.ccer().write(|w| {
        w.cc1e().set_bit().cc1ne().set_bit();
        w.cc2e().set_bit().cc2ne().set_bit();
        w.cc3e().set_bit().cc3ne().set_bit()
    });
    timer.cr2().write(|w| w.mms().compare_oc4());
    timer.arr().write(|w| w.arr().set(reload));
    let no_voltage = reload >> 1;
    for compare in [timer.ccr1(), timer.ccr2(), timer.ccr3()] {
        compare.write(|w| w.ccr().set(no_voltage));
    }
    // Centre-aligned modes differ in when compare flags are set, which nothing here uses.
    timer.cr1().write(|w| w.arpe().enabled().cms().center_aligned1());
    // Loads the preloaded registers; starts the counter at 0, upwards.
    timer.egr().write(|w| w.ug().update());
    // SAFETY: every value is valid for SR; this one clears all flags.
    timer.sr().write(|w| unsafe { w.bits(0) });
    timer.cr1().modify(|_, w| w.cen().enabled());
    (Bridge(()), Modulator { timer, reload: reload.into(), last_peak: 0, overdue: u16::MAX, first: false })
}

/// Switches torque on and off; owned by the task that decides about it.
#[derive(Debug)]
pub struct Bridge(());

impl Bridge {
    /// Switches the six outputs on or off.
    ///
    /// Stays off while [`Bridge::tripped`], which is asked before and once more behind the store: a trip in between is older than
    /// the store, but must win.
    #[inline(always)]
    pub fn set_on(&mut self, on: bool) {
        if on && !self.tripped() {
            // SAFETY: `ON` is built of defined fields only; under the lock, MOE is the only one that changes.
            registers().bdtr().write(|w| unsafe { w.bits(ON) });
            if self.tripped() {
                off();
            }
        } else {
            off();
        }
    }

    /// Are the outputs on? Shows a change two counts of the timer late.
    #[inline(always)]
    pub fn is_on(&self) -> bool {
        registers().bdtr().read().bits() & MOE != 0
    }

    /// Has the break input or [`Modulator::switch_off`] switched off, unacknowledged?
    #[inline(always)]
    pub fn tripped(&self) -> bool {
        TRIPPED.load(Ordering::SeqCst) || registers().sr().read().bits() & BIF != 0
    }

    /// Allows switching on again after a trip. The bridge stays off, and tripped while the break input is active: its flag cannot be
    /// cleared then.
    #[inline(always)]
    pub fn acknowledge_trip(&mut self) {
        off();
        TRIPPED.store(false, Ordering::SeqCst);
        // SAFETY: every value is valid for SR, whose bits are cleared by 0 and untouched by 1; the other flags are not used.
        registers().sr().write(|w| unsafe { w.bits(!BIF & SR_BITS) });
    }
}

/// The defined bits of TIM1_SR.
const SR_BITS: u32 = 0x1EFF;

/// Sets the voltages and keeps the time; owned by the current loop.
#[derive(Debug)]
pub struct Modulator {
    timer: pac::TIM1,
    /// In force from the last valley on, or from the next.
    reload: u32,
    /// Time of TIM9, of which the lower half counts.
    last_peak: u32,
    /// Counts after it from which on a period has been left out. Never, as long as there was none.
    overdue: u16,
    first: bool,
}

impl Modulator {
    /// Begins a period; to be called once in every current loop, before anything is written.
    ///
    /// Late is a current loop past the valley where its compare values should have come into force, and one before which a whole period was
    /// left out.
    ///
    /// Reads direction, counter and TIM9. An underflow between the first two falsifies the time of the peak by the few counts that
    /// lie between them.
    #[inline(always)]
    pub fn begin(&mut self) -> Cycle {
        let down = self.timer.cr1().read().dir().is_down();
        let counter = self.timer.cnt().read().bits();
        let peak = edge_time::register().wrapping_sub(since_peak(self.reload, down, counter));
        let missed = peak.wrapping_sub(self.last_peak) as u16 > self.overdue;
        self.last_peak = peak;
        self.overdue = overdue(PWM_FREQUENCY);
        self.first = first(PWM_FREQUENCY, self.first);
        if missed {
            self.skip();
        }
        if self.first {
            loop_phase::publish(peak as u16);
        }
        Cycle { first: self.first, late: missed || !down }
    }

    /// Counts a period that nobody has seen.
    #[cold]
    fn skip(&mut self) {
        self.first = first(PWM_FREQUENCY, self.first);
    }

    /// Pulse widths of the high sides, phases A, B, C: 0 (low side on all the time) to the peak of the counter or beyond (high side).
    /// Half of it is no voltage. In force from the next valley on.
    ///
    /// Where the low sides are on for less than twice 0.86 us + dead time, the currents are sampled while they switch.
    #[inline(always)]
    pub fn set_compare(&mut self, [a, b, c]: [u16; 3]) {
        self.timer.ccr1().write(|w| w.ccr().set(a));
        self.timer.ccr2().write(|w| w.ccr().set(b));
        self.timer.ccr3().write(|w| w.ccr().set(c));
    }

    /// Lengthens (positive) or shortens the ticks by so many counts of 84 MHz, limited to [`LARGEST_TRIM`]; from the next valley on.
    ///
    /// To be called in every period: an odd count at 16 kHz is made by the first one alone. The trigger moves with the peak.
    #[inline(always)]
    pub fn set_reload(&mut self, trim: i32) {
        let reload = reload(PWM_FREQUENCY, trim, self.first);
        self.reload = reload;
        // SAFETY: both registers hold 16 bits, and `reload` gives no more, see the assertions at the end of this file.
        unsafe {
            self.timer.arr().write(|w| w.bits(reload));
            self.timer.ccr4().write(|w| w.bits(trigger(reload)));
        }
    }

    /// Switches the outputs off; they stay off until [`Bridge::acknowledge_trip`].
    #[inline(always)]
    pub fn switch_off(&mut self) {
        // In this order: `Bridge::set_on` may look between the two.
        TRIPPED.store(true, Ordering::SeqCst);
        off();
    }
}

fn registers() -> &'static pac::tim1::RegisterBlock {
    // SAFETY: the owners of this file write BDTR and SR by single stores of whole values, of which any order is safe; what a
    // read-modify-write could damage belongs to `Modulator` alone.
    unsafe { &*pac::TIM1::ptr() }
}

/// Compare value of the trigger: the converters hold the currents at the peak.
const fn trigger(reload: u32) -> u32 {
    reload.wrapping_sub(TRIGGER_TO_HOLD as u32)
}

/// Value of ARR. One count more makes a period two counts of 168 MHz longer, which is one of 84 MHz; the tick is the sum of its periods.
#[inline(always)]
const fn reload(frequency: PwmFrequency, trim: i32, first: bool) -> u32 {
    let limited = if trim > LARGEST_TRIM {
        LARGEST_TRIM
    } else if trim < !LARGEST_TRIM {
        !LARGEST_TRIM
    } else {
        trim
    };
    let share = match frequency {
        PwmFrequency::Khz8 => limited,
        PwmFrequency::Khz16 => limited.wrapping_add(first as i32) >> 1,
    };
    (frequency.reload() as u32).wrapping_add_signed(share)
}

/// Counts since the last peak: down from it, or up again behind the valley.
const fn since_peak(reload: u32, down: bool, counter: u32) -> u32 {
    if down { reload.wrapping_sub(counter) } else { reload.wrapping_add(counter) }
}

/// More counts than these after the last peak that was seen, and a period was left out: one and a half.
const fn overdue(frequency: PwmFrequency) -> u16 {
    frequency.reload().wrapping_mul(3)
}

/// Is a period the first one of a tick, after one that was or was not?
const fn first(frequency: PwmFrequency, previous: bool) -> bool {
    match frequency {
        PwmFrequency::Khz8 => true,
        PwmFrequency::Khz16 => !previous,
    }
}

// Registers.
const _: () = {
    use PwmFrequency::{Khz8, Khz16};
    // Half a period.
    assert!(Khz16.reload() as u32 == APB2_TIMER_HZ / 16_000 / 2 && Khz8.reload() as u32 == APB2_TIMER_HZ / 8_000 / 2);
    assert!(OFF == 0x1E94, "1 us, level 2, idle levels driven, break enabled and active low, no automatic enable");
    assert!(ON == 0x9E94);
    assert!(!BIF & SR_BITS == 0x1E7F);
    assert!(trigger(5_250) == 5_106 && trigger(10_500) == 10_356);
    // The dead time leaves room for the pulses, and the trigger lies in the low-side pulse of a bridge without voltage.
    assert!(dead_time::counts(OFF as u8) == 168);
    assert!(dead_time::counts(OFF as u8) + TRIGGER_TO_HOLD < Khz16.reload() / 2);
};

// Trim: the ends, the limits, and the sum of the two periods of a tick for every trim.
#[allow(clippy::arithmetic_side_effects, reason = "evaluated by the compiler only")]
const _: () = {
    use PwmFrequency::{Khz8, Khz16};
    assert!(reload(Khz8, 0, true) == 10_500 && reload(Khz8, 1, true) == 10_501 && reload(Khz8, -7, true) == 10_493);
    assert!(reload(Khz8, i32::MAX, true) == 10_755 && reload(Khz8, i32::MIN, true) == 10_244);
    assert!(reload(Khz8, 256, true) == 10_755 && reload(Khz8, -257, true) == 10_244);
    assert!(reload(Khz16, 1, true) == 5_251 && reload(Khz16, 1, false) == 5_250);
    assert!(reload(Khz16, -1, true) == 5_250 && reload(Khz16, -1, false) == 5_249);
    assert!(reload(Khz16, i32::MAX, true) == 5_378 && reload(Khz16, i32::MIN, false) == 5_122);
    let mut trim = !LARGEST_TRIM;
    while trim <= LARGEST_TRIM {
        let tick = reload(Khz16, trim, true) as i32 + reload(Khz16, trim, false) as i32;
        assert!(tick == loop_phase::COUNTS as i32 + trim);
        assert!(reload(Khz8, trim, true) as i32 == loop_phase::COUNTS as i32 + trim);
        trim += 1;
    }
};

// Time since the peak, missed periods, first periods.
const _: () = {
    use PwmFrequency::{Khz8, Khz16};
    assert!(since_peak(5_250, true, 5_250) == 0 && since_peak(5_250, true, 4_938) == 312);
    assert!(since_peak(5_250, true, 1) == 5_249 && since_peak(5_250, false, 1) == 5_251);
    assert!(since_peak(10_710, false, 10_710) == 21_420);

    // Beyond the longest period, and not beyond two of the shortest.
    assert!(overdue(Khz16) == 15_750 && 10_756 < overdue(Khz16) && overdue(Khz16) < 20_488);
    assert!(overdue(Khz8) == 31_500 && 21_510 < overdue(Khz8) && overdue(Khz8) < 40_976);

    assert!(first(Khz16, false) && !first(Khz16, true) && first(Khz8, true) && first(Khz8, false));
};
