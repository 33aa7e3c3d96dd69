//! Finds a formula from recorded motion.

use super::drive_doubts::drive_doubts;
use super::error::FormulaError;
use super::exchange::Exchanged;
use super::extent::Drive;
use super::families::Families;
use super::found::{FoundDrive, FoundFormula, Rival, Verdict};
use super::function::Notation;
use super::held_out_test::HeldOutTest;
use super::library::{Library, Values};
use super::motion::{BlockSum, Model, Motion};
use super::prepared::Prepared;
use super::quotient::Quotient;
use super::search::{Search, covariance, left_over, shorten};
use super::select::{Choice, Path, eliminate_backward};
use super::thresholds::{
    BLOCKS_PER_HELD_OUT, DEFINITE_ERROR, LEAST_SAMPLES, LONG_SEGMENT_RESIDUAL, MOST_FITTED_TERMS, MOST_STARTING_TERMS,
    OTHER_STARTING_CHOICES, REGULAR_STATES, ROUNDS_OF_CHOICE, SEGMENT_PACES, STARTING_ERROR, TERM_COST,
};
use super::weak::Windows;
use crate::cancellation::Cancellation;
use crate::identification::{Between, Segment};
use crate::random::RngStream;
use rand::Rng;
use std::collections::{BTreeMap, BTreeSet};

/// Options of the search for a formula.
#[derive(Clone, Debug, PartialEq)]
pub struct FormulaOptions {
    /// Functions of the coordinates; by default, larger and larger libraries are searched until one fits the motion.
    pub families: Option<Families>,
    /// Additional formulas of the coordinates, in the grammar of system files.
    pub functions: Vec<String>,
    /// `true` for terms `v_i f(q)`, as in magnetic fields and rotating frames.
    pub gyroscopic: bool,
    /// `true` for a Rayleigh dissipation function of the velocities.
    pub friction: bool,
    /// `true` to search for friction that depends on the position if there is friction and no library with constant friction fits.
    pub friction_of_position: bool,
    /// `true` to search for a periodic drive of unknown frequency if no library fits.
    pub drive: bool,
    /// Standard deviation of every coordinate's noise; estimated if not given.
    pub noise: Option<Vec<f64>>,
    /// Interpolation of known forces between the samples; by default the one that fits the motion best.
    pub between: Option<Between>,
    /// Term and coefficient that fix the common factor; by default the first square of a velocity and 1/2. With known forces the motion itself
    /// gives the factor.
    pub scale: Option<(String, f64)>,
    /// Units of the coordinates, such as `m`; empty where a unit is not known.
    pub units: Vec<String>,
    /// Unit of time.
    pub time_unit: String,
    /// Bootstrap samples of the trajectories that give every term a probability.
    pub bootstraps: usize,
    /// Seed of the bootstrap samples and of the states at which terms are compared.
    pub seed: u64,
    /// Threads; the result does not depend on them.
    pub threads: usize,
    /// Cancels the search and receives its progress.
    pub cancellation: Cancellation,
}

impl Default for FormulaOptions {
    fn default() -> Self {
        Self {
            families: None,
            functions: Vec::new(),
            gyroscopic: true,
            friction: false,
            friction_of_position: true,
            drive: true,
            noise: None,
            between: None,
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

/// A library with the results of the weak form for its terms.
pub(super) struct WeakForm {
    pub library: Library,
    pub quotient: Quotient,
    pub windows: Windows,
    pub path: Path,
}

impl WeakForm {
    pub fn new(
        data: &Prepared<'_>,
        library: Library,
        held: &BTreeSet<usize>,
        options: &FormulaOptions,
    ) -> Result<Self, FormulaError> {
        let (kept, quotient) = library.independent(&data.bounds, options.seed);
        let (width, pieces) = data.width();
        let stretches = data.stretches(width);
        if stretches.len() < 2 {
            let (found, needed) = (data.longest(), 2 * LEAST_SAMPLES * pieces);
            return Err(match found < needed {
                true => FormulaError::Short { found, needed },
                false => FormulaError::Stretches { seconds: width },
            });
        }
        let stop = &options.cancellation;
        stop.stage("choice of terms");
        let windows = Windows::new(&library, &kept, &stretches, width);
        let complexity: Vec<f64> = kept.iter().map(|&k| library.complexity(k)).collect();
        let eliminate = |set: &[usize], speeds: &[f64]| {
            let start = windows.unit_mass(&library, &kept, speeds);
            let is_validation = |block| held.contains(&block);
            eliminate_backward(&windows, (set, &start), (&data.sigma, &complexity), &is_validation, stop)
        };
        let mut path = Path::default();
        // A search that ends at a nearly singular mass matrix restarts from other choices.
        for speeds in data.starts() {
            stop.check()?;
            path = eliminate(&windows.apart(&[]), &speeds);
            if best(&path).is_some() {
                break;
            }
        }
        // If decoupled coordinates are normalized jointly, one of them may vanish. So all coordinates are first normalized separately, then the
        // groups that are decoupled.
        let mut alone: Vec<usize> = (0..data.n).collect();
        while data.n > 1 && !alone.is_empty() {
            stop.check()?;
            let apart = eliminate(&windows.apart(&alone), &data.speeds);
            let Some(choice) = best(&apart) else { break };
            if best(&path).is_none_or(|whole| score(choice) <= STARTING_ERROR * score(whole)) {
                path = apart.before(path);
                break;
            }
            let errors = |choice: &Choice| windows.errors_by_coordinate(&choice.coefficients, &data.sigma);
            let (own, whole) = (errors(choice), best(&path).map(errors).unwrap_or_default());
            let before = alone.len();
            alone.retain(|&i| whole.get(i).is_none_or(|whole| own[i] <= STARTING_ERROR * whole));
            if alone.len() == before || alone.len() + 1 >= data.n {
                break;
            }
        }
        log(&library, &kept, &path);
        Ok(Self { library, quotient, windows, path })
    }

    /// The smallest held-out error of choices with which the search through the motion may start.
    pub fn least(&self) -> f64 {
        best(&self.path).map_or(f64::INFINITY, score)
    }

    /// Fits the choice to the motion, or another choice of the weak form if that gives no formula.
    pub fn follow_all(
        &self,
        data: &Prepared<'_>,
        held: &BTreeSet<usize>,
        options: &FormulaOptions,
    ) -> Result<FoundFormula, FormulaError> {
        let mut best: Option<FoundFormula> = None;
        for choice in starting_choices(&self.path, &self.windows) {
            let found = self.follow(choice, data, held, options)?;
            let done = found.verdict != Verdict::NotInLibrary;
            if done || best.as_ref().is_none_or(|best| found.residual < best.residual) {
                best = Some(found);
            }
            if done {
                break;
            }
        }
        best.ok_or(FormulaError::Singular)
    }

    /// Fits a choice to the motion, chooses terms again, and is_validation the result on held-out motion.
    fn follow(
        &self,
        choice: &Choice,
        data: &Prepared<'_>,
        held: &BTreeSet<usize>,
        options: &FormulaOptions,
    ) -> Result<FoundFormula, FormulaError> {
        let segments = data.segments(SEGMENT_PACES * data.pace).into_iter();
        let (mut validation, training): (Vec<Segment>, Vec<Segment>) =
            segments.partition(|s| held.contains(&data.block_of(s)));
        let (mut search, model) = self.search(choice, data, &training, options);
        let Fitted { mut model, mut segments, mut blocks, converged } =
            fit_segments(&mut search, model, training, options)?;
        let rival = search.exchange(&mut model, &mut segments, &mut blocks);
        search.motion.fit_initial_states(&model, &mut validation, 6);
        let mut validation = data.joined(&validation);
        let stop = &options.cancellation;
        stop.check()?;
        stop.stage("probabilities");
        let resampled = search.resample(&model, &blocks, &segments, (options.bootstraps, options.seed));
        stop.check()?;
        let shortened = shorten(&search, &self.quotient, &mut model, &mut segments);
        let covariance = covariance(&search, &mut model, &mut segments);
        let (square, count) = search.motion.fit_initial_states(&model, &mut validation, 8);
        let probability = resampled.probabilities(&model, &shortened);
        let periodic = &data.recording.periodic;
        let estimates = (covariance.coefficients.as_slice(), probability.as_slice());
        let mut found = FoundFormula::new(&self.library, periodic, &model, estimates, options);
        let residuals = search.motion.residuals(&model, &validation);
        let test =
            HeldOutTest { search: &search, model: &model, segments: &validation, residuals: &residuals, square, count };
        found.set_bootstraps(&self.library, &model, &resampled.coefficients);
        self.describe(&mut found, &test);
        if let Some(rival) = rival {
            found.several = rival.cost < TERM_COST;
            found.rival = Some(self.rival(&rival));
        }
        if !converged {
            found.notes.push(format!("the choice of terms has not converged after {ROUNDS_OF_CHOICE} rounds"));
        }
        if let (Some(Drive { name, .. }), Some(standard_error)) = (&self.library.drive, covariance.frequency) {
            found.drive = Some(FoundDrive { name: name.clone(), frequency: model.frequency, standard_error });
        }
        self.judge(&mut found, &test, covariance.converged);
        Ok(found)
    }

    /// The search through the motion that starts from a choice, and the model of that choice.
    fn search<'a>(
        &'a self,
        choice: &Choice,
        data: &'a Prepared<'a>,
        training: &[Segment],
        options: &FormulaOptions,
    ) -> (Search<'a>, Model) {
        let (library, kept) = (&self.library, &self.quotient.kept);
        let model = Model {
            terms: choice.set.iter().map(|&k| kept[k]).collect(),
            coefficients: choice.set.iter().map(|&k| choice.coefficients[k]).collect(),
            frequency: library.drive.as_ref().map_or(0.0, |drive| drive.frequency),
        };
        let mut candidates: Vec<usize> = self.path.order.iter().take(MOST_FITTED_TERMS).map(|&k| kept[k]).collect();
        candidates.extend(model.terms.iter().filter(|k| !candidates.contains(k)).copied().collect::<Vec<_>>());
        candidates.sort_unstable();
        let between = options.between.unwrap_or(Between::Linear);
        let motion = Motion { library, data, substeps: 1, between, threads: options.threads };
        let all: Vec<usize> = (0..library.functions.len()).collect();
        let states = training.iter().step_by(training.len().div_ceil(REGULAR_STATES).max(1)).map(|s| {
            let mut values = Values::new();
            library.evaluate(&all, (&s.start[..data.n], 0.0), &mut values);
            values
        });
        (Search { library, motion, candidates, states: states.collect() }, model)
    }

    /// Reports the held-out motion and the data of a search.
    fn describe(&self, found: &mut FoundFormula, test: &HeldOutTest<'_>) {
        let motion = &test.search.motion;
        let data = motion.data;
        found.paths = test.paths();
        found.residual = test.residual();
        found.left = left_over(motion, test.model, test.segments);
        found.forced.clone_from(&data.forced);
        found.noise = data.sigma.clone();
        found.noise_resolved = data.resolved;
        found.searched = (self.library.searched, self.quotient.removed);
        found.bounds = data.bounds.clone();
        found.speeds = data.speeds.clone();
        found.between = data.forced.contains(&true).then_some(motion.between);
    }

    /// The best choice of terms that was not taken, in words.
    fn rival(&self, rival: &Exchanged) -> Rival {
        let written = |&k: &usize| {
            let kind = if self.library.is_dissipation(k) { "D: " } else { "" };
            format!("{kind}{}", self.library.written(k, Notation::System))
        };
        Rival { terms: rival.model.terms.iter().map(written).collect(), cost: rival.cost }
    }

    /// Sets the verdict on a formula, with the reasons for doubt; `converged` refers to the fit of its coefficients.
    fn judge(&self, found: &mut FoundFormula, test: &HeldOutTest<'_>, converged: bool) {
        if !converged {
            found.doubts.push("the fit of the coefficients has not converged".to_string());
        }
        found.doubts.extend(test.doubts());
        if found.drive.is_some() {
            found.doubts.extend(drive_doubts(&test.search.motion, test.model));
        }
        found.verdict = test.verdict(&found.doubts);
        if found.verdict == Verdict::NotInLibrary {
            found.doubts.clear();
        }
        if !self.path.converged && found.verdict != Verdict::Found {
            found.notes.push("the exchange of terms in the weak form was stopped before it converged".to_string());
        }
    }
}

/// A model fitted to segments of the motion.
struct Fitted {
    model: Model,
    segments: Vec<Segment>,
    blocks: BTreeMap<usize, BlockSum>,
    /// `false` if the choice of terms did not converge.
    converged: bool,
}

/// Fits a model to short segments of the motion, then to longer ones, which determine the constants better.
fn fit_segments(
    search: &mut Search<'_>,
    mut model: Model,
    mut segments: Vec<Segment>,
    options: &FormulaOptions,
) -> Result<Fitted, FormulaError> {
    let (data, stop) = (search.motion.data, &options.cancellation);
    stop.stage("short segments");
    search.motion.fit_initial_states(&model, &mut segments, 4);
    search.motion.choose_steps(&model, &segments);
    search.converge(&mut model, &mut segments, ROUNDS_OF_CHOICE);
    if options.between.is_none() && data.forced.contains(&true) {
        search.motion.choose_between(&mut model, &mut segments);
    }
    stop.check()?;
    stop.stage("longer segments");
    let before = (model.clone(), segments.clone());
    let short = search.motion.fit_initial_states(&model, &mut segments, 1);
    let mut segments = data.joined(&segments);
    search.motion.choose_steps(&model, &segments);
    let (mut blocks, mut converged) = search.converge(&mut model, &mut segments, ROUNDS_OF_CHOICE);
    let long = search.motion.fit_initial_states(&model, &mut segments, 1);
    if long.0 / long.1 > LONG_SEGMENT_RESIDUAL * short.0 / short.1 {
        // The motion is too unstable to be followed for so long.
        (model, segments) = before;
        (blocks, converged) = search.converge(&mut model, &mut segments, 0);
    }
    Ok(Fitted { model, segments, blocks, converged })
}

/// The blocks that are held out: one in [`BLOCKS_PER_HELD_OUT`], chosen at random.
pub(super) fn held_out(data: &Prepared<'_>, seed: u64) -> BTreeSet<usize> {
    let tracks = 0..data.recording.tracks.len();
    let mut blocks: Vec<usize> = tracks.flat_map(|t| data.pieces(t).into_iter().map(|(block, _)| block)).collect();
    blocks.dedup();
    let mut rng = RngStream::HeldOut.generator(seed);
    let count = (blocks.len() / BLOCKS_PER_HELD_OUT).max(1).min(blocks.len().saturating_sub(1));
    (0..count).map(|_| blocks.swap_remove(rng.random_range(0..blocks.len()))).collect()
}

/// The shortest choice whose error is near the smallest, with a positive definite mass matrix if such a choice is not much worse; then other
/// choices near the smallest error.
fn starting_choices<'a>(path: &'a Path, windows: &Windows) -> Vec<&'a Choice> {
    let few: Vec<&'a Choice> = path.best.values().filter(|choice| choice.set.len() <= MOST_STARTING_TERMS).collect();
    let least = few.iter().map(|choice| score(choice)).fold(f64::INFINITY, f64::min);
    let near = |most: f64| few.iter().copied().filter(move |choice| score(choice) <= most * least);
    let definite = |most: f64| near(most).find(|choice| windows.is_definite(&choice.coefficients));
    let first = definite(STARTING_ERROR).or_else(|| definite(DEFINITE_ERROR)).or_else(|| near(STARTING_ERROR).next());
    let Some(first) = first else { return Vec::new() };
    let mut others: Vec<&Choice> = near(DEFINITE_ERROR).filter(|choice| choice.set != first.set).collect();
    others.sort_by(|a, b| score(a).total_cmp(&score(b)));
    [first].into_iter().chain(others.into_iter().take(OTHER_STARTING_CHOICES)).collect()
}

/// The choice with the smallest error that the search through the motion may start with.
pub(super) fn best(path: &Path) -> Option<&Choice> {
    let few = path.best.values().filter(|choice| choice.set.len() <= MOST_STARTING_TERMS);
    few.min_by(|a, b| score(a).total_cmp(&score(b)))
}

/// Held-out error of a choice.
fn score(choice: &Choice) -> f64 {
    if choice.held_out.is_finite() { choice.held_out } else { choice.error }
}

fn log(library: &Library, kept: &[usize], path: &Path) {
    for (size, choice) in path.best.iter().take(12) {
        let terms: Vec<String> = choice.set.iter().map(|&k| library.written(kept[k], Notation::System)).collect();
        let terms = terms.join(" ");
        tracing::debug!(size, error = choice.error, held_out = choice.held_out, terms, "weak form");
    }
}
