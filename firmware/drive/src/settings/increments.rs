//! What the increments of each scaling are, for those who convert from one to another.

use sercos::parameters::Parameters;
use sercos::unit::Dimension;

use super::scaling::{DerivativeScale, Ratio, increments_of_a_revolution, rpm_of_an_increment};
use super::torque::milliamperes;

/// How many increments of a dimension are a revolution, a revolution a minute, 10^-3 rad/s² or rad/s³, or 1 mA of the motor; `None` where the
/// scaling means nothing.
pub(crate) fn increments(dimension: Dimension, parameters: &Parameters) -> Option<Ratio> {
    match dimension {
        Dimension::Position => increments_of_a_revolution(parameters).ok().map(|(increments, _)| increments),
        Dimension::Velocity => rpm_of_an_increment(parameters).ok().map(Ratio::inverse),
        Dimension::Acceleration | Dimension::Jerk => {
            DerivativeScale::new(parameters).ok().map(|scale| scale.milliradians.inverse())
        }
        Dimension::Torque => milliamperes(parameters).ok()?.0.map(Ratio::inverse),
    }
}
