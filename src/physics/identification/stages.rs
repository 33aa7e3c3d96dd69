//! The stages of identification: fits to smoothed accelerations, then to longer and longer segments of the motion.

use super::by_trajectory::by_trajectory;
use super::choices::{check_errors, chosen, fitted_quantity, inputs, missing, sensors};
use super::driven::DrivenEquations;
use super::first_fit::first_fit;
use super::fitted::{Fitted, refit};
use super::found::Identified;
use super::initial_states::SEARCHED;
use super::innovations::Disturbances;
use super::interpolations::{Rivals, best_interpolation};
use super::measured::{Measured, check_columns};
use super::motion_result::result;
use super::per_trajectory::per_trajectory;
use super::pieces::Pieces;
use super::residual_noise::update_noise;
use super::segments::{joined, lengthened, shortened};
use super::smoothed::{Quantity, States};
use super::solve::{Problem, Sensor};
use super::steps::{choose_steps, refine_steps};
use super::thresholds::{EQUAL_SQUARES, ITERATIONS, LAST_ITERATIONS, LEAST_NOISE, START_ROUNDS};
use super::{Between, IdentifyError, IdentifyOptions, Verdict, by_forces};
use crate::lagrangian::system::Range;
use crate::lagrangian::{Equations, SystemInstance};
use crate::names::rounded;
use crate::recording::{Filled, Recording, deviation, filled, rms};
use std::f64::consts::TAU;

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
    let driven = DrivenEquations {
        recording,
        equations: &equations,
        chosen: chosen.len(),
        between: options.between.unwrap_or(Between::Linear),
        inputs,
        step: pieces.step,
        substeps: 1,
    };
    let problem = setup.problem(driven, (chosen, sensors), measured.as_ref());
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
        driven: DrivenEquations<'a>,
        (chosen, sensors): (Vec<usize>, Vec<Sensor>),
        measured: Option<&'a Measured>,
    ) -> Problem<'a> {
        let Self { instance, options, pieces, spread, .. } = *self;
        Problem {
            driven,
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
        let of_piece = |track: usize| problem.driven.inputs.get(pieces.origin(track, 0).0).copied();
        let inputs = (0..pieces.long.tracks.len()).filter_map(of_piece).collect();
        let driven = DrivenEquations { recording: &pieces.long, inputs, ..problem.driven.clone() };
        Problem { driven, missing: &[], ..problem.clone() }
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
        if problem.driven.equations.rows.is_some() {
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
            problem.fit_starts(&fitted.x, &mut longer, START_ROUNDS);
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
