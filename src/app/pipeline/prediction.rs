//! Predicts held-out windows in limited time and counts the reasons for failures.

use crate::analysis::{Predictions, Window, follow};
use crate::lagrangian::EulerLagrange;
use crate::pipeline::PipelineError;
use crate::pipeline::judging::Judging;
use crate::pipeline::thresholds::{PILOT_WINDOWS, WINDOWS_AT_ONCE};
use crate::rollout::RolloutError;
use std::collections::BTreeMap;

/// Windows with the predictions of a model.
#[derive(Clone, Debug, Default)]
pub(crate) struct HeldOutPredictions {
    /// The windows that were predicted.
    pub windows: Vec<Window>,
    /// Their predictions.
    pub predictions: Predictions,
    /// Number of available windows.
    pub all: usize,
    /// Number of failed predictions by reason.
    pub given_up: BTreeMap<&'static str, usize>,
}

impl HeldOutPredictions {
    /// Predicts the windows, or only a few of them if most of those fail.
    ///
    /// # Errors
    /// [`PipelineError::Interrupted`].
    pub fn new(
        model: &dyn EulerLagrange<f64>,
        mut windows: Vec<Window>,
        threads: usize,
        judging: &Judging<'_>,
    ) -> Result<Self, PipelineError> {
        let all = windows.len();
        let stride = all.div_ceil(PILOT_WINDOWS).max(1);
        let mut found = Self { windows: Vec::new(), predictions: Vec::new(), all, given_up: BTreeMap::new() };
        if stride > 1 {
            let pilot: Vec<Window> = windows.iter().step_by(stride).cloned().collect();
            let (predictions, stops) = in_parts(model, &pilot, threads, judging)?;
            if 2 * stops.iter().flatten().count() > pilot.len() {
                found.count(&stops);
                (found.windows, found.predictions) = (pilot, predictions);
                return Ok(found);
            }
        }
        let (predictions, stops) = in_parts(model, &windows, threads, judging)?;
        found.count(&stops);
        (found.windows, found.predictions) = (std::mem::take(&mut windows), predictions);
        Ok(found)
    }

    fn count(&mut self, stops: &[Option<RolloutError>]) {
        for stop in stops.iter().flatten() {
            *self.given_up.entry(reason(stop)).or_default() += 1;
        }
    }

    /// Describes predictions that failed or were left out; empty if all succeeded.
    pub fn remarks(&self) -> String {
        let mut text = String::new();
        let predicted = self.windows.len();
        if !self.given_up.is_empty() {
            let count: usize = self.given_up.values().sum();
            let reasons = self.given_up.iter().map(|(reason, count)| format!("{count} by {reason}"));
            let reasons = reasons.collect::<Vec<_>>().join(", ");
            text += &format!(
                "{count} of {predicted} predictions were given up: {reasons}; they count as infinitely wrong\n"
            );
        }
        if predicted < self.all {
            text += &format!("only {predicted} of {} windows were tried, because most of these failed\n", self.all);
        }
        text
    }
}

/// Predicts in chunks, reports progress and checks the interrupt flag.
fn in_parts(
    model: &dyn EulerLagrange<f64>,
    windows: &[Window],
    threads: usize,
    judging: &Judging<'_>,
) -> Result<(Predictions, Vec<Option<RolloutError>>), PipelineError> {
    let (mut predictions, mut stops) = (Vec::with_capacity(windows.len()), Vec::with_capacity(windows.len()));
    for part in windows.chunks(WINDOWS_AT_ONCE) {
        let (foretold, ended) = follow(model, part, threads);
        judging.advance(part.len());
        judging.check()?;
        predictions.extend(foretold);
        stops.extend(ended);
    }
    Ok((predictions, stops))
}

/// Explains briefly why a motion ended.
fn reason(stop: &RolloutError) -> &'static str {
    match stop {
        RolloutError::SingularMass { .. } => "a singular mass matrix",
        RolloutError::Uncertified { .. } => "a mass matrix that is not certified",
        RolloutError::TooManySteps { .. } => "more steps than allowed",
        RolloutError::StepUnderflow { .. } => "steps that became too small",
        RolloutError::LeftDomain { .. } => "leaving the domain",
        RolloutError::NotConverged { .. } => "steps that did not converge",
        _ => "numbers that are not finite",
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::models::{OSCILLATOR, SINGULAR};
    use crate::pipeline::Watch;
    use std::sync::atomic::Ordering;

    fn windows(count: usize) -> Vec<Window> {
        let times: Vec<f64> = (1..20).map(|k| 0.1 * f64::from(k)).collect();
        let window =
            Window { q: vec![0.0], v: vec![-1.0], lead: 0.0, measured: vec![0.0; times.len()], times, force: None };
        vec![window; count]
    }

    #[test]
    fn a_model_that_fails_nearly_always_is_not_tried_everywhere() {
        let watch = Watch::default();
        let judging = Judging::new(&watch, 1);
        let found = HeldOutPredictions::new(&SINGULAR, windows(400), 2, &judging).unwrap();
        assert_eq!((found.windows.len(), found.predictions.len(), found.all), (PILOT_WINDOWS, PILOT_WINDOWS, 400));
        let remarks = found.remarks();
        assert!(remarks.starts_with("40 of 40 predictions were given up: 40 by a singular mass matrix"), "{remarks}");
        assert!(remarks.contains("only 40 of 400 windows"), "{remarks}");
        let well = HeldOutPredictions::new(&OSCILLATOR, windows(100), 2, &judging).unwrap();
        assert_eq!((well.windows.len(), well.remarks().as_str()), (100, ""));
    }

    #[test]
    fn a_raised_flag_ends_it() {
        let watch = Watch::default();
        let judging = Judging::new(&watch, 1);
        watch.interrupt.store(true, Ordering::SeqCst);
        let watched = judging.watched(&OSCILLATOR);
        let Err(error) = HeldOutPredictions::new(&watched, windows(100), 2, &judging) else { panic!("it goes on") };
        assert!(error.to_string().contains("interrupted while the model was judged"));
        let (predictions, stops) = follow(&watched, &windows(1), 1);
        assert!(predictions[0].iter().all(|x| x.is_nan()) && stops[0].is_some());
        // The flag that ended a training does not end the judgement of its model.
        let later = Judging::new(&watch, 1);
        assert!(HeldOutPredictions::new(&later.watched(&OSCILLATOR), windows(3), 2, &later).is_ok());
    }
}
