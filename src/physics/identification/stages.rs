//! From smoothed accelerations to longer and longer segments of motion.

use super::covariance::{Root, Weighing, agreement, long_run, scores};
use super::follow::{Course, Segment};
use super::found::{Identified, Outlier, Residual};
use super::innovations::Disturbances;
use super::quality::{
    CHANCE, Correlation, EXPLAINED, Evidence, correlation, innovations, mean_eigenvalue, outliers, over_noise, usual,
};
use super::smoothed::{Met, States};
use super::solve::{Normal, Problem, Sensor, SensorKind};
use super::unknowns::unknowns;
use super::{Between, IdentifyError, IdentifyOptions, by_forces};
use crate::lagrangian::{Equations, SystemInstance};
use crate::names::rounded;
use crate::recording::smooth::{SmoothOptions, Smoothed, Smoothing};
use crate::recording::{Recording, Targets, deviation, rms};

/// Samples in a row that are needed.
const LEAST_SAMPLES: usize = 12;
/// Samples of the first, short segments at least.
const LEAST_SEGMENT: usize = 6;
/// Times in which the motion changes that a first segment lasts.
const PACES: f64 = 2.5;
/// Samples that are followed at most.
const MOST_SAMPLES: usize = 60_000;
/// Noise over the spread of a coordinate that is taken at least: the equations are integrated so well.
const LEAST_NOISE: f64 = 1e-9;
/// Error of the integrator over the noise.
const INTEGRATOR: f64 = 0.05;
const MOST_SUBSTEPS: usize = 64;
/// Longer segments may be met worse by this factor of the mean square.
const WORSE: f64 = 1.5;
/// Decrease of the mean logarithm of the errors that longer segments must bring.
const GAIN: f64 = 0.01;
/// Segments from which on their scatter tells how far errors are to be widened.
const MANY: usize = 8;
/// Residual over the spread of a coordinate up to which it is that of the integration, a few times [`LEAST_NOISE`].
const EXACT: f64 = 5.0 * LEAST_NOISE;
const ITERATIONS: usize = 40;

/// Constants, sensors and starts with the normal equations there.
#[derive(Clone)]
pub(super) struct Fitted {
    pub x: Vec<f64>,
    pub segments: Vec<Segment>,
    pub normal: Normal,
    pub substeps: usize,
}

impl Fitted {
    /// Mean square of the residuals.
    fn mean_square(&self) -> f64 {
        self.normal.square / self.normal.count.max(1.0)
    }

    /// Variance of the unknowns over that of independent noise of the given size: the mean square of the residuals, or what the
    /// scatter of the segments' pulls says if they are alike all along a segment. The second number is the part of the latter.
    pub fn inflation(&self) -> (f64, f64) {
        let square = self.mean_square();
        let (m, count) = (self.x.len(), self.normal.parts.len());
        if count < MANY {
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
        let plain = scatter <= 1.0 + 2.0 * (2.0 / count as f64).sqrt();
        if plain { (square, 1.0) } else { (square * scatter, scatter) }
    }

    /// Mean logarithm of the errors of the unknowns, each with the others fixed.
    fn spread(&self) -> f64 {
        let m = self.x.len();
        let logarithms = (0..m).map(|k| self.normal.matrix[k * m + k]).filter(|x| *x > 0.0).map(f64::ln);
        let (sum, count) = logarithms.fold((0.0, 0.0), |(sum, count), x| (sum + x, count + 1.0));
        (self.inflation().0.ln() - sum / f64::max(count, 1.0)) / 2.0
    }
}

/// Identifies the constants of a system from recorded motion; angles are unwrapped, numbers are in the units of the system.
///
/// # Errors
/// [`IdentifyError`] for options and recordings that do not fit the system, motion that is too short, and systems under constraints.
/// Constants that the motion leaves open are no error, nor is a form that does not explain the motion: the result says so.
pub fn identify(
    instance: &SystemInstance<f64>,
    recording: &Recording,
    options: &IdentifyOptions,
) -> Result<Identified, IdentifyError> {
    let n = instance.coordinates;
    if recording.n() != n {
        return Err(IdentifyError::Coordinates { expected: n, found: recording.n() });
    }
    recording.tracks.iter().try_for_each(|track| track.validate(n))?;
    let chosen = chosen(instance, options)?;
    let sensors = sensors(recording, options)?;
    let met = met(instance, recording, options)?;
    let stop = &options.cancellation;
    stop.stage("equations of motion");
    let constrained = || IdentifyError::Constrained { system: instance.system.name.to_string() };
    let equations = Equations::record(instance, &chosen)?.ok_or_else(constrained)?;
    let longest = recording.tracks.iter().map(|track| track.len()).max().unwrap_or(0);
    if longest < LEAST_SAMPLES {
        return Err(IdentifyError::Short { found: longest, needed: LEAST_SAMPLES });
    }
    stop.check()?;
    stop.stage("smoothed motion");
    let smoothing =
        Smoothing::choose(recording, &SmoothOptions { noise: options.noise.clone(), ..SmoothOptions::default() })?;
    let smooth = |track: &crate::recording::RecordedTrajectory| {
        (track.len() >= LEAST_SAMPLES).then(|| smoothing.apply(track)).transpose()
    };
    let smoothed = recording.tracks.iter().map(smooth).collect::<Result<Vec<_>, _>>()?;
    let spread: Vec<f64> = (0..n).map(|i| spread_of(recording, i)).collect();
    let noise: Vec<f64> = (0..n).map(|i| smoothing.coordinates[i].noise.sigma.max(LEAST_NOISE * spread[i])).collect();
    let forced = recording.tracks.iter().any(|track| !track.force.is_empty());
    let course = Course {
        recording,
        equations: &equations,
        chosen: chosen.len(),
        between: options.between.unwrap_or(Between::Linear),
        step: smoothing.step,
        substeps: 1,
    };
    let start: Vec<f64> = chosen.iter().map(|&k| instance.parameters[k]).collect();
    let mut x: Vec<f64> = start.iter().copied().chain(sensors.iter().map(|sensor| sensor.perfect())).collect();
    let mut problem = Problem {
        course,
        values: instance.parameters.clone(),
        ranges: instance.system.parameters.iter().map(|parameter| parameter.range).collect(),
        chosen,
        sensors,
        sigma: noise.clone(),
        sigma_of: Vec::new(),
        spread,
        robust: options.robust,
        disturbances: Disturbances::default(),
        threads: options.threads.max(1),
        cancellation: options.cancellation.clone(),
    };

    stop.check()?;
    let mut states = States::new(&problem, &smoothed);
    if met == Met::Forces {
        let segments = cut(recording, &smoothed, LEAST_SEGMENT, n);
        stop.stage("forces");
        return by_forces::identify(instance, &problem, (&smoothing, &mut states), (x, segments));
    }
    if states.len(n) > 0 && !states.fit(&problem, &mut x, met) {
        return Err(IdentifyError::Singular);
    }
    tracing::debug!(?x, states = states.len(n), "smoothed accelerations");
    let samples = first_samples(&states, (n, smoothing.step), options.segment)?;
    let segments = cut(recording, &smoothed, samples, n);
    stop.stage("short segments");
    let mut fitted = first(&mut problem, x, segments)?;
    if options.segment.is_none() {
        fitted = shortened(&problem, fitted);
    }
    if forced && options.between.is_none() {
        fitted = best_between(&mut problem, fitted);
    }
    if forced && problem.estimate_force_noise(&fitted.x, &fitted.segments) {
        refit(&problem, &mut fitted);
    }
    if options.noise.is_none() {
        weigh(&mut problem, &fitted);
        choose_steps(&mut problem, &fitted.x, &fitted.segments);
        refit(&problem, &mut fitted);
    }
    stop.stage("longer segments");
    fitted = grown(&mut problem, fitted, options.segment);
    if forced {
        problem.estimate_force_noise(&fitted.x, &fitted.segments);
    }
    if options.noise.is_none() {
        weigh(&mut problem, &fitted);
        choose_steps(&mut problem, &fitted.x, &fitted.segments);
    }
    refit(&problem, &mut fitted);
    stop.check()?;
    stop.stage("what is determined");
    let found = result(instance, &problem, &fitted, (&start, &noise), options);
    stop.check()?;
    Ok(found)
}

/// What is met.
fn met(instance: &SystemInstance<f64>, recording: &Recording, options: &IdentifyOptions) -> Result<Met, IdentifyError> {
    let driven = recording.is_driven();
    // A joint that nothing drives has a known force of 0.
    let mut forces = recording.tracks.iter().flat_map(|track| &track.force);
    let pushed = recording.tracks.iter().all(|track| !track.force.is_empty()) && forces.any(|force| *force != 0.0);
    // Both belong to motion that is followed.
    let follows = options.segment.is_some()
        || [&options.offsets, &options.gains, &options.delays].iter().any(|names| !names.is_empty());
    let refused = |expected: &str, found: &str| {
        let (expected, found) = (expected.to_string(), found.to_string());
        Err(IdentifyError::Option { what: "targets", expected, found })
    };
    match options.targets {
        Some(Targets::Motion) => Ok(Met::Accelerations),
        Some(Targets::Forces) if !pushed => refused("motion, of a recording without known forces", "forces"),
        Some(Targets::Forces) if follows => {
            refused("motion, beside unknown constants of sensors or a length of segments", "forces")
        }
        Some(Targets::Forces) => Ok(Met::Forces),
        Some(Targets::Measured) => refused("motion or forces", "measured"),
        Some(Targets::Smoothed) => refused("motion or forces", "smoothed"),
        None if instance.system.is_chain() && driven && !follows => Ok(Met::Forces),
        None => Ok(Met::Accelerations),
    }
}

/// Parameters that are unknown.
fn chosen(instance: &SystemInstance<f64>, options: &IdentifyOptions) -> Result<Vec<usize>, IdentifyError> {
    let parameters = &instance.system.parameters;
    let mut chosen = Vec::new();
    for symbol in &options.constants {
        let known = || parameters.iter().map(|parameter| parameter.symbol.to_string()).collect();
        let found = parameters.iter().position(|parameter| parameter.symbol == *symbol);
        let at = found.ok_or_else(|| IdentifyError::Constant { symbol: symbol.clone(), known: known() })?;
        if chosen.contains(&at) {
            return Err(IdentifyError::Repeated { what: "constants", name: symbol.clone() });
        }
        chosen.push(at);
    }
    if chosen.is_empty() {
        let learned: Vec<usize> = (0..parameters.len()).filter(|&k| parameters[k].learn).collect();
        chosen = if learned.is_empty() { (0..parameters.len()).collect() } else { learned };
    }
    chosen.sort_unstable();
    match chosen.is_empty() {
        true => Err(IdentifyError::Nothing { system: instance.system.name.to_string() }),
        false => Ok(chosen),
    }
}

/// Sensors with unknown constants.
fn sensors(recording: &Recording, options: &IdentifyOptions) -> Result<Vec<Sensor>, IdentifyError> {
    let mut sensors = Vec::new();
    let all = [
        ("offsets", SensorKind::Offset, &options.offsets),
        ("gains", SensorKind::Gain, &options.gains),
        ("delays", SensorKind::Delay, &options.delays),
    ];
    for (what, kind, names) in all {
        for name in names {
            let missing = || IdentifyError::Sensor { what, name: name.clone(), known: recording.coordinates.clone() };
            let coordinate = recording.coordinates.iter().position(|known| known == name).ok_or_else(missing)?;
            let sensor = Sensor { kind, coordinate };
            if sensors.contains(&sensor) {
                return Err(IdentifyError::Repeated { what, name: name.clone() });
            }
            sensors.push(sensor);
        }
    }
    Ok(sensors)
}

/// Standard deviation of a coordinate over all samples; 1 for one that rests.
pub(crate) fn spread_of(recording: &Recording, i: usize) -> f64 {
    let n = recording.n();
    let spread = deviation(recording.tracks.iter().flat_map(|track| track.q.iter().skip(i).step_by(n)));
    if spread > 0.0 { spread } else { 1.0 }
}

/// Samples of the first segments: some of the times in which the fastest coordinate changes, or as many as are wanted if these are fewer.
fn first_samples(states: &States, (n, step): (usize, f64), wanted: Option<f64>) -> Result<usize, IdentifyError> {
    let size = |values: &[f64], i: usize| deviation(values.iter().skip(i).step_by(n));
    let paces = (0..n).map(|i| size(&states.v, i) / size(&states.a, i)).filter(|pace| pace.is_finite() && *pace > 0.0);
    let pace = paces.fold(f64::INFINITY, f64::min);
    let samples = if pace.is_finite() { PACES * pace / step } else { 20.0 };
    let samples = samples.clamp(LEAST_SEGMENT as f64, 400.0) as usize;
    let Some(seconds) = wanted else { return Ok(samples) };
    let wanted = (seconds / step).round() as usize;
    if wanted < LEAST_SEGMENT {
        let expected = format!("at least {LEAST_SEGMENT} samples, {} s", rounded(LEAST_SEGMENT as f64 * step, 3));
        return Err(IdentifyError::Option { what: "segment", expected, found: format!("{seconds} s") });
    }
    Ok(samples.min(wanted))
}

/// Segments of about so many samples that start where smoothing says.
fn cut(recording: &Recording, smoothed: &[Option<Smoothed>], samples: usize, n: usize) -> Vec<Segment> {
    let mut segments = Vec::new();
    for (track, (recorded, smoothed)) in recording.tracks.iter().zip(smoothed).enumerate() {
        let Some(smoothed) = smoothed else { continue };
        let length = recorded.len();
        let count = ((length + samples / 2) / samples).max(1);
        for k in 0..count {
            let (first, end) = (k * length / count, (k + 1) * length / count);
            let [q, v] = [&smoothed.q, &smoothed.v].map(|values| &values[first * n..(first + 1) * n]);
            segments.push(Segment { track, first, samples: end - first, start: [q, v].concat() });
        }
    }
    thinned(segments)
}

/// Segments of as many samples as are followed: runs of segments that follow each other, so that they can be joined later.
pub(crate) fn thinned(segments: Vec<Segment>) -> Vec<Segment> {
    const RUN: usize = 16;
    let all: usize = segments.iter().map(|segment| segment.samples).sum();
    if all <= MOST_SAMPLES {
        return segments;
    }
    let runs = segments.len().div_ceil(RUN);
    let kept = (runs * MOST_SAMPLES / all).max(1);
    let keep = |at: usize| (at / RUN + 1) * kept / runs > at / RUN * kept / runs;
    segments.into_iter().enumerate().filter(|(at, _)| keep(*at)).map(|(_, segment)| segment).collect()
}

/// The fit of the first segments; those that cannot be followed are left out.
fn first(problem: &mut Problem<'_>, x: Vec<f64>, mut segments: Vec<Segment>) -> Result<Fitted, IdentifyError> {
    choose_steps(problem, &x, &segments);
    let followed = problem.all(&x, &segments);
    problem.cancellation.check()?;
    let mut kept = followed.iter().map(Option::is_some);
    segments.retain(|_| kept.next().unwrap_or(false));
    if segments.is_empty() {
        return Err(IdentifyError::Lost);
    }
    problem.settle(&x, &mut segments, 6);
    let mut x = x;
    let normal = problem.fit(&mut x, &mut segments, ITERATIONS);
    let mut fitted = Fitted { x, segments, normal, substeps: problem.course.substeps };
    if choose_steps(problem, &fitted.x, &fitted.segments) {
        refit(problem, &mut fitted);
    }
    log(&fitted, "first");
    Ok(fitted)
}

fn refit(problem: &Problem<'_>, fitted: &mut Fitted) {
    fitted.substeps = problem.course.substeps;
    fitted.normal = problem.fit(&mut fitted.x, &mut fitted.segments, ITERATIONS);
}

fn log(fitted: &Fitted, what: &str) {
    let (x, samples) = (&fitted.x, fitted.segments.first().map_or(0, |segment| segment.samples));
    let (square, spread) = (fitted.mean_square(), fitted.spread());
    let (segments, substeps) = (fitted.segments.len(), fitted.substeps);
    tracing::debug!(?x, samples, segments, substeps, square, spread, failed = fitted.normal.failed, "{what}");
}

/// As many integration steps from sample to sample as keep the integrator's error below a part of the noise; `true` if that changes
/// their number.
pub(crate) fn choose_steps(problem: &mut Problem<'_>, x: &[f64], segments: &[Segment]) -> bool {
    let before = problem.course.substeps;
    let stride = segments.len().div_ceil(32).max(1);
    let mut probes: Vec<&Segment> = segments.iter().step_by(stride).collect();
    probes.sort_by_key(|segment| std::cmp::Reverse(segment.samples));
    let n = problem.sigma.len();
    let mut coarse = problem.ends(x, &probes);
    while problem.course.substeps < MOST_SUBSTEPS && problem.cancellation.go_on() {
        let mut finer = problem.clone();
        finer.course.substeps *= 2;
        let fine = finer.ends(x, &probes);
        let errors = coarse.iter().zip(&fine).flat_map(|(a, b)| {
            (0..n).map(|i| ((a[i] - b[i]) / problem.sigma[i]).abs()).filter(|e| e.is_finite()).collect::<Vec<_>>()
        });
        let mut errors: Vec<f64> = errors.collect();
        errors.sort_by(f64::total_cmp);
        if errors.get(errors.len() * 9 / 10).is_none_or(|worst| *worst < INTEGRATOR) {
            break;
        }
        (problem.course.substeps, coarse) = (finer.course.substeps, fine);
    }
    problem.course.substeps != before
}

/// The way between the samples of known forces that meets the motion best.
fn best_between(problem: &mut Problem<'_>, fitted: Fitted) -> Fitted {
    let mut best = (problem.course.between, fitted);
    for between in [Between::Held, Between::Cubic, Between::BandLimited] {
        problem.course.between = between;
        let mut tried = best.1.clone();
        problem.settle(&tried.x, &mut tried.segments, 3);
        refit(problem, &mut tried);
        tracing::debug!(?between, square = tried.mean_square(), "forces");
        if tried.normal.square < best.1.normal.square {
            best = (between, tried);
        }
    }
    problem.course.between = best.0;
    best.1
}

/// Weighs coordinates by the residuals that are left.
fn weigh(problem: &mut Problem<'_>, fitted: &Fitted) {
    let n = problem.sigma.len();
    let residuals = problem.all_residuals(&fitted.x, &fitted.segments);
    let taken = fitted.normal.count / residuals.iter().map(|r| r.len() as f64).sum::<f64>();
    for i in 0..n {
        let own = || residuals.iter().flat_map(|segment| segment.iter().skip(i).step_by(n)).filter(|r| r.is_finite());
        let square = own().map(|r| r * r).sum::<f64>() / own().count().max(1) as f64 / taken;
        if problem.robust {
            // The median of the size of normal numbers is 0.6745 of their deviation.
            let mut sizes: Vec<f64> = own().map(|r| r.abs()).collect();
            sizes.sort_by(f64::total_cmp);
            let usual = sizes.get(sizes.len() / 2).copied().unwrap_or(0.0) / 0.6745;
            problem.sigma[i] *= f64::max(usual / taken.sqrt(), 1e-3);
        } else {
            problem.sigma[i] *= f64::max(square.sqrt(), 1e-3);
        }
        problem.sigma[i] = problem.sigma[i].max(LEAST_NOISE * problem.spread[i]);
    }
}

/// Pairs of segments that follow each other as one.
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

/// Both halves of every segment that is long enough, each with a start where the motion passes.
fn halved(problem: &Problem<'_>, fitted: &Fitted) -> Vec<Segment> {
    let long = |segment: &&Segment| segment.samples >= 2 * LEAST_SEGMENT;
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

/// Shorter segments of a form that misses the motion, as long as constants become better known by them: what is missing adds up along a
/// segment.
fn shortened(problem: &Problem<'_>, mut fitted: Fitted) -> Fitted {
    while fitted.mean_square() > EXPLAINED * EXPLAINED && !problem.cancellation.is_cancelled() {
        let segments = halved(problem, &fitted);
        if segments.len() == fitted.segments.len() {
            break;
        }
        let mut shorter = Fitted { segments, ..fitted.clone() };
        problem.settle(&shorter.x, &mut shorter.segments, 3);
        refit(problem, &mut shorter);
        log(&shorter, "shorter");
        if shorter.normal.failed > 0 || shorter.spread() > fitted.spread() - GAIN {
            break;
        }
        fitted = shorter;
    }
    fitted
}

/// Longer and longer segments, as long as constants become better known by them.
fn grown(problem: &mut Problem<'_>, mut fitted: Fitted, wanted: Option<f64>) -> Fitted {
    let seconds = |segments: &[Segment]| usual_samples(segments) as f64 * problem.course.step;
    let mut wanted_more = wanted.map(|wanted| seconds(&fitted.segments) * 1.5 < wanted);
    while wanted_more != Some(false) && !problem.cancellation.is_cancelled() {
        let segments = joined(&fitted.segments);
        if segments.len() == fitted.segments.len() {
            break;
        }
        let mut longer = Fitted { segments, ..fitted.clone() };
        choose_steps(problem, &longer.x, &longer.segments);
        problem.settle(&longer.x, &mut longer.segments, 6);
        refit(problem, &mut longer);
        log(&longer, "longer");
        let met = longer.normal.failed == 0 && longer.mean_square() < WORSE * fitted.mean_square();
        if wanted.is_none() && !(met && longer.spread() < fitted.spread() - GAIN) {
            problem.course.substeps = fitted.substeps;
            break;
        }
        fitted = longer;
        let seconds = usual_samples(&fitted.segments) as f64 * problem.course.step;
        wanted_more = wanted.map(|wanted| seconds * 1.5 < wanted);
    }
    fitted
}

/// Samples of the usual segment.
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
    options: &IdentifyOptions,
) -> Identified {
    let n = problem.sigma.len();
    let recording = problem.course.recording;
    let normal_at = |x: &[f64]| Some(problem.normal_at(x, &fitted.segments));
    let residuals = problem.all_residuals(&fitted.x, &fitted.segments);
    let numbers: f64 = residuals.iter().map(|r| r.len() as f64).sum();
    let taken = (fitted.normal.count - fitted.x.len() as f64).max(1.0) / numbers;
    let weighing = Weighing::of(&residuals, problem.robust, taken);
    let follow: Vec<Correlation> =
        innovations(problem, &fitted.x, &fitted.segments).iter().map(|runs| correlation(runs)).collect();
    let is_white = |of: &Correlation| of.probability * n as f64 >= CHANCE;
    // Samples that stand out do not excuse the others.
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
        time: recording.tracks[track].times[sample],
        coordinate: recording.coordinates[i].clone(),
        size,
    };
    let (outliers, outlier_count) = outliers((&fitted.segments, &residuals), n, far);
    let lags = follow.iter().filter(|of| !is_white(of)).map(|of| 2 * of.length).max();
    let agreement = agreement(problem, &fitted.x, &fitted.segments, weighing);
    let (normal, inflation) = informed(problem, fitted, (weighing, lags), options.noise.is_some());
    let verdict = Evidence {
        converged: true,
        sizes: (0..n).map(size).collect(),
        exact: (0..n).map(|i| EXACT * problem.spread[i]).collect(),
        residuals: &by_coordinate,
        probabilities: follow.iter().map(|of| (of.probability * n as f64).min(1.0)).collect(),
        outliers: outlier_count as f64 / numbers,
        agreement,
    }
    .verdict();
    Identified {
        explained: verdict.explains(),
        verdict,
        over_noise: over_noise(&by_coordinate),
        residuals: by_coordinate,
        outliers,
        outlier_count,
        inflation,
        force_noise: problem.disturbances.force.clone(),
        samples: fitted.segments.iter().map(|segment| segment.samples).sum(),
        segments: fitted.segments.len(),
        segment_seconds: usual_samples(&fitted.segments) as f64 * problem.course.step,
        substeps: fitted.substeps,
        between: recording.tracks.iter().any(|track| !track.force.is_empty()).then_some(problem.course.between),
        ..unknowns(
            instance,
            problem,
            &Fitted { normal, ..fitted.clone() },
            (start, 1.0),
            (Met::Accelerations, &normal_at),
        )
    }
}

/// The normal equations that know the unknowns as well as the residuals say, and the factor of variances by which correlated residuals
/// know less than independent ones. Correlated ones have `lags`; with `given` noise residuals count as large as that at least.
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
    let mut seen = root.seen(m, &long_run(&scores, &fitted.segments, m, lags));
    seen.iter_mut().for_each(|x| *x *= bread);
    let mean = mean_eigenvalue(&seen, root.forward.len());
    (root.informed(&fitted.normal, &seen, least), (mean / plain).max(1.0))
}
