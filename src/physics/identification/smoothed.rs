//! Constants by least squares on smoothed motion: on its accelerations, where the fit through the motion begins, or on known forces.

use super::descent::{LEAST_DAMPING, MOST_DAMPING, SILENT};
use super::follow::{Follower, LANES, forces};
use super::solve::{Normal, Problem};
use crate::recording::smooth::Smoothed;
use std::ops::Range;

/// States at most.
const MOST_STATES: usize = 12_000;
/// Errors beyond so many standard deviations count linearly.
const HUBER: f64 = 3.0;
const ITERATIONS: usize = 60;

/// States with their accelerations, `(states, n)`, and the errors to expect of these.
#[derive(Default)]
pub(super) struct States {
    pub q: Vec<f64>,
    pub v: Vec<f64>,
    pub a: Vec<f64>,
    pub force: Vec<f64>,
    pub a_error: Vec<f64>,
    /// Trajectory and sample of every state.
    pub places: Vec<(usize, usize)>,
    /// One over the errors of what is met: of the accelerations, or of the forces.
    pub weight: Vec<f64>,
}

/// What is met.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Met {
    Accelerations,
    Forces,
}

impl States {
    /// Of the samples with full windows.
    pub fn new(problem: &Problem<'_>, smoothed: &[Option<Smoothed>]) -> Self {
        let n = problem.course.equations.n;
        let (mut states, mut force) = (Self::default(), vec![0.0; n]);
        let full = |s: &Smoothed| s.interior().filter(|&at| s.is_full(at)).collect::<Vec<_>>();
        let all: usize = smoothed.iter().flatten().map(|s| full(s).len()).sum();
        let stride = all.div_ceil(MOST_STATES).max(1);
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
        // One sample that happens to look exact does not outweigh all others.
        let mut sorted = states.weight.clone();
        sorted.sort_by(f64::total_cmp);
        let most = 5.0 * sorted.get(sorted.len() / 2).copied().unwrap_or(1.0);
        states.weight.iter_mut().for_each(|w| *w = w.min(most));
        states
    }

    pub fn len(&self, n: usize) -> usize {
        self.q.len() / n
    }

    /// Calls `visit` with every batch of states: what follows it, its place among the numbers, and its accelerations by constants `x`.
    pub fn batches(
        &self,
        problem: &Problem<'_>,
        x: &[f64],
        mut visit: impl FnMut(&mut Follower<'_>, Range<usize>, &[f64]),
    ) {
        let n = problem.course.equations.n;
        let values = problem.parameters(x);
        let mut follower = Follower::new(&problem.course);
        let mut a = vec![0.0; LANES * n];
        for first in (0..self.q.len()).step_by(LANES * n) {
            let range = first..(first + LANES * n).min(self.q.len());
            let a = &mut a[..range.len()];
            let state = (&self.q[range.clone()], &self.v[range.clone()]);
            follower.accelerate(&values, state, &self.force[range.clone()], a);
            visit(&mut follower, range, a);
        }
    }

    /// Residuals of what is met with their slopes by the constants, batch by batch: `visit(first number, residuals, slopes)`.
    fn residuals(&self, problem: &Problem<'_>, x: &[f64], met: Met, mut visit: impl FnMut(usize, &[f64], &[f64])) {
        let values = problem.parameters(x);
        let mut residual = Vec::new();
        self.batches(problem, x, |follower, range, a| {
            let (first, measured) = (range.start, &self.a[range.clone()]);
            let (q, v) = (&self.q[range.clone()], &self.v[range]);
            residual.resize(a.len(), 0.0);
            let slopes = match met {
                Met::Accelerations => {
                    residual.iter_mut().zip(measured.iter().zip(a)).for_each(|(r, (measured, a))| *r = measured - a);
                    follower.slopes(&values, (q, v, a))
                }
                Met::Forces => {
                    follower.lacking_forces(measured, &mut residual);
                    follower.force_slopes(&values, (q, v, measured))
                }
            };
            visit(first, &residual, slopes);
        });
    }

    /// Normal equations of what is met, with the right-hand sides of batches of states; `None` where no residual is finite.
    pub fn normal(&self, problem: &Problem<'_>, x: &[f64], met: Met) -> Option<Normal> {
        let (n, m) = (problem.course.equations.n, problem.chosen.len());
        let mut normal = Normal::empty(m);
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
                for (i, x) in row.iter().enumerate() {
                    part[i] += cut * weight * x * residual;
                    let line = &mut normal.matrix[i * m..(i + 1) * m];
                    line.iter_mut().zip(row).for_each(|(sum, y)| *sum += scale * x * y);
                }
            }
            normal.right.iter_mut().zip(&part).for_each(|(sum, part)| *sum += part);
            normal.parts.push(part);
        });
        normal.diagonal = (0..m).map(|k| normal.matrix[k * m + k]).collect();
        (normal.count > 0.0).then_some(normal)
    }

    /// Residuals of force, `(states, n)`.
    pub fn force_residuals(&self, problem: &Problem<'_>, x: &[f64]) -> Vec<f64> {
        let mut all = vec![0.0; self.q.len()];
        self.batches(problem, x, |follower, range, _| follower.lacking_forces(&self.a[range.clone()], &mut all[range]));
        all
    }

    /// Moves constants to where smoothed motion is met best; the normal equations there, `None` if no residual is finite.
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
