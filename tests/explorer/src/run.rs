//! A life, lived.

use std::collections::VecDeque;
use std::panic::{AssertUnwindSafe, catch_unwind};

use fault_matrix::{Fault, Target};
use ring::Nanoseconds;
use ring::fibre::{Effect, TelegramKind};
use ring::ident::Element;
use ring::service_client::{Request, status};

use crate::causes::{Causes, LAW};
use crate::coverage::Coverage;
use crate::life::{Action, Life};
use crate::peace;
use crate::rig::{Rig, Stop, read_value, reading, writing_open};
use crate::units::words_of;

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

/// A data block that the life has written, and what it was before.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Written {
    pub(crate) idn: u16,
    pub(crate) before: Option<i64>,
}

/// What is waited for from the service channel, in the order of asking.
#[derive(Clone, Copy, Debug)]
enum Pending {
    Write { idn: u16, words: usize },
    Read,
    Diagnosis,
    Start(u16),
    Cancel,
}

pub(crate) struct Run {
    pub(crate) rig: Rig,
    pub(crate) coverage: Coverage,
    pub(crate) written: Vec<Written>,
    pub(crate) started: Vec<u16>,
    causes: Causes,
    /// A diagnosis that nothing in this life explains.
    unexplained: Option<u16>,
    pending: VecDeque<Pending>,
    /// A fault that goes on by itself, and since when.
    going_on: Option<(Fault, u64)>,
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
                written: Vec::new(),
                started: Vec::new(),
                causes: Causes::default(),
                unexplained: None,
                pending: VecDeque::new(),
                going_on: None,
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
        self.rig.run_up(true)?;
        self.base = self.rig.world.now();
        for (idn, _) in crate::units::writes(&self.rig.axis, &self.rig.machine) {
            self.coverage.count("set up", ring::ident::Idn(idn).to_string());
        }
        let mut refused = false;
        for event in &life.events {
            self.run_to(event.at)?;
            self.coverage.count("action", name_of(&event.action));
            self.causes.note(&event.action);
            match self.happen(&event.action) {
                Ok(()) => {}
                // A run-up that is refused because of what the life has written ends the life; peace mends it.
                Err(Stop::Refused(reason)) => {
                    self.coverage.count("run-up refused in a life", reason);
                    refused = true;
                    break;
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
            Action::Write(idn, value) => self.ask_to_write(idn, &words_of(idn, value)),
            Action::Read(idn) => {
                rig.master().ask(Request::Steps(reading(idn, true)));
                self.pending.push_back(Pending::Read);
            }
            Action::Start(idn) => {
                if idn == 99 {
                    rig.master().ask(Request::Steps(reading(390, true)));
                    self.pending.push_back(Pending::Diagnosis);
                }
                rig.master().ask(Request::Steps(crate::rig::writing(idn, &[3])));
                self.pending.push_back(Pending::Start(idn));
            }
            Action::Cancel(idn) => {
                rig.master().ask(Request::Steps(crate::rig::writing(idn, &[0])));
                self.pending.push_back(Pending::Cancel);
            }
            Action::LoseMst(cycles) => self.disturb(TelegramKind::Mst, cycles.into(), Effect::Drop)?,
            Action::LoseMdt(cycles) => self.disturb(TelegramKind::Mdt, cycles.into(), Effect::Drop)?,
            Action::DamageMst(bit) => self.disturb(TelegramKind::Mst, 1, Effect::FlipBit(bit.into()))?,
            Action::DamageMdt(bit) => self.disturb(TelegramKind::Mdt, 1, Effect::FlipBit(bit.into()))?,
            Action::WrongPhase(phase) => self.disturb(TelegramKind::Mst, 1, Effect::Phase(phase))?,
            Action::Dark(cycles) => {
                rig.darken(cycles.into())?;
            }
            Action::RunUp { stubborn } => {
                if !stubborn {
                    rig.master().switch(0);
                    rig.cycles(2)?;
                }
                self.run_up_again()?;
            }
            Action::FallBack(phase) => {
                rig.master().phase = phase.min(7);
                rig.cycles(3)?;
                self.run_up_again()?;
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
    }

    fn run_up_again(&mut self) -> Result<(), Stop> {
        let before = self.rig.world.now();
        let result = self.rig.run_up(false);
        self.drop_pending();
        let spent = self.rig.world.now().saturating_sub(before);
        self.base += spent;
        result
    }

    fn ask_to_write(&mut self, idn: u16, words: &[u16]) {
        let mut steps = reading(idn, true);
        steps.extend(writing_open(words));
        self.rig.master().ask(Request::Steps(steps));
        self.pending.push_back(Pending::Write { idn, words: words.len() });
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

    /// Requests that a run-up has cut off: nobody knows what came of them.
    pub(crate) fn drop_pending(&mut self) {
        for pending in self.pending.drain(..) {
            match pending {
                Pending::Write { idn, .. } => self.written.push(Written { idn, before: None }),
                Pending::Start(idn) => self.started.push(idn),
                Pending::Read | Pending::Diagnosis | Pending::Cancel => {}
            }
        }
    }

    /// Takes the answers of the service channel that have come.
    pub(crate) fn harvest(&mut self) {
        while let Some(finished) = self.rig.master().answer() {
            let Some(pending) = self.pending.pop_front() else { continue };
            let phase = self.rig.master().sent_phase();
            let sound = finished.result.is_ok();
            match pending {
                Pending::Write { idn, words } => {
                    let writes = finished.steps.iter().filter(|record| record.step.write);
                    let data = writes.filter(|record| record.step.element == Element::Data);
                    let refused = data.clone().find(|record| record.error).map(|record| record.reply);
                    let name = ring::ident::Idn(idn);
                    match refused {
                        Some(code) => self.coverage.count("write refused", format!("{name} CP{phase} {code:04X}H")),
                        None if sound && data.count() == words => {
                            self.coverage.count("write accepted", format!("{name} CP{phase}"));
                            let before = read_value(idn, &finished.steps);
                            self.written.push(Written { idn, before });
                        }
                        None => self.written.push(Written { idn, before: read_value(idn, &finished.steps) }),
                    }
                }
                Pending::Start(idn) => {
                    let refused = finished.steps.iter().find(|record| record.error);
                    let name = ring::ident::Idn(idn);
                    match refused {
                        Some(record) => {
                            self.coverage.count("command refused", format!("{name} CP{phase} {:04X}H", record.reply));
                        }
                        None => {
                            self.coverage.count("command started", format!("{name} CP{phase}"));
                            self.started.push(idn);
                        }
                    }
                }
                Pending::Diagnosis => {
                    let number = read_value(390, &finished.steps).unwrap_or(0) as u16;
                    self.diagnosed(number);
                }
                Pending::Read | Pending::Cancel => {}
            }
        }
    }
}

fn name_of(action: &Action) -> String {
    let text = format!("{action:?}");
    text.split(['(', ' ', '{']).next().unwrap_or_default().to_owned()
}
