//! Means of currents, voltages and speed over a fixed time.

use super::{IdentificationError, IdentificationInputs};
use crate::units::{Position, Velocity};

/// A window has 2^11 ticks: 256 ms.
const BITS: u32 = 11;
/// Ticks of a window, with the one that ends it.
pub(super) const WINDOW: u32 = (1 << BITS) + 1;
const HALF: u32 = 1 << (BITS - 1);
const END: u32 = 1 << BITS;

/// Sums of a window under way.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub(super) struct Window {
    ticks: u32,
    direct: i64,
    quadrature: i64,
    direct_voltage: i64,
    quadrature_voltage: i64,
    /// Direct voltage of the first half.
    early_voltage: i64,
    start: Position,
    middle: Position,
    is_limited: bool,
}

/// Means of a window.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub(super) struct Means {
    /// 2^-26 of peak.
    pub(super) direct: i32,
    pub(super) quadrature: i32,
    /// Volt 2^-14.
    pub(super) direct_voltage: i32,
    pub(super) quadrature_voltage: i32,
    pub(super) velocity: Velocity,
    /// Second half less first half.
    voltage_change: i32,
    velocity_change: Velocity,
    is_limited: bool,
}

impl Window {
    /// Takes a tick; gives the means with the tick that ends the window.
    #[inline]
    pub(super) fn add(&mut self, inputs: &IdentificationInputs) -> Option<Means> {
        let position = inputs.position;
        if self.ticks == 0 {
            self.start = position;
        } else if self.ticks == HALF {
            self.middle = position;
            self.early_voltage = self.direct_voltage;
        } else if self.ticks >= END {
            return Some(self.means(position));
        }
        let readings = &inputs.readings;
        self.direct = self.direct.wrapping_add(readings.direct.into());
        self.quadrature = self.quadrature.wrapping_add(readings.quadrature.into());
        self.direct_voltage = self.direct_voltage.wrapping_add(readings.direct_voltage.into());
        self.quadrature_voltage = self.quadrature_voltage.wrapping_add(readings.quadrature_voltage.into());
        self.is_limited |= inputs.is_at_voltage_limit();
        self.ticks = self.ticks.wrapping_add(1);
        None
    }

    #[inline]
    fn means(&self, end: Position) -> Means {
        let mean = |sum: i64| (sum.wrapping_add(i64::from(HALF)) >> BITS) as i32;
        let (early, late) = ((self.middle - self.start).to_bits(), (end - self.middle).to_bits());
        // 2^-32 to 2^-36 of a revolution
        let velocity = |way: i64, bits: u32| Velocity::saturating_from_bits(way >> bits.wrapping_sub(4));
        Means {
            direct: mean(self.direct),
            quadrature: mean(self.quadrature),
            direct_voltage: mean(self.direct_voltage),
            quadrature_voltage: mean(self.quadrature_voltage),
            velocity: velocity(early.wrapping_add(late), BITS),
            // Twice the difference of the sums of the halves.
            voltage_change: mean(self.direct_voltage.wrapping_sub(self.early_voltage.wrapping_mul(2)).wrapping_mul(2)),
            velocity_change: velocity(late.wrapping_sub(early), BITS.wrapping_sub(1)),
            is_limited: self.is_limited,
        }
    }
}

impl Means {
    /// Means of a current, a voltage and a velocity that stand still.
    #[cfg(test)]
    pub(super) fn steady(direct: i32, quadrature: i32, quadrature_voltage: i32, velocity: Velocity) -> Self {
        Self { direct, quadrature, quadrature_voltage, velocity, ..Self::default() }
    }

    /// The direct current is within 1/16 of this one, the voltage is free and steady.
    #[inline]
    pub(super) fn check_current(&self, expected: i32) -> Result<(), IdentificationError> {
        if self.is_limited {
            return Err(IdentificationError::VoltageLimit);
        }
        if self.direct.wrapping_sub(expected).wrapping_abs() > expected >> 4 {
            return Err(IdentificationError::CurrentNotReached { actual: self.direct, expected });
        }
        if self.voltage_change.wrapping_abs() > (self.direct_voltage.wrapping_abs() >> 4).wrapping_add(NOISE) {
            return Err(IdentificationError::Unstable);
        }
        Ok(())
    }

    /// The velocity is within 1/16 of this one and steady within 1/32, the voltage is free.
    #[inline]
    pub(super) fn check_velocity(&self, expected: Velocity) -> Result<(), IdentificationError> {
        let size = expected.abs().to_bits();
        let along = if expected < Velocity::ZERO { -self.velocity } else { self.velocity };
        if along.to_bits() < size >> 3 {
            return Err(IdentificationError::NoMovement);
        }
        if self.is_limited {
            return Err(IdentificationError::VoltageLimit);
        }
        let is_steady = self.velocity_change.abs().to_bits() <= size >> 5;
        if !is_steady || (self.velocity - expected).abs().to_bits() > size >> 4 {
            return Err(IdentificationError::Unstable);
        }
        Ok(())
    }
}

/// Change of a mean voltage that tells nothing: 20 mV.
const NOISE: i32 = 328;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::current::readings::CurrentReadings;

    fn inputs(tick: i64) -> IdentificationInputs {
        let late = i32::from(tick >= 1_024);
        IdentificationInputs {
            readings: CurrentReadings {
                direct: 1_000 + 100 * late,
                quadrature: -500,
                direct_voltage: 16_384 * (1 + late),
                quadrature_voltage: -7,
            },
            longest_voltage: 100 << 14,
            position: Position::from_bits(77 + tick * 640 + (tick - 1_024).max(0) * 64),
        }
    }

    #[test]
    fn a_window_gives_means_and_the_change_between_its_halves() {
        let mut window = Window::default();
        assert!((0..i64::from(WINDOW) - 1).all(|tick| window.add(&inputs(tick)).is_none()));
        let means = window.add(&inputs(2_048)).unwrap();
        assert_eq!((means.direct, means.quadrature), (1_050, -500));
        assert_eq!((means.direct_voltage, means.quadrature_voltage), (24_576, -7));
        assert_eq!(means.velocity.to_bits(), (640 + 32) * 16);
        assert_eq!(means.voltage_change, 16_384);
        assert_eq!(means.velocity_change.to_bits(), 64 * 16);
        assert_eq!(means.check_current(1_050), Err(IdentificationError::Unstable));
        let not_reached = IdentificationError::CurrentNotReached { actual: 1_050, expected: 1_200 };
        assert_eq!(means.check_current(1_200), Err(not_reached));
        assert_eq!(means.check_velocity(Velocity::from_bits(672 * 16)), Err(IdentificationError::Unstable));
        assert_eq!(means.check_velocity(Velocity::from_bits(-672 * 16)), Err(IdentificationError::NoMovement));
        let steady = Means { voltage_change: -1_500, velocity_change: Velocity::from_bits(-300), ..means };
        assert_eq!(steady.check_current(1_000), Ok(()));
        assert_eq!(steady.check_velocity(Velocity::from_bits(672 * 16)), Ok(()));
        assert_eq!(steady.check_velocity(Velocity::from_bits(740 * 16)), Err(IdentificationError::Unstable));
        let limited = Means { is_limited: true, ..steady };
        assert_eq!(limited.check_current(1_050), Err(IdentificationError::VoltageLimit));
        assert_eq!(limited.check_velocity(Velocity::from_bits(672 * 16)), Err(IdentificationError::VoltageLimit));
    }

    #[test]
    fn one_tick_at_the_voltage_limit_is_remembered() {
        for (volts, is_limited) in [(87, false), (88, true)] {
            let mut window = Window::default();
            for tick in 0..2_048 {
                let mut inputs = inputs(tick);
                if tick == 500 {
                    // 3, 4, 5
                    inputs.readings.direct_voltage = volts * 16_384 / 5 * 3;
                    inputs.readings.quadrature_voltage = -volts * 16_384 / 5 * 4;
                }
                window.add(&inputs);
            }
            assert_eq!(window.add(&inputs(2_048)).unwrap().is_limited, is_limited);
        }
    }
}
