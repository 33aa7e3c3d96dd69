//! The coefficients of terms through the motion: multiple shooting by Gauss and Newton's method.
//!
//! Every segment of the data has a start of its own; its motion follows from start and coefficients by Runge and Kutta's method, and with
//! it the derivatives by all of them, by those of terms too that the model does not have. Starts are eliminated from the normal equations
//! segment by segment. Noise enters positions alone, so that nothing is biased by it.

use super::library::{Kind, Library, Term, Values};
use super::linear::{inverse_with, times};
use crate::linalg::{self, Workspace, dot};
use std::collections::BTreeMap;

/// Samples that are followed from one start.
#[derive(Clone, Debug)]
pub(super) struct Segment {
    /// Block of the data.
    pub block: usize,
    /// Track and first sample.
    pub place: (usize, usize),
    pub times: Vec<f64>,
    /// Measured positions, `(samples, n)`.
    pub q: Vec<f64>,
    /// Known forces, `(samples, n)`, or empty.
    pub force: Vec<f64>,
    /// Standard deviation of every coordinate's noise.
    pub sigma: Vec<f64>,
    /// Positions and velocities at the first sample.
    pub start: Vec<f64>,
}

/// Terms with their coefficients.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Model {
    pub terms: Vec<usize>,
    pub coefficients: Vec<f64>,
}

/// Follows segments by models of a library.
#[derive(Clone, Debug)]
pub(super) struct Motion<'a> {
    pub library: &'a Library,
    /// Integration steps from sample to sample.
    pub substeps: usize,
    pub threads: usize,
}

/// Normal equations of a block, its starts eliminated.
#[derive(Clone, Debug)]
pub(super) struct BlockSum {
    pub matrix: Vec<f64>,
    pub right: Vec<f64>,
    /// Sum of squared residuals in units of noise, large ones counted linearly.
    pub square: f64,
    /// Residuals less the numbers that each start takes.
    pub count: f64,
    /// Segments that the model cannot follow.
    pub failed: usize,
    /// Variance of what coefficients are pulled by, over that of independent noise: residuals that are alike all along a motion, those of
    /// a model that is not quite right, say less than their number. At least 1.
    pub inflation: f64,
}

/// What moves a start.
struct StartStep {
    inverse: Vec<f64>,
    mixed: Vec<f64>,
    right: Vec<f64>,
}

struct Linear {
    matrix: Vec<f64>,
    right: Vec<f64>,
    square: f64,
    count: f64,
    step: StartStep,
}

/// Residuals beyond so many standard deviations count linearly.
const HUBER: f64 = 4.0;
/// Mean squared residual that stands for a segment that cannot be followed.
const FAILED: f64 = 1e3;
/// Part of the diagonal that damps steps in directions that the motion does not show.
const DAMPING: f64 = 1e-9;

/// Sum over blocks.
pub(super) fn total(blocks: &BTreeMap<usize, BlockSum>, weight: &dyn Fn(usize) -> f64) -> BlockSum {
    let mut sum: Option<BlockSum> = None;
    for (&block, part) in blocks {
        let w = weight(block);
        let sum = sum.get_or_insert_with(|| BlockSum::empty(part.right.len()));
        if w != 0.0 {
            sum.matrix.iter_mut().zip(&part.matrix).for_each(|(s, p)| *s += w * p);
            sum.right.iter_mut().zip(&part.right).for_each(|(s, p)| *s += w * p);
            sum.square += w * part.square;
            sum.count += w * part.count;
            sum.failed += part.failed;
        }
    }
    let mut sum = sum.unwrap_or_else(|| BlockSum::empty(0));
    sum.inflation = inflation(blocks, weight, &sum, &vec![0.0; sum.right.len()]);
    sum
}

/// The median over the coefficients of the scatter of what blocks pull them by once they are changed, over the scatter of noise; at
/// least the mean squared residual that is left, and 1.
pub(super) fn inflation(
    blocks: &BTreeMap<usize, BlockSum>,
    weight: &dyn Fn(usize) -> f64,
    sum: &BlockSum,
    change: &[f64],
) -> f64 {
    let m = sum.right.len();
    let square = ((sum.square - dot(&sum.right, change)) / sum.count.max(1.0)).max(1.0);
    let whole: f64 = blocks.keys().map(|&block| weight(block)).sum();
    if whole < 3.0 {
        return square;
    }
    let pulls: Vec<(f64, Vec<f64>)> = blocks
        .iter()
        .map(|(&block, part)| {
            let taken = times(m, &part.matrix, change);
            (weight(block), part.right.iter().zip(taken).map(|(pull, taken)| pull - taken).collect())
        })
        .collect();
    let ratio = |k: usize| {
        let mean = pulls.iter().map(|(weight, pull)| weight * pull[k]).sum::<f64>() / whole;
        let scatter: f64 = pulls.iter().map(|(weight, pull)| weight * (pull[k] - mean).powi(2)).sum();
        scatter * whole / (whole - 1.0) / sum.matrix[k * m + k]
    };
    let mut ratios: Vec<f64> = (0..m).map(ratio).filter(|ratio| ratio.is_finite()).collect();
    ratios.sort_by(f64::total_cmp);
    ratios.get(ratios.len() / 2).copied().unwrap_or(1.0).max(square)
}

impl BlockSum {
    fn empty(m: usize) -> Self {
        Self { matrix: vec![0.0; m * m], right: vec![0.0; m], square: 0.0, count: 0.0, failed: 0, inflation: 1.0 }
    }
}

/// Buffers of one thread.
struct Follower<'a> {
    library: &'a Library,
    model: &'a Model,
    wanted: &'a [usize],
    functions: Vec<usize>,
    values: Values,
    n: usize,
    columns: usize,
    mass: Vec<f64>,
    inverse: Vec<f64>,
    rest: Vec<f64>,
    right: Vec<f64>,
    workspace: Workspace<f64>,
    by_q: Vec<f64>,
    by_v: Vec<f64>,
    effect: Vec<f64>,
}

impl<'a> Follower<'a> {
    fn new(library: &'a Library, model: &'a Model, wanted: &'a [usize]) -> Self {
        let n = library.n();
        let all: Vec<usize> = model.terms.iter().chain(wanted).copied().collect();
        Self {
            library,
            model,
            wanted,
            functions: library.functions_of(&all),
            values: Values::new(),
            n,
            columns: 2 * n + wanted.len(),
            mass: vec![0.0; n * n],
            inverse: vec![0.0; n * n],
            rest: vec![0.0; n],
            right: vec![0.0; n * (2 * n + wanted.len())],
            workspace: Workspace::new(),
            by_q: vec![0.0; n * n],
            by_v: vec![0.0; n * n],
            effect: vec![0.0; n * wanted.len()],
        }
    }

    /// The acceleration; `false` where the mass matrix is singular.
    fn acceleration(&mut self, (q, v): (&[f64], &[f64]), force: &[f64], a: &mut [f64]) -> bool {
        let n = self.n;
        self.library.evaluate(&self.functions, q, &mut self.values);
        self.library.mass_matrix(&self.model.terms, &self.model.coefficients, &self.values, &mut self.mass);
        self.rest.fill(0.0);
        let still = [0.0; super::function::MOST_COORDINATES];
        for (&k, &c) in self.model.terms.iter().zip(&self.model.coefficients) {
            self.library.add_equation(k, c, &self.values, (v, &still[..n]), &mut self.rest);
        }
        for (i, rest) in self.rest.iter_mut().enumerate() {
            *rest = force.get(i).copied().unwrap_or(0.0) - *rest;
        }
        linalg::solve(n, &self.mass, &self.rest, a, &mut self.workspace).is_ok()
    }

    /// The acceleration with its derivatives: `d` is `(n, columns)`, given those of position and velocity.
    fn tangent(
        &mut self,
        (q, v): (&[f64], &[f64]),
        force: &[f64],
        (sq, sv): (&[f64], &[f64]),
        (a, d): (&mut [f64], &mut [f64]),
    ) -> bool {
        let (n, columns) = (self.n, self.columns);
        if !self.acceleration((q, v), force, a) {
            return false;
        }
        self.by_q.fill(0.0);
        self.by_v.fill(0.0);
        for (&k, &c) in self.model.terms.iter().zip(&self.model.coefficients) {
            let Term { kind, function } = self.library.terms[k];
            let f = &self.values[function];
            let (by_q, by_v) = (&mut self.by_q, &mut self.by_v);
            let bend = |l: usize| dot(&f.hessian[l][..n], v);
            match kind {
                Kind::Kinetic(i, j) => {
                    let rate = dot(&f.gradient[..n], v);
                    for l in 0..n {
                        let (g, h) = (c * f.gradient[l], c * bend(l));
                        by_q[i * n + l] += g * a[j] + h * v[j];
                        by_q[j * n + l] += g * a[i] + h * v[i];
                        by_v[i * n + l] += g * v[j];
                        by_v[j * n + l] += g * v[i];
                        by_v[l * n + i] -= g * v[j];
                        by_v[l * n + j] -= g * v[i];
                        for m in 0..n {
                            by_q[l * n + m] -= c * f.hessian[l][m] * v[i] * v[j];
                        }
                    }
                    by_v[i * n + j] += c * rate;
                    by_v[j * n + i] += c * rate;
                }
                Kind::Gyroscopic(i) => {
                    for l in 0..n {
                        by_q[i * n + l] += c * bend(l);
                        by_v[i * n + l] += c * f.gradient[l];
                        by_v[l * n + i] -= c * f.gradient[l];
                        for m in 0..n {
                            by_q[l * n + m] -= c * f.hessian[l][m] * v[i];
                        }
                    }
                }
                Kind::Potential => {
                    for l in 0..n {
                        for m in 0..n {
                            by_q[l * n + m] -= c * f.hessian[l][m];
                        }
                    }
                }
                Kind::Dissipation(i, j) => {
                    for l in 0..n {
                        by_q[i * n + l] += c * f.gradient[l] * v[j];
                        by_q[j * n + l] += c * f.gradient[l] * v[i];
                    }
                    by_v[i * n + j] += c * f.value;
                    by_v[j * n + i] += c * f.value;
                }
            }
        }
        let right = &mut self.right;
        right.fill(0.0);
        for i in 0..n {
            let row = &mut right[i * columns..(i + 1) * columns];
            for j in 0..n {
                let (x, y) = (self.by_q[i * n + j], self.by_v[i * n + j]);
                let pairs = sq[j * columns..(j + 1) * columns].iter().zip(&sv[j * columns..(j + 1) * columns]);
                row.iter_mut().zip(pairs).for_each(|(r, (q, v))| *r -= x * q + y * v);
            }
        }
        let count = self.wanted.len();
        let mut single = [0.0; super::function::MOST_COORDINATES];
        for (at, &k) in self.wanted.iter().enumerate() {
            single[..n].fill(0.0);
            self.library.add_equation(k, 1.0, &self.values, (v, a), &mut single[..n]);
            (0..n).for_each(|i| self.effect[i * count + at] = single[i]);
        }
        for i in 0..n {
            let row = &mut right[i * columns + 2 * n..(i + 1) * columns];
            row.iter_mut().zip(&self.effect[i * count..(i + 1) * count]).for_each(|(r, e)| *r -= e);
        }
        if linalg::inverse(n, &self.mass, &mut self.inverse, &mut self.workspace).is_err() {
            return false;
        }
        d.fill(0.0);
        for (inverse, d) in self.inverse.chunks_exact(n).zip(d.chunks_exact_mut(columns)) {
            for (factor, right) in inverse.iter().zip(right.chunks_exact(columns)) {
                d.iter_mut().zip(right).for_each(|(d, x)| *d += factor * x);
            }
        }
        true
    }
}

/// Weighted sums of the stages of Runge and Kutta's method.
struct State {
    q: Vec<f64>,
    v: Vec<f64>,
    sq: Vec<f64>,
    sv: Vec<f64>,
}

impl State {
    fn moved(&mut self, from: &Self, h: f64, (v, sv): (&[f64], &[f64]), (a, d): (&[f64], &[f64])) {
        add(&mut self.q, &from.q, h, v);
        add(&mut self.v, &from.v, h, a);
        add(&mut self.sq, &from.sq, h, sv);
        add(&mut self.sv, &from.sv, h, d);
    }
}

fn add(to: &mut [f64], from: &[f64], h: f64, slope: &[f64]) {
    to.iter_mut().zip(from.iter().zip(slope)).for_each(|(t, (f, s))| *t = f + h * s);
}

impl Motion<'_> {
    /// Positions of a model along a segment, with derivatives by start and wanted terms: `visit(sample, q, derivatives)`. `false` if it
    /// cannot be followed.
    fn follow(
        &self,
        follower: &mut Follower<'_>,
        segment: &Segment,
        mut visit: impl FnMut(usize, &[f64], &[f64]),
    ) -> bool {
        let (n, columns) = (follower.n, follower.columns);
        let mut sq = vec![0.0; n * columns];
        let mut sv = vec![0.0; n * columns];
        for i in 0..n {
            sq[i * columns + i] = 1.0;
            sv[i * columns + n + i] = 1.0;
        }
        let (q, v) = (segment.start[..n].to_vec(), segment.start[n..].to_vec());
        let mut now = State { q, v, sq, sv };
        let empty =
            || State { q: vec![0.0; n], v: vec![0.0; n], sq: vec![0.0; n * columns], sv: vec![0.0; n * columns] };
        let mut stages = [empty(), empty(), empty()];
        let mut a: [Vec<f64>; 4] = std::array::from_fn(|_| vec![0.0; n]);
        let mut d: [Vec<f64>; 4] = std::array::from_fn(|_| vec![0.0; n * columns]);
        let mut force = vec![0.0; if segment.force.is_empty() { 0 } else { n }];
        visit(0, &now.q, &now.sq);
        for sample in 1..segment.times.len() {
            let whole = segment.times[sample] - segment.times[sample - 1];
            let h = whole / self.substeps as f64;
            for step in 0..self.substeps {
                let at = |share: f64, force: &mut [f64]| {
                    let x = (step as f64 + share) / self.substeps as f64;
                    for (i, f) in force.iter_mut().enumerate() {
                        let [from, to] = [sample - 1, sample].map(|s| segment.force[s * n + i]);
                        *f = from + x * (to - from);
                    }
                };
                let [s2, s3, s4] = &mut stages;
                let [a1, a2, a3, a4] = &mut a;
                let [d1, d2, d3, d4] = &mut d;
                at(0.0, &mut force);
                let mut fine = follower.tangent((&now.q, &now.v), &force, (&now.sq, &now.sv), (a1, d1));
                s2.moved(&now, h / 2.0, (&now.v, &now.sv), (a1, d1));
                at(0.5, &mut force);
                fine &= follower.tangent((&s2.q, &s2.v), &force, (&s2.sq, &s2.sv), (a2, d2));
                s3.moved(&now, h / 2.0, (&s2.v, &s2.sv), (a2, d2));
                fine &= follower.tangent((&s3.q, &s3.v), &force, (&s3.sq, &s3.sv), (a3, d3));
                s4.moved(&now, h, (&s3.v, &s3.sv), (a3, d3));
                at(1.0, &mut force);
                fine &= follower.tangent((&s4.q, &s4.v), &force, (&s4.sq, &s4.sv), (a4, d4));
                if !fine {
                    return false;
                }
                for i in 0..n {
                    now.q[i] += h / 6.0 * (now.v[i] + 2.0 * (s2.v[i] + s3.v[i]) + s4.v[i]);
                    now.v[i] += h / 6.0 * (a1[i] + 2.0 * (a2[i] + a3[i]) + a4[i]);
                }
                for e in 0..n * columns {
                    now.sq[e] += h / 6.0 * (now.sv[e] + 2.0 * (s2.sv[e] + s3.sv[e]) + s4.sv[e]);
                    now.sv[e] += h / 6.0 * (d1[e] + 2.0 * (d2[e] + d3[e]) + d4[e]);
                }
            }
            visit(sample, &now.q, &now.sq);
        }
        now.sq.iter().chain(&now.q).all(|x| x.is_finite())
    }

    fn linear(&self, follower: &mut Follower<'_>, segment: &Segment) -> Option<Linear> {
        let n = follower.n;
        let (columns, width) = (follower.columns, 2 * n);
        let m = columns - width;
        let mut matrix = vec![0.0; columns * columns];
        let mut right = vec![0.0; columns];
        let mut square = 0.0;
        let mut lost = false;
        let fine = self.follow(follower, segment, |sample, q, derivatives| {
            for i in 0..n {
                let sigma = segment.sigma[i];
                let residual = (segment.q[sample * n + i] - q[i]) / sigma;
                lost |= !residual.is_finite();
                let weight = (HUBER / residual.abs()).min(1.0);
                square += weight * residual * residual;
                let row = &derivatives[i * columns..(i + 1) * columns];
                let scale = weight / (sigma * sigma);
                let pull = weight * residual / sigma;
                for a in 0..columns {
                    let x = scale * row[a];
                    right[a] += pull * row[a];
                    if x != 0.0 {
                        let line = &mut matrix[a * columns..a * columns + a + 1];
                        line.iter_mut().zip(row).for_each(|(sum, y)| *sum += x * y);
                    }
                }
            }
        });
        if !fine || lost || !square.is_finite() {
            return None;
        }
        let own: Vec<f64> = (0..width * width)
            .map(|e| (e / width, e % width))
            .map(|(i, j)| matrix[i.max(j) * columns + i.min(j)])
            .collect();
        let inverse = inverse_with(width, &own, 1e-10)?;
        // (2n, m): derivatives by starts times those by coefficients.
        let mixed: Vec<f64> = (0..width * m).map(|e| matrix[(width + e % m.max(1)) * columns + e / m.max(1)]).collect();
        let mut solved = vec![0.0; width * m];
        for i in 0..width {
            for j in 0..width {
                let x = inverse[i * width + j];
                let pairs = solved[i * m..(i + 1) * m].iter_mut().zip(&mixed[j * m..(j + 1) * m]);
                pairs.for_each(|(s, c)| *s += x * c);
            }
        }
        let mut reduced = vec![0.0; m * m];
        for k in 0..m {
            for l in 0..=k {
                let taken: f64 = (0..width).map(|i| mixed[i * m + k] * solved[i * m + l]).sum();
                let value = matrix[(width + k) * columns + width + l] - taken;
                (reduced[k * m + l], reduced[l * m + k]) = (value, value);
            }
        }
        let starts = &right[..width];
        let rest = (0..m).map(|k| right[width + k] - (0..width).map(|i| solved[i * m + k] * starts[i]).sum::<f64>());
        let count = (segment.times.len() * n) as f64 - width as f64;
        let right_reduced = rest.collect();
        let step = StartStep { inverse, mixed, right: starts.to_vec() };
        Some(Linear { matrix: reduced, right: right_reduced, square, count, step })
    }

    /// The linearised motion of all segments in order; those that cannot be followed are `None`.
    fn all(&self, model: &Model, wanted: &[usize], segments: &[Segment]) -> Vec<Option<Linear>> {
        let share = segments.len().div_ceil(self.threads.max(1)).max(1);
        let work = |part: &[Segment]| {
            let mut follower = Follower::new(self.library, model, wanted);
            part.iter().map(|segment| self.linear(&mut follower, segment)).collect::<Vec<_>>()
        };
        if self.threads <= 1 {
            return work(segments);
        }
        std::thread::scope(|scope| {
            let parts: Vec<_> = segments.chunks(share).map(|part| scope.spawn(move || work(part))).collect();
            parts.into_iter().flat_map(|part| part.join().unwrap_or_default()).collect()
        })
    }

    /// Normal equations of some terms at a model, by block.
    pub fn blocks(&self, model: &Model, wanted: &[usize], segments: &[Segment]) -> BTreeMap<usize, BlockSum> {
        let m = wanted.len();
        let mut blocks: BTreeMap<usize, BlockSum> = BTreeMap::new();
        // Few at a time: each holds a matrix of all wanted terms.
        for part in segments.chunks(64) {
            for (segment, found) in part.iter().zip(self.all(model, wanted, part)) {
                let sum = blocks.entry(segment.block).or_insert_with(|| BlockSum::empty(m));
                let Some(linear) = found else {
                    let count = (segment.times.len() * self.library.n()) as f64;
                    sum.failed += 1;
                    sum.square += FAILED * count;
                    sum.count += count;
                    continue;
                };
                sum.matrix.iter_mut().zip(&linear.matrix).for_each(|(s, x)| *s += x);
                sum.right.iter_mut().zip(&linear.right).for_each(|(s, x)| *s += x);
                sum.square += linear.square;
                sum.count += linear.count;
            }
        }
        blocks
    }

    /// Moves the starts alone, so that a model meets the data as well as it can; the sum of squares and the count of residuals.
    pub fn settle(&self, model: &Model, segments: &mut [Segment], iterations: usize) -> (f64, f64) {
        self.improve(&mut model.clone(), segments, iterations, Freedom::Starts);
        self.rescue(model, segments);
        let squares = self.squares(model, segments);
        squares.iter().fold((0.0, 0.0), |(square, count), (s, c)| (square + s, count + c))
    }

    /// Sum of squares and count of residuals of every segment.
    fn squares(&self, model: &Model, segments: &[Segment]) -> Vec<(f64, f64)> {
        let found = self.all(model, &[], segments);
        let of = |(found, segment): (&Option<Linear>, &Segment)| {
            let size = (segment.times.len() * self.library.n()) as f64;
            found.as_ref().map_or((FAILED * size, size), |linear| (linear.square, linear.count))
        };
        found.iter().zip(segments).map(of).collect()
    }

    /// Settles segments anew that are met badly: their first part, then more and more of them, as long as that meets them better.
    fn rescue(&self, model: &Model, segments: &mut [Segment]) {
        const BAD: f64 = 3.0;
        let before = self.squares(model, segments);
        let mut means: Vec<f64> = before.iter().map(|(s, c)| s / c.max(1.0)).collect();
        means.sort_by(f64::total_cmp);
        let usual = means.get(means.len() / 2).copied().unwrap_or(1.0);
        let bad: Vec<usize> =
            (0..segments.len()).filter(|&k| before[k].0 > BAD * usual.max(1.0) * before[k].1.max(1.0)).collect();
        if bad.is_empty() || bad.len() > segments.len() / 3 {
            return;
        }
        let mut tried: Vec<Segment> = bad.iter().map(|&k| segments[k].clone()).collect();
        let n = self.library.n();
        for share in [0.35, 0.65, 1.0] {
            let mut parts: Vec<Segment> = tried
                .iter()
                .map(|whole| {
                    let samples = ((whole.times.len() as f64 * share) as usize).max(2 * n + 2).min(whole.times.len());
                    let mut part = whole.clone();
                    part.times.truncate(samples);
                    part.q.truncate(samples * n);
                    part.force.truncate(samples * n);
                    part
                })
                .collect();
            self.improve(&mut model.clone(), &mut parts, 6, Freedom::Starts);
            tried.iter_mut().zip(parts).for_each(|(whole, part)| whole.start = part.start);
        }
        let after = self.squares(model, &tried);
        for ((&k, segment), (square, _)) in bad.iter().zip(tried).zip(after) {
            if square < before[k].0 {
                segments[k].start = segment.start;
            }
        }
    }

    /// Fits the coefficients and the starts; the sum of squares and the count of residuals.
    pub fn fit(&self, model: &mut Model, segments: &mut [Segment], iterations: usize, scaled: bool) -> (f64, f64) {
        let freedom = if scaled { Freedom::Scaled } else { Freedom::UpToScale };
        self.improve(model, segments, iterations, freedom)
    }

    fn improve(&self, model: &mut Model, segments: &mut [Segment], iterations: usize, freedom: Freedom) -> (f64, f64) {
        let n = self.library.n();
        let wanted = if freedom == Freedom::Starts { vec![] } else { model.terms.clone() };
        let m = wanted.len();
        let mut best: Option<Best> = None;
        let mut change = vec![0.0; m];
        let mut moves = vec![vec![0.0; 2 * n]; segments.len()];
        let mut part = 1.0;
        for _ in 0..iterations {
            let found = self.all(model, &wanted, segments);
            let size = |segment: &Segment| (segment.times.len() * n) as f64;
            let pairs = || found.iter().zip(segments.iter());
            let squares: Vec<f64> =
                pairs().map(|(f, s)| f.as_ref().map_or(FAILED * size(s), |linear| linear.square)).collect();
            let count: f64 = pairs().map(|(f, s)| f.as_ref().map_or(size(s), |linear| linear.count)).sum();
            let square: f64 = squares.iter().sum();
            let starts = || segments.iter().map(|s| s.start.clone()).collect::<Vec<_>>();
            // Segments whose step was too long.
            let mut worse = vec![false; segments.len()];
            match &mut best {
                Some(known) if freedom == Freedom::Starts => {
                    let mut gained = 0.0;
                    for (k, square) in squares.iter().enumerate() {
                        worse[k] = *square >= known.squares[k];
                        if !worse[k] {
                            gained += known.squares[k] - square;
                            known.squares[k] = *square;
                            known.starts[k].clone_from(&segments[k].start);
                        }
                    }
                    known.total = (known.squares.iter().sum(), count);
                    if gained < 1e-4 * known.total.0 {
                        break;
                    }
                }
                Some(known) if square > known.total.0 => {
                    part /= 4.0;
                    if part < 0.01 {
                        break;
                    }
                    place(known, (&change, &moves, part), model, segments);
                    continue;
                }
                Some(known) => {
                    let done = known.total.0 - square < 1e-6 * square && part == 1.0;
                    *known = Best { total: (square, count), model: model.clone(), starts: starts(), squares };
                    if done {
                        break;
                    }
                    part = f64::min(2.0 * part, 1.0);
                }
                None => best = Some(Best { total: (square, count), model: model.clone(), starts: starts(), squares }),
            }
            let Some(known) = &best else { break };
            if m > 0 {
                let mut sum = BlockSum::empty(m);
                for linear in found.iter().flatten() {
                    sum.matrix.iter_mut().zip(&linear.matrix).for_each(|(s, x)| *s += x);
                    sum.right.iter_mut().zip(&linear.right).for_each(|(s, x)| *s += x);
                }
                if freedom == Freedom::UpToScale {
                    self.pin(model, &wanted, segments, &mut sum);
                }
                let Some(inverse) = inverse_with(m, &sum.matrix, DAMPING) else { break };
                change = times(m, &inverse, &sum.right);
            }
            for ((step, found), worse) in moves.iter_mut().zip(&found).zip(&worse) {
                match found.as_ref().map(|linear| &linear.step) {
                    Some(StartStep { inverse, mixed, right }) if !worse => {
                        let rest = (0..2 * n).map(|i| right[i] - dot(&mixed[i * m..(i + 1) * m], &change));
                        *step = times(2 * n, inverse, &rest.collect::<Vec<_>>());
                    }
                    _ => step.iter_mut().for_each(|x| *x *= 0.25),
                }
            }
            place(known, (&change, &moves, part), model, segments);
        }
        let Some(Best { total, model: found, starts, .. }) = best else { return (f64::INFINITY, 1.0) };
        *model = found;
        segments.iter_mut().zip(starts).for_each(|(segment, start)| segment.start = start);
        total
    }

    /// Mean size of the mass matrix of wanted terms relative to the model's, over the starts of segments: 1 for the model itself.
    pub fn sizes(&self, model: &Model, wanted: &[usize], segments: &[Segment]) -> Vec<f64> {
        let n = self.library.n();
        let mut sizes = vec![0.0; wanted.len()];
        let mut follower = Follower::new(self.library, model, wanted);
        let (mut a, mut inverse) = (vec![0.0; n], vec![0.0; n * n]);
        let mut count = 0.0;
        let stride = segments.len().div_ceil(200).max(1);
        for segment in segments.iter().step_by(stride) {
            let (q, v) = segment.start.split_at(n);
            if !follower.acceleration((q, v), &[], &mut a) {
                continue;
            }
            if linalg::inverse(n, &follower.mass, &mut inverse, &mut follower.workspace).is_err() {
                continue;
            }
            count += n as f64;
            for (size, &k) in sizes.iter_mut().zip(wanted) {
                if let Some((i, j)) = self.library.kinetic(k) {
                    let value = follower.values[self.library.terms[k].function].value;
                    *size += value * (inverse[i * n + j] + inverse[j * n + i]);
                }
            }
        }
        sizes.iter_mut().for_each(|size| *size /= f64::max(count, 1.0));
        sizes
    }

    /// Fixes the common factor of normal equations, of which the motion says nothing, at the model's.
    pub fn pin(&self, model: &Model, wanted: &[usize], segments: &[Segment], sum: &mut BlockSum) {
        let m = wanted.len();
        let sizes = self.sizes(model, wanted, segments);
        let own = model.terms.iter().zip(&model.coefficients);
        let own = own.filter_map(|(k, c)| wanted.iter().position(|w| w == k).map(|at| sum.matrix[at * m + at] * c * c));
        let weight = own.fold(1.0, f64::max);
        for i in 0..m {
            for j in 0..m {
                sum.matrix[i * m + j] += weight * sizes[i] * sizes[j];
            }
        }
    }

    /// Residuals of every sample in units of noise, `(samples, n)`; `None` for segments that cannot be followed.
    pub fn residuals(&self, model: &Model, segments: &[Segment]) -> Vec<Option<Vec<f64>>> {
        let n = self.library.n();
        let mut follower = Follower::new(self.library, model, &[]);
        let of = |segment: &Segment| {
            let mut all = Vec::with_capacity(segment.q.len());
            let fine = self.follow(&mut follower, segment, |sample, q, _| {
                all.extend((0..n).map(|i| (segment.q[sample * n + i] - q[i]) / segment.sigma[i]));
            });
            (fine && all.iter().all(|r| r.is_finite())).then_some(all)
        };
        segments.iter().map(of).collect()
    }

    /// As many integration steps from sample to sample as keep the integrator's error below a twentieth of the noise.
    pub fn choose_steps(&mut self, model: &Model, segments: &[Segment]) {
        let stride = segments.len().div_ceil(24).max(1);
        let probes: Vec<&Segment> = segments.iter().step_by(stride).collect();
        let ends = |motion: &Self| {
            let mut follower = Follower::new(motion.library, model, &[]);
            let of = |segment: &&Segment| {
                let mut end = vec![f64::NAN; motion.library.n()];
                let fine = motion.follow(&mut follower, segment, |_, q, _| end.copy_from_slice(q));
                if fine { end } else { vec![f64::NAN; motion.library.n()] }
            };
            probes.iter().map(of).collect::<Vec<_>>()
        };
        let mut coarse = ends(self);
        while self.substeps < 16 {
            let finer = Self { substeps: 2 * self.substeps, ..self.clone() };
            let fine = ends(&finer);
            let pairs = coarse.iter().zip(&fine).zip(&probes);
            let mut errors: Vec<f64> = pairs
                .flat_map(|((a, b), probe)| a.iter().zip(b).zip(&probe.sigma).map(|((a, b), s)| ((a - b) / s).abs()))
                .filter(|e| e.is_finite())
                .collect();
            errors.sort_by(f64::total_cmp);
            let worst = errors.get(errors.len() * 9 / 10).copied().unwrap_or(0.0);
            if worst < 0.05 {
                break;
            }
            (self.substeps, coarse) = (finer.substeps, fine);
        }
    }
}

/// The best model and starts so far, with the sum of squares of every segment.
struct Best {
    total: (f64, f64),
    model: Model,
    starts: Vec<Vec<f64>>,
    squares: Vec<f64>,
}

/// Puts model and starts at part of a step from the best.
fn place(best: &Best, (change, moves, part): (&[f64], &[Vec<f64>], f64), model: &mut Model, segments: &mut [Segment]) {
    model.coefficients.clone_from(&best.model.coefficients);
    model.coefficients.iter_mut().zip(change).for_each(|(c, d)| *c += part * d);
    for ((segment, start), step) in segments.iter_mut().zip(&best.starts).zip(moves) {
        segment.start.clone_from(start);
        segment.start.iter_mut().zip(step).for_each(|(s, d)| *s += part * d);
    }
}

/// What a fit may change.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Freedom {
    Starts,
    /// Known forces give the factor of the coefficients.
    Scaled,
    UpToScale,
}
