//! What a temperature is measured with: the sensor's data sheet and the divider of the board, worked out by the compiler into a table from the
//! sample of the converter to the temperature.
//!
//! The sensor lies between the input and ground, a resistor of the board between the input and its supply. A broken wire shows the supply, and a
//! short circuit ground, whatever the sensor is.

mod data_sheets;

use data_sheets::DataSheet;

/// Kind of a temperature sensor. P-0-0134 has the number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[repr(u16)]
pub enum TemperatureSensor {
    /// There is none.
    None = 0,
    /// KTY84-130: silicon, 1 000 Ohm at 100 degrees C, rising.
    Kty84 = 1,
    /// Pt1000 of IEC 60751: platinum, 1 000 Ohm at 0 degrees C, rising.
    Pt1000 = 2,
    /// Resistor with negative coefficient, 10 kOhm at 25 degrees C, B25/85 of 3 435 K.
    Ntc10k = 3,
    /// PTC thermistors of DIN 44081 or 44082, one to three in series: cold or hot, without degrees.
    Ptc = 4,
    /// A switch that opens when it is hot.
    Switch = 5,
    /// Resistor with negative coefficient as power modules have it, 5 kOhm at 25 degrees C, B25/50 of 3 375 K.
    Ntc5k = 6,
}

/// What a board has between the supply of a sensor and the input of its converter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Divider {
    /// Resistor from the input to the supply, in Ohm. Of a few times the resistance that the sensors have when they are hot: a far larger one leaves
    /// a Pt1000 less than two counts a kelvin, and bends the curve of a hot resistor with negative coefficient within an interval of [`Curve`].
    pub pull_up: u32,
    /// Supply of the resistor in mV.
    pub supply: u32,
    /// Voltage in mV that would be 4 096 counts.
    pub reference: u32,
}

/// The temperature inputs of a board, worked out for every sensor that they may have.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Thermometers {
    heat_sink: Characteristic,
    motor: [Characteristic; MOTOR_SENSORS.len()],
}

/// By the number in P-0-0134.
const MOTOR_SENSORS: [TemperatureSensor; 6] = [
    TemperatureSensor::None,
    TemperatureSensor::Kty84,
    TemperatureSensor::Pt1000,
    TemperatureSensor::Ntc10k,
    TemperatureSensor::Ptc,
    TemperatureSensor::Switch,
];

#[allow(clippy::indexing_slicing, clippy::arithmetic_side_effects, reason = "evaluated by the compiler only")]
const _: () = {
    let mut number = 0;
    while number < MOTOR_SENSORS.len() {
        assert!(MOTOR_SENSORS[number] as usize == number, "P-0-0134 numbers the sensors as the table does");
        number += 1;
    }
};

impl Thermometers {
    /// Of a board with this sensor on its heat sink, and these two dividers.
    ///
    /// # Panics
    /// In a constant, where the converter cannot tell a sensor's whole range from a broken wire or a short circuit.
    #[must_use]
    pub const fn new(sensor: TemperatureSensor, heat_sink: &Divider, motor: &Divider) -> Self {
        let [none, kty84, pt1000, ntc, ptc, switch] = MOTOR_SENSORS;
        Self {
            heat_sink: Characteristic::of(sensor, heat_sink),
            motor: [
                Characteristic::of(none, motor),
                Characteristic::of(kty84, motor),
                Characteristic::of(pt1000, motor),
                Characteristic::of(ntc, motor),
                Characteristic::of(ptc, motor),
                Characteristic::of(switch, motor),
            ],
        }
    }

    /// Of the sensor on the heat sink.
    #[must_use]
    pub const fn heat_sink(&self) -> &Characteristic {
        &self.heat_sink
    }

    /// Of the sensor in the motor, by the number in P-0-0134; `None` for a number that no sensor has.
    #[must_use]
    pub fn motor(&self, number: u16) -> Option<&Characteristic> {
        self.motor.get(usize::from(number))
    }
}

/// What the samples of a sensor mean.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Characteristic {
    /// Nothing: there is no sensor.
    None,
    /// Degrees.
    Curve(Curve),
    /// Cold or hot.
    Contact(Contact),
}

impl Characteristic {
    /// Of a sensor behind a divider.
    ///
    /// # Panics
    /// As [`Thermometers::new`].
    #[must_use]
    pub const fn of(sensor: TemperatureSensor, divider: &Divider) -> Self {
        match sensor {
            TemperatureSensor::None => Self::None,
            TemperatureSensor::Kty84 => Self::Curve(Curve::new(&data_sheets::KTY84, divider)),
            TemperatureSensor::Pt1000 => Self::Curve(Curve::new(&data_sheets::PT1000, divider)),
            TemperatureSensor::Ntc10k => Self::Curve(Curve::new(&data_sheets::NTC_10K, divider)),
            TemperatureSensor::Ntc5k => Self::Curve(Curve::new(&data_sheets::NTC_5K, divider)),
            TemperatureSensor::Ptc => Self::Contact(Contact::new(&data_sheets::PTC, divider)),
            TemperatureSensor::Switch => Self::Contact(Contact::new(&data_sheets::SWITCH, divider)),
        }
    }
}

/// Samples from one knot of a curve to the next: with 64 the line between them is off by less than 0.3 K from -20 to 150 degrees C.
const SPACING: usize = 1 << SPACING_BITS;
const SPACING_BITS: u32 = 6;
/// One more than a converter of 12 bits has intervals, so that each has both its ends.
const KNOTS: usize = 4_096 / SPACING + 1;

/// Temperature over sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Curve {
    /// In 0.1 degree C, at every 64th sample.
    knots: [i16; KNOTS],
    /// Lowest sample of a sound sensor.
    pub(super) lowest: u16,
    /// Highest sample of a sound sensor.
    pub(super) highest: u16,
    /// Hottest temperature of a shut-down, in 0.1 degree C.
    pub(super) hottest: i16,
}

/// [`Curve::temperature`] has so many bits below 0.1 degree C.
pub(super) const CURVE_BITS: u32 = SPACING_BITS;

impl Curve {
    #[allow(clippy::indexing_slicing, clippy::arithmetic_side_effects, reason = "evaluated by the compiler only")]
    const fn new(sheet: &DataSheet, divider: &Divider) -> Self {
        let mut knots = [0; KNOTS];
        let mut knot = 0;
        while knot < KNOTS {
            knots[knot] = match divider.resistance((knot * SPACING) as u64) {
                Some(resistance) => sheet.temperature(resistance),
                None => sheet.temperature(u64::MAX),
            };
            knot += 1;
        }
        let (lowest, highest) = (divider.sample(sheet.least), divider.sample(sheet.most));
        assert!(lowest >= 4, "the converter does not tell the lowest resistance of the sensor from a short circuit");
        assert!(
            highest <= 4_091,
            "the converter does not tell the highest resistance of the sensor from a broken wire"
        );
        Self { knots, lowest, highest, hottest: sheet.hottest }
    }

    /// The temperature of a sample, in 0.1 degree C with [`CURVE_BITS`] bits behind the point.
    #[inline]
    pub(super) fn temperature(&self, sample: u16) -> i32 {
        let knot = usize::from(sample >> SPACING_BITS).min(KNOTS.saturating_sub(2));
        let beyond = i32::from(sample).wrapping_sub((knot << SPACING_BITS) as i32);
        let at = |knot: usize| i32::from(self.knots.get(knot).copied().unwrap_or_default());
        let (from, to) = (at(knot), at(knot.wrapping_add(1)));
        (from << SPACING_BITS).wrapping_add(to.wrapping_sub(from).wrapping_mul(beyond))
    }

    /// A straight line: 0.1 degree C a count, 0 at so many counts.
    #[cfg(test)]
    pub(super) const fn line(zero: i16, lowest: u16, highest: u16) -> Self {
        let (mut knots, mut knot) = ([0; KNOTS], 0);
        while knot < KNOTS {
            knots[knot] = (knot * SPACING) as i16 - zero;
            knot += 1;
        }
        Self { knots, lowest, highest, hottest: 3_000 }
    }
}

/// A sensor that knows cold and hot.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Contact {
    /// Lowest sample of a sound sensor; 0 for one that may have no resistance.
    pub(super) lowest: u16,
    /// Below it the sensor is cold again.
    pub(super) cold: u16,
    /// From it on the sensor is hot.
    pub(super) hot: u16,
}

impl Contact {
    const fn new(resistances: &data_sheets::Contact, divider: &Divider) -> Self {
        let contact = Self {
            lowest: divider.sample(resistances.least),
            cold: divider.sample(resistances.cold),
            hot: divider.sample(resistances.hot),
        };
        assert!(contact.lowest < contact.cold && contact.cold < contact.hot && contact.hot <= 4_091);
        assert!(resistances.least == 0 || contact.lowest >= 4, "the converter does not tell a short circuit");
        contact
    }
}

impl Divider {
    /// The resistance in 0.1 Ohm that shows `sample`; `None` where no resistance shows so much.
    #[allow(clippy::arithmetic_side_effects, reason = "evaluated by the compiler only")]
    const fn resistance(&self, sample: u64) -> Option<u64> {
        let (input, supply) = (sample * self.reference as u64, 4_096 * self.supply as u64);
        if input >= supply {
            return None;
        }
        Some(10 * self.pull_up as u64 * input / (supply - input))
    }

    /// The sample that a resistance in 0.1 Ohm shows, 4 095 at most.
    #[allow(clippy::arithmetic_side_effects, reason = "evaluated by the compiler only")]
    const fn sample(&self, resistance: u32) -> u16 {
        let resistance = resistance as u64;
        let whole = (resistance + 10 * self.pull_up as u64) * self.reference as u64;
        let sample = 4_096 * self.supply as u64 * resistance / whole;
        if sample > 4_095 { 4_095 } else { sample as u16 }
    }
}

#[cfg(test)]
mod tests {
    extern crate std;

    use super::*;

    const DIVIDER: Divider = Divider { pull_up: 2_200, supply: 3_300, reference: 3_300 };

    fn curve(sensor: TemperatureSensor, divider: &Divider) -> Curve {
        match Characteristic::of(sensor, divider) {
            Characteristic::Curve(curve) => curve,
            other => panic!("{other:?}"),
        }
    }

    /// The sample of a resistance in Ohm, not rounded.
    fn sample(resistance: f64, divider: &Divider) -> f64 {
        let input = f64::from(divider.supply) * resistance / (resistance + f64::from(divider.pull_up));
        input / f64::from(divider.reference) * 4_096.0
    }

    #[test]
    fn every_row_of_a_data_sheet_is_read_within_a_kelvin_behind_dividers_near_its_resistance() {
        let sensors = [
            (TemperatureSensor::Kty84, &data_sheets::KTY84),
            (TemperatureSensor::Pt1000, &data_sheets::PT1000),
            (TemperatureSensor::Ntc10k, &data_sheets::NTC_10K),
            (TemperatureSensor::Ntc5k, &data_sheets::NTC_5K),
        ];
        let dividers = [DIVIDER, Divider { pull_up: 1_000, ..DIVIDER }, Divider { supply: 3_000, ..DIVIDER }];
        for (sensor, sheet) in sensors {
            for divider in &dividers {
                let curve = curve(sensor, divider);
                for (row, resistance) in sheet.resistances.iter().enumerate() {
                    let celsius = sheet.celsius(row);
                    if !(-20..=150).contains(&celsius) {
                        continue;
                    }
                    let exact = sample(f64::from(*resistance) / 10.0, divider);
                    let shown = f64::from(curve.temperature(exact.round() as u16)) / 640.0;
                    // Half a count of a Pt1000 is 0.2 K.
                    let off = shown - f64::from(celsius);
                    assert!(off.abs() < 1.0, "{sensor:?} behind {divider:?}: {shown} instead of {celsius}");
                }
            }
        }
    }

    #[test]
    fn a_sound_sensor_from_minus_40_degrees_to_its_hottest_is_neither_broken_nor_short() {
        for sheet in [&data_sheets::KTY84, &data_sheets::PT1000, &data_sheets::NTC_10K, &data_sheets::NTC_5K] {
            let curve = Curve::new(sheet, &DIVIDER);
            for resistance in sheet.resistances {
                let sample = sample(f64::from(*resistance) / 10.0, &DIVIDER);
                assert!(sample > f64::from(curve.lowest) + 3.0, "{sample} of {}", curve.lowest);
                assert!(sample < f64::from(curve.highest) - 3.0, "{sample} of {}", curve.highest);
            }
            assert_eq!(curve.hottest, if sheet.step == 10 { 2_500 } else { 2_000 });
        }
    }

    #[test]
    fn the_resistances_of_a_data_sheet_go_in_one_direction() {
        for sheet in [&data_sheets::KTY84, &data_sheets::PT1000, &data_sheets::NTC_10K, &data_sheets::NTC_5K] {
            let falling = sheet.resistances.is_sorted_by(|a, b| a > b);
            let rising = sheet.resistances.is_sorted_by(|a, b| a < b);
            assert!(falling != rising, "{sheet:?}");
        }
    }

    #[test]
    fn every_sample_is_a_temperature_and_the_ends_of_the_range_show_the_ends_of_the_table() {
        let ntc = curve(TemperatureSensor::Ntc10k, &DIVIDER);
        assert_eq!((ntc.temperature(0), ntc.temperature(4_096)), (2_200 * 64, -400 * 64));
        let kty84 = curve(TemperatureSensor::Kty84, &DIVIDER);
        assert_eq!((kty84.temperature(0), kty84.temperature(4_096)), (-400 * 64, 3_000 * 64));
        assert_eq!(kty84.temperature(u16::MAX) >> 31, 0, "no panic");
        for sample in 1..4_096 {
            assert!(ntc.temperature(sample) <= ntc.temperature(sample - 1));
            assert!(kty84.temperature(sample) >= kty84.temperature(sample - 1));
        }
    }

    #[test]
    fn the_samples_of_a_ptc_and_of_a_switch_are_those_of_their_resistances() {
        let Characteristic::Contact(ptc) = Characteristic::of(TemperatureSensor::Ptc, &DIVIDER) else { panic!() };
        // 20, 1800 and 3300 Ohm over 2200 more.
        assert_eq!([ptc.lowest, ptc.cold, ptc.hot], [36, 1_843, 2_457]);
        let Characteristic::Contact(switch) = Characteristic::of(TemperatureSensor::Switch, &DIVIDER) else { panic!() };
        assert_eq!(switch.lowest, 0, "a closed switch is no short circuit");
        assert_eq!([switch.cold, switch.hot], [1_280, 1_950]);
    }

    #[test]
    fn the_numbers_of_p_0_0134_are_those_of_the_sensors_and_others_have_none() {
        let inputs = Thermometers::new(TemperatureSensor::Ntc5k, &DIVIDER, &DIVIDER);
        assert_eq!(inputs.heat_sink(), &Characteristic::of(TemperatureSensor::Ntc5k, &DIVIDER));
        for sensor in MOTOR_SENSORS {
            assert_eq!(inputs.motor(sensor as u16), Some(&Characteristic::of(sensor, &DIVIDER)));
        }
        assert_eq!(inputs.motor(6), None);
    }
}
