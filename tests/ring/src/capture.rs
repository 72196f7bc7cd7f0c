//! Recordings of masters: the file format of the captures' README, read and written.
//!
//! One telegram a line, tab-separated: cycle, kind, bytes, frame check sequence, line levels. Everything that the
//! columns say twice is checked, so that a damaged file is one clear line and not a failed replay.

use std::fmt::Write as _;
use std::path::Path;

use thiserror::Error;

use crate::ring::{Sender, TraceEntry};
use crate::wire::{BROADCAST, LineError, LineSignal, check_sequence};

/// Columns of a line.
const COLUMNS: [&str; 5] = ["cycle", "kind", "bytes", "fcs", "line"];
/// Bit times before the opening flag in the files that are written here.
const LEAD: usize = 2;

/// What a recorded telegram is.
#[derive(Copy, Clone, Debug, PartialEq, Eq)]
pub enum RecordedKind {
    /// Master synchronisation telegram.
    Mst,
    /// Master data telegram.
    Mdt,
}

/// One line of a recording.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RecordedTelegram {
    /// Line of the file, counted from 1.
    pub line: usize,
    /// Cycle, counted from the first MST.
    pub cycle: u64,
    /// What it is.
    pub kind: RecordedKind,
    /// Address and data.
    pub bytes: Vec<u8>,
}

/// One cycle of a recording.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RecordedCycle {
    /// Phase of the MST.
    pub phase: u8,
    /// The MDT, if there was one.
    pub mdt: Option<Vec<u8>>,
}

/// A recording without a fault.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Recording {
    /// All cycles, in order.
    pub cycles: Vec<RecordedCycle>,
}

/// Why a file is no recording.
#[derive(Debug, Error)]
pub enum CaptureError {
    /// The file cannot be read.
    #[error("{path}: {error}")]
    File {
        /// Which file.
        path: String,
        /// What the system says.
        error: std::io::Error,
    },
    /// A line is wrong.
    #[error("line {line}: {fault}")]
    Line {
        /// Line of the file, counted from 1.
        line: usize,
        /// What is wrong with it.
        fault: LineFault,
    },
    /// There is no telegram in it.
    #[error("no telegram in {lines} lines")]
    Empty {
        /// Lines of the file.
        lines: usize,
    },
}

/// What is wrong with a line.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum LineFault {
    /// Not five columns.
    #[error("{actual} columns, expected 5 (cycle, kind, bytes, fcs, line)")]
    Columns {
        /// How many there are.
        actual: usize,
    },
    /// A column that cannot be read.
    #[error("column {column}: {text:?}, expected {expected}")]
    Column {
        /// Its name.
        column: &'static str,
        /// What stands there.
        text: String,
        /// What should.
        expected: &'static str,
    },
    /// Cycles count the MSTs.
    #[error("cycle {actual}, expected {expected}")]
    Cycle {
        /// What stands there.
        actual: u64,
        /// What should.
        expected: u64,
    },
    /// Two MDTs in a cycle.
    #[error("second MDT in cycle {cycle}, expected one at most")]
    SecondMdt {
        /// The cycle.
        cycle: u64,
    },
    /// An MST that is none.
    #[error("{kind} with {bytes} bytes, first {first:#04x}; expected {expected}")]
    Shape {
        /// What the line says it is.
        kind: &'static str,
        /// Address and data bytes.
        bytes: usize,
        /// The address.
        first: u8,
        /// What such a telegram looks like.
        expected: &'static str,
    },
    /// A phase that does not exist.
    #[error("phase {actual}, expected 0 to 4")]
    Phase {
        /// What stands there.
        actual: u8,
    },
    /// The check sequence does not belong to the bytes.
    #[error("frame check sequence {actual}, expected {expected}")]
    CheckSequence {
        /// What stands there.
        actual: String,
        /// What belongs there.
        expected: String,
    },
    /// The line levels are no telegram.
    #[error("line levels: {0}")]
    Levels(#[from] LineError),
    /// The line levels are another telegram.
    #[error("line levels decode to {actual}, expected {expected}")]
    OtherTelegram {
        /// What they decode to.
        actual: String,
        /// The bytes of the line.
        expected: String,
    },
}

impl Recording {
    /// Reads a file.
    ///
    /// # Errors
    ///
    /// The first thing that is wrong with it.
    pub fn open(path: &Path) -> Result<Self, CaptureError> {
        let text = std::fs::read_to_string(path)
            .map_err(|error| CaptureError::File { path: path.display().to_string(), error })?;
        Self::parse(&text)
    }

    /// Reads the text of a file.
    ///
    /// # Errors
    ///
    /// The first thing that is wrong with it.
    pub fn parse(text: &str) -> Result<Self, CaptureError> {
        let mut cycles: Vec<RecordedCycle> = Vec::new();
        for (index, text) in text.lines().enumerate() {
            if text.starts_with('#') || text.trim().is_empty() {
                continue;
            }
            let line = index + 1;
            let telegram = parse_line(line, text).map_err(|fault| CaptureError::Line { line, fault })?;
            append(&mut cycles, telegram).map_err(|fault| CaptureError::Line { line, fault })?;
        }
        if cycles.is_empty() {
            return Err(CaptureError::Empty { lines: text.lines().count() });
        }
        Ok(Self { cycles })
    }

    /// The telegrams that a master has sent, out of a ring's trace.
    ///
    /// # Errors
    ///
    /// When they do not make a recording: an MDT before the first MST, for example.
    pub fn of_trace(trace: &[TraceEntry]) -> Result<Self, LineFault> {
        let mut cycles: Vec<RecordedCycle> = Vec::new();
        for (index, entry) in trace.iter().filter(|entry| entry.sender == Sender::Master).enumerate() {
            let (kind, cycle) = match entry.bytes[..] {
                [BROADCAST, _] => (RecordedKind::Mst, cycles.len()),
                _ => (RecordedKind::Mdt, cycles.len().saturating_sub(1)),
            };
            append(
                &mut cycles,
                RecordedTelegram { line: index + 1, cycle: cycle as u64, kind, bytes: entry.bytes.clone() },
            )?;
        }
        Ok(Self { cycles })
    }

    /// The text of a file with this recording in it.
    pub fn to_text(&self) -> String {
        let mut text = format!("# {}\n", COLUMNS.join("\t"));
        for (cycle, recorded) in self.cycles.iter().enumerate() {
            let mst = vec![BROADCAST, recorded.phase];
            for (kind, bytes) in std::iter::once(("MST", &mst)).chain(recorded.mdt.iter().map(|mdt| ("MDT", mdt))) {
                let sequence = check_sequence(bytes).to_le_bytes();
                let levels: String =
                    LineSignal::of_telegram(bytes).to_packed(LEAD).iter().map(|byte| format!("{byte:02x}")).collect();
                let _ = writeln!(text, "{cycle}\t{kind}\t{}\t{}\t{levels}", spaced(bytes), spaced(&sequence));
            }
        }
        text
    }
}

/// Writes the telegrams that a master has sent as a file of the captures' format; `Recording::parse` reads it back.
///
/// # Errors
///
/// When the trace does not make a recording, or the file cannot be written.
pub fn write_capture(path: &Path, trace: &[TraceEntry]) -> Result<(), CaptureError> {
    let recording = Recording::of_trace(trace).map_err(|fault| CaptureError::Line { line: 0, fault })?;
    std::fs::write(path, recording.to_text())
        .map_err(|error| CaptureError::File { path: path.display().to_string(), error })
}

fn append(cycles: &mut Vec<RecordedCycle>, telegram: RecordedTelegram) -> Result<(), LineFault> {
    let RecordedTelegram { cycle, kind, bytes, .. } = telegram;
    match kind {
        RecordedKind::Mst => {
            let [BROADCAST, phase] = bytes[..] else {
                return Err(shape("MST", &bytes, "ff and one phase byte"));
            };
            if phase > 4 {
                return Err(LineFault::Phase { actual: phase });
            }
            let expected = cycles.len() as u64;
            if cycle != expected {
                return Err(LineFault::Cycle { actual: cycle, expected });
            }
            cycles.push(RecordedCycle { phase, mdt: None });
        }
        RecordedKind::Mdt => {
            let expected = (cycles.len() as u64).saturating_sub(1);
            let Some(last) = cycles.last_mut().filter(|_| cycle == expected) else {
                return Err(LineFault::Cycle { actual: cycle, expected });
            };
            let fits = match last.phase {
                0 => return Err(shape("MDT in CP0", &bytes, "none")),
                1 | 2 => bytes.len() == 5 && bytes[0] != BROADCAST && bytes[0] != 0,
                _ => bytes.len() >= 5 && bytes.len() % 2 == 1 && bytes[0] == BROADCAST,
            };
            if !fits {
                let expected = if last.phase < 3 {
                    "address 1 to 254 and 4 bytes"
                } else {
                    "ff and at least one record of even length"
                };
                return Err(shape("MDT", &bytes, expected));
            }
            if last.mdt.is_some() {
                return Err(LineFault::SecondMdt { cycle });
            }
            last.mdt = Some(bytes);
        }
    }
    Ok(())
}

fn shape(kind: &'static str, bytes: &[u8], expected: &'static str) -> LineFault {
    LineFault::Shape { kind, bytes: bytes.len(), first: bytes.first().copied().unwrap_or(0), expected }
}

fn parse_line(line: usize, text: &str) -> Result<RecordedTelegram, LineFault> {
    let columns: Vec<&str> = text.split('\t').collect();
    let [cycle, kind, bytes, sequence, levels] = columns[..] else {
        return Err(LineFault::Columns { actual: columns.len() });
    };
    let cycle = cycle.parse().map_err(|_| column("cycle", cycle, "a number"))?;
    let kind = match kind {
        "MST" => RecordedKind::Mst,
        "MDT" => RecordedKind::Mdt,
        other => return Err(column("kind", other, "MST or MDT")),
    };
    let bytes = hex(bytes.split(' ')).ok_or_else(|| column("bytes", bytes, "two hex digits a byte, spaces between"))?;
    let expected = spaced(&check_sequence(&bytes).to_le_bytes());
    if sequence != expected {
        return Err(LineFault::CheckSequence { actual: sequence.to_owned(), expected });
    }
    let pairs: Vec<&str> = levels.as_bytes().chunks(2).map(|pair| std::str::from_utf8(pair).unwrap_or("")).collect();
    let packed = hex(pairs.into_iter()).ok_or_else(|| column("line", levels, "two hex digits a byte"))?;
    let signal = LineSignal::from_packed(&packed);
    let decoded = signal.telegram()?;
    if decoded != bytes {
        return Err(LineFault::OtherTelegram { actual: spaced(decoded), expected: spaced(&bytes) });
    }
    Ok(RecordedTelegram { line, cycle, kind, bytes })
}

fn column(column: &'static str, text: &str, expected: &'static str) -> LineFault {
    let text = text.chars().take(40).collect();
    LineFault::Column { column, text, expected }
}

fn hex<'a>(pairs: impl Iterator<Item = &'a str>) -> Option<Vec<u8>> {
    pairs.map(|pair| if pair.len() == 2 { u8::from_str_radix(pair, 16).ok() } else { None }).collect()
}

fn spaced(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;

    const MST: &str = "0\tMST\tff 00\t87 f0\t3f81eabd6be03f";

    fn fault(text: &str) -> String {
        Recording::parse(text).expect_err("the text is damaged").to_string()
    }

    #[test]
    fn a_good_line_is_read_and_written_alike() {
        let recording = Recording::parse(&format!("# cycle\tkind\n\n{MST}\n")).expect("the line is good");
        assert_eq!(recording.cycles, [RecordedCycle { phase: 0, mdt: None }]);
        let again = Recording::parse(&recording.to_text()).expect("what is written can be read");
        assert_eq!(again, recording);
    }

    #[test]
    fn damage_is_one_clear_line() {
        assert_eq!(fault("# nothing"), "no telegram in 1 lines");
        assert_eq!(fault("0\tMST\tff 00"), "line 1: 3 columns, expected 5 (cycle, kind, bytes, fcs, line)");
        assert_eq!(fault(&MST.replace("MST", "AT")), "line 1: column kind: \"AT\", expected MST or MDT");
        assert_eq!(fault(&MST.replace("87 f0", "87 f1")), "line 1: frame check sequence 87 f1, expected 87 f0");
        assert_eq!(fault(&format!("{MST}\n{MST}")), "line 2: cycle 0, expected 1");
        assert_eq!(
            fault(&MST.replace("ff 00", "fg 00")),
            "line 1: column bytes: \"fg 00\", expected two hex digits a byte, spaces between"
        );
        assert!(fault(&MST.replace("3f81", "3f80")).starts_with("line 1: line levels: "));
        assert_eq!(
            fault(&MST.replace("3f81eabd6be03f", "3f81")),
            "line 1: line levels: no closing flag in 6 bits after the opening one"
        );
    }

    #[test]
    fn a_line_that_says_two_things_is_refused() {
        let mdt_levels: String =
            LineSignal::of_telegram(&[1, 1, 0, 0, 0]).to_packed(2).iter().map(|byte| format!("{byte:02x}")).collect();
        assert_eq!(
            fault(&format!("0\tMST\tff 00\t87 f0\t{mdt_levels}")),
            "line 1: line levels decode to 01 01 00 00 00, expected ff 00"
        );
        assert_eq!(
            fault(&format!("0\tMST\t01 01 00 00 00\t88 d8\t{mdt_levels}")),
            "line 1: MST with 5 bytes, first 0x01; expected ff and one phase byte"
        );
        assert_eq!(
            fault(&format!("{MST}\n0\tMDT\t01 01 00 00 00\t88 d8\t{mdt_levels}")),
            "line 2: MDT in CP0 with 5 bytes, first 0x01; expected none"
        );
    }
}
