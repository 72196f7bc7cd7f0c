//! How far a movement still goes until it stands, and the choice of the next step that just lets it stand in time.
//!
//! A movement runs on a chain of sums: jerk into acceleration, acceleration into velocity, velocity into position, all in 2^-48
//! revolution. For a chain, the sum of the rates until standstill is that of a continuous movement plus a half of the last rate
//! (trapezoid rule, exact for straight lines), so that the formulas of continuous movements hold for it, without an error of a tick.

/// Binary digits of a time below one tick.
const TIME_BITS: u32 = 12;
/// Longest time in ticks from a velocity to standstill, 2000 s: its product with the highest rate, 2^44, just fits.
pub(crate) const LONGEST_BRAKING: i64 = 16_000_000;
const LONGEST_TIME: i64 = LONGEST_BRAKING << TIME_BITS;
/// Longest time from an acceleration to none, 65 s, where distances have full resolution.
const LONGEST_FINE_TIME: i64 = 1 << (19 + TIME_BITS);
/// Further than anything that is left to go.
pub(crate) const FAR: i64 = 1 << 62;

/// Multiplies by `1 / step`, the number of ticks that a rate needs to come down to zero.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub(crate) struct Slope {
    /// What the rate may change by in a tick, at least [`Slope::SMALLEST`].
    step: i64,
    /// 2^`shift` / `step`, normalised to 32 bits.
    mantissa: u32,
    shift: u32,
}

impl Slope {
    /// Smallest step: coarser ones would be off by more than two percent.
    pub(crate) const SMALLEST: i64 = 64;
    /// Largest step: from zero to the end of the range of a velocity at once.
    pub(crate) const LARGEST: i64 = 1 << 43;

    /// A slope of `step` per tick, limited to the range of slopes. Divides.
    pub(crate) fn new(step: i64) -> Self {
        let step = step.clamp(Self::SMALLEST, Self::LARGEST);
        // The mantissa lies within 2^31 ..= 2^32 - 1: 2^shift is above 2^31 * step, and at most 2^32 * step.
        let shift = 95_u32.saturating_sub(step.leading_zeros());
        let mantissa = (1_i128 << shift).checked_div(i128::from(step)).unwrap_or(0).min(i128::from(u32::MAX)) as u32;
        Self { step, mantissa, shift }
    }

    /// `rate / step` in 2^-12 ticks, rounded down by a relative 2^-31; for a rate of `0 ..= 2^45`.
    #[inline]
    pub(crate) fn time(self, rate: i64) -> i64 {
        let rate = rate << TIME_BITS;
        let mantissa = i64::from(self.mantissa);
        let upper = (rate >> 32).wrapping_mul(mantissa);
        // The low half times the mantissa fills 64 bits without a sign.
        let lower = ((rate & 0xFFFF_FFFF) as u64).wrapping_mul(u64::from(self.mantissa)) >> 32;
        upper.wrapping_add(lower as i64).wrapping_shr(self.shift.wrapping_sub(32))
    }
}

/// `rate * time / 2` in 2^`coarse` units of the rate's integral; for a rate of `0 ..= 2^44` and a time that is not negative.
///
/// `coarse` is 4 for positions, of which 2^-44 revolution is enough and 2^18 revolutions are needed, and 0 for velocities.
#[inline]
fn half_product(rate: i64, time: i64, coarse: u32) -> i64 {
    let longest = if coarse == 0 { LONGEST_FINE_TIME } else { LONGEST_TIME };
    if time > longest || rate > 1 << 44 {
        return FAR;
    }
    let shift = coarse.wrapping_add(1);
    let whole = time >> TIME_BITS;
    let part = time & ((1 << TIME_BITS) - 1);
    let below = rate & 1_i64.wrapping_shl(shift).wrapping_sub(1);
    rate.wrapping_shr(shift)
        .wrapping_mul(whole)
        .wrapping_add(below.wrapping_mul(whole).wrapping_shr(shift))
        .wrapping_add(rate.wrapping_mul(part).wrapping_shr(shift.wrapping_add(TIME_BITS)))
        .min(FAR)
}

/// Positions are compared in 2^-44 revolution.
pub(crate) const COARSE_POSITION: u32 = 4;

/// What is left of `gap` when the rate goes to `rate` in this tick and then down by the slope: negative when it does not suffice.
///
/// The step may not divide the rate. A last, partial step costs up to an eighth of a step.
#[inline]
pub(crate) fn margin(slope: Slope, gap: i64, rate: i64, coarse: u32) -> i64 {
    if rate <= slope.step >> 1 {
        return gap.wrapping_sub(rate.max(0).wrapping_shr(coarse));
    }
    // The time is rounded down by up to 2^-12 ticks.
    let rounded = rate >> (TIME_BITS - 1);
    let half = rate.wrapping_add(rounded).wrapping_add(slope.step >> 2).wrapping_shr(coarse.wrapping_add(1));
    gap.wrapping_sub(half).wrapping_sub(half_product(rate, slope.time(rate), coarse)).wrapping_sub(ROUNDED_AWAY)
}

/// What the shifts of a margin round down together, in its last place.
const ROUNDED_AWAY: i64 = 4;

/// The highest rate within `low ..= high` from which the slope stops the rate before `gap` is used up; `low` when there is none.
///
/// `gap` is at least zero and in 2^`coarse` units. With a rate that is reached, the gap closes from above and never below zero.
#[inline]
pub(crate) fn approach(slope: Slope, gap: i64, low: i64, high: i64, coarse: u32) -> i64 {
    best_between(low, high, |rate| margin(slope, gap, rate, coarse))
}

/// Like [`approach`], where `now` may lie far from either end: `high` by thousands of slopes.
#[inline]
pub(crate) fn approach_from(slope: Slope, gap: i64, now: i64, low: i64, high: i64, coarse: u32) -> i64 {
    let margin = |rate| margin(slope, gap, rate, coarse);
    if margin(high) >= 0 {
        return high.max(low);
    }
    let now = now.max(low).min(high);
    if margin(now) < 0 {
        return best_between(low, now, margin);
    }
    // The range above `now` is halved as often as it takes to have a margin: a search in the number of halvings, six steps.
    let range = high.wrapping_sub(now);
    let mut halvings = 0_u32;
    for step in [32, 16, 8, 4, 2, 1] {
        let more = halvings.wrapping_add(step);
        if margin(now.wrapping_add(range >> more.min(63))) < 0 {
            halvings = more;
        }
    }
    let above = now.wrapping_add(range >> halvings.min(63));
    let below = now.wrapping_add(range >> halvings.wrapping_add(1).min(63));
    best_between(below, above, margin)
}

/// The highest value within `low ..= high` whose margin is not negative, to a few thousandths of the range; the margin falls with the
/// value and bends down. `low` when it has no margin either.
#[inline]
pub(crate) fn best_between(low: i64, high: i64, margin: impl Fn(i64) -> i64) -> i64 {
    let above = margin(high);
    if above >= 0 || high <= low {
        return high.max(low);
    }
    let below = margin(low);
    if below <= 0 {
        return low;
    }
    // The chord lies below a curve that bends down: its zero has a margin.
    let first = low.wrapping_add(share(high.wrapping_sub(low), below, above));
    let middle = margin(first);
    if middle < 0 {
        return low.wrapping_add(share(first.wrapping_sub(low), below, middle));
    }
    first.wrapping_add(share(high.wrapping_sub(first), middle, above))
}

/// `range * positive / (positive - negative)`, rounded down to 2^-12 of the range: twelve conditional subtractions.
#[inline]
fn share(range: i64, positive: i64, negative: i64) -> i64 {
    let mut rest = positive >> 2;
    let whole = rest.wrapping_sub(negative >> 2);
    let mut quotient = 0_i64;
    for _ in 0..12 {
        rest = rest.wrapping_mul(2);
        quotient = quotient.wrapping_mul(2);
        if rest >= whole {
            rest = rest.wrapping_sub(whole);
            quotient = quotient.wrapping_add(1);
        }
    }
    range.wrapping_mul(quotient) >> 12
}

/// Braking with limited deceleration and jerk.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub(crate) struct SmoothBrake {
    deceleration: Slope,
    jerk: Slope,
    /// Time in which the jerk makes the whole deceleration, in 2^-12 ticks.
    build_up: i64,
    /// From this velocity on, braking from standing acceleration reaches the whole deceleration.
    knee: i64,
}

impl SmoothBrake {
    pub(crate) fn new(deceleration: Slope, jerk: Slope) -> Self {
        let build_up = jerk.time(deceleration.step);
        Self { deceleration, jerk, build_up, knee: half_product(deceleration.step, build_up, 0).saturating_mul(2) }
    }

    /// The jerk that it counts on.
    pub(crate) const fn release(&self) -> Slope {
        self.jerk
    }

    /// Ticks that braking from `velocity` takes, in 2^-12 ticks; for a velocity that is not negative.
    #[inline]
    pub(crate) fn time(&self, velocity: i64) -> i64 {
        if velocity >= self.knee {
            return self.deceleration.time(velocity).wrapping_add(self.build_up);
        }
        // Below 2^50: the root of a time in 2^-24 ticks has 2^-12 ticks.
        2_i64.wrapping_mul(root(self.jerk.time(velocity) << TIME_BITS))
    }

    /// The way to standstill of a continuous movement at this velocity and acceleration, in 2^-44 revolution.
    #[inline]
    fn way(&self, velocity: i64, acceleration: i64) -> i64 {
        let magnitude = acceleration.wrapping_abs();
        let release = self.jerk.time(magnitude);
        // The velocity that is gained, or was lost, between this acceleration and none.
        let gained = half_product(magnitude, release, 0);
        // A jerk that changes its sign within a tick costs up to a quarter of its step in velocity, until the last curve is reached, and
        // up to an eighth at its end.
        let ahead = if acceleration < 0 { velocity.wrapping_sub(gained) } else { velocity };
        let partial = (self.jerk.step >> 2).min(ahead.max(0) >> 1);
        let last = (self.jerk.step >> 3).min(velocity.max(0) >> 1);
        let velocity = velocity.wrapping_add(partial).wrapping_add(last);
        let peak = velocity.wrapping_add(gained);
        if gained >= FAR || peak > 1 << 44 {
            return FAR;
        }
        if peak <= 0 || (acceleration < 0 && velocity <= 0) {
            return 0;
        }
        if acceleration < 0 && velocity <= gained {
            // Braking harder than it takes. The way is less than on the curve where it is just right, v t / 3 with t² = 2 v / jerk.
            let time = root(self.jerk.time(velocity.wrapping_mul(2)) << TIME_BITS);
            return two_thirds(half_product(velocity, time, COARSE_POSITION));
        }
        let brake = half_product(peak, self.time(peak), COARSE_POSITION);
        // t (v + 2/3 of the gain), and the same way back from an acceleration that brakes already.
        let mean = velocity.wrapping_add(two_thirds(gained));
        let lead = half_product(mean.wrapping_abs(), release, COARSE_POSITION).wrapping_mul(2);
        if (acceleration < 0) == (mean < 0) { brake.wrapping_add(lead) } else { brake.wrapping_sub(lead) }
    }

    /// What is left of `gap`, in 2^-44 revolution before this tick, when the acceleration becomes `acceleration` and the velocity
    /// `velocity` plus that in this tick, and the movement then brakes; negative when it does not suffice.
    #[inline]
    pub(crate) fn margin(&self, gap: i64, velocity: i64, acceleration: i64) -> i64 {
        let velocity = velocity.wrapping_add(acceleration);
        // The continuous movement that the chain belongs to runs half a tick of acceleration behind; the sum until standstill is its
        // way less v - a/6.
        let behind = velocity.wrapping_sub(acceleration >> 1);
        let sixth = acceleration.wrapping_mul(10_923) >> 16;
        gap.wrapping_sub(sixth >> COARSE_POSITION).wrapping_sub(self.way(behind, acceleration))
    }
}

/// `value * 2 / 3`, for a value of at least zero.
#[inline]
fn two_thirds(value: i64) -> i64 {
    // 2^31 * 2 / 3 to the nearest: a relative error of 2^-32.
    (value >> 31).wrapping_mul(1_431_655_765).wrapping_add((value & 0x7FFF_FFFF).wrapping_mul(1_431_655_765) >> 31)
}

/// Square root, rounded down: one binary digit a step, 31 steps.
#[inline]
fn root(value: i64) -> i64 {
    let mut rest = value;
    let mut root = 0_i64;
    let mut bit = 1_i64 << 60;
    for _ in 0..31 {
        let trial = root.wrapping_add(bit);
        root >>= 1;
        if rest >= trial {
            rest = rest.wrapping_sub(trial);
            root = root.wrapping_add(bit);
        }
        bit >>= 2;
    }
    root
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Ticks and way of a rate that goes down by the slope, the next tick at `rate`.
    fn way(rate: i64, step: i64) -> i128 {
        let whole = i128::from(rate / step);
        let rest = i128::from(rate % step);
        (whole + 1) * rest + i128::from(step) * whole * (whole + 1) / 2
    }

    proptest! {
        #[test]
        fn a_time_is_the_quotient(exponent in 6.0..43.0_f64, rate in 0_i64..=1 << 43) {
            let step = exponent.exp2() as i64;
            let exact = (rate as f64) * 4_096.0 / step as f64;
            let error = Slope::new(step).time(rate) as f64 - exact;
            prop_assert!(error <= 1e-3 && error >= -1.0 - exact * 1e-9, "{error} of {exact}");
        }

        #[test]
        fn a_root_is_rounded_down(value in 0_i64..=1 << 62) {
            let root = i128::from(root(value));
            prop_assert!(root * root <= i128::from(value) && (root + 1) * (root + 1) > i128::from(value));
        }

        #[test]
        fn half_a_product_is_exact_to_its_last_places(
            rate in 0_i64..=1 << 44, fine in 0..=LONGEST_FINE_TIME, long in 0..=LONGEST_TIME,
        ) {
            for (time, coarse) in [(fine, 0), (long, COARSE_POSITION)] {
                let exact = (i128::from(rate) * i128::from(time)) >> (TIME_BITS + coarse + 1);
                let error = exact.min(i128::from(FAR)) - i128::from(half_product(rate, time, coarse));
                prop_assert!((0..=2).contains(&error), "{error} of {exact}");
            }
        }

        #[test]
        fn two_thirds_are_exact_to_a_few_billionths(value in 0_i64..=1 << 62) {
            let error = i128::from(two_thirds(value)) * 3 - i128::from(value) * 2;
            prop_assert!(error.abs() <= i128::from(value >> 29) + 6, "{error} of {value}");
        }

        #[test]
        fn the_rate_that_is_chosen_stops_in_time_and_one_step_more_would_not(
            step in 6.0..26.0_f64, ticks in 0.0..16.0_f64, part in 0.0..1.0_f64,
        ) {
            let step = step.exp2() as i64;
            let gap = (way((ticks.exp2() * step as f64) as i64, step) as f64 * part) as i64;
            let slope = Slope::new(step);
            let high = (ticks + 1.0).exp2() as i64 * step;
            let chosen = approach_from(slope, gap, 0, 0, high, 0);
            prop_assert!(way(chosen, step) <= i128::from(gap), "{chosen} by {step} in {gap}");
            // From far off to a step and 2^-6; the next tick begins there and comes closer.
            let more = chosen + step + (chosen >> 6);
            prop_assert!(way(more, step) > i128::from(gap) || more >= high, "{chosen} by {step} in {gap}");
        }

        /// Half of the velocity that the release of the acceleration takes away: on its last curve the jerk changes its sign no more, and only what it may cost at the
        /// end comes on top.
        #[test]
        fn the_way_of_a_brake_that_is_too_hard_has_nothing_but_its_end_added(ticks in 6.0..60.0_f64, step in 14.0..24.0_f64) {
            let jerk = step.exp2() as i64;
            let brake = SmoothBrake::new(Slope::new(jerk * 1_000), Slope::new(jerk));
            let velocity = ticks * ticks / 4.0 * jerk as f64;
            let with_end = velocity + jerk as f64 / 8.0;
            let expected = with_end * (2.0 * with_end / jerk as f64).sqrt() / 3.0;
            let way = (brake.way(velocity as i64, -(ticks * jerk as f64) as i64) << COARSE_POSITION) as f64;
            // A quarter of the step more would be 1.5 / ticks^2 of it.
            prop_assert!((way / expected - 1.0).abs() < 0.3 / (ticks * ticks), "{way}, expected {expected}");
        }

        #[test]
        fn a_margin_is_what_is_left_of_the_gap_and_never_more(step in 6.0..26.0_f64, steps in -2.0..17.0_f64) {
            let step = step.exp2() as i64;
            let rate = (steps.exp2() * step as f64) as i64;
            let (slope, way) = (Slope::new(step), way(rate, step) as i64);
            prop_assert!(margin(slope, way - 1, rate, 0) < 0, "{rate} by {step}");
            let rounded = (rate >> TIME_BITS) + (step >> 3) + 6;
            prop_assert!(margin(slope, way + rounded, rate, 0) >= 0, "{rate} by {step}");
        }

        #[test]
        fn the_rate_between_two_ends_that_are_near_just_stops_in_time(step in 6.0..26.0_f64, steps in 2.0..12.0_f64) {
            let step = step.exp2() as i64;
            let rate = (steps.exp2() * step as f64) as i64;
            let gap = way(rate, step) as i64;
            let chosen = approach(Slope::new(step), gap, rate / 2, 2 * rate, 0);
            prop_assert!(chosen <= rate && chosen > rate - rate / 12 - step, "{chosen}, not {rate}");
            // From a rate that is too high already, what is above it is not looked at.
            prop_assert_eq!(approach_from(Slope::new(step), gap, 2 * rate, rate / 2, 8 * rate, 0), chosen);
        }

        #[test]
        fn the_way_of_a_smooth_brake_is_that_of_a_continuous_movement(exponent in 28.0..43.0_f64, part in -1.0..1.0_f64) {
            let (deceleration, jerk) = (26.0_f64.exp2(), 16.0_f64.exp2());
            let (velocity, acceleration) = (exponent.exp2(), part * deceleration);
            let release = acceleration.abs() / jerk;
            let gained = acceleration * acceleration / 2.0 / jerk;
            let peak = velocity + gained;
            let time = if peak >= deceleration * deceleration / jerk {
                peak / deceleration + deceleration / jerk
            } else {
                2.0 * (peak / jerk).sqrt()
            };
            let (brake, lead) = (peak * time / 2.0, (velocity + gained * 2.0 / 3.0) * release);
            let exact = match acceleration < 0.0 {
                true if velocity <= gained => velocity * (2.0 * velocity / jerk).sqrt() / 3.0,
                true => brake - lead,
                false => brake + lead,
            };
            let smooth = SmoothBrake::new(Slope::new(1 << 26), Slope::new(1 << 16));
            let way = smooth.way(velocity as i64, acceleration as i64) as f64 * 16.0;
            // It counts on up to three eighths of a step of the jerk more.
            prop_assert!(way > exact - 1e-5 * brake && way < exact + 1e-3 * brake, "{way}, not {exact}, of {brake}");
        }

        #[test]
        fn a_movement_that_is_still_turning_round_goes_back_first(part in 0.1..1.0_f64, back in 0.0..0.95_f64) {
            let (deceleration, jerk) = (26.0_f64.exp2(), 16.0_f64.exp2());
            let acceleration = part * deceleration;
            let release = acceleration / jerk;
            let gained = acceleration * release / 2.0;
            let (velocity, peak) = (-back * gained, (1.0 - back) * gained);
            let exact = (velocity + gained * 2.0 / 3.0) * release + peak * (peak / jerk).sqrt();
            let smooth = SmoothBrake::new(Slope::new(1 << 26), Slope::new(1 << 16));
            let way = smooth.way(velocity as i64, acceleration as i64) as f64 * 16.0;
            prop_assert!((way - exact).abs() < 0.02 * gained * release, "{way}, not {exact}");
        }

        #[test]
        fn a_value_between_has_the_margin(low in -1_000_000_i64..0, zero in 0.0..1.0_f64, range in 1_i64..1 << 40) {
            let high = low + range;
            let zero = low + (range as f64 * zero) as i64;
            let chosen = best_between(low, high, |value| zero - value);
            prop_assert!(chosen <= zero && chosen >= zero - (range >> 11) - 1, "{chosen}, not {zero}");
        }
    }

    #[test]
    fn a_way_that_is_short_by_the_last_place_is_not_taken_for_enough() {
        // 253, 80: 333 in all.
        assert!(approach_from(Slope::new(173), 332, 0, 0, 253, 0) < 253);
    }

    #[test]
    fn what_takes_longer_than_the_longest_time_or_is_faster_than_the_highest_rate_is_far() {
        for (coarse, longest) in [(0, LONGEST_FINE_TIME), (COARSE_POSITION, LONGEST_TIME)] {
            let exact = (1 << (40 - coarse - 1)) * (longest >> TIME_BITS);
            assert_eq!(half_product(1 << 40, longest, coarse), exact);
            assert_eq!(half_product(1 << 40, longest + 1, coarse), FAR);
            assert_eq!(half_product(1 << 44, 1 << TIME_BITS, coarse), 1 << (44 - coarse - 1));
            assert_eq!(half_product((1 << 44) + 1, 1 << TIME_BITS, coarse), FAR);
        }
    }

    #[test]
    fn without_a_margin_at_either_end_the_end_is_taken() {
        assert_eq!(best_between(-5, 7, |_| 0), 7);
        assert_eq!(best_between(-5, 7, |_| -1), -5);
        assert_eq!(best_between(7, -5, |_| -1), 7, "an empty range is its lower end");
    }

    #[test]
    fn a_first_try_that_has_just_its_margin_is_taken_and_one_that_has_none_is_not_passed() {
        assert_eq!(best_between(0, 4_096, |value| 2_048 - value), 2_048);
        // It bends up: the first try lies at 52.
        let chosen = best_between(0, 100, |value| if value < 10 { 100 - 10 * value } else { 10 - value });
        assert!((30..40).contains(&chosen), "{chosen}");
    }

    #[test]
    fn a_smooth_brake_has_no_way_to_go_at_standstill_and_too_far_beyond_the_highest_rate() {
        let brake = SmoothBrake::new(Slope::new(1 << 26), Slope::new(1 << 16));
        // Three eighths of a step of the jerk are added.
        let highest = (1 << 44) - (1 << 14) - (1 << 13);
        assert!(brake.way(highest, 0) < FAR);
        assert_eq!(brake.way(highest + 1, 0), FAR);
        assert_eq!(brake.way(highest, 1 << 26), FAR);
        // And never more than the rate itself: 2^13 in all, for 2 roots of an eighth.
        let way = brake.way(1 << 12, 0);
        assert!((178..=184).contains(&way), "{way}");
        for (velocity, acceleration) in
            [(0, 0), (-1 << 30, 0), (-1 << 30, 1 << 20), (0, -1 << 26), (-1 << 30, -1 << 26)]
        {
            assert_eq!(brake.way(velocity, acceleration), 0, "{velocity}, {acceleration}");
        }
    }

    #[test]
    fn along_a_chain_that_just_stops_in_time_next_to_nothing_is_left_of_the_gap() {
        let jerk = 1_i64 << 16;
        let steps = 1_i64 << 10;
        // Out of an acceleration, into the deceleration, some time at it, and out of it.
        let out_of_it = (1..steps).rev().map(|step| -step);
        let accelerations = (-steps..=steps).rev().chain([-steps; 500]).chain(out_of_it).map(|step| step * jerk);
        let brake = SmoothBrake::new(Slope::new(steps * jerk), Slope::new(jerk));
        // From standstill back to the beginning.
        let (mut velocity, mut left) = (0, 0);
        for acceleration in accelerations.rev() {
            left += velocity;
            velocity -= acceleration;
            let margin = brake.margin(left >> COARSE_POSITION, velocity, acceleration);
            // What a jerk that changes its sign within a tick may cost, is kept in hand.
            let hand = ((jerk * 3 / 8) * 6_000 + jerk * 40) >> COARSE_POSITION;
            assert!((-hand..=1 << 12).contains(&margin), "{margin} of {left} at {velocity}, {acceleration}");
            let wider = (left >> COARSE_POSITION) + (1 << 50);
            assert_eq!(brake.margin(wider, velocity, acceleration), margin + (1 << 50));
        }
        assert!(velocity > 1 << 35 && left > 1 << 47, "{velocity}, {left}");
    }

    #[test]
    fn a_smooth_brake_takes_the_way_of_its_formula() {
        // Velocity of 2^36 against 2^26 a tick squared and 2^16 a tick cubed: 1024 ticks, and 1024 more of the jerk.
        let brake = SmoothBrake::new(Slope::new(1 << 26), Slope::new(1 << 16));
        assert!((brake.time(1 << 36) - (2_048 << 12)).abs() <= 4);
        let exact = 1_i64 << (36 + 10 - 4);
        let way = brake.way(1 << 36, 0);
        assert!((way - exact).abs() < exact / 10_000, "{way}, not {exact}");
        // A quarter of the velocity: twice the root of v / jerk, 1024 ticks.
        assert!((brake.time(1 << 34) - (1_024 << 12)).abs() <= 4);
        // On the last curve the way is a third of velocity and time: a² / 2 jerk over a / jerk.
        let way = brake.way(1 << 35, -(1 << 26));
        let exact = (1_i64 << (35 + 10 - 4)) / 3;
        assert!((way - exact).abs() < exact / 1_000, "{way}, not {exact}");
        // An acceleration first has to end: it takes v a/j + a³ / 3 j² more, and ends at v + a² / 2 j.
        let longer = brake.way(0, 1 << 26) - brake.way(1 << 35, 0);
        assert!((longer - 2 * exact).abs() < exact / 1_000, "{longer}, not twice {exact}");
    }
}
