//! Fits a network through its motion, from recorded trajectories and initial weights.

use super::thresholds::{INTEGRATION_ERROR, MEASURED_SEGMENTS};
use crate::configuration::{ConfigError, Penalty};
use crate::data::{Noise, StateEstimate};
use crate::lagrangian::{ConstraintFormulaError, FormulaConstraints, Manifold};
use crate::network::{Architecture, Layout, NetworkError};
use crate::random::RngStream;
use crate::recording::TrajectoryError;
use crate::scalar::Scalar;
use crate::shooting::learner::{ShootingLearner, ShootingProblem};
use crate::shooting::objective::ShootingObjective;
use crate::shooting::segments::Segments;
use crate::shooting::settings::Shooting;
use crate::training::checkpoint::{Clock, PhaseState, Snapshot};
use crate::training::epoch::Epoch;
use crate::training::phase::{Epochs, StopReason, run_epochs};
use crate::training::solver::{CheckpointWriter, EpochSolver, Hooks, Run};
use crate::training::trainer::{ResumeOptions, TrainingError};
use std::sync::Arc;
use thiserror::Error;

/// A network and the recorded motion it is fitted to.
#[derive(Clone, Debug)]
pub struct Task<'a, S> {
    /// Shape of the network.
    pub architecture: &'a Architecture,
    /// Penalty on the mass matrix at the start of every integration step.
    pub penalty: Penalty,
    /// Initial weights, for example those of a supervised training on smoothed accelerations.
    pub weights: Vec<S>,
    /// Trajectories to learn from.
    pub training: &'a [StateEstimate<'a>],
    /// Trajectories that choose the best epoch.
    pub validation: &'a [StateEstimate<'a>],
    /// Noise of the measurements; for noise-free data, the required accuracy.
    pub noise: &'a Noise,
    /// Constraints on the motion.
    pub constraints: Option<&'a FormulaConstraints>,
    /// Seed of the order of segments.
    pub seed: u64,
}

/// A network fitted through its motion.
#[derive(Clone, Debug)]
pub struct Fitted<S> {
    /// Parameters of the best epoch; the initial ones if no epoch was better.
    pub weights: Vec<S>,
    /// One row per epoch; losses are mean squared residuals in units of noise, states are segments.
    pub history: Vec<Epoch>,
    /// Validation loss of the initial parameters.
    pub start_loss: f64,
    /// Best validation loss, 1 where only noise remains.
    pub validation_loss: f64,
    /// Why fitting ended.
    pub stop: StopReason,
    /// Segments of the training trajectories, and their samples.
    pub segments: (usize, usize),
    /// Integration steps per segment.
    pub steps: usize,
    /// Root mean square difference of predictions when steps are halved, in units of noise, for the fitted parameters and the estimated
    /// starts. The number of steps was chosen for the initial parameters: if the error is far above 0.05, use more steps.
    pub integration_error: f64,
    /// Seconds spent.
    pub seconds: f64,
}

/// Why a network could not be fitted.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum ShootingError {
    /// A setting is out of range.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// A trajectory is inconsistent.
    #[error(transparent)]
    RecordedTrajectory(#[from] TrajectoryError),
    /// The architecture is inconsistent or has another number of weights.
    #[error(transparent)]
    Network(#[from] NetworkError),
    /// Estimated states or standard deviations are missing or not finite.
    #[error("{what}: expected {expected}, found {found}")]
    Estimate {
        /// Name of the numbers.
        what: String,
        /// Allowed values.
        expected: String,
        /// The value found.
        found: String,
    },
    /// A segment needs at least two samples that are close together, and there are none.
    #[error("{what}: no trajectory has two samples that follow each other")]
    TooShort {
        /// The trajectories: training or validation.
        what: &'static str,
    },
    /// The constraints have other coordinates than the network.
    #[error(transparent)]
    Constraints(#[from] ConstraintFormulaError),
    /// Training failed.
    #[error(transparent)]
    Training(#[from] TrainingError),
}

fn estimate(what: String, expected: impl ToString, found: impl ToString) -> ShootingError {
    ShootingError::Estimate { what, expected: expected.to_string(), found: found.to_string() }
}

impl<S: Scalar> Task<'_, S> {
    /// Checks every shape and number.
    fn check(&self) -> Result<(), ShootingError> {
        self.architecture.validate()?;
        let n = self.architecture.coordinates;
        // Parameters of other terms may follow those of the network.
        let (expected, found) = (Layout::new(self.architecture).parameters, self.weights.len());
        if found < expected {
            return Err(NetworkError::Weights { expected, found }.into());
        }
        for trajectory in self.training.iter().chain(self.validation) {
            let track = trajectory.track;
            track.validate(n)?;
            for (name, values) in [("positions", trajectory.q), ("velocities", trajectory.v)] {
                let what = || format!("{}: estimated {name}", track.name);
                if values.len() != track.len() * n {
                    return Err(estimate(what(), format!("{} numbers", track.len() * n), values.len()));
                }
                if let Some(at) = values.iter().position(|x| !x.is_finite()) {
                    return Err(estimate(what(), "finite numbers", format!("{} in sample {}", values[at], at / n)));
                }
            }
        }
        let lists = [("positions", &self.noise.q, false), ("velocities", &self.noise.v, true)];
        for (name, sigma, optional) in lists {
            let what = || format!("standard deviations of {name}");
            if sigma.len() != n && !(optional && sigma.is_empty()) {
                return Err(estimate(what(), format!("{n} numbers"), sigma.len()));
            }
            if let Some(bad) = sigma.iter().find(|s| !(s.is_finite() && **s > 0.0)) {
                return Err(estimate(what(), "positive numbers", bad));
            }
        }
        Ok(())
    }

    /// Cuts the trajectories into segments; an error if there are none.
    fn cut(&self, which: &'static str, per_segment: usize, steps: usize) -> Result<Segments<S>, ShootingError> {
        let trajectories = if which == TRAINING { self.training } else { self.validation };
        let segments = Segments::new(self.architecture, trajectories, self.noise, per_segment, steps);
        if segments.is_empty() {
            return Err(ShootingError::TooShort { what: which });
        }
        Ok(match self.manifold()? {
            Some(manifold) => segments.under(self.architecture, manifold),
            None => segments,
        })
    }

    /// The manifold of states that satisfy the constraints.
    fn manifold(&self) -> Result<Option<Arc<dyn Manifold<S>>>, ConstraintFormulaError> {
        let manifold = self.constraints.map(FormulaConstraints::manifold).transpose()?;
        Ok(manifold.map(|manifold| Arc::new(manifold) as _))
    }
}

const TRAINING: &str = "training trajectories";
const VALIDATION: &str = "validation trajectories";

/// Root mean square difference between the predictions of two segmentations of the same trajectories, in units of noise.
fn difference<S: Scalar>(
    shots: &mut ShootingObjective<S>,
    weights: &[S],
    coarse: &Segments<S>,
    fine: &Segments<S>,
) -> f64 {
    let rows = coarse.cross_section(MEASURED_SEGMENTS);
    let mut residuals = |segments: &Segments<S>| shots.residuals(weights, segments, segments.starts(), &rows);
    let (coarse, fine) = (residuals(coarse), residuals(fine));
    let differences = coarse.iter().zip(&fine).map(|(&a, &b)| (a - b).to_f64()).filter(|d| d.is_finite());
    let (square, count) = differences.fold((0.0, 0.0), |(square, count), d| (square + d * d, count + 1.0));
    (square / count).sqrt()
}

/// Fits a network through its motion; see the [module](crate::shooting).
///
/// The same task and seed give the same bytes on any number of `threads`. A segment whose motion is not finite, whose mass
/// matrix is singular or whose state leaves ten times the range of the data is left out of the step and counted in
/// [`Epoch::left_out`].
///
/// # Errors
/// [`ShootingError`]; a fit that was interrupted after its first epoch returns its best.
pub fn fit<S: Scalar>(
    settings: &Shooting,
    task: Task<'_, S>,
    threads: usize,
    hooks: &Hooks,
) -> Result<Fitted<S>, ShootingError> {
    resume(settings, task, threads, hooks, ResumeOptions { checkpoints: None, start: None })
}

/// [`fit`] with checkpoints and resuming: the result equals that of a fit that was never stopped, except for the times.
///
/// `session.start` is the training that gave the task its weights ([`Trained::snapshot`]), or the result of `CheckpointManager::restore`
/// for the same training, task and settings; without it no checkpoint is written.
///
/// # Errors
/// Those of [`fit`]; a checkpoint of other segments.
///
/// [`Trained::snapshot`]: crate::training::Trained::snapshot
pub fn resume<S: Scalar>(
    settings: &Shooting,
    task: Task<'_, S>,
    threads: usize,
    hooks: &Hooks,
    session: ResumeOptions<S>,
) -> Result<Fitted<S>, ShootingError> {
    settings.validate()?;
    task.check()?;
    let per_segment = settings.samples_per_segment;
    let mut shots =
        ShootingObjective::new(task.architecture, task.penalty, (settings.continuity, settings.huber), threads)
            .map_err(TrainingError::from)?;
    if let Some(manifold) = task.manifold()? {
        shots = shots.under(manifold);
    }
    let training = match settings.steps {
        Some(steps) => task.cut(TRAINING, per_segment, steps)?,
        None => fine_enough(&mut shots, &task, per_segment)?,
    };
    let steps = training.steps;
    let validation = task.cut(VALIDATION, per_segment, steps)?;
    let segments = (training.len(), training.samples());
    let problem = ShootingProblem { shots, training, validation };
    let ResumeOptions { checkpoints, start } = session;
    let (writer, in_progress) = match start {
        Some(Snapshot { seconds, outcome, in_progress }) => (
            checkpoints.map(|checkpoints| CheckpointWriter { checkpoints, outcome, seconds: Some(seconds) }),
            in_progress,
        ),
        None => (None, None),
    };
    // Checkpoints count these epochs together with those of the training that provided the weights; the history of the fit does not.
    let epochs_before = writer.as_ref().map_or(0, |writer| writer.outcome.history.len());
    let others = || estimate("checkpoint".to_string(), format!("{} segments", segments.0), "others");
    let mut learner = ShootingLearner::new(&problem, settings.start_share, settings.curvature_every);
    let mut in_progress = in_progress.filter(|in_progress| in_progress.learner.is_some());
    let mut clock = Clock::after(0.0);
    if let Some(PhaseState { optimizer_state, learner: state, .. }) = &mut in_progress
        && let Some(state) = state.take()
    {
        if optimizer_state.order.len() != segments.0 {
            return Err(others());
        }
        let seconds;
        (learner, seconds) = learner.restored(&problem, &state).ok_or_else(others)?;
        clock = Clock::after(seconds);
    }
    let run = Run {
        phase_number: 1,
        epoch: epochs_before,
        epochs_before,
        step: 0,
        steps: None,
        clock,
        hooks: hooks.clone(),
        writer,
    };
    let rng = RngStream::Segments.generator(task.seed);
    let solver = EpochSolver::new(learner, settings.optimizer(), settings.rates(), rng, segments.0).within(run);
    let epochs = run_epochs(solver, problem, task.weights.clone(), in_progress).map_err(TrainingError::Optimizer)?;
    let Epochs { problem, learner, history, best, cost: validation_loss, seconds, stop, .. } = epochs;
    let weights = best.filter(|_| validation_loss.is_finite()).ok_or(TrainingError::NothingLearned(None))?;
    let integration_error = match problem {
        Some(mut problem) => {
            let fine = task.cut(TRAINING, per_segment, 2 * steps)?;
            difference(&mut problem.shots, &weights, &problem.training, &fine)
        }
        None => f64::NAN,
    };
    let start_loss = learner.start_loss;
    Ok(Fitted { weights, history, start_loss, validation_loss, stop, segments, steps, integration_error, seconds })
}

/// Training segments with as few steps as keep the integrator's error far below the noise, for the weights given.
///
/// The number of steps starts at an eighth of the number of samples and is doubled up to eight per sample. Weights that move nothing in
/// range, or differ without bound, get one step per sample.
fn fine_enough<S: Scalar>(
    shots: &mut ShootingObjective<S>,
    task: &Task<'_, S>,
    per_segment: usize,
) -> Result<Segments<S>, ShootingError> {
    let mut coarse = task.cut(TRAINING, per_segment, per_segment.div_ceil(8))?;
    while coarse.steps <= 4 * per_segment {
        let fine = task.cut(TRAINING, per_segment, 2 * coarse.steps)?;
        if difference(shots, &task.weights, &coarse, &fine) <= INTEGRATION_ERROR {
            return Ok(coarse);
        }
        coarse = fine;
    }
    task.cut(TRAINING, per_segment, per_segment)
}
