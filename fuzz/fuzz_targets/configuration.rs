//! Values of parameters, then both transition checks and a run-up.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| garbage::configuration(bytes));
