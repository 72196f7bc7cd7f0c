//! Every instruction that the product executes, as QEMU logs them: the source of exact instruction counts.
//!
//! QEMU executes one instruction a translation block (`singlestep`) and logs each block's address (`log exec`) and each exception
//! (`log int`). The log runs into a FIFO that a thread of ours empties, so nothing is stored. Of the addresses only the product's are logged:
//! a trapped register access counts as the one instruction it is, whatever the shim does for it.
//!
//! Tracing costs microseconds an instruction, so it is switched on late, over QEMU's monitor. When exactly QEMU obeys depends on the
//! host; [`Tracer::mark`] therefore writes a line of our own into the FIFO while the guest waits for an answer, and what lies between two marks
//! is the same in every run.

use std::ffi::OsString;
use std::fs::{File, OpenOptions};
use std::io::{BufRead, BufReader, Write};
use std::ops::Range;
use std::os::unix::net::UnixStream;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;

use rustix::fs::{CWD, FileType, Mode, mknodat};
use tempfile::TempDir;

use crate::EmulatorError;

/// Something that the processor did.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TraceEvent {
    /// An instruction of the product at this address was executed.
    Instruction(u32),
    /// The last instruction accessed a peripheral or the external bus at this address.
    Access(u32),
    /// The handler of this exception begins (16 + number of the interrupt); the shim's own among them.
    Entered(u16),
    /// The handler of this exception has returned.
    Left(u16),
    /// [`Tracer::mark`] was called here.
    Mark,
}

/// Takes the events, in their order, in a thread of its own.
pub trait TraceSink: Send + 'static {
    /// One event.
    fn take(&mut self, event: TraceEvent);
}

/// File names in the tracer's folder.
const LOG: &str = "log";
const MONITOR: &str = "monitor";
/// Lines of our own in the log.
const MARK: &[u8] = b"tracer: mark";
const END: &[u8] = b"tracer: end";

/// Listens to the log of one QEMU.
#[derive(Debug)]
pub struct Tracer<S> {
    directory: TempDir,
    code: Range<u32>,
    /// Our own end of the FIFO: for the marks, and so that opening it never waits.
    log: File,
    on: Arc<AtomicBool>,
    reader: JoinHandle<std::io::Result<S>>,
    monitor: Option<UnixStream>,
}

impl<S: TraceSink> Tracer<S> {
    /// Makes the FIFO and starts to listen; `code` is where the product's instructions are.
    ///
    /// # Errors
    /// The FIFO cannot be made.
    pub fn new(code: Range<u32>, mut sink: S) -> Result<Self, EmulatorError> {
        let directory = TempDir::new().map_err(EmulatorError::io("temporary directory"))?;
        let path = directory.path().join(LOG);
        mknodat(CWD, &path, FileType::Fifo, Mode::RUSR | Mode::WUSR, 0)
            .map_err(|error| EmulatorError::Io { what: "creating the FIFO of the trace", source: error.into() })?;
        let open =
            || OpenOptions::new().read(true).write(true).open(&path).map_err(EmulatorError::io("opening the trace"));
        let (log, input) = (open()?, open()?);
        let on = Arc::new(AtomicBool::new(false));
        let seen = Arc::clone(&on);
        let reader = std::thread::spawn(move || {
            read(BufReader::with_capacity(1 << 16, input), &seen, &mut sink)?;
            Ok(sink)
        });
        Ok(Self { directory, code, log, on, reader, monitor: None })
    }

    /// What QEMU must be started with, for [`crate::GuestConfiguration::arguments`].
    #[must_use]
    pub fn arguments(&self) -> Vec<OsString> {
        let mut socket = OsString::from("socket,id=tracer,server=on,wait=off,path=");
        socket.push(self.path(MONITOR));
        let filter = format!("{:#x}..{:#x}", self.code.start, self.code.end - 1);
        vec!["-chardev".into(), socket, "-mon".into(), "chardev=tracer".into(), "-dfilter".into(), filter.into()]
    }

    fn path(&self, name: &str) -> std::path::PathBuf {
        self.directory.path().join(name)
    }

    /// Asks QEMU to begin; it does so as soon as the guest has run on for a while, see [`Tracer::is_on`].
    ///
    /// # Errors
    /// QEMU was not started with [`Tracer::arguments`].
    pub fn switch_on(&mut self) -> Result<(), EmulatorError> {
        let mut monitor =
            UnixStream::connect(self.path(MONITOR)).map_err(EmulatorError::io("connecting to the monitor"))?;
        monitor.write_all(&commands(&self.path(LOG))).map_err(EmulatorError::io("writing to the monitor"))?;
        // Kept open: QEMU drops what it has not read yet of a connection that ends.
        self.monitor = Some(monitor);
        Ok(())
    }

    /// Has QEMU begun?
    #[must_use]
    pub fn is_on(&self) -> bool {
        self.on.load(Ordering::Relaxed)
    }

    /// Marks this instant in the stream; to be called only while the guest waits for an answer, which is whenever it is not in
    /// [`crate::Guest::run`].
    ///
    /// # Errors
    /// The FIFO cannot be written.
    pub fn mark(&mut self) -> Result<(), EmulatorError> {
        self.write(MARK)
    }

    /// Ends the trace once all that was logged has been taken, and gives the sink back. The guest cannot go on afterwards.
    ///
    /// # Errors
    /// The log could not be read.
    pub fn finish(mut self) -> Result<S, EmulatorError> {
        self.write(END)?;
        match self.reader.join() {
            Ok(sink) => sink.map_err(EmulatorError::io("reading the trace")),
            Err(panic) => std::panic::resume_unwind(panic),
        }
    }

    /// A line of its own, even behind a QEMU that was killed in the middle of one.
    fn write(&mut self, line: &[u8]) -> Result<(), EmulatorError> {
        let whole = [b"\n", line, b"\n"].concat();
        self.log.write_all(&whole).map_err(EmulatorError::io("writing a mark into the trace"))
    }
}

/// The monitor's commands; `one-insn-per-tb` is the later name of `singlestep`, and each version rejects the other's.
fn commands(log: &Path) -> Vec<u8> {
    let mut commands = b"singlestep on\none-insn-per-tb on\nlogfile ".to_vec();
    commands.extend_from_slice(log.as_os_str().as_encoded_bytes());
    commands.extend_from_slice(b"\nlog exec,nochain,int\n");
    commands
}

fn read(mut input: impl BufRead, on: &AtomicBool, sink: &mut impl TraceSink) -> std::io::Result<()> {
    let mut decoder = Decoder::default();
    let mut line = Vec::new();
    loop {
        line.clear();
        if input.read_until(b'\n', &mut line)? == 0 || line.trim_ascii_end() == END {
            decoder.flush(sink);
            return Ok(());
        }
        on.fetch_or(line.starts_with(b"Trace"), Ordering::Relaxed);
        decoder.take(line.trim_ascii_end(), sink);
    }
}

/// From lines to events.
#[derive(Debug, Default)]
struct Decoder {
    /// The last instruction logged: it is known to be executed only when no retraction follows.
    last: Option<u32>,
}

impl Decoder {
    fn take(&mut self, line: &[u8], sink: &mut impl TraceSink) {
        if line.starts_with(b"Trace ") {
            // Trace 0: 0x7f815c031fcc [00800409/08005100/00000010/ff020201] TIM6_DAC: the second is the address.
            self.flush(sink);
            self.last = line.splitn(3, |byte| *byte == b'/').nth(1).and_then(hexadecimal);
        } else if line.starts_with(b"Stopped execution") || line.starts_with(b"cpu_io_recompile") {
            // An exception came before it, or it is executed anew as a block that may access a device: logged again then.
            self.last = None;
        } else if line.starts_with(b"...at fault address 0x") {
            self.flush(sink);
            if let Some(address) = line.rsplit(|byte| *byte == b'x').next().and_then(hexadecimal) {
                sink.take(TraceEvent::Access(address));
            }
        } else if line.starts_with(b"...taking pending ") {
            self.flush(sink);
            if let Some(number) = decimal_at_the_end(line) {
                sink.take(TraceEvent::Entered(number));
            }
        } else if line.starts_with(b"Exception return:") {
            self.flush(sink);
            if let Some(number) = decimal_at_the_end(line) {
                sink.take(TraceEvent::Left(number));
            }
        } else if line == MARK {
            self.flush(sink);
            sink.take(TraceEvent::Mark);
        }
    }

    fn flush(&mut self, sink: &mut impl TraceSink) {
        if let Some(address) = self.last.take() {
            sink.take(TraceEvent::Instruction(address));
        }
    }
}

fn hexadecimal(digits: &[u8]) -> Option<u32> {
    u32::from_str_radix(std::str::from_utf8(digits).ok()?, 16).ok()
}

fn decimal_at_the_end(line: &[u8]) -> Option<u16> {
    std::str::from_utf8(line.rsplit(|byte| *byte == b' ').next()?).ok()?.parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;
    use TraceEvent::{Access, Entered, Instruction, Left, Mark};

    #[derive(Default)]
    struct Kept(Vec<TraceEvent>);

    impl TraceSink for Kept {
        fn take(&mut self, event: TraceEvent) {
            self.0.push(event);
        }
    }

    fn events(log: &str) -> Vec<TraceEvent> {
        let mut kept = Kept::default();
        read(log.as_bytes(), &AtomicBool::new(false), &mut kept).unwrap();
        kept.0
    }

    #[test]
    fn a_trapped_access_is_one_instruction_and_the_shims_exception() {
        let log = "Trace 0: 0x7f81 [00800409/08005100/00000010/ff020201] TIM6_DAC\n\
                   Taking exception 4 [Data Abort] on CPU 0\n\
                   ...at fault address 0x40023800\n\
                   ...with CFSR.DACCVIOL and MMFAR 0x40023800\n\
                   ...taking pending nonsecure exception 3\n\
                   ...loading from element 3 of non-secure vector table at 0x2002000c\n\
                   Taking exception 8 [QEMU v7M exception exit] on CPU 0\n\
                   Exception return: magic PC fffffff9 previous exception 3\n\
                   ...successful exception return\n\
                   Trace 0: 0x7f82 [00800409/08005102/00000010/ff020201] TIM6_DAC\n";
        let expected = [Instruction(0x0800_5100), Access(0x4002_3800), Entered(3), Left(3), Instruction(0x0800_5102)];
        assert_eq!(events(log), expected);
    }

    #[test]
    fn an_instruction_that_was_stopped_or_executed_anew_counts_once() {
        let log = "Trace 0: 0x1 [0/080001b0/00000110/ff020201] Reset\n\
                   cpu_io_recompile: rewound execution of TB to 080001b0\n\
                   Trace 0: 0x2 [0/080001b0/00000110/ff038201] Reset\n\
                   Trace 0: 0x3 [0/080001b2/00000110/ff020201] Reset\n\
                   Stopped execution of TB chain before 0x3 [080001b2] Reset\n\
                   Taking exception 5 [IRQ] on CPU 0\n\
                   ...taking pending nonsecure exception 70\n\
                   Trace 0: 0x4 [0/080040f4/00000010/ff020201] TIM6_DAC\n";
        assert_eq!(events(log), [Instruction(0x0800_01b0), Entered(70), Instruction(0x0800_40f4)]);
    }

    #[test]
    fn a_mark_lies_behind_everything_logged_before_it_even_a_broken_line() {
        let log = "Trace 0: 0x1 [0/08000100/0/0] a\n\ntracer: mark\nTrace 0: 0x1 [0/08000102/0/0] a\nTrace 0: 0x\n\
                   tracer: end\nTrace 0: 0x1 [0/08000104/0/0] a\n";
        assert_eq!(events(log), [Instruction(0x0800_0100), Mark, Instruction(0x0800_0102)]);
    }

    #[test]
    fn the_tracer_gives_the_sink_back_with_everything_before_its_end() {
        let mut tracer = Tracer::new(0x0800_0000..0x080f_0000, Kept::default()).unwrap();
        assert!(!tracer.is_on());
        tracer.mark().unwrap();
        tracer.mark().unwrap();
        assert_eq!(tracer.finish().unwrap().0, [Mark, Mark]);
    }
}
