//! Learning-rate schedules.

use serde::{Deserialize, Serialize};

/// Course of the learning rate within a phase.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Schedule {
    /// The rate stays.
    Constant,
    /// Half a cosine from the rate to `eta_min` over the whole phase.
    Cosine,
    /// Cosine annealing with period `2 t_max`: falls to `eta_min` in `t_max` epochs, rises again in the next `t_max`
    /// (the paper's schedule).
    CosineAnnealing,
}

impl Schedule {
    /// Learning rate after a fraction of the phase.
    ///
    /// `epoch` counts from 0 and may be fractional; `epochs` is the length of the phase.
    pub fn rate(self, rate: f64, eta_min: f64, t_max: f64, epoch: f64, epochs: f64) -> f64 {
        let cosine = |phase: f64| eta_min + 0.5 * (rate - eta_min) * (1.0 + (std::f64::consts::PI * phase).cos());
        match self {
            Self::Constant => rate,
            Self::Cosine => cosine((epoch / epochs).min(1.0)),
            Self::CosineAnnealing => cosine(epoch / t_max),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_annealed_rate_falls_and_rises_again() {
        let rate = |epoch| Schedule::CosineAnnealing.rate(1e-3, 1e-6, 30.0, epoch, 300.0);
        assert_eq!(rate(0.0), 1e-3);
        assert!((rate(30.0) - 1e-6).abs() < 1e-18);
        assert!((rate(15.0) - 0.5 * (1e-3 + 1e-6)).abs() < 1e-15);
        assert!((rate(60.0) - 1e-3).abs() < 1e-15);
    }

    #[test]
    fn the_plain_cosine_ends_at_its_minimum() {
        let rate = |epoch| Schedule::Cosine.rate(3e-3, 0.0, 1.0, epoch, 20.0);
        assert_eq!(rate(0.0), 3e-3);
        assert!(rate(20.0).abs() < 1e-18);
        assert!(rate(25.0).abs() < 1e-18);
        assert!((rate(10.0) - 1.5e-3).abs() < 1e-15);
    }
}
