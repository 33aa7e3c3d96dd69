//! Header of a model file.

use crate::lagrangian::{Description, EulerLagrange, FormulaConstraints, configure_values};
use crate::network::Architecture;
use crate::scalar::Scalar;
use crate::storage::container::{ContainerError, StoredPrecision, check_version};
use serde::{Deserialize, Serialize};
use std::borrow::Cow;
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
    /// Formulas that vanish along the motion, by name, over coordinates and velocities: constraints that were found in the motion it was
    /// learned from, or given with it. Empty if there were none, and where the constraints are those of the description.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub constraints: BTreeMap<String, String>,
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
        let described = self.description.as_ref().is_some_and(|description| !description.constraints.is_empty());
        require(
            !described || self.constraints.is_empty(),
            "constraints: expected none beside those of the description",
        )?;
        self.formulas()?;
        require(self.parameters.values().all(|x| x.is_finite()), "parameters: expected finite numbers")?;
        for (bounds, text) in [(&self.position, "position"), (&self.velocity, "velocity")] {
            let ordered = bounds.iter().all(|&[low, high]| low.is_finite() && high.is_finite() && low <= high);
            require(bounds.len() == n && ordered, &format!("{text}: expected one finite [low, high] per coordinate"))?;
        }
        require(self.validation_loss.is_finite(), "validation_loss: expected a finite number")
    }

    /// The formulas that hold the motion, if they are not those of a description.
    fn formulas(&self) -> Result<Option<FormulaConstraints>, ContainerError> {
        if self.constraints.is_empty() {
            return Ok(None);
        }
        let coordinates = &self.columns[..self.columns.len() / 2];
        let compiled = FormulaConstraints::new(coordinates, self.constraints.clone());
        compiled.map(Some).map_err(|error| ContainerError::Header(error.to_string()))
    }

    /// `true` if constraints hold the motion.
    pub fn is_constrained(&self) -> bool {
        !self.held_by().is_empty()
    }

    /// The constraints that hold the motion, formulas by name; those of a description have its parameters and definitions in them.
    pub fn held_by(&self) -> &BTreeMap<String, String> {
        match &self.description {
            Some(description) if self.constraints.is_empty() => &description.constraints,
            _ => &self.constraints,
        }
    }

    /// The motion of the model: that of its network, under the constraints that it was learned under.
    ///
    /// # Errors
    /// [`ContainerError::Header`] for constraints that contradict each other or leave no motion, or a network of other coordinates.
    pub fn constrain<'a, S: Scalar>(
        &self,
        network: Box<dyn EulerLagrange<S> + 'a>,
    ) -> Result<Box<dyn EulerLagrange<S> + 'a>, ContainerError> {
        fn wrong(error: impl std::fmt::Display) -> ContainerError {
            ContainerError::Header(error.to_string())
        }
        if let Some(constraints) = self.formulas()? {
            return constraints.constrain(network).map_err(wrong);
        }
        match self.description.as_ref().filter(|description| !description.constraints.is_empty()) {
            None => Ok(network),
            Some(description) => {
                let system = description.system().map_err(|error| wrong(format_args!("description.{error}")))?;
                let system = configure_values::<S>(Cow::Owned(system), &self.parameters).map_err(wrong)?;
                system.constrain(network).map_err(wrong)
            }
        }
    }
}
