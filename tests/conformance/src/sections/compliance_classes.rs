//! The data blocks that every master asks for, with the attributes of a real drive, and the lists that say what there is.

use drive::DICTIONARY;
use ring::ident::Idn;

use crate::case::{Case, Section, ensure, expect};
use crate::configuration::{Configuration, list};
use crate::slave::{Outcome, Slave};

const SECTION: Section = Section::ComplianceClasses;

const GAO_1: &str = "Gao table 1, IGS table 1";
const GAO_2: &str = "Gao table 2, IGS table 2";
const TOUCHED: &str = "sercos2.md 4.4, 10.2";

/// IDN, attribute (sercos2.md Appendix A; 87, 185 to 188 as 3, 16), and who asks for it. All of them are only read.
const READ: [(u16, u32, &str); 27] = [
    (3, 0x7011_0001, GAO_1),
    (4, 0x7011_0001, GAO_1),
    (5, 0x7011_0001, GAO_1),
    (87, 0x7011_0001, GAO_1),
    (88, 0x7011_0001, GAO_1),
    (96, 0x7031_0001, GAO_1),
    (185, 0x7011_0001, GAO_1),
    (186, 0x7011_0001, GAO_1),
    (187, 0x7055_0001, GAO_1),
    (188, 0x7055_0001, GAO_1),
    (90, 0x7011_0001, "IGS table 4"),
    (11, 0x7001_0001, TOUCHED),
    (12, 0x7001_0001, TOUCHED),
    (13, 0x7001_0001, TOUCHED),
    (14, 0x7001_0001, TOUCHED),
    (17, 0x7055_0001, TOUCHED),
    (18, 0x7055_0001, TOUCHED),
    (19, 0x7055_0001, TOUCHED),
    (21, 0x7055_0001, TOUCHED),
    (22, 0x7055_0001, TOUCHED),
    (25, 0x7055_0001, TOUCHED),
    (28, 0x7011_0001, TOUCHED),
    (29, 0x7011_0001, TOUCHED),
    (30, 0x7044_0001, TOUCHED),
    (134, 0x7001_0001, TOUCHED),
    (135, 0x7001_0001, TOUCHED),
    (84, 0x7121_0001, "sercos2.md 1.8"),
];

/// IDN, attribute, a legal value, and who writes it.
const WRITTEN: [(u16, u32, &[u16], &str); 15] = [
    (1, 0x6011_0001, &[4_000], GAO_2),
    (2, 0x6011_0001, &[4_000], GAO_2),
    (6, 0x6011_0001, &[92], GAO_2),
    (7, 0x6011_0001, &[1_698], "IGS table 2"),
    (8, 0x6011_0001, &[1_965], GAO_2),
    (9, 0x6011_0001, &[17], GAO_2),
    (10, 0x6011_0001, &[32], GAO_2),
    (15, 0x6001_0001, &[7], GAO_2),
    (16, 0x6055_0001, &[6, 6, 11, 51, 0x8013], GAO_2),
    (24, 0x6055_0001, &[2, 2, 36], GAO_2),
    (32, 0x4001_0001, &[3], GAO_2),
    (89, 0x6011_0001, &[1_782], GAO_2),
    (97, 0x0001_0001, &[0x1234], "sercos2.md 4.1"),
    (98, 0x0001_0001, &[0x1234], "sercos2.md 4.1"),
    (142, 0x0044_0001, &[3, 3, 0x4141, 0x41], "sercos2.md 4.1"),
];

const COMMANDS: [(u16, u32); 3] = [(99, 0x0009_0001), (127, 0x6009_0001), (128, 0x5009_0001)];

/// Data of the standard telegrams.
const CYCLIC: [(u16, u32); 6] =
    [(36, 0x0422_0001), (40, 0x7422_0001), (47, 0x0422_0001), (51, 0x7422_0001), (53, 0x7422_0001), (80, 0x0121_0001)];

pub(super) fn cases() -> Vec<Case> {
    let mut cases = Vec::new();
    for (idn, attribute, source) in READ {
        let rule = format!("{} is read in CP2, CP3 and CP4, attribute {attribute:08X}H", Idn(idn));
        cases.push(Case::new(SECTION, rule, source, move |slave| {
            in_every_phase(slave, |slave, _| {
                expect("attribute", attribute_of(slave, idn)?, attribute)?;
                slave.get(idn).map(|_| ())
            })
        }));
    }
    for (idn, attribute, words, source) in WRITTEN {
        let rule = format!("{} is written where its attribute {attribute:08X}H lets it, and reads back", Idn(idn));
        cases.push(Case::new(SECTION, rule, source, move |slave| {
            in_every_phase(slave, |slave, phase| {
                expect("attribute", attribute_of(slave, idn)?, attribute)?;
                let before = slave.get(idn)?;
                let protected = attribute >> (26 + phase) & 1 != 0;
                expect("answer", slave.set(idn, words)?, if protected { Err(0x7005) } else { Ok(()) })?;
                let read = slave.get(idn)?;
                let written = if protected { before.clone() } else { own_maximum(words, &read) };
                expect("operation data", read, written)?;
                if protected { Ok(()) } else { slave.must_set(idn, &before) }
            })
        }));
    }
    for (idn, attribute) in COMMANDS {
        let rule = format!("{} is a command with attribute {attribute:08X}H", Idn(idn));
        cases.push(Case::new(SECTION, rule, GAO_2, move |slave| {
            slave.to_cp2()?;
            expect("attribute", attribute_of(slave, idn)?, attribute)?;
            expect("data status", slave.open(idn)?, 0)
        }));
    }
    for (idn, attribute) in CYCLIC {
        let rule = format!("{}, of the standard telegrams, has attribute {attribute:08X}H", Idn(idn));
        cases.push(Case::new(SECTION, rule, "sercos2.md 1.8, A", move |slave| {
            in_every_phase(slave, |slave, _| {
                expect("attribute", attribute_of(slave, idn)?, attribute)?;
                slave.get(idn).map(|_| ())
            })
        }));
    }
    cases.push(Case::new(SECTION, "S-0-0017 ascends, and every IDN in it opens", "sercos2.md 4.1", |slave| {
        slave.to_cp2()?;
        let all = slave.entries(17)?;
        ensure(all.windows(2).all(|pair| pair[0] < pair[1]), || "not in ascending order".to_owned())?;
        for &idn in &all {
            slave.open(idn)?;
        }
        expect("data blocks", all.len(), DICTIONARY.blocks().len())
    }));
    cases.push(Case::new(
        SECTION,
        "no IDN that is not in S-0-0017 opens (every S-0-0000 to S-0-0500 is tried)",
        "sercos2.md 4.1",
        |slave| {
            slave.to_cp2()?;
            let all = slave.entries(17)?;
            for idn in 0..=500 {
                let answer = slave.step(ring::service_client::Step::open(Idn(idn)))?;
                expect(&Idn(idn).to_string(), answer.error, !all.contains(&idn))?;
            }
            Ok(())
        },
    ));
    for (idn, what) in [
        (18, "CP2"),
        (19, "CP3"),
        (20, "CP4"),
        (25, "commands"),
        (187, "the AT"),
        (188, "the MDT"),
        (192, "backup"),
        (398, "status bits"),
        (399, "control bits"),
    ] {
        let rule = format!("{} ({what}) is part of S-0-0017 and is not empty", Idn(idn));
        cases.push(Case::new(SECTION, rule, "sercos2.md 4.1", move |slave| {
            slave.to_cp2()?;
            let all = slave.entries(17)?;
            let part = slave.entries(idn)?;
            ensure(!part.is_empty() && part.iter().all(|idn| all.contains(idn)), || format!("{part:?}"))
        }));
    }
    cases.push(Case::new(
        SECTION,
        "everything in S-0-0187 and S-0-0188 has 2 or 4 bytes, and fits into S-0-0185 and S-0-0186",
        "sercos2.md 1.9",
        |slave| {
            slave.to_cp2()?;
            for (part, longest) in [(187, 185), (188, 186)] {
                let longest = slave.number(longest)?;
                for idn in slave.entries(part)? {
                    let length = attribute_of(slave, idn)? >> 16 & 7;
                    ensure(matches!(length, 1 | 2), || format!("{} has length code {length}", Idn(idn)))?;
                    ensure(u64::from(length * 2) <= longest, || format!("{longest} bytes"))?;
                }
            }
            Ok(())
        },
    ));
    cases.push(Case::new(
        SECTION,
        "everything in S-0-0192 can be written, and what was read can be written back",
        "sercos2.md 4.1",
        |slave| {
            slave.to_cp2()?;
            for idn in slave.entries(192)? {
                let saved = slave.get(idn)?;
                slave.must_set(idn, &saved)?;
                expect(&Idn(idn).to_string(), slave.get(idn)?, saved)?;
            }
            Ok(())
        },
    ));
    cases.push(Case::new(
        SECTION,
        "equal settings have the same S-0-0326, others another",
        "sercos2.md 4.1",
        |slave| {
            slave.to_cp2()?;
            let before = slave.number(326)?;
            slave.must_set(104, &[101])?;
            ensure(slave.number(326)? != before, || "S-0-0326 has not changed".to_owned())?;
            slave.must_set(104, &[100])?;
            expect("S-0-0326", slave.number(326)?, before)
        },
    ));
    cases.push(Case::new(SECTION, "S-0-0143, S-0-0140 and S-0-0030 say who this is", "sercos2.md 4.1", |slave| {
        slave.to_cp2()?;
        ensure(slave.text(143)?.starts_with('V'), || "S-0-0143".to_owned())?;
        for idn in [30, 140] {
            ensure(slave.text(idn)?.len() > 5, || Idn(idn).to_string())?;
        }
        Ok(())
    }));
    cases
}

fn in_every_phase(slave: &mut Slave, look: impl Fn(&mut Slave, u8) -> Outcome) -> Outcome {
    slave.to_cp2()?;
    look(slave, 2).map_err(|error| format!("CP2: {error}"))?;
    slave.configure(Configuration {
        others: vec![(1, vec![2_000]), (16, list(&[])), (24, list(&[]))],
        ..Configuration::default()
    })?;
    slave.to_cp3()?;
    look(slave, 3).map_err(|error| format!("CP3: {error}"))?;
    slave.to_cp4()?;
    look(slave, 4).map_err(|error| format!("CP4: {error}"))
}

fn attribute_of(slave: &mut Slave, idn: u16) -> Outcome<u32> {
    slave.open(idn)?;
    let words = slave.words(3, 2)?.map_err(|code| format!("attribute of {}: {code:04X}H", Idn(idn)))?;
    Ok(u32::from(words[0]) | u32::from(words[1]) << 16)
}

/// A list as it reads back: the second length word is the drive's own.
fn own_maximum(written: &[u16], read: &[u16]) -> Vec<u16> {
    match (written, read) {
        ([length, _, items @ ..], [_, maximum, ..]) => [&[*length, *maximum], items].concat(),
        _ => written.to_vec(),
    }
}
