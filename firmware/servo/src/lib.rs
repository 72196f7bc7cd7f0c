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
//! [`Axis`](axis::Axis) joins the chain; the parts can be used alone. The crate knows no bus and no hardware. It is `no_std`,
//! allocates nothing and has no `unsafe`. The package is `servo-axis`, the library `servo`.
//!
//! The chain, in the order of its parts:
//!
//! * [`path`]: where the axis shall be at each tick, between the commands of the control or on movements of the drive's own.
//! * [`axis`]: position and velocity loop, torque limits, friction and filter, and [the gains](axis::velocity_gains) from the data of a motor.
//! * [`current`]: the current loop.
//! * [`encoder`] and [`commutation`]: from increments to the position, and to the electrical angle of the rotor.
//! * [`motor`]: all of it below the velocity loop, as it is flashed: the task of the current loop, the orders it gets, and what stands guard.
//! * [`clock`]: the loops in step with the ring.
//!
//! Beside the chain, ticked like it:
//!
//! * [`brake`]: the order of holding brake and torque.
//! * [`monitor`] and [`encoder::EncoderMonitor`]: supervision, each part with warnings and errors of its own.
//! * [`identification`]: resistance, inductances, flux and inertia of the motor, measured with its own currents.
//! * [`homing`], [`probe`]: the zero of the axis, and positions at an edge.
//! * [`scope`]: an oscilloscope.
//!
//! All of it stands on [`units`], what a position or a velocity is, and on [`arithmetic`].
//!
//! What holds for all of it:
//!
//! * All arithmetic is integer: the same input gives the same output, bit for bit, on the host and on the target.
//! * What a tick calls contains no division, no float, no panic and no loop whose length depends on data. Divisions happen in
//!   constructors of settings ([`AxisSettings::new`](axis::AxisSettings::new), ...), called when a parameter changes.
//! * Settings and state are separate types, so that settings can be prepared in a background task and handed over in one move.
//!
//! # Example
//!
//! Gains from the data of a motor, for a velocity loop of 50 Hz on 0.001 kg m² with 0.5 Nm/A:
//!
//! ```
//! use servo::SettingsError;
//! use servo::axis::{position_gain, velocity_gains};
//!
//! let gains = velocity_gains(10_000, 500_000, 50, 400)?; // small times of 400 us
//! assert_eq!((gains.proportional, gains.integral_time), (628, 127)); // mA s/rad, 0.1 ms
//! assert_eq!(position_gain(50)?, 471); // 0.01 * 1000/min
//! assert!(matches!(velocity_gains(0, 500_000, 50, 400), Err(SettingsError::Zero { .. })));
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

pub mod arithmetic;
pub mod axis;
pub mod brake;
pub mod clock;
pub mod commutation;
pub mod current;
pub mod encoder;
mod error;
pub mod homing;
pub mod identification;
pub mod monitor;
pub mod motor;
pub mod path;
pub mod probe;
pub mod scope;
pub mod units;

pub use error::SettingsError;
