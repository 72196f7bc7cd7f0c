//! The protocol, step by step.
//!
//! One program, because each would be linked with everything for itself.

mod garbage;
mod recording;
mod run_up;
#[path = "../examples/sample/mod.rs"]
mod sample;
mod service_channel;
mod support;
mod weighting;

use sample::DICTIONARY;
