//! What stands around the processor: the seam between the emulator and the simulated world.

use ring::Nanoseconds;

use crate::{EmulatorError, Guest};

/// Digital inputs of the power stage and the machine; `true` is the level 1.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct DigitalInputs {
    /// Main power is on.
    pub main_power: bool,
    /// Safe torque off, channel 1: torque is allowed.
    pub sto_1: bool,
    /// Safe torque off, channel 2: torque is allowed.
    pub sto_2: bool,
    /// Home switch.
    pub home_switch: bool,
    /// Contact of the holding brake.
    pub brake_feedback: bool,
    /// Probe 1.
    pub probe_1: bool,
    /// Probe 2.
    pub probe_2: bool,
}

/// The last rising edge of the encoder's index.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct IndexEdge {
    /// How many there were so far.
    pub number: u64,
    /// Position at this one, counted as [`Environment::encoder_count`].
    pub count: u32,
}

/// Where [`Guest::stop_at`] stops the product, once.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StopAt {
    /// Address of an instruction; [`StopAt::HERE`]: that before which the product stands stopped.
    pub address: u32,
    /// So many executed instructions behind it, whatever they belong to.
    pub behind: u32,
}

impl StopAt {
    /// See [`StopAt::address`].
    pub const HERE: u32 = 0;
}

/// For how long a product that has stopped is held, see [`Guest::hold`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Hold {
    /// To this instant.
    Until(Nanoseconds),
    /// Until a pin or a peripheral raises this interrupt of the NVIC.
    Interrupt(u8),
}

/// The product has come to a [`StopAt`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Stopped {
    /// When.
    pub now: Nanoseconds,
    /// The instruction that is executed next.
    pub pc: u32,
    /// Number of the exception that is being served; 0: none.
    pub exception: u16,
}

/// The world as the pins of the processor see it.
///
/// `now` is the processor's own time of the access; the world has been advanced to it before.
pub trait Environment {
    /// A 16-bit read on the external bus, byte offset into the window of NE1 (RAM at 0, registers at 1000H).
    fn external_read(&mut self, now: Nanoseconds, byte_offset: u32) -> u16;

    /// A 16-bit write on the external bus.
    fn external_write(&mut self, now: Nanoseconds, byte_offset: u32, value: u16);

    /// What [`Environment::external_read`] would answer, if reading has no side effect and the value cannot change by itself before the
    /// world's next event (the horizon given to [`crate::Guest::run`]). Lets an answer carry values that the processor is going to read.
    fn external_peek(&self, _byte_offset: u32) -> Option<u16> {
        None
    }

    /// The product has stopped, see [`Guest::stop_at`]. What is changed at the pins now, it sees behind the instruction that is next.
    ///
    /// # Errors
    /// The end of QEMU.
    fn stopped(&mut self, _guest: &mut Guest, _stopped: Stopped) -> Result<(), EmulatorError> {
        Ok(())
    }

    /// Electrical levels of INT0 and INT1 of the SERCON816.
    fn interrupt_pins(&self) -> (bool, bool);

    /// Position of the encoder, in increments (four per line), wrapping.
    fn encoder_count(&mut self, now: Nanoseconds) -> u32;

    /// Setting of the two hexadecimal address switches: high digit in bits 7..4.
    fn address_switches(&self) -> u8;

    /// Setting of the bit-rate switches: 0 = 2, 1 = 4, 2 = 8, 3 = 16 Mbit/s.
    fn bit_rate_switches(&self) -> u8 {
        0
    }

    /// The reset line of the SERCON816 changed: `true` = held in reset.
    fn set_chip_reset(&mut self, _now: Nanoseconds, _held: bool) {}

    /// The bit-rate straps SBAUD and SBAUD16 of the SERCON816 changed.
    fn set_bit_rate_straps(&mut self, _now: Nanoseconds, _sbaud: bool, _sbaud16: bool) {}

    /// The 12-bit code that an ADC (1 to 3) takes on a channel at its hold instant. The world has been advanced to `at`.
    fn analog_sample(&mut self, _at: Nanoseconds, _adc: usize, _channel: u8) -> u16 {
        2048
    }

    /// From `at` on the six switches follow the duties, or all of them are off. The dead time is in nanoseconds.
    fn set_bridge(&mut self, _at: Nanoseconds, _on: bool, _dead_time_ns: u32) {}

    /// From `at` on each phase's high side is on for this share of the time, 0 to 1, dead time not taken off.
    fn set_duties(&mut self, _at: Nanoseconds, _duties: [f64; 3]) {}

    /// The coil of the holding brake.
    fn set_brake(&mut self, _at: Nanoseconds, _energised: bool) {}

    /// The switch of the brake chopper.
    fn set_chopper(&mut self, _at: Nanoseconds, _on: bool) {}

    /// Level of the break input of the modulator: low = tripped. [`crate::Guest::run`] must be called at each of its edges.
    fn break_input(&self) -> bool {
        true
    }

    /// Levels of the digital inputs. [`crate::Guest::run`] must be called at each edge of the probes.
    fn digital_inputs(&self) -> DigitalInputs {
        DigitalInputs::default()
    }

    /// The last rising edge of the encoder's index up to `now`; falling edges are not told, no channel captures them.
    fn index_count(&mut self, _now: Nanoseconds) -> IndexEdge {
        IndexEdge::default()
    }

    /// What [`Environment::encoder_count`] will answer at an instant ahead, at most a few microseconds, without moving the world there; `None`
    /// when that is not known.
    fn encoder_foretold(&self, _at: Nanoseconds) -> Option<u32> {
        None
    }

    /// Until when [`Environment::encoder_count`] certainly answers the same as at `now`; `now` itself when that is not known. Lets an answer
    /// carry the position at standstill.
    fn encoder_steady_until(&self, now: Nanoseconds) -> Nanoseconds {
        now
    }
}
