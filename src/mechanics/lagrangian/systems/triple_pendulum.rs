//! Triple pendulum: three point masses on massless rods, angles from the downward vertical.

use super::{ACCELERATION_OF_GRAVITY, LAST_BOB, NOWHERE, angles, chain, length, mass};
use crate::lagrangian::Lagrangian;
use crate::lagrangian::system::{
    Bounds, ClosedForm, LearningAdvice, PaperBudget, PaperPhase, Parameter, PerSize, Plane, Size, System,
    TrajectoryTest,
};
use crate::scalar::Real;
use std::borrow::Cow;
use std::f64::consts::PI;

/// `L = sum_ij mu_max(i,j) l_i l_j v_i v_j cos(q_i - q_j) / 2 + g sum_i mu_i l_i cos q_i`, `mu_i = m_i + .. + m_3`.
#[derive(Clone, Copy, Debug)]
pub struct TriplePendulum;

static PARAMETERS: [Parameter; 7] =
    [mass("m1"), mass("m2"), mass("m3"), length("l1"), length("l2"), length("l3"), ACCELERATION_OF_GRAVITY];

/// Catalogue entry.
pub const SYSTEM: System = System {
    name: Cow::Borrowed("triple-pendulum"),
    title: Cow::Borrowed("Triple pendulum"),
    coordinates: PerSize::Rule(angles),
    parameters: Cow::Borrowed(&PARAMETERS),
    size: Size::Fixed(3),
    time_unit: Cow::Borrowed("s"),
    time_like: None,
    constraint: None,
    training: PerSize::Rule(|n| Bounds::uniform(n, (-0.5 * PI, 2.5 * PI), (-10.0, 10.0))),
    validation: PerSize::Rule(|n| Bounds::uniform(n, (0.0, 2.0 * PI), (-10.0, 10.0))),
    trajectory: PerSize::Rule(|n| TrajectoryTest {
        start: Bounds::uniform(n, (0.2, 3.0), (-0.1, 0.1)),
        t_end: 50.0,
        dt: 0.1,
    }),
    domain: None,
    plane: Some(Plane {
        labels: LAST_BOB,
        point: |parameters, q| match *parameters {
            [_, _, _, l1, l2, l3, _] => chain::end(&[l1, l2, l3], q),
            _ => NOWHERE,
        },
    }),
    conserved: None,
    learning: LearningAdvice {
        states: None,
        paper: Some(PaperBudget { states: 60_000, hidden: &[500; 3], phases: &[PaperPhase::new(500, 1e-3, 1e-7)] }),
        structure_rate: Some(1.6e-3),
    },
    described: None,
};

/// Masses carried by each rod, lengths, acceleration of gravity.
fn loads<R: Real>(parameters: &[R]) -> Option<([R; 3], [R; 3], R)> {
    let [m1, m2, m3, l1, l2, l3, g] = *parameters else { return None };
    Some(([m1 + (m2 + m3), m2 + m3, m3], [l1, l2, l3], g))
}

impl Lagrangian for TriplePendulum {
    const COORDINATES: Option<usize> = Some(3);

    fn coordinates(&self) -> usize {
        3
    }
    fn lagrangian<R: Real>(&self, parameters: &[R], q: &[R], v: &[R]) -> R {
        let Some((loads, lengths, g)) = loads(parameters) else { return R::constant(crate::scalar::Scalar::nan()) };
        chain::lagrangian(&loads, &lengths, g, q, v)
    }
}

impl ClosedForm for TriplePendulum {
    /// `M a = F` with the paper's mass matrix and forces.
    fn acceleration<R: Real>(&self, parameters: &[R], q: &[R], v: &[R]) -> Vec<R> {
        let Some((loads, lengths, g)) = loads(parameters) else { return Vec::new() };
        chain::acceleration(&loads, &lengths, g, q, v)
    }
}
