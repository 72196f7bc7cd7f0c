//! The current that an acceleration needs: its factor, and how it follows the commands.
//!
//! The accelerations of lines are the differences of commands that are rounded: at 500 us one increment of 0.0001 degrees is 7 rad/s². The
//! smoothing takes that out, once per command.

use crate::arithmetic::limited_gain::LimitedGain;
use crate::arithmetic::trigonometry::high_product;
use crate::path::settings::InterpolatorSettings;
use crate::units::LOOP_PERIOD_MICROSECONDS;
use crate::units::derivatives::SignedAcceleration;

/// A factor below 2^20 from 2^-42 revolutions per tick squared to 2^-25 of the peak current; what it makes is limited to four peaks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub(crate) struct AccelerationGain(LimitedGain);

/// Four peaks.
const LIMIT: i32 = 1 << 27;

impl AccelerationGain {
    /// The factor `numerator / denominator`; `None` when the denominator is 0 or above 2^126, or the factor is 2^20 or more. Slow.
    pub(crate) fn from_ratio(numerator: u128, denominator: u128) -> Option<Self> {
        LimitedGain::from_ratio(numerator, denominator).map(Self)
    }

    #[inline]
    pub(crate) fn apply(self, acceleration: SignedAcceleration) -> i32 {
        self.0.apply(acceleration.coarse()).clamp(-LIMIT, LIMIT - 1)
    }
}

/// How quickly what is fed forward follows the commands, scaled.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub(crate) struct AccelerationSmoothing {
    /// Of a command in what is fed forward, in 2^-30.
    share: i32,
}

impl AccelerationSmoothing {
    /// A time constant in us, for commands every so many ticks; 0 follows each command at once.
    pub(crate) const fn new(time_constant: u16, ticks_per_cycle: u16) -> Self {
        let cycle = (LOOP_PERIOD_MICROSECONDS as u64).saturating_mul(ticks_per_cycle as u64);
        match (cycle << 30).checked_div(cycle.saturating_add(time_constant as u64)) {
            Some(share) => Self { share: share as i32 },
            None => Self { share: 1 << 30 },
        }
    }

    /// From one current towards another, both within four peaks.
    #[inline]
    fn towards(self, from: i32, to: i32) -> i32 {
        // They are less than 2^29 apart.
        from.wrapping_add(high_product(to.wrapping_sub(from) << 2, self.share))
    }
}

/// The current for the acceleration of a path, in 2^-25 of the peak current: a ramp over the cycle, which costs a tick one addition.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub(crate) struct FedForward {
    current: i32,
    step: i32,
    /// What the ramp began with, and what it leads to: each smoothed from command to command.
    begin: i32,
    end: i32,
}

impl FedForward {
    /// Nothing.
    pub(crate) const NONE: Self = Self { current: 0, step: 0, begin: 0, end: 0 };

    /// Takes the accelerations with which the path to a new command begins and ends.
    #[inline]
    pub(crate) fn command(
        &mut self,
        gain: AccelerationGain,
        smoothing: AccelerationSmoothing,
        path: &InterpolatorSettings,
        accelerations: [SignedAcceleration; 2],
    ) {
        let [begin, end] = accelerations.map(|acceleration| gain.apply(acceleration));
        self.begin = smoothing.towards(self.begin, begin);
        self.end = smoothing.towards(self.end, end);
        self.current = self.begin;
        self.step = path.share_of_tick(self.end.wrapping_sub(self.begin));
    }

    /// The current of the next tick.
    #[inline]
    pub(crate) fn tick(&mut self) -> i32 {
        let current = self.current;
        self.current = current.wrapping_add(self.step);
        current
    }

    /// The current of a tick behind the path: a command that is late by a tick makes no gap, and one that is lost leaves nothing behind.
    #[inline]
    pub(crate) fn coast(&mut self) -> i32 {
        let current = self.current;
        self.current = current >> 1;
        current
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn unit() -> AccelerationGain {
        AccelerationGain::from_ratio(1, 1).unwrap()
    }

    fn coarse(bits: i64) -> SignedAcceleration {
        SignedAcceleration::from_bits(bits << 6)
    }

    #[test]
    fn a_smoothed_current_rises_to_63_percent_in_the_time_constant_and_settles() {
        for (time_constant, ticks) in [(5_000_u16, 4_u16), (20_000, 4), (20_000, 16)] {
            let smoothing = AccelerationSmoothing::new(time_constant, ticks);
            let path = InterpolatorSettings::new(ticks, None).unwrap();
            for size in [i64::from(LIMIT) - 1, -i64::from(LIMIT), 1 << 20] {
                let mut current = FedForward::NONE;
                let cycles = time_constant / (ticks * 125);
                let mut run = |cycles: u16| {
                    for _ in 0..cycles {
                        current.command(unit(), smoothing, &path, [coarse(size); 2]);
                        (0..ticks).for_each(|_| _ = current.tick());
                    }
                    f64::from(current.current) / size as f64
                };
                let share = run(cycles);
                assert!((0.6..0.67).contains(&share), "{time_constant} us: {share}");
                let settled = run(40 * cycles);
                assert!((settled - 1.0).abs() < 1e-4, "{time_constant} us: {settled}");
            }
        }
    }

    #[test]
    fn a_late_command_makes_no_gap_and_a_lost_one_leaves_nothing() {
        let path = InterpolatorSettings::new(10, None).unwrap();
        let mut current = FedForward::NONE;
        current.command(unit(), AccelerationSmoothing::new(0, 10), &path, [coarse(1 << 20); 2]);
        (0..10).for_each(|_| _ = current.tick());
        assert_eq!(current.coast(), 1 << 20);
        assert_eq!(current.coast(), 1 << 19);
        (0..20).for_each(|_| _ = current.coast());
        assert_eq!(current.coast(), 0);
    }

    #[test]
    fn without_time_constant_the_current_is_the_ramp_of_the_path() {
        let smoothing = AccelerationSmoothing::new(0, 10);
        let path = InterpolatorSettings::new(10, None).unwrap();
        let mut current = FedForward::NONE;
        for (begin, end) in [(0, 1_000), (1_000, -4_000), (-4_000, 0), (77, 77)] {
            current.command(unit(), smoothing, &path, [coarse(begin), coarse(end)]);
            for tick in 0..10 {
                let exact = begin + (end - begin) * tick / 10;
                assert!((i64::from(current.tick()) - exact).abs() <= 10, "{begin} to {end}, tick {tick}");
            }
        }
    }

    proptest! {
        #[test]
        fn the_current_is_that_of_the_factor_to_its_steps_and_a_billionth_or_limited(
            numerator in 1_u64..1 << 50, shift in 0_u32..50, denominator in 1_u64..1 << 50,
            divisor in 0_u32..50, acceleration in any::<i64>(), smaller in 0_u32..63,
        ) {
            let (numerator, denominator) = (numerator >> shift, (denominator >> divisor).max(1));
            let Some(gain) = AccelerationGain::from_ratio(numerator.into(), denominator.into()) else { return Ok(()) };
            let acceleration = SignedAcceleration::from_bits(acceleration >> smaller);
            let current = f64::from(gain.apply(acceleration));
            let factor = numerator as f64 / denominator as f64;
            let exact = f64::from(acceleration.coarse()) * factor;
            let exact = exact.clamp(-f64::from(LIMIT), f64::from(LIMIT));
            // The mantissa of a factor below 1/8 counts in 2^-32.
            let allowed = 1.0 + exact.abs() / 2e8 + f64::from(acceleration.coarse()).abs() * 1.2e-10;
            prop_assert!((current - exact).abs() <= allowed, "{} for {}", current, exact);
        }
    }

    #[test]
    fn factors_out_of_range_are_refused() {
        assert_eq!(AccelerationGain::from_ratio(1, 0), None);
        assert_eq!(AccelerationGain::from_ratio(1 << 20, 1), None);
        let largest = AccelerationGain::from_ratio((1 << 20) - 1, 1).unwrap();
        assert_eq!(largest.apply(SignedAcceleration::from_bits(i64::MIN)), -LIMIT);
        let none = AccelerationGain::from_ratio(0, 1).unwrap();
        assert_eq!(none.apply(SignedAcceleration::from_bits(i64::MAX)), 0);
    }
}
