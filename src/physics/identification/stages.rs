//! Stages of identification: from smoothed accelerations to longer and longer segments of motion.

use super::by_trajectory::by_trajectory;
use super::choices::{check_errors, chosen, inputs, met, missing, sensors};
use super::covariance::{Root, Weighing, agreement, continuation, long_run, scores};
use super::first_fit::first_fit;
use super::follow::{Course, Segment};
use super::found::{Identified, Outlier, Residual, ResidualPath};
use super::initial_states::SEARCHED;
use super::innovations::Disturbances;
use super::measured::{Measured, check_columns};
use super::per_trajectory::per_trajectory;
use super::pieces::Pieces;
use super::quality::{Correlation, Evidence, correlation, innovations, mean_eigenvalue, outliers, over_noise, usual};
use super::smoothed::{Met, States};
use super::solve::{Normal, Problem};
use super::thresholds::{
    EQUAL_SQUARES, EXACT_RESIDUAL, FEW_START_ROUNDS, FIRST_SEGMENT, INTEGRATION_ERROR, ITERATIONS, LAST_ITERATIONS,
    LEAST_ERROR_DECREASE, LEAST_FREEDOM, LEAST_NOISE, LEAST_NOISE_LEFT, LEAST_OWN_NOISE_SAMPLES,
    LEAST_SCATTERED_SEGMENTS, LEAST_SEGMENT, MOST_FIRST_SAMPLES, MOST_INCREASE, MOST_OVER_NOISE, MOST_SAMPLES,
    MOST_SUBSTEPS, NEAR_DECREMENT, OWN_NOISE_ERRORS, OWN_NOISE_RATIO, SCATTER_ERRORS, SEGMENTS_OF_RUN, SHORT_OF_CHOSEN,
    SIGNIFICANCE, START_ROUNDS, STEP_PROBES, USUAL_FIRST_SAMPLES,
};
use super::unknowns::unknowns;
use super::ways::{Rivals, best_between};
use super::{Between, IdentifyError, IdentifyOptions, Verdict, by_forces};
use crate::lagrangian::system::Range;
use crate::lagrangian::{Equations, SystemInstance};
use crate::names::rounded;
use crate::recording::{Filled, Recording, deviation, filled, rms};
use std::f64::consts::TAU;

/// Constants, sensors and initial states with the normal equations there.
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

    /// `true` for a fit that reached the noise with every constant inside its range: no better fit is to be expected.
    fn is_plain(&self) -> bool {
        let inside = !self.normal.held.contains(&true);
        self.normal.converged && inside && self.mean_square() < MOST_OVER_NOISE * MOST_OVER_NOISE
    }

    /// Variance of the unknowns over that of independent noise of the given size: the mean square of the residuals, or the scatter of the
    /// segments' scores if residuals are correlated along a segment. The second number is the share of the latter.
    pub fn inflation(&self) -> (f64, f64) {
        let square = self.mean_square();
        let (m, count) = (self.x.len(), self.normal.parts.len());
        if count < LEAST_SCATTERED_SEGMENTS {
            return (square, 1.0);
        }
        let ratio = |k: usize| {
            let scatter: f64 = self.normal.parts.iter().map(|part| part[k] * part[k]).sum();
            scatter / self.normal.matrix[k * m + k]
        };
        let mut ratios: Vec<f64> = (0..m).map(ratio).filter(|ratio| ratio.is_finite()).collect();
        ratios.sort_by(f64::total_cmp);
        let scatter = ratios.get(ratios.len() / 2).copied().unwrap_or(square) / square;
        // Scatter of noise itself is not exactly one.
        let plain = scatter <= 1.0 + SCATTER_ERRORS * (2.0 / count as f64).sqrt();
        if plain { (square, 1.0) } else { (square * scatter, scatter) }
    }

    /// Unknowns with a visible effect.
    fn seen(&self) -> Vec<bool> {
        let m = self.x.len();
        let own = |k: usize| self.normal.matrix[k * m + k];
        (0..m).map(|k| own(k) > 0.0 && (self.x[k] == 0.0 || own(k) * self.x[k] * self.x[k] > 1.0)).collect()
    }

    /// Mean log standard error of some unknowns, each with the others fixed.
    fn spread(&self, of: &[bool]) -> f64 {
        let m = self.x.len();
        let own = |k: usize| self.normal.matrix[k * m + k].max(f64::MIN_POSITIVE);
        let logarithms: Vec<f64> = (0..m).filter(|k| of[*k]).map(|k| own(k).ln()).collect();
        let mean = logarithms.iter().sum::<f64>() / logarithms.len().max(1) as f64;
        (self.inflation().0.ln() - mean) / 2.0
    }

    /// `true` if it determines the unknowns better than another fit: those with a visible effect in either; errors of the others are rounding.
    fn tells_more_than(&self, other: &Self) -> bool {
        let either: Vec<bool> = self.seen().into_iter().zip(other.seen()).map(|(a, b)| a || b).collect();
        self.spread(&either) < other.spread(&either) - LEAST_ERROR_DECREASE
    }
}

/// Identifies the constants of a system from recorded motion; angles are unwrapped, numbers are in the units of the system.
///
/// If the file of the system has a table `[measured]`, the recording holds these quantities in place of the coordinates, under their names and
/// in their order, [`SystemInstance::measured`]; what is said of positions then holds for readings.
///
/// # Errors
/// [`IdentifyError`] for options and recordings that do not fit the system, motion that is too short, and positions that constraints do not allow.
/// Constants that the motion does not determine are not an error, nor is a model that does not fit: the result reports them.
pub fn identify(
    instance: &SystemInstance<f64>,
    recording: &Recording,
    options: &IdentifyOptions,
) -> Result<Identified, IdentifyError> {
    let mut found = match per_trajectory(instance, recording, options)? {
        Some((instance, options)) => together(&instance, recording, &options)?,
        None => together(instance, recording, options)?,
    };
    if options.by_trajectory {
        found.by_trajectory = Some(by_trajectory(instance, recording, options, &found)?);
    }
    Ok(found)
}

/// The constants of all trajectories together.
fn together(
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
    let mut repeated = filled.as_ref().map_or_else(Vec::new, repeated);
    repeated.extend(missing(recording, &options.missing)?);
    let filled = Filled::without(filled, recording, &options.missing);
    let recording = filled.as_ref().map_or(recording, |filled| &filled.recording);
    let chosen = chosen(instance, options)?;
    let sensors = sensors(instance, recording, options)?;
    let met = met(instance, recording, options)?;
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
    let least: Vec<f64> = spread.iter().map(|spread| LEAST_NOISE * spread).collect();
    let known = options.noise.is_some() || !options.errors.is_empty();
    let noise = |i: usize| match options.errors.is_empty() {
        true => pieces.noise[i].max(least[i]),
        false => rms(options.errors.iter().flat_map(|errors| errors.iter().skip(i).step_by(n)).copied()),
    };
    let mut noise: Vec<f64> = (0..n).map(noise).collect();
    let forced = recording.tracks.iter().any(|track| !track.force.is_empty());
    let course = Course {
        recording,
        equations: &equations,
        chosen: chosen.len(),
        between: options.between.unwrap_or(Between::Linear),
        inputs: inputs.clone(),
        step: pieces.step,
        substeps: 1,
    };
    let start: Vec<f64> = chosen.iter().map(|&k| instance.parameters[k]).collect();
    let given: Vec<f64> = start.iter().copied().chain(sensors.iter().map(|sensor| sensor.perfect())).collect();
    let mut problem = Problem {
        course,
        values: instance.parameters.clone(),
        ranges: instance.system.parameters.iter().map(|parameter| parameter.range).collect(),
        chosen,
        sensors,
        measured: measured.as_ref(),
        sigma: noise.clone(),
        sigma_of: Vec::new(),
        errors: &options.errors,
        missing: &options.missing,
        gaps: pieces.gaps(),
        spread,
        robust: options.robust,
        disturbances: Disturbances::default(),
        threads: options.threads.max(1),
        cancellation: options.cancellation.clone(),
    };
    stop.check()?;
    let of_piece = |track: usize| inputs.get(pieces.origin(track, 0).0).copied();
    let of_pieces = (0..pieces.long.tracks.len()).filter_map(of_piece).collect();
    let course = Course { recording: &pieces.long, inputs: of_pieces, ..problem.course.clone() };
    let on_pieces = Problem { course, missing: &[], ..problem.clone() };
    if met == Met::Forces {
        stop.stage("forces");
        let smoothing = pieces.smoothing.as_ref().ok_or(IdentifyError::Lost)?;
        let mut found = by_forces::identify(instance, &on_pieces, smoothing, (given, pieces.cut_long()))?;
        for outlier in &mut found.outliers {
            (outlier.track, outlier.sample) = pieces.origin(outlier.track, outlier.sample);
        }
        found.obstacles = [pieces.still, repeated].concat();
        return Ok(found.named(recording, options.robust));
    }
    let (mut fitted, cut) = first_fit(&mut problem, (&on_pieces, &pieces), (instance, &given), options)?;
    if options.segment.is_none() {
        fitted = shortened(&problem, fitted);
    }
    if forced && problem.estimate_force_noise(&fitted.x, &fitted.segments) {
        refit(&problem, &mut fitted, ITERATIONS);
    }
    // The noise of the forces is now known, so that the smoothest curve through it does not win.
    let (best, mut rivals) = best_between(&mut problem, fitted, &Rivals::all(options, forced || instance.has_inputs()));
    fitted = best;
    if forced && options.between.is_none() && problem.estimate_force_noise(&fitted.x, &fitted.segments) {
        refit(&problem, &mut fitted, ITERATIONS);
    }
    if !known {
        weigh(&mut problem, &fitted);
        choose_steps(&mut problem, &fitted.x, &fitted.segments);
        refit(&problem, &mut fitted, ITERATIONS);
    }
    stop.stage("longer segments");
    fitted = grown(&mut problem, fitted, options.segment);
    if forced {
        // Force errors accumulate: longer segments show them best.
        let mut longer = joined(&fitted.segments);
        problem.settle(&fitted.x, &mut longer, START_ROUNDS);
        problem.estimate_force_noise(&fitted.x, &longer);
    }
    if !known {
        weigh(&mut problem, &fitted);
        choose_steps(&mut problem, &fitted.x, &fitted.segments);
    }
    refit(&problem, &mut fitted, LAST_ITERATIONS);
    smooth(&mut problem, &mut fitted);
    // Longer segments exclude more of the interpolations.
    (fitted, rivals) = best_between(&mut problem, fitted, &rivals);
    fitted = unturned(&problem, released(&problem, fitted, &given), &given);
    if !problem.sigma_of.is_empty() {
        let own = |i: usize| {
            let squares = recording.tracks.iter().zip(&pieces.noise_of);
            squares.map(|(track, noise)| track.len() as f64 * noise[i].powi(2)).sum::<f64>()
        };
        noise = (0..n).map(|i| (own(i) / recording.samples() as f64).sqrt().max(least[i])).collect();
    }
    stop.check()?;
    stop.stage("what is determined");
    let mut found = result(instance, &problem, &fitted, (&start, &noise), known);
    stop.check()?;
    if pieces.still.len() == n {
        // Coordinates that all stand still cannot confirm a model.
        let coordinate = recording.coordinates[0].clone();
        (found.explained, found.verdict) = (false, Verdict::Uninformative { coordinate, share: 1.0 });
    }
    let searched = |(k, [low, high]): &(usize, [f64; 2])| {
        let symbol = &instance.system.parameters[problem.chosen[*k]].symbol;
        let [low, high] = [low, high].map(|x| rounded(*x, 4));
        format!("{symbol} was searched from {low} to {high}; begin nearer if it may lie outside")
    };
    found.obstacles = [pieces.still, repeated, cut.iter().map(searched).collect()].concat();
    if equations.rows.is_some() {
        let states = States::new(&on_pieces, &pieces.smoothed);
        found.obstacles.extend(on_pieces.off_constraints(&fitted.x, (&states.q, &states.v)));
    }
    if problem.measured.is_some_and(Measured::is_searched) && !found.explained {
        found.obstacles.push(SEARCHED.to_string());
    }
    rivals.widen(&mut found);
    Ok(found.named(recording, options.robust))
}

/// Messages about readings that a sensor repeated.
fn repeated(filled: &Filled) -> Vec<String> {
    let recording = &filled.recording;
    let of = |(i, name): (usize, &String)| {
        let (held, samples) = (filled.count(i), recording.samples());
        let says = "readings repeat the previous one during motion; they were interpolated from their neighbours";
        (held > 0).then(|| format!("{name}: {held} of {samples} {says}"))
    };
    recording.coordinates.iter().enumerate().filter_map(of).collect()
}

/// Standard deviation of a coordinate over all samples; 1 for one that rests.
pub(crate) fn spread_of(recording: &Recording, i: usize) -> f64 {
    let n = recording.n();
    let spread = deviation(recording.tracks.iter().flat_map(|track| track.q.iter().skip(i).step_by(n)));
    if spread > 0.0 { spread } else { 1.0 }
}

/// Samples of the first segments: a few time scales of the fastest coordinate, or the requested number if that is smaller.
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

/// Segments up to the number of samples that can be followed: runs of consecutive segments, so that they can be joined later.
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

/// The better fit of the first segments from either of two starts; segments that cannot be followed are left out. The second start is tried if
/// the first one does not reach the noise.
pub(super) fn first(
    problem: &mut Problem<'_>,
    starts: [Vec<f64>; 2],
    segments: Vec<Segment>,
) -> Result<Fitted, IdentifyError> {
    let mut best: Option<Fitted> = None;
    for x in starts {
        if best.as_ref().is_some_and(Fitted::is_plain) {
            break;
        }
        let tried = first_from(problem, x, segments.clone());
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

/// The fit of the first segments from given values.
fn first_from(problem: &mut Problem<'_>, x: Vec<f64>, mut segments: Vec<Segment>) -> Option<Fitted> {
    problem.course.substeps = 1;
    problem.bring(&x, &mut segments);
    choose_steps(problem, &x, &segments);
    let followed = problem.all(&x, &segments);
    let mut kept = followed.iter().map(Option::is_some);
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

/// The better of two fits: one with constants at their bounds, and one that restarts these from their given values.
fn released(problem: &Problem<'_>, fitted: Fitted, given: &[f64]) -> Fitted {
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

/// The fit with constants that are known up to full turns, such as a phase, brought next to their given values.
fn unturned(problem: &Problem<'_>, mut fitted: Fitted, given: &[f64]) -> Fitted {
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

pub(super) fn refit(problem: &Problem<'_>, fitted: &mut Fitted, iterations: usize) {
    fitted.substeps = problem.course.substeps;
    fitted.normal = problem.fit(&mut fitted.x, &mut fitted.segments, iterations);
}

/// Takes smaller steps of integration until the search converges: where a force turns sharply, such as dry friction, the error of the steps
/// depends roughly on the constants, and the sum of squares with it.
fn smooth(problem: &mut Problem<'_>, fitted: &mut Fitted) {
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
    let (square, spread) = (fitted.mean_square(), fitted.spread(&fitted.seen()));
    let (segments, substeps) = (fitted.segments.len(), fitted.substeps);
    tracing::debug!(?x, samples, segments, substeps, square, spread, failed = fitted.normal.failed, "{what}");
}

/// Chooses as many integration steps between samples as keep the integrator's error below a share of the noise; `true` if their number changes.
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

/// Weights coordinates by their residuals, and trajectories by their own residuals where they clearly differ.
fn weigh(problem: &mut Problem<'_>, fitted: &Fitted) {
    let (n, tracks) = (problem.sigma.len(), problem.course.recording.tracks.len());
    let residuals = problem.all_residuals(&fitted.x, &fitted.segments);
    let taken = fitted.normal.count / problem.readings(&fitted.segments);
    // Residuals in the units of the coordinates, `(tracks, n)`.
    let mut own = vec![Vec::new(); tracks * n];
    for (segment, residuals) in fitted.segments.iter().zip(&residuals) {
        for (k, r) in residuals.iter().enumerate().filter(|(_, r)| r.is_finite()) {
            own[segment.track * n + k % n].push(r * problem.sigma_at(segment.track, segment.first + k / n, k % n));
        }
    }
    let mut of = vec![vec![0.0; n]; tracks];
    let mut unlike = false;
    for i in 0..n {
        let least = (LEAST_NOISE * problem.spread[i]).max(LEAST_NOISE_LEFT * problem.sigma[i]);
        let size = |values: Vec<f64>| (deviation_of(values, problem.robust) / taken.sqrt()).max(least);
        let whole = size(own.iter().skip(i).step_by(n).flatten().copied().collect());
        // Integration errors of exact motion are not noise.
        let noisy = whole > EXACT_RESIDUAL * problem.spread[i];
        problem.sigma[i] = whole;
        for (track, of) in of.iter_mut().enumerate() {
            let values = &own[track * n + i];
            let count = independent(values);
            of[i] = if values.len() < LEAST_OWN_NOISE_SAMPLES { whole } else { size(values.clone()) };
            // The log of a standard deviation has a standard error of one over the root of twice the count.
            unlike |=
                noisy && (of[i] / whole).ln().abs() > OWN_NOISE_RATIO.max(OWN_NOISE_ERRORS / (2.0 * count).sqrt());
        }
    }
    problem.sigma_of = if unlike { of } else { Vec::new() };
}

/// Effective number of independent samples for a mean square, by the autocorrelation.
fn independent(values: &[f64]) -> f64 {
    let square: f64 = values.iter().map(|x| x * x).sum();
    let product: f64 = values.windows(2).map(|pair| pair[0] * pair[1]).sum();
    let alike = (product / square).powi(2);
    let share = (1.0 - alike) / (1.0 + alike);
    if share.is_finite() { values.len() as f64 * share } else { 0.0 }
}

/// Root mean square, or a robust estimate from the median of the size, which is 0.6745 of it for normal numbers.
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

/// Halves every segment that is long enough; both halves start on the fitted motion.
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

/// For a model that does not fit, shortens segments while that reduces the standard errors: the effect of a missing term accumulates along a
/// segment.
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
        if shorter.normal.failed > 0 || !shorter.tells_more_than(&fitted) {
            break;
        }
        fitted = shorter;
    }
    fitted
}

/// Joins segments while that reduces the standard errors.
fn grown(problem: &mut Problem<'_>, mut fitted: Fitted, wanted: Option<f64>) -> Fitted {
    let seconds = |segments: &[Segment]| usual_samples(segments) as f64 * problem.course.step;
    let mut wanted_more = wanted.map(|wanted| seconds(&fitted.segments) * SHORT_OF_CHOSEN < wanted);
    while wanted_more != Some(false) && !problem.cancellation.is_cancelled() {
        let segments = joined(&fitted.segments);
        if segments.len() == fitted.segments.len() {
            break;
        }
        let mut longer = Fitted { segments, ..fitted.clone() };
        choose_steps(problem, &longer.x, &longer.segments);
        // No number of steps is known to follow longer segments well enough.
        if wanted.is_none() && problem.course.substeps == MOST_SUBSTEPS && fitted.substeps < MOST_SUBSTEPS {
            problem.course.substeps = fitted.substeps;
            break;
        }
        problem.settle(&longer.x, &mut longer.segments, START_ROUNDS);
        refit(problem, &mut longer, ITERATIONS);
        log(&longer, "longer");
        // Along chaotic motion the search gets stuck on the roughness of the sum of squares.
        let is_followed = longer.normal.decrement < NEAR_DECREMENT || !fitted.normal.converged;
        let met =
            longer.normal.failed == 0 && longer.mean_square() < MOST_INCREASE * fitted.mean_square() && is_followed;
        if wanted.is_none() && !(met && longer.tells_more_than(&fitted)) {
            problem.course.substeps = fitted.substeps;
            break;
        }
        fitted = longer;
        let seconds = usual_samples(&fitted.segments) as f64 * problem.course.step;
        wanted_more = wanted.map(|wanted| seconds * SHORT_OF_CHOSEN < wanted);
    }
    fitted
}

/// Number of samples of a typical segment.
fn usual_samples(segments: &[Segment]) -> usize {
    let mut samples: Vec<usize> = segments.iter().map(|segment| segment.samples).collect();
    samples.sort_unstable();
    samples.get(samples.len() / 2).copied().unwrap_or(0)
}

fn result(
    instance: &SystemInstance<f64>,
    problem: &Problem<'_>,
    fitted: &Fitted,
    (start, noise): (&[f64], &[f64]),
    known: bool,
) -> Identified {
    let n = problem.sigma.len();
    let recording = problem.course.recording;
    let normal_at = |x: &[f64]| Some(problem.normal_at(x, &fitted.segments));
    let residuals = problem.all_residuals(&fitted.x, &fitted.segments);
    let numbers = problem.readings(&fitted.segments);
    let taken = (fitted.normal.count - fitted.x.len() as f64).max(1.0) / numbers;
    let weighing = Weighing::of(&residuals, problem.robust, taken);
    let follow: Vec<Correlation> =
        innovations(problem, &fitted.x, &fitted.segments).iter().map(|runs| correlation(runs)).collect();
    let is_white = |of: &Correlation| of.probability * n as f64 >= SIGNIFICANCE;
    // Outliers do not excuse the other samples.
    let size = |i: usize| usual(&residuals, n, i) * problem.sigma[i] / taken.sqrt();
    let of = |i: usize| {
        let own = residuals.iter().flat_map(|segment| segment.iter().skip(i).step_by(n).copied());
        let rms = rms(own.filter(|r| r.is_finite())) / taken.sqrt() * problem.sigma[i];
        let (coordinate, spread) = (recording.coordinates[i].clone(), problem.spread[i]);
        let (autocorrelation, white) = (follow[i].neighbours, is_white(&follow[i]));
        Residual { coordinate, rms, noise: noise[i], spread, autocorrelation, white }
    };
    let by_coordinate: Vec<Residual> = (0..n).map(of).collect();
    let far = |track: usize, sample: usize, i: usize, size: f64| Outlier {
        track,
        sample,
        trajectory: String::new(),
        row: 0,
        time: recording.tracks[track].times[sample],
        coordinate: recording.coordinates[i].clone(),
        size,
    };
    let (outliers, outlier_count) = outliers((&fitted.segments, &residuals), n, far);
    // A correlation whose end is not seen within segments continues in the next ones.
    let longest = fitted.segments.iter().map(|segment| segment.samples).max().unwrap_or(0);
    let window = |of: &Correlation| if 4 * of.length >= longest { 4 * longest } else { 2 * of.length };
    let lags = follow.iter().filter(|of| !is_white(of)).map(window).max();
    let agreement = agreement(problem, &fitted.x, &fitted.segments, weighing);
    let segment_seconds = usual_samples(&fitted.segments) as f64 * problem.course.step;
    let continuation = (continuation(problem, fitted, weighing), segment_seconds);
    let (normal, inflation) = informed(problem, fitted, (weighing, lags), known);
    let verdict = Evidence {
        converged: fitted.normal.converged,
        sizes: (0..n).map(size).collect(),
        exact: (0..n).map(|i| EXACT_RESIDUAL * problem.spread[i]).collect(),
        residuals: &by_coordinate,
        probabilities: follow.iter().map(|of| (of.probability * n as f64).min(1.0)).collect(),
        outliers: outlier_count as f64 / numbers,
        agreement,
        continuation,
    }
    .verdict();
    Identified {
        converged: fitted.normal.converged,
        decrement: fitted.normal.decrement,
        explained: verdict.explains(),
        verdict,
        over_noise: over_noise(&by_coordinate),
        residuals: by_coordinate,
        outliers,
        outlier_count,
        paths: paths(problem, &fitted.segments, &residuals),
        inflation,
        force_noise: problem.disturbances.force.clone(),
        samples: fitted.segments.iter().map(|segment| segment.samples).sum(),
        segments: fitted.segments.len(),
        segment_seconds,
        substeps: fitted.substeps,
        between: (instance.has_inputs() || recording.tracks.iter().any(|track| !track.force.is_empty()))
            .then_some(problem.course.between),
        ..unknowns(
            instance,
            problem,
            // A constant at its bound counts as given.
            &Fitted { normal: normal.with_held(), ..fitted.clone() },
            (start, 1.0),
            (Met::Accelerations, &normal_at),
        )
    }
}

/// Positions of the segments and their residuals, in SI; `residuals` are in units of the noise.
fn paths(problem: &Problem<'_>, segments: &[Segment], residuals: &[Vec<f64>]) -> Vec<ResidualPath> {
    let of = |(segment, residuals): (&Segment, &Vec<f64>)| {
        let noise = |sample: usize, i: usize| problem.sigma_at(segment.track, sample, i);
        ResidualPath::of(problem.course.recording, segment, residuals, noise)
    };
    segments.iter().zip(residuals).map(of).collect()
}

/// Normal equations whose covariance is that of the residuals, and the factor by which correlated residuals increase variances. Correlated
/// residuals have `lags`; with `given` noise, residuals count as at least that large.
fn informed(
    problem: &Problem<'_>,
    fitted: &Fitted,
    (weighing, lags): (Weighing, Option<usize>),
    given: bool,
) -> (Normal, f64) {
    let m = fitted.x.len();
    let root = Root::of(m, &fitted.normal.matrix);
    let bread = weighing.bread * weighing.bread;
    let plain = weighing.square * bread;
    let least = if given { plain.max(1.0) } else { plain.max(f64::MIN_POSITIVE) };
    let Some(lags) = lags else {
        let unit = vec![0.0; root.forward.len().pow(2)];
        return (root.informed(&fitted.normal, &unit, least), 1.0);
    };
    let scores = scores(problem, &fitted.x, &fitted.segments);
    let [wide, narrow] = [lags, lags / 2].map(|lags| long_run(&scores, &fitted.segments, m, lags));
    // A kernel that is 1 over the first half of the lags, where correlated noise gets its full weight (Politis and Romano, J. Time Series
    // Analysis 16 (1995) 67).
    let flat: Vec<f64> = wide.iter().zip(&narrow).map(|(wide, narrow)| 2.0 * wide - narrow).collect();
    let mut seen = root.seen(m, &flat);
    seen.iter_mut().for_each(|x| *x *= bread);
    let mean = mean_eigenvalue(&seen, root.forward.len());
    let inflation = (mean / plain).max(1.0);
    // Initial states and constants use up as many of a few independent numbers as of many: correlated residuals fall below the noise by more
    // than independent ones.
    let numbers = problem.readings(&fitted.segments);
    let taken = (numbers - fitted.normal.count + m as f64) / numbers;
    let hidden = (1.0 - taken) / (1.0 - taken * inflation).max(LEAST_FREEDOM);
    seen.iter_mut().for_each(|x| *x *= hidden);
    (root.informed(&fitted.normal, &seen, least), inflation * hidden)
}
