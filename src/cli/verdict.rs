//! The beginning of a report: what was learned and how good it is, in one sentence and a short table.

use crate::analysis::ValidTimes;
use crate::cli::evaluation::Evaluation;
use crate::cli::judgement::Judgement;
use crate::names::{counted, number, percent};

/// Rows of a short table: what, and how much.
pub type Rows = Vec<[String; 2]>;

/// A time of valid prediction: `12.3 s`, `at least 100 s`, `8.4 Lyapunov times (12.3 s)`.
pub fn valid_time(valid: &ValidTimes, unit: &str) -> String {
    let bound = |at_least: bool| if at_least { "at least " } else { "" };
    let plain = format!("{}{} {unit}", bound(valid.at_least), number(valid.median));
    match valid.lyapunov_times {
        Some(times) => format!("{}{} Lyapunov times ({plain})", bound(valid.lyapunov_at_least), number(times)),
        None => plain,
    }
}

/// What the time of valid prediction is, with what it is a median of.
pub fn valid_name(valid: &ValidTimes, of: [&str; 2]) -> String {
    let [one, many] = of;
    format!(
        "Prediction valid (error below {} of the spread of the motion), median of {}",
        valid.threshold,
        counted(valid.starts, one, many)
    )
}

/// Of a model of a system that is known: `title` names it.
pub fn of_evaluation(title: &str, found: &Evaluation) -> (String, Rows) {
    let mass = found.mass_matrix.error.median;
    let matrix = if mass.is_finite() {
        format!("gives the mass matrix to {} up to one factor", percent(mass))
    } else {
        "gives no mass matrix that can be compared".to_string()
    };
    let predicts = match &found.valid_time {
        Some(valid) => format!(", and predicts the motion for {}", valid_time(valid, found.time_unit)),
        None => String::new(),
    };
    let sentence = format!("{title}: the learned Lagrangian {matrix}{predicts}.");
    let mut rows: Rows = Vec::new();
    let mut add = |what: &str, value: String| rows.push([what.to_string(), value]);
    if let Some(valid) = &found.valid_time {
        add(&valid_name(valid, ["start", "starts"]), valid_time(valid, found.time_unit));
    }
    let errors = found.coordinates.iter().zip(&found.accelerations);
    let errors = errors.map(|(name, error)| {
        let (name, unit) = name.split_once(" [").unwrap_or((name, ""));
        format!("{name} {} {}", number(error.median), unit.trim_end_matches(']'))
    });
    add("Accelerations of fresh states, median error", errors.collect::<Vec<_>>().join(", "));
    add("Mass matrix at rest, median error", percent(mass));
    let mut energies: Vec<f64> = found.trajectories.iter().map(|t| t.summary.energy_error.mean).collect();
    energies.retain(|x| x.is_finite());
    let energy = energies.iter().sum::<f64>() / energies.len() as f64;
    add("Exact energy along the predicted motions, mean error", percent(energy));
    add("Fresh states whose mass matrix has the wrong signature", percent(found.wrong_signature));
    (sentence, rows)
}

/// Of a model of recorded motion called `name`.
pub fn of_judgement(name: &str, found: &Judgement) -> (String, Rows) {
    let Some((model, straight)) = found.model.last().zip(found.constant_velocity.last()) else {
        let sentence = format!("{name}: a Lagrangian was learned; no held-out motion judges it.");
        return (sentence, Vec::new());
    };
    let valid = found.valid_time.as_ref();
    let sentence = match (model.median.is_finite(), valid) {
        (true, Some(valid)) => format!(
            "{name}: the learned Lagrangian predicts motion that it has not seen for {}; {} s ahead it is off by {} \
             (median, SI), where going on at constant velocity is off by {}.",
            valid_time(valid, "s"),
            number(model.seconds),
            number(model.median),
            number(straight.median)
        ),
        _ => format!("{name}: the learned Lagrangian fails to predict most of the motion that it has not seen."),
    };
    let mut rows: Rows = Vec::new();
    if let Some(valid) = valid {
        rows.push([valid_name(valid, ["held-out window", "held-out windows"]), valid_time(valid, "s")]);
    }
    let ahead = number(model.seconds);
    rows.extend([
        [format!("Median error {ahead} s ahead [SI]"), number(model.median)],
        ["The same at constant velocity [SI]".to_string(), number(straight.median)],
        ["Held-out states whose mass matrix has the wrong signature".to_string(), percent(found.wrong_signature)],
    ]);
    (sentence, rows)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::analysis::VALID;

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
}
