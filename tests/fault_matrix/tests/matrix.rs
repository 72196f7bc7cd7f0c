//! Every cell of the matrix, against what the drive has to do.

use fault_matrix::{Cell, cells, run_all};

#[test]
fn the_drive_does_what_the_matrix_asks_in_every_state_and_mode() {
    let expected = cells();
    let places: Vec<Cell> = expected.iter().map(|expected| expected.cell).collect();
    let outcomes = run_all(&places).unwrap();
    let wrong: Vec<String> =
        expected.iter().zip(&outcomes).filter_map(|(expected, outcome)| expected.contradiction(outcome)).collect();
    assert!(wrong.is_empty(), "{} of {}:\n{}", wrong.len(), places.len(), wrong.join("\n"));
}
