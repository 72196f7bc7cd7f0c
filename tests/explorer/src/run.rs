//! A life, lived.

use std::panic::{AssertUnwindSafe, catch_unwind};

use fault_matrix::{Fault, Target};
use ring::Nanoseconds;
use ring::fibre::{Effect, TelegramKind};
use ring::service_client::status;

use crate::causes::{Causes, LAW};
use crate::coverage::Coverage;
use crate::life::{Action, Life};
use crate::peace;
use crate::rig::{Rig, Stop};
use crate::services::Services;

/// How a life ended.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Ending {
    /// With peace.
    Lived,
    /// Before it began: the drive refuses the axis, with this reason.
    Refused(String),
    /// With a broken law.
    Broken {
        /// Its sentence.
        law: String,
        /// What was seen, and when.
        detail: String,
    },
}

/// What came of a life.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Outcome {
    /// How it ended.
    pub ending: Ending,
    /// All that the drive sent and the shaft did, in one number: the same life gives the same.
    pub hash: u64,
    /// What it has seen.
    pub coverage: Coverage,
}

pub(crate) struct Run {
    pub(crate) rig: Rig,
    pub(crate) coverage: Coverage,
    pub(crate) services: Services,
    pub(crate) causes: Causes,
    /// A diagnosis that nothing in this life explains.
    unexplained: Option<u16>,
    /// A fault that goes on by itself, and since when.
    going_on: Option<(Fault, u64)>,
    /// The axis was in CP4 with its own settings.
    pub(crate) proven: bool,
    /// P-0-0118 was written by the life: not with the angle of the motor.
    pub(crate) told_an_angle: bool,
    /// When CP4 began, moved on by what run-ups take.
    base: Nanoseconds,
    hash: u64,
}

/// Lives a life.
#[must_use]
pub fn live(life: &Life) -> Outcome {
    let result = catch_unwind(AssertUnwindSafe(|| live_on(life)));
    result.unwrap_or_else(|panic| {
        let text = panic.downcast_ref::<String>().cloned();
        let text = text.or_else(|| panic.downcast_ref::<&str>().map(|&text| text.to_owned()));
        Outcome {
            ending: Ending::Broken {
                law: "nothing panics".to_owned(),
                detail: text.unwrap_or_else(|| "a panic without words".to_owned()),
            },
            hash: 0,
            coverage: Coverage::default(),
        }
    })
}

fn live_on(life: &Life) -> Outcome {
    let mut coverage = Coverage::default();
    let (ending, hash) = match Rig::new(&life.axis) {
        Err(stop) => (ending_of(stop), 0),
        Ok(rig) => {
            let mut run = Run {
                rig,
                coverage: Coverage::default(),
                services: Services::default(),
                causes: Causes::default(),
                unexplained: None,
                going_on: None,
                proven: false,
                told_an_angle: false,
                base: Nanoseconds::ZERO,
                hash: 0,
            };
            let ending = match run.whole(life) {
                Ok(()) => Ending::Lived,
                Err(stop) => ending_of(stop),
            };
            let wire = run.rig.master().wire().clone();
            run.coverage.add_wire(&wire);
            for armed in run.rig.drive.laws.borrow().coverage() {
                run.coverage.add("law looked", armed.law, armed.armed);
            }
            run.coverage.milliseconds = run.rig.world.now().0 / 1_000_000;
            let angle = run.rig.angle().to_bits();
            let hash = (run.rig.master().hash() ^ run.hash ^ angle).wrapping_mul(0x0100_0000_01B3);
            coverage = run.coverage;
            (ending, hash)
        }
    };
    coverage.lives = 1;
    match &ending {
        Ending::Lived => coverage.count("ending", "lived"),
        Ending::Refused(reason) => coverage.count("refused axis", reason.clone()),
        Ending::Broken { law, .. } => coverage.count("broken law", law.clone()),
    }
    Outcome { ending, hash, coverage }
}

fn ending_of(stop: Stop) -> Ending {
    match stop {
        Stop::Broken { law, detail } => Ending::Broken { law, detail },
        Stop::Refused(reason) => Ending::Refused(reason),
    }
}

impl Run {
    fn whole(&mut self, life: &Life) -> Result<(), Stop> {
        let mut refused = match self.run_up(true, &life.axis.also) {
            // What was tried in CP2 may have spoilt it; peace mends it.
            Err(Stop::Refused(reason)) if !life.axis.also.is_empty() => {
                self.coverage.count("run-up refused in a life", reason);
                true
            }
            other => other.map(|()| false)?,
        };
        self.proven = !refused;
        self.base = self.rig.world.now();
        for idn in std::mem::take(&mut self.rig.set) {
            self.coverage.count("set up", ring::ident::Idn(idn).to_string());
        }
        for event in &life.events {
            if refused {
                break;
            }
            self.run_to(event.at)?;
            self.coverage.count("action", name_of(&event.action));
            self.causes.note(&event.action);
            match self.happen(&event.action) {
                Ok(()) => {}
                // A run-up that is refused because of what the life has written ends the life; peace mends it.
                Err(Stop::Refused(reason)) => {
                    self.coverage.count("run-up refused in a life", reason);
                    refused = true;
                }
                Err(broken) => return Err(broken),
            }
        }
        if !refused {
            let end = life.events.last().map_or(0, |event| event.at) + life.rest;
            self.run_to(end)?;
        }
        self.harvest();
        self.judge()?;
        peace::make(self)
    }

    /// Runs to so many us of the life.
    fn run_to(&mut self, at: u32) -> Result<(), Stop> {
        let until = self.base + Nanoseconds::from_microseconds(at.into());
        while let Some((fault, step)) = self.going_on {
            let next = self.rig.world.now() + Nanoseconds::from_millis(1);
            if next > until {
                break;
            }
            fault.go_on(&mut self.rig, step);
            self.going_on = (step < 20 * 16).then_some((fault, step + 16));
            self.rig.run_until(next)?;
        }
        self.rig.run_until(until)?;
        self.hash = self.hash.wrapping_mul(0x0100_0000_01B3) ^ self.rig.angle().to_bits();
        self.harvest();
        if self.rig.master().at().is_some_and(|at| at.status & status::FOLLOWS != 0) {
            let mode = self.rig.chosen_mode();
            self.coverage.count("mode followed", mode.to_string());
        }
        Ok(())
    }

    fn happen(&mut self, action: &Action) -> Result<(), Stop> {
        let rig = &mut self.rig;
        if self.services.ask(rig.master(), action) {
            return Ok(());
        }
        match *action {
            Action::Switches(bits) => rig.master().switch(bits),
            Action::Blip(bits, cycles) => rig.master().blip(bits, cycles),
            Action::Mode(bits) => {
                rig.chosen = bits;
                rig.master().choose_mode(bits);
            }
            Action::Set(idn, value) => rig.master().set(idn, value),
            Action::Jump(idn, by) => rig.master().jump(idn, by),
            Action::Ramp(idn, per_second) => rig.master().ramp(idn, per_second),
            Action::Align(align) => rig.master().align(align),
            Action::LoseMst(cycles) => self.disturb(TelegramKind::Mst, cycles.into(), Effect::Drop)?,
            Action::LoseMdt(cycles) => self.disturb(TelegramKind::Mdt, cycles.into(), Effect::Drop)?,
            Action::DamageMst(bit) => self.disturb(TelegramKind::Mst, 1, Effect::FlipBit(bit.into()))?,
            Action::DamageMdt(bit) => self.disturb(TelegramKind::Mdt, 1, Effect::FlipBit(bit.into()))?,
            Action::WrongPhase(phase) => self.disturb(TelegramKind::Mst, 1, Effect::Phase(phase))?,
            Action::Dark(cycles) => {
                rig.darken(cycles.into())?;
            }
            Action::RunUp { stubborn, ref also } => {
                if !stubborn {
                    rig.master().switch(0);
                    rig.cycles(2)?;
                }
                self.run_up_again(also)?;
            }
            Action::FallBack(phase) => {
                rig.master().phase = phase.min(7);
                rig.cycles(3)?;
                self.run_up_again(&[])?;
            }
            Action::SkipCheck(phase) => {
                let before = rig.world.now();
                rig.skip_check(phase)?;
                let spent = rig.world.now().saturating_sub(before);
                self.base += spent;
                self.run_up_again(&[])?;
            }
            Action::Break(fault) => self.break_something(fault)?,
            Action::Repair => self.repair(),
            Action::Load(percent) => {
                let torque =
                    rig.machine.machine.torque_constant() * f64::from(rig.machine.standstill_current) / 1_000.0;
                let torque = torque * f64::from(percent) / 100.0;
                rig.machine(|machine, now| machine.set_load_torque(torque, now));
            }
            Action::Mains(percent) => {
                let voltage = rig.machine.machine.supply.voltage * f64::from(percent) / 100.0;
                rig.machine(|machine, now| machine.set_supply(voltage, now));
            }
            Action::Contactor { closed, with_bit_15 } => {
                if with_bit_15 {
                    rig.master().take_bit_15_back();
                }
                rig.drive.motor_side.borrow_mut().change_inputs(|inputs| inputs.main_power = closed);
            }
            Action::SafeTorqueOff(open) => rig.drive.motor_side.borrow_mut().change_inputs(|inputs| {
                inputs.safe_torque_1 = !open;
                inputs.safe_torque_2 = !open;
            }),
            Action::HomeSwitch(on) => {
                rig.drive.motor_side.borrow_mut().change_inputs(|inputs| inputs.home_switch = on);
            }
            // The service channel's.
            Action::Write(..)
            | Action::WriteList(..)
            | Action::WriteText(..)
            | Action::WriteWords(..)
            | Action::Read(_)
            | Action::Start(_)
            | Action::Cancel(_) => {}
            Action::Probe(on) => rig.drive.motor_side.borrow_mut().change_inputs(|inputs| inputs.probe_1 = on),
        }
        Ok(())
    }

    fn disturb(&mut self, kind: TelegramKind, cycles: u64, effect: Effect) -> Result<(), Stop> {
        Ok(self.rig.disturb(kind, cycles, effect)?)
    }

    fn break_something(&mut self, fault: Fault) -> Result<(), Stop> {
        let torque = if self.rig.bridge_is_on() { "with torque" } else { "without torque" };
        self.coverage.count("fault", format!("{fault:?} {torque}"));
        fault.inject(&mut self.rig)?;
        self.going_on = Some((fault, 0));
        Ok(())
    }

    /// Everything that may be broken is sound again; what friction there is goes.
    pub(crate) fn repair(&mut self) {
        self.going_on = None;
        let fault = self.rig.axis.built_for.unwrap_or(Fault::PositionLimit);
        fault.repair(&mut self.rig);
        self.rig.drive.motor_side.borrow_mut().change_inputs(|inputs| {
            inputs.home_switch = false;
            inputs.probe_1 = false;
        });
        // What a stop has fed into the DC link is gone when somebody has repaired the machine.
        let now = self.rig.world.now().0;
        let supply = self.rig.machine.machine.supply.voltage;
        let mut side = self.rig.drive.motor_side.borrow_mut();
        if side.machine().glance(now).bus_voltage > supply {
            side.machine().set_bus_voltage(supply, now);
        }
    }

    fn run_up_again(&mut self, also: &[Action]) -> Result<(), Stop> {
        let before = self.rig.world.now();
        let result = self.run_up(false, also);
        let spent = self.rig.world.now().saturating_sub(before);
        self.base += spent;
        result
    }

    /// From CP0 to CP4, with what the service channel tries in CP2.
    pub(crate) fn run_up(&mut self, settings: bool, also: &[Action]) -> Result<(), Stop> {
        self.services.drop_pending();
        self.rig.open_cp2()?;
        if settings && self.services.may_be_locked {
            self.rig.unlock()?;
        }
        self.rig.set_up(settings)?;
        if !settings {
            self.services.ask_why(self.rig.master());
        }
        for action in also {
            self.causes.note(action);
            self.services.ask(self.rig.master(), action);
        }
        self.rig.wait_for_answers()?;
        self.harvest();
        for action in also {
            if let Action::Write(idn, value) = *action
                && self.services.has_taken(idn)
            {
                self.rig.learn(idn, value);
            }
        }
        if !also.is_empty() && self.services.has_taken_telegrams() {
            self.rig.writes_control_cycle = true;
            self.rig.set_up(false)?;
            self.rig.writes_control_cycle = false;
        }
        self.rig.go_on_to_cp4()
    }

    /// The drive tells of an error.
    pub(crate) fn diagnosed(&mut self, number: u16) {
        if number & 0xF000 == 0xF000 {
            self.coverage.count("error met", format!("{number:04X}H"));
            if !self.causes.allow(&self.rig.axis, number) {
                self.unexplained.get_or_insert(number);
            }
        }
    }

    /// The drive has told of this error.
    pub(crate) fn has_met(&self, number: u16) -> bool {
        self.coverage.has("error met", &format!("{number:04X}H"))
    }

    /// Whether every error so far had a cause.
    pub(crate) fn judge(&mut self) -> Result<(), Stop> {
        if let Some(outside) = self.rig.master().outside() {
            let law = "S-0-0051 of a modulo axis is never below 0 and never S-0-0103";
            return Err(Stop::Broken { law: law.to_owned(), detail: format!("S-0-0051 = {outside}") });
        }
        match self.unexplained {
            Some(number) => Err(Stop::Broken {
                law: LAW.to_owned(),
                detail: format!("S-0-0390 = {number:04X}H, and nothing like it"),
            }),
            None => Ok(()),
        }
    }

    /// Takes the answers of the service channel that have come.
    pub(crate) fn harvest(&mut self) {
        for number in self.services.harvest(self.rig.world.ring_mut().master_mut(), &mut self.coverage) {
            self.diagnosed(number);
        }
    }
}

fn name_of(action: &Action) -> String {
    let text = format!("{action:?}");
    text.split(['(', ' ', '{']).next().unwrap_or_default().to_owned()
}
