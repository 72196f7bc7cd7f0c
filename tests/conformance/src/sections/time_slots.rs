//! When the AT starts, which slots S-0-0127 takes and which it refuses, cycle times and bit rates.

use bench::DriveSetup;
use ring::Nanoseconds;
use ring::fibre::{Effect, TelegramKind};
use ring::wire::BitRate;

use crate::case::{Case, Section, ensure, expect};
use crate::configuration::Configuration;
use crate::slave::{Outcome, Slave};

const SECTION: Section = Section::TimeSlots;

pub(super) fn cases() -> Vec<Case> {
    let mut cases = Vec::new();
    for t1 in [12, 20, 92, 150, 336, 500, 824, 900] {
        let rule = format!("t1 = {t1} us: every AT of CP3 and CP4 starts within 1 us of it");
        cases.push(Case::new(SECTION, rule, "sercos2.md 5.1", move |slave| {
            slave.run_up(3, Configuration { t1, t2: 1_100, ..Configuration::default() })?;
            starts_at(slave, t1, 50)?;
            slave.to_cp4()?;
            starts_at(slave, t1, 200)
        }));
    }
    cases.push(Case::new(SECTION, "with a crystal 100 ppm off the AT does not drift", "sercos2.md 5.4", |_| {
        for clock_ppm in [-100, 100] {
            let slave = &mut Slave::new(DriveSetup { clock_ppm, ..DriveSetup::catalogue(5) });
            slave.run_up(4, Configuration::default())?;
            starts_at(slave, 200, 1_000)?;
        }
        Ok(())
    }));
    for (idn, name, most) in
        [(3, "t1min", 20), (4, "tATMT", 10), (5, "t5", 80), (88, "tMTSY", 10), (90, "tMTSG", 20), (87, "tATAT", 0)]
    {
        let rule = format!("{name} (S-0-{idn:04}) is at most {most} us");
        cases.push(Case::new(SECTION, rule, "DESIGN 8, sercos2.md 5.4", move |slave| {
            slave.to_cp2()?;
            let time = slave.number(idn)?;
            ensure(time <= most, || format!("{time} us"))
        }));
    }
    cases.extend(borders());
    for cycle in [500, 750, 1_000, 2_000, 4_000, 8_000, 10_000, 20_000, 65_000] {
        let rule = format!("cycle time {cycle} us: a run-up to CP4, every AT at t1");
        cases.push(Case::new(SECTION, rule, "sercos2.md 5.5", move |slave| {
            let configuration = Configuration { cycle, t1: 20, t2: 150, t3: 400, t4: 450, ..Configuration::default() };
            slave.run_up(4, configuration)?;
            starts_at(slave, 20, 50)
        }));
    }
    for (t3, t4) in [(0, 1_800), (1, 1_800), (1_500, 0), (1_500, 1), (0, 0), (2_000, 1_800)] {
        let rule =
            format!("t3 = {t3} and t4 = {t4} us: accepted, and CP4 is reached with loops that run with the ring");
        cases.push(Case::new(SECTION, rule, "sercos2.md 5.3", move |slave| {
            slave.run_up(4, Configuration { t3, t4, ..Configuration::default() })?;
            slave.cycles(200);
            expect("S-0-0182 bit 0", slave.number(182)? & 1, 1)
        }));
    }
    for (rate, name) in [(BitRate::M2, 2), (BitRate::M4, 4), (BitRate::M8, 8), (BitRate::M16, 16)] {
        for cycle in [500, 2_000] {
            let rule = format!("{name} Mbit/s, {cycle} us: a run-up to CP4, every AT at t1");
            cases.push(Case::new(SECTION, rule, "sercos2.md 5.2, 5.5", move |_| {
                let slave = &mut Slave::on(rate, vec![DriveSetup::catalogue(5)]);
                let configuration =
                    Configuration { cycle, t1: 12, t2: 150, t3: 400, t4: 450, ..Configuration::default() };
                slave.run_up(4, configuration)?;
                starts_at(slave, 12, 100)
            }));
        }
    }
    for (microseconds, taken) in [(0, true), (1, true), (200, false)] {
        let rule = format!(
            "an MDT that starts {microseconds} us after t2 {}",
            if taken { "is taken" } else { "counts as failed" }
        );
        cases.push(Case::new(SECTION, rule, "sercos2.md 2.4, 5.3", move |slave| {
            slave.run_up(4, Configuration::default())?;
            slave.cycles(20);
            slave.disturb(TelegramKind::Mdt, Effect::Delay(Nanoseconds::from_microseconds(microseconds)), 1);
            slave.cycles(10);
            expect("S-0-0029", slave.number(29)?, u64::from(!taken))
        }));
    }
    cases.push(Case::new(
        SECTION,
        "several control units: S-0-0001 of 1, 2 and 10 cycles",
        "sercos2.md 4.1",
        |slave| {
            for multiple in [1, 2, 10] {
                let configuration =
                    Configuration { control_unit_cycle: Some(2_000 * multiple), ..Configuration::default() };
                slave.run_up(4, configuration)?;
            }
            Ok(())
        },
    ));
    cases
}

/// A change of the default configuration that does not fit, the data block to blame, and the reason code.
type Border = (&'static str, fn(&mut Configuration), Option<(u16, u16)>);

/// The default: 2 ms at 2 Mbit/s, AT of 4 bytes (61 us), MDT of 8 bytes (61 us).
const BORDERS: [Border; 19] = [
    ("t1 = t1min", |c| c.t1 = 12, None),
    ("the MDT right behind AT and tATMT", |c| c.t1 = 929, None),
    ("the MDT 1 us too early behind the AT", |c| c.t1 = 930, Some((89, 9))),
    ("the MDT before the AT", |c| c.t2 = 100, Some((89, 9))),
    ("the MDT as late as tMTSY lets it", |c| (c.t2, c.t3) = (1_929, 500), None),
    ("the MDT 1 us later than tMTSY lets it", |c| (c.t2, c.t3) = (1_930, 500), Some((89, 10))),
    ("the MDT beyond the cycle", |c| (c.t2, c.t3) = (2_500, 500), Some((89, 10))),
    ("t4 as late as t5 lets it", |c| c.t4 = 1_970, None),
    ("t4 1 us later than t5 lets it", |c| c.t4 = 1_971, Some((7, 10))),
    ("t4 = 0", |c| c.t4 = 0, None),
    ("t3 right behind the MDT and tMTSG", |c| c.t3 = 1_063, None),
    ("t3 1 us too early behind the MDT", |c| c.t3 = 1_062, Some((8, 9))),
    ("t3 in the middle of the MDT", |c| c.t3 = 1_030, Some((8, 9))),
    ("t3 = t2: the command of the MDT before", |c| c.t3 = 1_000, None),
    ("t3 before the MDT", |c| c.t3 = 100, None),
    ("t3 at the end of the cycle", |c| c.t3 = 2_000, None),
    ("t3 beyond the cycle", |c| c.t3 = 2_001, Some((8, 10))),
    ("S-0-0001 that is no multiple of S-0-0002", |c| c.control_unit_cycle = Some(3_000), Some((1, 6))),
    ("S-0-0001 below S-0-0002", |c| c.control_unit_cycle = Some(1_000), Some((1, 6))),
];

fn borders() -> Vec<Case> {
    let mut cases = Vec::new();
    for (what, change, culprit) in BORDERS {
        let verdict =
            culprit.map_or_else(|| "accepted".to_owned(), |(idn, _)| format!("refused, S-0-{idn:04} to blame"));
        let rule = format!("{what}: {verdict}");
        cases.push(Case::new(SECTION, rule, "sercos2.md 2.3, 5.3", move |slave| {
            let mut configuration = Configuration::default();
            change(&mut configuration);
            slave.to_cp2()?;
            slave.configure(configuration)?;
            let status = slave.command(127)?;
            let found = slave.entries(21)?.into_iter().zip(slave.entries(0x8001)?).collect::<Vec<_>>();
            expect("S-0-0127", status, if culprit.is_some() { 0xF } else { 3 })?;
            expect("S-0-0021 and reasons", found, culprit.into_iter().collect())
        }));
    }
    for (cycle, code) in [(0, 0x7006), (62, 0x7006), (250, 0x7006), (499, 0x7006), (65_001, 0x7007), (65_535, 0x7007)] {
        let rule = format!("S-0-0002 = {cycle} is refused with {code:04X}H");
        cases.push(Case::new(SECTION, rule, "sercos2.md 5.5", move |slave| {
            slave.to_cp2()?;
            expect("answer", slave.set(2, &[cycle])?, Err(code))
        }));
    }
    for idn in [2, 6, 9, 10, 89] {
        let rule = format!("S-0-{idn:04} must be written in every run-up: else S-0-0127 names it");
        cases.push(Case::new(SECTION, rule, "sercos2.md 2.3", move |slave| {
            slave.run_up(4, Configuration::default())?;
            slave.to_cp2()?;
            for (other, words) in Configuration::default().writes() {
                if other != idn {
                    slave.must_set(other, &words)?;
                }
            }
            expect("S-0-0127", slave.command(127)?, 0xF)?;
            expect("S-0-0021", slave.entries(21)?, vec![idn])?;
            expect("P-0-0001", slave.entries(0x8001)?, vec![1])
        }));
    }
    cases
}

/// So many ATs in a row start within 1 us of t1.
fn starts_at(slave: &mut Slave, t1: u16, cycles: u32) -> Outcome {
    for cycle in 0..cycles {
        let at = slave.cycle().ok_or_else(|| format!("no AT in cycle {cycle}"))?;
        let off = at.after_mst.0.abs_diff(u64::from(t1) * 1_000);
        ensure(off <= 1_000, || format!("cycle {cycle}: the AT starts {} after the MST", at.after_mst))?;
    }
    Ok(())
}
