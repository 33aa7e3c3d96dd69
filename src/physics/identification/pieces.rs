//! Pieces of recorded motion between long gaps, which give initial states for segments.
//!
//! Smoothing does not bridge a long gap, but the integration does: pieces matter only at the beginning of the search.

use super::driven::Segment;
use super::segments::thinned;
use super::thresholds::{LEAST_SAMPLES, LEAST_SEGMENT, LEAST_SMOOTHED_SAMPLES, LEAST_TRACK, POLYNOMIAL_RIDGE};
use super::{IdentifyError, IdentifyOptions};
use crate::linalg::{self, Workspace};
use crate::recording::smooth::{SmoothError, SmoothOptions, Smoothed, Smoothing, noise};
use crate::recording::survey::{Stillness, stillness};
use crate::recording::{Clock, Filled, RecordedTrajectory, Recording};
use std::ops::Range;

/// A piece of a trajectory between long gaps.
pub(super) struct Piece {
    pub track: usize,
    pub samples: Range<usize>,
    /// Its index among the long pieces, if it is one.
    long: Option<usize>,
}

/// The pieces of a recording, in order.
pub(super) struct Pieces<'a> {
    recording: &'a Recording,
    /// All pieces, trajectory by trajectory.
    all: Vec<Piece>,
    /// The long pieces as separate trajectories.
    pub long: Recording,
    /// The trajectory and the samples that each of them comes from.
    origin: Vec<(usize, Vec<usize>)>,
    /// Smoothing of the long pieces; `None` if there are none.
    pub smoothing: Option<Smoothing>,
    pub smoothed: Vec<Option<Smoothed>>,
    /// Typical step between samples in s.
    pub step: f64,
    /// Standard deviation of every coordinate's noise, as given or as estimated.
    pub noise: Vec<f64>,
    /// The same by trajectory, each estimated from its own pieces.
    pub noise_of: Vec<Vec<f64>>,
    /// Messages about coordinates that stand still.
    pub still: Vec<String>,
}

/// The samples of a piece as a trajectory of its own, with their indices in the whole one; of repeated measurements only the first.
struct Part {
    track: RecordedTrajectory,
    samples: Vec<usize>,
}

/// Divides the trajectories of a recording at their long gaps.
fn divided(recording: &Recording) -> (Vec<Piece>, Vec<Part>) {
    let (mut pieces, mut parts) = (Vec::new(), Vec::new());
    for (track, recorded) in recording.tracks.iter().enumerate().filter(|(_, t)| t.len() >= LEAST_TRACK) {
        // Repeated measurements of a state count once.
        let distinct: Vec<usize> =
            (0..recorded.len()).filter(|&k| k == 0 || recorded.times[k] > recorded.times[k - 1]).collect();
        let times: Vec<f64> = distinct.iter().map(|&k| recorded.times[k]).collect();
        let clock = Clock::of(&times);
        let gap = |k: &usize| !clock.reaches_across(times[*k] - times[k - 1]);
        let bounds: Vec<usize> = [0].into_iter().chain((1..times.len()).filter(gap)).chain([times.len()]).collect();
        for pair in bounds.windows(2) {
            let samples = distinct[pair[0]..pair[1]].to_vec();
            let end = distinct.get(pair[1]).copied().unwrap_or(recorded.len());
            pieces.push(Piece { track, samples: samples[0]..end, long: None });
            parts.push(Part { track: selected(recorded, &samples, recording.n()), samples });
        }
    }
    (pieces, parts)
}

/// Times and values of one coordinate in the pieces of a trajectory.
struct Readings {
    track: usize,
    times: Vec<f64>,
    values: Vec<f64>,
}

/// The readings of coordinate `i` by piece. Missing readings are left out, because the numbers in their place have no noise.
fn readings(pieces: &[Piece], parts: &[Part], (n, i): (usize, usize), missing: &[Vec<bool>]) -> Vec<Readings> {
    let of = |(piece, part): (&Piece, &Part)| {
        let own = missing.get(piece.track).filter(|own| !own.is_empty());
        let kept = (0..part.track.len()).filter(|&k| !own.is_some_and(|own| own[part.samples[k] * n + i]));
        let (times, values) = kept.map(|k| (part.track.times[k], part.track.q[k * n + i])).unzip();
        Readings { track: piece.track, times, values }
    };
    pieces.iter().zip(parts).map(of).collect()
}

/// Standard deviation of the noise of a coordinate, estimated from all pieces or from those of one trajectory.
fn estimated(readings: &[Readings], track: Option<usize>) -> f64 {
    let own = readings.iter().filter(|own| track.is_none_or(|track| own.track == track));
    noise(own.map(|own| (own.times.as_slice(), own.values.as_slice())), 1, 0).sigma
}

/// Chooses the smoothing of the long pieces; `None` if these are too short.
fn smoothing(long: &Recording, noise: Option<Vec<f64>>) -> Result<Option<Smoothing>, IdentifyError> {
    let choices = SmoothOptions { noise, ..SmoothOptions::default() };
    match (!long.tracks.is_empty()).then(|| Smoothing::choose(long, &choices)).transpose() {
        Ok(smoothing) => Ok(smoothing),
        Err(SmoothError::Short { .. }) => Ok(None),
        Err(error) => Err(error.into()),
    }
}

impl<'a> Pieces<'a> {
    /// The pieces of a recording; `filled` contains it with its held readings interpolated.
    pub fn new(
        recording: &'a Recording,
        filled: Option<&Filled>,
        options: &IdentifyOptions,
    ) -> Result<Self, IdentifyError> {
        let n = recording.n();
        let (mut all, parts) = divided(recording);
        let found: usize = all.iter().map(|piece| piece.samples.len()).sum();
        if found < LEAST_SAMPLES {
            return Err(IdentifyError::Short { found, needed: LEAST_SAMPLES });
        }
        let mut long = Recording { tracks: Vec::new(), ..recording.clone() };
        let mut origin = Vec::new();
        let enough = |(_, part): &(&mut Piece, &Part)| part.track.len() >= LEAST_SMOOTHED_SAMPLES;
        for (piece, part) in all.iter_mut().zip(&parts).filter(enough) {
            piece.long = Some(origin.len());
            long.tracks.push(part.track.clone());
            origin.push((piece.track, part.samples.clone()));
        }
        // Short pieces help to estimate the noise, but are not smoothed.
        let readings: Vec<_> = (0..n).map(|i| readings(&all, &parts, (n, i), &options.missing)).collect();
        let gaps = options.missing.iter().flatten().any(|missing| *missing);
        let given = gaps.then(|| (0..n).map(|i| estimated(&readings[i], None)).collect());
        let smoothing = smoothing(&long, options.noise.clone().or(given))?;
        let step = smoothing.as_ref().map_or_else(|| typical_step(&parts), |smoothing| smoothing.step);
        let sigma = |i: usize| match (&smoothing, &options.noise) {
            (Some(smoothing), _) => smoothing.coordinates[i].noise.sigma,
            (None, Some(given)) => given[i],
            (None, None) => estimated(&readings[i], None),
        };
        let noise: Vec<f64> = (0..n).map(sigma).collect();
        let of = |track: usize| (0..n).map(|i| estimated(&readings[i], Some(track))).collect();
        let noise_of = (0..recording.tracks.len()).map(of).collect();
        let still = smoothing.as_ref().map_or_else(Vec::new, |smoothing| stillness(&long, smoothing));
        let still = still.into_iter().filter(|(_, how)| !matches!(how, Stillness::Copy(_)));
        let still = still
            .map(|(i, how)| format!("{} {how}; nothing can be learned about it", recording.coordinates[i]))
            .collect();
        let smoothed = Vec::new();
        let mut pieces = Self { recording, all, long, origin, smoothing, smoothed, step, noise, noise_of, still };
        pieces.smooth(filled)?;
        Ok(pieces)
    }

    /// Smooths the long pieces, the second time with smoothed values in place of held readings: these weight the readings around as if the held
    /// ones were missing.
    fn smooth(&mut self, filled: Option<&Filled>) -> Result<(), IdentifyError> {
        let (n, smoothing) = (self.recording.n(), self.smoothing.as_ref());
        let smooth = |track: &RecordedTrajectory| smoothing.map(|smoothing| smoothing.apply(track)).transpose();
        self.smoothed = self.long.tracks.iter().map(smooth).collect::<Result<Vec<_>, _>>()?;
        let Some(filled) = filled else { return Ok(()) };
        for ((track, smoothed), (from, samples)) in self.long.tracks.iter_mut().zip(&self.smoothed).zip(&self.origin) {
            let held = samples.iter().flat_map(|k| &filled.held[*from][k * n..(k + 1) * n]);
            let values = smoothed.iter().flat_map(|smoothed| &smoothed.q);
            let held = track.q.iter_mut().zip(values).zip(held).filter(|(_, held)| **held);
            held.for_each(|((q, value), _)| *q = *value);
        }
        self.smoothed = self.long.tracks.iter().map(smooth).collect::<Result<Vec<_>, _>>()?;
        Ok(())
    }

    /// Trajectory and sample index of a sample of a long piece.
    pub fn origin(&self, track: usize, sample: usize) -> (usize, usize) {
        let (from, samples) = &self.origin[track];
        (*from, samples[sample])
    }

    /// Segments of the long pieces.
    pub fn cut_long(&self) -> Vec<Segment> {
        let n = self.recording.n();
        let of = |(track, smoothed): (usize, &Option<Smoothed>)| {
            let smoothed = smoothed.as_ref()?;
            let length = smoothed.times.len();
            let start = |first: usize| {
                let start = [&smoothed.q, &smoothed.v].map(|values| &values[first * n..(first + 1) * n]).concat();
                Segment { track, first, samples: LEAST_SEGMENT.min(length - first), start }
            };
            Some((0..length).step_by(LEAST_SEGMENT).map(start).collect::<Vec<_>>())
        };
        thinned(self.smoothed.iter().enumerate().filter_map(of).flatten().collect())
    }

    /// First and second derivatives of smoothed motion at samples with full windows, `(samples, n)` each.
    pub fn rates(&self) -> [Vec<f64>; 2] {
        let n = self.recording.n();
        let of = |rate: fn(&Smoothed) -> &[f64]| {
            let full = |smoothed: &Smoothed| smoothed.interior().filter(|at| smoothed.is_full(*at)).collect::<Vec<_>>();
            let row = |smoothed: &Smoothed, at: usize| rate(smoothed)[at * n..(at + 1) * n].to_vec();
            let rows =
                |smoothed: &Smoothed| full(smoothed).into_iter().flat_map(|at| row(smoothed, at)).collect::<Vec<_>>();
            self.smoothed.iter().flatten().flat_map(rows).collect()
        };
        [of(|smoothed| &smoothed.v), of(|smoothed| &smoothed.a)]
    }

    /// First samples after long gaps, by trajectory.
    pub fn gaps(&self) -> Vec<Vec<usize>> {
        let mut gaps = vec![Vec::new(); self.recording.tracks.len()];
        self.all.iter().filter(|piece| piece.samples.start > 0).for_each(|p| gaps[p.track].push(p.samples.start));
        gaps
    }

    /// Segments of about this many samples. A short piece forms one segment with the pieces after it.
    pub fn cut(&self, samples: usize) -> Vec<Segment> {
        let mut segments: Vec<Segment> = Vec::new();
        for pieces in self.all.chunk_by(|one, next| one.track == next.track) {
            let (track, mut first) = (pieces[0].track, 0);
            for piece in pieces {
                let recorded = &self.recording.tracks[track];
                let (end, rest) = (piece.samples.end, recorded.len() - piece.samples.end);
                let long = end - first >= LEAST_SEGMENT && (rest == 0 || rest >= LEAST_SEGMENT);
                if !long && rest > 0 {
                    continue;
                }
                let length = end - first;
                let count = ((length + samples / 2) / samples).max(1);
                for k in 0..count {
                    let (from, to) = (first + k * length / count, first + (k + 1) * length / count);
                    segments.push(Segment { track, first: from, samples: to - from, start: self.start(track, from) });
                }
                first = end;
            }
        }
        thinned(segments)
    }

    /// Position and velocity at a sample, from the smoothed motion or from a polynomial through the samples nearby.
    pub fn start(&self, track: usize, sample: usize) -> Vec<f64> {
        let n = self.recording.n();
        let behind = self.all.partition_point(|piece| (piece.track, piece.samples.start) <= (track, sample));
        let piece = behind.checked_sub(1).and_then(|at| self.all.get(at));
        let long = piece.and_then(|piece| piece.long);
        if let Some((smoothed, k)) = long.and_then(|k| Some((self.smoothed[k].as_ref()?, k))) {
            let at = self.origin[k].1.partition_point(|state| *state <= sample).saturating_sub(1);
            return [&smoothed.q, &smoothed.v].map(|values| &values[at * n..(at + 1) * n]).concat();
        }
        nearby(&self.recording.tracks[track], n, sample, piece.map_or(0..0, |piece| piece.samples.clone()))
    }
}

/// The given samples of a trajectory.
fn selected(track: &RecordedTrajectory, samples: &[usize], n: usize) -> RecordedTrajectory {
    let rows = |values: &[f64]| match values.is_empty() {
        true => Vec::new(),
        false => samples.iter().flat_map(|&k| values[k * n..(k + 1) * n].to_vec()).collect(),
    };
    let times = samples.iter().map(|&k| track.times[k]).collect();
    let (name, q, v) = (track.name.clone(), rows(&track.q), rows(&track.v));
    RecordedTrajectory { name, times, q, v, a: rows(&track.a), force: rows(&track.force) }
}

/// Median step within pieces; 1 if no piece has a step.
fn typical_step(parts: &[Part]) -> f64 {
    let mut steps: Vec<f64> =
        parts.iter().flat_map(|part| part.track.times.windows(2).map(|pair| pair[1] - pair[0])).collect();
    steps.sort_by(f64::total_cmp);
    steps.get(steps.len() / 2).copied().unwrap_or(1.0)
}

/// Position and velocity at a sample, from a quadratic polynomial through all samples of its piece and, if these are few, the samples closest in
/// time.
fn nearby(track: &RecordedTrajectory, n: usize, sample: usize, piece: Range<usize>) -> Vec<f64> {
    let (mut first, mut end) = (piece.start.min(sample), piece.end.max(sample + 1));
    let now = track.times[sample];
    while end - first < LEAST_SEGMENT && (first > 0 || end < track.len()) {
        let before = || now - track.times[first - 1] <= track.times[end] - now;
        if end == track.len() || (first > 0 && before()) { first -= 1 } else { end += 1 }
    }
    let span = track.times[first..end].iter().fold(0.0, |most: f64, t| most.max((t - now).abs()));
    let (mut matrix, mut rights) = ([0.0; 9], vec![[0.0; 3]; n]);
    for k in first..end {
        let t = if span > 0.0 { (track.times[k] - now) / span } else { 0.0 };
        let row = [1.0, t, t * t];
        for i in 0..3 {
            (0..3).for_each(|j| matrix[3 * i + j] += row[i] * row[j]);
            (0..n).for_each(|c| rights[c][i] += row[i] * track.q[k * n + c]);
        }
    }
    // Fewer than three times do not determine the polynomial: the ridge chooses the smallest one.
    (0..3).for_each(|i| matrix[4 * i] += POLYNOMIAL_RIDGE);
    let mut start = vec![0.0; 2 * n];
    for (i, right) in rights.iter().enumerate() {
        let mut solved = [0.0; 3];
        let _ = linalg::solve(3, &matrix, right, &mut solved, &mut Workspace::new());
        (start[i], start[n + i]) = (solved[0], if span > 0.0 { solved[1] / span } else { 0.0 });
    }
    start
}
