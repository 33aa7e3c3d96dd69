//! Bound orbits in the equator of a metric: the free fall between two radii.

use super::GeometryError;
use super::orbits::{Equator, Sense, Symmetric};
use crate::scalar::{Real, Scalar};

/// Free fall in the equator at a turning point, where its radius stands still.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Turning<S> {
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
    fn turning(&self, ratio: S) -> Option<Turning<S>> {
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
        (time_rate > <S as Real>::zero()).then_some(Turning { energy, angular_momentum, time_rate, turning_rate })
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
    pub fn between(&self, near: S, far: S, sense: Sense) -> Result<Option<Turning<S>>, GeometryError> {
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
        let mut found: Vec<Turning<S>> = [of_root(root), of_root(-root)].into_iter().flatten().collect();
        found.sort_by(|a, b| a.turning_rate.to_f64().total_cmp(&b.turning_rate.to_f64()));
        Ok(match sense {
            Sense::Forward => found.pop().filter(|turning| turning.turning_rate > <S as Real>::zero()),
            Sense::Backward => found.into_iter().next().filter(|turning| turning.turning_rate < <S as Real>::zero()),
        })
    }
}
