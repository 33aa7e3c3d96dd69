//! The source of Euler-Lagrange terms: an analytical system or a trained model.

use crate::CliError;
use crate::arguments::learned::Learned;
use crate::arguments::{forces, system_arg};
use crate::terminal::output;
use lnn::lagrangian::system::System;
use lnn::lagrangian::{EulerLagrange, SystemInstance};
use lnn::pipeline::usual_force;
use lnn::scalar::Scalar;
use std::borrow::Cow;
use std::path::{Path, PathBuf};

/// Builds a value from a system, given by its name or file and the values of its parameters.
type FromSystem<T> = fn(&str, &[(String, String)]) -> Result<T, CliError>;

/// A Lagrangian with the names of its state's components.
pub struct Source<S> {
    /// Its terms.
    pub model: Box<dyn EulerLagrange<S>>,
    /// Coordinates, then velocities.
    pub columns: Vec<String>,
    /// Names of the external forces, one per coordinate.
    pub forces: Vec<String>,
}

impl<S: Scalar> Source<S> {
    /// A system by name or by file; its parameters, defaults included, are read in the precision of `S`.
    ///
    /// # Errors
    /// A usage error for an unknown name, a mistake in a file or a wrong parameter.
    pub fn system(name: &str, given: &[(String, String)]) -> Result<Self, CliError> {
        Self::configured(system_arg::system(name)?, given)
    }

    /// A system; its parameters, defaults included, are read in the precision of `S`.
    ///
    /// # Errors
    /// A usage error for a wrong parameter.
    pub fn configured(system: Cow<'static, System>, given: &[(String, String)]) -> Result<Self, CliError> {
        let configured = SystemInstance::<S>::new(system, given).map_err(CliError::usage)?;
        if let Some(input) = configured.inputs().next() {
            let problem = "depend on the input";
            return Err(CliError::usage(format_args!(
                "the forces of {} {problem} {input}: roll its motion out, or identify its constants",
                configured.system.name
            )));
        }
        Self::of(&configured)
    }

    /// A system with values of its parameters.
    ///
    /// # Errors
    /// A usage error for constraints that leave no motion.
    pub fn of(configured: &SystemInstance<S>) -> Result<Self, CliError> {
        let model = configured.build().map_err(CliError::usage)?;
        for name in model.manifold().map_or(&[][..], |manifold| manifold.redundant()) {
            output::note(&format!("the constraint `{name}` follows from the others and is left out"));
        }
        let columns = configured.system.columns(configured.coordinates);
        let forces = columns[..configured.coordinates].iter().map(|name| usual_force(name)).collect();
        Ok(Self { model, columns, forces })
    }

    /// A trained model; its weights are converted to the precision of `S`.
    ///
    /// # Errors
    /// A data error for a file that is not an intact model file, or whose constraints leave no motion.
    pub fn model(path: &Path) -> Result<Self, CliError> {
        let (header, model) = Learned::load(path)?.motion(path)?;
        let forces = forces::names(&header);
        Ok(Self { model, columns: header.columns, forces })
    }
}

/// Rejects more coordinates than a command supports, because its memory or time grows with a power of their number.
///
/// # Errors
/// A usage error with the numbers.
pub fn require_at_most(most: usize, found: usize) -> Result<(), CliError> {
    match found <= most {
        true => Ok(()),
        false => Err(CliError::usage(format_args!("expected at most {most} coordinates, found {found}"))),
    }
}

/// A system or a trained model, as arguments.
#[derive(Debug, clap::Args)]
pub struct SystemOrModel {
    /// A system by name (`lnn systems` lists them), or by the file that describes it.
    #[arg(long, value_name = "NAME|FILE", required_unless_present = "model", conflicts_with = "model")]
    pub system: Option<String>,
    /// A trained model, a file or the directory of a run.
    #[arg(long, value_name = "MODEL")]
    pub model: Option<PathBuf>,
    /// A parameter of the system, decimal text read in the working precision; may be repeated.
    #[arg(long, value_name = "SYMBOL=VALUE", num_args = 1.., value_parser = parameter, conflicts_with = "model")]
    pub param: Vec<(String, String)>,
}

impl SystemOrModel {
    /// Reads the system or the model that was given.
    ///
    /// # Errors
    /// Those of its reader.
    pub fn read<T>(&self, model: fn(&Path) -> Result<T, CliError>, system: FromSystem<T>) -> Result<T, CliError> {
        match &self.model {
            Some(path) => model(path),
            None => system(self.system.as_deref().unwrap_or_default(), &self.param),
        }
    }
}

/// Parses `symbol=value`.
pub fn parameter(text: &str) -> Result<(String, String), String> {
    match text.split_once('=') {
        Some((symbol, value)) if !symbol.trim().is_empty() && !value.trim().is_empty() => {
            Ok((symbol.trim().to_string(), value.trim().to_string()))
        }
        _ => Err("expected SYMBOL=VALUE".to_string()),
    }
}
