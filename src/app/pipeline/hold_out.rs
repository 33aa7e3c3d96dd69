//! Judgement of a model of recorded motion: predictions of motion that was held out, and the balance of its energy.

use crate::analysis::{
    PredictionError, Predictions, ValidTimes, Window, predict_by_constant_velocity, prediction_error, spread,
    window_valid_times,
};
use crate::data::Split;
use crate::lagrangian::{EulerLagrange, Request, Terms};
use crate::linalg::{SignatureBuffers, has_signature};
use crate::names::number;
use crate::pipeline::attention::Attention;
use crate::pipeline::energy::{Balance, balance};
use crate::pipeline::prediction::HeldOutPredictions;
use crate::pipeline::{PipelineError, Watch};
use crate::report::{Figure, LinePlot, Report, Series, Turn, kept, line_plot, text_table};
use crate::rollout::SampledForce;
use serde::Serialize;

/// Windows that are predicted at most; of more, evenly spaced ones.
const WINDOWS: usize = 500;
/// Samples ahead that are predicted unless told otherwise.
const AHEAD: f64 = 200.0;
/// Points of a curve of prediction errors.
const POINTS: usize = 40;

/// Motion that judges a model, and how.
#[derive(Clone, Copy, Debug)]
pub struct HoldOutOptions<'a> {
    /// Motion that the model has not seen.
    pub part: &'a Split,
    /// Time over which it is predicted, in s; none for 200 samples, at most a quarter of the shortest trajectory, pieces much shorter
    /// than the others left aside.
    pub horizon: Option<f64>,
    /// The time-like coordinate, if there is one.
    pub time: Option<usize>,
    /// Names of the known forces, if there are any.
    pub forces: &'a [String],
    /// Threads.
    pub threads: usize,
}

/// Predictions of motion that was held out, beside going on at constant velocity, in SI units.
#[derive(Clone, Debug, Serialize)]
pub struct HoldOut {
    /// Errors of the model's motion, by time ahead.
    pub model: Vec<PredictionError>,
    /// Time for which the model's motion predicts the measured one, median over the windows; at least to their end where the
    /// error stays small. None without windows.
    pub(crate) valid_time: Option<ValidTimes>,
    /// Which predictions were given up and why, in words; empty if none was.
    pub given_up: String,
    /// Errors of going on at the velocity of the start.
    pub constant_velocity: Vec<PredictionError>,
    /// Fraction of the held-out states whose mass matrix has not the right signature; `NaN` where nothing was held out.
    pub wrong_signature: f64,
    /// Energy along the held-out trajectories; none if there is none of it to be told.
    pub(crate) energy: Option<Balance>,
    /// Pictures.
    #[serde(skip)]
    pub figures: Vec<Figure>,
}

/// Predicts held-out motion in up to 500 windows and compares it with what was measured.
///
/// # Errors
/// [`PipelineError::Interrupted`].
pub fn evaluate_hold_out(
    model: &dyn EulerLagrange<f64>,
    options: &HoldOutOptions<'_>,
    watch: &Watch,
) -> Result<HoldOut, PipelineError> {
    let (attention, plan) = (&Attention::new(watch, WINDOWS), options);
    let (n, recording) = (model.coordinates(), &plan.part.recording);
    if recording.tracks.is_empty() {
        return Ok(HoldOut::nothing());
    }
    let horizon = plan.horizon.unwrap_or_else(|| horizon(plan.part));
    let mut windows: Vec<Window> = plan
        .part
        .estimated()
        .iter()
        .zip(&plan.part.states)
        .flat_map(|(e, states)| Window::cut(e.track, (e.q, e.v), states.interior(), n, horizon))
        .collect();
    let stride = windows.len().div_ceil(WINDOWS).max(1);
    windows = windows.into_iter().step_by(stride).collect();
    let watched = attention.watched(model);
    let model: &dyn EulerLagrange<f64> = &watched;
    let foretold = HeldOutPredictions::new(model, windows, plan.threads, attention)?;
    let (windows, motion) = (&foretold.windows, &foretold.predictions);
    let straight = predict_by_constant_velocity(windows);
    let errors = |predictions: &Predictions, count: usize| -> Vec<PredictionError> {
        let times = (1..=count).map(|k| horizon * k as f64 / count as f64);
        times.map(|t| prediction_error(windows, predictions, &recording.periodic, t)).collect()
    };
    let mut figures = Vec::new();
    if !windows.is_empty() {
        let curves = [("model", errors(motion, POINTS)), ("constant velocity", errors(&straight, POINTS))];
        figures.extend(drawn(error_plot(&curves), "prediction_error.svg", ERROR_CAPTION));
        for (i, name) in recording.coordinates.iter().enumerate() {
            let file = format!("prediction_{}.svg", i + 1);
            figures.extend(drawn(
                example(&windows[0], &motion[0], &recording.periodic, i, name),
                &file,
                EXAMPLE_CAPTION,
            ));
        }
        if let Some(force) = &windows[0].force {
            let times: Vec<f64> = [0.0].iter().chain(&windows[0].times).copied().collect();
            figures.extend(drawn(force_plot(force, &times, plan.forces), "prediction_forces.svg", FORCE_CAPTION));
        }
    }
    let tabled = |predictions: &Predictions| if windows.is_empty() { Vec::new() } else { errors(predictions, 4) };
    let (wrong_signature, energy) = (wrong_signature(model, plan.part, plan.time), balance(model, plan.part));
    attention.check()?;
    let spread = spread(
        &recording.tracks.iter().flat_map(|track| track.q.iter().copied()).collect::<Vec<_>>(),
        &recording.periodic,
    );
    let valid = window_valid_times(windows, motion, &recording.periodic, &spread);
    Ok(HoldOut {
        model: tabled(motion),
        valid_time: ValidTimes::of(&valid.into_iter().map(|valid| (valid, None)).collect::<Vec<_>>()),
        constant_velocity: tabled(&straight),
        given_up: foretold.remarks(),
        wrong_signature,
        energy,
        figures,
    })
}

const ERROR_CAPTION: &str = "Median over held-out windows of the error of predicted coordinates (root mean square over the coordinates) against the time since \
                             the state that the prediction starts from.";
const EXAMPLE_CAPTION: &str = "The first held-out window: measured, and predicted from the state at its start under the known forces, if there are any.";
const FORCE_CAPTION: &str =
    "Known forces in the first held-out window; the prediction takes them as linear between the samples.";

/// Times over which held-out motion can be predicted: from the shortest of its steps to the longest of its trajectories.
pub(crate) fn horizons(part: &Split) -> Option<(f64, f64)> {
    let times = || part.states.iter().map(|states| &states.times[states.interior()]);
    let spans = times().filter_map(|times| Some(times.last()? - times.first()?)).filter(|span| *span > 0.0);
    let steps = times().flat_map(|times| times.windows(2).map(|pair| pair[1] - pair[0]));
    Some((steps.reduce(f64::min)?, spans.reduce(f64::max)?))
}

/// A quarter of the shortest of the long trajectories, at most [`AHEAD`] samples. Half the time belongs to trajectories of a length or
/// longer ones; long is half as much: pieces between gaps do not shorten the horizon of the others.
fn horizon(part: &Split) -> f64 {
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
    let horizons = horizons.map(|(span, steps)| (0.25 * span).min(AHEAD * span / (*steps).max(1) as f64));
    horizons.fold(f64::INFINITY, f64::min)
}

/// The picture, unless there is nothing to show.
fn drawn(plot: LinePlot, file: &str, caption: &str) -> Option<Figure> {
    kept(file, line_plot(&plot), caption.to_string())
}

fn error_plot(curves: &[(&str, Vec<PredictionError>)]) -> LinePlot {
    let series = |(name, errors): &(&str, Vec<PredictionError>)| {
        let (x, y): (Vec<f64>, Vec<f64>) = errors.iter().map(|e| (e.seconds, e.median)).unzip();
        Series::new(name, &x, &y)
    };
    LinePlot {
        title: "Prediction of held-out motion".into(),
        x_label: "time ahead [s]".into(),
        y_label: "median error [SI]".into(),
        log_y: true,
        series: curves.iter().map(series).collect(),
        turn: None,
        level: None,
    }
}

/// Coordinate `i` of a window, measured and predicted; an angle in one turn if it leaves it.
fn example(window: &Window, predicted: &[f64], periodic: &[bool], i: usize, name: &str) -> LinePlot {
    let column = |values: &[f64]| -> Vec<(f64, f64)> {
        values.iter().skip(i).step_by(periodic.len()).copied().zip(window.times.iter().copied()).collect()
    };
    let (measured, predicted) = (column(&window.measured), column(predicted));
    let all = measured.iter().chain(&predicted).map(|p| p.0);
    let turn = if periodic[i] { Turn::of(all) } else { None };
    let line = |label: &str, path: Vec<(f64, f64)>| {
        let path = turn.map_or_else(|| path.clone(), |turn| turn.fold(&path));
        Series { points: path.into_iter().map(|(x, t)| (t, x)).collect(), ..Series::new(label, &[], &[]) }
    };
    LinePlot {
        title: format!("Prediction of {name}"),
        x_label: "time ahead [s]".into(),
        y_label: format!("{name} [{}]", if periodic[i] { "rad" } else { "SI" }),
        log_y: false,
        series: vec![line("measured", measured), line("predicted", predicted).over()],
        turn,
        level: None,
    }
}

/// Forces over time, one line each.
fn force_plot(force: &SampledForce<f64>, times: &[f64], names: &[String]) -> LinePlot {
    let mut values = vec![0.0; names.len()];
    let mut columns = vec![Vec::with_capacity(times.len()); names.len()];
    for &t in times {
        force.at(t, &mut values);
        columns.iter_mut().zip(&values).for_each(|(column, &value)| column.push(value));
    }
    LinePlot {
        title: "Known forces".into(),
        x_label: "time ahead [s]".into(),
        y_label: "force [N, N m]".into(),
        log_y: false,
        series: names.iter().zip(&columns).map(|(name, column)| Series::new(name, times, column)).collect(),
        turn: None,
        level: None,
    }
}

/// States evaluated at once.
const CHUNK: usize = 4096;

/// States whose mass matrix is looked at, about; of more, evenly spaced ones.
const STATES: usize = 20_000;

/// Fraction of the states with full windows whose mass matrix has not the right signature, or is not finite.
fn wrong_signature(model: &dyn EulerLagrange<f64>, part: &Split, time: Option<usize>) -> f64 {
    let n = model.coordinates();
    let (mut wrong, mut count) = (0, 0);
    let (mut terms, mut buffers) = (Terms::default(), SignatureBuffers::default());
    let stride = part.recording.samples().div_ceil(STATES).max(1);
    for states in &part.states {
        let rows = states.interior();
        let some = |values: &[f64]| -> Vec<f64> {
            values[rows.start * n..rows.end * n].chunks_exact(n).step_by(stride).flatten().copied().collect()
        };
        let (q, v) = (some(&states.q), some(&states.v));
        for (q, v) in q.chunks(CHUNK * n).zip(v.chunks(CHUNK * n)) {
            // Failures of single states leave matrices that are not finite.
            let _ = model.terms(q, v, Request::MASS_MATRIX, &mut terms);
            count += q.len() / n;
            let right =
                |matrix: &&[f64]| matrix.iter().all(|m| m.is_finite()) && has_signature(n, matrix, time, &mut buffers);
            wrong += q.len() / n - terms.mass_matrix.chunks_exact(n * n).filter(right).count();
        }
    }
    wrong as f64 / f64::max(1.0, count as f64)
}

/// How many times a prediction is better than constant velocity; none if it is no better.
pub(crate) fn factor(model: &PredictionError, straight: &PredictionError) -> Option<f64> {
    Some(straight.median / model.median).filter(|factor| *factor >= 1.05)
}

impl HoldOut {
    const HEADERS: [&'static str; 7] = [
        "time ahead [s]",
        "median error [SI]",
        "9 of 10 below [SI]",
        "rms error [SI]",
        "constant velocity, median [SI]",
        "windows",
        "given up",
    ];

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

    /// That of a model that no motion was held out to judge: its numbers are not there.
    fn nothing() -> Self {
        Self {
            model: Vec::new(),
            constant_velocity: Vec::new(),
            valid_time: None,
            given_up: String::new(),
            wrong_signature: f64::NAN,
            energy: None,
            figures: Vec::new(),
        }
    }

    /// `true` if the model predicts better than constant velocity at any of the times ahead; none without predictions.
    pub(crate) fn is_better(&self) -> Option<bool> {
        let mut pairs = self.model.iter().zip(&self.constant_velocity);
        (!self.model.is_empty()).then(|| pairs.any(|(model, straight)| factor(model, straight).is_some()))
    }

    /// `true` if there was nothing to judge by.
    fn is_of_nothing(&self) -> bool {
        self.wrong_signature.is_nan()
    }

    /// Remarks below the table of predictions, in words.
    fn remarks(&self) -> String {
        if self.is_of_nothing() {
            return "nothing was held out (--hold-out 0): nothing judges this model\n".to_string();
        }
        let mut text = self.given_up.clone();
        if let Some(balance) = &self.energy {
            text += &balance.text();
        }
        text
    }

    /// For a terminal.
    pub(crate) fn text(&self) -> String {
        if self.is_of_nothing() {
            return self.remarks();
        }
        if self.model.is_empty() {
            let none = "no window of held-out motion is as long as the horizon: nothing was predicted\n";
            return format!("{none}{}", self.remarks());
        }
        format!("{}{}", text_table(&Self::HEADERS, &self.rows()), self.remarks())
    }

    /// Adds tables and pictures to a report.
    pub(crate) fn report(&self, report: Report) -> Report {
        if self.is_of_nothing() {
            return report.heading("Predictions of held-out motion").paragraph(self.remarks().trim_end());
        }
        let report = report.heading("Predictions of held-out motion").table(&Self::HEADERS, &self.rows());
        let report = self.remarks().lines().fold(report, |report, line| report.paragraph(line));
        report.figures(&self.figures)
    }
}
