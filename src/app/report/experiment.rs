//! The table of an experiment, with published numbers next to ours, and its loss curves.

use super::{DataTable, Figure, LinePlot, Series, figure, line_plot};
use crate::experiments::{Record, Row, Run, RunSpread};
use crate::names::rounded;
use serde_json::json;

/// A quantity of a row, and the published number for it if there is one.
type Quantity = (&'static str, fn(&Row) -> Option<RunSpread>, Option<fn(&Row) -> Option<f64>>);

/// Quantities of the table of an experiment, in the order of its columns.
const QUANTITIES: [Quantity; 8] = [
    ("loss", |row| row.loss, Some(|row| row.reported.loss)),
    ("instability", |row| row.instability, Some(|row| row.reported.instability)),
    ("energy_error", |row| row.energy, Some(|row| row.reported.energy)),
    ("regular_energy_error", |row| row.regular_energy, Some(|row| row.reported.regular_energy)),
    ("chaotic_energy_error", |row| row.chaotic_energy, Some(|row| row.reported.chaotic_energy)),
    ("wrong_signature", |row| row.wrong_signature, None),
    ("physical_loss", |row| row.normalised_loss, None),
    ("physical_instability", |row| row.normalised_instability, None),
];

/// Rows of an experiment as numbers: of every quantity median, lowest and highest over the runs, and the paper's figure where it may state
/// one; losses and instabilities in the paper's convention, errors and wrong signatures as fractions.
pub fn experiment_table(rows: &[Row]) -> DataTable {
    let mut header = ["row", "runs", "failed", "integrated", "starts"].map(String::from).to_vec();
    for (name, _, paper) in QUANTITIES {
        header.extend(["median", "low", "high"].map(|which| format!("{name}_{which}")));
        header.extend(paper.map(|_| format!("{name}_paper")));
    }
    let cells = |row: &Row| {
        let mut cells = vec![json!(row.label), json!(row.runs), json!(row.failed)];
        cells.extend([json!(row.integrated.0), json!(row.integrated.1)]);
        for (_, of, paper) in QUANTITIES {
            let spread = of(row);
            cells.extend([spread.map(|s| s.median), spread.map(|s| s.low), spread.map(|s| s.high)].map(|x| json!(x)));
            cells.extend(paper.map(|paper| json!(paper(row))));
        }
        cells
    };
    DataTable { header, rows: rows.iter().map(cells).collect() }
}

/// Header of the table for people, with units.
const VIEW_HEADER: [&str; 16] = [
    "run",
    "runs",
    "loss here [1]",
    "loss paper [1]",
    "instability here [1]",
    "instability paper [1]",
    "energy error here [%]",
    "energy error paper [%]",
    "regular motions here [%]",
    "regular motions paper [%]",
    "chaotic motions here [%]",
    "chaotic motions paper [%]",
    "integrated",
    "wrong signature [%]",
    "physical loss [SI]",
    "physical instability [SI]",
];

/// Shown if there is no number.
const NONE: &str = "-";

/// Formats a number times a factor with three digits.
fn one(x: Option<f64>, factor: f64) -> String {
    x.map_or_else(|| NONE.to_string(), |x| rounded(factor * x, 3))
}

/// Formats a spread as `mean [low, high]`, or as the value alone if all runs agree.
fn spread(value: Option<RunSpread>, factor: f64) -> String {
    let Some(RunSpread { mean, low, high, .. }) = value else { return NONE.to_string() };
    let [mean, least, most] = [mean, low, high].map(|x| one(Some(x), factor));
    if low == high { mean } else { format!("{mean} [{least}, {most}]") }
}

fn view(row: &Row) -> Vec<String> {
    let runs = if row.failed == 0 { row.runs.to_string() } else { format!("{} ({} failed)", row.runs, row.failed) };
    let reported = row.reported;
    vec![
        row.label.clone(),
        runs,
        spread(row.loss, 1.0),
        one(reported.loss, 1.0),
        spread(row.instability, 1.0),
        one(reported.instability, 1.0),
        spread(row.energy, 100.0),
        one(reported.energy, 100.0),
        spread(row.regular_energy, 100.0),
        one(reported.regular_energy, 100.0),
        spread(row.chaotic_energy, 100.0),
        one(reported.chaotic_energy, 100.0),
        format!("{}/{}", row.integrated.0, row.integrated.1),
        spread(row.wrong_signature, 100.0),
        spread(row.normalised_loss, 1.0),
        spread(row.normalised_instability, 1.0),
    ]
}

/// Rows for people, with their header: the mean over the runs with the lowest and the highest, fractions in per cent, three digits. A column
/// is shown if it has a number, ours also if the paper's next to it has one.
pub fn experiment_view(rows: &[Row]) -> (Vec<&'static str>, Vec<Vec<String>>) {
    let all: Vec<Vec<String>> = rows.iter().map(view).collect();
    let known = |k: usize| all.iter().any(|row| row[k] != NONE);
    let beside = |k: usize| VIEW_HEADER[k].contains(" here ") && known(k + 1);
    let shown: Vec<usize> = (0..VIEW_HEADER.len()).filter(|&k| known(k) || beside(k)).collect();
    let pick = |row: &Vec<String>| shown.iter().map(|&k| row[k].clone()).collect();
    (shown.iter().map(|&k| VIEW_HEADER[k]).collect(), all.iter().map(pick).collect())
}

/// Loss curves of an experiment from its finished runs; empty curves are left out.
pub fn loss_figures(results: &[(Run, Option<Record>)]) -> Vec<Figure> {
    let of = |(part, word): (usize, &str)| {
        let plot = LinePlot {
            x_label: "epoch".into(),
            y_label: "loss".into(),
            log_y: true,
            series: loss_curves(results, part),
            ..LinePlot::default()
        };
        let heading = format!("How the {word} loss falls from epoch to epoch");
        let caption = format!("Geometric mean of the {word} losses of each group of runs, paper convention.");
        figure(&format!("{word}_loss.svg"), heading, line_plot(&plot), caption)
    };
    [(0, "training"), (1, "validation")].into_iter().filter_map(of).collect()
}

/// Groups in the order of first appearance with their records.
pub fn groups(results: &[(Run, Option<Record>)], of: fn(&Run) -> &str) -> Vec<(&str, Vec<(&Run, &Record)>)> {
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

/// One line per group: geometric mean over the runs that have not ended, epoch by epoch.
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiments::Reported;

    #[test]
    fn our_figures_and_the_papers_stand_side_by_side() {
        let spread = |mean: f64, by: f64| Some(RunSpread { mean, median: mean, low: mean - by, high: mean + by });
        let row = Row {
            label: "triple-pendulum".into(),
            runs: 3,
            failed: 0,
            loss: spread(0.0123456, 0.001),
            instability: None,
            normalised_loss: None,
            normalised_instability: None,
            wrong_signature: spread(0.0, 0.0),
            energy: spread(0.05, 0.0),
            regular_energy: spread(4.6e-4, 0.0),
            chaotic_energy: spread(0.0029, 0.0),
            integrated: (12, 12),
            reported: Reported {
                loss: Some(0.01972),
                instability: None,
                energy: None,
                regular_energy: Some(0.0058),
                chaotic_energy: Some(0.19),
            },
        };
        let (header, rows) = experiment_view(std::slice::from_ref(&row));
        let at = |name: &str| rows[0][header.iter().position(|h| *h == name).unwrap()].as_str();
        assert_eq!((at("loss here [1]"), at("loss paper [1]")), ("0.0123 [0.0113, 0.0133]", "0.0197"));
        assert_eq!((at("regular motions here [%]"), at("regular motions paper [%]")), ("0.0460", "0.580"));
        assert_eq!((at("chaotic motions here [%]"), at("chaotic motions paper [%]")), ("0.290", "19.0"));
        // Empty columns are left out, for people only.
        assert!(!header.iter().any(|name| name.contains("instability") || *name == "energy error paper [%]"));
        let file = experiment_table(&[row]).objects().remove(0);
        let number = |name: &str| file[name].as_f64();
        let loss = ["loss_median", "loss_low", "loss_high", "loss_paper"].map(number);
        assert_eq!(loss, [0.0123456, 0.0123456 - 0.001, 0.0123456 + 0.001, 0.01972].map(Some));
        assert_eq!(
            (number("regular_energy_error_median"), number("regular_energy_error_paper")),
            (Some(4.6e-4), Some(0.0058))
        );
        assert!(file["instability_median"].is_null() && file["failed"] == 0 && file["starts"] == 12);
    }
}
