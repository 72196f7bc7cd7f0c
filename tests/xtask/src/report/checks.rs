//! What a demonstration must reach to be called good.

use super::data::{Acknowledgement, DemoReport, DriveReplay};
use super::numbers;

/// Largest following error allowed, in degrees.
pub(crate) const FOLLOWING_ERROR_LIMIT_DEGREES: f64 = 0.02;

/// Torque ripple allowed on the ramp and at constant speed, rms in % of the peak torque.
const RIPPLE_LIMITS_PERCENT: [f64; 2] = [1.0, 0.2];

/// One expectation and what came of it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Check {
    /// What was expected.
    pub(crate) what: &'static str,
    /// What was found.
    pub(crate) found: String,
    /// Whether it is as expected.
    pub(crate) passed: bool,
}

/// All checks of a demonstration.
pub(crate) fn of_demo(report: &DemoReport) -> Vec<Check> {
    let in_operation = report.phases_reached.iter().filter(|phase| **phase == 4).count();
    let missed = report.missed;
    let error = report.following.overall_max_degrees;
    let ripple = [report.torque_ripple.accelerating_rms_percent, report.torque_ripple.constant_speed_rms_percent];
    vec![
        Check {
            what: "every drive of the ring in CP4",
            found: format!("{in_operation} of {}", report.ring.len()),
            passed: in_operation == report.ring.len() && !report.ring.is_empty(),
        },
        Check {
            what: "no service-channel step ended in an error",
            found: numbers::counted(report.service_errors.len() as u64, "error"),
            passed: report.service_errors.is_empty(),
        },
        Check {
            what: "no telegram missed",
            found: format!("{} MST, {} MDT, {} AT", missed.mst, missed.mdt, missed.at),
            passed: missed.mst == 0 && missed.mdt == 0 && missed.at == 0,
        },
        Check {
            what: "following error of the whole motion below 0.02°",
            found: numbers::degrees(error),
            // A motion without a stretch of constant speed proves nothing; NaN fails the comparison.
            passed: error < FOLLOWING_ERROR_LIMIT_DEGREES
                && report.segments.iter().any(|segment| segment.constant_speed && segment.end_us > segment.start_us),
        },
        Check {
            what: "torque ripple below 1 % rms on the ramp and 0.2 % at constant speed",
            found: ripple.map(|percent| format!("{percent:.2} %")).join(" and "),
            passed: ripple.iter().zip(RIPPLE_LIMITS_PERCENT).all(|(ripple, limit)| *ripple < limit),
        },
    ]
}

/// Why this drive did not pass the replay, or `None` if it did.
///
/// The bench gives its own reason; this is the same judgement from the numbers alone, so that a report cannot pass by
/// leaving its reason out.
pub(crate) fn failure_of_drive(drive: &DriveReplay) -> Option<String> {
    if let Some(failure) = &drive.failure {
        return Some(failure.clone());
    }
    let refused = |check: Acknowledgement| check != Acknowledgement::Positive;
    if drive.phase != 4 {
        Some(format!("ended in CP{}", drive.phase))
    } else if refused(drive.check_127) {
        Some("S-0-0127 was not acknowledged positively before CP3".to_owned())
    } else if refused(drive.check_128) {
        Some("S-0-0128 was not acknowledged positively before CP4".to_owned())
    } else if let Some(error) = drive.service_errors.first() {
        Some(format!(
            "the service channel answered {} element {} with error {:04X}H in cycle {}",
            error.idn, error.element, error.code, error.cycle
        ))
    } else {
        drive.differences.first().map(|difference| {
            format!(
                "{} reads back as {:04X?} after {:04X?} was written",
                difference.idn, difference.read, difference.written
            )
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::data::{MissedTelegrams, ReadBackDifference, ServiceError};
    use crate::report::examples;

    fn failed(report: &DemoReport) -> Vec<&'static str> {
        of_demo(report).into_iter().filter(|check| !check.passed).map(|check| check.what).collect()
    }

    #[test]
    fn a_good_run_passes_every_check() {
        assert_eq!(failed(&examples::demo()), Vec::<&str>::new());
    }

    #[test]
    fn each_check_fails_for_its_own_reason_only() {
        let mut report = examples::demo();
        report.phases_reached[1] = 3;
        assert_eq!(failed(&report), ["every drive of the ring in CP4"]);

        let mut report = examples::demo();
        report.service_errors.push(ServiceError { cycle: 5, idn: "S-0-0127".into(), element: 7, code: 0x7004 });
        assert_eq!(failed(&report), ["no service-channel step ended in an error"]);

        let mut report = examples::demo();
        report.missed = MissedTelegrams { at: 1, ..MissedTelegrams::default() };
        assert_eq!(failed(&report), ["no telegram missed"]);

        for error in [FOLLOWING_ERROR_LIMIT_DEGREES, f64::NAN] {
            let mut report = examples::demo();
            report.following.overall_max_degrees = error;
            assert_eq!(failed(&report), ["following error of the whole motion below 0.02°"]);
        }

        let mut report = examples::demo();
        report.segments.clear();
        assert_eq!(failed(&report), ["following error of the whole motion below 0.02°"]);

        for (ramp, constant) in [(1.0, 0.1), (0.1, 0.2), (f64::NAN, 0.1), (0.1, f64::NAN)] {
            let mut report = examples::demo();
            report.torque_ripple.accelerating_rms_percent = ramp;
            report.torque_ripple.constant_speed_rms_percent = constant;
            assert_eq!(failed(&report), ["torque ripple below 1 % rms on the ramp and 0.2 % at constant speed"]);
        }
    }

    #[test]
    fn a_replayed_drive_is_judged_by_its_numbers() {
        assert_eq!(failure_of_drive(&examples::drive(1)), None);

        let mut drive = examples::drive(1);
        drive.phase = 2;
        assert_eq!(failure_of_drive(&drive).unwrap(), "ended in CP2");

        let mut drive = examples::drive(1);
        drive.check_128 = Acknowledgement::NotAsked;
        assert!(failure_of_drive(&drive).unwrap().starts_with("S-0-0128"));

        let mut drive = examples::drive(1);
        drive.differences.push(ReadBackDifference { idn: "S-0-0006".into(), written: vec![92], read: vec![0] });
        assert_eq!(failure_of_drive(&drive).unwrap(), "S-0-0006 reads back as [0000] after [005C] was written");

        let mut drive = examples::drive(1);
        drive.failure = Some("said by the bench".into());
        assert_eq!(failure_of_drive(&drive).unwrap(), "said by the bench");
    }
}
