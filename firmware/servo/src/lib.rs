//! Motion control of one servo axis in fixed point.
//!
//! From a command value per control unit cycle to a torque-producing current per loop tick:
//!
//! ```text
//! S-0-0047 -> Interpolator -> PositionLoop -+-> VelocityLoop -> CurrentFraction
//! S-0-0036 -> VelocityInterpolator ---------+        ^
//! encoder count -> Encoder -> Position -> VelocityEstimate
//! t3 event -> LoopClock -> trim of the loop timer
//! ```
//!
//! [`Axis`] joins the chain; the parts can be used alone. The crate knows no bus and no hardware. It is `no_std`, allocates nothing and has no
//! `unsafe`. The package is `servo-axis`, the library `servo`.
//!
//! Beside the chain, ticked like it:
//!
//! * [`BrakeSequencer`]: the order of holding brake and torque.
//! * [`LoadModel`], [`Temperature`], [`BusVoltage`], [`EncoderMonitor`]: supervision, each with warnings and errors of its own.
//! * [`identification`]: resistance, inductances, flux and inertia of the motor, measured with its own currents.
//! * [`TorqueLimitSettings`]: what the torque is limited to, and [`Limiting`]: what limits the drive at the moment.
//! * [`FrictionSettings`] and [`CurrentFilter`]: what is added to the current command, and what is taken out of it.
//! * [`current_gains`], [`velocity_gains`], [`position_gain`]: gains from the data of a motor, outside the loops.
//!
//! What holds for all of it:
//!
//! * All arithmetic is integer: the same input gives the same output, bit for bit, on the host and on the target.
//! * What a tick calls contains no division, no float, no panic and no loop whose length depends on data.
//!   Divisions happen in constructors of settings ([`AxisSettings::new`], [`EncoderSettings::new`], ...), called when a parameter changes.
//! * Settings and state are separate types, so that settings can be prepared in a background task and handed over in one move.
//!
//! # Example
//!
//! Gains from the data of a motor, for a velocity loop of 50 Hz on 0.001 kg m² with 0.5 Nm/A:
//!
//! ```
//! use servo::{SettingsError, position_gain, velocity_gains};
//!
//! let gains = velocity_gains(10_000, 500_000, 50, 250)?;
//! assert_eq!((gains.proportional, gains.integral_time), (628, 127)); // mA s/rad, 0.1 ms
//! assert_eq!(position_gain(50)?, 471); // 0.01 * 1000/min
//! assert!(matches!(velocity_gains(0, 500_000, 50, 250), Err(SettingsError::Zero { .. })));
//! # Ok::<(), SettingsError>(())
//! ```
//!
//! `examples/position_loop.rs` lets an axis follow a master with them.
//!
//! # Licence
//!
//! MIT or Apache 2.0, at your choice.
#![no_std]
#![forbid(unsafe_code)]
#![cfg_attr(
    not(test),
    deny(
        clippy::unwrap_used,
        clippy::expect_used,
        clippy::indexing_slicing,
        clippy::arithmetic_side_effects,
        clippy::panic
    )
)]

mod acceleration_gain;
mod axis;
mod brake;
mod brake_error;
mod brake_settings;
mod clock;
mod command_step;
mod commutation;
mod cubic;
pub mod current;
mod debounce;
mod derivatives;
mod encoder;
mod encoder_monitor;
mod encoder_motion;
mod filter;
mod friction;
mod gain;
mod hidden_motion;
mod homing;
pub mod identification;
mod interpolation;
mod limited_gain;
mod limits;
mod load_model;
mod modulo;
mod motion_limits;
mod position_loop;
mod probe;
mod ramp;
mod scaling;
mod scope;
mod settings;
mod share;
mod stopping;
mod temperature;
mod trajectory;
mod travel_range;
mod trigonometry;
mod tuning;
mod twice_read;
mod units;
mod velocity_estimate;
mod velocity_interpolation;
mod velocity_loop;
mod voltage;
mod wide;

pub use axis::{Axis, AxisOutput, Mode, Travel};
pub use brake::{BrakeInputs, BrakeOutput, BrakeRequest, BrakeSequencer, TorqueScale};
pub use brake_error::BrakeError;
pub use brake_settings::{BrakeParameters, BrakeSettings};
pub use clock::{LoopClock, LoopClockSettings};
pub use command_step::{CommandJump, CommandLimits};
pub use commutation::{
    Alignment, AlignmentError, AlignmentOutput, AlignmentSettings, AlignmentState, CommutationAngle, CommutationError,
    CommutationSettings, IndexCorrection, IndexError, IndexOutput, IndexState,
};
pub use derivatives::{Jerk, SignedAcceleration};
pub use encoder::{Encoder, EncoderSettings};
pub use encoder_monitor::{
    EncoderError, EncoderMonitor, EncoderMonitorInputs, EncoderMonitorParameters, EncoderMonitorSettings,
};
pub use encoder_motion::EncoderMotion;
pub use filter::{CurrentFilter, CurrentFilterSettings, FilterSection};
pub use friction::{FrictionParameters, FrictionSettings};
pub use gain::Gain;
pub use homing::{
    Homing, HomingError, HomingInputs, HomingMotion, HomingOutput, HomingParameters, HomingSettings,
    HomingSettingsError, HomingState, Reference,
};
pub use interpolation::{CommandSource, Interpolation, Interpolator, InterpolatorSettings, Setpoint};
pub use limits::{
    CommandedTorqueLimits, Limiting, TorqueLimitParameters, TorqueLimitSettings, TorqueLimits, VelocityLimits,
};
pub use load_model::{LoadModel, LoadOutput, LoadParameters, LoadSettings};
pub use modulo::{Modulo, ModuloCounter};
pub use motion_limits::{FeedrateOverride, MotionLimits};
pub use position_loop::{PositionLoop, PositionLoopOutput, PositionLoopSettings};
pub use probe::{Edge, Probe, ProbeError, ProbeInput, ProbeInputs, ProbeSettings, ProbingCycle};
pub use ramp::Ramp;
pub use scaling::{PositionScale, VelocityScale};
pub use scope::{
    SCOPE_CHANNELS, SCOPE_POINTS, Scope, ScopeEdge, ScopeSettings, ScopeSettingsError, ScopeState, ScopeTrigger,
};
pub use settings::{AxisMovements, AxisParameters, AxisSettings, SettingsError};
pub use temperature::{Temperature, TemperatureError, TemperatureOutput, TemperatureParameters, TemperatureSettings};
pub use trajectory::Trajectory;
pub use travel_range::{Commanded, RangeEnd, RangeMonitor, TravelRange};
pub use trigonometry::Rotation;
pub use tuning::{CurrentGains, VelocityGains, current_gains, position_gain, velocity_gains};
pub use twice_read::{TwiceReadEncoder, TwiceReadSettings};
pub use units::{
    Acceleration, CurrentFraction, LOOP_PERIOD_MICROSECONDS, LOOP_TICKS_PER_SECOND, LOOP_TICKS_PER_SUPERVISION,
    Position, SUPERVISION_PERIOD_MICROSECONDS, Velocity,
};
pub use velocity_estimate::{FilteredVelocity, VelocityEstimate, VelocityFilter};
pub use velocity_interpolation::VelocityInterpolator;
pub use velocity_loop::{VelocityLoop, VelocityLoopOutput, VelocityLoopSettings};
pub use voltage::{
    BusVoltage, Duty, Reciprocal, VoltageError, VoltageOutput, VoltageParameters, VoltageSettings, Volts,
};
