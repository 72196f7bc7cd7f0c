//! Every cell of the matrix, against what the drive has to do and what the page says of it.

use bench::{Elves, Executor};
use fault_matrix::{Cell, Fault, Mode, State, cells, difference, markdown, run_all};

const PAGE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/fault-matrix.md");

#[test]
fn the_drive_does_what_the_matrix_asks_in_every_state_and_mode_and_the_page_in_the_repository_says_it() {
    let expected = cells();
    let places: Vec<Cell> = expected.iter().map(|expected| expected.cell).collect();
    let outcomes = run_all(&places, &Executor::Host).unwrap();
    let wrong: Vec<String> =
        expected.iter().zip(&outcomes).filter_map(|(expected, outcome)| expected.contradiction(outcome)).collect();
    assert!(wrong.is_empty(), "{} of {}:\n{}", wrong.len(), places.len(), wrong.join("\n"));
    let page = markdown(&expected.iter().zip(outcomes).collect::<Vec<_>>());
    let present = std::fs::read_to_string(PAGE).unwrap();
    assert!(present == page, "docs/fault-matrix.md is not what the drive does; run `cargo xtask faults` and commit it");
}

/// One cell of each kind of hardware that a fault takes part in; `cargo xtask faults --on qemu` runs all.
const SAMPLE: [(Fault, State, Mode); 12] = [
    (Fault::Overcurrent, State::AtSpeed, Mode::Velocity),
    (Fault::ConvertersStuck, State::SwitchingOn, Mode::Velocity),
    (Fault::Overvoltage, State::AtSpeed, Mode::Torque),
    (Fault::MainPowerLost, State::AtSpeed, Mode::Velocity),
    (Fault::GateDriver, State::Halted, Mode::Position),
    (Fault::EncoderFrozen, State::AtSpeed, Mode::Velocity),
    (Fault::MotorHot, State::AtSpeed, Mode::Velocity),
    (Fault::HeatSinkHot, State::AtSpeed, Mode::Velocity),
    (Fault::TemperatureSensorBroken, State::AtSpeed, Mode::Velocity),
    (Fault::SafeTorqueOff, State::AtSpeed, Mode::Velocity),
    (Fault::LateCycles, State::AtSpeed, Mode::Velocity),
    (Fault::BrakeStuckOpen, State::Stopping, Mode::PositionWithoutLag),
];

#[test]
#[ignore = "needs QEMU and the ELF: cargo xtask test"]
fn the_flashed_elf_does_about_a_fault_of_every_kind_of_hardware_what_the_portable_drive_does() {
    let path =
        |name: &str| std::env::var_os(name).unwrap_or_else(|| panic!("{name} is not set: run `cargo xtask test`"));
    let elf = Executor::Qemu(Elves::new(path("PRODUCT_ELF"), path("BUS_PLUGIN")));
    let known: Vec<Cell> = cells().iter().map(|expected| expected.cell).collect();
    let sample: Vec<Cell> = SAMPLE.into_iter().map(|(fault, state, mode)| Cell { fault, state, mode }).collect();
    for cell in &sample {
        assert!(known.contains(cell), "{cell} is no cell of the matrix");
    }
    let (on_host, on_elf) = (run_all(&sample, &Executor::Host).unwrap(), run_all(&sample, &elf).unwrap());
    let compared = sample.iter().zip(on_host.iter().zip(&on_elf));
    let different: Vec<String> = compared
        .filter_map(|(cell, (host, elf))| Some(format!("{cell}: {}", difference(cell.fault, cell.state, host, elf)?)))
        .collect();
    assert!(different.is_empty(), "{}", different.join("\n"));
}
