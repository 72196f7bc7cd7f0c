//! The task of highest priority: one cycle of the current loop, with everything that must not wait for another task.

use servo::Rotation;
use servo::current::{
    BusScale, CurrentCommand, CurrentLoop, CurrentLoopSettings, Offsets, Protection, PwmFrequency, Trip,
};

use crate::hardware::{PowerStage, Samples};
use crate::link::{COMMAND_WORDS, CurrentLink, SETTINGS_WORDS, set};
use crate::work::Work;

/// What the tasks of the loop tick ask of the current loop.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CurrentOrder {
    /// Current flows as commanded; otherwise the bridge is off and the current sensors find their zero.
    pub on: bool,
    /// Counts by which the next loop tick is to be longer.
    pub trim: i16,
    /// Reference, angle, feed-forward, bus.
    pub command: CurrentCommand,
}

/// Everything the current loop needs of the parameters.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct CurrentSettings {
    /// Gains.
    pub current_loop: CurrentLoopSettings,
    /// Trip levels.
    pub protection: Protection,
    /// Cycles a second.
    pub frequency: PwmFrequency,
}

/// The current loop of a drive: inverter, sensors and the state between two cycles.
#[derive(Debug)]
pub struct CurrentControl<P: 'static> {
    stage: P,
    link: &'static CurrentLink,
    current_loop: CurrentLoop,
    offsets: Offsets,
    settings: CurrentSettings,
    settings_read: u32,
    count: u32,
    trip: Option<Trip>,
    was_on: bool,
    was_late: bool,
    late: u32,
    /// Phase currents of this cycle, counts 2^-3; nothing while the bridge is off.
    phases: [i32; 3],
    /// Electrical angle of this cycle, 2^-32 revolution.
    angle: u32,
}

impl<P: PowerStage> CurrentControl<P> {
    /// A current loop at rest. `settings` are those of the drive's start; later ones come through `link`.
    pub fn new(mut stage: P, link: &'static CurrentLink, settings: CurrentSettings) -> Self {
        stage.switch_off();
        let count = stage.encoder_count();
        set(&link.report.count, count);
        Self {
            stage,
            link,
            current_loop: CurrentLoop::new(),
            offsets: Offsets::default(),
            settings,
            settings_read: link.settings.sent(),
            count,
            trip: None,
            was_on: false,
            was_late: false,
            late: 0,
            phases: [0; 3],
            angle: 0,
        }
    }

    /// Task of the end of conversion, every 62.5 us (125 us at 8 kHz): samples in, compare values out.
    ///
    /// Contract: from the end of the conversion to the compare registers in at most 600 instructions, and before the bottom of the period,
    /// 28 us after the samples; a cycle that is later switches the bridge off. Starts the control loop in the first cycle of a tick.
    #[inline]
    pub fn current_loop(&mut self) -> Work {
        let cycle = self.stage.begin();
        let samples = self.stage.samples();
        let count = self.stage.encoder_count();
        let moved = count.wrapping_sub(self.count).cast_signed();
        self.count = count;
        self.take_settings();
        let order = CurrentOrder::from_words(self.link.command.read());
        self.stage.trim(order.trim);
        self.angle = order.command.angle_at(count);
        if order.on {
            self.regulate(&order.command, &samples, moved, cycle.late);
        } else {
            self.rest(&samples);
        }
        self.was_late = cycle.late;
        self.late = self.late.wrapping_add(cycle.late.into());
        self.report(&samples, cycle.first);
        if cycle.first { Work::CONTROL_LOOP } else { Work::empty() }
    }

    #[inline]
    fn regulate(&mut self, command: &CurrentCommand, samples: &Samples, moved: i32, late: bool) {
        if !self.was_on {
            self.was_on = true;
            self.offsets.interrupt();
        }
        let currents = self.offsets.remove(samples.currents);
        self.phases = currents;
        if self.trip.is_some() {
            return;
        }
        self.trip = self.settings.protection.check(currents, samples.bus, moved);
        // A single late cycle repeats the voltage of the one before, two in a row would be no control any more.
        if self.trip.is_none() && late && self.was_late {
            self.trip = Some(Trip::Late);
        }
        if self.trip.is_some() {
            self.stage.switch_off();
            return;
        }
        let counts = self.current_loop.cycle(&self.settings.current_loop, command, currents, self.angle);
        self.stage.set_compare(counts);
    }

    fn rest(&mut self, samples: &Samples) {
        if self.was_on {
            self.was_on = false;
            self.trip = None;
            self.current_loop.reset();
            self.phases = [0; 3];
            self.stage.set_compare([self.settings.frequency.reload() / 2; 3]);
        }
        self.offsets.calibrate(samples.currents);
    }

    #[inline]
    fn take_settings(&mut self) {
        let sent = self.link.settings.sent();
        if sent != self.settings_read {
            self.settings_read = sent;
            self.settings = CurrentSettings::from_words(self.link.settings.read());
        }
    }

    #[inline]
    fn report(&mut self, samples: &Samples, first: bool) {
        let report = &self.link.report;
        let readings = self.current_loop.readings();
        let [first_cycle, second_cycle] = &report.cycles;
        let cycle = if first { first_cycle } else { second_cycle };
        set(&cycle.direct, readings.direct.cast_unsigned());
        set(&cycle.quadrature, readings.quadrature.cast_unsigned());
        set(&cycle.direct_voltage, readings.direct_voltage.cast_unsigned());
        set(&cycle.quadrature_voltage, readings.quadrature_voltage.cast_unsigned());
        // Twelve bits and three of fraction.
        let [phase_u, phase_v, phase_w] = self.phases.map(|current| u32::from((current as i16).cast_unsigned()));
        set(&cycle.phases, phase_u | phase_v << 16);
        set(&cycle.phase_and_angle, phase_w | self.angle & 0xFFFF_0000);
        set(&cycle.bus, samples.bus.into());
        set(&report.temperatures, u32::from(samples.heat_sink) | u32::from(samples.motor) << 16);
        set(&report.trip, self.trip.map_or(0, Trip::code));
        set(&report.calibrated, self.offsets.is_calibrated().into());
        set(&report.late, self.late);
        if first {
            set(&report.count, self.count);
        }
    }
}

impl CurrentOrder {
    /// For the mailbox.
    pub(crate) fn to_words(self) -> [u32; COMMAND_WORDS] {
        let command = self.command;
        let [longest, longest_direct, inverse, counts, side] = command.bus.to_words();
        [
            self.on.into(),
            i32::from(self.trim).cast_unsigned(),
            command.direct.cast_unsigned(),
            command.quadrature.cast_unsigned(),
            command.angle,
            command.count,
            command.angle_per_increment,
            command.ahead.cosine.cast_unsigned(),
            command.ahead.sine.cast_unsigned(),
            command.direct_voltage.cast_unsigned(),
            command.quadrature_voltage.cast_unsigned(),
            longest,
            longest_direct,
            inverse,
            counts,
            side,
        ]
    }

    #[inline]
    fn from_words(words: [u32; COMMAND_WORDS]) -> Self {
        let [on, trim, direct, quadrature, angle, count, angle_per_increment, cosine, sine, vd, vq, a, b, c, d, e] =
            words;
        Self {
            on: on != 0,
            trim: trim.cast_signed() as i16,
            command: CurrentCommand {
                direct: direct.cast_signed(),
                quadrature: quadrature.cast_signed(),
                angle,
                count,
                angle_per_increment,
                ahead: Rotation { cosine: cosine.cast_signed(), sine: sine.cast_signed() },
                direct_voltage: vd.cast_signed(),
                quadrature_voltage: vq.cast_signed(),
                bus: BusScale::from_words([a, b, c, d, e]),
            },
        }
    }
}

impl CurrentSettings {
    /// For the mailbox.
    pub(crate) fn to_words(self) -> [u32; SETTINGS_WORDS] {
        let [alpha, beta, proportional, integral, middle, slope, full] = self.current_loop.to_words();
        let [current, sum, bus, increments] = self.protection.to_words();
        [
            alpha,
            beta,
            proportional,
            integral,
            middle,
            slope,
            full,
            current,
            sum,
            bus,
            increments,
            (self.frequency == PwmFrequency::Khz8).into(),
        ]
    }

    fn from_words(words: [u32; SETTINGS_WORDS]) -> Self {
        let [alpha, beta, proportional, integral, middle, slope, full, current, sum, bus, increments, slow] = words;
        Self {
            current_loop: CurrentLoopSettings::from_words([alpha, beta, proportional, integral, middle, slope, full]),
            protection: Protection::from_words([current, sum, bus, increments]),
            frequency: if slow == 0 { PwmFrequency::Khz16 } else { PwmFrequency::Khz8 },
        }
    }
}
