//! The end of every life: everything is repaired, the control unit is reasonable, and then the axis must come back.

use fault_matrix::Fault;
use ring::Nanoseconds;
use ring::ident::Idn;
use ring::service_client::status;

use crate::life::{Action, Plant};
use crate::rig::{Rig, Stop};
use crate::run::Run;
use crate::services::{PASSWORD, is_list};
use crate::units::{default_of, setting, words_of};

const LAW: &str = "after the cause is gone, S-0-0099 and a fresh edge always bring the axis back";
/// A control word without bits 15 and 14 is seen for sure within this time.
const RELEASED: Nanoseconds = Nanoseconds::from_millis(10);
/// Bits 15, 14 and 13.
const FOLLOW: u8 = 7;
/// Bits 15 and 14.
const HALT: u8 = 6;
/// F105H.
const ENCODER_ERROR: i64 = 0xF105;
/// Operation mode 1.
const TORQUE: i64 = 1;
/// Brakes, the test of the torque and the search for the commutation angle.
const SWITCHING_ON: Nanoseconds = Nanoseconds::from_millis(3_000);
/// An axis that coasts with friction alone.
const COASTING: Nanoseconds = Nanoseconds::from_millis(20_000);
/// The diagnosis of an overload, and more than its time constant of 1 s.
const OVERLOAD: u16 = 0xF100;
const COOLING: Nanoseconds = Nanoseconds::from_millis(1_200);
/// That of a heat sink that is too hot.
const HEAT_SINK: u16 = 0xF101;
/// The longest that a brake takes to close.
const BRAKING: Nanoseconds = Nanoseconds::from_millis(1_500);
/// Where the commutation angle stands, and whether it is known.
const COMMUTATION_ANGLE: u16 = 0x8000 | 118;
const COMMUTATION_STATE: u16 = 0x8000 | 119;
const FINDING: u16 = 0x8000 | 3;
const OVERVOLTAGE_THRESHOLD: u16 = 0x8000 | 105;
/// This share of it.
const FULL: f64 = 0.93;
/// Commands that write parameters: S-0-0262, P-0-0220, 224, 225, 226.
const WRITERS: [u16; 5] = [262, 0x8000 | 220, 0x8000 | 224, 0x8000 | 225, 0x8000 | 226];
/// Data blocks that follow from what the axis does; nobody restores them.
const COMMANDS_AND_BITS: [u16; 16] =
    [36, 37, 47, 48, 80, 81, 145, 258, 282, 346, 400, 405, 406, 407, PASSWORD, COMMUTATION_ANGLE];
/// What every run-up writes anyway.
const TELEGRAMS: [u16; 11] = [1, 2, 6, 7, 8, 9, 10, 15, 16, 24, 89];
/// Command values that a control takes back if it has written them over the service channel.
const TAKEN_BACK: [u16; 6] = [36, 37, 48, 80, 81, 145];

/// Makes peace, and holds the axis to the law.
pub(crate) fn make(run: &mut Run) -> Result<(), Stop> {
    run.repair();
    run.rig.chosen = 0;
    run.rig.master().calm();
    let from = run.rig.sound_from;
    while run.rig.world.ring().cycle().is_some_and(|cycle| cycle < from) {
        run.rig.cycles(1)?;
    }
    run.rig.run(RELEASED)?;
    run.rig.cycles(2)?;
    run.services.take_back(run.rig.master());
    run.rig.wait_for_answers()?;
    run.harvest();
    stand(run)?;

    let alive = run.rig.master().sent_phase() == 4 && run.rig.master().silent() == 0;
    if alive && run.services.may_be_locked {
        run.rig.unlock()?;
    }
    run.told_an_angle |= run.services.has_taken(COMMUTATION_ANGLE);
    run.rig.is_another |= run.services.started.iter().any(|idn| WRITERS.contains(idn));
    if !alive || run.rig.is_another || !restore(run)? {
        run.coverage.count("peace", "by a run-up");
        run_up(run)?;
    } else {
        run.coverage.count("peace", "in CP4");
    }
    diagnose(run)?;
    cool_down(run)?;
    come_back_from(run).or_else(|stop| {
        // A count that was moved while the shaft stood is found at the first index pulse.
        if !run.causes.may_have_moved_the_count() || run.rig.read(390)? != Some(ENCODER_ERROR) {
            return Err(stop);
        }
        run.coverage.count("peace", "after an index pulse that showed a moved count");
        run.rig.master().switch(0);
        stand(run)?;
        come_back_from(run)
    })
}

fn come_back_from(run: &mut Run) -> Result<(), Stop> {
    reset(run)?;
    know_the_angle(run)?;
    come_back(run)
}

/// Waits until the shaft stands.
fn stand(run: &mut Run) -> Result<(), Stop> {
    let until = run.rig.world.now() + COASTING;
    while run.rig.rpm().abs() > 0.5 && run.rig.world.now() < until {
        run.rig.run(Nanoseconds::from_millis(10))?;
    }
    // A brake takes its time; the torque stays until it holds.
    let until = run.rig.world.now() + BRAKING;
    while run.rig.bridge_is_on() && run.rig.world.now() < until {
        run.rig.run(Nanoseconds::from_millis(5))?;
    }
    Ok(())
}

/// Cancels the commands, and writes back what the life has written, the last first; false if a data block does not take it.
fn restore(run: &mut Run) -> Result<bool, Stop> {
    let mut started = std::mem::take(&mut run.services.started);
    started.sort_unstable();
    started.dedup();
    for idn in started {
        if run.rig.write(idn, 0)?.is_err() {
            return Ok(false);
        }
    }
    while let Some(written) = run.services.written.pop() {
        if TAKEN_BACK.contains(&written.idn) && !run.rig.axis.mdt.contains(&written.idn) {
            if run.rig.write(written.idn, 0)?.is_err() {
                return Ok(false);
            }
            continue;
        }
        if COMMANDS_AND_BITS.contains(&written.idn) || TELEGRAMS.contains(&written.idn) {
            continue;
        }
        let words = if is_list(written.idn) {
            vec![0, 0]
        } else {
            words_of(written.idn, written.before.unwrap_or_else(|| original(run, written.idn)))
        };
        if run.rig.write_words(written.idn, &words)?.is_err() {
            run.coverage.count("not restored in CP4", Idn(written.idn).to_string());
            run.services.written.push(written);
            return Ok(false);
        }
    }
    Ok(true)
}

fn original(run: &Run, idn: u16) -> i64 {
    let needed = crate::units::writes(&run.rig.axis, &run.rig.machine);
    let needed = needed.iter().rev().find(|(other, _)| *other == idn).map(|(_, value)| *value);
    setting(&run.rig.axis, idn).or(needed).unwrap_or_else(|| default_of(idn))
}

/// A run-up with every setting, after what the life has written has got its default back.
fn run_up(run: &mut Run) -> Result<(), Stop> {
    run.services.drop_pending();
    run.services.started.clear();
    let mut written: Vec<u16> = run.services.written.drain(..).map(|written| written.idn).collect();
    written.sort_unstable();
    written.dedup();
    written.retain(|idn| !is_list(*idn) && !TELEGRAMS.contains(idn));
    written.retain(|idn| TAKEN_BACK.contains(idn) || !COMMANDS_AND_BITS.contains(idn));
    let originals: Vec<(u16, i64)> = written.iter().map(|&idn| (idn, original(run, idn))).collect();
    let before = run.rig.axis.settings.clone();
    for (idn, value) in originals {
        if setting(&run.rig.axis, idn).is_none() {
            run.rig.axis.settings.push((idn, value));
        }
    }
    let result = let_go(run).and_then(|()| run.run_up(true, &[]));
    run.rig.axis.settings = before;
    match result {
        Err(Stop::Refused(reason)) => {
            // Perhaps it is not what was tried that is refused, but the axis; what was tried in CP2 may have mended it.
            if !run.proven || !run.rig.axis.also.is_empty() {
                Rig::new(&run.rig.axis)?.run_up()?;
            }
            Err(Stop::Broken { law: LAW.to_owned(), detail: format!("the last run-up is refused: {reason}") })
        }
        Ok(()) => {
            // What was refused before has gone with it, also from P-0-0003.
            run.services.ask(run.rig.master(), &Action::Read(FINDING));
            run.rig.wait_for_answers()?;
            run.harvest();
            Ok(())
        }
        other => other,
    }
}

/// An axis that its brake did not hold is held by its torque, in every phase, until it is switched on and off again. As long as it is, the
/// defaults are not loaded: it runs up with its own data without them first.
fn let_go(run: &mut Run) -> Result<(), Stop> {
    if !run.rig.bridge_is_on() {
        return Ok(());
    }
    run.coverage.count("peace", "of an axis that was held by its torque");
    let is_another = std::mem::replace(&mut run.rig.is_another, false);
    run.run_up(true, &[])?;
    run.rig.is_another = is_another;
    come_back_from(run)?;
    run.rig.master().switch(0);
    stand(run)
}

/// For the coverage: what the drive says about itself.
fn diagnose(run: &mut Run) -> Result<(), Stop> {
    let error = run.rig.master().at().is_some_and(|at| at.status & status::SHUT_DOWN != 0);
    if error && let Some(number) = run.rig.read(390)? {
        run.diagnosed(number as u16);
    }
    run.judge()
}

/// A motor that was overloaded is left to cool, with the short time constants that such axes have, and a heat sink until the filter has seen it.
fn cool_down(run: &mut Run) -> Result<(), Stop> {
    if run.has_met(HEAT_SINK) {
        run.rig.run(Fault::HeatSinkHot.aftermath())?;
    }
    if run.has_met(OVERLOAD) { run.rig.run(COOLING) } else { Ok(()) }
}

fn reset(run: &mut Run) -> Result<(), Stop> {
    match run.rig.command(99)? {
        Ok(3) => {}
        other => {
            let number = run.rig.read(390)?.unwrap_or(0);
            let detail = format!("S-0-0099 ends with {other:04X?}, S-0-0390 = {:04X}H", number as u16);
            return Err(Stop::Broken { law: LAW.to_owned(), detail });
        }
    }
    run.rig.cycles(2)?;
    Ok(())
}

/// An axis whose angle was kept elsewhere gets it again, if the drive has lost it or was told another one.
fn know_the_angle(run: &mut Run) -> Result<(), Stop> {
    let unknown = run.told_an_angle || run.rig.axis.aligned && run.rig.read(COMMUTATION_STATE)? == Some(0);
    if unknown && run.rig.rpm().abs() < 0.5 {
        let angle = run.rig.commutation_angle();
        if let Err(code) = run.rig.write(COMMUTATION_ANGLE, angle)? {
            let detail = format!("P-0-0118 is refused with {code:04X}H at rest, without torque");
            return Err(Stop::Broken { law: LAW.to_owned(), detail });
        }
    }
    Ok(())
}

fn come_back(run: &mut Run) -> Result<(), Stop> {
    run.rig.master().switch(0);
    run.rig.run(RELEASED)?;
    run.rig.cycles(4)?;
    // No torque is no peace for a load that hangs: it is halted, and held.
    let primary = setting(&run.rig.axis, 32).unwrap_or_else(|| default_of(32));
    let bits = if primary & 0xF == TORQUE && run.rig.axis.plant == Plant::Vertical { HALT } else { FOLLOW };
    run.rig.master().switch(bits);
    let until = run.rig.world.now() + SWITCHING_ON;
    while !operates(run, bits) {
        let error = run.rig.master().at().is_some_and(|at| at.status & status::SHUT_DOWN != 0);
        if error && link_is_full(run)? {
            run.coverage.count("peace", "with a DC link that nothing empties");
            return Ok(());
        }
        if run.rig.world.now() > until || error {
            return Err(failed(run, "does not switch on"));
        }
        run.rig.cycles(1)?;
    }
    run.rig.cycles(10)?;
    if operates(run, bits) { Ok(()) } else { Err(failed(run, "does not stay in operation")) }
}

/// An overvoltage ends below P-0-0105, and what a motor has fed back without a chopper stays where it is: no control can help that.
fn link_is_full(run: &mut Run) -> Result<bool, Stop> {
    let most = run.rig.read(OVERVOLTAGE_THRESHOLD)?.unwrap_or(0);
    let now = run.rig.world.now().0;
    let volts = run.rig.drive.motor_side.borrow_mut().machine().bus_voltage(now);
    Ok(volts > FULL * most as f64)
}

fn operates(run: &mut Run, bits: u8) -> bool {
    let status = run.rig.master().at().map_or(0, |at| at.status);
    status::readiness(status) == 3
        && (status & status::FOLLOWS != 0) == (bits == FOLLOW)
        && status & status::SHUT_DOWN == 0
        && run.rig.bridge_is_on()
}

fn failed(run: &mut Run, what: &str) -> Stop {
    let at = run.rig.master().at().map_or(0, |at| at.status);
    // Whatever else breaks here says less than this.
    let number = run.rig.read(390).ok().flatten().unwrap_or(0);
    let detail = format!("the axis {what}: status {at:04X}H, S-0-0390 = {:04X}H", number as u16);
    Stop::Broken { law: LAW.to_owned(), detail }
}
