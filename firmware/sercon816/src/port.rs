//! Handles of the hot tasks: the record of the MDT taken at t3, the record of the AT written at t4.
//!
//! Each holds an access path of its own to the chip and touches its own words only.

use crate::bus::Bus;
use crate::header::{ReceiveHeader, TransmitHeader, TransmitMode};
use crate::layout::{Block, MAXIMUM_CYCLIC_WORDS, SERVICE_WORDS};

/// The service bits of the status word, which the chip puts over the RAM's when it sends: AHS, BUSY, ERR, and the command
/// change bit where [`crate::uncertain::COMMAND_CHANGE_IN_AT`] has it.
const SERVICE_BITS: u16 = 0x0007 | crate::uncertain::COMMAND_CHANGE_IN_AT;

/// The master's record, for the task of t3; in CP1 and CP2 also the switch of the one AT that answers an MDT.
#[derive(Debug)]
pub struct CommandPort<B> {
    bus: B,
    address: u8,
}

impl<B: Bus> CommandPort<B> {
    /// A port for the drive address given to the chip at initialisation.
    pub const fn new(bus: B, address: u8) -> Self {
        Self { bus, address }
    }

    /// CP3 and CP4: whether an MDT was received since the last call. Clears the mark for the next cycle.
    ///
    /// To be called once in a cycle, between the end of the MDT and the next one (t3). 2 accesses.
    pub fn take_cyclic(&mut self) -> bool {
        self.take(&Block::CYCLIC, ReceiveHeader::addressed(0xFF))
    }

    /// CP1 and CP2: whether an MDT with our address was received since the last call. Clears the mark.
    ///
    /// To be called once in a cycle when the window of the MDT is over (800 us after the MST). 2 accesses.
    pub fn take_initial(&mut self) -> bool {
        self.take(&Block::INITIAL, ReceiveHeader::addressed(self.address))
    }

    /// CP1 and CP2: sends the AT in the next cycle, or does not. To be called in every cycle after [`CommandPort::take_initial`],
    /// so that it does not matter whether the chip takes "send once" back by itself (G16).
    pub fn answer_once(&mut self, send: bool) {
        let mode = if send { TransmitMode::Once } else { TransmitMode::Off };
        self.bus.write_ram(Block::INITIAL.at_header, TransmitHeader::addressed(self.address, mode).raw_value());
    }

    /// CP3 and CP4: the control word of the record, service bits included.
    pub fn control_word(&mut self) -> u16 {
        self.bus.read_ram(Block::CYCLIC.mdt_data)
    }

    /// CP3 and CP4: a word of cyclic data, 0 being the first behind the service info word.
    /// Beyond the configured record the RAM holds nothing of use; beyond [`MAXIMUM_CYCLIC_WORDS`] the answer is 0.
    pub fn word(&mut self, index: u16) -> u16 {
        if index >= MAXIMUM_CYCLIC_WORDS {
            return 0;
        }
        self.bus.read_ram(Block::CYCLIC.mdt_data.offset(SERVICE_WORDS).offset(index))
    }

    /// CP3 and CP4: two words of cyclic data, the low word first.
    pub fn double_word(&mut self, index: u16) -> u32 {
        let low = self.word(index);
        let high = self.word(index.saturating_add(1));
        (u32::from(high) << 16) | u32::from(low)
    }

    fn take(&mut self, block: &Block, armed: ReceiveHeader) -> bool {
        let header = ReceiveHeader::new_with_raw_value(self.bus.read_ram(block.mdt_header));
        self.bus.write_ram(block.mdt_header, armed.raw_value());
        header.valid()
    }
}

/// The drive's record, for the task of t4.
#[derive(Debug)]
pub struct FeedbackPort<B> {
    bus: B,
}

impl<B: Bus> FeedbackPort<B> {
    /// A port.
    pub const fn new(bus: B) -> Self {
        Self { bus }
    }

    /// CP3 and CP4: writes the status word but for the chip's service bits (2 to 0, and 5).
    pub fn set_status(&mut self, status: u16) {
        self.set(&Block::CYCLIC, status);
    }

    /// CP3 and CP4: the status word as it stands in the record of the next AT, or of the one that is on its way. One access.
    pub fn status(&mut self) -> u16 {
        self.bus.read_ram(Block::CYCLIC.at_data)
    }

    /// CP1 and CP2: what [`FeedbackPort::set_status`] does, for the AT of these phases.
    pub fn set_initial_status(&mut self, status: u16) {
        self.set(&Block::INITIAL, status);
    }

    /// CP3 and CP4: writes a word of cyclic data, 0 being the first behind the service info word.
    /// Beyond [`MAXIMUM_CYCLIC_WORDS`] nothing is written.
    pub fn set_word(&mut self, index: u16, value: u16) {
        if index < MAXIMUM_CYCLIC_WORDS {
            self.bus.write_ram(Block::CYCLIC.at_data.offset(SERVICE_WORDS).offset(index), value);
        }
    }

    /// CP3 and CP4: writes two words of cyclic data, the low word first.
    pub fn set_double_word(&mut self, index: u16, value: u32) {
        self.set_word(index, (value & 0xFFFF) as u16);
        self.set_word(index.saturating_add(1), (value >> 16) as u16);
    }

    /// The low bits are kept as they stand: the chip overlays them when it sends (sercon816.md 6.3),
    /// and whether it does so in the RAM is not published.
    fn set(&mut self, block: &Block, status: u16) {
        let kept = self.bus.read_ram(block.at_data) & SERVICE_BITS;
        self.bus.write_ram(block.at_data, (status & !SERVICE_BITS) | kept);
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::test_bus::{TestBus, Write};

    #[test]
    fn a_received_mdt_is_seen_once_and_the_header_armed_again() {
        let bus = TestBus::new();
        let mut port = CommandPort::new(bus.clone(), 2);
        bus.set_ram(0x048, 0x18FF | 0x0400);
        assert!(port.take_cyclic());
        assert_eq!(bus.ram(0x048), 0x18FF);
        assert!(!port.take_cyclic());
        bus.set_ram(0x018, 0x1802 | 0x0400);
        assert!(port.take_initial());
        assert_eq!(bus.ram(0x018), 0x1802);
        assert!(!port.take_initial());
    }

    #[test]
    fn the_unknown_bit_13_of_a_header_neither_counts_nor_stays() {
        let bus = TestBus::new();
        let mut port = CommandPort::new(bus.clone(), 2);
        bus.set_ram(0x048, 0x38FF);
        assert!(!port.take_cyclic());
        assert_eq!(bus.ram(0x048), 0x18FF);
        bus.set_ram(0x048, 0x3CFF);
        assert!(port.take_cyclic());
    }

    #[test]
    fn an_answer_is_armed_once_or_off() {
        let bus = TestBus::new();
        let mut port = CommandPort::new(bus.clone(), 0x21);
        port.answer_once(true);
        port.answer_once(false);
        assert_eq!(bus.take_writes(), [Write::Ram(0x010, 0x4821), Write::Ram(0x010, 0x4021)]);
    }

    #[test]
    fn the_chips_own_status_bits_are_left_alone() {
        let bus = TestBus::new();
        let mut port = FeedbackPort::new(bus.clone());
        bus.set_ram(0x035, 0x5825);
        port.set_status(0x98DA);
        assert_eq!((bus.ram(0x035), port.status()), (0x98FD, 0x98FD));
        bus.set_ram(0x015, 0x002F);
        port.set_initial_status(0x4000);
        assert_eq!(bus.ram(0x015), 0x4027);
    }

    #[test]
    fn nothing_is_written_or_read_beyond_the_record() {
        let bus = TestBus::new();
        let mut feedback = FeedbackPort::new(bus.clone());
        feedback.set_word(16, 0x1234);
        feedback.set_double_word(u16::MAX, 0x1234_5678);
        assert_eq!(bus.take_writes(), []);
        assert_eq!(CommandPort::new(bus, 1).word(16), 0);
    }

    proptest! {
        #[test]
        fn cyclic_words_stand_behind_the_service_info(index in 0_u16..15, value: u32) {
            let bus = TestBus::new();
            FeedbackPort::new(bus.clone()).set_double_word(index, value);
            prop_assert_eq!(u32::from(bus.ram(0x037 + index)) | u32::from(bus.ram(0x038 + index)) << 16, value);
            bus.set_ram(0x051 + index, value as u16);
            bus.set_ram(0x052 + index, (value >> 16) as u16);
            prop_assert_eq!(CommandPort::new(bus, 1).double_word(index), value);
        }
    }
}
