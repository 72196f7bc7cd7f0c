//! Any life that an axis could have: what a control unit does on purpose, what it does by mistake, and what happens to both.

use fault_matrix::Fault;

use super::axis::{MODES, command_of};
use crate::dice::Dice;
use crate::life::{Action, Axis, Event, Plant};
use crate::units::{Units, setting};

/// Bits 15, 14, 13 of the control word.
pub(super) const FOLLOW: u8 = 0b111;
pub(super) const HALT: u8 = 0b110;
pub(super) const OFF: u8 = 0b011;
const DISABLE: u8 = 0b101;
pub(super) const NOTHING: u8 = 0;
/// In ms: a load that has changed is forgotten, and a shaft that was fast stands; an axis that has been switched on stays on.
pub(super) const QUIET: f64 = 600.0;
const IN_OPERATION: f64 = 320.0;

pub(crate) const FAULTS: [Fault; 26] = [
    Fault::Overcurrent,
    Fault::CurrentSum,
    Fault::ConvertersStuck,
    Fault::Overvoltage,
    Fault::MainPowerLost,
    Fault::EmergencyStop,
    Fault::GateDriver,
    Fault::EncoderFrozen,
    Fault::EncoderSlip,
    Fault::EncoderJump,
    Fault::CommutationDisturbed,
    Fault::MotorWarm,
    Fault::MotorHot,
    Fault::HeatSinkHot,
    Fault::TemperatureSensorBroken,
    Fault::Overspeed,
    Fault::SafeTorqueOff,
    Fault::OneSafeTorqueChannel,
    Fault::RingJitter,
    Fault::MstLost,
    Fault::TwoMstsLost,
    Fault::TwoMdtsLost,
    Fault::FibreBroken,
    Fault::PhaseRegression,
    Fault::OneLateCycle,
    Fault::LateCycles,
];
pub(crate) const BRAKE_FAULTS: [Fault; 3] = [Fault::BrakeStuckClosed, Fault::BrakeStuckOpen, Fault::BrakeWorn];

/// Whoever writes a life, an event after the other.
pub(super) struct Writer<'a> {
    pub(super) dice: &'a mut Dice,
    pub(super) axis: &'a Axis,
    pub(super) units: Units,
    fastest: f64,
    now: u32,
    events: Vec<Event>,
    /// S-0-0346 bit 0.
    toggle: i64,
    /// The axis has become another machine: nothing is switched on before it has its own data again.
    pub(super) ended: bool,
}

/// Events of a life, and how long it is watched after the last.
pub(super) fn any(dice: &mut Dice, axis: &Axis) -> (Vec<Event>, u32) {
    let least = 10 + dice.below(25) as usize;
    let mut writer = Writer::new(dice, axis);
    writer.beginning();
    while writer.events.len() < least && !writer.ended {
        writer.phrase();
        writer.pause();
    }
    let rest = writer.dice.weighted(&[(6, 20_000), (3, 80_000), (1, 250_000)]).unwrap_or(20_000);
    (writer.events, rest)
}

impl<'a> Writer<'a> {
    pub(super) fn new(dice: &'a mut Dice, axis: &'a Axis) -> Self {
        let fastest = f64::from(axis.plant.axis().maximum_speed);
        Self { dice, axis, units: Units::of(axis), fastest, now: 0, events: Vec::new(), toggle: 0, ended: false }
    }
}

impl Writer<'_> {
    pub(super) fn event(&mut self, action: Action) {
        self.events.push(Event { at: self.now, action });
    }

    pub(super) fn wait(&mut self, milliseconds: f64) {
        // Whole microseconds, so that a life is the same in a file.
        self.now += (milliseconds * 1_000.0).max(0.0) as u32;
    }

    pub(super) fn pause(&mut self) {
        let longest = self.dice.weighted(&[(3, 3.0), (5, 12.0), (2, 40.0)]).unwrap_or(12.0);
        let span = longest * self.dice.share();
        self.wait(span);
    }

    fn beginning(&mut self) {
        self.wait(1.0);
        self.block_from_the_start();
        if self.dice.chance(15) {
            self.set_absolute();
        }
        if self.dice.chance(85) {
            self.event(Action::Switches(FOLLOW));
            self.pause();
            self.wait_for_the_angle();
            // Before anything has happened, while nothing disturbs what some laws look at.
            match self.dice.weighted(&[(88, 0_u8), (6, 1), (3, 2), (3, 3)]) {
                Some(1) => self.home_in_peace(),
                Some(2) => {
                    self.wait(QUIET);
                    self.identify();
                }
                Some(3) => self.wait(IN_OPERATION),
                _ => {}
            }
        }
        self.overload_at_once();
    }

    /// A control that waits until all is quiet, resets, switches on and sees that it lasts.
    pub(super) fn come_back_in_peace(&mut self) {
        self.event(Action::Switches(NOTHING));
        self.event(Action::Repair);
        for idn in [36, 37] {
            if self.axis.mdt.contains(&idn) {
                self.event(Action::Set(idn, 0));
            }
        }
        self.event(Action::Align(true));
        self.event(Action::Load(0));
        self.wait(QUIET);
        self.event(Action::Start(99));
        self.wait(20.0);
        self.event(Action::Cancel(99));
        self.wait(20.0);
        self.event(Action::Switches(FOLLOW));
        self.wait(IN_OPERATION);
    }

    /// A few events that belong together.
    fn phrase(&mut self) {
        let kind = self.dice.weighted(&[
            (16, 0u8),
            (12, 1),
            (8, 2),
            (8, 3),
            (8, 4),
            (10, 5),
            (5, 6),
            (5, 7),
            (4, 8),
            (4, 9),
            (3, 10),
            (3, 11),
            (5, 12),
            (5, 13),
            (2, 14),
            (3, 15),
            (2, 16),
            (3, 17),
            (2, 18),
            (2, 19),
            (1, 20),
            (1, 21),
            (1, 22),
            (1, 24),
            (1, 25),
            (1, 23),
        ]);
        match kind.unwrap_or(0) {
            0 => self.command(),
            1 => self.stop(),
            2 => self.blip(),
            3 => self.jump(),
            4 => self.switch_mode(),
            5 => self.write(),
            6 => self.disturb(),
            7 => self.fault(),
            8 => self.run_up(),
            9 => self.load(),
            10 => self.supply(),
            11 => self.set_absolute(),
            12 => self.home(),
            13 => self.recover(),
            14 => self.defaults(),
            15 => self.command_of_any_kind(),
            16 => self.press_against_a_stop(),
            17 => self.read(),
            19 => self.catch_at_speed(),
            20 => self.ordeal(),
            21 => self.run_up_with_changes(),
            22 => self.identify(),
            24 => self.probe(),
            25 => self.come_back_in_peace(),
            23 => self.foreign_data(),
            _ => self.leave_alone(),
        }
    }

    /// A mode that the axis has set, by its number in the control word.
    pub(super) fn any_mode(&mut self) -> (u8, i64) {
        let set: Vec<(u8, i64)> =
            (0..8).filter_map(|bits| Some((bits, setting(self.axis, MODES[usize::from(bits)])?))).collect();
        self.dice.pick(&set).unwrap_or((0, setting(self.axis, 32).unwrap_or(2)))
    }

    fn any_command(&mut self) -> u16 {
        self.dice.pick(&self.axis.mdt).unwrap_or(47)
    }

    pub(super) fn rpm(&mut self) -> f64 {
        let most = self.fastest * 0.9;
        self.dice.spread(2.0, most)
    }

    pub(super) fn long(value: f64) -> i64 {
        value.round().clamp(f64::from(i32::MIN), f64::from(i32::MAX)) as i64
    }

    /// The axis is asked to move.
    pub(super) fn command(&mut self) {
        let idn = if self.dice.chance(70) { command_of(self.any_mode().1) } else { self.any_command() };
        let rpm = self.rpm();
        match idn {
            36 | 37 => {
                let velocity = Self::long(rpm * self.units.rpm);
                let steps = self.dice.chance(70);
                self.event(if steps {
                    Action::Set(idn, velocity)
                } else {
                    Action::Ramp(idn, velocity.saturating_mul(10))
                });
            }
            47 | 48 => {
                let per_second = Self::long(rpm / 60.0 * self.units.revolution);
                // A machine's shaft starts gently.
                if self.dice.chance(60) {
                    for share in [4, 2] {
                        self.event(Action::Ramp(idn, per_second / share));
                        self.wait(5.0);
                    }
                }
                self.event(Action::Ramp(idn, per_second));
            }
            80 | 81 => {
                let torque = self.dice.spread(5.0, 1_500.0) as i64;
                self.event(Action::Set(idn, torque));
            }
            258 => {
                let degrees = self.dice.spread(1.0, 2_000.0);
                self.event(Action::Set(idn, self.units.degrees(degrees)));
            }
            282 | 346 => self.position_by_control(),
            _ => {
                let value = self.dice.between(0, 0xFFFF);
                self.event(Action::Set(idn, value));
            }
        }
    }

    /// A position or distance, and S-0-0346 that has it taken over.
    fn position_by_control(&mut self) {
        let degrees = self.dice.spread(1.0, 2_000.0);
        self.event(Action::Set(282, self.units.degrees(degrees)));
        self.wait(4.0);
        // Bit 3: a distance, 4: from where it is, 5: at once; bits 2 and 1: turns, or stops.
        let way = self.dice.pick(&[0, 0, 0x08, 0x18, 0x20, 0x28, 0x02, 0x04, 0x06]).unwrap_or(0);
        self.toggle ^= 1;
        let control = way | self.toggle;
        let in_mdt = self.axis.mdt.contains(&346);
        self.event(if in_mdt { Action::Set(346, control) } else { Action::Write(346, control) });
    }

    pub(super) fn stop(&mut self) {
        let bits =
            self.dice.weighted(&[(4, HALT), (4, OFF), (1, DISABLE), (2, NOTHING), (1, 0b001), (1, 0b100), (1, 0b010)]);
        self.event(Action::Switches(bits.unwrap_or(HALT)));
        if self.dice.chance(70) {
            self.pause();
            if self.dice.chance(30) {
                let align = self.dice.chance(50);
                self.event(Action::Align(align));
            }
            self.event(Action::Switches(FOLLOW));
        }
    }

    fn blip(&mut self) {
        let bits = self.dice.between(0, 7) as u8;
        let bits = if self.dice.chance(60) { self.dice.pick(&[HALT, OFF]).unwrap_or(OFF) } else { bits };
        let cycles = self.dice.between(1, 20) as u8;
        self.event(Action::Blip(bits, cycles));
    }

    fn jump(&mut self) {
        if self.axis.mdt.contains(&47) && self.dice.chance(85) {
            let idn = if self.axis.mdt.contains(&48) && self.dice.chance(20) { 48 } else { 47 };
            let degrees = if self.dice.chance(25) {
                // Just beyond what a cycle of the control unit may bring.
                let seconds = f64::from(self.axis.cycle) * f64::from(self.axis.control_cycles) * 1e-6;
                let limit = setting(self.axis, 91).map_or(self.fastest, |limit| limit as f64 / self.units.rpm);
                self.dice.spread(1.5, 8.0) * limit * 6.0 * seconds
            } else {
                self.dice.spread(0.05, 50_000.0)
            };
            let by = if self.dice.chance(90) {
                Self::long(self.units.revolution * degrees / 360.0)
            } else {
                self.dice.between(i32::MIN.into(), i32::MAX.into())
            };
            self.event(Action::Jump(idn, by));
        } else {
            let idn = self.any_command();
            let value = self.dice.pick(&[i32::MIN.into(), i32::MAX.into(), 0, 1, -1, 0x7FFF, 0x8000]).unwrap_or(0);
            self.event(Action::Set(idn, value));
        }
    }

    fn switch_mode(&mut self) {
        let bits = if self.dice.chance(85) { self.any_mode().0 } else { self.dice.between(0, 7) as u8 };
        self.event(Action::Mode(bits));
        if self.dice.chance(50) {
            self.pause();
            self.command();
        }
    }

    fn disturb(&mut self) {
        let action = match self.dice.below(10) {
            0 | 1 => Action::LoseMst(self.dice.weighted(&[(5, 1), (3, 2), (2, 3), (1, 8)]).unwrap_or(1)),
            2 | 3 => Action::LoseMdt(self.dice.weighted(&[(5, 1), (3, 2), (2, 3), (1, 8)]).unwrap_or(1)),
            4 => Action::DamageMst(self.dice.below(50) as u8),
            5 | 6 => Action::DamageMdt(self.dice.below(150) as u16),
            7 => Action::WrongPhase(self.dice.between(0, 9) as u8),
            8 => Action::Dark(self.dice.weighted(&[(3, 1), (3, 3), (2, 15)]).unwrap_or(3)),
            _ => Action::FallBack(self.dice.between(0, 3) as u8),
        };
        self.event(action);
    }

    fn fault(&mut self) {
        let fault = if self.axis.plant == Plant::Vertical && self.dice.chance(30) {
            self.dice.pick(&BRAKE_FAULTS)
        } else {
            self.axis.built_for.filter(|_| self.dice.chance(60)).or_else(|| self.dice.pick(&FAULTS))
        };
        self.event(Action::Break(fault.unwrap_or(Fault::MainPowerLost)));
        self.pause();
        if self.dice.chance(60) {
            self.event(Action::Repair);
            self.pause();
            self.recover();
        }
    }

    /// What an operator does after an error.
    pub(super) fn recover(&mut self) {
        if self.dice.chance(50) {
            self.event(Action::Switches(NOTHING));
            self.pause();
        }
        self.event(Action::Start(99));
        self.wait(8.0);
        self.event(Action::Cancel(99));
        self.pause();
        if self.dice.chance(60) {
            self.event(Action::Switches(NOTHING));
            self.pause();
        }
        self.event(Action::Switches(FOLLOW));
    }

    fn run_up(&mut self) {
        let stubborn = self.dice.chance(60);
        self.event(Action::RunUp { stubborn, also: Vec::new() });
        self.pause();
        if self.dice.chance(60) {
            self.recover();
        }
    }

    fn load(&mut self) {
        let percent = self.dice.between(-180, 180) as i16;
        self.event(Action::Load(percent));
        if self.dice.chance(70) {
            self.pause();
            self.event(Action::Load(0));
        }
    }

    fn supply(&mut self) {
        if self.dice.chance(60) {
            let with_bit_15 = self.dice.chance(70);
            self.event(Action::Contactor { closed: false, with_bit_15 });
            self.pause();
            self.event(Action::Contactor { closed: true, with_bit_15: false });
        } else if self.dice.chance(50) {
            let percent = self.dice.pick(&[0, 0, 30, 60, 90, 110]).unwrap_or(0);
            self.event(Action::Mains(percent));
            self.pause();
            self.event(Action::Mains(100));
        } else {
            self.event(Action::SafeTorqueOff(true));
            self.pause();
            self.event(Action::SafeTorqueOff(false));
        }
    }

    /// Torque off, S-0-0052, S-0-0447, and on again.
    fn set_absolute(&mut self) {
        self.event(Action::Switches(NOTHING));
        self.wait(3.0);
        let place = self.value(52);
        self.event(Action::Write(52, place));
        self.event(Action::Start(447));
        self.wait(30.0);
        self.event(Action::Cancel(447));
        self.wait(6.0);
        // A control that wants to know.
        self.event(Action::Read(403));
        self.event(Action::Switches(FOLLOW));
        // Over the border of 32 bits, or back to where the axis comes from.
        if self.axis.mdt.contains(&47) && self.dice.chance(60) {
            self.wait(10.0);
            let rpm = self.rpm().abs().min(600.0) * if place > 0 { 1.0 } else { -1.0 };
            self.event(Action::Ramp(47, Self::long(rpm / 60.0 * self.units.revolution)));
            self.wait(60.0);
        }
    }

    fn home(&mut self) {
        if self.dice.chance(12) {
            self.fail_to_home();
        }
        if self.dice.chance(70) {
            let place = self.value(52);
            self.event(Action::Write(52, place));
        }
        let offset = self.value(150);
        if self.dice.chance(30) {
            self.event(Action::Write(150, offset));
        }
        // Bits 5 and 6: without switch, without marker; bit 7: stops at the reference point.
        let way = self.dice.pick(&[0x60, 0x60, 0x61, 0xE0, 0x20, 0x21, 0xA0, 0x44, 0x45, 0x04, 0x05, 0x46]);
        self.event(Action::Write(147, way.unwrap_or(0x60)));
        let speed = Self::long(self.units.rpm * (100.0 + 900.0 * self.dice.share())).max(1);
        self.event(Action::Write(41, speed));
        self.event(Action::Start(148));
        self.wait(30.0);
        if self.dice.chance(60) {
            self.event(Action::HomeSwitch(true));
            self.pause();
            self.event(Action::HomeSwitch(false));
        }
        self.wait(30.0);
        if self.dice.chance(80) {
            self.event(Action::Cancel(148));
            self.event(Action::Read(403));
            self.event(Action::Read(0x8003));
        }
    }

    /// A small torque limit and a load that it cannot move.
    fn press_against_a_stop(&mut self) {
        // Below the friction of most machines, or above it.
        let limit = self.dice.between(5, if self.dice.clone().chance(60) { 60 } else { 500 });
        self.event(Action::Write(92, limit));
        self.wait(8.0);
        let percent = (limit / 10 * self.dice.between(60, 140) / 100) as i16;
        let positive = self.dice.chance(50);
        if self.axis.built_for == Some(Fault::AxisBlocked) {
            self.event(Action::Break(Fault::AxisBlocked));
        } else if self.dice.chance(50) {
            self.event(Action::Load(if positive { percent } else { -percent }));
        }
        self.pause();
        self.command();
        self.wait(120.0);
        self.event(Action::Load(0));
    }

    /// A search for the switch that ends with the torque; then there is something to say about it.
    fn fail_to_home(&mut self) {
        self.event(Action::Write(147, 0x44));
        self.event(Action::Start(148));
        self.wait(30.0);
        self.event(Action::Switches(OFF));
        self.wait(30.0);
        self.event(Action::Cancel(148));
        self.event(Action::Read(0x8003));
        self.event(Action::Write(147, 0x60));
        self.event(Action::Start(148));
        self.wait(40.0);
        self.event(Action::Cancel(148));
        self.event(Action::Read(0x8003));
        self.event(Action::Switches(FOLLOW));
        self.pause();
    }

    /// As fast as the machine goes, a moment without torque, and on again.
    fn catch_at_speed(&mut self) {
        let rpm = self.fastest * (0.7 + 0.25 * self.dice.share());
        if self.axis.mdt.contains(&36) {
            self.event(Action::Set(36, Self::long(rpm * self.units.rpm)));
        } else if self.axis.mdt.contains(&47) {
            for share in [5.0, 4.0, 3.0, 2.0, 1.0] {
                self.event(Action::Ramp(47, Self::long(rpm / share / 60.0 * self.units.revolution)));
                self.wait(40.0);
            }
        } else {
            return;
        }
        let run = if self.axis.plant == Plant::Press { 700.0 } else { 60.0 };
        self.wait(run);
        let bits = self.dice.pick(&[NOTHING, DISABLE, OFF]).unwrap_or(NOTHING);
        self.event(Action::Switches(bits));
        let pause = 5.0 + 30.0 * self.dice.share();
        self.wait(pause);
        self.event(Action::Switches(FOLLOW));
        self.wait(40.0);
    }

    fn leave_alone(&mut self) {
        self.event(Action::Align(false));
        self.wait(50.0);
    }
}
