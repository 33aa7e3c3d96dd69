//! Measures prediction errors: their units, scales and medians by time ahead.

use super::result::CoordinatePredictions;
use crate::analysis::{PredictionError, Predictions, Window, coordinate_errors, prediction_error, spread};
use crate::data::Split;
use crate::recording::Recording;

/// Scales and units of prediction errors.
pub(super) struct ErrorMeasures<'a> {
    recording: &'a Recording,
    /// Longest prediction horizon.
    horizon: f64,
    /// Spread of the motion of every coordinate.
    pub(super) spread: Vec<f64>,
    /// Units of the errors of single coordinates, and of all coordinates together.
    units: Vec<&'static str>,
    pub(super) unit: &'static str,
    /// Divisors of the coordinates' errors before they are combined.
    pub(super) scales: Vec<f64>,
}

impl<'a> ErrorMeasures<'a> {
    pub(super) fn of(part: &'a Split, horizon: f64) -> Self {
        let recording = &part.recording;
        let positions: Vec<f64> = recording.tracks.iter().flat_map(|track| track.q.iter().copied()).collect();
        let spread = spread(&positions, &recording.periodic);
        let units: Vec<_> = recording.periodic.iter().map(|angle| if *angle { "rad" } else { "SI" }).collect();
        let (unit, scales) = match units.iter().any(|unit| *unit != units[0]) {
            true => ("of the spread of the motion", spread.clone()),
            false => (units[0], vec![1.0; recording.n()]),
        };
        Self { recording, horizon, spread, units, unit, scales }
    }

    /// Computes errors at `count` evenly spaced times ahead.
    pub(super) fn errors(&self, windows: &[Window], predictions: &Predictions, count: usize) -> Vec<PredictionError> {
        let times = (1..=count).map(|k| self.horizon * k as f64 / count as f64);
        let measures = (&self.recording.periodic[..], &self.scales[..]);
        times.map(|t| prediction_error(windows, predictions, measures, t)).collect()
    }

    /// Computes errors of every coordinate at these times, for the model and for constant velocity.
    pub(super) fn by_coordinate(
        &self,
        windows: &[Window],
        predictions: [&Predictions; 2],
        times: &[f64],
    ) -> Vec<CoordinatePredictions> {
        let [model, straight] = predictions.map(|all| -> Vec<Vec<f64>> {
            times.iter().map(|t| coordinate_errors(windows, all, &self.recording.periodic, *t)).collect()
        });
        let column = |errors: &[Vec<f64>], i: usize| errors.iter().map(|row| row[i]).collect();
        let coordinates = self.recording.coordinates.iter().zip(&self.units).enumerate();
        let of = |(i, (name, unit)): (usize, (&String, &&'static str))| {
            let (name, model, constant_velocity) = (name.clone(), column(&model, i), column(&straight, i));
            CoordinatePredictions { name, unit, model, constant_velocity }
        };
        coordinates.map(of).collect()
    }
}

/// Short form of a unit for a header.
pub(super) fn short(unit: &str) -> &str {
    if unit.starts_with("of ") { "spread" } else { unit }
}
