use super::*;
use crate::dictionary::DICTIONARY;
use crate::service::scope::{is_own, refuses_setting, signal as signal_of};
use crate::signal::command::CommandValue;
use crate::signal::feedback::FeedbackValue;
use crate::signal::word::Word;
use sercos::data_block::Selection;
use sercos::parameters::Parameters;
use servo::axis::AxisOutput;
use servo::path::CommandSource;
use servo::scope::ScopeState;
use servo::units::{CurrentFraction, Position, Velocity};
use std::boxed::Box;
use std::vec::Vec;

/// Every value is another one, so that no signal can be taken for its neighbour.
struct Values {
    loops: LoopValues,
    current_loop: CurrentLoopValues,
}

impl SignalValues for Values {
    fn command(&self, command: Command) -> u32 {
        match command {
            Command::Value(CommandValue::Velocity) => (-3_000_000_i32).cast_unsigned(),
            Command::Value(CommandValue::Torque) => 0xFF38,
            Command::Value(CommandValue::SignalControl) => 0xFF39,
            _ => 5,
        }
    }

    fn feedback(&self, feedback: Feedback) -> u32 {
        match feedback {
            Feedback::Value(FeedbackValue::Position) => (-1_800_000_i32).cast_unsigned(),
            Feedback::Value(FeedbackValue::Torque) => 0xFFFE,
            Feedback::Value(FeedbackValue::DiagnosticNumber) => 0xC0FE,
            _ => 6,
        }
    }

    fn bits(&self, source: Source) -> u16 {
        source.value(if source.word() == Word::Class3 { 0xFF02 } else { 0 })
    }

    fn loops(&self) -> &LoopValues {
        &self.loops
    }

    fn current_loop(&self) -> &CurrentLoopValues {
        &self.current_loop
    }
}

fn values() -> Values {
    let output = AxisOutput {
        current: CurrentFraction::from_bits(-1_000),
        following_error: Position::from_bits(-(3 << 30)),
        velocity: Velocity::from_bits(11),
        velocity_command: Velocity::from_bits(-22),
        position_command: Position::from_bits(300 << 32),
        command_source: CommandSource::Interpolated,
        standstill: false,
        limiting: servo::axis::Limiting::empty(),
        loop_velocity: servo::units::Velocity::ZERO,
        travelled: false,
    };
    let fraction = CurrentFraction::from_bits;
    let current_loop = CurrentLoopValues {
        quadrature: fraction(101),
        direct_command: fraction(102),
        direct: fraction(103),
        phases: [fraction(104), fraction(105), fraction(-106)],
        quadrature_voltage: -107,
        direct_voltage: 108,
        angle: 60_000,
        bus_voltage: 560_000,
    };
    Values { loops: LoopValues { position: Position::from_bits(-(1 << 32)), output }, current_loop }
}

fn signal(number: u16) -> Signal {
    signal_of(number, &Parameters::new(&DICTIONARY)).unwrap()
}

/// Settings as a master has written them; all others are 0.
fn settings(written: &[(Idn, u32)]) -> impl Fn(Idn) -> u32 + '_ {
    move |idn| written.iter().find(|(of, _)| *of == idn).map_or(0, |(_, value)| *value)
}

fn configuration(written: &[(Idn, u32)]) -> Result<Configuration, InvalidConfiguration> {
    Configuration::new(settings(written), |number| signal_of(number, &Parameters::new(&DICTIONARY)))
}

#[test]
fn the_values_of_data_blocks_have_the_sign_of_their_attribute() {
    let values = values();
    for (number, expected) in [
        (0, 0),
        (36, -3_000_000),
        (80, -200),
        (145, 0xFF39),
        (51, -1_800_000),
        (84, -2),
        (390, 0xC0FE),
        (13, 0xFF02),
        (331, 1),
        (332, 0),
        (0x8013, 0),
    ] {
        assert_eq!(sample_source(signal(number), &values), expected, "{}", Idn(number));
    }
}

#[test]
fn every_value_of_the_telegrams_is_recorded_with_length_and_sign_of_its_attribute() {
    struct Raw;
    impl SignalValues for Raw {
        fn command(&self, _: Command) -> u32 {
            0xFFFF_FF38
        }
        fn feedback(&self, _: Feedback) -> u32 {
            0xFFFF_FF38
        }
        fn bits(&self, _: Source) -> u16 {
            0xFF38
        }
        fn loops(&self) -> &LoopValues {
            unreachable!()
        }
        fn current_loop(&self) -> &CurrentLoopValues {
            unreachable!()
        }
    }
    let mut signed = Vec::new();
    let cyclic = [Selection::ConfigurableInAt, Selection::ConfigurableInMdt];
    for block in cyclic.into_iter().flat_map(|selection| DICTIONARY.select(selection)) {
        let recorded = sample_source(signal(block.idn.0), &Raw);
        let shown = block.attribute.value_of(0xFFFF_FF38);
        // Four bytes without sign keep their bits.
        assert_eq!(recorded, shown as i32, "{}", block.idn);
        if shown == -200 && block.fixed_bytes() == Some(2) {
            signed.push(block.idn.0);
        }
    }
    // Torque commands, limits and feedback, temperatures below zero.
    assert_eq!(signed, [84, 383, 384, 80, 81, 82, 83]);
}

#[test]
fn a_parameter_is_recorded_as_it_was_when_the_recording_was_armed() {
    let mut parameters = Parameters::new(&DICTIONARY);
    parameters.set(Idn::standard(104), 375).unwrap();
    parameters.set(Idn::standard(46), 0xFFFC).unwrap();
    parameters.set(Idn::standard(79), 0xFFFF_FFFF).unwrap();
    let recorded = |number| sample_source(signal_of(number, &parameters).unwrap(), &values());
    assert_eq!(recorded(104), 375);
    assert_eq!(recorded(46), -4, "two bytes with a sign");
    assert_eq!(recorded(79), -1, "four bytes without a sign keep their bits");
}

#[test]
fn every_internal_signal_has_a_number_a_row_and_its_own_value() {
    let expected = [
        (0xF000, -(1 << 24)),
        // 300 revolutions are 44 beyond the 256 after which the numbers go round.
        (0xF001, 44 << 24),
        (0xF002, -(3 << 22)),
        (0xF003, 11),
        (0xF004, -22),
        (0xF005, -33),
        (0xF006, -1_000),
        (0xF010, 101),
        (0xF011, 102),
        (0xF012, 103),
        (0xF013, 104),
        (0xF014, 105),
        (0xF015, -106),
        (0xF016, -107),
        (0xF017, 108),
        (0xF018, 60_000),
        (0xF019, 560_000),
    ];
    let numbers: Vec<u16> = INTERNAL_SIGNALS.iter().map(|row| row.signal.number()).collect();
    assert_eq!(numbers, expected.map(|(number, _)| number));
    for (number, value) in expected {
        assert_eq!(sample_source(signal(number), &values()), value, "{number:#06x}");
    }
    assert!(numbers.iter().all(|&number| number >= 0xF000 && DICTIONARY.find(Idn(number)).is_none()));
}

#[test]
fn a_following_error_beyond_the_range_is_limited_and_a_position_goes_round() {
    let mut values = values();
    values.loops.output.following_error = Position::from_bits(200 << 32);
    values.loops.position = Position::from_bits(200 << 32);
    assert_eq!(sample_source(signal(0xF002), &values), i32::MAX);
    assert_eq!(sample_source(signal(0xF000), &values), -56 * (1 << 24));
}

#[test]
fn what_cannot_be_recorded_is_refused_when_it_is_written() {
    let parameters = Parameters::new(&DICTIONARY);
    let refused = |number: u16| refuses_setting(SIGNALS[3], number.into(), &parameters);
    for number in [0, 36, 51, 84, 104, 331, 0xF000, 0xF019] {
        assert_eq!(refused(number), None, "{number:#06x}");
    }
    for number in [4_095, 0x1001, 0xF007, 0xFFFF] {
        assert_eq!(refused(number), Some(ServiceError::IdnNotAvailable), "{number:#06x}");
    }
    // A list of IDNs, a text, a command, a counter outside the motion side, eight bytes.
    for number in [17, 30, 99, 28, 0x8007, 0x8008] {
        assert_eq!(refused(number), Some(ServiceError::InvalidData), "{number:#06x}");
    }
    let trigger = |value: u16| refuses_setting(TRIGGER, value.into(), &parameters);
    assert_eq!([trigger(0x0000), trigger(0x0103), trigger(0x0200)], [None; 3]);
    assert_eq!([trigger(0x0004), trigger(0x0300), trigger(0x0110)], [Some(ServiceError::InvalidData); 3]);
    assert_eq!(refuses_setting(LEVEL, 0xFFFF, &parameters), None);
}

#[test]
fn settings_that_do_not_go_together_are_refused_with_a_name() {
    assert!(configuration(&[]).is_ok());
    assert_eq!(
        configuration(&[(SIGNALS[2], 4_095)]),
        Err(InvalidConfiguration::Signal { channel: 2, actual: 4_095, error: ServiceError::IdnNotAvailable })
    );
    assert_eq!(configuration(&[(TRIGGER, 0x0400)]), Err(InvalidConfiguration::Trigger { actual: 0x0400 }));
    let level = configuration(&[(TRIGGER, 0x0100), (LEVEL, 0x8000_0000)]);
    assert_eq!(level, Err(InvalidConfiguration::Scope(ScopeSettingsError::Level { actual: i32::MIN })));
    assert_eq!(level.map_err(InvalidConfiguration::service_error), Err(ServiceError::InvalidData));
    assert_eq!(
        configuration(&[(PRE_TRIGGER, 2_048)]),
        Err(InvalidConfiguration::Scope(ScopeSettingsError::PreTrigger { actual: 2_048 }))
    );
}

#[test]
fn the_data_blocks_of_the_oscilloscope_are_p_0_0200_to_p_0_0215() {
    let named = [STATE, TRIGGER, LEVEL, PRE_TRIGGER, SAMPLING, CONTROL, WINDOW, INTERVAL];
    let mut all: Vec<Idn> = named.into_iter().chain(SIGNALS).chain(POINTS).collect();
    all.sort_unstable();
    assert_eq!(all, (200..=215).map(Idn::product).collect::<Vec<_>>());
    assert!(all.into_iter().all(is_own));
    assert_eq!([Idn::product(199), Idn::product(216), Idn::standard(205)].map(is_own), [false; 3]);
}

#[test]
fn only_the_task_that_p_0_0208_names_records() {
    let mut scope = Box::new(Scope::new());
    let mut oscilloscope = Oscilloscope::new(&mut scope);
    assert_eq!(oscilloscope.wanted(Task::ControlLoop), None, "idle");
    for (sampling, task, other, interval) in [
        (0, Task::CurrentLoop, Task::ControlLoop, 625),
        (1, Task::ControlLoop, Task::CurrentLoop, 1_250),
        (65_535, Task::ControlLoop, Task::CurrentLoop, 81_918_750),
    ] {
        oscilloscope.arm(configuration(&[(SIGNALS[1], 40), (SAMPLING, sampling)]).unwrap());
        let signals = [
            Signal::Off,
            Signal::Feedback(Feedback::Value(FeedbackValue::Velocity), Width::Long),
            Signal::Off,
            Signal::Off,
        ];
        assert_eq!(oscilloscope.wanted(task), Some(signals), "{sampling}");
        assert_eq!(oscilloscope.wanted(other), None, "{sampling}");
        assert_eq!(oscilloscope.interval(625), interval);
    }
}

#[test]
fn the_windows_of_a_recording_join_to_all_its_points() {
    let mut scope = Box::new(Scope::new());
    let mut oscilloscope = Oscilloscope::new(&mut scope);
    let rising = [(TRIGGER, 0x0102), (LEVEL, 500), (PRE_TRIGGER, 100), (SAMPLING, 2)];
    oscilloscope.arm(configuration(&rising).unwrap());
    assert_eq!(oscilloscope.state(), ScopeState::Armed as u16);
    assert_eq!(oscilloscope.points(0).count(), 0);
    let mut tick = 0;
    while oscilloscope.wanted(Task::ControlLoop).is_some() {
        oscilloscope.record(&[tick * 10, -tick, tick, 0]);
        tick += 1;
    }
    assert_eq!(oscilloscope.state(), 4);
    let mut read = [const { Vec::new() }; SCOPE_CHANNELS];
    for start in (0..2_048).step_by(WINDOW_POINTS) {
        oscilloscope.set_window(start);
        assert_eq!(oscilloscope.window(), start);
        for (channel, points) in read.iter_mut().enumerate() {
            points.extend(oscilloscope.points(channel).map(u32::cast_signed));
        }
    }
    // Ticks 300, 302 ...: the trigger at tick 500 is point 100.
    let ticks = || (0..2_048).map(|point| 300 + 2 * point);
    assert_eq!(read[0], ticks().map(|tick| tick * 10).collect::<Vec<i32>>());
    assert_eq!(read[1], ticks().map(|tick| -tick).collect::<Vec<i32>>());
    assert_eq!(read[2], ticks().collect::<Vec<i32>>());
    assert_eq!(read[3], [0; 2_048]);

    oscilloscope.set_window(2_040);
    assert_eq!(oscilloscope.points(2).count(), 8, "the last points only");
    oscilloscope.arm(configuration(&rising).unwrap());
    assert_eq!((oscilloscope.window(), oscilloscope.points(2).count()), (0, 0));
    oscilloscope.stop();
    assert_eq!(oscilloscope.state(), 0);
}
