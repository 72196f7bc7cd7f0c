//! Any axis that a machine builder could set up, and some that none would.

use fault_matrix::Fault;

use super::{ordeals, services};
use crate::dice::Dice;
use crate::life::{Axis, Plant};
use crate::master::bytes_of;
use crate::units::Units;

/// What a standard telegram carries: type, MDT, AT (sercos2.md 1.8).
const STANDARD: [(u16, &[u16], &[u16]); 7] = [
    (0, &[], &[]),
    (1, &[80], &[]),
    (2, &[36], &[40]),
    (3, &[36], &[51]),
    (4, &[47], &[51]),
    (5, &[47, 36], &[51, 40]),
    (6, &[36], &[]),
];
/// The parameters of the operation modes, by control word bits 11, 9, 8.
pub(crate) const MODES: [u16; 8] = [32, 33, 34, 35, 284, 285, 286, 287];
/// What may stand in an AT besides position and velocity.
const MORE_FEEDBACK: [u16; 18] = [11, 12, 13, 14, 84, 129, 130, 131, 132, 133, 144, 189, 347, 380, 383, 384, 390, 403];
/// Bytes of configurable data (S-0-0185, S-0-0186).
const MOST_BYTES: usize = 32;

/// The command value that a mode follows.
pub(crate) const fn command_of(mode: i64) -> u16 {
    match mode {
        1 => 80,
        2 => 36,
        0x13 | 0x1B => 258,
        0x213 | 0x21B => 282,
        _ => 47,
    }
}

/// An axis.
pub(super) fn any(dice: &mut Dice) -> Axis {
    let plant = dice.weighted(&[
        (40, Plant::Press),
        (25, Plant::Catalogue),
        (15, Plant::SmallCnc),
        (15, Plant::Vertical),
        (5, Plant::Precise),
    ]);
    let plant = plant.unwrap_or(Plant::Press);
    let cycle = dice.weighted(&[
        (10, 500),
        (4, 750),
        (20, 1_000),
        (4, 1_250),
        (4, 1_500),
        (35, 2_000),
        (5, 3_000),
        (10, 4_000),
        (4, 8_000),
        (4, 10_000),
    ]);
    let cycle: u16 = cycle.unwrap_or(2_000);
    let megabits = if cycle < 1_000 {
        dice.weighted(&[(1, 8), (1, 16)])
    } else {
        dice.weighted(&[(40, 2), (30, 4), (15, 8), (15, 16)])
    };
    let control_cycles = dice.weighted(&[(80, 1), (12, 2), (6, 4), (2, 3)]).unwrap_or(1);
    let mut axis = Axis {
        plant,
        increments: None,
        built_for: None,
        megabits: megabits.unwrap_or(4),
        cycle,
        control_cycles,
        early_mdt: dice.chance(30),
        telegram: 7,
        at: Vec::new(),
        mdt: Vec::new(),
        aligned: dice.chance(if plant == Plant::Vertical { 100 } else { 96 }),
        wraps: dice.chance(60),
        settings: Vec::new(),
        also: Vec::new(),
    };
    if dice.chance(15) {
        let increments = plant.axis().machine.encoder.increments_per_revolution;
        let factor = dice.weighted(&[(1, (1, 2)), (1, (3, 4)), (1, (5, 4)), (1, (2, 1))]).unwrap_or((1, 1));
        axis.increments = Some((increments / 4 * factor.0 / factor.1 / 4).max(250) * 4 * 4);
    }
    if plant != Plant::Vertical && dice.chance(8) {
        axis.built_for = dice.pick(&[Fault::AxisBlocked, Fault::MainsFailure, Fault::Overload]);
    } else if plant == Plant::Vertical && dice.chance(3) {
        axis.built_for = Some(Fault::BrakeOpensLate);
    }
    telegram(dice, &mut axis);
    scaling(dice, &mut axis);
    polarity(dice, &mut axis);
    limits(dice, &mut axis);
    odds(dice, &mut axis);
    ordeals::prepare(dice, &mut axis);
    if dice.chance(10) {
        let also = services::in_cp2(dice, &axis);
        axis.also.extend(also);
    }
    axis
}

fn telegram(dice: &mut Dice, axis: &mut Axis) {
    let primary = dice
        .weighted(&[(30, 11), (20, 3), (25, 2), (10, 1), (8, 0x13), (7, 0x1B), (3, 0x213), (3, 0x21B)])
        .unwrap_or(2);
    let standard: Vec<_> = STANDARD.iter().filter(|(_, mdt, _)| mdt.contains(&command_of(primary))).collect();
    let mut modes = vec![primary];
    match dice.pick(&standard).filter(|_| dice.chance(40)) {
        Some((kind, mdt, at)) => {
            axis.telegram = *kind;
            axis.mdt = mdt.to_vec();
            axis.at = at.to_vec();
            while dice.chance(30) && modes.len() < 4 {
                let more = dice.pick(&[11, 3, 2, 1]).unwrap_or(2);
                if axis.mdt.contains(&command_of(more)) {
                    modes.push(more);
                }
            }
        }
        None => {
            while dice.chance(50) && modes.len() < 8 {
                modes.push(dice.pick(&[11, 3, 2, 1, 0x13, 0x1B, 0x213, 0x21B]).unwrap_or(2));
            }
            let mut mdt: Vec<u16> = modes.iter().map(|&mode| command_of(mode)).collect();
            for more in [36, 37, 47, 48, 80, 81, 145, 258] {
                if dice.chance(12) {
                    mdt.push(more);
                }
            }
            if mdt.contains(&282) && dice.chance(70) {
                mdt.push(346);
            }
            axis.mdt = shuffled(dice, mdt);
            let mut at = vec![51];
            for more in [40, 189, 84, 13] {
                if dice.chance(50) {
                    at.push(more);
                }
            }
            while dice.chance(40) {
                at.extend(dice.pick(&MORE_FEEDBACK));
            }
            axis.at = shuffled(dice, at);
        }
    }
    for (&idn, &mode) in MODES.iter().zip(&modes) {
        if idn != 32 || mode != 2 {
            axis.settings.push((idn, mode));
        }
    }
}

/// In random order, each once, as many as a telegram holds.
fn shuffled(dice: &mut Dice, idns: Vec<u16>) -> Vec<u16> {
    let mut left = idns;
    left.sort_unstable();
    left.dedup();
    let mut shuffled = Vec::new();
    let mut bytes = 0;
    while !left.is_empty() {
        let idn = left.remove(dice.below(left.len() as u64) as usize);
        bytes += bytes_of(idn);
        if bytes <= MOST_BYTES {
            shuffled.push(idn);
        }
    }
    shuffled
}

fn scaling(dice: &mut Dice, axis: &mut Axis) {
    let mut set = |idn: u16, value: i64| axis.settings.push((idn, value));
    let load = dice.chance(30);
    if load || dice.chance(10) {
        let most = if dice.chance(70) { 10 } else { 200 };
        set(121, dice.between(1, most));
        let most = if dice.chance(70) { 10 } else { 200 };
        set(122, dice.between(1, most));
    }
    let of_load = |dice: &mut Dice| i64::from(load && dice.chance(80)) << 6;
    let linear = dice.chance(25);
    if linear && dice.chance(60) {
        set(123, dice.pick(&[50_000, 100_000, 200_000, 314_159, 1_000_000]).unwrap_or(100_000));
    }
    let modulo = i64::from(dice.chance(30)) << 7;
    let mut kind = modulo | if linear { 1 } else { 2 } | of_load(dice);
    if dice.chance(35) {
        kind |= 1 << 3;
        if linear {
            set(77, dice.pick(&[1, 5, 25, 254]).unwrap_or(1));
            set(78, dice.pick(&[-6, -7, -8]).unwrap_or(-7));
        } else {
            let resolution = dice.pick(&[360, 36_000, 65_536, 1_000_000, 1 << 20, 1 << 24, 36_000_000]);
            set(79, resolution.unwrap_or(65_536));
        }
    }
    if kind != 2 {
        set(76, kind);
    }
    if linear || dice.chance(15) {
        let mut kind = if linear { 1 } else { 2 } | of_load(dice);
        if dice.chance(40) {
            kind |= 1 << 3 | i64::from(dice.chance(20)) << 5;
            set(45, dice.pick(&[1, 2, 5, 10]).unwrap_or(1));
            set(46, dice.pick(&[-3, -4, -5]).unwrap_or(-4));
        }
        set(44, kind);
    }
    if linear || dice.chance(10) {
        let mut kind = if linear { 1 } else { 2 } | of_load(dice);
        if dice.chance(30) {
            kind |= 1 << 3;
            set(161, dice.pick(&[1, 5]).unwrap_or(1));
            set(162, dice.pick(&[-2, -3, -4]).unwrap_or(-3));
        }
        set(160, kind);
    }
    if modulo != 0 {
        let units = Units::of(axis);
        let turns = dice.pick(&[1.0, 1.0, 1.0, 0.5, 2.0, 3.7, 10.0]).unwrap_or(1.0);
        let modulo = (units.revolution * turns).round().clamp(1.0, f64::from(i32::MAX)) as i64;
        axis.settings.push((103, modulo));
    }
}

fn polarity(dice: &mut Dice, axis: &mut Axis) {
    let inverted = dice.chance(30);
    let any = |dice: &mut Dice| dice.weighted(&[(75, if inverted { 7 } else { 0 }), (10, 7), (15, 8)]).unwrap_or(0);
    for idn in [43, 55, 85] {
        let mut value = any(dice);
        if value == 8 {
            value = dice.between(0, 7);
        }
        if idn == 55 {
            // A control whose command and feedback count against each other has no position to speak of.
            value = if value & 1 != 0 { value | 5 } else { value & 2 };
            // Some builders do not know that: the drive says so.
            if dice.chance(1) {
                value ^= 4;
            }
            // An endless axis has no limits: the drive refuses the two together.
            let endless = Units::of(axis).modulo.is_some();
            if dice.chance(if endless { 3 } else { 35 }) {
                value |= 0x10;
            }
        }
        if value != 0 {
            axis.settings.push((idn, value));
        }
    }
}

fn limits(dice: &mut Dice, axis: &mut Axis) {
    let units = Units::of(axis);
    let scaled = crate::units::setting(axis, 44).is_some() || crate::units::setting(axis, 76).is_some();
    let accelerated = crate::units::setting(axis, 160).is_some();
    let machine = axis.plant.axis();
    let fastest = f64::from(machine.maximum_speed);
    let long = |value: f64, least: f64| value.round().clamp(least, f64::from(i32::MAX)) as i64;
    let speed = |rpm: f64| long(rpm * units.rpm, 1.0);
    let degrees = |degrees: f64| long(degrees / 360.0 * units.revolution, 1.0);
    let acceleration = |value: f64| long(value * units.acceleration, 1_000.0);
    let ramp = f64::from(machine.gains.acceleration_limit) * 1e-3;
    let mut set = |idn: u16, value: i64| axis.settings.push((idn, value));

    set(91, speed(if dice.chance(70) { fastest } else { fastest * (0.1 + 0.9 * dice.share()) }));
    if scaled {
        for (idn, rpm) in [(124, 10.0), (125, 100.0), (157, 10.0), (41, 100.0), (259, 300.0)] {
            set(idn, speed(rpm));
        }
        set(159, degrees(30.0));
        set(57, degrees(1.0));
    }
    if accelerated || dice.chance(30) {
        set(260, acceleration(ramp * (0.2 + 0.8 * dice.share())));
        set(42, acceleration(ramp * 0.3));
    }
    if dice.chance(30) {
        // Some builders switch it off.
        set(159, if dice.chance(15) { 0 } else { degrees(5.0 + 85.0 * dice.share()) });
    }
    if dice.chance(15) {
        set(38, speed(fastest * dice.share()));
    }
    if dice.chance(15) {
        set(39, -speed(fastest * dice.share()));
    }
    if dice.chance(15) {
        set(92, dice.between(200, 4_000));
    }
    if dice.chance(10) {
        set(82, dice.between(300, 3_000));
        set(83, -dice.between(300, 3_000));
    }
    if dice.chance(35) {
        set(138, acceleration(ramp * (0.15 + 0.85 * dice.share())));
    }
    if dice.chance(20) {
        set(372, acceleration(ramp * (0.15 + 0.85 * dice.share())));
    }
    if dice.chance(20) {
        set(136, acceleration(ramp * (0.1 + 0.9 * dice.share())));
        set(137, acceleration(ramp * (0.1 + 0.9 * dice.share())));
    }
    if dice.chance(10) {
        set(349, acceleration(ramp * 100.0 * (0.1 + dice.share())));
    }
    if dice.chance(50) {
        set(259, speed(fastest * (0.05 + 0.9 * dice.share())));
    }
    if dice.chance(40) {
        let reach = 20.0 + 700.0 * dice.share();
        // Crossed, now and then: the drive refuses that.
        let sense = if dice.chance(3) { -1 } else { 1 };
        set(49, sense * degrees(reach));
        set(50, -sense * degrees(20.0 + 700.0 * dice.share()));
    }
}

fn odds(dice: &mut Dice, axis: &mut Axis) {
    let product = |number: u16| 0x8000 | number;
    if dice.chance(25) {
        axis.settings.push((product(141), 1));
    }
    if let Some(reaction @ (0 | 1)) = dice.weighted(&[(75, 2), (15, 0), (10, 1)]) {
        axis.settings.push((product(140), reaction));
    }
    if dice.chance(15) {
        axis.settings.push((296, dice.between(0, 1_000)));
    }
    if dice.chance(15) {
        axis.settings.push((273, dice.between(50, 1_000)));
    }
    if axis.plant == Plant::Vertical {
        axis.settings.push((product(120), 3));
        axis.settings.push((206, 60));
        axis.settings.push((207, 60));
    } else {
        // Friction is no brake.
        if axis.built_for.is_some() {
            axis.settings.push((product(120), 0));
        }
        axis.settings.push((206, dice.between(0, 20)));
        axis.settings.push((207, dice.between(0, 20)));
    }
    if axis.built_for == Some(Fault::BrakeOpensLate) {
        axis.settings.push((206, 600));
    }
    if axis.built_for == Some(Fault::Overload) {
        axis.settings.push((92, 4_000));
    }
}
