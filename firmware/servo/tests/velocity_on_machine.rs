//! The velocity loop on the machine.
mod machine_bench;
use machine_bench::master::*;
use machine_bench::measure::*;
use machine_bench::setup::Setup;
use machine_bench::*;
use plant::ReferenceAxis;
use servo::*;

fn bode(setup: &Setup, hertz: f64) -> Phasor {
    let mut bench = Bench::new(setup);
    bench.start(Mode::Velocity);
    let length = 4_000;
    let hertz = whole_periods(hertz, length, TICKS_PER_SECOND);
    let (mut c, mut m) = (vec![], vec![]);
    let mut t = 0;
    while t < 2_400 + length {
        let command = 100.0 + 8.0 * (std::f64::consts::TAU * hertz * t as f64 / TICKS_PER_SECOND).sin();
        for seen in bench.velocity_cycle(rpm(command)) {
            if t >= 2_400 { c.push(to_rpm(seen.output.velocity_command)); m.push(of_radians(seen.velocity)); 
              assert!(seen.output.limiting.is_empty()); }
            t += 1;
        }
    }
    assert!(bench.trip.is_none(), "{:?}", bench.trip);
    Phasor::of(&m, hertz, TICKS_PER_SECOND).over(Phasor::of(&c, hertz, TICKS_PER_SECOND))
}

#[test]
fn explore() {
    for (kp, tn, filter, notch) in [(1200, 67, 250, false), (1700, 47, 100, false), (1900, 42, 100, false), (1900, 42, 100, true),(1900, 60, 100, true), (2100, 60, 0, true), (2400, 80, 0, true)] {
        let mut setup = Setup::of(ReferenceAxis::precise()).with_cycle(4);
        setup.axis.velocity_gain = kp; setup.axis.integral_time = tn; setup.axis.velocity_filter = filter;
        if notch {
            setup.axis.filter = CurrentFilterSettings::new([FilterSection::Notch { frequency: 21_800, width: 8_000, depth: 2_000 }, FilterSection::Off]).unwrap();
        }
        let g = [10.0, 50.0, 100.0, 150.0, 200.0, 250.0, 300.0, 400.0, 600.0].map(|h| decibels(bode(&setup, h).amplitude()));
        println!("{kp} {tn} {filter} {notch} {g:.2?}");
        let mut bench = Bench::new(&setup);
        bench.start(Mode::Velocity);
        for speed in [1.0, 10.0, 100.0, 1000.0] {
            for _ in 0..1200 { bench.velocity_cycle(rpm(speed)); }
            let v: Vec<f64> = (0..2000).flat_map(|_| bench.velocity_cycle(rpm(speed))).map(|s| of_radians(s.velocity)).collect();
            println!("   {speed} rpm: mean {:.4} rms {:.4} peak {:.4}", mean(&v), deviation(&v), largest(v.iter().map(|x| x - mean(&v))));
        }
    }
}
