//! How far a command is: a bar on a terminal, lines in a log, numbers for a program that called it.

use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressStyle};

use crate::interrupt;

/// A line is written to a log after this time at the latest.
const SLOWEST_LINE: Duration = Duration::from_secs(10);

/// No two lines are closer than this: what is done within it needs none.
const FASTEST_LINE: Duration = Duration::from_secs(1);

/// Share of the work after which a line is due.
const LINE_SHARE: f64 = 0.1;

/// Where some work stands.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Standing {
    /// What is done, and figures of it.
    pub message: String,
    /// Steps so far.
    pub position: u64,
    /// Steps in all; 0 while that is unknown.
    pub length: u64,
}

impl Standing {
    /// What is done of all, 0 to 1.
    #[must_use]
    pub fn share(&self) -> f64 {
        if self.length == 0 { 0.0 } else { (self.position as f64 / self.length as f64).min(1.0) }
    }
}

/// Who is told.
#[derive(Debug)]
enum Watcher {
    Nobody,
    Terminal(ProgressBar),
    Log,
    /// A program that looks at it when it likes to.
    Caller(Arc<Mutex<Standing>>),
}

/// Progress of one piece of work.
#[derive(Debug)]
pub struct Progress {
    watcher: Watcher,
    state: Mutex<State>,
}

#[derive(Debug)]
struct State {
    standing: Standing,
    started: Instant,
    lines: Lines,
}

impl Progress {
    fn new(watcher: Watcher, steps: usize, label: &str) -> Self {
        let standing = Standing { message: label.to_owned(), position: 0, length: steps as u64 };
        let state = State { standing, started: Instant::now(), lines: Lines::default() };
        let progress = Self { watcher, state: Mutex::new(state) };
        progress.change(|_| ());
        progress
    }

    /// Progress that nobody sees.
    #[must_use]
    pub(crate) fn hidden() -> Self {
        Self::new(Watcher::Nobody, 0, "")
    }

    /// A bar that is never wider than the terminal.
    pub(crate) fn on_terminal(steps: usize, label: &str) -> Self {
        // The bar takes what figures and message leave of the width; 60 columns of message and 20 of figures make 80.
        let style = ProgressStyle::with_template("{msg:!60} {percent:>3}% {wide_bar} {eta:>4} left")
            .unwrap_or_else(|_| ProgressStyle::default_bar());
        let bar = ProgressBar::new(steps as u64).with_style(style);
        Self::new(Watcher::Terminal(bar), steps, label)
    }

    /// Lines for somebody who reads them later.
    pub(crate) fn in_log(steps: usize, label: &str) -> Self {
        Self::new(Watcher::Log, steps, label)
    }

    /// Kept up to date in `standing`.
    pub(crate) fn for_caller(standing: Arc<Mutex<Standing>>, steps: usize, label: &str) -> Self {
        Self::new(Watcher::Caller(standing), steps, label)
    }

    /// Counts `steps` more.
    pub fn inc(&self, steps: u64) {
        self.change(|standing| standing.position += steps);
    }

    /// Sets the steps so far.
    pub fn set_position(&self, position: u64) {
        self.change(|standing| standing.position = position);
    }

    /// Sets the steps in all.
    pub fn set_length(&self, length: u64) {
        self.change(|standing| standing.length = length);
    }

    /// Says what is done now.
    pub fn set_message(&self, message: String) {
        self.change(|standing| standing.message = message);
    }

    /// Ends it; nothing is left on a terminal.
    pub fn finish_and_clear(&self) {
        if let Watcher::Terminal(bar) = &self.watcher {
            bar.finish_and_clear();
        }
    }

    fn change(&self, change: impl FnOnce(&mut Standing)) {
        interrupt::give_up_if_asked();
        let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        let State { standing, started, lines } = &mut *state;
        change(standing);
        match &self.watcher {
            Watcher::Nobody => (),
            Watcher::Terminal(bar) => {
                bar.set_length(standing.length);
                bar.set_position(standing.position);
                bar.set_message(standing.message.clone());
            }
            Watcher::Log => {
                if let Some(line) = lines.due(standing, started.elapsed()) {
                    eprintln!("{line}");
                }
            }
            Watcher::Caller(caller) => {
                *caller.lock().unwrap_or_else(PoisonError::into_inner) = standing.clone();
            }
        }
    }
}

/// What was written to a log last.
#[derive(Clone, Copy, Debug, Default)]
struct Lines {
    after: Duration,
    share: f64,
}

impl Lines {
    /// The next line, if it is time for one `after` the start.
    fn due(&mut self, standing: &Standing, after: Duration) -> Option<String> {
        let (waited, share) = (after.saturating_sub(self.after), standing.share());
        // Work that has begun anew, with other steps.
        self.share = self.share.min(share);
        // A hair less than a tenth, as shares are rounded.
        let is_due = waited >= SLOWEST_LINE || share - self.share >= LINE_SHARE - 1e-9;
        if !is_due || waited < FASTEST_LINE {
            return None;
        }
        *self = Self { after, share };
        let left = if share > 0.0 {
            let seconds = after.as_secs_f64() * (1.0 - share) / share;
            format!("{:.0} %, {seconds:.0} s left", 100.0 * share)
        } else {
            format!("{:.0} s so far", after.as_secs_f64())
        };
        Some(format!("{}: {left}", standing.message))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lines_of(times: impl Iterator<Item = (u64, f64)>) -> Vec<String> {
        let mut lines = Lines::default();
        let due = |(position, seconds)| {
            let standing = Standing { message: "tracking".to_owned(), position, length: 200 };
            lines.due(&standing, Duration::from_secs_f64(seconds))
        };
        times.filter_map(due).collect()
    }

    #[test]
    fn a_log_gets_a_line_for_every_tenth() {
        // 200 steps of a fifth of a second: a tenth takes 4 s.
        let lines = lines_of((1..=200).map(|step| (step, 0.2 * step as f64)));
        assert_eq!(lines.len(), 10);
        assert_eq!(lines[0], "tracking: 10 %, 36 s left");
        assert_eq!(lines[9], "tracking: 100 %, 0 s left");
    }

    #[test]
    fn slow_work_gets_one_every_ten_seconds_and_fast_work_none() {
        // A tenth takes 40 s.
        assert_eq!(lines_of((1..=200).map(|step| (step, 2.0 * step as f64))).len(), 40);
        assert!(lines_of((1..=200).map(|step| (step, 0.004 * step as f64))).is_empty());
    }

    #[test]
    fn a_caller_sees_where_it_stands() {
        let seen = Arc::new(Mutex::new(Standing::default()));
        let progress = Progress::for_caller(Arc::clone(&seen), 8, "rendering");
        progress.inc(2);
        let standing = seen.lock().unwrap().clone();
        assert_eq!((standing.message.as_str(), standing.share()), ("rendering", 0.25));
    }
}
