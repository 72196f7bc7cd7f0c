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
//! [`Axis`] joins the chain; the parts can be used alone. The crate knows no bus and no hardware.
//!
//! * All arithmetic is integer: the same input gives the same output, bit for bit, on the host and on the target.
//! * What a tick calls contains no division, no float, no panic and no loop whose length depends on data.
//!   Divisions happen in constructors of settings ([`AxisSettings::new`], [`EncoderSettings::new`], ...), called when a parameter changes.
//! * Settings and state are separate types, so that settings can be prepared in a background task and handed over in one move.
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

mod axis;
mod clock;
mod encoder;
mod gain;
mod interpolation;
mod modulo;
mod position_loop;
mod ramp;
mod scaling;
mod scope;
mod settings;
mod units;
mod velocity_estimate;
mod velocity_loop;

pub use axis::{Axis, AxisOutput, Mode};
pub use clock::{LoopClock, LoopClockSettings};
pub use encoder::{Encoder, EncoderSettings};
pub use gain::Gain;
pub use interpolation::{CommandSource, Interpolator, InterpolatorSettings, Setpoint, VelocityInterpolator};
pub use modulo::{Modulo, ModuloCounter};
pub use position_loop::{PositionLoop, PositionLoopOutput, PositionLoopSettings};
pub use ramp::Ramp;
pub use scaling::{PositionScale, VelocityScale};
pub use scope::{
    SCOPE_CHANNELS, SCOPE_POINTS, Scope, ScopeEdge, ScopeSettings, ScopeSettingsError, ScopeState, ScopeTrigger,
};
pub use settings::{AxisParameters, AxisSettings, SettingsError};
pub use units::{Acceleration, CurrentFraction, LOOP_PERIOD_MICROSECONDS, LOOP_TICKS_PER_SECOND, Position, Velocity};
pub use velocity_estimate::{VelocityEstimate, VelocityFilter};
pub use velocity_loop::{VelocityLoop, VelocityLoopOutput, VelocityLoopSettings};
