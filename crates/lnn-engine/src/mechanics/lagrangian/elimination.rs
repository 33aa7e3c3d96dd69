//! Sparse elimination of a symmetric matrix without pivoting, for any type of number.

use crate::scalar::Real;
use alloc::collections::BTreeMap;
use alloc::vec::Vec;

/// Rows of a sparse matrix: the nonzero elements by increasing column.
pub(super) type Lists<R> = Vec<Vec<(usize, R)>>;

/// The linear system of the equations of motion, `[M A^T; A 0] [a; -lambda] = [f; -gamma]`, or `M a = f` without constraints.
pub(super) struct Balance<R> {
    /// Number of coordinates; their equations come first, followed by those of the constraints.
    pub coordinates: usize,
    /// The lower triangle, including the diagonal.
    pub lower: Lists<R>,
    /// The right-hand side.
    pub right: Vec<R>,
}

/// The factors of a symmetric matrix after sparse elimination.
pub(super) struct Eliminated<R> {
    coordinates: usize,
    /// Eliminated rows in order, each with the rows from which it was subtracted and the factors.
    steps: Vec<(usize, Vec<(usize, R)>)>,
    /// Pivots by row.
    pivots: Vec<R>,
    /// The diagonal elements before elimination, by row.
    diagonal: Vec<R>,
}

/// Solves with at most `most` products; returns the solution, and pairs of an original diagonal element and its pivot.
pub(super) fn eliminate<R: Real>(balance: Balance<R>, most: usize) -> Option<(Vec<R>, Vec<[R; 2]>)> {
    let eliminated = Eliminated::of(balance.coordinates, balance.lower, most)?;
    Some((eliminated.solve(balance.right), eliminated.guards()))
}

impl<R: Real> Eliminated<R> {
    /// Factors the matrix with this lower triangle with at most `most` products.
    ///
    /// Coordinates are eliminated before constraints, and within each kind the row with the least fill-in comes first. For a positive
    /// definite `M` and independent rows `A`, the pivots of the coordinates are positive and those of the constraints are negative, because
    /// they belong to `-A M^-1 A^T`, whose diagonal elements count as the original ones.
    pub fn of(coordinates: usize, lower: Lists<R>, most: usize) -> Option<Self> {
        let count = lower.len();
        let own = |(i, row): (usize, &Vec<(usize, R)>)| row.last().filter(|(j, _)| *j == i).map(|(_, m)| *m);
        let mut diagonal: Vec<R> = lower.iter().enumerate().map(own).collect::<Option<_>>()?;
        let mut pivots = diagonal.clone();
        let mut rest: Vec<BTreeMap<usize, R>> = vec![BTreeMap::new(); count];
        for (i, row) in lower.into_iter().enumerate() {
            for (j, m) in row.into_iter().filter(|(j, _)| *j != i) {
                rest[i].insert(j, m);
                rest[j].insert(i, m);
            }
        }
        let (mut steps, mut products) = (Vec::with_capacity(count), 0);
        let mut left: Vec<usize> = (0..count).collect();
        while !left.is_empty() {
            if left.len() == count - coordinates {
                diagonal[coordinates..].copy_from_slice(&pivots[coordinates..]);
            }
            // Choose the row with the least fill-in.
            let at = (0..left.len()).min_by_key(|&at| (left[at] >= coordinates, rest[left[at]].len()))?;
            let k = left.remove(at);
            let row = core::mem::take(&mut rest[k]);
            products += row.len() * (row.len() + 3) / 2;
            if products > most {
                return None;
            }
            let factors: Vec<(usize, R)> = row.iter().map(|(&i, &m)| (i, m / pivots[k])).collect();
            for &(i, factor) in &factors {
                rest[i].remove(&k);
                pivots[i] -= factor * row[&i];
                for (&j, &m) in row.range(..i) {
                    let term = factor * m;
                    let element = rest[i].get(&j).map_or(-term, |&element| element - term);
                    rest[i].insert(j, element);
                    rest[j].insert(i, element);
                }
            }
            steps.push((k, factors));
        }
        Some(Self { coordinates, steps, pivots, diagonal })
    }

    /// Returns the solution for this right-hand side.
    pub fn solve(&self, right: Vec<R>) -> Vec<R> {
        let mut solution = right;
        for (k, factors) in &self.steps {
            let known = solution[*k];
            factors.iter().for_each(|&(i, factor)| solution[i] -= factor * known);
        }
        for (k, factors) in self.steps.iter().rev() {
            solution[*k] =
                factors.iter().fold(solution[*k] / self.pivots[*k], |x, &(i, factor)| x - factor * solution[i]);
        }
        solution
    }

    /// Computes the inverse, starting from the row eliminated last: each row follows from the later ones, and symmetry gives half of the
    /// elements.
    pub fn inverse(&self) -> Vec<Vec<R>> {
        let count = self.pivots.len();
        let mut inverse = vec![vec![R::zero(); count]; count];
        let mut known: Vec<usize> = Vec::with_capacity(count);
        for (k, factors) in self.steps.iter().rev() {
            let k = *k;
            for &j in &known {
                let x = factors.iter().fold(R::zero(), |x, &(i, factor)| x - factor * inverse[i][j]);
                (inverse[k][j], inverse[j][k]) = (x, x);
            }
            inverse[k][k] = factors.iter().fold(self.pivots[k].recip(), |x, &(i, factor)| x - factor * inverse[i][k]);
            known.push(k);
        }
        inverse
    }

    /// Returns pairs of an original diagonal element and its pivot; those of constraints have reversed signs.
    pub fn guards(&self) -> Vec<[R; 2]> {
        let signed = |(k, pair): (usize, [R; 2])| if k < self.coordinates { pair } else { pair.map(|x| -x) };
        self.diagonal
            .iter()
            .zip(&self.pivots)
            .map(|(&element, &pivot)| [element, pivot])
            .enumerate()
            .map(signed)
            .collect()
    }
}
