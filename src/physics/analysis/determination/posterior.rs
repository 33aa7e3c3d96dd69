//! Residuals of a model's accelerations at observed states, and the changes of the model that explain them, by regularised least squares
//! over groups of consecutive states.

use super::changes::{Changes, Row, Typical};
use super::observed::Observed;
use super::{Estimate, LinearQuantity};
use crate::analysis::thresholds::{
    INFLUENCE_STATES, JACKKNIFE_GROUPS, LEAST_GROUP_STATES, LEAST_GROUPS, LEAST_INFLUENCE, LEAST_SQUARE_RESIDUAL,
    OPEN_SHARE,
};
use crate::lagrangian::{EulerLagrange, Request, Terms, acting_groups};
use crate::linalg::{MatMut, MatRef, Workspace, dot, gemm, inverse, solve};
use std::ops::Range;

/// States at which a model is finite, with the residuals of its accelerations.
pub(super) struct Data {
    n: usize,
    pub q: Vec<f64>,
    pub v: Vec<f64>,
    /// The model's accelerations, by known forces too.
    pub a: Vec<f64>,
    /// Known forces, empty without.
    force: Vec<f64>,
    missed: Vec<f64>,
    /// Accelerations of less bias less the observed ones, or zeros.
    finer: Vec<f64>,
    inverse: Vec<f64>,
    mass: Vec<f64>,
    /// Mean square of the observed accelerations, of their expected error, and the number of independent errors, of each
    /// coordinate.
    observed: Vec<[f64; 3]>,
    /// [`Observed::missed`].
    missed_elsewhere: Vec<f64>,
}

impl Data {
    pub fn new(model: &dyn EulerLagrange<f64>, observed: &Observed) -> Option<Self> {
        let n = model.coordinates();
        let mut data = Self {
            n,
            q: vec![],
            v: vec![],
            a: vec![],
            force: vec![],
            missed: vec![],
            finer: vec![],
            inverse: vec![],
            mass: vec![],
            observed: vec![],
            missed_elsewhere: observed.missed.clone(),
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
                data.force.extend_from_slice(observed.force.get(k * n..(k + 1) * n).unwrap_or_default());
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

    /// Root mean square residual of the accelerations of every coordinate beyond their expected error, over their size; `squares` are the
    /// mean squares of the residuals.
    fn beyond(&self, squares: &[f64]) -> Vec<f64> {
        let of = |(square, [size, error, _]): (&f64, &[f64; 3])| ((square - error).max(0.0) / size).sqrt();
        squares.iter().zip(&self.observed).map(of).collect()
    }

    /// [`Self::beyond`] for the model's own residuals.
    pub fn misfit(&self) -> Vec<f64> {
        self.beyond(&mean_squares(self.n, &self.missed))
    }

    /// Groups of coordinates that do not act on each other, as far as the model knows. An influence does not count if it is below the
    /// model's residuals beyond the error of the data, below twice its residuals on held-out motion, or below a share [`LEAST_INFLUENCE`] of the
    /// acceleration.
    pub fn groups(&self, model: &dyn EulerLagrange<f64>) -> Vec<Vec<usize>> {
        let (n, stride) = (self.n, self.states().div_ceil(INFLUENCE_STATES).max(1));
        let thinned = |x: &[f64]| -> Vec<f64> { x.chunks_exact(n).step_by(stride).flatten().copied().collect() };
        let (q, v, force) = (thinned(&self.q), thinned(&self.v), thinned(&self.force));
        let squares = mean_squares(n, &self.missed);
        let noise = self.observed.iter().zip(&squares).enumerate().map(|(i, ([size, error, independent], square))| {
            let beyond = (square - error).max(0.0) + 2.0 * square * (2.0 / independent).sqrt();
            let share =
                self.missed_elsewhere.get(i).map_or(LEAST_INFLUENCE, |missed| LEAST_INFLUENCE.max(2.0 * missed));
            beyond.max(share * share * size).sqrt()
        });
        let accelerations = |q: &[f64], v: &[f64]| {
            let mut terms = Terms::default();
            // Between observed positions the model may have no accelerations.
            let _ = model.terms(q, v, Request::ACCELERATION, &mut terms);
            if !force.is_empty() {
                let _ = terms.add_force(n, v, &force, &mut Workspace::new());
            }
            terms.acceleration
        };
        acting_groups(n, (&q, &v), &accelerations, &noise.collect::<Vec<_>>())
    }

    /// Coordinates along which a force was known.
    pub fn is_forced(&self, i: usize) -> bool {
        self.force.iter().skip(i).step_by(self.n).any(|force| *force != 0.0)
    }

    pub fn typical(&self) -> Option<Typical> {
        let (n, states) = (self.n, self.states() as f64);
        let all = |values: &[f64]| mean_squares(n, values).into_iter().map(f64::sqrt).collect::<Vec<_>>();
        let mass =
            (0..n).map(|i| self.mass.iter().skip(i * n + i).step_by(n * n).map(|m| m.abs()).sum::<f64>() / states);
        let usual = Typical { mass: mass.collect(), velocity: all(&self.v), acceleration: all(&self.a) };
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

    /// The distribution of the changes that explain the residuals.
    pub fn posterior(&self, changes: &Changes) -> Option<Posterior> {
        let (n, count) = (self.n, changes.len());
        let groups = groups(self.states(), LEAST_GROUP_STATES)?;
        let weights: Vec<f64> = mean_squares(n, &self.missed)
            .into_iter()
            .zip(&self.observed)
            .map(|(square, [size, _, independent])| {
                // Recorded numbers are rounded: a residual cannot be known to be smaller than their last digit.
                let square = square.max(LEAST_SQUARE_RESIDUAL * size).max(f64::MIN_POSITIVE.sqrt());
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

/// Mean square of each of `n` columns.
fn mean_squares(n: usize, values: &[f64]) -> Vec<f64> {
    let count = (values.len() / n) as f64;
    (0..n).map(|i| values.iter().skip(i).step_by(n).map(|x| x * x).sum::<f64>() / count).collect()
}

/// Posterior distribution of the sizes of the changes.
pub(super) struct Posterior {
    /// `C`.
    covariance: Vec<f64>,
    /// `x`, by all states.
    mean: Vec<f64>,
    /// Change of `x` by accelerations of less bias.
    bias: Vec<f64>,
    /// `x` without each of the groups.
    without: Vec<Vec<f64>>,
    /// For every coordinate, the part of the accelerations that neither the model nor its changes explain, over their size.
    pub floor: Vec<f64>,
}

impl Posterior {
    /// Prior variance of a linear function that the data do not reduce.
    fn prior_variance(&self, slopes: &[f64]) -> f64 {
        self.covariance.chunks_exact(slopes.len()).map(|row| dot(row, slopes).powi(2)).sum()
    }

    /// Change of a linear function from the learned model to the middle, and its variance.
    fn middle(&self, slopes: &[f64]) -> (f64, f64) {
        let middle = dot(slopes, &self.mean);
        let noise = jackknife(middle, self.without.iter().map(|sizes| dot(slopes, sizes)));
        (middle, self.prior_variance(slopes) + noise + dot(slopes, &self.bias).powi(2))
    }

    /// The range of a number whose systematic error is `floor`; without ends where it would reflect the prior and not the data.
    pub fn estimate(&self, linear: &LinearQuantity, floor: f64) -> Estimate {
        let before = dot(&linear.slopes, &linear.slopes);
        if self.prior_variance(&linear.slopes) > OPEN_SHARE * OPEN_SHARE * before {
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

/// Groups of at least `least` consecutive states; `None` if they are too few.
pub fn groups(states: usize, least: usize) -> Option<Vec<Range<usize>>> {
    let groups = JACKKNIFE_GROUPS.min(states / least);
    let range = |group: usize| group * states / groups..(group + 1) * states / groups;
    (groups >= LEAST_GROUPS).then(|| (0..groups).map(range).collect())
}

/// Jackknife variance of a number that is `whole` for all groups, from its values without each of them.
pub fn jackknife(whole: f64, without: impl ExactSizeIterator<Item = f64>) -> f64 {
    let groups = without.len() as f64;
    without.map(|x| (x - whole).powi(2)).sum::<f64>() * (groups - 1.0) / groups
}

/// Normal equations of some states: `A^T A`, `A^T e`, `e^T e`.
#[derive(Clone)]
pub struct Sums {
    precision: Vec<f64>,
    pull: Vec<f64>,
    square: f64,
}

impl Sums {
    /// Sums over the rows of `A` and `e`.
    pub fn new(rows: &[f64], missed: &[f64]) -> Self {
        let count = rows.len() / missed.len().max(1);
        let mut sums = Self::zero(count);
        let (a, e) = (MatRef::new(rows, missed.len(), count), MatRef::new(missed, missed.len(), 1));
        gemm(MatMut::new(&mut sums.precision, count, count), true, 1.0, a.t(), a);
        gemm(MatMut::new(&mut sums.pull, count, 1), true, 1.0, a.t(), e);
        sums.square = dot(missed, missed);
        sums
    }

    fn zero(count: usize) -> Self {
        Self { precision: vec![0.0; count * count], pull: vec![0.0; count], square: 0.0 }
    }

    /// Sums over all states.
    pub fn of(parts: &[Self]) -> Self {
        let mut sums = Self::zero(parts.first().map_or(0, |part| part.pull.len()));
        parts.iter().for_each(|part| sums.add(part, 1.0));
        sums
    }

    fn add(&mut self, other: &Self, factor: f64) {
        self.precision.iter_mut().zip(&other.precision).for_each(|(sum, x)| *sum += factor * x);
        self.pull.iter_mut().zip(&other.pull).for_each(|(sum, x)| *sum += factor * x);
        self.square += factor * other.square;
    }

    /// `1 + trust A^T A`.
    fn regular(&self, trust: f64) -> Vec<f64> {
        let mut regular: Vec<f64> = self.precision.iter().map(|x| trust * x).collect();
        let count = self.pull.len();
        (0..count).for_each(|k| regular[k * count + k] += 1.0);
        regular
    }

    /// The factors of the columns of `A` that are normal with deviation 1 before the data.
    pub fn solve(&self, trust: f64) -> Option<Vec<f64>> {
        let count = self.pull.len();
        let pull: Vec<f64> = self.pull.iter().map(|x| trust * x).collect();
        let mut sizes = vec![0.0; count];
        solve(count, &self.regular(trust), &pull, &mut sizes, &mut Workspace::new()).ok()?;
        Some(sizes)
    }

    /// The solution without each of the parts.
    pub fn without(&self, parts: &[Self], trust: f64) -> Option<Vec<Vec<f64>>> {
        let one = |part: &Self| {
            let mut rest = self.clone();
            rest.add(part, -1.0);
            rest.solve(trust)
        };
        parts.iter().map(one).collect()
    }

    /// Inverse of `1 + trust A^T A`.
    pub fn covariance(&self, trust: f64) -> Option<Vec<f64>> {
        let mut covariance = vec![0.0; self.precision.len()];
        inverse(self.pull.len(), &self.regular(trust), &mut covariance, &mut Workspace::new()).ok()?;
        Some(covariance)
    }

    /// The weight of the data that gives the residuals a mean square of 1, for `rows` rows of `A`.
    pub fn trust(&self, rows: usize) -> f64 {
        rows as f64 / self.square.max(f64::MIN_POSITIVE)
    }

    /// Sum of squared residuals with these factors.
    pub fn residual_square(&self, sizes: &[f64]) -> f64 {
        let rows = self.precision.chunks_exact(sizes.len());
        let square: f64 = rows.zip(sizes).map(|(row, s)| s * dot(row, sizes)).sum();
        self.square - 2.0 * dot(&self.pull, sizes) + square
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::RngStream;
    use rand::Rng;
    use rand_distr::StandardNormal;

    /// A line through correlated noise: the jackknife states the scatter over many draws.
    #[test]
    fn errors_of_correlated_noise_are_stated() {
        let mut rng = RngStream::Validation.generator(3);
        let (mut square, mut stated, draws) = (0.0, 0.0, 200);
        for _ in 0..draws {
            let mut noise = 0.0;
            let states: Vec<[f64; 2]> = (0..2000)
                .map(|_| {
                    noise = 0.8 * noise + 0.6 * rng.sample::<f64, _>(StandardNormal);
                    let x: f64 = rng.random_range(0.5..1.5);
                    [x, 2.0 * x + noise]
                })
                .collect();
            let parts: Vec<Sums> = groups(states.len(), 5)
                .unwrap()
                .into_iter()
                .map(|group| {
                    let (x, y): (Vec<f64>, Vec<f64>) = states[group].iter().map(|[x, y]| (*x, *y)).unzip();
                    Sums::new(&x, &y)
                })
                .collect();
            let sums = Sums::of(&parts);
            let slope = sums.solve(1e3).unwrap()[0];
            square += (slope - 2.0).powi(2);
            stated += jackknife(slope, sums.without(&parts, 1e3).unwrap().iter().map(|sizes| sizes[0]));
        }
        let ratio = (stated / square).sqrt();
        assert!((0.85..1.2).contains(&ratio), "{ratio}");
        assert!(groups(19, 5).is_none() && groups(20, 5).unwrap().len() == 4);
    }
}
