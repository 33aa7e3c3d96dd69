//! Null vectors with few entries: what an ill-conditioned basis adds as noise is taken out.

use super::orthonormal::{add, dot, norm, orthonormal};
use crate::linalg::{MatMut, MatRef, Workspace, gemm, solve};

/// Entries below this part of the largest are tried without.
const SMALL: f64 = 1e-4;
/// Residual of the null vector of few entries, in units of the one it replaces and of `1/SMALL` roundings.
const WORSE: f64 = 10.0;

/// Replaces a null vector of columns by one without its small entries, if that is one too.
///
/// `vector` has one entry for each of `columns`; `sizes` are those of the functions that they belong to. The largest entry keeps
/// its value, the other large ones follow by least squares. The new vector is taken if the residual, over that of all entries one by
/// one, is below ten times `noise` or below 1e-9.
pub(crate) fn polish(vector: &mut [f64], columns: &[Vec<f64>], sizes: &[f64], noise: f64) {
    let weighed: Vec<f64> = vector.iter().zip(sizes).map(|(x, s)| (x * s).abs()).collect();
    let largest = weighed.iter().fold(0.0, |m: f64, x| m.max(*x));
    let mut support: Vec<usize> = (0..vector.len()).filter(|k| weighed[*k] > SMALL * largest).collect();
    let Some(pivot) = support.iter().copied().max_by(|a, b| weighed[*a].total_cmp(&weighed[*b])) else { return };
    support.retain(|k| *k != pivot);
    let scaled: Vec<Vec<f64>> = support.iter().map(|k| columns[*k].clone()).collect();
    let target: Vec<f64> = columns[pivot].iter().map(|x| -vector[pivot] * x).collect();
    let plain = orthonormal(&scaled, 1e-10);
    let solution = plain.given(&plain.along(&target), support.len());
    let mut rest = target.clone();
    let mut whole = norm(&target).powi(2);
    for (x, column) in solution.iter().zip(&scaled) {
        add(&mut rest, column, -x);
        whole += (x * norm(column)).powi(2);
    }
    let whole = whole.sqrt();
    if whole > 0.0 && norm(&rest) > (WORSE * noise).max(1e-9) * whole {
        return;
    }
    let kept = vector[pivot];
    vector.fill(0.0);
    vector[pivot] = kept;
    let last = solution.iter().zip(&scaled).fold(0.0, |m: f64, (x, column)| m.max((x * norm(column)).abs()));
    for ((place, x), column) in support.into_iter().zip(solution).zip(&scaled) {
        vector[place] = if (x * norm(column)).abs() > 1e-10 * last { x } else { 0.0 };
    }
}

/// `A^T A` of a matrix `A` that is given by its columns, row-major.
pub(crate) fn gram(columns: &[Vec<f64>]) -> Vec<f64> {
    let (count, rows) = (columns.len(), columns.first().map_or(0, Vec::len));
    let all = columns.concat();
    let mut product = vec![0.0; count * count];
    let a = MatRef::new(&all, count, rows);
    gemm(MatMut::new(&mut product, count, count), false, 1.0, a, a.t());
    product
}

/// Steps of [`sparsest`].
const STEPS: usize = 12;
/// Part of the largest entry that counts as zero in the end.
const NOTHING: f64 = 2e-3;
/// Price of an entry, in units of the squared noise.
const PRICE: f64 = 0.3;
/// Growth of the residual that few entries are worth.
const WORTH: f64 = 2.0;

/// The vector of fewest entries near `start` that solves `A x = 0` to about `noise`, where `gram` is `A^T A`; `None` if it is
/// solved less well than twice as badly.
///
/// `x^T A^T A x` is minimised beside a price for entries `sum of (s x)^2/((s x)^2 + d^2)`, reweighted with `d` falling, `s` being the
/// `sizes` of the entries; the entry `pivot` is kept, the `taken` ones stay 0 (reweighted least squares, Chartrand and Yin 2008).
pub(crate) fn sparsest(
    gram: &[f64],
    start: &[f64],
    sizes: &[f64],
    pivot: usize,
    taken: &[bool],
    noise: f64,
) -> Option<Vec<f64>> {
    let count = start.len();
    let residual = |x: &[f64]| -> f64 {
        let rows = x.iter().enumerate().filter(|(_, x)| **x != 0.0);
        rows.map(|(i, xi)| xi * dot(&gram[i * count..(i + 1) * count], x)).sum::<f64>().max(0.0)
    };
    let mut x = start.to_vec();
    // A field of unit size changes L by the noise.
    let size = x.iter().zip(sizes).fold(0.0, |m: f64, (x, s)| m.max((x * s).abs()));
    let price = PRICE * residual(start).max((noise * size).powi(2) * 1e-2).max(f64::MIN_POSITIVE);
    let mut active: Vec<usize> = (0..count).filter(|k| *k != pivot && !taken[*k]).collect();
    let mut workspace = Workspace::new();
    for step in 0..STEPS {
        let near = size * 0.5_f64.powi(step as i32);
        let m = active.len();
        if m == 0 {
            break;
        }
        let mut matrix = vec![0.0; m * m];
        for (a, i) in active.iter().enumerate() {
            active.iter().enumerate().for_each(|(b, j)| matrix[a * m + b] = gram[i * count + j]);
            matrix[a * m + a] += price * sizes[*i].powi(2) / ((x[*i] * sizes[*i]).powi(2) + near * near);
        }
        let side: Vec<f64> = active.iter().map(|i| -gram[i * count + pivot] * x[pivot]).collect();
        let mut next = vec![0.0; m];
        solve(m, &matrix, &side, &mut next, &mut workspace).ok()?;
        let kept = x[pivot];
        x.fill(0.0);
        x[pivot] = kept;
        active.iter().zip(next).for_each(|(i, value)| x[*i] = value);
        let floor = (NOTHING * size).min(0.1 * near);
        active.retain(|i| (x[*i] * sizes[*i]).abs() > floor);
    }
    for (x, s) in x.iter_mut().zip(sizes) {
        if (*x * s).abs() <= NOTHING * size {
            *x = 0.0;
        }
    }
    let before = residual(start).max((noise * size).powi(2) * 1e-2);
    (residual(&x) <= WORTH * WORTH * before).then_some(x)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn few_entries_are_preferred() {
        // a = b + c nearly, and a = d nearly: of a mixture that is mostly the latter, one entry is enough.
        let columns = vec![
            vec![1.0, 1.0, 0.0, 0.0],
            vec![1.0, 0.0, 0.001, 0.0],
            vec![0.0, 1.0, 0.001, 0.0],
            vec![1.0, 1.0, 0.0, 0.001],
        ];
        let start = [1.0, -0.1, -0.1, -0.9];
        let found = sparsest(&gram(&columns), &start, &[1.0; 4], 0, &[false; 4], 1e-3).unwrap();
        assert!((found[3] + 1.0).abs() < 0.01 && found[1..3] == [0.0; 2], "{found:?}");
        assert_eq!(found[0], 1.0);
    }

    #[test]
    fn noise_is_taken_out() {
        // 2 a - b = 0; c is no part of it.
        let columns = vec![vec![1.0, 2.0, 0.5], vec![2.0, 4.0, 1.0], vec![0.0, 1.0, 3.0]];
        let mut vector = vec![2.0 + 1e-6, -1.0, 1e-6];
        polish(&mut vector, &columns, &[1.0; 3], 1e-6);
        assert!((vector[0] / vector[1] + 2.0).abs() < 1e-14 && vector[2] == 0.0, "{vector:?}");
        // An entry that is needed stays, small as it is.
        let columns = vec![vec![1.0, 0.0, 0.0], vec![1.0, 0.0, 1e-5], vec![0.0, 0.0, 1.0]];
        let mut vector = vec![1.0, -1.0, 1e-5];
        polish(&mut vector, &columns, &[1.0; 3], 1e-12);
        assert_eq!(vector, [1.0, -1.0, 1e-5]);
    }
}
