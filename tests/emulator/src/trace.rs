//! Every instruction that the product executes, as the bus inside QEMU writes them down: the source of exact instruction counts.
//!
//! A trace begins and ends while the guest waits for an answer, so that what lies in between is the same in every run. It changes nothing of what the
//! guest does or when: the ticks of a traced run are those of an untraced one.

use std::fs::File;
use std::io::{BufReader, ErrorKind, Read};
use std::path::Path;

use emulator_link::protocol::trace::{ACCESS, ENTERED, LEFT, NUMBER};

use crate::EmulatorError;

/// Something that the processor did.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TraceEvent {
    /// An instruction of the product at this address was executed.
    Instruction(u32),
    /// The last instruction accessed a peripheral or the external bus at this address.
    Access(u32),
    /// The handler of this exception begins (16 + number of the interrupt).
    Entered(u16),
    /// The handler of this exception has returned.
    Left(u16),
    /// The trace begins or ends here.
    Mark,
}

/// Takes the events, in their order.
pub trait TraceSink {
    /// One event.
    fn take(&mut self, event: TraceEvent);
}

/// Gives everything in the file to the sink, a mark before it and one behind it.
pub(crate) fn read_file(path: &Path, sink: &mut impl TraceSink) -> Result<(), EmulatorError> {
    let file = File::open(path).map_err(EmulatorError::io("opening the trace"))?;
    sink.take(TraceEvent::Mark);
    read(BufReader::with_capacity(1 << 16, file), sink)?;
    sink.take(TraceEvent::Mark);
    Ok(())
}

fn read(mut input: impl Read, sink: &mut impl TraceSink) -> Result<(), EmulatorError> {
    while let Some(word) = next(&mut input)? {
        let exception = (word >> NUMBER) as u16;
        let event = match word & ((1 << NUMBER) - 1) {
            _ if word & 1 == 0 => TraceEvent::Instruction(word),
            ACCESS => {
                TraceEvent::Access(next(&mut input)?.ok_or_else(|| broken("it ends in the middle of an access"))?)
            }
            ENTERED => TraceEvent::Entered(exception),
            LEFT => TraceEvent::Left(exception),
            _ => return Err(broken(&format!("{word:#x} means nothing"))),
        };
        sink.take(event);
    }
    Ok(())
}

/// The next word, if there is one.
fn next(input: &mut impl Read) -> Result<Option<u32>, EmulatorError> {
    let mut bytes = [0; 4];
    match input.read_exact(&mut bytes) {
        Ok(()) => Ok(Some(u32::from_le_bytes(bytes))),
        Err(error) if error.kind() == ErrorKind::UnexpectedEof => Ok(None),
        Err(error) => Err(EmulatorError::io("reading the trace")(error)),
    }
}

fn broken(what: &str) -> EmulatorError {
    EmulatorError::Guest(format!("its trace is broken: {what}; build it and the emulator from the same sources"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use TraceEvent::{Access, Entered, Instruction, Left};

    #[derive(Default)]
    struct Kept(Vec<TraceEvent>);

    impl TraceSink for Kept {
        fn take(&mut self, event: TraceEvent) {
            self.0.push(event);
        }
    }

    fn events(words: &[u32]) -> Result<Vec<TraceEvent>, String> {
        let bytes: Vec<u8> = words.iter().flat_map(|word| word.to_le_bytes()).collect();
        let mut kept = Kept::default();
        read(&*bytes, &mut kept).map(|()| kept.0).map_err(|error| error.to_string())
    }

    #[test]
    fn words_are_instructions_accesses_and_exceptions() {
        let words = [0x0800_5100, ACCESS, 0x4002_3801, ENTERED | 79 << NUMBER, 0x0800_40f4, LEFT | 79 << NUMBER];
        let expected = [Instruction(0x0800_5100), Access(0x4002_3801), Entered(79), Instruction(0x0800_40f4), Left(79)];
        assert_eq!(events(&words).unwrap(), expected);
    }

    #[test]
    fn a_trace_that_means_nothing_is_refused() {
        assert!(events(&[0x0800_5100, 7]).unwrap_err().contains("0x7 means nothing"));
        assert!(events(&[ACCESS]).unwrap_err().contains("in the middle of an access"));
    }
}
