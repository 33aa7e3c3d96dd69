//! Trains a network by a configuration: data, shape, training.

use crate::configuration::Config;
use crate::data::{Datasets, SamplingError};
use crate::lagrangian::SystemInstance;
use crate::network::{NetworkError, NetworkLagrangian};
use crate::scalar::Scalar;
use crate::training::solver::Hooks;
use crate::training::trainer::{Trained, TrainingError, train};
use thiserror::Error;

/// A trained network with its system and history.
#[derive(Debug)]
pub struct TrainingResult<S> {
    /// The system it learned from.
    pub system: SystemInstance<f64>,
    /// The network with its best weights.
    pub model: NetworkLagrangian<S>,
    /// History and losses.
    pub trained: Trained<S>,
}

/// Why a configuration could not be trained.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum RecipeError {
    /// The data could not be sampled.
    #[error(transparent)]
    Sampling(#[from] SamplingError),
    /// The network could not be built.
    #[error(transparent)]
    Network(#[from] NetworkError),
    /// Training failed.
    #[error(transparent)]
    Training(#[from] TrainingError),
}

/// Samples the data, trains, and returns the best network; see [`train`].
///
/// # Errors
/// [`RecipeError`].
pub fn run<S: Scalar>(config: &Config, threads: usize, hooks: &Hooks) -> Result<TrainingResult<S>, RecipeError> {
    let system = config.system()?;
    let (data, scale) = Datasets::<S>::sample(config, &system)?;
    let architecture = config.architecture(&system, scale).map_err(SamplingError::Config)?;
    let trained = train(config, &architecture, config.penalty()?, data, threads, hooks)?;
    let model = NetworkLagrangian::new(architecture, trained.weights.clone())?;
    Ok(TrainingResult { system, model, trained })
}
