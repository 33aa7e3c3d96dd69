//! The metric at a point: inverse, determinant, signature.

use super::GeometryError;
use super::curvature::{dot, rounded};
use crate::linalg::{Inertia, LinalgError, Workspace, inertia, inverse, leading_minors};
use crate::scalar::{Real, Scalar};

/// Metric at a point, not degenerate.
#[derive(Clone, Debug, PartialEq)]
pub struct Metric<S> {
    n: usize,
    /// `g_ij`, `(n, n)`, symmetric.
    pub components: Vec<S>,
    /// `g^ij`, `(n, n)`, symmetric.
    pub inverse: Vec<S>,
    /// `det g`.
    pub determinant: S,
    /// Numbers of negative and positive eigenvalues; none is zero.
    pub signature: Inertia,
}

/// `det` of a symmetric `(n, n)` matrix; `NaN` of one that is not finite.
pub(super) fn determinant<S: Scalar>(n: usize, matrix: &[S]) -> S {
    let mut minors = Vec::with_capacity(n);
    match leading_minors(n, matrix, &mut minors, &mut Workspace::new()) {
        Ok(()) => minors.last().map_or_else(<S as Real>::one, |minor| minor.value()),
        Err(_) => S::nan(),
    }
}

impl<S: Scalar> Metric<S> {
    /// The metric of `n` coordinates by its components, `(n, n)`, symmetric.
    ///
    /// # Errors
    /// [`GeometryError::Shape`], [`GeometryError::NotFinite`]; [`GeometryError::Degenerate`] where it is singular to working
    /// precision in any units of the coordinates.
    pub fn new(n: usize, components: &[S]) -> Result<Self, GeometryError> {
        super::error::expect_length("metric", n * n, components.len())?;
        let mut found = vec![S::nan(); n * n];
        inverse(n, components, &mut found, &mut Workspace::new()).map_err(explain)?;
        let signature = inertia(n, components, &mut vec![S::nan(); n * n]).map_err(explain)?;
        if signature.zero > 0 {
            return Err(GeometryError::Degenerate { condition: f64::INFINITY });
        }
        let determinant = determinant(n, components);
        Ok(Self { n, components: components.to_vec(), inverse: found, determinant, signature })
    }

    /// The same in other numbers.
    pub(super) fn rounded<T: Scalar>(&self) -> Metric<T> {
        Metric {
            n: self.n,
            components: rounded(&self.components),
            inverse: rounded(&self.inverse),
            determinant: self.determinant.cast(),
            signature: self.signature,
        }
    }

    /// Number of coordinates `n`.
    pub(crate) fn coordinates(&self) -> usize {
        self.n
    }

    /// `u_i = g_ij u^j`, `(n)`.
    pub fn lower(&self, vector: &[S]) -> Vec<S> {
        self.components.chunks_exact(self.n).map(|row| dot(row.iter().copied(), vector.iter().copied())).collect()
    }

    /// `u^i = g^ij u_j`, `(n)`.
    pub fn raise(&self, covector: &[S]) -> Vec<S> {
        self.inverse.chunks_exact(self.n).map(|row| dot(row.iter().copied(), covector.iter().copied())).collect()
    }

    /// `g(u, w) = g_ij u^i w^j`.
    pub fn product(&self, u: &[S], w: &[S]) -> S {
        dot(u.iter().copied(), self.lower(w))
    }
}

fn explain(error: LinalgError) -> GeometryError {
    match error {
        LinalgError::Singular { condition, .. } => GeometryError::Degenerate { condition },
        LinalgError::NotFinite { .. } => GeometryError::NotFinite { what: "the metric" },
        LinalgError::Shape { what, expected, found } => GeometryError::Shape { what, expected, found },
    }
}
