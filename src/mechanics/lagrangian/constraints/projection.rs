//! The way of a state to its constraints.

use super::rows::{dot, largest, length};
use super::{Manifold, ManifoldRows};
use crate::linalg::{Workspace, minimum_norm};
use crate::scalar::{Real, Scalar};

/// Steps of Newton's method.
const MAX_STEPS: usize = 60;
/// Defects below this many roundings of the state are none.
const ROUNDINGS: f64 = 1024.0;

/// A state from which no way to the constraints was found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OffManifold {
    /// The row that is missed most.
    pub row: usize,
    /// By how much, over the length of its gradient: a distance in units of the coordinates, or of the velocities.
    pub defect: f64,
}

/// Brings a state to the constraints by changes along the rows, which are the least ones, and returns how far the coordinates were
/// away and how far the velocities: `q` to `phi(q) = 0` by Newton's method, then `v` to `A v = b`.
///
/// # Errors
/// [`OffManifold`] where no state was found; `q` and `v` are the nearest then.
pub fn project<S: Scalar>(manifold: &dyn Manifold<S>, q: &mut [S], v: &mut [S]) -> Result<[f64; 2], OffManifold> {
    let mut rows = ManifoldRows::default();
    let m = manifold.names().len();
    let holonomic: Vec<usize> = (0..m).filter(|&row| manifold.is_holonomic(row)).collect();
    let all: Vec<usize> = (0..m).collect();
    let before = [q.to_vec(), v.to_vec()];
    let mut last = S::infinity();
    for step in 0..MAX_STEPS {
        if holonomic.is_empty() {
            break;
        }
        manifold.rows(q, v, &mut rows);
        let change = least_change(q.len(), &rows, &holonomic, &rows.values);
        let size = largest(&change);
        q.iter_mut().zip(&change).for_each(|(q, &change)| *q -= change);
        let rounding = S::epsilon() * largest(q);
        // As good as the numbers are, or no longer better.
        if size <= rounding || (step > 3 && size > last * S::half() && size < rounding.ldexp(10)) {
            break;
        }
        last = size;
    }
    manifold.rows(q, v, &mut rows);
    check(&rows, &holonomic, &rows.values, largest(q))?;
    for _ in 0..2 {
        let change = least_change(q.len(), &rows, &all, &rows.rates);
        v.iter_mut().zip(&change).for_each(|(v, &change)| *v -= change);
        manifold.rows(q, v, &mut rows);
    }
    check(&rows, &all, &rows.rates, Real::max(largest(&before[1]), largest(v)))?;
    let moved = |from: &[S], to: &[S]| {
        let change: Vec<S> = from.iter().zip(to).map(|(&a, &b)| a - b).collect();
        length(&change).to_f64()
    };
    Ok([moved(&before[0], q), moved(&before[1], v)])
}

/// Brings an acceleration at a state on the constraints to `A a = -gamma` by the least change.
pub fn project_acceleration<S: Scalar>(manifold: &dyn Manifold<S>, q: &[S], v: &[S], a: &mut [S]) {
    let mut rows = ManifoldRows::default();
    manifold.rows(q, v, &mut rows);
    let along = rows.matrix.chunks_exact(q.len()).map(|row| dot(row, a));
    let defects: Vec<S> = along.zip(&rows.drift).map(|(along, &drift)| along + drift).collect();
    let all: Vec<usize> = (0..defects.len()).collect();
    let change = least_change(q.len(), &rows, &all, &defects);
    a.iter_mut().zip(&change).for_each(|(a, &change)| *a -= change);
}

/// The shortest `x` with `A x = defects` for some of the rows, as near to it as can be where they depend on each other.
fn least_change<S: Scalar>(n: usize, rows: &ManifoldRows<S>, of: &[usize], defects: &[S]) -> Vec<S> {
    let picked: Vec<S> = of.iter().flat_map(|&row| rows.matrix[row * n..(row + 1) * n].iter().copied()).collect();
    let right: Vec<S> = of.iter().map(|&row| defects[row]).collect();
    along_rows(n, &picked, &right).0
}

/// The shortest `x = A^T w` with `A x = right`, and the shortest `w`, of rows `A`, `(m, n)`; as near to it as can be where the rows depend
/// on each other. A row that vanishes asks for nothing.
pub fn along_rows<S: Scalar>(n: usize, rows: &[S], right: &[S]) -> (Vec<S>, Vec<S>) {
    let (m, zero) = (right.len(), <S as Real>::zero());
    let sizes: Vec<S> = rows.chunks_exact(n).map(length).collect();
    let over = |x: S, size: S| if size == zero { zero } else { x / size };
    let unit: Vec<S> = rows.iter().enumerate().map(|(at, &x)| over(x, sizes[at / n])).collect();
    let gram: Vec<S> = (0..m * m).map(|at| dot(&unit[at / m * n..][..n], &unit[at % m * n..][..n])).collect();
    let right: Vec<S> = right.iter().zip(&sizes).map(|(&x, &size)| over(x, size)).collect();
    let Ok(found) = minimum_norm(m, &gram, &right, &mut Workspace::new()) else {
        return (vec![S::nan(); n], vec![S::nan(); m]);
    };
    let mut x = vec![zero; n];
    for (row, &weight) in unit.chunks_exact(n).zip(&found.solution) {
        x.iter_mut().zip(row).for_each(|(x, &a)| *x += weight * a);
    }
    (x, found.solution.iter().zip(&sizes).map(|(&weight, &size)| over(weight, size)).collect())
}

/// Refuses defects that are more than rounding.
fn check<S: Scalar>(rows: &ManifoldRows<S>, of: &[usize], defects: &[S], size: S) -> Result<(), OffManifold> {
    let n = rows.matrix.len() / rows.values.len().max(1);
    let mut worst: Option<(usize, S)> = None;
    for &row in of {
        let gradient = length(&rows.matrix[row * n..(row + 1) * n]);
        let defect = if gradient > <S as Real>::zero() { defects[row].abs() / gradient } else { defects[row].abs() };
        if worst.is_none_or(|(_, most)| defect.is_nan() || defect > most) {
            worst = Some((row, defect));
        }
    }
    let allowed = S::of_f64(ROUNDINGS) * S::epsilon() * Real::max(size, S::min_positive());
    match worst {
        Some((row, defect)) if defect.is_nan() || defect > allowed => Err(OffManifold { row, defect: defect.to_f64() }),
        _ => Ok(()),
    }
}
