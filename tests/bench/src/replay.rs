//! A recording of a real master, played against our drives.

use ring::capture::Recording;
use ring::ident::Idn;
use ring::master::PhaseRecord;
use ring::player::{CapturePlayer, DriveReport, PlayError, Stage};
use ring::wire::BitRate;
use ring::{Nanoseconds, RingConfiguration};

use crate::executor::Executor;
use crate::processor::ProcessorError;
use crate::report::{
    Acknowledgement, DriveReplay, MissedTelegrams, PhaseTime, Platform, Progress, ReadBackDifference, ReplayReport,
    ServiceError,
};
use crate::ring_of_drives::{DriveHandle, DriveSetup, ring_of_drives_on};

/// How a recording is played.
#[derive(Clone, Debug)]
pub struct ReplayOptions {
    /// Bit rate of the ring; recordings do not say.
    pub bit_rate: BitRate,
    /// Where drive 1 (the lowest address of the recording) runs.
    pub executor: Executor,
    /// What the drives are like; their addresses are those of the recording.
    pub drive: DriveSetup,
}

impl ReplayOptions {
    /// At 2 Mbit/s, all drives on this computer, on chips that behave as proposed.
    #[must_use]
    pub fn on_host() -> Self {
        Self { bit_rate: BitRate::M2, executor: Executor::Host, drive: DriveSetup::catalogue(1) }
    }
}

/// Why a replay could not be done at all.
#[derive(Debug, thiserror::Error)]
pub enum ReplayError {
    /// The recording contradicts itself.
    #[error(transparent)]
    Recording(#[from] PlayError),
    /// A drive could not go on.
    #[error(transparent)]
    Processor(#[from] ProcessorError),
}

/// How often the progress is told, in simulated time.
const PROGRESS_EVERY: Nanoseconds = Nanoseconds::from_millis(20);
/// What a recording that never gets to CP3 is played with.
const CYCLE_BEFORE_CP3_US: u32 = 2_000;
/// Steps of the observer; phases are noted this finely.
const STEP: Nanoseconds = Nanoseconds::from_microseconds(500);

/// Plays a recording, then reads everything back that the master wrote.
///
/// # Errors
/// [`ReplayError`]; a drive that fails the replay is no error, but in the report.
pub fn replay(
    recording: Recording,
    options: &ReplayOptions,
    progress: &mut dyn FnMut(&Progress),
) -> Result<ReplayReport, ReplayError> {
    let addresses = CapturePlayer::addresses(&recording);
    let player = CapturePlayer::new(recording, options.bit_rate)?;
    let setups: Vec<_> = addresses.iter().map(|&address| DriveSetup { address, ..options.drive.clone() }).collect();
    let under_test = addresses.iter().min().copied();
    let configuration = RingConfiguration::new(setups.len(), options.bit_rate);
    let (mut world, handles) = ring_of_drives_on(configuration, player, &setups, |address| {
        if Some(address) == under_test { options.executor.clone() } else { Executor::Host }
    })?;
    let mut phases: Vec<PhaseRecord> = Vec::new();
    let mut steps_at: Vec<u64> = Vec::new();
    let mut told = Nanoseconds::ZERO;
    while !world.ring().master().is_done() {
        let now = world.now();
        let player = world.ring().master();
        if player.stage() == Stage::Playing && phases.last().is_none_or(|last| last.phase != player.phase()) {
            phases.push(PhaseRecord { phase: player.phase(), cycle: player.progress().0, time: now });
            steps_at.push(steps(&player.report().drives));
        }
        if now >= told {
            told = now + PROGRESS_EVERY;
            progress(&progress_of(player, now));
        }
        world.run_until(now + STEP)?;
    }
    let player = world.ring().master();
    let report = player.report();
    steps_at.push(steps(&report.drives));
    let now = world.now();
    let phases = phases
        .iter()
        .enumerate()
        .map(|(index, phase)| PhaseTime {
            phase: phase.phase,
            start_us: phase.time.as_microseconds(),
            end_us: phases.get(index + 1).map_or(now, |next| next.time).as_microseconds(),
            service_steps: steps_at[index + 1] - steps_at[index],
        })
        .collect();
    let cycle_us = report.drives.iter().find_map(|drive| drive.written.get(&Idn::CYCLE)?.first().copied());
    let mut drives: Vec<DriveReplay> = report
        .drives
        .iter()
        .zip(&handles)
        .map(|(drive, handle)| {
            let platform = if Some(drive.address) == under_test { options.executor.platform() } else { Platform::Host };
            drive_replay(drive, handle, platform)
        })
        .collect();
    drives.sort_by_key(|drive| drive.address);
    Ok(ReplayReport {
        platform: options.executor.platform(),
        cycles: report.cycles,
        cycle_us: cycle_us.map_or(CYCLE_BEFORE_CP3_US, u32::from),
        phases,
        passed: !drives.is_empty() && drives.iter().all(|drive| drive.failure.is_none()),
        drives,
    })
}

fn steps(drives: &[DriveReport]) -> u64 {
    drives.iter().map(|drive| drive.steps).sum()
}

fn progress_of(player: &CapturePlayer, now: Nanoseconds) -> Progress {
    let (done, of) = player.progress();
    Progress {
        phase: player.phase(),
        what: match player.stage() {
            Stage::Playing => "play the recording".to_owned(),
            Stage::ReadingBack | Stage::Done => "read the written values back".to_owned(),
        },
        done: done.min(of),
        of,
        time_us: now.as_microseconds(),
    }
}

fn drive_replay(drive: &DriveReport, handle: &DriveHandle, platform: Platform) -> DriveReplay {
    let measurements = handle.measurements.borrow();
    DriveReplay {
        address: drive.address,
        platform,
        phase: drive.highest_phase.unwrap_or(0),
        check_127: acknowledgement(drive, 0, drive.s0127),
        check_128: acknowledgement(drive, 1, drive.s0128),
        service_steps: drive.steps,
        service_errors: drive
            .step_errors
            .iter()
            .map(|error| ServiceError {
                cycle: error.cycle,
                idn: error.idn.map_or_else(|| "none".to_owned(), |idn| idn.to_string()),
                element: element_of(error.code),
                code: error.code,
            })
            .collect(),
        written: drive.written.len() as u64,
        differences: drive
            .mismatches
            .iter()
            .map(|mismatch| ReadBackDifference {
                idn: mismatch.idn.to_string(),
                written: mismatch.written.clone(),
                read: mismatch.read.clone().unwrap_or_default(),
            })
            .collect(),
        service_release: measurements.service.durations(),
        missed: MissedTelegrams { at: drive.missed_ats, ..handle.missed_by_chip() },
        failure: failure(drive),
    }
}

/// Bits 14 to 12 of an error word name the element (sercos2.md 3.5).
fn element_of(code: u16) -> u8 {
    u8::try_from(code >> 12 & 7).unwrap_or(0)
}

fn acknowledgement(drive: &DriveReport, switch: usize, ever: bool) -> Acknowledgement {
    match (drive.acknowledged_before_switch[switch], ever) {
        (Some(true), _) => Acknowledgement::Positive,
        (Some(false), _) => Acknowledgement::Missing,
        (None, true) => Acknowledgement::Positive,
        (None, false) => Acknowledgement::NotAsked,
    }
}

/// The first thing that is wrong, in the order in which it matters.
fn failure(drive: &DriveReport) -> Option<String> {
    if drive.passed() {
        return None;
    }
    let phase = drive.highest_phase;
    Some(if !drive.acknowledged_before_switch[0].unwrap_or(true) {
        "S-0-0127 was not acknowledged before CP3".to_owned()
    } else if !drive.acknowledged_before_switch[1].unwrap_or(true) {
        "S-0-0128 was not acknowledged before CP4".to_owned()
    } else if let Some(error) = drive.step_errors.first() {
        format!("cycle {}: {} answered with {:04X}H, {}", error.cycle, error.step, error.code, error.meaning)
    } else if let Some(step) = drive.fell_behind.first() {
        format!("cycle {}: {} not acknowledged within {} cycles", step.cycle, step.step, step.allowed)
    } else if drive.double_losses > 0 {
        format!("{} times two ATs in a row were missed", drive.double_losses)
    } else if phase != Some(4) {
        phase.map_or_else(|| "never answered".to_owned(), |phase| format!("stayed in CP{phase}"))
    } else if let Some(mismatch) = drive.mismatches.first() {
        format!("{} does not read back: wrote {:04X?}, read {:04X?}", mismatch.idn, mismatch.written, mismatch.read)
    } else {
        format!("{} of {} written values were read back", drive.read_back, drive.written.len())
    })
}
