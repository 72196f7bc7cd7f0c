//! Laws of drive-controlled movements, over the whole range of limits: they are kept in every tick, to the last bit, and the
//! target is reached exactly and in the time that the formula of the profile gives.

use proptest::prelude::*;
use servo::path::{FeedrateOverride, MotionLimits, Setpoint, Trajectory};
use servo::units::{Acceleration, Jerk, Position, Velocity};

const RADIAN: f64 = 1.0 / std::f64::consts::TAU;
const TICKS_PER_SECOND: f64 = 8_000.0;
const CASES: u32 = 250;

/// Limits in radians and seconds.
#[derive(Clone, Copy, Debug)]
struct Physical {
    velocity: f64,
    acceleration: f64,
    deceleration: f64,
    jerk: Option<f64>,
}

impl Physical {
    fn limits(self) -> MotionLimits {
        MotionLimits::new(
            Velocity::saturating_from_bits((self.velocity * RADIAN / TICKS_PER_SECOND * 2_f64.powi(36)) as i64),
            Acceleration::from_bits(bits(self.acceleration, 2) as u64),
            Acceleration::from_bits(bits(self.deceleration, 2) as u64),
            self.jerk.map(|jerk| Jerk::from_bits(bits(jerk, 3) as u64)),
        )
        .expect("legal limits")
    }

    /// Ticks of the fastest movement from rest over a way in radians.
    fn closed_form(self, way: f64) -> f64 {
        // A jerk that acts within less than four ticks is lowered to that.
        let shortest = self.acceleration.min(self.deceleration) * TICKS_PER_SECOND / 4.0;
        let jerk = self.jerk.map(|jerk| jerk.min(shortest));
        let ramp = |peak: f64, acceleration: f64| match jerk {
            None => peak / acceleration,
            Some(jerk) if peak * jerk < acceleration * acceleration => 2.0 * (peak / jerk).sqrt(),
            Some(jerk) => peak / acceleration + acceleration / jerk,
        };
        let ramps = |peak: f64| ramp(peak, self.acceleration) + ramp(peak, self.deceleration);
        let (mut low, mut high) = (0.0, self.velocity);
        for _ in 0..100 {
            let middle = (low + high) / 2.0;
            if middle * ramps(middle) / 2.0 < way { low = middle } else { high = middle }
        }
        (ramps(low) + (way / low - ramps(low) / 2.0).max(0.0)) * TICKS_PER_SECOND
    }
}

/// A way in radians that takes about so many ticks.
fn way_of(physical: Physical, ticks: f64) -> f64 {
    let (mut low, mut high) = (-7.0, 9.0);
    for _ in 0..40 {
        let middle = (low + high) / 2.0;
        if physical.closed_form(10_f64.powf(middle)) < ticks { low = middle } else { high = middle }
    }
    10_f64.powf(low)
}

/// Radians per second to the power of `order` in 2^-48 revolution per tick to that power.
fn bits(value: f64, order: i32) -> i64 {
    (value * RADIAN / TICKS_PER_SECOND.powi(order) * 2_f64.powi(48)) as i64
}

fn steps(radians: f64) -> i64 {
    (radians * RADIAN * 2_f64.powi(32)) as i64
}

/// 0.1 rad/s to 15 000 rpm, 1 to 10^6 rad/s², 1 to 10^9 rad/s³, each evenly over its decades.
fn physical() -> impl Strategy<Value = Physical> {
    let smooth = proptest::option::weighted(0.7, 0.0..9.0_f64);
    (-1.0..3.195_f64, 0.0..6.0_f64, proptest::option::of(0.0..6.0_f64), smooth).prop_map(|(v, a, d, j)| Physical {
        velocity: 10_f64.powf(v),
        acceleration: 10_f64.powf(a),
        deceleration: 10_f64.powf(d.unwrap_or(a)),
        jerk: j.map(|j| 10_f64.powf(j)),
    })
}

/// A trajectory, and what it must be from the sums of its accelerations.
struct Watched {
    physical: Physical,
    trajectory: Trajectory,
    position: i128,
    velocity: i64,
    acceleration: i64,
}

impl Watched {
    fn new(physical: Physical, start: i64) -> Self {
        let setpoint = Setpoint::moving(Position::from_bits(start), Velocity::ZERO);
        Self {
            physical,
            trajectory: Trajectory::start(setpoint),
            position: i128::from(start) << 16,
            velocity: 0,
            acceleration: 0,
        }
    }

    fn watch(&mut self, tick: impl FnOnce(&mut Trajectory) -> Setpoint) -> Setpoint {
        let setpoint = tick(&mut self.trajectory);
        let Self { physical, .. } = *self;
        let acceleration = setpoint.acceleration.to_bits();
        if let Some(jerk) = physical.jerk {
            let step = (acceleration - self.acceleration).abs();
            assert!(step <= bits(jerk, 3), "jerk of {step}, limit {}, {physical:?}", bits(jerk, 3));
        }
        let limit = if self.velocity.signum() * acceleration.signum() < 0 {
            physical.deceleration
        } else {
            physical.acceleration
        };
        assert!(
            acceleration.abs() <= bits(limit, 2),
            "{acceleration} at {}, limit {}, {physical:?}",
            self.velocity,
            bits(limit, 2)
        );
        self.acceleration = acceleration;
        self.velocity += acceleration;
        let fastest = bits(physical.velocity, 1);
        assert!(self.velocity.abs() <= fastest, "velocity of {}, limit {fastest}, {physical:?}", self.velocity);
        self.position += i128::from(self.velocity);
        assert_eq!(
            i64::from(setpoint.velocity.to_bits()),
            self.velocity >> 12,
            "velocity is the sum of the accelerations"
        );
        assert_eq!(setpoint.position.to_bits(), (self.position >> 16) as i64, "position is the sum of the velocities");
        setpoint
    }

    fn to(&mut self, limits: &MotionLimits, target: i64) -> Setpoint {
        self.watch(|trajectory| trajectory.tick_to(limits, Position::from_bits(target)))
    }
}

/// What a jerk costs that changes its sign within a tick is lead of the velocity that is left, not of the one that the jerk takes away anyway.
#[test]
fn the_slowest_short_movement_takes_no_longer_than_its_profile() {
    let physical = Physical { velocity: 1.0, acceleration: 1.0, deceleration: 1.0, jerk: Some(1.0) };
    let way = way_of(physical, 1.0);
    let (closed, limits) = (physical.closed_form(way), physical.limits());
    let mut watched = Watched::new(physical, 0);
    let ticks = (1..1_000).find(|_| {
        watched.to(&limits, steps(way));
        watched.trajectory.is_finished()
    });
    let ticks = f64::from(ticks.expect("it ends"));
    assert!((closed - 1.0..closed * 1.02 + 4.0).contains(&ticks), "{ticks} ticks, {closed} at the least");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(CASES))]

    #[test]
    fn a_movement_from_rest_arrives_exactly_without_overshoot_in_the_time_of_its_profile(
        physical in physical(), decades in 0.0..4.0_f64, backwards: bool, start: i64,
    ) {
        let way = way_of(physical, 10_f64.powf(decades));
        let closed = physical.closed_form(way);
        let sign = if backwards { -1 } else { 1 };
        let target = start.wrapping_add(sign * steps(way));
        let limits = physical.limits();
        let mut watched = Watched::new(physical, start);
        let mut ticks = 0.0;
        while !watched.trajectory.is_finished() {
            let setpoint = watched.to(&limits, target);
            let left = target.wrapping_sub(setpoint.position.to_bits()) * sign;
            prop_assert!((0..=steps(way)).contains(&left), "{left} of {} left, {physical:?}", steps(way));
            ticks += 1.0;
            prop_assert!(ticks < 40_000.0, "does not end, {physical:?}");
        }
        prop_assert_eq!(watched.trajectory.setpoint(), Setpoint::moving(Position::from_bits(target), Velocity::ZERO));
        prop_assert_eq!(watched.to(&limits, target).position.to_bits(), target, "and stands there");
        let (share, more) = if physical.jerk.is_some() { (0.02, 3.0) } else { (0.01, 2.0) };
        let late = ticks - closed;
        // A tick to begin and one to stand; with a jerk limit three.
        prop_assert!(late >= -closed * 1e-3 - 1.0, "{} ticks, fastest {}, {:?}", ticks, closed, physical);
        prop_assert!(late <= closed * share + more + 1.0, "{} ticks, fastest {}, {:?}", ticks, closed, physical);
    }

    #[test]
    fn targets_that_change_at_any_time_never_violate_a_limit_and_the_last_one_is_reached(
        physical in physical(), legs in proptest::collection::vec((-1.0..1.0_f64, 1..300_u32, 0..=10_000_u16), 1..12),
    ) {
        let limits = physical.limits();
        let mut watched = Watched::new(physical, 0);
        // As far as the axis gets in some hundred ticks.
        let reach = physical.velocity.min(physical.acceleration * 0.02) * 0.03;
        let mut target = 0;
        for (share, ticks, feedrate) in legs {
            target = steps(share * share * share * reach);
            let limits = limits.with_override(FeedrateOverride::new(feedrate).unwrap());
            for _ in 0..ticks {
                watched.to(&limits, target);
            }
        }
        let mut ticks = 0;
        while !watched.trajectory.is_finished() {
            watched.to(&limits, target);
            ticks += 1;
            prop_assert!(ticks < 400_000, "does not end, {physical:?}");
        }
        prop_assert_eq!(watched.trajectory.setpoint().position.to_bits(), target);
    }

    #[test]
    fn velocities_are_reached_exactly_and_without_passing_them(
        physical in physical(), targets in proptest::collection::vec((-1.2..1.2_f64, 1..2_000_u32), 1..8),
    ) {
        let limits = physical.limits();
        let slower = physical.acceleration.min(physical.deceleration);
        let mut watched = Watched::new(physical, 0);
        for (share, ticks) in targets {
            let target = Velocity::saturating_from_bits(bits(share * physical.velocity, 1) >> 12);
            let limit = bits(physical.velocity, 1) >> 12;
            let aimed = i64::from(target.to_bits()).clamp(-limit, limit);
            // What an acceleration towards the target still adds while it ends.
            let rising = watched.acceleration as f64;
            let added = physical.jerk.map_or(0.0, |jerk| rising * rising / (1.9 * bits(jerk, 3).min(bits(slower, 2) / 4) as f64));
            let ample = ((aimed << 12) - watched.velocity).abs() as f64 > added + rising.abs() * 2.0;
            for _ in 0..ticks {
                let before = watched.velocity >> 12;
                let setpoint = watched.watch(|trajectory| trajectory.tick_velocity(&limits, target));
                let velocity = i64::from(setpoint.velocity.to_bits());
                let passed = (before < aimed && velocity > aimed) || (before > aimed && velocity < aimed);
                prop_assert!(!(passed && ample), "{velocity} from {before} to {aimed}, {physical:?}");
                if watched.trajectory.is_finished() {
                    prop_assert_eq!((velocity, setpoint.acceleration.to_bits()), (aimed, 0));
                }
            }
        }
    }

    #[test]
    fn what_is_said_to_stop_before_a_target_never_passes_it_and_needs_no_more_way_than_braking(
        physical in physical(), reach in 0.0..3.0_f64, ticks in 1..4_000_u32, backwards: bool,
    ) {
        let limits = physical.limits();
        let sign = if backwards { -1 } else { 1 };
        let mut watched = Watched::new(physical, 0);
        let far = steps(way_of(physical, 10_f64.powf(reach) * 100.0).min(1e6)).max(1);
        for _ in 0..ticks {
            watched.to(&limits, sign * far);
        }
        let start = watched.trajectory;
        let speed = i64::from(start.setpoint().velocity.abs().to_bits()) >> 4;
        let mut braking = start;
        for _ in 0..100_000 {
            braking.tick_velocity(&limits, Velocity::ZERO);
            if braking.is_at_rest() {
                break;
            }
        }
        prop_assume!(braking.is_at_rest() && speed > 1_000);
        let way = (braking.setpoint().position - start.setpoint().position).to_bits().abs();
        let at = |way: i64| start.setpoint().position + Position::from_bits(sign * way);
        // What a brake keeps in reserve, and what a tick rounds.
        let slack = way / 20 + 4 * speed + 16;
        prop_assert!(start.stops_before(&limits, at(way + slack)), "{way} {slack} {physical:?}");
        prop_assert!(way <= slack || !start.stops_before(&limits, at(way - slack)), "{way} {slack} {physical:?}");
        for target in [way, way + slack / 4, way + slack / 2, way + slack] {
            if start.stops_before(&limits, at(target)) {
                let mut trajectory = start;
                for _ in 0..20_000 {
                    let beyond = sign * (trajectory.tick_to(&limits, at(target)).position - at(target)).to_bits();
                    prop_assert!(beyond <= 0, "{beyond} beyond {target}, {physical:?}");
                }
            }
        }
        prop_assert!(start.stops_before(&limits, at(-1 - slack)), "it comes back to what lies behind");
    }

    #[test]
    fn both_directions_go_the_same_way(physical in physical(), decades in -6.0..3.0_f64) {
        let limits = physical.limits();
        let target = steps(10_f64.powf(decades));
        let [mut forwards, mut backwards] = [(); 2].map(|()| Watched::new(physical, 0));
        for _ in 0..2_000 {
            forwards.to(&limits, target);
            backwards.to(&limits, -target);
            prop_assert_eq!(forwards.position, -backwards.position);
            prop_assert_eq!(forwards.acceleration, -backwards.acceleration);
        }
    }

    #[test]
    fn nothing_wraps_from_any_speed_to_any_target(
        physical in physical(), speed in -1.0..1.0_f64, acceleration in any::<i64>(), start: i64, target: i64,
    ) {
        // Also beyond the limits, as after a change of them.
        let limits = physical.limits();
        let velocity = Velocity::saturating_from_bits((speed * f64::from(i32::MAX)) as i64);
        let mut trajectory = Trajectory::start(Setpoint {
            acceleration: servo::units::SignedAcceleration::from_bits(acceleration % (1 << 40)),
            ..Setpoint::moving(Position::from_bits(start), velocity)
        });
        let mut before = trajectory.setpoint();
        for _ in 0..200 {
            let setpoint = trajectory.tick_to(&limits, Position::from_bits(target));
            let way = setpoint.position - before.position;
            let moved = setpoint.velocity.to_bits() >> 4;
            prop_assert!((way.to_bits() - i64::from(moved)).abs() <= 1 || setpoint.velocity.abs() == Velocity::MAX);
            let step = (setpoint.acceleration.to_bits() - before.acceleration.to_bits()).abs();
            if let Some(jerk) = physical.jerk {
                prop_assert!(step <= bits(jerk, 3), "jerk of {step}");
            }
            before = setpoint;
        }
    }
}

const PRESS: Physical = Physical { velocity: 60.0, acceleration: 600.0, deceleration: 400.0, jerk: Some(20_000.0) };

#[test]
fn the_longest_way_starts_and_ends_in_the_right_direction() {
    let extremes = Physical { velocity: 1_570.0, acceleration: 1.0, deceleration: 1.0, jerk: Some(1.0) };
    let limits = extremes.limits();
    // 2^31 revolutions ahead: one step more would be nearer the other way round.
    for (target, sign) in [(i64::MAX, 1), (i64::MIN + 1, -1)] {
        let mut watched = Watched::new(extremes, 0);
        for _ in 0..20_000 {
            watched.to(&limits, target);
        }
        assert!(watched.velocity * sign > 0);
    }
    // Full speed from the slowest brake: 1570 s, and the way of it, 196 000 revolutions.
    let way = 1_570.0 * (1_570.0 + 1.0) / 2.0;
    let fast = Velocity::saturating_from_bits(bits(1_569.9, 1) >> 12);
    for (share, sign) in [(1.01, 1), (0.99, -1)] {
        let mut trajectory = Trajectory::start(Setpoint::moving(Position::ZERO, fast));
        let setpoint = trajectory.tick_to(&limits, Position::from_bits(steps(way * share)));
        assert_eq!(setpoint.acceleration.to_bits().signum(), sign, "{share} of the way that it takes to stop");
    }
}

#[test]
fn a_target_behind_a_moving_axis_is_reached_after_a_stop() {
    let limits = PRESS.limits();
    let mut watched = Watched::new(PRESS, 0);
    while watched.trajectory.setpoint().position.to_bits() < steps(20.0) {
        watched.to(&limits, steps(100.0));
    }
    let mut furthest = 0;
    while !watched.trajectory.is_finished() {
        furthest = furthest.max(watched.to(&limits, steps(10.0)).position.to_bits());
    }
    // v (v / d + d / j) / 2 = 5.1 rad, from the 20 rad and the tick in between.
    let overshoot = furthest as f64 / steps(1.0) as f64 - 20.0;
    assert!((5.09..5.12).contains(&overshoot), "{overshoot}");
}

#[test]
fn an_override_of_zero_stops_and_the_movement_goes_on_with_the_next() {
    let limits = PRESS.limits();
    let paused = limits.with_override(FeedrateOverride::new(0).unwrap());
    let half = limits.with_override(FeedrateOverride::new(5_000).unwrap());
    let mut watched = Watched::new(PRESS, 0);
    for _ in 0..2_000 {
        watched.to(&limits, steps(100.0));
    }
    for _ in 0..2_000 {
        watched.to(&paused, steps(100.0));
    }
    assert_eq!((watched.velocity, watched.trajectory.is_finished()), (0, false));
    for _ in 0..2_000 {
        watched.to(&half, steps(100.0));
    }
    let speed = watched.velocity as f64 / bits(60.0, 1) as f64;
    assert!((0.4999..0.5001).contains(&speed), "{speed}");
    while !watched.trajectory.is_finished() {
        watched.to(&limits, steps(100.0));
    }
}

#[test]
fn a_jerk_limited_halt_takes_the_time_and_the_way_of_its_formula() {
    let limits = PRESS.limits();
    let mut watched = Watched::new(PRESS, 0);
    while !watched.trajectory.is_finished() {
        watched.watch(|trajectory| trajectory.tick_velocity(&limits, Velocity::MAX));
    }
    let start = watched.trajectory.setpoint().position;
    let mut ticks = 0;
    while !watched.trajectory.is_finished() || ticks == 0 {
        watched.watch(|trajectory| trajectory.tick_velocity(&limits, Velocity::ZERO));
        ticks += 1;
    }
    // v / d + d / j = 0.17 s, v / 2 of it less a tick of v.
    assert!((1_360..=1_364).contains(&ticks), "{ticks}");
    let way = (watched.trajectory.setpoint().position - start).to_bits() as f64 / steps(1.0) as f64;
    assert!((5.0915..5.0935).contains(&way), "{way}");
}

#[test]
fn a_shift_moves_the_position_and_nothing_else() {
    let mut trajectory = Trajectory::start(Setpoint::moving(Position::ZERO, Velocity::ZERO));
    let limits = PRESS.limits();
    for _ in 0..100 {
        trajectory.tick_to(&limits, Position::from_bits(1 << 40));
    }
    let before = trajectory.setpoint();
    trajectory.shift(Position::from_bits(12_345));
    let after = trajectory.setpoint();
    assert_eq!(after.position - before.position, Position::from_bits(12_345));
    assert_eq!((after.velocity, after.acceleration), (before.velocity, before.acceleration));
}
