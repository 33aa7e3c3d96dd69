//! Observations that a model is compared with.

use crate::analysis::thresholds::{EXAMINED_STATES, OUTSIDE_MARGIN};
use crate::data::{Dataset, RecordingSplit, RecordingSplitError};
use crate::recording::Targets;

/// States with their accelerations, one trajectory after another in the order of time.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Observed {
    /// Coordinates, `(states, n)`.
    pub q: Vec<f64>,
    /// Velocities, `(states, n)`.
    pub v: Vec<f64>,
    /// Accelerations, `(states, n)`.
    pub a: Vec<f64>,
    /// Known external forces, `(states, n)`, or nothing.
    pub force: Vec<f64>,
    /// Root mean square error to expect of the accelerations of each coordinate, `(n)`: 0 of measured ones.
    pub error: Vec<f64>,
    /// The accelerations by smoothing of less bias and more noise, `(states, n)`, or nothing.
    pub finer: Vec<f64>,
    /// Number of errors of the accelerations that are independent, of each coordinate, `(n)`.
    pub independent: Vec<f64>,
    /// The model's residuals of the accelerations on held-out motion, over their size, `(n)`, or empty: the error of a network where it was
    /// not fitted.
    pub missed: Vec<f64>,
}

impl Observed {
    /// The training states of a fit.
    ///
    /// # Errors
    /// Those of [`RecordingSplit::datasets`].
    pub fn new(measured: &RecordingSplit, targets: Targets) -> Result<Self, RecordingSplitError> {
        let data = measured.datasets::<f64>(targets)?.training.remove(0);
        let finer = if is_derived(measured, targets) { measured.finer_accelerations() } else { None };
        let finer =
            finer.filter(|finer| finer.len() == data.a().len()).map(|finer| thinned(data.coordinates(), &finer));
        Ok(Self { finer: finer.unwrap_or_default(), ..Self::of(&data, measured, targets) })
    }

    /// The held-out states that test the model; `None` if none are held out.
    ///
    /// # Errors
    /// Those of [`RecordingSplit::datasets`].
    pub fn held_out(measured: &RecordingSplit, targets: Targets) -> Result<Option<Self>, RecordingSplitError> {
        if measured.test.states.is_empty() {
            return Ok(None);
        }
        Ok(Some(Self::of(&measured.datasets::<f64>(targets)?.test, measured, targets)))
    }

    /// Errors of smoothed accelerations are shared within a window; errors of a model change with the state and keep their sign over half a
    /// swing. Samples within half the fast period therefore count as one.
    fn of(data: &Dataset<f64>, measured: &RecordingSplit, targets: Targets) -> Self {
        let n = data.coordinates();
        let thinned = |values: &[f64]| thinned(n, values);
        let quality = || measured.smoothing.coordinates.iter().map(|c| &c.quality);
        let derived = is_derived(measured, targets);
        let samples = measured.training.recording.samples() as f64;
        let independent = quality().map(|quality| {
            let half = std::f64::consts::PI * quality.velocity / quality.acceleration / measured.smoothing.step;
            let half = if half.is_finite() { half } else { 1.0 };
            (samples / half.max(if derived { quality.window as f64 } else { 1.0 })).clamp(1.0, samples)
        });
        let independent = independent.collect();
        Self {
            q: thinned(data.q()),
            v: thinned(data.v()),
            a: thinned(data.a()),
            force: thinned(data.force()),
            error: quality().map(|quality| if derived { quality.total(2) } else { 0.0 }).collect(),
            finer: Vec::new(),
            independent,
            missed: Vec::new(),
        }
    }

    /// Share of the `other` states that lie outside of these: beyond the range of a coordinate (of the cosine and the sine of
    /// an angle, as a network sees it) or of a velocity, by more than a twentieth of the range.
    pub fn share_outside(&self, other: &Self, periodic: &[bool]) -> f64 {
        let n = periodic.len();
        let seen = |states: &Self, k: usize| -> Vec<f64> {
            let (q, v) = (&states.q[k * n..(k + 1) * n], &states.v[k * n..(k + 1) * n]);
            let position =
                q.iter().zip(periodic).flat_map(|(q, &angle)| if angle { [q.cos(), q.sin()] } else { [*q, 0.0] });
            position.chain(v.iter().copied()).collect()
        };
        let mut ranges = vec![[f64::INFINITY, f64::NEG_INFINITY]; 3 * n];
        for k in 0..self.q.len() / n {
            ranges.iter_mut().zip(seen(self, k)).for_each(|(r, x)| *r = [r[0].min(x), r[1].max(x)]);
        }
        let count = other.q.len() / n;
        let outside = |k: &usize| {
            let beyond = |([low, high], x): (&[f64; 2], f64)| {
                let margin = OUTSIDE_MARGIN * (high - low);
                x < low - margin || x > high + margin
            };
            ranges.iter().zip(seen(other, *k)).any(beyond)
        };
        (0..count).filter(outside).count() as f64 / f64::max(1.0, count as f64)
    }
}

/// `true` if accelerations were taken by smoothing.
fn is_derived(measured: &RecordingSplit, targets: Targets) -> bool {
    !(targets.takes_measured() && measured.training.recording.has_accelerations())
}

/// Evenly spaced rows of `n` numbers, at most about [`EXAMINED_STATES`].
fn thinned(n: usize, values: &[f64]) -> Vec<f64> {
    let stride = (values.len() / n).div_ceil(EXAMINED_STATES).max(1);
    values.chunks_exact(n).step_by(stride).flatten().copied().collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn states_beyond_the_learned_ones_are_counted() {
        let states = |q: &[f64]| Observed { q: q.to_vec(), v: vec![0.0; q.len()], ..Observed::default() };
        // Angles from -1 to 1, and lengths from 2 to 4.
        let learned = states(&[-1.0, 2.0, 0.0, 4.0, 1.0, 3.0]);
        let share = |q: &[f64]| learned.share_outside(&states(q), &[true, false]);
        assert_eq!(share(&[0.5, 3.0, -0.9, 4.05]), 0.0);
        assert_eq!(share(&[0.5 + std::f64::consts::TAU, 3.0]), 0.0);
        assert_eq!(share(&[3.0, 3.0, 0.5, 3.0]), 0.5);
        assert_eq!(share(&[0.0, 4.5]), 1.0);
        let fast = Observed { v: vec![9.0, 0.0], ..states(&[0.0, 3.0]) };
        assert_eq!(learned.share_outside(&fast, &[true, false]), 1.0);
    }
}
