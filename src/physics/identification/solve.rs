//! Multiple shooting: residuals and normal equations of constants, sensor constants and the initial states of segments.
//!
//! Every segment has an initial state of its own, which is eliminated from the normal equations.

use super::descent::Spectrum;
use super::driven::{DrivenEquations, Segment};
use super::follow::Follower;
use super::innovations::{Disturbances, Filter};
use super::lanes::State;
use super::linear::{inverse_with, times};
use super::measured::{Measured, ReadingSlopes};
use super::thresholds::{FAILED_SQUARE, GIVEN_WEIGHT, HUBER, LANES, RIDGE, START_ROUNDS};
use crate::cancellation::Cancellation;
use crate::lagrangian::system::Range;
use crate::linalg::dot;
use crate::scalar::update;
use std::f64::consts::TAU;

/// A constant of a sensor: measured positions are `gain q(t - delay) + offset`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum SensorKind {
    Offset,
    Gain,
    Delay,
}

/// Unknown constant of the sensor of a coordinate.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Sensor {
    pub kind: SensorKind,
    pub coordinate: usize,
}

impl Sensor {
    /// The value of a perfect sensor.
    pub fn perfect(self) -> f64 {
        if self.kind == SensorKind::Gain { 1.0 } else { 0.0 }
    }
}

/// Unknowns of the fit other than initial states, and the weights of residuals.
#[derive(Clone, Debug)]
pub(crate) struct Problem<'a> {
    pub driven: DrivenEquations<'a>,
    /// Values of all parameters of the system; those of `chosen` are replaced by unknowns.
    pub values: Vec<f64>,
    /// Parameters that are unknown.
    pub chosen: Vec<usize>,
    pub ranges: Vec<Range>,
    pub sensors: Vec<Sensor>,
    /// Quantities that were measured in place of the coordinates, if any. The fields below are by coordinate, or by such a reading.
    pub measured: Option<&'a Measured>,
    /// Standard deviation of every coordinate's noise.
    pub sigma: Vec<f64>,
    /// The same by trajectory, if trajectories differ; otherwise empty.
    pub sigma_of: Vec<Vec<f64>>,
    /// The same for every sample, if known, `(samples, n)` by trajectory; otherwise empty.
    pub errors: &'a [Vec<f64>],
    /// Marks of missing readings of positions, `(samples, n)` by trajectory; empty if none is missing.
    pub missing: &'a [Vec<bool>],
    /// First samples after long gaps, by trajectory; the number of turns of an angle within a gap is unknown.
    pub gaps: Vec<Vec<usize>>,
    /// Spread of every coordinate over all samples.
    pub spread: Vec<f64>,
    pub robust: bool,
    /// Disturbances of the motion.
    pub disturbances: Disturbances,
    pub threads: usize,
    /// Cancels every loop.
    pub cancellation: Cancellation,
}

/// Normal equations of a segment: initial state, constants, sensors.
#[derive(Clone, Debug)]
pub(crate) struct Linear {
    pub(super) matrix: Vec<f64>,
    pub(super) right: Vec<f64>,
    pub square: f64,
    pub count: f64,
}

/// Normal equations of constants and sensors, with initial states eliminated.
#[derive(Clone, Debug, Default)]
pub(crate) struct Normal {
    pub matrix: Vec<f64>,
    pub right: Vec<f64>,
    /// Its diagonal with the initial states held fixed.
    pub diagonal: Vec<f64>,
    /// The right-hand side of every segment.
    pub rights: Vec<Vec<f64>>,
    pub square: f64,
    /// Number of residuals minus the numbers of initial states.
    pub count: f64,
    pub failed: usize,
    /// Newton decrement of the initial states, per number.
    pub start_decrement: f64,
    /// Newton decrement over the variance of the noise: the decrease of the sum of squares that another step would bring.
    pub decrement: f64,
    /// `true` if the decrement is far below 1.
    pub converged: bool,
    /// Constants at the bound of their range, beyond which the fit would be better.
    pub held: Vec<bool>,
    /// Eigenvectors of the matrix, from the first step on.
    pub(super) spectrum: Option<Spectrum>,
}

impl Normal {
    /// For `m` unknowns, before the first residual.
    pub fn empty(m: usize) -> Self {
        let [right, diagonal] = [(); 2].map(|()| vec![0.0; m]);
        Self { matrix: vec![0.0; m * m], right, diagonal, held: vec![false; m], ..Self::default() }
    }

    /// Replaces the matrix by that of other normal equations.
    pub fn keep_matrix(&mut self, other: Self) {
        (self.matrix, self.diagonal, self.spectrum) = (other.matrix, other.diagonal, other.spectrum);
    }

    /// The same, with constants at their bounds treated as given.
    pub fn with_held(mut self) -> Self {
        let m = self.right.len();
        self.spectrum = None;
        for k in (0..m).filter(|&k| self.held[k]) {
            (0..m).for_each(|l| (self.matrix[k * m + l], self.matrix[l * m + k]) = (0.0, 0.0));
            (self.matrix[k * m + k], self.diagonal[k], self.right[k]) = (GIVEN_WEIGHT, GIVEN_WEIGHT, 0.0);
        }
        self
    }
}

/// Indices of segments, and the segments.
type Batch<'a> = (Vec<usize>, Vec<&'a Segment>);

/// Segments in batches that are integrated side by side, the longest first.
pub(super) fn batches(segments: &[Segment]) -> Vec<Batch<'_>> {
    let mut order: Vec<usize> = (0..segments.len()).collect();
    order.sort_by_key(|&k| std::cmp::Reverse(segments[k].samples));
    let batch = |batch: &[usize]| (batch.to_vec(), batch.iter().map(|&k| &segments[k]).collect());
    order.chunks(LANES).map(batch).collect()
}

/// Compares the integrated motion of segments with the readings.
struct Comparison<'a> {
    problem: &'a Problem<'a>,
    segments: &'a [&'a Segment],
    /// Offset, gain and delay of the sensor of every reading.
    sensors: Vec<[f64; 3]>,
    /// Delays other than 0, each with the states at the earlier times.
    delayed: Vec<(f64, State)>,
    reader: Option<ReadingSlopes<'a>>,
    /// Filters of the segments; empty if residuals are independent.
    filters: Vec<Filter>,
    /// Derivatives of the last residual; empty if not requested.
    row: Vec<f64>,
    /// Number of derivatives by initial state and constants, the first ones of a row.
    columns: usize,
}

impl<'a> Comparison<'a> {
    fn new(problem: &'a Problem<'a>, x: &[f64], segments: &'a [&'a Segment], derivatives: bool) -> Self {
        let columns = problem.driven.starts() + problem.chosen.len();
        let width = columns + problem.sensors.len();
        let filters = problem.filters(segments.len(), width);
        let sensors: Vec<[f64; 3]> = (0..problem.width()).map(|i| problem.sensor(x, i)).collect();
        let mut delayed: Vec<(f64, State)> = Vec::new();
        for [_, _, delay] in &sensors {
            if *delay != 0.0 && delayed.iter().all(|(known, _)| known != delay) {
                delayed.push((*delay, State::default()));
            }
        }
        let row = vec![0.0; if derivatives || !filters.is_empty() { width } else { 0 }];
        let reader = problem.measured.map(ReadingSlopes::new);
        Self { problem, segments, sensors, delayed, reader, filters, row, columns }
    }

    /// Evaluates delayed states and measured formulas at a sample of all segments.
    fn evaluate(&mut self, follower: &mut Follower<'_>, values: &[f64], sample: usize, state: &State) {
        for (delay, late) in &mut self.delayed {
            follower.shifted(values, (self.segments, sample), (state, -*delay), late);
        }
        if let Some(reader) = &mut self.reader {
            reader.evaluate((follower, &self.problem.driven), values, (self.segments, sample), state);
        }
    }

    /// The residual, or the innovation, of reading `i` of a lane at a sample of its trajectory; writes its derivatives to the row. Of angles that
    /// may have `turned`, full turns are removed.
    fn residual(&mut self, (lane, i): (usize, usize), (place, turned): (usize, bool), state: &State) -> f64 {
        let (problem, track) = (self.problem, self.segments[lane].track);
        let (width, columns) = (problem.width(), self.columns);
        let recording = problem.driven.recording;
        let at = lane * width + i;
        let [offset, gain, delay] = self.sensors[i];
        let late = self.delayed.iter().find(|(known, _)| *known == delay).map_or(state, |(_, late)| late);
        let (predicted, slopes) = match &self.reader {
            Some(reader) => (reader.readings[at], &reader.slopes),
            None => (late.q[at], &late.q_slopes),
        };
        let sigma = problem.sigma_at(track, place, i);
        let mut difference = recording.tracks[track].q[place * width + i] - gain * predicted - offset;
        if problem.measured.is_some_and(|measured| measured.angles[i]) || turned && recording.periodic[i] {
            difference -= TAU * (difference / TAU).round();
        }
        if !self.row.is_empty() {
            let factor = gain / sigma;
            update(&mut self.row, &slopes[at * columns..(at + 1) * columns], |row, slope| *row = factor * slope);
            for (sensor, r) in problem.sensors.iter().zip(&mut self.row[columns..]) {
                *r = match (sensor.coordinate == i, sensor.kind) {
                    (false, _) => 0.0,
                    (_, SensorKind::Offset) => sigma.recip(),
                    (_, SensorKind::Gain) => predicted / sigma,
                    (_, SensorKind::Delay) => -gain * late.v[at] / sigma,
                };
            }
        }
        match self.filters.get_mut(lane) {
            Some(filter) => filter.pass(difference / sigma, &mut self.row),
            None => difference / sigma,
        }
    }

    /// Adds the disturbance of the known forces over one interval to the filters; `follower` evaluated the states last.
    fn disturb(&mut self, follower: &Follower<'_>, state: &State) {
        let (problem, n) = (self.problem, self.problem.n());
        let starts = problem.driven.starts();
        let slopes = state.by_starts(n, (starts, self.columns));
        let impulses = problem.impulses(&slopes, &follower.mobility(), problem.driven.step);
        self.filters.iter_mut().zip(impulses.chunks_exact(n * starts)).for_each(|(filter, own)| filter.disturb(own));
    }
}

impl Problem<'_> {
    /// Number of coordinates.
    pub(super) fn n(&self) -> usize {
        self.driven.equations.n
    }

    /// Number of readings of a sample: positions, or the quantities measured in their place.
    pub(super) fn width(&self) -> usize {
        self.sigma.len()
    }

    /// Starting values of the unknown constants, and perfect sensors.
    pub fn given(&self) -> Vec<f64> {
        let sensors = self.sensors.iter().map(|sensor| sensor.perfect());
        self.chosen.iter().map(|&k| self.values[k]).chain(sensors).collect()
    }

    /// Number of unknowns other than initial states.
    pub fn unknowns(&self) -> usize {
        self.chosen.len() + self.sensors.len()
    }

    /// Values of all parameters, including the unknowns.
    pub fn parameters(&self, x: &[f64]) -> Vec<f64> {
        let mut values = self.values.clone();
        self.chosen.iter().zip(x).for_each(|(&k, &x)| values[k] = x);
        values
    }

    /// Offset, gain and delay of a coordinate's sensor.
    fn sensor(&self, x: &[f64], coordinate: usize) -> [f64; 3] {
        let mut found = [0.0, 1.0, 0.0];
        for (sensor, &x) in self.sensors.iter().zip(&x[self.chosen.len()..]) {
            if sensor.coordinate == coordinate {
                found[sensor.kind as usize] = x;
            }
        }
        found
    }

    /// Standard deviation of the noise of a measured position.
    pub fn sigma_at(&self, track: usize, sample: usize, i: usize) -> f64 {
        match self.errors.get(track) {
            Some(errors) => errors[sample * self.width() + i],
            None => self.sigma_of.get(track).unwrap_or(&self.sigma)[i],
        }
    }

    /// `true` for a missing reading.
    fn is_missing(&self, track: usize, sample: usize, i: usize) -> bool {
        self.missing.get(track).and_then(|track| track.get(sample * self.width() + i)).is_some_and(|missing| *missing)
    }

    /// Number of readings of segments, missing ones left out.
    pub fn readings(&self, segments: &[Segment]) -> f64 {
        let n = self.width();
        let of = |segment: &Segment| {
            let (first, end) = (segment.first * n, (segment.first + segment.samples) * n);
            let missing = self.missing.get(segment.track).and_then(|track| track.get(first..end));
            end - first - missing.map_or(0, |part| part.iter().filter(|missing| **missing).count())
        };
        segments.iter().map(of).sum::<usize>() as f64
    }

    /// `true` if a long gap lies between the start of a segment and the sample.
    fn is_beyond_gap(&self, segment: &Segment, sample: usize) -> bool {
        let next = |gaps: &Vec<usize>| gaps.get(gaps.partition_point(|gap| *gap <= segment.first)).copied();
        self.gaps.get(segment.track).and_then(next).is_some_and(|gap| gap <= sample)
    }

    /// Integrates segments and calls `visit(segment, sample, reading, residual, row)` for every reading. Residuals are in units of the noise; the
    /// row holds their derivatives by initial state, constants and sensor constants, if requested. With disturbances, `visit` receives innovations
    /// instead. Returns the sum of the logarithms of the innovations' variances, in units of the noise.
    pub(super) fn residuals(
        &self,
        x: &[f64],
        segments: &[&Segment],
        derivatives: bool,
        mut visit: impl FnMut(usize, usize, usize, f64, &[f64]),
    ) -> f64 {
        let (n, width) = (self.n(), self.width());
        let values = self.parameters(x);
        let mut comparison = Comparison::new(self, x, segments, derivatives);
        let derivatives = derivatives || !comparison.filters.is_empty();
        let mut a = vec![0.0; segments.len() * n];
        let noisy = !self.disturbances.force.is_empty();
        Follower::new(&self.driven).follow(&values, segments, derivatives, |follower, sample, state| {
            comparison.evaluate(follower, &values, sample, state);
            for (lane, segment) in segments.iter().enumerate().filter(|(_, segment)| sample < segment.samples) {
                let place = segment.first + sample;
                let turned = self.is_beyond_gap(segment, place);
                for i in (0..width).filter(|i| !self.is_missing(segment.track, place, *i)) {
                    let residual = comparison.residual((lane, i), (place, turned), state);
                    visit(lane, sample, i, residual, &comparison.row);
                }
            }
            if noisy {
                follower.accelerate(&values, (&state.q, &state.v), &[], &mut a);
                comparison.disturb(follower, state);
            }
        });
        comparison.filters.iter().map(|filter| filter.log_variance).sum()
    }

    /// Normal equations of a batch of segments; `None` for those that cannot be integrated.
    pub(super) fn batch(&self, x: &[f64], segments: &[&Segment]) -> Vec<Option<Linear>> {
        let starts = self.driven.starts();
        let width = starts + self.unknowns();
        let empty = |segment: &&Segment| Linear {
            matrix: vec![0.0; width * width],
            right: vec![0.0; width],
            square: 0.0,
            count: self.readings(std::slice::from_ref(*segment)) - starts as f64,
        };
        let mut found: Vec<Linear> = segments.iter().map(empty).collect();
        self.residuals(x, segments, true, |lane, _, _, residual, row| {
            let linear = &mut found[lane];
            let size = residual.abs();
            let outside = self.robust && size > HUBER;
            let weight = if outside { HUBER / size } else { 1.0 };
            linear.square += if outside { HUBER * (2.0 * size - HUBER) } else { residual * residual };
            for (a, &r) in row.iter().enumerate() {
                let scaled = weight * r;
                linear.right[a] += scaled * residual;
                let line = &mut linear.matrix[a * width..a * width + a + 1];
                line.iter_mut().zip(row).for_each(|(sum, y)| *sum += scaled * y);
            }
        });
        let finish = |mut linear: Linear| {
            for a in 0..width {
                for b in 0..a {
                    linear.matrix[b * width + a] = linear.matrix[a * width + b];
                }
            }
            let finite = linear.square.is_finite() && linear.matrix.iter().all(|x| x.is_finite());
            finite.then_some(linear)
        };
        found.into_iter().map(finish).collect()
    }

    /// Normal equations of all segments in order.
    pub fn all(&self, x: &[f64], segments: &[Segment]) -> Vec<Option<Linear>> {
        let batches = batches(segments);
        let work = |batches: &[Batch<'_>]| {
            let of = |(batch, lanes): &Batch<'_>| batch.iter().copied().zip(self.batch(x, lanes)).collect::<Vec<_>>();
            batches.iter().take_while(|_| self.cancellation.go_on()).flat_map(of).collect::<Vec<_>>()
        };
        let share = batches.len().div_ceil(self.threads.max(1)).max(1);
        let mut found = vec![None; segments.len()];
        let mut place = |part: Vec<(usize, Option<Linear>)>| part.into_iter().for_each(|(k, linear)| found[k] = linear);
        if batches.len() <= 1 || self.threads <= 1 {
            place(work(&batches));
        } else {
            std::thread::scope(|scope| {
                let parts: Vec<_> = batches.chunks(share).map(|part| scope.spawn(move || work(part))).collect();
                parts.into_iter().for_each(|part| place(part.join().unwrap_or_default()));
            });
        }
        found
    }

    /// Residuals in units of noise, `(samples, readings)` of each segment, `NaN` for readings that are missing.
    pub fn all_residuals(&self, x: &[f64], segments: &[Segment]) -> Vec<Vec<f64>> {
        let n = self.width();
        let mut found: Vec<Vec<f64>> = segments.iter().map(|segment| vec![f64::NAN; segment.samples * n]).collect();
        for (batch, lanes) in batches(segments).into_iter().take_while(|_| self.cancellation.go_on()) {
            let put = |lane: usize, sample: usize, i: usize, r: f64, _: &[f64]| found[batch[lane]][sample * n + i] = r;
            self.residuals(x, &lanes, false, put);
        }
        found
    }

    /// Positions and velocities at the last sample of each segment, `(2, n)`.
    pub fn ends(&self, x: &[f64], segments: &[&Segment]) -> Vec<Vec<f64>> {
        let n = self.n();
        let values = self.parameters(x);
        let mut ends = vec![vec![f64::NAN; 2 * n]; segments.len()];
        Follower::new(&self.driven).follow(&values, segments, false, |_, sample, state| {
            for (lane, _) in segments.iter().enumerate().filter(|(_, segment)| sample + 1 == segment.samples) {
                ends[lane][..n].copy_from_slice(&state.q[lane * n..(lane + 1) * n]);
                ends[lane][n..].copy_from_slice(&state.v[lane * n..(lane + 1) * n]);
            }
        });
        ends
    }

    /// The normal equations after eliminating the initial states.
    pub fn normal(&self, found: &[Option<Linear>], segments: &[Segment]) -> Normal {
        let m = self.unknowns();
        let starts = self.driven.starts();
        let width = starts + m;
        let mut normal = Normal::empty(m);
        for (linear, segment) in found.iter().zip(segments) {
            let Some(linear) = linear else {
                normal.failed += 1;
                normal.square += FAILED_SQUARE * (segment.samples * self.width()) as f64;
                normal.count += (segment.samples * self.width()) as f64;
                continue;
            };
            normal.square += linear.square;
            normal.count += linear.count;
            let inverse = self.start_inverse(linear, 0.0);
            normal.start_decrement += dot(&times(starts, &inverse, &linear.right[..starts]), &linear.right[..starts]);
            let mixed = |i: usize, k: usize| linear.matrix[i * width + starts + k];
            let mut solved = vec![0.0; starts * m];
            for i in 0..starts {
                for j in 0..starts {
                    let x = inverse[i * starts + j];
                    (0..m).for_each(|k| solved[i * m + k] += x * mixed(j, k));
                }
            }
            let mut part = linear.right[starts..].to_vec();
            for k in 0..m {
                normal.diagonal[k] += linear.matrix[(starts + k) * width + starts + k];
                part[k] -= (0..starts).map(|i| solved[i * m + k] * linear.right[i]).sum::<f64>();
                for l in 0..m {
                    let own = linear.matrix[(starts + k) * width + starts + l];
                    normal.matrix[k * m + l] += own - (0..starts).map(|i| mixed(i, k) * solved[i * m + l]).sum::<f64>();
                }
            }
            normal.right.iter_mut().zip(&part).for_each(|(sum, part)| *sum += part);
            normal.rights.push(part);
        }
        normal.start_decrement /= (starts * segments.len().max(1)) as f64;
        normal
    }

    /// Inverse of the block of the initial state, damped by a share of its diagonal.
    pub(super) fn start_inverse(&self, linear: &Linear, damping: f64) -> Vec<f64> {
        let starts = self.driven.starts();
        let width = starts + self.unknowns();
        let own = (0..starts * starts).map(|at| {
            let x = linear.matrix[at / starts * width + at % starts];
            if at / starts == at % starts { x * (1.0 + damping) } else { x }
        });
        let own: Vec<f64> = own.collect();
        inverse_with(starts, &own, RIDGE).unwrap_or_else(|| vec![0.0; starts * starts])
    }

    /// Undamped normal equations at other unknowns, with the initial states of the segments fitted to them.
    pub fn normal_at(&self, x: &[f64], segments: &[Segment]) -> Normal {
        let mut segments = segments.to_vec();
        self.fit_starts(x, &mut segments, START_ROUNDS);
        self.normal(&self.all(x, &segments), &segments)
    }
}
