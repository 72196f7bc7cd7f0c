//! A motor with its load, fed by a current-controlled amplifier and measured by an incremental encoder.

/// Physical parameters of a motor and its load, in SI units at the motor shaft.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MotorSettings {
    /// Torque at the amplifier's peak current, in Nm. The torque is this times the fraction of peak current.
    pub peak_torque: f64,
    /// Inertia of the rotor and, without coupling, of the load, in kg m².
    pub inertia: f64,
    /// Coulomb friction in Nm; holds the shaft at standstill against any smaller torque.
    pub coulomb_friction: f64,
    /// Viscous friction in Nm s/rad.
    pub viscous_friction: f64,
    /// Time constant of the amplifier's current loop in seconds; 0 follows at once.
    pub current_time_constant: f64,
    /// Encoder increments (edges) per revolution.
    pub increments_per_revolution: u32,
    /// Encoder counter at time zero.
    pub initial_count: u32,
    /// A load on an elastic shaft; `None` is one rigid mass.
    pub coupling: Option<Coupling>,
}

/// Load on an elastic shaft.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Coupling {
    /// Inertia of the load in kg m².
    pub load_inertia: f64,
    /// Torsional stiffness in Nm/rad.
    pub stiffness: f64,
    /// Torsional damping in Nm s/rad.
    pub damping: f64,
}

/// State at one instant.
#[derive(Clone, Copy, Debug, PartialEq)]
struct State {
    /// Whole revolutions and the rest, 0 ..= 1 revolution: no loss of resolution however far the motor turns.
    revolutions: i64,
    angle: f64,
    /// In rad/s.
    velocity: f64,
    /// Fraction of peak current that flows.
    current: f64,
    /// Load relative to the motor, in rad and rad/s (0 without coupling).
    twist: f64,
    load_velocity: f64,
}

/// A simulated motor.
#[derive(Clone, Debug, PartialEq)]
pub struct Motor {
    settings: MotorSettings,
    state: State,
    /// Instant of `state`: on the grid, or at the last change of an input.
    time: u64,
    command: f64,
    load_torque: f64,
}

/// The integration grid in nanoseconds.
const GRID: u64 = 10_000;
const RADIANS_PER_REVOLUTION: f64 = core::f64::consts::TAU;

impl Motor {
    /// A motor at rest at time zero, its shaft where the encoder shows `initial_count` (in the middle of an increment).
    ///
    /// # Panics
    /// When an inertia or the encoder resolution is not positive: the simulation would make no sense.
    #[must_use]
    pub fn new(settings: MotorSettings) -> Self {
        assert!(settings.inertia > 0.0, "inertia must be positive");
        assert!(settings.increments_per_revolution > 0, "the encoder needs increments");
        assert!(settings.coupling.is_none_or(|c| c.load_inertia > 0.0), "load inertia must be positive");
        let angle = 0.5 / f64::from(settings.increments_per_revolution);
        let state = State { revolutions: 0, angle, velocity: 0.0, current: 0.0, twist: 0.0, load_velocity: 0.0 };
        Self { settings, state, time: 0, command: 0.0, load_torque: 0.0 }
    }

    /// The parameters.
    #[must_use]
    pub fn settings(&self) -> &MotorSettings {
        &self.settings
    }

    /// Lets time pass until `to` nanoseconds. Earlier instants than those already reached are left alone.
    pub fn advance(&mut self, to: u64) {
        loop {
            let next = (self.time / GRID + 1) * GRID;
            if next > to {
                return;
            }
            self.state = self.step(next - self.time);
            self.time = next;
        }
    }

    /// Sets the current command at the instant `at`, as a fraction of peak current; limited to -1 ..= 1.
    pub fn set_current(&mut self, fraction: f64, at: u64) {
        let fraction = fraction.clamp(-1.0, 1.0);
        if fraction != self.command {
            self.settle(at);
            self.command = fraction;
        }
    }

    /// Switches the current off at the instant `at`, without the time constant of the current loop: the power stage opens.
    pub fn cut_current(&mut self, at: u64) {
        if self.command != 0.0 || self.state.current != 0.0 {
            self.settle(at);
            self.command = 0.0;
            self.state.current = 0.0;
        }
    }

    /// Sets the torque with which the load drives the shaft (negative brakes positive movement), in Nm, at the instant `at`.
    pub fn set_load_torque(&mut self, torque: f64, at: u64) {
        if torque != self.load_torque {
            self.settle(at);
            self.load_torque = torque;
        }
    }

    /// The encoder counter at the instant `at`: quantised, wrapping at 2^32.
    #[must_use]
    pub fn encoder_count(&mut self, at: u64) -> u32 {
        let state = self.state_at(at);
        let resolution = self.settings.increments_per_revolution;
        let increments = (state.angle * f64::from(resolution)).floor() as i64;
        let count = state.revolutions.wrapping_mul(i64::from(resolution)).wrapping_add(increments);
        self.settings.initial_count.wrapping_add(count as u32)
    }

    /// Angle of the motor shaft since time zero in revolutions, at the instant `at`.
    #[must_use]
    pub fn angle(&mut self, at: u64) -> f64 {
        let state = self.state_at(at);
        state.revolutions as f64 + (state.angle - 0.5 / f64::from(self.settings.increments_per_revolution))
    }

    /// Velocity of the motor shaft in rad/s at the instant `at`.
    #[must_use]
    pub fn velocity(&mut self, at: u64) -> f64 {
        self.state_at(at).velocity
    }

    /// Torque of the motor in Nm at the instant `at`.
    #[must_use]
    pub fn torque(&mut self, at: u64) -> f64 {
        self.state_at(at).current * self.settings.peak_torque
    }

    /// Gives the shaft a velocity in rad/s at the instant `at`, load included: a start in full run.
    pub fn set_velocity(&mut self, velocity: f64, at: u64) {
        self.settle(at);
        self.state.velocity = velocity;
        self.state.load_velocity = velocity;
        self.state.twist = 0.0;
    }

    /// The state at an instant, beside the grid without a trace in the state that is kept.
    fn state_at(&mut self, at: u64) -> State {
        self.advance(at);
        self.step(at.saturating_sub(self.time))
    }

    /// Moves the kept state to an instant at which an input changes.
    fn settle(&mut self, at: u64) {
        self.state = self.state_at(at);
        self.time = self.time.max(at);
    }

    fn step(&self, nanoseconds: u64) -> State {
        if nanoseconds == 0 {
            return self.state;
        }
        let dt = nanoseconds as f64 * 1e-9;
        let s = &self.settings;
        let old = self.state;
        let mut new = old;

        // First order, exact in its end value and stable for any time constant.
        let share = (dt / (s.current_time_constant + 0.5 * dt)).min(1.0);
        new.current = old.current + (self.command - old.current) * share;
        let drive = 0.5 * (old.current + new.current) * s.peak_torque;

        let (outside, shaft) = match s.coupling {
            None => (drive + self.load_torque, 0.0),
            Some(c) => {
                let shaft = c.stiffness * old.twist + c.damping * (old.load_velocity - old.velocity);
                (drive + shaft, shaft)
            }
        };
        new.velocity = rub(old.velocity, outside, s, dt);
        let travel = 0.5 * (old.velocity + new.velocity) * dt / RADIANS_PER_REVOLUTION;
        if let Some(c) = s.coupling {
            new.load_velocity = old.load_velocity + (self.load_torque - shaft) / c.load_inertia * dt;
            new.twist = old.twist + (new.load_velocity - new.velocity) * dt;
        }

        let angle = old.angle + travel;
        let whole = angle.floor();
        new.revolutions = old.revolutions + whole as i64;
        new.angle = angle - whole;
        new
    }
}

/// The velocity after `dt` under an outside torque and friction; friction slows down and holds, it never drives.
fn rub(velocity: f64, outside: f64, s: &MotorSettings, dt: f64) -> f64 {
    let direction = if velocity != 0.0 { velocity.signum() } else { outside.signum() };
    if velocity == 0.0 && outside.abs() <= s.coulomb_friction {
        return 0.0;
    }
    let torque = outside - direction * s.coulomb_friction;
    // Trapezoidal in the viscous part.
    let half = 0.5 * s.viscous_friction * dt / s.inertia;
    let next = (velocity * (1.0 - half) + torque / s.inertia * dt) / (1.0 + half);
    let reversed = next * direction < 0.0;
    if reversed && outside.abs() <= s.coulomb_friction { 0.0 } else { next }
}
