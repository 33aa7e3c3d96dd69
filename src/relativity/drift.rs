//! Drift of what the exact motion conserves along a motion of a model.

use super::event::passing;
use crate::lagrangian::{Configured, EulerLagrange};

/// Largest change of the system's conserved vector along the motion of a model from `(q, v)` until `t_end`, sampled every `dt`, relative to
/// its length at the start; `None` for a system without one, or a motion that does not reach the end.
pub(crate) fn conserved_drift(
    system: &Configured<f64>,
    model: &dyn EulerLagrange<f64>,
    (q, v): (&[f64], &[f64]),
    (t_end, dt): (f64, f64),
) -> Option<f64> {
    let start = system.conserved(q, v)?;
    let distance = |other: &[f64]| start.iter().zip(other).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt();
    let size = distance(&vec![0.0; start.len()]);
    let mut worst = 0.0_f64;
    passing(model, (q, v), (t_end, dt), |state| {
        worst = worst.max(system.conserved(&state.q, &state.v).map_or(f64::NAN, |vector| distance(&vector)) / size);
        state.t >= t_end
    })?;
    worst.is_finite().then_some(worst)
}
