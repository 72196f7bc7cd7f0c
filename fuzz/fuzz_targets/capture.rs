//! Recordings, line levels, telegrams, and a chip that receives them.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| garbage::capture(bytes));
