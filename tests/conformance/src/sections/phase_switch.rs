//! CP0 to CP4: which steps are taken, which are refused, and how.

use bench::DriveSetup;
use ring::wire::BitRate;

use crate::case::{Case, Section, ensure, expect};
use crate::configuration::Configuration;
use crate::slave::{Outcome, Slave};

const SECTION: Section = Section::PhaseSwitch;

/// S-0-0014.
const INTERFACE: u16 = 14;
/// S-0-0011.
const CLASS_1: u16 = 11;
const COMMUNICATION: u64 = 1 << 12;

pub(super) fn cases() -> Vec<Case> {
    let mut cases = Vec::new();
    for phase in 1..=4 {
        let rule = format!("a proper run-up reaches CP{phase} and S-0-0014 says so");
        cases.push(Case::new(SECTION, rule, "sercos2.md 2.2", move |slave| {
            slave.run_up(phase, Configuration::default())?;
            slave.cycles(20);
            ensure(!slave.is_silent(), || "no AT".to_owned())?;
            if phase >= 2 { expect("S-0-0014", slave.number(INTERFACE)?, phase.into()) } else { Ok(()) }
        }));
    }
    cases.push(Case::new(
        SECTION,
        "a master that writes only what S-0-0127 asks for comes from a fresh drive to CP4",
        "sercos2.md 2.3",
        |slave| {
            slave.to_cp2()?;
            let Configuration { cycle, t1, t2, position, length, .. } = Configuration::default();
            for (idn, value) in [(2, cycle), (6, t1), (89, t2), (9, position), (10, length)] {
                slave.must_set(idn, &[value])?;
            }
            slave.to_cp3()?;
            slave.to_cp4()?;
            expect("S-0-0014", slave.number(INTERFACE)?, 4)
        },
    ));
    for phase in 1..=4 {
        let rule = format!("CP0 from CP{phase} is no error, and the next run-up needs no reset");
        cases.push(Case::new(SECTION, rule, "sercos2.md 2.2", move |slave| {
            slave.run_up(phase, Configuration::default())?;
            slave.mst = Some(0);
            slave.cycles(2);
            let at = slave.cycle();
            ensure(at.is_none(), || format!("an AT in CP0: {at:?}"))?;
            slave.run_up(4, Configuration::default())?;
            expect("S-0-0014", slave.number(INTERFACE)?, 4)?;
            expect("S-0-0011", slave.number(CLASS_1)?, 0)
        }));
    }
    // Every other step is an error with a bit of its own (sercos2.md 2.2).
    for from in 0..=4_u8 {
        for to in 0..=7_u8 {
            let bit = match (from, to) {
                (_, 0) => continue,
                (from, to) if from == to || (to == from + 1 && to < 3) => continue,
                (_, 5..) => 5,
                (2, 3) | (3, 4) => 8,
                (from, to) if to < from => 7,
                _ => 6,
            };
            let rule =
                format!("CP{from} to CP{to} ends in CP0 with S-0-0014 bit {bit}, C1D bit 12, and phase {from} frozen");
            cases.push(Case::new(SECTION, rule, "sercos2.md 2.2, 2.4", move |slave| refused(slave, from, to, bit)));
        }
    }
    cases.push(Case::new(
        SECTION,
        "a permission of S-0-0127 outlives its cancellation by 200 cycles",
        "sercos2.md 2.2",
        |slave| {
            slave.run_up(2, Configuration::default())?;
            expect("S-0-0127", slave.command(127)?, 3)?;
            slave.cycles(200);
            slave.mst = Some(3);
            slave.cycles(3);
            expect("S-0-0014", slave.number(INTERFACE)?, 3)
        },
    ));
    for (idn, value) in [(6, 201), (89, 1_001), (8, 1_501), (7, 1_799), (9, 1), (10, 8), (15, 2), (2, 2_000)] {
        let rule = format!("S-0-{idn:04} written after S-0-0127 takes the permission for CP3 back");
        cases.push(Case::new(SECTION, rule, "sercos2.md 2.2", move |slave| {
            slave.run_up(2, Configuration::default())?;
            expect("S-0-0127", slave.command(127)?, 3)?;
            slave.must_set(idn, &[value])?;
            falls_to_cp0(slave, 3)?;
            seen_after_run_up(slave, 1 << 8 | 2)
        }));
    }
    cases.push(Case::new(
        SECTION,
        "a data block that S-0-0127 does not check leaves the permission",
        "sercos2.md 2.2",
        |slave| {
            slave.run_up(2, Configuration::default())?;
            expect("S-0-0127", slave.command(127)?, 3)?;
            slave.must_set(104, &[150])?;
            slave.mst = Some(3);
            slave.cycles(3);
            expect("S-0-0014", slave.number(INTERFACE)?, 3)
        },
    ));
    cases.push(Case::new(SECTION, "a failed S-0-0127 takes an earlier permission back", "sercos2.md 2.3", |slave| {
        slave.run_up(2, Configuration::default())?;
        expect("S-0-0127", slave.command(127)?, 3)?;
        slave.must_set(9, &[2])?;
        expect("S-0-0127", slave.command(127)?, 0xF)?;
        falls_to_cp0(slave, 3)?;
        seen_after_run_up(slave, 1 << 8 | 2)
    }));
    cases.push(Case::new(SECTION, "AHS is carried over from CP2 to CP3 and to CP4", "sercos2.md 2.1", |slave| {
        for close_twice in [false, true] {
            slave.run_up(2, Configuration::default())?;
            expect("S-0-0127", slave.command(127)?, 3)?;
            if close_twice {
                slave.close()?;
            }
            let handshake = slave.handshake();
            slave.mst = Some(3);
            for _ in 0..5 {
                if let Some(at) = slave.cycle() {
                    expect("AHS in CP3", at.status & 1 != 0, handshake)?;
                }
            }
            expect("S-0-0128", slave.command(128)?, 3)?;
            let handshake = slave.handshake();
            slave.mst = Some(4);
            for _ in 0..5 {
                if let Some(at) = slave.cycle() {
                    expect("AHS in CP4", at.status & 1 != 0, handshake)?;
                }
            }
        }
        Ok(())
    }));
    cases.push(Case::new(
        SECTION,
        "at most one AT is missing at the switch to CP3, none at CP4",
        "sercos2.md 2.4",
        |slave| {
            slave.run_up(2, Configuration::default())?;
            expect("S-0-0127", slave.command(127)?, 3)?;
            slave.mst = Some(3);
            let missing = (0..50).filter(|_| slave.cycle().is_none()).count();
            ensure(missing <= 1, || format!("{missing} ATs missing in CP3"))?;
            expect("S-0-0128", slave.command(128)?, 3)?;
            slave.mst = Some(4);
            expect("ATs missing in CP4", (0..50).filter(|_| slave.cycle().is_none()).count(), 0)
        },
    ));
    cases.push(Case::new(SECTION, "other bits of the MST's data byte are ignored", "sercos2.md 1.3", |slave| {
        slave.run_up(2, Configuration::default())?;
        slave.mst = Some(0xF8 | 2);
        slave.cycles(10);
        slave.mst = Some(2);
        slave.cycles(2);
        expect("S-0-0014", slave.number(INTERFACE)?, 2)
    }));
    cases.push(Case::new(
        SECTION,
        "a drive switched on in a running ring waits for CP0 without an error",
        "sercos2.md 2.2",
        |_| {
            let slave = &mut Slave::in_ring(BitRate::M2, vec![DriveSetup::catalogue(5)], 4);
            for phase in [4, 2, 1] {
                slave.mst = Some(phase);
                slave.mdt = phase < 3;
                for _ in 0..20 {
                    let at = slave.cycle();
                    ensure(at.is_none(), || format!("an AT in CP{phase}: {at:?}"))?;
                }
            }
            seen_after_run_up(slave, 2)
        },
    ));
    cases
}

/// From a phase that was reached properly, the MST goes on to one that may not follow.
fn refused(slave: &mut Slave, from: u8, to: u8, bit: u8) -> Outcome {
    slave.run_up(from, Configuration::default())?;
    falls_to_cp0(slave, to)?;
    seen_after_run_up(slave, 1 << bit | u64::from(from))
}

/// The MST announces a phase for good, and the slave sends no AT any more.
fn falls_to_cp0(slave: &mut Slave, to: u8) -> Outcome {
    slave.mst = Some(to);
    slave.cycles(3);
    for _ in 0..10 {
        let at = slave.cycle();
        ensure(at.is_none(), || format!("an AT although the slave should be in CP0: {at:?}"))?;
    }
    Ok(())
}

/// What S-0-0014 shows in CP2 of the next run-up, and that S-0-0099 clears it.
fn seen_after_run_up(slave: &mut Slave, interface: u64) -> Outcome {
    slave.to_cp2()?;
    expect("S-0-0014", slave.number(INTERFACE)?, interface)?;
    let is_error = interface & !7 != 0;
    expect("S-0-0011", slave.number(CLASS_1)?, if is_error { COMMUNICATION } else { 0 })?;
    if is_error {
        expect("S-0-0099", slave.command(99)?, 3)?;
        expect("S-0-0014 after S-0-0099", slave.number(INTERFACE)?, 2)?;
        expect("S-0-0011 after S-0-0099", slave.number(CLASS_1)?, 0)?;
    }
    Ok(())
}
