//! The result of a test by held-out motion.

use crate::analysis::{PredictionError, ValidTimes};
use crate::pipeline::energy::Balance;
use crate::pipeline::force_errors::ForceError;
use crate::pipeline::prediction::HeldOutPredictions;
use crate::pipeline::thresholds::BETTER_THAN_CONSTANT_VELOCITY;
use crate::report::Figure;
use serde::Serialize;

/// Time ahead up to which a prediction is useful: valid, and better than continuing at constant velocity.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct UsefulTime {
    /// The time in s; 0 for a prediction that is never useful.
    pub seconds: f64,
    /// `true` if it is useful to the end of the windows, so that the time is a lower bound.
    pub at_least: bool,
}

/// Errors of one coordinate by time ahead, medians over the windows, in its own unit.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CoordinatePredictions {
    /// Name of the coordinate.
    pub name: String,
    /// Its unit: `rad` for an angle, otherwise `SI`.
    pub unit: &'static str,
    /// Errors of the model's motion.
    pub model: Vec<f64>,
    /// Errors of continuing at constant velocity.
    pub constant_velocity: Vec<f64>,
}

/// Predictions of held-out motion, compared with motion at constant velocity.
#[derive(Clone, Debug, Serialize)]
pub struct HoldOut {
    /// Unit of the errors over all coordinates: `rad` for angles, `SI` for others; if there are both kinds, each error is divided by the
    /// spread of its coordinate's motion.
    pub error_unit: &'static str,
    /// Errors of the model's motion, by time ahead.
    pub model: Vec<PredictionError>,
    /// Median time, over the windows, for which the model's motion predicts the measured one; a lower bound if the error remains small to
    /// the end of a window. `None` without windows.
    pub(crate) valid_time: Option<ValidTimes>,
    /// Time for which the model's motion is useful. `None` without windows.
    pub useful_time: Option<UsefulTime>,
    /// Period of the fastest coordinate in s, `2 pi` times the spread of its velocity over that of its acceleration; none if the motion
    /// takes longer than the trajectories, or is noise.
    pub fastest_period: Option<f64>,
    /// Errors of every coordinate at the same times ahead.
    pub by_coordinate: Vec<CoordinatePredictions>,
    /// Number of failed predictions and the reasons, in words; empty if all succeeded.
    pub given_up: String,
    /// Errors of continuing at the velocity of the start.
    pub constant_velocity: Vec<PredictionError>,
    /// Fraction of the held-out states whose mass matrix has a wrong signature; `NaN` if nothing was held out.
    pub wrong_signature: f64,
    /// Energy balance of the held-out trajectories; `None` if the model gives no finite energy.
    pub(crate) energy: Option<Balance>,
    /// Errors of the known forces of a model that was trained on them.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub force_errors: Vec<ForceError>,
    /// Pictures.
    #[serde(skip)]
    pub figures: Vec<Figure>,
    /// The predictions.
    #[serde(skip)]
    pub(crate) predicted: HeldOutPredictions,
    /// Which coordinates are angles, and the scales of the coordinates' errors.
    #[serde(skip)]
    pub(crate) error_scales: (Vec<bool>, Vec<f64>),
}

impl HoldOut {
    /// Result for a model without held-out motion; it contains no numbers.
    pub(crate) fn nothing() -> Self {
        Self {
            error_unit: "SI",
            model: Vec::new(),
            constant_velocity: Vec::new(),
            valid_time: None,
            useful_time: None,
            fastest_period: None,
            by_coordinate: Vec::new(),
            given_up: String::new(),
            wrong_signature: f64::NAN,
            energy: None,
            force_errors: Vec::new(),
            figures: Vec::new(),
            predicted: HeldOutPredictions::default(),
            error_scales: Default::default(),
        }
    }

    /// `true` if the model predicts better than constant velocity at some time ahead; `None` without predictions.
    pub(crate) fn is_better(&self) -> Option<bool> {
        let mut pairs = self.model.iter().zip(&self.constant_velocity);
        (!self.model.is_empty()).then(|| pairs.any(|(model, straight)| factor(model, straight).is_some()))
    }

    /// `true` if there was no held-out motion.
    pub(super) fn is_of_nothing(&self) -> bool {
        self.wrong_signature.is_nan()
    }
}

impl UsefulTime {
    /// Determines the useful time from the time of valid prediction and from the errors of model and constant velocity at the same times.
    pub(super) fn new(valid: &ValidTimes, [model, straight]: [&[PredictionError]; 2]) -> Self {
        let mut pairs = model.iter().zip(straight).rev();
        let last = pairs.next().filter(|(model, straight)| factor(model, straight).is_some());
        let better = last.or_else(|| pairs.find(|(model, straight)| factor(model, straight).is_some()));
        let better = better.map_or(0.0, |(model, _)| model.seconds);
        Self { seconds: better.min(valid.median), at_least: last.is_some() && valid.at_least }
    }
}

/// Factor by which a prediction is better than constant velocity; `None` if it is not better.
pub(crate) fn factor(model: &PredictionError, straight: &PredictionError) -> Option<f64> {
    is_better(model.median, straight.median).then(|| straight.median / model.median)
}

/// `true` if the prediction error is at least a twentieth smaller than that of constant velocity.
pub(crate) fn is_better(model: f64, straight: f64) -> bool {
    straight / model >= BETTER_THAN_CONSTANT_VELOCITY
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_prediction_is_of_use_while_it_is_valid_and_better_than_constant_velocity() {
        let errors = |medians: [f64; 4]| -> Vec<PredictionError> {
            let error = |(k, median)| PredictionError {
                seconds: 1.0 + k as f64,
                rms: median,
                median,
                p90: median,
                windows: 9,
                missing: 0,
            };
            medians.into_iter().enumerate().map(error).collect()
        };
        let useful = |model, straight, median, at_least| {
            let (threshold, lyapunov_times, lyapunov_at_least) = (crate::analysis::VALID, None, false);
            let valid =
                ValidTimes { threshold, median, at_least, starts: 9, lyapunov_times, lyapunov_at_least, chaotic: 0 };
            UsefulTime::new(&valid, [&errors(model), &errors(straight)])
        };
        let straight = [1.0, 2.0, 3.0, 4.0];
        let of = |seconds, at_least| UsefulTime { seconds, at_least };
        assert_eq!(useful([0.1, 0.2, 0.3, 0.4], straight, 4.0, true), of(4.0, true));
        // Better to the end, but wrong before; right to the end, but no better; never better.
        assert_eq!(useful([0.1, 0.2, 0.3, 0.4], straight, 2.5, false), of(2.5, false));
        assert_eq!(useful([1.0, 0.2, 0.3, 4.0], straight, 4.0, true), of(3.0, false));
        assert_eq!(useful([1.0, 2.0, f64::INFINITY, 4.0], straight, 4.0, true), of(0.0, false));
    }
}
