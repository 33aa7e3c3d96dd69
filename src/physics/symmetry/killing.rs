//! The Killing form of a Lie algebra, and its signature.

use super::SymmetryError;
use crate::linalg::{Workspace, eigenvalues};

/// `K_ab = sum of c[a][c][d] c[b][d][c]`, rows of a symmetric matrix.
pub(crate) fn killing_form(c: &[Vec<Vec<f64>>]) -> Vec<f64> {
    let m = c.len();
    let entry = |a: usize, b: usize| (0..m).map(|i| (0..m).map(|j| c[a][i][j] * c[b][j][i]).sum::<f64>()).sum();
    (0..m).flat_map(|a| (0..m).map(move |b| (a, b))).map(|(a, b)| entry(a, b)).collect()
}

/// Numbers of negative, positive and zero eigenvalues of a symmetric matrix.
pub(crate) fn signature(matrix: &[f64], tolerance: f64) -> Result<[usize; 3], SymmetryError> {
    let m = matrix.len().isqrt();
    let mut values = vec![0.0; m];
    eigenvalues(m, matrix, &mut values, &mut Workspace::new())
        .map_err(|_| SymmetryError::NotFinite { what: "the Killing form" })?;
    let largest = values.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
    let floor = tolerance * largest.max(tolerance);
    let count = |test: &dyn Fn(f64) -> bool| values.iter().filter(|x| test(**x)).count();
    Ok([count(&|x| x < -floor), count(&|x| x > floor), count(&|x| x.abs() <= floor)])
}
