//! From a configuration to a trained network: data, shape, training.

use crate::lagrangian::system::System;
use crate::lagrangian::{Configured, configure_system, find};
use crate::network::{Architecture, Form, NetworkError, NetworkLagrangian};
use crate::scalar::Scalar;
use crate::training::config::{Config, ConfigError, Scaling};
use crate::training::penalty::{Penalty, Regularizer};
use crate::training::sampling::{SamplingError, sample_all};
use crate::training::solver::Hooks;
use crate::training::trainer::{Trained, TrainingError, train};
use std::borrow::Cow;
use thiserror::Error;

/// A trained network with what led to it.
#[derive(Debug)]
pub struct Outcome<S> {
    /// The system it learned from.
    pub system: Configured<f64>,
    /// The network with its best weights.
    pub model: NetworkLagrangian<S>,
    /// History and losses.
    pub trained: Trained<S>,
}

/// Why a configuration gave no network.
#[derive(Debug, Error)]
pub enum RecipeError {
    /// The data could not be made.
    #[error(transparent)]
    Sampling(#[from] SamplingError),
    /// The network could not be made.
    #[error(transparent)]
    Network(#[from] NetworkError),
    /// Training failed.
    #[error(transparent)]
    Training(#[from] TrainingError),
}

impl Config {
    /// The configured system in double precision.
    ///
    /// # Errors
    /// Unknown system or parameter, or a value out of range.
    pub fn system(&self) -> Result<Configured<f64>, SamplingError> {
        let given: Vec<(String, String)> =
            self.parameters.iter().map(|(symbol, value)| (symbol.clone(), value.to_string())).collect();
        Ok(configure_system(self.system_entry()?, &given)?)
    }

    /// The system: the catalogue's entry, or the one of its description.
    ///
    /// # Errors
    /// Unknown system, or a description that is wrong or of another name.
    pub fn system_entry(&self) -> Result<Cow<'static, System>, SamplingError> {
        match &self.description {
            None => Ok(Cow::Borrowed(find(&self.system)?)),
            Some(description) if description.name != self.system => Err(SamplingError::Config(ConfigError {
                field: "description.name".to_string(),
                expected: "the name of the system",
                found: format!("`{}` for `{}`", description.name, self.system),
            })),
            Some(description) => Ok(Cow::Owned(description.system()?)),
        }
    }

    /// The penalty, its time-like coordinate looked up in the system if it names one.
    ///
    /// # Errors
    /// Unknown system or parameter, or a name that is no coordinate of it.
    pub fn penalty(&self) -> Result<Penalty, SamplingError> {
        let coordinates = match self.penalty {
            Regularizer::LorentzianSylvester { .. } => {
                let system = self.system()?;
                system.system.coordinates(system.coordinates)
            }
            _ => Vec::new(),
        };
        Ok(self.penalty.penalty(coordinates.iter().map(|c| c.name.as_ref()))?)
    }

    /// Shape of the network for a system, with physical scales `scale` (used if the configuration scales).
    pub fn architecture(&self, system: &Configured<f64>, scale: Vec<f64>) -> Architecture {
        let coordinates = system.system.coordinates(system.coordinates);
        let names = coordinates.iter().map(|c| c.name.as_ref());
        // A name that is no coordinate is refused where the states are sampled.
        let time_like = self.network.time_like_index(names.clone()).unwrap_or_default();
        let form = self.network.form(names).unwrap_or_default();
        let architecture = self.architecture_with(coordinates.iter().map(|c| c.periodic).collect(), scale);
        Architecture { time_like, form, ..architecture }
    }

    /// Shape of the network for coordinates that are angles or not, with physical scales `scale` (used if the configuration
    /// scales), both of length `n`; without a time-like coordinate, which has to be looked up by its name
    /// ([`Network::time_like_index`](crate::training::Network::time_like_index)).
    pub fn architecture_with(&self, periodic: Vec<bool>, scale: Vec<f64>) -> Architecture {
        let n = periodic.len();
        Architecture {
            coordinates: n,
            hidden: self.network.hidden.clone(),
            activation: self.network.activation,
            alpha: self.network.alpha,
            time_like: None,
            scale: match self.network.scaling {
                Scaling::Physical => scale,
                Scaling::None => vec![1.0; n],
            },
            periodic,
            embed_periodic: self.network.embed_periodic,
            input_layer: self.network.input_layer,
            dissipation: self.network.dissipation,
            form: Form::default(),
        }
    }
}

/// Samples the data, trains, and returns the best network; see [`train`].
///
/// # Errors
/// [`RecipeError`].
pub fn run<S: Scalar>(config: &Config, threads: usize, hooks: &Hooks) -> Result<Outcome<S>, RecipeError> {
    let system = config.system()?;
    let (data, scale) = sample_all::<S>(config, &system)?;
    let architecture = config.architecture(&system, scale);
    let trained = train(config, &architecture, config.penalty()?, data, threads, hooks)?;
    let model = NetworkLagrangian::new(architecture, trained.weights.clone())?;
    Ok(Outcome { system, model, trained })
}
