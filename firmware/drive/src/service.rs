//! The service channel's side of the drive: every data block's operation data, the procedure commands, and the transition checks.

pub(crate) mod access;
pub(crate) mod checks;
pub(crate) mod commissioning;
pub(crate) mod context;
pub(crate) mod finding;
pub(crate) mod hand_over;
mod lists;
mod live;
pub(crate) mod loops;
mod procedures;
pub(crate) mod rescaling;
pub mod scope;
mod texts;
mod values;
mod writes;

#[cfg(test)]
mod effects;
#[cfg(test)]
pub(crate) mod rig;
#[cfg(test)]
mod tests;
