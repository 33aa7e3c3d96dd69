//! Multiple shooting: constants and the starts of all segments by Levenberg and Marquardt's method.
//!
//! Every segment has a start of its own, which is eliminated from the normal equations.

use super::follow::{Course, Follower, LANES, Segment, State};
use super::innovations::Disturbances;
use super::linear::{inverse_with, times};
use crate::cancellation::Cancellation;
use crate::lagrangian::system::Range;
use crate::linalg::dot;

/// Residuals beyond so many standard deviations count linearly where that is asked for.
pub(super) const HUBER: f64 = 3.0;
/// Part of the diagonal that keeps normal equations regular.
const RIDGE: f64 = 1e-11;
/// Part of the effect of an unknown, squared, that other starts do not have; integrators are no better.
const LIKE_STARTS: f64 = 1e-8;
/// Effect of an unknown on the motion, over the motion itself and squared, that is rounding alone.
const NO_EFFECT: f64 = 1e-22;
/// Sum of squares, of each residual, of a segment that cannot be followed.
const FAILED: f64 = 1e8;
/// Damping beyond which nothing gets better.
const MOST_DAMPING: f64 = 1e9;
/// Rounds in which starts follow other unknowns.
const SETTLING: usize = 6;
/// Relative decrease of the sum of squares that is none.
const CONVERGED: f64 = 1e-9;

/// A constant of a sensor: measured positions are `gain (q - delay v) + offset`.
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
    /// Value of a perfect sensor.
    pub fn perfect(self) -> f64 {
        if self.kind == SensorKind::Gain { 1.0 } else { 0.0 }
    }
}

/// Unknowns of the fit beside starts, and how residuals are weighed.
#[derive(Clone, Debug)]
pub(crate) struct Problem<'a> {
    pub course: Course<'a>,
    /// Values of all parameters of the system; those of `chosen` are replaced by unknowns.
    pub values: Vec<f64>,
    /// Parameters that are unknown.
    pub chosen: Vec<usize>,
    pub ranges: Vec<Range>,
    pub sensors: Vec<Sensor>,
    /// Standard deviation of every coordinate's noise.
    pub sigma: Vec<f64>,
    /// The same by trajectory where these differ; empty if they do not.
    pub sigma_of: Vec<Vec<f64>>,
    /// Spread of every coordinate over all samples.
    pub spread: Vec<f64>,
    pub robust: bool,
    /// What moves the motion beside the equations.
    pub disturbances: Disturbances,
    pub threads: usize,
    /// Ends every loop.
    pub cancellation: Cancellation,
}

/// Normal equations of a segment: start, constants, sensors.
#[derive(Clone, Debug)]
pub(crate) struct Linear {
    pub(super) matrix: Vec<f64>,
    pub(super) right: Vec<f64>,
    pub square: f64,
    pub count: f64,
}

/// Normal equations of constants and sensors, starts eliminated.
#[derive(Clone, Debug)]
pub(crate) struct Normal {
    pub matrix: Vec<f64>,
    pub right: Vec<f64>,
    /// Diagonal with starts held fixed.
    pub diagonal: Vec<f64>,
    /// The right-hand side of every segment.
    pub parts: Vec<Vec<f64>>,
    pub square: f64,
    /// Residuals less the numbers that starts take.
    pub count: f64,
    pub failed: usize,
}

impl Normal {
    /// Of `m` unknowns before the first residual.
    pub fn empty(m: usize) -> Self {
        let [right, diagonal] = [(); 2].map(|()| vec![0.0; m]);
        Self { matrix: vec![0.0; m * m], right, diagonal, parts: Vec::new(), square: 0.0, count: 0.0, failed: 0 }
    }
}

impl Problem<'_> {
    fn n(&self) -> usize {
        self.course.equations.n
    }

    /// Unknowns beside starts.
    pub fn unknowns(&self) -> usize {
        self.chosen.len() + self.sensors.len()
    }

    /// Values of all parameters with those of the unknowns.
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

    fn has_delay(&self) -> bool {
        self.sensors.iter().any(|sensor| sensor.kind == SensorKind::Delay)
    }

    /// Calls `visit(segment, sample, coordinate, residual, row)` along segments: residuals of positions in units of noise, and their
    /// derivatives by start, constants and sensors of one lane if those are asked for; innovations where something disturbs the motion.
    /// Gives the sum of the logarithms of the innovations' variances, in units of the noise.
    pub(super) fn residuals(
        &self,
        x: &[f64],
        segments: &[&Segment],
        derivatives: bool,
        mut visit: impl FnMut(usize, usize, usize, f64, &[f64]),
    ) -> f64 {
        let (n, m) = (self.n(), self.chosen.len());
        let values = self.parameters(x);
        let columns = 2 * n + m;
        let mut filters = self.filters(segments.len(), columns + self.sensors.len());
        let derivatives = derivatives || !filters.is_empty();
        let sensors: Vec<[f64; 3]> = (0..n).map(|i| self.sensor(x, i)).collect();
        let mut row = vec![0.0; if derivatives { columns + self.sensors.len() } else { 0 }];
        let mut a = vec![0.0; segments.len() * n];
        let (delayed, noisy) = (self.has_delay(), !self.disturbances.force.is_empty());
        let read = |follower: &mut Follower<'_>, sample: usize, state: &State| {
            if delayed || noisy {
                follower.accelerate(&values, (&state.q, &state.v), &[], &mut a);
            }
            for (lane, segment) in segments.iter().enumerate().filter(|(_, segment)| sample < segment.samples) {
                let own = self.sigma_of.get(segment.track).unwrap_or(&self.sigma);
                let measured = &self.course.recording.tracks[segment.track].q[(segment.first + sample) * n..][..n];
                for i in 0..n {
                    let at = lane * n + i;
                    let [offset, gain, delay] = sensors[i];
                    let (q, v) = (state.q[at], state.v[at]);
                    let seen = q - delay * (v - delay * a[at] / 2.0);
                    let sigma = own[i];
                    let residual = (measured[i] - gain * seen - offset) / sigma;
                    if derivatives {
                        let slopes = at * columns..(at + 1) * columns;
                        let both = state.q_slopes[slopes.clone()].iter().zip(&state.v_slopes[slopes]);
                        let factor = gain / sigma;
                        row.iter_mut().zip(both).for_each(|(r, (q, v))| *r = factor * (q - delay * v));
                        for (sensor, r) in self.sensors.iter().zip(&mut row[columns..]) {
                            *r = match (sensor.coordinate == i, sensor.kind) {
                                (false, _) => 0.0,
                                (_, SensorKind::Offset) => sigma.recip(),
                                (_, SensorKind::Gain) => seen / sigma,
                                (_, SensorKind::Delay) => -gain * (v - delay * a[at]) / sigma,
                            };
                        }
                    }
                    let residual = match filters.get_mut(lane) {
                        Some(filter) => filter.pass(residual, &mut row),
                        None => residual,
                    };
                    visit(lane, sample, i, residual, &row);
                }
            }
            if noisy {
                let impulses = self.impulses(&state.by_starts(n, columns), follower.mass(), self.course.step);
                filters.iter_mut().zip(impulses.chunks_exact(2 * n * n)).for_each(|(filter, own)| filter.disturb(own));
            }
        };
        Follower::new(&self.course).follow(&values, segments, derivatives, read);
        filters.iter().map(|filter| filter.log_variance).sum()
    }

    /// Normal equations of a batch of segments; `None` for those that cannot be followed.
    fn batch(&self, x: &[f64], segments: &[&Segment]) -> Vec<Option<Linear>> {
        let n = self.n();
        let width = 2 * n + self.unknowns();
        let empty = |segment: &&Segment| Linear {
            matrix: vec![0.0; width * width],
            right: vec![0.0; width],
            square: 0.0,
            count: (segment.samples * n) as f64 - 2.0 * n as f64,
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
        let mut order: Vec<usize> = (0..segments.len()).collect();
        order.sort_by_key(|&k| std::cmp::Reverse(segments[k].samples));
        let batches: Vec<&[usize]> = order.chunks(LANES).collect();
        let work = |batches: &[&[usize]]| {
            let of = |batch: &&[usize]| {
                let lanes: Vec<&Segment> = batch.iter().map(|&k| &segments[k]).collect();
                batch.iter().copied().zip(self.batch(x, &lanes)).collect::<Vec<_>>()
            };
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

    /// Residuals in units of noise, `(samples, n)` of each segment.
    pub fn all_residuals(&self, x: &[f64], segments: &[Segment]) -> Vec<Vec<f64>> {
        let n = self.n();
        let mut found: Vec<Vec<f64>> = segments.iter().map(|segment| vec![0.0; segment.samples * n]).collect();
        let mut order: Vec<usize> = (0..segments.len()).collect();
        order.sort_by_key(|&k| std::cmp::Reverse(segments[k].samples));
        for batch in order.chunks(LANES).take_while(|_| self.cancellation.go_on()) {
            let lanes: Vec<&Segment> = batch.iter().map(|&k| &segments[k]).collect();
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
        Follower::new(&self.course).follow(&values, segments, false, |_, sample, state| {
            for (lane, _) in segments.iter().enumerate().filter(|(_, segment)| sample + 1 == segment.samples) {
                ends[lane][..n].copy_from_slice(&state.q[lane * n..(lane + 1) * n]);
                ends[lane][n..].copy_from_slice(&state.v[lane * n..(lane + 1) * n]);
            }
        });
        ends
    }

    /// The normal equations without the starts, damped by a part of their diagonal.
    pub fn normal(&self, found: &[Option<Linear>], segments: &[Segment], damping: f64) -> Normal {
        let (n, m) = (self.n(), self.unknowns());
        let (starts, width) = (2 * n, 2 * n + m);
        let mut normal = Normal::empty(m);
        for (linear, segment) in found.iter().zip(segments) {
            let Some(linear) = linear else {
                normal.failed += 1;
                normal.square += FAILED * (segment.samples * n) as f64;
                normal.count += (segment.samples * n) as f64;
                continue;
            };
            normal.square += linear.square;
            normal.count += linear.count;
            let inverse = self.start_inverse(linear, damping);
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
                    let own = if k == l { own * (1.0 + damping) } else { own };
                    normal.matrix[k * m + l] += own - (0..starts).map(|i| mixed(i, k) * solved[i * m + l]).sum::<f64>();
                }
            }
            normal.right.iter_mut().zip(&part).for_each(|(sum, part)| *sum += part);
            normal.parts.push(part);
        }
        normal
    }

    /// Inverse of the part of the start.
    pub(super) fn start_inverse(&self, linear: &Linear, damping: f64) -> Vec<f64> {
        let starts = 2 * self.n();
        let width = starts + self.unknowns();
        let own = (0..starts * starts).map(|at| {
            let x = linear.matrix[at / starts * width + at % starts];
            if at / starts == at % starts { x * (1.0 + damping) } else { x }
        });
        let own: Vec<f64> = own.collect();
        inverse_with(starts, &own, RIDGE).unwrap_or_else(|| vec![0.0; starts * starts])
    }

    /// The step of a start, given that of the unknowns.
    fn start_step(&self, linear: &Linear, change: &[f64], damping: f64) -> Vec<f64> {
        let starts = 2 * self.n();
        let width = starts + self.unknowns();
        let right: Vec<f64> = (0..starts)
            .map(|i| linear.right[i] - dot(&linear.matrix[i * width + starts..(i + 1) * width], change))
            .collect();
        times(starts, &self.start_inverse(linear, damping), &right)
    }

    /// Moves the starts alone, each segment for itself; the sum of squares.
    pub fn settle(&self, x: &[f64], segments: &mut [Segment], iterations: usize) -> f64 {
        let still = vec![0.0; self.unknowns()];
        let mut best = self.all(x, segments);
        let mut starts: Vec<Vec<f64>> = segments.iter().map(|segment| segment.start.clone()).collect();
        let mut damping = vec![1e-6; segments.len()];
        for _ in 0..iterations {
            for (k, segment) in segments.iter_mut().enumerate() {
                segment.start.clone_from(&starts[k]);
                if let Some(linear) = &best[k] {
                    let step = self.start_step(linear, &still, damping[k]);
                    segment.start.iter_mut().zip(step).for_each(|(s, d)| *s += d);
                }
            }
            let tried = self.all(x, segments);
            let mut gained = 0.0;
            for (k, tried) in tried.into_iter().enumerate() {
                let square = |linear: &Option<Linear>| linear.as_ref().map_or(f64::INFINITY, |linear| linear.square);
                let (before, after) = (square(&best[k]), square(&tried));
                if after < before {
                    gained += if before.is_finite() { before - after } else { after };
                    (best[k], damping[k]) = (tried, damping[k] / 10.0);
                    starts[k].clone_from(&segments[k].start);
                } else {
                    damping[k] = (damping[k] * 100.0).max(1e-4);
                }
            }
            let total: f64 = best.iter().flatten().map(|linear| linear.square).sum();
            if gained < 1e-4 * total || self.cancellation.is_cancelled() {
                break;
            }
        }
        segments.iter_mut().zip(starts).for_each(|(segment, start)| segment.start = start);
        best.iter().zip(segments).map(|(b, s)| b.as_ref().map_or(FAILED * s.samples as f64, |b| b.square)).sum()
    }

    /// Undamped normal equations at other unknowns, the starts of the segments fitted to them.
    pub fn normal_at(&self, x: &[f64], segments: &[Segment]) -> Normal {
        let mut segments = segments.to_vec();
        self.settle(x, &mut segments, SETTLING);
        self.normal(&self.all(x, &segments), &segments, 0.0)
    }

    /// A change of the unknowns, applied to them; constants that must be positive stay so.
    pub fn moved(&self, x: &[f64], change: &[f64]) -> Vec<f64> {
        let moved = |(k, (&x, &d)): (usize, (&f64, &f64))| match self.chosen.get(k).map(|&at| self.ranges[at]) {
            Some(Range::Positive) if x > 0.0 => x * (d / x).clamp(-2.0, 2.0).exp(),
            Some(Range::Positive | Range::AtLeastZero) => (x + d).max(0.0),
            _ => x + d,
        };
        x.iter().zip(change).enumerate().map(moved).collect()
    }

    /// Sum of squares of the whole motion in units of noise, of as many numbers.
    fn size(&self, numbers: f64) -> f64 {
        let square = |(spread, sigma): (&f64, &f64)| (spread / sigma).powi(2);
        numbers * self.spread.iter().zip(&self.sigma).map(square).sum::<f64>() / self.n() as f64
    }

    /// A change of an unknown that is large: its value, of a sensor's offset the spread of the motion, of its delay ten samples; 0 of a
    /// constant that may be 0.
    pub fn scale(&self, unknown: usize, x: f64) -> f64 {
        match unknown.checked_sub(self.chosen.len()).map(|k| self.sensors[k]) {
            None => x.abs(),
            Some(Sensor { kind: SensorKind::Offset, coordinate }) => self.spread[coordinate],
            Some(Sensor { kind: SensorKind::Gain, .. }) => 1.0,
            Some(Sensor { kind: SensorKind::Delay, .. }) => 10.0 * self.course.step,
        }
    }

    /// Unknowns that the motion shows nothing of: their effect is rounding, or what other starts do as well.
    pub fn without_effect(&self, x: &[f64], normal: &Normal) -> Vec<bool> {
        let m = x.len();
        let scales: Vec<f64> = (0..m).map(|k| self.scale(k, x[k])).collect();
        let mut muted = without_effect(&scales, &normal.matrix, NO_EFFECT * self.size(normal.count));
        for (k, muted) in muted.iter_mut().enumerate() {
            *muted |= normal.matrix[k * m + k] <= LIKE_STARTS * normal.diagonal[k];
        }
        muted
    }

    /// Fits unknowns and starts; the normal equations at the end, undamped.
    pub fn fit(&self, x: &mut Vec<f64>, segments: &mut [Segment], iterations: usize) -> Normal {
        let m = self.unknowns();
        let mut best = self.all(x, segments);
        let mut square = self.normal(&best, segments, 0.0).square;
        let mut damping = 1e-4;
        for _ in 0..iterations {
            let mut normal = self.normal(&best, segments, damping);
            if !self.cancellation.iterate((square / normal.count.max(1.0)).sqrt()) {
                break;
            }
            let muted = self.without_effect(x, &normal);
            mute(&muted, &mut normal.matrix, &mut normal.right);
            let Some(inverse) = inverse_with(m, &normal.matrix, RIDGE) else { break };
            let change = times(m, &inverse, &normal.right);
            let moved = self.moved(x, &change);
            let real: Vec<f64> = moved.iter().zip(x.iter()).map(|(after, before)| after - before).collect();
            let starts: Vec<Vec<f64>> = segments.iter().map(|segment| segment.start.clone()).collect();
            for (segment, linear) in segments.iter_mut().zip(&best) {
                let Some(linear) = linear else { continue };
                let step = self.start_step(linear, &real, damping);
                segment.start.iter_mut().zip(step).for_each(|(s, d)| *s += d);
            }
            let tried = self.all(&moved, segments);
            let after = self.normal(&tried, segments, 0.0).square;
            if after < square {
                let done = square - after < CONVERGED * square;
                (*x, best, square) = (moved, tried, after);
                damping = f64::max(damping / 10.0, 1e-10);
                if done {
                    break;
                }
            } else {
                segments.iter_mut().zip(starts).for_each(|(segment, start)| segment.start = start);
                let expected = dot(&change, &normal.right);
                damping = f64::max(damping * 10.0, 1e-6);
                if damping > MOST_DAMPING || expected < CONVERGED * square {
                    break;
                }
            }
        }
        self.normal(&best, segments, 0.0)
    }
}

/// Unknowns whose part of normal equations, for a change of their size, is below `least`.
pub(super) fn without_effect(scales: &[f64], matrix: &[f64], least: f64) -> Vec<bool> {
    let m = scales.len();
    let square = |scale: f64| if scale == 0.0 { 1.0 } else { scale * scale };
    (0..m).map(|k| matrix[k * m + k] * square(scales[k]) <= least).collect()
}

/// Leaves unknowns out of normal equations: they stay where they are.
pub(super) fn mute(muted: &[bool], matrix: &mut [f64], right: &mut [f64]) {
    let m = right.len();
    for (k, _) in muted.iter().enumerate().filter(|(_, muted)| **muted) {
        (0..m).for_each(|l| (matrix[k * m + l], matrix[l * m + k]) = (0.0, 0.0));
        (matrix[k * m + k], right[k]) = (1.0, 0.0);
    }
}
