//! Set, start, interrupt, cancel; the change bit; and what each transition check finds.

use ring::service_client::status;

use super::error_handling::in_operation;
use crate::case::{Case, Section, ensure, expect};
use crate::configuration::{Configuration, list};
use crate::slave::{Outcome, Slave};

const SECTION: Section = Section::ProcedureCommands;

const RESET: u16 = 99;
const CHECK_CP3: u16 = 127;
const CHECK_CP4: u16 = 128;
const PARK: u16 = 139;
const HOME: u16 = 148;
const CANCEL_REFERENCE: u16 = 191;
const LOAD_DEFAULTS: u16 = 262;
const SET_POSITION: u16 = 447;

pub(super) fn cases() -> Vec<Case> {
    [engine(), effects(), findings_for_cp3(), findings_for_cp4()].into_iter().flatten().collect()
}

fn engine() -> Vec<Case> {
    let mut cases = Vec::new();
    for (idn, phases) in [
        (RESET, [2, 3, 4].as_slice()),
        (CHECK_CP3, &[2]),
        (CHECK_CP4, &[3]),
        (PARK, &[2]),
        (HOME, &[4]),
        (CANCEL_REFERENCE, &[2, 3, 4]),
        (LOAD_DEFAULTS, &[2, 3]),
        (SET_POSITION, &[2, 3, 4]),
    ] {
        for &phase in phases {
            let rule =
                format!("S-0-{idn:04} in CP{phase}: 0, start, 7 or 3, end 3 with the change bit, cancel, 0 without it");
            cases.push(Case::new(SECTION, rule, "sercos2.md 3.6", move |slave| {
                slave.run_up(phase, Configuration::default())?;
                slave.cycles(100);
                expect("data status before", slave.open(idn)?, 0)?;
                expect("change bit before", change_bit(slave)?, false)?;
                expect("data status at the end", slave.start_command(idn)?, 3)?;
                expect("operation data at the end", slave.number(idn)?, 3)?;
                expect("change bit at the end", change_bit(slave)?, true)?;
                slave.must_set(idn, &[0])?;
                expect("data status after", slave.open(idn)?, 0)?;
                slave.cycles(2);
                expect("change bit after", change_bit(slave)?, false)
            }));
        }
        for phase in (2..=4).filter(|phase| !phases.contains(phase) && idn != LOAD_DEFAULTS) {
            let rule = format!("S-0-{idn:04} cannot be started in CP{phase}: 7005H");
            cases.push(Case::new(SECTION, rule, "sercos2.md 3.7", move |slave| {
                slave.run_up(phase, Configuration::default())?;
                expect("answer", slave.set(idn, &[3])?, Err(0x7005))?;
                expect("data status", slave.open(idn)?, 0)
            }));
        }
    }
    cases.push(Case::new(
        SECTION,
        "1 sets a command without starting it: data status 1, no change bit",
        "sercos2.md 3.6",
        |slave| {
            slave.to_cp2()?;
            slave.must_set(CANCEL_REFERENCE, &[1])?;
            expect("data status", slave.open(CANCEL_REFERENCE)?, 1)?;
            expect("change bit", change_bit(slave)?, false)?;
            slave.must_set(CANCEL_REFERENCE, &[3])?;
            expect("data status", slave.open(CANCEL_REFERENCE)?, 3)
        },
    ));
    cases.push(Case::new(SECTION, "a second start without a cancellation: 7010H", "sercos2.md 3.5", |slave| {
        slave.to_cp2()?;
        expect("first", slave.start_command(RESET)?, 3)?;
        expect("second", slave.set(RESET, &[3])?, Err(0x7010))?;
        slave.must_set(RESET, &[0])?;
        expect("after the cancellation", slave.start_command(RESET)?, 3)
    }));
    for value in [2, 4, 5, 7, 0x8003, 0xFFFF] {
        let rule = format!("{value:04X}H written to a command: 7008H, and the command stays as it is");
        cases.push(Case::new(SECTION, rule, "sercos2.md 3.5, 3.6", move |slave| {
            slave.to_cp2()?;
            expect("answer", slave.set(RESET, &[value])?, Err(0x7008))?;
            expect("data status", slave.open(RESET)?, 0)
        }));
    }
    cases.push(Case::new(
        SECTION,
        "two commands at once: the change bit is there until both are cancelled",
        "sercos2.md 3.6",
        |slave| {
            slave.to_cp2()?;
            expect("first", slave.start_command(RESET)?, 3)?;
            expect("second", slave.start_command(CANCEL_REFERENCE)?, 3)?;
            slave.must_set(RESET, &[0])?;
            slave.cycles(2);
            expect("change bit with one left", change_bit(slave)?, true)?;
            expect("data status of the one left", slave.open(CANCEL_REFERENCE)?, 3)?;
            slave.must_set(CANCEL_REFERENCE, &[0])?;
            slave.cycles(2);
            expect("change bit", change_bit(slave)?, false)
        },
    ));
    cases.push(Case::new(
        SECTION,
        "S-0-0128 waits for the loops' lock at 7, is interrupted to 5, goes on, and ends at 3",
        "sercos2.md 3.6",
        |slave| {
            slave.run_up(2, Configuration::default())?;
            expect("S-0-0127", slave.command(CHECK_CP3)?, 3)?;
            slave.mst = Some(3);
            slave.cycles(2);
            // Without a close in between: the lock takes a few cycles only.
            slave.open(CHECK_CP4)?;
            expect("start", slave.write(&[3])?, Ok(7))?;
            expect("interruption", slave.write(&[1])?, Ok(5))?;
            expect("data status", slave.words(7, 1)?, Ok(vec![5]))?;
            slave.cycles(200);
            expect("data status long after", slave.open(CHECK_CP4)?, 5)?;
            expect("change bit", change_bit(slave)?, false)?;
            expect("data status at the end", slave.start_command(CHECK_CP4)?, 3)?;
            expect("change bit", change_bit(slave)?, true)
        },
    ));
    cases.push(Case::new(SECTION, "S-0-0128 cancelled while it waits permits nothing", "sercos2.md 3.6", |slave| {
        slave.run_up(2, Configuration::default())?;
        expect("S-0-0127", slave.command(CHECK_CP3)?, 3)?;
        slave.mst = Some(3);
        slave.cycles(2);
        slave.must_set(CHECK_CP4, &[3])?;
        slave.must_set(CHECK_CP4, &[0])?;
        slave.cycles(300);
        slave.mst = Some(4);
        slave.cycles(4);
        slave.to_cp2()?;
        expect("S-0-0014", slave.number(14)?, 1 << 8 | 3)
    }));
    cases.push(Case::new(
        SECTION,
        "S-0-0025 names exactly the data blocks whose attribute has bit 19",
        "sercos2.md 3.7",
        |slave| {
            slave.to_cp2()?;
            let listed = slave.entries(25)?;
            let mut commands = Vec::new();
            for idn in slave.entries(17)? {
                slave.open(idn)?;
                let attribute = slave.words(3, 2)?.map_err(|code| format!("{code:04X}H"))?;
                if attribute[1] & 8 != 0 {
                    commands.push(idn);
                }
            }
            expect("S-0-0025", listed, commands)
        },
    ));
    cases
}

fn effects() -> Vec<Case> {
    let mut cases = Vec::new();
    cases.push(Case::new(
        SECTION,
        "S-0-0148 makes the place S-0-0052 and sets S-0-0403; S-0-0191 takes it back",
        "sercos2.md 6.3",
        |slave| {
            slave.run_up(4, Configuration::standard(4).with(32, &[3]).with_long(52, 1_234_567))?;
            slave.cycles(100);
            expect("S-0-0403 before", slave.number(403)?, 0)?;
            expect("S-0-0148", slave.start_command(HOME)?, 3)?;
            slave.cycles(3);
            let position = slave.number(51)? as u32 as i32;
            ensure((position - 1_234_567).abs() < 1_000, || format!("S-0-0051 = {position}"))?;
            expect("S-0-0403", slave.number(403)?, 1)?;
            slave.must_set(HOME, &[0])?;
            expect("S-0-0191", slave.command(CANCEL_REFERENCE)?, 3)?;
            expect("S-0-0403 after S-0-0191", slave.number(403)?, 0)
        },
    ));
    for (idn, words) in [(52, [1, 0].as_slice()), (147, &[0])] {
        let rule = format!("S-0-{idn:04} cannot be written while S-0-0148 is set: 700CH");
        cases.push(Case::new(SECTION, rule, "sercos2.md 3.5", move |slave| {
            slave.run_up(4, Configuration::default())?;
            slave.cycles(50);
            expect("S-0-0148", slave.start_command(HOME)?, 3)?;
            expect("answer", slave.set(idn, words)?, Err(0x700C))?;
            slave.must_set(HOME, &[0])?;
            expect("answer after the cancellation", slave.set(idn, words)?, Ok(()))
        }));
    }
    for way in [0x0000, 0x0020, 0x0040, 0x00E0] {
        let rule = format!("S-0-0148 with S-0-0147 = {way:04X}H, a way to go, without torque: 7012H");
        cases.push(Case::new(SECTION, rule, "sercos2.md 3.5, 6.3", move |slave| {
            slave.run_up(4, Configuration::default().with(147, &[way]))?;
            slave.cycles(50);
            expect("answer", slave.set(HOME, &[3])?, Err(0x7012))?;
            expect("data status", slave.open(HOME)?, 0)
        }));
    }
    for way in [0x0068, 0x0160] {
        let rule = format!("S-0-0148 with S-0-0147 = {way:04X}H, which is not built: 7013H");
        cases.push(Case::new(SECTION, rule, "sercos2.md 3.5, 6.3", move |slave| {
            slave.run_up(4, Configuration::default().with(147, &[way]))?;
            slave.cycles(50);
            expect("answer", slave.set(HOME, &[3])?, Err(0x7013))?;
            expect("data status", slave.open(HOME)?, 0)
        }));
    }
    cases.push(Case::new(
        SECTION,
        "S-0-0262 in CP4, which protects some of what it would change: 7012H, and nothing changes",
        "sercos2.md 3.5, 3.7",
        |slave| {
            let configuration = Configuration::default().with(79, &[0x1234, 0x0056]).with(76, &[0x0A]).with(33, &[2]);
            slave.run_up(4, configuration)?;
            slave.must_set(104, &[250])?;
            expect("answer", slave.set(LOAD_DEFAULTS, &[3])?, Err(0x7012))?;
            ensure(slave.text(0x8003)?.contains("S-0-0262"), || "P-0-0003 does not say why".to_owned())?;
            for (idn, value) in [(104, 250), (79, 0x0056_1234), (76, 0x0A), (33, 2)] {
                expect("operation data", slave.number(idn)?, value)?;
            }
            Ok(())
        },
    ));
    for (idn, what) in [(LOAD_DEFAULTS, "S-0-0262"), (SET_POSITION, "S-0-0447")] {
        let rule = format!("{what} while torque is on: 7012H");
        cases.push(Case::new(SECTION, rule, "sercos2.md 3.5", move |slave| {
            in_operation(slave, 2, Configuration::default())?;
            expect("answer", slave.set(idn, &[3])?, Err(0x7012))?;
            expect("data status", slave.open(idn)?, 0)
        }));
    }
    cases.push(Case::new(SECTION, "S-0-0148 while the motor turns: 7012H", "sercos2.md 3.5", |slave| {
        in_operation(slave, 2, Configuration::default())?;
        slave.commands = 3_000_000_i32.to_le_bytes().to_vec();
        slave.cycles(500);
        expect("answer", slave.set(HOME, &[3])?, Err(0x7012))
    }));
    cases.push(Case::new(
        SECTION,
        "S-0-0262 gives what S-0-0192 lists its defaults, and leaves the cycle alone",
        "sercos2.md 4.2",
        |slave| {
            slave.to_cp2()?;
            slave.must_set(104, &[250])?;
            slave.must_set(142, &[2, 2, 0x4141])?;
            slave.must_set(2, &[4_000])?;
            expect("S-0-0262", slave.command(LOAD_DEFAULTS)?, 3)?;
            expect("S-0-0104", slave.number(104)?, 100)?;
            expect("S-0-0142", slave.text(142)?, String::new())?;
            expect("S-0-0002", slave.number(2)?, 4_000)
        },
    ));
    cases.push(Case::new(
        SECTION,
        "a parked axis (S-0-0139) takes no torque until the next run-up",
        "sercos2.md 4.2",
        |slave| {
            slave.run_up(2, Configuration::default())?;
            expect("S-0-0139", slave.start_command(PARK)?, 3)?;
            slave.to_cp3()?;
            slave.to_cp4()?;
            ensure(slave.switch_on().is_err(), || "the drive has switched on".to_owned())?;
            expect("S-0-0182 bit 1", slave.number(182)? >> 1 & 1, 1)?;
            expect("S-0-0390", slave.number(390)?, 0xA015)?;
            slave.run_up_with_motor(4, 2, Configuration::default())?;
            slave.switch_on()
        },
    ));
    cases
}

/// What is written instead, the data block to blame, the reason code, and a word of the text.
type Finding = (&'static str, &'static [(u16, &'static [u16])], u16, u16, &'static str);

const FOR_CP3: [Finding; 14] = [
    ("S-0-0001 = 3000, no multiple of S-0-0002", &[(1, &[3_000])], 1, 6, "multiple"),
    ("S-0-0007 = 1990, too late for S-0-0005", &[(7, &[1_990])], 7, 10, "late"),
    ("S-0-0008 = 1030, inside the MDT", &[(8, &[1_030])], 8, 9, "early"),
    ("S-0-0008 = 2001, beyond the cycle", &[(8, &[2_001])], 8, 10, "late"),
    ("S-0-0009 = 2, even", &[(9, &[2])], 9, 7, "odd"),
    ("S-0-0009 = 9, behind the end", &[(9, &[9])], 9, 8, "behind"),
    ("S-0-0010 = 9, odd", &[(10, &[9])], 10, 7, "even"),
    ("S-0-0010 = 6, too short for the record", &[(10, &[6])], 9, 8, "behind"),
    ("S-0-0015 = 8, a reserved bit", &[(15, &[8])], 15, 3, "support"),
    ("S-0-0015 = 12 without feedback 2", &[(15, &[12])], 15, 12, "P-0-2705"),
    ("S-0-0016 with S-0-0053 without feedback 2", &[(15, &[7]), (16, &[2, 2, 53])], 16, 12, "P-0-2705"),
    ("S-0-0024 with an IDN twice", &[(15, &[7]), (24, &[4, 4, 80, 80])], 24, 4, "twice"),
    ("S-0-0089 = 250, before the end of the AT", &[(89, &[250])], 89, 9, "early"),
    ("S-0-0089 = 1990, too late for S-0-0088", &[(89, &[1_990])], 89, 10, "late"),
];

fn findings_for_cp3() -> Vec<Case> {
    let mut cases = Vec::new();
    for (what, writes, culprit, code, word) in FOR_CP3 {
        let rule = format!("S-0-0127 finds {what}: S-0-{culprit:04} in S-0-0021, reason {code}, in words");
        cases.push(Case::new(SECTION, rule, "sercos2.md 2.3", move |slave| {
            slave.run_up(2, Configuration::default())?;
            for (idn, words) in writes {
                slave.must_set(*idn, words)?;
            }
            finds(slave, CHECK_CP3, [21, 0x8001], culprit, code, word)?;
            slave.configure(Configuration {
                others: vec![(16, list(&[])), (24, list(&[]))],
                control_unit_cycle: Some(2_000),
                ..Configuration::default()
            })?;
            passes(slave, CHECK_CP3, [21, 0x8001])
        }));
    }
    cases.push(Case::new(
        SECTION,
        "S-0-0127 finds several at once, in ascending order, each with its reason",
        "sercos2.md 2.3",
        |slave| {
            slave.run_up(2, Configuration { t2: 250, t4: 1_990, position: 2, ..Configuration::default() })?;
            expect("S-0-0127", slave.command(CHECK_CP3)?, 0xF)?;
            expect("S-0-0021", slave.entries(21)?, vec![7, 9, 89])?;
            expect("P-0-0001", slave.entries(0x8001)?, vec![10, 7, 9])
        },
    ));
    cases
}

const FOR_CP4: [Finding; 21] = [
    ("S-0-0032 = 0, no primary mode", &[(32, &[0])], 32, 3, "support"),
    ("S-0-0032 = 4, position with encoder 2", &[(32, &[4])], 32, 3, "support"),
    ("S-0-0032 = 3 without S-0-0047 in the MDT", &[(32, &[3])], 32, 11, "S-0-0047"),
    ("S-0-0032 = 1 without S-0-0080 in the MDT", &[(32, &[1])], 32, 11, "S-0-0080"),
    ("S-0-0033 = 11 without S-0-0047 in the MDT", &[(33, &[11])], 33, 11, "S-0-0047"),
    ("S-0-0287 = 7, uncontrolled", &[(287, &[7])], 287, 3, "support"),
    ("S-0-0044 = 11H, velocity in inches", &[(44, &[0x11])], 44, 3, "support"),
    ("S-0-0044 = 21H, preferred linear per second", &[(44, &[0x21])], 44, 3, "support"),
    ("S-0-0045, 46: increments beyond the drive", &[(44, &[0x0A]), (46, &[32])], 46, 3, "support"),
    ("S-0-0076 = 11H, position in inches", &[(76, &[0x11])], 76, 3, "support"),
    ("S-0-0078: increments beyond the drive", &[(76, &[9]), (78, &[32])], 78, 16, "2^31"),
    ("S-0-0079 = 1 increment a revolution", &[(76, &[0x0A]), (79, &[1, 0])], 79, 16, "4 to"),
    ("S-0-0201 above S-0-0204", &[(201, &[1_400])], 201, 16, "1400"),
    ("S-0-0193 = 1, below a step of the loops", &[(193, &[1, 0])], 193, 16, "jerk"),
    ("S-0-0103 = 0 with modulo", &[(76, &[0x82]), (103, &[0, 0])], 103, 2, "minimum"),
    ("S-0-0055 = 1, a command that counts against the feedback", &[(55, &[1])], 55, 14, "bits 0 and 2"),
    ("S-0-0055 = 25H, a reserved bit", &[(55, &[0x25])], 55, 3, "support"),
    ("S-0-0085 = 8, a reserved bit", &[(85, &[8])], 85, 3, "support"),
    ("S-0-0049 below S-0-0050", &[(49, &[9, 0]), (50, &[10, 0])], 49, 13, "S-0-0050"),
    ("position limits of an endless axis", &[(76, &[0x82]), (55, &[0x10])], 55, 13, "S-0-0076"),
    ("S-0-0277 = 1, a linear encoder", &[(277, &[1])], 277, 3, "support"),
];

fn findings_for_cp4() -> Vec<Case> {
    let mut cases = Vec::new();
    for (what, writes, culprit, code, word) in FOR_CP4 {
        let rule = format!("S-0-0128 finds {what}: S-0-{culprit:04} in S-0-0022, reason {code}, in words");
        cases.push(Case::new(SECTION, rule, "sercos2.md 2.3", move |slave| {
            slave.run_up(3, Configuration::default())?;
            slave.cycles(100);
            let mut before = Vec::new();
            for (idn, words) in writes {
                before.push((*idn, slave.get(*idn)?));
                slave.must_set(*idn, words)?;
            }
            finds(slave, CHECK_CP4, [22, 0x8002], culprit, code, word)?;
            for (idn, words) in before {
                slave.must_set(idn, &words)?;
            }
            passes(slave, CHECK_CP4, [22, 0x8002])?;
            slave.mst = Some(4);
            slave.cycles(3);
            expect("S-0-0014", slave.number(14)?, 4)
        }));
    }
    cases
}

fn finds(slave: &mut Slave, check: u16, lists: [u16; 2], culprit: u16, code: u16, word: &str) -> Outcome {
    expect("the check", slave.command(check)?, 0xF)?;
    expect("the list of invalid data", slave.entries(lists[0])?, vec![culprit])?;
    expect("the reasons", slave.entries(lists[1])?, vec![code])?;
    let text = slave.text(0x8003)?;
    ensure(text.starts_with(&format!("S-0-{culprit:04}: ")) && text.contains(word), || format!("P-0-0003: {text:?}"))
}

fn passes(slave: &mut Slave, check: u16, lists: [u16; 2]) -> Outcome {
    expect("the check", slave.command(check)?, 3)?;
    for idn in lists {
        expect("a list after a check that has passed", slave.entries(idn)?, vec![])?;
    }
    expect("P-0-0003", slave.text(0x8003)?, String::new())
}

fn change_bit(slave: &Slave) -> Outcome<bool> {
    let at = slave.last.as_ref().ok_or("no AT")?;
    Ok(at.status & status::COMMAND_CHANGE != 0)
}
