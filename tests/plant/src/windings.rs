//! The windings of a permanent magnet synchronous motor.

use crate::frame::{Dq, Frame};
use crate::inverter::Terminal;

/// Rise of copper's resistance per kelvin, from 20 degrees Celsius.
const COPPER: f64 = 0.003_93;
/// So many times the currents' directions are tried, which settle at once but where a current passes zero.
const ATTEMPTS: usize = 8;

/// Windings in star connection without a wired star point, in the rotor's frame. Quantities of d and q are amplitudes of phase quantities.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Windings {
    /// Electrical turns per revolution.
    pub pole_pairs: u32,
    /// Resistance of a phase in ohm at 20 degrees Celsius; it rises with the temperature as copper's does.
    pub resistance: f64,
    /// Inductance along the magnet in H.
    pub inductance_d: f64,
    /// Inductance across the magnet in H.
    pub inductance_q: f64,
    /// Flux linkage of the magnet in Vs, the amplitude of a phase. The torque constant is 1.5 times this and the pole pairs, in Nm per A
    /// of amplitude.
    pub flux: f64,
    /// How the iron saturates; `None` leaves the inductances constant.
    pub saturation: Option<Saturation>,
}

/// Saturation of the iron: an axis' current `i` links the flux `L i / sqrt(1 + (i / current)²)`. The magnet's flux stays.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Saturation {
    /// The current in A at which 71 % of the inductance is left.
    pub current: f64,
}

/// What the windings meet during a step.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Surroundings {
    /// Resistance of a phase in ohm.
    pub(crate) resistance: f64,
    /// Electrical angular velocity in rad/s.
    pub(crate) speed: f64,
    /// What the magnet induces, in V.
    pub(crate) emf: Dq,
    /// The rotor's frame in the middle of the step.
    pub(crate) frame: Frame,
    /// Bus voltage in V.
    pub(crate) bus: f64,
    /// Length of the step in seconds.
    pub(crate) dt: f64,
}

/// What flows during a step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Flow {
    /// Current at the end.
    pub(crate) end: Dq,
    /// Current in the middle.
    pub(crate) mean: Dq,
    /// Current in A that the bridge draws from the bus.
    pub(crate) drawn: f64,
    /// Heat of the windings in W.
    pub(crate) winding_loss: f64,
    /// Heat of the semiconductors in W.
    pub(crate) inverter_loss: f64,
}

/// The direction of a phase's current.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Direction {
    OutOfMotor,
    AroundZero,
    IntoMotor,
}

impl Direction {
    pub(crate) fn of(current: f64, knee: f64) -> Self {
        if current > knee {
            Self::IntoMotor
        } else if current < -knee {
            Self::OutOfMotor
        } else {
            Self::AroundZero
        }
    }

    /// The next direction to try. Between opposite ones lies zero, where a diode stops the current: to leap over it would find it never.
    pub(crate) fn towards(self, found: Self) -> Self {
        match (self, found) {
            (Self::IntoMotor, Self::OutOfMotor) | (Self::OutOfMotor, Self::IntoMotor) => Self::AroundZero,
            _ => found,
        }
    }
}

/// Phases' voltages, and the slopes with which a current after the step lowers its own, along the axes: resistors that are different in the
/// three phases.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Drive {
    voltages: [f64; 3],
    along_d: f64,
    across: f64,
    along_q: f64,
}

impl Drive {
    pub(crate) fn new() -> Self {
        Self { voltages: [0.0; 3], along_d: 0.0, across: 0.0, along_q: 0.0 }
    }

    /// A voltage in V of a phase.
    pub(crate) fn add_voltage(&mut self, phase: usize, voltage: f64) {
        self.voltages[phase] += voltage;
    }

    /// The slope of a phase: two thirds of what is in series with it, in ohm.
    pub(crate) fn add_slope(&mut self, phase: usize, frame: &Frame, slope: f64) {
        let (cosine, sine) = (frame.cosines[phase], frame.sines[phase]);
        self.along_d += slope * cosine * cosine;
        self.across -= slope * cosine * sine;
        self.along_q += slope * sine * sine;
    }
}

/// Inductance of an axis at a current.
#[derive(Clone, Copy, Debug)]
struct Inductance {
    /// Change of flux per change of current.
    differential: f64,
    /// Flux per current.
    apparent: f64,
}

impl Windings {
    pub(crate) fn check(&self) {
        assert!(self.pole_pairs > 0, "a motor has pole pairs");
        assert!(self.resistance >= 0.0, "the resistance must not be negative");
        assert!(self.inductance_d > 0.0 && self.inductance_q > 0.0, "inductances must be positive");
        assert!(self.saturation.is_none_or(|s| s.current > 0.0), "the current of saturation must be positive");
    }

    /// Resistance of a phase in ohm at a temperature in degrees Celsius.
    pub(crate) fn resistance_at(&self, temperature: f64) -> f64 {
        self.resistance * (1.0 + COPPER * (temperature - 20.0))
    }

    /// Torque in Nm.
    pub(crate) fn torque(&self, current: Dq) -> f64 {
        let flux = Dq {
            d: self.flux + self.inductance(self.inductance_d, current.d).apparent * current.d,
            q: self.inductance(self.inductance_q, current.q).apparent * current.q,
        };
        1.5 * f64::from(self.pole_pairs) * (flux.d * current.q - flux.q * current.d)
    }

    fn inductance(&self, unsaturated: f64, current: f64) -> Inductance {
        match self.saturation {
            None => Inductance { differential: unsaturated, apparent: unsaturated },
            Some(saturation) => {
                let ratio = current / saturation.current;
                let square = 1.0 + ratio * ratio;
                let apparent = unsaturated / square.sqrt();
                Inductance { differential: apparent / square, apparent }
            }
        }
    }

    /// The currents after a step.
    ///
    /// Resistance and rotation enter with the mean of the currents before and after (trapezoidal, keeps the energy), the direction of the
    /// current with the one after: a diode is too steep for anything else.
    pub(crate) fn step(&self, start: Dq, terminals: &[Terminal; 3], surroundings: &Surroundings) -> Flow {
        let frame = &surroundings.frame;
        let directions_of = |current: Dq| {
            let phases = frame.phases(current);
            core::array::from_fn(|k| Direction::of(phases[k], terminals[k].knee))
        };
        let mut directions: [Direction; 3] = directions_of(start);
        let mut end = start;
        for attempt in 1..=ATTEMPTS {
            let drive = drive(terminals, directions, surroundings);
            end = self.solve(start, start.mean(end), surroundings, &drive);
            let found = directions_of(end);
            let next = core::array::from_fn(|k| directions[k].towards(found[k]));
            if next == directions && attempt >= self.least_attempts() {
                break;
            }
            directions = next;
        }
        self.flow(start, end, terminals, surroundings)
    }

    /// The inductances in the middle of the step are known when its end is.
    pub(crate) fn least_attempts(&self) -> usize {
        if self.saturation.is_some() { 2 } else { 1 }
    }

    /// The currents after a step, with the inductances at a current: two linear equations.
    #[inline(always)]
    pub(crate) fn solve(&self, start: Dq, middle: Dq, surroundings: &Surroundings, drive: &Drive) -> Dq {
        let Surroundings { resistance, speed, emf, frame, dt, .. } = surroundings;
        let voltage = frame.dq(drive.voltages);
        let (d, q) = (self.inductance(self.inductance_d, middle.d), self.inductance(self.inductance_q, middle.q));
        let (change_d, change_q) = (d.differential / dt, q.differential / dt);
        let half = 0.5 * resistance;
        let (turn_d, turn_q) = (0.5 * speed * d.apparent, 0.5 * speed * q.apparent);

        let right_d = voltage.d + (change_d - half) * start.d + turn_q * start.q - emf.d;
        let right_q = voltage.q + (change_q - half) * start.q - turn_d * start.d - emf.q;
        let (dd, dq) = (change_d + half + drive.along_d, drive.across - turn_q);
        let (qd, qq) = (drive.across + turn_d, change_q + half + drive.along_q);
        let scale = 1.0 / (dd * qq - dq * qd);
        Dq { d: (right_d * qq - dq * right_q) * scale, q: (dd * right_q - right_d * qd) * scale }
    }

    fn flow(&self, start: Dq, end: Dq, terminals: &[Terminal; 3], surroundings: &Surroundings) -> Flow {
        let Surroundings { resistance, frame, .. } = surroundings;
        let mean = start.mean(end);
        let (after, during) = (frame.phases(end), frame.phases(mean));
        let (mut drawn, mut inverter_loss) = (0.0, 0.0);
        for (k, terminal) in terminals.iter().enumerate() {
            let level = (after[k] / terminal.knee).clamp(-1.0, 1.0);
            drawn += (terminal.share - terminal.deviation * level) * during[k];
            inverter_loss += terminal.drop * level * during[k];
        }
        Flow { end, mean, drawn, winding_loss: 1.5 * resistance * mean.square(), inverter_loss }
    }
}

/// What drives currents of these directions.
fn drive(terminals: &[Terminal; 3], directions: [Direction; 3], surroundings: &Surroundings) -> Drive {
    let Surroundings { frame, bus, .. } = surroundings;
    let mut drive = Drive::new();
    for (k, terminal) in terminals.iter().enumerate() {
        let swing = terminal.deviation * bus + terminal.drop;
        drive.voltages[k] = terminal.share * bus;
        match directions[k] {
            Direction::IntoMotor => drive.voltages[k] -= swing,
            Direction::OutOfMotor => drive.voltages[k] += swing,
            Direction::AroundZero => drive.add_slope(k, frame, 2.0 / 3.0 * swing / terminal.knee),
        }
    }
    drive
}
