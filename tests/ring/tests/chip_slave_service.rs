//! A slave's service channel by hand, as the firmware would serve it. sercon816.md 6.4, 8.1, 8.2, 8.4, G20, G21, G24.

use crate::chip_rig::{AT_HEADER, BUFFERS, CYCLE, FIRST_MST, Rig, SERVICE, with};
use ring::chip::{Alternatives, BufferSense, EndOfBuffer, Handshake, PointerMeaning};

const PERIOD: u64 = CYCLE * 1_000;

const HS: u16 = 1;
const BUSY: u16 = 2;
const ERR: u16 = 4;
const WRITE: u16 = 1 << 7;
const INT_ELEM_CHANGE: u16 = 1 << 12;
const INT_END_WRBUF: u16 = 1 << 13;
const INT_END_RDBUF: u16 = 1 << 14;
const INT_END_MDT: u16 = 1 << 15;

/// Offsets of the two buffers in these tests.
const SENT: u16 = 0;
const RECEIVED: u16 = 20;

/// A drive in CP2 whose AT is sent in every cycle, one service step a cycle.
struct Drive {
    rig: Rig,
    cycle: u64,
}

/// What one cycle shows: AT handshake and busy bits (with the error bit), AT info, and whether INT_SC_0 came.
#[derive(Debug, PartialEq, Eq)]
struct Answer {
    bits: u16,
    info: u16,
    interrupt: bool,
}

impl Drive {
    fn new(alternatives: Alternatives) -> Self {
        let mut rig = Rig::slave(alternatives);
        rig.set_ram(AT_HEADER, &[0x5001]);
        Self { rig, cycle: 0 }
    }

    /// One MDT; the answer is that of the AT in the next cycle.
    fn step(&mut self, control: u16, info: u16) -> Answer {
        let mst = FIRST_MST + self.cycle * PERIOD;
        self.cycle += 1;
        self.rig.mst(mst, 2);
        self.rig.mdt(mst, control, info);
        let interrupt = self.rig.take_status(0x05) & 1 != 0;
        let (bits, info) = self.at();
        Answer { bits, info, interrupt }
    }

    /// Status bits 3..0 and info of the next AT, looked at without a new MDT.
    fn at(&mut self) -> (u16, u16) {
        let mst = FIRST_MST + self.cycle * PERIOD;
        self.cycle += 1;
        self.rig.sent.clear();
        self.rig.mst(mst, 2);
        self.rig.run_to(mst + 400_000);
        let at = &self.rig.sent[0].1;
        (u16::from(at[1] & 0x0F), u16::from_le_bytes([at[3], at[4]]))
    }

    fn word(&mut self, offset: u16) -> u16 {
        self.rig.ram(SERVICE + offset)
    }

    fn buffer(&mut self, offset: u16) -> u16 {
        self.rig.ram(BUFFERS + offset)
    }

    /// Fills the sending buffer and points at all of it.
    fn send(&mut self, words: &[u16]) {
        self.rig.set_ram(BUFFERS + SENT, words);
        let last = SENT + words.len() as u16 - 1;
        self.rig.set_ram(SERVICE + 2, &[last << 8 | SENT]);
    }

    /// Makes room for so many words.
    fn receive(&mut self, words: u16) {
        self.rig.set_ram(SERVICE + 3, &[(RECEIVED + words - 1) << 8 | RECEIVED]);
    }

    /// The write of word 0 that releases a step.
    fn release(&mut self, element: u16, direction: u16, error: u16) {
        let handshake = self.word(1) & HS;
        self.rig.set_ram(SERVICE, &[handshake | element << 4 | direction | error]);
    }

    /// The drive as it stands after "open IDN 3" was released with data status 0001H; its handshake bit is 1.
    fn opened(alternatives: Alternatives) -> Self {
        let mut drive = Self::new(alternatives);
        drive.receive(1);
        drive.step(0x0F, 3);
        drive.send(&[0x0001]);
        drive.release(1, WRITE, 0);
        assert_eq!(drive.at(), (HS, 0x0001));
        drive
    }
}

#[test]
fn g20_an_open_is_held_with_or_without_the_handshake_and_answered_with_the_data_status() {
    for (handshake, held) in [(Handshake::HoldUntilReady, BUSY), (Handshake::AckThenBusy, BUSY | HS)] {
        let mut drive = Drive::new(with(|chip| chip.handshake = handshake));
        drive.receive(1);
        let answer = drive.step(0x0F, 3);
        assert_eq!((answer.bits, answer.interrupt), (held, true), "{handshake:?}");
        assert_eq!(drive.word(0), held | INT_ELEM_CHANGE | INT_END_MDT);
        assert_eq!(drive.word(1), 0x0F);
        assert_eq!(drive.buffer(RECEIVED), 3, "the IDN stands in the buffer");
        let again = drive.step(0x0F, 3);
        assert_eq!((again.bits, again.interrupt), (held, false), "the master repeats, the chip waits");
        drive.send(&[0x0001]);
        drive.release(1, WRITE, 0);
        assert_eq!(drive.at(), (HS, 0x0001));
        assert!(!drive.step(0x0F, 3).interrupt, "no step without a change of the handshake bit");
    }
}

#[test]
fn an_attribute_of_two_words_is_read_with_one_silent_step() {
    let mut drive = Drive::opened(Alternatives::default());
    let answer = drive.step(0x18, 0);
    assert_eq!((answer.bits, answer.interrupt), (HS | BUSY, true), "a new element is held");
    drive.send(&[0x1111, 0x2222, 0x3333]);
    drive.release(3, 0, 0);
    assert_eq!(drive.at(), (0, 0x1111), "its first word goes out with the release");
    assert_eq!(drive.step(0x19, 0), Answer { bits: HS, info: 0x2222, interrupt: false });
    let answer = drive.step(0x1C, 0);
    assert_eq!(answer, Answer { bits: HS | BUSY, info: 0x3333, interrupt: true }, "END asks the processor");
    assert_eq!(drive.word(0) & 0xF000, INT_END_MDT | INT_END_WRBUF);
    drive.release(3, 0, 0);
    assert_eq!(drive.at(), (0, 0x3333), "already transferred: the release changes nothing but the bits");
}

#[test]
fn g24_the_end_of_the_sent_buffer_stops_with_its_last_word_or_behind_it() {
    for pointer_meaning in [PointerMeaning::Next, PointerMeaning::Last] {
        let mut drive = Drive::opened(with(|chip| chip.pointer_meaning = pointer_meaning));
        drive.step(0x38, 0);
        drive.send(&[10, 11, 12]);
        drive.release(7, 0, 0);
        assert_eq!(drive.step(0x39, 0), Answer { bits: HS, info: 11, interrupt: false });
        assert_eq!(drive.step(0x38, 0), Answer { bits: HS | BUSY, info: 12, interrupt: true }, "{pointer_meaning:?}");
        assert_eq!(drive.word(0) & 0xF000, INT_END_WRBUF);
        drive.send(&[13, 14]);
        drive.release(7, 0, 0);
        assert_eq!(drive.at(), (0, 12), "the last word is acknowledged");
        assert_eq!(drive.step(0x39, 0), Answer { bits: HS, info: 13, interrupt: false });
    }
    for pointer_meaning in [PointerMeaning::Next, PointerMeaning::Last] {
        let mut drive = Drive::opened(with(|chip| {
            chip.pointer_meaning = pointer_meaning;
            chip.end_of_buffer = EndOfBuffer::AfterLast;
        }));
        drive.step(0x38, 0);
        drive.send(&[10, 11, 12]);
        drive.release(7, 0, 0);
        assert_eq!(drive.step(0x39, 0), Answer { bits: HS, info: 11, interrupt: false });
        assert_eq!(drive.step(0x38, 0), Answer { bits: 0, info: 12, interrupt: false }, "{pointer_meaning:?}");
        let answer = drive.step(0x39, 0);
        assert_eq!((answer.bits, answer.interrupt), (BUSY, true), "the step behind the buffer waits");
        assert_eq!(drive.word(0) & 0xF000, INT_END_WRBUF);
        drive.send(&[13, 14]);
        drive.release(7, 0, 0);
        assert_eq!(drive.at(), (HS, 13), "and is answered by the first refilled word");
        assert_eq!(drive.step(0x38, 0), Answer { bits: 0, info: 14, interrupt: false });
    }
}

#[test]
fn g24_the_end_of_the_received_buffer_stops_with_its_last_word_or_behind_it() {
    // Current length 6, maximum length 6, three elements: sercon816.md 8.2, S-0-0016.
    let mut drive = Drive::opened(Alternatives::default());
    let answer = drive.step(0x3A, 6);
    assert_eq!((answer.bits, answer.interrupt), (HS | BUSY, true));
    drive.receive(3);
    drive.release(7, WRITE, 0);
    assert!(!drive.step(0x3B, 6).interrupt);
    assert!(!drive.step(0x3A, 11).interrupt);
    let answer = drive.step(0x3B, 51);
    assert_eq!((answer.bits, answer.interrupt), (BUSY, true), "with the third word");
    assert_eq!(drive.word(0) & 0xF000, INT_END_RDBUF);
    assert_eq!([0, 1, 2].map(|word| drive.buffer(RECEIVED + word)), [6, 11, 51]);
    drive.receive(3);
    drive.release(7, WRITE, 0);
    let answer = drive.step(0x3E, 0x8013);
    assert_eq!((answer.bits, answer.interrupt), (HS | BUSY, true));
    assert_eq!(drive.word(0) & 0xF000, INT_END_MDT);
    assert_eq!(drive.buffer(RECEIVED), 0x8013);

    let mut drive = Drive::opened(with(|chip| chip.end_of_buffer = EndOfBuffer::AfterLast));
    drive.step(0x3A, 6);
    drive.receive(3);
    drive.release(7, WRITE, 0);
    for (control, info) in [(0x3B, 6), (0x3A, 11), (0x3B, 51)] {
        assert!(!drive.step(control, info).interrupt);
    }
    let answer = drive.step(0x3A, 0x8013);
    assert_eq!((answer.bits, answer.interrupt), (HS | BUSY, true), "behind the third word");
    assert_eq!([0, 1, 2].map(|word| drive.buffer(RECEIVED + word)), [6, 11, 51]);
    assert_eq!(drive.buffer(RECEIVED + 3), 0x8013, "in the overhang word");
}

#[test]
fn g24_the_pointer_reads_the_next_or_the_last_word() {
    for (pointer_meaning, after_one, after_two) in [(PointerMeaning::Next, 1, 2), (PointerMeaning::Last, 0, 1)] {
        let mut drive = Drive::opened(with(|chip| chip.pointer_meaning = pointer_meaning));
        drive.step(0x38, 0);
        drive.send(&[10, 11, 12]);
        drive.release(7, 0, 0);
        assert_eq!(drive.word(2), 0x0200 | after_one);
        drive.step(0x39, 0);
        assert_eq!(drive.word(2), 0x0200 | after_two);
    }
}

#[test]
fn one_shared_cell_serves_a_list_write_word_by_word_or_every_second_word() {
    for (end_of_buffer, interrupts) in
        [(EndOfBuffer::WithLast, [true, true, true, true]), (EndOfBuffer::AfterLast, [false, true, false, true])]
    {
        let mut drive = Drive::opened(with(|chip| chip.end_of_buffer = end_of_buffer));
        drive.step(0x3A, 6);
        drive.rig.set_ram(SERVICE + 2, &[0, 0]);
        drive.release(7, WRITE, 0);
        let mut handshake = 0;
        for (word, interrupt) in (100..).zip(interrupts) {
            handshake ^= HS;
            let answer = drive.step(0x3A | handshake, word);
            assert_eq!(answer.interrupt, interrupt, "{end_of_buffer:?} {word}");
            if interrupt {
                drive.rig.set_ram(BUFFERS, &[0x0008]);
                drive.rig.set_ram(SERVICE + 2, &[0, 0]);
                drive.release(7, WRITE, 0);
                assert_eq!(drive.at(), (handshake, 0x0008), "the cell goes into the AT");
            } else {
                assert_eq!(answer.bits, handshake);
                assert_eq!(drive.buffer(0), word, "the silent word stands in the cell");
            }
        }
    }
}

#[test]
fn g21_the_buffers_may_be_the_other_way_round() {
    let mut drive = Drive::new(with(|chip| chip.buffer_sense = BufferSense::WriteIsReceived));
    // Word 2 now points where the MDT's words go, word 3 at what is sent.
    drive.rig.set_ram(SERVICE + 2, &[RECEIVED << 8 | RECEIVED, SENT << 8 | SENT]);
    assert!(drive.step(0x0F, 3).interrupt);
    assert_eq!(drive.buffer(RECEIVED), 3);
    drive.rig.set_ram(BUFFERS + SENT, &[0x0055]);
    drive.release(1, WRITE, 0);
    assert_eq!(drive.at(), (HS, 0x0055));
    drive.step(0x38, 0);
    drive.rig.set_ram(BUFFERS + SENT, &[70, 71]);
    drive.rig.set_ram(SERVICE + 3, &[(SENT + 1) << 8 | SENT]);
    drive.release(7, 0, 0);
    assert_eq!(drive.at(), (0, 70));
    let answer = drive.step(0x39, 0);
    assert_eq!(answer, Answer { bits: BUSY, info: 71, interrupt: true });
    assert_eq!(drive.word(0) & 0xF000, INT_END_RDBUF, "the flag of word 3");
}

#[test]
fn a_change_of_direction_or_element_asks_the_processor() {
    let mut drive = Drive::opened(Alternatives::default());
    drive.step(0x38, 0);
    drive.send(&[1, 2, 3, 4]);
    drive.receive(4);
    drive.release(7, 0, 0);
    assert!(drive.step(0x3B, 9).interrupt, "read to write");
    assert_eq!(drive.word(0) & 0xF000, INT_ELEM_CHANGE);
    drive.release(7, WRITE, 0);
    assert!(drive.step(0x22, 9).interrupt, "element 7 to 4");
    assert_eq!(drive.word(0) & 0xF000, INT_ELEM_CHANGE);
}

#[test]
fn a_close_is_held_and_acknowledged_by_software_every_time() {
    let mut drive = Drive::opened(Alternatives::default());
    assert!(drive.step(0x06, 0).interrupt);
    drive.release(0, WRITE, 0);
    assert_eq!(drive.at().0, 0);
    let answer = drive.step(0x07, 0);
    assert!(answer.interrupt, "element 0 again is a step again");
    assert_eq!(drive.word(0) & INT_ELEM_CHANGE, INT_ELEM_CHANGE);
    drive.release(0, WRITE, 0);
    assert_eq!(drive.at().0, HS);
}

#[test]
fn an_error_release_puts_the_error_code_into_the_at() {
    let mut drive = Drive::opened(Alternatives::default());
    drive.step(0x38, 0);
    drive.send(&[0x7001]);
    drive.release(7, 0, ERR);
    assert_eq!(drive.at(), (ERR, 0x7001));
    // Also where the word had been transferred already.
    let mut drive = Drive::opened(Alternatives::default());
    drive.step(0x38, 0);
    drive.send(&[1, 2]);
    drive.release(7, 0, 0);
    drive.step(0x3D, 0);
    drive.send(&[0x7002]);
    drive.release(7, 0, ERR);
    assert_eq!(drive.at(), (HS | ERR, 0x7002));
}

#[test]
fn a_damaged_mdt_sets_recerr_and_makes_no_step() {
    let mut drive = Drive::opened(Alternatives::default());
    let mst = FIRST_MST + drive.cycle * PERIOD;
    drive.cycle += 1;
    drive.rig.mst(mst, 2);
    drive.rig.damaged_telegram(mst + 600_000, &[1, 0x38, 0, 0, 0]);
    assert_eq!(drive.word(1), 0x8F);
    assert_eq!(drive.rig.take_status(0x05) & 1, 0);
    assert!(drive.step(0x38, 0).interrupt);
    assert_eq!(drive.word(1), 0x38);
}

#[test]
fn software_may_keep_busy_for_as_long_as_it_likes() {
    let mut drive = Drive::opened(Alternatives::default());
    drive.step(0x38, 0);
    drive.rig.set_ram(SERVICE, &[HS | BUSY | 7 << 4]);
    for _ in 0..20 {
        let answer = drive.step(0x38, 0);
        assert_eq!((answer.bits, answer.interrupt), (HS | BUSY, false));
    }
    drive.send(&[5, 6]);
    drive.release(7, 0, 0);
    assert_eq!(drive.at(), (0, 5));
}

#[test]
fn a_pointer_that_software_leaves_alone_stays_at_the_overhang_word() {
    let mut drive = Drive::opened(Alternatives::default());
    for (control, element) in [(0x3A, 7), (0x23, 4), (0x3A, 7), (0x23, 4)] {
        assert!(drive.step(control, 9).interrupt);
        drive.release(element, WRITE, 0);
    }
    assert_eq!(drive.word(3), RECEIVED << 8 | (RECEIVED + 1));
}
