//! Watches: progress reports of a running pipeline, and the flag that ends it.

use crate::cancellation::{Cancellation, SearchProgress};
use crate::training::{Epoch, Hooks, Progress};
use std::fmt;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// An event in a running pipeline.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub enum Event<'a> {
    /// A step of a training: `done` of `total` steps.
    Step {
        /// Steps taken so far.
        done: usize,
        /// Steps of the whole training.
        total: usize,
    },
    /// An epoch of a training ended.
    Epoch(&'a Epoch),
    /// Pieces of work on a finished model: `done` of `total`.
    Judged {
        /// Pieces done.
        done: usize,
        /// Pieces of all the work.
        total: usize,
    },
    /// Evaluations of the model under test, so far.
    Evaluations(u64),
    /// Runs of an experiment that are finished: `done` of `total`.
    Runs {
        /// Runs that are finished.
        done: usize,
        /// Runs requested.
        total: usize,
    },
    /// A search for constants, a formula or constraints is under way.
    Search(SearchProgress),
    /// Remark for the user, one line.
    Note(&'a str),
}

/// Receiver of events; called from several threads.
pub type EventSink = Arc<dyn Fn(Event<'_>) + Send + Sync>;

/// Events and interruption of a pipeline.
#[derive(Clone, Default)]
pub struct Watch {
    /// Receiver of events, if there is one.
    pub events: Option<EventSink>,
    /// Flag that ends the work when it is raised: a training after its step, with the best model so far; an evaluation with
    /// [`PipelineError::Interrupted`](crate::pipeline::PipelineError::Interrupted).
    pub interrupt: Arc<AtomicBool>,
}

impl fmt::Debug for Watch {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Watch").field("interrupt", &self.interrupt).finish_non_exhaustive()
    }
}

impl Watch {
    /// Creates a watch that passes events to a function.
    pub fn new(events: impl Fn(Event<'_>) + Send + Sync + 'static) -> Self {
        Self { events: Some(Arc::new(events)), interrupt: Arc::default() }
    }

    /// Copies the watch with a filter for events.
    fn filtered(&self, passes: fn(Event<'_>) -> bool) -> Self {
        let events = self.events.clone().map(|events| -> EventSink {
            Arc::new(move |event| {
                if passes(event) {
                    events(event);
                }
            })
        });
        Self { events, interrupt: Arc::clone(&self.interrupt) }
    }

    /// Copies the watch, limited to remarks.
    pub(crate) fn remarks_alone(&self) -> Self {
        self.filtered(|event| matches!(event, Event::Note(_)))
    }

    /// This watch without remarks.
    pub(crate) fn without_remarks(&self) -> Self {
        self.filtered(|event| !matches!(event, Event::Note(_)))
    }

    /// `true` if the flag was raised.
    pub(crate) fn is_interrupted(&self) -> bool {
        self.interrupt.load(Ordering::SeqCst)
    }

    /// Sends an event.
    pub(crate) fn say(&self, event: Event<'_>) {
        if let Some(events) = &self.events {
            events(event);
        }
    }

    /// A cancellation for a search.
    pub fn cancellation(&self) -> Cancellation {
        let cancellation = Cancellation::by(&self.interrupt);
        match self.events.clone() {
            Some(events) => cancellation.reporting(move |progress| events(Event::Search(progress))),
            None => cancellation,
        }
    }

    /// Hooks for a training, such as [`Trainer::train_watched`](crate::presets::Trainer::train_watched).
    pub fn hooks(&self) -> Hooks {
        let watcher = self.events.clone().map(|events| {
            let watcher: crate::training::Watcher = Arc::new(move |progress: Progress<'_>| match progress {
                Progress::Step { step, steps, .. } => events(Event::Step { done: step, total: steps }),
                Progress::Epoch(epoch) => events(Event::Epoch(epoch)),
            });
            watcher
        });
        Hooks { watcher, interrupt: Arc::clone(&self.interrupt) }
    }
}
