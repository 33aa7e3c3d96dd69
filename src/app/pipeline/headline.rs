//! Headlines: what was learned and how good it is, in one sentence and a short table. They stand above the tables of a
//! terminal and at the beginning of a report.

use crate::analysis::{PredictionError, ValidTimes};
use crate::experiments::{Row, Spread};
use crate::names::{counted, number, percent};
use crate::pipeline::evaluation::Evaluation;
use crate::pipeline::hold_out::{HoldOut, factor};
use crate::report::Report;

/// A headline.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Headline {
    /// The result in a sentence.
    pub sentence: String,
    /// Quantities with their values.
    pub rows: Vec<[String; 2]>,
}

impl Headline {
    /// Lines for a terminal: the sentence, then one line per quantity.
    pub fn text(&self) -> String {
        let rows = self.rows.iter().map(|[what, value]| format!("{what}: {value}\n"));
        format!("{}\n{}", self.sentence, rows.collect::<String>())
    }

    /// The same at the beginning of a report.
    pub fn begin(&self, report: Report) -> Report {
        report.summary(&self.sentence, &self.rows)
    }
}

/// Name and unit of `name [unit]`.
pub(crate) fn named(text: &str) -> (&str, &str) {
    text.split_once(" [").map_or((text, ""), |(name, unit)| (name, unit.trim_end_matches(']')))
}

/// A time of valid prediction: `12.3 s`, `at least 100 s`, `8.4 Lyapunov times (12.3 s)`.
fn valid_time(valid: &ValidTimes, unit: &str) -> String {
    let bound = |at_least: bool| if at_least { "at least " } else { "" };
    let plain = format!("{}{} {unit}", bound(valid.at_least), number(valid.median));
    match valid.lyapunov_times {
        Some(times) => format!("{}{} Lyapunov times ({plain})", bound(valid.lyapunov_at_least), number(times)),
        None => plain,
    }
}

/// Name of a time of valid prediction, with its threshold and the count that it is a median of.
fn valid_name(valid: &ValidTimes, [one, many]: [&str; 2]) -> String {
    format!(
        "Prediction valid (error below {} of the spread of the motion), median of {}",
        valid.threshold,
        counted(valid.starts, one, many)
    )
}

/// A model of a system that is known: `title` names it.
pub(crate) fn of_evaluation(title: &str, found: &Evaluation) -> Headline {
    let mass = found.mass_matrix.error.median;
    let common = found.physics.common_ground.as_ref();
    let matrix = match common.map(|common| common.mass_matrix).filter(|x| x.is_finite()) {
        Some(left) => format!("gives the mass matrix to {} up to one factor", percent(left)),
        None if mass.is_finite() => format!("gives the mass matrix to {} up to one factor", percent(mass)),
        None => "gives no mass matrix that can be compared".to_string(),
    };
    let predicts = match &found.valid_time {
        Some(valid) => format!(", and predicts the motion for {}", valid_time(valid, &found.time_unit)),
        None => String::new(),
    };
    let mut rows: Vec<[String; 2]> = Vec::new();
    let mut add = |what: &str, value: String| rows.push([what.to_string(), value]);
    if let Some(valid) = &found.valid_time {
        add(&valid_name(valid, ["start", "starts"]), valid_time(valid, &found.time_unit));
    }
    let errors = found.coordinates.iter().zip(&found.accelerations).map(|(coordinate, error)| {
        let (name, unit) = named(coordinate);
        format!("{name} {} {unit}", number(error.median))
    });
    add("Accelerations of fresh states, median error", errors.collect::<Vec<_>>().join(", "));
    if let Some(common) = common {
        add("Left of the learned Lagrangian beside factor and gauge", common.text());
    }
    add("Mass matrix at rest, median error", percent(mass));
    let mut energies: Vec<f64> = found.trajectories.iter().map(|t| t.summary.energy_error.mean).collect();
    energies.retain(|x| x.is_finite());
    let energy = energies.iter().sum::<f64>() / energies.len() as f64;
    add("Exact energy along the predicted motions, mean error", percent(energy));
    add("Fresh states whose mass matrix has the wrong signature", percent(found.wrong_signature));
    Headline { sentence: format!("{title}: the learned Lagrangian {matrix}{predicts}."), rows }
}

/// A model of recorded motion called `name`, whose coordinates are in `unit`.
pub(crate) fn of_hold_out(name: &str, found: &HoldOut, unit: &str) -> Headline {
    let signature = || {
        let what = "Held-out states whose mass matrix has the wrong signature".to_string();
        found.wrong_signature.is_finite().then(|| [what, percent(found.wrong_signature)])
    };
    let Some((model, straight)) = found.model.last().zip(found.constant_velocity.last()) else {
        let sentence = format!("{name}: a Lagrangian was learned; no held-out motion judges its predictions.");
        return Headline { sentence, rows: signature().into_iter().collect() };
    };
    let valid = found.valid_time.as_ref().map(|valid| (valid, valid_time(valid, "s")));
    let of = |x: f64| if x.is_finite() { format!("{} {unit}", number(x)) } else { "-".to_string() };
    let mut rows: Vec<[String; 2]> = Vec::new();
    if let Some((valid, time)) = &valid {
        rows.push([valid_name(valid, ["held-out window", "held-out windows"]), time.clone()]);
    }
    rows.extend([
        [format!("Median error {} s ahead", number(model.seconds)), of(model.median)],
        ["The same at constant velocity".to_string(), of(straight.median)],
    ]);
    rows.extend(signature());
    let time = valid.map(|(_, time)| time);
    Headline { sentence: format!("{name}: {}", predicted(model, straight, time.as_deref(), unit)), rows }
}

/// Prediction of held-out motion beside going on at constant velocity, in a sentence; `valid` is the time of valid prediction.
fn predicted(model: &PredictionError, straight: &PredictionError, valid: Option<&str>, unit: &str) -> String {
    let (Some(valid), true) = (valid, model.median.is_finite()) else {
        return "the learned Lagrangian fails to predict most of the motion that it has not seen.".to_string();
    };
    let compared = match factor(model, straight) {
        Some(factor) => format!(", {} times more", number(factor)),
        None => ": the model is no better".to_string(),
    };
    format!(
        "the learned Lagrangian predicts motion that it has not seen for {valid}; {} s ahead it is off by {} {unit} (median), \
         going on at constant velocity by {}{compared}.",
        number(model.seconds),
        number(model.median),
        number(straight.median)
    )
}

/// An experiment: its best row beside the paper's best, and in how many rows it is below the paper.
pub(crate) fn of_experiment(rows: &[Row]) -> Headline {
    let lowest = |of: fn(&Row) -> Option<f64>| {
        let known = rows.iter().filter_map(|row| Some((row, of(row).filter(|loss| loss.is_finite())?)));
        known.min_by(|a, b| a.1.total_cmp(&b.1))
    };
    let (runs, failed) = rows.iter().fold((0, 0), |(runs, failed), row| (runs + row.runs, failed + row.failed));
    let (own, paper) = (lowest(|row| row.loss.map(|loss| loss.mean)), lowest(|row| row.reported.loss));
    let of = |(row, loss): (&Row, f64)| format!("{} ({})", number(loss), row.label);
    let compared: Vec<bool> = rows.iter().filter_map(|row| Some(row.loss?.mean < row.reported.loss?)).collect();
    let below = match compared.len() {
        0 => String::new(),
        all => {
            let below = compared.iter().filter(|below| **below).count();
            format!("; below the paper's in {below} of {all} rows for which it states one")
        }
    };
    let sentence = match own {
        Some(own) => format!("Lowest loss {}{below}.", of(own)),
        None => "No run learned anything.".to_string(),
    };
    let or_none = |found: Option<String>| found.unwrap_or_else(|| "-".to_string());
    let share = |of: fn(&Row) -> Option<Spread>| percent(own.and_then(|(row, _)| of(row)).map_or(f64::NAN, |s| s.mean));
    let table = [
        ("Lowest loss in the paper", or_none(paper.map(of))),
        ("Runs", if failed == 0 { runs.to_string() } else { format!("{runs}, {failed} learned nothing") }),
        ("States of wrong signature (best row)", share(|row| row.wrong_signature)),
        ("Energy error of predicted motion (best row)", share(|row| row.energy)),
    ];
    Headline { sentence, rows: table.map(|(what, value)| [what.to_string(), value]).to_vec() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::analysis::VALID;
    use crate::experiments::Reported;

    #[test]
    fn predictions_are_compared_with_constant_velocity() {
        let error = |median: f64| PredictionError { seconds: 0.5, rms: 1.0, median, p90: 2.0, windows: 9, missing: 0 };
        let said = |model, straight| predicted(&error(model), &error(straight), Some("1.20 s"), "rad");
        assert_eq!(
            said(0.0196, 1.96),
            "the learned Lagrangian predicts motion that it has not seen for 1.20 s; 0.500 s ahead it is off by 0.0196 rad \
             (median), going on at constant velocity by 1.96, 100 times more."
        );
        assert!(said(2.0, 1.0).ends_with("by 1.00: the model is no better."));
        assert!(said(f64::INFINITY, 1.0).contains("fails to predict"));
        assert!(predicted(&error(1.0), &error(1.0), None, "rad").contains("fails to predict"));
    }

    #[test]
    fn valid_times_say_what_they_are() {
        let plain = ValidTimes {
            threshold: VALID,
            median: 12.34,
            at_least: false,
            starts: 4,
            lyapunov_times: None,
            lyapunov_at_least: false,
            chaotic: 0,
        };
        assert_eq!(valid_time(&plain, "s"), "12.3 s");
        assert_eq!(valid_time(&ValidTimes { median: 100.0, at_least: true, ..plain }, "m"), "at least 100 m");
        let chaotic = ValidTimes { lyapunov_times: Some(8.41), ..plain };
        assert_eq!(valid_time(&chaotic, "s"), "8.41 Lyapunov times (12.3 s)");
        assert!(
            valid_name(&plain, ["start", "starts"])
                .ends_with("(error below 0.4 of the spread of the motion), median of 4 starts")
        );
    }

    #[test]
    fn experiments_stand_beside_the_paper() {
        let spread = |x: f64| Some(Spread { mean: x, low: x, high: x });
        let row = |label: &str, loss, paper, failed| Row {
            label: label.into(),
            runs: 2,
            failed,
            loss,
            instability: None,
            normalised_loss: None,
            normalised_instability: None,
            wrong_signature: spread(0.01),
            energy: None,
            regular_energy: None,
            chaotic_energy: None,
            integrated: (0, 0),
            reported: Reported {
                loss: paper,
                instability: None,
                energy: None,
                regular_energy: None,
                chaotic_energy: None,
            },
        };
        let rows =
            [row("a", spread(0.5), Some(0.25), 0), row("b", spread(0.125), Some(0.75), 1), row("c", None, None, 0)];
        let found = of_experiment(&rows);
        assert_eq!(
            found.text(),
            "Lowest loss 0.125 (b); below the paper's in 1 of 2 rows for which it states one.\n\
             Lowest loss in the paper: 0.250 (a)\n\
             Runs: 6, 1 learned nothing\n\
             States of wrong signature (best row): 1.00 %\n\
             Energy error of predicted motion (best row): -\n"
        );
        assert_eq!(of_experiment(&rows[2..]).sentence, "No run learned anything.");
        let page = found.begin(Report::new("Experiment")).to_html();
        assert!(page.contains(&found.sentence.replace('\'', "&#39;")) || page.contains(&found.sentence), "{page}");
    }
}
