//! Where the loops begin to follow position commands, and what becomes of a command that jumps.
//!
//! Following begins wherever the axis comes into [`servo::axis::Mode::Position`]: switched on, at the end of HALT, of homing, of an identification
//! or of a positioning, with another mode of operation, or when bit 15 comes back during a stop. There the interpolator starts at the shaft,
//! and the first command must lie within S-0-0159 of it; each later one within a step of the one before. A command that does not is never
//! taken: it is an error before anything moves towards it.

use sercon816::Bus;
use sercos::diagnostic::Class1;
use servo::path::CommandJump;

use super::Motion;
use crate::diagnosis::Manufacturer1;
use crate::hardware::Hardware;
use crate::operation_mode::OperationMode;

impl<B: Bus + Clone, H: Hardware> Motion<B, H> {
    /// A drive that is to be switched on far from its command stays off: neither the torque nor the brake has to come for it.
    ///
    /// A drive that stays off anyway is not asked: commands may run away from it, and after an error they do.
    #[cold]
    pub(super) fn look_before_switching_on(&mut self) {
        // A movement of the drive's own begins where the axis stands.
        let positioned =
            matches!(self.mode, None | Some(OperationMode::PositionWithLag | OperationMode::PositionWithoutLag));
        if !positioned {
            return;
        }
        if let Err(jump) = self.axis.would_follow(self.commanded_position()) {
            self.blame(jump);
        }
    }

    /// Stops the axis, from as fast as it is, in place of taking a command.
    #[cold]
    pub(super) fn refuse(&mut self, jump: CommandJump) {
        self.blame(jump);
        self.update_state();
    }

    fn blame(&mut self, jump: CommandJump) {
        match jump {
            CommandJump::FarFromAxis { .. } => self.class_1 |= Class1::EXCESSIVE_DEVIATION,
            CommandJump::Step { .. } => {
                self.class_1 |= Class1::MANUFACTURER;
                self.manufacturer_1 |= Manufacturer1::COMMAND_JUMP;
            }
        }
    }
}
