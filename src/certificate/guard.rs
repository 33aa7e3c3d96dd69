//! A model that moves only where its mass matrix is certified.

use super::{Certificate, Verdict};
use crate::lagrangian::{EulerLagrange, MechanicsError, MetricJet, Request, Terms};
use crate::scalar::{Dd, Scalar};

/// A model with a [`Certificate`] that is asked at every state: `dL/dq`, mass matrix and acceleration of a state that is not certified fail
/// with [`MechanicsError::Uncertified`].
///
/// An integrator stops where the certified region ends, as at the bound of a domain, and says so (`RolloutError::Uncertified`): at every
/// state that moved it the mass matrix is proven to have its signature. `L`, momenta and the energy are given everywhere.
#[derive(Clone, Debug)]
pub struct Guarded<'a, M> {
    model: M,
    certificate: &'a Certificate,
}

impl<'a, M> Guarded<'a, M> {
    /// A model and a certificate of its mass matrix.
    pub fn new(model: M, certificate: &'a Certificate) -> Self {
        Self { model, certificate }
    }

    /// The model without its guard.
    pub fn model(&self) -> &M {
        &self.model
    }
}

impl<S: Scalar, M: EulerLagrange<S>> EulerLagrange<S> for Guarded<'_, M> {
    fn coordinates(&self) -> usize {
        self.model.coordinates()
    }

    fn terms(&self, q: &[S], v: &[S], request: Request, terms: &mut Terms<S>) -> Result<(), MechanicsError> {
        let outcome = self.model.terms(q, v, request, terms);
        if !request.includes(Request::MASS_MATRIX) && !request.includes(Request::DL_DQ) {
            return outcome;
        }
        let n = self.coordinates().max(1);
        let mut first = None;
        for (row, (q, v)) in q.chunks_exact(n).zip(v.chunks_exact(n)).enumerate() {
            if !matches!(self.certificate.verdict(q, v), Verdict::Certified { .. }) {
                first = first.or(Some(row));
                if let Some(acceleration) = terms.acceleration.get_mut(row * n..(row + 1) * n) {
                    acceleration.fill(S::nan());
                }
            }
        }
        match (outcome, first) {
            (Err(error), _) => Err(error),
            (Ok(()), Some(row)) => Err(MechanicsError::Uncertified { row }),
            (Ok(()), None) => Ok(()),
        }
    }

    fn metric_jets(&self, q: &[S], v: &[S]) -> Result<Vec<MetricJet<S>>, MechanicsError> {
        self.model.metric_jets(q, v)
    }

    fn wide_metric_jets(&self, q: &[S], v: &[S]) -> Result<Option<Vec<MetricJet<Dd>>>, MechanicsError> {
        self.model.wide_metric_jets(q, v)
    }

    fn conserves_energy(&self) -> bool {
        self.model.conserves_energy()
    }

    fn prefers_batches(&self) -> bool {
        self.model.prefers_batches()
    }
}
