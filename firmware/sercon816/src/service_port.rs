//! Serving a service container in slave mode: one step of the master at a time.
//!
//! The chip passes words of an element without the processor ("silent" steps) and stops ("holds") at a new element,
//! at the end of an element and at the end of a buffer. When exactly it stops, and which of its two buffers it sends,
//! is not published (G20, G21, G24); [`ServicePort`] is written so that no answer to these questions matters:
//!
//! * The info word of a held step is read from the MDT record itself, never from a buffer.
//! * Sending, both buffers are filled alike until the chip has shown, by reporting the end of one of them alone, which one it sends.
//!   Every step flips the handshake bit, so its parity tells whether a held step is the one that carried the last word of the
//!   segment or the one behind it.
//! * Receiving, both buffer pointers name one shared cell. Between two held steps no step or one passes silently;
//!   the parity tells, and the silent word stands in the cell.
//! * When no word of the element is left, the container is given element 0: whatever the master does next is a change of
//!   element and is held.

use arbitrary_int::u3;

use crate::bus::{Bus, RamAddress};
use crate::layout::{Block, REGION_A, REGION_B, SERVICE_BUFFERS, SERVICE_CONTAINER, SHARED_CELL};
use crate::service::BufferPointer;
use crate::service::slave::{Answer, Request, Supervision};
use crate::uncertain::{INITIAL_HANDSHAKE, SEGMENT_WORDS};

const REQUEST: RamAddress = SERVICE_CONTAINER.offset(1);
const WRITE_POINTER: RamAddress = SERVICE_CONTAINER.offset(2);
const READ_POINTER: RamAddress = SERVICE_CONTAINER.offset(3);
const SUPERVISION: RamAddress = SERVICE_CONTAINER.offset(4);
const CELL: RamAddress = SERVICE_BUFFERS.offset(SHARED_CELL as u16);

/// A step of the master that waits for the processor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct ServiceStep {
    /// Element 1 to 7, or 0: the channel is to be closed. An element-0 step is acknowledged with
    /// [`ServiceAnswer::Accept`] and is never an error, whatever its other bits.
    pub element: u8,
    /// The master writes (L/S).
    pub write: bool,
    /// The last transfer of the element (END).
    pub end: bool,
    /// The info word of this step's MDT.
    pub info: u16,
    /// A word of the same element that the master wrote just before this step, and that the chip accepted by itself;
    /// comes before `info`.
    pub silent: Option<u16>,
    /// The first step of a transfer: another element or direction than the step before, or the step before was the end.
    pub new_transfer: bool,
    /// Where a read stands in the segment sent last.
    pub boundary: Boundary,
    /// The chip reported a protocol error (INT_SC_ERR) since the last step. The step is then a new transfer.
    pub protocol_error: bool,
}

/// Where a read transfer stands in the segment that was given with [`ServiceAnswer::Send`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Boundary {
    /// There is no segment yet.
    #[default]
    None,
    /// The end of the element, with a word of the segment that is certainly not its last.
    EndInside,
    /// This step took the last word of the segment. Without the end of the element, answer with the next segment
    /// ([`ServiceAnswer::Send`]; it begins with the *following* step), or with [`ServiceAnswer::Continue`] if the element has no more
    /// words. With the end of the element, the word may also be an even number of places before the last: a last segment of one or two words
    /// leaves no doubt.
    SegmentSent,
    /// The step before took the last word; this step asks for one more.
    /// Answer with the next segment (it begins with *this* step), or with an error if the element has no more words.
    SegmentExhausted,
}

/// The answer to a [`ServiceStep`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum ServiceAnswer<'a> {
    /// A read: the next 1 to [`SEGMENT_WORDS`] words of the element; further words are not taken.
    /// Give as many as there are. The answer to a step with a new transfer or at a boundary.
    Send {
        /// The words in the order of transfer.
        words: &'a [u16],
    },
    /// A read: nothing to add, the segment goes on or is complete.
    Continue,
    /// A write or a close: accepted.
    Accept {
        /// The info word of the AT; for element 1 the status of the data (command acknowledgement).
        info: u16,
    },
    /// The step is refused; the transfer is over.
    Error {
        /// The info word of the AT, for example 1001H.
        code: u16,
    },
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Transfer {
    /// No transfer: every next step is a new one.
    None,
    /// A read; `first` is the handshake bit of the step that carries the segment's word 0.
    Sending { element: u3, first: bool, words: u8 },
    /// A read whose segment has gone out completely: the next step asks for more.
    Sent { element: u3 },
    /// A write; `handshake` was released last.
    Receiving { element: u3, handshake: bool },
}

#[derive(Clone, Copy, Debug)]
struct Held {
    request: Request,
    /// The word of this read step stands in the AT already.
    sent: bool,
    /// The container reports a protocol error, which the release clears.
    protocol_error: bool,
}

/// The two buffers of the container, by their pointers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Buffer {
    Write,
    Read,
}

/// The engine of service container 0.
///
/// Belongs to the task of INT_SC0 alone. Serve it within the gap between MDT and AT, so that the master sees no extra
/// cycle; later is legal and costs cycles only (sercon816.md 11.3).
#[derive(Debug)]
pub struct ServicePort<B> {
    bus: B,
    info: RamAddress,
    transfer: Transfer,
    held: Option<Held>,
    command_change: bool,
    /// The command-change bit that stands in the container; nobody else writes it.
    shown_command_change: bool,
    /// The buffer from which the AT is sent, once the chip has shown it (G21).
    sent: Option<Buffer>,
}

impl<B: Bus> ServicePort<B> {
    /// A port that receives through the MDT of CP0 to CP2. Call [`ServicePort::reset`] once the chip is initialised.
    pub fn new(bus: B) -> Self {
        Self {
            bus,
            info: info_of(&Block::INITIAL),
            transfer: Transfer::None,
            held: None,
            command_change: false,
            shown_command_change: false,
            sent: None,
        }
    }

    /// The MDT record from which info words are read: that of the block in force. A transfer under way goes on.
    pub fn set_block(&mut self, block: &Block) {
        self.info = info_of(block);
    }

    /// Closes the channel with HS_AT = 0 and CMD_AT = 0; on entry to CP2, and after the chip was initialised.
    pub fn reset(&mut self) {
        self.transfer = Transfer::None;
        self.held = None;
        self.command_change = false;
        self.shown_command_change = false;
        self.point_at_cell(0);
        self.bus.write_ram(SUPERVISION, 0);
        self.bus.write_ram(REQUEST, 0);
        self.bus.write_ram(SERVICE_CONTAINER, Answer::DEFAULT.with_handshake(INITIAL_HANDSHAKE).raw_value());
    }

    /// Sets the command-change bit of the AT.
    ///
    /// Between transfers it shows at once, else with the next release: while a transfer is under way the chip may be
    /// writing the same word.
    pub fn set_command_change(&mut self, set: bool) {
        self.command_change = set;
        if set == self.shown_command_change || self.transfer != Transfer::None {
            return;
        }
        let answer = self.answer();
        // A container that is held gets the bit with the release; and should a step arrive between this read and the
        // write, the chip finds the same difference of the handshake bits again in the next MDT.
        if !answer.is_held() {
            self.bus.write_ram(SERVICE_CONTAINER, answer.with_command_change(set).raw_value());
            self.shown_command_change = set;
        }
    }

    /// The step that waits, if one does. Without [`ServicePort::release`] the same step is returned again.
    pub fn pending(&mut self) -> Option<ServiceStep> {
        let answer = self.answer();
        let supervision = Supervision::new_with_raw_value(self.bus.read_ram(SUPERVISION));
        if supervision.protocol_error() {
            self.transfer = Transfer::None;
        }
        if !answer.is_held() {
            if supervision.protocol_error() {
                self.bus.write_ram(SUPERVISION, 0);
                self.point_at_cell(0);
                self.bus.write_ram(SERVICE_CONTAINER, answer.with_element(u3::new(0)).raw_value());
            }
            return None;
        }
        let request = Request::new_with_raw_value(self.bus.read_ram(REQUEST));
        let mut step = ServiceStep {
            element: request.element().value(),
            write: request.write(),
            end: request.end(),
            info: self.bus.read_ram(self.info),
            silent: None,
            new_transfer: true,
            boundary: Boundary::None,
            protocol_error: supervision.protocol_error(),
        };
        let mut sent = false;
        match self.transfer {
            Transfer::Sending { element, first, words } if element == request.element() && !request.write() => {
                step.new_transfer = false;
                self.learn_sent_buffer(answer);
                step.boundary = self.boundary(answer, request, first, words);
                sent = step.boundary != Boundary::SegmentExhausted;
            }
            Transfer::Sent { element } if element == request.element() && !request.write() => {
                step.new_transfer = false;
                step.boundary = Boundary::SegmentExhausted;
            }
            Transfer::Receiving { element, handshake } if element == request.element() && request.write() => {
                step.new_transfer = false;
                // Two flips of the handshake bit since the release: one step was accepted by the chip itself.
                if handshake == request.handshake() {
                    step.silent = Some(self.bus.read_ram(CELL));
                }
            }
            _ => {}
        }
        self.held = Some(Held { request, sent, protocol_error: step.protocol_error });
        Some(step)
    }

    /// Answers the step last returned by [`ServicePort::pending`] and lets the chip go on. Without such a step, nothing happens.
    ///
    /// An answer that does not fit the step (`Send` to a write) is taken as accepted with info word 0.
    pub fn release(&mut self, answer: ServiceAnswer<'_>) {
        let Some(Held { request, sent, protocol_error }) = self.held.take() else { return };
        let element = request.element();
        let read = !request.write() && element != u3::new(0);
        let mut error = false;
        self.transfer = match answer {
            ServiceAnswer::Send { words } if read && !words.is_empty() => {
                let count = self.fill(words);
                if request.end() {
                    Transfer::None
                } else if count == 1 && !sent {
                    // The release itself sends the only word.
                    Transfer::Sent { element }
                } else {
                    Transfer::Sending { element, first: request.handshake() ^ sent, words: count }
                }
            }
            ServiceAnswer::Continue if read && sent => {
                if request.end() {
                    Transfer::None
                } else {
                    Transfer::Sent { element }
                }
            }
            ServiceAnswer::Error { code } => {
                error = true;
                self.point_at_cell(code);
                Transfer::None
            }
            ServiceAnswer::Send { .. } | ServiceAnswer::Continue | ServiceAnswer::Accept { .. } => {
                let info = if let ServiceAnswer::Accept { info } = answer { info } else { 0 };
                self.point_at_cell(info);
                if request.write() && !request.end() && element != u3::new(0) {
                    Transfer::Receiving { element, handshake: request.handshake() }
                } else {
                    Transfer::None
                }
            }
        };
        let under_way = matches!(self.transfer, Transfer::Sending { .. } | Transfer::Receiving { .. });
        if protocol_error {
            self.bus.write_ram(SUPERVISION, 0);
        }
        let word = Answer::DEFAULT
            .with_handshake(request.handshake())
            .with_error(error)
            .with_command_change(self.command_change)
            .with_element(if under_way { element } else { u3::new(0) })
            .with_write(request.write());
        self.bus.write_ram(SERVICE_CONTAINER, word.raw_value());
        self.shown_command_change = self.command_change;
    }

    fn answer(&mut self) -> Answer {
        Answer::new_with_raw_value(self.bus.read_ram(SERVICE_CONTAINER))
    }

    fn boundary(&mut self, answer: Answer, request: Request, first: bool, words: u8) -> Boundary {
        let took_last_word = took_last_word(request.handshake(), first, words);
        match (took_last_word, request.end()) {
            (true, _) => Boundary::SegmentSent,
            (false, false) => Boundary::SegmentExhausted,
            // The end of the element somewhere within the segment, or one word behind it: only a chip that reports
            // the end of the buffer late gets there, and then it shows the flag or a pointer beyond the last word.
            (false, true) => {
                let late = answer.end_of_write_buffer() || answer.end_of_read_buffer() || self.ran_past_segment();
                if late { Boundary::SegmentExhausted } else { Boundary::EndInside }
            }
        }
    }

    fn ran_past_segment(&mut self) -> bool {
        [WRITE_POINTER, READ_POINTER].into_iter().any(|address| {
            let pointer = BufferPointer::new_with_raw_value(self.bus.read_ram(address));
            pointer.present() > pointer.last()
        })
    }

    /// While a segment is sent, the end of one buffer alone is that of the buffer which is sent: the other one is not used, or would end
    /// with it.
    fn learn_sent_buffer(&mut self, answer: Answer) {
        match (answer.end_of_write_buffer(), answer.end_of_read_buffer()) {
            (true, false) => self.sent = Some(Buffer::Write),
            (false, true) => self.sent = Some(Buffer::Read),
            _ => {}
        }
    }

    /// Fills the buffer that is sent, or both alike while that is not known, and returns how many words were taken. The pointers are the same
    /// in both cases: a chip that looks at both of them finds no difference.
    fn fill(&mut self, words: &[u16]) -> u8 {
        let words = words.get(..SEGMENT_WORDS).unwrap_or(words);
        for (buffer, region) in [(Buffer::Write, REGION_A), (Buffer::Read, REGION_B)] {
            if self.sent.is_none_or(|sent| sent == buffer) {
                for (offset, &word) in (u16::from(region)..).zip(words) {
                    self.bus.write_ram(SERVICE_BUFFERS.offset(offset), word);
                }
            }
        }
        // At most SEGMENT_WORDS, and at least one.
        let count = words.len() as u8;
        let last = count.saturating_sub(1);
        self.bus.write_ram(WRITE_POINTER, BufferPointer::span(REGION_A, REGION_A | last).raw_value());
        self.bus.write_ram(READ_POINTER, BufferPointer::span(REGION_B, REGION_B | last).raw_value());
        count
    }

    fn point_at_cell(&mut self, info: u16) {
        self.bus.write_ram(CELL, info);
        let pointer = BufferPointer::span(SHARED_CELL, SHARED_CELL).raw_value();
        self.bus.write_ram(WRITE_POINTER, pointer);
        self.bus.write_ram(READ_POINTER, pointer);
    }
}

const fn info_of(block: &Block) -> RamAddress {
    block.mdt_data.offset(1)
}

/// Whether a step with this handshake bit carried the last word of a segment; every step flips the bit once.
const fn took_last_word(handshake: bool, first: bool, words: u8) -> bool {
    let flips_to_last_word_are_odd = words & 1 == 0;
    (handshake ^ first) == flips_to_last_word_are_odd
}

#[cfg(test)]
mod tests;
