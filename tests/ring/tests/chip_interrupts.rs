//! Events, enabling, routing and the interrupt outputs. sercon816.md 5.5, 5.6, G2, G4, G5, G11.

use crate::chip_rig::{CYCLE, FIRST_MST, Rig, with};
use ring::Nanoseconds;
use ring::chip::{
    Alternatives, EnableSense, EventMap, InterruptOutput, InterruptPin, InterruptPins, RoutingSense, TimerOrder,
    TimerZero,
};

const MICROSECOND: u64 = 1_000;

/// The flags of 05H in the order of their coming within one cycle, with microseconds after the MST.
fn events_of_a_cycle(rig: &mut Rig) -> Vec<(u64, u16)> {
    let mut events = Vec::new();
    rig.mst(FIRST_MST, 0);
    let flags = rig.take_status(0x05);
    if flags != 0 {
        events.push((0, flags));
    }
    for time in 1..CYCLE {
        rig.run_to(FIRST_MST + time * MICROSECOND);
        let flags = rig.take_status(0x05);
        if flags != 0 {
            events.push((time, flags));
        }
    }
    events
}

fn slave_with_timers(alternatives: Alternatives, times: [u16; 4]) -> Rig {
    let mut rig = Rig::slave(alternatives);
    for (register, time) in (0x1A..).zip(times) {
        rig.set_register(register, time);
    }
    rig
}

#[test]
fn timers_stand_still_before_the_first_mst() {
    let mut rig = slave_with_timers(Alternatives::default(), [100, 200, 300, 400]);
    rig.run_to(900_000);
    assert_eq!(rig.register(0x05), 0);
    assert_eq!(rig.chip.next_event(), None);
}

#[test]
fn g4_every_map_puts_the_events_where_it_says() {
    for (event_map, expected) in [
        (EventMap::Suggested, vec![(0, 1 << 12), (100, 1 << 8), (200, 1 << 9), (300, 1 << 10), (400, 1 << 11)]),
        (EventMap::Reversed, vec![(0, 1 << 11), (100, 1 << 15), (200, 1 << 14), (300, 1 << 13), (400, 1 << 12)]),
        (
            EventMap::Shifted,
            vec![(0, 1 << 8), (50, 1 << 13), (100, 1 << 9), (200, 1 << 10), (300, 1 << 11), (400, 1 << 12)],
        ),
        (EventMap::WithoutMst, vec![(100, 1 << 8), (200, 1 << 9), (300, 1 << 10), (400, 1 << 11)]),
    ] {
        let mut rig = slave_with_timers(with(|chip| chip.event_map = event_map), [100, 200, 300, 400]);
        assert_eq!(events_of_a_cycle(&mut rig), expected, "{event_map:?}");
    }
}

#[test]
fn g11_timer_registers_ascend_or_descend() {
    let mut rig = slave_with_timers(with(|chip| chip.timer_order = TimerOrder::Descending), [100, 200, 300, 400]);
    let events = events_of_a_cycle(&mut rig);
    assert_eq!(events, [(0, 1 << 12), (100, 1 << 11), (200, 1 << 10), (300, 1 << 9), (400, 1 << 8)]);
}

#[test]
fn g11_a_timer_of_zero_is_off_or_fires_at_the_mst_and_ffffh_never_fires() {
    for (timer_zero, at_mst) in [(TimerZero::Off, 1 << 12), (TimerZero::FiresAtMst, 1 << 12 | 1 << 8)] {
        let mut rig = slave_with_timers(with(|chip| chip.timer_zero = timer_zero), [0, 0xFFFF, 0xFFFF, 0xFFFF]);
        assert_eq!(events_of_a_cycle(&mut rig), [(0, at_mst)], "{timer_zero:?}");
    }
}

#[test]
fn a_timer_written_within_the_cycle_fires_only_if_its_time_is_to_come() {
    let mut rig = Rig::slave(Alternatives::default());
    rig.mst(FIRST_MST, 0);
    rig.run_to(FIRST_MST + 500 * MICROSECOND);
    rig.take_status(0x05);
    rig.set_register(0x1A, 499);
    rig.set_register(0x1B, 501);
    rig.run_to(FIRST_MST + 1_900 * MICROSECOND);
    assert_eq!(rig.register(0x05), 1 << 9);
}

#[test]
fn a_timer_comes_to_the_nanosecond_after_the_mst() {
    let mut rig = slave_with_timers(Alternatives::default(), [1_965, 0, 0, 0]);
    rig.mst(FIRST_MST, 0);
    rig.take_status(0x05);
    rig.run_to(FIRST_MST + 1_965 * MICROSECOND - 1);
    assert_eq!(rig.register(0x05), 0);
    rig.run_to(FIRST_MST + 1_965 * MICROSECOND);
    assert_eq!(rig.register(0x05), 1 << 8);
}

#[test]
fn g5_enable_and_routing_registers_work_in_either_sense() {
    for enable_sense in [EnableSense::OneEnables, EnableSense::ZeroEnables] {
        for routing_sense in [RoutingSense::ZeroIsInt0, RoutingSense::OneIsInt0] {
            for (enabled, routed) in [(false, false), (false, true), (true, false), (true, true)] {
                let mut rig = Rig::slave(with(|chip| {
                    chip.enable_sense = enable_sense;
                    chip.routing_sense = routing_sense;
                }));
                rig.set_register(0x06, if enable_sense == EnableSense::ZeroEnables { 0xFFFF } else { 0 });
                rig.set_register(
                    0x07,
                    if enabled == (enable_sense == EnableSense::OneEnables) { 1 << 12 } else { !(1 << 12) },
                );
                rig.set_register(0x09, u16::from(routed) << 12);
                rig.mst(FIRST_MST, 0);
                let to_int1 = routed == (routing_sense == RoutingSense::ZeroIsInt0);
                let active = InterruptPins { int0: !enabled || to_int1, int1: !enabled || !to_int1 };
                assert_eq!(rig.chip.interrupt_pins(), active, "{enable_sense:?} {routing_sense:?} {enabled} {routed}");
                assert_eq!(rig.register(0x05), 1 << 12, "the flag itself does not ask");
            }
        }
    }
}

#[test]
fn g2_a_level_output_stays_active_until_the_last_flag_is_cleared() {
    for (output, idle) in [(InterruptOutput::ActiveLowLevel, true), (InterruptOutput::ActiveHighLevel, false)] {
        let mut rig = slave_with_timers(with(|chip| chip.interrupt_output = output), [100, 0, 0, 0]);
        rig.set_register(0x07, 0xFFFF);
        assert_eq!(rig.chip.interrupt_pins(), InterruptPins { int0: idle, int1: idle });
        rig.mst(FIRST_MST, 0);
        rig.run_to(FIRST_MST + 150 * MICROSECOND);
        rig.set_register(0x05, 1 << 12);
        assert_eq!(rig.chip.interrupt_pins().int0, !idle);
        rig.set_register(0x05, 1 << 8);
        assert_eq!(rig.chip.interrupt_pins().int0, idle);
        let edges: Vec<_> = rig.chip.pin_edges().into_iter().map(|edge| (edge.time.0, edge.pin, edge.level)).collect();
        let cleared = FIRST_MST + 150 * MICROSECOND;
        assert_eq!(edges, [(FIRST_MST, InterruptPin::Int0, !idle), (cleared, InterruptPin::Int0, idle)]);
        assert!(rig.chip.pin_edges().is_empty());
    }
}

#[test]
fn g2_a_pulse_output_is_active_for_one_microsecond_whatever_software_does() {
    for (output, idle) in [(InterruptOutput::ActiveLowPulse, true), (InterruptOutput::ActiveHighPulse, false)] {
        let mut rig = slave_with_timers(with(|chip| chip.interrupt_output = output), [100, 0, 0, 0]);
        rig.set_register(0x07, 0xFFFF);
        rig.mst(FIRST_MST, 0);
        assert_eq!(rig.chip.interrupt_pins().int0, !idle);
        rig.run_to(FIRST_MST + 1_999 * MICROSECOND);
        assert_eq!(rig.chip.interrupt_pins().int0, idle, "nothing was cleared, the pulses are over");
        let edges: Vec<_> = rig.chip.pin_edges().into_iter().map(|edge| (edge.time, edge.level)).collect();
        let at = |microseconds: u64| Nanoseconds(FIRST_MST + microseconds * MICROSECOND);
        assert_eq!(edges, [(at(0), !idle), (at(1), idle), (at(100), !idle), (at(101), idle)]);
    }
}
