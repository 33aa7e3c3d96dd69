//! Mass matrices that are not nearly singular.

use super::thresholds::MOST_MASS_CONDITION;
use crate::linalg::{self, Workspace};

/// `true` if most of the symmetric matrices `(n, n)`, with rows and columns scaled to size 1, have a condition number below
/// [`MOST_MASS_CONDITION`].
pub(super) fn is_regular(n: usize, matrices: &[f64]) -> bool {
    let mut scaled = matrices.to_vec();
    for matrix in scaled.chunks_exact_mut(n * n) {
        // The largest element of each row of a positive definite matrix is then on the diagonal; others need not have a diagonal.
        for _ in 0..3 {
            let size = |i: usize| matrix[i * n..(i + 1) * n].iter().fold(0.0, |most: f64, x| most.max(x.abs())).sqrt();
            let sizes: Vec<f64> = (0..n).map(size).collect();
            matrix.iter_mut().enumerate().for_each(|(at, x)| *x /= sizes[at / n] * sizes[at % n]);
        }
    }
    let mut values = vec![0.0; scaled.len() / n];
    // Matrices that fail are NaN.
    let _ = linalg::eigenvalues(n, &scaled, &mut values, &mut Workspace::new());
    let regular = values.chunks_exact(n).filter(|values| {
        let sizes = || values.iter().map(|x| x.abs());
        let (least, most) = (sizes().fold(f64::INFINITY, f64::min), sizes().fold(0.0, f64::max));
        values.iter().all(|x| x.is_finite()) && least * MOST_MASS_CONDITION > most
    });
    4 * regular.count() > 3 * (values.len() / n)
}
