//! The compensation of the cogging: P-0-0251, and the table P-0-0252.

use sercos::Idn;
use sercos::capacity::TABLE_ENTRIES;
use sercos::parameters::Parameters;
use servo::SettingsError;
use servo::axis::{COGGING_POINTS, CoggingScale, CoggingSettings};
use servo::motor::{Facts, MotorSettings};

use super::invalid::{InvalidSetting, invalid};
use crate::hardware::LOOP_PERIOD_MICROSECONDS;

/// P-0-0252.
pub(crate) const COGGING_TABLE: Idn = Idn::product(252);

const _: () = assert!(TABLE_ENTRIES == COGGING_POINTS, "the data block has a number for each point");

/// Scales the parameters. Divides.
///
/// # Errors
/// A table with a current beyond a quarter of S-0-0110, or beyond two bytes.
pub(super) fn settings(
    parameters: &Parameters,
    facts: &Facts,
    motor: &MotorSettings,
) -> Result<CoggingSettings, InvalidSetting> {
    let maximum = scale(parameters)?.largest();
    let points = parameters.table(COGGING_TABLE).iter();
    let actual = points.map(|point| point.cast_signed().unsigned_abs()).max().unwrap_or(0);
    if actual > maximum {
        let parameter = "magnitude of a current of the table in mA";
        let [actual, maximum] = [actual, maximum].map(u32::from);
        let reason = SettingsError::OutOfRange { parameter, actual, minimum: 0, maximum };
        return Err(InvalidSetting { idn: COGGING_TABLE, reason: Some(reason) });
    }
    let is_on = parameters.get_word(Idn::product(251)) != 0;
    Ok(CoggingSettings::new(is_on, has_index(parameters), lead(facts, motor)))
}

/// From mA RMS to the points of the loops. Divides.
///
/// # Errors
/// Without peak current.
pub(crate) fn scale(parameters: &Parameters) -> Result<CoggingScale, InvalidSetting> {
    CoggingScale::new(parameters.get(Idn::standard(110))).map_err(invalid(110))
}

/// P-0-0117.
pub(crate) fn has_index(parameters: &Parameters) -> bool {
    parameters.get_word(Idn::product(117)) != 0
}

/// In ns, from the instant to which a measured position belongs to that at which the torque of the tick's order is there.
///
/// The order is taken by the second cycle of the current loop in the tick, at 8 kHz by the first of the next one; what is ordered stays for a
/// tick, half of which is its middle; and the current is behind it by the time constant of its loop, in which the delay of the bridge
/// cancels: `1 / (1 + s / w e^sT)` is late by `1 / w`.
fn lead(facts: &Facts, motor: &MotorSettings) -> u32 {
    const TICK: u32 = LOOP_PERIOD_MICROSECONDS as u32 * 1_000;
    let (taken, age) = if facts.reads_the_encoder_twice() { (TICK / 2, TICK / 4) } else { (TICK, 0) };
    let behind = motor.current_loop_time().unwrap_or(0).saturating_mul(1_000);
    let acts = taken.saturating_add(TICK / 2).saturating_add(behind);
    acts.saturating_add(age).saturating_sub(facts.sample_to_count.into())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dictionary::source;
    use crate::service::rig::FACTS;
    use crate::settings::DriveSettings;

    fn with_point(milliamperes: i16) -> Result<DriveSettings, InvalidSetting> {
        let mut parameters = crate::service::rig::parameters();
        let mut table = [0; TABLE_ENTRIES];
        table[1_000] = milliamperes.cast_unsigned();
        parameters.set_table(COGGING_TABLE, &table).unwrap();
        DriveSettings::new(&parameters, &FACTS, source)
    }

    #[test]
    fn a_table_beyond_a_quarter_of_the_peak_current_is_refused_with_its_current() {
        // 14.142 A.
        assert!(with_point(3_535).is_ok() && with_point(-3_535).is_ok());
        for milliamperes in [3_536, -3_536, i16::MIN] {
            let error = with_point(milliamperes).unwrap_err();
            let actual = milliamperes.unsigned_abs().into();
            let parameter = "magnitude of a current of the table in mA";
            let expected = SettingsError::OutOfRange { parameter, actual, minimum: 0, maximum: 3_535 };
            assert_eq!((error.idn, error.reason), (COGGING_TABLE, Some(expected)));
        }
    }

    #[test]
    fn the_order_acts_later_where_the_current_loop_is_slower() {
        let lead_with = |gain: u64| {
            let mut parameters = crate::service::rig::parameters();
            parameters.set(Idn::standard(106), gain).unwrap();
            lead(&FACTS, &DriveSettings::new(&parameters, &FACTS, source).unwrap().motor)
        };
        // 62.5 us to the cycle, 62.5 us for half a tick, 29.05 us since the reading; 6 mH by 20 and by 10 V/A.
        let (fast, slow) = (lead_with(20_000), lead_with(10_000));
        assert!((453_000..456_000).contains(&fast), "{fast}");
        assert!((753_000..757_000).contains(&slow), "{slow}");
    }
}
