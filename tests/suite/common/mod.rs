//! What several test programs share.
#![allow(dead_code, reason = "each test program uses its part")]

pub mod accuracy;
pub mod arm;
pub mod damped;
pub mod forms;
pub mod kinds;
pub mod matrices;
pub mod nested;
pub mod penalties;
#[path = "../../../crates/lnn-engine/src/properties.rs"]
mod properties;

use lnn::scalar::{Real, Scalar};
#[allow(unused_imports, reason = "each test program uses its part")]
pub use properties::properties;

/// Gaussian elimination without exchanges over any number type, for small well-conditioned systems.
pub fn solve<T: Real>(n: usize, matrix: &[T], right: &[T]) -> Vec<T> {
    let (mut m, mut x) = (matrix.to_vec(), right.to_vec());
    for k in 0..n {
        for i in k + 1..n {
            let factor = m[i * n + k] / m[k * n + k];
            for j in k..n {
                let element = m[k * n + j];
                m[i * n + j] -= factor * element;
            }
            let element = x[k];
            x[i] -= factor * element;
        }
    }
    for k in (0..n).rev() {
        for j in k + 1..n {
            let known = m[k * n + j] * x[j];
            x[k] -= known;
        }
        x[k] /= m[k * n + k];
    }
    x
}

/// A scalar as a constant of any number over any scalar; exact where the target is at least as precise.
pub fn of_scalar<R: Real>(x: impl Scalar) -> R {
    R::constant(x.cast())
}
