//! The task of highest priority: one cycle of the current loop, with everything that must not wait for another task.

use super::facts::{BoardKind, Facts};
use super::link::{CurrentLink, CycleReport, get, set};
use super::settings::CurrentSettings;
use super::stage::{PowerStage, Samples};
use crate::current::control::CurrentLoop;
use crate::current::protection::{Offsets, Protection, Trip};
use crate::current::sensing::{Hidden, ShuntWindow};
use crate::current::shared::SharedCommand;
use crate::monitor::chopper::ChopperLevels;

/// The current loop of a drive: inverter, sensors and the state between two cycles.
#[derive(Debug)]
pub struct CurrentControl<P: 'static> {
    stage: P,
    link: &'static CurrentLink,
    current_loop: CurrentLoop,
    offsets: Offsets,
    protection: Protection,
    settings_read: u32,
    orders_seen: u32,
    count: u32,
    control: Control,
    was_late: bool,
    /// The phase whose sample the next cycle does not believe.
    hidden: Hidden,
    /// The resistor of the chopper is on.
    chopping: bool,
}

/// What the current loop does with the bridge.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Control {
    /// Nothing: it is off.
    Resting,
    /// Current as commanded.
    Regulating,
    /// It has switched the bridge off by itself, until the order to do so comes as well.
    Tripped,
}

impl<P: PowerStage> CurrentControl<P> {
    const FACTS: Facts = <P::Board as BoardKind>::FACTS;
    const SHUNTS: Option<ShuntWindow> = Self::FACTS.shunt_window();

    /// A current loop at rest. `settings` are those of the drive's start; later ones come through `link`.
    pub fn new(mut stage: P, link: &'static CurrentLink, settings: CurrentSettings) -> Self {
        stage.switch_off();
        stage.set_chopper(false);
        let count = stage.encoder_count();
        for first in [true, false] {
            set(&link.report.cycle(first).count, count);
            set(&link.report.cycle(first).count_before, count);
        }
        Self {
            stage,
            link,
            current_loop: CurrentLoop::new(settings.current_loop),
            offsets: Offsets::default(),
            protection: settings.protection,
            settings_read: link.settings.sent(),
            orders_seen: link.order.sent(),
            count,
            control: Control::Resting,
            was_late: false,
            hidden: Hidden::No,
            chopping: false,
        }
    }

    /// Task of the end of conversion, every 62.5 us (125 us at 8 kHz): samples in, compare values out.
    ///
    /// Contract: from the end of the conversion to the compare registers in at most 600 instructions, and before the bottom of the period,
    /// 28 us after the samples; a cycle that is later switches the bridge off. Returns whether a loop tick begins: the control loop is to be
    /// started.
    #[inline]
    #[must_use = "without a control loop the current stays what it was"]
    pub fn current_loop(&mut self) -> bool {
        let cycle = self.stage.begin();
        let count = self.stage.encoder_count();
        let before = core::mem::replace(&mut self.count, count);
        let moved = count.wrapping_sub(before).cast_signed();
        if cycle.late {
            self.take_delay();
        } else {
            self.was_late = false;
        }
        let link = self.link;
        let order = link.order.last();
        let report = link.report.cycle(cycle.first);
        self.stage.trim(get(&order.trim).cast_signed());
        set(&report.count, count);
        set(&report.count_before, before);
        report.readings.set_angle(order.command.angle_at(count));
        let samples = self.stage.samples();
        set(&report.bus, samples.bus);
        self.chop(samples.bus);
        if get(&order.on) == 0 {
            self.rest(&samples);
        } else {
            self.regulate(&order.command, report, &samples, moved);
        }
        if !cycle.first || Self::FACTS.frequency.cycles_per_tick() < 2 {
            self.take_settings();
            self.tell_life();
            let [heat_sink, motor] = self.stage.temperatures();
            set(&link.report.temperatures, heat_sink | motor << 16);
        }
        cycle.first
    }

    /// With the bridge off as well: what charges the link need not be this motor's doing.
    #[inline]
    fn chop(&mut self, bus: u32) {
        let levels = ChopperLevels::from_word(get(&self.link.chopper));
        if self.chopping || levels.switches_on(bus) {
            self.keep_chopping(levels.stays_on(bus));
        }
    }

    #[cold]
    #[inline(never)]
    fn keep_chopping(&mut self, on: bool) {
        if on != self.chopping {
            self.chopping = on;
            self.stage.set_chopper(on);
        }
        if on {
            let chopped = &self.link.report.chopped;
            set(chopped, get(chopped).wrapping_add(1));
        }
    }

    #[inline]
    fn regulate(&mut self, command: &SharedCommand, report: &CycleReport, samples: &Samples, moved: i32) {
        let measured = self.offsets.remove(samples.currents);
        let currents = if Self::SHUNTS.is_some() { self.hidden.restore(measured) } else { measured };
        report.readings.set_phases(currents);
        if self.control != Control::Regulating && !self.begin() {
            return;
        }
        if let Some(trip) = self.protection.check(currents, samples.bus, moved) {
            self.trip(trip);
            return;
        }
        let counts = match Self::SHUNTS {
            None => self.current_loop.cycle(command, &report.readings),
            Some(window) => {
                let (counts, hidden) = self.current_loop.cycle_on_shunts(command, &report.readings, window);
                // They act from the bottom on, and the next sample is in the middle of what they make. Those of a late cycle will be overwritten
                // before they act: the next sample still belongs to the ones before.
                if !self.was_late {
                    self.hidden = hidden;
                }
                counts
            }
        };
        self.stage.set_compare(counts);
    }

    /// Begins to regulate, unless the bridge has been switched off for good.
    #[cold]
    fn begin(&mut self) -> bool {
        if self.control == Control::Tripped {
            return false;
        }
        self.control = Control::Regulating;
        self.offsets.interrupt();
        true
    }

    #[cold]
    fn trip(&mut self, trip: Trip) {
        self.control = Control::Tripped;
        self.stage.switch_off();
        let report = &self.link.report;
        report.tell(&report.trip, trip.code());
    }

    fn rest(&mut self, samples: &Samples) {
        let report = &self.link.report;
        if self.control != Control::Resting {
            self.control = Control::Resting;
            report.tell(&report.trip, 0);
            self.current_loop.reset();
            for first in [true, false] {
                report.cycle(first).readings.without_current();
            }
            self.stage.set_compare([Self::FACTS.frequency.reload() / 2; 3]);
            self.hidden = Hidden::No;
        }
        if Self::SHUNTS.is_some() {
            self.offsets.calibrate_on_shunts(samples.currents);
        } else {
            self.offsets.calibrate(samples.currents);
        }
        let calibrated = self.offsets.is_calibrated().into();
        if calibrated != get(&report.calibrated) {
            report.tell(&report.calibrated, calibrated);
        }
    }

    /// A single late cycle repeats the voltage of the one before, two in a row would be no control any more.
    #[cold]
    fn take_delay(&mut self) {
        if self.was_late && self.control == Control::Regulating {
            self.trip(Trip::Late);
        }
        self.was_late = true;
        let report = &self.link.report;
        report.tell(&report.late, get(&report.late).wrapping_add(1));
    }

    /// No order without a control loop, and no call of this without a current loop.
    #[inline]
    fn tell_life(&mut self) {
        let orders = self.link.order.sent();
        if orders != self.orders_seen {
            self.orders_seen = orders;
            self.stage.is_alive();
        }
    }

    #[inline]
    fn take_settings(&mut self) {
        let sent = self.link.settings.sent();
        if sent != self.settings_read {
            self.settings_read = sent;
            let settings = self.link.settings.last().get();
            self.current_loop.set(settings.current_loop);
            self.protection = settings.protection;
        }
    }
}

#[cfg(test)]
mod shunt_tests;
#[cfg(test)]
mod tests;
