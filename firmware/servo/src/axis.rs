//! One axis: modes, loops and their bumpless hand-over.

pub(crate) mod acceleration_gain;
pub(crate) mod expected_lag;
pub(crate) mod filter;
pub(crate) mod friction;
pub(crate) mod limits;
pub(crate) mod position_loop;
pub(crate) mod settings;
pub(crate) mod tuning;
pub(crate) mod velocity_estimate;
pub(crate) mod velocity_guard;
pub(crate) mod velocity_loop;
pub(crate) mod velocity_rate;

pub use filter::{CurrentFilter, CurrentFilterSettings, FilterSection};
pub use friction::{FrictionParameters, FrictionSettings};
pub use limits::{
    CommandedTorqueLimits, Limiting, TorqueLimitParameters, TorqueLimitSettings, TorqueLimits, VelocityLimits,
};
pub use position_loop::{PositionLoopOutput, PositionLoopSettings};
pub use settings::{AxisMovements, AxisParameters, AxisSettings};
pub use tuning::{
    CurrentGains, NOISE_DAMPING, NOISE_TIME, VelocityGains, acceleration_feed_forward, acceleration_smoothing,
    current_gains, is_felt, noise_filter, position_gain, velocity_gains,
};
pub use velocity_estimate::{FilteredVelocity, VelocityEstimate, VelocityFilter};
pub use velocity_loop::{VelocityLoop, VelocityLoopOutput, VelocityLoopSettings};
pub use velocity_rate::VelocityRate;

use crate::axis::acceleration_gain::FedForward;
use crate::axis::expected_lag::ExpectedLag;
use crate::axis::velocity_guard::{VelocityGuard, towards};
use crate::axis::velocity_loop::{CURRENT_BITS, bounds};
use crate::path::command_step::CommandJump;
use crate::path::interpolation::Interpolator;
use crate::path::limits::MotionLimits;
use crate::path::ramp::Ramp;
use crate::path::setpoint::{CommandSource, Setpoint};
use crate::path::trajectory::Trajectory;
use crate::path::velocity_interpolation::VelocityInterpolator;
use crate::units::modulo::ModuloCounter;
use crate::units::{CurrentFraction, Position, Velocity};

/// What the axis does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Mode {
    /// No current; the measurement goes on.
    Off,
    /// Follows torque commands (S-0-0080); the velocity loop takes over where the velocity limit would be passed.
    Torque,
    /// Follows velocity commands (S-0-0036) with the velocity loop.
    Velocity,
    /// Follows position commands (S-0-0047) with position and velocity loop.
    Position,
    /// Best possible deceleration: the velocity command goes to zero at S-0-0138, the velocity loop stays closed, at zero too.
    Stopping,
    /// The velocity command is zero at once: the axis stops at its torque limit (P-0-0140 = 0).
    Braking,
    /// Drive halt (control word bit 13): brakes at S-0-0372 or S-0-0138 on a position ramp and holds the position where it ends.
    Halt,
    /// A movement that the drive makes by itself (positioning, homing): follows [`Axis::travel`].
    Travel,
}

/// Where a movement of [`Mode::Travel`] goes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Travel {
    /// Brakes and holds the position where it stops.
    Hold,
    /// Turns at this velocity.
    AtVelocity(Velocity),
    /// Goes to this position, unbounded, and holds it.
    To(Position),
}

/// Result of a tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct AxisOutput {
    /// Torque-producing current command, zero in [`Mode::Off`].
    pub current: CurrentFraction,
    /// Commanded less measured position (S-0-0189); zero while no position is commanded (`Off`, `Torque`, `Velocity`,
    /// `Stopping`, `Braking`).
    pub following_error: Position,
    /// Measured velocity for S-0-0040 and the monitoring, filtered with 2 ms.
    pub velocity: Velocity,
    /// Measured velocity as the velocity loop sees it, filtered with S-0-0392.
    pub loop_velocity: Velocity,
    /// Command of the velocity loop; the measured velocity in [`Mode::Off`] and [`Mode::Torque`].
    pub velocity_command: Velocity,
    /// Position setpoint of this tick, unbounded; the measured position while no position is commanded.
    pub position_command: Position,
    /// Where the setpoint comes from; [`CommandSource::Interpolated`] in modes without position commands.
    pub command_source: CommandSource,
    /// Measured velocity is within the standstill window (S-0-0124), and a braking ramp, if one runs, has ended (C3D bit 1).
    pub standstill: bool,
    /// What limits the axis in this tick.
    pub limiting: Limiting,
    /// The movement of [`Mode::Travel`] has reached its target.
    pub travelled: bool,
}

impl AxisOutput {
    /// Of an axis that stands at `position` with its loops open.
    #[must_use]
    pub const fn at_rest(position: Position) -> Self {
        Self {
            current: CurrentFraction::ZERO,
            following_error: Position::ZERO,
            velocity: Velocity::ZERO,
            loop_velocity: Velocity::ZERO,
            velocity_command: Velocity::ZERO,
            position_command: position,
            command_source: CommandSource::Interpolated,
            standstill: true,
            limiting: Limiting::empty(),
            travelled: true,
        }
    }
}

/// State of an axis.
///
/// Call order in a control unit cycle: at t3 [`Axis::set_mode`] when the mode changes, then [`Axis::command_position`] or
/// [`Axis::command_velocity`] (or both: the mode takes its own); then one [`Axis::tick`] per loop period, and half a period later one
/// [`Axis::half_tick`] where the velocity loop runs twice in it ([`VelocityRate`]).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Axis {
    settings: AxisSettings,
    mode: Mode,
    measured: Position,
    ranges: ModuloCounter,
    /// Measured in the last step of the velocity loop.
    latest: Velocity,
    /// Measured, as the velocity loop sees it.
    velocity: FilteredVelocity,
    /// Measured, as it is shown and monitored.
    monitored: FilteredVelocity,
    interpolator: Interpolator,
    velocity_interpolator: VelocityInterpolator,
    ramp: Ramp,
    expected_lag: ExpectedLag,
    /// The velocity that an axis exactly on its set-point would be measured to have: the commanded one through the filter of the measured
    /// one. Fed forward in its place, the commanded velocity would be ahead of the measured one by the time of the filter. The velocity loop
    /// would take that for an error, and at constant acceleration a the position loop would have to hold a * time / Kv against it.
    expected_velocity: FilteredVelocity,
    /// Of the position set-points of the last two ticks, the later one last.
    setpoint_velocities: [Velocity; 2],
    /// The velocity command of the second half of the tick, where it does not come from a position.
    turned: Option<Velocity>,
    /// In [`Mode::Torque`]: the velocity, some milliseconds behind.
    slow_velocity: Velocity,
    /// And what keeps it within its limit.
    guard: VelocityGuard,
    velocity_loop: VelocityLoop,
    /// For the acceleration of the path to a position command.
    fed_forward: FedForward,
    velocity_command: Velocity,
    /// What acceleration and friction need, of the last tick, in 2^-25 of the peak current.
    acceleration: i32,
    friction: i32,
    torque_command: CurrentFraction,
    /// Movement of [`Mode::Travel`] and [`Mode::Halt`], and ramp of velocity commands.
    trajectory: Trajectory,
    travel: Travel,
    travel_limits: MotionLimits,
    /// Of the velocity loop or of the torque command in the last tick.
    current: CurrentFraction,
    filter: CurrentFilter,
    /// The next current that passes the filter is the first one.
    filter_begins: bool,
}

/// Of the reported velocity: slow enough for the standstill window of a coarse encoder, fast against the cycles in which a master looks at it.
const MONITOR_FILTER: VelocityFilter = VelocityFilter::from_microseconds(2_000);

impl Axis {
    /// An axis in [`Mode::Off`], at standstill at this measured position. Divides.
    #[must_use]
    pub fn new(settings: AxisSettings, measured: Position) -> Self {
        let here = Setpoint::moving(measured, Velocity::ZERO);
        let ranges = ranges_at(&settings, measured);
        Self {
            settings,
            mode: Mode::Off,
            measured,
            ranges,
            latest: Velocity::ZERO,
            velocity: FilteredVelocity::new(Velocity::ZERO),
            monitored: FilteredVelocity::new(Velocity::ZERO),
            interpolator: Interpolator::new(measured, ranges),
            velocity_interpolator: VelocityInterpolator::new(Velocity::ZERO),
            ramp: Ramp::new(here),
            expected_lag: ExpectedLag::new(&settings.position_loop, here),
            expected_velocity: FilteredVelocity::new(Velocity::ZERO),
            setpoint_velocities: [Velocity::ZERO; 2],
            turned: None,
            slow_velocity: Velocity::ZERO,
            guard: VelocityGuard::new(Velocity::ZERO, CurrentFraction::ZERO),
            velocity_loop: VelocityLoop::new(),
            fed_forward: FedForward::NONE,
            velocity_command: Velocity::ZERO,
            acceleration: 0,
            friction: 0,
            torque_command: CurrentFraction::ZERO,
            trajectory: Trajectory::start(here),
            travel: Travel::Hold,
            travel_limits: settings.halt,
            current: CurrentFraction::ZERO,
            filter: CurrentFilter::new(),
            filter_begins: false,
        }
    }

    /// Takes new settings over, also while the axis moves; the state of the loops is kept. Divides when the modulo value changes.
    pub fn apply_settings(&mut self, settings: &AxisSettings) {
        if settings.interpolator.modulo() != self.settings.interpolator.modulo() {
            self.ranges = ranges_at(settings, self.measured);
            self.interpolator.set_ranges(self.ranges);
        }
        // Nothing has passed it until now: a section that is switched on while current flows starts with that.
        self.filter_begins |= !self.settings.filter.is_active();
        self.settings = *settings;
    }

    /// Exchanges the limits of the velocity command, until new settings are applied.
    #[inline]
    pub fn set_velocity_limits(&mut self, limits: VelocityLimits) {
        self.settings.velocity_limits = limits;
    }

    /// Exchanges the ramps, also while one of them is run, until new settings are applied.
    pub fn set_movements(&mut self, movements: &AxisMovements) {
        self.settings.deceleration = movements.deceleration;
        self.settings.halt = movements.halt;
        self.settings.velocity_ramp = movements.velocity_ramp;
    }

    /// Settings in force.
    #[must_use]
    pub const fn settings(&self) -> &AxisSettings {
        &self.settings
    }

    /// Mode in force.
    #[must_use]
    pub const fn mode(&self) -> Mode {
        self.mode
    }

    /// Changes the mode without a bump: the new mode starts at the shaft, with the velocity command of the last tick as far as the shaft
    /// turns that fast, see `Axis::hand_over`, and with position control from a setpoint ahead by the lag that belongs to that velocity.
    /// The integral part of the velocity loop is kept: it holds the load.
    pub fn set_mode(&mut self, mode: Mode) {
        if mode == self.mode {
            return;
        }
        let setpoint = self.hand_over(mode);
        let measured = self.velocity.velocity();
        // Along the way that the shaft turns.
        let forth = if measured < Velocity::ZERO {
            setpoint.velocity < self.velocity_command
        } else {
            setpoint.velocity > self.velocity_command
        };
        if forth && measured.abs() > self.settings.standstill_window {
            // A loop that was turning the shaft back had an error against its integral part, which would drive the shaft on without it.
            self.velocity_loop.keep_at_most(self.current);
        }
        let follows = matches!(mode, Mode::Velocity | Mode::Position);
        if self.mode == Mode::Torque && !follows && self.gains_speed() {
            self.velocity_loop.reset();
        }
        // Torque commands pass no filter: what stands in it is old.
        self.filter_begins |= self.mode == Mode::Torque;
        self.slow_velocity = measured;
        match mode {
            Mode::Off => {
                self.velocity_loop.reset();
                self.current = CurrentFraction::ZERO;
                self.filter.reset(0);
            }
            Mode::Torque => {
                self.torque_command = CurrentFraction::ZERO;
                let carried = self.velocity_loop.carrying(&self.settings.velocity_loop, self.current);
                self.guard = VelocityGuard::new(measured, carried);
            }
            Mode::Velocity => {
                self.velocity_interpolator = VelocityInterpolator::new(setpoint.velocity);
                self.trajectory = Trajectory::start(setpoint);
            }
            Mode::Stopping => self.ramp = Ramp::new(setpoint),
            Mode::Braking => {}
            Mode::Position => {
                let ranges = self.ranges_near(setpoint.position);
                self.interpolator.start(&self.settings.interpolator, setpoint.position, setpoint.velocity, ranges);
            }
            Mode::Halt => self.trajectory = Trajectory::start(setpoint),
            Mode::Travel => {
                self.trajectory = Trajectory::start(setpoint);
                self.travel = Travel::Hold;
                self.travel_limits = self.settings.halt;
            }
        }
        self.expected_lag = ExpectedLag::new(&self.settings.position_loop, setpoint);
        self.setpoint_velocities = [setpoint.velocity; 2];
        self.velocity_command = setpoint.velocity;
        self.turned = Some(setpoint.velocity);
        self.expected_velocity = FilteredVelocity::new(setpoint.velocity);
        self.fed_forward = FedForward::NONE;
        self.mode = mode;
    }

    /// The torque command makes the shaft faster: how much of it the load needs nobody knows, and a stop that went on with it would make the
    /// shaft faster still. The torque of a shaft that keeps its speed is that of the load.
    fn gains_speed(&self) -> bool {
        let velocity = self.velocity.velocity();
        let gained = velocity.abs().to_bits().saturating_sub(self.slow_velocity.abs().to_bits());
        // An eighth of the speed within the time, and more than a shaft that is held trembles.
        let least = velocity.abs().max(self.settings.standstill_window).to_bits() >> 3;
        self.velocity_loop.pushes(velocity) && gained > least
    }

    /// What a mode starts from: the shaft, and a velocity between standstill and that of the shaft.
    ///
    /// A command that is ahead of the shaft (it accelerates, or it is held back) must not be reached only to be braked from: a stop never
    /// makes the shaft faster. A command behind it, down to zero, brakes the shaft already: that is not let go, but where a place is to be
    /// held. The shaft would run past that place, and come back. On an axis that follows its command the two are the same but for the noise
    /// of the measured one, and nothing bumps.
    fn hand_over(&self, mode: Mode) -> Setpoint {
        let measured = self.velocity.velocity();
        let (slowest, fastest) =
            if measured < Velocity::ZERO { (measured, Velocity::ZERO) } else { (Velocity::ZERO, measured) };
        let commanded = self.velocity_command.max(slowest).min(fastest);
        let positioned = matches!(mode, Mode::Position | Mode::Halt | Mode::Travel);
        let most = Velocity::from_bits(measured.to_bits().wrapping_sub(measured.to_bits() >> 2));
        let velocity = if positioned && commanded.abs() < most.abs() { measured } else { commanded };
        let ahead = self.settings.moved_since_measured(velocity) + self.settings.position_loop.lag(velocity);
        Setpoint::moving(self.measured + ahead, velocity)
    }

    /// Takes a position command valid at t3: within `0 ..` modulo value, or absolute. Ignored outside [`Mode::Position`].
    ///
    /// # Errors
    /// [`CommandJump`] when it is too far from the one before it, or, as the first one in the mode, from the axis. It is not taken then.
    #[inline]
    pub fn command_position(&mut self, command: Position) -> Result<(), CommandJump> {
        if self.mode == Mode::Position {
            let settings = &self.settings;
            self.interpolator.command(&settings.interpolator, command)?;
            self.fed_forward.command(
                settings.velocity_loop.acceleration(),
                settings.acceleration_smoothing,
                &settings.interpolator,
                self.interpolator.accelerations(),
            );
        }
        Ok(())
    }

    /// Notes the command that is in force where [`Mode::Position`] has begun between two commands: it says that it follows, and what comes next is
    /// looked at as a step from there, beside its distance from the axis.
    #[inline]
    pub fn note_standing_command(&mut self, command: Position) {
        if self.mode == Mode::Position {
            self.interpolator.note_standing(&self.settings.interpolator, command);
        }
    }

    /// Whether [`Mode::Position`] would begin with this command, from where the axis is.
    ///
    /// # Errors
    /// [`CommandJump`], as [`Axis::command_position`] would then say.
    pub fn would_follow(&self, command: Position) -> Result<(), CommandJump> {
        let setpoint = self.hand_over(Mode::Position);
        let mut interpolator = self.interpolator;
        let ranges = self.ranges_near(setpoint.position);
        interpolator.start(&self.settings.interpolator, setpoint.position, setpoint.velocity, ranges);
        interpolator.command(&self.settings.interpolator, command)
    }

    /// Takes a velocity command valid at t3. Ignored outside [`Mode::Velocity`].
    #[inline]
    pub fn command_velocity(&mut self, command: Velocity) {
        if self.mode == Mode::Velocity {
            let limited = self.settings.velocity_limits.limit(command);
            self.velocity_interpolator.command(&self.settings.interpolator, limited);
        }
    }

    /// Takes a torque command valid at t3, as the current that makes it. Ignored outside [`Mode::Torque`].
    #[inline]
    pub fn command_torque(&mut self, command: CurrentFraction) {
        if self.mode == Mode::Torque {
            self.torque_command = command;
        }
    }

    /// Where the axis is to go in [`Mode::Travel`], and how fast; may change in any tick. Ignored in other modes.
    #[inline]
    pub fn travel(&mut self, limits: MotionLimits, travel: Travel) {
        if self.mode == Mode::Travel {
            self.travel = travel;
            self.travel_limits = limits;
        }
    }

    /// Where the set-point of [`Mode::Position`] or [`Mode::Travel`] is led to, unbounded; `None` while nothing leads it: it comes to rest, or no
    /// command has come yet.
    #[must_use]
    pub fn aim(&self) -> Option<Position> {
        match (self.mode, self.travel) {
            (Mode::Position, _) => self.interpolator.aim(),
            (Mode::Travel, Travel::To(place)) => Some(place),
            (Mode::Travel, Travel::AtVelocity(velocity)) if velocity > Velocity::ZERO => Some(self.measured + FAR),
            (Mode::Travel, Travel::AtVelocity(velocity)) if velocity < Velocity::ZERO => Some(self.measured - FAR),
            _ => None,
        }
    }

    /// The set-point of [`Mode::Travel`] or [`Mode::Halt`] does not move.
    #[must_use]
    pub const fn setpoint_rests(&self) -> bool {
        self.trajectory.is_at_rest()
    }

    /// Whether the set-point of [`Mode::Travel`] can still stop at `target` without passing it; one that moves away from it can.
    #[must_use]
    pub fn stops_before(&self, limits: &MotionLimits, target: Position) -> bool {
        self.trajectory.stops_before(limits, target)
    }

    /// Starts the velocity loop with this current: what held the load when the axis was last switched off.
    pub fn preload(&mut self, current: CurrentFraction) {
        self.velocity_loop.preset(current);
        self.current = current;
        self.filter.reset(fine(current));
    }

    /// Holds the place where the axis stands, beginning with this current: something else has stopped it on the way of its ramp. Ignored
    /// outside [`Mode::Halt`], and of an axis that does not stand.
    pub fn anchor(&mut self, current: CurrentFraction) {
        if self.mode == Mode::Halt && self.velocity.velocity().abs() <= self.settings.standstill_window {
            self.preload(current);
            let setpoint = Setpoint::moving(self.measured, Velocity::ZERO);
            self.trajectory = Trajectory::start(setpoint);
            self.expected_lag = ExpectedLag::new(&self.settings.position_loop, setpoint);
            self.setpoint_velocities = [Velocity::ZERO; 2];
            self.expected_velocity = FilteredVelocity::new(Velocity::ZERO);
        }
    }

    /// One loop period: the measured position goes in, the current command comes out, within these limits of the torque.
    ///
    /// `latest`: the velocity over the last step of the velocity loop, half a period where it runs twice in it.
    #[inline]
    pub fn tick(&mut self, measured: Position, latest: Velocity, limits: &TorqueLimits) -> AxisOutput {
        self.measured = measured;
        if self.mode != Mode::Position {
            return self.tick_without_commands(latest, limits);
        }
        let (setpoint, source) = self.interpolator.tick(&self.settings.interpolator);
        let acceleration =
            if source == CommandSource::Interpolated { self.fed_forward.tick() } else { self.fed_forward.coast() };
        let mut output = self.follow(setpoint, acceleration, latest, limits);
        output.command_source = source;
        output
    }

    /// Half a loop period later: the velocity loop once more, with the velocity over this half. The current command, if it is another one
    /// than that of the tick.
    ///
    /// A position loop has a bandwidth of a quarter of the velocity loop's at most, and a set-point has a known velocity in between: what is
    /// commanded meanwhile is the velocity of the tick, moved on by what the set-point has gained.
    #[inline]
    pub fn half_tick(&mut self, latest: Velocity, limits: &TorqueLimits) -> Option<CurrentFraction> {
        let [_, measured] = self.measure(latest);
        if matches!(self.mode, Mode::Off | Mode::Torque) {
            return None;
        }
        let settings = &self.settings;
        let command = match self.turned {
            Some(command) => command,
            None => {
                let [before, now] = self.setpoint_velocities;
                let expected = self.expected_velocity.velocity();
                let velocity = settings.as_measured_later(before, now);
                let gained = self.expected_velocity.update(&settings.velocity_filter, velocity) - expected;
                settings.position_loop.moved_on(&settings.velocity_limits, self.velocity_command, gained)
            }
        };
        let (current, _) = self.control(command, measured, limits);
        Some(current)
    }

    /// The rest of a tick in the modes without position commands.
    #[inline(never)]
    fn tick_without_commands(&mut self, latest: Velocity, limits: &TorqueLimits) -> AxisOutput {
        let settings = &self.settings;
        match self.mode {
            Mode::Off | Mode::Position => {
                let output = self.measured(latest);
                self.velocity_command = output.loop_velocity;
                output
            }
            Mode::Torque => {
                let mut output = self.measured(latest);
                self.velocity_command = output.loop_velocity;
                self.torque(limits, &mut output);
                output
            }
            Mode::Velocity => {
                let command = self.velocity_interpolator.tick();
                let ramped = match &settings.velocity_ramp {
                    Some(ramp) => self.trajectory.tick_velocity(ramp, command),
                    None => Setpoint {
                        acceleration: self.velocity_interpolator.acceleration(),
                        ..Setpoint::moving(self.measured, command)
                    },
                };
                let mut output = self.turn(ramped, latest, limits);
                output.limiting.set(Limiting::ACCELERATION, ramped.velocity != command);
                output
            }
            Mode::Stopping => {
                let ramped = self.ramp.tick(settings.deceleration);
                let mut output = self.turn(ramped, latest, limits);
                output.standstill &= self.ramp.is_finished();
                output
            }
            Mode::Braking => self.turn(Setpoint::moving(self.measured, Velocity::ZERO), latest, limits),
            Mode::Halt => {
                let setpoint = self.trajectory.tick_velocity(&settings.halt, Velocity::ZERO);
                let acceleration = settings.velocity_loop.feed_forward(setpoint.acceleration);
                let mut output = self.follow(setpoint, acceleration, latest, limits);
                output.standstill &= self.trajectory.is_finished();
                output
            }
            Mode::Travel => {
                let setpoint = match self.travel {
                    Travel::Hold => self.trajectory.tick_velocity(&self.travel_limits, Velocity::ZERO),
                    Travel::AtVelocity(velocity) => self.trajectory.tick_velocity(&self.travel_limits, velocity),
                    Travel::To(target) => self.trajectory.tick_to(&self.travel_limits, target),
                };
                let acceleration = settings.velocity_loop.feed_forward(setpoint.acceleration);
                let mut output = self.follow(setpoint, acceleration, latest, limits);
                output.travelled = self.trajectory.is_finished();
                output
            }
        }
    }

    /// Takes the velocity over the last step of the velocity loop. Gives the one over the last tick, and the one that the loop works with.
    #[inline]
    fn measure(&mut self, latest: Velocity) -> [Velocity; 2] {
        let settings = &self.settings;
        let before = core::mem::replace(&mut self.latest, latest);
        let over_tick = match settings.velocity_rate {
            VelocityRate::EachTick => latest,
            VelocityRate::TwiceATick => mean(before, latest),
        };
        let seen = if settings.spans_tick { over_tick } else { latest };
        [over_tick, self.velocity.update(&settings.velocity_filter, seen)]
    }

    /// What is measured, without any command.
    #[inline]
    fn measured(&mut self, latest: Velocity) -> AxisOutput {
        let [over_tick, loop_velocity] = self.measure(latest);
        let velocity = self.monitored.update(&MONITOR_FILTER, over_tick);
        AxisOutput {
            velocity,
            loop_velocity,
            velocity_command: loop_velocity,
            standstill: velocity.abs() <= self.settings.standstill_window,
            travelled: false,
            ..AxisOutput::at_rest(self.measured)
        }
    }

    /// From a position, and the current that its acceleration needs, to the current.
    ///
    /// Inlined so that position commands have a path of their own, without what only other movements need.
    #[inline(always)]
    fn follow(&mut self, setpoint: Setpoint, acceleration: i32, latest: Velocity, limits: &TorqueLimits) -> AxisOutput {
        let mut output = self.measured(latest);
        let settings = &self.settings;
        let [_, before] = self.setpoint_velocities;
        self.setpoint_velocities = [before, setpoint.velocity];
        self.turned = None;
        let velocity = settings.as_measured(before, setpoint.velocity);
        let expected = self.expected_velocity.update(&settings.velocity_filter, velocity);
        let followed = settings.position_loop.follow(
            &settings.velocity_limits,
            Setpoint { velocity: expected, ..setpoint },
            self.measured + settings.moved_since_measured(setpoint.velocity),
        );
        output.velocity_command = followed.velocity;
        output.position_command = setpoint.position;
        output.following_error = followed.following_error;
        output.limiting = followed.limiting;
        self.expected_lag.note(setpoint.position, followed.following_error);
        self.feed_forward(acceleration, followed.velocity);
        self.control_tick(followed.velocity, limits, &mut output);
        output
    }

    /// From a velocity to the current.
    ///
    /// The velocity of the tick holds from its middle on, where the velocity loop runs twice in it: a ramp is one in both halves.
    #[inline]
    fn turn(&mut self, setpoint: Setpoint, latest: Velocity, limits: &TorqueLimits) -> AxisOutput {
        let mut output = self.measured(latest);
        let settings = &self.settings;
        output.velocity_command = setpoint.velocity;
        output.limiting = settings.velocity_limits.met_by(setpoint.velocity);
        let command = match settings.velocity_rate {
            VelocityRate::EachTick => setpoint.velocity,
            VelocityRate::TwiceATick => mean(self.velocity_command, setpoint.velocity),
        };
        self.turned = Some(setpoint.velocity);
        self.feed_forward(settings.velocity_loop.feed_forward(setpoint.acceleration), setpoint.velocity);
        self.control_tick(command, limits, &mut output);
        output
    }

    /// Takes the velocity command of a tick, and the current that its acceleration needs.
    #[inline]
    fn feed_forward(&mut self, acceleration: i32, command: Velocity) {
        self.acceleration = acceleration;
        self.friction = self.settings.friction.current(command);
        self.velocity_command = command;
    }

    /// The step of the velocity loop that belongs to a tick.
    #[inline]
    fn control_tick(&mut self, command: Velocity, limits: &TorqueLimits, output: &mut AxisOutput) {
        let (current, limiting) = self.control(command, output.loop_velocity, limits);
        output.current = current;
        output.limiting |= limiting;
    }

    /// A step of the velocity loop: from the velocity command to the current, and what holds that back.
    #[inline]
    fn control(&mut self, command: Velocity, measured: Velocity, limits: &TorqueLimits) -> (CurrentFraction, Limiting) {
        let settings = &self.settings;
        let fed_forward = self.acceleration.saturating_add(self.friction);
        let controlled = self.velocity_loop.tick(&settings.velocity_loop, limits, command, measured, fed_forward);
        self.current = controlled.current;
        if !settings.filter.is_active() {
            return (controlled.current, controlled.limiting);
        }
        // The current for the acceleration comes from commands, without the noise of a measurement: filtered it would only be late. What
        // the limits take of it must not stand in the filter with the opposite sign when it ends.
        let [lowest, highest] = bounds(limits);
        let beside = self.acceleration.min(highest).max(lowest) << (31 - CURRENT_BITS);
        let fed_back = fine(controlled.current).saturating_sub(beside);
        if core::mem::take(&mut self.filter_begins) {
            self.filter.reset(fed_back);
        }
        let filtered = self.filter.tick(&settings.filter, fed_back).saturating_add(beside);
        // A filter may swing beyond the limit that its input keeps.
        (limits.apply(CurrentFraction::from_bits((filtered >> 16) as i16)).0, controlled.limiting)
    }

    /// The torque command, or less where the velocity limit S-0-0091 stands in its way.
    fn torque(&mut self, limits: &TorqueLimits, output: &mut AxisOutput) {
        let settings = &self.settings;
        let (slow, now) = (self.slow_velocity.to_bits(), output.velocity.to_bits());
        self.slow_velocity = Velocity::from_bits(towards(slow, now, SLOW_SHIFT));
        let (wanted, limiting) = limits.apply(self.torque_command);
        let velocity_limits = &settings.velocity_limits;
        let limit = if wanted >= CurrentFraction::ZERO { velocity_limits.positive } else { velocity_limits.negative };
        let velocities = [limit, output.loop_velocity];
        let guarded = self.guard.tick(&settings.velocity_loop, limits, velocities, wanted);
        self.velocity_loop.preset(guarded.lasting);
        self.current = guarded.current;
        output.current = guarded.current;
        output.limiting = if guarded.is_held { velocity_limits.met_by(limit) } else { limiting };
    }

    /// Looks after the axis: keeps the modulo range near it, and finds out whether it is further from the lag that its command makes it
    /// expect than the monitoring window (C1D bit 11), in a mode with position commands. To be called once in
    /// [`crate::units::LOOP_TICKS_PER_SUPERVISION`] ticks.
    #[inline]
    #[must_use]
    pub fn supervise(&mut self) -> bool {
        self.ranges = self.ranges_near(self.measured);
        let settings = &self.settings;
        matches!(self.mode, Mode::Position | Mode::Halt | Mode::Travel)
            && self.expected_lag.deviates(
                &settings.deviation,
                &settings.position_loop,
                &settings.velocity_limits,
                self.expected_velocity.velocity(),
            )
    }

    #[inline]
    fn ranges_near(&self, position: Position) -> ModuloCounter {
        let mut ranges = self.ranges;
        if let Some(modulo) = self.settings.interpolator.modulo() {
            ranges.wrap(modulo, position);
        }
        ranges
    }

    /// A measured position near that of the last tick (the latch of t4) as cyclic data show it: within `0 ..` modulo value,
    /// or as it is without modulo.
    #[inline]
    #[must_use]
    pub fn cyclic_position(&self, position: Position) -> Position {
        match self.settings.interpolator.modulo() {
            Some(modulo) => {
                let mut ranges = self.ranges;
                ranges.wrap(modulo, position)
            }
            None => position,
        }
    }

    /// Moves the zero of the axis by `difference` without a movement, as [`crate::encoder::Encoder::set_position`] did with the measurement.
    /// Divides.
    pub fn shift(&mut self, difference: Position) {
        self.measured = self.measured + difference;
        self.ranges = ranges_at(&self.settings, self.measured);
        self.interpolator.shift(difference);
        self.interpolator.set_ranges(self.ranges);
        self.ramp.shift(difference);
        self.trajectory.shift(difference);
        self.expected_lag.shift(difference);
    }
}

/// Of two velocities, rounded down.
#[inline]
fn mean(one: Velocity, other: Velocity) -> Velocity {
    Velocity::from_bits((i64::from(one.to_bits()).wrapping_add(i64::from(other.to_bits())) >> 1) as i32)
}

/// Where an axis goes that only has a velocity: 2^16 revolutions, further than any set-point is from its axis.
const FAR: Position = Position::from_bits(1 << 48);

/// A velocity of [`Mode::Torque`] is followed within 2^5 ticks, 4 ms.
const SLOW_SHIFT: u32 = 5;

/// In 2^-31 of peak.
fn fine(current: CurrentFraction) -> i32 {
    i32::from(current.to_bits()) << 16
}

fn ranges_at(settings: &AxisSettings, position: Position) -> ModuloCounter {
    settings
        .interpolator
        .modulo()
        .map_or_else(ModuloCounter::default, |modulo| ModuloCounter::containing(modulo, position))
}
