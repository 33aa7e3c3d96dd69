//! Model files: a network with everything needed to restore it, in one safetensors file.
//!
//! `docs/model-format.md` describes every tensor and every key, and how `L` follows from them. The metadata have one key `lnn`, a JSON
//! object with the fields of [`Header`] and `checksum`: eight hexadecimal digits, the CRC-32 (IEEE) of that JSON text up to the comma
//! before `"checksum"`, followed by the bytes of the tensors. A file with a changed bit is rejected. The same model always gives the same
//! bytes.

pub use crate::storage::container::StoredPrecision;

use crate::lagrangian::{Description, EulerLagrange, ExpressionConstraints, FormulaConstraints, SystemInstance};
use crate::network::{Architecture, DissipationLayout, Layout, LinearMap};
use crate::scalar::Scalar;
use crate::storage::container::{ContainerError, FileKind, Tensor, check_version, pack, unpack};
use crate::storage::{Disk, Files, read_regular, write_whole};
use serde::{Deserialize, Serialize};
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::path::Path;

/// The error of a model file.
pub type ModelFileError = ContainerError;

/// Size of the largest file that is read, in bytes.
pub(crate) const MAX_BYTES: u64 = 1 << 30;

/// Identification of a model file.
const MODEL: FileKind = FileKind { name: "model", key: "lnn", format: Header::FORMAT };

/// A network: its description and its flat parameter vector.
///
/// The vector is laid out by [`Layout`]: branch by branch, for every layer the weights, then the biases; then the
/// dissipation.
#[derive(Clone, Debug, PartialEq)]
pub struct ModelFile<S> {
    /// Everything except the weights.
    pub header: Header,
    /// Weights and biases.
    pub weights: Vec<S>,
}

/// A tensor of the file: name, shape and position in the flat vector.
struct Slot {
    name: String,
    shape: Vec<usize>,
    range: std::ops::Range<usize>,
}

impl<S: Scalar> ModelFile<S> {
    /// Returns the bytes of the file; weights are rounded to `header.precision` (exactly, if they were read with that precision).
    ///
    /// # Errors
    /// The header is inconsistent, the number of weights is wrong, or a weight is not finite.
    pub fn to_bytes(&self) -> Result<Vec<u8>, ModelFileError> {
        self.header.validate()?;
        let slots = slots(&self.header.architecture)?;
        let expected = slots.iter().map(|slot| slot.range.len()).sum();
        if self.weights.len() != expected {
            return Err(ModelFileError::WrongLength { expected, found: self.weights.len() });
        }
        let precision = self.header.precision;
        let mut tensors = Vec::with_capacity(slots.len());
        for Slot { name, shape, range } in slots {
            let numbers = &self.weights[range];
            let finite = |x: &S| match precision {
                StoredPrecision::F32 => x.cast::<f32>().is_finite(),
                StoredPrecision::F64 => x.to_f64().is_finite(),
            };
            if let Some(index) = numbers.iter().position(|x| !finite(x)) {
                return Err(ModelFileError::NotFinite { name, index });
            }
            tensors.push(Tensor::new(name, shape, numbers, precision));
        }
        pack(&MODEL, &self.header, tensors)
    }

    /// Parses the bytes of a file; never panics and allocates at most a small multiple of their number.
    ///
    /// Weights are converted to `S`: widening is exact, `f64` weights read as `f32` are rounded to nearest.
    ///
    /// # Errors
    /// [`ModelFileError`] for anything except an intact model file of this format.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, ModelFileError> {
        let (header, file) = unpack::<Header>(&MODEL, bytes)?;
        header.validate()?;
        let slots = slots(&header.architecture)?;
        file.check_names(|name| slots.iter().any(|slot| slot.name == name))?;
        let mut weights = Vec::with_capacity(bytes.len() / 4);
        for slot in slots {
            let first = weights.len();
            weights.extend(file.numbers::<S>(&slot.name, &slot.shape, header.precision)?);
            if let Some(index) = weights[first..].iter().position(|x| !x.is_finite()) {
                return Err(ModelFileError::NotFinite { name: slot.name, index });
            }
        }
        weights.shrink_to_fit();
        Ok(Self { header, weights })
    }

    /// Writes the file atomically: to a temporary file in the same directory, which is synchronised and then renamed.
    ///
    /// # Errors
    /// Those of [`ModelFile::to_bytes`], and [`ModelFileError::Write`].
    pub fn save(&self, path: &Path) -> Result<(), ModelFileError> {
        self.save_to(&Disk, path)
    }

    /// Does the same as [`ModelFile::save`] with the file operations `files`.
    ///
    /// # Errors
    /// Those of [`ModelFile::save`].
    #[doc(hidden)]
    pub fn save_to(&self, files: &dyn Files, path: &Path) -> Result<(), ModelFileError> {
        write_whole(files, path, &self.to_bytes()?).map_err(ModelFileError::Write)
    }

    /// Reads a regular file of at most 1 GiB.
    ///
    /// # Errors
    /// Those of [`ModelFile::from_bytes`], and [`ModelFileError::Read`].
    pub fn load(path: &Path) -> Result<Self, ModelFileError> {
        Self::from_bytes(&read_regular(path, MAX_BYTES)?)
    }
}

/// Returns the tensors of an architecture in the order of the flat vector.
fn slots(architecture: &Architecture) -> Result<Vec<Slot>, ModelFileError> {
    // The shapes are not checked against the file yet, so compute their products without overflow first. The branches of a hybrid share the
    // widths and have at most as many weights as one network.
    let features = 3 * architecture.coordinates;
    let mut inputs = Some(features);
    let mut total = Some(architecture.activation.branches().len() * (1 + 2 * features));
    for &outputs in architecture.hidden.iter().chain(&[architecture.outputs()]) {
        let layer = inputs.and_then(|i| i.checked_add(1)).and_then(|i| i.checked_mul(outputs));
        total = total.zip(layer).and_then(|(a, b)| a.checked_add(b));
        inputs = Some(outputs);
    }
    let units = architecture.dissipation.unwrap_or(0);
    total = total.zip(units.checked_mul(1 + features)).and_then(|(a, b)| a.checked_add(b));
    if total.is_none_or(|total| total as u64 > MAX_BYTES) {
        return Err(ModelFileError::Header("hidden: more weights than a file may hold".to_string()));
    }
    let layout = Layout::new(architecture);
    let mut slots = Vec::new();
    for (b, branch) in layout.branches.iter().enumerate() {
        let prefix = if layout.branches.len() > 1 { format!("branches.{b}.") } else { String::new() };
        let mut dense = 0;
        for layer in &branch.layers {
            let (weight, shape, bias) = match layer.map {
                LinearMap::Scalar => ("dyt.alpha".to_string(), vec![1], String::new()),
                LinearMap::Diagonal => ("dyt.gamma".to_string(), vec![layer.outputs], "dyt.beta".to_string()),
                LinearMap::Dense => {
                    dense += 1;
                    let name = |part: &str| format!("layers.{}.{part}", dense - 1);
                    (name("weight"), vec![layer.outputs, layer.inputs], name("bias"))
                }
            };
            slots.push(Slot { name: format!("{prefix}{weight}"), shape, range: layer.weight_range() });
            if layer.bias.is_some() {
                let (name, shape) = (format!("{prefix}{bias}"), vec![layer.outputs]);
                slots.push(Slot { name, shape, range: layer.bias_range() });
            }
        }
    }
    if let Some(dissipation) = layout.dissipation {
        let DissipationLayout { units, features, coordinates, .. } = dissipation;
        let mut push =
            |part: &str, shape, range| slots.push(Slot { name: format!("dissipation.{part}"), shape, range });
        push("gamma", vec![units], dissipation.gamma_range());
        push("weight", vec![units, features], dissipation.weight_range());
        push("direction", vec![units, coordinates], dissipation.direction_range());
    }
    if let Some((name, initial)) = architecture.own_constants() {
        slots.push(Slot { name: name.to_string(), shape: vec![initial.len()], range: layout.constants });
    }
    if !layout.joint_friction.is_empty() {
        let shape = vec![architecture.form.joint_friction.rows(), architecture.coordinates];
        slots.push(Slot { name: "joint_friction".to_string(), shape, range: layout.joint_friction });
    }
    if !layout.known.is_empty() {
        slots.push(Slot { name: "known".to_string(), shape: vec![layout.known.len()], range: layout.known });
    }
    Ok(slots)
}

/// Largest number of coordinates of a model; the memory of an evaluation grows with its square, unlike that of a file.
pub const MAX_COORDINATES: usize = 256;

/// Largest width of a hidden layer.
pub const MAX_WIDTH: usize = 1 << 16;

/// Everything needed to restore a model except its weights.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Header {
    /// Format of the file, [`Header::FORMAT`].
    pub format: u32,
    /// Version of the crate that wrote it.
    pub crate_version: String,
    /// Shape of the network, scales and periodic coordinates.
    pub architecture: Architecture,
    /// Name of the system that was learned: one of the catalogue, or any text for a recorded system.
    pub system: String,
    /// The system itself, if a file describes it; it has this name.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub description: Option<Description>,
    /// Values of all parameters of that system, in their units; empty for a recorded system.
    pub parameters: BTreeMap<String, f64>,
    /// Names of the components of a state: coordinates, then velocities.
    pub columns: Vec<String>,
    /// Names of the columns of the known external forces in the training data, one per coordinate; empty if there were none.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub forces: Vec<String>,
    /// Formulas that vanish along the motion, by name, in terms of coordinates and velocities: constraints found in the training motion, or
    /// given with it. Empty if there are none, or if they belong to the description.
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
    /// Validation loss of these weights, as defined in the paper.
    pub validation_loss: f64,
}

impl Header {
    /// Format that this version writes and reads.
    pub const FORMAT: u32 = 1;

    /// Checks that lengths match, numbers are finite and sizes are within the limits.
    ///
    /// # Errors
    /// [`ContainerError::Header`] or [`ContainerError::Version`].
    pub(crate) fn validate(&self) -> Result<(), ContainerError> {
        check_version(Self::FORMAT, self.format, &self.crate_version)?;
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

    /// Returns the formulas of the constraints, if these do not come from a description.
    fn formulas(&self) -> Result<Option<FormulaConstraints>, ContainerError> {
        if self.constraints.is_empty() {
            return Ok(None);
        }
        let coordinates = &self.columns[..self.columns.len() / 2];
        let compiled = FormulaConstraints::new(coordinates, self.constraints.clone());
        compiled.map(Some).map_err(|error| ContainerError::Header(error.to_string()))
    }

    /// Returns `true` if the motion has constraints.
    pub fn is_constrained(&self) -> bool {
        !self.held_by().is_empty()
    }

    /// Returns the constraints of the motion, formulas by name; in those of a description, parameters and definitions are inserted.
    pub fn held_by(&self) -> &BTreeMap<String, String> {
        match &self.description {
            Some(description) if self.constraints.is_empty() => &description.constraints,
            _ => &self.constraints,
        }
    }

    /// Applies the constraints of the training motion to the network.
    ///
    /// # Errors
    /// [`ContainerError::Header`] if the constraints contradict each other or leave no motion, or the network has other coordinates.
    pub fn constrain<'a, S: Scalar>(
        &self,
        network: Box<dyn EulerLagrange<S> + 'a>,
    ) -> Result<Box<dyn EulerLagrange<S> + 'a>, ContainerError> {
        if let Some(constraints) = self.formulas()? {
            return constraints.constrain(network).map_err(wrong);
        }
        match self.holding()? {
            None => Ok(network),
            Some(system) => system.constrain(network).map_err(wrong),
        }
    }

    /// Returns the described system whose constraints apply to the motion.
    fn holding<S: Scalar>(&self) -> Result<Option<SystemInstance<S>>, ContainerError> {
        let described = self.description.as_ref().filter(|description| !description.constraints.is_empty());
        let Some(description) = described else { return Ok(None) };
        let system = description.system().map_err(|error| wrong(format_args!("description.{error}")))?;
        SystemInstance::with_values(Cow::Owned(system), &self.parameters).map(Some).map_err(wrong)
    }

    /// Returns the constraints of the motion as functions of the state, with the values of their parameters; `None` if it is free. Those of
    /// a description may depend on each other.
    ///
    /// # Errors
    /// [`ContainerError::Header`] if formulas or parameters are invalid.
    #[doc(hidden)]
    pub fn constraints(&self) -> Result<Option<(ExpressionConstraints, Vec<f64>)>, ContainerError> {
        if let Some(formulas) = self.formulas()? {
            return Ok(Some((formulas.compiled().clone(), Vec::new())));
        }
        let system = self.holding::<f64>()?;
        Ok(system.and_then(|system| Some((system.constraints()?.clone(), system.parameters))))
    }
}

fn wrong(error: impl std::fmt::Display) -> ContainerError {
    ContainerError::Header(error.to_string())
}

#[cfg(test)]
mod tests;
