//! A law that was broken.

use ring::Nanoseconds;
use thiserror::Error;

/// Which law, by which drive, when, and what was seen.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("drive {address} at {time} broke the law that {law}: {detail}")]
pub struct Broken {
    /// The law, a sentence.
    pub law: &'static str,
    /// Address of the drive.
    pub address: u8,
    /// When it was seen.
    pub time: Nanoseconds,
    /// What was expected and what was seen.
    pub detail: String,
}
