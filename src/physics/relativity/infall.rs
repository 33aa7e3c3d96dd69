//! Free fall through a horizon.

use super::CentralCoordinates;
use super::event::{State, passing, zero};
use crate::geometry::characters;
use crate::lagrangian::EulerLagrange;
use crate::linalg::Inertia;

/// A fall from a state down to a distance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Infall {
    /// Time of the motion: the proper time of a motion on the mass shell.
    pub time: f64,
    /// `true` if the metric has the signature of the start at all samples.
    pub keeps_signature: bool,
}

fn signature(model: &dyn EulerLagrange<f64>, state: &State) -> Option<Inertia> {
    characters(model, &state.q, &state.v).ok()?.first()?.signature
}

/// The fall from `(q, v)` to the distance `to` from the centre, sampled every `dt`, until `t_end`; `None` if the motion does not get there.
pub fn infall(
    model: &dyn EulerLagrange<f64>,
    (q, v): (&[f64], &[f64]),
    (around, to): (CentralCoordinates, f64),
    (t_end, dt): (f64, f64),
) -> Option<Infall> {
    let above = |state: &State| around.distance(&state.q) - to;
    let first = signature(model, &State { t: 0.0, q: q.to_vec(), v: v.to_vec() });
    let mut keeps_signature = first.is_some();
    let found = passing(model, (q, v), (t_end, dt), |state| {
        keeps_signature &= signature(model, state) == first;
        above(state) <= 0.0
    })?;
    let end = zero(model, &found, above).ok()?;
    Some(Infall { time: end.t, keeps_signature })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lagrangian::build;
    use crate::relativity::Chart;

    #[test]
    fn a_fall_from_rest_is_a_cycloid_through_the_horizon() {
        let around = CentralCoordinates::Cartesian(Chart::default());
        let hole = build::<f64>("schwarzschild-cartesian", &[]).unwrap();
        let (start, end) = (10.0_f64, 1.5);
        let q = around.place(start, [0.48, 0.6, 0.64]);
        let v = [(1.0 - 2.0 / start).sqrt().recip(), 0.0, 0.0, 0.0];
        let found = infall(&*hole, (&q, &v), (around, end), (100.0, 0.25)).unwrap();
        // r = r0 (1 + cos x)/2, tau = sqrt(r0^3/8M) (x + sin x).
        let x = (2.0 * end / start - 1.0).acos();
        let exact = (start.powi(3) / 8.0).sqrt() * (x + x.sin());
        assert!((found.time / exact - 1.0).abs() < 1e-9, "{} {exact}", found.time);
        assert!(found.keeps_signature);
        assert_eq!(infall(&*hole, (&q, &v), (around, end), (10.0, 0.25)), None);
    }
}
