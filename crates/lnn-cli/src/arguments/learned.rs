//! A model file with the network it describes and the system it learned.

use crate::CliError;
use crate::arguments::input::is_standard;
use crate::arguments::system_arg::{self, learned_system};
use lnn::lagrangian::{EulerLagrange, System, SystemInstance};
use lnn::network::NetworkLagrangian;
use lnn::network::file::{Header, ModelFile};
use lnn::pipeline::{self, trained_on};
use lnn::rollout::Domain;
use lnn::scalar::Scalar;
use std::path::{Path, PathBuf};

/// A trained model.
pub struct Learned<S> {
    /// Header of the file.
    pub header: Header,
    /// The network in the precision of `S`.
    pub network: NetworkLagrangian<S>,
}

/// The file of a model that is given by its file or by the directory of its run.
///
/// # Errors
/// A data error for a directory without a model, a usage error for standard input.
pub fn model_file(path: &Path) -> Result<PathBuf, CliError> {
    if is_standard(path) {
        return Err(CliError::usage("-: expected a model's file or the directory of a run, not standard input"));
    }
    Ok(pipeline::model_file(path)?)
}

/// Creates the error of a command that does not support constraints.
pub fn held(name: &dyn std::fmt::Display) -> CliError {
    CliError::usage(format_args!("{name}: {}", pipeline::CONSTRAINTS_UNSUPPORTED))
}

impl<S: Scalar> Learned<S> {
    /// Reads a model, by its file or by the directory of its run; weights are converted to the precision of `S`.
    ///
    /// # Errors
    /// A data error for anything but an intact model file.
    pub fn load(path: &Path) -> Result<Self, CliError> {
        let path = &model_file(path)?;
        let ModelFile { header, weights } = ModelFile::load(path).map_err(|e| CliError::file(path, e))?;
        let network =
            NetworkLagrangian::new(header.architecture.clone(), weights).map_err(|e| CliError::file(path, e))?;
        Ok(Self { header, network })
    }

    /// Like [`Learned::load`], for a command that does not support constraints.
    ///
    /// # Errors
    /// As [`Learned::load`]; a usage error for a model under constraints.
    pub fn load_free(path: &Path) -> Result<Self, CliError> {
        let learned = Self::load(path)?;
        if learned.header.is_constrained() {
            return Err(held(&path.display()));
        }
        Ok(learned)
    }

    /// The motion of the model, that of its network under its constraints, and its header.
    ///
    /// # Errors
    /// A data error for constraints that leave no motion.
    pub fn motion(self, path: &Path) -> Result<(Header, Box<dyn EulerLagrange<S>>), CliError> {
        let motion = self.header.constrain(Box::new(self.network)).map_err(|e| CliError::file(path, e))?;
        Ok((self.header, motion))
    }

    /// The system that the model learned, from the catalogue or from its description.
    ///
    /// # Errors
    /// A data error for a system that is known only from recordings.
    pub fn system(&self, path: &Path) -> Result<SystemInstance<f64>, CliError> {
        let known = self.header.description.is_some() || System::named(&self.header.system).is_ok();
        if !known {
            let problem = "is not a built-in system, so that there is no exact motion to compare with; give its file with --system FILE.toml";
            return Err(CliError::file(path, format_args!("{:?}, which it learned, {problem}", self.header.system)));
        }
        let system = learned_system(&self.header).map_err(|e| CliError::file(path, e))?;
        let configured =
            SystemInstance::with_values(system, &self.header.parameters).map_err(|e| CliError::file(path, e))?;
        if configured.system.columns(configured.coordinates) != self.header.columns {
            return Err(CliError::file(path, format_args!("columns are not those of {}", self.header.system)));
        }
        Ok(configured)
    }

    /// Finds a system by name or by file; it must have the model's columns.
    ///
    /// # Errors
    /// A usage error for an unknown system, a wrong parameter, or other columns.
    pub fn beside(&self, name: &str, given: &[(String, String)]) -> Result<SystemInstance<f64>, CliError> {
        let configured = SystemInstance::new(system_arg::system(name)?, given).map_err(CliError::usage)?;
        let columns = configured.system.columns(configured.coordinates);
        if columns != self.header.columns {
            let (found, expected) = (columns.join(","), self.header.columns.join(","));
            return Err(CliError::usage(format_args!(
                "--system {name}: expected the model's columns {expected}, found {found}"
            )));
        }
        Ok(configured)
    }

    /// The states it was trained on.
    pub fn domain(&self) -> Domain<S> {
        trained_on(&self.header)
    }
}
