//! Switching on and off: commutation angle, proof of the torque, brake, in this order and back.

use super::Motor;
use super::facts::BoardKind;
use super::fault::{MotorFault, MotorFaults};
use super::phase_test::{Finding, Look, Step};
use crate::brake::error::BrakeError;
use crate::brake::{BrakeInputs, BrakeRequest, TorqueScale};
use crate::commutation::CommutationAngle;
use crate::commutation::alignment::{Alignment, AlignmentError, AlignmentState};
use crate::commutation::index::IndexState;
use crate::units::{CurrentFraction, Position};

/// What the state of the drive asks of the sequence.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sequence {
    /// Torque on, brake open, free to move.
    Start,
    /// Brake closed, torque off, in order.
    Stop,
    /// Torque off and brake closed at once.
    Off,
}

/// How far the sequence has come.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SequenceOutput {
    /// The axis may move.
    pub released: bool,
    /// There is no torque any more, or not yet.
    pub torque_off: bool,
    /// The bridge is to switch.
    pub bridge: bool,
    /// The brake's coil is to have current.
    pub brake: bool,
    /// The velocity loop is to start with this current.
    pub preload: Option<CurrentFraction>,
    /// See [`BrakeOutput::anchor`](crate::brake::BrakeOutput::anchor).
    pub anchor: Option<CurrentFraction>,
}

/// What the sequence needs to know of the rest of the drive.
#[derive(Clone, Copy, Debug)]
pub struct SequenceInputs {
    /// What is asked of it.
    pub wanted: Sequence,
    /// The bridge switches.
    pub bridge_on: bool,
    /// The axis stands.
    pub standstill: bool,
    /// Where it is.
    pub position: Position,
    /// Torque-producing current as the loops commanded it in the last tick.
    pub torque_command: CurrentFraction,
    /// The contact of the brake says that it is open.
    pub brake_contact: bool,
    /// Motion is commanded at high torque, but nothing moves.
    pub blocked: bool,
    /// Position latched at an index pulse since the last tick.
    pub index: Option<Position>,
}

/// Ticks of the supervision in which the current sensors find their zero, three times over: 250 ms.
pub const CALIBRATION_TICKS: u16 = 500;

impl<B: BoardKind> Motor<B> {
    /// One step of the sequence.
    pub fn sequence(&mut self, inputs: &SequenceInputs, faults: &mut MotorFaults) -> SequenceOutput {
        self.correct_at_the_index(inputs.index, faults);
        let testing = self.test_phases(inputs, faults);
        let aligning = testing.is_none() && self.align(inputs, faults);
        let request = match inputs.wanted {
            Sequence::Off => BrakeRequest::Immediate,
            Sequence::Stop => BrakeRequest::Engage,
            Sequence::Start if !self.zero_is_known(faults) => BrakeRequest::Immediate,
            Sequence::Start if testing.is_some() || aligning || self.commutation.is_none() => BrakeRequest::Immediate,
            Sequence::Start => BrakeRequest::Release,
        };
        self.brake_output = self.brake.tick(
            &self.settings.brake,
            &BrakeInputs {
                request,
                bridge_on: inputs.bridge_on,
                standstill: inputs.standstill,
                position: inputs.position,
                torque_command: inputs.torque_command,
                torque_current: self.measured.torque_current,
                // A turning motor may need a field current of its own.
                field_current: self.measured.field_current.saturating_sub(self.weakened),
                contact_open: inputs.brake_contact,
                blocked: inputs.blocked,
            },
        );
        if !inputs.bridge_on {
            // What is asked of an open bridge winds up in the current loop.
            self.brake_output.torque_scale = TorqueScale::ZERO;
            self.brake_output.test_current = CurrentFraction::ZERO;
        }
        let output = self.brake_output;
        if let Some(error) = output.event {
            self.take_brake_error(error, faults);
        }
        let bridge = aligning || output.torque || testing == Some(true);
        // The order has reached the current loop by the next step: then its voltage is that of the turning rotor, and the bridge no short circuit.
        let regulated = core::mem::replace(&mut self.bridge_on, bridge);
        self.close(bridge && regulated, inputs.bridge_on);
        SequenceOutput {
            released: request == BrakeRequest::Release && output.finished,
            torque_off: !bridge,
            bridge: self.told,
            brake: output.energise || (aligning && self.settings.has_brake),
            // Only a brake hands a load over. Without one the last current may be that of an axis that was blocked: it would be thrown.
            preload: output.preload.filter(|_| self.settings.has_brake),
            anchor: output.anchor,
        }
    }

    /// The bridge is told to be closed or open. When it is told to close it does so before the next order of a tick, which is to have the
    /// flux-producing current that a fast motor needs from the beginning.
    fn close(&mut self, told: bool, bridge_on: bool) {
        let begins = !core::mem::replace(&mut self.told, told);
        let was_closed = core::mem::replace(&mut self.closed, told && (begins || bridge_on));
        if !self.closed {
            self.keep_the_field();
        } else if !was_closed {
            self.begin_to_weaken();
        }
    }

    /// The zero of the current sensors is known. It is measured while the bridge is off, which it stays until then; a zero that does not come
    /// is an error.
    fn zero_is_known(&mut self, faults: &mut MotorFaults) -> bool {
        if self.measured.calibrated {
            self.uncalibrated = 0;
            return true;
        }
        self.uncalibrated = self.uncalibrated.saturating_add(1);
        if self.uncalibrated >= CALIBRATION_TICKS {
            self.uncalibrated = 0;
            faults.add(MotorFault::CurrentSensor);
        }
        false
    }

    /// One step of the test before the torque. `None`: the sequence may go on; otherwise it may not, and the bridge is to be closed or not.
    fn test_phases(&mut self, inputs: &SequenceInputs, faults: &mut MotorFaults) -> Option<bool> {
        // Where the torque is on a load may hang on it, whatever was wanted meanwhile: the test would take it away.
        if self.brake_output.torque {
            return None;
        }
        let wanted = inputs.wanted == Sequence::Start && self.measured.calibrated && !self.refuses_to_align();
        if wanted && self.phase_test.is_over() {
            return None;
        }
        let step = self.phase_test.tick(&Look {
            wanted,
            standstill: inputs.standstill,
            bridge_on: inputs.bridge_on,
            magnets: self.commutation_angle(inputs.position).unwrap_or_default(),
            loop_time: self.loop_time,
            asked: self.direct_command,
            readings: self.measured.readings,
            angle: self.link.report.cycle(true).readings.angle(),
        });
        let tested = core::mem::replace(&mut self.tested, matches!(step, Step::Flow(..)));
        match step {
            Step::Flow(angle, current) => self.aligning = Some((angle, current, CurrentFraction::ZERO)),
            // The search for the angle may have the currents by then.
            _ if tested => self.aligning = None,
            _ => {}
        }
        match step {
            Step::Over => None,
            Step::Flow(..) => Some(true),
            Step::Failed(finding) => {
                match finding {
                    Some(Finding::Open) => faults.add(MotorFault::OpenPhase),
                    Some(Finding::Nothing) => faults.add(MotorFault::CurrentSensor),
                    None => {}
                }
                Some(false)
            }
        }
    }

    /// Has the commutation angle searched for when torque is wanted and the angle is not known. Returns whether that is under way.
    fn align(&mut self, inputs: &SequenceInputs, faults: &mut MotorFaults) -> bool {
        if inputs.wanted != Sequence::Start || self.commutation.is_some() {
            self.alignment = None;
            self.alignment_error = None;
            self.aligning = None;
            return false;
        }
        if !self.measured.calibrated {
            self.alignment = None;
            self.aligning = None;
            return false;
        }
        if self.refuses_to_align() {
            faults.add(MotorFault::Commutation);
            return false;
        }
        if let Some(error) = self.alignment_error.take() {
            faults.add(match error {
                AlignmentError::NoMovement => MotorFault::AlignmentNoMovement,
                AlignmentError::WrongDirection => MotorFault::AlignmentDirection,
                AlignmentError::PhaseMissing => MotorFault::OpenPhase,
                _ => MotorFault::Alignment,
            });
            return false;
        }
        if self.alignment.is_none() {
            self.alignment = Some(Alignment::start(self.settings.alignment, inputs.position));
            // The bridge is on its way.
            self.aligning = Some((0, CurrentFraction::ZERO, CurrentFraction::ZERO));
        }
        true
    }

    /// Without an angle there is no torque to hold a load with, and the load may be a vertical one.
    const fn refuses_to_align(&self) -> bool {
        self.commutation.is_none() && self.settings.has_brake && !self.settings.aligns_with_open_brake
    }

    /// A search for the commutation angle is under way.
    #[inline]
    pub const fn is_searching(&self) -> bool {
        self.alignment.is_some()
    }

    /// One loop tick of the search, while the bridge switches.
    pub fn search(&mut self, position: Position) {
        let Some(alignment) = &mut self.alignment else { return };
        let output = alignment.tick(position);
        match output.state {
            AlignmentState::Running => {
                self.aligning = Some((output.angle, output.id, output.iq));
                return;
            }
            AlignmentState::Done => {
                self.commutation = Some(CommutationAngle::new(self.settings.commutation, position, output.angle));
                self.index_armed = true;
            }
            AlignmentState::Failed(error) => self.alignment_error = Some(error),
        }
        self.alignment = None;
        self.aligning = None;
    }

    fn correct_at_the_index(&mut self, index: Option<Position>, faults: &mut MotorFaults) {
        let Some(commutation) = &mut self.commutation else { return };
        if !self.index_armed {
            return;
        }
        let output = self.index.tick(index.map(|position| commutation.at(position)));
        commutation.correct(output.correction);
        match output.state {
            IndexState::Waiting | IndexState::Correcting => {}
            IndexState::Failed(_) => {
                self.index_armed = false;
                faults.add(MotorFault::Commutation);
            }
            _ => self.index_armed = false,
        }
    }

    /// A bridge that does not answer is the amplifier's doing. What is the brake's can only be told where there is one.
    fn take_brake_error(&mut self, error: BrakeError, faults: &mut MotorFaults) {
        match error {
            BrakeError::BridgeOff | BrakeError::TorqueLost => faults.add(MotorFault::Bridge),
            _ if error.is_warning() || !self.settings.has_brake => {}
            _ => faults.add(MotorFault::Brake),
        }
    }

    /// How well the commutation angle is known (P-0-0119): 0 not at all, 1 aligned or given, 2 by the index.
    pub fn commutation_state(&self) -> u16 {
        match (&self.commutation, self.index_armed) {
            (None, _) => 0,
            (Some(_), true) => 1,
            (Some(_), false) => 2,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::example::{self, Example};
    use super::super::link::{CurrentLink, set};
    use super::*;
    use crate::brake::settings::{BrakeParameters, BrakeSettings};
    use crate::current::command::CurrentCommand;
    use crate::units::Velocity;

    static LINKS: [CurrentLink; 6] = [const { CurrentLink::new() }; 6];

    const START: SequenceInputs = SequenceInputs {
        wanted: Sequence::Start,
        bridge_on: false,
        standstill: true,
        position: Position::ZERO,
        torque_command: CurrentFraction::ZERO,
        brake_contact: false,
        blocked: false,
        index: None,
    };

    fn with_a_known_angle(link: &'static CurrentLink) -> Motor<Example> {
        let mut motor = Motor::new(link, example::settings());
        motor.set_commutation_angle(Position::ZERO, Some(0));
        motor
    }

    fn report_a_zero(link: &'static CurrentLink, motor: &mut Motor<Example>) {
        link.report.tell(&link.report.calibrated, 1);
        set(&link.report.cycle(true).count, 0);
        motor.measure();
    }

    #[test]
    fn without_the_zero_of_its_current_sensors_nothing_is_switched_on_and_that_is_told() {
        let mut motor = with_a_known_angle(&LINKS[0]);
        for tick in 1..=CALIBRATION_TICKS {
            let mut faults = MotorFaults::NONE;
            let output = motor.sequence(&START, &mut faults);
            assert!(!output.bridge && output.torque_off && !output.brake && !output.released, "{tick}");
            assert_eq!(!faults.is_empty(), tick == CALIBRATION_TICKS, "{tick}");
        }
        report_a_zero(&LINKS[0], &mut motor);
        let mut faults = MotorFaults::NONE;
        let orders = [(); 2].map(|()| motor.sequence(&START, &mut faults).bridge);
        assert!(orders[1] && faults.is_empty());
    }

    #[test]
    fn the_order_to_regulate_is_a_step_ahead_of_the_bridge_and_asks_for_no_current_until_it_is_closed() {
        let mut motor = with_a_known_angle(&LINKS[1]);
        report_a_zero(&LINKS[1], &mut motor);
        let turning = SequenceInputs { standstill: false, ..START };
        let mut faults = MotorFaults::NONE;
        // What turns is not tested before.
        let ordered = motor.sequence(&turning, &mut faults);
        assert!(!ordered.bridge && !ordered.torque_off && motor.bridge_on);
        for bridge_on in [false, true] {
            let closed = motor.sequence(&SequenceInputs { bridge_on, ..START }, &mut faults);
            assert!(closed.bridge);
            let asked = motor.brake_output.test_current != CurrentFraction::ZERO
                || motor.brake_output.torque_scale != TorqueScale::ZERO;
            assert_eq!(asked, bridge_on);
        }
        let off = motor.sequence(&SequenceInputs { wanted: Sequence::Off, bridge_on: true, ..START }, &mut faults);
        assert!(!off.bridge && off.torque_off, "off at once");
    }

    /// Of the peak current: what the load asks for.
    const LOAD: CurrentFraction = CurrentFraction::lit("0.3");

    /// A load of 9.81 m/s² that falls where neither its brake nor the current of the loops holds it, with a motor that gives what is asked for.
    struct Vertical {
        motor: Motor<Example>,
        inputs: SequenceInputs,
        faults: MotorFaults,
        /// The brake does not close any more, and its contact says so.
        stuck: bool,
        /// Steps since the coil has had no current.
        closing: u32,
        /// m/s and m.
        speed: f64,
        sunk: f64,
    }

    /// Steps of the supervision until the brake holds, 25 ms.
    const CLOSES_IN: u32 = 50;

    impl Vertical {
        /// In operation, after a test of its phases.
        fn released(link: &'static CurrentLink) -> Self {
            let mut settings = example::settings();
            settings.has_brake = true;
            settings.brake = BrakeSettings::new(&BrakeParameters {
                fitted: true,
                contact_fitted: true,
                drive_on_delay: 40,
                drive_off_delay: 30,
                maximum_drive_off_delay: 1_000,
                proof_current: CurrentFraction::lit("0.1"),
                proof_tolerance: CurrentFraction::lit("0.05"),
                proof_time: 2,
                proof_limit: 100,
                hold_test_time: 100,
                hold_window: Position::from_bits(1 << 24),
                stuck_time: 500,
            })
            .unwrap();
            let mut motor = Motor::new(link, settings);
            motor.set_commutation_angle(Position::ZERO, Some(0));
            motor.measured.calibrated = true;
            let faults = MotorFaults::NONE;
            let inputs = SequenceInputs { torque_command: LOAD, ..START };
            let mut axis = Self { motor, inputs, faults, stuck: false, closing: u32::MAX, speed: 0.0, sunk: 0.0 };
            let tested = axis.steps(Sequence::Start, 20).filter(|&(_, tests)| tests).count();
            assert!((8..12).contains(&tested), "{tested} steps of the test at the first time");
            assert!(axis.steps(Sequence::Start, 180).last().unwrap().0.released);
            axis
        }

        /// A step of the supervision: its output, and whether the phases were tested.
        fn step(&mut self, wanted: Sequence) -> (SequenceOutput, bool) {
            let output = self.motor.sequence(&SequenceInputs { wanted, ..self.inputs }, &mut self.faults);
            self.inputs.bridge_on = output.bridge;
            self.motor.command(Position::ZERO, LOAD, Velocity::ZERO, 0);
            let (direct, quadrature) = (self.motor.direct_command, self.motor.commanded);
            let measured = &mut self.motor.measured;
            measured.readings.direct = CurrentCommand::reference(direct);
            (measured.field_current, measured.torque_current) = (direct, quadrature);
            self.closing = if output.brake || self.stuck { 0 } else { self.closing.saturating_add(1) };
            self.inputs.brake_contact = self.closing < CLOSES_IN;
            let carried = if output.bridge { f64::from(quadrature.to_bits()) / f64::from(LOAD.to_bits()) } else { 0.0 };
            self.speed = if self.inputs.brake_contact { self.speed + 9.81 * (1.0 - carried) * 500e-6 } else { 0.0 };
            self.sunk += self.speed * 500e-6;
            (output, self.motor.aligning.is_some())
        }

        fn steps(&mut self, wanted: Sequence, number: usize) -> impl Iterator<Item = (SequenceOutput, bool)> {
            (0..number).map(move |_| self.step(wanted))
        }

        /// Wanted so for so many steps, the load hangs on its current, and nothing but the loops has it.
        fn holds(&mut self, wanted: Sequence, number: usize) {
            for step in 0..number {
                let (output, tests) = self.step(wanted);
                assert!(output.bridge && !output.torque_off && !tests, "{wanted:?}, step {step}: {output:?}");
                assert_eq!(self.motor.brake_output.torque_scale, TorqueScale::ONE, "{wanted:?}, step {step}");
                assert!(self.sunk.abs() < 1e-9, "{wanted:?}, step {step}: sunk by {} mm", self.sunk * 1e3);
            }
        }
    }

    #[test]
    fn a_load_whose_brake_is_still_closing_stays_on_its_current_when_torque_is_wanted_again() {
        // Before the brake holds, when it just does, and at every step in between.
        for stopped in 1..=usize::try_from(CLOSES_IN).unwrap() {
            let mut axis = Vertical::released(&LINKS[2]);
            axis.holds(Sequence::Stop, stopped);
            axis.holds(Sequence::Start, 400);
            assert!(axis.step(Sequence::Start).0.released && axis.faults.is_empty(), "{stopped}");
        }
    }

    #[test]
    fn a_load_that_only_its_current_holds_stays_on_it_when_torque_is_wanted_again() {
        let mut axis = Vertical::released(&LINKS[3]);
        axis.stuck = true;
        // The brake's 1 s are over: from then on it is held by the torque.
        axis.holds(Sequence::Stop, 2_100);
        assert!(axis.faults.contains(MotorFault::Brake));
        // S-0-0099, and a new edge.
        axis.faults = MotorFaults::NONE;
        axis.holds(Sequence::Start, 400);
        assert!(axis.step(Sequence::Start).0.released && axis.faults.is_empty());
    }

    #[test]
    fn phases_are_tested_again_when_the_torque_has_been_off() {
        let mut axis = Vertical::released(&LINKS[4]);
        // At once, and in order.
        for (off, steps) in [(Sequence::Off, 2), (Sequence::Stop, 1_000), (Sequence::Off, 100)] {
            let last = axis.steps(off, steps).last().unwrap();
            assert!(last.0.torque_off && !last.0.bridge, "{off:?}");
            let tested = axis.steps(Sequence::Start, 20).filter(|&(_, tests)| tests).count();
            assert!((8..12).contains(&tested), "{off:?}: {tested} steps of the test");
            assert!(axis.steps(Sequence::Start, 180).last().unwrap().0.released, "{off:?}");
        }
        assert!(axis.faults.is_empty());
    }

    #[test]
    fn a_test_that_was_broken_off_is_made_from_its_beginning() {
        let mut axis = Vertical::released(&LINKS[5]);
        axis.steps(Sequence::Off, 100).last().unwrap();
        assert!(axis.steps(Sequence::Start, 4).last().unwrap().1, "under way");
        assert!(!axis.step(Sequence::Stop).1);
        let tested = axis.steps(Sequence::Start, 20).filter(|&(_, tests)| tests).count();
        assert!((7..12).contains(&tested), "{tested} steps of the test");
        assert!(axis.faults.is_empty());
    }
}
