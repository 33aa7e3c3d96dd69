//! Constants by least squares on smoothed accelerations: where the fit through the motion begins.

use super::follow::{Follower, LANES, forces};
use super::linear::{inverse_with, times};
use super::solve::{Problem, mute, without_effect};
use crate::recording::smooth::Smoothed;

/// States at most.
const MOST_STATES: usize = 12_000;
/// Errors beyond so many standard deviations count linearly.
const HUBER: f64 = 3.0;
const ITERATIONS: usize = 60;
/// Part of the diagonal that keeps normal equations regular.
const RIDGE: f64 = 1e-11;
/// Effect of a constant on accelerations, over these and squared, that is rounding alone.
const NO_EFFECT: f64 = 1e-20;

/// States with their accelerations, `(states, n)`, and one over the errors to expect of these.
pub(super) struct States {
    pub q: Vec<f64>,
    pub v: Vec<f64>,
    pub a: Vec<f64>,
    pub force: Vec<f64>,
    weight: Vec<f64>,
}

impl States {
    /// Of the samples with full windows.
    pub fn new(problem: &Problem<'_>, smoothed: &[Option<Smoothed>]) -> Self {
        let n = problem.course.equations.n;
        let mut states = Self { q: vec![], v: vec![], a: vec![], force: vec![], weight: vec![] };
        let full = |s: &Smoothed| s.interior().filter(|&at| s.is_full(at)).collect::<Vec<_>>();
        let all: usize = smoothed.iter().flatten().map(|s| full(s).len()).sum();
        let stride = all.div_ceil(MOST_STATES).max(1);
        let mut force = vec![0.0; n];
        for (track, smoothed) in problem.course.recording.tracks.iter().zip(smoothed) {
            let Some(smoothed) = smoothed else { continue };
            for at in full(smoothed).into_iter().step_by(stride) {
                let range = at * n..(at + 1) * n;
                states.q.extend(&smoothed.q[range.clone()]);
                states.v.extend(&smoothed.v[range.clone()]);
                states.a.extend(&smoothed.a[range.clone()]);
                let errors = smoothed.a_error[range.clone()].iter().zip(&smoothed.a_bias[range]);
                states.weight.extend(errors.map(|(error, bias)| error.hypot(*bias).max(1e-300).recip()));
                if !track.force.is_empty() {
                    forces(track, problem.course.between, (at.max(1), if at == 0 { 0.0 } else { 1.0 }), &mut force);
                }
                states.force.extend(&force);
            }
        }
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

    /// Normal equations of the accelerations' errors; `None` where they cannot be solved for anywhere.
    fn normal(&self, problem: &Problem<'_>, x: &[f64]) -> Option<(Vec<f64>, Vec<f64>, f64)> {
        let (n, m) = (problem.course.equations.n, problem.chosen.len());
        let values = problem.parameters(x);
        let mut follower = Follower::new(&problem.course);
        let (mut matrix, mut right, mut square, mut used) = (vec![0.0; m * m], vec![0.0; m], 0.0, 0);
        let mut a = vec![0.0; LANES * n];
        for first in (0..self.q.len()).step_by(LANES * n) {
            let range = first..(first + LANES * n).min(self.q.len());
            let (q, v) = (&self.q[range.clone()], &self.v[range.clone()]);
            let a = &mut a[..q.len()];
            follower.accelerate(&values, (q, v), &self.force[range.clone()], a);
            let slopes = follower.slopes(&values, (q, v, a));
            for (k, row) in slopes.chunks_exact(2 * n + m).enumerate() {
                let at = first + k;
                let row = &row[2 * n..];
                let residual = (self.a[at] - a[k]) * self.weight[at];
                if !(residual.is_finite() && row.iter().all(|x| x.is_finite())) {
                    square += 1e6;
                    continue;
                }
                used += 1;
                let size = residual.abs();
                let cut = if size > HUBER { HUBER / size } else { 1.0 };
                square += if size > HUBER { HUBER * (2.0 * size - HUBER) } else { residual * residual };
                let scale = cut * self.weight[at] * self.weight[at];
                for (i, x) in row.iter().enumerate() {
                    right[i] += cut * self.weight[at] * x * residual;
                    matrix[i * m..(i + 1) * m].iter_mut().zip(row).for_each(|(sum, y)| *sum += scale * x * y);
                }
            }
        }
        (used > 0).then_some((matrix, right, square))
    }

    /// Moves constants to where smoothed accelerations are met best; `false` if no acceleration can be solved for.
    pub fn fit(&self, problem: &Problem<'_>, x: &mut Vec<f64>) -> bool {
        let m = problem.chosen.len();
        let Some(mut best) = self.normal(problem, x) else { return false };
        let size: f64 = self.a.iter().zip(&self.weight).map(|(a, w)| (a * w).powi(2)).sum();
        let mut damping = 1e-3;
        for _ in 0..ITERATIONS {
            let (matrix, right, square) = &best;
            let mut right = right.clone();
            let mut damped: Vec<f64> =
                (0..m * m).map(|at| matrix[at] * if at / m == at % m { 1.0 + damping } else { 1.0 }).collect();
            mute(&without_effect(&x[..m], matrix, NO_EFFECT * size), &mut damped, &mut right);
            let Some(inverse) = inverse_with(m, &damped, RIDGE) else { break };
            let mut change = times(m, &inverse, &right);
            change.resize(x.len(), 0.0);
            let moved = problem.moved(x, &change);
            match self.normal(problem, &moved) {
                Some(tried) if tried.2 < *square => {
                    let done = square - tried.2 < 1e-8 * square;
                    (*x, best) = (moved, tried);
                    damping = f64::max(damping / 10.0, 1e-10);
                    if done {
                        break;
                    }
                }
                _ => {
                    damping *= 10.0;
                    if damping > 1e9 {
                        break;
                    }
                }
            }
        }
        true
    }
}
