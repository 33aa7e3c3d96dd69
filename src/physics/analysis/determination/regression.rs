//! Regularised least squares over groups of consecutive states, and the scatter of what it gives without each of them.

use crate::linalg::{MatMut, MatRef, Workspace, dot, gemm, inverse, solve};
use std::ops::Range;

/// Groups that states are cut into, each long enough to be independent of the others.
const GROUPS: usize = 20;
/// Fewest groups.
const FEWEST: usize = 4;

/// Groups of at least `least` consecutive states; `None` if they are too few.
pub fn groups(states: usize, least: usize) -> Option<Vec<Range<usize>>> {
    let groups = GROUPS.min(states / least);
    let range = |group: usize| group * states / groups..(group + 1) * states / groups;
    (groups >= FEWEST).then(|| (0..groups).map(range).collect())
}

/// Variance of a number that is `whole` by all groups, from what it is without each of them.
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
    /// Of the rows of `A`, and `e`.
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

    /// Of all states together.
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

    /// The same without each of the parts.
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

    /// The weight of the data by which what the factors leave is of mean square 1, for `rows` rows of `A`.
    pub fn trust(&self, rows: usize) -> f64 {
        rows as f64 / self.square.max(f64::MIN_POSITIVE)
    }

    /// Square of what these factors leave.
    pub fn left(&self, sizes: &[f64]) -> f64 {
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

    /// A line through noise whose neighbours are alike: the jackknife states the scatter over many draws.
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
