//! Derivatives of the equations of motion as programs.

use super::rate::Rate;
use super::{Held, Products, Slopes};
use crate::lagrangian::MechanicsError;
use crate::scalar::{Real, Scalar, update};
use crate::tape::{Program, ROWS, Replay, Tracer};
use alloc::sync::Arc;
use alloc::vec::Vec;

/// Programs of one part of the equations.
#[derive(Clone, Debug)]
pub(crate) struct SlopePrograms<S> {
    /// Numbers of coordinates and of constraints in this part.
    size: (usize, usize),
    /// Nonzero elements of `df/d(q, v)` and their positions: row, and column among `2 n`.
    matrices: Arc<Program<S>>,
    places: Arc<[(usize, usize)]>,
    /// Derivatives of `weights.f` by the state and the parameters.
    products: Arc<Program<S>>,
}

impl<S: Scalar> SlopePrograms<S> {
    /// Records the programs of a part with this rate; returns `None` if they are too large.
    pub(crate) fn of(rate: &Rate<S>) -> Option<Self> {
        let ((n, m), k) = (rate.size, rate.parameters());
        let mut places = Vec::new();
        let matrices = Program::record_within(ROWS, (3 * n + m, k), |x, p| {
            let mut outputs = Vec::new();
            for (i, row) in rate.slopes(x, p, &[])?.into_iter().enumerate() {
                for (j, x) in row {
                    places.push((i, j));
                    outputs.push(x);
                }
            }
            Some(outputs)
        });
        // weights.f as a function of q, v, a, lambda, weights, parameters.
        let state = 3 * n + m;
        let weighted = Program::<S>::record_within(ROWS, (state + n + m + k, 0), |x, _| {
            let (x, weights) = x.split_at(state);
            let terms = rate.equations(x, &weights[n + m..])?.into_iter().zip(weights).map(|(f, &weight)| weight * f);
            Some(vec![terms.fold(Tracer::zero(), |sum, term| sum + term)])
        });
        let weighted = weighted.ok()?;
        let products = Program::record_within(ROWS, (state + n + m, k), |x, p| {
            let first = weighted.derivatives(&[x, p].concat(), &[], None)?.first;
            Some([&first[..2 * n], &first[state + n + m..]].concat())
        });
        let (matrices, products) = (Arc::new(matrices.ok()?), Arc::new(products.ok()?));
        Some(Self { size: (n, m), matrices, places: places.into(), products })
    }

    /// Returns the number of operations per state.
    #[cfg(test)]
    pub(crate) fn operations(&self) -> usize {
        self.matrices.lane_operations()
    }
}

/// Evaluates [`Slopes`] of a part with its programs.
pub(crate) struct ProgramSlopes<S> {
    programs: SlopePrograms<S>,
    matrices: Replay<S>,
    products: Replay<S>,
    parameters: Vec<S>,
    elements: Vec<S>,
    weights: Vec<S>,
    sums: [Vec<S>; 3],
}

impl<S: Scalar> ProgramSlopes<S> {
    /// Allocates buffers for programs; `parameters` are those of the recorded functions.
    pub fn new(programs: SlopePrograms<S>, parameters: &[S]) -> Self {
        Self {
            matrices: Replay::new(Arc::clone(&programs.matrices)),
            products: Replay::new(Arc::clone(&programs.products)),
            programs,
            parameters: parameters.to_vec(),
            elements: Vec::new(),
            weights: Vec::new(),
            sums: Default::default(),
        }
    }
}

impl<S: Scalar> Slopes<S> for ProgramSlopes<S> {
    fn add_matrices(&mut self, held: &Held<'_, S>, matrices: &mut [S]) -> Result<(), MechanicsError> {
        let SlopePrograms { size: (n, m), ref places, .. } = self.programs;
        let ((q, v), count) = (held.state, places.len());
        if q.is_empty() || count == 0 {
            return Ok(());
        }
        self.elements.resize(q.len() / n * count, S::nan());
        let inputs = [q, v, held.a, if m > 0 { held.multipliers } else { &[] }];
        let done = self.matrices.evaluate(q.len() / n, &inputs, &self.parameters, &mut [&mut self.elements]);
        done.map_err(|_| MechanicsError::Derivatives { what: "equations of motion" })?;
        let width = (n + held.constraints) * 2 * n;
        for (matrix, elements) in matrices.chunks_exact_mut(width).zip(self.elements.chunks_exact(count)) {
            for (&(i, j), &x) in places.iter().zip(elements) {
                matrix[i * 2 * n + j] += x;
            }
        }
        Ok(())
    }

    fn add_products(
        &mut self,
        held: &Held<'_, S>,
        weights: &[S],
        products: &mut Products<'_, S>,
    ) -> Result<(), MechanicsError> {
        let ((n, m), (q, v), k) = (self.programs.size, held.state, self.parameters.len());
        if q.is_empty() {
            return Ok(());
        }
        let batch = q.len() / n;
        self.weights.clear();
        weights.chunks_exact(n + held.constraints).for_each(|all| self.weights.extend_from_slice(&all[..n + m]));
        for (field, width) in self.sums.iter_mut().zip([n, n, k]) {
            field.resize(batch * width, S::nan());
        }
        let inputs = [q, v, held.a, if m > 0 { held.multipliers } else { &[] }, &self.weights];
        let mut outputs = self.sums.each_mut().map(Vec::as_mut_slice);
        let done = self.products.evaluate(batch, &inputs, &self.parameters, &mut outputs);
        done.map_err(|_| MechanicsError::Derivatives { what: "equations of motion" })?;
        let [by_q, by_v, by_parameters] = &self.sums;
        update(products.by_q, by_q, |sum, x| *sum += x);
        update(products.by_v, by_v, |sum, x| *sum += x);
        by_parameters.chunks_exact(k.max(1)).for_each(|by| products.add_parameters(by));
        Ok(())
    }
}
