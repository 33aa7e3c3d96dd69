//! A model file with the network it describes and the system it learned.

use crate::cli::CliError;
use crate::lagrangian::system::Size;
use crate::lagrangian::{Configured, configure, find};
use crate::network::NetworkLagrangian;
use crate::network::file::{Header, ModelFile};
use crate::rollout::Domain;
use crate::scalar::Scalar;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// A trained model.
pub struct Learned<S> {
    /// Header of the file.
    pub header: Header,
    /// The network in the precision of `S`.
    pub network: NetworkLagrangian<S>,
}

/// Name of the model file in the directory of a run.
pub const MODEL: &str = "model.safetensors";

/// The file of a model that is given by its file or by the directory of its run.
///
/// # Errors
/// A data error for a directory without a model.
pub fn model_file(path: &Path) -> Result<PathBuf, CliError> {
    if !path.is_dir() {
        return Ok(path.to_path_buf());
    }
    let file = path.join(MODEL);
    if file.exists() {
        Ok(file)
    } else {
        Err(CliError::file(path, format_args!("there is no {MODEL} in this directory")))
    }
}

impl<S: Scalar> Learned<S> {
    /// Reads a model, by its file or by the directory of its run; weights are converted to the precision of `S`.
    ///
    /// # Errors
    /// A data error for anything but a whole model file.
    pub fn load(path: &Path) -> Result<Self, CliError> {
        let path = &model_file(path)?;
        let ModelFile { header, weights } = ModelFile::load(path).map_err(|e| CliError::file(path, e))?;
        let network =
            NetworkLagrangian::new(header.architecture.clone(), weights).map_err(|e| CliError::file(path, e))?;
        Ok(Self { header, network })
    }

    /// The hand-written system that the model learned.
    ///
    /// # Errors
    /// A data error if it is none of the catalogue's: a system of which there are only recordings.
    pub fn system(&self, path: &Path) -> Result<Configured<f64>, CliError> {
        if find(&self.header.system).is_err() {
            let problem = "is no system of `lnn systems`: there is no exact motion to compare the model with";
            return Err(CliError::file(path, format_args!("{:?}, which it learned, {problem}", self.header.system)));
        }
        let configured =
            configure(&self.header.system, &given(&self.header.parameters)).map_err(|e| CliError::file(path, e))?;
        if configured.system.columns(configured.coordinates) != self.header.columns {
            return Err(CliError::file(path, format_args!("columns are not those of {}", self.header.system)));
        }
        Ok(configured)
    }

    /// The states it was trained on.
    pub fn domain(&self) -> Domain<S> {
        trained_on(&self.header)
    }
}

/// The states a model was trained on; periodic coordinates are unbounded.
pub fn trained_on<S: Scalar>(header: &Header) -> Domain<S> {
    let bound = |&[low, high]: &[f64; 2]| (S::of_f64(low), S::of_f64(high));
    let periodic = &header.architecture.periodic;
    let positions = header.position.iter().zip(periodic).map(|(b, &p)| (!p).then(|| bound(b)));
    Domain::new(positions.chain(header.velocity.iter().map(|b| Some(bound(b)))).collect())
}

/// Values of all parameters of a system, its size among them.
pub fn all_parameters(system: &Configured<f64>) -> BTreeMap<String, f64> {
    let named = system.system.parameters.iter().map(|p| p.symbol.to_string());
    let mut parameters: BTreeMap<_, _> = named.zip(system.parameters.iter().copied()).collect();
    if let Size::Chosen { symbol, .. } = system.system.size {
        parameters.insert(symbol.to_string(), system.coordinates as f64);
    }
    parameters
}

/// Parameters in the form the catalogue takes them.
pub fn given(parameters: &BTreeMap<String, f64>) -> Vec<(String, String)> {
    parameters.iter().map(|(symbol, value)| (symbol.clone(), value.to_string())).collect()
}
