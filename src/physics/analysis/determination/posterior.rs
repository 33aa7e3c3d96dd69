//! What a model misses of the accelerations of observed states, and the changes that make up for it.

use super::changes::{Changes, Row, Usual};
use super::observed::Observed;
use super::regression::{Sums, groups, jackknife};
use super::{Estimate, Linear};
use crate::lagrangian::{EulerLagrange, Request, Terms};
use crate::linalg::{Workspace, dot, inverse};

/// States on which a model is finite, with what its accelerations miss.
pub(super) struct Data {
    n: usize,
    pub q: Vec<f64>,
    pub v: Vec<f64>,
    /// The model's accelerations, by known forces too.
    pub a: Vec<f64>,
    missed: Vec<f64>,
    /// Accelerations of less bias less the observed ones, or zeros.
    finer: Vec<f64>,
    inverse: Vec<f64>,
    mass: Vec<f64>,
    /// Mean square of the observed accelerations, of their expected error, and the number of independent errors, of each
    /// coordinate.
    observed: Vec<[f64; 3]>,
}

impl Data {
    pub fn new(model: &dyn EulerLagrange<f64>, observed: &Observed) -> Option<Self> {
        let n = model.coordinates();
        let mut data = Self {
            n,
            q: vec![],
            v: vec![],
            a: vec![],
            missed: vec![],
            finer: vec![],
            inverse: vec![],
            mass: vec![],
            observed: vec![],
        };
        let mut terms = Terms::default();
        let mut workspace = Workspace::new();
        let mut squares = vec![0.0; n];
        for (k, (q, v)) in observed.q.chunks_exact(n).zip(observed.v.chunks_exact(n)).enumerate() {
            if model.terms(q, v, Request::ACCELERATION, &mut terms).is_err() {
                continue;
            }
            let mut inverted = vec![0.0; n * n];
            if inverse(n, &terms.mass_matrix, &mut inverted, &mut workspace).is_err() {
                continue;
            }
            let mut a = terms.acceleration.clone();
            if let Some(force) = observed.force.get(k * n..(k + 1) * n) {
                for (a, row) in a.iter_mut().zip(inverted.chunks_exact(n)) {
                    *a += row.iter().zip(force).map(|(m, f)| m * f).sum::<f64>();
                }
            }
            let seen = &observed.a[k * n..(k + 1) * n];
            let missed: Vec<f64> = seen.iter().zip(&a).map(|(a, b)| a - b).collect();
            if missed.iter().chain(&inverted).all(|x| x.is_finite()) {
                squares.iter_mut().zip(seen).for_each(|(sum, a)| *sum += a * a);
                data.q.extend_from_slice(q);
                data.v.extend_from_slice(v);
                data.a.extend(a);
                data.missed.extend(missed);
                data.finer.extend((0..n).map(|i| observed.finer.get(k * n + i).map_or(0.0, |finer| finer - seen[i])));
                data.inverse.extend(inverted);
                data.mass.extend_from_slice(&terms.mass_matrix);
            }
        }
        let states = data.states() as f64;
        let of = |values: &[f64], i: usize, usual: f64| values.get(i).copied().unwrap_or(usual);
        data.observed = (0..n)
            .map(|i| {
                let error = of(&observed.error, i, 0.0);
                [squares[i] / states, error * error, of(&observed.independent, i, states)]
            })
            .collect();
        (data.q.len() > n).then_some(data)
    }

    pub fn states(&self) -> usize {
        self.q.len() / self.n
    }

    /// Root mean square, over the size, of what is missed of the accelerations of every coordinate beyond their expected error;
    /// `squares` are the mean squares of what is missed.
    fn beyond(&self, squares: &[f64]) -> Vec<f64> {
        let of = |(square, [size, error, _]): (&f64, &[f64; 3])| ((square - error).max(0.0) / size).sqrt();
        squares.iter().zip(&self.observed).map(of).collect()
    }

    /// The same of what the model misses.
    pub fn misfit(&self) -> Vec<f64> {
        self.beyond(&mean_squares(self.n, &self.missed))
    }

    pub fn usual(&self) -> Option<Usual> {
        let (n, states) = (self.n, self.states() as f64);
        let all = |values: &[f64]| mean_squares(n, values).into_iter().map(f64::sqrt).collect::<Vec<_>>();
        let mass =
            (0..n).map(|i| self.mass.iter().skip(i * n + i).step_by(n * n).map(|m| m.abs()).sum::<f64>() / states);
        let usual = Usual { mass: mass.collect(), velocity: all(&self.v), acceleration: all(&self.a) };
        let positive = |values: &[f64]| values.iter().all(|x| x.is_finite() && *x > 0.0);
        (positive(&usual.mass) && positive(&usual.velocity)).then_some(usual)
    }

    /// Appends the changes of the accelerations of a state by all changes, `(n, changes)`.
    fn push_rows(&self, state: usize, changes: &Changes, row: &mut Row, rows: &mut Vec<f64>) {
        let (n, count) = (self.n, changes.len());
        let at = state * n..(state + 1) * n;
        changes.evaluate(&self.q[at.clone()], &self.v[at.clone()], &self.a[at], row);
        for inverse in self.inverse[state * n * n..(state + 1) * n * n].chunks_exact(n) {
            let start = rows.len();
            rows.resize(start + count, 0.0);
            for (factor, equation) in inverse.iter().zip(row.equation.chunks_exact(count)) {
                rows[start..].iter_mut().zip(equation).for_each(|(sum, x)| *sum -= factor * x);
            }
        }
    }

    /// The changes that make up for what is missed.
    pub fn posterior(&self, changes: &Changes) -> Option<Posterior> {
        let (n, count) = (self.n, changes.len());
        let groups = groups(self.states(), LEAST)?;
        let weights: Vec<f64> = mean_squares(n, &self.missed)
            .into_iter()
            .zip(&self.observed)
            .map(|(square, [size, _, independent])| {
                // Nothing is known better than numbers have digits.
                let square = square.max(1e-20 * size).max(f64::MIN_POSITIVE.sqrt());
                independent / (square * self.states() as f64)
            })
            .collect();
        let mut parts = Vec::new();
        let mut row = Row::default();
        for group in &groups {
            let (mut rows, mut missed) = (Vec::new(), Vec::new());
            for state in group.clone() {
                self.push_rows(state, changes, &mut row, &mut rows);
                missed.extend_from_slice(&self.missed[state * n..(state + 1) * n]);
            }
            for (k, (missed, rows)) in missed.iter_mut().zip(rows.chunks_exact_mut(count)).enumerate() {
                let root = weights[k % n].sqrt();
                *missed *= root;
                rows.iter_mut().for_each(|x| *x *= root);
            }
            parts.push(Sums::new(&rows, &missed));
        }
        let sums = Sums::of(&parts);
        let without = sums.without(&parts, 1.0)?;
        let (mut left, mut pull) = (Vec::with_capacity(self.missed.len()), vec![0.0; count]);
        let mut rows = Vec::new();
        for (group, sizes) in groups.iter().zip(&without) {
            for state in group.clone() {
                rows.clear();
                self.push_rows(state, changes, &mut row, &mut rows);
                let missed = &self.missed[state * n..(state + 1) * n];
                let finer = &self.finer[state * n..(state + 1) * n];
                for ((row, finer), weight) in rows.chunks_exact(count).zip(finer).zip(&weights) {
                    pull.iter_mut().zip(row).for_each(|(sum, x)| *sum += weight * finer * x);
                }
                left.extend(missed.iter().zip(rows.chunks_exact(count)).map(|(e, row)| e - dot(row, sizes)));
            }
        }
        let floor = self.beyond(&mean_squares(n, &left));
        let covariance = sums.covariance(1.0)?;
        let bias = covariance.chunks_exact(count).map(|row| dot(row, &pull)).collect();
        Some(Posterior { covariance, mean: sums.solve(1.0)?, bias, without, floor })
    }
}

/// Share of the deviation before the data that is left after them, from which on they leave a number open.
const OPEN: f64 = 0.5;
/// Fewest states of a group.
const LEAST: usize = 5;

/// Mean square of each of `n` columns.
fn mean_squares(n: usize, values: &[f64]) -> Vec<f64> {
    let count = (values.len() / n) as f64;
    (0..n).map(|i| values.iter().skip(i).step_by(n).map(|x| x * x).sum::<f64>() / count).collect()
}

/// Sizes of the changes after the data.
pub(super) struct Posterior {
    /// `C`.
    covariance: Vec<f64>,
    /// `x`, by all states.
    mean: Vec<f64>,
    /// Change of `x` by accelerations of less bias.
    bias: Vec<f64>,
    /// `x` without each of the groups.
    without: Vec<Vec<f64>>,
    /// Of every coordinate, what neither the model nor its changes account for, over the size of the accelerations.
    pub floor: Vec<f64>,
}

impl Posterior {
    /// Variance of a linear function that the data leave open: of size before them, and only believed.
    fn believed(&self, slopes: &[f64]) -> f64 {
        self.covariance.chunks_exact(slopes.len()).map(|row| dot(row, slopes).powi(2)).sum()
    }

    /// Change of a linear function from the learned model to the middle, and its variance.
    fn middle(&self, slopes: &[f64]) -> (f64, f64) {
        let middle = dot(slopes, &self.mean);
        let noise = jackknife(middle, self.without.iter().map(|sizes| dot(slopes, sizes)));
        (middle, self.believed(slopes) + noise + dot(slopes, &self.bias).powi(2))
    }

    /// The range of a number whose consistent error is `floor`; without ends where it would be what was believed and not what the
    /// data say.
    pub fn estimate(&self, linear: &Linear, floor: f64) -> Estimate {
        let before = dot(&linear.slopes, &linear.slopes);
        if self.believed(&linear.slopes) > OPEN * OPEN * before {
            return Estimate::open(linear.value);
        }
        let (middle, variance) = self.middle(&linear.slopes);
        Estimate::about(linear.value, middle, variance.sqrt().hypot(floor))
    }

    /// Mean square of the error of a linear function.
    pub fn square(&self, slopes: &[f64]) -> f64 {
        let (middle, variance) = self.middle(slopes);
        variance + middle * middle
    }
}
