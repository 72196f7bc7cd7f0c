//! The ring controller's two interrupt lines, and what each event starts.

use sercon816::uncertain::PHASE_RECEIVED_BITS;
use sercon816::{Bus, Discovery, Events, Observation, Register, TimerMap};
use sercos::Phase;

use crate::hardware::{Hardware, InterruptLine, LOOP_PERIOD_MICROSECONDS};
use crate::motion::Motion;
use crate::tasks::Tasks;

/// No MST carries this byte: the first one received is a change.
const NO_PHASE: u8 = 0xFF;

/// Reads and acknowledges the chip's interrupts and sorts them into tasks.
///
/// Both lines are served alike, because which source drives which line is one of the chip's unknowns (G5). Until the chip
/// has shown which timer raises which bit (G4, G11), [`RingInterrupts::poll`] looks at it in every loop tick as well.
#[derive(Debug)]
pub struct RingInterrupts<B> {
    chip: sercon816::Interrupts<B>,
    bus: B,
    discovery: Discovery,
    time_us: u32,
    events: u8,
    interrupted: bool,
    interrupts_arrive: bool,
    learning: bool,
    phase_byte: u8,
    /// The line of all events but t4, once one of them has come.
    common_line: Option<InterruptLine>,
}

impl<B: Bus + Clone> RingInterrupts<B> {
    /// A handler that knows nothing of the chip yet.
    pub fn new(bus: B) -> Self {
        Self {
            chip: sercon816::Interrupts::new(bus.clone()),
            bus,
            discovery: Discovery::new(),
            time_us: 0,
            events: 0,
            interrupted: false,
            interrupts_arrive: false,
            learning: true,
            phase_byte: NO_PHASE,
            common_line: None,
        }
    }

    /// Enables the chip's interrupts, once it is initialised.
    pub(crate) fn enable(&mut self) {
        self.chip.enable();
    }

    /// Task of an interrupt line: takes and acknowledges all events, and of t3 and t4 what the hardware has latched at the edge.
    ///
    /// The latch comes first, because acknowledging makes another edge on the line. That one starts the task once more, which finds nothing.
    /// 3 to 8 bus accesses once the chip is learned, up to 17 before.
    #[inline]
    pub fn take<H: Hardware>(&mut self, line: InterruptLine, motion: &mut Motion<B, H>) -> Tasks {
        self.interrupted = true;
        let common_line = self.common_line.unwrap_or(line);
        let events = self.chip.take(|seen| {
            if seen.command_valid {
                let edge = edge_of(common_line, line, motion);
                motion.take_edge(edge);
            }
            if seen.capture_feedback {
                let edge = edge_of(common_line.other(), line, motion);
                motion.take_latch(edge);
            }
        });
        let Some(events) = events else { return Tasks::empty() };
        if self.learning {
            // t4 is not set before CP3, so that this is the line of the others.
            self.common_line = Some(line);
        }
        self.sort(events)
    }

    /// [`RingInterrupts::poll`] still has something to do. Once it has not, it never has again.
    pub fn need_polling(&self) -> bool {
        // Interrupts may arrive later than the learning ends: only then are the conditions that nobody waits for taken off the lines.
        self.learning || !self.interrupts_arrive || !self.chip.errors_are_masked()
    }

    /// In every tick of the loop timer, while [`RingInterrupts::need_polling`]: learns the chip's timers in CP0, and stands in for interrupts that
    /// do not arrive.
    ///
    /// Two bus accesses while there is something to learn, one when that is over.
    pub fn poll<H: Hardware>(&mut self, motion: &mut Motion<B, H>) -> Tasks {
        self.time_us = self.time_us.wrapping_add(u32::from(LOOP_PERIOD_MICROSECONDS));
        self.interrupts_arrive |= self.interrupted;
        if !self.learning && self.interrupts_arrive {
            self.chip.mask_errors();
            return Tasks::empty();
        }
        let events = self.chip.take(|_| {}).unwrap_or_default();
        if events.capture_feedback {
            motion.latch_now();
        }
        let work = self.sort(events);
        let mut orders = self.discovery.tick(Observation {
            time_us: self.time_us,
            events: self.events,
            polled: !events.is_empty(),
            interrupted: self.interrupted,
        });
        self.events = 0;
        self.interrupted = false;
        if !self.learning {
            orders.arm = None;
            orders.found = None;
        }
        self.learning &= !self.discovery.is_done();
        self.chip.carry_out(&orders);
        work
    }

    /// The timers to be programmed for a phase, `None` while the chip is still being learned in CP0 to CP2.
    ///
    /// CP3 and CP4 end the learning: what is not known by then is assumed.
    pub(crate) fn timers_for(&mut self, phase: Phase) -> Option<TimerMap> {
        if phase >= Phase::Cp3 {
            self.learning = false;
        }
        (!self.learning).then(|| self.chip.timers())
    }

    fn sort(&mut self, events: Events) -> Tasks {
        self.events |= events.raw;
        let mut work = Tasks::empty();
        work.set(Tasks::COMMAND_VALID, events.command_valid);
        work.set(Tasks::CAPTURE_FEEDBACK, events.capture_feedback);
        work.set(Tasks::SERVICE_CHANNEL, events.service_channel);
        // Only an event of a running cycle proves that an MST has been received and 0BH means anything.
        let in_cycle = events.cycle || events.command_valid || (self.learning && events.raw != 0);
        if in_cycle && self.phase_changed() {
            work |= Tasks::PHASE_CHANGE;
        }
        work
    }

    fn phase_changed(&mut self) -> bool {
        let received = (self.bus.read_register(Register::PHASE_RECEIVED) & PHASE_RECEIVED_BITS) as u8;
        let changed = received != self.phase_byte;
        self.phase_byte = received;
        changed
    }
}

/// The line whose edge belongs to an event of the line `own` that is found while `handled` is served.
///
/// It is another one than `handled` when the event came between that line's edge and the reading of the status: then `own` waits to be served.
/// On a chip that does not route t4 apart, it never waits.
#[inline(always)]
fn edge_of<B: Bus + Clone, H: Hardware>(
    own: InterruptLine,
    handled: InterruptLine,
    motion: &mut Motion<B, H>,
) -> InterruptLine {
    if own != handled && motion.edge_waits(own) { own } else { handled }
}
