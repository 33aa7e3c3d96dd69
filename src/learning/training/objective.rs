//! Loss and parameter gradient of a batch, and the losses of a whole dataset.
//!
//! Loss of the paper: the mean of `|prediction - target|` over the `2n` components `(v, a)` of the scaled state
//! derivative, the first `n` equal by construction: half the mean absolute error of the scaled accelerations. States of a
//! dataset may have [weights](Dataset::with_weights).
//!
//! A batch is cut into shards and chunks whose sizes do not depend on the number of threads, and every sum is taken in their order, so that
//! the numbers do not depend on the number of threads.

use crate::configuration::Penalty;
use crate::data::Dataset;
use crate::lagrangian::MechanicsError;
use crate::linalg::characteristic_scales;
use crate::network::{Architecture, Model};
use crate::scalar::{Scalar, Sum};
use crate::tape::STATES;
use crate::training::reduction::sum_gradients;
use crate::training::shard::Shard;
use rayon::prelude::*;
use std::sync::Arc;

/// Number of states that are evaluated together.
pub(crate) const CHUNK: usize = STATES;
/// Largest number of shards of a batch; each has its own gradient.
pub(crate) const SHARDS: usize = 8;

/// Outcome of a batch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BatchReport<S> {
    /// Loss in the paper's convention, without penalty, over the states that count; `NaN` if there are none.
    pub loss: S,
    /// Penalty with its weight.
    pub penalty: S,
    /// States whose penalty is active.
    pub penalised: usize,
    /// States left out because they have no finite acceleration, or no finite force if the training uses forces.
    pub left_out: usize,
    /// The first state that failed, by its row in the dataset, with the reason.
    pub failure: Option<MechanicsError>,
}

/// Evaluates batches; owns the threads and every buffer, so that a step allocates nothing after the first.
pub struct Objective<S> {
    model: Model<S>,
    penalty: Penalty,
    pool: Arc<rayon::ThreadPool>,
    shards: Vec<Shard<S>>,
}

/// Creates the thread pool of a run: at most as many threads as a batch has shards, and fewer if the operating system refuses more.
///
/// # Errors
/// [`ThreadsError`] if not even one can be started.
pub(crate) fn threads(count: usize) -> Result<Arc<rayon::ThreadPool>, ThreadsError> {
    let mut threads = count.clamp(1, SHARDS);
    loop {
        match rayon::ThreadPoolBuilder::new().num_threads(threads).build() {
            Ok(pool) => return Ok(Arc::new(pool)),
            Err(error) if threads == 1 => return Err(ThreadsError { threads, problem: error.to_string() }),
            Err(_) => threads /= 2,
        }
    }
}

/// The threads could not be started.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("cannot start {threads} threads: {problem}")]
pub struct ThreadsError {
    /// Number requested.
    pub threads: usize,
    /// Message of the operating system.
    pub problem: String,
}

impl<S: Scalar> Objective<S> {
    /// An objective for networks of this shape on `threads` threads.
    ///
    /// # Errors
    /// When the threads cannot be started.
    pub fn new(architecture: &Architecture, penalty: Penalty, threads: usize) -> Result<Self, ThreadsError> {
        Self::of_model(architecture.model(), penalty, threads)
    }

    /// An objective for any model on `threads` threads.
    ///
    /// # Errors
    /// When the threads cannot be started.
    pub(crate) fn of_model(model: Model<S>, penalty: Penalty, threads: usize) -> Result<Self, ThreadsError> {
        Ok(Self::on(self::threads(threads)?, model, penalty))
    }

    /// Creates an objective for any model on a shared thread pool.
    pub(crate) fn on(pool: Arc<rayon::ThreadPool>, model: Model<S>, penalty: Penalty) -> Self {
        Self { model, penalty, pool, shards: Vec::new() }
    }

    /// The model that is trained.
    pub(crate) fn model(&self) -> &Model<S> {
        &self.model
    }

    /// The threads.
    pub(crate) fn pool(&self) -> &Arc<rayon::ThreadPool> {
        &self.pool
    }

    /// Runs `work` on every shard of `rows`, at most [`SHARDS`] of whole chunks each.
    fn run(&mut self, rows: &[u32], work: impl Fn(&mut Shard<S>, &[u32]) + Sync) -> usize {
        let chunks = rows.len().div_ceil(CHUNK);
        let size = chunks.div_ceil(SHARDS) * CHUNK;
        let count = rows.len().div_ceil(size);
        while self.shards.len() < count {
            self.shards.push(Shard::new(&self.model));
        }
        let shards = &mut self.shards[..count];
        self.pool.install(|| {
            shards.par_iter_mut().zip(rows.par_chunks(size)).for_each(|(shard, rows)| work(shard, rows));
        });
        count
    }

    /// Computes loss, penalty and gradient of the states `rows` of `data`; overwrites `gradient`. The loss is the mean over the states that
    /// are not left out, the penalty the mean over all states, and the gradient is that of their sum.
    pub fn step(&mut self, weights: &[S], data: &Dataset<S>, rows: &[u32], gradient: &mut [S]) -> BatchReport<S> {
        let penalty = self.penalty;
        let lambda = S::of_f64(penalty.lambda()) / S::of_f64(rows.len() as f64);
        let mut shards = self.evaluate(weights, data, rows, rows.len(), lambda);
        let counted = rows.len() - self.left_out(shards);
        if 0 < counted && counted < rows.len() {
            // Only now is the number of counted states known. Few batches leave states out, so repeating them is cheaper than storing
            // separate gradients of loss and penalty for all batches.
            shards = self.evaluate(weights, data, rows, counted, lambda);
        }
        if self.shards[..shards].iter().any(|shard| !shard.suspects.is_empty()) {
            let scales = self.scales(shards, data.coordinates());
            self.run(rows, |shard, rows| shard.add_suspects(weights, data, rows, &scales, (penalty, lambda)));
        }
        let shards = &self.shards[..shards];
        sum_gradients(&self.pool, shards, |shard| &shard.gradient, gradient);
        self.report(shards.len(), rows.len(), data.coordinates())
    }

    /// Sums of loss, penalty and gradient over the batch, where `counted` states are not left out; a penalty that needs scales is added
    /// elsewhere. Returns the number of shards.
    fn evaluate(&mut self, weights: &[S], data: &Dataset<S>, rows: &[u32], counted: usize, lambda: S) -> usize {
        let weight = (S::of_f64(2.0 * data.coordinates() as f64) * S::of_f64(counted as f64)).recip();
        let penalty = self.penalty;
        self.run(rows, |shard, rows| {
            shard.reset(weights.len());
            for rows in rows.chunks(CHUNK) {
                shard.add_chunk(weights, data, rows, weight, (penalty, lambda));
            }
            shard.violations.add_gradient(weights, true, &mut shard.gradient);
        })
    }

    /// Number of states that the shards left out.
    fn left_out(&self, shards: usize) -> usize {
        self.shards[..shards].iter().map(|shard| shard.left_out).sum()
    }

    /// Characteristic scales of the batch in the shards.
    fn scales(&self, shards: usize, n: usize) -> Vec<S> {
        let diagonals: Vec<S> = self.shards[..shards].iter().flat_map(|s| s.diagonal.iter().copied()).collect();
        characteristic_scales(n, &diagonals)
    }

    /// Computes the loss of a whole dataset without gradient.
    pub fn loss(&mut self, weights: &[S], data: &Dataset<S>) -> BatchReport<S> {
        let rows: Vec<u32> = (0..data.len() as u32).collect();
        let shards = self.run(&rows, |shard, rows| {
            shard.reset(0);
            for rows in rows.chunks(CHUNK) {
                shard.add_losses(weights, data, rows);
            }
        });
        self.report(shards, rows.len(), data.coordinates())
    }

    fn report(&self, shards: usize, states: usize, n: usize) -> BatchReport<S> {
        let (mut residual, mut penalty) = (Sum::default(), Sum::default());
        let (mut penalised, mut left_out, mut failure) = (0, 0, None);
        for shard in &self.shards[..shards] {
            residual.add(shard.residual.value());
            penalty.add(shard.violations.penalty.value());
            penalised += shard.violations.count;
            left_out += shard.left_out;
            failure = failure.or(shard.failure);
        }
        // If no state counts, the loss is `NaN`, because the mean of nothing is not 0.
        let loss = residual.value() / S::of_f64((2 * n * (states - left_out)) as f64);
        BatchReport { loss, penalty: penalty.value(), penalised, left_out, failure }
    }
}
