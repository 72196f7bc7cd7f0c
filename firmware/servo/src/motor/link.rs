//! Between the current loop and the tasks below it: data without locks.
//!
//! The current loop interrupts everything else and is interrupted by nothing. Whatever it reads or writes here is done before the other
//! side gets on, so two rules suffice on a single core:
//!
//! * Downwards ([`Mailbox`]): the lower side fills the message that is not in use, then switches over with one store. The current loop never
//!   sees half of it, and reads of it what it needs, where it lies.
//! * Upwards ([`Report`]): the current loop writes words; the lower side reads each of them whole. What must belong together is written only
//!   once in a tick ([`CycleReport`]): the first cycle's readings stand for a tick from then on, which is when the lower side is started, and
//!   with them the count of the cycle before. The second cycle's readings come half a tick later, maybe before a control loop that was held up
//!   has begun: they are for the oscilloscope only.

use core::sync::atomic::{AtomicU32, Ordering, compiler_fence};

use super::settings::CurrentSettings;
use crate::current::protection::Protection;
use crate::current::settings::CurrentLoopSettings;
use crate::current::shared::{SharedCommand, SharedReadings};
use crate::monitor::chopper::ChopperLevels;

/// The words of both directions; one for each drive.
#[derive(Debug)]
pub struct CurrentLink {
    pub(crate) order: Mailbox<SharedOrder>,
    pub(crate) settings: Mailbox<SharedSettings>,
    /// [`ChopperLevels`](crate::monitor::ChopperLevels).
    pub(crate) chopper: AtomicU32,
    pub(crate) report: Report,
}

impl CurrentLink {
    /// Nothing commanded, nothing reported.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            order: Mailbox::new([const { SharedOrder::new() }; 2]),
            settings: Mailbox::new([const { SharedSettings::new() }; 2]),
            chopper: AtomicU32::new(ChopperLevels::NEVER.to_word()),
            report: Report::new(),
        }
    }
}

impl Default for CurrentLink {
    fn default() -> Self {
        Self::new()
    }
}

/// A message from a lower to a higher priority.
#[derive(Debug)]
pub(crate) struct Mailbox<T> {
    messages: [T; 2],
    /// How many messages were sent; the last bit says which one is in use.
    sent: AtomicU32,
}

impl<T> Mailbox<T> {
    const fn new(messages: [T; 2]) -> Self {
        Self { messages, sent: AtomicU32::new(0) }
    }

    /// Sends a message, which `fill` writes. From one place only, of lower priority than the reader.
    #[inline]
    pub(crate) fn send(&self, fill: impl FnOnce(&T)) {
        let sent = self.sent.load(Ordering::Relaxed).wrapping_add(1);
        fill(self.message(sent));
        // One core: it is enough that the compiler keeps the order.
        compiler_fence(Ordering::SeqCst);
        self.sent.store(sent, Ordering::Relaxed);
    }

    /// How many messages were sent.
    #[inline]
    pub(crate) fn sent(&self) -> u32 {
        self.sent.load(Ordering::Relaxed)
    }

    /// The last message. It stands still until the one after it has been sent, but for single words that the sender may exchange.
    #[inline]
    pub(crate) fn last(&self) -> &T {
        self.message(self.sent())
    }

    #[inline]
    fn message(&self, number: u32) -> &T {
        let [even, _] = &self.messages;
        self.messages.get((number & 1) as usize).unwrap_or(even)
    }
}

/// What the tasks of the loop tick ask of the current loop.
#[derive(Debug)]
pub(crate) struct SharedOrder {
    /// Reference, angle, feed-forward, bus.
    pub(crate) command: SharedCommand,
    pub(crate) on: AtomicU32,
    pub(crate) trim: AtomicU32,
}

impl SharedOrder {
    pub(crate) const fn new() -> Self {
        Self { command: SharedCommand::new(), on: AtomicU32::new(0), trim: AtomicU32::new(0) }
    }

    /// * `on`: current flows as commanded; otherwise the bridge is off and the current sensors find their zero.
    /// * `trim`: counts by which the next loop tick is to be longer.
    #[inline]
    pub(crate) fn set(&self, on: bool, trim: i16) {
        set(&self.on, on.into());
        set(&self.trim, i32::from(trim).cast_unsigned());
    }
}

/// [`CurrentSettings`] in the mailbox.
#[derive(Debug)]
pub(crate) struct SharedSettings([AtomicU32; 12]);

impl SharedSettings {
    pub(crate) const fn new() -> Self {
        Self([const { AtomicU32::new(0) }; 12])
    }

    pub(crate) fn set(&self, settings: &CurrentSettings) {
        let [alpha, beta, proportional, integral, middle, first, second, third] = settings.current_loop.to_words();
        let [current, sum, bus, increments] = settings.protection.to_words();
        let words = [alpha, beta, proportional, integral, middle, first, second, third, current, sum, bus, increments];
        for (place, word) in self.0.iter().zip(words) {
            set(place, word);
        }
    }

    pub(crate) fn get(&self) -> CurrentSettings {
        let words = self.0.each_ref().map(get);
        let [alpha, beta, proportional, integral, middle, first, second, third, protection @ ..] = words;
        let current_loop = [alpha, beta, proportional, integral, middle, first, second, third];
        CurrentSettings {
            current_loop: CurrentLoopSettings::from_words(current_loop),
            protection: Protection::from_words(protection),
        }
    }
}

/// What the current loop tells.
#[derive(Debug)]
pub(crate) struct Report {
    /// What the cycles of a tick have read, the first of them last.
    cycles: [CycleReport; 2],
    /// Heat sink (low half) and motor temperature in counts.
    pub(crate) temperatures: AtomicU32,
    /// [`Trip::code`](crate::current::Trip::code), 0: none.
    pub(crate) trip: AtomicU32,
    /// 1: the zero of the current sensors is known.
    pub(crate) calibrated: AtomicU32,
    /// Cycles that came too late, since the start.
    pub(crate) late: AtomicU32,
    /// Cycles with the resistor of the chopper on, since the start.
    pub(crate) chopped: AtomicU32,
    /// How often the last three have changed.
    changes: AtomicU32,
}

impl Report {
    const fn new() -> Self {
        Self {
            cycles: [const { CycleReport::new() }; 2],
            temperatures: AtomicU32::new(0),
            trip: AtomicU32::new(0),
            calibrated: AtomicU32::new(0),
            late: AtomicU32::new(0),
            chopped: AtomicU32::new(0),
            changes: AtomicU32::new(0),
        }
    }

    /// Sets one of the words that seldom change.
    pub(crate) fn tell(&self, word: &AtomicU32, value: u32) {
        set(word, value);
        set(&self.changes, self.changes().wrapping_add(1));
    }

    /// How often one of the words has been told. Looked at before them, it says that they are worth another look.
    #[inline]
    pub(crate) fn changes(&self) -> u32 {
        get(&self.changes)
    }

    /// What the first or the second cycle of a tick has read.
    #[inline]
    pub(crate) fn cycle(&self, first: bool) -> &CycleReport {
        let [second, of_the_first] = &self.cycles;
        if first { of_the_first } else { second }
    }
}

/// Readings of one cycle of the current loop. As long as a power of two, so that the choice of one is a shift and an addition.
#[derive(Debug)]
#[repr(align(64))]
pub(crate) struct CycleReport {
    /// Phase currents, angle, and what the loop made of them.
    pub(crate) readings: SharedReadings,
    /// Bus voltage in counts.
    pub(crate) bus: AtomicU32,
    /// Encoder count.
    pub(crate) count: AtomicU32,
    /// Encoder count of the cycle before.
    pub(crate) count_before: AtomicU32,
}

impl CycleReport {
    const fn new() -> Self {
        Self {
            readings: SharedReadings::new(),
            bus: AtomicU32::new(0),
            count: AtomicU32::new(0),
            count_before: AtomicU32::new(0),
        }
    }
}

/// A word of the report.
#[inline]
pub(crate) fn get(word: &AtomicU32) -> u32 {
    word.load(Ordering::Relaxed)
}

/// Sets a word of the report.
#[inline]
pub(crate) fn set(word: &AtomicU32, value: u32) {
    word.store(value, Ordering::Relaxed);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_reader_between_two_stores_sees_the_message_before() {
        let mailbox = Mailbox::new([const { AtomicU32::new(0) }; 2]);
        mailbox.send(|message| set(message, 1));
        assert_eq!((mailbox.sent(), get(mailbox.last())), (1, 1));
        mailbox.send(|message| {
            set(message, 7);
            // As an interrupt would find it: the other message is being filled, nothing is switched over.
            assert_eq!((mailbox.sent(), get(mailbox.last())), (1, 1));
        });
        assert_eq!((mailbox.sent(), get(mailbox.last())), (2, 7));
        mailbox.send(|message| set(message, 8));
        assert_eq!((mailbox.sent(), get(mailbox.last())), (3, 8));
    }

    #[test]
    fn the_two_cycles_of_a_tick_have_a_report_each() {
        let report = Report::new();
        set(&report.cycle(true).bus, 1);
        set(&report.cycle(false).bus, 2);
        assert_eq!([true, false].map(|first| get(&report.cycle(first).bus)), [1, 2]);
    }
}
