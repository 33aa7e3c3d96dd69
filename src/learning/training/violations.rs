//! Gradients of penalties: collects mixed directions of the states that violate, and evaluates them in full chunks.

use crate::linalg::Violation;
use crate::network::{Dynamics, Model};
use crate::scalar::{Scalar, Sum};
use crate::tape::{Depth, MixedDirections, STATES};

/// States whose mass matrices have a penalty, and the directions of its gradient.
pub(crate) struct Violations<S> {
    model: Model<S>,
    /// Created when the first violation occurs.
    dynamics: Option<Dynamics<S>>,
    q: Vec<S>,
    v: Vec<S>,
    directions: MixedDirections<S>,
    /// Directions of the current states.
    chunk: MixedDirections<S>,
    /// Penalties with their weights.
    pub penalty: Sum<S>,
    /// States with a penalty.
    pub count: usize,
}

impl<S: Scalar> Violations<S> {
    pub fn new(model: &Model<S>) -> Self {
        Self {
            model: model.clone(),
            dynamics: None,
            q: Vec::new(),
            v: Vec::new(),
            directions: MixedDirections::default(),
            chunk: MixedDirections::default(),
            penalty: Sum::default(),
            count: 0,
        }
    }

    /// Resets the sums.
    pub fn reset(&mut self) {
        (self.penalty, self.count) = (Sum::default(), 0);
        self.q.clear();
        self.v.clear();
        self.directions.clear(false);
    }

    /// Adds the violation of a state `(q, v)` and stores its directions: `G = sum gamma u u^T` has `s = lambda gamma u`, `t = u`.
    pub fn push(&mut self, (q, v): (&[S], &[S]), violation: &Violation<S>, lambda: S) {
        if violation.gamma.is_empty() {
            return;
        }
        self.penalty.add(lambda * violation.value);
        self.count += 1;
        for (&gamma, u) in violation.gamma.iter().zip(violation.vectors.chunks_exact(q.len())) {
            self.q.extend_from_slice(q);
            self.v.extend_from_slice(v);
            self.directions.s.extend(u.iter().map(|&u| lambda * gamma * u));
            self.directions.t.extend_from_slice(u);
        }
    }

    /// Adds the gradients of the stored states: all of them if `all`, otherwise only full chunks.
    pub fn add_gradient(&mut self, weights: &[S], all: bool, gradient: &mut [S]) {
        let width = STATES * self.model.coordinates();
        while self.q.len() >= width || (all && !self.q.is_empty()) {
            let from = self.q.len() - width.min(self.q.len());
            let dynamics = self.dynamics.get_or_insert_with(|| Dynamics::new(&self.model));
            dynamics.evaluate(weights, &self.q[from..], &self.v[from..], Depth::Training, false);
            self.chunk.clear(false);
            self.chunk.s.extend(self.directions.s.drain(from..));
            self.chunk.t.extend(self.directions.t.drain(from..));
            self.q.truncate(from);
            self.v.truncate(from);
            dynamics.add_gradient(weights, &self.chunk, gradient, None);
        }
    }
}
