//! Headlines: what was learned and how good it is, in one sentence and a short table. They appear above the tables on a terminal and at the
//! beginning of a report.

use crate::analysis::{PredictionError, ValidTimes};
use crate::experiments::{Row, RunSpread};
use crate::findings::Findings;
use crate::formula::{FoundFormula, Verdict};
use crate::names::{number, percent, pluralize};
use crate::pipeline::determination::Determined;
use crate::pipeline::evaluation::Evaluation;
use crate::pipeline::force_errors::{ForceError, judged as judged_by_forces};
use crate::pipeline::hold_out::{HoldOut, factor, is_better};
use crate::pipeline::thresholds::{BAD_SHARE_OF_TIME, GOOD_LYAPUNOV_TIMES, MOST_WRONG_SIGNATURES, UNACCOUNTED_ENERGY};

/// A headline.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Headline {
    /// The result in a sentence.
    pub sentence: String,
    /// Quantities with their values.
    pub rows: Vec<[String; 2]>,
}

impl Headline {
    /// The beginning of a report.
    pub fn findings(&self) -> Findings {
        let mut findings = Findings::default();
        findings.summary(&self.sentence, &self.rows);
        findings
    }
}

/// The unit after a number, or a word if there is no unit.
fn spoken(unit: &str) -> &str {
    if unit == "1" { "units" } else { unit }
}

/// Splits `name [unit]` into name and unit.
pub(crate) fn named(text: &str) -> (&str, &str) {
    text.split_once(" [").map_or((text, ""), |(name, unit)| (name, unit.trim_end_matches(']')))
}

/// Describes a time of valid prediction: `12.3 s`, `at least 100 s`, `8.4 Lyapunov times (12.3 s)`.
fn valid_time(valid: &ValidTimes, unit: &str) -> String {
    let bound = |at_least: bool| if at_least { "at least " } else { "" };
    let plain = format!("{}{} {unit}", bound(valid.at_least), number(valid.median));
    match valid.lyapunov_times {
        Some(times) => format!("{}{} Lyapunov times ({plain})", bound(valid.lyapunov_at_least), number(times)),
        None => plain,
    }
}

/// Names a time of valid prediction, with its threshold and the number of values in the median.
fn valid_name(valid: &ValidTimes, [one, many]: [&str; 2]) -> String {
    format!(
        "Prediction valid (error below {} of the spread of the motion), median of {}",
        valid.threshold,
        pluralize(valid.starts, one, many)
    )
}

/// Headline for a model of a known system, named `title`.
pub(crate) fn of_evaluation(title: &str, found: &Evaluation) -> Headline {
    let mass = found.mass_matrix.error.median;
    let equivalence = found.physics.equivalence.as_ref();
    let free = match found.mass_matrix.groups {
        0 | 1 => "one factor".to_string(),
        groups => format!("a factor for each of {groups} decoupled groups of coordinates"),
    };
    let matrix = match equivalence.map(|found| found.mass_matrix).filter(|x| x.is_finite()) {
        Some(difference) => format!("it gives the mass matrix to {} up to {free}", percent(difference)),
        None if mass.is_finite() => format!("it gives the mass matrix to {} up to {free}", percent(mass)),
        None => "its mass matrix cannot be compared".to_string(),
    };
    let predicts = found.valid_time.as_ref().map(|valid| predicted(valid, found.tested, spoken(&found.time_unit)));
    let wrong = match found.wrong_signature {
        share if share > MOST_WRONG_SIGNATURES => {
            format!(" At {} of the states its mass matrix has the wrong signature.", percent(share))
        }
        _ => String::new(),
    };
    let sentence = match predicts {
        Some(predicts) => format!("{title}: {predicts}; {matrix}.{wrong}"),
        None => format!("{title}: no motion was predicted; {matrix}.{wrong}"),
    };
    let mut rows: Vec<[String; 2]> = Vec::new();
    let mut add = |what: &str, value: String| rows.push([what.to_string(), value]);
    if let Some(valid) = &found.valid_time {
        add(&valid_name(valid, ["start", "starts"]), valid_time(valid, spoken(&found.time_unit)));
    }
    let errors = found.coordinates.iter().zip(&found.accelerations).map(|(coordinate, error)| {
        let (name, unit) = named(coordinate);
        format!("{name} {} {unit}", number(error.median))
    });
    add("Accelerations of fresh states, median error", errors.collect::<Vec<_>>().join(", "));
    if let Some(found) = equivalence {
        add("Difference from the exact Lagrangian, up to a factor and a gauge term", found.text());
    }
    add("Mass matrix at rest, median error", percent(mass));
    let mut energies: Vec<f64> = found.trajectories.iter().map(|t| t.summary.energy_error.mean).collect();
    energies.retain(|x| x.is_finite());
    let energy = energies.iter().sum::<f64>() / energies.len() as f64;
    add("Exact energy along the predicted motions, mean error", percent(energy));
    add("Fresh states whose mass matrix has the wrong signature", percent(found.wrong_signature));
    Headline { sentence, rows }
}

/// Describes predictions compared with exact motion over the time `tested`.
fn predicted(valid: &ValidTimes, tested: f64, unit: &str) -> String {
    let time = valid_time(valid, unit);
    let (until, tested) = (tested, format!("{} {unit}", number(tested)));
    if valid.at_least {
        return format!("good: the learned Lagrangian predicts the motion for all of the {tested} that were tested");
    }
    match valid.lyapunov_times {
        Some(times) if times >= GOOD_LYAPUNOV_TIMES => {
            format!("good: the learned Lagrangian predicts the chaotic motion for {time}, of {tested} that were tested")
        }
        times if times.map_or(valid.median < BAD_SHARE_OF_TIME * until, |times| times < 1.0) => {
            format!("bad: predictions are useful for no more than {time}; {tested} were tested")
        }
        _ => format!("limited: useful for {time} of prediction, and wrong beyond; {tested} were tested"),
    }
}

/// Headline for a model, called `name`, of recorded motion, and for a formula of the same motion if one was sought.
///
/// A model is good if all hold: its predictions reach at least one period of the fastest motion, every coordinate is predicted better than
/// at constant velocity, at most half of the held-out states lie outside the learned ones, the energy is accounted for to 10 %, and the
/// data determine a mass. Otherwise the sentence says which condition fails.
pub(crate) fn of_hold_out(
    name: &str,
    found: &HoldOut,
    determined: &Determined,
    formula: Option<&FoundFormula>,
) -> Headline {
    let of_network = of_network(name, found, &failures(found, determined));
    let Some(formula) = formula.filter(|formula| formula.verdict == Verdict::Found) else { return of_network };
    let network = of_network.sentence.strip_prefix(&format!("{name}: ")).unwrap_or(&of_network.sentence);
    let sentence =
        format!("{name}: a formula explains the motion, L = {}. The network is {network}", formula.text(false));
    Headline { sentence, ..of_network }
}

/// Lists the weaknesses of a model, each as a clause.
fn failures(found: &HoldOut, determined: &Determined) -> Vec<String> {
    let mut all = Vec::new();
    if let Some(error) = found.model.last() {
        match found.fastest_period {
            Some(period) if error.seconds >= period => {}
            Some(period) => all.push(format!(
                "predictions were tried for {} s, less than one period of the fastest motion ({} s)",
                number(error.seconds),
                number(period)
            )),
            None => all.push("the held-out motion is shorter than one period of it".to_string()),
        }
    }
    let straight = found.by_coordinate.iter().filter(|c| {
        let ends = c.model.last().zip(c.constant_velocity.last());
        !ends.is_some_and(|(model, straight)| is_better(*model, *straight))
    });
    let straight: Vec<&str> = straight.map(|c| c.name.as_str()).collect();
    if !straight.is_empty() {
        all.push(format!("the prediction of {} is no better than constant velocity", straight.join(", ")));
    }
    if let Some(share) = determined.mostly_outside() {
        all.push(format!("{} of the held-out states lie outside the learned ones", percent(share)));
    }
    match found.energy.map(|balance| balance.unaccounted()) {
        Some(share) if share <= UNACCOUNTED_ENERGY => {}
        Some(share) if share.is_finite() => {
            all.push(format!("energy of {} of the mean kinetic energy is not accounted for", percent(share)));
        }
        _ => all.push("its energy is not finite".to_string()),
    }
    all.extend(determined.no_mass());
    all
}

/// Adds a verdict and the weaknesses to a sentence.
fn with_failures(sentence: String, failures: &[String]) -> String {
    let all = failures.join("; ");
    match (sentence.strip_prefix("good: "), sentence.strip_prefix("limited: ")) {
        _ if failures.is_empty() => sentence,
        (Some(rest), _) => format!("limited: {all}; otherwise {rest}"),
        (_, Some(rest)) => format!("limited: {all}; {rest}"),
        _ => format!("{sentence} Besides: {all}."),
    }
}

/// Headline for the network of a fit with these `failures`.
fn of_network(name: &str, found: &HoldOut, failures: &[String]) -> Headline {
    let signature = || {
        let what = "Held-out states whose mass matrix has the wrong signature".to_string();
        found.wrong_signature.is_finite().then(|| [what, percent(found.wrong_signature)])
    };
    let forces = |error: &ForceError| {
        [format!("Squared error of the force of {} over its variance", error.name), percent(error.nmse)]
    };
    if !found.force_errors.is_empty() {
        let rows = found.force_errors.iter().map(forces).chain(signature()).collect();
        let sentence = with_failures(judged_by_forces(&found.force_errors), failures);
        return Headline { sentence: format!("{name}: {sentence}"), rows };
    }
    let Some((model, straight)) = found.model.last().zip(found.constant_velocity.last()) else {
        let sentence = format!(
            "{name}: a Lagrangian was learned; its predictions were not tested, because no motion was held out."
        );
        return Headline { sentence, rows: signature().into_iter().collect() };
    };
    let of = |x: f64| if x.is_finite() { format!("{} {}", number(x), found.error_unit) } else { "-".to_string() };
    let mut rows: Vec<[String; 2]> = Vec::new();
    if let Some(valid) = &found.valid_time {
        rows.push([valid_name(valid, ["held-out window", "held-out windows"]), valid_time(valid, "s")]);
    }
    rows.extend([
        [format!("Median error {} s ahead", number(model.seconds)), of(model.median)],
        ["The same at constant velocity".to_string(), of(straight.median)],
    ]);
    // With a single coordinate both numbers would be equal.
    let several = found.by_coordinate.len() > 1;
    let apart = found.by_coordinate.iter().filter(|_| several).filter_map(|c| {
        let errors = [c.model.last()?, c.constant_velocity.last()?].map(|x| number(*x));
        Some([
            format!("Of {}", c.name),
            format!("{} {}, at constant velocity {} {}", errors[0], c.unit, errors[1], c.unit),
        ])
    });
    rows.extend(apart);
    rows.extend(signature());
    let sentence = with_failures(judged(found, model, straight), failures);
    Headline { sentence: format!("{name}: {sentence}"), rows }
}

/// Compares predictions of held-out motion with constant velocity, in a sentence with a verdict.
fn judged(found: &HoldOut, model: &PredictionError, straight: &PredictionError) -> String {
    let (Some(useful), true) = (&found.useful_time, model.median.is_finite()) else {
        return "bad: the learned Lagrangian fails to predict most of the motion that it has not seen.".to_string();
    };
    let compared = match factor(model, straight) {
        Some(factor) => format!(", {} times more", number(factor)),
        None => String::new(),
    };
    let errors = format!(
        "{} s ahead it is off by {} {} (median), going on at constant velocity by {}{compared}.",
        number(model.seconds),
        number(model.median),
        found.error_unit,
        number(straight.median)
    );
    let verdict = match useful.seconds {
        _ if useful.at_least => {
            "good: the learned Lagrangian is useful for all of the time ahead that was tested".to_string()
        }
        0.0 => "bad: the learned Lagrangian predicts motion that it has not seen no better than constant velocity"
            .to_string(),
        seconds => {
            let valid = found.valid_time.as_ref().map_or(0.0, |valid| valid.median);
            let beyond = if seconds < valid { "no better than constant velocity beyond" } else { "and wrong beyond" };
            format!("limited: useful for {} s of prediction, {beyond}", number(seconds))
        }
    };
    format!("{verdict}; {errors}")
}

/// Headline for an experiment: its best row next to the paper's best, and the number of rows that are better than the paper.
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
            match below {
                _ if below == all => format!(": good, below the paper's in all {all} rows for which it states one"),
                0 => format!(": bad, above the paper's in all {all} rows for which it states one"),
                _ => format!(": below the paper's in {below} of {all} rows for which it states one"),
            }
        }
    };
    let sentence = match own {
        Some(own) => format!("Lowest loss {}{below}.", of(own)),
        None => "No run learned anything.".to_string(),
    };
    let share =
        |of: fn(&Row) -> Option<RunSpread>| percent(own.and_then(|(row, _)| of(row)).map_or(f64::NAN, |s| s.mean));
    let stated = paper.map(|paper| ("Lowest loss in the paper", of(paper)));
    let table = [
        ("Runs", if failed == 0 { runs.to_string() } else { format!("{runs}, {failed} learned nothing") }),
        ("States of wrong signature (best row)", share(|row| row.wrong_signature)),
        ("Energy error of predicted motion (best row)", share(|row| row.energy)),
    ];
    Headline {
        sentence,
        rows: stated.into_iter().chain(table).map(|(what, value)| [what.to_string(), value]).collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::analysis::VALID;
    use crate::experiments::Reported;
    use crate::pipeline::energy::Balance;
    use crate::pipeline::hold_out::{CoordinatePredictions, UsefulTime};
    use crate::report::Report;

    fn valid(median: f64, at_least: bool) -> ValidTimes {
        let (lyapunov_times, lyapunov_at_least) = (None, false);
        ValidTimes { threshold: VALID, median, at_least, starts: 4, lyapunov_times, lyapunov_at_least, chaotic: 0 }
    }

    #[test]
    fn headlines_of_predictions_say_good_or_bad() {
        let error = |median: f64| PredictionError { seconds: 0.5, rms: 1.0, median, p90: 2.0, windows: 9, missing: 0 };
        let said = |model: f64, seconds: f64, at_least: bool, (until, open): (f64, bool)| {
            let found = HoldOut {
                error_unit: "rad",
                model: vec![error(model)],
                constant_velocity: vec![error(1.0)],
                valid_time: Some(valid(until, open)),
                useful_time: Some(UsefulTime { seconds, at_least }),
                wrong_signature: 0.0,
                ..HoldOut::nothing()
            };
            of_network("swing", &found, &[]).sentence
        };
        let good = said(0.01, 0.5, true, (0.5, true));
        assert!(
            good.starts_with("swing: good: ") && good.contains("0.0100 rad") && good.contains("100 times"),
            "{good}"
        );
        let limited = said(2.0, 0.29, false, (0.5, true));
        assert!(
            limited.starts_with("swing: limited: useful for 0.290 s") && limited.contains("no better than"),
            "{limited}"
        );
        let wrong = said(0.9, 0.29, false, (0.29, false));
        assert!(wrong.starts_with("swing: limited: useful for 0.290 s") && wrong.contains("wrong beyond"), "{wrong}");
        assert!(said(2.0, 0.0, false, (0.5, true)).starts_with("swing: bad: "));
        assert!(said(f64::INFINITY, 0.0, false, (0.1, false)).starts_with("swing: bad: "));

        assert!(predicted(&valid(100.0, true), 100.0, "s").starts_with("good: "));
        assert!(predicted(&valid(7.0, false), 100.0, "s").starts_with("limited: useful for 7.00 s"));
        let chaotic = ValidTimes { lyapunov_times: Some(8.0), ..valid(7.0, false) };
        assert!(predicted(&chaotic, 100.0, "s").starts_with("good: "));
        assert!(predicted(&valid(0.0, false), 100.0, "s").starts_with("bad: "));
    }

    /// One failure is enough.
    #[test]
    fn a_model_is_good_only_if_everything_holds() {
        let sentence = |verdict: &str, all: &[&str]| {
            let all: Vec<String> = all.iter().map(|text| (*text).to_string()).collect();
            with_failures(format!("{verdict}: it predicts; 3 s ahead."), &all)
        };
        assert_eq!(sentence("good", &[]), "good: it predicts; 3 s ahead.");
        let limited = sentence("good", &["no mass", "no energy"]);
        assert!(limited.starts_with("limited: no mass; no energy; ") && !limited.contains("good"), "{limited}");
        assert!(sentence("limited", &["no mass"]).starts_with("limited: no mass; it predicts"));
        assert_eq!(sentence("bad", &["no mass"]), "bad: it predicts; 3 s ahead. Besides: no mass.");

        let nothing = Determined::under_constraints();
        let errors = |model: f64| CoordinatePredictions {
            name: "x".to_string(),
            unit: "SI",
            model: vec![model],
            constant_velocity: vec![1.0],
        };
        let balance = |defect_rms| Balance { trajectories: 1, kinetic: 2.0, defect_rms, ..Balance::default() };
        let found = |seconds, x: f64, defect| {
            let error = PredictionError { seconds, rms: 1.0, median: x, p90: 1.0, windows: 9, missing: 0 };
            HoldOut {
                model: vec![error],
                fastest_period: Some(2.0),
                by_coordinate: vec![errors(x)],
                energy: Some(balance(defect)),
                ..HoldOut::nothing()
            }
        };
        let count = |seconds, x, defect| failures(&found(seconds, x, defect), &nothing).len();
        // Under constraints no mass is determined.
        assert_eq!(
            [count(2.0, 0.1, 0.1), count(1.9, 0.1, 0.1), count(1.9, 0.99, 0.1), count(1.9, 0.99, 0.3)],
            [1, 2, 3, 4]
        );
        assert_eq!([count(2.0, f64::NAN, 0.1), count(2.0, 0.1, f64::NAN)], [2, 2]);
    }

    #[test]
    fn valid_times_say_what_they_are() {
        let plain = valid(12.34, false);
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
        let spread = |x: f64| Some(RunSpread { mean: x, median: x, low: x, high: x });
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
            found.findings().to_string(),
            "Lowest loss 0.125 (b): below the paper's in 1 of 2 rows for which it states one.\n\
             Lowest loss in the paper: 0.250 (a)\n\
             Runs: 6, 1 learned nothing\n\
             States of wrong signature (best row): 1.00 %\n\
             Energy error of predicted motion (best row): -\n"
        );
        assert_eq!(of_experiment(&rows[2..]).sentence, "No run learned anything.");
        let page = Report::new("Experiment").findings(&found.findings()).to_html();
        assert!(page.contains(&found.sentence.replace('\'', "&#39;")) || page.contains(&found.sentence), "{page}");
    }
}
