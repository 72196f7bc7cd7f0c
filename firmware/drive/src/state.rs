//! The drive's states: what the control word asks for, what power and faults allow, what the status word says.
//!
//! Sources: sercos2.md 1.6 (control word), 1.7 (status word), 6.3 (states and reactions).

/// What the drive does with the motor.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum DriveState {
    /// Torque-free. Main power may be missing (status 01) or applied (status 10).
    #[default]
    Off,
    /// Switching on: the torque comes, the commutation angle is found where it is not known, the brake opens. No command is followed yet.
    SwitchingOn,
    /// In operation: the motor follows the cyclic command values.
    Following,
    /// In operation, but held by HALT: the drive has stopped by itself and keeps its loops closed.
    Halted,
    /// The control took bit 15 away: best possible deceleration, then [`DriveState::Engaging`].
    SwitchingOff,
    /// A class 1 diagnostic: best possible deceleration, then [`DriveState::Engaging`].
    FaultReaction,
    /// At standstill: the brake closes, and then the torque goes.
    Engaging,
    /// Torque-free after a class 1 diagnostic, until S-0-0099 has cleared it.
    Fault,
}

impl DriveState {
    /// Whether torque is on.
    #[must_use]
    pub const fn has_torque(self) -> bool {
        !matches!(self, Self::Off | Self::Fault)
    }

    /// Whether the drive is in operation: the loops are closed and the axis is its own master or follows.
    #[must_use]
    pub const fn is_in_operation(self) -> bool {
        matches!(self, Self::Following | Self::Halted | Self::SwitchingOff | Self::FaultReaction)
    }
}

/// The three switches of the control word (sercos2.md 1.6, bits 15 to 13).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Switches {
    /// Bit 15, drive ON.
    pub on: bool,
    /// Bit 14, drive ENABLE.
    pub enable: bool,
    /// Bit 13: `true` lets the drive follow, `false` is HALT.
    pub run: bool,
}

impl Switches {
    /// The switches in a control word.
    #[must_use]
    pub const fn from_control_word(word: u16) -> Self {
        Self { on: word & 0x8000 != 0, enable: word & 0x4000 != 0, run: word & 0x2000 != 0 }
    }
}

/// What the state machine has to know of the rest of the drive.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Conditions {
    /// CP4: command values are valid, torque is allowed, and the switches are those of an MDT of this CP4.
    pub operating_phase: bool,
    /// Main power is applied and the amplifier reports no fault of its own: torque may come.
    pub power: bool,
    /// The DC link is above P-0-0104, the amplifier is sound and safe torque off permits torque: torque that is there may stay. Without main
    /// power it is for a stop alone.
    pub sustained: bool,
    /// A class 1 diagnostic is present.
    pub fault: bool,
    /// The fault forbids a controlled stop: torque off at once (feedback lost, amplifier tripped).
    pub fatal: bool,
    /// The motor stands still (within S-0-0124).
    pub standstill: bool,
    /// Switching on is done: the torque is proven and the brake is open.
    pub released: bool,
    /// Switching off is done: the brake is closed and there is no torque any more.
    pub torque_off: bool,
}

/// The state machine of sercos2.md 6.3.
///
/// Torque comes on only at a rising edge of ON and ENABLE together, both sides of it seen in CP4, with power and without fault: a switch
/// that was left on through a fault, a loss of power or a run-up never starts a motor. Torque that is on goes on without main power for as
/// long as the DC link carries it: the error that the loss is, or the control, makes a stop of it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct StateMachine {
    state: DriveState,
    /// The last look was at a request of 0 in CP4: the next one may be an edge.
    armed: bool,
}

impl StateMachine {
    /// The state.
    #[must_use]
    pub const fn state(&self) -> DriveState {
        self.state
    }

    /// Whether these switches would bring torque on: the edge is there, and nothing stands in its way.
    #[must_use]
    ///
    /// `conditions` are asked for only if it depends on them.
    #[inline]
    pub fn would_switch_on(&self, switches: Switches, conditions: impl FnOnce() -> Conditions) -> bool {
        if !matches!(self.state, DriveState::Off | DriveState::Engaging)
            || !self.armed
            || !switches.on
            || !switches.enable
        {
            return false;
        }
        let conditions = conditions();
        conditions.operating_phase && conditions.power && !conditions.fault && !conditions.fatal
    }

    /// Takes one look at switches and conditions and returns the new state. Called every loop tick; costs a few compares.
    pub fn update(&mut self, switches: Switches, conditions: Conditions) -> DriveState {
        let request = switches.on && switches.enable && conditions.operating_phase;
        let rising = request && self.armed;
        self.armed = conditions.operating_phase && !request;
        let torque_forbidden = !conditions.sustained || conditions.fatal;
        let may_come = rising && conditions.power;
        self.state = match self.state {
            DriveState::Off if conditions.fault => DriveState::Fault,
            DriveState::Off if may_come && !torque_forbidden => DriveState::SwitchingOn,
            DriveState::Off => DriveState::Off,
            DriveState::Fault if conditions.fault => DriveState::Fault,
            DriveState::Fault => DriveState::Off,
            _ if torque_forbidden => Self::stopped(conditions),
            // ENABLE goes past every ramp: torque off at once (sercos2.md 6.3). A lost ring has no switches to obey.
            _ if conditions.operating_phase && !switches.enable => Self::stopped(conditions),
            DriveState::Engaging if conditions.torque_off => Self::stopped(conditions),
            DriveState::Engaging if may_come && !conditions.fault => DriveState::SwitchingOn,
            DriveState::Engaging => DriveState::Engaging,
            DriveState::SwitchingOn if conditions.fault || !request => Self::given_up(conditions),
            DriveState::SwitchingOn if conditions.released => Self::running(switches),
            DriveState::SwitchingOn => DriveState::SwitchingOn,
            DriveState::FaultReaction if conditions.standstill => DriveState::Engaging,
            DriveState::FaultReaction => DriveState::FaultReaction,
            _ if conditions.fault => DriveState::FaultReaction,
            DriveState::SwitchingOff if may_come => Self::running(switches),
            DriveState::SwitchingOff if conditions.standstill => DriveState::Engaging,
            DriveState::SwitchingOff => DriveState::SwitchingOff,
            DriveState::Following | DriveState::Halted if !request => DriveState::SwitchingOff,
            DriveState::Following | DriveState::Halted => Self::running(switches),
        };
        self.state
    }

    const fn running(switches: Switches) -> DriveState {
        if switches.run { DriveState::Following } else { DriveState::Halted }
    }

    /// Switching on has an end before it is done. What stands has nothing to decelerate; a shaft that was caught at speed has.
    const fn given_up(conditions: Conditions) -> DriveState {
        match (conditions.released && !conditions.standstill, conditions.fault) {
            (false, _) => DriveState::Engaging,
            (true, true) => DriveState::FaultReaction,
            (true, false) => DriveState::SwitchingOff,
        }
    }

    const fn stopped(conditions: Conditions) -> DriveState {
        if conditions.fault { DriveState::Fault } else { DriveState::Off }
    }
}

/// Bit 13 of the status word: C1D holds an error.
pub(crate) const ERROR_BIT: u16 = 0x2000;

/// Bits 15, 14, 13 and 3 of the status word (sercos2.md 1.7) for a state.
#[must_use]
pub const fn status_bits(state: DriveState, conditions: Conditions) -> u16 {
    let ready = match state {
        _ if state.is_in_operation() => 0xC000,
        // A brake that closes, or opens, does it under torque: what the DC link carries is power.
        _ if conditions.power || (state.has_torque() && conditions.sustained) => 0x8000,
        _ => 0x4000,
    };
    let error = if conditions.fault { ERROR_BIT } else { 0 };
    let following = if matches!(state, DriveState::Following) { 0x0008 } else { 0 };
    ready | error | following
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const FOLLOW: Switches = Switches { on: true, enable: true, run: true };
    const HALT: Switches = Switches { on: true, enable: true, run: false };
    const ENABLED: Switches = Switches { on: false, enable: true, run: true };
    const NONE: Switches = Switches { on: false, enable: false, run: false };
    const READY: Conditions = Conditions {
        operating_phase: true,
        power: true,
        sustained: true,
        fault: false,
        fatal: false,
        standstill: false,
        released: true,
        torque_off: true,
    };
    const FAULT: Conditions = Conditions { fault: true, ..READY };
    const STANDING: Conditions = Conditions { standstill: true, ..READY };

    #[test]
    fn only_an_edge_that_would_bring_torque_counts_as_switching_on() {
        let mut machine = StateMachine::default();
        assert!(!machine.would_switch_on(FOLLOW, || READY), "nothing has been seen yet");
        let _ = machine.update(NONE, READY);
        assert!(machine.would_switch_on(FOLLOW, || READY));
        for conditions in [FAULT, Conditions { power: false, ..READY }, Conditions { operating_phase: false, ..READY }]
        {
            assert!(!machine.would_switch_on(FOLLOW, || conditions), "{conditions:?}");
        }
        assert!(!machine.would_switch_on(ENABLED, || READY));
        let _ = machine.update(FOLLOW, Conditions { power: false, ..READY });
        assert!(!machine.would_switch_on(FOLLOW, || READY), "the edge has gone by");
        let mut closing = following();
        let _ = closing.update(ENABLED, STANDING);
        let _ = closing.update(ENABLED, Conditions { torque_off: false, ..STANDING });
        assert_eq!(closing.state(), DriveState::Engaging);
        assert!(closing.would_switch_on(FOLLOW, || READY), "its brake would open again");
    }

    fn following() -> StateMachine {
        let mut machine = StateMachine::default();
        let _ = machine.update(NONE, READY);
        switch_on(&mut machine);
        machine
    }

    fn switch_on(machine: &mut StateMachine) {
        assert_eq!(machine.update(FOLLOW, READY), DriveState::SwitchingOn);
        assert_eq!(machine.update(FOLLOW, READY), DriveState::Following);
    }

    #[test]
    fn torque_needs_cp4_and_power_and_a_new_edge() {
        let mut machine = StateMachine::default();
        let no_power = Conditions { power: false, ..READY };
        let cp3 = Conditions { operating_phase: false, ..READY };
        assert_eq!(machine.update(FOLLOW, READY), DriveState::Off, "no request of 0 was seen in CP4");
        assert_eq!(machine.update(NONE, cp3), DriveState::Off);
        assert_eq!(machine.update(FOLLOW, READY), DriveState::Off, "that of CP3 is none");
        assert_eq!(machine.update(NONE, no_power), DriveState::Off);
        assert_eq!(machine.update(FOLLOW, no_power), DriveState::Off);
        assert_eq!(machine.update(FOLLOW, READY), DriveState::Off, "power came under a request that was already there");
        let _ = machine.update(ENABLED, READY);
        switch_on(&mut machine);
    }

    #[test]
    fn a_fault_stops_the_motor_and_a_switch_left_on_does_not_restart_it() {
        let mut machine = following();
        assert_eq!(machine.update(FOLLOW, FAULT), DriveState::FaultReaction);
        assert_eq!(machine.update(FOLLOW, FAULT), DriveState::FaultReaction);
        assert_eq!(machine.update(FOLLOW, Conditions { standstill: true, ..FAULT }), DriveState::Engaging);
        assert_eq!(machine.update(FOLLOW, FAULT), DriveState::Fault);
        assert_eq!(machine.update(FOLLOW, READY), DriveState::Off);
        assert_eq!(machine.update(FOLLOW, READY), DriveState::Off);
        let _ = machine.update(NONE, READY);
        switch_on(&mut machine);
    }

    #[test]
    fn a_ring_that_falls_to_cp0_ends_in_a_controlled_stop() {
        let mut machine = following();
        let lost = Conditions { operating_phase: false, ..FAULT };
        assert_eq!(machine.update(NONE, lost), DriveState::FaultReaction);
        assert_eq!(machine.update(NONE, Conditions { standstill: true, ..lost }), DriveState::Engaging);
        assert_eq!(machine.update(NONE, lost), DriveState::Fault);
        let mut machine = following();
        let orderly = Conditions { operating_phase: false, ..READY };
        assert_eq!(machine.update(NONE, orderly), DriveState::SwitchingOff);
        assert_eq!(machine.update(NONE, Conditions { standstill: true, ..orderly }), DriveState::Engaging);
        assert_eq!(machine.update(NONE, orderly), DriveState::Off);
    }

    #[test]
    fn enable_and_an_empty_dc_link_take_the_torque_away_at_once() {
        let mut machine = following();
        assert_eq!(machine.update(Switches { enable: false, ..FOLLOW }, READY), DriveState::Off);
        let mut machine = following();
        let empty = Conditions { power: false, sustained: false, ..READY };
        assert_eq!(machine.update(FOLLOW, empty), DriveState::Off);
        let mut machine = following();
        assert_eq!(machine.update(FOLLOW, Conditions { fatal: true, ..FAULT }), DriveState::Fault);
    }

    #[test]
    fn each_switch_is_a_bit_of_the_control_word_and_the_others_are_none() {
        for (word, switches) in [
            (0x8000, Switches { on: true, ..NONE }),
            (0x4000, Switches { enable: true, ..NONE }),
            (0x2000, Switches { run: true, ..NONE }),
            (0x1FFF, NONE),
            (0xE000, FOLLOW),
        ] {
            let inverted = Switches { on: !switches.on, enable: !switches.enable, run: !switches.run };
            assert_eq!(Switches::from_control_word(word), switches, "{word:#06x}");
            assert_eq!(Switches::from_control_word(!word), inverted, "all but {word:#06x}");
        }
    }

    #[test]
    fn a_fault_stays_a_fault_as_long_as_its_cause_does() {
        let mut machine = StateMachine::default();
        for look in 0..4 {
            assert_eq!(machine.update(NONE, FAULT), DriveState::Fault, "look {look}");
        }
        assert_eq!(machine.update(NONE, READY), DriveState::Off);
    }

    #[test]
    fn a_stop_is_broken_off_by_a_new_edge_and_the_axis_follows_or_halts_as_the_switches_say() {
        for (switches, state) in [(FOLLOW, DriveState::Following), (HALT, DriveState::Halted)] {
            let mut machine = following();
            assert_eq!(machine.update(ENABLED, READY), DriveState::SwitchingOff);
            assert_eq!(machine.update(switches, READY), state);
        }
    }

    const WITHOUT_MAINS: Conditions = Conditions { power: false, ..READY };

    #[test]
    fn a_stop_is_finished_without_main_power_as_long_as_the_dc_link_carries_it() {
        let mut machine = following();
        let lost = Conditions { fault: true, ..WITHOUT_MAINS };
        assert_eq!(machine.update(FOLLOW, lost), DriveState::FaultReaction);
        assert_eq!(status_bits(machine.state(), lost), 0xE000);
        assert_eq!(machine.update(FOLLOW, Conditions { standstill: true, ..lost }), DriveState::Engaging);
        let closing = Conditions { torque_off: false, ..lost };
        assert_eq!(machine.update(FOLLOW, closing), DriveState::Engaging, "the brake closes under torque");
        assert_eq!(status_bits(machine.state(), closing), 0xA000);
        assert_eq!(machine.update(FOLLOW, lost), DriveState::Fault);
        assert_eq!(status_bits(machine.state(), lost), 0x6000);
        let mut machine = following();
        assert_eq!(machine.update(ENABLED, READY), DriveState::SwitchingOff);
        assert_eq!(machine.update(ENABLED, WITHOUT_MAINS), DriveState::SwitchingOff);
        let empty = Conditions { sustained: false, fault: true, ..WITHOUT_MAINS };
        assert_eq!(machine.update(ENABLED, empty), DriveState::Fault);
    }

    #[test]
    fn an_edge_without_main_power_takes_up_no_stopped_axis_again() {
        let mut machine = following();
        let _ = machine.update(ENABLED, READY);
        assert_eq!(machine.update(FOLLOW, WITHOUT_MAINS), DriveState::SwitchingOff);
        assert_eq!(machine.update(FOLLOW, READY), DriveState::SwitchingOff, "the edge was another one");
        let closing = Conditions { standstill: true, torque_off: false, ..WITHOUT_MAINS };
        assert_eq!(machine.update(ENABLED, closing), DriveState::Engaging);
        assert_eq!(machine.update(FOLLOW, closing), DriveState::Engaging);
        assert_eq!(machine.update(FOLLOW, WITHOUT_MAINS), DriveState::Off);
        assert_eq!(machine.update(FOLLOW, READY), DriveState::Off);
    }

    #[test]
    fn drive_off_decelerates_first_and_halt_keeps_the_loop_closed() {
        let mut machine = following();
        assert_eq!(machine.update(HALT, READY), DriveState::Halted);
        assert_eq!(machine.update(FOLLOW, STANDING), DriveState::Following);
        assert_eq!(machine.update(ENABLED, READY), DriveState::SwitchingOff);
        assert_eq!(machine.update(ENABLED, READY), DriveState::SwitchingOff);
        assert_eq!(machine.update(ENABLED, STANDING), DriveState::Engaging);
        assert_eq!(machine.update(ENABLED, READY), DriveState::Off);
    }

    #[test]
    fn nothing_is_followed_before_the_brake_is_open_and_no_torque_goes_before_it_is_closed() {
        let mut machine = StateMachine::default();
        let closed = Conditions { released: false, torque_off: false, ..READY };
        let _ = machine.update(NONE, closed);
        for _ in 0..3 {
            assert_eq!(machine.update(FOLLOW, closed), DriveState::SwitchingOn);
        }
        assert_eq!(status_bits(DriveState::SwitchingOn, closed), 0x8000, "power applied, not in operation");
        assert_eq!(machine.update(FOLLOW, Conditions { released: true, ..closed }), DriveState::Following);
        let standing = Conditions { standstill: true, ..closed };
        assert_eq!(machine.update(ENABLED, standing), DriveState::SwitchingOff);
        assert_eq!(machine.update(ENABLED, standing), DriveState::Engaging);
        assert_eq!(machine.update(ENABLED, standing), DriveState::Engaging);
        assert_eq!(machine.update(FOLLOW, standing), DriveState::SwitchingOn, "wanted again before it had gone");
        assert_eq!(machine.update(ENABLED, standing), DriveState::Engaging, "and given up before it was released");
        assert_eq!(machine.update(ENABLED, Conditions { torque_off: true, ..standing }), DriveState::Off);
    }

    #[test]
    fn a_shaft_that_was_caught_at_speed_is_stopped_and_one_that_stands_is_let_go() {
        let caught = || {
            let mut machine = StateMachine::default();
            let _ = machine.update(NONE, READY);
            assert_eq!(machine.update(FOLLOW, READY), DriveState::SwitchingOn);
            machine
        };
        assert_eq!(caught().update(FOLLOW, FAULT), DriveState::FaultReaction);
        assert_eq!(caught().update(ENABLED, READY), DriveState::SwitchingOff);
        for conditions in [Conditions { fault: true, ..STANDING }, Conditions { released: false, ..FAULT }] {
            assert_eq!(caught().update(FOLLOW, conditions), DriveState::Engaging, "{conditions:?}");
        }
    }

    #[test]
    fn status_bits_follow_the_captured_words() {
        // 0x5801 and 0x9801 of a real ring: power missing, power applied (sercos2.md 1.7; bits 12, 11 and 0 are not ours).
        let no_power = Conditions { power: false, ..READY };
        assert_eq!(status_bits(DriveState::Off, no_power), 0x4000);
        assert_eq!(status_bits(DriveState::Off, READY), 0x8000);
        assert_eq!(status_bits(DriveState::Following, READY), 0xC008);
        assert_eq!(status_bits(DriveState::Halted, READY), 0xC000);
        assert_eq!(status_bits(DriveState::FaultReaction, FAULT), 0xE000);
        assert_eq!(status_bits(DriveState::Fault, Conditions { power: false, ..FAULT }), 0x6000);
    }

    /// One look: switches and conditions as they may come.
    fn look() -> impl Strategy<Value = (Switches, Conditions)> {
        let switches = (prop::bool::weighted(0.7), prop::bool::weighted(0.8), any::<bool>());
        let conditions = (
            (
                prop::bool::weighted(0.8),
                prop::bool::weighted(0.9),
                prop::bool::weighted(0.9),
                prop::bool::weighted(0.1),
            ),
            (prop::bool::weighted(0.3), any::<bool>(), any::<bool>(), any::<bool>()),
        );
        (switches, conditions).prop_map(|((on, enable, run), (outside, inside))| {
            let (operating_phase, sustained, mains, fault) = outside;
            let (grave, standstill, released, torque_off) = inside;
            let fatal = fault && grave;
            let power = sustained && mains;
            let conditions =
                Conditions { operating_phase, power, sustained, fault, fatal, standstill, released, torque_off };
            (Switches { on, enable, run }, conditions)
        })
    }

    proptest! {
        #[test]
        fn torque_comes_and_a_stop_ends_only_at_a_request_of_0_and_then_1_in_cp4_with_power_and_without_fault(
            looks in prop::collection::vec(look(), 1..200),
        ) {
            let mut machine = StateMachine::default();
            let mut seen_0 = false;
            for (switches, conditions) in looks {
                let before = machine.state();
                let state = machine.update(switches, conditions);
                let request = switches.on && switches.enable;
                let edge = seen_0 && request && conditions.operating_phase && conditions.power && !conditions.fault;
                let wants = |state| matches!(
                    state,
                    DriveState::SwitchingOn | DriveState::Following | DriveState::Halted
                );
                prop_assert!(wants(before) || !wants(state) || edge, "{before:?} to {state:?}: {switches:?}, {conditions:?}");
                prop_assert!(before.has_torque() || !state.has_torque() || edge, "{before:?} to {state:?}");
                // And it does come: the law is not kept by a drive that never starts.
                prop_assert!(!edge || before != DriveState::Off || state == DriveState::SwitchingOn);
                seen_0 = conditions.operating_phase && !request;
            }
        }
    }
}
