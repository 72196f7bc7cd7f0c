//! Resistance over temperature of the sensors, as their data sheets and standards have it.

/// Resistances of a sensor.
#[derive(Debug)]
pub(super) struct DataSheet {
    /// In 0.1 Ohm, from -40 degrees C upwards.
    pub(super) resistances: &'static [u32],
    /// From one to the next, in K.
    pub(super) step: i16,
    /// Up to which it is used, in 0.1 degree C; the rows go on beyond for the sake of the last knot.
    pub(super) hottest: i16,
    /// Below so many 0.1 Ohm the sensor is short-circuited.
    pub(super) least: u32,
    /// Above so many 0.1 Ohm a wire of the sensor is broken.
    pub(super) most: u32,
}

/// Resistances of a sensor that knows cold and hot, in 0.1 Ohm.
#[derive(Debug)]
pub(super) struct Contact {
    /// Below it the sensor is short-circuited.
    pub(super) least: u32,
    /// Below it the sensor is cold again.
    pub(super) cold: u32,
    /// From it on the sensor is hot.
    pub(super) hot: u32,
}

/// KTY84-130 (NXP KTY84 table 1), 1 000 Ohm +-3 % at 100 degrees C.
pub(super) const KTY84: DataSheet =
    DataSheet { resistances: &KTY84_OHMS, step: 10, hottest: 2_500, least: 3_000, most: 27_500 };

const KTY84_OHMS: [u32; 35] = [
    3_590, 3_910, 4_240, 4_600, 4_980, 5_380, 5_810, 6_260, 6_720, 7_220, 7_730, 8_260, 8_820, 9_400, 10_000, 10_620,
    11_270, 11_940, 12_620, 13_340, 14_070, 14_820, 15_600, 16_400, 17_220, 18_070, 18_930, 19_820, 20_730, 21_660,
    22_610, 23_570, 24_520, 25_420, 26_240,
];

/// Pt1000 (IEC 60751 table 1, times ten).
pub(super) const PT1000: DataSheet =
    DataSheet { resistances: &PT1000_OHMS, step: 10, hottest: 2_500, least: 7_000, most: 22_500 };

const PT1000_OHMS: [u32; 35] = [
    8_427, 8_822, 9_216, 9_609, 10_000, 10_390, 10_779, 11_167, 11_554, 11_940, 12_324, 12_708, 13_090, 13_471, 13_851,
    14_229, 14_607, 14_983, 15_358, 15_733, 16_105, 16_477, 16_848, 17_217, 17_586, 17_953, 18_319, 18_684, 19_047,
    19_410, 19_771, 20_131, 20_490, 20_848, 21_205,
];

/// 10 kOhm with B25/50 of 3 380 K and B25/85 of 3 434 K (Murata NCP18XH103). Its table ends at 125 degrees C; the rows above go on with the
/// cubic of ln R over 1/T through those of 25, 75, 100 and 125 degrees C.
pub(super) const NTC_10K: DataSheet =
    DataSheet { resistances: &NTC_10K_OHMS, step: 5, hottest: 2_000, least: 600, most: 10_000_000 };

const NTC_10K_OHMS: [u32; 53] = [
    1_956_520, 1_481_710, 1_133_470, 875_590, 682_370, 536_500, 425_060, 338_920, 272_190, 220_210, 179_260, 146_740,
    120_810, 100_000, 83_150, 69_480, 58_340, 49_170, 41_610, 35_350, 30_140, 25_860, 22_280, 19_250, 16_690, 14_520,
    12_680, 11_100, 9_740, 8_580, 7_580, 6_720, 5_960, 5_310, 4_741, 4_243, 3_806, 3_422, 3_084, 2_785, 2_520, 2_285,
    2_076, 1_890, 1_723, 1_575, 1_441, 1_321, 1_213, 1116, 1028, 948, 876,
];

/// 5 kOhm at 25 degrees C, B25/50 of 3 375 K, 493 Ohm at 100 degrees C, B100/125 of 3 550 K: the sensor of most power modules (Semikron SEMiX,
/// Mitsubishi NX). The rows are the cubic of ln R over 1/T through the four points that these figures make.
pub(super) const NTC_5K: DataSheet =
    DataSheet { resistances: &NTC_5K_OHMS, step: 5, hottest: 2_000, least: 320, most: 5_000_000 };

const NTC_5K_OHMS: [u32; 53] = [
    952_901, 729_123, 562_094, 436_519, 341_435, 268_931, 213_264, 170_236, 136_758, 110_544, 89_891, 73_520, 60_467,
    50_000, 41_561, 34_720, 29_147, 24_583, 20_828, 17_723, 15_145, 12_995, 11_194, 9_679, 8_400, 7_315, 6_393, 5_605,
    4_930, 4_350, 3_849, 3_416, 3_040, 2_713, 2_427, 2_177, 1_957, 1_764, 1_594, 1_443, 1_309, 1_190, 1_084, 990, 905,
    829, 761, 700, 645, 595, 549, 509, 471,
];

/// PTC thermistors (DIN 44081, DIN 44082): each has at least 20 Ohm, up to 550 Ohm 5 K below its temperature, which is 1 650 Ohm for three in
/// series, and 4 000 Ohm 15 K above it. Between lies where tripping relays of IEC 60947-8 trip and let go.
pub(super) const PTC: Contact = Contact { least: 200, cold: 18_000, hot: 33_000 };

/// A closed switch, with its wires, has less than 100 Ohm, and an open one more than 100 kOhm.
pub(super) const SWITCH: Contact = Contact { least: 0, cold: 10_000, hot: 20_000 };

const COLDEST: i16 = -40;

#[allow(clippy::indexing_slicing, clippy::arithmetic_side_effects, reason = "evaluated by the compiler only")]
impl DataSheet {
    /// The temperature in 0.1 degree C at a resistance in 0.1 Ohm, on the line between two rows; beyond the rows that of the last one.
    pub(super) const fn temperature(&self, resistance: u64) -> i16 {
        let rows = self.resistances;
        let falling = rows[0] > rows[1];
        let mut row = 0;
        while row < rows.len() && (resistance != rows[row] as u64) && (resistance < rows[row] as u64) == falling {
            row += 1;
        }
        if row == 0 {
            return 10 * COLDEST;
        }
        if row == rows.len() {
            return 10 * self.celsius(rows.len() - 1);
        }
        let (from, to) = (rows[row - 1] as i64, rows[row] as i64);
        let (passed, whole) = ((resistance as i64 - from) * 10 * self.step as i64, to - from);
        // To the nearest: both are of one sign.
        10 * self.celsius(row - 1) + ((2 * passed + whole) / (2 * whole)) as i16
    }

    /// Degrees C of a row.
    pub(super) const fn celsius(&self, row: usize) -> i16 {
        COLDEST + self.step * row as i16
    }
}
