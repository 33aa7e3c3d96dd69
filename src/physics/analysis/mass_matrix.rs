//! The learned mass matrix, or metric, against the exact one.

use super::summary::ErrorDistribution;
use crate::lagrangian::{EulerLagrange, Manifold, ManifoldRows, ReducedMass, Request, Terms};
use crate::linalg::dot;
use crate::scalar::{Real, Scalar};
use serde::{Deserialize, Serialize};

/// Distribution of `|s M_learned - M_exact| / |M_exact|` (Frobenius norms) at rest, with one factor `s` for all states.
///
/// A Lagrangian is free up to a factor. That of a geodesic is free up to any function, `L -> f(L)`: `M` becomes
/// `f' g + f'' (g v)(g v)^T`, and only at rest the metric `g` is left, up to the one factor `f'(0)`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct MassMatrixError {
    /// The factor `s` of the smallest mean square.
    pub factor: f64,
    /// The relative errors.
    #[serde(flatten)]
    pub error: ErrorDistribution,
}

/// Mass matrices at rest at the positions `q`, `(states, n)`: `(states, n, n)`.
pub(crate) fn matrices_at_rest<S: Scalar>(model: &dyn EulerLagrange<S>, q: &[S]) -> Vec<f64> {
    let mut terms = Terms::default();
    // Failures of single states leave matrices that are not finite.
    let _ = model.terms(q, &vec![<S as Real>::zero(); q.len()], Request::MASS_MATRIX, &mut terms);
    terms.mass_matrix.iter().map(|x| x.to_f64()).collect()
}

/// Matrices of `size` numbers that are finite in both lists, the first of each pair not zero.
fn pairs<'a>(size: usize, exact: &'a [f64], learned: &'a [f64]) -> impl Iterator<Item = (&'a [f64], &'a [f64])> {
    let pairs = exact.chunks_exact(size).zip(learned.chunks_exact(size));
    pairs.filter(|(a, b)| a.iter().chain(*b).all(|x| x.is_finite()) && dot(a, a) > 0.0)
}

/// Factor `s` of the smallest sum of `|s M_learned - M_exact|^2 / |M_exact|^2` over matrices of `size` numbers.
pub(crate) fn nearest_factor(size: usize, exact: &[f64], learned: &[f64]) -> f64 {
    let (mut product, mut square) = (0.0, 0.0);
    for (a, b) in pairs(size, exact, learned) {
        let scale = dot(a, a).recip();
        product += scale * dot(a, b);
        square += scale * dot(b, b);
    }
    product / square
}

/// Compares the matrices at rest at the positions `q`, `(states, n)`.
pub fn mass_matrix_error<S: Scalar>(
    exact: &dyn EulerLagrange<S>,
    learned: &dyn EulerLagrange<S>,
    q: &[S],
) -> MassMatrixError {
    let size = exact.coordinates() * exact.coordinates();
    compare(size, &matrices_at_rest(exact, q), &matrices_at_rest(learned, q))
}

/// Compares the matrices within the directions that the constraints leave, at states `q`, `v`, `(states, n)`.
pub fn mass_matrix_error_within(
    manifold: &dyn Manifold<f64>,
    (exact, learned): (&dyn EulerLagrange<f64>, &dyn EulerLagrange<f64>),
    (q, v): (&[f64], &[f64]),
) -> MassMatrixError {
    let n = exact.coordinates();
    let matrices = |model: &dyn EulerLagrange<f64>| {
        let mut terms = Terms::default();
        // Failures of single states leave matrices that are not finite.
        let _ = model.terms(q, v, Request::MASS_MATRIX, &mut terms);
        terms.mass_matrix
    };
    let (exact, learned) = (matrices(exact), matrices(learned));
    let (mut rows, mut size) = (ManifoldRows::default(), 0);
    let mut within: [Vec<f64>; 2] = Default::default();
    let states = q.chunks_exact(n).zip(v.chunks_exact(n));
    for ((q, v), (a, b)) in states.zip(exact.chunks_exact(n * n).zip(learned.chunks_exact(n * n))) {
        manifold.rows(q, v, &mut rows);
        // One basis for both.
        let [a, b] = [a, b].map(|matrix| ReducedMass::of(n, matrix, &rows.matrix).map(|reduced| reduced.matrix));
        let most = a.as_ref().map_or(0, Vec::len);
        size = size.max(most);
        for (matrices, found) in within.iter_mut().zip([a, b]) {
            let found = found.ok().filter(|found| found.len() == size);
            matrices.extend(found.unwrap_or_else(|| vec![f64::NAN; size]));
        }
    }
    compare(size.max(1), &within[0], &within[1])
}

/// Compares matrices of `size` numbers.
fn compare(size: usize, exact: &[f64], learned: &[f64]) -> MassMatrixError {
    let states = exact.len().max(learned.len()) / size;
    let factor = nearest_factor(size, exact, learned);
    let error = |(a, b): (&[f64], &[f64])| {
        let difference: Vec<f64> = a.iter().zip(b).map(|(a, b)| factor * b - a).collect();
        (dot(&difference, &difference) / dot(a, a)).sqrt()
    };
    let errors: Vec<f64> = pairs(size, exact, learned).map(error).collect();
    let failed = states - errors.len();
    MassMatrixError { factor, error: ErrorDistribution::of(errors, failed) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lagrangian::{Lagrangian, Mechanics};

    /// `L = a |v|^2 / 2 + b q_0 v_0^2 / 2 + c |v|^4`.
    struct Masses([f64; 3]);

    impl Lagrangian for Masses {
        fn coordinates(&self) -> usize {
            2
        }
        fn lagrangian<R: Real>(&self, _: &[R], q: &[R], v: &[R]) -> R {
            let [a, b, c] = self.0.map(R::of);
            let square = v[0].sqr() + v[1].sqr();
            R::half() * (a * square + b * q[0] * v[0].sqr()) + c * square.sqr()
        }
    }

    #[test]
    fn one_factor_is_free_and_nothing_else() {
        let model = |a, b, c| Mechanics::<_, f64>::new(Masses([a, b, c]), vec![]);
        let q = [0.0, 0.0, 1.0, 0.0, 3.0, 0.0];
        let exact = model(1.0, 0.5, 0.0);
        // What vanishes at rest does not count.
        let same = mass_matrix_error(&exact, &model(-4.0, -2.0, 7.0), &q);
        assert_eq!((same.factor, same.error.max, same.error.count, same.error.failed), (-0.25, 0.0, 3, 0));
        let other = mass_matrix_error(&exact, &model(1.0, 0.0, 0.0), &q);
        // M_exact = diag(1 + q/2, 1) against s times the unit matrix.
        let squares = [2.0, 1.5f64.powi(2) + 1.0, 2.5f64.powi(2) + 1.0];
        let traces = [2.0, 2.5, 3.5];
        let s = (0..3).map(|k| traces[k] / squares[k]).sum::<f64>() / squares.iter().map(|x| 2.0 / x).sum::<f64>();
        assert!((other.factor - s).abs() < 1e-14);
        let errors = [1.0, 1.5, 2.5].map(|m| ((s - m).powi(2) + (s - 1.0).powi(2)).sqrt());
        let relative: Vec<f64> = errors.iter().zip(squares).map(|(e, x)| e / x.sqrt()).collect();
        assert!((other.error.mean - relative.iter().sum::<f64>() / 3.0).abs() < 1e-14);
        assert!((other.error.max - relative.iter().fold(0.0f64, |m, &x| m.max(x))).abs() < 1e-14);
        let broken = mass_matrix_error(&exact, &model(f64::NAN, 0.0, 0.0), &q);
        assert_eq!((broken.error.count, broken.error.failed), (0, 3));
    }
}
