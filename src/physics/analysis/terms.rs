//! Terms of a learned Lagrangian against exact ones: accelerations, mass matrix, its signature, and `L` up to the `a L + b`
//! that motion does not determine.

use super::statistics::ErrorDistribution;
use super::thresholds::COMPARED_AT_ONCE;
use crate::lagrangian::{EulerLagrange, Manifold, ManifoldRows, ReducedMass, Request, Terms, group_factors, groups};
use crate::linalg::{Inertia, dot, inertia};
use crate::scalar::{Real, Scalar};
use serde::{Deserialize, Serialize};

/// `|a_learned - a_exact|` at a batch of states, one entry per coordinate, in the unit of its acceleration.
///
/// `q` and `v` are `(batch, n)` in physical units. States where either model fails are counted, not compared.
pub fn acceleration_errors<S: Scalar>(
    exact: &dyn EulerLagrange<S>,
    learned: &dyn EulerLagrange<S>,
    q: &[S],
    v: &[S],
) -> Vec<ErrorDistribution> {
    let n = exact.coordinates();
    let mut errors = vec![Vec::new(); n];
    let mut failed = 0;
    let (mut a, mut b) = (Terms::default(), Terms::default());
    let size = COMPARED_AT_ONCE * n.max(1);
    for (q, v) in q.chunks(size).zip(v.chunks(size)) {
        for (model, terms) in [(exact, &mut a), (learned, &mut b)] {
            terms.acceleration.clear();
            // Failed rows are `NaN` in the result; the others are right.
            let _ = model.terms(q, v, Request::ACCELERATION, terms);
            terms.acceleration.resize(q.len(), S::nan());
        }
        for (a, b) in a.acceleration.chunks(n).zip(b.acceleration.chunks(n)) {
            if a.iter().chain(b).all(|x| x.is_finite()) {
                for (errors, (&a, &b)) in errors.iter_mut().zip(a.iter().zip(b)) {
                    errors.push((a - b).abs().to_f64());
                }
            } else {
                failed += 1;
            }
        }
    }
    errors.into_iter().map(|errors| ErrorDistribution::of(errors, failed)).collect()
}

/// Distribution of `|s M_learned - M_exact| / |M_exact|` (Frobenius norms) at rest, with one factor `s` for all states.
///
/// A Lagrangian is free up to a factor. Where the exact equations split into groups of coordinates that do not act on each other, each
/// group has a factor of its own, and the elements between the groups `a` and `b` are multiplied by `sqrt |s_a s_b|`. The Lagrangian of a
/// geodesic is free up to any function, `L -> f(L)`: `M` becomes `f' g + f'' (g v)(g v)^T`, and only at rest does the metric `g` remain, up
/// to the one factor `f'(0)`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MassMatrixError {
    /// The factor `s` of the smallest mean square error, for the first group.
    pub factor: f64,
    /// Number of groups of coordinates that do not act on each other.
    pub groups: usize,
    /// The factor of every coordinate, which is that of its group.
    #[serde(skip)]
    pub factors: Vec<f64>,
    /// The relative errors.
    #[serde(flatten)]
    pub error: ErrorDistribution,
}

/// Factor of the element of a mass matrix between two coordinates that have a factor each.
pub(crate) fn element_factor(a: f64, b: f64) -> f64 {
    a.signum() * (a * b).abs().sqrt()
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

impl MassMatrixError {
    /// Compares the matrices at rest at the positions `q`, `(states, n)`.
    pub fn of<S: Scalar>(exact: &dyn EulerLagrange<S>, learned: &dyn EulerLagrange<S>, q: &[S]) -> Self {
        let n = exact.coordinates();
        let (of_exact, mut of_learned) = (matrices_at_rest(exact, q), matrices_at_rest(learned, q));
        // Any velocities that show which coordinates act on which.
        let v: Vec<S> = (0..q.len()).map(|k| S::of_f64(0.3 * (1.0 + 2.4 * k as f64).cos())).collect();
        let groups = groups(exact, (q, &v));
        if groups.len() < 2 {
            return compare(n, n * n, &of_exact, &of_learned);
        }
        let factors = group_factors(n, &groups, &of_learned, &of_exact);
        let mut of_coordinate = vec![1.0; n];
        groups.iter().zip(&factors).for_each(|(group, s)| group.iter().for_each(|&i| of_coordinate[i] = *s));
        for matrix in of_learned.chunks_exact_mut(n * n) {
            for (at, m) in matrix.iter_mut().enumerate() {
                *m *= element_factor(of_coordinate[at / n], of_coordinate[at % n]);
            }
        }
        let found = compare_scaled(n * n, &of_exact, &of_learned, 1.0);
        MassMatrixError { factor: factors[0], groups: groups.len(), factors: of_coordinate, ..found }
    }
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
        // One basis of the remaining directions for both.
        let [a, b] = [a, b].map(|matrix| ReducedMass::of(n, matrix, &rows.matrix).map(|reduced| reduced.matrix));
        let most = a.as_ref().map_or(0, Vec::len);
        size = size.max(most);
        for (matrices, found) in within.iter_mut().zip([a, b]) {
            let found = found.ok().filter(|found| found.len() == size);
            matrices.extend(found.unwrap_or_else(|| vec![f64::NAN; size]));
        }
    }
    compare(n, size.max(1), &within[0], &within[1])
}

/// Compares matrices of `size` numbers for `n` coordinates, which have one factor.
fn compare(n: usize, size: usize, exact: &[f64], learned: &[f64]) -> MassMatrixError {
    let factor = nearest_factor(size, exact, learned);
    MassMatrixError { factors: vec![factor; n], ..compare_scaled(size, exact, learned, factor) }
}

/// The comparison with a given factor.
fn compare_scaled(size: usize, exact: &[f64], learned: &[f64], factor: f64) -> MassMatrixError {
    let states = exact.len().max(learned.len()) / size;
    let error = |(a, b): (&[f64], &[f64])| {
        let difference: Vec<f64> = a.iter().zip(b).map(|(a, b)| factor * b - a).collect();
        (dot(&difference, &difference) / dot(a, a)).sqrt()
    };
    let errors: Vec<f64> = pairs(size, exact, learned).map(error).collect();
    let failed = states - errors.len();
    MassMatrixError { factor, groups: 1, factors: Vec::new(), error: ErrorDistribution::of(errors, failed) }
}

/// Fraction of the states `q`, `v`, both `(states, n)`, whose learned mass matrix differs in inertia (numbers of positive, zero and
/// negative eigenvalues) from the exact one; matrices that are not finite count as wrong. Under constraints, the inertia is taken within
/// the remaining directions.
///
/// A learned Lagrangian is free up to a factor, which may be negative: the sign of all matrices together is chosen so that fewer are wrong.
/// 0 for no states.
pub fn wrong_signatures<S: Scalar>(
    exact: &dyn EulerLagrange<S>,
    learned: &dyn EulerLagrange<S>,
    q: &[S],
    v: &[S],
) -> f64 {
    let (exact, learned) = (inertias(exact, q, v), inertias(learned, q, v));
    let states = exact.len().max(learned.len());
    if states == 0 {
        return 0.0;
    }
    let flipped: fn(Inertia) -> Inertia = |i| Inertia { positive: i.negative, negative: i.positive, ..i };
    let right = |turn: fn(Inertia) -> Inertia| {
        exact.iter().zip(&learned).filter(|(a, b)| a.is_some() && **a == b.map(turn)).count()
    };
    1.0 - right(|i| i).max(right(flipped)) as f64 / states as f64
}

/// Inertia of each state's mass matrix; `None` where it is not finite.
fn inertias<S: Scalar>(model: &dyn EulerLagrange<S>, q: &[S], v: &[S]) -> Vec<Option<Inertia>> {
    let n = model.coordinates();
    let mut terms = Terms::default();
    // Failures of single states leave matrices that are not finite.
    let _ = model.terms(q, v, Request::MASS_MATRIX | Request::CONSTRAINTS, &mut terms);
    let (mut scratch, m) = (vec![<S as Real>::zero(); n * n], terms.constraints);
    let of_state = |(k, matrix): (usize, &[S])| match m {
        0 => inertia(n, matrix, &mut scratch).ok(),
        _ => {
            let rows = terms.constraint_matrix.get(k * m * n..(k + 1) * m * n)?;
            let within = ReducedMass::of(n, matrix, rows).ok()?.matrix;
            inertia(within.len().isqrt(), &within, &mut scratch).ok()
        }
    };
    terms.mass_matrix.chunks_exact(n * n).enumerate().map(of_state).collect()
}

/// `target = a source + b` by least squares.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct AffineFit {
    /// Factor.
    pub a: f64,
    /// Summand.
    pub b: f64,
    /// Share of the variance of the target that is explained, `1 - residual / variance`; at most 1. `NaN` for a constant target that is not
    /// reproduced exactly.
    pub r2: f64,
    /// Root mean square of `target - (a source + b)`, in the unit of the target.
    pub rms: f64,
    /// Pairs used.
    pub count: usize,
}

impl AffineFit {
    /// `a x + b`.
    pub fn apply(&self, x: f64) -> f64 {
        self.a * x + self.b
    }
}

/// Fits `target[k] = a source[k] + b` over the pairs in which both are finite; `None` if there are fewer than two.
///
/// A constant source is fitted by `a = 0` and the mean of the target. Sums are taken about the means, so that a large common offset loses
/// no digits. The remaining freedom of a Lagrangian, a total derivative `dF(q)/dt`, is odd in the velocity for the usual systems: compare
/// on grids at rest or over coordinates to be free of it.
pub fn affine_fit(source: &[f64], target: &[f64]) -> Option<AffineFit> {
    let pairs = || source.iter().zip(target).map(|(&x, &y)| (x, y)).filter(|(x, y)| x.is_finite() && y.is_finite());
    let count = pairs().count();
    if count < 2 {
        return None;
    }
    let per = 1.0 / count as f64;
    let (mean_x, mean_y) = pairs().fold((0.0, 0.0), |(a, b), (x, y)| (a + x * per, b + y * per));
    let (mut xx, mut xy, mut yy) = (0.0, 0.0, 0.0);
    for (x, y) in pairs() {
        let (x, y) = (x - mean_x, y - mean_y);
        xx += x * x;
        xy += x * y;
        yy += y * y;
    }
    let a = if xx > 0.0 { xy / xx } else { 0.0 };
    let b = mean_y - a * mean_x;
    let residual: f64 = pairs().map(|(x, y)| ((y - mean_y) - a * (x - mean_x)).powi(2)).sum();
    let r2 = if yy > 0.0 {
        1.0 - residual / yy
    } else if residual == 0.0 {
        1.0
    } else {
        f64::NAN
    };
    Some(AffineFit { a, b, r2, rms: (residual * per).sqrt(), count })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lagrangian::{Lagrangian, Mechanics};
    use crate::models::{OSCILLATOR, PENDULUM, SINGULAR};

    #[test]
    fn known_distribution() {
        let q: Vec<f64> = (0..=1000).map(|k| 0.001 * f64::from(k)).collect();
        let error = acceleration_errors(&OSCILLATOR, &PENDULUM, &q, &vec![0.0; q.len()])[0];
        // |q - sin q| grows with q.
        assert!((error.max - (1.0 - 1.0_f64.sin())).abs() < 1e-12);
        assert!((error.median - (0.5 - 0.5_f64.sin())).abs() < 1e-12);
        let mean = 0.5 - (1.0 - 1.0_f64.cos());
        assert!((error.mean - mean).abs() < 1e-3 * mean + 1e-4, "{error:?}");
        assert!(error.rms > error.mean && error.p95 < error.p99 && error.p99 < error.max);
        assert_eq!((error.count, error.failed), (1001, 0));
    }

    #[test]
    fn failures_are_counted() {
        let error = acceleration_errors::<f64>(&OSCILLATOR, &SINGULAR, &[-2.0, 0.0], &[0.0, 0.0])[0];
        assert_eq!((error.count, error.failed, error.max), (1, 1, 1.0));
        let none = acceleration_errors::<f64>(&OSCILLATOR, &SINGULAR, &[], &[])[0];
        assert!(none.mean.is_nan() && none.count == 0);
    }

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
        // With `c` the coordinates act on each other.
        let exact = model(1.0, 0.5, 0.1);
        // A difference that vanishes at rest does not count.
        let same = MassMatrixError::of(&exact, &model(-4.0, -2.0, 7.0), &q);
        assert_eq!((same.factor, same.error.max, same.error.count, same.error.failed), (-0.25, 0.0, 3, 0));
        assert_eq!(same.factors, [-0.25; 2]);
        let other = MassMatrixError::of(&exact, &model(1.0, 0.0, 0.0), &q);
        // M_exact = diag(1 + q/2, 1) against s times the unit matrix.
        let squares = [2.0, 1.5f64.powi(2) + 1.0, 2.5f64.powi(2) + 1.0];
        let traces = [2.0, 2.5, 3.5];
        let s = (0..3).map(|k| traces[k] / squares[k]).sum::<f64>() / squares.iter().map(|x| 2.0 / x).sum::<f64>();
        assert!((other.factor - s).abs() < 1e-14);
        let errors = [1.0, 1.5, 2.5].map(|m| ((s - m).powi(2) + (s - 1.0).powi(2)).sqrt());
        let relative: Vec<f64> = errors.iter().zip(squares).map(|(e, x)| e / x.sqrt()).collect();
        assert!((other.error.mean - relative.iter().sum::<f64>() / 3.0).abs() < 1e-14);
        assert!((other.error.max - relative.iter().fold(0.0f64, |m, &x| m.max(x))).abs() < 1e-14);
        let broken = MassMatrixError::of(&exact, &model(f64::NAN, 0.0, 0.0), &q);
        assert_eq!((broken.error.count, broken.error.failed), (0, 3));
    }

    /// Two oscillators with a mass each, joined by a spring or not.
    struct Two;

    impl Lagrangian for Two {
        fn coordinates(&self) -> usize {
            2
        }
        fn lagrangian<R: Real>(&self, p: &[R], q: &[R], v: &[R]) -> R {
            let one = |m: R, q: R, v: R| m * (R::half() * (R::one() + q.sqr()) * v.sqr() - q.sqr());
            one(p[0], q[0], v[0]) + one(p[1], q[1], v[1]) - p[2] * q[0] * q[1]
        }
    }

    #[test]
    fn every_group_has_a_factor_of_its_own() {
        let model = |a, b, joined| Mechanics::<_, f64>::new(Two, vec![a, b, joined]);
        let q = [1.0, 0.3, -0.4, 0.8, 0.2, -1.1, 0.7, 0.5];
        let found = MassMatrixError::of(&model(1.0, 1.0, 0.0), &model(2.0, -1e-7, 0.0), &q);
        assert!((found.factor - 0.5).abs() < 1e-12 && found.groups == 2 && found.error.max < 1e-12, "{found:?}");
        assert!((found.factors[1] / -1e7 - 1.0).abs() < 1e-12 && found.factors.len() == 2, "{found:?}");
        assert_eq!((element_factor(4.0, 9.0), element_factor(-2.0, -2.0)), (6.0, -2.0));
        let joined = MassMatrixError::of(&model(1.0, 1.0, 0.1), &model(2.0, 0.2, 0.1), &q);
        assert!(joined.groups == 1 && joined.error.median > 0.3, "{joined:?}");
    }

    /// `L = sum_i m_i v_i^2 / 2`, the first mass of the sign of `q_0`.
    struct Signs([f64; 2]);

    impl Lagrangian for Signs {
        fn coordinates(&self) -> usize {
            2
        }
        fn lagrangian<R: Real>(&self, _: &[R], q: &[R], v: &[R]) -> R {
            (R::of(self.0[0]) + q[0] * R::of(self.0[1])) * v[0].sqr() + v[1].sqr()
        }
    }

    #[test]
    fn wrong_signs_are_counted_up_to_a_common_sign() {
        let model = |a, b| Mechanics::<_, f64>::new(Signs([a, b]), vec![]);
        let q = [1.0, 0.0, 2.0, 0.0, -1.0, 0.0, 3.0, 0.0];
        let v = [0.1; 8];
        let against = |a: f64, b: f64, c: f64, d: f64| wrong_signatures(&model(a, b), &model(c, d), &q, &v);
        assert_eq!(against(1.0, 0.0, 2.0, 0.0), 0.0);
        // Negative at one of four states.
        assert_eq!(against(1.0, 0.0, 0.0, 1.0), 0.25);
        // Lorentzian everywhere: wrong everywhere, also with the opposite sign of both.
        assert_eq!(against(1.0, 0.0, -1.0, 0.0), 1.0);
        assert_eq!(wrong_signatures(&model(1.0, 0.0), &model(1.0, 0.0), &[], &[]), 0.0);
    }

    #[test]
    fn recovers_a_and_b() {
        let source: Vec<f64> = (0..100).map(|k| (0.1 * f64::from(k)).sin()).collect();
        let mut target: Vec<f64> = source.iter().map(|x| -2.5 * x + 1e3).collect();
        let fit = affine_fit(&source, &target).unwrap();
        assert!((fit.a + 2.5).abs() < 1e-12 && (fit.b - 1e3).abs() < 1e-12);
        assert!((fit.r2 - 1.0).abs() < 1e-14 && fit.rms < 1e-12 && fit.count == 100);
        assert!((fit.apply(2.0) - 995.0).abs() < 1e-11);

        target[3] = f64::NAN;
        target[7] = f64::INFINITY;
        let fit = affine_fit(&source, &target).unwrap();
        assert!((fit.a + 2.5).abs() < 1e-12 && fit.count == 98);
    }

    #[test]
    fn poor_and_degenerate_fits_say_so() {
        let fit = affine_fit(&[1.0, -1.0, 1.0, -1.0], &[1.0, 1.0, -1.0, -1.0]).unwrap();
        assert_eq!((fit.a, fit.b, fit.r2, fit.rms), (0.0, 0.0, 0.0, 1.0));
        let fit = affine_fit(&[2.0, 2.0], &[1.0, 3.0]).unwrap();
        assert_eq!((fit.a, fit.b), (0.0, 2.0));
        assert_eq!(affine_fit(&[0.0, 1.0], &[5.0, 5.0]).unwrap().r2, 1.0);
        assert!(affine_fit(&[1.0], &[1.0]).is_none());
    }
}
