//! Where everything lies in the dual-port RAM of a one-drive slave (after sercon816.md 6.5).
//!
//! Two blocks of headers stand side by side, so that the block of CP3 and CP4 can be filled while that of CP0 to CP2 runs.

use crate::bus::RamAddress;

/// Most words of cyclic data in an AT or in the own record of an MDT: 32 bytes.
pub const MAXIMUM_CYCLIC_WORDS: u16 = 16;

/// Words of a record before the cyclic data: control or status word, and service info word.
pub const SERVICE_WORDS: u16 = 2;

/// The parts of one block: AT, MDT, end marker.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Block {
    /// Transmit header of the AT.
    pub at_header: RamAddress,
    /// Data container of the AT; one word.
    pub at_container: RamAddress,
    /// Status word; service info word and cyclic data follow.
    pub at_data: RamAddress,
    /// Receive header of the MDT.
    pub mdt_header: RamAddress,
    /// Data container of the MDT; container word and position.
    pub mdt_container: RamAddress,
    /// Control word; service info word and cyclic data follow.
    pub mdt_data: RamAddress,
    /// End marker, two words.
    pub end: RamAddress,
}

impl Block {
    const fn at(at_header: u16, mdt_header: u16, end: u16) -> Self {
        let at_header = RamAddress::new(at_header);
        let mdt_header = RamAddress::new(mdt_header);
        Self {
            at_header,
            at_container: at_header.offset(4),
            at_data: at_header.offset(5),
            mdt_header,
            mdt_container: mdt_header.offset(5),
            mdt_data: mdt_header.offset(7),
            end: RamAddress::new(end),
        }
    }

    /// The block of CP0 to CP2.
    pub const INITIAL: Self = Self::at(0x010, 0x018, 0x022);
    /// The block of CP3 and CP4.
    pub const CYCLIC: Self = Self::at(0x030, 0x048, 0x062);
}

/// COMPT0 and COMPT1: first header of transmission block 0 and 1.
pub const BLOCK_POINTERS: [RamAddress; 2] = [RamAddress::new(0), RamAddress::new(1)];
/// SCPT0: the first of eight pointers to service containers.
pub const SERVICE_POINTERS: RamAddress = RamAddress::new(2);
/// Number of service container pointers.
pub const SERVICE_POINTER_COUNT: u16 = 8;
/// NMSTERR: counter of missed MSTs.
pub const MST_ERRORS: RamAddress = RamAddress::new(10);

/// Service container 0: five control words, then the buffers.
pub const SERVICE_CONTAINER: RamAddress = RamAddress::new(0x070);
/// First buffer word; the container's pointers count from here.
pub const SERVICE_BUFFERS: RamAddress = SERVICE_CONTAINER.offset(5);
/// Pointer value of the first buffer, 16 words.
pub const REGION_A: u8 = 0;
/// Pointer value of the second buffer, 16 words.
pub const REGION_B: u8 = 16;
/// Pointer value of the cell that both pointers name while the master writes.
pub const SHARED_CELL: u8 = 32;
/// First word behind everything this driver uses: behind the shared cell one word stays free,
/// because a chip that reports the end of a buffer one step late (G24) stores one word beyond it.
pub const END: RamAddress = SERVICE_BUFFERS.offset(34);

#[cfg(test)]
mod tests {
    use super::*;
    use crate::uncertain::SEGMENT_WORDS;

    #[test]
    fn the_parts_follow_each_other_without_overlap() {
        let record = SERVICE_WORDS + MAXIMUM_CYCLIC_WORDS;
        let parts = [
            (MST_ERRORS.word(), 1),
            (Block::INITIAL.at_header.word(), 5 + SERVICE_WORDS),
            (Block::INITIAL.mdt_header.word(), 7 + SERVICE_WORDS),
            (Block::INITIAL.end.word(), 2),
            (Block::CYCLIC.at_header.word(), 5 + record),
            (Block::CYCLIC.mdt_header.word(), 7 + record),
            (Block::CYCLIC.end.word(), 2),
            (SERVICE_CONTAINER.word(), 5),
            (SERVICE_BUFFERS.word() + u16::from(REGION_A), SEGMENT_WORDS as u16),
            (SERVICE_BUFFERS.word() + u16::from(REGION_B), SEGMENT_WORDS as u16),
            (SERVICE_BUFFERS.word() + u16::from(SHARED_CELL), 2),
            (END.word(), 0),
        ];
        for pair in parts.windows(2) {
            let [(start, words), (next, _)] = pair else { unreachable!() };
            assert!(start + words <= *next, "{start:#x} + {words} > {next:#x}");
        }
        assert_eq!(SERVICE_POINTERS.word() + SERVICE_POINTER_COUNT, MST_ERRORS.word());
    }
}
