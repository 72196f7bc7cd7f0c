//! What the DC link leaves of the current that feeds it: a motor that brakes must not charge it to its overvoltage threshold.
//!
//! From 93 % of the threshold on the current whose torque acts against the rotation falls along a straight line, to nothing at 97.5 %. Where a
//! chopper works it begins above the chopper's own level, for a resistor that is too small for the brake. A stop gets longer by it; the
//! overvoltage would have ended it with a motor that coasts.
//!
//! Two currents are not taken. Below a speed at which the windings burn more than the rotation gives there is nothing to be limited: an
//! axis at rest holds its load with any voltage of the link. And an axis with a brake keeps its continuous current, because its load may hang: it
//! must not fall because the link is full. If the link gets fuller still, the overvoltage takes the torque off and closes the brake.

use crate::arithmetic::gain::Gain;
use crate::error::{SettingsError, in_range};
use crate::monitor::chopper::part_of;
use crate::units::CurrentFraction;

/// Parameters of the limit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct GeneratingParameters {
    /// Voltage of a sample of 4096 in V, 50 ..= 4000.
    pub full_scale: u16,
    /// Overvoltage threshold in V.
    pub overvoltage: u16,
    /// Resistance of a phase in mOhm.
    pub resistance: u32,
    /// Amplitude of the motor's continuous current in mA.
    pub continuous_current: u32,
    /// Amplitude of the amplifier's peak current in mA: the unit of [`CurrentFraction`].
    pub peak_current: u32,
    /// The load may hang: a brake is fitted.
    pub holds_a_load: bool,
}

/// Parts of the overvoltage threshold in 0.1 %: where the limit begins without and with a chopper, and where nothing is left.
const BEGIN: u32 = 930;
const BEGIN_ABOVE_THE_CHOPPER: u32 = 960;
const END: u32 = 975;

/// The limit, scaled.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct GeneratingSettings {
    /// Samples of the bus voltage at which the limit begins: without and with a chopper that works.
    begin: [u16; 2],
    /// And at which nothing is left.
    end: u16,
    /// Counts below the end to a current in 2^-15 of the peak.
    slopes: [Gain; 2],
    /// Voltage of the rotation below which nothing is limited, volt 2^-14.
    burned: i32,
    /// Current that is left in any case, 2^-15 of the peak.
    least: i16,
}

impl GeneratingSettings {
    /// Scales the parameters. Divides.
    ///
    /// # Errors
    /// [`SettingsError::OutOfRange`] for a parameter beyond its range.
    pub fn new(parameters: &GeneratingParameters) -> Result<Self, SettingsError> {
        let full_scale = in_range("bus voltage at full scale", parameters.full_scale.into(), 50, 4_000)?;
        let overvoltage = in_range("overvoltage threshold", parameters.overvoltage.into(), 1, full_scale)?;
        let peak = in_range("amplifier peak current S-0-0110", parameters.peak_current, 1, u32::MAX)?;
        let end = part_of(overvoltage, END, full_scale);
        let begin = [BEGIN, BEGIN_ABOVE_THE_CHOPPER].map(|share| part_of(overvoltage, share, full_scale));
        let slopes = begin.map(|begin| {
            let counts = end.saturating_sub(begin).max(1);
            Gain::from_ratio(LARGEST.into(), counts.into()).unwrap_or(Gain::ZERO)
        });
        // mOhm * mA are uV.
        let microvolts = u64::from(parameters.resistance).saturating_mul(parameters.continuous_current.into());
        let burned = microvolts.saturating_mul(1 << 14) / 1_000_000;
        let continuous = (u64::from(parameters.continuous_current) << 15).checked_div(peak.into()).unwrap_or(0);
        let least = if parameters.holds_a_load { i16::try_from(continuous).unwrap_or(i16::MAX) } else { 0 };
        Ok(Self { begin, end, slopes, burned: i32::try_from(burned).unwrap_or(i32::MAX), least })
    }

    /// Sample of the bus voltage above which [`GeneratingSettings::allowed`] is to be asked.
    #[inline]
    #[must_use]
    pub const fn begin(&self, chopper_works: bool) -> u16 {
        let [without, with] = self.begin;
        if chopper_works { with } else { without }
    }

    /// Magnitude of the current that may feed the link at this sample of its voltage; `None`: nothing is limited at this voltage of the
    /// rotation, volt 2^-14.
    #[must_use]
    pub fn allowed(&self, sample: u16, induced: i32, chopper_works: bool) -> Option<CurrentFraction> {
        if induced.unsigned_abs() <= self.burned.unsigned_abs() {
            return None;
        }
        let [without, with] = self.slopes;
        let slope = if chopper_works { with } else { without };
        let below = i64::from(self.end).wrapping_sub(i64::from(sample)).max(0);
        let allowed = slope.apply(below).clamp(self.least.into(), LARGEST.into());
        // Between two values of 15 bits.
        Some(CurrentFraction::from_bits(allowed as i16))
    }
}

const LARGEST: u16 = i16::MAX as u16;

#[cfg(test)]
mod tests {
    use super::*;

    /// 440 V of 500 V, 1.2 Ohm, 5 A of 20 A.
    const PARAMETERS: GeneratingParameters = GeneratingParameters {
        full_scale: 500,
        overvoltage: 440,
        resistance: 1_200,
        continuous_current: 5_000,
        peak_current: 20_000,
        holds_a_load: false,
    };

    fn sample(share: f64) -> u16 {
        (440.0 * share * 4_096.0 / 500.0) as u16
    }

    const FAST: i32 = 100 << 14;

    fn at(settings: &GeneratingSettings, share: f64, chopper: bool) -> f64 {
        settings.allowed(sample(share), FAST, chopper).unwrap().to_num()
    }

    #[test]
    fn the_current_falls_from_all_at_93_percent_to_nothing_at_97_5_percent() {
        let settings = GeneratingSettings::new(&PARAMETERS).unwrap();
        assert_eq!(settings.begin(false), sample(0.93));
        for (share, expected) in [(0.93, 1.0), (0.94125, 0.75), (0.9525, 0.5), (0.975, 0.0), (1.0, 0.0)] {
            let allowed = at(&settings, share, false);
            assert!((allowed - expected).abs() < 0.01, "{allowed} at {share}");
        }
    }

    #[test]
    fn with_a_chopper_it_begins_above_the_chopper() {
        let settings = GeneratingSettings::new(&PARAMETERS).unwrap();
        assert_eq!(settings.begin(true), sample(0.96));
        for (share, expected) in [(0.96, 1.0), (0.9675, 0.5), (0.975, 0.0)] {
            let allowed = at(&settings, share, true);
            assert!((allowed - expected).abs() < 0.02, "{allowed} at {share}");
        }
    }

    #[test]
    fn what_the_windings_burn_is_not_limited() {
        let settings = GeneratingSettings::new(&PARAMETERS).unwrap();
        // 1.2 Ohm * 5 A = 6 V.
        for (tenths, limited) in [(0, false), (59, false), (-59, false), (61, true), (-61, true)] {
            let induced = (tenths << 14) / 10;
            assert_eq!(settings.allowed(4_095, induced, false).is_some(), limited, "{tenths}");
        }
    }

    #[test]
    fn an_axis_with_a_brake_keeps_the_continuous_current() {
        let settings = GeneratingSettings::new(&GeneratingParameters { holds_a_load: true, ..PARAMETERS }).unwrap();
        for share in [0.98, 0.985, 1.0] {
            let allowed = at(&settings, share, false);
            assert!((0.249..0.26).contains(&allowed), "{allowed} at {share}");
        }
        assert!((at(&settings, 0.9525, false) - 0.5).abs() < 0.01, "and more where there is more");
    }
}
