//! Condition numbers, and when a matrix counts as singular.

use super::batch::{Dense, LANES};
use super::thresholds::REGULAR_SHARE;
use super::{LinalgError, Workspace, eigen, elimination, expect_length, large_systems};
use crate::scalar::{Real, Scalar, vectorized};
use alloc::vec::Vec;

/// 2-norm condition number `max |w| / min |w|` of one symmetric `(n, n)` matrix; infinite if exactly singular.
///
/// # Errors
/// [`LinalgError::Shape`]; [`LinalgError::NotFinite`] (row 0) for an infinity or a `NaN`.
pub fn condition_number<S: Scalar>(n: usize, matrix: &[S], workspace: &mut Workspace<S>) -> Result<f64, LinalgError> {
    expect_length("matrix", n * n, matrix.len())?;
    if matrix.iter().any(|m| !m.is_finite()) {
        return Err(LinalgError::NotFinite { row: 0 });
    }
    Ok(condition_2(n, matrix, &mut workspace.second.dense))
}

/// [`condition_number`] of a finite matrix.
pub(super) fn condition_2<S: Scalar>(n: usize, matrix: &[S], scratch: &mut Dense<S>) -> f64 {
    scratch.load(matrix);
    let (least, most) = scratch.extreme_eigenvalues(n);
    if least > <S as Real>::zero() { (most / least).to_f64() } else { f64::INFINITY }
}

/// `true` if a finite symmetric matrix has a condition number above `1/eps`, as given and scaled to rows of size 1
/// (Bunch 1971).
///
/// The scaling is by powers of two on both sides: a choice of units cannot make a matrix singular. It may spoil a well-conditioned
/// indefinite matrix, so both are tested. Eigenvalues are computed only where the Frobenius norms of matrix and inverse, whose product
/// bounds the condition number, do not settle it.
pub(super) fn is_singular<S: Scalar>(n: usize, matrix: &[S], scratch: &mut Dense<S>) -> bool {
    scratch.load(matrix);
    if scratch.bounded(n) {
        return false;
    }
    if !scratch.equilibrate(n) {
        return true;
    }
    if scratch.bounded(n) {
        return false;
    }
    let (least, most) = scratch.extreme_eigenvalues(n);
    if least > S::epsilon() * most {
        return false;
    }
    scratch.load(matrix);
    let (least, most) = scratch.extreme_eigenvalues(n);
    // Not finite counts as singular.
    let regular = least > S::epsilon() * most;
    !regular
}

/// Powers of two `s_i` for which `s_i a_ij s_j` has rows of size 1 (Bunch 1971), one after the other; `false` where a
/// row is zero.
///
/// `1/s_i = max(sqrt |a_ii|, s_j |a_ij| for j < i)`; the lower triangle is read.
fn equilibration<S: Scalar>(n: usize, a: &[S], scale: &mut Vec<S>) -> bool {
    let zero = <S as Real>::zero();
    scale.clear();
    for i in 0..n {
        let mut size = a[i * n + i].abs().sqrt();
        for (j, &s) in scale.iter().enumerate() {
            let bound: S = s * a[i * n + j].abs();
            size = if bound > size { bound } else { size };
        }
        if size == zero {
            size = a[i * n..(i + 1) * n].iter().fold(zero, |m, x| if x.abs() > m { x.abs() } else { m });
        }
        if size == zero {
            return false;
        }
        scale.push(<S as Real>::one().ldexp(-size.ilogb()));
    }
    true
}

impl<S: Scalar> Dense<S> {
    /// Copies a matrix in.
    fn load(&mut self, matrix: &[S]) {
        self.matrix.clear();
        self.matrix.extend_from_slice(matrix);
    }

    /// Scales rows and columns of the loaded matrix to size 1; `false` where a row is zero.
    fn equilibrate(&mut self, n: usize) -> bool {
        let Self { matrix: a, scale, .. } = self;
        if !equilibration(n, a, scale) {
            return false;
        }
        for i in 0..n {
            for j in 0..n {
                a[i * n + j] = a[i * n + j] * scale[i] * scale[j];
            }
        }
        true
    }

    /// `true` if `|A|_F |A^-1|_F` of the loaded matrix is below `1/eps` by a factor of four, room for rounding.
    ///
    /// The columns of the inverse are spread over the lanes.
    fn bounded(&mut self, n: usize) -> bool {
        let m = n.div_ceil(LANES);
        let width = n + m;
        let system = self.lanes.lanes::<LANES>(n * width);
        let (zero, one) = (<S as Real>::zero(), <S as Real>::one());
        let matrix = &self.matrix;
        let mut squares = [0.0; LANES];
        vectorized(
            #[inline(always)]
            || {
                for i in 0..n {
                    for j in 0..n {
                        system[i * width + j] = [matrix[i * n + j]; LANES];
                    }
                    system[i * width + n..(i + 1) * width].fill([zero; LANES]);
                    system[i * width + n + i / LANES][i % LANES] = one;
                }
                elimination::solve((n, m), system);
                for i in 0..n {
                    for c in 0..m {
                        for l in 0..LANES {
                            let x = system[i * width + n + c][l].to_f64();
                            squares[l] += x * x;
                        }
                    }
                }
            },
        );
        let own: f64 = matrix.iter().map(|x| x.to_f64() * x.to_f64()).sum();
        let condition = (own * squares.iter().sum::<f64>()).sqrt();
        condition * S::epsilon().to_f64() < REGULAR_SHARE
    }

    /// Smallest and largest absolute eigenvalue of the loaded matrix.
    fn extreme_eigenvalues(&mut self, n: usize) -> (S, S) {
        let mut values = vec![S::nan(); n];
        if !large_systems::eigh(n, &self.matrix, &mut values, &mut []) {
            eigen::decompose::<S, 1>(n, &self.matrix, &mut values, &mut [], (0, 1), &mut self.lanes);
        }
        values.iter().fold((S::infinity(), <S as Real>::zero()), |(least, most), w| {
            let w = w.abs();
            (if w >= least { least } else { w }, if w <= most { most } else { w })
        })
    }
}
