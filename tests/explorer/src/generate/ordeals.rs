//! What lasts long or comes together seldom: loads that heat, a motor that cannot turn or turns the wrong way, a check that is left out.

use fault_matrix::Fault;

use super::events::{FOLLOW, HALT, NOTHING, QUIET, Writer};
use crate::dice::Dice;
use crate::life::{Action, Axis, Plant};

/// S-0-0277 bit 3: the encoder counts against the motor.
const TURNED_ROUND: i64 = 8;
/// P-0-0130 and 131: thermal time constants, 1 s.
const TIME_CONSTANTS: [(u16, i64); 2] = [(0x8000 | 130, 1_000), (0x8000 | 131, 1_000)];
/// S-0-0114 in 0.1 %: the lowest.
const LOAD_LIMIT: (u16, i64) = (114, 901);

/// A motor that is warm soon, if it is built to be overloaded; an encoder that is wired the wrong way, if nobody gives its angle away.
pub(super) fn prepare(dice: &mut Dice, axis: &mut Axis) {
    if blocks(axis) && dice.chance(15) {
        axis.aligned = false;
    } else if !axis.aligned && axis.plant != Plant::Vertical && dice.chance(25) {
        axis.also.push(Action::Write(277, TURNED_ROUND));
    }
    // The search for the angle would be too much for it already.
    if axis.built_for == Some(Fault::Overload) && axis.aligned {
        axis.settings.extend(TIME_CONSTANTS);
        axis.settings.push(LOAD_LIMIT);
    }
}

/// Something can jam it.
fn blocks(axis: &Axis) -> bool {
    matches!(axis.built_for, Some(Fault::AxisBlocked | Fault::Overload))
}

impl Writer<'_> {
    /// The axis is blocked before it has looked for its angle.
    pub(super) fn block_from_the_start(&mut self) {
        if blocks(self.axis) && !self.axis.aligned && self.dice.chance(60) {
            self.event(Action::Break(Fault::AxisBlocked));
        }
    }

    /// A search that nothing disturbs takes its time.
    pub(super) fn wait_for_the_angle(&mut self) {
        let fails = blocks(self.axis) || !self.axis.also.is_empty();
        if !self.axis.aligned && fails && self.dice.chance(40) {
            self.wait(1_300.0);
        }
    }

    /// What it is built for comes in many of its lives.
    pub(super) fn overload_at_once(&mut self) {
        if self.axis.built_for == Some(Fault::Overload) && self.axis.aligned && self.dice.chance(50) {
            self.overload();
        }
    }

    pub(super) fn ordeal(&mut self) {
        match self.dice.below(4) {
            0 => self.overload(),
            1 => self.heat(),
            2 => self.positive_stop(),
            _ => self.skip_a_check(),
        }
    }

    /// Homing with a marker or a switch of an axis that rests and that nothing disturbs, to its end.
    pub(super) fn home_in_peace(&mut self) {
        self.wait(QUIET);
        let place = self.value(52);
        self.event(Action::Write(52, place));
        if self.dice.chance(60) {
            let degrees = self.dice.spread(1.0, 300.0);
            self.event(Action::Write(150, self.units.degrees(degrees)));
        }
        // Bits 0: backwards, 2: the switch is at the drive, 5 and 6: without switch, without marker, 7: stops at the reference point.
        let way = self.dice.pick(&[0x20, 0x20, 0x21, 0xA0, 0xA1, 0x04, 0x05, 0x84, 0x44, 0x45]).unwrap_or(0x20);
        self.event(Action::Write(147, way));
        let rpm = 300.0 + 700.0 * self.dice.share();
        self.event(Action::Write(41, Self::long(self.units.rpm * rpm).max(1)));
        self.event(Action::Start(148));
        if way & 0x20 == 0 {
            self.wait(90.0);
            self.event(Action::HomeSwitch(true));
        }
        self.wait(400.0);
        self.event(Action::Cancel(148));
        self.event(Action::Read(403));
        self.wait(20.0);
        self.event(Action::HomeSwitch(false));
    }

    /// Torque at its limit against a blocked axis, until the motor has had enough.
    fn overload(&mut self) {
        if self.axis.built_for != Some(Fault::Overload) {
            return self.heat();
        }
        // Otherwise the following distance ends it sooner.
        self.event(Action::Write(159, 0));
        self.event(Action::Write(92, 4_000));
        self.command();
        self.event(Action::Break(Fault::Overload));
        self.wait(400.0);
        self.event(Action::Repair);
        self.recover();
    }

    /// A motor that gets hot, and thresholds that it reaches soon; or a heat sink, whose thresholds nobody can change.
    fn heat(&mut self) {
        if self.dice.chance(50) {
            self.event(Action::Write(201, 250));
            self.write_between(204, 280, 330);
            self.event(Action::Break(Fault::MotorHot));
            self.wait(200.0);
        } else {
            self.event(Action::Break(Fault::HeatSinkHot));
            // 90 degrees of 110, with a filter of two seconds.
            self.wait(2_700.0);
        }
        self.event(Action::Repair);
        self.pause();
        self.recover();
    }

    /// S-0-0149 and a command into a stop, if there is one.
    fn positive_stop(&mut self) {
        self.event(Action::Switches(FOLLOW));
        self.wait(20.0);
        self.write_between(92, 100, 800);
        self.wait(8.0);
        self.event(Action::Start(149));
        self.wait(8.0);
        if blocks(self.axis) {
            self.event(Action::Break(Fault::AxisBlocked));
        } else {
            let percent = self.dice.between(-150, 150) as i16;
            self.event(Action::Load(percent));
        }
        self.command();
        self.wait(90.0);
        if self.dice.chance(40) {
            let bits = self.dice.pick(&[HALT, NOTHING]).unwrap_or(HALT);
            self.event(Action::Switches(bits));
            self.pause();
        }
        self.event(Action::Cancel(149));
        self.event(Action::Repair);
    }

    fn skip_a_check(&mut self) {
        let phase = self.dice.between(3, 4) as u8;
        self.event(Action::SkipCheck(phase));
        self.pause();
        if self.dice.chance(70) {
            self.recover();
        }
    }
}
