//! A motor with its load, fed by a current-controlled amplifier and measured by an incremental encoder.

use crate::friction::Friction;
use crate::timeline::{Stretch, Timeline};
use crate::turn::Turn;

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
    turn: Turn,
    /// In rad/s.
    velocity: f64,
    /// Fraction of peak current that flows.
    current: f64,
    /// Load relative to the motor, in rad and rad/s (0 without coupling).
    twist: f64,
    load_velocity: f64,
}

/// A simulated motor.
///
/// Inputs carry the instant from which they hold, which may lie ahead of the queries; instants of inputs never go back.
/// Queries never go back behind an instant that was already reached by more than one grid step.
#[derive(Clone, Debug, PartialEq)]
pub struct Motor {
    settings: MotorSettings,
    state: State,
    timeline: Timeline<Input, GRID>,
    command: f64,
    load_torque: f64,
    /// The current command after all inputs, to drop inputs that change nothing.
    last_command: f64,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Input {
    Current(f64),
    Cut,
    LoadTorque(f64),
    Velocity(f64),
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
        let turn = Turn::start(settings.increments_per_revolution);
        let state = State { turn, velocity: 0.0, current: 0.0, twist: 0.0, load_velocity: 0.0 };
        Self { settings, state, timeline: Timeline::new(), command: 0.0, load_torque: 0.0, last_command: 0.0 }
    }

    /// The parameters.
    #[must_use]
    pub fn settings(&self) -> &MotorSettings {
        &self.settings
    }

    /// Lets time pass until `to` nanoseconds. Earlier instants than those already reached are left alone.
    pub fn advance(&mut self, to: u64) {
        while let Some(Stretch { nanoseconds, input }) = self.timeline.next(to) {
            self.state = self.step(nanoseconds);
            if let Some(input) = input {
                self.apply(input);
            }
        }
    }

    /// Sets the current command from the instant `at` on, as a fraction of peak current; limited to -1 ..= 1.
    pub fn set_current(&mut self, fraction: f64, at: u64) {
        let fraction = fraction.clamp(-1.0, 1.0);
        // A repeated command is no event: the result must not depend on how often it is repeated.
        if fraction != self.last_command {
            self.last_command = fraction;
            self.timeline.enter(Input::Current(fraction), at);
        }
    }

    /// Switches the current off at the instant `at`, without the time constant of the current loop: the power stage opens.
    pub fn cut_current(&mut self, at: u64) {
        self.last_command = 0.0;
        self.timeline.enter(Input::Cut, at);
    }

    /// Sets the torque with which the load drives the shaft (negative brakes positive movement), in Nm, from the instant `at` on.
    pub fn set_load_torque(&mut self, torque: f64, at: u64) {
        self.timeline.enter(Input::LoadTorque(torque), at);
    }

    /// Gives the shaft a velocity in rad/s at the instant `at`, load included: a start in full run.
    pub fn set_velocity(&mut self, velocity: f64, at: u64) {
        self.timeline.enter(Input::Velocity(velocity), at);
    }

    /// The encoder counter at the instant `at`: quantised, wrapping at 2^32.
    #[must_use]
    pub fn encoder_count(&mut self, at: u64) -> u32 {
        let turn = self.state_at(at).turn;
        self.settings.initial_count.wrapping_add(turn.count(self.settings.increments_per_revolution))
    }

    /// Angle of the motor shaft since time zero in revolutions, at the instant `at`.
    #[must_use]
    pub fn angle(&mut self, at: u64) -> f64 {
        self.state_at(at).turn.since_start(self.settings.increments_per_revolution)
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

    /// The state at an instant, beside the grid without a trace in the state that is kept.
    fn state_at(&mut self, at: u64) -> State {
        self.advance(at);
        self.step(self.timeline.beyond(at))
    }

    fn apply(&mut self, input: Input) {
        match input {
            Input::Current(fraction) => self.command = fraction,
            Input::Cut => {
                self.command = 0.0;
                self.state.current = 0.0;
            }
            Input::LoadTorque(torque) => self.load_torque = torque,
            Input::Velocity(velocity) => {
                self.state.velocity = velocity;
                self.state.load_velocity = velocity;
                self.state.twist = 0.0;
            }
        }
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
        let friction = Friction { coulomb: s.coulomb_friction, viscous: s.viscous_friction, inertia: s.inertia };
        new.velocity = friction.rub(old.velocity, outside, dt);
        let travel = 0.5 * (old.velocity + new.velocity) * dt / RADIANS_PER_REVOLUTION;
        if let Some(c) = s.coupling {
            new.load_velocity = old.load_velocity + (self.load_torque - shaft) / c.load_inertia * dt;
            new.twist = old.twist + (new.load_velocity - new.velocity) * dt;
        }

        new.turn = old.turn.after(travel);
        new
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn settings() -> MotorSettings {
        MotorSettings {
            peak_torque: 10.0,
            inertia: 0.01,
            coulomb_friction: 0.0,
            viscous_friction: 0.0,
            current_time_constant: 0.0,
            increments_per_revolution: 4_096,
            initial_count: 0,
            coupling: None,
        }
    }

    const SECOND: u64 = 1_000_000_000;

    #[test]
    fn constant_torque_gives_constant_acceleration() {
        let mut motor = Motor::new(settings());
        motor.set_current(0.5, 0);
        // 5 Nm / 0.01 kg m²: 500 rad/s, 250 rad after a second
        assert!((motor.velocity(SECOND) - 500.0).abs() < 0.01);
        assert!((motor.angle(SECOND) * RADIANS_PER_REVOLUTION - 250.0).abs() < 0.01);
    }

    #[test]
    fn commands_beyond_the_peak_current_give_the_peak_torque() {
        let mut motor = Motor::new(settings());
        motor.set_current(-3.0, 0);
        assert!((motor.torque(SECOND) + 10.0).abs() < 1e-9);
    }

    #[test]
    fn the_current_follows_with_its_time_constant() {
        let mut motor = Motor::new(MotorSettings { current_time_constant: 0.001, ..settings() });
        motor.set_current(1.0, 0);
        let torque = motor.torque(1_000_000);
        assert!((6.25..6.40).contains(&torque), "63 % after one time constant: {torque}");
        motor.cut_current(2_000_000);
        assert_eq!(motor.torque(2_000_000), 0.0);
    }

    #[test]
    fn coulomb_friction_holds_then_brakes_and_never_drives() {
        let mut motor = Motor::new(MotorSettings { coulomb_friction: 1.0, ..settings() });
        motor.set_current(0.09, 0);
        assert_eq!(motor.velocity(SECOND), 0.0, "0.9 Nm do not break 1 Nm");
        motor.set_current(0.3, SECOND);
        assert!((motor.velocity(2 * SECOND) - 200.0).abs() < 0.1);
        motor.set_current(0.0, 2 * SECOND);
        assert!((motor.velocity(3 * SECOND) - 100.0).abs() < 0.1);
        assert_eq!(motor.velocity(5 * SECOND), 0.0);
        let stands = motor.angle(5 * SECOND);
        assert_eq!(motor.angle(6 * SECOND), stands);
    }

    #[test]
    fn viscous_friction_leads_to_the_speed_of_balance() {
        let mut motor = Motor::new(MotorSettings { viscous_friction: 0.1, ..settings() });
        motor.set_current(0.2, 0);
        assert!((motor.velocity(2 * SECOND) - 20.0).abs() < 0.001);
        // one time constant of 0.1 s: 63.2 %
        let mut motor = Motor::new(MotorSettings { viscous_friction: 0.1, ..settings() });
        motor.set_current(0.2, 0);
        assert!((motor.velocity(SECOND / 10) - 12.642).abs() < 0.01);
    }

    #[test]
    fn the_encoder_counts_quantised_down_and_wraps() {
        let mut motor = Motor::new(MotorSettings { initial_count: 5, ..settings() });
        assert_eq!(motor.encoder_count(0), 5);
        motor.set_velocity(-RADIANS_PER_REVOLUTION, 0);
        assert_eq!(motor.encoder_count(SECOND), 5_u32.wrapping_sub(4_096));
        assert_eq!(motor.encoder_count(SECOND + SECOND / 4_096 / 4), 5_u32.wrapping_sub(4_096));
        assert_eq!(motor.encoder_count(SECOND + SECOND / 4_096), 5_u32.wrapping_sub(4_097));
        // 2^32 increments are 1 048 576 revolutions: as many seconds
        let mut motor = Motor::new(settings());
        motor.set_velocity(1_000.0 * RADIANS_PER_REVOLUTION, 0);
        let count = motor.encoder_count(100 * SECOND);
        assert!(count.abs_diff(409_600_000) <= 1, "{count}");
    }

    #[test]
    fn the_result_does_not_depend_on_how_often_it_is_asked() {
        let run = |step: u64| {
            let mut motor = Motor::new(MotorSettings {
                coulomb_friction: 0.3,
                viscous_friction: 0.01,
                current_time_constant: 0.000_2,
                coupling: Some(Coupling { load_inertia: 0.02, stiffness: 500.0, damping: 0.05 }),
                ..settings()
            });
            for n in 0..100_u64 {
                let at = n * 125_000 + 3_333;
                motor.set_current(((n * 37) % 21) as f64 / 10.0 - 1.0, at);
                let mut asked = at;
                while asked < at + 125_000 {
                    let _ = motor.encoder_count(asked);
                    motor.set_current(((n * 37) % 21) as f64 / 10.0 - 1.0, asked);
                    asked += step;
                }
            }
            (motor.angle(20_000_000).to_bits(), motor.velocity(20_000_000).to_bits())
        };
        let reference = run(125_000);
        for step in [777, 9_999, 10_000, 31_250] {
            assert_eq!(run(step), reference, "asked every {step} ns");
        }
    }

    #[test]
    fn an_input_ahead_of_time_waits_for_it() {
        let mut motor = Motor::new(settings());
        motor.set_current(1.0, 5_000);
        assert_eq!(motor.torque(4_999), 0.0);
        assert_eq!(motor.torque(5_000), 0.0, "half the rise has yet to come");
        assert!(motor.torque(5_001) > 9.9);
        assert_eq!(motor.velocity(5_000), 0.0);
    }

    #[test]
    fn an_elastic_load_swings_at_its_resonance_and_keeps_momentum() {
        let coupling = Coupling { load_inertia: 0.03, stiffness: 1_000.0, damping: 0.0 };
        let mut motor = Motor::new(MotorSettings { coupling: Some(coupling), ..settings() });
        motor.set_current(0.4, 0);
        motor.set_current(0.0, SECOND / 100);
        // 4 Nm * 10 ms / 0.04 kg m²: 1 rad/s on average; resonance sqrt(1000 * (1/0.01 + 1/0.03)) = 365 rad/s
        let velocities: Vec<f64> = (0..10_000).map(|n| motor.velocity(SECOND / 10 + n * 100_000)).collect();
        let mean = velocities.iter().sum::<f64>() / velocities.len() as f64;
        assert!((mean - 1.0).abs() < 0.02, "{mean}");
        let crossings = velocities.windows(2).filter(|pair| (pair[0] < mean) != (pair[1] < mean)).count();
        assert!((113..=119).contains(&crossings), "58.1 Hz for a second: {crossings} crossings");
    }
}
