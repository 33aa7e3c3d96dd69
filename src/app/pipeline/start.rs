//! Training that starts from a model: the configuration adopts the model's shape, and any other shape is rejected.

use crate::configuration::{Config, Known, Precision, Scaling};
use crate::network::Architecture;
use crate::network::file::{Header, ModelFile, StoredPrecision};
use crate::pipeline::{PipelineError, model_file};
use crate::scalar::Scalar;
use serde_json::Value;
use std::path::Path;

/// The header of a model to start from, which fixes the shape of a training.
pub struct StartModel {
    /// The path as the user gave it.
    pub from: String,
    /// Header of its file.
    pub header: Header,
}

impl StartModel {
    /// Reads a model, given its file or the directory of its run.
    ///
    /// # Errors
    /// [`PipelineError::NoModel`] and [`PipelineError::Model`] for anything but an intact model file.
    pub fn read(from: &str) -> Result<Self, PipelineError> {
        let path = model_file(Path::new(from))?;
        let loaded = ModelFile::<f64>::load(&path);
        let ModelFile { header, .. } = loaded.map_err(|source| PipelineError::Model { path, source })?;
        Ok(Self { from: from.to_string(), header })
    }

    /// Sets the model's shape and precision in a configuration.
    pub fn shape(&self, config: &mut Config) {
        let model = &self.header.architecture;
        let network = &mut config.network;
        network.hidden.clone_from(&model.hidden);
        (network.activation, network.alpha) = (model.activation, model.alpha);
        (network.embed_periodic, network.input_layer) = (model.embed_periodic, model.input_layer);
        network.dissipation = model.dissipation;
        network.time_like = model.time_like.and_then(|i| self.header.columns.get(i).cloned());
        let name = |i: &usize| self.header.columns.get(*i).cloned();
        (network.structure, network.cyclic) =
            (model.form.structure, model.form.cyclic.iter().filter_map(name).collect());
        network.factor = model.form.factor;
        network.joint_friction = model.form.joint_friction;
        network.radial =
            model.form.radial.iter().map(|group| group.coordinates.iter().filter_map(name).collect()).collect();
        network.radial_unit = model.form.radial.first().map(|group| group.unit);
        (network.even_in_v, network.learn_alpha) = (model.form.even_in_v, model.form.learn_alpha);
        network.known = model.form.known.clone().map(Known::Description);
        let scaled = model.scale.iter().any(|scale| *scale != 1.0);
        network.scaling = if scaled { Scaling::Physical } else { Scaling::None };
        config.precision = match self.header.precision {
            StoredPrecision::F32 => Precision::F32,
            StoredPrecision::F64 => Precision::F64,
        };
        config.from = Some(self.from.clone());
    }

    /// Rejects a configuration whose network has another shape than the model; `periodic` marks angles.
    ///
    /// # Errors
    /// [`PipelineError::OtherShape`] naming everything that differs.
    pub fn require(&self, config: &Config, periodic: Vec<bool>) -> Result<(), PipelineError> {
        let columns = self.header.columns.iter().take(periodic.len()).map(String::as_str);
        let mut asked = config.architecture_with(columns, periodic, self.header.architecture.scale.clone())?;
        asked.form.sizes.clone_from(&self.header.architecture.form.sizes);
        let found = differences(&asked, &self.header.architecture);
        if found.is_empty() {
            return Ok(());
        }
        let place = format!("--from {}", self.from);
        Err(PipelineError::OtherShape { place, differences: found, configuration: true })
    }
}

/// Weights and scales of a model that a training starts from; its architecture must have been checked.
///
/// # Errors
/// A model that cannot be read, or has since changed its shape.
pub(crate) fn weights<S: Scalar>(
    from: &str,
    asked: impl FnOnce(Vec<f64>) -> Architecture,
) -> Result<(Vec<S>, Architecture), PipelineError> {
    let path = model_file(Path::new(from))?;
    let loaded = ModelFile::load(&path);
    let ModelFile { header, weights } = loaded.map_err(|source| PipelineError::Model { path: path.clone(), source })?;
    let mut asked = asked(header.architecture.scale.clone());
    asked.form.sizes.clone_from(&header.architecture.form.sizes);
    let differences = differences(&asked, &header.architecture);
    if differences.is_empty() {
        return Ok((weights, asked));
    }
    Err(PipelineError::OtherShape { place: path.display().to_string(), differences, configuration: false })
}

/// Differences between the requested shape and that of a model.
fn differences(asked: &Architecture, model: &Architecture) -> Vec<String> {
    let fields = |shape: &Architecture| serde_json::to_value(shape).unwrap_or_default();
    let (asked, model) = (fields(asked), fields(model));
    let names = |value: &Value| value.as_object().map(|o| o.keys().cloned().collect::<Vec<_>>()).unwrap_or_default();
    let mut all = [names(&asked), names(&model)].concat();
    all.sort_unstable();
    all.dedup();
    let shown = |value: &Value| if value.is_null() { "none".to_string() } else { value.to_string() };
    let differing = all.iter().filter(|name| asked[name.as_str()] != model[name.as_str()]);
    differing
        .map(|name| format!("{name} {} requested, {} in the model", shown(&asked[name]), shown(&model[name])))
        .collect()
}
