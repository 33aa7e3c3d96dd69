//! Motion under constraints in the scaled coordinates of a network: rows, multipliers and adjoints.
//!
//! In scaled coordinates `q_i = s_i q'_i` the rows are `A_ci s_i`; each is scaled to unit length, since coordinates and constraints may
//! have any size. [`ConstrainedMotion::motion`] solves `[M A^T; A 0] [a; -lambda] = [f; -gamma]`, [`ConstrainedMotion::adjoint`] the same
//! matrix for `[lam; nu]` with `[u; 0]` on the right.

use crate::lagrangian::{Bordered, ReducedMass, independent_rows};
use crate::linalg::{Violation, Workspace};
use crate::scalar::{Real, Scalar};

/// Constraints of a chunk of states; buffers are reused from chunk to chunk.
pub(crate) struct ConstrainedMotion<S> {
    n: usize,
    m: usize,
    /// Rows `A` scaled to unit length, `(states, m, n)`, their scaling factors, and `-gamma` scaled alike, `(states, m)`.
    rows: Vec<S>,
    unit: Vec<S>,
    drift: Vec<S>,
    bordered: Bordered<S>,
    /// Multipliers of the scaled rows, `(states, m)`.
    load: Vec<S>,
}

impl<S> Default for ConstrainedMotion<S> {
    fn default() -> Self {
        let (rows, unit, drift, load) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        Self { n: 0, m: 0, rows, unit, drift, bordered: Bordered::default(), load }
    }
}

impl<S: Scalar> ConstrainedMotion<S> {
    /// Removes all states; states added later have `n` coordinates and `m` constraints.
    pub fn clear(&mut self, (n, m): (usize, usize)) {
        (self.n, self.m) = (n, m);
        [&mut self.rows, &mut self.unit, &mut self.drift].into_iter().for_each(Vec::clear);
    }

    /// Adds a state with rows `A`, `(m, n)`, and drift `gamma`, `(m)`, in physical units.
    pub fn push(&mut self, scale: &[S], (matrix, drift): (&[S], &[S])) {
        let zero = <S as Real>::zero();
        for (gradient, &drift) in matrix.chunks_exact(self.n).zip(drift) {
            let scaled = gradient.iter().zip(scale).map(|(&a, &s)| a * s);
            let square = scaled.clone().fold(zero, |sum, a| sum + a * a);
            // A row of zeros is kept; the solver detects that the matrix is singular.
            let unit = if square > zero { Real::sqrt(square).recip() } else { <S as Real>::one() };
            self.rows.extend(scaled.map(|a| a * unit));
            self.unit.push(unit);
            self.drift.push(-drift * unit);
        }
    }

    /// Sets the mass matrices of the states, `(states, n, n)`.
    pub fn border(&mut self, masses: &[S]) {
        self.bordered.set((self.n, self.m), masses, &self.rows);
        self.load.resize(self.drift.len(), <S as Real>::zero());
    }

    /// Solves for the accelerations under forces `f`, both `(states, n)`; `true` if no state failed.
    pub fn motion(&mut self, force: &[S], acceleration: &mut [S], workspace: &mut Workspace<S>) -> bool {
        self.bordered.solve(force, &self.drift, acceleration, &mut self.load, workspace)
    }

    /// Solves for `lam` of a loss whose derivative with respect to the accelerations is `u`, both `(states, n)`; `true` if no state failed.
    pub fn adjoint(&mut self, u: &[S], lam: &mut [S], workspace: &mut Workspace<S>) -> bool {
        self.bordered.solve(u, &[], lam, &mut self.load, workspace)
    }

    /// Appends the multipliers of the last solution, `-lambda` or `nu`, `(states, m)`, for the rows in physical units.
    pub fn loads(&self, out: &mut Vec<S>) {
        out.extend(self.load.iter().zip(&self.unit).map(|(&load, &unit)| load * unit));
    }

    /// Orthonormal basis of the constraint forces `A^T lambda` of a state, where forces `(n)` are in the given units.
    pub fn carried(&self, state: usize, units: &[S]) -> Vec<S> {
        let size = self.m * self.n;
        let rows = &self.rows[state * size..(state + 1) * size];
        let rows: Vec<S> = rows.iter().zip(units.iter().cycle()).map(|(&a, &unit)| a * unit).collect();
        independent_rows(self.n, &rows).1
    }

    /// Computes the eigenvalue penalty of a state within its constraints: minus the sum of the negative eigenvalues of `Z^T M Z`; also sets
    /// its directions.
    pub fn violation(&self, state: usize, mass: &[S], violation: &mut Violation<S>) {
        let (n, m) = (self.n, self.m);
        *violation = Violation::default();
        let Ok(reduced) = ReducedMass::of(n, mass, &self.rows[state * m * n..(state + 1) * m * n]) else { return };
        let negative = reduced.eigenvalues.iter().zip(reduced.directions.chunks_exact(n));
        for (&w, direction) in negative.take_while(|(w, _)| **w < <S as Real>::zero()) {
            violation.value -= w;
            violation.gamma.push(-<S as Real>::one());
            violation.vectors.extend_from_slice(direction);
        }
    }
}
