//! Checks modulator and converters: what RM0090 needs for 16 kHz centre-aligned complementary PWM with currents sampled at its peak.

use super::{Finding, Findings, pins};
use crate::Guest;
use crate::peripherals::Peripherals;
use crate::peripherals::adc::{self, Converters, FASTEST_CLOCK_HZ, INJECTED_INTERRUPT, TRIGGERED_BY_TIM1, TRIPLE};
use crate::peripherals::advanced_timer::registers::{ARR, BDTR, CCER, CCMR1, CCMR2, CCR4, CR1, CR2, PSC, RCR};
use crate::peripherals::advanced_timer::{ALL_SWITCHES, AdvancedTimer};
use crate::peripherals::break_and_dead_time::{
    AUTOMATIC_OUTPUT, BREAK_ACTIVE_HIGH, BREAK_ENABLE, IDLE_STATE_DRIVEN, RUN_STATE_DRIVEN,
};
use crate::wiring::{ADC_SEQUENCES, power_stage_pins};
use ring::Nanoseconds;

/// Timer clocks in half a period of 16 kHz at 168 MHz.
const HALF_PERIOD: u32 = 5_250;
/// The ring's cycle trims the period by much less than this.
const TRIM: u32 = HALF_PERIOD / 200;
const SHORTEST_DEAD_TIME_NS: u32 = 900;
const LONGEST_DEAD_TIME_NS: u32 = 1_100;
/// How far the currents may be taken from the peak of the counter, in nanoseconds.
const HOLD_TOLERANCE_NS: u64 = 100;
/// From the trigger to the sampling: up to so many cycles of the converters (data sheet); the set-up may count on any of them.
const TRIGGER_LATENCY: u64 = 3;

/// Compares the power stage with what the board needs; to be called once the product has finished its set-up.
#[must_use]
pub fn audit_power_stage(guest: &Guest) -> Vec<Finding> {
    deviations(guest.peripherals())
}

fn deviations(peripherals: &Peripherals) -> Vec<Finding> {
    let mut findings = Findings::default();
    pins(&peripherals.ports, power_stage_pins(), &mut findings);
    let stage = &peripherals.stage;
    counter(&stage.timer, &mut findings);
    outputs(&stage.timer, &mut findings);
    trigger(&stage.timer, &stage.converters, &mut findings);
    converters(&stage.converters, &mut findings);
    findings.0
}

fn hexadecimal(value: &u32) -> String {
    format!("{value:#06x}")
}

fn register(timer: &AdvancedTimer, offset: u32) -> u32 {
    timer.read(offset, Nanoseconds::ZERO).unwrap_or_default()
}

impl Findings {
    fn check_bits(&mut self, what: &str, mask: u32, expected: u32, actual: u32) {
        self.check(what, expected, actual & mask, hexadecimal);
    }

    fn check_range(&mut self, what: impl Into<String>, shortest: u64, longest: u64, actual: u64) {
        if !(shortest..=longest).contains(&actual) {
            let expected = format!("{shortest} to {longest}");
            self.0.push(Finding { what: what.into(), expected, actual: actual.to_string() });
        }
    }
}

fn counter(timer: &AdvancedTimer, findings: &mut Findings) {
    let control = register(timer, CR1);
    findings.check_bits("TIM1_CR1 CEN", 1, 1, control);
    findings.check_bits("TIM1_CR1 UDIS", 1 << 1, 0, control);
    findings.check_bits("TIM1_CR1 ARPE", 1 << 7, 1 << 7, control);
    findings.check("TIM1_CR1 CMS: centre-aligned", true, control >> 5 & 3 != 0, bool::to_string);
    findings.check_bits("TIM1_PSC", 0xFFFF, 0, register(timer, PSC));
    let (shortest, longest) = (u64::from(HALF_PERIOD - TRIM), u64::from(HALF_PERIOD + TRIM));
    findings.check_range("TIM1_ARR", shortest, longest, u64::from(register(timer, ARR)));
    findings.check_bits("TIM1_RCR", 0xFF, 0, register(timer, RCR));
    findings.check("timer clock of TIM1", 168_000_000, timer.clock_hz(), |hertz| format!("{hertz} Hz"));
}

fn outputs(timer: &AdvancedTimer, findings: &mut Findings) {
    // OCxM = 6 and OCxPE.
    findings.check_bits("TIM1_CCMR1: PWM mode 1 with preload", 0x7878, 0x6868, register(timer, CCMR1));
    findings.check_bits("TIM1_CCMR2: PWM mode 1 with preload", 0x0078, 0x0068, register(timer, CCMR2));
    let enables = register(timer, CCER);
    findings.check_bits("TIM1_CCER: all six outputs", ALL_SWITCHES, ALL_SWITCHES, enables);
    findings.check_bits("TIM1_CCER: outputs active high", 0x0AAA, 0, enables);
    findings.check_bits("TIM1_CR2: idle levels", 0x3F00, 0, register(timer, CR2));
    let (shortest, longest) = (u64::from(SHORTEST_DEAD_TIME_NS), u64::from(LONGEST_DEAD_TIME_NS));
    findings.check_range("TIM1 dead time, ns", shortest, longest, u64::from(timer.dead_time_ns()));
    let protection = register(timer, BDTR);
    findings.check_bits("TIM1_BDTR OSSI", IDLE_STATE_DRIVEN, IDLE_STATE_DRIVEN, protection);
    findings.check_bits("TIM1_BDTR OSSR", RUN_STATE_DRIVEN, RUN_STATE_DRIVEN, protection);
    findings.check_bits("TIM1_BDTR BKE", BREAK_ENABLE, BREAK_ENABLE, protection);
    findings.check_bits("TIM1_BDTR BKP: active low", BREAK_ACTIVE_HIGH, 0, protection);
    findings.check_bits("TIM1_BDTR AOE", AUTOMATIC_OUTPUT, 0, protection);
}

fn trigger(timer: &AdvancedTimer, converters: &Converters, findings: &mut Findings) {
    const REFERENCE_4: u32 = 7 << 4;
    findings.check_bits("TIM1_CR2 MMS: OC4REF", REFERENCE_4, REFERENCE_4, register(timer, CR2));
    // OC4M = 7 and OC4PE: the reference rises on the way up.
    findings.check_bits("TIM1_CCMR2: PWM mode 2 with preload on channel 4", 0x7800, 0x7800, register(timer, CCMR2));
    let before_peak = register(timer, ARR).saturating_sub(register(timer, CCR4));
    let clocks = u64::from(before_peak) * u64::from(register(timer, PSC) + 1);
    let before_peak = clocks * 1_000_000_000 / timer.clock_hz();
    let latency = (TRIGGER_LATENCY * 1_000_000_000).checked_div(converters.converter_hz()).unwrap_or(0);
    for number in 1..=3 {
        let sampling = converters.first_sampling_time(number).0;
        findings.check_range(
            format!("hold instant of ADC{number}: TIM1_CCR4 before the peak, ns"),
            sampling.saturating_sub(HOLD_TOLERANCE_NS),
            sampling + latency + HOLD_TOLERANCE_NS,
            before_peak,
        );
    }
}

fn converters(converters: &Converters, findings: &mut Findings) {
    /// Data sheet.
    const SLOWEST_CLOCK_HZ: u64 = 600_000;
    findings.check_range("ADC clock, Hz", SLOWEST_CLOCK_HZ, FASTEST_CLOCK_HZ, converters.converter_hz());
    findings.check("ADC_CCR MULTI", TRIPLE, converters.multi(), |mode| format!("{mode:#07b}"));
    for (number, channels) in (1..=3).zip(ADC_SEQUENCES) {
        let name = |what: &str| format!("ADC{number}: {what}");
        let master = number == 1;
        findings.check(name("injected channels"), channels.to_vec(), converters.sequence(number), |channels| {
            format!("{channels:?}")
        });
        let [scan, control] = converters.control(number);
        findings.check_bits(&name("CR1 SCAN"), 1 << 8, 1 << 8, scan);
        let interrupt = if master { INJECTED_INTERRUPT } else { 0 };
        findings.check_bits(&name("CR1 JEOCIE"), INJECTED_INTERRUPT, interrupt, scan);
        findings.check_bits(&name("CR2 ADON"), 1, 1, control);
        findings.check_bits(&name("CR2 ALIGN"), 1 << 11, 0, control);
        // The slaves follow the master; a trigger of their own would start them a second time.
        let triggered = if master { TRIGGERED_BY_TIM1 } else { 0 };
        let mask = if master { adc::TRIGGER_EDGES | adc::TRIGGER_SOURCE } else { adc::TRIGGER_EDGES };
        findings.check_bits(&name("CR2 JEXTEN and JEXTSEL"), mask, triggered, control);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::peripherals::tests::{Board, set_up_power_stage};

    fn deviations_after(writes: &[(u32, u32)]) -> Vec<String> {
        let mut board = Board::new();
        let mut set_up = set_up_power_stage();
        for (address, value) in writes {
            // A deviation takes the place of the right value.
            let right = set_up.iter_mut().find(|(other, _)| other == address).unwrap();
            right.1 = *value;
        }
        board.set_up(&set_up);
        deviations(&board.peripherals).iter().map(ToString::to_string).collect()
    }

    #[test]
    fn the_right_set_up_has_no_deviation() {
        assert_eq!(deviations_after(&[]), Vec::<String>::new());
    }

    #[test]
    fn a_part_after_reset_has_many() {
        assert!(deviations(&Board::new().peripherals).len() > 40);
    }

    #[test]
    fn every_deviation_is_found_and_named() {
        for (address, value, what) in [
            (0x4001_0000, 0x01A1 & !0x80, "ARPE"),
            (0x4001_0000, 0x00A0, "CEN"),
            (0x4001_0028, 1, "TIM1_PSC"),
            (0x4001_002C, 5_200, "TIM1_ARR"),
            (0x4001_0030, 1, "TIM1_RCR"),
            (0x4001_0018, 0x6860, "TIM1_CCMR1"),
            (0x4001_001C, 0x7860, "TIM1_CCMR2"),
            (0x4001_001C, 0x6868, "PWM mode 2"),
            (0x4001_0020, 0x0455, "all six outputs"),
            (0x4001_0020, 0x055D, "active high"),
            (0x4001_0004, 0x0270, "idle levels"),
            (0x4001_0004, 0x0060, "MMS"),
            (0x4001_0040, 5_170, "hold instant of ADC2"),
            (0x4001_0040, 5_245, "hold instant of ADC3"),
            (0x4001_0044, 0x1C8B, "dead time"),
            (0x4001_0044, 0x1CA0, "dead time"),
            (0x4001_0044, 0x1894, "OSSI"),
            (0x4001_0044, 0x1494, "OSSR"),
            (0x4001_0044, 0x0C94, "BKE"),
            (0x4001_0044, 0x3C94, "BKP"),
            (0x4001_2304, 0x0000_0015, "ADC clock"),
            (0x4001_2304, 0x0001_0005, "MULTI"),
            (0x4001_200C, 7, "hold instant of ADC1"),
            (0x4001_2138, 0x0010_2C0E, "ADC2: injected channels"),
            (0x4001_2004, 0x0000_0080, "ADC1: CR1 SCAN"),
            (0x4001_2204, 0x0000_0180, "ADC3: CR1 JEOCIE"),
            (0x4001_2008, 0x0000_0001, "ADC1: CR2 JEXTEN"),
            (0x4001_2108, 0x0011_0001, "ADC2: CR2 JEXTEN"),
            (0x4001_2208, 0x0000_0000, "ADC3: CR2 ADON"),
            (0x4001_2008, 0x0011_0801, "ADC1: CR2 ALIGN"),
            (0x4002_0400, 0, "break input"),
        ] {
            let found = deviations_after(&[(address, value)]);
            assert!(found.iter().any(|finding| finding.contains(what)), "{address:#x} = {value:#x}: {found:?}");
        }
    }

    #[test]
    fn outputs_that_come_back_by_themselves_are_found() {
        let mut board = Board::new();
        board.set_up(&set_up_power_stage());
        board.write(0x4001_0044, 0x5C94);
        let found: Vec<String> = deviations(&board.peripherals).iter().map(ToString::to_string).collect();
        assert_eq!(found, ["TIM1_BDTR AOE: expected 0x0000, actual 0x4000"]);
    }
}
