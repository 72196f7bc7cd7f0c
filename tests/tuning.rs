//! P-0-0240 on every reference axis: what it finds, what an observer outside of the drive finds, and where the axis has been meanwhile.

use bench::{DriveSetup, parameters_of, product};
use plant::ReferenceAxis;
use ring::Nanoseconds;
use ring::ident::{Idn, Value};
use ring::master::{DriveScript, Telegram};

use crate::commissioning::Halted;
use crate::running::ADDRESS;

const P: u16 = 0x8000;
const TUNE: u16 = P | 240;
const PROGRESS: u16 = P | 227;
const FINDING: u16 = P | 228;
const EXECUTED: u64 = 3;
const EXECUTING: u64 = 7;

/// An axis in the hands of HALT.
fn halted(axis: ReferenceAxis) -> Halted {
    let mut drive = DriveScript::new(ADDRESS, Telegram::standard(2).unwrap()).with_all(parameters_of(&axis));
    if axis.machine.brake.is_some() {
        let encoder = axis.machine.encoder;
        let angle = (encoder.electrical_zero * f64::from(axis.machine.windings.pole_pairs)).fract() * 36_000.0;
        drive = drive
            .with(product(120), Value::Word(3))
            .with(product(118), Value::Long(angle as u32))
            .with(Idn(206), Value::Word(60))
            .with(Idn(207), Value::Word(60));
    }
    Halted::on(DriveSetup { axis, ..DriveSetup::new(ADDRESS) }, drive, 2_000)
}

/// Starts the tuning and waits for its end; how far the axis has been from where it stood, in revolutions.
fn tune(halted: &mut Halted) -> (u64, f64) {
    let start = halted.revolutions();
    halted.bench.write(TUNE, Value::Word(3)).unwrap();
    let mut furthest = 0.0_f64;
    for _ in 0..3_000 {
        for _ in 0..200 {
            halted.bench.run(Nanoseconds::from_millis(5));
            furthest = furthest.max((halted.revolutions() - start).abs());
            if halted.bench.world.ring().master().phase() != 4 {
                let at = halted.bench.world.now();
                let error = halted.bench.run_up_and_read(&[390]);
                panic!("the torque went at {at:?}: {error:04X?}, {}", halted.bench.text(FINDING));
            }
        }
        let progress = halted.numbers([PROGRESS, P | 246, P | 247]);
        println!("{:?} {progress:?} {:.1} rpm", halted.bench.world.now(), halted.bench.rpm());
        let status = halted.bench.number(TUNE);
        if status != EXECUTING {
            return (status, furthest);
        }
    }
    panic!("the tuning does not end: {} %", halted.bench.number(PROGRESS));
}

#[test]
fn try_the_axes() {
    for axis in ReferenceAxis::ALL {
        let axis = axis();
        let mut halted = halted(axis);
        let (status, furthest) = tune(&mut halted);
        let at = halted.bench.world.now();
        println!("{}: {status}, {furthest:.3} rev, {:?}, {}", axis.name, at, halted.bench.text(FINDING));
        println!("{:?}", halted.numbers([P | 243, P | 244, P | 245, P | 246, P | 247]));
        println!(
            "{:?}",
            halted.numbers([
                100,
                101,
                104,
                348,
                P | 221,
                155,
                P | 142,
                P | 170,
                P | 171,
                P | 172,
                P | 173,
                P | 174,
                P | 175,
                P | 176
            ])
        );
        for window in 0..11 {
            halted.bench.write(P | 249, Value::Word(window * 6)).unwrap();
            let Value::Bytes(bytes) = halted.bench.read(P | 248) else { panic!() };
            let numbers: Vec<f64> =
                bytes.chunks(4).map(|word| f64::from(i32::from_le_bytes(word.try_into().unwrap())) / 100.0).collect();
            for point in numbers.chunks(5) {
                println!("{point:?}");
            }
        }
    }
    assert_eq!(EXECUTED, 4);
}
