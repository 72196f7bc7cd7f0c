//! What a control asks of the service channel: every data block that can be written, with values that it takes and values that it refuses.

use drive::DICTIONARY;
use drive::dictionary::is_rating;
use plant::ReferenceAxis;
use sercos::Phase;
use sercos::attribute::{Format, Length};
use sercos::data_block::{DataBlock, Location, Selection};

use super::events::{FOLLOW, HALT, NOTHING, Writer};
use crate::life::{Action, Axis};
use crate::services::{KEY, PASSWORD};
use crate::units::{default_of, setting, writes};

/// Data of motor and encoder: another value is a lie about the machine, and no fault of the drive if it swings. They are written with
/// values that the drive refuses, and with their own again.
const MACHINE: [u16; 14] = [
    109,
    111,
    113,
    116,
    277,
    0x8000 | 110,
    0x8000 | 111,
    0x8000 | 112,
    0x8000 | 113,
    0x8000 | 114,
    0x8000 | 115,
    0x8000 | 117,
    0x8000 | 118,
    0x8000 | 120,
];
/// Gains and compensations: a machine keeps its loops with a value near its own.
const TUNING: [u16; 10] = [100, 101, 104, 106, 107, 155, 348, 392, 0x8000 | 107, 0x8000 | 142];
/// What lives are about, written more often than the rest.
const LIMITS: [u16; 21] =
    [91, 92, 38, 39, 82, 83, 138, 372, 136, 137, 159, 349, 49, 50, 52, 57, 124, 259, 260, 193, 201];
/// What changes the weight of positions, velocities and accelerations.
const SCALING: [u16; 12] = [44, 45, 76, 77, 79, 103, 121, 122, 123, 160, 161, 55];
/// What keeps its size under another scaling.
const SIZED: [u16; 10] = [41, 42, 57, 91, 124, 125, 138, 157, 159, 261];
/// What a phase protects, to be looked at.
const PROTECTED: [u16; 12] = [32, 43, 44, 55, 76, 79, 85, 103, 109, 113, 116, 160];
/// P-0-0118.
const COMMUTATION_ANGLE: u16 = 0x8000 | 118;
/// P-0-0003.
const FINDING: u16 = 0x8003;
/// S-0-0301 and 303: what a real-time bit can set, and something that it cannot.
const BIT_TARGETS: [u16; 6] = [400, 405, 406, 407, 0x8000 | 19, 47];

/// What a control tries in CP2 beside the settings of its axis.
pub(super) fn in_cp2(dice: &mut crate::dice::Dice, axis: &Axis) -> Vec<Action> {
    let mut writer = Writer::new(dice, axis);
    let number = writer.dice.weighted(&[(5, 1), (3, 2), (1, 4)]).unwrap_or(1);
    (0..number).map(|_| writer.any_write(Phase::Cp2)).collect()
}

fn machine(axis: &Axis) -> ReferenceAxis {
    let mut machine = axis.plant.axis();
    if let Some(increments) = axis.increments {
        machine.machine.encoder.increments_per_revolution = increments;
    }
    machine
}

/// The value that the axis has been set up with.
fn own_value(axis: &Axis, idn: u16) -> i64 {
    let writes = writes(axis, &machine(axis));
    let needed = writes.iter().rev().find(|(other, _)| *other == idn).map(|(_, value)| *value);
    setting(axis, idn).or(needed).unwrap_or_else(|| default_of(idn))
}

/// Smallest and largest number that the words of a data block hold.
fn range(block: &DataBlock) -> (i64, i64) {
    if block.fixed_bytes() == Some(2) { (-0x8000, 0xFFFF) } else { (i32::MIN.into(), u32::MAX.into()) }
}

const fn idn_of(action: &Action) -> u16 {
    match action {
        Action::Write(idn, _) | Action::WriteList(idn, _) | Action::WriteText(idn, _) | Action::WriteWords(idn, _) => {
            *idn
        }
        _ => 51,
    }
}

impl Writer<'_> {
    pub(super) fn write(&mut self) {
        if self.dice.chance(50) {
            let idn = self.dice.pick(&LIMITS).unwrap_or(91);
            let value = self.value(idn);
            self.event(Action::Write(idn, value));
        }
        for _ in 0..self.dice.below(4) {
            let action = self.any_write(Phase::Cp4);
            let idn = idn_of(&action);
            self.event(action);
            // Whether it is what was written, or what it was.
            if self.dice.chance(30) {
                self.event(Action::Read(idn));
            }
        }
    }

    pub(super) fn write_between(&mut self, idn: u16, from: i64, to: i64) {
        let value = self.dice.between(from, to);
        self.event(Action::Write(idn, value));
    }

    /// A write of any data block that is not read-only in every phase, and seldom of one that is.
    fn any_write(&mut self, phase: Phase) -> Action {
        if self.dice.chance(2) {
            let ratings: Vec<&DataBlock> = DICTIONARY.blocks().iter().filter(|block| is_rating(block)).collect();
            if let Some(rating) = self.dice.pick(&ratings) {
                return Action::Write(rating.idn.0, self.dice.between(0, 0xFFFF));
            }
        }
        // Seldom what the phase protects anyway.
        let protected = self.dice.chance(12);
        let choices: Vec<&DataBlock> = DICTIONARY
            .blocks()
            .iter()
            .filter(|block| {
                !matches!(block.location, Location::Command)
                    && !block.attribute.is_read_only()
                    && block.attribute.is_protected_in(phase) == protected
            })
            .collect();
        let lists = self.dice.chance(12);
        let choices: Vec<&DataBlock> =
            choices.into_iter().filter(|block| !lists || block.fixed_bytes().is_none()).collect();
        let Some(block) = self.dice.pick(&choices).or_else(|| DICTIONARY.find(sercos::Idn(26))) else {
            return Action::Read(51);
        };
        self.write_of(block)
    }

    fn write_of(&mut self, block: &DataBlock) -> Action {
        let idn = block.idn.0;
        if self.dice.chance(6) {
            return self.wrong_length(block);
        }
        match (block.fixed_bytes(), block.attribute.format()) {
            (Some(_), _) => Action::Write(idn, self.value(idn)),
            (None, Format::Text) => Action::WriteText(idn, self.text(idn)),
            (None, _) => Action::WriteList(idn, self.list(block)),
        }
    }

    /// Fewer or more words than the data block has.
    fn wrong_length(&mut self, block: &DataBlock) -> Action {
        let mut word = || self.dice.bits() as u16;
        let words = match block.fixed_bytes() {
            // One word ends the value.
            Some(4) => vec![word()],
            Some(_) => vec![word(), word()],
            // Four bytes are promised.
            None => vec![4, 4, word()],
        };
        let words = if self.dice.chance(40) { [words, vec![0; 3]].concat() } else { words };
        Action::WriteWords(block.idn.0, words)
    }

    fn text(&mut self, idn: u16) -> String {
        if idn == PASSWORD {
            return self.dice.pick(&[KEY, KEY, KEY, "", "no", "elevenchars"]).unwrap_or(KEY).to_owned();
        }
        let text = self.dice.pick(&["", "axis 1", "feeder of the second press", "x"]).unwrap_or("");
        if self.dice.chance(15) { "forty-one characters and no more than these".to_owned() } else { text.to_owned() }
    }

    fn list(&mut self, block: &DataBlock) -> Vec<u32> {
        let length = self.dice.weighted(&[(1, 0), (3, 1), (3, 2), (2, 4), (1, 17)]).unwrap_or(1);
        let idns = |selection| {
            let chosen = DICTIONARY.blocks().iter().filter(|block| block.is_in(selection));
            chosen.map(|block| u32::from(block.idn.0)).collect()
        };
        let sound: Vec<u32> = match block.idn.0 {
            16 => idns(Selection::ConfigurableInAt),
            24 => idns(Selection::ConfigurableInMdt),
            26 => idns(Selection::BitSources),
            27 => idns(Selection::BitTargets),
            328 | 329 => (0..16).collect(),
            _ => vec![0, 1, 0x8000, u32::MAX],
        };
        let most = if block.attribute.length() == Length::ListOfFour { u32::MAX } else { 0xFFFF };
        (0..length)
            .map(|_| {
                let any = self.dice.bits() as u32 & most;
                if self.dice.chance(92) { self.dice.pick(&sound).unwrap_or(any) } else { any }
            })
            .collect()
    }

    /// A value for a data block of fixed length, within its limits or not.
    pub(super) fn value(&mut self, idn: u16) -> i64 {
        let Some(block) = DICTIONARY.find(sercos::Idn(idn)) else { return 0 };
        if idn == COMMUTATION_ANGLE {
            // Another angle than the motor's would turn it anywhere: the drive does what it is told.
            return self.outside(block).unwrap_or(i64::from(i32::MAX));
        }
        if MACHINE.contains(&idn) {
            return self.own_or_refused(block);
        }
        if TUNING.contains(&idn) {
            return self.near_or_refused(block);
        }
        let (least, most) = range(block);
        let (minimum, maximum) = (block.minimum.unwrap_or(least), block.maximum.unwrap_or(most));
        let default = block.default;
        let degrees = |degrees: f64| self.units.revolution * degrees / 360.0;
        match idn {
            52 | 150 if self.dice.chance(70) => {
                let edge = self.dice.pick(&[i64::from(i32::MAX), i64::from(i32::MIN), 0, 0]).unwrap_or(0);
                let by = degrees(self.dice.spread(1.0, 1_000.0)) as i64;
                return (edge + by).clamp(i32::MIN.into(), i32::MAX.into());
            }
            47 | 48 | 258 | 282 | 49 | 50 if self.dice.chance(70) => {
                return degrees(self.dice.spread(1.0, 2_000.0)) as i64;
            }
            36 | 37 if self.dice.chance(80) => return Self::long(self.rpm() * self.units.rpm),
            80 | 81 if self.dice.chance(80) => return self.dice.spread(5.0, 1_500.0) as i64,
            91 | 259 if self.dice.chance(60) => return Self::long(self.rpm().abs() * self.units.rpm).max(1),
            92 if self.dice.chance(60) => return self.dice.between(10, 3_000),
            138 | 372 | 136 | 137 if self.dice.chance(70) => {
                let ramp = f64::from(self.axis.plant.axis().gains.acceleration_limit) * 1e-3;
                return Self::long(ramp * self.units.acceleration * (0.05 + self.dice.share())).max(1);
            }
            159 if self.dice.chance(60) => return degrees(0.5 + 60.0 * self.dice.share()) as i64,
            301 | 303 if self.dice.chance(70) => return self.dice.pick(&BIT_TARGETS).unwrap_or(0).into(),
            _ => {}
        }
        match self.dice.below(6) {
            0 => self.dice.pick(&[0, 1, -1, 2, 7, i64::from(i32::MAX), 0x7FFF]).unwrap_or(0),
            1 => self.dice.pick(&[minimum, maximum, minimum - 1, maximum + 1]).unwrap_or(0),
            2 => self.dice.between(minimum, maximum),
            3 => default,
            _ => (default as f64 * (0.2 + 2.0 * self.dice.share())) as i64,
        }
    }

    /// Just outside the limits of a data block; `None` if all that its words hold is within.
    fn outside(&mut self, block: &DataBlock) -> Option<i64> {
        let (least, most) = range(block);
        let below = block.minimum.filter(|minimum| *minimum > least.max(0)).map(|minimum| minimum - 1);
        let above = block.maximum.filter(|maximum| *maximum < most).map(|maximum| maximum + 1);
        let outside: Vec<i64> = below.into_iter().chain(above).collect();
        self.dice.pick(&outside)
    }

    fn own_or_refused(&mut self, block: &DataBlock) -> i64 {
        let outside = self.outside(block).filter(|_| self.dice.chance(60));
        outside.unwrap_or_else(|| own_value(self.axis, block.idn.0))
    }

    fn near_or_refused(&mut self, block: &DataBlock) -> i64 {
        let outside = self.outside(block).filter(|_| self.dice.chance(25));
        outside.unwrap_or_else(|| {
            let own = own_value(self.axis, block.idn.0);
            let near = (own as f64 * (0.85 + 0.3 * self.dice.share())).round() as i64;
            // A compensation that is off may come on a little.
            if own == 0 { self.dice.between(0, 20) } else { near.max(block.minimum.unwrap_or(1)) }
        })
    }

    /// A run-up in which the axis gets other data: another scaling, mode, polarity.
    pub(super) fn run_up_with_changes(&mut self) {
        let stubborn = self.dice.chance(30);
        let scaling = self.dice.chance(50);
        let number = self.dice.between(1, 3);
        let also: Vec<Action> = (0..number)
            .map(|_| match self.dice.pick(&SCALING).filter(|_| scaling) {
                Some(idn) => {
                    let value = self.dice.pick(&self.scaling_values(idn)).unwrap_or(1);
                    Action::Write(idn, value)
                }
                None => self.any_write(Phase::Cp2),
            })
            .collect();
        self.event(Action::RunUp { stubborn, also });
        self.pause();
        let idn = self.dice.pick(&SIZED).unwrap_or(124);
        self.event(Action::Read(idn));
        if self.dice.chance(50) {
            self.recover();
        }
    }

    fn scaling_values(&self, idn: u16) -> Vec<i64> {
        match idn {
            44 | 160 => vec![1, 2, 0x42, 0x22, 0x0A],
            45 | 77 | 161 => vec![1, 2, 10],
            76 => vec![1, 2, 0x42, 0x82, 0x0A, 0x8A],
            79 => vec![36_000, 65_536, 1_000_000, 36_000_000],
            103 => vec![1_800_000, 3_600_000, 36_000_000],
            55 => vec![0, 5, 7, 0x10],
            _ => vec![1, 2, 3, 10],
        }
    }

    pub(super) fn defaults(&mut self) {
        self.event(Action::Switches(NOTHING));
        self.wait(5.0);
        self.event(Action::Start(262));
        self.wait(10.0);
        self.event(Action::Cancel(262));
        // Its gains are those of another machine now: it is looked at, and not switched on before it has its own again.
        self.wait(10.0);
        for _ in 0..2 {
            let idn = self.dice.pick(&PROTECTED).unwrap_or(109);
            self.event(Action::Read(idn));
        }
        self.wait(40.0);
        self.ended = true;
    }

    /// Any value for what makes the machine, without torque, and nothing is switched on before it has its own again.
    pub(super) fn foreign_data(&mut self) {
        self.event(Action::Switches(NOTHING));
        self.wait(5.0);
        for _ in 0..4 {
            let Some(idn) = self.dice.pick(&[&MACHINE[..], &TUNING[..]].concat()) else { continue };
            let Some(block) = DICTIONARY.find(sercos::Idn(idn)) else { continue };
            let (least, most) = range(block);
            let value = self.dice.between(block.minimum.unwrap_or(least), block.maximum.unwrap_or(most));
            self.event(Action::Write(idn, value));
            self.pause();
        }
        self.event(Action::Start(0x8000 | 220));
        self.wait(10.0);
        self.event(Action::Cancel(0x8000 | 220));
        self.read();
        self.ended = true;
    }

    pub(super) fn command_of_any_kind(&mut self) {
        let commands = [99, 139, 148, 149, 170, 191, 447, 0x80DC, 0x80E0, 0x80E1, 0x80E2, 127, 128];
        let idn = self.dice.pick(&commands).unwrap_or(99);
        self.event(Action::Start(idn));
        self.pause();
        if self.dice.chance(70) {
            self.event(Action::Cancel(idn));
        }
    }

    /// S-0-0170: a probe that is waited for, at standstill more often than not.
    pub(super) fn probe(&mut self) {
        if self.dice.chance(60) {
            self.event(Action::Switches(HALT));
        }
        let edges = self.dice.pick(&[1, 1, 3, 0xF]).unwrap_or(1);
        self.event(Action::Write(169, edges));
        self.event(Action::Start(170));
        self.event(Action::Write(405, 1));
        self.wait(80.0);
        self.event(Action::Probe(true));
        self.pause();
        self.event(Action::Read(130));
        self.wait(10.0);
        self.event(Action::Probe(false));
        if self.dice.chance(70) {
            self.event(Action::Cancel(170));
        }
        self.event(Action::Switches(FOLLOW));
    }

    /// The drive finds out about its motor: P-0-0224, 225 or 226 at HALT, undisturbed or not.
    pub(super) fn identify(&mut self) {
        self.event(Action::Switches(HALT));
        self.write_between(0x8000 | 218, 500_000, 4_000_000);
        self.write_between(0x8000 | 219, 100_000, 2_000_000);
        self.write_between(0x8000 | 229, 20, 300);
        self.wait(60.0);
        let command = self.dice.pick(&[0x8000 | 224, 0x8000 | 225, 0x8000 | 226]).unwrap_or(0x8000 | 224);
        self.event(Action::Start(command));
        let span = self.dice.weighted(&[(4, 20.0), (3, 100.0), (1, 400.0)]).unwrap_or(20.0);
        self.wait(span);
        if self.dice.chance(40) {
            self.stop();
        }
        self.event(Action::Cancel(command));
        self.wait(20.0);
        // What it has found may be the start of a movement only.
        let bits = self.dice.pick(&[FOLLOW, HALT]).unwrap_or(HALT);
        self.event(Action::Switches(bits));
    }

    pub(super) fn read(&mut self) {
        let idn =
            self.dice.pick(&[1, 36, 40, 47, 51, 189, 84, 11, 12, 13, 14, 390, 403, 130, 336, 380, 134, 135, FINDING]);
        self.event(Action::Read(idn.unwrap_or(51)));
    }
}
