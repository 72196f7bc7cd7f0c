//! Between the current loop and the tasks below it: data without locks.
//!
//! The current loop interrupts everything else and is interrupted by nothing. Whatever it reads or writes here is done before the other
//! side gets on, so two rules suffice on a single core:
//!
//! * Downwards ([`Mailbox`]): the lower side fills the buffer that is not in use, then switches over with one store. The current loop never
//!   sees half of it.
//! * Upwards ([`Report`]): the current loop writes words; the lower side reads each of them whole. What must belong together is packed into
//!   one word, or written only once in a tick ([`CycleReport`]): the first cycle's readings stand for a tick from then on, which is when the
//!   lower side is started; the second cycle's come half a tick later, when it has long read those of the tick before.

use core::sync::atomic::{AtomicU32, Ordering, compiler_fence};

/// The words of both directions; one for each drive.
#[derive(Debug)]
pub struct CurrentLink {
    pub(crate) command: Mailbox<COMMAND_WORDS>,
    pub(crate) settings: Mailbox<SETTINGS_WORDS>,
    pub(crate) report: Report,
}

/// Words of a command, see `current_control`.
pub(crate) const COMMAND_WORDS: usize = 16;
/// Words of the settings.
pub(crate) const SETTINGS_WORDS: usize = 12;

impl CurrentLink {
    /// Nothing commanded, nothing reported.
    #[must_use]
    pub const fn new() -> Self {
        Self { command: Mailbox::new(), settings: Mailbox::new(), report: Report::new() }
    }
}

impl Default for CurrentLink {
    fn default() -> Self {
        Self::new()
    }
}

/// A message of `N` words from a lower to a higher priority.
#[derive(Debug)]
pub(crate) struct Mailbox<const N: usize> {
    buffers: [[AtomicU32; N]; 2],
    /// How many messages were sent; the last bit says which buffer is in use.
    sent: AtomicU32,
}

impl<const N: usize> Mailbox<N> {
    const fn new() -> Self {
        Self { buffers: [const { [const { AtomicU32::new(0) }; N] }; 2], sent: AtomicU32::new(0) }
    }

    /// Sends a message. From one place only, of lower priority than the reader.
    pub(crate) fn send(&self, words: [u32; N]) {
        let sent = self.sent.load(Ordering::Relaxed).wrapping_add(1);
        let [even, odd] = &self.buffers;
        let buffer = if sent & 1 == 0 { even } else { odd };
        for (place, word) in buffer.iter().zip(words) {
            place.store(word, Ordering::Relaxed);
        }
        // One core: it is enough that the compiler keeps the order.
        compiler_fence(Ordering::SeqCst);
        self.sent.store(sent, Ordering::Relaxed);
    }

    /// How many messages were sent.
    #[inline]
    pub(crate) fn sent(&self) -> u32 {
        self.sent.load(Ordering::Relaxed)
    }

    /// The last message.
    #[inline]
    pub(crate) fn read(&self) -> [u32; N] {
        let [even, odd] = &self.buffers;
        let buffer = if self.sent.load(Ordering::Relaxed) & 1 == 0 { even } else { odd };
        let mut words = [0; N];
        for (word, place) in words.iter_mut().zip(buffer) {
            *word = place.load(Ordering::Relaxed);
        }
        words
    }
}

/// What the current loop tells.
#[derive(Debug)]
pub(crate) struct Report {
    /// Encoder count in the first cycle of the tick.
    pub(crate) count: AtomicU32,
    /// What the first and the second cycle of a tick have read.
    pub(crate) cycles: [CycleReport; 2],
    /// Heat sink (low half) and motor temperature in counts.
    pub(crate) temperatures: AtomicU32,
    /// [`servo::current::Trip::code`], 0: none.
    pub(crate) trip: AtomicU32,
    /// 1: the zero of the current sensors is known.
    pub(crate) calibrated: AtomicU32,
    /// Cycles that came too late, since the start.
    pub(crate) late: AtomicU32,
}

impl Report {
    const fn new() -> Self {
        Self {
            count: AtomicU32::new(0),
            cycles: [const { CycleReport::new() }; 2],
            temperatures: AtomicU32::new(0),
            trip: AtomicU32::new(0),
            calibrated: AtomicU32::new(0),
            late: AtomicU32::new(0),
        }
    }
}

/// Readings of one cycle of the current loop.
#[derive(Debug)]
pub(crate) struct CycleReport {
    /// Flux-producing current, 2^-26 of peak.
    pub(crate) direct: AtomicU32,
    /// Torque-producing current, 2^-26 of peak.
    pub(crate) quadrature: AtomicU32,
    /// d voltage, volt 2^-14.
    pub(crate) direct_voltage: AtomicU32,
    /// q voltage, volt 2^-14.
    pub(crate) quadrature_voltage: AtomicU32,
    /// Currents of phase U (low half) and V, counts 2^-3 without offset.
    pub(crate) phases: AtomicU32,
    /// Current of phase W (low half), and electrical angle in 2^-16 revolution.
    pub(crate) phase_and_angle: AtomicU32,
    /// Bus voltage in counts.
    pub(crate) bus: AtomicU32,
}

impl CycleReport {
    const fn new() -> Self {
        Self {
            direct: AtomicU32::new(0),
            quadrature: AtomicU32::new(0),
            direct_voltage: AtomicU32::new(0),
            quadrature_voltage: AtomicU32::new(0),
            phases: AtomicU32::new(0),
            phase_and_angle: AtomicU32::new(0),
            bus: AtomicU32::new(0),
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
        let mailbox = Mailbox::<3>::new();
        mailbox.send([1, 2, 3]);
        assert_eq!((mailbox.sent(), mailbox.read()), (1, [1, 2, 3]));
        // As an interrupt would find it: the other buffer is half filled, nothing is switched over.
        mailbox.buffers[0][0].store(7, Ordering::Relaxed);
        assert_eq!(mailbox.read(), [1, 2, 3]);
        mailbox.send([4, 5, 6]);
        assert_eq!((mailbox.sent(), mailbox.read()), (2, [4, 5, 6]));
        mailbox.send([8, 8, 8]);
        assert_eq!((mailbox.sent(), mailbox.read()), (3, [8, 8, 8]));
    }
}
