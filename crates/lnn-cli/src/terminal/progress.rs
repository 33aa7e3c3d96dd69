//! A progress bar on standard error: loss, learning rate, remaining time.

use crate::terminal::output;
use crate::thresholds::{FIRST_LINE, NEXT_LINE};
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use lnn::names::number;
use std::io::IsTerminal;
use std::sync::Mutex;
use std::time::{Duration, Instant};

/// Progress bar for a known number of steps. If standard error is not a terminal, it is silent, except for an occasional line during a
/// search.
pub struct Progress {
    bar: ProgressBar,
    /// Time at which the next line is due.
    line: Mutex<Instant>,
}

impl Progress {
    /// A bar of `total` steps, such as epochs.
    pub fn new(total: u64, unit: &str) -> Self {
        let target = if std::io::stderr().is_terminal() {
            ProgressDrawTarget::stderr_with_hz(5)
        } else {
            ProgressDrawTarget::hidden()
        };
        let bar = ProgressBar::with_draw_target(Some(total), target);
        let template = format!("{{bar:24}} {{pos}}/{{len}} {unit}  {{msg}}  {{eta}} left");
        if let Ok(style) = ProgressStyle::with_template(&template) {
            bar.set_style(style.progress_chars("=> "));
        }
        Self { bar, line: Mutex::new(Instant::now() + FIRST_LINE) }
    }

    /// Sets the number of finished steps.
    pub fn advance(&self, done: u64) {
        self.bar.set_position(done);
    }

    /// Adds finished steps, from any thread.
    pub fn add(&self, done: usize) {
        self.bar.inc(done as u64);
    }

    /// Shows a short description of the current work.
    pub fn say(&self, text: &str) {
        self.bar.set_message(text.to_string());
    }

    /// Shows the progress of a search, whose number of steps is unknown.
    pub fn search(&self, text: &str) {
        if !self.bar.is_hidden() {
            if self.bar.length() == Some(0) {
                self.bar.unset_length();
                if let Ok(style) = ProgressStyle::with_template("{spinner} {elapsed}  {msg}") {
                    self.bar.set_style(style);
                }
                self.bar.enable_steady_tick(Duration::from_millis(200));
            }
            self.bar.set_message(text.to_string());
        } else if let Ok(mut line) = self.line.lock()
            && Instant::now() >= *line
        {
            *line = Instant::now() + NEXT_LINE;
            output::progress(text);
        }
    }

    /// The last validation loss and the learning rate.
    pub fn show(&self, loss: f64, rate: f64) {
        self.bar.set_message(format!("loss {}  rate {}", number(loss), number(rate)));
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        self.bar.finish_and_clear();
    }
}
