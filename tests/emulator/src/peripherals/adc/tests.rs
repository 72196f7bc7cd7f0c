//! The laws of the converters, one test each.

use super::*;

const ADC2: u32 = 0x100;
const ADC3: u32 = 0x200;
const TRIGGER: Nanoseconds = Nanoseconds(1_000_000);
/// 84 MHz / 4 = 21 MHz.
const DIVIDED_BY_4: u32 = 1 << 16;

/// Writes its samples down: when, which converter, which channel.
type Samples = Vec<(u64, usize, u8)>;

fn converters() -> Converters {
    let mut adc = Converters::new();
    adc.set_clock(84_000_000);
    adc
}

fn write(adc: &mut Converters, writes: &[(u32, u32)]) {
    for (offset, value) in writes {
        adc.write(*offset, *value, Nanoseconds::ZERO).unwrap().unwrap();
    }
}

/// Two ranks on each of three: phase current, then a slow quantity; three cycles of sampling, then 28.
fn set_up() -> Converters {
    let mut adc = converters();
    let sequence = |first: u32, second: u32| 1 << 20 | second << 15 | first << 10;
    for (base, first, second, sampling) in
        [(0, 10, 13, [2 << 9, 0]), (ADC2, 11, 14, [2 << 12, 0]), (ADC3, 12, 4, [0, 2 << 12])]
    {
        let writes =
            [(JSQR, sequence(first, second)), (SMPR1, sampling[0]), (SMPR2, sampling[1]), (CR1, SCAN), (CR2, ON)];
        write(&mut adc, &writes.map(|(offset, value)| (base + offset, value)));
    }
    write(&mut adc, &[(CCR, DIVIDED_BY_4 | TRIPLE), (CR2, ON | TRIGGERED_BY_TIM1), (CR1, SCAN | INJECTED_INTERRUPT)]);
    adc
}

/// Advances; a sample is 1000 times the converter plus the channel.
fn advance(adc: &mut Converters, until: u64) -> Samples {
    let mut samples = Samples::new();
    adc.advance(TRIGGER + Nanoseconds(until), &mut |at, number, channel| {
        samples.push((at.0 - TRIGGER.0, number, channel));
        Ok(1_000 * number as u16 + u16::from(channel))
    })
    .unwrap();
    samples
}

#[test]
fn values_are_taken_at_the_hold_instants_of_all_three() {
    let mut adc = set_up();
    adc.trigger(TRIGGER).unwrap();
    // Rank 1: 3 cycles of 47.6 ns; rank 2: (3 + 12 + 28) cycles.
    let expected = [(143, 1, 10), (143, 2, 11), (143, 3, 12), (2_048, 1, 13), (2_048, 2, 14), (2_048, 3, 4)];
    assert_eq!(advance(&mut adc, 10_000), expected);
}

#[test]
fn the_interrupt_comes_at_the_end_of_the_last_rank() {
    let mut adc = set_up();
    adc.trigger(TRIGGER).unwrap();
    assert_eq!(adc.read(SR), Some(INJECTED_START));
    // 3 + 12 + 28 + 12 = 55 cycles.
    advance(&mut adc, 2_619);
    assert!(!adc.line());
    assert_eq!(adc.next_event(None), Some(TRIGGER + Nanoseconds(2_620)));
    advance(&mut adc, 2_620);
    assert!(adc.line());
    assert_eq!(adc.next_event(None), None);
    assert_eq!(adc.read(CSR), Some(0x0C_0C0C));
    assert_eq!(adc.read(ADC3 + JDR1), Some(3_012));
    assert_eq!(adc.read(ADC3 + JDR1 + 4), Some(3_004));
    write(&mut adc, &[(SR, !INJECTED_END)]);
    assert_eq!((adc.line(), adc.read(SR)), (false, Some(INJECTED_START)));
}

#[test]
fn a_trigger_to_come_announces_its_first_hold() {
    let adc = set_up();
    assert_eq!(adc.next_event(Some(TRIGGER)), Some(TRIGGER + Nanoseconds(143)));
    assert_eq!(adc.next_event(None), None);
}

#[test]
fn short_sequences_sit_at_the_upper_end_of_jsqr() {
    let fields = 4 << 15 | 3 << 10 | 2 << 5 | 1;
    let sequence = |length: u32| {
        let mut adc = converters();
        write(&mut adc, &[(JSQR, (length - 1) << 20 | fields)]);
        adc.sequence(1)
    };
    assert_eq!(sequence(1), [4]);
    assert_eq!(sequence(2), [3, 4]);
    assert_eq!(sequence(3), [2, 3, 4]);
    assert_eq!(sequence(4), [1, 2, 3, 4]);
}

#[test]
fn software_starts_one_converter_or_the_whole_group() {
    let mut adc = set_up();
    adc.write(ADC2 + CR2, ON | SOFTWARE_START, TRIGGER).unwrap().unwrap();
    assert_eq!(advance(&mut adc, 143), [(143, 2, 11)]);
    assert_eq!(adc.read(ADC2 + CR2), Some(ON), "JSWSTART clears itself");
    let mut adc = set_up();
    write(&mut adc, &[(CCR, DIVIDED_BY_4 | DUAL)]);
    adc.write(CR2, ON | SOFTWARE_START, TRIGGER).unwrap().unwrap();
    assert_eq!(advance(&mut adc, 143), [(143, 1, 10), (143, 2, 11)]);
}

#[test]
fn independent_converters_follow_their_own_triggers() {
    let mut adc = set_up();
    write(&mut adc, &[(CCR, DIVIDED_BY_4), (CR2, ON), (ADC3 + CR2, ON | TRIGGERED_BY_TIM1)]);
    adc.trigger(TRIGGER).unwrap();
    assert_eq!(advance(&mut adc, 200), [(143, 3, 12)]);
}

#[test]
fn offset_and_alignment_shape_the_result() {
    let result = |control: u32, offset: u32| {
        let mut adc = converters();
        write(&mut adc, &[(CCR, DIVIDED_BY_4), (CR2, ON | control), (JOFR1, offset)]);
        adc.write(CR2, ON | control | SOFTWARE_START, TRIGGER).unwrap().unwrap();
        advance(&mut adc, 10_000);
        adc.read(JDR1).unwrap()
    };
    assert_eq!(result(0, 0), 1_000);
    assert_eq!(result(LEFT, 0), 8_000);
    assert_eq!(result(0, 2_048), 0xFFFF & -1_048_i32 as u32);
    assert_eq!(result(LEFT, 2_048), 0xFFFF & (-1_048_i32 * 8) as u32);
}

#[test]
fn values_are_foretold_only_while_nothing_runs() {
    let mut adc = set_up();
    assert_eq!(adc.peek(ADC2 + JDR1), Some(0));
    adc.trigger(TRIGGER).unwrap();
    assert_eq!(adc.peek(ADC2 + JDR1), None);
    advance(&mut adc, 2_620);
    assert_eq!(adc.peek(ADC2 + JDR1), Some(2_011));
    assert_eq!(adc.peek(SR), Some(INJECTED_START | INJECTED_END));
    assert_eq!(adc.peek(CR1), None);
}

#[test]
fn a_group_that_cannot_convert_together_is_refused() {
    let refused = |writes: &[(u32, u32)]| {
        let mut adc = set_up();
        write(&mut adc, writes);
        adc.trigger(TRIGGER).unwrap_err()
    };
    assert!(refused(&[(ADC2 + CR2, ON | TRIGGERED_BY_TIM1)]).contains("ADC2 has a trigger of its own"));
    assert!(refused(&[(ADC3 + JSQR, 12 << 15)]).contains("different length"));
    assert!(refused(&[(ADC2 + JSQR, 1 << 20 | 14 << 15 | 10 << 10)]).contains("same pin at once in rank 1"));
    assert!(refused(&[(ADC3 + SMPR2, 0)]).contains("different times in rank 2"));
    assert!(refused(&[(CR1, INJECTED_INTERRUPT)]).contains("without SCAN"));
    assert!(refused(&[(CCR, TRIPLE)]).contains("ADC clock 42000000 Hz"));
}

#[test]
fn a_trigger_at_the_wrong_time_is_refused() {
    let mut adc = set_up();
    adc.trigger(TRIGGER).unwrap();
    assert!(adc.trigger(TRIGGER + Nanoseconds(2_000)).unwrap_err().contains("still being converted"));
    let mut adc = set_up();
    assert!(adc.trigger(Nanoseconds(2_999)).unwrap_err().contains("3 us after ADON"));
    adc.trigger(Nanoseconds(3_000)).unwrap();
}

#[test]
fn what_is_not_modelled_is_refused() {
    for (offset, value) in
        [(CR1, 1 << 24), (CR1, 1 << 10), (CR2, 1 << 30), (CR2, 2 << 20 | 1 << 16), (CR2, 1 << 20), (CCR, 6)]
    {
        assert!(converters().write(offset, value, TRIGGER).unwrap().is_err(), "{offset:#x} = {value:#x}");
    }
    assert!(converters().write(0x50, 0, TRIGGER).is_none());
}
