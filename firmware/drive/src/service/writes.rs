//! What becomes of a write: why the drive refuses it, and how it comes into effect.

use rtic_core::Mutex;
use sercon816::Bus;
use sercos::data_block::{DataBlock, Location, NeededFor};
use sercos::error::ServiceError;
use sercos::parameters::Parameters;
use sercos::{Idn, Phase};
use servo::probe::ProbeSettings;

use super::context::Context;
use super::finding::Finding;
use super::procedures::{HOMING_PARAMETER, PROBE_CONTROL, REFERENCE_DISTANCE};
use super::{hand_over, loops, scope};
use crate::dictionary::access::Access;
use crate::dictionary::access_of;
use crate::dictionary::numbers::Number;
use crate::hardware::Hardware;
use crate::motion::Motion;
use crate::operation_mode::Direction;
use crate::oscilloscope;
use crate::signal::word::Word;

/// S-0-0393.
const COMMAND_VALUE_MODE: Idn = Idn::standard(393);

impl<B, H, M> Context<'_, B, M>
where
    B: Bus + Clone,
    H: Hardware,
    M: Mutex<T = Motion<B, H>>,
{
    /// A reason of the drive's own against writing this value (0 for lists and texts).
    pub(super) fn refusal(&mut self, block: &DataBlock, value: u64, parameters: &Parameters) -> Option<ServiceError> {
        let (idn, access) = (block.idn, access_of(block));
        if idn == oscilloscope::CONTROL && value == 1 {
            return scope::configuration(parameters).err();
        }
        if let Some(error) = scope::refuses_setting(idn, value, parameters) {
            return Some(error);
        }
        // What somebody else sets would not last: only what is there already is taken.
        if let Some((mask, wanted)) = controlled_bits(access, value) {
            let (bits, owned) = self.motion.lock(|motion| motion.controlled_bits());
            return ((bits ^ wanted) & mask & owned != 0).then_some(ServiceError::ProtectedBySettings);
        }
        if idn == COMMAND_VALUE_MODE && Direction::from_parameter(value as u16).is_none() {
            return Some(ServiceError::InvalidData);
        }
        // An angle that is taken over under torque would throw the motor to it.
        if access == Access::Number(Number::CommutationAngle) {
            let torque = self.motion.lock(|motion| motion.has_torque());
            return torque.then_some(ServiceError::ProtectedBySettings);
        }
        // The reference stands on these two until the command is cancelled.
        let belongs_to_homing = matches!(idn, HOMING_PARAMETER | REFERENCE_DISTANCE);
        let refused = belongs_to_homing && self.motion.lock(|motion| motion.is_homing());
        refused.then_some(ServiceError::ProtectedBySettings)
    }

    /// A data block was written: the loops work with it before it is acknowledged, or it is refused.
    ///
    /// # Errors
    /// The loops cannot work with the parameters as they are now.
    pub(super) fn take_effect(&mut self, block: &DataBlock, parameters: &mut Parameters) -> Result<(), ServiceError> {
        if block.idn == oscilloscope::CONTROL {
            match (parameters.get_word(block.idn), scope::configuration(parameters)) {
                (1, Ok(configuration)) => self.motion.lock(|motion| motion.oscilloscope().arm(configuration)),
                _ => self.motion.lock(|motion| motion.oscilloscope().stop()),
            }
        }
        if block.stored {
            self.note_stored(parameters);
        }
        if block.location != Location::Parameter || scope::is_own(block.idn) {
            // The loops know nothing of them.
            return Ok(());
        }
        let needed_for = block.needed_for;
        let checked = match self.phases.current() {
            Phase::Cp2 => needed_for == NeededFor::Cp3,
            Phase::Cp3 => needed_for == NeededFor::Cp4,
            _ => false,
        };
        if checked {
            self.phases.withdraw();
        }
        if !self.loops_work() {
            self.settings_changed = true;
        } else {
            // Up to 1.7 ms, which the step is held for: its answer depends on it, and what is acknowledged is in effect.
            let settings = match (loops::settings::<H>(parameters), self.first_invalid(parameters)) {
                (Ok(settings), None) => settings,
                (Err(setting), _) => {
                    self.checks.finding = Some(Finding::Write(setting));
                    return Err(ServiceError::InvalidData);
                }
                (_, Some(invalid)) => {
                    self.checks.finding = Some(Finding::WriteOf(invalid));
                    return Err(ServiceError::InvalidData);
                }
            };
            hand_over::by_parts(self.motion, &settings);
        }
        if block.idn == PROBE_CONTROL {
            // S-0-0170 has no end of its own after which it could be taken over.
            let edges = ProbeSettings::new(parameters.get_word(block.idn)).map_err(|_| ServiceError::InvalidData)?;
            self.motion.lock(|motion| motion.select_probe_edges(edges));
        }
        if self.checks.finding.is_some_and(|finding| finding.is_of_a_write()) {
            self.checks.finding = None;
        }
        Ok(())
    }
}

/// For a data block of single bits that the control sets: where they lie, and how `value` wants them.
fn controlled_bits(access: Access, value: u64) -> Option<(u32, u32)> {
    match access {
        Access::Word(Word::Application) => Some((0xFFFF, (value & 0xFFFF) as u32)),
        Access::Enable(enable) => Some((enable.mask(), if value & 1 != 0 { enable.mask() } else { 0 })),
        _ => None,
    }
}
