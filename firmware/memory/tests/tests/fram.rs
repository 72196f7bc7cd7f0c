//! The seam: an FRAM on a simulated SPI bus in the place of the processor's flash.

use core::convert::Infallible;

use embedded_hal::spi::{ErrorType, Operation, SpiDevice};
use memory::{Condition, Error, Fram, FramError};

use crate::{load, save, set, started};

/// An MB85RS256 or the like: what its data sheet says that it does with the bytes between two edges of its chip select.
#[derive(Clone)]
struct Part {
    cells: Vec<u8>,
    enabled: bool,
    /// The pin WP, with the block protection set.
    protected: bool,
    address_bytes: usize,
}

impl Part {
    fn new(bytes: usize, address_bytes: usize) -> Self {
        Self { cells: vec![0; bytes], enabled: false, protected: false, address_bytes }
    }
}

impl ErrorType for Part {
    type Error = Infallible;
}

impl SpiDevice for Part {
    fn transaction(&mut self, operations: &mut [Operation<'_, u8>]) -> Result<(), Infallible> {
        let mut sent = Vec::new();
        let mut address = None;
        for operation in operations {
            match operation {
                Operation::Write(bytes) => {
                    for byte in bytes.iter() {
                        let head = 1 + self.address_bytes;
                        if sent.len() == head && address.is_none() {
                            address = Some(of(&sent[1..]));
                        }
                        if let Some(at) = address.as_mut().filter(|_| sent[0] == 0x02) {
                            if self.enabled && !self.protected {
                                let size = self.cells.len();
                                self.cells[*at % size] = *byte;
                            }
                            *at += 1;
                        } else {
                            sent.push(*byte);
                        }
                    }
                }
                Operation::Read(bytes) => {
                    assert_eq!(
                        (sent.len(), sent[0]),
                        (1 + self.address_bytes, 0x03),
                        "a read has its command and its address"
                    );
                    let from = of(&sent[1..]);
                    for (place, byte) in bytes.iter_mut().enumerate() {
                        *byte = self.cells[(from + place) % self.cells.len()];
                    }
                }
                other => panic!("{other:?}"),
            }
        }
        // WREN lasts until the next write ends (data sheet, "write enable latch").
        self.enabled = sent[0] == 0x06 && sent.len() == 1;
        Ok(())
    }
}

fn of(address: &[u8]) -> usize {
    address.iter().fold(0, |sum, byte| sum << 8 | usize::from(*byte))
}

#[test]
fn an_fram_takes_the_place_of_the_flash_and_its_pages_turn() {
    let mut part = Part::new(32 * 1_024, 2);
    for number in 1..=200 {
        let (mut memory, condition) = started(Fram::<_, 16_384, 2>::new(part)).unwrap();
        // As delivered it is full of zeros, which is no memory of ours.
        assert_eq!(condition, if number == 1 { Condition::Damaged } else { Condition::Whole });
        let before = (number > 1).then(|| set(number - 1, 1_800));
        assert_eq!(load(&mut memory), before);
        save(&mut memory, &set(number, 1_800)).unwrap();
        part = memory.flash().clone_part();
    }
}

#[test]
fn a_large_part_has_addresses_of_three_bytes() {
    let (mut memory, _) = started(Fram::<_, 131_072, 3>::new(Part::new(256 * 1_024, 3))).unwrap();
    save(&mut memory, &set(1, 1_800)).unwrap();
    let part = memory.flash().clone_part();
    assert!(part.cells.contains(&0xFF) && part.cells.len() == 262_144);
    assert_eq!(load(&mut started(Fram::<_, 131_072, 3>::new(part)).unwrap().0), Some(set(1, 1_800)));
}

#[test]
fn a_part_that_is_protected_or_not_there_is_told() {
    let protected = Part { protected: true, ..Part::new(32 * 1_024, 2) };
    let refused = started(Fram::<_, 16_384, 2>::new(protected)).err();
    assert_eq!(refused, Some(Error::Flash(FramError::NotWritten)));
}

trait ClonePart {
    fn clone_part(&mut self) -> Part;
}

impl<const PAGE: usize, const ADDRESS: usize> ClonePart for Fram<Part, PAGE, ADDRESS> {
    fn clone_part(&mut self) -> Part {
        core::mem::replace(self, Self::new(Part::new(0, ADDRESS))).release()
    }
}
