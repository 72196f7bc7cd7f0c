//! x
use crate::*;
#[allow(missing_docs)] pub struct Expectation {}
#[allow(missing_docs)] pub struct Expected {}
#[allow(missing_docs)] pub const CELLS: &[Expected] = &[];
