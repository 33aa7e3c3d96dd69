//! A point mass on a linear spring.

use super::{lengths, mass};
use crate::lagrangian::Lagrangian;
use crate::lagrangian::system::{
    Bounds, ClosedForm, LearningAdvice, Parameter, PerSize, Range, Size, System, TrajectoryTest,
};
use crate::scalar::Real;
use std::borrow::Cow;

/// `L = m v^2 / 2 - k q^2 / 2`.
#[derive(Clone, Copy, Debug)]
pub struct HarmonicOscillator;

static PARAMETERS: [Parameter; 2] = [mass("m"), Parameter::new("k", "1", "N/m", Range::AtLeastZero)];

/// Catalogue entry.
pub const SYSTEM: System = System {
    name: Cow::Borrowed("harmonic-oscillator"),
    title: Cow::Borrowed("Harmonic oscillator"),
    coordinates: PerSize::Rule(|_| lengths(&["q"])),
    parameters: Cow::Borrowed(&PARAMETERS),
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
