//! Metrics with two asymptotic regions, such as wormholes: their radial coordinate goes to minus and to plus infinity.

use super::RelativityError;
use super::orbits::{along, dot, norm, scaled};
use super::thresholds::{EXAMINED_PLACES, LEAST_AXIS_SINE, MOST_AREA_DEVIATION};
use crate::geometry::Metric;
use crate::lagrangian::{EulerLagrange, MechanicsError, Request, Terms};
use std::f64::consts::FRAC_PI_2;

/// Turns a metric with a time, a radial coordinate `l` from minus to plus infinity, the angle `theta` from an axis and the angle `phi`
/// about it into a metric of `t, x, y, z`, in which rays can cross the axis and pass through the throat:
///
/// ```text
/// (x, y, z) = rho (sin theta cos phi, sin theta sin phi, cos theta),   l = rho - s^2/(4 rho)
/// ```
///
/// Where `l` goes to plus infinity, `rho` is `l`; the other region far away lies around the origin, and `x s^2/(4 rho^2)` are Cartesian
/// coordinates there. The scale `s` affects a ray only through its tolerance. Accelerations and mass matrices are given, nothing else.
pub struct TwoSided<M> {
    model: M,
    time: usize,
    /// Indices of `l`, `theta`, `phi`.
    space: [usize; 3],
    scale: f64,
}

/// A place: `rho`, directions along `l`, `theta` and `phi`, the sine and the cosine of `theta`, and the coordinates.
struct Place {
    rho: f64,
    legs: [[f64; 3]; 3],
    sine: f64,
    cosine: f64,
    coordinates: [f64; 3],
}

impl<M: EulerLagrange<f64>> TwoSided<M> {
    /// The metric `model` with the indices of its time and of `l`, `theta`, `phi`, about a distance `far` at which space is flat in both
    /// regions; `scale` is a typical `l`.
    ///
    /// # Errors
    /// [`RelativityError::OneSided`] if the metric is not one of space-time from `l = -far` to `far`, or spheres do not have the area
    /// `4 pi l^2` there within 20 %; those of [`Chart`](super::Chart).
    pub fn new(model: M, time: usize, space: [usize; 3], scale: f64, far: f64) -> Result<Self, RelativityError> {
        super::Chart { time, space }.check(model.coordinates())?;
        let sided = Self { model, time, space, scale };
        let outward = (0..EXAMINED_PLACES).map(|k| far * 0.5_f64.powi(k));
        for radius in outward.flat_map(|l| [l, -l]).chain([0.0]) {
            let area = sided.area_radius(radius)?;
            if radius.abs() == far && (area / far - 1.0).abs() > MOST_AREA_DEVIATION {
                return Err(RelativityError::OneSided { radius });
            }
        }
        Ok(sided)
    }

    /// `sqrt(g_theta,theta/g_ll)` at the equator.
    fn area_radius(&self, radius: f64) -> Result<f64, RelativityError> {
        let mut q = [0.0; 4];
        (q[self.space[0]], q[self.space[1]]) = (radius, FRAC_PI_2);
        let mut terms = Terms::default();
        let refused = RelativityError::OneSided { radius };
        if let Err(MechanicsError::Interrupted) = self.model.terms(&q, &[0.0; 4], Request::MASS_MATRIX, &mut terms) {
            return Err(MechanicsError::Interrupted.into());
        }
        let metric = Metric::new(4, &terms.mass_matrix).map_err(|_| refused.clone())?;
        let signs = (metric.signature.negative, metric.signature.positive);
        let [along, across] = [self.space[0], self.space[1]].map(|i| metric.components[5 * i]);
        let is_space_time = [(1, 3), (3, 1)].contains(&signs) && across / along > 0.0;
        if is_space_time { Ok((across / along).sqrt()) } else { Err(refused) }
    }

    /// `rho` of `l`.
    pub fn distance(&self, radius: f64) -> f64 {
        // Without cancellation on either side.
        let root = radius.hypot(self.scale);
        if radius >= 0.0 { 0.5 * (root + radius) } else { 0.5 * self.scale.powi(2) / (root - radius) }
    }

    fn place(&self, x: [f64; 3]) -> Place {
        let (rho, across) = (norm(x), x[0].hypot(x[1]));
        let (mut sine, mut cosine) = (across / rho, x[2] / rho);
        let (sin, cos) = x[1].atan2(x[0]).sin_cos();
        let legs = [[sine * cos, sine * sin, cosine], [cosine * cos, cosine * sin, -sine], [-sin, cos, 0.0]];
        if sine < LEAST_AXIS_SINE {
            (sine, cosine) = (LEAST_AXIS_SINE, cosine.signum());
        }
        Place {
            rho,
            legs,
            sine,
            cosine,
            coordinates: [rho - 0.25 * self.scale.powi(2) / rho, sine.atan2(cosine), x[1].atan2(x[0])],
        }
    }

    /// `dl/d rho`.
    fn stretch(&self, rho: f64) -> f64 {
        1.0 + 0.25 * (self.scale / rho).powi(2)
    }

    /// Velocities of `rho`, `theta`, `phi` by those of `x`.
    fn rates(place: &Place, v: [f64; 3]) -> [f64; 3] {
        let [out, down, round] = place.legs.map(|leg| dot(leg, v));
        [out, down / place.rho, round / (place.rho * place.sine)]
    }

    /// Accelerations of `x` by those of `l`, `theta`, `phi`.
    fn acceleration(&self, place: &Place, rates: [f64; 3], accelerations: [f64; 3]) -> [f64; 3] {
        let (&Place { rho, legs, sine, cosine, .. }, [out, down, round]) = (place, rates);
        let [radial, polar, azimuthal] = accelerations;
        // d(dl/d rho)/d rho = -s^2/(2 rho^3).
        let outward = (radial + 0.5 * self.scale.powi(2) / rho.powi(3) * out * out) / self.stretch(rho);
        let parts = [
            outward - rho * (down * down + (sine * round).powi(2)),
            rho * (polar - sine * cosine * round * round) + 2.0 * out * down,
            sine * (rho * azimuthal + 2.0 * out * round) + 2.0 * rho * cosine * down * round,
        ];
        legs.iter().zip(parts).fold([0.0; 3], |sum, (&leg, part)| along(sum, part, leg))
    }

    /// The vector `(4)` of the model with a time and `l`, `theta`, `phi`.
    fn vector(&self, time: f64, space: [f64; 3]) -> [f64; 4] {
        super::Chart { time: self.time, space: self.space }.vector(time, space)
    }
}

impl<M: EulerLagrange<f64>> EulerLagrange<f64> for TwoSided<M> {
    fn coordinates(&self) -> usize {
        4
    }

    fn terms(&self, q: &[f64], v: &[f64], request: Request, terms: &mut Terms<f64>) -> Result<(), MechanicsError> {
        if !(Request::ACCELERATION | Request::MASS_MATRIX).includes(request) {
            return Err(MechanicsError::Derivatives { what: "a term of a metric with two sides" });
        }
        let places: Vec<Place> = q.chunks_exact(4).map(|q| self.place([q[1], q[2], q[3]])).collect();
        let rates: Vec<[f64; 3]> =
            places.iter().zip(v.chunks_exact(4)).map(|(place, v)| Self::rates(place, [v[1], v[2], v[3]])).collect();
        let at: Vec<[f64; 4]> =
            places.iter().zip(q.chunks_exact(4)).map(|(place, q)| self.vector(q[0], place.coordinates)).collect();
        let rate = places.iter().zip(&rates).zip(v.chunks_exact(4));
        let rate: Vec<[f64; 4]> = rate
            .map(|((place, rate), v)| self.vector(v[0], [self.stretch(place.rho) * rate[0], rate[1], rate[2]]))
            .collect();
        let outcome = self.model.terms(at.as_flattened(), rate.as_flattened(), request, terms);
        if !terms.record_failures(&outcome) {
            return outcome;
        }
        terms.dl_dq.clear();
        terms.coriolis.clear();
        for ((found, place), rates) in terms.acceleration.chunks_exact_mut(4).zip(&places).zip(&rates) {
            let time = found[self.time];
            let space = self.acceleration(place, *rates, self.space.map(|i| found[i]));
            found.copy_from_slice(&[time, space[0], space[1], space[2]]);
        }
        for (found, place) in terms.mass_matrix.chunks_exact_mut(16).zip(&places) {
            let lengths = [self.stretch(place.rho), place.rho.recip(), (place.rho * place.sine).recip()];
            let slopes: [[f64; 3]; 3] = std::array::from_fn(|k| scaled(lengths[k], place.legs[k]));
            // Columns of the Jacobian: the model's velocities per velocity of `t`, `x`, `y` or `z`.
            let columns: [[f64; 4]; 4] = std::array::from_fn(|j| match j {
                0 => self.vector(1.0, [0.0; 3]),
                j => self.vector(0.0, slopes.map(|slope| slope[j - 1])),
            });
            let pulled: [f64; 16] =
                std::array::from_fn(|k| super::orbits::product(found, columns[k / 4], columns[k % 4]));
            found.copy_from_slice(&pulled);
        }
        outcome
    }
}

/// The direction in the other region of a ray that has the direction `k` at `x`: that of its image under `x s^2/(4 rho^2)`.
pub(super) fn beyond(x: [f64; 3], k: [f64; 3]) -> [f64; 3] {
    let turned = along(k, -2.0 * dot(x, k) / dot(x, x), x);
    scaled(norm(turned).recip(), turned)
}

#[cfg(test)]
mod tests {
    use super::super::tests::Wormhole;
    use super::*;
    use crate::lagrangian::{Mechanics, SystemInstance};

    /// The accelerations are those of the Lagrangian `g_ij v_i v_j/2` of the mass matrix that is given.
    #[test]
    fn accelerations_are_those_of_the_pulled_back_metric() {
        let model = TwoSided::new(Mechanics::new(Wormhole(2.0, 0.5), vec![]), 0, [1, 2, 3], 3.0, 1e3).unwrap();
        let request = Request::ACCELERATION | Request::MASS_MATRIX;
        let of = |q: &[f64; 4], v: &[f64; 4]| {
            let mut terms = Terms::default();
            model.terms(q, v, request, &mut terms).unwrap();
            terms
        };
        for q in [[0.2, 3.0, -1.0, 0.5], [0.0, 0.1, 0.2, -0.3], [0.0, 1e-4, 0.0, 2.0]] {
            let v = [1.1, -0.4, 0.3, 0.2];
            let found = of(&q, &v);
            let step = 1e-5;
            let slope = |k: usize| {
                let shifted = |by: f64| {
                    let mut q = q;
                    q[k] += by;
                    of(&q, &v).mass_matrix
                };
                let (more, less) = (shifted(step), shifted(-step));
                more.iter().zip(less).map(|(a, b)| (a - b) / (2.0 * step)).collect::<Vec<f64>>()
            };
            let slopes: Vec<Vec<f64>> = (0..4).map(slope).collect();
            // M a = dL/dq - (dM/dt) v.
            for i in 0..4 {
                let pull: f64 = (0..16).map(|k| 0.5 * slopes[i][k] * v[k / 4] * v[k % 4]).sum();
                let change: f64 = (0..16).map(|k| slopes[k / 4][4 * i + k % 4] * v[k / 4] * v[k % 4]).sum();
                let force: f64 = (0..4).map(|j| found.mass_matrix[4 * i + j] * found.acceleration[j]).sum();
                let size = found.mass_matrix.iter().fold(1.0, |m: f64, x| m.max(x.abs()));
                assert!((force - pull + change).abs() < 1e-6 * size, "{q:?} {i}: {force} {pull} {change}");
            }
        }
    }

    #[test]
    fn radii_are_found_on_both_sides() {
        let model = TwoSided::new(Mechanics::new(Wormhole(1.0, 0.0), vec![]), 0, [1, 2, 3], 3.0, 1e3).unwrap();
        for radius in [-1e9, -4.0, 0.0, 1e-3, 7.0, 1e9] {
            let found = model.place([0.0, model.distance(radius), 0.0]).coordinates;
            assert!((found[0] - radius).abs() < 1e-9 * radius.abs().max(1.0), "{radius} {found:?}");
        }
    }

    #[test]
    fn charts_with_one_side_are_refused() {
        let one_sided = |name: &str| {
            let refused = TwoSided::new(
                SystemInstance::<f64>::named(name, &[]).unwrap().build().unwrap(),
                0,
                [1, 2, 3],
                20.0,
                2e3,
            )
            .err();
            assert!(matches!(refused, Some(RelativityError::OneSided { .. })), "{name}: {refused:?}");
        };
        one_sided("schwarzschild-geodesic");
        one_sided("kerr-cartesian");
        // Flat space has no sphere at l = 0, and spheres of a quarter of the area are not far away from anything.
        let flat = Mechanics::new(Wormhole(0.0, 0.0), vec![]);
        assert_eq!(TwoSided::new(flat, 0, [1, 2, 3], 3.0, 1e3).err(), Some(RelativityError::OneSided { radius: 0.0 }));
        let near = Mechanics::new(Wormhole(2e3, 0.0), vec![]);
        assert!(matches!(TwoSided::new(near, 0, [1, 2, 3], 3.0, 1e3), Err(RelativityError::OneSided { .. })));
        let twice = TwoSided::new(Mechanics::new(Wormhole(1.0, 0.0), vec![]), 0, [1, 2, 2], 3.0, 1e3);
        assert!(matches!(twice, Err(RelativityError::Chart { .. })));
    }
}
