//! A point mass under a constant force, and a relativistic charge in uniform magnetic and electric fields at right angles.

use super::{X_AND_Y, lengths, mass};
use crate::lagrangian::Lagrangian;
use crate::lagrangian::system::{
    Bounds, ClosedForm, LearningAdvice, Parameter, PerSize, Range, Size, System, TrajectoryTest,
};
use crate::scalar::Real;
use alloc::borrow::Cow;
use alloc::vec::Vec;

/// `L = m v^2 / 2 + F q`.
#[derive(Clone, Copy, Debug)]
pub struct ConstantForce;

static OF_CONSTANT_FORCE: [Parameter; 2] = [mass("m"), Parameter::new("F", "1", "N", Range::Any)];

/// Catalogue entry.
pub const CONSTANT_FORCE: System = System {
    name: Cow::Borrowed("constant-force"),
    title: Cow::Borrowed("Constant force"),
    coordinates: PerSize::Rule(|_| lengths(&["q"])),
    parameters: Cow::Borrowed(&OF_CONSTANT_FORCE),
    size: Size::Fixed(1),
    time_unit: Cow::Borrowed("s"),
    time_like: None,
    constraint: None,
    training: PerSize::Rule(|n| Bounds::uniform(n, (-5.0, 5.0), (-5.0, 5.0))),
    validation: PerSize::Rule(|n| Bounds::uniform(n, (-5.0, 5.0), (-5.0, 5.0))),
    trajectory: PerSize::Rule(|n| TrajectoryTest {
        start: Bounds::uniform(n, (-1.0, 1.0), (-1.0, 1.0)),
        t_end: 2.0,
        dt: 0.02,
    }),
    domain: None,
    plane: None,
    conserved: None,
    learning: LearningAdvice::NONE,
    described: None,
};

impl Lagrangian for ConstantForce {
    const COORDINATES: Option<usize> = Some(1);

    fn coordinates(&self) -> usize {
        1
    }
    #[inline]
    fn lagrangian<R: Real>(&self, parameters: &[R], q: &[R], v: &[R]) -> R {
        let [m, force] = *parameters else { return R::constant(crate::scalar::Scalar::nan()) };
        R::half() * m * v[0].sqr() + force * q[0]
    }
}

impl ClosedForm for ConstantForce {
    fn acceleration<R: Real>(&self, parameters: &[R], _q: &[R], _v: &[R]) -> Vec<R> {
        let [m, force] = *parameters else { return Vec::new() };
        vec![force / m]
    }
}

/// `L = -m c^2 sqrt(1 - v^2/c^2) + q (A.v - phi)` with `A = B (-y, x, 0) / 2` and `phi = -E x`: a magnetic field `B` along `z` and an
/// electric field `E` along `x`. It is not quadratic in `v`; `M = gamma m (1 + gamma^2 v v^T / c^2)`.
///
/// All results are `NaN` unless `|v| < c`. The default `c = 1` means natural units; with `c` in m/s everything is in SI units.
#[derive(Clone, Copy, Debug)]
pub struct ChargedParticle;

static OF_CHARGED_PARTICLE: [Parameter; 5] = [
    mass("m"),
    Parameter::new("q", "1", "C", Range::Any),
    Parameter::new("c", "1", "m/s", Range::Positive),
    Parameter::new("B", "1", "T", Range::Any),
    Parameter::new("E", "0.1", "V/m", Range::Any),
];

/// Catalogue entry. Even the corners of the velocity boxes are slower than light.
pub const CHARGED_PARTICLE: System = System {
    name: Cow::Borrowed("charged-particle"),
    title: Cow::Borrowed("Relativistic charged particle"),
    coordinates: PerSize::Rule(|_| lengths(&["x", "y", "z"])),
    parameters: Cow::Borrowed(&OF_CHARGED_PARTICLE),
    size: Size::Fixed(3),
    time_unit: Cow::Borrowed("s"),
    time_like: None,
    constraint: None,
    training: PerSize::Rule(|n| Bounds::uniform(n, (-5.0, 5.0), (-0.55, 0.55))),
    validation: PerSize::Rule(|n| Bounds::uniform(n, (-5.0, 5.0), (-0.55, 0.55))),
    trajectory: PerSize::Rule(|n| TrajectoryTest {
        start: Bounds::uniform(n, (-1.0, 1.0), (-0.25, 0.25)),
        t_end: 10.0,
        dt: 0.05,
    }),
    domain: None,
    plane: Some(X_AND_Y),
    conserved: None,
    learning: LearningAdvice::NONE,
    described: None,
};

/// Computes `1 - v^2/c^2`, `NaN` unless it is positive.
///
/// The largest component `w` enters as `(c - w) (c + w)` close to `c`, where that is exact, and as `c^2 - w^2` far from it, where the
/// derivative of the product would suffer from cancellation.
fn gamma_to_minus_two<R: Real>(c: R, v: &[R]) -> R {
    let (mut w, mut others) = (v[0], R::zero());
    for &x in &v[1..] {
        let larger = x.sqr() - w.sqr();
        others += larger.select(w, x).sqr();
        w = larger.select(x, w);
    }
    let (limit, square) = (c.sqr(), w.sqr());
    let along = (square + square - limit).select((c - w) * (c + w), limit - square);
    let result = (along - others) / limit;
    result.select(result, R::constant(crate::scalar::Scalar::nan()))
}

impl Lagrangian for ChargedParticle {
    const COORDINATES: Option<usize> = Some(3);

    fn coordinates(&self) -> usize {
        3
    }
    #[inline]
    fn lagrangian<R: Real>(&self, parameters: &[R], q: &[R], v: &[R]) -> R {
        let [m, charge, c, b, e] = *parameters else { return R::constant(crate::scalar::Scalar::nan()) };
        let potential = R::half() * b * (q[0] * v[1] - q[1] * v[0]) + e * q[0];
        charge * potential - m * c.sqr() * gamma_to_minus_two(c, v).sqrt()
    }
}

impl ClosedForm for ChargedParticle {
    /// `gamma m a = q (E + v x B - v (v.E) / c^2)`.
    fn acceleration<R: Real>(&self, parameters: &[R], _q: &[R], v: &[R]) -> Vec<R> {
        let [m, charge, c, b, e] = *parameters else { return Vec::new() };
        let factor = charge * gamma_to_minus_two(c, v).sqrt() / m;
        let drag = e * v[0] / c.sqr();
        let along = e * ((c - v[0]) / c) * ((c + v[0]) / c);
        vec![factor * (along + b * v[1]), -(factor * (b * v[0] + drag * v[1])), -(factor * drag * v[2])]
    }
}
