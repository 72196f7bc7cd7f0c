//! What the works may have written.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| garbage::production_record(bytes));
