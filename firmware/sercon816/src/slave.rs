//! Setting the chip up as a slave, and moving it from phase to phase.

use core::fmt;

use crate::bus::{Bus, RamAddress, Register};
use crate::container::DataContainer;
use crate::header::{END_MARKER, ReceiveHeader, TransmitHeader, TransmitMode};
use crate::layout::{
    BLOCK_POINTERS, Block, END, MAXIMUM_CYCLIC_WORDS, MST_ERRORS, SERVICE_CONTAINER, SERVICE_POINTER_COUNT,
    SERVICE_POINTERS, SERVICE_WORDS,
};
use crate::rate::{BitRate, MasterClock};
use crate::register::{SerialConfiguration, ServiceTimeouts, StartCommand, Transceiver};
use crate::timer::TimerMap;
use crate::timing::{Timing, Window};
use crate::uncertain;

/// What the board and the operator decide.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Configuration {
    /// Drive address, 1 to 254.
    pub address: u8,
    /// Bit rate of the ring.
    pub bit_rate: BitRate,
    /// MCLK of the board.
    pub clock: MasterClock,
    /// Wiring of the optical transceivers.
    pub transceiver: Transceiver,
}

/// What the master decides in CP2: times in us after the MST, records in 16-bit words.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct CyclicConfiguration {
    /// Cycle time, S-0-0002.
    pub cycle_us: u16,
    /// Start of the AT, S-0-0006.
    pub t1_us: u16,
    /// Start of the MDT, S-0-0089.
    pub t2_us: u16,
    /// Command value valid, S-0-0008.
    pub t3_us: u16,
    /// Feedback acquisition, S-0-0007.
    pub t4_us: u16,
    /// Cyclic data of the AT, 0 to [`MAXIMUM_CYCLIC_WORDS`]; without status word and service info word.
    pub at_words: u16,
    /// Cyclic data of the own record in the MDT, 0 to [`MAXIMUM_CYCLIC_WORDS`]; without control word and service info word.
    pub mdt_words: u16,
    /// The whole MDT, S-0-0010 / 2.
    pub mdt_length_words: u16,
    /// Begin of the own record in the MDT, (S-0-0009 - 1) / 2.
    pub record_position_words: u16,
}

/// Why the chip could not be initialised.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum InitialiseError {
    /// The drive address is not 1 to 254.
    Address {
        /// The address asked for.
        actual: u8,
    },
    /// Register 00H does not name a SERCON816: no chip, another one, or a broken bus.
    Version {
        /// [`uncertain::VERSION`].
        expected: u16,
        /// What was read.
        actual: u16,
    },
    /// A word of the RAM did not read back.
    Ram {
        /// Word offset.
        address: u16,
        /// What was written.
        expected: u16,
        /// What was read.
        actual: u16,
    },
}

impl fmt::Display for InitialiseError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Address { actual } => write!(f, "drive address {actual} is not 1 to 254"),
            Self::Version { expected, actual } => {
                write!(f, "version register reads {actual:04X}H, a SERCON816 has {expected:04X}H")
            }
            Self::Ram { address, expected, actual } => {
                write!(f, "RAM word {address:03X}H reads {actual:04X}H after {expected:04X}H was written")
            }
        }
    }
}

impl core::error::Error for InitialiseError {}

/// Why a cyclic configuration does not fit the chip. Whether it fits the ring is the protocol's business.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum CyclicError {
    /// More cyclic words than the RAM layout has room for.
    TooManyWords {
        /// [`MAXIMUM_CYCLIC_WORDS`].
        limit: u16,
        /// The words asked for.
        actual: u16,
    },
    /// The own record ends behind the MDT.
    RecordOutsideTelegram {
        /// Words in the MDT.
        length: u16,
        /// First word behind the record.
        actual: u16,
    },
    /// A time is not below the cycle time.
    TimeOutsideCycle {
        /// The cycle time in us.
        cycle_us: u16,
        /// The time in us.
        actual_us: u16,
    },
}

impl fmt::Display for CyclicError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::TooManyWords { limit, actual } => write!(f, "{actual} words of cyclic data, room for {limit}"),
            Self::RecordOutsideTelegram { length, actual } => {
                write!(f, "the record ends at word {actual} of an MDT of {length} words")
            }
            Self::TimeOutsideCycle { cycle_us, actual_us } => {
                write!(f, "{actual_us} us is not within the cycle of {cycle_us} us")
            }
        }
    }
}

impl core::error::Error for CyclicError {}

/// Why a phase could not be entered.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum EnterError {
    /// No such phase.
    UnknownPhase {
        /// The phase asked for.
        actual: u8,
    },
    /// CP3 or CP4 without [`Slave::configure_cyclic`] since CP0.
    NotConfigured,
}

impl fmt::Display for EnterError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::UnknownPhase { actual } => write!(f, "there is no phase {actual}"),
            Self::NotConfigured => f.write_str("the cyclic telegrams are not configured"),
        }
    }
}

impl core::error::Error for EnterError {}

#[derive(Clone, Copy, Debug)]
struct CyclicTimes {
    cycle_us: u16,
    t3_us: u16,
    t4_us: u16,
    first_header: RamAddress,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum BlockInForce {
    None,
    Initial,
    Cyclic,
}

/// The chip as a slave with one drive, service container 0. Belongs to the task of the phase change.
#[derive(Debug)]
pub struct Slave<B> {
    bus: B,
    address: u8,
    timing: Timing,
    cyclic: Option<CyclicTimes>,
    in_force: BlockInForce,
}

impl<B: Bus> Slave<B> {
    /// A slave not yet initialised.
    pub const fn new(bus: B) -> Self {
        Self {
            bus,
            address: 0,
            timing: Timing::new(MasterClock::Mhz32, BitRate::Mbit2),
            cyclic: None,
            in_force: BlockInForce::None,
        }
    }

    /// Resets the chip and sets it up for CP0: repeater on, nothing sent, timers off, RAM tested and cleared.
    ///
    /// Neither reset values nor RAM contents are relied upon (G30); the order is that of sercon816.md 9.
    /// Interrupts stay off until [`crate::Interrupts::enable`]; the service container is set up by
    /// [`crate::ServicePort::reset`]. Takes some 1000 accesses.
    ///
    /// # Errors
    /// [`InitialiseError`]: an address outside 1 to 254, no SERCON816 on the bus, or RAM that does not hold its contents.
    pub fn initialise(&mut self, configuration: &Configuration) -> Result<(), InitialiseError> {
        if !(1..=254).contains(&configuration.address) {
            return Err(InitialiseError::Address { actual: configuration.address });
        }
        self.in_force = BlockInForce::None;
        self.cyclic = None;
        self.address = configuration.address;
        self.timing = Timing::new(configuration.clock, configuration.bit_rate);
        let version = self.version();
        if version != uncertain::VERSION {
            return Err(InitialiseError::Version { expected: uncertain::VERSION, actual: version });
        }
        self.reset(configuration);
        self.clear_ram()?;
        self.write_fixed_words();
        self.configure_initial();
        self.activate_initial(None);
        self.set_phase(0);
        self.start(false);
        Ok(())
    }

    /// Register 00H.
    pub fn version(&mut self) -> u16 {
        self.bus.read_register(Register::VERSION)
    }

    /// The phase in the last MST, 0 to 255 as received (0BH).
    pub fn phase_received(&mut self) -> u8 {
        (self.bus.read_register(Register::PHASE_RECEIVED) & uncertain::PHASE_RECEIVED_BITS) as u8
    }

    /// NMSTERR: counter of missed MSTs; only differences mean anything (G27).
    pub fn mst_errors(&mut self) -> u16 {
        self.bus.read_ram(MST_ERRORS)
    }

    /// Error counter of the MDT of CP3 and CP4; only differences mean anything.
    pub fn mdt_errors(&mut self) -> u16 {
        self.bus.read_ram(Block::CYCLIC.mdt_header.offset(4))
    }

    /// Prepares the telegrams of CP3 and CP4, without touching those of CP0 to CP2; at S-0-0127.
    ///
    /// # Errors
    /// [`CyclicError`] if the configuration does not fit the chip; what was prepared before is then no longer valid.
    pub fn configure_cyclic(&mut self, cyclic: &CyclicConfiguration) -> Result<(), CyclicError> {
        if self.in_force == BlockInForce::Cyclic {
            // Only the block that is not being processed may be rewritten.
            self.activate_initial(None);
        }
        self.cyclic = None;
        check(cyclic)?;
        self.cyclic = Some(self.write_cyclic_block(cyclic));
        Ok(())
    }

    /// Moves the chip to a phase: some 20 accesses for CP3, 40 for CP0, few for the others.
    ///
    /// `timers` are the timers as discovered; `None` leaves the timer registers alone (discovery is under way).
    /// Call it for every phase accepted. In CP0 the cyclic configuration is forgotten.
    ///
    /// # Errors
    /// [`EnterError`]: a phase above 4, or CP3 or CP4 without a cyclic configuration; nothing is changed then.
    pub fn enter(&mut self, phase: u8, timers: Option<&TimerMap>) -> Result<(), EnterError> {
        match phase {
            0..=2 => {
                if phase == 0 || self.in_force != BlockInForce::Initial {
                    self.cyclic = None;
                    self.activate_initial(timers);
                } else {
                    self.send_initial_at(false);
                }
            }
            3 | 4 => {
                let times = self.cyclic.ok_or(EnterError::NotConfigured)?;
                if self.in_force != BlockInForce::Cyclic {
                    self.activate_cyclic(times, timers);
                }
            }
            actual => return Err(EnterError::UnknownPhase { actual }),
        }
        self.set_phase(phase);
        Ok(())
    }

    /// Continuous light on the transmitter, a test signal (sercon816.md 5.3); `false` goes back to the board's setting.
    pub fn set_continuous_light(&mut self, on: bool, transceiver: &Transceiver) {
        let word = if on { uncertain::TRANSMITTER_LIGHT } else { transceiver.transmitter };
        self.bus.write_register(Register::TRANSMITTER, word);
    }

    fn reset(&mut self, configuration: &Configuration) {
        let bus = &mut self.bus;
        bus.write_register(Register::SERIAL_CONFIGURATION, SerialConfiguration::RESET.raw_value());
        let flag =
            SerialConfiguration::new_with_raw_value(bus.read_register(Register::SERIAL_CONFIGURATION)).reset_flag();
        let serial = configuration.transceiver.slave_word(configuration.bit_rate).with_reset_flag(flag);
        bus.write_register(Register::SERIAL_CONFIGURATION, serial.raw_value());
        bus.write_register(Register::START, StartCommand::DEFAULT.raw_value());
        bus.write_register(Register::TRANSMITTER, configuration.transceiver.transmitter);
        for register in Register::TIMERS {
            bus.write_register(register, uncertain::TIMER_NEVER_US);
        }
        for status in [Register::ERROR_STATUS, Register::INTERRUPT_STATUS] {
            bus.write_register(status, uncertain::CLEAR_ALL);
        }
        for enable in [Register::ERROR_ENABLE, Register::INTERRUPT_ENABLE] {
            bus.write_register(enable, !uncertain::ENABLE_ALL);
        }
        for routing in [Register::ERROR_ROUTING, Register::INTERRUPT_ROUTING] {
            bus.write_register(routing, uncertain::ROUTING);
        }
        bus.write_register(Register::SERVICE_TIMEOUTS, ServiceTimeouts::STANDARD.raw_value());
        bus.write_register(Register::COUNTER_START, self.timing.counter_start());
        bus.write_register(Register::CLOCK_DIVIDER, self.timing.clock_divider().raw_value());
        bus.write_register(Register::CYCLE_START_DELAY, 0);
    }

    fn clear_ram(&mut self) -> Result<(), InitialiseError> {
        let [even, odd] = uncertain::RAM_TEST_PATTERNS;
        // The words differ from each other and from those of the second pass, so that address lines are tested too.
        for pattern in [even, odd] {
            for word in 0..END.word() {
                self.bus.write_ram(RamAddress::new(word), pattern ^ word);
            }
            for word in 0..END.word() {
                let address = RamAddress::new(word);
                let expected = pattern ^ word;
                let actual = self.bus.read_ram(address);
                if actual != expected {
                    return Err(InitialiseError::Ram { address: word, expected, actual });
                }
            }
        }
        for word in 0..END.word() {
            self.bus.write_ram(RamAddress::new(word), 0);
        }
        Ok(())
    }

    fn write_fixed_words(&mut self) {
        for container in 0..SERVICE_POINTER_COUNT {
            self.bus.write_ram(SERVICE_POINTERS.offset(container), SERVICE_CONTAINER.word());
        }
        self.bus.write_ram(MST_ERRORS, 0);
    }

    fn write_words(&mut self, address: RamAddress, words: &[u16]) {
        for (offset, &word) in (0_u16..).zip(words) {
            self.bus.write_ram(address.offset(offset), word);
        }
    }

    fn configure_initial(&mut self) {
        let block = Block::INITIAL;
        let address = self.address;
        let at = TransmitHeader::addressed(address, TransmitMode::Off).raw_value();
        let mdt = ReceiveHeader::addressed(address).raw_value();
        let container = DataContainer::of_slave(SERVICE_WORDS).raw_value();
        self.write_words(
            block.at_header,
            &[at, uncertain::INITIAL_AT_TIME_US, SERVICE_WORDS, block.mdt_header.word(), container, 0, 0],
        );
        self.write_words(
            block.mdt_header,
            &[mdt, uncertain::INITIAL_MDT_TIME_US, SERVICE_WORDS, block.end.word(), 0, container, 0, 0, 0],
        );
        self.write_words(block.end, &[END_MARKER, uncertain::INITIAL_END_US]);
    }

    fn write_cyclic_block(&mut self, cyclic: &CyclicConfiguration) -> CyclicTimes {
        let block = Block::CYCLIC;
        let at_first = cyclic.t1_us <= cyclic.t2_us;
        let (first_header, at_next, mdt_next) = if at_first {
            (block.at_header, block.mdt_header, block.end)
        } else {
            (block.mdt_header, block.end, block.at_header)
        };
        let at_length = SERVICE_WORDS.saturating_add(cyclic.at_words);
        let mdt_length = SERVICE_WORDS.saturating_add(cyclic.mdt_words);
        let at = TransmitHeader::addressed(self.address, TransmitMode::Off).raw_value();
        self.write_words(
            block.at_header,
            &[at, cyclic.t1_us, at_length, at_next.word(), DataContainer::of_slave(at_length).raw_value()],
        );
        let mdt = ReceiveHeader::addressed(0xFF).raw_value();
        self.write_words(block.mdt_header, &[mdt, cyclic.t2_us, cyclic.mdt_length_words, mdt_next.word()]);
        self.write_words(
            block.mdt_container,
            &[DataContainer::of_slave(mdt_length).raw_value(), cyclic.record_position_words],
        );
        for word in 0..SERVICE_WORDS.saturating_add(MAXIMUM_CYCLIC_WORDS) {
            self.bus.write_ram(block.at_data.offset(word), 0);
            self.bus.write_ram(block.mdt_data.offset(word), 0);
        }
        self.write_words(block.end, &[END_MARKER, self.end_time(cyclic, at_length)]);
        CyclicTimes { cycle_us: cyclic.cycle_us, t3_us: cyclic.t3_us, t4_us: cyclic.t4_us, first_header }
    }

    /// 10 us after the last telegram (sercon816.md 6.2), but before the window of the next MST opens.
    fn end_time(&self, cyclic: &CyclicConfiguration, at_length: u16) -> u16 {
        let at = cyclic.t1_us.saturating_add(self.timing.telegram_duration_us(at_length));
        let mdt = cyclic.t2_us.saturating_add(self.timing.telegram_duration_us(cyclic.mdt_length_words));
        let latest = cyclic.cycle_us.saturating_add_signed(self.timing.cyclic_mst_window(cyclic.cycle_us).start);
        at.max(mdt).saturating_add(10).min(latest.saturating_sub(1))
    }

    fn activate_initial(&mut self, timers: Option<&TimerMap>) {
        // In the block that is left, so that no further AT goes out in this cycle.
        let off = TransmitHeader::addressed(self.address, TransmitMode::Off).raw_value();
        self.bus.write_ram(Block::CYCLIC.at_header, off);
        self.send_initial_at(false);
        self.bus.write_ram(Block::INITIAL.mdt_header, ReceiveHeader::addressed(self.address).raw_value());
        self.point_at(Block::INITIAL.at_header);
        self.write_windows(
            uncertain::INITIAL_CYCLE_US,
            self.timing.initial_mst_window(),
            self.timing.initial_telegram_window(),
        );
        if let Some(timers) = timers {
            timers.program(&mut self.bus, Some(uncertain::INITIAL_COMMAND_VALID_US), None);
        }
        if self.in_force == BlockInForce::Cyclic {
            self.start(false);
        }
        self.in_force = BlockInForce::Initial;
    }

    fn activate_cyclic(&mut self, times: CyclicTimes, timers: Option<&TimerMap>) {
        let at = TransmitHeader::addressed(self.address, TransmitMode::Continuous).raw_value();
        self.bus.write_ram(Block::CYCLIC.mdt_header, ReceiveHeader::addressed(0xFF).raw_value());
        self.bus.write_ram(Block::CYCLIC.at_header, at);
        self.point_at(times.first_header);
        self.write_windows(
            times.cycle_us,
            self.timing.cyclic_mst_window(times.cycle_us),
            self.timing.cyclic_telegram_window(times.cycle_us),
        );
        self.start(uncertain::BLOCK_SELECT_IN_CYCLIC_PHASES);
        self.send_initial_at(false);
        if let Some(timers) = timers {
            timers.program(&mut self.bus, Some(times.t3_us), Some(times.t4_us));
        }
        self.in_force = BlockInForce::Cyclic;
    }

    fn send_initial_at(&mut self, send: bool) {
        let mode = if send { TransmitMode::Once } else { TransmitMode::Off };
        self.bus.write_ram(Block::INITIAL.at_header, TransmitHeader::addressed(self.address, mode).raw_value());
    }

    fn point_at(&mut self, header: RamAddress) {
        for pointer in BLOCK_POINTERS {
            self.bus.write_ram(pointer, header.word());
        }
    }

    fn write_windows(&mut self, cycle_us: u16, mst: Window, telegram: Window) {
        let start = telegram.start.max(uncertain::LOWEST_TELEGRAM_WINDOW_START);
        self.bus.write_register(Register::CYCLE_TIME_0, cycle_us);
        self.bus.write_register(Register::CYCLE_TIME_1, cycle_us);
        self.bus.write_register(Register::MST_WINDOW_START, mst.start as u16);
        self.bus.write_register(Register::MST_WINDOW_END, mst.end as u16);
        self.bus.write_register(Register::TELEGRAM_WINDOW_START, start as u16);
        self.bus.write_register(Register::TELEGRAM_WINDOW_END, telegram.end as u16);
    }

    fn start(&mut self, block_1: bool) {
        let word = StartCommand::DEFAULT.with_enable(true).with_block_1(block_1);
        self.bus.write_register(Register::START, word.raw_value());
    }

    fn set_phase(&mut self, phase: u8) {
        self.bus.write_register(Register::PHASE, u16::from(phase));
        if let Some(Some(value)) = uncertain::PHASE_DEPENDENT.get(usize::from(phase)) {
            self.bus.write_register(Register::PHASE_DEPENDENT, *value);
        }
    }
}

fn check(cyclic: &CyclicConfiguration) -> Result<(), CyclicError> {
    for actual in [cyclic.at_words, cyclic.mdt_words] {
        if actual > MAXIMUM_CYCLIC_WORDS {
            return Err(CyclicError::TooManyWords { limit: MAXIMUM_CYCLIC_WORDS, actual });
        }
    }
    let end = cyclic.record_position_words.saturating_add(SERVICE_WORDS).saturating_add(cyclic.mdt_words);
    if end > cyclic.mdt_length_words {
        return Err(CyclicError::RecordOutsideTelegram { length: cyclic.mdt_length_words, actual: end });
    }
    for actual_us in [cyclic.t1_us, cyclic.t2_us, cyclic.t3_us, cyclic.t4_us] {
        if actual_us >= cyclic.cycle_us {
            return Err(CyclicError::TimeOutsideCycle { cycle_us: cyclic.cycle_us, actual_us });
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests;
