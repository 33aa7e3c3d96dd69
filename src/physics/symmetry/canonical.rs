//! Canonical form of a Lagrangian: fixes at one state the factor and the gauge that motion does not determine.

use super::SymmetryError;
use crate::lagrangian::{EulerLagrange, Lagrangian, MechanicsError, MetricJet, Request, Terms};
use crate::linalg::{Inertia, Workspace, inertia, leading_minors};
use crate::scalar::{Dd, Real, Scalar};

/// Factor and gauge that bring a Lagrangian into its form at a base state `(q0, v0)`,
///
/// ```text
/// L' = s (L - L0 - p0.(v - v0)),   |s| = |det M0|^(-1/n)
/// ```
///
/// with `L0`, `p0 = dL/dv`, `M0 = d2L/dv dv` of the base state. There `L' = 0`, `p' = 0`, `E' = 0` and `|det M'| = 1`; motions and
/// accelerations are those of `L`. Two Lagrangians of the same motion, `s L + dF/dt`, have canonical forms that agree at
/// the base state in `L`, `p`, `E` and `M`, everywhere in `M`, and everywhere else up to a `dF/dt` whose `F` has no gradient at `q0`.
///
/// The sign of `s` makes most eigenvalues of `M0` positive: all of them for a mechanical system, the spatial ones for a spacetime. If as
/// many are negative, the last nonzero `M0_ii` is made positive; if all of these are zero, as in null coordinates, the first nonzero
/// component. The determinant is taken in the units of the coordinates: other units change the factors of all Lagrangians equally. A
/// determinant works for every regular mass matrix, while a trace may vanish.
#[derive(Clone, Debug, PartialEq)]
pub struct CanonicalForm<S> {
    /// `s`.
    pub factor: S,
    /// `L0`.
    pub lagrangian: S,
    /// `p0`, `(n)`.
    pub momentum: Vec<S>,
    /// `v0`, `(n)`.
    pub velocity: Vec<S>,
}

impl<S: Scalar> CanonicalForm<S> {
    /// The form of a Lagrangian at a base state, `q0` and `v0` of length `n`.
    ///
    /// # Errors
    /// [`SymmetryError::Base`] for slices of other lengths, terms that are not finite, and a mass matrix that is singular to working
    /// precision.
    pub fn at(model: &dyn EulerLagrange<S>, q0: &[S], v0: &[S]) -> Result<Self, SymmetryError> {
        let n = model.coordinates();
        for (what, found) in [("coordinates of the base state", q0.len()), ("velocities of the base state", v0.len())] {
            if found != n {
                return Err(SymmetryError::Base(MechanicsError::Shape { what, expected: n, found }));
            }
        }
        let mut terms = Terms::default();
        let request = Request::LAGRANGIAN | Request::MOMENTUM | Request::MASS_MATRIX;
        model.terms(q0, v0, request, &mut terms).map_err(SymmetryError::Base)?;
        let factor = factor(n, &terms.mass_matrix).map_err(SymmetryError::Base)?;
        let Some(&lagrangian) = terms.lagrangian.first() else {
            return Err(SymmetryError::Base(MechanicsError::Shape { what: "Lagrangian", expected: 1, found: 0 }));
        };
        Ok(Self { factor, lagrangian, momentum: terms.momentum, velocity: v0.to_vec() })
    }

    /// `p0.v0 - L0`, the energy of the base state before it is taken out.
    pub(crate) fn energy(&self) -> S {
        let action = self.momentum.iter().zip(&self.velocity).map(|(&p, &v)| p * v);
        action.fold(-self.lagrangian, |sum, x| sum + x)
    }

    /// Turns the given terms of `L` at velocities `(batch, n)` into those of `L'`.
    fn apply(&self, v: &[S], terms: &mut Terms<S>) {
        let (s, n, energy) = (self.factor, self.momentum.len().max(1), self.energy());
        for (value, v) in terms.lagrangian.iter_mut().zip(v.chunks_exact(n)) {
            let gauge = self.momentum.iter().zip(v).zip(&self.velocity).map(|((&p, &v), &v0)| p * (v - v0));
            *value = s * gauge.fold(*value - self.lagrangian, |rest, x| rest - x);
        }
        for momentum in terms.momentum.chunks_exact_mut(n) {
            momentum.iter_mut().zip(&self.momentum).for_each(|(p, &p0)| *p = s * (*p - p0));
        }
        terms.energy.iter_mut().for_each(|e| *e = s * (*e - energy));
        let Terms { dl_dq, mass_matrix, coriolis, force, dissipation, .. } = terms;
        [dl_dq, mass_matrix, coriolis, force, dissipation].into_iter().flatten().for_each(|x| *x *= s);
    }
}

/// The factor `s` for a mass matrix `(n, n)`.
fn factor<S: Scalar>(n: usize, matrix: &[S]) -> Result<S, MechanicsError> {
    let refused = |_| MechanicsError::NotFinite { row: 0, what: "mass matrix" };
    let singular = Err(MechanicsError::Singular { row: 0, condition: f64::INFINITY });
    let signs = inertia(n, matrix, &mut vec![S::nan(); n * n]).map_err(refused)?;
    let mut minors = Vec::with_capacity(n);
    leading_minors(n, matrix, &mut minors, &mut Workspace::new()).map_err(refused)?;
    let zero = <S as Real>::zero();
    let Some(determinant) = minors.last().filter(|minor| signs.zero == 0 && minor.mantissa != zero) else {
        return singular;
    };
    // |det|^(1/n) of 2^(n k + r) m: the power of two k exactly, the rest near 1.
    let (n_, exponent) = (n as i64, determinant.exponent);
    let rest = determinant.mantissa.abs().ldexp(exponent.rem_euclid(n_) as i32);
    let root = match n {
        1 => rest,
        2 => Real::sqrt(rest),
        _ => Real::exp(Real::ln(rest) / S::of_f64(n as f64)),
    };
    let size = Real::recip(root).ldexp(-(exponent.div_euclid(n_).clamp(-8192, 8192) as i32));
    if !size.is_finite() || size == zero {
        return singular;
    }
    Ok(if positive(n, matrix, signs) { size } else { -size })
}

/// `true` if the sign of a regular matrix is the canonical one.
fn positive<S: Scalar>(n: usize, matrix: &[S], signs: Inertia) -> bool {
    let zero = <S as Real>::zero();
    if signs.positive != signs.negative {
        return signs.positive > signs.negative;
    }
    // A number below the root of the rounding, relative to its row, can be zero for one of two equal matrices and not for the other.
    let rounding = Real::sqrt(S::epsilon());
    let counts = |&(i, j): &(usize, usize)| {
        let largest = matrix[i * n..(i + 1) * n].iter().fold(zero, |most, x| Real::max(most, Real::abs(*x)));
        Real::abs(matrix[i * n + j]) > rounding * largest
    };
    let diagonal = (0..n).rev().map(|i| (i, i));
    let others = (0..n).flat_map(|i| (0..n).map(move |j| (i, j)));
    diagonal.chain(others).find(counts).is_none_or(|(i, j)| matrix[i * n + j] > zero)
}

/// A Lagrangian in its [`CanonicalForm`]: the same motion, another factor and another gauge.
///
/// It is an [`EulerLagrange`] if the model is one, with accelerations equal to the bit, and a [`Lagrangian`] if the model is one.
///
/// ```
/// use lnn::lagrangian::{EulerLagrange, Request, SystemInstance, Terms};
/// use lnn::symmetry::{Canonical, CanonicalForm};
///
/// let arm = SystemInstance::<f64>::named("double-pendulum", &[])?.build()?;
/// let (q0, v0) = ([0.3, -0.2], [1.0, 0.5]);
/// let canonical = Canonical::at(arm, &q0, &v0)?;
/// let mut terms = Terms::default();
/// canonical.terms(&q0, &v0, Request::ALL, &mut terms)?;
/// assert_eq!((terms.lagrangian[0], terms.momentum.as_slice()), (0.0, &[0.0, 0.0][..]));
/// let m = &terms.mass_matrix;
/// assert!((m[0] * m[3] - m[1] * m[2] - 1.0).abs() < 1e-14);
/// // A Lagrangian in normal form does not change again.
/// let again = CanonicalForm::at(&canonical, &q0, &v0)?;
/// assert!((again.factor - 1.0).abs() < 1e-14);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct Canonical<M, S> {
    model: M,
    form: CanonicalForm<S>,
}

impl<M, S> Canonical<M, S> {
    /// A model and the form it is brought into, of the model itself or of another of as many coordinates.
    pub fn new(model: M, form: CanonicalForm<S>) -> Self {
        Self { model, form }
    }

    /// The original model.
    pub fn model(&self) -> &M {
        &self.model
    }

    /// Factor and gauge.
    pub fn form(&self) -> &CanonicalForm<S> {
        &self.form
    }
}

impl<S: Scalar, M: EulerLagrange<S>> Canonical<M, S> {
    /// A model in its own form at a base state, `q0` and `v0` of length `n`.
    ///
    /// # Errors
    /// Returns the same errors as [`CanonicalForm::at`].
    pub fn at(model: M, q0: &[S], v0: &[S]) -> Result<Self, SymmetryError> {
        let form = CanonicalForm::at(&model, q0, v0)?;
        Ok(Self { model, form })
    }
}

impl<S: Scalar, M: EulerLagrange<S>> EulerLagrange<S> for Canonical<M, S> {
    fn coordinates(&self) -> usize {
        self.model.coordinates()
    }

    fn terms(&self, q: &[S], v: &[S], request: Request, terms: &mut Terms<S>) -> Result<(), MechanicsError> {
        // Rows that do not fail are right, and stay so.
        let outcome = self.model.terms(q, v, request, terms);
        self.form.apply(v, terms);
        outcome
    }

    fn metric_jets(&self, q: &[S], v: &[S]) -> Result<Vec<MetricJet<S>>, MechanicsError> {
        Ok(scaled(self.model.metric_jets(q, v)?, self.form.factor))
    }

    fn wide_metric_jets(&self, q: &[S], v: &[S]) -> Result<Option<Vec<MetricJet<Dd>>>, MechanicsError> {
        Ok(self.model.wide_metric_jets(q, v)?.map(|jets| scaled(jets, self.form.factor.cast())))
    }

    fn inner(&self) -> Option<&dyn EulerLagrange<S>> {
        Some(&self.model)
    }
}

/// Metrics with their derivatives, times a factor.
fn scaled<S: Scalar>(mut jets: Vec<MetricJet<S>>, factor: S) -> Vec<MetricJet<S>> {
    for MetricJet { metric, first, second } in &mut jets {
        [metric, first, second].into_iter().flatten().for_each(|x| *x *= factor);
    }
    jets
}

impl<M: Lagrangian, S: Scalar> Lagrangian for Canonical<M, S> {
    const COORDINATES: Option<usize> = M::COORDINATES;

    fn coordinates(&self) -> usize {
        self.model.coordinates()
    }

    fn lagrangian<R: Real>(&self, parameters: &[R], q: &[R], v: &[R]) -> R {
        let CanonicalForm { factor, lagrangian, momentum, velocity } = &self.form;
        let number = |x: S| R::constant(x.cast());
        let gauge = momentum.iter().zip(v).zip(velocity).map(|((&p, &v), &v0)| number(p) * (v - number(v0)));
        let value = self.model.lagrangian(parameters, q, v) - number(*lagrangian);
        number(*factor) * gauge.fold(value, |rest, x| rest - x)
    }
}
