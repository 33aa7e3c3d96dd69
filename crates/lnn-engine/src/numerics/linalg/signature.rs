//! Value and gradient of the penalties of single mass matrices.
//!
//! A gradient by the elements of `M` is given as `G = sum_k gamma_k u_k u_k^T`: each term is one symmetric jet of the adjoint identity. A
//! matrix of the right signature has no term and needs no spectrum: its pivots show it.

use super::thresholds::PENALTY_FLOOR;
use crate::linalg::{LinalgError, Scaled, Workspace, adjugate, eigh, inertia, is_positive_definite, leading_minors};
use crate::scalar::{Real, Scalar};
use alloc::vec::Vec;

/// A penalty of one matrix and its gradient; buffers are reused from matrix to matrix.
#[derive(Clone, Debug, Default)]
pub struct Violation<S> {
    /// The penalty without its weight.
    pub value: S,
    /// Weights `gamma_k` of the gradient's terms.
    pub gamma: Vec<S>,
    /// Vectors `u_k`, `(terms, n)`.
    pub vectors: Vec<S>,
}

impl<S: Scalar> Violation<S> {
    fn clear(&mut self) {
        self.value = <S as Real>::zero();
        self.gamma.clear();
        self.vectors.clear();
    }
}

/// Scratch memory of the penalties of a mass matrix.
#[derive(Debug)]
pub struct SignatureBuffers<S> {
    block: Vec<S>,
    scaling: Vec<S>,
    gradient: Vec<S>,
    leading: Vec<S>,
    adjugate: Vec<S>,
    values: Vec<S>,
    vectors: Vec<S>,
    minors: Vec<Scaled<S>>,
    workspace: Workspace<S>,
}

impl<S: Scalar> Default for SignatureBuffers<S> {
    fn default() -> Self {
        Self {
            block: Vec::new(),
            scaling: Vec::new(),
            gradient: Vec::new(),
            leading: Vec::new(),
            adjugate: Vec::new(),
            values: Vec::new(),
            vectors: Vec::new(),
            minors: Vec::new(),
            workspace: Workspace::new(),
        }
    }
}

/// Characteristic scales `c_i`: the lower median of `|M_ii|` over a batch, `diagonals` `(batch, n)`; index
/// `(batch - 1)/2` of the ascending order, `NaN` last.
pub fn characteristic_scales<S: Scalar>(n: usize, diagonals: &[S]) -> Vec<S> {
    let batch = diagonals.len() / n;
    if batch == 0 {
        return vec![<S as Real>::zero(); n];
    }
    let order = |a: &S, b: &S| a.partial_cmp(b).unwrap_or_else(|| a.is_nan().cmp(&b.is_nan()));
    let mut column = Vec::with_capacity(batch);
    (0..n)
        .map(|i| {
            column.clear();
            column.extend(diagonals.iter().skip(i).step_by(n).map(|&m| Real::abs(m)));
            *column.select_nth_unstable_by((batch - 1) / 2, order).1
        })
        .collect()
}

/// `true` if `M`, `(n, n)`, is positive definite, or with a time-like coordinate `M_tt < 0` and the rest positive definite.
///
/// `false` also where rounding leaves it open.
pub fn has_signature<S: Scalar>(
    n: usize,
    matrix: &[S],
    time: Option<usize>,
    buffers: &mut SignatureBuffers<S>,
) -> bool {
    buffers.gradient.resize(n * n, <S as Real>::zero());
    match time {
        None => is_positive_definite(n, matrix, &mut buffers.gradient),
        Some(t) => {
            buffers.block.clear();
            buffers.block.extend(spatial(n, t).flat_map(|i| spatial(n, t).map(move |j| matrix[i * n + j])));
            matrix[t * n + t] < <S as Real>::zero()
                && is_positive_definite(n - 1, &buffers.block, &mut buffers.gradient)
        }
    }
}

/// All coordinates but one.
fn spatial(n: usize, time: usize) -> impl Iterator<Item = usize> {
    (0..n).filter(move |&i| i != time)
}

/// `sum_i relu(-w_i)` over the eigenvalues `w_i` of `M`, `(n, n)`, with `G = -sum over w_i < 0 of u_i u_i^T`.
///
/// Exact at repeated eigenvalues, where any basis of their space gives the same sum.
///
/// # Errors
/// A matrix that is not finite.
pub fn eigenvalue_violation<S: Scalar>(
    n: usize,
    matrix: &[S],
    buffers: &mut SignatureBuffers<S>,
    found: &mut Violation<S>,
) -> Result<(), LinalgError> {
    found.clear();
    if has_signature(n, matrix, None, buffers) {
        return Ok(());
    }
    let (zero, one) = (<S as Real>::zero(), <S as Real>::one());
    buffers.values.resize(n, zero);
    buffers.vectors.resize(n * n, zero);
    eigh(n, matrix, &mut buffers.values, &mut buffers.vectors, &mut buffers.workspace)?;
    for (&w, u) in buffers.values.iter().zip(buffers.vectors.chunks_exact(n)).take_while(|(w, _)| **w < zero) {
        found.value -= w;
        found.gamma.push(-one);
        found.vectors.extend_from_slice(u);
    }
    Ok(())
}

/// `true` if `M`, `(n, n)`, has one negative eigenvalue and otherwise positive ones; `false` if rounding leaves it open.
pub fn has_one_negative<S: Scalar>(n: usize, matrix: &[S], buffers: &mut SignatureBuffers<S>) -> bool {
    buffers.gradient.resize(n * n, <S as Real>::zero());
    inertia(n, matrix, &mut buffers.gradient).is_ok_and(|found| found.negative == 1 && found.zero == 0)
}

/// `relu(w_1) + sum_(k > 1) relu(-w_k)` over the eigenvalues `w_1 <= w_2 <= ..` of `D M D`, `M` of shape `(n, n)`, `D` diagonal with
/// `(c_i + eps)^(-1/2)` of the characteristic scales `c`, `(n)`.
///
/// Eigenvalues of `D M D` have the signs of those of `M` (Sylvester's law of inertia), and sizes near 1 whatever the units of the
/// coordinates and the factor of `M` are. With the eigenvectors `u_k` the gradient is `G = sum_k +-(D u_k)(D u_k)^T`. The value is 0 for
/// one negative eigenvalue and `n - 1` positive ones, and above 0 for every other regular matrix.
///
/// # Errors
/// A matrix that is not finite.
pub fn one_negative_violation<S: Scalar>(
    n: usize,
    matrix: &[S],
    scales: &[S],
    buffers: &mut SignatureBuffers<S>,
    found: &mut Violation<S>,
) -> Result<(), LinalgError> {
    found.clear();
    if has_one_negative(n, matrix, buffers) {
        return Ok(());
    }
    let (zero, one) = (<S as Real>::zero(), <S as Real>::one());
    let SignatureBuffers { block, scaling, values, vectors, workspace, .. } = buffers;
    scaling.clear();
    scaling.extend(scales.iter().map(|&c| (c + S::of_f64(PENALTY_FLOOR)).sqrt().recip()));
    block.clear();
    // Scaled on one side first: two scales may lie at opposite ends of the range.
    block.extend(matrix.iter().enumerate().map(|(k, &m)| (m * scaling[k / n]) * scaling[k % n]));
    values.resize(n, zero);
    vectors.resize(n * n, zero);
    eigh(n, block, values, vectors, workspace)?;
    for (k, (&w, u)) in values.iter().zip(vectors.chunks_exact(n)).enumerate() {
        if (w > zero) == (k > 0) || w == zero {
            continue;
        }
        found.value += w.abs();
        found.gamma.push(if k == 0 { one } else { -one });
        found.vectors.extend(u.iter().zip(scaling.iter()).map(|(&u, &d)| u * d));
    }
    Ok(())
}

/// Sylvester's criterion on `M`, `(n, n)`, with characteristic scales `c`, `(n)`; formula in
/// `Penalty::Sylvester`.
///
/// With `D = diag(c_i^(-1/2))`, `det M_k / (s_k + eps) = det (D M D)_k / (1 + eps/s_k)`: minors are taken of the scaled
/// matrix. The gradient of a minor is its adjugate, also where the minor is singular.
///
/// # Errors
/// A matrix that is not finite.
pub fn sylvester_violation<S: Scalar>(
    n: usize,
    matrix: &[S],
    scales: &[S],
    time: Option<usize>,
    buffers: &mut SignatureBuffers<S>,
    found: &mut Violation<S>,
) -> Result<(), LinalgError> {
    found.clear();
    if has_signature(n, matrix, time, buffers) {
        return Ok(());
    }
    let (zero, one) = (<S as Real>::zero(), <S as Real>::one());
    if let Some(t) = time
        && matrix[t * n + t] > zero
    {
        let gamma = (scales[t] + S::of_f64(PENALTY_FLOOR)).recip();
        found.value += gamma * matrix[t * n + t];
        found.gamma.push(gamma);
        found.vectors.extend((0..n).map(|i| if i == t { one } else { zero }));
    }
    let axes = || (0..n).filter(|&i| Some(i) != time);
    let m = axes().count();
    let SignatureBuffers { block, scaling, .. } = buffers;
    scaling.clear();
    scaling.extend(axes().map(|i| if scales[i] > zero { scales[i].sqrt().recip() } else { one }));
    block.clear();
    for (i, &d) in axes().zip(scaling.iter()) {
        // Scaled on one side first: c_i and c_j may lie at opposite ends of the range.
        block.extend(axes().zip(scaling.iter()).map(|(j, &e)| (matrix[i * n + j] * d) * e));
    }
    minor_violations(m, || axes().map(|i| scales[i]), buffers, found)?;
    let SignatureBuffers { gradient, values, vectors, scaling, workspace, .. } = buffers;
    if gradient.iter().all(|g| *g == zero) {
        return Ok(());
    }
    values.resize(m, zero);
    vectors.resize(m * m, zero);
    eigh(m, gradient, values, vectors, workspace)?;
    for (&gamma, u) in values.iter().zip(vectors.chunks_exact(m)).filter(|(gamma, _)| **gamma != zero) {
        found.gamma.push(gamma);
        let mut scaled = u.iter().zip(scaling.iter()).map(|(&u, &d)| u * d);
        found.vectors.extend((0..n).map(|i| if Some(i) == time { None } else { scaled.next() }.unwrap_or(zero)));
    }
    Ok(())
}

/// Adds the violations of the leading minors of `buffers.block` to the value, and stores their gradient, by the block's elements, in
/// `buffers.gradient`.
fn minor_violations<S: Scalar, I: Iterator<Item = S>>(
    m: usize,
    scales: impl Fn() -> I,
    buffers: &mut SignatureBuffers<S>,
    found: &mut Violation<S>,
) -> Result<(), LinalgError> {
    let (zero, one) = (<S as Real>::zero(), <S as Real>::one());
    let SignatureBuffers { block, gradient, leading, adjugate: adjoint, minors, workspace, .. } = buffers;
    gradient.clear();
    gradient.resize(m * m, zero);
    leading_minors(m, block, minors, workspace)?;
    // eps / s_k; its part eps / (product of the scales that are not zero) replaces 1/(s_k + eps) where a scale is zero.
    let mut ratio = Scaled::new(S::of_f64(PENALTY_FLOOR));
    let mut vanishes = false;
    for (k, (minor, c)) in minors.iter().zip(scales()).enumerate() {
        let size = k + 1;
        if c > zero {
            ratio = ratio.over(c);
        } else {
            vanishes = true;
        }
        if minor.mantissa >= zero {
            continue;
        }
        let factor = if vanishes { ratio.value().recip() } else { (one + ratio.value()).recip() };
        found.value -= factor * minor.value();
        leading.clear();
        leading.extend((0..size).flat_map(|i| block[i * m..i * m + size].iter().copied()));
        adjoint.resize(size * size, zero);
        let exponent = adjugate(size, leading, adjoint, workspace)?;
        let unit = Scaled { mantissa: one, exponent }.value();
        for (i, row) in adjoint.chunks_exact(size).enumerate() {
            for (g, &a) in gradient[i * m..].iter_mut().zip(row) {
                *g -= factor * (unit * a);
            }
        }
    }
    Ok(())
}
