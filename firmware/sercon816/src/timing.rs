//! Start values and windows of the chip's microsecond counter (sercon816.md 5.7 and G25).
//!
//! All terms are exact multiples of 1/1600 us, so integer arithmetic gives the very values of the formulas.

use crate::rate::{BitRate, ClockDivider, MasterClock};
use crate::uncertain;

/// Units of this module in one microsecond.
const MICROSECOND: i32 = 1600;

/// A window in whole microseconds, relative to a nominal time; both edges belong to it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Window {
    /// Lower edge in us, may be negative.
    pub start: i16,
    /// Upper edge in us.
    pub end: i16,
}

/// The formulas for one clock and one bit rate.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Timing {
    clock: MasterClock,
    rate: BitRate,
}

#[allow(
    clippy::arithmetic_side_effects,
    reason = "all operands are bounded by the two enums and by a 16-bit cycle time; the largest sum is below 2^28"
)]
impl Timing {
    /// The timing for a clock and a bit rate.
    #[must_use]
    pub const fn new(clock: MasterClock, rate: BitRate) -> Self {
        Self { clock, rate }
    }

    /// The bit rate.
    #[must_use]
    pub const fn bit_rate(&self) -> BitRate {
        self.rate
    }

    /// t_start, the internal delay of MST recognition: 5.5 bit times and 3.5 clocks.
    const fn start_delay(&self) -> i32 {
        (11 * self.rate.bit_time() + 7 * self.clock.period()) / 2
    }

    /// TCNTST (13H): start value of the microsecond counter at the MST.
    #[must_use]
    pub const fn counter_start(&self) -> u16 {
        (self.start_delay() / MICROSECOND + 1) as u16
    }

    /// MCLKDIV and MCLKST (0EH).
    #[must_use]
    pub const fn clock_divider(&self) -> ClockDivider {
        let remainder = self.counter_start() as i32 * MICROSECOND - self.start_delay();
        let preset = remainder * self.clock.megahertz() / MICROSECOND + 1;
        ClockDivider::DEFAULT.with_divider((self.clock.megahertz() - 1) as u8).with_preset(preset as u8)
    }

    const fn with_jitter(&self, limit: i32) -> i32 {
        limit + 4 * self.rate.bit_time()
    }

    /// JT_scyc in CP3 and CP4: half a per cent of the cycle time, at most 5 us, and four bit times.
    const fn cyclic_jitter(&self, cycle_us: u16) -> i32 {
        let half_per_cent = cycle_us as i32 * (MICROSECOND / 200);
        self.with_jitter(if half_per_cent < 5 * MICROSECOND { half_per_cent } else { 5 * MICROSECOND })
    }

    const fn mst_window(&self, jitter: i32) -> Window {
        let whole = jitter / MICROSECOND;
        let start = self.counter_start() as i32;
        Window { start: (start - whole) as i16, end: (start + whole) as i16 }
    }

    /// JTSCYC1 and JTSCYC2 (15H, 16H) in CP0 to CP2.
    #[must_use]
    pub const fn initial_mst_window(&self) -> Window {
        self.mst_window(self.with_jitter(5 * MICROSECOND))
    }

    /// JTSCYC1 and JTSCYC2 (15H, 16H) in CP3 and CP4, for a cycle time in us.
    #[must_use]
    pub const fn cyclic_mst_window(&self, cycle_us: u16) -> Window {
        self.mst_window(self.cyclic_jitter(cycle_us))
    }

    /// JTRDEL1 and JTRDEL2 (18H, 19H) in CP1 and CP2, for an MDT header time of 500 us (G25):
    /// every MDT that starts 500 to 700 us after the MST, and 5 us more.
    #[must_use]
    pub const fn initial_telegram_window(&self) -> Window {
        let recognition = 59 * self.rate.bit_time() / 2;
        let end = (uncertain::INITIAL_MDT_SPAN_US as i32 + 5) * MICROSECOND + recognition;
        Window { start: 0, end: ((end + MICROSECOND - 1) / MICROSECOND) as i16 }
    }

    /// JTRDEL1 and JTRDEL2 (18H, 19H) in CP3 and CP4, for a cycle time in us (G25), not yet clamped.
    ///
    /// The ring delay counts as zero: MST and MDT reach a slave the same way.
    #[must_use]
    pub const fn cyclic_telegram_window(&self, cycle_us: u16) -> Window {
        let nominal = (59 * self.rate.bit_time() + 5 * self.clock.period()) / 2;
        let margin = self.cyclic_jitter(cycle_us) + (self.rate.bit_time() + self.clock.period()) / 2;
        let start = (nominal - margin).div_euclid(MICROSECOND) - 1;
        let end = (nominal + margin) / MICROSECOND + uncertain::TELEGRAM_WINDOW_MARGIN_US as i32;
        Window { start: start as i16, end: end as i16 }
    }

    /// Longest duration in us, rounded up, of a telegram with so many 16-bit words of data:
    /// two flags, and 9.6 bits for each byte of address, data and FCS (sercon816.md 5.7).
    #[must_use]
    pub const fn telegram_duration_us(&self, words: u16) -> u16 {
        let bytes = 3 + 2 * words as i32;
        let stuffed = bytes * 48 * (self.rate.bit_time() / 5);
        let duration = 16 * self.rate.bit_time() + stuffed;
        let whole = (duration + MICROSECOND - 1) / MICROSECOND;
        if whole > u16::MAX as i32 { u16::MAX } else { whole as u16 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const fn timing(megahertz: u32, rate: BitRate) -> Timing {
        Timing::new(if megahertz == 16 { MasterClock::Mhz16 } else { MasterClock::Mhz32 }, rate)
    }

    #[test]
    fn start_values_match_the_worked_table() {
        let table = [
            (16, BitRate::Mbit2, 3, 0x010F, -4, 10),
            (16, BitRate::Mbit4, 2, 0x070F, -4, 8),
            (32, BitRate::Mbit2, 3, 0x051F, -4, 10),
            (32, BitRate::Mbit4, 2, 0x111F, -4, 8),
            (32, BitRate::Mbit8, 1, 0x071F, -4, 6),
            (32, BitRate::Mbit16, 1, 0x121F, -4, 6),
        ];
        for (clock, rate, start, divider, lower, upper) in table {
            let timing = timing(clock, rate);
            assert_eq!(timing.counter_start(), start, "{timing:?}");
            assert_eq!(timing.clock_divider().raw_value(), divider, "{timing:?}");
            assert_eq!(timing.initial_mst_window(), Window { start: lower, end: upper }, "{timing:?}");
        }
    }

    #[test]
    fn start_delays_match_the_worked_table() {
        let table = [
            (16, BitRate::Mbit2, 2.96875),
            (16, BitRate::Mbit4, 1.59375),
            (32, BitRate::Mbit2, 2.859_375),
            (32, BitRate::Mbit4, 1.484_375),
            (32, BitRate::Mbit8, 0.796_875),
            (32, BitRate::Mbit16, 0.453_125),
        ];
        for (clock, rate, microseconds) in table {
            assert_eq!(f64::from(timing(clock, rate).start_delay()) / 1600.0, microseconds);
        }
    }

    #[test]
    fn the_preset_is_rounded_down_and_one_added_even_where_the_sources_differ() {
        assert_eq!(timing(16, BitRate::Mbit16).clock_divider().preset(), 8);
    }

    #[test]
    fn telegram_windows_match_the_worked_table() {
        let table = [
            (BitRate::Mbit2, 6, 23, 220),
            (BitRate::Mbit4, 0, 14, 213),
            (BitRate::Mbit8, -3, 10, 209),
            (BitRate::Mbit16, -5, 8, 207),
        ];
        for (rate, start, end, initial) in table {
            let timing = timing(32, rate);
            for cycle in [1000, 2000, 10_000, 65_000] {
                assert_eq!(timing.cyclic_telegram_window(cycle), Window { start, end }, "{rate:?}");
            }
            assert_eq!(timing.initial_telegram_window(), Window { start: 0, end: initial }, "{rate:?}");
        }
    }

    /// The formulas as they are printed, in floating point.
    fn printed(f: f64, bit: f64, cycle: f64) -> (i16, i16, i16, i16) {
        let start = (5.5 * bit + 3.5 / f + 1.0).floor();
        let jitter = (0.005 * cycle).min(5.0) + 4.0 * bit;
        let nominal = 29.5 * bit + 2.5 / f;
        let margin = jitter + bit / 2.0 + 0.5 / f;
        (
            (start - jitter.floor()) as i16,
            (start + jitter.floor()) as i16,
            (nominal - margin - 1.0).floor() as i16,
            (nominal + margin + 1.0).floor() as i16,
        )
    }

    #[test]
    fn cyclic_windows_follow_the_printed_formulas_for_short_cycles_too() {
        for (rate, bit) in BitRate::ALL.into_iter().zip([0.5, 0.25, 0.125, 0.0625]) {
            for clock in [16, 32] {
                // 62 and 125 us are legal cycle times; multiples of 25 us keep the floating-point side exact enough.
                for cycle in (125..=65_000_u16).step_by(125) {
                    let timing = timing(clock, rate);
                    let mst = timing.cyclic_mst_window(cycle);
                    let telegram = timing.cyclic_telegram_window(cycle);
                    assert_eq!(
                        (mst.start, mst.end, telegram.start, telegram.end),
                        printed(f64::from(clock), bit, f64::from(cycle)),
                        "{timing:?} {cycle} us"
                    );
                }
            }
        }
    }

    #[test]
    fn durations_match_the_worked_table() {
        // AT with 8 bytes of cyclic data: status, info and 4 words.
        for (rate, us) in BitRate::ALL.into_iter().zip([80, 40, 20, 10]) {
            assert_eq!(timing(32, rate).telegram_duration_us(6), us);
        }
        // MDT of four drives with 4 bytes each: 16 words.
        for (rate, us) in BitRate::ALL.into_iter().zip([176, 88, 44, 22]) {
            assert_eq!(timing(32, rate).telegram_duration_us(16), us);
        }
    }
}
