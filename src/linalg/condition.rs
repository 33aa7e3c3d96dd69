//! Condition numbers, and when a matrix counts as singular.

use super::batch::Dense;
use super::error::{LinalgError, expect_length};
use super::{Workspace, jacobi, large};
use crate::scalar::{Real, Scalar};

/// 2-norm condition number `max |w| / min |w|` of one symmetric `(n, n)` matrix; infinite if exactly singular.
///
/// # Errors
/// [`LinalgError::Shape`]; [`LinalgError::NotFinite`] (row 0) for an infinity or a `NaN`.
pub fn condition_number<S: Scalar>(n: usize, matrix: &[S], workspace: &mut Workspace<S>) -> Result<f64, LinalgError> {
    expect_length("matrix", n * n, matrix.len())?;
    if matrix.iter().any(|m| !m.is_finite()) {
        return Err(LinalgError::NotFinite { row: 0 });
    }
    Ok(condition_2(n, matrix, &mut workspace.dense))
}

/// [`condition_number`] of a finite matrix.
pub(super) fn condition_2<S: Scalar>(n: usize, matrix: &[S], scratch: &mut Dense<S>) -> f64 {
    scratch.load(matrix);
    let (least, most) = scratch.extreme_eigenvalues(n);
    if least > <S as Real>::zero() { (most / least).to_f64() } else { f64::INFINITY }
}

/// Whether a finite symmetric matrix has a condition number above `1/eps`, as given and scaled to rows of size 1
/// (Bunch 1971).
///
/// The scaling is by powers of two on both sides: a choice of units cannot make a matrix singular. It may spoil a
/// well-conditioned indefinite matrix, therefore both are asked.
pub(super) fn is_singular<S: Scalar>(n: usize, matrix: &[S], scratch: &mut Dense<S>) -> bool {
    scratch.load(matrix);
    let (least, most) = scratch.extreme_eigenvalues(n);
    if least > S::EPSILON * most {
        return false;
    }
    scratch.load(matrix);
    let Dense { matrix: a, scale } = scratch;
    scale.clear();
    let zero = <S as Real>::zero();
    for i in 0..n {
        // 1/s_i = max(sqrt |a_ii|, s_j |a_ij| for j < i), as a power of two.
        let mut size = a[i * n + i][0].abs().sqrt();
        for (j, &s) in scale.iter().enumerate() {
            let bound: S = s * a[i * n + j][0].abs();
            size = if bound > size { bound } else { size };
        }
        if size == zero {
            size = a[i * n..(i + 1) * n].iter().fold(zero, |m, x| if x[0].abs() > m { x[0].abs() } else { m });
        }
        if size == zero {
            return true;
        }
        scale.push(<S as Real>::one().ldexp(-size.ilogb()));
    }
    for i in 0..n {
        for j in 0..n {
            a[i * n + j][0] = a[i * n + j][0] * scale[i] * scale[j];
        }
    }
    let (least, most) = scratch.extreme_eigenvalues(n);
    // Not finite counts as singular.
    let regular = least > S::EPSILON * most;
    !regular
}

impl<S: Scalar> Dense<S> {
    /// Copies a matrix in.
    pub(super) fn load(&mut self, matrix: &[S]) {
        self.matrix.clear();
        self.matrix.extend(matrix.iter().map(|&m| [m]));
    }

    /// Smallest and largest absolute eigenvalue of the loaded matrix, which is destroyed.
    fn extreme_eigenvalues(&mut self, n: usize) -> (S, S) {
        let mut values = if large::serves::<S>(n) {
            let matrix: Vec<S> = self.matrix.iter().map(|m| m[0]).collect();
            let mut values = vec![S::NAN; n];
            large::eigh(n, &matrix, &mut values, &mut []);
            values
        } else {
            let exponents = jacobi::rescale(&mut self.matrix);
            jacobi::diagonalize(n, &mut self.matrix, &mut []);
            (0..n).map(|i| self.matrix[i * n + i][0].ldexp(exponents[0])).collect()
        };
        values.iter_mut().for_each(|w| *w = w.abs());
        values.iter().fold((S::INFINITY, <S as Real>::zero()), |(least, most), &w| {
            (if w >= least { least } else { w }, if w <= most { most } else { w })
        })
    }
}
