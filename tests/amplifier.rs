//! The amplifier belongs to the drive: what it bears is told by the works, and by nobody else.

use std::sync::Arc;
use std::sync::atomic::{AtomicI16, Ordering};

use bench::{DriveSetup, Executor, Works, amplifier_of, parameters_of, record_of};
use flash::FlashModel;
use plant::ReferenceAxis;
use ring::Nanoseconds;
use ring::ident::{Idn, Value};
use ring::master::{CommandValues, DriveScript, MasterScript, Motion, Telegram};
use ring::service_client::{Reply, Request};

use crate::elf::on_qemu;
use crate::running::{ADDRESS, Bench};

const P: u16 = 0x8000;
const SERIAL_NUMBER: u16 = P | 20;
const HARDWARE: u16 = P | 21;
const WRITE_PROTECTED: u16 = 0x7004;

/// Ratings with what a master writes into them: the first four are what one has written, and was believed.
const WRITES: [(u16, Value); 14] = [
    (110, Value::Long(100_000)),
    (P | 100, Value::Long(125_000)),
    (P | 105, Value::Word(490)),
    (203, Value::Word(2_000)),
    (112, Value::Long(100_000)),
    (200, Value::Word(1_900)),
    (P | 101, Value::Word(1_000)),
    (P | 102, Value::Word(10)),
    (P | 103, Value::Word(0)),
    (P | 104, Value::Word(1)),
    (P | 106, Value::Long(0)),
    (P | 131, Value::Long(3_600_000)),
    (P | 234, Value::Word(1)),
    (P | 239, Value::Word(4_000)),
];

/// A drive that was told its motor, without torque in CP4.
fn in_cp4(executor: Executor, axis: ReferenceAxis, works: Works) -> Bench {
    let drive = DriveScript::new(ADDRESS, Telegram::standard(2).unwrap())
        .with(Idn::OPERATION_MODE, Value::Word(2))
        .with_all(parameters_of(&axis));
    let script = MasterScript { reset_diagnostics: false, ..MasterScript::new(vec![drive]) };
    let mut bench = Bench::on(executor, DriveSetup { axis, works, ..DriveSetup::new(ADDRESS) }, script);
    for _ in 0..1_000 {
        bench.run(Nanoseconds::from_millis(10));
        if bench.world.ring().master().is_done() {
            return bench;
        }
    }
    panic!("{}", bench.world.ring().master().state());
}

fn assert_ratings_stay(executor: Executor) {
    let axis = ReferenceAxis::small_cnc();
    let mut bench = in_cp4(executor, axis, Works::OfItsAxis);
    let kept = bench.entries(192);
    let before = WRITES.map(|(idn, _)| bench.number(idn));
    let amplifier = amplifier_of(&axis);
    assert_eq!(before[0], u64::from(amplifier.peak_current));
    assert_eq!(before[1], u64::from(amplifier.current_range));
    assert_eq!(before[2], u64::from(amplifier.overvoltage));
    assert_eq!((bench.text(HARDWARE), bench.text(SERIAL_NUMBER)), ("bench".to_owned(), "1".to_owned()));
    for (idn, value) in WRITES {
        assert_eq!(bench.write(idn, value), Err(WRITE_PROTECTED), "{}", Idn(idn));
        assert!(!kept.contains(&idn), "S-0-0192 has {}", Idn(idn));
    }
    assert_eq!(WRITES.map(|(idn, _)| bench.number(idn)), before);
}

#[test]
fn no_control_writes_a_rating_of_the_amplifier() {
    assert_ratings_stay(Executor::Host);
}

#[test]
#[ignore = "needs QEMU and the ELF: cargo xtask test"]
fn no_control_writes_a_rating_of_the_amplifier_into_the_elf() {
    assert_ratings_stay(on_qemu());
}

/// The flashed ELF in a sector of ones, and the board that this computer stands for.
#[test]
#[ignore = "needs QEMU and the ELF: cargo xtask test"]
fn a_drive_as_it_comes_has_the_amplifier_of_the_board_here_and_in_the_elf() {
    let ratings = [Executor::Host, on_qemu()].map(|executor| {
        let mut bench = in_cp4(executor, ReferenceAxis::catalogue(), Works::Blank);
        assert_eq!((bench.text(HARDWARE), bench.text(SERIAL_NUMBER)), (String::new(), String::new()));
        WRITES.map(|(idn, _)| bench.number(idn))
    });
    assert_eq!(ratings[0], ratings[1]);
}

/// Why a drive is refused CP4.
fn refused(executor: Executor, works: Works) -> String {
    let axis = ReferenceAxis::small_cnc();
    let drive = DriveScript::new(ADDRESS, Telegram::standard(2).unwrap())
        .with(Idn::OPERATION_MODE, Value::Word(2))
        .with_all(parameters_of(&axis));
    let motion = Motion::new(1_000_000, |_| CommandValues::at_velocity(100_000));
    let script = MasterScript { motion: Some(motion), ..MasterScript::new(vec![drive]) };
    let mut bench = Bench::on(executor, DriveSetup { axis, works, ..DriveSetup::new(ADDRESS) }, script);
    for _ in 0..400 {
        bench.run(Nanoseconds::from_millis(10));
        assert!(!bench.has_torque());
        let error = bench.world.ring().master().report().error.as_ref().map(ToString::to_string);
        if let Some(error) = error {
            return error;
        }
    }
    panic!("{}", bench.world.ring().master().state());
}

fn assert_unreadable_is_refused(executor: Executor) {
    let mut bytes = record_of(&ReferenceAxis::small_cnc()).emit();
    bytes[40] ^= 1;
    let error = refused(executor, Works::Bytes(bytes));
    assert!(error.ends_with("invalid data: P-0-0021"), "{error}");
}

#[test]
fn a_drive_that_cannot_read_what_it_is_never_has_torque() {
    assert_unreadable_is_refused(Executor::Host);
}

#[test]
#[ignore = "needs QEMU and the ELF: cargo xtask test"]
fn an_elf_that_cannot_read_what_it_is_never_has_torque() {
    assert_unreadable_is_refused(on_qemu());
}

#[test]
fn ratings_that_no_drive_can_have_are_refused_by_their_names() {
    let axis = ReferenceAxis::small_cnc();
    // 600 V are beyond what its converter shows.
    let error = refused(Executor::Host, Works::but_for(&axis, |amplifier| amplifier.overvoltage = 600));
    assert!(error.ends_with("invalid data: P-0-0105"), "{error}");
}

/// Everything that S-0-0192 of a drive three times the size has saved, written into a small one whose shaft is blocked: all of its torque is asked for.
#[test]
fn the_backup_of_a_bigger_amplifier_raises_no_limit() {
    let (large, small) = (ReferenceAxis::press(), ReferenceAxis::small_cnc());
    let mut backup = in_cp4(Executor::Host, large, Works::OfItsAxis);
    let kept: Vec<(u16, Value)> = backup.entries(192).into_iter().map(|idn| (idn, backup.read(idn))).collect();
    assert!(kept.iter().any(|(idn, value)| *idn == 109 && value.as_number() == Some(42_426)));

    let mut bench = in_cp4(Executor::Host, small, Works::OfItsAxis);
    let limits = |bench: &mut Bench| [110, 112, 200, 203, P | 105, P | 106].map(|idn| bench.number(idn));
    let before = limits(&mut bench);
    for (idn, value) in kept {
        // What its phase protects, or what does not go together here, is refused.
        let _ = bench.write(idn, value);
    }
    assert_eq!(limits(&mut bench), before);

    // The small amplifier, told the motor of the large one.
    let drive = DriveScript::new(ADDRESS, Telegram::standard(1).unwrap())
        .with_all(parameters_of(&small))
        .with(Idn::OPERATION_MODE, Value::Word(1))
        .with(Idn(109), Value::Long(42_426))
        .with(Idn(114), Value::Word(2_000))
        .with(Idn(92), Value::Word(65_535));
    let command = Arc::new(AtomicI16::new(0));
    let given = Arc::clone(&command);
    let motion = Motion::new(1_000_000, move |_| CommandValues {
        torque: given.load(Ordering::Relaxed),
        ..CommandValues::default()
    });
    let script = MasterScript { motion: Some(motion), stops_at_refusals: false, ..MasterScript::new(vec![drive]) };
    let mut bench = Bench::new(DriveSetup { axis: small, ..DriveSetup::new(ADDRESS) }, script);
    bench.run_to_operation();
    let now = bench.world.now().0;
    bench.drive.motor_side.borrow_mut().machine().block(true, now);
    command.store(i16::MAX, Ordering::Relaxed);
    let per_ampere = small.machine.torque_constant();
    let current = |bench: &mut Bench| {
        bench.run(Nanoseconds::from_millis(1));
        let now = bench.world.now().0;
        bench.drive.motor_side.borrow_mut().machine().torque(now).abs() / per_ampere
    };
    let most = (0..40).map(|_| current(&mut bench)).fold(0.0, f64::max);
    let peak = f64::from(small.peak_current) / 1_000.0;
    assert!((0.95 * peak..1.02 * peak).contains(&most), "{most} A, at most {peak} A");
    // Four time constants of the bridge later the current is folded back to what it carries for ever; S-0-0114, 200 % here, is the motor's.
    for _ in 0..2_000 {
        bench.run(Nanoseconds::from_millis(10));
    }
    let last = current(&mut bench);
    assert!(bench.has_torque() && (0.48 * peak..0.53 * peak).contains(&last), "{last} A of {peak} A");
}

/// What a drive shows in CP2, before anybody has told it a motor, 1.5 s after its DC link was brought to so many volts.
fn shown_in_cp2(works: Works, axis: ReferenceAxis, flash: FlashModel, volts: f64, idn: Idn) -> u64 {
    let drive = DriveScript::new(ADDRESS, Telegram::standard(2).unwrap());
    let script = MasterScript { stops_at_refusals: false, ..MasterScript::new(vec![drive]) };
    let mut bench = Bench::new(DriveSetup { axis, works, flash, ..DriveSetup::new(ADDRESS) }, script);
    bench.drive.motor_side.borrow_mut().machine().set_supply(volts, 0);
    while bench.world.ring().master().phase() != 2 {
        bench.run(Nanoseconds::from_millis(1));
    }
    bench.world.ring_mut().master_mut().service(0).request(Request::Read(idn));
    bench.run(Nanoseconds::from_millis(1_500));
    let services = &bench.world.ring().master().report().drives[0].services;
    let read = services.iter().find(|service| service.request == Request::Read(idn)).unwrap();
    let Ok(Reply::Data { value, .. }) = &read.result else { panic!("{:?}", read.result) };
    value.as_number().unwrap()
}

#[test]
fn a_drive_that_knows_its_amplifier_and_no_motor_yet_measures_on_the_amplifiers_scale() {
    // With currents of 42 A the motor of the defaults goes together with nothing.
    let volts = shown_in_cp2(Works::OfItsAxis, ReferenceAxis::press(), FlashModel::new(), 560.0, Idn(380));
    assert!((557..=563).contains(&volts), "{volts} V");
}

/// On the scale of the board 900 V are 450, and its chopper would begin at 418.
#[test]
fn a_drive_that_does_not_know_its_amplifier_switches_no_brake_resistor() {
    let axis = ReferenceAxis::press().with_resistor(40.0);
    let mut parameters = sercos::parameters::Parameters::new(&drive::DICTIONARY);
    for (number, value) in [(235, 400), (236, 1_000)] {
        parameters.set(sercos::Idn::product(number), value).unwrap();
    }
    let load = |works| shown_in_cp2(works, axis, bench::saved(&parameters), 900.0, Idn(P | 238));
    let mut bytes = record_of(&axis).emit();
    assert!(load(Works::Bytes(bytes)) > 0, "above 745 V it is on");
    bytes[40] ^= 1;
    assert_eq!(load(Works::Bytes(bytes)), 0);
    assert!(load(Works::Blank) > 0, "it takes itself for the board: nobody can tell");
    // E00BH, from the start on.
    let warned = |works| shown_in_cp2(works, axis, bench::saved(&parameters), 560.0, Idn(181)) & 1 << 8;
    assert_eq!([Works::Bytes(bytes), Works::OfItsAxis].map(warned), [1 << 8, 0]);
}
