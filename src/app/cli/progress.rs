//! A progress bar on standard error: loss, learning rate, remaining time.

use crate::names::number;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::io::IsTerminal;

/// Progress through a known number of steps; silent when standard error is not a terminal.
pub struct Progress {
    bar: ProgressBar,
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
        Self { bar }
    }

    /// `done` steps are done.
    pub fn advance(&self, done: u64) {
        self.bar.set_position(done);
    }

    /// A word about the work at hand.
    pub fn say(&self, text: &str) {
        self.bar.set_message(text.to_string());
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
