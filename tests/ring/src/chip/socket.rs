//! A chip for foreign software: its registers and RAM over a line protocol.
//!
//! One command a line, one answer a line. Register and RAM words are hexadecimal, counts and times decimal.
//!
//! | command | answer | |
//! |---|---|---|
//! | `r 0b` | `0002` | read register 00 to 2a |
//! | `w 0a 0001` | `ok` | write a register |
//! | `R 012` | `5001` | read RAM word 000 to 7ff |
//! | `W 012 5001` | `ok` | write a RAM word |
//! | `cycles 5` | `ok` | let the ring run for 5 cycles |
//! | `time` | `2000000` | simulated time in nanoseconds |
//!
//! A line that is no such command is answered by one line `error: ...` and changes nothing. No time passes but by
//! `cycles`.

use std::io::{self, BufRead, BufReader, Read, Write};
use std::os::unix::net::UnixListener;
use std::path::Path;

use thiserror::Error;

use super::SharedChip;
use crate::time::{Nanoseconds, SharedClock};

/// Last control register.
const LAST_REGISTER: u16 = 0x2A;
/// Last RAM word.
const LAST_RAM_WORD: u16 = 0x7FF;
/// The longest run that one command may ask for: more than a day of 65 ms cycles would only be a typing error.
const MOST_CYCLES: u32 = 1_000_000;
/// What passes for a cycle while the chip has none.
const CYCLE_WITHOUT_TSCYC: Nanoseconds = Nanoseconds::from_millis(1);
/// A longer line is no command; its rest is read and dropped.
const LONGEST_LINE: u64 = 256;

/// The world behind the socket: a chip in master use and the ring that it drives.
pub trait ChipServer {
    /// Reads control register 0 to 2AH.
    fn read_register(&mut self, word: u16) -> u16;
    /// Writes control register 0 to 2AH.
    fn write_register(&mut self, word: u16, value: u16);
    /// Reads RAM word 0 to 7FFH.
    fn read_ram(&mut self, word: u16) -> u16;
    /// Writes RAM word 0 to 7FFH.
    fn write_ram(&mut self, word: u16, value: u16);
    /// Lets simulated time pass: so many cycles of the master, or of 1 ms while it has no cycle time.
    fn run_cycles(&mut self, cycles: u32);
    /// Simulated time.
    fn time(&self) -> Nanoseconds;
}

/// A chip whose world is moved on by a function that lets everything happen up to a given time and sets the clock to it.
pub struct ServedChip<A> {
    chip: SharedChip,
    clock: SharedClock,
    advance: A,
}

impl<A: FnMut(Nanoseconds)> ServedChip<A> {
    /// Serves `chip`; `advance` must leave `clock` at the time that it is given.
    pub fn new(chip: SharedChip, clock: SharedClock, advance: A) -> Self {
        Self { chip, clock, advance }
    }
}

impl<A: FnMut(Nanoseconds)> ChipServer for ServedChip<A> {
    fn read_register(&mut self, word: u16) -> u16 {
        self.chip.borrow_mut().read_register(self.clock.get(), word)
    }

    fn write_register(&mut self, word: u16, value: u16) {
        self.chip.borrow_mut().write_register(self.clock.get(), word, value);
    }

    fn read_ram(&mut self, word: u16) -> u16 {
        self.chip.borrow_mut().read_ram(self.clock.get(), word)
    }

    fn write_ram(&mut self, word: u16, value: u16) {
        self.chip.borrow_mut().write_ram(self.clock.get(), word, value);
    }

    /// Each cycle begins with an edge at CYC_CLK, so that a master that has not written 03H sends its MSTs as well: drivers
    /// look for a closed ring before they do.
    fn run_cycles(&mut self, cycles: u32) {
        for _ in 0..cycles {
            let now = self.clock.get();
            self.chip.borrow_mut().on_cycle_clock(now);
            let cycle = self.chip.borrow().cycle_time().unwrap_or(CYCLE_WITHOUT_TSCYC);
            (self.advance)(now + cycle);
        }
    }

    fn time(&self) -> Nanoseconds {
        self.clock.get()
    }
}

/// Why a line is no command.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum CommandError {
    /// The first word is none of the commands.
    #[error("unknown command `{0}`, expected r, w, R, W, cycles or time")]
    Unknown(String),
    /// Not as many arguments as the command has.
    #[error("`{command}` takes {expected} arguments, got {actual}")]
    Arguments {
        /// The command.
        command: String,
        /// How many it takes.
        expected: usize,
        /// How many there were.
        actual: usize,
    },
    /// An argument is no hexadecimal word.
    #[error("`{0}` is no hexadecimal word of 1 to 4 digits")]
    Hexadecimal(String),
    /// An address beyond the last one.
    #[error("address {address:x} is out of range, the last is {last:x}")]
    Address {
        /// The address.
        address: u16,
        /// The last there is.
        last: u16,
    },
    /// The argument of `cycles` is no count, or too large.
    #[error("`{0}` is no number of cycles from 0 to {MOST_CYCLES}")]
    Cycles(String),
    /// The line is not text, or too long.
    #[error("the line is no text of at most {LONGEST_LINE} bytes")]
    Line,
}

/// Answers commands until the input ends. Empty lines are passed over.
///
/// # Errors
///
/// Those of `input` and `output`; a wrong command is answered, not returned.
pub fn serve<S: ChipServer + ?Sized>(
    input: &mut impl BufRead,
    output: &mut impl Write,
    server: &mut S,
) -> io::Result<()> {
    loop {
        let answer = match read_line(input)? {
            None => return Ok(()),
            Some(Ok(line)) if line.trim().is_empty() => continue,
            Some(line) => line.and_then(|line| execute(&line, server)),
        };
        match answer {
            Ok(answer) => writeln!(output, "{answer}")?,
            Err(error) => writeln!(output, "error: {error}")?,
        }
        output.flush()?;
    }
}

/// Listens at `path` and serves one client after the other, for ever. A socket file that nobody listens at any more is
/// replaced.
///
/// # Errors
///
/// When the socket cannot be bound, or accepts no more; a client that breaks off is no error.
pub fn listen<S: ChipServer + ?Sized>(path: &Path, server: &mut S) -> io::Result<()> {
    let listener = bind(path)?;
    loop {
        serve_next(&listener, server)?;
    }
}

/// Binds a socket at `path`.
///
/// # Errors
///
/// When something else is there, a listening socket included, or the folder is not writable.
pub fn bind(path: &Path) -> io::Result<UnixListener> {
    match UnixListener::bind(path) {
        Err(error) if error.kind() == io::ErrorKind::AddrInUse && is_abandoned_socket(path) => {
            std::fs::remove_file(path)?;
            UnixListener::bind(path)
        }
        bound => bound,
    }
}

/// Waits for one client and serves it until it leaves.
///
/// # Errors
///
/// When no client can be accepted any more.
pub fn serve_next<S: ChipServer + ?Sized>(listener: &UnixListener, server: &mut S) -> io::Result<()> {
    let (stream, _) = listener.accept()?;
    let mut output = stream.try_clone()?;
    // The client may go at any time; the next one finds the chip as this one left it.
    let _ = serve(&mut BufReader::new(stream), &mut output, server);
    Ok(())
}

fn is_abandoned_socket(path: &Path) -> bool {
    use std::os::unix::fs::FileTypeExt;
    let is_socket = std::fs::symlink_metadata(path).is_ok_and(|file| file.file_type().is_socket());
    is_socket && std::os::unix::net::UnixStream::connect(path).is_err()
}

/// One line without its end, `None` at the end of the input.
fn read_line(input: &mut impl BufRead) -> io::Result<Option<Result<String, CommandError>>> {
    let mut line = Vec::new();
    if Read::take(&mut *input, LONGEST_LINE).read_until(b'\n', &mut line)? == 0 {
        return Ok(None);
    }
    if line.last() != Some(&b'\n') && line.len() as u64 == LONGEST_LINE {
        input.skip_until(b'\n')?;
        return Ok(Some(Err(CommandError::Line)));
    }
    Ok(Some(String::from_utf8(line).map_err(|_| CommandError::Line)))
}

fn execute<S: ChipServer + ?Sized>(line: &str, server: &mut S) -> Result<String, CommandError> {
    let mut words = line.split_ascii_whitespace();
    let command = words.next().unwrap_or_default();
    let arguments: Vec<&str> = words.collect();
    let arguments = arguments.as_slice();
    let wrong_number =
        |expected| Err(CommandError::Arguments { command: command.to_owned(), expected, actual: arguments.len() });
    let ok = Ok("ok".to_owned());
    match (command, arguments) {
        ("r", [register]) => {
            let register = address(register, LAST_REGISTER)?;
            Ok(format!("{:04x}", server.read_register(register)))
        }
        ("R", [word]) => {
            let word = address(word, LAST_RAM_WORD)?;
            Ok(format!("{:04x}", server.read_ram(word)))
        }
        ("w", [register, value]) => {
            server.write_register(address(register, LAST_REGISTER)?, hexadecimal(value)?);
            ok
        }
        ("W", [word, value]) => {
            server.write_ram(address(word, LAST_RAM_WORD)?, hexadecimal(value)?);
            ok
        }
        ("cycles", [count]) => {
            let cycles = count.parse().ok().filter(|&cycles| cycles <= MOST_CYCLES);
            server.run_cycles(cycles.ok_or_else(|| CommandError::Cycles((*count).to_owned()))?);
            ok
        }
        ("time", []) => Ok(server.time().0.to_string()),
        ("r" | "R" | "cycles", _) => wrong_number(1),
        ("w" | "W", _) => wrong_number(2),
        ("time", _) => wrong_number(0),
        _ => Err(CommandError::Unknown(command.to_owned())),
    }
}

fn hexadecimal(text: &str) -> Result<u16, CommandError> {
    let digits = (1..=4).contains(&text.len()) && text.bytes().all(|digit| digit.is_ascii_hexdigit());
    digits
        .then(|| u16::from_str_radix(text, 16).ok())
        .flatten()
        .ok_or_else(|| CommandError::Hexadecimal(text.to_owned()))
}

fn address(text: &str, last: u16) -> Result<u16, CommandError> {
    let address = hexadecimal(text)?;
    if address <= last { Ok(address) } else { Err(CommandError::Address { address, last }) }
}
