//! The coordinates of the master over the ring: what it writes and reads as a position is that of S-0-0051, in every scaling and polarity,
//! absolute and modulo, in both directions, after any number of turns.

use std::cell::Cell;
use std::rc::Rc;

use crate::running::{ADDRESS, Bench, script};
use bench::DriveSetup;
use ring::Nanoseconds;
use ring::ident::{Idn, Value};
use ring::master::{CommandValues, MasterScript, Motion, Telegram};

const ON: u16 = 0xE000;
/// Rotary position data by S-0-0079, of the motor or the load; modulo.
const BY_RESOLUTION: u16 = 0x0A;
const OF_LOAD: u16 = 0x40;
const MODULO: u16 = 0x80;

/// A way of counting positions: parameters, increments of a revolution of the motor as a ratio, and the modulo value.
#[derive(Clone, Debug)]
struct Counting {
    parameters: Vec<(Idn, Value)>,
    numerator: i64,
    denominator: i64,
    modulo: Option<i64>,
}

impl Counting {
    fn preferred() -> Self {
        Self { parameters: vec![], numerator: 3_600_000, denominator: 1, modulo: None }
    }

    /// 32 bits are two revolutions.
    fn finest() -> Self {
        let parameters = vec![(Idn(76), Value::Word(BY_RESOLUTION)), (Idn(79), Value::Long(1 << 31))];
        Self { parameters, numerator: 1 << 31, denominator: 1, modulo: None }
    }

    /// Of a load that turns three times for seven turns of the motor: 14 revolutions of the motor.
    fn of_load() -> Self {
        let parameters = vec![
            (Idn(76), Value::Word(BY_RESOLUTION | OF_LOAD)),
            (Idn(79), Value::Long(715_827_883)),
            (Idn(121), Value::Long(7)),
            (Idn(122), Value::Long(3)),
        ];
        Self { parameters, numerator: 715_827_883 * 3, denominator: 7, modulo: None }
    }

    fn modulo_of_load() -> Self {
        let parameters = vec![
            (Idn(76), Value::Word(BY_RESOLUTION | OF_LOAD | MODULO)),
            (Idn(79), Value::Long(1_000_000)),
            (Idn(103), Value::Long(1_000_000)),
            (Idn(121), Value::Long(7)),
            (Idn(122), Value::Long(3)),
        ];
        Self { parameters, numerator: 3_000_000, denominator: 7, modulo: Some(1_000_000) }
    }

    fn modulo() -> Self {
        let parameters = vec![(Idn(76), Value::Word(0x82)), (Idn(103), Value::Long(3_600_000))];
        Self { parameters, numerator: 3_600_000, denominator: 1, modulo: Some(3_600_000) }
    }

    /// A thousandth of a revolution: ten increments of the encoder, so that the last half of the last one is met.
    fn coarse_modulo() -> Self {
        let parameters = vec![
            (Idn(76), Value::Word(BY_RESOLUTION | MODULO)),
            (Idn(79), Value::Long(1_000)),
            (Idn(103), Value::Long(1_000)),
        ];
        Self { parameters, numerator: 1_000, denominator: 1, modulo: Some(1_000) }
    }

    fn all() -> [Self; 5] {
        [Self::preferred(), Self::finest(), Self::of_load(), Self::modulo(), Self::modulo_of_load()]
    }

    /// Increments of so many degrees of the motor.
    fn increments(&self, degrees: f64) -> i64 {
        (degrees / 360.0 * self.numerator as f64 / self.denominator as f64).round() as i64
    }

    fn degrees(&self, increments: i64) -> f64 {
        increments as f64 * 360.0 * self.denominator as f64 / self.numerator as f64
    }

    /// An unbounded number of increments as the master sends it.
    fn data(&self, increments: i64) -> i32 {
        self.modulo.map_or(increments, |modulo| increments.rem_euclid(modulo)) as i32
    }

    /// The short way from one data value to another, in degrees of the motor.
    fn way(&self, from: i32, to: i32) -> f64 {
        let way = match self.modulo {
            None => i64::from(to.wrapping_sub(from)),
            Some(modulo) => (i64::from(to) - i64::from(from) + modulo / 2).rem_euclid(modulo) - modulo / 2,
        };
        self.degrees(way)
    }
}

/// A drive in CP4 whose master sends what the test has put down, whatever the drive answers.
struct Axis {
    bench: Bench,
    counting: Counting,
    commands: Rc<Cell<CommandValues>>,
}

impl Axis {
    fn new(mode: u16, counting: Counting, parameters: Vec<(Idn, Value)>) -> Self {
        let mdt = match mode {
            1 => Idn::TORQUE_COMMAND,
            2 => Idn::VELOCITY_COMMAND,
            _ => Idn::POSITION_COMMAND,
        };
        let mut drive = script().drives.remove(0).with(Idn::OPERATION_MODE, Value::Word(mode));
        // Windows in degrees of the motor, whatever an increment is.
        for (idn, degrees) in [(57, 1.0), (159, 30.0)] {
            let increments = counting.increments(degrees).min(i32::MAX.into());
            drive = drive.with(Idn(idn), Value::Long(increments as u32));
        }
        let drive = drive.with_all(counting.parameters.clone()).with_all(parameters);
        let drive =
            ring::master::DriveScript { telegram: Telegram::application(&[Idn(51), Idn(189)], &[mdt]), ..drive };
        let script = MasterScript { stops_at_refusals: false, ..MasterScript::new(vec![drive]) };
        let mut bench = Bench::new(DriveSetup::new(ADDRESS), script);
        for _ in 0..1_000 {
            bench.run(Nanoseconds::from_millis(10));
            if bench.world.ring().master().is_done() {
                assert_eq!(bench.world.ring().master().report().error, None);
                return Self { bench, counting, commands: Rc::default() };
            }
        }
        panic!("{}", bench.world.ring().master().state());
    }

    /// Switches on; position commands begin with S-0-0051.
    fn switch_on(&mut self) {
        let commands = Rc::clone(&self.commands);
        commands.set(CommandValues { position: self.position(), ..CommandValues::default() });
        let motion = Motion { patience: 100_000, ..Motion::new(u64::MAX, move |_| commands.get()) };
        let master = self.bench.world.ring_mut().master_mut();
        master.hold_switches(None);
        master.move_again(motion);
        for _ in 0..300 {
            self.run(10);
            let master = self.bench.world.ring().master();
            if matches!(master.state().activity, ring::master::Activity::Moving { .. }) {
                self.bench.world.ring_mut().master_mut().hold_switches(Some(ON));
                self.run(50);
                return;
            }
        }
        panic!("{} {}", self.bench.world.ring().master().state(), self.bench.text(95));
    }

    fn run(&mut self, milliseconds: u64) {
        self.bench.run(Nanoseconds::from_millis(milliseconds));
    }

    fn signed(&mut self, idn: u16) -> i32 {
        self.bench.number(idn) as u32 as i32
    }

    fn position(&mut self) -> i32 {
        self.signed(51)
    }

    fn write(&mut self, idn: u16, value: i32) {
        self.bench.write(idn, Value::Long(value as u32)).unwrap();
    }

    /// Angle of the motor in degrees, in the direction of its current.
    fn angle(&mut self) -> f64 {
        let now = self.bench.world.now().0;
        self.bench.drive.motor_side.borrow_mut().machine().angle(now) * 360.0
    }

    /// The place where the motor stands becomes this position.
    fn set_position(&mut self, position: i32) {
        self.write(52, position);
        self.bench.write(447, Value::Word(3)).unwrap();
        self.bench.write(447, Value::Word(0)).unwrap();
        self.run(10);
    }

    fn homes_where_it_stands(&mut self, position: i32) {
        self.write(52, position);
        self.bench.write(148, Value::Word(3)).unwrap();
        assert_eq!((self.bench.number(148), self.bench.number(403)), (3, 1));
    }

    /// Sends positions along a straight line for so many cycles of 2 ms, from where the command is.
    fn line(&mut self, increments_a_cycle: i64, cycles: i64) {
        let start = i64::from(self.commands.get().position);
        for cycle in 1..=cycles {
            self.command(self.counting.data(start + increments_a_cycle * cycle));
            self.run(2);
        }
    }

    fn command(&self, position: i32) {
        self.commands.set(CommandValues { position, ..self.commands.get() });
    }

    fn turn(&self, velocity: i32) {
        self.commands.set(CommandValues { velocity, ..self.commands.get() });
    }

    fn assert_no_error(&mut self) {
        assert_eq!(self.bench.number(11), 0, "{}", self.bench.text(95));
        assert!(self.bench.has_torque());
    }
}

/// 1 where positions count with the motor, -1 where they count against it.
fn sense(polarity: u16) -> f64 {
    if polarity & 1 == 0 { 1.0 } else { -1.0 }
}

fn near(actual: f64, expected: f64, tolerance: f64, what: &str) {
    assert!((actual - expected).abs() <= tolerance, "{what}: {actual}, expected {expected}");
}

#[test]
fn a_command_that_goes_over_the_border_of_its_32_bits_is_a_small_step_in_every_scaling_polarity_and_direction() {
    for counting in Counting::all() {
        for (polarity, direction) in [(0, 1), (0, -1), (7, 1), (7, -1)] {
            let what = format!("{counting:?}, S-0-0055 = {polarity}, {direction}");
            let mut axis = Axis::new(11, counting.clone(), vec![(Idn(55), Value::Word(polarity))]);
            // Half a revolution of the motor before the border of absolute data.
            let to_border = counting.increments(180.0);
            let border = if direction > 0 { i64::from(i32::MAX) } else { i64::from(i32::MIN) };
            axis.set_position(counting.data(border - direction * to_border));
            axis.switch_on();
            let (before, start) = (axis.angle(), axis.position());
            // 100 rpm: 1.2 degrees in 2 ms, for three revolutions.
            axis.line(direction * counting.increments(1.2), 900);
            axis.run(100);
            axis.assert_no_error();
            let turned = (axis.angle() - before) * sense(polarity);
            let commanded = counting.degrees(direction * 900 * counting.increments(1.2));
            near(turned, commanded, 0.2, &what);
            let (command, shown) = (axis.commands.get().position, axis.position());
            near(counting.way(shown, command), 0.0, 0.1, &what);
            let along = counting.data(i64::from(start) + direction * 900 * counting.increments(1.2));
            near(counting.way(along, shown), 0.0, 0.2, &what);
            if let Some(modulo) = counting.modulo {
                assert!((0..modulo).contains(&i64::from(shown)), "{what}: {shown}");
            }
        }
    }
}

#[test]
fn switching_on_beside_the_border_is_no_jump() {
    for polarity in [0, 7] {
        let mut axis = Axis::new(11, Counting::preferred(), vec![(Idn(55), Value::Word(polarity))]);
        axis.set_position(i32::MAX - 100);
        axis.switch_on();
        let before = axis.angle();
        axis.command(i32::MIN + 100);
        axis.run(100);
        axis.assert_no_error();
        near(axis.angle(), before, 0.1, "201 increments are 0.02 degrees");
        // Bit 15 off and on, with the command beyond the border.
        axis.bench.world.ring_mut().master_mut().hold_switches(Some(0));
        axis.run(600);
        axis.bench.world.ring_mut().master_mut().hold_switches(Some(ON));
        axis.run(600);
        axis.assert_no_error();
        near(axis.angle(), before, 0.1, "switched on again");
    }
}

#[test]
fn a_drive_that_goes_by_itself_does_not_take_an_absolute_axis_over_the_border() {
    for polarity in [0, 7] {
        // 32 bits are two revolutions: the axis stands 30 degrees below the border, its target lies 30 degrees above.
        let counting = Counting::finest();
        let parameters = vec![
            (Idn(55), Value::Word(polarity)),
            (Idn(259), Value::Long(3_000_000)),
            (Idn(260), Value::Long(400_000)),
        ];
        let mut axis = Axis::new(0x1B, counting.clone(), parameters);
        axis.set_position(counting.data(i64::from(i32::MAX) - counting.increments(30.0)));
        axis.write(258, counting.data(i64::from(i32::MAX) - counting.increments(30.0)));
        axis.switch_on();
        let before = axis.angle();
        let target = counting.data(i64::from(i32::MIN) + counting.increments(30.0));
        axis.write(258, target);
        axis.run(2_000);
        axis.assert_no_error();
        near((axis.angle() - before) * sense(polarity), -660.0, 0.1, "the way that the numbers go");
        let shown = axis.position();
        near(counting.way(shown, target), 0.0, 0.1, "S-0-0051 is the target");
    }
}

#[test]
fn every_position_is_in_the_coordinates_of_the_feedback_whatever_the_polarity() {
    for counting in Counting::all() {
        for polarity in [0, 2, 5, 7] {
            let what = format!("{counting:?}, S-0-0055 = {polarity}");
            let parameters = vec![(Idn(55), Value::Word(polarity)), (Idn(0x8000 + 2705), Value::Word(1))];
            let mut axis = Axis::new(3, counting.clone(), parameters);
            let reference = counting.data(counting.increments(50.0));
            axis.set_position(reference);
            near(counting.way(axis.position(), reference), 0.0, 0.05, &format!("{what}, S-0-0447"));
            axis.switch_on();
            axis.homes_where_it_stands(counting.data(counting.increments(75.0)));
            axis.run(20);
            near(counting.way(counting.data(counting.increments(75.0)), axis.position()), 0.0, 0.05, &what);
            let aligned = axis.signed(47);
            axis.command(aligned);
            axis.bench.write(148, Value::Word(0)).unwrap();
            axis.run(100);
            axis.assert_no_error();

            // A command upwards makes the feedback rise, and the motor turn by the polarity; it lags behind by v/Kv.
            let (angle, start) = (axis.angle(), axis.position());
            axis.line(counting.increments(0.6), 200);
            let sample = *axis.bench.world.ring().master().report().samples.last().unwrap();
            let lag = counting.degrees(sample.following_distance.unwrap().into());
            // 50 rpm at the 62.5 1/s of the press are 4.8 degrees. The command of the AT's cycle is reached a cycle or two later.
            near(lag, 4.8, 0.2, &format!("{what}, S-0-0189"));
            let (command, shown) = (sample.position_command, sample.position.unwrap());
            near(counting.way(shown, command), lag, 1.3, &format!("{what}, S-0-0047 - S-0-0051"));
            axis.run(600);
            let [command, shown, second] = [47, 51, 53].map(|idn| axis.signed(idn));
            assert_eq!(command, axis.commands.get().position, "{what}");
            near(counting.way(shown, second), 0.0, 0.05, &format!("{what}, S-0-0053"));
            near(counting.way(start, axis.position()), 120.0, 0.2, &what);
            near((axis.angle() - angle) * sense(polarity), 120.0, 0.2, &what);

            // The additive command has a bit of its own.
            let before = axis.position();
            for step in 1..=5 {
                axis.write(48, counting.increments(f64::from(step) * 4.0) as i32);
                axis.run(50);
            }
            let added = counting.way(before, axis.position());
            let with = if polarity == 0 || polarity == 7 { 20.0 } else { -20.0 };
            near(added, with, 0.2, &format!("{what}, S-0-0048"));
            axis.assert_no_error();
        }
    }
}

#[test]
fn the_drive_goes_to_its_target_in_the_coordinates_of_the_feedback() {
    for counting in Counting::all() {
        for polarity in [0, 7] {
            let what = format!("{counting:?}, S-0-0055 = {polarity}");
            let parameters = vec![
                (Idn(55), Value::Word(polarity)),
                (Idn(259), Value::Long(1_200_000)),
                (Idn(260), Value::Long(200_000)),
            ];
            let mut axis = Axis::new(0x1B, counting.clone(), parameters);
            axis.set_position(counting.data(counting.increments(20.0)));
            axis.write(258, counting.data(counting.increments(20.0)));
            axis.switch_on();
            for (target, way) in [(110.0, 90.0), (40.0, -70.0)] {
                let (before, data) = (axis.angle(), counting.data(counting.increments(target)));
                axis.write(258, data);
                axis.run(800);
                near(counting.way(axis.position(), data), 0.0, 0.1, &what);
                near((axis.angle() - before) * sense(polarity), way, 0.2, &what);
            }
        }
    }
}

#[test]
fn probes_read_the_coordinates_of_the_instant_of_their_edge() {
    for counting in [Counting::preferred(), Counting::modulo(), Counting::modulo_of_load()] {
        for polarity in [0, 7] {
            let what = format!("{counting:?}, S-0-0055 = {polarity}");
            let parameters = vec![(Idn(55), Value::Word(polarity)), (Idn(169), Value::Word(1))];
            let mut axis = Axis::new(11, counting.clone(), parameters);
            axis.switch_on();
            axis.bench.write(170, Value::Word(3)).unwrap();
            axis.bench.write(405, Value::Word(1)).unwrap();
            axis.line(counting.increments(1.2), 100);
            axis.run(100);
            let at_edge = axis.position();
            axis.bench.drive.motor_side.borrow_mut().change_inputs(|inputs| inputs.probe_1 = true);
            axis.run(10);
            // Three revolutions on, the value is still that of the edge.
            axis.line(counting.increments(1.2), 900);
            let taken = axis.signed(130);
            near(counting.way(at_edge, taken), 0.0, 0.05, &what);
            assert!(counting.modulo.is_none_or(|modulo| (0..modulo).contains(&i64::from(taken))), "{what}: {taken}");
        }
    }
}

#[test]
fn homing_to_a_switch_goes_and_counts_in_the_coordinates_of_the_feedback() {
    for polarity in [0, 7] {
        for negative in [0, 1] {
            let what = format!("S-0-0055 = {polarity}, S-0-0147 bit 0 = {negative}");
            let parameters =
                vec![(Idn(55), Value::Word(polarity)), (Idn(41), Value::Long(300_000)), (Idn(42), Value::Long(50_000))];
            let mut axis = Axis::new(11, Counting::preferred(), parameters);
            axis.switch_on();
            axis.write(52, 500_000);
            axis.write(150, 100_000);
            axis.bench.write(147, Value::Word(0x44 | negative)).unwrap();
            axis.bench.write(148, Value::Word(3)).unwrap();
            // The switch, 40 degrees away in the homing direction as S-0-0051 counts.
            let way = if negative == 0 { sense(polarity) } else { -sense(polarity) };
            let mut edge = f64::NAN;
            for _ in 0..4_000 {
                let angle = axis.angle();
                let on = angle * way >= 40.0;
                if on && edge.is_nan() {
                    edge = angle;
                }
                axis.bench.drive.motor_side.borrow_mut().change_inputs(|inputs| inputs.home_switch = on);
                axis.bench.run(Nanoseconds::from_microseconds(250));
            }
            assert_eq!(axis.bench.number(148), 3, "{what}: {}", axis.bench.text(0x8003));
            let here = f64::from(axis.position()) / 10_000.0;
            let of_edge = here - (axis.angle() - edge) * sense(polarity);
            near(of_edge, 40.0, 0.1, &what);
        }
    }
}

#[test]
fn position_limits_count_as_the_feedback_does() {
    for polarity in [0, 7] {
        for direction in [1, -1] {
            let what = format!("S-0-0055 = {polarity}, {direction}");
            let parameters = vec![
                (Idn(55), Value::Word(0x10 | polarity)),
                (Idn(49), Value::Long(1_000_000)),
                (Idn(50), Value::Long(-100_000_i32 as u32)),
            ];
            let mut axis = Axis::new(11, Counting::preferred(), parameters);
            axis.switch_on();
            axis.homes_where_it_stands(300_000);
            axis.run(20);
            axis.command(300_000);
            axis.bench.write(148, Value::Word(0)).unwrap();
            axis.run(50);
            // To half a degree before the limit: 60 rpm are 0.72 degrees in 2 ms.
            let inside = if direction > 0 { 995_000 } else { -95_000 };
            let (start, cycles) = (300_000_i64, 100);
            axis.line((inside - start) / cycles, cycles);
            axis.command(inside as i32);
            axis.run(100);
            axis.assert_no_error();
            axis.line(direction * 1_000, 20);
            axis.run(300);
            assert_eq!(axis.bench.number(11), 1 << 13, "{what}");
            let limit = if direction > 0 { 1_000_000 } else { -100_000 };
            let over = (f64::from(axis.position()) - f64::from(limit)) / 10_000.0 * direction as f64;
            assert!((-0.2..1.0).contains(&over), "{what}: {over} degrees over the limit");
        }
    }
}

#[test]
fn velocity_limits_and_their_names_count_as_the_velocity_data_do() {
    for polarity in [0, 7] {
        let parameters = vec![
            (Idn(43), Value::Word(polarity)),
            (Idn(38), Value::Long(1_000_000)),
            (Idn(39), Value::Long(-2_000_000_i32 as u32)),
        ];
        let mut axis = Axis::new(2, Counting::preferred(), parameters);
        axis.switch_on();
        for (command, limited, name) in [(3_000_000, 100.0, 1 << 9), (-3_000_000, -200.0, 1 << 10)] {
            axis.turn(command);
            axis.run(500);
            near(f64::from(axis.signed(40)) / 10_000.0, limited, 2.0, "S-0-0040");
            near(axis.bench.rpm() * sense(polarity), limited, 2.0, "the motor");
            assert_eq!(axis.bench.number(0x8000 + 160) & 0xE00, name, "P-0-0160");
        }
    }
}

#[test]
fn torque_limits_and_their_names_count_as_the_torque_data_do() {
    for polarity in [0, 7] {
        let parameters = vec![
            (Idn(85), Value::Word(polarity)),
            (Idn(82), Value::Word(100)),
            (Idn(83), Value::Word(-200_i16 as u16)),
        ];
        let mut axis = Axis::new(1, Counting::preferred(), parameters);
        axis.switch_on();
        for (torque, limited, name) in [(400, 100.0, 1), (-400, -200.0, 2)] {
            axis.commands.set(CommandValues { torque, ..CommandValues::default() });
            axis.run(30);
            near(f64::from(axis.bench.number(84) as u16 as i16), limited, 15.0, "S-0-0084");
            assert_eq!(axis.bench.number(0x8000 + 160) & 7, name, "P-0-0160");
            axis.commands.set(CommandValues::default());
            axis.run(30);
        }
    }
}

#[test]
fn beyond_a_limit_the_axis_can_be_switched_on_held_and_brought_back_but_not_taken_further() {
    // Resting places of a seventh of a revolution and more, on both sides, read with the rounding of the encoder.
    for polarity in [0, 7] {
        for side in [1, -1] {
            let parameters = vec![
                (Idn(55), Value::Word(0x10 | polarity)),
                (Idn(49), Value::Long(1_000_000)),
                (Idn(50), Value::Long(-1_000_000_i32 as u32)),
            ];
            let mut axis = Axis::new(11, Counting::preferred(), parameters);
            for place in 0..24 {
                let what = format!("S-0-0055 = {polarity}, side {side}, place {place}");
                axis.set_position(side * (1_000_000 + 137_000 * place));
                // The limit itself is the end of what is inside.
                axis.switch_on();
                axis.run(100);
                axis.assert_no_error();
                assert_eq!(axis.bench.number(11), 0, "{what}");
                axis.bench.world.ring_mut().master_mut().hold_switches(Some(0));
                axis.run(300);
            }
            axis.set_position(side * 1_500_000);
            axis.switch_on();
            // In by 20 degrees, and a little out again is an error.
            axis.line(i64::from(-side) * 2_000, 100);
            axis.run(100);
            axis.assert_no_error();
            axis.line(i64::from(side) * 1_000, 20);
            axis.run(300);
            assert_eq!(axis.bench.number(11), 1 << 13, "outwards");
            assert_eq!(axis.bench.number(390), 0xF10D);
            axis.bench.clear_errors();
            assert_eq!(axis.bench.number(11), 0);
            axis.bench.world.ring_mut().master_mut().hold_switches(Some(0));
            axis.run(100);
            axis.switch_on();
            axis.line(i64::from(-side) * 5_000, 100);
            axis.run(100);
            axis.assert_no_error();
            assert!(axis.position().abs() < 1_000_000, "home again");
        }
    }
}

#[test]
fn beyond_a_limit_in_velocity_mode_only_a_velocity_outwards_is_an_error() {
    for polarity in [0, 7] {
        let parameters = vec![
            (Idn(43), Value::Word(polarity)),
            (Idn(55), Value::Word(0x10 | polarity)),
            (Idn(49), Value::Long(1_000_000)),
            (Idn(50), Value::Long(-1_000_000_i32 as u32)),
        ];
        let mut axis = Axis::new(2, Counting::preferred(), parameters);
        axis.set_position(1_137_000);
        axis.switch_on();
        axis.run(300);
        axis.assert_no_error();
        axis.turn(-10_000);
        axis.run(300);
        axis.assert_no_error();
        axis.turn(10_000);
        axis.run(300);
        assert_eq!(axis.bench.number(11), 1 << 13);
    }
}

#[test]
fn modulo_feedback_is_never_the_modulo_value() {
    for counting in [Counting::modulo(), Counting::modulo_of_load(), Counting::coarse_modulo()] {
        for polarity in [0, 7] {
            let mut axis = Axis::new(11, counting.clone(), vec![(Idn(55), Value::Word(polarity))]);
            let modulo = counting.modulo.unwrap();
            axis.switch_on();
            // Slowly over the border, there and back, with the feedback in every AT.
            for direction in [-1, 1, -1] {
                axis.line(direction * counting.increments(0.01).max(1), 300);
            }
            let samples = &axis.bench.world.ring().master().report().samples;
            let shown: Vec<i32> = samples.iter().filter_map(|sample| sample.position).collect();
            assert!(shown.iter().all(|&shown| (0..modulo).contains(&i64::from(shown))), "{counting:?}");
            assert!(shown.iter().any(|&shown| i64::from(shown) > modulo / 2), "it has crossed the border");
            assert!(shown.iter().any(|&shown| i64::from(shown) < modulo / 2), "it has crossed the border");
        }
    }
}

#[test]
fn while_homing_holds_the_axis_its_command_reads_the_held_place_and_a_master_that_takes_it_over_goes_on() {
    for counting in Counting::all() {
        for polarity in [0, 7] {
            let what = format!("{counting:?}, S-0-0055 = {polarity}");
            let mut axis = Axis::new(11, counting.clone(), vec![(Idn(55), Value::Word(polarity))]);
            axis.switch_on();
            axis.write(48, counting.increments(5.0) as i32);
            axis.run(100);
            let angle = axis.angle();
            let reference = counting.data(counting.increments(123.0));
            axis.homes_where_it_stands(reference);
            let read = axis.signed(47);
            let held = counting.way(read, reference);
            near(held, 5.0, 0.05, &format!("{what}: S-0-0047 and S-0-0048 are the held place"));
            assert_eq!(axis.signed(47), read, "{what}: it stays");
            // Align, cancel.
            axis.command(read);
            axis.run(10);
            axis.bench.write(148, Value::Word(0)).unwrap();
            axis.run(200);
            axis.assert_no_error();
            near(axis.angle(), angle, 0.1, &what);
            assert_eq!(axis.signed(47), read, "{what}");
            assert_ne!(axis.bench.status() & 1 << 3, 0, "{what}: it follows");
        }
    }
}

#[test]
fn a_command_that_is_not_cyclic_is_brought_into_the_new_coordinates_by_homing() {
    // Velocity mode, and position mode beside it whose commands come over the service channel.
    let mut axis = Axis::new(2, Counting::preferred(), vec![]);
    axis.switch_on();
    axis.homes_where_it_stands(700_000);
    axis.run(10);
    axis.bench.write(148, Value::Word(0)).unwrap();
    near(f64::from(axis.signed(47)) / 10_000.0, 70.0, 0.1, "S-0-0047 after the command");
}

#[test]
fn no_data_block_with_a_direction_is_missing_from_the_table_of_polarities() {
    use sercos::unit::Unit;
    let page = include_str!("../docs/polarity.md");
    let rows: Vec<&str> = page.lines().filter(|line| line.starts_with("| S-") || line.starts_with("| P-")).collect();
    let has_motion = |unit: Unit| match unit {
        Unit::Scaled(_) => true,
        Unit::Fixed(unit) => ["deg", "rpm", "rad/s^2", "rad/s^3", "mm", "Nm", "N"].contains(&unit),
    };
    let mut found = 0;
    for block in drive::DICTIONARY.blocks().iter().filter(|block| has_motion(block.unit)) {
        let row = format!("| {} | {} | ", block.idn, block.name);
        let rows = rows.iter().filter(|line| line.starts_with(&row)).count();
        assert_eq!(rows, 1, "docs/polarity.md has no row {row}");
        found += 1;
    }
    assert!(found >= 50, "{found}");
    for direction in ["S-0-0147", "S-0-0346", "S-0-0393"] {
        assert!(rows.iter().any(|row| row.starts_with(&format!("| {direction} "))), "{direction} has a direction");
    }
}

/// One increment of velocity data is 1 rpm.
const WHOLE_RPM: [(Idn, Value); 3] =
    [(Idn(44), Value::Word(0x0A)), (Idn(45), Value::Word(1)), (Idn(46), Value::Word(0))];

#[test]
fn windows_keep_their_value_when_the_scaling_changes_and_a_motor_that_turns_does_not_stand() {
    let mut axis = Axis::new(2, Counting::preferred(), vec![]);
    let windows = [124, 125, 157, 41, 259].map(|idn| (idn, axis.signed(idn)));
    // The next set is written by somebody who knows of the scaling, but of no windows. Limits of a foreign control have to be written.
    let mut drive = script().drives.remove(0);
    drive.parameters.retain(|(idn, _)| ![44, 45, 46, 124, 125, 157, 41, 259, 91, 113].contains(&idn.0));
    let drive = drive.with(Idn::OPERATION_MODE, Value::Word(2)).with_all(WHOLE_RPM).with(Idn(91), Value::Long(3_000));
    let motion = Motion { patience: 100_000, ..Motion::new(u64::MAX, |_| CommandValues::at_velocity(600)) };
    let script = MasterScript { motion: Some(motion), stops_at_refusals: false, ..MasterScript::new(vec![drive]) };
    axis.bench.world.ring_mut().master_mut().restart(script);
    for _ in 0..1_000 {
        axis.run(10);
        if axis.bench.rpm() > 599.0 {
            break;
        }
    }
    axis.run(300);
    assert!((598.0..602.0).contains(&axis.bench.rpm()), "{} rpm, {}", axis.bench.rpm(), axis.bench.text(0x8003));
    assert_eq!(axis.bench.number(13) & 0b110, 0, "neither standstill nor below the threshold of 100 rpm");
    for (idn, number) in windows {
        let rpm = f64::from(number) / 10_000.0;
        near(f64::from(axis.signed(idn)), rpm.round().max(1.0), 0.01, &format!("S-0-{idn:04}"));
    }
}

#[test]
fn a_value_that_does_not_fit_the_new_scaling_is_asked_for_by_the_transition_check() {
    let mut drive = script().drives.remove(0);
    drive.parameters.retain(|(idn, _)| idn.0 != 91);
    // 10^-8 rpm: the 3 000 rpm of S-0-0091 would be 3 * 10^11.
    let drive = drive.with_all([(Idn(44), Value::Word(0x0A)), (Idn(46), Value::Word(-8_i16 as u16))]);
    let script = MasterScript { stops_at_refusals: false, ..MasterScript::new(vec![drive]) };
    let mut bench = Bench::new(DriveSetup::new(ADDRESS), script);
    bench.run(Nanoseconds::from_millis(4_000));
    let error = format!("{:?}", bench.world.ring().master().report().error);
    assert!(error.contains("91"), "{error}");
    assert_eq!(bench.world.ring().master().phase(), 0);
}
