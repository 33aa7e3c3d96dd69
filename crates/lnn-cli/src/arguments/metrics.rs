//! Metrics that are shown side by side: the exact one of a system, the learned one of a model.

use crate::CliError;
use crate::arguments::learned::{Learned, model_file};
use crate::arguments::source::Source;
use crate::arguments::system_arg;
use lnn::lagrangian::{EulerLagrange, SystemInstance};
use std::path::{Path, PathBuf};

/// Metrics of the same coordinates.
pub struct Metrics {
    /// Name of the system.
    pub system: String,
    /// Names of the coordinates.
    pub coordinates: Vec<String>,
    /// For each coordinate, whether it is a periodic angle; empty if that is not known.
    pub periodic: Vec<bool>,
    /// Unit of the coordinates, if it is known.
    pub unit: Option<String>,
    /// The terms of each, with its name: `exact`, `learned`, or both in this order.
    pub metrics: Vec<(&'static str, Box<dyn EulerLagrange<f64>>)>,
    /// The files that were read.
    pub files: Vec<PathBuf>,
}

impl Metrics {
    /// Reads the metric of a system, by name or by file, with values of its parameters, and that of a model, by its file or by the
    /// directory of its run.
    ///
    /// # Errors
    /// A usage error for an unknown system, a wrong parameter or a system with other columns than the model; a data error for anything
    /// but an intact model file.
    pub fn read(system: Option<&str>, model: Option<&Path>, given: &[(String, String)]) -> Result<Self, CliError> {
        let (mut name, mut columns, mut known, mut metrics) = (String::new(), Vec::new(), None, Vec::new());
        let learned = model.map(Learned::<f64>::load_free).transpose()?;
        if let Some(text) = system {
            let configured = match &learned {
                Some(learned) => learned.beside(text, given)?,
                None => SystemInstance::new(system_arg::system(text)?, given).map_err(CliError::usage)?,
            };
            let source = Source::<f64>::configured(configured.system.clone(), given)?;
            (name, columns) = (configured.system.name.to_string(), source.columns);
            known = Some(configured.system);
            metrics.push(("exact", source.model));
        }
        if let Some(Learned { header, network }) = learned {
            if metrics.is_empty() {
                known = system_arg::learned_system(&header).ok();
            }
            (name, columns) = (header.system, header.columns);
            metrics.push(("learned", Box::new(network)));
        }
        let coordinates = columns[..columns.len() / 2].to_vec();
        let unit = known.as_ref().map(|system| system.time_unit.to_string());
        let periodic = known.map(|system| system.coordinates(coordinates.len()).iter().map(|c| c.periodic).collect());
        let file = system.filter(|text| system_arg::is_file(text)).map(PathBuf::from);
        let files = model.map(model_file).transpose()?.into_iter().chain(file).collect();
        Ok(Self { system: name, periodic: periodic.unwrap_or_default(), coordinates, unit, metrics, files })
    }
}
