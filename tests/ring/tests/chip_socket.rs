//! The chip socket's line protocol.

use std::io::{BufRead, BufReader, Cursor, Write};
use std::os::unix::net::UnixStream;

use ring::Nanoseconds;
use ring::chip::socket::{ChipServer, bind, serve, serve_next};
use ring::chip::{Alternatives, Chip};

/// A chip alone, without a ring.
struct Lone {
    chip: Chip,
    now: Nanoseconds,
}

impl Lone {
    fn new() -> Self {
        Self { chip: Chip::new(Alternatives::default(), 1), now: Nanoseconds::ZERO }
    }
}

impl ChipServer for Lone {
    fn read_register(&mut self, word: u16) -> u16 {
        self.chip.read_register(self.now, word)
    }
    fn write_register(&mut self, word: u16, value: u16) {
        self.chip.write_register(self.now, word, value);
    }
    fn read_ram(&mut self, word: u16) -> u16 {
        self.chip.read_ram(self.now, word)
    }
    fn write_ram(&mut self, word: u16, value: u16) {
        self.chip.write_ram(self.now, word, value);
    }
    fn run_cycles(&mut self, cycles: u32) {
        let cycle = self.chip.cycle_time().unwrap_or(Nanoseconds::from_millis(1));
        self.now += Nanoseconds(u64::from(cycles) * cycle.0);
    }
    fn time(&self) -> Nanoseconds {
        self.now
    }
}

fn converse(input: &[u8]) -> Vec<String> {
    let mut output = Vec::new();
    serve(&mut Cursor::new(input), &mut output, &mut Lone::new()).unwrap();
    String::from_utf8(output).unwrap().lines().map(str::to_owned).collect()
}

#[test]
fn registers_and_ram_words_read_back() {
    let answers = converse(b"r 00\nw 0a 0001\nr 0a\nR 012\nW 012 5001\nR 12\nW 7ff BEEF\nR 7FF\n");
    assert_eq!(answers[0], "0010");
    assert_eq!(answers[1..3], ["ok", "0001"]);
    assert_eq!(answers[4..], ["ok", "5001", "ok", "beef"]);
}

#[test]
fn cycles_are_those_of_tscyc_and_time_is_in_nanoseconds() {
    let answers = converse(b"time\ncycles 2\ntime\nw 0e 051f\nw 0f 07d0\ncycles 10\ntime\n");
    assert_eq!(answers, ["0", "ok", "2000000", "ok", "ok", "ok", "22000000"]);
}

#[test]
fn a_wrong_line_is_answered_by_one_error_line_and_changes_nothing() {
    for line in [
        "x 00",
        "r",
        "r 00 00",
        "w 0a",
        "w 0a 0001 2",
        "r 2b",
        "R 800",
        "W 800 0",
        "w 2b 0",
        "r 0g",
        "r -1",
        "r +1",
        "w 0a 12345",
        "cycles",
        "cycles x",
        "cycles -1",
        "cycles 4294967296",
        "time 1",
        "R",
        "read 00",
        "\u{e9}",
    ] {
        let answers = converse(format!("w 0a 0003\n{line}\nr 0a\ntime\n").as_bytes());
        assert_eq!(answers.len(), 4, "{line}: {answers:?}");
        assert!(answers[1].starts_with("error: "), "{line}: {answers:?}");
        assert_eq!(answers[2..], ["0003", "0"], "{line}");
    }
    assert_eq!(converse(b"r 2b\n"), ["error: address 2b is out of range, the last is 2a"]);
    assert_eq!(converse(b"peek 1\n"), ["error: unknown command `peek`, expected r, w, R, W, cycles or time"]);
}

#[test]
fn long_and_binary_lines_are_errors_and_the_next_line_is_served() {
    let mut input = vec![b'r'; 100_000];
    input.extend(b"\nr 00\n\xFF\xFE\nr 00\n\n\r\nr 00");
    let answers = converse(&input);
    let error = "error: the line is no text of at most 256 bytes";
    assert_eq!(answers, [error, "0010", error, "0010", "0010"]);
}

#[test]
fn a_socket_serves_one_client_after_the_other_on_the_same_chip() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("chip");
    let listener = bind(&path).unwrap();
    let client_path = path.clone();
    let clients = std::thread::spawn(move || {
        let mut answers = Vec::new();
        for command in ["w 0a 0002\n", "r 0a\n"] {
            let mut stream = UnixStream::connect(&client_path).unwrap();
            stream.write_all(command.as_bytes()).unwrap();
            let mut answer = String::new();
            BufReader::new(stream).read_line(&mut answer).unwrap();
            answers.push(answer);
        }
        answers
    });
    let mut server = Lone::new();
    serve_next(&listener, &mut server).unwrap();
    serve_next(&listener, &mut server).unwrap();
    assert_eq!(clients.join().unwrap(), ["ok\n", "0002\n"]);

    assert!(bind(&path).is_err(), "somebody listens there");
    drop(listener);
    assert!(bind(&path).is_ok(), "an abandoned socket is replaced");
    std::fs::remove_file(&path).unwrap();
    std::fs::write(&path, "a file").unwrap();
    assert!(bind(&path).is_err(), "a file of somebody is not");
    assert_eq!(std::fs::read_to_string(&path).unwrap(), "a file");
}
