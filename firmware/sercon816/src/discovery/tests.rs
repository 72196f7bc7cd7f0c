//! Discovery against a small chip: timers, cycle events and a ring that comes and goes.

use std::vec::Vec;

use proptest::prelude::*;
use proptest::sample::{Index, subsequence};

use super::*;

/// A stretch of time in which MSTs come.
#[derive(Clone, Copy, Debug)]
struct Ring {
    from_us: u32,
    until_us: u32,
    cycle_us: u32,
}

#[derive(Clone, Debug)]
struct Chip {
    /// Bit of 05H's high byte for 1AH to 1DH; `None` is a register without a timer.
    timer_bits: [Option<u8>; 4],
    mst_bit: Option<u8>,
    con_clk: Option<(u8, u32)>,
    zero_fires_at_mst: bool,
    /// Without a ring the timers run in cycles of 65 ms.
    runs_alone: bool,
    /// Timer registers take effect at the next MST only.
    latches_timers: bool,
    rings: Vec<Ring>,
    timers: [u16; 4],
    timers_in_force: [u16; 4],
}

impl Chip {
    /// Events in `from..to`.
    fn events(&mut self, from: u32, to: u32) -> u8 {
        let alone = [Ring { from_us: 0, until_us: u32::MAX, cycle_us: 65_000 }];
        let ring = self.rings.iter().find(|ring| (ring.from_us..ring.until_us).contains(&from));
        let (ring, msts) = match ring {
            Some(ring) => (ring, true),
            None if self.runs_alone => (&alone[0], false),
            None => return 0,
        };
        let happens = |offset: u32| {
            offset < ring.cycle_us
                && (from..to).any(|time| time >= ring.from_us && (time - ring.from_us) % ring.cycle_us == offset)
        };
        if !self.latches_timers || happens(0) {
            self.timers_in_force = self.timers;
        }
        let mut events = 0;
        let mut at = |offset: u32, bit: Option<u8>| {
            if let (true, Some(bit)) = (happens(offset), bit) {
                events |= 1_u8 << bit;
            }
        };
        for (bit, time) in self.timer_bits.into_iter().zip(self.timers_in_force) {
            if time != 0 || self.zero_fires_at_mst {
                at(u32::from(time), bit);
            }
        }
        if msts {
            at(0, self.mst_bit);
            if let Some((bit, offset)) = self.con_clk {
                at(offset, Some(bit));
            }
        }
        events
    }

    fn carry_out(&mut self, orders: &Orders) {
        if let Some(watched) = orders.arm {
            for (register, time) in Register::TIMERS.into_iter().zip(&mut self.timers) {
                *time = if register == watched { 800 } else { 0xFFFF };
            }
        }
    }

    /// Ticks until the result is there; returns it with the time.
    fn discover(&mut self, tick_us: u32, limit_us: u32) -> Option<(TimerMap, u32)> {
        let mut discovery = Discovery::new();
        let mut now = 0;
        while now < limit_us {
            let events = self.events(now, now + tick_us);
            now += tick_us;
            let orders = discovery.tick(Observation { time_us: now, events, polled: events != 0, interrupted: true });
            assert_eq!(orders.enable, None);
            self.carry_out(&orders);
            if let Some(map) = orders.found {
                assert!(discovery.is_done());
                return Some((map, now));
            }
        }
        None
    }

    fn assert_right(&self, map: &TimerMap) {
        for timer in [map.command_valid, map.capture_feedback] {
            let index = Register::TIMERS.iter().position(|register| *register == timer.register).unwrap();
            assert_eq!(self.timer_bits[index].map(|bit| bit + 8), Some(timer.bit), "{map:?} of {self:?}");
        }
        assert_ne!(map.command_valid.register, map.capture_feedback.register);
    }

    fn own_events(&self) -> u16 {
        let mst = self.mst_bit.map_or(0, |bit| 0x100 << bit);
        mst | self.con_clk.map_or(0, |(bit, _)| 0x100 << bit)
    }
}

fn forever(from_us: u32, cycle_us: u32) -> Vec<Ring> {
    std::vec![Ring { from_us, until_us: u32::MAX, cycle_us }]
}

/// Any assignment of the bits; registers start as garbage.
fn any_chip(rings: Vec<Ring>) -> impl Strategy<Value = Chip> {
    let bits = subsequence((0..8_u8).collect::<Vec<_>>(), 6).prop_shuffle();
    (bits, any::<bool>(), any::<bool>(), 10_u32..600, any::<[bool; 3]>(), any::<[u16; 4]>()).prop_map(
        move |(bits, mst, con_clk, con_clk_time, [zero_fires_at_mst, runs_alone, latches_timers], timers)| Chip {
            timer_bits: [Some(bits[0]), Some(bits[1]), Some(bits[2]), Some(bits[3])],
            mst_bit: mst.then_some(bits[4]),
            con_clk: con_clk.then_some((bits[5], con_clk_time)),
            zero_fires_at_mst,
            runs_alone,
            latches_timers,
            rings: rings.clone(),
            timers,
            timers_in_force: timers,
        },
    )
}

fn suggested(rings: Vec<Ring>) -> Chip {
    Chip {
        timer_bits: [Some(0), Some(1), Some(2), Some(3)],
        mst_bit: Some(4),
        con_clk: None,
        zero_fires_at_mst: false,
        runs_alone: false,
        latches_timers: false,
        rings,
        timers: [0xFFFF; 4],
        timers_in_force: [0xFFFF; 4],
    }
}

#[test]
fn the_suggested_assignment_is_confirmed() {
    let (map, _) = suggested(forever(0, 2000)).discover(125, 1_000_000).unwrap();
    assert_eq!(map, crate::uncertain::ASSUMED_TIMERS);
}

#[test]
fn nothing_is_found_without_a_ring() {
    assert_eq!(suggested(Vec::new()).discover(125, 3_000_000), None);
}

#[test]
fn registers_without_a_timer_are_passed_over() {
    for dead in 0..4 {
        for mst_bit in [Some(4), None] {
            let mut chip = Chip { mst_bit, ..suggested(forever(0, 2000)) };
            chip.timer_bits[dead] = None;
            let (map, _) = chip.discover(125, 3_000_000).unwrap();
            chip.assert_right(&map);
        }
    }
}

#[test]
fn a_chip_that_ran_alone_does_not_delay_discovery_when_a_ring_starts() {
    for cycle_us in [2000, 10_000] {
        for start in [150_000, 200_000, 333_000, 500_000] {
            let mut chip = Chip { runs_alone: true, ..suggested(forever(start, cycle_us)) };
            let (map, found) = chip.discover(125, 3_000_000).unwrap();
            chip.assert_right(&map);
            assert!(found <= start + 12 * cycle_us, "{} us", found - start);
        }
    }
}

#[test]
fn a_timer_that_still_follows_its_old_time_in_the_first_cycle_is_waited_for() {
    let mut chip = Chip {
        timer_bits: [Some(0), Some(1), Some(3), Some(4)],
        mst_bit: None,
        con_clk: Some((6, 166)),
        latches_timers: true,
        timers: [0, 0, 950, 0],
        timers_in_force: [0, 0, 950, 0],
        ..suggested(forever(10_489, 1000))
    };
    let (map, found) = chip.discover(123, 1_000_000).unwrap();
    chip.assert_right(&map);
    assert!(found <= 10_489 + 10 * 1000, "{found} us");
}

#[test]
fn enable_bits_are_doubted_only_without_interrupts_and_both_senses_are_tried() {
    let mut discovery = Discovery::new();
    let mut orders = Vec::new();
    for tick in 0..40 {
        let seen = Observation { time_us: tick * 125, events: 0, polled: tick % 2 == 0, interrupted: false };
        orders.extend(discovery.tick(seen).enable);
    }
    assert_eq!(orders, [0x0000, 0xFFFF]);
    let mut discovery = Discovery::new();
    for tick in 0..40 {
        let seen = Observation { time_us: tick * 125, events: 0, polled: true, interrupted: tick == 2 };
        assert_eq!(discovery.tick(seen).enable, None);
    }
}

#[test]
fn discovery_survives_the_wrap_of_its_clock() {
    let mut chip = suggested(forever(0, 10_000));
    let mut discovery = Discovery::new();
    let mut now = 0;
    let found = loop {
        let events = chip.events(now, now + 125);
        now += 125;
        let time_us = now.wrapping_sub(30_000);
        let orders = discovery.tick(Observation { time_us, events, polled: false, interrupted: true });
        chip.carry_out(&orders);
        if orders.found.is_some() {
            break now;
        }
    };
    assert!(found <= 100_000, "{found} us");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn any_assignment_is_found_within_ten_cycles(
        chip in any_chip(Vec::new()),
        cycle_us in prop_oneof![Just(2000_u32), Just(10_000), 1000..65_000_u32],
        start_us in 0_u32..30_000,
        tick_us in 120_u32..130,
    ) {
        let mut chip = Chip { rings: forever(start_us, cycle_us), runs_alone: false, ..chip };
        let (map, time) = chip.discover(tick_us, 2_000_000).unwrap();
        chip.assert_right(&map);
        prop_assert_eq!(map.cycle_bits, chip.own_events());
        prop_assert!(time <= start_us + 10 * cycle_us, "{} us", time - start_us);
    }

    #[test]
    fn a_ring_that_stops_and_starts_again_never_leads_to_a_wrong_result(
        chip in any_chip(Vec::new()),
        cycles in proptest::collection::vec(1000_u32..12_000, 1..5),
        stops in proptest::collection::vec((1_u32..9, 0_u32..40_000), 5),
        last in any::<Index>(),
    ) {
        let mut rings = Vec::new();
        let mut time = 0;
        for (cycle_us, (count, gap)) in cycles.iter().copied().zip(stops) {
            let until_us = time + count * cycle_us + 1;
            rings.push(Ring { from_us: time, until_us, cycle_us });
            time = until_us + gap;
        }
        rings.push(Ring { from_us: time, until_us: u32::MAX, cycle_us: cycles[last.index(cycles.len())] });
        let mut chip = Chip { rings, ..chip };
        let (map, _) = chip.discover(125, 5_000_000).expect("found once the ring stays");
        chip.assert_right(&map);
    }
}
