//! Inverter and sensors of the machine, as the task of the current loop sees them.

use std::cell::{RefCell, RefMut};
use std::marker::PhantomData;
use std::rc::Rc;

use plant::Machine;
use servo::current::{CurrentSensing, PwmFrequency};
use servo::monitor::{Divider, TemperatureSensor, Thermometers};
use servo::motor::{BoardKind, Cycle, Facts, PowerStage, Samples};

use super::CYCLE;

/// From the sample of the currents to the count of the encoder, in nanoseconds.
const CONVERSION: u64 = 2_200;

/// The board that this stands for, with current sensors in the lines.
#[derive(Debug)]
pub(crate) struct Kind;

/// The same with shunts in the low-side emitters.
#[derive(Debug)]
pub(crate) struct OnShunts;

impl BoardKind for OnShunts {
    const FACTS: Facts =
        Facts { current_sensing: CurrentSensing::LowSideShunts { settling: 1_200, sampling: 700 }, ..Kind::FACTS };
}

/// Of both temperature inputs.
pub(crate) const DIVIDER: Divider = Divider { pull_up: 2_200, supply: 3_300, reference: 3_300 };

impl BoardKind for Kind {
    const FACTS: Facts = Facts {
        frequency: PwmFrequency::Khz16,
        dead_time: 1_000,
        current_sensing: CurrentSensing::InLine,
        loop_timer_counts: 10_500,
        sample_to_count: CONVERSION as u16,
        encoder_rate: 18_600_000,
        thermometers: &Thermometers::new(TemperatureSensor::Ntc5k, &DIVIDER, &DIVIDER),
    };
}

/// A machine in the hands of the current loop and of the bench.
pub(crate) struct Stage<B>(Rc<RefCell<State>>, PhantomData<fn() -> B>);

impl<B> Clone for Stage<B> {
    fn clone(&self) -> Self {
        Self(Rc::clone(&self.0), PhantomData)
    }
}

struct State {
    machine: Machine,
    /// Of the last sample.
    time: u64,
    /// The next cycle is the first of a tick.
    first: bool,
    bridge_on: bool,
    /// The current loop has switched the bridge off.
    tripped: bool,
}

impl<B> Stage<B> {
    pub(crate) fn new(machine: Machine) -> Self {
        Self(
            Rc::new(RefCell::new(State { machine, time: 0, first: true, bridge_on: false, tripped: false })),
            PhantomData,
        )
    }

    pub(crate) fn machine(&self) -> RefMut<'_, Machine> {
        RefMut::map(self.0.borrow_mut(), |state| &mut state.machine)
    }

    /// The currents are sampled at this instant, in nanoseconds.
    pub(crate) fn sample_at(&self, time: u64) {
        self.0.borrow_mut().time = time;
    }

    pub(crate) fn bridge_is_on(&self) -> bool {
        let state = self.0.borrow();
        state.bridge_on && !state.tripped
    }

    /// Switches on again what the current loop has switched off.
    pub(crate) fn reset(&self) {
        let state = &mut *self.0.borrow_mut();
        state.tripped = false;
        state.machine.set_bridge(state.bridge_on, state.time + CYCLE / 2);
    }

    /// Sets the bridge on or off in the middle of the period; on has no effect after a trip.
    pub(crate) fn set_bridge(&self, on: bool) {
        let state = &mut *self.0.borrow_mut();
        if on != state.bridge_on {
            state.bridge_on = on;
            state.machine.set_bridge(on && !state.tripped, state.time + CYCLE / 2);
        }
    }
}

impl<B: BoardKind> PowerStage for Stage<B> {
    type Board = B;

    fn begin(&mut self) -> Cycle {
        let state = &mut *self.0.borrow_mut();
        let first = state.first;
        state.first = !first;
        Cycle { first, late: false }
    }

    fn samples(&mut self) -> Samples {
        let State { machine, time, .. } = &mut *self.0.borrow_mut();
        Samples { currents: machine.current_samples(*time).map(u32::from), bus: machine.bus_sample(*time).into() }
    }

    fn temperatures(&mut self) -> [u32; 2] {
        let State { machine, time, .. } = &mut *self.0.borrow_mut();
        machine.temperature_samples(*time).map(u32::from)
    }

    fn encoder_count(&mut self) -> u32 {
        let State { machine, time, .. } = &mut *self.0.borrow_mut();
        machine.encoder_count(*time + CONVERSION)
    }

    /// They act from the bottom of the period on.
    fn set_compare(&mut self, counts: [u16; 3]) {
        let State { machine, time, .. } = &mut *self.0.borrow_mut();
        let reload = f64::from(B::FACTS.frequency.reload());
        machine.set_duties(counts.map(|count| f64::from(count) / reload), *time + CYCLE / 2);
    }

    /// There is no ring to be in step with.
    fn trim(&mut self, counts: i32) {
        assert_eq!(counts, 0);
    }

    fn switch_off(&mut self) {
        let state = &mut *self.0.borrow_mut();
        if state.bridge_on {
            state.tripped = true;
            state.machine.set_bridge(false, state.time + CONVERSION);
        }
    }

    /// The pin acts at the end of the cycle's first instructions.
    fn set_chopper(&mut self, on: bool) {
        let State { machine, time, .. } = &mut *self.0.borrow_mut();
        machine.set_chopper(on, *time + CONVERSION);
    }

    /// Nobody waits for it here.
    fn is_alive(&mut self) {}
}
