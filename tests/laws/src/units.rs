//! What an increment of position, velocity, acceleration and torque is at the motor's shaft (sercos2.md 6.5).

use core::f64::consts::{SQRT_2, TAU};

use ring::ident::Idn;

use crate::settings::Settings;

/// Weights at the motor's shaft, as the settings are.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Units {
    /// Position increments of a revolution of the motor.
    pub increments: f64,
    /// rad/s of a velocity increment.
    pub velocity: f64,
    /// rad/s² of an acceleration increment.
    pub acceleration: f64,
    /// A of 0.1 % of torque.
    pub torque: f64,
    /// Position increments after which positions repeat: S-0-0103 with bit 7 of S-0-0076, else 2^32.
    pub modulo: f64,
    /// Positions are modulo S-0-0103.
    pub is_modulo: bool,
}

impl Units {
    /// `None` while something that matters is not known.
    #[must_use]
    pub fn of(settings: &Settings) -> Option<Self> {
        let number = |idn| settings.unsigned(Idn(idn)).map(|value| value as f64);
        let weight = |factor: u16, exponent: u16| {
            let exponent = i32::try_from(settings.signed(Idn(exponent))?).ok()?;
            Some(settings.unsigned(Idn(factor))? as f64 * 10f64.powi(exponent))
        };
        // Revolutions of the load while the motor makes one.
        let gear = number(122)? / number(121)?;
        let feed = number(123)? * 1e-7;
        let turn = |kind: u16| if kind & 0x40 == 0 { 1.0 } else { gear };

        let position = settings.word(Idn(76))?;
        let increments = match (position & 7, position & 8 == 0) {
            (1, true) => feed / 1e-7,
            (1, false) => feed / weight(77, 78)?,
            (2, true) => 3_600_000.0,
            (2, false) => number(79)?,
            _ => return None,
        } * turn(position);

        let kind = settings.word(Idn(44))?;
        let per_second = if kind & 0x20 == 0 { 1.0 / 60.0 } else { 1.0 };
        let velocity = match (kind & 7, kind & 8 == 0) {
            (1, true) => 1e-6 * per_second / feed,
            (1, false) => weight(45, 46)? * per_second / feed,
            (2, true) => {
                if kind & 0x20 == 0 {
                    1e-4 / 60.0
                } else {
                    1e-6
                }
            }
            (2, false) => weight(45, 46)? * per_second,
            _ => return None,
        } * TAU
            / turn(kind);

        let kind = settings.word(Idn(160))?;
        let acceleration = match (kind & 7, kind & 8 == 0) {
            (1, true) => 1e-6 / feed * TAU,
            (1, false) => weight(161, 162)? / feed * TAU,
            (2, true) => 1e-3,
            (2, false) => weight(161, 162)?,
            _ => return None,
        } / turn(kind);

        let is_modulo = position & 0x80 != 0;
        let modulo = if is_modulo { number(103)? } else { 4_294_967_296.0 };
        Some(Self { increments, velocity, acceleration, torque: number(111)? * 1e-6 * SQRT_2, modulo, is_modulo })
    }

    /// The shortest way from one position to another, in increments.
    #[must_use]
    pub fn way(&self, from: f64, to: f64) -> f64 {
        let way = (to - from).rem_euclid(self.modulo);
        if way > 0.5 * self.modulo { way - self.modulo } else { way }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_new_drive_has_rotary_data_of_the_motor() {
        let units = Units::of(&Settings::default()).expect("all defaults are known");
        assert_eq!(units.increments, 3_600_000.0);
        // 10 000 increments are 1 rpm.
        assert!((units.velocity * 10_000.0 - TAU / 60.0).abs() < 1e-12);
        assert!((units.acceleration - 1e-3).abs() < 1e-15);
        // 1000 increments are S-0-0111: 3.536 A RMS.
        assert!((units.torque * 1_000.0 - 3.536 * SQRT_2).abs() < 1e-12);
    }

    #[test]
    fn linear_data_of_a_load_behind_a_gear() {
        let mut settings = Settings::default();
        for (number, words) in
            [(76, vec![0x41]), (44, vec![0x41]), (160, vec![0x41]), (121, vec![5, 0]), (122, vec![2, 0])]
        {
            settings.note(Idn(number), words);
        }
        let units = Units::of(&settings).expect("known");
        // 10 mm a revolution of the load, 0.4 revolutions of it: 4 mm of 0.1 um.
        assert!((units.increments - 40_000.0).abs() < 1e-6);
        // 4 mm/min are one revolution of the motor a minute.
        assert!((units.velocity * 4_000.0 - TAU / 60.0).abs() < 1e-12);
        assert!((units.acceleration * 4_000.0 - TAU).abs() < 1e-9);
    }

    #[test]
    fn the_shortest_way_wraps() {
        let units = Units { modulo: 100.0, ..Units::default() };
        assert_eq!((units.way(90.0, 10.0), units.way(10.0, 90.0)), (20.0, -20.0));
    }
}
