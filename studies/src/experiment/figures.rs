//! Pictures of an experiment beside its loss curves.

use super::experiments::{Experiment, Picture};
use lnn::experiments::{Outcome, Record, Run, RunSpread};
use lnn::report::{Figure, Level, LinePlot, Series, figure, groups, line_plot};
use std::fmt::Write as _;

/// Validation loss against seconds of training.
#[derive(Clone, Debug, PartialEq)]
pub struct Curve {
    /// Name of the curve.
    pub label: String,
    /// Seconds and loss, paper convention.
    pub points: Vec<(f64, f64)>,
}

/// The curve of every finished run.
pub fn curves_of(results: &[(Run, Option<Record>)]) -> Vec<Curve> {
    let of = |(run, record): &(Run, Option<Record>)| {
        let record = record.as_ref()?;
        let losses = record.losses.iter().map(|[_, validation]| *validation);
        let points = record.times.iter().zip(losses).filter_map(|(&time, loss)| Some((time, loss?))).collect();
        Some(Curve { label: run.label.clone(), points })
    };
    results.iter().filter_map(of).collect()
}

/// The lowest loss so far against the logarithm of the time.
fn reached(curves: &[Curve]) -> Vec<Series> {
    let series = |curve: &Curve| {
        let mut lowest = f64::INFINITY;
        let point = |&(time, loss): &(f64, f64)| {
            lowest = lowest.min(loss);
            (time.log10(), lowest)
        };
        Series { name: curve.label.clone(), points: curve.points.iter().map(point).collect(), over: false }
    };
    curves.iter().map(series).collect()
}

/// Pictures from finished runs, and `curves` where time matters; what has nothing to show is left out.
pub fn figures(experiment: &Experiment, results: &[(Run, Option<Record>)], curves: &[Curve]) -> Vec<Figure> {
    let mut found = Vec::new();
    let mut add = |file: &str, heading: &str, caption: String, plot: LinePlot| {
        found.extend(figure(&format!("{file}.svg"), heading, line_plot(&plot), caption));
    };
    for picture in experiment.pictures {
        match picture {
            Picture::Scan { abscissa } => add(
                "scan",
                &format!("Which {abscissa} gives the lowest loss"),
                format!(
                    "Lowest validation loss of each run against {abscissa}; runs without {abscissa} as a level line."
                ),
                LinePlot {
                    x_label: format!("log10 {abscissa}"),
                    y_label: "lowest validation loss".into(),
                    log_y: true,
                    series: scan(results),
                    ..LinePlot::default()
                },
            ),
            Picture::Gain { abscissa } => add(
                "gain",
                "How many times lower the penalty makes the loss",
                format!(
                    "Lowest validation loss without the penalty over that with it, medians over seeds, against {abscissa}, 1 in the paper."
                ),
                LinePlot {
                    x_label: format!("log2 of {abscissa} over the paper's"),
                    y_label: "ratio of the lowest losses".into(),
                    log_y: true,
                    series: gain(results),
                    level: Some(Level { value: 1.0, name: "penalty without effect".into() }),
                    ..LinePlot::default()
                },
            ),
            Picture::TradeOff => add(
                "trade_off",
                "Accuracy against stability of the training",
                "Lowest validation loss against training instability, one point per run; lower left is better.".into(),
                LinePlot {
                    x_label: "log10 instability".into(),
                    y_label: "lowest validation loss".into(),
                    log_y: true,
                    series: trade_off(results),
                    ..LinePlot::default()
                },
            ),
            Picture::Clock => add(
                "time_to_accuracy",
                "Which accuracy is reached after which time",
                "Lowest validation loss so far against seconds of training, paper convention.".into(),
                LinePlot {
                    x_label: "log10 of the time of training [s]".into(),
                    y_label: "lowest validation loss".into(),
                    log_y: true,
                    series: reached(curves),
                    ..LinePlot::default()
                },
            ),
            Picture::Evaluation(_) | Picture::BlackHole => {}
        }
    }
    found
}

/// Loss against time of every curve, as far as they are known.
pub fn curves_csv(curves: &[Curve]) -> String {
    let mut csv = String::from("run,seconds,validation_loss\n");
    for Curve { label, points } in curves {
        let label = label.replace('"', "\"\"");
        for (seconds, loss) in points {
            let _ = writeln!(csv, "\"{label}\",{seconds},{loss}");
        }
    }
    csv
}

fn lowest(record: &Record) -> f64 {
    match &record.outcome {
        Outcome::Learned(learned) => learned.validation_loss,
        Outcome::Nothing { .. } => f64::NAN,
    }
}

fn scan(results: &[(Run, Option<Record>)]) -> Vec<Series> {
    let abscissae = || results.iter().filter_map(|(run, _)| run.abscissa).map(f64::log10);
    let ends = [abscissae().fold(f64::INFINITY, f64::min), abscissae().fold(f64::NEG_INFINITY, f64::max)];
    groups(results, |run| &run.group)
        .into_iter()
        .map(|(name, members)| {
            let at = |(run, record): &(&Run, &Record)| run.abscissa.map(|x| (x.log10(), lowest(record)));
            let mut points: Vec<(f64, f64)> = members.iter().filter_map(at).collect();
            points.sort_by(|a, b| a.0.total_cmp(&b.0));
            if points.is_empty() {
                let losses: Vec<f64> = members.iter().map(|(_, r)| lowest(r)).filter(|x| x.is_finite()).collect();
                let mean = losses.iter().sum::<f64>() / losses.len() as f64;
                points = ends.map(|x| (x, mean)).to_vec();
            }
            Series { name: name.to_string(), points, over: false }
        })
        .collect()
}

/// A line per group: median loss of the runs without a penalty over that of the runs with one.
fn gain(results: &[(Run, Option<Record>)]) -> Vec<Series> {
    let line = |(name, members): (&str, Vec<(&Run, &Record)>)| {
        let mut abscissae: Vec<f64> = members.iter().filter_map(|(run, _)| run.abscissa).collect();
        abscissae.sort_by(f64::total_cmp);
        abscissae.dedup();
        let median = |x: f64, penalised: bool| {
            let here = |run: &Run| run.abscissa == Some(x) && (run.config.penalty.lambda() > 0.0) == penalised;
            let losses = members.iter().filter(|(run, _)| here(run)).map(|(_, record)| lowest(record));
            RunSpread::of(losses).map_or(f64::NAN, |spread| spread.median)
        };
        let points = abscissae.into_iter().map(|x| (x.log2(), median(x, false) / median(x, true)));
        Series { name: name.to_string(), points: points.collect(), over: false }
    };
    groups(results, |run| &run.group).into_iter().map(line).collect()
}

/// A label or group per colour; gaps between the points keep them apart.
fn trade_off(results: &[(Run, Option<Record>)]) -> Vec<Series> {
    let labels = groups(results, |run| &run.label);
    // More labels than colours: groups.
    let chosen = if labels.len() <= 7 { labels } else { groups(results, |run| &run.group) };
    chosen
        .into_iter()
        .map(|(name, members)| {
            let points = members.iter().flat_map(|(_, record)| {
                let instability = match &record.outcome {
                    Outcome::Learned(learned) => learned.instability.map_or(f64::NAN, f64::log10),
                    Outcome::Nothing { .. } => f64::NAN,
                };
                [(instability, lowest(record)), (f64::NAN, f64::NAN)]
            });
            Series { name: name.to_string(), points: points.collect(), over: false }
        })
        .collect()
}
