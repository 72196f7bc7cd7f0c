//! What a [`super::ScriptedMaster`] is told to do.

use std::fmt;

use crate::ident::{Idn, Value};
use crate::service_client::Pace;
use crate::slots::{DriveData, MdtPlace, Slots};
use crate::time::Nanoseconds;
use crate::wire::BitRate;

/// The cyclic data of one drive (sercos2.md 1.8, 1.9).
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Telegram {
    /// S-0-0015.
    pub kind: u16,
    /// What the AT carries, in order.
    pub at: Vec<Idn>,
    /// What the MDT record carries, in order.
    pub mdt: Vec<Idn>,
}

impl Telegram {
    /// S-0-0015 of the application telegram.
    pub const APPLICATION: u16 = 7;

    /// The standard telegrams 0 to 6, and 11 to 13 with the second encoder. `None` for any other number.
    pub fn standard(kind: u16) -> Option<Self> {
        let position = if kind & 8 == 0 { Idn::POSITION_FEEDBACK } else { Idn::POSITION_FEEDBACK_2 };
        let (mdt, at) = match kind {
            0 => (vec![], vec![]),
            1 => (vec![Idn::TORQUE_COMMAND], vec![]),
            2 => (vec![Idn::VELOCITY_COMMAND], vec![Idn::VELOCITY_FEEDBACK]),
            3 | 11 => (vec![Idn::VELOCITY_COMMAND], vec![position]),
            4 | 12 => (vec![Idn::POSITION_COMMAND], vec![position]),
            5 | 13 => (vec![Idn::POSITION_COMMAND, Idn::VELOCITY_COMMAND], vec![position, Idn::VELOCITY_FEEDBACK]),
            6 => (vec![Idn::VELOCITY_COMMAND], vec![]),
            _ => return None,
        };
        Some(Self { kind, at, mdt })
    }

    /// The application telegram with the lists S-0-0016 and S-0-0024.
    pub fn application(at: &[Idn], mdt: &[Idn]) -> Self {
        Self { kind: Self::APPLICATION, at: at.to_vec(), mdt: mdt.to_vec() }
    }
}

/// One drive of the ring.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DriveScript {
    /// Its address, 1 to 254.
    pub address: u8,
    /// Its cyclic data.
    pub telegram: Telegram,
    /// Written in CP2 after the communication parameters: operation mode, scaling, limits.
    pub parameters: Vec<(Idn, Value)>,
    /// Written in CP3.
    pub parameters_cp3: Vec<(Idn, Value)>,
}

impl DriveScript {
    /// A drive without parameters of its own.
    pub fn new(address: u8, telegram: Telegram) -> Self {
        Self { address, telegram, parameters: Vec::new(), parameters_cp3: Vec::new() }
    }

    /// The same with one more parameter, written in CP2.
    #[must_use]
    pub fn with(mut self, idn: Idn, value: Value) -> Self {
        self.parameters.push((idn, value));
        self
    }

    /// With these parameters, to be written in CP2 in this order.
    #[must_use]
    pub fn with_all(mut self, parameters: impl IntoIterator<Item = (Idn, Value)>) -> Self {
        self.parameters.extend(parameters);
        self
    }
}

/// Where t1 to t4 come from.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum SlotChoice {
    /// By the rules, from what the drives say they need.
    Computed(MdtPlace),
    /// Given, whatever the drives say.
    Fixed(Slots),
}

/// A whole run: start-up, motion, stop.
#[derive(Debug)]
pub struct MasterScript {
    /// Bit rate of the ring, for the lengths of telegrams.
    pub bit_rate: BitRate,
    /// MST period before CP3; at least 1 ms (sercos2.md 2.1).
    pub start_up_cycle: Nanoseconds,
    /// S-0-0002, us.
    pub cycle: u16,
    /// S-0-0001 in communication cycles.
    pub control_unit_cycles: u16,
    /// t1 to t4.
    pub slots: SlotChoice,
    /// The drives, in the order of their ATs.
    pub drives: Vec<DriveScript>,
    /// How fast service steps follow each other.
    pub pace: Pace,
    /// MSTs that must come back before CP1; at least 10 (sercos2.md 2.1).
    pub good_msts: u32,
    /// Cycles without service between the end of CP2's dialogue and CP3, at least 1.
    pub idle_before_cp3: u32,
    /// Cycles in CP3 before S-0-0128, in which the drives synchronise.
    pub idle_in_cp3: u32,
    /// Cycles without service before CP4, at least 1.
    pub idle_before_cp4: u32,
    /// Whether S-0-0099 is executed before S-0-0127.
    pub reset_diagnostics: bool,
    /// Whether a service request that fails in CP4, beside the script, ends the run.
    pub stops_at_refusals: bool,
    /// Whether control bit 10 toggles once a control-unit cycle; several masters never do (sercos2.md 1.6).
    pub toggle_iposync: bool,
    /// How far an AT may start from t1, in CP3 and CP4.
    pub at_tolerance: Nanoseconds,
    /// What the drives are to do in CP4; nothing, if `None`.
    pub motion: Option<Motion>,
}

impl MasterScript {
    /// A run-up at 2 Mbit/s and 2 ms with nothing to do in CP4.
    pub fn new(drives: Vec<DriveScript>) -> Self {
        Self {
            bit_rate: BitRate::M2,
            start_up_cycle: Nanoseconds::from_millis(2),
            cycle: 2_000,
            control_unit_cycles: 1,
            slots: SlotChoice::Computed(MdtPlace::Late),
            drives,
            pace: Pace::FASTEST,
            good_msts: 10,
            idle_before_cp3: 10,
            idle_in_cp3: 100,
            idle_before_cp4: 10,
            reset_diagnostics: true,
            stops_at_refusals: true,
            toggle_iposync: false,
            at_tolerance: Nanoseconds::from_microseconds(2),
            motion: None,
        }
    }

    pub(super) fn start_up_microseconds(&self) -> Nanoseconds {
        self.start_up_cycle.max(Nanoseconds::from_millis(1))
    }
}

/// Command values of one drive for one cycle, in the units of its scaling.
#[derive(Copy, Clone, Debug, PartialEq, Eq, Default)]
pub struct CommandValues {
    /// S-0-0047, or S-0-0258 or S-0-0282 where the MDT carries one of these.
    pub position: i32,
    /// S-0-0036.
    pub velocity: i32,
    /// S-0-0080.
    pub torque: i16,
    /// S-0-0346.
    pub positioning: u16,
    /// Drive HALT, control word bit 13 = 0: of all drives, if one of them asks for it.
    pub halt: bool,
    /// Limits that the MDT carries, with their values as they are transmitted.
    pub limits: [(Idn, u32); 3],
}

impl CommandValues {
    /// A position; velocity and torque stay 0.
    pub const fn at_position(position: i32) -> Self {
        Self { position, velocity: 0, torque: 0, positioning: 0, halt: false, limits: [(Idn(0), 0); 3] }
    }

    /// A velocity; position and torque stay 0.
    pub const fn at_velocity(velocity: i32) -> Self {
        Self { position: 0, velocity, torque: 0, positioning: 0, halt: false, limits: [(Idn(0), 0); 3] }
    }

    pub(super) fn bytes_of(self, idn: Idn, length: usize) -> Vec<u8> {
        let mut bytes = match idn {
            Idn::POSITION_COMMAND | Idn(258 | 282) => self.position.to_le_bytes().to_vec(),
            Idn::VELOCITY_COMMAND => self.velocity.to_le_bytes().to_vec(),
            Idn::TORQUE_COMMAND => self.torque.to_le_bytes().to_vec(),
            Idn(346) => self.positioning.to_le_bytes().to_vec(),
            _ => {
                let limit = self.limits.into_iter().find(|(limit, _)| *limit == idn);
                limit.map_or_else(Vec::new, |(_, value)| value.to_le_bytes().to_vec())
            }
        };
        bytes.resize(length, 0);
        bytes
    }
}

/// What a profile is asked for.
#[derive(Copy, Clone, Debug, PartialEq, Eq)]
pub struct ProfilePoint {
    /// Communication cycles since all drives follow their commands, counted from 0.
    pub cycle: u64,
    /// The same as a time.
    pub time: Nanoseconds,
    /// Index of the drive in the script.
    pub drive: usize,
    /// Its position feedback when it began to follow; 0 if its AT carries none.
    pub start: i32,
}

/// Command values as a function of time.
pub type Profile = Box<dyn FnMut(ProfilePoint) -> CommandValues>;

/// What the drives do in CP4.
pub struct Motion {
    /// Command values of every drive and cycle.
    pub profile: Profile,
    /// How many cycles of them; the last values are held while the drives are stopped.
    pub cycles: u64,
    /// Cycles that a drive may take to report power (status bits 15..14 = 2), to follow its commands after it has
    /// been switched on, and to be without torque after it has been switched off.
    pub patience: u64,
}

impl Motion {
    /// `cycles` cycles of `profile`; 2000 cycles of patience.
    pub fn new(cycles: u64, profile: impl FnMut(ProfilePoint) -> CommandValues + 'static) -> Self {
        Self { profile: Box::new(profile), cycles, patience: 2_000 }
    }
}

impl fmt::Debug for Motion {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.debug_struct("Motion").field("cycles", &self.cycles).finish_non_exhaustive()
    }
}

/// A line shaft: all drives turn alike, from standstill to a velocity, along it, and back to standstill.
///
/// The velocity ramps are parabolas in position; all arithmetic is in integers, so every run is the same bit for bit.
#[derive(Copy, Clone, Debug, PartialEq, Eq)]
pub struct LineShaft {
    /// Velocity on the way, position units a second.
    pub velocity: i64,
    /// Duration of each ramp.
    pub ramp: Nanoseconds,
    /// Duration between the ramps.
    pub constant: Nanoseconds,
}

impl LineShaft {
    /// Until standstill.
    pub fn duration(&self) -> Nanoseconds {
        self.ramp + self.constant + self.ramp
    }

    /// How far the shaft has turned, position units.
    pub fn position(&self, time: Nanoseconds) -> i64 {
        let (ramp, constant) = (i128::from(self.ramp.0.max(1)), i128::from(self.constant.0));
        let velocity = i128::from(self.velocity);
        let time = i128::from(time.0.min(self.duration().0));
        let second = 1_000_000_000;
        let rising = |time: i128| velocity * time * time / (2 * ramp * second);
        let along = |time: i128| velocity * time / second;
        let turned = if time < ramp {
            rising(time)
        } else if time < ramp + constant {
            rising(ramp) + along(time - ramp)
        } else {
            2 * rising(ramp) + along(constant) - rising(ramp + constant + ramp - time)
        };
        turned as i64
    }

    /// Velocity, position units a second.
    pub fn velocity(&self, time: Nanoseconds) -> i64 {
        let (ramp, constant, time) = (i128::from(self.ramp.0.max(1)), i128::from(self.constant.0), i128::from(time.0));
        let part = if time < ramp { time } else { ramp.min((ramp + constant + ramp - time).max(0)) };
        (i128::from(self.velocity) * part / ramp) as i64
    }
}

/// Lengths of the cyclic data, once they are known.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct Layout {
    pub(super) at: Vec<(Idn, usize)>,
    pub(super) mdt: Vec<(Idn, usize)>,
}

impl Layout {
    pub(super) fn data(&self) -> DriveData {
        let sum = |fields: &[(Idn, usize)]| fields.iter().map(|(_, length)| length).sum();
        DriveData { at_bytes: sum(&self.at), mdt_bytes: sum(&self.mdt) }
    }

    /// A value out of the AT's configurable data, sign-extended.
    pub(super) fn feedback(&self, idn: Idn, data: &[u8]) -> Option<i32> {
        let mut offset = 0;
        for (field, length) in &self.at {
            if *field == idn {
                let bytes = data.get(offset..offset + length)?;
                return match *bytes {
                    [low, high] => Some(i32::from(i16::from_le_bytes([low, high]))),
                    [a, b, c, d] => Some(i32::from_le_bytes([a, b, c, d])),
                    _ => None,
                };
            }
            offset += length;
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_shaft_is_steady_and_comes_to_rest() {
        let shaft = LineShaft {
            velocity: 360_000,
            ramp: Nanoseconds::from_millis(500),
            constant: Nanoseconds::from_millis(1_000),
        };
        assert_eq!(shaft.position(Nanoseconds::ZERO), 0);
        assert_eq!(shaft.position(Nanoseconds::from_millis(500)), 90_000);
        assert_eq!(shaft.position(Nanoseconds::from_millis(1_500)), 450_000);
        assert_eq!(shaft.position(shaft.duration()), 540_000);
        assert_eq!(shaft.position(shaft.duration() + shaft.duration()), 540_000);
        assert_eq!(shaft.velocity(Nanoseconds::from_millis(250)), 180_000);
        assert_eq!(shaft.velocity(Nanoseconds::from_millis(700)), 360_000);
        assert_eq!(shaft.velocity(shaft.duration()), 0);
        let steps: Vec<i64> = (0..=1_000).map(|step| shaft.position(Nanoseconds::from_millis(2 * step))).collect();
        assert!(steps.windows(2).all(|pair| (0..=720).contains(&(pair[1] - pair[0]))));
    }

    #[test]
    fn feedback_is_found_by_its_place() {
        let layout = Layout { at: vec![(Idn(11), 2), (Idn(51), 4), (Idn(0x8013), 2)], mdt: vec![] };
        // sercos2.md 1.5: a real AT.
        let data = [0x00, 0x00, 0xE0, 0xDD, 0x01, 0x00, 0x02, 0x00];
        assert_eq!(layout.feedback(Idn(51), &data), Some(122_336));
        assert_eq!(layout.feedback(Idn(0x8013), &data), Some(2));
        assert_eq!(layout.feedback(Idn(40), &data), None);
        assert_eq!(layout.data(), DriveData { at_bytes: 8, mdt_bytes: 0 });
    }
}
