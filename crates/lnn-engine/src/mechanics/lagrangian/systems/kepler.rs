//! Motion of a unit mass around a fixed centre of gravity, in the plane.

use super::{X_AND_Y, lengths};
use crate::lagrangian::Lagrangian;
use crate::lagrangian::system::{
    Bounds, ClosedForm, Conserved, LearningAdvice, Parameter, PerSize, Range, Size, System, TrajectoryTest,
};
use crate::scalar::Real;
use alloc::borrow::Cow;
use alloc::vec::Vec;

/// `L = (v_x^2 + v_y^2) / 2 + mu / r`, `r^2 = x^2 + y^2`, per unit of mass; singular at `r = 0`.
#[derive(Clone, Copy, Debug)]
pub struct Kepler;

static PARAMETERS: [Parameter; 1] = [Parameter::new("mu", "1", "m^3/s^2", Range::Positive)];

/// Catalogue entry. The initial states of the trajectory test lie on ellipses of eccentricity below 1/2 inside the training box.
pub const KEPLER: System = System {
    name: Cow::Borrowed("kepler"),
    title: Cow::Borrowed("Kepler problem"),
    coordinates: PerSize::Rule(|_| lengths(&["x", "y"])),
    parameters: Cow::Borrowed(&PARAMETERS),
    size: Size::Fixed(2),
    time_unit: Cow::Borrowed("s"),
    time_like: None,
    constraint: None,
    training: PerSize::Rule(|n| Bounds::uniform(n, (-2.0, 2.0), (-2.0, 2.0))),
    validation: PerSize::Rule(|n| Bounds::uniform(n, (-2.0, 2.0), (-2.0, 2.0))),
    trajectory: PerSize::Rule(|_| TrajectoryTest {
        start: Bounds { positions: vec![(0.9, 1.1), (-0.1, 0.1)], velocities: vec![(-0.1, 0.1), (0.8, 1.05)] },
        t_end: 20.0,
        dt: 0.05,
    }),
    domain: Some(|_, q| if q[0] != 0.0 || q[1] != 0.0 { Ok(()) } else { Err("x and y must not both vanish") }),
    plane: Some(X_AND_Y),
    conserved: Some(Conserved { name: "angular momentum [m^2/s]", vector: |_, q, v| vec![q[0] * v[1] - q[1] * v[0]] }),
    learning: LearningAdvice::NONE,
    described: None,
};

impl Lagrangian for Kepler {
    const COORDINATES: Option<usize> = Some(2);

    fn coordinates(&self) -> usize {
        2
    }
    #[inline]
    fn lagrangian<R: Real>(&self, parameters: &[R], q: &[R], v: &[R]) -> R {
        let [mu] = *parameters else { return R::constant(crate::scalar::Scalar::nan()) };
        R::half() * (v[0].sqr() + v[1].sqr()) + mu / (q[0].sqr() + q[1].sqr()).sqrt()
    }
}

impl ClosedForm for Kepler {
    /// `a = -mu (x, y) / r^3`.
    fn acceleration<R: Real>(&self, parameters: &[R], q: &[R], _v: &[R]) -> Vec<R> {
        let [mu] = *parameters else { return Vec::new() };
        let square = q[0].sqr() + q[1].sqr();
        let factor = -mu / (square * square.sqrt());
        vec![factor * q[0], factor * q[1]]
    }
}
