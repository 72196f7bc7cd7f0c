//! Legs of the bridge that are more than a switch each: with a capacitance, or with a cable that is broken.

use crate::cable::Cable;
use crate::frame::Dq;
use crate::inverter::{Inverter, Terminal};
use crate::windings::{Direction, Drive, Flow, Surroundings, Windings};

/// What holds the current of an open phase: 100 megohm, so that not a hundredth of the leakage of a diode flows through it.
const OPEN: Part = Part { deviation: 0.0, drop: 1e5, center: 0.0, knee: 1e-3, curved: false };
/// Nothing.
const NONE: Part = Part { deviation: 0.0, drop: 0.0, center: 0.0, knee: 1.0, curved: false };
/// So many times the tangents are tried; four suffice but where currents pass zero.
const ATTEMPTS: usize = 24;
/// Currents that move less than this in A from one trial to the next are found.
const FOUND: f64 = 1e-9;

/// Capacitance between the output of each leg and the bus: of both transistors, their module, and the cable.
///
/// In a dead time in which the current commutates from a transistor to the opposite diode, the voltage does not jump but slews with
/// `dv/dt = i / C` (Zhang, Xu, Dead-time compensation of inverters considering snubber and parasitic capacitance, IEEE Trans. Power
/// Electronics 29, 2014, 3179). Within the dead time `Td` it comes all the way on a bus of `U` when the current is above `i0 = C U / Td`. The
/// other dead time of the period loses all of `U Td` as ever. So a period loses `U Td (1 - i0 / 2i)` above `i0`, and `U Td i / 2i0` below,
/// where the other transistor closes on what is left of the voltage.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LegCapacitance {
    /// In F.
    pub farads: f64,
}

/// A part of a leg's voltage that depends on the direction of the current: `-(deviation * bus + drop) * level`.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Part {
    deviation: f64,
    drop: f64,
    /// Current in A at which the level is zero.
    center: f64,
    /// So far from there, in A, the level changes evenly.
    knee: f64,
    /// There it has reached one half and nears 1 as `1 - knee / 2i`; else it has reached 1.
    curved: bool,
}

/// A leg with its cable, as a winding sees it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Leg {
    /// Share of the bus voltage without current.
    share: f64,
    parts: [Part; 2],
    /// In series, in ohm.
    resistance: f64,
    /// To the bus's minus, in 1/ohm.
    earth: f64,
}

impl LegCapacitance {
    pub(crate) fn check(&self) {
        assert!(self.farads >= 0.0, "the capacitance of a leg must not be negative");
    }
}

impl Part {
    /// The level at a current.
    fn level(&self, current: f64) -> f64 {
        let [constant, slope] = self.tangent(current, Direction::of(current - self.center, self.knee));
        constant + slope * current
    }

    /// The level as a straight line through that of a current, of which the direction is known: its value at zero, and its slope.
    fn tangent(&self, current: f64, direction: Direction) -> [f64; 2] {
        let inner = if self.curved { 0.5 } else { 1.0 };
        let sign = match direction {
            Direction::AroundZero => {
                let slope = inner / self.knee;
                return [-slope * self.center, slope];
            }
            Direction::IntoMotor => 1.0,
            Direction::OutOfMotor => -1.0,
        };
        if !self.curved {
            return [sign, 0.0];
        }
        let away = (sign * (current - self.center)).max(self.knee);
        let slope = 0.5 * self.knee / (away * away);
        let level = sign * (1.0 - 0.5 * self.knee / away);
        [level - slope * (self.center + sign * away), slope]
    }
}

impl Leg {
    /// The legs of a bridge, each with its part of the cable.
    pub(crate) fn all(
        inverter: &Inverter,
        terminals: [Terminal; 3],
        capacitance: Option<LegCapacitance>,
        cable: &Cable,
        (bridge, bus): (bool, f64),
    ) -> [Self; 3] {
        core::array::from_fn(|k| {
            let mut leg = Self::sound(terminals[k], bridge);
            if let Some(LegCapacitance { farads }) = capacitance
                && bridge
                && inverter.dead_time > 0.0
            {
                leg.slew(farads * bus / inverter.dead_time);
            }
            if let Some(fault) = cable.earth_fault_of(k) {
                leg.earth(1.0 / fault.resistance, bus);
            }
            if cable.is_open(k) {
                leg.open(bridge);
            }
            leg.resistance = cable.resistance(k);
            leg
        })
    }

    /// An open bridge's diodes take the bus's voltage and their own at one current; a transistor's drop is independent of the dead time.
    fn sound(Terminal { share, deviation, drop, knee }: Terminal, bridge: bool) -> Self {
        let part = |deviation, drop| Part { deviation, drop, center: 0.0, knee, curved: false };
        let parts = if bridge { [part(deviation, 0.0), part(0.0, drop)] } else { [part(deviation, drop), NONE] };
        Self { share, parts, resistance: 0.0, earth: 0.0 }
    }

    /// With a voltage that slews all the way within the dead time from this current on. The ripple of the current leaves its own knee.
    fn slew(&mut self, all_the_way: f64) {
        let [switch, _] = &mut self.parts;
        // The slope at zero is half of that of a straight line to the knee.
        switch.knee = all_the_way.max(0.5 * switch.knee);
        switch.curved = true;
    }

    /// With a path to the bus's minus. While no transistor conducts, a current that comes out of the motor goes there and lifts the leg no
    /// higher than its resistance says: to the upper diode from `bus / resistance` on.
    fn earth(&mut self, conductance: f64, bus: f64) {
        let [switch, _] = &mut self.parts;
        switch.knee = ((0.5 * bus + switch.drop) * conductance).max(switch.knee);
        switch.center = -0.5 * bus * conductance;
        switch.curved = false;
        self.earth = conductance;
    }

    /// With a broken core.
    fn open(&mut self, bridge: bool) {
        self.parts = [OPEN, NONE];
        if !bridge {
            // Nothing lifts the leg any more.
            (self.share, self.earth) = (0.0, 0.0);
        }
    }

    /// Current in A that the bridge draws for the path to the bus's minus, with the level of the switches.
    fn drawn_to_earth(&self, level: f64, bus: f64) -> f64 {
        let [switch, _] = self.parts;
        let between = 0.5 * (1.0 - level);
        self.earth * bus * (self.share - switch.deviation + 2.0 * switch.deviation * between * between)
    }

    /// Voltage in V on the bus's minus, as the mean over a period, at a current into the motor.
    pub(crate) fn voltage(&self, current: f64, bus: f64) -> f64 {
        let drop: f64 = self.parts.iter().map(|part| (part.deviation * bus + part.drop) * part.level(current)).sum();
        self.share * bus - drop
    }
}

impl Windings {
    /// The currents after a step behind such legs: as [`Windings::step`], with the tangent at each trial where a leg's voltage is curved.
    pub(crate) fn step_behind(&self, start: Dq, legs: &[Leg; 3], surroundings: &Surroundings) -> Flow {
        let frame = &surroundings.frame;
        let directions_of = |phases: [f64; 3]| -> [[Direction; 2]; 3] {
            core::array::from_fn(|k| {
                core::array::from_fn(|n| {
                    let part = &legs[k].parts[n];
                    Direction::of(phases[k] - part.center, part.knee)
                })
            })
        };
        let before = frame.phases(start);
        let (mut end, mut tried) = (start, before);
        let mut directions = directions_of(tried);
        for attempt in 1..=ATTEMPTS {
            let drive = drive(legs, before, tried, &directions, surroundings);
            end = self.solve(start, start.mean(end), surroundings, &drive);
            let phases = frame.phases(end);
            let found = directions_of(phases);
            let next = core::array::from_fn(|k| core::array::from_fn(|n| directions[k][n].towards(found[k][n])));
            let moved = (0..3).map(|k| (phases[k] - tried[k]).abs()).fold(0.0, f64::max);
            if next == directions && moved < FOUND && attempt >= self.least_attempts() {
                break;
            }
            (directions, tried) = (next, phases);
        }
        self.flow_behind(start, end, legs, surroundings)
    }

    fn flow_behind(&self, start: Dq, end: Dq, legs: &[Leg; 3], surroundings: &Surroundings) -> Flow {
        let Surroundings { resistance, frame, bus, .. } = surroundings;
        let mean = start.mean(end);
        let (after, during) = (frame.phases(end), frame.phases(mean));
        let (mut drawn, mut inverter_loss) = (0.0, 0.0);
        for (k, leg) in legs.iter().enumerate() {
            let levels = leg.parts.map(|part| part.level(after[k]));
            drawn += leg.share * during[k] + leg.drawn_to_earth(levels[0], *bus);
            for (part, level) in leg.parts.iter().zip(levels) {
                drawn -= part.deviation * level * during[k];
                inverter_loss += part.drop * level * during[k];
            }
        }
        Flow { end, mean, drawn, winding_loss: 1.5 * resistance * mean.square(), inverter_loss }
    }
}

fn drive(
    legs: &[Leg; 3],
    before: [f64; 3],
    tried: [f64; 3],
    directions: &[[Direction; 2]; 3],
    surroundings: &Surroundings,
) -> Drive {
    let Surroundings { frame, bus, .. } = surroundings;
    let mut drive = Drive::new();
    for (k, leg) in legs.iter().enumerate() {
        // Of a resistor the mean of both currents counts, as of the winding's own.
        let mut voltage = leg.share * bus - 0.5 * leg.resistance * before[k];
        let mut ohm = 0.5 * leg.resistance;
        for (part, direction) in leg.parts.iter().zip(directions[k]) {
            let swing = part.deviation * bus + part.drop;
            let [constant, slope] = part.tangent(tried[k], direction);
            voltage -= swing * constant;
            ohm += swing * slope;
        }
        drive.add_voltage(k, voltage);
        drive.add_slope(k, frame, 2.0 / 3.0 * ohm);
    }
    drive
}
