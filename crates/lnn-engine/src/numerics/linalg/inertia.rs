//! Signs of the eigenvalues without the eigenvalues; determinants of the leading blocks and their gradients, without overflow.

use super::thresholds::MOST_BALANCING_ROUNDS;
use super::{LinalgError, Workspace, eigh, expect_length};
use crate::scalar::{Real, Scalar};
use alloc::vec::Vec;

/// Numbers of positive, zero and negative eigenvalues (Sylvester's law: invariant under congruence).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Inertia {
    /// Positive eigenvalues.
    pub positive: usize,
    /// Eigenvalues indistinguishable from zero.
    pub zero: usize,
    /// Negative eigenvalues.
    pub negative: usize,
}

/// `true` if every pivot of `M = L D L^T` without exchanges is positive.
///
/// `scratch` holds `n^2` numbers. Wrong only where an eigenvalue is within rounding of zero; `false` for `NaN`.
#[inline]
pub fn is_positive_definite<S: Scalar>(n: usize, matrix: &[S], scratch: &mut [S]) -> bool {
    let zero = <S as Real>::zero();
    let a = &mut scratch[..n * n];
    a.copy_from_slice(&matrix[..n * n]);
    for k in 0..n {
        let pivot = a[k * n + k];
        if !(pivot > zero && pivot.is_finite()) {
            return false;
        }
        for i in k + 1..n {
            let factor = a[i * n + k] / pivot;
            for j in k + 1..=i {
                let update = factor * a[j * n + k];
                a[i * n + j] -= update;
            }
        }
    }
    true
}

/// Inertia of one symmetric `(n, n)` matrix from the pivots of `P M P^T = L D L^T` with complete pivoting, blocks of
/// 1x1 and 2x2 (Bunch and Parlett 1971).
///
/// Signs are right for every eigenvalue larger than rounding, even with zero diagonals, tiny pivots and coordinates in very different
/// units: rows and columns are first scaled to largest elements near 1, which preserves the inertia (Sylvester). A remainder below `2 n
/// eps` of that counts as zero. Reads the lower triangle; `scratch` holds `n^2` numbers.
///
/// # Errors
/// [`LinalgError::Shape`]; [`LinalgError::NotFinite`] (row 0) for an infinity or a `NaN`.
pub fn inertia<S: Scalar>(n: usize, matrix: &[S], scratch: &mut [S]) -> Result<Inertia, LinalgError> {
    expect_length("matrix", n * n, matrix.len())?;
    if scratch.len() < n * n {
        return Err(LinalgError::Shape { what: "scratch", expected: n * n, found: scratch.len() });
    }
    if matrix.iter().any(|m| !m.is_finite()) {
        return Err(LinalgError::NotFinite { row: 0 });
    }
    let (zero, one) = (<S as Real>::zero(), <S as Real>::one());
    let a = &mut scratch[..n * n];
    a.copy_from_slice(matrix);
    let largest = a.iter().fold(zero, |m, x| if x.abs() > m { x.abs() } else { m });
    let mut found = Inertia::default();
    if largest == zero {
        found.zero = n;
        return Ok(found);
    }
    // Scaled near 1, so that products of pivots neither overflow nor vanish.
    let exponent = largest.ilogb();
    a.iter_mut().for_each(|x| *x = x.ldexp(-exponent));
    balance(n, a);
    let floor = S::epsilon() * S::of_f64(2.0 * n as f64);
    // (1 + sqrt 17) / 8 bounds the growth.
    let alpha = (one + S::of_f64(17.0).sqrt()) / S::of_f64(8.0);
    let mut k = 0;
    while k < n {
        let [(diagonal, p, _), (off, r, s)] = largest_elements(n, a, k);
        if diagonal <= floor && off <= floor {
            found.zero += n - k;
            break;
        }
        if diagonal >= alpha * off {
            exchange(n, a, k, p);
            if a[k * n + k] > zero {
                found.positive += 1;
            } else {
                found.negative += 1;
            }
            eliminate_one(n, a, k);
            k += 1;
        } else {
            // A 2x2 block whose determinant is negative: one eigenvalue of each sign. s < r.
            exchange(n, a, k, s);
            exchange(n, a, k + 1, r);
            found.positive += 1;
            found.negative += 1;
            eliminate_two(n, a, k);
            k += 2;
        }
    }
    Ok(found)
}

/// The largest sizes on the diagonal and below it, each with its row and column, from row `k`.
#[inline]
fn largest_elements<S: Scalar>(n: usize, a: &[S], k: usize) -> [(S, usize, usize); 2] {
    let mut diagonal = (<S as Real>::zero(), k, k);
    let mut off = diagonal;
    for i in k..n {
        for j in k..=i {
            let size = a[i * n + j].abs();
            if i == j && size > diagonal.0 {
                diagonal = (size, i, i);
            } else if i != j && size > off.0 {
                off = (size, i, j);
            }
        }
    }
    [diagonal, off]
}

/// Eliminates row `k` by its pivot.
#[inline]
fn eliminate_one<S: Scalar>(n: usize, a: &mut [S], k: usize) {
    let pivot = a[k * n + k];
    for i in k + 1..n {
        let factor = a[i * n + k] / pivot;
        for j in k + 1..=i {
            let update = factor * a[j * n + k];
            a[i * n + j] -= update;
        }
    }
}

/// Eliminates rows `k` and `k + 1` by their block.
#[inline]
fn eliminate_two<S: Scalar>(n: usize, a: &mut [S], k: usize) {
    let (d, b, e) = (a[k * n + k], a[(k + 1) * n + k], a[(k + 1) * n + k + 1]);
    // Divided by b twice: no overflow, and d e / b^2 <= alpha^2 < 1.
    let (x, y) = (d / b, e / b);
    let scale = (b * (x * y - <S as Real>::one())).recip();
    for i in k + 2..n {
        let (u, w) = (a[i * n + k], a[i * n + k + 1]);
        let (first, second) = ((y * u - w) * scale, (x * w - u) * scale);
        for j in k + 2..=i {
            let update = first * a[j * n + k] + second * a[j * n + k + 1];
            a[i * n + j] -= update;
        }
    }
}

/// Multiplies rows and columns of a symmetric matrix, in its lower triangle, by powers of two until the largest element
/// of each row is near 1 (Ruiz 2001, one row after the other).
fn balance<S: Scalar>(n: usize, a: &mut [S]) {
    let zero = <S as Real>::zero();
    let lowest = S::min_positive().ilogb();
    for _ in 0..MOST_BALANCING_ROUNDS {
        let mut balanced = true;
        for i in 0..n {
            let place = |j: usize| if j < i { i * n + j } else { j * n + i };
            let size = (0..n).map(|j| a[place(j)].abs()).fold(zero, |m, x| if x > m { x } else { m });
            let shift = if size == zero { 0 } else { size.ilogb().max(lowest).div_euclid(2) };
            if shift == 0 {
                continue;
            }
            balanced = false;
            let factor = <S as Real>::one().ldexp(-shift);
            for j in 0..n {
                a[place(j)] *= factor;
            }
            a[i * n + i] *= factor;
        }
        if balanced {
            break;
        }
    }
}

/// Exchanges rows and columns `i <= j` of a symmetric matrix in its lower triangle.
fn exchange<S: Scalar>(n: usize, a: &mut [S], i: usize, j: usize) {
    if i == j {
        return;
    }
    let mut at = |x: usize, y: usize, z: usize, w: usize| a.swap(x * n + y, z * n + w);
    at(i, i, j, j);
    for k in 0..i {
        at(i, k, j, k);
    }
    for k in i + 1..j {
        at(k, i, j, k);
    }
    for k in j + 1..n {
        at(k, i, k, j);
    }
}

/// `mantissa * 2^exponent` with `1 <= |mantissa| < 2`, or zero.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scaled<S> {
    /// Sign and leading digits.
    pub mantissa: S,
    /// Power of two.
    pub exponent: i64,
}

impl<S: Scalar> Scaled<S> {
    /// 1.
    pub fn one() -> Self {
        Self { mantissa: <S as Real>::one(), exponent: 0 }
    }
    /// A number in scaled form.
    pub fn new(value: S) -> Self {
        Self::one().times(value)
    }
    /// The product with a number.
    pub fn times(self, factor: S) -> Self {
        let product = |x: S, exponent: i64| {
            if x == <S as Real>::zero() || !x.is_finite() {
                return Self { mantissa: x, exponent: 0 };
            }
            let shift = x.ilogb();
            Self { mantissa: x.ldexp(-shift), exponent: exponent + i64::from(shift) }
        };
        let factor = product(factor, 0);
        product(self.mantissa * factor.mantissa, self.exponent + factor.exponent)
    }
    /// The quotient by a number.
    pub fn over(self, divisor: S) -> Self {
        let divisor = Self::new(divisor);
        let quotient = Self::new(self.mantissa / divisor.mantissa);
        Self { exponent: quotient.exponent + self.exponent - divisor.exponent, ..quotient }
    }
    /// As a plain number: rounds to infinity or zero outside its range.
    pub fn value(self) -> S {
        let exponent = self.exponent.clamp(-8192, 8192) as i32;
        // In steps, so that no power of two overflows on the way.
        let step = exponent / 8;
        let rest = exponent - 7 * step;
        (0..7).fold(self.mantissa.ldexp(rest), |x, _| x.ldexp(step))
    }
}

/// Determinants of the leading `k` by `k` blocks, `k = 1..=n`, of one symmetric matrix, pushed to `minors`.
///
/// Signs are exact if the determinant exceeds rounding. Cost `O(n^3)` for a positive definite matrix, whose pivots need no exchanges; from
/// the first pivot that is not comfortably positive, one pivoted factorisation per block.
///
/// # Errors
/// [`LinalgError::Shape`]; [`LinalgError::NotFinite`] (row 0) for an infinity or a `NaN`.
pub fn leading_minors<S: Scalar>(
    n: usize,
    matrix: &[S],
    minors: &mut Vec<Scaled<S>>,
    workspace: &mut Workspace<S>,
) -> Result<(), LinalgError> {
    expect_length("matrix", n * n, matrix.len())?;
    if matrix.iter().any(|m| !m.is_finite()) {
        return Err(LinalgError::NotFinite { row: 0 });
    }
    minors.clear();
    let scratch = &mut workspace.minors.block;
    scratch.clear();
    scratch.extend_from_slice(matrix);
    positive_pivots(n, scratch, minors);
    for k in minors.len() + 1..=n {
        scratch.clear();
        scratch.extend((0..k).flat_map(|i| matrix[i * n..i * n + k].iter().copied()));
        minors.push(determinant(k, scratch));
    }
    Ok(())
}

/// Pushes the minors up to the last that follows from comfortably positive pivots without exchanges.
fn positive_pivots<S: Scalar>(n: usize, a: &mut [S], minors: &mut Vec<Scaled<S>>) {
    let floor = S::epsilon().sqrt();
    let mut product = Scaled::one();
    for k in 0..n {
        let mut pivot = a[k * n + k];
        let diagonal = pivot;
        for j in 0..k {
            // Row k of L D and of L.
            let mut sum = a[k * n + j];
            for i in 0..j {
                sum -= a[k * n + i] * a[j * n + i];
            }
            a[k * n + j] = sum;
        }
        for j in 0..k {
            let scaled = a[k * n + j];
            let unit = scaled / a[j * n + j];
            pivot -= scaled * unit;
            a[k * n + j] = unit;
        }
        let comfortable = pivot > floor * diagonal;
        if !comfortable {
            return;
        }
        a[k * n + k] = pivot;
        product = product.times(pivot);
        minors.push(product);
    }
}

/// Determinant by LU with partial pivoting; the matrix is destroyed.
fn determinant<S: Scalar>(n: usize, a: &mut [S]) -> Scaled<S> {
    let zero = <S as Real>::zero();
    let mut product = Scaled::<S>::one();
    for k in 0..n {
        let mut p = k;
        for i in k + 1..n {
            if a[i * n + k].abs() > a[p * n + k].abs() {
                p = i;
            }
        }
        if p != k {
            for j in k..n {
                a.swap(k * n + j, p * n + j);
            }
            product.mantissa = -product.mantissa;
        }
        let pivot = a[k * n + k];
        product = product.times(pivot);
        if pivot == zero {
            return product;
        }
        for i in k + 1..n {
            let factor = a[i * n + k] / pivot;
            for j in k + 1..n {
                let update = factor * a[k * n + j];
                a[i * n + j] -= update;
            }
        }
    }
    product
}

/// Gradient of the determinant of one symmetric `(n, n)` matrix: its adjugate, right at singular matrices too.
///
/// `d det M / d M_ij = adj(M)_ij = sum_k (prod_{l != k} w_l) u_k u_k^T`. `gradient` receives mantissas, to be
/// multiplied by 2 to the returned exponent.
///
/// # Errors
/// As [`eigh`].
pub fn adjugate<S: Scalar>(
    n: usize,
    matrix: &[S],
    gradient: &mut [S],
    workspace: &mut Workspace<S>,
) -> Result<i64, LinalgError> {
    expect_length("matrix", n * n, matrix.len())?;
    expect_length("gradient", n * n, gradient.len())?;
    let zero = <S as Real>::zero();
    let mut scratch = core::mem::take(&mut workspace.minors);
    scratch.values.resize(n, zero);
    scratch.vectors.resize(n * n, zero);
    let (values, vectors) = (&mut scratch.values[..n], &mut scratch.vectors[..n * n]);
    let outcome = eigh(n, matrix, values, vectors, workspace).map(|()| sum_adjugate(n, values, vectors, gradient));
    workspace.minors = scratch;
    outcome
}

/// [`adjugate`] from eigenvalues and eigenvectors.
fn sum_adjugate<S: Scalar>(n: usize, values: &[S], vectors: &[S], gradient: &mut [S]) -> i64 {
    let zero = <S as Real>::zero();
    let product = |k: usize| (0..n).filter(|&l| l != k).fold(Scaled::one(), |product, l| product.times(values[l]));
    let exponent = (0..n).map(product).filter(|p| p.mantissa != zero).map(|p| p.exponent).max().unwrap_or(0);
    gradient.fill(zero);
    for k in 0..n {
        let product = product(k);
        let weight = Scaled { exponent: product.exponent - exponent, ..product }.value();
        let u = &vectors[k * n..(k + 1) * n];
        for i in 0..n {
            for j in 0..n {
                gradient[i * n + j] += weight * (u[i] * u[j]);
            }
        }
    }
    exponent
}
