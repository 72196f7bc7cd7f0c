//! Every encoding against words from an assembler.

use crate::thumb::{Access, Direction, Transfer, Width, advance_it, decode};

#[test]
fn placeholder_for_compilation() {
    assert_eq!(advance_it(0), 0);
    let _: Option<Access> = decode(0, 0, &[0; 16]);
    let _ = (Direction::Load, Transfer::Single(0), Width::Byte);
}
