//! What a fault is put into.

use bench::motor_side::SharedMotorSide;
use plant::BrakeFailure;
use ring::Nanoseconds;
use ring::fibre::{Effect, Fault as RingFault, TelegramKind};

use crate::{MatrixError, Mode};

/// A drive with its machine on a ring of its own, running.
pub trait Target {
    /// Simulated time.
    fn now(&self) -> Nanoseconds;

    /// Machine and board.
    fn motor_side(&self) -> &SharedMotorSide;

    /// What the drive follows.
    fn mode(&self) -> Mode;

    /// The control unit gives ON, ENABLE and no HALT, or nothing.
    fn hold_switches(&mut self, on: bool);

    /// The control unit takes bit 15 of the control word back, in one cycle with what happens now.
    fn take_bit_15_away(&mut self);

    /// The first cycle that can still be disturbed.
    fn next_cycles(&self) -> u64;

    /// One more thing that will go wrong on the fibre.
    fn add_ring_fault(&mut self, fault: RingFault);

    /// Lets everything happen until this cycle has begun.
    ///
    /// # Errors
    /// The simulation can not go on.
    fn run_to_cycle(&mut self, cycle: u64) -> Result<(), MatrixError>;

    /// Something happens to the machine now.
    fn machine(&self, change: impl FnOnce(&mut plant::Machine, u64)) {
        let now = self.now().0;
        change(self.motor_side().borrow_mut().machine(), now);
    }

    /// Breaks or repairs the brake.
    fn break_brake(&self, failure: Option<BrakeFailure>) {
        self.machine(|machine, now| machine.fail_brake(failure, now));
    }

    /// So many of the next cycles of the current loop come too late.
    ///
    /// # Errors
    /// The processor can not go on.
    fn delay_cycles(&self, cycles: u32) -> Result<(), MatrixError> {
        self.motor_side().borrow_mut().delay_cycles(cycles);
        Ok(())
    }

    /// These telegrams are changed in so many of the next cycles. Returns when the first of them begins.
    ///
    /// # Errors
    /// As [`Target::run_to_cycle`].
    fn disturb(&mut self, kind: TelegramKind, cycles: u64, effect: Effect) -> Result<(), MatrixError> {
        let from = self.next_cycles();
        for cycle in from..from + cycles {
            self.add_ring_fault(RingFault::once(cycle, 0, kind, effect));
        }
        self.run_to_cycle(from)
    }

    /// Every second of the next so many MSTs comes late.
    ///
    /// # Errors
    /// As [`Target::run_to_cycle`].
    fn jitter(&mut self, cycles: u64, delay: Nanoseconds) -> Result<(), MatrixError> {
        let from = self.next_cycles();
        for cycle in (from..from + cycles).step_by(2) {
            self.add_ring_fault(RingFault::once(cycle, 0, TelegramKind::Mst, Effect::Delay(delay)));
        }
        self.run_to_cycle(from)
    }

    /// The fibre is dark for so many cycles.
    ///
    /// # Errors
    /// As [`Target::run_to_cycle`].
    fn darken(&mut self, cycles: u64) -> Result<(), MatrixError> {
        let from = self.next_cycles();
        self.add_ring_fault(RingFault::ring_break(from..from + cycles, 0));
        self.run_to_cycle(from)
    }
}
