//! Products, elimination, eigenvalues and singular values by faer, for large matrices in `f32` and `f64`, one after the other.

use super::singular::Singular;
use super::solve::{is_harmless, suspicious};
use crate::scalar::{Real, Scalar, vectorized};
use faer::diag::Diag;
use faer::dyn_stack::{MemBuffer, MemStack, StackReq};
use faer::linalg::lu::partial_pivoting::{factor, solve};
use faer::linalg::matmul::matmul;
use faer::linalg::svd::{ComputeSvdVectors, svd, svd_scratch};
use faer::perm::PermRef;
use faer::traits::{ComplexField, RealField};
use faer::{Accum, Mat, MatMut, MatRef, Par, Side, Spec};

/// `C = alpha A B`, or `C += alpha A B` if `accumulate`; the shapes fit.
pub(super) fn product<T: ComplexField>(
    c: crate::scalar::MatMut<'_, T>,
    accumulate: bool,
    alpha: T,
    a: crate::scalar::MatRef<'_, T>,
    b: crate::scalar::MatRef<'_, T>,
) {
    fn view<'a, T>(m: crate::scalar::MatRef<'a, T>) -> MatRef<'a, T> {
        let view = MatRef::from_row_major_slice_with_stride(m.data, m.rows, m.cols, m.stride);
        if m.transposed { view.transpose() } else { view }
    }
    // Not `from_row_major_slice_with_stride_mut`: faer 0.24.4 swaps its strides and writes past the slice.
    let target = MatMut::from_column_major_slice_with_stride_mut(c.data, c.cols, c.rows, c.stride).transpose_mut();
    let accum = if accumulate { Accum::Add } else { Accum::Replace };
    matmul(target, accum, view(a), view(b), alpha, Par::Seq);
}

/// Factors of one matrix, and the buffers for solving with them.
struct Elimination<F> {
    n: usize,
    m: usize,
    /// `L` and `U` in columns.
    factors: Vec<F>,
    order: Vec<usize>,
    inverse_order: Vec<usize>,
    memory: MemBuffer,
}

impl<F: Scalar + RealField> Elimination<F> {
    fn new(n: usize, m: usize) -> Self {
        Self {
            n,
            m,
            factors: Vec::new(),
            order: vec![0; n],
            inverse_order: vec![0; n],
            memory: MemBuffer::new(StackReq::any_of(&[
                factor::lu_in_place_scratch::<usize, F>(n, n, Par::Seq, Spec::default()),
                solve::solve_in_place_scratch::<usize, F>(n, m, Par::Seq),
            ])),
        }
    }

    /// Factors a symmetric matrix: its rows are its columns.
    fn factor(&mut self, matrix: &[F]) {
        self.factors.clear();
        self.factors.extend_from_slice(matrix);
        let lu = MatMut::from_column_major_slice_mut(&mut self.factors, self.n, self.n);
        let stack = MemStack::new(&mut self.memory);
        factor::lu_in_place(lu, &mut self.order, &mut self.inverse_order, Par::Seq, stack, Spec::default());
    }

    /// Solves in place for `x`, `(n, m)`.
    fn solve(&mut self, x: &mut [F]) {
        let lu = MatRef::from_column_major_slice(&self.factors, self.n, self.n);
        let order = PermRef::new_checked(&self.order, &self.inverse_order, self.n);
        let x = MatMut::from_row_major_slice_mut(x, self.n, self.m);
        solve::solve_in_place(lu, lu, order, x, Par::Seq, MemStack::new(&mut self.memory));
    }

    /// Smallest pivot and largest element of `U`, absolutely.
    fn pivots(&self) -> (F, F) {
        let mut pivots = (F::infinity(), <F as Real>::zero());
        for (j, column) in self.factors.chunks_exact(self.n).enumerate() {
            let pivot = Real::abs(column[j]);
            // NaN counts as the smallest.
            pivots.0 = if pivot >= pivots.0 { pivots.0 } else { pivot };
            pivots.1 = largest(pivots.1, &column[..=j]);
        }
        pivots
    }
}

/// The largest of a bound and absolute elements.
#[inline(always)]
fn largest<F: Scalar>(bound: F, x: &[F]) -> F {
    x.iter().fold(bound, |bound, &x| if Real::abs(x) > bound { Real::abs(x) } else { bound })
}

/// Solves all systems, refining each once if necessary; returns the rows whose matrices must be examined.
pub(super) fn eliminate<F: Scalar + RealField>(
    n: usize,
    m: usize,
    matrices: &[F],
    right: Option<&[F]>,
    solutions: &mut [F],
) -> Vec<usize> {
    let zero = <F as Real>::zero();
    let mut elimination = Elimination::<F>::new(n, m);
    let (mut identity, mut x, mut step, mut doubtful) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    if right.is_none() {
        identity.resize(n * m, zero);
        identity.iter_mut().step_by(n + 1).for_each(|one| *one = <F as Real>::one());
    }
    for (row, (matrix, out)) in matrices.chunks_exact(n * n).zip(solutions.chunks_exact_mut(n * m)).enumerate() {
        let right = right.map_or(&identity[..], |right| &right[row * n * m..][..n * m]);
        elimination.factor(matrix);
        x.clear();
        x.extend_from_slice(right);
        elimination.solve(&mut x);
        let (smallest, growth, size) = vectorized(
            #[inline(always)]
            || {
                let (smallest, growth) = elimination.pivots();
                (smallest, growth, largest(zero, matrix))
            },
        );
        let harmless = is_harmless(smallest, growth, size);
        if !harmless {
            step.clear();
            step.extend_from_slice(right);
            residual(m, matrix, &x, &mut step);
            elimination.solve(&mut step);
            refine(m, &mut x, &step);
        }
        if identity.is_empty() {
            out.copy_from_slice(&x);
        } else {
            for (k, out) in out.iter_mut().enumerate() {
                *out = (x[k] + x[k % n * n + k / n]) * F::half();
            }
        }
        let finite = out.iter().all(|&x| Scalar::is_finite(x));
        if !(finite && (harmless || smallest > suspicious::<F>(n) * size)) {
            doubtful.push(row);
        }
    }
    doubtful
}

/// Subtracts `A X` from the right-hand sides.
fn residual<F: Scalar>(m: usize, matrix: &[F], x: &[F], right: &mut [F]) {
    vectorized(
        #[inline(always)]
        || {
            for (row, right) in matrix.chunks_exact(x.len() / m).zip(right.chunks_exact_mut(m)) {
                for (&a, x) in row.iter().zip(x.chunks_exact(m)) {
                    for (right, &x) in right.iter_mut().zip(x) {
                        *right = (-a).lane_fused(x, *right);
                    }
                }
            }
        },
    );
}

/// Adds the corrections of no more than half the size of their solutions.
fn refine<F: Scalar>(m: usize, x: &mut [F], step: &[F]) {
    let column =
        |x: &[F], c: usize| x.iter().skip(c).step_by(m).fold(<F as Real>::zero(), |size, &x| largest(size, &[x]));
    for c in 0..m {
        if column(step, c) <= F::half() * column(x, c) {
            x.iter_mut().zip(step).skip(c).step_by(m).for_each(|(x, &step)| *x += step);
        }
    }
}

/// Eigenvalues, ascending, and eigenvectors as rows (if requested) of one symmetric matrix; `NaN` if they are not found.
pub(super) fn eigh<F: Scalar + RealField>(n: usize, matrix: &[F], values: &mut [F], vectors: &mut [F]) {
    // Row-major and lower triangle: column-major and upper triangle of the same symmetric matrix.
    let matrix = MatRef::from_column_major_slice(matrix, n, n);
    if vectors.is_empty() {
        match matrix.self_adjoint_eigenvalues(Side::Lower) {
            Ok(found) => values.copy_from_slice(&found),
            Err(_) => values.fill(<F as Scalar>::nan()),
        }
        return;
    }
    match matrix.self_adjoint_eigen(Side::Lower) {
        Ok(found) => {
            for k in 0..n {
                values[k] = found.S()[k];
                for i in 0..n {
                    vectors[k * n + i] = found.U()[(i, k)];
                }
            }
        }
        Err(_) => values.fill(<F as Scalar>::nan()),
    }
}

/// [`singular`](super::singular()) of `all`, the columns of `n` of `m` numbers one after the other, finite, `m >= n`; `None` if faer gives up.
pub(super) fn singular(n: usize, m: usize, all: &[f64]) -> Option<Singular> {
    let matrix = MatRef::from_column_major_slice(all, m, n);
    let (mut values, mut right) = (Diag::<f64>::zeros(n), Mat::<f64>::zeros(n, n));
    let scratch = svd_scratch::<f64>(m, n, ComputeSvdVectors::No, ComputeSvdVectors::Full, Par::Seq, Spec::default());
    let mut memory = MemBuffer::new(scratch);
    let stack = MemStack::new(&mut memory);
    svd(matrix, values.as_mut(), None, Some(right.as_mut()), Par::Seq, stack, Spec::default()).ok()?;
    let order = (0..n).rev();
    Some(Singular {
        values: order.clone().map(|k| values[k]).collect(),
        vectors: order.map(|k| (0..n).map(|i| right[(i, k)]).collect()).collect(),
    })
}
