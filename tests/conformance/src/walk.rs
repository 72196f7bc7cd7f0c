//! A walk over the service channel: every element of every data block is read and written in CP2, CP3 and CP4, and every answer is compared
//! with what the table says.

use drive::DICTIONARY;
use sercos::Phase;
use sercos::data_block::{DataBlock, Location, Selection};
use serde::Serialize;

use crate::configuration::Configuration;
use crate::slave::{Outcome, Slave};

/// S-0-0267: what is written to it would lock the rest of the walk out.
const PASSWORD: u16 = 267;

/// What was seen.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct WalkReport {
    /// Elements read.
    pub elements: u64,
    /// Writes, refused ones included.
    pub writes: u64,
    /// Most cycles that a step took.
    pub slowest_cycles: u32,
    /// The step that took them.
    pub slowest_step: String,
    /// Answers that are not what the table says.
    pub disagreements: Vec<String>,
}

/// Reads every element and writes everything that can be written or must be refused, in CP2, CP3 and CP4.
///
/// # Errors
/// The handshake fails, or the run-up does not go on: the walk has broken something.
pub fn walk(slave: &mut Slave) -> Outcome<WalkReport> {
    let mut report = WalkReport::default();
    slave.to_cp2()?;
    over_all(slave, Phase::Cp2, &mut report)?;
    slave.configure(Configuration {
        control_unit_cycle: Some(2_000),
        others: vec![(16, vec![0, 0]), (24, vec![0, 0])],
        ..Configuration::default()
    })?;
    slave.to_cp3()?;
    over_all(slave, Phase::Cp3, &mut report)?;
    slave.to_cp4()?;
    over_all(slave, Phase::Cp4, &mut report)?;
    report.slowest_cycles = slave.slowest.0;
    report.slowest_step = slave.slowest.1.map(|step| step.to_string()).unwrap_or_default();
    Ok(report)
}

/// Reads every element of every data block in the phase that the slave is in.
///
/// # Errors
/// The handshake fails.
pub fn read_all(slave: &mut Slave, phase: Phase) -> Outcome<WalkReport> {
    let mut report = WalkReport::default();
    for block in DICTIONARY.blocks() {
        read(slave, block, phase, &mut report)?;
    }
    report.slowest_cycles = slave.slowest.0;
    Ok(report)
}

fn over_all(slave: &mut Slave, phase: Phase, report: &mut WalkReport) -> Outcome {
    for block in DICTIONARY.blocks() {
        read(slave, block, phase, report)?;
        write(slave, block, phase, report)?;
        slave.close()?;
    }
    Ok(())
}

/// Elements 1 to 7.
fn read(slave: &mut Slave, block: &DataBlock, phase: Phase, report: &mut WalkReport) -> Outcome {
    let idn = block.idn;
    let mut compare = |what: &str, seen: Result<Vec<u16>, u16>, expected: Result<Vec<u16>, u16>| {
        report.elements += 1;
        if seen != expected {
            report.disagreements.push(format!("{idn} in {phase}, {what}: expected {expected:04X?}, seen {seen:04X?}"));
        }
    };
    slave.open(idn.0)?;
    compare("element 1", slave.words(1, 1)?, Ok(vec![idn.0]));
    slave.open(idn.0)?;
    compare("name", slave.list(2)?, Ok(text(block.name)));
    // Element by element as under the default scaling, which no step of this walk leaves.
    let attribute = block.attribute.raw_value();
    compare("attribute", slave.words(3, 2)?, Ok(words_of(attribute.into(), 2)));
    let unit = if block.unit.is_empty() { Err(0x4001) } else { Ok(text(block.unit.preferred())) };
    compare("unit", slave.list(4)?, unit);
    for (element, limit) in [(5_u8, block.minimum), (6, block.maximum)] {
        let words = usize::from(block.fixed_bytes().unwrap_or(2) / 2);
        let expected = limit.map(|limit| words_of(limit as u64, words)).ok_or(u16::from(element) << 12 | 1);
        compare(if element == 5 { "minimum" } else { "maximum" }, slave.words(element, words)?, expected);
    }
    let data = data(slave, block)?;
    if let Location::Dictionary(selection) = block.location {
        compare("operation data", data, Ok(idns(selection)));
    } else {
        let readable = data.is_ok();
        compare("operation data", data.clone(), if readable { data } else { Ok(Vec::new()) });
    }
    slave.open(idn.0).map(|_| ())
}

/// Every element but the first is written with what must be refused, the operation data also with what must be taken.
fn write(slave: &mut Slave, block: &DataBlock, phase: Phase, report: &mut WalkReport) -> Outcome {
    let idn = block.idn;
    for element in 2..=6_u8 {
        let available = match element {
            4 => !block.unit.is_empty(),
            5 => block.minimum.is_some(),
            6 => block.maximum.is_some(),
            _ => true,
        };
        let expected = u16::from(element) << 12 | if available { 4 } else { 1 };
        let answer = slave.send(element, true, true, 0)?.result();
        report.writes += 1;
        if answer != Err(expected) {
            report.disagreements.push(format!("{idn} in {phase}, writing element {element}: {answer:04X?}"));
        }
    }
    if idn.0 == PASSWORD {
        return Ok(());
    }
    let before = data(slave, block)?.unwrap_or_default();
    for (what, words, verdict) in attempts(block, &before) {
        let expected = protection(slave, block, phase).map_or(verdict, Verdict::Refused);
        let answer = slave.write(&words)?;
        let after = data(slave, block)?;
        report.writes += 1;
        let agrees = match (expected, answer) {
            (Verdict::Taken, Ok(_)) => shows_something_else(block) || after == Ok(own_maximum(block, &words, &before)),
            (Verdict::Taken, Err(code)) => block.restricted && matches!(code, 0x1001 | 0x7008 | 0x700C),
            (Verdict::Refused(code), Err(seen)) => {
                code == seen && (changes_by_itself(block) || after == Ok(before.clone()))
            }
            (Verdict::Refused(_), Ok(_)) => false,
        };
        if !agrees {
            let after = after.map(|after| after != before);
            report.disagreements.push(format!(
                "{idn} in {phase}, {what} {words:04X?}: expected {expected:04X?}, seen {answer:04X?}, changed: {after:?}"
            ));
        }
        if answer.is_ok() && block.location != Location::Command {
            // So that the next phase and the next data block find the drive as it was.
            slave.write(&before)?.map_err(|code| format!("{idn}: the old value is refused with {code:04X}H"))?;
        }
    }
    Ok(())
}

/// What the table says of a write.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Verdict {
    Taken,
    Refused(u16),
}

/// The refusal that comes before any look at the value.
fn protection(slave: &Slave, block: &DataBlock, phase: Phase) -> Option<u16> {
    if block.attribute.is_read_only() {
        return Some(0x7004);
    }
    if block.attribute.is_protected_in(phase) {
        return Some(0x7005);
    }
    // Telegram type 2: the velocity command.
    let in_mdt = slave.configuration.telegram_type == 2 && block.idn == sercos::Idn::VELOCITY_COMMAND;
    (phase >= Phase::Cp3 && in_mdt).then_some(0x700A)
}

/// Values to be written: what they are called, their words, and the verdict if nothing protects the data block.
fn attempts(block: &DataBlock, before: &[u16]) -> Vec<(&'static str, Vec<u16>, Verdict)> {
    let Some(bytes) = block.fixed_bytes() else {
        let item = block.attribute.length().item_bytes().unwrap_or(1);
        let mut attempts = vec![
            ("an empty list", vec![0, 0], Verdict::Taken),
            ("only one length word", vec![0], Verdict::Refused(0x7002)),
            ("an item too few", vec![4, 4, 1], Verdict::Refused(0x7002)),
            ("an item too many", vec![4, 4, 1, 2, 3], Verdict::Refused(0x7003)),
            ("a length beyond the maximum", vec![0xFFFC, 0xFFFC], Verdict::Refused(0x7003)),
            ("what is there already", [&[before[0], before[0]], &before[2..]].concat(), Verdict::Taken),
        ];
        if item > 1 {
            attempts.push(("half an item", vec![3, 3, 1, 1], Verdict::Refused(0x7008)));
        }
        return attempts;
    };
    let words = usize::from(bytes / 2);
    if block.location == Location::Command {
        return vec![
            ("cancel", vec![0], Verdict::Taken),
            ("an invalid command", vec![2], Verdict::Refused(0x7008)),
            ("a word too many", vec![0, 0], Verdict::Refused(0x7003)),
        ];
    }
    let mut attempts = vec![("a word too many", vec![0; words + 1], Verdict::Refused(0x7003))];
    if words > 1 {
        attempts.push(("a word too few", vec![0; words - 1], Verdict::Refused(0x7002)));
    }
    let in_range = |value: i64| {
        let (least, most) = match (block.attribute.value_of(u64::MAX) < 0, bytes) {
            (true, 2) => (i64::from(i16::MIN), i64::from(i16::MAX)),
            (true, _) => (i64::from(i32::MIN), i64::from(i32::MAX)),
            (false, 2) => (0, i64::from(u16::MAX)),
            (false, _) => (0, i64::from(u32::MAX)),
        };
        (least..=most).contains(&value)
    };
    for (what, limit, beyond, code) in [("minimum", block.minimum, -1, 0x7006), ("maximum", block.maximum, 1, 0x7007)] {
        let Some(limit) = limit else { continue };
        attempts.push((what, words_of(limit as u64, words), Verdict::Taken));
        if in_range(limit + beyond) {
            let name = if beyond < 0 { "below minimum" } else { "above maximum" };
            attempts.push((name, words_of((limit + beyond) as u64, words), Verdict::Refused(code)));
        }
    }
    attempts.push(("what is there already", before.to_vec(), Verdict::Taken));
    attempts
}

/// Operation data, whatever their length.
fn data(slave: &mut Slave, block: &DataBlock) -> Outcome<Result<Vec<u16>, u16>> {
    match block.fixed_bytes() {
        Some(bytes) => slave.words(7, usize::from(bytes / 2)),
        None => slave.list(7),
    }
}

/// Live data change between two reads.
fn changes_by_itself(block: &DataBlock) -> bool {
    block.location == Location::Live
}

/// A command shows its data status, not what was written.
fn shows_something_else(block: &DataBlock) -> bool {
    block.location == Location::Command
}

/// A list as it reads back: the second length word is the drive's own.
fn own_maximum(block: &DataBlock, written: &[u16], read: &[u16]) -> Vec<u16> {
    match (written, read) {
        ([length, _, items @ ..], [_, maximum, ..]) if block.fixed_bytes().is_none() => {
            [&[*length, *maximum], items].concat()
        }
        _ => written.to_vec(),
    }
}

fn text(text: &str) -> Vec<u16> {
    let length = text.len() as u16;
    let pairs = text.as_bytes().chunks(2);
    let words = pairs.map(|pair| u16::from(pair[0]) | u16::from(pair.get(1).copied().unwrap_or(0)) << 8);
    [length, length].into_iter().chain(words).collect()
}

fn idns(selection: Selection) -> Vec<u16> {
    let idns: Vec<u16> = DICTIONARY.select(selection).map(|block| block.idn.0).collect();
    let bytes = 2 * idns.len() as u16;
    [bytes, bytes].into_iter().chain(idns).collect()
}

/// Words of a value, the low one first.
fn words_of(value: u64, words: usize) -> Vec<u16> {
    (0..words).map(|word| (value >> (16 * word)) as u16).collect()
}

impl WalkReport {
    /// One line for people.
    #[must_use]
    pub fn summary(&self) -> String {
        format!(
            "{} elements read, {} writes, slowest step {} cycles ({}), {} disagreements",
            self.elements,
            self.writes,
            self.slowest_cycles,
            self.slowest_step,
            self.disagreements.len()
        )
    }

    /// Whether the slave has answered everything as the table says, in time.
    ///
    /// # Errors
    /// The first disagreements.
    pub fn verdict(&self) -> Outcome {
        if self.slowest_cycles > 10 {
            return Err(format!("a step took {} cycles: {}", self.slowest_cycles, self.slowest_step));
        }
        if self.disagreements.is_empty() {
            return Ok(());
        }
        let shown = self.disagreements.iter().take(5).cloned().collect::<Vec<_>>().join("; ");
        Err(format!("{} disagreements: {shown}", self.disagreements.len()))
    }
}
