//! The microsecond counter that starts at the MST. sercon816.md 5.7.

use crate::time::Nanoseconds;
use crate::wire::BitRate;

/// What is wired to the chip's clock and bit rate pins.
#[derive(Copy, Clone, Debug, PartialEq, Eq)]
pub struct Straps {
    /// Bit rate of the ring, from the pins SBAUD and SBAUD16.
    pub bit_rate: BitRate,
    /// Frequency at the pin MCLK in MHz, at most 32.
    pub mclk_megahertz: u32,
}

impl Default for Straps {
    /// 2 Mbit/s, 32 MHz.
    fn default() -> Self {
        Self { bit_rate: BitRate::M2, mclk_megahertz: 32 }
    }
}

impl Straps {
    /// Duration of `halves` half bits in picoseconds.
    fn half_bits(self, halves: i64) -> i64 {
        halves * (500_000 / self.bit_rate.megabits() as i64)
    }

    /// Duration of `halves` half periods of MCLK in picoseconds.
    fn half_clocks(self, halves: i64) -> i64 {
        (halves * 500_000).div_euclid(i64::from(self.mclk_megahertz))
    }

    /// From the end of an MST's closing flag until the chip has recognised it: `t_start`.
    fn mst_recognition(self) -> i64 {
        self.half_bits(11) + self.half_clocks(7)
    }

    /// From the start of a telegram until the chip has recognised it: `t_rdelnom` without `t_cycdel`.
    fn telegram_recognition(self) -> i64 {
        self.half_bits(59) + self.half_clocks(5)
    }
}

/// The counter of one cycle, latched at its MST from 0EH and 13H.
#[derive(Copy, Clone, Debug)]
pub(super) struct TimeBase {
    straps: Straps,
    /// When the counter shows TCNTST as a whole number.
    preset_picoseconds: i64,
    preset: i64,
    clocks_per_tick: i64,
}

impl TimeBase {
    /// The counter after an MST that ended at `mst_end`; `divider` is 0EH, `preset` 13H.
    ///
    /// With the values of sercon816.md 5.7 the counter shows N exactly N us after `mst_end`.
    pub(super) fn new(mst_end: Nanoseconds, straps: Straps, divider: u16, preset: u16) -> Self {
        let start = i64::from(divider >> 8);
        Self {
            straps,
            preset_picoseconds: to_picoseconds(mst_end) + straps.mst_recognition() + straps.half_clocks(2 * start - 1),
            preset: i64::from(preset),
            clocks_per_tick: i64::from(divider & 0xFF) + 1,
        }
    }

    /// When the counter reaches `count`.
    pub(super) fn time_of(&self, count: i32) -> Nanoseconds {
        let ticks = i64::from(count) - self.preset;
        to_nanoseconds(self.preset_picoseconds + self.straps.half_clocks(2 * ticks * self.clocks_per_tick))
    }

    /// Whether the counter, which starts at its preset, comes to this count at all.
    pub(super) fn reaches(&self, count: i32) -> bool {
        i64::from(count) > self.preset
    }

    /// The count at which an MST with its end at `end` is recognised.
    pub(super) fn mst_count(&self, end: Nanoseconds) -> i32 {
        self.count_at(to_picoseconds(end) + self.straps.mst_recognition())
    }

    /// The count at which a telegram that starts at `start` is recognised.
    pub(super) fn telegram_count(&self, start: Nanoseconds) -> i32 {
        self.count_at(to_picoseconds(start) + self.straps.telegram_recognition())
    }

    /// The number of whole ticks between two instants.
    pub(super) fn ticks_between(&self, from: Nanoseconds, to: Nanoseconds) -> u16 {
        let ticks = (to_picoseconds(to) - to_picoseconds(from)) / self.tick_picoseconds();
        ticks.clamp(0, 0xFFFF) as u16
    }

    fn count_at(&self, picoseconds: i64) -> i32 {
        let ticks = (picoseconds - self.preset_picoseconds).div_euclid(self.tick_picoseconds());
        (self.preset + ticks).clamp(i64::from(i32::MIN), i64::from(i32::MAX)) as i32
    }

    fn tick_picoseconds(&self) -> i64 {
        self.straps.half_clocks(2 * self.clocks_per_tick).max(1)
    }
}

/// Duration of `ticks` ticks of the counter with the divider 0EH.
pub(super) fn ticks(straps: Straps, divider: u16, ticks: u16) -> Nanoseconds {
    to_nanoseconds(straps.half_clocks(2 * (i64::from(divider & 0xFF) + 1) * i64::from(ticks)))
}

fn to_picoseconds(time: Nanoseconds) -> i64 {
    time.0 as i64 * 1_000
}

fn to_nanoseconds(picoseconds: i64) -> Nanoseconds {
    Nanoseconds((picoseconds.max(0) as u64 + 500) / 1_000)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// sercon816.md 5.7, "Worked values": f_MCLK, Mbit/s, 0EH, TCNTST.
    const WORKED: [(u32, u64, u16, u16); 6] = [
        (16, 2, 0x010F, 3),
        (16, 4, 0x070F, 2),
        (32, 2, 0x051F, 3),
        (32, 4, 0x111F, 2),
        (32, 8, 0x071F, 1),
        (32, 16, 0x121F, 1),
    ];

    #[test]
    fn the_worked_values_make_the_counter_show_microseconds_after_the_mst() {
        for (mclk_megahertz, megabits, divider, preset) in WORKED {
            let straps = Straps { bit_rate: BitRate::from_megabits(megabits).unwrap(), mclk_megahertz };
            let base = TimeBase::new(Nanoseconds(1_000_000), straps, divider, preset);
            for count in [0, 150, 65_000] {
                assert_eq!(
                    base.time_of(count),
                    Nanoseconds(1_000_000 + count as u64 * 1_000),
                    "{mclk_megahertz} MHz, {megabits} Mbit/s"
                );
            }
            // An MST after exactly 2000 us stands in the middle of the window around TSCYC + TCNTST.
            let count = base.mst_count(Nanoseconds(3_000_000));
            assert!((2_000 + i32::from(preset) - 1..=2_000 + i32::from(preset)).contains(&count));
        }
    }

    #[test]
    fn a_wrong_preset_or_divider_makes_every_time_wrong() {
        let end = Nanoseconds(1_000_000);
        let straps = Straps::default();
        let late = TimeBase::new(end, straps, 0x051F, 1);
        assert_eq!(late.time_of(150), Nanoseconds(1_152_000));
        let late = TimeBase::new(end, straps, 0x151F, 3);
        assert_eq!(late.time_of(150), Nanoseconds(1_150_500));
        let fast = TimeBase::new(end, straps, 0x050F, 3);
        assert_eq!(fast.time_of(1_003), Nanoseconds(1_503_000));
    }

    #[test]
    fn a_telegram_is_recognised_29_and_a_half_bits_after_its_start() {
        let base = TimeBase::new(Nanoseconds(0), Straps::default(), 0x051F, 3);
        assert_eq!(base.telegram_count(Nanoseconds(500_000)), 514);
        assert_eq!(base.telegram_count(Nanoseconds(500_200)), 515);
    }
}
