//! Derivatives of the equations of motion as programs, recorded from the functions that the equations follow from.
//!
//! Along the motion a Lagrangian has the rate `w.dL/dq + a.dL/dv`, `w = v`. With a dissipation function `D`, with the rows `A` of constraints,
//! their multipliers `lambda` and weights `y` of their second derivatives,
//!
//! ```text
//! R(q, v, w, a, lambda, y) = w.dL/dq + a.dL/dv + D + lambda.(A w) - y.(A a + gamma)
//! ```
//!
//! holds all equations of motion:
//!
//! ```text
//! g - c - M a - dD/dv + A^T lambda = dR/dw - dR/dv,    -(A a + gamma) = dR/dy.
//! ```
//!
//! All their derivatives are therefore second derivatives of `R`. The Lagrangian, the friction and the constraints have programs of their own.

use super::{Held, Products, Slopes};
use crate::forward::{Dual, HyperDual};
use crate::lagrangian::{Constraints, MechanicsError};
use crate::scalar::{Real, Scalar, update};
use crate::tape::{Directions, Program, ROWS, Replay, TANGENTS, Tracer};
use std::collections::BTreeMap;
use std::sync::Arc;

/// Programs of one part of `R`.
#[derive(Clone, Debug)]
pub(crate) struct SlopePrograms<S> {
    /// Numbers of coordinates, and of constraints that the part knows.
    size: (usize, usize),
    /// Of the elements of `df/d(q, v)` that are not zero, and where they stand: row and column of `2 n`.
    matrices: Arc<Program<S>>,
    places: Arc<[(usize, usize)]>,
    /// Of the derivatives of `weights.f` by the state and the parameters.
    products: Arc<Program<S>>,
}

/// Inputs of a rate `R`: `q`, `v`, `w`, `a`, `lambda`, `y`, parameters.
struct Inputs {
    n: usize,
    m: usize,
}

impl Inputs {
    /// Number before the parameters.
    fn count(&self) -> usize {
        4 * self.n + 2 * self.m
    }

    /// The inputs at a state that moves: `x` holds `q`, `v`, `a`, `lambda`, and `y` is zero.
    fn at_motion<R: Real>(&self, x: &[R], parameters: &[R]) -> Vec<R> {
        let n = self.n;
        [&x[..2 * n], &x[n..3 * n + self.m], &vec![R::zero(); self.m], parameters].concat()
    }

    /// The equations from the derivatives of `R` by all inputs; those of the constraints below.
    fn equation<T>(&self, i: usize, by: impl Fn(usize) -> T, less: impl Fn(T, T) -> T) -> T {
        match i.checked_sub(self.n) {
            None => less(by(2 * self.n + i), by(self.n + i)),
            Some(row) => by(4 * self.n + self.m + row),
        }
    }
}

impl<S: Scalar> SlopePrograms<S> {
    /// Of the Lagrangian with this value; `None` if they are too large.
    pub(crate) fn of_lagrangian(value: &Program<S>) -> Option<Self> {
        let (n, k) = (value.inputs() / 2, value.parameters());
        let rate = Program::record_within(ROWS, (4 * n + k, 0), |x, _| {
            // The coordinates move along `w`, the velocities along `a`.
            let moving = x[..2 * n].iter().zip(&x[2 * n..]).map(|(&value, &tangent)| Dual { value, tangent });
            let parameters: Vec<_> = x[4 * n..].iter().map(|&p| Dual::lift(p)).collect();
            Some(vec![value.interpret(&moving.collect::<Vec<_>>(), &parameters).ok()?[0].tangent])
        });
        Self::of_rate((n, 0), &rate.ok()?, true)
    }

    /// Of the dissipation function with this value.
    pub(crate) fn of_dissipation(value: &Program<S>) -> Option<Self> {
        let (n, k) = (value.inputs() / 2, value.parameters());
        let rate = Program::record_within(ROWS, (4 * n + k, 0), |x, _| value.interpret(&x[..2 * n], &x[4 * n..]).ok());
        Self::of_rate((n, 0), &rate.ok()?, true)
    }

    /// Of those rows of constraints with these numbers; `shared` if their parameters are the Lagrangian's.
    pub(crate) fn of_constraints(
        constraints: &impl Constraints,
        (all, kept): (usize, &[usize]),
        parameters: &[S],
        shared: bool,
    ) -> Option<Self> {
        let (n, m) = (constraints.coordinates(), kept.len());
        let (inputs, k) = (Inputs { n, m }, if shared { parameters.len() } else { 0 });
        let rate = Program::record_within(ROWS, (inputs.count() + k, 0), |x, _| {
            let own: Vec<_> = match shared {
                true => x[inputs.count()..].to_vec(),
                false => parameters.iter().map(|&p| Tracer::constant(p)).collect(),
            };
            let (zero, at) = (Tracer::zero(), |field: usize, i: usize| x[field * n + i]);
            let p: Vec<_> = own.iter().map(|&p| Dual::lift(p)).collect();
            let mut sum = zero;
            // Of a function the row is the gradient by the coordinates, of a row that is linear in the velocities by those.
            for holonomic in [true, false] {
                let along = |field: usize, moves: bool| -> Vec<_> {
                    let tangent = |i: usize| if moves { at(2, i) } else { zero };
                    (0..n).map(|i| Dual { value: at(field, i), tangent: tangent(i) }).collect()
                };
                let (q, v) = (along(0, holonomic), along(1, !holonomic));
                let mut values = vec![Dual::lift(zero); all];
                constraints.values(&p, &q, &v, &mut values);
                for (c, &row) in kept.iter().enumerate().filter(|(_, row)| constraints.is_holonomic(**row) == holonomic)
                {
                    sum += x[4 * n + c] * values[row].tangent;
                }
            }
            let p: Vec<_> = own.iter().map(|&p| HyperDual::new(p, zero, zero, zero)).collect();
            let q: Vec<_> = (0..n).map(|i| HyperDual::new(at(0, i), at(1, i), at(1, i), at(3, i))).collect();
            let v: Vec<_> = (0..n).map(|i| HyperDual::new(at(1, i), at(3, i), zero, zero)).collect();
            let mut values = vec![HyperDual::new(zero, zero, zero, zero); all];
            constraints.values(&p, &q, &v, &mut values);
            for (c, &row) in kept.iter().enumerate() {
                let second = if constraints.is_holonomic(row) { values[row].st } else { values[row].s };
                sum -= x[4 * n + m + c] * second;
            }
            Some(vec![sum])
        });
        let symmetric = kept.iter().all(|&row| constraints.is_holonomic(row));
        Self::of_rate((n, m), &rate.ok()?, symmetric)
    }

    /// Operations of a state.
    #[cfg(test)]
    pub(crate) fn operations(&self) -> usize {
        self.matrices.lane_operations()
    }
    /// Of a rate `R`, whose `d2R/dw dq` may be known to be symmetric.
    fn of_rate((n, m): (usize, usize), rate: &Program<S>, symmetric: bool) -> Option<Self> {
        let inputs = Inputs { n, m };
        let k = rate.inputs() - inputs.count();
        let mut places = Vec::new();
        let matrices = Program::record_within(ROWS, (3 * n + m, k), |x, p| {
            // Velocities move along the first directions, coordinates along the others.
            let seed = |input: usize| match input / n {
                0 => vec![((n + input) as u32, Tracer::one())],
                1 => vec![((input - n) as u32, Tracer::one())],
                _ => Vec::new(),
            };
            // The last direction of an input: of symmetric blocks the lower triangle is enough.
            let last = |input: usize| match (input / n, input.checked_sub(4 * n + m)) {
                (_, Some(y)) => (y < m).then_some(2 * n - 1),
                (0, _) => Some(n - 1),
                (1, _) => Some(input - n),
                (2, _) => Some(if symmetric { input - n } else { 2 * n - 1 }),
                _ => None,
            };
            let directions = Directions {
                seeds: (0..rate.inputs()).map(seed).collect(),
                rows: (0..rate.inputs()).map(|input| last(input).map(|last| last as u32)).collect(),
                shared: 2 * n as u32,
                budget: TANGENTS,
            };
            let second = rate.derivatives(&inputs.at_motion(x, p), &[], Some(&directions))?.second;
            let mut rows: Vec<BTreeMap<usize, Tracer<'_, S>>> = vec![BTreeMap::new(); n + m];
            let mut add = |i: usize, j: usize, x| {
                rows[i].entry(j).and_modify(|sum| *sum += x).or_insert(x);
            };
            for (input, elements) in second.into_iter().enumerate() {
                for (direction, x) in elements {
                    let direction = direction as usize;
                    let (moves, j) = (direction >= n, direction % n);
                    match (input / n, input.checked_sub(4 * n + m)) {
                        (_, Some(y)) => add(n + y, if moves { j } else { n + j }, x),
                        // -d2R/dv dq.
                        (0, _) => add(j, input, -x),
                        // -d2R/dv dv.
                        (1, _) => {
                            add(input - n, n + j, -x);
                            if j < input - n {
                                add(j, input, -x);
                            }
                        }
                        // d2R/dw dq.
                        (_, _) if moves => {
                            add(input - 2 * n, j, x);
                            if symmetric && j < input - 2 * n {
                                add(j, input - 2 * n, x);
                            }
                        }
                        // d2R/dw dv and, as w moves with v, -d2R/dv dw.
                        (_, _) => {
                            add(input - 2 * n, n + j, x);
                            add(j, input - n, -x);
                        }
                    }
                }
            }
            let mut outputs = Vec::new();
            for (i, row) in rows.into_iter().enumerate() {
                for (j, x) in row.into_iter().filter(|(_, x)| !x.is_exact_zero()) {
                    places.push((i, j));
                    outputs.push(x);
                }
            }
            Some(outputs)
        });
        // weights.f, of the inputs q, v, a, lambda, weights, parameters.
        let state = 3 * n + m;
        let weighted = Program::<S>::record_within(ROWS, (state + n + m + k, 0), |x, _| {
            let first = rate.derivatives(&inputs.at_motion(&x[..state], &x[state + n + m..]), &[], None)?.first;
            let terms = (0..n + m).map(|i| x[state + i] * inputs.equation(i, |input| first[input], |a, b| a - b));
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
}

/// [`Slopes`] of a part by its programs.
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
    /// Buffers for programs; `parameters` those that the recorded functions take.
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
