//! Watches of the program: progress bars and remarks on standard error, and interruption by Ctrl-C.

use crate::CliError;
use crate::terminal::progress::Progress as Bar;
use crate::terminal::{interrupt, output};
use lnn::cancellation::Cancellation;
use lnn::pipeline::{Event, Watch};
use std::sync::atomic::AtomicBool;
use std::sync::{Arc, Mutex, PoisonError};

/// Stage of the work, each with its own progress bar.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Stage {
    Training(usize),
    Judging,
    Experiment,
    Search,
}

/// A watch that shows the current stage and ends when a flag is raised.
pub fn watch(stop: &Arc<AtomicBool>) -> Watch {
    let bar: Mutex<Option<(Stage, Bar)>> = Mutex::new(None);
    let events = move |event: Event<'_>| {
        let mut bar = bar.lock().unwrap_or_else(PoisonError::into_inner);
        let mut advance = |stage: Stage, done: usize, total: usize, unit: &str| {
            if bar.as_ref().is_none_or(|(shown, _)| *shown != stage) {
                // The old bar is cleared before the new one appears.
                *bar = None;
                *bar = Some((stage, Bar::new(total as u64, unit)));
            }
            if let Some((_, bar)) = bar.as_ref() {
                bar.advance(done as u64);
            }
        };
        match event {
            Event::Step { done, total } => advance(Stage::Training(total), done, total, "steps"),
            Event::Judged { done, total } => advance(Stage::Judging, done, total, "judged"),
            Event::Runs { done, total } => advance(Stage::Experiment, done, total, "runs"),
            Event::Epoch(epoch) => {
                if let Some((Stage::Training(_), bar)) = bar.as_ref() {
                    bar.show(epoch.validation_loss, epoch.rate);
                }
            }
            Event::Search(progress) => {
                advance(Stage::Search, 0, 0, "");
                if let Some((_, bar)) = bar.as_ref() {
                    bar.search(&progress.to_string());
                }
            }
            Event::Evaluations(count) => {
                if let Some((_, bar)) = bar.as_ref() {
                    bar.say(&format!("{count} evaluations"));
                }
            }
            Event::Note(text) => output::note(text),
            _ => {}
        }
    };
    Watch { interrupt: Arc::clone(stop), ..Watch::new(events) }
}

/// Cancellation of a long search by a signal, with its progress on standard error.
///
/// # Errors
/// Signals that cannot be watched for.
pub fn search() -> Result<Cancellation, CliError> {
    Ok(watch(&interrupt::flag()?).cancellation())
}
