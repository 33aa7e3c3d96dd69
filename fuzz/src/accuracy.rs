//! Sizes and differences of lists of numbers, judged in double-double.

use lnn::scalar::{Dd, Scalar};

/// The same numbers in another precision.
pub fn cast<S: Scalar, T: Scalar>(x: &[S]) -> Vec<T> {
    x.iter().map(|x| x.cast()).collect()
}

/// Largest magnitude.
pub fn largest<S: Scalar>(x: &[S]) -> f64 {
    x.iter().fold(0.0, |most, x| most.max(x.to_f64().abs()))
}

/// Largest difference.
pub fn apart(x: &[Dd], y: &[Dd]) -> f64 {
    assert_eq!(x.len(), y.len());
    x.iter().zip(y).fold(0.0, |most, (&x, &y)| most.max((x - y).to_f64().abs()))
}

/// Whether all are finite.
pub fn finite<S: Scalar>(x: &[S]) -> bool {
    x.iter().all(|x| x.is_finite())
}
