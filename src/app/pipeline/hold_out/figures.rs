//! Pictures of predictions of held-out motion.

use super::measures::short;
use super::options::HoldOutOptions;
use crate::analysis::{PredictionError, Window, prediction_error};
use crate::pipeline::prediction::HeldOutPredictions;
use crate::report::{Figure, LinePlot, Polar, Series, Turn, figure, line_plot, median_of, trace_plot, with_unit};
use crate::rollout::SampledForce;
use std::slice;

const ERROR_CAPTION: &str = "Median over the held-out windows of the error of the predicted coordinates (root mean square over the coordinates), by \
                             time since the last sample that the start of the prediction has seen, beside going on at constant velocity.";

const FORCE_CAPTION: &str =
    "Known forces in the same held-out window; the prediction takes them as linear between the samples.";

/// Picture of the growth of the error with the time ahead, a curve for each of the named predictions.
pub(super) fn error_figure(curves: &[(&str, Vec<PredictionError>)], unit: &str) -> Option<Figure> {
    let series = |(name, errors): &(&str, Vec<PredictionError>)| {
        let (x, y): (Vec<f64>, Vec<f64>) = errors.iter().map(|e| (e.seconds, e.median)).unzip();
        Series::new(name, &x, &y)
    };
    let plot = LinePlot {
        x_label: "time ahead [s]".into(),
        y_label: format!("median error [{}]", short(unit)),
        log_y: true,
        series: curves.iter().map(series).collect(),
        ..LinePlot::default()
    };
    figure("prediction_error.svg", "How the error of the prediction grows", line_plot(&plot), ERROR_CAPTION)
}

/// Pictures of the window whose final error is the median: its coordinates, its path in the plane if coordinates are polar, and its forces.
pub(super) fn example_figures(
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
