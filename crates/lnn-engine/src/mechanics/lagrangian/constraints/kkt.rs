//! Solves the equations of motion of a batch: `M a = f`, or with constraints `M a = f + A^T lambda` and `A a = -gamma`.

use super::rows::independent_rows;
use crate::lagrangian::MechanicsError;
use crate::linalg::{self, Failure, Workspace};
use crate::scalar::{Real, Scalar};
use alloc::vec::Vec;

/// The matrices in the equations of motion of a batch.
#[derive(Clone, Copy)]
pub struct Motion<'a, S> {
    /// Numbers of coordinates and constraints.
    pub size: (usize, usize),
    /// `M`, `(batch, n, n)`.
    pub mass: &'a [S],
    /// `A`, `(batch, m, n)`.
    pub constraints: &'a [S],
    /// `gamma`, `(batch, m)`; 0 if empty.
    pub drift: &'a [S],
}

/// Solves for accelerations, `(batch, n)`, and multipliers, `(batch, m)`, under forces `(batch, n)`. Rows that fail become `NaN` and are
/// added to `failures`.
pub fn accelerate<S: Scalar>(
    motion: Motion<'_, S>,
    force: &[S],
    (acceleration, multipliers): (&mut [S], &mut [S]),
    workspace: &mut Workspace<S>,
    failures: &mut Vec<MechanicsError>,
) {
    let (n, m) = motion.size;
    if m > 0 {
        constrained(motion, force, (acceleration, multipliers), workspace, failures);
    } else if n == 1 {
        divide(motion.mass, force, acceleration, failures);
    } else if linalg::solve_symmetric(n, motion.mass, force, acceleration, workspace).is_err() {
        failures.extend(workspace.failures().iter().map(|&(row, failure)| MechanicsError::unsolved(row, failure)));
    }
}

/// The matrices `[M A^T; A 0]` of a batch and their solver, with reusable buffers.
#[derive(Clone, Debug)]
pub struct Bordered<S> {
    size: (usize, usize),
    matrices: Vec<S>,
    right: Vec<S>,
    solution: Vec<S>,
}

impl<S> Default for Bordered<S> {
    fn default() -> Self {
        Self { size: (0, 0), matrices: Vec::new(), right: Vec::new(), solution: Vec::new() }
    }
}

impl<S: Scalar> Bordered<S> {
    /// Sets `M`, `(batch, n, n)`, and the rows `A`, `(batch, m, n)`.
    pub fn set(&mut self, (n, m): (usize, usize), mass: &[S], rows: &[S]) {
        let (k, zero) = (n + m, <S as Real>::zero());
        self.size = (n, m);
        self.matrices.clear();
        self.matrices.resize(mass.len() / (n * n) * k * k, zero);
        let batch = mass.chunks_exact(n * n).zip(rows.chunks_exact(m * n));
        for (matrix, (mass, rows)) in self.matrices.chunks_exact_mut(k * k).zip(batch) {
            for i in 0..n {
                matrix[i * k..i * k + n].copy_from_slice(&mass[i * n..(i + 1) * n]);
            }
            for (at, &element) in rows.iter().enumerate() {
                let (c, i) = (at / n, at % n);
                matrix[i * k + n + c] = element;
                matrix[(n + c) * k + i] = element;
            }
        }
    }

    /// Returns the matrices, `(batch, n + m, n + m)`.
    pub fn matrices(&self) -> &[S] {
        &self.matrices
    }

    /// Solves for `[x; y]` with the right side `[upper; lower]`, `(batch, n)` and `(batch, m)`; an empty `lower` counts as 0. Returns
    /// `true` if no row failed; failed rows are `NaN`, and the workspace lists them.
    pub fn solve(&mut self, upper: &[S], lower: &[S], x: &mut [S], y: &mut [S], workspace: &mut Workspace<S>) -> bool {
        let (n, m) = self.size;
        let (k, zero) = (n + m, <S as Real>::zero());
        self.right.clear();
        for (row, upper) in upper.chunks_exact(n).enumerate() {
            self.right.extend_from_slice(upper);
            match lower.get(row * m..(row + 1) * m) {
                Some(lower) => self.right.extend_from_slice(lower),
                None => self.right.resize((row + 1) * k, zero),
            }
        }
        self.solution.resize(self.right.len(), zero);
        let solved = linalg::solve(k, &self.matrices, &self.right, &mut self.solution, workspace).is_ok();
        for (row, solved) in self.solution.chunks_exact(k).enumerate() {
            x[row * n..(row + 1) * n].copy_from_slice(&solved[..n]);
            y[row * m..(row + 1) * m].copy_from_slice(&solved[n..]);
        }
        solved
    }
}

/// Solves with constraints and multipliers.
fn constrained<S: Scalar>(
    motion: Motion<'_, S>,
    force: &[S],
    (acceleration, multipliers): (&mut [S], &mut [S]),
    workspace: &mut Workspace<S>,
    failures: &mut Vec<MechanicsError>,
) {
    let Motion { size: (n, m), mass, constraints, drift } = motion;
    let mut bordered = Bordered::default();
    bordered.set((n, m), mass, constraints);
    let lower: Vec<S> = drift.iter().map(|&drift| -drift).collect();
    if !bordered.solve(force, &lower, acceleration, multipliers, workspace) {
        for &(row, failure) in workspace.failures() {
            failures.push(explained((n, m), &constraints[row * m * n..(row + 1) * m * n], row, failure));
        }
    }
    multipliers.iter_mut().for_each(|multiplier| *multiplier = -*multiplier);
}

/// Explains why the solution failed at a state: either a constraint depends on others there, or the mass matrix is singular within the
/// constraints.
#[cold]
fn explained<S: Scalar>((n, m): (usize, usize), constraints: &[S], row: usize, failure: Failure) -> MechanicsError {
    if matches!(failure, Failure::Singular { .. }) {
        let (kept, _) = independent_rows(n, constraints);
        if let Some(constraint) = (0..m).find(|c| !kept.contains(c)) {
            return MechanicsError::Dependent { row, constraint };
        }
    }
    MechanicsError::unsolved(row, failure)
}

/// Solves for one coordinate: `a = f / M`.
fn divide<S: Scalar>(mass: &[S], force: &[S], acceleration: &mut [S], failures: &mut Vec<MechanicsError>) {
    for (row, ((a, &f), &m)) in acceleration.iter_mut().zip(force).zip(mass).enumerate() {
        *a = f / m;
        if !a.is_finite() {
            *a = S::nan();
            let singular = m == <S as Real>::zero();
            let failure = if singular { Failure::Singular { condition: f64::INFINITY } } else { Failure::NotFinite };
            failures.push(MechanicsError::unsolved(row, failure));
        }
    }
}
