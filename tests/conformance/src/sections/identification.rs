//! CP0 and CP1: who is there.

use bench::DriveSetup;
use ring::service_client::status;
use ring::wire::{BROADCAST, BitRate};

use crate::case::{Case, Section, ensure, expect};
use crate::slave::{Outcome, Slave};

const SECTION: Section = Section::Identification;

pub(super) fn cases() -> Vec<Case> {
    let mut cases = Vec::new();
    for address in [1, 2, 3, 5, 16, 99, 127, 128, 200, 253, 254] {
        let rule = format!("drive {address} answers an MDT to its address in the next cycle");
        cases.push(Case::new(SECTION, rule, "sercos2.md 2.1", answers_its_address).at(address));
    }
    for (address, other) in [(1, 2), (5, 4), (5, 0), (254, 253), (16, 17)] {
        let rule = format!("drive {address} is silent when drive {other} is addressed");
        cases.push(Case::new(SECTION, rule, "sercos2.md 2.1", move |slave| silent_for(slave, other)).at(address));
    }
    cases.push(Case::new(SECTION, "a broadcast MDT has no answer in CP1", "sercos2.md 2.1", |slave| {
        silent_for(slave, BROADCAST)
    }));
    cases.push(Case::new(SECTION, "no AT in CP0", "sercos2.md 2.1", |slave| {
        slave.to_cp0();
        for _ in 0..20 {
            let at = slave.cycle();
            ensure(at.is_none(), || format!("an AT in CP0: {at:?}"))?;
        }
        Ok(())
    }));
    cases.push(Case::new(SECTION, "no AT in CP1 without an MDT", "sercos2.md 2.1", |slave| {
        in_cp1(slave);
        slave.mdt = false;
        slave.cycles(2);
        for _ in 0..10 {
            let at = slave.cycle();
            ensure(at.is_none(), || format!("an AT without an MDT: {at:?}"))?;
        }
        Ok(())
    }));
    cases.push(Case::new(SECTION, "one MDT in CP1 has one AT", "sercos2.md 2.1", |slave| {
        in_cp1(slave);
        slave.mdt = false;
        let answers: Vec<bool> = (0..4).map(|_| slave.cycle().is_some()).collect();
        expect("ATs after the last MDT", answers, vec![true, false, false, false])
    }));
    cases.push(Case::new(SECTION, "the AT of CP1 starts 100 to 300 us after the MST", "IGS 4.2.6.1", |slave| {
        in_cp1(slave);
        for _ in 0..20 {
            let at = slave.cycle().ok_or("no AT")?;
            let after = at.after_mst.as_microseconds();
            ensure((100..=300).contains(&after), || format!("an AT after {after} us"))?;
        }
        Ok(())
    }));
    cases.push(Case::new(SECTION, "the AT of CP1 has 4 data bytes and AHS follows MHS", "sercos2.md 2.1", |slave| {
        in_cp1(slave);
        let at = slave.last.clone().ok_or("no AT")?;
        expect("configurable data", at.data.len(), 0)?;
        expect("AHS", at.status & status::HANDSHAKE, status::HANDSHAKE)?;
        expect("BUSY and error", at.status & (status::BUSY | status::ERROR), 0)
    }));
    cases.push(Case::new(SECTION, "the status word of CP1 says torque-free", "sercos2.md 1.7", |slave| {
        in_cp1(slave);
        let at = slave.last.clone().ok_or("no AT")?;
        ensure(matches!(status::readiness(at.status), 1 | 2), || format!("status {:04X}H", at.status))?;
        expect("C1D bit", at.status & status::SHUT_DOWN, 0)
    }));
    cases.push(Case::new(SECTION, "the ring is closed: every MST comes back in CP0", "sercos2.md 2.1", |slave| {
        for _ in 0..50 {
            slave.cycle();
            ensure(slave.world.ring().master().mst_has_returned(), || "an MST did not come back".to_owned())?;
        }
        expect("damaged telegrams", slave.world.ring().master().line_errors(), 0)
    }));
    cases.push(
        Case::new(SECTION, "S-0-0096 is the drive's address in both bytes", "sercos2.md 4.1", |slave| {
            slave.to_cp2()?;
            expect("S-0-0096", slave.number(96)?, 0x2A2A)
        })
        .at(42),
    );
    for rate in [BitRate::M2, BitRate::M4, BitRate::M8, BitRate::M16] {
        let rule = format!("three drives answer one after the other at {} Mbit/s", rate.megabits());
        cases.push(Case::new(SECTION, rule, "sercos2.md 2.1", move |_| three_drives(rate)));
    }
    cases
}

fn in_cp1(slave: &mut Slave) {
    slave.to_cp0();
    slave.mst = Some(1);
    slave.cycles(4);
}

fn answers_its_address(slave: &mut Slave) -> Outcome {
    in_cp1(slave);
    let at = slave.last.clone().ok_or("no AT")?;
    let heard = slave.ats();
    expect("ATs in the cycle", heard, vec![(slave.address(), at)])
}

fn silent_for(slave: &mut Slave, address: u8) -> Outcome {
    slave.to_cp0();
    slave.address_to(address);
    slave.mst = Some(1);
    for _ in 0..10 {
        let at = slave.cycle();
        ensure(at.is_none(), || format!("an AT although {address} is addressed: {at:?}"))?;
    }
    Ok(())
}

fn three_drives(rate: BitRate) -> Outcome {
    let addresses = [7, 3, 11];
    let mut slave = Slave::on(rate, addresses.map(DriveSetup::catalogue).to_vec());
    slave.to_cp0();
    slave.mst = Some(1);
    for address in [3, 11, 7, 3, 7, 11] {
        slave.address_to(address);
        slave.cycles(2);
        let heard: Vec<u8> = slave.ats().iter().map(|(address, _)| *address).collect();
        expect("who answers", heard, vec![address])?;
    }
    Ok(())
}
