//! S-0-0015, S-0-0016, S-0-0024: what stands in the cyclic telegrams, and the bits of control and status word.

use drive::DICTIONARY;
use sercos::data_block::Selection;

use crate::case::{Case, Section, ensure, expect};
use crate::configuration::{Configuration, bytes_of, list};
use crate::slave::{Outcome, Slave};

const SECTION: Section = Section::TelegramTypes;

const VELOCITY_COMMAND: u16 = 36;
const POSITION_COMMAND: u16 = 47;
const TORQUE_COMMAND: u16 = 80;
const VELOCITY: u16 = 40;
const POSITION: u16 = 51;
const POSITION_2: u16 = 53;
const FEEDBACK_2_SOURCE: u16 = 0x8000 | 2705;
const APPLICATION_WORD: u16 = 0x8013;

/// Type, data of the MDT, data of the AT (sercos2.md 1.8).
const TYPES: [(u16, &[u16], &[u16]); 7] = [
    (0, &[], &[]),
    (1, &[TORQUE_COMMAND], &[]),
    (2, &[VELOCITY_COMMAND], &[VELOCITY]),
    (3, &[VELOCITY_COMMAND], &[POSITION]),
    (4, &[POSITION_COMMAND], &[POSITION]),
    (5, &[POSITION_COMMAND, VELOCITY_COMMAND], &[POSITION, VELOCITY]),
    (6, &[VELOCITY_COMMAND], &[]),
];

/// Type, data of the AT, with position feedback 2.
const TYPES_WITH_FEEDBACK_2: [(u16, &[u16], &[u16]); 3] = [
    (11, &[VELOCITY_COMMAND], &[POSITION_2]),
    (12, &[POSITION_COMMAND], &[POSITION_2]),
    (13, &[POSITION_COMMAND, VELOCITY_COMMAND], &[POSITION_2, VELOCITY]),
];

pub(super) fn cases() -> Vec<Case> {
    let mut cases = Vec::new();
    for (kind, mdt, at) in TYPES {
        let rule = format!("type {kind}: MDT with {}, AT with {}", names(mdt), names(at));
        cases.push(Case::new(SECTION, rule, "sercos2.md 1.8", move |slave| {
            carries(slave, with_a_mode_for(Configuration::standard(kind), mdt), mdt, at)
        }));
    }
    for (kind, mdt, at) in TYPES_WITH_FEEDBACK_2 {
        let rule = format!("type {kind} without feedback 2 is refused, S-0-0015 to blame");
        cases.push(Case::new(SECTION, rule, "sercos2.md 1.8, 2.3", move |slave| {
            refused(slave, Configuration::standard(kind), 15, 0x000C)
        }));
        let rule = format!("type {kind} with feedback 2: MDT with {}, AT with {}", names(mdt), names(at));
        cases.push(Case::new(SECTION, rule, "sercos2.md 1.8", move |slave| {
            let configuration = Configuration::standard(kind).with(FEEDBACK_2_SOURCE, &[1]);
            carries(slave, with_a_mode_for(configuration, mdt), mdt, at)
        }));
    }
    for kind in [8, 9, 10, 14, 15, 0x10, 0x8002] {
        let rule = format!("type {kind:04X}H has a reserved bit: refused, S-0-0015 to blame");
        cases.push(Case::new(SECTION, rule, "sercos2.md 1.8, 2.3", move |slave| {
            refused(slave, Configuration::standard(kind), 15, 0x0003)
        }));
    }
    for block in DICTIONARY.select(Selection::ConfigurableInAt) {
        let idn = block.idn.0;
        let rule = format!("{} in the AT has the value that the service channel reads", block.idn);
        cases.push(Case::new(SECTION, rule, "sercos2.md 1.9, S-0-0187", move |slave| {
            let configuration = Configuration::application(&[idn], &[VELOCITY_COMMAND]).with(FEEDBACK_2_SOURCE, &[1]);
            slave.run_up(4, configuration)?;
            at_equals_service_channel(slave, &[idn])
        }));
    }
    for block in DICTIONARY.select(Selection::ConfigurableInMdt) {
        let idn = block.idn.0;
        let rule = format!("{} in the MDT arrives", block.idn);
        cases.push(Case::new(SECTION, rule, "sercos2.md 1.9, S-0-0188", move |slave| {
            let mdt = if idn == VELOCITY_COMMAND { vec![idn] } else { vec![idn, VELOCITY_COMMAND] };
            carries(slave, Configuration::application(&[], &mdt), &mdt, &[])
        }));
    }
    let at_orders: [&[u16]; 5] = [
        &[POSITION, VELOCITY, 11, 13],
        &[13, 11, VELOCITY, POSITION],
        &[11, POSITION, APPLICATION_WORD],
        &[390, 189, 12, 347, 14, 84, 403],
        &[129, 181, 182, 144, POSITION, 40, 189],
    ];
    for at in at_orders {
        let rule = format!("the AT carries {} in this order", names(at));
        cases.push(Case::new(SECTION, rule, "sercos2.md 1.9", move |slave| {
            slave.run_up(4, Configuration::application(at, &[VELOCITY_COMMAND]))?;
            at_equals_service_channel(slave, at)
        }));
    }
    let mdt_orders: [&[u16]; 4] = [
        &[VELOCITY_COMMAND, POSITION_COMMAND, TORQUE_COMMAND],
        &[TORQUE_COMMAND, POSITION_COMMAND, VELOCITY_COMMAND],
        &[81, 48, 145, 37, VELOCITY_COMMAND, 80, POSITION_COMMAND],
        &[145, VELOCITY_COMMAND],
    ];
    for mdt in mdt_orders {
        let rule = format!("the MDT carries {} in this order", names(mdt));
        cases.push(Case::new(SECTION, rule, "sercos2.md 1.9", move |slave| {
            carries(slave, Configuration::application(&[], mdt), mdt, &[])
        }));
    }
    for (list_idn, entry, what) in [
        (16, 36, "a command value in S-0-0016"),
        (16, 2, "a parameter in S-0-0016"),
        (16, 4_000, "an unknown IDN in S-0-0016"),
        (24, 51, "a feedback value in S-0-0024"),
        (24, 0x8013, "P-0-0019 in S-0-0024"),
        (24, 4_000, "an unknown IDN in S-0-0024"),
    ] {
        let rule = format!("{what} is refused with 7008H and the old list stays");
        cases.push(Case::new(SECTION, rule, "sercos2.md 1.9, 3.5", move |slave| {
            slave.to_cp2()?;
            let good = if list_idn == 16 { 51 } else { 36 };
            slave.must_set(list_idn, &list(&[good]))?;
            expect("answer", slave.set(list_idn, &list(&[good, entry]))?, Err(0x7008))?;
            expect("list", slave.entries(list_idn)?, vec![good])
        }));
    }
    cases.push(Case::new(
        SECTION,
        "an IDN twice in S-0-0024 fails S-0-0127, the list to blame",
        "sercos2.md 1.9",
        |slave| refused(slave, Configuration::application(&[], &[36, 36]), 24, 0x0004),
    ));
    cases.push(Case::new(
        SECTION,
        "more data than S-0-0185 fail S-0-0127, S-0-0016 to blame",
        "sercos2.md 1.9",
        |slave| {
            let long = [40, 51, 189, 347, 11, 12, 13, 14, 84, 129, 144, 181, 182, 390];
            refused(slave, Configuration::application(&long, &[36]), 16, 0x0005)
        },
    ));
    cases.push(Case::new(SECTION, "a list of more than 16 entries is too long (7003H)", "sercos2.md 3.2", |slave| {
        slave.to_cp2()?;
        expect("answer", slave.set(16, &list(&[51; 17]))?, Err(0x7003))
    }));
    cases.push(Case::new(SECTION, "empty lists are legal", "sercos2.md 1.9", |slave| {
        slave.run_up(3, Configuration::application(&[], &[]))?;
        let at = slave.last.clone().ok_or("no AT")?;
        expect("bytes of configurable data", at.data.len(), 0)
    }));
    cases.push(Case::new(SECTION, "the configuration becomes active in CP3, not before", "sercos2.md 1.8", |slave| {
        slave.run_up(2, Configuration::standard(5))?;
        slave.cycles(5);
        expect("data in CP2", slave.last.clone().ok_or("no AT")?.data.len(), 0)?;
        slave.to_cp3()?;
        expect("data in CP3", slave.last.clone().ok_or("no AT")?.data.len(), 8)
    }));
    for (idn, words) in [(15, vec![4]), (16, list(&[51])), (24, list(&[36])), (9, vec![3]), (10, vec![16])] {
        let rule = format!("S-0-{idn:04} cannot be written in CP3 and CP4 (7005H)");
        cases.push(Case::new(SECTION, rule, "sercos2.md 4.1", move |slave| {
            slave.run_up(3, Configuration::default())?;
            expect("CP3", slave.set(idn, &words)?, Err(0x7005))?;
            slave.to_cp4()?;
            expect("CP4", slave.set(idn, &words)?, Err(0x7005))
        }));
    }
    for drive in [1_u16, 2, 100, 253, 254] {
        let rule = format!("the record of drive {drive} of 254 in an MDT of 2032 bytes");
        cases.push(Case::new(SECTION, rule, "sercos2.md 1.4, S-0-0009", move |slave| {
            let configuration = Configuration {
                cycle: 16_000,
                t3: 12_000,
                t4: 15_000,
                length: 254 * 8,
                position: 1 + 8 * (drive - 1),
                ..Configuration::default()
            };
            carries(slave, configuration, &[VELOCITY_COMMAND], &[VELOCITY])
        }));
    }
    for (position, length, culprit, code) in
        [(2, 8, 9, 0x0007), (1, 9, 10, 0x0007), (3, 8, 9, 0x0008), (1, 6, 9, 0x0008)]
    {
        let rule = format!("a record at {position} of {length} bytes fails S-0-0127, S-0-{culprit:04} to blame");
        cases.push(Case::new(SECTION, rule, "sercos2.md 2.3", move |slave| {
            refused(slave, Configuration { position, length, ..Configuration::default() }, culprit, code)
        }));
    }
    for cycles in [1, 2, 5] {
        let rule = format!("IPOSYNC may toggle every {cycles} cycles");
        cases.push(Case::new(SECTION, rule, "sercos2.md 1.6", move |slave| {
            slave.run_up(4, Configuration::default())?;
            for cycle in 0..50 {
                slave.control = if cycle / cycles % 2 == 0 { 0 } else { 1 << 10 };
                ensure(slave.cycle().is_some(), || "an AT is missing".to_owned())?;
            }
            expect("S-0-0014", slave.number(14)?, 4)
        }));
    }
    cases.extend(real_time_bits());
    cases
}

fn real_time_bits() -> Vec<Case> {
    let mut cases = Vec::new();
    for (allocation, bit_number, control_bit) in [(301, 413, 6), (303, 414, 7)] {
        let rule = format!("control word bit {control_bit} sets and clears the bit that S-0-{allocation:04} names");
        cases.push(Case::new(SECTION, rule, "sercos2.md 6.1", move |slave| {
            slave.run_up(4, Configuration::default())?;
            slave.must_set(APPLICATION_WORD, &[0x8001])?;
            slave.must_set(bit_number, &[3])?;
            slave.must_set(allocation, &[APPLICATION_WORD])?;
            for (control, expected) in [(1 << control_bit, 0x8009), (0, 0x8001), (1 << control_bit, 0x8009)] {
                slave.control = control;
                slave.cycles(3);
                expect("P-0-0019", slave.number(APPLICATION_WORD)?, expected)?;
            }
            expect("the bit as a data block", slave.number(allocation - 1)?, 1)
        }));
        let rule = format!("S-0-{allocation:04}: unknown IDN 1001H, one that no bit can set 7008H, 0 is none");
        cases.push(Case::new(SECTION, rule, "sercos2.md 6.1", move |slave| {
            slave.to_cp2()?;
            for (idn, answer) in [(4_000, Err(0x1001)), (11, Err(0x7008)), (2, Err(0x7008)), (0, Ok(()))] {
                expect("answer", slave.set(allocation, &[idn])?, answer)?;
            }
            Ok(())
        }));
    }
    for (allocation, bit_number, status_bit) in [(305, 415, 6), (307, 416, 7)] {
        let rule = format!("status word bit {status_bit} shows the bit that S-0-{allocation:04} names");
        cases.push(Case::new(SECTION, rule, "sercos2.md 6.1", move |slave| {
            slave.run_up(4, Configuration::default())?;
            slave.must_set(bit_number, &[5])?;
            slave.must_set(allocation, &[APPLICATION_WORD])?;
            for word in [0, 1 << 5, 0xFFDF, 0xFFFF] {
                slave.must_set(APPLICATION_WORD, &[word])?;
                slave.cycles(3);
                let at = slave.last.clone().ok_or("no AT")?;
                expect("the bit", at.status >> status_bit & 1, word >> 5 & 1)?;
            }
            // Standstill as a data block of one bit.
            slave.must_set(bit_number, &[0])?;
            slave.must_set(allocation, &[331])?;
            slave.cycles(3);
            let at = slave.last.clone().ok_or("no AT")?;
            expect("standstill", at.status >> status_bit & 1, 1)
        }));
    }
    cases.push(Case::new(
        SECTION,
        "S-0-0144 shows and S-0-0145 sets the bits of their lists, in the telegrams",
        "sercos2.md 4.1",
        |slave| {
            let configuration = Configuration::application(&[144, APPLICATION_WORD], &[145, VELOCITY_COMMAND])
                .with(26, &list(&[APPLICATION_WORD, 331, APPLICATION_WORD]))
                .with(328, &list(&[9, 0, 15]))
                .with(27, &list(&[APPLICATION_WORD, APPLICATION_WORD]))
                .with(329, &list(&[15, 9]));
            slave.run_up(4, configuration)?;
            for (signal, application, status) in
                [(0b00, 0, 0b010), (0b01, 0x8000, 0b110), (0b10, 0x0200, 0b011), (0b11, 0x8200, 0b111)]
            {
                slave.commands = vec![signal, 0, 0, 0, 0, 0];
                slave.cycles(4);
                let at = slave.last.clone().ok_or("no AT")?;
                expect("P-0-0019", at.word(2), application)?;
                expect("S-0-0144", at.word(0), status)?;
            }
            Ok(())
        },
    ));
    cases
}

fn names(idns: &[u16]) -> String {
    if idns.is_empty() {
        return "nothing".to_owned();
    }
    idns.iter().map(|&idn| sercos::Idn(idn).to_string()).collect::<Vec<_>>().join(", ")
}

/// S-0-0032 is a mode whose command value the MDT carries, if it carries any.
fn with_a_mode_for(configuration: Configuration, mdt: &[u16]) -> Configuration {
    let mode = if mdt.contains(&VELOCITY_COMMAND) {
        2
    } else if mdt.contains(&POSITION_COMMAND) {
        3
    } else {
        1
    };
    configuration.with(32, &[mode])
}

/// A run-up with this configuration; commands that are sent arrive, and the AT is what the service channel reads.
fn carries(slave: &mut Slave, configuration: Configuration, mdt: &[u16], at: &[u16]) -> Outcome {
    // A telegram without commands fits no operation mode: CP3 is as far as it goes (S-0-0128).
    let phase = if mdt.is_empty() { 3 } else { 4 };
    slave.run_up(phase, configuration)?;
    let mut expected = Vec::new();
    for (index, &idn) in (1_u32..).zip(mdt) {
        // The negative limits are not above 0.
        let is_negative = DICTIONARY.find(sercos::Idn(idn)).is_some_and(|block| block.maximum == Some(0));
        let value = match (bytes_of(idn), is_negative) {
            (2, false) => 0x0120 + index,
            (2, true) => 0xFEE0 - index,
            (_, false) => 0x0012_3400 + index,
            (_, true) => 0xFFED_CC00 - index,
        };
        slave.commands.extend(&value.to_le_bytes()[..usize::from(bytes_of(idn))]);
        expected.push((idn, value));
    }
    slave.cycles(3);
    for (idn, value) in expected {
        expect(&sercos::Idn(idn).to_string(), slave.number(idn)?, value.into())?;
    }
    at_equals_service_channel(slave, at)
}

/// The configurable data of the AT, one after the other, are what the service channel reads. The drive stands still meanwhile.
fn at_equals_service_channel(slave: &mut Slave, idns: &[u16]) -> Outcome {
    slave.cycles(100);
    let sum: u16 = idns.iter().map(|&idn| bytes_of(idn)).sum();
    let mut byte = 0;
    for &idn in idns {
        let read = slave.number(idn)?;
        let at = slave.cycle().ok_or("no AT")?;
        expect("bytes of configurable data", at.data.len(), usize::from(sum))?;
        let carried = match bytes_of(idn) {
            2 => u64::from(at.word(byte)),
            _ => u64::from(at.long(byte) as u32),
        };
        expect(&sercos::Idn(idn).to_string(), carried, read)?;
        byte += usize::from(bytes_of(idn));
    }
    Ok(())
}

/// S-0-0127 fails on this configuration with one culprit.
fn refused(slave: &mut Slave, configuration: Configuration, culprit: u16, code: u16) -> Outcome {
    slave.to_cp2()?;
    slave.configure(configuration)?;
    expect("S-0-0127", slave.command(127)?, 0xF)?;
    expect("S-0-0021", slave.entries(21)?, vec![culprit])?;
    expect("P-0-0001", slave.entries(0x8001)?, vec![code])?;
    let text = slave.text(0x8003)?;
    ensure(text.starts_with(&format!("S-0-{culprit:04}: ")), || format!("P-0-0003: {text:?}"))
}
