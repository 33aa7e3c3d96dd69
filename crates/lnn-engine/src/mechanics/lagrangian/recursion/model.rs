//! A chain of links as a model: terms from its Lagrangian, accelerations and forces of single states by recursion.

use super::{Chain, Passes, Shape};
use crate::forward::Dual;
use crate::lagrangian::accelerations::RecordMotion;
use crate::lagrangian::elimination::Balance;
use crate::lagrangian::linearization::SparseRows;
use crate::lagrangian::{EulerLagrange, MechanicsError, Request, Slopes, Solved, Terms};
use crate::platform::OnceLock;
use crate::scalar::{Real, Scalar};
use crate::tape::Tracer;
use alloc::boxed::Box;
use alloc::collections::BTreeMap;
use alloc::sync::Arc;
use alloc::vec::Vec;

/// A model of a chain of links that uses recursive algorithms.
pub(in crate::mechanics::lagrangian) struct Recursive<S> {
    model: Box<dyn EulerLagrange<S>>,
    chain: Chain<S>,
    shape: Arc<Shape>,
    parameters: Vec<S>,
    /// The program of the accelerations, recorded on first use.
    solved: OnceLock<Option<Solved<'static, S>>>,
}

impl<S: Scalar> Recursive<S> {
    /// Combines the models of a chain's Lagrangian and friction.
    pub(in crate::mechanics::lagrangian) fn new(
        model: Box<dyn EulerLagrange<S>>,
        shape: &Arc<Shape>,
        parameters: &[S],
    ) -> Self {
        let chain = Chain::new(shape, parameters);
        Self { model, chain, shape: Arc::clone(shape), parameters: parameters.to_vec(), solved: OnceLock::new() }
    }

    /// Records the accelerations, including the elimination of the mass matrix. Constant parts are computed during recording.
    fn solve(&self) -> Option<Solved<'static, S>> {
        let recursion = Recursion { shape: Arc::clone(&self.shape), parameters: self.parameters.clone() };
        Solved::record(Arc::new(recursion), self.shape.coordinates, &[], usize::MAX)
    }
}

/// The equations of motion, computed recursively.
#[derive(Debug)]
struct Recursion<S> {
    shape: Arc<Shape>,
    parameters: Vec<S>,
}

impl<S: Scalar> RecordMotion<S> for Recursion<S> {
    fn record<'t>(&self, state: &[Tracer<'t, S>], _: &[Tracer<'t, S>]) -> Option<Balance<Tracer<'t, S>>> {
        let n = self.shape.coordinates;
        let constants: Vec<_> = self.parameters.iter().map(|&value| Tracer::constant(value)).collect();
        let (chain, (q, v)) = (Chain::new(&self.shape, &constants), state.split_at(n));
        let (still, mut right) = (vec![Tracer::zero(); n], vec![Tracer::zero(); n]);
        chain.inverse_dynamics([q, v, &still], &mut Passes::default(), &mut right);
        for (k, force) in right.iter_mut().enumerate() {
            *force = chain.friction(k, v[k]) - *force;
        }
        let lower = chain.mass_matrix(q).into_iter().enumerate().map(sparse).collect();
        Some(Balance { coordinates: n, lower, right })
    }

    /// Uses forward tangents, which are zero for links closer to the base than the moving joint.
    fn record_slopes<'t>(&self, x: &[Tracer<'t, S>], _: &[Tracer<'t, S>]) -> Option<SparseRows<Tracer<'t, S>>> {
        let n = self.shape.coordinates;
        let constants: Vec<_> = self.parameters.iter().map(|&value| Dual::lift(Tracer::constant(value))).collect();
        let chain = Chain::new(&self.shape, &constants);
        let (mut rows, mut torques) = (vec![BTreeMap::new(); n], vec![Dual::lift(Tracer::zero()); n]);
        let mut state: Vec<_> = x.iter().map(|&x| Dual::lift(x)).collect();
        for column in 0..2 * n {
            state[column].tangent = Tracer::one();
            let [q, v, a] = [0, 1, 2].map(|field| &state[field * n..][..n]);
            chain.inverse_dynamics([q, v, a], &mut Passes::default(), &mut torques);
            for (k, row) in rows.iter_mut().enumerate() {
                let slope = (chain.friction(k, v[k]) - torques[k]).tangent;
                if !slope.is_exact_zero() {
                    row.insert(column, slope);
                }
            }
            state[column].tangent = Tracer::zero();
        }
        Some(rows)
    }

    fn linearized_up_to(&self) -> usize {
        usize::MAX
    }
}

/// Converts a row of a lower triangle to pairs of column and nonzero value, including its diagonal.
fn sparse<R: Real>((k, row): (usize, Vec<R>)) -> Vec<(usize, R)> {
    row.into_iter().enumerate().filter(|(j, m)| *j == k || !m.is_exact_zero()).collect()
}

impl<S: Scalar> EulerLagrange<S> for Recursive<S> {
    fn coordinates(&self) -> usize {
        self.model.coordinates()
    }

    fn terms(&self, q: &[S], v: &[S], request: Request, terms: &mut Terms<S>) -> Result<(), MechanicsError> {
        self.model.terms(q, v, request, terms)
    }

    fn inner(&self) -> Option<&dyn EulerLagrange<S>> {
        Some(&self.model)
    }

    fn solved(&self) -> Option<Solved<'_, S>> {
        self.solved.get_or_init(|| self.solve()).clone()
    }

    fn slopes(&self) -> Option<Box<dyn Slopes<S> + '_>> {
        self.model.slopes()
    }

    fn links(&self) -> Option<&Chain<S>> {
        Some(&self.chain)
    }
}
