//! Telegram headers and data containers: what is sent, what is taken, what counts as an error.
//! sercon816.md 6.2, 6.3, 7.3, 7.4, G7, G16, G17, G18, G26, G32, G33.

use crate::chip_rig::{AT_HEADER, AT_STATUS, CYCLE, FIRST_MST, MDT_CONTROL, MDT_HEADER, Rig, with};
use ring::chip::{
    Alternatives, BlockSelect, Delivery, ErrorBit, OneShot, ProcessingEnable, Rearm, TelegramErrorFlag, WindowSign,
};

const PERIOD: u64 = CYCLE * 1_000;
const VAL: u16 = 1 << 10;
const RERR: u16 = 1 << 13;
const MDT_ERRORS: u16 = MDT_HEADER + 4;

fn val(rig: &mut Rig) -> bool {
    rig.ram(MDT_HEADER) & VAL != 0
}

#[test]
fn an_armed_at_is_sent_at_t1_with_the_service_bits_laid_over_status_and_info() {
    let mut rig = Rig::slave(Alternatives::default());
    rig.set_ram(AT_HEADER, &[0x5001]);
    rig.set_ram(AT_STATUS, &[0xA5AF, 0xFFFF]);
    rig.mst(FIRST_MST, 2);
    rig.run_to(FIRST_MST + 400_000);
    // Service container word 0 and the info behind it are 0: handshake, busy, error (2..0) and command change (5) are the chip's.
    assert_eq!(rig.sent, [(FIRST_MST + 150_000, vec![1, 0x88, 0xA5, 0, 0])]);
}

#[test]
fn the_repeater_is_out_while_the_chip_sends() {
    let mut rig = Rig::slave(Alternatives::default());
    rig.set_ram(AT_HEADER, &[0x5001]);
    rig.mst(FIRST_MST, 2);
    rig.run_to(FIRST_MST + 150_000);
    assert!(rig.chip.is_transmitting() && !rig.chip.repeater_on());
    rig.run_to(FIRST_MST + 250_000);
    assert!(!rig.chip.is_transmitting() && rig.chip.repeater_on());
}

#[test]
fn g16_a_once_header_sends_once_or_until_software_clears_it() {
    for (one_shot, sent, word) in [(OneShot::AutoClear, 1, 0x4001), (OneShot::Stays, 3, 0x4801)] {
        let mut rig = Rig::slave(with(|chip| chip.one_shot = one_shot));
        rig.set_ram(AT_HEADER, &[0x4801]);
        rig.cycles(3, 2);
        rig.run_to(FIRST_MST + 2 * PERIOD + 400_000);
        assert_eq!(rig.sent.len(), sent, "{one_shot:?}");
        assert_eq!(rig.ram(AT_HEADER), word, "{one_shot:?}");
    }
}

#[test]
fn headers_are_walked_only_once_processing_is_enabled() {
    for (processing_enable, command, sent) in [
        (ProcessingEnable::Bit8Of03H, 0x0000, 0),
        (ProcessingEnable::Bit8Of03H, 0x0100, 1),
        (ProcessingEnable::Always, 0x0000, 1),
    ] {
        let mut rig = Rig::slave(with(|chip| chip.processing_enable = processing_enable));
        rig.set_register(0x03, command);
        rig.set_ram(AT_HEADER, &[0x5001]);
        rig.mst(FIRST_MST, 2);
        rig.run_to(FIRST_MST + 400_000);
        assert_eq!(rig.sent.len(), sent, "{processing_enable:?} {command:x}");
    }
}

#[test]
fn g7_the_block_is_selected_by_03h_or_0ah_or_not_at_all() {
    for (block_select, command, phase, block) in [
        (BlockSelect::Bit2Of03H, 0x0100, 3, 0),
        (BlockSelect::Bit2Of03H, 0x0104, 0, 1),
        (BlockSelect::PhaseIn0AH, 0x0104, 2, 0),
        (BlockSelect::PhaseIn0AH, 0x0100, 3, 1),
        (BlockSelect::AlwaysBlock0, 0x0104, 3, 0),
    ] {
        let mut rig = Rig::slave(with(|chip| chip.block_select = block_select));
        rig.set_register(0x03, command);
        rig.set_register(0x0A, phase);
        rig.set_ram(0x01, &[0x30]);
        rig.set_ram(AT_HEADER, &[0x5001]);
        rig.set_ram(0x30, &[0x5002, 160, 2, 0x22, 0x8002, 0x1111, 0x2222]);
        rig.mst(FIRST_MST, phase as u8);
        rig.run_to(FIRST_MST + 400_000);
        assert_eq!(rig.sent.len(), 1);
        assert_eq!(u16::from(rig.sent[0].1[0]), 1 + block, "{block_select:?} {command:x} {phase}");
    }
}

#[test]
fn an_mdt_to_this_drive_is_copied_and_marked_valid_at_its_end() {
    let mut rig = Rig::slave(Alternatives::default());
    rig.mst(FIRST_MST, 2);
    rig.run_to(FIRST_MST + 600_000);
    assert!(!val(&mut rig));
    rig.mdt(FIRST_MST, 0xE000, 0xBEEF);
    assert!(val(&mut rig));
    assert_eq!((rig.ram(MDT_CONTROL), rig.ram(MDT_CONTROL + 1)), (0xE000, 0xBEEF));
    assert_eq!(rig.ram(MDT_ERRORS), 0);
}

#[test]
fn a_telegram_to_another_drive_is_passed_over_without_an_error() {
    let mut rig = Rig::slave(Alternatives::default());
    rig.mst(FIRST_MST, 2);
    rig.telegram(FIRST_MST + 510_000, &[2, 1, 2, 3, 4]);
    assert_eq!((val(&mut rig), rig.ram(MDT_ERRORS)), (false, 0));
    rig.mdt(FIRST_MST, 0x1000, 0);
    assert!(val(&mut rig), "the header still waited");
}

#[test]
fn without_address_check_any_address_is_taken_and_stored() {
    let mut rig = Rig::slave(Alternatives::default());
    rig.set_ram(MDT_HEADER, &[0x1000]);
    rig.mst(FIRST_MST, 2);
    rig.telegram(FIRST_MST + 510_000, &[0x42, 1, 2, 3, 4]);
    assert_eq!(rig.ram(MDT_HEADER), 0x1042 | VAL);
}

#[test]
fn wrong_length_damage_and_a_wrong_time_count_once_a_cycle_and_clear_val() {
    for case in ["long", "short", "damaged", "early"] {
        let mut rig = Rig::slave(Alternatives::default());
        rig.set_ram(MDT_HEADER, &[0x1801 | VAL]);
        rig.mst(FIRST_MST, 2);
        match case {
            "long" => rig.telegram(FIRST_MST + 600_000, &[1, 1, 2, 3, 4, 5, 6]),
            "short" => rig.telegram(FIRST_MST + 600_000, &[1, 1, 2]),
            "damaged" => rig.damaged_telegram(FIRST_MST + 600_000, &[1, 1, 2, 3, 4]),
            _ => rig.telegram(FIRST_MST + 300_000, &[1, 1, 2, 3, 4]),
        };
        assert!(!val(&mut rig), "{case}");
        assert_eq!(rig.ram(MDT_ERRORS), 1, "{case}");
        assert_ne!(rig.ram(MDT_HEADER) & RERR, 0, "{case}");
        rig.run_to(FIRST_MST + PERIOD - 30_000);
        assert_eq!(rig.ram(MDT_ERRORS), 1, "{case}: not once more at the end of the window");
        rig.mst(FIRST_MST + PERIOD, 2);
        rig.mdt(FIRST_MST + PERIOD, 0, 0);
        assert_eq!(rig.ram(MDT_HEADER) & (RERR | VAL), VAL, "{case}: good again");
    }
}

#[test]
fn a_telegram_that_does_not_come_in_its_window_counts_as_lost_and_leaves_val() {
    let mut rig = Rig::slave(Alternatives::default());
    rig.mst(FIRST_MST, 2);
    rig.run_to(FIRST_MST + 720_000);
    assert_eq!(rig.ram(MDT_ERRORS), 0);
    rig.run_to(FIRST_MST + 721_000);
    assert_eq!(rig.ram(MDT_ERRORS), 1);
    assert_eq!(rig.ram(MDT_HEADER), 0x1801);
}

#[test]
fn a_telegram_that_starts_in_the_window_may_end_after_it() {
    let mut rig = Rig::slave(Alternatives::default());
    rig.set_register(0x19, 23);
    rig.mst(FIRST_MST, 2);
    rig.telegram(FIRST_MST + 508_000, &[1, 0, 0, 7, 0]);
    assert_eq!((val(&mut rig), rig.ram(MDT_ERRORS)), (true, 0));
    rig.mst(FIRST_MST + PERIOD, 2);
    rig.telegram(FIRST_MST + PERIOD + 511_000, &[1, 0, 0, 7, 0]);
    assert_eq!((val(&mut rig), rig.ram(MDT_ERRORS)), (false, 1));
}

#[test]
fn the_time_window_reaches_from_jtrdel1_to_jtrdel2_around_the_recognition_time() {
    // sercon816.md 14, G25, 2 Mbit/s: JTRDEL1 = 6, JTRDEL2 = 23, recognition 14.8 us after the start.
    for (shift, taken) in [(-10_000, false), (-8_000, true), (0, true), (9_000, true), (10_000, false)] {
        let mut rig = Rig::slave(Alternatives::default());
        rig.set_register(0x18, 6);
        rig.set_register(0x19, 23);
        rig.mst(FIRST_MST, 2);
        rig.telegram((FIRST_MST + 500_000).saturating_add_signed(shift), &[1, 0, 0, 7, 0]);
        assert_eq!(val(&mut rig), taken, "{shift} ns");
    }
}

#[test]
fn g26_a_negative_lower_edge_shuts_the_window_where_jtrdel_is_unsigned() {
    for (window_sign, lower, taken) in
        [(WindowSign::Signed, 0xFFFD, true), (WindowSign::Unsigned, 0xFFFD, false), (WindowSign::Unsigned, 0, true)]
    {
        let mut rig = Rig::slave(with(|chip| chip.window_sign = window_sign));
        rig.set_register(0x18, lower);
        rig.mst(FIRST_MST, 2);
        rig.mdt(FIRST_MST, 0, 0);
        assert_eq!(val(&mut rig), taken, "{window_sign:?} {lower:x}");
    }
}

#[test]
fn g17_a_header_takes_one_telegram_after_the_other_or_waits_to_be_written() {
    for (rearm, again) in [(Rearm::Continuous, true), (Rearm::EachTelegram, false)] {
        let mut rig = Rig::slave(with(|chip| chip.rearm = rearm));
        rig.mst(FIRST_MST, 2);
        rig.mdt(FIRST_MST, 0, 1);
        rig.mst(FIRST_MST + PERIOD, 2);
        rig.mdt(FIRST_MST + PERIOD, 0, 2);
        assert_eq!(rig.ram(MDT_CONTROL + 1) == 2, again, "{rearm:?}");
        rig.set_ram(MDT_HEADER, &[0x1801]);
        rig.mst(FIRST_MST + 2 * PERIOD, 2);
        rig.mdt(FIRST_MST + 2 * PERIOD, 0, 3);
        assert_eq!(rig.ram(MDT_CONTROL + 1), 3, "{rearm:?}: rewritten");
        assert!(val(&mut rig));
    }
}

#[test]
fn g18_and_g32_what_a_telegram_error_sets() {
    for (error_bit, header) in [(ErrorBit::SetOnError, RERR), (ErrorBit::Untouched, 0)] {
        for (flag, status) in [(TelegramErrorFlag::None, 0), (TelegramErrorFlag::Bit10, 1 << 10)] {
            let mut rig = Rig::slave(with(|chip| {
                chip.error_bit = error_bit;
                chip.telegram_error_flag = flag;
            }));
            rig.mst(FIRST_MST, 2);
            rig.damaged_telegram(FIRST_MST + 600_000, &[1, 0, 0, 0, 0]);
            assert_eq!(rig.ram(MDT_HEADER) & RERR, header);
            assert_eq!(rig.register(0x04), status);
        }
    }
}

#[test]
fn g33_val_falls_at_the_start_of_the_telegram_or_not() {
    for (delivery, meanwhile) in [(Delivery::AtEnd, true), (Delivery::Progressive, false)] {
        let mut rig = Rig::slave(with(|chip| chip.delivery = delivery));
        rig.set_ram(MDT_HEADER, &[0x1801 | VAL]);
        rig.mst(FIRST_MST, 2);
        rig.run_to(FIRST_MST + 604_000);
        rig.chip.on_telegram_start(rig.now);
        assert_eq!(val(&mut rig), meanwhile, "{delivery:?}");
        rig.mdt(FIRST_MST, 0, 0);
        assert!(val(&mut rig), "{delivery:?}");
    }
}

#[test]
fn containers_take_their_part_of_the_telegram_by_position_and_length() {
    let mut rig = Rig::slave(Alternatives::default());
    let mdt: Vec<u8> = [255].into_iter().chain((0..16u16).flat_map(|word| (0x1000 + word).to_le_bytes())).collect();
    rig.set_ram(MDT_HEADER, &[0x18FF, 500, 16, 0x22, 0]);
    rig.set_ram(0x22, &[0xC000, 1_900]);
    rig.set_ram(MDT_HEADER + 5, &[0x0001, 12, 0, 0x8003, 4, 0, 0, 0]);
    // The second container reaches over the end marker's place: move that.
    rig.set_ram(MDT_HEADER + 3, &[0x40]);
    rig.set_ram(0x40, &[0xC000, 1_900]);
    rig.mst(FIRST_MST, 3);
    rig.telegram(FIRST_MST + 500_000, &mdt);
    assert_eq!(rig.ram(MDT_HEADER + 7), 0x100C);
    let second: Vec<u16> = (0..3).map(|word| rig.ram(MDT_HEADER + 10 + word)).collect();
    assert_eq!(second, [0x1004, 0x1005, 0x1006]);
}

#[test]
fn a_double_buffered_header_fills_the_buffers_in_turn_and_val_names_the_new_one() {
    let mut rig = Rig::slave(Alternatives::default());
    rig.set_ram(MDT_HEADER, &[0x1A01, 500, 2, 0x40, 0, 0x8002, 0, 0, 0, 0, 0]);
    rig.set_ram(0x40, &[0xC000, 1_900]);
    for (cycle, info, buffer) in [(0, 0x1111, 1), (1, 0x2222, 0), (2, 0x3333, 1)] {
        rig.mst(FIRST_MST + cycle * PERIOD, 2);
        rig.mdt(FIRST_MST + cycle * PERIOD, 0, info);
        assert_eq!(u16::from(val(&mut rig)), buffer);
        assert_eq!(rig.ram(MDT_CONTROL + 2 * buffer + 1), info);
    }
    rig.mst(FIRST_MST + 3 * PERIOD, 2);
    rig.damaged_telegram(FIRST_MST + 3 * PERIOD + 600_000, &[1, 0, 0, 0, 0]);
    assert!(val(&mut rig), "the last good buffer stays named");
}

#[test]
fn a_header_armed_after_its_time_waits_for_the_next_cycle() {
    let mut rig = Rig::slave(Alternatives::default());
    rig.mst(FIRST_MST, 2);
    rig.run_to(FIRST_MST + 160_000);
    rig.set_ram(AT_HEADER, &[0x4801]);
    rig.run_to(FIRST_MST + PERIOD - 30_000);
    assert!(rig.sent.is_empty());
    rig.mst(FIRST_MST + PERIOD, 2);
    rig.run_to(FIRST_MST + PERIOD + 400_000);
    assert_eq!(rig.sent.len(), 1);
}

#[test]
fn garbage_and_circular_chains_do_not_hang_the_chip() {
    for seed in 0..200 {
        let mut chip = ring::chip::Chip::new(Alternatives::default(), seed);
        let zero = ring::Nanoseconds::ZERO;
        chip.write_register(zero, 0x03, 0x0100);
        chip.write_register(zero, 0x0E, 0x051F);
        chip.on_telegram(zero, ring::Nanoseconds(24_500), Ok(&[255, 0]));
        for _ in 0..2_000 {
            let Some(time) = chip.next_event() else { break };
            chip.on_time(time);
        }
    }
    let mut rig = Rig::slave(Alternatives::default());
    rig.set_ram(AT_HEADER, &[0x4001, 0, 2, AT_HEADER]);
    rig.mst(FIRST_MST, 0);
    rig.run_to(FIRST_MST + PERIOD);
}

#[test]
fn two_damaged_telegrams_of_one_cycle_count_once() {
    let mut rig = Rig::slave(Alternatives::default());
    rig.mst(FIRST_MST, 2);
    rig.damaged_telegram(FIRST_MST + 510_000, &[1, 0, 0, 0, 0]);
    rig.damaged_telegram(FIRST_MST + 600_000, &[1, 0, 0, 0, 0]);
    assert_eq!(rig.ram(MDT_ERRORS), 1);
}

#[test]
fn a_transmit_header_behind_a_later_one_is_too_late() {
    let mut rig = Rig::slave(Alternatives::default());
    rig.set_ram(AT_HEADER, &[0x4001, 150, 2, 0x40]);
    rig.set_ram(0x40, &[0x5002, 100, 2, MDT_HEADER, 0x8002, 0, 0]);
    rig.mst(FIRST_MST, 2);
    rig.run_to(FIRST_MST + 480_000);
    assert!(rig.sent.is_empty());
}

#[test]
fn a_double_buffered_transmit_header_sends_the_buffer_that_val_names() {
    for (word, info) in [(0x5201, 0x1111), (0x5601, 0x2222u16)] {
        let mut rig = Rig::slave(Alternatives::default());
        rig.set_ram(AT_HEADER, &[word, 150, 1, 0x40, 0x8001, 0x1111, 0x2222]);
        rig.set_ram(0x40, &[0xC000, 1_900]);
        rig.mst(FIRST_MST, 2);
        rig.run_to(FIRST_MST + 400_000);
        assert_eq!(rig.sent[0].1[1..], info.to_le_bytes());
    }
}

#[test]
fn with_dma_no_data_words_are_written_to_the_ram() {
    let mut rig = Rig::slave(Alternatives::default());
    rig.set_ram(MDT_HEADER, &[0x1901]);
    rig.set_ram(MDT_CONTROL, &[0x5A5A, 0x5A5A]);
    rig.mst(FIRST_MST, 2);
    rig.mdt(FIRST_MST, 0x1000, 0xBEEF);
    assert!(val(&mut rig));
    assert_eq!((rig.ram(MDT_CONTROL), rig.ram(MDT_CONTROL + 1)), (0x5A5A, 0x5A5A));
}
