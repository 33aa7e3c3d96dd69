//! Settings of multiple shooting.

use crate::configuration::{ConfigError, Faults, MOST_EPOCHS, MOST_RATE, OnFailure, Optimizer};
use crate::optimizers::{Method, Schedule};
use crate::training::solver::RateCourse;
use serde::{Deserialize, Serialize};

/// Samples of a segment and integration steps of it at most.
pub(crate) const MOST_STEPS: usize = 1 << 16;

/// Choices of a fit through motion. Keys that are not given have their defaults; others are refused.
///
/// | Name | Default | Purpose | Range |
/// |---|---|---|---|
/// | `samples_per_segment` | 20 | samples predicted from one start | 2 to 65536 |
/// | `steps` | chosen | integration steps per segment | 1 to 65536 |
/// | `epochs` | 100 | passes through all segments | 1 to 2^24 |
/// | `batch` | 16 | segments per update of the weights | 1 to 2^30 |
/// | `method` | RAdam | update rule of the weights | |
/// | `rate` | 0.002 | learning rate, falling to 0 by half a cosine | above 0 to 1000 |
/// | `weight_decay` | 1e-6 | L2 weight decay, added to the gradient | from 0 |
/// | `clip` | 1 | the gradient's norm is cut to this | above 0 |
/// | `continuity` | 0.1 | weight of a joint's gap beside one observation | from 0 |
/// | `huber` | 3 | residuals beyond so many sigma count linearly | above 0, `inf` for plain squares |
/// | `start_share` | 1 | part of a Gauss-Newton step the starts take per visit | above 0 to 1 |
/// | `curvature_every` | 5 | epochs between two linearisations by the starts | 1 to 2^24 |
///
/// The defaults are what served best on a double pendulum sampled at 100 Hz with noise of 1 %: segments that last about a
/// tenth of its slow period. Much longer ones follow its chaos rather than its law, a much larger weight of the gaps joins
/// them into longer ones.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Shooting {
    /// Samples of a segment, about: every trajectory is cut into segments of equal length.
    pub samples_per_segment: usize,
    /// Integration steps per segment. If not given, as many as keep the integrator's error below a twentieth of the noise.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub steps: Option<usize>,
    /// Passes through all segments.
    pub epochs: usize,
    /// Segments per update of the weights.
    pub batch: usize,
    /// Update rule of the weights.
    pub method: Method,
    /// Learning rate at the start.
    pub rate: f64,
    /// L2 weight decay.
    pub weight_decay: f64,
    /// The gradient's norm is cut to this.
    pub clip: f64,
    /// Weight of the gap of a joint, in units of noise, beside one observation.
    pub continuity: f64,
    /// Residuals beyond so many standard deviations count linearly.
    pub huber: f64,
    /// Part of the Gauss-Newton step that the start of a segment takes when it is visited.
    pub start_share: f64,
    /// Epochs between two linearisations of the motion by the starts.
    pub curvature_every: usize,
}

impl Default for Shooting {
    fn default() -> Self {
        Self {
            samples_per_segment: 20,
            steps: None,
            epochs: 100,
            batch: 16,
            method: Method::Radam,
            rate: 2e-3,
            weight_decay: 1e-6,
            clip: 1.0,
            continuity: 0.1,
            huber: 3.0,
            start_share: 1.0,
            curvature_every: 5,
        }
    }
}

impl Shooting {
    /// Settings of a small network beside a known Lagrangian whose constants are learned: longer and bolder, for a constant
    /// has a longer way to go than a weight; with more weight decay, which leaves the constants alone; and with segments joined
    /// as closely as samples are followed, for constants are known by the long run.
    pub(crate) fn grey_box() -> Self {
        let (method, rate, epochs, weight_decay, continuity) = (Method::Soap, 0.01, 400, 3e-3, 1.0);
        Self { method, rate, epochs, weight_decay, continuity, ..Self::default() }
    }

    /// Update rule of the weights, for batches of segments.
    pub(crate) fn optimizer(&self) -> Optimizer {
        let &Self { method, batch, weight_decay, clip, .. } = self;
        Optimizer { method, batch, weight_decay, clip, averaging: 0.0, on_failure: OnFailure::Skip }
    }

    /// Half a cosine from the rate to 0.
    pub(crate) fn rates(&self) -> RateCourse {
        let &Self { epochs, rate, .. } = self;
        RateCourse { epochs, rate, eta_min: 0.0, schedule: Schedule::Cosine, t_max: 1.0 }
    }

    /// Checks every range.
    ///
    /// # Errors
    /// The first value out of range.
    pub(crate) fn validate(&self) -> Result<(), ConfigError> {
        self.faults().into_iter().next().map_or(Ok(()), Err)
    }

    /// Every value out of range, in the order of the keys.
    pub(crate) fn faults(&self) -> Vec<ConfigError> {
        let mut faults = Faults::default();
        let within = 2..=MOST_STEPS;
        let found = self.samples_per_segment.to_string();
        let ok = within.contains(&self.samples_per_segment);
        faults.check(ok, "shooting.samples_per_segment", "2 to 65536 samples", found);
        if let Some(steps) = self.steps {
            faults.check((1..=MOST_STEPS).contains(&steps), "shooting.steps", "1 to 65536 steps", steps.to_string());
        }
        faults.count(self.epochs, "shooting.epochs", MOST_EPOCHS);
        faults.count(self.batch, "shooting.batch", 1 << 30);
        let expected = format!("a number above 0, at most {MOST_RATE}");
        faults.number(self.rate, "shooting.rate", self.rate > 0.0 && self.rate <= MOST_RATE, expected);
        faults.at_least_zero(self.weight_decay, "shooting.weight_decay");
        faults.number(self.clip, "shooting.clip", self.clip > 0.0, "a positive number");
        faults.at_least_zero(self.continuity, "shooting.continuity");
        let expected = "a positive number, inf for plain squares";
        faults.number(self.huber, "shooting.huber", self.huber > 0.0, expected);
        let ok = self.start_share > 0.0 && self.start_share <= 1.0;
        faults.number(self.start_share, "shooting.start_share", ok, "a number above 0, at most 1");
        faults.count(self.curvature_every, "shooting.curvature_every", MOST_EPOCHS);
        faults.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn defaults_are_valid_and_bad_values_are_named() {
        assert_eq!(Shooting::default().validate(), Ok(()));
        let fault = |change: fn(&mut Shooting)| {
            let mut settings = Shooting::default();
            change(&mut settings);
            settings.validate().unwrap_err().field
        };
        assert_eq!(fault(|s| s.samples_per_segment = 1), "shooting.samples_per_segment");
        assert_eq!(fault(|s| s.steps = Some(0)), "shooting.steps");
        assert_eq!(fault(|s| s.rate = f64::NAN), "shooting.rate");
        assert_eq!(fault(|s| s.huber = 0.0), "shooting.huber");
        assert_eq!(fault(|s| s.continuity = f64::INFINITY), "shooting.continuity");
        assert_eq!(fault(|s| s.start_share = 1.5), "shooting.start_share");
        assert_eq!(fault(|s| s.batch = 0), "shooting.batch");
    }

    #[test]
    fn keys_are_known_or_refused() {
        let read = |text| serde_json::from_str::<Shooting>(text);
        assert_eq!(read(r#"{"epochs": 7}"#).unwrap(), Shooting { epochs: 7, ..Shooting::default() });
        assert!(read(r#"{"epoch": 7}"#).unwrap_err().to_string().contains("epoch"));
    }
}
