//! Progress and cancellation of the work on a finished model: it reports how far it is, and the flag of its [`Watch`] ends it.

use crate::lagrangian::{EulerLagrange, MechanicsError, Request, Terms};
use crate::pipeline::{Event, PipelineError, Watch};
use std::sync::atomic::{AtomicU64, Ordering};

/// Evaluations between two reports.
const OFTEN: u64 = 1024;

/// Reports progress and honours the flag.
#[derive(Debug)]
pub(crate) struct Cancellation<'a> {
    watch: &'a Watch,
    /// `true` if the flag counts.
    counts: bool,
    pieces: usize,
    done: AtomicU64,
    evaluations: AtomicU64,
}

impl<'a> Cancellation<'a> {
    /// Cancellation of so many pieces of work. A flag that was raised before does not count: it ended the training.
    pub fn new(watch: &'a Watch, pieces: usize) -> Self {
        let counts = !watch.is_interrupted();
        watch.say(Event::Judged { done: 0, total: pieces });
        Self { watch, counts, pieces, done: AtomicU64::new(0), evaluations: AtomicU64::new(0) }
    }

    /// So many pieces more are done.
    pub fn advance(&self, pieces: usize) {
        let done = self.done.fetch_add(pieces as u64, Ordering::Relaxed) as usize + pieces;
        self.watch.say(Event::Judged { done, total: self.pieces });
    }

    /// `true` if the flag was raised meanwhile.
    pub fn is_interrupted(&self) -> bool {
        self.counts && self.watch.is_interrupted()
    }

    /// Goes on unless the flag was raised.
    ///
    /// # Errors
    /// [`PipelineError::Interrupted`].
    pub fn check(&self) -> Result<(), PipelineError> {
        if self.is_interrupted() { Err(PipelineError::Interrupted) } else { Ok(()) }
    }

    /// The same model; once the flag was raised it fails everywhere, which ends whatever integrates it.
    pub fn watched<'b>(&'b self, model: &'b dyn EulerLagrange<f64>) -> Watched<'b> {
        Watched { model, cancellation: self }
    }
}

/// A model under [`Cancellation`].
pub(crate) struct Watched<'a> {
    model: &'a dyn EulerLagrange<f64>,
    cancellation: &'a Cancellation<'a>,
}

impl EulerLagrange<f64> for Watched<'_> {
    fn coordinates(&self) -> usize {
        self.model.coordinates()
    }

    fn terms(&self, q: &[f64], v: &[f64], request: Request, terms: &mut Terms<f64>) -> Result<(), MechanicsError> {
        let Cancellation { watch, evaluations, .. } = self.cancellation;
        let before = evaluations.fetch_add(1, Ordering::Relaxed);
        if before % OFTEN == 0 {
            watch.say(Event::Evaluations(before));
        }
        if self.cancellation.is_interrupted() {
            terms.clear();
            return Err(MechanicsError::Interrupted);
        }
        self.model.terms(q, v, request, terms)
    }

    fn inner(&self) -> Option<&dyn EulerLagrange<f64>> {
        Some(self.model)
    }
}
