//! Inverter and sensors as the current loop sees them.

use drive::{Cycle, PowerStage, Samples};

use crate::{bridge::Modulator, chopper::Chopper, current_sense::CurrentSense, encoder, facts::Kind, loop_watchdog};

/// Modulation, converters, and a view of the encoder's counter; owned by the current loop.
#[derive(Debug)]
pub struct Inverter {
    pub(crate) modulator: Modulator,
    pub(crate) current_sense: CurrentSense,
    pub(crate) chopper: Chopper,
}

impl PowerStage for Inverter {
    type Board = Kind;

    #[inline(always)]
    fn begin(&mut self) -> Cycle {
        self.current_sense.acknowledge();
        self.modulator.begin()
    }

    #[inline(always)]
    fn samples(&mut self) -> Samples {
        self.current_sense.read()
    }

    #[inline(always)]
    fn temperatures(&mut self) -> [u32; 2] {
        self.current_sense.temperatures()
    }

    #[inline(always)]
    fn encoder_count(&mut self) -> u32 {
        encoder::count()
    }

    #[inline(always)]
    fn set_compare(&mut self, counts: [u16; 3]) {
        self.modulator.set_compare(counts);
    }

    #[inline(always)]
    fn trim(&mut self, counts: i32) {
        self.modulator.set_reload(counts);
    }

    #[inline(always)]
    fn switch_off(&mut self) {
        self.modulator.switch_off();
    }

    #[inline(always)]
    fn set_chopper(&mut self, on: bool) {
        self.chopper.set(on);
    }

    #[inline(always)]
    fn is_alive(&mut self) {
        loop_watchdog::feed();
    }
}
