//! Position commands that jump, over the ring: what is followed starts at the shaft, and goes on as fast as S-0-0091 allows.

use crate::led::{Axis, FOLLOW, HALT, OFF};
use ring::fibre::TelegramKind;
use ring::ident::{Idn, Value};

const EXCESSIVE_DEVIATION: u16 = 1 << 11;
const MANUFACTURER: u16 = 1 << 15;
const TOO_FAR: u16 = 0xF10B;
const JUMPED: u16 = 0xF11B;

#[test]
fn a_position_command_a_revolution_away_within_a_cycle_moves_nothing() {
    for mode in [3, 11] {
        let mut axis = Axis::in_mode(mode);
        let before = axis.degrees();
        axis.position(360.0);
        axis.run(500);
        let moved = axis.degrees() - before;
        assert!(moved.abs() < 0.1 && axis.fastest < 2.0, "mode {mode}: {moved} degrees, {} rpm", axis.fastest);
        assert!(!axis.bench.has_torque());
        assert_eq!(axis.diagnosis(), (MANUFACTURER, JUMPED), "mode {mode}");
        assert_eq!(axis.bench.number(129), 1 << 12);
        assert!(axis.bench.text(95).contains("jump"), "{}", axis.bench.text(95));
    }
}

#[test]
fn a_step_up_to_what_s_0_0091_moves_in_a_cycle_and_a_quarter_is_followed_and_more_is_an_error() {
    // 300 rpm: 3.6 degrees a cycle; the margin makes 4.5.
    for (step, taken) in [(4.4, true), (4.6, false), (-4.4, true), (-4.6, false)] {
        let mut axis = Axis::with(11, vec![(Idn(91), Value::Long(3_000_000))]);
        let before = axis.degrees();
        axis.position(step);
        axis.run(300);
        let moved = axis.degrees() - before;
        let expected = if taken { step } else { 0.0 };
        assert!((moved - expected).abs() < 0.1, "{step}: {moved} degrees");
        assert_eq!(axis.bench.number(11), if taken { 0 } else { MANUFACTURER.into() }, "{step}");
        assert_eq!(axis.bench.has_torque(), taken, "{step}");
    }
}

#[test]
fn a_jump_at_speed_stops_on_the_ramp_from_the_measured_speed() {
    let mut axis = Axis::in_mode(11);
    for cycle in 1..=200 {
        axis.position(match cycle {
            ..=100 => 7.2 * 0.005 * f64::from(cycle * cycle),
            _ => 7.2 * (f64::from(cycle) - 50.0),
        });
        axis.run(2);
    }
    let turned = axis.degrees();
    axis.fastest = 0.0;
    axis.position(7.2 * 151.0 + 200.0);
    axis.run(400);
    let way = axis.degrees() - turned;
    assert!((275.0..315.0).contains(&way), "{way} degrees: 283 of ramp");
    assert!(axis.fastest < 612.0, "{} rpm", axis.fastest);
    assert_eq!(axis.diagnosis(), (MANUFACTURER, JUMPED));
}

/// How a drive that holds still comes to follow position commands again.
#[derive(Clone, Copy, Debug)]
enum Resumption {
    Halt,
    ModeSwitch,
    Positioning,
    Blip,
    SwitchedOn,
}

#[test]
fn wherever_following_begins_a_command_beyond_s_0_0159_is_an_error_before_anything_moves() {
    use Resumption::{Blip, Halt, ModeSwitch, Positioning, SwitchedOn};
    const SECOND_MODE: u16 = 0x0100;
    for resumption in [Halt, ModeSwitch, Positioning, Blip, SwitchedOn] {
        // The window S-0-0159 is 30 degrees, and a cycle at S-0-0091 is 36.
        for (distance, taken) in [(28.0, true), (32.0, false), (170.0, false), (-32.0, false)] {
            let parameters = match resumption {
                ModeSwitch => vec![(Idn(33), Value::Word(2))],
                Positioning => vec![(Idn(33), Value::Word(0x1B))],
                _ => vec![],
            };
            let mut axis = Axis::with(11, parameters);
            let before = axis.degrees();
            let away = match resumption {
                Halt => HALT,
                ModeSwitch | Positioning => FOLLOW | SECOND_MODE,
                Blip | SwitchedOn => OFF,
            };
            axis.switches(away);
            match resumption {
                // Bit 15 was off for 8 ms: SwitchingOff or Engaging, the torque never went.
                Blip => axis.run(4),
                _ => axis.run(100),
            }
            axis.position(distance);
            axis.run(4);
            axis.fastest = 0.0;
            axis.had_torque = false;
            let here = axis.degrees();
            axis.switches(FOLLOW);
            axis.run(600);
            let moved = axis.degrees() - if taken { before } else { here };
            let case = format!("{resumption:?}, {distance} degrees away");
            if taken {
                assert!((moved - distance).abs() < 0.1, "{case}: {moved}");
                assert_eq!(axis.bench.number(11), 0, "{case}");
            } else {
                assert!(moved.abs() < 0.1 && axis.fastest < 2.0, "{case}: {moved} degrees, {} rpm", axis.fastest);
                assert_eq!(axis.diagnosis(), (EXCESSIVE_DEVIATION, TOO_FAR), "{case}");
                assert!(!axis.bench.has_torque(), "{case}");
                // Nor has a brake to open for it.
                assert!(!matches!(resumption, SwitchedOn) || !axis.had_torque, "{case}");
            }
        }
    }
}

#[test]
fn without_s_0_0159_the_step_limit_counts_from_the_shaft() {
    // 360 degrees away at the end of HALT, nothing monitored: 45 are the limit.
    for (distance, taken) in [(44.0, true), (46.0, false), (360.0, false)] {
        let mut axis = Axis::with(11, vec![(Idn(159), Value::Long(0))]);
        let before = axis.degrees();
        axis.switches(HALT);
        axis.run(50);
        axis.position(distance);
        axis.run(6);
        axis.switches(FOLLOW);
        axis.run(500);
        let moved = axis.degrees() - before;
        assert!((moved - if taken { distance } else { 0.0 }).abs() < 0.1, "{distance}: {moved} degrees");
        let expected = if taken { 0 } else { MANUFACTURER };
        assert_eq!(axis.bench.number(11), u64::from(expected), "{distance}");
    }
}

#[test]
fn a_lost_mdt_makes_one_step_of_two_and_that_is_no_jump() {
    for mode in [3, 11] {
        // 2 400 of 3 000 rpm: 28.8 degrees a cycle, 57.6 over a lost MDT.
        let mut axis = Axis::with(mode, vec![(Idn(159), Value::Long(3_600_000))]);
        let mut cycle = 0.0_f64;
        let mut ramp = |axis: &mut Axis, cycles: u32| {
            for _ in 0..cycles {
                cycle += 1.0;
                axis.position(if cycle < 400.0 { 28.8 * cycle * cycle / 800.0 } else { 28.8 * (cycle - 200.0) });
                axis.run(2);
            }
        };
        ramp(&mut axis, 500);
        axis.bench.lose(TelegramKind::Mdt, 1);
        ramp(&mut axis, 100);
        assert_eq!(axis.bench.status() & 0x2000, 0, "mode {mode}");
        let rpm = axis.bench.rpm();
        assert!((2_380.0..2_420.0).contains(&rpm), "mode {mode}: {rpm}");
    }
}
