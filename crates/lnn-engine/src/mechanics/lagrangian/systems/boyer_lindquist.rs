//! Free fall outside a black hole, with or without spin, in Schwarzschild or Boyer-Lindquist coordinates.

use super::angular_velocity;
use crate::lagrangian::Lagrangian;
use crate::lagrangian::system::{
    Bounds, ClosedForm, Conserved, Coordinate, LearningAdvice, Parameter, PerSize, Plane, Range, Size, System,
    TrajectoryTest,
};
use crate::scalar::{Real, Scalar};
use alloc::borrow::Cow;
use alloc::vec::Vec;
use core::f64::consts::PI;

/// `L = (-f t'^2 + r'^2 / f + r^2 (theta'^2 + sin^2 theta phi'^2)) / 2`, `f = 1 - 2M/r`, per unit of mass.
///
/// Here `' = d/dtau` with the proper time `tau`, in geometric units with `G = c = 1`: `t`, `r`, `tau` and `M` are in metres.
#[derive(Clone, Copy, Debug)]
pub struct SchwarzschildGeodesic;

static OF_SCHWARZSCHILD: [Parameter; 1] = [Parameter::new("M", "1", "m", Range::Positive)];

/// Bounds of states outside a black hole in `t`, `r`, `theta`, `phi`.
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

/// Orbits for the trajectory test.
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

/// The orbital plane seen along the axis, with `r` as if space were flat.
const PLANE: Plane =
    Plane { labels: ["r cos phi [m]", "r sin phi [m]"], point: |_, q| (q[1] * q[3].cos(), q[1] * q[3].sin()) };

/// Catalogue entry.
pub const SCHWARZSCHILD: System = System {
    name: Cow::Borrowed("schwarzschild-geodesic"),
    title: Cow::Borrowed("Geodesic of the Schwarzschild metric"),
    coordinates: PerSize::Rule(|_| coordinates()),
    parameters: Cow::Borrowed(&OF_SCHWARZSCHILD),
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

/// Computes `f = 1 - 2M/r`: below `r = 4M` as `(r - 2M)/r`, where the difference is exact, and above as written, where the derivative of
/// the quotient would suffer from cancellation.
fn redshift<R: Real>(mass: R, r: R) -> R {
    let horizon = R::two() * mass;
    (horizon + horizon - r).select((r - horizon) / r, R::one() - horizon / r)
}

impl Lagrangian for SchwarzschildGeodesic {
    const COORDINATES: Option<usize> = Some(4);

    fn coordinates(&self) -> usize {
        4
    }
    #[inline]
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

/// `L = (-Delta A^2/Sigma + sin^2 theta B^2/Sigma + Sigma (r'^2/Delta + theta'^2))/2` per unit of mass.
///
/// `A = t' - a sin^2 theta phi'`, `B = (r^2 + a^2) phi' - a t'`, `Delta = r^2 - 2 M r + a^2`, `Sigma = r^2 + a^2 cos^2 theta`; `a` is the
/// angular momentum per mass. Here `' = d/dtau` with the proper time `tau`; in geometric units with `G = c = 1` everything is in metres.
///
/// Source: Boyer and Lindquist, J. Math. Phys. 8, 265 (1967), in the orthogonal forms of Carter, Phys. Rev. 174, 1559 (1968).
#[derive(Clone, Copy, Debug)]
pub struct KerrGeodesic;

static OF_KERR: [Parameter; 2] =
    [Parameter::new("M", "1", "m", Range::Positive), Parameter::new("a", "0.9", "m", Range::Any)];

/// Catalogue entry.
pub const KERR: System = System {
    name: Cow::Borrowed("kerr-geodesic"),
    title: Cow::Borrowed("Geodesic of the Kerr metric"),
    coordinates: PerSize::Rule(|_| coordinates()),
    parameters: Cow::Borrowed(&OF_KERR),
    size: Size::Fixed(4),
    time_unit: Cow::Borrowed("m"),
    time_like: Some(0),
    constraint: Some("t_dot = C/(sqrt(b^2 - g_tt C) - b), b = g_tphi phi_dot, C = 1 + g(v, v) of t_dot = 0"),
    training: PerSize::Rule(|_| bounds((-0.5 * PI, 2.5 * PI))),
    validation: PerSize::Rule(|_| bounds((0.0, 2.0 * PI))),
    trajectory: PerSize::Rule(|_| trajectory()),
    domain: Some(|parameters, q| match (parameters, q) {
        (&[mass, spin], &[_, r, theta, _])
            if r > mass + (mass * mass - spin * spin).max(0.0).sqrt() && theta.sin() != 0.0 =>
        {
            Ok(())
        }
        _ => Err("r must be above M + sqrt(M^2 - a^2) and theta keep away from the poles"),
    }),
    plane: Some(PLANE),
    conserved: Some(Conserved {
        name: "energy, angular momentum about the axis and root of Carter's constant K per mass [1, m, m]",
        vector: |parameters, q, v| {
            let Some(form) = Forms::new(parameters, q, v) else { return vec![f64::NAN] };
            let [time, azimuth] = form.momenta();
            let carter = KerrGeodesic.carter(parameters, q, v).unwrap_or(f64::NAN);
            vec![-time, azimuth, carter.max(0.0).sqrt()]
        },
    }),
    learning: LearningAdvice::NONE,
    described: None,
};

/// Carter's forms at a state.
struct Forms<R> {
    spin: R,
    r: R,
    sin: R,
    cos: R,
    /// `Sigma`.
    sigma: R,
    /// `Delta`.
    delta: R,
    /// `d Delta/dr = 2 (r - M)`.
    delta_slope: R,
    /// `A = t' - a sin^2 theta phi'`.
    time: R,
    /// `B = (r^2 + a^2) phi' - a t'`.
    azimuth: R,
}

impl<R: Real> Forms<R> {
    fn new(parameters: &[R], q: &[R], v: &[R]) -> Option<Self> {
        let [mass, spin] = *parameters else { return None };
        let (r, (sin, cos)) = (q[1], q[2].sin_cos());
        let fall = r - mass;
        Some(Self {
            spin,
            r,
            sin,
            cos,
            sigma: r.sqr() + (spin * cos).sqr(),
            delta: r * (fall - mass) + spin.sqr(),
            delta_slope: fall + fall,
            time: v[0] - spin * sin.sqr() * v[3],
            azimuth: (r.sqr() + spin.sqr()) * v[3] - spin * v[0],
        })
    }

    /// `p_t` and `p_phi`.
    fn momenta(&self) -> [R; 2] {
        let (time, azimuth) = (self.delta * self.time / self.sigma, self.sin.sqr() * self.azimuth / self.sigma);
        [-(time + self.spin * azimuth), self.spin * self.sin.sqr() * time + (self.r.sqr() + self.spin.sqr()) * azimuth]
    }

    /// `2 L`.
    fn interval(&self, v: &[R]) -> R {
        let turned = (self.sin * self.azimuth).sqr() - self.delta * self.time.sqr();
        turned / self.sigma + self.sigma * (v[1].sqr() / self.delta + v[2].sqr())
    }
}

impl KerrGeodesic {
    /// Carter's constant `K = Sigma^2 theta'^2 + sin^2 theta B^2 - a^2 cos^2 theta g(v, v)`, which is never negative for free fall slower
    /// than light and equals `(L_z - a E)^2` in the equatorial plane; `Q = K - (L_z - a E)^2`. Returns `None` for a wrong number of
    /// parameters.
    ///
    /// Source: Carter, Phys. Rev. 174, 1559 (1968).
    pub fn carter<R: Real>(&self, parameters: &[R], q: &[R], v: &[R]) -> Option<R> {
        let form = Forms::new(parameters, q, v)?;
        let turned = (form.sigma * v[2]).sqr() + (form.sin * form.azimuth).sqr();
        Some(turned - (form.spin * form.cos).sqr() * form.interval(v))
    }
}

impl Lagrangian for KerrGeodesic {
    const COORDINATES: Option<usize> = Some(4);

    fn coordinates(&self) -> usize {
        4
    }
    #[inline]
    fn lagrangian<R: Real>(&self, parameters: &[R], q: &[R], v: &[R]) -> R {
        Forms::new(parameters, q, v).map_or(R::constant(Scalar::nan()), |form| R::half() * form.interval(v))
    }
}

impl ClosedForm for KerrGeodesic {
    /// For `t''` and `phi''`, uses `Delta A = (r^2 + a^2) E - a L_z` and `B = L_z/sin^2 theta - a E`, where `E` and `L_z` are constant;
    /// `r'' = Delta (dL/dr - r' (Sigma/Delta)')/Sigma`, `theta'' = (dL/dtheta - theta' Sigma')/Sigma`.
    fn acceleration<R: Real>(&self, parameters: &[R], q: &[R], v: &[R]) -> Vec<R> {
        let Some(form) = Forms::new(parameters, q, v) else { return Vec::new() };
        let [time_momentum, angular] = form.momenta();
        let Forms { spin, r, sin, cos, sigma, delta, delta_slope, time, azimuth } = form;
        let (two, half) = (R::two(), R::half());
        let (r_dot, theta_dot, phi_dot) = (v[1], v[2], v[3]);
        let time_rate = -r_dot * (two * r * time_momentum + time * delta_slope) / delta;
        let azimuth_rate = -two * angular * cos * theta_dot / (sin * sin.sqr());
        let alpha = time_rate + two * spin * sin * cos * theta_dot * phi_dot;
        let beta = azimuth_rate - two * r * r_dot * phi_dot;
        let t = ((r.sqr() + spin.sqr()) * alpha + spin * sin.sqr() * beta) / sigma;
        let phi = (beta + spin * alpha) / sigma;
        // (-Delta A^2 + sin^2 theta B^2)/Sigma^2 with reversed sign.
        let bent = (delta * time.sqr() - (sin * azimuth).sqr()) / sigma.sqr();
        let sigma_theta = -two * spin.sqr() * sin * cos;
        let along_r = r * bent
            + (two * r * phi_dot * sin.sqr() * azimuth - half * delta_slope * time.sqr()) / sigma
            + r * (r_dot.sqr() / delta + theta_dot.sqr())
            - half * sigma * delta_slope * (r_dot / delta).sqr();
        let along_theta = half * sigma_theta * (bent + r_dot.sqr() / delta + theta_dot.sqr())
            + sin * cos * (two * spin * delta * time * phi_dot + azimuth.sqr()) / sigma;
        let sigma_rate = two * r * r_dot + sigma_theta * theta_dot;
        let stretch_rate = (sigma_rate - sigma * delta_slope * r_dot / delta) / delta;
        vec![t, delta * (along_r - r_dot * stretch_rate) / sigma, (along_theta - theta_dot * sigma_rate) / sigma, phi]
    }

    /// `t' = C/(sqrt(b^2 - g_tt C) - b)`, `b = g_tphi phi'`, where `C = 1 + g(v, v)` for the velocity without `t'`; points to the future
    /// both outside and inside the ergosphere.
    fn constrained_velocity<R: Real>(&self, parameters: &[R], q: &[R], v: &[R]) -> Option<R> {
        let still = [R::zero(), v[1], v[2], v[3]];
        let form = Forms::new(parameters, q, &still)?;
        let b = form.momenta()[0];
        let stretch = (form.spin * form.sin).sqr() - form.delta;
        let c = R::one() + form.interval(&still);
        let root = (b.sqr() - stretch / form.sigma * c).sqrt();
        // For b > 0, motion against the spin, the other form avoids cancellation; it needs g_tt < 0.
        let outside = b.select(-stretch, -R::one());
        Some(outside.select((root + b) * form.sigma / (-stretch), c / (root - b)))
    }
}
