//! Null vectors of a matrix: how many singular values count as zero, and the simplest vectors that span the space.

use super::thresholds::{
    EXACT_STATES, GAUGE_SIGNIFICANCE, INDEPENDENT_NULL_COLUMN, LEAST_ABOVE_NOISE, LEAST_EXACT_GAP, LEAST_MODEL_GAP,
    LEAST_MODEL_NOISE, LEAST_PIVOT, MODEL_STATES, MOST_ZERO_VALUE, NEGLIGIBLE_ENTRIES, REFINED_RESIDUAL,
    REFINED_ROUNDING, ROUNDING_ENTRY, SPARSE_LEAST_RESIDUAL, SPARSE_PENALTY, SPARSE_RESIDUAL, SPARSE_STEPS,
    SPARSE_WIDTH, SPARSE_ZERO, STATES_PER_UNKNOWN, TOLERANCES,
};
use super::{Basis, Chart, Degrees, Symmetries, SymmetryError};
use crate::lagrangian::EulerLagrange;
use crate::linalg::{MatMut, MatRef, Workspace, gemm, solve};
use serde::Serialize;

/// Singular values divided into those that count as zero and the others.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Separation {
    /// Number of values that count as zero; `None` if there is no gap.
    pub count: Option<usize>,
    /// Ratio of the first value that does not count as zero to the last that does, or to the tolerance if none does; `None` if
    /// all values are zero.
    pub gap: Option<f64>,
}

/// Refuses a tolerance outside [`TOLERANCES`].
///
/// # Errors
/// [`SymmetryError::Tolerance`].
pub(crate) fn check(tolerance: Option<f64>) -> Result<(), SymmetryError> {
    let [least, most] = TOLERANCES;
    match tolerance {
        Some(found) if !(least..=most).contains(&found) => Err(SymmetryError::Tolerance { found, least, most }),
        _ => Ok(()),
    }
}

impl Separation {
    /// Cuts ascending values at a tolerance, the noise of exact terms, or, without one, at the largest gap.
    ///
    /// With a tolerance the first value above it must exceed the last below it 30 times, and the tolerance itself three times. Without one,
    /// values above 0.1 are not zero, and the cut is where the ratio of neighbours is largest. It must be at least 10, with values below
    /// 1e-3 taken as 1e-3. Otherwise there is no gap and no count.
    pub(crate) fn new(values: &[f64], tolerance: Option<f64>) -> Self {
        // No value is smaller than the rounding of a number near 1.
        let floor = f64::EPSILON;
        let ratio = |k: usize, below: f64| values.get(k).map(|above| above / below.max(floor));
        match tolerance {
            Some(tolerance) => {
                let count = values.iter().take_while(|value| **value <= tolerance).count();
                let gap = ratio(count, if count == 0 { tolerance } else { values[count - 1] });
                let least = if count == 0 { LEAST_ABOVE_NOISE } else { LEAST_EXACT_GAP };
                let clear = gap.is_none_or(|gap| gap >= least)
                    && ratio(count, tolerance).is_none_or(|r| r >= LEAST_ABOVE_NOISE);
                Self { count: clear.then_some(count), gap }
            }
            None => {
                let small = values.iter().take_while(|value| **value < MOST_ZERO_VALUE).count();
                let cuts = (1..=small).filter_map(|k| Some((k, ratio(k, values[k - 1].max(LEAST_MODEL_NOISE))?)));
                match cuts.max_by(|a, b| a.1.total_cmp(&b.1)) {
                    None => Self { count: Some(small), gap: ratio(0, MOST_ZERO_VALUE) },
                    Some((k, apart)) => {
                        Self { count: (apart >= LEAST_MODEL_GAP).then_some(k), gap: ratio(k, values[k - 1]) }
                    }
                }
            }
        }
    }
}

/// The bases in which symmetries are sought: with these degrees, or the usual ones; for a model, whose errors hide symmetries among many
/// functions, also bases of lower powers.
pub fn bases(names: &[String], charts: &[Chart], degrees: Option<Degrees>, exact: bool) -> Vec<(Basis, Degrees)> {
    if let Some(degrees) = degrees {
        return vec![(Basis::new(names, charts, degrees), degrees)];
    }
    let (basis, highest) = Basis::usual(names, charts);
    let mut all = vec![(basis, highest)];
    if !exact {
        for polynomial in (0..highest.polynomial).rev() {
            let degrees = Degrees { polynomial, ..highest };
            let lower = Basis::new(names, charts, degrees);
            if lower.len() > 1 && all.last().is_some_and(|(last, _)| lower.len() < last.len()) {
                all.push((lower, degrees));
            }
        }
    }
    all
}

/// Number of states for this many unknown coefficients, for a Lagrangian that is written down or for a model.
pub fn enough(unknowns: usize, exact: bool) -> usize {
    (STATES_PER_UNKNOWN * unknowns).max(if exact { EXACT_STATES } else { MODEL_STATES })
}

/// Point symmetries in the basis that shows the most of them, or, if several do, in the one with the widest gap; `tolerance` as in
/// [`Symmetries::find`], [`Symmetries::EXACT`] for exact terms if there is none.
///
/// # Errors
/// [`SymmetryError`].
pub fn most_symmetries(
    model: &dyn EulerLagrange<f64>,
    bases: Vec<(Basis, Degrees)>,
    (q, v): (&[f64], &[f64]),
    (tolerance, exact): (Option<f64>, bool),
) -> Result<(Symmetries, Degrees), SymmetryError> {
    let tolerance = tolerance.or(exact.then_some(Symmetries::EXACT));
    let mut best: Option<(Symmetries, Degrees)> = None;
    for (basis, degrees) in bases {
        let found = Symmetries::find(model, &basis, (q, v), tolerance)?;
        let rank = |found: &Symmetries| (found.separation.count, found.separation.gap.unwrap_or(f64::INFINITY));
        if best.as_ref().is_none_or(|(best, _)| rank(&found) > rank(best)) {
            best = Some((found, degrees));
        }
    }
    best.ok_or(SymmetryError::Basis { expected: model.coordinates(), found: 0 })
}

/// Brings `rows` into reduced echelon form, in place: every row has a pivot 1, where the others have 0.
///
/// Columns are weighted by `sizes`, those of the functions whose coefficients they are; early columns are preferred as pivots, as long as
/// their entry is not much smaller than the largest remaining one. Entries below `noise` of the largest weighted entry of their row become
/// 0. Rows are ordered by their pivots. The first `fixed` rows take part before the others. Entries beyond the weighted columns are carried
/// along.
///
/// Returns the pivot of every row.
pub(crate) fn reduce(rows: &mut [Vec<f64>], sizes: &[f64], noise: f64, fixed: usize) -> Vec<usize> {
    let mut pivots: Vec<usize> = Vec::new();
    for done in 0..rows.len() {
        let candidates = done..if done < fixed { fixed } else { rows.len() };
        for row in &mut rows[candidates.clone()] {
            let largest = row.iter().zip(sizes).fold(0.0, |m: f64, (x, s)| m.max((x * s).abs()));
            if largest > 0.0 {
                row.iter_mut().for_each(|x| *x /= largest);
            }
        }
        let best = |column: usize| {
            let entries = candidates.clone().map(|k| (k, (rows[k][column] * sizes[column]).abs()));
            entries.max_by(|a, b| a.1.total_cmp(&b.1)).unwrap_or((done, 0.0))
        };
        let Some(column) = (0..sizes.len()).find(|&column| best(column).1 > LEAST_PIVOT) else { break };
        let row = best(column).0;
        rows.swap(done, row);
        let pivot = rows[done].clone();
        for (k, row) in rows.iter_mut().enumerate() {
            if k == done {
                let unit = pivot[column];
                row.iter_mut().for_each(|x| *x /= unit);
            } else {
                let share = row[column] / pivot[column];
                row.iter_mut().zip(&pivot).for_each(|(x, p)| *x -= share * p);
                row[column] = 0.0;
            }
        }
        pivots.push(column);
    }
    for (row, &pivot) in rows.iter_mut().zip(&pivots) {
        let largest = row.iter().zip(sizes).fold(0.0, |m: f64, (x, s)| m.max((x * s).abs()));
        for (x, size) in row.iter_mut().zip(sizes) {
            if (*x * size).abs() < noise * largest {
                *x = 0.0;
            }
        }
        let unit = row[pivot];
        if unit != 0.0 {
            row.iter_mut().for_each(|x| *x /= unit);
        }
    }
    let fixed = fixed.min(rows.len());
    let order = |row: &Vec<f64>| row.iter().position(|x| *x != 0.0);
    rows[..fixed].sort_by_key(order);
    rows[fixed..].sort_by_key(order);
    let pivot = |k: usize| {
        let lone = |column: &usize| rows.iter().enumerate().all(|(l, row)| row[*column] == f64::from(u8::from(k == l)));
        (0..sizes.len()).find(lone)
    };
    (0..rows.len()).filter_map(pivot).collect()
}

/// Orthonormal columns, and their coefficients over the columns that were kept.
#[derive(Clone, Debug)]
pub(crate) struct Orthonormal {
    /// The columns, each of length 1.
    pub columns: Vec<Vec<f64>>,
    /// Indices of the given columns that were kept.
    pub kept: Vec<usize>,
    /// Orthonormal column `k` is the sum of `mix[k][j]` times the kept column `j`, `j <= k`.
    pub mix: Vec<Vec<f64>>,
}

/// Gram-Schmidt, twice for every column. A column counts as dependent if less than `least` of its length is left.
pub(crate) fn orthonormal(given: &[Vec<f64>], least: f64) -> Orthonormal {
    let mut result = Orthonormal { columns: Vec::new(), kept: Vec::new(), mix: Vec::new() };
    for (place, column) in given.iter().enumerate() {
        let length = norm(column);
        let (mut rest, mut shares) = (column.clone(), vec![0.0; result.columns.len()]);
        for _ in 0..2 {
            for (share, known) in shares.iter_mut().zip(&result.columns) {
                let along = dot(known, &rest);
                *share += along;
                add(&mut rest, known, -along);
            }
        }
        let left = norm(&rest);
        // A column of zeros adds nothing.
        if left <= least * length {
            continue;
        }
        let mut mix = vec![0.0; result.columns.len() + 1];
        for (share, known) in shares.iter().zip(&result.mix) {
            mix.iter_mut().zip(known).for_each(|(sum, x)| *sum -= share * x);
        }
        mix[result.columns.len()] = 1.0;
        mix.iter_mut().for_each(|x| *x /= left);
        rest.iter_mut().for_each(|x| *x /= left);
        result.columns.push(rest);
        result.kept.push(place);
        result.mix.push(mix);
    }
    result
}

impl Orthonormal {
    /// The kept columns of `given`, combined like the orthonormal ones.
    pub fn mixed(&self, given: &[Vec<f64>]) -> Vec<Vec<f64>> {
        let one = |mix: &Vec<f64>| {
            let mut sum = vec![0.0; given.first().map_or(0, Vec::len)];
            mix.iter().zip(&self.kept).for_each(|(x, &place)| add(&mut sum, &given[place], *x));
            sum
        };
        self.mix.iter().map(one).collect()
    }

    /// Coefficients of the columns that were given, `(given)`, from those of the orthonormal ones.
    pub fn given(&self, coefficients: &[f64], given: usize) -> Vec<f64> {
        let mut result = vec![0.0; given];
        for (x, mix) in coefficients.iter().zip(&self.mix) {
            mix.iter().zip(&self.kept).for_each(|(m, &place)| result[place] += x * m);
        }
        result
    }

    /// Coefficients of the orthonormal columns that come closest to a column.
    pub fn along(&self, column: &[f64]) -> Vec<f64> {
        self.columns.iter().map(|known| dot(known, column)).collect()
    }

    /// Removes the part of a column along the orthonormal columns.
    pub fn remove(&self, column: &mut [f64]) {
        for _ in 0..2 {
            for known in &self.columns {
                let along = dot(known, column);
                add(column, known, -along);
            }
        }
    }
}

/// Sum of products.
pub(crate) fn dot(a: &[f64], b: &[f64]) -> f64 {
    // Eight sums, which a compiler makes vectors of.
    let mut sums = [0.0; 8];
    let (a8, a1) = a.as_chunks::<8>();
    let (b8, b1) = b.as_chunks::<8>();
    for (a, b) in a8.iter().zip(b8) {
        for l in 0..8 {
            sums[l] += a[l] * b[l];
        }
    }
    sums.iter().sum::<f64>() + a1.iter().zip(b1).map(|(a, b)| a * b).sum::<f64>()
}

/// Euclidean length.
pub(crate) fn norm(a: &[f64]) -> f64 {
    dot(a, a).sqrt()
}

/// `a += factor b`.
pub(crate) fn add(a: &mut [f64], b: &[f64], factor: f64) {
    a.iter_mut().zip(b).for_each(|(a, b)| *a += factor * b);
}

/// Replaces a null vector of columns by one without its small entries, if that is a null vector too.
///
/// `column` gives the column of an entry of `vector`; `sizes` are those of the functions that they belong to. The largest entry keeps its
/// value, the other large ones follow by least squares. The new vector is accepted if the residual, relative to all entries one by one, is
/// below ten times `noise` or below 1e-9: it then leaves out only noise. This is repeated while it leaves out more: an entry that was large
/// before a fit may be small after it.
pub(crate) fn refine(vector: &mut [f64], column: &dyn Fn(usize) -> Vec<f64>, sizes: &[f64], noise: f64) {
    let entries = |vector: &[f64]| vector.iter().filter(|x| **x != 0.0).count();
    loop {
        let before = entries(vector);
        refine_once(vector, column, sizes, noise);
        if entries(vector) == before {
            return;
        }
    }
}

fn refine_once(vector: &mut [f64], column: &dyn Fn(usize) -> Vec<f64>, sizes: &[f64], noise: f64) {
    let weighed: Vec<f64> = vector.iter().zip(sizes).map(|(x, s)| (x * s).abs()).collect();
    let largest = weighed.iter().fold(0.0, |m: f64, x| m.max(*x));
    let mut before = 0;
    for small in NEGLIGIBLE_ENTRIES {
        let mut support: Vec<usize> = (0..vector.len()).filter(|k| weighed[*k] > small * largest).collect();
        let Some(pivot) = support.iter().copied().max_by(|a, b| weighed[*a].total_cmp(&weighed[*b])) else { return };
        support.retain(|k| *k != pivot);
        // The same entries would be refused again.
        if small < NEGLIGIBLE_ENTRIES[0] && support.len() == before {
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
    let plain = orthonormal(&columns, INDEPENDENT_NULL_COLUMN);
    let mut solution = plain.given(&plain.along(&target), support.len());
    let mut rest = target.clone();
    let mut whole = norm(&target).powi(2);
    for (x, column) in solution.iter().zip(&columns) {
        add(&mut rest, column, -x);
        whole += (x * norm(column)).powi(2);
    }
    let whole = whole.sqrt();
    if whole > 0.0 && norm(&rest) > (REFINED_RESIDUAL * noise).max(REFINED_ROUNDING) * whole {
        return None;
    }
    let parts: Vec<f64> = solution.iter().zip(&columns).map(|(x, column)| (x * norm(column)).abs()).collect();
    let last = parts.iter().fold(0.0, |m: f64, part| m.max(*part));
    for (x, part) in solution.iter_mut().zip(&parts) {
        if *part <= ROUNDING_ENTRY * last {
            *x = 0.0;
        }
    }
    Some(solution)
}

/// Coefficients of the least-squares fit of columns to a target, 0 for those that it does not determine: columns that explain no more than
/// chance beyond the columns before them are left out and the others refitted, as long as the residual grows no more than by chance.
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
        // The columns that were left out explained no more than the same number of noise columns.
        let left_out = (columns.len() - support.len()) as f64;
        if let Some((before, least)) = &found
            && square > least * (1.0 + GAUGE_SIGNIFICANCE * (2.0 * left_out).sqrt() / free)
        {
            return before.clone();
        }
        let solution = plain.given(&along, support.len());
        let mut all = vec![0.0; columns.len()];
        support.iter().zip(&solution).for_each(|(k, x)| all[*k] = *x);
        let least = found.map_or(square, |(_, least)| least);
        found = Some((all.clone(), least));
        let known = plain.kept.iter().zip(&along).filter(|(_, along)| along.abs() > GAUGE_SIGNIFICANCE * square.sqrt());
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

/// The vector of fewest entries near `start` that solves `A x = 0` to about `noise`, where `gram` is `A^T A`; `None` if its residual is
/// more than twice as large.
///
/// `x^T A^T A x` is minimised together with a penalty on entries `sum of (s x)^2/((s x)^2 + d^2)`, reweighted with `d` falling, `s` being
/// the `sizes` of the entries; the entry `pivot` is kept, the `taken` ones stay 0 (reweighted least squares, Chartrand and Yin 2008).
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
    let price =
        SPARSE_PENALTY * residual(start).max((noise * size).powi(2) * SPARSE_LEAST_RESIDUAL).max(f64::MIN_POSITIVE);
    let mut active: Vec<usize> = (0..count).filter(|k| *k != pivot && !taken[*k]).collect();
    let mut workspace = Workspace::new();
    for step in 0..SPARSE_STEPS {
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
        let floor = (SPARSE_ZERO * size).min(SPARSE_WIDTH * near);
        active.retain(|i| (x[*i] * sizes[*i]).abs() > floor);
    }
    for (x, s) in x.iter_mut().zip(sizes) {
        if (*x * s).abs() <= SPARSE_ZERO * size {
            *x = 0.0;
        }
    }
    let before = residual(start).max((noise * size).powi(2) * SPARSE_LEAST_RESIDUAL);
    (residual(&x) <= SPARSE_RESIDUAL * SPARSE_RESIDUAL * before).then_some(x)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn zeros_are_told_by_the_gap() {
        let at = |values: &[f64], tolerance| Separation::new(values, tolerance);
        let exact = Some(1e-8);
        assert_eq!(at(&[1e-13, 1e-12, 0.01, 0.3], exact), Separation { count: Some(2), gap: Some(1e10) });
        assert_eq!(at(&[0.02, 0.3], exact), Separation { count: Some(0), gap: Some(0.02 / 1e-8) });
        assert_eq!(at(&[1e-14, 5e-9, 6e-9, 2e-8], exact).count, None);
        assert_eq!(at(&[1e-16, 1e-17], exact), Separation { count: Some(2), gap: None });
        assert_eq!(at(&[1e-4, 2e-3, 3e-3, 0.2], None).count, Some(3));
        // Imposed symmetries next to learned ones.
        assert_eq!(at(&[0.0, 1e-9, 2e-3, 0.05], None).count, Some(3));
        // A value that exceeds only two exact zeros may still be noise.
        assert_eq!(at(&[1e-6, 2e-6, 4e-3, 0.02], None).count, None);
        assert_eq!(at(&[1e-3, 5e-3, 2e-2, 0.09], None).count, None);
        assert_eq!(at(&[0.2, 0.3], None), Separation { count: Some(0), gap: Some(2.0) });
        assert_eq!(at(&[], None).count, Some(0));
    }

    #[test]
    fn rows_become_simple() {
        // Combinations of (1, 0, 2, 0) and (0, 1, 0, -1), with rounding.
        let mut rows = vec![vec![0.6, 0.8, 1.2, -0.8], vec![0.8, -0.6, 1.6, 0.6 + 1e-15]];
        assert_eq!(reduce(&mut rows, &[1.0; 4], 1e-12, 0), [0, 1]);
        let near = |row: &[f64], other: &[f64]| row.iter().zip(other).all(|(a, b)| (a - b).abs() < 1e-14);
        assert!(near(&rows[0], &[1.0, 0.0, 2.0, 0.0]) && near(&rows[1], &[0.0, 1.0, 0.0, -1.0]), "{rows:?}");
        assert_eq!((rows[0][1], rows[1][0], rows[1][2]), (0.0, 0.0, 0.0));
    }

    #[test]
    fn few_entries_are_preferred() {
        // a = b + c nearly, and a = d nearly: for a mixture that is mostly the latter, one entry is enough.
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
        // If two columns explain it together, neither is left out.
        let both: Vec<f64> = a.iter().zip(&c).map(|(a, c)| a - 0.5 * c).collect();
        let found = significant(&[a, c], &both, 1e-9);
        assert!((found[0] - 1.0).abs() < 1e-12 && (found[1] + 0.5).abs() < 1e-12, "{found:?}");
    }

    #[test]
    fn noise_is_taken_out() {
        // 2 a - b = 0; c is no part of it.
        let columns = [vec![1.0, 2.0, 0.5], vec![2.0, 4.0, 1.0], vec![0.0, 1.0, 3.0]];
        let mut vector = vec![2.0 + 1e-6, -1.0, 1e-6];
        refine(&mut vector, &|k| columns[k].clone(), &[1.0; 3], 1e-6);
        assert!((vector[0] / vector[1] + 2.0).abs() < 1e-14 && vector[2] == 0.0, "{vector:?}");
        // A needed entry stays, however small.
        let columns = [vec![1.0, 0.0, 0.0], vec![1.0, 0.0, 1e-5], vec![0.0, 0.0, 1.0]];
        let mut vector = vec![1.0, -1.0, 1e-5];
        refine(&mut vector, &|k| columns[k].clone(), &[1.0; 3], 1e-12);
        assert_eq!(vector, [1.0, -1.0, 1e-5]);
    }
}
