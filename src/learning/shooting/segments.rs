//! Trajectories cut into segments: observations in scaled coordinates, and their positions between integration steps.
//!
//! The samples of a segment are its own; it is integrated over equal steps from its first sample to the first of the next
//! segment, or to its last sample if none follows. A sample between two steps is predicted by the cubic Hermite polynomial
//! of positions and velocities at both, whose error is of the integrator's own order 4. Periodic coordinates are counted
//! from a multiple of `2 pi` near the segment's start, so that a motion of many turns loses no digits.

use super::thresholds::{NOISE_RANGE, STATE_RANGE};
use crate::data::{Noise, StateEstimate};
use crate::lagrangian::Manifold;
use crate::network::Architecture;
use crate::recording::hermite;
use crate::rollout::SampledForce;
use crate::scalar::{Real, Scalar};
use crate::shooting::starts_allowed::StartsAllowed;
use std::f64::consts::TAU;
use std::ops::Range;
use std::sync::Arc;

/// One segment.
#[derive(Clone, Debug)]
pub(super) struct Segment<S> {
    /// Its samples in the lists of all samples.
    pub samples: Range<usize>,
    /// Length of an integration step in s.
    pub step: S,
    /// Seconds from its start to its end.
    pub duration: f64,
    /// `true` if the next segment of the list continues where this one ends.
    pub has_next: bool,
    /// `true` if the previous segment ends where this one starts.
    pub has_previous: bool,
    /// `true` if the velocities were measured.
    pub has_velocity: bool,
    /// Scaled offset of the next segment's origin of positions from this segment's, `(n)`.
    pub jump: Vec<S>,
}

/// Interpolation of a sample: its step, and the coefficients of the states at both ends of the step for position and velocity.
#[derive(Clone, Copy, Debug)]
pub(super) struct Place<S> {
    pub step: usize,
    /// Coefficients of the position for `q`, `v` at the start and `q`, `v` at the end of the step.
    pub position: [S; 4],
    /// The same coefficients for the velocity.
    pub velocity: [S; 4],
}

impl<S: Scalar> Place<S> {
    /// Interpolates at the relative time `fraction` of step `step`, which has length `h`.
    fn new(step: usize, fraction: f64, h: f64) -> Self {
        let [position, velocity] = hermite(fraction, h);
        Self { step, position: position.map(S::of_f64), velocity: velocity.map(S::of_f64) }
    }
}

/// Segments of recorded trajectories of `n` coordinates, in the scaled coordinates of a network.
#[derive(Clone, Debug)]
pub struct Segments<S> {
    pub(super) n: usize,
    /// Integration steps of every segment.
    pub(super) steps: usize,
    pub(super) list: Vec<Segment<S>>,
    /// Observed positions of all samples, `(samples, n)`.
    pub(super) q: Vec<S>,
    /// Observed velocities, zeros where there are none, `(samples, n)`.
    pub(super) v: Vec<S>,
    pub(super) places: Vec<Place<S>>,
    /// External forces at the steps' ends and middles, `(segments, 2 steps + 1, n)`; empty if there are none.
    pub(super) force: Vec<S>,
    /// Tolerances `tau` of positions and velocities, `(2, n)`: their noise; for velocities that were not measured, from the ratio of the
    /// spreads of velocities and positions.
    pub(super) tau: Vec<S>,
    /// Largest distance of positions from the start, and largest velocity, `(2, n)`.
    pub(super) range: Vec<S>,
    /// Estimated starts, `(segments, 2, n)`.
    starts: Vec<S>,
    /// The constraints on the starts.
    pub(super) allowed: Option<StartsAllowed<S>>,
}

/// Samples of one track that belong to one segment, and whether another segment follows.
struct Piece {
    samples: Range<usize>,
    has_next: bool,
}

/// Cuts `times` into pieces of about `per_segment` samples; none crosses a pause as long as a whole segment.
fn pieces(times: &[f64], per_segment: usize) -> Vec<Piece> {
    let mut intervals: Vec<f64> = times.windows(2).map(|pair| pair[1] - pair[0]).collect();
    if intervals.is_empty() {
        return Vec::new();
    }
    let middle = intervals.len() / 2;
    let pause = per_segment as f64 * *intervals.select_nth_unstable_by(middle, f64::total_cmp).1;
    let mut ends: Vec<usize> = (1..times.len()).filter(|&k| times[k] - times[k - 1] > pause).collect();
    ends.push(times.len());
    let (mut pieces, mut first) = (Vec::new(), 0);
    for end in ends {
        let samples = end - first;
        let count = ((samples + per_segment / 2) / per_segment).max(1);
        if samples >= 2 {
            let at = |k: usize| first + k * samples / count;
            pieces.extend((0..count).map(|k| Piece { samples: at(k)..at(k + 1), has_next: k + 1 < count }));
        }
        first = end;
    }
    pieces
}

impl<S: Scalar> Segments<S> {
    /// Cuts trajectories for a network of this shape; each segment is integrated over `steps` equal steps.
    ///
    /// Samples that are isolated between pauses are left out. Shapes must have been checked.
    pub fn new(
        architecture: &Architecture,
        trajectories: &[StateEstimate<'_>],
        noise: &Noise,
        per_segment: usize,
        steps: usize,
    ) -> Self {
        let n = architecture.coordinates;
        let forced = trajectories.iter().any(|t| !t.track.force.is_empty());
        let mut all = Self {
            n,
            steps,
            list: Vec::new(),
            q: Vec::new(),
            v: Vec::new(),
            places: Vec::new(),
            force: Vec::new(),
            tau: Vec::new(),
            range: Vec::new(),
            starts: Vec::new(),
            allowed: None,
        };
        // Largest displacement within a segment and largest speed, in physical units.
        let mut largest = vec![0.0_f64; 2 * n];
        for trajectory in trajectories {
            let force = trajectory.force();
            let force = forced.then_some(force.as_ref());
            for piece in pieces(&trajectory.track.times, per_segment) {
                all.push(architecture, trajectory, !noise.v.is_empty(), &piece, force, &mut largest);
            }
        }
        let scale = |i: usize| architecture.scale[i];
        for i in 0..n {
            all.tau.push(S::of_f64(noise.q[i] / scale(i)));
        }
        for i in 0..n {
            let ratio: f64 =
                spread(trajectories.iter().map(|t| t.v), n, i) / spread(trajectories.iter().map(|t| t.q), n, i);
            let ratio = if ratio.is_finite() && ratio > 0.0 { ratio } else { 1.0 };
            let sigma = noise.v.get(i).copied().unwrap_or(noise.q[i] * ratio);
            all.tau.push(S::of_f64(sigma / scale(i)));
        }
        // If nothing moves, the noise sets the range.
        all.range = (0..2 * n)
            .map(|k| S::of_f64(STATE_RANGE * largest[k] / scale(k % n)).max(S::of_f64(NOISE_RANGE) * all.tau[k]))
            .collect();
        all
    }

    /// Adds constraints to the segments and projects the starts onto them.
    pub fn under(mut self, architecture: &Architecture, manifold: Arc<dyn Manifold<S>>) -> Self {
        let allowed = StartsAllowed::new(architecture, manifold);
        self.starts.chunks_exact_mut(2 * self.n).for_each(|start| allowed.bring(start));
        self.allowed = Some(allowed);
        self
    }

    fn push(
        &mut self,
        architecture: &Architecture,
        trajectory: &StateEstimate<'_>,
        use_velocity: bool,
        piece: &Piece,
        force: Option<Option<&SampledForce<f64>>>,
        largest: &mut [f64],
    ) {
        let n = self.n;
        let track = trajectory.track;
        let scale = &architecture.scale;
        let Piece { samples: Range { start, end }, has_next } = *piece;
        let last = if has_next { end } else { end - 1 };
        let begin = track.times[start];
        let duration = track.times[last] - begin;
        let h = duration / self.steps as f64;
        let origin = |sample: usize, i: usize| {
            if architecture.periodic[i] { TAU * (trajectory.q[sample * n + i] / TAU).round() } else { 0.0 }
        };
        let scaled = |x: f64, i: usize| S::of_f64(x / scale[i]);
        let has_velocity = use_velocity && !track.v.is_empty();
        let first = self.places.len();
        for sample in start..end {
            let at = (track.times[sample] - begin) / h;
            let step = (at.floor().max(0.0) as usize).min(self.steps - 1);
            self.places.push(Place::new(step, at - step as f64, h));
            for i in 0..n {
                let k = sample * n + i;
                self.q.push(scaled(track.q[k] - origin(start, i), i));
                self.v.push(if has_velocity { scaled(track.v[k], i) } else { <S as Real>::zero() });
                let moved = trajectory.q[k] - trajectory.q[start * n + i];
                largest[i] = largest[i].max(moved.abs());
                largest[n + i] = largest[n + i].max(trajectory.v[k].abs());
            }
        }
        self.starts.extend((0..n).map(|i| scaled(trajectory.q[start * n + i] - origin(start, i), i)));
        self.starts.extend((0..n).map(|i| scaled(trajectory.v[start * n + i], i)));
        let jump = |i: usize| if has_next { scaled(origin(end, i) - origin(start, i), i) } else { <S as Real>::zero() };
        if let Some(force) = force {
            // A track without forces has zeros if other tracks have forces.
            let mut values = vec![0.0; n];
            for k in 0..=2 * self.steps {
                if let Some(force) = force {
                    force.at(begin + 0.5 * k as f64 * h, &mut values);
                }
                self.force.extend(values.iter().zip(scale).map(|(force, scale)| S::of_f64(force * scale)));
            }
        }
        self.list.push(Segment {
            samples: first..self.places.len(),
            step: S::of_f64(h),
            duration,
            has_next,
            has_previous: self.list.last().is_some_and(|segment| segment.has_next),
            has_velocity,
            jump: (0..n).map(jump).collect(),
        });
    }

    /// Number of segments.
    pub fn len(&self) -> usize {
        self.list.len()
    }
    /// `true` if there is no segment.
    pub fn is_empty(&self) -> bool {
        self.list.is_empty()
    }
    /// Samples of all segments.
    pub fn samples(&self) -> usize {
        self.places.len()
    }
    /// Integration steps of every segment.
    pub fn steps(&self) -> usize {
        self.steps
    }
    /// Noise of component `k` of a start, `(2, n)`, scaled.
    pub(crate) fn tolerance(&self, k: usize) -> S {
        self.tau[k]
    }
    /// Estimated starts `(q/s, v/s)`, `(segments, 2, n)`; positions from the segment's origin.
    pub fn starts(&self) -> &[S] {
        &self.starts
    }
    /// Selects about `count` segments evenly by length, from the longest to the shortest.
    pub(super) fn cross_section(&self, count: usize) -> Vec<u32> {
        let mut rows: Vec<u32> = (0..self.len() as u32).collect();
        rows.sort_by(|&a, &b| self.list[b as usize].duration.total_cmp(&self.list[a as usize].duration));
        rows.into_iter().step_by(self.len().div_ceil(count.max(1)).max(1)).collect()
    }
}

/// Root mean square deviation of column `i` of `n` from its mean over each list.
fn spread<'a>(lists: impl Iterator<Item = &'a [f64]>, n: usize, i: usize) -> f64 {
    let (mut square, mut count) = (0.0, 0.0);
    for list in lists {
        let column = || list.iter().skip(i).step_by(n);
        let samples = column().count() as f64;
        let mean = column().sum::<f64>() / samples;
        square += column().map(|x| (x - mean).powi(2)).sum::<f64>();
        count += samples;
    }
    (square / count).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pieces_are_even_and_never_reach_over_a_pause() {
        let mut times: Vec<f64> = (0..100).map(|k| 0.1 * f64::from(k)).collect();
        times.extend((0..21).map(|k| 100.0 + 0.1 * f64::from(k)));
        times.push(200.0);
        let found: Vec<_> =
            pieces(&times, 30).into_iter().map(|p| (p.samples.start, p.samples.end, p.has_next)).collect();
        assert_eq!(found, [(0, 33, true), (33, 66, true), (66, 100, false), (100, 121, false)]);
        assert!(pieces(&[0.0], 30).is_empty() && pieces(&[], 30).is_empty());
    }

    #[test]
    fn a_cubic_is_interpolated_exactly() {
        let h = 0.3;
        let (q, v) = (|t: f64| t * t * t - 2.0 * t * t + t - 0.5, |t: f64| 3.0 * t * t - 4.0 * t + 1.0);
        for fraction in [0.0, 0.25, 0.9, 1.0] {
            let place = Place::<f64>::new(0, fraction, h);
            let sum =
                |factors: [f64; 4]| factors[0] * q(0.0) + factors[1] * v(0.0) + factors[2] * q(h) + factors[3] * v(h);
            assert!((sum(place.position) - q(fraction * h)).abs() < 1e-15);
            assert!((sum(place.velocity) - v(fraction * h)).abs() < 1e-14);
        }
    }
}
