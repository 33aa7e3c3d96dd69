//! The method of Levenberg and Marquardt for constants, sensor constants and initial states, with its test of convergence.
//!
//! The initial states `s` are eliminated from the normal equations of the constants `c`: `S = H_cc - H_cs H_ss^-1 H_sc`, with the gradient
//! `g = g_c - H_cs H_ss^-1 g_s`. A step is `dc = (S + damping diag S)^-1 g` and `ds = (H_ss + damping diag H_ss)^-1 g_s - H_ss^-1 H_sc dc`. Initial
//! states follow the constants undamped. A constant whose effect other initial states almost compensate therefore moves as fast as any other.
//!
//! The search has converged when the Newton decrement `g' S^-1 g`, the decrease of the sum of squares that another step would bring, is far below
//! the variance of the noise: every constant is then within a small fraction of its standard error of the minimum. A constant at a bound of its
//! range stays there as long as the gradient points out of the range (Bertsekas, SIAM J. Control Optim. 20 (1982) 221).

use super::closed::advance;
use super::driven::Segment;
use super::linear::times;
use super::solve::{Linear, Normal, Problem, Sensor, SensorKind};
use super::thresholds::{
    CONVERGED_DECREMENT, ELIMINATION, FILTERED_DECREMENT, FIRST_DAMPING, LEAST_DAMPING, LEAST_POSITIVE,
    LEAST_SHARE_LEFT, LEAST_START_DECREASE, LIKE_STARTS, MOST_DAMPING, MOST_DELAY, NO_EFFECT, NO_EFFECT_IN_SEARCH,
    RIDGE, STALLED_DECREMENT, USUAL_DELAY,
};
use crate::lagrangian::system::Range;
use crate::linalg::{Workspace, dot, eigh};

/// A solution of damped normal equations.
pub(super) struct Step {
    pub change: Vec<f64>,
    /// Decrease of the sum of squares that the quadratic model predicts for the whole undamped step.
    pub decrement: f64,
    /// Constants that stay at the bound of their range.
    pub held: Vec<bool>,
}

impl Problem<'_> {
    /// Lower bound of an unknown.
    fn bound(&self, k: usize) -> f64 {
        let Some(&at) = self.chosen.get(k) else { return f64::NEG_INFINITY };
        match self.ranges[at] {
            Range::Any => f64::NEG_INFINITY,
            Range::AtLeastZero => 0.0,
            Range::Positive => (LEAST_POSITIVE * self.values[at].abs()).max(f64::MIN_POSITIVE),
        }
    }

    /// The unknowns after a change. Constants stay within their ranges; a positive constant keeps a share of its value, unless the normal equations
    /// do not resolve the value itself.
    pub(super) fn stepped(&self, x: &[f64], change: &[f64], normal: &Normal) -> Vec<f64> {
        let m = normal.right.len();
        let stepped = |(k, (&x, d)): (usize, (&f64, f64))| match k.checked_sub(self.chosen.len()) {
            Some(sensor) if self.sensors[sensor].kind == SensorKind::Delay => {
                (x + d).clamp(-MOST_DELAY * self.driven.step, MOST_DELAY * self.driven.step)
            }
            Some(_) => x + d,
            None if self.ranges[self.chosen[k]] == Range::Positive => {
                let unresolved = normal.matrix[k * m + k] * x * x < 1.0;
                (x + d).max(if unresolved { 0.0 } else { LEAST_SHARE_LEFT * x }).max(self.bound(k))
            }
            None => (x + d).max(self.bound(k)),
        };
        let changes = change.iter().copied().chain(std::iter::repeat(0.0));
        x.iter().zip(changes).enumerate().map(stepped).collect()
    }

    /// Sum of squares of the motion about its mean, in units of the noise, for the given number of readings.
    fn size(&self, numbers: f64) -> f64 {
        let square = |(spread, sigma): (&f64, &f64)| (spread / sigma).powi(2);
        numbers * self.spread.iter().zip(&self.sigma).map(square).sum::<f64>() / self.sigma.len() as f64
    }

    /// Size of an unknown, with which its error is compared: its value, for a sensor's offset the spread of the motion, for its delay ten samples.
    pub fn scale(&self, unknown: usize, x: f64) -> f64 {
        match unknown.checked_sub(self.chosen.len()).map(|k| self.sensors[k]) {
            None => x.abs(),
            Some(Sensor { kind: SensorKind::Offset, coordinate }) => self.spread[coordinate],
            Some(Sensor { kind: SensorKind::Gain, .. }) => 1.0,
            Some(Sensor { kind: SensorKind::Delay, .. }) => USUAL_DELAY * self.driven.step,
        }
    }

    /// Marks the unknowns for which a change by their size, or by that of their starting value, has at most the given effect in the normal
    /// equations.
    pub(super) fn too_weak(&self, x: &[f64], normal: &Normal, least: f64) -> Vec<bool> {
        let m = normal.right.len();
        let given = |k: usize| self.chosen.get(k).map_or(0.0, |&at| self.values[at].abs());
        let scale = |k: usize| Some(self.scale(k, x[k]).max(given(k))).filter(|scale| *scale > 0.0).unwrap_or(1.0);
        (0..m).map(|k| normal.matrix[k * m + k] * scale(k).powi(2) <= least).collect()
    }

    /// Marks the unknowns without a visible effect on the motion: the effect is rounding, or other initial states reproduce it.
    pub fn without_effect(&self, x: &[f64], normal: &Normal) -> Vec<bool> {
        self.ineffective(x, normal, NO_EFFECT)
    }

    /// The same for effects of at most the given share of the squared motion.
    fn ineffective(&self, x: &[f64], normal: &Normal, share: f64) -> Vec<bool> {
        let m = x.len();
        let mut fixed = self.too_weak(x, normal, share * self.size(normal.count));
        for (k, fixed) in fixed.iter_mut().enumerate() {
            *fixed |= normal.matrix[k * m + k] <= LIKE_STARTS * normal.diagonal[k];
        }
        fixed
    }

    /// The solution of the damped normal equations, with some unknowns fixed. Constants at a bound that would leave their range stay there.
    pub(super) fn step(&self, x: &[f64], normal: &mut Normal, fixed: &[bool], damping: f64) -> Step {
        let m = normal.right.len();
        let at_bound: Vec<bool> = (0..m).map(|k| x[k] <= self.bound(k)).collect();
        let mut held: Vec<bool> = (0..m).map(|k| !fixed[k] && at_bound[k] && normal.right[k] <= 0.0).collect();
        loop {
            let free: Vec<usize> = (0..m).filter(|&k| !fixed[k] && !held[k]).collect();
            let change = solution(normal, &free, damping);
            let out = |k: &usize| at_bound[*k] && change[*k] < 0.0;
            let leaving: Vec<usize> = free.iter().copied().filter(out).collect();
            if leaving.is_empty() {
                let decrement = dot(&change, &normal.right);
                return Step { change, decrement, held };
            }
            leaving.into_iter().for_each(|k| held[k] = true);
        }
    }

    /// Records the Newton decrement and whether the search has converged; `stalled` if no step reduces the sum of squares.
    pub(super) fn record_convergence(&self, x: &[f64], normal: &mut Normal, fixed: &[bool], stalled: bool) {
        let step = self.step(x, normal, fixed, 0.0);
        let variance = (normal.square / normal.count.max(1.0)).max(1.0);
        normal.held = step.held;
        normal.decrement = step.decrement.max(normal.start_decrement) / variance;
        let filtered = !self.disturbances.force.is_empty();
        let limit = if !stalled {
            CONVERGED_DECREMENT
        } else if filtered {
            FILTERED_DECREMENT
        } else {
            STALLED_DECREMENT
        };
        normal.converged = normal.failed == 0 && normal.decrement < limit;
    }

    /// Fits unknowns and initial states; returns the undamped normal equations at the end.
    pub fn fit(&self, x: &mut Vec<f64>, segments: &mut [Segment], iterations: usize) -> Normal {
        self.project_starts(x, segments);
        let mut best = self.all(x, segments);
        let mut normal = self.normal(&best, segments);
        let mut fixed = self.ineffective(x, &normal, NO_EFFECT_IN_SEARCH);
        self.record_convergence(x, &mut normal, &fixed, false);
        let mut damping = FIRST_DAMPING;
        for _ in 0..iterations {
            let residual = (normal.square / normal.count.max(1.0)).sqrt();
            if normal.converged || !self.cancellation.iterate(residual) {
                break;
            }
            let change = self.step(x, &mut normal, &fixed, damping).change;
            let moved = self.stepped(x, &change, &normal);
            let real: Vec<f64> = moved.iter().zip(x.iter()).map(|(after, before)| after - before).collect();
            let starts: Vec<Vec<f64>> = segments.iter().map(|segment| segment.start.clone()).collect();
            let mover = self.mover(x, &moved);
            for (segment, linear) in segments.iter_mut().zip(&best) {
                let Some(linear) = linear else { continue };
                advance(mover.as_ref(), &mut segment.start, &self.start_step(linear, &real, damping));
            }
            let tried = self.all(&moved, segments);
            let after = self.normal(&tried, segments);
            if after.square < normal.square {
                (*x, best, normal) = (moved, tried, after);
                fixed = self.ineffective(x, &normal, NO_EFFECT_IN_SEARCH);
                self.record_convergence(x, &mut normal, &fixed, false);
                damping = f64::max(damping / 10.0, LEAST_DAMPING);
            } else {
                segments.iter_mut().zip(starts).for_each(|(segment, start)| segment.start = start);
                damping = f64::max(damping * 10.0, 1e-6);
                if damping > MOST_DAMPING {
                    self.record_convergence(x, &mut normal, &fixed, true);
                    break;
                }
            }
        }
        normal
    }

    /// The step of an initial state, given that of the unknowns.
    fn start_step(&self, linear: &Linear, change: &[f64], damping: f64) -> Vec<f64> {
        let (starts, width) = (linear.right.len() - self.unknowns(), linear.right.len());
        let own = times(starts, &self.start_inverse(linear, damping), &linear.right[..starts]);
        if change.iter().all(|d| *d == 0.0) {
            return own;
        }
        let coupled = |i: usize| dot(&linear.matrix[i * width + starts..(i + 1) * width], change);
        let response = times(starts, &self.start_inverse(linear, 0.0), &(0..starts).map(coupled).collect::<Vec<_>>());
        own.iter().zip(response).map(|(own, response)| own - response).collect()
    }

    /// Fits only the initial states, each segment separately; `false` if the sum of squares still decreases.
    pub fn fit_starts(&self, x: &[f64], segments: &mut [Segment], iterations: usize) -> bool {
        let no_change = vec![0.0; self.unknowns()];
        self.project_starts(x, segments);
        let mover = self.mover(x, x);
        let mut best = self.all(x, segments);
        let mut starts: Vec<Vec<f64>> = segments.iter().map(|segment| segment.start.clone()).collect();
        let mut damping = vec![1e-6; segments.len()];
        let mut converged = false;
        for _ in 0..iterations {
            for (k, segment) in segments.iter_mut().enumerate() {
                segment.start.clone_from(&starts[k]);
                if let Some(linear) = &best[k] {
                    advance(mover.as_ref(), &mut segment.start, &self.start_step(linear, &no_change, damping[k]));
                }
            }
            let tried = self.all(x, segments);
            let mut decrease = 0.0;
            for (k, tried) in tried.into_iter().enumerate() {
                let square = |linear: &Option<Linear>| linear.as_ref().map_or(f64::INFINITY, |linear| linear.square);
                let (before, after) = (square(&best[k]), square(&tried));
                if after < before {
                    decrease += if before.is_finite() { before - after } else { after };
                    (best[k], damping[k]) = (tried, damping[k] / 10.0);
                    starts[k].clone_from(&segments[k].start);
                } else {
                    damping[k] = (damping[k] * 100.0).max(1e-4);
                }
            }
            let total: f64 = best.iter().flatten().map(|linear| linear.square).sum();
            converged = decrease < LEAST_START_DECREASE * total;
            if converged || self.cancellation.is_cancelled() {
                break;
            }
        }
        segments.iter_mut().zip(starts).for_each(|(segment, start)| segment.start = start);
        converged
    }
}

/// Eigenvectors of the correlation matrix of the free unknowns.
#[derive(Clone, Debug)]
pub(super) struct Spectrum {
    free: Vec<usize>,
    values: Vec<f64>,
    vectors: Vec<f64>,
}

impl Spectrum {
    /// `None` for a matrix that is not finite.
    fn of(normal: &Normal, free: &[usize]) -> Option<Self> {
        let (m, count) = (normal.right.len(), free.len());
        let scaled: Vec<f64> = (0..count * count)
            .map(|at| (free[at / count], free[at % count]))
            .map(|(i, j)| normal.matrix[i * m + j] / (root(normal, i) * root(normal, j)))
            .collect();
        let (mut values, mut vectors) = (vec![0.0; count], vec![0.0; count * count]);
        eigh(count, &scaled, &mut values, &mut vectors, &mut Workspace::new()).ok()?;
        Some(Self { free: free.to_vec(), values, vectors })
    }
}

/// Square root of an element of the diagonal.
fn root(normal: &Normal, k: usize) -> f64 {
    normal.matrix[k * normal.right.len() + k].max(f64::MIN_POSITIVE).sqrt()
}

/// Solution of the damped normal equations for the free unknowns, by the eigenvectors of the correlation matrix, which are kept for the next step.
/// Eigenvalues below the rounding are raised to it.
fn solution(normal: &mut Normal, free: &[usize], damping: f64) -> Vec<f64> {
    let mut change = vec![0.0; normal.right.len()];
    let known = normal.spectrum.take().filter(|spectrum| spectrum.free == free);
    let Some(spectrum) = known.or_else(|| Spectrum::of(normal, free)) else { return change };
    let before = free.iter().map(|&k| normal.diagonal[k] / root(normal, k).powi(2)).fold(0.0, f64::max);
    let ridge = RIDGE.max(ELIMINATION * before);
    let right: Vec<f64> = free.iter().map(|&k| normal.right[k] / root(normal, k)).collect();
    for (value, vector) in spectrum.values.iter().zip(spectrum.vectors.chunks_exact(free.len().max(1))) {
        let size = dot(vector, &right) / (value.max(ridge) + damping);
        vector.iter().zip(free).for_each(|(v, &k)| change[k] += v * size / root(normal, k));
    }
    normal.spectrum = Some(spectrum);
    change
}

/// Fixes unknowns in normal equations, so that they keep their values.
pub(super) fn hold_fixed(fixed: &[bool], matrix: &mut [f64], right: &mut [f64]) {
    let m = right.len();
    for (k, _) in fixed.iter().enumerate().filter(|(_, fixed)| **fixed) {
        (0..m).for_each(|l| (matrix[k * m + l], matrix[l * m + k]) = (0.0, 0.0));
        (matrix[k * m + k], right[k]) = (1.0, 0.0);
    }
}
