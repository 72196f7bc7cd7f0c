//! What the drive is set to, as the service channel and the MDT have told, and from the start what docs/idn.md says of a new drive.

use std::collections::BTreeSet;

use ring::ident::Idn;

use crate::blocks::Blocks;
use crate::units::Units;

/// Settings of a new drive that the laws ask for, as docs/idn.md has them: number and value of the operation data.
const DEFAULTS: [(u16, i64); 67] = [
    (1, 2_000),
    (2, 2_000),
    (9, 1),
    (15, 4),
    (32, 2),
    (33, 0),
    (34, 0),
    (35, 0),
    (38, 0),
    (39, 0),
    (41, 1_000_000),
    (42, 100_000),
    (43, 0),
    (44, 2),
    (45, 1),
    (46, -4),
    (49, 2_147_483_647),
    (50, -2_147_483_647),
    (52, 0),
    (55, 0),
    (57, 10_000),
    (76, 2),
    (77, 1),
    (78, -7),
    (79, 3_600_000),
    (82, 32_767),
    (83, -32_767),
    (85, 0),
    (91, 30_000_000),
    (92, 2_000),
    (103, 3_600_000),
    (104, 100),
    (109, 14_142),
    (110, 14_142),
    (111, 3_536),
    (113, 45_000_000),
    (116, 2_500),
    (121, 1),
    (122, 1),
    (123, 100_000),
    (124, 100_000),
    (125, 1_000_000),
    (136, 0),
    (137, 0),
    (138, 1_000_000),
    (147, 0x60),
    (150, 0),
    (157, 100_000),
    (159, 300_000),
    (160, 2),
    (161, 1),
    (162, -3),
    (206, 100),
    (207, 100),
    (259, 1_000_000),
    (260, 1_000_000),
    (261, 100_000),
    (277, 0),
    (349, 0),
    (372, 0),
    (0x8000 | 104, 150),
    (0x8000 | 105, 440),
    (0x8000 | 107, 500),
    (0x8000 | 110, 4),
    (0x8000 | 120, 0),
    (0x8000 | 123, 20),
    (0x8000 | 140, 2),
];

/// Data blocks of two bytes among those that can be configured in AT and MDT, or have a default here.
const WORDS: [u16; 57] = [
    1, 2, 9, 11, 12, 13, 14, 15, 32, 33, 34, 35, 43, 44, 45, 46, 55, 76, 77, 78, 80, 81, 82, 83, 84, 85, 92, 104, 129,
    134, 135, 144, 145, 147, 160, 161, 162, 179, 181, 182, 206, 207, 277, 336, 338, 341, 342, 343, 346, 380, 383, 384,
    390, 403, 0x8013, 0x806B, 0x80A0,
];
/// The same of four bytes.
const LONGS: [u16; 50] = [
    36, 37, 38, 39, 40, 47, 48, 49, 50, 51, 52, 53, 79, 91, 103, 109, 110, 111, 113, 116, 121, 122, 123, 124, 125, 130,
    131, 132, 133, 136, 137, 138, 157, 159, 189, 193, 258, 259, 260, 282, 347, 349, 359, 372, 41, 42, 57, 150, 261,
    278,
];
/// Data blocks that stay what they are when the defaults or a saved set are loaded: they belong to the ring or to the amplifier.
const STAY: [u16; 14] = [1, 2, 6, 7, 8, 9, 10, 15, 16, 24, 89, 110, 0x8000 | 104, 0x8000 | 105];

/// Types, factors and exponents of the scaling of positions, velocities and accelerations. Gear and feed constant are none: data of the load
/// stay data of the load.
const SCALING: [u16; 10] = [44, 45, 46, 76, 77, 78, 79, 160, 161, 162];
/// Settings of four bytes that are counted in such a scaling.
const OF_VELOCITY: [u16; 8] = [38, 39, 41, 91, 124, 125, 157, 259];
const OF_ACCELERATION: [u16; 8] = [42, 136, 137, 138, 193, 260, 349, 372];
const OF_POSITION: [u16; 8] = [49, 50, 52, 57, 150, 159, 261, 278];

/// What is known of a drive's settings.
#[derive(Clone, Debug)]
pub struct Settings {
    values: Blocks,
    /// [`SCALING`] of the last set that came into operation.
    scaling: [Option<Vec<u16>>; SCALING.len()],
    /// Written since CP2 began: their numbers count in the scaling that the set ends with.
    fresh: BTreeSet<u16>,
    mdt: Vec<Idn>,
    at: Vec<Idn>,
}

impl Default for Settings {
    fn default() -> Self {
        let mut settings = Self {
            values: Blocks::new(),
            scaling: Default::default(),
            fresh: BTreeSet::new(),
            mdt: Vec::new(),
            at: Vec::new(),
        };
        settings.new_drive(|_| true);
        settings.scaling = settings.scaling_now();
        settings.arrange();
        settings
    }
}

impl Settings {
    fn new_drive(&mut self, concerns: impl Fn(u16) -> bool) {
        for (number, value) in DEFAULTS {
            if concerns(number) {
                let words = [value as u16, (value >> 16) as u16];
                let length = Self::bytes_of(Idn(number)).unwrap_or(2) / 2;
                self.values.insert(number, words[..length].to_vec());
            }
        }
    }

    /// The words of the operation data, as they were written or read.
    pub fn note(&mut self, idn: Idn, words: Vec<u16>) {
        self.values.insert(idn.0, words);
        if matches!(idn, Idn::TELEGRAM_TYPE | Idn::AT_LIST | Idn::MDT_LIST) {
            self.arrange();
        }
    }

    /// A set of data begins: CP2.
    pub(crate) fn begin_set(&mut self) {
        self.fresh.clear();
        self.follow_cycle();
    }

    /// S-0-0001 is S-0-0002 as long as nobody has written it.
    fn follow_cycle(&mut self) {
        if !self.fresh.contains(&Idn::CONTROL_UNIT_CYCLE.0)
            && let Some(words) = self.values.get(Idn::CYCLE.0).map(<[u16]>::to_vec)
        {
            self.values.insert(Idn::CONTROL_UNIT_CYCLE.0, words);
        }
    }

    /// The master has written it, and the drive has taken it.
    pub(crate) fn note_written(&mut self, idn: Idn) {
        self.fresh.insert(idn.0);
        if idn == Idn::CYCLE {
            self.follow_cycle();
        }
    }

    /// The set has come into operation: what nobody has written keeps its size, if the scaling is another one.
    pub(crate) fn end_set(&mut self) {
        let now = self.scaling_now();
        if now == self.scaling {
            return;
        }
        let mut old = self.clone();
        for (number, words) in SCALING.iter().zip(&self.scaling) {
            match words {
                Some(words) => old.values.insert(*number, words.clone()),
                None => old.values.remove(*number),
            };
        }
        self.scaling = now;
        let units = Units::of(&old).zip(Units::of(self));
        let ratios = units.map(|(old, new)| {
            let position = new.increments / old.increments;
            [position, old.velocity / new.velocity, old.acceleration / new.acceleration]
        });
        for (numbers, dimension) in [(&OF_POSITION[..], 0), (&OF_VELOCITY, 1), (&OF_ACCELERATION, 2)] {
            let ratio = ratios.map(|ratios| ratios[dimension]);
            for number in numbers {
                if !self.fresh.contains(number) {
                    self.convert(*number, ratio);
                }
            }
        }
    }

    fn convert(&mut self, number: u16, ratio: Option<f64>) {
        let Some(value) = self.signed(Idn(number)) else { return };
        // The end of the format means that there is no limit, in every scaling; 0 is 0.
        if value.unsigned_abs() >= 0x7FFF_FFFF || value == 0 {
            return;
        }
        let least = if value < 0 { -1.0 } else { 1.0 };
        let converted =
            ratio.map(|ratio| (value as f64 * ratio).round()).map(|value| if value == 0.0 { least } else { value });
        match converted.filter(|value| value.abs() < f64::from(i32::MAX)) {
            Some(value) => {
                let value = value as i32;
                self.values.insert(number, vec![value as u16, (value >> 16) as u16]);
            }
            None => {
                self.values.remove(number);
            }
        }
    }

    fn scaling_now(&self) -> [Option<Vec<u16>>; SCALING.len()] {
        SCALING.map(|number| self.values.get(number).map(<[u16]>::to_vec))
    }

    /// A value that came in the MDT.
    pub fn note_cyclic(&mut self, idn: Idn, value: u32) {
        let words = self.values.entry(idn.0);
        words.clear();
        words.push(value as u16);
        if Self::bytes_of(idn) == Some(4) {
            words.push((value >> 16) as u16);
        }
    }

    /// This command value of the MDT leads the axis somewhere else than the one before: further than the noise of a feedback that a control sends
    /// back, 1e-4 revolutions or 1 rpm.
    #[must_use]
    pub fn is_led_away(&self, idn: Idn, value: u32, units: Option<&Units>) -> bool {
        const SWING: (f64, f64) = (1e-4, 0.1);
        let (Some(before), Some(units)) = (self.signed(idn), units) else { return true };
        let raw = if Self::bytes_of(idn) == Some(4) { i64::from(value.cast_signed()) } else { i64::from(value as i16) };
        match idn.0 {
            47 | 48 | 258 | 282 => units.way(before as f64, raw as f64).abs() > SWING.0 * units.increments,
            36 | 37 => (raw - before).unsigned_abs() as f64 * units.velocity > SWING.1,
            _ => raw != before,
        }
    }

    /// It is no longer known.
    pub fn forget(&mut self, idn: Idn) {
        self.values.remove(idn.0);
    }

    /// S-0-0262 has been executed: what can be written now has its default; without `protected`, only what no phase protects.
    pub fn load_defaults(&mut self, protected: bool) {
        if protected {
            self.values.retain(|number| STAY.contains(&number));
            self.new_drive(|number| !STAY.contains(&number));
            self.scaling = self.scaling_now();
            self.fresh.clear();
        } else {
            // What may change in CP4 says the drive; until it is read it is unknown.
            self.values.retain(|number| STAY.contains(&number) || is_protected_in_cp4(number));
        }
    }

    /// What the drive had when it was started, other than [`DEFAULTS`]: its memory has given it back.
    pub fn remember(&mut self, values: impl IntoIterator<Item = (Idn, Vec<u16>)>) {
        for (idn, words) in values {
            if Self::bytes_of(idn).is_some() || self.values.get(idn.0).is_some() {
                self.note(idn, words);
            }
        }
        self.scaling = self.scaling_now();
        self.fresh.clear();
        self.arrange();
    }

    /// S-0-0263 has been executed: what was saved is unknown until it is read.
    pub fn load_saved(&mut self) {
        self.values.retain(|number| STAY.contains(&number));
        self.scaling = self.scaling_now();
        self.fresh.clear();
    }

    /// Everything that is known, to be compared with what is read.
    #[must_use]
    pub fn words(&self, idn: Idn) -> Option<&[u16]> {
        self.values.get(idn.0)
    }

    /// A value of two bytes.
    #[must_use]
    pub fn word(&self, idn: Idn) -> Option<u16> {
        self.words(idn)?.first().copied()
    }

    /// A value of two or four bytes without sign.
    #[must_use]
    pub fn unsigned(&self, idn: Idn) -> Option<i64> {
        Some(self.words(idn)?.iter().rev().fold(0, |value, word| value << 16 | i64::from(*word)))
    }

    /// A value of two or four bytes with sign.
    #[must_use]
    pub fn signed(&self, idn: Idn) -> Option<i64> {
        match *self.words(idn)? {
            [word] => Some(i64::from(word as i16)),
            [low, high] => Some(i64::from((u32::from(high) << 16 | u32::from(low)) as i32)),
            _ => None,
        }
    }

    /// The operation mode of a number 0 to 7 of the control or status word.
    #[must_use]
    pub fn mode(&self, number: u16) -> Option<u16> {
        let idn = if number < 4 { 32 + number } else { 280 + number };
        self.word(Idn(idn))
    }

    /// Length of the operation data in bytes, of those that can be configured in a telegram.
    #[must_use]
    pub fn bytes_of(idn: Idn) -> Option<usize> {
        if WORDS.contains(&idn.0) {
            Some(2)
        } else if LONGS.contains(&idn.0) {
            Some(4)
        } else {
            None
        }
    }

    /// What stands in the MDT's record behind its two words.
    #[must_use]
    pub fn mdt_contents(&self) -> &[Idn] {
        &self.mdt
    }

    /// What stands in the AT behind its two words.
    #[must_use]
    pub fn at_contents(&self) -> &[Idn] {
        &self.at
    }

    /// Contents of the telegrams (sercos2.md 1.8).
    fn arrange(&mut self) {
        let kind = self.word(Idn::TELEGRAM_TYPE).unwrap_or(0);
        let position = if kind & 8 == 0 { Idn::POSITION_FEEDBACK } else { Idn::POSITION_FEEDBACK_2 };
        let (mdt, at): (&[Idn], &[Idn]) = match kind & 7 {
            1 => (&[Idn::TORQUE_COMMAND], &[]),
            2 => (&[Idn::VELOCITY_COMMAND], &[Idn::VELOCITY_FEEDBACK]),
            3 => (&[Idn::VELOCITY_COMMAND], &[position]),
            4 => (&[Idn::POSITION_COMMAND], &[position]),
            5 => (&[Idn::POSITION_COMMAND, Idn::VELOCITY_COMMAND], &[position, Idn::VELOCITY_FEEDBACK]),
            6 => (&[Idn::VELOCITY_COMMAND], &[]),
            7 => (&self.list(Idn::MDT_LIST), &self.list(Idn::AT_LIST)),
            _ => (&[], &[]),
        };
        (self.mdt, self.at) = (mdt.to_vec(), at.to_vec());
    }

    fn list(&self, idn: Idn) -> Vec<Idn> {
        let Some([bytes, _, items @ ..]) = self.words(idn) else { return Vec::new() };
        items.iter().take(usize::from(*bytes / 2)).map(|item| Idn(*item)).collect()
    }
}

/// Data blocks with a default here that docs/idn.md protects in CP4.
pub(crate) fn is_protected_in_cp4(number: u16) -> bool {
    matches!(number, 1..=24 | 32..=35 | 43..=46 | 55 | 76..=79 | 85..=90 | 103 | 109..=116 | 121..=123 | 160..=162 | 277 | 284..=287)
        || number == 0x8000 | 120
}

/// Counted in the scaling of positions, velocities or accelerations.
pub(crate) fn is_sized(idn: Idn) -> bool {
    [&OF_POSITION[..], &OF_VELOCITY, &OF_ACCELERATION].iter().any(|numbers| numbers.contains(&idn.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_default_has_a_length_that_holds_it() {
        let settings = Settings::default();
        for (number, value) in DEFAULTS {
            let idn = Idn(number);
            if number < 0x8000 {
                assert!(Settings::bytes_of(idn).is_some(), "{idn}");
            }
            assert!(settings.signed(idn) == Some(value) || settings.unsigned(idn) == Some(value), "{idn}");
        }
    }

    #[test]
    fn the_cycle_of_the_control_unit_follows_the_ring_s_until_it_is_written() {
        let mut settings = Settings::default();
        for (idn, value, expected) in [(2, 4_000, 4_000), (1, 8_000, 8_000), (2, 1_000, 8_000)] {
            settings.note(Idn(idn), vec![value]);
            settings.note_written(Idn(idn));
            assert_eq!(settings.word(Idn::CONTROL_UNIT_CYCLE), Some(expected));
        }
        settings.begin_set();
        assert_eq!(settings.word(Idn::CONTROL_UNIT_CYCLE), Some(1_000));
    }

    #[test]
    fn limits_and_references_count_in_the_new_scaling_unless_they_were_written_in_it() {
        let mut settings = Settings::default();
        settings.note(Idn(122), vec![6, 0]);
        for (number, value) in [(50_u16, -1_000_i32), (52, 70), (150, -7)] {
            settings.note(Idn(number), vec![value as u16, (value >> 16) as u16]);
        }
        settings.end_set();
        settings.begin_set();
        // Of the load, which makes six revolutions for one of the motor.
        settings.note(Idn(76), vec![0x42]);
        settings.note(Idn(150), vec![7, 0]);
        settings.note_written(Idn(150));
        settings.end_set();
        let known = [49, 50, 52, 150].map(|number| settings.signed(Idn(number)));
        assert_eq!(known, [Some(0x7FFF_FFFF), Some(-6_000), Some(420), Some(7)]);
    }

    #[test]
    fn application_telegrams_hold_their_lists() {
        let mut settings = Settings::default();
        settings.note(Idn::TELEGRAM_TYPE, vec![7]);
        settings.note(Idn::AT_LIST, vec![4, 4, 51, 40]);
        assert_eq!(settings.at_contents(), [Idn(51), Idn(40)]);
        assert_eq!(settings.mdt_contents(), []);
    }

    #[test]
    fn loading_defaults_leaves_the_ring_alone() {
        let mut settings = Settings::default();
        settings.note(Idn(2), vec![4_000]);
        settings.note(Idn(92), vec![7]);
        settings.note(Idn(55), vec![7]);
        settings.load_defaults(false);
        assert_eq!(
            (settings.word(Idn(2)), settings.word(Idn(92)), settings.word(Idn(55))),
            (Some(4_000), None, Some(7))
        );
        settings.load_defaults(true);
        assert_eq!((settings.word(Idn(92)), settings.word(Idn(55))), (Some(2_000), Some(0)));
    }
}
