//! The main job: a press ring of three drives, run up by a scripted master, following a line shaft.

use plant::ReferenceAxis;
use ring::ident::{Idn, Value};
use ring::master::{
    Activity, CommandValues, DriveScript, LineShaft, MasterError, MasterReport, MasterScript, Motion, ScriptedMaster,
    Telegram,
};
use ring::wire::BitRate;
use ring::{Nanoseconds, RingConfiguration};

use crate::axis::{commissioned, parameters_of};
use crate::executor::Executor;
use crate::processor::ProcessorError;
use crate::report::{
    DemoReport, FollowingError, MissedTelegrams, MotionSegment, PhaseTime, Platform, Progress, Sample, ServiceError,
    TorqueRipple,
};
use crate::ring_of_drives::{DriveHandle, DriveSetup, ring_of_drives_on};

/// Why the demonstration did not come to its end.
#[derive(Debug, thiserror::Error)]
pub enum DemoError {
    /// The master gave up.
    #[error("the master stopped: {0}")]
    Master(#[from] MasterError),
    /// A drive could not go on.
    #[error(transparent)]
    Processor(#[from] ProcessorError),
    /// Neither an end nor an error.
    #[error("the run did not end within {seconds} s of simulated time; the master is {state}")]
    NoEnd {
        /// The limit.
        seconds: u64,
        /// What the master was doing.
        state: String,
    },
}

/// Addresses of the ring; the second is the drive under test.
const RING: [u8; 3] = [1, 2, 3];
const UNDER_TEST: usize = 1;
/// The press ring of the newspaper press: 2 Mbit/s, 10 ms in all phases (sercos2.md 7).
const CYCLE: Nanoseconds = Nanoseconds::from_millis(10);
/// 600 rpm in 0.0001 degree a second.
const SHAFT: LineShaft = LineShaft {
    velocity: 36_000_000,
    ramp: Nanoseconds::from_millis(1_500),
    constant: Nanoseconds::from_millis(3_000),
};
/// Position increments of a revolution, S-0-0079.
const INCREMENTS: f64 = 3_600_000.0;
/// The shaft has swung in to the new acceleration so long after a ramp's end.
const SETTLING: Nanoseconds = Nanoseconds::from_millis(300);
/// The observer looks at the motor this often: at every second loop tick.
const STEP: Nanoseconds = Nanoseconds::from_microseconds(250);
/// Every so many looks become a point of the plot.
const PLOTTED: usize = 16;
const PROGRESS_EVERY: Nanoseconds = Nanoseconds::from_millis(50);
const LONGEST_RUN_SECONDS: u64 = 60;

/// Runs the demonstration with drives that have been commissioned, see [`commissioned`]; `executor` says where drive 2 runs.
///
/// # Errors
/// [`DemoError`] when the run does not come to its end.
pub fn demo(executor: &Executor, progress: &mut dyn FnMut(&Progress)) -> Result<DemoReport, DemoError> {
    demo_with(executor, &commissioned(&ReferenceAxis::press()), progress)
}

/// The same with drives that have the data of their machine and the gains from them, and these parameters besides, written in CP2.
///
/// # Errors
/// [`DemoError`] when the run does not come to its end.
pub fn demo_with(
    executor: &Executor,
    parameters: &[(Idn, Value)],
    progress: &mut dyn FnMut(&Progress),
) -> Result<DemoReport, DemoError> {
    let on = |address| if address == RING[UNDER_TEST] { executor.clone() } else { Executor::Host };
    run(&on, parameters, progress)
}

/// The same; `executor` says where the drive of each address runs. The report is about drive 2.
///
/// # Errors
/// [`DemoError`] when the run does not come to its end.
pub fn demo_on(
    executor: &dyn Fn(u8) -> Executor,
    progress: &mut dyn FnMut(&Progress),
) -> Result<DemoReport, DemoError> {
    run(executor, &commissioned(&ReferenceAxis::press()), progress)
}

fn run(
    executor: &dyn Fn(u8) -> Executor,
    parameters: &[(Idn, Value)],
    progress: &mut dyn FnMut(&Progress),
) -> Result<DemoReport, DemoError> {
    let axis = ReferenceAxis::press();
    let setups = RING.map(|address| DriveSetup { axis, ..DriveSetup::new(address) });
    let master = ScriptedMaster::new(script(&axis, parameters));
    let configuration = RingConfiguration::new(RING.len(), BitRate::M2);
    let (mut world, handles) = ring_of_drives_on(configuration, master, &setups, executor)?;
    let mut told = Nanoseconds::ZERO;
    let mut looks = Vec::new();
    let mut steps: Vec<(u8, u64)> = Vec::new();
    while !world.ring().master().is_done() {
        let now = world.now();
        let master = world.ring().master();
        if now.as_seconds() > LONGEST_RUN_SECONDS as f64 {
            let state = master.state().to_string();
            return Err(DemoError::NoEnd { seconds: LONGEST_RUN_SECONDS, state });
        }
        if steps.last().is_none_or(|(phase, _)| *phase != master.phase()) {
            steps.push((master.phase(), total_steps(master.report())));
        }
        if now >= told {
            told = now + PROGRESS_EVERY;
            progress(&progress_of(master, now));
        }
        if master.phase() == 4 {
            looks.push(Look::at(&handles[UNDER_TEST], now));
        }
        world.run_until(now + STEP)?;
    }
    let master = world.ring().master().report().clone();
    if let Some(error) = master.error {
        return Err(error.into());
    }
    steps.push((4, total_steps(&master)));
    Ok(report(executor(RING[UNDER_TEST]).platform(), &master, &handles, &looks, &steps, world.now()))
}

fn script(axis: &ReferenceAxis, parameters: &[(Idn, Value)]) -> MasterScript {
    let word = |value: u16| Value::Word(value);
    let drives = RING.map(|address| {
        let telegram =
            Telegram::application(&[Idn(51), Idn(40), Idn::FOLLOWING_DISTANCE, Idn(0x8013)], &[Idn::POSITION_COMMAND]);
        DriveScript::new(address, telegram)
            .with(Idn::OPERATION_MODE, word(11))
            .with_all(parameters_of(axis))
            .with_all(parameters.iter().cloned())
            .with(Idn(0x8013), word(u16::from(address)))
    });
    let cycles = SHAFT.duration().0 / CYCLE.0 + SETTLING.0 / CYCLE.0;
    let motion = Motion::new(cycles, |point| {
        let turned = SHAFT.position(point.time);
        CommandValues::at_position(point.start.wrapping_add(turned as i32))
    });
    MasterScript {
        start_up_cycle: CYCLE,
        cycle: u16::try_from(CYCLE.as_microseconds()).unwrap_or(u16::MAX),
        motion: Some(motion),
        ..MasterScript::new(drives.to_vec())
    }
}

fn total_steps(report: &MasterReport) -> u64 {
    report.drives.iter().map(|drive| drive.steps() as u64).sum()
}

fn progress_of(master: &ScriptedMaster, now: Nanoseconds) -> Progress {
    let state = master.state();
    let (done, of) = match state.activity {
        Activity::ClosingRing { good } => (u64::from(good), 10),
        Activity::Moving { done, of } => (done, of),
        _ => (state.cycle, 0),
    };
    Progress { phase: state.phase, what: state.activity.to_string(), done, of, time_us: now.as_microseconds() }
}

/// One look at the motor.
struct Look {
    time: Nanoseconds,
    /// True position of the shaft in degrees.
    degrees: f64,
    rpm: f64,
    current: f64,
    /// Of the motor, as a share of what the peak current makes.
    torque: f64,
}

impl Look {
    fn at(handle: &DriveHandle, time: Nanoseconds) -> Self {
        let mut side = handle.motor_side.borrow_mut();
        let current = side.current();
        let motor = side.machine();
        let peak = ReferenceAxis::press().motor.peak_torque;
        Self {
            time,
            degrees: motor.angle(time.0) * 360.0,
            rpm: motor.velocity(time.0) * 60.0 / core::f64::consts::TAU,
            current,
            torque: motor.torque(time.0) / peak,
        }
    }
}

/// Where the drive under test shall be: on the line shaft, of which the commands are points, one cycle later.
struct CommandCurve {
    /// The first command of the profile is reached.
    begins: Nanoseconds,
    /// That command, in position increments.
    start: f64,
}

impl CommandCurve {
    fn of(master: &MasterReport, moving: Nanoseconds) -> Self {
        let mut samples = master.samples.iter().filter(|sample| sample.drive == UNDER_TEST);
        let first = samples.find(|sample| sample.profile_cycle == Some(0));
        Self { begins: moving + CYCLE, start: first.map_or(0.0, |sample| f64::from(sample.position_command)) }
    }

    /// In degrees.
    fn at(&self, time: Nanoseconds) -> f64 {
        let turned = SHAFT.position(time.saturating_sub(self.begins));
        (self.start + turned as f64) / INCREMENTS * 360.0
    }
}

fn report(
    platform: Platform,
    master: &MasterReport,
    handles: &[DriveHandle],
    looks: &[Look],
    steps: &[(u8, u64)],
    end: Nanoseconds,
) -> DemoReport {
    let t3 =
        master.slots.as_ref().map_or(Nanoseconds::ZERO, |slots| Nanoseconds::from_microseconds(u64::from(slots.t3)));
    let moving = moving_time(master, t3);
    let curve = CommandCurve::of(master, moving);
    let segments = segments(moving);
    let samples: Vec<Sample> = looks
        .iter()
        .filter(|look| look.time >= moving && look.time <= moving + SHAFT.duration() + SETTLING)
        .map(|look| {
            let command = curve.at(look.time);
            Sample {
                time_us: look.time.as_microseconds(),
                command_degrees: command,
                feedback_degrees: look.degrees,
                error_degrees: command - look.degrees,
                velocity_rpm: look.rpm,
                current_fraction: look.current,
            }
        })
        .collect();
    let steady = segments.iter().find(|segment| segment.constant_speed);
    let steady: Vec<f64> = samples
        .iter()
        .filter(|sample| {
            steady.is_some_and(|segment| sample.time_us >= segment.start_us && sample.time_us < segment.end_us)
        })
        .map(|sample| sample.error_degrees)
        .collect();
    let all: Vec<f64> = samples.iter().map(|sample| sample.error_degrees).collect();
    let (constant_speed_max_degrees, constant_speed_rms_degrees) = max_and_rms(&steady);
    let (overall_max_degrees, overall_rms_degrees) = max_and_rms(&all);
    let under_test = &handles[UNDER_TEST];
    let measured = under_test.measurements.borrow();
    let record = &master.drives[UNDER_TEST];
    DemoReport {
        platform,
        address: RING[UNDER_TEST],
        ring: RING.to_vec(),
        megabits_per_second: 2,
        cycle_us: u32::try_from(CYCLE.as_microseconds()).unwrap_or(u32::MAX),
        end_us: end.as_microseconds(),
        phases_reached: vec![master.phases.last().map_or(0, |phase| phase.phase); RING.len()],
        phases: phase_times(master, steps, end),
        service_errors: service_errors(master),
        service_release: measured.service.durations().unwrap_or_default(),
        missed: MissedTelegrams {
            at: record.missed_ats,
            first_at: record.missed_first_at,
            ..under_test.missed_by_chip()
        },
        interrupt_to_at: measured.interrupt_to_at.durations().unwrap_or_default(),
        interrupt_to_command: measured.interrupt_to_command.durations().unwrap_or_default(),
        following: FollowingError {
            constant_speed_max_degrees,
            constant_speed_rms_degrees,
            overall_max_degrees,
            overall_rms_degrees,
        },
        torque_ripple: torque_ripple(looks, &segments),
        segments,
        samples: samples.into_iter().step_by(PLOTTED).collect(),
        trace: measured.trace.map(|trace| trace.to_string()),
        log: measured.log.clone(),
    }
}

/// When the first command of the profile becomes valid.
fn moving_time(master: &MasterReport, t3: Nanoseconds) -> Nanoseconds {
    let first = master.samples.iter().find(|sample| sample.profile_cycle == Some(0));
    first.map_or(Nanoseconds::ZERO, |sample| sample.time + t3)
}

/// The parts of the motion as the drive follows it: one cycle behind the master.
fn segments(moving: Nanoseconds) -> Vec<MotionSegment> {
    let begin = moving + CYCLE;
    let parts = [
        ("accelerate", SHAFT.ramp, false),
        ("swing in", SETTLING, false),
        ("constant speed", Nanoseconds(SHAFT.constant.0 - SETTLING.0), true),
        ("decelerate", SHAFT.ramp, false),
        ("stand", SETTLING, false),
    ];
    let mut start = begin;
    parts
        .into_iter()
        .map(|(name, duration, constant_speed)| {
            let segment = MotionSegment {
                name: name.to_owned(),
                start_us: start.as_microseconds(),
                end_us: (start + duration).as_microseconds(),
                constant_speed,
            };
            start += duration;
            segment
        })
        .collect()
}

/// What leaves a straight line in the torque, settled, on the way up and at constant speed.
fn torque_ripple(looks: &[Look], segments: &[MotionSegment]) -> TorqueRipple {
    let settled = SETTLING.as_microseconds();
    let off_the_line = |index: usize, settling: u64| {
        let segment = &segments[index];
        let within = |look: &&Look| {
            let time = look.time.as_microseconds();
            (segment.start_us + settling..segment.end_us).contains(&time)
        };
        off_the_line(&looks.iter().filter(within).map(|look| look.torque * 100.0).collect::<Vec<_>>())
    };
    let (accelerating_peak_to_peak_percent, accelerating_rms_percent) = off_the_line(0, settled);
    let (_, constant_speed_rms_percent) = off_the_line(2, 0);
    TorqueRipple { accelerating_rms_percent, accelerating_peak_to_peak_percent, constant_speed_rms_percent }
}

/// Peak to peak and root of the mean square of what leaves the straight line through the values.
fn off_the_line(values: &[f64]) -> (f64, f64) {
    let middle = (values.len() as f64 - 1.0) / 2.0;
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    let places = || values.iter().enumerate().map(|(index, value)| (index as f64 - middle, value));
    let slope = places().map(|(place, value)| place * value).sum::<f64>()
        / places().map(|(place, _)| place * place).sum::<f64>();
    let left: Vec<f64> = places().map(|(place, value)| value - mean - slope * place).collect();
    let (highest, lowest) =
        left.iter().fold((f64::MIN, f64::MAX), |(high, low), left| (high.max(*left), low.min(*left)));
    (highest - lowest, max_and_rms(&left).1)
}

fn max_and_rms(errors: &[f64]) -> (f64, f64) {
    let largest = errors.iter().fold(0.0_f64, |largest, error| largest.max(error.abs()));
    let squares: f64 = errors.iter().map(|error| error * error).sum();
    let mean = if errors.is_empty() { 0.0 } else { squares / errors.len() as f64 };
    (largest, mean.sqrt())
}

fn phase_times(master: &MasterReport, steps: &[(u8, u64)], end: Nanoseconds) -> Vec<PhaseTime> {
    let next_of = |index: usize| master.phases.get(index + 1).map_or(end, |next| next.time);
    let steps_in = |phase: u8| {
        let place = steps.iter().position(|(of, _)| *of == phase);
        place.and_then(|place| Some(steps.get(place + 1)?.1 - steps[place].1)).unwrap_or(0)
    };
    let times = master.phases.iter().enumerate().map(|(index, phase)| PhaseTime {
        phase: phase.phase,
        start_us: phase.time.as_microseconds(),
        end_us: next_of(index).as_microseconds(),
        service_steps: steps_in(phase.phase),
    });
    times.collect()
}

fn service_errors(master: &MasterReport) -> Vec<ServiceError> {
    let services = master.drives.iter().flat_map(|drive| &drive.services);
    services
        .flat_map(|service| service.steps.iter().map(move |step| (service, step)))
        .filter(|(_, step)| step.error)
        .map(|(service, step)| ServiceError {
            cycle: 0,
            idn: service.request.idn().to_string(),
            element: step.step.element as u8,
            code: step.reply,
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_leaves_a_straight_line_is_neither_its_height_nor_its_slope() {
        let sine = |index: u32| (f64::from(index) * core::f64::consts::TAU / 40.0).sin();
        let values: Vec<f64> = (0..4_000).map(|index| 7.0 - 0.01 * f64::from(index) + 3.0 * sine(index)).collect();
        let (peak_to_peak, rms) = off_the_line(&values);
        assert!((5.9..6.1).contains(&peak_to_peak), "{peak_to_peak}");
        assert!((2.1..2.14).contains(&rms), "{rms}");
    }
}
