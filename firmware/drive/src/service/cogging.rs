//! The table against the cogging P-0-0252, from what P-0-0250 has summed up.

use rtic_core::Mutex;
use sercon816::Bus;
use sercos::parameters::Parameters;
use servo::axis::COGGING_POINTS;
use servo::identification::{CoggingMeasurement, CoggingTable};

use super::commissioning::Finding;
use super::hand_over;
use crate::hardware::Hardware;
use crate::motion::Motion;
use crate::motion::cogging::PART;
use crate::settings::cogging::{COGGING_TABLE, scale};

/// Empties the record, by parts: the tasks of the cycle wait for none longer than for a parameter.
pub(super) fn prepare<B: Bus + Clone, H: Hardware>(motion: &mut impl Mutex<T = Motion<B, H>>) {
    for from in (0..COGGING_POINTS).step_by(PART) {
        motion.lock(|motion| motion.clear_bins(from));
    }
}

/// Puts the table together and into effect. 2 ms; divides.
///
/// # Errors
/// [`Finding`]; nothing is changed then.
#[cold]
#[inline(never)]
pub(super) fn take_over<B: Bus + Clone, H: Hardware>(
    measurement: &CoggingMeasurement,
    parameters: &mut Parameters,
    motion: &mut impl Mutex<T = Motion<B, H>>,
) -> Result<(), Finding> {
    let scale = scale(parameters).map_err(|invalid| Finding::Refused(invalid.idn))?;
    let mut table = CoggingTable::new();
    for from in (0..COGGING_POINTS).step_by(PART) {
        motion.lock(|motion| motion.bins(from)).into_iter().for_each(|bin| table.take(bin));
    }
    let points = table.finish(measurement, &scale)?.map(i16::cast_unsigned);
    parameters.set_table(COGGING_TABLE, &points).map_err(|_| Finding::Refused(COGGING_TABLE))?;
    hand_over::cogging(motion, parameters);
    Ok(())
}
