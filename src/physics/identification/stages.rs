//! The stages of identification: fits to smoothed accelerations, then to longer and longer segments of the motion.

use super::by_trajectory::by_trajectory;
use super::choices::{check_errors, chosen, fitted_quantity, inputs, missing, sensors};
use super::course::{Course, Segment};
use super::first_fit::first_fit;
use super::found::Identified;
use super::initial_states::SEARCHED;
use super::innovations::Disturbances;
use super::interpolations::{Rivals, best_interpolation};
use super::measured::{Measured, check_columns};
use super::motion_result::result;
use super::per_trajectory::per_trajectory;
use super::pieces::Pieces;
use super::smoothed::{Quantity, States};
use super::solve::{Normal, Problem, Sensor};
use super::thresholds::{
    EQUAL_SQUARES, EXACT_RESIDUAL, FEW_START_ROUNDS, FIRST_SEGMENT, INTEGRATION_ERROR, ITERATIONS, LAST_ITERATIONS,
    LEAST_ERROR_DECREASE, LEAST_NOISE, LEAST_NOISE_LEFT, LEAST_OWN_NOISE_SAMPLES, LEAST_SCATTERED_SEGMENTS,
    LEAST_SEGMENT, MOST_FIRST_SAMPLES, MOST_INCREASE, MOST_OVER_NOISE, MOST_SAMPLES, MOST_SUBSTEPS, NEAR_DECREMENT,
    OWN_NOISE_ERRORS, OWN_NOISE_RATIO, SCATTER_ERRORS, SEGMENTS_OF_RUN, SHORT_OF_CHOSEN, START_ROUNDS, STEP_PROBES,
    USUAL_FIRST_SAMPLES,
};
use super::{Between, IdentifyError, IdentifyOptions, Verdict, by_forces};
use crate::lagrangian::system::Range;
use crate::lagrangian::{Equations, SystemInstance};
use crate::names::rounded;
use crate::recording::{Filled, Recording, deviation, filled, rms};
use std::f64::consts::TAU;

/// Fitted constants, sensor constants and initial states, with the normal equations at these values.
#[derive(Clone)]
pub(super) struct Fitted {
    pub x: Vec<f64>,
    pub segments: Vec<Segment>,
    pub normal: Normal,
    pub substeps: usize,
}

impl Fitted {
    /// Mean square of the residuals.
    pub fn mean_square(&self) -> f64 {
        self.normal.square / self.normal.count.max(1.0)
    }

    /// `true` for a fit that reached the noise with every constant inside its range: no better fit can be expected.
    fn is_sufficient(&self) -> bool {
        let inside = !self.normal.held.contains(&true);
        self.normal.converged && inside && self.mean_square() < MOST_OVER_NOISE * MOST_OVER_NOISE
    }

    /// Variance of the unknowns over that of independent noise of the given size: the mean square of the residuals, or the scatter of the
    /// segments' scores if residuals are correlated along a segment. The second number is the share of the latter.
    pub fn inflation(&self) -> (f64, f64) {
        let square = self.mean_square();
        let (m, count) = (self.x.len(), self.normal.rights.len());
        if count < LEAST_SCATTERED_SEGMENTS {
            return (square, 1.0);
        }
        let ratio = |k: usize| {
            let scatter: f64 = self.normal.rights.iter().map(|part| part[k] * part[k]).sum();
            scatter / self.normal.matrix[k * m + k]
        };
        let mut ratios: Vec<f64> = (0..m).map(ratio).filter(|ratio| ratio.is_finite()).collect();
        ratios.sort_by(f64::total_cmp);
        let scatter = ratios.get(ratios.len() / 2).copied().unwrap_or(square) / square;
        // The scatter that noise causes is itself only estimated.
        let independent = scatter <= 1.0 + SCATTER_ERRORS * (2.0 / count as f64).sqrt();
        if independent { (square, 1.0) } else { (square * scatter, scatter) }
    }

    /// Marks the unknowns with a visible effect.
    fn visible(&self) -> Vec<bool> {
        let m = self.x.len();
        let own = |k: usize| self.normal.matrix[k * m + k];
        (0..m).map(|k| own(k) > 0.0 && (self.x[k] == 0.0 || own(k) * self.x[k] * self.x[k] > 1.0)).collect()
    }

    /// Mean log standard error of the marked unknowns, each with the others held fixed.
    fn mean_log_error(&self, of: &[bool]) -> f64 {
        let m = self.x.len();
        let own = |k: usize| self.normal.matrix[k * m + k].max(f64::MIN_POSITIVE);
        let logarithms: Vec<f64> = (0..m).filter(|k| of[*k]).map(|k| own(k).ln()).collect();
        let mean = logarithms.iter().sum::<f64>() / logarithms.len().max(1) as f64;
        (self.inflation().0.ln() - mean) / 2.0
    }

    /// `true` if its standard errors are smaller than those of another fit. Unknowns without a visible effect in either fit do not count: their
    /// errors are rounding.
    fn determines_better_than(&self, other: &Self) -> bool {
        let either: Vec<bool> = self.visible().into_iter().zip(other.visible()).map(|(a, b)| a || b).collect();
        self.mean_log_error(&either) < other.mean_log_error(&either) - LEAST_ERROR_DECREASE
    }
}

/// Identifies the constants of a system from recorded motion. Angles must be unwrapped, and numbers in the units of the system.
///
/// If the system file has a table `[measured]`, the recording holds these quantities in place of the coordinates, under their names and in their
/// order, [`SystemInstance::measured`]. Every statement about positions then applies to these readings.
///
/// # Errors
/// [`IdentifyError`] for options and recordings that do not match the system, motion that is too short, and positions off a constraint.
/// Constants that the motion does not determine are not an error, nor is a model that does not fit: the result reports them.
pub fn identify(
    instance: &SystemInstance<f64>,
    recording: &Recording,
    options: &IdentifyOptions,
) -> Result<Identified, IdentifyError> {
    let mut found = match per_trajectory(instance, recording, options)? {
        Some((instance, options)) => identify_together(&instance, recording, &options)?,
        None => identify_together(instance, recording, options)?,
    };
    if options.by_trajectory {
        found.by_trajectory = Some(by_trajectory(instance, recording, options, &found)?);
    }
    Ok(found)
}

/// Identifies the constants of all trajectories together.
fn identify_together(
    instance: &SystemInstance<f64>,
    recording: &Recording,
    options: &IdentifyOptions,
) -> Result<Identified, IdentifyError> {
    check_columns(instance, recording)?;
    let n = recording.n();
    recording.tracks.iter().try_for_each(|track| track.validate_repeated(n))?;
    check_errors(recording, &options.errors)?;
    let inputs = inputs(instance, recording, options)?;
    let filled = filled(recording);
    let mut notes = filled.as_ref().map_or_else(Vec::new, repeated_readings);
    notes.extend(missing(recording, &options.missing)?);
    let filled = Filled::without(filled, recording, &options.missing);
    let recording = filled.as_ref().map_or(recording, |filled| &filled.recording);
    let chosen = chosen(instance, options)?;
    let sensors = sensors(instance, recording, options)?;
    let quantity = fitted_quantity(instance, recording, options)?;
    let stop = &options.cancellation;
    stop.stage("equations of motion");
    let unknown = || IdentifyError::Unknown { system: instance.system.name.to_string() };
    let acting = instance.acting_constraints()?;
    let equations = Equations::record(instance, &chosen, &acting)?.ok_or_else(unknown)?;
    let measured = Measured::record(instance, &chosen)?;
    stop.check()?;
    stop.stage("smoothed motion");
    let pieces = Pieces::new(recording, filled.as_ref(), options)?;
    let spread: Vec<f64> = (0..n).map(|i| spread_of(recording, i)).collect();
    let setup = Setup { instance, options, recording, pieces: &pieces, spread: &spread, notes };
    let course = Course {
        recording,
        equations: &equations,
        chosen: chosen.len(),
        between: options.between.unwrap_or(Between::Linear),
        inputs,
        step: pieces.step,
        substeps: 1,
    };
    let problem = setup.problem(course, (chosen, sensors), measured.as_ref());
    stop.check()?;
    let on_pieces = setup.on_pieces(&problem);
    let found = match quantity {
        Quantity::Forces => setup.fit_forces(&on_pieces)?,
        Quantity::Accelerations => setup.fit_motion(problem, &on_pieces)?,
    };
    Ok(found.finished(recording, options.robust))
}

/// What the stages of one identification share.
struct Setup<'a> {
    instance: &'a SystemInstance<f64>,
    options: &'a IdentifyOptions,
    recording: &'a Recording,
    pieces: &'a Pieces<'a>,
    /// Spread of every coordinate over all samples.
    spread: &'a [f64],
    /// Messages about readings that are repeated or missing.
    notes: Vec<String>,
}

impl<'a> Setup<'a> {
    /// The problem of the whole recording.
    fn problem(
        &self,
        course: Course<'a>,
        (chosen, sensors): (Vec<usize>, Vec<Sensor>),
        measured: Option<&'a Measured>,
    ) -> Problem<'a> {
        let Self { instance, options, pieces, spread, .. } = *self;
        Problem {
            course,
            values: instance.parameters.clone(),
            ranges: instance.system.parameters.iter().map(|parameter| parameter.range).collect(),
            chosen,
            sensors,
            measured,
            sigma: self.noise(),
            sigma_of: Vec::new(),
            errors: &options.errors,
            missing: &options.missing,
            gaps: pieces.gaps(),
            spread: spread.to_vec(),
            robust: options.robust,
            disturbances: Disturbances::default(),
            threads: options.threads.max(1),
            cancellation: options.cancellation.clone(),
        }
    }

    /// The same problem for the long pieces alone.
    fn on_pieces<'b>(&self, problem: &Problem<'b>) -> Problem<'b>
    where
        'a: 'b,
    {
        let pieces = self.pieces;
        let of_piece = |track: usize| problem.course.inputs.get(pieces.origin(track, 0).0).copied();
        let inputs = (0..pieces.long.tracks.len()).filter_map(of_piece).collect();
        let course = Course { recording: &pieces.long, inputs, ..problem.course.clone() };
        Problem { course, missing: &[], ..problem.clone() }
    }

    /// `true` if the noise of the positions is given.
    fn knows_noise(&self) -> bool {
        self.options.noise.is_some() || !self.options.errors.is_empty()
    }

    /// `true` if known forces act.
    fn is_forced(&self) -> bool {
        self.recording.tracks.iter().any(|track| !track.force.is_empty())
    }

    /// Standard deviation of every coordinate's noise before the fit, as given or as estimated.
    fn noise(&self) -> Vec<f64> {
        let (n, errors) = (self.spread.len(), &self.options.errors);
        let of = |i: usize| match errors.is_empty() {
            true => self.pieces.noise[i].max(LEAST_NOISE * self.spread[i]),
            false => rms(errors.iter().flat_map(|errors| errors.iter().skip(i).step_by(n)).copied()),
        };
        (0..n).map(of).collect()
    }

    /// The same for trajectories whose noise differs: the root mean square over the samples.
    fn noise_by_trajectory(&self) -> Vec<f64> {
        let of = |i: usize| {
            let squares = self.recording.tracks.iter().zip(&self.pieces.noise_of);
            let square = squares.map(|(track, noise)| track.len() as f64 * noise[i].powi(2)).sum::<f64>();
            (square / self.recording.samples() as f64).sqrt().max(LEAST_NOISE * self.spread[i])
        };
        (0..self.spread.len()).map(of).collect()
    }

    /// Constants fitted to the known forces on the long pieces.
    fn fit_forces(&self, problem: &Problem<'_>) -> Result<Identified, IdentifyError> {
        self.options.cancellation.stage("forces");
        let smoothing = self.pieces.smoothing.as_ref().ok_or(IdentifyError::Lost)?;
        let start = (problem.given(), self.pieces.cut_long());
        let mut found = by_forces::identify(self.instance, problem, smoothing, start)?;
        for outlier in &mut found.outliers {
            (outlier.track, outlier.sample) = self.pieces.origin(outlier.track, outlier.sample);
        }
        found.obstacles = [&self.pieces.still[..], &self.notes].concat();
        Ok(found)
    }

    /// Constants fitted to the motion.
    fn fit_motion(&self, mut problem: Problem<'a>, on_pieces: &Problem<'_>) -> Result<Identified, IdentifyError> {
        let (stop, given) = (&self.options.cancellation, problem.given());
        let (fitted, searched) =
            first_fit(&mut problem, (on_pieces, self.pieces), (self.instance, &given), self.options)?;
        let (fitted, rivals) = self.refined(&mut problem, fitted);
        stop.stage("longer segments");
        let (fitted, rivals) = self.completed(&mut problem, fitted, &rivals);
        let fitted = without_full_turns(&problem, restarted_from_bounds(&problem, fitted, &given), &given);
        let noise = if problem.sigma_of.is_empty() { self.noise() } else { self.noise_by_trajectory() };
        stop.check()?;
        stop.stage("what is determined");
        let start = (&given[..problem.chosen.len()], &noise[..]);
        let mut found = result(self.instance, &problem, &fitted, start, self.knows_noise());
        stop.check()?;
        if self.pieces.still.len() == self.recording.n() {
            // Motionless coordinates cannot confirm a model.
            let coordinate = self.recording.coordinates[0].clone();
            (found.explained, found.verdict) = (false, Verdict::Uninformative { coordinate, share: 1.0 });
        }
        found.obstacles = [&self.pieces.still[..], &self.notes, &self.searched(&problem, &searched)].concat();
        if problem.course.equations.rows.is_some() {
            let states = States::new(on_pieces, &self.pieces.smoothed);
            found.obstacles.extend(on_pieces.off_constraints(&fitted.x, (&states.q, &states.v)));
        }
        if problem.measured.is_some_and(Measured::is_searched) && !found.explained {
            found.obstacles.push(SEARCHED.to_string());
        }
        rivals.widen(&mut found);
        Ok(found)
    }

    /// The fit of the first segments with their best length, interpolation and noise, and the interpolations that fit as well.
    fn refined(&self, problem: &mut Problem<'_>, mut fitted: Fitted) -> (Fitted, Rivals) {
        let (options, forced) = (self.options, self.is_forced());
        if options.segment.is_none() {
            fitted = shortened(problem, fitted);
        }
        if forced && problem.estimate_force_noise(&fitted.x, &fitted.segments) {
            refit(problem, &mut fitted, ITERATIONS);
        }
        // The noise of the forces is now known, so that the smoothest curve through them has no advantage.
        let (mut fitted, rivals) =
            best_interpolation(problem, fitted, &Rivals::all(options, forced || self.instance.has_inputs()));
        if forced && options.between.is_none() && problem.estimate_force_noise(&fitted.x, &fitted.segments) {
            refit(problem, &mut fitted, ITERATIONS);
        }
        if !self.knows_noise() {
            update_noise(problem, &fitted);
            choose_steps(problem, &fitted.x, &fitted.segments);
            refit(problem, &mut fitted, ITERATIONS);
        }
        (fitted, rivals)
    }

    /// The last fit: to segments as long as useful, with the noise that these show.
    fn completed(&self, problem: &mut Problem<'_>, fitted: Fitted, rivals: &Rivals) -> (Fitted, Rivals) {
        let mut fitted = lengthened(problem, fitted, self.options.segment);
        if self.is_forced() {
            // Force errors accumulate: longer segments show them best.
            let mut longer = joined(&fitted.segments);
            problem.settle(&fitted.x, &mut longer, START_ROUNDS);
            problem.estimate_force_noise(&fitted.x, &longer);
        }
        if !self.knows_noise() {
            update_noise(problem, &fitted);
            choose_steps(problem, &fitted.x, &fitted.segments);
        }
        refit(problem, &mut fitted, LAST_ITERATIONS);
        refine_steps(problem, &mut fitted);
        // Longer segments exclude more of the interpolations.
        best_interpolation(problem, fitted, rivals)
    }

    /// Messages about constants whose range was searched only in part.
    fn searched(&self, problem: &Problem<'_>, ranges: &[(usize, [f64; 2])]) -> Vec<String> {
        let of = |(k, [low, high]): &(usize, [f64; 2])| {
            let symbol = &self.instance.system.parameters[problem.chosen[*k]].symbol;
            let [low, high] = [low, high].map(|x| rounded(*x, 4));
            format!("{symbol} was searched from {low} to {high}; start closer to the true value if it may lie outside")
        };
        ranges.iter().map(of).collect()
    }
}

/// Messages about readings that repeat the previous one.
fn repeated_readings(filled: &Filled) -> Vec<String> {
    let recording = &filled.recording;
    let of = |(i, name): (usize, &String)| {
        let (held, samples) = (filled.count(i), recording.samples());
        let problem = "readings repeat the previous one during motion; they were interpolated from their neighbours";
        (held > 0).then(|| format!("{name}: {held} of {samples} {problem}"))
    };
    recording.coordinates.iter().enumerate().filter_map(of).collect()
}

/// Standard deviation of a coordinate over all samples; 1 for one that rests.
pub(crate) fn spread_of(recording: &Recording, i: usize) -> f64 {
    let n = recording.n();
    let spread = deviation(recording.tracks.iter().flat_map(|track| track.q.iter().skip(i).step_by(n)));
    if spread > 0.0 { spread } else { 1.0 }
}

/// Number of samples in a first segment: a few time scales of the fastest coordinate, or the requested number if that is smaller.
pub(super) fn first_samples(
    (v, a): (&[f64], &[f64]),
    (n, step): (usize, f64),
    wanted: Option<f64>,
) -> Result<usize, IdentifyError> {
    let size = |values: &[f64], i: usize| deviation(values.iter().skip(i).step_by(n));
    let paces = (0..n).map(|i| size(v, i) / size(a, i)).filter(|pace| pace.is_finite() && *pace > 0.0);
    let pace = paces.fold(f64::INFINITY, f64::min);
    let samples = if pace.is_finite() { FIRST_SEGMENT * pace / step } else { USUAL_FIRST_SAMPLES };
    let samples = samples.clamp(LEAST_SEGMENT as f64, MOST_FIRST_SAMPLES) as usize;
    let Some(seconds) = wanted else { return Ok(samples) };
    let wanted = (seconds / step).round() as usize;
    if wanted < LEAST_SEGMENT {
        let expected = format!("at least {LEAST_SEGMENT} samples, {} s", rounded(LEAST_SEGMENT as f64 * step, 3));
        return Err(IdentifyError::Option { what: "segment", expected, found: format!("{seconds} s") });
    }
    Ok(samples.min(wanted))
}

/// Leaves out segments beyond the largest number of samples. Runs of consecutive segments are kept, so that these can be joined later.
pub(crate) fn thinned(segments: Vec<Segment>) -> Vec<Segment> {
    let all: usize = segments.iter().map(|segment| segment.samples).sum();
    if all <= MOST_SAMPLES {
        return segments;
    }
    let runs = segments.len().div_ceil(SEGMENTS_OF_RUN);
    let kept = (runs * MOST_SAMPLES / all).max(1);
    let keep = |at: usize| (at / SEGMENTS_OF_RUN + 1) * kept / runs > at / SEGMENTS_OF_RUN * kept / runs;
    segments.into_iter().enumerate().filter(|(at, _)| keep(*at)).map(|(_, segment)| segment).collect()
}

/// The better fit of the first segments from two starting points. The second one is tried only if the fit from the first does not reach the noise.
/// Segments that cannot be integrated are left out.
pub(super) fn fit_first_segments(
    problem: &mut Problem<'_>,
    starts: [Vec<f64>; 2],
    segments: Vec<Segment>,
) -> Result<Fitted, IdentifyError> {
    let mut best: Option<Fitted> = None;
    for x in starts {
        if best.as_ref().is_some_and(Fitted::is_sufficient) {
            break;
        }
        let tried = fit_from(problem, x, segments.clone());
        problem.cancellation.check()?;
        let Some(tried) = tried else { continue };
        if best.as_ref().is_none_or(|best| tried.normal.square < best.normal.square) {
            best = Some(tried);
        }
    }
    let best = best.ok_or(IdentifyError::Lost)?;
    problem.course.substeps = best.substeps;
    log(&best, "first");
    Ok(best)
}

/// The fit of the first segments from one starting point; `None` if no segment can be integrated.
fn fit_from(problem: &mut Problem<'_>, x: Vec<f64>, mut segments: Vec<Segment>) -> Option<Fitted> {
    problem.course.substeps = 1;
    problem.project_starts(&x, &mut segments);
    choose_steps(problem, &x, &segments);
    let integrated = problem.all(&x, &segments);
    let mut kept = integrated.iter().map(Option::is_some);
    segments.retain(|_| kept.next().unwrap_or(false));
    if segments.is_empty() {
        return None;
    }
    problem.settle(&x, &mut segments, START_ROUNDS);
    let mut fitted = Fitted { x, segments, normal: Normal::default(), substeps: 1 };
    refit(problem, &mut fitted, ITERATIONS);
    if choose_steps(problem, &fitted.x, &fitted.segments) {
        refit(problem, &mut fitted, ITERATIONS);
    }
    Some(fitted)
}

/// The better of two fits: the given one, and one that restarts the constants at their bounds from their starting values.
fn restarted_from_bounds(problem: &Problem<'_>, fitted: Fitted, given: &[f64]) -> Fitted {
    if !fitted.normal.held.contains(&true) {
        return fitted;
    }
    let mut tried = fitted.clone();
    for (k, x) in tried.x.iter_mut().enumerate().filter(|(k, _)| fitted.normal.held[*k]) {
        *x = given[k];
    }
    refit(problem, &mut tried, LAST_ITERATIONS);
    let better = tried.normal.square < fitted.normal.square && tried.normal.converged >= fitted.normal.converged;
    if better { tried } else { fitted }
}

/// Shifts constants that are determined up to full turns, such as a phase, next to their starting values.
fn without_full_turns(problem: &Problem<'_>, mut fitted: Fitted, given: &[f64]) -> Fitted {
    for (k, &parameter) in problem.chosen.iter().enumerate().filter(|(_, k)| problem.ranges[**k] == Range::Any) {
        let turns = ((fitted.x[k] - given[k]) / TAU).round();
        let mut tried = fitted.x.clone();
        tried[k] -= turns * TAU;
        if turns != 0.0 && turns.is_finite() {
            let square = problem.normal_at(&tried, &fitted.segments).square;
            if (square - fitted.normal.square).abs() <= EQUAL_SQUARES * fitted.normal.square {
                tracing::debug!(parameter, turns, "full turns");
                fitted.x = tried;
            }
        }
    }
    fitted
}

/// Fits the constants and the initial states again.
pub(super) fn refit(problem: &Problem<'_>, fitted: &mut Fitted, iterations: usize) {
    fitted.substeps = problem.course.substeps;
    fitted.normal = problem.fit(&mut fitted.x, &mut fitted.segments, iterations);
}

/// Halves the integration steps until the search converges. Where a force changes abruptly, such as dry friction, the integration error is not a
/// smooth function of the constants, and neither is the sum of squares.
fn refine_steps(problem: &mut Problem<'_>, fitted: &mut Fitted) {
    while !fitted.normal.converged && fitted.normal.failed == 0 && problem.course.substeps < MOST_SUBSTEPS {
        if problem.cancellation.is_cancelled() {
            break;
        }
        let before = fitted.normal.decrement;
        problem.course.substeps *= 2;
        refit(problem, fitted, ITERATIONS);
        log(fitted, "smaller steps");
        if fitted.normal.decrement > before / 2.0 {
            break;
        }
    }
}

fn log(fitted: &Fitted, what: &str) {
    let (x, samples) = (&fitted.x, fitted.segments.first().map_or(0, |segment| segment.samples));
    let (square, spread) = (fitted.mean_square(), fitted.mean_log_error(&fitted.visible()));
    let (segments, substeps) = (fitted.segments.len(), fitted.substeps);
    tracing::debug!(?x, samples, segments, substeps, square, spread, failed = fitted.normal.failed, "{what}");
}

/// Increases the number of integration steps between samples until the integration error is small compared with the noise; `true` if the number
/// changes.
pub(crate) fn choose_steps(problem: &mut Problem<'_>, x: &[f64], segments: &[Segment]) -> bool {
    let before = problem.course.substeps;
    let stride = segments.len().div_ceil(STEP_PROBES).max(1);
    let mut probes: Vec<&Segment> = segments.iter().step_by(stride).collect();
    probes.sort_by_key(|segment| std::cmp::Reverse(segment.samples));
    let n = problem.width();
    let mut coarse = problem.last_readings(x, &probes);
    while problem.course.substeps < MOST_SUBSTEPS && problem.cancellation.go_on() {
        let mut finer = problem.clone();
        finer.course.substeps *= 2;
        let fine = finer.last_readings(x, &probes);
        let errors = coarse.iter().zip(&fine).flat_map(|(a, b)| {
            (0..n).map(|i| ((a[i] - b[i]) / problem.sigma[i]).abs()).filter(|e| e.is_finite()).collect::<Vec<_>>()
        });
        let mut errors: Vec<f64> = errors.collect();
        errors.sort_by(f64::total_cmp);
        if errors.get(errors.len() * 9 / 10).is_none_or(|worst| *worst < INTEGRATION_ERROR) {
            break;
        }
        (problem.course.substeps, coarse) = (finer.course.substeps, fine);
    }
    problem.course.substeps != before
}

/// Replaces the noise of every coordinate by the size of its residuals, for each trajectory separately if trajectories differ significantly.
fn update_noise(problem: &mut Problem<'_>, fitted: &Fitted) {
    let (n, tracks) = (problem.sigma.len(), problem.course.recording.tracks.len());
    let residuals = problem.all_residuals(&fitted.x, &fitted.segments);
    let freedom = fitted.normal.count / problem.readings(&fitted.segments);
    // Residuals in the units of the coordinates, `(tracks, n)`.
    let mut own = vec![Vec::new(); tracks * n];
    for (segment, residuals) in fitted.segments.iter().zip(&residuals) {
        for (k, r) in residuals.iter().enumerate().filter(|(_, r)| r.is_finite()) {
            own[segment.track * n + k % n].push(r * problem.sigma_at(segment.track, segment.first + k / n, k % n));
        }
    }
    let mut of = vec![vec![0.0; n]; tracks];
    let mut differ = false;
    for i in 0..n {
        let least = (LEAST_NOISE * problem.spread[i]).max(LEAST_NOISE_LEFT * problem.sigma[i]);
        let size = |values: Vec<f64>| (deviation_of(values, problem.robust) / freedom.sqrt()).max(least);
        let whole = size(own.iter().skip(i).step_by(n).flatten().copied().collect());
        // Integration errors of exact motion are not noise.
        let noisy = whole > EXACT_RESIDUAL * problem.spread[i];
        problem.sigma[i] = whole;
        for (track, of) in of.iter_mut().enumerate() {
            let values = &own[track * n + i];
            let count = independent_samples(values);
            of[i] = if values.len() < LEAST_OWN_NOISE_SAMPLES { whole } else { size(values.clone()) };
            // The standard error of the logarithm of a standard deviation is one over the square root of twice the count.
            differ |=
                noisy && (of[i] / whole).ln().abs() > OWN_NOISE_RATIO.max(OWN_NOISE_ERRORS / (2.0 * count).sqrt());
        }
    }
    problem.sigma_of = if differ { of } else { Vec::new() };
}

/// Effective number of independent samples in a mean square, from the autocorrelation at lag 1.
fn independent_samples(values: &[f64]) -> f64 {
    let square: f64 = values.iter().map(|x| x * x).sum();
    let product: f64 = values.windows(2).map(|pair| pair[0] * pair[1]).sum();
    let correlation = (product / square).powi(2);
    let share = (1.0 - correlation) / (1.0 + correlation);
    if share.is_finite() { values.len() as f64 * share } else { 0.0 }
}

/// Root mean square, or a robust estimate from the median of the sizes, which is 0.6745 times the standard deviation of normal numbers.
fn deviation_of(mut values: Vec<f64>, robust: bool) -> f64 {
    if !robust {
        return rms(values);
    }
    values.iter_mut().for_each(|x| *x = x.abs());
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(0.0) / 0.6745
}

/// Joins pairs of adjacent segments.
pub(crate) fn joined(segments: &[Segment]) -> Vec<Segment> {
    let mut joined: Vec<(Segment, bool)> = Vec::new();
    for segment in segments {
        match joined.last_mut() {
            Some((last, double))
                if !*double && last.track == segment.track && last.first + last.samples == segment.first =>
            {
                last.samples += segment.samples;
                *double = true;
            }
            _ => joined.push((segment.clone(), false)),
        }
    }
    joined.into_iter().map(|(segment, _)| segment).collect()
}

/// Halves every segment that is long enough. Both halves start on the fitted motion.
fn halved(problem: &Problem<'_>, fitted: &Fitted) -> Vec<Segment> {
    let long = |segment: &&Segment| segment.samples >= 2 * problem.least_segment();
    let to_middle = |segment: &Segment| Segment { samples: segment.samples / 2 + 1, ..segment.clone() };
    let first: Vec<Segment> = fitted.segments.iter().filter(long).map(to_middle).collect();
    let mut middles = problem.ends(&fitted.x, &first.iter().collect::<Vec<_>>()).into_iter();
    let mut segments = Vec::new();
    for segment in &fitted.segments {
        let Some(start) = long(&segment).then(|| middles.next()).flatten() else {
            segments.push(segment.clone());
            continue;
        };
        let half = segment.samples / 2;
        let (first, samples) = (segment.first + half, segment.samples - half);
        segments.push(Segment { samples: half, ..segment.clone() });
        segments.push(Segment { track: segment.track, first, samples, start });
    }
    segments
}

/// Halves the segments of a model that does not fit, as long as that reduces the standard errors: the effect of a missing term accumulates along
/// a segment.
fn shortened(problem: &Problem<'_>, mut fitted: Fitted) -> Fitted {
    while fitted.mean_square() > MOST_OVER_NOISE * MOST_OVER_NOISE && !problem.cancellation.is_cancelled() {
        let segments = halved(problem, &fitted);
        if segments.len() == fitted.segments.len() {
            break;
        }
        let mut shorter = Fitted { segments, ..fitted.clone() };
        problem.settle(&shorter.x, &mut shorter.segments, FEW_START_ROUNDS);
        refit(problem, &mut shorter, ITERATIONS);
        log(&shorter, "shorter");
        if shorter.normal.failed > 0 || !shorter.determines_better_than(&fitted) {
            break;
        }
        fitted = shorter;
    }
    fitted
}

/// Joins adjacent segments as long as that reduces the standard errors, or up to the wanted length.
fn lengthened(problem: &mut Problem<'_>, mut fitted: Fitted, wanted: Option<f64>) -> Fitted {
    let seconds = |segments: &[Segment]| typical_samples(segments) as f64 * problem.course.step;
    let mut too_short = wanted.map(|wanted| seconds(&fitted.segments) * SHORT_OF_CHOSEN < wanted);
    while too_short != Some(false) && !problem.cancellation.is_cancelled() {
        let segments = joined(&fitted.segments);
        if segments.len() == fitted.segments.len() {
            break;
        }
        let mut longer = Fitted { segments, ..fitted.clone() };
        choose_steps(problem, &longer.x, &longer.segments);
        // The largest number of steps may not be enough to integrate longer segments accurately.
        if wanted.is_none() && problem.course.substeps == MOST_SUBSTEPS && fitted.substeps < MOST_SUBSTEPS {
            problem.course.substeps = fitted.substeps;
            break;
        }
        problem.settle(&longer.x, &mut longer.segments, START_ROUNDS);
        refit(problem, &mut longer, ITERATIONS);
        log(&longer, "longer");
        // For chaotic motion the sum of squares is rough, and the search stalls.
        let has_arrived = longer.normal.decrement < NEAR_DECREMENT || !fitted.normal.converged;
        let acceptable =
            longer.normal.failed == 0 && longer.mean_square() < MOST_INCREASE * fitted.mean_square() && has_arrived;
        if wanted.is_none() && !(acceptable && longer.determines_better_than(&fitted)) {
            problem.course.substeps = fitted.substeps;
            break;
        }
        fitted = longer;
        let seconds = typical_samples(&fitted.segments) as f64 * problem.course.step;
        too_short = wanted.map(|wanted| seconds * SHORT_OF_CHOSEN < wanted);
    }
    fitted
}

/// Number of samples of a typical segment.
pub(super) fn typical_samples(segments: &[Segment]) -> usize {
    let mut samples: Vec<usize> = segments.iter().map(|segment| segment.samples).collect();
    samples.sort_unstable();
    samples.get(samples.len() / 2).copied().unwrap_or(0)
}
