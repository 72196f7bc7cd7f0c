//! A life as a sentence.

use std::fmt;

use drive::DICTIONARY;
use ring::ident::Idn;
use sercos::attribute::Format;

use crate::life::{Action, Axis, Life};
use crate::units::Units;

impl fmt::Display for Life {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "{}; CP4", self.axis)?;
        // Under another scaling a number is worth something else.
        let mut axis = self.axis.clone();
        learn(&mut axis, &self.axis.also);
        for event in &self.events {
            write!(formatter, "; at {} ms ", f64::from(event.at) / 1_000.0)?;
            if let Action::RunUp { also, .. } = &event.action {
                learn(&mut axis, also);
            }
            tell(formatter, &event.action, &Units::of(&axis))?;
        }
        write!(formatter, "; {} ms more.", f64::from(self.rest) / 1_000.0)
    }
}

impl fmt::Display for Axis {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "axis {}", self.plant.axis().name)?;
        if let Some(increments) = self.increments {
            write!(formatter, " with {increments} increments")?;
        }
        if let Some(fault) = self.built_for {
            write!(formatter, " built for \"{fault}\"")?;
        }
        write!(formatter, ", {} us", self.cycle)?;
        if self.control_cycles > 1 {
            write!(formatter, " (S-0-0001 {} times that)", self.control_cycles)?;
        }
        write!(formatter, " at {} Mbit/s{}", self.megabits, if self.early_mdt { ", MDT early" } else { "" })?;
        let list = |idns: &[u16]| idns.iter().map(|&idn| Idn(idn).to_string()).collect::<Vec<_>>().join(" ");
        write!(formatter, ", telegram {} (MDT {}; AT {})", self.telegram, list(&self.mdt), list(&self.at))?;
        if !self.aligned {
            write!(formatter, ", commutation angle not known")?;
        }
        if self.wraps && Units::of(self).modulo.is_some() {
            write!(formatter, ", commands wrap")?;
        }
        for (idn, value) in &self.settings {
            write!(formatter, ", {} = {value}", Idn(*idn))?;
        }
        if !self.also.is_empty() {
            write!(formatter, ", in CP2 also ")?;
        }
        tell_all(formatter, &self.also, &Units::of(self))
    }
}

/// What an axis is after these writes, if the drive takes them.
fn learn(axis: &mut Axis, writes: &[Action]) {
    axis.settings.extend(writes.iter().filter_map(|action| match *action {
        Action::Write(idn, value) => Some((idn, value)),
        _ => None,
    }));
}

/// What the service channel tries in CP2.
fn tell_all(formatter: &mut fmt::Formatter<'_>, actions: &[Action], units: &Units) -> fmt::Result {
    for (index, action) in actions.iter().enumerate() {
        if index > 0 {
            write!(formatter, " and ")?;
        }
        tell(formatter, action, units)?;
    }
    Ok(())
}

fn tell(formatter: &mut fmt::Formatter<'_>, action: &Action, units: &Units) -> fmt::Result {
    let worth = |idn: u16, value: i64| match idn {
        47..=53 | 57 | 130..=133 | 150 | 159 | 258 => format!(" ({:.3} deg)", value as f64 / units.revolution * 360.0),
        36..=41 | 91 | 259 => format!(" ({:.2} rpm)", value as f64 / units.rpm),
        42 | 136..=138 | 260 | 372 => format!(" ({:.2} rad/s2)", value as f64 / units.acceleration),
        80..=83 | 92 => format!(" ({:.1} %)", value as f64 / 10.0),
        _ => String::new(),
    };
    match *action {
        Action::WriteList(idn, ref items) => {
            write!(formatter, "write {} = (", Idn(idn))?;
            let is_idns = is_list_of_idns(idn);
            for (index, item) in items.iter().enumerate() {
                let gap = if index > 0 { " " } else { "" };
                match u16::try_from(*item) {
                    Ok(item) if is_idns => write!(formatter, "{gap}{}", Idn(item))?,
                    _ => write!(formatter, "{gap}{item}")?,
                }
            }
            write!(formatter, ")")
        }
        Action::WriteText(idn, ref text) => write!(formatter, "write {} = {text:?}", Idn(idn)),
        Action::WriteWords(idn, ref words) => {
            write!(formatter, "write {} with the {} words", Idn(idn), words.len())?;
            words.iter().try_for_each(|word| write!(formatter, " {word:04X}H"))
        }
        Action::RunUp { stubborn, ref also } => {
            write!(
                formatter,
                "{}",
                if stubborn { "CP0 and a run-up with the bits left on" } else { "bits 000, CP0 and a run-up" }
            )?;
            if !also.is_empty() {
                write!(formatter, ", in CP2 ")?;
            }
            tell_all(formatter, also, units)
        }
        Action::SkipCheck(phase) => {
            let check = if phase == 4 { "S-0-0128" } else { "S-0-0127" };
            write!(formatter, "a run-up to CP{phase} without {check}, then a proper one")
        }
        Action::Switches(bits) => write!(formatter, "bits {bits:03b}"),
        Action::Blip(bits, cycles) => write!(formatter, "bits {bits:03b} for {cycles} cycles"),
        Action::Mode(bits) => write!(formatter, "mode bits {bits:03b}"),
        Action::Set(idn, value) => write!(formatter, "{} is {value}{}", Idn(idn), worth(idn, value)),
        Action::Jump(idn, by) => write!(formatter, "{} jumps by {by}{}", Idn(idn), worth(idn, by)),
        Action::Ramp(47 | 48 | 258, per_second) if units.revolution != 0.0 => {
            let idn = if let Action::Ramp(idn, _) = *action { idn } else { 47 };
            let rpm = per_second as f64 / units.revolution * 60.0;
            write!(formatter, "{} moves by {per_second}/s ({rpm:.2} rpm)", Idn(idn))
        }
        Action::Ramp(idn, per_second) => write!(formatter, "{} rises by {per_second}/s", Idn(idn)),
        Action::Align(true) => write!(formatter, "S-0-0047 follows S-0-0051 while off"),
        Action::Align(false) => write!(formatter, "S-0-0047 stays while off"),
        Action::Write(idn, value) => write!(formatter, "write {} = {value}{}", Idn(idn), worth(idn, value)),
        Action::Read(idn) => write!(formatter, "read {}", Idn(idn)),
        Action::Start(idn) => write!(formatter, "start {}", Idn(idn)),
        Action::Cancel(idn) => write!(formatter, "cancel {}", Idn(idn)),
        Action::LoseMst(cycles) => write!(formatter, "{cycles} MSTs lost"),
        Action::LoseMdt(cycles) => write!(formatter, "{cycles} MDTs lost"),
        Action::DamageMst(bit) => write!(formatter, "line bit {bit} of an MST inverted"),
        Action::DamageMdt(bit) => write!(formatter, "line bit {bit} of an MDT inverted"),
        Action::WrongPhase(phase) => write!(formatter, "one MST of phase {phase}"),
        Action::Dark(cycles) => write!(formatter, "dark for {cycles} cycles"),
        Action::FallBack(phase) => write!(formatter, "back to CP{phase}, then a run-up"),
        Action::Break(fault) => write!(formatter, "{fault}"),
        Action::Repair => write!(formatter, "repaired"),
        Action::Load(percent) => write!(formatter, "load of {percent} % of the standstill torque"),
        Action::Mains(percent) => write!(formatter, "mains at {percent} %"),
        Action::Contactor { closed: true, .. } => write!(formatter, "contactor closes"),
        Action::Contactor { closed: false, with_bit_15: true } => write!(formatter, "contactor opens, bit 15 goes"),
        Action::Contactor { closed: false, with_bit_15: false } => write!(formatter, "contactor opens"),
        Action::SafeTorqueOff(true) => write!(formatter, "safe torque off opens"),
        Action::SafeTorqueOff(false) => write!(formatter, "safe torque off closes"),
        Action::HomeSwitch(on) => write!(formatter, "home switch {}", u8::from(on)),
        Action::Probe(on) => write!(formatter, "probe 1 {}", u8::from(on)),
    }
}

fn is_list_of_idns(idn: u16) -> bool {
    DICTIONARY.find(sercos::Idn(idn)).is_some_and(|block| block.attribute.format() == Format::Idn)
}
