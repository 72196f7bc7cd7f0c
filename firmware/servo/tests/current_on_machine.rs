//! The current loop on the machine: inverter with dead time, saturating windings, noisy sensors with offsets and gain errors.

mod machine_bench;

use machine_bench::measure::*;
use machine_bench::setup::Setup;
use machine_bench::*;
use plant::ReferenceAxis;

fn axes() -> [ReferenceAxis; 5] {
    [ReferenceAxis::press(), ReferenceAxis::small_cnc(), ReferenceAxis::precise(), ReferenceAxis::vertical(), ReferenceAxis::catalogue()]
}

fn seized(setup: &Setup) -> Bench {
    let mut bench = Bench::new(setup);
    bench.machine.block(true, bench.time);
    bench
}

#[test]
fn explore() {
    for axis in axes() {
        for offset in [0.0, 0.3, 0.7] {
            let g = |hertz: f64| {
                let mut bench = seized(&Setup::of(axis));
                let length = 3_200;
                let hertz = whole_periods(hertz, length, CYCLES_PER_SECOND);
                let (mut c, mut m) = (vec![], vec![]);
                for n in 0..1600 + length {
                    let command = offset + 0.1 * (std::f64::consts::TAU * hertz * n as f64 / CYCLES_PER_SECOND).sin();
                    let now = bench.current_cycle([0.0, command]);
                    if n >= 1600 { c.push(command); m.push(now[1]); }
                }
                assert!(bench.trip.is_none(), "{:?}", bench.trip);
                decibels(Phasor::of(&m, hertz, CYCLES_PER_SECOND).over(Phasor::of(&c, hertz, CYCLES_PER_SECOND)).amplitude())
            };
            println!("{} {offset} {:.2?}", axis.name, [50.0, 200.0, 500.0, 1000.0, 1500.0, 1800.0, 2000.0, 2200.0, 3000.0].map(g));
        }
        let mut bench = seized(&Setup::of(axis));
        for _ in 0..400 { bench.current_cycle([0.0, 0.0]); }
        let v: Vec<f64> = (0..200).map(|_| bench.current_cycle([0.0, 0.3])[1]).collect();
        println!("{:?}", Step::of(&v, 0.0, 0.3));
    }
}
