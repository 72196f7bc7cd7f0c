//! The two interrupt status registers, 04H and 05H.

use bitbybit::bitfield;

/// 04H: errors of the ring and of the synchronisation, latched until 1 is written (sercon816.md 5.4).
#[bitfield(u16, default = 0, debug)]
#[derive(PartialEq, Eq)]
pub struct ErrorStatus {
    /// RDIST: the received signal is distorted (also: wrong bit rate).
    #[bit(0, rw)]
    distorted: bool,
    /// FIBBR: fibre break, no signal.
    #[bit(1, rw)]
    fibre_break: bool,
    /// MSTEARLY: an MST arrived before its window.
    #[bit(7, rw)]
    mst_early: bool,
    /// MSTLATE: an MST arrived after its window.
    #[bit(8, rw)]
    mst_late: bool,
    /// MSTMISS: no MST arrived.
    #[bit(9, rw)]
    mst_missing: bool,
}

impl ErrorStatus {
    /// The flags that must stay clear for 20 cycles for the ring to count as closed, 0382H (sercon816.md 5.4).
    pub const RING_CLOSED: Self =
        Self::DEFAULT.with_fibre_break(true).with_mst_early(true).with_mst_late(true).with_mst_missing(true);

    /// The flags of both.
    #[must_use]
    pub const fn union(self, other: Self) -> Self {
        Self::new_with_raw_value(self.raw_value() | other.raw_value())
    }

    /// The bits that no public source explains (G3).
    #[must_use]
    pub const fn unexplained(self) -> u16 {
        self.raw_value() & 0xFC7C
    }
}

#[cfg(feature = "defmt")]
impl defmt::Format for ErrorStatus {
    fn format(&self, formatter: defmt::Formatter<'_>) {
        defmt::write!(formatter, "{=u16:#06x}", self.raw_value());
    }
}

/// 05H: the service containers and, at unknown places in the high byte, timers and cycle events (sercon816.md 5.5, G4).
#[bitfield(u16, default = 0, debug)]
#[derive(PartialEq, Eq)]
pub struct InterruptStatus {
    /// INT_SC0 to INT_SC7: a service container waits for the processor.
    #[bit(0, rw)]
    service_container: [bool; 8],
    /// Timers and cycle events, positions learned by [`crate::Discovery`].
    #[bits(8..=15, rw)]
    events: u8,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_ring_closed_mask_is_the_published_one() {
        assert_eq!(ErrorStatus::RING_CLOSED.raw_value(), 0x0382);
    }

    #[test]
    fn every_bit_is_either_named_or_unexplained() {
        let named = ErrorStatus::RING_CLOSED.with_distorted(true);
        assert_eq!(named.unexplained(), 0);
        assert_eq!(ErrorStatus::new_with_raw_value(!named.raw_value()).unexplained(), !named.raw_value());
    }

    #[test]
    fn service_containers_are_the_low_byte() {
        let status = InterruptStatus::new_with_raw_value(0x0481);
        assert!(status.service_container(0) && status.service_container(7) && !status.service_container(1));
        assert_eq!(status.events(), 4);
    }
}
