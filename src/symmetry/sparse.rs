//! Null vectors with few entries: what an ill-conditioned basis adds as noise is taken out.

use super::orthonormal::{add, norm, orthonormal};

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

#[cfg(test)]
mod tests {
    use super::*;

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
