//! The motion of a batch: `M a = f`, under constraints `M a = f + A^T lambda` and `A a = -gamma`.

use super::rows::independent;
use crate::lagrangian::MechanicsError;
use crate::linalg::{self, Failure, Workspace};
use crate::scalar::{Real, Scalar};

/// Rows of `A` at unit length whose part beside the others is below this many roots of the rounding have lost their rank.
const RANK: f64 = 16.0;

/// The matrices of a batch of motions.
#[derive(Clone, Copy)]
pub struct Motion<'a, S> {
    /// Number of coordinates, and of constraints.
    pub size: (usize, usize),
    /// `M`, `(batch, n, n)`.
    pub mass: &'a [S],
    /// `A`, `(batch, m, n)`.
    pub constraints: &'a [S],
    /// `gamma`, `(batch, m)`; 0 if empty.
    pub drift: &'a [S],
}

/// Solves for accelerations, `(batch, n)`, and multipliers, `(batch, m)`, under forces `(batch, n)`; rows that fail are added to
/// `failures` and have `NaN`.
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
    } else if linalg::solve(n, motion.mass, force, acceleration, workspace).is_err() {
        failures.extend(workspace.failures().iter().map(|&(row, failure)| MechanicsError::unsolved(row, failure)));
    }
}

/// With multipliers.
fn constrained<S: Scalar>(
    motion: Motion<'_, S>,
    force: &[S],
    (acceleration, multipliers): (&mut [S], &mut [S]),
    workspace: &mut Workspace<S>,
    failures: &mut Vec<MechanicsError>,
) {
    let Motion { size: (n, m), mass, constraints, drift } = motion;
    let (k, zero) = (n + m, <S as Real>::zero());
    let batch = force.len() / n;
    let mut matrices = vec![zero; batch * k * k];
    let mut right = vec![zero; batch * k];
    let mut solution = right.clone();
    for row in 0..batch {
        let matrix = &mut matrices[row * k * k..(row + 1) * k * k];
        for i in 0..n {
            matrix[i * k..i * k + n].copy_from_slice(&mass[(row * n + i) * n..(row * n + i + 1) * n]);
        }
        for c in 0..m {
            for i in 0..n {
                let element = constraints[(row * m + c) * n + i];
                matrix[i * k + n + c] = element;
                matrix[(n + c) * k + i] = element;
            }
        }
        right[row * k..row * k + n].copy_from_slice(&force[row * n..(row + 1) * n]);
        for (right, &drift) in right[row * k + n..(row + 1) * k].iter_mut().zip(drift.iter().skip(row * m)) {
            *right = -drift;
        }
    }
    if linalg::solve(k, &matrices, &right, &mut solution, workspace).is_err() {
        for &(row, failure) in workspace.failures() {
            failures.push(explained((n, m), &constraints[row * m * n..(row + 1) * m * n], row, failure));
        }
    }
    for (row, solved) in solution.chunks_exact(k).enumerate() {
        acceleration[row * n..(row + 1) * n].copy_from_slice(&solved[..n]);
        multipliers[row * m..(row + 1) * m].iter_mut().zip(&solved[n..]).for_each(|(to, &x)| *to = -x);
    }
}

/// Why a state under constraints cannot move: a constraint that depends on others there, or a mass matrix that is singular within
/// them.
#[cold]
fn explained<S: Scalar>((n, m): (usize, usize), constraints: &[S], row: usize, failure: Failure) -> MechanicsError {
    if matches!(failure, Failure::Singular { .. }) {
        let (kept, _) = independent(n, constraints, RANK * S::epsilon().to_f64().sqrt());
        if let Some(constraint) = (0..m).find(|c| !kept.contains(c)) {
            return MechanicsError::Dependent { row, constraint };
        }
    }
    MechanicsError::unsolved(row, failure)
}

/// One coordinate: `a = f / M`.
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
