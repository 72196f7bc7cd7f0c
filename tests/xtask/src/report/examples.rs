//! Reports with believable numbers, for the tests of what is made of them.

use super::data::{
    Acknowledgement, DemoReport, DriveReplay, Durations, FollowingError, MissedTelegrams, MotionSegment, PhaseTime,
    Platform, ReplayReport, Sample, TorqueRipple,
};

/// A demonstration as it should be: three drives, five seconds of motion.
pub(crate) fn demo() -> DemoReport {
    let phase = |phase, start_us, end_us, service_steps| PhaseTime { phase, start_us, end_us, service_steps };
    let segment = |name: &str, start_us, end_us, constant_speed| MotionSegment {
        name: name.to_owned(),
        start_us,
        end_us,
        constant_speed,
    };
    let samples: Vec<Sample> = (0..2_500_u64).map(|index| sample(4_400_000 + index * 2_000)).collect();
    let magnitude = |sample: &&Sample| sample.error_degrees.abs();
    let constant: Vec<&Sample> =
        samples.iter().filter(|sample| (5_500_000..8_300_000).contains(&sample.time_us)).collect();
    let max = |samples: &[&Sample]| samples.iter().map(magnitude).fold(0.0, f64::max);
    let rms = |samples: &[&Sample]| {
        (samples.iter().map(|sample| sample.error_degrees.powi(2)).sum::<f64>() / samples.len() as f64).sqrt()
    };
    let all: Vec<&Sample> = samples.iter().collect();
    DemoReport {
        platform: Platform::Qemu,
        address: 2,
        ring: vec![1, 2, 3],
        megabits_per_second: 2,
        cycle_us: 10_000,
        end_us: 9_400_000,
        phases_reached: vec![4, 4, 4],
        phases: vec![
            phase(0, 0, 300_000, 0),
            phase(1, 300_000, 420_000, 0),
            phase(2, 420_000, 2_900_000, 1_862),
            phase(3, 2_900_000, 4_200_000, 84),
            phase(4, 4_200_000, 9_400_000, 0),
        ],
        service_errors: Vec::new(),
        service_release: Durations { count: 246, shortest_ns: 11_200, mean_ns: 14_900, longest_ns: 41_300 },
        missed: MissedTelegrams::default(),
        trace: None,
        interrupt_to_at: Durations { count: 1_040, shortest_ns: 2_810, mean_ns: 2_955, longest_ns: 3_420 },
        interrupt_to_command: Durations { count: 1_040, shortest_ns: 1_900, mean_ns: 2_020, longest_ns: 2_700 },
        following: FollowingError {
            constant_speed_max_degrees: max(&constant),
            constant_speed_rms_degrees: rms(&constant),
            overall_max_degrees: max(&all),
            overall_rms_degrees: rms(&all),
        },
        torque_ripple: TorqueRipple {
            accelerating_rms_percent: 0.15,
            accelerating_peak_to_peak_percent: 1.6,
            constant_speed_rms_percent: 0.12,
        },
        segments: vec![
            segment("standstill", 4_400_000, 4_700_000, false),
            segment("accelerate", 4_700_000, 5_400_000, false),
            segment("constant speed", 5_400_000, 8_400_000, true),
            segment("decelerate", 8_400_000, 9_100_000, false),
            segment("stop", 9_100_000, 9_400_000, false),
        ],
        samples,
        log: vec![
            "INFO  SERCON816 version 0010H, address 2".to_owned(),
            "INFO  timer discovery: t3 on 1CH, t4 on 1DH".to_owned(),
            "INFO  CP2 -> CP3 <accepted>".to_owned(),
        ],
    }
}

/// A trapezoid of velocity with a small, shaped error.
fn sample(time_us: u64) -> Sample {
    let time = time_us as f64 * 1e-6;
    let ramp = ((time - 4.7) / 0.7).clamp(0.0, 1.0) - ((time - 8.4) / 0.7).clamp(0.0, 1.0);
    let (up, down) = ((time - 4.7).clamp(0.0, 0.7), (time - 8.4).clamp(0.0, 0.7));
    let turns = 720.0 * (up * up / 1.4 + (time - 5.4).clamp(0.0, 3.0) + down - down * down / 1.4);
    let accelerating =
        f64::from(u8::from((4.7..5.4).contains(&time))) - f64::from(u8::from((8.4..9.1).contains(&time)));
    let ripple = 0.006 * (time * 40.0).sin() * ramp;
    let error = 0.008 * accelerating * (1.0 - (-(time - 4.7).max(0.0) * 12.0).exp()) + ripple;
    Sample {
        time_us,
        command_degrees: turns,
        feedback_degrees: turns - error,
        error_degrees: error,
        velocity_rpm: 120.0 * ramp + 0.2 * (time * 40.0).cos() * ramp,
        current_fraction: 0.35 * accelerating + 0.06 * ramp + 0.01 * (time * 40.0).sin() * ramp,
    }
}

/// A drive that passed a replay.
pub(crate) fn drive(address: u8) -> DriveReplay {
    DriveReplay {
        address,
        platform: Platform::Host,
        phase: 4,
        check_127: Acknowledgement::Positive,
        check_128: Acknowledgement::Positive,
        service_steps: 1_234,
        service_errors: Vec::new(),
        written: 12,
        differences: Vec::new(),
        service_release: None,
        missed: MissedTelegrams::default(),
        failure: None,
    }
}

/// A replay that four drives passed.
pub(crate) fn replay() -> ReplayReport {
    ReplayReport {
        platform: Platform::Host,
        cycles: 9_000,
        cycle_us: 2_000,
        phases: vec![PhaseTime { phase: 0, start_us: 0, end_us: 172_000, service_steps: 0 }],
        drives: (1..=4).map(drive).collect(),
        passed: true,
    }
}
