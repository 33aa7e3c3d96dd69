//! From recorded motion to a formula.

use super::error::FormulaError;
use super::found::{FoundFormula, Left, Verdict};
use super::function::Notation;
use super::library::{Extent, Families, Library, Quotient, Values};
use super::motion::{BlockSum, Model, Motion, inflation, total};
use super::select::{Path, eliminate_backward};
use super::wald::{Equations, RIDGE, Survivors, survivors};
use super::weak::{Stretch, Windows};
use crate::cancellation::Cancellation;
use crate::identification::linear::{inverse_with, part, times};
use crate::identification::{Segment, joined, spread_of};
use crate::linalg::{self, Workspace, dot};
use crate::random::RngStream;
use crate::recording::smooth::{SmoothOptions, Smoothed, Smoothing, noise};
use crate::recording::{RecordedTrajectory, Recording};
use rand::Rng;
use std::collections::{BTreeMap, BTreeSet};

/// How a formula is looked for.
#[derive(Clone, Debug, PartialEq)]
pub struct FormulaOptions {
    /// Functions of the coordinates.
    pub families: Families,
    /// Formulas of the coordinates beside them, in the grammar of system files.
    pub functions: Vec<String>,
    /// `true` for terms `v_i f(q)`, those of magnetic fields and turning frames.
    pub gyroscopic: bool,
    /// `true` for a Rayleigh dissipation function of the velocities.
    pub friction: bool,
    /// Standard deviation of every coordinate's noise; estimated if not given.
    pub noise: Option<Vec<f64>>,
    /// Term and coefficient that fix the common factor; the first square of a velocity and 1/2 if not given. With known forces the motion
    /// itself gives the factor.
    pub scale: Option<(String, f64)>,
    /// Units of the coordinates, such as `m`; an empty text, or no list, where they are not known.
    pub units: Vec<String>,
    /// Unit of time.
    pub time_unit: String,
    /// Resamplings of the trajectories that give every term a probability.
    pub bootstraps: usize,
    /// Seed of the resamplings and of the states at which terms are compared.
    pub seed: u64,
    /// Threads; the result does not depend on them.
    pub threads: usize,
    /// Ends the search, and receives reports of how far it is.
    pub cancellation: Cancellation,
}

impl Default for FormulaOptions {
    fn default() -> Self {
        Self {
            families: Families::default(),
            functions: Vec::new(),
            gyroscopic: true,
            friction: false,
            noise: None,
            scale: None,
            units: Vec::new(),
            time_unit: "s".to_string(),
            bootstraps: 40,
            seed: 0,
            threads: 1,
            cancellation: Cancellation::default(),
        }
    }
}

/// Resamplings at most.
pub const MOST_BOOTSTRAPS: usize = 10_000;
/// Least noise relative to the range of a coordinate: what is exact to more digits is taken as exact to these.
const LEAST_NOISE: f64 = 1e-6;
/// Samples in a row that are needed.
const LEAST_SAMPLES: usize = 20;
/// Samples from which on a trajectory may have a noise of its own.
const LEAST_OWN: usize = 200;
/// Trajectories from which on they are held out as a whole; fewer are cut into pieces.
const WHOLE: usize = 5;
/// Pieces of a trajectory otherwise.
const PIECES: usize = 10;
/// One block of so many is held out.
const HELD_OUT: usize = 5;
/// Terms that are looked at through the motion, at most.
const MOST_CANDIDATES: usize = 60;
/// Terms that the search through the motion may start with, at most.
const MOST_START: usize = 15;
/// Error of accelerations over the least of all choices that a shorter choice may have to start with.
const START_ERROR: f64 = 1.3;
/// The same of a choice with a positive definite mass matrix, if no such one is nearer.
const DEFINITE_ERROR: f64 = 3.0;
/// Least determinant of a mass matrix over that of the model before it.
const LEAST_REGULAR: f64 = 0.05;
/// Sum of squares in units of noise that a term must explain.
const THRESHOLD: f64 = 30.0;
/// Held-out residual over noise up to which a formula is found.
const MOST_RESIDUAL: f64 = 1.1;
/// Samples that are followed at most.
const MOST_SAMPLES: usize = 60_000;
/// Choices of terms through the motion, at most, and passes of a fit.
const ROUNDS: usize = 6;
const PASSES: usize = 10;

/// Recorded motion with what smoothing says of it.
#[derive(Debug)]
pub(super) struct Prepared<'a> {
    pub recording: &'a Recording,
    smoothed: Vec<Option<Smoothed>>,
    /// Noise of every coordinate.
    pub sigma: Vec<f64>,
    /// The same by trajectory: its own where it is plainly another than that of all together.
    pub sigma_of: Vec<Vec<f64>>,
    /// Standard deviation of every coordinate.
    pub spread: Vec<f64>,
    /// Usual time between samples, in s.
    pub step: f64,
    resolved: bool,
    bounds: Vec<[f64; 2]>,
    speeds: Vec<f64>,
    /// Time in which the motion changes, in s.
    pace: f64,
    /// Ends the search.
    pub cancellation: Cancellation,
    n: usize,
}

impl<'a> Prepared<'a> {
    fn new(recording: &'a Recording, options: &FormulaOptions) -> Result<Self, FormulaError> {
        let n = recording.coordinates.len();
        let longest = recording.tracks.iter().map(|track| track.len()).max().unwrap_or(0);
        if longest < LEAST_SAMPLES {
            return Err(FormulaError::Short { found: longest, needed: LEAST_SAMPLES });
        }
        let choice = SmoothOptions { noise: options.noise.clone(), ..SmoothOptions::default() };
        let smoothing = Smoothing::choose(recording, &choice)?;
        let smooth =
            |track: &RecordedTrajectory| (track.len() >= LEAST_SAMPLES).then(|| smoothing.apply(track)).transpose();
        let smoothed = recording.tracks.iter().map(smooth).collect::<Result<Vec<_>, _>>()?;
        let mut bounds = vec![[f64::INFINITY, f64::NEG_INFINITY]; n];
        for track in &recording.tracks {
            for row in track.q.chunks_exact(n) {
                bounds.iter_mut().zip(row).for_each(|(b, &x)| *b = [b[0].min(x), b[1].max(x)]);
            }
        }
        for b in &mut bounds {
            if b[1] - b[0] < 1e-9 * b[0].abs().max(1e-9) {
                *b = [b[0] - 0.5, b[1] + 0.5];
            }
        }
        let sigma = (0..n).map(|i| {
            let least = LEAST_NOISE * (bounds[i][1] - bounds[i][0]);
            smoothing.coordinates[i].noise.sigma.max(least)
        });
        let inner = || smoothed.iter().flatten().flat_map(|s| s.interior().map(move |at| (s, at)));
        let spread = |of: &dyn Fn(&Smoothed, usize) -> f64| {
            let values: Vec<f64> = inner().map(|(s, at)| of(s, at)).collect();
            let count = values.len().max(1) as f64;
            let mean = values.iter().sum::<f64>() / count;
            (values.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / count).sqrt()
        };
        let speeds: Vec<f64> = (0..n).map(|i| spread(&|s, at| s.v[at * n + i])).collect();
        let turns: Vec<f64> = (0..n).map(|i| spread(&|s, at| s.a[at * n + i])).collect();
        let mut paces: Vec<f64> =
            speeds.iter().zip(&turns).map(|(v, a)| v / a).filter(|p| p.is_finite() && *p > 0.0).collect();
        paces.sort_by(f64::total_cmp);
        let step = smoothing.step;
        let pace = paces.first().copied().unwrap_or(20.0 * step).max(4.0 * step);
        let resolved = smoothing.coordinates.iter().all(|c| c.noise.resolved);
        let speeds = speeds.into_iter().map(|s| if s > 0.0 { s } else { 1.0 }).collect();
        let sigma: Vec<f64> = sigma.collect();
        const OTHER: f64 = 1.25;
        let own = |track: &RecordedTrajectory, i: usize| {
            let usual = sigma[i];
            if options.noise.is_some() || track.len() < LEAST_OWN {
                return usual;
            }
            let own = noise(std::iter::once((track.times.as_slice(), track.q.as_slice())), n, i).sigma;
            let other = !(usual / OTHER..usual * OTHER).contains(&own);
            if other { own.max(LEAST_NOISE * (bounds[i][1] - bounds[i][0])) } else { usual }
        };
        let sigma_of = recording.tracks.iter().map(|track| (0..n).map(|i| own(track, i)).collect()).collect();
        let spread = (0..n).map(|i| spread_of(recording, i)).collect();
        let cancellation = options.cancellation.clone();
        Ok(Self { recording, smoothed, sigma_of, sigma, spread, step, resolved, bounds, speeds, pace, cancellation, n })
    }

    /// The block of a segment.
    pub fn block_of(&self, segment: &Segment) -> usize {
        self.block(segment.track, segment.first)
    }

    /// The block of a sample.
    fn block(&self, track: usize, sample: usize) -> usize {
        if self.recording.tracks.len() >= WHOLE {
            return track;
        }
        track * PIECES + sample * PIECES / self.recording.tracks[track].len().max(1)
    }

    /// Ranges of samples without change of the block.
    fn pieces(&self, track: usize) -> Vec<(usize, std::ops::Range<usize>)> {
        let length = self.recording.tracks[track].len();
        let mut pieces: Vec<(usize, std::ops::Range<usize>)> = Vec::new();
        for sample in 0..length {
            let block = self.block(track, sample);
            match pieces.last_mut() {
                Some((last, range)) if *last == block => range.end = sample + 1,
                _ => pieces.push((block, sample..sample + 1)),
            }
        }
        pieces
    }

    /// Smoothed motion for the weak form.
    fn stretches(&self, width: f64) -> Vec<Stretch<'_>> {
        let n = self.n;
        let mut stretches = Vec::new();
        for (track, smoothed) in self.smoothed.iter().enumerate() {
            let Some(smoothed) = smoothed else { continue };
            let inside = smoothed.interior();
            for (block, range) in self.pieces(track) {
                let range = range.start.max(inside.start)..range.end.min(inside.end);
                if range.len() < LEAST_SAMPLES / 2
                    || smoothed.times[range.end - 1] - smoothed.times[range.start] < width
                {
                    continue;
                }
                let force = &self.recording.tracks[track].force;
                stretches.push(Stretch {
                    times: &smoothed.times[range.clone()],
                    q: &smoothed.q[range.start * n..range.end * n],
                    v: &smoothed.v[range.start * n..range.end * n],
                    force: if force.is_empty() { &[] } else { &force[range.start * n..range.end * n] },
                    block,
                });
            }
        }
        stretches
    }

    /// Measured motion cut into segments of about so many seconds.
    fn segments(&self, seconds: f64) -> Vec<Segment> {
        let n = self.n;
        let mut segments = Vec::new();
        for (index, track) in self.recording.tracks.iter().enumerate() {
            let Some(smoothed) = &self.smoothed[index] else { continue };
            for (_, range) in self.pieces(index) {
                let times = &track.times[range.clone()];
                if times.len() < 2 * n + 2 {
                    continue;
                }
                let whole = times[times.len() - 1] - times[0];
                let most = (times.len() / (2 * n + 2).max(8)).max(1);
                let count = ((whole / seconds).round() as usize).clamp(1, most);
                for k in 0..count {
                    let [first, end] = [k, k + 1].map(|k| range.start + k * range.len() / count);
                    let [q, v] = [&smoothed.q, &smoothed.v].map(|values| &values[first * n..(first + 1) * n]);
                    segments.push(Segment { track: index, first, samples: end - first, start: [q, v].concat() });
                }
            }
        }
        let samples: usize = segments.iter().map(|s| s.samples).sum();
        let stride = samples.div_ceil(MOST_SAMPLES).max(1);
        segments.into_iter().step_by(stride).collect()
    }

    /// Pairs of segments of a block that follow each other as one.
    fn joined(&self, segments: &[Segment]) -> Vec<Segment> {
        segments.chunk_by(|a, b| self.block_of(a) == self.block_of(b)).flat_map(joined).collect()
    }
}

/// A search through the motion.
struct Search<'a> {
    library: &'a Library,
    motion: Motion<'a>,
    candidates: Vec<usize>,
    driven: bool,
    /// States at which a mass matrix must be regular.
    states: Vec<Values>,
}

impl Search<'_> {
    fn model_over_candidates(&self, model: &Model) -> Vec<f64> {
        let of = |k: &usize| model.terms.iter().position(|t| t == k).map_or(0.0, |at| model.coefficients[at]);
        self.candidates.iter().map(of).collect()
    }

    /// `true` if terms give a mass matrix that is not nearly singular beside the one of a model, and as definite. Lagrangians of one
    /// motion may differ in that: with a cyclic coordinate the square of its momentum may be added as often as one likes.
    fn regular(&self, model: &Model, (terms, coefficients): (&[usize], &[f64])) -> bool {
        let n = self.library.n();
        let eigenvalues = |terms: &[usize], coefficients: &[f64]| {
            let mut mass = vec![0.0; self.states.len() * n * n];
            for (values, mass) in self.states.iter().zip(mass.chunks_exact_mut(n * n)) {
                self.library.mass_matrix(terms, coefficients, values, mass);
            }
            let mut eigenvalues = vec![0.0; self.states.len() * n];
            // States that fail are NaN.
            let _ = linalg::eigenvalues(n, &mass, &mut eigenvalues, &mut Workspace::new());
            eigenvalues
        };
        let own = eigenvalues(&model.terms, &model.coefficients);
        let other = eigenvalues(terms, coefficients);
        let determinant = |values: &[f64]| values.iter().product::<f64>().abs();
        let negative = |values: &[f64]| values.iter().filter(|x| **x < 0.0).count();
        let pairs = own.chunks_exact(n).zip(other.chunks_exact(n)).filter(|(own, _)| determinant(own) > 0.0);
        let ratio = |(own, other): (&[f64], &[f64])| {
            let as_definite = negative(other) == 0 || negative(other) == negative(own);
            if as_definite { determinant(other) / determinant(own) } else { 0.0 }
        };
        let mut ratios: Vec<f64> = pairs.map(ratio).collect();
        ratios.sort_by(f64::total_cmp);
        ratios.get(ratios.len() / 4).is_none_or(|ratio| *ratio > LEAST_REGULAR)
    }

    /// The terms that blocks of some weights need.
    fn survivors(
        &self,
        model: &Model,
        segments: &[Segment],
        blocks: &BTreeMap<usize, BlockSum>,
        weight: &dyn Fn(usize) -> f64,
    ) -> Option<Survivors> {
        let mut sum = total(blocks, weight);
        if !self.driven {
            self.motion.pin(model, &self.candidates, segments, &mut sum);
        }
        let coefficients = self.model_over_candidates(model);
        let complexity: Vec<f64> = self.candidates.iter().map(|&k| self.library.complexity(k)).collect();
        let equations =
            Equations { matrix: &sum.matrix, right: &sum.right, coefficients: &coefficients, complexity: &complexity };
        // What is left once all terms are there is what counts as noise.
        let m = self.candidates.len();
        let change = times(m, &inverse_with(m, &sum.matrix, RIDGE)?, &sum.right);
        let noise = inflation(blocks, weight, &sum, &change);
        survivors(&equations, THRESHOLD * noise, &|x| self.regular(model, (&self.candidates, x)))
    }

    /// Refits and chooses terms anew until they stay the same; the normal equations at the end, by block.
    fn converge(&self, model: &mut Model, segments: &mut [Segment], rounds: usize) -> BTreeMap<usize, BlockSum> {
        let mut seen: Vec<Vec<usize>> = Vec::new();
        for round in 0.. {
            self.motion.settle(model, segments, 4);
            self.motion.fit(model, segments, PASSES);
            let blocks = self.motion.blocks(model, &self.candidates, segments);
            if round >= rounds || self.motion.data.cancellation.is_cancelled() {
                return blocks;
            }
            let Some(found) = self.survivors(model, segments, &blocks, &|_| 1.0) else { return blocks };
            let terms: Vec<usize> = found.set.iter().map(|&k| self.candidates[k]).collect();
            tracing::debug!(
                round,
                next = found.next,
                terms = terms.iter().map(|&k| self.library.written(k, Notation::System)).collect::<Vec<_>>().join(" "),
                "formula"
            );
            if terms == model.terms || seen.contains(&terms) {
                return blocks;
            }
            seen.push(terms.clone());
            let coefficients = found.set.iter().map(|&k| found.coefficients[k]).collect();
            *model = Model { terms, coefficients };
        }
        BTreeMap::new()
    }
}

/// Looks for a formula of the Lagrangian of recorded motion.
///
/// # Errors
/// [`FormulaError`] for motion that is too short or cannot be smoothed, for a library that is too large, and for functions and terms that
/// are none. Motion that the library cannot explain is no error: the verdict says so.
pub fn formula_of_motion(recording: &Recording, options: &FormulaOptions) -> Result<FoundFormula, FormulaError> {
    let extent = Extent { families: options.families, gyroscopic: options.gyroscopic, friction: options.friction };
    let library = Library::new(&recording.coordinates, &recording.periodic, extent, &options.functions)?;
    let stop = &options.cancellation;
    stop.stage("smoothed motion");
    let data = Prepared::new(recording, options)?;
    let (kept, quotient) = library.independent(&data.bounds, options.seed);
    let width = 3.0 * data.pace;
    let span = |times: &[f64]| times.last().zip(times.first()).map_or(0.0, |(last, first)| last - first);
    let longest = recording.tracks.iter().map(|track| span(&track.times)).fold(0.0, f64::max);
    let pieces = if recording.tracks.len() >= WHOLE { 1 } else { PIECES };
    let width = width.min(longest / pieces as f64 / 2.5);
    let stretches = data.stretches(width);
    let short = FormulaError::Short {
        found: recording.tracks.iter().map(|track| track.len()).max().unwrap_or(0),
        needed: 2 * LEAST_SAMPLES * pieces,
    };
    if stretches.len() < 2 {
        return Err(short);
    }
    stop.check()?;
    let windows = Windows::new(&library, &kept, &stretches, width);
    let driven = windows.driven();
    let held = held_out(&data, options.seed);
    let complexity: Vec<f64> = kept.iter().map(|&k| library.complexity(k)).collect();
    let start = windows.unit_mass(&library, &kept, &data.speeds);
    stop.check()?;
    stop.stage("choice of terms");
    let path = eliminate_backward(&windows, &start, (&data.sigma, &complexity), &|block| held.contains(&block), stop);
    stop.check()?;
    log(&library, &kept, &path);
    let Some(choice) = beginning(&path, &windows) else { return Err(short) };
    let mut model = Model {
        terms: choice.iter().map(|&(k, _)| kept[k]).collect(),
        coefficients: choice.iter().map(|&(_, c)| c).collect(),
    };
    let mut candidates: Vec<usize> = path.order.iter().take(MOST_CANDIDATES).map(|&k| kept[k]).collect();
    candidates.extend(model.terms.iter().filter(|k| !candidates.contains(k)).copied().collect::<Vec<_>>());
    candidates.sort_unstable();
    let motion = Motion { library: &library, data: &data, substeps: 1, threads: options.threads };
    let short = data.segments(2.5 * data.pace);
    let (mut judges, mut learned): (Vec<Segment>, Vec<Segment>) =
        short.into_iter().partition(|s| held.contains(&data.block_of(s)));
    let states = learned.iter().step_by(learned.len().div_ceil(60).max(1)).map(|s| {
        let mut values = Values::new();
        let all: Vec<usize> = (0..library.functions.len()).collect();
        library.evaluate(&all, &s.start[..data.n], &mut values);
        values
    });
    let mut search = Search { library: &library, motion, candidates, driven, states: states.collect() };
    stop.stage("short segments");
    search.motion.settle(&model, &mut learned, 4);
    search.motion.choose_steps(&model, &learned);
    search.converge(&mut model, &mut learned, ROUNDS);
    stop.check()?;
    stop.stage("longer segments");
    // Longer segments say more of the constants; their starts are known by now.
    let before = (model.clone(), learned.clone());
    let short = search.motion.settle(&model, &mut learned, 1);
    let mut learned = data.joined(&learned);
    search.motion.choose_steps(&model, &learned);
    let mut blocks = search.converge(&mut model, &mut learned, 3);
    let long = search.motion.settle(&model, &mut learned, 1);
    if long.0 / long.1 > 1.1 * short.0 / short.1 {
        // Motion that is too unstable to be followed for so long.
        (model, learned) = before;
        blocks = search.converge(&mut model, &mut learned, 0);
    }
    search.motion.settle(&model, &mut judges, 6);
    let mut judges = data.joined(&judges);
    stop.check()?;
    stop.stage("probabilities");
    let probabilities = probabilities(&search, &model, &blocks, &learned, options);
    stop.check()?;
    let shortened = shorten(&search, &quotient, &mut model, &mut learned);
    let covariance = covariance(&search, &model, &learned);
    let (square, count) = search.motion.settle(&model, &mut judges, 8);
    let residual = (square / count.max(1.0)).sqrt();
    let left = left_over(&search.motion, &model, &judges);
    let probability = |k: usize| match shortened.get(&k) {
        Some(replaced) => replaced.iter().map(|r| probabilities.get(r).copied().unwrap_or(0.0)).fold(1.0, f64::min),
        None => probabilities.get(&k).copied().unwrap_or(1.0),
    };
    let probability: Vec<f64> = model.terms.iter().map(|&k| probability(k)).collect();
    let mut found = FoundFormula::new(&library, &recording.periodic, &model, (&covariance, &probability), options);
    // Few residuals scatter by themselves.
    let most = MOST_RESIDUAL + 3.0 / (2.0 * count.max(1.0)).sqrt();
    found.verdict = if residual <= most { Verdict::Found } else { Verdict::NotInLibrary };
    found.residual = residual;
    found.noise = data.sigma.clone();
    found.noise_resolved = data.resolved;
    found.left = left;
    found.searched = (library.searched, quotient.removed);
    found.bounds = data.bounds.clone();
    found.speeds = data.speeds.clone();
    if !driven || options.scale.is_some() {
        found.rescale(options.scale.as_ref())?;
    }
    found.name_constants();
    stop.check()?;
    Ok(found)
}

/// Blocks that are held out: one of so many, drawn.
fn held_out(data: &Prepared<'_>, seed: u64) -> BTreeSet<usize> {
    let tracks = 0..data.recording.tracks.len();
    let mut blocks: Vec<usize> = tracks.flat_map(|t| data.pieces(t).into_iter().map(|(block, _)| block)).collect();
    blocks.dedup();
    let mut rng = RngStream::HeldOut.generator(seed);
    let count = (blocks.len() / HELD_OUT).max(1).min(blocks.len().saturating_sub(1));
    (0..count).map(|_| blocks.swap_remove(rng.random_range(0..blocks.len()))).collect()
}

/// The shortest choice whose error is near the least, with its coefficients; one with a positive definite mass matrix if there is any that
/// is not much worse.
fn beginning(path: &Path, windows: &Windows) -> Option<Vec<(usize, f64)>> {
    let few = || path.best.values().filter(|choice| choice.set.len() <= MOST_START);
    let judged = |choice: &super::select::Choice| {
        if choice.held_out.is_finite() { choice.held_out } else { choice.error }
    };
    let least = few().map(judged).fold(f64::INFINITY, f64::min);
    let near = |most: f64| few().filter(move |choice| judged(choice) <= most * least);
    let definite = |most: f64| near(most).find(|choice| windows.is_definite(&choice.coefficients));
    let choice = definite(START_ERROR).or_else(|| definite(DEFINITE_ERROR)).or_else(|| near(START_ERROR).next())?;
    Some(choice.set.iter().map(|&k| (k, choice.coefficients[k])).collect())
}

fn log(library: &Library, kept: &[usize], path: &Path) {
    for (size, choice) in path.best.iter().take(12) {
        let terms: Vec<String> = choice.set.iter().map(|&k| library.written(kept[k], Notation::System)).collect();
        let terms = terms.join(" ");
        tracing::debug!(size, error = choice.error, held_out = choice.held_out, terms, "weak form");
    }
}

/// The share of resamplings of the blocks that keep each candidate.
fn probabilities(
    search: &Search<'_>,
    model: &Model,
    blocks: &BTreeMap<usize, BlockSum>,
    segments: &[Segment],
    options: &FormulaOptions,
) -> BTreeMap<usize, f64> {
    let mut rng = RngStream::Segments.generator(options.seed);
    let names: Vec<usize> = blocks.keys().copied().collect();
    let mut counts: BTreeMap<usize, f64> = BTreeMap::new();
    for _ in (0..options.bootstraps).take_while(|_| options.cancellation.go_on()) {
        let mut weights: BTreeMap<usize, f64> = BTreeMap::new();
        for _ in &names {
            *weights.entry(names[rng.random_range(0..names.len())]).or_default() += 1.0;
        }
        let weight = |block: usize| weights.get(&block).copied().unwrap_or(0.0);
        let Some(found) = search.survivors(model, segments, blocks, &weight) else { continue };
        for k in found.set {
            *counts.entry(search.candidates[k]).or_default() += 1.0 / options.bootstraps as f64;
        }
    }
    counts
}

/// Replaces two terms by one that is made up of them wherever the motion allows it; what each new term replaced.
fn shorten(
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
        if !search.driven {
            search.motion.pin(model, &model.terms, segments, &mut sum);
        }
        let own: Vec<Option<usize>> = model.terms.iter().map(|k| quotient.kept.iter().position(|t| t == k)).collect();
        let mut best: Option<(f64, Vec<usize>, Model)> = None;
        for (term, over) in quotient.over_kept.iter().enumerate() {
            let Some(over) = over.as_ref().filter(|_| !model.terms.contains(&term)) else { continue };
            // The new term over the model's own, if it is made up of them.
            let support: Vec<usize> = (0..over.len()).filter(|&k| over[k].abs() > 1e-6).collect();
            let inside = |k: &usize| own.contains(&Some(*k));
            if support.len() != 2 || !support.iter().all(inside) {
                continue;
            }
            let column: Vec<f64> = own.iter().map(|k| k.map_or(0.0, |k| over[k])).collect();
            let gone: Vec<usize> = (0..m).filter(|&k| column[k].abs() > 1e-6).collect();
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
            let better = cost < THRESHOLD * inflation && best.as_ref().is_none_or(|(least, ..)| cost < *least);
            let terms: Vec<usize> = rest.iter().map(|&k| model.terms[k]).chain([term]).collect();
            if better && search.regular(model, (&terms, &x)) {
                best = Some((cost, gone, Model { terms, coefficients: x }));
            }
        }
        let Some((_, gone, shorter)) = best.filter(|_| search.motion.data.cancellation.go_on()) else {
            return replaced;
        };
        let old = gone.iter().flat_map(|&k| replaced.get(&model.terms[k]).cloned().unwrap_or(vec![model.terms[k]]));
        replaced.insert(shorter.terms[shorter.terms.len() - 1], old.collect());
        *model = shorter;
        search.motion.fit(model, segments, PASSES);
    }
}

/// Covariance of the coefficients, the common factor fixed.
fn covariance(search: &Search<'_>, model: &Model, segments: &[Segment]) -> Vec<f64> {
    let m = model.terms.len();
    let blocks = search.motion.blocks(model, &model.terms, segments);
    let mut sum = total(&blocks, &|_| 1.0);
    if !search.driven {
        search.motion.pin(model, &model.terms, segments, &mut sum);
    }
    let inflation = sum.inflation;
    let all: Vec<usize> = (0..m).collect();
    let inverse = inverse_with(m, &part(m, &sum.matrix, &all), RIDGE).unwrap_or(vec![f64::NAN; m * m]);
    inverse.into_iter().map(|x| x * inflation).collect()
}

/// Residuals over noise in eight parts of the range of every coordinate.
fn left_over(motion: &Motion<'_>, model: &Model, segments: &[Segment]) -> Vec<Left> {
    const PARTS: usize = 8;
    let (n, bounds) = (motion.data.n, &motion.data.bounds);
    let mut sums = vec![[0.0; 2]; n * PARTS];
    for (segment, residuals) in segments.iter().zip(motion.residuals(model, segments)) {
        let q = &motion.data.recording.tracks[segment.track].q[segment.first * n..];
        for (row, residual) in q.chunks_exact(n).zip(residuals.chunks_exact(n)) {
            let square = residual.iter().map(|r| r * r).sum::<f64>() / n as f64;
            for (i, x) in row.iter().enumerate().filter(|_| square.is_finite()) {
                let share = (x - bounds[i][0]) / (bounds[i][1] - bounds[i][0]);
                let at = ((share * PARTS as f64) as usize).min(PARTS - 1);
                sums[i * PARTS + at][0] += square;
                sums[i * PARTS + at][1] += 1.0;
            }
        }
    }
    let of = |(e, [square, count]): (usize, &[f64; 2])| {
        let (i, at) = (e / PARTS, e % PARTS);
        let step = (bounds[i][1] - bounds[i][0]) / PARTS as f64;
        let low = bounds[i][0] + at as f64 * step;
        Left { coordinate: i, low, high: low + step, residual: (square / count).sqrt(), samples: *count as usize }
    };
    sums.iter().enumerate().map(of).filter(|left| left.samples > 0).collect()
}
