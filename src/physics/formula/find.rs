//! Finds a formula from recorded motion.

use super::error::FormulaError;
use super::found::{FoundFormula, Rival, Verdict};
use super::function::Notation;
use super::library::{Extent, Families, Library, Quotient, Values};
use super::motion::{Model, Motion};
use super::obstacles::constrained;
use super::prepared::{LEAST_SAMPLES, Prepared};
use super::search::{Search, THRESHOLD, covariance, left_over, shorten};
use super::select::{Choice, Path, eliminate_backward};
use super::weak::{Windows, is_regular};
use crate::cancellation::Cancellation;
use crate::identification::{Between, ResidualPath, Segment};
use crate::names::rounded;
use crate::random::RngStream;
use crate::recording::Recording;
use rand::Rng;
use std::collections::BTreeSet;

/// Options of the search for a formula.
#[derive(Clone, Debug, PartialEq)]
pub struct FormulaOptions {
    /// Functions of the coordinates; if not given, larger and larger libraries until one fits the motion.
    pub families: Option<Families>,
    /// Additional formulas of the coordinates, in the grammar of system files.
    pub functions: Vec<String>,
    /// `true` for terms `v_i f(q)`, as in magnetic fields and rotating frames.
    pub gyroscopic: bool,
    /// `true` for a Rayleigh dissipation function of the velocities.
    pub friction: bool,
    /// Standard deviation of every coordinate's noise; estimated if not given.
    pub noise: Option<Vec<f64>>,
    /// Interpolation of known forces between the samples; by default the one that fits the motion best.
    pub between: Option<Between>,
    /// Term and coefficient that fix the common factor; by default the first square of a velocity and 1/2. With known forces the motion itself
    /// gives the factor.
    pub scale: Option<(String, f64)>,
    /// Units of the coordinates, such as `m`; an empty text, or no list, where they are not known.
    pub units: Vec<String>,
    /// Unit of time.
    pub time_unit: String,
    /// Bootstrap samples of the trajectories that give every term a probability.
    pub bootstraps: usize,
    /// Seed of the bootstrap samples and of the states at which terms are compared.
    pub seed: u64,
    /// Threads; the result does not depend on them.
    pub threads: usize,
    /// Cancels the search, and receives reports of its progress.
    pub cancellation: Cancellation,
}

impl Default for FormulaOptions {
    fn default() -> Self {
        Self {
            families: None,
            functions: Vec::new(),
            gyroscopic: true,
            friction: false,
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

/// Largest number of bootstrap samples.
pub const MOST_BOOTSTRAPS: usize = 10_000;
/// One block in so many is held out.
const HELD_OUT: usize = 5;
/// Largest number of terms that are fitted to the motion.
const MOST_CANDIDATES: usize = 60;
/// Largest number of terms with which the search through the motion starts.
const MOST_START: usize = 15;
/// Largest error of accelerations, over the smallest of all choices, of a shorter choice that may be the start.
const START_ERROR: f64 = 1.3;
/// The same for a choice with a positive definite mass matrix if no such choice is nearer, and for others that are tried if the first gives no
/// formula; and the number of these.
const DEFINITE_ERROR: f64 = 3.0;
const OTHER_STARTS: usize = 2;
/// Smallest and largest held-out residual over noise at which a formula is found; if the noise is given or is that of exact numbers, only the
/// largest one applies.
const LEAST_RESIDUAL: f64 = 0.8;
const MOST_RESIDUAL: f64 = 1.1;
/// Smallest ratio of a coordinate's motion to its residual at which it can confirm a law: noise is below half of the spread.
const SIGNAL: f64 = 2.0;
/// Largest error of accelerations, over that of smaller libraries, at which a larger library is fitted to the motion.
const BETTER: f64 = 0.8;
/// Largest number of choices of terms that are fitted to the motion.
const ROUNDS: usize = 6;

/// Finds a formula for the Lagrangian of recorded motion. If no families are given, searches larger and larger libraries until one fits the
/// held-out motion.
///
/// # Errors
/// [`FormulaError`] for motion that is too short, cannot be smoothed or does not determine a law, for example because a coordinate stands still;
/// for a library that is too large, and for invalid functions and terms. Motion that the library cannot fit is not an error: the verdict reports
/// it.
pub fn formula_of_motion(recording: &Recording, options: &FormulaOptions) -> Result<FoundFormula, FormulaError> {
    let rungs = options.families.map_or_else(|| rungs(&recording.periodic), |families| vec![families]);
    let libraries: Vec<(Families, Result<Library, FormulaError>)> =
        rungs.into_iter().map(|families| (families, library(recording, families, options))).collect();
    if let Some((_, Err(error))) = libraries.first() {
        return Err(error.clone());
    }
    let stop = &options.cancellation;
    stop.stage("smoothed motion");
    let data = Prepared::new(recording, options)?;
    stop.check()?;
    let held = constrained(recording, options.noise.as_ref(), stop)?;
    stop.check()?;
    let judges = held_out(&data, options.seed);
    let (mut searched, mut refused) = (Vec::new(), None);
    // A formula of high powers may be the series of a shorter one of other functions.
    let mut long = false;
    let mut best: Option<FoundFormula> = None;
    let mut least = f64::INFINITY;
    for (families, library) in libraries {
        let Ok(library) = library else {
            searched.push(format!("{families} (too many terms)"));
            continue;
        };
        if long && families.is_polynomial() {
            continue;
        }
        searched.push(families.to_string());
        stop.check()?;
        let followed = WeakForm::new(&data, library, &judges, options).and_then(|weak| {
            // A library is fitted to the motion only if it fits accelerations better.
            let (error, before) = (weak.least(), least);
            least = least.min(error);
            let most = if long { before / BETTER } else { BETTER * before };
            if error > most { Ok(None) } else { weak.follow_all(&data, &judges, options).map(Some) }
        });
        stop.check()?;
        match followed {
            Err(error) => refused = refused.or(Some(error)),
            Ok(None) => {}
            Ok(Some(mut found)) => {
                let done = found.verdict != Verdict::NotInLibrary;
                let is_better = match &best {
                    None => true,
                    Some(best) if long => found.verdict == Verdict::Found && found.terms.len() < best.terms.len(),
                    Some(best) => done || found.residual < best.residual,
                };
                let is_found = found.verdict == Verdict::Found;
                if is_better {
                    found.basis = families.to_string();
                    best = Some(found);
                }
                if done && !(is_found && families.is_polynomial() && families.polynomial > 2) {
                    break;
                }
                long |= is_found;
            }
        }
    }
    let mut found = best.ok_or_else(|| refused.unwrap_or(FormulaError::Singular))?;
    found.tried = searched;
    found.notes.extend(data.suspicious.iter().cloned());
    if let Some(formula) = held {
        found.notes.push(format!(
            "the only trajectory satisfies {formula} = 0, by a constraint or by chance: terms that vanish with it are not determined, record more trajectories"
        ));
        found.several = true;
    }
    found.rescale(options.scale.as_ref())?;
    found.name_constants();
    stop.check()?;
    Ok(found)
}

/// Libraries in the order in which they are searched.
fn rungs(periodic: &[bool]) -> Vec<Families> {
    let lines = periodic.iter().filter(|periodic| !**periodic).count();
    let degree = |degree: usize| Families { polynomial: degree, trigonometric: degree, ..Families::default() };
    let mut rungs = vec![degree(2), degree(3), degree(4)];
    if lines > 1 {
        rungs.push(Families { radial: 3, ..degree(2) });
    }
    if lines > 0 {
        rungs.push(Families { reciprocal: 3, ..degree(3) });
    }
    if lines > 1 {
        rungs.push(Families { radial: 3, reciprocal: 3, ..degree(3) });
    }
    rungs
}

fn library(recording: &Recording, families: Families, options: &FormulaOptions) -> Result<Library, FormulaError> {
    let extent = Extent { families, gyroscopic: options.gyroscopic, friction: options.friction };
    Library::new(&recording.coordinates, &recording.periodic, extent, &options.functions)
}

/// A library with the results of the weak form for its terms.
struct WeakForm {
    library: Library,
    quotient: Quotient,
    windows: Windows,
    path: Path,
}

impl WeakForm {
    fn new(
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
            let judges = |block| held.contains(&block);
            eliminate_backward(&windows, (set, &start), (&data.sigma, &complexity), &judges, stop)
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
            if best(&path).is_none_or(|whole| judged(choice) <= START_ERROR * judged(whole)) {
                path = apart.before(path);
                break;
            }
            let errors = |choice: &Choice| windows.errors_by_coordinate(&choice.coefficients, &data.sigma);
            let (own, whole) = (errors(choice), best(&path).map(errors).unwrap_or_default());
            let before = alone.len();
            alone.retain(|&i| whole.get(i).is_none_or(|whole| own[i] <= START_ERROR * whole));
            if alone.len() == before || alone.len() + 1 >= data.n {
                break;
            }
        }
        log(&library, &kept, &path);
        Ok(Self { library, quotient, windows, path })
    }

    /// The smallest held-out error of choices with which the search through the motion may start.
    fn least(&self) -> f64 {
        best(&self.path).map_or(f64::INFINITY, judged)
    }

    /// Fits the choice to the motion, or another choice of the weak form if that gives no formula.
    fn follow_all(
        &self,
        data: &Prepared<'_>,
        held: &BTreeSet<usize>,
        options: &FormulaOptions,
    ) -> Result<FoundFormula, FormulaError> {
        let mut best: Option<FoundFormula> = None;
        for choice in beginnings(&self.path, &self.windows) {
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

    /// Fits a choice to the motion.
    fn follow(
        &self,
        choice: &Choice,
        data: &Prepared<'_>,
        held: &BTreeSet<usize>,
        options: &FormulaOptions,
    ) -> Result<FoundFormula, FormulaError> {
        let (library, kept) = (&self.library, &self.quotient.kept);
        let mut model = Model {
            terms: choice.set.iter().map(|&k| kept[k]).collect(),
            coefficients: choice.set.iter().map(|&k| choice.coefficients[k]).collect(),
        };
        let mut candidates: Vec<usize> = self.path.order.iter().take(MOST_CANDIDATES).map(|&k| kept[k]).collect();
        candidates.extend(model.terms.iter().filter(|k| !candidates.contains(k)).copied().collect::<Vec<_>>());
        candidates.sort_unstable();
        let between = options.between.unwrap_or(Between::Linear);
        let motion = Motion { library, data, substeps: 1, between, threads: options.threads };
        let short = data.segments(2.5 * data.pace);
        let (mut judges, mut learned): (Vec<Segment>, Vec<Segment>) =
            short.into_iter().partition(|s| held.contains(&data.block_of(s)));
        let states = learned.iter().step_by(learned.len().div_ceil(60).max(1)).map(|s| {
            let mut values = Values::new();
            let all: Vec<usize> = (0..library.functions.len()).collect();
            library.evaluate(&all, &s.start[..data.n], &mut values);
            values
        });
        let mut search = Search { library, motion, candidates, states: states.collect() };
        let stop = &options.cancellation;
        stop.stage("short segments");
        search.motion.settle(&model, &mut learned, 4);
        search.motion.choose_steps(&model, &learned);
        search.converge(&mut model, &mut learned, ROUNDS);
        if options.between.is_none() && data.forced.contains(&true) {
            search.motion.choose_between(&mut model, &mut learned);
        }
        stop.check()?;
        stop.stage("longer segments");
        // Longer segments determine the constants better; their initial states are known by now.
        let before = (model.clone(), learned.clone());
        let short = search.motion.settle(&model, &mut learned, 1);
        let mut learned = data.joined(&learned);
        search.motion.choose_steps(&model, &learned);
        let (mut blocks, mut chosen) = search.converge(&mut model, &mut learned, ROUNDS);
        let long = search.motion.settle(&model, &mut learned, 1);
        if long.0 / long.1 > 1.1 * short.0 / short.1 {
            // The motion is too unstable to be followed for so long.
            (model, learned) = before;
            (blocks, chosen) = search.converge(&mut model, &mut learned, 0);
        }
        let rival = search.exchange(&mut model, &mut learned, &mut blocks);
        search.motion.settle(&model, &mut judges, 6);
        let mut judges = data.joined(&judges);
        stop.check()?;
        stop.stage("probabilities");
        let resampled = search.resample(&model, &blocks, &learned, (options.bootstraps, options.seed));
        stop.check()?;
        let shortened = shorten(&search, &self.quotient, &mut model, &mut learned);
        let (covariance, settled) = covariance(&search, &mut model, &mut learned);
        let (square, count) = search.motion.settle(&model, &mut judges, 8);
        let share = |k: &usize| resampled.share.get(k).copied().unwrap_or(1.0);
        let probability = |k: &usize| match shortened.get(k) {
            Some(replaced) => replaced.iter().map(share).fold(1.0, f64::min),
            None => share(k),
        };
        let probability: Vec<f64> = model.terms.iter().map(probability).collect();
        let periodic = &data.recording.periodic;
        let mut found = FoundFormula::new(library, periodic, &model, (&covariance, &probability), options);
        let residuals = search.motion.residuals(&model, &judges);
        let judged = Judged { search: &search, model: &model, segments: &judges, residuals: &residuals, square, count };
        found.paths = judged.paths();
        found.forced.clone_from(&data.forced);
        found.draw(library, &model, &resampled.coefficients);
        found.residual = judged.residual();
        found.noise = data.sigma.clone();
        found.noise_resolved = data.resolved;
        found.left = left_over(&search.motion, &model, &judges);
        found.searched = (library.searched, self.quotient.removed);
        found.bounds = data.bounds.clone();
        found.speeds = data.speeds.clone();
        found.between = data.forced.contains(&true).then_some(search.motion.between);
        if let Some(rival) = rival {
            found.several = rival.cost < THRESHOLD;
            let written = |&k: &usize| {
                let kind = if library.is_dissipation(k) { "D: " } else { "" };
                format!("{kind}{}", library.written(k, Notation::System))
            };
            found.rival = Some(Rival { terms: rival.model.terms.iter().map(written).collect(), cost: rival.cost });
        }
        if !chosen {
            found.notes.push(format!("the choice of terms has not converged after {ROUNDS} rounds"));
        }
        if !settled {
            found.doubts.push("the fit of the coefficients has not converged".to_string());
        }
        found.doubts.extend(judged.doubts());
        found.verdict = judged.verdict(&found.doubts);
        if found.verdict == Verdict::NotInLibrary {
            found.doubts.clear();
        }
        if !self.path.settled && found.verdict != Verdict::Found {
            found.notes.push("the exchange of terms in the weak form was stopped before it converged".to_string());
        }
        Ok(found)
    }
}

/// Held-out motion as a test of a model.
struct Judged<'a> {
    search: &'a Search<'a>,
    model: &'a Model,
    segments: &'a [Segment],
    /// Residuals of the segments in units of the noise, `(samples, n)` each.
    residuals: &'a [Vec<f64>],
    square: f64,
    count: f64,
}

impl Judged<'_> {
    fn residual(&self) -> f64 {
        (self.square / self.count.max(1.0)).sqrt()
    }

    /// Three standard deviations of the residual, which matter if its count is small.
    fn scatter(&self) -> f64 {
        3.0 / (2.0 * self.count.max(1.0)).sqrt()
    }

    fn verdict(&self, doubts: &[String]) -> Verdict {
        match self.residual() <= MOST_RESIDUAL + self.scatter() {
            true if doubts.is_empty() => Verdict::Found,
            true => Verdict::Undecided,
            false => Verdict::NotInLibrary,
        }
    }

    /// Reasons why small residuals do not confirm the formula.
    fn doubts(&self) -> Vec<String> {
        let data = self.search.motion.data;
        let mut doubts = Vec::new();
        let residual = self.residual();
        if data.estimated.iter().all(|estimated| *estimated) && residual < LEAST_RESIDUAL - self.scatter() {
            doubts.push(format!("the residual is {residual:.2} times the noise: the initial states overfit the noise"));
        }
        let masses = self.search.masses(&self.model.terms, &self.model.coefficients);
        if !is_regular(data.n, &masses) {
            doubts.push("its mass matrix is nearly singular".to_string());
        }
        for (i, [moved, left]) in self.motion_and_rest().into_iter().enumerate() {
            if moved < SIGNAL * left {
                let name = &data.recording.coordinates[i];
                doubts.push(format!(
                    "{name} moves by only {} times its residual in the held-out motion: too little to confirm a law",
                    rounded(moved / left, 2)
                ));
            }
        }
        doubts
    }

    /// Positions and residuals of the segments in SI units.
    fn paths(&self) -> Vec<ResidualPath> {
        let data = self.search.motion.data;
        let of = |(segment, residuals): (&Segment, &Vec<f64>)| {
            ResidualPath::of(data.recording, segment, residuals, |_, i| data.sigma_of[segment.track][i])
        };
        self.segments.iter().zip(self.residuals).map(of).collect()
    }

    /// Standard deviation of each coordinate within segments, and of its residual, in units of noise.
    fn motion_and_rest(&self) -> Vec<[f64; 2]> {
        let data = self.search.motion.data;
        let n = data.n;
        let mut sums = vec![[0.0; 4]; n];
        for (segment, residuals) in self.segments.iter().zip(self.residuals) {
            let q = &data.recording.tracks[segment.track].q[segment.first * n..][..segment.samples * n];
            for (i, [moved, free, left, rest]) in sums.iter_mut().map(|[a, b, c, d]| [a, b, c, d]).enumerate() {
                let sigma = data.sigma_of[segment.track][i];
                let values = || q.iter().skip(i).step_by(n);
                let mean = values().sum::<f64>() / segment.samples as f64;
                *moved += values().map(|x| ((x - mean) / sigma).powi(2)).sum::<f64>();
                *free += segment.samples as f64 - 1.0;
                *left += residuals.iter().skip(i).step_by(n).filter(|r| r.is_finite()).map(|r| r * r).sum::<f64>();
                *rest += segment.samples as f64 - 2.0;
            }
        }
        sums.into_iter().map(|[moved, free, left, rest]| [(moved / free).sqrt(), (left / rest).sqrt()]).collect()
    }
}

/// The blocks that are held out: one in so many, chosen at random.
fn held_out(data: &Prepared<'_>, seed: u64) -> BTreeSet<usize> {
    let tracks = 0..data.recording.tracks.len();
    let mut blocks: Vec<usize> = tracks.flat_map(|t| data.pieces(t).into_iter().map(|(block, _)| block)).collect();
    blocks.dedup();
    let mut rng = RngStream::HeldOut.generator(seed);
    let count = (blocks.len() / HELD_OUT).max(1).min(blocks.len().saturating_sub(1));
    (0..count).map(|_| blocks.swap_remove(rng.random_range(0..blocks.len()))).collect()
}

/// The shortest choice whose error is near the smallest, with a positive definite mass matrix if such a choice is not much worse; then other
/// choices near the smallest error.
fn beginnings<'a>(path: &'a Path, windows: &Windows) -> Vec<&'a Choice> {
    let few: Vec<&'a Choice> = path.best.values().filter(|choice| choice.set.len() <= MOST_START).collect();
    let least = few.iter().map(|choice| judged(choice)).fold(f64::INFINITY, f64::min);
    let near = |most: f64| few.iter().copied().filter(move |choice| judged(choice) <= most * least);
    let definite = |most: f64| near(most).find(|choice| windows.is_definite(&choice.coefficients));
    let first = definite(START_ERROR).or_else(|| definite(DEFINITE_ERROR)).or_else(|| near(START_ERROR).next());
    let Some(first) = first else { return Vec::new() };
    let mut others: Vec<&Choice> = near(DEFINITE_ERROR).filter(|choice| choice.set != first.set).collect();
    others.sort_by(|a, b| judged(a).total_cmp(&judged(b)));
    [first].into_iter().chain(others.into_iter().take(OTHER_STARTS)).collect()
}

/// The choice with the smallest error that the search through the motion may start with.
fn best(path: &Path) -> Option<&Choice> {
    let few = path.best.values().filter(|choice| choice.set.len() <= MOST_START);
    few.min_by(|a, b| judged(a).total_cmp(&judged(b)))
}

/// Held-out error of a choice.
fn judged(choice: &Choice) -> f64 {
    if choice.held_out.is_finite() { choice.held_out } else { choice.error }
}

fn log(library: &Library, kept: &[usize], path: &Path) {
    for (size, choice) in path.best.iter().take(12) {
        let terms: Vec<String> = choice.set.iter().map(|&k| library.written(kept[k], Notation::System)).collect();
        let terms = terms.join(" ");
        tracing::debug!(size, error = choice.error, held_out = choice.held_out, terms, "weak form");
    }
}
