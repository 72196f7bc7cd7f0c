//! Values of parameters, and what the transition checks make of them.

use std::sync::LazyLock;

use drive::dictionary::{DICTIONARY, records, source};
use drive::{Amplifier, CurrentSensing, Divider, DriveSettings, Facts, PwmFrequency, TemperatureSensor, Thermometers};
use sercos::command::CommandStatus;
use sercos::data_block::{DataBlock, Location, NeededFor, Selection};
use sercos::duration::{self, BitRate};
use sercos::transition::{self, Capabilities, CyclicConfiguration};
use sercos::{Idn, Phase};

use crate::bytes::{Bytes, chosen};
use crate::run_up::{command, run_up, words_of};
use crate::support::{CAPABILITIES, Slave};

/// Of both temperature inputs.
const DIVIDER: Divider = Divider { pull_up: 2_200, supply: 3_300, reference: 3_300 };

/// On a board as it comes.
const AMPLIFIER: Amplifier = Amplifier {
    peak_current: 14_142,
    continuous_current: 7_071,
    trip_current: 17_677,
    current_range: 25_000,
    dead_time_band: 200,
    bus_range: 500,
    undervoltage: 150,
    overvoltage: 440,
    withstand_voltage: 600,
    least_resistance: 220,
    warning_temperature: 800,
    shutdown_temperature: 900,
    thermal_time_constant: 5_000,
};

/// As the board has them.
pub(crate) const FACTS: Facts = Facts {
    frequency: PwmFrequency::Khz16,
    dead_time: 1_000,
    current_sensing: CurrentSensing::InLine,
    loop_timer_counts: 10_500,
    sample_to_count: 2_200,
    encoder_rate: 18_600_000,
    thermometers: &Thermometers::new(TemperatureSensor::Ntc5k, &DIVIDER, &DIVIDER),
};

/// Whatever values a master writes before it asks for the transition checks:
///
/// * nothing panics, neither the checks nor the scaling of the loops;
/// * what passes S-0-0127 fits into the cycle, and the drive has records for it;
/// * what fails a check is named in S-0-0021 or S-0-0022;
/// * a proper run-up afterwards ends in CP4.
///
/// # Panics
/// When one of these does not hold.
pub fn configuration(bytes: &[u8]) {
    let mut bytes = Bytes::new(bytes);
    let Some(choice) = bytes.byte() else { return };
    let bit_rate = chosen(&[BitRate::Mbit2, BitRate::Mbit4, BitRate::Mbit8, BitRate::Mbit16], usize::from(choice));
    let capabilities = Capabilities { bit_rate, ..CAPABILITIES };
    let mut slave = Slave::in_cp2();
    AMPLIFIER.show(&FACTS, &mut slave.parameters);
    slave.configure();
    let writes_in_cp2 = usize::from(choice >> 2 & 0xF);
    for _ in 0..writes_in_cp2 {
        write(&mut slave, &mut bytes);
    }
    if let Ok((configuration, _)) = transition::check_cp3(&slave.parameters, &capabilities) {
        assert_fits(&configuration, bit_rate);
        assert_has_records(&configuration);
    }
    let _ = DriveSettings::new(&slave.parameters, &FACTS, source);
    if checked(&mut slave, Idn::CP3_TRANSITION_CHECK) {
        assert_eq!(slave.mst(3), Ok(()));
        while write(&mut slave, &mut bytes) {}
        let scaled = DriveSettings::new(&slave.parameters, &FACTS, source);
        if checked(&mut slave, Idn::CP4_TRANSITION_CHECK) {
            assert_eq!(slave.mst(4), Ok(()));
            if let Ok(settings) = scaled {
                assert!(settings.motion.modes[0].is_some(), "{settings:?}");
                assert!(
                    settings.motion.cycle.ticks_per_cycle > 0 && settings.motion.cycle.cycles_per_command > 0,
                    "{settings:?}"
                );
            }
        } else {
            assert_eq!(slave.drive.machine.current(), Phase::Cp3);
        }
    }
    run_up(&mut slave);
}

/// Writes what the next bytes say, as far as the drive takes it; false at their end.
fn write(slave: &mut Slave, bytes: &mut Bytes<'_>) -> bool {
    let Some(shape) = bytes.byte() else { return false };
    let block = match shape >> 6 {
        // Those of the cyclic configuration come up most.
        0 | 1 => chosen(&WRITABLE[0], usize::from(shape & 0x3F)),
        _ => match bytes.byte() {
            Some(number) => chosen(&WRITABLE[1], usize::from(number)),
            None => return false,
        },
    };
    let words = match block.fixed_bytes() {
        Some(length) => value(slave, block, length, shape & 0x40 != 0, bytes),
        None => list(block, bytes),
    };
    let Some(words) = words else { return false };
    let before = slave.parameters.clone();
    if slave.set(block.idn, &words).is_err() {
        assert!(slave.parameters == before, "{} has changed with an error", block.idn);
    }
    true
}

/// The words of a value: close to the present one, where limits are met, or any.
fn value(slave: &mut Slave, block: &DataBlock, length: u16, close: bool, bytes: &mut Bytes<'_>) -> Option<Vec<u16>> {
    if close {
        let step = i64::from(bytes.byte()?.cast_signed());
        slave.open(block.idn).ok()?;
        let present = slave.read(7, usize::from(length / 2)).ok()?;
        let present = present.iter().rev().fold(0, |value, &word| value << 16 | i64::from(word));
        return Some(words_of(block, present.wrapping_add(step)));
    }
    let low = i64::from(bytes.word()?);
    // A second word where there is room and one: long values of either sign are as likely as short ones.
    let high = if length == 2 { None } else { bytes.word() };
    Some(words_of(block, high.map_or(low, |high| i64::from(high.cast_signed()) << 16 | low)))
}

/// The words of a list, or of a text that is a list of IDNs as well as any other.
fn list(block: &DataBlock, bytes: &mut Bytes<'_>) -> Option<Vec<u16>> {
    let entries = bytes.byte()?;
    let entries = bytes.up_to(usize::from(entries % 20));
    let length = entries.len() as u16 * 2;
    Some([length, length].into_iter().chain(entries.iter().map(|&entry| entry_of(block, entry))).collect())
}

/// Parameters that a master can write, those that S-0-0127 looks at alone and all of them.
static WRITABLE: LazyLock<[Vec<&'static DataBlock>; 2]> = LazyLock::new(|| {
    let is_writable = |block: &&DataBlock| block.location == Location::Parameter && !block.attribute.is_read_only();
    let all: Vec<&DataBlock> = DICTIONARY.blocks().iter().filter(is_writable).collect();
    [all.iter().copied().filter(|block| block.needed_for == NeededFor::Cp3).collect(), all]
});

/// What S-0-0016 and S-0-0024 can name, and everything.
static ENTRIES: LazyLock<[Vec<Idn>; 3]> = LazyLock::new(|| {
    [Selection::ConfigurableInAt, Selection::ConfigurableInMdt, Selection::All]
        .map(|selection| DICTIONARY.select(selection).map(|block| block.idn).collect())
});

/// An entry of a list: mostly one that its telegram can carry.
fn entry_of(block: &DataBlock, number: u8) -> u16 {
    let entries = match block.idn {
        Idn::AT_LIST if number < 0xF0 => &ENTRIES[0],
        Idn::MDT_LIST if number < 0xF0 => &ENTRIES[1],
        _ => &ENTRIES[2],
    };
    chosen(entries, usize::from(number)).0
}

/// Whether the check was passed; if not, S-0-0021 or S-0-0022 says why.
fn checked(slave: &mut Slave, idn: Idn) -> bool {
    let passed = command(slave, idn) == CommandStatus::Executed;
    let invalid = if idn == Idn::CP3_TRANSITION_CHECK { &slave.drive.invalid_cp3 } else { &slave.drive.invalid_cp4 };
    assert_eq!(passed, invalid.is_empty(), "{idn}: {invalid:?}");
    assert!(invalid.is_sorted_by(|one, next| one < next), "{idn}: {invalid:?}");
    assert_eq!(slave.drive.machine.is_permitted(), passed);
    passed
}

fn assert_fits(configuration: &CyclicConfiguration, bit_rate: BitRate) {
    let nanoseconds = |microseconds: u16| u32::from(microseconds) * 1_000;
    let lasts = |bytes| bit_rate.longest_nanoseconds(bytes);
    let cycle = nanoseconds(configuration.cycle_us);
    let t2 = nanoseconds(configuration.t2_us);
    let t3 = nanoseconds(configuration.t3_us);
    let at_end = nanoseconds(configuration.t1_us) + lasts(duration::at_bytes(configuration.at_data_bytes()));
    let mdt_end = t2 + lasts(duration::mdt_bytes(configuration.mdt_length_bytes));
    assert!(at_end < t2 && mdt_end < cycle, "{configuration:?}");
    assert!(nanoseconds(configuration.t4_us) < cycle && t3 <= cycle, "{configuration:?}");
    assert!(t3 <= t2 || t3 > mdt_end, "{configuration:?}");
    let record_end = u32::from(configuration.record_position_bytes) + 3 + u32::from(configuration.mdt_data_bytes());
    assert!(record_end <= u32::from(configuration.mdt_length_bytes), "{configuration:?}");
    assert!(configuration.record_position_bytes % 2 == 1 && configuration.mdt_length_bytes.is_multiple_of(2));
    assert_eq!(configuration.control_unit_cycle_us % configuration.cycle_us, 0, "{configuration:?}");
    assert_ne!(configuration.control_unit_cycle_us, 0);
}

fn assert_has_records(configuration: &CyclicConfiguration) {
    let records = records(configuration).unwrap_or_else(|| panic!("no records for {configuration:?}"));
    let feedback_words: u16 = records.feedback.iter().map(|datum| datum.words).sum();
    assert_eq!(feedback_words * 2, configuration.at_data_bytes(), "{configuration:?}");
    assert_eq!(records.commands.len(), configuration.mdt.len());
}
