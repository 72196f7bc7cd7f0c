//! The transition checks: procedure commands S-0-0127 (before CP3) and S-0-0128 (before CP4).
//!
//! A slave can judge its own values only; whether the slots of the whole ring fit is the master's business
//! (sercos2.md 5.3).

mod finding;

use crate::capacity::LIST_ENTRIES;
use crate::data_block::{NeededFor, Selection};
use crate::dictionary::Dictionary;
use crate::duration::{self, BitRate};
use crate::idn::Idn;
use crate::parameters::{self, Parameters};
use crate::phase::{ReadyForCp3, ReadyForCp4};
use crate::telegram_type::TelegramType;
use crate::unit::Dimension;
use crate::weighting::Weighting;
use heapless::Vec;

pub use finding::{FINDINGS, Invalid, InvalidData, Reason};

/// What the drive can do beyond the read-only data of the dictionary.
#[derive(Clone, Copy, Debug)]
pub struct Capabilities {
    /// Bit rate of the ring.
    pub bit_rate: BitRate,
    /// Values that S-0-0032 to S-0-0035 and S-0-0284 to S-0-0287 may have, besides 0 (none) for the secondary modes.
    pub operation_modes: &'static [u16],
    /// There is a position feedback 2 (S-0-0053).
    pub feedback_2: bool,
}

/// Everything that CP3 and CP4 need to know, taken from parameters that passed S-0-0127.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CyclicConfiguration {
    /// S-0-0002.
    pub cycle_us: u16,
    /// S-0-0001.
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
const POSITION_POLARITY: Idn = Idn::standard(55);
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
    let dictionary = parameters.dictionary();
    let mut invalid = InvalidData::default();
    // The least that masters write (sercos2.md 2.3); the others have usable defaults.
    for idn in [Idn::CYCLE, T1, RECORD_POSITION, MDT_LENGTH, T2] {
        if !parameters.is_written(idn) {
            invalid.add(idn, Reason::NeverWritten);
        }
    }
    check_ranges(parameters, NeededFor::Cp3, &mut invalid);

    let cycle_us = parameters.get_word(Idn::CYCLE);
    let control_unit_cycle_us = parameters.get_word(Idn::CONTROL_UNIT_CYCLE);
    if control_unit_cycle_us.checked_rem(cycle_us) != Some(0) {
        invalid.add(Idn::CONTROL_UNIT_CYCLE, Reason::NotAMultiple);
    }

    let telegram_type = parameters.telegram_type();
    if telegram_type.is_none() {
        invalid.add(Idn::TELEGRAM_TYPE, Reason::NotSupported);
    }
    if telegram_type.is_some_and(TelegramType::uses_feedback_2) && !capabilities.feedback_2 {
        invalid.add(Idn::TELEGRAM_TYPE, Reason::NoFeedback2);
    }
    let asked_for = parameters.cyclic_at().contains(&Idn::POSITION_FEEDBACK_2);
    if telegram_type == Some(TelegramType::APPLICATION) && asked_for && !capabilities.feedback_2 {
        invalid.add(Idn::AT_LIST, Reason::NoFeedback2);
    }
    let blamed = |list| if telegram_type == Some(TelegramType::APPLICATION) { list } else { Idn::TELEGRAM_TYPE };
    let at = lay_out(dictionary, parameters.cyclic_at(), Selection::ConfigurableInAt, parameters.get_word(AT_MAXIMUM))
        .unwrap_or_else(|reason| {
            invalid.add(blamed(Idn::AT_LIST), reason);
            Vec::new()
        });
    let mdt =
        lay_out(dictionary, parameters.cyclic_mdt(), Selection::ConfigurableInMdt, parameters.get_word(MDT_MAXIMUM))
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
    let mut invalid = InvalidData::default();
    invalid.not_synchronised = !synchronised;
    check_ranges(parameters, NeededFor::Cp4, &mut invalid);
    for idn in OPERATION_MODES {
        let mode = parameters.get_word(idn);
        // Secondary modes may be absent.
        if mode == 0 && idn != OPERATION_MODES[0] {
            continue;
        }
        if !capabilities.operation_modes.contains(&mode) {
            invalid.add(idn, Reason::NotSupported);
        } else if let Some(command) = command_value_of(mode)
            && !configuration.mdt.iter().any(|datum| datum.idn == command)
        {
            invalid.add(idn, Reason::CommandValueMissing(command));
        }
    }
    for dimension in [Dimension::Position, Dimension::Velocity, Dimension::Torque, Dimension::Acceleration] {
        if let Err(scaling_type) = Weighting::of(dimension, parameters) {
            invalid.add(scaling_type, Reason::NotSupported);
        }
    }
    let modulo = Idn::standard(103);
    let is_modulo = Weighting::of(Dimension::Position, parameters).is_ok_and(|weighting| weighting.modulo);
    if is_modulo && parameters.get(modulo) == 0 {
        invalid.add(modulo, Reason::OutOfRange);
    }
    check_polarities(parameters, &mut invalid);
    check_position_limits(parameters, &mut invalid);
    if invalid.is_empty() { Ok(ReadyForCp4::new()) } else { Err(invalid) }
}

/// S-0-0043, S-0-0055, S-0-0085. Each bit of velocities and torques turns its own value round. Positions have one direction.
fn check_polarities(parameters: &Parameters, invalid: &mut InvalidData) {
    // Command, additive command, feedback 1 and 2; limits on.
    for (number, bits) in [(43, 0b0_1111_u16), (55, 0b1_1111), (85, 0b0_0111)] {
        let polarity = Idn::standard(number);
        if parameters.get_word(polarity) & !bits != 0 {
            invalid.add(polarity, Reason::NotSupported);
        }
    }
    let polarity = parameters.get_word(POSITION_POLARITY);
    if (polarity ^ polarity >> 2) & 1 != 0 {
        invalid.add(POSITION_POLARITY, Reason::MixedPolarity);
    }
}

/// S-0-0049 and S-0-0050: an endless axis has no end that it could pass, and the highest position is not below the lowest.
fn check_position_limits(parameters: &Parameters, invalid: &mut InvalidData) {
    const LIMITS_ON: u16 = 1 << 4;
    const MODULO: u16 = 1 << 7;
    let (highest, lowest) = (Idn::standard(49), Idn::standard(50));
    if parameters.get_signed(highest) < parameters.get_signed(lowest) {
        invalid.add(highest, Reason::Contradicts(lowest));
    }
    let position_scaling = Idn::standard(76);
    let on = parameters.get_word(POSITION_POLARITY) & LIMITS_ON != 0;
    if on && parameters.get_word(position_scaling) & MODULO != 0 {
        invalid.add(POSITION_POLARITY, Reason::Contradicts(position_scaling));
    }
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
    // Commands over the service channel, or a target that the drive goes to by itself (S-0-0258 or, with bit 9, S-0-0282, wherever it
    // comes from).
    if operation_mode & 0x4000 != 0 || operation_mode & 0x01F0 == 0x0010 {
        return None;
    }
    match operation_mode & 7 {
        1 => Some(Idn::TORQUE_COMMAND),
        2 => Some(Idn::VELOCITY_COMMAND),
        3..=5 => Some(Idn::POSITION_COMMAND),
        _ => None,
    }
}

fn check_ranges(parameters: &Parameters, needed_for: NeededFor, invalid: &mut InvalidData) {
    let needed = parameters.dictionary().blocks().iter().filter(|block| block.needed_for == needed_for);
    for block in needed.filter(|block| block.fixed_bytes().is_some()) {
        if parameters::check_limits(block, parameters.get(block.idn).into()).is_err() {
            invalid.add(block.idn, Reason::OutOfRange);
        }
    }
}

/// Places data one after the other.
fn lay_out(
    dictionary: &Dictionary,
    idns: &[Idn],
    selection: Selection,
    maximum: u16,
) -> Result<Vec<CyclicDatum, LIST_ENTRIES>, Reason> {
    let mut data: Vec<CyclicDatum, LIST_ENTRIES> = Vec::new();
    for &idn in idns {
        let block = dictionary.find(idn).filter(|block| block.is_in(selection));
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
mod tests;
