//! Where the axis shall be at each loop tick: between the commands of the control, or on movements of the drive's own.

pub(crate) mod command_step;
pub(crate) mod cubic;
pub(crate) mod interpolation;
pub(crate) mod limits;
pub(crate) mod ramp;
pub(crate) mod setpoint;
pub(crate) mod settings;
pub(crate) mod stopping;
pub(crate) mod trajectory;
pub(crate) mod velocity_interpolation;

pub use command_step::{CommandJump, CommandLimits};
pub use interpolation::Interpolator;
pub use limits::{FeedrateOverride, MotionLimits};
pub use ramp::Ramp;
pub use setpoint::{CommandSource, Setpoint};
pub use settings::{Interpolation, InterpolatorSettings};
pub use trajectory::Trajectory;
pub use velocity_interpolation::VelocityInterpolator;
