//! Eigenvalues of matrices whose coordinates split into uncoupled groups: those of the groups' blocks.

use super::batch::Buffer;
use super::components;
use super::eigen::whole;
use super::thresholds::BLOCK_SEARCH_SIZE;
use crate::scalar::{Real, Scalar, are_finite};
use alloc::vec::Vec;

/// Eigenvalues, ascending, and eigenvectors as rows (if `vectors` is not empty) of a batch, of every matrix by its blocks; `true` if all is
/// known to be finite. Eigenvectors are zero outside their block.
///
/// The split of a matrix depends only on its own zeros, so that it gives the same bits at any position in a batch. Neighbours with the same
/// split are processed together.
pub(super) fn by_blocks<S: Scalar>(
    n: usize,
    matrices: &[S],
    values: &mut [S],
    vectors: &mut [S],
    buffer: &mut Buffer<S>,
) -> bool {
    if n < BLOCK_SEARCH_SIZE {
        return whole(n, matrices, values, vectors, buffer);
    }
    let groups_of = |row: usize| groups(n, &matrices[row * n * n..][..n * n]);
    let batch = values.len() / n;
    let (mut finite, mut start) = (true, 0);
    let mut next = groups_of(0);
    while start < batch {
        let (groups, mut end) = (next, start + 1);
        loop {
            next = if end < batch { groups_of(end) } else { Vec::new() };
            if next != groups {
                break;
            }
            end += 1;
        }
        let matrices = &matrices[start * n * n..end * n * n];
        let values = &mut values[start * n..end * n];
        let vectors = if vectors.is_empty() { &mut [][..] } else { &mut vectors[start * n * n..end * n * n] };
        finite &= match groups.len() {
            1 => whole(n, matrices, values, vectors, buffer),
            _ => apart(n, &groups, matrices, values, vectors, buffer),
        };
        start = end;
    }
    finite
}

/// The coordinates of a matrix in groups, by its upper triangle.
fn groups<S: Scalar>(n: usize, matrix: &[S]) -> Vec<Vec<usize>> {
    let is_element = |i: usize, j: usize| matrix[i * n + j] != <S as Real>::zero();
    // The first row of a full matrix is enough.
    if (1..n).all(|j| is_element(0, j)) {
        return vec![(0..n).collect()];
    }
    let pairs = (0..n).flat_map(|i| (i + 1..n).map(move |j| (i, j)));
    components(n, pairs.filter(|&(i, j)| is_element(i, j)))
}

/// Decomposes matrices with the same groups, block by block.
fn apart<S: Scalar>(
    n: usize,
    groups: &[Vec<usize>],
    matrices: &[S],
    values: &mut [S],
    vectors: &mut [S],
    buffer: &mut Buffer<S>,
) -> bool {
    // An element outside the blocks, below the diagonal, may have any value.
    let mut finite = are_finite(matrices);
    vectors.fill(<S as Real>::zero());
    let mut first = 0;
    for group in groups {
        let m = group.len();
        let of = |matrix: &[S]| {
            group.iter().flat_map(|i| group.iter().map(move |j| i * n + j)).map(|at| matrix[at]).collect::<Vec<S>>()
        };
        let blocks: Vec<S> = matrices.chunks_exact(n * n).flat_map(of).collect();
        let mut found = vec![S::nan(); blocks.len() / m];
        let mut directions = vec![S::nan(); if vectors.is_empty() { 0 } else { blocks.len() }];
        finite &= whole(m, &blocks, &mut found, &mut directions, buffer);
        for (values, found) in values.chunks_exact_mut(n).zip(found.chunks_exact(m)) {
            values[first..first + m].copy_from_slice(found);
        }
        for (vectors, directions) in vectors.chunks_exact_mut(n * n).zip(directions.chunks_exact(m * m)) {
            for (k, direction) in directions.chunks_exact(m).enumerate() {
                group.iter().zip(direction).for_each(|(i, &u)| vectors[(first + k) * n + i] = u);
            }
        }
        first += m;
    }
    for (row, values) in values.chunks_exact_mut(n).enumerate() {
        sort(values, if vectors.is_empty() { &mut [] } else { &mut vectors[row * n * n..][..n * n] });
    }
    finite
}

/// Sorts eigenvalues in ascending order, equal ones in the order of their blocks, and their eigenvectors with them.
fn sort<S: Scalar>(values: &mut [S], vectors: &mut [S]) {
    let (n, found, directions) = (values.len(), values.to_vec(), vectors.to_vec());
    let mut order: Vec<usize> = (0..n).collect();
    order.sort_by(|&a, &b| {
        let (a, b) = (found[a], found[b]);
        a.partial_cmp(&b).unwrap_or_else(|| a.is_nan().cmp(&b.is_nan()))
    });
    for (k, from) in order.into_iter().enumerate() {
        values[k] = found[from];
        if !vectors.is_empty() {
            vectors[k * n..][..n].copy_from_slice(&directions[from * n..][..n]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::linalg::{Failure, Workspace, dot, eigenvalues, eigh};
    use crate::scalar::Dd;

    /// A matrix of blocks of these sizes, its coordinates in an order of no pattern.
    fn blocks(sizes: &[usize], seed: usize) -> Vec<f64> {
        let n = sizes.iter().sum::<usize>();
        let mut order: Vec<usize> = (0..n).collect();
        (1..n).for_each(|i| order.swap(i, (i * i * 31 + 17 * i + 5) % (i + 1)));
        let mut matrix = vec![0.0; n * n];
        let mut first = 0;
        for &m in sizes {
            for i in first..first + m {
                for j in first..=i {
                    let x = ((i * j * 7 + (i + j) * 13 + 5 * m + 29 * seed) % 101) as f64 / 101.0 - 0.505;
                    (matrix[order[i] * n + order[j]], matrix[order[j] * n + order[i]]) = (x, x);
                }
            }
            first += m;
        }
        matrix
    }

    /// Largest residual and departure from orthonormal vectors, in roundings of the largest eigenvalue.
    fn errors(n: usize, matrix: &[f64], values: &[f64], vectors: &[f64]) -> (f64, f64) {
        let size = values[0].abs().max(values[n - 1].abs());
        let (mut rest, mut skew) = (0.0_f64, 0.0_f64);
        for (k, u) in vectors.chunks_exact(n).enumerate() {
            matrix.chunks_exact(n).zip(u).for_each(|(row, x)| rest = rest.max((dot(row, u) - values[k] * x).abs()));
            for (l, w) in vectors.chunks_exact(n).enumerate() {
                skew = skew.max((dot(u, w) - f64::from(k == l)).abs());
            }
        }
        (rest / size / f64::EPSILON, skew / f64::EPSILON)
    }

    #[test]
    fn blocks_are_decomposed_as_accurately_as_the_whole() {
        const SEEDS: usize = 16;
        for sizes in [&[3, 5, 1, 3, 7][..], &[1; 20], &[40, 40, 2, 2, 7], &[12, 33], &[27, 30, 9], &[2; 32], &[16, 1]] {
            let n = sizes.iter().sum::<usize>();
            let largest = *sizes.iter().max().unwrap();
            let (mut ours, mut theirs) = ((0.0, 0.0), (0.0, 0.0));
            for seed in 0..SEEDS {
                let matrix = blocks(sizes, seed);
                let (mut workspace, mut w, mut u) = (Workspace::new(), vec![0.0; n], vec![0.0; n * n]);
                eigh(n, &matrix, &mut w, &mut u, &mut workspace).unwrap();
                let (mut plain, mut full) = (w.clone(), u.clone());
                whole(n, &matrix, &mut plain, &mut full, &mut Buffer::default());
                let add = |sum: &mut (f64, f64), more: (f64, f64)| *sum = (sum.0 + more.0, sum.1 + more.1);
                add(&mut ours, errors(n, &matrix, &w, &u));
                add(&mut theirs, errors(n, &matrix, &plain, &full));
                assert!(w.is_sorted());
                u.chunks_exact(n).for_each(|u| assert!(u.iter().filter(|u| **u != 0.0).count() <= largest));
                let bound = 16.0 * n as f64 * f64::EPSILON * w[0].abs().max(w[n - 1].abs());
                let close = |(a, b): (&f64, &f64)| (a - b).abs() < bound;
                assert!(plain.iter().zip(&w).all(close));
                eigenvalues(n, &matrix, &mut plain, &mut workspace).unwrap();
                assert!(plain.iter().zip(&w).all(close));
            }
            let mean = |sum: (f64, f64)| (sum.0 / SEEDS as f64, sum.1 / SEEDS as f64);
            let (ours, theirs) = (mean(ours), mean(theirs));
            println!("{sizes:?}: residual and skew {ours:.2?}, of the whole {theirs:.2?}");
            assert!(ours.0 <= 1.5 * theirs.0 && ours.1 <= 1.5 * theirs.1, "{sizes:?}: {ours:?} {theirs:?}");
        }
    }

    #[test]
    fn a_full_matrix_is_decomposed_as_a_whole() {
        for n in [16, 20, 40] {
            let matrix = blocks(&[n], 0);
            let (mut w, mut u) = (vec![0.0; n], vec![0.0; n * n]);
            eigh(n, &matrix, &mut w, &mut u, &mut Workspace::new()).unwrap();
            let (mut plain, mut full) = (w.clone(), u.clone());
            whole(n, &matrix, &mut plain, &mut full, &mut Buffer::default());
            assert_eq!((w, u), (plain, full));
        }
    }

    #[test]
    fn equal_eigenvalues_of_different_blocks_keep_their_own_vectors() {
        // Two blocks, each with eigenvalues 1 and 3, and a diagonal with 3, 1, -2 and repeated 4.
        let n = 18;
        let mut matrix = vec![<Dd as Real>::zero(); n * n];
        let mut set =
            |i: usize, j: usize, x: f64| (matrix[i * n + j], matrix[j * n + i]) = (Dd::of_f64(x), Dd::of_f64(x));
        [0, 3, 5, 8].into_iter().for_each(|i| set(i, i, 2.0));
        set(0, 8, 1.0);
        set(3, 5, -1.0);
        [(1, 3.0), (2, 1.0), (4, -2.0), (6, 3.0), (7, 1.0)].into_iter().for_each(|(i, x)| set(i, i, x));
        (9..n).for_each(|i| set(i, i, 4.0));
        let (mut w, mut u) = (vec![<Dd as Real>::zero(); n], matrix.clone());
        eigh(n, &matrix, &mut w, &mut u, &mut Workspace::new()).unwrap();
        let exact = [&[-2.0, 1.0, 1.0, 1.0, 1.0, 3.0, 3.0, 3.0, 3.0][..], &[4.0; 9]].concat();
        assert!(w.iter().zip(exact).all(|(w, exact)| (*w - Dd::of_f64(exact)).to_f64().abs() < 1e-30), "{w:?}");
        for (k, vector) in u.chunks_exact(n).enumerate() {
            for (l, other) in u.chunks_exact(n).enumerate() {
                let product = vector.iter().zip(other).fold(<Dd as Real>::zero(), |sum, (&a, &b)| sum + a * b);
                assert!((product.to_f64() - f64::from(k == l)).abs() < 1e-30);
            }
        }
    }

    #[test]
    fn matrices_give_the_same_bits_and_failures_wherever_they_stand() {
        let n = 18;
        let kinds = [&[18][..], &[8, 10], &[9, 9], &[1; 18], &[3, 5, 3, 7]].map(|sizes| blocks(sizes, 0));
        let mut batch = Vec::new();
        (0..70).for_each(|k| batch.extend_from_slice(&kinds[if k % 7 < 4 { 1 } else { k % kinds.len() }]));
        // Outside of the blocks below the diagonal, and inside of one.
        let hidden = (0..n * n).find(|e| e / n > e % n && kinds[3][*e] == 0.0).unwrap();
        let spoilt = [(4, hidden, f64::NAN), (12, 0, f64::NAN), (20, n + 1, f64::INFINITY)];
        for (row, place, value) in spoilt {
            batch[row * n * n + place] = value;
        }
        let (mut w, mut u) = (vec![0.0; 70 * n], vec![0.0; 70 * n * n]);
        let mut workspace = Workspace::new();
        assert!(eigh(n, &batch, &mut w, &mut u, &mut workspace).is_err());
        assert_eq!(workspace.failures(), spoilt.map(|(row, ..)| (row, Failure::NotFinite)));
        for (row, matrix) in batch.chunks_exact(n * n).enumerate() {
            let (mut own, mut vectors) = (vec![0.0; n], vec![0.0; n * n]);
            let found = eigh(n, matrix, &mut own, &mut vectors, &mut Workspace::new());
            let bits = |x: &[f64]| x.iter().map(|x| x.to_bits()).collect::<Vec<_>>();
            let failed = spoilt.iter().any(|s| s.0 == row);
            assert_eq!(found.is_err(), failed);
            assert!(!failed || own.iter().chain(&vectors).all(|x| x.is_nan()));
            if !failed {
                assert_eq!(bits(&own), bits(&w[row * n..][..n]), "{row}");
                assert_eq!(bits(&vectors), bits(&u[row * n * n..][..n * n]), "{row}");
            }
        }
    }
}
