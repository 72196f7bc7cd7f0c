//! Field weakening: a negative flux-producing current that keeps the voltage of a fast motor within what the bus gives.
//!
//! An integrator compares the length of the voltage vector with a share of the longest one. It needs no data of the motor but one: its
//! limit must not be above the current that cancels the flux of the magnets, flux / inductance, because beyond it more current raises
//! the voltage again. What the peak current leaves beside the flux-producing current is the limit of the torque-producing one.
//!
//! A bridge that is closed on a motor that is already too fast leaves the integrator no time: within a millisecond the magnets would drive more
//! current than the bridge bears. There it starts with what the data of the motor say.

use super::command::{BusScale, MotorModel};
use super::readings::CurrentReadings;
use crate::arithmetic::division::divide_rounding;
use crate::arithmetic::trigonometry::high_product;
use crate::error::{SettingsError, in_range};
use crate::units::CurrentFraction;

/// Parameters of field weakening.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FieldWeakeningParameters {
    /// Largest flux-producing current in 0.01 % of the peak current S-0-0110, 0 ..= 9 000; 0 switches field weakening off.
    pub limit: u16,
    /// Voltage that is held, in 0.01 % of the longest vector, 5 000 ..= 9 700. The rest is what the current loop controls with; above
    /// 97 % the voltage limit of the current loop would hide the need.
    pub voltage: u16,
    /// Integral action time in 0.1 ms, 40 ..= 10 000: after it, a motor without voltage at all would have gained the peak current. Eight
    /// ticks of the supervision leave a margin of eight to the gain at which the voltage would swing.
    pub integral_time: u16,
}

/// Field weakening, scaled.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct FieldWeakeningSettings {
    /// Largest flux-producing current, 2^-30 of peak.
    limit: i32,
    /// Voltage that is held, 2^-31 of the longest vector, and its square, 2^-30.
    held: i32,
    square: i32,
    /// From the difference of squares, 2^-30, to the current per tick of the supervision, 2^-30 of peak, in 2^-32.
    rate: i32,
}

impl FieldWeakeningSettings {
    /// Without field weakening.
    pub const OFF: Self = Self { limit: 0, held: 0, square: 0, rate: 0 };

    /// Scales the parameters. Divides.
    ///
    /// # Errors
    /// [`SettingsError::OutOfRange`] for a value outside the range that [`FieldWeakeningParameters`] states.
    pub fn new(parameters: &FieldWeakeningParameters) -> Result<Self, SettingsError> {
        let limit = in_range("field weakening current", parameters.limit.into(), 0, 9_000)?;
        let voltage = in_range("field weakening voltage", parameters.voltage.into(), 5_000, 9_700)?;
        let time = in_range("field weakening integral action time", parameters.integral_time.into(), 40, 10_000)?;
        let square = i128::from(voltage).saturating_mul(voltage.into());
        // All below 2^31. A tick is 5 times 0.1 ms.
        Ok(Self {
            limit: divide_rounding(i128::from(limit) << 30, 10_000) as i32,
            held: divide_rounding(i128::from(voltage) << 31, 10_000) as i32,
            square: divide_rounding(square << 30, 100_000_000) as i32,
            rate: divide_rounding(5 << 32, time.into()) as i32,
        })
    }
}

/// What field weakening asks for in a tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct WeakeningOutput {
    /// Flux-producing current: 0 or negative.
    pub direct: CurrentFraction,
    /// Largest magnitude of the torque-producing current: within the circle of the peak current, by up to 2.3 % of peak.
    pub quadrature_limit: CurrentFraction,
    /// The field is weakened.
    pub active: bool,
}

/// State of field weakening.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct FieldWeakening {
    /// 2^-30 of peak, 0 or negative.
    direct: i32,
}

impl FieldWeakening {
    /// Starts with the full field.
    #[must_use]
    pub const fn new() -> Self {
        Self { direct: 0 }
    }

    /// Back to the full field: without a bridge there is nothing to weaken it with.
    pub fn reset(&mut self) {
        self.direct = 0;
    }

    /// Starts with what a bridge needs that is switched on while the magnets induce this voltage, volt 2^-14.
    pub fn preset(
        &mut self,
        settings: &FieldWeakeningSettings,
        model: &MotorModel,
        magnets: i32,
        bus: &BusScale,
    ) -> WeakeningOutput {
        let held = high_product(bus.longest, settings.held).wrapping_shl(1);
        let wanted = i32::from(model.weakening(magnets, held).to_bits()).wrapping_shl(15);
        self.direct = wanted.max(settings.limit.wrapping_neg());
        self.output()
    }

    /// One tick of the supervision, with what the current loop gave last and the bus voltage that it worked with.
    #[inline]
    pub fn tick(
        &mut self,
        settings: &FieldWeakeningSettings,
        readings: &CurrentReadings,
        bus: &BusScale,
    ) -> WeakeningOutput {
        let direct = square_of_share(readings.direct_voltage, bus);
        let quadrature = square_of_share(readings.quadrature_voltage, bus);
        // Each square is below 2^30.
        let margin = settings.square.wrapping_sub(direct.wrapping_add(quadrature));
        let grown = self.direct.wrapping_add(high_product(margin, settings.rate));
        self.direct = grown.min(0).max(settings.limit.wrapping_neg());
        self.output()
    }

    #[inline]
    fn output(&self) -> WeakeningOutput {
        // Within -0.9 ..= 0 of 2^15.
        let direct = (self.direct.wrapping_add(1 << 14) >> 15) as i16;
        WeakeningOutput {
            direct: CurrentFraction::from_bits(direct),
            quadrature_limit: CurrentFraction::from_bits(rest_of_peak(direct)),
            active: direct < 0,
        }
    }
}

/// Square of a voltage as a share of the longest vector, 2^-30; below 1, for a bus that has just fallen.
#[inline]
fn square_of_share(voltage: i32, bus: &BusScale) -> i32 {
    let share = high_product(voltage, bus.inverse).clamp(-LONGEST_SHARE, LONGEST_SHARE);
    share.wrapping_mul(share)
}

/// In 2^-15.
const LONGEST_SHARE: i32 = i16::MAX as i32;

/// sqrt(1 - direct^2) in 2^-15, or up to 0.023 less, never more; for `direct` up to 0.91.
#[inline]
fn rest_of_peak(direct: i16) -> i16 {
    let square = i32::from(direct).wrapping_mul(direct.into());
    // 1 - x/2 - x^2/4 stays below sqrt(1 - x) up to x = 0.83.
    let twice_less = square.wrapping_add(high_product(square, square).wrapping_shl(1));
    // Within 0.42 ..= 1 of 2^15.
    LONGEST_SHARE.wrapping_sub(twice_less.wrapping_add(0xFFFF) >> 16) as i16
}

#[cfg(test)]
mod tests {
    use super::*;

    const PARAMETERS: FieldWeakeningParameters =
        FieldWeakeningParameters { limit: 6_000, voltage: 9_500, integral_time: 100 };

    fn bus(volts: i32) -> BusScale {
        BusScale::new(volts << 14, ((1_i64 << 44) / (i64::from(volts) << 14)) as i32, 5_250)
    }

    /// A voltage of a share of the longest vector, at an angle to the d axis in radians.
    fn readings(bus: &BusScale, share: f64, angle: f64) -> CurrentReadings {
        let length = share * f64::from(bus.longest());
        CurrentReadings {
            direct_voltage: (length * angle.cos()) as i32,
            quadrature_voltage: (length * angle.sin()) as i32,
            ..CurrentReadings::default()
        }
    }

    #[test]
    fn the_field_is_weakened_above_the_voltage_that_is_held_and_not_below() {
        let settings = FieldWeakeningSettings::new(&PARAMETERS).unwrap();
        for volts in [24, 320, 800] {
            let bus = bus(volts);
            for angle in [0.0, 0.7, 1.57, 2.5, -1.0] {
                let mut weakening = FieldWeakening::new();
                for _ in 0..200 {
                    let output = weakening.tick(&settings, &readings(&bus, 0.949, angle), &bus);
                    assert!(!output.active && output.direct == 0, "{volts} V {angle}: {output:?}");
                    assert_eq!(output.quadrature_limit, CurrentFraction::MAX);
                }
                for _ in 0..200 {
                    weakening.tick(&settings, &readings(&bus, 0.951, angle), &bus);
                }
                assert!(weakening.tick(&settings, &readings(&bus, 0.951, angle), &bus).active, "{volts} V {angle}");
            }
        }
    }

    #[test]
    fn the_current_grows_by_the_difference_of_squares_in_the_integral_action_time() {
        let settings = FieldWeakeningSettings::new(&PARAMETERS).unwrap();
        let bus = bus(320);
        let mut weakening = FieldWeakening::new();
        let mut current = 0.0;
        for _ in 0..20 {
            current = weakening.tick(&settings, &readings(&bus, 0.999, 1.2), &bus).direct.to_num::<f64>();
        }
        let expected = 0.95_f64.powi(2) - 0.999_f64.powi(2);
        assert!((current / expected - 1.0).abs() < 0.01, "{current}, not {expected}");
    }

    #[test]
    fn the_current_stops_at_its_limit_and_leaves_it_at_once() {
        let settings = FieldWeakeningSettings::new(&PARAMETERS).unwrap();
        let bus = bus(320);
        let mut weakening = FieldWeakening::new();
        let mut output = weakening.tick(&settings, &readings(&bus, 1.9, 0.785), &bus);
        for _ in 0..500 {
            output = weakening.tick(&settings, &readings(&bus, 1.9, 0.785), &bus);
        }
        assert_eq!(output.direct, CurrentFraction::from_num(-0.6));
        let back = weakening.tick(&settings, &readings(&bus, 0.0, 0.5), &bus).direct;
        let step = (back - output.direct).to_num::<f64>();
        assert!((step - 0.9025 / 20.0).abs() < 1e-4, "{step}");
        weakening.reset();
        assert!(!weakening.tick(&settings, &readings(&bus, 0.5, 0.5), &bus).active);
        let off = FieldWeakening::new().tick(&FieldWeakeningSettings::OFF, &readings(&bus, 1.0, 0.5), &bus);
        assert!(!off.active && off.quadrature_limit == CurrentFraction::MAX);
    }

    #[test]
    fn a_start_at_speed_asks_for_what_the_magnets_have_too_much_and_for_no_more_than_the_limit() {
        let settings = FieldWeakeningSettings::new(&PARAMETERS).unwrap();
        // 0.2 Vs, 5 mH at 20 A: the peak current takes half of the flux away.
        let model = MotorModel::new(5_000, 5_000, 200_000, 20_000).unwrap();
        let bus = bus(320);
        let longest = f64::from(bus.longest()) / 16_384.0;
        let start = |magnets: f64| {
            let mut weakening = FieldWeakening { direct: -1 << 20 };
            weakening.preset(&settings, &model, (magnets * 16_384.0) as i32, &bus)
        };
        for sign in [-1.0, 1.0] {
            let output = start(sign * longest);
            assert!(output.active && (output.direct.to_num::<f64>() + 0.1).abs() < 0.001, "5 % of it: {output:?}");
            assert_eq!(start(sign * 3.0 * longest).direct, CurrentFraction::from_num(-0.6));
            let below = start(sign * 0.94 * longest);
            assert!(!below.active && below.quadrature_limit == CurrentFraction::MAX, "{below:?}");
        }
        let off = FieldWeakening::new().preset(&FieldWeakeningSettings::OFF, &model, i32::MAX, &bus);
        assert!(!off.active, "{off:?}");
    }

    #[test]
    fn both_currents_together_stay_within_the_peak_current_and_hardly_below_it() {
        for direct in -29_491..=0_i16 {
            let share = f64::from(direct) / 32_768.0;
            let error = f64::from(rest_of_peak(direct)) / 32_768.0 - (1.0 - share * share).sqrt();
            assert!((-0.023..=0.0).contains(&error), "{share}: {error}");
        }
        assert!((f64::from(rest_of_peak(-16_384)) / 32_768.0 - 0.859_4).abs() < 1e-3, "1 - 1/8 - 1/64");
    }

    #[test]
    fn values_out_of_range_are_refused() {
        let refused = |parameters| FieldWeakeningSettings::new(&parameters).unwrap_err();
        let out_of_range =
            |parameter, actual, minimum, maximum| SettingsError::OutOfRange { parameter, actual, minimum, maximum };
        assert_eq!(
            refused(FieldWeakeningParameters { limit: 9_001, ..PARAMETERS }),
            out_of_range("field weakening current", 9_001, 0, 9_000)
        );
        assert_eq!(
            refused(FieldWeakeningParameters { voltage: 9_701, ..PARAMETERS }),
            out_of_range("field weakening voltage", 9_701, 5_000, 9_700)
        );
        assert_eq!(
            refused(FieldWeakeningParameters { integral_time: 39, ..PARAMETERS }),
            out_of_range("field weakening integral action time", 39, 40, 10_000)
        );
    }
}
