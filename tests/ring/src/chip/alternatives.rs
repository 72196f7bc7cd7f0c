//! Every way the silicon may turn out to behave where the public record stops, one field per G-number.
//!
//! The defaults are the proposals of sercon816.md 14; [`Alternatives::singles`] and [`Alternatives::pairs`] are the lists
//! that a drive is run against.

use std::fmt;

/// What the interrupt outputs do while a routed and enabled flag is set. G2.
#[derive(Copy, Clone, Debug, PartialEq, Eq, Default)]
pub enum InterruptOutput {
    /// Low as long as a flag is pending.
    #[default]
    ActiveLowLevel,
    /// High as long as a flag is pending.
    ActiveHighLevel,
    /// Low for 1 us whenever a flag becomes pending.
    ActiveLowPulse,
    /// High for 1 us whenever a flag becomes pending.
    ActiveHighPulse,
}

/// Where the timer and cycle events sit in 05H bits 15..8. G4.
#[derive(Copy, Clone, Debug, PartialEq, Eq, Default)]
pub enum EventMap {
    /// 8..11 TINT0..TINT3, 12 MST received, 13 CON_CLK (which never comes: its registers are not known).
    #[default]
    Suggested,
    /// 15..12 TINT0..TINT3, 11 MST received, 10 CON_CLK.
    Reversed,
    /// 8 MST received, 9..12 TINT0..TINT3, 13 CON_CLK, which comes in every cycle, 50 us after the MST.
    Shifted,
    /// 8..11 TINT0..TINT3 and nothing else.
    WithoutMst,
}

impl EventMap {
    /// Bit of 05H for TINT `index`, 0 to 3.
    pub const fn timer_bit(self, index: usize) -> u16 {
        match self {
            Self::Suggested | Self::WithoutMst => 1 << (8 + index),
            Self::Reversed => 1 << (15 - index),
            Self::Shifted => 1 << (9 + index),
        }
    }

    /// Bit of 05H for "MST received", 0 when there is none.
    pub const fn mst_bit(self) -> u16 {
        match self {
            Self::Suggested => 1 << 12,
            Self::Reversed => 1 << 11,
            Self::Shifted => 1 << 8,
            Self::WithoutMst => 0,
        }
    }

    /// Bit of 05H for CON_CLK where that event comes by itself, else 0.
    pub const fn con_clk_bit(self) -> u16 {
        match self {
            Self::Shifted => 1 << 13,
            Self::Suggested | Self::Reversed | Self::WithoutMst => 0,
        }
    }
}

/// Which value of a bit of 06H or 07H enables an interrupt. G5.
#[derive(Copy, Clone, Debug, PartialEq, Eq, Default)]
pub enum EnableSense {
    /// 1 enables.
    #[default]
    OneEnables,
    /// 0 enables: the registers are masks.
    ZeroEnables,
}

/// Which value of a bit of 08H or 09H routes an interrupt to which output. G5.
#[derive(Copy, Clone, Debug, PartialEq, Eq, Default)]
pub enum RoutingSense {
    /// 0 is INT0, 1 is INT1.
    #[default]
    ZeroIsInt0,
    /// 1 is INT0, 0 is INT1.
    OneIsInt0,
}

/// What selects transmission block 1. G7.
#[derive(Copy, Clone, Debug, PartialEq, Eq, Default)]
pub enum BlockSelect {
    /// Bit 2 of 03H.
    #[default]
    Bit2Of03H,
    /// A phase of 3 or more in 0AH.
    PhaseIn0AH,
    /// Nothing that is known: always block 0.
    AlwaysBlock0,
}

/// What must be set before telegram headers are processed. G7.
#[derive(Copy, Clone, Debug, PartialEq, Eq, Default)]
pub enum ProcessingEnable {
    /// Bit 8 of 03H.
    #[default]
    Bit8Of03H,
    /// Nothing.
    Always,
}

/// What 0AH reads. G8.
#[derive(Copy, Clone, Debug, PartialEq, Eq, Default)]
pub enum PhaseReadBack {
    /// What software wrote.
    #[default]
    Stored,
    /// The phase of the last MST.
    Received,
}

/// What stands in 0BH bits 15..8. G9.
#[derive(Copy, Clone, Debug, PartialEq, Eq, Default)]
pub enum UpperByte {
    /// Zero.
    #[default]
    Zero,
    /// Anything.
    Garbage,
}

/// Which of 1AH to 1DH is which timer interrupt. G11.
#[derive(Copy, Clone, Debug, PartialEq, Eq, Default)]
pub enum TimerOrder {
    /// 1AH is TINT0, 1DH is TINT3.
    #[default]
    Ascending,
    /// 1AH is TINT3, 1DH is TINT0.
    Descending,
}

/// What a timer register of zero does. G11.
#[derive(Copy, Clone, Debug, PartialEq, Eq, Default)]
pub enum TimerZero {
    /// No interrupt.
    #[default]
    Off,
    /// An interrupt at the MST.
    FiresAtMst,
}

/// Who clears the send-once bit of a transmit header. G16.
#[derive(Copy, Clone, Debug, PartialEq, Eq, Default)]
pub enum OneShot {
    /// The chip, when it has sent.
    #[default]
    AutoClear,
    /// Nobody but software.
    Stays,
}

/// Whether a receive header takes telegrams until it is changed. G17.
#[derive(Copy, Clone, Debug, PartialEq, Eq, Default)]
pub enum Rearm {
    /// It does.
    #[default]
    Continuous,
    /// After each telegram software must write its word 0 again.
    EachTelegram,
}

/// Bit 13 of a receive header's word 0. G18.
#[derive(Copy, Clone, Debug, PartialEq, Eq, Default)]
pub enum ErrorBit {
    /// Set on a telegram error, cleared by the next good telegram.
    #[default]
    SetOnError,
    /// Never touched.
    Untouched,
}

/// What the handshake bit of the AT does while a service step waits for the processor. G20.
#[derive(Copy, Clone, Debug, PartialEq, Eq, Default)]
pub enum Handshake {
    /// It keeps its level until software releases the step.
    #[default]
    HoldUntilReady,
    /// It follows the MDT at once, with BUSY = 1.
    AckThenBusy,
}

/// Which buffer of a slave's service container is which. G21.
#[derive(Copy, Clone, Debug, PartialEq, Eq, Default)]
pub enum BufferSense {
    /// The write buffer (container word 2) goes into the AT, the read buffer (word 3) comes from the MDT.
    #[default]
    WriteIsSent,
    /// The other way round.
    WriteIsReceived,
}

/// At which step the end of a service buffer stops the hardware dialogue. G24.
#[derive(Copy, Clone, Debug, PartialEq, Eq, Default)]
pub enum EndOfBuffer {
    /// At the step that transfers the last word.
    #[default]
    WithLast,
    /// At the first step behind the last word.
    AfterLast,
}

/// What a service buffer's pointer reads after a transfer. G24.
#[derive(Copy, Clone, Debug, PartialEq, Eq, Default)]
pub enum PointerMeaning {
    /// The word that the next transfer uses.
    #[default]
    Next,
    /// The word that the last transfer used.
    Last,
}

/// How JTRDEL1 and JTRDEL2 are read. G26. (JTSCYC is added modulo 2^16 either way: its sign is graded A.)
#[derive(Copy, Clone, Debug, PartialEq, Eq, Default)]
pub enum WindowSign {
    /// Two's complement.
    #[default]
    Signed,
    /// Unsigned: a negative lower edge becomes one that no telegram reaches.
    Unsigned,
}

/// What NMSTERR does after FFFFH. G27.
#[derive(Copy, Clone, Debug, PartialEq, Eq, Default)]
pub enum CounterEnd {
    /// It stays there.
    #[default]
    Saturates,
    /// It goes on with zero.
    Wraps,
}

/// What happens at the transmit headers of a cycle without MST. G28.
#[derive(Copy, Clone, Debug, PartialEq, Eq, Default)]
pub enum TransmitWithoutMst {
    /// Nothing is sent.
    #[default]
    Suppressed,
    /// They are executed.
    Continues,
}

/// What the timer interrupts do in a cycle without MST. G28.
#[derive(Copy, Clone, Debug, PartialEq, Eq, Default)]
pub enum TimersWithoutMst {
    /// They come.
    #[default]
    Fire,
    /// They do not.
    Silent,
}

/// What stands in the registers after a reset. G30.
#[derive(Copy, Clone, Debug, PartialEq, Eq, Default)]
pub enum ResetValues {
    /// Zero, but for 00H and 01H.
    #[default]
    Zero,
    /// Anything, but in 00H, 01H and the status registers.
    Garbage,
}

/// Whether a telegram error sets a bit of 04H. G32.
#[derive(Copy, Clone, Debug, PartialEq, Eq, Default)]
pub enum TelegramErrorFlag {
    /// No.
    #[default]
    None,
    /// Bit 10.
    Bit10,
}

/// When the words of a received telegram appear. G33.
#[derive(Copy, Clone, Debug, PartialEq, Eq, Default)]
pub enum Delivery {
    /// All at its end.
    #[default]
    AtEnd,
    /// While it comes in; VAL is 0 from its start on.
    Progressive,
}

/// Noise in the bits of 04H whose meaning is not known (2..6 and 10..15). G3.
#[derive(Copy, Clone, Debug, PartialEq, Eq, Default)]
pub enum UnknownStatusBits {
    /// They stay 0.
    #[default]
    Quiet,
    /// Some of them come with every MST.
    Noisy,
}

/// One complete chip, as it may turn out to be.
#[derive(Copy, Clone, Debug, PartialEq, Eq, Default)]
pub struct Alternatives {
    /// G2.
    pub interrupt_output: InterruptOutput,
    /// G3.
    pub unknown_status_bits: UnknownStatusBits,
    /// G4.
    pub event_map: EventMap,
    /// G5.
    pub enable_sense: EnableSense,
    /// G5.
    pub routing_sense: RoutingSense,
    /// G7.
    pub block_select: BlockSelect,
    /// G7.
    pub processing_enable: ProcessingEnable,
    /// G8.
    pub phase_read_back: PhaseReadBack,
    /// G9.
    pub received_phase_upper_byte: UpperByte,
    /// G11.
    pub timer_order: TimerOrder,
    /// G11.
    pub timer_zero: TimerZero,
    /// G16.
    pub one_shot: OneShot,
    /// G17.
    pub rearm: Rearm,
    /// G18.
    pub error_bit: ErrorBit,
    /// G20.
    pub handshake: Handshake,
    /// G21.
    pub buffer_sense: BufferSense,
    /// G24.
    pub end_of_buffer: EndOfBuffer,
    /// G24.
    pub pointer_meaning: PointerMeaning,
    /// G26.
    pub window_sign: WindowSign,
    /// G27.
    pub error_counter_end: CounterEnd,
    /// G28.
    pub transmit_without_mst: TransmitWithoutMst,
    /// G28.
    pub timers_without_mst: TimersWithoutMst,
    /// G30.
    pub reset_values: ResetValues,
    /// G32.
    pub telegram_error_flag: TelegramErrorFlag,
    /// G33.
    pub delivery: Delivery,
}

/// One deviation from the defaults.
struct Deviation {
    g_number: u8,
    name: &'static str,
    apply: fn(&mut Alternatives),
}

/// The G-numbers whose deviations meet in the service channel and the interrupts.
const PAIRED_G_NUMBERS: [u8; 8] = [2, 4, 5, 11, 20, 21, 24, 32];

macro_rules! deviations {
    ($($g:literal $name:literal $field:ident = $value:expr;)*) => {
        &[$(Deviation { g_number: $g, name: $name, apply: |chip| chip.$field = $value }),*]
    };
}

const DEVIATIONS: &[Deviation] = deviations! {
    2 "G2 interrupt outputs active high" interrupt_output = InterruptOutput::ActiveHighLevel;
    2 "G2 interrupt outputs pulse low" interrupt_output = InterruptOutput::ActiveLowPulse;
    2 "G2 interrupt outputs pulse high" interrupt_output = InterruptOutput::ActiveHighPulse;
    3 "G3 noise in the unknown bits of 04H" unknown_status_bits = UnknownStatusBits::Noisy;
    4 "G4 event bits reversed" event_map = EventMap::Reversed;
    4 "G4 event bits shifted, CON_CLK every cycle" event_map = EventMap::Shifted;
    4 "G4 no MST event" event_map = EventMap::WithoutMst;
    5 "G5 zero enables interrupts" enable_sense = EnableSense::ZeroEnables;
    5 "G5 one routes to INT0" routing_sense = RoutingSense::OneIsInt0;
    7 "G7 block by the phase in 0AH" block_select = BlockSelect::PhaseIn0AH;
    7 "G7 always block 0" block_select = BlockSelect::AlwaysBlock0;
    7 "G7 headers always processed" processing_enable = ProcessingEnable::Always;
    8 "G8 0AH reads the received phase" phase_read_back = PhaseReadBack::Received;
    9 "G9 garbage above the received phase" received_phase_upper_byte = UpperByte::Garbage;
    11 "G11 timer registers descending" timer_order = TimerOrder::Descending;
    11 "G11 a timer of zero fires at the MST" timer_zero = TimerZero::FiresAtMst;
    16 "G16 send-once stays set" one_shot = OneShot::Stays;
    17 "G17 receive headers re-armed for each telegram" rearm = Rearm::EachTelegram;
    18 "G18 header bit 13 untouched" error_bit = ErrorBit::Untouched;
    20 "G20 acknowledged at once, then busy" handshake = Handshake::AckThenBusy;
    21 "G21 service buffers swapped" buffer_sense = BufferSense::WriteIsReceived;
    24 "G24 end of buffer after the last word" end_of_buffer = EndOfBuffer::AfterLast;
    24 "G24 pointers read the last word" pointer_meaning = PointerMeaning::Last;
    26 "G26 JTRDEL unsigned" window_sign = WindowSign::Unsigned;
    27 "G27 NMSTERR wraps" error_counter_end = CounterEnd::Wraps;
    28 "G28 transmits without MST" transmit_without_mst = TransmitWithoutMst::Continues;
    28 "G28 no timers without MST" timers_without_mst = TimersWithoutMst::Silent;
    30 "G30 registers start as garbage" reset_values = ResetValues::Garbage;
    32 "G32 a telegram error sets 04H bit 10" telegram_error_flag = TelegramErrorFlag::Bit10;
    33 "G33 data arrive progressively" delivery = Delivery::Progressive;
};

impl Alternatives {
    /// Every deviation from the defaults, each alone, with its name.
    pub fn singles() -> Vec<(String, Self)> {
        DEVIATIONS
            .iter()
            .map(|deviation| {
                let mut chip = Self::default();
                (deviation.apply)(&mut chip);
                (deviation.name.to_owned(), chip)
            })
            .collect()
    }

    /// Every two deviations of different G-numbers among those that touch the service container and the interrupts
    /// (G2, G4, G5, G11, G20, G21, G24, G32), with both names joined by " + ".
    pub fn pairs() -> Vec<(String, Self)> {
        let paired: Vec<_> =
            DEVIATIONS.iter().filter(|deviation| PAIRED_G_NUMBERS.contains(&deviation.g_number)).collect();
        let mut pairs = Vec::new();
        for (index, first) in paired.iter().enumerate() {
            for second in &paired[index + 1..] {
                if first.g_number != second.g_number {
                    let mut chip = Self::default();
                    (first.apply)(&mut chip);
                    (second.apply)(&mut chip);
                    pairs.push((format!("{} + {}", first.name, second.name), chip));
                }
            }
        }
        pairs
    }
}

impl fmt::Display for Alternatives {
    /// The names of all deviations in force joined by " + ", or `defaults`.
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut first = true;
        for deviation in DEVIATIONS {
            let mut applied = *self;
            (deviation.apply)(&mut applied);
            if applied == *self {
                if !first {
                    formatter.write_str(" + ")?;
                }
                first = false;
                formatter.write_str(deviation.name)?;
            }
        }
        if first {
            formatter.write_str("defaults")?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_single_deviates_and_displays_its_own_name() {
        for (name, chip) in Alternatives::singles() {
            assert_ne!(chip, Alternatives::default(), "{name}");
            assert_eq!(chip.to_string(), name);
        }
        assert_eq!(Alternatives::default().to_string(), "defaults");
    }

    #[test]
    fn pairs_are_distinct_and_join_two_different_g_numbers() {
        let pairs = Alternatives::pairs();
        // Deviations of the paired G-numbers: 3, 3, 2, 2, 1, 1, 2, 1.
        assert_eq!(pairs.len(), (15 * 15 - (9 + 9 + 4 + 4 + 1 + 1 + 4 + 1)) / 2);
        for (index, (name, chip)) in pairs.iter().enumerate() {
            assert_eq!(&chip.to_string(), name);
            assert!(!pairs[..index].iter().any(|(_, other)| other == chip));
        }
    }
}
