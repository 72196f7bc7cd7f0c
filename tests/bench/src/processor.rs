//! A processor beside a chip, as the world sees it: the portable tasks on this computer, or the flashed ELF in QEMU.

use laws::Broken;
use ring::Nanoseconds;

/// Something that runs the drive's tasks.
pub trait Processor {
    /// The next instant at which this processor does something by itself (a timer tick, a pending task, an access that it
    /// waits for). `None`: only an interrupt pin can wake it.
    fn next_event(&self) -> Option<Nanoseconds>;

    /// Lets it do everything that is due at `now`: interrupt edges since the last call, timers, pending tasks.
    ///
    /// Nothing reaches its chip before `horizon()`, so it may compute ahead up to there, but not beyond. The horizon is worked
    /// out when it is asked for.
    ///
    /// # Errors
    /// The processor can not go on; the text says why.
    fn run(&mut self, now: Nanoseconds, horizon: &dyn Fn() -> Nanoseconds) -> Result<(), ProcessorError>;
}

/// A processor that can not go on, or must not.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ProcessorError {
    /// It can not.
    #[error("drive {address}: {cause}")]
    Stuck {
        /// Address of the drive.
        address: u8,
        /// What happened and what to do about it.
        cause: String,
    },
    /// The drive has broken a law of the axis.
    #[error(transparent)]
    Unlawful(#[from] Broken),
}
