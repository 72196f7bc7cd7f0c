//! Lost telegrams, illegal modes, the errors and warnings of the drive, and how they are told and cleared.

use bench::Amplifier;
use ring::Nanoseconds;
use ring::fibre::{Effect, TelegramKind};
use ring::service_client::status;

use crate::case::{Case, Section, ensure, expect};
use crate::configuration::Configuration;
use crate::slave::{Outcome, Slave};

const SECTION: Section = Section::ErrorHandling;

const CLASS_1: u16 = 11;
const CLASS_2: u16 = 12;
const CLASS_3: u16 = 13;
const INTERFACE: u16 = 14;
/// Of S-0-0011.
const COMMUNICATION: u64 = 1 << 12;
const MST_ERRORS: u16 = 28;
const MDT_ERRORS: u16 = 29;
const DIAGNOSTIC_NUMBER: u16 = 390;
const CHANGE_2: u16 = 1 << 12;
const CHANGE_3: u16 = 1 << 11;
const HEALTHY: Amplifier = Amplifier { main_power: true, fault: false };

pub(super) fn cases() -> Vec<Case> {
    [supervision(), diagnosis(), modes(), drive_errors()].into_iter().flatten().collect()
}

/// What can happen to one telegram, and whether the slave still takes it.
fn mishaps() -> [(&'static str, TelegramKind, Effect); 7] {
    let late = |microseconds| Effect::Delay(Nanoseconds::from_microseconds(microseconds));
    [
        ("an MST is lost", TelegramKind::Mst, Effect::Drop),
        ("an MST is damaged", TelegramKind::Mst, Effect::FlipBit(20)),
        ("an MST is 50 us late", TelegramKind::Mst, late(50)),
        ("an MDT is lost", TelegramKind::Mdt, Effect::Drop),
        ("an MDT is damaged", TelegramKind::Mdt, Effect::FlipBit(40)),
        ("an MDT is 60 us late", TelegramKind::Mdt, late(60)),
        ("an MDT has another address", TelegramKind::Mdt, Effect::Byte { index: 0, value: 77 }),
    ]
}

fn supervision() -> Vec<Case> {
    let mut cases = Vec::new();
    for phase in [3, 4] {
        for (what, kind, effect) in mishaps() {
            let rule = format!("CP{phase}: {what} once: no error, and it is counted");
            cases.push(Case::new(SECTION, rule, "sercos2.md 2.4", move |slave| {
                slave.run_up(phase, Configuration::default())?;
                slave.cycles(50);
                slave.disturb(kind, effect, 1);
                slave.cycles(20);
                expect("S-0-0014", slave.number(INTERFACE)?, phase.into())?;
                expect("S-0-0011", slave.number(CLASS_1)?, 0)?;
                let counted = (slave.number(MST_ERRORS)?, slave.number(MDT_ERRORS)?);
                let by_one = match kind {
                    TelegramKind::Mst => counted.0 == 1 && counted.1 <= 1,
                    _ => counted == (0, 1),
                };
                ensure(by_one, || format!("S-0-0028 and S-0-0029: {counted:?}"))
            }));
        }
        for (kind, bit, name) in [(TelegramKind::Mst, 3, "MSTs"), (TelegramKind::Mdt, 4, "MDTs")] {
            let rule =
                format!("CP{phase}: two {name} lost in a row: CP0, S-0-0014 bit {bit}, phase {phase} frozen, recovery");
            cases.push(Case::new(SECTION, rule, "sercos2.md 2.4", move |slave| {
                slave.run_up(phase, Configuration::default())?;
                slave.cycles(50);
                slave.disturb(kind, Effect::Drop, 2);
                slave.cycles(6);
                ends_in_cp0(slave, 1 << bit | u64::from(phase))
            }));
        }
        let rule = format!("CP{phase}: every second MST lost, ten times: no error, all counted");
        cases.push(Case::new(SECTION, rule, "sercos2.md 2.4", move |slave| {
            slave.run_up(phase, Configuration::default())?;
            slave.cycles(50);
            for _ in 0..10 {
                slave.disturb(TelegramKind::Mst, Effect::Drop, 1);
                slave.cycles(4);
            }
            slave.cycles(5);
            expect("S-0-0014", slave.number(INTERFACE)?, phase.into())?;
            expect("S-0-0028", slave.number(MST_ERRORS)?, 10)
        }));
        let rule = format!("CP{phase}: no light for 20 cycles: CP0, S-0-0014 bit 3, recovery");
        cases.push(Case::new(SECTION, rule, "sercos2.md 2.4", move |slave| {
            slave.run_up(phase, Configuration::default())?;
            slave.cycles(50);
            slave.disturb(TelegramKind::Mst, Effect::Drop, 20);
            slave.disturb(TelegramKind::Mdt, Effect::Drop, 20);
            slave.cycles(25);
            slave.to_cp2()?;
            let interface = slave.number(INTERFACE)?;
            expect("bit 3", interface >> 3 & 1, 1)?;
            expect("frozen phase", interface & 7, phase.into())?;
            expect("S-0-0099", slave.command(99)?, 3)?;
            slave.run_up(4, Configuration::default())
        }));
    }
    for (kind, counter) in [(TelegramKind::Mst, MST_ERRORS), (TelegramKind::Mdt, MDT_ERRORS)] {
        let rule = format!("of a burst only two count in S-0-{counter:04}, until the next way to CP3");
        cases.push(Case::new(SECTION, rule, "sercos2.md 2.4", move |slave| {
            slave.run_up(4, Configuration::default())?;
            slave.disturb(kind, Effect::Drop, 8);
            slave.cycles(10);
            slave.to_cp2()?;
            expect("count", slave.number(counter)?, 2)?;
            slave.run_up(3, Configuration::default())?;
            expect("count after a new CP3", slave.number(counter)?, 0)
        }));
    }
    for phase in [1, 2] {
        let rule = format!("CP{phase}: lost telegrams are no error");
        cases.push(Case::new(SECTION, rule, "sercos2.md 2.4", move |slave| {
            slave.run_up(phase, Configuration::default())?;
            slave.disturb(TelegramKind::Mdt, Effect::Drop, 10);
            slave.disturb(TelegramKind::Mst, Effect::Drop, 10);
            slave.cycles(15);
            if phase == 1 {
                slave.mst = Some(2);
                slave.cycles(3);
            }
            expect("S-0-0014", slave.number(INTERFACE)?, 2)
        }));
    }
    cases.push(Case::new(SECTION, "status word bit 13 shows C1D until S-0-0099", "sercos2.md 1.7", |slave| {
        slave.run_up(4, Configuration::default())?;
        slave.disturb(TelegramKind::Mdt, Effect::Drop, 2);
        slave.cycles(6);
        slave.to_cp2()?;
        slave.cycles(2);
        let shut_down = |slave: &Slave| slave.last.as_ref().map(|at| at.status & status::SHUT_DOWN != 0);
        expect("bit 13", shut_down(slave), Some(true))?;
        expect("S-0-0099", slave.command(99)?, 3)?;
        slave.cycles(2);
        expect("bit 13 after S-0-0099", shut_down(slave), Some(false))
    }));
    for phase in [2, 3, 4] {
        let rule = format!("S-0-0099 clears an error of the last run in CP{phase}");
        cases.push(Case::new(SECTION, rule, "sercos2.md 3.6, 4.3", move |slave| {
            slave.run_up(4, Configuration::default())?;
            slave.mst = Some(2);
            slave.cycles(6);
            slave.run_up(phase, Configuration::default())?;
            expect("S-0-0014", slave.number(INTERFACE)?, 1 << 7 | 4)?;
            expect("S-0-0099", slave.command(99)?, 3)?;
            expect("S-0-0014", slave.number(INTERFACE)?, phase.into())?;
            expect("S-0-0011", slave.number(CLASS_1)?, 0)
        }));
    }
    cases
}

fn diagnosis() -> Vec<Case> {
    let mut cases = Vec::new();
    for (phase, number, text) in [
        (2, 0xA002, "Communication phase 2"),
        (3, 0xA003, "Communication phase 3"),
        (4, 0xA011, "Power applied, torque-free"),
    ] {
        let rule = format!("CP{phase} is {number:04X}H in S-0-0390 and \"{text}\" in S-0-0095");
        cases.push(Case::new(SECTION, rule, "sercos2.md 4.1", move |slave| {
            slave.run_up(phase, Configuration::default())?;
            slave.cycles(200);
            expect("S-0-0390", slave.number(DIAGNOSTIC_NUMBER)?, number)?;
            expect("S-0-0095", slave.text(95)?, text.to_owned())?;
            ensure(!slave.text(0x800A)?.is_empty(), || "P-0-0010 is empty".to_owned())
        }));
    }
    // From a phase, an MST byte that may not follow; the number of S-0-0390 (every phase error has a row of its own).
    for (from, to, number) in [(4, 5, 0xF005), (2, 4, 0xF006), (4, 2, 0xF007), (2, 3, 0xF008), (3, 4, 0xF008)] {
        let rule = format!("CP{from} to CP{to} is {number:04X}H, with text, cause and remedy, and stays in S-0-0375");
        cases.push(Case::new(SECTION, rule, "sercos2.md 2.4, 4.1", move |slave| {
            slave.run_up(from, Configuration::default())?;
            slave.mst = Some(to);
            slave.cycles(6);
            told(slave, number)
        }));
    }
    for (kind, number) in [(TelegramKind::Mst, 0xF003), (TelegramKind::Mdt, 0xF004)] {
        let rule = format!("two lost telegrams are {number:04X}H, with text, cause and remedy, and stay in S-0-0375");
        cases.push(Case::new(SECTION, rule, "sercos2.md 2.4, 4.1", move |slave| {
            slave.run_up(4, Configuration::default())?;
            slave.disturb(kind, Effect::Drop, 2);
            slave.cycles(6);
            told(slave, number)
        }));
    }
    cases.push(Case::new(
        SECTION,
        "S-0-0375 keeps the last 32 errors, the newest first, with their times",
        "issue: error memory",
        |slave| {
            for round in 0..34 {
                slave.to_cp2()?;
                slave.mst = Some(if round == 33 { 7 } else { 4 });
                slave.cycles(4);
            }
            slave.to_cp2()?;
            let numbers = slave.entries(375)?;
            expect("entries", numbers.len(), 32)?;
            expect("newest", numbers[..2].to_vec(), vec![0xF005, 0xF006])?;
            let times = slave.entries(0x8004)?;
            let seconds: Vec<u32> = times.chunks(2).map(|pair| u32::from(pair[0]) | u32::from(pair[1]) << 16).collect();
            expect("times", seconds.len(), 32)?;
            ensure(seconds.windows(2).all(|pair| pair[0] >= pair[1]), || format!("times do not descend: {seconds:?}"))
        },
    ));
    cases.push(Case::new(
        SECTION,
        "change bit 11 comes with a change of C3D and goes with reading S-0-0013",
        "sercos2.md 4.1",
        |slave| {
            in_operation(slave, 2, Configuration::application(&[13], &[36]))?;
            slave.number(CLASS_3)?;
            slave.cycles(20);
            expect("bit 11 while nothing changes", bit(slave, CHANGE_3)?, false)?;
            slave.commands = 1_500_000_i32.to_le_bytes().to_vec();
            slave.cycles(100);
            expect("bit 11 when the motor has started", bit(slave, CHANGE_3)?, true)?;
            slave.cycles(1_000);
            slave.number(CLASS_3)?;
            slave.cycles(2);
            expect("bit 11 after reading", bit(slave, CHANGE_3)?, false)
        },
    ));
    cases.push(Case::new(SECTION, "the mask S-0-0098 keeps change bit 11, not S-0-0013", "sercos2.md 4.1", |slave| {
        in_operation(slave, 2, Configuration::application(&[13], &[36]).with(98, &[0]))?;
        let standing = slave.number(CLASS_3)?;
        slave.commands = 1_000_000_i32.to_le_bytes().to_vec();
        slave.cycles(100);
        expect("bit 11", bit(slave, CHANGE_3)?, false)?;
        let running = slave.number(CLASS_3)?;
        ensure(standing & 2 != 0 && running & 2 == 0, || format!("S-0-0013 {standing:04X}H, then {running:04X}H"))
    }));
    cases.push(Case::new(
        SECTION,
        "change bit 12 comes and goes with S-0-0012 in the same way",
        "sercos2.md 4.1",
        |slave| {
            slave.run_up(4, Configuration::default())?;
            slave.cycles(100);
            slave.number(CLASS_2)?;
            slave.cycles(2);
            expect("bit 12 while nothing changes", bit(slave, CHANGE_2)?, false)?;
            amplifier(slave, Amplifier { main_power: true, fault: true });
            slave.cycles(3);
            expect("bit 12 with a warning", bit(slave, CHANGE_2)?, true)?;
            expect("S-0-0012", slave.number(CLASS_2)?, 1 << 15)?;
            slave.cycles(2);
            expect("bit 12 after reading", bit(slave, CHANGE_2)?, false)?;
            expect("S-0-0181", slave.number(181)?, 1 << 2)?;
            amplifier(slave, HEALTHY);
            slave.cycles(3);
            expect("S-0-0012 is not latched", slave.number(CLASS_2)?, 0)
        },
    ));
    cases.push(Case::new(SECTION, "the mask S-0-0097 keeps change bit 12, not S-0-0012", "sercos2.md 4.1", |slave| {
        slave.run_up(4, Configuration::default().with(97, &[0x7FFF]))?;
        slave.cycles(100);
        slave.number(CLASS_2)?;
        slave.cycles(2);
        amplifier(slave, Amplifier { main_power: true, fault: true });
        slave.cycles(3);
        expect("bit 12", bit(slave, CHANGE_2)?, false)?;
        expect("S-0-0012", slave.number(CLASS_2)?, 1 << 15)
    }));
    cases.push(Case::new(SECTION, "a lost telegram is a warning for a second", "issue: C2D", |slave| {
        slave.run_up(4, Configuration::default())?;
        slave.cycles(600);
        expect("S-0-0181 before", slave.number(181)?, 0)?;
        slave.disturb(TelegramKind::Mdt, Effect::Drop, 1);
        slave.cycles(10);
        expect("S-0-0181", slave.number(181)?, 1 << 1)?;
        expect("S-0-0390", slave.number(DIAGNOSTIC_NUMBER)?, 0xE001)?;
        slave.cycles(500);
        expect("S-0-0181 a second later", slave.number(181)?, 0)
    }));
    cases.push(Case::new(
        SECTION,
        "a velocity deviation beyond S-0-0377 is C2D bit 11 and S-0-0321",
        "sercos2.md 4.3",
        |slave| {
            in_operation(slave, 2, Configuration::application(&[13], &[36]).with_long(377, 50_000))?;
            expect("S-0-0321 standing", slave.number(321)?, 0)?;
            slave.commands = 10_000_000_i32.to_le_bytes().to_vec();
            slave.cycles(8);
            expect("C2D bit 11", slave.number(CLASS_2)? >> 11 & 1, 1)?;
            expect("S-0-0321", slave.number(321)?, 1)?;
            slave.cycles(1_500);
            expect("S-0-0321 at speed", slave.number(321)?, 0)
        },
    ));
    for (mask, idn) in [(1, 330), (2, 331), (4, 332), (8, 333), (16, 334), (32, 335), (64, 336)] {
        let rule = format!("S-0-{idn:04} is C3D bit {}", u16::trailing_zeros(mask));
        cases.push(Case::new(SECTION, rule, "sercos2.md 4.3", move |slave| {
            in_operation(slave, 3, Configuration::application(&[13, 51], &[47]))?;
            for _ in 0..3 {
                slave.cycles(20);
                let class_3 = slave.number(CLASS_3)?;
                expect("S-0-0013", slave.number(idn)?, u64::from(class_3 & u64::from(mask) != 0))?;
            }
            Ok(())
        }));
    }
    cases
}

fn modes() -> Vec<Case> {
    let mut cases = Vec::new();
    const MODES: [u16; 8] = [32, 33, 34, 35, 284, 285, 286, 287];
    for (selected, idn) in MODES.into_iter().enumerate().skip(1) {
        let rule = format!("mode {selected} not initialised, bits 15 and 14 clear: no error");
        cases.push(Case::new(SECTION, rule, "sercos2.md 6.2", move |slave| {
            slave.run_up(4, Configuration::default())?;
            slave.control = select(selected);
            slave.cycles(20);
            let at = slave.last.clone().ok_or("no AT")?;
            expect("status bits 10 to 8: the mode in force", at.status >> 8 & 7, 0)?;
            expect("S-0-0014", slave.number(INTERFACE)?, 4)?;
            expect("S-0-0011", slave.number(CLASS_1)?, 0)
        }));
        for (bits, name) in [(0x8000, "15"), (0x4000, "14"), (0xE000, "15 to 13")] {
            let rule = format!(
                "mode {selected} not initialised, bit {name} set: S-0-0014 bit 9, C1D bit 12, S-0-{idn:04} in S-0-0023, in CP4"
            );
            cases.push(Case::new(SECTION, rule, "sercos2.md 6.2", move |slave| {
                slave.run_up(4, Configuration::default())?;
                slave.cycles(50);
                slave.control = select(selected) | bits;
                slave.cycles(20);
                let at = slave.last.clone().ok_or("no AT")?;
                expect("status bits 15 and 14", at.status >> 14 == 3, false)?;
                expect("status bits 13 and 10 to 8", (at.status >> 13 & 1, at.status >> 8 & 7), (1, 0))?;
                expect("S-0-0014", slave.number(INTERFACE)?, 1 << 9 | 4)?;
                expect("S-0-0011", slave.number(CLASS_1)?, COMMUNICATION)?;
                expect("S-0-0390", slave.number(DIAGNOSTIC_NUMBER)?, 0xF009)?;
                expect("S-0-0023", slave.entries(23)?, vec![idn])?;
                // The cause is still there.
                slave.command(99)?;
                slave.cycles(5);
                expect("S-0-0014 with the cause", slave.number(INTERFACE)?, 1 << 9 | 4)?;
                expect("S-0-0011 with the cause", slave.number(CLASS_1)?, COMMUNICATION)?;
                expect("S-0-0375", slave.entries(375)?, vec![0xF009, 0xF009])?;
                slave.control = 0;
                slave.cycles(2);
                expect("S-0-0099", slave.command(99)?, 3)?;
                expect("S-0-0023 after S-0-0099", slave.entries(23)?, vec![])?;
                expect("S-0-0014 after S-0-0099", slave.number(INTERFACE)?, 4)?;
                expect("S-0-0011 after S-0-0099", slave.number(CLASS_1)?, 0)
            }));
        }
        let rule = format!("mode {selected} (S-0-{idn:04}) is switched to in CP4 and echoed in status bits 10 to 8");
        cases.push(Case::new(SECTION, rule, "sercos2.md 1.7, 6.2", move |slave| {
            let configuration = Configuration::application(&[51], &[47, 36]).with(32, &[2]).with(idn, &[11]);
            slave.run_up(4, configuration)?;
            slave.control = select(selected);
            slave.cycles(5);
            let at = slave.last.clone().ok_or("no AT")?;
            expect("status bits 10 to 8", usize::from(at.status >> 8 & 7), selected)?;
            slave.control = 0;
            slave.cycles(5);
            let at = slave.last.clone().ok_or("no AT")?;
            expect("status bits 10 to 8 of the primary mode", at.status >> 8 & 7, 0)?;
            expect("S-0-0014", slave.number(INTERFACE)?, 4)
        }));
    }
    cases.push(Case::new(
        SECTION,
        "S-0-0292 names exactly the modes that S-0-0128 accepts",
        "sercos2.md 6.2",
        |slave| {
            slave.to_cp2()?;
            let supported = slave.entries(292)?;
            for mode in 1..=15 {
                let all = Configuration::application(&[51], &[47, 36, 80]).with(32, &[mode]);
                slave.run_up(3, all)?;
                let status = slave.command(128)?;
                expect(&format!("S-0-0128 with mode {mode}"), status == 3, supported.contains(&mode))?;
                if status != 3 {
                    expect("S-0-0022", slave.entries(22)?, vec![32])?;
                }
            }
            Ok(())
        },
    ));
    cases.push(Case::new(
        SECTION,
        "the motor changes from velocity to position mode while it runs",
        "sercos2.md 6.2",
        |slave| {
            let configuration = Configuration::application(&[51, 40], &[36, 47]).with(33, &[11]);
            in_operation(slave, 2, configuration)?;
            let velocity = 1_000_000_i32;
            let put = |slave: &mut Slave, velocity: i32, position: i32| {
                slave.commands = [velocity.to_le_bytes(), position.to_le_bytes()].concat();
            };
            put(slave, velocity, 0);
            slave.cycles(500);
            let at = slave.last.clone().ok_or("no AT")?;
            ensure((at.long(4) - velocity).abs() < 20_000, || format!("velocity {}", at.long(4)))?;
            // 100 rpm: 600 degrees a second, 1.2 degrees in 2 ms.
            let mut position = at.long(0) + 12_000;
            slave.control |= select(1);
            for _ in 0..500 {
                position += 12_000;
                put(slave, velocity, position);
                ensure(slave.cycle().is_some(), || "an AT is missing".to_owned())?;
            }
            let at = slave.last.clone().ok_or("no AT")?;
            ensure(status::readiness(at.status) == 3, || format!("status {:04X}H", at.status))?;
            let lag = position - at.long(0);
            ensure(lag.abs() < 40_000, || format!("{lag} of 0.0001 degrees behind"))
        },
    ));
    cases
}

fn drive_errors() -> Vec<Case> {
    let mut cases = Vec::new();
    cases.push(Case::new(
        SECTION,
        "an amplifier fault with torque: C1D bit 15, S-0-0129, torque off, F10FH",
        "sercos2.md 4.3, 6.3",
        |slave| {
            in_operation(slave, 2, Configuration::default())?;
            amplifier(slave, Amplifier { main_power: true, fault: true });
            slave.cycles(3);
            shut_down(slave, 1 << 15, 0xF10F)?;
            expect("S-0-0129", slave.number(129)?, 1)?;
            expect("S-0-0099 while the cause is there", slave.command(99)?, 0xF)?;
            amplifier(slave, HEALTHY);
            slave.cycles(3);
            expect("S-0-0099", slave.command(99)?, 3)?;
            expect("S-0-0011", slave.number(CLASS_1)?, 0)
        },
    ));
    cases.push(Case::new(
        SECTION,
        "lost main power with torque: C1D bit 9, torque off, F109H",
        "sercos2.md 4.3, 6.3",
        |slave| {
            in_operation(slave, 2, Configuration::default())?;
            amplifier(slave, Amplifier { main_power: false, fault: false });
            slave.cycles(3);
            shut_down(slave, 1 << 9, 0xF109)
        },
    ));
    cases.push(Case::new(
        SECTION,
        "a command that jumps beyond S-0-0159: C1D bit 11, F10BH",
        "sercos2.md 4.3, 6.3",
        |slave| {
            in_operation(slave, 11, Configuration::standard(4))?;
            let position = slave.last.clone().ok_or("no AT")?.long(0);
            slave.commands = (position + 400_000).to_le_bytes().to_vec();
            slave.cycles(500);
            shut_down(slave, 1 << 11, 0xF10B)
        },
    ));
    cases.push(Case::new(
        SECTION,
        "a command that jumps beyond S-0-0091 in a cycle: C1D bit 15, F11BH",
        "sercos2.md 4.3, 6.3",
        |slave| {
            in_operation(slave, 3, Configuration::standard(4))?;
            let position = slave.last.clone().ok_or("no AT")?.long(0);
            slave.commands = (position + 3_600_000).to_le_bytes().to_vec();
            slave.cycles(500);
            shut_down(slave, 1 << 15, 0xF11B)
        },
    ));
    cases.push(Case::new(
        SECTION,
        "switched on without main power: no torque, C2D bit 9 and S-0-0319",
        "sercos2.md 4.3",
        |slave| {
            slave.run_up_with_motor(4, 2, Configuration::default())?;
            amplifier(slave, Amplifier { main_power: false, fault: false });
            slave.cycles(5);
            let at = slave.last.clone().ok_or("no AT")?;
            expect("status bits 15, 14", status::readiness(at.status), 1)?;
            slave.control = 0xE000;
            slave.cycles(5);
            let at = slave.last.clone().ok_or("no AT")?;
            expect("status bits 15, 14", status::readiness(at.status), 1)?;
            expect("C2D bit 9", slave.number(CLASS_2)? >> 9 & 1, 1)?;
            expect("S-0-0319", slave.number(319)?, 1)?;
            expect("S-0-0390", slave.number(DIAGNOSTIC_NUMBER)?, 0xE009)
        },
    ));
    cases.push(Case::new(
        SECTION,
        "after an error the drive needs S-0-0099 and a new edge of bit 15",
        "sercos2.md 6.3",
        |slave| {
            in_operation(slave, 2, Configuration::default())?;
            amplifier(slave, Amplifier { main_power: false, fault: false });
            slave.cycles(5);
            amplifier(slave, HEALTHY);
            slave.cycles(5);
            expect("S-0-0099", slave.command(99)?, 3)?;
            slave.cycles(5);
            let at = slave.last.clone().ok_or("no AT")?;
            expect("status bits 15, 14 with bit 15 left on", status::readiness(at.status), 2)?;
            slave.control = 0x6000;
            slave.cycles(3);
            slave.switch_on()
        },
    ));
    cases.push(Case::new(SECTION, "torque only in CP4", "sercos2.md 6.3", |slave| {
        slave.run_up_with_motor(3, 2, Configuration::default())?;
        slave.control = 0xE000;
        slave.cycles(20);
        ensure(!slave.drive.motor_side.borrow().bridge_is_on(), || "the amplifier is on in CP3".to_owned())?;
        let at = slave.last.clone().ok_or("no AT")?;
        expect("status bits 15, 14", status::readiness(at.status), 2)
    }));
    for (control, name) in [(0xE000, "following: bit 3 set"), (0xC000, "halted: bit 3 clear")] {
        let rule = format!("in operation, {name}");
        cases.push(Case::new(SECTION, rule, "sercos2.md 1.7", move |slave| {
            in_operation(slave, 2, Configuration::default())?;
            slave.control = control;
            slave.cycles(5);
            let at = slave.last.clone().ok_or("no AT")?;
            expect("status bits 15, 14", status::readiness(at.status), 3)?;
            expect("bit 3", at.status & status::FOLLOWS != 0, control & 0x2000 != 0)
        }));
    }
    cases
}

/// Control word bits 11, 9, 8.
const fn select(mode: usize) -> u16 {
    let mode = mode as u16;
    (mode & 4) << 9 | (mode & 3) << 8
}

fn amplifier(slave: &Slave, inputs: Amplifier) {
    slave.drive.motor_side.borrow_mut().set_amplifier_inputs(inputs);
}

/// In CP4 with torque in this mode, standing still.
pub(super) fn in_operation(slave: &mut Slave, mode: u16, configuration: Configuration) -> Outcome {
    slave.run_up_with_motor(4, mode, configuration)?;
    let bytes = usize::from(slave.configuration.length).saturating_sub(4);
    slave.commands = vec![0; bytes];
    slave.cycles(20);
    slave.number(CLASS_2)?;
    slave.switch_on()?;
    slave.cycles(50);
    Ok(())
}

fn bit(slave: &Slave, mask: u16) -> Outcome<bool> {
    slave.last.as_ref().map(|at| at.status & mask != 0).ok_or_else(|| "no AT".to_owned())
}

/// The drive has taken the torque away for this error and says so.
fn shut_down(slave: &mut Slave, class_1: u64, number: u64) -> Outcome {
    expect("S-0-0011", slave.number(CLASS_1)?, class_1)?;
    expect("S-0-0390", slave.number(DIAGNOSTIC_NUMBER)?, number)?;
    let at = slave.last.clone().ok_or("no AT")?;
    expect("status bit 13", at.status & status::SHUT_DOWN != 0, true)?;
    ensure(status::readiness(at.status) != 3, || format!("torque: status {:04X}H", at.status))?;
    ensure(!slave.drive.motor_side.borrow().bridge_is_on(), || "the amplifier is still on".to_owned())
}

/// No AT any more; the next run-up shows the error, S-0-0099 clears it, and everything goes on to CP4.
fn ends_in_cp0(slave: &mut Slave, interface: u64) -> Outcome {
    for _ in 0..5 {
        let at = slave.cycle();
        ensure(at.is_none(), || format!("an AT in CP0: {at:?}"))?;
    }
    slave.to_cp2()?;
    expect("S-0-0014", slave.number(INTERFACE)?, interface)?;
    expect("S-0-0011", slave.number(CLASS_1)?, 1 << 12)?;
    expect("S-0-0099", slave.command(99)?, 3)?;
    expect("S-0-0014 after S-0-0099", slave.number(INTERFACE)?, 2)?;
    slave.run_up(4, Configuration::default())?;
    expect("S-0-0014 in CP4", slave.number(INTERFACE)?, 4)
}

/// The error of the last run has a number, a text, a cause and a remedy, and stays in the error memory when it is cleared.
fn told(slave: &mut Slave, number: u16) -> Outcome {
    slave.to_cp2()?;
    expect("S-0-0390", slave.number(DIAGNOSTIC_NUMBER)?, number.into())?;
    for text in [95, 0x800A, 0x800B] {
        let words = slave.text(text)?;
        ensure(words.len() >= 8, || format!("{}: {words:?}", sercos::Idn(text)))?;
    }
    expect("S-0-0099", slave.command(99)?, 3)?;
    expect("S-0-0390 after S-0-0099", slave.number(DIAGNOSTIC_NUMBER)?, 0xA002)?;
    expect("S-0-0375", slave.entries(375)?.first().copied(), Some(number))
}
