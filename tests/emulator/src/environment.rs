//! What stands around the processor: the seam between the emulator and the simulated world.

use ring::Nanoseconds;

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

    /// Electrical levels of INT0 and INT1 of the SERCON816.
    fn interrupt_pins(&self) -> (bool, bool);

    /// Position of the encoder, in increments (four per line), wrapping.
    fn encoder_count(&mut self, now: Nanoseconds) -> u32;

    /// The analogue current command: 12-bit code of the converter, 800H = zero.
    fn set_current(&mut self, now: Nanoseconds, code: u16);

    /// The amplifier enable line.
    fn set_amplifier(&mut self, now: Nanoseconds, on: bool);

    /// Status of the amplifier: main power present, fault.
    fn amplifier_inputs(&self) -> (bool, bool);

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
}
