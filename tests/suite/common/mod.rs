//! What several test programs share.
#![allow(dead_code, reason = "each test program uses its part")]

pub mod accuracy;
#[cfg(feature = "cli")]
pub mod arm;
pub mod damped;
#[cfg(feature = "cli")]
pub mod forms;
#[cfg(feature = "cli")]
pub mod kinds;
pub mod matrices;
pub mod nested;
#[cfg(feature = "cli")]
pub mod program;

use lnn::scalar::{Real, Scalar};
use proptest::test_runner::{Config, FileFailurePersistence, RngSeed};

/// Cases of a property that every run tries at least, if it has as many.
const LEAST_CASES: u32 = 32;

/// Settings of a property over random cases: a quarter of `cases`, all of them with `LNN_THOROUGH=1` (and as many as
/// `PROPTEST_CASES` says). They are the same in every run unless `PROPTEST_RNG_SEED` names others, as the continuous integration
/// does anew in every run; seeds that failed are kept in a file beside the test's source.
pub fn properties(cases: u32) -> Config {
    let mut config = Config::default();
    if std::env::var_os("PROPTEST_CASES").is_none() {
        let thorough = std::env::var_os("LNN_THOROUGH").is_some_and(|value| value == "1");
        config.cases = if thorough { cases } else { cases.div_ceil(4).max(cases.min(LEAST_CASES)) };
    }
    if config.rng_seed == RngSeed::Random {
        config.rng_seed = RngSeed::Fixed(1);
    }
    config.failure_persistence = Some(Box::new(FileFailurePersistence::WithSource("regressions")));
    config
}

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
