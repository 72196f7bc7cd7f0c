//! The current loop over an inverter that notes what it is told.

extern crate std;

use core::cell::RefCell;
use std::boxed::Box;
use std::rc::Rc;

use super::*;
use crate::arithmetic::trigonometry::Rotation;
use crate::current::command::BusScale;
use crate::current::settings::PwmFrequency;
use crate::motor::example::{self, Example};
use crate::motor::stage::Cycle;

const HALF: [u16; 3] = [PwmFrequency::Khz16.reload() / 2; 3];
pub(super) const NO_CURRENT: Samples = Samples { currents: [2_048; 3], bus: 1_000 };
/// 4 A above the trip level of [`settings`], in the sum nothing.
const OVERCURRENT: Samples = Samples { currents: [2_048 + 1_700, 2_048 - 850, 2_048 - 850], bus: 1_000 };

/// What the current loop has done, and what it is to find.
#[derive(Debug, Default)]
pub(super) struct Noted {
    late: bool,
    first: bool,
    count: u32,
    samples: Samples,
    compare: Option<[u16; 3]>,
    trim: i32,
    switched_off: u32,
    chopper: std::vec::Vec<bool>,
    alive: u32,
}

#[derive(Clone, Debug, Default)]
pub(super) struct Stage(Rc<RefCell<Noted>>);

impl Stage {
    /// What the next cycle finds.
    pub(super) fn provide(&self, samples: Samples) {
        self.0.borrow_mut().samples = samples;
    }

    pub(super) fn be_late(&self, late: bool) {
        self.0.borrow_mut().late = late;
    }

    /// The last compare values.
    pub(super) fn compared(&self) -> Option<[u16; 3]> {
        self.0.borrow().compare
    }
}

impl PowerStage for Stage {
    type Board = Example;

    fn begin(&mut self) -> Cycle {
        let mut noted = self.0.borrow_mut();
        noted.first = !noted.first;
        Cycle { first: noted.first, late: noted.late }
    }

    fn samples(&mut self) -> Samples {
        self.0.borrow().samples
    }

    fn temperatures(&mut self) -> [u32; 2] {
        [700, 800]
    }

    fn encoder_count(&mut self) -> u32 {
        self.0.borrow().count
    }

    fn set_compare(&mut self, counts: [u16; 3]) {
        self.0.borrow_mut().compare = Some(counts);
    }

    fn trim(&mut self, counts: i32) {
        self.0.borrow_mut().trim = counts;
    }

    fn switch_off(&mut self) {
        self.0.borrow_mut().switched_off += 1;
    }

    fn set_chopper(&mut self, on: bool) {
        self.0.borrow_mut().chopper.push(on);
    }

    fn is_alive(&mut self) {
        self.0.borrow_mut().alive += 1;
    }
}

/// 20 A of 25 A, 3 600 counts of bus voltage, 50 increments a cycle.
pub(super) fn settings() -> CurrentSettings {
    CurrentSettings { protection: Protection::new(20_000, 25_000, 3_600, 50).unwrap(), ..example::settings().current }
}

struct Bench {
    control: CurrentControl<Stage>,
    stage: Stage,
    link: &'static CurrentLink,
}

impl Bench {
    fn new() -> Self {
        let (stage, link) = (Stage::default(), &*Box::leak(Box::new(CurrentLink::new())));
        stage.0.borrow_mut().samples = NO_CURRENT;
        let bench = Self { control: CurrentControl::new(stage.clone(), link, settings()), stage, link };
        assert_eq!(bench.switched_off(), 1, "it begins with the bridge off");
        bench
    }

    fn order(&self, on: bool, trim: i16) {
        self.link.order.send(|order| {
            order.command.set_bus(&BusScale::new(300 << 14, ((1_i64 << 44) / (300 << 14)) as i32, 5_250));
            order.command.set_ahead(Rotation::by(0));
            order.command.set_currents(0, 1 << 22);
            order.command.set_angle(1_000, 10, 7);
            order.set(on, trim);
        });
    }

    /// One cycle with these samples; the compare values, if there are new ones.
    fn cycle(&mut self, samples: Samples) -> Option<[u16; 3]> {
        {
            let mut noted = self.stage.0.borrow_mut();
            noted.samples = samples;
            noted.compare = None;
        }
        let _ = self.control.current_loop();
        self.stage.0.borrow().compare
    }

    fn cycles(&mut self, number: u32, samples: Samples) {
        for _ in 0..number {
            self.cycle(samples);
        }
    }

    fn late_cycle(&mut self) {
        self.stage.0.borrow_mut().late = true;
        self.cycle(NO_CURRENT);
        self.stage.0.borrow_mut().late = false;
    }

    fn switched_off(&self) -> u32 {
        self.stage.0.borrow().switched_off
    }

    fn trip(&self) -> Option<Trip> {
        Trip::from_code(get(&self.link.report.trip))
    }
}

/// A drive under torque.
fn regulating() -> Bench {
    let mut bench = Bench::new();
    bench.order(true, 0);
    assert!(bench.cycle(NO_CURRENT).is_some());
    bench
}

#[test]
fn the_board_hears_that_all_is_well_once_for_every_order_and_not_without_one() {
    let mut bench = Bench::new();
    let alive = |bench: &Bench| bench.stage.0.borrow().alive;
    for orders in 1..=5 {
        bench.order(false, 0);
        bench.cycles(2, NO_CURRENT);
        assert_eq!(alive(&bench), orders);
    }
    bench.cycles(20, NO_CURRENT);
    assert_eq!(alive(&bench), 5, "the control loop is silent");
}

#[test]
fn an_overcurrent_switches_off_in_its_cycle_is_told_and_not_regulated_until_the_order_for_torque_has_gone_and_come() {
    let mut bench = regulating();
    assert_eq!(bench.cycle(OVERCURRENT), None);
    assert_eq!((bench.switched_off(), bench.trip()), (2, Some(Trip::Overcurrent)));
    for _ in 0..4 {
        assert_eq!(bench.cycle(NO_CURRENT), None, "the order is still the one that tripped");
    }
    assert_eq!(bench.trip(), Some(Trip::Overcurrent));
    bench.order(false, 0);
    assert_eq!(bench.cycle(NO_CURRENT), Some(HALF));
    assert_eq!(bench.trip(), None);
    bench.order(true, 0);
    assert!(bench.cycle(NO_CURRENT).is_some());
    assert_eq!(bench.switched_off(), 2);
}

#[test]
fn bus_voltage_and_increments_of_the_cycle_trip_too() {
    let mut bench = regulating();
    bench.cycle(Samples { bus: 3_601, ..NO_CURRENT });
    assert_eq!(bench.trip(), Some(Trip::Overvoltage));
    for moved in [51_i32, -51] {
        let mut bench = regulating();
        for _ in 0..3 {
            bench.stage.0.borrow_mut().count = bench.control.count.wrapping_add(50);
            bench.cycle(NO_CURRENT);
        }
        assert_eq!(bench.trip(), None);
        bench.stage.0.borrow_mut().count = bench.control.count.wrapping_add_signed(moved);
        bench.cycle(NO_CURRENT);
        assert_eq!((bench.switched_off(), bench.trip()), (2, Some(Trip::EncoderJump)));
    }
}

#[test]
fn late_cycles_are_counted_and_only_two_in_a_row_under_torque_switch_off() {
    let mut bench = regulating();
    for _ in 0..3 {
        bench.late_cycle();
        bench.cycle(NO_CURRENT);
    }
    assert_eq!((get(&bench.link.report.late), bench.trip(), bench.switched_off()), (3, None, 1));
    bench.late_cycle();
    bench.late_cycle();
    assert_eq!((get(&bench.link.report.late), bench.trip(), bench.switched_off()), (5, Some(Trip::Late), 2));
    let mut resting = Bench::new();
    resting.late_cycle();
    resting.late_cycle();
    assert_eq!((resting.trip(), resting.switched_off()), (None, 1));
}

#[test]
fn torque_that_comes_again_begins_like_the_first_time() {
    let mut bench = Bench::new();
    bench.order(true, 0);
    let first = bench.cycle(NO_CURRENT);
    bench.cycles(50, NO_CURRENT);
    assert_ne!(bench.cycle(NO_CURRENT), first, "the integrators wind up against a current that does not come");
    bench.order(false, 0);
    assert_eq!(bench.cycle(NO_CURRENT), Some(HALF), "the timer forgets the last voltage");
    bench.order(true, 0);
    assert_eq!(bench.cycle(NO_CURRENT), first);
}

#[test]
fn settings_come_into_force_with_the_second_cycle_of_a_tick_each_word_in_its_place() {
    let mut bench = regulating();
    let lower = CurrentSettings { protection: Protection::new(5_000, 25_000, 900, 20).unwrap(), ..settings() };
    bench.link.settings.send(|words| words.set(&lower));
    assert_eq!(bench.link.settings.last().get(), lower);
    let [some, bus] = [Samples { currents: [2_048 + 500, 2_048 - 250, 2_048 - 250], bus: 800 }, NO_CURRENT];
    assert!(
        bench.cycle(some).is_some(),
        "the second cycle still goes by the old ones, and takes the new ones at its end"
    );
    bench.cycle(some);
    assert_eq!(bench.trip(), Some(Trip::Overcurrent));
    let mut bench = regulating();
    bench.link.settings.send(|words| words.set(&lower));
    bench.cycles(2, bus);
    assert_eq!(bench.trip(), Some(Trip::Overvoltage));
}

#[test]
fn the_zero_of_the_sensors_is_made_only_of_samples_without_torque_in_a_row() {
    let mut bench = Bench::new();
    bench.order(false, 0);
    bench.cycles(1_279, NO_CURRENT);
    bench.order(true, 0);
    bench.cycles(3, NO_CURRENT);
    bench.order(false, 0);
    bench.cycles(1_279, NO_CURRENT);
    assert_eq!(get(&bench.link.report.calibrated), 0);
    bench.cycle(NO_CURRENT);
    assert_eq!(get(&bench.link.report.calibrated), 1);
}

#[test]
fn a_cycle_reports_its_count_its_angle_and_its_bus_in_its_own_place_and_trims_as_it_is_told() {
    let mut bench = Bench::new();
    bench.order(false, -37);
    for (count, bus) in [(12, 1_100), (13, 1_200)] {
        bench.stage.0.borrow_mut().count = count;
        bench.cycle(Samples { bus, ..NO_CURRENT });
    }
    let report = |first: bool| {
        let cycle = bench.link.report.cycle(first);
        (get(&cycle.count), get(&cycle.bus), cycle.readings.angle())
    };
    assert_eq!([report(true), report(false)], [(12, 1_100, 1_014), (13, 1_200, 1_021)]);
    assert_eq!(bench.stage.0.borrow().trim, -37);
    assert_eq!(get(&bench.link.report.temperatures), 700 | 800 << 16);
}

#[test]
fn every_first_cycle_of_a_tick_starts_the_control_loop() {
    let mut bench = Bench::new();
    let started = [0; 6].map(|_| bench.control.current_loop());
    assert_eq!(started, [true, false].repeat(3)[..]);
}

#[test]
fn the_chopper_switches_at_its_levels_with_and_without_the_bridge_and_its_cycles_are_counted() {
    let at = |bus: u32| Samples { bus, ..NO_CURRENT };
    for (bridge, beyond) in [(false, 0), (true, 0), (false, u32::MAX)] {
        let mut bench = Bench::new();
        let begun = core::mem::take(&mut bench.stage.0.borrow_mut().chopper);
        assert_eq!(begun, [false], "it begins with the chopper off");
        bench.order(bridge, 0);
        set(&bench.link.chopper, 3_000 << 16 | 2_900 | beyond);
        let mut seen = std::vec::Vec::new();
        for bus in [2_950, 3_000, 3_001, 2_901, 3_100, 2_900, 3_000, 3_001] {
            bench.cycle(at(bus));
            seen.push(bench.control.chopping);
        }
        let expected = [false, false, true, true, true, false, false, true].map(|on| on && beyond == 0);
        assert_eq!(seen, expected, "bridge {bridge}");
        let switched = core::mem::take(&mut bench.stage.0.borrow_mut().chopper);
        assert_eq!(switched, if beyond == 0 { &[true, false, true][..] } else { &[] });
        assert_eq!(get(&bench.link.report.chopped), if beyond == 0 { 4 } else { 0 });
        // Too hot: off with the next sample, whatever it is.
        set(&bench.link.chopper, u32::MAX);
        bench.cycle(at(4_095));
        assert!(!bench.control.chopping);
    }
}

#[test]
fn a_trip_leaves_the_chopper_to_work() {
    let mut bench = Bench::new();
    set(&bench.link.chopper, 3_000 << 16 | 2_900);
    bench.order(true, 0);
    bench.cycles(2, Samples { bus: 3_700, ..NO_CURRENT });
    assert_eq!(bench.switched_off(), 2, "an overvoltage");
    assert!(bench.control.chopping);
    bench.cycle(Samples { bus: 2_800, ..NO_CURRENT });
    assert!(!bench.control.chopping);
}
