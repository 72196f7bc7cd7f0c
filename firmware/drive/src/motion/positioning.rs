//! Movements to a target by the drive itself, and what it tells of having reached it.
//!
//! Two kinds: to S-0-0258 as soon as it is written (modes 0013H, 001BH), or to what S-0-0346 takes over of S-0-0282 when its bit 0 changes
//! (0213H, 021BH). HALT only interrupts a movement. A target is left, or with S-0-0393 bit 2 = 0 kept for later, when its mode ends, the
//! torque goes, the axis is homed or an identification moves it.
//!
//! Sources: sercos2.md 4.3 and Appendix B for the words. What S-0-0437 has in which bit is in no public paper: it is this drive's own.

use sercos::diagnostic::Class3;
use servo::axis::{Axis, AxisOutput, Mode, Travel};
use servo::units::{Position, Velocity};

use crate::operation_mode::{Direction, OperationMode, TargetSource};
use crate::settings::MotionSettings;
use crate::signal::command::CommandValues;

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
    /// The target has become another one in this step.
    renewed: bool,
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
pub(super) const REACHED: Class3 = Class3::IN_POSITION
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

/// The axis that is moved, as it is now.
pub(super) struct Scene<'a> {
    axis: &'a Axis,
    output: &'a AxisOutput,
    settings: &'a MotionSettings,
    /// Measured.
    position: Position,
}

impl<'a> Scene<'a> {
    /// `output`: what the loops gave in their last tick.
    #[inline]
    pub(super) const fn new(
        axis: &'a Axis,
        output: &'a AxisOutput,
        settings: &'a MotionSettings,
        position: Position,
    ) -> Self {
        Self { axis, output, settings, position }
    }

    /// Position data of a place near the axis.
    fn data_at(&self, place: Position) -> i32 {
        self.settings.coordinates.data(self.axis.cyclic_position(place))
    }
}

/// One step on the way. Plain values, for who moves the axis and tells of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct PositioningStep {
    /// The movement of the axis.
    pub(super) travel: Travel,
    /// The target is another one now.
    pub(super) renewed: bool,
    /// The axis stays where it is, which is to be the value of S-0-0258.
    pub(super) stays_at: Option<i32>,
}

impl Positioning {
    /// A mode with a target is active.
    #[inline]
    pub(super) const fn is_active(&self) -> bool {
        self.source.is_some()
    }

    /// The next step begins from where the axis is: a mode with a target has just become active, or the movement goes on.
    #[inline]
    pub(super) const fn takes_over(&self) -> bool {
        self.source.is_some() && self.begins
    }

    /// A phase begins: nothing is left of the last one.
    pub(super) fn reset(&mut self) {
        *self = Self::default();
    }

    /// S-0-0258 has a new value, or its old one once more.
    #[inline]
    pub(super) const fn target_is_written(&mut self) {
        self.written = true;
    }

    /// A movement stops or goes on: the way to the target is another one now.
    #[inline]
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

    /// Something may begin or end with this mode. Most modes have no target.
    #[inline]
    pub(super) fn is_concerned(&self, mode: Option<OperationMode>) -> bool {
        mode.and_then(OperationMode::target_source).is_some() || self.source.is_some()
    }

    /// Notices that a mode with a target begins or ends. `free`: the drive follows or is halted, and no function moves or holds the axis;
    /// `control`: S-0-0346.
    pub(super) fn watch(&mut self, mode: Option<OperationMode>, free: bool, control: u16, drops_target: bool) {
        let source = mode.and_then(OperationMode::target_source).filter(|_| free);
        if source == self.source {
            return;
        }
        self.source = source;
        self.jogging = false;
        if source.is_none() {
            // What is written from now on is meant for the next time.
            self.written = false;
            return;
        }
        self.seen = control;
        if drops_target {
            self.target = None;
        }
    }

    /// One step on the way to the target. In HALT the target may become another one, and the axis stays.
    #[inline]
    pub(super) fn step(&mut self, scene: &Scene<'_>, commands: &CommandValues) -> PositioningStep {
        self.renewed = false;
        if self.source == Some(TargetSource::Control) {
            let travel = self.controlled_travel(scene, commands);
            return PositioningStep { travel, renewed: self.renewed, stays_at: None };
        }
        let travel = self.targeted_travel(scene, commands.target_position);
        let stays = self.target.filter(|target| self.renewed && target.commanded.is_none());
        PositioningStep { travel, renewed: self.renewed, stays_at: stays.map(|target| target.data) }
    }

    fn targeted_travel(&mut self, scene: &Scene<'_>, commanded: i32) -> Travel {
        let begins = core::mem::take(&mut self.begins);
        if core::mem::take(&mut self.written) && self.target.is_none_or(|target| target.commanded != Some(commanded)) {
            self.aim_at(scene, commanded);
        } else if begins {
            self.aim_again(scene);
        }
        self.travel_to_target(scene)
    }

    fn controlled_travel(&mut self, scene: &Scene<'_>, commands: &CommandValues) -> Travel {
        let control = commands.positioning_control;
        let jog = control & JOG;
        let upwards = jog == JOG_POSITIVE;
        self.jogging = upwards || jog == JOG_NEGATIVE;
        if self.jogging {
            self.renewed = self.target.take().is_some();
            let upwards = upwards != scene.settings.coordinates.reversed;
            return Travel::AtVelocity(if upwards { Velocity::MAX } else { -Velocity::MAX });
        }
        if jog != 0 {
            self.begins = true;
            return Travel::Hold;
        }
        let begins = core::mem::take(&mut self.begins);
        if self.is_asked(control) && (control & AT_ONCE != 0 || self.is_ready_for_next(scene)) {
            self.take_over(scene, control, commands.positioning_value);
        } else if begins {
            self.aim_again(scene);
        }
        self.travel_to_target(scene)
    }

    /// On the way, or where the axis stands once it does.
    fn travel_to_target(&mut self, scene: &Scene<'_>) -> Travel {
        if self.target.is_none() && scene.axis.setpoint_rests() {
            let place = scene.output.position_command;
            self.renew(Target { place, data: scene.data_at(place), commanded: None, attained: false });
        }
        let attained = self.is_ready_for_next(scene);
        if let Some(target) = &mut self.target {
            target.attained |= attained;
        }
        self.target.map_or(Travel::Hold, |target| Travel::To(target.place))
    }

    /// Nothing is left of the last movement.
    fn is_ready_for_next(&self, scene: &Scene<'_>) -> bool {
        scene.axis.setpoint_rests()
            && self.target.is_none_or(|target| target.attained || target.place == scene.output.position_command)
    }

    #[cold]
    fn renew(&mut self, target: Target) {
        self.target = Some(target);
        self.renewed = true;
    }

    /// S-0-0282, taken over by S-0-0346.
    #[cold]
    fn take_over(&mut self, scene: &Scene<'_>, control: u16, value: i32) {
        self.seen = control;
        self.acknowledged = control & TOGGLE != 0;
        if control & IS_DISTANCE == 0 {
            return self.aim_at(scene, value);
        }
        let (place, data) = match self.target {
            _ if control & FROM_ACTUAL != 0 => (scene.position, scene.data_at(scene.position)),
            Some(Target { place, data, .. }) => (place, data),
            None => (scene.output.position_command, scene.data_at(scene.output.position_command)),
        };
        self.renew(further(scene, place, data, value));
    }

    #[cold]
    fn aim_at(&mut self, scene: &Scene<'_>, commanded: i32) {
        let coordinates = &scene.settings.coordinates;
        let wanted = coordinates.place(commanded);
        let here = scene.output.position_command;
        let within = scene.axis.cyclic_position(here);
        let way = match coordinates.modulo {
            // The way that the numbers go, never over the border between the highest and the lowest: behind it may be the end of the axis.
            None => wanted - coordinates.range.around_zero(within),
            Some(_) => way_to(scene, coordinates.range.reduce(wanted - within)),
        };
        let data = coordinates.data(coordinates.range.reduce(wanted));
        self.renew(Target { place: here + way, data, commanded: Some(commanded), attained: false });
    }

    /// The way to a position that was commanded, from where the axis is now.
    #[cold]
    fn aim_again(&mut self, scene: &Scene<'_>) {
        let unfinished = self.target.filter(|target| !target.attained);
        if let Some(commanded) = unfinished.and_then(|target| target.commanded) {
            self.aim_at(scene, commanded);
        }
    }

    /// S-0-0430.
    pub(super) fn effective_target(&self, scene: &Scene<'_>) -> i32 {
        self.target.map_or_else(|| scene.data_at(scene.output.position_command), |target| target.data)
    }

    /// S-0-0437; `control`: S-0-0346.
    pub(super) fn status(&self, class_3: Class3, control: u16) -> u16 {
        let reached = |bit: Class3| class_3.contains(bit);
        let waits = self.source == Some(TargetSource::Control) && self.is_asked(control);
        [
            self.acknowledged,
            reached(Class3::TARGET_ATTAINED),
            reached(Class3::INTERPOLATOR_HALTED),
            reached(Class3::AT_ACTIVE_TARGET),
            reached(Class3::IN_COARSE_POSITION),
            reached(Class3::IN_POSITION),
            self.jogging,
            waits,
            self.source.is_some(),
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
    pub(super) fn reached(&self, scene: &Scene<'_>, in_operation: bool, travels_home: bool) -> Class3 {
        let mut reached = Class3::empty();
        let near = scene.output.following_error.abs() <= scene.settings.position_window;
        match scene.axis.mode() {
            Mode::Position => reached.set(Class3::IN_POSITION, near),
            Mode::Halt | Mode::Travel if in_operation => {
                let rests = scene.axis.setpoint_rests();
                if self.source.is_none() {
                    reached.set(Class3::IN_POSITION, near && rests && !travels_home);
                    return reached;
                }
                reached.set(Class3::INTERPOLATOR_HALTED, rests);
                let Some(target) = self.target else { return reached };
                let attained = self.is_ready_for_next(scene);
                let distance = (target.place - scene.position).abs();
                reached.set(Class3::TARGET_ATTAINED, attained);
                reached.set(Class3::IN_POSITION, attained && near);
                reached.set(Class3::AT_ACTIVE_TARGET, distance <= scene.settings.position_window);
                reached.set(Class3::IN_COARSE_POSITION, distance <= scene.settings.coarse_window);
            }
            _ => {}
        }
        reached
    }
}

/// The target at a distance from a place. Its place is that of its data, so that no sum of many distances drifts.
fn further(scene: &Scene<'_>, place: Position, data: i32, distance: i32) -> Target {
    let coordinates = &scene.settings.coordinates;
    let here = scene.output.position_command;
    let within = scene.axis.cyclic_position(here);
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

/// The way of a modulo axis in the direction of S-0-0393, from the way in the direction of the motor, `0 ..` modulo value.
fn way_to(scene: &Scene<'_>, forwards: Position) -> Position {
    let range = scene.settings.coordinates.range;
    let settings = &scene.settings.positioning;
    let reversed = scene.settings.coordinates.reversed;
    let is_forwards = match settings.direction {
        Direction::Shortest => return range.around_zero(forwards),
        Direction::Positive => !reversed,
        Direction::Negative => reversed,
    };
    let signed = |way: Position| if is_forwards { way } else { -way };
    let ahead = if is_forwards || forwards == Position::ZERO { forwards } else { range.value() - forwards };
    let shortest = range.around_zero(ahead);
    if scene.axis.setpoint_rests() {
        let is_just_behind = shortest < Position::ZERO && -shortest <= settings.window_behind;
        return signed(if is_just_behind { shortest } else { ahead });
    }
    // Too near to stop there: the axis would come back.
    let stops = scene.axis.stops_before(&settings.limits, scene.output.position_command + signed(ahead));
    signed(if stops { ahead } else { ahead + range.value() })
}
