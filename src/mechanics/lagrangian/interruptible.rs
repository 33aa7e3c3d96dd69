//! Models that a flag ends.

use super::{EulerLagrange, Manifold, MechanicsError, MetricJet, Request, Terms};
use crate::scalar::{Dd, Scalar};
use std::sync::atomic::{AtomicBool, Ordering};

/// The same model; once the flag was raised it fails everywhere with [`MechanicsError::Interrupted`], which ends whatever follows its
/// motion at the next evaluation. The energy of states that are there is still to be had.
pub(crate) struct Interruptible<'a, S> {
    model: &'a dyn EulerLagrange<S>,
    flag: &'a AtomicBool,
}

impl<'a, S> Interruptible<'a, S> {
    /// The model under a flag.
    pub fn new(model: &'a dyn EulerLagrange<S>, flag: &'a AtomicBool) -> Self {
        Self { model, flag }
    }
}

impl<S: Scalar> EulerLagrange<S> for Interruptible<'_, S> {
    fn coordinates(&self) -> usize {
        self.model.coordinates()
    }

    fn terms(&self, q: &[S], v: &[S], request: Request, terms: &mut Terms<S>) -> Result<(), MechanicsError> {
        if request != Request::ENERGY && self.flag.load(Ordering::Relaxed) {
            terms.clear();
            return Err(MechanicsError::Interrupted);
        }
        self.model.terms(q, v, request, terms)
    }

    fn metric_jets(&self, q: &[S], v: &[S]) -> Result<Vec<MetricJet<S>>, MechanicsError> {
        self.model.metric_jets(q, v)
    }

    fn wide_metric_jets(&self, q: &[S], v: &[S]) -> Result<Option<Vec<MetricJet<Dd>>>, MechanicsError> {
        self.model.wide_metric_jets(q, v)
    }

    fn manifold(&self) -> Option<&dyn Manifold<S>> {
        self.model.manifold()
    }

    fn conserves_energy(&self) -> bool {
        self.model.conserves_energy()
    }

    fn prefers_batches(&self) -> bool {
        self.model.prefers_batches()
    }
}
