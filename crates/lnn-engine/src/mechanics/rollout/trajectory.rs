//! Sampled motion, and the sample times.

use super::RolloutError;
use super::options::{RolloutOptions, blur};
use super::thresholds::STATES_TOGETHER;
use crate::lagrangian::{EulerLagrange, Request, Terms};
use crate::scalar::{Real, Scalar};
use serde::{Deserialize, Serialize};
use std::fmt::Write as _;

/// Counts of steps and evaluations in an integration.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct StepCounts {
    /// Steps taken.
    pub accepted: usize,
    /// Steps attempted but rejected.
    pub rejected: usize,
    /// States evaluated: accelerations for the adaptive methods, momenta and forces for the structure-preserving ones.
    pub evaluations: usize,
    /// Iterations of implicit equations; 0 for explicit methods.
    #[serde(default)]
    pub iterations: usize,
}

impl std::ops::AddAssign for StepCounts {
    fn add_assign(&mut self, other: Self) {
        self.accepted += other.accepted;
        self.rejected += other.rejected;
        self.evaluations += other.evaluations;
        self.iterations += other.iterations;
    }
}

/// States at successive times, in physical units.
#[derive(Clone, Debug, PartialEq)]
pub struct Trajectory<S> {
    /// Number of coordinates `n`.
    pub coordinates: usize,
    /// Times.
    pub t: Vec<S>,
    /// Coordinates, `(len, n)`; angles are continuous.
    pub q: Vec<S>,
    /// Velocities, `(len, n)`.
    pub v: Vec<S>,
    /// Energy of the integrated model at each time, if requested; `NaN` if it could not be computed.
    pub energy: Option<Vec<S>>,
}

impl<S: Scalar> Trajectory<S> {
    /// Creates a trajectory of `n` coordinates without states.
    pub fn empty(coordinates: usize) -> Self {
        Self { coordinates, t: Vec::new(), q: Vec::new(), v: Vec::new(), energy: None }
    }

    /// Appends a state.
    pub(super) fn push(&mut self, t: S, q: &[S], v: &[S]) {
        self.t.push(t);
        self.q.extend_from_slice(q);
        self.v.extend_from_slice(v);
    }

    /// Returns the number of states.
    pub fn len(&self) -> usize {
        self.t.len()
    }

    /// Returns `true` if there are no states.
    pub fn is_empty(&self) -> bool {
        self.t.is_empty()
    }

    /// Returns state `k` as `(q, v)`.
    ///
    /// # Panics
    /// If `k` is not below [`Trajectory::len`].
    pub fn state(&self, k: usize) -> (&[S], &[S]) {
        let rows = k * self.coordinates..(k + 1) * self.coordinates;
        (&self.q[rows.clone()], &self.v[rows])
    }

    /// Computes the energy `E = p.v - L` of `model` at every state; `NaN` if the model cannot be evaluated there.
    pub fn energy_by(&self, model: &dyn EulerLagrange<S>) -> Vec<S> {
        let size = STATES_TOGETHER * self.coordinates.max(1);
        let mut energy = Vec::with_capacity(self.len());
        let mut terms = Terms::default();
        let states = self.q.chunks(size).zip(self.v.chunks(size));
        for ((q, v), t) in states.zip(self.t.chunks(STATES_TOGETHER)) {
            let batch = t.len();
            terms.energy.clear();
            // The error for a row that is not finite is ignored, since the result shows it as `NaN` or infinite.
            let computed = model.terms_at(t, q, v, Request::ENERGY, &mut terms);
            if terms.energy.len() == batch {
                energy.extend(terms.energy.iter().map(|&e| if e.is_finite() { e } else { S::nan() }));
            } else {
                debug_assert!(computed.is_err());
                energy.resize(energy.len() + batch, S::nan());
            }
        }
        energy
    }

    /// Converts the states to another precision.
    pub fn cast<T: Scalar>(&self) -> Trajectory<T> {
        let cast = |values: &[S]| values.iter().map(|&x| x.cast()).collect::<Vec<T>>();
        Trajectory {
            coordinates: self.coordinates,
            t: cast(&self.t),
            q: cast(&self.q),
            v: cast(&self.v),
            energy: self.energy.as_deref().map(cast),
        }
    }

    /// Formats the trajectory as CSV with the header `t, columns..` and, if stored, `energy`; with all digits, one state per line. If a
    /// column is already called `t`, the time of a spacetime, the first column is called `tau`.
    ///
    /// `columns` are the `2n` names of a state, coordinates then velocities.
    ///
    /// # Errors
    /// [`RolloutError::Invalid`] if the number of columns is not `2n`.
    pub fn to_csv<T: AsRef<str>>(&self, columns: &[T]) -> Result<String, RolloutError> {
        Ok(self.csv_header(columns)? + &self.csv_rows())
    }

    /// Returns the header of [`Trajectory::to_csv`] as one line.
    ///
    /// # Errors
    /// Those of [`Trajectory::to_csv`].
    pub fn csv_header<T: AsRef<str>>(&self, columns: &[T]) -> Result<String, RolloutError> {
        let n = self.coordinates;
        if columns.len() != 2 * n {
            return Err(RolloutError::Invalid {
                what: "columns",
                problem: format!("expected {} names, found {}", 2 * n, columns.len()),
            });
        }
        let taken = columns.iter().any(|column| column.as_ref() == "t");
        let mut text = String::from(if taken { "tau" } else { "t" });
        for column in columns {
            text.push(',');
            text.push_str(&quoted(column.as_ref()));
        }
        text.push_str(if self.energy.is_some() { ",energy\n" } else { "\n" });
        Ok(text)
    }

    /// Returns the lines of [`Trajectory::to_csv`] below the header.
    pub fn csv_rows(&self) -> String {
        let mut text = String::new();
        for (k, t) in self.t.iter().enumerate() {
            let (q, v) = self.state(k);
            text.push_str(&t.to_text());
            for x in q.iter().chain(v) {
                let _ = write!(text, ",{}", x.to_text());
            }
            if let Some(energy) = self.energy.as_ref().and_then(|energy| energy.get(k)) {
                let _ = write!(text, ",{}", energy.to_text());
            }
            text.push('\n');
        }
        text
    }
}

/// Formats a CSV field, with quotes if necessary.
pub fn quoted(field: &str) -> String {
    if field.contains([',', '"', '\n', '\r']) { format!("\"{}\"", field.replace('"', "\"\"")) } else { field.into() }
}

/// Elapsed times of samples, ascending from 0.
pub(super) trait Times<S> {
    /// Returns the number of samples.
    fn len(&self) -> usize;
    /// Returns the elapsed time of sample `k`, if it exists.
    fn get(&self, k: usize) -> Option<S>;
}

impl<S: Copy> Times<S> for Vec<S> {
    fn len(&self) -> usize {
        self.as_slice().len()
    }

    fn get(&self, k: usize) -> Option<S> {
        self.as_slice().get(k).copied()
    }
}

/// The sample times from the options: `t0 + k dt`, and `t_end` as the last one.
#[derive(Clone, Copy, Debug)]
pub(super) struct Samples<S> {
    t0: S,
    t_end: S,
    /// `abs(dt)`, and `dt` with the sign of the direction of time.
    step: S,
    signed: S,
    /// Number of samples before the last one.
    regular: usize,
}

impl<S: Scalar> Samples<S> {
    /// Computes the sample times of options that are already checked.
    pub(super) fn new(options: &RolloutOptions<S>) -> Self {
        let (t0, t_end) = (options.t0, options.t_end);
        let span = t_end - t0;
        let step = options.dt.abs();
        let signed = if span < <S as Real>::zero() { -step } else { step };
        let ratio = span.abs() / step;
        let blur = blur(options);
        let whole = (ratio + blur).floor();
        let count = whole.to_f64() as usize;
        let regular = if (ratio - whole).abs() <= blur { count } else { count + 1 };
        Self { t0, t_end, step, signed, regular }
    }

    /// Returns the time of sample `k`.
    pub(super) fn time(&self, k: usize) -> S {
        if k < self.regular { self.t0 + S::of_f64(k as f64) * self.signed } else { self.t_end }
    }

    /// Returns the elapsed time `abs(t - t0)` of sample `k`.
    pub(super) fn elapsed(&self, k: usize) -> S {
        if k < self.regular { S::of_f64(k as f64) * self.step } else { (self.t_end - self.t0).abs() }
    }

    /// Returns the number of samples whose elapsed time is at most `end`.
    pub(super) fn count_until(&self, end: S) -> usize {
        let (mut low, mut high) = (0, self.len());
        while low < high {
            let middle = low + (high - low) / 2;
            if self.elapsed(middle) <= end { low = middle + 1 } else { high = middle }
        }
        low
    }
}

/// Samples `first..after` with times relative to `start`, and the end of the interval if it is not a sample.
#[derive(Clone, Copy, Debug)]
pub(super) struct Part<S> {
    pub(super) all: Samples<S>,
    pub(super) first: usize,
    pub(super) after: usize,
    pub(super) start: S,
    pub(super) end: Option<S>,
}

impl<S: Scalar> Times<S> for Part<S> {
    fn len(&self) -> usize {
        self.after - self.first + usize::from(self.end.is_some())
    }

    fn get(&self, k: usize) -> Option<S> {
        let sample = self.first + k;
        let elapsed = if sample < self.after { Some(self.all.elapsed(sample)) } else { self.end };
        elapsed.filter(|_| k < self.len()).map(|e| S::max(e - self.start, <S as Real>::zero()))
    }
}

impl<S: Scalar> Times<S> for Samples<S> {
    fn len(&self) -> usize {
        self.regular + 1
    }

    fn get(&self, k: usize) -> Option<S> {
        (k <= self.regular).then(|| self.elapsed(k))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn two() -> Trajectory<f64> {
        Trajectory {
            coordinates: 1,
            t: vec![0.0, 0.1],
            q: vec![1.0, 1.0 / 3.0],
            v: vec![0.0, -1e-300],
            energy: Some(vec![0.5, f64::NAN]),
        }
    }

    #[test]
    fn csv_keeps_every_digit() {
        let text = two().to_csv(&["x", "a,\"b\""]).unwrap();
        let mut lines = text.lines();
        assert_eq!(lines.next().unwrap(), "t,x,\"a,\"\"b\"\"\",energy");
        assert_eq!(lines.next().unwrap(), "0.0,1.0,0.0,0.5");
        let fields: Vec<f64> = lines.next().unwrap().split(',').map(|f| f.parse().unwrap()).collect();
        assert_eq!(fields[..3], [0.1, 1.0 / 3.0, -1e-300]);
        assert!(fields[3].is_nan());
        assert_eq!(lines.next(), None);
        assert!(two().to_csv(&["x"]).is_err());
        assert!(two().to_csv(&["t", "t_dot"]).unwrap().starts_with("tau,t,t_dot,energy\n"));
    }

    #[test]
    fn states_and_casts() {
        let trajectory = two();
        assert_eq!(trajectory.state(1), (&[1.0 / 3.0][..], &[-1e-300][..]));
        let single: Trajectory<f32> = trajectory.cast();
        assert_eq!(single.q, [1.0, 1.0 / 3.0]);
        assert_eq!(single.v[1], 0.0);
    }

    fn times<S: Scalar>(options: RolloutOptions<S>) -> Vec<S> {
        let samples = Samples::new(&options);
        (0..samples.len()).map(|k| samples.time(k)).collect()
    }

    #[test]
    fn sample_times_are_the_requested_ones() {
        let times = |t0: f64, t_end: f64, dt: f64| times(RolloutOptions { t0, ..RolloutOptions::new(t_end, dt) });
        assert_eq!(times(0.0, 0.3, 0.1), [0.0, 0.1, 0.2, 0.3]);
        assert_eq!(times(0.0, 0.35, 0.1), [0.0, 0.1, 0.2, 0.1 * 3.0, 0.35]);
        assert_eq!(times(1.0, 0.0, 0.5), [1.0, 0.5, 0.0]);
        assert_eq!(times(-1.0, 1.0, -1.0), [-1.0, 0.0, 1.0]);
        assert_eq!(times(2.0, 2.0, 0.1), [2.0]);
        assert_eq!(times(0.0, 0.05, 0.1), [0.0, 0.05]);
        assert_eq!(times(0.0, 100.0, 0.1).len(), 1001);
        assert_eq!(times(1e6, 1e6 + 1.0, 0.1).len(), 11);
        let single = super::tests::times(RolloutOptions::<f32>::new(100.0, 0.1));
        assert_eq!(single.len(), 1001);
        assert_eq!(*single.last().unwrap(), 100.0);
        // The last sample is exactly at the end, whatever the rounding of the quotient, and no sample is later.
        let many = Samples::new(&RolloutOptions::<f32>::new(200_000.0, 1.0));
        assert_eq!((many.len(), many.get(200_000), many.get(200_001)), (200_001, Some(200_000.0), None));
    }
}
