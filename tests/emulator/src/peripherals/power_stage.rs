//! Modulator and converters together, with their pins: TRGO starts the converters, the outputs drive the bridge, a fault breaks.

use std::cell::Cell;

use ring::Nanoseconds;

use super::adc::Converters;
use super::advanced_timer::registers::{BDTR, CNT, CR1};
use super::advanced_timer::{AdvancedTimer, Bridge, TimerEvent};
use super::clocks::ClockTree;
use super::gpio::{PinMode, Port};
use crate::Environment;
use crate::wiring;

/// TIM1, ADC1 to ADC3, the coil of the holding brake and the switch of the chopper.
#[derive(Debug)]
pub(crate) struct PowerStage {
    pub(crate) timer: AdvancedTimer,
    pub(crate) converters: Converters,
    /// What the timer does; the pins may still be elsewhere.
    bridge: Option<Bridge>,
    told: Option<Bridge>,
    brake: bool,
    chopper: bool,
    /// The timer's next trigger, once worked out: it stays what it is until it has come or the timer is written or clocked otherwise.
    trigger: Cell<Option<Option<Nanoseconds>>>,
}

impl PowerStage {
    pub(crate) fn new() -> Self {
        Self {
            timer: AdvancedTimer::new(),
            converters: Converters::new(),
            bridge: None,
            told: None,
            brake: false,
            chopper: false,
            trigger: Cell::new(None),
        }
    }

    pub(crate) fn set_clocks(&mut self, tree: &ClockTree, now: Nanoseconds) {
        self.trigger.set(None);
        self.timer.set_clock(tree.apb2_timers, now);
        self.converters.set_clock(tree.apb2);
    }

    /// The next instant at which something can be seen or must be sampled.
    pub(crate) fn next_event(&self) -> Option<Nanoseconds> {
        let converters = self.converters.next_event(self.next_trigger());
        [self.timer.next_event(), converters].into_iter().flatten().min()
    }

    /// The next instant at which one of the lines may rise by itself.
    pub(crate) fn next_interrupt(&self) -> Option<Nanoseconds> {
        let timer = self.timer.next_event().filter(|_| self.timer.interrupts());
        let converters = self.converters.next_end(self.next_trigger());
        [timer, converters].into_iter().flatten().min()
    }

    /// Lines of the NVIC (bit n = interrupt n).
    pub(crate) fn lines(&self) -> u128 {
        let [broken, update, compare] = self.timer.lines();
        [(broken, 24), (update, 25), (compare, 27), (self.converters.line(), 18)]
            .into_iter()
            .fold(0, |lines, (high, vector)| lines | u128::from(high) << vector)
    }

    fn next_trigger(&self) -> Option<Nanoseconds> {
        if let Some(trigger) = self.trigger.get() {
            return trigger;
        }
        let trigger = self.timer.next_trigger();
        self.trigger.set(Some(trigger));
        trigger
    }

    /// Does what is due until `now`. `Err` tells what goes wrong on the part.
    pub(crate) fn advance<E: Environment + ?Sized>(
        &mut self,
        ports: &[Port],
        environment: &mut E,
        now: Nanoseconds,
    ) -> Result<(), String> {
        if self.trigger.get().flatten().is_some_and(|trigger| trigger <= now) {
            self.trigger.set(None);
        }
        let mut events = Vec::new();
        self.timer.advance(now, &mut events);
        self.carry_out(&events, ports, environment)?;
        self.convert(ports, environment, now)
    }

    /// Takes the level of the break input over.
    pub(crate) fn sample<E: Environment + ?Sized>(
        &mut self,
        ports: &[Port],
        environment: &mut E,
        now: Nanoseconds,
    ) -> Result<(), String> {
        let (port, pin) = wiring::BREAK;
        // The input of the timer is low while no pin is switched to it.
        let level = ports[port].mode(pin) == PinMode::Alternate(1) && environment.break_input();
        let mut events = Vec::new();
        self.timer.set_break_level(level, now, &mut events);
        self.carry_out(&events, ports, environment)
    }

    pub(crate) fn write_timer<E: Environment + ?Sized>(
        &mut self,
        (offset, value): (u32, u32),
        ports: &[Port],
        environment: &mut E,
        now: Nanoseconds,
    ) -> Option<Result<(), String>> {
        self.trigger.set(None);
        let mut events = Vec::new();
        let done = self.timer.write(offset, value, now, &mut events)?;
        Some(done.and_then(|()| self.carry_out(&events, ports, environment)))
    }

    /// The clock security system breaks the timer.
    pub(crate) fn break_by_clock<E: Environment + ?Sized>(
        &mut self,
        ports: &[Port],
        environment: &mut E,
        now: Nanoseconds,
    ) -> Result<(), String> {
        let mut events = Vec::new();
        self.timer.break_by_clock(now, &mut events);
        self.carry_out(&events, ports, environment)
    }

    /// No pin drives gate drivers or coil any more.
    pub(crate) fn release<E: Environment + ?Sized>(&mut self, environment: &mut E, now: Nanoseconds) {
        if let Some(told) = self.told.take().filter(|told| told.on) {
            environment.set_bridge(now, false, told.dead_time_ns);
        }
        if std::mem::take(&mut self.brake) {
            environment.set_brake(now, false);
        }
        if std::mem::take(&mut self.chopper) {
            environment.set_chopper(now, false);
        }
    }

    /// Tells the world about pins that changed by a write to a port.
    pub(crate) fn tell<E: Environment + ?Sized>(&mut self, ports: &[Port], environment: &mut E, now: Nanoseconds) {
        self.tell_bridge(ports, environment, now);
        let drives = |(port, pin): wiring::Pin| ports[port].mode(pin) == PinMode::Output && ports[port].output(pin);
        let energised = drives(wiring::BRAKE_COIL);
        if std::mem::replace(&mut self.brake, energised) != energised {
            environment.set_brake(now, energised);
        }
        let on = drives(wiring::CHOPPER);
        if std::mem::replace(&mut self.chopper, on) != on {
            environment.set_chopper(now, on);
        }
    }

    /// CR1 with the direction, if it is sure until then, and BDTR, which only the world's break input changes by itself.
    pub(crate) fn peek_timer(&self, offset: u32, now: Nanoseconds, until: Nanoseconds) -> Option<u32> {
        let sure = offset == BDTR || offset == CR1 && self.timer.next_turn().is_none_or(|turn| turn >= until);
        self.timer.read(offset, now).filter(|_| sure)
    }

    /// The count at an instant of the half that runs.
    pub(crate) fn foretell_count(&self, at: Nanoseconds) -> Option<u32> {
        let in_half = self.timer.next_turn().is_some_and(|turn| at < turn);
        self.timer.read(CNT, at).filter(|_| in_half)
    }

    /// Status or data of a converter, if nothing can change them until then.
    pub(crate) fn peek_converters(&self, offset: u32, until: Nanoseconds) -> Option<u32> {
        let quiet = self.next_trigger().is_none_or(|trigger| trigger >= until);
        self.converters.peek(offset).filter(|_| quiet)
    }

    fn carry_out<E: Environment + ?Sized>(
        &mut self,
        events: &[TimerEvent],
        ports: &[Port],
        environment: &mut E,
    ) -> Result<(), String> {
        for event in events {
            match *event {
                TimerEvent::Trigger(at) => {
                    self.convert(ports, environment, at)?;
                    self.converters.trigger(at)?;
                }
                TimerEvent::Bridge(at, bridge) => {
                    self.convert(ports, environment, at)?;
                    self.bridge = Some(bridge);
                    self.tell_bridge(ports, environment, at);
                }
            }
        }
        Ok(())
    }

    fn convert<E: Environment + ?Sized>(
        &mut self,
        ports: &[Port],
        environment: &mut E,
        until: Nanoseconds,
    ) -> Result<(), String> {
        self.converters.advance(until, &mut |at, adc, channel| {
            let Some((port, pin)) = wiring::analogue_pin(adc, channel) else {
                return Err(format!("ADC{adc} channel {channel} has no pin"));
            };
            if ports[port].mode(pin) != PinMode::Analogue {
                return Err(format!("ADC{adc} converts {}, which is not analogue", wiring::pin_name((port, pin))));
            }
            Ok(environment.analog_sample(at, adc, channel))
        })
    }

    /// Outputs that no pin is switched to reach no gate driver: its inputs are pulled low.
    fn tell_bridge<E: Environment + ?Sized>(&mut self, ports: &[Port], environment: &mut E, at: Nanoseconds) {
        let connected = wiring::HIGH_SIDES
            .iter()
            .chain(&wiring::LOW_SIDES)
            .all(|(port, pin)| ports[*port].mode(*pin) == PinMode::Alternate(1));
        let Some(bridge) = self.bridge.map(|bridge| Bridge { on: bridge.on && connected, ..bridge }) else {
            return;
        };
        let before = self.told.replace(bridge);
        if before.map(|told| told.duties) != Some(bridge.duties) {
            environment.set_duties(at, bridge.duties);
        }
        if before.map(|told| (told.on, told.dead_time_ns)) != Some((bridge.on, bridge.dead_time_ns)) {
            environment.set_bridge(at, bridge.on, bridge.dead_time_ns);
        }
    }
}
