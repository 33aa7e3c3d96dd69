//! A point mass under a constant force.

use super::{lengths, mass};
use crate::lagrangian::Lagrangian;
use crate::lagrangian::system::{
    Bounds, ClosedForm, LearningAdvice, Parameter, PerSize, Range, Size, System, TrajectoryTest,
};
use crate::scalar::Real;
use std::borrow::Cow;

/// `L = m v^2 / 2 + F q`.
#[derive(Clone, Copy, Debug)]
pub struct ConstantForce;

static PARAMETERS: [Parameter; 2] = [mass("m"), Parameter::new("F", "1", "N", Range::Any)];

/// Catalogue entry.
pub const SYSTEM: System = System {
    name: Cow::Borrowed("constant-force"),
    title: Cow::Borrowed("Constant force"),
    coordinates: PerSize::Rule(|_| lengths(&["q"])),
    parameters: Cow::Borrowed(&PARAMETERS),
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
