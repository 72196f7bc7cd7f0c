//! The laws, one file each.

mod back;
mod border;
mod contradictions;
mod directions;
mod distance;
mod feedback;
mod findings;
mod following;
mod limits;
mod marker;
mod nothing_moves;
mod probes;
mod service;
mod sizes;
mod stop;
mod switching_on;
mod torque_goes;
mod true_errors;
mod truth;
mod vertical;

#[cfg(test)]
mod fake;

use crate::law::Law;

/// All of them.
pub(crate) fn all() -> Vec<Box<dyn Law>> {
    vec![
        Box::new(stop::Stop::default()),
        Box::new(switching_on::SwitchingOn::default()),
        Box::new(truth::Truth::default()),
        Box::new(torque_goes::TorqueGoes::default()),
        Box::new(true_errors::TrueErrors::default()),
        Box::new(vertical::Vertical::default()),
        Box::new(back::Back::default()),
        Box::new(nothing_moves::NothingMoves::default()),
        Box::new(following::Following::default()),
        Box::new(limits::Current::default()),
        Box::new(limits::Velocity::default()),
        Box::new(limits::PositionLimits::default()),
        Box::new(feedback::Feedback::default()),
        Box::new(distance::Distance::default()),
        Box::new(marker::Marker::default()),
        Box::new(service::AtAndService::default()),
        Box::new(service::Acknowledged::default()),
        Box::new(service::Protected::default()),
        Box::new(sizes::Sizes),
        Box::new(findings::Findings::default()),
        Box::new(contradictions::Contradictions::default()),
        Box::new(directions::Directions::default()),
        Box::new(probes::Probes::default()),
        Box::new(border::Border::default()),
    ]
}
