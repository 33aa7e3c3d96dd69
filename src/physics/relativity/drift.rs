//! Drift of what the exact motion conserves along a motion of a model.

use super::event::passing;
use crate::analysis::conserved_change;
use crate::lagrangian::{EulerLagrange, SystemInstance};

/// Largest change of the system's conserved vector along the motion of a model from `(q, v)` until `t_end`, sampled every `dt`, relative to
/// its length at the start; `None` for a system without one, or a motion that does not reach the end.
pub(crate) fn conserved_drift(
    system: &SystemInstance<f64>,
    model: &dyn EulerLagrange<f64>,
    (q, v): (&[f64], &[f64]),
    (t_end, dt): (f64, f64),
) -> Option<f64> {
    let start = system.conserved(q, v)?;
    let mut worst = 0.0_f64;
    passing(model, (q, v), (t_end, dt), |state| {
        let now = system.conserved(&state.q, &state.v);
        worst = worst.max(now.map_or(f64::NAN, |vector| conserved_change(&start, &vector)));
        state.t >= t_end
    })?;
    worst.is_finite().then_some(worst)
}
