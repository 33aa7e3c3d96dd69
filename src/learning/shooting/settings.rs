//! Settings of multiple shooting.

use super::thresholds::MOST_STEPS;
use crate::configuration::table::{count, from_zero, table};
use crate::configuration::{ConfigError, Faults, MOST_EPOCHS, MOST_RATE, OnFailure, Optimizer, Ranges as _};
use crate::optimizers::{Method, Schedule};
use crate::training::solver::LearningRateSchedule;

table! {
    /// Settings of a fit through motion. Missing keys have their defaults; unknown keys are rejected.
    ///
    /// The defaults were chosen on a double pendulum sampled at 100 Hz with noise of 1 %: segments that last about a tenth of its slow
    /// period. A much larger weight of the gaps has the same effect as longer segments.
    pub struct Shooting {
        /// Approximate number of samples predicted from one initial condition.
        ///
        /// Every trajectory is cut into segments of equal length.
        #[key("2 to 65536", flag = "segment", check = |x| (2..=MOST_STEPS).contains(x))]
        pub samples_per_segment: usize = 20,
        /// Integration steps per segment; by default as many as the noise requires.
        ///
        /// As many as keep the integrator's error below a twentieth of the noise.
        #[key("1 to 65536", example = "8", check = count(MOST_STEPS))]
        #[serde(skip_serializing_if = "Option::is_none")]
        pub steps: Option<usize> = None,
        /// Passes through all segments.
        #[key("1 to 2^24", flag = "shooting-epochs", check = count(MOST_EPOCHS))]
        pub epochs: usize = 100,
        /// Segments per update of the weights.
        #[key("1 to 2^30", check = count(1 << 30))]
        pub batch: usize = 16,
        /// Update rule of the weights.
        #[key(Method::NAMES)]
        pub method: Method = Method::Radam,
        /// Learning rate at the start, falling to 0 by half a cosine.
        #[key("above 0 to 1000", check = |x| *x > 0.0 && *x <= MOST_RATE)]
        pub rate: f64 = 2e-3,
        /// Weight decay: added to the gradient (L2); with adamw, weights shrink by the rate times it.
        #[key("from 0", check = from_zero)]
        pub weight_decay: f64 = 1e-6,
        /// Largest norm of the gradient; longer gradients are cut to it.
        #[key("above 0, inf for none", check = |x| *x > 0.0)]
        pub clip: f64 = 1.0,
        /// Weight of the gap between two segments, in units of noise, relative to one observation.
        #[key("from 0", check = from_zero)]
        pub continuity: f64 = 0.1,
        /// Number of standard deviations beyond which residuals count linearly.
        #[key("above 0, inf for plain squares", check = |x| *x > 0.0)]
        pub huber: f64 = 3.0,
        /// Part of a Gauss-Newton step that an initial condition takes when it is visited.
        #[key("above 0 to 1", check = |x| *x > 0.0 && *x <= 1.0)]
        pub start_share: f64 = 1.0,
        /// Epochs between two linearisations of the motion by the initial conditions.
        #[key("1 to 2^24", check = count(MOST_EPOCHS))]
        pub curvature_every: usize = 5,
    }
}

impl Shooting {
    /// Settings for a small network in addition to a known Lagrangian whose constants are learned: more epochs and larger steps, because a
    /// constant starts farther from its final value than a weight; more weight decay, which does not act on constants; and a larger weight
    /// of the gaps, because long segments determine constants best.
    pub fn grey_box() -> Self {
        let (method, rate, epochs, weight_decay, continuity) = (Method::Soap, 0.01, 400, 3e-3, 1.0);
        Self { method, rate, epochs, weight_decay, continuity, ..Self::default() }
    }

    /// Update rule of the weights, for batches of segments.
    pub(crate) fn optimizer(&self) -> Optimizer {
        let &Self { method, batch, weight_decay, clip, .. } = self;
        Optimizer { method, batch, weight_decay, clip, averaging: 0.0, on_failure: OnFailure::Skip }
    }

    /// The learning rate falls to 0 by half a cosine.
    pub(crate) fn rates(&self) -> LearningRateSchedule {
        let &Self { epochs, rate, .. } = self;
        LearningRateSchedule { epochs, rate, eta_min: 0.0, schedule: Schedule::Cosine, t_max: 1.0 }
    }

    /// Checks every range.
    ///
    /// # Errors
    /// The first value out of range.
    pub(crate) fn validate(&self) -> Result<(), ConfigError> {
        let mut faults = Faults::default();
        self.ranges("shooting", &mut faults);
        faults.0.into_iter().next().map_or(Ok(()), Err)
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
