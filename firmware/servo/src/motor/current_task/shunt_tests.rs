//! The current loop over shunts of the low side: which samples it believes, and when.

extern crate std;

use std::boxed::Box;
use std::vec::Vec;

use super::tests::{NO_CURRENT, Stage, settings};
use super::*;
use crate::arithmetic::trigonometry::Rotation;
use crate::current::command::BusScale;
use crate::current::sensing::CurrentSensing;
use crate::motor::example::Example;
use crate::motor::stage::Cycle;

/// The example with shunts that settle in 1.2 us.
#[derive(Debug)]
struct OnShunts;

impl BoardKind for OnShunts {
    const FACTS: Facts = Facts {
        current_sensing: CurrentSensing::LowSideShunts { settling: 1_200, sampling: 714 },
        ..<Example as BoardKind>::FACTS
    };
}

/// Of a half-bridge whose shunt can be read.
const LARGEST: u16 = 4_760;
/// A tenth of the range and a little: what the sum of three true samples never is.
const WRONG: u32 = 220;

#[derive(Clone, Debug, Default)]
struct ShuntStage(Stage);

impl PowerStage for ShuntStage {
    type Board = OnShunts;

    fn begin(&mut self) -> Cycle {
        self.0.begin()
    }

    fn samples(&mut self) -> Samples {
        self.0.samples()
    }

    fn temperatures(&mut self) -> [u32; 2] {
        self.0.temperatures()
    }

    fn encoder_count(&mut self) -> u32 {
        self.0.encoder_count()
    }

    fn set_compare(&mut self, counts: [u16; 3]) {
        self.0.set_compare(counts);
    }

    fn trim(&mut self, counts: i32) {
        self.0.trim(counts);
    }

    fn switch_off(&mut self) {
        self.0.switch_off();
    }

    fn set_chopper(&mut self, on: bool) {
        self.0.set_chopper(on);
    }

    fn is_alive(&mut self) {
        self.0.is_alive();
    }
}

struct Bench {
    control: CurrentControl<ShuntStage>,
    stage: Stage,
    link: &'static CurrentLink,
    /// Compare values of the last cycles, the newest last.
    compared: Vec<[u16; 3]>,
}

impl Bench {
    fn new() -> Self {
        let link = &*Box::leak(Box::new(CurrentLink::new()));
        let stage = Stage::default();
        let control = CurrentControl::new(ShuntStage(stage.clone()), link, settings());
        Self { control, stage, link, compared: Vec::new() }
    }

    /// The bridge on, with a voltage of so many thousandths of the longest at an angle in 2^-32 revolution.
    fn order(&self, thousandths: i32, angle: u32) {
        let bus = BusScale::new(300 << 14, ((1_i64 << 44) / (300 << 14)) as i32, 5_250);
        self.link.order.send(|order| {
            order.command.set_bus(&bus);
            order.command.set_ahead(Rotation::by(0));
            order.command.set_currents(0, 0);
            order.command.set_voltages(0, bus.longest() / 1_000 * thousandths);
            order.command.set_angle(angle, 0, 0);
            order.set(true, 0);
        });
    }

    /// A cycle whose samples are zero, but for these phases.
    fn cycle(&mut self, wrong: [bool; 3]) {
        let currents = wrong.map(|wrong| 2_048 + if wrong { WRONG } else { 0 });
        self.stage.provide(Samples { currents, ..NO_CURRENT });
        let _ = self.control.current_loop();
        self.compared.push(self.stage.compared().unwrap_or_default());
    }

    fn hidden(&self, cycles_ago: usize) -> [bool; 3] {
        self.compared[self.compared.len() - cycles_ago].map(|counts| counts > LARGEST)
    }

    fn trip(&self) -> Option<Trip> {
        Trip::from_code(get(&self.link.report.trip))
    }
}

/// So many cycles with the longest voltage, which turns by 25 degrees in each: what is hidden changes every second or third cycle.
fn turning(cycles: u32, wrong: impl Fn(&Bench) -> [bool; 3]) -> Bench {
    let mut bench = Bench::new();
    for step in 0..cycles {
        bench.order(1_000, step.wrapping_mul(298_261_617));
        let wrong = wrong(&bench);
        bench.cycle(wrong);
    }
    bench
}

#[test]
fn a_sample_that_the_compare_values_of_the_cycle_before_hide_is_not_believed() {
    let bench = turning(720, |bench| if bench.compared.is_empty() { [false; 3] } else { bench.hidden(1) });
    assert_eq!(bench.trip(), None);
    let hidden = bench.compared.iter().filter(|counts| counts.iter().any(|&counts| counts > LARGEST)).count();
    assert!((500..650).contains(&hidden), "{hidden}");
}

#[test]
fn a_sample_that_those_of_the_cycle_before_that_or_of_this_one_hide_is_believed() {
    let hidden = |counts: [u16; 3]| counts.map(|counts| counts > LARGEST);
    let compared = turning(300, |_| [false; 3]).compared;
    // What the cycle `at` is shown belongs to the compare values before it.
    for other in [0, 2] {
        let mut tried = 0;
        for at in 3..300 {
            let wrong = hidden(compared[at - other]);
            if wrong == [false; 3] || hidden(compared[at - 1]) != [false; 3] {
                continue;
            }
            tried += 1;
            let bench = turning(at as u32 + 1, |bench| if bench.compared.len() == at { wrong } else { [false; 3] });
            assert_eq!(bench.trip(), Some(Trip::CurrentSum), "cycle {at}, compare values of {other} cycles ago");
        }
        assert!(tried > 20, "{tried}");
    }
}

#[test]
fn after_a_late_cycle_the_sample_still_belongs_to_the_compare_values_before_it() {
    let mut bench = Bench::new();
    for _ in 0..3 {
        bench.order(1_000, 0);
        bench.cycle([false; 3]);
    }
    let before = bench.hidden(1);
    assert_ne!(before, [false; 3]);
    // Late, it asks for hardly any voltage, which comes into force with nothing.
    bench.order(10, 0);
    bench.stage.be_late(true);
    bench.cycle(before);
    bench.stage.be_late(false);
    assert_eq!(bench.hidden(1), [false; 3]);
    bench.cycle(before);
    assert_eq!(bench.trip(), None);
    bench.stage.provide(Samples { currents: before.map(|w| 2_048 + if w { WRONG } else { 0 }), ..NO_CURRENT });
    let _ = bench.control.current_loop();
    assert_eq!(bench.trip(), Some(Trip::CurrentSum));
}

#[test]
fn a_bridge_that_is_off_hides_nothing() {
    let mut bench = Bench::new();
    for _ in 0..3 {
        bench.order(1_000, 0);
        bench.cycle([false; 3]);
    }
    let hidden = bench.hidden(1);
    assert_ne!(hidden, [false; 3]);
    bench.link.order.send(|order| order.set(false, 0));
    bench.cycle(hidden);
    bench.order(0, 0);
    bench.stage.provide(Samples { currents: hidden.map(|w| 2_048 + if w { WRONG } else { 0 }), ..NO_CURRENT });
    let _ = bench.control.current_loop();
    assert_eq!(bench.trip(), Some(Trip::CurrentSum));
}
