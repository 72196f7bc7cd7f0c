//! The MST: phase, window, misses, and what a cycle without one does. sercon816.md 5.7, 7.1, 7.2, 7.6, G27, G28.

use crate::chip_rig::{AT_HEADER, CYCLE, FIRST_MST, NMSTERR, Rig, with};
use ring::chip::{Alternatives, CounterEnd, TimersWithoutMst, TransmitWithoutMst};

const MSTEARLY: u16 = 1 << 7;
const MSTLATE: u16 = 1 << 8;
const MSTMISS: u16 = 1 << 9;
const PERIOD: u64 = CYCLE * 1_000;

#[test]
fn msts_in_time_raise_nothing_and_show_their_phase() {
    let mut rig = Rig::slave(Alternatives::default());
    for (cycle, phase) in (0..).zip([0, 0, 1, 2, 3, 4]) {
        rig.mst(FIRST_MST + cycle * PERIOD, phase);
        assert_eq!(rig.register(0x0B), u16::from(phase));
    }
    assert_eq!(rig.register(0x04), 0);
    assert_eq!(rig.ram(NMSTERR), 0);
}

#[test]
fn the_window_of_the_worked_values_reaches_from_6_us_early_to_8_us_late() {
    // JTSCYC 1996..2010, and an MST after 2000 us is recognised at a count of 2002.9.
    for (shift, flag) in [(-7, MSTEARLY), (-6, 0), (8, 0), (9, MSTLATE)] {
        let mut rig = Rig::slave(Alternatives::default());
        rig.set_register(0x0A, 3);
        rig.mst(FIRST_MST, 3);
        rig.mst((FIRST_MST + PERIOD).saturating_add_signed(shift * 1_000), 4);
        assert_eq!(rig.register(0x04) & !MSTMISS, flag, "{shift} us");
        let accepted = if flag == 0 { 4 } else { 3 };
        assert_eq!(rig.register(0x0B), accepted, "{shift} us");
    }
}

#[test]
fn below_cp3_an_early_mst_is_flagged_and_restarts_the_cycle() {
    let mut rig = Rig::slave(Alternatives::default());
    rig.set_register(0x1A, 300);
    rig.mst(FIRST_MST, 0);
    rig.mst(FIRST_MST + 1_000_000, 1);
    assert_eq!(rig.take_status(0x04), MSTEARLY);
    assert_eq!(rig.register(0x0B), 1);
    rig.take_status(0x05);
    rig.run_to(FIRST_MST + 1_299_999);
    assert_eq!(rig.register(0x05), 0);
    rig.run_to(FIRST_MST + 1_300_000);
    assert_eq!(rig.register(0x05), 1 << 8);
}

#[test]
fn a_missed_mst_is_counted_once_and_the_timers_keep_their_rhythm() {
    let mut rig = Rig::slave(Alternatives::default());
    rig.set_register(0x0A, 4);
    rig.set_register(0x1A, 300);
    rig.mst(FIRST_MST, 4);
    rig.run_to(FIRST_MST + PERIOD + 7_999);
    assert_eq!(rig.register(0x04), 0);
    rig.run_to(FIRST_MST + PERIOD + 11_000);
    assert_eq!(rig.take_status(0x04), MSTMISS);
    assert_eq!(rig.ram(NMSTERR), 1);
    rig.take_status(0x05);
    rig.run_to(FIRST_MST + PERIOD + 299_999);
    assert_eq!(rig.register(0x05), 0);
    rig.run_to(FIRST_MST + PERIOD + 300_000);
    assert_eq!(rig.register(0x05), 1 << 8);
    rig.mst(FIRST_MST + 2 * PERIOD, 4);
    assert_eq!(rig.register(0x04), 0, "the next MST is in time");
    assert_eq!(rig.ram(NMSTERR), 1);
}

#[test]
fn an_mst_right_behind_a_missed_one_is_late_and_in_cp4_taken_only_after_two_misses() {
    let mut rig = Rig::slave(Alternatives::default());
    rig.set_register(0x0A, 4);
    rig.mst(FIRST_MST, 4);
    rig.mst(FIRST_MST + PERIOD + 40_000, 0);
    assert_eq!(rig.take_status(0x04), MSTMISS | MSTLATE);
    assert_eq!(rig.register(0x0B), 4);
    rig.mst(FIRST_MST + 2 * PERIOD + 40_000, 0);
    assert_eq!(rig.take_status(0x04), MSTMISS | MSTLATE);
    assert_eq!(rig.register(0x0B), 0);
    rig.mst(FIRST_MST + 3 * PERIOD + 40_000, 1);
    assert_eq!(rig.register(0x04), 0, "synchronised to the new rhythm");
    assert_eq!(rig.ram(NMSTERR), 2);
}

#[test]
fn g27_the_error_counter_saturates_or_wraps() {
    for (error_counter_end, expected) in [(CounterEnd::Saturates, 0xFFFF), (CounterEnd::Wraps, 0)] {
        let mut rig = Rig::slave(with(|chip| chip.error_counter_end = error_counter_end));
        rig.set_ram(NMSTERR, &[0xFFFE]);
        rig.mst(FIRST_MST, 0);
        rig.run_to(FIRST_MST + 2 * PERIOD + 100_000);
        assert_eq!(rig.ram(NMSTERR), expected);
    }
}

#[test]
fn g28_a_cycle_without_mst_sends_or_not_and_has_timers_or_not() {
    for (transmit, sends) in [(TransmitWithoutMst::Suppressed, 0), (TransmitWithoutMst::Continues, 1)] {
        for (timers, event) in [(TimersWithoutMst::Fire, 1 << 8), (TimersWithoutMst::Silent, 0)] {
            let mut rig = Rig::slave(with(|chip| {
                chip.transmit_without_mst = transmit;
                chip.timers_without_mst = timers;
            }));
            rig.set_ram(AT_HEADER, &[0x5001]);
            rig.set_register(0x1A, 300);
            rig.mst(FIRST_MST, 0);
            rig.run_to(FIRST_MST + PERIOD + 100_000);
            rig.take_status(0x05);
            rig.sent.clear();
            rig.run_to(FIRST_MST + PERIOD + 1_000_000);
            assert_eq!(rig.sent.len(), sends, "{transmit:?} {timers:?}");
            assert_eq!(rig.register(0x05), event, "{transmit:?} {timers:?}");
            if sends == 1 {
                assert_eq!(rig.sent[0].0, FIRST_MST + PERIOD + 150_000);
            }
        }
    }
}

#[test]
fn without_a_cycle_time_nothing_is_missed() {
    let mut rig = Rig::slave(Alternatives::default());
    rig.set_register(0x0F, 0);
    rig.mst(FIRST_MST, 0);
    rig.run_to(FIRST_MST + 50 * PERIOD);
    assert_eq!(rig.register(0x04), 0);
}

#[test]
fn a_good_mst_ends_the_count_of_misses_in_a_row() {
    let mut rig = Rig::slave(Alternatives::default());
    rig.set_register(0x0A, 4);
    rig.mst(FIRST_MST, 4);
    rig.mst(FIRST_MST + 2 * PERIOD, 4);
    rig.mst(FIRST_MST + 3 * PERIOD + 40_000, 0);
    assert_eq!(rig.register(0x0B), 4, "one miss, one good, one miss: still synchronised");
}

#[test]
fn a_timer_of_ffffh_never_fires_even_where_nothing_restarts_the_counter() {
    let mut rig = Rig::slave(Alternatives::default());
    rig.set_register(0x0F, 0);
    rig.set_register(0x1B, 0xFFFE);
    rig.mst(FIRST_MST, 0);
    rig.run_to(FIRST_MST + 100_000_000);
    assert_eq!(rig.register(0x05) & 0x0F00, 1 << 9);
}
