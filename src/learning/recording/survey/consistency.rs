//! Comparison of measured velocities and accelerations with the derivatives of the positions.

use crate::recording::Recording;
use crate::recording::smooth::Smoothing;
use serde::Serialize;
use std::f64::consts::PI;

/// A measured derivative against the derivative of the positions.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Consistency {
    /// The measured one is so many times the computed one (least squares); 1 if all is well.
    pub factor: f64,
    /// Correlation of the two.
    pub correlation: f64,
    /// Relative error of the computed one.
    pub uncertainty: f64,
}

impl Consistency {
    /// `true` if the two agree as far as they are known.
    pub fn holds(&self) -> bool {
        let doubt = 0.05 + 2.0 * self.uncertainty * self.uncertainty;
        (self.factor - 1.0).abs() <= doubt && self.correlation >= 0.9 - self.uncertainty
    }

    /// A possible mistake, if the factor is that of a usual one.
    pub fn mistake(&self, step: f64) -> Option<&'static str> {
        let known = [
            (180.0 / PI, "degrees where radians are expected?"),
            (PI / 180.0, "positions in degrees, derivatives in radians?"),
            (-1.0, "the other sign?"),
            (1e3, "milli-units or milliseconds?"),
            (1e-3, "milli-units or milliseconds?"),
            (60.0 / (2.0 * PI), "revolutions per minute?"),
            (1.0 / (2.0 * PI), "turns per second?"),
            (2.0 * PI, "positions in turns?"),
            (step, "per sample instead of per second?"),
            (step * step, "per sample squared instead of per second squared?"),
        ];
        known.into_iter().find(|(factor, _)| (self.factor / factor - 1.0).abs() < 0.05).map(|(_, text)| text)
    }
}

/// Compares derivative 1 or 2 of coordinate `i` with what was measured.
pub fn compare(recording: &Recording, i: usize, derivative: usize, smoothing: &Smoothing) -> Consistency {
    let n = recording.n();
    let (mut product, mut computed, mut measured) = (0.0, 0.0, 0.0);
    smoothing.visit(recording, i, |values, track, at| {
        let x = if derivative == 1 { track.v[at * n + i] } else { track.a[at * n + i] };
        let y = values[derivative];
        (product, computed, measured) = (product + x * y, computed + y * y, measured + x * x);
    });
    let quality = smoothing.coordinates[i].quality;
    let size = if derivative == 1 { quality.velocity } else { quality.acceleration };
    let error = quality.total(derivative);
    let uncertainty = if error == 0.0 { 0.0 } else { error / size };
    Consistency { factor: product / computed, correlation: product / (computed * measured).sqrt(), uncertainty }
}
