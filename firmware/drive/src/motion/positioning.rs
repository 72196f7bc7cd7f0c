//! Movements to a target by the drive itself, and what it tells of having reached it.
//!
//! Two kinds: to S-0-0258 as soon as it is written (modes 0013H, 001BH), or to what S-0-0346 takes over of S-0-0282 when its bit 0 changes
//! (0213H, 021BH). HALT only interrupts a movement. A target is left, or with S-0-0393 bit 2 = 0 kept for later, when its mode ends, the
//! torque goes, the axis is homed or an identification moves it.
//!
//! Sources: sercos2.md 4.3 and Appendix B for the words. What S-0-0437 has in which bit is in no public paper: it is this drive's own.

use sercon816::Bus;
use sercos::diagnostic::Class3;
use servo::axis::{Mode, Travel};
use servo::units::{Position, Velocity};

use super::Motion;
use crate::hardware::Hardware;
use crate::operation_mode::{Direction, OperationMode, TargetSource};
use crate::state::DriveState;

/// What is known of the drive's own movement.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Positioning {
    /// Where the target comes from, while a mode with one is active: also in HALT.
    source: Option<TargetSource>,
    /// `None`: the axis is to stop and stay where it does.
    target: Option<Target>,
    /// S-0-0258 was written, and nobody has looked at it yet.
    written: bool,
    /// The way to the target begins from another place than the last step.
    begins: bool,
    /// S-0-0346 as it was when its bit 0 was looked at last.
    seen: u16,
    /// S-0-0419.
    acknowledged: bool,
    /// Turns by bits 2 and 1 of S-0-0346.
    jogging: bool,
}

/// Where a movement ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Target {
    /// Unbounded.
    place: Position,
    /// S-0-0430.
    data: i32,
    /// The position command that it was made of; `None` for a distance, or where the axis just stopped.
    commanded: Option<i32>,
    /// The set-point has been there: a HALT afterwards, which holds the shaft where it is, does not take that away.
    attained: bool,
}

/// C3D bits that tell of the drive's own movements.
const REACHED: Class3 = Class3::IN_POSITION
    .union(Class3::AT_ACTIVE_TARGET)
    .union(Class3::IN_COARSE_POSITION)
    .union(Class3::TARGET_ATTAINED)
    .union(Class3::INTERPOLATOR_HALTED);

// Bits of S-0-0346.
const TOGGLE: u16 = 1 << 0;
const JOG: u16 = 3 << 1;
const JOG_POSITIVE: u16 = 1 << 1;
const JOG_NEGATIVE: u16 = 2 << 1;
const IS_DISTANCE: u16 = 1 << 3;
const FROM_ACTUAL: u16 = 1 << 4;
const AT_ONCE: u16 = 1 << 5;

impl Positioning {
    /// A mode with a target is active.
    #[inline]
    pub(super) const fn is_active(&self) -> bool {
        self.source.is_some()
    }

    /// S-0-0258 has a new value, or its old one once more.
    #[inline]
    pub(super) const fn target_is_written(&mut self) {
        self.written = true;
    }

    /// A movement stops or goes on: the way to the target is another one now.
    pub(super) const fn begin_again(&mut self) {
        self.begins = true;
    }

    /// Places mean something else from now on.
    pub(super) const fn forget(&mut self) {
        self.target = None;
    }

    /// Bit 0 of S-0-0346 has changed, and nothing was taken over yet.
    const fn is_asked(&self, control: u16) -> bool {
        (control ^ self.seen) & TOGGLE != 0
    }
}

impl<B: Bus + Clone, H: Hardware> Motion<B, H> {
    /// Notices that a mode with a target begins or ends.
    #[inline]
    pub(super) fn watch_positioning(&mut self, state: DriveState) {
        let source = self.mode.and_then(OperationMode::target_source);
        // Most modes have none.
        if source.is_some() || self.positioning.source.is_some() {
            self.change_positioning(state, source);
        }
    }

    #[inline(never)]
    fn change_positioning(&mut self, state: DriveState, source: Option<TargetSource>) {
        let active = matches!(state, DriveState::Following | DriveState::Halted)
            && !self.homing
            && self.identification.is_none();
        let source = source.filter(|_| active);
        let positioning = &mut self.positioning;
        if source == positioning.source {
            return;
        }
        positioning.source = source;
        positioning.jogging = false;
        if source.is_none() {
            // What is written from now on is meant for the next time.
            positioning.written = false;
            return;
        }
        positioning.seen = self.commands.positioning_control;
        if self.settings.positioning.drops_target {
            positioning.target = None;
        }
    }

    /// One step on the way to the target. In HALT the target may become another one, and the axis stays.
    #[inline(never)]
    pub(super) fn position_to_target(&mut self) {
        let travel = match self.positioning.source {
            Some(TargetSource::Control) => self.controlled_travel(),
            _ => self.targeted_travel(),
        };
        let limits = self.cyclic_limits.movements().positioning.unwrap_or(self.settings.positioning.limits);
        self.axis.travel(limits, travel);
    }

    fn targeted_travel(&mut self) -> Travel {
        let commanded = self.commands.target_position;
        let begins = core::mem::take(&mut self.positioning.begins);
        if core::mem::take(&mut self.positioning.written)
            && self.positioning.target.is_none_or(|target| target.commanded != Some(commanded))
        {
            self.aim_at(commanded);
        } else if begins {
            self.aim_again();
        }
        self.travel_to_target()
    }

    fn controlled_travel(&mut self) -> Travel {
        let control = self.commands.positioning_control;
        let jog = control & JOG;
        let upwards = jog == JOG_POSITIVE;
        self.positioning.jogging = upwards || jog == JOG_NEGATIVE;
        if self.positioning.jogging {
            if self.positioning.target.take().is_some() {
                self.refresh_reached();
            }
            let upwards = upwards != self.settings.coordinates.reversed;
            return Travel::AtVelocity(if upwards { Velocity::MAX } else { -Velocity::MAX });
        }
        if jog != 0 {
            self.positioning.begins = true;
            return Travel::Hold;
        }
        let begins = core::mem::take(&mut self.positioning.begins);
        if self.positioning.is_asked(control) && (control & AT_ONCE != 0 || self.is_ready_for_next()) {
            self.take_over(control);
        } else if begins {
            self.aim_again();
        }
        self.travel_to_target()
    }

    /// On the way, or where the axis stands once it does.
    fn travel_to_target(&mut self) -> Travel {
        if self.positioning.target.is_none() && self.axis.setpoint_rests() {
            self.stay_here();
        }
        let attained = self.is_ready_for_next();
        if let Some(target) = &mut self.positioning.target {
            target.attained |= attained;
        }
        self.positioning.target.map_or(Travel::Hold, |target| Travel::To(target.place))
    }

    /// Nothing is left of the last movement.
    fn is_ready_for_next(&self) -> bool {
        self.axis.setpoint_rests()
            && self
                .positioning
                .target
                .is_none_or(|target| target.attained || target.place == self.output.position_command)
    }

    #[cold]
    fn stay_here(&mut self) {
        let place = self.output.position_command;
        let data = self.data_at(place);
        self.positioning.target = Some(Target { place, data, commanded: None, attained: false });
        if self.positioning.source == Some(TargetSource::Target) {
            self.commands.target_position = data;
        }
        self.refresh_reached();
    }

    /// S-0-0282, taken over by S-0-0346.
    #[cold]
    fn take_over(&mut self, control: u16) {
        self.positioning.seen = control;
        self.positioning.acknowledged = control & TOGGLE != 0;
        let value = self.commands.positioning_value;
        if control & IS_DISTANCE == 0 {
            return self.aim_at(value);
        }
        let target = match self.positioning.target {
            _ if control & FROM_ACTUAL != 0 => {
                let here = self.encoder.position();
                self.further(here, self.data_at(here), value)
            }
            Some(Target { place, data, .. }) => self.further(place, data, value),
            None => {
                let here = self.output.position_command;
                self.further(here, self.data_at(here), value)
            }
        };
        self.positioning.target = Some(target);
        self.refresh_reached();
    }

    /// The target at a distance from a place. Its place is that of its data, so that no sum of many distances drifts.
    fn further(&self, place: Position, data: i32, distance: i32) -> Target {
        let coordinates = &self.settings.coordinates;
        let here = self.output.position_command;
        let within = self.axis.cyclic_position(here);
        let ahead = place + coordinates.place(distance);
        let data = match coordinates.modulo {
            None => data.wrapping_add(distance),
            Some(_) => coordinates.data(coordinates.range.reduce(within + (ahead - here))),
        };
        // The nearest place with these data.
        let exact = here + coordinates.place(data) - within;
        let rounding = coordinates.range.around_zero(coordinates.range.reduce(ahead - exact));
        Target { place: ahead - rounding, data, commanded: None, attained: false }
    }

    #[cold]
    fn aim_at(&mut self, commanded: i32) {
        let coordinates = &self.settings.coordinates;
        let wanted = coordinates.place(commanded);
        let here = self.output.position_command;
        let within = self.axis.cyclic_position(here);
        let way = match coordinates.modulo {
            // The way that the numbers go, never over the border between the highest and the lowest: behind it may be the end of the axis.
            None => wanted - coordinates.range.around_zero(within),
            Some(_) => self.way_to(coordinates.range.reduce(wanted - within)),
        };
        let data = coordinates.data(coordinates.range.reduce(wanted));
        self.positioning.target = Some(Target { place: here + way, data, commanded: Some(commanded), attained: false });
        self.refresh_reached();
    }

    /// The way to a position that was commanded, from where the axis is now.
    #[cold]
    fn aim_again(&mut self) {
        let unfinished = self.positioning.target.filter(|target| !target.attained);
        if let Some(commanded) = unfinished.and_then(|target| target.commanded) {
            self.aim_at(commanded);
        }
    }

    /// The way of a modulo axis in the direction of S-0-0393, from the way in the direction of the motor, `0 ..` modulo value.
    fn way_to(&self, forwards: Position) -> Position {
        let range = self.settings.coordinates.range;
        let settings = &self.settings.positioning;
        let reversed = self.settings.coordinates.reversed;
        let is_forwards = match settings.direction {
            Direction::Shortest => return range.around_zero(forwards),
            Direction::Positive => !reversed,
            Direction::Negative => reversed,
        };
        let signed = |way: Position| if is_forwards { way } else { -way };
        let ahead = if is_forwards || forwards == Position::ZERO { forwards } else { range.value() - forwards };
        let shortest = range.around_zero(ahead);
        if self.axis.setpoint_rests() {
            let is_just_behind = shortest < Position::ZERO && -shortest <= settings.window_behind;
            return signed(if is_just_behind { shortest } else { ahead });
        }
        // Too near to stop there: the axis would come back.
        let stops = self.axis.stops_before(&settings.limits, self.output.position_command + signed(ahead));
        signed(if stops { ahead } else { ahead + range.value() })
    }

    /// Position data of a place near the axis.
    fn data_at(&self, place: Position) -> i32 {
        self.settings.coordinates.data(self.axis.cyclic_position(place))
    }

    /// S-0-0430.
    pub(super) fn effective_target(&self) -> i32 {
        self.positioning.target.map_or_else(|| self.data_at(self.output.position_command), |target| target.data)
    }

    /// S-0-0437.
    pub(super) fn positioning_status(&self) -> u16 {
        let positioning = &self.positioning;
        let reached = |bit: Class3| self.class_3.contains(bit);
        let waits = positioning.source == Some(TargetSource::Control)
            && positioning.is_asked(self.commands.positioning_control);
        [
            positioning.acknowledged,
            reached(Class3::TARGET_ATTAINED),
            reached(Class3::INTERPOLATOR_HALTED),
            reached(Class3::AT_ACTIVE_TARGET),
            reached(Class3::IN_COARSE_POSITION),
            reached(Class3::IN_POSITION),
            positioning.jogging,
            waits,
            positioning.source.is_some(),
        ]
        .into_iter()
        .rev()
        .fold(0, |word, bit| word << 1 | u16::from(bit))
    }

    /// The bits of C3D that tell of having reached something (S-0-0336, S-0-0338, S-0-0341 to S-0-0343).
    ///
    /// In position is an axis near a command that it follows, but not on the way of a movement of its own. The target is attained by the
    /// set-point, as on other drives; being near it is another bit.
    #[inline(never)]
    pub(super) fn reached(&self) -> Class3 {
        let mut reached = Class3::empty();
        let near = self.output.following_error.abs() <= self.settings.position_window;
        match self.axis.mode() {
            Mode::Position => reached.set(Class3::IN_POSITION, near),
            Mode::Halt | Mode::Travel if self.machine.state().is_in_operation() => {
                let rests = self.axis.setpoint_rests();
                if self.positioning.source.is_none() {
                    reached.set(Class3::IN_POSITION, near && rests && !self.is_travelling_home());
                    return reached;
                }
                reached.set(Class3::INTERPOLATOR_HALTED, rests);
                let Some(target) = self.positioning.target else { return reached };
                let attained = self.is_ready_for_next();
                let distance = (target.place - self.encoder.position()).abs();
                reached.set(Class3::TARGET_ATTAINED, attained);
                reached.set(Class3::IN_POSITION, attained && near);
                reached.set(Class3::AT_ACTIVE_TARGET, distance <= self.settings.position_window);
                reached.set(Class3::IN_COARSE_POSITION, distance <= self.settings.coarse_window);
            }
            _ => {}
        }
        reached
    }

    /// A new target is not reached by having reached the old one, not even until the supervision looks.
    fn refresh_reached(&mut self) {
        let class_3 = self.class_3.difference(REACHED) | self.reached();
        self.show_class_3(class_3);
    }
}
