//! Orbits in the equator of a metric that is the same at all times and around an axis: circular orbits, light and horizons,
//! and the free fall between two radii.
//!
//! With the components `g_tt`, `g_tp`, `g_pp` along the two symmetries, `t` the time and `p` the turn about the axis, a circular orbit of
//! angular velocity `w = dp/dt` obeys `g_tt' + 2 g_tp' w + g_pp' w^2 = 0`, `' = d/dr` along the equator, whatever the other coordinates do.
//! Its energy and angular momentum per mass are `E = -(g_tt + g_tp w)/s`, `L = (g_tp + g_pp w)/s`, `s^2 = -(g_tt + 2 g_tp w + g_pp w^2)`.
//! A factor of the metric changes none of the places found here.
//!
//! Source: Bardeen, Press and Teukolsky, Astrophys. J. 178, 347 (1972).

use super::{GeometryError, expect_length};
use crate::lagrangian::EulerLagrange;
use crate::scalar::{Real, Scalar};
use alloc::vec::Vec;

/// Coordinate, or plane of two, in which a metric turns about its axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Turn {
    /// An angle about the axis.
    Angle(usize),
    /// The second of two Cartesian coordinates around the axis; the first one is the radius of [`Equator`], and this one is 0 there.
    Across(usize),
}

/// Sense of an orbit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sense {
    /// The larger of the two angular velocities: with the hole, for a positive spin.
    Forward,
    /// The smaller one.
    Backward,
}

/// A ray in the equator: a metric, its time, and the line along which the radius grows.
#[derive(Clone, Copy)]
pub struct Equator<'a, S> {
    /// The metric.
    pub model: &'a dyn EulerLagrange<S>,
    /// Index of the time, on which the metric does not depend.
    pub time: usize,
    /// Index of the coordinate that grows along the ray.
    pub radius: usize,
    /// The turn about the axis.
    pub turn: Turn,
    /// A point of the equator, `(n)`; its radius is not read.
    pub point: &'a [S],
}

/// Metric along the two symmetries, with its first and second derivatives by the radius: `tt`, `tp`, `pp` of each.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Symmetric<S> {
    /// `g_tt`, `g_tp`, `g_pp`.
    pub value: [S; 3],
    /// Their first derivatives.
    pub first: [S; 3],
    /// Their second derivatives.
    pub second: [S; 3],
}

/// Circular orbit of free fall or light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CircularOrbit<S> {
    /// Radius, in the coordinate of the ray.
    pub radius: S,
    /// `dp/dt`.
    pub angular_velocity: S,
}

impl<S: Scalar> CircularOrbit<S> {
    /// `|L/E|` of light that circles here: the impact parameter of a ray from afar that is just not captured. `1/|w|`, as the orbit is null.
    pub fn impact_parameter(&self) -> S {
        Real::abs(self.angular_velocity).recip()
    }
}

/// `(tt, tp, pp) -> tt + 2 tp w + pp w^2`.
fn form<S: Scalar>([tt, tp, pp]: [S; 3], w: S) -> S {
    tt + (tp + tp + pp * w) * w
}

impl<S: Scalar> Symmetric<S> {
    /// Angular velocity of the circular orbit of this sense, timelike or not; `None` where there is none.
    pub(crate) fn angular_velocity(&self, sense: Sense) -> Option<S> {
        let [tt, tp, pp] = self.first;
        let root = tp * tp - tt * pp;
        if root.is_nan() || root < <S as Real>::zero() {
            return None;
        }
        let root = if sense == Sense::Forward { Real::sqrt(root) } else { -Real::sqrt(root) };
        Some((root - tp) / pp)
    }

    /// `-g(k, k)` of the orbit's direction `k = d/dt + w d/dp`, over the size of its terms: positive of matter, 0 of light.
    fn lag(&self, sense: Sense) -> Option<S> {
        let w = self.angular_velocity(sense)?;
        Some(-form(self.value, w) / Real::abs(self.value[2] * w * w))
    }

    /// A number of the sign of `dE/dr` of the circular orbits: positive where they are stable. `None` where there is no such orbit of matter.
    pub(crate) fn stability(&self, sense: Sense) -> Option<S> {
        let w = self.angular_velocity(sense)?;
        let ([tt, tp, pp], [tt1, tp1, pp1]) = (self.value, self.first);
        let slope = -form(self.second, w) / (<S as Real>::two() * (tp1 + pp1 * w));
        let square = -form(self.value, w);
        let energy = tt + tp * w;
        let rate = -(tt1 + tp1 * w + tp * slope) * square - energy * (tp + pp * w) * slope;
        (square > <S as Real>::zero()).then_some(rate)
    }

    /// `g_tp^2 - g_tt g_pp`: positive outside a horizon, where something can stay at its radius, negative inside.
    pub(crate) fn room(&self) -> S {
        let [tt, tp, pp] = self.value;
        tp * tp - tt * pp
    }

    /// Angular velocity `-g_tp/g_pp` of what falls without angular momentum: the dragging of frames.
    pub fn dragging(&self) -> S {
        -self.value[1] / self.value[2]
    }
}

/// Steps of a search, each by a factor of the radius.
const STEPS: usize = 400;

impl<S: Scalar> Equator<'_, S> {
    /// The metric along the symmetries at a radius.
    ///
    /// # Errors
    /// [`GeometryError::Shape`] for a point of the wrong length or an index beyond it; what the model refuses.
    pub fn at(&self, radius: S) -> Result<Symmetric<S>, GeometryError> {
        let n = self.model.coordinates();
        expect_length("point of the equator", n, self.point.len())?;
        let (turned, by_radius) = match self.turn {
            Turn::Angle(i) => (i, false),
            Turn::Across(i) => (i, true),
        };
        if let Some(found) = [self.time, self.radius, turned].into_iter().find(|&i| i >= n) {
            return Err(GeometryError::Shape { what: "coordinate of the equator", expected: n, found });
        }
        let mut q = self.point.to_vec();
        q[self.radius] = radius;
        let jets = self.model.metric_jets(&q, &vec![<S as Real>::zero(); n])?;
        let jet = &jets[0];
        let pairs = [(self.time, self.time), (self.time, turned), (turned, turned)];
        let (zero, one, two) = (<S as Real>::zero(), <S as Real>::one(), <S as Real>::two());
        let pick = |from: &[S]| pairs.map(|(i, j)| from[i * n + j]);
        let k = self.radius;
        let value = pick(&jet.metric);
        let first = pick(&jet.first[k * n * n..]);
        let second = pick(&jet.second[(k * n + k) * n * n..]);
        if !by_radius {
            return Ok(Symmetric { value, first, second });
        }
        // d/dp = r d/dy: a component takes a factor of r for each.
        let factor = [(one, zero, zero), (radius, one, zero), (radius * radius, two * radius, two)];
        let product = |i: usize| {
            let (f, f1, f2) = factor[i];
            [f * value[i], f1 * value[i] + f * first[i], f2 * value[i] + two * f1 * first[i] + f * second[i]]
        };
        let [a, b, c] = [product(0), product(1), product(2)];
        Ok(Symmetric { value: [a[0], b[0], c[0]], first: [a[1], b[1], c[1]], second: [a[2], b[2], c[2]] })
    }

    /// Outermost radius between `low` and `high` below which a number that is positive outside stops being positive, to the precision of
    /// the numbers; `None` if it is positive everywhere, or nowhere at the outer end.
    ///
    /// # Errors
    /// As [`Equator::at`].
    fn outermost(
        &self,
        (low, high): (S, S),
        of: impl Fn(&Symmetric<S>) -> Option<S>,
    ) -> Result<Option<S>, GeometryError> {
        let positive = |radius: S| -> Result<bool, GeometryError> {
            Ok(of(&self.at(radius)?).is_some_and(|number| number > <S as Real>::zero()))
        };
        let factor = Real::exp(Real::ln(low / high) / S::of_f64(STEPS as f64));
        let mut outer = high;
        if !positive(outer)? {
            return Ok(None);
        }
        for step in 0..STEPS {
            let mut inner = if step + 1 == STEPS { low } else { outer * factor };
            if positive(inner)? {
                outer = inner;
                continue;
            }
            loop {
                let middle = (inner + outer) * <S as Real>::half();
                if !(middle > inner && middle < outer) {
                    return Ok(Some(outer));
                }
                if positive(middle)? {
                    outer = middle;
                } else {
                    inner = middle;
                }
            }
        }
        Ok(None)
    }

    fn orbit(&self, radius: Option<S>, sense: Sense) -> Result<Option<CircularOrbit<S>>, GeometryError> {
        let Some(radius) = radius else { return Ok(None) };
        let angular_velocity = self.at(radius)?.angular_velocity(sense);
        Ok(angular_velocity.map(|angular_velocity| CircularOrbit { radius, angular_velocity }))
    }

    /// The innermost stable circular orbit of matter, sought from `high` inward to `low`; `None` if there is none.
    ///
    /// # Errors
    /// As [`Equator::at`].
    pub fn innermost_stable(&self, range: (S, S), sense: Sense) -> Result<Option<CircularOrbit<S>>, GeometryError> {
        let radius = self.outermost(range, |metric| metric.stability(sense))?;
        self.orbit(radius, sense)
    }

    /// The circular orbit of light, sought from `high` inward to `low`; `None` if there is none.
    ///
    /// # Errors
    /// As [`Equator::at`].
    pub fn light(&self, range: (S, S), sense: Sense) -> Result<Option<CircularOrbit<S>>, GeometryError> {
        let radius = self.outermost(range, |metric| metric.lag(sense))?;
        self.orbit(radius, sense)
    }

    /// The horizon, inside which nothing can stay at constant radius, sought from `high` inward to `low`; `None` if there is none.
    ///
    /// # Errors
    /// As [`Equator::at`].
    pub fn horizon(&self, range: (S, S)) -> Result<Option<S>, GeometryError> {
        self.outermost(range, |metric| Some(metric.room()))
    }

    /// The ergosurface, inside which nothing can stay at rest, sought from `high` inward to `low`; `None` if there is none.
    ///
    /// # Errors
    /// As [`Equator::at`].
    pub fn ergosurface(&self, range: (S, S)) -> Result<Option<S>, GeometryError> {
        self.outermost(range, |metric| Some(-metric.value[0]))
    }
}

/// Free fall in the equator at a turning point, where its radius is stationary.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TurningPoint<S> {
    /// Energy per mass.
    pub energy: S,
    /// Angular momentum per mass.
    pub angular_momentum: S,
    /// `dt/dtau`.
    pub time_rate: S,
    /// `dp/dtau`, `p` the turn about the axis.
    pub turning_rate: S,
}

impl<S: Scalar> Symmetric<S> {
    /// The state of matter of `energy` and `ratio = L/E` that turns here: `g(v, v) = -1` with `v` along the symmetries alone.
    fn turning(&self, ratio: S) -> Option<TurningPoint<S>> {
        let [tt, tp, pp] = self.value;
        // E^2 pp + 2 E L tp + L^2 tt = tp^2 - tt pp, the inverse of the block of the symmetries.
        let square = self.room() / (pp + (tp + tp + tt * ratio) * ratio);
        if square.is_nan() || square <= <S as Real>::zero() {
            return None;
        }
        let energy = Real::sqrt(square);
        let angular_momentum = ratio * energy;
        let (time_rate, turning_rate) =
            ((pp * energy + tp * angular_momentum) / self.room(), -(tp * energy + tt * angular_momentum) / self.room());
        (time_rate > <S as Real>::zero()).then_some(TurningPoint { energy, angular_momentum, time_rate, turning_rate })
    }
}

impl<S: Scalar> Equator<'_, S> {
    /// The free fall with this sense that turns at both radii, at the first of them; `None` if there is none.
    ///
    /// Energy and angular momentum per mass obey `E^2 g_pp + 2 E L g_tp + L^2 g_tt = g_tp^2 - g_tt g_pp` at every turning point of the
    /// radius; two such points determine both. Whether the motion between them is possible is not tested.
    ///
    /// # Errors
    /// As [`Equator::at`].
    pub fn between(&self, near: S, far: S, sense: Sense) -> Result<Option<TurningPoint<S>>, GeometryError> {
        let (here, there) = (self.at(near)?, self.at(far)?);
        let of = |metric: &Symmetric<S>| metric.value.map(|component| component / metric.room());
        let (a, b) = (of(&here), of(&there));
        let [tt, tp, pp] = [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
        // (pp + 2 x tp + x^2 tt)/room is the same at both, x = L/E.
        let root = tp * tp - tt * pp;
        if root.is_nan() || root < <S as Real>::zero() {
            return Ok(None);
        }
        let root = Real::sqrt(root);
        let of_root = |root: S| here.turning((root - tp) / tt);
        let mut found: Vec<TurningPoint<S>> = [of_root(root), of_root(-root)].into_iter().flatten().collect();
        found.sort_by(|a, b| a.turning_rate.to_f64().total_cmp(&b.turning_rate.to_f64()));
        Ok(match sense {
            Sense::Forward => found.pop().filter(|turning| turning.turning_rate > <S as Real>::zero()),
            Sense::Backward => found.into_iter().next().filter(|turning| turning.turning_rate < <S as Real>::zero()),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Turn;
    use crate::lagrangian::SystemInstance;
    use std::f64::consts::FRAC_PI_2;

    const ORIGIN: [f64; 4] = [0.0, 0.0, FRAC_PI_2, 0.0];

    fn equator(model: &dyn EulerLagrange<f64>) -> Equator<'_, f64> {
        Equator { model, time: 0, radius: 1, turn: Turn::Angle(3), point: &ORIGIN }
    }

    #[test]
    fn turning_points_of_schwarzschild_have_the_closed_form() {
        let hole = SystemInstance::<f64>::named("schwarzschild-geodesic", &[]).unwrap().build().unwrap();
        let equator = equator(&*hole);
        for (p, e) in [(7.5, 0.3), (10.0, 0.1), (40.0, 0.6)] {
            let (near, far) = (p / (1.0 + e), p / (1.0 - e));
            let forward = equator.between(near, far, Sense::Forward).unwrap().unwrap();
            // Chandrasekhar, The Mathematical Theory of Black Holes, section 19.
            let common = p - 3.0 - e * e;
            let (energy, momentum) = ((((p - 2.0).powi(2) - 4.0 * e * e) / p / common).sqrt(), p / common.sqrt());
            assert!((forward.energy - energy).abs() < 1e-12 && (forward.angular_momentum - momentum).abs() < 1e-10);
            assert!((forward.time_rate - energy / (1.0 - 2.0 / near)).abs() < 1e-11);
            assert!((forward.turning_rate - momentum / near.powi(2)).abs() < 1e-11);
            let backward = equator.between(near, far, Sense::Backward).unwrap().unwrap();
            assert!((backward.angular_momentum + momentum).abs() < 1e-10);
        }
        // Within the orbit of light, at 3 M, no matter turns.
        assert_eq!(equator.between(2.4, 2.8, Sense::Forward).unwrap(), None);
    }

    #[test]
    fn both_turning_points_of_kerr_have_the_same_constants() {
        let hole = SystemInstance::<f64>::named("kerr-geodesic", &[("a".to_string(), "0.9".to_string())])
            .unwrap()
            .build()
            .unwrap();
        let equator = equator(&*hole);
        for sense in [Sense::Forward, Sense::Backward] {
            let [near, far] = [(10.0, 25.0), (25.0, 10.0)].map(|(a, b)| equator.between(a, b, sense).unwrap().unwrap());
            assert!((near.energy - far.energy).abs() < 1e-12);
            assert!((near.angular_momentum - far.angular_momentum).abs() < 1e-11);
            for (radius, found) in [(10.0, near), (25.0, far)] {
                let [tt, tp, pp] = equator.at(radius).unwrap().value;
                let (t, p) = (found.time_rate, found.turning_rate);
                assert!((tt * t * t + 2.0 * tp * t * p + pp * p * p + 1.0).abs() < 1e-12);
                assert_eq!(p > 0.0, sense == Sense::Forward);
            }
        }
    }
}
