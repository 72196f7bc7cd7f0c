//! What a test sees of a drive in QEMU beside the fibre, and what it does to it: pins, the lines of the chip, the processor itself.

use std::cell::RefCell;
use std::collections::VecDeque;
use std::fmt;
use std::rc::Rc;

use emulator::{EmulatorError, Guest, Hold, StopAt, Stopped};
use ring::Nanoseconds;
use ring::chip::InterruptPin;

/// What is done when the product stops, see [`Guest::stop_at`].
pub type OnStop = Box<dyn FnMut(&mut Guest, Stopped) -> Result<(), EmulatorError>>;

/// A drive that runs in QEMU, as a test holds it.
#[derive(Clone)]
pub struct Elf {
    /// The running product. Not to be borrowed while the world runs.
    pub guest: Rc<RefCell<Guest>>,
    /// What happened at its pins.
    pub tape: Rc<RefCell<Tape>>,
    /// The lines between the chip and the processor.
    pub lines: Rc<RefCell<Lines>>,
    /// What is done when it stops.
    pub on_stop: Rc<RefCell<Option<OnStop>>>,
}

impl Elf {
    pub(crate) fn new(guest: Guest) -> Self {
        Self {
            guest: Rc::new(RefCell::new(guest)),
            tape: Rc::default(),
            lines: Rc::default(),
            on_stop: Rc::new(RefCell::new(None)),
        }
    }
}

impl Elf {
    /// Holds the handler of the current loop at its first instruction for these spans, one cycle after the other, from the next one on;
    /// `done` is called behind the last.
    ///
    /// # Errors
    /// The end of QEMU.
    pub fn hold_cycles(&self, spans: &[Nanoseconds], mut done: impl FnMut() + 'static) -> Result<(), EmulatorError> {
        const END_OF_CONVERSION: u8 = 18;
        let guest = &mut *self.guest.borrow_mut();
        let stop = StopAt { address: guest.handler_of(END_OF_CONVERSION)?, behind: 0 };
        let mut spans = VecDeque::from(spans.to_vec());
        *self.on_stop.borrow_mut() = Some(Box::new(move |guest, stopped| {
            match spans.pop_front() {
                Some(span) => guest.hold(Hold::Until(stopped.now + span)),
                None => return Ok(()),
            }
            if spans.is_empty() {
                done();
                return Ok(());
            }
            guest.stop_at(stop)
        }));
        guest.stop_at(stop)
    }
}

impl fmt::Debug for Elf {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.debug_struct("Elf").field("tape", &self.tape).field("lines", &self.lines).finish_non_exhaustive()
    }
}

/// What happened at the pins of a processor, in the order of time.
#[derive(Clone, Debug, Default)]
pub struct Tape {
    /// Edges of the chip's lines; nothing is kept while this is `None`.
    pub edges: Option<Vec<LineEdge>>,
    /// The bridge has begun (`true`) or ceased to switch.
    pub bridge: Vec<(Nanoseconds, bool)>,
    /// The brake's coil was energised (`true`) or left without current.
    pub coil: Vec<(Nanoseconds, bool)>,
    /// The resistor of the brake chopper was switched on or off.
    pub chopper: Vec<(Nanoseconds, bool)>,
}

/// An edge of an interrupt line of the chip.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LineEdge {
    /// When.
    pub time: Nanoseconds,
    /// Which line.
    pub line: InterruptPin,
    /// The level behind it.
    pub level: bool,
    /// Register 05H then.
    pub status: u16,
    /// Where the shaft was, as the encoder counts.
    pub count: u32,
}

impl Tape {
    pub(crate) fn note(events: &mut Vec<(Nanoseconds, bool)>, at: Nanoseconds, on: bool) {
        if events.last().map_or(on, |(_, before)| *before != on) {
            events.push((at, on));
        }
    }
}

/// The two lines between the chip and the processor, and what they pick up on the way.
#[derive(Clone, Debug, Default)]
pub struct Lines {
    /// A line rings so long after each of its edges: it leaves its level once more for [`Lines::WIDTH`].
    pub rings_after: Option<Nanoseconds>,
    /// When which line leaves or takes its level, in the order of time.
    toggles: VecDeque<(Nanoseconds, InterruptPin)>,
    turned: [bool; 2],
}

impl Lines {
    /// Half of what the filters of the board keep out.
    pub const WIDTH: Nanoseconds = Nanoseconds(50);

    /// The chip has moved a line.
    pub(crate) fn edge(&mut self, at: Nanoseconds, line: InterruptPin) {
        let Some(after) = self.rings_after else { return };
        for time in [at + after, at + after + Self::WIDTH] {
            let place = self.toggles.partition_point(|(before, _)| *before <= time);
            self.toggles.insert(place, (time, line));
        }
    }

    /// The next edge that the chip knows nothing of.
    pub(crate) fn next(&self) -> Option<Nanoseconds> {
        self.toggles.front().map(|(time, _)| *time)
    }

    /// Lets happen what is due.
    pub(crate) fn advance(&mut self, now: Nanoseconds) {
        let due = self.toggles.partition_point(|(time, _)| *time <= now);
        for (_, line) in self.toggles.drain(..due) {
            let turned = &mut self.turned[usize::from(line == InterruptPin::Int1)];
            *turned = !*turned;
        }
    }

    /// The levels at the processor of those at the chip.
    pub(crate) const fn levels(&self, (int0, int1): (bool, bool)) -> (bool, bool) {
        (int0 != self.turned[0], int1 != self.turned[1])
    }
}
