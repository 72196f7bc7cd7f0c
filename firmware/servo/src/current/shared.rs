//! What the current loop shares with the tasks below it, without a lock and without a copy: a cycle reads its command where the control
//! loop has put it, and leaves its readings where the control loop finds them.
//!
//! Every word is loaded and stored whole, as fast as a word of its own. Which words belong together is up to whoever owns these: a
//! command is written while no cycle looks at it, its torque-producing reference alone at any time, readings are looked at while no cycle writes
//! them.

use core::sync::atomic::{AtomicI32, AtomicU32, Ordering::Relaxed};

use super::command::{BusScale, CurrentCommand};
use super::readings::CurrentReadings;
use crate::arithmetic::trigonometry::Rotation;

/// A [`CurrentCommand`] that a cycle can be given while the next one is being written elsewhere.
#[derive(Debug)]
pub struct SharedCommand {
    pub(super) direct: Word,
    pub(super) quadrature: Word,
    angle: AtomicU32,
    count: AtomicU32,
    angle_per_increment: AtomicU32,
    cosine: Word,
    sine: Word,
    pub(super) direct_voltage: Word,
    pub(super) quadrature_voltage: Word,
    pub(super) longest: Word,
    pub(super) longest_direct: Word,
    pub(super) inverse: Word,
    pub(super) counts: Word,
    pub(super) side: Word,
}

/// What a cycle measured and gave. Phase currents and angle are put here first: the cycle takes them from here.
#[derive(Debug)]
pub struct SharedReadings {
    phases: [Word; 3],
    angle: AtomicU32,
    direct: Word,
    quadrature: Word,
    direct_voltage: Word,
    quadrature_voltage: Word,
}

impl SharedCommand {
    /// No current at angle 0, and no voltage to make one with.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            direct: Word::ZERO,
            quadrature: Word::ZERO,
            angle: AtomicU32::new(0),
            count: AtomicU32::new(0),
            angle_per_increment: AtomicU32::new(0),
            cosine: Word::ZERO,
            sine: Word::ZERO,
            direct_voltage: Word::ZERO,
            quadrature_voltage: Word::ZERO,
            longest: Word::ZERO,
            longest_direct: Word::ZERO,
            inverse: Word::ZERO,
            counts: Word::ZERO,
            side: Word::ZERO,
        }
    }

    /// Writes a command.
    pub fn set(&self, command: &CurrentCommand) {
        self.set_currents(command.direct, command.quadrature);
        self.set_angle(command.angle, command.count, command.angle_per_increment);
        self.set_ahead(command.ahead);
        self.set_voltages(command.direct_voltage, command.quadrature_voltage);
        self.set_bus(&command.bus);
    }

    /// The references alone.
    #[inline]
    pub fn set_currents(&self, direct: i32, quadrature: i32) {
        self.direct.set(direct);
        self.quadrature.set(quadrature);
    }

    /// The torque-producing reference alone, also while cycles are given the command.
    #[inline]
    pub fn set_quadrature(&self, quadrature: i32) {
        self.quadrature.set(quadrature);
    }

    /// The angle alone, with the count that it belongs to.
    #[inline]
    pub fn set_angle(&self, angle: u32, count: u32, angle_per_increment: u32) {
        self.angle.store(angle, Relaxed);
        self.count.store(count, Relaxed);
        self.angle_per_increment.store(angle_per_increment, Relaxed);
    }

    /// The rotation until the voltage acts, alone.
    #[inline]
    pub fn set_ahead(&self, ahead: Rotation) {
        self.cosine.set(ahead.cosine);
        self.sine.set(ahead.sine);
    }

    /// The feed-forward alone.
    #[inline]
    pub fn set_voltages(&self, direct: i32, quadrature: i32) {
        self.direct_voltage.set(direct);
        self.quadrature_voltage.set(quadrature);
    }

    /// The measure of the bus voltage alone.
    #[inline]
    pub fn set_bus(&self, bus: &BusScale) {
        self.longest.set(bus.longest);
        self.longest_direct.set(bus.longest_direct);
        self.inverse.set(bus.inverse);
        self.counts.set(bus.counts);
        self.side.set(bus.side);
    }

    /// Electrical angle at an encoder count at most some hundred increments away from [`CurrentCommand::count`].
    #[inline]
    #[must_use]
    pub fn angle_at(&self, count: u32) -> u32 {
        let moved = count.wrapping_sub(self.count.load(Relaxed));
        self.angle.load(Relaxed).wrapping_add(moved.wrapping_mul(self.angle_per_increment.load(Relaxed)))
    }

    #[inline]
    pub(super) fn ahead(&self) -> Rotation {
        Rotation { cosine: self.cosine.get(), sine: self.sine.get() }
    }
}

impl SharedReadings {
    /// Nothing measured, nothing given.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            phases: [Word::ZERO; 3],
            angle: AtomicU32::new(0),
            direct: Word::ZERO,
            quadrature: Word::ZERO,
            direct_voltage: Word::ZERO,
            quadrature_voltage: Word::ZERO,
        }
    }

    /// Electrical angle of the sample, 2^-32 revolution.
    #[inline]
    pub fn set_angle(&self, angle: u32) {
        self.angle.store(angle, Relaxed);
    }

    /// Phase currents in ADC counts 2^-3, see [`crate::current::Offsets::remove`].
    #[inline]
    pub fn set_phases(&self, [a, b, c]: [i32; 3]) {
        let [phase_a, phase_b, phase_c] = &self.phases;
        phase_a.set(a);
        phase_b.set(b);
        phase_c.set(c);
    }

    /// No current any more. The voltages stay: there is none at all without the bridge.
    pub fn without_current(&self) {
        self.set_phases([0; 3]);
        self.direct.set(0);
        self.quadrature.set(0);
    }

    /// What [`SharedReadings::set_angle`] was told.
    #[inline]
    #[must_use]
    pub fn angle(&self) -> u32 {
        self.angle.load(Relaxed)
    }

    /// What [`SharedReadings::set_phases`] was told.
    #[inline]
    #[must_use]
    pub fn phases(&self) -> [i32; 3] {
        let [a, b, c] = &self.phases;
        [a.get(), b.get(), c.get()]
    }

    /// What the cycle made of it.
    #[inline]
    #[must_use]
    pub fn readings(&self) -> CurrentReadings {
        CurrentReadings {
            direct: self.direct.get(),
            quadrature: self.quadrature.get(),
            direct_voltage: self.direct_voltage.get(),
            quadrature_voltage: self.quadrature_voltage.get(),
        }
    }

    #[inline]
    pub(super) fn set_currents(&self, direct: i32, quadrature: i32) {
        self.direct.set(direct);
        self.quadrature.set(quadrature);
    }

    #[inline]
    pub(super) fn set_voltages(&self, direct: i32, quadrature: i32) {
        self.direct_voltage.set(direct);
        self.quadrature_voltage.set(quadrature);
    }
}

impl Default for SharedCommand {
    fn default() -> Self {
        Self::new()
    }
}

impl Default for SharedReadings {
    fn default() -> Self {
        Self::new()
    }
}

/// A signed word.
#[derive(Debug)]
pub(super) struct Word(AtomicI32);

impl Word {
    #[allow(clippy::declare_interior_mutable_const, reason = "what every word begins with")]
    const ZERO: Self = Self(AtomicI32::new(0));

    #[inline]
    pub(super) fn get(&self) -> i32 {
        self.0.load(Relaxed)
    }

    #[inline]
    fn set(&self, value: i32) {
        self.0.store(value, Relaxed);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_angle_follows_the_count_across_its_wrap() {
        let shared = SharedCommand::new();
        shared.set(&CurrentCommand {
            direct: 0,
            quadrature: 0,
            angle: 0xFFFF_FFF0,
            count: u32::MAX,
            angle_per_increment: 16,
            ahead: Rotation::NONE,
            direct_voltage: 0,
            quadrature_voltage: 0,
            bus: BusScale::default(),
        });
        assert_eq!(shared.angle_at(0), 0);
        assert_eq!(shared.angle_at(1), 16);
        assert_eq!(shared.angle_at(u32::MAX - 1), 0xFFFF_FFE0);
    }

    #[test]
    fn a_bridge_that_is_off_has_no_current_but_keeps_its_angle() {
        let shared = SharedReadings::new();
        shared.set_phases([1, -2, 3]);
        shared.set_angle(7);
        shared.set_currents(4, 5);
        shared.set_voltages(6, 8);
        assert_eq!((shared.phases(), shared.angle()), ([1, -2, 3], 7));
        shared.without_current();
        let left = CurrentReadings { direct_voltage: 6, quadrature_voltage: 8, ..CurrentReadings::default() };
        assert_eq!((shared.phases(), shared.angle(), shared.readings()), ([0; 3], 7, left));
    }
}
