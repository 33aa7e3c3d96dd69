//! The Levi-Civita connection at a point.

use super::curvature::{dot, move_first, rounded};
use super::{GeometryError, Metric};
use crate::lagrangian::MetricJet;
use crate::scalar::{Real, Scalar};
use crate::tape::{VectorFunction, jacobian};

/// Christoffel symbols at a point.
#[derive(Clone, Debug, PartialEq)]
pub struct Connection<S> {
    n: usize,
    /// `G_kij = (d_i g_kj + d_j g_ki - d_k g_ij)/2` at `[k][i][j]`, `(n, n, n)`, all indices down.
    pub lowered: Vec<S>,
    /// `G^k_ij = g^kl G_lij` at `[k][i][j]`, `(n, n, n)`, symmetric in `i`, `j`.
    pub symbols: Vec<S>,
}

impl<S: Scalar> Connection<S> {
    /// The connection of a metric with first derivatives.
    pub(crate) fn new(jet: &MetricJet<S>, metric: &Metric<S>) -> Self {
        let n = metric.coordinates();
        let d = |k: usize, i: usize, j: usize| jet.first[(k * n + i) * n + j];
        let mut lowered = vec![<S as Real>::zero(); n * n * n];
        for k in 0..n {
            for i in 0..n {
                for j in 0..=i {
                    let symbol = (d(i, k, j) + d(j, k, i) - d(k, i, j)) * <S as Real>::half();
                    (lowered[(k * n + i) * n + j], lowered[(k * n + j) * n + i]) = (symbol, symbol);
                }
            }
        }
        let symbols = move_first(n, &metric.inverse, &lowered);
        Self { n, lowered, symbols }
    }

    /// The same in other numbers.
    pub(super) fn rounded<T: Scalar>(&self) -> Connection<T> {
        Connection { n: self.n, lowered: rounded(&self.lowered), symbols: rounded(&self.symbols) }
    }

    /// `G^k_ij u^i w^j`, `(n)`; `-G^k_ij v^i v^j` is the acceleration of a geodesic.
    pub fn contracted(&self, u: &[S], w: &[S]) -> Vec<S> {
        let n = self.n;
        let row = |row: &[S]| dot(row.iter().copied(), w.iter().copied());
        self.symbols.chunks_exact(n * n).map(|k| dot(k.chunks_exact(n).map(row), u.iter().copied())).collect()
    }

    /// Covariant derivative `V^a_;b = d_b V^a + G^a_bc V^c` at `[a][b]`, `(n, n)`, of a vector field with the components
    /// `vector`, `(n)`, and their partial derivatives `d_b V^a` at `[a][b]`, `(n, n)`.
    ///
    /// # Errors
    /// [`GeometryError::Shape`].
    pub fn covariant_derivative(&self, vector: &[S], partial: &[S]) -> Result<Vec<S>, GeometryError> {
        let n = self.n;
        super::error::expect_length("vector", n, vector.len())?;
        super::error::expect_length("partial derivatives", n * n, partial.len())?;
        let turned = self.symbols.chunks_exact(n).map(|row| dot(row.iter().copied(), vector.iter().copied()));
        Ok(partial.iter().zip(turned).map(|(&partial, turned)| partial + turned).collect())
    }

    /// Covariant derivative of a field given as a function of the coordinates, differentiated at `q`, `(n)`.
    ///
    /// # Errors
    /// [`GeometryError::Shape`] if the field has not `n` components or `q` not `n` numbers; [`GeometryError::NotFinite`] if it
    /// cannot be differentiated.
    pub fn covariant_derivative_of(&self, field: &impl VectorFunction, q: &[S]) -> Result<Vec<S>, GeometryError> {
        super::error::expect_length("coordinates", self.n, q.len())?;
        super::error::expect_length("vector field", self.n, field.outputs())?;
        let (vector, partial) =
            jacobian(field, q).map_err(|_| GeometryError::NotFinite { what: "the derivative of the field" })?;
        self.covariant_derivative(&vector, &partial)
    }
}
