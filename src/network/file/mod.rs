//! Model files: a network with everything needed to rebuild it, in one safetensors file.
//!
//! Tensors are `layers.K.weight`, shape `(out, in)` row-major, and `layers.K.bias`, shape `(out)`, `K` from 0; the last
//! layer is linear, has one output and no bias. Numbers are `f32` or `f64`, all of one type. The input features are,
//! for every coordinate in order, `sin q_i` and `cos q_i` if the coordinate is periodic and embedded and `q_i/s_i` if it
//! is not, then `v_i/s_i` for every velocity. They are the inputs of layer 0; with the input layer `dyt` those are
//! `gamma_i tanh(alpha x_i) + beta_i` of the features `x_i`, with the tensors `dyt.alpha`, shape `(1)`, `dyt.gamma` and
//! `dyt.beta`, shape `(features)`. The network's output plus `alpha |v/s|^2` is the Lagrangian (`alpha` of the header).
//!
//! The activation `quadratic-softplus` has two such networks, whose outputs add up, with half the widths each: names
//! start with `branches.0.` (softplus) and `branches.1.` (quadratic).
//!
//! The metadata has the one key `lnn`, a JSON object with the fields of [`Header`] and `checksum`: eight hexadecimal
//! digits, the CRC-32 (IEEE) of that JSON text up to the comma before `"checksum"`, followed by the bytes of the tensors.
//! A changed bit anywhere is refused. The same model gives the same bytes.

mod error;
mod header;
mod json;
#[cfg(test)]
mod tests;

pub use error::ModelFileError;
pub use header::{FORMAT, Header, MAX_COORDINATES, MAX_WIDTH, StoredPrecision};

use crate::network::{Architecture, Layout, LinearMap};
use crate::scalar::Scalar;
use crate::storage::{read_regular, write_atomically};
use safetensors::tensor::{Dtype, SafeTensors, TensorView};
use serde::Deserialize;
use std::collections::HashMap;
use std::path::Path;

/// Largest file that is read, in bytes.
pub const MAX_BYTES: u64 = 1 << 30;

/// Largest description that is read, in bytes.
const MAX_HEADER: u64 = 1 << 20;

/// The only metadata key: with two, the order of bytes would change from run to run.
const KEY: &str = "lnn";

/// A network: its description and its flat parameter vector.
///
/// The vector is laid out by [`Layout`]: branch by branch, for every layer the weights, then the biases.
#[derive(Clone, Debug, PartialEq)]
pub struct ModelFile<S> {
    /// Everything but the weights.
    pub header: Header,
    /// Weights and biases.
    pub weights: Vec<S>,
}

/// A tensor of the file: name, shape and place in the flat vector.
struct Slot {
    name: String,
    shape: Vec<usize>,
    range: std::ops::Range<usize>,
}

impl<S: Scalar> ModelFile<S> {
    /// The bytes of the file; weights are rounded to `header.precision` (exact when they came from there).
    ///
    /// # Errors
    /// A header that fails [`Header::validate`], a wrong number of weights, a weight that is not finite.
    pub fn to_bytes(&self) -> Result<Vec<u8>, ModelFileError> {
        self.header.validate()?;
        let slots = slots(&self.header.architecture)?;
        let expected = slots.iter().map(|slot| slot.range.len()).sum();
        if self.weights.len() != expected {
            return Err(ModelFileError::WrongLength { expected, found: self.weights.len() });
        }
        let mut tensors = Vec::with_capacity(slots.len());
        for slot in slots {
            let mut bytes = Vec::with_capacity(slot.range.len() * 8);
            for (index, &x) in self.weights[slot.range].iter().enumerate() {
                let finite = match self.header.precision {
                    StoredPrecision::F32 => {
                        put(&x.cast::<f32>().to_le_bytes(), x.cast::<f32>().is_finite(), &mut bytes)
                    }
                    StoredPrecision::F64 => put(&x.to_f64().to_le_bytes(), x.to_f64().is_finite(), &mut bytes),
                };
                if !finite {
                    return Err(ModelFileError::NotFinite { name: slot.name, index });
                }
            }
            tensors.push((slot.name, slot.shape, bytes));
        }
        // The payload in the file is in safetensors' own order: by name, one number type throughout.
        tensors.sort_by(|a, b| a.0.cmp(&b.0));
        let text = serde_json::to_string(&self.header).map_err(|e| ModelFileError::Header(e.to_string()))?;
        let body = text.strip_suffix('}').unwrap_or(&text);
        let mut checksum = crc32fast::Hasher::new();
        checksum.update(body.as_bytes());
        tensors.iter().for_each(|(_, _, bytes)| checksum.update(bytes));
        let text = format!("{body}{}", checksum_field(checksum.finalize()));

        let dtype = stored_dtype(self.header.precision);
        let damaged = |e: safetensors::SafeTensorError| ModelFileError::NotSafetensors(e.to_string());
        let views = tensors
            .iter()
            .map(|(name, shape, bytes)| Ok((name, TensorView::new(dtype, shape.clone(), bytes)?)))
            .collect::<Result<Vec<_>, _>>()
            .map_err(damaged)?;
        safetensors::serialize(views, Some(HashMap::from([(KEY.to_string(), text)]))).map_err(damaged)
    }

    /// Reads the bytes of a file; never panics and allocates no more than a small multiple of their number.
    ///
    /// Weights are converted to `S`: widening is exact, `f64` weights read as `f32` are rounded to nearest.
    ///
    /// # Errors
    /// [`ModelFileError`] for anything but a whole, undamaged model file of this format.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, ModelFileError> {
        let damaged = |e: safetensors::SafeTensorError| ModelFileError::NotSafetensors(e.to_string());
        check_container(bytes)?;
        let (start, metadata) = SafeTensors::read_metadata(bytes).map_err(damaged)?;
        let text = metadata.metadata().as_ref().and_then(|map| map.get(KEY)).ok_or(ModelFileError::Foreign)?;
        let header = read_header(text, &bytes[8 + start..])?;
        if metadata.metadata().as_ref().is_some_and(|map| map.len() != 1) {
            return Err(ModelFileError::Header("expected \"lnn\" as the only metadata key".to_string()));
        }
        let file = SafeTensors::deserialize(bytes).map_err(damaged)?;
        let slots = slots(&header.architecture)?;
        let mut names = file.names();
        names.sort_unstable();
        if let Some(&extra) = names.iter().find(|&&name| slots.iter().all(|slot| slot.name != name)) {
            return Err(ModelFileError::ExtraTensor(extra.escape_debug().take(60).collect()));
        }
        let mut weights = Vec::with_capacity(bytes.len() / 4);
        for slot in slots {
            let tensor = file.tensor(&slot.name).map_err(|_| ModelFileError::MissingTensor(slot.name.clone()))?;
            read_tensor(&tensor, slot, header.precision, &mut weights)?;
        }
        weights.shrink_to_fit();
        Ok(Self { header, weights })
    }

    /// Writes the file whole or not at all: a temporary file in the same directory, synchronised, then renamed.
    ///
    /// # Errors
    /// As [`ModelFile::to_bytes`], and [`ModelFileError::Write`].
    pub fn save(&self, path: &Path) -> Result<(), ModelFileError> {
        write_atomically(path, &self.to_bytes()?).map_err(ModelFileError::Write)
    }

    /// Reads a regular file of at most [`MAX_BYTES`].
    ///
    /// # Errors
    /// As [`ModelFile::from_bytes`], and [`ModelFileError::Read`].
    pub fn load(path: &Path) -> Result<Self, ModelFileError> {
        Self::from_bytes(&read_regular(path, MAX_BYTES)?)
    }
}

fn put(number: &[u8], finite: bool, bytes: &mut Vec<u8>) -> bool {
    bytes.extend_from_slice(number);
    finite
}

fn stored_dtype(precision: StoredPrecision) -> Dtype {
    match precision {
        StoredPrecision::F32 => Dtype::F32,
        StoredPrecision::F64 => Dtype::F64,
    }
}

fn checksum_field(checksum: u32) -> String {
    format!(",\"checksum\":\"{checksum:08x}\"}}")
}

/// Limits the description before it is parsed, and refuses one that two readers could understand differently.
fn check_container(bytes: &[u8]) -> Result<(), ModelFileError> {
    let refuse = |text: &str| Err(ModelFileError::NotSafetensors(text.to_string()));
    let Some(length) = bytes.first_chunk::<8>().map(|b| u64::from_le_bytes(*b)) else {
        return refuse("shorter than 8 bytes");
    };
    if length > MAX_HEADER {
        return refuse("the description is longer than 1 MiB");
    }
    match bytes[8..].get(..length as usize) {
        None => refuse("cut off"),
        Some(text) => json::check_unambiguous(text).map_err(|e| ModelFileError::NotSafetensors(e.to_string())),
    }
}

/// The description, its version and checksum tested first.
fn read_header(text: &str, payload: &[u8]) -> Result<Header, ModelFileError> {
    /// What every version of the format says.
    #[derive(Deserialize)]
    struct Version {
        format: u32,
        crate_version: String,
    }
    let malformed = |e: serde_json::Error| ModelFileError::Header(e.to_string());
    let version: Version = serde_json::from_str(text).map_err(malformed)?;
    header::check_version(version.format, &version.crate_version)?;

    let missing = || ModelFileError::Header("no checksum".to_string());
    let cut = text.len().checked_sub(checksum_field(0).len()).ok_or_else(missing)?;
    let (body, field) = text.split_at_checked(cut).ok_or_else(missing)?;
    let digits =
        field.strip_prefix(",\"checksum\":\"").and_then(|rest| rest.strip_suffix("\"}")).ok_or_else(missing)?;
    let expected = u32::from_str_radix(digits, 16).map_err(|_| missing())?;
    let mut checksum = crc32fast::Hasher::new();
    checksum.update(body.as_bytes());
    checksum.update(payload);
    let found = checksum.finalize();
    // Comparing the text as well refuses digits written in another way.
    if found != expected || field != checksum_field(expected) {
        return Err(ModelFileError::Checksum { expected, found });
    }
    let body = format!("{body}}}");
    json::check_unambiguous(body.as_bytes()).map_err(malformed)?;
    let header: Header = serde_json::from_str(&body).map_err(malformed)?;
    header.validate()?;
    Ok(header)
}

/// The tensors of an architecture in the order of the flat vector.
fn slots(architecture: &Architecture) -> Result<Vec<Slot>, ModelFileError> {
    // Shapes are only claims until they are compared with the file: multiply them out without overflow first. The
    // branches of a hybrid share the widths and have no more weights than one network.
    let features = 3 * architecture.coordinates;
    let mut inputs = Some(features);
    let mut total = Some(architecture.activation.branches().len() * (1 + 2 * features));
    for &outputs in architecture.hidden.iter().chain(&[1]) {
        let layer = inputs.and_then(|i| i.checked_add(1)).and_then(|i| i.checked_mul(outputs));
        total = total.zip(layer).and_then(|(a, b)| a.checked_add(b));
        inputs = Some(outputs);
    }
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
    Ok(slots)
}

/// Appends the numbers of one tensor.
fn read_tensor<S: Scalar>(
    tensor: &TensorView<'_>,
    slot: Slot,
    precision: StoredPrecision,
    weights: &mut Vec<S>,
) -> Result<(), ModelFileError> {
    let name = slot.name;
    if tensor.dtype() != stored_dtype(precision) {
        let found = format!("{:?}", tensor.dtype()).to_lowercase();
        return Err(ModelFileError::WrongType { name, expected: precision.name(), found });
    }
    if tensor.shape() != slot.shape {
        return Err(ModelFileError::WrongShape { name, expected: slot.shape, found: tensor.shape().to_vec() });
    }
    let first = weights.len();
    match precision {
        StoredPrecision::F32 => {
            let (chunks, _) = tensor.data().as_chunks::<4>();
            weights.extend(chunks.iter().map(|b| S::of_f64(f64::from(f32::from_le_bytes(*b)))));
        }
        StoredPrecision::F64 => {
            let (chunks, _) = tensor.data().as_chunks::<8>();
            weights.extend(chunks.iter().map(|b| S::of_f64(f64::from_le_bytes(*b))));
        }
    }
    match weights[first..].iter().position(|x| !x.is_finite()) {
        Some(index) => Err(ModelFileError::NotFinite { name, index }),
        None => Ok(()),
    }
}
