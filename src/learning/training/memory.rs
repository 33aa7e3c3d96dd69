//! Estimate of the memory that a training takes.

use crate::configuration::Regularizer;
use crate::configuration::{Config, Precision};
use crate::network::{Architecture, Layout};
use crate::optimizers::eigenbasis_numbers;
use crate::training::objective::{CHUNK, SHARDS};

/// Number of weight-sized vectors in a training: weights, gradient, two moments, average, the best of the phase and of earlier phases (each
/// twice), the last two validated ones, and the initial one.
const VECTORS: u64 = 12;
/// Number of copies of a checkpoint's numbers during writing: the copy, its bytes, the file's bytes, and those read back.
const COPIES: u64 = 4;
/// Number of weight-sized vectors in all copies of a checkpoint during writing.
const CHECKPOINT: u64 = 6 * COPIES;
/// Number of weight-sized vectors in L-BFGS, besides two for each stored pair.
const LBFGS: u64 = 14;

/// Approximate upper bound of the bytes that a training takes; `None` if they cannot be counted in 64 bits.
///
/// With `s` bytes per number, `n` coordinates, `f` features, `w` units in all layers, `P` weights, `K` phases of `N`
/// training states, `V` validation and `T` test states, it is the sum of
///
/// - states: `(3 n + 1) (16 + s) (K N + V + T)`, drawn in double precision into vectors that may have grown to twice their
///   length, then converted; `3 n s (N + V)` for the phase under way; `8 n T` for the evaluation afterwards, five times;
///   `4 (6 N + V)` for the order of states and its copies in a checkpoint;
/// - weights: `(12 + 24) s P`, the second for writing a checkpoint;
/// - eigenbases of SOAP: `s (4 r + m)` with `r` numbers in the squares over the sides of all weight matrices and `m` in the
///   matrices, and `8 s r` for writing a checkpoint;
/// - shards: `s (P + 64 j (w (2 c + 21) + 4 f c + 10 n^2 + 20 n + 6 K))` for each of the up to 8 parts of a batch, `c = n + 2`
///   channels and `j` evaluations side by side, 1 without penalty and 2 with one, the latter with `n^2` more numbers per state;
/// - L-BFGS with memory `m`, which makes `s = 8` in the shards: `24 n (N + V) + 4 N + 8 P (2 m + 14)`.
pub fn training_memory(config: &Config, architecture: &Architecture) -> Option<u64> {
    let layout = Layout::new(architecture);
    let number = match config.precision {
        Precision::F32 => 4,
        Precision::F64 => 8,
    };
    let (n, f) = (architecture.coordinates as u64, layout.features as u64);
    let units: usize = layout.branches.iter().flat_map(|branch| branch.hidden()).map(|layer| layer.outputs).sum();
    let (units, weights, phases) = (units as u64, layout.parameters as u64, config.phases.len() as u64);
    let data = &config.data;
    let (training, validation, test) = (data.training as u64, data.validation as u64, data.test as u64);

    let all = sum([product([phases, training]), Some(validation), Some(test)]);
    let once = sum([Some(training), Some(validation)]);
    let states = sum([
        product([16 + number, sum([product([3, n]), Some(1)])?, all?]),
        product([3 * number, n, once?]),
        product([40, n, test]),
        product([4, sum([product([6, training]), Some(validation)])?]),
    ]);

    let (kept, held) = eigenbasis_numbers(config.optimizer.method, layout.matrices())?;
    let bases = product([number, sum([Some(held as u64), product([COPIES, kept as u64])])?]);

    let largest = (data.training.min(config.optimizer.batch)).max(data.validation).max(data.test);
    let largest = if config.lbfgs.is_some() { largest.max(data.training) } else { largest } as u64;
    let shards = largest.div_ceil(CHUNK as u64).min(SHARDS as u64);
    let batch = largest.div_ceil(SHARDS as u64).max(CHUNK as u64);
    let (channels, penalised) = (n + 2, !matches!(config.penalty, Regularizer::None));
    let evaluations = if penalised { 2 } else { 1 };
    let square = product([n, n])?;
    let of_state = sum([
        product([units, sum([product([2, channels]), Some(21)])?]),
        product([4, f, channels]),
        product([10, square]),
        product([20, n]),
        product([6, architecture.dissipation.unwrap_or(0) as u64]),
    ]);
    let suspects = if penalised { product([square + n + 1, batch]) } else { Some(0) };
    let of_stripe = sum([Some(weights), product([CHUNK as u64, evaluations, of_state?]), suspects]);
    let wide = if config.lbfgs.is_some() { 8 } else { number };
    let lbfgs = match &config.lbfgs {
        None => Some(0),
        Some(lbfgs) => sum([
            product([24, n, once?]),
            product([4, training]),
            product([8, weights, 2 * lbfgs.memory as u64 + LBFGS]),
        ]),
    };
    sum([
        states,
        bases,
        product([(VECTORS + CHECKPOINT) * number, weights]),
        product([wide, shards, of_stripe?]),
        lbfgs,
    ])
}

/// Product, or `None` on overflow.
fn product<const N: usize>(factors: [u64; N]) -> Option<u64> {
    factors.into_iter().try_fold(1_u64, u64::checked_mul)
}

/// Sum, or `None` on overflow.
fn sum<const N: usize>(terms: [Option<u64>; N]) -> Option<u64> {
    terms.into_iter().try_fold(0_u64, |sum, term| sum.checked_add(term?))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::presets::Preset;

    fn memory(change: impl FnOnce(&mut Config)) -> Option<u64> {
        let system = crate::lagrangian::SystemInstance::named("double-pendulum", &[]).unwrap();
        let mut config = Preset::Quick.config(&system).unwrap();
        change(&mut config);
        training_memory(&config, &config.architecture(&system, vec![1.0; 2]).unwrap())
    }

    #[test]
    fn more_of_anything_takes_more() {
        let plain = memory(|_| {}).unwrap();
        assert!(memory(|c| c.data.training += 1000).unwrap() > plain);
        assert!(memory(|c| c.network.hidden[0] += 100).unwrap() > plain);
        assert!(memory(|c| c.phases.push(c.phases[0].clone())).unwrap() > plain);
        assert!(memory(|c| c.precision = Precision::F64).unwrap() > plain);
        assert!(memory(|c| c.data.training = 1 << 30).unwrap() > 100 << 30);
        // Three square matrices of 65536 rows in 36 vectors and 8 gradients.
        assert!(memory(|c| c.network.hidden = vec![1 << 16; 4]).unwrap() > 44 * 4 * (3 << 32));
    }

    #[test]
    fn what_cannot_be_counted_is_not() {
        assert_eq!(product([1 << 32, 1 << 32]), None);
        assert_eq!(sum([Some(u64::MAX), Some(1)]), None);
        assert_eq!(sum([Some(1), None]), None);
        assert_eq!(memory(|c| c.data.training = usize::MAX / 4), None);
    }
}
