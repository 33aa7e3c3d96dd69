//! Headlines in plain words: what a person wants to know of a run before any table.

use crate::analysis::PredictionError;
use crate::cli::evaluation::Evaluation;
use crate::experiments::Row;
use crate::names::{counted, number, percent};

/// Name and unit of `name [unit]`.
pub fn named(text: &str) -> (&str, &str) {
    text.split_once(" [").map_or((text, ""), |(name, unit)| (name, unit.trim_end_matches(']')))
}

/// Quality of a model of a listed system: accelerations, mass matrix, energy along the motions of the trajectory test.
pub fn of_evaluation(found: &Evaluation) -> String {
    let typical = found.coordinates.iter().zip(&found.accelerations).map(|(coordinate, error)| {
        let (name, unit) = named(coordinate);
        format!("{} {unit} in {name}", number(error.median))
    });
    let mut text = format!(
        "Half of the accelerations of fresh states are right to {}; the mass matrix is right to {}.\n",
        typical.collect::<Vec<_>>().join(", "),
        percent(found.mass_matrix.error.mean)
    );
    if found.wrong_signature > 0.0 {
        text += &format!("The mass matrix has a wrong signature in {} of them.\n", percent(found.wrong_signature));
    }
    let energies: Vec<f64> = found.trajectories.iter().map(|t| t.summary.energy_error.mean).collect();
    let whole = energies.iter().filter(|x| x.is_finite()).count();
    if whole > 0 {
        let mean = energies.iter().filter(|x| x.is_finite()).sum::<f64>() / whole as f64;
        let most = found.trajectories.iter().fold(f64::NAN, |m, t| m.max(t.summary.energy_error.max));
        let until = found.trajectories.iter().fold(0.0, |m: f64, t| m.max(t.summary.compared_until));
        text += &format!(
            "Along {} of {} {} the energy is off by {} in the mean, by {} at most.\n",
            counted(whole, "motion", "motions"),
            number(until),
            found.time_unit,
            percent(mean),
            percent(most)
        );
    }
    text
}

/// Errors of predicted held-out motion, of the model and at constant velocity, in a coordinate's unit.
pub fn of_predictions(model: &[PredictionError], straight: &[PredictionError], unit: &str) -> String {
    let Some((model, straight)) = model.last().zip(straight.last()) else { return String::new() };
    if !model.median.is_finite() {
        return format!("After {} s most predictions of held-out motion have failed.\n", number(model.seconds));
    }
    let compared = match straight.median / model.median {
        factor if factor >= 1.05 => format!(", {} times more", number(factor)),
        _ => ": the model is no better".to_string(),
    };
    format!(
        "After {} s of held-out motion the prediction is off by {} {unit} (median); at constant velocity by {}{compared}.\n",
        number(model.seconds),
        number(model.median),
        number(straight.median)
    )
}

/// The lowest loss of an experiment, and in how many rows it is below the paper's.
pub fn of_experiment(rows: &[Row]) -> String {
    let losses = rows.iter().filter_map(|row| Some((row.loss?.mean, row)));
    let Some((lowest, row)) = losses.min_by(|a, b| a.0.total_cmp(&b.0)) else {
        return "No run learned anything.\n".to_string();
    };
    let compared: Vec<bool> = rows.iter().filter_map(|row| Some(row.loss?.mean < row.reported.loss?)).collect();
    let below = match compared.len() {
        0 => String::new(),
        all => format!(
            "; below the paper's in {} of {all} rows for which it states one",
            compared.iter().filter(|b| **b).count()
        ),
    };
    format!("Lowest loss {} ({}){below}.\n", number(lowest), row.label)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn predictions_are_compared_with_constant_velocity() {
        let error = |median: f64| PredictionError { seconds: 0.5, rms: 1.0, median, most: 2.0, windows: 9, missing: 0 };
        let said = |model, straight| of_predictions(&[error(9.0), error(model)], &[error(9.0), error(straight)], "rad");
        assert_eq!(
            said(0.0196, 1.96),
            "After 0.500 s of held-out motion the prediction is off by 0.0196 rad (median); at constant velocity by 1.96, 100 times \
             more.\n"
        );
        assert!(said(2.0, 1.0).ends_with("by 1.00: the model is no better.\n"));
        assert!(said(f64::INFINITY, 1.0).contains("have failed"));
        assert_eq!(of_predictions(&[], &[], "m"), "");
    }
}
