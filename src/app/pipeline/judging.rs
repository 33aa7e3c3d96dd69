//! Progress and cancellation of the work on a finished model: it reports its progress, and the flag of its [`Watch`] ends it.

use crate::lagrangian::{EulerLagrange, MechanicsError, Request, Slopes, Terms};
use crate::network::NetworkLagrangian;
use crate::network::file::Header;
use crate::pipeline::thresholds::EVALUATIONS_PER_REPORT;
use crate::pipeline::{Event, PipelineError, Watch};
use crate::training::{Epoch, StopReason};
use std::sync::atomic::{AtomicU64, Ordering};

/// A trained model whose test was interrupted.
#[derive(Debug)]
pub struct Unjudged {
    /// Header of the model.
    pub header: Header,
    /// The model.
    pub network: NetworkLagrangian<f64>,
    /// One row per epoch.
    pub history: Vec<Epoch>,
    /// Why learning ended.
    pub stop: StopReason,
}

/// Reports progress and checks the interrupt flag.
#[derive(Debug)]
pub(crate) struct Judging<'a> {
    watch: &'a Watch,
    /// `true` if the interrupt flag is respected.
    counts: bool,
    pieces: usize,
    done: AtomicU64,
    evaluations: AtomicU64,
}

impl<'a> Judging<'a> {
    /// Starts `pieces` pieces of work. A flag that was raised earlier is ignored, because it ended the training.
    pub fn new(watch: &'a Watch, pieces: usize) -> Self {
        let counts = !watch.is_interrupted();
        watch.say(Event::Judged { done: 0, total: pieces });
        Self { watch, counts, pieces, done: AtomicU64::new(0), evaluations: AtomicU64::new(0) }
    }

    /// Reports `pieces` more finished pieces.
    pub fn advance(&self, pieces: usize) {
        let done = self.done.fetch_add(pieces as u64, Ordering::Relaxed) as usize + pieces;
        self.watch.say(Event::Judged { done, total: self.pieces });
    }

    /// `true` if the flag was raised in the meantime.
    pub fn is_interrupted(&self) -> bool {
        self.counts && self.watch.is_interrupted()
    }

    /// Continues unless the flag was raised.
    ///
    /// # Errors
    /// [`PipelineError::Interrupted`].
    pub fn check(&self) -> Result<(), PipelineError> {
        if self.is_interrupted() { Err(PipelineError::Interrupted) } else { Ok(()) }
    }

    /// Wraps a model so that it fails everywhere once the flag is raised, which ends any integration.
    pub fn watched<'b>(&'b self, model: &'b dyn EulerLagrange<f64>) -> Watched<'b> {
        Watched { model, judging: self }
    }
}

/// A model wrapped by [`Judging`].
pub(crate) struct Watched<'a> {
    model: &'a dyn EulerLagrange<f64>,
    judging: &'a Judging<'a>,
}

impl EulerLagrange<f64> for Watched<'_> {
    fn coordinates(&self) -> usize {
        self.model.coordinates()
    }

    fn terms(&self, q: &[f64], v: &[f64], request: Request, terms: &mut Terms<f64>) -> Result<(), MechanicsError> {
        let Judging { watch, evaluations, .. } = self.judging;
        let before = evaluations.fetch_add(1, Ordering::Relaxed);
        if before % EVALUATIONS_PER_REPORT == 0 {
            watch.say(Event::Evaluations(before));
        }
        if self.judging.is_interrupted() {
            terms.clear();
            return Err(MechanicsError::Interrupted);
        }
        self.model.terms(q, v, request, terms)
    }

    fn slopes(&self) -> Option<Box<dyn Slopes<f64> + '_>> {
        self.model.slopes()
    }

    fn inner(&self) -> Option<&dyn EulerLagrange<f64>> {
        Some(self.model)
    }
}
