//! Reaction times of a drive, seen on its bus: from an event in the chip to the access that answers it.

use ring::Nanoseconds;
use ring::chip::{Chip, InterruptPin, PinEdge};
use sercon816::Block;
use sercon816::layout::SERVICE_CONTAINER;

use crate::executor::SharedMeasurements;

/// Word 0 of a service container: BUSY, the processor's turn (sercon816.md 6.4).
const BUSY: u16 = 1 << 1;
/// Register 05H and its bit of service container 0.
pub(crate) const INTERRUPT_STATUS: u16 = 0x05;
const SERVICE_CHANNEL: u16 = 1;
/// Word of a header that holds the number of data words.
const LENGTH: u16 = 2;

/// Watches the accesses of a processor to its chip's RAM.
pub(crate) struct BusObserver {
    measurements: SharedMeasurements,
    /// Last edge of each interrupt pin that was raised, until it is answered: t4 has INT1 (or INT0) for itself.
    raised: [Option<Nanoseconds>; 2],
    /// The command task has begun: since which edge, and its last access to the MDT record.
    command: Option<(Nanoseconds, Nanoseconds)>,
}

impl BusObserver {
    pub(crate) fn new(measurements: SharedMeasurements) -> Self {
        Self { measurements, raised: [None; 2], command: None }
    }

    /// Whether [`BusObserver::read`] makes something of a read of this word: the MDT and its record, but for the info word, which is the service channel's.
    pub(crate) fn watches_read_of(word: u16) -> bool {
        let of_the_service_channel = Block::CYCLIC.mdt_data.offset(1).word();
        (Block::CYCLIC.mdt_header.word()..Block::CYCLIC.end.word()).contains(&word) && word != of_the_service_channel
    }

    pub(crate) fn traced(&mut self, trace: emulator::Trace) {
        self.measurements.borrow_mut().trace = Some(trace);
    }

    pub(crate) fn log(&mut self, line: String) {
        self.measurements.borrow_mut().log.push(line);
    }

    pub(crate) fn edge(&mut self, edge: &PinEdge, chip: &mut Chip) {
        let measurements = &mut *self.measurements.borrow_mut();
        let status = chip.read_register(edge.time, INTERRUPT_STATUS);
        if status & SERVICE_CHANNEL != 0 {
            measurements.service.start(edge.time);
        }
        if let Some((since, last)) = self.command.take() {
            measurements.interrupt_to_command.record(last.saturating_sub(since));
        }
        // The other edge of the pin is that of the acknowledgement.
        if status != 0 {
            self.raised[usize::from(edge.pin == InterruptPin::Int1)] = Some(edge.time);
        }
    }

    pub(crate) fn read(&mut self, now: Nanoseconds, word: u16) {
        if Self::watches_read_of(word) {
            let begun = self.command.map(|(since, _)| since).or_else(|| self.raised[0].take());
            self.command = begun.map(|since| (since, now));
        }
    }

    pub(crate) fn write(&mut self, now: Nanoseconds, word: u16, value: u16, chip: &mut Chip) {
        if word == SERVICE_CONTAINER.word() && value & BUSY == 0 {
            let measurements = &mut *self.measurements.borrow_mut();
            measurements.service.stop(now);
            measurements.released = Some(now);
        }
        let length = chip.read_ram(now, Block::CYCLIC.at_header.offset(LENGTH).word());
        if length > 0
            && word == Block::CYCLIC.at_data.offset(length - 1).word()
            && let Some(edge) = self.raised[1].take()
        {
            self.measurements.borrow_mut().interrupt_to_at.record(now.saturating_sub(edge));
        }
    }
}
