//! The transition checks: procedure commands S-0-0127 (before CP3) and S-0-0128 (before CP4).
//!
//! A slave can judge its own values only; whether the slots of the whole ring fit is the master's business
//! (sercos2.md 5.3).

use crate::data_block::{NeededFor, Selection};
use crate::dictionary;
use crate::duration::{self, BitRate};
use crate::idn::Idn;
use crate::parameters::{self, LIST_ENTRIES, Parameters};
use crate::phase::{ReadyForCp3, ReadyForCp4};
use crate::telegram_type::TelegramType;
use core::fmt;
use heapless::Vec;

/// What the drive can do beyond the read-only data of the dictionary.
#[derive(Clone, Copy, Debug)]
pub struct Capabilities {
    /// Bit rate of the ring.
    pub bit_rate: BitRate,
    /// Values that S-0-0032 to S-0-0035 and S-0-0284 to S-0-0287 may have, besides 0 (none) for the secondary modes.
    pub operation_modes: &'static [u16],
}

/// Everything that CP3 and CP4 need to know, taken from parameters that passed S-0-0127.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CyclicConfiguration {
    /// S-0-0002.
    pub cycle_us: u16,
    /// S-0-0001; equal to `cycle_us` if the master has not written it.
    pub control_unit_cycle_us: u16,
    /// S-0-0006, AT start.
    pub t1_us: u16,
    /// S-0-0089, MDT start.
    pub t2_us: u16,
    /// S-0-0008, command values valid.
    pub t3_us: u16,
    /// S-0-0007, feedback capture.
    pub t4_us: u16,
    /// S-0-0010: bytes of all records of the MDT.
    pub mdt_length_bytes: u16,
    /// S-0-0009: position of this drive's record, from 1.
    pub record_position_bytes: u16,
    /// Data of the AT, in order, with their lengths.
    pub at: Vec<CyclicDatum, LIST_ENTRIES>,
    /// Data of this drive's MDT record, in order, with their lengths.
    pub mdt: Vec<CyclicDatum, LIST_ENTRIES>,
}

/// One datum of a cyclic telegram.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct CyclicDatum {
    /// Whose operation data.
    pub idn: Idn,
    /// Bytes from the start of the configurable data; even.
    pub offset_bytes: u16,
    /// 2 or 4.
    pub bytes: u16,
}

impl CyclicConfiguration {
    /// Bytes of configurable data in the AT.
    pub fn at_data_bytes(&self) -> u16 {
        data_bytes(&self.at)
    }

    /// Bytes of configurable data in the MDT record.
    pub fn mdt_data_bytes(&self) -> u16 {
        data_bytes(&self.mdt)
    }
}

/// Why a check failed on a data block.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Reason {
    /// The master has not written it since CP2 began.
    NeverWritten,
    /// Below its minimum or above its maximum.
    OutOfRange,
    /// A value, bit or combination that this drive does not support.
    NotSupported,
    /// Names an IDN that cannot be configured in this telegram, or one twice.
    NotConfigurable(Idn),
    /// The data do not fit into S-0-0185 or S-0-0186.
    DataTooLong {
        /// Bytes configured.
        bytes: u16,
        /// Bytes available.
        maximum: u16,
    },
    /// S-0-0001 is not a multiple of S-0-0002.
    NotAMultiple,
    /// S-0-0009 is even or S-0-0010 is odd.
    WrongParity,
    /// The record does not lie inside the MDT.
    RecordOutsideMdt,
    /// The instant is too early: the drive needs at least this, in ns.
    TooEarly {
        /// Earliest instant after the end of the MST.
        earliest_ns: u32,
    },
    /// The instant is too late: the drive needs at most this, in ns.
    TooLate {
        /// Latest instant after the end of the MST.
        latest_ns: u32,
    },
    /// An operation mode needs a command value that the MDT does not carry.
    CommandValueMissing(Idn),
    /// Asks for position feedback 2, which this drive does not have (P-0-0005).
    NoFeedback2,
}

impl Reason {
    /// The number of the reason, for P-0-0001 and P-0-0002.
    pub const fn code(self) -> u16 {
        match self {
            Reason::NeverWritten => 0x0001,
            Reason::OutOfRange => 0x0002,
            Reason::NotSupported => 0x0003,
            Reason::NotConfigurable(_) => 0x0004,
            Reason::DataTooLong { .. } => 0x0005,
            Reason::NotAMultiple => 0x0006,
            Reason::WrongParity => 0x0007,
            Reason::RecordOutsideMdt => 0x0008,
            Reason::TooEarly { .. } => 0x0009,
            Reason::TooLate { .. } => 0x000A,
            Reason::CommandValueMissing(_) => 0x000B,
            Reason::NoFeedback2 => 0x000C,
        }
    }

    /// One of each kind, for the manual.
    pub const ALL: [Reason; 12] = [
        Reason::NeverWritten,
        Reason::OutOfRange,
        Reason::NotSupported,
        Reason::NotConfigurable(Idn::VELOCITY_COMMAND),
        Reason::DataTooLong { bytes: 36, maximum: 32 },
        Reason::NotAMultiple,
        Reason::WrongParity,
        Reason::RecordOutsideMdt,
        Reason::TooEarly { earliest_ns: 12_000 },
        Reason::TooLate { latest_ns: 1_970_000 },
        Reason::CommandValueMissing(Idn::POSITION_COMMAND),
        Reason::NoFeedback2,
    ];
}

impl fmt::Display for Reason {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Reason::NeverWritten => formatter.write_str("not written since CP2 began"),
            Reason::OutOfRange => formatter.write_str("outside its minimum and maximum"),
            Reason::NotSupported => formatter.write_str("a value this drive does not support"),
            Reason::NotConfigurable(idn) => write!(formatter, "{idn} cannot be configured, or is there twice"),
            Reason::DataTooLong { bytes, maximum } => write!(formatter, "{bytes} bytes of data, at most {maximum}"),
            Reason::NotAMultiple => formatter.write_str("no multiple of S-0-0002"),
            Reason::WrongParity => formatter.write_str("position must be odd, length even"),
            Reason::RecordOutsideMdt => formatter.write_str("the record ends behind the MDT (S-0-0010)"),
            Reason::TooEarly { earliest_ns } => {
                write!(formatter, "too early, at least {} us", earliest_ns.div_ceil(1_000))
            }
            Reason::TooLate { latest_ns } => write!(formatter, "too late, at most {} us", latest_ns / 1_000),
            Reason::CommandValueMissing(idn) => write!(formatter, "the MDT does not carry {idn}"),
            Reason::NoFeedback2 => formatter.write_str("no position feedback 2, see P-0-0005"),
        }
    }
}

/// One finding of a check.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Invalid {
    /// The data block to blame.
    pub idn: Idn,
    /// What is wrong with it.
    pub reason: Reason,
}

/// Most findings of one check: as many as it has data blocks to look at.
pub const FINDINGS: usize = 32;

/// The findings of a check that failed: the contents of S-0-0021 or S-0-0022.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct InvalidData {
    findings: Vec<Invalid, FINDINGS>,
    /// The drive was not synchronised to the MST (S-0-0128 only). No data block is to blame for that.
    pub not_synchronised: bool,
}

impl fmt::Display for Invalid {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "{}: {}", self.idn, self.reason)
    }
}

impl InvalidData {
    /// The findings in the order of their IDN, one for each IDN.
    pub fn findings(&self) -> &[Invalid] {
        &self.findings
    }

    /// The IDNs in ascending order.
    pub fn idns(&self) -> impl Iterator<Item = Idn> {
        self.findings.iter().map(|invalid| invalid.idn)
    }

    /// The reason codes, in the order of [`InvalidData::idns`].
    pub fn codes(&self) -> impl Iterator<Item = u16> {
        self.findings.iter().map(|invalid| invalid.reason.code())
    }

    /// Keeps the first finding for each IDN; for what the drive itself finds beside the checks of this module.
    pub fn add(&mut self, idn: Idn, reason: Reason) {
        if let Err(place) = self.findings.binary_search_by_key(&idn, |invalid| invalid.idn) {
            // More findings than room: the check has failed anyway.
            let _ = self.findings.insert(place, Invalid { idn, reason });
        }
    }

    /// True if nothing is wrong.
    pub fn is_empty(&self) -> bool {
        self.findings.is_empty() && !self.not_synchronised
    }
}

/// Cycle times are multiples of this (sercos2.md 5.5).
const CYCLE_STEP_US: u16 = 250;

const CONTROL_UNIT_CYCLE: Idn = Idn::standard(1);
const CYCLE: Idn = Idn::standard(2);
const T1_MIN: Idn = Idn::standard(3);
const T_ATMT: Idn = Idn::standard(4);
const T5: Idn = Idn::standard(5);
const T1: Idn = Idn::standard(6);
const T4: Idn = Idn::standard(7);
const T3: Idn = Idn::standard(8);
const RECORD_POSITION: Idn = Idn::standard(9);
const MDT_LENGTH: Idn = Idn::standard(10);
const T_MTSY: Idn = Idn::standard(88);
const T2: Idn = Idn::standard(89);
const T_MTSG: Idn = Idn::standard(90);
const AT_MAXIMUM: Idn = Idn::standard(185);
const MDT_MAXIMUM: Idn = Idn::standard(186);

/// The check of S-0-0127: cycle, slots, telegram type, configuration lists.
///
/// # Errors
/// Every data block that is not valid, for S-0-0021.
#[allow(clippy::result_large_err, reason = "there is no heap to box the findings on, and a check runs once a command")]
pub fn check_cp3(
    parameters: &Parameters,
    capabilities: &Capabilities,
) -> Result<(CyclicConfiguration, ReadyForCp3), InvalidData> {
    let mut invalid = InvalidData::default();
    // The least that masters write (sercos2.md 2.3); the others have usable defaults.
    for idn in [CYCLE, T1, RECORD_POSITION, MDT_LENGTH, T2] {
        if !parameters.is_written(idn) {
            invalid.add(idn, Reason::NeverWritten);
        }
    }
    check_ranges(parameters, NeededFor::Cp3, &mut invalid);

    let cycle_us = parameters.get_word(CYCLE);
    if cycle_us.checked_rem(CYCLE_STEP_US) != Some(0) {
        invalid.add(CYCLE, Reason::NotSupported);
    }
    let control_unit_cycle_us = match parameters.is_written(CONTROL_UNIT_CYCLE) {
        true => parameters.get_word(CONTROL_UNIT_CYCLE),
        false => cycle_us,
    };
    if control_unit_cycle_us == 0 || control_unit_cycle_us.checked_rem(cycle_us) != Some(0) {
        invalid.add(CONTROL_UNIT_CYCLE, Reason::NotAMultiple);
    }

    let telegram_type = parameters.telegram_type();
    if telegram_type.is_none() {
        invalid.add(Idn::TELEGRAM_TYPE, Reason::NotSupported);
    }
    if telegram_type.is_some_and(TelegramType::uses_feedback_2) && !has_feedback_2(parameters) {
        invalid.add(Idn::TELEGRAM_TYPE, Reason::NoFeedback2);
    }
    let asked_for = parameters.cyclic_at().contains(&Idn::POSITION_FEEDBACK_2);
    if telegram_type == Some(TelegramType::APPLICATION) && asked_for && !has_feedback_2(parameters) {
        invalid.add(Idn::AT_LIST, Reason::NoFeedback2);
    }
    let blamed = |list| if telegram_type == Some(TelegramType::APPLICATION) { list } else { Idn::TELEGRAM_TYPE };
    let at = lay_out(parameters.cyclic_at(), Selection::ConfigurableInAt, parameters.get_word(AT_MAXIMUM))
        .unwrap_or_else(|reason| {
            invalid.add(blamed(Idn::AT_LIST), reason);
            Vec::new()
        });
    let mdt = lay_out(parameters.cyclic_mdt(), Selection::ConfigurableInMdt, parameters.get_word(MDT_MAXIMUM))
        .unwrap_or_else(|reason| {
            invalid.add(blamed(Idn::MDT_LIST), reason);
            Vec::new()
        });

    let configuration = CyclicConfiguration {
        cycle_us,
        control_unit_cycle_us,
        t1_us: parameters.get_word(T1),
        t2_us: parameters.get_word(T2),
        t3_us: parameters.get_word(T3),
        t4_us: parameters.get_word(T4),
        mdt_length_bytes: parameters.get_word(MDT_LENGTH),
        record_position_bytes: parameters.get_word(RECORD_POSITION),
        at,
        mdt,
    };
    check_record(&configuration, &mut invalid);
    check_slots(&configuration, parameters, capabilities.bit_rate, &mut invalid);
    if invalid.is_empty() { Ok((configuration, ReadyForCp3::new())) } else { Err(invalid) }
}

/// The check of S-0-0128: operation modes, scaling, limits, synchronisation to the MST.
///
/// # Errors
/// Every data block that is not valid, for S-0-0022.
#[allow(clippy::result_large_err, reason = "there is no heap to box the findings on, and a check runs once a command")]
pub fn check_cp4(
    parameters: &Parameters,
    capabilities: &Capabilities,
    configuration: &CyclicConfiguration,
    synchronised: bool,
) -> Result<ReadyForCp4, InvalidData> {
    let mut invalid = InvalidData { not_synchronised: !synchronised, ..InvalidData::default() };
    check_ranges(parameters, NeededFor::Cp4, &mut invalid);
    for idn in OPERATION_MODES {
        let mode = parameters.get_word(idn);
        // Secondary modes may be absent.
        if mode == 0 && idn != OPERATION_MODES[0] {
            continue;
        }
        if !capabilities.operation_modes.contains(&mode) {
            invalid.add(idn, Reason::NotSupported);
        } else if let Some(command) = command_value_of(mode) {
            if !configuration.mdt.iter().any(|datum| datum.idn == command) {
                invalid.add(idn, Reason::CommandValueMissing(command));
            }
        }
    }
    // Rotary data of the motor shaft; preferred or parameter scaling, absolute or modulo, per minute or per second
    // (sercos2.md 6.5).
    let velocity_scaling = Idn::standard(44);
    if parameters.get_word(velocity_scaling) & !0b0010_1000 != 0b010 {
        invalid.add(velocity_scaling, Reason::NotSupported);
    }
    let position_scaling = Idn::standard(76);
    let position_type = parameters.get_word(position_scaling);
    if position_type & !0b1000_1000 != 0b010 {
        invalid.add(position_scaling, Reason::NotSupported);
    }
    let modulo = Idn::standard(103);
    if position_type & 0b1000_0000 != 0 && parameters.get(modulo) == 0 {
        invalid.add(modulo, Reason::OutOfRange);
    }
    if invalid.is_empty() { Ok(ReadyForCp4::new()) } else { Err(invalid) }
}

/// The operation mode parameters in the order of control word bits 11, 9, 8: S-0-0032 to S-0-0035, S-0-0284 to S-0-0287.
pub const OPERATION_MODES: [Idn; 8] = [
    Idn::standard(32),
    Idn::standard(33),
    Idn::standard(34),
    Idn::standard(35),
    Idn::standard(284),
    Idn::standard(285),
    Idn::standard(286),
    Idn::standard(287),
];

/// The command value that an operation mode follows (sercos2.md 6.2); `None`: commands come over the service channel,
/// or the mode needs none.
pub const fn command_value_of(operation_mode: u16) -> Option<Idn> {
    if operation_mode & 0x4000 != 0 {
        return None;
    }
    match operation_mode & 7 {
        1 => Some(Idn::TORQUE_COMMAND),
        2 => Some(Idn::VELOCITY_COMMAND),
        3..=5 => Some(Idn::POSITION_COMMAND),
        _ => None,
    }
}

fn has_feedback_2(parameters: &Parameters) -> bool {
    parameters.get_word(Idn::POSITION_FEEDBACK_2_SOURCE) != 0
}

fn check_ranges(parameters: &Parameters, needed_for: NeededFor, invalid: &mut InvalidData) {
    let needed = dictionary::DICTIONARY.iter().filter(|block| block.needed_for == needed_for);
    for block in needed.filter(|block| block.fixed_bytes().is_some()) {
        if parameters::check_limits(block, parameters.get_long(block.idn)).is_err() {
            invalid.add(block.idn, Reason::OutOfRange);
        }
    }
}

/// Places data one after the other.
fn lay_out(idns: &[Idn], selection: Selection, maximum: u16) -> Result<Vec<CyclicDatum, LIST_ENTRIES>, Reason> {
    let mut data: Vec<CyclicDatum, LIST_ENTRIES> = Vec::new();
    for &idn in idns {
        let block = dictionary::find(idn).filter(|block| block.is_in(selection));
        let is_new = !data.iter().any(|datum| datum.idn == idn);
        let bytes =
            block.and_then(|block| block.fixed_bytes()).filter(|_| is_new).ok_or(Reason::NotConfigurable(idn))?;
        let offset_bytes = data_bytes(&data);
        data.push(CyclicDatum { idn, offset_bytes, bytes }).map_err(|_| Reason::NotConfigurable(idn))?;
    }
    let bytes = data_bytes(&data);
    if bytes > maximum { Err(Reason::DataTooLong { bytes, maximum }) } else { Ok(data) }
}

fn data_bytes(data: &[CyclicDatum]) -> u16 {
    data.last().map_or(0, |last| last.offset_bytes.saturating_add(last.bytes))
}

fn check_record(configuration: &CyclicConfiguration, invalid: &mut InvalidData) {
    let position = configuration.record_position_bytes;
    let length = configuration.mdt_length_bytes;
    if length & 1 != 0 {
        invalid.add(MDT_LENGTH, Reason::WrongParity);
    }
    if position & 1 == 0 {
        invalid.add(RECORD_POSITION, Reason::WrongParity);
    }
    // Control word and INFO come before the data; the position counts from 1.
    let record_end = u32::from(position).saturating_add(3).saturating_add(u32::from(configuration.mdt_data_bytes()));
    if record_end > u32::from(length) {
        invalid.add(RECORD_POSITION, Reason::RecordOutsideMdt);
    }
}

fn check_slots(
    configuration: &CyclicConfiguration,
    parameters: &Parameters,
    bit_rate: BitRate,
    invalid: &mut InvalidData,
) {
    let nanoseconds = |microseconds: u16| u32::from(microseconds).saturating_mul(1_000);
    let own = |idn| nanoseconds(parameters.get_word(idn));
    let cycle = nanoseconds(configuration.cycle_us);
    let t1 = nanoseconds(configuration.t1_us);
    let t2 = nanoseconds(configuration.t2_us);
    let t3 = nanoseconds(configuration.t3_us);
    let t4 = nanoseconds(configuration.t4_us);
    let at_duration = bit_rate.longest_nanoseconds(duration::at_bytes(configuration.at_data_bytes()));
    let mdt_duration = bit_rate.longest_nanoseconds(duration::mdt_bytes(configuration.mdt_length_bytes));

    if t1 < own(T1_MIN) {
        invalid.add(T1, Reason::TooEarly { earliest_ns: own(T1_MIN) });
    }
    let at_over = t1.saturating_add(at_duration).saturating_add(own(T_ATMT));
    if t2 < at_over {
        invalid.add(T2, Reason::TooEarly { earliest_ns: at_over });
    }
    let latest_t2 = cycle.saturating_sub(mdt_duration.saturating_add(own(T_MTSY)));
    if t2 > latest_t2 {
        invalid.add(T2, Reason::TooLate { latest_ns: latest_t2 });
    }
    let latest_t4 = cycle.saturating_sub(own(T5));
    if t4 > latest_t4 {
        invalid.add(T4, Reason::TooLate { latest_ns: latest_t4 });
    }
    // Before t2, the data of the MDT before are meant; after it, those of this cycle's.
    let mdt_usable = t2.saturating_add(mdt_duration).saturating_add(own(T_MTSG));
    if t3 > cycle {
        invalid.add(T3, Reason::TooLate { latest_ns: cycle });
    } else if t3 > t2 && t3 < mdt_usable {
        invalid.add(T3, Reason::TooEarly { earliest_ns: mdt_usable });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const CAPABILITIES: Capabilities = Capabilities { bit_rate: BitRate::Mbit2, operation_modes: &[1, 2, 3, 11] };

    fn set(parameters: &mut Parameters, number: u16, value: u32) {
        parameters.set(Idn::standard(number), value.into()).unwrap();
        parameters.mark_written(Idn::standard(number));
    }

    /// What the recorded master writes to drive 1.
    fn recorded() -> Parameters {
        let mut parameters = Parameters::new();
        for (number, value) in
            [(1, 2000), (2, 2000), (6, 92), (89, 1782), (8, 1965), (7, 1698), (9, 1), (10, 32), (15, 7)]
        {
            set(&mut parameters, number, value);
        }
        parameters.set_list(Idn::AT_LIST, &[Idn::standard(11), Idn::standard(51), Idn::product(19)]).unwrap();
        parameters.set_list(Idn::MDT_LIST, &[Idn::standard(36)]).unwrap();
        parameters
    }

    fn findings(parameters: &Parameters) -> std::vec::Vec<(u16, Reason)> {
        match check_cp3(parameters, &CAPABILITIES) {
            Ok(_) => std::vec![],
            Err(invalid) => invalid.findings().iter().map(|found| (found.idn.0, found.reason)).collect(),
        }
    }

    #[track_caller]
    fn finds(change: impl FnOnce(&mut Parameters), number: u16, reason: Reason) {
        let mut parameters = recorded();
        change(&mut parameters);
        assert_eq!(findings(&parameters), [(number, reason)]);
    }

    #[test]
    fn no_check_has_more_to_find_than_there_is_room_for() {
        for selection in [Selection::NeededForCp3, Selection::NeededForCp4] {
            assert!(dictionary::select(selection).count() <= FINDINGS);
        }
    }

    #[test]
    fn the_recorded_values_of_all_four_drives_pass() {
        for (t1, position) in [(92, 1), (336, 9), (580, 17), (824, 25)] {
            let mut parameters = recorded();
            set(&mut parameters, 6, t1);
            set(&mut parameters, 9, position);
            let (configuration, _) = check_cp3(&parameters, &CAPABILITIES).unwrap();
            assert_eq!(u32::from(configuration.t1_us), t1);
            assert_eq!(u32::from(configuration.record_position_bytes), position);
            assert_eq!((configuration.cycle_us, configuration.control_unit_cycle_us), (2000, 2000));
            assert_eq!((configuration.t2_us, configuration.t3_us, configuration.t4_us), (1782, 1965, 1698));
            let at: std::vec::Vec<_> =
                configuration.at.iter().map(|datum| (datum.idn.0, datum.offset_bytes, datum.bytes)).collect();
            assert_eq!(at, [(11, 0, 2), (51, 2, 4), (0x8013, 6, 2)]);
            assert_eq!((configuration.at_data_bytes(), configuration.mdt_data_bytes()), (8, 4));
        }
    }

    #[test]
    fn the_tight_ring_passes() {
        let mut parameters = recorded();
        set(&mut parameters, 6, 17);
        assert_eq!(findings(&parameters), []);
    }

    #[test]
    fn the_press_ring_passes_with_any_standard_telegram() {
        for telegram_type in [0, 1, 2, 3, 4, 5, 6] {
            let mut parameters = Parameters::new();
            let length = 48 * 12;
            for (number, value) in [
                (2, 10_000),
                (6, 150),
                (89, 7_000),
                (9, 565),
                (10, length),
                (15, telegram_type),
                (8, 9_900),
                (7, 9_000),
            ] {
                set(&mut parameters, number, value);
            }
            let (configuration, _) = check_cp3(&parameters, &CAPABILITIES).unwrap();
            assert_eq!(configuration.control_unit_cycle_us, 10_000, "S-0-0001 was not written");
        }
    }

    #[test]
    fn what_the_master_must_write_is_asked_for() {
        let expected = [2, 6, 9, 10, 89].map(|number| (number, Reason::NeverWritten));
        let mut parameters = recorded();
        parameters.forget_written();
        assert_eq!(findings(&parameters), expected);
    }

    #[test]
    fn cycle_times_are_multiples_of_250_us_and_the_control_unit_cycle_of_them() {
        finds(|p| set(p, 1, 3000), 1, Reason::NotAMultiple);
        let mut parameters = recorded();
        set(&mut parameters, 2, 2100);
        set(&mut parameters, 1, 4200);
        assert_eq!(findings(&parameters), [(2, Reason::NotSupported)]);
        set(&mut parameters, 2, 2250);
        set(&mut parameters, 1, 4500);
        assert_eq!(findings(&parameters), []);
    }

    #[test]
    fn records_lie_on_words_inside_the_mdt() {
        finds(|p| set(p, 9, 2), 9, Reason::WrongParity);
        finds(|p| set(p, 10, 33), 10, Reason::WrongParity);
        finds(|p| set(p, 9, 27), 9, Reason::RecordOutsideMdt);
        finds(|p| set(p, 9, 65_531), 9, Reason::RecordOutsideMdt);
    }

    #[test]
    fn telegram_types_and_lists_must_fit_the_drive() {
        for second_encoder in [11, 12, 13] {
            finds(|p| set(p, 15, second_encoder), 15, Reason::NoFeedback2);
            let mut parameters = recorded();
            set(&mut parameters, 15, second_encoder);
            parameters.set(Idn::POSITION_FEEDBACK_2_SOURCE, 1).unwrap();
            assert_eq!(findings(&parameters), []);
        }
        for unknown in [8, 9, 10, 14, 15, 16] {
            finds(|p| set(p, 15, unknown), 15, Reason::NotSupported);
        }
        let feedback_2 = [Idn::POSITION_FEEDBACK_2];
        finds(|p| p.set_list(Idn::AT_LIST, &feedback_2).unwrap(), 16, Reason::NoFeedback2);
        let twice = [Idn::VELOCITY_COMMAND, Idn::VELOCITY_COMMAND];
        finds(|p| p.set_list(Idn::MDT_LIST, &twice).unwrap(), 24, Reason::NotConfigurable(Idn::VELOCITY_COMMAND));
    }

    #[test]
    fn own_slots_are_checked_against_own_durations() {
        finds(|p| set(p, 6, 11), 6, Reason::TooEarly { earliest_ns: 12_000 });
        // AT of 8 bytes: 80 us; tATMT 10 us.
        finds(|p| set(p, 6, 1_693), 89, Reason::TooEarly { earliest_ns: 1_783_000 });
        // MDT of 32 bytes: 176 us; tMTSY 10 us.
        finds(
            |p| {
                set(p, 89, 1_815);
                set(p, 8, 0);
            },
            89,
            Reason::TooLate { latest_ns: 1_814_000 },
        );
        finds(|p| set(p, 7, 1_971), 7, Reason::TooLate { latest_ns: 1_970_000 });
        finds(|p| set(p, 8, 2_001), 8, Reason::TooLate { latest_ns: 2_000_000 });
    }

    #[test]
    fn t3_is_refused_only_while_the_mdt_is_on_the_fibre() {
        for (t3, passes) in [(0, true), (1_782, true), (1_783, false), (1_959, false), (1_960, true), (2_000, true)] {
            let mut parameters = recorded();
            set(&mut parameters, 8, t3);
            assert_eq!(check_cp3(&parameters, &CAPABILITIES).is_ok(), passes, "{t3}");
        }
    }

    fn check_4(parameters: &Parameters) -> std::vec::Vec<(u16, Reason)> {
        let (configuration, _) = check_cp3(&recorded(), &CAPABILITIES).unwrap();
        match check_cp4(parameters, &CAPABILITIES, &configuration, true) {
            Ok(_) => std::vec![],
            Err(invalid) => invalid.findings().iter().map(|found| (found.idn.0, found.reason)).collect(),
        }
    }

    #[test]
    fn cp4_needs_modes_with_command_values_and_known_scaling() {
        assert_eq!(check_4(&recorded()), []);
        for (number, value, reason) in [
            (32, 0, Reason::NotSupported),
            (32, 4, Reason::NotSupported),
            (32, 3, Reason::CommandValueMissing(Idn::POSITION_COMMAND)),
            (33, 11, Reason::CommandValueMissing(Idn::POSITION_COMMAND)),
            (35, 1, Reason::CommandValueMissing(Idn::TORQUE_COMMAND)),
            (284, 3, Reason::CommandValueMissing(Idn::POSITION_COMMAND)),
            (287, 4, Reason::NotSupported),
            (44, 1, Reason::NotSupported),
            (76, 0x42, Reason::NotSupported),
        ] {
            let mut parameters = recorded();
            set(&mut parameters, number, value);
            assert_eq!(check_4(&parameters), [(number, reason)]);
        }
        let mut parameters = recorded();
        set(&mut parameters, 76, 0x8A);
        assert_eq!(check_4(&parameters), []);
        set(&mut parameters, 103, 0);
        assert_eq!(check_4(&parameters), [(103, Reason::OutOfRange)]);
    }

    #[test]
    fn cp4_needs_synchronisation() {
        let (configuration, _) = check_cp3(&recorded(), &CAPABILITIES).unwrap();
        let refused = check_cp4(&recorded(), &CAPABILITIES, &configuration, false).unwrap_err();
        assert!(refused.not_synchronised && refused.findings().is_empty());
    }

    proptest! {
        #[test]
        fn whatever_passes_the_check_fits_into_the_cycle(
            cycle in 2u32..=260, t1 in 0u32..3_000, t2 in 0u32..3_000, t3 in 0u32..3_000, t4 in 0u32..3_000,
            position in 1u32..100, length in 4u32..200, telegram_type in 0u32..8, rate in 0usize..4,
        ) {
            let rate = [BitRate::Mbit2, BitRate::Mbit4, BitRate::Mbit8, BitRate::Mbit16][rate];
            let mut parameters = recorded();
            for (number, value) in [
                (2, cycle * 250), (1, cycle * 250), (6, t1), (89, t2), (8, t3), (7, t4),
                (9, position | 1), (10, length & !1), (15, telegram_type),
            ] {
                set(&mut parameters, number, value);
            }
            let capabilities = Capabilities { bit_rate: rate, ..CAPABILITIES };
            if let Ok((configuration, _)) = check_cp3(&parameters, &capabilities) {
                let at_end = t1 * 1_000 + rate.longest_nanoseconds(duration::at_bytes(configuration.at_data_bytes()));
                let mdt_end = t2 * 1_000 + rate.longest_nanoseconds(duration::mdt_bytes(configuration.mdt_length_bytes));
                prop_assert!(at_end < t2 * 1_000 && mdt_end < cycle * 250_000 && t4 < cycle * 250 && t3 <= cycle * 250);
                prop_assert!(t3 <= t2 || t3 * 1_000 > mdt_end);
                let record_end = configuration.record_position_bytes + 3 + configuration.mdt_data_bytes();
                prop_assert!(record_end <= configuration.mdt_length_bytes);
            }
        }
    }
}
