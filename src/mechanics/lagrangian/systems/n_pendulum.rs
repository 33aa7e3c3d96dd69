//! Chain of n equal pendula.

use super::{ACCELERATION_OF_GRAVITY, LAST_BOB, NOWHERE, angles, chain, length, mass};
use crate::lagrangian::Lagrangian;
use crate::lagrangian::system::{
    Bounds, ClosedForm, LearningAdvice, Parameter, PerSize, Plane, Size, System, TrajectoryTest,
};
use crate::scalar::Real;
use std::borrow::Cow;
use std::f64::consts::PI;

/// `n` equal masses `m` on rods of equal length `l`: rod `i` carries `(n - i) m`, `i` from 0.
#[derive(Clone, Copy, Debug)]
pub struct NPendulum {
    /// Number of pendula.
    pub n: usize,
}

static PARAMETERS: [Parameter; 3] = [mass("m"), length("l"), ACCELERATION_OF_GRAVITY];

/// Catalogue entry.
pub const SYSTEM: System = System {
    name: Cow::Borrowed("n-pendulum"),
    title: Cow::Borrowed("Chain of n equal pendula"),
    coordinates: PerSize::Rule(angles),
    parameters: Cow::Borrowed(&PARAMETERS),
    size: Size::Chosen { symbol: "n", default: 4, least: 1, most: 20 },
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
            [_, l, _] => chain::end(&vec![l; q.len()], q),
            _ => NOWHERE,
        },
    }),
    conserved: None,
    learning: LearningAdvice::NONE,
    described: None,
};

impl NPendulum {
    /// Masses carried by each rod, lengths, acceleration of gravity.
    fn loads<R: Real>(&self, parameters: &[R]) -> Option<(Vec<R>, Vec<R>, R)> {
        let [m, l, g] = *parameters else { return None };
        let loads = (0..self.n).map(|i| R::of((self.n - i) as f64) * m).collect();
        Some((loads, vec![l; self.n], g))
    }
}

impl Lagrangian for NPendulum {
    fn coordinates(&self) -> usize {
        self.n
    }
    fn lagrangian<R: Real>(&self, parameters: &[R], q: &[R], v: &[R]) -> R {
        let Some((loads, lengths, g)) = self.loads(parameters) else {
            return R::constant(crate::scalar::Scalar::nan());
        };
        chain::lagrangian(&loads, &lengths, g, q, v)
    }
}

impl ClosedForm for NPendulum {
    fn acceleration<R: Real>(&self, parameters: &[R], q: &[R], v: &[R]) -> Vec<R> {
        let Some((loads, lengths, g)) = self.loads(parameters) else { return Vec::new() };
        chain::acceleration(&loads, &lengths, g, q, v)
    }
}
