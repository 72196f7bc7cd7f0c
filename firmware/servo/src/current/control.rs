//! A cycle of the current loop.

use super::modulator::{Counts, space_vector, to_compare_value};
use super::sensing::{Hidden, ShuntWindow};
use super::settings::CurrentLoopSettings;
use super::shared::{SharedCommand, SharedReadings};
use crate::arithmetic::trigonometry::{Rotation, high_product, rounded_product, sum_of_products};

/// The current loop: settings, and the integral parts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct CurrentLoop {
    settings: CurrentLoopSettings,
    /// Volt 2^-18.
    direct_integral: i32,
    quadrature_integral: i32,
    /// Compare values of the running cycle before dead-time compensation, in counts 2^-3.
    counts: [i32; 3],
}

impl CurrentLoop {
    /// Starts without integral parts.
    #[must_use]
    pub const fn new(settings: CurrentLoopSettings) -> Self {
        Self { settings, direct_integral: 0, quadrature_integral: 0, counts: [0; 3] }
    }

    /// Goes on with other settings.
    pub const fn set(&mut self, settings: CurrentLoopSettings) {
        self.settings = settings;
    }

    /// The bridge is off: no integral parts. The compare values of the last cycle do not matter.
    #[inline]
    pub fn reset(&mut self) {
        self.direct_integral = 0;
        self.quadrature_integral = 0;
    }

    /// One cycle with the bridge on. The phase currents and the electrical angle of its sample are in `readings`, where it leaves what it
    /// makes of them; compare values come out.
    #[inline]
    pub fn cycle(&mut self, command: &SharedCommand, readings: &SharedReadings) -> [u16; 3] {
        let (counts, then) = self.counts(command, readings);
        self.compensated(command, counts, then)
    }

    /// The same on shunts of the low side, with compare values of which at most one hides its phase.
    #[inline]
    pub fn cycle_on_shunts(
        &mut self,
        command: &SharedCommand,
        readings: &SharedReadings,
        window: ShuntWindow,
    ) -> ([u16; 3], Hidden) {
        let (counts, then) = self.counts(command, readings);
        let (counts, hidden) = window.fit(counts);
        (self.compensated(command, counts, then), hidden)
    }

    #[inline]
    fn counts(&mut self, command: &SharedCommand, readings: &SharedReadings) -> (Counts, Rotation) {
        // With a drive that is a static the compiler would know the address, and load it anew, two instructions each, wherever it lacks a
        // register.
        let state = core::hint::black_box(&mut *self);
        let then = state.current_loop_core(command, readings);
        (self.counts, then)
    }

    #[inline]
    fn compensated(&self, command: &SharedCommand, counts: Counts, then: Rotation) -> [u16; 3] {
        self.settings.dead_time.compensate(counts, commanded(command, then)).map(to_compare_value)
    }

    /// Clarke, Park, two PI, voltage limit, inverse Park, space vector, with sine and cosine of the angle. A function of its own, because
    /// `cargo xtask budget` counts its instructions. Gives the rotation at the time when the voltage acts, in 2^-30.
    #[inline(never)]
    fn current_loop_core(&mut self, command: &SharedCommand, readings: &SharedReadings) -> Rotation {
        let settings = &self.settings;
        let at = Rotation::by(readings.angle());
        let [a, b, c] = readings.phases();
        let alpha = a.wrapping_shl(1).wrapping_sub(b).wrapping_sub(c).wrapping_mul(settings.alpha);
        let beta = b.wrapping_sub(c).wrapping_mul(settings.beta);
        let direct = sum_of_products(alpha, at.cosine, beta, at.sine);
        let quadrature = sum_of_products(beta, at.cosine, alpha.wrapping_neg(), at.sine);
        readings.set_currents(direct, quadrature);

        let direct_voltage = regulate(
            settings,
            &mut self.direct_integral,
            command.direct.get().wrapping_sub(direct),
            command.direct_voltage.get(),
            command.longest_direct.get(),
        );
        let quadrature_voltage = regulate(
            settings,
            &mut self.quadrature_integral,
            command.quadrature.get().wrapping_sub(quadrature),
            command.quadrature_voltage.get(),
            rest_of_circle(direct_voltage, command.longest.get(), command.inverse.get()),
        );
        readings.set_voltages(direct_voltage, quadrature_voltage);

        let then = at.half_then(command.ahead());
        let alpha = sum_of_products(direct_voltage, then.cosine, quadrature_voltage.wrapping_neg(), then.sine);
        let beta = sum_of_products(direct_voltage, then.sine, quadrature_voltage, then.cosine);
        let [alpha, side] = [rounded_product(alpha, command.counts.get()), rounded_product(beta, command.side.get())];
        self.counts = space_vector(alpha, side, settings.middle);
        then
    }
}

/// The commanded current at a rotation in 2^-30: alpha and beta, in 2^-24 of peak.
#[inline]
fn commanded(command: &SharedCommand, at: Rotation) -> [i32; 2] {
    let (direct, quadrature) = (command.direct.get(), command.quadrature.get());
    [
        sum_of_products(direct, at.cosine, quadrature.wrapping_neg(), at.sine),
        sum_of_products(direct, at.sine, quadrature, at.cosine),
    ]
}

/// Proportional and integral part with feed-forward, within +-`limit`.
///
/// The integral part stands still while the voltage is at its limit and the error would push it further: nothing winds up, and an error
/// that leads back is integrated at once.
#[inline]
fn regulate(settings: &CurrentLoopSettings, integral: &mut i32, error: i32, feed_forward: i32, limit: i32) -> i32 {
    let grown = integral.wrapping_add(high_product(error, settings.integral));
    let wanted = feed_forward.wrapping_add(grown >> 4).wrapping_add(high_product(error, settings.proportional));
    // What lies within the limits is, moved up by one of them, an unsigned number of at most twice that. A comparison and a branch are
    // cheaper than the four that a limit takes, and the other way is not longer than those.
    if wanted.wrapping_add(limit).cast_unsigned() <= limit.cast_unsigned().wrapping_shl(1) {
        *integral = grown;
        return wanted;
    }
    if (error ^ wanted) < 0 {
        *integral = grown;
    }
    if wanted < 0 { limit.wrapping_neg() } else { limit }
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
