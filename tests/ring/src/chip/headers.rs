//! Walking the chain of telegram headers of a cycle, and what is sent and taken on the way.
//! sercon816.md 6.2, 6.3 and 7.

use super::Chip;
use super::alternatives::{Delivery, ErrorBit, OneShot, Rearm, TelegramErrorFlag, TransmitWithoutMst, WindowSign};
use super::ram::WORDS;
use super::registers::status_0;
use super::slave_service::{OVERLAID, SlaveService};
use crate::time::Nanoseconds;
use crate::wire::{LineError, Transmission};

/// Header word 0: data by DMA, none in RAM.
const DMA: u16 = 1 << 8;
const DOUBLE_BUFFER: u16 = 1 << 9;
const VAL: u16 = 1 << 10;
/// Receive header: take the own address only.
const ACHK: u16 = 1 << 11;
/// Receive header: check the arrival time.
const TCHK: u16 = 1 << 12;
/// Receive header: telegram error (G18).
const RERR: u16 = 1 << 13;
/// Transmit header: send once.
const ONCE: u16 = 1 << 11;
/// Transmit header: send in every cycle.
const CONTINUOUS: u16 = 1 << 12;

/// Container word 0: block length.
const LENGTH: u16 = 0x03FF;
const SVFL: u16 = 1 << 10;
const SCMASTER: u16 = 1 << 14;
const LASTDC: u16 = 1 << 15;

/// Header words: receive headers have the error counter as a fifth word.
const RECEIVE_HEADER: u16 = 5;
const TRANSMIT_HEADER: u16 = 4;
const ERROR_COUNTER: u16 = 4;

/// More headers, or containers of one telegram, than a RAM of 2048 words holds: the chain runs in circles.
const CHAIN_LIMIT: u16 = 512;

#[derive(Copy, Clone, Debug, PartialEq, Eq)]
enum Kind {
    Receive,
    Transmit,
    End,
    Undefined,
}

impl Kind {
    fn of(word: u16) -> Self {
        match word >> 14 {
            0 => Self::Receive,
            1 => Self::Transmit,
            3 => Self::End,
            _ => Self::Undefined,
        }
    }
}

/// The header that the chip stands at.
#[derive(Copy, Clone, Debug)]
struct Current {
    address: u16,
    next: u16,
    kind: Kind,
    /// Transmit: when to send. Receive: when to give up; `None` waits for the telegram that is coming in.
    due: Option<Nanoseconds>,
    /// Receive: first and last count at which a telegram that is checked for time may be recognised.
    window: (i32, i32),
    /// Receive: an error has been counted in this cycle.
    faulty: bool,
}

/// Position in the chain.
#[derive(Default)]
pub(super) struct Walk {
    current: Option<Current>,
    steps: u16,
    /// Receive headers that wait for software to write their word 0 again (G17).
    disarmed: Vec<u16>,
    /// Start of the telegram that is coming in.
    incoming: bool,
}

impl Walk {
    /// When the chip has to act at its header by itself.
    pub(super) fn next_event(&self) -> Option<Nanoseconds> {
        self.current.and_then(|current| current.due)
    }

    /// Software has written a RAM word.
    pub(super) fn on_software_write(&mut self, address: u16) {
        self.disarmed.retain(|&header| header != address);
    }

    /// Forgets the chain until the next MST.
    pub(super) fn stop(&mut self) {
        self.current = None;
    }
}

/// One data container of a telegram.
#[derive(Copy, Clone, Debug)]
struct Container {
    service: Option<Service>,
    length: u16,
    /// Position in the telegram, in words; transmit containers follow each other.
    position: u16,
    /// First data word in RAM, `None` with DMA.
    data: Option<u16>,
}

#[derive(Copy, Clone, Debug)]
struct Service {
    number: usize,
    master: bool,
}

impl Chip {
    /// Goes to the first header of the block in force.
    pub(super) fn start_walk(&mut self, now: Nanoseconds) {
        self.walk.stop();
        self.walk.steps = 0;
        if self.free_running || self.registers.processing_enabled(&self.alternatives) {
            let block = self.registers.block(&self.alternatives);
            self.enter_header(now, self.ram.first_header(block));
        }
    }

    /// Does what is due at the current header; a transmission may start if `may_send`.
    pub(super) fn walk_on_time(&mut self, now: Nanoseconds, may_send: bool) -> Option<Transmission> {
        while let Some(current) = self.walk.current {
            if current.due.is_none_or(|due| due > now) {
                break;
            }
            match current.kind {
                Kind::Transmit => {
                    self.enter_header(now, current.next);
                    if may_send && let Some(transmission) = self.send(current.address) {
                        return Some(transmission);
                    }
                }
                Kind::Receive if self.walk.incoming && self.kind(current.next) != Kind::Transmit => {
                    self.walk.current = Some(Current { due: None, ..current });
                }
                Kind::Receive => self.leave_receive_header(now, current),
                Kind::End | Kind::Undefined => self.walk.stop(),
            }
        }
        None
    }

    /// The opening flag of a telegram has been seen.
    pub(super) fn walk_on_start(&mut self, start: Nanoseconds) {
        self.walk.incoming = true;
        let Some(current) = self.walk.current else {
            return;
        };
        if self.alternatives.delivery == Delivery::Progressive
            && current.kind == Kind::Receive
            && self.is_armed(current.address)
            && self.in_time(current, start)
            && self.ram.get(current.address) & DOUBLE_BUFFER == 0
        {
            self.ram.change(current.address, VAL, 0);
        }
    }

    /// The telegram that was coming in is complete.
    pub(super) fn walk_on_end(&mut self) {
        self.walk.incoming = false;
    }

    /// A telegram other than an MST has come in.
    pub(super) fn walk_on_telegram(&mut self, start: Nanoseconds, now: Nanoseconds, frame: Result<&[u8], LineError>) {
        let Some(current) = self.walk.current else {
            return;
        };
        if current.kind != Kind::Receive {
            return;
        }
        let taken = self.is_armed(current.address) && self.take(current, start, frame);
        if taken {
            self.enter_header(now, current.next);
        } else if current.due.is_none()
            && let Some(current) = self.walk.current
        {
            self.leave_receive_header(now, current);
        }
    }

    /// Stands at the header at `address`, or at the first one behind it that is not already too late.
    fn enter_header(&mut self, now: Nanoseconds, address: u16) {
        self.walk.current = None;
        let Some(base) = self.base else { return };
        let mut address = address % WORDS;
        while self.walk.steps < CHAIN_LIMIT {
            self.walk.steps += 1;
            let kind = self.kind(address);
            let time = i32::from(self.ram.get(address + 1));
            let next = self.ram.get(address + 3) % WORDS;
            let (due, window) = match kind {
                Kind::End | Kind::Undefined => return,
                Kind::Transmit => (base.time_of(time), (0, 0)),
                Kind::Receive => {
                    let (lower, upper) = self.receive_window();
                    let window = (time + lower, time + upper);
                    let own = base.time_of(window.1 + 1) + self.telegram_time_of_a_master(address);
                    let following = base.time_of(i32::from(self.ram.get(next + 1)));
                    let checked = self.ram.get(address) & TCHK != 0;
                    let due = match self.kind(next) {
                        Kind::Receive if checked => own,
                        Kind::Transmit | Kind::End if checked => own.min(following),
                        Kind::Undefined if checked => own,
                        Kind::Undefined => base.time_of(i32::MAX),
                        _ => following,
                    };
                    (due, window)
                }
            };
            if kind == Kind::Receive || due >= now {
                self.walk.current = Some(Current { address, next, kind, due: Some(due), window, faulty: false });
                return;
            }
            address = next;
        }
    }

    fn leave_receive_header(&mut self, now: Nanoseconds, current: Current) {
        if self.is_armed(current.address) && !current.faulty {
            if self.ram.get(current.address) & TCHK != 0 {
                self.count_error(current.address);
            }
            self.report_missing_answer(current.address);
        }
        self.enter_header(now, current.next);
    }

    /// The ring hands a master complete telegrams only, so it waits for one as long as its header says that it may last;
    /// a slave is told of the start and need not wait when nothing has come.
    fn telegram_time_of_a_master(&self, header: u16) -> Nanoseconds {
        if self.registers.repeater_on() {
            return Nanoseconds::ZERO;
        }
        // sercon816.md 5.7: flags, and 9.6 bits at most for each byte of address, data and check sequence.
        let bytes = 3 + 2 * usize::from(self.ram.get(header + 2) & LENGTH);
        self.straps.bit_rate.span(16 + (bytes * 96).div_ceil(10))
    }

    fn kind(&self, address: u16) -> Kind {
        Kind::of(self.ram.get(address))
    }

    fn is_armed(&self, address: u16) -> bool {
        !self.walk.disarmed.contains(&address)
    }

    /// JTRDEL1 and JTRDEL2 as the chip reads them. G26.
    fn receive_window(&self) -> (i32, i32) {
        let (lower, upper) = self.registers.telegram_window();
        match self.alternatives.window_sign {
            WindowSign::Signed => (i32::from(lower as i16), i32::from(upper as i16)),
            WindowSign::Unsigned => (i32::from(lower), i32::from(upper)),
        }
    }

    fn in_time(&self, current: Current, start: Nanoseconds) -> bool {
        let Some(base) = self.base else { return false };
        let count = base.telegram_count(start);
        self.ram.get(current.address) & TCHK == 0 || (current.window.0..=current.window.1).contains(&count)
    }

    /// Takes a telegram for the current receive header; `false` when it is not for it, or not in order.
    fn take(&mut self, current: Current, start: Nanoseconds, frame: Result<&[u8], LineError>) -> bool {
        let header = current.address;
        let word = self.ram.get(header);
        let in_time = self.in_time(current, start);
        let data = match frame {
            Ok([address, _, ..]) if word & ACHK != 0 && u16::from(*address) != word & 0xFF => {
                return false;
            }
            Ok([_, data @ ..]) => data,
            // A damaged telegram says nothing about its address: it counts if it came when ours was due.
            Err(_) | Ok([]) if !in_time => return false,
            Err(_) | Ok([]) => &[],
        };
        if self.alternatives.rearm == Rearm::EachTelegram {
            self.walk.disarmed.push(header);
        }
        let words: Vec<u16> = data.chunks_exact(2).map(|pair| u16::from_le_bytes([pair[0], pair[1]])).collect();
        let complete = frame.is_ok() && data.len() == 2 * usize::from(self.ram.get(header + 2));
        if !complete || !in_time {
            self.reject(current);
            return false;
        }

        let mut word = self.ram.get(header);
        if word & ACHK == 0 {
            let address = frame.map_or(0, |bytes| bytes[0]);
            word = word & 0xFF00 | u16::from(address);
        }
        let double = word & DOUBLE_BUFFER != 0;
        let buffer = if double && word & VAL == 0 { 1 } else { 0 };
        for container in self.containers(header, RECEIVE_HEADER, buffer) {
            self.deliver(container, &words);
        }
        word = if double { word ^ VAL } else { word | VAL };
        if self.alternatives.error_bit == ErrorBit::SetOnError {
            word &= !RERR;
        }
        self.ram.set(header, word);
        true
    }

    /// Copies a container's words out of a telegram and lets its service container make a step.
    fn deliver(&mut self, container: Container, telegram: &[u16]) {
        let position = usize::from(container.position);
        let length = usize::from(container.length);
        let words = telegram.get(position..).unwrap_or(&[]);
        if let Some(data) = container.data {
            for (offset, &word) in (0..).zip(words.iter().take(length)) {
                self.ram.set(data + offset, word);
            }
        }
        let (Some(service), &[control, info, ..]) = (container.service, words) else {
            return;
        };
        let number = service.number;
        let base = self.ram.service_container(number) % WORDS;
        let interrupt = if service.master {
            let timeouts = self.registers.service_timeouts();
            self.master_services[number].on_at(&mut self.ram, base, control, info, timeouts)
        } else {
            self.slave_services[number].on_mdt(&mut self.ram, base, control, info, &self.alternatives)
        };
        if interrupt {
            self.registers.raise_1(1 << number);
        }
    }

    /// A telegram for this header was damaged, too long or short, or came at the wrong time.
    fn reject(&mut self, current: Current) {
        let header = current.address;
        self.walk.current = Some(Current { faulty: true, ..current });
        if !current.faulty {
            self.count_error(header);
        }
        let mut word = self.ram.get(header);
        if word & DOUBLE_BUFFER == 0 {
            word &= !VAL;
        }
        if self.alternatives.error_bit == ErrorBit::SetOnError {
            word |= RERR;
        }
        self.ram.set(header, word);
        for container in self.containers(header, RECEIVE_HEADER, 0) {
            if let Some(service) = container.service.filter(|service| !service.master) {
                let base = self.ram.service_container(service.number) % WORDS;
                SlaveService::on_damaged_mdt(&mut self.ram, base);
            }
        }
        if !current.faulty {
            self.report_missing_answer(header);
        }
    }

    fn count_error(&mut self, header: u16) {
        let counter = header + ERROR_COUNTER;
        self.ram.set(counter, self.ram.get(counter).wrapping_add(1));
        if self.alternatives.telegram_error_flag == TelegramErrorFlag::Bit10 {
            self.registers.raise_0(status_0::TELEGRAM_ERROR);
        }
    }

    /// Tells master service containers that no good AT came.
    fn report_missing_answer(&mut self, header: u16) {
        let timeouts = self.registers.service_timeouts();
        for container in self.containers(header, RECEIVE_HEADER, 0) {
            if let Some(service) = container.service.filter(|service| service.master) {
                let base = self.ram.service_container(service.number) % WORDS;
                let missing = &mut self.master_services[service.number];
                if missing.on_missing_at(&mut self.ram, base, timeouts) {
                    self.registers.raise_1(1 << service.number);
                }
            }
        }
    }

    /// The telegram of a transmit header, if it is to be sent.
    fn send(&mut self, header: u16) -> Option<Transmission> {
        let word = self.ram.get(header);
        let suppressed =
            !self.cycle_has_mst && self.alternatives.transmit_without_mst == TransmitWithoutMst::Suppressed;
        if suppressed || word & (ONCE | CONTINUOUS) == 0 {
            return None;
        }
        let length = usize::from(self.ram.get(header + 2));
        let buffer = u16::from(word & DOUBLE_BUFFER != 0 && word & VAL != 0);
        let mut words = Vec::with_capacity(length);
        for container in self.containers(header, TRANSMIT_HEADER, buffer) {
            let start = words.len();
            for offset in 0..container.length {
                words.push(container.data.map_or(0, |data| self.ram.get(data + offset)));
            }
            if let (Some(service), Some([first, second])) = (container.service, words.get_mut(start..start + 2)) {
                let number = service.number;
                let base = self.ram.service_container(number) % WORDS;
                if service.master {
                    let (bits, info) = self.master_services[number].on_sending(&self.ram, base);
                    *first = *first & !0x003F | bits;
                    *second = info;
                } else {
                    *first = *first & !OVERLAID | SlaveService::at_bits(&self.ram, base);
                    *second = self.slave_services[number].at_info();
                }
            }
        }
        words.resize(length, 0);
        if word & ONCE != 0 && self.alternatives.one_shot == OneShot::AutoClear {
            self.ram.change(header, ONCE, 0);
        }
        let mut bytes = vec![word as u8];
        bytes.extend(words.into_iter().flat_map(u16::to_le_bytes));
        Some(Transmission { bytes })
    }

    /// The data containers behind a header; `buffer` selects one of two.
    fn containers(&self, header: u16, header_length: u16, buffer: u16) -> Vec<Container> {
        let header_word = self.ram.get(header);
        let receive = header_length == RECEIVE_HEADER;
        let buffers = if header_word & DMA != 0 {
            0
        } else if header_word & DOUBLE_BUFFER != 0 {
            2
        } else {
            1
        };
        let mut containers = Vec::new();
        let mut address = header + header_length;
        let mut position = 0;
        while containers.len() < usize::from(CHAIN_LIMIT) {
            address %= WORDS;
            let word = self.ram.get(address);
            let length = word & LENGTH;
            let words_before_data = if receive { 2 } else { 1 };
            if receive {
                position = self.ram.get(address + 1);
            }
            let data = address + words_before_data;
            containers.push(Container {
                service: (word & SVFL != 0)
                    .then_some(Service { number: usize::from(word >> 11 & 7), master: word & SCMASTER != 0 }),
                length,
                position,
                data: (buffers > 0).then_some(data + buffer * length),
            });
            if word & LASTDC != 0 {
                break;
            }
            address = data + buffers * length;
        }
        containers
    }
}
