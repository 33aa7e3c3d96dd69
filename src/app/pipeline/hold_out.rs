//! Tests a model of recorded motion: predictions of held-out motion, and the energy balance.

use crate::analysis::{
    PredictionError, Predictions, ValidTimes, Window, coordinate_errors, predict_by_constant_velocity,
    prediction_error, spread, window_valid_times,
};
use crate::data::{Split, StateEstimate};
use crate::findings::Findings;
use crate::lagrangian::{EulerLagrange, ReducedMass, Request, Terms, project};
use crate::linalg::{SignatureBuffers, has_signature};
use crate::names::number;
use crate::pipeline::constraint_figures::constraint_figures;
use crate::pipeline::energy::{Balance, balance, energy_figure};
use crate::pipeline::force_errors::ForceError;
use crate::pipeline::judging::Judging;
use crate::pipeline::prediction::HeldOutPredictions;
use crate::pipeline::thresholds::{
    BETTER_THAN_CONSTANT_VELOCITY, CURVE_TIMES, MOST_WINDOWS, SAMPLES_AHEAD, SIGNATURE_STATES, STATES_AT_ONCE,
    TABLE_TIMES,
};
use crate::pipeline::{PipelineError, Watch};
use crate::recording::{Recording, Smoothed};
use crate::report::{Figure, LinePlot, Polar, Series, Turn, figure, line_plot, median_of, trace_plot, with_unit};
use crate::rollout::SampledForce;
use serde::Serialize;
use std::f64::consts::TAU;
use std::slice;

/// Held-out motion and the settings of the test.
#[derive(Clone, Copy, Debug)]
pub struct HoldOutOptions<'a> {
    /// The held-out motion.
    pub part: &'a Split,
    /// Prediction horizon in s. By default 200 samples, or one period of the fastest motion if that is longer, but at most a quarter of the
    /// shortest trajectory, ignoring pieces much shorter than the others.
    pub horizon: Option<f64>,
    /// The time-like coordinate, if there is one.
    pub time: Option<usize>,
    /// Names of the known forces, if there are any.
    pub forces: &'a [String],
    /// Units of the coordinates, for pictures.
    pub units: &'a [String],
    /// Number of threads.
    pub threads: usize,
}

/// Time ahead up to which a prediction is useful: valid, and better than continuing at constant velocity.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct UsefulTime {
    /// The time in s; 0 for a prediction that is never useful.
    pub seconds: f64,
    /// `true` if it is useful to the end of the windows, so that the time is a lower bound.
    pub at_least: bool,
}

/// Errors of one coordinate by time ahead, medians over the windows, in its own unit.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CoordinatePredictions {
    /// Name of the coordinate.
    pub name: String,
    /// Its unit: `rad` for an angle, otherwise `SI`.
    pub unit: &'static str,
    /// Errors of the model's motion.
    pub model: Vec<f64>,
    /// Errors of continuing at constant velocity.
    pub constant_velocity: Vec<f64>,
}

/// Predictions of held-out motion, compared with motion at constant velocity.
#[derive(Clone, Debug, Serialize)]
pub struct HoldOut {
    /// Unit of the errors over all coordinates: `rad` for angles, `SI` for others; if there are both kinds, each error is divided by the
    /// spread of its coordinate's motion.
    pub error_unit: &'static str,
    /// Errors of the model's motion, by time ahead.
    pub model: Vec<PredictionError>,
    /// Median time, over the windows, for which the model's motion predicts the measured one; a lower bound if the error remains small to
    /// the end of a window. `None` without windows.
    pub(crate) valid_time: Option<ValidTimes>,
    /// Time for which the model's motion is useful. `None` without windows.
    pub useful_time: Option<UsefulTime>,
    /// Period of the fastest coordinate in s, `2 pi` times the spread of its velocity over that of its acceleration; none if the motion
    /// takes longer than the trajectories, or is noise.
    pub fastest_period: Option<f64>,
    /// Errors of every coordinate at the same times ahead.
    pub by_coordinate: Vec<CoordinatePredictions>,
    /// Number of failed predictions and the reasons, in words; empty if all succeeded.
    pub given_up: String,
    /// Errors of continuing at the velocity of the start.
    pub constant_velocity: Vec<PredictionError>,
    /// Fraction of the held-out states whose mass matrix has a wrong signature; `NaN` if nothing was held out.
    pub wrong_signature: f64,
    /// Energy balance of the held-out trajectories; `None` if the model gives no finite energy.
    pub(crate) energy: Option<Balance>,
    /// Errors of the known forces of a model that was trained on them.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub force_errors: Vec<ForceError>,
    /// Pictures.
    #[serde(skip)]
    pub figures: Vec<Figure>,
    /// The predictions.
    #[serde(skip)]
    pub(crate) predicted: HeldOutPredictions,
    /// Which coordinates are angles, and the scales of the coordinates' errors.
    #[serde(skip)]
    pub(crate) error_scales: (Vec<bool>, Vec<f64>),
}

/// Predicts held-out motion in up to 500 windows and compares it with the measurements.
///
/// # Errors
/// [`PipelineError::Interrupted`].
pub fn evaluate_hold_out(
    model: &dyn EulerLagrange<f64>,
    options: &HoldOutOptions<'_>,
    watch: &Watch,
) -> Result<HoldOut, PipelineError> {
    let (judging, part) = (&Judging::new(watch, MOST_WINDOWS), options.part);
    let recording = &part.recording;
    if recording.tracks.is_empty() {
        return Ok(HoldOut::nothing());
    }
    let period = fastest_period(part);
    let horizon = options.horizon.unwrap_or_else(|| horizon(part, period));
    let windows = windows(model, part, horizon);
    let watched = judging.watched(model);
    let model: &dyn EulerLagrange<f64> = &watched;
    let predicted = HeldOutPredictions::new(model, windows, options.threads, judging)?;
    let measures = ErrorMeasures::of(part, horizon);
    let (windows, motion) = (&predicted.windows, &predicted.predictions);
    let straight = predict_by_constant_velocity(windows);
    let valid = window_valid_times(windows, motion, &recording.periodic, &measures.spread);
    let valid_time = ValidTimes::of(&valid.into_iter().map(|valid| (valid, None)).collect::<Vec<_>>());
    let mut figures = Vec::new();
    let mut useful_time = None;
    if !windows.is_empty() {
        figures = example_figures(options, &predicted, (&measures.scales, horizon));
        let errors = |predictions| measures.errors(windows, predictions, CURVE_TIMES);
        let curves = [("model", errors(motion)), ("constant velocity", errors(&straight))];
        useful_time = valid_time.as_ref().map(|valid| UsefulTime::new(valid, [&curves[0].1, &curves[1].1]));
        let (heading, drawn) =
            ("How the error of the prediction grows", line_plot(&error_plot(&curves, measures.unit)));
        figures.extend(figure("prediction_error.svg", heading, drawn, ERROR_CAPTION));
    }
    figures.extend(energy_figure(model, part));
    if let Some(window) = windows.first() {
        figures.extend(constraint_figures(model, (&window.q, &window.v), horizon, (&recording.coordinates, "s")));
    }
    let (wrong_signature, energy) = (wrong_signature(model, part, options.time), balance(model, part));
    judging.check()?;
    let table_times = if windows.is_empty() { 0 } else { TABLE_TIMES };
    let [model, constant_velocity] = [motion, &straight].map(|all| measures.errors(windows, all, table_times));
    let times: Vec<f64> = model.iter().map(|error| error.seconds).collect();
    Ok(HoldOut {
        error_unit: measures.unit,
        model,
        valid_time,
        useful_time,
        fastest_period: period,
        by_coordinate: measures.by_coordinate(windows, [motion, &straight], &times),
        constant_velocity,
        given_up: predicted.remarks(),
        wrong_signature,
        energy,
        force_errors: Vec::new(),
        figures,
        error_scales: (recording.periodic.clone(), measures.scales),
        predicted,
    })
}

/// Selects the windows to predict, whose starts satisfy the constraints of the model; if there are too many, they are thinned evenly.
fn windows(model: &dyn EulerLagrange<f64>, part: &Split, horizon: f64) -> Vec<Window> {
    let estimated = part.estimated();
    let of = |(estimate, states): (&StateEstimate<'_>, &Smoothed)| {
        let samples = states.interior().start..estimate.track.len();
        Window::unseen(*estimate, &states.reach, (samples, part.recording.n()), horizon)
    };
    let all: Vec<Window> = estimated.iter().zip(&part.states).flat_map(of).collect();
    let stride = all.len().div_ceil(MOST_WINDOWS).max(1);
    let mut windows: Vec<Window> = all.into_iter().step_by(stride).collect();
    if let Some(manifold) = model.manifold() {
        // No prediction is possible from a start that cannot be projected onto the constraints.
        for Window { q, v, .. } in &mut windows {
            let _ = project(manifold, q, v);
        }
    }
    windows
}

/// Scales and units of prediction errors.
struct ErrorMeasures<'a> {
    recording: &'a Recording,
    /// Longest prediction horizon.
    horizon: f64,
    /// Spread of the motion of every coordinate.
    spread: Vec<f64>,
    /// Units of the errors of single coordinates, and of all coordinates together.
    units: Vec<&'static str>,
    unit: &'static str,
    /// Divisors of the coordinates' errors before they are combined.
    scales: Vec<f64>,
}

impl<'a> ErrorMeasures<'a> {
    fn of(part: &'a Split, horizon: f64) -> Self {
        let recording = &part.recording;
        let positions: Vec<f64> = recording.tracks.iter().flat_map(|track| track.q.iter().copied()).collect();
        let spread = spread(&positions, &recording.periodic);
        let units: Vec<_> = recording.periodic.iter().map(|angle| if *angle { "rad" } else { "SI" }).collect();
        let (unit, scales) = match units.iter().any(|unit| *unit != units[0]) {
            true => ("of the spread of the motion", spread.clone()),
            false => (units[0], vec![1.0; recording.n()]),
        };
        Self { recording, horizon, spread, units, unit, scales }
    }

    /// Computes errors at `count` evenly spaced times ahead.
    fn errors(&self, windows: &[Window], predictions: &Predictions, count: usize) -> Vec<PredictionError> {
        let times = (1..=count).map(|k| self.horizon * k as f64 / count as f64);
        let measures = (&self.recording.periodic[..], &self.scales[..]);
        times.map(|t| prediction_error(windows, predictions, measures, t)).collect()
    }

    /// Computes errors of every coordinate at these times, for the model and for constant velocity.
    fn by_coordinate(
        &self,
        windows: &[Window],
        predictions: [&Predictions; 2],
        times: &[f64],
    ) -> Vec<CoordinatePredictions> {
        let [model, straight] = predictions.map(|all| -> Vec<Vec<f64>> {
            times.iter().map(|t| coordinate_errors(windows, all, &self.recording.periodic, *t)).collect()
        });
        let column = |errors: &[Vec<f64>], i: usize| errors.iter().map(|row| row[i]).collect();
        let coordinates = self.recording.coordinates.iter().zip(&self.units).enumerate();
        let of = |(i, (name, unit)): (usize, (&String, &&'static str))| {
            let (name, model, constant_velocity) = (name.clone(), column(&model, i), column(&straight, i));
            CoordinatePredictions { name, unit, model, constant_velocity }
        };
        coordinates.map(of).collect()
    }
}

const ERROR_CAPTION: &str = "Median over the held-out windows of the error of the predicted coordinates (root mean square over the coordinates), by \
                             time since the last sample that the start of the prediction has seen, beside going on at constant velocity.";
const FORCE_CAPTION: &str =
    "Known forces in the same held-out window; the prediction takes them as linear between the samples.";

/// Range of possible horizons: from the shortest time step to the longest trajectory.
pub(crate) fn horizons(part: &Split) -> Option<(f64, f64)> {
    let times = || part.states.iter().map(|states| &states.times[states.interior()]);
    let spans = times().filter_map(|times| Some(times.last()? - times.first()?)).filter(|span| *span > 0.0);
    let steps = times().flat_map(|times| times.windows(2).map(|pair| pair[1] - pair[0]));
    Some((steps.reduce(f64::min)?, spans.reduce(f64::max)?))
}

/// Period of the fastest coordinate ([`HoldOut::fastest_period`]).
fn fastest_period(part: &Split) -> Option<f64> {
    let n = part.recording.n();
    let longest = horizons(part)?.1;
    let of = |i: usize| {
        let column = |of: fn(&Smoothed) -> &[f64]| {
            part.states.iter().flat_map(move |states| states.interior().map(move |row| of(states)[row * n + i]))
        };
        let count = column(|states| &states.v).count() as f64;
        let square = |of: fn(&Smoothed) -> &[f64]| column(of).map(|x| x * x).sum::<f64>() / count;
        let mean = column(|states| &states.v).sum::<f64>() / count;
        let velocity = square(|states| &states.v) - mean * mean;
        let acceleration = square(|states| &states.a) - square(|states| &states.a_error);
        TAU * (velocity / acceleration).sqrt()
    };
    (0..n).map(of).filter(|period| *period <= longest).reduce(f64::min)
}

/// Default horizon: a quarter of the shortest long trajectory, but at most [`SAMPLES_AHEAD`] samples or one `period`. Trajectories count as
/// long from half the length above which half of the recorded time lies, so that pieces between gaps do not shorten the horizon of the
/// others.
fn horizon(part: &Split, period: Option<f64>) -> f64 {
    let times = part.states.iter().map(|states| &states.times[states.interior()]);
    let mut spans: Vec<(f64, usize)> =
        times.filter_map(|times| Some((times.last()? - times.first()?, times.len() - 1))).collect();
    spans.sort_by(|a, b| b.0.total_cmp(&a.0));
    let half = 0.5 * spans.iter().map(|(span, _)| span).sum::<f64>();
    let mut sum = 0.0;
    let usual = spans.iter().find(|(span, _)| {
        sum += span;
        sum >= half
    });
    let long = usual.map_or(0.0, |(span, _)| 0.5 * span);
    let horizons = spans.iter().filter(|(span, _)| *span >= long);
    let period = period.unwrap_or(0.0);
    let horizons =
        horizons.map(|(span, steps)| (0.25 * span).min((SAMPLES_AHEAD * span / (*steps).max(1) as f64).max(period)));
    horizons.fold(f64::INFINITY, f64::min)
}

fn error_plot(curves: &[(&str, Vec<PredictionError>)], unit: &str) -> LinePlot {
    let series = |(name, errors): &(&str, Vec<PredictionError>)| {
        let (x, y): (Vec<f64>, Vec<f64>) = errors.iter().map(|e| (e.seconds, e.median)).unzip();
        Series::new(name, &x, &y)
    };
    LinePlot {
        x_label: "time ahead [s]".into(),
        y_label: format!("median error [{}]", short(unit)),
        log_y: true,
        series: curves.iter().map(series).collect(),
        ..LinePlot::default()
    }
}

/// Pictures of the window whose final error is the median: its coordinates, its path in the plane if coordinates are polar, and its forces.
fn example_figures(
    plan: &HoldOutOptions<'_>,
    found: &HeldOutPredictions,
    (scales, horizon): (&[f64], f64),
) -> Vec<Figure> {
    let (windows, motion, recording) = (&found.windows, &found.predictions, &plan.part.recording);
    let (names, periodic) = (&recording.coordinates, &recording.periodic);
    let error = |(window, predicted): (&Window, &Vec<f64>)| {
        prediction_error(slice::from_ref(window), &vec![predicted.clone()], (periodic, scales), horizon).median
    };
    let Some(chosen) = median_of(&windows.iter().zip(motion).map(error).collect::<Vec<_>>()) else { return Vec::new() };
    let (window, predicted) = (&windows[chosen], &motion[chosen]);
    let which = match windows.len() {
        1 => "the held-out window".to_string(),
        count => format!("of {count} held-out windows the one whose error at the end is the median"),
    };
    let caption = format!("Measured (wide), and predicted from a state that has not seen it: {which}.");
    let of = |(i, name): (usize, &String)| {
        let drawn = line_plot(&example(window, predicted, periodic, i, with_unit(name, &plan.units[i])));
        let heading = format!("{name} over time: predicted over measured");
        figure(&format!("prediction_{}.svg", i + 1), heading, drawn, caption.as_str())
    };
    let path = Polar::of(names, plan.units).and_then(|polar| {
        let trace = polar.trace(names.len(), &[("measured", &window.measured), ("predicted", predicted)]);
        let heading = "The path in the plane: predicted over measured";
        figure("prediction_path.svg", heading, trace_plot(&trace), caption.as_str())
    });
    let forces = window.force.as_ref().and_then(|force| {
        let times: Vec<f64> = [0.0].iter().chain(&window.times).map(|t| window.lead + t).collect();
        let drawn = line_plot(&force_plot(force, &times, plan.forces));
        figure("prediction_forces.svg", "The known forces that drove the motion", drawn, FORCE_CAPTION)
    });
    names.iter().enumerate().filter_map(of).chain(path).chain(forces).collect()
}

/// Plots coordinate `i` of a window, measured and predicted; an angle that leaves one turn is folded into it.
fn example(window: &Window, predicted: &[f64], periodic: &[bool], i: usize, y_label: String) -> LinePlot {
    let column = |values: &[f64]| -> Vec<(f64, f64)> {
        values.iter().skip(i).step_by(periodic.len()).copied().zip(window.times.iter().copied()).collect()
    };
    let (measured, predicted) = (column(&window.measured), column(predicted));
    let all = measured.iter().chain(&predicted).map(|p| p.0);
    let turn = if periodic[i] { Turn::of(all) } else { None };
    let series = vec![Series::folded("measured", measured, turn), Series::folded("predicted", predicted, turn).over()];
    LinePlot { x_label: "time ahead [s]".into(), y_label, series, turn, ..LinePlot::default() }
}

/// Plots forces over time, one line each.
fn force_plot(force: &SampledForce<f64>, times: &[f64], names: &[String]) -> LinePlot {
    let mut values = vec![0.0; names.len()];
    let mut columns = vec![Vec::with_capacity(times.len()); names.len()];
    for &t in times {
        force.at(t, &mut values);
        columns.iter_mut().zip(&values).for_each(|(column, &value)| column.push(value));
    }
    let series = names.iter().zip(&columns).map(|(name, column)| Series::new(name, times, column)).collect();
    let (x_label, y_label) = ("time ahead [s]".into(), "force [N, N m]".into());
    LinePlot { x_label, y_label, series, ..LinePlot::default() }
}

/// Fraction of the states with full windows whose mass matrix has a wrong signature or is not finite.
fn wrong_signature(model: &dyn EulerLagrange<f64>, part: &Split, time: Option<usize>) -> f64 {
    let n = model.coordinates();
    let (mut wrong, mut count) = (0, 0);
    let (mut terms, mut buffers) = (Terms::default(), SignatureBuffers::default());
    let stride = part.recording.samples().div_ceil(SIGNATURE_STATES).max(1);
    for states in &part.states {
        let rows = states.interior();
        let some = |values: &[f64]| -> Vec<f64> {
            values[rows.start * n..rows.end * n].chunks_exact(n).step_by(stride).flatten().copied().collect()
        };
        let (q, v) = (some(&states.q), some(&states.v));
        for (q, v) in q.chunks(STATES_AT_ONCE * n).zip(v.chunks(STATES_AT_ONCE * n)) {
            // If a state fails, its matrix is not finite and is handled below.
            let _ = model.terms(q, v, Request::MASS_MATRIX | Request::CONSTRAINTS, &mut terms);
            count += q.len() / n;
            let m = terms.constraints;
            let mut right = |(k, matrix): &(usize, &[f64])| match m {
                0 => matrix.iter().all(|m| m.is_finite()) && has_signature(n, matrix, time, &mut buffers),
                _ => {
                    let rows = terms.constraint_matrix.get(k * m * n..(k + 1) * m * n).unwrap_or_default();
                    ReducedMass::of(n, matrix, rows).is_ok_and(|reduced| reduced.eigenvalues.iter().all(|w| *w > 0.0))
                }
            };
            wrong += q.len() / n - terms.mass_matrix.chunks_exact(n * n).enumerate().filter(|pair| right(pair)).count();
        }
    }
    wrong as f64 / f64::max(1.0, count as f64)
}

/// Factor by which a prediction is better than constant velocity; `None` if it is not better.
pub(crate) fn factor(model: &PredictionError, straight: &PredictionError) -> Option<f64> {
    is_better(model.median, straight.median).then(|| straight.median / model.median)
}

/// `true` if the prediction error is at least a twentieth smaller than that of constant velocity.
pub(crate) fn is_better(model: f64, straight: f64) -> bool {
    straight / model >= BETTER_THAN_CONSTANT_VELOCITY
}

impl UsefulTime {
    /// Determines the useful time from the time of valid prediction and from the errors of model and constant velocity at the same times.
    fn new(valid: &ValidTimes, [model, straight]: [&[PredictionError]; 2]) -> Self {
        let mut pairs = model.iter().zip(straight).rev();
        let last = pairs.next().filter(|(model, straight)| factor(model, straight).is_some());
        let better = last.or_else(|| pairs.find(|(model, straight)| factor(model, straight).is_some()));
        let better = better.map_or(0.0, |(model, _)| model.seconds);
        Self { seconds: better.min(valid.median), at_least: last.is_some() && valid.at_least }
    }
}

/// Short form of a unit for a header.
fn short(unit: &str) -> &str {
    if unit.starts_with("of ") { "spread" } else { unit }
}

impl HoldOut {
    fn headers(&self) -> [String; 7] {
        let unit = short(self.error_unit);
        [
            "time ahead [s]".to_string(),
            format!("median error [{unit}]"),
            format!("9 of 10 below [{unit}]"),
            format!("rms error [{unit}]"),
            format!("constant velocity, median [{unit}]"),
            "windows".to_string(),
            "given up".to_string(),
        ]
    }

    /// Builds the table of errors by coordinate, if there are several.
    fn table_by_coordinate(&self) -> Option<(Vec<String>, Vec<Vec<String>>)> {
        if self.by_coordinate.len() < 2 || self.model.is_empty() {
            return None;
        }
        let header = |c: &CoordinatePredictions| {
            [format!("{} [{}]", c.name, c.unit), format!("{}, constant velocity [{}]", c.name, c.unit)]
        };
        let headers = self.by_coordinate.iter().flat_map(header);
        let headers = ["median error, time ahead [s]".to_string()].into_iter().chain(headers).collect();
        let row = |(k, error): (usize, &PredictionError)| {
            let numbers = self.by_coordinate.iter().flat_map(|c| [c.model[k], c.constant_velocity[k]]);
            [error.seconds].into_iter().chain(numbers).map(number).collect()
        };
        Some((headers, self.model.iter().enumerate().map(row).collect()))
    }

    fn rows(&self) -> Vec<Vec<String>> {
        let pairs = self.model.iter().zip(&self.constant_velocity);
        pairs
            .map(|(model, straight)| {
                let numbers = [model.median, model.p90, model.rms, straight.median].map(number);
                let counts = [model.windows, model.missing].map(|count| count.to_string());
                [vec![number(model.seconds)], numbers.to_vec(), counts.to_vec()].concat()
            })
            .collect()
    }

    /// Result for a model without held-out motion; it contains no numbers.
    pub(crate) fn nothing() -> Self {
        Self {
            error_unit: "SI",
            model: Vec::new(),
            constant_velocity: Vec::new(),
            valid_time: None,
            useful_time: None,
            fastest_period: None,
            by_coordinate: Vec::new(),
            given_up: String::new(),
            wrong_signature: f64::NAN,
            energy: None,
            force_errors: Vec::new(),
            figures: Vec::new(),
            predicted: HeldOutPredictions::default(),
            error_scales: Default::default(),
        }
    }

    /// `true` if the model predicts better than constant velocity at some time ahead; `None` without predictions.
    pub(crate) fn is_better(&self) -> Option<bool> {
        let mut pairs = self.model.iter().zip(&self.constant_velocity);
        (!self.model.is_empty()).then(|| pairs.any(|(model, straight)| factor(model, straight).is_some()))
    }

    /// `true` if there was no held-out motion.
    fn is_of_nothing(&self) -> bool {
        self.wrong_signature.is_nan()
    }

    /// Reports errors of forces and predictions, and the energy balance.
    pub(crate) fn findings(&self) -> Findings {
        let mut findings = Findings::default();
        if !self.force_errors.is_empty() {
            findings.heading("Errors of the forces of held-out motion");
            findings.table(&ForceError::HEADERS, self.force_errors.iter().map(ForceError::row));
        }
        findings.heading("Errors of the predictions of held-out motion");
        if self.is_of_nothing() {
            findings.line("Nothing was held out (--hold-out 0): this model was not tested.");
            return findings;
        }
        if self.model.is_empty() {
            findings.line("No window of the held-out motion is as long as the horizon: nothing was predicted.");
        }
        findings.table(&self.headers(), self.rows());
        if let Some((headers, rows)) = self.table_by_coordinate() {
            findings.gap().table(&headers, rows);
        }
        findings.lines(self.given_up.lines()).lines(self.energy.iter().flat_map(Balance::lines));
        findings
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_prediction_is_of_use_while_it_is_valid_and_better_than_constant_velocity() {
        let errors = |medians: [f64; 4]| -> Vec<PredictionError> {
            let error = |(k, median)| PredictionError {
                seconds: 1.0 + k as f64,
                rms: median,
                median,
                p90: median,
                windows: 9,
                missing: 0,
            };
            medians.into_iter().enumerate().map(error).collect()
        };
        let useful = |model, straight, median, at_least| {
            let (threshold, lyapunov_times, lyapunov_at_least) = (crate::analysis::VALID, None, false);
            let valid =
                ValidTimes { threshold, median, at_least, starts: 9, lyapunov_times, lyapunov_at_least, chaotic: 0 };
            UsefulTime::new(&valid, [&errors(model), &errors(straight)])
        };
        let straight = [1.0, 2.0, 3.0, 4.0];
        let of = |seconds, at_least| UsefulTime { seconds, at_least };
        assert_eq!(useful([0.1, 0.2, 0.3, 0.4], straight, 4.0, true), of(4.0, true));
        // Better to the end, but wrong before; right to the end, but no better; never better.
        assert_eq!(useful([0.1, 0.2, 0.3, 0.4], straight, 2.5, false), of(2.5, false));
        assert_eq!(useful([1.0, 0.2, 0.3, 4.0], straight, 4.0, true), of(3.0, false));
        assert_eq!(useful([1.0, 2.0, f64::INFINITY, 4.0], straight, 4.0, true), of(0.0, false));
    }
}
