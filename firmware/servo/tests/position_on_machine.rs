//! Position on the machine.
mod machine_bench;
use machine_bench::master::*;
use machine_bench::measure::*;
use machine_bench::setup::Setup;
use machine_bench::*;
use plant::ReferenceAxis;
use servo::*;

#[test]
fn explore() {
    for (name, kp, tn, kv, filter, notch, dt, band, exact) in [("f100k24", 2400, 42, 1600, 100, true, 1290, 100, 0), ("f100k26", 2600, 36, 2000, 100, true, 1290, 100, 0), ("f100k26b200", 2600, 36, 2000, 100, true, 1290, 200, 0), ("f150k30b200", 3000, 36, 2000, 150, true, 1290, 200, 0), ("f150k30b200 nonoise", 3000, 36, 2000, 150, true, 1290, 200, 2), ("f250k30b150", 3000, 36, 2000, 250, true, 1290, 150, 0)] {
        let mut setup = Setup::of(ReferenceAxis::precise()).with_friction_compensation().with_acceleration_feed_forward();
        setup.axis.velocity_gain = kp; setup.axis.integral_time = tn; setup.axis.velocity_filter = filter; setup.axis.position_gain = kv;
        setup.current.dead_time = dt; setup.current.dead_time_band = band;
        let se = &mut setup.reference.machine.current_sensors;
        if exact == 1 || exact == 2 { se.noise = 0.0; }
        if exact == 2 { se.offset = [0.0; 3]; }
        if exact == 3 { se.gain_error = [0.0; 3]; }
        if notch {
            setup.axis.filter = CurrentFilterSettings::new([FilterSection::Notch { frequency: 21_800, width: 8_000, depth: 2_000 }, FilterSection::Off]).unwrap();
        }
        for ticks in [16] {
            let setup = setup.with_cycle(ticks);
            for speed in [10.0, 100.0, 1000.0] {
                let mut bench = Bench::new(&setup);
                bench.start(Mode::Position);
                let mut master = Master::new(ticks);
                let n = 8000 / ticks;
                for _ in 0..n*2 { bench.position_cycle(master.next(speed / 60.0, speed / 60.0 / 0.3)); }
                let seen: Vec<Seen> = (0..2*n).flat_map(|_| bench.position_cycle(master.next(speed / 60.0, 100.0))).collect();
                let e: Vec<f64> = seen.iter().map(|s| counts(s.output.following_error)).collect();
                let tr: Vec<f64> = seen.iter().map(|s| counts(s.output.position_command) - s.angle * 1048576.0).collect();
                let iq: Vec<f64> = seen.iter().map(|s| s.current[1]*bench.peak*1e3).collect();
                let fe = speed / 60.0 * 5.0;
                let h: Vec<String> = [1.0, 2.0, 6.0, 12.0].iter().map(|k| format!("{:.3}", Phasor::of(&e, fe * k, 8000.0).amplitude())).collect();
                print!("{h:?} ");
                println!("{name} {ticks} {speed} rpm: error mean {:.3} rms {:.3} peak {:.3}; true mean {:.3} rms {:.3} peak-mean {:.3}; iq mean {:.1} rms {:.1} mA {:?}", mean(&e), deviation(&e), largest(e.iter().copied()), mean(&tr), deviation(&tr), largest(tr.iter().map(|t| t - mean(&tr))), mean(&iq), deviation(&iq), bench.trip);
            }
        }
    }
}
