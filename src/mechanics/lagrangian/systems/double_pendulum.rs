//! Double pendulum: two point masses on massless rods, angles from the downward vertical.

use super::{ACCELERATION_OF_GRAVITY, LAST_BOB, NOWHERE, angles, chain, length, mass};
use crate::lagrangian::Lagrangian;
use crate::lagrangian::system::{
    Bounds, ClosedForm, LearningAdvice, PaperBudget, PaperPhase, Parameter, PerSize, Plane, Size, System,
    TrajectoryTest,
};
use crate::scalar::Real;
use std::borrow::Cow;
use std::f64::consts::PI;

/// `L = (m1 + m2) l1^2 v1^2 / 2 + m2 l2^2 v2^2 / 2 + m2 l1 l2 v1 v2 cos(q1 - q2) + (m1 + m2) g l1 cos q1 + m2 g l2 cos q2`.
#[derive(Clone, Copy, Debug)]
pub struct DoublePendulum;

static PARAMETERS: [Parameter; 5] = [mass("m1"), mass("m2"), length("l1"), length("l2"), ACCELERATION_OF_GRAVITY];

/// Catalogue entry.
pub const SYSTEM: System = System {
    name: Cow::Borrowed("double-pendulum"),
    title: Cow::Borrowed("Double pendulum"),
    coordinates: PerSize::Rule(angles),
    parameters: Cow::Borrowed(&PARAMETERS),
    size: Size::Fixed(2),
    time_unit: Cow::Borrowed("s"),
    time_like: None,
    constraint: None,
    training: PerSize::Rule(|n| Bounds::uniform(n, (-0.1 * PI, 2.1 * PI), (-10.0, 10.0))),
    validation: PerSize::Rule(|n| Bounds::uniform(n, (0.0, 2.0 * PI), (-10.0, 10.0))),
    trajectory: PerSize::Rule(|n| TrajectoryTest {
        start: Bounds::uniform(n, (0.0, 2.0 * PI), (-0.1, 0.1)),
        t_end: 100.0,
        dt: 0.1,
    }),
    domain: None,
    plane: Some(Plane {
        labels: LAST_BOB,
        point: |parameters, q| match *parameters {
            [_, _, l1, l2, _] => chain::end(&[l1, l2], q),
            _ => NOWHERE,
        },
    }),
    conserved: None,
    // The paper's first phase sees three turns, the others one turn and a little more.
    learning: LearningAdvice {
        paper: Some(PaperBudget {
            states: 60_000,
            hidden: &[500; 3],
            phases: &[
                PaperPhase { positions: Some((-3.0 * PI, 3.0 * PI)), ..PaperPhase::new(300, 1e-3, 1e-6) },
                PaperPhase { positions: Some((-PI / 10.0, 21.0 * PI / 10.0)), ..PaperPhase::new(200, 4e-5, 1e-7) },
                PaperPhase { positions: Some((-PI / 10.0, 21.0 * PI / 10.0)), ..PaperPhase::new(200, 1e-5, 1e-8) },
            ],
        }),
        ..LearningAdvice::NONE
    },
    described: None,
};

impl Lagrangian for DoublePendulum {
    const COORDINATES: Option<usize> = Some(2);

    fn coordinates(&self) -> usize {
        2
    }
    fn lagrangian<R: Real>(&self, parameters: &[R], q: &[R], v: &[R]) -> R {
        let [m1, m2, l1, l2, g] = *parameters else { return R::constant(crate::scalar::Scalar::nan()) };
        let (u1, u2) = (l1 * v[0], l2 * v[1]);
        let total = m1 + m2;
        let kinetic = R::half() * (total * u1.sqr() + m2 * u2.sqr()) + m2 * u1 * u2 * (q[0] - q[1]).cos();
        kinetic + g * (total * l1 * q[0].cos() + m2 * l2 * q[1].cos())
    }
}

impl ClosedForm for DoublePendulum {
    /// The paper's formulas with the denominator `1 - a1 a2` written without cancellation, `m1 + m2 sin^2 (q1 - q2)`.
    fn acceleration<R: Real>(&self, parameters: &[R], q: &[R], v: &[R]) -> Vec<R> {
        let [m1, m2, l1, l2, g] = *parameters else { return Vec::new() };
        let (sin, cos) = (q[0] - q[1]).sin_cos();
        let total = m1 + m2;
        // Torques divided by the lengths: l1 total a1 + m2 l2 cos a2 = f1, l2 a2 + l1 cos a1 = f2.
        let f1 = -(m2 * l2 * v[1].sqr() * sin + total * g * q[0].sin());
        let f2 = l1 * v[0].sqr() * sin - g * q[1].sin();
        let denominator = m1 + m2 * sin.sqr();
        vec![(f1 - m2 * cos * f2) / (l1 * denominator), (total * f2 - cos * f1) / (l2 * denominator)]
    }
}
