//! Precession of bound orbits.

use super::Around;
use super::event::{State, passing, zero};
use crate::lagrangian::EulerLagrange;
use std::f64::consts::TAU;

/// One radial period of a bound orbit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RadialPeriod {
    /// Angle from one periastron to the next, over the full turn, in the sense of the motion: the advance of the periastron.
    pub advance: f64,
    /// Time of the motion from one periastron to the next.
    pub time: f64,
}

/// The radial period of the motion in the equator that starts at a periastron `(q, v)`.
///
/// The motion is sampled every `dt`, a small part of its period, and followed until `t_end`; `None` if it does not come back by then.
pub fn radial_period(
    model: &dyn EulerLagrange<f64>,
    (q, v): (&[f64], &[f64]),
    around: Around,
    (t_end, dt): (f64, f64),
) -> Option<RadialPeriod> {
    let outward = |state: &State| around.outward(&state.q, &state.v);
    let angle = |state: &State| around.azimuth(&state.q);
    let turned = |from: f64, to: f64| (to - from + 1.5 * TAU).rem_euclid(TAU) - 0.5 * TAU;
    let start = State { t: 0.0, q: q.to_vec(), v: v.to_vec() };
    let (mut last, mut total, mut kept) = (angle(&start), 0.0, 0.0);
    // Out, back in, and out again.
    let (mut gone, mut returning) = (false, false);
    let found = passing(model, (q, v), (t_end, dt), |state| {
        kept = total;
        let at = angle(state);
        total += turned(last, at);
        let speed = outward(state);
        gone |= speed > 0.0;
        returning |= gone && speed < 0.0;
        let back = returning && speed >= 0.0;
        if !back {
            last = at;
        }
        back
    })?;
    let end = zero(model, &found, outward).ok()?;
    let angle = kept + turned(angle(&found[0]), angle(&end));
    Some(RadialPeriod { advance: angle.abs() - TAU, time: end.t })
}
