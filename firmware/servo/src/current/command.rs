//! What the current loop is given once a loop tick: reference, angle, feed-forward and the measure of the bus voltage.

use crate::arithmetic::division::{TEN_TO_15, TWO_PI_TIMES_TEN_TO_15, divide_rounding};
use crate::arithmetic::trigonometry::{Rotation, high_product};
use crate::error::SettingsError;
use crate::units::CurrentFraction;

use super::settings::CurrentLoopSettings;

/// Reference and angle of the current loop, for the cycles until the next loop tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct CurrentCommand {
    /// Flux-producing current, 2^-26 of peak.
    pub direct: i32,
    /// Torque-producing current, 2^-26 of peak.
    pub quadrature: i32,
    /// Electrical angle at `count`, 2^-32 revolution.
    pub angle: u32,
    /// Encoder count that `angle` belongs to.
    pub count: u32,
    /// Electrical angle of one increment, 2^-32 revolution.
    pub angle_per_increment: u32,
    /// From the instant of the sample to the middle of the period in which the voltage acts.
    pub ahead: Rotation,
    /// Feed-forward of the direct voltage, volt 2^-14.
    pub direct_voltage: i32,
    /// Feed-forward of the quadrature voltage, volt 2^-14.
    pub quadrature_voltage: i32,
    /// The bus voltage.
    pub bus: BusScale,
}

impl CurrentCommand {
    /// Current of the reference in the loop's unit.
    #[inline]
    #[must_use]
    pub fn reference(current: CurrentFraction) -> i32 {
        i32::from(current.to_bits()).wrapping_shl(super::settings::CURRENT_BITS.wrapping_sub(15))
    }
}

/// How voltages become counts at the bus voltage of this moment.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct BusScale {
    /// Longest voltage vector, volt 2^-14.
    pub(super) longest: i32,
    /// Longest voltage of the d axis: 29/32 of it, so that the q axis is never left without.
    pub(super) longest_direct: i32,
    /// 2^47 / `longest`.
    pub(super) inverse: i32,
    /// Volt 2^-12 to timer counts 2^-3, in 2^-32.
    pub(super) counts: i32,
    /// sqrt(3)/2 of `counts`.
    pub(super) side: i32,
}

impl BusScale {
    /// From the bus voltage in volt 2^-14 and its reciprocal, 2^44 / voltage; the voltage 24 (48 at 8 kHz) to 1 000 V.
    ///
    /// `reload` is the compare value of a fully switched-on phase. The longest vector is 98 % of the bus over sqrt(3), which leaves
    /// the dead-time compensation its room.
    #[inline]
    #[must_use]
    pub fn new(voltage: i32, reciprocal: i32, reload: u16) -> Self {
        // 2^3 * reload * 2^32 / (v / 4) = 2^44 / v * reload / 2^7; below 21 V, 42 V at 8 kHz, the voltage falls short
        let counts = (i64::from(reciprocal).wrapping_mul(i64::from(reload)) >> 7).min(i32::MAX.into()) as i32;
        let longest = high_product(voltage, LONGEST_SHARE).wrapping_shl(1);
        Self {
            longest,
            longest_direct: longest.wrapping_sub(longest >> 4).wrapping_sub(longest >> 5),
            // 2^47 / (0.5658 v) = 2^44 / v * 14.1
            inverse: high_product(reciprocal, INVERSE_SHARE).wrapping_shl(6),
            counts,
            side: high_product(counts, HALF_ROOT_OF_THREE).wrapping_shl(1),
        }
    }

    /// Longest voltage vector, volt 2^-14.
    #[must_use]
    pub const fn longest(&self) -> i32 {
        self.longest
    }
}

/// 0.98 / sqrt(3) in 2^-31.
const LONGEST_SHARE: i32 = 1_215_053_257;
/// sqrt(3) / 2 in 2^-31.
const HALF_ROOT_OF_THREE: i32 = 1_859_775_393;
/// sqrt(3) / 0.98 * 8 in 2^-26.
const INVERSE_SHARE: i32 = 948_864_997;

/// The motor as the feed-forward knows it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct MotorModel {
    /// Flux linkages at peak current (inductances), as volt 2^-14 per electrical speed, in 2^-32.
    direct: i32,
    quadrature: i32,
    /// Half of that of the magnets.
    half_magnet: i32,
    /// Flux of the peak current as a share of that of the magnets, 2^-16; 0: not known.
    flux_of_peak: u32,
}

impl MotorModel {
    /// Inductances in uH and flux linkage of the magnets in uVs (peak value of a phase), with the peak current in mA.
    ///
    /// # Errors
    /// [`SettingsError::FluxLinkage`] when one of them makes 2.5 Vs or more.
    pub fn new(
        direct_inductance: u32,
        quadrature_inductance: u32,
        flux: u32,
        peak_current: u32,
    ) -> Result<Self, SettingsError> {
        // One step of electrical speed is 2^-32 revolution per tick: 2 pi 8000 / 2^32 rad/s.
        let factor = |nanovoltseconds: i128| {
            let numerator =
                nanovoltseconds.saturating_mul(TWO_PI_TIMES_TEN_TO_15).saturating_mul(8_000).saturating_mul(1 << 14);
            let factor = divide_rounding(numerator, TEN_TO_15.saturating_mul(1_000_000_000));
            if nanovoltseconds < 2_500_000_000 && factor <= i64::from(i32::MAX) {
                Ok(factor as i32)
            } else {
                Err(SettingsError::FluxLinkage)
            }
        };
        let of_inductance = |inductance: u32| i128::from(inductance).saturating_mul(peak_current.into());
        let of_peak = u64::from(direct_inductance).saturating_mul(peak_current.into());
        // uH * mA are nVs.
        let flux_of_peak = (of_peak << 16).checked_div(u64::from(flux).saturating_mul(1_000)).unwrap_or(0);
        Ok(Self {
            direct: factor(of_inductance(direct_inductance))?,
            quadrature: factor(of_inductance(quadrature_inductance))?,
            half_magnet: factor(i128::from(flux).saturating_mul(1_000))? >> 1,
            flux_of_peak: u32::try_from(flux_of_peak).unwrap_or(u32::MAX),
        })
    }

    /// Time constant of a current loop that regulates this motor: the larger inductance by S-0-0106, in us. `None` where one of them is not
    /// known. Divides.
    pub(crate) fn loop_time(&self, settings: &CurrentLoopSettings) -> Option<u32> {
        let inductance = self.direct.max(self.quadrature).unsigned_abs();
        // Volt 2^-14 per 2 pi 8000 / 2^32 rad/s, by volt 2^-20: 2^6 / (2 pi 8000) s.
        let microseconds =
            u64::from(inductance).saturating_mul(1_273).checked_div(u64::from(settings.proportional.unsigned_abs()))?;
        (inductance > 0).then(|| u32::try_from(microseconds).unwrap_or(u32::MAX))
    }

    /// Flux-producing current, 0 or negative, with which magnets that induce `magnets` leave hardly more than `held`, both in volt 2^-14.
    ///
    /// It is looked for bit by bit: nothing divides where it is asked for.
    #[must_use]
    pub fn weakening(&self, magnets: i32, held: i32) -> CurrentFraction {
        // In volt 2^-5, 2 047 V at most.
        let [magnets, held] = [magnets, held].map(|voltage| (voltage.unsigned_abs() >> 9).min(0xFFFF));
        let excess = u64::from(magnets.saturating_sub(held)) << 15;
        let of_peak = u64::from(magnets).wrapping_mul(self.flux_of_peak.into()) >> 16;
        if excess == 0 || of_peak == 0 {
            return CurrentFraction::ZERO;
        }
        let current = (0..15).rev().fold(0_i16, |current, bit| {
            let more = current | 1 << bit;
            // Below 2^47.
            if of_peak.wrapping_mul(u64::from(more.unsigned_abs())) <= excess { more } else { current }
        });
        CurrentFraction::from_bits(current.wrapping_neg())
    }

    /// Voltages (d, q) in volt 2^-14 that the rotation induces at this electrical speed, in 2^-32 revolution per tick.
    #[inline]
    #[must_use]
    pub fn induced(&self, speed: i32, direct: CurrentFraction, quadrature: CurrentFraction) -> (i32, i32) {
        // Half of it: what is linked with a current of -1 is then within 32 bits, and the magnets do not take it beyond.
        let linked = |factor: i32, current: CurrentFraction| {
            (i64::from(factor).wrapping_mul(i64::from(current.to_bits())) >> 16) as i32
        };
        let of_direct = linked(self.direct, direct).wrapping_add(self.half_magnet);
        let of_quadrature = linked(self.quadrature, quadrature);
        (
            high_product(speed, of_quadrature).wrapping_shl(1).wrapping_neg(),
            high_product(speed, of_direct).wrapping_shl(1),
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::current::settings::{CurrentLoopParameters, PwmFrequency};

    #[test]
    fn the_time_of_a_current_loop_is_the_larger_inductance_by_its_gain() {
        let time = |direct, quadrature, gain| {
            let settings = CurrentLoopSettings::new(&CurrentLoopParameters {
                peak_current: 10_000,
                measuring_range: 12_500,
                proportional_gain: gain,
                integral_time: 500,
                frequency: PwmFrequency::Khz16,
                dead_time: 1_000,
                dead_time_band: 100,
            });
            MotorModel::new(direct, quadrature, 200_000, 10_000).unwrap().loop_time(&settings.unwrap())
        };
        for (direct, quadrature, gain, exact) in
            [(5_000, 8_000, 40_000, 200.0), (120_000, 100_000, 7_500, 16_000.0), (6_000, 6_000, 1, 6e6)]
        {
            let time = f64::from(time(direct, quadrature, gain).unwrap());
            assert!((time / exact - 1.0).abs() < 0.01, "{time} us, {exact}");
        }
        assert_eq!(time(0, 0, 40_000), None);
    }

    #[test]
    fn the_induced_voltage_is_speed_times_flux() {
        // 0.2 Vs, 5 and 8 mH at 10 A; 100 electrical revolutions per second.
        let model = MotorModel::new(5_000, 8_000, 200_000, 10_000).unwrap();
        let speed = (100.0 / 8_000.0 * 4_294_967_296.0) as i32;
        let (direct, quadrature) =
            model.induced(speed, CurrentFraction::from_num(-0.5), CurrentFraction::from_num(0.25));
        let volts = |value: i32| f64::from(value) / 16_384.0;
        let omega = 100.0 * core::f64::consts::TAU;
        assert!((volts(direct) + omega * 0.008 * 2.5).abs() < 0.01, "{}", volts(direct));
        assert!((volts(quadrature) - omega * (0.2 - 0.005 * 5.0)).abs() < 0.01, "{}", volts(quadrature));
        assert_eq!(MotorModel::new(0, 0, 2_500_000, 1), Err(SettingsError::FluxLinkage));
        assert_eq!(MotorModel::new(300_000, 0, 1, 10_000), Err(SettingsError::FluxLinkage));
    }

    #[test]
    fn what_weakens_the_field_takes_the_voltage_of_the_magnets_to_what_is_held_in_both_directions() {
        // 0.2 Vs, 5 mH at 10 A: the peak current makes a quarter of the flux.
        let model = MotorModel::new(5_000, 8_000, 200_000, 10_000).unwrap();
        let volts = |volts: f64| (volts * 16_384.0) as i32;
        for (magnets, held) in [(200.0, 181.0), (-200.0, 181.0), (1_000.0, 990.0), (60.0, 50.0)] {
            let current = model.weakening(volts(magnets), volts(held)).to_num::<f64>();
            let expected = -(1.0 - held / f64::abs(magnets)) * 4.0;
            assert!((current - expected).abs() < 0.003, "{magnets} V: {current}, not {expected}");
        }
        assert_eq!(model.weakening(volts(180.0), volts(181.0)), CurrentFraction::ZERO, "there is voltage enough");
        assert_eq!(model.weakening(0, 0), CurrentFraction::ZERO);
        assert_eq!(model.weakening(volts(500.0), 0), CurrentFraction::from_bits(-i16::MAX), "never beyond the peak");
        let unknown = MotorModel::new(0, 0, 200_000, 10_000).unwrap();
        assert_eq!(unknown.weakening(volts(500.0), volts(181.0)), CurrentFraction::ZERO);
    }

    #[test]
    fn the_bus_scale_turns_volts_into_counts_from_24_to_1000_volts() {
        for volts in [24_i64, 48, 320, 560, 1_000] {
            let voltage = volts << 14;
            let bus = BusScale::new(voltage as i32, ((1_i64 << 44) / voltage) as i32, 5_250);
            let longest = f64::from(bus.longest) / 16_384.0;
            assert!((f64::from(bus.side) / f64::from(bus.counts) - 0.75_f64.sqrt()).abs() < 1e-6);
            assert!((longest / (volts as f64 * 0.98 / 3_f64.sqrt()) - 1.0).abs() < 3e-5, "{volts} V: {longest}");
            let counts = high_product((voltage / 8) as i32, bus.counts);
            assert!((20_985..=21_000).contains(&counts), "half the bus is half the period: {counts}");
            let inverse = f64::from(bus.inverse) * f64::from(bus.longest) / (1_u64 << 47) as f64;
            assert!((inverse - 1.0).abs() < 1e-4, "{volts} V: {inverse}");
        }
    }
}
