//! Free fall outside a black hole without charge and spin.

use super::angular_velocity;
use crate::lagrangian::Lagrangian;
use crate::lagrangian::system::{
    Bounds, ClosedForm, Conserved, Coordinate, LearningAdvice, Parameter, PerSize, Plane, Range, Size, System,
    TrajectoryTest,
};
use crate::scalar::Real;
use std::borrow::Cow;
use std::f64::consts::PI;

/// `L = (-f t'^2 + r'^2 / f + r^2 (theta'^2 + sin^2 theta phi'^2)) / 2`, `f = 1 - 2M/r`, per unit of mass.
///
/// `' = d/dtau`, `tau` the proper time; geometric units, `G = c = 1`: `t`, `r`, `tau` and `M` in metres.
#[derive(Clone, Copy, Debug)]
pub struct SchwarzschildGeodesic;

static PARAMETERS: [Parameter; 1] = [Parameter::new("M", "1", "m", Range::Positive)];

/// States outside a hole in `t`, `r`, `theta`, `phi`.
pub(super) fn bounds(phi: (f64, f64)) -> Bounds {
    Bounds {
        positions: vec![(-10.0, 10.0), (3.0, 15.0), (0.1 * PI, 0.9 * PI), phi],
        // The velocity of t follows from the mass shell.
        velocities: vec![(0.0, 0.0), (-0.3, 0.3), (-0.1, 0.1), (-0.1, 0.1)],
    }
}

/// `t`, `r`, `theta`, `phi`.
pub(super) fn coordinates() -> Vec<Coordinate> {
    let theta = Coordinate { periodic: false, ..Coordinate::angle("theta") };
    vec![Coordinate::length("t"), Coordinate::length("r"), theta, Coordinate::angle("phi")]
}

/// Orbits that the trajectory test begins.
pub(super) fn trajectory() -> TrajectoryTest {
    TrajectoryTest {
        start: Bounds {
            positions: vec![(0.0, 0.0), (6.0, 12.0), (0.4 * PI, 0.6 * PI), (0.0, 2.0 * PI)],
            velocities: vec![(0.0, 0.0), (-0.1, 0.1), (-0.02, 0.02), (-0.05, 0.05)],
        },
        t_end: 5.0,
        dt: 0.05,
    }
}

/// The plane seen along the axis, `r` as if space were flat.
pub(super) const PLANE: Plane =
    Plane { labels: ["r cos phi [m]", "r sin phi [m]"], point: |_, q| (q[1] * q[3].cos(), q[1] * q[3].sin()) };

/// Catalogue entry.
pub const SYSTEM: System = System {
    name: Cow::Borrowed("schwarzschild-geodesic"),
    title: Cow::Borrowed("Geodesic of the Schwarzschild metric"),
    coordinates: PerSize::Rule(|_| coordinates()),
    parameters: Cow::Borrowed(&PARAMETERS),
    size: Size::Fixed(4),
    time_unit: Cow::Borrowed("m"),
    time_like: Some(0),
    constraint: Some("t_dot = sqrt((1 + r_dot^2/f + r^2 (theta_dot^2 + sin(theta)^2 phi_dot^2))/f), f = 1 - 2 M/r"),
    training: PerSize::Rule(|_| bounds((-0.5 * PI, 2.5 * PI))),
    validation: PerSize::Rule(|_| bounds((0.0, 2.0 * PI))),
    trajectory: PerSize::Rule(|_| trajectory()),
    domain: Some(|parameters, q| match (parameters, q) {
        (&[mass], &[_, r, theta, _]) if r > 2.0 * mass && theta.sin() != 0.0 => Ok(()),
        _ => Err("r must be above 2 M and theta keep away from the poles"),
    }),
    plane: Some(PLANE),
    conserved: Some(Conserved {
        name: "energy and angular momentum per mass [1, m]",
        vector: |parameters, q, v| {
            let &[mass] = parameters else { return vec![f64::NAN] };
            let momentum = angular_velocity([q[2], q[3]], [v[2], v[3]]).map(|x| q[1] * q[1] * x);
            [[redshift(mass, q[1]) * v[0]].as_slice(), &momentum].concat()
        },
    }),
    learning: LearningAdvice::NONE,
    described: None,
};

/// `theta'^2 + sin^2 theta phi'^2`.
fn turning<R: Real>(q: &[R], v: &[R]) -> R {
    v[2].sqr() + (q[2].sin() * v[3]).sqr()
}

/// `f = 1 - 2M/r`: below `r = 4M` as `(r - 2M)/r`, where the difference is exact, above as written, where the derivative
/// of the quotient would cancel.
fn redshift<R: Real>(mass: R, r: R) -> R {
    let horizon = R::two() * mass;
    (horizon + horizon - r).select((r - horizon) / r, R::one() - horizon / r)
}

impl Lagrangian for SchwarzschildGeodesic {
    const COORDINATES: Option<usize> = Some(4);

    fn coordinates(&self) -> usize {
        4
    }
    fn lagrangian<R: Real>(&self, parameters: &[R], q: &[R], v: &[R]) -> R {
        let [mass] = *parameters else { return R::constant(crate::scalar::Scalar::nan()) };
        let (r, f) = (q[1], redshift(mass, q[1]));
        R::half() * (v[1].sqr() / f - f * v[0].sqr() + r.sqr() * turning(q, v))
    }
}

impl ClosedForm for SchwarzschildGeodesic {
    /// `t'' = -2M t' r' / (r (r - 2M))`, `r'' = M (r'^2/f - f t'^2)/r^2 + (r - 2M) (theta'^2 + sin^2 theta phi'^2)`,
    /// `theta'' = -2 r' theta'/r + sin theta cos theta phi'^2`, `phi'' = -2 phi' (r'/r + cot theta theta')`.
    fn acceleration<R: Real>(&self, parameters: &[R], q: &[R], v: &[R]) -> Vec<R> {
        let [mass] = *parameters else { return Vec::new() };
        let (r, (sin, cos)) = (q[1], q[2].sin_cos());
        let height = r - R::two() * mass;
        let f = height / r;
        let rate = v[1] / r;
        vec![
            -R::two() * mass * v[0] * rate / height,
            mass * (v[1].sqr() / f - f * v[0].sqr()) / r.sqr() + height * turning(q, v),
            sin * cos * v[3].sqr() - R::two() * rate * v[2],
            -R::two() * v[3] * (rate + (cos / sin) * v[2]),
        ]
    }

    /// `t' = sqrt((1 + r'^2/f + r^2 (theta'^2 + sin^2 theta phi'^2)) / f)`.
    fn constrained_velocity<R: Real>(&self, parameters: &[R], q: &[R], v: &[R]) -> Option<R> {
        let [mass] = *parameters else { return None };
        let f = redshift(mass, q[1]);
        Some(((R::one() + v[1].sqr() / f + q[1].sqr() * turning(q, v)) / f).sqrt())
    }
}
