//! Small dense linear algebra of normal equations and mass matrices: symmetric matrices `(n, n)`, row-major.

use super::thresholds::{PRODUCT_ROWS, RIDGE};
use crate::linalg::{self, Workspace, dot, gemm};
use crate::scalar::{MatMut, MatRef};

/// Inverse of a symmetric, positive semi-definite matrix, regularized by a small ridge.
pub(crate) fn inverse(n: usize, matrix: &[f64]) -> Option<Vec<f64>> {
    inverse_with(n, matrix, RIDGE)
}

/// [`inverse`] with the given ridge, relative to the diagonal.
pub(crate) fn inverse_with(n: usize, matrix: &[f64], ridge: f64) -> Option<Vec<f64>> {
    let diagonal = |i: usize| matrix[i * n + i];
    let scale: Vec<f64> = (0..n).map(|i| if diagonal(i) > 0.0 { diagonal(i).sqrt().recip() } else { 1.0 }).collect();
    let scaled =
        |(at, x): (usize, &f64)| x * scale[at / n] * scale[at % n] + if at / n == at % n { ridge } else { 0.0 };
    let scaled: Vec<f64> = matrix.iter().enumerate().map(scaled).collect();
    let mut inverse = vec![0.0; n * n];
    linalg::inverse(n, &scaled, &mut inverse, &mut Workspace::new()).ok()?;
    inverse.iter_mut().enumerate().for_each(|(at, x)| *x *= scale[at / n] * scale[at % n]);
    Some(inverse)
}

/// Inverses of a batch of matrices that need not be symmetric, `(batch, n, n)`: `[[0, A], [A', 0]]` is symmetric, and its inverse contains that of
/// `A` as a block.
pub(super) fn inverses(n: usize, matrices: &[f64]) -> Vec<f64> {
    let batch = matrices.len() / (n * n);
    let mut symmetric = vec![0.0; 4 * matrices.len()];
    for (whole, matrix) in symmetric.chunks_exact_mut(4 * n * n).zip(matrices.chunks_exact(n * n)) {
        for (at, x) in matrix.iter().enumerate() {
            let (i, j) = (at / n, at % n);
            (whole[i * 2 * n + n + j], whole[(n + j) * 2 * n + i]) = (*x, *x);
        }
    }
    let mut inverse = vec![0.0; symmetric.len()];
    // Inverses of singular matrices are NaN.
    let _ = linalg::inverse(2 * n, &symmetric, &mut inverse, &mut Workspace::new());
    let corner = |at: usize| {
        let (matrix, i, j) = (at / (n * n), at / n % n, at % n);
        inverse[matrix * 4 * n * n + (n + i) * 2 * n + j]
    };
    (0..batch * n * n).map(corner).collect()
}

/// `A x`.
pub(crate) fn times(n: usize, matrix: &[f64], x: &[f64]) -> Vec<f64> {
    (0..n).map(|i| dot(&matrix[i * n..(i + 1) * n], x)).collect()
}

/// The rows and columns of the given indices.
pub(crate) fn part(n: usize, matrix: &[f64], indices: &[usize]) -> Vec<f64> {
    indices.iter().flat_map(|&i| indices.iter().map(move |&j| matrix[i * n + j])).collect()
}

/// Sums of products of rows, `J^T J`, by blocks of rows of one coordinate. A torque depends only on the links that its joint carries, so that a
/// block has few columns other than 0.
pub(super) struct Products {
    m: usize,
    /// Rows of each coordinate, `(rows, m)`.
    rows: Vec<Vec<f64>>,
    packed: Vec<f64>,
    product: Vec<f64>,
}

impl Products {
    /// For rows of `m` numbers of `n` coordinates.
    pub fn new(n: usize, m: usize) -> Self {
        Self { m, rows: vec![Vec::new(); n], packed: Vec::new(), product: Vec::new() }
    }

    /// Adds a row of a coordinate, times a factor.
    pub fn add(&mut self, coordinate: usize, row: &[f64], factor: f64, sum: &mut [f64]) {
        let rows = &mut self.rows[coordinate];
        rows.extend(row.iter().map(|x| factor * x));
        if rows.len() >= PRODUCT_ROWS * self.m {
            self.multiply(coordinate, sum);
        }
    }

    /// Adds the products of the remaining rows.
    pub fn finish(&mut self, sum: &mut [f64]) {
        (0..self.rows.len()).for_each(|coordinate| self.multiply(coordinate, sum));
    }

    /// Adds the products of the rows of a coordinate to the sum, `(m, m)`.
    fn multiply(&mut self, coordinate: usize, sum: &mut [f64]) {
        let m = self.m;
        let rows = std::mem::take(&mut self.rows[coordinate]);
        let count = rows.len() / m.max(1);
        let held: Vec<usize> = (0..m).filter(|k| rows.iter().skip(*k).step_by(m).any(|x| *x != 0.0)).collect();
        self.packed.clear();
        self.packed.extend(rows.chunks_exact(m.max(1)).flat_map(|row| held.iter().map(|&k| row[k])));
        self.product.resize(held.len() * held.len(), 0.0);
        let packed = MatRef::new(&self.packed, count, held.len());
        gemm(MatMut::new(&mut self.product, held.len(), held.len()), false, 1.0, packed.t(), packed);
        for (&i, products) in held.iter().zip(self.product.chunks_exact(held.len().max(1))) {
            let line = &mut sum[i * m..(i + 1) * m];
            held.iter().zip(products).for_each(|(&j, product)| line[j] += product);
        }
        self.rows[coordinate] = rows;
        self.rows[coordinate].clear();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_inverse_solves() {
        let matrix = [4.0, 1.0, 0.0, 1.0, 3.0, -2.0, 0.0, -2.0, 6.0];
        let inverse = inverse(3, &matrix).unwrap();
        let x = times(3, &inverse, &[1.0, 2.0, 3.0]);
        let again = times(3, &matrix, &x);
        assert!(again.iter().zip([1.0, 2.0, 3.0]).all(|(a, b)| (a - b).abs() < 1e-10), "{again:?}");
    }

    #[test]
    fn matrices_without_symmetry_are_inverted() {
        let matrices = [0.0, 2.0, -1.0, 1e-3, 3.0, 4.0, 0.0, 5.0];
        let found = inverses(2, &matrices);
        for (matrix, inverse) in matrices.chunks(4).zip(found.chunks(4)) {
            for k in 0..2 {
                let column = times(2, matrix, &[inverse[k], inverse[2 + k]]);
                assert!((0..2).all(|i| (column[i] - f64::from(u8::from(i == k))).abs() < 1e-12), "{column:?}");
            }
        }
    }

    #[test]
    fn a_direction_without_data_gets_the_smallest_solution() {
        let inverse = inverse(2, &[1.0, 1.0, 1.0, 1.0]).unwrap();
        let x = times(2, &inverse, &[2.0, 2.0]);
        assert!((x[0] + x[1] - 2.0).abs() < 1e-3, "{x:?}");
    }
    #[test]
    fn products_of_rows_are_summed_over_the_columns_that_they_have() {
        // The second coordinate has two columns of five; more rows than a block.
        let (m, mut products, mut sum, mut expected) = (5, Products::new(2, 5), vec![0.0; 25], vec![0.0; 25]);
        for k in 0..150usize {
            let number = |i: usize| f64::from(u8::from(k % 2 == 0 || i > 2)) * ((k * 7 + i * 3) % 11) as f64;
            let row: Vec<f64> = (0..m).map(number).collect();
            products.add(k % 2, &row, 0.5, &mut sum);
            (0..25).for_each(|at| expected[at] += 0.25 * row[at / m] * row[at % m]);
        }
        products.finish(&mut sum);
        assert!(sum.iter().zip(&expected).all(|(a, b)| (a - b).abs() < 1e-9), "{sum:?} {expected:?}");
    }
}
