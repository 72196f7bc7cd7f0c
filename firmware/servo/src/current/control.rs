//! A cycle of the current loop.

use super::modulator::{limited_to_period, space_vector};
use super::settings::CURRENT_BITS;
use super::{CurrentCommand, CurrentLoopSettings};
use crate::CurrentFraction;
use crate::trigonometry::{Rotation, high_product, rounded_product, sum_of_products};

/// What the current loop measured and gave in its last cycle.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct CurrentReadings {
    /// Flux-producing current, 2^-26 of peak.
    pub direct: i32,
    /// Torque-producing current, 2^-26 of peak.
    pub quadrature: i32,
    /// Voltage of the d axis, volt 2^-14.
    pub direct_voltage: i32,
    /// Voltage of the q axis, volt 2^-14.
    pub quadrature_voltage: i32,
}

impl CurrentReadings {
    /// A current of the loop as a fraction of the peak current, limited to its range.
    #[inline]
    #[must_use]
    pub fn fraction(current: i32) -> CurrentFraction {
        let bits = current.wrapping_add(1 << (CURRENT_BITS - 16)) >> (CURRENT_BITS - 15);
        CurrentFraction::from_bits(bits.clamp(-MOST, MOST) as i16)
    }
}

const MOST: i32 = i16::MAX as i32;

/// State of the current loop: the integral parts, and what was measured last.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct CurrentLoop {
    /// Volt 2^-18.
    direct_integral: i32,
    quadrature_integral: i32,
    readings: CurrentReadings,
    /// Compare values from the middle of the period, in counts 2^-3, before dead-time compensation. in counts 2^-4.
    counts: [i32; 3],
}

/// What a cycle works with: phase currents in ADC counts 2^-3 without their offsets, and the electrical angle in 2^-32 revolution.
struct Measurement {
    currents: [i32; 3],
    angle: u32,
}

impl CurrentLoop {
    /// Starts without integral parts.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// The bridge is off: no integral parts, no current. The compare values of the last cycle do not matter.
    #[inline]
    pub fn reset(&mut self) {
        self.direct_integral = 0;
        self.quadrature_integral = 0;
        self.readings.direct = 0;
        self.readings.quadrature = 0;
    }

    /// What the last cycle measured and gave.
    #[inline]
    #[must_use]
    pub const fn readings(&self) -> &CurrentReadings {
        &self.readings
    }

    /// One cycle with the bridge on: phase currents in ADC counts 2^-3 ([`super::Offsets::remove`]) and the electrical angle in 2^-32
    /// revolution go in, compare values come out.
    #[inline]
    pub fn cycle(
        &mut self,
        settings: &CurrentLoopSettings,
        command: &CurrentCommand,
        currents: [i32; 3],
        angle: u32,
    ) -> [u16; 3] {
        // With a drive that is a static the compiler would know the address, and load it anew, two instructions each, wherever it lacks a
        // register.
        let state = core::hint::black_box(&mut *self);
        let then = state.current_loop_core(settings, command, &Measurement { currents, angle });
        let [a, b, c] = self.counts;
        let [current_a, current_b, current_c] = commanded_phases(command, then);
        let dead_time = settings.dead_time;
        [
            limited_to_period(a.wrapping_add(dead_time.counts(current_a)), settings.middle),
            limited_to_period(b.wrapping_add(dead_time.counts(current_b)), settings.middle),
            limited_to_period(c.wrapping_add(dead_time.counts(current_c)), settings.middle),
        ]
    }

    /// Clarke, Park, two PI, voltage limit, inverse Park, space vector, with sine and cosine of the angle. A function of its own, because
    /// `cargo xtask budget` counts its instructions. Gives the rotation at the time when the voltage acts, in 2^-30.
    #[inline(never)]
    fn current_loop_core(
        &mut self,
        settings: &CurrentLoopSettings,
        command: &CurrentCommand,
        measurement: &Measurement,
    ) -> Rotation {
        let at = Rotation::by(measurement.angle);
        let [a, b, c] = measurement.currents;
        let alpha = a.wrapping_shl(1).wrapping_sub(b).wrapping_sub(c).wrapping_mul(settings.alpha);
        let beta = b.wrapping_sub(c).wrapping_mul(settings.beta);
        let direct = sum_of_products(alpha, at.cosine, beta, at.sine);
        let quadrature = sum_of_products(beta, at.cosine, alpha.wrapping_neg(), at.sine);

        let bus = &command.bus;
        let direct_voltage = regulate(
            settings,
            &mut self.direct_integral,
            command.direct.wrapping_sub(direct),
            command.direct_voltage,
            bus.longest_direct,
        );
        let quadrature_voltage = regulate(
            settings,
            &mut self.quadrature_integral,
            command.quadrature.wrapping_sub(quadrature),
            command.quadrature_voltage,
            rest_of_circle(direct_voltage, bus.longest, bus.inverse),
        );
        self.readings = CurrentReadings { direct, quadrature, direct_voltage, quadrature_voltage };

        let then = at.half_then(command.ahead);
        let alpha = sum_of_products(direct_voltage, then.cosine, quadrature_voltage.wrapping_neg(), then.sine);
        let beta = sum_of_products(direct_voltage, then.sine, quadrature_voltage, then.cosine);
        self.counts = space_vector(rounded_product(alpha, bus.counts), rounded_product(beta, bus.side));
        then
    }
}

/// The commanded currents of the phases at a rotation in 2^-30, in 2^-24 of peak.
#[inline]
fn commanded_phases(command: &CurrentCommand, at: Rotation) -> [i32; 3] {
    let alpha = sum_of_products(command.direct, at.cosine, command.quadrature.wrapping_neg(), at.sine);
    let beta = sum_of_products(command.direct, at.sine, command.quadrature, at.cosine);
    let half = alpha >> 1;
    let side = high_product(beta, HALF_ROOT_OF_THREE).wrapping_shl(1);
    [alpha, side.wrapping_sub(half), half.wrapping_add(side).wrapping_neg()]
}

/// sqrt(3) / 2 in 2^-31.
const HALF_ROOT_OF_THREE: i32 = 1_859_775_393;

/// Proportional and integral part with feed-forward, within +-`limit`.
///
/// The integral part stands still while the voltage is at its limit and the error would push it further: nothing winds up, and an error
/// that leads back is integrated at once.
#[inline]
fn regulate(settings: &CurrentLoopSettings, integral: &mut i32, error: i32, feed_forward: i32, limit: i32) -> i32 {
    let grown = integral.wrapping_add(high_product(error, settings.integral));
    let wanted = feed_forward.wrapping_add(grown >> 4).wrapping_add(high_product(error, settings.proportional));
    let given = wanted.min(limit).max(limit.wrapping_neg());
    if given == wanted || (error ^ wanted) < 0 {
        *integral = grown;
    }
    given
}

/// What the circle of `limit` leaves for the other axis: sqrt(limit^2 - direct^2) or up to 2.3 % of the limit less, never more; for
/// `direct` up to 0.906 `limit`.
#[inline]
fn rest_of_circle(direct: i32, limit: i32, inverse: i32) -> i32 {
    // direct / limit in 2^-15, its square in 2^-30
    let share = high_product(direct, inverse);
    let square = share.wrapping_mul(share);
    // 1 - x/2 - x^2/4 stays below sqrt(1 - x) up to x = 0.83 and needs no constants.
    let less = square.wrapping_add(high_product(square, square).wrapping_shl(1));
    limit.wrapping_sub(high_product(limit, less).wrapping_shl(1))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_rest_of_the_circle_is_never_more_than_the_circle_and_hardly_less() {
        for limit_volts in [9_i32, 180, 560] {
            let limit = limit_volts << 14;
            let inverse = ((1_u64 << 47) as f64 / f64::from(limit)) as i32;
            for thousandth in 0..=906 {
                let direct = (i64::from(limit) * thousandth / 1_000) as i32;
                let rest = f64::from(rest_of_circle(direct, limit, inverse));
                let exact = (f64::from(limit).powi(2) - f64::from(direct).powi(2)).sqrt();
                let error = (rest - exact) / f64::from(limit);
                assert!((-0.023..=3e-5).contains(&error), "{limit_volts} V, {thousandth}: {error}");
                let other_side = f64::from(rest_of_circle(-direct, limit, inverse));
                assert!((rest - other_side).abs() < 0.001 * f64::from(limit));
            }
        }
    }
}
