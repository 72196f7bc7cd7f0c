//! A master that does what it is told, however unwise: it keeps its switches, jumps, wraps, and never waits for a drive.
//!
//! The AT of a cycle comes before its MDT, so a step of the service channel takes one cycle.

use drive::DICTIONARY;
use ring::Nanoseconds;
use ring::service_client::{AtWords, Finished, Pace, Request, ServiceClient, control, status};
use ring::station::Master;
use ring::wire::{BROADCAST, BitRate, LineError, Transmission, encode};

use crate::coverage::Wire;

/// Cycle of CP0 to CP2, the shortest that a master may have (sercos2.md 2.1).
const START_UP_CYCLE: Nanoseconds = Nanoseconds::from_millis(1);
/// When the MDT starts in CP1 and CP2: in the middle of its window of 500 to 700 us (sercos2.md 2.1).
const START_UP_MDT: Nanoseconds = Nanoseconds::from_microseconds(600);
/// An MST never has more line bits than this; the phase is decided so long before its end.
const MOST_MST_BITS: usize = 56;
/// Least bytes of an AT: address, status and info.
const SHORTEST_AT: usize = 5;

const POSITION_COMMAND: u16 = 47;
/// Target position.
const TARGET: u16 = 258;
const POSITION_FEEDBACK: u16 = 51;

/// What the cyclic telegrams of CP3 and CP4 look like.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Layout {
    /// S-0-0002 in us.
    pub(crate) cycle: u16,
    /// S-0-0001 as a multiple of it.
    pub(crate) control_cycles: u16,
    /// S-0-0089 in us.
    pub(crate) t2: u16,
    /// Data of the AT.
    pub(crate) at: Vec<u16>,
    /// Data of the MDT.
    pub(crate) mdt: Vec<u16>,
}

/// One command value of the MDT.
#[derive(Clone, Debug)]
struct Field {
    idn: u16,
    bytes: usize,
    /// In 2^-16 increments, so that slow ramps move.
    value: i64,
    per_control_cycle: i64,
}

/// An AT of CP3 or CP4, or the first two words of one before.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct At {
    pub(crate) status: u16,
    pub(crate) info: u16,
    data: Vec<u8>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Act {
    Decide,
    Mst,
    Mdt,
}

/// The master of a life.
#[derive(Debug)]
pub(crate) struct Stubborn {
    rate: BitRate,
    address: u8,
    mark: Nanoseconds,
    next: (Nanoseconds, Act),
    /// What the next MST shows.
    pub(crate) phase: u8,
    sent_phase: u8,
    cycles: u64,
    layout: Layout,
    client: ServiceClient,
    switches: u16,
    mode: u16,
    blip: Option<(u16, u8)>,
    align: bool,
    wraps_at: Option<i64>,
    fields: Vec<Field>,
    last_mdt: Vec<u8>,
    at: Option<At>,
    last_at: Option<At>,
    /// Cycles in a row without an AT.
    silent: u32,
    /// S-0-0103 of an axis with a modulo, and the first S-0-0051 outside.
    modulo: Option<i64>,
    outside: Option<i64>,
    /// Everything that came back, in one number.
    hash: u64,
    wire: Wire,
}

/// Bits 15, 14, 13 of the control word from a number of three bits.
const fn switches(bits: u8) -> u16 {
    (bits as u16 & 7) << 13
}

/// Bits 11, 9, 8 of the control word from a number of three bits.
const fn mode_bits(bits: u8) -> u16 {
    let bits = bits as u16;
    (bits & 3) << 8 | (bits & 4) << 9
}

impl Stubborn {
    pub(crate) fn new(rate: BitRate, address: u8) -> Self {
        let mark = START_UP_CYCLE;
        Self {
            rate,
            address,
            mark,
            next: (mark - rate.span(MOST_MST_BITS), Act::Decide),
            phase: 0,
            sent_phase: 0,
            cycles: 0,
            layout: Layout::default(),
            client: ServiceClient::new(true, Pace::FASTEST),
            switches: 0,
            mode: 0,
            blip: None,
            align: true,
            wraps_at: None,
            fields: Vec::new(),
            last_mdt: Vec::new(),
            at: None,
            last_at: None,
            silent: 0,
            modulo: None,
            outside: None,
            hash: 0xCBF2_9CE4_8422_2325,
            wire: Wire::default(),
        }
    }

    /// The service channel as it is when a master begins with CP1.
    pub(crate) fn open_channel(&mut self) {
        self.client = ServiceClient::new(true, Pace::FASTEST);
    }

    pub(crate) fn set_layout(&mut self, layout: Layout) {
        self.fields = layout.mdt.iter().map(|&idn| self.field(idn)).collect();
        self.layout = layout;
    }

    /// A field keeps its value over a run-up.
    fn field(&self, idn: u16) -> Field {
        let bytes = bytes_of(idn);
        let before = self.fields.iter().find(|field| field.idn == idn).cloned();
        before.unwrap_or(Field { idn, bytes, value: 0, per_control_cycle: 0 })
    }

    /// The axis has this modulo; its commands wrap in it, or not.
    pub(crate) fn wrap_at(&mut self, modulo: Option<i64>, wraps: bool) {
        self.modulo = modulo;
        self.wraps_at = modulo.filter(|_| wraps);
    }

    /// The first S-0-0051 that was not within the modulo.
    pub(crate) const fn outside(&self) -> Option<i64> {
        self.outside
    }

    pub(crate) fn switch(&mut self, bits: u8) {
        self.switches = switches(bits);
        self.blip = None;
    }

    pub(crate) fn take_bit_15_back(&mut self) {
        self.switches &= !control::ON;
        self.blip = None;
    }

    pub(crate) fn blip(&mut self, bits: u8, cycles: u8) {
        self.blip = Some((switches(bits), cycles));
    }

    pub(crate) fn choose_mode(&mut self, bits: u8) {
        self.mode = mode_bits(bits);
    }

    pub(crate) fn align(&mut self, align: bool) {
        self.align = align;
    }

    pub(crate) fn set(&mut self, idn: u16, value: i64) {
        self.change(idn, |field| {
            field.value = value << 16;
            field.per_control_cycle = 0;
        });
    }

    pub(crate) fn jump(&mut self, idn: u16, by: i64) {
        self.change(idn, |field| field.value = field.value.wrapping_add(by << 16));
    }

    pub(crate) fn ramp(&mut self, idn: u16, per_second: i64) {
        let microseconds = i128::from(self.layout.cycle) * i128::from(self.layout.control_cycles.max(1));
        let per_control_cycle = (i128::from(per_second) << 16) * microseconds / 1_000_000;
        self.change(idn, |field| field.per_control_cycle = per_control_cycle as i64);
    }

    /// All command values as a master has them that wants peace.
    pub(crate) fn calm(&mut self) {
        self.switches = 0;
        self.mode = 0;
        self.blip = None;
        self.align = true;
        for field in &mut self.fields {
            field.per_control_cycle = 0;
            if !matches!(field.idn, POSITION_COMMAND | TARGET) {
                field.value = 0;
            }
        }
    }

    fn change(&mut self, idn: u16, change: impl FnOnce(&mut Field)) {
        if let Some(field) = self.fields.iter_mut().find(|field| field.idn == idn) {
            change(field);
        }
    }

    pub(crate) fn ask(&mut self, request: Request) {
        self.client.request(request);
    }

    /// Takes back what it has not begun to ask; how many requests.
    pub(crate) fn take_back(&mut self) -> usize {
        self.client.take_back()
    }

    pub(crate) fn answer(&mut self) -> Option<Finished> {
        self.client.take_finished()
    }

    pub(crate) fn is_idle(&self) -> bool {
        self.client.is_idle()
    }

    /// The last AT, if the last cycle had one.
    pub(crate) fn at(&self) -> Option<&At> {
        self.last_at.as_ref()
    }

    pub(crate) const fn silent(&self) -> u32 {
        self.silent
    }

    pub(crate) const fn cycles(&self) -> u64 {
        self.cycles
    }

    /// The phase that the last MST showed.
    pub(crate) const fn sent_phase(&self) -> u8 {
        self.sent_phase
    }

    /// End of the MST of this cycle and the time to the next.
    pub(crate) fn cycle_time(&self) -> Nanoseconds {
        if self.is_cyclic() { Nanoseconds::from_microseconds(self.layout.cycle.into()) } else { START_UP_CYCLE }
    }

    pub(crate) const fn hash(&self) -> u64 {
        self.hash
    }

    pub(crate) const fn wire(&self) -> &Wire {
        &self.wire
    }

    const fn is_cyclic(&self) -> bool {
        matches!(self.sent_phase, 3 | 4)
    }

    fn mst(&self) -> [u8; 2] {
        [BROADCAST, self.sent_phase]
    }

    fn decide_next(&mut self) {
        self.mark += self.cycle_time();
        self.next = (self.mark - self.rate.span(MOST_MST_BITS), Act::Decide);
    }

    fn mdt(&mut self) -> Vec<u8> {
        let at = self.at.take();
        match &at {
            Some(at) => {
                self.silent = 0;
                self.wire.see(self.sent_phase, at.status);
            }
            None => self.silent += 1,
        }
        let words = at.as_ref().map(|at| AtWords { status: at.status, info: at.info });
        let service = self.client.poll(words);
        let mut bytes = Vec::with_capacity(40);
        if !self.is_cyclic() {
            bytes.push(self.address);
            bytes.extend(service.control.to_le_bytes());
            bytes.extend(service.info.to_le_bytes());
        } else {
            self.move_on(at.as_ref());
            let switches = match &mut self.blip {
                Some((switches, cycles)) if *cycles > 0 => {
                    *cycles -= 1;
                    *switches
                }
                _ => self.switches,
            };
            bytes.push(BROADCAST);
            bytes.extend((switches | self.mode | service.control).to_le_bytes());
            bytes.extend(service.info.to_le_bytes());
            for field in &self.fields {
                bytes.extend_from_slice(&(field.value >> 16).to_le_bytes()[..field.bytes]);
            }
        }
        self.last_at = at;
        bytes
    }

    /// New command values once in S-0-0001.
    fn move_on(&mut self, at: Option<&At>) {
        let follows = at.is_some_and(|at| at.status & status::FOLLOWS != 0);
        let feedback = at.and_then(|at| self.layout.number(POSITION_FEEDBACK, &at.data));
        if let (4, Some(modulo), Some(feedback)) = (self.sent_phase, self.modulo, feedback)
            && !(0..modulo).contains(&feedback)
        {
            self.outside.get_or_insert(feedback);
        }
        let due = self.cycles.is_multiple_of(u64::from(self.layout.control_cycles.max(1)));
        let (align, wraps_at) = (self.align, self.wraps_at);
        for field in &mut self.fields {
            let is_position = matches!(field.idn, POSITION_COMMAND | TARGET);
            if is_position && align && !follows {
                if let Some(feedback) = feedback {
                    field.value = feedback << 16;
                }
            } else if due {
                field.value = field.value.wrapping_add(field.per_control_cycle);
            }
            if field.idn == POSITION_COMMAND
                && let Some(modulo) = wraps_at
            {
                field.value = field.value.rem_euclid(modulo.max(1) << 16);
            }
        }
    }

    fn take_note(&mut self, bytes: &[u8]) {
        for byte in bytes {
            self.hash = (self.hash ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01B3);
        }
    }
}

impl Layout {
    /// A value of the AT, with its sign.
    fn number(&self, idn: u16, data: &[u8]) -> Option<i64> {
        let mut begin = 0;
        for &other in &self.at {
            let bytes = bytes_of(other);
            if other == idn {
                let field = data.get(begin..begin + bytes)?;
                return Some(match *field {
                    [a, b] => i64::from(i16::from_le_bytes([a, b])),
                    [a, b, c, d] => i64::from(i32::from_le_bytes([a, b, c, d])),
                    _ => return None,
                });
            }
            begin += bytes;
        }
        None
    }
}

/// Length of a cyclic data block.
pub(crate) fn bytes_of(idn: u16) -> usize {
    DICTIONARY.find(sercos::Idn(idn)).and_then(|block| block.fixed_bytes()).map_or(0, usize::from)
}

impl Master for Stubborn {
    fn next_transmission(&self) -> Option<Nanoseconds> {
        Some(self.next.0)
    }

    fn transmit(&mut self, _now: Nanoseconds) -> Option<Transmission> {
        match self.next.1 {
            Act::Decide => {
                self.sent_phase = self.phase;
                let bits = encode(&self.mst()).len();
                self.next = (self.mark - self.rate.span(bits), Act::Mst);
                None
            }
            Act::Mst => {
                self.cycles += 1;
                self.last_mdt.clear();
                let after = match self.sent_phase {
                    3 | 4 => Nanoseconds::from_microseconds(self.layout.t2.into()),
                    _ => START_UP_MDT,
                };
                if self.sent_phase == 0 {
                    self.last_at = None;
                    self.decide_next();
                } else {
                    self.next = (self.mark + after, Act::Mdt);
                }
                Some(Transmission { bytes: vec![BROADCAST, self.sent_phase] })
            }
            Act::Mdt => {
                let bytes = self.mdt();
                self.last_mdt.clone_from(&bytes);
                self.decide_next();
                Some(Transmission { bytes })
            }
        }
    }

    fn receive(&mut self, _start: Nanoseconds, _end: Nanoseconds, frame: Result<&[u8], LineError>) {
        let Ok(bytes) = frame else {
            self.take_note(&[0xFF]);
            return;
        };
        if bytes.len() < SHORTEST_AT || bytes[0] != self.address || bytes == self.last_mdt {
            return;
        }
        self.take_note(bytes);
        let word = |index: usize| u16::from_le_bytes([bytes[index], bytes[index + 1]]);
        self.at = Some(At { status: word(1), info: word(3), data: bytes[SHORTEST_AT..].to_vec() });
    }
}
