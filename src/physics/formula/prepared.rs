//! Recorded motion prepared for the search: smoothed, and cut into blocks, stretches and segments.

use super::FormulaOptions;
use super::error::FormulaError;
use super::obstacles;
use super::thresholds::{
    LEAST_OWN_NOISE_SAMPLES, LEAST_RELATIVE_NOISE, LEAST_SAMPLES, LEAST_WHOLE_TRAJECTORIES, MOST_BRIDGED_GAP,
    OWN_NOISE_RATIO, PIECES_PER_TRAJECTORY, STARTING_SPEEDS, WINDOW_PACES,
};
use super::weak::Stretch;
use crate::cancellation::Cancellation;
use crate::identification::{Segment, joined, spread_of, thinned};
use crate::recording::smooth::{SmoothOptions, Smoothed, Smoothing, noise};
use crate::recording::{Clock, RecordedTrajectory, Recording};

/// Recorded motion with the results of smoothing.
#[derive(Debug)]
pub(super) struct Prepared<'a> {
    pub recording: &'a Recording,
    smoothed: Vec<Option<Smoothed>>,
    /// Noise of every coordinate.
    pub sigma: Vec<f64>,
    /// Noise by trajectory, where it clearly differs from that of all trajectories.
    pub sigma_of: Vec<Vec<f64>>,
    /// Standard deviation of every coordinate.
    pub spread: Vec<f64>,
    /// Usual time between samples, in s.
    pub step: f64,
    /// `false` if the noise and the motion could not be separated.
    pub resolved: bool,
    /// `true` for a coordinate whose noise was estimated and exceeds that of exact numbers.
    pub estimated: Vec<bool>,
    /// Notes about rows that do not look like motion, but are not far from it.
    pub suspicious: Vec<String>,
    /// Coordinates with known forces.
    pub forced: Vec<bool>,
    pub bounds: Vec<[f64; 2]>,
    pub speeds: Vec<f64>,
    /// Time scale of the motion, in s.
    pub pace: f64,
    /// Cancels the search.
    pub cancellation: Cancellation,
    pub n: usize,
}

impl<'a> Prepared<'a> {
    pub fn new(recording: &'a Recording, options: &FormulaOptions) -> Result<Self, FormulaError> {
        let n = recording.coordinates.len();
        let longest = recording.tracks.iter().map(|track| track.len()).max().unwrap_or(0);
        if longest < LEAST_SAMPLES {
            return Err(FormulaError::Short { found: longest, needed: LEAST_SAMPLES });
        }
        let choice = SmoothOptions { noise: options.noise.clone(), ..SmoothOptions::default() };
        let smoothing = Smoothing::choose(recording, &choice)?;
        let suspicious = obstacles::refuse(recording, &smoothing)?;
        let smooth =
            |track: &RecordedTrajectory| (track.len() >= LEAST_SAMPLES).then(|| smoothing.apply(track)).transpose();
        let smoothed = recording.tracks.iter().map(smooth).collect::<Result<Vec<_>, _>>()?;
        let bounds = ranges(recording);
        let least = |i: usize| LEAST_RELATIVE_NOISE * (bounds[i][1] - bounds[i][0]);
        let sigma: Vec<f64> = (0..n).map(|i| smoothing.coordinates[i].noise.sigma.max(least(i))).collect();
        let speeds: Vec<f64> = (0..n).map(|i| interior_spread(&smoothed, &|s, at| s.v[at * n + i])).collect();
        let accelerations: Vec<f64> = (0..n).map(|i| interior_spread(&smoothed, &|s, at| s.a[at * n + i])).collect();
        let step = smoothing.step;
        let pace = time_scale(&speeds, &accelerations, step);
        let resolved = smoothing.coordinates.iter().all(|c| c.noise.resolved);
        let speeds = speeds.into_iter().map(|s| if s > 0.0 { s } else { 1.0 }).collect();
        let own = |track: &RecordedTrajectory, i: usize| {
            let given = options.noise.is_some() || track.len() < LEAST_OWN_NOISE_SAMPLES;
            if given { sigma[i] } else { own_noise(track, (n, i), sigma[i], least(i)) }
        };
        let sigma_of = recording.tracks.iter().map(|track| (0..n).map(|i| own(track, i)).collect()).collect();
        let spread = (0..n).map(|i| spread_of(recording, i)).collect();
        let estimated = (0..n).map(|i| {
            let own = smoothing.coordinates[i].noise;
            options.noise.is_none() && own.resolved && own.sigma >= sigma[i]
        });
        let estimated = estimated.collect();
        let forced = |i: usize| recording.tracks.iter().any(|t| t.force.iter().skip(i).step_by(n).any(|f| *f != 0.0));
        let forced = (0..n).map(forced).collect();
        Ok(Self {
            recording,
            smoothed,
            sigma_of,
            sigma,
            spread,
            step,
            resolved,
            estimated,
            suspicious,
            forced,
            bounds,
            speeds,
            pace,
            cancellation: options.cancellation.clone(),
            n,
        })
    }

    /// Samples of the longest trajectory.
    pub fn longest(&self) -> usize {
        self.recording.tracks.iter().map(|track| track.len()).max().unwrap_or(0)
    }

    /// Width of test functions in s, and number of parts into which trajectories are cut.
    pub fn width(&self) -> (f64, usize) {
        let span = |times: &[f64]| times.last().zip(times.first()).map_or(0.0, |(last, first)| last - first);
        let longest = self.recording.tracks.iter().map(|track| span(&track.times)).fold(0.0, f64::max);
        let pieces = if self.recording.tracks.len() >= LEAST_WHOLE_TRAJECTORIES { 1 } else { PIECES_PER_TRAJECTORY };
        ((WINDOW_PACES * self.pace).min(longest / pieces as f64 / 2.5), pieces)
    }

    /// Speeds that weight unit masses, one set for each start of the elimination.
    pub fn starts(&self) -> impl Iterator<Item = Vec<f64>> + '_ {
        let at = move |number: usize| {
            (0..self.n).map(move |i| self.speeds[i] * STARTING_SPEEDS[number].powi(if i % 2 == 0 { 1 } else { -1 }))
        };
        (0..STARTING_SPEEDS.len()).map(move |number| at(number).collect())
    }

    /// The block of a segment.
    pub fn block_of(&self, segment: &Segment) -> usize {
        self.block(segment.track, segment.first)
    }

    /// The block of a sample.
    fn block(&self, track: usize, sample: usize) -> usize {
        if self.recording.tracks.len() >= LEAST_WHOLE_TRAJECTORIES {
            return track;
        }
        track * PIECES_PER_TRAJECTORY + sample * PIECES_PER_TRAJECTORY / self.recording.tracks[track].len().max(1)
    }

    /// Ranges of samples within one block.
    pub fn pieces(&self, track: usize) -> Vec<(usize, std::ops::Range<usize>)> {
        let length = self.recording.tracks[track].len();
        let mut pieces: Vec<(usize, std::ops::Range<usize>)> = Vec::new();
        for sample in 0..length {
            let block = self.block(track, sample);
            match pieces.last_mut() {
                Some((last, range)) if *last == block => range.end = sample + 1,
                _ => pieces.push((block, sample..sample + 1)),
            }
        }
        pieces
    }

    /// Smoothed motion for the weak form, at even steps: where samples are missing or late, the smoothing polynomials around them give the
    /// motion. Test functions do not reach across gaps that are a large part of their width.
    pub fn stretches(&self, width: f64) -> Vec<Stretch> {
        let mut stretches = Vec::new();
        for (track, smoothed) in self.smoothed.iter().enumerate() {
            let Some(smoothed) = smoothed else { continue };
            let force = &self.recording.tracks[track].force;
            let even = Clock::of(&smoothed.times).even;
            for (block, range) in self.pieces(track) {
                let full: Vec<usize> = range.filter(|&at| smoothed.is_full(at)).collect();
                let most = (width * MOST_BRIDGED_GAP).max(2.5 * self.step);
                let near = |a: &usize, b: &usize| smoothed.times[*b] - smoothed.times[*a] <= most;
                for part in full.chunk_by(near) {
                    let seconds = smoothed.times[part[part.len() - 1]] - smoothed.times[part[0]];
                    if part.len() >= LEAST_SAMPLES / 2 && seconds >= width {
                        let nodes = Nodes { smoothed, force, at: part, n: self.n };
                        stretches.push(if even { nodes.at_samples(block) } else { nodes.at_steps(self.step, block) });
                    }
                }
            }
        }
        stretches
    }

    /// Measured motion cut into segments of about `seconds`.
    pub fn segments(&self, seconds: f64) -> Vec<Segment> {
        let n = self.n;
        let mut segments = Vec::new();
        for (index, track) in self.recording.tracks.iter().enumerate() {
            let Some(smoothed) = &self.smoothed[index] else { continue };
            for (_, range) in self.pieces(index) {
                let times = &track.times[range.clone()];
                if times.len() < 2 * n + 2 {
                    continue;
                }
                let whole = times[times.len() - 1] - times[0];
                let most = (times.len() / (2 * n + 2).max(8)).max(1);
                let count = ((whole / seconds).round() as usize).clamp(1, most);
                for k in 0..count {
                    let [first, end] = [k, k + 1].map(|k| range.start + k * range.len() / count);
                    let [q, v] = [&smoothed.q, &smoothed.v].map(|values| &values[first * n..(first + 1) * n]);
                    segments.push(Segment { track: index, first, samples: end - first, start: [q, v].concat() });
                }
            }
        }
        thinned(segments)
    }

    /// Joins pairs of consecutive segments of a block.
    pub fn joined(&self, segments: &[Segment]) -> Vec<Segment> {
        segments.chunk_by(|a, b| self.block_of(a) == self.block_of(b)).flat_map(joined).collect()
    }
}

/// Ranges of the coordinates; a coordinate that stands still gets a range of 1.
fn ranges(recording: &Recording) -> Vec<[f64; 2]> {
    let mut bounds = vec![[f64::INFINITY, f64::NEG_INFINITY]; recording.n()];
    for track in &recording.tracks {
        for row in track.q.chunks_exact(recording.n()) {
            bounds.iter_mut().zip(row).for_each(|(b, &x)| *b = [b[0].min(x), b[1].max(x)]);
        }
    }
    for b in &mut bounds {
        if b[1] - b[0] < 1e-9 * b[0].abs().max(1e-9) {
            *b = [b[0] - 0.5, b[1] + 0.5];
        }
    }
    bounds
}

/// Standard deviation of a quantity over all samples away from the ends of trajectories.
fn interior_spread(smoothed: &[Option<Smoothed>], quantity: &dyn Fn(&Smoothed, usize) -> f64) -> f64 {
    let interior = smoothed.iter().flatten().flat_map(|s| s.interior().map(move |at| (s, at)));
    let values: Vec<f64> = interior.map(|(s, at)| quantity(s, at)).collect();
    let count = values.len().max(1) as f64;
    let mean = values.iter().sum::<f64>() / count;
    (values.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / count).sqrt()
}

/// The shortest time in which a speed changes by its own size; at least four steps.
fn time_scale(speeds: &[f64], accelerations: &[f64], step: f64) -> f64 {
    let times = speeds.iter().zip(accelerations).map(|(v, a)| v / a);
    let mut times: Vec<f64> = times.filter(|p| p.is_finite() && *p > 0.0).collect();
    times.sort_by(f64::total_cmp);
    times.first().copied().unwrap_or(20.0 * step).max(4.0 * step)
}

/// The noise of coordinate `i` of `n` in a trajectory, if it clearly differs from `usual`, else `usual`.
fn own_noise(track: &RecordedTrajectory, (n, i): (usize, usize), usual: f64, least: f64) -> f64 {
    let own = noise(std::iter::once((track.times.as_slice(), track.q.as_slice())), n, i).sigma;
    let differs = !(usual / OWN_NOISE_RATIO..usual * OWN_NOISE_RATIO).contains(&own);
    if differs { own.max(least) } else { usual }
}

/// Samples of smoothed motion, between which polynomials interpolate.
struct Nodes<'a> {
    smoothed: &'a Smoothed,
    force: &'a [f64],
    at: &'a [usize],
    n: usize,
}

impl Nodes<'_> {
    /// The samples themselves.
    fn at_samples(&self, block: usize) -> Stretch {
        let n = self.n;
        let of = |values: &[f64]| self.at.iter().flat_map(|at| &values[at * n..(at + 1) * n]).copied().collect();
        Stretch {
            times: self.at.iter().map(|&at| self.smoothed.times[at]).collect(),
            q: of(&self.smoothed.q),
            v: of(&self.smoothed.v),
            force: if self.force.is_empty() { Vec::new() } else { of(self.force) },
            block,
        }
    }

    /// Motion at even steps, interpolated from position, velocity and acceleration of the neighbouring samples.
    fn at_steps(&self, step: f64, block: usize) -> Stretch {
        let (n, times) = (self.n, &self.smoothed.times);
        let (first, last) = (times[self.at[0]], times[self.at[self.at.len() - 1]]);
        let count = ((last - first) / step).floor() as usize + 1;
        let mut stretch = Stretch { times: Vec::new(), q: Vec::new(), v: Vec::new(), force: Vec::new(), block };
        let mut k = 0;
        for t in (0..count).map(|c| first + c as f64 * step) {
            while k + 2 < self.at.len() && times[self.at[k + 1]] < t {
                k += 1;
            }
            let [a, b] = [self.at[k], self.at[(k + 1).min(self.at.len() - 1)]];
            let h = times[b] - times[a];
            let share = if h > 0.0 { (t - times[a]) / h } else { 0.0 };
            let weights = quintic(share, h);
            let known = |i: usize, at: usize| {
                [&self.smoothed.q, &self.smoothed.v, &self.smoothed.a].map(|values| values[at * n + i])
            };
            for i in 0..n {
                let ends = [known(i, a), known(i, b)];
                let sum = |weights: &[f64; 6]| ends.iter().flatten().zip(weights).map(|(x, w)| x * w).sum();
                stretch.q.push(sum(&weights[0]));
                stretch.v.push(sum(&weights[1]));
                if !self.force.is_empty() {
                    let [before, after] = [a, b].map(|at| self.force[at * n + i]);
                    stretch.force.push(before + share * (after - before));
                }
            }
            stretch.times.push(t);
        }
        stretch
    }
}

/// Weights of the quintic Hermite polynomial, for position and then velocity, of position, velocity and acceleration at the start and at the end
/// of an interval of length `h`, at the share `s` of it.
fn quintic(s: f64, h: f64) -> [[f64; 6]; 2] {
    let [s2, s3, s4, s5] = [2, 3, 4, 5].map(|k| s.powi(k));
    let rise = 10.0 * s3 - 15.0 * s4 + 6.0 * s5;
    let position = [
        1.0 - rise,
        h * (s - 6.0 * s3 + 8.0 * s4 - 3.0 * s5),
        h * h / 2.0 * (s2 - 3.0 * s3 + 3.0 * s4 - s5),
        rise,
        h * (-4.0 * s3 + 7.0 * s4 - 3.0 * s5),
        h * h / 2.0 * (s3 - 2.0 * s4 + s5),
    ];
    let slope = if h > 0.0 { 30.0 * (s2 - 2.0 * s3 + s4) / h } else { 0.0 };
    let velocity = [
        -slope,
        1.0 - 18.0 * s2 + 32.0 * s3 - 15.0 * s4,
        h / 2.0 * (2.0 * s - 9.0 * s2 + 12.0 * s3 - 5.0 * s4),
        slope,
        -12.0 * s2 + 28.0 * s3 - 15.0 * s4,
        h / 2.0 * (3.0 * s2 - 8.0 * s3 + 5.0 * s4),
    ];
    [position, velocity]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn motion_of_the_fifth_degree_is_met_between_samples() {
        let q = |t: f64| 1.0 - 2.0 * t + 0.5 * t * t + 0.25 * t.powi(3) - 0.3 * t.powi(4) + 0.1 * t.powi(5);
        let v = |t: f64| -2.0 + t + 0.75 * t * t - 1.2 * t.powi(3) + 0.5 * t.powi(4);
        let a = |t: f64| 1.0 + 1.5 * t - 3.6 * t * t + 2.0 * t.powi(3);
        let (start, h) = (0.3, 0.8);
        let known = [q(start), v(start), a(start), q(start + h), v(start + h), a(start + h)];
        for share in [0.0, 0.25, 0.5, 0.9, 1.0] {
            let [position, velocity] = quintic(share, h).map(|w| w.iter().zip(known).map(|(w, x)| w * x).sum::<f64>());
            let t = start + share * h;
            assert!((position - q(t)).abs() < 1e-14 && (velocity - v(t)).abs() < 1e-13, "{share}");
        }
    }
}
