//! Fits the coefficients of terms to the motion: the multiple shooting of [`identification`](crate::identification), with all terms of a
//! library.

use super::library::{Library, Values};
use super::prepared::Prepared;
use super::thresholds::{FAILED_SQUARE, FIT_STEPS, LEAST_SCORED_BLOCKS, RESCUED_RESIDUAL, SEGMENTS_AT_A_TIME};
use crate::identification::linear::times;
use crate::identification::{Between, Disturbances, DrivenEquations, Problem, Segment, choose_steps};
use crate::lagrangian::system::Range;
use crate::linalg::{self, Workspace, dot};
use std::collections::BTreeMap;

/// Terms with their coefficients.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Model {
    pub terms: Vec<usize>,
    pub coefficients: Vec<f64>,
    /// Angular frequency of the drive in rad/s, 0 without one.
    pub frequency: f64,
}

/// Integrates segments with models of a library.
#[derive(Clone, Debug)]
pub(super) struct Motion<'a> {
    pub library: &'a Library,
    pub data: &'a Prepared<'a>,
    /// Integration steps between samples.
    pub substeps: usize,
    /// Known forces between the samples.
    pub between: Between,
    pub threads: usize,
}

/// Normal equations of a block, with its initial states eliminated.
#[derive(Clone, Debug)]
pub(super) struct BlockSum {
    pub matrix: Vec<f64>,
    pub right: Vec<f64>,
    /// Sum of squared residuals in units of noise, large ones counted linearly.
    pub square: f64,
    /// Number of residuals minus the numbers of initial states.
    pub count: f64,
    /// Variance of the scores of coefficients over that of independent noise, at least 1: residuals of an imperfect model are correlated along
    /// the motion and carry less information than their number suggests.
    pub inflation: f64,
}

/// Sum over blocks.
pub(super) fn total(blocks: &BTreeMap<usize, BlockSum>, weight: &dyn Fn(usize) -> f64) -> BlockSum {
    let mut sum = BlockSum::empty(blocks.values().next().map_or(0, |part| part.right.len()));
    for (&block, part) in blocks {
        sum.add(weight(block), part);
    }
    sum.inflation = inflation(blocks, weight, &sum, &vec![0.0; sum.right.len()]);
    sum
}

/// The median over the coefficients of the scatter of the blocks' scores, over the scatter of noise; at least the mean squared residual, and 1.
pub(super) fn inflation(
    blocks: &BTreeMap<usize, BlockSum>,
    weight: &dyn Fn(usize) -> f64,
    sum: &BlockSum,
    change: &[f64],
) -> f64 {
    let m = sum.right.len();
    let square = ((sum.square - dot(&sum.right, change)) / sum.count.max(1.0)).max(1.0);
    let whole: f64 = blocks.keys().map(|&block| weight(block)).sum();
    if whole < LEAST_SCORED_BLOCKS {
        return square;
    }
    let scores: Vec<(f64, Vec<f64>)> = blocks
        .iter()
        .map(|(&block, part)| {
            let taken = times(m, &part.matrix, change);
            (weight(block), part.right.iter().zip(taken).map(|(score, taken)| score - taken).collect())
        })
        .collect();
    let ratio = |k: usize| {
        let mean = scores.iter().map(|(weight, score)| weight * score[k]).sum::<f64>() / whole;
        let scatter: f64 = scores.iter().map(|(weight, score)| weight * (score[k] - mean).powi(2)).sum();
        scatter * whole / (whole - 1.0) / sum.matrix[k * m + k]
    };
    let mut ratios: Vec<f64> = (0..m).map(ratio).filter(|ratio| ratio.is_finite()).collect();
    ratios.sort_by(f64::total_cmp);
    ratios.get(ratios.len() / 2).copied().unwrap_or(1.0).max(square)
}

impl BlockSum {
    fn empty(m: usize) -> Self {
        Self { matrix: vec![0.0; m * m], right: vec![0.0; m], square: 0.0, count: 0.0, inflation: 1.0 }
    }

    fn add(&mut self, weight: f64, part: &Self) {
        self.matrix.iter_mut().zip(&part.matrix).for_each(|(s, p)| *s += weight * p);
        self.right.iter_mut().zip(&part.right).for_each(|(s, p)| *s += weight * p);
        self.square += weight * part.square;
        self.count += weight * part.count;
    }
}

impl Motion<'_> {
    /// `true` if a model has terms of a drive.
    pub fn is_driven(&self, model: &Model) -> bool {
        model.terms.iter().any(|&k| self.library.is_driven(k))
    }

    /// Multiple shooting with a model. The unknowns are the frequency of its drive, if requested, and the coefficients of the wanted terms,
    /// which the model need not all have; `None` for a formula that cannot be recorded.
    fn shooting<T>(
        &self,
        model: &Model,
        (frequency, wanted): (bool, &[usize]),
        work: impl FnOnce(&mut Problem<'_>, Vec<f64>) -> T,
    ) -> Option<T> {
        let others = wanted.iter().copied().filter(|k| !model.terms.contains(k));
        let all: Vec<usize> = model.terms.iter().copied().chain(others).collect();
        let mut values = model.coefficients.clone();
        values.resize(all.len(), 0.0);
        values.extend(self.library.drive.iter().map(|_| model.frequency));
        let first: &[usize] = if frequency { &[all.len()] } else { &[] };
        let places = wanted.iter().filter_map(|k| all.iter().position(|known| known == k));
        let chosen: Vec<usize> = first.iter().copied().chain(places).collect();
        let x = chosen.iter().map(|&at| values[at]).collect();
        let equations = self.library.equations(&model.terms, values.len(), (first, wanted)).ok()?;
        let data = self.data;
        let driven = DrivenEquations {
            recording: data.recording,
            equations: &equations,
            chosen: chosen.len(),
            between: self.between,
            inputs: Vec::new(),
            step: data.step,
            substeps: self.substeps,
        };
        let mut problem = Problem {
            driven,
            ranges: vec![Range::Any; values.len()],
            values,
            chosen,
            sensors: Vec::new(),
            measured: None,
            sigma: data.sigma.clone(),
            sigma_of: data.sigma_of.clone(),
            errors: &[],
            missing: &[],
            gaps: Vec::new(),
            spread: data.spread.clone(),
            robust: true,
            disturbances: Disturbances::default(),
            threads: self.threads,
            cancellation: data.cancellation.clone(),
        };
        Some(work(&mut problem, x))
    }

    /// Normal equations of some terms at a model, by block, with the frequency of the drive fixed.
    pub fn blocks(&self, model: &Model, wanted: &[usize], segments: &[Segment]) -> BTreeMap<usize, BlockSum> {
        self.blocks_of(model, (false, wanted), segments)
    }

    /// The same for all unknowns of a model: first the frequency if it has a drive, then its coefficients.
    pub fn own_blocks(&self, model: &Model, segments: &[Segment]) -> BTreeMap<usize, BlockSum> {
        self.blocks_of(model, (self.is_driven(model), &model.terms), segments)
    }

    fn blocks_of(&self, model: &Model, unknowns: (bool, &[usize]), segments: &[Segment]) -> BTreeMap<usize, BlockSum> {
        let m = unknowns.1.len() + usize::from(unknowns.0);
        let mut blocks: BTreeMap<usize, BlockSum> = BTreeMap::new();
        self.shooting(model, unknowns, |problem, x| {
            for part in segments.chunks(SEGMENTS_AT_A_TIME) {
                for (segment, found) in part.iter().zip(problem.all(&x, part)) {
                    let sum = blocks.entry(self.data.block_of(segment)).or_insert_with(|| BlockSum::empty(m));
                    if found.is_none() {
                        let count = (segment.samples * self.library.n()) as f64;
                        sum.square += FAILED_SQUARE * count;
                        sum.count += count;
                        continue;
                    }
                    let normal = problem.normal(&[found], std::slice::from_ref(segment));
                    let (matrix, right) = (normal.matrix, normal.right);
                    let part = BlockSum { matrix, right, square: normal.square, count: normal.count, inflation: 1.0 };
                    sum.add(1.0, &part);
                }
            }
        });
        blocks
    }

    /// Fits the initial states alone, with the model fixed; returns the sum of squares and the number of residuals.
    pub fn fit_initial_states(&self, model: &Model, segments: &mut [Segment], iterations: usize) -> (f64, f64) {
        let squares = self.shooting(model, (false, &[]), |problem, x| {
            problem.fit_starts(&x, segments, iterations);
            rescue(problem, &x, segments)
        });
        let squares = squares.unwrap_or(vec![(f64::INFINITY, 1.0)]);
        squares.iter().fold((0.0, 0.0), |(square, count), (s, c)| (square + s, count + c))
    }

    /// Fits the coefficients, the frequency of the drive if there is one, and the initial states.
    pub fn fit(&self, model: &mut Model, segments: &mut [Segment], iterations: usize) {
        let driven = self.is_driven(model);
        let fitted = self.shooting(model, (driven, &model.terms), |problem, mut x| {
            problem.fit(&mut x, segments, iterations);
            x
        });
        let Some(mut fitted) = fitted else { return };
        if driven {
            model.frequency = fitted.remove(0);
        }
        model.coefficients = fitted;
    }

    /// Mean size of the mass matrix of the wanted terms relative to the model's, over the initial states of segments, for every block of
    /// coordinates whose factor no forces determine: 1 for the model itself.
    fn sizes(&self, model: &Model, wanted: &[usize], segments: &[Segment]) -> Vec<Vec<f64>> {
        let n = self.library.n();
        let mut blocks = self.library.blocks(&model.terms);
        blocks.retain(|block| !block.iter().any(|&i| self.data.forced[i]));
        let mut sizes = vec![vec![0.0; wanted.len()]; blocks.len()];
        let functions = self.library.functions_of(&[&model.terms, wanted].concat());
        let (mut values, mut workspace) = (Values::new(), Workspace::new());
        let (mut mass, mut inverse) = (vec![0.0; n * n], vec![0.0; n * n]);
        let mut count: f64 = 0.0;
        let stride = segments.len().div_ceil(200).max(1);
        for segment in segments.iter().step_by(stride) {
            self.library.evaluate(&functions, (&segment.start[..n], 0.0), &mut values);
            self.library.mass_matrix(&model.terms, &model.coefficients, &values, &mut mass);
            if linalg::inverse(n, &mass, &mut inverse, &mut workspace).is_err() {
                continue;
            }
            count += 1.0;
            for (at, &k) in wanted.iter().enumerate() {
                let Some((i, j)) = self.library.kinetic(k) else { continue };
                let value = values[self.library.terms[k].function].value;
                // The inverse is 0 between coordinates in different blocks.
                if let Some(block) = blocks.iter().position(|block| block.contains(&i)) {
                    sizes[block][at] += value * (inverse[i * n + j] + inverse[j * n + i]);
                }
            }
        }
        for (sizes, block) in sizes.iter_mut().zip(&blocks) {
            sizes.iter_mut().for_each(|size| *size /= count.max(1.0) * block.len() as f64);
        }
        sizes
    }

    /// Fixes the common factor of every block at the model's, because the motion without forces does not determine it. The wanted terms are the
    /// last unknowns of the sum.
    pub fn pin(&self, model: &Model, wanted: &[usize], segments: &[Segment], sum: &mut BlockSum) {
        let m = sum.right.len();
        let first = m - wanted.len();
        let sizes = self.sizes(model, wanted, segments);
        let own = model.terms.iter().zip(&model.coefficients);
        let size = |at: usize, c: f64| sum.matrix[(first + at) * m + first + at] * c * c;
        let own = own.filter_map(|(k, c)| wanted.iter().position(|w| w == k).map(|at| size(at, *c)));
        let weight = own.fold(1.0, f64::max);
        for sizes in &sizes {
            for i in 0..wanted.len() {
                for j in 0..wanted.len() {
                    sum.matrix[(first + i) * m + first + j] += weight * sizes[i] * sizes[j];
                }
            }
        }
    }

    /// The interpolation of known forces that fits the motion best; returns the model and its segments with it.
    pub fn choose_between(&mut self, model: &mut Model, segments: &mut [Segment]) {
        let mut least = self.fit_initial_states(model, segments, 1).0;
        let from = (model.clone(), segments.to_vec());
        let mut best = self.between;
        for between in [Between::Held, Between::Cubic, Between::BandLimited] {
            self.between = between;
            let (mut tried, mut starts) = from.clone();
            self.fit_initial_states(&tried, &mut starts, 3);
            self.fit(&mut tried, &mut starts, FIT_STEPS);
            let square = self.fit_initial_states(&tried, &mut starts, 1).0;
            if square < least {
                (least, best) = (square, between);
                *model = tried;
                segments.clone_from_slice(&starts);
            }
        }
        self.between = best;
    }

    /// Residuals of every sample in units of noise, `(samples, n)`; `NaN` from where a segment cannot be followed.
    pub fn residuals(&self, model: &Model, segments: &[Segment]) -> Vec<Vec<f64>> {
        self.shooting(model, (false, &[]), |problem, x| problem.all_residuals(&x, segments)).unwrap_or_default()
    }

    /// Chooses as many integration steps between samples as keep the integrator's error below a share of the noise.
    pub fn choose_steps(&mut self, model: &Model, segments: &[Segment]) {
        let steps = self.shooting(model, (false, &[]), |problem, x| {
            choose_steps(problem, &x, segments);
            problem.driven.substeps
        });
        self.substeps = steps.unwrap_or(self.substeps);
    }
}

/// Sum of squares and number of residuals of every segment.
fn squares(problem: &Problem<'_>, x: &[f64], segments: &[Segment]) -> Vec<(f64, f64)> {
    let of = |(found, segment): (Option<_>, &Segment)| {
        let size = (segment.samples * problem.sigma.len()) as f64;
        found
            .map_or((FAILED_SQUARE * size, size), |linear: crate::identification::Linear| (linear.square, linear.count))
    };
    problem.all(x, segments).into_iter().zip(segments).map(of).collect()
}

/// Fits segments with large residuals again: first their beginning, then longer and longer parts while the fit improves. Returns the sum of
/// squares and the number of residuals of every segment.
fn rescue(problem: &Problem<'_>, x: &[f64], segments: &mut [Segment]) -> Vec<(f64, f64)> {
    let mut found = squares(problem, x, segments);
    let mut means: Vec<f64> = found.iter().map(|(s, c)| s / c.max(1.0)).collect();
    means.sort_by(f64::total_cmp);
    let usual = means.get(means.len() / 2).copied().unwrap_or(1.0).max(1.0);
    let bad: Vec<usize> =
        (0..segments.len()).filter(|&k| found[k].0 > RESCUED_RESIDUAL * usual * found[k].1.max(1.0)).collect();
    if bad.is_empty() || bad.len() > segments.len() / 3 {
        return found;
    }
    let mut tried: Vec<Segment> = bad.iter().map(|&k| segments[k].clone()).collect();
    let least = 2 * problem.sigma.len() + 2;
    for share in [0.35, 0.65, 1.0] {
        for (part, &k) in tried.iter_mut().zip(&bad) {
            let whole = segments[k].samples;
            part.samples = ((whole as f64 * share) as usize).max(least).min(whole);
        }
        problem.fit_starts(x, &mut tried, 6);
    }
    let after = squares(problem, x, &tried);
    for ((k, segment), after) in bad.into_iter().zip(tried).zip(after) {
        if after.0 < found[k].0 {
            (segments[k].start, found[k]) = (segment.start, after);
        }
    }
    found
}
