//! Names of the control registers, and the typed words written to them once at start.
//!
//! Source of every address and bit: sercon816.md 5.1 to 5.3. Registers that no public source explains have no name here;
//! they are listed in [`crate::uncertain::UNTOUCHED`].

use bitbybit::bitfield;

use crate::bus::Register;
use crate::rate::BitRate;
use crate::uncertain;

impl Register {
    /// 00H: version, read only; 0010H on the SERCON816.
    pub const VERSION: Self = Self::at(0x00);
    /// 01H: reset and serial interface, see [`SerialConfiguration`].
    pub const SERIAL_CONFIGURATION: Self = Self::at(0x01);
    /// 02H: transmitter enable and test, see [`uncertain::TRANSMITTER_NORMAL`].
    pub const TRANSMITTER: Self = Self::at(0x02);
    /// 03H: start and transmission block, see [`StartCommand`].
    pub const START: Self = Self::at(0x03);
    /// 04H: ring errors, write 1 to clear, see [`crate::ErrorStatus`].
    pub const ERROR_STATUS: Self = Self::at(0x04);
    /// 05H: service containers and timers, write 1 to clear, see [`crate::InterruptStatus`].
    pub const INTERRUPT_STATUS: Self = Self::at(0x05);
    /// 06H: interrupt enable for 04H.
    pub const ERROR_ENABLE: Self = Self::at(0x06);
    /// 07H: interrupt enable for 05H.
    pub const INTERRUPT_ENABLE: Self = Self::at(0x07);
    /// 08H: routing of the sources of 04H to INT0 or INT1.
    pub const ERROR_ROUTING: Self = Self::at(0x08);
    /// 09H: routing of the sources of 05H to INT0 or INT1.
    pub const INTERRUPT_ROUTING: Self = Self::at(0x09);
    /// 0AH: phase to send in the MST (master) or accepted phase (slave), bits 7..0.
    pub const PHASE: Self = Self::at(0x0A);
    /// 0BH: data byte of the last MST received, bits 7..0, read only.
    pub const PHASE_RECEIVED: Self = Self::at(0x0B);
    /// 0DH: timeouts of the service containers, see [`ServiceTimeouts`].
    pub const SERVICE_TIMEOUTS: Self = Self::at(0x0D);
    /// 0EH: divider of MCLK, see [`ClockDivider`](crate::ClockDivider).
    pub const CLOCK_DIVIDER: Self = Self::at(0x0E);
    /// 0FH: TSCYC0, cycle time of transmission block 0 in us.
    pub const CYCLE_TIME_0: Self = Self::at(0x0F);
    /// 10H: TSCYC1, cycle time of transmission block 1 in us.
    pub const CYCLE_TIME_1: Self = Self::at(0x10);
    /// 11H: TCYCDEL, measured ring delay counter in us (master).
    pub const RING_DELAY: Self = Self::at(0x11);
    /// 13H: TCNTST, start value of the microsecond counter at the MST.
    pub const COUNTER_START: Self = Self::at(0x13);
    /// 14H: TCYCSTART, delay from the start command to the MST in us (master).
    pub const CYCLE_START_DELAY: Self = Self::at(0x14);
    /// 15H: JTSCYC1, lower edge of the MST window relative to the cycle time in us, signed.
    pub const MST_WINDOW_START: Self = Self::at(0x15);
    /// 16H: JTSCYC2, upper edge of the MST window relative to the cycle time in us, signed.
    pub const MST_WINDOW_END: Self = Self::at(0x16);
    /// 18H: JTRDEL1, lower edge of the receive window of telegrams with time check in us.
    pub const TELEGRAM_WINDOW_START: Self = Self::at(0x18);
    /// 19H: JTRDEL2, upper edge of the receive window of telegrams with time check in us.
    pub const TELEGRAM_WINDOW_END: Self = Self::at(0x19);
    /// 1AH: most likely TINT0 in us after the MST (G11).
    pub const TIMER_0: Self = Self::at(0x1A);
    /// 1BH: most likely TINT1 in us after the MST (G11).
    pub const TIMER_1: Self = Self::at(0x1B);
    /// 1CH: most likely TINT2 in us after the MST (G11).
    pub const TIMER_2: Self = Self::at(0x1C);
    /// 1DH: most likely TINT3 in us after the MST (G11).
    pub const TIMER_3: Self = Self::at(0x1D);
    /// 25H: set "as required per phase" by one published slave, meaning not found (G13).
    pub const PHASE_DEPENDENT: Self = Self::at(0x25);

    /// The four timer registers in address order.
    pub const TIMERS: [Self; 4] = [Self::TIMER_0, Self::TIMER_1, Self::TIMER_2, Self::TIMER_3];
}

/// 01H: reset flag, repeater and serial interface (sercon816.md 5.2).
#[bitfield(u16, default = 0, debug)]
#[derive(PartialEq, Eq)]
pub struct SerialConfiguration {
    /// RSTFL: reset flag; its state is preserved when the register is rewritten.
    #[bit(0, rw)]
    reset_flag: bool,
    /// SWRST: software reset.
    #[bit(1, rw)]
    software_reset: bool,
    /// REPON: the repeater passes on what is received; a slave keeps it on.
    #[bit(3, rw)]
    repeater: bool,
    /// SREGEN: serial clock regeneration enable (name only, G31).
    #[bit(4, rw)]
    clock_regeneration: bool,
    /// REGMODE: clock regeneration mode, depends on the optical receiver.
    #[bit(5, rw)]
    regeneration_mode: bool,
    /// SWSBAUD: 1 = 2 Mbit/s, 0 = 4 Mbit/s, when [`SerialConfiguration::software_bit_rate`] is set.
    #[bit(6, rw)]
    slow_bit_rate: bool,
    /// POLRXD: polarity of RxD.
    #[bit(7, rw)]
    invert_receive: bool,
    /// PRESYNC: fixed value for conformance (G31).
    #[bit(8, rw)]
    presync: bool,
    /// POLTXD: polarity of TxD.
    #[bit(9, rw)]
    invert_transmit: bool,
    /// ENTSBAUD: the bit rate is taken from [`SerialConfiguration::slow_bit_rate`] and not from the pins.
    #[bit(10, rw)]
    software_bit_rate: bool,
    /// SBAUD: probably the state of the SBAUD pin.
    #[bit(11, r)]
    bit_rate_pin: bool,
    /// RXDNRZ: the received signal is NRZ instead of NRZI (G31: 0).
    #[bit(12, rw)]
    receive_nrz: bool,
}

impl SerialConfiguration {
    /// The word that starts a software reset, 0002H.
    pub const RESET: Self = Self::DEFAULT.with_software_reset(true);

    /// The bit-rate selection for a rate: by software for 2 and 4 Mbit/s, by the pins SBAUD and SBAUD16 for 8 and 16 (G14).
    #[must_use]
    pub const fn with_bit_rate(self, rate: BitRate) -> Self {
        match rate {
            BitRate::Mbit2 => self.with_software_bit_rate(true).with_slow_bit_rate(true),
            BitRate::Mbit4 => self.with_software_bit_rate(true).with_slow_bit_rate(false),
            BitRate::Mbit8 | BitRate::Mbit16 => self.with_software_bit_rate(false).with_slow_bit_rate(false),
        }
    }
}

/// 03H: start of telegram processing and choice of the transmission block (G7).
#[bitfield(u16, default = 0, debug)]
#[derive(PartialEq, Eq)]
pub struct StartCommand {
    /// Transmission block 1 is in force (weak evidence; both block pointers are moved, so that it need not be right).
    #[bit(2, rw)]
    block_1: bool,
    /// Telegrams are processed.
    #[bit(8, rw)]
    enable: bool,
}

/// 0DH: service container timeouts (sercon816.md 5.1); a slave has no use for them, but leaves nothing to the reset value.
#[bitfield(u16, default = 0, debug)]
#[derive(PartialEq, Eq)]
pub struct ServiceTimeouts {
    /// Handshake timeout in cycles.
    #[bits(0..=7, rw)]
    handshake: u8,
    /// BUSY timeout in cycles.
    #[bits(8..=15, rw)]
    busy: u8,
}

impl ServiceTimeouts {
    /// The published value FF0AH: 10 cycles handshake, 255 cycles BUSY.
    pub const STANDARD: Self = Self::DEFAULT.with_handshake(10).with_busy(255);
}

/// How the optical transceivers are wired to the chip; the bits of 01H and 02H that the board decides.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Transceiver {
    /// POLTXD: the driver of the transmitter inverts.
    pub invert_transmit: bool,
    /// POLRXD: the receiver inverts.
    pub invert_receive: bool,
    /// REGMODE: clock regeneration mode, given by the type of the optical receiver.
    pub regeneration_mode: bool,
    /// The word for 02H: which TxD outputs drive, at which power.
    pub transmitter: u16,
}

impl Transceiver {
    /// The published wiring: inverting driver, receiver that does not invert, regeneration mode 1 (sercon816.md 5.2, 5.3).
    pub const STANDARD: Self = Self {
        invert_transmit: true,
        invert_receive: false,
        regeneration_mode: true,
        transmitter: uncertain::TRANSMITTER_NORMAL,
    };

    /// The word for 01H of a slave: repeater on, bit rate and polarities set.
    #[must_use]
    pub const fn slave_word(&self, rate: BitRate) -> SerialConfiguration {
        self.master_word(rate).with_repeater(true)
    }

    /// The word for 01H of a master: as for a slave, repeater off.
    #[must_use]
    pub const fn master_word(&self, rate: BitRate) -> SerialConfiguration {
        SerialConfiguration::DEFAULT
            .with_bit_rate(rate)
            .with_invert_transmit(self.invert_transmit)
            .with_invert_receive(self.invert_receive)
            .with_regeneration_mode(self.regeneration_mode)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn serial_words_match_the_published_ones() {
        let board = Transceiver::STANDARD;
        assert_eq!(board.master_word(BitRate::Mbit4).raw_value(), 0x0620);
        assert_eq!(board.master_word(BitRate::Mbit2).raw_value(), 0x0660);
        assert_eq!(board.slave_word(BitRate::Mbit4).raw_value(), 0x0628);
        assert_eq!(board.slave_word(BitRate::Mbit2).raw_value(), 0x0668);
        assert_eq!(SerialConfiguration::RESET.raw_value(), 0x0002);
    }

    #[test]
    fn fast_bit_rates_are_left_to_the_pins() {
        for rate in [BitRate::Mbit8, BitRate::Mbit16] {
            assert_eq!(Transceiver::STANDARD.slave_word(rate).raw_value(), 0x0228);
        }
    }

    #[test]
    fn start_and_timeout_words_match_the_published_ones() {
        assert_eq!(StartCommand::DEFAULT.with_enable(true).raw_value(), 0x0100);
        assert_eq!(StartCommand::DEFAULT.with_enable(true).with_block_1(true).raw_value(), 0x0104);
        assert_eq!(ServiceTimeouts::STANDARD.raw_value(), 0xFF0A);
    }

    #[test]
    fn the_register_range_ends_at_2ah() {
        assert_eq!(Register::new(0x2A), Some(Register::LAST));
        assert_eq!(Register::new(0x2B), None);
        assert_eq!(Register::TIMER_3.word(), 0x1D);
    }

    proptest! {
        #[test]
        fn serial_fields_cover_their_own_bits_only(raw: u16) {
            let word = SerialConfiguration::new_with_raw_value(raw);
            let rebuilt = SerialConfiguration::new_with_raw_value(raw & !0x17FB)
                .with_reset_flag(word.reset_flag())
                .with_software_reset(word.software_reset())
                .with_repeater(word.repeater())
                .with_clock_regeneration(word.clock_regeneration())
                .with_regeneration_mode(word.regeneration_mode())
                .with_slow_bit_rate(word.slow_bit_rate())
                .with_invert_receive(word.invert_receive())
                .with_presync(word.presync())
                .with_invert_transmit(word.invert_transmit())
                .with_software_bit_rate(word.software_bit_rate())
                .with_receive_nrz(word.receive_nrz());
            prop_assert_eq!(rebuilt.raw_value(), raw);
        }
    }
}
