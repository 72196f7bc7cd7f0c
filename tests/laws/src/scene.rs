//! Everything that the laws look at, at one instant.

use std::collections::VecDeque;

use ring::Nanoseconds;
use ring::ident::Idn;

use plant::MachineSettings;

use crate::settings::Settings;
use crate::sight::Sight;
use crate::units::Units;
use crate::wire::Wire;

/// What is seen and heard of one axis.
#[derive(Clone, Debug)]
pub struct Scene {
    /// Now.
    pub now: Nanoseconds,
    /// The last look.
    pub sight: Sight,
    /// The look before it.
    pub before: Sight,
    /// The fibre.
    pub wire: Wire,
    /// What the drive is set to.
    pub settings: Settings,
    /// What its increments are.
    pub units: Option<Units>,
    /// What the machine is made of.
    pub machine: MachineSettings,
    /// S-0-0002, or 2 ms.
    pub cycle: Nanoseconds,
    /// When the load, or another torque from outside, last changed; a seized shaft and a shaft that is let go count too.
    pub disturbed: Option<Nanoseconds>,
    /// When the service channel last wrote something.
    pub written: Option<Nanoseconds>,
    /// When something outside the drive was last not as it should be.
    pub troubled: Option<Nanoseconds>,
    /// A sensor of current or position shows, or has shown since the bridge came on, what is not so.
    pub deceived: bool,
    /// When the encoder last counted what the shaft did not turn.
    pub slipped: Option<Nanoseconds>,
    /// What the slips added up to when P-0-0118 was last written.
    pub in_step_at: i32,
    /// When a pin of the power stage last changed.
    pub pins_changed: Option<Nanoseconds>,
    /// When the bridge was last switched.
    pub bridge_changed: Option<Nanoseconds>,
    /// The last procedure command that was started and not yet cancelled.
    pub command: Option<Idn>,
    /// S-0-0148 or S-0-0447 is set, whatever else was started since.
    pub homing: bool,
    /// The procedure command that is being started, before the drive has acknowledged it.
    pub starting: Option<Idn>,
    /// When a telegram of the master last came late or not at all, or an MST too early.
    pub irregular: Option<Nanoseconds>,
    /// When a command value last changed, in the MDT or over the service channel.
    pub commanded: Option<Nanoseconds>,
    /// When the load was last stronger than the motor may be.
    pub overpowered: Option<Nanoseconds>,
    /// When a command or a value was last written that may give positions another zero or another weight.
    pub rezeroed: Option<Nanoseconds>,
    /// Where the shaft was, in revolutions, over the last cycles; the newest at the end.
    pub path: VecDeque<(Nanoseconds, f64)>,
}

/// Procedure commands by which the drive moves the axis itself.
const MOVERS: [u16; 6] = [148, 149, 152, 0x8000 | 224, 0x8000 | 225, 0x8000 | 226];

/// A temperature may be measured so many degrees wrong.
const SENSOR: f64 = 5.0;

/// Operation modes 3, 4, 11 and 12: S-0-0047 is followed.
const POSITION_MODES: [u16; 4] = [3, 4, 11, 12];

/// Amplitude in A of 1 mA RMS.
pub(crate) const AMPLITUDE: f64 = 1e-3 * core::f64::consts::SQRT_2;

/// A bridge reaches this share of its longest vector; the rest is what a current is controlled with.
const REACH: f64 = 0.93;

/// 93 % of P-0-0105, less what a small link rises by within a millisecond.
const LINK_FULL: f64 = 0.88;

/// In electrical revolutions: 20 degrees, with which 94 % of the torque are left.
const OUT_OF_STEP: f64 = 20.0 / 360.0;

/// A brake holds at this multiple of its delay.
const FIRM: f64 = 1.2;

impl Scene {
    /// A line for a reader who follows an axis from AT to AT (`LAWS_TRACE`).
    #[must_use]
    pub fn words(&self) -> String {
        let (sight, machine) = (&self.sight, &self.sight.machine);
        let or_dash = |value: Option<f64>| value.map_or_else(|| "-".to_owned(), |value| format!("{value:.0}"));
        let [d, q] = machine.current;
        let distance = self.wire.feedback(Idn::FOLLOWING_DISTANCE);
        format!(
            "{:>9} us CP{} control {:04X}H status {:04X}H {:9.2} rpm {:11.6} rev, {:7.2} A (d {:6.2}), brake {:5.2} Nm, load {:6.2} Nm, {:4.0} V{}{}{}; S-0-0047 {}, S-0-0051 {}{}{}",
            self.now.0 / 1_000,
            self.wire.phase,
            self.wire.control,
            self.wire.status,
            sight.rpm(),
            machine.angle,
            q,
            d,
            machine.brake_torque,
            machine.load_torque,
            machine.bus_voltage,
            if sight.bridge { ", bridge on" } else { "" },
            if sight.coil { ", coil on" } else { "" },
            if self.deceived { ", a sensor lies" } else { "" },
            or_dash(self.position_command()),
            or_dash(self.position_feedback()),
            distance.map_or_else(String::new, |distance| format!(", S-0-0189 {}", distance.cast_signed())),
            self.command.map_or_else(String::new, |idn| format!(", {idn} set")),
        )
    }

    /// What the count has slipped is so much of an electrical revolution that a drive that has not noticed it turns the motor with the wrong current.
    #[must_use]
    pub fn is_out_of_step(&self) -> bool {
        let slipped = f64::from(self.sight.machine.slipped.wrapping_sub(self.in_step_at));
        let increments = f64::from(self.machine.encoder.increments_per_revolution);
        let turns = slipped / increments * f64::from(self.machine.windings.pole_pairs);
        (turns - turns.round()).abs() > OUT_OF_STEP
    }

    /// In CP4, with the ring intact.
    #[must_use]
    pub fn is_operating(&self) -> bool {
        self.wire.is_operating(self.now, self.cycle)
    }

    /// A procedure command is set by which the drive moves the axis itself.
    #[must_use]
    pub fn drive_moves_the_axis(&self) -> bool {
        [self.command, self.starting].iter().flatten().any(|idn| MOVERS.contains(&idn.0))
    }

    /// So long ago, or `None` if never.
    #[must_use]
    pub fn since(&self, then: Option<Nanoseconds>) -> Option<Nanoseconds> {
        then.map(|then| self.now.saturating_sub(then))
    }

    /// It happened within `span`.
    #[must_use]
    pub fn within(&self, then: Option<Nanoseconds>, span: Nanoseconds) -> bool {
        self.since(then).is_some_and(|since| since <= span)
    }

    /// Where the shaft was at an instant of the last cycles, in revolutions.
    #[must_use]
    pub fn angle_at(&self, at: Nanoseconds) -> Option<f64> {
        let after = self.path.partition_point(|(time, _)| *time < at);
        let (t1, a1) = *self.path.get(after)?;
        let (t0, a0) = if after > 0 { self.path[after - 1] } else { return (t1 == at).then_some(a1) };
        let share = at.saturating_sub(t0).as_seconds() / t1.saturating_sub(t0).as_seconds();
        Some(a0 + (a1 - a0) * share)
    }

    /// The sign of a movement in S-0-0051 when the shaft counts up: S-0-0277 and S-0-0055 may turn it.
    #[must_use]
    pub fn sense(&self) -> Option<f64> {
        let counts = self.settings.word(Idn(277))? & 8 != 0;
        let shows = self.settings.word(Idn(55))? & 4 != 0;
        Some(if counts == shows { 1.0 } else { -1.0 })
    }

    /// Whether a movement or a torque of the shaft is positive for a limit of one sign, which bit 0 of S-0-0043 or S-0-0085 turns round;
    /// `None` while that is not known.
    #[must_use]
    pub fn is_positive(&self, value: f64, polarity: Idn) -> Option<bool> {
        let turned = self.settings.word(polarity)? & 1 != 0;
        // With bit 3 of S-0-0277 the drive's own positive direction is another one than the machine's.
        (self.settings.word(Idn(277))? & 8 == 0).then_some((value > 0.0) != turned)
    }

    /// The operation mode that the control word asks for.
    #[must_use]
    pub fn asked_mode(&self) -> Option<u16> {
        let control = self.wire.control;
        self.settings.mode((control & 0x0800) >> 9 | (control & 0x0300) >> 8)
    }

    /// The operation mode in the status word.
    #[must_use]
    pub fn actual_mode(&self) -> Option<u16> {
        self.settings.mode(self.wire.actual_mode())
    }

    /// S-0-0047 is what is to be followed.
    #[must_use]
    pub fn asks_for_position(&self) -> bool {
        self.asked_mode().is_some_and(|mode| POSITION_MODES.contains(&mode))
    }

    /// S-0-0047 of the last MDT, if it is there and stands alone.
    #[must_use]
    pub fn position_command(&self) -> Option<f64> {
        let additive =
            self.wire.command(Idn(48)).unwrap_or_else(|| self.settings.unsigned(Idn(48)).unwrap_or(0) as u32);
        let turned = self.settings.word(Idn(55))? & 7;
        // Commands and feedback in one coordinate, and nothing added: else there is nothing to compare.
        let plain = additive == 0 && matches!(turned & 5, 0 | 5);
        self.wire.command(Idn::POSITION_COMMAND).filter(|_| plain).map(|value| f64::from(value.cast_signed()))
    }

    /// S-0-0051 of the last AT.
    #[must_use]
    pub fn position_feedback(&self) -> Option<f64> {
        self.wire.feedback(Idn::POSITION_FEEDBACK).map(|value| f64::from(value.cast_signed()))
    }

    /// Position increments of a step of the encoder.
    #[must_use]
    pub fn quantum(&self, units: &Units) -> f64 {
        units.increments / f64::from(self.machine.encoder.increments_per_revolution)
    }

    /// The shaft is where the motor alone has moved it: no load that changes, no sensor that lies, nothing seized.
    #[must_use]
    pub fn is_left_alone(&self, for_so_long: Nanoseconds) -> bool {
        let machine = &self.sight.machine;
        !self.within(self.disturbed, for_so_long) && !machine.seized && !machine.brake_broken && !self.deceived
    }

    /// S-0-0206 or S-0-0207 is shorter than the brake takes: the drive is told to move against a brake that is not open yet, or to hand a load
    /// over to one that does not hold yet.
    #[must_use]
    pub fn hurries_its_brake(&self) -> bool {
        let told = |idn| self.settings.unsigned(Idn(idn)).map_or(0.0, |milliseconds| milliseconds as f64 * 1e-3);
        let hurries = |idn, delay| told(idn) < FIRM * delay;
        self.machine.brake.is_some_and(|brake| hurries(206, brake.release_delay) || hurries(207, brake.engage_delay))
    }

    /// The shaft is faster than 1.2 times S-0-0113, or so fast that the largest weakening current P-0-0107 does not bring the voltage of the magnets
    /// below that of the DC link: it drives currents of its own.
    #[must_use]
    pub fn outruns_its_motor(&self) -> bool {
        let number = |idn: u16| self.settings.unsigned(Idn(idn)).map(|value| value as f64);
        let beyond = number(113).is_some_and(|most| self.sight.rpm().abs() > 1.2e-4 * most);
        let most = number(109).zip(number(110)).map(|(motor, amplifier)| motor.min(amplifier) * AMPLITUDE);
        // What is not known is no excuse.
        let weakening = most.zip(number(0x8000 | 107)).map_or(f64::INFINITY, |(most, share)| most * share * 1e-3);
        let windings = &self.machine.windings;
        let speed = self.sight.machine.velocity.abs() * f64::from(windings.pole_pairs);
        let voltage = speed * (windings.flux - windings.inductance_d * weakening);
        beyond || voltage > REACH * self.sight.machine.bus_voltage / f64::sqrt(3.0)
    }

    /// The load is stronger than what the limits leave to the motor that holds it: the load, not the drive, moves the shaft.
    #[must_use]
    pub fn load_is_stronger(&self) -> bool {
        let load = self.sight.machine.load_torque;
        let limit = self.is_positive(-load, Idn(85)).and_then(|positive| self.current_limit(positive));
        limit.is_some_and(|limit| load.abs() > limit * self.torque_constant())
    }

    /// What the limits leave of a deceleration in rad/s² where the motor has to turn the shaft that way; `None` while one is not known.
    #[must_use]
    pub fn deceleration_left(&self, positive: bool) -> Option<f64> {
        Some(self.current_limit(positive)? * self.torque_constant() / self.inertia())
    }

    /// Torque in Nm for 1 A across the magnet.
    #[must_use]
    pub fn torque_constant(&self) -> f64 {
        1.5 * f64::from(self.machine.windings.pole_pairs) * self.machine.windings.flux
    }

    /// Inertia of rotor and load in kg m².
    #[must_use]
    pub fn inertia(&self) -> f64 {
        self.machine.mechanics.rotor_inertia + self.machine.mechanics.load.map_or(0.0, |load| load.inertia)
    }

    /// The amplitude of the current in A that S-0-0082, 83, 92, 109 and 110 leave to a torque of this sign; `None` while one is not known.
    #[must_use]
    pub fn current_limit(&self, positive: bool) -> Option<f64> {
        let number = |idn: u16| self.settings.unsigned(Idn(idn)).map(|value| value as f64);
        let side = if positive { self.settings.signed(Idn(82))? } else { -self.settings.signed(Idn(83))? } as f64;
        let torque = side.min(number(92)?) * self.units?.torque;
        Some(torque.min(number(109)? * AMPLITUDE).min(number(110)? * AMPLITUDE))
    }

    /// Heat sink or motor are as hot as S-0-0203 or S-0-0204 allow, or the DC link is near P-0-0104 or P-0-0105, whatever these are set to:
    /// what a control has made an error is not gone.
    #[must_use]
    pub fn is_beyond_thresholds(&self) -> bool {
        let number = |idn: u16| self.settings.unsigned(Idn(idn)).map(|value| value as f64);
        let ([heat_sink, winding], bus) = (self.sight.machine.temperatures, self.sight.machine.bus_voltage);
        let hot = |temperature: f64, idn| number(idn).is_some_and(|most| temperature > 0.1 * most - SENSOR);
        let low = number(0x8000 | 104).is_none_or(|least| bus < 1.15 * least);
        let high = number(0x8000 | 105).is_none_or(|most| bus > 0.95 * most);
        hot(heat_sink, 203) || hot(winding, 204) || low || high
    }

    /// The DC link is above 93 % of P-0-0105, or will be within a millisecond of braking with all the torque: less may flow back into it.
    #[must_use]
    pub fn link_is_full(&self) -> bool {
        let full = self.settings.unsigned(Idn(0x8000 | 105)).map(|value| value as f64);
        let bus = self.sight.machine.bus_voltage;
        // More than the mains make: something feeds it.
        bus > 1.02 * self.machine.supply.voltage && full.is_none_or(|full| bus > LINK_FULL * full)
    }

    /// The motor gives what its limits or its supply leave it, or nearly so.
    #[must_use]
    pub fn is_at_its_limit(&self) -> bool {
        let [d, q] = self.sight.machine.current;
        let starved = self.sight.machine.bus_voltage < 0.9 * self.machine.supply.voltage;
        let limit = self.is_positive(q, Idn(85)).and_then(|positive| self.current_limit(positive));
        starved || self.link_is_full() || limit.is_none_or(|limit| d.hypot(q) > 0.9 * limit)
    }

    /// So many cycles, and so many microseconds beyond them.
    #[must_use]
    pub const fn cycles(&self, cycles: u64, microseconds: u64) -> Nanoseconds {
        Nanoseconds(self.cycle.0 * cycles + microseconds * 1_000)
    }
}
