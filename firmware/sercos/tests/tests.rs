//! The protocol, step by step.
//!
//! One program, because each would be linked with everything for itself.

mod garbage;
mod recording;
#[path = "../../../tests/recordings/find.rs"]
mod recordings;
mod run_up;
#[path = "../examples/sample/mod.rs"]
mod sample;
mod service_channel;
mod support;
mod weighting;

use sample::DICTIONARY;
