//! What an increment of position, velocity and acceleration is worth on an axis, from its scaling parameters (sercos2.md 4.2).

use drive::DICTIONARY;
use plant::ReferenceAxis;
use ring::ident::{Idn, Value};

use crate::life::Axis;

/// Increments of the axis' data for what the motor does.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Units {
    /// Of position, for a revolution of the motor.
    pub(crate) revolution: f64,
    /// Of velocity, for 1 rpm of the motor.
    pub(crate) rpm: f64,
    /// Of acceleration, for 1 rad/s² of the motor.
    pub(crate) acceleration: f64,
    /// Of position, the modulo value; `None` without modulo.
    pub(crate) modulo: Option<f64>,
}

const LINEAR: i64 = 1;
const BY_PARAMETER: i64 = 1 << 3;
const PER_SECOND: i64 = 1 << 5;
const OF_LOAD: i64 = 1 << 6;
const MODULO: i64 = 1 << 7;

impl Units {
    /// Those of an axis with these settings; what is not there has its default.
    #[must_use]
    pub(crate) fn of(axis: &Axis) -> Self {
        let value = |idn: u16| setting(axis, idn).unwrap_or_else(|| default_of(idn));
        let number = |idn: u16| value(idn) as f64;
        let power = |idn: u16| 10f64.powi(value(idn) as i32);
        let gear = number(122) / number(121);
        // Metres and revolutions of what the data are of, for one revolution of the motor.
        let revolutions = |kind: i64| if kind & OF_LOAD != 0 { gear } else { 1.0 };
        let metres = |kind: i64| number(123) * 1e-7 * revolutions(kind);

        let kind = value(76);
        let revolution = match (kind & 7 == LINEAR, kind & BY_PARAMETER != 0) {
            (true, false) => metres(kind) / 1e-7,
            (true, true) => metres(kind) / (number(77) * power(78)),
            (false, false) => revolutions(kind) * 3_600_000.0,
            (false, true) => revolutions(kind) * number(79),
        };
        let modulo = (kind & MODULO != 0).then(|| number(103));

        let kind = value(44);
        let minutes = if kind & PER_SECOND != 0 { 60.0 } else { 1.0 };
        let rpm = match (kind & 7 == LINEAR, kind & BY_PARAMETER != 0) {
            (true, false) => metres(kind) / minutes / 1e-6,
            (true, true) => metres(kind) / minutes / (number(45) * power(46)),
            (false, false) => revolutions(kind) / minutes / if kind & PER_SECOND != 0 { 1e-6 } else { 1e-4 },
            (false, true) => revolutions(kind) / minutes / (number(45) * power(46)),
        };

        let kind = value(160);
        let per_radian = 1.0 / core::f64::consts::TAU;
        let acceleration = match (kind & 7 == LINEAR, kind & BY_PARAMETER != 0) {
            (true, false) => metres(kind) * per_radian / 1e-6,
            (true, true) => metres(kind) * per_radian / (number(161) * power(162)),
            (false, false) => revolutions(kind) / 1e-3,
            (false, true) => revolutions(kind) / (number(161) * power(162)),
        };
        Self { revolution, rpm, acceleration, modulo }
    }

    /// Degrees of the motor as increments of position.
    #[must_use]
    pub(crate) fn degrees(&self, degrees: f64) -> i64 {
        (self.revolution * degrees / 360.0).round() as i64
    }
}

/// The value that an axis' settings give a data block.
pub(crate) fn setting(axis: &Axis, idn: u16) -> Option<i64> {
    axis.settings.iter().rev().find(|(other, _)| *other == idn).map(|(_, value)| *value)
}

/// The value of a data block that nobody has written.
pub(crate) fn default_of(idn: u16) -> i64 {
    DICTIONARY.find(sercos::Idn(idn)).map_or(0, |block| block.default)
}

/// What is written in CP2: what the machine needs, in the axis' units, then the axis' own settings. Nothing that has its default anyway.
pub(crate) fn writes(axis: &Axis, machine: &ReferenceAxis) -> Vec<(u16, i64)> {
    let units = Units::of(axis);
    let mut writes = Vec::new();
    let mut base: Vec<(u16, i64)> = bench::parameters_of(machine)
        .into_iter()
        .filter_map(|(Idn(idn), value)| Some((idn, number_of(&value)?)))
        .collect();
    for (idn, value) in &mut base {
        // The precise axis asks for a filter that the drive does not have.
        *value = (*value).max(DICTIONARY.find(sercos::Idn(*idn)).and_then(|block| block.minimum).unwrap_or(i64::MIN));
        if *idn == 138 {
            let acceleration = f64::from(machine.gains.acceleration_limit) * 1e-3;
            *value = (acceleration * units.acceleration).round().clamp(1.0, f64::from(i32::MAX)) as i64;
        }
    }
    // The scaling first: everything after it is in its units.
    let scaling = |idn: u16| matches!(idn, 44..=46 | 76..=79 | 103 | 116 | 121..=123 | 160..=162);
    let own = |scales: bool| axis.settings.iter().copied().filter(move |(idn, _)| scaling(*idn) == scales);
    writes.extend(own(true));
    writes.extend(base.into_iter().filter(|(idn, value)| {
        setting(axis, *idn).is_none() && (*value != default_of(*idn) || (*idn == 138 && units.acceleration != 1_000.0))
    }));
    writes.extend(own(false));
    writes
}

pub(crate) fn number_of(value: &Value) -> Option<i64> {
    match value {
        Value::Word(word) => Some(i64::from(*word)),
        Value::Long(long) => Some(i64::from(*long)),
        Value::Quad(_) | Value::Bytes(_) => None,
    }
}

/// A value as the words of a data block's operation data.
pub(crate) fn words_of(idn: u16, value: i64) -> Vec<u16> {
    let bytes = DICTIONARY.find(sercos::Idn(idn)).and_then(|block| block.fixed_bytes()).unwrap_or(2);
    (0..usize::from(bytes / 2).max(1)).map(|word| (value >> (16 * word).min(63)) as u16).collect()
}

/// The value of a data block from its words, with its sign.
pub(crate) fn value_of(idn: u16, words: &[u16]) -> i64 {
    let raw = words.iter().rev().fold(0u64, |raw, word| raw << 16 | u64::from(*word));
    DICTIONARY.find(sercos::Idn(idn)).map_or(raw as i64, |block| block.attribute.value_of(raw))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::life::Plant;

    fn axis(settings: &[(u16, i64)]) -> Axis {
        Axis {
            plant: Plant::Press,
            increments: None,
            built_for: None,
            megabits: 2,
            cycle: 2_000,
            control_cycles: 1,
            early_mdt: false,
            telegram: 5,
            at: vec![51, 40],
            mdt: vec![47, 36],
            aligned: true,
            wraps: false,
            settings: settings.to_vec(),
            also: Vec::new(),
        }
    }

    #[test]
    fn the_defaults_are_ten_thousandths_of_degrees_and_of_rpm() {
        let units = Units::of(&axis(&[]));
        assert_eq!(units, Units { revolution: 3_600_000.0, rpm: 10_000.0, acceleration: 1_000.0, modulo: None });
    }

    #[test]
    fn linear_data_of_the_load_go_through_gear_and_feed_constant() {
        // 10 mm a revolution of the load, the motor turns three times for two of it: 6.6667 mm, in 0.1 um.
        let units = Units::of(&axis(&[(76, 0x41), (44, 0x41), (160, 0x41), (121, 3), (122, 2)]));
        assert!((units.revolution - 66_666.67).abs() < 0.01, "{units:?}");
        assert!((units.rpm - 6_666.667).abs() < 0.001, "{units:?}");
        assert!((units.acceleration - 1_061.03).abs() < 0.01, "{units:?}");
    }

    #[test]
    fn values_keep_their_sign_and_length_on_the_way_through_words() {
        for (idn, value) in [(47, -5), (47, i64::from(i32::MIN)), (80, -32_768), (92, 65_535), (79, 0xFFFF_FFFF)] {
            assert_eq!(value_of(idn, &words_of(idn, value)), value, "{idn}");
        }
    }
}
