//! What the tasks of the loop tick need of the board; what the current loop above them needs is [`servo::motor::PowerStage`].

use servo::motor::BoardKind;

use crate::amplifier::Amplifier;

/// The motor side of a board, as the tasks of the loop tick see it.
///
/// Every call is a few register accesses; none may wait.
pub trait Hardware {
    /// The board that it is on.
    type Board: BoardKind;

    /// The amplifier that this board has where no production record tells of another one.
    const AMPLIFIER: Amplifier;

    /// The encoder counter now, in increments (four per line), wrapping at 2^32.
    fn encoder_count(&mut self) -> u32;

    /// The encoder counter as the hardware latched it at the last interrupt edge of the ring controller
    /// on the given line: the feedback value of t4 without software jitter.
    fn encoder_latch(&mut self, line: InterruptLine) -> u32;

    /// Phase of the last edge of this line: time from the beginning of its loop tick, in counts of [`Facts::loop_timer_counts`] to
    /// the tick, as the hardware captured it. Read with the latch, before the interrupt is acknowledged.
    ///
    /// [`Facts::loop_timer_counts`]: servo::motor::Facts::loop_timer_counts
    fn edge_phase(&mut self, line: InterruptLine) -> u16;

    /// An edge has come on this line that its handler has not begun to serve: what [`Hardware::encoder_latch`] and
    /// [`Hardware::edge_phase`] of the line tell belongs to it.
    fn edge_waits(&mut self, line: InterruptLine) -> bool;

    /// Phase of the present instant.
    fn phase_now(&mut self) -> u16;

    /// All digital inputs at the same instant.
    fn inputs(&mut self) -> Inputs;

    /// Lets the bridge switch, or switches all six transistors off. On has no effect while a break input holds the bridge off.
    fn set_bridge(&mut self, on: bool);

    /// Whether the bridge switches. It does not any more after a break or a trip of the current loop, whatever was set.
    fn bridge_is_on(&mut self) -> bool;

    /// Forgets a break or a trip whose cause is gone: the bridge may be set on again.
    fn reset_bridge(&mut self);

    /// Current through the coil of the holding brake: `true` opens the brake.
    fn set_brake(&mut self, open: bool);

    /// Forgets the index pulses seen so far.
    fn arm_index(&mut self);

    /// The count at the last index pulse since [`Hardware::arm_index`] or since the last call.
    fn index_latch(&mut self) -> Option<u32>;

    /// Forgets the edges of a probe seen so far.
    fn arm_probe(&mut self, probe: ProbeInput);

    /// The count at an edge of a probe since it was armed or since the last call.
    fn probe_latch(&mut self, probe: ProbeInput, rising: bool) -> Option<u32>;

    /// Why the processor was started; read once at start.
    fn reset_cause(&self) -> ResetCause;
}

/// Digital inputs. A broken wire reads as `false`, which is the safe state of each of them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Inputs {
    /// Main power is applied and the DC link is charged.
    pub main_power: bool,
    /// The gate drivers report no fault; a fault also holds the bridge off by the break input.
    pub bridge_ready: bool,
    /// First channel of safe torque off permits torque. Observed, never relied on.
    pub safe_torque_1: bool,
    /// Second channel.
    pub safe_torque_2: bool,
    /// Home switch S-0-0400.
    pub home_switch: bool,
    /// Contact of the holding brake: it is open.
    pub brake_open: bool,
    /// Probe 1 (S-0-0401).
    pub probe_1: bool,
    /// Probe 2 (S-0-0402).
    pub probe_2: bool,
}

/// One of the two probe inputs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum ProbeInput {
    /// Probe 1.
    One,
    /// Probe 2.
    Two,
}

/// Period of the velocity and position loops in microseconds; divides every legal S-0-0002 (multiples of 250 us).
pub const LOOP_PERIOD_MICROSECONDS: u16 = servo::units::LOOP_PERIOD_MICROSECONDS as u16;

/// One of the two interrupt outputs of the SERCON816. Both lines have a capture channel of the encoder timer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum InterruptLine {
    /// Pin INT0.
    Int0,
    /// Pin INT1.
    Int1,
}

impl InterruptLine {
    /// The other pin.
    #[must_use]
    pub const fn other(self) -> Self {
        match self {
            Self::Int0 => Self::Int1,
            Self::Int1 => Self::Int0,
        }
    }
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
