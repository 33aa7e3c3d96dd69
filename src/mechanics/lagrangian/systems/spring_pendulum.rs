//! Spring pendulum: a point mass on a spring that swings in a plane.

use super::{ACCELERATION_OF_GRAVITY, length, mass};
use crate::lagrangian::Lagrangian;
use crate::lagrangian::system::{
    Bounds, ClosedForm, Coordinate, LearningAdvice, PaperBudget, PaperPhase, Parameter, PerSize, Plane, Range, Size,
    StateAdvice, System, TrajectoryTest,
};
use crate::scalar::Real;
use std::borrow::Cow;
use std::f64::consts::PI;

/// `L = m (v_r^2 + r^2 v_theta^2) / 2 + m g r cos theta - k (r - l0)^2 / 2`.
#[derive(Clone, Copy, Debug)]
pub struct SpringPendulum;

static PARAMETERS: [Parameter; 4] =
    [mass("m"), Parameter::new("k", "40", "N/m", Range::AtLeastZero), length("l0"), ACCELERATION_OF_GRAVITY];

/// Catalogue entry.
pub const SYSTEM: System = System {
    name: Cow::Borrowed("spring-pendulum"),
    title: Cow::Borrowed("Spring pendulum"),
    coordinates: PerSize::Rule(|_| vec![Coordinate::length("r"), Coordinate::angle("theta")]),
    parameters: Cow::Borrowed(&PARAMETERS),
    size: Size::Fixed(2),
    time_unit: Cow::Borrowed("s"),
    time_like: None,
    constraint: None,
    training: PerSize::Rule(|_| Bounds {
        positions: vec![(0.05, 5.0), (-0.5 * PI, 2.5 * PI)],
        velocities: vec![(-5.0, 5.0), (-5.0, 5.0)],
    }),
    validation: PerSize::Rule(|_| Bounds {
        positions: vec![(0.05, 5.0), (0.0, 2.0 * PI)],
        velocities: vec![(-5.0, 5.0), (-5.0, 5.0)],
    }),
    trajectory: PerSize::Rule(|_| TrajectoryTest {
        start: Bounds { positions: vec![(0.5, 1.5), (0.0, 2.0 * PI)], velocities: vec![(-1.0, 1.0), (-1.0, 1.0)] },
        t_end: 50.0,
        dt: 0.1,
    }),
    domain: Some(|_, q| if q[0] > 0.0 { Ok(()) } else { Err("r must be positive") }),
    plane: Some(Plane { labels: ["x [m]", "y [m]"], point: |_, q| (q[0] * q[1].sin(), -(q[0] * q[1].cos())) }),
    conserved: None,
    learning: LearningAdvice {
        // A short spring turns fast, and its angle is accelerated a thousand times more than others.
        states: Some(|bounds| {
            bounds.velocities = vec![(-7.0, 7.0), (-10.0, 10.0)];
            StateAdvice {
                log_uniform: vec![true, false],
                acceleration_weighting: 0.1,
                trajectory_fraction: 0.0,
                shell: None,
            }
        }),
        paper: Some(PaperBudget { states: 60_000, hidden: &[600; 2], phases: &[PaperPhase::new(500, 5e-4, 1e-7)] }),
        ..LearningAdvice::NONE
    },
    described: None,
};

impl Lagrangian for SpringPendulum {
    const COORDINATES: Option<usize> = Some(2);

    fn coordinates(&self) -> usize {
        2
    }
    fn lagrangian<R: Real>(&self, parameters: &[R], q: &[R], v: &[R]) -> R {
        let [m, k, l0, g] = *parameters else { return R::constant(crate::scalar::Scalar::nan()) };
        let (r, theta) = (q[0], q[1]);
        m * (R::half() * (v[0].sqr() + (r * v[1]).sqr()) + g * r * theta.cos()) - R::half() * k * (r - l0).sqr()
    }
}

impl ClosedForm for SpringPendulum {
    fn acceleration<R: Real>(&self, parameters: &[R], q: &[R], v: &[R]) -> Vec<R> {
        let [m, k, l0, g] = *parameters else { return Vec::new() };
        let (r, (sin, cos)) = (q[0], q[1].sin_cos());
        vec![r * v[1].sqr() + g * cos - k * (r - l0) / m, -(g * sin + R::two() * v[0] * v[1]) / r]
    }
}
