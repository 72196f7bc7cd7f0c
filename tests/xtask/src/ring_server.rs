//! A master's SERCON816 behind a Unix socket, so that foreign master software can drive our ring.
//!
//! One command a line, one answer a line:
//!
//! | command | answer | |
//! |---|---|---|
//! | `r 0b` | `0002` | reads register 0BH |
//! | `w 0a 0001` | `ok` | writes register 0AH |
//! | `R 012` | `5001` | reads RAM word 012H |
//! | `W 012 5001` | `ok` | writes RAM word 012H |
//! | `cycles 5` | `ok` | lets the ring run five cycles (decimal) |
//! | `time` | `10000000` | simulated time in nanoseconds (decimal) |
//!
//! Anything else is answered with `error` and the cause, and changes nothing.

use crate::Verdict;
use anyhow::{Context, Result, bail};
use std::io::{BufRead, BufReader, Write};
use std::os::unix::fs::FileTypeExt;
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::Path;

/// The last register, as the chip numbers its 16-bit words.
const LAST_REGISTER: u16 = 0x2A;
/// The last word of the dual-port RAM.
const LAST_RAM_WORD: u16 = 0x7FF;
/// Most cycles in one command: an hour of the longest cycle would be fewer.
const MOST_CYCLES: u32 = 1_000_000;

/// What the socket gives access to.
pub(crate) trait MasterSeat {
    /// Reads a register, 0 to 2AH.
    fn read_register(&mut self, word: u16) -> u16;
    /// Writes a register, 0 to 2AH.
    fn write_register(&mut self, word: u16, value: u16);
    /// Reads a RAM word, 0 to 7FFH.
    fn read_ram(&mut self, word: u16) -> u16;
    /// Writes a RAM word, 0 to 7FFH.
    fn write_ram(&mut self, word: u16, value: u16);
    /// Lets the ring run so many cycles.
    fn run_cycles(&mut self, cycles: u32) -> Result<()>;
    /// Simulated time in nanoseconds.
    fn time_nanoseconds(&self) -> u64;
}

/// Serves the chip of a ring with these drives until interrupted.
pub(crate) fn run(drives: &[u8], chip_socket: &Path) -> Result<Verdict> {
    refuse_doubles(drives)?;
    let mut seat = seat(drives)?;
    let listener = listen(chip_socket)?;
    eprintln!("ring with drives {drives:?}; the master's chip is served at {}", chip_socket.display());
    for client in listener.incoming() {
        let client = client.context("the socket broke")?;
        // A client that goes away in the middle of a line ends only its own visit.
        if let Err(error) = serve(&client, seat.as_mut()) {
            eprintln!("client left: {error:#}");
        }
    }
    Ok(Verdict::Passed)
}

/// The ring and its master's chip.
fn seat(_drives: &[u8]) -> Result<Box<dyn MasterSeat>> {
    bail!("the bench is not built yet")
}

fn refuse_doubles(drives: &[u8]) -> Result<()> {
    for (index, drive) in drives.iter().enumerate() {
        if drives[..index].contains(drive) {
            bail!("two drives have the address {drive}; give each address of --drives once");
        }
    }
    Ok(())
}

/// Binds the socket; one that a killed server left behind is taken over.
fn listen(path: &Path) -> Result<UnixListener> {
    let left_behind = std::fs::symlink_metadata(path).is_ok_and(|metadata| metadata.file_type().is_socket())
        && UnixStream::connect(path).is_err();
    if left_behind {
        std::fs::remove_file(path).with_context(|| format!("cannot remove the old socket {}", path.display()))?;
    }
    UnixListener::bind(path).with_context(|| {
        format!("cannot serve at {}; give --chip-socket a path that does not exist yet", path.display())
    })
}

fn serve(client: &UnixStream, seat: &mut dyn MasterSeat) -> Result<()> {
    let mut writer = client;
    for line in BufReader::new(client).lines() {
        let answer = answer(seat, &line?).unwrap_or_else(|error| format!("error {error:#}"));
        writer.write_all(format!("{answer}\n").as_bytes())?;
    }
    Ok(())
}

fn answer(seat: &mut dyn MasterSeat, line: &str) -> Result<String> {
    let words: Vec<&str> = line.split_whitespace().collect();
    match words[..] {
        ["r", register] => Ok(format!("{:04x}", seat.read_register(number(register, LAST_REGISTER)?))),
        ["w", register, value] => {
            seat.write_register(number(register, LAST_REGISTER)?, number(value, u16::MAX)?);
            Ok("ok".to_owned())
        }
        ["R", word] => Ok(format!("{:04x}", seat.read_ram(number(word, LAST_RAM_WORD)?))),
        ["W", word, value] => {
            seat.write_ram(number(word, LAST_RAM_WORD)?, number(value, u16::MAX)?);
            Ok("ok".to_owned())
        }
        ["cycles", count] => {
            let cycles = count.parse().ok().filter(|cycles| (1..=MOST_CYCLES).contains(cycles));
            seat.run_cycles(cycles.with_context(|| format!("{count} is no count of cycles from 1 to {MOST_CYCLES}"))?)?;
            Ok("ok".to_owned())
        }
        ["time"] => Ok(seat.time_nanoseconds().to_string()),
        _ => bail!("r REGISTER, w REGISTER VALUE, R WORD, W WORD VALUE, cycles COUNT or time expected"),
    }
}

fn number(text: &str, last: u16) -> Result<u16> {
    u16::from_str_radix(text, 16)
        .ok()
        .filter(|number| *number <= last)
        .with_context(|| format!("{text} is no hexadecimal number up to {last:x}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A chip that only stores, and counts cycles of 2 ms.
    struct Storage {
        registers: [u16; 0x2B],
        ram: Vec<u16>,
        cycles: u64,
    }

    impl Storage {
        fn new() -> Self {
            Self { registers: [0; 0x2B], ram: vec![0; 0x800], cycles: 0 }
        }
    }

    impl MasterSeat for Storage {
        fn read_register(&mut self, word: u16) -> u16 {
            self.registers[usize::from(word)]
        }
        fn write_register(&mut self, word: u16, value: u16) {
            self.registers[usize::from(word)] = value;
        }
        fn read_ram(&mut self, word: u16) -> u16 {
            self.ram[usize::from(word)]
        }
        fn write_ram(&mut self, word: u16, value: u16) {
            self.ram[usize::from(word)] = value;
        }
        fn run_cycles(&mut self, cycles: u32) -> Result<()> {
            self.cycles += u64::from(cycles);
            Ok(())
        }
        fn time_nanoseconds(&self) -> u64 {
            self.cycles * 2_000_000
        }
    }

    fn say(seat: &mut Storage, line: &str) -> String {
        answer(seat, line).unwrap_or_else(|error| format!("error {error:#}"))
    }

    #[test]
    fn registers_and_ram_are_different_rooms() {
        let mut seat = Storage::new();
        assert_eq!(say(&mut seat, "w 0a 0001"), "ok");
        assert_eq!(say(&mut seat, "W 00a 5001"), "ok");
        assert_eq!(say(&mut seat, "r 0a"), "0001");
        assert_eq!(say(&mut seat, "R 00a"), "5001");
        assert_eq!(say(&mut seat, "R 7ff"), "0000");
    }

    #[test]
    fn cycles_let_time_pass_and_nothing_else_does() {
        let mut seat = Storage::new();
        assert_eq!(say(&mut seat, "time"), "0");
        assert_eq!(say(&mut seat, "r 0b"), "0000");
        assert_eq!(say(&mut seat, "time"), "0");
        assert_eq!(say(&mut seat, "cycles 5"), "ok");
        assert_eq!(say(&mut seat, "time"), "10000000");
    }

    #[test]
    fn what_is_not_understood_changes_nothing() {
        let mut seat = Storage::new();
        for line in [
            "",
            "r",
            "r 2b",
            "w 0a",
            "w 0a 10000",
            "R 800",
            "W 800 1",
            "cycles",
            "cycles 0",
            "cycles -1",
            "cycles 1000001",
            "r 0a 1",
            "x",
        ] {
            let answer = say(&mut seat, line);
            assert!(answer.starts_with("error ") && !answer.contains('\n'), "{line:?} was answered {answer:?}");
        }
        assert_eq!(seat.cycles, 0);
        assert!(seat.registers.iter().chain(&seat.ram).all(|word| *word == 0));
    }

    #[test]
    fn a_client_gets_one_line_for_each_line() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("chip");
        let listener = listen(&path).unwrap();
        let client = std::thread::spawn({
            let path = path.clone();
            move || {
                let stream = UnixStream::connect(path).unwrap();
                (&stream).write_all(b"w 0a 0004\nr 0a\nnonsense\n").unwrap();
                stream.shutdown(std::net::Shutdown::Write).unwrap();
                BufReader::new(&stream).lines().map(Result::unwrap).collect::<Vec<_>>()
            }
        });
        serve(&listener.accept().unwrap().0, &mut Storage::new()).unwrap();
        let answers = client.join().unwrap();
        assert_eq!(answers[..2], ["ok", "0004"]);
        assert!(answers[2].starts_with("error "));
        assert_eq!(answers.len(), 3);
    }

    #[test]
    fn a_socket_left_behind_is_taken_over_but_a_living_one_is_not() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("chip");
        let first = listen(&path).unwrap();
        assert!(listen(&path).unwrap_err().to_string().contains("does not exist yet"));
        drop(first);
        listen(&path).unwrap();
    }

    #[test]
    fn a_file_in_the_place_of_the_socket_stays() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("precious");
        std::fs::write(&path, "text").unwrap();
        assert!(listen(&path).is_err());
        assert_eq!(std::fs::read_to_string(&path).unwrap(), "text");
    }

    #[test]
    fn an_address_may_stand_only_once() {
        assert!(refuse_doubles(&[1, 2, 3]).is_ok());
        assert!(refuse_doubles(&[1, 2, 1]).unwrap_err().to_string().contains("address 1"));
    }
}
