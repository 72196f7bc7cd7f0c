//! New settings on their way to the hot tasks while the ring is in operation.
//!
//! All of them at once are 2.4 KB, and the tasks of the cycle would wait for 40 us: the AT would show the feedback of the cycle before, and an
//! order to the current loop would come late. So each part goes by itself. A loop tick may fall between two of them: what belongs to the
//! parameter that was written acts a tick earlier in the one than in the other. Everything else is the same before and after. The longest part is
//! counted by `cargo xtask budget`.

use rtic_core::{Exclusive, Mutex};
use sercon816::Bus;
use sercos::parameters::Parameters;
use servo::axis::COGGING_POINTS;

use crate::hardware::Hardware;
use crate::motion::Motion;
use crate::motion::cogging::PART;
use crate::settings::DriveSettings;
use crate::settings::cogging::{COGGING_TABLE, scale};

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

/// The table P-0-0252, which [`DriveSettings::new`] has looked at. It is filled beside the one that acts, and then exchanged with it.
pub(crate) fn cogging<B: Bus + Clone, H: Hardware>(motion: &mut impl Mutex<T = Motion<B, H>>, parameters: &Parameters) {
    let (table, scale) = (parameters.table(COGGING_TABLE), scale(parameters));
    let Ok(scale) = scale else { return };
    for (number, part) in table.chunks(PART).enumerate() {
        let mut points = [0; PART];
        for (point, milliamperes) in points.iter_mut().zip(part) {
            *point = scale.point(milliamperes.cast_signed());
        }
        motion.lock(|motion| motion.cogging().fill(number.saturating_mul(PART), &points));
    }
    motion.lock(|motion| motion.cogging().exchange(table.len() == COGGING_POINTS));
}

/// The same before there are tasks to lock; a table that the loops cannot work with waits for S-0-0128.
pub(crate) fn cogging_at_start<B: Bus + Clone, H: Hardware>(motion: &mut Motion<B, H>, parameters: &Parameters) {
    if super::loops::accept::<H>(parameters).is_ok() {
        cogging(&mut Exclusive(motion), parameters);
    }
}
