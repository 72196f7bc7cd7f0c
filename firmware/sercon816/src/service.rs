//! Words of the service containers, slave and master mode (sercon816.md 6.4).

use arbitrary_int::{u2, u3};
use bitbybit::bitfield;

/// Words of a service container in slave mode.
pub mod slave {
    use super::{bitfield, u2, u3};

    /// Word 0: what the AT shows, the transfer under way, and why the chip waits.
    #[bitfield(u16, default = 0, debug)]
    #[derive(PartialEq, Eq)]
    pub struct Answer {
        /// HS_AT: handshake bit of the AT.
        #[bit(0, rw)]
        handshake: bool,
        /// BUSY_AT: busy bit of the AT; the chip waits for the processor.
        #[bit(1, rw)]
        busy: bool,
        /// ERR_AT: error bit of the AT.
        #[bit(2, rw)]
        error: bool,
        /// CMD_AT: command-change bit of the AT.
        #[bit(3, rw)]
        command_change: bool,
        /// ELEM: element of the present transmission.
        #[bits(4..=6, rw)]
        element: u3,
        /// L/S: the present transmission is a write.
        #[bit(7, rw)]
        write: bool,
        /// NINFO_WRITE: info words per transfer of the write buffer, coded n - 1.
        #[bits(8..=9, rw)]
        info_words: u2,
        /// INT_ELEM_CHANGE: the master changed element or direction.
        #[bit(12, rw)]
        element_change: bool,
        /// INT_END_WRBUF: end of the write buffer reached.
        #[bit(13, rw)]
        end_of_write_buffer: bool,
        /// INT_END_RDBUF: end of the read buffer reached.
        #[bit(14, rw)]
        end_of_read_buffer: bool,
        /// INT_END_MDT: the master signalled the end of the element.
        #[bit(15, rw)]
        end_of_element: bool,
    }

    impl Answer {
        /// The chip waits for the processor: BUSY or any of the four flags.
        #[must_use]
        pub const fn is_held(self) -> bool {
            self.raw_value() & 0xF002 != 0
        }
    }

    /// Word 1: the bits of the last MDT.
    #[bitfield(u16, default = 0, debug)]
    #[derive(PartialEq, Eq)]
    pub struct Request {
        /// HS_MDT: received handshake bit.
        #[bit(0, rw)]
        handshake: bool,
        /// L/S_MDT: the master writes.
        #[bit(1, rw)]
        write: bool,
        /// END_MDT: last transfer of the element.
        #[bit(2, rw)]
        end: bool,
        /// ELEM_MDT: received element, 0 closes the channel.
        #[bits(3..=5, rw)]
        element: u3,
        /// RECERR: the last MDT was erroneous.
        #[bit(7, rw)]
        receive_error: bool,
        /// NINFO_READ: info words per transfer of the read buffer, coded n - 1.
        #[bits(8..=9, rw)]
        info_words: u2,
    }

    /// Word 4: supervision.
    #[bitfield(u16, default = 0, debug)]
    #[derive(PartialEq, Eq)]
    pub struct Supervision {
        /// INT_SC_ERR: protocol error.
        #[bit(9, rw)]
        protocol_error: bool,
    }
}

/// Words of a service container in master mode. The drive has no use for them; a master on the same chip has.
pub mod master {
    use super::{bitfield, u2, u3};

    /// Word 0: what the MDT carries.
    #[bitfield(u16, default = 0, debug)]
    #[derive(PartialEq, Eq)]
    pub struct Request {
        /// HS_MDT: handshake bit of the MDT.
        #[bit(0, rw)]
        handshake: bool,
        /// L/S_MDT: write.
        #[bit(1, rw)]
        write: bool,
        /// END_MDT: last transfer of the element.
        #[bit(2, rw)]
        end: bool,
        /// ELEM_MDT: element.
        #[bits(3..=5, rw)]
        element: u3,
        /// SETEND: END_MDT is set by the chip with the last word of the buffer.
        #[bit(6, rw)]
        automatic_end: bool,
        /// M_BUSY: the container waits for the processor.
        #[bit(7, rw)]
        busy: bool,
        /// NINFO_WRITE: info words per transfer of the write buffer, coded n - 1.
        #[bits(8..=9, rw)]
        info_words: u2,
        /// INT_ERR: the slave reports an error.
        #[bit(12, rw)]
        slave_error: bool,
        /// INT_END_WRBUF: end of the write buffer reached.
        #[bit(13, rw)]
        end_of_write_buffer: bool,
        /// INT_END_RDBUF: end of the read buffer reached.
        #[bit(14, rw)]
        end_of_read_buffer: bool,
    }

    /// Word 1: the bits of the last AT.
    #[bitfield(u16, default = 0, debug)]
    #[derive(PartialEq, Eq)]
    pub struct Answer {
        /// HS_AT: handshake bit received.
        #[bit(0, rw)]
        handshake: bool,
        /// BUSY_AT: busy bit received.
        #[bit(1, rw)]
        busy: bool,
        /// ERR_AT: error bit received.
        #[bit(2, rw)]
        error: bool,
        /// CMD_AT: command-change bit received.
        #[bit(3, rw)]
        command_change: bool,
        /// RECERR: the last AT was erroneous.
        #[bit(7, rw)]
        receive_error: bool,
        /// NINFO_READ: info words per transfer of the read buffer, coded n - 1.
        #[bits(8..=9, rw)]
        info_words: u2,
    }

    /// Word 4: supervision.
    #[bitfield(u16, default = 0, debug)]
    #[derive(PartialEq, Eq)]
    pub struct Supervision {
        /// ERR_CNT: cycles counted.
        #[bits(0..=7, rw)]
        count: u8,
        /// BUSY_CNT: BUSY cycles are counted, not handshake differences.
        #[bit(8, rw)]
        counts_busy: bool,
        /// INT_SC_ERR: protocol error.
        #[bit(9, rw)]
        protocol_error: bool,
        /// INT_HS_TIMEOUT: no handshake for the cycles of 0DH.
        #[bit(10, rw)]
        handshake_timeout: bool,
        /// INT_BUSY_TIMEOUT: busy for longer than the cycles of 0DH.
        #[bit(11, rw)]
        busy_timeout: bool,
        /// INT_CMD: a command-change bit was received.
        #[bit(12, rw)]
        command_change: bool,
    }
}

/// Words 2 and 3 in both modes: the pointers of the write and of the read buffer, counted from the first buffer word.
#[bitfield(u16, default = 0, debug)]
#[derive(PartialEq, Eq)]
pub struct BufferPointer {
    /// WRDATPT or RDDATPT: present position.
    #[bits(0..=7, rw)]
    present: u8,
    /// WRDATLAST or RDDATLAST: last position.
    #[bits(8..=15, rw)]
    last: u8,
}

impl BufferPointer {
    /// A buffer from its first to its last position.
    #[must_use]
    pub const fn span(first: u8, last: u8) -> Self {
        Self::DEFAULT.with_present(first).with_last(last)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn the_published_reset_of_a_master_container_reads_as_closed_and_waiting() {
        let request = master::Request::new_with_raw_value(0x0086);
        assert!(request.busy() && request.write() && request.end() && !request.handshake());
        assert_eq!(request.element().value(), 0);
        assert_eq!(BufferPointer::span(20, 20).raw_value(), 0x1414);
    }

    #[test]
    fn requests_seen_on_the_bus_decode() {
        let open = slave::Request::new_with_raw_value(0x000F);
        assert!(open.handshake() && open.write() && open.end());
        assert_eq!(open.element().value(), 1);
        let attribute = slave::Request::new_with_raw_value(0x0018);
        assert!(!attribute.handshake() && !attribute.write() && !attribute.end());
        assert_eq!(attribute.element().value(), 3);
    }

    #[test]
    fn a_container_is_held_by_busy_or_any_flag_but_not_by_its_other_bits() {
        assert!(slave::Answer::DEFAULT.with_busy(true).is_held());
        assert!(slave::Answer::DEFAULT.with_element_change(true).is_held());
        assert!(slave::Answer::DEFAULT.with_end_of_write_buffer(true).is_held());
        assert!(slave::Answer::DEFAULT.with_end_of_read_buffer(true).is_held());
        assert!(slave::Answer::DEFAULT.with_end_of_element(true).is_held());
        assert!(!slave::Answer::new_with_raw_value(0x0FFD).is_held());
    }

    proptest! {
        #[test]
        fn slave_words_read_back_from_their_fields(raw: u16) {
            let answer = slave::Answer::new_with_raw_value(raw);
            let rebuilt = slave::Answer::new_with_raw_value(raw & 0x0C00)
                .with_handshake(answer.handshake())
                .with_busy(answer.busy())
                .with_error(answer.error())
                .with_command_change(answer.command_change())
                .with_element(answer.element())
                .with_write(answer.write())
                .with_info_words(answer.info_words())
                .with_element_change(answer.element_change())
                .with_end_of_write_buffer(answer.end_of_write_buffer())
                .with_end_of_read_buffer(answer.end_of_read_buffer())
                .with_end_of_element(answer.end_of_element());
            prop_assert_eq!(rebuilt.raw_value(), raw);
            let request = slave::Request::new_with_raw_value(raw);
            let rebuilt = slave::Request::new_with_raw_value(raw & 0xFC40)
                .with_handshake(request.handshake())
                .with_write(request.write())
                .with_end(request.end())
                .with_element(request.element())
                .with_receive_error(request.receive_error())
                .with_info_words(request.info_words());
            prop_assert_eq!(rebuilt.raw_value(), raw);
        }

        #[test]
        fn master_words_read_back_from_their_fields(raw: u16) {
            let request = master::Request::new_with_raw_value(raw);
            let rebuilt = master::Request::new_with_raw_value(raw & 0x8C00)
                .with_handshake(request.handshake())
                .with_write(request.write())
                .with_end(request.end())
                .with_element(request.element())
                .with_automatic_end(request.automatic_end())
                .with_busy(request.busy())
                .with_info_words(request.info_words())
                .with_slave_error(request.slave_error())
                .with_end_of_write_buffer(request.end_of_write_buffer())
                .with_end_of_read_buffer(request.end_of_read_buffer());
            prop_assert_eq!(rebuilt.raw_value(), raw);
            let supervision = master::Supervision::new_with_raw_value(raw);
            let rebuilt = master::Supervision::new_with_raw_value(raw & 0xE000)
                .with_count(supervision.count())
                .with_counts_busy(supervision.counts_busy())
                .with_protocol_error(supervision.protocol_error())
                .with_handshake_timeout(supervision.handshake_timeout())
                .with_busy_timeout(supervision.busy_timeout())
                .with_command_change(supervision.command_change());
            prop_assert_eq!(rebuilt.raw_value(), raw);
        }
    }
}
