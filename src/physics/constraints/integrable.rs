//! Decides which rows linear in the velocities are derivatives of functions, by Frobenius' condition.

use super::MotionSamples;
use super::features::Features;
use super::independence::{RowsTaken, extend};
use super::thresholds::MOST_CURL;
use crate::lagrangian::ReducedMass;
use crate::linalg::dot;

/// An orthonormal basis of the null space of the rows.
fn kernel(n: usize, rows: &[f64]) -> Vec<f64> {
    ReducedMass::of(n, &vec![0.0; n * n], rows).map(|reduced| reduced.basis).unwrap_or_default()
}

/// Which of the rows are derivatives of functions, in addition to the `by_functions` constraints: starting with the rows whose curl vanishes in
/// the null space of all rows, repeatedly keeps those whose curl vanishes in the null space of the kept rows. A rolling disk has a row of the
/// first kind, its path along its heading, and none that remains.
pub(super) fn integrable(
    features: &Features,
    samples: &MotionSamples,
    rows: &[&[f64]],
    (held, by_functions): (&RowsTaken, Vec<Vec<f64>>),
) -> Vec<bool> {
    let (mut left, mut bases) = (vec![true; rows.len()], held.bases.clone());
    loop {
        let mut lost = false;
        for (weights, left) in rows.iter().zip(&mut left).filter(|(_, left)| **left) {
            let places = held.places.iter().zip(&bases);
            let turns: Vec<f64> = places.map(|(&at, rows)| curl(features, samples, at, weights, rows)).collect();
            let turn = (turns.iter().map(|x| x * x).sum::<f64>() / turns.len() as f64).sqrt();
            if turn >= MOST_CURL || features.has_rate(weights) {
                (*left, lost) = (false, true);
            }
        }
        if !lost {
            return left;
        }
        bases.clone_from(&by_functions);
        for (weights, _) in rows.iter().zip(&left).filter(|(_, left)| **left) {
            for (&at, basis) in held.places.iter().zip(&mut bases) {
                extend(basis, &features.velocity_row(samples, at, weights));
            }
        }
    }
}

/// Size of the curl of a row within the null space of the rows, over that of its derivatives: 0 if it is the derivative of a function
/// (Frobenius).
fn curl(features: &Features, samples: &MotionSamples, at: usize, weights: &[f64], rows: &[f64]) -> f64 {
    let n = samples.n();
    let derivatives = features.row_derivatives(samples, at, weights);
    let size = derivatives.iter().fold(0.0, |size: f64, x| size.max(x.abs()));
    let basis = kernel(n, rows);
    let mut most: f64 = 0.0;
    for z in basis.chunks_exact(n) {
        for y in basis.chunks_exact(n) {
            let along =
                |z: &[f64], y: &[f64]| (0..n).map(|i| z[i] * dot(&derivatives[i * n..(i + 1) * n], y)).sum::<f64>();
            most = most.max((along(z, y) - along(y, z)).abs());
        }
    }
    if size > 0.0 { most / size } else { 0.0 }
}
