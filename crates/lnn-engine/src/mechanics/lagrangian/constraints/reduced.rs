//! The mass matrix within the constraints.

use super::rows::{complement, dot, independent_rows};
use crate::lagrangian::thresholds::NULL_ROUNDINGS;
use crate::linalg::{LinalgError, Workspace, eigh};
use crate::scalar::{Real, Scalar};
use alloc::vec::Vec;

/// `Z^T M Z` at one state, where `Z` is an orthonormal basis of the directions that the constraints allow: the part of `M` that the motion
/// can determine.
#[derive(Clone, Debug, PartialEq)]
pub struct ReducedMass<S> {
    /// `Z`, rows `(d, n)`.
    pub basis: Vec<S>,
    /// `Z^T M Z`, `(d, d)`.
    pub matrix: Vec<S>,
    /// Its eigenvalues, ascending, `(d)`.
    pub eigenvalues: Vec<S>,
    /// The velocity direction of each eigenvalue, `(d, n)`.
    pub directions: Vec<S>,
}

impl<S: Scalar> ReducedMass<S> {
    /// Reduces a mass matrix `(n, n)` by the constraint rows `A`, `(m, n)`; without rows the result is the mass matrix.
    ///
    /// # Errors
    /// [`LinalgError::NotFinite`].
    pub fn of(n: usize, mass: &[S], rows: &[S]) -> Result<Self, LinalgError> {
        let (_, spanned) = independent_rows(n, rows);
        let basis = complement(n, &spanned);
        let d = basis.len() / n.max(1);
        let mut matrix = Vec::with_capacity(d * d);
        for z in basis.chunks_exact(n) {
            let image: Vec<S> = mass.chunks_exact(n).map(|row| dot(row, z)).collect();
            matrix.extend(basis.chunks_exact(n).map(|other| dot(other, &image)));
        }
        let (mut eigenvalues, mut vectors) = (vec![<S as Real>::zero(); d], vec![<S as Real>::zero(); d * d]);
        eigh(d, &matrix, &mut eigenvalues, &mut vectors, &mut Workspace::new())?;
        let mut directions = Vec::with_capacity(d * n);
        for u in vectors.chunks_exact(d.max(1)) {
            directions.extend(
                (0..n).map(|i| {
                    u.iter().zip(basis.chunks_exact(n)).fold(<S as Real>::zero(), |sum, (&u, z)| sum + u * z[i])
                }),
            );
        }
        Ok(Self { basis, matrix, eigenvalues, directions })
    }

    /// Returns the null directions `z` with `M z = 0` within the constraints, in which the Lagrangian is degenerate.
    ///
    /// An eigenvalue below 1024 times the rounding error of the largest one counts as zero.
    pub fn null_directions(&self) -> Vec<&[S]> {
        let d = self.eigenvalues.len();
        let n = self.directions.len() / d.max(1);
        let most = self.eigenvalues.iter().fold(<S as Real>::zero(), |most, w| Real::max(most, w.abs()));
        let floor = S::of_f64(NULL_ROUNDINGS) * S::epsilon() * most;
        let pairs = self.eigenvalues.iter().zip(self.directions.chunks_exact(n.max(1)));
        pairs.filter(|(w, _)| w.abs() <= floor).map(|(_, direction)| direction).collect()
    }
}
