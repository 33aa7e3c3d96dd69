//! Elimination along the pattern of a symmetric matrix, without a search for pivots, on numbers of any kind.

use crate::scalar::Real;
use alloc::collections::BTreeMap;
use alloc::vec::Vec;

/// Rows of a matrix: the nonzero elements by increasing column.
pub(super) type Lists<R> = Vec<Vec<(usize, R)>>;

/// A linear system of equations of motion, `[M A^T; A 0] [a; -lambda] = [f; -gamma]`, without constraints `M a = f`.
pub(super) struct Balance<R> {
    /// Number of coordinates; the equations after them are those of constraints.
    pub coordinates: usize,
    /// The lower triangle, the diagonal with it.
    pub lower: Lists<R>,
    /// The right-hand side.
    pub right: Vec<R>,
}

/// A symmetric matrix after its elimination along its pattern.
pub(super) struct Eliminated<R> {
    coordinates: usize,
    /// Rows in the order of their elimination, each with the rows from which it was subtracted, and the factors.
    steps: Vec<(usize, Vec<(usize, R)>)>,
    /// By row.
    pivots: Vec<R>,
    /// The value of every pivot before reduction.
    diagonal: Vec<R>,
}

/// Solves in at most `most` products: the solution, and every pivot after its original diagonal element.
pub(super) fn eliminate<R: Real>(balance: Balance<R>, most: usize) -> Option<(Vec<R>, Vec<[R; 2]>)> {
    let eliminated = Eliminated::of(balance.coordinates, balance.lower, most)?;
    Some((eliminated.solve(balance.right), eliminated.guards()))
}

impl<R: Real> Eliminated<R> {
    /// Eliminates the matrix with this lower triangle in at most `most` products.
    ///
    /// The coordinates come first; among them, and among the constraints, the one with the least fill-in. For a positive definite `M` and
    /// independent rows `A`, the pivots of the coordinates are positive and those of the constraints, of `-A M^-1 A^T`, are negative; the
    /// original elements are those of this matrix.
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
            // The row that fills in the least.
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

    /// The solution of the system with this right-hand side.
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

    /// The inverse, starting from the row eliminated last: each row follows from the later ones, and symmetry gives half of them.
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

    /// Every pivot after its original diagonal element; for constraints with reversed sign.
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
