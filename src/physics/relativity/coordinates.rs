//! Coordinates around a centre: distances, directions, the equator; oblate spheroidal coordinates around a spin, in which Carter's constant
//! has a short formula.

use super::RelativityError;
use super::orbits::directions;
use super::thresholds::{COMPARED_TIMES, INFLUENCE_POINTS, LEAST_INFLUENCE, TIME_ROUNDING};
use crate::geometry::{Equator, Turn, TurningPoint};
use crate::lagrangian::{EulerLagrange, MechanicsError, Request, Terms, acting_groups};
use std::f64::consts::FRAC_PI_2;

/// Coordinates that give positions around a centre; the axis of a spin is `z`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum CentralCoordinates {
    /// `t`, `x`, `y`, `z`.
    Cartesian(Chart),
    /// `t`, `r`, `theta`, `phi`.
    Spherical {
        /// Index of the time.
        time: usize,
        /// Index of the radius.
        radius: usize,
        /// Index of the angle from the axis.
        polar: usize,
        /// Index of the angle about the axis.
        azimuth: usize,
    },
}

impl CentralCoordinates {
    /// Recognizes `t, x, y, z` and `t, r, theta, phi` by their names, in any order; `None` for other coordinates.
    pub fn of_names(names: &[&str]) -> Option<Self> {
        let index = |name: &str| names.iter().position(|n| *n == name);
        let time = index("t").filter(|_| names.len() == 4)?;
        let cartesian = || Some(Self::Cartesian(Chart { time, space: [index("x")?, index("y")?, index("z")?] }));
        let spherical =
            || Some(Self::Spherical { time, radius: index("r")?, polar: index("theta")?, azimuth: index("phi")? });
        cartesian().or_else(spherical)
    }

    /// Index of the time.
    pub(crate) fn time(self) -> usize {
        match self {
            Self::Cartesian(Chart { time, .. }) | Self::Spherical { time, .. } => time,
        }
    }

    /// The place of a distance in a direction `(x, y, z)` of unit length, `(4)`, at time 0.
    pub(crate) fn place(self, distance: f64, [x, y, z]: [f64; 3]) -> [f64; 4] {
        let mut q = [0.0; 4];
        match self {
            Self::Cartesian(Chart { space, .. }) => {
                space.iter().zip([x, y, z]).for_each(|(&i, x)| q[i] = distance * x);
            }
            Self::Spherical { radius, polar, azimuth, .. } => {
                (q[radius], q[polar], q[azimuth]) = (distance, z.acos(), y.atan2(x));
            }
        }
        q
    }

    /// Points `(points, 4)` in all directions, their distances uniform in the logarithm.
    pub(crate) fn points(self, points: usize, range: (f64, f64)) -> Vec<f64> {
        directions(points, range).flat_map(|(distance, direction)| self.place(distance, direction)).collect()
    }

    /// Distance from the centre.
    pub fn distance(self, q: &[f64]) -> f64 {
        match self {
            Self::Cartesian(Chart { space, .. }) => space.iter().map(|&i| q[i] * q[i]).sum::<f64>().sqrt(),
            Self::Spherical { radius, .. } => q[radius],
        }
    }

    /// A number of the sign of the rate of the distance.
    pub(crate) fn outward(self, q: &[f64], v: &[f64]) -> f64 {
        match self {
            Self::Cartesian(Chart { space, .. }) => space.iter().map(|&i| q[i] * v[i]).sum(),
            Self::Spherical { radius, .. } => v[radius],
        }
    }

    /// Angle about the axis, up to full turns.
    pub(crate) fn azimuth(self, q: &[f64]) -> f64 {
        match self {
            Self::Cartesian(Chart { space: [x, y, _], .. }) => q[y].atan2(q[x]),
            Self::Spherical { azimuth, .. } => q[azimuth],
        }
    }

    /// Position in space, `(x, y, z)` of the distance and the angles.
    pub(crate) fn position(self, q: &[f64]) -> [f64; 3] {
        match self {
            Self::Cartesian(Chart { space, .. }) => space.map(|i| q[i]),
            Self::Spherical { radius, polar, azimuth, .. } => {
                let across = q[radius] * q[polar].sin();
                [across * q[azimuth].cos(), across * q[azimuth].sin(), q[radius] * q[polar].cos()]
            }
        }
    }

    /// A point of the equator, for [`CentralCoordinates::equator`].
    pub fn origin(self) -> [f64; 4] {
        let mut q = [0.0; 4];
        if let Self::Spherical { polar, .. } = self {
            q[polar] = FRAC_PI_2;
        }
        q
    }

    /// The equator of a metric along `x`; `origin` is that of [`CentralCoordinates::origin`].
    pub fn equator<'a>(self, model: &'a dyn EulerLagrange<f64>, origin: &'a [f64; 4]) -> Equator<'a, f64> {
        let (time, radius, turn) = match self {
            Self::Cartesian(Chart { time, space: [x, y, _] }) => (time, x, Turn::Across(y)),
            Self::Spherical { time, radius, azimuth, .. } => (time, radius, Turn::Angle(azimuth)),
        };
        Equator { model, time, radius, turn, point: origin }
    }

    /// The state of a motion that turns in the equator at a distance.
    pub fn turning(self, distance: f64, turning: &TurningPoint<f64>) -> [[f64; 4]; 2] {
        let (q, mut v) = (self.place(distance, [1.0, 0.0, 0.0]), [0.0; 4]);
        v[self.time()] = turning.time_rate;
        match self {
            Self::Cartesian(Chart { space: [_, y, _], .. }) => v[y] = distance * turning.turning_rate,
            Self::Spherical { azimuth, .. } => v[azimuth] = turning.turning_rate,
        }
        [q, v]
    }
}

/// Indices of the coordinates of a metric: a time, on which it does not depend, and Cartesian places around a centre at their origin.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Chart {
    /// Index of the time.
    pub time: usize,
    /// Indices of `x`, `y`, `z`.
    pub space: [usize; 3],
}

impl Default for Chart {
    /// `t, x, y, z`.
    fn default() -> Self {
        Self { time: 0, space: [1, 2, 3] }
    }
}

impl Chart {
    /// Names of the spatial coordinates of a metric unless others are chosen: `x`, `y`, `z` if they are among the coordinates,
    /// otherwise the three beside the time in their order.
    pub fn usual_space(coordinates: &[String], time: &str) -> Vec<String> {
        let cartesian = ["x", "y", "z"].map(String::from);
        let others: Vec<String> = coordinates.iter().filter(|name| *name != time).cloned().collect();
        let is_cartesian = others.len() != 3 || cartesian.iter().all(|name| coordinates.contains(name));
        if is_cartesian { cartesian.to_vec() } else { others }
    }

    /// Refuses a model of another number of coordinates, and indices that do not name each of them once.
    ///
    /// # Errors
    /// [`RelativityError::Coordinates`], [`RelativityError::Chart`].
    pub(super) fn check(&self, coordinates: usize) -> Result<(), RelativityError> {
        let Self { time, space } = *self;
        if coordinates != 4 {
            return Err(RelativityError::Coordinates { found: coordinates });
        }
        let mut named = [time, space[0], space[1], space[2]];
        named.sort_unstable();
        if named == [0, 1, 2, 3] { Ok(()) } else { Err(RelativityError::Chart { time, space }) }
    }

    /// The places of a vector `(4)`.
    pub(crate) fn space_of(&self, vector: [f64; 4]) -> [f64; 3] {
        self.space.map(|i| vector[i])
    }

    /// The vector of a time and places, `(4)`.
    pub(crate) fn vector(&self, time: f64, space: [f64; 3]) -> [f64; 4] {
        let mut vector = [0.0; 4];
        vector[self.time] = time;
        self.space.iter().zip(space).for_each(|(&i, x)| vector[i] = x);
        vector
    }
}

/// A model of Cartesian coordinates in the coordinates `t`, `r`, `theta`, `phi`:
/// `x + i y = (r + i a) e^(i phi) sin(theta)`, `z = r cos(theta)`.
///
/// It gives `L`, `p`, `dL/dq`, `M` and the energy: `p` and `dL/dq` are pulled back, `P = J^T p`, `G = J^T g + (dJ/dQ V)^T p`.
/// Accelerations are refused.
pub(super) struct Spheroidal<'a> {
    /// The model.
    pub model: &'a dyn EulerLagrange<f64>,
    /// `a`.
    pub spin: f64,
    /// Index of the time.
    pub time: usize,
    /// Indices of `x`, `y`, `z`.
    pub space: [usize; 3],
}

/// Place, `dx_i/dQ_j` and `d2x_i/dQ_j dQ_k` of `Q = (r, theta, phi)`.
struct Place {
    x: [f64; 3],
    first: [[f64; 3]; 3],
    second: [[[f64; 3]; 3]; 3],
}

impl Place {
    fn new(spin: f64, [r, theta, phi]: [f64; 3]) -> Self {
        let ((s, c), (sine, cosine)) = (theta.sin_cos(), phi.sin_cos());
        // The distances from the axis over sin(theta), as components.
        let (u, w) = (r * cosine - spin * sine, r * sine + spin * cosine);
        let row = |rr: f64, rt: f64, rp: f64, tt: f64, tp: f64, pp: f64| [[rr, rt, rp], [rt, tt, tp], [rp, tp, pp]];
        Self {
            x: [u * s, w * s, r * c],
            first: [[cosine * s, u * c, -w * s], [sine * s, w * c, u * s], [c, -r * s, 0.0]],
            second: [
                row(0.0, cosine * c, -sine * s, -u * s, -w * c, -u * s),
                row(0.0, sine * c, cosine * s, -w * s, u * c, -w * s),
                row(0.0, -s, 0.0, -r * c, 0.0, 0.0),
            ],
        }
    }
}

impl EulerLagrange<f64> for Spheroidal<'_> {
    fn coordinates(&self) -> usize {
        4
    }

    fn terms(&self, q: &[f64], v: &[f64], request: Request, terms: &mut Terms<f64>) -> Result<(), MechanicsError> {
        if request.includes(Request::ACCELERATION) {
            return Err(MechanicsError::Derivatives { what: "acceleration in spheroidal coordinates" });
        }
        let places: Vec<Place> = q.chunks_exact(4).map(|q| Place::new(self.spin, [q[1], q[2], q[3]])).collect();
        let (mut at, mut rate) = (vec![0.0; q.len()], vec![0.0; v.len()]);
        for (k, place) in places.iter().enumerate() {
            (at[4 * k + self.time], rate[4 * k + self.time]) = (q[4 * k], v[4 * k]);
            for (i, &target) in self.space.iter().enumerate() {
                at[4 * k + target] = place.x[i];
                rate[4 * k + target] = (0..3).map(|j| place.first[i][j] * v[4 * k + 1 + j]).sum();
            }
        }
        let outcome = self.model.terms(&at, &rate, request, terms);
        if !terms.record_failures(&outcome) {
            return outcome;
        }
        let space = self.space;
        for (k, place) in places.iter().enumerate() {
            let speed = &v[4 * k + 1..4 * k + 4];
            let gather = |from: &[f64]| (from[4 * k + self.time], space.map(|i| from[4 * k + i]));
            let back = |(time, x): (f64, [f64; 3])| {
                [time, 0.0, 0.0, 0.0].into_iter().enumerate().map(move |(j, time)| match j {
                    0 => time,
                    j => (0..3).map(|i| place.first[i][j - 1] * x[i]).sum(),
                })
            };
            let momentum = (!terms.momentum.is_empty()).then(|| gather(&terms.momentum));
            if !terms.dl_dq.is_empty() {
                let mut pulled: Vec<f64> = back(gather(&terms.dl_dq)).collect();
                let Some((_, p)) = momentum else {
                    return Err(MechanicsError::Derivatives { what: "dL/dq without momenta" });
                };
                for j in 0..3 {
                    for (i, p) in p.iter().enumerate() {
                        pulled[1 + j] += p * (0..3).map(|l| place.second[i][j][l] * speed[l]).sum::<f64>();
                    }
                }
                terms.dl_dq[4 * k..4 * k + 4].copy_from_slice(&pulled);
            }
            if let Some(momentum) = momentum {
                let pulled: Vec<f64> = back(momentum).collect();
                terms.momentum[4 * k..4 * k + 4].copy_from_slice(&pulled);
            }
            if !terms.mass_matrix.is_empty() {
                let matrix = terms.mass_matrix[16 * k..16 * k + 16].to_vec();
                // Columns of the whole Jacobian, `(4, 4)`.
                let column = |j: usize| {
                    let mut column = [0.0; 4];
                    match j {
                        0 => column[self.time] = 1.0,
                        j => space.iter().enumerate().for_each(|(i, &target)| column[target] = place.first[i][j - 1]),
                    }
                    column
                };
                for a in 0..4 {
                    for b in 0..4 {
                        let (left, right) = (column(a), column(b));
                        let sum = |i: usize| (0..4).map(|j| matrix[4 * i + j] * right[j]).sum::<f64>();
                        terms.mass_matrix[16 * k + 4 * a + b] = (0..4).map(|i| left[i] * sum(i)).sum();
                    }
                }
            }
        }
        outcome
    }
}

/// `true` if the time and the spatial coordinates of a metric do not act on each other, as in `-c dt^2 + h`. Motion then leaves the unit of
/// time relative to that of length open, and with it every impact parameter. States within a `distance` from the centre are examined.
pub fn time_moves_alone(model: &dyn EulerLagrange<f64>, chart: Chart, distance: f64) -> bool {
    let q = CentralCoordinates::Cartesian(chart).points(INFLUENCE_POINTS, (0.3 * distance, distance));
    let v: Vec<f64> = (0..q.len()).map(|k| (1.0 + 2.4 * k as f64).cos()).collect();
    let accelerations = |q: &[f64], v: &[f64]| {
        let mut terms = Terms::default();
        // Points where the metric is invalid are skipped.
        let _ = model.terms(q, v, Request::ACCELERATION, &mut terms);
        terms.acceleration
    };
    let own = accelerations(&q, &v);
    let finite = own.chunks_exact(4).filter(|a| a.iter().all(|a| a.is_finite()));
    let (sum, count) =
        finite.fold((0.0, 0.0), |(sum, count), a| (sum + a.iter().map(|a| a * a).sum::<f64>(), count + 4.0));
    let noise = LEAST_INFLUENCE * f64::sqrt(sum / count);
    acting_groups(4, (&q, &v), &accelerations, &[noise; 4]).contains(&vec![chart.time])
}

/// `true` if the metric at some point changes with time: by a span of time, or a part of it, later or earlier. `points` are `(points, n)`,
/// `time` is the index of the time.
///
/// # Errors
/// Refusals of the model other than for single states, which are skipped.
pub fn depends_on_time(
    model: &dyn EulerLagrange<f64>,
    time: usize,
    points: &[f64],
    span: f64,
) -> Result<bool, MechanicsError> {
    let n = model.coordinates();
    let mut terms = Terms::default();
    let mut velocity = vec![0.0; n];
    velocity[time] = 1.0;
    for point in points.chunks_exact(n) {
        let mut q = point.repeat(1 + COMPARED_TIMES.len());
        q.iter_mut().skip(n + time).step_by(n).zip(COMPARED_TIMES).for_each(|(t, part)| *t += part * span);
        match model.terms(&q, &velocity.repeat(1 + COMPARED_TIMES.len()), Request::MASS_MATRIX, &mut terms) {
            Ok(()) | Err(MechanicsError::Singular { .. } | MechanicsError::NotFinite { .. }) => {}
            Err(error) => return Err(error),
        }
        // Times at which the metric is invalid are skipped; at all others it must be the same.
        let metrics = || terms.mass_matrix.chunks_exact(n * n);
        let Some(one) = metrics().find(|g| g.iter().all(|g| g.is_finite())) else { continue };
        let most = one.iter().fold(0.0_f64, |most, g| most.max(g.abs()));
        let differs = |(g, one): (&f64, &f64)| (g - one).is_nan() || (g - one).abs() > TIME_ROUNDING * most;
        if metrics().any(|g| g.iter().zip(one).any(differs)) {
            return Ok(true);
        }
    }
    Ok(false)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lagrangian::{Lagrangian, Mechanics, SystemInstance};
    use crate::scalar::Real;

    #[test]
    fn coordinates_are_named_once() {
        let chart = Chart { time: 2, space: [3, 0, 1] };
        assert_eq!(chart.vector(5.0, [1.0, 2.0, 3.0]), [2.0, 3.0, 5.0, 1.0]);
        assert_eq!(chart.space_of([2.0, 3.0, 5.0, 1.0]), [1.0, 2.0, 3.0]);
        assert_eq!(chart.check(4), Ok(()));
        assert_eq!(chart.check(3), Err(RelativityError::Coordinates { found: 3 }));
        for wrong in [Chart { time: 1, ..Chart::default() }, Chart { time: 4, ..Chart::default() }] {
            assert!(matches!(wrong.check(4), Err(RelativityError::Chart { .. })));
        }
    }

    /// In flat space the pulled-back terms are those of the oblate spheroidal metric; in Kerr space they are the derivatives of `L`.
    #[test]
    fn pulled_back_terms_are_derivatives_of_the_lagrangian() {
        let hole = SystemInstance::<f64>::named("kerr-cartesian", &[]).unwrap().build().unwrap();
        let model = Spheroidal { model: &*hole, spin: 0.9, time: 0, space: [1, 2, 3] };
        let (q, v) = ([0.3, 4.0, 1.1, 0.7], [1.2, 0.3, -0.1, 0.05]);
        let of = |q: &[f64], v: &[f64], request: Request| {
            let mut terms = Terms::default();
            model.terms(q, v, request, &mut terms).unwrap();
            terms
        };
        let request = Request::LAGRANGIAN | Request::MOMENTUM | Request::DL_DQ | Request::MASS_MATRIX;
        let found = of(&q, &v, request);
        let step = 1e-5;
        let shifted = |x: &[f64; 4], i: usize, by: f64| {
            let mut x = *x;
            x[i] += by;
            x
        };
        let lagrangian = |q: &[f64], v: &[f64]| of(q, v, Request::LAGRANGIAN).lagrangian[0];
        for i in 0..4 {
            let by_v = (lagrangian(&q, &shifted(&v, i, step)) - lagrangian(&q, &shifted(&v, i, -step))) / (2.0 * step);
            let by_q = (lagrangian(&shifted(&q, i, step), &v) - lagrangian(&shifted(&q, i, -step), &v)) / (2.0 * step);
            assert!((found.momentum[i] - by_v).abs() < 1e-8, "p {i}");
            assert!((found.dl_dq[i] - by_q).abs() < 1e-8, "g {i}");
            let row: f64 = (0..4).map(|j| found.mass_matrix[4 * i + j] * v[j]).sum();
            assert!((found.momentum[i] - row).abs() < 1e-12, "M {i}");
        }
    }

    /// `a(t)^2 dx^2 - dt^2`, `a = 1 + rate sin t`.
    struct Breathing(f64);

    impl Lagrangian for Breathing {
        fn coordinates(&self) -> usize {
            2
        }
        fn lagrangian<R: Real>(&self, _: &[R], q: &[R], v: &[R]) -> R {
            let scale = (R::one() + R::of(self.0) * q[0].sin()) * v[1];
            (scale.sqr() - v[0].sqr()) * R::half()
        }
    }

    /// `(dx^2 - dt^2)/t^2`.
    struct Shrinking;

    impl Lagrangian for Shrinking {
        fn coordinates(&self) -> usize {
            2
        }
        fn lagrangian<R: Real>(&self, _: &[R], q: &[R], v: &[R]) -> R {
            (v[1].sqr() - v[0].sqr()) * R::half() / q[0].sqr()
        }
    }

    #[test]
    fn a_time_that_nothing_moves_is_alone() {
        let chart = Chart::default();
        let of = |name: &str| {
            time_moves_alone(&*SystemInstance::<f64>::named(name, &[]).unwrap().build().unwrap(), chart, 20.0)
        };
        assert!(!of("schwarzschild-cartesian"));
        assert!(time_moves_alone(&Mechanics::<_, f64>::new(Ultrastatic, vec![]), chart, 20.0));
    }

    /// `-3 dt^2 + (1 + 1/(1 + r^2)) (dx^2 + dy^2 + dz^2)`.
    struct Ultrastatic;

    impl Lagrangian for Ultrastatic {
        fn coordinates(&self) -> usize {
            4
        }
        fn lagrangian<R: Real>(&self, _: &[R], q: &[R], v: &[R]) -> R {
            let square = |x: &[R]| x[1].sqr() + x[2].sqr() + x[3].sqr();
            let space = (R::one() + (R::one() + square(q)).recip()) * square(v);
            (space - R::of(3.0) * v[0].sqr()) * R::half()
        }
    }

    #[test]
    fn time_is_told_from_place() {
        let points = [0.0, 1.0, 0.0, 30.0];
        let of = |rate: f64| depends_on_time(&Mechanics::<_, f64>::new(Breathing(rate), vec![]), 0, &points, 7.0);
        assert_eq!([of(0.0), of(1e-12), of(1e-6), of(0.5)], [Ok(false), Ok(false), Ok(true), Ok(true)]);
        // A metric that is invalid at present but valid at other times: `(dx^2 - dt^2)/t^2`.
        let shrinking = Mechanics::<_, f64>::new(Shrinking, vec![]);
        assert_eq!(depends_on_time(&shrinking, 0, &points, 7.0), Ok(true));
        // It may depend on the position.
        let hole = SystemInstance::<f64>::named("schwarzschild-cartesian", &[]).unwrap().build().unwrap();
        let points = [0.0, 8.0, 0.0, 0.0, 0.0, 0.0, -3.0, 1.0, 0.0, 0.0, 0.0, 0.0];
        assert_eq!(depends_on_time(&*hole, 0, &points, 100.0), Ok(false));
        assert_eq!(depends_on_time(&*hole, 1, &points, 1.0), Ok(true));
    }
}
