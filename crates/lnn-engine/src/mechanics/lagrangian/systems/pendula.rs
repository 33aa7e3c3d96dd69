//! Pendula: two, three or any number of point masses on massless rods, with angles from the downward vertical; a point mass on a spring
//! that swings in a plane.
//!
//! In a chain of pendula, rod `i` of length `l_i` carries the load `mu_i = m_i + m_(i+1) + ..`. For two and three pendula, and in closed
//! forms, differences of angles are computed first, so that a common rotation costs no accuracy.

use super::{ACCELERATION_OF_GRAVITY, LAST_BOB, NOWHERE, angles, length, mass};
use crate::lagrangian::Lagrangian;
use crate::lagrangian::system::{
    Bounds, ClosedForm, Coordinate, Layout, LearningAdvice, PaperBudget, PaperPhase, Parameter, PerSize, Plane, Range,
    Size, StateAdvice, System, TrajectoryTest,
};
use crate::scalar::Real;
use alloc::borrow::Cow;
use alloc::vec::Vec;
use core::f64::consts::PI;

/// `L = (m1 + m2) l1^2 v1^2 / 2 + m2 l2^2 v2^2 / 2 + m2 l1 l2 v1 v2 cos(q1 - q2) + (m1 + m2) g l1 cos q1 + m2 g l2 cos q2`.
#[derive(Clone, Copy, Debug)]
pub struct DoublePendulum;

static OF_DOUBLE_PENDULUM: [Parameter; 5] =
    [mass("m1"), mass("m2"), length("l1"), length("l2"), ACCELERATION_OF_GRAVITY];

/// Catalogue entry.
pub const DOUBLE_PENDULUM: System = System {
    name: Cow::Borrowed("double-pendulum"),
    title: Cow::Borrowed("Double pendulum"),
    coordinates: PerSize::Rule(angles),
    parameters: Cow::Borrowed(&OF_DOUBLE_PENDULUM),
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
            [_, _, l1, l2, _] => chain_end(&[l1, l2], q),
            _ => NOWHERE,
        },
    }),
    conserved: None,
    // The first phase in the paper uses angles over three turns, the others over slightly more than one turn.
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
    #[inline]
    fn lagrangian<R: Real>(&self, parameters: &[R], q: &[R], v: &[R]) -> R {
        let [m1, m2, l1, l2, g] = *parameters else { return R::constant(crate::scalar::Scalar::nan()) };
        let (u1, u2) = (l1 * v[0], l2 * v[1]);
        let total = m1 + m2;
        let kinetic = R::half() * (total * u1.sqr() + m2 * u2.sqr()) + m2 * u1 * u2 * (q[0] - q[1]).cos();
        kinetic + g * (total * l1 * q[0].cos() + m2 * l2 * q[1].cos())
    }
}

impl ClosedForm for DoublePendulum {
    /// The formulas of the paper, with the denominator `1 - a1 a2` written without cancellation as `m1 + m2 sin^2 (q1 - q2)`.
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

/// `L = sum_ij mu_max(i,j) l_i l_j v_i v_j cos(q_i - q_j) / 2 + g sum_i mu_i l_i cos q_i`, `mu_i = m_i + .. + m_3`.
#[derive(Clone, Copy, Debug)]
pub struct TriplePendulum;

static OF_TRIPLE_PENDULUM: [Parameter; 7] =
    [mass("m1"), mass("m2"), mass("m3"), length("l1"), length("l2"), length("l3"), ACCELERATION_OF_GRAVITY];

/// Catalogue entry.
pub const TRIPLE_PENDULUM: System = System {
    name: Cow::Borrowed("triple-pendulum"),
    title: Cow::Borrowed("Triple pendulum"),
    coordinates: PerSize::Rule(angles),
    parameters: Cow::Borrowed(&OF_TRIPLE_PENDULUM),
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
            [_, _, _, l1, l2, l3, _] => chain_end(&[l1, l2, l3], q),
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

/// Returns the masses carried by each rod, the lengths, and the acceleration of gravity.
fn loads<R: Real>(parameters: &[R]) -> Option<([R; 3], [R; 3], R)> {
    let [m1, m2, m3, l1, l2, l3, g] = *parameters else { return None };
    Some(([m1 + (m2 + m3), m2 + m3, m3], [l1, l2, l3], g))
}

impl Lagrangian for TriplePendulum {
    const COORDINATES: Option<usize> = Some(3);

    fn coordinates(&self) -> usize {
        3
    }
    #[inline]
    fn lagrangian<R: Real>(&self, parameters: &[R], q: &[R], v: &[R]) -> R {
        let Some((loads, lengths, g)) = loads(parameters) else { return R::constant(crate::scalar::Scalar::nan()) };
        chain_lagrangian(&loads, &lengths, g, q, v)
    }
}

impl ClosedForm for TriplePendulum {
    /// Solves `M a = F` with the mass matrix and forces of the paper.
    fn acceleration<R: Real>(&self, parameters: &[R], q: &[R], v: &[R]) -> Vec<R> {
        let Some((loads, lengths, g)) = loads(parameters) else { return Vec::new() };
        chain_acceleration(&loads, &lengths, g, q, v)
    }
}

/// `n` equal masses `m` on rods of equal length `l`: rod `i`, counted from 0, carries `(n - i) m`.
///
/// `L = m l^2 sum_i (n - i) v_i (v_i / 2 + x_i cos q_i + y_i sin q_i) + m g l sum_i (n - i) cos q_i`, where the running sums `x_i =
/// sum_(j<i) v_j cos q_j` and `y_i = sum_(j<i) v_j sin q_j` are the velocity of the previous bob in units of `l`. The number of operations
/// is proportional to `n`.
#[derive(Clone, Copy, Debug)]
pub struct NPendulum {
    /// Number of pendula.
    pub n: usize,
}

static OF_N_PENDULUM: [Parameter; 3] = [mass("m"), length("l"), ACCELERATION_OF_GRAVITY];

/// Catalogue entry.
pub const N_PENDULUM: System = System {
    name: Cow::Borrowed("n-pendulum"),
    title: Cow::Borrowed("Chain of n equal pendula"),
    coordinates: PerSize::Rule(angles),
    parameters: Cow::Borrowed(&OF_N_PENDULUM),
    size: Size::Chosen { symbol: "n", default: 4, least: 1, most: 1000, layout: Layout::Line },
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
            [_, l, _] => chain_end(&vec![l; q.len()], q),
            _ => NOWHERE,
        },
    }),
    conserved: None,
    learning: LearningAdvice::NONE,
    described: None,
};

impl NPendulum {
    /// Returns the masses carried by each rod, the lengths, and the acceleration of gravity.
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
    #[inline]
    fn lagrangian<R: Real>(&self, parameters: &[R], q: &[R], v: &[R]) -> R {
        let [m, l, g] = *parameters else { return R::constant(crate::scalar::Scalar::nan()) };
        let (mut x, mut y, mut squares, mut height) = (R::zero(), R::zero(), R::zero(), R::zero());
        for (i, (&q, &v)) in q.iter().zip(v).enumerate() {
            let (carried, (sin, cos)) = (R::of((self.n - i) as f64), q.sin_cos());
            squares += carried * v * (R::half() * v + x * cos + y * sin);
            height += carried * cos;
            (x, y) = (x + v * cos, y + v * sin);
        }
        m * l * (l * squares + g * height)
    }
}

impl ClosedForm for NPendulum {
    fn acceleration<R: Real>(&self, parameters: &[R], q: &[R], v: &[R]) -> Vec<R> {
        let Some((loads, lengths, g)) = self.loads(parameters) else { return Vec::new() };
        chain_acceleration(&loads, &lengths, g, q, v)
    }
}

/// Returns the position of the last point mass, `x = sum_i l_i sin q_i`, `y = -sum_i l_i cos q_i`, with the pivot at the origin.
fn chain_end(lengths: &[f64], q: &[f64]) -> (f64, f64) {
    lengths.iter().zip(q).fold((0.0, 0.0), |(x, y), (l, q)| (x + l * q.sin(), y - l * q.cos()))
}

/// `L = sum_i mu_i (l_i v_i)^2 / 2 + sum_(i<j) mu_j l_i l_j v_i v_j cos(q_i - q_j) + g sum_i mu_i l_i cos q_i`.
fn chain_lagrangian<R: Real>(loads: &[R], lengths: &[R], g: R, q: &[R], v: &[R]) -> R {
    let mut kinetic = R::zero();
    let mut height = R::zero();
    for j in 0..q.len() {
        let speed = lengths[j] * v[j];
        let mut sum = R::half() * speed;
        for i in 0..j {
            sum += lengths[i] * v[i] * (q[i] - q[j]).cos();
        }
        kinetic += loads[j] * speed * sum;
        height += loads[j] * lengths[j] * q[j].cos();
    }
    kinetic + g * height
}

/// Solves `M a = F`, `M_ij = mu_max(i,j) l_i l_j cos(q_i - q_j)`,
/// `F_i = -sum_j mu_max(i,j) l_i l_j v_j^2 sin(q_i - q_j) - mu_i g l_i sin q_i`, by Cholesky's method.
fn chain_acceleration<R: Real>(loads: &[R], lengths: &[R], g: R, q: &[R], v: &[R]) -> Vec<R> {
    let n = q.len();
    // Both sides are divided by l_i; the unknowns are l_j a_j.
    let mut m = vec![R::zero(); n * n];
    let mut force = Vec::with_capacity(n);
    for i in 0..n {
        let mut sum = -(loads[i] * g * q[i].sin());
        for j in 0..n {
            let load = loads[i.max(j)];
            if i == j {
                m[i * n + j] = load;
            } else {
                let (sin, cos) = (q[i] - q[j]).sin_cos();
                m[i * n + j] = load * cos;
                sum -= load * lengths[j] * v[j].sqr() * sin;
            }
        }
        force.push(sum);
    }
    // M = L D L^T; below the diagonal, column k contains L times its pivot.
    for k in 0..n {
        for i in k + 1..n {
            let factor = m[i * n + k] / m[k * n + k];
            for j in k + 1..=i {
                let update = factor * m[j * n + k];
                m[i * n + j] -= update;
            }
            let update = factor * force[k];
            force[i] -= update;
        }
    }
    for k in (0..n).rev() {
        for i in k + 1..n {
            let update = m[i * n + k] * force[i];
            force[k] -= update;
        }
        force[k] /= m[k * n + k];
    }
    force.iter().zip(lengths).map(|(&x, &l)| x / l).collect()
}

/// `L = m (v_r^2 + r^2 v_theta^2) / 2 + m g r cos theta - k (r - l0)^2 / 2`.
#[derive(Clone, Copy, Debug)]
pub struct SpringPendulum;

static OF_SPRING_PENDULUM: [Parameter; 4] =
    [mass("m"), Parameter::new("k", "40", "N/m", Range::AtLeastZero), length("l0"), ACCELERATION_OF_GRAVITY];

/// Catalogue entry.
pub const SPRING_PENDULUM: System = System {
    name: Cow::Borrowed("spring-pendulum"),
    title: Cow::Borrowed("Spring pendulum"),
    coordinates: PerSize::Rule(|_| vec![Coordinate::length("r"), Coordinate::angle("theta")]),
    parameters: Cow::Borrowed(&OF_SPRING_PENDULUM),
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
        // A short spring rotates fast, and its angular acceleration is a thousand times larger than elsewhere.
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
    #[inline]
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
