//! The recorded functions of a model, and their evaluation on a chunk of states.

use crate::lagrangian::Lagrangian;
use crate::network::{Architecture, Layout};
use crate::scalar::{Real, Scalar};
use crate::tape::{Depth, Evaluation, MixedDirections, Recorded};
use alloc::sync::Arc;
use alloc::vec::Vec;

/// A recorded model of motion: a Lagrangian, possibly with a Rayleigh dissipation, with one list of parameters.
#[derive(Clone, Debug)]
pub struct Model<S> {
    lagrangian: Arc<Recorded<S>>,
    dissipation: Option<Arc<Recorded<S>>>,
    periodic: Vec<bool>,
    weights: usize,
}

impl<S: Scalar> Model<S> {
    /// Creates a model of `lagrangian`, which shares its scales and parameters with `dissipation`. The `periodic` coordinates are angles
    /// that [`Model::wrap`] reduces to `[0, 2 pi)`.
    pub fn new(lagrangian: Arc<Recorded<S>>, dissipation: Option<Arc<Recorded<S>>>, periodic: Vec<bool>) -> Self {
        let weights = lagrangian.parameters();
        Self { lagrangian, dissipation, periodic, weights }
    }
    /// Declares the parameters after the first `weights` as physical constants, to which weight decay does not apply.
    ///
    /// # Panics
    /// If there are fewer parameters.
    pub fn with_weights(self, weights: usize) -> Self {
        assert!(weights <= self.parameters(), "weights among {} parameters", self.parameters());
        Self { weights, ..self }
    }
    /// Returns the Lagrangian.
    pub fn lagrangian(&self) -> &Arc<Recorded<S>> {
        &self.lagrangian
    }
    /// Returns the dissipation, if there is one.
    pub fn dissipation(&self) -> Option<&Arc<Recorded<S>>> {
        self.dissipation.as_ref()
    }
    /// Returns the number of coordinates `n`.
    pub fn coordinates(&self) -> usize {
        self.lagrangian.coordinates()
    }
    /// Returns the number of parameters.
    pub fn parameters(&self) -> usize {
        self.lagrangian.parameters()
    }
    /// Returns the number of network weights, which are the first parameters.
    pub fn weights(&self) -> usize {
        self.weights
    }
    /// Returns the scales `s_i` of the coordinates.
    pub fn scale(&self) -> &[S] {
        self.lagrangian.scale()
    }
    /// Reduces the periodic coordinates of states `(batch, n)` to `[0, 2 pi)`, the range of the training data.
    pub fn wrap(&self, q: &mut [S]) {
        for row in q.chunks_exact_mut(self.periodic.len()) {
            for (q, _) in row.iter_mut().zip(&self.periodic).filter(|(_, periodic)| **periodic) {
                *q = q.wrap_angle();
            }
        }
    }
    /// Returns the offset among the parameters, rows and columns of every weight matrix of the Lagrangian, in order.
    pub fn matrices(&self) -> Vec<(usize, usize, usize)> {
        self.lagrangian.matrices()
    }
}

impl Architecture {
    /// Records the functions of a network of this shape, as [`Architecture::model`] does.
    pub(super) fn record<S: Scalar>(&self) -> Model<S> {
        let scale = || self.scale.iter().map(|&s| S::of_f64(s)).collect();
        let layout = Layout::new(self);
        let parameters = layout.parameters;
        let record = Recorded::new(scale(), parameters, |p, q, v| self.lagrangian(p, q, v));
        let lagrangian = Arc::new(record.expect("networks read no values"));
        let dissipation = self.has_friction().then(|| {
            let record = Recorded::new(scale(), parameters, |p, q, v| self.rayleigh_dissipation(p, q, v));
            Arc::new(record.expect("dissipations read no values"))
        });
        Model::new(lagrangian, dissipation, self.periodic.clone()).with_weights(layout.joint_friction.start)
    }
}

/// Evaluates a model on chunks of at most [`LANES`](crate::tape::STATES) states, in scaled coordinates; buffers are reused.
#[derive(Debug)]
pub struct Dynamics<S> {
    lagrangian: Evaluation<S>,
    dissipation: Option<Evaluation<S>>,
    /// `v.dD/dv`, `(batch)`.
    power: Vec<S>,
}

impl<S: Scalar> Dynamics<S> {
    /// Allocates the buffers for a model.
    pub fn new(model: &Model<S>) -> Self {
        Self {
            lagrangian: Evaluation::new(Arc::clone(&model.lagrangian)),
            dissipation: model.dissipation.as_ref().map(|recorded| Evaluation::new(Arc::clone(recorded))),
            power: Vec::new(),
        }
    }

    /// Evaluates states `q`, `v`, `(batch, n)`, in physical units with unwrapped angles; friction forces only if `forces` is set.
    pub fn evaluate(&mut self, parameters: &[S], q: &[S], v: &[S], depth: Depth, forces: bool) {
        self.lagrangian.evaluate(parameters, q, v, depth);
        let Some(dissipation) = self.dissipation.as_mut().filter(|_| forces) else { return };
        dissipation.evaluate(parameters, q, v, if depth == Depth::Training { depth } else { Depth::Gradient });
        self.power.clear();
        let scale = dissipation.recorded().scale();
        let n = scale.len();
        let rows = dissipation.momentum.chunks_exact(n).zip(v.chunks_exact(n));
        let zero = <S as Real>::zero();
        self.power.extend(rows.map(|(gradient, v)| {
            let terms = gradient.iter().zip(v).zip(scale);
            let power = terms.fold(zero, |sum, ((&d, &v), &s)| sum + d * (v / s));
            // Friction opposes the velocity, so that negative values are rounding errors.
            if power < zero { zero } else { power }
        }));
    }

    /// Returns the terms of the Lagrangian.
    pub fn lagrangian(&self) -> &Evaluation<S> {
        &self.lagrangian
    }
    /// Returns `dD/d(v/s)`, `(batch, n)`, the negative generalized force, of a model with dissipation.
    pub fn friction(&self) -> Option<&[S]> {
        self.dissipation.as_ref().map(|dissipation| dissipation.momentum.as_slice())
    }
    /// Returns the dissipated power `v.dD/dv`, `(batch)`, which is never negative; empty without dissipation.
    pub fn power(&self) -> &[S] {
        &self.power
    }

    /// Writes the right sides `g - c - dD/d(v/s)` of `M a = ..`, `(batch, n)`, to `right`.
    pub fn right_hand_sides(&self, right: &mut Vec<S>) {
        right.clear();
        right.extend(self.lagrangian.dl_dq.iter().zip(&self.lagrangian.coriolis).map(|(&g, &c)| g - c));
        if let Some(friction) = self.friction() {
            right.iter_mut().zip(friction).for_each(|(right, &friction)| *right -= friction);
        }
    }

    /// Adds the derivative of a sum of mixed coefficients to `gradient`, and of the dissipation's contribution to accelerations: with `s =
    /// -M^-1 u`, `t = a` and moving directions, `u da/dtheta`, and to `inputs` `u da/d(q/s)` and `u da/d(v/s)`.
    ///
    /// The states are those of the last evaluation, which must be to [`Depth::Training`] with forces; all their numbers must be finite.
    pub fn add_gradient(
        &mut self,
        parameters: &[S],
        directions: &MixedDirections<S>,
        gradient: &mut [S],
        mut inputs: Option<(&mut [S], &mut [S])>,
    ) {
        let again = inputs.as_mut().map(|(dq, dv)| (&mut **dq, &mut **dv));
        self.lagrangian.add_gradient(parameters, directions, gradient, again);
        if let (Some(dissipation), true) = (&mut self.dissipation, directions.moving) {
            dissipation.add_momentum_gradient(parameters, directions, gradient, inputs);
        }
    }
}
