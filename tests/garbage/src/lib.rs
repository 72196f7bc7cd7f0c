//! What bytes from outside may do to the drive, and what they may not.
//!
//! Each function takes any bytes, makes of them what a master, a fibre or a file might bring, and panics if the drive's
//! code does what it must not. The fuzz targets in `fuzz/` call them with bytes that libFuzzer finds by coverage; the
//! tests here call them with random bytes and with the seeds, so that they hold in every ordinary test run, too.
//!
//! * `service_channel`: steps, phases, commands and lost telegrams, then a run-up.
//! * `configuration`: values of parameters, then both transition checks and a run-up.
//! * `production_record`: what the works may have written, and whatever ratings of an amplifier.
//! * `capture`: recordings, line levels, telegrams, and a chip that receives them.
#![forbid(unsafe_code)]

mod bytes;
mod capture;
mod configuration;
mod production_record;
mod run_up;
mod service_channel;
#[path = "../../../firmware/sercos/tests/support/mod.rs"]
mod support;

use drive::DICTIONARY;

pub use capture::capture;
pub use configuration::configuration;
pub use production_record::production_record;
pub use service_channel::service_channel;
