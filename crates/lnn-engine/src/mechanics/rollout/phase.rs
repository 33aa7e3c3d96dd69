//! A model in phase space: `p = dL/dv` and `dp/dt = dL/dq + Q` as functions of `(q, v)`, and the inverse map from `p` to `v`. `Q` consists
//! of friction and an external force; it is zero for a model that conserves its energy if no force acts.

use super::force::Piece;
use super::thresholds::{MODEL_ROUNDINGS_LOG2, MOST_VELOCITY_SWEEPS};
use super::{Force, StepFailure};
use crate::lagrangian::{EulerLagrange, Manifold, ManifoldRows, MechanicsError, Request, Terms};
use crate::linalg::{self, LinalgError, Workspace};
use crate::scalar::{Real, Scalar};

/// A model, the buffers of its evaluation, and the results.
pub(super) struct PhaseSpace<'a, S> {
    model: &'a dyn EulerLagrange<S>,
    /// Number of coordinates.
    pub(super) n: usize,
    terms: Terms<S>,
    pub(super) workspace: Workspace<S>,
    /// Number of evaluated states.
    pub(super) evaluations: usize,
    /// Number of iterations of implicit equations.
    pub(super) iterations: usize,
    points: Vec<S>,
    external: Vec<S>,
    /// `true` if some forces do not follow from `L`.
    damped: bool,
    /// `true` if the model depends on the time.
    timed: bool,
    /// Times of the evaluated states.
    times: Vec<S>,
    force: Option<&'a dyn Force<S>>,
    /// Time at the start of the current step, and the piece whose times are valid for the force.
    start: S,
    piece: Option<Piece<S>>,
}

/// First derivatives of `p` and `g = dL/dq + Q` at one state, `(n, n)` each; `d2L/dq dv` is the transpose of `dp/dq`.
#[derive(Clone, Debug, Default)]
pub(super) struct Derivatives<S> {
    /// `M = dp/dv`.
    pub(super) mass: Vec<S>,
    /// `dp_i/dq_j` at `(i, j)`.
    pub(super) mixed: Vec<S>,
    /// `dg_i/dq_j` at `(i, j)`.
    pub(super) stiffness: Vec<S>,
    /// `dQ_i/dv_j` at `(i, j)`; zero for a model that conserves its energy.
    pub(super) damping: Vec<S>,
}

/// The residual of an equation during its solution.
#[derive(Clone, Copy, Debug)]
pub(super) struct Defect<S> {
    /// Largest residual relative to the terms of the same component.
    pub(super) relative: S,
    /// Largest residual relative to the largest of all terms.
    pub(super) overall: S,
}

impl<S: Scalar> Defect<S> {
    /// Returns the defect before the first evaluation.
    pub(super) fn unknown() -> Self {
        Self { relative: S::infinity(), overall: S::infinity() }
    }

    /// Computes the defect of residuals `(rows, n)`, where the terms of component `i` have the size `size(i)`.
    pub(super) fn of(n: usize, residual: &[S], size: impl Fn(usize) -> S) -> Self {
        let zero = <S as Real>::zero();
        let most = (0..n).map(&size).fold(zero, |most, size| S::max(most, size));
        let mut defect = Self { relative: zero, overall: zero };
        for i in 0..n {
            let worst = residual.iter().skip(i).step_by(n).fold(zero, |worst, r| S::max(worst, r.abs()));
            if worst == zero {
                continue;
            }
            defect.relative = S::max(defect.relative, worst / (size(i) + S::epsilon() * most));
            defect.overall = S::max(defect.overall, worst / most);
        }
        defect
    }

    /// Returns `true` if the equation is solved to the last digit.
    pub(super) fn is_rounding(self) -> bool {
        self.relative <= S::epsilon()
    }

    /// Returns `true` if the equation is solved up to the rounding errors of the model.
    pub(super) fn is_small(self) -> bool {
        self.overall <= S::epsilon().ldexp(MODEL_ROUNDINGS_LOG2)
    }

    /// Returns `true` if this is less than half of the best defect so far, in either measure. If it were compared with the last one, an
    /// iteration could alternate between two rounded values forever.
    pub(super) fn improves(self, best: Self) -> bool {
        self.relative < best.relative * S::half() || self.overall < best.overall * S::half()
    }

    /// Returns the larger defect in each measure.
    pub(super) fn worst(self, other: Self) -> Self {
        Self { relative: S::max(self.relative, other.relative), overall: S::max(self.overall, other.overall) }
    }

    /// Returns the smaller defect in each measure.
    pub(super) fn best(self, other: Self) -> Self {
        Self { relative: S::min(self.relative, other.relative), overall: S::min(self.overall, other.overall) }
    }
}

impl<'a, S: Scalar> PhaseSpace<'a, S> {
    pub(super) fn new(model: &'a dyn EulerLagrange<S>, force: Option<&'a dyn Force<S>>) -> Self {
        Self {
            model,
            n: model.coordinates(),
            terms: Terms::default(),
            workspace: Workspace::new(),
            evaluations: 0,
            iterations: 0,
            points: Vec::new(),
            external: Vec::new(),
            damped: !model.conserves_energy() || force.is_some(),
            timed: model.is_timed(),
            times: Vec::new(),
            force,
            start: <S as Real>::zero(),
            piece: None,
        }
    }

    /// Starts a step at time `t`.
    pub(super) fn begin(&mut self, t: S, piece: &Piece<S>) {
        (self.start, self.piece) = (t, Some(*piece));
    }

    /// Sets the time `t` for evaluations between two steps.
    pub(super) fn stop_at(&mut self, t: S) {
        self.start = t;
    }

    /// Moves the time forward by `h`.
    pub(super) fn move_on(&mut self, h: S) {
        self.start += h;
    }

    /// Returns the time of row `row` of a batch: `after[row]` after the start of the step, or `after[0]` for all rows.
    fn time(&self, after: &[S], row: usize) -> S {
        let after = after.get(row).or(after.first()).copied().unwrap_or_else(<S as Real>::zero);
        let t = self.start + after;
        self.piece.map_or(t, |piece| piece.time(t))
    }

    /// Adds the external force to the force of the model; for `after` see [`PhaseSpace::time`].
    fn add_external(&mut self, q: &[S], v: &[S], after: &[S]) -> Result<(), StepFailure> {
        let Some(force) = self.force.filter(|_| self.piece.is_some()) else { return Ok(()) };
        let (n, zero) = (self.n, <S as Real>::zero());
        self.terms.force.resize(q.len(), zero);
        self.external.resize(n, zero);
        for (row, (q, v)) in q.chunks_exact(n).zip(v.chunks_exact(n)).enumerate() {
            force.force(self.time(after, row), q, v, &mut self.external);
            if self.external.iter().any(|x| !x.is_finite()) {
                return Err(StepFailure::Model(MechanicsError::NotFinite { row: 0, what: "external force" }));
            }
            let sums = self.terms.force[row * n..(row + 1) * n].iter_mut();
            sums.zip(&self.external).for_each(|(sum, &force)| *sum += force);
        }
        Ok(())
    }

    /// Evaluates states; `after` is their time after the start of the step, see [`PhaseSpace::time`].
    fn evaluate(&mut self, q: &[S], v: &[S], request: Request, after: &[S]) -> Result<(), StepFailure> {
        if q.iter().chain(v).any(|x| !x.is_finite()) {
            return Err(StepFailure::State);
        }
        self.evaluations += q.len() / self.n;
        let request = if self.damped && request.includes(Request::DL_DQ) { request | Request::FORCE } else { request };
        let outcome = if self.timed {
            let mut times = std::mem::take(&mut self.times);
            times.clear();
            times.extend((0..q.len() / self.n).map(|row| self.time(after, row)));
            self.times = times;
            self.model.terms_at(&self.times, q, v, request, &mut self.terms)
        } else {
            self.model.terms(q, v, request, &mut self.terms)
        };
        outcome.map_err(StepFailure::Model)?;
        if request.includes(Request::FORCE) {
            self.add_external(q, v, after)?;
            self.terms.dl_dq.iter_mut().zip(&self.terms.force).for_each(|(g, &force)| *g += force);
        }
        let fields = [
            (Request::MOMENTUM, "momentum", &self.terms.momentum, 1),
            (Request::DL_DQ, "dL/dq", &self.terms.dl_dq, 1),
            (Request::MASS_MATRIX, "mass matrix", &self.terms.mass_matrix, self.n),
        ];
        for (asked, what, field, width) in fields {
            let expected = q.len() * width;
            if request.includes(asked) && field.len() != expected {
                return Err(StepFailure::Model(MechanicsError::Shape { what, expected, found: field.len() }));
            }
            if request.includes(asked) && field.iter().any(|x| !x.is_finite()) {
                return Err(StepFailure::Model(MechanicsError::NotFinite { row: 0, what }));
            }
        }
        Ok(())
    }

    /// Computes `p` and `g` of a batch, `(batch, n)`, with row `k` at `after[k]` after the start of the step.
    pub(super) fn momenta_and_forces(
        &mut self,
        q: &[S],
        v: &[S],
        after: &[S],
        (p, g): (&mut [S], &mut [S]),
    ) -> Result<(), StepFailure> {
        self.evaluate(q, v, Request::MOMENTUM | Request::DL_DQ, after)?;
        p.copy_from_slice(&self.terms.momentum);
        g.copy_from_slice(&self.terms.dl_dq);
        Ok(())
    }

    /// Computes `p` of one state.
    pub(super) fn momentum(&mut self, q: &[S], v: &[S]) -> Result<Vec<S>, StepFailure> {
        self.evaluate(q, v, Request::MOMENTUM, &[])?;
        Ok(self.terms.momentum.clone())
    }

    /// Computes `M` exactly, and its derivatives by `q` and those of `Q` by `v` by forward differences with the step `sqrt(eps)`, which are
    /// sufficient for an iteration matrix. The differences need one batch of `n + 1` states, or `2n + 1` with friction or an external
    /// force, at the time `after` after the start of the step.
    pub(super) fn derivatives(
        &mut self,
        q: &[S],
        v: &[S],
        after: S,
        into: &mut Derivatives<S>,
    ) -> Result<(), StepFailure> {
        let n = self.n;
        let zero = <S as Real>::zero();
        self.evaluate(q, v, Request::MASS_MATRIX, &[after])?;
        into.mass.clone_from(&self.terms.mass_matrix);
        let shift = |i: usize| {
            let size = S::max(q[i].abs(), v[i].abs());
            S::epsilon().sqrt() * if size > zero { size } else { <S as Real>::one() }
        };
        let mut points = std::mem::take(&mut self.points);
        let rows = if self.damped { 2 * n + 1 } else { n + 1 };
        points.clear();
        (0..rows).for_each(|_| points.extend_from_slice(q));
        (0..rows).for_each(|_| points.extend_from_slice(v));
        let (shifted, velocities) = points.split_at_mut(rows * n);
        for i in 0..n {
            shifted[(1 + i) * n + i] += shift(i);
            if self.damped {
                velocities[(1 + n + i) * n + i] += shift(i);
            }
        }
        let outcome = self.evaluate(shifted, velocities, Request::MOMENTUM | Request::DL_DQ, &[after]);
        for (field, matrix) in [(&self.terms.momentum, &mut into.mixed), (&self.terms.dl_dq, &mut into.stiffness)] {
            matrix.clear();
            matrix.resize(n * n, zero);
            for j in 0..n {
                // The displacement after rounding.
                let width = points[(j + 1) * n + j] - q[j];
                for i in 0..n {
                    if outcome.is_ok() {
                        matrix[i * n + j] = (field[(j + 1) * n + i] - field[i]) / width;
                    }
                }
            }
        }
        into.damping.clear();
        into.damping.resize(n * n, zero);
        if outcome.is_ok() && !self.terms.force.is_empty() {
            let force = &self.terms.force;
            for j in 0..n {
                let width = points[(rows + 1 + n + j) * n + j] - v[j];
                for i in 0..n {
                    into.damping[i * n + j] = (force[(1 + n + j) * n + i] - force[i]) / width;
                }
            }
        }
        self.points = points;
        outcome
    }

    /// Solves `dL/dv(q, v) = p` for `v` by Newton's method, starting from the guess in `v`, to the last digit.
    pub(super) fn velocity(&mut self, q: &[S], p: &[S], v: &mut [S]) -> Result<(), StepFailure> {
        let n = self.n;
        let mut residual = vec![<S as Real>::zero(); n];
        let mut change = residual.clone();
        let mut best = Defect::unknown();
        for sweep in 1..=MOST_VELOCITY_SWEEPS {
            self.evaluate(q, v, Request::MOMENTUM | Request::MASS_MATRIX, &[])?;
            self.iterations += 1;
            for ((r, &found), &wanted) in residual.iter_mut().zip(&self.terms.momentum).zip(p) {
                *r = found - wanted;
            }
            let found = &self.terms.momentum;
            let defect = Defect::of(n, &residual, |i| p[i].abs() + found[i].abs());
            // Solve before the test of convergence, because a momentum that does not depend on the velocity would always pass it.
            linalg::solve_symmetric(n, &self.terms.mass_matrix, &residual, &mut change, &mut self.workspace)
                .map_err(singular)?;
            if defect.is_rounding() || (!defect.improves(best) && defect.is_small()) {
                return Ok(());
            }
            if sweep == MOST_VELOCITY_SWEEPS {
                return Err(StepFailure::NotConverged { iterations: sweep, residual: defect.overall.to_f64() });
            }
            best = best.best(defect);
            v.iter_mut().zip(&change).for_each(|(v, &c)| *v -= c);
        }
        Ok(())
    }
}

impl<'a, S: Scalar> PhaseSpace<'a, S> {
    /// Returns the manifold of states that the constraints allow.
    pub(super) fn manifold(&self) -> Option<&'a dyn Manifold<S>> {
        self.model.manifold()
    }

    /// Solves `dL/dv(q, v) = p + A^T mu` and `A v = b` for `v` by Newton's method, starting from the guess in `v`; returns the impulse `A^T
    /// mu`.
    pub(super) fn land(
        &mut self,
        manifold: &dyn Manifold<S>,
        q: &[S],
        p: &[S],
        v: &mut [S],
    ) -> Result<Vec<S>, StepFailure> {
        let (n, m, zero) = (self.n, manifold.names().len(), <S as Real>::zero());
        let k = n + m;
        let (mut rows, mut push) = (ManifoldRows::default(), vec![zero; n]);
        let (mut matrix, mut right, mut change) = (vec![zero; k * k], vec![zero; k], vec![zero; k]);
        let mut best = Defect::unknown();
        for sweep in 1..=MOST_VELOCITY_SWEEPS {
            self.evaluate(q, v, Request::MOMENTUM | Request::MASS_MATRIX, &[])?;
            self.iterations += 1;
            manifold.rows(q, v, &mut rows);
            for i in 0..n {
                right[i] = (self.terms.momentum[i] - p[i]) - push[i];
                matrix[i * k..i * k + n].copy_from_slice(&self.terms.mass_matrix[i * n..(i + 1) * n]);
                for c in 0..m {
                    matrix[i * k + n + c] = rows.matrix[c * n + i];
                    matrix[(n + c) * k + i] = rows.matrix[c * n + i];
                }
            }
            right[n..].copy_from_slice(&rows.rates);
            let momentum = &self.terms.momentum;
            let of_momenta = Defect::of(n, &right[..n], |i| p[i].abs() + momentum[i].abs() + push[i].abs());
            let size = |c: usize| {
                let terms = rows.matrix[c * n..(c + 1) * n].iter().zip(&*v);
                terms.fold(zero, |sum, (&a, &v)| sum + (a * v).abs()) + rows.rates[c].abs()
            };
            let defect = of_momenta.worst(Defect::of(m, &rows.rates, size));
            linalg::solve(k, &matrix, &right, &mut change, &mut self.workspace).map_err(singular)?;
            if defect.is_rounding() || (!defect.improves(best) && defect.is_small()) {
                return Ok(push);
            }
            if sweep == MOST_VELOCITY_SWEEPS {
                return Err(StepFailure::NotConverged { iterations: sweep, residual: defect.overall.to_f64() });
            }
            best = best.best(defect);
            v.iter_mut().zip(&change).for_each(|(v, &c)| *v -= c);
            for (row, &weight) in rows.matrix.chunks_exact(n).zip(&change[n..]) {
                push.iter_mut().zip(row).for_each(|(push, &a)| *push += weight * a);
            }
        }
        Ok(push)
    }
}

/// Converts a failed solution to a failure of the model.
pub(super) fn singular(error: LinalgError) -> StepFailure {
    StepFailure::Model(match error {
        LinalgError::Singular { condition, .. } => MechanicsError::Singular { row: 0, condition },
        _ => MechanicsError::NotFinite { row: 0, what: "mass matrix" },
    })
}

/// A vector that is updated by small increments with compensated summation.
///
/// The value is `high + low` (Kahan 1965, Moller 1965). Rounding errors of the updates do not accumulate, so that in a long run only the
/// errors of the increments remain, which are smaller by a factor `h`.
#[derive(Clone, Debug)]
pub(super) struct Compensated<S> {
    /// Rounded value.
    pub(super) high: Vec<S>,
    /// Parts lost in rounding.
    pub(super) low: Vec<S>,
}

impl<S: Scalar> Compensated<S> {
    /// Creates an exact value.
    pub(super) fn new(high: Vec<S>) -> Self {
        let low = vec![<S as Real>::zero(); high.len()];
        Self { high, low }
    }

    /// Adds an increment to component `i`.
    #[inline]
    pub(super) fn add(&mut self, i: usize, increment: S) {
        let (high, term) = (self.high[i], self.low[i] + increment);
        let sum = high + term;
        // Knuth's error of a sum, which is valid whichever term is larger.
        let shifted = sum - high;
        self.low[i] = (high - (sum - shifted)) + (term - shifted);
        self.high[i] = sum;
    }
}

/// Coordinates and conjugate momenta `p = dL/dv`.
#[derive(Clone, Debug)]
pub(super) struct PhasePoint<S> {
    pub(super) q: Compensated<S>,
    pub(super) p: Compensated<S>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ten_million_tenths_in_single_precision() {
        let mut sum = Compensated::new(vec![0.0_f32]);
        (0..10_000_000).for_each(|_| sum.add(0, 0.1));
        let exact = f64::from(0.1_f32) * 1e7;
        assert!((f64::from(sum.high[0]) - exact).abs() <= exact * f64::from(f32::EPSILON));
    }
}
