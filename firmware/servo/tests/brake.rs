//! The sequence of the holding brake with an ideal drive around it.

use proptest::prelude::*;
use servo::brake::{
    BrakeError, BrakeInputs, BrakeOutput, BrakeParameters, BrakeRequest, BrakeSequencer, BrakeSettings,
};
use servo::units::{CurrentFraction, Position};

/// 20 and 30 ms, test current 5 % within 2 %, 2 ms, 50 ms; ramp and watch 40 ms; window 1/256 revolution.
const PARAMETERS: BrakeParameters = BrakeParameters {
    fitted: true,
    contact_fitted: false,
    drive_on_delay: 20,
    drive_off_delay: 30,
    maximum_drive_off_delay: 100,
    proof_current: CurrentFraction::lit("0.05"),
    proof_tolerance: CurrentFraction::lit("0.02"),
    proof_time: 2,
    proof_limit: 50,
    hold_test_time: 40,
    hold_window: Position::from_bits(1 << 24),
    stuck_time: 10,
};
const WITH_CONTACT: BrakeParameters = BrakeParameters { contact_fitted: true, ..PARAMETERS };

/// A sequence with an ideal drive around it: the bridge and the field current follow.
struct Bench {
    settings: BrakeSettings,
    sequencer: BrakeSequencer,
    inputs: BrakeInputs,
    output: BrakeOutput,
    events: Vec<BrakeError>,
}

impl Bench {
    fn new(parameters: BrakeParameters) -> Self {
        let settings = BrakeSettings::new(&parameters).unwrap();
        let mut sequencer = BrakeSequencer::new();
        let inputs = BrakeInputs {
            request: BrakeRequest::Engage,
            bridge_on: false,
            standstill: true,
            position: Position::ZERO,
            torque_command: CurrentFraction::ZERO,
            torque_current: CurrentFraction::ZERO,
            field_current: CurrentFraction::ZERO,
            contact_open: false,
            blocked: false,
        };
        let output = sequencer.tick(&settings, &inputs);
        Self { settings, sequencer, inputs, output, events: Vec::new() }
    }

    fn tick(&mut self) {
        self.inputs.bridge_on = self.output.torque;
        self.inputs.field_current = self.output.test_current;
        self.output = self.sequencer.tick(&self.settings, &self.inputs);
        self.events.extend(self.output.event);
    }

    /// Ticks of 500 us until `reached`, at most a second.
    fn until(&mut self, reached: impl Fn(&BrakeOutput) -> bool) -> u32 {
        (1..=2_000)
            .find(|_| {
                self.tick();
                reached(&self.output)
            })
            .expect("within a second")
    }

    fn run(&mut self, ticks: u32) {
        (0..ticks).for_each(|_| self.tick());
    }

    fn released(parameters: BrakeParameters) -> Self {
        let mut bench = Self::new(parameters);
        bench.inputs.request = BrakeRequest::Release;
        bench.inputs.contact_open = true;
        bench.until(|output| output.finished);
        bench.events.clear();
        bench
    }
}

#[test]
fn switching_on_takes_proof_and_delay_in_this_order() {
    let mut bench = Bench::new(PARAMETERS);
    assert_eq!((bench.output.torque, bench.output.energise, bench.output.finished), (false, false, true));
    bench.inputs.request = BrakeRequest::Release;
    bench.tick();
    assert!(bench.output.torque && bench.output.hold && !bench.output.energise && !bench.output.finished);
    assert_eq!(bench.output.test_current, PARAMETERS.proof_current);
    assert_eq!(bench.until(|output| output.energise), 4, "2 ms of proof");
    assert!(bench.output.hold);
    assert_eq!(bench.output.test_current, CurrentFraction::ZERO);
    assert_eq!(bench.until(|output| !output.hold), 40, "S-0-0206");
    assert!(bench.output.finished && bench.events.is_empty());
}

#[test]
fn a_current_that_does_not_follow_keeps_the_brake_closed() {
    for (bridge, field, torque, error) in [
        (false, 0.05, 0.0, BrakeError::BridgeOff),
        (true, 0.0, 0.0, BrakeError::TorqueNotProven { expected: 49, actual: 0 }),
        (true, 0.029, 0.0, BrakeError::TorqueNotProven { expected: 49, actual: 28 }),
        (true, 0.05, 0.025, BrakeError::TorqueNotProven { expected: 49, actual: 49 }),
    ] {
        let mut bench = Bench::new(PARAMETERS);
        bench.inputs.request = BrakeRequest::Release;
        bench.tick();
        bench.inputs.bridge_on = bridge;
        bench.inputs.field_current = CurrentFraction::from_num(field);
        bench.inputs.torque_current = CurrentFraction::from_num(torque);
        for tick in 1..=100 {
            bench.output = bench.sequencer.tick(&bench.settings, &bench.inputs);
            assert!(!bench.output.energise);
            assert_eq!(bench.output.event, (tick == 100).then_some(error));
        }
        assert!(!bench.output.torque);
        bench.run(1_000);
        assert!(!bench.output.torque, "not again before the request went");
        bench.inputs.request = BrakeRequest::Engage;
        bench.tick();
        bench.inputs.request = BrakeRequest::Release;
        bench.inputs.torque_current = CurrentFraction::ZERO;
        bench.until(|output| output.finished);
    }
}

#[test]
fn a_gap_in_the_proof_starts_it_again() {
    let mut bench = Bench::new(PARAMETERS);
    bench.inputs.request = BrakeRequest::Release;
    bench.run(4);
    bench.inputs.torque_current = CurrentFraction::from_num(0.1);
    bench.tick();
    bench.inputs.torque_current = CurrentFraction::ZERO;
    assert_eq!(bench.until(|output| output.energise), 4);
}

#[test]
fn switching_off_takes_delay_ramp_and_watch_in_this_order() {
    let mut bench = Bench::released(PARAMETERS);
    bench.inputs.request = BrakeRequest::Engage;
    bench.inputs.standstill = false;
    bench.run(25);
    assert!(bench.output.energise && !bench.output.hold, "it still stops");
    bench.inputs.standstill = true;
    bench.tick();
    assert!(!bench.output.energise && bench.output.torque && bench.output.hold);
    assert_eq!(bench.until(|output| output.torque_scale < 1), 61, "S-0-0207, then the ramp");
    assert_eq!(bench.until(|output| output.torque_scale < 0.5), 39);
    assert_eq!(bench.until(|output| output.torque_scale == 0), 40);
    assert_eq!(bench.until(|output| !output.torque), 80, "watched without torque");
    assert!(bench.output.finished && bench.events.is_empty());
}

#[test]
fn an_axis_that_moves_in_its_brake_gets_its_torque_back() {
    for (moved, holds) in [(1 << 24, true), ((1 << 24) + 1, false), (-(1 << 24) - 1, false)] {
        let mut bench = Bench::released(PARAMETERS);
        bench.inputs.request = BrakeRequest::Engage;
        bench.inputs.position = Position::from_bits(77);
        bench.until(|output| output.torque_scale < 0.25);
        bench.inputs.position = Position::from_bits(77 + moved);
        bench.run(1_000);
        if holds {
            assert!(!bench.output.torque && bench.events.is_empty());
            continue;
        }
        let (expected, actual) = (Position::from_bits(1 << 24), Position::from_bits(i64::abs(moved)));
        assert_eq!(bench.events, [BrakeError::BrakeDoesNotHold { expected, actual }]);
        assert!(bench.output.torque && bench.output.hold && !bench.output.energise && !bench.output.finished);
        assert_eq!(bench.output.torque_scale, 1);
        bench.inputs.request = BrakeRequest::Release;
        bench.tick();
        assert!(bench.output.energise, "to be lowered under control");
        assert_eq!(bench.until(|output| !output.hold), 40);
    }
}

#[test]
fn a_slow_contact_is_a_warning_and_a_silent_one_an_error() {
    // S-0-0206 is 40 ticks.
    for (answer, event) in [
        (25, None),
        (40, None),
        (42, Some(BrakeError::ReleaseSlow { expected: 20, actual: 21 })),
        (79, Some(BrakeError::ReleaseSlow { expected: 20, actual: 39 })),
        (81, Some(BrakeError::NotReleased { expected: 40 })),
    ] {
        let mut bench = Bench::new(WITH_CONTACT);
        bench.inputs.request = BrakeRequest::Release;
        bench.until(|output| output.energise);
        bench.run(answer - 1);
        bench.inputs.contact_open = true;
        bench.run(50);
        assert_eq!(bench.events, Vec::from_iter(event), "contact after {answer} ticks");
        let failed = event.is_some_and(|event| !event.is_warning());
        assert_eq!(bench.output.finished, !failed);
        assert_eq!(bench.output.energise, !failed);
        assert!(bench.output.torque);
    }
}

#[test]
fn a_brake_that_is_slow_or_silent_when_it_closes_never_takes_the_torque_early() {
    // S-0-0207 is 60 ticks.
    for (answer, event) in [
        (60, None),
        (62, Some(BrakeError::EngageSlow { expected: 30, actual: 31 })),
        (119, Some(BrakeError::EngageSlow { expected: 30, actual: 59 })),
        (121, Some(BrakeError::NotEngaged { expected: 60 })),
    ] {
        let mut bench = Bench::released(WITH_CONTACT);
        bench.inputs.request = BrakeRequest::Engage;
        bench.until(|output| !output.energise);
        bench.run(answer - 1);
        assert_eq!(bench.output.torque_scale, 1);
        bench.inputs.contact_open = false;
        bench.run(1_000);
        assert_eq!(bench.events, Vec::from_iter(event), "contact after {answer} ticks");
        assert_eq!(bench.output.torque, event.is_some_and(|event| !event.is_warning()), "held by torque");
    }
}

#[test]
fn a_current_at_the_end_of_its_tolerance_follows_and_one_beyond_does_not() {
    for (less, follows) in [(655, true), (656, false)] {
        let mut bench = Bench::new(PARAMETERS);
        assert_eq!(PARAMETERS.proof_tolerance.to_bits(), 655);
        bench.inputs.request = BrakeRequest::Release;
        bench.tick();
        bench.inputs.bridge_on = true;
        bench.inputs.field_current = CurrentFraction::from_bits(PARAMETERS.proof_current.to_bits() - less);
        for _ in 0..10 {
            bench.output = bench.sequencer.tick(&bench.settings, &bench.inputs);
        }
        assert_eq!(bench.output.energise, follows, "{less}");
    }
}

#[test]
fn a_brake_that_stays_closed_is_found_wherever_the_axis_stands() {
    for revolutions in [-3, 7] {
        let mut bench = Bench::new(PARAMETERS);
        bench.inputs.position = Position::from_bits(revolutions << 32);
        bench.inputs.request = BrakeRequest::Release;
        bench.until(|output| output.finished);
        bench.inputs.blocked = true;
        bench.run(20);
        let error = BrakeError::BrakeStuck { expected: PARAMETERS.hold_window, actual: Position::ZERO };
        assert_eq!(bench.events, [error], "{revolutions}");
    }
}

#[test]
fn a_brake_that_stays_closed_is_found_in_the_first_motion_only() {
    let mut bench = Bench::released(PARAMETERS);
    bench.inputs.blocked = true;
    bench.inputs.position = Position::from_bits(1 << 24);
    bench.run(19);
    assert!(bench.events.is_empty());
    bench.tick();
    let window = Position::from_bits(1 << 24);
    assert_eq!(bench.events, [BrakeError::BrakeStuck { expected: window, actual: window }]);
    assert!(bench.output.torque && !bench.output.energise && bench.output.hold);
    bench.until(|output| !output.torque);
    bench.run(1_000);
    assert!(!bench.output.torque, "locked");

    let mut bench = Bench::released(PARAMETERS);
    bench.inputs.position = Position::from_bits((1 << 24) + 1);
    bench.tick();
    bench.inputs.blocked = true;
    bench.run(1_000);
    assert!(bench.events.is_empty() && bench.output.finished, "it has moved: what blocks it is not the brake");
}

#[test]
fn an_axis_that_does_not_stop_is_braked_after_the_maximum_delay() {
    let mut bench = Bench::released(PARAMETERS);
    bench.inputs.request = BrakeRequest::Engage;
    bench.inputs.standstill = false;
    assert_eq!(bench.until(|output| !output.energise), 200);
    assert_eq!(bench.events, [BrakeError::NoStandstill { expected: 100 }]);
    assert!(bench.output.torque);
    let mut patient = Bench::released(BrakeParameters { maximum_drive_off_delay: 0, ..PARAMETERS });
    patient.inputs.request = BrakeRequest::Engage;
    patient.inputs.standstill = false;
    patient.run(20_000);
    assert!(patient.output.energise && patient.events.is_empty());
}

#[test]
fn switching_on_again_while_the_brake_closes_opens_it_again_without_a_gap_in_the_torque() {
    let mut bench = Bench::released(PARAMETERS);
    bench.inputs.request = BrakeRequest::Engage;
    bench.run(12);
    bench.inputs.request = BrakeRequest::Release;
    bench.tick();
    assert!(bench.output.energise && bench.output.torque && bench.output.hold);
    assert_eq!(bench.until(|output| output.finished), 40, "the whole delay");
}

#[test]
fn an_immediate_request_and_a_lost_bridge_close_the_brake_in_the_same_tick_in_every_state() {
    let mut kinds = Vec::new();
    let mut bench = Bench::new(PARAMETERS);
    bench.inputs.request = BrakeRequest::Release;
    for tick in 0..350 {
        if tick == 75 {
            bench.inputs.request = BrakeRequest::Engage;
        }
        bench.tick();
        let mut sequencer = bench.sequencer;
        let at_once = BrakeInputs { request: BrakeRequest::Immediate, ..bench.inputs };
        let output = sequencer.tick(&bench.settings, &at_once);
        assert!(!output.torque && !output.energise && output.finished && output.torque_scale == 0);

        let BrakeOutput { torque, energise, hold, test_current, .. } = bench.output;
        let mut sequencer = bench.sequencer;
        let output = sequencer.tick(&bench.settings, &BrakeInputs { bridge_on: false, ..bench.inputs });
        if torque && test_current == 0 {
            assert_eq!(output.event, Some(BrakeError::TorqueLost));
            assert!(!output.energise && !output.torque);
        }
        let kind = (torque, energise, hold);
        if kinds.last() != Some(&kind) {
            kinds.push(kind);
        }
    }
    let (proving, opening, open, off) =
        ((true, false, true), (true, true, true), (true, true, false), (false, false, true));
    assert_eq!(kinds, [proving, opening, open, proving, off], "closing looks like proving");
}

#[test]
fn without_a_brake_there_is_nothing_to_prove_but_the_bridge_has_to_answer() {
    let mut bench = Bench::new(BrakeParameters { fitted: false, contact_fitted: true, ..PARAMETERS });
    bench.inputs.request = BrakeRequest::Release;
    // A current that does not follow at all, as near the voltage limit.
    bench.inputs.torque_current = CurrentFraction::from_num(0.5);
    bench.tick();
    assert_eq!(bench.output.test_current, CurrentFraction::ZERO);
    assert_eq!(bench.until(|output| output.finished), 1, "the bridge is seen to switch, and the axis is free");
    assert!(!bench.output.energise);
    bench.inputs.blocked = true;
    bench.run(1_000);
    assert!(bench.events.is_empty() && bench.output.finished);
    bench.inputs.request = BrakeRequest::Engage;
    bench.tick();
    assert!(bench.output.finished && !bench.output.torque);

    let mut bench = Bench::new(BrakeParameters { fitted: false, ..PARAMETERS });
    bench.inputs.request = BrakeRequest::Release;
    bench.tick();
    bench.inputs.bridge_on = false;
    for tick in 1..=100 {
        bench.output = bench.sequencer.tick(&bench.settings, &bench.inputs);
        assert_eq!(bench.output.event, (tick == 100).then_some(BrakeError::BridgeOff));
    }
    assert!(!bench.output.torque);
}

#[test]
fn the_torque_comes_back_with_the_current_that_held_the_axis() {
    let mut bench = Bench::released(PARAMETERS);
    bench.inputs.torque_command = CurrentFraction::from_num(-0.3);
    bench.inputs.torque_current = bench.inputs.torque_command;
    bench.run(1_000);
    bench.inputs.request = BrakeRequest::Engage;
    bench.run(10);
    bench.inputs.torque_command = CurrentFraction::ZERO;
    bench.inputs.torque_current = CurrentFraction::ZERO;
    bench.until(|output| !output.torque);
    bench.inputs.request = BrakeRequest::Release;
    bench.tick();
    let preload = bench.output.preload.unwrap().to_num::<f64>();
    assert!((preload + 0.3).abs() < 0.000_1, "{preload}");
    bench.tick();
    assert_eq!(bench.output.preload, None, "once");
    bench.until(|output| output.energise);
    let anchor = bench.output.anchor.unwrap().to_num::<f64>();
    assert!((anchor + 0.3).abs() < 0.000_1, "it holds its place with that when the brake opens: {anchor}");
    bench.tick();
    assert_eq!(bench.output.anchor, None, "once");
}

#[test]
fn a_brake_that_is_still_closing_is_waited_for_when_the_proof_is_given_up() {
    // S-0-0207, the test of the brake and the ramp that unloads the motor: 60, 80 and 80 ticks.
    for (closed_for, waits) in [(10, 221), (58, 221), (60, 1), (200, 1)] {
        let mut bench = Bench::released(PARAMETERS);
        bench.inputs.request = BrakeRequest::Immediate;
        bench.run(closed_for);
        assert!(!bench.output.torque && !bench.output.energise);
        bench.inputs.request = BrakeRequest::Release;
        bench.tick();
        assert!(bench.output.torque);
        bench.inputs.request = BrakeRequest::Engage;
        assert_eq!(bench.until(|output| !output.torque), waits, "{closed_for}");
    }
}

#[test]
fn impossible_settings_are_refused() {
    let refused = |parameters| BrakeSettings::new(&parameters).is_err();
    assert!(refused(BrakeParameters { proof_current: CurrentFraction::ZERO, ..PARAMETERS }));
    assert!(refused(BrakeParameters { proof_tolerance: PARAMETERS.proof_current, ..PARAMETERS }));
    assert!(refused(BrakeParameters { proof_time: 0, ..PARAMETERS }));
    assert!(refused(BrakeParameters { proof_limit: 2, ..PARAMETERS }));
    assert!(refused(BrakeParameters { hold_test_time: 0, ..PARAMETERS }));
    assert!(refused(BrakeParameters { hold_window: Position::ZERO, ..PARAMETERS }));
    assert!(refused(BrakeParameters { stuck_time: 0, ..PARAMETERS }));
    assert!(!refused(BrakeParameters { drive_on_delay: 0, drive_off_delay: 0, ..PARAMETERS }));
}

fn request() -> impl Strategy<Value = BrakeRequest> {
    prop_oneof![6 => Just(BrakeRequest::Release), 6 => Just(BrakeRequest::Engage), 1 => Just(BrakeRequest::Immediate)]
}

proptest! {
    // A test outside the library has no place for its regressions.
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    /// The contract, for any inputs at any time.
    #[test]
    fn torque_never_leaves_before_the_brake_holds_and_the_brake_never_opens_before_torque_is_proven(
        contact_fitted in any::<bool>(),
        on_delay in 0_u16..30, off_delay in 0_u16..30,
        steps in proptest::collection::vec(
            (request(), 1_u32..225, any::<bool>(), any::<bool>(), 0_i64..1 << 25, prop::bool::weighted(0.03), any::<bool>()), 1..40,
        ),
    ) {
        let mut bench = Bench::new(BrakeParameters {
            contact_fitted, drive_on_delay: on_delay, drive_off_delay: off_delay, ..PARAMETERS
        });
        let (mut closed_for, mut proven_for, mut still_for) = (u32::MAX, 0_u32, 0_u32);
        let mut opened = false;
        for (request, ticks, standstill, contact, position, bridge_fails, blocked) in steps {
            for tick in 0..ticks {
                let before = bench.output;
                let moved_to = Position::from_bits(position);
                still_for = if bench.inputs.position == moved_to { still_for + 1 } else { 0 };
                bench.inputs = BrakeInputs {
                    request, standstill, contact_open: contact, position: moved_to, blocked,
                    bridge_on: before.torque && !(bridge_fails && tick == 0),
                    field_current: before.test_current, ..bench.inputs
                };
                bench.output = bench.sequencer.tick(&bench.settings, &bench.inputs);
                let output = bench.output;
                // the current has followed so long up to this tick
                let proving = before.test_current > 0 && bench.inputs.bridge_on;
                if proving { proven_for += 1 } else if !before.torque || !bench.inputs.bridge_on { proven_for = 0 }
                if output.energise && !before.energise {
                    prop_assert!(output.torque && output.hold && proven_for >= 4, "opened after {} ticks", proven_for);
                    opened = true;
                }
                closed_for = if output.energise { 0 } else { closed_for.saturating_add(1) };
                let orderly = request != BrakeRequest::Immediate && bench.inputs.bridge_on;
                if before.torque && !output.torque && orderly && opened {
                    let least = u32::from(off_delay) * 2 + 160;
                    prop_assert!(closed_for >= least, "torque off {} ticks after the brake, {} needed", closed_for, least);
                    prop_assert_eq!(before.torque_scale, 0);
                }
                if !output.torque { opened = false; }
                prop_assert!(output.hold || output.energise, "moves only with an open brake");
                prop_assert!(output.torque || !output.energise, "never open without torque");
                prop_assert!(output.torque_scale == 1 || !output.energise, "never open with less than the whole torque");
                if output.event.is_some_and(|event| !event.is_warning()) {
                    prop_assert!(!output.finished || request == BrakeRequest::Engage);
                }
            }
        }
    }
}

#[test]
fn a_zero_that_moves_is_no_movement_of_an_axis_that_its_brake_holds() {
    for ticks in [1, 59, 61, 100, 200] {
        let mut bench = Bench::released(PARAMETERS);
        bench.inputs.request = BrakeRequest::Engage;
        bench.run(ticks);
        let zero = Position::from_bits(-(555 << 32));
        bench.inputs.position = bench.inputs.position + zero;
        bench.sequencer.shift(zero);
        bench.until(|output| output.finished);
        assert!(!bench.output.torque && bench.events.is_empty(), "{ticks}: {:?}", bench.events);
    }
    // Nor does it show that a brake has opened.
    let mut bench = Bench::released(PARAMETERS);
    let zero = Position::from_bits(555 << 32);
    bench.inputs.position = bench.inputs.position + zero;
    bench.sequencer.shift(zero);
    bench.inputs.blocked = true;
    bench.run(40);
    assert!(matches!(bench.events[..], [BrakeError::BrakeStuck { .. }]), "{:?}", bench.events);
}
