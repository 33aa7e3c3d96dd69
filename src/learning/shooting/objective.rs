//! Loss of a batch of segments with its gradient by weights and starts, residuals, and linearisations with respect to the starts.
//!
//! A batch is cut into shards and chunks whose sizes do not depend on the number of threads, and every sum is taken in their order, so that
//! the numbers do not depend on the number of threads.

use crate::configuration::Penalty;
use crate::lagrangian::Manifold;
use crate::network::{Architecture, Model};
use crate::scalar::{Real, Scalar, Sum};
use crate::shooting::integrator::SegmentIntegrator;
use crate::shooting::loss::{Huber, add_loss, each_residual, gap};
use crate::shooting::segments::Segments;
use crate::shooting::starts::{Curvature, Linearisation};
use crate::training::ThreadsError;
use crate::training::objective::threads as start_threads;
use crate::training::reduction::sum_gradients;
use rayon::prelude::*;
use std::sync::Arc;

/// Number of segments that are integrated together.
const CHUNK: usize = 8;
/// Largest number of shards of a batch; each has its own gradient.
const SHARDS: usize = 8;

/// Outcome of a batch of segments.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ShootingReport<S> {
    /// Mean of `rho` over the residuals that count, 1 for noise alone; `NaN` if none counts.
    pub loss: S,
    /// Mean of `rho` over the components of the gaps; 0 if there are none.
    pub gap: S,
    /// Penalty with its weight.
    pub penalty: S,
    /// Starts of steps at which it is active.
    pub penalised: usize,
    /// Segments left out because their motion is not finite or leaves the plausible range.
    pub left_out: usize,
    /// Residuals that count.
    pub residuals: usize,
}

/// Shoots batches of segments; owns the threads and every buffer.
pub struct ShootingObjective<S> {
    model: Model<S>,
    penalty: Penalty,
    huber: Huber<S>,
    continuity: S,
    manifold: Option<Arc<dyn Manifold<S>>>,
    pool: Arc<rayon::ThreadPool>,
    shards: Vec<Shard<S>>,
}

/// Segments, their starts `(segments, 2, n)`, and the weights.
struct Given<'a, S> {
    weights: &'a [S],
    segments: &'a Segments<S>,
    starts: &'a [S],
}

/// A contiguous part of a batch with its own buffers.
pub(super) struct Shard<S> {
    pub integrator: SegmentIntegrator<S>,
    gradient: Vec<S>,
    /// Gradients by the starts of the shard's segments and of the segments that follow them, `(rows, 2, n)`.
    start_gradient: Vec<S>,
    next_gradient: Vec<S>,
    /// Residuals, if requested.
    values: Vec<S>,
    linear: Linearisation<S>,
    /// Curvatures, `(rows, 2n, 2n)`, and derivatives of residuals and gaps, if requested.
    curvature: Vec<S>,
    jacobian: Vec<S>,
    /// Sums over residuals and gaps.
    sums: [Sum<S>; 2],
    counted: usize,
    gaps: usize,
    penalty: Sum<S>,
    penalised: usize,
    left_out: usize,
}

impl<S: Scalar> Shard<S> {
    fn new(model: &Model<S>, manifold: Option<Arc<dyn Manifold<S>>>) -> Self {
        Self {
            integrator: SegmentIntegrator::new(model, manifold),
            gradient: Vec::new(),
            start_gradient: Vec::new(),
            next_gradient: Vec::new(),
            values: Vec::new(),
            linear: Linearisation::default(),
            curvature: Vec::new(),
            jacobian: Vec::new(),
            sums: Default::default(),
            counted: 0,
            gaps: 0,
            penalty: Sum::default(),
            penalised: 0,
            left_out: 0,
        }
    }

    fn reset(&mut self, parameters: usize) {
        self.gradient.clear();
        self.gradient.resize(parameters, <S as Real>::zero());
        let lists = [&mut self.start_gradient, &mut self.next_gradient, &mut self.values];
        lists.into_iter().chain([&mut self.curvature, &mut self.jacobian]).for_each(Vec::clear);
        (self.sums, self.penalty) = (Default::default(), Sum::default());
        (self.counted, self.gaps, self.penalised, self.left_out) = (0, 0, 0, 0);
    }

    /// Integrates a chunk.
    fn shoot(&mut self, given: &Given<'_, S>, rows: &[u32]) {
        let width = 2 * given.segments.n;
        let starts = rows.iter().flat_map(|&row| &given.starts[row as usize * width..(row as usize + 1) * width]);
        self.integrator.place(given.segments, rows, starts.copied());
        self.integrator.forward(given.weights, given.segments, rows);
    }

    /// Loss of the integrated chunk; its derivatives are stored for the reverse pass.
    fn add_losses(&mut self, given: &Given<'_, S>, rows: &[u32], huber: Huber<S>, weights: (S, S)) {
        let width = 2 * given.segments.n;
        let from = self.next_gradient.len();
        self.next_gradient.resize(from + rows.len() * width, <S as Real>::zero());
        for (row, &segment) in rows.iter().enumerate() {
            if !self.integrator.alive[row] {
                self.left_out += 1;
                continue;
            }
            let place = (row, segment as usize);
            let next = &mut self.next_gradient[from + row * width..][..width];
            let sums = (next, &mut self.sums);
            add_loss(&mut self.integrator, given.segments, place, given.starts, huber, weights, sums);
            self.counted += given.segments.residuals(segment as usize);
            self.gaps += if given.segments.list[segment as usize].has_next { width } else { 0 };
        }
    }

    /// Gradient of the chunk whose losses were added.
    fn add_gradient(&mut self, weights: &[S], penalty: (Penalty, S), n: usize) {
        let (value, active) = self.integrator.reverse(weights, penalty, &mut self.gradient);
        self.penalty.add(value);
        self.penalised += active;
        let SegmentIntegrator { alive, q_adjoint, v_adjoint, .. } = &self.integrator;
        for (row, &alive) in alive.iter().enumerate() {
            let by_start = q_adjoint[row * n..][..n].iter().chain(&v_adjoint[row * n..][..n]);
            self.start_gradient.extend(by_start.map(|&g| if alive { g } else { <S as Real>::zero() }));
        }
    }

    /// Residuals of the integrated chunk, `NaN` for segments that are left out.
    fn add_values(&mut self, segments: &Segments<S>, rows: &[u32]) {
        let Self { integrator, values, .. } = self;
        for (row, &segment) in rows.iter().enumerate() {
            let alive = integrator.alive[row];
            each_residual(integrator, segments, (row, segment as usize), |residual| {
                values.push(if alive { residual.value } else { S::nan() });
            });
        }
    }

    /// Curvatures and gradients of a chunk with respect to the starts, by differences of residuals and gaps.
    fn add_curvature(&mut self, given: &Given<'_, S>, rows: &[u32], huber: Huber<S>, continuity: S) {
        self.shoot(given, rows);
        self.add_losses(given, rows, huber, (<S as Real>::one(), continuity));
        let mut linear = std::mem::take(&mut self.linear);
        linear.base.clear();
        self.collect(given, rows, &mut linear.base);
        linear.alive.clone_from(&self.integrator.alive);
        linear.moved.clear();
        let width = 2 * given.segments.n;
        for k in 0..width {
            let by = linear.difference(given.segments, k);
            let starts = rows.iter().flat_map(|&row| &given.starts[row as usize * width..][..width]);
            let starts = starts.enumerate().map(|(at, &x)| if at % width == k { x + by } else { x });
            self.integrator.place(given.segments, rows, starts);
            self.integrator.forward(given.weights, given.segments, rows);
            self.collect(given, rows, &mut linear.moved);
            for (all, &alive) in linear.alive.iter_mut().zip(&self.integrator.alive) {
                *all &= alive;
            }
        }
        let parts = (&mut self.curvature, &mut self.jacobian, &mut self.start_gradient);
        linear.add(given.segments, rows, huber, continuity, parts);
        self.linear = linear;
    }

    /// Gradients of a chunk with respect to the starts, with the derivatives of an earlier linearisation.
    fn add_start_gradients(
        &mut self,
        given: &Given<'_, S>,
        rows: &[u32],
        curvature: &Curvature<S>,
        (huber, continuity): (Huber<S>, S),
    ) {
        self.shoot(given, rows);
        self.add_losses(given, rows, huber, (<S as Real>::one(), continuity));
        let mut values = std::mem::take(&mut self.values);
        for (row, &segment) in rows.iter().enumerate() {
            let from = self.start_gradient.len();
            self.start_gradient.resize(from + 2 * given.segments.n, <S as Real>::zero());
            if self.integrator.alive[row] {
                values.clear();
                self.collect_row(given, (row, segment as usize), &mut values);
                let gradient = &mut self.start_gradient[from..];
                curvature.add_gradient(given.segments, segment as usize, &values, huber, continuity, gradient);
            }
        }
        self.values = values;
    }

    /// All residuals and gaps of the integrated chunk, row by row.
    fn collect(&self, given: &Given<'_, S>, rows: &[u32], out: &mut Vec<S>) {
        rows.iter().enumerate().for_each(|(row, &segment)| self.collect_row(given, (row, segment as usize), out));
    }

    /// Residuals, then the gap, of one row.
    fn collect_row(&self, given: &Given<'_, S>, place: (usize, usize), out: &mut Vec<S>) {
        let width = 2 * given.segments.n;
        each_residual(&self.integrator, given.segments, place, |residual| out.push(residual.value));
        if given.segments.list[place.1].has_next {
            let next = &given.starts[(place.1 + 1) * width..][..width];
            out.extend((0..width).map(|k| gap(&self.integrator, given.segments, place, next, k)));
        }
    }
}

impl<S: Scalar> Segments<S> {
    /// Residuals of one segment.
    pub(crate) fn residuals(&self, segment: usize) -> usize {
        let segment = &self.list[segment];
        segment.samples.len() * self.n * if segment.has_velocity { 2 } else { 1 }
    }
}

impl<S: Scalar> ShootingObjective<S> {
    /// An objective for networks of this shape on `threads` threads; `continuity` and `huber` as in
    /// [`Shooting`](crate::shooting::Shooting).
    ///
    /// # Errors
    /// The threads cannot be started.
    pub fn new(
        architecture: &Architecture,
        penalty: Penalty,
        (continuity, huber): (f64, f64),
        threads: usize,
    ) -> Result<Self, ThreadsError> {
        let pool = start_threads(threads)?;
        let (huber, continuity) = (Huber::new(huber), S::of_f64(continuity));
        let model = architecture.model();
        Ok(Self { model, penalty, huber, continuity, manifold: None, pool, shards: Vec::new() })
    }

    /// Adds constraints to the objective; the segments must be [under](Segments::under) them too.
    pub fn under(self, manifold: Arc<dyn Manifold<S>>) -> Self {
        Self { manifold: Some(manifold), shards: Vec::new(), ..self }
    }

    /// The model that is trained.
    pub(super) fn model(&self) -> &Model<S> {
        &self.model
    }

    /// The threads.
    pub(super) fn pool(&self) -> &Arc<rayon::ThreadPool> {
        &self.pool
    }

    /// Runs `work` on the chunks of every shard of `rows`; returns the number of shards.
    fn run(&mut self, rows: &[u32], parameters: usize, work: impl Fn(&mut Shard<S>, &[u32]) + Sync) -> usize {
        let size = rows.len().div_ceil(CHUNK).div_ceil(SHARDS).max(1) * CHUNK;
        let count = rows.len().div_ceil(size);
        while self.shards.len() < count {
            self.shards.push(Shard::new(&self.model, self.manifold.clone()));
        }
        let shards = &mut self.shards[..count];
        self.pool.install(|| {
            shards.par_iter_mut().zip(rows.par_chunks(size)).for_each(|(shard, rows)| {
                shard.reset(parameters);
                rows.chunks(CHUNK).for_each(|rows| work(shard, rows));
            });
        });
        count
    }

    /// Loss and gradients of the segments `rows`; `gradient` by the weights and `start_gradient` by all starts,
    /// `(segments, 2, n)` scaled, are overwritten.
    ///
    /// The gradient is that of `loss + penalty`, gaps included, with the weight `1/residuals` of every residual and `continuity/residuals`
    /// of every gap, where `residuals` is that of the report; segments that are left out do not count. The penalty treats the states as
    /// given.
    pub fn step(
        &mut self,
        weights: &[S],
        segments: &Segments<S>,
        starts: &[S],
        rows: &[u32],
        (gradient, start_gradient): (&mut [S], &mut [S]),
    ) -> ShootingReport<S> {
        let given = Given { weights, segments, starts };
        let (penalty, huber) = (self.penalty, self.huber);
        let all: usize = rows.iter().map(|&row| segments.residuals(row as usize)).sum();
        let lambda = S::of_f64(penalty.lambda()) / count::<S>(rows.len() * segments.steps);
        let mut shoot = |counted: usize| {
            let weight = count::<S>(counted).recip();
            let continuity = self.continuity * weight;
            let shards = self.run(rows, weights.len(), |shard, rows| {
                shard.shoot(&given, rows);
                shard.add_losses(&given, rows, huber, (weight, continuity));
                shard.add_gradient(weights, (penalty, lambda), segments.n);
            });
            (shards, self.shards[..shards].iter().map(|shard| shard.counted).sum())
        };
        let (mut shards, counted) = shoot(all);
        if 0 < counted && counted < all {
            // Only now is the number of counted residuals known.
            (shards, _) = shoot(counted);
        }
        sum_gradients(&self.pool, &self.shards[..shards], |shard| &shard.gradient, gradient);
        self.gather_starts(shards, rows, segments, start_gradient);
        self.report(shards)
    }

    /// Collects the gradients with respect to the starts of the segments `rows` and of the segments that follow them.
    fn gather_starts(&self, shards: usize, rows: &[u32], segments: &Segments<S>, start_gradient: &mut [S]) {
        let width = 2 * segments.n;
        start_gradient.fill(<S as Real>::zero());
        let parts = || self.shards[..shards].iter();
        let own = parts().flat_map(|part| part.start_gradient.chunks_exact(width));
        let next = parts().flat_map(|part| part.next_gradient.chunks_exact(width));
        for ((&row, own), next) in rows.iter().zip(own).zip(next) {
            let at = row as usize * width;
            for (sum, &g) in start_gradient[at..].iter_mut().zip(own) {
                *sum += g;
            }
            if segments.list[row as usize].has_next {
                for (sum, &g) in start_gradient[at + width..].iter_mut().zip(next) {
                    *sum += g;
                }
            }
        }
    }

    /// Computes the loss of the segments `rows` without gradient.
    pub fn loss(&mut self, weights: &[S], segments: &Segments<S>, starts: &[S], rows: &[u32]) -> ShootingReport<S> {
        let given = Given { weights, segments, starts };
        let huber = self.huber;
        let zero = <S as Real>::zero();
        let shards = self.run(rows, 0, |shard, rows| {
            shard.shoot(&given, rows);
            shard.add_losses(&given, rows, huber, (zero, zero));
        });
        self.report(shards)
    }

    /// Residuals of the segments `rows` in units of noise, sample by sample: positions each with its velocity, if that was
    /// measured; `NaN` for segments that are left out.
    pub fn residuals(&mut self, weights: &[S], segments: &Segments<S>, starts: &[S], rows: &[u32]) -> Vec<S> {
        let given = Given { weights, segments, starts };
        let shards = self.run(rows, 0, |shard, rows| {
            shard.shoot(&given, rows);
            shard.add_values(segments, rows);
        });
        self.shards[..shards].iter().flat_map(|shard| shard.values.iter().copied()).collect()
    }

    /// Linearises all segments with respect to their starts, stores the result in `curvature` for [`Curvature::correct`], and moves
    /// `starts` by `share` of a Gauss-Newton step; the report belongs to the starts before.
    pub fn refine(
        &mut self,
        weights: &[S],
        segments: &Segments<S>,
        starts: &mut [S],
        curvature: &mut Curvature<S>,
        share: f64,
    ) -> ShootingReport<S> {
        let rows: Vec<u32> = (0..segments.len() as u32).collect();
        let given = Given { weights, segments, starts: &*starts };
        let (huber, continuity) = (self.huber, self.continuity);
        let shards = self.run(&rows, 0, |shard, rows| shard.add_curvature(&given, rows, huber, continuity));
        let mut gradient = vec![<S as Real>::zero(); starts.len()];
        self.gather_starts(shards, &rows, segments, &mut gradient);
        let parts = self.shards[..shards].iter().map(|s| (s.curvature.as_slice(), s.jacobian.as_slice()));
        curvature.set(segments, parts);
        curvature.correct(segments, starts, &gradient, share);
        self.report(shards)
    }

    /// Moves the starts of the segments `rows`, and a little those of their followers, by `share` of a Gauss-Newton step
    /// with the derivatives that `curvature` holds of an earlier [`refine`](Self::refine): one forward integration.
    pub fn move_starts(
        &mut self,
        weights: &[S],
        segments: &Segments<S>,
        (starts, rows): (&mut [S], &[u32]),
        (curvature, start_gradient): (&mut Curvature<S>, &mut [S]),
        share: f64,
    ) {
        let given = Given { weights, segments, starts: &*starts };
        let (huber, continuity) = (self.huber, self.continuity);
        let held = &*curvature;
        let shards = self.run(rows, 0, |shard, rows| {
            shard.add_start_gradients(&given, rows, held, (huber, continuity));
        });
        self.gather_starts(shards, rows, segments, start_gradient);
        curvature.correct(segments, starts, start_gradient, share);
    }

    fn report(&self, shards: usize) -> ShootingReport<S> {
        let (mut residual, mut gap, mut penalty) = (Sum::default(), Sum::default(), Sum::default());
        let (mut counted, mut gaps, mut penalised, mut left_out) = (0, 0, 0, 0);
        for shard in &self.shards[..shards] {
            residual.add(shard.sums[0].value());
            gap.add(shard.sums[1].value());
            penalty.add(shard.penalty.value());
            counted += shard.counted;
            gaps += shard.gaps;
            penalised += shard.penalised;
            left_out += shard.left_out;
        }
        // If nothing counts, the loss is `NaN`, because the mean of nothing is not 0.
        let loss = residual.value() / count::<S>(counted);
        let gap = gap.value() / count::<S>(gaps.max(1));
        ShootingReport { loss, gap, penalty: penalty.value(), penalised, left_out, residuals: counted }
    }
}

fn count<S: Scalar>(number: usize) -> S {
    S::of_f64(number as f64)
}
