//! Positions of marks: the encoder's index and the two probes, each latched in hardware by a counter of its own.
//!
//! | counter | tracks A, B | channel 3 | channel 4 |
//! |---|---|---|---|
//! | TIM3 | PB4, PB5 | PB0: index, rising | - |
//! | TIM4 | PB6, PB7 | PB8: probe 1, rising | the same pin, falling |
//! | TIM8 | PC6, PC7 | PC8: probe 2, rising | the same pin, falling |
//!
//! TIM2's own latches belong to the SERCON816 (see [`crate::encoder`]), so three more timers count the same tracks. They have 16 bits;
//! what they latch is extended with TIM2's 32 ([`extend`]): right as long as a mark is asked for within 32 767 increments,
//! which is 50 ms at 10 000 increments a revolution and 3900 rpm, against a question every 125 us.
//!
//! All start at different times, so each has an offset to TIM2, measured once. It only changes when a disturbance is counted
//! by one of them and not by the other: [`EdgeLatches::drift`] looks, and is a check of the encoder's lines that a single counter
//! cannot make.
//!
//! The filters are those of TIM2, 8 samples at 84 MHz: TIM8 runs at 168 MHz and takes every second clock. Position and mark then have
//! the same delay in each counter.

use drive::ProbeInput;
use stm32f4xx_hal::{
    pac,
    rcc::{Enable, Rcc},
};

use crate::encoder;

/// An edge of a probe.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Edge {
    /// From 0 to 1.
    Rising,
    /// From 1 to 0.
    Falling,
}

/// A counter beside TIM2.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Counter {
    /// TIM3, which latches the index.
    Index,
    /// TIM4 or TIM8, which latches a probe.
    Probe(ProbeInput),
}

/// The three counters.
#[derive(Debug)]
pub struct EdgeLatches {
    timers: (pac::TIM3, pac::TIM4, pac::TIM8),
    index: u16,
    probes: [u16; 2],
}

impl EdgeLatches {
    /// Starts counting. The encoder must count already, see [`encoder::Encoder`].
    pub(crate) fn new(timers: (pac::TIM3, pac::TIM4, pac::TIM8), rcc: &mut Rcc) -> Self {
        pac::TIM3::enable(rcc);
        pac::TIM4::enable(rcc);
        pac::TIM8::enable(rcc);
        let mut marks = Self { timers, index: 0, probes: [0; 2] };
        marks.index = start(marks.registers(Counter::Index), Filter::EVERY_CLOCK);
        marks.probes = [
            start(marks.registers(Counter::Probe(ProbeInput::One)), Filter::EVERY_CLOCK),
            start(marks.registers(Counter::Probe(ProbeInput::Two)), Filter::EVERY_SECOND_CLOCK),
        ];
        marks
    }

    /// Forgets an index that was seen before.
    #[inline(always)]
    pub fn arm_index(&mut self) {
        self.arm(Counter::Index, flags(Edge::Rising));
    }

    /// Position of the index, in increments, wrapping at 2^32, once for every time that it was passed since [`EdgeLatches::arm_index`].
    ///
    /// Passed more than once since the last question: the last position.
    #[inline(always)]
    pub fn index_latch(&mut self) -> Option<u32> {
        self.latch(Counter::Index, Edge::Rising)
    }

    /// Forgets edges of a probe that were seen before.
    #[inline(always)]
    pub fn arm_probe(&mut self, probe: ProbeInput) {
        self.arm(Counter::Probe(probe), flags(Edge::Rising) | flags(Edge::Falling));
    }

    /// Position of an edge of a probe, as [`EdgeLatches::index_latch`]. A contact that bounces within two questions gives the last bounce.
    #[inline(always)]
    pub fn probe_latch(&mut self, probe: ProbeInput, edge: Edge) -> Option<u32> {
        self.latch(Counter::Probe(probe), edge)
    }

    /// Increments by which a counter has departed from TIM2 since the start: not 0 when one has counted what the other has not.
    ///
    /// `None` when an increment came while the two were read; ask again next time.
    #[inline(always)]
    pub fn drift(&self, counter: Counter) -> Option<i16> {
        let offset_now = offset(encoder::count, || self.registers(counter).cnt().read().cnt().bits())?;
        Some(offset_now.wrapping_sub(self.offset(counter)) as i16)
    }

    #[inline(always)]
    fn arm(&mut self, counter: Counter, flags: u32) {
        // SAFETY: every value is valid for SR, whose bits are cleared by 0 and untouched by 1; the others are not used.
        self.registers(counter).sr().write(|w| unsafe { w.bits(!flags & SR_BITS) });
    }

    #[inline(always)]
    fn latch(&mut self, counter: Counter, edge: Edge) -> Option<u32> {
        let timer = self.registers(counter);
        if timer.sr().read().bits() & flag(edge) == 0 {
            return None;
        }
        // Reading the latch clears the flag.
        let latch = match edge {
            Edge::Rising => timer.ccr3().read().ccr().bits(),
            Edge::Falling => timer.ccr4().read().ccr().bits(),
        };
        // Behind the latch, so that what lies between the two readings is positive or negative as the axis moves, and never wraps.
        let now = encoder::count();
        Some(extend(latch, (now as u16).wrapping_add(self.offset(counter)), now))
    }

    #[inline(always)]
    const fn offset(&self, counter: Counter) -> u16 {
        let [one, two] = self.probes;
        match counter {
            Counter::Index => self.index,
            Counter::Probe(ProbeInput::One) => one,
            Counter::Probe(ProbeInput::Two) => two,
        }
    }

    #[inline(always)]
    fn registers(&self, counter: Counter) -> &pac::tim3::RegisterBlock {
        match counter {
            Counter::Index => &self.timers.0,
            Counter::Probe(ProbeInput::One) => &self.timers.1,
            // SAFETY: what this file uses of TIM8 (CR1, SMCR, SR, CCMR1, CCMR2, CCER, CNT, ARR, CCR3, CCR4) has the offsets and, for
            // inputs, the bits of TIM3 (RM0090, register maps of 17.4 and 18.4), and `self` owns TIM8.
            Counter::Probe(ProbeInput::Two) => unsafe { &*pac::TIM8::ptr().cast::<pac::tim3::RegisterBlock>() },
        }
    }
}

/// Field ICxF for 8 equal samples at 84 MHz.
struct Filter(u32);

impl Filter {
    /// Of a timer that runs at 84 MHz.
    const EVERY_CLOCK: Self = Self(0b0011);
    /// Of a timer that runs at 168 MHz.
    const EVERY_SECOND_CLOCK: Self = Self(0b0101);

    /// CCMR1: channels 1 and 2 are tracks A and B.
    const fn tracks(&self) -> u32 {
        const TI1: u32 = 0b01;
        const TI2: u32 = 0b01 << 8;
        TI1 | TI2 | self.0 << 4 | self.0 << 12
    }

    /// CCMR2: channels 3 and 4 both look at pin 3, behind its filter, which is IC3F.
    const fn marks(&self) -> u32 {
        const TI3: u32 = 0b01;
        const TI3_OF_CHANNEL_4: u32 = 0b10 << 8;
        TI3 | TI3_OF_CHANNEL_4 | self.0 << 4
    }
}

/// CCER: channel 3 captures rising edges, channel 4 falling ones; 1 and 2 stay non-inverted, as encoder mode wants.
const EDGES: u32 = {
    const CC3E: u32 = 1 << 8;
    const CC4E: u32 = 1 << 12;
    const CC4P: u32 = 1 << 13;
    CC3E | CC4E | CC4P
};

/// The defined bits of SR.
const SR_BITS: u32 = 0x1E5F;

/// An edge was captured (CC3IF, CC4IF).
const fn flag(edge: Edge) -> u32 {
    match edge {
        Edge::Rising => 1 << 3,
        Edge::Falling => 1 << 4,
    }
}

/// The same, and that it was captured twice (CC3OF, CC4OF).
const fn flags(edge: Edge) -> u32 {
    flag(edge) | flag(edge) << 8
}

/// Sets a counter up, starts it, and returns its offset to TIM2.
fn start(timer: &pac::tim3::RegisterBlock, filter: Filter) -> u16 {
    // SAFETY: the constants are built of defined fields only.
    unsafe {
        timer.ccmr1_input().write(|w| w.bits(filter.tracks()));
        timer.ccmr2_input().write(|w| w.bits(filter.marks()));
        timer.ccer().write(|w| w.bits(EDGES));
    }
    timer.smcr().write(|w| w.sms().encoder_mode_3());
    timer.arr().write(|w| w.arr().set(u16::MAX));
    timer.cr1().write(|w| w.cen().set_bit());
    // Two increments lie 95 ns apart at least, which is the time of the readings: even a shaft that is turned at full speed lets one
    // of these attempts through, and 0 afterwards would show as a drift at once.
    const ATTEMPTS: u8 = 100;
    (0..ATTEMPTS).find_map(|_| offset(encoder::count, || timer.cnt().read().cnt().bits())).unwrap_or(0)
}

/// Offset of a 16-bit counter to TIM2, if TIM2 stood still while it was read.
#[inline(always)]
fn offset(wide: impl Fn() -> u32, narrow: impl Fn() -> u16) -> Option<u16> {
    let before = wide();
    let narrow = narrow();
    offset_of(before, narrow, wide())
}

/// Offset of `narrow`, read between `before` and `after`.
const fn offset_of(before: u32, narrow: u16, after: u32) -> Option<u16> {
    if before == after { Some(narrow.wrapping_sub(after as u16)) } else { None }
}

/// The 32-bit count at which a 16-bit counter latched `latch`, with both counts at one and the same later instant.
///
/// Right if they are less than 32 768 increments apart, in either direction.
#[must_use]
pub const fn extend(latch: u16, count16_now: u16, count32_now: u32) -> u32 {
    let since = count16_now.wrapping_sub(latch) as i16;
    count32_now.wrapping_sub(since as u32)
}

const _: () = {
    assert!(Filter::EVERY_CLOCK.tracks() == 0x3131 && Filter::EVERY_SECOND_CLOCK.tracks() == 0x5151);
    assert!(Filter::EVERY_CLOCK.marks() == 0x0231 && Filter::EVERY_SECOND_CLOCK.marks() == 0x0251);
    assert!(EDGES == 0x3100);
    assert!(flags(Edge::Rising) == 0x0808 && flags(Edge::Falling) == 0x1010);
    assert!(!flags(Edge::Rising) & SR_BITS == 0x1657 && !flags(Edge::Falling) & SR_BITS == 0x0E4F);
};

// Standing, forwards, backwards; across the wraps of either count; the farthest in both directions, and one beyond.
const _: () = {
    assert!(extend(5, 5, 1_000) == 1_000);
    assert!(extend(5, 9, 1_000) == 996 && extend(9, 5, 1_000) == 1_004);
    assert!(extend(0xFFFE, 3, 0x1_0003) == 0xFFFE && extend(3, 0xFFFE, 0xFFFE) == 0x1_0003);
    assert!(extend(0xFFF0, 0, 5) == 0xFFFF_FFF5 && extend(0, 0xFFF0, 0xFFFF_FFF8) == 8);
    assert!(extend(0, 32_767, 100_000) == 67_233 && extend(32_768, 0, 100_000) == 132_768);
    assert!(extend(0, 32_769, 100_000) == 132_767, "too far back: taken for a mark ahead");
};

// Offsets, and what a latch becomes with them.
const _: () = {
    assert!(matches!(offset_of(70_000, 4_464, 70_000), Some(0)));
    assert!(matches!(offset_of(70_000, 4_460, 70_000), Some(0xFFFC)));
    assert!(matches!(offset_of(0xFFFF_FFFF, 7, 0xFFFF_FFFF), Some(8)));
    assert!(offset_of(70_000, 4_464, 70_001).is_none());
    assert!(extend(4_450, (70_100u32 as u16).wrapping_add(0xFFFC), 70_100) == 69_990);
};
