//! Steps, phases, commands and lost telegrams, then a run-up.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| garbage::service_channel(bytes));
