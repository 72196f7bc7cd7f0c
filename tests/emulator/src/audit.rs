//! Checks what the binary has set up: clock tree, pins, external bus, interrupts.

use crate::peripherals::encoder_counters::{TIM2, TIM3, TIM4, TIM8, TIM9};
use crate::peripherals::gpio::Port;
use crate::wiring::{ExpectedPin, expected_pins, pin_name};
use crate::{EmulatorError, Guest};

mod power_stage;

pub use power_stage::audit_power_stage;

/// Something that is not as it should be.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Finding {
    /// What was looked at.
    pub what: String,
    /// What the board needs.
    pub expected: String,
    /// What the binary did.
    pub actual: String,
}

impl std::fmt::Display for Finding {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(formatter, "{}: expected {}, actual {}", self.what, self.expected, self.actual)
    }
}

/// An interrupt that the product must have enabled, with its priority.
#[derive(Clone, Copy, Debug)]
struct ExpectedInterrupt {
    name: &'static str,
    number: u8,
    /// RTIC priority: 1 low to 15, 4 bits are implemented; 16 is above what RTIC masks.
    priority: u8,
}

/// The table of the application: hardware tasks, and the vectors borrowed for tasks that are pended by software.
const INTERRUPTS: [ExpectedInterrupt; 11] = [
    interrupt("WWDG (fault handler)", 0, 16),
    interrupt("ADC (current_loop)", 18, 5),
    interrupt("EXTI2 (INT1)", 8, 4),
    interrupt("EXTI3 (INT0)", 9, 4),
    interrupt("CAN1_TX (command_valid)", 19, 4),
    interrupt("CAN1_RX0 (capture_feedback)", 20, 4),
    interrupt("CAN2_TX (control_loop)", 63, 4),
    interrupt("CAN2_RX0 (supervision)", 64, 4),
    interrupt("CAN2_RX1 (velocity_loop)", 65, 4),
    interrupt("CAN1_RX1 (phase_change)", 21, 2),
    interrupt("CAN1_SCE (service_channel)", 22, 2),
];

const fn interrupt(name: &'static str, number: u8, priority: u8) -> ExpectedInterrupt {
    ExpectedInterrupt { name, number, priority }
}

#[derive(Default)]
struct Findings(Vec<Finding>);

impl Findings {
    fn check<T: PartialEq>(&mut self, what: impl Into<String>, expected: T, actual: T, show: impl Fn(&T) -> String) {
        if expected != actual {
            self.0.push(Finding { what: what.into(), expected: show(&expected), actual: show(&actual) });
        }
    }
}

/// Compares the state of all peripherals with what the board needs; to be called once the product has finished its set-up.
///
/// The power stage on the board has an audit of its own: [`audit_power_stage`].
///
/// # Errors
/// The end of QEMU.
pub fn audit(guest: &mut Guest) -> Result<Vec<Finding>, EmulatorError> {
    let mut findings = Findings::default();
    clocks(guest, &mut findings);
    pins(&guest.peripherals().ports, expected_pins(), &mut findings);
    bus(guest, &mut findings);
    pin_interrupts(guest, &mut findings);
    timers(guest, &mut findings);
    controller(guest, &mut findings)?;
    Ok(findings.0)
}

fn clocks(guest: &Guest, findings: &mut Findings) {
    let tree = guest.peripherals().clock_tree();
    for (name, expected, actual) in [
        ("SYSCLK", 168_000_000, tree.system),
        ("HCLK", 168_000_000, tree.core),
        ("PCLK1", 42_000_000, tree.apb1),
        ("PCLK2", 84_000_000, tree.apb2),
        ("timer clock of APB1", 84_000_000, tree.apb1_timers),
        ("timer clock of APB2", 168_000_000, tree.apb2_timers),
    ] {
        findings.check(name, expected, actual, |hertz| format!("{hertz} Hz"));
    }
    findings.check("clock from the crystal", true, tree.from_crystal, bool::to_string);
    let controller = &guest.peripherals().flash;
    findings.check("flash controller locked", true, controller.is_locked(), bool::to_string);
    let flash = controller.access_control;
    findings.check("flash wait states", 5, flash & 7, u32::to_string);
    findings.check("flash prefetch and caches", 7, flash >> 8 & 7, |bits| format!("{bits:#05b}"));
}

fn pins(ports: &[Port], expected: Vec<ExpectedPin>, findings: &mut Findings) {
    for expected in expected {
        let (port, number) = expected.pin;
        let name = format!("{} {}", pin_name(expected.pin), expected.signal);
        let port = &ports[port];
        findings.check(format!("{name}: mode"), expected.mode, port.mode(number), |mode| format!("{mode:?}"));
        findings.check(
            format!("{name}: pull (0 none, 1 up, 2 down)"),
            expected.pull,
            port.pull(number),
            u32::to_string,
        );
        let speed = port.speed(number);
        if speed < expected.speed {
            findings.0.push(Finding {
                what: format!("{name}: output speed code"),
                expected: format!("at least {}", expected.speed),
                actual: speed.to_string(),
            });
        }
        findings.check(format!("{name}: open drain"), false, port.is_open_drain(number), bool::to_string);
    }
}

fn bus(guest: &Guest, findings: &mut Findings) {
    let fsmc = &guest.peripherals().fsmc;
    // Bank on, SRAM, 16 bits, not multiplexed, writable, NWAIT active low and asynchronous, extended mode A, slowest bring-up timing.
    for (name, offset, expected, mask) in [
        ("FSMC_BCR1", 0x000, 0x0000_F091, u32::MAX),
        ("FSMC_BTR1", 0x004, 0x000F_3C1F, u32::MAX),
        ("FSMC_BWTR1", 0x104, 0x000F_3C1F, 0xF00F_FFFF),
    ] {
        let actual = fsmc.read(offset).unwrap_or(0) & mask;
        findings.check(name, expected, actual, |value| format!("{value:#010x}"));
    }
}

fn pin_interrupts(guest: &Guest, findings: &mut Findings) {
    const BOTH: u32 = 0b1100;
    let peripherals = guest.peripherals();
    for line in [2, 3] {
        let port = peripherals.syscfg.port(line);
        findings.check(format!("port of EXTI{line}"), 0, port, usize::to_string);
    }
    let exti = &peripherals.exti;
    for (name, actual) in [("EXTI_IMR", exti.interrupt_mask), ("EXTI_RTSR", exti.rising), ("EXTI_FTSR", exti.falling)] {
        findings.check(name, BOTH, actual, |value| format!("{value:#06x}"));
    }
}

fn timers(guest: &Guest, findings: &mut Findings) {
    let peripherals = guest.peripherals();
    for (name, number) in [("TIM2", TIM2), ("TIM3", TIM3), ("TIM4", TIM4), ("TIM8", TIM8)] {
        let counts = peripherals.counters.timer(number).counts_tracks_as_wired();
        findings.check(format!("{name} counts all edges of the encoder as wired"), true, counts, bool::to_string);
    }
    // Tracks and marks are latched together only behind equal filters: 8 samples at 84 MHz.
    for (name, number, channels) in
        [("TIM2", TIM2, 4), ("TIM3", TIM3, 3), ("TIM4", TIM4, 3), ("TIM8", TIM8, 3), ("TIM9", TIM9, 2)]
    {
        for channel in 1..=channels {
            let filter = peripherals.counters.timer(number).filter_of(channel).0;
            findings.check(format!("filter of {name}_CH{channel}, ns"), 95, filter, u64::to_string);
        }
    }
}

fn controller(guest: &mut Guest, findings: &mut Findings) -> Result<(), EmulatorError> {
    const ENABLED: u32 = 0xE000_E100;
    const PRIORITY: u32 = 0xE000_E400;
    const SYSTEM_HANDLERS: u32 = 0xE000_ED24;
    let enabled = guest.read_memory(ENABLED, 3)?;
    let priorities = guest.read_memory(PRIORITY, 24)?;
    let enabled = enabled.iter().rev().fold(0_u128, |all, word| all << 32 | u128::from(*word));
    let mut expected = 0;
    for interrupt in INTERRUPTS {
        expected |= 1 << interrupt.number;
        let word = priorities[usize::from(interrupt.number / 4)];
        let actual = (word >> (8 * (interrupt.number % 4)) & 0xFF) as u8;
        findings.check(
            format!("NVIC priority of {}", interrupt.name),
            (16 - interrupt.priority) << 4,
            actual,
            |value| format!("{value:#04x}"),
        );
    }
    findings.check("enabled interrupts", expected, enabled, |set| {
        let numbers: Vec<String> =
            (0..96).filter(|number| set & 1 << number != 0).map(|number| number.to_string()).collect();
        numbers.join(" ")
    });
    // Every fault of the product shall end in HardFault, where the bus sees and reports it.
    let handlers = guest.read_memory(SYSTEM_HANDLERS, 1)?[0];
    findings.check("SHCSR fault enables", 0, handlers >> 16 & 7, u32::to_string);
    Ok(())
}
