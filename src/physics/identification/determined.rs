//! What the motion determines: the directions of the unknowns without a visible effect, and the standard errors of everything else.
//!
//! Let `S` be the normal matrix of the unknowns in units of the noise, with initial states eliminated, and `D` the size of each unknown. The
//! singular values of the Jacobian times `D` are the roots of the eigenvalues of `D S D`. A direction is *open* if its singular value is below 1,
//! that is if the relative error along it is above 1, or if its effect is rounding.

use super::solve::{Normal, Problem};
use super::thresholds::{
    EIGENVECTOR_ROUNDING, ELIMINATED_ROUNDING, EQUAL_CHANGE, NO_DEPENDENCE, OVER_ROUNDING, SIZE_FROM_ERROR,
};
use crate::linalg::{Workspace, components, dot, eigh};

/// What the normal equations determine.
pub(super) struct Determined {
    /// Size of each unknown, in its own units.
    pub size: Vec<f64>,
    /// Effect of a unit change of each unknown with the others held fixed, in standard deviations.
    pub effect: Vec<f64>,
    /// Covariance, `(m, m)`, with every open direction held fixed.
    pub covariance: Vec<f64>,
    /// Unknowns that have no visible effect.
    pub without_effect: Vec<usize>,
    /// Open directions of the other unknowns: changes in their own units, each of as few unknowns as possible.
    pub open: Vec<OpenDirection>,
    /// The normal matrix in units of the noise, `(m, m)`.
    pub information: Vec<f64>,
    /// Squared effects that are rounding, by unknown.
    rounding: Vec<f64>,
}

/// An open direction, in a basis where each direction has a pivot that the others leave unchanged.
#[derive(Clone, Debug)]
pub(super) struct OpenDirection {
    /// The unknown that only this direction changes.
    pub pivot: usize,
    /// Change of each unknown; the largest is as large as the unknown itself.
    pub change: Vec<f64>,
}

impl Determined {
    /// Analyses undamped normal equations at `x`, for a search that began at `start`; `variance` is that of the residuals. A direction is open if
    /// its relative error exceeds `open`: 1, or [`NO_DEPENDENCE`] for equations that are linear in the unknowns, where a sum with a large error
    /// still counts as determined.
    pub fn new(
        problem: &Problem<'_>,
        (x, start): (&[f64], &[f64]),
        normal: &Normal,
        (variance, open): (f64, f64),
    ) -> Self {
        let m = x.len();
        let variance = variance.max(f64::MIN_POSITIVE);
        let ineffective = problem.without_effect(x, normal);
        let known =
            |(at, x): (usize, &f64)| if ineffective[at / m] || ineffective[at % m] { 0.0 } else { x / variance };
        let information: Vec<f64> = normal.matrix.iter().enumerate().map(known).collect();
        let effect: Vec<f64> =
            (0..m).map(|k| if ineffective[k] { 0.0 } else { information[k * m + k].max(0.0).sqrt() }).collect();
        let size = |k: usize| {
            let [now, before] = [x[k], start[k]].map(|x| problem.scale(k, x));
            let least = match (before > 0.0, effect[k] > 0.0) {
                (false, true) => SIZE_FROM_ERROR / effect[k],
                _ => 0.0,
            };
            let size = now.max(before).max(least);
            if size > 0.0 { size } else { 1.0 }
        };
        let size: Vec<f64> = (0..m).map(size).collect();
        let rounding: Vec<f64> = normal.diagonal.iter().map(|x| ELIMINATED_ROUNDING * x.max(0.0) / variance).collect();
        let resolved = |k: usize| size[k] * open / (1.0 + rounding[k] * (size[k] * open).powi(2)).sqrt();
        let resolved: Vec<f64> = (0..m).map(resolved).collect();
        let (live, without_effect): (Vec<usize>, Vec<usize>) = (0..m).partition(|&k| effect[k] * resolved[k] >= 1.0);
        let count = live.len();
        let scaled: Vec<f64> = (0..count * count)
            .map(|at| (live[at / count], live[at % count]))
            .map(|(i, j)| information[i * m + j] * resolved[i] * resolved[j])
            .collect();
        let (mut values, mut vectors) = (vec![0.0; count], vec![0.0; count * count]);
        // Finite by construction.
        let _ = eigh(count, &scaled, &mut values, &mut vectors, &mut Workspace::new());
        let mut covariance = vec![0.0; m * m];
        let mut directions = Vec::new();
        for (value, vector) in values.iter().zip(vectors.chunks_exact(count.max(1))) {
            let along: Vec<(usize, f64)> = live.iter().zip(vector).map(|(&k, x)| (k, x * resolved[k])).collect();
            if *value >= 1.0 {
                for &(i, a) in &along {
                    along.iter().for_each(|&(j, b)| covariance[i * m + j] += a * b / value);
                }
            } else {
                let mut change = vec![0.0; m];
                along.iter().for_each(|&(k, x)| change[k] = x);
                directions.push(change);
            }
        }
        let columns = echelon(directions, &size);
        let mut found = Self { size, effect, covariance, without_effect, open: columns, information, rounding };
        found.drop_invisible(open.recip());
        found
    }

    /// Sets the changes to 0 along open directions whose own effect, with the other unknowns held fixed, is not visible or is rounding.
    fn drop_invisible(&mut self, least_effect: f64) {
        for column in &mut self.open {
            let effects: Vec<f64> =
                column.change.iter().zip(&self.effect).map(|(x, effect)| (x * effect).abs()).collect();
            let largest = effects.iter().copied().fold(0.0, f64::max);
            let least = f64::max(least_effect, EIGENVECTOR_ROUNDING * largest);
            for (k, x) in column.change.iter_mut().enumerate().filter(|(k, _)| *k != column.pivot) {
                *x = if effects[k] >= least { *x } else { 0.0 };
            }
        }
    }

    /// `true` if an open direction changes the unknown.
    pub fn is_open(&self, k: usize) -> bool {
        self.without_effect.contains(&k) || self.open.iter().any(|column| column.change[k] != 0.0)
    }

    /// Standard errors of the unknowns; `None` for those that are not determined individually.
    pub fn errors(&self) -> Vec<Option<f64>> {
        let m = self.size.len();
        (0..m).map(|k| (!self.is_open(k)).then(|| self.covariance[k * m + k].max(0.0).sqrt())).collect()
    }

    /// Standard error of a function with this gradient that no open direction changes.
    pub fn error_of(&self, gradient: &[f64]) -> f64 {
        quadratic(&self.covariance, gradient).max(0.0).sqrt()
    }

    /// Relative error along a change; `None` if the motion does not depend on it.
    pub fn relative_error(&self, change: &[f64]) -> Option<f64> {
        let rounding: f64 = change.iter().zip(&self.rounding).map(|(x, rounding)| x * x * rounding).sum();
        let size: f64 = change.iter().zip(&self.size).map(|(x, size)| (x / size).powi(2)).sum();
        let effect = quadratic(&self.information, change);
        (effect > OVER_ROUNDING * rounding && effect > size / (NO_DEPENDENCE * NO_DEPENDENCE))
            .then(|| (size / effect).sqrt())
    }

    /// All changes of the unknowns without a visible effect.
    pub fn changes(&self) -> Vec<Vec<f64>> {
        let m = self.size.len();
        let alone = |&k: &usize| (0..m).map(|j| if j == k { self.size[k] } else { 0.0 }).collect();
        self.without_effect.iter().map(alone).chain(self.open.iter().map(|column| column.change.clone())).collect()
    }

    /// Open directions in groups that share unknowns.
    pub fn groups(&self) -> Vec<Vec<usize>> {
        let shares =
            |a: &OpenDirection, b: &OpenDirection| a.change.iter().zip(&b.change).any(|(a, b)| *a != 0.0 && *b != 0.0);
        let count = self.open.len();
        let pairs = (0..count).flat_map(|i| (0..i).map(move |j| (j, i)));
        components(count, pairs.filter(|&(i, j)| shares(&self.open[i], &self.open[j])))
    }
}

/// `x' A x`.
pub(super) fn quadratic(matrix: &[f64], x: &[f64]) -> f64 {
    matrix.chunks_exact(x.len().max(1)).zip(x).map(|(row, own)| own * dot(row, x)).sum()
}

/// Reduced echelon form of directions: each has a pivot, the unknown with the largest relative change, which no other direction changes.
pub(super) fn echelon(mut rows: Vec<Vec<f64>>, size: &[f64]) -> Vec<OpenDirection> {
    let mut pivots: Vec<usize> = Vec::new();
    for at in 0..rows.len() {
        let relative = |&(row, k): &(usize, usize)| {
            let norm: f64 = rows[row].iter().zip(size).map(|(x, size): (&f64, &f64)| (x / size).powi(2)).sum();
            (rows[row][k] / size[k]).abs() / norm.sqrt()
        };
        let free = (0..size.len()).filter(|k| !pivots.contains(k));
        let places: Vec<(usize, usize)> = free.flat_map(|k| (at..rows.len()).map(move |row| (row, k))).collect();
        let largest = places.iter().map(relative).fold(0.0, f64::max);
        // The first of equally large ones, so that rounding does not decide.
        let Some(&(row, pivot)) = places.iter().find(|place| relative(place) >= EQUAL_CHANGE * largest) else { break };
        rows.swap(at, row);
        let value = rows[at][pivot];
        rows[at].iter_mut().for_each(|x| *x /= value);
        let own = rows[at].clone();
        for (_, row) in rows.iter_mut().enumerate().filter(|(k, _)| *k != at) {
            let factor = row[pivot];
            row.iter_mut().zip(&own).for_each(|(x, o)| *x -= factor * o);
            row[pivot] = 0.0;
        }
        pivots.push(pivot);
    }
    let scaled = |(change, pivot): (Vec<f64>, usize)| {
        let largest = change.iter().zip(size).map(|(x, size)| (x / size).abs()).fold(0.0, f64::max);
        OpenDirection { pivot, change: change.into_iter().map(|x| x / largest).collect() }
    };
    rows.into_iter().zip(pivots).map(scaled).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn directions_change_few_unknowns_each() {
        let rows = vec![vec![1.0, 1.0, 1.0, 1.0], vec![1.0, 1.0, -1.0, -1.0]];
        let found = echelon(rows, &[1.0; 4]);
        let close = |a: &[f64], b: &[f64]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-12);
        assert!(close(&found[0].change, &[1.0, 1.0, 0.0, 0.0]), "{found:?}");
        assert!(close(&found[1].change, &[0.0, 0.0, 1.0, 1.0]), "{found:?}");
    }
}
