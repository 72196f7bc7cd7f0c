//! Telegram headers in the dual-port RAM: the chain that the chip walks in every cycle (sercon816.md 6.2).

use bitbybit::{bitenum, bitfield};

/// What a header is, bits 15..14 of its word 0.
#[bitenum(u2, exhaustive = true)]
#[derive(Debug, PartialEq, Eq)]
pub enum HeaderKind {
    /// 5 words: the chip waits for a telegram.
    Receive = 0b00,
    /// 4 words: the chip sends a telegram.
    Transmit = 0b01,
    /// Not published.
    Unknown = 0b10,
    /// 2 words: end of the block, [`END_MARKER`].
    End = 0b11,
}

/// Word 0 of the end marker, C000H; word 1 is the end time in us after the MST.
pub const END_MARKER: u16 = 0xC000;

/// The kind of a header, from its word 0.
#[must_use]
pub const fn header_kind(word: u16) -> HeaderKind {
    ReceiveHeader::new_with_raw_value(word).kind()
}

/// Word 0 of a receive header. Words 1 to 4: time in us, data words, next header, error counter.
#[bitfield(u16, default = 0, debug)]
#[derive(PartialEq, Eq)]
pub struct ReceiveHeader {
    /// ADR: the telegram address, or the address received when [`ReceiveHeader::check_address`] is off.
    #[bits(0..=7, rw)]
    address: u8,
    /// DMA: the data go by DMA and not to the RAM.
    #[bit(8, rw)]
    dma: bool,
    /// DBUF: two buffers; VAL then names the valid one.
    #[bit(9, rw)]
    double_buffer: bool,
    /// VAL: single buffer: a telegram was received completely.
    #[bit(10, rw)]
    valid: bool,
    /// ACHK: only a telegram with this address is accepted.
    #[bit(11, rw)]
    check_address: bool,
    /// TCHK: only a telegram that starts in its time window is accepted.
    #[bit(12, rw)]
    check_time: bool,
    /// Perhaps a receive error (G18); written 0, never looked at.
    #[bit(13, r)]
    unknown_13: bool,
    /// [`HeaderKind::Receive`].
    #[bits(14..=15, rw)]
    kind: HeaderKind,
}

impl ReceiveHeader {
    /// Words a receive header occupies.
    pub const WORDS: u16 = 5;

    /// Telegrams of one address within the time window, not yet received: 1800H | address.
    #[must_use]
    pub const fn addressed(address: u8) -> Self {
        Self::any_address().with_check_address(true).with_address(address)
    }

    /// Telegrams of any address within the time window, 1000H.
    #[must_use]
    pub const fn any_address() -> Self {
        Self::DEFAULT.with_check_time(true)
    }
}

/// When a transmit header sends, bits 12..11 of its word 0.
#[bitenum(u2, exhaustive = true)]
#[derive(Debug, PartialEq, Eq)]
pub enum TransmitMode {
    /// Not at all.
    Off = 0b00,
    /// In the next cycle only (G16: who takes the bit back is not published).
    Once = 0b01,
    /// In every cycle.
    Continuous = 0b10,
    /// Not published.
    Unknown = 0b11,
}

/// Word 0 of a transmit header. Words 1 to 3: time in us, data words, next header.
#[bitfield(u16, default = 0, debug)]
#[derive(PartialEq, Eq)]
pub struct TransmitHeader {
    /// ADR: the telegram address.
    #[bits(0..=7, rw)]
    address: u8,
    /// DMA: the data come by DMA and not from the RAM.
    #[bit(8, rw)]
    dma: bool,
    /// DBUF: two buffers.
    #[bit(9, rw)]
    double_buffer: bool,
    /// VAL: with two buffers the one to send; without meaning for a single buffer.
    #[bit(10, rw)]
    valid: bool,
    /// When to send.
    #[bits(11..=12, rw)]
    mode: TransmitMode,
    /// [`HeaderKind::Transmit`].
    #[bits(14..=15, rw)]
    kind: HeaderKind,
}

impl TransmitHeader {
    /// Words a transmit header occupies.
    pub const WORDS: u16 = 4;

    /// A header of a single-buffered telegram: 4000H, 4800H or 5000H | address.
    #[must_use]
    pub const fn addressed(address: u8, mode: TransmitMode) -> Self {
        Self::DEFAULT.with_kind(HeaderKind::Transmit).with_address(address).with_mode(mode)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn the_end_marker_is_recognised() {
        assert_eq!(header_kind(END_MARKER), HeaderKind::End);
        assert_eq!(header_kind(0x8000), HeaderKind::Unknown);
    }

    #[test]
    fn receive_headers_match_the_published_words() {
        assert_eq!(ReceiveHeader::addressed(0xFF).raw_value(), 0x18FF);
        assert_eq!(ReceiveHeader::any_address().raw_value(), 0x1000);
        assert_eq!(ReceiveHeader::addressed(0xFF).with_check_time(false).raw_value(), 0x08FF);
        assert!(ReceiveHeader::new_with_raw_value(0x1C02).valid());
    }

    #[test]
    fn transmit_headers_match_the_published_words() {
        assert_eq!(TransmitHeader::addressed(0xFF, TransmitMode::Continuous).raw_value(), 0x50FF);
    }

    proptest! {
        #[test]
        fn address_and_mode_stay_in_their_bits(address: u8) {
            let low = u16::from(address);
            prop_assert_eq!(TransmitHeader::addressed(address, TransmitMode::Off).raw_value(), 0x4000 | low);
            prop_assert_eq!(TransmitHeader::addressed(address, TransmitMode::Once).raw_value(), 0x4800 | low);
            prop_assert_eq!(TransmitHeader::addressed(address, TransmitMode::Continuous).raw_value(), 0x5000 | low);
            prop_assert_eq!(ReceiveHeader::addressed(address).raw_value(), 0x1800 | low);
        }

        #[test]
        fn every_word_reads_back_from_its_fields(raw: u16) {
            let receive = ReceiveHeader::new_with_raw_value(raw);
            let rebuilt = ReceiveHeader::new_with_raw_value(raw & 0x2000)
                .with_address(receive.address())
                .with_dma(receive.dma())
                .with_double_buffer(receive.double_buffer())
                .with_valid(receive.valid())
                .with_check_address(receive.check_address())
                .with_check_time(receive.check_time())
                .with_kind(receive.kind());
            prop_assert_eq!(rebuilt.raw_value(), raw);
            let transmit = TransmitHeader::new_with_raw_value(raw);
            let rebuilt = TransmitHeader::new_with_raw_value(raw & 0x2000)
                .with_address(transmit.address())
                .with_dma(transmit.dma())
                .with_double_buffer(transmit.double_buffer())
                .with_valid(transmit.valid())
                .with_mode(transmit.mode())
                .with_kind(transmit.kind());
            prop_assert_eq!(rebuilt.raw_value(), raw);
        }
    }
}
