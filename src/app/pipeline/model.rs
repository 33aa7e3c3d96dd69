//! Model files of runs: their location, the states they were trained on, and the parameters of their systems.

use crate::lagrangian::SystemInstance;
use crate::lagrangian::system::Size;
use crate::network::file::Header;
use crate::pipeline::{MODEL, PipelineError};
use crate::rollout::Domain;
use crate::scalar::Scalar;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Message of commands that only support free coordinates, for motion under constraints.
pub const CONSTRAINTS_UNSUPPORTED: &str =
    "the motion has constraints, which this command does not support; see `lnn constraints`";

/// Finds a model file, given its path or the directory of its run.
///
/// # Errors
/// [`PipelineError::NoModel`] for a directory without a model.
pub fn model_file(path: &Path) -> Result<PathBuf, PipelineError> {
    if !path.is_dir() {
        return Ok(path.to_path_buf());
    }
    let file = path.join(MODEL);
    if file.exists() { Ok(file) } else { Err(PipelineError::NoModel(path.to_path_buf())) }
}

/// The states a model was trained on; periodic coordinates are unbounded.
pub fn trained_on<S: Scalar>(header: &Header) -> Domain<S> {
    let bound = |&[low, high]: &[f64; 2]| (S::of_f64(low), S::of_f64(high));
    let periodic = &header.architecture.periodic;
    let positions = header.position.iter().zip(periodic).map(|(b, &p)| (!p).then(|| bound(b)));
    Domain::new(positions.chain(header.velocity.iter().map(|b| Some(bound(b)))).collect())
}

/// Values of all parameters of a system, including its size.
pub fn all_parameters(system: &SystemInstance<f64>) -> BTreeMap<String, f64> {
    let named = system.system.parameters.iter().map(|p| p.symbol.to_string());
    let mut parameters: BTreeMap<_, _> = named.zip(system.parameters.iter().copied()).collect();
    if let Size::Chosen { symbol, layout, .. } = system.system.size {
        parameters.insert(symbol.to_string(), layout.chosen(system.coordinates) as f64);
    }
    parameters
}
