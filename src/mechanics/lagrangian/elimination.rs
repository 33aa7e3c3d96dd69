//! Elimination along the pattern of a symmetric matrix, without a search for pivots, on numbers of any kind.

use crate::scalar::Real;
use alloc::collections::BTreeMap;
use alloc::vec::Vec;

/// Rows of a matrix: the columns of what is not zero, rising.
pub(super) type Lists<R> = Vec<Vec<(usize, R)>>;

/// A linear system of equations of motion, `[M A^T; A 0] [a; -lambda] = [f; -gamma]`, without constraints `M a = f`.
pub(super) struct Balance<R> {
    /// Number of coordinates; the equations behind them are those of constraints.
    pub coordinates: usize,
    /// The lower triangle, the diagonal with it.
    pub lower: Lists<R>,
    /// The right-hand side.
    pub right: Vec<R>,
}

/// Solves in at most so many products: the solution, and every pivot behind what it was before it was reduced.
///
/// The coordinates come first, and of them as of the constraints the one that fills in the least. Of a positive definite `M` and
/// independent rows `A` the pivots of the former are positive, those of the latter, of `-A M^-1 A^T`, negative; the elements of this
/// matrix are what they were. They are handed over with their signs turned.
pub(super) fn eliminate<R: Real>(balance: Balance<R>, most: usize) -> Option<(Vec<R>, Vec<[R; 2]>)> {
    let Balance { coordinates, lower, mut right } = balance;
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
        let known = right[k];
        for &(i, factor) in &factors {
            rest[i].remove(&k);
            right[i] -= factor * known;
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
    let mut solution = right;
    for (k, factors) in steps.into_iter().rev() {
        solution[k] = factors.iter().fold(solution[k] / pivots[k], |x, &(i, factor)| x - factor * solution[i]);
    }
    let signed = |(k, pair): (usize, [R; 2])| if k < coordinates { pair } else { pair.map(|x| -x) };
    let guards = diagonal.into_iter().zip(pivots).map(|(element, pivot)| [element, pivot]);
    Some((solution, guards.enumerate().map(signed).collect()))
}
