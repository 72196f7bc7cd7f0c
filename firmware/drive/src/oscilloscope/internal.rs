//! Signals that have no IDN, because no telegram carries them: the values of the loops in every tick.
//!
//! Their numbers, F000H and up, would be product-specific data blocks of parameter set 7, which the drive does not have.

use servo::axis::AxisOutput;
use servo::motor::CurrentLoopValues;
use servo::units::{CurrentFraction, Position};

/// What the position and velocity loops had in their last tick (125 us).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LoopValues {
    /// Measured position.
    pub position: Position,
    /// What came out of the loops.
    pub output: AxisOutput,
}

/// A row of the table of internal signals.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct InternalSignal {
    /// What P-0-0201 to P-0-0204 call it.
    pub signal: Internal,
    /// For the reader.
    pub name: &'static str,
    /// The value in this unit is the recorded number times 2^-`shift`.
    pub unit: &'static str,
    /// See `unit`.
    pub shift: u8,
}

macro_rules! internal_signals {
    ($($(#[doc = $documentation:literal])+ $name:ident = $number:literal $text:literal [$unit:literal] $shift:literal;)+) => {
        /// A signal without IDN; its number is its discriminant.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        #[cfg_attr(feature = "defmt", derive(defmt::Format))]
        #[repr(u16)]
        pub enum Internal {
            $($(#[doc = $documentation])+ $name = $number,)+
        }

        /// All internal signals, in ascending order of their number.
        pub static INTERNAL_SIGNALS: &[InternalSignal] = &[
            $(InternalSignal { signal: Internal::$name, name: $text, unit: $unit, shift: $shift },)+
        ];
    };
}

internal_signals! {
    /// Measured position; wraps after 256 revolutions.
    PositionFeedback = 0xF000 "position feedback" ["rev"] 24;
    /// Setpoint of the position loop, the measured position where there is none; wraps after 256 revolutions.
    PositionCommand = 0xF001 "position setpoint" ["rev"] 24;
    /// Setpoint minus measured position, limited to 128 revolutions.
    FollowingError = 0xF002 "following error" ["rev"] 24;
    /// Measured velocity, filtered with 2 ms, in revolutions per loop tick of 125 us.
    VelocityFeedback = 0xF003 "velocity feedback" ["rev/tick"] 36;
    /// Setpoint of the velocity loop.
    VelocityCommand = 0xF004 "velocity setpoint" ["rev/tick"] 36;
    /// Setpoint minus measured velocity.
    VelocityError = 0xF005 "velocity error" ["rev/tick"] 36;
    /// Torque-producing current, commanded; 1 is the peak current S-0-0110.
    CurrentCommand = 0xF006 "torque-producing current setpoint" ["of S-0-0110"] 15;
    /// Torque-producing current, measured.
    QuadratureCurrent = 0xF010 "torque-producing current" ["of S-0-0110"] 15;
    /// Flux-producing current, commanded.
    DirectCurrentCommand = 0xF011 "flux-producing current setpoint" ["of S-0-0110"] 15;
    /// Flux-producing current, measured.
    DirectCurrent = 0xF012 "flux-producing current" ["of S-0-0110"] 15;
    /// Current into phase U.
    PhaseCurrentU = 0xF013 "phase current U" ["of S-0-0110"] 15;
    /// Current into phase V.
    PhaseCurrentV = 0xF014 "phase current V" ["of S-0-0110"] 15;
    /// Current into phase W.
    PhaseCurrentW = 0xF015 "phase current W" ["of S-0-0110"] 15;
    /// Voltage command in the direction of the torque-producing current.
    QuadratureVoltage = 0xF016 "torque-producing voltage" ["V"] 14;
    /// Voltage command in the direction of the flux.
    DirectVoltage = 0xF017 "flux-producing voltage" ["V"] 14;
    /// Electrical angle that the current loop works with, 0 up to one turn; that of the rotor once the commutation angle is known.
    ElectricalAngle = 0xF018 "electrical angle" ["turn"] 16;
    /// Bus voltage.
    BusVoltage = 0xF019 "bus voltage" ["mV"] 0;
}

impl Internal {
    /// The signal of a number; `None` for a number that is none.
    #[must_use]
    pub fn from_number(number: u16) -> Option<Self> {
        INTERNAL_SIGNALS.iter().map(|row| row.signal).find(|signal| signal.number() == number)
    }

    /// What P-0-0201 to P-0-0204 call it.
    #[must_use]
    pub const fn number(self) -> u16 {
        self as u16
    }

    /// Its value, in the unit of the table.
    #[inline]
    #[must_use]
    pub fn value(self, loops: &LoopValues, current_loop: &CurrentLoopValues) -> i32 {
        let output = &loops.output;
        let [phase_u, phase_v, phase_w] = current_loop.phases;
        let fraction = |current: CurrentFraction| i32::from(current.to_bits());
        match self {
            Self::PositionFeedback => wrapped(loops.position),
            Self::PositionCommand => wrapped(output.position_command),
            Self::FollowingError => limited(output.following_error),
            Self::VelocityFeedback => output.velocity.to_bits(),
            Self::VelocityCommand => output.velocity_command.to_bits(),
            Self::VelocityError => (output.velocity_command - output.velocity).to_bits(),
            Self::CurrentCommand => fraction(output.current),
            Self::QuadratureCurrent => fraction(current_loop.quadrature),
            Self::DirectCurrentCommand => fraction(current_loop.direct_command),
            Self::DirectCurrent => fraction(current_loop.direct),
            Self::PhaseCurrentU => fraction(phase_u),
            Self::PhaseCurrentV => fraction(phase_v),
            Self::PhaseCurrentW => fraction(phase_w),
            Self::QuadratureVoltage => current_loop.quadrature_voltage,
            Self::DirectVoltage => current_loop.direct_voltage,
            Self::ElectricalAngle => current_loop.angle.into(),
            Self::BusVoltage => current_loop.bus_voltage,
        }
    }
}

/// From 2^-32 to 2^-24 revolution.
const POSITION_SHIFT: u32 = 8;

/// The low 32 bits: the numbers go round as the position goes on.
#[inline]
const fn wrapped(position: Position) -> i32 {
    (position.to_bits() >> POSITION_SHIFT) as i32
}

/// A difference must not go round: a large one would look small.
#[inline]
fn limited(difference: Position) -> i32 {
    (difference.to_bits() >> POSITION_SHIFT).clamp(i32::MIN.into(), i32::MAX.into()) as i32
}
