//! The motor side of the board as the tasks of the loop tick see it.

use drive::{Amplifier, Hardware, Inputs, InterruptLine, ProbeInput, ResetCause};

use crate::{
    brake_coil::BrakeCoil,
    bridge::Bridge,
    edge_latches::{Edge, EdgeLatches},
    encoder::Encoder,
    facts::{AMPLIFIER, Kind},
    inputs, interrupt_pins,
    loop_phase::LoopPhase,
};

/// Encoder, marks, phase of the tick, digital inputs, and the switches of bridge and brake.
#[derive(Debug)]
pub struct MotorSide {
    pub(crate) encoder: Encoder,
    pub(crate) marks: EdgeLatches,
    pub(crate) loop_phase: LoopPhase,
    pub(crate) bridge: Bridge,
    pub(crate) brake_coil: BrakeCoil,
    pub(crate) reset_cause: ResetCause,
}

impl Hardware for MotorSide {
    type Board = Kind;

    const AMPLIFIER: Amplifier = AMPLIFIER;

    #[inline(always)]
    fn encoder_count(&mut self) -> u32 {
        self.encoder.count()
    }

    #[inline(always)]
    fn encoder_latch(&mut self, line: InterruptLine) -> u32 {
        self.encoder.latch(line)
    }

    #[inline(always)]
    fn edge_phase(&mut self, line: InterruptLine) -> u16 {
        self.loop_phase.at_edge(line)
    }

    #[inline(always)]
    fn edge_waits(&mut self, line: InterruptLine) -> bool {
        interrupt_pins::edge_waits(line)
    }

    #[inline(always)]
    fn phase_now(&mut self) -> u16 {
        self.loop_phase.now()
    }

    #[inline(always)]
    fn inputs(&mut self) -> Inputs {
        inputs::read()
    }

    /// A break from the time without torque is no fault: a power stage that got its supply after us has one behind it. One that is still
    /// active is not forgotten by this and keeps the bridge off.
    #[inline(always)]
    fn set_bridge(&mut self, on: bool) {
        if on && !self.bridge.is_on() {
            self.bridge.acknowledge_trip();
        }
        self.bridge.set_on(on);
    }

    #[inline(always)]
    fn bridge_is_on(&mut self) -> bool {
        self.bridge.is_on()
    }

    fn reset_bridge(&mut self) {
        self.bridge.acknowledge_trip();
    }

    #[inline(always)]
    fn set_brake(&mut self, open: bool) {
        self.brake_coil.set_energised(open);
    }

    #[inline(always)]
    fn arm_index(&mut self) {
        self.marks.arm_index();
    }

    #[inline(always)]
    fn index_latch(&mut self) -> Option<u32> {
        self.marks.index_latch()
    }

    #[inline(always)]
    fn arm_probe(&mut self, probe: ProbeInput) {
        self.marks.arm_probe(probe);
    }

    #[inline(always)]
    fn probe_latch(&mut self, probe: ProbeInput, rising: bool) -> Option<u32> {
        self.marks.probe_latch(probe, if rising { Edge::Rising } else { Edge::Falling })
    }

    fn reset_cause(&self) -> ResetCause {
        self.reset_cause
    }
}
