//! What an amplifier is built for, which nobody but who has built it can know.

use sercos::Idn;
use servo::SettingsError;

use crate::settings::current::{amplitude, rms};
use crate::settings::invalid::InvalidSetting;

/// Ratings of an amplifier. Currents are RMS values of a phase where they are not said to be instantaneous.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Amplifier {
    /// Largest current of the bridge, in mA.
    pub peak_current: u32,
    /// Current that the bridge carries for ever, in mA.
    pub continuous_current: u32,
    /// Current at which the bridge is switched off, at the crest of a sine with this RMS value, in mA.
    pub trip_current: u32,
    /// Instantaneous phase current at full deflection of the sensors, in mA, as it was measured on this one.
    pub current_range: u32,
    /// Instantaneous phase current up to which the dead time is compensated in proportion, in mA; 0: no compensation.
    pub dead_time_band: u16,
    /// Bus voltage at the end of the converter's range, in V, as it was measured on this one.
    pub bus_range: u16,
    /// Bus voltage below which the bridge does not work, in V.
    pub undervoltage: u16,
    /// Bus voltage above which the bridge is switched off, in V.
    pub overvoltage: u16,
    /// Bus voltage that link and bridge bear while the bridge is off, in V.
    pub withstand_voltage: u16,
    /// Smallest resistor for the switch of the brake chopper, in 0.1 Ohm; 0: there is no such switch.
    pub least_resistance: u16,
    /// Temperature of the heat sink from which there is a warning, in 0.1 degrees Celsius.
    pub warning_temperature: u16,
    /// Temperature of the heat sink at which the bridge is switched off, in 0.1 degrees Celsius.
    pub shutdown_temperature: u16,
    /// Thermal time constant of the bridge, in ms.
    pub thermal_time_constant: u32,
}

impl Amplifier {
    /// Whether these can be the ratings of a drive. S-0-0128 looks, and whoever writes them down.
    ///
    /// # Errors
    /// The first rating that cannot.
    pub fn check(&self) -> Result<(), InvalidSetting> {
        let [standard, product]: [fn(u16) -> Idn; 2] = [Idn::standard, Idn::product];
        let Self { peak_current, current_range, overvoltage, shutdown_temperature, .. } = *self;
        let peak = amplitude(peak_current);
        // The last fiftieth of a converter's range is that of its errors: a level there might never be seen.
        let shown = self.bus_range.saturating_sub(self.bus_range.div_ceil(50));
        // An eighth above it main power is there.
        let most_undervoltage = u32::from(overvoltage).saturating_mul(8).saturating_sub(1) / 9;
        let ratings: [(Idn, &'static str, u32, [u32; 2]); 10] = [
            (standard(110), "peak current in mA", peak_current, [1, 500_000]),
            (standard(112), "continuous current in mA", self.continuous_current, [1, peak_current]),
            (product(100), "range of the current sensors in mA", current_range, [peak, peak.saturating_mul(8)]),
            // Both are rounded.
            (
                product(106),
                "trip current in mA",
                self.trip_current,
                [peak_current, rms(current_range).saturating_add(1)],
            ),
            (product(101), "range of the bus voltage in V", self.bus_range.into(), [50, 4_000]),
            (product(105), "overvoltage in V", overvoltage.into(), [1, shown.min(self.withstand_voltage).into()]),
            (product(104), "undervoltage in V", self.undervoltage.into(), [1, most_undervoltage]),
            (standard(203), "shut-down temperature in 0.1 C", shutdown_temperature.into(), [2, 2_000]),
            (
                standard(200),
                "warning temperature in 0.1 C",
                self.warning_temperature.into(),
                [1, shutdown_temperature.saturating_sub(1).into()],
            ),
            (product(131), "thermal time constant in ms", self.thermal_time_constant, [1_000, 3_600_000]),
        ];
        for (idn, parameter, actual, [minimum, maximum]) in ratings {
            if actual < minimum || actual > maximum {
                let reason = Some(SettingsError::OutOfRange { parameter, actual, minimum, maximum });
                return Err(InvalidSetting { idn, reason });
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::service::rig::AMPLIFIER;

    #[test]
    fn each_rating_has_a_range_and_one_beyond_it_is_named() {
        assert_eq!(AMPLIFIER.check(), Ok(()));
        type Change = fn(&mut Amplifier);
        let refused = |change: Change| {
            let mut amplifier = AMPLIFIER;
            change(&mut amplifier);
            amplifier.check().err().map(|setting| setting.idn)
        };
        let [standard, product]: [fn(u16) -> Idn; 2] = [Idn::standard, Idn::product];
        let changes: [(Idn, Change); 16] = [
            (standard(110), |amplifier| amplifier.peak_current = 0),
            (standard(110), |amplifier| amplifier.peak_current = 500_001),
            (standard(112), |amplifier| amplifier.continuous_current = 14_143),
            (standard(112), |amplifier| amplifier.continuous_current = 0),
            (product(100), |amplifier| amplifier.current_range = 19_999),
            (product(100), |amplifier| amplifier.current_range = 160_001),
            (product(106), |amplifier| amplifier.trip_current = 14_141),
            (product(106), |amplifier| amplifier.trip_current = 17_680),
            (product(101), |amplifier| amplifier.bus_range = 4_001),
            (product(105), |amplifier| amplifier.overvoltage = 491),
            (product(105), |amplifier| amplifier.withstand_voltage = 439),
            (product(104), |amplifier| amplifier.undervoltage = 0),
            (product(104), |amplifier| amplifier.undervoltage = 392),
            (standard(203), |amplifier| amplifier.shutdown_temperature = 2_001),
            (standard(200), |amplifier| amplifier.warning_temperature = 900),
            (product(131), |amplifier| amplifier.thermal_time_constant = 999),
        ];
        for (index, (idn, change)) in changes.into_iter().enumerate() {
            assert_eq!(refused(change), Some(idn), "{index}");
        }
        assert_eq!(refused(|amplifier| amplifier.overvoltage = 490), None);
        assert_eq!(refused(|amplifier| amplifier.undervoltage = 391), None);
    }
}
