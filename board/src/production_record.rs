//! The sector of flash in which the works have written what this unit is (RM0090 3.6): sector 9, which no program of ours erases or writes.
//!
//! `cargo xtask identity` writes it over the debug port. A new program leaves it as it is.

use drive::production::RECORD_BYTES;

/// The bytes of the record, as `drive` parses them; all ones where nothing was written.
#[must_use]
pub fn bytes() -> &'static [u8; RECORD_BYTES] {
    unsafe extern "C" {
        static _production_record_start: [u8; RECORD_BYTES];
    }
    // SAFETY: the linker puts it at the beginning of a sector of 128 KiB (memory.x), where there is flash and nothing else; nobody changes it while the
    // program runs: the controller's only owner, `parameter_flash`, writes the two sectors behind it.
    unsafe { &_production_record_start }
}
