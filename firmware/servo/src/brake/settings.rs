//! Parameters of the holding brake and their form for the sequence.

use crate::error::{SettingsError, in_range};
use crate::monitor::debounce::ticks_of;
use crate::units::{CurrentFraction, Position};

/// Parameters of the holding brake. Times are in milliseconds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BrakeParameters {
    /// The motor has a holding brake. Without one only the bridge has to answer.
    pub fitted: bool,
    /// The brake has a contact that tells whether it is open.
    pub contact_fitted: bool,
    /// Drive-on delay S-0-0206: the brake is open so long after it is energised.
    pub drive_on_delay: u16,
    /// Drive-off delay S-0-0207: the brake holds so long after it is de-energised.
    pub drive_off_delay: u16,
    /// Maximum drive-off delay S-0-0273: an axis that does not come to a standstill is braked after it all the same; 0 waits for ever.
    pub maximum_drive_off_delay: u16,
    /// Test current in the field axis, above zero.
    pub proof_current: CurrentFraction,
    /// Largest difference of commanded and measured current, below the test current: a dead amplifier must not pass.
    pub proof_tolerance: CurrentFraction,
    /// Time for which the current must follow, 1 ..= 1000.
    pub proof_time: u16,
    /// Time after which the torque must have been proven, above `proof_time`.
    pub proof_limit: u16,
    /// Time in which the torque is lowered, and for which the axis is then watched without torque, 1 ..= 10 000.
    pub hold_test_time: u16,
    /// Movement beyond which a brake does not hold, and up to which an axis has not moved, above zero.
    pub hold_window: Position,
    /// Time for which an axis under high torque must stand still in its first motion before the brake counts as stuck, from 1.
    pub stuck_time: u16,
}

/// The holding brake, scaled to ticks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct BrakeSettings {
    pub(crate) fitted: bool,
    pub(crate) contact_fitted: bool,
    pub(crate) on_delay: u32,
    pub(crate) on_limit: u32,
    pub(crate) off_delay: u32,
    pub(crate) off_limit: u32,
    /// `None` waits for ever.
    pub(crate) standstill_limit: Option<u32>,
    pub(crate) proof_current: i16,
    pub(crate) proof_tolerance: i32,
    pub(crate) proof_ticks: u32,
    pub(crate) proof_limit: u32,
    /// Scale of the torque (2^-31) taken away in a tick.
    pub(crate) ramp: u32,
    pub(crate) watch_ticks: u32,
    pub(crate) hold_window: Position,
    pub(crate) stuck_ticks: u32,
}

/// A contact has at least this time in ms before its silence is an error, whatever the delay.
const SHORTEST_CONTACT_LIMIT: u32 = 20;
/// The whole torque in 2^-31.
pub(crate) const WHOLE: u32 = 1 << 31;

impl BrakeSettings {
    /// Scales the parameters. Divides.
    ///
    /// # Errors
    /// [`SettingsError::OutOfRange`] or [`SettingsError::Zero`] for a parameter beyond its range.
    pub fn new(parameters: &BrakeParameters) -> Result<Self, SettingsError> {
        let proof_current = parameters.proof_current.to_bits();
        let largest = i16::MAX.unsigned_abs().into();
        let current = in_range("test current", proof_current.max(0).unsigned_abs().into(), 1, largest)?;
        let tolerance = parameters.proof_tolerance.to_bits().max(0).unsigned_abs();
        in_range("tolerance of the test current", tolerance.into(), 0, current.saturating_sub(1))?;
        let proof_time = in_range("time of the torque proof", parameters.proof_time.into(), 1, 1_000)?;
        let proof_limit = u32::from(parameters.proof_limit);
        in_range("time limit of the torque proof", proof_limit, proof_time.saturating_add(1), u16::MAX.into())?;
        let hold_test = in_range("time of the holding test", parameters.hold_test_time.into(), 1, 10_000)?;
        in_range("time to a stuck brake", parameters.stuck_time.into(), 1, u16::MAX.into())?;
        if parameters.hold_window <= Position::ZERO {
            return Err(SettingsError::Zero { parameter: "movement window of the holding test" });
        }
        let on_delay = ticks_of(parameters.drive_on_delay.into());
        let off_delay = ticks_of(parameters.drive_off_delay.into());
        let shortest = ticks_of(SHORTEST_CONTACT_LIMIT);
        let watch_ticks = ticks_of(hold_test);
        Ok(Self {
            fitted: parameters.fitted,
            contact_fitted: parameters.fitted && parameters.contact_fitted,
            on_delay,
            on_limit: on_delay.saturating_mul(2).max(shortest),
            off_delay,
            off_limit: off_delay.saturating_mul(2).max(shortest),
            standstill_limit: match parameters.maximum_drive_off_delay {
                0 => None,
                limit => Some(ticks_of(limit.into())),
            },
            proof_current,
            proof_tolerance: tolerance.into(),
            proof_ticks: ticks_of(proof_time),
            proof_limit: ticks_of(proof_limit),
            ramp: WHOLE.div_ceil(watch_ticks.max(1)),
            watch_ticks,
            hold_window: parameters.hold_window,
            stuck_ticks: ticks_of(parameters.stuck_time.into()),
        })
    }
}
