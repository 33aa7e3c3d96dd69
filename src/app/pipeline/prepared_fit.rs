//! Recorded motion prepared for a fit: derivatives, split, suitable configuration.

use crate::configuration::{Config, ConfigError, Precision};
use crate::data::{Dataset, Datasets, RecordingSplit};
use crate::lagrangian::FormulaConstraints;
use crate::names::rounded;
use crate::pipeline::PipelineError;
use crate::pipeline::fit_config::{FitColumns, FitConfig, FitOptions};
use crate::pipeline::fit_constraints::FitHeld;
use crate::pipeline::hold_out::horizons;
use crate::presets::suggested;
use crate::recording::survey::{Survey, SurveyOptions, survey};
use crate::recording::{LoadedRecording, Targets};
use crate::scalar::Scalar;
use std::time::Instant;

/// Recorded motion with its derivatives, split into training, validation and test states.
#[derive(Debug)]
pub struct PreparedFit<'a> {
    /// The recording as it was read.
    pub reading: &'a LoadedRecording,
    pub(crate) options: FitOptions,
    /// The smoothed and split recording.
    pub measured: RecordingSplit,
    pub(crate) targets: Targets,
    /// Constraints on the motion.
    pub(crate) held: Option<FitHeld>,
    /// Remarks on the constraints.
    pub(crate) remarks: Vec<String>,
    /// Start of the work, for the duration in the summary.
    pub started: Instant,
}

impl<'a> PreparedFit<'a> {
    /// Smooths and splits recorded motion; a [`Recording`](crate::recording::Recording) in memory becomes a [`LoadedRecording`] by `into`.
    ///
    /// # Errors
    /// [`PipelineError::Recording`] for motion that cannot be learned from, [`PipelineError::NoAccelerations`] if measured ones are
    /// requested and there are none, [`PipelineError::NoForces`] for forces that not every coordinate has; [`PipelineError::Constraints`]
    /// for constraints that are invalid, contradict each other, or are not obeyed by the motion.
    pub fn new(reading: &'a LoadedRecording, options: &FitOptions) -> Result<Self, PipelineError> {
        let started = Instant::now();
        let measured = RecordingSplit::of_takes(&reading.recording, &reading.takes, &options.preparation())?;
        let targets = options.targets.unwrap_or_else(|| measured.advice());
        if targets == Targets::Measured && !measured.training.recording.has_accelerations() {
            return Err(PipelineError::NoAccelerations);
        }
        if targets == Targets::Forces && !reading.recording.is_driven() {
            return Err(PipelineError::NoForces);
        }
        let (mut held, remarks) = FitHeld::new(options, &measured)?;
        if let Some(held) = &mut held {
            let set = measured.datasets::<f64>(targets)?.training.swap_remove(0);
            held.require_obedience(set, &measured.noise().q)?;
        }
        Ok(Self { reading, options: options.clone(), measured, targets, held, remarks, started })
    }

    /// The constraints on the motion.
    pub(crate) fn constraints(&self) -> Option<&FormulaConstraints> {
        self.held.as_ref().map(|held| &held.constraints)
    }

    /// Training, validation and test states; projected onto the constraints if there are any.
    ///
    /// # Errors
    /// Those of [`RecordingSplit::datasets`]; [`PipelineError::Constraints`] for a state that cannot be projected onto the constraints.
    pub(crate) fn datasets<S: Scalar>(&self) -> Result<Datasets<S>, PipelineError> {
        let Some(held) = &self.held else { return Ok(self.measured.datasets(self.targets)?) };
        let Datasets { training, validation, test } = self.measured.datasets::<f64>(self.targets)?;
        let bring = |set| held.bring(set).map(|(set, _)| set.cast());
        let training = training.into_iter().map(bring).collect::<Result<Vec<Dataset<S>>, _>>()?;
        Ok(Datasets { training, validation: bring(validation)?, test: bring(test)? })
    }

    /// Targets of the training.
    pub fn targets(&self) -> Targets {
        self.targets
    }

    /// Rejects a horizon that contains no sample, or after which there is none.
    ///
    /// # Errors
    /// The range that the held-out motion allows.
    pub fn check_horizon(&self, horizon: Option<f64>) -> Result<(), ConfigError> {
        let (Some(found), Some((least, most))) = (horizon, horizons(&self.measured.test)) else { return Ok(()) };
        // Tolerates a rounding error in the time of the last sample.
        if (least * (1.0 - 1e-9)..=most * (1.0 + 1e-9)).contains(&found) {
            return Ok(());
        }
        let (least, most) = (rounded(least, 6), rounded(most, 6));
        let expected = format!("{least} to {most} s, from a step to the longest trajectory of the held-out motion");
        Err(ConfigError { field: "horizon".to_string(), expected: expected.into(), found: found.to_string() })
    }

    /// Survey of the recorded motion, with warnings of problems for a fit.
    ///
    /// # Errors
    /// [`PipelineError::Smooth`] for motion without derivatives.
    pub fn survey(&self) -> Result<Survey, PipelineError> {
        let FitOptions { held_out: validation, seed, .. } = self.options;
        let smooth = self.options.preparation().smoothing;
        Ok(survey(self.reading, &SurveyOptions { smooth, validation, seed })?)
    }

    /// Suggests a configuration that suits the data, for a system called `name`.
    ///
    /// # Errors
    /// [`PipelineError::Recording`], if no sample has a full window around it for instance.
    pub fn suggest(&self, name: &str, precision: Precision) -> Result<FitConfig, PipelineError> {
        let mut training = Config { seed: self.options.seed, precision, ..self.suggest_training(name, precision)? };
        let shooting = (self.targets == Targets::Motion).then(Default::default);
        if shooting.is_some() {
            shorten(&mut training);
        }
        Ok(self.config(training, None, FitColumns::default(), shooting))
    }

    /// Assembles the configuration of this fit.
    pub fn config(
        &self,
        training: Config,
        horizon: Option<f64>,
        recording: FitColumns,
        shooting: Option<crate::shooting::Shooting>,
    ) -> FitConfig {
        let FitOptions { held_out, window, noise, between, constraints, .. } = self.options.clone();
        FitConfig {
            targets: Some(self.targets),
            held_out,
            window,
            noise,
            horizon,
            between,
            constraints,
            formula: false,
            members: 1,
            recording,
            shooting,
            training,
        }
    }

    /// Suggests a supervised training that suits the data.
    pub fn suggest_training(&self, name: &str, precision: Precision) -> Result<Config, PipelineError> {
        match precision {
            Precision::F32 => self.suggest_in::<f32>(name),
            Precision::F64 => self.suggest_in::<f64>(name),
        }
    }

    fn suggest_in<S: Scalar>(&self, name: &str) -> Result<Config, PipelineError> {
        Ok(suggested(name, &self.datasets::<S>()?))
    }
}

/// Shortens supervised training to a third, for use before multiple shooting.
pub fn shorten(training: &mut Config) {
    let phase = &mut training.phases[0];
    phase.epochs = phase.epochs.div_ceil(3);
    phase.t_max = phase.epochs as f64;
}
