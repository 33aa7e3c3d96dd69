//! Eigenvalues of matrices whose coordinates fall into groups that no element joins: those of the groups' blocks.

use super::batch::{Apart, Buffer, Workspace};
use super::eigen::whole;
use super::large_systems::{LARGE, LARGE_BLOCK};
use crate::scalar::{Real, Scalar};

/// Size from which the search for blocks takes less than a fiftieth of what a full matrix takes.
const SIZE: usize = 16;

/// Matrices that are divided at once at most: their blocks stay in the cache.
const TOGETHER: usize = 64;

/// Eigenvalues, ascending, and eigenvectors as rows (if `vectors` is not empty) of a batch, of every matrix by its blocks; whether all is known to
/// be finite. Eigenvectors are zero outside of their block.
///
/// A matrix is divided by its own zeros alone, so that it gives the same bits wherever it stands in a batch. Neighbours that are divided alike go
/// together.
pub(super) fn by_blocks<S: Scalar>(
    n: usize,
    matrices: &[S],
    values: &mut [S],
    vectors: &mut [S],
    workspace: &mut Workspace<S>,
) -> bool {
    let Workspace { block: buffer, apart, .. } = workspace;
    if n < SIZE {
        return whole(n, LARGE, matrices, values, vectors, buffer);
    }
    let batch = values.len() / n;
    let [mut label, mut next] = std::mem::take(&mut apart.labels);
    let mut finite = true;
    let mut start = 0;
    while start < batch {
        let matrix = |row: usize| &matrices[row * n * n..][..n * n];
        let reached = &mut apart.members;
        let groups = find(n, matrix(start), &mut label, reached);
        let mut end = start + 1;
        while end < batch.min(start + TOGETHER) && find(n, matrix(end), &mut next, reached) == groups && next == label {
            end += 1;
        }
        let matrices = &matrices[start * n * n..end * n * n];
        let values = &mut values[start * n..end * n];
        let vectors = if vectors.is_empty() { &mut [][..] } else { &mut vectors[start * n * n..end * n * n] };
        finite &= if groups == 1 {
            whole(n, LARGE, matrices, values, vectors, buffer)
        } else {
            divide(n, &label, apart);
            apart.decompose(n, matrices, values, vectors, buffer)
        };
        start = end;
    }
    apart.labels = [label, next];
    finite
}

/// Labels the coordinates of a matrix by the first members of their groups, from its upper triangle, and counts the groups.
///
/// The first row of a full matrix says all.
fn find<S: Scalar>(n: usize, matrix: &[S], label: &mut Vec<usize>, reached: &mut Vec<usize>) -> usize {
    let zero = <S as Real>::zero();
    label.clear();
    label.resize(n, n);
    reached.clear();
    let mut groups = 0;
    for first in 0..n {
        if label[first] < n {
            continue;
        }
        label[first] = first;
        groups += 1;
        let mut next = reached.len();
        reached.push(first);
        while next < reached.len() && reached.len() < n {
            let i = reached[next];
            for (j, label) in label.iter_mut().enumerate() {
                if *label == n && matrix[i.min(j) * n + i.max(j)] != zero {
                    *label = first;
                    reached.push(j);
                }
            }
            next += 1;
        }
    }
    groups
}

/// Lists the groups by size, and their members.
fn divide<S: Scalar>(n: usize, label: &[usize], apart: &mut Apart<S>) {
    let Apart { groups, members, .. } = apart;
    groups.clear();
    groups.extend((0..n).filter(|&i| label[i] == i).map(|i| (label.iter().filter(|&&root| root == i).count(), i)));
    groups.sort_unstable();
    members.clear();
    for &(_, root) in groups.iter() {
        members.extend((0..n).filter(|&i| label[i] == root));
    }
}

impl<S: Scalar> Apart<S> {
    /// Decomposes matrices of the same groups, blocks of one size as one batch.
    fn decompose(
        &mut self,
        n: usize,
        matrices: &[S],
        values: &mut [S],
        vectors: &mut [S],
        buffer: &mut Buffer<S>,
    ) -> bool {
        let zero = <S as Real>::zero();
        vectors.fill(zero);
        let least = if n > LARGE { LARGE_BLOCK } else { LARGE };
        // Below the diagonal an element outside of the blocks may be anything.
        let mut finite = matrices.iter().all(|m| m.is_finite());
        let mut first = 0;
        for groups in self.groups.chunk_by(|a, b| a.0 == b.0) {
            let (m, width) = (groups[0].0, groups[0].0 * groups.len());
            let members = &self.members[first..first + width];
            if m == 1 {
                for (row, matrix) in matrices.chunks_exact(n * n).enumerate() {
                    for (k, &i) in members.iter().enumerate() {
                        values[row * n + first + k] = matrix[i * n + i];
                        if !vectors.is_empty() {
                            vectors[(row * n + first + k) * n + i] = <S as Real>::one();
                        }
                    }
                }
                first += width;
                continue;
            }
            self.matrices.clear();
            for matrix in matrices.chunks_exact(n * n) {
                for group in members.chunks_exact(m) {
                    self.matrices.extend(group.iter().flat_map(|i| group.iter().map(move |j| matrix[i * n + j])));
                }
            }
            self.values.resize(self.matrices.len() / m, zero);
            self.vectors.resize(if vectors.is_empty() { 0 } else { self.matrices.len() }, zero);
            finite &= whole(m, least, &self.matrices, &mut self.values, &mut self.vectors, buffer);
            for (values, found) in values.chunks_exact_mut(n).zip(self.values.chunks_exact(width)) {
                values[first..first + width].copy_from_slice(found);
            }
            for (vectors, found) in vectors.chunks_exact_mut(n * n).zip(self.vectors.chunks_exact(width * m)) {
                for (k, found) in found.chunks_exact(m).enumerate() {
                    let group = &members[k / m * m..][..m];
                    group.iter().zip(found).for_each(|(i, &u)| vectors[(first + k) * n + i] = u);
                }
            }
            first += width;
        }
        for (row, values) in values.chunks_exact_mut(n).enumerate() {
            let vectors = if vectors.is_empty() { &mut [][..] } else { &mut vectors[row * n * n..][..n * n] };
            self.sort(values, vectors);
        }
        finite
    }

    /// Brings eigenvalues into ascending order, those that are equal in the order of their blocks, and their eigenvectors with them.
    fn sort(&mut self, values: &mut [S], vectors: &mut [S]) {
        let n = values.len();
        let found = &mut self.values;
        found.clear();
        found.extend_from_slice(values);
        let compare = |a: S, b: S| a.partial_cmp(&b).unwrap_or_else(|| a.is_nan().cmp(&b.is_nan()));
        self.order.clear();
        self.order.extend(0..n);
        self.order.sort_unstable_by(|&a, &b| compare(found[a], found[b]).then(a.cmp(&b)));
        self.vectors.clear();
        self.vectors.extend_from_slice(vectors);
        for (k, &from) in self.order.iter().enumerate() {
            values[k] = found[from];
            if !vectors.is_empty() {
                vectors[k * n..][..n].copy_from_slice(&self.vectors[from * n..][..n]);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::linalg::{Failure, dot, eigenvalues, eigh};
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
                whole(n, LARGE, &matrix, &mut plain, &mut full, &mut Buffer::default());
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
            whole(n, LARGE, &matrix, &mut plain, &mut full, &mut Buffer::default());
            assert_eq!((w, u), (plain, full));
        }
    }

    #[test]
    fn equal_eigenvalues_of_different_blocks_keep_their_own_vectors() {
        // Two blocks with the eigenvalues 1 and 3 each, and a diagonal with 3, 1, -2 and many of 4.
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
