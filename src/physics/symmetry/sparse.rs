//! Null vectors with few entries: what an ill-conditioned basis adds as noise is taken out.

use super::orthonormal::{add, dot, norm, orthonormal};
use crate::linalg::{MatMut, MatRef, Workspace, gemm, solve};

/// Parts of the largest entry below which entries are tried without, one after the other.
const SMALL: [f64; 4] = [1e-4, 1e-5, 1e-6, 1e-7];
/// Residual of the null vector of few entries, in units of the one it replaces and of `1/SMALL` roundings.
const WORSE: f64 = 10.0;

/// Replaces a null vector of columns by one without its small entries, if that is one too.
///
/// `column` gives the column of an entry of `vector`; `sizes` are those of the functions that they belong to. The largest entry keeps
/// its value, the other large ones follow by least squares. The new vector is taken if the residual, over that of all entries one by
/// one, is below ten times `noise` or below 1e-9: whatever it leaves out was noise. Once more, as long as that leaves out more: what was
/// large before a fit may be small after it.
pub(crate) fn polish(vector: &mut [f64], column: &dyn Fn(usize) -> Vec<f64>, sizes: &[f64], noise: f64) {
    let entries = |vector: &[f64]| vector.iter().filter(|x| **x != 0.0).count();
    loop {
        let before = entries(vector);
        polish_once(vector, column, sizes, noise);
        if entries(vector) == before {
            return;
        }
    }
}

fn polish_once(vector: &mut [f64], column: &dyn Fn(usize) -> Vec<f64>, sizes: &[f64], noise: f64) {
    let weighed: Vec<f64> = vector.iter().zip(sizes).map(|(x, s)| (x * s).abs()).collect();
    let largest = weighed.iter().fold(0.0, |m: f64, x| m.max(*x));
    let mut before = 0;
    for small in SMALL {
        let mut support: Vec<usize> = (0..vector.len()).filter(|k| weighed[*k] > small * largest).collect();
        let Some(pivot) = support.iter().copied().max_by(|a, b| weighed[*a].total_cmp(&weighed[*b])) else { return };
        support.retain(|k| *k != pivot);
        // The same entries would be refused again.
        if small < SMALL[0] && support.len() == before {
            continue;
        }
        before = support.len();
        if let Some(solution) = fitted(vector[pivot], &column(pivot), &support, column, noise) {
            let kept = vector[pivot];
            vector.fill(0.0);
            vector[pivot] = kept;
            support.into_iter().zip(solution).for_each(|(place, x)| vector[place] = x);
            return;
        }
    }
}

/// Entries of `support` that take `value` times the pivot's column to zero, if they do.
fn fitted(
    value: f64,
    pivot: &[f64],
    support: &[usize],
    column: &dyn Fn(usize) -> Vec<f64>,
    noise: f64,
) -> Option<Vec<f64>> {
    let columns: Vec<Vec<f64>> = support.iter().map(|k| column(*k)).collect();
    let target: Vec<f64> = pivot.iter().map(|x| -value * x).collect();
    let plain = orthonormal(&columns, 1e-10);
    let mut solution = plain.given(&plain.along(&target), support.len());
    let mut rest = target.clone();
    let mut whole = norm(&target).powi(2);
    for (x, column) in solution.iter().zip(&columns) {
        add(&mut rest, column, -x);
        whole += (x * norm(column)).powi(2);
    }
    let whole = whole.sqrt();
    if whole > 0.0 && norm(&rest) > (WORSE * noise).max(1e-9) * whole {
        return None;
    }
    let parts: Vec<f64> = solution.iter().zip(&columns).map(|(x, column)| (x * norm(column)).abs()).collect();
    let last = parts.iter().fold(0.0, |m: f64, part| m.max(*part));
    for (x, part) in solution.iter_mut().zip(&parts) {
        if *part <= 1e-10 * last {
            *x = 0.0;
        }
    }
    Some(solution)
}

/// What a column explains below so many standard errors is chance.
const CERTAIN: f64 = 3.0;

/// Coefficients of the least-squares fit of columns to a target, 0 for those that the fit does not know: columns that explain no more beside
/// those before them than chance does are left out and the others fitted again, as long as the rest grows no more than by chance.
pub(crate) fn significant(columns: &[Vec<f64>], target: &[f64], dependent: f64) -> Vec<f64> {
    let mut support: Vec<usize> = (0..columns.len()).collect();
    let mut found: Option<(Vec<f64>, f64)> = None;
    loop {
        let own: Vec<Vec<f64>> = support.iter().map(|k| columns[*k].clone()).collect();
        let plain = orthonormal(&own, dependent);
        let mut rest = target.to_vec();
        let along = plain.along(target);
        plain.remove(&mut rest);
        let free = target.len().saturating_sub(plain.columns.len()).max(1) as f64;
        let square = dot(&rest, &rest) / free;
        // What was left out explained no more than as many columns of noise do.
        let left_out = (columns.len() - support.len()) as f64;
        if let Some((before, least)) = &found
            && square > least * (1.0 + CERTAIN * (2.0 * left_out).sqrt() / free)
        {
            return before.clone();
        }
        let solution = plain.given(&along, support.len());
        let mut all = vec![0.0; columns.len()];
        support.iter().zip(&solution).for_each(|(k, x)| all[*k] = *x);
        let least = found.map_or(square, |(_, least)| least);
        found = Some((all.clone(), least));
        let known = plain.kept.iter().zip(&along).filter(|(_, along)| along.abs() > CERTAIN * square.sqrt());
        let kept: Vec<usize> = known.map(|(k, _)| support[*k]).collect();
        if kept.len() == support.len() {
            return all;
        }
        support = kept;
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
    fn coefficients_that_a_fit_does_not_know_are_zero() {
        // 3 a and noise that neither b, which is nearly a, nor c explains.
        let wave = |rate: f64| (0..200).map(|k| (rate * f64::from(k)).sin()).collect::<Vec<f64>>();
        let (a, c, noise) = (wave(0.1), wave(0.37), wave(2.3));
        let b: Vec<f64> = a.iter().zip(wave(1.7)).map(|(a, x)| a + 1e-3 * x).collect();
        let target: Vec<f64> = a.iter().zip(&noise).map(|(a, x)| 3.0 * a + 0.1 * x).collect();
        let found = significant(&[a.clone(), b, c.clone()], &target, 1e-9);
        assert!((found[0] - 3.0).abs() < 0.05 && found[1..] == [0.0; 2], "{found:?}");
        // Of two that explain it together neither is left out.
        let both: Vec<f64> = a.iter().zip(&c).map(|(a, c)| a - 0.5 * c).collect();
        let found = significant(&[a, c], &both, 1e-9);
        assert!((found[0] - 1.0).abs() < 1e-12 && (found[1] + 0.5).abs() < 1e-12, "{found:?}");
    }

    #[test]
    fn noise_is_taken_out() {
        // 2 a - b = 0; c is no part of it.
        let columns = [vec![1.0, 2.0, 0.5], vec![2.0, 4.0, 1.0], vec![0.0, 1.0, 3.0]];
        let mut vector = vec![2.0 + 1e-6, -1.0, 1e-6];
        polish(&mut vector, &|k| columns[k].clone(), &[1.0; 3], 1e-6);
        assert!((vector[0] / vector[1] + 2.0).abs() < 1e-14 && vector[2] == 0.0, "{vector:?}");
        // An entry that is needed stays, small as it is.
        let columns = [vec![1.0, 0.0, 0.0], vec![1.0, 0.0, 1e-5], vec![0.0, 0.0, 1.0]];
        let mut vector = vec![1.0, -1.0, 1e-5];
        polish(&mut vector, &|k| columns[k].clone(), &[1.0; 3], 1e-12);
        assert_eq!(vector, [1.0, -1.0, 1e-5]);
    }
}
