//! Contents, times and the cut.

use std::time::Duration;

use crate::FlashError;
use crate::dice::Dice;
use crate::left_over;

/// Bytes of a sector.
pub const SECTOR_BYTES: usize = 128 * 1024;
/// How many sectors there are: 10 and 11 of the part.
pub const SECTORS: usize = 2;
/// Bytes of all sectors.
pub const CAPACITY: usize = SECTORS * SECTOR_BYTES;

/// What is programmed at once, and how many bits are erased at once: PSIZE (RM0090 3.6.2).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Width {
    /// 8 bits.
    Byte,
    /// 16 bits; from 2.1 V on.
    HalfWord,
    /// 32 bits; from 2.7 V on.
    Word,
}

impl Width {
    /// In bytes.
    #[must_use]
    pub const fn bytes(self) -> usize {
        match self {
            Self::Byte => 1,
            Self::HalfWord => 2,
            Self::Word => 4,
        }
    }
}

/// Which of the data sheet's times an operation takes (DocID022152, table "Flash memory programming").
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Speed {
    /// 16 us to program, 1 s to erase with words.
    #[default]
    Typical,
    /// 100 us to program, 2 s to erase with words.
    Longest,
}

impl Speed {
    /// Programming takes this, whatever the width.
    #[must_use]
    pub const fn programming(self) -> Duration {
        match self {
            Self::Typical => Duration::from_micros(16),
            Self::Longest => Duration::from_micros(100),
        }
    }

    /// Erasing a sector of 128 KiB takes this.
    #[must_use]
    pub const fn erasing(self, width: Width) -> Duration {
        let typical = match width {
            Width::Byte => 2_000,
            Width::HalfWord => 1_300,
            Width::Word => 1_000,
        };
        match self {
            Self::Typical => Duration::from_millis(typical),
            Self::Longest => Duration::from_millis(2 * typical),
        }
    }
}

/// The supply has gone in an operation, or before it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Cut {
    /// So long after the operation had begun.
    pub after: Duration,
}

/// The supply goes within an operation that is to come.
#[derive(Clone, Copy, Debug)]
struct Plan {
    /// The number of that operation.
    operation: u64,
    seed: u64,
}

/// An operation, as far as it can be left undone.
#[derive(Clone)]
enum Last {
    Word { offset: usize, width: Width, old: u32 },
    Sector { number: usize, old: Vec<u8> },
}

/// Two sectors of flash.
#[derive(Clone)]
pub struct FlashModel {
    contents: Vec<u8>,
    last: Option<Last>,
    speed: Speed,
    plan: Option<Plan>,
    is_supplied: bool,
    operations: u64,
    erases: [u64; SECTORS],
    busy: Duration,
}

impl Default for FlashModel {
    fn default() -> Self {
        Self::new()
    }
}

/// Without the contents, which nobody reads as text.
impl std::fmt::Debug for FlashModel {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { speed, plan, is_supplied, operations, erases, busy, .. } = self;
        formatter
            .debug_struct("FlashModel")
            .field("speed", speed)
            .field("plan", plan)
            .field("is_supplied", is_supplied)
            .field("operations", operations)
            .field("erases", erases)
            .field("busy", busy)
            .finish_non_exhaustive()
    }
}

impl FlashModel {
    /// Both sectors erased.
    #[must_use]
    pub fn new() -> Self {
        Self {
            contents: vec![0xFF; CAPACITY],
            last: None,
            speed: Speed::default(),
            plan: None,
            is_supplied: true,
            operations: 0,
            erases: [0; SECTORS],
            busy: Duration::ZERO,
        }
    }

    /// With contents from the first byte on; what is behind them is erased.
    ///
    /// # Errors
    /// [`FlashError::OutOfBounds`]: there are more of them than fit.
    pub fn with_contents(contents: &[u8]) -> Result<Self, FlashError> {
        let mut flash = Self::new();
        flash.contents.get_mut(..contents.len()).ok_or(FlashError::OutOfBounds)?.copy_from_slice(contents);
        Ok(flash)
    }

    /// From now on operations take these times.
    pub const fn set_speed(&mut self, speed: Speed) {
        self.speed = speed;
    }

    /// All bytes, [`CAPACITY`] of them.
    #[must_use]
    pub fn contents(&self) -> &[u8] {
        &self.contents
    }

    /// All bytes, to be damaged; takes no time and is no operation.
    pub fn contents_mut(&mut self) -> &mut [u8] {
        &mut self.contents
    }

    /// The supply goes within the `nth` operation from now on, the next being the first. What is left of the word or sector depends on the
    /// `seed`. Takes the place of a cut that has not come yet.
    pub const fn cut_in(&mut self, nth: u64, seed: u64) {
        self.plan = Some(Plan { operation: self.operations + nth, seed });
    }

    /// Is there a supply?
    #[must_use]
    pub const fn is_supplied(&self) -> bool {
        self.is_supplied
    }

    /// The supply is back, the contents are as it left them. A cut that has not come yet is forgotten.
    pub const fn restore_supply(&mut self) {
        self.is_supplied = true;
        self.plan = None;
    }

    /// Operations that have begun: words programmed and sectors erased.
    #[must_use]
    pub const fn operations(&self) -> u64 {
        self.operations
    }

    /// How often the erase of each sector has begun. A sector stands 10 000 at least (DocID022152, "Flash memory endurance").
    #[must_use]
    pub const fn erases(&self) -> [u64; SECTORS] {
        self.erases
    }

    /// How long all operations took so far.
    #[must_use]
    pub const fn busy(&self) -> Duration {
        self.busy
    }

    /// What is at an offset: a byte, half-word or word, little-endian. Zero beyond the end.
    #[must_use]
    pub fn value(&self, offset: usize, width: Width) -> u32 {
        let bytes = self.contents.iter().skip(offset).take(width.bytes());
        bytes.rev().fold(0, |value, byte| value << 8 | u32::from(*byte))
    }

    /// Programs `value` at an `offset`: ones become zeros where it has zeros, no zero becomes a one. Returns how long it takes.
    ///
    /// # Errors
    /// The supply has gone.
    ///
    /// # Panics
    /// The offset is beyond the end.
    pub fn program(&mut self, offset: usize, value: u32, width: Width) -> Result<Duration, Cut> {
        let takes = self.speed.programming();
        let cut = self.begin(takes)?;
        let old = self.value(offset, width);
        self.set(offset, old & value, width);
        self.last = Some(Last::Word { offset, width, old });
        self.end(takes, cut)
    }

    /// Erases a sector: 0 or 1. Returns how long it takes.
    ///
    /// # Errors
    /// The supply has gone.
    ///
    /// # Panics
    /// There is no such sector.
    pub fn erase(&mut self, sector: usize, width: Width) -> Result<Duration, Cut> {
        let takes = self.speed.erasing(width);
        let cut = self.begin(takes)?;
        self.erases[sector] += 1;
        let bytes = &mut self.contents[sector * SECTOR_BYTES..][..SECTOR_BYTES];
        self.last = Some(Last::Sector { number: sector, old: bytes.to_vec() });
        bytes.fill(0xFF);
        self.end(takes, cut)
    }

    /// The last operation did not come to its end: the processor was reset in it. What is left of the word or sector depends on the `seed`.
    pub fn interrupt(&mut self, seed: u64) {
        self.leave_undone(&mut Dice::new(seed));
    }

    fn leave_undone(&mut self, dice: &mut Dice) {
        match self.last.take() {
            None => {}
            Some(Last::Word { offset, width, old }) => {
                let left = left_over::of_programming(old, self.value(offset, width), dice);
                self.set(offset, left, width);
            }
            Some(Last::Sector { number, old }) => {
                let bytes = &mut self.contents[number * SECTOR_BYTES..][..SECTOR_BYTES];
                bytes.copy_from_slice(&old);
                left_over::of_erasing(bytes, dice);
            }
        }
    }

    fn set(&mut self, offset: usize, value: u32, width: Width) {
        let bytes = width.bytes();
        self.contents[offset..offset + bytes].copy_from_slice(&value.to_le_bytes()[..bytes]);
    }

    fn end(&mut self, takes: Duration, cut: Option<(Dice, Cut)>) -> Result<Duration, Cut> {
        let Some((mut dice, cut)) = cut else { return Ok(takes) };
        self.leave_undone(&mut dice);
        Err(cut)
    }

    /// Counts an operation and tells whether, and when, the supply goes in it.
    fn begin(&mut self, takes: Duration) -> Result<Option<(Dice, Cut)>, Cut> {
        if !self.is_supplied {
            return Err(Cut { after: Duration::ZERO });
        }
        self.operations += 1;
        let Some(plan) = self.plan.filter(|plan| plan.operation == self.operations) else {
            self.busy += takes;
            return Ok(None);
        };
        self.plan = None;
        self.is_supplied = false;
        let mut dice = Dice::new(plan.seed);
        let after = Duration::from_nanos(dice.below(takes.as_nanos() as u64));
        self.busy += after;
        Ok(Some((dice, Cut { after })))
    }
}
