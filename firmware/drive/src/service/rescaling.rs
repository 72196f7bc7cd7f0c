//! What becomes of parameters when the scaling of their data changes (S-0-0044, S-0-0076, S-0-0086, S-0-0160 and their factors).
//!
//! A control writes one set of numbers that belong together, in an order of its own: scaling first, or values first (a backup in ascending
//! order has S-0-0041 before S-0-0044 and S-0-0124 behind it). So the order says nothing, and the rule is:
//!
//! * A number that the master has written since CP2 began, or since the last S-0-0128 that passed, counts in the scaling that the set ends
//!   with.
//! * Every other one, a default or one of an earlier set, keeps its value: it is expressed in the new increments, to the nearest, and never
//!   becomes 0. One that does not fit is cut to its limits, and S-0-0128 asks for it.
//! * A number at the end of its format means "no limit" in every scaling. S-0-0103 is a part of the scaling itself.
//!
//! The numbers are worked out anew from those of the last set with every change, so that scalings on the way to the last one leave no trace.
//! Gear, feed constant and the data of the motor are no scaling: data of the load stay data of the load when its gear is corrected.

use heapless::Vec;
use sercos::Idn;
use sercos::data_block::Location;
use sercos::dictionary::Dictionary;
use sercos::parameters::Parameters;
use sercos::unit::{Dimension, Unit};

use crate::settings::increments::increments;
use crate::settings::scaling::Ratio;

/// Scaling types, factors and exponents.
const SCALING: [u16; 13] = [44, 45, 46, 76, 77, 78, 79, 86, 93, 94, 160, 161, 162];
/// Gear, feed constant, stall current and torque constant.
const MECHANICS: [Idn; 5] =
    [Idn::standard(111), Idn::standard(121), Idn::standard(122), Idn::standard(123), Idn::product(114)];
/// What lies between numbers and motion.
const DIMENSIONS: [Dimension; 5] =
    [Dimension::Position, Dimension::Velocity, Dimension::Acceleration, Dimension::Jerk, Dimension::Torque];
const MODULO_VALUE: Idn = Idn::standard(103);

/// Room for all parameters with a scaling; a test looks.
const MOST: usize = 64;

/// The last set of parameters that belonged together.
#[derive(Debug)]
pub(crate) struct Rescaling {
    scaling: [u32; SCALING.len()],
    numbers: Vec<u32, MOST>,
    /// What the numbers were last worked out for.
    seen: ([u32; SCALING.len()], [u32; MECHANICS.len()]),
}

/// Parameters whose numbers count increments of a scaling, in ascending order.
fn scaled(dictionary: &'static Dictionary) -> impl Iterator<Item = (Idn, Dimension)> {
    dictionary.blocks().iter().filter_map(|block| match (block.location, block.unit) {
        (Location::Parameter, Unit::Scaled(dimension)) if block.idn != MODULO_VALUE => Some((block.idn, dimension)),
        _ => None,
    })
}

impl Rescaling {
    /// Begins with these parameters, which belong together.
    pub(crate) fn new(parameters: &Parameters) -> Self {
        let mut rescaling = Self { scaling: [0; _], numbers: Vec::new(), seen: ([0; _], [0; _]) };
        rescaling.keep(parameters);
        rescaling
    }

    /// What is there now belongs together: S-0-0128 has passed, CP2 begins, or defaults were loaded. Not with a scaling that means nothing, as
    /// one that S-0-0128 has refused: the values stay those of the set before.
    pub(crate) fn take_over(&mut self, parameters: &mut Parameters) {
        if DIMENSIONS.iter().any(|&dimension| increments(dimension, parameters).is_none()) {
            return;
        }
        self.keep(parameters);
        for (idn, _) in scaled(parameters.dictionary()) {
            parameters.forget(idn);
        }
    }

    /// The defaults were loaded, into whatever scaling there is: the numbers are those of the default scaling. To be followed by
    /// [`Rescaling::refresh`].
    pub(crate) fn defaults_loaded(&mut self, parameters: &mut Parameters) {
        self.take_over(parameters);
        self.scaling = SCALING.map(|number| default_of(parameters.dictionary(), Idn::standard(number)));
        self.seen = ([0; _], [0; _]);
    }

    /// Works the numbers out again if the scaling has changed. Divides.
    pub(crate) fn refresh(&mut self, parameters: &mut Parameters) {
        let now = seen(parameters);
        if now != self.seen {
            self.seen = now;
            self.convert(parameters, |_| ());
        }
    }

    /// Parameters that do not fit their new increments and were not written anew. Divides.
    pub(crate) fn misfits(&self, parameters: &mut Parameters) -> Vec<Idn, MOST> {
        let mut misfits = Vec::new();
        if self.scaling == SCALING.map(|number| parameters.get(Idn::standard(number))) {
            // Every number is the one that it was. The divisions would make S-0-0128 take longer than a cycle of a tight ring.
            return misfits;
        }
        self.convert(parameters, |idn| {
            // There is room for all of them.
            let _ = misfits.push(idn);
        });
        misfits
    }

    fn keep(&mut self, parameters: &Parameters) {
        self.scaling = SCALING.map(|number| parameters.get(Idn::standard(number)));
        self.seen = seen(parameters);
        self.numbers.clear();
        for (idn, _) in scaled(parameters.dictionary()) {
            let _ = self.numbers.push(parameters.get(idn));
        }
    }

    fn convert(&self, parameters: &mut Parameters, mut misfit: impl FnMut(Idn)) {
        let after = DIMENSIONS.map(|dimension| increments(dimension, parameters));
        let before = self.in_old_scaling(parameters, |old| DIMENSIONS.map(|dimension| increments(dimension, old)));
        for ((idn, dimension), &number) in scaled(parameters.dictionary()).zip(&self.numbers) {
            let index = DIMENSIONS.iter().position(|&other| other == dimension);
            let ratio_of = |ratios: &[Option<Ratio>; DIMENSIONS.len()]| {
                index.and_then(|index| ratios.get(index).copied().flatten())
            };
            if parameters.is_written(idn) || index.is_none() {
                continue;
            }
            // A scaling that means nothing has its own finding.
            let (Some(before), Some(after)) = (ratio_of(&before), ratio_of(&after)) else { continue };
            if !put(parameters, idn, number, before, after) {
                misfit(idn);
            }
        }
    }

    /// The mechanics as they are, with the scaling of the last set.
    fn in_old_scaling<T>(&self, parameters: &mut Parameters, look: impl FnOnce(&Parameters) -> T) -> T {
        let now = SCALING.map(|number| parameters.get(Idn::standard(number)));
        set_scaling(parameters, self.scaling);
        let result = look(parameters);
        set_scaling(parameters, now);
        result
    }
}

fn set_scaling(parameters: &mut Parameters, words: [u32; SCALING.len()]) {
    for (number, word) in SCALING.into_iter().zip(words) {
        // They were there before.
        let _ = parameters.set(Idn::standard(number), word.into());
    }
}

fn seen(parameters: &Parameters) -> ([u32; SCALING.len()], [u32; MECHANICS.len()]) {
    (SCALING.map(|number| parameters.get(Idn::standard(number))), MECHANICS.map(|idn| parameters.get(idn)))
}

fn default_of(dictionary: &Dictionary, idn: Idn) -> u32 {
    // As it is transmitted.
    dictionary.find(idn).map_or(0, |block| (block.default & 0xFFFF_FFFF) as u32)
}

/// Sets a parameter to its old number in new increments; `false` if it had to be cut.
fn put(parameters: &mut Parameters, idn: Idn, number: u32, before: Ratio, after: Ratio) -> bool {
    let Some(block) = parameters.dictionary().find(idn) else { return false };
    let old = block.attribute.value_of(number.into());
    let longest = if block.fixed_bytes() == Some(2) { i64::from(i16::MAX) } else { i64::from(i32::MAX) };
    let unlimited = old.unsigned_abs() >= longest.unsigned_abs();
    let Some(ratio) = after.over_ratio(before) else {
        return parameters.set(idn, number.into()).is_ok() && (old == 0 || unlimited);
    };
    let scaled = ratio.of(old.unsigned_abs()).max(u128::from(old != 0));
    let magnitude = i64::try_from(scaled).unwrap_or(i64::MAX);
    let wanted = match (unlimited, old < 0) {
        (true, _) => old,
        (false, true) => magnitude.saturating_neg(),
        (false, false) => magnitude,
    };
    let lowest = block.minimum.unwrap_or(i64::MIN).max(longest.saturating_neg());
    let within = wanted.max(lowest).min(block.maximum.unwrap_or(longest)).min(longest);
    let within = if unlimited { old } else { within };
    // Two's complement of the block's length.
    parameters.set(idn, within.cast_unsigned() & 0xFFFF_FFFF).is_ok() && within == wanted
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dictionary::DICTIONARY;

    const S: fn(u16) -> Idn = Idn::standard;

    /// As a master does: set, and marked as written.
    fn write(parameters: &mut Parameters, number: u16, value: i64) {
        parameters.set(S(number), (value as u32).into()).unwrap();
        parameters.mark_written(S(number));
    }

    fn write_all(rescaling: &mut Rescaling, parameters: &mut Parameters, values: &[(u16, i64)]) {
        for &(number, value) in values {
            write(parameters, number, value);
            rescaling.refresh(parameters);
        }
    }

    /// One increment is 1 rpm.
    const RPM: [(u16, i64); 3] = [(44, 0x0A), (45, 1), (46, 0)];

    fn new() -> (Rescaling, Parameters) {
        let parameters = crate::service::rig::parameters();
        (Rescaling::new(&parameters), parameters)
    }

    #[test]
    fn there_is_room_for_all_parameters_with_a_scaling() {
        assert!((20..=MOST).contains(&scaled(&DICTIONARY).count()), "{}", scaled(&DICTIONARY).count());
    }

    #[test]
    fn what_nobody_has_written_keeps_its_value() {
        let (mut rescaling, mut parameters) = new();
        write_all(&mut rescaling, &mut parameters, &RPM);
        for (number, rpm) in [(41, 100), (91, 3_000), (124, 10), (125, 100), (157, 10), (259, 100)] {
            assert_eq!(parameters.get(S(number)), rpm, "S-0-{number:04}");
        }
        assert_eq!((parameters.get(S(38)), parameters.get(S(377))), (0, 0), "no limit is no limit");
        assert_eq!(parameters.get(S(138)), 1_000_000, "an acceleration has its own scaling");
        assert!(rescaling.misfits(&mut parameters).is_empty());
        // And back: nothing is lost on the way over other scalings.
        write_all(&mut rescaling, &mut parameters, &[(46, 3), (46, -4)]);
        assert_eq!(parameters.get(S(124)), 100_000);
    }

    #[test]
    fn numbers_of_a_set_count_in_its_scaling_in_either_order() {
        let values = [(41, 70), (91, 2_500), (124, 7), (157, 9)];
        for scaling_first in [true, false] {
            let (mut rescaling, mut parameters) = new();
            let sets: [&[(u16, i64)]; 2] = if scaling_first { [&RPM, &values] } else { [&values, &RPM] };
            for set in sets {
                write_all(&mut rescaling, &mut parameters, set);
            }
            for (number, value) in values {
                assert_eq!(i64::from(parameters.get(S(number))), value, "S-0-{number:04}, {scaling_first}");
            }
            assert_eq!(parameters.get(S(125)), 100, "and what the set leaves out keeps its value");
        }
    }

    #[test]
    fn a_number_of_an_earlier_set_keeps_its_value_in_the_next_scaling() {
        let (mut rescaling, mut parameters) = new();
        write_all(&mut rescaling, &mut parameters, &RPM);
        write_all(&mut rescaling, &mut parameters, &[(124, 7)]);
        rescaling.take_over(&mut parameters);
        write_all(&mut rescaling, &mut parameters, &[(44, 2)]);
        assert_eq!((parameters.get(S(124)), parameters.get(S(91))), (70_000, 30_000_000));
    }

    #[test]
    fn positions_keep_their_angle_and_no_limit_stays_none() {
        let (mut rescaling, mut parameters) = new();
        write_all(&mut rescaling, &mut parameters, &[(76, 0x0A), (79, 3_600)]);
        assert_eq!((parameters.get(S(57)), parameters.get(S(159))), (10, 300));
        assert_eq!(parameters.get_signed(S(49)), i64::from(i32::MAX));
        assert_eq!(parameters.get_signed(S(50)), -i64::from(i32::MAX));
        assert_eq!(parameters.get(S(103)), 3_600_000, "a part of the scaling");
        // 1 increment is 36 degrees: less than one would be no window.
        write_all(&mut rescaling, &mut parameters, &[(79, 10)]);
        assert_eq!((parameters.get(S(57)), parameters.get(S(159))), (1, 1));
    }

    #[test]
    fn torques_keep_their_current() {
        let (mut rescaling, mut parameters) = new();
        // 0.01 Nm at 1.131 Nm/A: 100 % of 3.536 A are 4 Nm.
        write_all(&mut rescaling, &mut parameters, &[(86, 2)]);
        assert_eq!((parameters.get(S(126)), parameters.get(S(92))), (400, 800));
        assert_eq!(parameters.get(S(82)), 32_767, "no limit");
    }

    #[test]
    fn data_of_the_load_stay_data_of_the_load_when_its_gear_is_corrected() {
        let (mut rescaling, mut parameters) = new();
        write_all(&mut rescaling, &mut parameters, &[(76, 0x42), (121, 7), (122, 3), (52, 900_000)]);
        // 30 degrees of the motor are 12.857 of the load.
        assert_eq!(parameters.get(S(159)), 128_571);
        rescaling.take_over(&mut parameters);
        write_all(&mut rescaling, &mut parameters, &[(121, 14)]);
        assert_eq!((parameters.get(S(159)), parameters.get(S(52))), (128_571, 900_000));
    }

    #[test]
    fn what_does_not_fit_is_cut_and_named_until_it_is_written() {
        let (mut rescaling, mut parameters) = new();
        // 10^-8 rpm: 3 000 rpm are 3 * 10^11.
        write_all(&mut rescaling, &mut parameters, &[(44, 0x0A), (46, -8)]);
        assert_eq!(parameters.get(S(91)), i32::MAX.cast_unsigned());
        let misfits = rescaling.misfits(&mut parameters);
        assert!(misfits.contains(&S(91)) && !misfits.contains(&S(38)), "{misfits:?}");
        write_all(&mut rescaling, &mut parameters, &[(91, 2_000_000_000)]);
        assert!(!rescaling.misfits(&mut parameters).contains(&S(91)));
        assert_eq!(parameters.get(S(91)), 2_000_000_000);
    }

    #[test]
    fn a_scaling_that_means_nothing_leaves_the_values_of_the_set_before() {
        let (mut rescaling, mut parameters) = new();
        // Inches; the run-up begins again.
        write_all(&mut rescaling, &mut parameters, &[(44, 0x11)]);
        rescaling.take_over(&mut parameters);
        parameters.forget_written();
        write_all(&mut rescaling, &mut parameters, &RPM);
        assert_eq!(parameters.get(S(124)), 10);
    }

    #[test]
    fn defaults_that_are_loaded_into_another_scaling_keep_their_value() {
        let (mut rescaling, mut parameters) = new();
        write_all(&mut rescaling, &mut parameters, &RPM);
        rescaling.take_over(&mut parameters);
        parameters.set(S(124), 100_000).unwrap();
        rescaling.defaults_loaded(&mut parameters);
        rescaling.refresh(&mut parameters);
        assert_eq!(parameters.get(S(124)), 10);
    }
}
