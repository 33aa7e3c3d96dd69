//! Sums over the shards of a batch in a fixed order, so that results do not depend on the number of threads.

use super::thresholds::PARAMETERS_AT_ONCE;
use crate::scalar::Scalar;
use rayon::prelude::*;

/// Writes the sum of the gradients of all `shards`, at least one, to `out` without allocation.
pub(crate) fn sum_gradients<S: Scalar, T: Sync>(
    pool: &rayon::ThreadPool,
    shards: &[T],
    gradient: impl Fn(&T) -> &[S] + Sync,
    out: &mut [S],
) {
    pool.install(|| {
        out.par_chunks_mut(PARAMETERS_AT_ONCE).enumerate().for_each(|(k, block)| {
            let range = k * PARAMETERS_AT_ONCE..k * PARAMETERS_AT_ONCE + block.len();
            block.copy_from_slice(&gradient(&shards[0])[range.clone()]);
            for shard in &shards[1..] {
                for (sum, &g) in block.iter_mut().zip(&gradient(shard)[range.clone()]) {
                    *sum += g;
                }
            }
        });
    });
}
