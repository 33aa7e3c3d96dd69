//! System, penalty, network shape and model file header for a configuration.

use crate::configuration::{Config, ConfigError, Penalty, Precision};
use crate::data::sampling::SamplingError;
use crate::lagrangian::system::System;
use crate::lagrangian::{SystemInstance, resolve};
use crate::network::Architecture;
use crate::network::file::{Header, StoredPrecision};
use std::borrow::Cow;
use std::collections::BTreeMap;

impl Config {
    /// The configured system in double precision.
    ///
    /// # Errors
    /// Unknown system or parameter, or a value out of range.
    pub fn system(&self) -> Result<SystemInstance<f64>, SamplingError> {
        Ok(SystemInstance::with_values(self.system_entry()?, &self.parameters)?)
    }

    /// The system: the catalogue entry, or the one that the configuration describes.
    ///
    /// # Errors
    /// Unknown system, or a description that is wrong or of another name.
    pub fn system_entry(&self) -> Result<Cow<'static, System>, SamplingError> {
        match &self.description {
            None => Ok(resolve(&self.system)?),
            Some(description) if description.name != self.system => Err(SamplingError::Config(ConfigError {
                field: "description.name".to_string(),
                expected: "the name of the system".into(),
                found: format!("`{}` for `{}`", description.name, self.system),
            })),
            Some(description) => Ok(Cow::Owned(description.system()?)),
        }
    }

    /// The penalty, its time-like coordinate looked up in the system if it names one.
    ///
    /// # Errors
    /// Unknown system or parameter, or a name that is not a coordinate of it.
    pub fn penalty(&self) -> Result<Penalty, SamplingError> {
        let coordinates = if self.penalty.time().is_some() {
            let system = self.system()?;
            system.system.coordinates(system.coordinates)
        } else {
            Vec::new()
        };
        Ok(self.penalty.resolve(coordinates.iter().map(|c| c.name.as_ref()))?)
    }

    /// Shape of the network for a system, with physical scales `scale` (used if the configuration scales).
    ///
    /// # Errors
    /// A name in the configuration that is not a coordinate of the system.
    pub fn architecture(&self, system: &SystemInstance<f64>, scale: Vec<f64>) -> Result<Architecture, ConfigError> {
        let coordinates = system.system.coordinates(system.coordinates);
        let names = coordinates.iter().map(|c| c.name.as_ref());
        self.architecture_with(names, coordinates.iter().map(|c| c.periodic).collect(), scale)
    }

    /// Shape of the network for coordinates with these names. `periodic` marks angles; `scale` are the physical scales, used if the
    /// configuration scales. Both have length `n`.
    ///
    /// # Errors
    /// A name in the configuration that is not one of them.
    pub fn architecture_with<'a>(
        &self,
        names: impl Iterator<Item = &'a str> + Clone,
        periodic: Vec<bool>,
        scale: Vec<f64>,
    ) -> Result<Architecture, ConfigError> {
        let n = periodic.len();
        Ok(Architecture {
            coordinates: n,
            hidden: self.network.hidden.clone(),
            activation: self.network.activation,
            alpha: self.network.alpha,
            time_like: self.network.time_like_index(names.clone())?,
            scale: self.network.scaling.of(scale),
            periodic,
            embed_periodic: self.network.embed_periodic,
            input_layer: self.network.input_layer,
            dissipation: self.network.dissipation,
            form: self.network.form(names)?,
        })
    }

    /// Header of the file of a model that was learned by this configuration from states within `ranges`, of coordinates and of
    /// velocities. It has no parameters of a system, no known forces, no constraints and no description.
    pub(crate) fn header(
        &self,
        architecture: Architecture,
        columns: Vec<String>,
        [position, velocity]: [Vec<[f64; 2]>; 2],
        validation_loss: f64,
    ) -> Header {
        Header {
            format: Header::FORMAT,
            crate_version: env!("CARGO_PKG_VERSION").to_string(),
            architecture,
            system: self.system.clone(),
            parameters: BTreeMap::new(),
            columns,
            forces: Vec::new(),
            constraints: BTreeMap::new(),
            description: None,
            precision: match self.precision {
                Precision::F32 => StoredPrecision::F32,
                Precision::F64 => StoredPrecision::F64,
            },
            position,
            velocity,
            seed: self.seed,
            validation_loss,
        }
    }
}
