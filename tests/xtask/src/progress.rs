//! Progress of a simulated run: one bar a phase on a terminal, one line a phase elsewhere.

use crate::report::data::Progress;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::io::IsTerminal;

/// Shows how a run goes from CP0 to CP4. Everything goes to stderr; stdout is for results.
pub(crate) struct PhaseBars {
    terminal: bool,
    current: Option<Shown>,
}

struct Shown {
    phase: u8,
    what: String,
    bar: ProgressBar,
    time_us: u64,
}

impl PhaseBars {
    /// Bars if stderr is a terminal, else lines.
    pub(crate) fn new() -> Self {
        Self { terminal: std::io::stderr().is_terminal(), current: None }
    }

    /// Takes one report of the run.
    pub(crate) fn show(&mut self, progress: &Progress) {
        if self.current.as_ref().is_none_or(|shown| shown.phase != progress.phase) {
            self.finish();
            self.current = Some(self.begin(progress));
        }
        let Some(shown) = &mut self.current else { return };
        shown.time_us = progress.time_us;
        if progress.of > 0 {
            shown.bar.set_length(progress.of);
            shown.bar.set_position(progress.done.min(progress.of));
        } else {
            shown.bar.tick();
        }
        if shown.what != progress.what {
            shown.what.clone_from(&progress.what);
            shown.bar.set_message(progress.what.clone());
        }
    }

    /// Ends the last phase's bar.
    pub(crate) fn finish(&mut self) {
        let Some(shown) = self.current.take() else { return };
        let line = done_line(&shown);
        shown.bar.finish_and_clear();
        eprintln!("{line}");
    }

    fn begin(&self, progress: &Progress) -> Shown {
        let target = if self.terminal { ProgressDrawTarget::stderr() } else { ProgressDrawTarget::hidden() };
        let bar = ProgressBar::with_draw_target((progress.of > 0).then_some(progress.of), target);
        let template = if progress.of > 0 {
            "  {prefix} {bar:32.cyan/blue} {percent:>3} %  {msg}"
        } else {
            "  {prefix} {spinner} {msg}"
        };
        if let Ok(style) = ProgressStyle::with_template(template) {
            bar.set_style(style.progress_chars("━╸─"));
        }
        bar.set_prefix(format!("CP{}", progress.phase));
        bar.set_message(progress.what.clone());
        Shown { phase: progress.phase, what: progress.what.clone(), bar, time_us: progress.time_us }
    }
}

fn done_line(shown: &Shown) -> String {
    format!("  CP{} until {} s  {}", shown.phase, crate::report::numbers::seconds(shown.time_us), shown.what)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn progress(phase: u8, done: u64, time_us: u64) -> Progress {
        Progress { phase, what: format!("work of CP{phase}"), done, of: 10, time_us }
    }

    #[test]
    fn a_new_phase_ends_the_bar_of_the_old_one() {
        let mut bars = PhaseBars { terminal: false, current: None };
        bars.show(&progress(0, 3, 30_000));
        bars.show(&progress(0, 10, 100_000));
        assert_eq!(done_line(bars.current.as_ref().unwrap()), "  CP0 until 0.100 s  work of CP0");
        bars.show(&progress(1, 1, 110_000));
        let shown = bars.current.as_ref().unwrap();
        assert_eq!((shown.phase, shown.bar.position(), shown.bar.length()), (1, 1, Some(10)));
        bars.finish();
        assert!(bars.current.is_none());
    }
}
