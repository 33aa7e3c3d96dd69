//! Simplified Newton method, which keeps its matrix as long as it converges and iterates down to rounding errors.

use super::StepFailure;
use super::phase::{Defect, PhaseSpace, singular};
use super::thresholds::{MOST_NEWTON_ITERATIONS, MOST_NEWTON_MATRICES, NEWTON_PATIENCE, NEWTON_ROUNDINGS};
use crate::linalg::{LANES, solve};
use crate::scalar::{Real, Scalar};

/// The equations `F(x) = 0` of one step.
pub(super) trait Equations<S: Scalar> {
    /// Writes `F(x)` to `residual`, and returns its size.
    fn residual(
        &mut self,
        phase: &mut PhaseSpace<'_, S>,
        x: &[S],
        residual: &mut [S],
    ) -> Result<Defect<S>, StepFailure>;
    /// Writes an approximation of `dF/dx` at `x`, row-major.
    fn jacobian(&mut self, phase: &mut PhaseSpace<'_, S>, x: &[S], matrix: &mut [S]) -> Result<(), StepFailure>;
    /// Returns the change of unknown `i` caused by rounding of the inputs of the equations, including the coordinates: the force of a stiff
    /// spring has no higher accuracy.
    fn rounding(&self, n: usize, x: &[S], i: usize) -> S;
}

/// Returns the change of an unknown velocity in `x` that follows from rounding of the velocities and of the coordinates `q`, over a step
/// `h`.
pub(super) fn rounding<S: Scalar>(q: &[S], h: S, x: &[S], i: usize) -> S {
    S::epsilon() * (x[i].abs() + q[i % q.len()].abs() / h.abs())
}

/// The inverse of an iteration matrix and a measure of its convergence.
#[derive(Clone, Debug)]
pub(super) struct SimplifiedNewton<S> {
    inverse: Vec<S>,
    /// Smallest number of evaluations in a step with this matrix.
    least: usize,
    stale: bool,
    residual: Vec<S>,
    matrix: Vec<S>,
    unit: Vec<S>,
}

impl<S: Scalar> SimplifiedNewton<S> {
    /// Creates a solver for `size` unknowns, without a matrix.
    pub(super) fn new(size: usize) -> Self {
        let zero = <S as Real>::zero();
        Self {
            inverse: vec![zero; size * size],
            least: MOST_NEWTON_ITERATIONS,
            stale: true,
            residual: vec![zero; size],
            matrix: vec![zero; size * size],
            unit: Vec::new(),
        }
    }

    /// Discards the matrix, for another step size or position.
    pub(super) fn forget(&mut self) {
        self.stale = true;
    }

    /// Solves the equations, starting from the guess in `x`; on success the last call of [`Equations::residual`] was at the solution.
    ///
    /// The iteration ends when it no longer halves the residual, and the residual or its correction is at the level of rounding. It does
    /// not end at a tolerance, because that would leave errors of one sign, which cause a drift (Hairer, McLachlan and Razakarivony 2008).
    ///
    /// # Errors
    /// Those of the equations; [`StepFailure::NotConverged`]; a singular matrix.
    pub(super) fn solve(
        &mut self,
        phase: &mut PhaseSpace<'_, S>,
        equations: &mut impl Equations<S>,
        x: &mut [S],
    ) -> Result<(), StepFailure> {
        let size = x.len();
        let (mut matrices, mut best) = (0, Defect::unknown());
        if self.stale {
            self.refresh(phase, equations, x)?;
            matrices = 1;
        }
        for iteration in 1..=MOST_NEWTON_ITERATIONS {
            let defect = equations.residual(phase, x, &mut self.residual)?;
            phase.iterations += 1;
            let improves = defect.improves(best);
            if defect.is_rounding() || (!improves && (defect.is_small() || self.is_settled(phase.n, equations, x))) {
                self.least = self.least.min(iteration);
                self.stale = matrices > 1 || iteration > self.least + NEWTON_PATIENCE;
                return Ok(());
            }
            let failed = StepFailure::NotConverged { iterations: iteration, residual: defect.overall.to_f64() };
            if iteration == MOST_NEWTON_ITERATIONS {
                return Err(failed);
            }
            if !improves {
                if matrices == MOST_NEWTON_MATRICES {
                    return Err(failed);
                }
                self.refresh(phase, equations, x)?;
                matrices += 1;
            }
            best = best.best(defect);
            (0..size).for_each(|i| x[i] -= self.correction(i));
        }
        Ok(())
    }

    /// Returns the correction of unknown `i` for the residual.
    fn correction(&self, i: usize) -> S {
        let row = &self.inverse[i * self.residual.len()..][..self.residual.len()];
        row.iter().zip(&self.residual).fold(<S as Real>::zero(), |sum, (&a, &r)| a.mul_add(r, sum))
    }

    /// Returns `true` if the correction for the residual is below the rounding of the unknowns, however large the residual is relative to
    /// cancelling terms.
    fn is_settled(&self, n: usize, equations: &impl Equations<S>, x: &[S]) -> bool {
        (0..x.len()).all(|i| self.correction(i).abs() <= S::of_f64(NEWTON_ROUNDINGS) * equations.rounding(n, x, i))
    }

    /// Computes and inverts a new matrix at `x`.
    fn refresh(
        &mut self,
        phase: &mut PhaseSpace<'_, S>,
        equations: &mut impl Equations<S>,
        x: &[S],
    ) -> Result<(), StepFailure> {
        let size = x.len();
        (self.stale, self.least) = (true, MOST_NEWTON_ITERATIONS);
        equations.jacobian(phase, x, &mut self.matrix)?;
        if size == 1 {
            if self.matrix[0] == <S as Real>::zero() {
                return Err(StepFailure::Model(crate::lagrangian::MechanicsError::Singular {
                    row: 0,
                    condition: f64::INFINITY,
                }));
            }
            self.inverse[0] = self.matrix[0].recip();
        } else {
            // Columns of the inverse, one block of lanes at a time.
            let width = size.min(LANES);
            let matrices = self.matrix.repeat(width);
            let mut columns = vec![<S as Real>::zero(); width * size];
            for start in (0..size).step_by(width) {
                let count = width.min(size - start);
                self.unit.clear();
                self.unit.resize(count * size, <S as Real>::zero());
                for k in 0..count {
                    self.unit[k * size + start + k] = <S as Real>::one();
                }
                let columns = &mut columns[..count * size];
                let matrices = &matrices[..count * size * size];
                solve(size, matrices, &self.unit, columns, &mut phase.workspace).map_err(singular)?;
                for k in 0..count {
                    for i in 0..size {
                        self.inverse[i * size + start + k] = columns[k * size + i];
                    }
                }
            }
        }
        self.stale = false;
        Ok(())
    }
}
