//! Bound orbits in the equator of a metric: the free fall between two radii.

use super::GeometryError;
use super::orbits::{Equator, Sense, Symmetric};
use crate::scalar::{Real, Scalar};

/// Free fall in the equator at a turning point, where its radius stands still.
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
    /// The free fall of a sense that turns at both radii, at the first of them; `None` if there is none.
    ///
    /// Energy and angular momentum per mass obey `E^2 g_pp + 2 E L g_tp + L^2 g_tt = g_tp^2 - g_tt g_pp` wherever the radius stands still;
    /// two such places determine both. Whether the motion between them is possible is not asked.
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
    use crate::lagrangian::{EulerLagrange, build};
    use std::f64::consts::FRAC_PI_2;

    const ORIGIN: [f64; 4] = [0.0, 0.0, FRAC_PI_2, 0.0];

    fn equator(model: &dyn EulerLagrange<f64>) -> Equator<'_, f64> {
        Equator { model, time: 0, radius: 1, turn: Turn::Angle(3), point: &ORIGIN }
    }

    #[test]
    fn turning_points_of_schwarzschild_have_the_closed_form() {
        let hole = build::<f64>("schwarzschild-geodesic", &[]).unwrap();
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
        let hole = build::<f64>("kerr-geodesic", &[("a".to_string(), "0.9".to_string())]).unwrap();
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
