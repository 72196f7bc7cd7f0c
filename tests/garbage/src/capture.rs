//! Recordings, line levels, telegrams, and a chip that receives them.

use std::fmt::Write;
use std::sync::LazyLock;

use ring::Nanoseconds;
use ring::capture::Recording;
use ring::chip::{Alternatives, Chip};
use ring::wire::{self, BROADCAST, LineSignal};
use sercos::telegram::{self, Mst, RecordPacket, RecordRepr};

use crate::bytes::{Bytes, chosen};

/// Whatever stands in a file or comes over the fibre:
///
/// * nothing panics and nothing hangs;
/// * a recording that is read is written and read again as the same;
/// * bytes that are encoded decode to themselves, and so do bits that were decoded;
/// * the views of a telegram read what was written through them;
/// * a chip, whatever is written into it and sent to it, goes on in time.
///
/// # Panics
/// When one of these does not hold.
pub fn capture(bytes: &[u8]) {
    let mut bytes = Bytes::new(bytes);
    match bytes.byte().map(|kind| kind % 5) {
        None => {}
        Some(0) => text(bytes.rest()),
        Some(1) => lines(&mut bytes),
        Some(2) => wire_of(bytes.rest()),
        Some(3) => views(&mut bytes),
        Some(_) => chip(&mut bytes),
    }
}

/// A file as it is.
fn text(bytes: &[u8]) {
    if let Ok(text) = std::str::from_utf8(bytes) {
        survives(text);
    }
}

/// What is a recording once stays one.
fn survives(text: &str) -> bool {
    let Ok(recording) = Recording::parse(text) else { return false };
    let again = Recording::parse(&recording.to_text());
    assert_eq!(again.ok().as_ref(), Some(&recording));
    true
}

/// Lines that are right in themselves, in any order and shape; then one of their bytes is another.
fn lines(bytes: &mut Bytes<'_>) {
    let Some(damage) = bytes.word() else { return };
    let mut text = String::new();
    let mut cycle: u64 = 0;
    while let Some(shape) = bytes.byte() {
        let (kind, telegram) = match shape % 4 {
            0 | 1 => ("MST", vec![BROADCAST, shape >> 4]),
            2 => ("MDT", [&[shape >> 2], bytes.up_to(4)].concat()),
            _ => ("MDT", [&[BROADCAST], bytes.up_to(usize::from(shape >> 3))].concat()),
        };
        let expected = cycle.saturating_sub(u64::from(kind == "MDT"));
        let number = if shape & 8 == 0 { expected } else { u64::from(shape) };
        cycle += u64::from(kind == "MST");
        let sequence = wire::check_sequence(&telegram).to_le_bytes();
        let levels = LineSignal::of_telegram(&telegram).to_packed(2);
        let _ =
            writeln!(text, "{number}\t{kind}\t{}\t{}\t{}", hex(&telegram, " "), hex(&sequence, " "), hex(&levels, ""));
    }
    survives(&text);
    if damage != 0 && !text.is_empty() {
        let place = usize::from(damage) % text.len();
        let other = chosen(&["\t", " ", "\n", "0", "f", "#", "-", "M", "\0", "", "µ"], usize::from(damage) / 7);
        // Every line is ASCII, so that every place is between two characters.
        text.replace_range(place..=place, other);
        survives(&text);
    }
}

fn hex(bytes: &[u8], between: &str) -> String {
    let mut text = String::new();
    for (number, byte) in bytes.iter().enumerate() {
        let between = if number == 0 { "" } else { between };
        let _ = write!(text, "{between}{byte:02x}");
    }
    text
}

/// The bytes once as a telegram, once as line bits, once as levels.
fn wire_of(bytes: &[u8]) {
    let bits: Vec<bool> = bytes.iter().flat_map(|byte| (0..8).map(move |bit| byte >> bit & 1 == 1)).collect();
    if let Ok(telegram) = wire::decode(&bits) {
        assert_eq!(wire::decode(&wire::encode(&telegram)).as_ref(), Ok(&telegram));
    }
    let levels = LineSignal::from_packed(bytes);
    if let Ok(telegram) = levels.telegram() {
        assert_eq!(LineSignal::of_telegram(telegram).telegram(), Ok(telegram));
    }
    if bytes.len() >= 2 {
        let signal = LineSignal::of_telegram(bytes);
        assert_eq!(signal.telegram(), Ok(bytes));
        let flipped = usize::from(bytes[0]) % signal.len();
        let damaged = signal.with_flipped_bit(flipped).expect("the bit is in the telegram");
        assert_ne!(damaged.telegram(), Ok(bytes), "bit {flipped}");
        let repacked = LineSignal::from_packed(&signal.to_packed(2));
        assert_eq!(repacked.telegram(), Ok(bytes));
    }
}

fn views(bytes: &mut Bytes<'_>) {
    let (Some(position), Some(length)) = (bytes.word(), bytes.word()) else { return };
    let telegram = bytes.rest();
    if let Ok(mst) = Mst::parse(telegram) {
        assert_eq!(mst.emit(), telegram);
        assert_eq!(mst.phase().is_some(), mst.data & 7 < 5);
    }
    // Small numbers as often as large ones.
    for (position, length) in [(position, length), (position & 0x3F, length & 0x3F)] {
        if let Ok(record) = telegram::record_of(telegram, position, length) {
            let start = usize::from(position) - 1;
            assert_eq!(record.data(), &telegram[start + 4..start + usize::from(length)]);
        }
    }
    let Ok(record) = RecordPacket::new_checked(telegram) else { return };
    assert_eq!(record.control().raw_value(), record.status().raw_value());
    let offset = usize::from(position);
    let in_data = |bytes: usize| record.data().get(offset..offset + bytes);
    assert_eq!(record.data_word(offset).map(u16::to_le_bytes).as_ref().map(|bytes| &bytes[..]), in_data(2));
    assert_eq!(record.data_long(offset).map(u32::to_le_bytes).as_ref().map(|bytes| &bytes[..]), in_data(4));
    let repr = RecordRepr::parse(&record);
    let mut copy = RecordPacket::new_checked(vec![0; telegram.len()]).expect("as long as the first");
    assert_eq!(repr.emit(&mut copy), Ok(()));
    assert_eq!(RecordRepr::parse(&copy), repr);
}

/// More events in one instant than a chip has things to do.
const MOST_EVENTS_IN_AN_INSTANT: u32 = 1_000;
/// Bytes that a chip may send: a header full of garbage asks for telegrams that take long and tell nothing new.
const MOST_BYTES_SENT: usize = 1_000;
/// The longest time between two things that happen to the chip, ns.
const LONGEST_PAUSE: u64 = 300_000;

/// Every alternative of an open point, alone.
static VARIANTS: LazyLock<Vec<Alternatives>> =
    LazyLock::new(|| Alternatives::singles().into_iter().map(|(_, alternatives)| alternatives).collect());

/// A chip with anything in its registers and its RAM receives anything.
fn chip(bytes: &mut Bytes<'_>) {
    let Some(silicon) = bytes.word() else { return };
    let alternatives = chosen(&VARIANTS, usize::from(silicon));
    let mut chip = Watched { chip: Chip::new(alternatives, u64::from(silicon)), sent: 0 };
    let mut now = Nanoseconds::from_microseconds(1);
    while let Some(kind) = bytes.byte().filter(|_| chip.sent < MOST_BYTES_SENT) {
        match kind % 8 {
            0 | 1 => {
                let (Some(word), Some(value)) = (bytes.byte(), bytes.word()) else { return };
                chip.chip.write_register(now, u16::from(word) % 0x30, value);
            }
            2 => {
                let (Some(word), Some(value)) = (bytes.word(), bytes.word()) else { return };
                chip.chip.write_ram(now, word, value);
            }
            3 => {
                let (Some(register), Some(word)) = (bytes.byte(), bytes.word()) else { return };
                let _ = (chip.chip.read_register(now, u16::from(register)), chip.chip.read_ram(now, word));
            }
            4 => chip.chip.on_signal(now, kind & 0x80 == 0),
            5 => {
                let span = u64::from(bytes.word().unwrap_or(0)) * 1_000 % LONGEST_PAUSE;
                now = chip.pass(now, now + Nanoseconds(span));
            }
            6 => {
                let telegram = bytes.up_to(usize::from(kind >> 3));
                now = chip.receive(now, telegram);
            }
            _ => now = chip.receive(now, &[BROADCAST, kind >> 3]),
        }
    }
    let end = chip.pass(now, now + Nanoseconds(LONGEST_PAUSE));
    assert!(chip.sent >= MOST_BYTES_SENT || chip.chip.next_event().is_none_or(|next| next > end));
}

/// A chip, and how many bytes it has sent.
struct Watched {
    chip: Chip,
    sent: usize,
}

impl Watched {
    fn receive(&mut self, start: Nanoseconds, telegram: &[u8]) -> Nanoseconds {
        self.chip.on_telegram_start(start);
        let signal = LineSignal::of_telegram(telegram);
        let end = self.pass(start, start + wire::BitRate::M2.span(signal.len()));
        self.chip.on_telegram(start, end, signal.telegram());
        end
    }

    /// Lets everything of the chip happen until then, or until it has sent enough.
    fn pass(&mut self, from: Nanoseconds, until: Nanoseconds) -> Nanoseconds {
        let (mut now, mut events) = (from, 0);
        while let Some(next) = self.chip.next_event().filter(|&next| next <= until && self.sent < MOST_BYTES_SENT) {
            assert!(next >= now, "the chip asks for {next} at {now}");
            events = if next == now { events + 1 } else { 0 };
            assert!(events < MOST_EVENTS_IN_AN_INSTANT, "the chip asks for {next} without end");
            now = next;
            self.sent += self.chip.on_time(now).map_or(0, |transmission| transmission.bytes.len());
            let _ = (self.chip.pin_edges(), self.chip.interrupt_pins());
        }
        until
    }
}
