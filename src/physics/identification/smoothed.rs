//! Least-squares fits to smoothed motion: to its accelerations, which gives starting values for the fit to the motion, or to known forces.

use super::averages::Averages;
use super::closed::FreePart;
use super::driven::forces;
use super::follow::Follower;
use super::linear::Products;
use super::solve::{Normal, Problem};
use super::thresholds::{
    DOUBLED_PHASE_VALUES, FAILED_EQUATION, HUBER, LANES, LEAST_COSINE, LEAST_DAMPING, LEAST_PHASE_DECREASE,
    MATRIX_KEPT, MOST_DAMPING, MOST_PHASE_VALUES, MOST_SMOOTHED_STATES, MOST_WEIGHT, NO_EFFECT_IN_SEARCH,
    PHASE_HALVINGS, PHASE_RANGE, SHORTEST_BEGINNING, SMOOTHED_ITERATIONS,
};
use crate::recording::smooth::Smoothed;
use std::ops::Range;

/// Smoothed states with their accelerations and known forces, `(states, n)` each.
#[derive(Default)]
pub(super) struct States {
    pub q: Vec<f64>,
    pub v: Vec<f64>,
    pub a: Vec<f64>,
    pub force: Vec<f64>,
    /// Expected errors of the accelerations.
    pub a_error: Vec<f64>,
    /// Trajectory and sample of every state.
    pub places: Vec<(usize, usize)>,
    /// Inverse errors of the fitted quantity: of the accelerations, or of the forces.
    pub weight: Vec<f64>,
    /// Number of samples between states.
    pub stride: usize,
    /// Number of states on either side over which force equations are averaged. The average is taken twice, so that the weights form a triangle.
    pub averaged: usize,
    /// Weights of the force equations in these averages, `(states, n)`; empty for equal weights.
    pub share: Vec<f64>,
    /// Units in which forces on the coordinates are compared under constraints, `(n)`.
    pub units: Vec<f64>,
}

/// The quantity that the constants are fitted to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Quantity {
    Accelerations,
    Forces,
}

impl States {
    /// The states at samples with full smoothing windows.
    pub fn new(problem: &Problem<'_>, smoothed: &[Option<Smoothed>]) -> Self {
        let n = problem.driven.equations.n;
        let (mut states, mut force) = (Self::default(), vec![0.0; n]);
        let full = |s: &Smoothed| s.interior().filter(|&at| s.is_full(at)).collect::<Vec<_>>();
        let all: usize = smoothed.iter().flatten().map(|s| full(s).len()).sum();
        let stride = all.div_ceil(MOST_SMOOTHED_STATES).max(1);
        states.stride = stride;
        for (at, (track, smoothed)) in problem.driven.recording.tracks.iter().zip(smoothed).enumerate() {
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
                    forces(track, problem.driven.between, place, &mut force);
                }
                states.force.extend(&force);
            }
        }
        states.weight = states.a_error.iter().map(|error| error.max(1e-300).recip()).collect();
        // A single sample that appears exact must not outweigh all others.
        let mut sorted = states.weight.clone();
        sorted.sort_by(f64::total_cmp);
        let most = MOST_WEIGHT * sorted.get(sorted.len() / 2).copied().unwrap_or(1.0);
        states.weight.iter_mut().for_each(|w| *w = w.min(most));
        states
    }

    /// Number of states.
    pub fn len(&self, n: usize) -> usize {
        self.q.len() / n
    }

    /// The track and the time of a state.
    fn place(&self, problem: &Problem<'_>, at: usize) -> (usize, f64) {
        let (track, sample) = self.places[at];
        (track, problem.driven.recording.tracks[track].times[sample])
    }

    /// Calls `visit` with every batch of states: the evaluated equations, the range of the batch in the arrays, and its accelerations for constants
    /// `x`.
    pub fn batches(
        &self,
        problem: &Problem<'_>,
        x: &[f64],
        mut visit: impl FnMut(&mut Follower<'_>, Range<usize>, &[f64]),
    ) {
        let n = problem.driven.equations.n;
        let values = problem.parameters(x);
        let mut follower = Follower::new(&problem.driven);
        let mut a = vec![0.0; LANES * n];
        let firsts = (0..self.q.len()).step_by(LANES * n);
        for first in firsts.take_while(|_| problem.cancellation.go_on()) {
            let range = first..(first + LANES * n).min(self.q.len());
            let a = &mut a[..range.len()];
            let state = (&self.q[range.clone()], &self.v[range.clone()]);
            follower.at((first / n..range.end / n).map(|at| self.place(problem, at)));
            follower.accelerate(&values, state, &self.force[range.clone()], a);
            visit(&mut follower, range, a);
        }
    }

    /// Calls `visit(first index, residuals, slopes)` with the residuals of every batch of states and their derivatives by the constants.
    fn residuals(
        &self,
        problem: &Problem<'_>,
        x: &[f64],
        quantity: Quantity,
        mut visit: impl FnMut(usize, &[f64], &[f64]),
    ) {
        let (n, values) = (problem.driven.equations.n, problem.parameters(x));
        let width = 2 * n + problem.driven.chosen;
        let (mut residual, mut rows, mut pending) = (Vec::new(), Vec::new(), PendingRows::default());
        // Length of a row: a residual and its derivatives.
        let one = width - 2 * n + 1;
        let mut averages = Averages::new(self, (n, one));
        self.batches(problem, x, |follower, range, a| {
            let (first, measured) = (range.start, &self.a[range.clone()]);
            let (q, v) = (&self.q[range.clone()], &self.v[range]);
            rows.clear();
            residual.resize(a.len(), 0.0);
            if quantity == Quantity::Accelerations {
                residual.iter_mut().zip(measured.iter().zip(a)).for_each(|(r, (measured, a))| *r = measured - *a);
                for slopes in follower.slopes(&values, (q, v, a)).chunks_exact(width) {
                    rows.extend_from_slice(&slopes[2 * n..]);
                }
                return visit(first, &residual, &rows);
            }
            follower.unbalanced_forces(measured, &mut residual);
            let slopes = follower.force_slopes(&values, (q, v, measured)).chunks_exact(width);
            for (r, slopes) in residual.iter().zip(slopes) {
                rows.push(*r);
                rows.extend_from_slice(&slopes[2 * n..]);
            }
            self.with_free_part(follower, |free| free.project_all(&mut rows, one));
            for row in rows.chunks_exact(n * one) {
                averages.take(row, |mean| pending.take(mean, one, LANES * n, &mut visit));
            }
        });
        pending.finish(&mut visit);
    }

    /// Under constraints, calls `act` with the projection of forces to the part that the constraints cannot balance, at the states evaluated last.
    pub fn with_free_part(&self, follower: &Follower<'_>, act: impl FnOnce(FreePart<'_>)) {
        let (n, rows) = (self.units.len(), follower.rows());
        if n > 0 && !rows.is_empty() {
            act(FreePart { rows, constraints: follower.constraints(), units: &self.units });
        }
    }

    /// Normal equations with the right-hand sides of batches of states; `None` if no residual is finite.
    pub fn normal(&self, problem: &Problem<'_>, x: &[f64], quantity: Quantity) -> Option<Normal> {
        let m = problem.chosen.len();
        let mut products = Products::new(problem.driven.equations.n, m);
        let mut matrix = vec![0.0; m * m];
        let add = |i: usize, row: &[f64], factor: f64| products.add(i, row, factor, &mut matrix);
        let normal = self.right_hand_side(problem, x, quantity, add)?;
        products.finish(&mut matrix);
        let diagonal = (0..m).map(|k| matrix[k * m + k]).collect();
        Some(Normal { matrix, diagonal, ..normal })
    }

    /// Normal equations without their matrix; `add(coordinate, row, factor)` receives the weighted rows, whose products sum to the matrix.
    fn right_hand_side(
        &self,
        problem: &Problem<'_>,
        x: &[f64],
        quantity: Quantity,
        mut add: impl FnMut(usize, &[f64], f64),
    ) -> Option<Normal> {
        let (n, m) = (problem.driven.equations.n, problem.chosen.len());
        let mut normal = Normal { right: vec![0.0; m], held: vec![false; m], ..Normal::default() };
        self.residuals(problem, x, quantity, |first, residuals, slopes| {
            let mut right = vec![0.0; m];
            for (k, residual) in residuals.iter().enumerate() {
                let (weight, row) = (self.weight[first + k], &slopes[k * m..(k + 1) * m]);
                let residual = residual * weight;
                if !(residual.is_finite() && row.iter().all(|x| x.is_finite())) {
                    normal.square += FAILED_EQUATION;
                    continue;
                }
                normal.count += 1.0;
                let size = residual.abs();
                let cut = if size > HUBER { HUBER / size } else { 1.0 };
                normal.square += if size > HUBER { HUBER * (2.0 * size - HUBER) } else { residual * residual };
                right.iter_mut().zip(row).for_each(|(sum, x)| *sum += cut * weight * x * residual);
                add((first + k) % n, row, cut.sqrt() * weight);
            }
            normal.right.iter_mut().zip(&right).for_each(|(sum, x)| *sum += x);
            normal.rights.push(right);
        });
        (normal.count > 0.0).then_some(normal)
    }

    /// Force residuals, `(states, n)`, and their averages over neighbouring states.
    pub fn force_residuals(&self, problem: &Problem<'_>, x: &[f64]) -> [Vec<f64>; 2] {
        let mut all = vec![0.0; self.q.len()];
        self.batches(problem, x, |follower, range, _| {
            let found = &mut all[range.clone()];
            follower.unbalanced_forces(&self.a[range], found);
            self.with_free_part(follower, |free| free.project_all(found, 1));
        });
        let (n, mut means) = (problem.driven.equations.n, Vec::with_capacity(all.len()));
        let mut averages = Averages::new(self, (n, 1));
        all.chunks_exact(n).for_each(|row| averages.take(row, |mean| means.extend_from_slice(mean)));
        [all, means]
    }

    /// Fits the constants to the smoothed motion; returns the normal equations at the end, `None` if no residual is finite.
    pub fn fit(&self, problem: &Problem<'_>, x: &mut Vec<f64>, quantity: Quantity) -> Option<Normal> {
        let mut best = self.normal(problem, x, quantity)?;
        let given = if quantity == Quantity::Forces { &self.force } else { &self.a };
        let size: f64 = given.iter().zip(&self.weight).map(|(a, w)| (a * w).powi(2)).sum();
        // Forces are often linear in the constants. The matrix of one step can then be used for the next.
        let mut linear = quantity == Quantity::Forces;
        let mut damping = if linear { 1e-9 } else { 1e-3 };
        let (mut matrix_kept, mut before) = (false, f64::INFINITY);
        for _ in 0..SMOOTHED_ITERATIONS {
            let fixed = problem.too_weak(x, &best, NO_EFFECT_IN_SEARCH * size);
            problem.record_convergence(x, &mut best, &fixed, damping > MOST_DAMPING);
            if matrix_kept && !best.converged && best.decrement > MATRIX_KEPT * before {
                best = self.normal(problem, x, quantity)?;
                (linear, matrix_kept) = (false, false);
                continue;
            }
            let residual = (best.square / best.count.max(1.0)).sqrt();
            if best.converged || damping > MOST_DAMPING || !problem.cancellation.iterate(residual) {
                break;
            }
            before = best.decrement;
            let change = problem.step(x, &mut best, &fixed, damping).change;
            let moved = problem.stepped(x, &change, &best);
            let tried = match linear {
                true => self.right_hand_side(problem, &moved, quantity, |_, _, _| ()),
                false => self.normal(problem, &moved, quantity),
            };
            match tried {
                Some(mut tried) if tried.square < best.square => {
                    if linear {
                        tried.keep_matrix(best);
                        matrix_kept = true;
                    }
                    (*x, best) = (moved, tried);
                    damping = f64::max(damping / 10.0, LEAST_DAMPING);
                }
                _ => damping *= 10.0,
            }
        }
        Some(best)
    }
}

impl Normal {
    /// `true` if the sum of squares is significantly smaller than that of a fit closer to the given constants.
    fn is_better(&self, closer: &Self) -> bool {
        self.square < (1.0 - LEAST_PHASE_DECREASE) * closer.square
    }
}

impl States {
    /// Fits the constants to the accelerations, as [`States::fit`], for forces that may have a phase. The sum of squares has as many minima over a
    /// frequency as there are periods in the recording, and similarly over the wave number of a field that the motion crosses. The fit therefore
    /// begins at several values of such a constant. A wide range is searched in a short part of a long recording first, which then doubles. Returns
    /// the constants, by index, whose range was searched only in part, and that part.
    pub fn fit_phases(&self, problem: &Problem<'_>, x: &mut Vec<f64>) -> Option<Vec<(usize, [f64; 2])>> {
        let given = x.clone();
        let mut best = self.fit(problem, x, Quantity::Accelerations)?;
        let mut cut = Vec::new();
        for k in 0..problem.chosen.len() {
            let Some(whole) = self.phase_step(problem, (&given, k)) else { continue };
            let reach = if given[k] == 0.0 { MOST_PHASE_VALUES as f64 * whole } else { PHASE_RANGE * given[k].abs() };
            let mut share = 1.0;
            let mut step = whole;
            while MOST_PHASE_VALUES as f64 * step < reach && share > SHORTEST_BEGINNING {
                share /= 2.0;
                step = self.beginning(problem, share).phase_step(problem, (&given, k)).unwrap_or(reach);
            }
            let mut count = ((reach / step).ceil() as usize).min(MOST_PHASE_VALUES);
            if count as f64 * step < reach {
                let widest = count as f64 * step;
                cut.push((k, [given[k] - widest, given[k] + widest]));
            }
            let mut from = given.clone();
            loop {
                let part = (share < 1.0).then(|| self.beginning(problem, share));
                let found = part.as_ref().unwrap_or(self).best_start(problem, (&from, k), step, count);
                let Some((tried, found)) = found else { break };
                if share == 1.0 {
                    if found.is_better(&best) {
                        (*x, best) = (tried, found);
                    }
                    break;
                }
                (from, share, count) = (tried, (2.0 * share).min(1.0), DOUBLED_PHASE_VALUES);
                step = (step / 2.0).max(whole);
            }
        }
        Some(cut)
    }

    /// The best of the fits that begin at a value of constant `k` and at `count` values on either side of it; of equally good ones the closest.
    fn best_start(
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
            let Some(found) = self.fit(problem, &mut tried, Quantity::Accelerations) else { continue };
            if best.as_ref().is_none_or(|(_, best)| found.is_better(best)) {
                best = Some((tried, found));
            }
        }
        best
    }

    /// The states within the first `share` of the time.
    fn beginning(&self, problem: &Problem<'_>, share: f64) -> Self {
        let n = problem.driven.equations.n;
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

    /// Largest change of a constant, among the searched range and its halves, that leaves the derivatives of the accelerations by the constant
    /// almost parallel. `None` if the whole range does: the constant, such as a stiffness, is not part of a phase. Growth of the derivatives is not
    /// tested, because smoothing omits the beginning of a recording.
    fn phase_step(&self, problem: &Problem<'_>, (x, k): (&[f64], usize)) -> Option<f64> {
        let m = problem.chosen.len();
        let derivatives = |change: f64| {
            let (mut moved, mut found) = (x.to_vec(), Vec::new());
            moved[k] += change;
            self.residuals(problem, &moved, Quantity::Accelerations, |first, _, slopes| {
                let rows = slopes.chunks_exact(m).zip(&self.weight[first..]);
                found.extend(rows.map(|(row, weight)| weight * row[k]));
            });
            found
        };
        let unchanged = derivatives(0.0);
        let parallel = |change: &f64| {
            let changed = derivatives(*change);
            let pairs = unchanged.iter().zip(&changed).filter(|(a, b)| a.is_finite() && b.is_finite());
            let [ab, aa, bb] = pairs.fold([0.0; 3], |[ab, aa, bb], (a, b)| [ab + a * b, aa + a * a, bb + b * b]);
            ab >= LEAST_COSINE * (aa * bb).sqrt()
        };
        let range = if x[k] == 0.0 { 1.0 } else { PHASE_RANGE * x[k].abs() };
        let step = (0..PHASE_HALVINGS).map(|halvings| range * 0.5f64.powi(halvings)).find(parallel)?;
        (step < range).then_some(step)
    }
}

/// Residuals and their derivatives that wait until they fill a batch.
#[derive(Default)]
struct PendingRows {
    residuals: Vec<f64>,
    slopes: Vec<f64>,
    first: usize,
}

impl PendingRows {
    /// Adds rows of a residual and its derivatives, `one` numbers each; passes them on once there are `batch`.
    fn take(&mut self, rows: &[f64], one: usize, batch: usize, visit: &mut impl FnMut(usize, &[f64], &[f64])) {
        for row in rows.chunks_exact(one) {
            self.residuals.push(row[0]);
            self.slopes.extend_from_slice(&row[1..]);
        }
        if self.residuals.len() >= batch {
            self.finish(visit);
        }
    }

    /// Passes on the remaining rows.
    fn finish(&mut self, visit: &mut impl FnMut(usize, &[f64], &[f64])) {
        if !self.residuals.is_empty() {
            visit(self.first, &self.residuals, &self.slopes);
            self.first += self.residuals.len();
            self.residuals.clear();
            self.slopes.clear();
        }
    }
}
