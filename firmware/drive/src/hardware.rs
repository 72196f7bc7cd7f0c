//! What the drive needs of the board: the position measurement, the torque output, the power stage, the loop timer.

use fixed::types::I1F15;

/// The motor side of a board, as the hot tasks see it.
///
/// Every call is one or two register accesses; none may wait.
pub trait Hardware {
    /// The encoder counter now, in increments (four per line), wrapping at 2^32.
    fn encoder_count(&mut self) -> u32;

    /// The encoder counter as the hardware latched it at the last interrupt edge of the ring controller
    /// on the given line: the feedback value of t4 without software jitter.
    fn encoder_latch(&mut self, line: InterruptLine) -> u32;

    /// The torque-producing current command, as a fraction of the amplifier's peak current (S-0-0110);
    /// positive accelerates in counting direction of the encoder.
    ///
    /// This is the seam of the current loop: today an analogue command to a current-controlled amplifier.
    fn set_current(&mut self, fraction_of_peak: I1F15);

    /// Switches the amplifier on or off. Off means torque-free at once.
    fn set_amplifier(&mut self, on: bool);

    /// Reads the amplifier's status lines.
    fn amplifier(&mut self) -> Amplifier;

    /// Time since the last tick of the loop timer, in counts of its clock (see [`Hardware::LOOP_TIMER_COUNTS`]).
    fn loop_timer_phase(&mut self) -> u16;

    /// Lengthens (positive) or shortens the following loop periods by so many counts, until changed again.
    fn trim_loop_timer(&mut self, counts: i16);

    /// Why the processor was started; read once at start.
    fn reset_cause(&self) -> ResetCause;

    /// Counts of the loop timer's clock in one untrimmed loop period of [`LOOP_PERIOD_MICROSECONDS`].
    const LOOP_TIMER_COUNTS: u16;
}

/// Period of the velocity and position loops in microseconds; divides every legal S-0-0002 (multiples of 250 us).
pub const LOOP_PERIOD_MICROSECONDS: u16 = 125;

/// One of the two interrupt outputs of the SERCON816. Both lines have a capture channel of the encoder timer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum InterruptLine {
    /// Pin INT0.
    Int0,
    /// Pin INT1.
    Int1,
}

/// Status lines of the amplifier.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Amplifier {
    /// Main power is applied and the DC link is charged.
    pub main_power: bool,
    /// The amplifier reports a fault and has switched itself off.
    pub fault: bool,
}

/// Why the processor was started.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum ResetCause {
    /// Nothing tells.
    #[default]
    Unknown,
    /// The supply came on, or broke down for a moment.
    PowerOn,
    /// The reset pin.
    ResetPin,
    /// The watchdog: the firmware had stopped.
    Watchdog,
    /// A reset by software.
    Software,
    /// The end of a low-power mode, which this drive never enters by itself.
    LowPower,
}

impl ResetCause {
    /// P-0-0009.
    #[must_use]
    pub const fn code(self) -> u16 {
        match self {
            Self::Unknown => 0,
            Self::PowerOn => 1,
            Self::ResetPin => 2,
            Self::Watchdog => 3,
            Self::Software => 4,
            Self::LowPower => 5,
        }
    }
}
