//! The port against a small container, in all ways the silicon may turn out to behave, and a master that reads and writes.

use std::cell::RefCell;
use std::rc::Rc;
use std::vec::Vec;

use proptest::prelude::*;

use super::*;
use crate::bus::Register;
use crate::test_bus::{TestBus, Write};

const BASE: usize = 0x070;
const INFO: usize = 0x020;

/// The ways of G20, G21 and G24.
#[derive(Clone, Copy, Debug, Default)]
struct Silicon {
    acknowledges_at_once: bool,
    buffers_swapped: bool,
    reports_end_late: bool,
    /// With a late report at the end of an element: no end-of-buffer flag.
    hides_end_of_buffer: bool,
    /// The pointers read the word transferred last, not the next one.
    points_at_last_transfer: bool,
    /// Only the very last position counts as the end of the buffer, not one behind it.
    compares_for_equality: bool,
}

impl Silicon {
    fn all() -> impl Iterator<Item = Self> {
        // A chip that hides both signs of a late end of buffer cannot be told from one that has not reached it.
        (0..64).filter(|bits| bits & 0x18 != 0x18).map(|bits| Self {
            acknowledges_at_once: bits & 1 != 0,
            buffers_swapped: bits & 2 != 0,
            reports_end_late: bits & 4 != 0,
            hides_end_of_buffer: bits & 8 != 0,
            points_at_last_transfer: bits & 16 != 0,
            compares_for_equality: bits & 32 != 0,
        })
    }
}

struct Container {
    silicon: Silicon,
    ram: [u16; 2048],
    at_info: u16,
    /// A held step: is its word in the AT already?
    held: Option<bool>,
    /// For pointer words 2 and 3: a transfer was made since the processor wrote it.
    moved: [bool; 2],
}

impl Container {
    fn pointer_index(&self, sending: bool) -> usize {
        usize::from(sending == self.silicon.buffers_swapped)
    }

    /// Position of the next transfer, and of the last word.
    fn position(&self, sending: bool) -> (u16, u16) {
        let index = self.pointer_index(sending);
        let pointer = self.ram[BASE + 2 + index];
        let behind = self.silicon.points_at_last_transfer && self.moved[index];
        ((pointer & 0xFF) + u16::from(behind), pointer >> 8)
    }

    fn transfer(&mut self, sending: bool, info: u16) -> bool {
        let (position, last) = self.position(sending);
        if sending && position > last {
            return false;
        }
        let position = position.min(last + 1);
        let index = self.pointer_index(sending);
        let pointer = position + u16::from(!self.silicon.points_at_last_transfer);
        self.ram[BASE + 2 + index] = (last << 8) | pointer.min(last + 1);
        self.moved[index] = true;
        let cell = BASE + 5 + usize::from(position);
        if sending {
            self.at_info = self.ram[cell];
        } else {
            self.ram[cell] = info;
        }
        true
    }

    /// An MDT to this drive.
    fn receive(&mut self, control: u16, info: u16) {
        self.ram[INFO] = info;
        self.ram[BASE + 1] = control & 0x3F;
        let word = self.ram[BASE];
        if (word ^ control) & 1 == 0 || word & 2 != 0 {
            return;
        }
        let (write, end, element) = (control & 2 != 0, control & 4 != 0, (control >> 3) & 7);
        let same = element != 0 && element == (word >> 4) & 7 && write == (word & 0x80 != 0);
        let (present, last) = self.position(!write);
        let end_position = last + u16::from(self.silicon.reports_end_late);
        let at_end = if self.silicon.compares_for_equality { present == end_position } else { present >= end_position };
        let transferred = if write || same { self.transfer(!write, info) } else { false };
        if same && !at_end && !end {
            self.ram[BASE] = word ^ 1;
            return;
        }
        let mut flags = 2;
        flags |= if same { 0 } else { 0x1000 };
        flags |= if end { 0x8000 } else { 0 };
        if same && at_end && !(end && self.silicon.hides_end_of_buffer) {
            flags |= if write != self.silicon.buffers_swapped { 0x4000 } else { 0x2000 };
        }
        self.ram[BASE] = word | flags;
        if self.silicon.acknowledges_at_once {
            self.ram[BASE] = (self.ram[BASE] & !1) | (control & 1);
        }
        self.held = Some(transferred && !write);
    }

    fn write(&mut self, word: usize, value: u16) {
        self.ram[word] = value;
        if let Some(moved) = word.checked_sub(BASE + 2).and_then(|index| self.moved.get_mut(index)) {
            *moved = false;
        }
        if word == BASE && value & 2 == 0 {
            let held = self.held.take();
            if held == Some(false) || value & 4 != 0 {
                self.transfer(true, 0);
            }
        }
    }
}

#[derive(Clone)]
struct ContainerBus(Rc<RefCell<Container>>);

impl Bus for ContainerBus {
    fn read_register(&mut self, _: Register) -> u16 {
        unreachable!("the service port has no business with registers")
    }
    fn write_register(&mut self, _: Register, _: u16) {
        unreachable!("the service port has no business with registers")
    }
    fn read_ram(&mut self, address: RamAddress) -> u16 {
        self.0.borrow().ram[usize::from(address.word())]
    }
    fn write_ram(&mut self, address: RamAddress, value: u16) {
        self.0.borrow_mut().write(usize::from(address.word()), value);
    }
}

/// A drive with one operation datum in every element.
struct Drive {
    port: ServicePort<ContainerBus>,
    data: Vec<u16>,
    cursor: usize,
    segment: usize,
    written: Vec<u16>,
    complete: Option<Vec<u16>>,
    /// Where a read ended, as the port told it.
    end_seen: Option<Boundary>,
}

const STATUS_OF_DATA: u16 = 0x0107;
const TOO_LONG: u16 = 0x7003;

impl Drive {
    fn serve(&mut self) {
        let Some(step) = self.port.pending() else { return };
        assert_eq!(self.port.pending(), Some(step), "asking twice must not change anything");
        let answer = match step {
            ServiceStep { element: 0, .. } => ServiceAnswer::Accept { info: 0 },
            ServiceStep { write: true, .. } => {
                if step.new_transfer {
                    self.written.clear();
                }
                self.written.extend(step.silent);
                self.written.push(step.info);
                if step.end {
                    self.complete = Some(core::mem::take(&mut self.written));
                }
                ServiceAnswer::Accept { info: STATUS_OF_DATA }
            }
            _ => {
                if step.new_transfer {
                    self.cursor = 0;
                }
                self.end_seen = step.end.then_some(step.boundary);
                let wanted = step.new_transfer
                    || step.boundary == Boundary::SegmentExhausted
                    || (step.boundary == Boundary::SegmentSent && !step.end);
                let rest = self.data.get(self.cursor..).unwrap_or(&[]);
                if !wanted || (rest.is_empty() && step.boundary == Boundary::SegmentSent) {
                    ServiceAnswer::Continue
                } else if rest.is_empty() {
                    ServiceAnswer::Error { code: TOO_LONG }
                } else {
                    let words = &rest[..self.segment.min(rest.len())];
                    self.cursor += words.len();
                    ServiceAnswer::Send { words }
                }
            }
        };
        self.port.release(answer);
    }
}

/// A master at the other end of the ring, and how lazy the drive's processor is.
struct Bench {
    container: Rc<RefCell<Container>>,
    drive: Drive,
    handshake: u16,
    idle_cycles: usize,
}

impl Bench {
    fn new(silicon: Silicon, segment: usize, idle_cycles: usize) -> Self {
        let container = Rc::new(RefCell::new(Container {
            silicon,
            ram: [0xDEAD; 2048],
            at_info: 0,
            held: None,
            moved: [false; 2],
        }));
        let mut port = ServicePort::new(ContainerBus(container.clone()));
        port.reset();
        let drive =
            Drive { port, data: Vec::new(), cursor: 0, segment, written: Vec::new(), complete: None, end_seen: None };
        Self { container, drive, handshake: 0, idle_cycles }
    }

    /// One step of the master; returns info word and error bit of the AT that answers it.
    fn step(&mut self, element: u16, write: bool, end: bool, info: u16) -> (u16, bool) {
        self.handshake ^= 1;
        let control = self.handshake | u16::from(write) << 1 | u16::from(end) << 2 | element << 3;
        for cycle in 0..10 + self.idle_cycles {
            self.container.borrow_mut().receive(control, info);
            if cycle >= self.idle_cycles {
                self.drive.serve();
            }
            let container = self.container.borrow();
            let status = container.ram[BASE];
            if (status ^ control) & 1 == 0 && status & 2 == 0 {
                return (container.at_info, status & 4 != 0);
            }
        }
        panic!("handshake timeout in element {element}");
    }

    fn open(&mut self) {
        assert_eq!(self.step(1, true, true, 3), (STATUS_OF_DATA, false));
    }

    fn close(&mut self) {
        assert!(!self.step(0, true, true, 0).1);
    }

    fn write(&mut self, element: u16, words: &[u16]) {
        for (index, &word) in words.iter().enumerate() {
            self.drive.complete = None;
            assert!(!self.step(element, true, index + 1 == words.len(), word).1);
        }
        assert_eq!(self.drive.complete.as_deref(), Some(words));
    }

    fn read(&mut self, element: u16, count: usize) {
        for index in 0..count {
            let end = index + 1 == count;
            assert_eq!(self.step(element, false, end, 0xFFFF), (self.drive.data[index], false), "word {index}");
        }
    }
}

#[test]
fn reset_closes_the_channel_with_handshake_0() {
    let bus = TestBus::new();
    ServicePort::new(bus.clone()).reset();
    let words: Vec<u16> = (0x70..0x75).map(|word| bus.ram(word)).collect();
    assert_eq!(words, [0, 0, 0x2020, 0x2020, 0]);
    assert_eq!(bus.take_writes().last(), Some(&Write::Ram(0x70, 0)), "the release comes last");
}

#[test]
fn info_words_come_from_the_block_in_force() {
    let bus = TestBus::new();
    let mut port = ServicePort::new(bus.clone());
    port.reset();
    bus.set_ram(0x020, 0x1111);
    bus.set_ram(0x050, 0x2222);
    bus.set_ram(0x071, 0x000F);
    bus.set_ram(0x070, 0x9002);
    assert_eq!(port.pending().unwrap().info, 0x1111);
    port.set_block(&Block::CYCLIC);
    let step = port.pending().unwrap();
    assert_eq!((step.info, step.element, step.write, step.end), (0x2222, 1, true, true));
    port.release(ServiceAnswer::Accept { info: 7 });
    assert_eq!((bus.ram(0x070), bus.ram(0x075 + 32)), (0x0081, 7));
    assert_eq!(port.pending(), None);
}

/// A read of many words: the first segment is asked for, and its last word is taken with these flags in container word 0.
fn read_on_until(bus: &TestBus, port: &mut ServicePort<TestBus>, flags: u16) {
    bus.set_ram(0x071, 0x0038);
    bus.set_ram(0x070, 0x1002);
    assert!(port.pending().unwrap().new_transfer);
    port.release(ServiceAnswer::Send { words: &[1, 2] });
    bus.set_ram(0x071, 0x0039);
    bus.set_ram(0x070, 0x0073 | flags);
    assert_eq!(port.pending().unwrap().boundary, Boundary::SegmentSent);
}

/// The words that the next segment leaves in both buffers.
fn next_segment(bus: &TestBus, port: &mut ServicePort<TestBus>) -> [u16; 2] {
    bus.set_ram(0x075, 0xAAAA);
    bus.set_ram(0x075 + 16, 0xBBBB);
    port.release(ServiceAnswer::Send { words: &[3, 4] });
    assert_eq!((bus.ram(0x072), bus.ram(0x073)), (0x0100, 0x1110), "the pointers are the same in any case");
    [bus.ram(0x075), bus.ram(0x075 + 16)]
}

#[test]
fn once_the_chip_has_shown_which_buffer_it_sends_only_that_one_is_filled() {
    const WRITE_BUFFER: u16 = 1 << 13;
    const READ_BUFFER: u16 = 1 << 14;
    for (flags, expected) in [
        (0, [3, 3]),
        (WRITE_BUFFER | READ_BUFFER, [3, 3]),
        (WRITE_BUFFER, [3, 0xBBBB]),
        (READ_BUFFER, [0xAAAA, 3]),
        // The end of the element together with that of the buffer.
        (1 << 15 | WRITE_BUFFER, [3, 0xBBBB]),
    ] {
        let bus = TestBus::new();
        let mut port = ServicePort::new(bus.clone());
        port.reset();
        read_on_until(&bus, &mut port, flags);
        assert_eq!(next_segment(&bus, &mut port), expected, "{flags:#x}");
        // It stays what it was when the channel is closed for a new run-up.
        port.reset();
        read_on_until(&bus, &mut port, 0);
        assert_eq!(next_segment(&bus, &mut port), expected, "{flags:#x}");
    }
}

#[test]
fn the_end_of_a_buffer_that_receives_says_nothing_about_the_one_that_is_sent() {
    let bus = TestBus::new();
    let mut port = ServicePort::new(bus.clone());
    port.reset();
    bus.set_ram(0x071, 0x003A);
    bus.set_ram(0x070, 0x1002);
    assert!(port.pending().is_some());
    port.release(ServiceAnswer::Accept { info: 0 });
    bus.set_ram(0x071, 0x003B);
    bus.set_ram(0x070, 0x40F3);
    assert!(port.pending().is_some());
    port.release(ServiceAnswer::Accept { info: 0 });
    read_on_until(&bus, &mut port, 0);
    assert_eq!(next_segment(&bus, &mut port), [3, 3]);
}

#[test]
fn a_long_segment_takes_23_accesses_once_the_sent_buffer_is_known() {
    let bus = TestBus::new();
    let mut port = ServicePort::new(bus.clone());
    port.reset();
    read_on_until(&bus, &mut port, 1 << 13);
    port.release(ServiceAnswer::Send { words: &[5; 2] });
    bus.set_ram(0x071, 0x0039);
    bus.set_ram(0x070, 0x2073);
    bus.take_accesses();
    assert!(port.pending().is_some());
    port.set_command_change(false);
    port.release(ServiceAnswer::Send { words: &[5; 16] });
    assert_eq!(bus.take_accesses(), 4 + 16 + 3);
}

#[test]
fn a_protocol_error_that_comes_while_a_step_is_answered_is_still_there_for_the_next() {
    let bus = TestBus::new();
    let mut port = ServicePort::new(bus.clone());
    port.reset();
    bus.set_ram(0x071, 0x000F);
    bus.set_ram(0x070, 0x9002);
    assert!(!port.pending().unwrap().protocol_error);
    bus.set_ram(0x074, 0x0200);
    port.release(ServiceAnswer::Accept { info: 7 });
    bus.set_ram(0x071, 0x003E);
    bus.set_ram(0x070, 0x9002);
    assert!(port.pending().unwrap().protocol_error);
}

#[test]
fn a_release_without_a_step_writes_nothing() {
    let bus = TestBus::new();
    let mut port = ServicePort::new(bus.clone());
    port.release(ServiceAnswer::Error { code: 0x1001 });
    assert_eq!(bus.take_writes(), []);
}

#[test]
fn a_protocol_error_is_reported_with_the_step_and_cleared() {
    let bus = TestBus::new();
    let mut port = ServicePort::new(bus.clone());
    port.reset();
    bus.set_ram(0x074, 0x0200);
    assert_eq!(port.pending(), None);
    assert_eq!((bus.ram(0x070), bus.ram(0x074)), (0, 0));
    bus.set_ram(0x074, 0x0200);
    bus.set_ram(0x071, 0x003F);
    bus.set_ram(0x070, 0x8002);
    let step = port.pending().unwrap();
    assert!(step.protocol_error && step.new_transfer);
    port.release(ServiceAnswer::Error { code: 0x7008 });
    assert_eq!((bus.ram(0x070), bus.ram(0x074)), (0x0085, 0));
}

#[test]
fn the_command_change_bit_shows_at_once_only_between_transfers() {
    let bus = TestBus::new();
    let mut port = ServicePort::new(bus.clone());
    port.reset();
    port.set_command_change(true);
    assert_eq!(bus.ram(0x070), 0x0008);
    bus.set_ram(0x071, 0x003B);
    bus.set_ram(0x070, 0x100A);
    port.set_command_change(false);
    assert_eq!(bus.ram(0x070), 0x100A, "held: left to the release");
    assert!(port.pending().is_some());
    port.release(ServiceAnswer::Accept { info: 0 });
    assert_eq!(bus.ram(0x070), 0x00F1, "element 7, write, handshake as received, no command change");
    port.set_command_change(true);
    assert_eq!(bus.ram(0x070), 0x00F1, "within a transfer: left to the release");
    bus.set_ram(0x071, 0x003E);
    bus.set_ram(0x070, 0x80F2);
    assert!(port.pending().is_some());
    port.release(ServiceAnswer::Accept { info: 0 });
    assert_eq!(bus.ram(0x070), 0x0088, "the release of the last step shows it");
    bus.take_accesses();
    port.set_command_change(true);
    assert_eq!(bus.take_accesses(), 0, "it stands there already");
    port.set_command_change(false);
    assert_eq!(bus.ram(0x070), 0x0080);
    // The bit that a release has shown counts as well as one that was shown at once.
    port.set_command_change(true);
    bus.set_ram(0x071, 0x003F);
    bus.set_ram(0x070, 0x808A);
    port.set_command_change(false);
    assert!(port.pending().is_some());
    port.release(ServiceAnswer::Accept { info: 0 });
    port.set_command_change(true);
    assert_eq!(bus.ram(0x070), 0x0089);
}

#[test]
fn the_dialogue_of_the_recording_is_answered_in_every_silicon() {
    for silicon in Silicon::all() {
        let mut bench = Bench::new(silicon, 16, 0);
        bench.drive.data = std::vec![0x0001, 0x7011];
        bench.open();
        bench.read(3, 2);
        bench.drive.data = std::vec![2000];
        bench.read(7, 1);
        bench.close();
        bench.open();
        bench.write(7, &[6, 6, 11, 51, 0x8013]);
        bench.close();
    }
}

#[test]
fn an_element_0_word_may_flip_the_handshake_for_one_cycle() {
    for silicon in Silicon::all() {
        let mut bench = Bench::new(silicon, 16, 0);
        for served_between in [false, true] {
            bench.container.borrow_mut().receive(bench.handshake ^ 1 | 6, 0);
            if served_between {
                bench.drive.serve();
            }
            bench.container.borrow_mut().receive(bench.handshake | 6, 0);
            bench.drive.serve();
            assert_eq!(bench.container.borrow().ram[BASE] & 7, bench.handshake, "{silicon:?}");
            bench.open();
            bench.close();
        }
    }
}

#[test]
fn reading_past_the_end_is_an_error_in_every_silicon() {
    for silicon in Silicon::all() {
        for length in [1, 2, 15, 16, 17, 32, 33] {
            for end in [false, true] {
                let mut bench = Bench::new(silicon, 16, 0);
                bench.drive.data = (0..length).map(|word| 0x4000 + word).collect();
                bench.open();
                for word in 0..length {
                    assert_eq!(bench.step(7, false, false, 0), (0x4000 + word, false), "{silicon:?} {length}");
                }
                assert_eq!(bench.step(7, false, end, 0), (TOO_LONG, true), "{silicon:?} {length}");
                bench.close();
                bench.open();
            }
        }
    }
}

#[derive(Clone, Debug)]
enum Action {
    Open,
    Close,
    /// Words in the drive, and how many of them the master takes before it signals the end.
    Read {
        element: u16,
        words: Vec<u16>,
        taken: usize,
    },
    /// The master gives up without END.
    AbandonRead {
        element: u16,
        words: Vec<u16>,
        taken: usize,
    },
    Write {
        element: u16,
        words: Vec<u16>,
    },
    AbandonWrite {
        element: u16,
        words: Vec<u16>,
    },
    CommandChange(bool),
}

fn any_action() -> impl Strategy<Value = Action> {
    let words = || proptest::collection::vec(any::<u16>(), 1..70);
    prop_oneof![
        Just(Action::Open),
        Just(Action::Close),
        (2_u16..8, words(), any::<proptest::sample::Index>()).prop_map(|(element, words, taken)| Action::Read {
            element,
            taken: taken.index(words.len()) + 1,
            words
        }),
        (2_u16..8, words()).prop_map(|(element, words)| Action::Read { element, taken: words.len(), words }),
        (2_u16..8, words(), any::<proptest::sample::Index>()).prop_map(|(element, words, taken)| {
            Action::AbandonRead { element, taken: taken.index(words.len()) + 1, words }
        }),
        (2_u16..8, words()).prop_map(|(element, words)| Action::Write { element, words }),
        (2_u16..8, words()).prop_map(|(element, words)| Action::AbandonWrite { element, words }),
        any::<bool>().prop_map(Action::CommandChange),
    ]
}

#[test]
fn an_end_before_the_last_word_of_two_is_told_from_one_with_it_in_every_silicon() {
    for silicon in Silicon::all() {
        for idle_cycles in 0..3 {
            let mut bench = Bench::new(silicon, 16, idle_cycles);
            // The last segment: two words, and END with the first or with the second of them.
            for taken in [1, 2] {
                bench.drive.data = std::vec![1; 18];
                bench.open();
                for index in 0..16 + taken {
                    bench.step(7, false, index + 1 == 16 + taken, 0);
                }
                let seen = bench.drive.end_seen.unwrap();
                // A silicon that stops one step late asks for the second segment with the very step that ends.
                let early = matches!(seen, Boundary::EndInside | Boundary::SegmentExhausted);
                assert_eq!(
                    (early, seen == Boundary::SegmentSent),
                    (taken == 1, taken == 2),
                    "{silicon:?} {taken}: {seen:?}"
                );
            }
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(256))]

    #[test]
    fn every_dialogue_arrives_whole_in_every_silicon(
        actions in proptest::collection::vec(any_action(), 1..12),
        segment in 1_usize..=16,
        idle_cycles in 0_usize..3,
    ) {
        for silicon in Silicon::all() {
            let mut bench = Bench::new(silicon, segment, idle_cycles);
            let mut command_change = false;
            for action in actions.clone() {
                match action {
                    Action::Open => bench.open(),
                    Action::Close => bench.close(),
                    Action::Read { element, words, taken } => {
                        bench.drive.data = words;
                        bench.read(element, taken);
                    }
                    Action::AbandonRead { element, words, taken } => {
                        bench.drive.data = words;
                        for index in 0..taken {
                            let answer = bench.step(element, false, false, 0);
                            prop_assert_eq!(answer, (bench.drive.data[index], false));
                        }
                        bench.close();
                    }
                    Action::Write { element, words } => bench.write(element, &words),
                    Action::AbandonWrite { element, words } => {
                        for word in words {
                            prop_assert!(!bench.step(element, true, false, word).1);
                        }
                        bench.close();
                    }
                    Action::CommandChange(set) => {
                        bench.drive.port.set_command_change(set);
                        command_change = set;
                    }
                }
            }
            bench.close();
            prop_assert_eq!(bench.container.borrow().ram[BASE] & 8 != 0, command_change);
        }
    }
}
