//! A point mass on a linear spring.

use super::{MASS, lengths};
use crate::lagrangian::Lagrangian;
use crate::lagrangian::system::{Bounds, Closed, Parameter, Range, Size, System, TrajectoryTest};
use crate::scalar::Real;

/// `L = m v^2 / 2 - k q^2 / 2`.
#[derive(Clone, Copy, Debug)]
pub struct HarmonicOscillator;

const PARAMETERS: [Parameter; 2] =
    [MASS, Parameter { symbol: "k", default: "1", unit: "N/m", range: Range::AtLeastZero }];

/// Catalogue entry.
pub const SYSTEM: System = System {
    name: "harmonic-oscillator",
    title: "Harmonic oscillator",
    coordinates: |_| lengths(&["q"]),
    parameters: &PARAMETERS,
    size: Size::Fixed(1),
    time_unit: "s",
    time_like: None,
    constraint: None,
    training: |n| Bounds::uniform(n, (-2.0, 2.0), (-2.0, 2.0)),
    validation: |n| Bounds::uniform(n, (-2.0, 2.0), (-2.0, 2.0)),
    trajectory: |n| TrajectoryTest { start: Bounds::uniform(n, (-1.0, 1.0), (-1.0, 1.0)), t_end: 50.0, dt: 0.1 },
    domain: None,
    plane: None,
    conserved: None,
};

impl Lagrangian for HarmonicOscillator {
    const COORDINATES: Option<usize> = Some(1);

    fn coordinates(&self) -> usize {
        1
    }
    fn lagrangian<R: Real>(&self, parameters: &[R], q: &[R], v: &[R]) -> R {
        let [m, k] = *parameters else { return R::constant(crate::scalar::Scalar::NAN) };
        R::half() * (m * v[0].sqr() - k * q[0].sqr())
    }
}

impl Closed for HarmonicOscillator {
    fn acceleration<R: Real>(&self, parameters: &[R], q: &[R], _v: &[R]) -> Vec<R> {
        let [m, k] = *parameters else { return Vec::new() };
        vec![-(k * q[0]) / m]
    }
}
