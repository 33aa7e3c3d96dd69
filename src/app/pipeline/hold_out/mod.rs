//! Tests a model of recorded motion: predictions of held-out motion, and the energy balance.

mod figures;
mod findings;
mod horizon;
mod measures;
mod options;
mod result;

use crate::analysis::{ValidTimes, Window, predict_by_constant_velocity, window_valid_times};
use crate::data::{Split, StateEstimate};
use crate::lagrangian::{EulerLagrange, ReducedMass, Request, Terms, project};
use crate::linalg::{SignatureBuffers, has_signature};
use crate::pipeline::constraint_figures::constraint_figures;
use crate::pipeline::energy::{balance, energy_figure};
use crate::pipeline::judging::Judging;
use crate::pipeline::prediction::HeldOutPredictions;
use crate::pipeline::thresholds::{CURVE_TIMES, MOST_WINDOWS, SIGNATURE_STATES, STATES_AT_ONCE, TABLE_TIMES};
use crate::pipeline::{PipelineError, Watch};
use crate::recording::Smoothed;
use figures::{error_figure, example_figures};
pub(crate) use horizon::horizons;
use horizon::{fastest_period, horizon};
use measures::ErrorMeasures;
pub use options::HoldOutOptions;
pub use result::{CoordinatePredictions, HoldOut, UsefulTime};
pub(crate) use result::{factor, is_better};

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
        figures.extend(error_figure(&curves, measures.unit));
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
