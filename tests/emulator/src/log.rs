//! The product's defmt output, read out of its RTT buffer.

use std::path::Path;

use defmt_decoder::{DecodeError, Table};
use object::{Object, ObjectSymbol};
use ring::Nanoseconds;

use crate::EmulatorError;

/// One line that the product logged.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LogLine {
    /// Simulated time at which the host fetched it; at most one exchange after it was written.
    pub time: Nanoseconds,
    /// `trace` to `error`, empty for `println`.
    pub level: &'static str,
    /// The message.
    pub text: String,
}

/// Offsets in SEGGER's control block: 16 bytes of name, two counts, then the first up channel.
const BUFFER: u32 = 28;
const WRITE: u32 = 36;
const READ: u32 = 40;

/// Decoder and RTT bookkeeping of one guest.
pub(crate) struct Log {
    table: Option<Table>,
    control_block: Option<u32>,
    read: u32,
    bytes: Vec<u8>,
    /// The product starts again, and so do its indices.
    restarted: bool,
}

impl Log {
    /// Finds the control block and the format strings in the product's ELF. A product without them simply has no log.
    pub(crate) fn new(path: &Path, elf: &[u8]) -> Result<Self, EmulatorError> {
        let broken = |what: String| EmulatorError::Elf { path: path.to_owned(), what };
        let file = object::File::parse(elf).map_err(|error| broken(error.to_string()))?;
        let control_block =
            file.symbols().find(|symbol| symbol.name() == Ok("_SEGGER_RTT")).map(|symbol| symbol.address() as u32);
        let table = Table::parse(elf).map_err(|error| broken(format!("defmt: {error}")))?;
        Ok(Self { table, control_block, read: 0, bytes: Vec::new(), restarted: false })
    }

    /// Address of the write index, 0 = no log.
    pub(crate) fn watch(&self) -> u32 {
        match (&self.table, self.control_block) {
            (Some(_), Some(block)) => block + WRITE,
            _ => 0,
        }
    }

    /// Address of the words {buffer, size} in the control block, if the write index says that there is something to fetch.
    pub(crate) fn wants(&mut self, write: u32) -> Option<u32> {
        let block = self.control_block?;
        if std::mem::take(&mut self.restarted) {
            self.read = 0;
        }
        (write != self.read).then_some(block + BUFFER)
    }

    /// The address of the read index and its new value, once everything up to `write` was fetched.
    pub(crate) fn fetched(&mut self, write: u32, bytes: &[u8]) -> Option<(u32, u32)> {
        self.bytes.extend_from_slice(bytes);
        self.read = write;
        self.control_block.map(|block| (block + READ, write))
    }

    /// The product was reset: what it logs next begins at the start of its buffer.
    pub(crate) fn restart(&mut self) {
        self.restarted = true;
        self.bytes.clear();
    }

    /// Index behind the last byte that was fetched.
    pub(crate) fn read_index(&self) -> u32 {
        self.read
    }

    /// Decodes the complete frames; a frame ends with a zero byte (rzCOBS).
    pub(crate) fn lines(&mut self, time: Nanoseconds) -> Vec<LogLine> {
        let mut lines = Vec::new();
        let Some(table) = &self.table else {
            return lines;
        };
        let Some(last) = self.bytes.iter().rposition(|byte| *byte == 0) else {
            return lines;
        };
        let complete: Vec<u8> = self.bytes.drain(..=last).collect();
        let mut decoder = table.new_stream_decoder();
        decoder.received(&complete);
        loop {
            match decoder.decode() {
                Ok(frame) => lines.push(LogLine {
                    time,
                    level: frame.level().map_or("", |level| level.as_str()),
                    text: frame.display_message().to_string(),
                }),
                Err(DecodeError::UnexpectedEof) => return lines,
                Err(DecodeError::Malformed) => lines.push(LogLine {
                    time,
                    level: "error",
                    text: "(undecodable log frame: the log buffer overran)".into(),
                }),
            }
        }
    }
}

impl std::fmt::Debug for Log {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        formatter
            .debug_struct("Log")
            .field("control_block", &self.control_block)
            .field("read", &self.read)
            .finish_non_exhaustive()
    }
}
