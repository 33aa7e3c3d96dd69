//! Pictures of a training.

use super::{Figure, LinePlot, Series, figure, line_plot};
use crate::names::rounded;

/// One epoch. Quantities that a training does not have are `NaN`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HistoryRow {
    /// Number of the epoch.
    pub epoch: f64,
    /// Mean loss of the training states.
    pub training_loss: f64,
    /// Loss of the validation states.
    pub validation_loss: f64,
    /// Learning rate.
    pub learning_rate: f64,
    /// Mean norm of the gradient.
    pub gradient_norm: f64,
    /// Mean penalty.
    pub penalty: f64,
}

/// Pictures of a history: loss, learning rate, gradient norm and penalty; quantities without a finite positive value are left
/// out.
pub fn training_figures(rows: &[HistoryRow]) -> Vec<Figure> {
    let epochs: Vec<f64> = rows.iter().map(|row| row.epoch).collect();
    let series = |name: &str, part: fn(&HistoryRow) -> f64| {
        Series::new(name, &epochs, &rows.iter().map(part).collect::<Vec<_>>())
    };
    let best = rows
        .iter()
        .filter(|row| row.validation_loss.is_finite())
        .min_by(|a, b| a.validation_loss.total_cmp(&b.validation_loss));
    let loss = match best {
        Some(best) => {
            format!("Lowest validation loss {} in epoch {}.", rounded(best.validation_loss, 6), best.epoch)
        }
        None => String::new(),
    };
    let pictures = [
        (
            "training_loss.svg",
            "How the loss falls from epoch to epoch",
            "Training",
            "loss",
            vec![series("training", |r| r.training_loss), series("validation", |r| r.validation_loss)],
            loss,
        ),
        (
            "learning_rate.svg",
            "The learning rate",
            "Learning rate",
            "learning rate",
            vec![series("", |r| r.learning_rate)],
            String::new(),
        ),
        (
            "gradient_norm.svg",
            "The size of the gradient",
            "Gradient norm",
            "gradient norm",
            vec![series("", |r| r.gradient_norm)],
            "Norm before clipping, mean per epoch.".into(),
        ),
        (
            "penalty.svg",
            "How much the mass matrix violates its signature",
            "Stability penalty",
            "penalty",
            vec![series("", |r| r.penalty)],
            "Penalty on the mass matrix, mean per epoch; epochs without a violation leave gaps.".into(),
        ),
    ];
    let drawn = |(file, heading, title, y_label, series, caption): (&str, &str, &str, &str, Vec<Series>, String)| {
        let (title, y_label) = (title.to_string(), y_label.to_string());
        let plot = LinePlot { title, x_label: "epoch".into(), y_label, log_y: true, series, turn: None, level: None };
        figure(file, heading, line_plot(&plot), caption)
    };
    pictures.into_iter().filter_map(drawn).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_missing_is_left_out() {
        let rows: Vec<_> = (0..20)
            .map(|k| HistoryRow {
                epoch: f64::from(k),
                training_loss: (-0.3 * f64::from(k)).exp(),
                validation_loss: 1.1 * (-0.3 * f64::from(k)).exp(),
                learning_rate: 1e-3,
                gradient_norm: f64::NAN,
                penalty: 0.0,
            })
            .collect();
        let figures = training_figures(&rows);
        let names: Vec<_> = figures.iter().map(|f| f.file.as_str()).collect();
        assert_eq!(names, ["training_loss.svg", "learning_rate.svg"]);
        assert!(figures[0].caption.contains("epoch 19"));
        assert!(training_figures(&[]).is_empty());
    }
}
