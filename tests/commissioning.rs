//! Commissioning commands: gains from the data of the motor, and the data of the motor from measurements, against the simulated machine.

use std::cell::Cell;
use std::rc::Rc;

use crate::running::{ADDRESS, Bench, script};
use bench::{Amplifier, DriveSetup};
use ring::Nanoseconds;
use ring::ident::{Idn, Value};
use ring::master::{CommandValues, DriveScript, MasterScript, Motion, Telegram};

const P: u16 = 0x8000;
const COMPUTE_GAINS: u16 = P | 220;
const IDENTIFY_WINDING: u16 = P | 224;
const IDENTIFY_FLUX: u16 = P | 225;
const IDENTIFY_INERTIA: u16 = P | 226;
const PROGRESS: u16 = P | 227;
const FINDING: u16 = P | 228;

const EXECUTED: u64 = 3;
const EXECUTING: u64 = 7;
const FAILED: u64 = 0xF;

/// A press drive in operation, in position mode, held by HALT as long as the master says so.
pub(crate) struct Halted {
    pub(crate) bench: Bench,
    halt: Rc<Cell<bool>>,
}

impl Halted {
    fn new() -> Self {
        Self::with_cycle(2_000)
    }

    /// With position commands every so many us.
    pub(crate) fn with_cycle(cycle: u16) -> Self {
        let drive = script().drives.remove(0).with(Idn::OPERATION_MODE, Value::Word(11));
        let drive = DriveScript { telegram: Telegram::standard(4).unwrap(), ..drive };
        let halt = Rc::new(Cell::new(true));
        let asked = halt.clone();
        let motion = Motion::new(1_000_000, move |point| CommandValues {
            halt: asked.get(),
            ..CommandValues::at_position(point.start)
        });
        let mut bench = Bench::new(
            DriveSetup::new(ADDRESS),
            MasterScript { cycle, motion: Some(motion), stops_at_refusals: false, ..MasterScript::new(vec![drive]) },
        );
        for _ in 0..1_000 {
            bench.run(Nanoseconds::from_millis(10));
            if bench.is_in_operation() && bench.world.ring().master().phase() == 4 {
                bench.run(Nanoseconds::from_millis(300));
                assert_eq!(bench.status() & 1 << 3, 0, "halted");
                return Self { bench, halt };
            }
        }
        panic!("{}", bench.world.ring().master().state());
    }

    pub(crate) fn numbers<const N: usize>(&mut self, idns: [u16; N]) -> [u64; N] {
        idns.map(|idn| self.bench.number(idn))
    }

    /// Waits for the end of a command that executes.
    pub(crate) fn end_of(&mut self, command: u16) -> u64 {
        for _ in 0..1_000 {
            self.bench.run(Nanoseconds::from_millis(20));
            let status = self.bench.number(command);
            if status != EXECUTING {
                return status;
            }
        }
        panic!("{} does not end: {} %", Idn(command), self.bench.number(PROGRESS));
    }

    fn revolutions(&mut self) -> f64 {
        let now = self.bench.world.now().0;
        self.bench.drive.motor_side.borrow_mut().machine().angle(now)
    }

    /// Half a second later the motor stands, held by torque.
    fn assert_held(&mut self) {
        self.bench.run(Nanoseconds::from_millis(500));
        let before = self.revolutions();
        self.bench.run(Nanoseconds::from_millis(200));
        let moved = (self.revolutions() - before) * 360.0;
        assert!(moved.abs() < 0.02 && self.bench.has_torque(), "{moved} degrees");
    }
}

/// Within five per cent.
fn assert_near(actual: u64, expected: f64) {
    let ratio = actual as f64 / expected;
    assert!((0.95..1.05).contains(&ratio), "{actual}, expected {expected}");
}

#[test]
fn gains_come_from_the_data_of_the_motor_all_or_none() {
    let mut halted = Halted::new();
    let bench = &mut halted.bench;
    let gains = [100, 101, 104, 106, 107, 348, P | 231];
    for (idn, value) in [(221, Value::Long(1_500_000)), (222, Value::Word(1_100)), (223, Value::Word(40))] {
        bench.write(P | idn, value).unwrap();
    }
    bench.write(COMPUTE_GAINS, Value::Word(3)).unwrap();
    assert_eq!(halted.numbers([COMPUTE_GAINS]), [EXECUTED]);
    assert_eq!(halted.bench.text(FINDING), "");
    let [velocity, time, position, current, current_time, feed_forward, smoothing] = halted.numbers(gains);
    // 2 pi 40 Hz * 0.15 kg m^2 / 2.828 Nm/A (RMS); 4 / (2 pi 40 Hz); a quarter of 2 pi 40 Hz.
    assert_eq!((velocity, time, position), (13_329, 159, 377));
    // 3.5 mH at 16 kHz, 0.292 of which is 1 100 Hz at -3 dB; 3.5 mH / 0.35 Ohm.
    assert!((16_250..16_350).contains(&current), "{current}");
    assert_eq!(current_time, 100);
    // 0.15 kg m^2 / 2.828 Nm/A in 0.1 mA s²/rad; 0.5 ms² / 2 ms.
    assert_eq!((feed_forward, smoothing), (530, 250));
    halted.assert_held();
    let before = halted.numbers(gains);
    halted.bench.write(COMPUTE_GAINS, Value::Word(0)).unwrap();
    halted.bench.write(P | 223, Value::Word(400)).unwrap();
    halted.bench.write(COMPUTE_GAINS, Value::Word(3)).unwrap();
    assert_eq!(halted.numbers([COMPUTE_GAINS]), [FAILED]);
    let finding = halted.bench.text(FINDING);
    assert!(finding.starts_with("bandwidth of the velocity loop"), "{finding}");
    assert_eq!(halted.numbers(gains), before);
}

#[test]
fn resistance_and_inductances_are_those_of_the_machine() {
    let mut halted = Halted::new();
    let start = halted.revolutions();
    for (idn, value) in [(111, 500), (112, 5_000), (113, 5_000)] {
        halted.bench.write(P | idn, Value::Long(value)).unwrap();
    }
    halted.bench.write(IDENTIFY_WINDING, Value::Word(3)).unwrap();
    halted.bench.run(Nanoseconds::from_millis(1_000));
    let [status, early] = halted.numbers([IDENTIFY_WINDING, PROGRESS]);
    assert_eq!(status, EXECUTING);
    halted.bench.run(Nanoseconds::from_millis(1_000));
    let [late] = halted.numbers([PROGRESS]);
    assert!(0 < early && early < late && late < 100, "{early} % and {late} %");
    assert_eq!(halted.end_of(IDENTIFY_WINDING), EXECUTED, "{}", halted.bench.text(FINDING));
    let [resistance, direct, quadrature, percent] = halted.numbers([P | 111, P | 112, P | 113, PROGRESS]);
    assert_near(resistance, 350.0);
    assert_near(direct, 3_500.0);
    assert_near(quadrature, 3_800.0);
    assert_eq!((percent, halted.bench.text(FINDING).as_str()), (100, ""));
    halted.assert_held();
    let turned = (halted.revolutions() - start) * 360.0 * 4.0;
    assert!(turned.abs() < 32.0, "{turned} electrical degrees");
}

#[test]
fn an_axis_that_holds_a_load_is_not_let_go_for_the_resistance() {
    // An eighth of 25 A at 2 Nm/A.
    for (torque, status) in [(5.0, EXECUTING), (7.5, FAILED), (-7.5, FAILED)] {
        let mut halted = Halted::new();
        let now = halted.bench.world.now().0;
        halted.bench.drive.motor_side.borrow_mut().machine().set_load_torque(torque, now);
        halted.bench.run(Nanoseconds::from_millis(600));
        let before = halted.revolutions();
        halted.bench.write(IDENTIFY_WINDING, Value::Word(3)).unwrap();
        halted.bench.run(Nanoseconds::from_millis(100));
        assert_eq!(halted.numbers([IDENTIFY_WINDING]), [status], "{torque} Nm");
        if status == FAILED {
            assert!(halted.bench.text(FINDING).contains("take the load off"), "{}", halted.bench.text(FINDING));
            halted.assert_held();
            let moved = halted.revolutions() - before;
            assert!(moved.abs() < 1e-4, "{torque} Nm: {moved} revolutions");
        }
    }
}

#[test]
fn the_flux_linkage_is_that_of_the_machine_and_the_motor_stands_afterwards() {
    let mut halted = Halted::new();
    let start = halted.revolutions();
    halted.bench.write(P | 114, Value::Long(2_100_000)).unwrap();
    halted.bench.write(P | 218, Value::Long((-3_000_000_i32).cast_unsigned())).unwrap();
    halted.bench.write(IDENTIFY_FLUX, Value::Word(3)).unwrap();
    halted.bench.run(Nanoseconds::from_millis(1_200));
    assert!((-310.0..-290.0).contains(&halted.bench.rpm()), "{}", halted.bench.rpm());
    assert_eq!(halted.end_of(IDENTIFY_FLUX), EXECUTED, "{}", halted.bench.text(FINDING));
    // The machine's 2 Nm per ampere of amplitude, as a name plate has it.
    let [torque_constant] = halted.numbers([P | 114]);
    assert_near(torque_constant, 2e6 * core::f64::consts::SQRT_2);
    halted.assert_held();
    let turned = halted.revolutions() - start;
    assert!((-8.0..-4.0).contains(&turned), "{turned} revolutions");
}

#[test]
fn the_inertia_and_the_friction_are_those_of_the_machine() {
    let mut halted = Halted::new();
    halted.bench.write(P | 221, Value::Long(1_000)).unwrap();
    halted.bench.write(155, Value::Word(7)).unwrap();
    halted.bench.write(IDENTIFY_INERTIA, Value::Word(3)).unwrap();
    assert_eq!(halted.end_of(IDENTIFY_INERTIA), EXECUTED, "{}", halted.bench.text(FINDING));
    let [inertia] = halted.numbers([P | 221]);
    assert_near(inertia, 1_500_000.0);
    // 6 Nm at 2 Nm/A are 12 % of 25 A; 0.05 Nm s/rad are 1.851 mA/rpm (RMS).
    let [coulomb, viscous] = halted.numbers([155, P | 142]);
    assert_near(coulomb, 120.0);
    assert_near(viscous, 1_851.0);
    halted.assert_held();
}

#[test]
fn a_cancelled_identification_leaves_the_halted_motor_where_it_is_and_nothing_changed() {
    for (command, result) in [(IDENTIFY_WINDING, P | 111), (IDENTIFY_FLUX, P | 114)] {
        let mut halted = Halted::new();
        let before = halted.numbers([result]);
        halted.bench.write(command, Value::Word(3)).unwrap();
        halted.bench.run(Nanoseconds::from_millis(800));
        assert_eq!(halted.bench.write(command, Value::Word(1)), Err(0x7011), "it cannot be interrupted");
        halted.bench.write(command, Value::Word(0)).unwrap();
        assert_eq!(halted.numbers([command]), [0]);
        halted.assert_held();
        assert_eq!(halted.numbers([result]), before);
        halted.bench.write(command, Value::Word(3)).unwrap();
        assert_eq!(halted.numbers([command]), [EXECUTING]);
    }
}

#[test]
fn an_identification_needs_torque_halt_standstill_and_no_other_and_no_password() {
    let mut halted = Halted::new();
    halted.bench.write(IDENTIFY_FLUX, Value::Word(3)).unwrap();
    for other in [IDENTIFY_WINDING, IDENTIFY_INERTIA, 148] {
        assert_eq!(halted.bench.write(other, Value::Word(3)), Err(0x7012), "{}", Idn(other));
    }
    halted.bench.write(IDENTIFY_FLUX, Value::Word(0)).unwrap();
    halted.assert_held();
    halted.bench.write(267, Value::Bytes(b"press".to_vec())).unwrap();
    for command in [COMPUTE_GAINS, IDENTIFY_WINDING] {
        assert_eq!(halted.bench.write(command, Value::Word(3)), Err(0x7009), "{}", Idn(command));
    }
    let mut following = Bench::running();
    for command in [IDENTIFY_WINDING, IDENTIFY_FLUX, IDENTIFY_INERTIA] {
        assert_eq!(following.write(command, Value::Word(3)), Err(0x7012), "{}", Idn(command));
    }
    let mut idle = Bench::running();
    idle.run_up_and_read(&[]);
    assert_eq!(idle.write(IDENTIFY_WINDING, Value::Word(3)), Err(0x7012));
    assert!(!idle.has_torque());
}

#[test]
fn the_end_of_halt_ends_an_identification_and_a_command_that_is_far_off_is_not_followed() {
    let mut halted = Halted::new();
    halted.bench.write(IDENTIFY_FLUX, Value::Word(3)).unwrap();
    halted.bench.run(Nanoseconds::from_millis(1_000));
    // This master goes on with the position where the motor stood revolutions ago.
    halted.halt.set(false);
    halted.bench.run(Nanoseconds::from_millis(500));
    assert!(!halted.bench.has_torque());
    // The master has answered the error by taking ENABLE away: the motor coasts, and was not thrown back to the command.
    assert!((50.0..290.0).contains(&halted.bench.rpm()), "{}", halted.bench.rpm());
    assert_eq!(halted.bench.run_up_and_read(&[390]), [0xF10B]);
    assert_eq!(halted.bench.text(FINDING), "interrupted: HALT, torque or operation have ended");
}

#[test]
fn the_end_of_halt_ends_a_measurement_of_the_winding_and_the_drive_follows_from_where_it_is() {
    let mut halted = Halted::new();
    halted.bench.write(IDENTIFY_WINDING, Value::Word(3)).unwrap();
    halted.bench.run(Nanoseconds::from_millis(1_500));
    let before = halted.revolutions();
    halted.halt.set(false);
    halted.bench.run(Nanoseconds::from_millis(300));
    assert_eq!(halted.bench.number(IDENTIFY_WINDING), FAILED);
    assert_eq!(halted.bench.status() & 1 << 3, 1 << 3, "it follows");
    let moved = (halted.revolutions() - before) * 360.0;
    assert!(moved.abs() < 8.0, "{moved} degrees back to the command");
}

#[test]
fn an_error_ends_an_identification() {
    let mut halted = Halted::new();
    halted.bench.write(IDENTIFY_WINDING, Value::Word(3)).unwrap();
    halted.bench.run(Nanoseconds::from_millis(500));
    let progress = halted.bench.number(PROGRESS) as u8;
    assert!((1..50).contains(&progress), "{progress}");
    halted.bench.drive.motor_side.borrow_mut().set_amplifier_inputs(Amplifier { main_power: true, fault: true });
    halted.bench.run(Nanoseconds::from_millis(100));
    assert!(!halted.bench.has_torque());
    assert_eq!(halted.bench.run_up_and_read(&[390]), [0xF10F]);
    assert_eq!(halted.bench.text(FINDING), "interrupted: HALT, torque or operation have ended");
    assert_eq!(halted.bench.number(PROGRESS), u64::from(progress));
}

#[test]
fn a_motor_that_turns_further_than_it_may_is_stopped_and_said_so() {
    let mut halted = Halted::new();
    let start = halted.revolutions();
    halted.bench.write(P | 229, Value::Long(100)).unwrap();
    halted.bench.write(IDENTIFY_INERTIA, Value::Word(3)).unwrap();
    assert_eq!(halted.end_of(IDENTIFY_INERTIA), FAILED);
    assert!(halted.bench.text(FINDING).contains("further than P-0-0229"), "{}", halted.bench.text(FINDING));
    halted.assert_held();
    // A revolution, and the way of halt: 15.7 rad/s at 400 rad/s^2 are 0.05 revolutions.
    let turned = halted.revolutions() - start;
    assert!((1.0..1.15).contains(&turned), "{turned}");
    // A velocity of zero measures nothing.
    halted.bench.write(IDENTIFY_INERTIA, Value::Word(0)).unwrap();
    halted.bench.write(P | 218, Value::Long(0)).unwrap();
    halted.bench.write(IDENTIFY_INERTIA, Value::Word(3)).unwrap();
    assert_eq!(halted.bench.number(IDENTIFY_INERTIA), FAILED);
    assert!(halted.bench.text(FINDING).starts_with("velocity of the identification"), "{}", halted.bench.text(FINDING));
}
