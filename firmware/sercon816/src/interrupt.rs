//! What the chip wants: the two status registers read, acknowledged and sorted.

use crate::bus::{Bus, Register};
use crate::discovery::Orders;
use crate::status::{ErrorStatus, InterruptStatus};
use crate::timer::TimerMap;
use crate::uncertain::{
    ASSUMED_TIMERS, ENABLE_ALL, INITIAL_COMMAND_VALID_US, INTERRUPT_ROUNDS, ROUTING, TIMER_NEVER_US,
};

/// What happened since the status registers were read last.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Events {
    /// Service container 0 waits.
    pub service_channel: bool,
    /// The t3 timer: the command values are valid; in CP1 and CP2 the MDT is over.
    pub command_valid: bool,
    /// The t4 timer: the feedback value is to be captured.
    pub capture_feedback: bool,
    /// Another event that comes in every cycle, such as the MST.
    pub cycle: bool,
    /// The high byte of 05H as it was, for [`crate::Discovery`].
    pub raw: u8,
    /// 04H as it was.
    pub errors: ErrorStatus,
}

impl Events {
    /// Nothing that anybody waits for.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        *self == Self::default()
    }
}

/// Events that hardware beside the chip has latched something at, not acknowledged yet.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Seen {
    /// The t3 timer.
    pub command_valid: bool,
    /// The t4 timer.
    pub capture_feedback: bool,
}

/// The handler of both interrupt lines, and the poll of the loop timer.
#[derive(Debug)]
pub struct Interrupts<B> {
    bus: B,
    timers: TimerMap,
    /// The value of 06H and 07H that enables, as far as is known.
    enabled: u16,
    errors_masked: bool,
}

impl<B: Bus> Interrupts<B> {
    /// A handler that assumes [`ASSUMED_TIMERS`] until told better.
    pub const fn new(bus: B) -> Self {
        Self { bus, timers: ASSUMED_TIMERS, enabled: ENABLE_ALL, errors_masked: false }
    }

    /// The timers as they are known now.
    #[must_use]
    pub const fn timers(&self) -> TimerMap {
        self.timers
    }

    /// Enables and routes every source; after the chip was initialised.
    pub fn enable(&mut self) {
        self.write_enable(ENABLE_ALL);
        self.bus.write_register(Register::ERROR_ROUTING, ROUTING);
        self.bus.write_register(Register::INTERRUPT_ROUTING, ROUTING);
    }

    /// Takes the conditions of 04H off the lines, once it is known which value enables: one that persists (a dark fibre)
    /// would hold a level output, and no further event would make an edge. From then on 04H is not read any more either.
    pub fn mask_errors(&mut self) {
        self.errors_masked = true;
        self.bus.write_register(Register::ERROR_ENABLE, !self.enabled);
    }

    /// Whether [`Interrupts::mask_errors`] was called.
    pub const fn errors_are_masked(&self) -> bool {
        self.errors_masked
    }

    /// Reads and acknowledges until nothing is pending, at most [`INTERRUPT_ROUNDS`] times; `None` if nothing was.
    ///
    /// `seen` is called with the events of a round before they are acknowledged, which makes another edge on the line: time to look at what the
    /// hardware has latched at their own. 3 accesses for one event once the errors are masked, before that 5 to 7, for nothing 1 or 2. Nothing
    /// gets lost between the lines' edges: a flag that comes while this runs is either found in the next round or sets the line again.
    #[inline(always)]
    pub fn take(&mut self, mut seen: impl FnMut(Seen)) -> Option<Events> {
        if !self.errors_masked {
            return self.take_with_errors(seen);
        }
        let mut status = 0;
        for _ in 0..INTERRUPT_ROUNDS {
            let new_status = self.bus.read_register(Register::INTERRUPT_STATUS);
            if new_status == 0 {
                break;
            }
            self.show(new_status, &mut seen);
            self.bus.write_register(Register::INTERRUPT_STATUS, new_status);
            status |= new_status;
        }
        if status == 0 { None } else { Some(self.sorted(status, 0)) }
    }

    /// [`Interrupts::take`] until [`Interrupts::mask_errors`], when nothing is in a hurry yet.
    #[inline(never)]
    fn take_with_errors(&mut self, mut seen: impl FnMut(Seen)) -> Option<Events> {
        let mut status = 0;
        let mut errors = 0;
        for _ in 0..INTERRUPT_ROUNDS {
            let new_errors = self.bus.read_register(Register::ERROR_STATUS);
            let new_status = self.bus.read_register(Register::INTERRUPT_STATUS);
            if new_errors == 0 && new_status == 0 {
                break;
            }
            self.show(new_status, &mut seen);
            if new_errors != 0 {
                self.bus.write_register(Register::ERROR_STATUS, new_errors);
            }
            if new_status != 0 {
                self.bus.write_register(Register::INTERRUPT_STATUS, new_status);
            }
            errors |= new_errors;
            status |= new_status;
        }
        (status != 0 || errors != 0).then(|| self.sorted(status, errors))
    }

    #[inline]
    fn show(&self, status: u16, seen: &mut impl FnMut(Seen)) {
        seen(Seen {
            command_valid: status & self.timers.command_valid.mask() != 0,
            capture_feedback: status & self.timers.capture_feedback.mask() != 0,
        });
    }

    #[inline]
    fn sorted(&self, status: u16, errors: u16) -> Events {
        let events = InterruptStatus::new_with_raw_value(status);
        Events {
            service_channel: events.service_container(0),
            command_valid: status & self.timers.command_valid.mask() != 0,
            capture_feedback: status & self.timers.capture_feedback.mask() != 0,
            cycle: status & self.timers.cycle_bits != 0,
            raw: events.events(),
            errors: ErrorStatus::new_with_raw_value(errors),
        }
    }

    /// Does what [`crate::Discovery`] asks for. Not to be called with orders from before the chip was initialised.
    pub fn carry_out(&mut self, orders: &Orders) {
        if let Some(value) = orders.enable {
            self.write_enable(value);
        }
        if let Some(watched) = orders.arm {
            for register in Register::TIMERS {
                let time = if register == watched { INITIAL_COMMAND_VALID_US } else { TIMER_NEVER_US };
                self.bus.write_register(register, time);
            }
        }
        if let Some(timers) = orders.found {
            self.timers = timers;
            // Apart from all others, so that an event that is still pending never hides the edge at which t4 latches the encoder.
            self.bus.write_register(Register::INTERRUPT_ROUTING, ROUTING ^ timers.capture_feedback.mask());
            timers.program(&mut self.bus, Some(INITIAL_COMMAND_VALID_US), None);
        }
    }

    fn write_enable(&mut self, value: u16) {
        self.enabled = value;
        self.bus.write_register(Register::ERROR_ENABLE, value);
        self.bus.write_register(Register::INTERRUPT_ENABLE, value);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_bus::{TestBus, Write};
    use crate::timer::Timer;

    #[test]
    fn events_are_sorted_acknowledged_and_gone() {
        let bus = TestBus::new();
        let mut interrupts = Interrupts::new(bus.clone());
        bus.set_register(5, 0x1401);
        bus.set_register(4, 0x0200);
        let events = interrupts.take(|_| {}).unwrap();
        assert!(events.service_channel && events.command_valid && events.cycle && !events.capture_feedback);
        assert!(events.errors.mst_missing());
        assert_eq!(events.raw, 0x14);
        assert_eq!(bus.take_writes(), [Write::Register(4, 0x0200), Write::Register(5, 0x1401)]);
        assert_eq!(interrupts.take(|_| {}), None);
    }

    #[test]
    fn flags_that_come_meanwhile_are_added_to_those_already_taken() {
        for (register, bits) in [(5, 0x0800), (4, 0x0001)] {
            let bus = TestBus::new();
            bus.set_register(5, 0x0001);
            bus.set_register(4, 0x0002);
            bus.0.borrow_mut().late = Some((register, bits));
            let events = Interrupts::new(bus.clone()).take(|_| {}).unwrap();
            assert!(events.service_channel && events.errors.fibre_break());
            assert_eq!((events.capture_feedback, events.errors.distorted()), (register == 5, register == 4));
        }
    }

    #[test]
    fn every_event_is_shown_before_it_is_acknowledged_and_in_its_round() {
        let bus = TestBus::new();
        bus.set_register(5, 0x0401);
        bus.0.borrow_mut().late = Some((5, 0x0800));
        let mut rounds = std::vec::Vec::new();
        let events = Interrupts::new(bus.clone()).take(|seen| {
            rounds.push((seen.command_valid, seen.capture_feedback, bus.register(5)));
        });
        assert_eq!(rounds, [(true, false, 0x0401), (false, true, 0x0800)]);
        assert!(events.is_some_and(|events| events.command_valid && events.capture_feedback));
    }

    #[test]
    fn a_line_with_nothing_behind_it_costs_one_access_once_the_errors_are_masked() {
        let bus = TestBus::new();
        let mut interrupts = Interrupts::new(bus.clone());
        interrupts.mask_errors();
        bus.take_accesses();
        assert_eq!(interrupts.take(|_| unreachable!("nothing happened")), None);
        assert_eq!(bus.take_accesses(), 1);
    }

    #[test]
    fn other_service_containers_are_acknowledged_and_ignored() {
        let bus = TestBus::new();
        bus.set_register(5, 0x00FE);
        let events = Interrupts::new(bus.clone()).take(|_| {}).unwrap();
        assert!(!events.service_channel && events.is_empty());
        assert_eq!(bus.register(5), 0);
    }

    #[test]
    fn a_condition_that_persists_does_not_hold_the_handler() {
        let bus = TestBus::new();
        bus.0.borrow_mut().persistent = (4, 0x0002);
        bus.set_register(4, 0x0002);
        let events = Interrupts::new(bus.clone()).take(|_| {}).unwrap();
        assert!(events.errors.fibre_break());
        assert_eq!(bus.take_accesses(), 4 * 3);
    }

    #[test]
    fn learned_timers_replace_the_assumed_ones() {
        let bus = TestBus::new();
        let mut interrupts = Interrupts::new(bus.clone());
        let found = TimerMap {
            command_valid: Timer { register: Register::TIMER_1, bit: 15 },
            capture_feedback: Timer { register: Register::TIMER_0, bit: 8 },
            cycle_bits: 0,
        };
        interrupts.carry_out(&Orders { found: Some(found), ..Orders::default() });
        assert_eq!([0x1A, 0x1B, 0x1C, 0x1D].map(|word| bus.register(word)), [0xFFFF, 800, 0xFFFF, 0xFFFF]);
        bus.set_register(5, 0x8400);
        let events = interrupts.take(|_| {}).unwrap();
        assert!(events.command_valid && !events.capture_feedback && !events.cycle);
    }

    #[test]
    fn a_watched_timer_is_the_only_one_programmed() {
        let bus = TestBus::new();
        let mut interrupts = Interrupts::new(bus.clone());
        interrupts.carry_out(&Orders { arm: Some(Register::TIMER_3), enable: Some(0), found: None });
        assert_eq!([0x1A, 0x1B, 0x1C, 0x1D].map(|word| bus.register(word)), [0xFFFF, 0xFFFF, 0xFFFF, 800]);
        assert_eq!((bus.register(6), bus.register(7)), (0, 0));
        interrupts.mask_errors();
        assert_eq!((bus.register(6), bus.register(7)), (0xFFFF, 0));
        interrupts.enable();
        assert_eq!([6, 7, 8, 9].map(|word| bus.register(word)), [0xFFFF, 0xFFFF, 0, 0]);
        interrupts.mask_errors();
        assert_eq!((bus.register(6), bus.register(7)), (0, 0xFFFF));
    }

    #[test]
    fn the_timer_that_latches_has_a_line_of_its_own_once_it_is_known() {
        let bus = TestBus::new();
        let mut interrupts = Interrupts::new(bus.clone());
        let found = TimerMap {
            command_valid: Timer { register: Register::TIMER_0, bit: 15 },
            capture_feedback: Timer { register: Register::TIMER_1, bit: 14 },
            cycle_bits: 0x0100,
        };
        interrupts.carry_out(&Orders { arm: None, enable: None, found: Some(found) });
        assert_eq!(bus.register(9), 0x4000);
    }
}
