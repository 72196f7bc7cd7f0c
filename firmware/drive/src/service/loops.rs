//! What the parameters make of the loops.

use sercos::Idn;
use sercos::parameters::Parameters;
use servo::motor::{BoardKind, Facts};

use crate::amplifier::Amplifier;
use crate::dictionary::{parameters_on, source};
use crate::hardware::Hardware;
use crate::settings::DriveSettings;
use crate::settings::invalid::InvalidSetting;

/// The settings of the loops. About a millisecond; divides.
///
/// # Errors
/// The first parameter that the drive cannot work with.
pub(crate) fn settings<H: Hardware>(parameters: &Parameters) -> Result<DriveSettings, InvalidSetting> {
    DriveSettings::new(parameters, &<H::Board>::FACTS, source)
}

/// Whether the loops can work with the parameters.
pub(super) fn accept<H: Hardware>(parameters: &Parameters) -> Result<(), InvalidSetting> {
    settings::<H>(parameters).map(|_| ())
}

/// The defaults on this amplifier, without a motor that could not go with it: for a drive that has yet to be told one. The brake resistor is that of `others`.
#[must_use]
pub fn without_motor(amplifier: &Amplifier, facts: &Facts, others: Option<&Parameters>) -> Parameters {
    let mut parameters = parameters_on(amplifier, facts);
    let slow = [
        (Idn::standard(100), 1),
        (Idn::standard(106), 100),
        (Idn::standard(109), amplifier.peak_current),
        (Idn::standard(111), amplifier.continuous_current),
        // No magnets, no inductance, and so no field to weaken.
        (Idn::product(107), 0),
        (Idn::product(112), 0),
        (Idn::product(113), 0),
        (Idn::product(114), 0),
    ];
    let resistor = [235, 236, 237].map(Idn::product);
    let resistor = others.into_iter().flat_map(|others| resistor.map(|idn| (idn, others.get(idn))));
    for (idn, value) in slow.into_iter().chain(resistor) {
        // Within the range of its data block; a test tries amplifiers of every size.
        let _ = parameters.set(idn, value.into());
    }
    parameters
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::service::rig::{AMPLIFIER, FACTS};

    /// Also with a set of which nothing goes together: the scales are the amplifier's, and its resistor is there.
    #[test]
    fn an_amplifier_of_any_size_makes_a_drive_that_has_not_been_told_its_motor() {
        let mut others = parameters_on(&AMPLIFIER, &FACTS);
        others.set(Idn::standard(106), 65_535).unwrap();
        for (number, value) in [(235, 1_000), (236, 500)] {
            others.set(Idn::product(number), value).unwrap();
        }
        let mut tried = 0;
        for peak_current in [100, 1_000, 5_657, 42_426, 150_000, 500_000] {
            for (bus_range, overvoltage) in [(50, 40), (100, 75), (500, 440), (1_000, 784), (4_000, 3_900)] {
                for (thermal_time_constant, share) in [(1_000, 2), (5_000, 1), (3_600_000, 20)] {
                    let amplifier = Amplifier {
                        peak_current,
                        continuous_current: peak_current / share,
                        trip_current: peak_current * 5 / 4,
                        current_range: peak_current * 9 / 5,
                        bus_range,
                        overvoltage,
                        undervoltage: overvoltage / 2,
                        withstand_voltage: overvoltage,
                        thermal_time_constant,
                        ..AMPLIFIER
                    };
                    assert_eq!(amplifier.check(), Ok(()), "{amplifier:?}");
                    let parameters = without_motor(&amplifier, &FACTS, Some(&others));
                    match DriveSettings::new(&parameters, &FACTS, source) {
                        Ok(settings) => {
                            let scale = servo::arithmetic::Gain::from_ratio(u128::from(bus_range) * 1_000, 4_096);
                            assert_eq!(Some(settings.motor.bus_millivolts), scale, "{amplifier:?}");
                            assert_eq!(parameters.get(Idn::product(235)), 1_000);
                            tried += 1;
                        }
                        // More heat than the model's shortest step can follow is no amplifier's.
                        Err(error) => assert_eq!((error.idn, share), (Idn::product(131), 20), "{error}: {amplifier:?}"),
                    }
                }
            }
        }
        assert!(tried >= 60, "{tried}");
    }
}
