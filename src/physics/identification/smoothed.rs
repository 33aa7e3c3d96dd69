//! Least-squares fits to smoothed motion: to its accelerations, where the fit to the motion begins, or to known forces.

use super::closed::FreePart;
use super::descent::{LEAST_DAMPING, MOST_DAMPING, SILENT};
use super::follow::{Follower, LANES, forces};
use super::solve::{Normal, Problem};
use crate::recording::smooth::Smoothed;
use std::ops::Range;

/// Largest number of states.
const MOST_STATES: usize = 12_000;
/// Errors beyond so many standard deviations count linearly.
const HUBER: f64 = 3.0;
const ITERATIONS: usize = 60;

/// States with their accelerations, `(states, n)`, and the expected errors of these.
#[derive(Default)]
pub(super) struct States {
    pub q: Vec<f64>,
    pub v: Vec<f64>,
    pub a: Vec<f64>,
    pub force: Vec<f64>,
    pub a_error: Vec<f64>,
    /// Trajectory and sample of every state.
    pub places: Vec<(usize, usize)>,
    /// Inverse errors of the fitted quantity: of the accelerations, or of the forces.
    pub weight: Vec<f64>,
    /// Number of samples between states.
    pub stride: usize,
    /// Number of states on either side over which force equations are averaged, twice: the weights form a triangle.
    pub averaged: usize,
    /// Weights of the force equations in averages, `(states, n)`; empty for equal weights.
    pub share: Vec<f64>,
    /// Units in which forces on the coordinates are compared under constraints, `(n)`.
    pub units: Vec<f64>,
}

/// What the constants are fitted to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Met {
    Accelerations,
    Forces,
}

impl States {
    /// From the samples with full windows.
    pub fn new(problem: &Problem<'_>, smoothed: &[Option<Smoothed>]) -> Self {
        let n = problem.course.equations.n;
        let (mut states, mut force) = (Self::default(), vec![0.0; n]);
        let full = |s: &Smoothed| s.interior().filter(|&at| s.is_full(at)).collect::<Vec<_>>();
        let all: usize = smoothed.iter().flatten().map(|s| full(s).len()).sum();
        let stride = all.div_ceil(MOST_STATES).max(1);
        states.stride = stride;
        for (at, (track, smoothed)) in problem.course.recording.tracks.iter().zip(smoothed).enumerate() {
            let Some(smoothed) = smoothed else { continue };
            for sample in full(smoothed).into_iter().step_by(stride) {
                let range = sample * n..(sample + 1) * n;
                states.places.push((at, sample));
                states.q.extend(&smoothed.q[range.clone()]);
                states.v.extend(&smoothed.v[range.clone()]);
                states.a.extend(&smoothed.a[range.clone()]);
                let errors = smoothed.a_error[range.clone()].iter().zip(&smoothed.a_bias[range]);
                states.a_error.extend(errors.map(|(error, bias)| error.hypot(*bias)));
                if !track.force.is_empty() {
                    let place = (sample.max(1), if sample == 0 { 0.0 } else { 1.0 });
                    forces(track, problem.course.between, place, &mut force);
                }
                states.force.extend(&force);
            }
        }
        states.weight = states.a_error.iter().map(|error| error.max(1e-300).recip()).collect();
        // A single sample that happens to look exact must not outweigh all others.
        let mut sorted = states.weight.clone();
        sorted.sort_by(f64::total_cmp);
        let most = 5.0 * sorted.get(sorted.len() / 2).copied().unwrap_or(1.0);
        states.weight.iter_mut().for_each(|w| *w = w.min(most));
        states
    }

    pub fn len(&self, n: usize) -> usize {
        self.q.len() / n
    }

    /// The track and the time of a state.
    fn place(&self, problem: &Problem<'_>, at: usize) -> (usize, f64) {
        let (track, sample) = self.places[at];
        (track, problem.course.recording.tracks[track].times[sample])
    }

    /// Calls `visit` with every batch of states: the integrator, the batch's offset among the numbers, and its accelerations for constants `x`.
    pub fn batches(
        &self,
        problem: &Problem<'_>,
        x: &[f64],
        visit: impl FnMut(&mut Follower<'_>, Range<usize>, &[f64]),
    ) {
        self.batches_at(problem, x, |at| self.place(problem, at), visit);
    }

    /// The same with states at other times.
    fn batches_at(
        &self,
        problem: &Problem<'_>,
        x: &[f64],
        place: impl Fn(usize) -> (usize, f64),
        mut visit: impl FnMut(&mut Follower<'_>, Range<usize>, &[f64]),
    ) {
        let n = problem.course.equations.n;
        let values = problem.parameters(x);
        let mut follower = Follower::new(&problem.course);
        let mut a = vec![0.0; LANES * n];
        let firsts = (0..self.q.len()).step_by(LANES * n);
        for first in firsts.take_while(|_| problem.cancellation.go_on()) {
            let range = first..(first + LANES * n).min(self.q.len());
            let a = &mut a[..range.len()];
            let state = (&self.q[range.clone()], &self.v[range.clone()]);
            follower.at((first / n..range.end / n).map(&place));
            follower.accelerate(&values, state, &self.force[range.clone()], a);
            visit(&mut follower, range, a);
        }
    }

    /// Residuals with their slopes by the constants, in batches of states: `visit(first number, residuals, slopes)`.
    fn residuals(&self, problem: &Problem<'_>, x: &[f64], met: Met, mut visit: impl FnMut(usize, &[f64], &[f64])) {
        let (n, values) = (problem.course.equations.n, problem.parameters(x));
        let width = 2 * n + problem.course.chosen;
        let (mut residual, mut rows) = (Vec::new(), Vec::new());
        self.batches(problem, x, |follower, range, a| {
            let (first, measured) = (range.start, &self.a[range.clone()]);
            let (q, v) = (&self.q[range.clone()], &self.v[range]);
            match met {
                Met::Accelerations => {
                    residual.clear();
                    residual.extend(measured.iter().zip(a).map(|(measured, a)| measured - a));
                    visit(first, &residual, follower.slopes(&values, (q, v, a)));
                }
                Met::Forces => {
                    residual.resize(a.len(), 0.0);
                    follower.lacking_forces(measured, &mut residual);
                    let (slopes, added) = (follower.force_slopes(&values, (q, v, measured)), rows.len());
                    residual.iter().zip(slopes.chunks_exact(width)).for_each(|(r, slopes)| {
                        rows.push(*r);
                        rows.extend_from_slice(slopes);
                    });
                    self.free_part(follower, |free| free.take_all(&mut rows[added..], width + 1));
                }
            }
        });
        self.average(n, &mut rows);
        for (part, rows) in rows.chunks(LANES * n * (width + 1)).enumerate() {
            let [residual, slopes] = [0..1, 1..width + 1].map(|range| {
                rows.chunks_exact(width + 1).flat_map(|row| &row[range.clone()]).copied().collect::<Vec<_>>()
            });
            visit(part * LANES * n, &residual, &slopes);
        }
    }

    /// Calls `act` with what tells the part of forces on the states evaluated last that constraints cannot balance; not without constraints.
    pub fn free_part(&self, follower: &Follower<'_>, act: impl FnOnce(FreePart<'_>)) {
        let (n, rows) = (self.units.len(), follower.rows());
        if n > 0 && !rows.is_empty() {
            act(FreePart { rows, constraints: follower.constraints(), units: &self.units });
        }
    }

    /// Means over neighbouring states of every trajectory; each force equation has several numbers, `(states, n, numbers)`.
    ///
    /// Averages of equations, forces included, hold as well as the equations themselves: the noise of accelerations is averaged out of the
    /// regressors before these are squared, so that least squares are hardly biased by it, and the polynomials may have a degree that misses
    /// nothing. Robots are identified this way ("parallel filtering", Gautier, IEEE ICRA 1997).
    fn average(&self, n: usize, values: &mut [f64]) {
        let (states, half) = (self.places.len(), self.averaged);
        if half == 0 || values.is_empty() {
            return;
        }
        let (size, width) = (values.len() / states, values.len() / (states * n));
        let mut weights = if self.share.is_empty() { vec![1.0; states * n] } else { self.share.clone() };
        let mut failed = Vec::new();
        for (at, (row, weight)) in values.chunks_exact_mut(width).zip(&mut weights).enumerate() {
            if row.iter().all(|x| x.is_finite()) {
                row.iter_mut().for_each(|x| *x *= *weight);
            } else {
                failed.push(at);
                (*weight, _) = (0.0, row.fill(0.0));
            }
        }
        let mut first = 0;
        let next = |a: &(usize, usize), b: &(usize, usize)| a.0 == b.0 && b.1 <= a.1 + self.stride;
        for run in self.places.chunk_by(next) {
            let end = first + run.len();
            for _ in 0..2 {
                sums(&mut values[first * size..end * size], size, half);
                sums(&mut weights[first * n..end * n], n, half);
            }
            first = end;
        }
        for (row, weight) in values.chunks_exact_mut(width).zip(&weights) {
            row.iter_mut().for_each(|x| *x = if *weight > 0.0 { *x / weight } else { 0.0 });
        }
        failed.into_iter().for_each(|at| values[at * width..(at + 1) * width].fill(f64::NAN));
    }

    /// Normal equations, with the right-hand sides of batches of states; `None` where no residual is finite.
    pub fn normal(&self, problem: &Problem<'_>, x: &[f64], met: Met) -> Option<Normal> {
        let (n, m) = (problem.course.equations.n, problem.chosen.len());
        let (mut normal, mut held) = (Normal::empty(m), Vec::with_capacity(m));
        self.residuals(problem, x, met, |first, residuals, slopes| {
            let mut part = vec![0.0; m];
            for (k, (residual, row)) in residuals.iter().zip(slopes.chunks_exact(2 * n + m)).enumerate() {
                let weight = self.weight[first + k];
                let (residual, row) = (residual * weight, &row[2 * n..]);
                if !(residual.is_finite() && row.iter().all(|x| x.is_finite())) {
                    normal.square += 1e6;
                    continue;
                }
                normal.count += 1.0;
                let size = residual.abs();
                let cut = if size > HUBER { HUBER / size } else { 1.0 };
                normal.square += if size > HUBER { HUBER * (2.0 * size - HUBER) } else { residual * residual };
                let scale = cut * weight * weight;
                // A torque depends on the links that its joint carries, few of many in a tree.
                held.clear();
                held.extend((0..m).filter(|&i| row[i] != 0.0));
                for &i in &held {
                    let x = row[i];
                    part[i] += cut * weight * x * residual;
                    let line = &mut normal.matrix[i * m..(i + 1) * m];
                    match 2 * held.len() > m {
                        true => line.iter_mut().zip(row).for_each(|(sum, y)| *sum += scale * x * y),
                        false => held.iter().for_each(|&j| line[j] += scale * x * row[j]),
                    }
                }
            }
            normal.right.iter_mut().zip(&part).for_each(|(sum, part)| *sum += part);
            normal.parts.push(part);
        });
        normal.diagonal = (0..m).map(|k| normal.matrix[k * m + k]).collect();
        (normal.count > 0.0).then_some(normal)
    }

    /// Force residuals, `(states, n)`, and their averages.
    pub fn force_residuals(&self, problem: &Problem<'_>, x: &[f64]) -> [Vec<f64>; 2] {
        let mut all = vec![0.0; self.q.len()];
        self.batches(problem, x, |follower, range, _| {
            let found = &mut all[range.clone()];
            follower.lacking_forces(&self.a[range], found);
            self.free_part(follower, |free| free.take_all(found, 1));
        });
        let mut averages = all.clone();
        self.average(problem.course.equations.n, &mut averages);
        [all, averages]
    }

    /// Fits constants to the smoothed motion; returns the normal equations there, `None` if no residual is finite.
    pub fn fit(&self, problem: &Problem<'_>, x: &mut Vec<f64>, met: Met) -> Option<Normal> {
        let mut best = self.normal(problem, x, met)?;
        let given = if met == Met::Forces { &self.force } else { &self.a };
        let size: f64 = given.iter().zip(&self.weight).map(|(a, w)| (a * w).powi(2)).sum();
        // Forces are often linear in the constants.
        let mut damping = if met == Met::Forces { 1e-9 } else { 1e-3 };
        for _ in 0..ITERATIONS {
            let muted = problem.too_weak(x, &best, SILENT * size);
            problem.judge(x, &mut best, &muted, damping > MOST_DAMPING);
            let residual = (best.square / best.count.max(1.0)).sqrt();
            if best.converged || damping > MOST_DAMPING || !problem.cancellation.iterate(residual) {
                break;
            }
            let moved = problem.moved(x, &problem.step(x, &best, &muted, damping).change, &best);
            match self.normal(problem, &moved, met) {
                Some(tried) if tried.square < best.square => {
                    (*x, best) = (moved, tried);
                    damping = f64::max(damping / 10.0, LEAST_DAMPING);
                }
                _ => damping *= 10.0,
            }
        }
        Some(best)
    }
}

/// Growth of a derivative from the first to the last third of the time from which a constant is one of a phase, such as a frequency.
const GROWS: f64 = 2.5;
/// Part of the given value of such a constant on either side of it that is searched, and most values that are tried on either side.
const SEARCHED: f64 = 0.5;
const TRIED: usize = 40;
/// Shortest part of a recording that is searched first, and values that are tried on either side after it doubled.
const SHORTEST: f64 = 1.0 / 16.0;
const DOUBLED: usize = 3;

impl States {
    /// As [`States::fit`] to accelerations of a system that depends on the time: the sum of squares has many minima over a frequency, as many
    /// as there are periods in the recording, so that the fit begins at several values of it. In a long recording a wide range is searched by
    /// a short part, which doubles. Returns the constants, by their places, whose range was searched in part only, and that part.
    pub fn fit_in_time(&self, problem: &Problem<'_>, x: &mut Vec<f64>) -> Option<Vec<(usize, [f64; 2])>> {
        let given = x.clone();
        let mut best = self.fit(problem, x, Met::Accelerations)?;
        let mut cut = Vec::new();
        for k in 0..problem.chosen.len() {
            let Some(step) = self.phase_step(problem, &given, k) else { continue };
            let reach = if given[k] == 0.0 { TRIED as f64 * step } else { SEARCHED * given[k].abs() };
            let mut share = (TRIED as f64 * step / reach).clamp(SHORTEST, 1.0);
            let mut count = ((reach * share / step) as usize).min(TRIED);
            if (count + 1) as f64 * step < reach * share {
                let widest = count as f64 * step / share;
                cut.push((k, [given[k] - widest, given[k] + widest]));
            }
            let mut from = given.clone();
            loop {
                let part = (share < 1.0).then(|| self.beginning(problem, share));
                let found = part.as_ref().unwrap_or(self).nearest(problem, (&from, k), step / share, count);
                let Some((tried, found)) = found else { break };
                if share == 1.0 {
                    if found.square < best.square {
                        (*x, best) = (tried, found);
                    }
                    break;
                }
                (from, share, count) = (tried, (2.0 * share).min(1.0), DOUBLED);
            }
        }
        Some(cut)
    }

    /// The best of the fits that begin at a value of constant `k` and at `count` others on either side of it.
    fn nearest(
        &self,
        problem: &Problem<'_>,
        (from, k): (&[f64], usize),
        step: f64,
        count: usize,
    ) -> Option<(Vec<f64>, Normal)> {
        let mut best: Option<(Vec<f64>, Normal)> = None;
        for place in std::iter::once(0.0).chain((1..=count).flat_map(|j| [j as f64, -(j as f64)])) {
            let mut tried = from.to_vec();
            tried[k] += place * step;
            let Some(found) = self.fit(problem, &mut tried, Met::Accelerations) else { continue };
            if best.as_ref().is_none_or(|(_, best)| found.square < best.square) {
                best = Some((tried, found));
            }
        }
        best
    }

    /// The states within the first share of the time.
    fn beginning(&self, problem: &Problem<'_>, share: f64) -> Self {
        let n = problem.course.equations.n;
        let [low, high] = self.span(problem);
        let end = low + share * (high - low);
        let kept: Vec<usize> = (0..self.places.len()).filter(|&at| self.place(problem, at).1 <= end).collect();
        let of = |values: &[f64]| -> Vec<f64> {
            kept.iter().filter_map(|at| values.get(at * n..(at + 1) * n)).flatten().copied().collect()
        };
        Self {
            q: of(&self.q),
            v: of(&self.v),
            a: of(&self.a),
            force: of(&self.force),
            a_error: of(&self.a_error),
            places: kept.iter().map(|&at| self.places[at]).collect(),
            weight: of(&self.weight),
            share: of(&self.share),
            units: self.units.clone(),
            ..*self
        }
    }

    /// First and last time of a state.
    fn span(&self, problem: &Problem<'_>) -> [f64; 2] {
        let times = (0..self.places.len()).map(|at| self.place(problem, at).1);
        times.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], t| [low.min(t), high.max(t)])
    }

    /// Change of constant `k` that turns the phase of the forces by about half a radian at the end of the recording; none of a constant
    /// whose effect does not grow with time.
    fn phase_step(&self, problem: &Problem<'_>, x: &[f64], k: usize) -> Option<f64> {
        let (n, m) = (problem.course.equations.n, problem.chosen.len());
        let [low, high] = self.span(problem);
        let third = (high - low) / 3.0;
        let (mut sums, mut counts) = ([0.0; 2], [0.0; 2]);
        self.residuals(problem, x, Met::Accelerations, |first, _, slopes| {
            for (row, slopes) in slopes.chunks_exact(2 * n + m).enumerate() {
                let since = self.place(problem, (first + row) / n).1 - low;
                let part = if since < third { 0 } else { 1 };
                if since < third || since > 2.0 * third {
                    sums[part] += slopes[2 * n + k].powi(2);
                    counts[part] += 1.0;
                }
            }
        });
        let [early, late] = [0, 1].map(|part| (sums[part] / f64::max(counts[part], 1.0)).sqrt());
        if late.is_nan() || late <= GROWS * early {
            return None;
        }
        // What the forces do between one time and others.
        let mut all = vec![0.0; self.q.len()];
        self.batches(problem, x, |_, range, a| all[range].copy_from_slice(a));
        self.batches_at(
            problem,
            x,
            |at| (self.places[at].0, low),
            |_, range, a| {
                all[range].iter_mut().zip(a).for_each(|(moved, still)| *moved -= still);
            },
        );
        let effect = (all.iter().filter(|x| x.is_finite()).map(|x| x * x).sum::<f64>() / all.len() as f64).sqrt();
        let step = 0.5 * effect / late;
        (step.is_finite() && step > 0.0).then_some(step)
    }
}

/// Moving sums over `half` rows on either side.
fn sums(rows: &mut [f64], size: usize, half: usize) {
    let given = rows.to_vec();
    let row = |at: usize| given.get(at * size..(at + 1) * size);
    let count = rows.len() / size;
    let mut sum = vec![0.0; size];
    for at in 0..count + half {
        if let Some(row) = row(at) {
            sum.iter_mut().zip(row).for_each(|(s, x)| *s += x);
        }
        if let Some(row) = at.checked_sub(2 * half + 1).and_then(row) {
            sum.iter_mut().zip(row).for_each(|(s, x)| *s -= x);
        }
        if let Some(middle) = at.checked_sub(half) {
            rows[middle * size..(middle + 1) * size].copy_from_slice(&sum);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equations_are_averaged_along_their_trajectory_by_their_weights() {
        // Two trajectories, the second with a sample missing between its parts; one equation takes no part, one has failed.
        let places: Vec<(usize, usize)> =
            (0..9).map(|k| (0, k)).chain((0..4).map(|k| (1, k))).chain((5..9).map(|k| (1, k))).collect();
        let mut states = States { places, stride: 1, averaged: 1, share: vec![1.0; 17], ..States::default() };
        states.share[2] = 0.0;
        let given: Vec<f64> = (0..34).map(|k| f64::from(k * k % 11)).collect();
        let mut found = given.clone();
        found[2 * 15] = f64::NAN;
        states.average(1, &mut found);
        let runs = [0..9, 9..13, 13..17];
        for (at, row) in found.chunks_exact(2).enumerate() {
            let run = runs.iter().find(|run| run.contains(&at)).unwrap();
            let near = |k: &usize| run.contains(k) && *k != 2 && *k != 15;
            let weight = |k: usize| [3.0, 2.0, 1.0, 0.0][k.abs_diff(at).min(3)];
            // At the ends a first average of two counts once more.
            let twice = |k: usize| {
                let inner = at.saturating_sub(1).max(run.start)..(at + 2).min(run.end);
                inner.filter(|middle| middle.abs_diff(k) <= 1).count() as f64
            };
            let all = || (0..17).filter(near);
            let mean = all().map(|k| twice(k) * given[2 * k + 1]).sum::<f64>() / all().map(twice).sum::<f64>();
            match at {
                15 => assert!(row[0].is_nan() && row[1].is_nan()),
                _ => assert!((row[1] - mean).abs() < 1e-12, "{at}: {row:?} {mean}"),
            }
            if at == 6 {
                assert!((4..9).all(|k| twice(k) == weight(k)));
            }
        }
    }
}
