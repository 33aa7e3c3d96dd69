//! Chooses terms by fits to the motion.

use super::found::RangeResidual;
use super::function::Notation;
use super::library::{Library, Values};
use super::motion::{BlockSum, Model, Motion, inflation, total};
use super::quotient::Quotient;
use super::regular::is_regular;
use super::thresholds::{
    COMBINATION_REMAINDER, CONVERGED_DECREMENT, FIT_STEPS, LEAST_DETERMINANT_RATIO, MOST_FINAL_FITS, RESIDUAL_RANGES,
    RIDGE, TERM_COST,
};
use super::wald::{Equations, Survivors, survivors};
use crate::identification::Segment;
use crate::identification::linear::{inverse_with, part, times};
use crate::linalg::{self, Workspace, dot};
use crate::random::RngStream;
use rand::Rng;
use std::collections::BTreeMap;

/// A search through the motion.
pub(super) struct Search<'a> {
    pub library: &'a Library,
    pub motion: Motion<'a>,
    pub candidates: Vec<usize>,
    /// States at which a mass matrix must be regular.
    pub states: Vec<Values>,
}

impl Search<'_> {
    pub fn model_over_candidates(&self, model: &Model) -> Vec<f64> {
        let of = |k: &usize| model.terms.iter().position(|t| t == k).map_or(0.0, |at| model.coefficients[at]);
        self.candidates.iter().map(of).collect()
    }

    /// Mass matrices at the states, `(states, n, n)`.
    pub fn masses(&self, terms: &[usize], coefficients: &[f64]) -> Vec<f64> {
        let n = self.library.n();
        let mut masses = vec![0.0; self.states.len() * n * n];
        for (values, mass) in self.states.iter().zip(masses.chunks_exact_mut(n * n)) {
            self.library.mass_matrix(terms, coefficients, values, mass);
        }
        masses
    }

    /// `true` if terms give a mass matrix that is not nearly singular relative to that of a model, and equally definite. Lagrangians of the
    /// same motion may differ in this: with a cyclic coordinate, any multiple of the square of its momentum may be added.
    pub fn regular(&self, model: &Model, (terms, coefficients): (&[usize], &[f64])) -> bool {
        let n = self.library.n();
        let eigenvalues = |mass: &[f64]| {
            let mut eigenvalues = vec![0.0; self.states.len() * n];
            // States that fail are NaN.
            let _ = linalg::eigenvalues(n, mass, &mut eigenvalues, &mut Workspace::new());
            eigenvalues
        };
        let changed = self.masses(terms, coefficients);
        if !is_regular(n, &changed) {
            return false;
        }
        let own = eigenvalues(&self.masses(&model.terms, &model.coefficients));
        let other = eigenvalues(&changed);
        let determinant = |values: &[f64]| values.iter().product::<f64>().abs();
        let negative = |values: &[f64]| values.iter().filter(|x| **x < 0.0).count();
        let pairs = own.chunks_exact(n).zip(other.chunks_exact(n)).filter(|(own, _)| determinant(own) > 0.0);
        let ratio = |(own, other): (&[f64], &[f64])| {
            let as_definite = negative(other) == 0 || negative(other) == negative(own);
            if as_definite { determinant(other) / determinant(own) } else { 0.0 }
        };
        let mut ratios: Vec<f64> = pairs.map(ratio).collect();
        ratios.sort_by(f64::total_cmp);
        ratios.get(ratios.len() / 4).is_none_or(|ratio| *ratio > LEAST_DETERMINANT_RATIO)
    }

    /// The terms that remain if every block counts with its weight.
    pub fn survivors(
        &self,
        model: &Model,
        segments: &[Segment],
        blocks: &BTreeMap<usize, BlockSum>,
        weight: &dyn Fn(usize) -> f64,
    ) -> Option<Survivors> {
        let mut sum = total(blocks, weight);
        self.motion.pin(model, &self.candidates, segments, &mut sum);
        let coefficients = self.model_over_candidates(model);
        let complexity: Vec<f64> = self.candidates.iter().map(|&k| self.library.complexity(k)).collect();
        let equations =
            Equations { matrix: &sum.matrix, right: &sum.right, coefficients: &coefficients, complexity: &complexity };
        // The residual with all terms counts as noise.
        let m = self.candidates.len();
        let change = times(m, &inverse_with(m, &sum.matrix, RIDGE)?, &sum.right);
        let noise = inflation(blocks, weight, &sum, &change);
        survivors(&equations, TERM_COST * noise, &|x| self.regular(model, (&self.candidates, x)))
    }

    /// Refits and chooses terms again until they no longer change; returns the normal equations at the end, by block, and `false` if the choice
    /// did not converge.
    pub fn converge(
        &self,
        model: &mut Model,
        segments: &mut [Segment],
        rounds: usize,
    ) -> (BTreeMap<usize, BlockSum>, bool) {
        let mut seen: Vec<Vec<usize>> = Vec::new();
        for round in 0.. {
            self.motion.fit_initial_states(model, segments, 4);
            self.motion.fit(model, segments, FIT_STEPS);
            let blocks = self.motion.blocks(model, &self.candidates, segments);
            if round >= rounds || self.motion.data.cancellation.is_cancelled() {
                return (blocks, rounds == 0);
            }
            let Some(found) = self.survivors(model, segments, &blocks, &|_| 1.0) else { return (blocks, true) };
            let terms: Vec<usize> = found.set.iter().map(|&k| self.candidates[k]).collect();
            tracing::debug!(
                round,
                next = found.next,
                terms = terms.iter().map(|&k| self.library.written(k, Notation::System)).collect::<Vec<_>>().join(" "),
                "formula"
            );
            if terms == model.terms || seen.contains(&terms) {
                return (blocks, true);
            }
            seen.push(terms.clone());
            let coefficients = found.set.iter().map(|&k| found.coefficients[k]).collect();
            (model.terms, model.coefficients) = (terms, coefficients);
        }
        (BTreeMap::new(), true)
    }
}

/// Bootstrap results for each candidate.
pub(super) struct Resampled {
    /// Fraction of the bootstrap samples that keep the term.
    pub share: BTreeMap<usize, f64>,
    /// Its coefficients, 0 where it is removed.
    pub coefficients: BTreeMap<usize, Vec<f64>>,
}

impl Resampled {
    /// Probabilities of a model's terms; a term that replaced others has the smallest of theirs.
    pub fn probabilities(&self, model: &Model, replaced: &BTreeMap<usize, Vec<usize>>) -> Vec<f64> {
        let share = |k: &usize| self.share.get(k).copied().unwrap_or(1.0);
        let probability = |k: &usize| match replaced.get(k) {
            Some(replaced) => replaced.iter().map(share).fold(1.0, f64::min),
            None => share(k),
        };
        model.terms.iter().map(probability).collect()
    }
}

impl Search<'_> {
    /// Draws blocks at random, and chooses the terms for each bootstrap sample.
    pub fn resample(
        &self,
        model: &Model,
        blocks: &BTreeMap<usize, BlockSum>,
        segments: &[Segment],
        (draws, seed): (usize, u64),
    ) -> Resampled {
        let mut rng = RngStream::Segments.generator(seed);
        let names: Vec<usize> = blocks.keys().copied().collect();
        let mut drawn: Vec<Survivors> = Vec::new();
        for _ in (0..draws).take_while(|_| self.motion.data.cancellation.go_on()) {
            let mut weights: BTreeMap<usize, f64> = BTreeMap::new();
            for _ in &names {
                *weights.entry(names[rng.random_range(0..names.len())]).or_default() += 1.0;
            }
            let weight = |block: usize| weights.get(&block).copied().unwrap_or(0.0);
            drawn.extend(self.survivors(model, segments, blocks, &weight));
        }
        let count = drawn.len().max(1) as f64;
        let (mut share, mut coefficients) = (BTreeMap::new(), BTreeMap::new());
        for (at, &k) in self.candidates.iter().enumerate() {
            let kept = drawn.iter().filter(|found| found.set.contains(&at)).count();
            share.insert(k, kept as f64 / count);
            coefficients.insert(k, drawn.iter().map(|found| found.coefficients[at]).collect());
        }
        Resampled { share, coefficients }
    }
}

/// Replaces two terms by one that is a combination of them where the motion allows it; returns what each new term replaced.
pub(super) fn shorten(
    search: &Search<'_>,
    quotient: &Quotient,
    model: &mut Model,
    segments: &mut [Segment],
) -> BTreeMap<usize, Vec<usize>> {
    let mut replaced: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
    loop {
        let m = model.terms.len();
        let blocks = search.motion.blocks(model, &model.terms, segments);
        let mut sum = total(&blocks, &|_| 1.0);
        let inflation = sum.inflation;
        search.motion.pin(model, &model.terms, segments, &mut sum);
        let own: Vec<Option<usize>> = model.terms.iter().map(|k| quotient.kept.iter().position(|t| t == k)).collect();
        let mut best: Option<(f64, Vec<usize>, Model)> = None;
        for (term, over) in quotient.over_kept.iter().enumerate() {
            let Some(over) = over.as_ref().filter(|_| !model.terms.contains(&term)) else { continue };
            // The new term as a combination of two of the model's own terms, if it is one.
            let support: Vec<usize> = (0..over.len()).filter(|&k| over[k].abs() > COMBINATION_REMAINDER).collect();
            let inside = |k: &usize| own.contains(&Some(*k));
            if support.len() != 2 || !support.iter().all(inside) {
                continue;
            }
            let column: Vec<f64> = own.iter().map(|k| k.map_or(0.0, |k| over[k])).collect();
            let gone: Vec<usize> = (0..m).filter(|&k| column[k].abs() > COMBINATION_REMAINDER).collect();
            let rest: Vec<usize> = (0..m).filter(|k| !gone.contains(k)).collect();
            // Directions of the shorter model in the coefficients of the longer one.
            let mut directions: Vec<Vec<f64>> =
                rest.iter().map(|&k| (0..m).map(|i| f64::from(u8::from(i == k))).collect()).collect();
            directions.push(column);
            let size = directions.len();
            let images: Vec<Vec<f64>> = directions.iter().map(|d| times(m, &sum.matrix, d)).collect();
            let normal: Vec<f64> = (0..size * size).map(|e| dot(&directions[e / size], &images[e % size])).collect();
            let right: Vec<f64> = images.iter().map(|i| dot(i, &model.coefficients)).collect();
            let Some(inverse) = inverse_with(size, &normal, RIDGE) else { continue };
            let x = times(size, &inverse, &right);
            let whole = dot(&model.coefficients, &times(m, &sum.matrix, &model.coefficients));
            let cost = whole - dot(&x, &right);
            let better = cost < TERM_COST * inflation && best.as_ref().is_none_or(|(least, ..)| cost < *least);
            let terms: Vec<usize> = rest.iter().map(|&k| model.terms[k]).chain([term]).collect();
            if better && search.regular(model, (&terms, &x)) {
                best = Some((cost, gone, Model { terms, coefficients: x, frequency: model.frequency }));
            }
        }
        let Some((_, gone, shorter)) = best.filter(|_| search.motion.data.cancellation.go_on()) else {
            return replaced;
        };
        let old = gone.iter().flat_map(|&k| replaced.get(&model.terms[k]).cloned().unwrap_or(vec![model.terms[k]]));
        replaced.insert(shorter.terms[shorter.terms.len() - 1], old.collect());
        *model = shorter;
        search.motion.fit(model, segments, FIT_STEPS);
    }
}

/// Covariance of a fit.
pub(super) struct Covariance {
    /// Covariance of the coefficients with the common factors fixed, `(terms, terms)`.
    pub coefficients: Vec<f64>,
    /// Standard error of the frequency of the drive, if there is one.
    pub frequency: Option<f64>,
    /// `false` if the fit has not converged.
    pub converged: bool,
}

/// Refits a model until the fit has converged; returns the covariance of its coefficients.
pub(super) fn covariance(search: &Search<'_>, model: &mut Model, segments: &mut [Segment]) -> Covariance {
    let terms = model.terms.len();
    let driven = search.motion.is_driven(model);
    let m = terms + usize::from(driven);
    let of = |whole: &[f64], converged: bool| {
        let places: Vec<usize> = (m - terms..m).collect();
        let frequency = driven.then(|| whole[0].max(0.0).sqrt());
        Covariance { coefficients: part(m, whole, &places), frequency, converged }
    };
    let mut last = of(&vec![f64::NAN; m * m], false);
    for _ in 0..MOST_FINAL_FITS {
        let blocks = search.motion.own_blocks(model, segments);
        let mut sum = total(&blocks, &|_| 1.0);
        search.motion.pin(model, &model.terms, segments, &mut sum);
        let Some(inverse) = inverse_with(m, &sum.matrix, RIDGE) else { return last };
        let decrement = dot(&sum.right, &times(m, &inverse, &sum.right)) / sum.inflation;
        let whole: Vec<f64> = inverse.into_iter().map(|x| x * sum.inflation).collect();
        last = of(&whole, decrement < CONVERGED_DECREMENT);
        if last.converged {
            break;
        }
        tracing::debug!(decrement, "fit goes on");
        search.motion.fit(model, segments, FIT_STEPS);
    }
    last
}

/// Residuals over noise by parts of the range of every coordinate.
pub(super) fn left_over(motion: &Motion<'_>, model: &Model, segments: &[Segment]) -> Vec<RangeResidual> {
    let (n, bounds) = (motion.data.n, &motion.data.bounds);
    let mut sums = vec![[0.0; 2]; n * RESIDUAL_RANGES];
    for (segment, residuals) in segments.iter().zip(motion.residuals(model, segments)) {
        let q = &motion.data.recording.tracks[segment.track].q[segment.first * n..];
        for (row, residual) in q.chunks_exact(n).zip(residuals.chunks_exact(n)) {
            let square = residual.iter().map(|r| r * r).sum::<f64>() / n as f64;
            for (i, x) in row.iter().enumerate().filter(|_| square.is_finite()) {
                let share = (x - bounds[i][0]) / (bounds[i][1] - bounds[i][0]);
                let at = ((share * RESIDUAL_RANGES as f64) as usize).min(RESIDUAL_RANGES - 1);
                sums[i * RESIDUAL_RANGES + at][0] += square;
                sums[i * RESIDUAL_RANGES + at][1] += 1.0;
            }
        }
    }
    let of = |(e, [square, count]): (usize, &[f64; 2])| {
        let (i, at) = (e / RESIDUAL_RANGES, e % RESIDUAL_RANGES);
        let step = (bounds[i][1] - bounds[i][0]) / RESIDUAL_RANGES as f64;
        let low = bounds[i][0] + at as f64 * step;
        RangeResidual {
            coordinate: i,
            low,
            high: low + step,
            residual: (square / count).sqrt(),
            samples: *count as usize,
        }
    };
    sums.iter().enumerate().map(of).filter(|left| left.samples > 0).collect()
}
