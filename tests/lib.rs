//! Integration tests of the whole drive: chip model, ring, drive and plant together.
//!
//! The tests are the `*.rs` files of this folder, each behaviour a function whose name is a sentence.
