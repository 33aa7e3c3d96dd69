//! Header of a model file.

use crate::lagrangian::Description;
use crate::network::Architecture;
use crate::storage::container::{ContainerError, StoredPrecision, check_version};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Format that this version writes and reads.
pub const FORMAT: u32 = 1;

/// Most coordinates of a model: the memory of an evaluation grows with their square, that of a file does not.
pub const MAX_COORDINATES: usize = 256;

/// Largest width of a hidden layer.
pub const MAX_WIDTH: usize = 1 << 16;

/// Everything needed to rebuild a model but its weights.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Header {
    /// Format of the file, [`FORMAT`].
    pub format: u32,
    /// Version of the crate that wrote it.
    pub crate_version: String,
    /// Shape of the network, scales and periodic coordinates.
    pub architecture: Architecture,
    /// Name of the system it learned: one of the catalogue, or any text for a system that was only recorded.
    pub system: String,
    /// The system itself, if it is described by a file; it has this name.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub description: Option<Description>,
    /// Values of all parameters of that system, in their units; empty for one that was only recorded.
    pub parameters: BTreeMap<String, f64>,
    /// Names of the components of a state: coordinates, then velocities.
    pub columns: Vec<String>,
    /// Names of the columns of the known external forces it was learned with, one per coordinate; empty if there were none.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub forces: Vec<String>,
    /// Number type of the weights.
    pub precision: StoredPrecision,
    /// Bounds of each coordinate in training, in physical units.
    pub position: Vec<[f64; 2]>,
    /// Bounds of each velocity in training, in physical units.
    pub velocity: Vec<[f64; 2]>,
    /// Seed of the training.
    pub seed: u64,
    /// Validation loss of these weights, paper convention.
    pub validation_loss: f64,
}

impl Header {
    /// Checks that lengths agree, numbers are finite and sizes are sensible.
    ///
    /// # Errors
    /// [`ContainerError::Header`] or [`ContainerError::Version`].
    pub(crate) fn validate(&self) -> Result<(), ContainerError> {
        check_version(FORMAT, self.format, &self.crate_version)?;
        let require = |ok: bool, text: &str| if ok { Ok(()) } else { Err(ContainerError::Header(text.to_string())) };
        self.architecture.validate().map_err(|e| ContainerError::Header(e.to_string()))?;
        let (n, hidden) = (self.architecture.coordinates, &self.architecture.hidden);
        require(n <= MAX_COORDINATES, &format!("coordinates: expected at most {MAX_COORDINATES}"))?;
        require(hidden.len() <= 64, "hidden: expected at most 64 widths")?;
        require(hidden.iter().all(|w| *w <= MAX_WIDTH), &format!("hidden: expected widths of at most {MAX_WIDTH}"))?;
        let units = self.architecture.dissipation.unwrap_or(1);
        require(units <= MAX_WIDTH, &format!("dissipation: expected at most {MAX_WIDTH} units"))?;
        let named = self.description.as_ref().is_none_or(|description| description.name == self.system);
        require(named, "description: expected the name of the system")?;
        require(self.columns.len() == 2 * n, "columns: expected two per coordinate")?;
        let distinct: std::collections::BTreeSet<_> = self.columns.iter().collect();
        require(distinct.len() == 2 * n, "columns: expected distinct names")?;
        require([0, n].contains(&self.forces.len()), "forces: expected one name per coordinate or none")?;
        require(self.parameters.values().all(|x| x.is_finite()), "parameters: expected finite numbers")?;
        for (bounds, text) in [(&self.position, "position"), (&self.velocity, "velocity")] {
            let ordered = bounds.iter().all(|&[low, high]| low.is_finite() && high.is_finite() && low <= high);
            require(bounds.len() == n && ordered, &format!("{text}: expected one finite [low, high] per coordinate"))?;
        }
        require(self.validation_loss.is_finite(), "validation_loss: expected a finite number")
    }
}
