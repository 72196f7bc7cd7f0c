//! t3: when a command becomes valid. t4: of which instant the feedback is.

use super::error_handling::in_operation;
use crate::case::{Case, Section, ensure};
use crate::configuration::Configuration;
use crate::slave::{Outcome, Slave};

const SECTION: Section = Section::CommandAndFeedback;

/// From t3 to the current. The loop tick, locked a quarter of its 125 us behind t3, takes the command; the current loop's second cycle of
/// the tick gets it, and its voltage acts half a cycle later: 125 us. The current needs three of its time constants of 130 us.
const LATEST_CURRENT_US: u16 = 520;

/// Smaller differences of the current are noise of the sensors, as a fraction of the peak current.
const NOISE: f64 = 0.004;

/// 0.0001 degrees of an encoder increment (65 536 a revolution), and of a microsecond at 300 rpm.
const INCREMENT: f64 = 54.9;
const MICROSECOND: f64 = 18.0;

pub(super) fn cases() -> Vec<Case> {
    let mut cases = Vec::new();
    // t1 = 20, t2 = 150: the MDT is over at 211 us.
    for t3 in [220, 300, 500, 750, 1_000, 1_333, 1_700, 1_900, 1_999] {
        let rule = format!("t3 = {t3} us, behind the MDT: the command is valid at t3, by the next loop tick");
        cases.push(Case::new(SECTION, rule, "sercos2.md 4.1, 5.3", move |slave| command_valid(slave, 20, 150, t3)));
    }
    // t2 = 1 200.
    for t3 in [50, 125, 400, 777, 1_100] {
        let rule = format!("t3 = {t3} us, before the MDT: the command of the MDT before is valid at t3");
        cases.push(Case::new(SECTION, rule, "sercos2.md 5.3", move |slave| command_valid(slave, 20, 1_200, t3)));
    }
    for t4 in [250, 400, 600, 900, 1_234, 1_500, 1_800, 1_900, 1_970] {
        let rule = format!("t4 = {t4} us: the AT has the position of t4, to an encoder increment and 1 us");
        cases.push(Case::new(SECTION, rule, "sercos2.md 4.1", move |slave| feedback_captured(slave, t4)));
    }
    cases.push(Case::new(SECTION, "a velocity command is followed within 1 %", "sercos2.md 6.2", |slave| {
        in_operation(slave, 2, Configuration::application(&[51, 40], &[36]))?;
        slave.commands = 3_000_000_i32.to_le_bytes().to_vec();
        slave.cycles(800);
        let velocity = slave.last.clone().ok_or("no AT")?.long(4);
        ensure((velocity - 3_000_000).abs() < 30_000, || format!("{velocity} of 0.0001 rpm"))
    }));
    cases.push(Case::new(SECTION, "S-0-0037 in the MDT is added to S-0-0036", "sercos2.md 4.2", |slave| {
        in_operation(slave, 2, Configuration::application(&[51, 40], &[36, 37]))?;
        slave.commands = [1_000_000_i32.to_le_bytes(), 500_000_i32.to_le_bytes()].concat();
        slave.cycles(800);
        let velocity = slave.last.clone().ok_or("no AT")?.long(4);
        ensure((velocity - 1_500_000).abs() < 20_000, || format!("{velocity} of 0.0001 rpm"))
    }));
    cases.push(Case::new(SECTION, "S-0-0048 in the MDT is added to S-0-0047", "sercos2.md 4.2", |slave| {
        in_operation(slave, 11, Configuration::application(&[51], &[47, 48]))?;
        let start = slave.last.clone().ok_or("no AT")?.long(0);
        for step in 1..=90_i32 {
            slave.commands = [start.to_le_bytes(), (step * 1_000).to_le_bytes()].concat();
            slave.cycle();
        }
        slave.cycles(100);
        let turned = slave.last.clone().ok_or("no AT")?.long(0) - start;
        ensure((turned - 90_000).abs() < 1_000, || format!("{turned} of 0.0001 degrees"))
    }));
    for (source, what) in [(1, "that of the motor encoder"), (0, "0")] {
        let rule = format!("with P-0-2705 = {source} S-0-0053 is {what}");
        cases.push(Case::new(SECTION, rule, "sercos2.md 1.8, P-0-2705", move |slave| {
            slave.run_up_with_motor(
                4,
                2,
                Configuration::default().with(0x8000 | 2705, &[source]).with_long(52, 987_654),
            )?;
            slave.cycles(50);
            ensure(slave.command(447)? == 3, || "S-0-0447 fails".to_owned())?;
            slave.cycles(5);
            let (first, second) = (slave.number(51)? as u32 as i32, slave.number(53)? as u32 as i32);
            ensure((first - 987_654).abs() < 1_000, || format!("S-0-0051 = {first}"))?;
            let expected = if source == 1 { first } else { 0 };
            ensure((second - expected).abs() < 1_000, || format!("S-0-0053 = {second}, S-0-0051 = {first}"))
        }));
    }
    cases.push(Case::new(SECTION, "feedback is refreshed every cycle", "sercos2.md 4.1", |slave| {
        running(slave, 1_800)?;
        let mut last = slave.cycle().ok_or("no AT")?.long(0);
        for _ in 0..100 {
            let position = slave.cycle().ok_or("no AT")?.long(0);
            // 300 rpm: 3.6 degrees in 2 ms.
            let step = position - last;
            ensure((35_000..37_000).contains(&step), || format!("{step} of 0.0001 degrees in a cycle"))?;
            last = position;
        }
        Ok(())
    }));
    cases.push(Case::new(SECTION, "no command is valid in CP3", "sercos2.md 2.1", |slave| {
        slave.run_up_with_motor(3, 2, Configuration::default())?;
        slave.commands = 3_000_000_i32.to_le_bytes().to_vec();
        slave.control = 0xE000;
        slave.cycles(50);
        let current = slave.drive.motor_side.borrow_mut().current();
        ensure(current.abs() < 1e-9, || format!("{current} of the peak current"))?;
        let command = slave.number(36)?;
        ensure(command == 0, || format!("S-0-0036 = {command}"))
    }));
    cases.push(Case::new(SECTION, "a lost MDT is bridged: the motor goes on", "sercos2.md 2.4", |slave| {
        running(slave, 1_800)?;
        for _ in 0..5 {
            slave.disturb(ring::fibre::TelegramKind::Mdt, ring::fibre::Effect::Drop, 1);
            let before = slave.cycle().ok_or("no AT")?.long(0);
            slave.cycles(9);
            let after = slave.cycle().ok_or("no AT")?.long(0);
            let step = f64::from(after - before) / 10.0;
            ensure((35_500.0..36_500.0).contains(&step), || format!("{step} of 0.0001 degrees in a cycle"))?;
        }
        Ok(())
    }));
    cases.into_iter().map(Case::on_a_press).collect()
}

/// A step of the torque command becomes current at t3.
fn command_valid(slave: &mut Slave, t1: u16, t2: u16, t3: u16) -> Outcome {
    let configuration = Configuration { t1, t2, t3, t4: 1_900, ..Configuration::application(&[84], &[80]) };
    in_operation(slave, 1, configuration)?;
    slave.cycles(200);
    let current = |slave: &Slave| slave.drive.motor_side.borrow_mut().current();
    for percent in [40_i16, -40, 60] {
        let before = current(slave);
        slave.commands = percent.to_le_bytes().to_vec();
        slave.finish_cycle_to(t3.saturating_sub(2));
        let behind_mdt = t3 > t2;
        let mut seen = before;
        if behind_mdt {
            ensure((current(slave) - before).abs() < NOISE, || "the current changes before t3".to_owned())?;
            slave.run_to((t3 + LATEST_CURRENT_US).min(1_970));
            seen = current(slave);
        }
        slave.finish_cycle();
        slave.begin_cycle();
        if !behind_mdt {
            slave.run_to(t3.saturating_sub(2));
            ensure((current(slave) - before).abs() < NOISE, || {
                "the current changes before t3 of the next cycle".to_owned()
            })?;
            slave.run_to(t3 + LATEST_CURRENT_US);
            seen = current(slave);
        } else if t3 + LATEST_CURRENT_US > 1_970 {
            // The loop tick may come behind the next MST.
            slave.run_to((t3 + LATEST_CURRENT_US).saturating_sub(2_000));
            seen = current(slave);
        }
        // 0.1 % of 25 A on an amplifier of 60 A.
        let expected = f64::from(percent) / 1_000.0 * 25.0 / 60.0;
        ensure((seen - expected).abs() < NOISE, || format!("current {seen:.4} of the peak, expected {expected:.4}"))?;
        slave.run_to_mdt();
        slave.cycles(5);
    }
    Ok(())
}

/// The motor turns at 300 rpm; the AT says where it was at t4.
fn feedback_captured(slave: &mut Slave, t4: u16) -> Outcome {
    running(slave, t4)?;
    for _ in 0..20 {
        slave.finish_cycle_to(t4);
        let now = slave.world.now();
        let angle = slave.drive.motor_side.borrow_mut().machine().angle(now.0) * 3_600_000.0;
        let shown = slave.cycle().ok_or("no AT")?.long(0);
        let off = f64::from(shown) - angle;
        ensure(off.abs() < INCREMENT + MICROSECOND, || {
            format!("{shown} of 0.0001 degrees, the motor was at {angle:.0}: {:.1} us off", off / MICROSECOND)
        })?;
    }
    Ok(())
}

/// 300 rpm in velocity mode; t1 and t2 as early as they can be.
fn running(slave: &mut Slave, t4: u16) -> Outcome {
    let configuration = Configuration { t1: 20, t2: 150, t3: 230, t4, ..Configuration::application(&[51], &[36]) };
    in_operation(slave, 2, configuration)?;
    slave.commands = 3_000_000_i32.to_le_bytes().to_vec();
    slave.cycles(1_000);
    Ok(())
}
