//! The laws, one file each.

mod distance;
mod feedback;
mod service;
mod stop;
mod switching_on;
mod torque_goes;
mod truth;

#[cfg(test)]
mod fake;

use crate::law::Law;

/// All of them.
pub(crate) fn all() -> Vec<Box<dyn Law>> {
    vec![
        Box::new(stop::Stop::default()),
        Box::new(switching_on::SwitchingOn),
        Box::new(truth::Truth),
        Box::new(torque_goes::TorqueGoes::default()),
        Box::new(feedback::Feedback::default()),
        Box::new(distance::Distance::default()),
        Box::new(service::AtAndService::default()),
        Box::new(service::Acknowledged::default()),
        Box::new(service::Protected::default()),
    ]
}
