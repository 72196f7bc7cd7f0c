//! New settings on their way to the hot tasks while the ring is in operation.
//!
//! All of them at once are 2.4 KB, and the tasks of the cycle would wait for 40 us: the AT would show the feedback of the cycle before, and an
//! order to the current loop would come late. So each part goes by itself. A loop tick may fall between two of them: what belongs to the
//! parameter that was written acts a tick earlier in the one than in the other. Everything else is the same before and after. The longest part is
//! counted by `cargo xtask budget`.

use rtic_core::Mutex;
use sercon816::Bus;

use crate::hardware::Hardware;
use crate::motion::Motion;
use crate::settings::DriveSettings;

/// Hands them over.
pub(crate) fn by_parts<B: Bus + Clone, H: Hardware>(
    motion: &mut impl Mutex<T = Motion<B, H>>,
    settings: &DriveSettings,
) {
    motion.lock(|motion| motion.apply_motor_settings(settings));
    motion.lock(|motion| motion.take_axis_settings(settings, false));
    motion.lock(|motion| motion.take_axis_settings(settings, true));
    motion.lock(Motion::put_axis_settings_in_force);
    motion.lock(|motion| motion.apply_motion_settings(&settings.motion));
}
