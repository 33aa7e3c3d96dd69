//! A point mass on a linear spring; a star near the centre of an axisymmetric galaxy (Henon and Heiles 1964), the standard example of
//! chaos.

use super::{X_AND_Y, lengths, mass};
use crate::lagrangian::Lagrangian;
use crate::lagrangian::system::{
    Bounds, ClosedForm, LearningAdvice, Parameter, PerSize, Range, Size, System, TrajectoryTest,
};
use crate::scalar::Real;
use alloc::borrow::Cow;
use alloc::vec::Vec;

/// `L = m v^2 / 2 - k q^2 / 2`.
#[derive(Clone, Copy, Debug)]
pub struct HarmonicOscillator;

static OF_HARMONIC_OSCILLATOR: [Parameter; 2] = [mass("m"), Parameter::new("k", "1", "N/m", Range::AtLeastZero)];

/// Catalogue entry.
pub const HARMONIC_OSCILLATOR: System = System {
    name: Cow::Borrowed("harmonic-oscillator"),
    title: Cow::Borrowed("Harmonic oscillator"),
    coordinates: PerSize::Rule(|_| lengths(&["q"])),
    parameters: Cow::Borrowed(&OF_HARMONIC_OSCILLATOR),
    size: Size::Fixed(1),
    time_unit: Cow::Borrowed("s"),
    time_like: None,
    constraint: None,
    training: PerSize::Rule(|n| Bounds::uniform(n, (-2.0, 2.0), (-2.0, 2.0))),
    validation: PerSize::Rule(|n| Bounds::uniform(n, (-2.0, 2.0), (-2.0, 2.0))),
    trajectory: PerSize::Rule(|n| TrajectoryTest {
        start: Bounds::uniform(n, (-1.0, 1.0), (-1.0, 1.0)),
        t_end: 50.0,
        dt: 0.1,
    }),
    domain: None,
    plane: None,
    conserved: None,
    learning: LearningAdvice::NONE,
    described: None,
};

impl Lagrangian for HarmonicOscillator {
    const COORDINATES: Option<usize> = Some(1);

    fn coordinates(&self) -> usize {
        1
    }
    #[inline]
    fn lagrangian<R: Real>(&self, parameters: &[R], q: &[R], v: &[R]) -> R {
        let [m, k] = *parameters else { return R::constant(crate::scalar::Scalar::nan()) };
        R::half() * (m * v[0].sqr() - k * q[0].sqr())
    }
}

impl ClosedForm for HarmonicOscillator {
    fn acceleration<R: Real>(&self, parameters: &[R], q: &[R], _v: &[R]) -> Vec<R> {
        let [m, k] = *parameters else { return Vec::new() };
        vec![-(k * q[0]) / m]
    }
}

/// `L = (v_x^2 + v_y^2) / 2 - (x^2 + y^2) / 2 - lambda (x^2 y - y^3 / 3)` with unit mass and frequency; motion is bound below `E = 1 / (6
/// lambda^2)`.
#[derive(Clone, Copy, Debug)]
pub struct HenonHeiles;

static OF_HENON_HEILES: [Parameter; 1] = [Parameter::new("lambda", "1", "1/(m s^2)", Range::Any)];

/// Catalogue entry. The initial states of the trajectory test are below the escape energy.
pub const HENON_HEILES: System = System {
    name: Cow::Borrowed("henon-heiles"),
    title: Cow::Borrowed("Henon-Heiles system"),
    coordinates: PerSize::Rule(|_| lengths(&["x", "y"])),
    parameters: Cow::Borrowed(&OF_HENON_HEILES),
    size: Size::Fixed(2),
    time_unit: Cow::Borrowed("s"),
    time_like: None,
    constraint: None,
    training: PerSize::Rule(|n| Bounds::uniform(n, (-1.0, 1.0), (-0.6, 0.6))),
    validation: PerSize::Rule(|n| Bounds::uniform(n, (-1.0, 1.0), (-0.6, 0.6))),
    trajectory: PerSize::Rule(|n| TrajectoryTest {
        start: Bounds::uniform(n, (-0.25, 0.25), (-0.25, 0.25)),
        t_end: 100.0,
        dt: 0.1,
    }),
    domain: None,
    plane: Some(X_AND_Y),
    conserved: None,
    learning: LearningAdvice::NONE,
    described: None,
};

impl Lagrangian for HenonHeiles {
    const COORDINATES: Option<usize> = Some(2);

    fn coordinates(&self) -> usize {
        2
    }
    #[inline]
    fn lagrangian<R: Real>(&self, parameters: &[R], q: &[R], v: &[R]) -> R {
        let [lambda] = *parameters else { return R::constant(crate::scalar::Scalar::nan()) };
        let (xx, yy) = (q[0].sqr(), q[1].sqr());
        R::half() * (v[0].sqr() + v[1].sqr() - xx - yy) - lambda * q[1] * (xx - R::ratio(1, 3) * yy)
    }
}

impl ClosedForm for HenonHeiles {
    fn acceleration<R: Real>(&self, parameters: &[R], q: &[R], _v: &[R]) -> Vec<R> {
        let [lambda] = *parameters else { return Vec::new() };
        let (x, y) = (q[0], q[1]);
        vec![-(x + R::two() * lambda * x * y), -(y + lambda * (x - y) * (x + y))]
    }
}
