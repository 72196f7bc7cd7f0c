//! A broken life, made as short as it can be while the same law breaks.

use crate::life::{Action, Axis, Life};
use crate::run::{Ending, live};

/// The shortest life found within so many trials in which the same law breaks.
#[must_use]
pub fn shrink(life: &Life, trials: u32) -> Life {
    let Ending::Broken { law, .. } = live(life).ending else { return life.clone() };
    let mut shrinker = Shrinker { best: life.clone(), law, trials };
    while shrinker.trials > 0 {
        let before = shrinker.best.clone();
        shrinker.events();
        shrinker.settings();
        shrinker.tries();
        shrinker.axis();
        shrinker.values();
        shrinker.times();
        if shrinker.best == before {
            break;
        }
    }
    shrinker.best
}

struct Shrinker {
    best: Life,
    law: String,
    trials: u32,
}

impl Shrinker {
    /// Takes the simpler life if the law breaks in it, too.
    fn try_it(&mut self, simpler: Life) -> bool {
        if self.trials == 0 || simpler == self.best {
            return false;
        }
        self.trials -= 1;
        let same = matches!(live(&simpler).ending, Ending::Broken { law, .. } if law == self.law);
        if same {
            self.best = simpler;
        }
        same
    }

    /// Leaves events out: the last ones first, halves before quarters.
    fn events(&mut self) {
        let mut size = self.best.events.len().div_ceil(2);
        while size > 0 {
            let mut end = self.best.events.len();
            while end > 0 {
                let begin = end.saturating_sub(size);
                let mut simpler = self.best.clone();
                simpler.events.drain(begin..end.min(simpler.events.len()));
                self.try_it(simpler);
                end = begin;
            }
            size /= 2;
        }
    }

    fn settings(&mut self) {
        let mut size = self.best.axis.settings.len().div_ceil(2);
        while size > 0 {
            let mut end = self.best.axis.settings.len();
            while end > 0 {
                let begin = end.saturating_sub(size);
                let mut simpler = self.best.clone();
                simpler.axis.settings.drain(begin..end.min(simpler.axis.settings.len()));
                self.try_it(simpler);
                end = begin;
            }
            size /= 2;
        }
    }

    /// Fewer tries in CP2, of the axis and of later run-ups.
    fn tries(&mut self) {
        for index in (0..self.best.axis.also.len()).rev() {
            let mut simpler = self.best.clone();
            simpler.axis.also.remove(index);
            self.try_it(simpler);
        }
        for event in 0..self.best.events.len() {
            let Action::RunUp { also, .. } = &self.best.events[event].action else { continue };
            for index in (0..also.len()).rev() {
                let mut simpler = self.best.clone();
                if let Action::RunUp { also, .. } = &mut simpler.events[event].action {
                    also.remove(index);
                    self.try_it(simpler);
                }
            }
        }
    }

    /// The plainest ring and telegram.
    fn axis(&mut self) {
        let plainer: [fn(&mut Axis); 8] = [
            |axis| {
                axis.cycle = 2_000;
                axis.megabits = 2;
            },
            |axis| axis.control_cycles = 1,
            |axis| axis.early_mdt = false,
            |axis| axis.increments = None,
            |axis| axis.built_for = None,
            |axis| axis.wraps = false,
            |axis| axis.aligned = true,
            |axis| {
                axis.telegram = 5;
                axis.mdt = vec![47, 36];
                axis.at = vec![51, 40];
            },
        ];
        for change in plainer {
            let mut simpler = self.best.clone();
            change(&mut simpler.axis);
            self.try_it(simpler);
        }
        for list in [false, true] {
            for index in (0..if list { self.best.axis.mdt.len() } else { self.best.axis.at.len() }).rev() {
                let mut simpler = self.best.clone();
                let idns = if list { &mut simpler.axis.mdt } else { &mut simpler.axis.at };
                // A control aligns its command with S-0-0051.
                let needed = !list && idns.get(index) == Some(&51);
                if simpler.axis.telegram == 7 && index < idns.len() && !needed {
                    idns.remove(index);
                    self.try_it(simpler);
                }
            }
        }
    }

    /// Rounder and smaller numbers.
    fn values(&mut self) {
        for index in 0..self.best.events.len() {
            for value in number_in(&self.best.events[index].action).map(simpler_numbers).unwrap_or_default() {
                let mut simpler = self.best.clone();
                put_number(&mut simpler.events[index].action, value);
                self.try_it(simpler);
            }
        }
        for index in 0..self.best.axis.settings.len() {
            for value in simpler_numbers(self.best.axis.settings[index].1) {
                let mut simpler = self.best.clone();
                simpler.axis.settings[index].1 = value;
                self.try_it(simpler);
            }
        }
    }

    /// Whole milliseconds, and no pauses that nothing needs.
    fn times(&mut self) {
        for index in 0..self.best.events.len() {
            let before = index.checked_sub(1).map_or(0, |index| self.best.events[index].at);
            let gap = self.best.events[index].at.saturating_sub(before);
            for shorter in [0, gap / 2 / 1_000 * 1_000, gap / 1_000 * 1_000] {
                let mut simpler = self.best.clone();
                for event in &mut simpler.events[index..] {
                    event.at -= gap - shorter;
                }
                if shorter < gap && self.try_it(simpler) {
                    break;
                }
            }
        }
        for rest in [0, 20_000, self.best.rest / 2] {
            let simpler = Life { rest, ..self.best.clone() };
            if rest < self.best.rest && self.try_it(simpler) {
                break;
            }
        }
    }
}

const fn number_in(action: &Action) -> Option<i64> {
    match action {
        Action::Set(_, value) | Action::Jump(_, value) | Action::Ramp(_, value) | Action::Write(_, value) => {
            Some(*value)
        }
        Action::Load(percent) => Some(*percent as i64),
        _ => None,
    }
}

fn put_number(action: &mut Action, number: i64) {
    match action {
        Action::Set(_, value) | Action::Jump(_, value) | Action::Ramp(_, value) | Action::Write(_, value) => {
            *value = number;
        }
        Action::Load(percent) => *percent = number as i16,
        _ => {}
    }
}

/// 0, a number with one digit that is not 0, and one with two.
fn simpler_numbers(value: i64) -> Vec<i64> {
    let mut numbers = vec![0];
    for digits in [1, 2] {
        let mut unit: i64 = 1;
        while value.unsigned_abs() / unit.unsigned_abs() >= 10u64.pow(digits) {
            unit *= 10;
        }
        numbers.push(value / unit * unit);
    }
    numbers.retain(|number| *number != value);
    numbers.dedup();
    numbers
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn simpler_numbers_are_rounder() {
        assert_eq!(simpler_numbers(-123_456), [0, -100_000, -120_000]);
        assert_eq!(simpler_numbers(7), [0]);
        assert_eq!(simpler_numbers(0), [] as [i64; 0]);
    }
}
