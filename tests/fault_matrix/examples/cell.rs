//! Runs the cells of the matrix whose name contains a text; `LAWS_TRACE=1` shows what the axis does in them.
//!
//! `cargo run -p fault_matrix --example cell -- "bits 15 and 14 away"`

use bench::Executor;
use fault_matrix::{cells, run};

fn main() -> Result<(), String> {
    let text = std::env::args().nth(1).ok_or("which cell? give a part of its name, such as \"at speed / position\"")?;
    for expected in cells().iter().filter(|expected| expected.cell.to_string().contains(&text)) {
        println!("{}", expected.cell);
        match run(expected.cell, &Executor::Host) {
            Ok(outcome) => {
                println!("{}", expected.contradiction(&outcome).unwrap_or_else(|| "as it has to be".to_owned()))
            }
            Err(error) => println!("{error:?}"),
        }
    }
    Ok(())
}
