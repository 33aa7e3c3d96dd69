//! Tables and pictures of an experiment: the paper's figures beside ours.

use super::{Figure, LinePlot, Series, kept, line_plot};
use crate::experiments::{Experiment, Outcome, Picture, Record, Reduction, Row, Run, Spread};
use crate::names::{counted, percent};

/// Header of [`experiment_table`].
pub const EXPERIMENT_HEADER: [&str; 13] = [
    "run",
    "runs",
    "loss",
    "paper",
    "instability",
    "paper",
    "physical loss",
    "physical instability",
    "wrong signature",
    "integrated",
    "energy error",
    "of regular motions",
    "of chaotic motions",
];

/// Header of [`reduction_table`].
pub const REDUCTION_HEADER: [&str; 5] = ["reduction of", "by", "against", "here", "paper"];

/// The reductions that the paper states beside those of these runs, below [`REDUCTION_HEADER`].
pub fn reduction_table(reductions: &[(Reduction, Option<f64>)]) -> Vec<Vec<String>> {
    let percent = |x: f64| format!("{:.1} %", 100.0 * x);
    let row = |(reduction, found): &(Reduction, Option<f64>)| {
        let Reduction { quantity, group, against, paper } = reduction;
        let found = found.map_or_else(|| "-".to_string(), percent);
        vec![quantity.name().to_string(), group.to_string(), against.to_string(), found, percent(*paper)]
    };
    reductions.iter().map(row).collect()
}

/// A spread as `mean [low, high]`, or the value alone where there is no spread.
fn spread(value: Option<Spread>) -> String {
    value.map_or_else(
        || "-".to_string(),
        |s| {
            if s.low == s.high {
                number(s.mean)
            } else {
                format!("{} [{}, {}]", number(s.mean), number(s.low), number(s.high))
            }
        },
    )
}

/// Four significant digits.
fn number(x: f64) -> String {
    if x == 0.0 || (1e-3..1e4).contains(&x.abs()) {
        let digits = if x == 0.0 { 0 } else { (3 - x.abs().log10().floor() as i32).max(0) as usize };
        format!("{x:.digits$}")
    } else {
        format!("{x:.3e}")
    }
}

/// The best row of an experiment in a sentence, beside the paper's best, and in a short table.
pub fn experiment_summary(rows: &[Row]) -> (String, Vec<[String; 2]>) {
    let lowest = |of: fn(&Row) -> Option<f64>| {
        let known = rows.iter().filter_map(|row| Some((row, of(row).filter(|loss| loss.is_finite())?)));
        known.min_by(|a, b| a.1.total_cmp(&b.1))
    };
    let (runs, failed) = rows.iter().fold((0, 0), |(runs, failed), row| (runs + row.runs, failed + row.failed));
    let runs_of = counted(runs, "run", "runs");
    let (own, paper) = (lowest(|row| row.loss.map(|loss| loss.mean)), lowest(|row| row.reported.loss));
    let of = |found: Option<(&Row, f64)>| found.map(|(row, loss)| format!("{} ({})", number(loss), row.label));
    let beside = of(paper).map_or(String::new(), |paper| format!("; the paper's best is {paper}"));
    let sentence = match own {
        Some((row, loss)) => {
            format!("The best of {runs_of}, {}, reached a loss of {}{beside}.", row.label, number(loss))
        }
        None => format!("None of {runs_of} learned anything{beside}."),
    };
    let none = || "-".to_string();
    let share = |of: fn(&Row) -> Option<Spread>| percent(own.and_then(|(row, _)| of(row)).map_or(f64::NAN, |s| s.mean));
    let table = [
        ("lowest loss", of(own).unwrap_or_else(none)),
        ("lowest loss in the paper", of(paper).unwrap_or_else(none)),
        ("runs", if failed == 0 { runs.to_string() } else { format!("{runs}, {failed} learned nothing") }),
        ("states of wrong signature (best run)", share(|row| row.wrong_signature)),
        ("energy error of predicted motion (best run)", share(|row| row.energy)),
    ];
    (sentence, table.map(|(what, value)| [what.to_string(), value]).to_vec())
}

/// Rows of the paper's table beside ours, below [`EXPERIMENT_HEADER`]; losses and instabilities in the paper's convention,
/// the mean over the runs with the lowest and the highest.
pub fn experiment_table(rows: &[Row]) -> Vec<Vec<String>> {
    rows.iter()
        .map(|row| {
            let reported = |value: Option<f64>| value.map_or_else(|| "-".to_string(), number);
            let runs =
                if row.failed == 0 { row.runs.to_string() } else { format!("{} ({} failed)", row.runs, row.failed) };
            let energy = |own: Option<Spread>, paper: Option<f64>| match paper {
                Some(paper) => format!("{} (paper {})", spread(own), number(paper)),
                None => spread(own),
            };
            vec![
                row.label.clone(),
                runs,
                spread(row.loss),
                reported(row.reported.loss),
                spread(row.instability),
                reported(row.reported.instability),
                spread(row.normalised_loss),
                spread(row.normalised_instability),
                spread(row.wrong_signature),
                format!("{}/{}", row.integrated.0, row.integrated.1),
                energy(row.energy, row.reported.energy),
                energy(row.regular_energy, row.reported.regular_energy),
                energy(row.chaotic_energy, row.reported.chaotic_energy),
            ]
        })
        .collect()
}

/// Validation loss against seconds of training.
#[derive(Clone, Debug, PartialEq)]
pub struct Curve {
    /// What it is of.
    pub label: String,
    /// Seconds and loss, paper convention.
    pub points: Vec<(f64, f64)>,
}

/// The curve of every finished run.
pub fn experiment_curves(results: &[(Run, Option<Record>)]) -> Vec<Curve> {
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

/// Pictures of an experiment from its finished runs, and `curves` where time matters; what has nothing to show is left out.
pub fn experiment_figures(experiment: &Experiment, results: &[(Run, Option<Record>)], curves: &[Curve]) -> Vec<Figure> {
    let mut figures = Vec::new();
    let mut add = |file: &str, caption: String, plot: LinePlot| {
        figures.extend(kept(&format!("{file}.svg"), line_plot(&plot), caption));
    };
    for (part, word) in [(0, "training"), (1, "validation")] {
        add(
            &format!("{word}_loss"),
            format!("Geometric mean of the {word} losses of each group of runs, paper convention."),
            LinePlot {
                title: format!("{}: {word} loss", experiment.title),
                x_label: "epoch".into(),
                y_label: "loss".into(),
                log_y: true,
                series: loss_curves(results, part),
                turn: None,
                level: None,
            },
        );
    }
    for picture in experiment.pictures {
        match picture {
            Picture::Scan { abscissa } => add(
                "scan",
                format!(
                    "Lowest validation loss of each run against {abscissa}; runs without {abscissa} as a level line."
                ),
                LinePlot {
                    title: format!("{}: lowest loss", experiment.title),
                    x_label: format!("log10 {abscissa}"),
                    y_label: "lowest validation loss".into(),
                    log_y: true,
                    series: scan(results),
                    turn: None,
                    level: None,
                },
            ),
            Picture::TradeOff => add(
                "trade_off",
                "Lowest validation loss against training instability, one point per run; lower left is better.".into(),
                LinePlot {
                    title: format!("{}: loss against instability", experiment.title),
                    x_label: "log10 instability".into(),
                    y_label: "lowest validation loss".into(),
                    log_y: true,
                    series: trade_off(results),
                    turn: None,
                    level: None,
                },
            ),
            Picture::Clock => add(
                "time_to_accuracy",
                "Lowest validation loss so far against seconds of training, paper convention.".into(),
                LinePlot {
                    title: experiment.title.into(),
                    x_label: "log10 of the time of training [s]".into(),
                    y_label: "lowest validation loss".into(),
                    log_y: true,
                    series: reached(curves),
                    turn: None,
                    level: None,
                },
            ),
            Picture::Evaluation(_) => {}
        }
    }
    figures
}

/// Groups in the order of first appearance with their records.
fn groups(results: &[(Run, Option<Record>)], of: fn(&Run) -> &str) -> Vec<(&str, Vec<(&Run, &Record)>)> {
    let mut groups: Vec<(&str, Vec<(&Run, &Record)>)> = Vec::new();
    for (run, record) in results {
        let Some(record) = record else { continue };
        match groups.iter_mut().find(|(name, _)| *name == of(run)) {
            Some((_, members)) => members.push((run, record)),
            None => groups.push((of(run), vec![(run, record)])),
        }
    }
    groups
}

/// One line per group: geometric mean over the runs that still went on, epoch by epoch.
fn loss_curves(results: &[(Run, Option<Record>)], part: usize) -> Vec<Series> {
    let curve = |members: &[(&Run, &Record)]| -> Vec<(f64, f64)> {
        let epochs = members.iter().map(|(_, record)| record.losses.len()).max().unwrap_or(0);
        (0..epochs)
            .map(|epoch| {
                let losses = members.iter().filter_map(|(_, record)| record.losses.get(epoch));
                let logarithms: Vec<f64> =
                    losses.filter_map(|loss| loss[part]).map(f64::ln).filter(|x| x.is_finite()).collect();
                let mean = logarithms.iter().sum::<f64>() / logarithms.len() as f64;
                (epoch as f64 + 1.0, mean.exp())
            })
            .collect()
    };
    let lines = groups(results, |run| if run.group.is_empty() { &run.label } else { &run.group });
    lines
        .iter()
        .map(|(name, members)| Series { name: (*name).to_string(), points: curve(members), over: false })
        .collect()
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
