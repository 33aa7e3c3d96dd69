//! Steady loss of energy in recorded motion: the mark of friction.

use crate::data::Split;
use crate::lagrangian::{EulerLagrange, Request, Terms};
use serde::{Deserialize, Serialize};

/// Energy that recorded motion loses by a model that conserves it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct EnergyLoss {
    /// Mean loss per second over the mean kinetic energy `p.v/2`; negative where energy is gained.
    pub per_second: f64,
    /// Its standard error, from the scatter between stretches.
    pub error: f64,
    /// Share of the stretches that lose energy.
    pub losing: f64,
    /// Stretches looked at.
    pub stretches: usize,
    /// Mean length of a stretch in s.
    pub seconds: f64,
}

impl EnergyLoss {
    /// `true` if motion loses energy steadily: nearly everywhere, by more than chance, and enough to matter.
    pub(crate) fn is_steady(&self) -> bool {
        let lost = self.per_second * self.seconds;
        self.stretches >= 5 && self.per_second > 4.0 * self.error && self.losing >= 0.8 && lost > 0.01
    }
}

/// Stretches that trajectories are cut into, at least about.
const STRETCHES: usize = 20;
/// Samples of a stretch at which the energy is looked at, at most.
const SAMPLES: usize = 64;

/// Energy lost along the estimated states of recorded motion, work of known forces taken out: the slope of straight lines
/// through `E - work` over stretches of the trajectories. `None` where the model gives no energy.
pub fn energy_loss(model: &dyn EulerLagrange<f64>, part: &Split) -> Option<EnergyLoss> {
    let n = model.coordinates();
    let pieces = STRETCHES.div_ceil(part.states.len().max(1)).max(1);
    let (mut slopes, mut seconds) = (Vec::new(), 0.0);
    let (mut kinetic, mut count) = (0.0, 0.0);
    let mut terms = Terms::default();
    for (track, states) in part.recording.tracks.iter().zip(&part.states) {
        let rows = states.interior();
        let length = rows.len() / pieces;
        for first in (rows.start..rows.end).step_by(length.max(1)).take(pieces).filter(|_| length >= 8) {
            let stride = length.div_ceil(SAMPLES);
            let (mut line, mut work) = (Vec::new(), 0.0);
            for row in first..first + length {
                let at = |values: &[f64], row: usize| values[row * n..(row + 1) * n].to_vec();
                let power = |row: usize| -> f64 {
                    let force = track.force.get(row * n..(row + 1) * n).unwrap_or_default();
                    force.iter().zip(&states.v[row * n..]).map(|(f, v)| f * v).sum()
                };
                if row > first {
                    work += 0.5 * (power(row) + power(row - 1)) * (states.times[row] - states.times[row - 1]);
                }
                if (row - first) % stride == 0 {
                    let (q, v) = (at(&states.q, row), at(&states.v, row));
                    if model.terms(&q, &v, Request::ENERGY, &mut terms).is_ok() && terms.energy[0].is_finite() {
                        line.push((states.times[row], terms.energy[0] - work));
                        kinetic += 0.5 * terms.momentum.iter().zip(&v).map(|(p, v)| p * v).sum::<f64>();
                        count += 1.0;
                    }
                }
            }
            if line.len() >= 4 {
                seconds += line[line.len() - 1].0 - line[0].0;
                slopes.push(slope(&line));
            }
        }
    }
    let number = slopes.len() as f64;
    let unit = (kinetic / count).abs();
    let mean = slopes.iter().sum::<f64>() / number;
    let variance = slopes.iter().map(|s| (s - mean).powi(2)).sum::<f64>() / (number - 1.0);
    let loss = EnergyLoss {
        per_second: -mean / unit,
        error: (variance / number).sqrt() / unit,
        losing: slopes.iter().filter(|s| **s < 0.0).count() as f64 / number,
        stretches: slopes.len(),
        seconds: seconds / number,
    };
    (loss.per_second.is_finite() && loss.error.is_finite()).then_some(loss)
}

/// Slope of the line of least squares through points.
fn slope(points: &[(f64, f64)]) -> f64 {
    let count = points.len() as f64;
    let (t, e) = points.iter().fold((0.0, 0.0), |(t, e), p| (t + p.0 / count, e + p.1 / count));
    let (up, down) =
        points.iter().fold((0.0, 0.0), |(up, down), p| (up + (p.0 - t) * (p.1 - e), down + (p.0 - t).powi(2)));
    up / down
}
