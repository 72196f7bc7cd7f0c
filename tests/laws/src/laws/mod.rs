//! The laws, one file each.

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
    ]
}
