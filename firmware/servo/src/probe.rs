//! Probing cycle S-0-0170: positions at the edges of two probe inputs, latched in hardware.
//!
//! The command enables the function. A rising enable bit (S-0-0405, S-0-0406) arms its probe; each selected edge (S-0-0169) latches the
//! position of its first occurrence (S-0-0130 to S-0-0133) and sets its bits in S-0-0179 and S-0-0409 to S-0-0412. Later edges change nothing
//! until the enable bit has been 0 and 1 again. The command has no end of its own: it runs until it is cancelled, and edges that are selected
//! meanwhile count from then on.

use core::fmt;

use crate::units::Position;

/// One of the two probe inputs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Probe {
    /// Probe 1: S-0-0130, S-0-0131, S-0-0401, S-0-0405, S-0-0409, S-0-0410.
    One,
    /// Probe 2: S-0-0132, S-0-0133, S-0-0402, S-0-0406, S-0-0411, S-0-0412.
    Two,
}

/// Direction of a signal edge.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Edge {
    /// From 0 to 1.
    Positive,
    /// From 1 to 0.
    Negative,
}

/// A probe control parameter S-0-0169 that asks for what is not there.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum ProbeError {
    /// Only the edges (bits 0 to 3) can be chosen; the feedback is always that of the motor.
    UnsupportedBits {
        /// Bits that are set and must not be.
        actual: u16,
    },
}

impl fmt::Display for ProbeError {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::UnsupportedBits { actual } => {
                write!(formatter, "bits {actual:#06X} of the probe control parameter S-0-0169 are not supported")
            }
        }
    }
}

impl core::error::Error for ProbeError {}

/// Edges that a probing cycle looks at.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct ProbeSettings {
    one: Pair<bool>,
    two: Pair<bool>,
}

impl ProbeSettings {
    /// From S-0-0169: bit 0 positive and bit 1 negative edge of probe 1, bits 2 and 3 those of probe 2.
    ///
    /// # Errors
    /// [`ProbeError::UnsupportedBits`] for any other bit.
    pub const fn new(probe_control: u16) -> Result<Self, ProbeError> {
        let unsupported = probe_control & !0xF;
        if unsupported != 0 {
            return Err(ProbeError::UnsupportedBits { actual: unsupported });
        }
        Ok(Self {
            one: Pair { positive: probe_control & 1 != 0, negative: probe_control & 2 != 0 },
            two: Pair { positive: probe_control & 4 != 0, negative: probe_control & 8 != 0 },
        })
    }
}

/// What one probe input has done since the last tick.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct ProbeInput {
    /// Level of the input now (S-0-0401, S-0-0402).
    pub level: bool,
    /// Probe enable S-0-0405 or S-0-0406.
    pub enable: bool,
    /// Position latched in hardware at a positive edge since the last tick. A capture register keeps the last of several
    /// edges: an input that bounces within 125 us latches the end of the bouncing.
    pub positive: Option<Position>,
    /// The same for a negative edge.
    pub negative: Option<Position>,
}

/// Both probe inputs in a tick.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct ProbeInputs {
    /// Probing cycle S-0-0170 is being executed.
    pub active: bool,
    /// Probe 1.
    pub one: ProbeInput,
    /// Probe 2.
    pub two: ProbeInput,
}

/// State of the probing cycle.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct ProbingCycle {
    active: bool,
    one: Channel,
    two: Channel,
}

impl ProbingCycle {
    /// Nothing armed, nothing latched.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// One tick. The edges of the period in which an enable bit rises came before the arming and are not taken; one that is already set
    /// when the command starts does not arm.
    #[inline]
    pub fn tick(&mut self, settings: &ProbeSettings, inputs: &ProbeInputs) {
        if inputs.active && !self.active {
            self.one.latched = Pair::default();
            self.two.latched = Pair::default();
        }
        self.active = inputs.active;
        self.one.tick(settings.one, inputs.active, &inputs.one);
        self.two.tick(settings.two, inputs.active, &inputs.two);
    }

    /// Measurement value status S-0-0179: bits 0 to 3 are probe 1 positive, probe 1 negative, probe 2 positive, probe 2 negative latched.
    #[inline]
    #[must_use]
    pub fn measurement_value_status(&self) -> u16 {
        u16::from(self.one.latched.positive)
            | u16::from(self.one.latched.negative) << 1
            | u16::from(self.two.latched.positive) << 2
            | u16::from(self.two.latched.negative) << 3
    }

    /// This edge has been latched since the arming (S-0-0409 to S-0-0412). Cleared by the next arming of its probe and by the start of
    /// the command.
    #[inline]
    #[must_use]
    pub const fn is_latched(&self, probe: Probe, edge: Edge) -> bool {
        self.channel(probe).latched.of(edge)
    }

    /// The last position latched at this edge (S-0-0130 to S-0-0133), in the coordinates of its time; zero before the first.
    #[inline]
    #[must_use]
    pub const fn value(&self, probe: Probe, edge: Edge) -> Position {
        self.channel(probe).values.of(edge)
    }

    /// Level of the input at the last tick (S-0-0401, S-0-0402), whether the command is active or not.
    #[inline]
    #[must_use]
    pub const fn level(&self, probe: Probe) -> bool {
        self.channel(probe).level
    }

    const fn channel(&self, probe: Probe) -> &Channel {
        match probe {
            Probe::One => &self.one,
            Probe::Two => &self.two,
        }
    }
}

/// Something for each of the two edges.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
struct Pair<T> {
    positive: T,
    negative: T,
}

impl<T: Copy> Pair<T> {
    const fn of(&self, edge: Edge) -> T {
        match edge {
            Edge::Positive => self.positive,
            Edge::Negative => self.negative,
        }
    }
}

/// One probe input.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
struct Channel {
    level: bool,
    enable: bool,
    armed: bool,
    latched: Pair<bool>,
    values: Pair<Position>,
}

impl Channel {
    #[inline]
    fn tick(&mut self, selected: Pair<bool>, active: bool, input: &ProbeInput) {
        if self.armed {
            if let (true, false, Some(position)) = (selected.positive, self.latched.positive, input.positive) {
                self.values.positive = position;
                self.latched.positive = true;
            }
            if let (true, false, Some(position)) = (selected.negative, self.latched.negative, input.negative) {
                self.values.negative = position;
                self.latched.negative = true;
            }
        }
        // The edges above came before this enable bit was read: a falling one does not take them away, a rising one does not give them.
        if !active || !input.enable {
            self.armed = false;
        } else if !self.enable {
            self.armed = true;
            self.latched = Pair::default();
        }
        self.enable = input.enable;
        self.level = input.level;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const EDGES: [(Probe, Edge); 4] = [
        (Probe::One, Edge::Positive),
        (Probe::One, Edge::Negative),
        (Probe::Two, Edge::Positive),
        (Probe::Two, Edge::Negative),
    ];

    /// A cycle with all edges selected, and the inputs that armed it.
    fn armed(probe_control: u16) -> (ProbeSettings, ProbingCycle, ProbeInputs) {
        let settings = ProbeSettings::new(probe_control).unwrap();
        let mut cycle = ProbingCycle::new();
        let mut inputs = ProbeInputs { active: true, ..ProbeInputs::default() };
        cycle.tick(&settings, &inputs);
        inputs.one.enable = true;
        inputs.two.enable = true;
        cycle.tick(&settings, &inputs);
        (settings, cycle, inputs)
    }

    /// All four edges at once, at positions `base` to `base + 3`.
    fn with_edges(inputs: ProbeInputs, base: i64) -> ProbeInputs {
        let at = |number| Some(Position::from_bits(base + number));
        ProbeInputs {
            one: ProbeInput { positive: at(0), negative: at(1), ..inputs.one },
            two: ProbeInput { positive: at(2), negative: at(3), ..inputs.two },
            ..inputs
        }
    }

    fn values(cycle: &ProbingCycle) -> [i64; 4] {
        EDGES.map(|(probe, edge)| cycle.value(probe, edge).to_bits())
    }

    #[test]
    fn each_selected_edge_latches_its_own_value_and_bit() {
        for probe_control in 0..16 {
            let (settings, mut cycle, inputs) = armed(probe_control);
            assert_eq!(cycle.measurement_value_status(), 0);
            cycle.tick(&settings, &with_edges(inputs, 100));
            assert_eq!(cycle.measurement_value_status(), probe_control);
            for (bit, (probe, edge)) in (0_u16..).zip(EDGES) {
                let selected = probe_control >> bit & 1 != 0;
                assert_eq!(cycle.is_latched(probe, edge), selected);
                assert_eq!(cycle.value(probe, edge).to_bits(), if selected { 100 + i64::from(bit) } else { 0 });
            }
        }
    }

    #[test]
    fn only_the_first_edge_latches_until_the_enable_bit_was_0_and_1_again() {
        let (settings, mut cycle, mut inputs) = armed(0xF);
        cycle.tick(&settings, &with_edges(inputs, 100));
        cycle.tick(&settings, &with_edges(inputs, 200));
        assert_eq!(values(&cycle), [100, 101, 102, 103]);
        inputs.one.enable = false;
        cycle.tick(&settings, &inputs);
        cycle.tick(&settings, &with_edges(inputs, 300));
        assert_eq!(cycle.measurement_value_status(), 0xF, "the bits stay without enable");
        inputs.one.enable = true;
        cycle.tick(&settings, &inputs);
        assert_eq!(cycle.measurement_value_status(), 0b1100, "arming probe 1 leaves probe 2 alone");
        assert_eq!(values(&cycle), [100, 101, 102, 103], "values stay until the next edge");
        cycle.tick(&settings, &with_edges(inputs, 400));
        assert_eq!(values(&cycle), [400, 401, 102, 103]);
        assert_eq!(cycle.measurement_value_status(), 0xF);
    }

    #[test]
    fn the_edges_of_a_probe_wait_for_each_other() {
        let (settings, mut cycle, inputs) = armed(0b0011);
        let mut first = inputs;
        first.one.negative = Some(Position::from_bits(7));
        cycle.tick(&settings, &first);
        assert_eq!(cycle.measurement_value_status(), 0b0010);
        cycle.tick(&settings, &with_edges(inputs, 50));
        assert_eq!(cycle.measurement_value_status(), 0b0011);
        assert_eq!(values(&cycle), [50, 7, 0, 0]);
    }

    #[test]
    fn edges_before_the_arming_and_after_the_disarming_do_not_count() {
        let settings = ProbeSettings::new(0xF).unwrap();
        let mut cycle = ProbingCycle::new();
        let mut inputs = ProbeInputs { active: true, ..ProbeInputs::default() };
        cycle.tick(&settings, &inputs);
        inputs.one.enable = true;
        cycle.tick(&settings, &with_edges(inputs, 100));
        assert_eq!(cycle.measurement_value_status(), 0, "the edge of the period in which the enable bit rose");
        inputs.one.enable = false;
        cycle.tick(&settings, &with_edges(inputs, 200));
        assert_eq!(cycle.measurement_value_status(), 0b0011, "the edge of the period in which it fell");
        assert_eq!(values(&cycle), [200, 201, 0, 0]);
        cycle.tick(&settings, &with_edges(inputs, 300));
        assert_eq!(values(&cycle), [200, 201, 0, 0]);
    }

    #[test]
    fn edges_that_are_selected_while_the_command_runs_count_from_then_on() {
        for at_first in 0..16 {
            for then in 0..16 {
                let (_, mut cycle, inputs) = armed(at_first);
                let settings = ProbeSettings::new(then).unwrap();
                cycle.tick(&settings, &with_edges(inputs, 100));
                assert_eq!(cycle.measurement_value_status(), then, "{at_first:04b}, then {then:04b}");
            }
        }
        // What was latched before stays, and a second edge is none.
        let (settings, mut cycle, inputs) = armed(0b0001);
        cycle.tick(&settings, &with_edges(inputs, 100));
        cycle.tick(&ProbeSettings::new(0b0011).unwrap(), &with_edges(inputs, 200));
        assert_eq!((cycle.measurement_value_status(), values(&cycle)), (0b0011, [100, 201, 0, 0]));
    }

    #[test]
    fn without_enable_or_command_an_armed_edge_is_given_up() {
        for take_away in [
            |inputs: &mut ProbeInputs| inputs.active = false,
            |inputs: &mut ProbeInputs| {
                inputs.one.enable = false;
                inputs.two.enable = false;
            },
        ] {
            let (settings, mut cycle, mut inputs) = armed(0xF);
            take_away(&mut inputs);
            cycle.tick(&settings, &inputs);
            cycle.tick(&settings, &with_edges(inputs, 100));
            assert_eq!(cycle.measurement_value_status(), 0);
            assert_eq!(values(&cycle), [0; 4]);
        }
    }

    #[test]
    fn the_command_enables_clears_and_ends_the_function() {
        let settings = ProbeSettings::new(0xF).unwrap();
        let mut cycle = ProbingCycle::new();
        let mut inputs = ProbeInputs::default();
        inputs.one.enable = true;
        cycle.tick(&settings, &inputs);
        cycle.tick(&settings, &with_edges(inputs, 100));
        assert_eq!(cycle.measurement_value_status(), 0, "without command nothing is armed");
        inputs.active = true;
        cycle.tick(&settings, &inputs);
        cycle.tick(&settings, &with_edges(inputs, 100));
        assert_eq!(cycle.measurement_value_status(), 0, "an enable bit that was set before does not arm");

        let (settings, mut cycle, mut inputs) = armed(0xF);
        cycle.tick(&settings, &with_edges(inputs, 100));
        inputs.active = false;
        cycle.tick(&settings, &inputs);
        assert_eq!(cycle.measurement_value_status(), 0xF, "results outlive the command");
        inputs.active = true;
        cycle.tick(&settings, &inputs);
        assert_eq!(cycle.measurement_value_status(), 0, "and end with the next");
        cycle.tick(&settings, &with_edges(inputs, 200));
        assert_eq!(values(&cycle), [100, 101, 102, 103], "the end of the command has disarmed");
    }

    #[test]
    fn levels_are_those_of_the_last_tick() {
        let settings = ProbeSettings::new(0).unwrap();
        let mut cycle = ProbingCycle::new();
        for (one, two) in [(true, false), (false, true)] {
            let mut inputs = ProbeInputs::default();
            inputs.one.level = one;
            inputs.two.level = two;
            cycle.tick(&settings, &inputs);
            assert_eq!((cycle.level(Probe::One), cycle.level(Probe::Two)), (one, two));
        }
    }

    #[test]
    fn other_bits_of_the_probe_control_parameter_are_refused() {
        assert_eq!(ProbeSettings::new(0x0013), Err(ProbeError::UnsupportedBits { actual: 0x0010 }));
        assert_eq!(ProbeSettings::new(0x8000), Err(ProbeError::UnsupportedBits { actual: 0x8000 }));
    }
}
